//! Profiles: how much work of which kind a frame is, phase by phase and draw by draw, without the work itself.
//!
//! A profile depends on the work alone, on no machine. It is made once, in one walk over the events. Estimates are computed from it
//! (`run::bound`), and sampling finds frames that are alike by it (`run::sample`).

mod apart;
mod caches;
mod lines;
mod pass;
mod shader;
mod touch;

pub use apart::{APART, ApartProfile, DEALT};
pub use caches::BLOCK_CACHES;
pub use lines::{FOLLOWED as LINES_FOLLOWED, GAPS, LineProfile, SPANS, gaps_of, span};
pub use shader::{PIECE, ShaderProfile, TOGETHER};
pub use touch::{BUNDLE, FIRST, Sampled, Touch, Toucher, WHOLE};

use pass::OpenPass;
use touch::Touches;

use std::collections::HashSet;

use gfx::codec::CODECS;
use gfx::format::TexelClass;
use gfx::stage::StageMap;

use super::{Dispatch, Event, Groups, Pass, Shade, Surface, Transfer};

/// Sizes of first-in-first-out vertex caches for which a profile knows how many vertices are shaded.
pub const REUSE: [usize; 6] = [0, 8, 16, 32, 64, 128];

/// Vertices, and indices, of a batch within which vertices are reused, for which a profile knows how many vertices are shaded: those of
/// NVIDIA's cards (Kerbl et al. 2018).
pub const BATCH: [usize; 2] = [32, 96];

/// A draw, or a part of it.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct DrawProfile {
    /// Number in its frame, from 0.
    pub number: u32,
    /// Number of its pipeline ([`Programs::pipeline`](super::Programs::pipeline)).
    pub pipeline: u64,
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
    /// Streams of attributes: those that lie between each other are one.
    pub streams: u64,
    /// Lines that a vertex touches in its streams, if it shares none with the vertex before, in 64ths.
    pub stream_lines: u64,
    /// Vertices shaded behind a cache of as many as [`REUSE`] says.
    pub shaded_vertices: [u64; REUSE.len()],
    /// Vertices shaded in batches of at most [`BATCH`] vertices and indices.
    pub batched_vertices: u64,
    /// Cost of the runs of each stage: those of the distinct vertices, and of the quads that are shaded.
    pub costs: StageMap<ShaderProfile>,
    /// Registers of an invocation of each stage.
    pub registers: StageMap<u32>,
    /// Words that a fragment's varyings have.
    pub varyings: u64,
    /// Primitives.
    pub primitives: u64,
    /// Primitives that are clipped.
    pub clipped: u64,
    /// Triangles that cover samples.
    pub triangles: u64,
    /// Screen tiles of these triangles, summed up.
    pub visits: u64,
    /// The same of tiles of [`BINS`] pixels, that triangles cover part of, and that their bounds touch.
    pub bins: [[u64; BINS.len()]; 2],
    /// Vertices shaded if each batch of [`DEALT`] primitives begins anew.
    pub dealt_vertices: u64,
    /// 32-bit words of a shaded quad's outputs.
    pub payload: u64,
    /// What pipelines that draw apart hide; nothing where the work has visible quads only.
    pub apart: ApartProfile,
    /// Quads covered.
    pub quads: u64,
    /// Whether depth or stencil is in use.
    pub depth: bool,
    /// Whether depth or stencil can be written.
    pub writes_depth: bool,
    /// Tests come before shading.
    pub early: bool,
    /// Colour targets that are written.
    pub targets: u64,
    /// Colour targets that are blended.
    pub blended: u64,
}

/// Edges of tiles in pixels for which a profile knows how many each triangle touches.
pub const BINS: [u32; 4] = [8, 16, 32, 64];

/// A window of a draw ends after this number of drawn triangles, of primitives, or of groups of quads.
const WINDOW: [u32; 3] = [32, 128, 256];

