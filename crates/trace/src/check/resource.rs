//! Rules of buffers, textures, views, samplers, shaders and query sets.

use gfx::format::{Format, TexelKind};
use gfx::state::*;

use super::*;

/// A view, resolved.
#[derive(Clone, Debug)]
pub struct View {
    pub texture: TextureId,
    pub format: Format,
    pub dimension: ViewDimension,
    pub base_level: u32,
    pub levels: u32,
    pub base_layer: u32,
    pub layers: u32,
    pub samples: u32,
    /// Width, height and depth of the first level.
    pub size: [u32; 3],
}

impl Checker<'_> {
    fn claim(&mut self, what: &str, bytes: u64) -> CheckResult {
        ensure!(bytes <= OBJECT_MAX, "{what} of {bytes} bytes, it must be {OBJECT_MAX} at most");
        let alive = self.memory;
        let total = alive.saturating_add(bytes);
        let refused = |error| format!("asks for {bytes} bytes for {what} where {alive} are alive: {error}");
        self.trace.limits().memory_bytes.check(total).map_err(refused)?;
        self.memory = total;
        self.summary.peak_bytes = self.summary.peak_bytes.max(total);
        Ok(())
    }

    pub(super) fn create_buffer(&mut self, id: BufferId, size: u64) -> CheckResult {
        self.claim("a buffer", size)?;
        self.summary.buffer_bytes += size;
        Ok(self.buffers.create(id.0, size)?)
    }

    pub(super) fn create_texture(&mut self, id: TextureId, desc: &TextureDesc) -> CheckResult {
        texture(desc)?;
        let bytes = desc.bytes().ok_or("the texture is larger than memory can be")?;
        self.claim("a texture", bytes)?;
        self.summary.texture_bytes += bytes;
        Ok(self.textures.create(id.0, desc.clone())?)
    }

    pub(super) fn create_view(&mut self, id: ViewId, texture: TextureId, desc: &ViewDesc) -> CheckResult {
        let view = view(texture, self.textures.get(texture.0)?, desc)?;
        Ok(self.views.create(id.0, view)?)
    }

    pub(super) fn create_sampler(&mut self, id: SamplerId, desc: &SamplerDesc) -> CheckResult {
        sampler(desc)?;
        Ok(self.samplers.create(id.0, ())?)
    }

    pub(super) fn create_shader(&mut self, id: ShaderId, source: &ShaderSource) -> CheckResult {
        let (ShaderSource::Wgsl(name) | ShaderSource::SpirV(name) | ShaderSource::NagaIr(name)) = source;
        match source {
            ShaderSource::SpirV(_) => {
                let length = self.trace.blob(name)?.len();
                ensure!(length.is_multiple_of(4), "SPIR-V blob {name:?} of {length} bytes is not made of whole words");
            }
            _ => {
                self.trace.text(name)?;
            }
        }
        self.use_blob(name);
        Ok(self.shaders.create(id.0, ())?)
    }

    pub(super) fn create_query_set(&mut self, id: QuerySetId, kind: QueryKind, count: u32) -> CheckResult {
        query_set(kind, count)?;
        Ok(self.query_sets.create(id.0, (kind, count))?)
    }

    pub(super) fn destroy(&mut self, object: Object) -> CheckResult {
        match object {
            Object::Buffer(id) => self.memory -= self.buffers.destroy(id.0)?,
            Object::Texture(id) => self.memory -= self.textures.destroy(id.0)?.bytes().unwrap_or(0),
            Object::View(id) => self.views.destroy(id.0).map(|_| ())?,
            Object::Sampler(id) => self.samplers.destroy(id.0)?,
            Object::Shader(id) => self.shaders.destroy(id.0)?,
            Object::BindGroupLayout(id) => drop(self.group_layouts.destroy(id.0)?),
            Object::PipelineLayout(id) => drop(self.pipeline_layouts.destroy(id.0)?),
            Object::BindGroup(id) => drop(self.groups.destroy(id.0)?),
            Object::RenderPipeline(id) => drop(self.render_pipelines.destroy(id.0)?),
            Object::ComputePipeline(id) => drop(self.compute_pipelines.destroy(id.0)?),
            Object::Bundle(id) => drop(self.bundles.destroy(id.0)?),
            Object::QuerySet(id) => drop(self.query_sets.destroy(id.0)?),
        }
        Ok(())
    }
}

/// The rules of a texture, as far as they follow from its description.
///
/// # Errors
/// The rule that is broken.
pub fn texture(desc: &TextureDesc) -> Result<(), String> {
    let [width, height, depth] = desc.size;
    let at_most = match desc.dimension {
        TextureDimension::D1 => [TEXTURE_EDGE_MAX, 1, 1],
        TextureDimension::D2 => [TEXTURE_EDGE_MAX, TEXTURE_EDGE_MAX, TEXTURE_LAYERS_MAX],
        TextureDimension::D3 => [TEXTURE_EDGE_3D_MAX; 3],
    };
    for ((name, size), at_most) in ["width", "height", "depth or layers"].into_iter().zip(desc.size).zip(at_most) {
        ensure!((1..=at_most).contains(&size), "{name} is {size}, it must be 1 to {at_most}");
    }
    let full = desc.full_levels();
    ensure!((1..=full).contains(&desc.levels), "{} levels, a {width}x{height}x{depth} texture has 1 to {full}", desc.levels);
    ensure!(matches!(desc.samples, 1 | 4), "{} samples, only 1 and 4 are possible", desc.samples);
    let format = desc.format;
    let name = format.name();
    if desc.samples > 1 {
        let flat = desc.dimension == TextureDimension::D2 && desc.levels == 1 && depth == 1;
        ensure!(flat, "a multisampled texture has one level and one layer");
        ensure!(!format.is_compressed(), "{name} cannot be multisampled");
    }
    if format.is_compressed() {
        ensure!(desc.dimension != TextureDimension::D1, "{name} has no 1D textures");
        let whole = width.is_multiple_of(4) && height.is_multiple_of(4);
        ensure!(whole, "a {name} texture of {width}x{height} is not made of whole 4x4 blocks");
    }
    if format.is_depth_stencil() {
        ensure!(desc.dimension == TextureDimension::D2, "{name} has only 2D textures");
    }
    let bytes = desc.bytes().ok_or("the texture is larger than memory can be")?;
    ensure!(bytes <= OBJECT_MAX, "a texture of {bytes} bytes, it must be {OBJECT_MAX} at most");
    Ok(())
}

