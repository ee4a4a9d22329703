//! Resources: buffers, textures, views, samplers, query sets, bind groups, surfaces.

use gfx::state::{SamplerDesc, TextureDimension, ViewDimension};
use num::TextureId;
use trace::command::*;

use super::copy;
use super::objects::*;
use super::translate::Translator;
use wgpu_text::{self as schema, Id};

/// The largest anisotropy: wgpu clamps greater values.
const ANISOTROPY_MAX: u16 = 16;

impl Translator {
    pub(super) fn create_buffer(&mut self, id: Id, desc: schema::BufferDescriptor) -> Result<(), Reason> {
        let native = self.objects.new_buffer();
        let old = self.objects.buffers.set(id, Buffer { id: native, size: desc.size });
        self.gone(old.map(|old| Object::Buffer(old.id)));
        self.emit(Command::CreateBuffer { id: native, size: desc.size, label: desc.label });
        Ok(())
    }

    pub(super) fn write_buffer(&mut self, id: Id, data: schema::Data, offset: u64, size: u64) -> Result<(), Reason> {
        let buffer = *self.objects.buffers.get(id)?;
        if offset.checked_add(size).is_none_or(|end| end > buffer.size) {
            let bytes = buffer.size;
            return Err(format!("{size} bytes at offset {offset} reach past the end of the buffer of {bytes} bytes"));
        }
        if size > 0 {
            let data = self.blobs.add_prefix(&mut self.builder, data, size)?;
            self.emit(Command::WriteBuffer { id: buffer.id, offset, data });
        }
        Ok(())
    }

    pub(super) fn create_texture(&mut self, id: Id, desc: schema::TextureDescriptor) -> Result<(), Reason> {
        check_samples(desc.sample_count)?;
        let native = TextureDesc {
            dimension: desc.dimension.into(),
            size: desc.size.into(),
            levels: desc.mip_level_count,
            samples: desc.sample_count,
            format: desc.format.0,
            opaque: false,
        };
        self.new_texture(id, native, desc.label);
        Ok(())
    }

    fn new_texture(&mut self, id: Id, desc: TextureDesc, label: Option<String>) -> TextureId {
        let native = self.objects.new_texture();
        let old = self.objects.textures.set(id, Texture { id: native, desc: desc.clone() });
        self.gone(old.map(|old| Object::Texture(old.id)));
        self.emit(Command::CreateTexture { id: native, desc, label });
        native
    }

    /// For each frame a surface gives out a texture without contents.
    pub(super) fn acquire(&mut self, id: Id, surface: Id) -> Result<(), Reason> {
        let state = self.objects.surfaces.surface(surface);
        let Some(desc) = state.desc.clone() else {
            return Err("the surface gives out a texture, but was never configured".into());
        };
        let old = state.acquired.take();
        self.gone(old.map(Object::Texture));
        let native = self.new_texture(id, desc, Some("surface".into()));
        self.objects.surfaces.surface(surface).acquired = Some(native);
        Ok(())
    }

    pub(super) fn write_texture(
        &mut self,
        to: schema::TexelCopyTextureInfo,
        data: schema::Data,
        layout: schema::TexelCopyBufferLayout,
        size: schema::Extent3d,
    ) -> Result<(), Reason> {
        let format = self.objects.textures.get(to.texture)?.desc.format;
        let to = self.texture_end(to)?;
        let layout = copy::layout(layout);
        let size: [u32; 3] = size.into();
        let needed = copy::bytes_needed(format, to.aspect, layout, size)?;
        if size.contains(&0) {
            return Ok(());
        }
        let data = self.blobs.add_prefix(&mut self.builder, data, needed)?;
        self.emit(Command::WriteTexture { to, data, layout, size });
        Ok(())
    }

    pub(super) fn create_view(&mut self, id: Id, parent: Id, desc: schema::TextureViewDescriptor) -> Result<(), Reason> {
        let texture = self.objects.textures.get(parent)?;
        let (parent, of) = (texture.id, texture.desc.clone());
        let range = desc.range;
        // The defaults are resolved here by wgpu's rules, so that no later code has to know these rules.
        let dimension = desc.dimension.map_or_else(|| default_dimension(&of), Into::into);
        let layered = of.dimension == TextureDimension::D2;
        let layers = match dimension {
            ViewDimension::D2Array | ViewDimension::CubeArray => of.size[2].saturating_sub(range.base_array_layer),
            ViewDimension::Cube => 6,
            ViewDimension::D1 | ViewDimension::D2 | ViewDimension::D3 => 1,
        };
        let levels = range.mip_level_count.unwrap_or_else(|| of.levels.saturating_sub(range.base_mip_level));
        let native = ViewDesc {
            format: desc.format.map(|format| format.0).filter(|&format| format != of.format),
            dimension: Some(dimension),
            aspect: copy::aspect(range.aspect)?,
            base_level: range.base_mip_level,
            levels: Some(levels),
            base_layer: range.base_array_layer,
            layers: if layered { Some(range.array_layer_count.unwrap_or(layers)) } else { range.array_layer_count },
        };
        let view = self.objects.new_view();
        let old = self.objects.views.set(id, View { id: view, format: of.format });
        self.gone(old.map(|old| Object::View(old.id)));
        self.emit(Command::CreateView { id: view, texture: parent, desc: native });
        Ok(())
    }

