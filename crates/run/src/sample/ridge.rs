//! Ridge regression (Hoerl and Kennard, 1970): what is known of some frames, as a linear function of counts that all have.

/// The penalty of a coefficient, against the squares of the deviations of one frame. For a count divided by its mean, it is about 3 %.
const PENALTY: f64 = 1e-3;

/// A known value is not extrapolated below this share of the smallest.
const LEAST: f64 = 0.25;

/// Sums over the counts of all frames.
pub(super) struct Summary<const N: usize> {
    frames: u64,
    first: [f64; N],
    sums: [f64; N],
    /// Which differ between frames.
    change: [bool; N],
}

impl<const N: usize> Default for Summary<N> {
    fn default() -> Self {
        Summary { frames: 0, first: [0.0; N], sums: [0.0; N], change: [false; N] }
    }
}

impl<const N: usize> Summary<N> {
    /// Adds a frame, behind those before it.
    pub fn add(&mut self, counts: &[f64; N]) {
        if self.frames == 0 {
            self.first = *counts;
        }
        self.frames += 1;
        for at in 0..N {
            self.sums[at] += counts[at];
            self.change[at] |= counts[at] != self.first[at];
        }
    }
}

/// Counts of frames, made ready for any number of quantities.
pub(super) struct Ridge<const N: usize> {
    /// The means of the counts over all frames.
    means: [f64; N],
    /// The counts that change from frame to frame.
    kept: Vec<usize>,
    /// The counts of the frames of which values are known.
    known: Vec<[f64; N]>,
    /// The lower triangle of the normal equations' Cholesky factor.
    factor: Vec<Vec<f64>>,
}

/// A quantity as a linear function of counts.
pub(super) struct Law {
    coefficients: Vec<f64>,
    /// The least value.
    least: f64,
}

impl<const N: usize> Ridge<N> {
    /// Makes ready: what is known of all frames, and the counts of those of which values will be known.
    pub fn new(all: &Summary<N>, known: Vec<[f64; N]>) -> Ridge<N> {
        let means = all.sums.map(|sum| sum / all.frames.max(1) as f64);
        let kept: Vec<usize> = (0..N).filter(|&at| all.change[at]).collect();
        let n = kept.len() + 1;
        let mut ridge = Ridge { means, kept, known, factor: vec![vec![0.0; n]; n] };
        for i in 0..n {
            for j in 0..=i {
                let mut sum: f64 = ridge.known.iter().map(|counts| ridge.input(counts, i) * ridge.input(counts, j)).sum();
                // The constant is free.
                sum += if i == j && i > 0 { PENALTY * ridge.known.len() as f64 } else { 0.0 };
                let factor = &mut ridge.factor;
                let before: f64 = (0..j).map(|k| factor[i][k] * factor[j][k]).sum();
                let left = sum - before;
                factor[i][j] = if i == j { left.max(f64::MIN_POSITIVE).sqrt() } else { left / factor[j][j] };
            }
        }
        ridge
    }

    /// An input of the law in a frame of such counts: the constant, or a count by its mean, less one.
    fn input(&self, counts: &[f64; N], at: usize) -> f64 {
        let Some(&count) = at.checked_sub(1).and_then(|at| self.kept.get(at)) else { return 1.0 };
        counts[count] / self.means[count] - 1.0
    }

    /// The law by the values of the known frames.
    pub fn fit(&self, values: &[f64]) -> Law {
        let n = self.factor.len();
        let mut solved: Vec<f64> = (0..n)
            .map(|at| self.known.iter().zip(values).map(|(counts, value)| self.input(counts, at) * value).sum())
            .collect();
        for i in 0..n {
            let before: f64 = (0..i).map(|k| self.factor[i][k] * solved[k]).sum();
            solved[i] = (solved[i] - before) / self.factor[i][i];
        }
        for i in (0..n).rev() {
            let after: f64 = (i + 1..n).map(|k| self.factor[k][i] * solved[k]).sum();
            solved[i] = (solved[i] - after) / self.factor[i][i];
        }
        let least = LEAST * values.iter().copied().fold(f64::INFINITY, f64::min).min(f64::MAX);
        Law { coefficients: solved, least }
    }

    /// The value that a law predicts for a frame with these counts.
    pub fn value(&self, law: &Law, counts: &[f64; N]) -> f64 {
        let counted = law.coefficients[1..].iter().enumerate().map(|(at, by)| self.input(counts, at + 1) * by);
        (law.coefficients[0] + counted.sum::<f64>()).max(law.least)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The values of all frames.
    fn fitted<const N: usize>(counts: &[[f64; N]], known: &[usize], values: &[f64]) -> Vec<f64> {
        let mut all = Summary::default();
        counts.iter().for_each(|counts| all.add(counts));
        let ridge = Ridge::new(&all, known.iter().map(|&frame| counts[frame]).collect());
        let law = ridge.fit(values);
        counts.iter().map(|counts| ridge.value(&law, counts)).collect()
    }

    #[test]
    fn a_linear_law_is_found_from_a_few_frames() {
        let counts: Vec<[f64; 3]> =
            (0..60).map(|i| [100.0 + f64::from(i % 7) * 10.0, 50.0, 1000.0 + f64::from(i % 11) * 80.0]).collect();
        let law = |row: &[f64; 3]| 400.0 + 3.0 * row[0] + 0.5 * row[2];
        let known: Vec<usize> = (0..60).step_by(5).collect();
        let values: Vec<f64> = known.iter().map(|&frame| law(&counts[frame])).collect();
        let found = fitted(&counts, &known, &values);
        for (row, found) in counts.iter().zip(found) {
            assert!((found / law(row) - 1.0).abs() < 0.01, "{found} for {}", law(row));
        }
    }

    #[test]
    fn equal_frames_are_equal_and_nothing_falls_below_zero() {
        let found = fitted(&[[1.0, 0.0]; 8], &[1, 5], &[10.0, 20.0]);
        assert!(found.iter().all(|value| *value == found[0] && (value - 15.0).abs() < 1e-9), "{found:?}");
        let counts: Vec<[f64; 1]> = [10.0, 11.0, 0.0, 12.0].into_iter().map(|count| [count]).collect();
        assert!(fitted(&counts, &[0, 1, 3], &[1.0, 10.0, 19.0]).iter().all(|&value| value >= 0.25));
    }
}
