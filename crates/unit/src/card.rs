//! What tokens point into: the work in flight, the frame buffer, and the pools of what is too large for a token.
//!
//! A unit reads what belongs to the card as a whole, and reads and writes what belongs to a token that it holds. Nothing here
//! carries information from one unit to another except behind a token; that would bring back the order of ticks.

use std::collections::VecDeque;
use std::sync::Arc;

use super::copies::{self, Apart, Marks, PassOrder};
use super::frame::Frame;
use super::interleave::Interleave;
use super::phase::Phases;
use super::same;
use super::warp::{Execution, Warps};
use gfx::format::Format;
use gfx::hierarchical::may_raise_lower;
use gfx::rop::{ColorState, DepthStencilState};
use gfx::state::ColorTarget;
use work::{Attachment, Dispatch, Draw, Event, Funnel, Groups, Pass, Quad, Segment, Signature, TILE, Target, Triangle, Visit};

/// Pipelines that a set of them, a 64-bit mask, can name.
pub const MAX_PIPELINES: usize = 64;

/// A draw's segment in flight.
#[derive(Clone, Debug)]
pub struct Work {
    /// The segment.
    pub segment: Arc<Segment>,
    /// Its draw.
    pub draw: Arc<Draw>,
    /// Fragments of this draw are tested before shading.
    pub early: bool,
    /// Number of the draw on this machine, from 0: segments of one draw share it.
    pub draw_number: u32,
    /// Number of the segment on this machine, from 0.
    pub number: u32,
    /// Where quads may reach the ROP out of order: all sequence numbers before this one must have ended. None: each quad waits for all
    /// before its own.
    pub order_from: Option<u32>,
    /// For each of the segment's tiles its owner; empty where a tile has several.
    pub owners: Vec<u8>,
    /// Depth and stencil tests, if the draw has any.
    pub depth: Option<DepthStencilState>,
    /// Format of the stored depths; that of no depth where there are none.
    pub depth_format: Format,
    /// The depth test that its quads may have ahead of that at the ROP, if there is one that is safe.
    pub ahead: Option<DepthStencilState>,
    /// For each colour target of the draw how it is written.
    pub colors: Vec<Option<ColorState>>,
    /// What its quads leave in the stamps of a copy, where pipelines have copies.
    pub marks: Marks,
}

impl Work {
    /// The visits of a triangle.
    #[inline(always)]
    pub fn visits(&self, triangle: &Triangle) -> &[Visit] {
        &self.segment.visits[triangle.first_visit as usize..][..triangle.visits as usize]
    }
}

/// What is known of a block's test before it is made.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Ahead {
    /// Nothing.
    #[default]
    Nothing,
    /// All samples pass, and none is written.
    Passes,
    /// All samples pass and are written: what was there before need not be known.
    Writes,
}

/// Up to four quads of one block of one triangle, on their way through a pipeline.
#[derive(Clone, Copy, Debug, Default)]
pub struct Group {
    /// Slot of the segment.
    pub slot: u16,
    /// Number of quads.
    pub count: u8,
    /// The triangle in its segment.
    pub triangle: u32,
    /// The tile in the segment's tiles.
    pub tile: u32,
    /// The first quad in the tile's quads.
    pub first: u32,
    /// The block on the surface, numbered row by row.
    pub block: u32,
    /// For each quad the samples still alive.
    pub live: [u16; 4],
    /// What hierarchical Z knows of the early test.
    pub ahead: Ahead,
}

/// Things with an index, allocated and freed all the time.
#[derive(Clone, Debug)]
pub struct Pool<T> {
    items: Vec<T>,
    free: Vec<u32>,
}

impl<T: Copy + Default> Default for Pool<T> {
    fn default() -> Pool<T> {
        Pool { items: Vec::new(), free: Vec::new() }
    }
}

impl<T: Copy + Default> Pool<T> {
    /// Takes in an item. Grows only until as many are in flight as ever will be.
    #[inline(always)]
    pub fn insert(&mut self, item: T) -> u32 {
        match self.free.pop() {
            Some(index) => {
                self.items[index as usize] = item;
                index
            }
            None => {
                self.items.push(item);
                (self.items.len() - 1) as u32
            }
        }
    }

