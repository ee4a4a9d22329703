//! Textures: the operands of samples, and loads, stores, atomics and queries. The filters themselves are the library's.

use gfx::format::Format;
use gfx::state::{Aspect, ViewDimension};
use gfx::texel;
use gfx::texture::{Lod, Sample, Sampler, View};
use naga::{AtomicFunction, Expression, Handle, ImageDimension, ImageQuery, SampleLevel, ScalarKind, TypeInner};
use num::{Lanes, Words};

use super::expressions::texel_kind;
use super::machine::{Invocation, World};
use super::memory::atomic_result;
use super::value::{Number, Value, broken};
use super::{Fault, Resource, Texture};

/// The level that a sample asks for.
#[derive(Clone, Copy, Debug)]
pub enum Level {
    Auto,
    Bias(f32),
    Zero,
    Exact(f32),
    Gradient([f32; 3], [f32; 3]),
}

/// The operands of a sample or gather.
#[derive(Clone, Debug)]
pub struct SampleArguments {
    texture: ((u32, u32), u32),
    sampler: ((u32, u32), u32),
    coordinates: [f32; 3],
    /// Clamped to those that there are.
    layer: Option<u32>,
    offset: [i32; 3],
    level: Level,
    reference: Option<f32>,
    /// The component that is gathered.
    gather: Option<u32>,
    clamp_to_edge: bool,
    kind: ScalarKind,
    /// Only the first component counts.
    single: bool,
}

/// The numbers of a texel.
fn texel_value(kind: ScalarKind, bits: [u32; 4], single: bool) -> Result<Value, Fault> {
    let scalar = naga::Scalar { kind, width: 4 };
    let numbers = bits.map(|b| Number::from_bits(scalar, b));
    let [a, b, c, d] = numbers;
    if single { Ok(Value::Number(a?)) } else { Ok(Value::vector(&[a?, b?, c?, d?])) }
}

/// Up to three numbers; missing ones are zero.
fn three<T: Copy + Default>(from: impl IntoIterator<Item = T>) -> [T; 3] {
    let mut out = [T::default(); 3];
    for (place, x) in out.iter_mut().zip(from) {
        *place = x;
    }
    out
}

/// Layers of what is bound: of an array of cubes, cubes.
fn layers(texture: &Texture) -> u32 {
    match texture.range.dimension {
        ViewDimension::D3 => 1,
        ViewDimension::Cube | ViewDimension::CubeArray => texture.range.layers / 6,
        _ => texture.range.layers,
    }
}

/// Width, height and depth or layers of a level of what is bound.
fn size(texture: &Texture, level: u32) -> Option<[u32; 3]> {
    if level >= texture.range.levels {
        return None;
    }
    let [w, h, d] = texture.desc.level_size(texture.range.base_level + level);
    Some([w, h, if texture.range.dimension == ViewDimension::D3 { d } else { texture.range.layers }])
}

/// The first byte of a texel of what is bound (of a compressed texture: of its block); none outside of it.
fn place(texture: &Texture, [x, y, z]: [u32; 3], level: u32, sample: u32) -> Option<usize> {
    let [w, h, d] = size(texture, level)?;
    if x >= w || y >= h || z >= d || sample >= texture.desc.samples {
        return None;
    }
    let (desc, level) = (&texture.desc, texture.range.base_level + level);
    let slice = if texture.range.dimension == ViewDimension::D3 { z } else { texture.range.base_layer + z };
    let block = desc.format.block_dim();
    let at = desc.offset(level, slice)
        + u64::from(y / block) * desc.row_bytes(level)
        + u64::from(x / block) * desc.texel_bytes()
        + u64::from(sample * desc.format.block_bytes());
    let end = at as usize + desc.format.block_bytes() as usize;
    (end <= texture.bytes.len()).then_some(at as usize)
}

