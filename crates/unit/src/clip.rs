//! Clip and cull: primitives in, triangles out. What becomes of each was decided by `gfx`; here it takes time and is counted. Of
//! primitives that the culls here let through the work has triangles, which end in setup or traversal.

use super::card::Card;
use super::token::{Kind, Run};
use knob::Allowed;
use sim::{Budget, In, Out, Tick, Unit, Wires};

knob::knobs! {
    /// Clipping and culling, one unit a geometry unit.
    pub struct ClipConfig {
        /// Primitives tested per cycle, those that end here and those that go on untouched.
        primitives_per_cycle: u32 ["primitives/cycle", Allowed::Range(1, 16), "one (NVIDIA 2010, GF100 white paper); ATTILA bGPU.ini CLIPPER TrianglesCycle = 2, two units"]
            {estimate: Used, relax: Rate, advice: []},
        /// Cycles that testing `primitives_per_cycle` primitives takes, for rates below one primitive per cycle.
        interval: u32 ["cycles", Allowed::Range(1, 64), "pipelined; 2 in each of the 16 geometry units of the GeForce GTX 980"]
            {estimate: Used, relax: Never, advice: []},
        /// Cycles that a primitive takes which has to be cut against a plane.
        clip_cycles: u32 ["cycles/primitive", Allowed::Range(1, 256),
            "assumed: Sutherland-Hodgman against one or two planes at a vertex a cycle; ATTILA bGPU.ini ExecLatency = 6"]
            {estimate: Used, relax: Interval, advice: []},
        /// Whether triangles that face away end here; if not, setup finds out.
        cull_facing: bool ["", Allowed::Switch, "the sign of the area, from window positions that the tests below need too; ATTILA finds it in setup"]
            {estimate: RefusedUnless(Is(&["true"]), "triangles that are not drawn"), relax: Skip(&[("true", "triangles that face away culled early")]), advice: []},
        /// Whether primitives outside the view volume end here; if not, setup finds out, or cutting them does.
        cull_frustum: bool ["", Allowed::Switch, "trivial rejection by outcodes (Sutherland and Sproull 1968)"]
            {estimate: RefusedUnless(Is(&["true"]), "triangles that are not drawn"), relax: Skip(&[("true", "primitives out of view culled early")]), advice: []},
        /// Whether primitives outside the scissor rectangle end here; if not, traversal finds no sample of them in it.
        cull_scissor: bool ["", Allowed::Switch, "bounds of a triangle against a rectangle: four comparisons"]
            {estimate: RefusedUnless(Is(&["true"]), "triangles that are not drawn"), relax: Skip(&[("true", "scissored primitives culled early")]), advice: []},
        /// Whether primitives without area, or without a covered sample, end here or as they are distributed; if not, setup finds that
        /// they have no area, and traversal, in all of their bounds, no sample of them.
        cull_no_sample: bool ["", Allowed::Switch, "bounds of a triangle against sample positions; off in cards without a filter for small triangles"]
            {estimate: RefusedUnless(Is(&["true"]), "triangles that are not drawn"), relax: Skip(&[("true", "triangles between samples culled early")]), advice: []},
        /// Cycles from here to the distribution.
        latency: u32 ["cycles", Allowed::Range(1, 64), "assumed; ATTILA bGPU.ini CLIPPER StartLatency + ExecLatency = 7"]
            {estimate: Used, relax: Latency, advice: []},
        /// Runs of triangles queued before the distribution.
        queue: u32 ["runs", Allowed::Range(2, 1024), "assumed; ATTILA bGPU.ini ClipBufferSize = 32"]
            {estimate: RefusedUnless(AtLeast(4), "short queues in geometry"), relax: Room, advice: []},
    }
}

