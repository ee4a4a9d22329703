//! The geometry half of a draw: which primitives its segments have, their vertices, and what of them lies in which tile. It reads nothing that
//! a draw before it has drawn.

use gfx::stage::Stage;
use num::Meter;
use shader::Program;
use work::{Cull, Culling, Segment};

use super::super::ledger::CLIPPED_STEPS;
use super::super::needs::Need;
use super::batch::{self, Batch};
use super::cull;
use super::plan::{Piece, Planner};
use super::record::TileRecord;
use super::stream::{Stream, StreamSource};
use super::vertex::Vertices;
use super::workers::Workers;
use super::{DrawCall, DrawError, DrawRange};
use crate::parallel;

/// Primitives of a segment.
const SEGMENT_PRIMITIVES: u32 = 64 * 1024;

/// References of a segment to triangles, in all tiles together, at most: on the largest targets its primitives are fewer.
const SEGMENT_REFERENCES: u32 = 1 << 27;

/// Bytes of a strip in the plan of a draw.
const STRIP: u64 = 12;

/// Bytes of a recorded quad, roughly: itself, depth and colour, a request.
const RECORDED_QUAD: u64 = 48;

/// Quads of a recorded segment, roughly.
const SEGMENT_QUADS: u64 = 1 << 20;

/// The results that the stages of a segment hand on.
#[derive(Default)]
pub struct Stages {
    pub stream: Stream,
    pub vertices: Vertices,
    pub batches: Vec<Batch>,
    /// How many of the batches the current segment has.
    pub batches_used: usize,
    pub planner: Planner,
    pub pieces: Vec<Piece>,
    /// The tiles that the current segment draws.
    pub touched: Vec<u32>,
    /// The record of each tile. Without recording there is an empty record, or one for each tile that another thread draws.
    pub records: Vec<TileRecord>,
}

impl Stages {
    /// Quads of the current segment, about.
    pub fn quads(&self) -> u64 {
        self.batches[..self.batches_used].iter().map(|batch| batch.quads_estimate).sum()
    }
}

/// The result of the geometry half of a segment.
pub struct Geometry {
    /// Memory that threads claim for it.
    pub growth: Meter,
    /// Where work is recorded.
    pub segment: Option<Box<Segment>>,
    /// Entries of the stream, without those that an earlier segment has read.
    pub entries: u64,
    /// Vertices shaded.
    pub shaded: u64,
}

/// Does something with every item, on this thread alone where there is only one.
pub fn each<T: Send>(items: &mut [T], work: impl Fn(&mut T) + Sync + Send) {
    match items {
        [item] => work(item),
        items => parallel::each(items.iter_mut(), parallel::ANY, |_, item| work(item)),
    }
}

/// The walk over a draw's primitives, without those that bounds show to be out of view.
pub fn plan(call: &DrawCall<'_>, planner: &mut Planner) -> Result<Culling, DrawError> {
    let range = call.range;
    let index = call.index.map(|i| i.buffer());
    let restart = call.pipeline.primitive.strip_index_format.map(|f| if f.bytes() == 2 { 0xffff } else { u32::MAX });
    if restart.is_some() && index.is_some() && call.topology.is_strip() {
        // At most every other index ends a strip.
        let strips = u64::from(range.count / 2) * STRIP;
        call.ledger.passing("the strips of a draw", strips)?;
    }
    let first = u64::from(range.first_instance);
    let instances = first..first + u64::from(range.instances);
    planner.begin(call.topology, index.as_ref(), [range.first, range.count], restart, instances);
    match call.boxes {
        Some(boxes) if cull::may_cull(call) && planner.instance_primitives() > 0 => {
            let (primitives, entries) = (planner.instance_primitives(), planner.instance_entries());
            let restart = restart.filter(|_| call.topology.is_strip());
            if call.options.key.cull == Cull::Instances {
                // Each instance is a run of the program on single values.
                let steps = u64::from(range.instances).saturating_mul(call.vertex().stage.program.steps());
                call.ledger.steps.charge(steps / 8)?;
            }
            let candidate = cull::Candidate { call, restart, primitives, entries };
            // A poisoned lock means that another draw panicked; what is known of buffers is true all the same.
            let mut boxes = boxes.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
            let seen = candidate.test(&mut boxes);
            planner.draw_only(seen.instances);
            Ok(seen.culling)
        }
        _ => Ok(Culling::default()),
    }
}

/// Looks whether a stage that all threads took part in came to more than is allowed. What stopped one of its tasks comes after: which tasks
/// came to their end says nothing once the sum is over. Steps come before memory, because tasks of several threads are stopped by steps
/// alone ([`BoundProgram::forgetting`](shader::BoundProgram::forgetting)): the sum of steps is that of all tasks, or it is over.
pub fn settle(call: &DrawCall<'_>, workers: &Workers, growth: &Meter, program: Option<&Program>) -> Result<(), DrawError> {
    if let Err(over) = workers.settle(call.ledger) {
        return Err(program.map_or(over.into(), |program| program.fault(over.into(), None).into()));
    }
    Ok(growth.verify()?)
}

