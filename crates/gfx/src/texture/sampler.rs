//! Samplers, and where a coordinate falls among the texels of an axis.

use crate::state::{AddressMode, BorderColor, Compare, FilterMode, SamplerDesc};

/// A sampler made ready.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sampler {
    pub(super) address: [AddressMode; 3],
    pub(super) mag_linear: bool,
    pub(super) min_linear: bool,
    pub(super) mip_linear: bool,
    pub(super) lod_min: f32,
    pub(super) lod_max: f32,
    pub(super) compare: Compare,
    pub(super) anisotropy: f32,
    pub(super) border: [f32; 4],
}

impl Sampler {
    /// Prepares a sampler. A level range of the wrong order, or with NaN, is that of its lower bound (0 for NaN). Anisotropy
    /// counts with linear filters only.
    pub fn new(desc: &SamplerDesc) -> Sampler {
        let linear = desc.mag == FilterMode::Linear && desc.min == FilterMode::Linear;
        let lod_min = if desc.lod_min.is_nan() { 0.0 } else { desc.lod_min };
        Sampler {
            address: desc.address,
            mag_linear: desc.mag == FilterMode::Linear,
            min_linear: desc.min == FilterMode::Linear,
            mip_linear: desc.mipmap == FilterMode::Linear,
            lod_min,
            lod_max: if desc.lod_max > lod_min { desc.lod_max } else { lod_min },
            compare: desc.compare.unwrap_or(Compare::Always),
            anisotropy: if linear { f32::from(desc.anisotropy.clamp(1, 16)) } else { 1.0 },
            border: match desc.border {
                BorderColor::TransparentBlack => [0.0; 4],
                BorderColor::OpaqueBlack => [0.0, 0.0, 0.0, 1.0],
                BorderColor::OpaqueWhite => [1.0; 4],
            },
        }
    }
}

/// A texel outside the texture, where the border colour is read.
pub(super) const BORDER: i32 = -1;

/// The two neighbouring texels of an axis and the weight of the second.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Axis {
    pub first: i32,
    pub second: i32,
    pub weight: f32,
}

/// A coordinate brought to a range in which it can be scaled and floored without loss or overflow: the fraction of a period for
/// repeating modes, the neighbourhood of the texture for clamping ones. NaN becomes 0.
#[inline(always)]
pub(super) fn fold(mode: AddressMode, u: f32) -> f32 {
    let folded = match mode {
        AddressMode::Repeat => u - u.floor(),
        AddressMode::MirrorRepeat => u - 2.0 * (u * 0.5).floor(),
        AddressMode::ClampToEdge | AddressMode::ClampToBorder => u.clamp(-1.0, 2.0),
    };
    // Infinity less itself is NaN as well.
    if folded.is_nan() { 0.0 } else { folded }
}

/// The texel index of an integer place, any number of periods away.
#[inline(always)]
pub(super) fn wrap(mode: AddressMode, i: i32, n: i32) -> i32 {
    // Most places are inside, and a division takes longer than all else here.
    if (0..n).contains(&i) {
        return i;
    }
    match mode {
        AddressMode::ClampToEdge => i.clamp(0, n - 1),
        AddressMode::Repeat => i.rem_euclid(n),
        AddressMode::MirrorRepeat => {
            let m = i.rem_euclid(2 * n);
            if m < n { m } else { 2 * n - 1 - m }
        }
        AddressMode::ClampToBorder => {
            if i >= 0 && i < n {
                i
            } else {
                BORDER
            }
        }
    }
}

/// The texel nearest to a coordinate in [0, 1], `offset` texels on.
#[inline(always)]
pub(super) fn nearest(mode: AddressMode, u: f32, n: u32, offset: i32) -> i32 {
    let place = (fold(mode, u) * n as f32).floor() as i32;
    wrap(mode, place + offset, n as i32)
}

/// The texels on both sides of a coordinate, `offset` texels on.
#[inline(always)]
pub(super) fn linear(mode: AddressMode, u: f32, n: u32, offset: i32) -> Axis {
    let place = fold(mode, u) * n as f32 - 0.5;
    let whole = place.floor();
    let i = whole as i32 + offset;
    Axis { first: wrap(mode, i, n as i32), second: wrap(mode, i + 1, n as i32), weight: place - whole }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn modes_wrap_as_specified() {
        let at = |mode, u| nearest(mode, u, 4, 0);
        for (u, clamp, repeat, mirror, border) in [
            (-0.6, 0, 1, 2, BORDER),
            (-0.1, 0, 3, 0, BORDER),
            (0.0, 0, 0, 0, 0),
            (0.99, 3, 3, 3, 3),
            (1.0, 3, 0, 3, BORDER),
            (1.3, 3, 1, 2, BORDER),
            (2.1, 3, 0, 0, BORDER),
        ] {
            assert_eq!(at(AddressMode::ClampToEdge, u), clamp, "{u}");
            assert_eq!(at(AddressMode::Repeat, u), repeat, "{u}");
            assert_eq!(at(AddressMode::MirrorRepeat, u), mirror, "{u}");
            assert_eq!(at(AddressMode::ClampToBorder, u), border, "{u}");
        }
        assert_eq!(linear(AddressMode::Repeat, 0.0, 4, 0), Axis { first: 3, second: 0, weight: 0.5 });
        assert_eq!(linear(AddressMode::ClampToEdge, 0.0, 4, 0), Axis { first: 0, second: 0, weight: 0.5 });
        assert_eq!(linear(AddressMode::MirrorRepeat, 1.0, 4, 0), Axis { first: 3, second: 3, weight: 0.5 });
        assert_eq!(linear(AddressMode::ClampToBorder, 0.0, 4, 0), Axis { first: BORDER, second: 0, weight: 0.5 });
        assert_eq!(linear(AddressMode::Repeat, 0.375, 4, -3), Axis { first: 2, second: 3, weight: 0.0 });
    }

    proptest! {
        #[test]
        fn any_coordinate_gives_a_texel(bits in any::<u32>(), n in 1_u32..5000, offset in -8_i32..8) {
            let u = f32::from_bits(bits);
            for &mode in AddressMode::ALL {
                let valid = |i: i32| (0..n as i32).contains(&i) || mode == AddressMode::ClampToBorder && i == BORDER;
                prop_assert!(valid(nearest(mode, u, n, offset)));
                let axis = linear(mode, u, n, offset);
                prop_assert!(valid(axis.first) && valid(axis.second) && (0.0..1.0).contains(&axis.weight));
            }
        }
    }
}
