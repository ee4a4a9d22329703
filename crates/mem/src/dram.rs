//! A DRAM channel: banks, rows, a scheduler that serves row hits first, and refresh.
//!
//! Time inside is counted in the DRAM's own clock, whose ratio to the card's is any fraction. The channel issues its commands in
//! the order of their time: a precharge as soon as no request in the window wants the open row any more, an activation when
//! tRP, tRRD and tFAW allow it, a column access when tRCD and the data bus do. Banks prepare their rows while others transfer.
//! (A reservation of whole transactions, bank after bank, was rejected: it holds back activations that could go first.)
//!
//! Reads and writes wait in queues of their own, and the channel serves one of the two at a time. Writes, for which nobody waits, go when
//! there are no reads, or together once their queue is filled to its high watermark.

use std::collections::VecDeque;

use super::port::{DramAnswer, DramRequest};
use knob::Allowed;
use num::{Cycle, NEVER};
use sim::{In, Out, Tick, Unit, Wires};
use stats::{Declaration, Heading};

knob::choices! {
    /// When a bank's row is closed that no request in the queues wants.
    pub enum PagePolicy {
        /// Once another row of the bank is wanted.
        Open "open",
        /// When it has not been used for a time.
        Idle "idle",
        /// At once.
        Closed "closed",
    }
}

knob::choices! {
    /// What a refresh closes and holds up.
    pub enum RefreshScope {
        /// All banks of the channel.
        AllBanks "all-banks",
        /// One bank, the banks in turn.
        PerBank "per-bank",
    }
}

