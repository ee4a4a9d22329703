//! What is known about a register: ranges that contain the values of all invocations.

/// The values that 32 bits can have, in three readings. Each reading that is given is true of every value; without any, all values are possible.
#[derive(Clone, Copy, Debug, PartialEq, Default)]
pub struct Range {
    /// As unsigned numbers: least and greatest.
    pub(super) unsigned: Option<(u32, u32)>,
    /// As signed numbers.
    pub(super) signed: Option<(i32, i32)>,
    /// As floating-point numbers: the ends are finite, so that no value is NaN. Both zeros are one number.
    pub(super) float: Option<(f32, f32)>,
}

impl Range {
    /// Anything.
    pub const ANY: Range = Range { unsigned: None, signed: None, float: None };

    /// False or true.
    pub(super) const BOOL: Range = Range { unsigned: Some((0, 1)), signed: Some((0, 1)), float: None };

    /// These bits and no others.
    pub fn point(bits: u32) -> Range {
        let x = f32::from_bits(bits);
        Range { unsigned: Some((bits, bits)), signed: Some((bits as i32, bits as i32)), float: x.is_finite().then_some((x, x)) }
    }

    /// All of these values; anything if there are none.
    pub fn all<'a>(bits: impl IntoIterator<Item = &'a u32>) -> Range {
        bits.into_iter().map(|&bits| Range::point(bits)).reduce(Range::join).unwrap_or(Range::ANY)
    }

    /// All unsigned numbers from the least to the greatest.
    pub fn unsigned(least: u32, greatest: u32) -> Range {
        Range::integers(Some((least, greatest)), None)
    }

    /// Floating-point numbers from the least to the greatest; anything where an end is infinite or NaN. Where both ends are finite no
    /// value between them is infinite, so that a value that came of an overflow is never held to be in a range.
    pub fn floats(least: f32, greatest: f32) -> Range {
        let float = (least.is_finite() && greatest.is_finite()).then_some((least, greatest));
        Range { float, ..Range::ANY }
    }

    /// Integers of which one or both readings are known; one follows from the other where the sign is known.
    pub(super) fn integers(unsigned: Option<(u32, u32)>, signed: Option<(i32, i32)>) -> Range {
        let one_sign = |(a, b): (u32, u32)| (a as i32 <= b as i32).then_some((a as i32, b as i32));
        let same_sign = |(a, b): (i32, i32)| (a as u32 <= b as u32).then_some((a as u32, b as u32));
        Range { unsigned: unsigned.or(signed.and_then(same_sign)), signed: signed.or(unsigned.and_then(one_sign)), float: None }
    }

    /// What is true of both.
    pub fn join(self, other: Range) -> Range {
        let float = self.float.zip(other.float);
        Range {
            unsigned: self.unsigned.zip(other.unsigned).map(|((a, b), (c, d))| (a.min(c), b.max(d))),
            signed: self.signed.zip(other.signed).map(|((a, b), (c, d))| (a.min(c), b.max(d))),
            float: float.map(|((a, b), (c, d))| (if c < a { c } else { a }, if d > b { d } else { b })),
        }
    }

    /// The bits, where there is only one possibility.
    pub fn bits(self) -> Option<u32> {
        self.unsigned.filter(|(least, greatest)| least == greatest).map(|(bits, _)| bits)
    }

    /// Least and greatest number in floating point; none: some value may be infinite or NaN.
    pub fn ends(self) -> Option<(f32, f32)> {
        self.float
    }

    /// Whether a condition holds for all invocations, for none, or is not known.
    pub(super) fn truth(self) -> Option<bool> {
        match self.unsigned {
            Some((0, 0)) => Some(false),
            Some((least, _)) if least > 0 => Some(true),
            _ => None,
        }
    }

    /// Whether the range contains a value.
    #[cfg(test)]
    pub fn holds(self, bits: u32) -> bool {
        let x = f32::from_bits(bits);
        self.unsigned.is_none_or(|(a, b)| (a..=b).contains(&bits))
            && self.signed.is_none_or(|(a, b)| (a..=b).contains(&(bits as i32)))
            && self.float.is_none_or(|(a, b)| a <= x && x <= b)
    }
}