/// The bits of a texel; zeros outside of what is bound.
fn read(texture: &Texture, [x, y, z]: [u32; 3], level: u32, sample: u32) -> [u32; 4] {
    let Some(at) = place(texture, [x, y, z], level, sample) else { return [0; 4] };
    let stored = texture.desc.format;
    let bytes = &texture.bytes[at..];
    if texture.range.aspect == Aspect::StencilOnly || texture.range.format == Format::Stencil8 {
        return [u32::from(texel::stencil_value(stored, bytes)), 0, 0, 1];
    }
    let format = if stored.is_depth_stencil() { stored } else { texture.range.format };
    if format.is_compressed() {
        return texel::decode_block(format, bytes)[(y % 4 * 4 + x % 4) as usize];
    }
    texel::decode(format, bytes)
}

impl World<'_> {
    /// A texture that is bound.
    fn texture(&self, (binding, element): ((u32, u32), u32)) -> Option<&Texture> {
        match self.resource(binding, element)? {
            Resource::Texture(texture) => Some(texture),
            _ => None,
        }
    }

    /// Samples for one of several pixels; implicit levels come from the first four of them, a quad.
    pub fn sample(&mut self, all: &[&SampleArguments], pixel: usize) -> Result<Value, Fault> {
        let own = all[pixel];
        let nothing = texel_value(own.kind, [0; 4], own.single);
        let Some(texture) = self.texture(own.texture) else { return nothing };
        let extent = size(texture, 0).unwrap_or([1; 3]);
        let Some(Resource::Sampler(desc)) = self.resource(own.sampler.0, own.sampler.1) else { return nothing };
        let sampler = Sampler::new(desc);
        let view = match self.views.get(&own.texture) {
            Some(view) => view,
            None => {
                let words = Words::new(texture.bytes.len() as u64);
                words.write(0, &texture.bytes);
                let view = View::new(&words, &texture.desc, &texture.range, 0);
                let view = view.map_err(|error| Fault::Unsupported(format!("a texture view: {error}")))?;
                self.views.entry(own.texture).or_insert(view)
            }
        };
        // The pixels as the first lanes of a batch.
        let lanes = |f: &dyn Fn(&SampleArguments) -> u32| {
            let mut out = Lanes::ZERO;
            for (lane, arguments) in all.iter().enumerate() {
                out.0[lane] = f(arguments);
            }
            out
        };
        let coordinate = |axis: usize| {
            lanes(&|a| {
                let x = a.coordinates[axis];
                // Half a texel inside of the edges.
                let half = 0.5 / extent[axis] as f32;
                if a.clamp_to_edge && axis < 2 { x.clamp(half, 1.0 - half) } else { x }.to_bits()
            })
        };
        let coordinates = [coordinate(0), coordinate(1), coordinate(2)];
        let number = lanes(&|a| match a.level {
            Level::Bias(x) | Level::Exact(x) => x.to_bits(),
            _ => 0,
        });
        let gradient = |which: usize, axis: usize| {
            lanes(&|a| match a.level {
                Level::Gradient(x, y) => [x, y][which][axis].to_bits(),
                _ => 0,
            })
        };
        let (dx, dy) = ([0, 1, 2].map(|axis| gradient(0, axis)), [0, 1, 2].map(|axis| gradient(1, axis)));
        let layer = own.layer.map(|_| lanes(&|a| a.layer.unwrap_or(0)));
        let compare = own.reference.map(|_| lanes(&|a| a.reference.unwrap_or(0.0).to_bits()));
        let lod = match own.level {
            Level::Auto => Lod::Auto,
            Level::Bias(_) => Lod::Bias(&number),
            Level::Zero => Lod::Zero,
            Level::Exact(_) => Lod::Level(&number),
            Level::Gradient(..) => Lod::Gradient { dx: dx.each_ref(), dy: dy.each_ref() },
        };
        let arguments = Sample {
            coords: coordinates.each_ref(),
            layer: layer.as_ref(),
            offset: own.offset,
            lod,
            compare: compare.as_ref(),
        };
        let mut out = [Lanes::ZERO; 4];
        match own.gather {
            Some(component) => view.gather(&sampler, &arguments, component, 1 << pixel, &mut out),
            None => view.sample(&sampler, &arguments, 1 << pixel, &mut out),
        }
        texel_value(own.kind, out.each_ref().map(|o| o.0[pixel]), own.single)
    }
}

