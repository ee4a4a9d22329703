//! Vulkan's formats and constants, as the native trace has them.

use gfx::format::Format;
use gfx::state::*;

use super::fault::{Outcome, unsupported};

/// The format of an image.
pub fn format(code: u32) -> Outcome<Format> {
    use Format::*;
    Ok(match code {
        9 => R8Unorm,
        10 => R8Snorm,
        13 => R8Uint,
        14 => R8Sint,
        16 => Rg8Unorm,
        17 => Rg8Snorm,
        20 => Rg8Uint,
        21 => Rg8Sint,
        37 | 51 => Rgba8Unorm,
        38 | 52 => Rgba8Snorm,
        41 | 55 => Rgba8Uint,
        42 | 56 => Rgba8Sint,
        43 | 57 => Rgba8UnormSrgb,
        44 => Bgra8Unorm,
        50 => Bgra8UnormSrgb,
        64 => Rgb10a2Unorm,
        68 => Rgb10a2Uint,
        70 => R16Unorm,
        71 => R16Snorm,
        74 => R16Uint,
        75 => R16Sint,
        76 => R16Float,
        77 => Rg16Unorm,
        78 => Rg16Snorm,
        81 => Rg16Uint,
        82 => Rg16Sint,
        83 => Rg16Float,
        91 => Rgba16Unorm,
        92 => Rgba16Snorm,
        95 => Rgba16Uint,
        96 => Rgba16Sint,
        97 => Rgba16Float,
        98 => R32Uint,
        99 => R32Sint,
        100 => R32Float,
        101 => Rg32Uint,
        102 => Rg32Sint,
        103 => Rg32Float,
        107 => Rgba32Uint,
        108 => Rgba32Sint,
        109 => Rgba32Float,
        110 => R64Uint,
        122 => Rg11b10Ufloat,
        123 => Rgb9e5Ufloat,
        124 => Depth16Unorm,
        125 => Depth24Plus,
        126 => Depth32Float,
        127 => Stencil8,
        129 => Depth24PlusStencil8,
        130 => Depth32FloatStencil8,
        // Blocks without alpha have the same colours: only where they have three of them, the fourth code is black, and not transparent as well.
        131 | 133 => Bc1RgbaUnorm,
        132 | 134 => Bc1RgbaUnormSrgb,
        135 => Bc2RgbaUnorm,
        136 => Bc2RgbaUnormSrgb,
        137 => Bc3RgbaUnorm,
        138 => Bc3RgbaUnormSrgb,
        139 => Bc4RUnorm,
        140 => Bc4RSnorm,
        141 => Bc5RgUnorm,
        142 => Bc5RgSnorm,
        143 => Bc6hRgbUfloat,
        144 => Bc6hRgbFloat,
        145 => Bc7RgbaUnorm,
        146 => Bc7RgbaUnormSrgb,
        other => return unsupported(format!("image format {}", name("VkFormat", other))),
    })
}

/// The format of a vertex attribute.
pub fn vertex_format(code: u32) -> Outcome<VertexFormat> {
    use VertexFormat::*;
    Ok(match code {
        9 => Unorm8,
        10 => Snorm8,
        13 => Uint8,
        14 => Sint8,
        16 => Unorm8x2,
        17 => Snorm8x2,
        20 => Uint8x2,
        21 => Sint8x2,
        37 | 51 => Unorm8x4,
        38 | 52 => Snorm8x4,
        41 | 55 => Uint8x4,
        42 | 56 => Sint8x4,
        44 => Unorm8x4Bgra,
        64 => Unorm10x10x10x2,
        70 => Unorm16,
        71 => Snorm16,
        74 => Uint16,
        75 => Sint16,
        76 => Float16,
        77 => Unorm16x2,
        78 => Snorm16x2,
        81 => Uint16x2,
        82 => Sint16x2,
        83 => Float16x2,
        91 => Unorm16x4,
        92 => Snorm16x4,
        95 => Uint16x4,
        96 => Sint16x4,
        97 => Float16x4,
        98 => Uint32,
        99 => Sint32,
        100 => Float32,
        101 => Uint32x2,
        102 => Sint32x2,
        103 => Float32x2,
        104 => Uint32x3,
        105 => Sint32x3,
        106 => Float32x3,
        107 => Uint32x4,
        108 => Sint32x4,
        109 => Float32x4,
        other => return unsupported(format!("vertex format {}", name("VkFormat", other))),
    })
}

