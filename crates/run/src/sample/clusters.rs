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
//! The interval comes from how much the ratios of simulated to estimated differ between clusters of several frames, with Student's t for their
//! number: what differs between clusters, too, is taken for chance, so that the interval is rather too wide. A cluster of one frame is known.

use std::ops::Range;

use anyhow::Result;
use num::Random;

use super::means::Centers;
use super::table::{self, Table};

/// Level of the intervals.
pub const LEVEL: f64 = 0.997;

/// Student's t for a two-sided interval of [`LEVEL`], for 1 to 30 degrees of freedom; beyond, nearly the normal's 2.968.
const STUDENT: [f64; 30] = [
    212.205, 18.2163, 8.89146, 6.43485, 5.37603, 4.80024, 4.44213, 4.19915, 4.02399, 3.89195, 3.78898, 3.70649, 3.63895,
    3.58265, 3.53502, 3.49421, 3.45885, 3.42793, 3.40066, 3.37643, 3.35476, 3.33527, 3.31764, 3.30162, 3.287, 3.27361, 3.26129,
    3.24993, 3.23941, 3.22965,
];

/// Most clusters by signature.
pub(super) const MEANS: usize = 64;

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

/// The cycles of work of each unit, in the order of `units`. Several entries of one unit are summed up.
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
#[derive(Debug)]
pub struct Clusters {
    /// The group of each frame.
    groups: Table<u32>,
    /// The clusters: the first is that of the first frame, where there is one.
    parts: Vec<FrameRange>,
}

/// Some frames of a group that stand one behind the other in it.
#[derive(Clone, Debug)]
struct FrameRange {
    group: u32,
    places: Range<u32>,
}

/// The estimates of a cluster's frames. They say how much its drawn frame stands for.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Share {
    /// Frames of the cluster.
    pub frames: usize,
    /// The sum over them.
    pub sum: f64,
    /// The estimate of the frame that is drawn.
    pub own: f64,
}

impl Share {
    /// The weight of the drawn frame: the estimates of its cluster, divided by its own.
    pub fn weight(&self) -> f64 {
        if self.own > 0.0 { self.sum / self.own } else { self.frames as f64 }
    }
}

impl Clusters {
    /// Puts the first frame into a cluster of its own and the others into `count` clusters, or as many as there are; into one if all are alike.
    /// Frames are rows, and their signatures the first `width` numbers of these.
    ///
    /// # Errors
    /// If the rows cannot be read, or what is kept of the frames cannot be written.
    pub fn new(signatures: &Table<f64>, width: usize, count: usize) -> Result<Clusters> {
        let centers = Centers::far_apart(signatures, width, count)?;
        let alike = centers.alike;
        let (groups, sizes) = centers.settle(signatures)?;
        let all = (0..).zip(sizes).filter(|(_, size)| *size > 0);
        let mut parts: Vec<FrameRange> = all.map(|(group, size)| FrameRange { group, places: 0..size }).collect();
        // Halves, in the order of frames; where all are alike, there is nothing to tell an error by.
        while (alike || count > MEANS) && (2..count).contains(&parts.len().saturating_sub(1)) {
            // The first part is the first frame alone.
            let largest = (1..parts.len()).rev().max_by_key(|&at| parts[at].places.len()).unwrap_or_default();
            let Range { start, end } = parts[largest].places;
            if end - start < 2 {
                break;
            }
            let middle = start + (end - start) / 2;
            parts[largest].places.end = middle;
            parts.push(FrameRange { places: middle..end, ..parts[largest] });
        }
        Ok(Clusters { groups, parts })
    }

    /// How many there are.
    pub fn len(&self) -> usize {
        self.parts.len()
    }

    /// Whether there is none.
    pub fn is_empty(&self) -> bool {
        self.parts.is_empty()
    }

    /// How many frames are in each.
    pub fn sizes(&self) -> impl Iterator<Item = usize> {
        self.parts.iter().map(|part| part.places.len())
    }

    /// Goes through all frames in order: the cluster of each, its place in that, and the frame's in the sequence.
    ///
    /// # Errors
    /// If what is kept of the frames cannot be read.
    pub fn each(&self, mut each: impl FnMut(usize, u32, usize)) -> Result<()> {
        let mut walk = Walk::new(&self.parts);
        self.groups.each(|frame, group| {
            if let Some((cluster, place)) = walk.next(group[0]) {
                each(cluster, place, frame);
            }
        })?;
        Ok(())
    }