    /// Gives an item up.
    #[inline(always)]
    pub fn remove(&mut self, index: u32) {
        self.free.push(index);
    }

    /// Items held.
    pub fn len(&self) -> usize {
        self.items.len() - self.free.len()
    }

    /// Whether none is held.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }
}

impl<T> std::ops::Index<u32> for Pool<T> {
    type Output = T;

    #[inline(always)]
    fn index(&self, index: u32) -> &T {
        &self.items[index as usize]
    }
}

impl<T> std::ops::IndexMut<u32> for Pool<T> {
    #[inline(always)]
    fn index_mut(&mut self, index: u32) -> &mut T {
        &mut self.items[index as usize]
    }
}

/// A triangle in a tile's list.
#[derive(Clone, Copy, Debug)]
pub struct TileEntry {
    /// Slot of its segment.
    pub slot: u16,
    /// Bytes of the entry in memory.
    pub bytes: u8,
    /// The triangle in its segment.
    pub triangle: u32,
    /// Where in memory the triangle is kept.
    pub address: u64,
}

/// The list of a tile. Binning writes it, and the pipeline that draws the tile reads it, from the tile's token on.
#[derive(Clone, Debug, Default)]
pub struct TileList {
    /// Its triangles in API order.
    pub entries: Vec<TileEntry>,
    /// Where its pieces are in memory.
    pub chunks: Vec<u64>,
    /// Bytes of its entries.
    pub bytes: u64,
    /// Bytes read of it and its triangles.
    pub read_bytes: u64,
}

impl TileList {
    /// Appends an entry.
    pub fn push(&mut self, entry: TileEntry) {
        self.bytes += u64::from(entry.bytes);
        self.entries.push(entry);
    }

    /// Empties it, and keeps its room.
    pub fn clear(&mut self) {
        self.entries.clear();
        self.chunks.clear();
        (self.bytes, self.read_bytes) = (0, 0);
    }
}

/// Something that the machine cannot do, or that the work got wrong; the run stops with it.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum Fault {
    /// The order of events is not one.
    #[error("event {event} of the work comes where it cannot: {what}")]
    Order {
        /// Number of the event, from 0.
        event: u64,
        /// What is wrong.
        what: &'static str,
    },
    /// A workgroup does not fit a core.
    #[error("dispatch {dispatch}: {what} asks for {asked}, and a core of this machine has {has} (configuration key {key})")]
    Resources {
        /// The dispatch.
        dispatch: u32,
        /// What is short.
        what: &'static str,
        /// How much a workgroup needs.
        asked: u64,
        /// How much there is.
        has: u64,
        /// The knob that says so.
        key: &'static str,
    },
    /// More primitives in a pass than pipelines with copies can number.
    #[error("a pass has {most} primitives or more, which pipelines with copies of their own cannot number")]
    Primitives {
        /// How many are too many.
        most: u32,
    },
    /// A segment is to be drawn at once where that cannot be.
    #[error("a segment is to be drawn at once, but machines of class {class} keep pixels of a pass elsewhere until it ends")]
    AtOnce {
        /// The sort class.
        class: &'static str,
    },
    /// A quad passed this machine's early tests but was not shaded in API order.
    #[error("draw {draw}: a quad in block ({x}, {y}) passed early depth and stencil tests here, but not in API order")]
    Visibility {
        /// The draw.
        draw: u32,
        /// Block column.
        x: u32,
        /// Block row.
        y: u32,
    },
}

/// How the depth attachment starts a pass.
#[derive(Clone, Copy, Debug)]
pub struct DepthStart {
    /// New bounds for all blocks, as ordered keys; none: those of the pass before still hold.
    pub bounds: Option<(u32, u32)>,
}

