//! Vertex shading: 64 vertices at a time, each once per segment.

use std::ops::Range;

use crate::parallel;
use crate::pipeline::Varying;
use gfx::clip::Outcode;
use gfx::setup::ScreenVertex;
use gfx::simd::wide;
use gfx::stage::Stage;
use gfx::state::StepMode;
use num::{LANES, Lanes, Mask, Meter, QUADS};
use shader::{BoundProgram, BuiltIn, Executor, Recorder, ShaderFault};

use super::DrawCall;
use super::stream::Stream;
use super::workers::Workers;

/// Batches that one task shades.
const BATCHES: usize = 16;

/// Vertices that one task shades.
const TASK: usize = BATCHES * LANES;

/// Shaded vertices of a segment; memory is kept from one to the next.
#[derive(Default)]
pub struct Vertices {
    /// Which planes each is outside of.
    pub codes: Vec<Outcode>,
    /// Window positions.
    pub screen: Vec<ScreenVertex>,
    /// Clip positions.
    pub clip: Vec<[f32; 4]>,
    /// Varyings, `varying_stride` words per vertex.
    pub varyings: Vec<u32>,
    /// Clip distances, `distance_stride` a vertex.
    pub distances: Vec<f32>,
    /// Words of a vertex in `varyings`.
    pub varying_stride: usize,
    /// Numbers of a vertex in `distances`.
    pub distance_stride: usize,
    /// Empty between segments, and new after one that failed.
    recorder: Recorder,
}

/// The part of [`Vertices`] that one task writes.
struct Task<'a> {
    codes: &'a mut [Outcode],
    screen: &'a mut [ScreenVertex],
    clip: &'a mut [[f32; 4]],
    varyings: &'a mut [u32],
    distances: &'a mut [f32],
}

impl Vertices {
    /// Gives memory back, but for as much as a small draw needs: draws come by the hundred, and new memory has to be cleared.
    pub fn release(&mut self) {
        if self.codes.len() > TASK {
            *self = Vertices { recorder: std::mem::take(&mut self.recorder), ..Vertices::default() };
        }
    }

    /// Shades the vertices of a stream. With `record`, costs and requests are recorded, in order of the vertices.
    ///
    /// # Errors
    /// If the shader does not end.
    pub fn shade(
        &mut self,
        call: &DrawCall<'_>,
        workers: &Workers,
        stream: &Stream,
        record: Option<(&mut work::Segment, &Meter)>,
    ) -> Result<u64, ShaderFault> {
        self.varying_stride = call.pipeline.varying_words;
        self.distance_stride = call.pipeline.clip_distances.map_or(0, |(_, n)| n);
        let room = stream.vertices.next_multiple_of(if stream.vertices <= TASK { LANES } else { TASK });
        self.codes.resize(room, 0);
        self.screen.resize(room, ScreenVertex::default());
        self.clip.resize(room, [0.0; 4]);
        // Chunks must not be empty: one word where there is nothing.
        let (vs, ds) = (self.varying_stride.max(1), self.distance_stride.max(1));
        self.varyings.resize(room * vs, 0);
        self.distances.resize(room * ds, 0.0);
        let tasks = self
            .codes
            .chunks_mut(TASK)
            .zip(self.screen.chunks_mut(TASK))
            .zip(self.clip.chunks_mut(TASK))
            .zip(self.varyings.chunks_mut(TASK * vs))
            .zip(self.distances.chunks_mut(TASK * ds))
            .map(|((((codes, screen), clip), varyings), distances)| Task { codes, screen, clip, varyings, distances });
        if let Some((segment, growth)) = record {
            // One recorder in one thread, so that costs are numbered in order.
            let mut recorder = std::mem::take(&mut self.recorder);
            recorder.extra = call.extra;
            segment.vertices.reserve_exact(stream.vertices);
            let mut shaded = 0;
            // Costs and requests are recorded per quad of lanes. Where there may be requests, a vertex has a quad for itself.
            let program = &call.vertex().stage.program;
            let alone = !program.interface().bindings.is_empty() && !program.is_straight();
            for (number, mut task) in tasks.enumerate() {
                let start = number * TASK;
                let mut record = Some((&mut recorder, &mut *segment, growth));
                shaded += workers.with(|w| match alone {
                    true => shade_task::<4>(call, &mut w.executors[Stage::Vertex], stream, start, &mut task, &mut record),
                    false => shade_task::<1>(call, &mut w.executors[Stage::Vertex], stream, start, &mut task, &mut record),
                })?;
            }
            growth.add(recorder.take_bytes());
            let invocations = &mut segment.invocations[Stage::Vertex];
            *invocations = recorder.take();
            invocations.shrink_to_fit();
            self.recorder = recorder;
            return Ok(shaded);
        }
        let one = |number: usize, mut task: Task<'_>| {
            workers
                .with(|w| shade_task::<1>(call, &mut w.executors[Stage::Vertex], stream, number * TASK, &mut task, &mut None))
        };
        if call.vertex_in_order || room <= TASK {
            return tasks.enumerate().map(|(number, task)| one(number, task)).sum();
        }
        parallel::map(tasks, parallel::ANY, one).sum()
    }
}