    /// Goes through all frames in order: the cluster of each, and its row of a table.
    ///
    /// # Errors
    /// If the rows or what is kept of the frames cannot be read.
    pub fn each_row(&self, rows: &Table<f64>, mut each: impl FnMut(usize, &[f64])) -> Result<()> {
        let (mut walk, mut groups, mut values) = (Walk::new(&self.parts), Vec::new(), Vec::new());
        for range in table::parts(rows.rows()) {
            self.groups.fill(&range, &mut groups)?;
            rows.fill(&range, &mut values)?;
            for (&group, row) in groups.iter().zip(values.chunks_exact(rows.width())) {
                if let Some((cluster, _)) = walk.next(group) {
                    each(cluster, row);
                }
            }
        }
        Ok(())
    }

    /// A frame of each, drawn at random.
    ///
    /// # Errors
    /// If what is kept of the frames cannot be read.
    pub fn draw(&self, random: &mut Random) -> Result<Vec<usize>> {
        let places: Vec<u32> = self.parts.iter().map(|part| random.below(part.places.len() as u32)).collect();
        let mut drawn = vec![0; places.len()];
        self.each(|cluster, place, frame| {
            if place == places[cluster] {
                drawn[cluster] = frame;
            }
        })?;
        Ok(drawn)
    }
}

/// A way through all frames in order, which finds the cluster of each.
struct Walk<'c> {
    parts: &'c [FrameRange],
    /// The clusters of each group that are not behind, the last first.
    left: Vec<Vec<usize>>,
    /// Frames of each group that are behind.
    behind: Vec<u32>,
}

impl Walk<'_> {
    fn new(parts: &[FrameRange]) -> Walk<'_> {
        let groups = parts.iter().map(|part| part.group as usize + 1).max().unwrap_or(0);
        let mut left: Vec<Vec<usize>> = vec![Vec::new(); groups];
        parts.iter().enumerate().for_each(|(at, part)| left[part.group as usize].push(at));
        left.iter_mut().for_each(|own| own.sort_unstable_by_key(|&at| std::cmp::Reverse(parts[at].places.start)));
        Walk { parts, left, behind: vec![0; groups] }
    }

    /// The cluster of the next frame, which is in this group, and its place there.
    fn next(&mut self, group: u32) -> Option<(usize, u32)> {
        let group = group as usize;
        let place = self.behind[group];
        self.behind[group] += 1;
        while let Some(&at) = self.left[group].last() {
            let Range { start, end } = self.parts[at].places;
            if place < end {
                return Some((at, place - start));
            }
            self.left[group].pop();
        }
        None
    }
}

