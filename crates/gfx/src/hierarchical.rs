//! Hierarchical Z: what bounds on new and on stored depths prove.

use super::format::Format;
use super::state::Compare;

/// The depth in a code of a format as a number that orders as depths do: unorm codes without their stencil, floats by their bits.
#[inline(always)]
pub fn depth_key(format: Format, code: u32) -> u32 {
    match format {
        Format::Depth24PlusStencil8 | Format::Depth24Plus => code & 0x00ff_ffff,
        Format::Depth32Float | Format::Depth32FloatStencil8 => code ^ ((code as i32 >> 31) as u32 | 0x8000_0000),
        _ => code,
    }
}

/// Whether no depth between `low` and `high` can pass against any stored one between `min` and `max` (all as keys).
#[inline(always)]
pub fn culls(compare: Compare, low: u32, high: u32, min: u32, max: u32) -> bool {
    match compare {
        Compare::Never => true,
        Compare::Less => low >= max,
        Compare::LessEqual => low > max,
        Compare::Equal => low > max || high < min,
        Compare::Greater => high <= min,
        Compare::GreaterEqual => high < min,
        Compare::NotEqual => min == max && low == high && low == min,
        Compare::Always => false,
    }
}

/// Whether every depth between `low` and `high` passes against every stored one between `min` and `max` (all as keys).
#[inline(always)]
pub fn accepts(compare: Compare, low: u32, high: u32, min: u32, max: u32) -> bool {
    match compare {
        Compare::Never => false,
        Compare::Less => high < min,
        Compare::LessEqual => high <= min,
        Compare::Equal => min == max && low == high && low == min,
        Compare::Greater => low > max,
        Compare::GreaterEqual => low >= max,
        Compare::NotEqual => low > max || high < min,
        Compare::Always => true,
    }
}

/// Whether passing fragments may store a depth above, and below, the one that was there.
#[inline(always)]
pub fn may_raise_lower(compare: Compare) -> (bool, bool) {
    match compare {
        Compare::Never | Compare::Equal => (false, false),
        Compare::Less | Compare::LessEqual => (false, true),
        Compare::Greater | Compare::GreaterEqual => (true, false),
        Compare::NotEqual | Compare::Always => (true, true),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn culling_and_acceptance_agree_with_the_comparison() {
        for &compare in Compare::ALL {
            for low in 0..5 {
                for high in low..5 {
                    for min in 0..5 {
                        for max in min..5 {
                            let passes = |new: u32, old: u32| compare.test(new as f32, old as f32);
                            let possible = (low..=high).any(|new| (min..=max).any(|old| passes(new, old)));
                            let certain = (low..=high).all(|new| (min..=max).all(|old| passes(new, old)));
                            // What bounds can prove they do prove.
                            assert_eq!(culls(compare, low, high, min, max), !possible, "{compare:?}");
                            assert_eq!(accepts(compare, low, high, min, max), certain, "{compare:?}");
                        }
                    }
                }
            }
        }
    }
}