/// Consecutive primitives of a draw.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Window {
    /// The draw, among those of the pass.
    pub draw: u32,
    /// Primitives of the window.
    pub primitives: u32,
    /// Triangles of these primitives that cover samples.
    pub triangles: u32,
    /// Whether a segment begins with it.
    pub begins: bool,
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
    /// Blocks of which a part is covered.
    pub blocks: u32,
    /// Covered blocks that are not hidden whole.
    pub seen: u32,
    /// Groups of up to four quads in the blocks that are not hidden whole.
    pub groups: u32,
    /// Quads that are shaded.
    pub shaded: u32,
    /// Blocks with shaded quads.
    pub pins: u32,
}

/// An attachment of a pass.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct AttachmentProfile {
    /// Its first line in memory: address by [`LINE`](super::LINE).
    pub line: u32,
    /// Bytes of a block of 8 x 8 pixels, all samples.
    pub block_bytes: u64,
    /// It has several samples per pixel.
    pub multisampled: bool,
    /// The width class of its texels.
    pub texel: TexelClass,
    /// Samples of a pixel.
    pub samples: u32,
    /// It is read from memory, not cleared.
    pub loads: bool,
    /// It is wanted after the pass.
    pub stores: bool,
    /// Bytes resolved to another surface; 0 where none.
    pub resolved: u64,
    /// Memory lines that a block takes as the pass leaves it, by each codec ([`gfx::codec::lines`]): the mean of its blocks, each as often as it is
    /// touched. Raw where the work does not say.
    pub lines: [f32; CODECS],
}

/// What a phase is about.
#[derive(Clone, Debug, PartialEq)]
pub enum PhaseProfile {
    /// A render pass.
    Pass {
        /// Number in its frame, from 0.
        number: u32,
        /// Label.
        label: String,
        /// Size in pixels.
        size: [u32; 2],
        /// Its draws, in order.
        draws: Vec<DrawProfile>,
        /// Runs of the draws' primitives, in order.
        windows: Vec<Window>,
        /// The work of the windows in each screen tile.
        cells: Vec<Cell>,
        /// Colour attachments.
        color: Vec<AttachmentProfile>,
        /// Depth attachment.
        depth: Option<AttachmentProfile>,
        /// Distinct blocks of 8 x 8 pixels: those with covered samples that are not hidden whole, and those with shaded quads.
        blocks: [u64; 2],
        /// Misses of these blocks behind caches of the sizes of [`BLOCK_CACHES`].
        block_misses: [[u64; BLOCK_CACHES.len()]; 2],
        /// For some of these blocks: the copies that are drawn into, for each number of pipelines in [`APART`] that draw apart.
        copies: [u64; APART.len()],
        /// What its fragments look up.
        lines: Box<LineProfile>,
    },
    /// A compute dispatch.
    Dispatch {
        /// Number in its frame, from 0.
        number: u32,
        /// Label.
        label: String,
        /// Number of its pipeline ([`Programs::pipeline`](super::Programs::pipeline)).
        pipeline: u64,
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
        /// The memory line that it begins in.
        line: u32,
        /// Its height.
        lines: u32,
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
    /// What they touch in memory.
    pub sampled: Sampled,
}

/// Makes profiles of a stream of events.
#[derive(Debug, Default)]
pub struct Profiler {
    frame: FrameProfile,
    pass: Option<OpenPass>,
    dispatch: Option<OpenDispatch>,
    touches: Touches,
    /// Attachments of the pass that are resolved, and where to.
    resolves: Vec<(Surface, Surface)>,
    /// The work has all covered quads: what pipelines apart hide is not known yet.
    covered: bool,
    /// See [`Profiler::whole`].
    whole: bool,
}

#[derive(Debug)]
struct OpenDispatch {
    number: u32,
    label: String,
    pipeline: u64,
    registers: u32,
    cost: ShaderProfile,
    lines: HashSet<u32>,
    runs: u64,
}

impl Profiler {
    /// Makes profiles of work that has these quads.
    pub fn new(shade: Shade) -> Profiler {
        Profiler { covered: shade == Shade::Covered, ..Profiler::default() }
    }

    /// The same for machines whose pipelines share all geometry: [`DrawProfile::dealt_vertices`] is not counted.
    pub fn whole(self) -> Profiler {
        Profiler { whole: true, ..self }
    }

