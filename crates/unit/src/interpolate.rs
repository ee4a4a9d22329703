//! Interpolation, one unit per pipeline: reads a triangle's attributes and evaluates them for its quads.

use super::card::Card;
use super::token::{GroupToken, Kind, bytes};
use gfx::stage::Stage;
use knob::Allowed;
use sim::{In, Out, Tick, Unit, Wires};

knob::knobs! {
    /// Interpolation of attributes.
    pub struct InterpolateConfig {
        /// Quads begun per cycle.
        quads_per_cycle: u32 ["quads/cycle", Allowed::Range(1, 16), "assumed; ATTILA bGPU.ini NumInterpolators = 4"]
            {estimate: Used, relax: Rate, advice: []},
        /// Cycles between beginnings of `quads_per_cycle` quads, for rates below one quad per cycle.
        interval: u32 ["cycles", Allowed::Range(1, 64), "pipelined; 2 where a core shades two fragments per cycle (Mali-G57, Arm GPU Datasheet v7)"]
            {estimate: Used, relax: Never, advice: []},
        /// Attribute words that each of these quads gets per cycle; more take more cycles.
        words_per_cycle: u32 ["words/quad/cycle", Allowed::Range(1, 64), "assumed: a vec4 a quad and cycle, as ATTILA's interpolators"]
            {estimate: Used, relax: Rate, advice: []},
        /// Whether only those varyings are computed and interpolated that the fragment stage reads; if not, all that the vertex stage writes.
        skip_varyings: bool ["", Allowed::Switch, "drivers link the stages of a pipeline; off shows what that is worth"]
            {estimate: UsedBy("config.render_key"), relax: Skip(&[("true", "only varyings that are read")]), advice: []},
        /// Cycles from here to the cores.
        latency: u32 ["cycles", Allowed::Range(1, 64), "assumed: multiply-add chains and a reciprocal: 8 stages"]
            {estimate: RefusedUnless(AtMost(32), "long ways through interpolation"), relax: Latency, advice: []},
        /// Groups of quads queued before the cores.
        queue: u32 ["groups", Allowed::Range(2, 4096), "assumed; ATTILA bGPU.ini ShaderInputQueueSize = 128"]
            {estimate: RefusedUnless(AtLeast(8), "short queues behind interpolation"), relax: Room, advice: []},
    }
}

/// Interpolation. Its items are quads.
#[derive(Clone)]
pub struct Interpolate {
    config: InterpolateConfig,
    input: In<GroupToken>,
    output: Out<GroupToken>,
    /// Time in quads begun: the cycle times `quads_per_cycle` at which the interpolators are free.
    free_at: u64,
    items: u64,
}

impl Interpolate {
    /// An idle interpolation unit.
    pub fn new(config: InterpolateConfig, input: In<GroupToken>, output: Out<GroupToken>) -> Interpolate {
        Interpolate { config, input, output, free_at: 0, items: 0 }
    }
}

impl Unit<Card> for Interpolate {
    fn tick(&mut self, wires: &mut Wires, card: &mut Card) -> Tick {
        let mut did = Tick::Starved;
        let rate = u64::from(self.config.quads_per_cycle);
        let end = (wires.now() + 1) * rate;
        loop {
            let Some(token) = wires.front(&self.input) else { return wires.stop(did, Tick::Starved) };

            // 1. The interpolators are at work on what came before.
            if self.free_at >= end {
                wires.sleep_until(self.free_at / rate);
                return wires.stop(did, Tick::Working);
            }
            if !wires.can_push(&self.output) {
                return wires.stop(did, Tick::Blocked);
            }

            // 2. A quad takes as many turns as its words need.
            if token.kind == Kind::DATA {
                let group = &card.groups[usize::from(token.pool)][token.group];
                let words = card.work(group.slot).draw.shape(Stage::Fragment).inputs;
                let turns = u64::from(words.div_ceil(self.config.words_per_cycle).max(1) * self.config.interval);
                self.free_at = self.free_at.max(wires.now() * rate) + turns * u64::from(token.quads);
                self.items += u64::from(token.quads);
                wires.push_sized(&self.output, token, u32::from(token.quads) * bytes::QUAD);
            } else {
                wires.push_sized(&self.output, token, bytes::MARK);
            }
            wires.take(&self.input);
            did = Tick::Moved;
        }
    }

    fn items(&self) -> u64 {
        self.items
    }

    fn resident(&self) -> u64 {
        0
    }
}
