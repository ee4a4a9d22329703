//! Profiles: how much work of which kind a frame is, phase by phase and draw by draw, without the work itself.
//!
//! A profile depends on the work alone, on no machine. It is made once, in one walk over the events, and is what estimates are
//! computed from (`run::bound`) and by which frames are told to be alike (`run::sample`).

mod caches;

use std::collections::HashSet;

pub use caches::{BLOCK_CACHES, LINE_CACHES};
use caches::{Caches, FOLLOWED, shaded_vertices};

use super::{
    Class, Cost, Dispatch, Draw, Event, Groups, LINE, Load, Pass, QUAD_SHADED, Request, RequestKind, Segment, TILE, TileWork,
    Transfer, Triangle, Visit,
};

/// Sizes of first-in-first-out vertex caches for which a profile knows how many vertices are shaded.
pub const REUSE: [usize; 6] = [0, 8, 16, 32, 64, 128];

/// What shader invocations cost, summed up: an entry a vertex, a quad, or four invocations of a workgroup.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct ShaderProfile {
    /// Vertices, quads or packets.
    pub runs: u64,
    /// Instructions by class, summed over the runs.
    pub instructions: [u64; Class::COUNT],
    /// Texture requests.
    pub textures: u64,
    /// Their filter operations,
    pub operations: u64,
    /// and lines looked up.
    pub texture_lines: u64,
    /// Loads, stores and atomics.
    pub accesses: u64,
    /// Their lines.
    pub access_lines: u64,
}

impl ShaderProfile {
    fn add(&mut self, cost: &Cost, requests: &[Request]) {
        self.runs += 1;
        for (sum, n) in self.instructions.iter_mut().zip(cost.instructions()) {
            *sum += u64::from(n);
        }
        let asking = cost.steps.iter().filter(|step| step.then.has_request());
        for (step, request) in asking.zip(requests) {
            if step.then == RequestKind::Texture {
                self.textures += 1;
                self.operations += u64::from(request.operations);
                self.texture_lines += u64::from(request.lines);
            } else {
                self.accesses += 1;
                self.access_lines += u64::from(request.lines);
            }
        }
    }

    /// All requests to memory.
    pub fn requests(&self) -> u64 {
        self.textures + self.accesses
    }
}

/// A draw, or a part of it.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct DrawProfile {
    /// Number in the trace.
    pub number: u32,
    /// Segments.
    pub segments: u64,
    /// Indices read, or vertices of a draw without.
    pub indices: u64,
    /// Bytes of an index; 0 without.
    pub index_bytes: u64,
    /// Lines of attributes that a vertex touches, in 64ths (bytes of stride, or of the attribute where the stride is longer).
    pub vertex_bytes: u64,
    /// Attributes of a vertex.
    pub attributes: u64,
    /// Vertices shaded behind a cache of as many as [`REUSE`] says.
    pub shaded_vertices: [u64; REUSE.len()],
    /// Cost of the distinct vertices.
    pub vertex: ShaderProfile,
    /// Registers of a vertex, and of a fragment.
    pub registers: [u32; 2],
    /// Words that a fragment's varyings have.
    pub varyings: u64,
    /// Primitives,
    pub primitives: u64,
    /// of these clipped,
    pub clipped: u64,
    /// and triangles that cover samples.
    pub triangles: u64,
    /// Screen tiles of these triangles, summed up.
    pub visits: u64,
    /// Quads covered.
    pub quads: u64,
    /// Cost of the quads shaded.
    pub fragment: ShaderProfile,
    /// Depth or stencil is in use.
    pub depth: bool,
    /// Tests come before shading.
    pub early: bool,
    /// Colour targets written,
    pub targets: u64,
    /// and of these those that are blended.
    pub blended: u64,
}

/// A window of a draw ends after so many drawn triangles, primitives, or groups of quads.
const WINDOW: [u32; 3] = [32, 128, 256];

/// Consecutive primitives of a draw.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Window {
    /// The draw, among those of the pass.
    pub draw: u32,
    /// Primitives.
    pub primitives: u32,
    /// The end of its cells among those of the pass; they begin where those of the window before end.
    pub end: u32,
}

/// What a window has to do in a screen tile of 64 x 64 pixels.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Cell {
    /// Column and row of the tile.
    pub tile: [u16; 2],
    /// Triangles that cover part of it.
    pub triangles: u32,
    /// Blocks in the bounds of these triangles.
    pub tested: u32,
    /// Blocks covered in part.
    pub blocks: u32,
    /// Groups of up to four quads of a block.
    pub groups: u32,
    /// Quads shaded.
    pub shaded: u32,
}