    /// Takes an event; gives the frame that it ends.
    pub fn event(&mut self, event: &Event) -> Option<FrameProfile> {
        if !matches!(event, Event::Groups(_)) {
            self.end_dispatch();
        }
        match event {
            Event::Contents(_) | Event::FramesFollow => {}
            Event::BeginPass(pass) => self.begin_pass(pass),
            Event::Draw(draw) => {
                if let Some(pass) = &mut self.pass {
                    pass.draw(draw);
                }
            }
            Event::Segment(segment) | Event::Applied(segment) => {
                if let Some(pass) = &mut self.pass {
                    pass.segment(segment, &mut self.touches);
                }
            }
            Event::EndPass(stored) => {
                if let Some(pass) = self.pass.take() {
                    let phase = pass.end(&mut self.touches, &self.resolves, stored.as_deref());
                    self.push(phase);
                }
            }
            Event::Dispatch(dispatch) => self.dispatch = Some(OpenDispatch::new(dispatch)),
            Event::Groups(groups) => {
                if let Some(dispatch) = &mut self.dispatch {
                    dispatch.groups(groups, &mut self.touches);
                }
            }
            Event::Transfer(transfer) => self.transfer(transfer),
            Event::EndFrame(end) => {
                if let Some(shown) = &end.shown {
                    let texel = u64::from(shown.format.block_bytes()) * u64::from(shown.samples);
                    let bytes = u64::from(shown.width) * u64::from(shown.height) * texel;
                    self.touches.run(shown.address, bytes, 64 * texel, Toucher::Read);
                    self.push(PhaseProfile::ScanOut { bytes, line: (shown.address / crate::LINE) as u32, lines: shown.height });
                }
                self.frame.number = end.number;
                self.frame.sampled = self.touches.end_frame();
                return Some(std::mem::take(&mut self.frame));
            }
        }
        None
    }

    fn push(&mut self, phase: PhaseProfile) {
        self.frame.phases.push(phase);
        self.touches.phase = self.frame.phases.len().min(usize::from(u16::MAX)) as u16;
    }

    fn begin_pass(&mut self, pass: &Pass) {
        let resolved = pass.color.iter().flatten().filter_map(|a| Some((a.surface, a.resolve?)));
        self.resolves = resolved.collect();
        self.pass = Some(OpenPass::new(pass, self.covered, self.whole));
    }

    fn end_dispatch(&mut self) {
        if let Some(OpenDispatch { number, label, pipeline, registers, cost, lines, runs }) = self.dispatch.take() {
            let lines = lines.len() as u64;
            self.push(PhaseProfile::Dispatch { number, label, pipeline, cost, registers, lines, runs });
        }
    }

    fn transfer(&mut self, transfer: &Transfer) {
        let moved = [transfer.from, transfer.to].map(|end| if end.is_some() { transfer.bytes } else { 0 });
        if let Some(PhaseProfile::Transfers { .. }) = self.frame.phases.last() {
            self.touches.phase = self.frame.phases.len() as u16 - 1;
        }
        for (end, by) in [(transfer.from, Toucher::Read), (transfer.to, Toucher::Write)] {
            if let Some(address) = end {
                self.touches.run(address, transfer.bytes, 1, by);
            }
        }
        match self.frame.phases.last_mut() {
            Some(PhaseProfile::Transfers { transfers }) => {
                transfers.push(moved);
                self.touches.phase += 1;
            }
            _ => self.push(PhaseProfile::Transfers { transfers: vec![moved] }),
        }
    }
}

impl OpenDispatch {
    fn new(dispatch: &Dispatch) -> OpenDispatch {
        let (number, label, pipeline) = (dispatch.number, dispatch.label.clone(), dispatch.programs.pipeline);
        let (registers, cost) = (dispatch.shape.registers, ShaderProfile::default());
        OpenDispatch { number, label, pipeline, registers, cost, lines: HashSet::new(), runs: 0 }
    }

    fn groups(&mut self, groups: &Groups, touches: &mut Touches) {
        self.runs += 1;
        // Which lines are written is not told apart: most of a dispatch's are read, written, or both, and once.
        for &line in &groups.invocations.lines {
            if touches.follows(line) {
                touches.push_once(Touch { line, by: Toucher::Store, ..Touch::default() });
            }
        }
        self.cost.add_groups(groups);
        self.lines.extend(&groups.invocations.lines);
    }
}
