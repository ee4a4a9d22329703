//! The counters that all kinds of sorting share: of primitives before geometry, of triangles before rasterisation, or of quads before
//! the ROPs.

use std::collections::VecDeque;

use super::card::Work;
use super::network::Receiver;
use super::network::Stall;
use super::token::{Kind, TriangleToken};
use gfx::state::Compare;
use knob::Allowed;
use num::Cycle;
use sim::{StallProbe, Wires};
use work::Quad;

stats::counters! {
    /// What sorting costs.
    pub struct SortCounts {
        /// Items that were sorted: primitives, triangles or quads, by the sort class; those that no pipeline needs included.
        sorted_items: "items",
        /// Items sent to at least one receiver.
        sent: "items",
        /// Items sent, each copy counted.
        redistributed_items: "items",
        /// Their bytes.
        redistributed_bytes: "bytes",
        /// Of the items, those that went to another pipeline than that of the unit which sent them (by its number, modulo the pipelines).
        foreign_items: "items",
        /// Their bytes.
        foreign_bytes: "bytes",
        /// Sort-first: bytes if scenes are kept in memory, three numbers of vertices per primitive.
        retained_bytes: "bytes",
        /// Sort-first: bytes if they are not, three vertices with all attributes.
        immediate_bytes: "bytes",
        /// Marks sent so that receivers can restore the order.
        marks: "marks",
    }
}

impl SortCounts {
    /// A copy was sent.
    #[inline(always)]
    pub fn copy(&mut self, items: u32, bytes: u32, foreign: bool) {
        self.redistributed_items += u64::from(items);
        self.redistributed_bytes += u64::from(bytes);
        if foreign {
            self.foreign_items += u64::from(items);
            self.foreign_bytes += u64::from(bytes);
        }
    }
}

stats::counters! {
    /// What restoring the order costs.
    pub struct OrderCounts {
        /// Cycles in which something had come and none of it was next in order, summed over the units that restore it.
        order_waiting_cycles: "cycles",
    }
}

/// Counts the cycles in which what has come waits for its turn, and sets a probe to the reason of the stall.
#[derive(Clone, Debug, Default)]
pub struct OrderClock {
    probe: StallProbe,
    state: Stall,
    since: Option<Cycle>,
    counts: OrderCounts,
}

impl OrderClock {
    /// A clock that sets this probe.
    pub fn new(probe: StallProbe) -> OrderClock {
        OrderClock { probe, ..OrderClock::default() }
    }

    /// A tick begins: whatever was, is over.
    #[inline(always)]
    pub fn begin(&mut self, now: Cycle) {
        self.state = Stall::None;
        if let Some(since) = self.since.take() {
            self.counts.order_waiting_cycles += now - since;
        }
    }

    /// From now on, until the next tick, there is nothing that may be taken, whether or not something is `here`. It is `counted`
    /// unless the sender whose turn it is has sent nothing more.
    #[inline(always)]
    pub fn wait(&mut self, now: Cycle, here: bool, counted: bool) {
        self.state = if here { Stall::OutOfOrder } else { Stall::NoInput };
        self.since = (here && counted).then_some(now);
    }

    /// The tick is over.
    #[inline(always)]
    pub fn end(&mut self, wires: &mut Wires) {
        wires.set_probe(&self.probe, self.state as u8);
    }

    /// The counters.
    pub fn counts(&self) -> OrderCounts {
        self.counts
    }
}

/// The time that each pipeline has waited, at the ends of passes, for the others to end theirs.
#[derive(Clone, Debug, Default)]
pub struct PassWaits {
    /// The cycle of each pipeline's last report.
    ended: Vec<Cycle>,
    waited: Vec<u64>,
}

impl PassWaits {
    /// The waits of `pipelines` pipelines.
    pub fn new(pipelines: usize) -> PassWaits {
        PassWaits { ended: vec![0; pipelines], waited: vec![0; pipelines] }
    }

    /// A unit has ended its part of the pass, perhaps as the last one; numbers of units go round the pipelines.
    pub fn ended(&mut self, unit: usize, now: Cycle, last: bool) {
        let pipeline = unit % self.ended.len();
        self.ended[pipeline] = now;
        if last {
            for (waited, ended) in self.waited.iter_mut().zip(&self.ended) {
                *waited += now - ended;
            }
        }
    }