/// An attachment of a pass.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct AttachmentProfile {
    /// Bytes of a block of 8 x 8 pixels, all samples.
    pub block_bytes: u64,
    /// It is read from memory, not cleared.
    pub loads: bool,
    /// Bytes resolved to another surface; 0 where none.
    pub resolved: u64,
}

/// What a phase is about.
#[derive(Clone, Debug, PartialEq)]
pub enum PhaseProfile {
    /// A render pass.
    Pass {
        /// Number in the trace.
        number: u32,
        /// Label.
        label: String,
        /// Size in pixels.
        size: [u32; 2],
        /// Its draws, in order.
        draws: Vec<DrawProfile>,
        /// Runs of their primitives, in order,
        windows: Vec<Window>,
        /// and what these have to do where.
        cells: Vec<Cell>,
        /// Colour attachments.
        color: Vec<AttachmentProfile>,
        /// Depth attachment.
        depth: Option<AttachmentProfile>,
        /// Distinct blocks of 8 x 8 pixels with covered samples, and with shaded quads,
        blocks: [u64; 2],
        /// misses of these behind caches as large as [`BLOCK_CACHES`] says,
        block_misses: [[u64; BLOCK_CACHES.len()]; 2],
        /// distinct lines of textures and buffers,
        lines: u64,
        /// and misses of these behind caches as large as [`LINE_CACHES`] says, vertices left out.
        line_misses: [u64; LINE_CACHES.len()],
    },
    /// A compute dispatch.
    Dispatch {
        /// Number in the trace.
        number: u32,
        /// Label.
        label: String,
        /// Cost of its packets of four invocations.
        cost: ShaderProfile,
        /// Registers of an invocation.
        registers: u32,
        /// Distinct lines.
        lines: u64,
        /// Runs of workgroups.
        runs: u64,
    },
    /// Uploads, copies, clears.
    Transfers {
        /// Bytes read from the card's memory by each.
        transfers: Vec<[u64; 2]>,
    },
    /// The picture is read.
    ScanOut {
        /// Bytes.
        bytes: u64,
    },
}

impl PhaseProfile {
    /// Quads covered.
    pub fn quads(&self) -> u64 {
        match self {
            PhaseProfile::Pass { draws, .. } => draws.iter().map(|draw| draw.quads).sum(),
            _ => 0,
        }
    }
}

/// A frame's phases.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct FrameProfile {
    /// The trace's own number.
    pub number: u32,
    /// Phases in order.
    pub phases: Vec<PhaseProfile>,
}

/// Makes profiles of a stream of events.
#[derive(Debug, Default)]
pub struct Profiler {
    frame: FrameProfile,
    pass: Option<OpenPass>,
    dispatch: Option<OpenDispatch>,
}

#[derive(Debug)]
struct OpenPass {
    phase: PhaseProfile,
    /// When each block was put in the caches, those of covered blocks and those of shaded ones.
    caches: Caches,
    lines: HashSet<u32>,
    /// The draw's state, for its segments.
    state: Option<std::sync::Arc<Draw>>,
}

#[derive(Debug)]
struct OpenDispatch {
    number: u32,
    label: String,
    registers: u32,
    cost: ShaderProfile,
    lines: HashSet<u32>,
    runs: u64,
}

impl Profiler {
    /// Takes an event; gives the frame that it ends.
    pub fn event(&mut self, event: &Event) -> Option<FrameProfile> {
        if !matches!(event, Event::Groups(_)) {
            self.end_dispatch();
        }
        match event {
            Event::Contents(_) => {}
            Event::BeginPass(pass) => self.pass = Some(OpenPass::new(pass)),
            Event::Draw(draw) => {
                if let Some(pass) = &mut self.pass {
                    pass.draw(draw);
                }
            }
            Event::Segment(segment) => {
                if let Some(pass) = &mut self.pass {
                    pass.segment(segment);
                }
            }
            Event::EndPass => {
                if let Some(pass) = self.pass.take() {
                    self.frame.phases.push(pass.end());
                }
            }
            Event::Dispatch(dispatch) => self.dispatch = Some(OpenDispatch::new(dispatch)),
            Event::Groups(groups) => {
                if let Some(dispatch) = &mut self.dispatch {
                    dispatch.groups(groups);
                }
            }
            Event::Transfer(transfer) => self.transfer(transfer),
            Event::EndFrame(end) => {
                if let Some(shown) = &end.shown {
                    let texel = u64::from(shown.format.block_bytes()) * u64::from(shown.samples);
                    let bytes = u64::from(shown.width) * u64::from(shown.height) * texel;
                    self.frame.phases.push(PhaseProfile::ScanOut { bytes });
                }
                self.frame.number = end.number;
                return Some(std::mem::take(&mut self.frame));
            }
        }
        None
    }