/// The way of a draw through its segments.
pub struct Segments {
    tiles: [u32; 2],
    /// Primitives of the next segment, at most.
    limit: u32,
    /// Primitives of any segment, at most.
    most: u32,
    /// Whether a segment of too many quads is cut again: vertex shaders with side effects run once.
    divisible: bool,
}

impl Segments {
    /// The segments of a draw that has been [planned](plan), on a screen of `tiles` columns and rows of tiles.
    pub fn new(call: &DrawCall<'_>, tiles: [u32; 2]) -> Segments {
        let most = (SEGMENT_REFERENCES / (tiles[0] * tiles[1]).max(1)).clamp(2, SEGMENT_PRIMITIVES);
        Segments { tiles, limit: most, most, divisible: call.options.record && !call.vertex_in_order }
    }

    /// The geometry half of the next segment; none behind the last.
    ///
    /// # Errors
    /// If a shader does not end, or something asks for more than is allowed.
    pub fn next(&mut self, call: &DrawCall<'_>, workers: &Workers, stages: &mut Stages) -> Result<Option<Geometry>, DrawError> {
        loop {
            let place = stages.planner.place();
            if !stages.planner.next(self.limit, &mut stages.pieces) {
                return Ok(None);
            }
            let primitives: u32 = stages.pieces.iter().map(|p| p.primitives).sum();
            let growth = call.ledger.growth();
            let made = geometry(call, workers, stages, self.tiles, &growth);
            settle(call, workers, &growth, Some(&call.pipeline.geometry().program))?;
            let (segment, entries, shaded) = made?;
            let quads = stages.quads();
            if self.divisible && quads > SEGMENT_QUADS && primitives > 2 {
                // Too much for one piece: the same primitives again, fewer at a time.
                let fraction = SEGMENT_QUADS as f64 / quads as f64;
                self.limit = ((f64::from(primitives) * fraction) as u32).clamp(2, primitives - 1);
                stages.planner.go_back(place);
                continue;
            }
            if call.options.record {
                let bytes = quads.saturating_mul(RECORDED_QUAD);
                call.ledger.passing("recorded work", bytes)?;
            }
            if quads < SEGMENT_QUADS / 4 {
                self.limit = self.limit.saturating_mul(2).min(self.most);
            }
            return Ok(Some(Geometry { growth, segment, entries, shaded }));
        }
    }
}

/// The geometry half of a segment: vertices, primitives, tiles' lists. What is recorded of it, entries of the stream without those that an earlier
/// segment has read, and vertices shaded.
fn geometry(
    call: &DrawCall<'_>,
    workers: &Workers,
    stages: &mut Stages,
    [across, down]: [u32; 2],
    growth: &Meter,
) -> Result<(Option<Box<Segment>>, u64, u64), DrawError> {
    let Stages { stream, vertices, batches, pieces, .. } = &mut *stages;
    let DrawRange { first, base_vertex, .. } = call.range;
    stream.read(&StreamSource { index: call.index.map(|i| i.buffer()), first, base_vertex }, pieces, call.options.record);
    let mut segment = call.options.record.then(Box::<Segment>::default);
    let shaded = match call.pipeline.geometry().kind() {
        Stage::Vertex => vertices.shade(call, workers, stream, segment.as_deref_mut().zip(Some(growth)))?,
        kind @ (Stage::Fragment | Stage::Compute) => unreachable!("the {} stage comes before no rasteriser", kind.name()),
    };
    let n = batch::cut(call.topology, pieces, batches);
    // Every batch has a list for every tile.
    call.ledger.bytes.charge(4 * n as u64 * u64::from(across) * u64::from(down))?;
    let late_setup = batch::late_setup(call);
    let input = batch::Input {
        call,
        stream,
        vertices,
        tiles: (across, across * down),
        late_setup,
        mark_small: late_setup && batch::mark_small(call),
        areas: call.options.areas || call.options.need == Need::Survey,
    };
    let run = |batch: &mut Batch| workers.with(|worker| batch.run(&input, worker));
    each(&mut batches[..n], run);
    let clipped: u64 = batches[..n].iter().map(|batch| batch.funnel.clipped).sum();
    call.ledger.steps.charge(CLIPPED_STEPS.saturating_mul(clipped))?;
    batches.truncate(n.max(64));
    let entries = stream.entries.len() as u64 - pieces.iter().map(|p| u64::from(p.repeated)).sum::<u64>();
    stages.batches_used = n;
    Ok((segment, entries, shaded))
}
