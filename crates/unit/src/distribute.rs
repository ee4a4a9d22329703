//! Distribution: the sort of a sort-middle machine. Screen-space triangles go to every rasteriser that owns a tile they touch.

use super::card::{Card, Work};
use super::network::{Sender, SenderCounts};
use super::sorting::SortCounts;
use super::token::{Kind, NextDraw, Run, TriangleToken, bytes};
use knob::Allowed;
use num::{Cycle, prefetch};
use sim::{Budget, Counted, In, Tick, Unit, Wires};
use stats::Heading;
use work::{End, Triangle};

knob::choices! {
    /// How the rasterisers that a triangle is sent to are found.
    pub enum Overlap {
        /// Those that own a tile in which it covers samples.
        Exact "exact",
        /// Those that own a tile its bounding box touches.
        Bounds "bounding-box",
    }
}

knob::knobs! {
    /// Distribution of triangles from each geometry unit to the rasterisers.
    pub struct DistributeConfig {
        /// Edge of the screen tiles that are dealt to pipelines. Where tiles are drawn from bins they are at least as large as those.
        tile: u32 ["pixels", Allowed::PowerOfTwo(8, 1024),
            "tiles of 16 x 16 pixels and more on Maxwell (Kanter 2016); ATTILA bGPU.ini ScanWidth = 16. Larger tiles mean less overlap, smaller ones better balance"]
            {estimate: UsedBy("config.owned_tile"), relax: Parts("screen tiles"), advice: [Imbalance]},
        /// How tiles are dealt.
        pattern: super::interleave::Pattern ["", Allowed::Choice(super::interleave::Pattern::NAMES),
            "assumed: evenly; how GM204 deals the screen is not published. A skewed interleave gives neighbours in both directions to different pipelines, and small targets to all"]
            {estimate: Used, relax: Each("screen tiles dealt in the pattern"), advice: []},
        /// How precisely the receivers of a triangle are found.
        overlap: Overlap ["", Allowed::Choice(Overlap::NAMES), "hardware tests bounding boxes (Molnar et al. 1994)"]
            {estimate: Ignored("cycles hardly depend on it"), relax: Skip(&[("exact", "triangles sent to exactly those that draw them")]), advice: []},
        /// Triangles routed per cycle by each geometry unit.
        triangles_per_cycle: u32 ["triangles/cycle", Allowed::Range(1, 16), "assumed: as the clipper delivers them"]
            {estimate: Used, relax: Rate, advice: []},
        /// Cycles between two triangles of one unit; 1 is fully pipelined.
        interval: u32 ["cycles", Allowed::Range(1, 64), "assumed: pipelined; ATTILA sets triangles up before it distributes them: bGPU.ini SetupStartLatency = 4 of TrianglesCycle = 2"]
            {estimate: Used, relax: Never, advice: []},
    }
}

/// Distribution. Its items are triangles.
#[derive(Clone)]
pub struct Distribute {
    config: DistributeConfig,
    /// Its number.
    number: usize,
    input: In<Run>,
    /// To all rasterisers.
    network: Sender<TriangleToken>,
    /// Which draw may be rasterised, where one waits for the one before it; and the last that may.
    turns: Option<In<NextDraw>>,
    turn: Option<u32>,
    /// When the next triangle may be sent, where they have an interval.
    free_at: Cycle,
    /// Triangles of the run at the head that are done.
    done: u32,
    /// Rasterisers that the current triangle, or the mark, has still to be sent to; there is none if this is empty.
    pending: u64,
    /// Whether a copy of the current triangle is on its way. Over a shared link this copy serves all receivers.
    shared: bool,
    counts: SortCounts,
    facing: FacingCounts,
}

/// The heading under which distribution counts the facing of triangles.
pub const FACING: Heading =
    Heading::new("facing.distribute[i]", "Which way triangles face that are distributed, of cards that sort triangles.");

stats::counters! {
    /// Which way triangles face.
    pub struct FacingCounts {
        /// Those that face away, of all that come here.
        back: "triangles",
    }
}

