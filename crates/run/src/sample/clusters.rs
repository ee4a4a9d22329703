//! Sampling over frames: frames that are alike by their profiles are simulated once.
//!
//! 1. Each frame's profile becomes a signature: what every unit has to do in it, by [`Bound`](crate::bound::Bound).
//! 2. The first frame finds cold caches and often does what no other does (uploads, passes that are drawn once): it is simulated in any case and
//!    stands for itself alone, a certainty stratum (Cochran, Sampling Techniques, 1977, section 5.5).
//! 3. The others are put into clusters by signature, as many as are to be drawn (k-means, from centres that are farthest apart). Where fewer
//!    frames differ, or more than [`MEANS`] are drawn, the largest clusters are halved: else one that stands for most frames sets the error, however
//!    many rare frames are set apart.
//! 4. Of each cluster one frame is drawn at random and simulated, behind some frames that warm the caches and are not counted.
//! 5. What a cluster counts is what its frame counted, times the cluster's estimate by that frame's: a ratio estimator in each
//!    stratum (Cochran, section 6.10). `Bound` has errors, but nearly the same for frames that are alike.
//!
//! The interval comes from how much the ratios of simulated to estimated differ between clusters, with Student's t for their
//! number: what differs between clusters, too, is taken for chance, so that the interval is rather too wide.

use num::Random;
use rayon::prelude::*;

/// Level of the intervals.
pub const LEVEL: f64 = 0.997;

/// Student's t for a two-sided interval of [`LEVEL`], for 1 to 30 degrees of freedom; beyond, nearly the normal's 2.968.
const STUDENT: [f64; 30] = [
    212.205, 18.2163, 8.89146, 6.43485, 5.37603, 4.80024, 4.44213, 4.19915, 4.02399, 3.89195, 3.78898, 3.70649, 3.63895,
    3.58265, 3.53502, 3.49421, 3.45885, 3.42793, 3.40066, 3.37643, 3.35476, 3.33527, 3.31764, 3.30162, 3.287, 3.27361, 3.26129,
    3.24993, 3.23941, 3.22965,
];

/// Most rounds of k-means; it settles in a few.
const ROUNDS: usize = 50;

/// Most clusters by signature.
const MEANS: usize = 64;

/// A value and half the width of its interval.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Interval {
    /// The estimate.
    pub value: f64,
    /// Plus and minus.
    pub margin: f64,
}

impl Interval {
    /// Whether it holds a value.
    pub fn covers(&self, value: f64) -> bool {
        (value - self.value).abs() <= self.margin
    }
}

