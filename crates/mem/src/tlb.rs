//! Translation of addresses: translation look-aside buffers (TLBs) between the clients' ports and the crossbar.
//!
//! Each port has a first level of its own, and all of them share a second one. A request whose page the first level has is not held up. Any other
//! steps aside until its translation is there, and those behind it go on: a translation that the second level has takes
//! [`TlbConfig::second_latency`], and a walk of the page tables [`TlbConfig::walk_latency`] more. Requests to a page whose translation is under way wait
//! for it. A walk takes a fixed time: what it reads occupies neither the second-level cache nor DRAM.

use std::collections::VecDeque;

use super::port::Request;
use knob::Allowed;
use num::Cycle;
use stats::Heading;

knob::knobs! {
    /// Translation of addresses.
    #[derive(Copy)]
    pub struct TlbConfig {
        /// Pages of the first level of each port, any page anywhere; 0: addresses are not translated.
        entries: u32 ["pages", Allowed::Range(0, 4096), "16 of 128 KB: the first level covers about 2 MB on Kepler and Maxwell (Jia et al. 2019, table 3.1)"]
            {estimate: Ignored("cycles hardly depend on it"), relax: Room, advice: []},
        /// Bytes of a page of the first level.
        page_bytes: u32 ["bytes", Allowed::PowerOfTwo(4096, 67108864), "128 KB on Kepler and Maxwell (Jia et al. 2019, table 3.1)"]
            {estimate: RefusedUnless(AtLeast(8192), "translation of addresses"), relax: Never, advice: []},
        /// Pages of the second level, which all ports share, any page anywhere.
        second_entries: u32 ["pages", Allowed::Range(1, 4096), "64 of 2 MB: the second level covers about 128 MB on Kepler and Maxwell (Jia et al. 2019, table 3.1)"]
            {estimate: Ignored("cycles hardly depend on it"), relax: Never, advice: []},
        /// Bytes of a page of the second level, at least those of the first.
        second_page_bytes: u32 ["bytes", Allowed::PowerOfTwo(4096, 67108864), "2 MB on Kepler and Maxwell (Jia et al. 2019, table 3.1)"]
            {estimate: RefusedUnless(AtLeast(262144), "translation of addresses"), relax: Never, advice: []},
        /// Cycles that a translation takes which the first level lacks and the second has.
        second_latency: u32 ["cycles", Allowed::Range(1, 4096), "assumed: less than the way to the second-level cache and back"]
            {estimate: RefusedUnless(Between(32, 64), "translation of addresses"), relax: Never, advice: []},
        /// Cycles that a walk of the page tables takes in addition.
        walk_latency: u32 ["cycles", Allowed::Range(1, 16384), "an access takes 616 cycles where no TLB has its page, and 296 where one does (Jia et al. 2019, fig. 3.5: T4; not measured on Maxwell)"]
            {estimate: RefusedUnless(AtMost(512), "translation of addresses"), relax: Never, advice: []},
        /// Requests of a port that wait for translations.
        queue: u32 ["requests", Allowed::Range(1, 4096), "assumed: as many misses as a texture unit has under way"]
            {estimate: Ignored("cycles hardly depend on it"), relax: Room, advice: []},
    }
}

/// Where translations count.
pub const TLB: Heading = Heading::new("memory.tlb", "Translation of addresses.");

stats::counters! {
    /// What translation has done.
    pub struct TlbCounts {
        /// Translations that a port's first level lacked.
        misses: "translations",
        /// Those of them that the second level lacked too.
        walks: "translations",
        /// Requests that waited for a translation.
        waits: "requests",
    }
}

/// A translation.
#[derive(Clone, Copy, Debug)]
struct CachedPage {
    page: u64,
    used: u64,
    /// When it is there.
    ready: Cycle,
}

/// One buffer: the least recently used page goes.
#[derive(Clone, Debug)]
struct Buffer {
    entries: Vec<CachedPage>,
    capacity: usize,
    shift: u32,
    clock: u64,
    /// Where the last page was found: most requests are to it.
    last: usize,
}

impl Buffer {
    fn new(entries: u32, page_bytes: u32) -> Buffer {
        let shift = page_bytes.trailing_zeros();
        Buffer { entries: Vec::with_capacity(entries as usize), capacity: entries as usize, shift, clock: 0, last: 0 }
    }

