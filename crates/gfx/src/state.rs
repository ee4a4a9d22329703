//! Pipeline state: the fixed-function half of a draw, as plain values. Names and meanings are WebGPU's; what goes beyond it
//! (fans, quads, polygon modes) is marked.

use serde::{Deserialize, Serialize};

use super::format::{Format, TexelKind};

macro_rules! state_enum {
    ($(#[$doc:meta])* $name:ident default $default:ident { $($(#[$vdoc:meta])* $variant:ident),* $(,)? }) => {
        $(#[$doc])*
        #[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
        pub enum $name { $($(#[$vdoc])* $variant,)* }

        impl $name {
            /// All values, in declaration order.
            pub const ALL: &'static [$name] = &[$($name::$variant),*];
        }

        impl Default for $name {
            fn default() -> Self { $name::$default }
        }
    };
}

state_enum! {
    /// How vertices become primitives.
    Topology default TriangleList {
        /// Each vertex is a point of one pixel (the pixel that holds it).
        PointList,
        /// Vertex pairs.
        LineList,
        /// Each vertex after the first ends a line.
        LineStrip,
        /// Vertex triples.
        TriangleList,
        /// Each vertex after the second ends a triangle; odd triangles swap their first two for facing.
        TriangleStrip,
        /// Beyond WebGPU: all triangles share the first vertex.
        TriangleFan,
        /// Beyond WebGPU: vertex quadruples, drawn as triangles 0 1 2 and 0 2 3.
        QuadList,
    }
}

impl Topology {
    /// Whether strip restart applies.
    pub const fn is_strip(self) -> bool {
        matches!(self, Topology::LineStrip | Topology::TriangleStrip | Topology::TriangleFan)
    }
}

state_enum! {
    /// Width of an index.
    IndexFormat default Uint32 {
        /// Two bytes; 0xFFFF restarts a strip.
        Uint16,
        /// Four bytes; 0xFFFFFFFF restarts a strip.
        Uint32,
    }
}

impl IndexFormat {
    /// Bytes of one index.
    pub const fn bytes(self) -> u32 {
        match self {
            IndexFormat::Uint16 => 2,
            IndexFormat::Uint32 => 4,
        }
    }
}

state_enum! {
    /// Winding of a front face, seen on the screen with y up in clip space.
    FrontFace default Ccw {
        /// Counter-clockwise.
        Ccw,
        /// Clockwise.
        Cw,
    }
}

state_enum! {
    /// Which faces are thrown away.
    CullMode default None {
        /// None.
        None,
        /// Front faces.
        Front,
        /// Back faces.
        Back,
    }
}

state_enum! {
    /// Beyond WebGPU's core: how triangles are filled.
    PolygonMode default Fill {
        /// The inside.
        Fill,
        /// The edges, as lines.
        Line,
        /// The corners, as points.
        Point,
    }
}

state_enum! {
    /// A comparison of a new value with the stored one.
    Compare default Always {
        /// Fails always.
        Never,
        /// new < stored.
        Less,
        /// new = stored.
        Equal,
        /// new <= stored.
        LessEqual,
        /// new > stored.
        Greater,
        /// new != stored.
        NotEqual,
        /// new >= stored.
        GreaterEqual,
        /// Passes always.
        Always,
    }
}

impl Compare {
    /// Applies the comparison; with a NaN on either side only `NotEqual` and `Always` pass.
    #[inline(always)]
    pub fn test(self, new: f32, stored: f32) -> bool {
        match self {
            Compare::Never => false,
            Compare::Less => new < stored,
            Compare::Equal => new == stored,
            Compare::LessEqual => new <= stored,
            Compare::Greater => new > stored,
            Compare::NotEqual => new != stored,
            Compare::GreaterEqual => new >= stored,
            Compare::Always => true,
        }
    }
}

state_enum! {
    /// What happens to a stencil value.
    StencilOp default Keep {
        /// Stays.
        Keep,
        /// Becomes 0.
        Zero,
        /// Becomes the reference.
        Replace,
        /// All bits flip.
        Invert,
        /// Plus one, stops at 255.
        IncrementClamp,
        /// Minus one, stops at 0.
        DecrementClamp,
        /// Plus one, 255 becomes 0.
        IncrementWrap,
        /// Minus one, 0 becomes 255.
        DecrementWrap,
    }
}

/// Stencil test and operations of one face.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize, Default)]
#[serde(default, deny_unknown_fields)]
pub struct StencilFace {
    /// Comparison of the masked reference with the masked stored value.
    #[serde(skip_serializing_if = "is_default")]
    pub compare: Compare,
    /// When the stencil test fails.
    #[serde(skip_serializing_if = "is_default")]
    pub fail_op: StencilOp,
    /// When the stencil test passes and the depth test fails.
    #[serde(skip_serializing_if = "is_default")]
    pub depth_fail_op: StencilOp,
    /// When both pass.
    #[serde(skip_serializing_if = "is_default")]
    pub pass_op: StencilOp,
}

/// Masks of the stencil test of one face.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct StencilMasks {
    /// Mask on both sides of the stencil comparison.
    #[serde(default = "all_ones", skip_serializing_if = "is_all_ones")]
    pub read: u32,
    /// Bits of the stencil value that are written.
    #[serde(default = "all_ones", skip_serializing_if = "is_all_ones")]
    pub write: u32,
}

/// Depth and stencil state.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct DepthStencil {
    /// Format of the attachment.
    pub format: Format,
    /// Whether a passing fragment writes its depth.
    #[serde(default, skip_serializing_if = "is_default")]
    pub depth_write: bool,
    /// Depth comparison.
    #[serde(default, skip_serializing_if = "is_default")]
    pub depth_compare: Compare,
    /// Stencil state of front faces (lines and points are front).
    #[serde(default, skip_serializing_if = "is_default")]
    pub stencil_front: StencilFace,
    /// Stencil state of back faces.
    #[serde(default, skip_serializing_if = "is_default")]
    pub stencil_back: StencilFace,
    /// Mask on both sides of the stencil comparison.
    #[serde(default = "all_ones", skip_serializing_if = "is_all_ones")]
    pub stencil_read_mask: u32,
    /// Bits of the stencil value that are written.
    #[serde(default = "all_ones", skip_serializing_if = "is_all_ones")]
    pub stencil_write_mask: u32,
    /// Beyond WebGPU: the masks of back faces, where they differ from the two masks above.
    #[serde(default, skip_serializing_if = "is_default")]
    pub stencil_back_masks: Option<StencilMasks>,
    /// Constant depth bias in units of the smallest resolvable difference (Vulkan's `r`), with any fraction.
    #[serde(default, skip_serializing_if = "is_default")]
    pub bias: f32,
    /// Depth bias per unit of the maximum depth slope.
    #[serde(default, skip_serializing_if = "is_default")]
    pub bias_slope: f32,
    /// Bound on the depth bias: positive an upper, negative a lower bound, 0 none.
    #[serde(default, skip_serializing_if = "is_default")]
    pub bias_clamp: f32,
}

impl DepthStencil {
    /// The stencil masks of front and back faces.
    pub fn stencil_masks(&self) -> [StencilMasks; 2] {
        let front = StencilMasks { read: self.stencil_read_mask, write: self.stencil_write_mask };
        [front, self.stencil_back_masks.unwrap_or(front)]
    }

    /// Whether a stencil test may change bits of stencil values.
    pub fn writes_stencil(&self) -> bool {
        let acts = |face: &StencilFace| {
            [face.fail_op, face.depth_fail_op, face.pass_op].into_iter().any(|operation| operation != StencilOp::Keep)
        };
        let faces = [self.stencil_front, self.stencil_back];
        faces.iter().zip(self.stencil_masks()).any(|(face, masks)| acts(face) && masks.write & 0xff != 0)
    }
}

// A field that has its default value is left out of the text of a trace, which keeps it readable.

fn is_default<T: Default + PartialEq>(value: &T) -> bool {
    *value == T::default()
}

fn all_ones() -> u32 {
    !0
}

fn is_all_ones(value: &u32) -> bool {
    *value == !0
}

state_enum! {
    /// A factor of the blend equation.
    BlendFactor default One {
        /// 0
        Zero,
        /// 1
        One,
        /// The source colour.
        Src,
        /// 1 - source colour.
        OneMinusSrc,
        /// The source alpha.
        SrcAlpha,
        /// 1 - source alpha.
        OneMinusSrcAlpha,
        /// The stored colour.
        Dst,
        /// 1 - stored colour.
        OneMinusDst,
        /// The stored alpha.
        DstAlpha,
        /// 1 - stored alpha.
        OneMinusDstAlpha,
        /// min(source alpha, 1 - stored alpha); 1 for alpha.
        SrcAlphaSaturated,
        /// The blend constant.
        Constant,
        /// 1 - blend constant.
        OneMinusConstant,
        /// The second source colour (dual-source blending).
        Src1,
        /// 1 - second source colour.
        OneMinusSrc1,
        /// The second source alpha.
        Src1Alpha,
        /// 1 - second source alpha.
        OneMinusSrc1Alpha,
    }
}

state_enum! {
    /// The operation of the blend equation.
    BlendOp default Add {
        /// source + destination
        Add,
        /// source - destination
        Subtract,
        /// destination - source
        ReverseSubtract,
        /// Minimum of the unweighted values.
        Min,
        /// Maximum of the unweighted values.
        Max,
    }
}

/// Blending of the colour or of the alpha channel.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct BlendComponent {
    /// Factor of the source.
    pub src: BlendFactor,
    /// Factor of the destination.
    pub dst: BlendFactor,
    /// Operation.
    pub op: BlendOp,
}

impl Default for BlendComponent {
    /// The source replaces the destination.
    fn default() -> Self {
        BlendComponent { src: BlendFactor::One, dst: BlendFactor::Zero, op: BlendOp::Add }
    }
}

/// Blending of one target.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Blend {
    /// Red, green and blue.
    pub color: BlendComponent,
    /// Alpha.
    pub alpha: BlendComponent,
}

state_enum! {
    /// Beyond WebGPU: a logic operation on the bits of new and stored colours, in the order of Vulkan and OpenGL.
    LogicOp default Copy {
        /// 0
        Clear,
        /// new and stored
        And,
        /// new and not stored
        AndReverse,
        /// new
        Copy,
        /// not new and stored
        AndInverted,
        /// stored
        NoOp,
        /// either new or stored
        Xor,
        /// new or stored
        Or,
        /// not (new or stored)
        Nor,
        /// not (either new or stored)
        Equivalent,
        /// not stored
        Invert,
        /// new or not stored
        OrReverse,
        /// not new
        CopyInverted,
        /// not new or stored
        OrInverted,
        /// not (new and stored)
        Nand,
        /// All ones.
        Set,
    }
}

impl LogicOp {
    /// Applies the operation to each bit.
    #[inline(always)]
    pub const fn apply(self, new: u32, stored: u32) -> u32 {
        match self {
            LogicOp::Clear => 0,
            LogicOp::And => new & stored,
            LogicOp::AndReverse => new & !stored,
            LogicOp::Copy => new,
            LogicOp::AndInverted => !new & stored,
            LogicOp::NoOp => stored,
            LogicOp::Xor => new ^ stored,
            LogicOp::Or => new | stored,
            LogicOp::Nor => !(new | stored),
            LogicOp::Equivalent => !(new ^ stored),
            LogicOp::Invert => !stored,
            LogicOp::OrReverse => new | !stored,
            LogicOp::CopyInverted => !new,
            LogicOp::OrInverted => !new | stored,
            LogicOp::Nand => !(new & stored),
            LogicOp::Set => !0,
        }
    }

    /// Whether the result depends on what is stored.
    pub const fn reads(self) -> bool {
        !matches!(self, LogicOp::Clear | LogicOp::Copy | LogicOp::CopyInverted | LogicOp::Set)
    }

    /// Whether colours of a format take logic operations: integers and normalised numbers do, floating-point numbers and sRGB do not.
    pub fn applies_to(format: Format) -> bool {
        let normalised = format.name().contains("unorm") || format.name().contains("snorm");
        let integer = matches!(format.kind(), TexelKind::Uint | TexelKind::Sint);
        (normalised || integer) && !format.is_srgb() && !format.is_compressed() && !format.is_depth_stencil()
    }
}

/// State of one colour target.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ColorTarget {
    /// Format of the attachment.
    pub format: Format,
    /// Blending; none replaces.
    #[serde(default, skip_serializing_if = "is_default")]
    pub blend: Option<Blend>,
    /// Beyond WebGPU: a logic operation on stored bits, in place of blending; none replaces.
    #[serde(default, skip_serializing_if = "is_default")]
    pub logic: Option<LogicOp>,
    /// Channels written: bit 0 red, 1 green, 2 blue, 3 alpha.
    #[serde(default = "all_channels", skip_serializing_if = "is_all_channels")]
    pub write_mask: u8,
}