/// A view of a texture, if its description keeps the rules.
///
/// # Errors
/// The rule that is broken.
pub fn view(texture: TextureId, owner: &TextureDesc, desc: &ViewDesc) -> Result<View, String> {
    let dimension = desc.dimension_of(owner);
    let (levels, layers) = (desc.levels_of(owner), desc.layers_of(owner));
    let fits = |base: u32, count: u32, all: u32| count > 0 && base.checked_add(count).is_some_and(|end| end <= all);
    let (base, all) = (desc.base_level, owner.levels);
    ensure!(fits(base, levels, all), "levels {base} + {levels} are not in the texture's {all}");
    let (base, all) = (desc.base_layer, owner.layers());
    ensure!(fits(base, layers, all), "layers {base} + {layers} are not in the texture's {all}");

    let matches_owner = match dimension {
        ViewDimension::D1 => owner.dimension == TextureDimension::D1,
        ViewDimension::D3 => owner.dimension == TextureDimension::D3,
        _ => owner.dimension == TextureDimension::D2,
    };
    ensure!(matches_owner, "a {dimension:?} view of a {:?} texture", owner.dimension);
    let right_layers = match dimension {
        ViewDimension::D1 | ViewDimension::D2 | ViewDimension::D3 => layers == 1,
        ViewDimension::Cube => layers == 6,
        ViewDimension::CubeArray => layers.is_multiple_of(6),
        ViewDimension::D2Array => true,
    };
    ensure!(right_layers, "a {dimension:?} view of {layers} layers");
    let [width, height, _] = owner.size;
    let square = width == height || !matches!(dimension, ViewDimension::Cube | ViewDimension::CubeArray);
    ensure!(square, "a cube view of a {width}x{height} texture");
    ensure!(owner.samples == 1 || dimension == ViewDimension::D2, "a {dimension:?} view of a multisampled texture");

    let has_aspect = match desc.aspect {
        Aspect::All => true,
        Aspect::DepthOnly => owner.format.has_depth(),
        Aspect::StencilOnly => owner.format.has_stencil(),
    };
    ensure!(has_aspect, "{} has no aspect {:?}", owner.format.name(), desc.aspect);
    let format = desc.format.unwrap_or(owner.format);
    let aspect_format = match desc.aspect {
        Aspect::All => false,
        Aspect::DepthOnly => matches!(
            (owner.format, format),
            (Format::Depth24PlusStencil8, Format::Depth24Plus) | (Format::Depth32FloatStencil8, Format::Depth32Float)
        ),
        Aspect::StencilOnly => format == Format::Stencil8,
    };
    let (of, is) = (owner.format.name(), format.name());
    ensure!(aspect_format || same_but_srgb(owner.format, format), "a {is} view of a {of} texture");

    Ok(View {
        texture,
        format,
        dimension,
        base_level: desc.base_level,
        levels,
        base_layer: desc.base_layer,
        layers,
        samples: owner.samples,
        size: owner.level_size(desc.base_level),
    })
}

/// The rules of a sampler.
///
/// # Errors
/// The rule that is broken.
pub fn sampler(desc: &SamplerDesc) -> Result<(), String> {
    let (low, high) = (desc.lod_min, desc.lod_max);
    ensure!(low >= 0.0 && high >= low, "levels of detail from {low} to {high} are no range");
    ensure!((1..=16).contains(&desc.anisotropy), "anisotropy is {}, it must be 1 to 16", desc.anisotropy);
    let linear = [desc.mag, desc.min, desc.mipmap] == [FilterMode::Linear; 3];
    ensure!(desc.anisotropy == 1 || linear, "anisotropy asks for linear filters");
    Ok(())
}

/// The rules of a query set.
///
/// # Errors
/// The rule that is broken.
pub fn query_set(kind: QueryKind, count: u32) -> Result<(), String> {
    ensure!((1..=QUERIES_MAX).contains(&count), "{count} queries, it must be 1 to {QUERIES_MAX}");
    if let QueryKind::PipelineStatistics(mask) = kind {
        ensure!(mask != 0 && mask < 32, "{mask} is no set of pipeline statistics");
    }
    Ok(())
}

/// Whether a format can be a colour target.
pub fn renderable(format: Format) -> bool {
    !format.is_compressed()
        && !matches!(format.kind(), TexelKind::Depth)
        && !matches!(format, Format::Rgb9e5Ufloat | Format::R64Uint)
}
