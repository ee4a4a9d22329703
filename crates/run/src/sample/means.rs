//! Groups of frames that are alike: k-means (Lloyd, 1982), from centres that are farthest apart (Gonzalez, 1985).
//!
//! Frames are rows of a table, which is gone through some rows at a time. What is kept of each frame between two passes lies in tables, too.

use std::ops::Range;

use anyhow::Result;
use rayon::prelude::*;

use super::clusters::MEANS;
use super::table::{Table, parts};

/// Most rounds of k-means; it settles in a few.
const ROUNDS: usize = 50;

/// Centres of groups; the first frame belongs to none.
pub(super) struct Centers {
    width: usize,
    all: Vec<Vec<f64>>,
    /// Whether there are no more centers because all frames are like these.
    pub alike: bool,
}

/// A sum of signatures.
#[derive(Clone)]
struct Sum {
    of: Vec<f64>,
    frames: u32,
}

impl Sum {
    fn new(width: usize) -> Sum {
        Sum { of: vec![0.0; width], frames: 0 }
    }

    fn add(&mut self, signature: &[f64]) {
        self.of.iter_mut().zip(signature).for_each(|(sum, own)| *sum += own);
        self.frames += 1;
    }

    fn mean(self) -> Vec<f64> {
        let frames = f64::from(self.frames);
        self.of.into_iter().map(|sum| sum / frames).collect()
    }
}

/// The square of how far a frame is from a centre.
fn distance(signature: &[f64], center: &[f64]) -> f64 {
    signature.iter().zip(center).map(|(own, center)| (own - center) * (own - center)).sum()
}

/// Which centre is nearest to a frame.
fn nearest(signature: &[f64], centers: &[Vec<f64>]) -> u32 {
    let mut best = (0, f64::INFINITY);
    for (place, center) in (0..).zip(centers) {
        let mut sum = 0.0;
        for (own, center) in signature.iter().zip(center) {
            sum += (own - center) * (own - center);
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
}

/// Rows of a pass without the first frame's.
fn others(range: &Range<usize>) -> Range<usize> {
    range.start.max(1)..range.end
}

impl Centers {
    /// At most `count` centers: the frame farthest from the mean, then each frame that is farthest from those chosen.
    pub fn far_apart(rows: &Table<f64>, width: usize, count: usize) -> Result<Centers> {
        let mut centers = Centers { width, all: Vec::new(), alike: false };
        if rows.rows() < 2 {
            return Ok(centers);
        }
        let mut sum = Sum::new(width);
        rows.each(|frame, row| {
            if frame > 0 {
                sum.add(&row[..width])
            }
        })?;
        let mut from = sum.mean();
        // The distance of each frame to the nearest centre.
        let mut far = Table::<f64>::new(1);
        parts(rows.rows()).try_for_each(|range| far.add(&vec![f64::INFINITY; range.len()]))?;
        let (mut signatures, mut distances) = (Vec::new(), Vec::new());
        while centers.all.len() < count.min(MEANS) {
            let mut farthest = (1, -1.0);
            for range in parts(rows.rows()) {
                rows.fill(&range, &mut signatures)?;
                far.fill(&range, &mut distances)?;
                let wide = signatures.len() / range.len();
                let measured = distances.par_iter_mut().zip(signatures.par_chunks_exact(wide));
                measured.for_each(|(far, row)| *far = far.min(distance(&row[..width], &from)));
                // The mean of all is no centre.
                if !centers.all.is_empty() {
                    far.replace(range.start, &distances)?;
                }
                for frame in others(&range) {
                    let far = distances[frame - range.start];
                    farthest = if far > farthest.1 { (frame, far) } else { farthest };
                }
            }
            centers.alike = farthest.1 <= 0.0 && !centers.all.is_empty();
            if centers.alike {
                break;
            }
            from = rows.row(farthest.0)?;
            from.truncate(width);
            centers.all.push(from.clone());
        }
        Ok(centers)
    }

    /// Frames go to the nearest centre, centres to the mean of their frames, until nothing moves. Gives the group of each frame, and how many
    /// frames each group has: group 0 is the first frame alone, and that of centre `n` is `n + 1`.
    pub fn settle(mut self, rows: &Table<f64>) -> Result<(Table<u32>, Vec<u32>)> {
        let mut groups = Table::<u32>::new(1);
        parts(rows.rows()).try_for_each(|range| groups.add(&vec![0; range.len()]))?;
        let mut sizes = vec![0; self.all.len() + 1];
        sizes[0] = u32::from(rows.rows() > 0);
        if self.all.is_empty() {
            return Ok((groups, sizes));
        }
        let (mut signatures, mut before, mut next) = (Vec::new(), Vec::new(), Vec::new());
        for _ in 0..ROUNDS {
            let (mut settled, mut sums) = (true, vec![Sum::new(self.width); self.all.len()]);
            for range in parts(rows.rows()) {
                rows.fill(&range, &mut signatures)?;
                groups.fill(&range, &mut before)?;
                let wide = signatures.len() / range.len();
                let nearest = |row: &[f64]| nearest(&row[..self.width], &self.all) + 1;
                signatures.par_chunks_exact(wide).map(nearest).collect_into_vec(&mut next);
                if range.start == 0 {
                    next[0] = 0;
                }
                for frame in others(&range) {
                    let row = &signatures[(frame - range.start) * wide..][..self.width];
                    sums[next[frame - range.start] as usize - 1].add(row);
                }
                settled &= next == before;
                groups.replace(range.start, &next)?;
            }
            sizes[1..].iter_mut().zip(&sums).for_each(|(size, sum)| *size = sum.frames);
            if settled {
                break;
            }
            for (center, sum) in self.all.iter_mut().zip(sums).filter(|(_, sum)| sum.frames > 0) {
                *center = sum.mean();
            }
        }
        Ok((groups, sizes))
    }
}
