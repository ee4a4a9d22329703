//! Textures: sampling, loads, stores, queries.

use naga::{
    AtomicFunction, Expression, GlobalVariable, Handle, ImageClass, ImageDimension, ImageQuery, SampleLevel, ScalarKind,
    StorageFormat, SwizzleComponent, TypeInner,
};

use super::{Lowerer, Result, Val};
use crate::code::Code;
use crate::interface::{BindingKind, SampleKind};
use crate::ir::{NONE, V, texture_src as at};
use crate::program::{Level, NO_REG, TextureAction, TextureOp};
use gfx::format::Format;
use gfx::state::ViewDimension;

/// The type of an image.
#[derive(Clone, Copy)]
pub(crate) struct Image {
    pub dim: ImageDimension,
    pub arrayed: bool,
    pub class: ImageClass,
}

impl Image {
    /// Number of coordinates.
    fn coordinates(self) -> usize {
        match self.dim {
            ImageDimension::D1 => 1,
            ImageDimension::D2 => 2,
            ImageDimension::D3 | ImageDimension::Cube => 3,
        }
    }

    fn view(self) -> Option<ViewDimension> {
        Some(match (self.dim, self.arrayed) {
            (ImageDimension::D1, false) => ViewDimension::D1,
            (ImageDimension::D2, false) => ViewDimension::D2,
            (ImageDimension::D2, true) => ViewDimension::D2Array,
            (ImageDimension::D3, false) => ViewDimension::D3,
            (ImageDimension::Cube, false) => ViewDimension::Cube,
            (ImageDimension::Cube, true) => ViewDimension::CubeArray,
            _ => return None,
        })
    }

    /// What the binding is.
    pub fn kind(self) -> std::result::Result<BindingKind, &'static str> {
        let dimension = self.view().ok_or("arrays of 1D or 3D textures are not supported")?;
        Ok(match self.class {
            ImageClass::Sampled { kind, multi } => BindingKind::Texture {
                dimension,
                multisampled: multi,
                sample: match kind {
                    ScalarKind::Sint => SampleKind::Sint,
                    ScalarKind::Uint => SampleKind::Uint,
                    _ => SampleKind::Float,
                },
            },
            ImageClass::Depth { multi } => BindingKind::Texture { dimension, multisampled: multi, sample: SampleKind::Depth },
            ImageClass::External => return Err("external textures are not supported"),
            ImageClass::Storage { format, access } => BindingKind::StorageTexture {
                dimension,
                format: storage_format(format),
                readable: access.contains(naga::StorageAccess::LOAD),
                writable: access.contains(naga::StorageAccess::STORE),
                atomic: access.contains(naga::StorageAccess::ATOMIC),
            },
        })
    }
}

/// Our name of a storage texture's format.
fn storage_format(f: StorageFormat) -> Format {
    macro_rules! same {
        ($($name:ident)*) => { match f { $(StorageFormat::$name => Format::$name,)* } };
    }
    same! {
        R8Unorm R8Snorm R8Uint R8Sint R16Uint R16Sint R16Float Rg8Unorm Rg8Snorm Rg8Uint Rg8Sint R32Uint R32Sint R32Float
        Rg16Uint Rg16Sint Rg16Float Rgba8Unorm Rgba8Snorm Rgba8Uint Rgba8Sint Bgra8Unorm Rgb10a2Uint Rgb10a2Unorm
        Rg11b10Ufloat R64Uint Rg32Uint Rg32Sint Rg32Float Rgba16Uint Rgba16Sint Rgba16Float Rgba32Uint Rgba32Sint
        Rgba32Float R16Unorm R16Snorm Rg16Unorm Rg16Snorm Rgba16Unorm Rgba16Snorm
    }
}

const EMPTY: TextureOp = TextureOp {
    action: TextureAction::Load,
    texture: u16::MAX,
    texture_element: NO_REG,
    sampler: u16::MAX,
    sampler_element: NO_REG,
    data: [NO_REG; 4],
    coordinate: [NO_REG; 3],
    layer: NO_REG,
    unsigned_layer: false,
    sample: NO_REG,
    level: NO_REG,
    gradient_x: [NO_REG; 3],
    gradient_y: [NO_REG; 3],
    reference: NO_REG,
    offset: [0; 3],
    clamp_to_edge: false,
};

