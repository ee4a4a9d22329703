//! The data that tokens point into: the work in flight, the frame buffer, and pools of items that are too large for a token.
//!
//! A unit reads what belongs to the card as a whole, and reads and writes what belongs to a token that it holds. Nothing here
//! carries information from one unit to another except behind a token; that would bring back the order of ticks.

mod fault;
mod funnels;
mod in_flight;
pub mod notes;
mod pass;
mod pool;
mod presented;
mod tiles;

pub use self::fault::Fault;
pub use self::funnels::Funnels;
pub use self::in_flight::{Ahead, ComputeWork, Group, Output, Work};
pub use self::pass::{DepthStart, PASSES, PassState, Passes};
pub use self::pool::Pool;
pub use self::presented::Presented;
pub use self::tiles::{KeptVertices, TileEntry, TileList};

use self::notes::Notes;
use std::collections::VecDeque;
use std::sync::Arc;

use super::class_state::ClassState;
use super::frame::{FrameBuffers, Store};
use super::interleave::Interleave;
use super::phase::Phases;
use super::stamps::{MAX_PRIMITIVES, Marks};
use super::warp::{Execution, Item, Warp, Warps};
use gfx::format::Format;
use gfx::rop::{ColorState, DepthStencilState};
use gfx::stage::Stage;
use gfx::state::ColorTarget;
use work::{Attachment, Cost, Draw, EndFrame, Event, Holdings, Invocations, Quad, Segment, TILE, Target};

/// Pipelines that a set of them, a 64-bit mask, can name.
pub const MAX_PIPELINES: usize = 64;

/// Whether an epoch began after another epoch. Work of two passes in flight reaches a cache in any order: the later epoch decides.
#[inline(always)]
pub fn is_newer(epoch: u32, than: u32) -> bool {
    epoch.wrapping_sub(than) as i32 > 0
}

/// All that tokens point into.
#[derive(Clone)]
pub struct Card {
    /// Segments in flight, by slot.
    pub work: Vec<Option<Work>>,
    /// Groups of workgroups in flight, by slot.
    pub compute: Vec<Option<ComputeWork>>,
    /// Groups of quads in flight, by pipeline.
    pub groups: Vec<Pool<Group>>,
    /// Warps, by cluster of cores.
    pub warps: Vec<Warps>,
    /// The passes in flight.
    pub passes: Passes,
    /// The machine's own surfaces.
    pub frame: FrameBuffers,
    /// The images that these surfaces hold, as far as follows from the events.
    pub holdings: Holdings,
    /// The state that the machine's sort class adds.
    pub class_state: ClassState,
    /// Which pipeline owns which pixels.
    pub interleave: Interleave,
    /// The lists of tiles, by number, on a machine that bins.
    pub bins: Vec<TileList>,
    /// The vertices that these share.
    pub kept: KeptVertices,
    /// The phases that the command processor has begun in this frame.
    pub phases: Phases,
    /// The numbers of items that each stage of this machine threw away.
    pub funnel: Funnels,
    /// Events that the command processor has not read yet; never empty before the last.
    pub events: VecDeque<Event>,
    /// Whether there are no more events than these.
    pub closed: bool,
    /// Counts up whenever what caches of read-only data hold may be stale for what begins from then on.
    pub epoch: u32,
    /// Segments installed so far.
    pub segments: u32,
    /// Frames on their way to a free-running display, each behind a token.
    pub presented: VecDeque<Presented>,
    /// Passes whose result may depend on an order that pipelines with copies do not keep: number and label.
    pub disordered: Vec<(u32, String)>,
    /// Why the run must stop.
    pub fault: Option<Fault>,
    /// Notes on blocks, if a user asks for maps.
    pub notes: Option<Box<Notes>>,
}

