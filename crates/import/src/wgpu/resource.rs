//! Resources: buffers, textures, views, samplers, query sets, bind groups, surfaces.

use gfx::state::{SamplerDesc, TextureDimension, ViewDimension};
use num::{BindGroupId, QuerySetId, SamplerId};
use trace::check::{OBJECT_MAX, rules};
use trace::command::*;

use super::objects::*;
use super::schema::{self, Id};
use super::translate::Translator;
use super::{copy, refuse};

/// The largest anisotropy: wgpu clamps greater values.
const ANISOTROPY_MAX: u16 = 16;

impl Translator {
    pub(super) fn create_buffer(&mut self, desc: schema::BufferDescriptor) -> Result<Buffer, Reason> {
        if desc.size > OBJECT_MAX {
            return Err(format!("a buffer of {} bytes is not supported, only {OBJECT_MAX} at most", desc.size).into());
        }
        let id = self.objects.new_buffer();
        self.emit(Command::CreateBuffer { id, size: desc.size, label: desc.label });
        Ok(Buffer { id, size: desc.size, writable: desc.usage.has("COPY_DST") })
    }

    /// A write of the queue, or of a buffer that was mapped.
    pub(super) fn write_buffer(
        &mut self,
        id: Id,
        data: schema::Data,
        (offset, size): (u64, u64),
        queued: bool,
    ) -> Result<(), Reason> {
        let buffer = *self.objects.buffers.get(id)?;
        refuse::buffer_write(&buffer, offset, size, queued)?;
        if size > 0 {
            let data = self.blobs.add_prefix(&mut self.builder, data, size)?;
            self.emit(Command::WriteBuffer { id: buffer.id, offset, data });
        }
        Ok(())
    }

    pub(super) fn create_texture(&mut self, desc: schema::TextureDescriptor) -> Result<Texture, Reason> {
        check_samples(desc.sample_count)?;
        let native = TextureDesc {
            dimension: desc.dimension.into(),
            size: desc.size.into(),
            levels: desc.mip_level_count,
            samples: desc.sample_count,
            format: desc.format.known()?,
            opaque: false,
        };
        refuse::texture(&native, &self.limits)?;
        self.new_texture(native, desc.label, desc.usage.has("COPY_DST"))
    }

    fn new_texture(&mut self, desc: TextureDesc, label: Option<String>, writable: bool) -> Result<Texture, Reason> {
        rules::texture(&desc)?;
        let id = self.objects.new_texture();
        self.emit(Command::CreateTexture { id, desc: desc.clone(), label });
        Ok(Texture { id, desc, writable })
    }

    /// For each frame a surface gives out a texture without contents.
    pub(super) fn acquire(&mut self, id: Id, surface: Id) -> Result<Texture, Reason> {
        let Some(textures) = self.objects.surface(surface).textures.clone() else {
            return Err(Reason::Damaged("the surface gives out a texture, but was never configured".into()));
        };
        let made = match textures.desc {
            Ok(desc) => self.new_texture(desc, Some("surface".into()), textures.writable),
            Err(refusal) => Err(Reason::Invalid(refusal)),
        };
        let texture = match &made {
            Ok(texture) => Ok(texture.id),
            Err(Reason::Invalid(refusal)) => Err(refusal.clone()),
            Err(Reason::Refused(reason)) => Err(self.refusal("surface texture", reason.clone())),
            Err(Reason::Damaged(_) | Reason::Data(_)) => return made,
        };
        let acquired = Acquired { id, texture, configuration: textures.number, destroyed: false };
        let old = self.objects.surface(surface).acquired.replace(acquired);
        self.gone(old.and_then(|old| old.texture.ok()).map(Object::Texture));
        made
    }

    pub(super) fn write_texture(
        &mut self,
        to: schema::TexelCopyTextureInfo,
        data: schema::Data,
        layout: schema::TexelCopyBufferLayout,
        size: schema::Extent3d,
    ) -> Result<(), Reason> {
        let texture = self.objects.textures.get(to.texture)?.clone();
        let to = self.texture_end(to)?;
        let layout = copy::layout(layout);
        let size: [u32; 3] = size.into();
        let needed = refuse::texture_write(&texture, &to, layout, size)?;
        let (blob, length) = self.blobs.add(&mut self.builder, data)?;
        if length < needed {
            return Err(format!("{needed} bytes are needed, data {blob:?} has {length}").into());
        }
        if !size.contains(&0) {
            self.emit(Command::WriteTexture { to, data: Data { blob, offset: 0, size: needed }, layout, size });
        }
        Ok(())
    }

    pub(super) fn create_view(&mut self, parent: Id, desc: schema::TextureViewDescriptor) -> Result<View, Reason> {
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
            format: desc.format.map(|format| format.known()).transpose()?.filter(|&format| format != of.format),
            dimension: Some(dimension),
            aspect: copy::aspect(range.aspect)?,
            base_level: range.base_mip_level,
            levels: Some(levels),
            base_layer: range.base_array_layer,
            layers: if layered { Some(range.array_layer_count.unwrap_or(layers)) } else { range.array_layer_count },
        };
        rules::view(parent, &of, &native)?;
        let id = self.objects.new_view();
        self.emit(Command::CreateView { id, texture: parent, desc: native });
        Ok(View { id, format: of.format })
    }

    pub(super) fn create_sampler(&mut self, desc: schema::SamplerDescriptor) -> Result<SamplerId, Reason> {
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
        rules::sampler(&native)?;
        let id = self.objects.new_sampler();
        self.emit(Command::CreateSampler { id, desc: native });
        Ok(id)
    }

    pub(super) fn create_query_set(&mut self, desc: schema::QuerySetDescriptor) -> Result<QuerySetId, Reason> {
        let kind = match desc.ty {
            schema::QueryType::Occlusion => QueryKind::Occlusion,
            schema::QueryType::Timestamp => QueryKind::Timestamp,
            schema::QueryType::PipelineStatistics(flags) => QueryKind::PipelineStatistics(statistics(&flags)?),
        };
        rules::query_set(kind, desc.count)?;
        let id = self.objects.new_query_set();
        self.emit(Command::CreateQuerySet { id, kind, count: desc.count });
        Ok(id)
    }

    pub(super) fn create_bind_group(&mut self, desc: schema::BindGroupDescriptor) -> Result<BindGroupId, Reason> {
        let layout = self.objects.group_layouts.get(desc.layout)?.id;
        let mut entries = Vec::with_capacity(desc.entries.len());
        for entry in desc.entries {
            let binding = entry.binding;
            let resource = self.bound(entry.resource).map_err(|reason| reason.within(format_args!("binding {binding}")))?;
            entries.push(BindGroupEntry { binding, resource });
        }
        entries.sort_by_key(|entry| entry.binding);
        let id = self.objects.new_bind_group();
        self.emit(Command::CreateBindGroup { id, layout, entries });
        Ok(id)
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
        _ => Err(format!("sample count {count} is not supported, only 1 and 4 are").into()),
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
            _ => return Err(format!("pipeline statistic {flag:?} is not supported").into()),
        };
    }
    Ok(bits)
}