impl<'a> Lowerer<'a> {
    /// The global behind a texture or sampler expression, the element of its binding array, and its binding.
    fn opaque(&mut self, h: Handle<Expression>) -> Result<(Handle<GlobalVariable>, Option<V>, u16)> {
        let Val::Opaque(g, element) = self.eval(h)? else {
            return self.refuse("not a texture or sampler");
        };
        match self.bindings.get(&g) {
            Some(&b) => Ok((g, element, b)),
            None => self.refuse("a texture or sampler without a binding"),
        }
    }

    fn image(&self, h: Handle<Expression>) -> Result<Image> {
        match *self.inner(h) {
            TypeInner::Image { dim, arrayed, class } => Ok(Image { dim, arrayed, class }),
            _ => self.refuse("not a texture"),
        }
    }

    /// Begins a texture instruction: its entry and operands so far.
    fn texture_op(&mut self, image: Handle<Expression>, action: TextureAction) -> Result<(TextureOp, Vec<V>)> {
        let (_, element, binding) = self.opaque(image)?;
        let mut src = vec![NONE; at::COUNT];
        src[at::ELEMENT] = element.unwrap_or(NONE);
        Ok((TextureOp { action, texture: binding, ..EMPTY }, src))
    }

    fn emit_texture(&mut self, op: TextureOp, src: &[V], code: Code, results: usize) -> V {
        self.b.textures.push(op);
        let entry = (self.b.textures.len() - 1) as u32;
        self.b.ops(code, src, entry, results, false)
    }

    fn place_components(&mut self, src: &mut [V], first: usize, h: Handle<Expression>) -> Result<()> {
        let d = self.data(h)?;
        src[first..first + d.len()].copy_from_slice(&d);
        Ok(())
    }

    fn array_layer(&mut self, src: &mut [V], array_index: Option<Handle<Expression>>) -> Result<()> {
        if let Some(h) = array_index {
            src[at::LAYER] = self.scalar(h)?;
        }
        Ok(())
    }