knob::knobs! {
    /// DRAM. Times are in cycles of its command clock.
    #[derive(Copy)]
    pub struct DramConfig {
        /// Channels.
        channels: u32 ["channels", Allowed::Range(1, 64), "256 bits of GDDR5 in channels of 32 (NVIDIA 2014, GeForce GTX 980 white paper, p. 7)"]
            {estimate: Used, relax: Bandwidth, advice: []},
        /// Cycles of the DRAM's command clock in `card_cycles` of the card.
        clock: u32 ["cycles", Allowed::Range(1, 10000), "1,753 MHz: GDDR5 of 7 Gbit/s a pin (NVIDIA 2014, GeForce GTX 980 white paper, p. 7)"]
            {estimate: Used, relax: Never, advice: []},
        /// Cycles of the card in which the DRAM's clock ticks `clock` times.
        card_cycles: u32 ["cycles", Allowed::Range(1, 10000), "assumed: 1,126 MHz: see clock"] {estimate: Used, relax: Never, advice: []},
        /// Cycles of the card from a slice to the queues of its channel, and from the last data of a read back to the slice: controller, PHY and
        /// wires.
        latency: u32 ["cycles", Allowed::Range(1, 1024), "60: an access of DRAM takes 150 cycles more than an L2 hit on Maxwell (357 against 207; Arafa et al. 2019, Jia et al. 2019), 30 of them in the chip"]
            {estimate: RefusedUnless(AtMost(512), "latencies of a slow memory"), relax: Latency, advice: []},
        /// Banks of a channel.
        banks: u32 ["banks", Allowed::Range(1, 64), "16 (GDDR5, JESD212)"]
            {estimate: RefusedUnless(AtLeast(8), "conflicts of banks"), relax: Never, advice: []},
        /// Groups of banks. Neighbouring banks are of different groups.
        bank_groups: u32 ["groups", Allowed::PowerOfTwo(1, 16), "4 (GDDR5, JESD212); 1 in memory without bank groups"]
            {estimate: Ignored("cycles hardly depend on it"), relax: Never, advice: []},
        /// Bytes of a row.
        row_bytes: u32 ["bytes", Allowed::PowerOfTwo(256, 65536), "2 KB (GDDR5); ATTILA bGPU.ini V2MemoryRowSize = 2048"]
            {estimate: Ignored("cycles hardly depend on it"), relax: Never, advice: []},
        /// Bytes of a burst.
        burst_bytes: u32 ["bytes", Allowed::PowerOfTwo(8, 256), "burst of 8 on 32 bits"] {estimate: Used, relax: Never, advice: []},
        /// Cycles of a burst on the data bus.
        burst_cycles: u32 ["DRAM cycles", Allowed::Range(1, 64), "8 beats, 4 a command clock"]
            {estimate: Used, relax: Interval, advice: []},
        /// Burst to burst of one bank group. Without effect where there is one group, or where it is no longer than a burst.
        t_ccd_l: u32 ["DRAM cycles", Allowed::Range(1, 64), "tCCDL of GDDR5: 3 cycles, one more than a burst (Hynix H5GQ1H24AFR)"]
            {estimate: RefusedUnless(AtMost(3), "bursts of bank groups"), relax: Interval, advice: []},
        /// Activation to column access.
        t_rcd: u32 ["DRAM cycles", Allowed::Range(1, 1000), "12 ns (Hynix H5GQ1H24AFR)"] {estimate: RefusedUnless(AtMost(500), "latencies of a slow memory"), relax: Latency, advice: []},
        /// Precharge to activation.
        t_rp: u32 ["DRAM cycles", Allowed::Range(1, 1000), "12 ns"]
            {estimate: RefusedUnless(AtMost(72), "misses of rows"), relax: Latency, advice: []},
        /// Column read to its data.
        cl: u32 ["DRAM cycles", Allowed::Range(1, 1000), "12 ns"] {estimate: RefusedUnless(AtMost(250), "latencies of a slow memory"), relax: Latency, advice: []},
        /// Column write to its data.
        cwl: u32 ["DRAM cycles", Allowed::Range(1, 1000), "assumed: 4 cycles"] {estimate: Used, relax: Latency, advice: []},
        /// Activation to precharge.
        t_ras: u32 ["DRAM cycles", Allowed::Range(1, 1000), "28 ns"]
            {estimate: RefusedUnless(AtMost(126), "rows that stay open"), relax: Latency, advice: []},
        /// Activation to activation of another bank.
        t_rrd: u32 ["DRAM cycles", Allowed::Range(1, 1000), "6 ns"]
            {estimate: RefusedUnless(AtMost(14), "a limit on activations"), relax: Latency, advice: []},
        /// A window with at most four activations.
        t_faw: u32 ["DRAM cycles", Allowed::Range(1, 1000), "23 ns"]
            {estimate: RefusedUnless(AtMost(56), "a limit on activations"), relax: Latency, advice: []},
        /// Read to precharge.
        t_rtp: u32 ["DRAM cycles", Allowed::Range(1, 1000), "assumed: 2 cycles"]
            {estimate: RefusedUnless(AtMost(64), "misses of rows"), relax: Latency, advice: []},
        /// End of write data to precharge.
        t_wr: u32 ["DRAM cycles", Allowed::Range(1, 1000), "12 ns"]
            {estimate: RefusedUnless(AtMost(72), "misses of rows"), relax: Latency, advice: []},
        /// End of write data to a read.
        t_wtr: u32 ["DRAM cycles", Allowed::Range(1, 1000), "5 ns"] {estimate: Used, relax: Latency, advice: []},
        /// End of read data to write data.
        t_rtw: u32 ["DRAM cycles", Allowed::Range(0, 1000), "assumed: turn of the bus"] {estimate: Used, relax: Latency, advice: []},
        /// What a refresh closes and holds up.
        refresh: RefreshScope ["", Allowed::Choice(RefreshScope::NAMES), "GDDR5 refreshes all banks (JESD212); LPDDR4, HBM and GDDR6 can refresh one"]
            {estimate: RefusedUnless(Is(&["all-banks"]), "refreshes of single banks"), relax: Never, advice: []},
        /// Length of a refresh.
        t_rfc: u32 ["DRAM cycles", Allowed::Range(0, 10000), "65 ns"]
            {estimate: RefusedUnless(AtMost(625), "long refreshes"), relax: Never, advice: []},
        /// Refresh to refresh of a bank; 0 for none.
        t_refi: u32 ["DRAM cycles", Allowed::Range(0, 1000000), "1.9 us"] {estimate: Used, relax: Never, advice: []},
        /// When a row is closed that no request wants.
        page: PagePolicy ["", Allowed::Choice(PagePolicy::NAMES), "open rows serve streams; ATTILA's controller closes them (bGPU.ini V2PagePolicy = 0)"]
            {estimate: RefusedUnless(Is(&["open"]), "rows that are closed early"), relax: Never, advice: []},
        /// From the last access to a row to its end, where `page` is idle.
        page_idle: u32 ["DRAM cycles", Allowed::Range(1, 65535), "assumed: about tRC, the time that a row takes to be opened anew"]
            {estimate: Ignored("without effect where memory.dram.page is open"), relax: Never, advice: []},
        /// Reads among which the scheduler chooses.
        window: u32 ["requests", Allowed::Range(1, 64), "assumed; ATTILA bGPU.ini V2MaxChannelTransactions = 64"]
            {estimate: Ignored("cycles hardly depend on it"), relax: Never, advice: []},
        /// Writes that wait in the queue of writes.
        write_queue: u32 ["requests", Allowed::Range(1, 64), "64 (Chatterjee et al. 2012, USIMM; gem5 write_buffer_size)"]
            {estimate: Ignored("cycles hardly depend on it"), relax: Room, advice: []},
        /// Writes in their queue from which on they go first; all of its places, where it has fewer.
        write_high: u32 ["requests", Allowed::Range(1, 64), "40 of 64 (USIMM's high watermark); gem5 85 %"]
            {estimate: Used, relax: Never, advice: []},
        /// Writes in their queue with which reads go first again. Where that is not fewer than `write_high`, it is half of `write_high`.
        write_low: u32 ["requests", Allowed::Range(0, 63), "20 of 64 (USIMM's low watermark); gem5 50 %"]
            {estimate: Used, relax: Never, advice: []},
        /// Whether bank numbers are mixed with row bits.
        hash_banks: bool ["", Allowed::Switch, "permutation-based interleaving (Zhang et al. 2000)"]
            {estimate: Ignored("cycles hardly depend on it"), relax: Never, advice: []},
    }
}