impl Distribute {
    /// An idle distribution unit with number `number`.
    pub fn new(config: DistributeConfig, number: usize, input: In<Run>, network: Sender<TriangleToken>) -> Distribute {
        let (counts, facing) = (SortCounts::default(), FacingCounts::default());
        let (turns, turn) = (None, None);
        Distribute {
            config,
            number,
            input,
            network,
            turns,
            turn,
            free_at: 0,
            done: 0,
            pending: 0,
            shared: false,
            counts,
            facing,
        }
    }

    /// Waits with the triangles of a draw for its turn.
    #[must_use]
    pub fn in_turn(self, turns: In<NextDraw>) -> Distribute {
        Distribute { turns: Some(turns), ..self }
    }

    /// The counters of what the unit has sent.
    pub fn counts(&self) -> SortCounts {
        self.counts
    }

    /// The counters of the unit's waits.
    pub fn waits(&self) -> SenderCounts {
        self.network.counts()
    }

    /// Sends a token to all pending rasterisers that have room; true when none is pending any more.
    #[inline(always)]
    fn send(&mut self, wires: &mut Wires, token: TriangleToken, size: u32, moved: &mut bool) -> bool {
        if self.network.is_shared() {
            return self.send_shared(wires, token, size, moved);
        }
        let mut left = self.pending;
        while left != 0 {
            let to = left.trailing_zeros();
            left &= left - 1;
            if self.network.can_send(wires, to as usize) {
                self.network.send(wires, to as usize, token, size);
                self.pending &= !(1 << to);
                *moved = true;
                self.count(to as usize, token.kind, size);
            }
        }
        self.pending == 0
    }

    /// Counts a copy that was sent.
    #[inline(always)]
    fn count(&mut self, to: usize, kind: Kind, size: u32) {
        if kind == Kind::DATA {
            self.counts.copy(1, size, to != self.number % self.network.receivers());
        } else {
            self.counts.marks += 1;
        }
    }

    /// [`Distribute::send`] over a link that all rasterisers listen to: one transfer reaches all that it is for.
    fn send_shared(&mut self, wires: &mut Wires, token: TriangleToken, size: u32, moved: &mut bool) -> bool {
        if token.kind != Kind::DATA {
            if !self.network.can_send_all(wires) {
                return false;
            }
            self.network.send_all(wires, token, size);
            self.counts.marks += 1;
            self.pending = 0;
            *moved = true;
            return true;
        }
        while self.pending != 0 {
            let to = self.pending.trailing_zeros();
            if !self.network.can_send(wires, to as usize) {
                return false;
            }
            let size = if std::mem::replace(&mut self.shared, true) { 0 } else { size };
            self.network.send(wires, to as usize, token, size);
            self.pending &= self.pending - 1;
            self.count(to as usize, token.kind, size);
            *moved = true;
        }
        self.shared = false;
        true
    }
}

/// The pipelines, of `pipelines` in all, that own what a triangle touches, as a mask. None if the triangle covers no sample and this is known
/// by the time that owners are sought.
#[inline(always)]
pub fn owners(card: &Card, work: &Work, triangle: &Triangle, overlap: Overlap, pipelines: usize) -> u64 {
    let late = triangle.end != End::Nowhere;
    if pipelines == 1 {
        return u64::from(overlap == Overlap::Bounds || triangle.visits > 0 || late);
    }
    let all = u64::MAX >> (64 - pipelines);
    let mut mask = 0;
    // Where setup or traversal finds out later that a triangle is drawn nowhere, only its bounds are known here. If these are outside of all
    // pipelines' pixels, any pipeline can find it out.
    let [x0, y0, x1, y1] = triangle.bounds;
    if late && (x0 >= x1 || y0 >= y1) {
        return 1 << (triangle.primitive as usize % pipelines);
    }
    match if late { Overlap::Bounds } else { overlap } {
        Overlap::Exact if !work.owners.is_empty() => {
            for visit in work.visits(triangle) {
                mask |= 1 << work.owners[visit.tile as usize];
                if mask == all {
                    break;
                }
            }
        }
        Overlap::Exact => {
            'all: for visit in work.visits(triangle) {
                let tile = &work.segment.tiles[visit.tile as usize];
                for block in &tile.blocks[visit.first_block as usize..][..visit.blocks as usize] {
                    mask |= 1 << card.interleave.owner(u32::from(block.x), u32::from(block.y));
                    if mask == all {
                        break 'all;
                    }
                }
            }
        }
        Overlap::Bounds => {
            let [x0, y0, x1, y1] = triangle.bounds.map(u32::from);
            let step = card.interleave.tile() / work::BLOCK;
            let mut y = y0 / step * step;
            'all: while y < y1 {
                let mut x = x0 / step * step;
                while x < x1 {
                    mask |= 1 << card.interleave.owner(x, y);
                    if mask == all {
                        break 'all;
                    }
                    x += step;
                }
                y += step;
            }
        }
    }
    mask
}