impl<'a> Invocation<'a> {
    fn resource(&mut self, world: &mut World<'a>, h: Handle<Expression>) -> Result<((u32, u32), u32), Fault> {
        match self.evaluate(world, h)? {
            Value::Resource(binding, element) => Ok((binding, element)),
            _ => broken("a texture or sampler was expected"),
        }
    }

    /// The kind of an image's texels, and whether they are depths.
    fn kind_of(&mut self, world: &World<'a>, image: Handle<Expression>) -> Result<(ScalarKind, bool), Fault> {
        match *self.type_of(world, image)? {
            TypeInner::Image { class, .. } => texel_kind(class),
            _ => broken("a texture was expected"),
        }
    }

    /// Evaluates the operands of a sample.
    pub fn sample_of(&mut self, world: &mut World<'a>, h: Handle<Expression>) -> Result<SampleArguments, Fault> {
        let Expression::ImageSample {
            image,
            sampler,
            gather,
            coordinate,
            array_index,
            offset,
            level,
            depth_ref,
            clamp_to_edge,
        } = self.frame()?.function.expressions[h]
        else {
            return broken("a sample was expected");
        };
        let texture = self.resource(world, image)?;
        let sampler = self.resource(world, sampler)?;
        let (kind, depth) = self.kind_of(world, image)?;
        let coordinates = three(self.evaluate(world, coordinate)?.floats()?);
        let layer = match array_index {
            None => None,
            Some(h) => {
                let last = world.texture(texture).map_or(0, |t| layers(t).saturating_sub(1));
                Some(match self.evaluate(world, h)?.number()? {
                    Number::Sint(x) => (x.max(0) as u32).min(last),
                    Number::Uint(x) => x.min(last),
                    _ => return broken("a layer that is no integer"),
                })
            }
        };
        let mut number = |h: Handle<Expression>| {
            Ok(match self.evaluate(world, h)?.number()? {
                Number::Float(x) | Number::Half(x) => x,
                // The level of a depth texture is an integer.
                Number::Sint(x) => x as f32,
                Number::Uint(x) => x as f32,
                Number::Bool(_) => return broken("a level that is no number"),
            })
        };
        let reference = depth_ref.map(&mut number).transpose()?;
        let level = match level {
            SampleLevel::Auto => Level::Auto,
            SampleLevel::Zero => Level::Zero,
            SampleLevel::Exact(h) => Level::Exact(number(h)?),
            SampleLevel::Bias(h) => Level::Bias(number(h)?),
            SampleLevel::Gradient { x, y } => {
                Level::Gradient(three(self.evaluate(world, x)?.floats()?), three(self.evaluate(world, y)?.floats()?))
            }
        };
        let offset = match offset {
            Some(h) => three(self.evaluate(world, h)?.numbers()?.iter().map(|n| n.bits() as i32)),
            None => [0; 3],
        };
        Ok(SampleArguments {
            texture,
            sampler,
            coordinates,
            layer,
            offset,
            level,
            reference,
            gather: gather.map(|c| c as u32),
            clamp_to_edge,
            kind,
            single: gather.is_none() && (depth || depth_ref.is_some()),
        })
    }

    /// A sample that needs no other invocation.
    pub fn image_sample(&mut self, world: &mut World<'a>, h: Handle<Expression>) -> Result<Value, Fault> {
        let arguments = self.sample_of(world, h)?;
        world.sample(&[&arguments], 0)
    }

    /// Column, row, and slice or layer.
    fn texel_at(
        &mut self,
        world: &mut World<'a>,
        coordinate: Handle<Expression>,
        array_index: Option<Handle<Expression>>,
    ) -> Result<[u32; 3], Fault> {
        let mut at = three(self.evaluate(world, coordinate)?.numbers()?.iter().map(|n| n.bits()));
        if let Some(h) = array_index {
            at[2] = self.evaluate(world, h)?.integer()?;
        }
        Ok(at)
    }

