//! Triangle setup, one unit per rasteriser: takes triangles from all geometry units in the order of their sequence numbers.

use super::card::Card;
use super::network::Receiver;
use super::sorting::{Keep, Merge, OrderCounts};
use super::token::{Kind, TriangleToken};
use knob::Allowed;
use num::prefetch;
use sim::{Budget, Counted, Out, StallProbe, Tick, Unit, Wires};
use stats::Heading;
use work::End;

knob::knobs! {
    /// Triangle setup in each rasteriser.
    pub struct SetupConfig {
        /// Triangles set up per cycle.
        triangles_per_cycle: u32 ["triangles/cycle", Allowed::Range(1, 8), "assumed; ATTILA bGPU.ini RASTERIZER TrianglesCycle = 2 for the card; one each here"]
            {estimate: Used, relax: Rate, advice: []},
        /// Cycles between two triangles of one unit; 1 is fully pipelined.
        interval: u32 ["cycles", Allowed::Range(1, 64), "pipelined since the GeForce 256"] {estimate: Used, relax: Interval, advice: []},
        /// Cycles from here to traversal.
        latency: u32 ["cycles", Allowed::Range(1, 64), "assumed; ATTILA bGPU.ini SetupLatency = 10"]
            {estimate: RefusedUnless(AtMost(32), "long ways through setup"), relax: Latency, advice: []},
        /// Triangles queued before traversal.
        queue: u32 ["triangles", Allowed::Range(2, 1024), "assumed; ATTILA bGPU.ini SetupFIFOSize = 32"]
            {estimate: RefusedUnless(AtLeast(8), "short queues before setup"), relax: Room, advice: []},
    }
}

stats::counters! {
    /// What setup finds out.
    pub struct SetupCounts {
        /// Triangles that end here, since they face away, have no area, or lie outside: where geometry does not find that out.
        ended: "triangles",
    }
}

/// Triangle setup. Its items are triangles.
#[derive(Clone)]
pub struct Setup {
    config: SetupConfig,
    /// From all geometry units.
    input: Receiver<TriangleToken>,
    output: Out<TriangleToken>,
    merge: Merge,
    /// Whether a mark for the end of each sequence number is sent on.
    marks: bool,
    free_at: u64,
    found: SetupCounts,
    items: u64,
}

impl Setup {
    /// An idle setup unit. With `marks` the marks that end sequence numbers are passed on, for units behind it that restore the order again.
    /// The state of the probe is what the unit waits for.
    pub fn new(
        config: SetupConfig,
        input: Receiver<TriangleToken>,
        marks: bool,
        keep: Keep,
        probe: StallProbe,
        output: Out<TriangleToken>,
    ) -> Setup {
        Setup {
            config,
            merge: Merge::new(keep, probe, &input),
            input,
            output,
            marks,
            free_at: 0,
            found: SetupCounts::default(),
            items: 0,
        }
    }

    /// The counters of what setup has found out.
    pub fn found(&self) -> SetupCounts {
        self.found
    }

    /// The counters of the unit's waits for the order.
    pub fn counts(&self) -> OrderCounts {
        self.merge.counts()
    }
}

/// Whether a triangle ends here, because setup finds that nothing of it is drawn.
#[inline(always)]
fn ends(card: &Card, token: TriangleToken) -> bool {
    let work = card.work.get(usize::from(token.slot)).and_then(Option::as_ref);
    work.is_some_and(|work| work.segment.triangles[token.triangle as usize].end == End::Setup)
}

/// Asks the host for the first quads of a triangle, which traversal will want in some cycles. No part of the model.
#[inline(always)]
fn ask_ahead(card: &Card, token: TriangleToken) {
    let Some(Some(work)) = card.work.get(usize::from(token.slot)) else { return };
    for visit in work.visits(&work.segment.triangles[token.triangle as usize]).iter().take(4) {
        let tile = &work.segment.tiles[visit.tile as usize];
        prefetch(&tile.quads[tile.blocks[visit.first_block as usize].first_quad as usize]);
    }
}

impl Setup {
    #[inline(always)]
    fn step(&mut self, wires: &mut Wires, card: &mut Card) -> Tick {
        let mut did = Tick::Starved;
        let mut budget = Budget::new(self.config.triangles_per_cycle);
        loop {
            let Some((from, token)) = self.merge.next(wires, &self.input) else {
                return wires.stop(did, Tick::Starved);
            };
            match token.kind {
                // 1. The end of a sequence number is seen and forgotten where the order is restored here.
                kind if kind.is_end() && !self.marks => {
                    self.merge.take(wires, &mut self.input, from, token);
                    did = Tick::Moved;
                }
                // 2. Triangles take their time.
                Kind::DATA => {
                    if self.free_at > wires.now() {
                        wires.sleep_until(self.free_at);
                        return wires.stop(did, Tick::Working);
                    }
                    if budget.left() == 0 {
                        return Tick::Moved;
                    }
                    // A triangle of which nothing is drawn takes its time and goes no further.
                    if ends(card, token) {
                        self.found.ended += 1;
                    } else {
                        if !wires.try_push(&self.output, token) {
                            return wires.stop(did, Tick::Blocked);
                        }
                        ask_ahead(card, token);
                    }
                    budget.spend();
                    self.merge.take(wires, &mut self.input, from, token);
                    self.items += 1;
                    if self.config.interval > 1 {
                        self.free_at = wires.now() + u64::from(self.config.interval);
                    }
                    did = Tick::Moved;
                }
                // 3. Marks pass in order.
                _ => {
                    if !wires.try_push(&self.output, token) {
                        return wires.stop(did, Tick::Blocked);
                    }
                    self.merge.take(wires, &mut self.input, from, token);
                    did = Tick::Moved;
                }
            }
        }
    }
}

impl Unit<Card> for Setup {
    fn tick(&mut self, wires: &mut Wires, card: &mut Card) -> Tick {
        self.merge.begin(wires.now());
        self.input.poll(wires);
        let did = self.step(wires, card);
        self.merge.end(wires);
        did
    }

    fn items(&self) -> u64 {
        self.items
    }

    fn resident(&self) -> u64 {
        self.input.resident()
    }

    fn counted(groups: &mut Counted<Self>) {
        groups.group(Heading::new("setup.setup[i]", "What setup finds out."), |unit| unit.found);
    }
}
