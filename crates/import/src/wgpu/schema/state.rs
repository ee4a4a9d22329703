//! Enumerations and small structs of pipeline state, and what each means natively.

use serde::{Deserialize, Deserializer};

use gfx::format::Format;
use gfx::state;

/// A texture format.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum TextureFormat {
    /// A format that Fillrate has.
    Known(Format),
    /// The name of a format that Fillrate does not have.
    Unknown(String),
}

impl TextureFormat {
    /// The format.
    ///
    /// # Errors
    /// If Fillrate does not have it; the message names it.
    pub fn known(&self) -> Result<Format, String> {
        match self {
            TextureFormat::Known(format) => Ok(*format),
            TextureFormat::Unknown(name) => Err(format!("texture format {name:?} is not supported")),
        }
    }
}

impl<'de> Deserialize<'de> for TextureFormat {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let name = String::deserialize(deserializer)?;
        Ok(Format::from_name(&name).map_or(TextureFormat::Unknown(name), TextureFormat::Known))
    }
}

/// Flags, as in `COPY_DST | VERTEX`.
#[derive(Clone, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(transparent)]
pub struct Flags(pub String);

impl Flags {
    /// The flags' names.
    pub fn names(&self) -> impl Iterator<Item = &str> {
        self.0.split('|').map(str::trim).filter(|name| !name.is_empty())
    }

    /// Whether a flag is among them.
    pub fn has(&self, name: &str) -> bool {
        self.names().any(|other| other == name)
    }
}

/// A vertex format, known natively.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct VertexFormat(pub state::VertexFormat);

impl<'de> Deserialize<'de> for VertexFormat {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct Name;
        impl serde::de::Visitor<'_> for Name {
            type Value = VertexFormat;
            fn expecting(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
                f.write_str("a vertex format")
            }
            fn visit_str<E: serde::de::Error>(self, name: &str) -> Result<VertexFormat, E> {
                let known = state::VertexFormat::ALL.iter().find(|known| known.name() == name);
                known
                    .map(|&known| VertexFormat(known))
                    .ok_or_else(|| E::custom(format_args!("vertex format {name:?} is not supported")))
            }
        }
        // A recorder writes a unit variant, that is a bare identifier.
        deserializer.deserialize_identifier(Name)
    }
}