    /// Cycles by pipeline.
    pub fn waited(&self) -> &[u64] {
        &self.waited
    }
}

knob::choices! {
    /// Where API order is kept.
    pub enum Keep {
        /// Everywhere.
        Always "always",
        /// Among quads of opaque draws, whose depth decides, it is not: they reach the ROP as they come.
        WhereNeeded "where-needed",
        /// Nowhere: everything is taken as it comes, lists of tiles are written so, and frame buffers are composed without the numbers
        /// of primitives, which shows what keeping the order is for.
        Never "never",
    }
}

knob::choices! {
    /// Early depth tests in pipelines that do not own the pixels they draw.
    pub enum EarlyTest {
        /// None: every covered quad is shaded.
        None "none",
        /// Against a copy of the depths, one in each pipeline, which knows what that pipeline has drawn.
        Local "local",
        /// Against the owner's depths, which are asked for.
        Remote "remote",
    }
}

knob::knobs! {
    /// API order, where it is restored, and what can be known ahead of it.
    pub struct OrderConfig {
        /// Where API order is kept.
        keep: Keep ["", Allowed::Choice(Keep::NAMES),
            "APIs demand it; where-needed is for sort-last-fragment (Molnar et al. 1994), never for no real card"]
            {estimate: RefusedUnless(Is(&["always", "never"]), "quads in any order"), relax: Never, advice: []},
        /// Early depth tests where the pixels have another owner: sort-last-fragment.
        early: EarlyTest ["", Allowed::Choice(EarlyTest::NAMES),
            "Molnar et al. 1994 have none; the others show what an early test is worth there"]
            {estimate: RefusedUnless(Is(&["none"]), "early tests of quads that others own"), relax: Never, advice: []},
        /// Groups of quads that wait for the depths of their early test.
        early_queue: u32 ["groups", Allowed::Range(1, 4096), "assumed: covers a question and its answer"]
            {estimate: Ignored("without effect where order.early is none"), relax: Room, advice: []},
        /// Remote early tests: cycles that a question takes to the owner of its pixels, and an answer back.
        early_latency: u32 ["cycles", Allowed::Range(1, 1024), "assumed: as network.link_latency"]
            {estimate: Ignored("without effect where order.early is none"), relax: Latency, advice: []},
        /// Remote early tests: bytes per cycle of each way between two pipelines, there and back.
        early_bytes: u32 ["bytes/cycle", Allowed::Range(1, 65536), "assumed: the depths of four quads, one sample per pixel"]
            {estimate: Ignored("without effect where order.early is none"), relax: Rate, advice: []},
    }
}

/// Sequence numbers that have ended, of which all before the first that has not are known by it.
#[derive(Clone, Debug, Default)]
pub struct Ended {
    /// The first that has not ended.
    first: u32,
    /// For this number and each after it, the number of parts that have ended, or [`WHOLE`] if all have.
    after: VecDeque<u8>,
}

/// All parts of a number have ended.
const WHOLE: u8 = u8::MAX;

impl Ended {
    /// A number has ended.
    pub fn note(&mut self, sequence: u32) {
        self.note_part(sequence, 1);
    }

    /// Notes that one of a number's `parts` parts has ended.
    pub fn note_part(&mut self, sequence: u32, parts: usize) {
        let place = sequence.wrapping_sub(self.first) as usize;
        if self.after.len() <= place {
            self.after.resize(place + 1, 0);
        }
        let ended = &mut self.after[place];
        *ended = if usize::from(*ended) + 1 == parts { WHOLE } else { *ended + 1 };
        while self.after.front() == Some(&WHOLE) {
            self.after.pop_front();
            self.first = self.first.wrapping_add(1);
        }
    }

    /// Whether all numbers before `sequence` have ended.
    pub fn before(&self, sequence: u32) -> bool {
        self.first.wrapping_sub(sequence) as i32 >= 0
    }

    /// Whether a token may be taken where no order is kept: a fence waits for all before it.
    pub fn takes(&self, kind: Kind, sequence: u32) -> bool {
        !kind.is_fence() || self.before(sequence)
    }
}

