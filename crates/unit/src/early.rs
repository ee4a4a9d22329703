//! Early depth tests in pipelines that do not own the pixels they draw, one unit per pipeline of a machine that sorts fragments: throws
//! away, before they are shaded and sent, quads that will certainly fail the test of the ROP that owns their pixels.
//!
//! That test is made in any case, against what was drawn before in the ROP's order. Here a depth is asked for that was stored there
//! before, or that something which reaches the ROP earlier will have compared there: either a copy of the pipeline's own, or what
//! the owner has at the moment.
//!
//! # Why nothing visible is thrown away
//!
//! Let z be the depth of a fragment whose draw compares `less` (the other directions are the same turned round), and d the depth against
//! which it fails here: z >= d. It is shown that when the fragment reaches its ROP, the depth D stored there is at most d, so
//! that it fails there too, and leaves the picture as it is.
//!
//! 1. A draw whose comparison may raise depths takes `less` from the tests that may be made here, from its own on to the end of the pass
//!    ([`Work::ahead`](super::card::Work::ahead), which is settled in API order where segments are installed). So of all draws of the pass
//!    up to the fragment's own, in API order, none has raised a depth. (In a pass that has written no depth at all, both directions hold.)
//! 2. *The owner's depth.* At the moment of the answer D = d. Until the fragment arrives, the ROP takes only what its order lets pass
//!    before it: what is earlier in API order, which by 1 does not raise D. Where order is kept everywhere this is all: of the
//!    fragment's sequence number, and of none after it, anything may have come, as the number ends behind the fragment. Where opaque
//!    draws are let through in any order, later ones may have come before and after the answer, all of which lower D too: the ROP lets
//!    pass none but those of one direction with each other. Of two with equal depths the first to come wins, here as there.
//! 3. *The pipeline's own copy.* d is the least of the depth with which the pass began and of those of fragments that the pipeline has
//!    sent to the same ROP before: it draws its primitives in API order, and from one pipeline to one ROP nothing overtakes. When the
//!    fragment arrives these have been tested there: each has been written, or has failed against something less or equal. After it,
//!    by 1 and as in 2, nothing has raised D. A fragment counts here only if nothing but the depth test decides whether it is written:
//!    no stencil, and no shader that may discard it first.
//!
//! Where no order is kept at all, a later draw may raise depths in between; the picture is what it is there anyway.

use std::collections::VecDeque;

use super::block_cache::{BlockCache, Quads, ROP};
use super::card::Card;
use super::card::notes::note;
use super::class_state::ClassState;
use super::depths::test_ahead;
use super::token::fragments;
use super::token::{Answer, GroupToken, Kind, Question, bytes};
use mem::CACHES;
use num::Cycle;
use sim::{Counted, In, Out, Tick, Unit, Wires};
use stats::Heading;

/// The heading of these units in the statistics.
pub const EARLY_TESTS: Heading = Heading::new("early.early[i]", "Sort-last-fragment: early depth tests, where there are any.");

stats::counters! {
    /// What early tests in pipelines that own no pixels do.
    pub struct EarlyCounts {
        /// Quads whose depths were asked for: of the copy, or of the owner.
        asked: "quads",
        /// Of these, quads whose depths have come and were compared.
        answered: "quads",
        /// Quads thrown away.
        culled: "quads",
        /// Fragments thrown away, those of quads that go on included.
        culled_fragments: "fragments",
        /// Bytes of questions to owners.
        question_bytes: "bytes",
        /// Bytes of their answers.
        answer_bytes: "bytes",
    }
}

/// The source of the depths that early tests use.
#[derive(Clone)]
pub enum DepthSource {
    /// The pipeline's own copy, through a Z cache.
    Copy(Box<BlockCache>),
    /// The owners', each by a way there and back.
    Owners {
        /// Questions, by owner.
        questions: Vec<Out<Question>>,
        /// Answers.
        answers: Vec<In<Answer>>,
    },
}

/// The rate, queue and latency of early tests.
#[derive(Clone, Copy, Debug)]
pub struct EarlyRate {
    /// Quads tested per cycle.
    pub quads_per_cycle: u32,
    /// Groups that wait for their depths.
    pub queue: u32,
    /// Cycles of a test.
    pub latency: u32,
}

/// The event that a group waits for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Wait {
    /// Nothing: it is not tested.
    Nothing,
    /// A block of the copy, by its place in the cache.
    Block(u32),
    /// The owner's answer.
    Answer,
    /// Nothing any more: the owner has answered.
    Answered,
}

