//! Formats of Vulkan: their storage images, and the texels of buffers.

use grammar::ImageFormat as I;

/// How the bits of a component are to be read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    Unorm,
    Snorm,
    Uint,
    Sint,
    Float,
}

/// A texel of a buffer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Texel {
    pub kind: Kind,
    /// Bits of a component; of all but those of `RGB10A2`, whose last has 2.
    pub bits: u32,
    pub components: u32,
    /// Whether the first and the third component are swapped.
    pub bgra: bool,
}

impl Texel {
    /// Bytes of a texel.
    pub fn bytes(self) -> u32 {
        if self.is_packed() { 4 } else { self.bits * self.components / 8 }
    }

    /// Whether it is three components of 10 bits and one of 2.
    pub fn is_packed(self) -> bool {
        self.bits == 10
    }

    /// Offset and width in bits of a component of the value.
    pub fn place(self, component: u32) -> (u32, u32) {
        let stored = if self.bgra && component != 3 { 2 - component.min(2) } else { component };
        let bits = if self.is_packed() && component == 3 { 2 } else { self.bits };
        (stored * self.bits, bits)
    }
}

/// The format of a storage image of this `VkFormat`.
pub fn image(format: u32) -> Option<I> {
    Some(match format {
        9 => I::R8,
        10 => I::R8Snorm,
        13 => I::R8ui,
        14 => I::R8i,
        16 => I::Rg8,
        17 => I::Rg8Snorm,
        20 => I::Rg8ui,
        21 => I::Rg8i,
        37 | 51 => I::Rgba8,
        38 | 52 => I::Rgba8Snorm,
        41 | 55 => I::Rgba8ui,
        42 | 56 => I::Rgba8i,
        64 => I::Rgb10A2,
        68 => I::Rgb10a2ui,
        70 => I::R16,
        71 => I::R16Snorm,
        74 => I::R16ui,
        75 => I::R16i,
        76 => I::R16f,
        77 => I::Rg16,
        78 => I::Rg16Snorm,
        81 => I::Rg16ui,
        82 => I::Rg16i,
        83 => I::Rg16f,
        91 => I::Rgba16,
        92 => I::Rgba16Snorm,
        95 => I::Rgba16ui,
        96 => I::Rgba16i,
        97 => I::Rgba16f,
        98 => I::R32ui,
        99 => I::R32i,
        100 => I::R32f,
        101 => I::Rg32ui,
        102 => I::Rg32i,
        103 => I::Rg32f,
        107 => I::Rgba32ui,
        108 => I::Rgba32i,
        109 => I::Rgba32f,
        122 => I::R11fG11fB10f,
        _ => return None,
    })
}

/// The texels of a buffer view of this `VkFormat`.
pub fn texel(format: u32) -> Option<Texel> {
    use Kind::{Float, Sint, Snorm, Uint, Unorm};
    let (kind, bits, components, bgra) = match format {
        9 => (Unorm, 8, 1, false),
        10 => (Snorm, 8, 1, false),
        13 => (Uint, 8, 1, false),
        14 => (Sint, 8, 1, false),
        16 => (Unorm, 8, 2, false),
        17 => (Snorm, 8, 2, false),
        20 => (Uint, 8, 2, false),
        21 => (Sint, 8, 2, false),
        37 | 51 => (Unorm, 8, 4, false),
        38 | 52 => (Snorm, 8, 4, false),
        41 | 55 => (Uint, 8, 4, false),
        42 | 56 => (Sint, 8, 4, false),
        44 => (Unorm, 8, 4, true),
        45 => (Snorm, 8, 4, true),
        48 => (Uint, 8, 4, true),
        49 => (Sint, 8, 4, true),
        58 => (Unorm, 10, 4, true),
        62 => (Uint, 10, 4, true),
        64 => (Unorm, 10, 4, false),
        68 => (Uint, 10, 4, false),
        70 => (Unorm, 16, 1, false),
        71 => (Snorm, 16, 1, false),
        74 => (Uint, 16, 1, false),
        75 => (Sint, 16, 1, false),
        76 => (Float, 16, 1, false),
        77 => (Unorm, 16, 2, false),
        78 => (Snorm, 16, 2, false),
        81 => (Uint, 16, 2, false),
        82 => (Sint, 16, 2, false),
        83 => (Float, 16, 2, false),
        91 => (Unorm, 16, 4, false),
        92 => (Snorm, 16, 4, false),
        95 => (Uint, 16, 4, false),
        96 => (Sint, 16, 4, false),
        97 => (Float, 16, 4, false),
        98 => (Uint, 32, 1, false),
        99 => (Sint, 32, 1, false),
        100 => (Float, 32, 1, false),
        101 => (Uint, 32, 2, false),
        102 => (Sint, 32, 2, false),
        103 => (Float, 32, 2, false),
        104 => (Uint, 32, 3, false),
        105 => (Sint, 32, 3, false),
        106 => (Float, 32, 3, false),
        107 => (Uint, 32, 4, false),
        108 => (Sint, 32, 4, false),
        109 => (Float, 32, 4, false),
        _ => return None,
    };
    Some(Texel { kind, bits, components, bgra })
}

/// The texels of a storage texel buffer whose type has this format.
pub fn texel_of_image(format: u32) -> Option<Texel> {
    (1..=122).filter_map(|vk| Some((image(vk)?, texel(vk)?))).find(|(image, _)| *image as u32 == format).map(|(_, texel)| texel)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn components_lie_where_vulkan_has_them() {
        let [bgra, packed] = [44, 64].map(|format| texel(format).expect("a format"));
        assert_eq!([0, 1, 2, 3].map(|component| bgra.place(component)), [(16, 8), (8, 8), (0, 8), (24, 8)]);
        assert_eq!([0, 2, 3].map(|component| packed.place(component)), [(0, 10), (20, 10), (30, 2)]);
        assert_eq!((bgra.bytes(), packed.bytes(), texel(106).map(Texel::bytes)), (4, 4, Some(12)));
        assert_eq!(texel_of_image(I::R8 as u32), texel(9));
        assert_eq!(texel_of_image(I::Rgba8 as u32), texel(37));
    }
}
