//! Functional warming: a run that simulates only some segments applies the others here.
//!
//! A segment's quads go through the very tests and blends of the ROPs, in API order, so that depths and colours are what they are behind
//! a segment that was simulated. Nothing takes time and nothing is counted. What later segments meet is left as it would be, as far as it does
//! not depend on time: which blocks are in the ROPs' caches and how large the others are in memory, what hierarchical Z knows of them,
//! which lines the texture caches have, and which pipeline gets the next batch. Reads and writes that go on to memory are reported for the
//! second-level cache, geometry's reads included.

use super::assembly::Assembly;
use super::card::{Ahead, Card, Fault, Group, PassState, Work};
use super::color::{Color, blend_group};
use super::constant::Constant;
use super::deal::Deal;
use super::depth::Depth;
use super::depths::test_group;
use super::fetch::Fetch;
use super::frame::FrameBuffers;
use super::route::Route;
use super::texture::{Texture, stored_bytes};
use super::touch::{Touch, Touching};
use super::traverse::{Territory, Traverse};
use gfx::stage::Stage;
use gfx::state::StepMode;
use work::{Block, LINE, QUAD_SHADED, Request, RequestKind, Segment, TileWork};

/// The units that are warmed: those that keep something from segment to segment.
pub struct WarmedUnits<'u> {
    /// The units that route primitives by their bounds, if the machine has any.
    pub route: &'u [Route],
    /// Vertex fetch, by front.
    pub fetch: &'u [Fetch],
    /// The units that deal primitives to pipelines, if the machine has any.
    pub deal: &'u mut [Deal],
    /// Primitive assembly.
    pub assembly: &'u mut [Assembly],
    /// Hierarchical Z buffers.
    pub traverse: &'u mut [Traverse],
    /// Depth units, by pipeline.
    pub depth: &'u mut [Depth],
    /// Colour units, by pipeline.
    pub color: &'u mut [Color],
    /// Texture units, pipeline by pipeline; as many to each.
    pub texture: &'u mut [Texture],
    /// Texture units of vertex cores; none where all cores shade vertices.
    pub vertex_texture: &'u mut [Texture],
    /// Constant caches, as many as texture units, or none.
    pub constant: &'u mut [Constant],
}

/// Functional warming of the segment in a slot, while nothing is in flight. `memory` gets what the caches would have asked of it.
pub fn apply(card: &mut Card, slot: u16, units: &mut WarmedUnits, memory: &mut Touching) {
    let Card { work, passes, frame, interleave, epoch, fault, .. } = card;
    let (Some(work), Some(pass)) = (&mut work[usize::from(slot)], passes.current()) else { return };
    for unit in &*units.deal {
        work.shared = unit.too_large(work);
    }
    let work = &*work;
    geometry(work, units, memory);
    vertices(&work.segment, *epoch, units, memory);
    let pipelines = units.color.len();
    let dealt: Vec<_> = units.deal.iter_mut().map(|unit| unit.visit(work)).collect();
    let mut noted = vec![false; units.traverse.len()];
    for (number, triangle) in (0..).zip(&work.segment.triangles) {
        for visit in work.visits(triangle) {
            let tile = &work.segment.tiles[visit.tile as usize];
            for block in &tile.blocks[visit.first_block as usize..][..visit.blocks as usize] {
                if interleave.is_balanced() {
                    interleave.note(u32::from(block.y), block.quads.into());
                }
                let pipeline = usize::from(interleave.owner(block.x.into(), block.y.into()));
                // A pipeline that draws pixels of other owners must see all draws.
                let screen = units.traverse[pipeline].territory() == Territory::Screen;
                let noting = if screen { 0..pipelines } else { pipeline..pipeline + 1 };
                for unit in noting.filter(|&unit| !std::mem::replace(&mut noted[unit], true)) {
                    units.traverse[unit].note(Some(pass), work, true);
                }
                let at = u32::from(block.y) * pass.blocks_across + u32::from(block.x);
                if units.traverse[pipeline].passes_by(work, triangle, block, at) {
                    continue;
                }
                // A pipeline that draws on the whole screen shades the primitives that were dealt to it.
                let to = dealt.first().filter(|_| screen).and_then(|dealt| dealt[triangle.primitive as usize]);
                let shades = to.unwrap_or(pipeline);
                let place =
                    TriangleBlock { work, pass, tile, index: visit.tile, triangle: number, block, at, pipeline, shades };
                if let Err(found) = place.draw(frame, *epoch, units, memory) {
                    fault.get_or_insert(found);
                    return;
                }
            }
        }
    }
    let primitives = work.segment.primitives.len();
    if let [assembly] = units.assembly {
        assembly.visit(primitives);
    }
}