    pub fn image_sample(&mut self, h: Handle<Expression>) -> Result<Val> {
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
        } = self.frame().function.expressions[h]
        else {
            return self.refuse("not a sample");
        };
        let shape = self.image(image)?;
        let action = match gather {
            Some(c) => TextureAction::Gather(match c {
                SwizzleComponent::X => 0,
                SwizzleComponent::Y => 1,
                SwizzleComponent::Z => 2,
                SwizzleComponent::W => 3,
            }),
            None => TextureAction::Sample(match level {
                SampleLevel::Auto => Level::Auto,
                SampleLevel::Zero => Level::Zero,
                SampleLevel::Exact(_) => Level::Exact,
                SampleLevel::Bias(_) => Level::Bias,
                SampleLevel::Gradient { .. } => Level::Gradient,
            }),
        };
        let (mut op, mut src) = self.texture_op(image, action)?;
        let (_, element, binding) = self.opaque(sampler)?;
        op.sampler = binding;
        op.clamp_to_edge = clamp_to_edge;
        src[at::SAMPLER_ELEMENT] = element.unwrap_or(NONE);
        self.place_components(&mut src, at::COORDINATE, coordinate)?;
        self.array_layer(&mut src, array_index)?;
        if let Some(h) = array_index {
            op.unsigned_layer = self.scalar_of(h)?.kind == ScalarKind::Uint;
        }
        match level {
            SampleLevel::Auto | SampleLevel::Bias(_) if gather.is_none() => self.flags.derivatives = true,
            _ => {}
        }
        match level {
            SampleLevel::Exact(l) | SampleLevel::Bias(l) => {
                let v = self.scalar(l)?;
                // The level of a depth texture is an integer.
                let integer = !matches!(self.scalar_of(l)?.kind, ScalarKind::Float);
                let signed = self.scalar_of(l)?.kind == ScalarKind::Sint;
                let convert = if signed { Code::SToF } else { Code::UToF };
                src[at::LEVEL] = if integer { self.b.op(convert, &[v]) } else { v };
            }
            SampleLevel::Gradient { x, y } => {
                self.place_components(&mut src, at::GRADIENT_X, x)?;
                self.place_components(&mut src, at::GRADIENT_Y, y)?;
            }
            SampleLevel::Auto | SampleLevel::Zero => {}
        }
        if let Some(r) = depth_ref {
            src[at::REFERENCE] = self.scalar(r)?;
        }
        if let Some(o) = offset {
            let d = self.data(o)?;
            for (k, &v) in d.iter().enumerate() {
                match self.b.known(v).map(|bits| bits as i32) {
                    Some(i) if (-128..128).contains(&i) => op.offset[k] = i as i8,
                    _ => return self.refuse("a texture offset must be a small constant"),
                }
            }
        }
        let four = gather.is_some() || !(depth_ref.is_some() || matches!(shape.class, ImageClass::Depth { .. }));
        let n = if four { 4 } else { 1 };
        let v = self.emit_texture(op, &src, Code::Texture, n);
        Ok(Val::Data((v..v + n as V).collect()))
    }

    pub fn image_load(
        &mut self,
        image: Handle<Expression>,
        coordinate: Handle<Expression>,
        array_index: Option<Handle<Expression>>,
        sample: Option<Handle<Expression>>,
        level: Option<Handle<Expression>>,
    ) -> Result<Val> {
        let shape = self.image(image)?;
        let (op, mut src) = self.texture_op(image, TextureAction::Load)?;
        self.place_components(&mut src, at::COORDINATE, coordinate)?;
        self.array_layer(&mut src, array_index)?;
        if let Some(h) = sample {
            src[at::SAMPLE] = self.scalar(h)?;
        }
        if let Some(h) = level {
            src[at::LEVEL] = self.scalar(h)?;
        }
        let n = if matches!(shape.class, ImageClass::Depth { .. }) { 1 } else { 4 };
        let v = self.emit_texture(op, &src, Code::Texture, n);
        Ok(Val::Data((v..v + n as V).collect()))
    }

    pub fn image_store(
        &mut self,
        image: Handle<Expression>,
        coordinate: Handle<Expression>,
        array_index: Option<Handle<Expression>>,
        value: Handle<Expression>,
    ) -> Result<()> {
        let (op, mut src) = self.texture_op(image, TextureAction::Store)?;
        self.place_components(&mut src, at::COORDINATE, coordinate)?;
        self.array_layer(&mut src, array_index)?;
        self.place_components(&mut src, at::DATA, value)?;
        self.flags.side_effects = true;
        self.written_bindings[usize::from(op.texture)] = true;
        self.emit_texture(op, &src, Code::TextureStore, 0);
        Ok(())
    }

    pub fn image_atomic(
        &mut self,
        image: Handle<Expression>,
        coordinate: Handle<Expression>,
        array_index: Option<Handle<Expression>>,
        fun: AtomicFunction,
        value: Handle<Expression>,
    ) -> Result<()> {
        let kind = self.scalar_of(value)?.kind;
        let atomic = self.atomic_op(fun, kind)?;
        let (op, mut src) = self.texture_op(image, TextureAction::Atomic(atomic))?;
        self.place_components(&mut src, at::COORDINATE, coordinate)?;
        self.array_layer(&mut src, array_index)?;
        src[at::DATA] = self.scalar(value)?;
        self.flags.side_effects = true;
        self.written_bindings[usize::from(op.texture)] = true;
        self.emit_texture(op, &src, Code::TextureAtomic, 0);
        Ok(())
    }

    pub fn image_query(&mut self, image: Handle<Expression>, query: ImageQuery) -> Result<Val> {
        let shape = self.image(image)?;
        let (action, n) = match query {
            ImageQuery::Size { .. } => {
                let n = if shape.dim == ImageDimension::Cube { 2 } else { shape.coordinates() };
                (TextureAction::Size, n)
            }
            ImageQuery::NumLevels => (TextureAction::Levels, 1),
            ImageQuery::NumLayers => (TextureAction::Layers, 1),
            ImageQuery::NumSamples => (TextureAction::Samples, 1),
        };
        let (op, mut src) = self.texture_op(image, action)?;
        if let ImageQuery::Size { level: Some(l) } = query {
            src[at::LEVEL] = self.scalar(l)?;
        }
        // Bindings do not change during a draw, so that a query with uniform operands is done once.
        let uniform = src.iter().all(|&s| s == NONE || self.b.is_uniform(s));
        self.b.textures.push(op);
        let entry = (self.b.textures.len() - 1) as u32;
        let v = self.b.ops(Code::TextureQuery, &src, entry, n, uniform);
        Ok(Val::Data((v..v + n as V).collect()))
    }
}
