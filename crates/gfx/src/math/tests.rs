use super::*;
use num::Lanes;

/// Distance from the f64 value in units of the last place of its f32 neighbourhood.
fn ulps(got: f32, want: f64) -> f64 {
    if want.is_nan() {
        return if got.is_nan() { 0.0 } else { f64::INFINITY };
    }
    let rounded = want as f32;
    if rounded.is_infinite() || rounded == 0.0 {
        return if got == rounded { 0.0 } else { f64::INFINITY };
    }
    let magnitude = rounded.abs().max(f32::MIN_POSITIVE);
    let ulp = f64::from(f32::from_bits(magnitude.to_bits() + 1)) - f64::from(magnitude);
    (f64::from(got) - want).abs() / ulp
}

/// Evenly spaced numbers, ends included.
fn sweep(from: f32, to: f32, n: usize) -> impl Iterator<Item = f32> {
    (0..=n).map(move |i| from + (to - from) * (i as f32 / n as f32))
}

/// Numbers of every binade, both signs.
fn all_binades() -> impl Iterator<Item = f32> {
    (0..u32::MAX).step_by(7919 * 13).map(f32::from_bits)
}

#[track_caller]
fn worst(numbers: impl Iterator<Item = f32>, f: impl Fn(f32) -> f32, exact: impl Fn(f64) -> f64, bound: f64) {
    let mut most = (0.0, 0.0);
    for x in numbers {
        let error = ulps(f(x), exact(f64::from(x)));
        if error > most.0 {
            most = (error, x);
        }
    }
    assert!(most.0 <= bound, "{} ULP at {:e}, bound {bound}", most.0, most.1);
}

#[track_caller]
fn worst_absolute(numbers: impl Iterator<Item = f32>, f: impl Fn(f32) -> f32, exact: impl Fn(f64) -> f64, bound: f64) {
    for x in numbers {
        let error = (f64::from(f(x)) - exact(f64::from(x))).abs();
        assert!(error <= bound, "{error:e} at {x:e}, bound {bound:e}");
    }
}

#[test]
fn exponentials_are_within_two_ulp() {
    worst(sweep(-126.0, 127.99, 300_000), exp2, libm::exp2, 2.0);
    worst(sweep(-151.0, -126.0, 20_000), exp2, libm::exp2, 1.0);
    worst(sweep(-1.0, 1.0, 100_000), exp2, libm::exp2, 2.0);
    worst(sweep(-87.0, 88.7, 300_000), exp, libm::exp, 2.0);
    for e in -149..=127 {
        assert_eq!(exp2(e as f32), libm::exp2(f64::from(e)) as f32, "2^{e}");
    }
}

#[test]
fn logarithms_are_within_two_ulp() {
    let positive = || all_binades().filter(|x| *x > 0.0 && x.is_finite());
    worst(positive().filter(|x| !(0.5..=2.0).contains(x)), log2, libm::log2, 2.0);
    worst(positive().filter(|x| !(0.5..=2.0).contains(x)), log, libm::log, 2.0);
    worst_absolute(sweep(0.5, 2.0, 300_000), log2, libm::log2, 2f64.powi(-22));
    worst_absolute(sweep(0.5, 2.0, 300_000), log, libm::log, 2f64.powi(-22));
    for e in -126..=127 {
        assert_eq!(log2(exp2(e as f32)), e as f32);
    }
}

#[test]
fn sine_and_cosine_stay_near_f64() {
    let bound = 2f64.powi(-22);
    for (low, high) in [(-3.2, 3.2), (-100.0, 100.0), (-8192.0, 8192.0)] {
        worst_absolute(sweep(low, high, 300_000), sin, libm::sin, bound);
        worst_absolute(sweep(low, high, 300_000), cos, libm::cos, bound);
    }
    worst(sweep(-0.78, 0.78, 100_000).filter(|x| *x != 0.0), sin, libm::sin, 2.0);
    worst(sweep(-0.78, 0.78, 100_000), cos, libm::cos, 2.0);
    worst(sweep(-1.5, 1.5, 100_000).filter(|x| *x != 0.0), tan, libm::tan, 5.0);
    worst(all_binades().filter(|x| x.abs() > 8192.0 && x.is_finite()), sin, libm::sin, 2.0);
}