impl Card {
    /// A card with nothing in flight, for `pipelines` pipelines, `segments` segments and `runs` runs of workgroups. `execution` says how cores
    /// execute warps.
    pub fn new(
        pipelines: usize,
        segments: usize,
        runs: usize,
        interleave: Interleave,
        execution: Execution,
        class_state: ClassState,
    ) -> Card {
        Card {
            work: vec![None; segments],
            compute: vec![None; runs],
            groups: vec![Pool::default(); pipelines],
            // One cluster per pipeline, and one for vertex cores.
            warps: vec![Warps::new(execution); pipelines + 1],
            passes: Passes::default(),
            frame: FrameBuffers::default(),
            holdings: Holdings::default(),
            class_state,
            interleave,
            bins: Vec::new(),
            kept: KeptVertices::default(),
            phases: Phases::default(),
            funnel: Funnels::new(segments),
            events: VecDeque::new(),
            closed: false,
            epoch: 0,
            segments: 0,
            presented: VecDeque::new(),
            disordered: Vec::new(),
            fault: None,
            notes: None,
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

    /// The pass of the segment in a slot.
    #[inline(always)]
    pub fn pass_of(&self, slot: u16) -> Option<&PassState> {
        self.passes.get(self.work(slot).pass)
    }

    /// The epoch in which the work of a slot began: what caches of read-only data hold of earlier ones is stale for it.
    #[inline(always)]
    pub fn epoch_of(&self, stage: Stage, slot: u16) -> u32 {
        match stage {
            Stage::Compute => self.compute(slot).epoch,
            Stage::Vertex | Stage::Fragment => self.work(slot).epoch,
        }
    }

    /// The workgroups in a slot.
    ///
    /// # Panics
    /// If there are none: a token outlived its workgroups, which is a bug.
    #[inline(always)]
    pub fn compute(&self, slot: u16) -> &ComputeWork {
        self.compute[usize::from(slot)].as_ref().expect("a token's workgroups are in flight")
    }

    /// The invocations that an item of a warp is one of.
    #[inline(always)]
    pub fn invocations(&self, warp: &Warp, item: &Item) -> &Invocations {
        match warp.stage {
            Stage::Vertex => &self.work(warp.slot).segment.invocations[warp.stage],
            Stage::Fragment => &self.work(warp.slot).segment.tiles[item.source as usize].invocations,
            Stage::Compute => &self.compute(warp.slot).groups.invocations,
        }
    }

    /// The cost of an item of a warp.
    #[inline(always)]
    pub fn cost(&self, warp: &Warp, item: &Item) -> &Cost {
        &self.invocations(warp, item).costs[item.cost]
    }

    /// Puts a segment into a slot.
    pub fn install(&mut self, slot: u16, segment: Arc<Segment>, draw: Arc<Draw>, draw_number: u32) {
        if self.class_state.same_tiles && draw.signature.is_none() {
            // It may write more than its attachments.
            let of_tiles = segment.tiles.iter().map(|tile| &tile.invocations);
            let all = segment.invocations.values().chain(of_tiles);
            self.frame.forget_lines(all.flat_map(|invocations| &invocations.lines));
        }
        let owners = if self.interleave.tile() >= TILE {
            let owner = |x: u16, y: u16| self.interleave.owner(u32::from(x) * 8, u32::from(y) * 8);
            segment.tiles.iter().map(|tile| owner(tile.x, tile.y)).collect()
        } else {
            Vec::new()
        };
        let early = draw.early || !draw.shades();
        let (depth, depth_format) = match &draw.depth_stencil {
            Some(state) => {
                (Some(DepthStencilState::new(state, draw.stencil_references.map(u32::from), draw.depth_range)), state.format)
            }
            None => (None, Format::Stencil8),
        };
        let ahead = match (self.passes.current_mut(), &depth) {
            (Some(pass), Some(state)) => pass.ahead(early, state),
            _ => None,
        };
        let attachments = self.passes.current().map_or(&[][..], |pass| &pass.pass.color);
        let color = |(target, attachment): (&Option<Target>, &Option<Attachment>)| {
            let (target, attachment) = (target.as_ref()?, attachment.as_ref()?);
            let &Target { blend, logic, write_mask, .. } = target;
            let state = ColorTarget { format: attachment.surface.format, blend, logic, write_mask };
            Some(ColorState::new(&state, draw.blend_constant))
        };
        let colors: Vec<_> = draw.targets.iter().zip(attachments).map(color).collect();
        let surfaces = self.passes.current().map_or(&[][..], |pass| &pass.color);
        let outputs = colors.iter().zip(&draw.targets).zip(surfaces);
        let outputs = outputs.filter_map(|((state, target), surface)| Output::new(state.as_ref(), target.as_ref(), *surface));
        let outputs = outputs.collect();
        let marks = if self.class_state.copies.is_empty() {
            Marks::default()
        } else {
            self.note(&segment, &draw, depth.as_ref(), &colors)
        };
        let number = self.segments;
        self.segments = number.wrapping_add(1);
        self.work[usize::from(slot)] = Some(Work {
            segment,
            draw,
            early,
            draw_number,
            number,
            pass: self.passes.last().unwrap_or(0),
            epoch: self.epoch,
            order_from: None,
            owners,
            shared: Vec::new(),
            depth,
            depth_format,
            ahead,
            colors,
            outputs,
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
        let Some(pass) = self.passes.current_mut() else { return Marks::default() };
        pass.order.unnumbered = self.class_state.unnumbered;
        let marks = pass.order.note(draw, depth, colors);
        // Depths of fragments that are discarded after an early test stay, without their colours.
        let discards = |quad: &Quad| quad.kept & quad.coverage != quad.coverage;
        let early = draw.early && draw.shades() && depth.is_some_and(DepthStencilState::writes_depth);
        pass.order.matters |= early && segment.tiles.iter().any(|tile| tile.quads.iter().any(discards));
        let first = pass.order.primitives;
        pass.order.primitives = first.saturating_add(segment.primitives.len() as u32);
        if pass.order.primitives >= MAX_PRIMITIVES {
            self.stop(Fault::Primitives { most: MAX_PRIMITIVES });
        }
        Marks { first, over: marks.over && self.class_state.chunks, ..marks }
    }

    /// The store whose texels are the picture of a frame. None where the last writer was no draw: the frame brings its picture.
    pub fn drawn_picture(&self, end: &EndFrame) -> Option<&Store> {
        let shown = end.shown.filter(|_| end.drawn)?;
        self.frame.find(shown.key).map(|index| &self.frame.stores[index])
    }

    /// Stops the run; the first fault stands.
    #[cold]
    pub fn stop(&mut self, fault: Fault) {
        self.fault.get_or_insert(fault);
    }
}
