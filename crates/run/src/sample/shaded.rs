//! The time of a frame's shaders: how often the programs of each pipeline run in it, and the time of a run.
//!
//! What a run takes is measured in the frames that are recorded. Of pipelines that none of these uses it is known how many instructions their
//! programs have.

use std::collections::BTreeMap;
use std::io;

use super::table::Table;
use crate::bound::Bound;
use gfx::stage::{Stage, StageMap};
use machine::Config;
use work::profile::{FrameProfile, PhaseProfile, ShaderProfile};
use work::{Areas, Event, Programs};

/// Runs of a pipeline's programs in a frame: vertices, quads by their areas, quads that are seen, and packets of four invocations.
const RUNS: usize = 4;

/// Screen tiles for each one that a survey looks at ([`Areas::visible`]).
const TILES: f64 = 4.0;

/// The numbers of runs of the pipelines' programs in consecutive frames.
pub(super) struct Runs {
    /// The pipelines of each frame, frame after frame: their numbers and runs.
    rows: Table<f64>,
    /// The runs of the frame that is being read.
    open: BTreeMap<u64, [f64; RUNS]>,
    /// The programs of the pipelines, known before they run.
    programs: BTreeMap<u64, Programs>,
}

impl Default for Runs {
    fn default() -> Self {
        Runs { rows: Table::new(1 + RUNS), open: BTreeMap::new(), programs: BTreeMap::new() }
    }
}

impl Runs {
    /// Adds an event of a frame; whether fragments are tested early where they may be.
    pub fn add(&mut self, event: &Event, early: bool) {
        let (programs, runs) = match event {
            Event::Segment(segment) | Event::Applied(segment) => {
                let Areas { quads, visible, .. } = segment.areas;
                let quads = quads as f64 / 256.0;
                let visible = if early { visible as f64 * TILES } else { quads };
                (segment.programs, [segment.funnel.vertices_shaded as f64, quads, visible, 0.0])
            }
            Event::Dispatch(dispatch) => {
                let packets = dispatch.groups as f64 * f64::from(dispatch.invocations.div_ceil(4));
                (dispatch.programs, [0.0, 0.0, 0.0, packets])
            }
            _ => return,
        };
        self.programs.insert(programs.pipeline, programs);
        let open = self.open.entry(programs.pipeline).or_default();
        open.iter_mut().zip(runs).for_each(|(sum, own)| *sum += own);
    }

    /// Ends a frame; gives how many pipelines it has used.
    ///
    /// # Errors
    /// If they cannot be kept.
    pub fn end_frame(&mut self) -> io::Result<usize> {
        let used = self.open.len();
        while let Some((pipeline, runs)) = self.open.pop_first() {
            let mut row = [pipeline as f64; 1 + RUNS];
            row[1..].copy_from_slice(&runs);
            self.rows.add(&row)?;
        }
        Ok(used)
    }
}

/// What the shaders of a frame take, in cycles: cores for vertices, for quads by their areas and for quads that are seen; texture units for
/// both; all units for packets; and the slowest unit of each pipeline's pixels.
pub(super) type Shaded = [f64; SHADED];

/// How many numbers that are.
pub(super) const SHADED: usize = 7;

/// The time that a run of each of a pipeline's programs takes in a core and in its texture unit: of a vertex, a quad, a packet.
type ProgramTimes = StageMap<[f64; 2]>;

/// The costs of the runs of all pipelines.
pub(super) struct Costs {
    of: BTreeMap<u64, ProgramTimes>,
    cores: f64,
    /// Quads that all ROPs write in a cycle.
    quads: f64,
}

/// The measurements of a pipeline: the cost of the runs of each stage, and the registers of an invocation.
type Measured = StageMap<(ShaderProfile, u32)>;

/// The invocations of a run of each stage: a vertex, a quad, a packet.
const INVOCATIONS: StageMap<f64> = StageMap::new([1.0, 4.0, 4.0]);