    fn end_dispatch(&mut self) {
        if let Some(OpenDispatch { number, label, registers, cost, lines, runs }) = self.dispatch.take() {
            let lines = lines.len() as u64;
            self.frame.phases.push(PhaseProfile::Dispatch { number, label, cost, registers, lines, runs });
        }
    }

    fn transfer(&mut self, transfer: &Transfer) {
        let moved = [transfer.from, transfer.to].map(|end| if end.is_some() { transfer.bytes } else { 0 });
        match self.frame.phases.last_mut() {
            Some(PhaseProfile::Transfers { transfers }) => transfers.push(moved),
            _ => self.frame.phases.push(PhaseProfile::Transfers { transfers: vec![moved] }),
        }
    }
}

impl OpenDispatch {
    fn new(dispatch: &Dispatch) -> OpenDispatch {
        let (number, label, registers) = (dispatch.number, dispatch.label.clone(), dispatch.shape.registers);
        OpenDispatch { number, label, registers, cost: ShaderProfile::default(), lines: HashSet::new(), runs: 0 }
    }

    fn groups(&mut self, groups: &Groups) {
        self.runs += 1;
        for packet in &groups.packets {
            self.cost.add(&groups.costs[packet.cost], &groups.requests[packet.first_request as usize..]);
        }
        self.lines.extend(&groups.lines);
    }
}

impl OpenPass {
    fn new(pass: &Pass) -> OpenPass {
        let profile = |attachment: &super::Attachment, clears: bool| {
            let bytes = |surface: &super::Surface| u64::from(surface.format.block_bytes()) * u64::from(surface.samples);
            let resolved = |to: &super::Surface| u64::from(to.width) * u64::from(to.height) * bytes(to);
            AttachmentProfile {
                block_bytes: 64 * bytes(&attachment.surface),
                loads: !clears,
                resolved: attachment.resolve.as_ref().map_or(0, resolved),
            }
        };
        let clears = |load: Load| matches!(load, Load::Clear(_));
        let depth = pass.depth.as_ref().map(|a| {
            let format = a.surface.format;
            let whole = (clears(a.load) || !format.has_depth()) && (clears(a.stencil_load) || !format.has_stencil());
            profile(a, whole)
        });
        OpenPass {
            phase: PhaseProfile::Pass {
                number: pass.number,
                label: pass.label.clone(),
                size: [pass.width, pass.height],
                draws: Vec::new(),
                windows: Vec::new(),
                cells: Vec::new(),
                color: pass.color.iter().flatten().map(|a| profile(a, clears(a.load))).collect(),
                depth,
                blocks: [0; 2],
                block_misses: [[0; BLOCK_CACHES.len()]; 2],
                lines: 0,
                line_misses: [0; LINE_CACHES.len()],
            },
            caches: Caches::new(pass),
            lines: HashSet::new(),
            state: None,
        }
    }

    fn draw(&mut self, draw: &std::sync::Arc<Draw>) {
        self.state = Some(draw.clone());
        let PhaseProfile::Pass { draws, .. } = &mut self.phase else { return };
        let written = || draw.targets.iter().flatten().filter(|target| target.write_mask != 0);
        let line = |a: &super::AttributeFetch| if a.stride == 0 { 0 } else { a.stride.min(LINE).max(u64::from(a.bytes)) };
        // Attributes that lie between each other are one stream of lines.
        let mut streams: Vec<(u64, u64)> = Vec::new();
        for attribute in draw.attributes.iter().filter(|a| a.stride > 0) {
            let same = |&&(at, stride): &&(u64, u64)| stride == attribute.stride && at.abs_diff(attribute.address) < stride;
            if streams.iter().find(same).is_none() {
                streams.push((attribute.address, attribute.stride));
            }
        }
        draws.push(DrawProfile {
            number: draw.number,
            attributes: draw.attributes.len() as u64,
            vertex_bytes: streams.iter().map(|&(_, stride)| stride).sum::<u64>().min(draw.attributes.iter().map(line).sum()),
            registers: [draw.vertex.registers, draw.fragment.map_or(0, |shape| shape.registers)],
            varyings: draw.fragment.map_or(0, |shape| u64::from(shape.inputs)),
            depth: draw.depth_stencil.is_some(),
            early: draw.early,
            targets: written().count() as u64,
            blended: written().filter(|target| target.blend.is_some()).count() as u64,
            ..DrawProfile::default()
        });
    }