impl DramConfig {
    /// One channel of DDR4-3200 (JEDEC JESD79-4, speed bin 22-22-22), in cycles of its own clock, which is the card's.
    pub fn ddr4_3200() -> DramConfig {
        DramConfig {
            channels: 1,
            clock: 1,
            card_cycles: 1,
            latency: 1,
            banks: 16,
            row_bytes: 8192,
            burst_bytes: 64,
            burst_cycles: 4,
            t_rcd: 22,
            t_rp: 22,
            cl: 22,
            cwl: 16,
            t_ras: 52,
            t_rrd: 4,
            t_faw: 34,
            t_rtp: 12,
            t_wr: 24,
            t_wtr: 12,
            t_rtw: 2,
            refresh: RefreshScope::AllBanks,
            t_rfc: 560,
            t_refi: 12480,
            bank_groups: 1,
            t_ccd_l: 4,
            page: PagePolicy::Open,
            page_idle: 100,
            window: 64,
            write_queue: 64,
            write_high: 40,
            write_low: 20,
            hash_banks: false,
            ..DramConfig::default()
        }
    }
}

/// The use of the data buses.
pub const BUSY_CYCLES: Declaration = Declaration::new(
    "busy_cycles",
    "cycles",
    "Cycles of the card in which the data buses carried data, the sum over the channels.",
);

/// Where DRAM counts.
pub const DRAM: Heading = Heading::new("memory.dram", "All DRAM channels together (or the ideal memory).");

stats::counters! {
    /// What a channel counts.
    pub struct DramCounts {
        /// Bytes read, in whole bursts.
        read_bytes: "bytes",
        /// Bytes written, in whole bursts.
        write_bytes: "bytes",
        /// Bursts of a row that was open.
        row_hits: "bursts",
        /// Bursts that had their row opened for them.
        row_misses: "bursts",
        /// Cycles of the data bus that carried data, in DRAM clock cycles.
        bus_cycles: "DRAM cycles",
        /// Refreshes that held up requests.
        refreshes: "refreshes",
    }
}

/// Most bytes of a request: the longest line of a second-level cache.
const LONGEST: u32 = 256;

/// A request in a queue.
#[derive(Clone, Copy, Debug, Default)]
struct Queued {
    row: u64,
    bank: u32,
    /// Bursts that have still to go.
    bursts: u32,
    id: u32,
    port: u32,
}

/// A set of slots of a queue's ring, which has twice as many as a queue holds: a request that waits long holds up later ones only when
/// they are that many.
type Slots = u128;
const RING: u32 = Slots::BITS;

/// No row is open.
const CLOSED: u64 = u64::MAX;

/// Numbers of the two queues, and of what banks note for each.
const READS: usize = 0;
const WRITES: usize = 1;

#[derive(Clone, Copy, Debug)]
struct Bank {
    row: u64,
    /// From when columns of the open row can be accessed.
    column_at: u64,
    /// From when the open row can be closed; of a closed bank, from when a row can be opened.
    ready_at: u64,
    /// When the open row was accessed last, or opened.
    used_at: u64,
    /// The first access to the row has still to come.
    fresh: bool,
    /// By queue, the slots of requests for this bank, and of those for its open row.
    queue: [Slots; 2],
    hits: [Slots; 2],
}

/// The reads or the writes that wait in a channel.
#[derive(Clone, Debug)]
struct Queue {
    requests: [Queued; RING as usize],
    /// Taken slots. Slots are taken round robin: rotated by `next`, the lowest bit is the request that came first.
    taken: Slots,
    next: u32,
    /// How many requests wait, and how many can.
    waiting: u32,
    size: u32,
    /// Banks that are closed although a request waits for one of their rows.
    closed: u64,
    /// Banks with requests for their open row.
    hitting: u64,
}

