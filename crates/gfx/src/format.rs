//! Texture formats: their names, sizes and aspects. The codecs of their texels are in `gfx::texel`.

use serde::{Deserialize, Serialize};

/// How a shader sees the texels of a format.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum TexelKind {
    /// Floating-point values (unorm, snorm, float, sRGB): can be blended where colour-renderable.
    Float,
    /// Unsigned integers.
    Uint,
    /// Signed integers.
    Sint,
    /// Depth, stencil or both.
    Depth,
}

/// How wide the texels of a format are for a unit that works on them: by the bits of a component, and of all of them.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
#[repr(u8)]
pub enum TexelClass {
    /// Components of up to 8 bits; compressed blocks too.
    #[default]
    Bytes,
    /// Wider components, in up to 32 bits.
    Packed,
    /// One component of 32 bits.
    Single,
    /// 64 bits of several narrower components.
    Halves,
    /// Two components of 32 bits, or one of 64.
    Pair,
    /// Four components of 32 bits.
    Full,
}

impl TexelClass {
    /// All classes, in declaration order: a class as a number is its place here.
    pub const ALL: [TexelClass; 6] =
        [TexelClass::Bytes, TexelClass::Packed, TexelClass::Single, TexelClass::Halves, TexelClass::Pair, TexelClass::Full];
}

macro_rules! formats {
    ($($name:ident $label:literal $bytes:literal $block:literal $comps:literal $kind:ident $srgb:literal),* $(,)?) => {
        /// A texture format; names and meanings are WebGPU's (`GPUTextureFormat`), which are also the names in a trace.
        #[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
        pub enum Format {
            $(#[doc = concat!("`", $label, "`")] $name,)*
        }

        impl Format {
            /// All formats, in declaration order.
            pub const ALL: &'static [Format] = &[$(Format::$name),*];

            /// The WebGPU name.
            pub const fn name(self) -> &'static str {
                match self { $(Format::$name => $label,)* }
            }

            /// The format of a WebGPU name.
            pub fn from_name(name: &str) -> Option<Format> {
                match name { $($label => Some(Format::$name),)* _ => None }
            }

            /// Bytes of one block (a texel, or 4x4 texels of a compressed format) as stored in memory.
            pub const fn block_bytes(self) -> u32 {
                match self { $(Format::$name => $bytes,)* }
            }

            /// Width and height of a block in texels: 1, or 4 for BC formats.
            pub const fn block_dim(self) -> u32 {
                match self { $(Format::$name => $block,)* }
            }

            /// Number of components that a shader reads.
            pub const fn components(self) -> u32 {
                match self { $(Format::$name => $comps,)* }
            }

            /// How a shader sees it.
            pub const fn kind(self) -> TexelKind {
                match self { $(Format::$name => TexelKind::$kind,)* }
            }

            /// Whether colours are stored with the sRGB transfer function.
            pub const fn is_srgb(self) -> bool {
                match self { $(Format::$name => $srgb,)* }
            }
        }
    };
}