/// Touches the memory that geometry reads of a segment: indices, and the lines of its vertices' attributes, each once where neighbours share it.
/// Which front reads what depends on its primitives: here each reads all.
fn geometry(work: &Work, units: &WarmedUnits, memory: &mut Touching) {
    let segment = &work.segment;
    let mut read = |ports: &[u16], line: u64| {
        let touch = |&port: &u16| Touch { port, address: line * LINE, bytes: LINE as u32, write: false };
        memory.extend(ports.iter().map(touch));
    };
    let (routing, fetching) = (units.route.iter().map(Route::ports), units.fetch.iter().map(Fetch::ports));
    // Those that route have read the indices.
    let indices: Vec<u16> = if units.route.is_empty() {
        fetching.clone().map(|[index, _]| index).collect()
    } else {
        routing.clone().map(|[index, _]| index).collect()
    };
    let attributes: Vec<u16> = routing.chain(fetching).map(|[_, vertex]| vertex).collect();
    if let Some(address) = segment.index_address {
        let bytes = segment.stream.len() as u64 * u64::from(segment.index_bytes);
        (address / LINE..(address + bytes).div_ceil(LINE)).for_each(|line| read(&indices, line));
    }
    for fetch in &work.draw.attributes {
        let mut last = None;
        for vertex in &segment.vertices {
            let element = match fetch.step {
                StepMode::Vertex => vertex.index,
                StepMode::Instance => vertex.instance,
            };
            let address = fetch.address + u64::from(element) * fetch.stride;
            for line in address / LINE..(address + u64::from(fetch.bytes)).div_ceil(LINE) {
                if last.replace(line) != Some(line) {
                    read(&attributes, line);
                }
            }
        }
    }
}

/// Invocations that run on one core before those behind them run on the next.
const BATCH: usize = 32;

/// Looks up what vertex shaders read. Which core gets which vertices is a matter of time: here cores take turns.
fn vertices(segment: &Segment, epoch: u32, units: &mut WarmedUnits, memory: &mut Touching) {
    let own = !units.vertex_texture.is_empty();
    let textures = if own { &mut *units.vertex_texture } else { &mut *units.texture };
    let invocations = &segment.invocations[Stage::Vertex];
    if invocations.requests.is_empty() || textures.is_empty() {
        return;
    }
    for (number, vertex) in segment.vertices.iter().enumerate() {
        let core = number / BATCH % textures.len();
        let constant = if own { None } else { units.constant.get_mut(core) };
        let mut core = (&mut textures[core], constant);
        for (step, found) in invocations.costs[vertex.cost].asking().zip(&invocations.requests[vertex.first_request as usize..])
        {
            ask(step.then, found, &invocations.lines, epoch, &mut core, memory);
        }
    }
}

/// Looks up the lines of a request in a core's texture unit and its constant cache, if it has one. Stores go to memory.
fn ask(
    kind: RequestKind,
    found: &Request,
    lines: &[u32],
    epoch: u32,
    (texture, constant): &mut (&mut Texture, Option<&mut Constant>),
    memory: &mut Touching,
) {
    let own = &lines[found.first_line as usize..][..usize::from(found.lines)];
    for (at, &line) in (0..).zip(own) {
        let halves = if kind == RequestKind::Load { found.halves(lines, at) } else { 3 };
        match (kind, &mut *constant) {
            (RequestKind::Constant, Some(unit)) => unit.visit(line, epoch, memory),
            (RequestKind::Texture | RequestKind::Load | RequestKind::Constant, _) => texture.visit(line, halves, epoch, memory),
            (RequestKind::Store | RequestKind::Atomic, _) => memory.push(texture.store(line, stored_bytes(found))),
            (RequestKind::End | RequestKind::Barrier | RequestKind::Shared, _) => {}
        }
    }
}