impl Queue {
    fn new(size: u32) -> Queue {
        Queue { requests: [Queued::default(); RING as usize], taken: 0, next: 0, waiting: 0, size, closed: 0, hitting: 0 }
    }

    #[inline(always)]
    fn has_room(&self) -> bool {
        self.waiting < self.size && self.taken & (1 << self.next) == 0
    }

    /// The request of a set that came first. Slots are given out in a ring, so age is distance from the next one.
    #[inline(always)]
    fn oldest(&self, slots: Slots) -> usize {
        let turned = slots.rotate_right(self.next);
        ((turned.trailing_zeros() + self.next) % RING) as usize
    }
}

/// A DRAM channel. Its items are requests.
#[derive(Clone, Debug)]
pub struct Dram {
    config: DramConfig,
    banks: Vec<Bank>,
    /// Reads and writes.
    queues: [Queue; 2],
    /// The queue that is served.
    serving: usize,
    /// Writes from which on they go first, and with which reads do again.
    write_high: u32,
    write_low: u32,
    /// The card cycle before which no command can go, found when the last of a cycle had gone and void once a request enters.
    command_at: Cycle,
    /// Earliest times of the next column access by queue, and of the next activation.
    access_at: [u64; 2],
    activate_at: u64,
    /// From a burst to the next of the same bank group, and by group, when the next can go.
    group_gap: u64,
    group_at: [u64; MAX_GROUPS],
    /// After how long a row is closed that is not used; none where it stays open.
    page_idle: Option<u64>,
    /// The ends of the windows that the last four activations opened, the oldest at `turn`.
    activations: [u64; 4],
    turn: usize,
    /// Refreshes so far, those among them that have passed unseen, and when the next is due.
    refreshes: u64,
    refresh_at: u64,
    /// Refreshes of the channel in the time between two refreshes of a bank.
    refresh_turns: u64,
    /// The end of all data so far.
    data_end: u64,
    /// Reads whose data come: the cycle, port and id.
    flight: VecDeque<(Cycle, u32, u32)>,
    /// The port whose requests enter first.
    first_port: usize,
    items: u64,
    counts: DramCounts,
    inputs: Vec<In<DramRequest>>,
    outputs: Vec<Out<DramAnswer>>,
}

/// Most groups of banks.
const MAX_GROUPS: usize = 16;

/// Values that make no channel.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[allow(missing_docs, reason = "the message explains each variant")]
pub enum DramError {
    #[error("{0}")]
    Rule(&'static str),
    #[error(
        "t_refi is {t_refi}, and must be 0 or more than {least}, so that requests are served between refreshes of t_rfc = {t_rfc}"
    )]
    Refresh { t_refi: u32, least: u64, t_rfc: u32 },
}

impl DramConfig {
    /// Whether the values make a channel.
    ///
    /// # Errors
    /// The rule that is broken.
    pub fn check(&self) -> Result<(), DramError> {
        let rules = [
            (self.clock >= 1 && self.card_cycles >= 1, "the clock ratio must be positive"),
            ((1..=64).contains(&self.banks), "banks must be 1 to 64"),
            (self.row_bytes.is_power_of_two() && self.row_bytes >= 256, "row_bytes must be a power of two of at least 256"),
            (
                self.burst_bytes.is_power_of_two() && self.burst_bytes <= self.row_bytes,
                "burst_bytes must be a power of two within a row",
            ),
            (self.burst_cycles >= 1 && self.cl >= 1 && self.cwl >= 1, "burst, cl and cwl must be positive"),
            ((1..=64).contains(&self.window), "window must be 1 to 64"),
            ((1..=64).contains(&self.write_queue), "write_queue must be 1 to 64"),
            (self.write_high >= 1, "write_high must be at least 1"),
            (
                self.bank_groups.is_power_of_two() && self.bank_groups as usize <= MAX_GROUPS,
                "bank_groups must be a power of two of at most 16",
            ),
        ];
        if let Some((_, rule)) = rules.iter().find(|(holds, _)| !holds) {
            return Err(DramError::Rule(rule));
        }
        match self.between_refreshes() {
            least if self.t_refi != 0 && u64::from(self.t_refi) <= least => {
                Err(DramError::Refresh { t_refi: self.t_refi, least, t_rfc: self.t_rfc })
            }
            _ => Ok(()),
        }
    }