    pub(super) fn create_sampler(&mut self, id: Id, desc: schema::SamplerDescriptor) -> Result<(), Reason> {
        let native = SamplerDesc {
            address: desc.address_modes.map(Into::into),
            mag: desc.mag_filter.into(),
            min: desc.min_filter.into(),
            mipmap: desc.mipmap_filter.into(),
            lod_min: desc.lod_min_clamp,
            lod_max: desc.lod_max_clamp,
            compare: desc.compare.map(Into::into),
            anisotropy: desc.anisotropy_clamp.clamp(1, ANISOTROPY_MAX),
            border: desc.border_color.map(Into::into).unwrap_or_default(),
        };
        let sampler = self.objects.new_sampler();
        let old = self.objects.samplers.set(id, sampler);
        self.gone(old.map(Object::Sampler));
        self.emit(Command::CreateSampler { id: sampler, desc: native });
        Ok(())
    }

    pub(super) fn create_query_set(&mut self, id: Id, desc: schema::QuerySetDescriptor) -> Result<(), Reason> {
        let kind = match desc.ty {
            schema::QueryType::Occlusion => QueryKind::Occlusion,
            schema::QueryType::Timestamp => QueryKind::Timestamp,
            schema::QueryType::PipelineStatistics(flags) => QueryKind::PipelineStatistics(statistics(&flags)?),
        };
        let set = self.objects.new_query_set();
        let old = self.objects.query_sets.set(id, set);
        self.gone(old.map(Object::QuerySet));
        self.emit(Command::CreateQuerySet { id: set, kind, count: desc.count });
        Ok(())
    }

    pub(super) fn create_bind_group(&mut self, id: Id, desc: schema::BindGroupDescriptor) -> Result<(), Reason> {
        let layout = self.objects.group_layouts.get(desc.layout)?.id;
        let mut entries = Vec::with_capacity(desc.entries.len());
        for entry in desc.entries {
            let binding = entry.binding;
            let resource = self.bound(entry.resource).map_err(|reason| format!("binding {binding}: {reason}"))?;
            entries.push(BindGroupEntry { binding, resource });
        }
        entries.sort_by_key(|entry| entry.binding);
        let group = self.objects.new_bind_group();
        let old = self.objects.bind_groups.set(id, group);
        self.gone(old.map(Object::BindGroup));
        self.emit(Command::CreateBindGroup { id: group, layout, entries });
        Ok(())
    }

    fn bound(&self, resource: schema::BindingResource) -> Result<BoundResource, Reason> {
        use schema::BindingResource as Wire;
        let o = &self.objects;
        let range = |b: schema::BufferBinding| Ok::<_, Reason>((o.buffers.get(b.buffer)?.id, b.offset, b.size));
        Ok(match resource {
            Wire::Buffer(binding) => {
                let (buffer, offset, size) = range(binding)?;
                BoundResource::Buffer { buffer, offset, size }
            }
            Wire::BufferArray(all) => BoundResource::Buffers(all.into_iter().map(range).collect::<Result<_, _>>()?),
            Wire::Sampler(id) => BoundResource::Sampler(*o.samplers.get(id)?),
            Wire::SamplerArray(all) => {
                BoundResource::Samplers(all.into_iter().map(|id| o.samplers.get(id).copied()).collect::<Result<_, _>>()?)
            }
            Wire::TextureView(id) => BoundResource::View(o.views.get(id)?.id),
            Wire::TextureViewArray(all) => {
                BoundResource::Views(all.into_iter().map(|id| Ok(o.views.get(id)?.id)).collect::<Result<_, Reason>>()?)
            }
            Wire::AccelerationStructure(_) | Wire::AccelerationStructureArray(_) => {
                return Err("ray tracing (acceleration structures) is not supported".into());
            }
            Wire::ExternalTexture(_) => return Err("external textures are not supported".into()),
        })
    }
}

/// Refuses sample counts that Fillrate does not have.
pub(super) fn check_samples(count: u32) -> Result<(), Reason> {
    match count {
        1 | 4 => Ok(()),
        _ => Err(format!("sample count {count} is not supported, only 1 and 4 are")),
    }
}

/// The bits of pipeline statistics flags.
fn statistics(flags: &str) -> Result<u8, Reason> {
    let mut bits = 0;
    for flag in flags.split('|').map(str::trim).filter(|flag| !flag.is_empty()) {
        bits |= match flag {
            "VERTEX_SHADER_INVOCATIONS" => 1,
            "CLIPPER_INVOCATIONS" => 2,
            "CLIPPER_PRIMITIVES_OUT" => 4,
            "FRAGMENT_SHADER_INVOCATIONS" => 8,
            "COMPUTE_SHADER_INVOCATIONS" => 16,
            _ => return Err(format!("pipeline statistic {flag:?} is not supported")),
        };
    }
    Ok(bits)
}