impl Costs {
    /// The costs of the pipelines of some frames, by the profiles of those that are recorded.
    pub fn new<'p>(
        config: &Config,
        bound: &Bound,
        all: impl Iterator<Item = &'p Runs>,
        recorded: impl Iterator<Item = &'p FrameProfile>,
    ) -> Costs {
        let mut measured: BTreeMap<u64, Measured> = BTreeMap::new();
        for phase in recorded.flat_map(|frame| &frame.phases) {
            match phase {
                PhaseProfile::Pass { draws, .. } => {
                    for draw in draws {
                        let own = measured.entry(draw.pipeline).or_default();
                        for stage in Stage::ALL.into_iter().filter(|&stage| draw.costs[stage].runs > 0) {
                            own[stage].0 += draw.costs[stage];
                            own[stage].1 = draw.registers[stage];
                        }
                    }
                }
                PhaseProfile::Dispatch { pipeline, cost, registers, .. } => {
                    let own = &mut measured.entry(*pipeline).or_default()[Stage::Compute];
                    own.0 += *cost;
                    own.1 = *registers;
                }
                PhaseProfile::Transfers { .. } | PhaseProfile::ScanOut { .. } => {}
            }
        }
        let mut of = BTreeMap::new();
        for programs in all.flat_map(|runs| runs.programs.values()) {
            let none = Measured::default();
            let own = measured.get(&programs.pipeline).unwrap_or(&none);
            let times = ProgramTimes::from_fn(|stage| {
                let (cost, registers) = &own[stage];
                if cost.runs > 0 {
                    return bound.of_run(cost, INVOCATIONS[stage], *registers);
                }
                let instructions = programs.instructions[stage].map(u64::from);
                let cost = ShaderProfile { runs: 1, instructions, chain: instructions, ..ShaderProfile::default() };
                bound.of_run(&cost, INVOCATIONS[stage], 1)
            });
            of.insert(programs.pipeline, times);
        }
        let pipelines = f64::from(config.card.pipelines);
        Costs {
            of,
            cores: pipelines * f64::from(config.core.per_pipeline),
            quads: pipelines * f64::from(config.color.quads_per_cycle),
        }
    }

    /// Adds what some runs of a pipeline's programs take to what the shaders of a frame take.
    fn add(&self, sum: &mut Shaded, pipeline: u64, [vertices, quads, visible, packets]: [f64; RUNS]) {
        let times = self.of.get(&pipeline).copied().unwrap_or_default();
        let [vertex, quad, packet] = Stage::ALL.map(|stage| times[stage]);
        let texture = |quads: f64| vertices * vertex[1] + quads * quad[1];
        let slowest = quad[0].max(quad[1]) / self.cores;
        let own = [
            vertices * vertex[0] / self.cores,
            quads * quad[0] / self.cores,
            visible * quad[0] / self.cores,
            texture(quads) / self.cores,
            texture(visible) / self.cores,
            packets * packet[0].max(packet[1]) / self.cores,
            visible * slowest.max(1.0 / self.quads),
        ];
        sum.iter_mut().zip(own).for_each(|(sum, own)| *sum += own);
    }
}

/// A walk through the frames of some runs.
pub(super) struct Walk<'r> {
    runs: &'r Runs,
    costs: &'r Costs,
    next: usize,
    rows: Vec<f64>,
}

impl<'r> Walk<'r> {
    /// Begins with the first frame.
    pub fn new(runs: &'r Runs, costs: &'r Costs) -> Walk<'r> {
        Walk { runs, costs, next: 0, rows: Vec::new() }
    }

    /// The time of the shaders of the next frame, which has used `used` pipelines.
    ///
    /// # Errors
    /// If what is kept of them cannot be read.
    pub fn frame(&mut self, used: usize) -> io::Result<Shaded> {
        let mut sum = [0.0; SHADED];
        self.runs.rows.fill(&(self.next..self.next + used), &mut self.rows)?;
        self.next += used;
        for row in self.rows.chunks_exact(1 + RUNS) {
            self.costs.add(&mut sum, row[0] as u64, std::array::from_fn(|at| row[1 + at]));
        }
        Ok(sum)
    }
}