/// Takes what several senders send in the order of its sequence numbers, or as it comes where no order is kept.
#[derive(Clone, Debug)]
pub struct Merge {
    keep: Keep,
    /// A single sender sends in order, and may leave out the marks of ends.
    alone: bool,
    /// The sequence number that is being taken, and its sender, once it is known.
    sequence: u32,
    current: Option<usize>,
    /// The sequence numbers that have ended, if no order is kept.
    ended: Ended,
    clock: OrderClock,
}

impl Merge {
    /// A merge at the beginning of the order. The state of `probe` is what it waits for.
    pub fn new(keep: Keep, probe: StallProbe, input: &Receiver<TriangleToken>) -> Merge {
        let alone = input.senders() == 1;
        // The tokens of a single sender are in order, and its marks may have numbers of their own.
        let keep = if alone { Keep::Always } else { keep };
        let (ended, clock) = (Ended::default(), OrderClock::new(probe));
        Merge { keep, alone, sequence: 0, current: alone.then_some(0), ended, clock }
    }

    /// A tick of its unit begins.
    #[inline(always)]
    pub fn begin(&mut self, now: Cycle) {
        self.clock.begin(now);
    }

    /// It is over.
    #[inline(always)]
    pub fn end(&mut self, wires: &mut Wires) {
        self.clock.end(wires);
    }

    /// The counters of the unit.
    pub fn counts(&self) -> OrderCounts {
        self.clock.counts()
    }

    /// The next token in order and its sender, if it is here. It stays the next one until it is taken.
    #[inline(always)]
    pub fn next(&mut self, wires: &mut Wires, input: &Receiver<TriangleToken>) -> Option<(usize, TriangleToken)> {
        if let Some(from) = self.current {
            let Some(token) = input.front(wires, from) else {
                let here = !self.alone && input.find(wires, |_| true).is_some();
                self.clock.wait(wires.now(), here, false);
                return None;
            };
            return Some((from, token));
        }
        let sought = |token: &TriangleToken| match self.keep {
            Keep::Never => self.ended.takes(token.kind, token.sequence),
            _ => token.sequence == self.sequence,
        };
        let found = input.find(wires, sought);
        if let Some((from, _)) = found {
            self.current = Some(from);
        } else {
            let here = input.find(wires, |_| true).is_some();
            self.clock.wait(wires.now(), here, true);
        }
        found
    }

    /// Takes a token that is the next of its sender; one that ends its sequence number opens the next.
    #[inline(always)]
    pub fn take(&mut self, wires: &mut Wires, input: &mut Receiver<TriangleToken>, from: usize, token: TriangleToken) {
        input.take(wires, from);
        if token.kind != Kind::DATA {
            if self.keep == Keep::Never {
                self.ended.note(token.sequence);
            }
            self.sequence = self.sequence.wrapping_add(1);
        } else if self.keep != Keep::Never {
            return;
        }
        self.current = self.alone.then_some(0);
    }
}

/// The state that draws must have in common for their quads to reach the ROP in any order.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Opaque {
    /// Whether the lesser depth wins.
    less: bool,
    /// The targets that are written with it, a bit each.
    targets: u32,
}

/// Whether quads of a draw may reach the ROP in any order among those of draws of the same kind: what is nearer wins with all that it
/// writes, nothing of what was there shows through, and no stencil counts. (Of quads with equal depths the first or the last to come wins.)
pub fn any_order(work: &Work) -> Option<Opaque> {
    let depth = work.depth.as_ref().filter(|depth| depth.writes_depth() && !depth.uses_stencil())?;
    let less = match depth.compare() {
        Compare::Less | Compare::LessEqual => true,
        Compare::Greater | Compare::GreaterEqual => false,
        _ => return None,
    };
    // A fragment that is discarded after an early test leaves its depth, but not its colours.
    let discards = |quad: &Quad| quad.kept & quad.coverage != quad.coverage;
    let early = work.early && work.draw.shades();
    if early && work.segment.tiles.iter().any(|tile| tile.quads.iter().any(discards)) {
        return None;
    }
    let mut targets = 0;
    for (n, (color, target)) in work.colors.iter().zip(&work.draw.targets).enumerate() {
        let (Some(color), Some(target)) = (color, target) else { continue };
        if color.reads() {
            return None;
        }
        targets |= u32::from(!color.is_idle() && target.payload.is_some()) << n;
    }
    Some(Opaque { less, targets })
}