/// The pass that is being drawn, as pipelines need it.
#[derive(Clone, Debug)]
pub struct PassState {
    /// Number of the pass on this machine, from 0.
    pub number: u32,
    /// How the depth attachment starts, if there is one.
    pub depth_start: Option<DepthStart>,
    /// Blocks of the pass's area.
    pub blocks: usize,
    /// The pass.
    pub pass: Arc<Pass>,
    /// Index in the frame of each colour attachment.
    pub color: Vec<Option<usize>>,
    /// Index in the frame of the depth attachment.
    pub depth: Option<usize>,
    /// Blocks across the pass's area.
    pub blocks_across: u32,
    /// Primitives of the pass, where they are known before it is drawn.
    pub primitives: u64,
    /// Where pipelines have copies, of what kind its draws are.
    pub order: PassOrder,
    /// The pass's signature without its draws, where tiles are looked for that are in memory already and this pass's may be.
    pub signature: Option<Signature>,
    /// Whether a draw of it up to now may have raised depths, and lowered them.
    pub raised: bool,
    /// See `raised`.
    pub lowered: bool,
}

impl PassState {
    /// Notes which way a draw can move depths, and gives the test that its quads may have ahead, against a depth that was stored before
    /// by something that comes earlier in API order.
    fn ahead(&mut self, early: bool, depth: &DepthStencilState) -> Option<DepthStencilState> {
        if depth.writes_depth() {
            let (raises, lowers) = may_raise_lower(depth.compare());
            self.raised |= raises;
            self.lowered |= lowers;
        }
        // Where the shader comes first it may change depths and coverage; where stencil values are written, failures count.
        if !early || depth.writes_stencil() {
            return None;
        }
        let ahead = depth.ahead(!self.raised, !self.lowered)?;
        // Only the owner knows what the stencil test throws away, and thus which depths are written.
        Some(if depth.uses_stencil() { ahead.read_only() } else { ahead })
    }
}

/// A dispatch's workgroups in flight.
#[derive(Clone, Debug)]
pub struct ComputeWork {
    /// The dispatch.
    pub dispatch: Arc<Dispatch>,
    /// The groups.
    pub groups: Arc<Groups>,
}

/// All that tokens point into.
pub struct Card {
    /// Segments in flight, by slot.
    pub work: Vec<Option<Work>>,
    /// Groups of workgroups in flight, by slot.
    pub compute: Vec<Option<ComputeWork>>,
    /// Groups of quads in flight, by pipeline.
    pub groups: Vec<Pool<Group>>,
    /// Warps, by cluster of cores.
    pub warps: Vec<Warps>,
    /// The pass being drawn.
    pub pass: Option<PassState>,
    /// The machine's own surfaces.
    pub frame: Frame,
    /// What pipelines have for themselves, and what else the machine's sort class asks.
    pub apart: Apart,
    /// Which pipeline owns which pixels.
    pub interleave: Interleave,
    /// The lists of tiles, by number, on a machine that bins.
    pub bins: Vec<TileList>,
    /// What the command processor has begun in this frame.
    pub phases: Phases,
    /// What was thrown away where, on this machine.
    pub funnel: Funnel,
    /// Events that the command processor has not read yet; never empty before the last.
    pub events: VecDeque<Event>,
    /// Whether there are no more events than these.
    pub closed: bool,
    /// Changes whenever what caches of read-only data hold may be stale.
    pub epoch: u32,
    /// Segments installed so far.
    pub segments: u32,
    /// Why the run must stop.
    pub fault: Option<Fault>,
}

impl Card {
    /// A card with nothing in flight: for so many pipelines, segments and runs of workgroups, with cores that execute warps so.
    pub fn new(
        pipelines: usize,
        segments: usize,
        runs: usize,
        interleave: Interleave,
        execution: Execution,
        apart: Apart,
    ) -> Card {
        Card {
            work: vec![None; segments],
            compute: vec![None; runs],
            groups: vec![Pool::default(); pipelines],
            // One cluster a pipeline, and one for vertex cores.
            warps: vec![Warps::new(execution); pipelines + 1],
            pass: None,
            frame: Frame::default(),
            apart,
            interleave,
            bins: Vec::new(),
            phases: Phases::default(),
            funnel: Funnel::default(),
            events: VecDeque::new(),
            closed: false,
            epoch: 0,
            segments: 0,
            fault: None,
        }
    }