fn all_channels() -> u8 {
    15
}

fn is_all_channels(value: &u8) -> bool {
    *value == 15
}

/// Primitive state.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Primitive {
    /// Topology.
    #[serde(skip_serializing_if = "is_default")]
    pub topology: Topology,
    /// Index format that enables strip restart (non-indexed and list draws ignore it).
    #[serde(skip_serializing_if = "is_default")]
    pub strip_index_format: Option<IndexFormat>,
    /// Front winding.
    #[serde(skip_serializing_if = "is_default")]
    pub front_face: FrontFace,
    /// Culling.
    #[serde(skip_serializing_if = "is_default")]
    pub cull_mode: CullMode,
    /// Fill mode (beyond WebGPU's core).
    #[serde(skip_serializing_if = "is_default")]
    pub polygon_mode: PolygonMode,
    /// Depth clip off: depth is clamped to the viewport's range instead of clipped to the near and far planes.
    #[serde(skip_serializing_if = "is_default")]
    pub unclipped_depth: bool,
    /// Beyond WebGPU: flat varyings take the last vertex of a primitive instead of the first.
    #[serde(skip_serializing_if = "is_default")]
    pub provoking_last: bool,
    /// Beyond WebGPU: samples exactly on horizontal edges belong to what is above them, not below: OpenGL's rule in windows, whose rows
    /// it counts from below.
    #[serde(skip_serializing_if = "is_default")]
    pub lower_edges: bool,
    /// Beyond WebGPU: lines are rectangles of this width in pixels, as Vulkan's strict lines. Without it lines have a width of 1; with one
    /// sample per pixel they draw the pixels whose diamonds they leave, with several samples they are rectangles.
    #[serde(skip_serializing_if = "is_default")]
    pub line_width: Option<f32>,
}

