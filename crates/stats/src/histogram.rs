//! Counting values by size.

use super::{Leaf, Node, Tree};

/// A histogram in power-of-two classes: class 0 holds the value 0, class k the values from 2^(k-1) to 2^k - 1.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Histogram {
    classes: [u64; 65],
    sum: u64,
    max: u64,
}

impl Default for Histogram {
    fn default() -> Histogram {
        Histogram { classes: [0; 65], sum: 0, max: 0 }
    }
}

impl Histogram {
    /// Counts one value.
    #[inline]
    pub fn add(&mut self, value: u64) {
        self.classes[(64 - value.leading_zeros()) as usize] += 1;
        self.sum = self.sum.saturating_add(value);
        self.max = self.max.max(value);
    }

    /// How many values were counted.
    pub fn count(&self) -> u64 {
        self.classes.iter().sum()
    }

    /// Their sum, saturating.
    pub fn sum(&self) -> u64 {
        self.sum
    }

    /// The largest, 0 when there is none.
    pub fn max(&self) -> u64 {
        self.max
    }

    /// The mean, 0 when there is none.
    pub fn mean(&self) -> f64 {
        let count = self.count();
        if count == 0 { 0.0 } else { self.sum as f64 / count as f64 }
    }

    /// The classes up to the last that holds anything: (lowest value, highest value, count).
    pub fn classes(&self) -> impl Iterator<Item = (u64, u64, u64)> + '_ {
        let used = self.classes.iter().rposition(|&count| count > 0).map_or(0, |last| last + 1);
        self.classes[..used].iter().enumerate().map(|(class, &count)| match class {
            0 => (0, 0, count),
            _ => (1 << (class - 1), u64::MAX >> (64 - class), count),
        })
    }

    /// Adds all that another histogram counted.
    pub fn merge(&mut self, other: &Histogram) {
        for (mine, theirs) in self.classes.iter_mut().zip(&other.classes) {
            *mine += theirs;
        }
        self.sum = self.sum.saturating_add(other.sum);
        self.max = self.max.max(other.max);
    }

    /// The classes as leaves named by their lowest value, after `sum`.
    pub fn tree(&self) -> Tree {
        let mut tree = Tree::new();
        tree.count("sum", self.sum);
        for (lowest, _, count) in self.classes() {
            tree.set(lowest.to_string(), Node::Leaf(Leaf::Count(count)));
        }
        tree
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_value_is_in_the_class_that_names_it() {
        for value in [0, 1, 2, 3, 4, 255, 256, u64::MAX] {
            let mut histogram = Histogram::default();
            histogram.add(value);
            let (low, high, _) = histogram.classes().find(|&(.., count)| count == 1).unwrap();
            assert!(low <= value && value <= high, "{value} is not in {low}..={high}");
        }
    }

    #[test]
    fn merged_histograms_are_as_one() {
        let (mut a, mut b, mut both) = (Histogram::default(), Histogram::default(), Histogram::default());
        for value in 0..100 {
            if value % 3 == 0 { &mut a } else { &mut b }.add(value);
            both.add(value);
        }
        a.merge(&b);
        assert_eq!(a, both);
        assert_eq!(a.count(), 100);
        assert_eq!(a.mean(), 49.5);
        assert_eq!(a.max(), 99);
    }
}