    fn segment(&mut self, segment: &Segment) {
        let PhaseProfile::Pass { draws, windows, cells, .. } = &mut self.phase else { return };
        let number = draws.len().saturating_sub(1) as u32;
        let Some(draw) = draws.last_mut() else { return };
        draw.segments += 1;
        draw.indices += segment.stream.len() as u64;
        draw.index_bytes = segment.index_address.map_or(0, |_| u64::from(segment.index_bytes));
        for (shaded, size) in draw.shaded_vertices.iter_mut().zip(REUSE) {
            *shaded += shaded_vertices(segment, size);
        }
        for vertex in &segment.vertices {
            draw.vertex.add(&segment.costs[vertex.cost], &segment.requests[vertex.first_request as usize..]);
        }
        self.lines.extend(&segment.lines);
        draw.primitives += segment.primitives.len() as u64;
        draw.clipped += segment.primitives.iter().filter(|primitive| primitive.clipped).count() as u64;

        let mut open = Window { draw: number, primitives: 0, end: cells.len() as u32 };
        let (mut first, mut drawn, mut groups) = (cells.len(), 0, 0);
        for primitive in &segment.primitives {
            open.primitives += 1;
            let triangles = &segment.triangles[primitive.first_triangle as usize..][..usize::from(primitive.triangles)];
            for triangle in triangles.iter().filter(|triangle| triangle.visits > 0) {
                drawn += 1;
                draw.triangles += 1;
                draw.visits += u64::from(triangle.visits);
                for visit in &segment.visits[triangle.first_visit as usize..][..triangle.visits as usize] {
                    let tile = &segment.tiles[visit.tile as usize];
                    let at = match cells[first..].iter().position(|cell| cell.tile == [tile.x, tile.y]) {
                        Some(at) => first + at,
                        None => {
                            cells.push(Cell { tile: [tile.x, tile.y], ..Cell::default() });
                            cells.len() - 1
                        }
                    };
                    groups += cells[at].add(triangle, tile, visit, &mut self.caches, draw);
                }
            }
            if drawn >= WINDOW[0] || open.primitives >= WINDOW[1] || groups >= WINDOW[2] {
                open.end = cells.len() as u32;
                windows.push(open);
                (first, drawn, groups, open.primitives) = (cells.len(), 0, 0, 0);
            }
        }
        if open.primitives > 0 {
            windows.push(Window { end: cells.len() as u32, ..open });
        }
    }

    fn end(self) -> PhaseProfile {
        let mut phase = self.phase;
        if let PhaseProfile::Pass { blocks, block_misses, lines, line_misses, .. } = &mut phase {
            for (at, caches) in self.caches.blocks.iter().enumerate() {
                (blocks[at], block_misses[at]) = (caches.distinct, caches.misses);
            }
            *lines = self.lines.len() as u64 + self.caches.lines.put.len() as u64 * FOLLOWED;
            *line_misses = self.caches.lines.misses.map(|misses| misses * FOLLOWED);
        }
        phase
    }
}

/// Blocks along the edge of a screen tile.
const EDGE: u16 = (TILE / super::BLOCK) as u16;

impl Cell {
    /// Adds the blocks of a triangle, and what their quads cost to their draw; its groups of quads.
    fn add(&mut self, triangle: &Triangle, tile: &TileWork, visit: &Visit, caches: &mut Caches, draw: &mut DrawProfile) -> u32 {
        let before = self.groups;
        let [x0, y0, x1, y1] = triangle.bounds;
        let span = |a: u16, b: u16, at: u16| u32::from(b.min((at + 1) * EDGE).saturating_sub(a.max(at * EDGE)));
        self.triangles += 1;
        self.tested += span(x0, x1, tile.x) * span(y0, y1, tile.y);
        for block in &tile.blocks[visit.first_block as usize..][..visit.blocks as usize] {
            let quads = &tile.quads[block.first_quad as usize..][..usize::from(block.quads)];
            self.blocks += 1;
            self.groups += u32::from(block.quads).div_ceil(4);
            draw.quads += u64::from(block.quads);
            caches.blocks[0].touch(block.x, block.y);
            let before = self.shaded;
            for quad in quads.iter().filter(|quad| quad.flags & QUAD_SHADED != 0) {
                self.shaded += 1;
                let cost = &tile.costs[quad.cost];
                let requests = &tile.requests[quad.first_request as usize..][..cost.requests()];
                draw.fragment.add(cost, requests);
                for request in requests {
                    let lines = &tile.lines[request.first_line as usize..][..usize::from(request.lines)];
                    lines.iter().for_each(|&line| caches.lines.touch(line));
                }
            }
            if self.shaded > before {
                caches.blocks[1].touch(block.x, block.y);
            }
        }
        self.groups - before
    }
}