/// Multisample state.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Multisample {
    /// Samples per pixel: 1 or 4.
    pub count: u32,
    /// Samples that may be written.
    pub mask: u32,
    /// Whether alpha of the first target turns into coverage.
    pub alpha_to_coverage: bool,
}

impl Default for Multisample {
    fn default() -> Self {
        Multisample { count: 1, mask: !0, alpha_to_coverage: false }
    }
}

macro_rules! vertex_formats {
    ($($name:ident $label:literal $bytes:literal $comps:literal),* $(,)?) => {
        /// Format of a vertex attribute; names are WebGPU's (`GPUVertexFormat`).
        #[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
        pub enum VertexFormat { $(#[doc = concat!("`", $label, "`")] $name,)* }

        impl VertexFormat {
            /// All formats, in declaration order.
            pub const ALL: &'static [VertexFormat] = &[$(VertexFormat::$name),*];

            /// The WebGPU name.
            pub const fn name(self) -> &'static str {
                match self { $(VertexFormat::$name => $label,)* }
            }

            /// Size in memory, in bytes.
            pub const fn bytes(self) -> u32 {
                match self { $(VertexFormat::$name => $bytes,)* }
            }

            /// Number of components.
            pub const fn components(self) -> u32 {
                match self { $(VertexFormat::$name => $comps,)* }
            }
        }
    };
}

vertex_formats! {
    Uint8 "uint8" 1 1, Uint8x2 "uint8x2" 2 2, Uint8x4 "uint8x4" 4 4,
    Sint8 "sint8" 1 1, Sint8x2 "sint8x2" 2 2, Sint8x4 "sint8x4" 4 4,
    Unorm8 "unorm8" 1 1, Unorm8x2 "unorm8x2" 2 2, Unorm8x4 "unorm8x4" 4 4,
    Snorm8 "snorm8" 1 1, Snorm8x2 "snorm8x2" 2 2, Snorm8x4 "snorm8x4" 4 4,
    Uint16 "uint16" 2 1, Uint16x2 "uint16x2" 4 2, Uint16x4 "uint16x4" 8 4,
    Sint16 "sint16" 2 1, Sint16x2 "sint16x2" 4 2, Sint16x4 "sint16x4" 8 4,
    Unorm16 "unorm16" 2 1, Unorm16x2 "unorm16x2" 4 2, Unorm16x4 "unorm16x4" 8 4,
    Snorm16 "snorm16" 2 1, Snorm16x2 "snorm16x2" 4 2, Snorm16x4 "snorm16x4" 8 4,
    Float16 "float16" 2 1, Float16x2 "float16x2" 4 2, Float16x4 "float16x4" 8 4,
    Float32 "float32" 4 1, Float32x2 "float32x2" 8 2, Float32x3 "float32x3" 12 3, Float32x4 "float32x4" 16 4,
    Uint32 "uint32" 4 1, Uint32x2 "uint32x2" 8 2, Uint32x3 "uint32x3" 12 3, Uint32x4 "uint32x4" 16 4,
    Sint32 "sint32" 4 1, Sint32x2 "sint32x2" 8 2, Sint32x3 "sint32x3" 12 3, Sint32x4 "sint32x4" 16 4,
    Float64 "float64" 8 1, Float64x2 "float64x2" 16 2, Float64x3 "float64x3" 24 3, Float64x4 "float64x4" 32 4,
    Unorm10x10x10x2 "unorm10-10-10-2" 4 4, Unorm8x4Bgra "unorm8x4-bgra" 4 4,
}

state_enum! {
    /// What advances a vertex buffer.
    StepMode default Vertex {
        /// The vertex index.
        Vertex,
        /// The instance index.
        Instance,
    }
}

/// One attribute in a vertex buffer.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct VertexAttribute {
    /// Format in memory.
    pub format: VertexFormat,
    /// Bytes from the start of the vertex.
    pub offset: u64,
    /// `@location` of the vertex stage.
    pub location: u32,
}

