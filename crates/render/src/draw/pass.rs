//! A render pass: its attachments, and draws into them.

use std::sync::{Arc, Mutex};

use crate::parallel;
use crate::surface::{ALL, Shape, TileSurface, aspect_masks};
use gfx::format::Format;
use host::one_line;
use num::{LimitExceeded, LimitOverrun, Meter};
use shader::{Program, ShaderFault, Uniforms};
use work::{Areas, Cull, Culling, Event, Funnel, Segment};

use super::super::needs::Need;
use super::areas;
use super::batch::{self, Batch};
use super::cull;
use super::frame::{PreparedDraw, Workers};
use super::plan::{Piece, Planner};
use super::record::{self, TileRecord};
use super::settings::Settings;
use super::signature;
use super::stream::{Stream, StreamSource};
use super::tile::{self, MAX_COLORS, SegmentInput, TileJob};
use super::vertex::Vertices;
use super::{DrawCall, Drawn, Range};

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

/// Why a draw cannot be done.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum DrawError {
    /// Pipeline and pass do not fit each other.
    #[error("render pipeline `{}`: {message}", one_line(.label))]
    Pipeline {
        /// The pipeline's label.
        label: String,
        /// What does not fit.
        message: String,
    },
    /// Too many attachments.
    #[error("{0} colour attachments, at most {MAX_COLORS} are possible")]
    Attachments(usize),
    /// A shader was stopped.
    #[error(transparent)]
    Shader(#[from] ShaderFault),
    /// It asks for more than is allowed.
    #[error(transparent)]
    Limit(#[from] LimitExceeded),
    /// It came to more than is allowed.
    #[error(transparent)]
    Overrun(#[from] LimitOverrun),
    /// There is not as much memory as it asks for.
    #[error("{0}")]
    Memory(String),
}

impl From<DrawError> for String {
    fn from(error: DrawError) -> String {
        error.to_string()
    }
}

/// Scratch of a draw's stages; what one draw allocated serves the next.
struct Scratch {
    workers: Workers,
    stages: Stages,
    uniforms: [Uniforms; 2],
}

/// What the stages of a segment hand on.
#[derive(Default)]
struct Stages {
    stream: Stream,
    vertices: Vertices,
    batches: Vec<Batch>,
    /// How many of the batches the current segment has.
    batches_used: usize,
    planner: Planner,
    pieces: Vec<Piece>,
    /// The tiles that the current segment draws.
    touched: Vec<u32>,
    /// What is recorded of each of them; where nothing is, of one or of each that is drawn by another thread, and they are empty.
    records: Vec<TileRecord>,
}

/// What the geometry half of a segment came to.
struct Geometry {
    /// Where work is recorded.
    segment: Option<Box<Segment>>,
    /// Entries of the stream, without those that an earlier segment has read.
    entries: u64,
    /// Vertices shaded.
    shaded: u64,
    /// Quads, about.
    quads: u64,
}

/// Tiles that are not worth other threads.
const FEW_TILES: usize = 2;

/// Quads and triangles of tiles that are not worth other threads either: to wake them, and to wait for them where the host is busy, takes
/// longer than to draw these.
const FEW_QUADS: u64 = 128;
const FEW_REFERENCES: u64 = 64;

/// Does something with every item, on this thread alone where there is only one.
fn each<T: Send>(items: &mut [T], work: impl Fn(&mut T) + Sync + Send) {
    match items {
        [item] => work(item),
        items => parallel::each(items.iter_mut(), parallel::ANY, |_, item| work(item)),
    }
}

/// Scratch that no pass uses at the moment: passes come one after the other, and fresh memory costs page faults.
static IDLE: Mutex<Vec<Scratch>> = Mutex::new(Vec::new());

impl Scratch {
    fn take() -> Box<Scratch> {
        let idle = IDLE.lock().unwrap_or_else(std::sync::PoisonError::into_inner).pop();
        let fresh = || Scratch { workers: Workers::new(), stages: Stages::default(), uniforms: <[Uniforms; 2]>::default() };
        Box::new(idle.filter(|s| s.workers.suffice()).unwrap_or_else(fresh))
    }

    fn give(self: Box<Scratch>) {
        IDLE.lock().unwrap_or_else(std::sync::PoisonError::into_inner).push(*self);
    }
}

/// A render pass between begin and end.
pub struct RenderPass {
    width: u32,
    height: u32,
    samples: u32,
    color: Vec<Option<(TileSurface, Format)>>,
    depth: Option<TileSurface>,
    scratch: Option<Box<Scratch>>,
    /// Those of the last draw.
    settings: Option<Box<Settings>>,
}

/// The attachments of a pass that has ended.
#[derive(Debug)]
pub struct EndedPass {
    /// Colour attachments by location.
    pub color: Vec<Option<TileSurface>>,
    /// Depth and stencil.
    pub depth: Option<TileSurface>,
}

/// The walk over a draw's primitives, without those that bounds show to be out of view.
fn plan(call: &DrawCall<'_>, frame: &PreparedDraw<'_>, planner: &mut Planner) -> Result<Culling, DrawError> {
    let range = call.range;
    let index = call.index.map(|i| i.buffer());
    let restart = call.pipeline.primitive.strip_index_format.map(|f| if f.bytes() == 2 { 0xffff } else { u32::MAX });
    if restart.is_some() && index.is_some() && frame.topology.is_strip() {
        // At most every other index ends a strip.
        let strips = u64::from(range.count / 2) * STRIP;
        call.ledger.passing("the strips of a draw", strips).map_err(DrawError::Memory)?;
    }
    let first = u64::from(range.first_instance);
    let instances = first..first + u64::from(range.instances);
    planner.begin(frame.topology, index.as_ref(), [range.first, range.count], restart, instances);
    match call.boxes {
        Some(boxes) if cull::may_cull(call, frame) && planner.instance_primitives() > 0 => {
            let (primitives, entries) = (planner.instance_primitives(), planner.instance_entries());
            let restart = restart.filter(|_| frame.topology.is_strip());
            if call.key.cull == Cull::Instances {
                // Each instance is a run of the program on single values.
                let steps = u64::from(range.instances).saturating_mul(call.pipeline.vertex().steps());
                call.ledger.steps.charge(steps / 8)?;
            }
            let candidate = cull::Candidate { call, frame, restart, primitives, entries };
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
/// alone ([`Bound::forgetting`](shader::Bound::forgetting)): the sum of steps is that of all tasks, or it is over.
fn settle(call: &DrawCall<'_>, workers: &Workers, growth: &Meter, program: Option<&Program>) -> Result<(), DrawError> {
    if let Err(over) = workers.settle(call.ledger) {
        return Err(program.map_or(over.into(), |program| program.fault(over.into(), None).into()));
    }
    Ok(growth.verify()?)
}

/// Adds what became of a segment's primitives before its tiles were drawn.
fn count(funnel: &mut Funnel, batches: &[Batch]) {
    for batch in batches {
        *funnel += batch.funnel;
        funnel.triangles_setup += batch.late.iter().filter(|late| late.end.is_some()).count() as u64;
    }
}

/// The depth attachment where a draw uses it, and the bits of its texels that the draw may write.
fn depth_of<'a>(depth: &'a mut Option<TileSurface>, frame: &PreparedDraw<'_>) -> Option<(&'a mut TileSurface, [u32; 4])> {
    let (surface, state) = (depth.as_mut()?, frame.depth.as_ref()?);
    let (depth_bits, stencil_bits) = aspect_masks(surface.shape().format);
    let stencil = if state.writes_stencil() { u32::MAX } else { 0 };
    Some((surface, std::array::from_fn(|w| depth_bits[w] | stencil_bits[w] & stencil)))
}

impl RenderPass {
    /// Begins a pass on attachments of the given extent, loaded or cleared already. A colour attachment comes with the format it
    /// is seen in, which may differ in sRGB-ness from what is stored.
    pub fn begin(
        width: u32,
        height: u32,
        samples: u32,
        color: Vec<Option<(TileSurface, Format)>>,
        depth: Option<TileSurface>,
    ) -> RenderPass {
        let fits = |s: &TileSurface| matches!(s.shape(), Shape { width: w, height: h, samples: n, .. } if (w, h, n) == (width, height, samples));
        assert!(color.iter().flatten().all(|(s, _)| fits(s)) && depth.iter().all(fits), "attachments of one extent");
        RenderPass { width, height, samples, color, depth, scratch: Some(Scratch::take()), settings: None }
    }

    /// Resolves a call against the attachments; takes over what that came to for the draw before it, where nothing of it is different.
    fn settings(&mut self, call: &DrawCall<'_>) -> Result<Box<Settings>, DrawError> {
        match self.settings.take().filter(|settings| settings.fit(call)) {
            Some(settings) => Ok(settings),
            None => {
                let extent = (self.width, self.height, self.samples);
                Ok(Box::new(Settings::new(call, extent, &self.color, self.depth.as_ref())?))
            }
        }
    }

    /// Draws. With `call.record` the draw and its segments go to `sink`, in order.
    ///
    /// # Errors
    /// If pipeline and attachments do not fit each other, or a shader does not end.
    pub fn draw(&mut self, call: &DrawCall<'_>, sink: &mut dyn FnMut(Event)) -> Result<Drawn, DrawError> {
        if self.color.len() > MAX_COLORS {
            return Err(DrawError::Attachments(self.color.len()));
        }
        let settings = self.settings(call)?;
        let mut scratch = self.scratch.take().unwrap_or_else(Scratch::take);
        let Scratch { workers, stages, uniforms } = &mut *scratch;
        let frame = PreparedDraw::new(call, &settings, uniforms);
        let result = self.segments(call, &frame, workers, stages, sink);
        self.scratch = Some(scratch);
        self.settings = Some(settings);
        result
    }

    fn segments(
        &mut self,
        call: &DrawCall<'_>,
        frame: &PreparedDraw<'_>,
        workers: &Workers,
        stages: &mut Stages,
        sink: &mut dyn FnMut(Event),
    ) -> Result<Drawn, DrawError> {
        let culling = plan(call, frame, &mut stages.planner)?;
        if call.record {
            sink(Event::Draw(Arc::new(record::draw(call, frame, self.depth.is_some(), culling))));
        }
        let Range { first, base_vertex, .. } = call.range;
        let source = StreamSource { index: call.index.map(|i| i.buffer()), first, base_vertex };
        let mut drawn = Drawn::default();
        // Vertex shaders with side effects run once: their segments are not cut again.
        let divisible = call.record && !frame.vertex_in_order;
        let [across, down] = self.tiles();
        let most = (SEGMENT_REFERENCES / (across * down).max(1)).clamp(2, SEGMENT_PRIMITIVES);
        let mut limit = most;
        loop {
            let place = stages.planner.place();
            if !stages.planner.next(limit, &mut stages.pieces) {
                return Ok(drawn);
            }
            let primitives: u32 = stages.pieces.iter().map(|p| p.primitives).sum();
            let growth = call.ledger.growth();
            let made = self.geometry(call, frame, workers, stages, &source, &growth);
            settle(call, workers, &growth, Some(call.pipeline.vertex()))?;
            let made = made?;
            let quads = made.quads;
            if divisible && quads > SEGMENT_QUADS && primitives > 2 {
                // Too much for one piece: the same primitives again, fewer at a time.
                let fraction = SEGMENT_QUADS as f64 / quads as f64;
                limit = ((f64::from(primitives) * fraction) as u32).clamp(2, primitives - 1);
                stages.planner.go_back(place);
                continue;
            }
            if call.record {
                let bytes = quads.saturating_mul(RECORDED_QUAD);
                call.ledger.passing("recorded work", bytes).map_err(DrawError::Memory)?;
            }
            drawn += self.fragments(call, frame, workers, stages, &growth, made, sink)?;
            if quads < SEGMENT_QUADS / 4 {
                limit = limit.saturating_mul(2).min(most);
            }
        }
    }

    /// The geometry half of a segment: vertices, primitives, tiles' lists.
    fn geometry(
        &self,
        call: &DrawCall<'_>,
        frame: &PreparedDraw<'_>,
        workers: &Workers,
        stages: &mut Stages,
        source: &StreamSource<'_>,
        growth: &Meter,
    ) -> Result<Geometry, DrawError> {
        let Stages { stream, vertices, batches, pieces, .. } = &mut *stages;
        stream.read(source, pieces, call.record);
        let mut segment = call.record.then(Box::<Segment>::default);
        let shaded = vertices.shade(frame, workers, stream, segment.as_deref_mut().zip(Some(growth)))?;
        let n = batch::cut(frame.topology, pieces, batches);
        let tiles = self.tiles();
        // Every batch has a list for every tile.
        call.ledger.bytes.charge(4 * n as u64 * u64::from(tiles[0]) * u64::from(tiles[1]))?;
        let late_setup = batch::late_setup(frame, call.record);
        let input = batch::Input {
            frame,
            stream,
            vertices,
            tiles: (tiles[0], tiles[0] * tiles[1]),
            record: call.record,
            late_setup,
            mark_small: late_setup && batch::mark_small(frame),
            areas: call.areas || call.need == Need::Survey,
        };
        each(&mut batches[..n], |batch| workers.with(|worker| batch.run(&input, worker)));
        batches.truncate(n.max(64));
        let entries = stream.entries.len() as u64 - pieces.iter().map(|p| u64::from(p.repeated)).sum::<u64>();
        let quads = batches[..n].iter().map(|b| b.quads_estimate).sum();
        stages.batches_used = n;
        Ok(Geometry { segment, entries, shaded, quads })
    }

    /// The fragment half of a segment: all tiles with something in them.
    fn fragments(
        &mut self,
        call: &DrawCall<'_>,
        frame: &PreparedDraw<'_>,
        workers: &Workers,
        stages: &mut Stages,
        growth: &Meter,
        made: Geometry,
        sink: &mut dyn FnMut(Event),
    ) -> Result<Drawn, DrawError> {
        let tiles = self.tiles();
        let Stages { stream, vertices, batches, batches_used, pieces, touched, records, .. } = stages;
        let batches = &mut batches[..*batches_used];
        let wanted = |&tile: &u32| call.need != Need::Survey || areas::surveys([tile % tiles[0], tile / tiles[0]]);
        touched.clear();
        match &*batches {
            [batch] => touched.extend(batch.tiles().iter().copied().filter(wanted)),
            batches => {
                let drawn_here = |tile: &u32| batches.iter().any(|batch| batch.touches(*tile as usize));
                touched.extend((0..tiles[0] * tiles[1]).filter(|tile| wanted(tile) && drawn_here(tile)));
            }
        }
        let references = batches.iter().map(Batch::references).sum();
        call.ledger.quads.charge(references)?;
        let quads: u64 = batches.iter().map(|batch| batch.quads_estimate).sum();
        let few = touched.len() <= FEW_TILES || references <= FEW_REFERENCES && quads <= FEW_QUADS;
        let input = SegmentInput { frame, pieces, batches, vertices, growth };
        let one = |job: &mut TileJob<'_>| workers.with(|worker| tile::draw(&input, worker, job, call.record));
        let alone = frame.tiles_in_order || few;
        let own = if alone && !call.record { 1 } else { touched.len() };
        if call.record {
            // A draw that failed may have left some.
            records.clear();
        }
        records.resize_with(records.len().max(own), TileRecord::default);
        let mut result = Ok(());
        if alone {
            for (i, &index) in touched.iter().enumerate() {
                let record = &mut records[if call.record { i } else { 0 }];
                result = one(&mut self.job(frame, tiles, index as usize, record));
                if result.is_err() {
                    break;
                }
            }
        } else {
            let mut jobs = self.jobs(frame, tiles, touched, records);
            result = parallel::map(jobs.iter_mut(), 1..=1, |_, job| one(job)).collect();
        }
        let mut drawn = workers.take_counts();
        settle(call, workers, growth, frame.fragment)?;
        result?;
        call.ledger.quads.add(drawn.funnel.quads_rasterized);
        call.ledger.quads.verify()?;
        if call.need == Need::Survey {
            // Of some tiles only.
            drawn.funnel = Funnel::default();
        } else {
            each(batches, Batch::count_uncovered);
        }
        drawn.funnel.vertices_in += made.entries;
        drawn.funnel.vertices_shaded += made.shaded;
        count(&mut drawn.funnel, batches);
        if call.areas || call.need == Need::Survey {
            batches.iter().for_each(|batch| drawn.areas += batch.areas);
        } else {
            // Tiles count what is visible in any case.
            drawn.areas = Areas::default();
        }
        if let Some(mut segment) = made.segment {
            segment.funnel = drawn.funnel;
            segment.areas = drawn.areas;
            let tile = |(&tile, record): (&u32, &mut TileRecord)| (tile % tiles[0], tile / tiles[0], std::mem::take(record));
            let recorded = touched.iter().zip(records).map(tile).collect();
            // The segment waits for the machine, with as much memory as made it: what is not needed now goes.
            let signed = call.signature.is_some().then(|| signature::vertices(vertices));
            vertices.release();
            let mut segment = record::assemble(call, pieces, stream, batches, recorded, *segment);
            if let Some(signed) = signed {
                segment.signatures = signature::primitives(&segment.primitives, &signed);
            }
            sink(Event::Segment(Arc::new(segment)));
        }
        Ok(drawn)
    }

    /// One tile with its parts of the attachments.
    fn job<'a>(
        &'a mut self,
        frame: &PreparedDraw<'_>,
        tiles: [u32; 2],
        index: usize,
        record: &'a mut TileRecord,
    ) -> TileJob<'a> {
        let mut job = TileJob::new(index, tiles[0], record);
        let mut locations: [Option<&mut TileSurface>; MAX_COLORS] = Default::default();
        for (location, color) in locations.iter_mut().zip(&mut self.color) {
            *location = color.as_mut().map(|(surface, _)| surface);
        }
        for (tile, target) in job.colors.iter_mut().zip(&frame.targets) {
            *tile = locations[target.location].take().map(|surface| surface.tile_mut(index, ALL));
        }
        job.depth = depth_of(&mut self.depth, frame).map(|(surface, written)| surface.tile_mut(index, written));
        job
    }

    /// Some tiles, in order, with their parts of the attachments, and with what is recorded of each.
    fn jobs<'a>(
        &'a mut self,
        frame: &PreparedDraw<'_>,
        tiles: [u32; 2],
        indices: &[u32],
        records: &'a mut [TileRecord],
    ) -> Vec<TileJob<'a>> {
        let mut locations: Vec<Option<_>> =
            self.color.iter_mut().map(|c| c.as_mut().map(|(surface, _)| surface.tiles_mut(ALL))).collect();
        let mut colors: Vec<_> = frame.targets.iter().map(|t| locations[t.location].take()).collect();
        let mut depth = depth_of(&mut self.depth, frame).map(|(surface, written)| surface.tiles_mut(written));
        let mut jobs = Vec::with_capacity(indices.len());
        let mut next = 0;
        for (index, record) in indices.iter().map(|&index| index as usize).zip(records) {
            let skipped = index - next;
            next = index + 1;
            let mut job = TileJob::new(index, tiles[0], record);
            for (tile, surface) in job.colors.iter_mut().zip(&mut colors) {
                *tile = surface.as_mut().and_then(|tiles| tiles.nth(skipped));
            }
            job.depth = depth.as_mut().and_then(|tiles| tiles.nth(skipped));
            jobs.push(job);
        }
        jobs
    }

    fn tiles(&self) -> [u32; 2] {
        let format = Format::R8Unorm;
        Shape { format, width: self.width, height: self.height, samples: self.samples }.tiles()
    }

    /// Ends the pass and gives its attachments back.
    pub fn end(mut self) -> EndedPass {
        if let Some(scratch) = self.scratch.take() {
            scratch.give();
        }
        EndedPass { color: self.color.into_iter().map(|c| c.map(|(surface, _)| surface)).collect(), depth: self.depth }
    }
}