    pub fn image_load(&mut self, world: &mut World<'a>, h: Handle<Expression>) -> Result<Value, Fault> {
        let Expression::ImageLoad { image, coordinate, array_index, sample, level } = self.frame()?.function.expressions[h]
        else {
            return broken("a load was expected");
        };
        let texture = self.resource(world, image)?;
        let (kind, depth) = self.kind_of(world, image)?;
        let at = self.texel_at(world, coordinate, array_index)?;
        let mut integer = |h: Option<Handle<Expression>>| h.map_or(Ok(0), |h| self.evaluate(world, h)?.integer());
        let (sample, level) = (integer(sample)?, integer(level)?);
        let bits = world.texture(texture).map_or([0; 4], |t| read(t, at, level, sample));
        texel_value(kind, bits, depth)
    }

    pub fn image_store(
        &mut self,
        world: &mut World<'a>,
        image: Handle<Expression>,
        coordinate: Handle<Expression>,
        array_index: Option<Handle<Expression>>,
        value: Handle<Expression>,
    ) -> Result<(), Fault> {
        let (binding, element) = self.resource(world, image)?;
        let at = self.texel_at(world, coordinate, array_index)?;
        let mut bits = [0; 4];
        for (bits, n) in bits.iter_mut().zip(self.evaluate(world, value)?.numbers()?) {
            *bits = n.bits();
        }
        if !self.has_effects() {
            return Ok(());
        }
        if let Some(Resource::Texture(texture)) = world.resource_mut(binding, element)
            && let Some(first) = place(texture, at, 0, 0)
        {
            let format = texture.desc.format;
            let bytes = texel::encode(format, bits);
            let n = format.block_bytes() as usize;
            texture.bytes[first..first + n].copy_from_slice(&bytes[..n]);
        }
        Ok(())
    }

    pub fn image_atomic(
        &mut self,
        world: &mut World<'a>,
        image: Handle<Expression>,
        coordinate: Handle<Expression>,
        array_index: Option<Handle<Expression>>,
        fun: AtomicFunction,
        value: Handle<Expression>,
    ) -> Result<(), Fault> {
        let (binding, element) = self.resource(world, image)?;
        let at = self.texel_at(world, coordinate, array_index)?;
        let value = self.evaluate(world, value)?.number()?;
        if !self.has_effects() {
            return Ok(());
        }
        if let Some(Resource::Texture(texture)) = world.resource_mut(binding, element)
            && let Some(first) = place(texture, at, 0, 0)
            && let Some(word) = texture.bytes.get_mut(first..first + 4)
        {
            let bits = u32::from_le_bytes([word[0], word[1], word[2], word[3]]);
            let old = match value {
                Number::Sint(_) => Number::Sint(bits as i32),
                Number::Uint(_) => Number::Uint(bits),
                _ => return broken("an atomic of texels that are no integers"),
            };
            word.copy_from_slice(&atomic_result(fun, old, value, None)?.bits().to_le_bytes());
        }
        Ok(())
    }

    pub fn image_query(&mut self, world: &mut World<'a>, image: Handle<Expression>, query: ImageQuery) -> Result<Value, Fault> {
        let TypeInner::Image { dim, .. } = *self.type_of(world, image)? else {
            return broken("a texture was expected");
        };
        let texture = self.resource(world, image)?;
        let level = match query {
            ImageQuery::Size { level: Some(h) } => self.evaluate(world, h)?.integer()?,
            _ => 0,
        };
        // What is not bound has no size.
        let Some(texture) = world.texture(texture) else { return Ok(query_value(query, dim, [0; 3])) };
        Ok(match query {
            ImageQuery::Size { .. } => query_value(query, dim, size(texture, level).unwrap_or([0; 3])),
            ImageQuery::NumLevels => query_value(query, dim, [texture.range.levels; 3]),
            ImageQuery::NumLayers => query_value(query, dim, [layers(texture); 3]),
            ImageQuery::NumSamples => query_value(query, dim, [texture.desc.samples; 3]),
        })
    }
}

/// The answer to a query: as many numbers as the dimension has, or one.
fn query_value(query: ImageQuery, dim: ImageDimension, numbers: [u32; 3]) -> Value {
    let n = match (query, dim) {
        (ImageQuery::Size { .. }, ImageDimension::D2 | ImageDimension::Cube) => 2,
        (ImageQuery::Size { .. }, ImageDimension::D3) => 3,
        _ => 1,
    };
    Value::of_numbers(&numbers.map(Number::Uint)[..n])
}
