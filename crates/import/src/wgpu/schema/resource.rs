//! Descriptors of resources.

use serde::de::IgnoredAny;
use serde::{Deserialize, Deserializer};

use super::*;

/// What a program asks of its device. Fields that say nothing about the picture are ignored.
#[derive(Clone, Debug, Default, Deserialize)]
#[serde(default)]
#[allow(missing_docs, reason = "fields are named as in wgpu")]
pub struct DeviceDescriptor {
    pub label: Option<String>,
    pub required_features: Flags,
    pub required_limits: Limits,
}

/// The limits of a device, by name, in the order of the recording.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Limits(pub Vec<(String, u64)>);

impl Limits {
    /// A limit by name.
    pub fn get(&self, name: &str) -> Option<u64> {
        self.0.iter().find(|(known, _)| known == name).map(|&(_, value)| value)
    }
}

impl<'de> Deserialize<'de> for Limits {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Limits, D::Error> {
        struct Name(String);
        impl<'de> Deserialize<'de> for Name {
            fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Name, D::Error> {
                struct Text;
                impl serde::de::Visitor<'_> for Text {
                    type Value = Name;
                    fn expecting(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
                        f.write_str("the name of a limit")
                    }
                    fn visit_str<E>(self, name: &str) -> Result<Name, E> {
                        Ok(Name(name.to_owned()))
                    }
                }
                deserializer.deserialize_identifier(Text)
            }
        }
        struct Fields;
        impl<'de> serde::de::Visitor<'de> for Fields {
            type Value = Limits;
            fn expecting(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
                f.write_str("limits by name")
            }
            fn visit_map<A: serde::de::MapAccess<'de>>(self, mut fields: A) -> Result<Limits, A::Error> {
                let mut limits = Vec::new();
                while let Some((Name(name), value)) = fields.next_entry()? {
                    limits.push((name, value));
                }
                Ok(Limits(limits))
            }
        }
        deserializer.deserialize_struct("Limits", &[], Fields)
    }
}

/// A buffer.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
#[allow(missing_docs, reason = "fields are named as in wgpu")]
pub struct BufferDescriptor {
    pub label: Option<String>,
    pub size: u64,
    pub usage: Flags,
    pub mapped_at_creation: bool,
}

/// A texture.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
#[allow(missing_docs, reason = "fields are named as in wgpu")]
pub struct TextureDescriptor {
    pub label: Option<String>,
    pub size: Extent3d,
    pub mip_level_count: u32,
    pub sample_count: u32,
    pub dimension: TextureDimension,
    pub format: TextureFormat,
    pub usage: Flags,
    pub view_formats: IgnoredAny,
}

/// A view of a texture.
#[derive(Clone, Debug, Default, Deserialize)]
#[serde(default, deny_unknown_fields)]
#[allow(missing_docs, reason = "fields are named as in wgpu")]
pub struct TextureViewDescriptor {
    pub label: Option<String>,
    pub format: Option<TextureFormat>,
    pub dimension: Option<TextureViewDimension>,
    pub usage: Option<IgnoredAny>,
    pub range: ImageSubresourceRange,
}

/// Part of a texture.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "camelCase", deny_unknown_fields)]
#[allow(missing_docs, reason = "fields are named as in wgpu")]
pub struct ImageSubresourceRange {
    pub aspect: TextureAspect,
    pub base_mip_level: u32,
    pub mip_level_count: Option<u32>,
    pub base_array_layer: u32,
    pub array_layer_count: Option<u32>,
}

/// A sampler.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
#[allow(missing_docs, reason = "fields are named as in wgpu")]
pub struct SamplerDescriptor {
    pub label: Option<String>,
    pub address_modes: [AddressMode; 3],
    pub mag_filter: FilterMode,
    pub min_filter: FilterMode,
    pub mipmap_filter: FilterMode,
    pub lod_min_clamp: f32,
    pub lod_max_clamp: f32,
    pub compare: Option<CompareFunction>,
    pub anisotropy_clamp: u16,
    pub border_color: Option<SamplerBorderColor>,
}

/// A surface. Only what its textures are matters here.
#[derive(Clone, Debug, Deserialize)]
#[allow(missing_docs, reason = "fields are named as in wgpu")]
pub struct SurfaceConfiguration {
    #[serde(default)]
    pub usage: Flags,
    pub format: TextureFormat,
    pub width: u32,
    pub height: u32,
}

/// A query set.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
#[allow(missing_docs, reason = "fields are named as in wgpu")]
pub struct QuerySetDescriptor {
    pub label: Option<String>,
    pub ty: QueryType,
    pub count: u32,
}

/// What a query set counts.
#[derive(Clone, Debug, PartialEq, Eq, Deserialize)]
#[allow(missing_docs, reason = "variants are named as in wgpu")]
pub enum QueryType {
    Occlusion,
    Timestamp,
    /// Flags joined by ` | `.
    PipelineStatistics(String),
}

/// A bind group layout.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
#[allow(missing_docs, reason = "fields are named as in wgpu")]
pub struct BindGroupLayoutDescriptor {
    pub label: Option<String>,
    pub entries: Vec<BindGroupLayoutEntry>,
}

/// One binding of a layout.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
#[allow(missing_docs, reason = "fields are named as in wgpu")]
pub struct BindGroupLayoutEntry {
    pub binding: u32,
    pub visibility: IgnoredAny,
    pub ty: BindingType,
    #[serde(default)]
    pub count: Option<u32>,
}

/// What a binding holds.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
#[allow(missing_docs, reason = "variants and fields are named as in wgpu")]
pub enum BindingType {
    Buffer {
        ty: BufferBindingType,
        #[serde(default)]
        has_dynamic_offset: bool,
        #[serde(default)]
        min_binding_size: Option<u64>,
    },
    Sampler(IgnoredAny),
    Texture {
        sample_type: IgnoredAny,
        view_dimension: IgnoredAny,
        multisampled: bool,
    },
    StorageTexture {
        access: IgnoredAny,
        format: TextureFormat,
        view_dimension: IgnoredAny,
    },
    AccelerationStructure {
        vertex_return: bool,
    },
    ExternalTexture,
}

/// What a buffer binding is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(deny_unknown_fields)]
#[allow(missing_docs, reason = "variants and fields are named as in wgpu")]
pub enum BufferBindingType {
    Uniform,
    Storage { read_only: bool },
}

/// A bind group.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
#[allow(missing_docs, reason = "fields are named as in wgpu")]
pub struct BindGroupDescriptor {
    pub label: Option<String>,
    pub layout: Id,
    pub entries: Vec<BindGroupEntry>,
}

/// One binding.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
#[allow(missing_docs, reason = "fields are named as in wgpu")]
pub struct BindGroupEntry {
    pub binding: u32,
    pub resource: BindingResource,
}

/// What is bound.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[allow(missing_docs, reason = "variants are named as in wgpu")]
pub enum BindingResource {
    Buffer(BufferBinding),
    BufferArray(Vec<BufferBinding>),
    Sampler(Id),
    SamplerArray(Vec<Id>),
    TextureView(Id),
    TextureViewArray(Vec<Id>),
    AccelerationStructure(Id),
    AccelerationStructureArray(Vec<Id>),
    ExternalTexture(Id),
}

/// A range of a buffer.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(deny_unknown_fields)]
#[allow(missing_docs, reason = "fields are named as in wgpu")]
pub struct BufferBinding {
    pub buffer: Id,
    pub offset: u64,
    pub size: Option<u64>,
}