/// A group or a mark on its way.
#[derive(Clone, Copy, Debug)]
struct EarlyGroup {
    token: GroupToken,
    wait: Wait,
    from: Cycle,
}

/// Early tests of a pipeline. Its items are quads tested.
#[derive(Clone)]
pub struct Early {
    pipeline: u8,
    rate: EarlyRate,
    input: In<GroupToken>,
    output: Out<GroupToken>,
    known: DepthSource,
    /// In order; the first has the ticket `first`, and those behind it the numbers after that.
    entries: VecDeque<EarlyGroup>,
    first: u32,
    /// The pass that the copy is of.
    pass: u32,
    /// When the testers are free, in cycles times `quads_per_cycle`.
    free_at: u64,
    counts: EarlyCounts,
    items: u64,
}

impl Early {
    /// An idle unit of pipeline `pipeline`, which makes early tests.
    pub fn new(pipeline: u8, rate: EarlyRate, input: In<GroupToken>, output: Out<GroupToken>, known: DepthSource) -> Early {
        Early {
            pipeline,
            rate,
            input,
            output,
            known,
            entries: VecDeque::with_capacity(rate.queue as usize),
            first: 0,
            pass: u32::MAX,
            free_at: 0,
            counts: EarlyCounts::default(),
            items: 0,
        }
    }

    /// The counters of the unit.
    pub fn counts(&self) -> EarlyCounts {
        self.counts
    }

    /// The cache of the copy, if there is one.
    fn copy(&self) -> Option<&BlockCache> {
        match &self.known {
            DepthSource::Copy(cache) => Some(cache),
            DepthSource::Owners { .. } => None,
        }
    }

    /// Memory, or answers; true if anything came or went.
    fn exchange(&mut self, wires: &mut Wires) -> bool {
        match &mut self.known {
            DepthSource::Copy(cache) => cache.exchange(wires),
            DepthSource::Owners { answers, .. } => {
                let mut moved = false;
                for port in answers {
                    while let Some(Answer { ticket, bytes }) = wires.pop(port) {
                        self.entries[ticket.wrapping_sub(self.first) as usize].wait = Wait::Answered;
                        self.counts.answer_bytes += u64::from(bytes);
                        moved = true;
                    }
                }
                moved
            }
        }
    }

    /// Asks for the depths of a group, if its draw has a test to be made with them.
    fn ask(&mut self, wires: &mut Wires, card: &mut Card, token: GroupToken) -> Result<Wait, Tick> {
        let Card { groups, work, passes, class_state: ClassState { seen, .. }, .. } = card;
        let group = &groups[usize::from(token.pool)][token.group];
        let work = work[usize::from(group.slot)].as_ref().expect("a group's segment is in flight");
        let Some(pass) = passes.get(work.pass) else { return Ok(Wait::Nothing) };
        let (Some(_), Some(surface)) = (&work.ahead, pass.depth) else { return Ok(Wait::Nothing) };
        let wait = match &mut self.known {
            DepthSource::Copy(cache) => {
                if self.pass != pass.number {
                    // All of the pass before is drawn. Its depths here are of no more use.
                    self.pass = pass.number;
                    cache.forget();
                }
                let place = cache.pin(&mut seen[usize::from(self.pipeline)], surface, group.block, Quads::ANY, &mut None)?;
                Wait::Block(place as u32)
            }
            DepthSource::Owners { questions, .. } => {
                let port = &questions[usize::from(token.pool)];
                if !wires.can_push(port) {
                    return Err(Tick::Blocked);
                }
                let ticket = self.first.wrapping_add(self.entries.len() as u32);
                wires.push_sized(port, Question { ticket, group: token.group }, bytes::QUESTION);
                self.counts.question_bytes += u64::from(bytes::QUESTION);
                Wait::Answer
            }
        };
        self.counts.asked += u64::from(token.quads);
        Ok(wait)
    }

    /// Takes groups in.
    fn accept(&mut self, wires: &mut Wires, card: &mut Card) -> Tick {
        let mut did = Tick::Starved;
        let mut budget = self.rate.quads_per_cycle;
        while let Some(token) = wires.front(&self.input) {
            if self.entries.len() as u32 >= self.rate.queue {
                return did.or(Tick::Blocked);
            }
            let mut wait = Wait::Nothing;
            if token.kind == Kind::DATA {
                if budget == 0 {
                    return Tick::Moved;
                }
                wait = match self.ask(wires, card, token) {
                    Ok(wait) => wait,
                    Err(stall) => return did.or(stall),
                };
                budget = budget.saturating_sub(u32::from(token.quads));
            }
            self.entries.push_back(EarlyGroup { token, wait, from: wires.now() + Cycle::from(self.rate.latency) });
            wires.take(&self.input);
            did = Tick::Moved;
        }
        did
    }

