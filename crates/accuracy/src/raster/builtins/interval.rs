//! What WGSL allows a result to be, as an interval: the rules of "Floating Point Evaluation" on the ends of the operands' intervals,
//! in `f64`.

use crate::raster::numbers::ulp;

/// All numbers from `lo` to `hi`. An infinite end means that any result is allowed, NaN included.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Interval {
    pub lo: f64,
    pub hi: f64,
}

/// Nothing is promised.
pub const ANY: Interval = Interval { lo: f64::NEG_INFINITY, hi: f64::INFINITY };

/// The largest `f32` that is not above a number.
fn down(x: f64) -> f64 {
    let near = x as f32;
    f64::from(if f64::from(near) > x { near.next_down() } else { near })
}

/// A number alone.
pub fn point(x: f64) -> Interval {
    Interval { lo: x, hi: x }
}

/// Both neighbours of a number that is none, between which a correctly rounded result may choose.
pub fn rounded(x: f64) -> Interval {
    Interval { lo: x, hi: x }.outward()
}

/// So near to a number.
pub fn near(x: f64, error: f64) -> Interval {
    Interval { lo: x - error, hi: x + error }.flushed()
}

impl Interval {
    pub fn is_any(self) -> bool {
        !(self.lo.is_finite() && self.hi.is_finite())
    }

    /// Whether a result is allowed.
    pub fn allows(self, result: f32) -> bool {
        self.is_any() || (self.lo..=self.hi).contains(&f64::from(result))
    }

    pub fn contains(self, x: f64) -> bool {
        (self.lo..=self.hi).contains(&x)
    }

    /// Both and what lies between.
    pub fn or(self, other: Interval) -> Interval {
        Interval { lo: self.lo.min(other.lo), hi: self.hi.max(other.hi) }
    }

    /// Rounded outwards to `f32`. A result that may be larger than any is not bounded.
    fn outward(self) -> Interval {
        let most = f64::from(f32::MAX);
        if self.lo.is_nan() || self.hi.is_nan() || self.lo < -most || self.hi > most {
            return ANY;
        }
        Interval { lo: down(self.lo), hi: -down(-self.hi) }.flushed()
    }

    /// Results that are subnormal may be flushed to 0.
    fn flushed(self) -> Interval {
        let least = f64::from(f32::MIN_POSITIVE);
        let lo = if self.lo > 0.0 && self.lo < least { 0.0 } else { self.lo };
        let hi = if self.hi < 0.0 && self.hi > -least { 0.0 } else { self.hi };
        Interval { lo, hi }
    }

    /// The interval, wider at each end by a number of units in the last place of that end.
    fn off_by(self, ulps: [f64; 2]) -> Interval {
        if self.is_any() {
            return ANY;
        }
        let (lo, hi) = (self.lo - ulps[0] * ulp(self.lo), self.hi + ulps[1] * ulp(self.hi));
        if lo < -f64::from(f32::MAX) || hi > f64::from(f32::MAX) { ANY } else { Interval { lo, hi }.flushed() }
    }

    fn ends(self, other: Interval, f: impl Fn(f64, f64) -> f64) -> Interval {
        if self.is_any() || other.is_any() {
            return ANY;
        }
        let all = [f(self.lo, other.lo), f(self.lo, other.hi), f(self.hi, other.lo), f(self.hi, other.hi)];
        let bound = |pick: fn(f64, f64) -> f64| all.into_iter().reduce(pick).unwrap_or(f64::NAN);
        Interval { lo: bound(f64::min), hi: bound(f64::max) }
    }

    /// A function that rises or falls, of both ends.
    pub fn map(self, f: impl Fn(f64) -> f64) -> Interval {
        if self.is_any() {
            return ANY;
        }
        let (p, q) = (f(self.lo), f(self.hi));
        Interval { lo: p.min(q), hi: p.max(q) }
    }

    pub fn plus(self, other: Interval) -> Interval {
        self.ends(other, |a, b| a + b).outward()
    }

    pub fn minus(self, other: Interval) -> Interval {
        self.ends(other, |a, b| a - b).outward()
    }

    pub fn times(self, other: Interval) -> Interval {
        self.ends(other, |a, b| a * b).outward()
    }

