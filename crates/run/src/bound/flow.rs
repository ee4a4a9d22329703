//! Windows of primitives flow through geometry and pipelines: which waits for which, without a cycle simulated.

use super::{Bound, Roofs};
use work::profile::{Cell, Window};

/// The cycles that an item of a draw takes in each unit.
#[derive(Clone, Copy, Debug)]
pub(super) struct Rates {
    /// Cycles of a router for a primitive.
    pub route: f64,
    /// Cycles of geometry for a primitive.
    pub geometry: f64,
    /// Cycles of a core, and of its texture unit, for a primitive's vertices.
    pub vertex_core: f64,
    pub vertex_texture: f64,
    /// Cycles of setup for a triangle.
    pub setup: f64,
    /// Cycles of traversal for a block in a triangle's bounds, a covered block, and a group of quads: it does all at once.
    pub test: f64,
    pub block: f64,
    pub group: f64,
    /// Cycles of the depth test for a group.
    pub depth: f64,
    /// Cycles of each of these units for a shaded quad.
    pub interpolate: f64,
    pub dispatch: f64,
    pub core: f64,
    pub texture: f64,
    pub color: f64,
    /// Least cycles of the depth test for a block with covered quads, and of colour for a block with shaded quads.
    pub depth_block: f64,
    pub color_block: f64,
    /// Latency in shaders from a vertex to the end of its fragments.
    pub latency: f64,
    /// The part of fragments in `latency`.
    pub shaded: f64,
}

/// A pipeline as windows flow through it: what it has been given, and when its rasteriser and its cores were done with it.
#[derive(Clone, Debug, Default)]
pub(super) struct Pipeline {
    windows: Vec<Passed>,
    /// The number of windows whose triangles have left the queue before setup when geometry begins the next window.
    setup: usize,
    /// The number of windows whose quads have left the cores when the rasteriser begins the next window.
    shaded: usize,
}

/// A window that has passed a pipeline.
#[derive(Clone, Copy, Debug, Default)]
struct Passed {
    /// Triangles and shaded quads up to its end.
    triangles: f64,
    quads: f64,
    /// When they were through the rasteriser, through cores and ROPs, and gone.
    rasterized: f64,
    shaded: f64,
    written: f64,
}

/// The larger of two times; unlike [`f64::max`] one instruction, since none is a NaN.
#[inline(always)]
pub(super) fn later(a: f64, b: f64) -> f64 {
    if b > a { b } else { a }
}

impl Pipeline {
    /// When the last window was through cores and ROPs.
    pub fn written(&self) -> f64 {
        self.last().written
    }

    fn last(&self) -> Passed {
        self.windows.last().copied().unwrap_or_default()
    }

    /// The time at which there is room for another window's triangles, if at most `waiting` triangles wait before setup.
    pub fn place(&mut self, waiting: f64) -> f64 {
        let all = self.last().triangles;
        while self.windows.get(self.setup).is_some_and(|window| all - window.triangles > waiting) {
            self.setup += 1;
        }
        if self.setup == 0 { 0.0 } else { self.windows[self.setup - 1].rasterized }
    }

    /// Sets the times at which the last window is shaded and gone.
    pub fn hold(&mut self, shaded: f64, gone: f64) {
        if let Some(last) = self.windows.last_mut() {
            (last.shaded, last.written) = (shaded, later(shaded, gone));
        }
    }

    /// The time at which the rasteriser had at most `ahead` triangles left before the end of the window that is `back` from the end.
    pub fn read(&self, back: usize, ahead: f64) -> f64 {
        let Some(window) = self.windows.len().checked_sub(back) else { return 0.0 };
        let reached = self.windows[window].triangles - ahead;
        let at = self.windows.partition_point(|window| window.triangles < reached);
        self.windows[at].rasterized
    }

    /// Takes a window's part: `given` triangles and quads, which geometry delivers between the two times of `from`. At most `waiting` quads
    /// are between rasteriser and ROPs, and each stays there for at least `latency` cycles.
    pub fn take(&mut self, given: [f64; 2], from: [f64; 2], work: &Work, waiting: f64, latency: f64) {
        let last = self.last();
        let slowest = |units: &[f64]| units.iter().copied().fold(0.0, later);
        while self.windows.get(self.shaded).is_some_and(|window| last.quads - window.quads > waiting) {
            self.shaded += 1;
        }
        let place = if self.shaded == 0 { 0.0 } else { self.windows[self.shaded - 1].written };
        let begin = later(later(last.rasterized, from[0]), place);
        let rasterized = later(begin + slowest(&work[..RASTERIZER]), from[1]);
        let latency = if given[1] > 0.0 { latency } else { 0.0 };
        let shaded = later(later(last.shaded, begin) + slowest(&work[RASTERIZER..]), rasterized + latency);
        let [triangles, quads] = [last.triangles + given[0], last.quads + given[1]];
        self.windows.push(Passed { triangles, quads, rasterized, shaded, written: shaded });
    }
}