    /// The longest distance between two refreshes, in DRAM cycles, that is refused. At this distance rows might be closed again and again
    /// before a request is served, or the channel would spend half of its time or more on refreshes.
    fn between_refreshes(&self) -> u64 {
        let c = |cycles: u32| u64::from(cycles);
        // 1. What was under way as the refresh came: data on the bus, rows that have to stay open.
        let bursts = c(LONGEST.div_ceil(self.burst_bytes) + 1);
        let accesses = bursts * self.group_gap();
        let data = c(self.cl.max(self.cwl)) + accesses;
        let open = c(self.t_ras).max(data + c(self.t_wr)).max(accesses + c(self.t_rtp));
        // 2. The refresh, an activation and the access to its row, which waits for the bus as well.
        let activation = (open + c(self.t_rp) + c(self.t_rfc)).max(c(self.t_faw.max(self.t_rrd)));
        let access = (activation + c(self.t_rcd)).max(data + c(self.t_wtr.max(self.t_rtw)));
        // 3. Refreshes begin where cycles of the card do; what has time within one such cycle is served in it.
        let served =
            if c(self.clock / self.card_cycles) > access { 0 } else { access + c(self.clock.div_ceil(self.card_cycles)) };
        served.max(2 * c(self.t_rfc))
    }

    /// From a burst to the next of the same bank group, in DRAM cycles.
    fn group_gap(&self) -> u64 {
        u64::from(if self.bank_groups > 1 { self.t_ccd_l.max(self.burst_cycles) } else { self.burst_cycles })
    }

    /// Writes from which on they go first: `write_high`, or as many as there is room for.
    pub fn write_high(&self) -> u32 {
        self.write_high.min(self.write_queue)
    }

    /// Writes with which reads go first again: `write_low`, or half of [`DramConfig::write_high`] where that is not fewer.
    pub fn write_low(&self) -> u32 {
        if self.write_low < self.write_high() { self.write_low } else { self.write_high() / 2 }
    }

    /// Refreshes of the channel in the time between two refreshes of a bank.
    fn refresh_turns(&self) -> u64 {
        if self.refresh == RefreshScope::PerBank { u64::from(self.banks) } else { 1 }
    }

    /// When a refresh of the channel is due, counted from 0.
    fn refresh_due(&self, number: u64) -> u64 {
        if self.t_refi == 0 { NEVER } else { (number + 1) * u64::from(self.t_refi) / self.refresh_turns() }
    }

    /// The first DRAM clock tick of a card cycle.
    #[inline(always)]
    fn ticks(&self, cycle: Cycle) -> u64 {
        cycle * u64::from(self.clock) / u64::from(self.card_cycles)
    }

    /// The card cycle in which a DRAM clock tick falls.
    #[inline(always)]
    fn cycle(&self, tick: u64) -> Cycle {
        ((tick + 1) * u64::from(self.card_cycles)).div_ceil(u64::from(self.clock)) - 1
    }

    /// Bank and row of an address within the channel.
    #[inline(always)]
    pub(crate) fn place(&self, address: u64) -> (u32, u64) {
        let index = address >> self.row_bytes.trailing_zeros();
        let banks = u64::from(self.banks);
        let (row, bank) = (index / banks, index % banks);
        let bank = if self.hash_banks { (bank + row * 5 + (row >> 4)) % banks } else { bank };
        (bank as u32, row)
    }
}

/// Calls `f` with the number of each set bit.
#[inline(always)]
fn each_bit(mut bits: u64, mut f: impl FnMut(usize)) {
    while bits != 0 {
        f(bits.trailing_zeros() as usize);
        bits &= bits - 1;
    }
}

impl Dram {
    /// A channel at rest, serving a port for each pair of channels.
    ///
    /// # Panics
    /// If the configuration does not [`check`](DramConfig::check).
    pub fn new(config: DramConfig, inputs: Vec<In<DramRequest>>, outputs: Vec<Out<DramAnswer>>) -> Dram {
        assert_eq!(config.check(), Ok(()));
        let bank = Bank { row: CLOSED, column_at: 0, ready_at: 0, used_at: 0, fresh: false, queue: [0; 2], hits: [0; 2] };
        Dram {
            banks: vec![bank; config.banks as usize],
            queues: [Queue::new(config.window), Queue::new(config.write_queue)],
            serving: READS,
            write_high: config.write_high(),
            write_low: config.write_low(),
            command_at: 0,
            access_at: [0; 2],
            activate_at: 0,
            group_gap: config.group_gap(),
            group_at: [0; MAX_GROUPS],
            page_idle: match config.page {
                PagePolicy::Open => None,
                PagePolicy::Idle => Some(u64::from(config.page_idle)),
                PagePolicy::Closed => Some(0),
            },
            activations: [0; 4],
            turn: 0,
            refreshes: 0,
            refresh_at: config.refresh_due(0),
            refresh_turns: config.refresh_turns(),
            data_end: 0,
            flight: VecDeque::with_capacity(256),
            first_port: 0,
            items: 0,
            counts: DramCounts::default(),
            config,
            inputs,
            outputs,
        }
    }