    /// 2.5 ULP where the divisor's magnitude is from 2^-126 to 2^126.
    pub fn over(self, divisor: Interval) -> Interval {
        let (least, most) = (f64::from(f32::MIN_POSITIVE), libm::exp2(126.0));
        let (low, high) = (divisor.lo.abs().min(divisor.hi.abs()), divisor.lo.abs().max(divisor.hi.abs()));
        if divisor.contains(0.0) || low < least || high > most {
            return ANY;
        }
        self.ends(divisor, |a, b| a / b).off_by([2.5; 2])
    }

    /// 2 ULP of positive numbers.
    pub fn inverse_sqrt(self) -> Interval {
        if self.lo <= 0.0 { ANY } else { self.map(|x| 1.0 / libm::sqrt(x)).off_by([2.0; 2]) }
    }

    /// Inherited from 1 / inverseSqrt.
    pub fn sqrt(self) -> Interval {
        point(1.0).over(self.inverse_sqrt())
    }

    /// 3 + 2 |x| ULP of a power of `base`.
    fn power_of(self, base: fn(f64) -> f64) -> Interval {
        self.map(base).off_by([self.lo, self.hi].map(|x| 3.0 + 2.0 * x.abs()))
    }

    pub fn exp(self) -> Interval {
        self.power_of(libm::exp)
    }

    pub fn exp2(self) -> Interval {
        self.power_of(libm::exp2)
    }

    /// 3 ULP of a logarithm, or 2^-21 where the operand is in [0.5, 2].
    fn logarithm(self, of: fn(f64) -> f64) -> Interval {
        if self.lo <= 0.0 || self.is_any() {
            return ANY;
        }
        let end =
            |x: f64| if (0.5..=2.0).contains(&x) { near(of(x), 1.0 / 2_097_152.0) } else { point(of(x)).off_by([3.0; 2]) };
        end(self.lo).or(end(self.hi))
    }

    pub fn log(self) -> Interval {
        self.logarithm(libm::log)
    }

    pub fn log2(self) -> Interval {
        self.logarithm(libm::log2)
    }

    /// 4096 ULP.
    pub fn atan(self) -> Interval {
        self.map(libm::atan).off_by([4096.0; 2])
    }

    /// 2^-11 in [-pi, pi].
    pub fn circular(self, of: fn(f64) -> f64) -> Interval {
        let pi = f64::from(std::f32::consts::PI);
        if self.lo != self.hi || self.lo.abs() > pi { ANY } else { near(of(self.lo), 1.0 / 2048.0) }
    }
}

/// 4096 ULP where y is normal and the magnitude of x from 2^-126 to 2^126.
pub fn atan2(y: f64, x: f64) -> Interval {
    let least = f64::from(f32::MIN_POSITIVE);
    if y.abs() < least || !(least..=libm::exp2(126.0)).contains(&x.abs()) {
        return ANY;
    }
    point(libm::atan2(y, x)).off_by([4096.0; 2])
}

/// Products added in any order.
pub fn dot(x: &[Interval], y: &[Interval]) -> Interval {
    let product = |k: usize| x[k].times(y[k]);
    match x.len() {
        2 => product(0).plus(product(1)),
        _ => {
            let order = |a: usize, b: usize, c: usize| product(a).plus(product(b)).plus(product(c));
            order(0, 1, 2).or(order(0, 2, 1)).or(order(1, 2, 0))
        }
    }
}

pub fn length(x: &[Interval]) -> Interval {
    dot(x, x).sqrt()
}

/// The nearest halves on both sides of a number; ANY beyond the largest.
pub fn rounded16(x: f64) -> Interval {
    if x.abs() > 65504.0 {
        return ANY;
    }
    // The spacing of halves of this size, subnormal ones included.
    let exponent = if x == 0.0 { -14 } else { libm::ilogb(x).max(-14) };
    let step = libm::exp2(f64::from(exponent - 10));
    let (lo, hi) = ((x / step).floor() * step, (x / step).ceil() * step);
    // Subnormal ones may be flushed.
    let least = libm::exp2(-14.0);
    Interval { lo: if lo > 0.0 && lo < least { 0.0 } else { lo }, hi: if hi < 0.0 && hi > -least { 0.0 } else { hi } }
}
