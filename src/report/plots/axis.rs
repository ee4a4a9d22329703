//! Axes: where a value goes, and which values are written beside it.

/// How values go along an axis.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Scale {
    /// From the smallest to the largest.
    Linear,
    /// From 0 to the largest.
    FromZero,
    /// Logarithmic; values must be above 0.
    Log,
}

/// An axis of a plot.
#[derive(Clone, Debug)]
pub struct Axis {
    scale: Scale,
    low: f64,
    high: f64,
}

/// Powers of ten, from a billionth on, exactly as they are written: products of roundings would show in ticks.
fn decades() -> impl Iterator<Item = f64> {
    (-9..=18).filter_map(|power| format!("1e{power}").parse().ok())
}

/// Steps between ticks: 1, 2 or 5 times a power of ten, at least so that there are at most `most`.
fn step(span: f64, most: usize) -> f64 {
    let mut steps = decades().flat_map(|decade| [1.0, 2.0, 5.0].map(|factor| factor * decade));
    steps.find(|step| span / step <= most as f64).unwrap_or(span)
}

impl Axis {
    /// An axis for values; what is not finite does not count.
    pub fn new(scale: Scale, values: impl Iterator<Item = f64>) -> Axis {
        let (mut low, mut high) = (f64::INFINITY, f64::NEG_INFINITY);
        for value in values.filter(|value| value.is_finite() && (scale != Scale::Log || *value > 0.0)) {
            (low, high) = (low.min(value), high.max(value));
        }
        if low > high {
            (low, high) = (1.0, 2.0);
        }
        match scale {
            Scale::FromZero => low = 0.0,
            Scale::Log => (low, high) = (low / 1.15, high * 1.15),
            Scale::Linear => {}
        }
        if high <= low {
            (low, high) = (low - 0.5 * low.abs().max(1.0), high + 0.5 * high.abs().max(1.0));
        }
        Axis { scale, low, high }
    }

    /// An axis of names, which are numbered from 0.
    pub fn of_names(count: usize) -> Axis {
        Axis { scale: Scale::Linear, low: -0.5, high: count as f64 - 0.5 }
    }

    /// The place of a value, from 0 to 1.
    pub fn place(&self, value: f64) -> f64 {
        let part = match self.scale {
            Scale::Log => libm::log2(value.max(self.low) / self.low) / libm::log2(self.high / self.low),
            _ => (value - self.low) / (self.high - self.low),
        };
        part.clamp(0.0, 1.0)
    }

    /// Values that are written beside it, at most about `most`.
    pub fn ticks(&self, most: usize) -> Vec<f64> {
        if self.scale != Scale::Log {
            let step = step(self.high - self.low, most);
            let first = (self.low / step).ceil() as i64;
            return (first..).map(|n| n as f64 * step).take_while(|value| *value <= self.high * (1.0 + 1e-9)).collect();
        }
        let span = libm::log10(self.high / self.low);
        let factors: &[f64] = if span < 1.2 {
            &[1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 8.0]
        } else if span < 2.5 {
            &[1.0, 2.0, 5.0]
        } else {
            &[1.0]
        };
        let mut ticks = Vec::new();
        for decade in decades() {
            ticks.extend(factors.iter().map(|factor| factor * decade).filter(|value| (self.low..=self.high).contains(value)));
        }
        let thin = ticks.len().div_ceil(most.max(1)).max(1);
        ticks.into_iter().step_by(thin).collect()
    }
}

/// A value as it stands beside an axis: three digits, with k, M or G.
pub fn label(value: f64) -> String {
    rounded(value, 3)
}

/// Digits of a label at most: values that differ by less are equal to a reader.
const DIGITS: i32 = 6;

/// Values as they stand beside an axis or in cells: three digits, or as many more, up to six, as make different values different texts.
pub fn labels(values: &[f64]) -> Vec<String> {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    sorted.dedup();
    let differ = |digits: &i32| sorted.windows(2).all(|pair| rounded(pair[0], *digits) != rounded(pair[1], *digits));
    let digits = (3..DIGITS).find(differ).unwrap_or(DIGITS);
    values.iter().map(|&value| rounded(value, digits)).collect()
}

/// A value with a number of digits; a whole number below 10,000 is not rounded.
fn rounded(value: f64, digits: i32) -> String {
    let (scaled, unit) = match value.abs() {
        size if size >= 0.99995e9 => (value / 1e9, "G"),
        size if size >= 0.99995e6 => (value / 1e6, "M"),
        size if size >= 1e4 => (value / 1e3, "k"),
        _ => (value, ""),
    };
    let before = match scaled.abs() {
        size if size >= 1000.0 => 4,
        size if size >= 100.0 => 3,
        size if size >= 10.0 => 2,
        size if size >= 1.0 => 1,
        _ => 0,
    };
    let whole = (scaled - scaled.round()).abs() < 1e-9;
    let decimals = if whole { 0 } else { (digits - before).max(0) as usize };
    let text = format!("{scaled:.decimals$}");
    let text = if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.').to_owned() } else { text };
    format!("{text}{unit}")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ticks_are_round_and_inside() {
        let axis = Axis::new(Scale::FromZero, [3.0, 209_304.0].into_iter());
        assert_eq!(axis.ticks(5), [0.0, 50_000.0, 100_000.0, 150_000.0, 200_000.0]);
        let log = Axis::new(Scale::Log, [1.0, 1000.0].into_iter());
        assert_eq!(log.ticks(6).iter().map(|&value| label(value)).collect::<Vec<_>>(), ["1", "10", "100", "1000"]);
        assert!((log.place(31.622) - 0.5).abs() < 1e-3);
        assert_eq!([209_304.0, 12_500.0, 0.25, 1.5e6].map(label), ["209k", "12.5k", "0.25", "1.5M"]);
    }

    #[test]
    fn different_values_have_different_texts() {
        assert_eq!(labels(&[129_795.0, 129_952.0, 131_000.0]), ["129.8k", "130k", "131k"]);
        assert_eq!(labels(&[129_795.0, 129_795.0, 300_000.0]), ["130k", "130k", "300k"]);
        assert_eq!(labels(&[0.1234, 0.1235, 2.0]), ["0.1234", "0.1235", "2"]);
        // What is equal in six digits is equal.
        assert_eq!(labels(&[1.0, 1.000_000_01]), ["1", "1"]);
    }

    #[test]
    fn an_axis_of_names_has_each_name_at_its_number() {
        let axis = Axis::of_names(4);
        assert_eq!([0.0, 3.0].map(|value| axis.place(value)), [0.125, 0.875]);
    }

    #[test]
    fn an_axis_of_one_value_or_none_has_room() {
        for values in [&[][..], &[5.0], &[f64::NAN], &[0.0]] {
            for scale in [Scale::Linear, Scale::FromZero, Scale::Log] {
                let axis = Axis::new(scale, values.iter().copied());
                assert!(axis.place(5.0).is_finite() && !axis.ticks(5).is_empty(), "{values:?} {scale:?} {axis:?}");
            }
        }
    }
}