impl ClipConfig {
    /// The culls by the paths of their knobs, and whether they are on.
    pub fn culls(&self) -> [(&'static str, bool); 4] {
        [
            ("clip.cull_facing", self.cull_facing),
            ("clip.cull_frustum", self.cull_frustum),
            ("clip.cull_scissor", self.cull_scissor),
            ("clip.cull_no_sample", self.cull_no_sample),
        ]
    }
}

/// Clip and cull. Its items are primitives.
#[derive(Clone)]
pub struct Clip {
    config: ClipConfig,
    input: In<Run>,
    output: Out<Run>,
    /// Primitives of the run at the head that are done.
    done: u32,
    /// The cycle from which on the unit is free.
    busy_until: u64,
    /// Whether this unit counts how primitives end. Otherwise the unit before it does.
    counts: bool,
    items: u64,
}

impl Clip {
    /// An idle clip unit. With `counts` it counts how primitives end.
    pub fn new(config: ClipConfig, counts: bool, input: In<Run>, output: Out<Run>) -> Clip {
        Clip { config, input, output, done: 0, busy_until: 0, counts, items: 0 }
    }
}

impl Unit<Card> for Clip {
    fn tick(&mut self, wires: &mut Wires, card: &mut Card) -> Tick {
        // 1. A primitive that is being cut, or the interval behind the last, holds the unit.
        if self.busy_until > wires.now() {
            wires.sleep_until(self.busy_until);
            return Tick::Working;
        }

        let did = self.test(wires, card);
        if did == Tick::Moved && self.busy_until > wires.now() {
            wires.sleep_until(self.busy_until);
            return wires.stop(did, Tick::Working);
        }
        did
    }

    fn items(&self) -> u64 {
        self.items
    }

    fn resident(&self) -> u64 {
        u64::from(self.done)
    }
}

impl Clip {
    /// The primitives of a cycle.
    fn test(&mut self, wires: &mut Wires, card: &mut Card) -> Tick {
        let mut did = Tick::Starved;
        let mut budget = Budget::new(self.config.primitives_per_cycle);
        while budget.left() > 0 {
            let Some(run) = wires.front(&self.input) else { return wires.stop(did, Tick::Starved) };

            // 2. Marks pass in order.
            if run.kind != Kind::DATA {
                if !wires.try_push(&self.output, run) {
                    return wires.stop(did, Tick::Blocked);
                }
                wires.take(&self.input);
                did = Tick::Moved;
                continue;
            }

            // 3. Test primitives; their triangles follow each other, so that a cycle's survivors are one run. One that must be
            //    cut ends the cycle.
            if !wires.can_push(&self.output) {
                return wires.stop(did, Tick::Blocked);
            }
            let work = card.work(run.slot);
            let first = (run.first + self.done) as usize;
            let most = (run.count - self.done).min(budget.left());
            let primitives = &work.segment.primitives[first..first + most as usize];
            let start = primitives[0].first_triangle;
            let (mut tested, mut triangles, mut cut) = (0, 0, false);
            // Primitives that go to all pipelines are counted where they are dealt.
            let shared = work.is_shared(first as u32);
            let funnel = &mut { card.funnel[run.slot] };
            for primitive in primitives {
                tested += 1;
                triangles += u32::from(primitive.triangles);
                if self.counts && !shared {
                    funnel.end(primitive, 1);
                }
                funnel.clipped += u64::from(primitive.clipped && !shared);
                if primitive.clipped || primitive.cut_away {
                    cut = true;
                    break;
                }
            }
            card.funnel[run.slot] = *funnel;
            if triangles > 0 {
                let run = Run { slot: run.slot, kind: Kind::DATA, sequence: run.sequence, first: start, count: triangles };
                wires.push(&self.output, run);
            }
            budget.take(tested);
            self.items += u64::from(tested);
            self.done += tested;
            if self.done == run.count {
                self.done = 0;
                wires.take(&self.input);
            }
            did = Tick::Moved;
            if self.config.interval > 1 {
                self.busy_until = wires.now() + u64::from(self.config.interval);
            }
            if cut {
                self.busy_until = self.busy_until.max(wires.now() + u64::from(self.config.clip_cycles));
                break;
            }
        }
        did
    }
}