    /// What it has counted.
    pub fn counts(&self) -> DramCounts {
        self.counts
    }

    /// Card cycles' worth of data on the bus.
    pub fn busy_cycles(&self) -> u64 {
        self.counts.bus_cycles * u64::from(self.config.card_cycles) / u64::from(self.config.clock)
    }

    /// Requests in both queues.
    #[inline(always)]
    fn waiting(&self) -> u32 {
        self.queues[READS].waiting + self.queues[WRITES].waiting
    }

    /// Chooses the queue to serve after the queues have changed. Banks whose open row only the other queue wants are closed then.
    #[inline(always)]
    fn choose_queue(&mut self, time: u64) {
        let [reads, writes] = [self.queues[READS].waiting, self.queues[WRITES].waiting];
        let enough = if self.serving == WRITES { self.write_low + 1 } else { self.write_high };
        let serving = if writes > 0 && (reads == 0 || writes >= enough) { WRITES } else { READS };
        if serving != self.serving {
            self.serving = serving;
            for number in 0..self.banks.len() {
                self.precharge(number, time);
            }
        }
    }

    /// Closes a bank's row if requests of the queue that is served wait for the bank but none for that row.
    #[inline(always)]
    fn precharge(&mut self, number: usize, time: u64) {
        self.close_unused(number, time);
        let bank = &self.banks[number];
        if bank.row != CLOSED && bank.hits[self.serving] == 0 && bank.queue[self.serving] != 0 {
            self.close(number, time);
        }
    }

    /// Closes the row of a bank for which there are no requests, if it has not been used for so long that the page policy closes it. That
    /// has happened before: it is found out when the bank is looked at again.
    #[inline(always)]
    fn close_unused(&mut self, number: usize, time: u64) {
        let Some(idle) = self.page_idle else { return };
        let bank = &self.banks[number];
        let closes = bank.used_at + idle;
        if bank.row != CLOSED && bank.hits == [0; 2] && closes <= time {
            self.close(number, closes);
        }
    }

    /// Closes a bank's row at a time, or as soon after it as the row can be closed.
    #[inline(always)]
    fn close(&mut self, number: usize, time: u64) {
        let bank = &mut self.banks[number];
        bank.row = CLOSED;
        bank.hits = [0; 2];
        bank.ready_at = bank.ready_at.max(time) + u64::from(self.config.t_rp);
        for (queue, requests) in self.queues.iter_mut().zip(bank.queue) {
            queue.hitting &= !(1 << number);
            queue.closed |= u64::from(requests != 0) << number;
        }
    }

    /// The bank that opens a row next, and when: that of the oldest request among the banks that can go first. Any bank, and no
    /// later than it will be, if that is at `end` or later. Rows for the queue that is not served would be closed again.
    #[inline(always)]
    fn next_activation(&self, time: u64, end: u64) -> Option<(u64, usize)> {
        let queue = &self.queues[self.serving];
        if queue.closed == 0 {
            return None;
        }
        let floor = time.max(self.activate_at);
        if floor >= end {
            return Some((floor, 0));
        }
        let mut ready = 0;
        let mut soonest = (NEVER, 0);
        each_bit(queue.closed, |number| {
            let bank = &self.banks[number];
            if bank.ready_at <= floor {
                ready |= bank.queue[self.serving];
            } else if bank.ready_at < soonest.0 {
                soonest = (bank.ready_at, number);
            }
        });
        if ready != 0 { Some((floor, queue.requests[queue.oldest(ready)].bank as usize)) } else { Some(soonest) }
    }

    #[inline(always)]
    fn activate(&mut self, number: usize, at: u64) {
        let queue = &self.queues[self.serving];
        let row = queue.requests[queue.oldest(self.banks[number].queue[self.serving])].row;
        let bank = &mut self.banks[number];
        bank.row = row;
        bank.fresh = true;
        bank.column_at = at + u64::from(self.config.t_rcd);
        bank.ready_at = at + u64::from(self.config.t_ras);
        bank.used_at = at;
        for (which, queue) in self.queues.iter_mut().enumerate() {
            let (mut hits, mut slots) = (0, bank.queue[which]);
            while slots != 0 {
                let slot = slots.trailing_zeros();
                hits |= Slots::from(queue.requests[slot as usize].row == row) << slot;
                slots &= slots - 1;
            }
            bank.hits[which] = hits;
            queue.closed &= !(1 << number);
            queue.hitting |= u64::from(hits != 0) << number;
        }
        // The ring holds from when a fifth activation may follow each of the last four.
        self.activations[self.turn] = at + u64::from(self.config.t_faw);
        self.turn = (self.turn + 1) & 3;
        self.activate_at = (at + u64::from(self.config.t_rrd)).max(self.activations[self.turn]);
    }