    /// When the translation of an address is there, if it is known or under way.
    fn find(&mut self, address: u64) -> Option<Cycle> {
        let page = address >> self.shift;
        if self.entries.get(self.last).is_none_or(|entry| entry.page != page) {
            self.last = self.entries.iter().position(|entry| entry.page == page)?;
        }
        self.clock += 1;
        let entry = &mut self.entries[self.last];
        entry.used = self.clock;
        Some(entry.ready)
    }

    fn put(&mut self, address: u64, ready: Cycle) {
        self.clock += 1;
        let entry = CachedPage { page: address >> self.shift, used: self.clock, ready };
        if self.entries.len() < self.capacity {
            self.entries.push(entry);
        } else if let Some(oldest) = self.entries.iter_mut().min_by_key(|entry| entry.used) {
            *oldest = entry;
        }
    }
}

/// The translation of the addresses of all ports.
#[derive(Clone, Debug)]
pub(super) struct Translation {
    config: TlbConfig,
    first: Vec<Buffer>,
    second: Buffer,
    /// Requests of each port that wait, in the order in which they came, and until when.
    waiting: Vec<VecDeque<(Cycle, Request)>>,
    counts: TlbCounts,
}

impl Translation {
    /// That of a number of ports; none where addresses are not translated.
    pub fn new(config: TlbConfig, ports: usize) -> Option<Translation> {
        (config.entries > 0).then(|| Translation {
            config,
            first: vec![Buffer::new(config.entries, config.page_bytes); ports],
            second: Buffer::new(config.second_entries, config.second_page_bytes),
            waiting: vec![VecDeque::new(); ports],
            counts: TlbCounts::default(),
        })
    }

    /// What it has done.
    pub fn counts(&self) -> TlbCounts {
        self.counts
    }

    /// Requests that wait.
    pub fn resident(&self) -> u64 {
        self.waiting.iter().map(|waiting| waiting.len() as u64).sum()
    }

    /// Until when the request waits that waits for the shortest time.
    pub fn next(&self) -> Option<Cycle> {
        self.waiting.iter().flatten().map(|&(ready, _)| ready).min()
    }

    /// Until when the request at the head of a port has to wait, if it does. Its translation begins, if none is under way.
    pub fn waits_until(&mut self, port: usize, address: u64, now: Cycle) -> Option<Cycle> {
        let ready = match self.first[port].find(address) {
            Some(ready) => ready,
            None => {
                let begin = match self.second.find(address) {
                    Some(ready) => ready.max(now),
                    None => {
                        let ready = now + Cycle::from(self.config.walk_latency);
                        self.second.put(address, ready);
                        self.counts.walks += 1;
                        ready
                    }
                };
                let ready = begin + Cycle::from(self.config.second_latency);
                self.first[port].put(address, ready);
                self.counts.misses += 1;
                ready
            }
        };
        (ready > now).then_some(ready)
    }

    /// Has the page of an address of a port looked up without any time: both levels know it then, and nothing is counted.
    pub fn visit(&mut self, port: usize, address: u64) {
        if self.first[port].find(address).is_some() {
            return;
        }
        self.first[port].put(address, 0);
        if self.second.find(address).is_none() {
            self.second.put(address, 0);
        }
    }

    /// Whether one more request of a port can wait.
    pub fn has_room(&self, port: usize) -> bool {
        self.waiting[port].len() < self.config.queue as usize
    }

    /// A request of a port steps aside.
    pub fn wait(&mut self, port: usize, request: Request, until: Cycle) {
        self.waiting[port].push_back((until, request));
        self.counts.waits += 1;
    }

    /// The oldest request of a port that has waited long enough, by its place.
    pub fn translated(&self, port: usize, now: Cycle) -> Option<(usize, Request)> {
        let mut waiting = self.waiting[port].iter().enumerate();
        waiting.find(|(_, (ready, _))| *ready <= now).map(|(place, &(_, request))| (place, request))
    }

    /// The request in a place of a port goes on.
    pub fn take(&mut self, port: usize, place: usize) {
        self.waiting[port].remove(place);
    }
}
