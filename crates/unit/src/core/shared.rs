//! Workgroup memory of a core: its banks, and the latency of an access.
//!
//! Word `w` lies in bank `w` modulo the banks. A bank has a word for a warp in a cycle, which all invocations get that ask for it. So an access
//! of a warp occupies the memory for as many cycles as the bank with most different words among those of the access. An atomic changes its
//! word for each invocation by itself.

use std::collections::VecDeque;

use super::CoreConfig;
use crate::card::Card;
use crate::warp::Item;
use num::{Cycle, NEVER};
use stats::Heading;
use work::{Request, RequestKind, Service, ServiceMap};

/// The heading of workgroup memory in the statistics.
pub const SHARED: Heading = Heading::new("shading.shared[i]", "Workgroup memory.");

stats::counters! {
    /// What the workgroup memory of a core counts.
    pub struct SharedCounts {
        /// Accesses of warps.
        accesses: "accesses",
        /// Cycles that banks have for them.
        cycles: "cycles",
        /// Of these, the cycles after the first of an access: words that one bank has to give after another.
        conflicts: "cycles",
    }
}

/// The services that the parts of a warp ask at the end of its current step.
#[cold]
pub(super) fn asks(card: &Card, cluster: usize, number: u32) -> ServiceMap<bool> {
    let warp = &card.warps[cluster][number];
    let mut asks = ServiceMap::default();
    for (part, item) in warp.items.iter().enumerate() {
        if let Some(service) = warp.then(warp.step, part, || card.cost(warp, item)).service() {
            asks[service] = true;
        }
    }
    // Parts that have nothing left to ask are answered like the others.
    if asks == ServiceMap::default() {
        asks[Service::Texture] = true;
    }
    asks
}

/// The workgroup memory of a core.
#[derive(Clone, Debug)]
pub(super) struct SharedMemory {
    banks: u32,
    latency: Cycle,
    /// When the banks take the next access.
    free_at: Cycle,
    /// The cycles at which accesses are answered, and the places of their warps, in order.
    answers: VecDeque<(Cycle, u32)>,
    /// Words of the access, and how many of each bank.
    words: Vec<u32>,
    of_bank: Vec<u32>,
    counts: SharedCounts,
}

impl SharedMemory {
    pub fn new(config: &CoreConfig) -> SharedMemory {
        SharedMemory {
            banks: config.shared_banks.max(1),
            latency: Cycle::from(config.shared_latency),
            free_at: 0,
            answers: VecDeque::new(),
            words: Vec::new(),
            of_bank: vec![0; config.shared_banks.max(1) as usize],
            counts: SharedCounts::default(),
        }
    }

    pub fn counts(&self) -> SharedCounts {
        self.counts
    }

    /// The place whose access is answered next, if one is by now.
    pub fn answer(&mut self, now: Cycle) -> Option<u32> {
        let &(at, place) = self.answers.front()?;
        (at <= now).then(|| {
            self.answers.pop_front();
            place
        })
    }

    /// When the next access is answered; [`NEVER`] if there is none.
    pub fn next_answer(&self) -> Cycle {
        self.answers.front().map_or(NEVER, |&(at, _)| at)
    }

    /// A warp accesses the memory with the request of its current step. An access without conflicts is answered after the latency.
    pub fn access(&mut self, card: &mut Card, cluster: usize, number: u32, place: u32, now: Cycle) {
        self.words.clear();
        let mut atomic = false;
        let (step, parts) = (card.warps[cluster][number].step, card.warps[cluster][number].items.len());
        for part in 0..parts {
            let warp = &card.warps[cluster][number];
            let item = warp.items[part];
            let kind = warp.then(step, part, || card.cost(warp, &item));
            if kind != RequestKind::Shared {
                continue;
            }
            let (request, words) = request(card, warp.slot, &item);
            atomic |= request.operations == 0;
            for k in 0..u32::from(request.operations.max(1)) {
                self.words.extend(words.iter().map(|word| word + k));
            }
            card.warps[cluster][number].items[part].next[Service::Shared] += 1;
        }
        let cycles = self.cycles(atomic);
        self.counts.accesses += 1;
        self.counts.cycles += cycles;
        self.counts.conflicts += cycles - 1;
        self.free_at = self.free_at.max(now) + cycles;
        self.answers.push_back((self.free_at - 1 + self.latency, place));
    }

    /// Cycles that the banks need for the words of an access.
    fn cycles(&mut self, atomic: bool) -> Cycle {
        if !atomic {
            self.words.sort_unstable();
            self.words.dedup();
        }
        self.of_bank.fill(0);
        for word in &self.words {
            self.of_bank[(word % self.banks) as usize] += 1;
        }
        Cycle::from(self.of_bank.iter().copied().max().unwrap_or(0).max(1))
    }
}

/// The access of a part of a workgroup's warp, and its words.
fn request<'a>(card: &'a Card, slot: u16, item: &Item) -> (&'a Request, &'a [u32]) {
    let groups = &card.compute(slot).groups;
    let request = &groups.shared[item.next[Service::Shared] as usize];
    (request, &groups.words[request.first_line as usize..][..usize::from(request.lines)])
}