/// A constant's name for messages.
pub fn name(kind: &str, code: u32) -> String {
    gfxr::constant_name(kind, (code as i32).into()).map_or_else(|| code.to_string(), str::to_owned)
}

fn pick<T: Copy>(kind: &str, all: &[T], code: u32) -> Outcome<T> {
    match all.get(code as usize) {
        Some(&value) => Ok(value),
        None => unsupported(name(kind, code)),
    }
}

/// `VkPrimitiveTopology`.
pub fn topology(code: u32) -> Outcome<Topology> {
    use Topology::*;
    pick("VkPrimitiveTopology", &[PointList, LineList, LineStrip, TriangleList, TriangleStrip, TriangleFan], code)
}

/// `VkCompareOp`.
pub fn compare(code: u32) -> Outcome<Compare> {
    pick("VkCompareOp", Compare::ALL, code)
}

/// `VkStencilOp`.
pub fn stencil_op(code: u32) -> Outcome<StencilOp> {
    use StencilOp::*;
    let all = [Keep, Zero, Replace, IncrementClamp, DecrementClamp, Invert, IncrementWrap, DecrementWrap];
    pick("VkStencilOp", &all, code)
}

/// `VkBlendFactor`. Whether it takes the constant's alpha is asked with [`is_constant_alpha`].
pub fn blend_factor(code: u32) -> Outcome<BlendFactor> {
    use BlendFactor::*;
    let all = [
        Zero,
        One,
        Src,
        OneMinusSrc,
        Dst,
        OneMinusDst,
        SrcAlpha,
        OneMinusSrcAlpha,
        DstAlpha,
        OneMinusDstAlpha,
        Constant,
        OneMinusConstant,
        Constant,
        OneMinusConstant,
        SrcAlphaSaturated,
        Src1,
        OneMinusSrc1,
        Src1Alpha,
        OneMinusSrc1Alpha,
    ];
    pick("VkBlendFactor", &all, code)
}

/// Whether a blend factor is the alpha of the constant.
pub fn is_constant_alpha(code: u32) -> bool {
    matches!(code, 12 | 13)
}

/// Whether a blend factor is the colour of the constant.
pub fn is_constant_color(code: u32) -> bool {
    matches!(code, 10 | 11)
}

/// `VkBlendOp`.
pub fn blend_op(code: u32) -> Outcome<BlendOp> {
    pick("VkBlendOp", BlendOp::ALL, code)
}

/// `VkFilter`.
pub fn filter(code: u32) -> Outcome<FilterMode> {
    pick("VkFilter", FilterMode::ALL, code)
}

/// `VkSamplerAddressMode`.
pub fn address(code: u32) -> Outcome<AddressMode> {
    use AddressMode::*;
    pick("VkSamplerAddressMode", &[Repeat, MirrorRepeat, ClampToEdge, ClampToBorder], code)
}

/// `VkBorderColor`: floating-point and integer colours are the same here.
pub fn border(code: u32) -> Outcome<BorderColor> {
    use BorderColor::*;
    let all = [TransparentBlack, TransparentBlack, OpaqueBlack, OpaqueBlack, OpaqueWhite, OpaqueWhite];
    pick("VkBorderColor", &all, code)
}

/// `VkImageViewType`.
pub fn view_dimension(code: u32) -> Outcome<ViewDimension> {
    use ViewDimension::*;
    match code {
        4 => unsupported("an array of 1D images"),
        _ => pick("VkImageViewType", &[D1, D2, D3, Cube, D1, D2Array, CubeArray], code),
    }
}

/// `VkImageType`.
pub fn texture_dimension(code: u32) -> Outcome<TextureDimension> {
    pick("VkImageType", &[TextureDimension::D1, TextureDimension::D2, TextureDimension::D3], code)
}

/// `VkImageAspectFlags` of an image of this format.
pub fn aspect(flags: u32, format: Format) -> Outcome<Aspect> {
    let both = format.has_depth() && format.has_stencil();
    match flags {
        2 if both => Ok(Aspect::DepthOnly),
        4 if both => Ok(Aspect::StencilOnly),
        1 | 2 | 4 | 6 => Ok(Aspect::All),
        other => unsupported(format!("image aspects {other:#x}")),
    }
}