    /// The access that goes next, and when: the oldest among the row hits that can go first. Any, and no later than it will be, if
    /// that is at `end` or later.
    #[inline(always)]
    fn next_access(&self, time: u64, end: u64) -> Option<(u64, usize)> {
        let queue = &self.queues[self.serving];
        if queue.hitting == 0 {
            return None;
        }
        let bus = time.max(self.access_at[self.serving]);
        if bus >= end {
            return Some((bus, 0));
        }
        let mut ready = 0;
        let mut soonest = (NEVER, 0);
        each_bit(queue.hitting, |number| {
            let bank = &self.banks[number];
            let from = bank.column_at.max(self.group_at[number & (self.config.bank_groups as usize - 1)]);
            if from <= bus {
                ready |= bank.hits[self.serving];
            } else if from < soonest.0 {
                soonest = (from, number);
            }
        });
        if ready != 0 {
            Some((bus, queue.oldest(ready)))
        } else {
            Some((soonest.0, queue.oldest(self.banks[soonest.1].hits[self.serving])))
        }
    }

    /// The bursts of a request go, or one of them where others can go before the next.
    #[inline(always)]
    fn access(&mut self, slot: usize, at: u64) {
        let c = &self.config;
        let serving = self.serving;
        let request = &mut self.queues[serving].requests[slot];
        let bursts = if self.group_gap > u64::from(c.burst_cycles) { 1 } else { request.bursts };
        request.bursts -= bursts;
        let request = *request;
        let number = request.bank as usize;
        let bank = &mut self.banks[number];
        let length = u64::from(bursts * c.burst_cycles);
        let bytes = u64::from(bursts * c.burst_bytes);
        let start = at + u64::from(if serving == WRITES { c.cwl } else { c.cl });
        let end = start + length;
        self.data_end = end;
        self.access_at[serving] = at + length;
        self.group_at[number & (c.bank_groups as usize - 1)] = at + self.group_gap;
        if serving == WRITES {
            bank.ready_at = bank.ready_at.max(end + u64::from(c.t_wr));
            self.access_at[READS] = (end + u64::from(c.t_wtr)).max(self.access_at[READS]);
            self.counts.write_bytes += bytes;
        } else {
            bank.ready_at = bank.ready_at.max(at + length - u64::from(c.burst_cycles) + u64::from(c.t_rtp));
            let turned = (end + u64::from(c.t_rtw)).saturating_sub(u64::from(c.cwl));
            self.access_at[WRITES] = turned.max(self.access_at[WRITES]);
            self.counts.read_bytes += bytes;
        }
        self.counts.row_hits += u64::from(bursts - u32::from(bank.fresh));
        self.counts.row_misses += u64::from(bank.fresh);
        self.counts.bus_cycles += length;
        bank.fresh = false;
        bank.used_at = at + length;
        if request.bursts > 0 {
            return;
        }
        if serving == WRITES {
            self.items += 1;
        } else {
            // The data are there when the last of them has gone over the bus.
            self.flight.push_back((c.cycle(end - 1) + 1, request.port, request.id));
        }
        bank.queue[serving] &= !(1 << slot);
        bank.hits[serving] &= !(1 << slot);
        let queue = &mut self.queues[serving];
        queue.waiting -= 1;
        queue.taken &= !(1 << slot);
        if bank.hits[serving] == 0 {
            queue.hitting &= !(1 << number);
        }
        self.choose_queue(at);
        self.precharge(number, at);
    }

    /// All banks, or the one whose turn it is, are closed and refreshed. Refreshes that were due while nothing was asked for have passed
    /// unseen, except for the last of each bank.
    #[inline(always)]
    fn refresh(&mut self, time: u64) {
        let turns = self.refresh_turns;
        let due = time * turns / u64::from(self.config.t_refi);
        let unseen = (due - self.refreshes).saturating_sub(turns);
        self.refreshes += unseen;
        let mut start = self.config.refresh_due(self.refreshes);
        let banks = if turns > 1 {
            let number = (self.refreshes % turns) as usize;
            number..number + 1
        } else {
            if unseen == 0 {
                start = start.max(self.data_end);
            }
            0..self.banks.len()
        };
        let mut free = start;
        for number in banks.clone() {
            self.close_unused(number, start);
            if self.banks[number].row != CLOSED {
                self.close(number, start);
            }
            free = free.max(self.banks[number].ready_at);
        }
        let end = free + u64::from(self.config.t_rfc);
        self.banks[banks].iter_mut().for_each(|bank| bank.ready_at = end);
        self.refreshes += 1;
        self.refresh_at = self.config.refresh_due(self.refreshes);
        self.counts.refreshes += 1;
    }