/// Asks the host for the first blocks of a triangle, which traversal will want in some cycles. No part of the model.
#[inline(always)]
fn ask_ahead(card: &Card, slot: u16, triangle: u32) {
    let work = card.work(slot);
    for visit in work.visits(&work.segment.triangles[triangle as usize]).iter().take(4) {
        prefetch(&work.segment.tiles[visit.tile as usize].blocks[visit.first_block as usize]);
    }
}

impl Unit<Card> for Distribute {
    fn tick(&mut self, wires: &mut Wires, card: &mut Card) -> Tick {
        let mut moved = self.network.poll(wires);
        while let Some(turn) = self.turns.as_ref().and_then(|turns| wires.pop(turns)) {
            self.turn = Some(turn.draw);
            moved = true;
        }
        let mut budget = Budget::new(self.config.triangles_per_cycle);
        loop {
            let Some(run) = wires.front(&self.input) else {
                return wires.stop(Tick::moved_or(moved, Tick::Starved), Tick::Starved);
            };

            // 1. A mark goes to every rasteriser, a triangle to the owners of what it touches.
            let data = run.kind == Kind::DATA;
            if data && self.turns.is_some() && self.turn != Some(card.work(run.slot).draw_number) {
                return wires.stop(Tick::moved_or(moved, Tick::Blocked), Tick::Blocked);
            }
            if data && self.free_at > wires.now() {
                wires.sleep_until(self.free_at);
                return wires.stop(Tick::moved_or(moved, Tick::Working), Tick::Working);
            }
            if data && !budget.spend() {
                return Tick::Moved;
            }
            let triangle = run.first + self.done;
            if self.pending == 0 {
                self.pending = match run.kind {
                    Kind::DATA => {
                        ask_ahead(card, run.slot, triangle);
                        {
                            let work = card.work(run.slot);
                            let triangle = &work.segment.triangles[triangle as usize];
                            owners(card, work, triangle, self.config.overlap, self.network.receivers())
                        }
                    }
                    _ => u64::MAX >> (64 - self.network.receivers()),
                };
                self.counts.sent += u64::from(data && self.pending != 0);
                moved = true;
            }
            let token = TriangleToken { slot: run.slot, kind: run.kind, sequence: run.sequence, triangle };
            let size = if data { bytes::TRIANGLE } else { bytes::MARK };

            // 2. Send it where there is room; the others wait, and what follows with them.
            if !self.send(wires, token, size, &mut moved) {
                return wires.stop(Tick::moved_or(moved, Tick::Blocked), Tick::Blocked);
            }

            // 3. Sent to all.
            if data {
                self.counts.sorted_items += 1;
                let work = card.work(run.slot);
                let of = &work.segment.triangles[triangle as usize];
                self.facing.back += u64::from(of.back);
                // Triangles of primitives that go to all pipelines are counted where they are dealt.
                let counted = !work.is_shared(of.primitive);
                card.funnel[run.slot].triangles_setup += u64::from(counted);
                self.done += 1;
                if self.config.interval > 1 {
                    self.free_at = wires.now() + Cycle::from(self.config.interval);
                }
            }
            if self.done == run.count {
                self.done = 0;
                wires.take(&self.input);
            }
        }
    }

    fn items(&self) -> u64 {
        self.counts.sorted_items
    }

    fn resident(&self) -> u64 {
        u64::from(self.done) + u64::from(self.pending != 0)
    }

    fn counted(groups: &mut Counted<Self>) {
        groups.group(FACING, |unit| unit.facing);
    }
}