    /// Sends on what is tested and lives.
    fn drain(&mut self, wires: &mut Wires, card: &mut Card) -> Tick {
        let mut did = Tick::Starved;
        let rate = u64::from(self.rate.quads_per_cycle);
        while let Some(&EarlyGroup { mut token, wait, from }) = self.entries.front() {
            if from > wires.now() {
                wires.sleep_until(from);
                return did.or(Tick::Working);
            }
            let come = match (&mut self.known, wait) {
                (DepthSource::Copy(cache), Wait::Block(place)) => cache.ready(place as usize),
                _ => wait != Wait::Answer,
            };
            if !come {
                return did.or(Tick::Memory);
            }
            if self.free_at >= (wires.now() + 1) * rate {
                wires.sleep_until(self.free_at / rate);
                return did.or(Tick::Working);
            }
            if !wires.can_push(&self.output) {
                return did.or(Tick::Blocked);
            }
            self.entries.pop_front();
            self.first = self.first.wrapping_add(1);
            did = Tick::Moved;
            if token.kind != Kind::DATA {
                wires.push_sized(&self.output, token, bytes::MARK);
                continue;
            }
            if wait != Wait::Nothing {
                self.free_at = self.free_at.max(wires.now() * rate) + u64::from(token.quads.max(1));
                token.quads = self.test(card, token, wait);
            }
            if token.quads == 0 {
                card.groups[usize::from(token.pool)].remove(token.group);
            } else {
                wires.push_sized(&self.output, token, u32::from(token.quads) * bytes::QUAD);
            }
        }
        did
    }

    /// Tests a group, or takes note of what the owner has found; gives the quads still alive.
    fn test(&mut self, card: &mut Card, token: GroupToken, wait: Wait) -> u8 {
        let Card { groups, work, passes, class_state: ClassState { seen, .. }, funnel, notes, .. } = card;
        let group = &mut groups[usize::from(token.pool)][token.group];
        let work = work[usize::from(group.slot)].as_ref().expect("a group's segment is in flight");
        let quads = &work.segment.tiles[group.tile as usize].quads[group.first as usize..][..usize::from(group.count)];
        if let (DepthSource::Copy(cache), Wait::Block(place)) = (&mut self.known, wait)
            && let (Some(state), Some(pass)) = (&work.ahead, passes.get(work.pass))
            && let Some(surface) = pass.depth
        {
            let store = &mut seen[usize::from(self.pipeline)].stores[surface];
            let alive = test_ahead(state, work, group, pass.blocks_across, store);
            cache.release(place as usize, state.writes_depth() && alive > 0);
        }
        let alive = group.live.iter().filter(|&&live| live != 0).count() as u8;
        let before: u32 = quads.iter().map(|quad| fragments(quad.coverage)).sum();
        let after: u32 = group.live.iter().map(|&live| fragments(live)).sum();
        self.items += u64::from(token.quads);
        self.counts.answered += u64::from(token.quads);
        self.counts.culled += u64::from(token.quads - alive);
        self.counts.culled_fragments += u64::from(before - after);
        funnel[group.slot].quads_early_culled += u64::from(token.quads - alive);
        if let Some(notes) = notes {
            note(notes, passes.get(work.pass), group.block, |block| block.early += u32::from(token.quads - alive));
        }
        alive
    }
}

impl Unit<Card> for Early {
    fn tick(&mut self, wires: &mut Wires, card: &mut Card) -> Tick {
        // 1. Depths come, and requests for them go.
        let mut did = Tick::moved_or(self.exchange(wires), Tick::Starved);

        // 2. Groups that have their depths are tested and go on.
        did = did.or(self.drain(wires, card));

        // 3. The next ones ask for theirs.
        did.or(self.accept(wires, card))
    }

    fn items(&self) -> u64 {
        self.items
    }

    fn resident(&self) -> u64 {
        let requests = if let DepthSource::Copy(cache) = &self.known { cache.resident() } else { 0 };
        self.entries.len() as u64 + requests
    }

    fn counted(groups: &mut Counted<Self>) {
        groups.group(EARLY_TESTS, |unit| unit.counts);
        groups.group_if(CACHES.named("early"), |unit| Some(unit.copy()?.cache()));
        groups.group_if(ROP.named("early"), |unit| Some(unit.copy()?.counts()));
    }
}