    /// Issues the commands of a card cycle in the order of their time, and finds the cycle of the next. Returns whether there were
    /// any.
    #[inline(always)]
    fn command(&mut self, now: Cycle) -> bool {
        let (begin, end) = (self.config.ticks(now), self.config.ticks(now + 1));
        let mut any = false;
        while self.waiting() > 0 {
            while begin >= self.refresh_at {
                self.refresh(begin);
                any = true;
            }
            let activation = self.next_activation(begin, end);
            let access = self.next_access(begin, end);
            let next = activation.map_or(NEVER, |(at, _)| at).min(access.map_or(NEVER, |(at, _)| at));
            if next >= end {
                let until = next.min(self.refresh_at);
                assert!(until != NEVER, "cycle {now}: a DRAM channel has requests and nothing to do for them");
                self.command_at = self.config.cycle(until).max(now + 1);
                break;
            }
            match (activation, access) {
                (Some((at, bank)), _) if at == next => self.activate(bank, at),
                (_, Some((at, slot))) => self.access(slot, at),
                _ => unreachable!("one of both is next"),
            }
            any = true;
        }
        any
    }

    /// A request enters its queue.
    #[inline(always)]
    fn accept(&mut self, request: DramRequest, port: usize, time: u64) {
        let which = if request.write != 0 { WRITES } else { READS };
        let (number, row) = self.config.place(request.address);
        let offset = request.address as u32 & (self.config.burst_bytes - 1);
        let bursts = (offset + u32::from(request.bytes)).div_ceil(self.config.burst_bytes);
        let number = number as usize;
        self.close_unused(number, time);
        let queue = &mut self.queues[which];
        let slot = queue.next as usize;
        queue.next = (queue.next + 1) % RING;
        queue.requests[slot] = Queued { row, bank: number as u32, bursts, id: request.id, port: port as u32 };
        queue.taken |= 1 << slot;
        queue.waiting += 1;
        self.command_at = 0;
        let bank = &mut self.banks[number];
        bank.queue[which] |= 1 << slot;
        if bank.row == row {
            bank.hits[which] |= 1 << slot;
            queue.hitting |= 1 << number;
        } else if bank.row == CLOSED {
            queue.closed |= 1 << number;
        }
        self.choose_queue(time);
        self.precharge(number, time);
    }
}

impl<C> Unit<C> for Dram {
    #[inline]
    fn tick(&mut self, wires: &mut Wires, _: &mut C) -> Tick {
        let now = wires.now();
        let mut did = if self.waiting() > 0 || !self.flight.is_empty() { Tick::Working } else { Tick::Starved };
        let mut blocked = false;
        // 1. Data that have come go back.
        while let Some(&(there, port, id)) = self.flight.front() {
            if there > now {
                wires.sleep_until(there);
                break;
            }
            if !wires.try_push(&self.outputs[port as usize], DramAnswer { id }) {
                did = did.or(Tick::Blocked);
                blocked = true;
                break;
            }
            self.flight.pop_front();
            self.items += 1;
            did = Tick::Moved;
        }
        // 2. The commands of this cycle are issued in the order of their time.
        if self.waiting() > 0 && now >= self.command_at && self.command(now) {
            did = Tick::Moved;
        }
        if self.waiting() > 0 {
            wires.sleep_until(self.command_at);
        }
        // 3. Requests enter their queues, each port's in the order in which they came. The ports take turns to be first.
        let (ports, mut entered) = (self.inputs.len(), false);
        for step in 0..ports {
            let port = if self.first_port + step < ports { self.first_port + step } else { self.first_port + step - ports };
            while let Some(request) = wires.front(&self.inputs[port]) {
                if !self.queues[if request.write != 0 { WRITES } else { READS }].has_room() {
                    break;
                }
                wires.take(&self.inputs[port]);
                self.accept(request, port, self.config.ticks(now));
                entered = true;
            }
        }
        if entered {
            self.first_port = if self.first_port + 1 < ports { self.first_port + 1 } else { 0 };
            did = Tick::Moved;
        }
        // 4. What comes next is known: data, a command, or a request.
        if did == Tick::Moved && !blocked {
            if let Some(&(there, ..)) = self.flight.front() {
                wires.sleep_until(there);
            }
            if self.waiting() > 0 {
                wires.sleep_until(self.command_at);
            }
            wires.rest(if self.waiting() > 0 || !self.flight.is_empty() { Tick::Working } else { Tick::Starved });
        }
        did
    }

    fn items(&self) -> u64 {
        self.items
    }

    fn resident(&self) -> u64 {
        u64::from(self.waiting()) + self.flight.len() as u64
    }
}