/// Layout of one vertex buffer slot.
#[derive(Clone, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct VertexBufferLayout {
    /// Bytes from one vertex to the next.
    pub stride: u64,
    /// What advances it.
    #[serde(default, skip_serializing_if = "is_default")]
    pub step: StepMode,
    /// Attributes.
    pub attributes: Vec<VertexAttribute>,
}

/// The viewport transform: x, y, width, height in pixels (y down), depth range.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Viewport {
    /// Left edge in pixels.
    pub x: f32,
    /// Top edge in pixels.
    pub y: f32,
    /// Width in pixels.
    pub width: f32,
    /// Height in pixels.
    pub height: f32,
    /// Depth of the near plane.
    pub min_depth: f32,
    /// Depth of the far plane.
    pub max_depth: f32,
}

/// A rectangle of whole pixels.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Rect {
    /// Left edge.
    pub x: u32,
    /// Top edge.
    pub y: u32,
    /// Width.
    pub width: u32,
    /// Height.
    pub height: u32,
}

state_enum! {
    /// What a coordinate outside [0, 1] reads.
    AddressMode default ClampToEdge {
        /// The edge texel.
        ClampToEdge,
        /// The texture repeated.
        Repeat,
        /// The texture repeated, mirrored every second time.
        MirrorRepeat,
        /// The border colour (beyond WebGPU's core).
        ClampToBorder,
    }
}