formats! {
    R8Unorm "r8unorm" 1 1 1 Float false,
    R8Snorm "r8snorm" 1 1 1 Float false,
    R8Uint "r8uint" 1 1 1 Uint false,
    R8Sint "r8sint" 1 1 1 Sint false,
    R16Unorm "r16unorm" 2 1 1 Float false,
    R16Snorm "r16snorm" 2 1 1 Float false,
    R16Uint "r16uint" 2 1 1 Uint false,
    R16Sint "r16sint" 2 1 1 Sint false,
    R16Float "r16float" 2 1 1 Float false,
    Rg8Unorm "rg8unorm" 2 1 2 Float false,
    Rg8Snorm "rg8snorm" 2 1 2 Float false,
    Rg8Uint "rg8uint" 2 1 2 Uint false,
    Rg8Sint "rg8sint" 2 1 2 Sint false,
    R32Uint "r32uint" 4 1 1 Uint false,
    R32Sint "r32sint" 4 1 1 Sint false,
    R32Float "r32float" 4 1 1 Float false,
    Rg16Unorm "rg16unorm" 4 1 2 Float false,
    Rg16Snorm "rg16snorm" 4 1 2 Float false,
    Rg16Uint "rg16uint" 4 1 2 Uint false,
    Rg16Sint "rg16sint" 4 1 2 Sint false,
    Rg16Float "rg16float" 4 1 2 Float false,
    Rgba8Unorm "rgba8unorm" 4 1 4 Float false,
    Rgba8UnormSrgb "rgba8unorm-srgb" 4 1 4 Float true,
    Rgba8Snorm "rgba8snorm" 4 1 4 Float false,
    Rgba8Uint "rgba8uint" 4 1 4 Uint false,
    Rgba8Sint "rgba8sint" 4 1 4 Sint false,
    Bgra8Unorm "bgra8unorm" 4 1 4 Float false,
    Bgra8UnormSrgb "bgra8unorm-srgb" 4 1 4 Float true,
    Rgb9e5Ufloat "rgb9e5ufloat" 4 1 3 Float false,
    Rgb10a2Uint "rgb10a2uint" 4 1 4 Uint false,
    Rgb10a2Unorm "rgb10a2unorm" 4 1 4 Float false,
    Rg11b10Ufloat "rg11b10ufloat" 4 1 3 Float false,
    R64Uint "r64uint" 8 1 1 Uint false,
    Rg32Uint "rg32uint" 8 1 2 Uint false,
    Rg32Sint "rg32sint" 8 1 2 Sint false,
    Rg32Float "rg32float" 8 1 2 Float false,
    Rgba16Unorm "rgba16unorm" 8 1 4 Float false,
    Rgba16Snorm "rgba16snorm" 8 1 4 Float false,
    Rgba16Uint "rgba16uint" 8 1 4 Uint false,
    Rgba16Sint "rgba16sint" 8 1 4 Sint false,
    Rgba16Float "rgba16float" 8 1 4 Float false,
    Rgba32Uint "rgba32uint" 16 1 4 Uint false,
    Rgba32Sint "rgba32sint" 16 1 4 Sint false,
    Rgba32Float "rgba32float" 16 1 4 Float false,
    Stencil8 "stencil8" 1 1 1 Depth false,
    Depth16Unorm "depth16unorm" 2 1 1 Depth false,
    Depth24Plus "depth24plus" 4 1 1 Depth false,
    Depth24PlusStencil8 "depth24plus-stencil8" 4 1 1 Depth false,
    Depth32Float "depth32float" 4 1 1 Depth false,
    Depth32FloatStencil8 "depth32float-stencil8" 8 1 1 Depth false,
    Bc1RgbaUnorm "bc1-rgba-unorm" 8 4 4 Float false,
    Bc1RgbaUnormSrgb "bc1-rgba-unorm-srgb" 8 4 4 Float true,
    Bc2RgbaUnorm "bc2-rgba-unorm" 16 4 4 Float false,
    Bc2RgbaUnormSrgb "bc2-rgba-unorm-srgb" 16 4 4 Float true,
    Bc3RgbaUnorm "bc3-rgba-unorm" 16 4 4 Float false,
    Bc3RgbaUnormSrgb "bc3-rgba-unorm-srgb" 16 4 4 Float true,
    Bc4RUnorm "bc4-r-unorm" 8 4 1 Float false,
    Bc4RSnorm "bc4-r-snorm" 8 4 1 Float false,
    Bc5RgUnorm "bc5-rg-unorm" 16 4 2 Float false,
    Bc5RgSnorm "bc5-rg-snorm" 16 4 2 Float false,
    Bc6hRgbUfloat "bc6h-rgb-ufloat" 16 4 3 Float false,
    Bc6hRgbFloat "bc6h-rgb-float" 16 4 3 Float false,
    Bc7RgbaUnorm "bc7-rgba-unorm" 16 4 4 Float false,
    Bc7RgbaUnormSrgb "bc7-rgba-unorm-srgb" 16 4 4 Float true,
}

impl Format {
    /// Whether it has a depth aspect.
    pub const fn has_depth(self) -> bool {
        matches!(
            self,
            Format::Depth16Unorm
                | Format::Depth24Plus
                | Format::Depth24PlusStencil8
                | Format::Depth32Float
                | Format::Depth32FloatStencil8
        )
    }

    /// Whether it has a stencil aspect.
    pub const fn has_stencil(self) -> bool {
        matches!(self, Format::Stencil8 | Format::Depth24PlusStencil8 | Format::Depth32FloatStencil8)
    }

    /// Whether it has a depth or stencil aspect.
    pub const fn is_depth_stencil(self) -> bool {
        matches!(self.kind(), TexelKind::Depth)
    }

    /// How wide its texels are for a unit that works on them.
    pub const fn texel_class(self) -> TexelClass {
        let (bytes, components) = (self.block_bytes(), self.components());
        match self {
            _ if self.is_compressed() => TexelClass::Bytes,
            Format::Rgb10a2Unorm | Format::Rgb10a2Uint | Format::Rgb9e5Ufloat | Format::Rg11b10Ufloat => TexelClass::Packed,
            Format::Depth32FloatStencil8 => TexelClass::Single,
            _ if bytes == components => TexelClass::Bytes,
            _ => match (bytes, components) {
                (0..4, _) | (4, 2..) => TexelClass::Packed,
                (4, _) => TexelClass::Single,
                (5..=8, 4) => TexelClass::Halves,
                (5..=8, _) => TexelClass::Pair,
                _ => TexelClass::Full,
            },
        }
    }

    /// Whether it is block-compressed.
    pub const fn is_compressed(self) -> bool {
        self.block_dim() > 1
    }
}

#[cfg(test)]
mod tests {
    use super::{Format, TexelClass};

    #[test]
    fn texels_are_as_wide_as_their_components() {
        use TexelClass::{Bytes, Full, Halves, Packed, Pair, Single};
        let expected = [
            (Bytes, "r8unorm rg8unorm rgba8unorm-srgb bgra8unorm stencil8 bc1-rgba-unorm bc5-rg-snorm bc6h-rgb-ufloat"),
            (Packed, "r16float rg16float rgb9e5ufloat rgb10a2unorm rg11b10ufloat depth16unorm"),
            (Single, "r32float r32uint depth24plus depth24plus-stencil8 depth32float depth32float-stencil8"),
            (Halves, "rgba16float rgba16unorm"),
            (Pair, "rg32float r64uint"),
            (Full, "rgba32float rgba32uint"),
        ];
        for (class, names) in expected {
            for name in names.split(' ') {
                let format = Format::from_name(name).expect("a format");
                assert_eq!(format.texel_class(), class, "{name}");
            }
        }
        assert!(TexelClass::ALL.iter().enumerate().all(|(at, &class)| class as usize == at));
    }
}