/// Shades the vertices of a task, `LANES / SPREAD` at a time: vertex `i` of a batch is lane `SPREAD * i`.
fn shade_task<const SPREAD: usize>(
    call: &DrawCall<'_>,
    executor: &mut Executor,
    stream: &Stream,
    start: usize,
    task: &mut Task<'_>,
    record: &mut Option<(&mut Recorder, &mut work::Segment, &Meter)>,
) -> Result<u64, ShaderFault> {
    let pipeline = &*call.pipeline;
    let vertex = call.vertex();
    if call.ledger.steps.verify().is_err() {
        return Ok(0);
    }
    let growth = record.as_ref().map(|(.., growth)| *growth);
    let bound = executor.bind(&vertex.stage.program, &vertex.resources, vertex.uniforms);
    let mut bound = bound.within(&call.ledger.steps, growth);
    let (mut index, mut instance) = ([0; LANES], [0; LANES]);
    let mut fetched = [Lanes::ZERO; 4];
    let mut shaded = 0;
    let step = LANES / SPREAD;
    for first in (start..stream.vertices.min(start + TASK)).step_by(step) {
        let mut used: Mask = stream.used(first) & (u64::MAX >> (LANES - step));
        if used == 0 {
            continue;
        }
        // Draws of few vertices leave most lanes empty: what is done lane by lane ends with the last that is used.
        let n = LANES - used.leading_zeros() as usize;
        stream.identify(first, &mut index[..n], &mut instance[..n]);
        let mask = if SPREAD > 1 { (0..step).fold(0, |wide, i| wide | (used >> i & 1) << (SPREAD * i)) } else { used };
        shaded += u64::from(mask.count_ones());
        for attribute in &pipeline.attributes {
            let by = match attribute.step {
                StepMode::Vertex => &index,
                StepMode::Instance => &instance,
            };
            call.source(attribute).fetch(attribute.format, attribute.offset, by, n, &mut fetched);
            for c in 0..attribute.components {
                if let Some(input) = bound.input_mut(attribute.input, c) {
                    spread::<SPREAD>(&fetched[c].0, n, &mut input.0);
                }
            }
        }
        for &(slot, builtin) in &vertex.stage.builtins {
            let Some(input) = bound.input_mut(slot, 0) else { continue };
            match builtin {
                BuiltIn::VertexIndex => spread::<SPREAD>(&index, n, &mut input.0),
                BuiltIn::InstanceIndex => spread::<SPREAD>(&instance, n, &mut input.0),
                BuiltIn::BaseVertex => *input = Lanes::splat(call.base_vertex()),
                BuiltIn::BaseInstance => *input = Lanes::splat(call.range.first_instance),
                BuiltIn::DrawIndex => *input = Lanes::splat(call.range.draw_index),
                BuiltIn::SubgroupSize => *input = Lanes::splat(LANES as u32),
                BuiltIn::SubgroupInvocationId => input.0 = std::array::from_fn(|i| i as u32),
                _ => {}
            }
        }
        match record {
            None => drop(bound.run(mask, 0)?),
            Some((recorder, segment, _)) => {
                bound.run_recorded(mask, 0, recorder)?;
                while used != 0 {
                    let i = used.trailing_zeros() as usize;
                    used &= used - 1;
                    let quad = recorder.quads[SPREAD * i / 4 % QUADS];
                    segment.vertices.push(work::Vertex {
                        index: index[i],
                        instance: instance[i],
                        cost: quad.cost,
                        first_request: quad.first_request,
                    });
                }
            }
        }
        let at = first - start;
        let position: [&Lanes; 4] = std::array::from_fn(|c| bound.output(pipeline.position, c));
        place(call, position, SPREAD, at..at + n, task);
        let stride = pipeline.varying_words;
        for varying in &pipeline.varyings {
            let vertices = &mut task.varyings[at * stride..(at + n) * stride];
            match varying.components {
                1 => put_varying::<SPREAD, 1>(&bound, varying, vertices, stride),
                2 => put_varying::<SPREAD, 2>(&bound, varying, vertices, stride),
                3 => put_varying::<SPREAD, 3>(&bound, varying, vertices, stride),
                _ => put_varying::<SPREAD, 4>(&bound, varying, vertices, stride),
            }
        }
        if let Some((slot, planes)) = pipeline.clip_distances {
            for c in 0..planes {
                let value = bound.output(slot, c).f32();
                for i in 0..n {
                    task.distances[(at + i) * planes + c] = value[SPREAD * i];
                }
            }
        }
    }
    Ok(shaded)
}