/// The units of a pipeline, those of its rasteriser first.
pub(super) const UNITS: [&str; 8] = ["setup", "traverse", "depth", "interpolate", "dispatch", "core", "texture", "color"];

/// Units of the rasteriser.
const RASTERIZER: usize = 5;

/// Cycles of each unit of a pipeline.
pub(super) type Work = [f64; UNITS.len()];

/// The cycles that a cell takes in traversal. `open` is the part of its groups of quads that hierarchical Z does not throw away.
pub(super) fn traversal(cell: &Cell, rates: &Rates, open: f64) -> f64 {
    let [tested, blocks] = [f64::from(cell.tested) * rates.test, f64::from(cell.blocks) * rates.block];
    later(later(f64::from(cell.groups) * open * rates.group, tested), blocks)
}

/// The cycles that a cell takes in each unit of a pipeline.
pub(super) fn work_of(cell: &Cell, rates: &Rates) -> Work {
    let (triangles, groups, shaded) = (f64::from(cell.triangles), f64::from(cell.groups), f64::from(cell.shaded));
    [
        triangles * rates.setup,
        traversal(cell, rates, 1.0),
        later(groups * rates.depth, f64::from(cell.seen) * rates.depth_block),
        shaded * rates.interpolate,
        shaded * rates.dispatch,
        shaded * rates.core,
        shaded * rates.texture,
        later(shaded * rates.color, f64::from(cell.pins) * rates.color_block),
    ]
}

impl Bound<'_> {
    /// Lets the windows of a pass flow through geometry and pipelines: geometry takes them one after another; a pipeline has its part
    /// of a window when its part of the one before is done; and geometry is ahead
    /// of a pipeline by what the queues between them hold.
    /// Cycles until the last is done.
    pub(super) fn fluid(
        &self,
        roofs: &mut Roofs,
        rates: &[Rates],
        owners: &[Option<u8>],
        windows: &[Window],
        cells: &[Cell],
    ) -> f64 {
        let pipelines = self.config.card.pipelines as usize;
        let mut sums = vec![[0.0; UNITS.len()]; pipelines];
        let mut work = vec![[0.0; UNITS.len()]; pipelines];
        let mut done = vec![Pipeline::default(); pipelines];
        let waiting = self.waiting();
        let (mut geometry, mut first) = (0.0_f64, 0);
        let mut given = vec![[0.0; 2]; pipelines];
        for window in windows {
            given.iter_mut().for_each(|given| *given = [0.0; 2]);
            let rates = &rates[window.draw as usize];
            let primitives = f64::from(window.primitives);
            work.iter_mut().for_each(|units| {
                *units = [0.0, 0.0, 0.0, 0.0, 0.0, primitives * rates.vertex_core, primitives * rates.vertex_texture, 0.0]
            });
            let range = first as usize..window.end as usize;
            for (cell, owner) in cells[range.clone()].iter().zip(&owners[range]) {
                let (triangles, shaded) = (f64::from(cell.triangles), f64::from(cell.shaded));
                let units = work_of(cell, rates);
                let (owners, part) = match *owner {
                    Some(pipeline) => (usize::from(pipeline)..usize::from(pipeline) + 1, 1.0),
                    None => (0..pipelines, 1.0 / pipelines as f64),
                };
                for at in owners {
                    work[at].iter_mut().zip(units).for_each(|(sum, cycles)| *sum += cycles * part);
                    given[at][0] += triangles * part;
                    given[at][1] += shaded * part;
                }
            }
            first = window.end;
            let place = done.iter_mut().map(|pipeline| pipeline.place(waiting[0])).fold(0.0, later);
            let begin = later(geometry, place);
            geometry = begin + primitives * rates.geometry;
            for (((pipeline, units), sums), given) in done.iter_mut().zip(&work).zip(&mut sums).zip(&given) {
                pipeline.take(*given, [begin, geometry], units, waiting[1], rates.shaded);
                sums.iter_mut().zip(units).for_each(|(sum, cycles)| *sum += cycles);
            }
        }
        for (at, unit) in UNITS.into_iter().enumerate() {
            roofs.add(unit, sums.iter().map(|sums| sums[at]).fold(0.0, f64::max));
        }
        done.iter().map(|pipeline| pipeline.last().written).fold(geometry, f64::max)
    }

    /// Triangles that wait before a pipeline's setup, and quads that are in its queues and cores, at most.
    pub(super) fn waiting(&self) -> [f64; 2] {
        let c = self.config;
        let triangles = c.network.receive_queue + c.setup.queue;
        // Groups of up to four quads are half full on average.
        let queued = 2 * (c.traverse.queue + c.depth.fifo + c.depth.output_queue + c.interpolate.queue) + c.dispatch.reorder;
        let resident = c.core.warps * c.core.warp_width / 4 * c.core.per_pipeline;
        [f64::from(triangles), f64::from(queued + resident)]
    }
}