state_enum! {
    /// How texels or levels are filtered.
    FilterMode default Nearest {
        /// The nearest.
        Nearest,
        /// A weighted mean of the neighbours.
        Linear,
    }
}

state_enum! {
    /// Colour outside a texture with `ClampToBorder`.
    BorderColor default TransparentBlack {
        /// (0, 0, 0, 0)
        TransparentBlack,
        /// (0, 0, 0, 1)
        OpaqueBlack,
        /// (1, 1, 1, 1)
        OpaqueWhite,
    }
}

/// A sampler.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct SamplerDesc {
    /// Address modes of u, v, w.
    pub address: [AddressMode; 3],
    /// Filter where a texel covers more than a pixel.
    pub mag: FilterMode,
    /// Filter where a texel covers less than a pixel.
    pub min: FilterMode,
    /// Filter between levels.
    pub mipmap: FilterMode,
    /// Lower bound of the level of detail.
    pub lod_min: f32,
    /// Upper bound of the level of detail.
    pub lod_max: f32,
    /// Comparison, for comparison samplers.
    pub compare: Option<Compare>,
    /// Maximum anisotropy, 1 to 16.
    pub anisotropy: u16,
    /// Border colour.
    pub border: BorderColor,
}

impl Default for SamplerDesc {
    fn default() -> Self {
        SamplerDesc {
            address: [AddressMode::ClampToEdge; 3],
            mag: FilterMode::Nearest,
            min: FilterMode::Nearest,
            mipmap: FilterMode::Nearest,
            lod_min: 0.0,
            lod_max: 32.0,
            compare: None,
            anisotropy: 1,
            border: BorderColor::TransparentBlack,
        }
    }
}

state_enum! {
    /// Dimension of a texture.
    TextureDimension default D2 {
        /// One row.
        D1,
        /// Rows, in layers.
        D2,
        /// Slices.
        D3,
    }
}

state_enum! {
    /// Dimension of a view.
    ViewDimension default D2 {
        /// One row.
        D1,
        /// One layer.
        D2,
        /// Layers.
        D2Array,
        /// Six layers as the faces of a cube, +x -x +y -y +z -z.
        Cube,
        /// Cubes of six layers each.
        CubeArray,
        /// Slices.
        D3,
    }
}

state_enum! {
    /// Which aspect of a depth-stencil texture.
    Aspect default All {
        /// All that it has.
        All,
        /// Depth.
        DepthOnly,
        /// Stencil.
        StencilOnly,
    }
}