/// A block of a triangle.
struct TriangleBlock<'w> {
    work: &'w Work,
    pass: &'w PassState,
    tile: &'w TileWork,
    /// The tile's place in the segment.
    index: u32,
    /// The triangle's place in the segment.
    triangle: u32,
    block: &'w Block,
    /// The block's number on the surface.
    at: u32,
    /// The pipeline that owns it, and the one that shades it.
    pipeline: usize,
    shades: usize,
}

impl TriangleBlock<'_> {
    /// Tests and blends the block's quads, four at a time.
    fn draw(&self, frame: &mut FrameBuffers, epoch: u32, units: &mut WarmedUnits, memory: &mut Touching) -> Result<(), Fault> {
        let TriangleBlock { work, pass, .. } = self;
        let state = work.depth.as_ref().filter(|state| !state.is_idle());
        let tested = state.zip(pass.depth);
        let shaded = work.draw.shades();
        let (mut looked_up, mut alive) = (false, 0_u32);
        for first in (0..self.block.quads).step_by(4) {
            let mut group = self.group(first);
            let quads = &self.tile.quads[group.first as usize..][..usize::from(group.count)];
            let test = |frame: &mut FrameBuffers, group: &mut Group, late: bool| {
                if let Some((state, surface)) = tested {
                    test_group(state, work, group, pass, &mut frame.stores[surface], late);
                }
            };
            if work.early {
                test(frame, &mut group, false);
                looked_up = true;
            }
            for ((live, quad), n) in group.live.iter_mut().zip(quads).zip(0..) {
                if *live == 0 || !shaded {
                    continue;
                }
                if quad.flags & QUAD_SHADED == 0 {
                    let (x, y) = (self.block.x.into(), self.block.y.into());
                    return Err(Fault::Visibility { draw: work.draw.number, x, y });
                }
                self.fetch(group.first + n, epoch, units, memory);
                *live &= quad.kept;
            }
            if !work.early && group.live != [0; 4] {
                test(frame, &mut group, true);
                looked_up = true;
            }
            if group.live == [0; 4] || !shaded {
                continue;
            }
            alive += 1;
            for output in &work.outputs {
                blend_group(work, &group, output, frame);
            }
        }

        // The blocks that the caches hold.
        if let Some((state, surface)) = tested.filter(|_| looked_up) {
            let written = state.writes_depth() || state.writes_stencil();
            let told = units.depth[self.pipeline].visit(frame, (surface, self.at), written, pass.number, memory);
            for bounds in told {
                units.traverse[self.pipeline].learn(bounds);
            }
        }
        for output in work.outputs.iter().filter(|_| alive > 0) {
            units.color[self.pipeline].visit(frame, (output.surface, self.at), memory);
        }
        Ok(())
    }

    /// Up to four quads of the block.
    fn group(&self, first: u8) -> Group {
        let count = (self.block.quads - first).min(4);
        let from = self.block.first_quad + u32::from(first);
        let mut live = [0; 4];
        for (live, quad) in live.iter_mut().zip(&self.tile.quads[from as usize..][..usize::from(count)]) {
            *live = quad.coverage;
        }
        Group {
            slot: 0,
            count,
            triangle: self.triangle,
            tile: self.index,
            first: from,
            block: self.at,
            live,
            ahead: Ahead::Nothing,
        }
    }

    /// Looks up a quad's lines, request by request, in the texture unit of the pipeline that shades it. Where a pipeline has several
    /// cores, blocks take turns: which core gets which warp is a matter of time.
    fn fetch(&self, quad: u32, epoch: u32, units: &mut WarmedUnits, memory: &mut Touching) {
        let quad = &self.tile.quads[quad as usize];
        let each = units.texture.len() / units.color.len();
        let core = self.shades * each + self.at as usize % each.max(1);
        let Some(unit) = units.texture.get_mut(core) else { return };
        let mut core = (unit, units.constant.get_mut(core));
        let invocations = &self.tile.invocations;
        for (step, found) in invocations.costs[quad.cost].asking().zip(&invocations.requests[quad.first_request as usize..]) {
            ask(step.then, found, &invocations.lines, epoch, &mut core, memory);
        }
    }
}