    /// The work in a slot.
    ///
    /// # Panics
    /// If there is none: a token outlived its segment, which is a bug.
    #[inline(always)]
    pub fn work(&self, slot: u16) -> &Work {
        self.work[usize::from(slot)].as_ref().expect("a token's segment is in flight")
    }

    /// The workgroups in a slot.
    ///
    /// # Panics
    /// If there are none: a token outlived its workgroups, which is a bug.
    #[inline(always)]
    pub fn compute(&self, slot: u16) -> &ComputeWork {
        self.compute[usize::from(slot)].as_ref().expect("a token's workgroups are in flight")
    }

    /// Puts a segment into a slot.
    pub fn install(&mut self, slot: u16, segment: Arc<Segment>, draw: Arc<Draw>, draw_number: u32) {
        if self.apart.same_tiles && draw.signature.is_none() {
            // It may write more than its attachments.
            same::touched(self, segment.lines.iter().chain(segment.tiles.iter().flat_map(|tile| &tile.lines)));
        }
        let owners = if self.interleave.tile() >= TILE {
            let owner = |x: u16, y: u16| self.interleave.owner(u32::from(x) * 8, u32::from(y) * 8);
            segment.tiles.iter().map(|tile| owner(tile.x, tile.y)).collect()
        } else {
            Vec::new()
        };
        let early = draw.early || draw.fragment.is_none();
        let (depth, depth_format) = match &draw.depth_stencil {
            Some(state) => {
                (Some(DepthStencilState::new(state, u32::from(draw.stencil_reference), draw.depth_range)), state.format)
            }
            None => (None, Format::Stencil8),
        };
        let ahead = match (&mut self.pass, &depth) {
            (Some(pass), Some(state)) => pass.ahead(early, state),
            _ => None,
        };
        let attachments = self.pass.as_ref().map_or(&[][..], |pass| &pass.pass.color);
        let color = |(target, attachment): (&Option<Target>, &Option<Attachment>)| {
            let (target, attachment) = (target.as_ref()?, attachment.as_ref()?);
            let state = ColorTarget { format: attachment.surface.format, blend: target.blend, write_mask: target.write_mask };
            Some(ColorState::new(&state, draw.blend_constant))
        };
        let colors: Vec<_> = draw.targets.iter().zip(attachments).map(color).collect();
        let marks =
            if self.apart.copies.is_empty() { Marks::default() } else { self.note(&segment, &draw, depth.as_ref(), &colors) };
        let number = self.segments;
        self.segments = number.wrapping_add(1);
        self.work[usize::from(slot)] = Some(Work {
            segment,
            draw,
            early,
            draw_number,
            number,
            order_from: None,
            owners,
            depth,
            depth_format,
            ahead,
            colors,
            marks,
        });
    }

    /// Notes a segment that is drawn in copies.
    #[cold]
    fn note(
        &mut self,
        segment: &Segment,
        draw: &Draw,
        depth: Option<&DepthStencilState>,
        colors: &[Option<ColorState>],
    ) -> Marks {
        let Some(pass) = &mut self.pass else { return Marks::default() };
        pass.order.unnumbered = self.apart.unnumbered;
        let marks = pass.order.note(draw, depth, colors);
        // Depths of fragments that are discarded after an early test stay, without their colours.
        let discards = |quad: &Quad| quad.kept & quad.coverage != quad.coverage;
        let early = draw.early && draw.fragment.is_some() && depth.is_some_and(DepthStencilState::writes_depth);
        pass.order.matters |= early && segment.tiles.iter().any(|tile| tile.quads.iter().any(discards));
        let first = self.apart.primitives;
        self.apart.primitives = first.saturating_add(segment.primitives.len() as u32);
        if self.apart.primitives >= copies::MAX_PRIMITIVES {
            self.stop(Fault::Primitives { most: copies::MAX_PRIMITIVES });
        }
        Marks { first, over: marks.over && self.apart.chunks, ..marks }
    }

    /// Stops the run; the first fault stands.
    #[cold]
    pub fn stop(&mut self, fault: Fault) {
        self.fault.get_or_insert(fault);
    }
}