macro_rules! wire_enum {
    ($(#[$doc:meta])* $name:ident means $native:ty { $($variant:ident $wire:literal),* $(,)? }) => {
        $(#[$doc])*
        #[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
        #[allow(missing_docs, reason = "variants are named as in WebGPU")]
        pub enum $name { $(#[serde(rename = $wire)] $variant,)* }

        impl From<$name> for $native {
            fn from(value: $name) -> $native {
                match value { $($name::$variant => <$native>::$variant,)* }
            }
        }
    };
}

wire_enum! {
    /// Blend factor.
    BlendFactor means state::BlendFactor {
        Zero "zero", One "one", Src "src", OneMinusSrc "one-minus-src", SrcAlpha "src-alpha",
        OneMinusSrcAlpha "one-minus-src-alpha", Dst "dst", OneMinusDst "one-minus-dst", DstAlpha "dst-alpha",
        OneMinusDstAlpha "one-minus-dst-alpha", SrcAlphaSaturated "src-alpha-saturated", Constant "constant",
        OneMinusConstant "one-minus-constant", Src1 "src1", OneMinusSrc1 "one-minus-src1", Src1Alpha "src1-alpha",
        OneMinusSrc1Alpha "one-minus-src1-alpha",
    }
}

wire_enum! {
    /// Blend operation.
    BlendOperation means state::BlendOp {
        Add "add", Subtract "subtract", ReverseSubtract "reverse-subtract", Min "min", Max "max",
    }
}

wire_enum! {
    /// Topology.
    PrimitiveTopology means state::Topology {
        PointList "point-list", LineList "line-list", LineStrip "line-strip", TriangleList "triangle-list",
        TriangleStrip "triangle-strip",
    }
}

wire_enum! {
    /// Winding of front faces.
    FrontFace means state::FrontFace { Ccw "ccw", Cw "cw" }
}

wire_enum! {
    /// A face that is culled.
    Face means state::CullMode { Front "front", Back "back" }
}

wire_enum! {
    /// Fill mode.
    PolygonMode means state::PolygonMode { Fill "fill", Line "line", Point "point" }
}

wire_enum! {
    /// Index format.
    IndexFormat means state::IndexFormat { Uint16 "uint16", Uint32 "uint32" }
}

wire_enum! {
    /// Stencil operation.
    StencilOperation means state::StencilOp {
        Keep "keep", Zero "zero", Replace "replace", Invert "invert", IncrementClamp "increment-clamp",
        DecrementClamp "decrement-clamp", IncrementWrap "increment-wrap", DecrementWrap "decrement-wrap",
    }
}

wire_enum! {
    /// Comparison.
    CompareFunction means state::Compare {
        Never "never", Less "less", Equal "equal", LessEqual "less-equal", Greater "greater", NotEqual "not-equal",
        GreaterEqual "greater-equal", Always "always",
    }
}

wire_enum! {
    /// Address mode.
    AddressMode means state::AddressMode {
        ClampToEdge "clamp-to-edge", Repeat "repeat", MirrorRepeat "mirror-repeat", ClampToBorder "clamp-to-border",
    }
}

wire_enum! {
    /// Filter.
    FilterMode means state::FilterMode { Nearest "nearest", Linear "linear" }
}

wire_enum! {
    /// Step mode.
    VertexStepMode means state::StepMode { Vertex "vertex", Instance "instance" }
}

wire_enum! {
    /// Dimension of a texture.
    TextureDimension means state::TextureDimension { D1 "1d", D2 "2d", D3 "3d" }
}

wire_enum! {
    /// Dimension of a view.
    TextureViewDimension means state::ViewDimension {
        D1 "1d", D2 "2d", D2Array "2d-array", Cube "cube", CubeArray "cube-array", D3 "3d",
    }
}

/// Border colour.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[allow(missing_docs, reason = "variants are named as in wgpu")]
pub enum SamplerBorderColor {
    TransparentBlack,
    OpaqueBlack,
    OpaqueWhite,
    /// What Metal's textures without alpha call zero; elsewhere transparent black.
    Zero,
}

impl From<SamplerBorderColor> for state::BorderColor {
    fn from(value: SamplerBorderColor) -> state::BorderColor {
        match value {
            SamplerBorderColor::TransparentBlack | SamplerBorderColor::Zero => state::BorderColor::TransparentBlack,
            SamplerBorderColor::OpaqueBlack => state::BorderColor::OpaqueBlack,
            SamplerBorderColor::OpaqueWhite => state::BorderColor::OpaqueWhite,
        }
    }
}

/// Aspect. Planes belong to multi-planar formats, which are refused.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[allow(missing_docs, reason = "variants are named as in wgpu")]
pub enum TextureAspect {
    #[default]
    #[serde(rename = "all")]
    All,
    #[serde(rename = "stencil-only")]
    StencilOnly,
    #[serde(rename = "depth-only")]
    DepthOnly,
    #[serde(rename = "plane0")]
    Plane0,
    #[serde(rename = "plane1")]
    Plane1,
    #[serde(rename = "plane2")]
    Plane2,
}

/// How an attachment's contents begin.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum LoadOp<V> {
    /// Cleared.
    Clear(V),
    /// Kept.
    Load,
}

/// Whether an attachment's contents are kept.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
#[allow(missing_docs, reason = "variants are named as in WebGPU")]
pub enum StoreOp {
    Store,
    Discard,
}

/// A colour.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
#[allow(missing_docs, reason = "channels")]
pub struct Color {
    pub r: f64,
    pub g: f64,
    pub b: f64,
    pub a: f64,
}

impl From<Color> for [f64; 4] {
    fn from(c: Color) -> [f64; 4] {
        [c.r, c.g, c.b, c.a]
    }
}

/// A size in texels.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "camelCase", deny_unknown_fields)]
#[allow(missing_docs, reason = "fields are named as in WebGPU")]
pub struct Extent3d {
    pub width: u32,
    pub height: u32,
    #[serde(default = "one")]
    pub depth_or_array_layers: u32,
}

fn one() -> u32 {
    1
}

impl From<Extent3d> for [u32; 3] {
    fn from(size: Extent3d) -> [u32; 3] {
        [size.width, size.height, size.depth_or_array_layers]
    }
}

/// A place in a texture.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(deny_unknown_fields)]
#[allow(missing_docs, reason = "coordinates")]
pub struct Origin3d {
    pub x: u32,
    pub y: u32,
    pub z: u32,
}

impl From<Origin3d> for [u32; 3] {
    fn from(at: Origin3d) -> [u32; 3] {
        [at.x, at.y, at.z]
    }
}