/// Copies the `N` components of a varying to the records of the vertices.
#[inline(always)]
fn put_varying<const SPREAD: usize, const N: usize>(
    bound: &BoundProgram<'_>,
    varying: &Varying,
    vertices: &mut [u32],
    stride: usize,
) {
    let values: [&[u32; LANES]; N] = std::array::from_fn(|c| &bound.output(varying.output, c).0);
    for (vertex, lane) in vertices.chunks_exact_mut(stride).zip((0..LANES).step_by(SPREAD)) {
        let vertex = &mut vertex[varying.word..][..N];
        for c in 0..N {
            vertex[c] = values[c][lane];
        }
    }
}

/// Copies each of the first `n` values to `SPREAD` lanes. It may copy more values than `n`.
#[inline(always)]
fn spread<const SPREAD: usize>(values: &[u32; LANES], n: usize, lanes: &mut [u32; LANES]) {
    if SPREAD == 1 {
        // Many draws have few vertices.
        match n {
            0..=8 => lanes[..8].copy_from_slice(&values[..8]),
            _ => *lanes = *values,
        }
        return;
    }
    for (lanes, value) in lanes.chunks_exact_mut(SPREAD).zip(values) {
        lanes.fill(*value);
    }
}

wide! {
    /// Finds outcodes and window positions of a batch, of which every `spread`-th lane is a vertex: these of the task.
    fn place(call: &DrawCall<'_>, position: [&Lanes; 4], spread: usize, here: Range<usize>, task: &mut Task<'_>) = place_here;
}

#[inline(always)]
fn place_here(call: &DrawCall<'_>, position: [&Lanes; 4], spread: usize, here: Range<usize>, task: &mut Task<'_>) {
    // Many draws have few vertices.
    match spread * here.len() {
        ..=8 => place_first::<8>(call, position, spread, here, task),
        9..=32 => place_first::<32>(call, position, spread, here, task),
        _ => place_first::<LANES>(call, position, spread, here, task),
    }
}

/// The vertices of the first `N` lanes.
#[inline(always)]
fn place_first<const N: usize>(
    call: &DrawCall<'_>,
    position: [&Lanes; 4],
    spread: usize,
    here: Range<usize>,
    task: &mut Task<'_>,
) {
    let mut codes = [0; N];
    let mut screen = [ScreenVertex::default(); N];
    call.clip.outcodes(position, &mut codes);
    call.screen.vertices(position, &mut screen);
    let [x, y, z, w] = position.map(Lanes::f32);
    for (to, code) in task.codes[here.clone()].iter_mut().zip(codes.iter().step_by(spread)) {
        *to = *code;
    }
    for (to, vertex) in task.screen[here.clone()].iter_mut().zip(screen.iter().step_by(spread)) {
        *to = *vertex;
    }
    for (to, lane) in task.clip[here].iter_mut().zip((0..N).step_by(spread)) {
        *to = [x[lane], y[lane], z[lane], w[lane]];
    }
}