/// What each unit has to do, in cycles, in the order of `units`; several entries of one unit are summed up.
pub fn signature(work: impl Iterator<Item = (&'static str, f64)>, units: &mut Vec<&'static str>) -> Vec<f64> {
    let mut signature = vec![0.0; units.len()];
    for (unit, cycles) in work {
        let at = units.iter().position(|known| *known == unit).unwrap_or_else(|| {
            units.push(unit);
            units.len() - 1
        });
        if signature.len() <= at {
            signature.resize(at + 1, 0.0);
        }
        signature[at] += cycles;
    }
    signature
}

/// Clusters of frames: the first frame alone, and those of the others.
#[derive(Clone, Debug, PartialEq)]
pub struct Clusters {
    /// The frames of each, by place in the sequence; `[0]` comes first, where there is a frame.
    pub members: Vec<Vec<usize>>,
}

impl Clusters {
    /// Puts the first frame into a cluster of its own and the others into `count` clusters, or as many as there are; into one if all are alike.
    pub fn new(signatures: &[Vec<f64>], count: usize) -> Clusters {
        let width = signatures.iter().map(Vec::len).max().unwrap_or(0);
        let at = |frame: usize, unit: usize| signatures[frame].get(unit).copied().unwrap_or(0.0);
        let distance = |frame: usize, center: &[f64]| -> f64 {
            center.iter().enumerate().map(|(unit, c)| (at(frame, unit) - c) * (at(frame, unit) - c)).sum()
        };
        let of = |frame: usize| -> Vec<f64> { (0..width).map(|unit| at(frame, unit)).collect() };
        let nearest = |centers: &[Vec<f64>], frame: usize| {
            let mut best = (0, f64::INFINITY);
            for (place, center) in centers.iter().enumerate() {
                let mut sum = 0.0;
                for (unit, c) in center.iter().enumerate() {
                    sum += (at(frame, unit) - c) * (at(frame, unit) - c);
                    // It only grows.
                    if sum >= best.1 {
                        break;
                    }
                }
                if sum < best.1 {
                    best = (place, sum);
                }
            }
            best.0
        };
        let mean = |members: &[usize]| -> Vec<f64> {
            (0..width).map(|unit| members.iter().map(|&f| at(f, unit)).sum::<f64>() / members.len() as f64).collect()
        };

        // 1. Centres: the frame farthest from the mean, then each that is farthest from those chosen.
        let all: Vec<usize> = (1..signatures.len()).collect();
        let mut centers: Vec<Vec<f64>> = Vec::new();
        let mut from = if all.is_empty() { Vec::new() } else { mean(&all) };
        // Of each frame, the distance to the nearest.
        let mut far = vec![f64::INFINITY; all.len()];
        let mut alike = false;
        while centers.len() < count.min(MEANS) && !all.is_empty() {
            far.par_iter_mut().zip(&all).for_each(|(far, &frame)| *far = far.min(distance(frame, &from)));
            let farthest =
                all.iter().zip(&far).fold((all[0], -1.0), |best, (&f, &far)| if far > best.1 { (f, far) } else { best });
            alike = farthest.1 <= 0.0 && !centers.is_empty();
            if alike {
                break;
            }
            if centers.is_empty() {
                far.fill(f64::INFINITY);
            }
            from = of(farthest.0);
            centers.push(from.clone());
        }

        // 2. Frames go to the nearest centre, centres to the mean of their frames, until nothing moves.
        let mut members: Vec<Vec<usize>> = Vec::new();
        for _ in 0..ROUNDS {
            let mut next = vec![Vec::new(); centers.len()];
            let places: Vec<usize> = all.par_iter().map(|&frame| nearest(&centers, frame)).collect();
            all.iter().zip(places).for_each(|(&frame, place)| next[place].push(frame));
            let settled = next == members;
            members = next;
            if settled {
                break;
            }
            for (center, members) in centers.iter_mut().zip(&members).filter(|(_, members)| !members.is_empty()) {
                *center = mean(members);
            }
        }
        members.retain(|members| !members.is_empty());

        // 3. Halves, in the order of frames; where all are alike, there is nothing to tell an error by.
        while (alike || count > MEANS) && (2..count).contains(&members.len()) {
            let largest = (0..members.len()).rev().max_by_key(|&place| members[place].len()).unwrap_or_default();
            if members[largest].len() < 2 {
                break;
            }
            let half = members[largest].len() / 2;
            let others = members[largest].split_off(half);
            members.push(others);
        }
        if !signatures.is_empty() {
            members.insert(0, vec![0]);
        }
        Clusters { members }
    }

    /// A frame of each, drawn at random.
    pub fn draw(&self, random: &mut Random) -> Vec<usize> {
        self.members.iter().map(|members| members[random.below(members.len() as u32) as usize]).collect()
    }

    /// How much each drawn frame stands for: the estimates of its cluster, by its own.
    pub fn weights(&self, drawn: &[usize], estimates: &[f64]) -> Vec<f64> {
        let sum = |members: &[usize]| members.iter().map(|&frame| estimates[frame]).sum::<f64>();
        let weight = |(members, &frame): (&Vec<usize>, &usize)| {
            if estimates[frame] > 0.0 { sum(members) / estimates[frame] } else { members.len() as f64 }
        };
        self.members.iter().zip(drawn).map(weight).collect()
    }

    /// The sum over all frames of what was counted in those drawn. The deviations of all clusters count alike, whatever their size; that of the
    /// first frame, which is known, does not count.
    pub fn total(&self, drawn: &[usize], estimates: &[f64], counted: &[f64]) -> Interval {
        let weights = self.weights(drawn, estimates);
        let parts: Vec<f64> = weights.iter().zip(counted).map(|(weight, counted)| weight * counted).collect();
        let value: f64 = parts.iter().sum();
        let clusters = drawn.len().saturating_sub(1);
        if clusters < 2 {
            return Interval { value, margin: f64::INFINITY };
        }
        // What a cluster's frames would count if they were like the average of all clusters, and by how much its frame differs.
        let share = |members: &Vec<usize>| members.iter().map(|&frame| estimates[frame]).sum::<f64>();
        let shares: Vec<f64> = self.members[1..].iter().map(share).collect();
        let (parts, all) = (&parts[1..], shares.iter().sum::<f64>());
        let ratio = if all > 0.0 { parts.iter().sum::<f64>() / all } else { 0.0 };
        let own = parts.iter().zip(&shares).map(|(part, share)| if *share > 0.0 { part / share } else { ratio });
        let squares = own.map(|own| (own - ratio) * (own - ratio));
        let spread = squares.sum::<f64>() / (clusters - 1) as f64;
        let parts = shares.iter().zip(&self.members[1..]).map(|(share, m)| share * share * (1.0 - 1.0 / m.len() as f64));
        let t = STUDENT.get(clusters - 2).copied().unwrap_or(STUDENT[STUDENT.len() - 1]);
        Interval { value, margin: t * (spread * parts.sum::<f64>()).sqrt() }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frames_that_are_alike_share_a_cluster() {
        let signatures: Vec<Vec<f64>> = (0..30).map(|i| vec![f64::from(i % 3) * 100.0 + f64::from(i) * 0.01, 5.0]).collect();
        let clusters = Clusters::new(&signatures, 3);
        assert_eq!(clusters.members.len(), 4);
        assert_eq!(clusters.members[0], [0]);
        for members in &clusters.members[1..] {
            let all = if members[0] % 3 == 0 { 9 } else { 10 };
            assert!(members.len() == all && members.iter().all(|frame| frame % 3 == members[0] % 3), "{members:?}");
        }
        // Fewer different frames than clusters, fewer frames, and all alike.
        let of = |frames: &[f64], count| Clusters::new(&frames.iter().map(|&x| vec![x]).collect::<Vec<_>>(), count).members;
        assert_eq!(of(&[9.0, 1.0, 1.0, 1.0, 1.0, 2.0], 3), [vec![0], vec![5], vec![1, 2], vec![3, 4]]);
        assert_eq!(of(&[9.0, 1.0, 1.0, 2.0], 7).len(), 4);
        assert_eq!(of(&[9.0, 1.0, 1.0, 1.0], 2), [vec![0], vec![1, 2, 3]]);
        assert!(Clusters::new(&[], 3).members.is_empty());
    }

    #[test]
    fn what_only_the_first_frame_does_is_told_exactly() {
        // As a user interface whose textures come from DRAM once.
        let estimates = vec![100.0; 40];
        let signatures: Vec<Vec<f64>> = (0..40).map(|i| vec![100.0 + f64::from(i % 5)]).collect();
        let clusters = Clusters::new(&signatures, 4);
        for seed in 0..20 {
            let drawn = clusters.draw(&mut Random::new(seed));
            let counted: Vec<f64> = drawn.iter().map(|&frame| if frame == 0 { 5000.0 } else { 0.0 }).collect();
            assert_eq!(clusters.total(&drawn, &estimates, &counted), Interval { value: 5000.0, margin: 0.0 });
        }
    }

    #[test]
    fn counts_in_proportion_to_the_estimates_are_told_exactly() {
        let estimates: Vec<f64> = (1..=50).map(f64::from).collect();
        let signatures: Vec<Vec<f64>> = estimates.iter().map(|&x| vec![x]).collect();
        let clusters = Clusters::new(&signatures, 4);
        let drawn = clusters.draw(&mut Random::new(1));
        let counted: Vec<f64> = drawn.iter().map(|&frame| 3.0 * estimates[frame]).collect();
        let total = clusters.total(&drawn, &estimates, &counted);
        assert!((total.value - 3.0 * 1275.0).abs() < 1e-6 && total.margin < 1e-6, "{total:?}");
    }

    #[test]
    fn intervals_cover() {
        // Estimates are off by 5 %, independently; a quarter of the frames is of another kind, off by 10 % more.
        let mut chance = Random::new(7);
        let mut normal = || (0..12).map(|_| f64::from(chance.unit())).sum::<f64>() - 6.0;
        let estimates: Vec<f64> = (0..300).map(|i| 100.0 + 50.0 * libm::sin(f64::from(i) / 20.0)).collect();
        let kind = |i: usize| f64::from(u8::from(i.is_multiple_of(4)));
        let counts: Vec<f64> = estimates.iter().enumerate().map(|(i, x)| x * (1.0 + 0.05 * normal() + 0.1 * kind(i))).collect();
        let signatures: Vec<Vec<f64>> = estimates.iter().enumerate().map(|(i, &x)| vec![x, 60.0 * kind(i)]).collect();
        let truth: f64 = counts.iter().sum();
        for clusters in [3, 6, 12, 40] {
            let clusters = Clusters::new(&signatures, clusters);
            let covered = (0..1000).filter(|&seed| {
                let drawn = clusters.draw(&mut Random::new(seed));
                let counted: Vec<f64> = drawn.iter().map(|&frame| counts[frame]).collect();
                clusters.total(&drawn, &estimates, &counted).covers(truth)
            });
            assert!(covered.count() >= 990, "{} clusters", clusters.members.len());
        }
    }
}