/// The sum over all frames of what was counted in those drawn. The deviations of all clusters count alike, whatever their size. Those of the
/// first frame and of clusters of one frame do not count, because such a frame is known: how far it is from the others says nothing of them
/// (certainty strata: Cochran, section 5.5). Where not two clusters have more frames than one, all count but the first.
pub fn total(shares: &[Share], counted: &[f64]) -> Interval {
    let parts: Vec<f64> = shares.iter().zip(counted).map(|(share, counted)| share.weight() * counted).collect();
    let value: f64 = parts.iter().sum();
    let others = || shares.iter().zip(parts.iter().copied()).skip(1);
    let (mut compared, single): (Vec<_>, Vec<_>) = others().partition(|(share, _)| share.frames > 1);
    if compared.is_empty() && !single.is_empty() {
        return Interval { value, margin: 0.0 };
    }
    if compared.len() < 2 {
        compared.extend(single);
    }
    if compared.len() < 2 {
        return Interval { value, margin: f64::INFINITY };
    }
    // The counts of a cluster's frames if they were like the average of all clusters, and the difference of its drawn frame.
    let [all, counted] =
        [compared.iter().map(|(share, _)| share.sum).sum::<f64>(), compared.iter().map(|(_, part)| part).sum()];
    let ratio = if all > 0.0 { counted / all } else { 0.0 };
    let own = compared.iter().map(|(share, part)| if share.sum > 0.0 { part / share.sum } else { ratio });
    let squares = own.map(|own| (own - ratio) * (own - ratio));
    let spread = squares.sum::<f64>() / (compared.len() - 1) as f64;
    let parts = compared.iter().map(|(share, _)| share.sum * share.sum * (1.0 - 1.0 / share.frames as f64));
    let t = STUDENT.get(compared.len() - 2).copied().unwrap_or(STUDENT[STUDENT.len() - 1]);
    Interval { value, margin: t * (spread * parts.sum::<f64>()).sqrt() }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn clusters(signatures: &[Vec<f64>], count: usize) -> Clusters {
        let width = signatures.first().map_or(1, Vec::len);
        let mut table = Table::new(width);
        signatures.iter().for_each(|signature| table.add(signature).expect("added"));
        Clusters::new(&table, width, count).expect("put into clusters")
    }

    fn members(clusters: &Clusters) -> Vec<Vec<usize>> {
        let mut members = vec![Vec::new(); clusters.len()];
        clusters.each(|cluster, _, frame| members[cluster].push(frame)).expect("read");
        members
    }

    fn shares(clusters: &Clusters, drawn: &[usize], estimates: &[f64]) -> Vec<Share> {
        let all = members(clusters);
        let share = |(members, &frame): (&Vec<usize>, &usize)| Share {
            frames: members.len(),
            sum: members.iter().map(|&frame| estimates[frame]).sum(),
            own: estimates[frame],
        };
        all.iter().zip(drawn).map(share).collect()
    }

    #[test]
    fn frames_that_are_alike_share_a_cluster() {
        let signatures: Vec<Vec<f64>> = (0..30).map(|i| vec![f64::from(i % 3) * 100.0 + f64::from(i) * 0.01, 5.0]).collect();
        let all = members(&clusters(&signatures, 3));
        assert_eq!(all.len(), 4);
        assert_eq!(all[0], [0]);
        for members in &all[1..] {
            let all = if members[0] % 3 == 0 { 9 } else { 10 };
            assert!(members.len() == all && members.iter().all(|frame| frame % 3 == members[0] % 3), "{members:?}");
        }
        // Fewer different frames than clusters, fewer frames, and all alike.
        let of = |frames: &[f64], count| members(&clusters(&frames.iter().map(|&x| vec![x]).collect::<Vec<_>>(), count));
        assert_eq!(of(&[9.0, 1.0, 1.0, 1.0, 1.0, 2.0], 3), [vec![0], vec![5], vec![1, 2], vec![3, 4]]);
        assert_eq!(of(&[9.0, 1.0, 1.0, 2.0], 7).len(), 4);
        assert_eq!(of(&[9.0, 1.0, 1.0, 1.0], 2), [vec![0], vec![1, 2, 3]]);
        assert!(clusters(&[], 3).is_empty());
    }

    #[test]
    fn halves_follow_each_other_in_their_cluster() {
        // More than there are means: 300 frames that differ in 70 ways.
        let signatures: Vec<Vec<f64>> = (0..300).map(|i| vec![f64::from(i * i % 70)]).collect();
        let clusters = clusters(&signatures, 90);
        let all = members(&clusters);
        assert_eq!((all.len(), clusters.len()), (91, 91));
        let mut frames: Vec<usize> = all.iter().flatten().copied().collect();
        frames.sort_unstable();
        assert_eq!(frames, (0..300).collect::<Vec<_>>());
        assert!(all.iter().all(|members| members.is_sorted()));
        assert_eq!(clusters.sizes().collect::<Vec<_>>(), all.iter().map(Vec::len).collect::<Vec<_>>());
        let drawn = clusters.draw(&mut Random::new(5)).expect("drawn");
        assert!(drawn.iter().zip(&all).all(|(frame, members)| members.contains(frame)));
    }

    #[test]
    fn what_only_the_first_frame_does_is_told_exactly() {
        // As a user interface whose textures come from DRAM once.
        let estimates = vec![100.0; 40];
        let signatures: Vec<Vec<f64>> = (0..40).map(|i| vec![100.0 + f64::from(i % 5)]).collect();
        let clusters = clusters(&signatures, 4);
        for seed in 0..20 {
            let drawn = clusters.draw(&mut Random::new(seed)).expect("drawn");
            let counted: Vec<f64> = drawn.iter().map(|&frame| if frame == 0 { 5000.0 } else { 0.0 }).collect();
            let told = total(&shares(&clusters, &drawn, &estimates), &counted);
            assert_eq!(told, Interval { value: 5000.0, margin: 0.0 });
        }
    }

    #[test]
    fn counts_in_proportion_to_the_estimates_are_told_exactly() {
        let estimates: Vec<f64> = (1..=50).map(f64::from).collect();
        let signatures: Vec<Vec<f64>> = estimates.iter().map(|&x| vec![x]).collect();
        let clusters = clusters(&signatures, 4);
        let drawn = clusters.draw(&mut Random::new(1)).expect("drawn");
        let counted: Vec<f64> = drawn.iter().map(|&frame| 3.0 * estimates[frame]).collect();
        let total = total(&shares(&clusters, &drawn, &estimates), &counted);
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
        for count in [3, 6, 12, 40] {
            let clusters = clusters(&signatures, count);
            let covered = (0..1000).filter(|&seed| {
                let drawn = clusters.draw(&mut Random::new(seed)).expect("drawn");
                let counted: Vec<f64> = drawn.iter().map(|&frame| counts[frame]).collect();
                total(&shares(&clusters, &drawn, &estimates), &counted).covers(truth)
            });
            assert!(covered.count() >= 990, "{} clusters", clusters.len());
        }
    }
}