#[test]
fn inverse_functions_stay_near_f64() {
    worst(sweep(-1.0, 1.0, 300_000).filter(|x| *x != 0.0), asin, libm::asin, 4.0);
    worst_absolute(sweep(-1.0, 1.0, 300_000), acos, libm::acos, 2f64.powi(-21));
    worst(all_binades().filter(|x| x.is_finite() && x.abs() > 1e-30), atan, libm::atan, 4.0);
    worst(all_binades().filter(|x| *x > 1e-37 && x.is_finite()), inverse_sqrt, |x| 1.0 / x.sqrt(), 2.0);
    for i in 0..720 {
        let angle = f64::from(i) * core::f64::consts::PI / 360.0 - core::f64::consts::PI;
        let (y, x) = (libm::sin(angle) as f32 * 3.0, libm::cos(angle) as f32 * 3.0);
        let error = f64::from(atan2(y, x)) - libm::atan2(f64::from(y), f64::from(x));
        assert!(error.abs() < 1e-6, "{y} {x}: {error:e}");
    }
}

#[test]
fn special_values_are_defined() {
    assert_eq!(exp2(f32::INFINITY), f32::INFINITY);
    assert_eq!(exp2(f32::NEG_INFINITY), 0.0);
    assert_eq!(exp2(128.0), f32::INFINITY);
    assert_eq!(exp(f32::INFINITY), f32::INFINITY);
    assert_eq!(exp(f32::NEG_INFINITY), 0.0);
    assert_eq!(log2(0.0), f32::NEG_INFINITY);
    assert_eq!(log2(-0.0), f32::NEG_INFINITY);
    assert_eq!(log2(f32::INFINITY), f32::INFINITY);
    assert_eq!(log(f32::INFINITY), f32::INFINITY);
    for f in [exp2, exp, log2, log, sin, cos, tan, asin, acos, atan] {
        assert!(f(f32::NAN).is_nan());
    }
    for f in [log2, log, sin, cos, asin, acos] {
        assert!(f(f32::NEG_INFINITY).is_nan());
    }
    assert_eq!(atan(f32::INFINITY), core::f32::consts::FRAC_PI_2);
    assert_eq!(atan2(0.0, 0.0), 0.0);
    assert_eq!(atan2(0.0, -1.0), core::f32::consts::PI);
    assert_eq!(atan2(-0.0, -1.0), -core::f32::consts::PI);
    assert_eq!(atan2(f32::INFINITY, f32::INFINITY), core::f32::consts::FRAC_PI_4);
    assert!(asin(1.1).is_nan() && acos(-1.1).is_nan());
    assert_eq!(pow(0.0, 2.0), 0.0);
    assert_eq!(pow(7.0, 0.0), 1.0);
    assert_eq!(pow(2.0, 10.0), 1024.0);
    assert!(pow(-1.0, 0.5).is_nan());
}

#[test]
fn lanes_equal_scalars_bit_for_bit() {
    type Scalar = fn(f32) -> f32;
    type Batch = fn(&[f32; 64], &mut [f32; 64]);
    let pairs: &[(Scalar, Batch)] = &[
        (exp, lanes::exp),
        (exp2, lanes::exp2),
        (log, lanes::log),
        (log2, lanes::log2),
        (sin, lanes::sin),
        (cos, lanes::cos),
        (tan, lanes::tan),
        (asin, lanes::asin),
        (acos, lanes::acos),
        (atan, lanes::atan),
        (tanh, lanes::tanh),
    ];
    let mut random = num::Random::new(1);
    for _ in 0..500 {
        let mut x = Lanes::ZERO;
        for bits in &mut x.0 {
            *bits = random.bits();
        }
        for (index, (scalar, batch)) in pairs.iter().enumerate() {
            let mut out = Lanes::ZERO;
            batch(x.f32(), out.f32_mut());
            for i in 0..64 {
                let (got, want) = (out.f32()[i], scalar(x.f32()[i]));
                assert!(got.to_bits() == want.to_bits() || got.is_nan() && want.is_nan(), "{index}: {:e}", x.f32()[i]);
            }
        }
    }
}
