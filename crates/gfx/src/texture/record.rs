//! What a sample costs the card: the memory lines it reads and the filter operations it takes, quad by quad.

use std::ops::Range;

use super::ellipse::{self, Ellipses};
use super::fast::QuadLevels;
use super::general::{lanes_of, locate};
use super::lod::{Levels, Selection};
use super::sampler::BORDER;
use super::squares::Room;
use super::taps::{TexturePoint, gather_taps, taps};
use super::{Sample, Sampler, View};
use crate::format::TexelClass;
use num::{Lanes, Mask, QUADS};

/// Lines and operations of one texture instruction of a batch.
#[derive(Clone, Debug, Default)]
pub struct Footprint {
    /// Lines of all texture instructions since their owner emptied it, in order.
    pub lines: Vec<u32>,
    /// Of the last instruction: where the lines of each quad begin, and where those of the last one end.
    pub(super) bounds: [u32; QUADS + 1],
    pub(super) operations: [u16; QUADS],
    /// How wide the texels are that it asks for, and whether it loads them without filtering.
    pub(super) texel: TexelClass,
    pub(super) loads: bool,
    /// Samples between two levels ask for the second even where it has no weight.
    pub both_levels: bool,
    /// Where lines are looked for; none before the first time.
    pub(super) room: Option<Box<Room>>,
}

impl Footprint {
    /// An empty record; kept and reused by its owner, because it grows to what is needed once.
    pub fn new() -> Footprint {
        Footprint::default()
    }

    /// The distinct lines (address / 64) that a quad reads, in order of first use, and its bilinear filter operations: one a
    /// live lane for nearest, bilinear, gather and load, twice as many between two levels or two slices; with anisotropy as
    /// many as the footprint is longer than wide, or on cubes times the probes.
    pub fn quad(&self, quad: usize) -> (&[u32], u16) {
        let (lines, operations) = self.range(quad);
        (&self.lines[lines.start as usize..lines.end as usize], operations)
    }

    /// [`Footprint::quad`], with the lines by their places among all.
    #[inline]
    pub fn range(&self, quad: usize) -> (Range<u32>, u16) {
        (self.bounds[quad]..self.bounds[quad + 1], self.operations[quad])
    }

    /// How wide the texels are that the last instruction asked for, and whether it loaded them without filtering.
    pub fn texel(&self) -> (TexelClass, bool) {
        (self.texel, self.loads)
    }

    /// Records quads in order: `one` is called with each live lane, and adds its lines and operations.
    #[inline(always)]
    pub(super) fn fill(&mut self, mask: Mask, mut one: impl FnMut(usize, &mut Quad<'_>)) {
        self.bounds[0] = self.lines.len() as u32;
        for q in 0..QUADS {
            let mut quad = Quad { first: self.lines.len(), lines: &mut self.lines, operations: 0 };
            for p in lanes_of(mask >> (4 * q) & 15) {
                one(4 * q + p, &mut quad);
            }
            self.operations[q] = quad.operations;
            self.bounds[q + 1] = self.lines.len() as u32;
        }
    }

    /// Whether a sample asks for two levels, whatever their weights.
    pub(super) fn takes_both(&self, view: &View, sampler: &Sampler) -> bool {
        self.both_levels && sampler.mip_linear && view.levels.len() > 1
    }

    #[inline(always)]
    pub(super) fn sample(&mut self, view: &View, sampler: &Sampler, args: &Sample<'_>, found: Option<&QuadLevels>, mask: Mask) {
        (self.texel, self.loads) = (view.texel, false);
        if !super::squares::record(view, sampler, args, found, mask, self) {
            self.sample_others(view, sampler, args, mask);
        }
    }

    #[inline(never)]
    fn sample_others(&mut self, view: &View, sampler: &Sampler, args: &Sample<'_>, mask: Mask) {
        if ellipse::applies(view, sampler, args) {
            return self.average(view, sampler, args, mask);
        }
        let selection = Selection::new(view, sampler, args);
        let both = self.takes_both(view, sampler);
        self.fill(mask, |lane, quad| {
            let levels = Levels::new(selection.lambda[lane], view.levels.len(), sampler);
            let place = TexturePoint::new(view, args, lane);
            let count = selection.probes[lane];
            for step in 1..=count {
                let t = f32::from(step) / f32::from(count + 1) - 0.5;
                let mut at = place;
                at.coords[0] += selection.major[0][lane] * t;
                at.coords[1] += selection.major[1][lane] * t;
                quad.level(view, sampler, args, levels.first, levels.linear, at);
                if levels.weight > 0.0 || both {
                    quad.level(view, sampler, args, levels.second, levels.linear, at);
                }
            }
        });
    }

    fn average(&mut self, view: &View, sampler: &Sampler, args: &Sample<'_>, mask: Mask) {
        self.fill(mask, |lane, quad| {
            let footprint = Ellipses::new(view, sampler, args).of(lane);
            footprint.texels(view, sampler, TexturePoint::new(view, args, lane), args.offset, |texel, _| {
                let texel = if texel.contains(&BORDER) { [BORDER; 3] } else { texel };
                quad.texel(view, footprint.level, texel);
            });
            quad.operations += footprint.probes;
        });
    }

    pub(super) fn gather(&mut self, view: &View, sampler: &Sampler, args: &Sample<'_>, mask: Mask) {
        (self.texel, self.loads) = (view.texel, false);
        self.fill(mask, |lane, quad| {
            quad.operations += 1;
            for texel in gather_taps(view, sampler, TexturePoint::new(view, args, lane), args.offset) {
                quad.texel(view, 0, texel);
            }
        });
    }

    pub(super) fn load(&mut self, view: &View, coords: [&Lanes; 3], layer: Option<&Lanes>, level: &Lanes, mask: Mask) {
        (self.texel, self.loads) = (view.texel, true);
        self.fill(mask, |lane, quad| {
            quad.operations += 1;
            if let Some((level, texel, _)) = locate(view, coords, layer, level, lane) {
                quad.texel(view, level, texel);
            }
        });
    }
}

/// The quad being recorded.
pub(super) struct Quad<'a> {
    first: usize,
    lines: &'a mut Vec<u32>,
    operations: u16,
}

impl Quad<'_> {
    fn level(&mut self, view: &View, sampler: &Sampler, args: &Sample<'_>, level: usize, linear: bool, place: TexturePoint) {
        let taps = taps(view, sampler, level, linear, place, args.offset);
        self.operations += if taps.count > 4 { 2 } else { 1 };
        for i in 0..taps.count {
            self.texel(view, level, taps.texel[i]);
        }
    }

    #[inline(always)]
    fn texel(&mut self, view: &View, level: usize, [x, y, slice]: [i32; 3]) {
        if x == BORDER {
            return;
        }
        self.line(view.line(level, x as u32, y as u32, slice as u32));
    }

    #[inline(always)]
    fn line(&mut self, line: u32) {
        if !self.lines[self.first..].contains(&line) {
            self.lines.push(line);
        }
    }
}
