//! A DRAM channel: banks, rows, a scheduler that serves row hits first, and refresh.
//!
//! Time inside is counted in the DRAM's own clock, whose ratio to the card's is any fraction. The channel issues its commands in
//! the order of their time: a precharge as soon as no request in the window wants the open row any more, an activation when
//! tRP, tRRD and tFAW allow it, a column access when tRCD and the data bus do. Banks prepare their rows while others transfer.
//! (A reservation of whole transactions, bank after bank, was rejected: it holds back activations that could go first.)

use std::collections::VecDeque;

use super::port::{DramAnswer, DramRequest};
use knob::Allowed;
use num::{Cycle, NEVER};
use sim::{In, Out, Tick, Unit, Wires};
use stats::Heading;

knob::knobs! {
    /// DRAM. Times are in cycles of its command clock.
    #[derive(Copy)]
    pub struct DramConfig {
        /// Channels.
        channels: u32 ["channels", Allowed::Range(1, 64), "128 bits of GDDR5 in channels of 32, as the GeForce GTX 960"],
        /// Cycles of the DRAM's command clock in `card_cycles` of the card.
        clock: u32 ["cycles", Allowed::Range(1, 10000), "1.5 GHz: GDDR5 of 6 Gbit/s a pin"],
        /// Cycles of the card in which the DRAM's clock ticks `clock` times.
        card_cycles: u32 ["cycles", Allowed::Range(1, 10000), "see clock"],
        /// Banks of a channel.
        banks: u32 ["banks", Allowed::Range(1, 64), "16 (GDDR5, JESD212)"],
        /// Bytes of a row.
        row_bytes: u32 ["bytes", Allowed::PowerOfTwo(256, 65536), "2 KB (GDDR5); ATTILA bGPU.ini V2MemoryRowSize = 2048"],
        /// Bytes of a burst.
        burst_bytes: u32 ["bytes", Allowed::PowerOfTwo(8, 256), "burst of 8 on 32 bits"],
        /// Cycles of a burst on the data bus.
        burst_cycles: u32 ["DRAM cycles", Allowed::Range(1, 64), "8 beats, 4 a command clock"],
        /// Activation to column access.
        t_rcd: u32 ["DRAM cycles", Allowed::Range(1, 1000), "12 ns (Hynix H5GQ1H24AFR)"],
        /// Precharge to activation.
        t_rp: u32 ["DRAM cycles", Allowed::Range(1, 1000), "12 ns"],
        /// Column read to its data.
        cl: u32 ["DRAM cycles", Allowed::Range(1, 1000), "12 ns"],
        /// Column write to its data.
        cwl: u32 ["DRAM cycles", Allowed::Range(1, 1000), "4 cycles"],
        /// Activation to precharge.
        t_ras: u32 ["DRAM cycles", Allowed::Range(1, 1000), "28 ns"],
        /// Activation to activation of another bank.
        t_rrd: u32 ["DRAM cycles", Allowed::Range(1, 1000), "6 ns"],
        /// A window with at most four activations.
        t_faw: u32 ["DRAM cycles", Allowed::Range(1, 1000), "23 ns"],
        /// Read to precharge.
        t_rtp: u32 ["DRAM cycles", Allowed::Range(1, 1000), "2 cycles"],
        /// End of write data to precharge.
        t_wr: u32 ["DRAM cycles", Allowed::Range(1, 1000), "12 ns"],
        /// End of write data to a read.
        t_wtr: u32 ["DRAM cycles", Allowed::Range(1, 1000), "5 ns"],
        /// End of read data to write data.
        t_rtw: u32 ["DRAM cycles", Allowed::Range(0, 1000), "turn of the bus"],
        /// Length of a refresh.
        t_rfc: u32 ["DRAM cycles", Allowed::Range(0, 10000), "65 ns"],
        /// Refresh to refresh; 0 for none.
        t_refi: u32 ["DRAM cycles", Allowed::Range(0, 1000000), "1.9 us"],
        /// Requests among which the scheduler chooses.
        window: u32 ["requests", Allowed::Range(1, 64), "ATTILA bGPU.ini V2MaxChannelTransactions = 64"],
        /// Writes in the window that make them go first.
        write_high: u32 ["requests", Allowed::Range(1, 64), "three quarters of the window"],
        /// Whether bank numbers are mixed with row bits.
        hash_banks: bool ["", Allowed::Switch, "permutation-based interleaving (Zhang et al. 2000)"],
    }
}

impl DramConfig {
    /// One channel of DDR4-3200 (JEDEC JESD79-4, speed bin 22-22-22), in cycles of its own clock, which is the card's.
    pub fn ddr4_3200() -> DramConfig {
        DramConfig {
            channels: 1,
            clock: 1,
            card_cycles: 1,
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
            t_rfc: 560,
            t_refi: 12480,
            window: 64,
            write_high: 16,
            hash_banks: false,
            ..DramConfig::default()
        }
    }
}

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

/// A request in the window.
#[derive(Clone, Copy, Debug, Default)]
struct Queued {
    row: u64,
    bank: u32,
    bursts: u32,
    id: u32,
    port: u32,
}

/// A set of places of the window's ring, which has twice as many as the window: a request that has to wait long holds up those
/// who come after it only when they are that many.
type Places = u128;
const RING: u32 = Places::BITS;

/// No row is open.
const CLOSED: u64 = u64::MAX;

#[derive(Clone, Copy, Debug)]
struct Bank {
    row: u64,
    /// From when columns of the open row can be accessed.
    column_at: u64,
    /// From when the open row can be closed; of a closed bank, from when a row can be opened.
    ready_at: u64,
    /// The first access to the row has still to come.
    fresh: bool,
    /// Places with requests to this bank, and those to its open row.
    queue: Places,
    hits: Places,
}

/// A DRAM channel. Its items are requests.
#[derive(Clone, Debug)]
pub struct Dram {
    config: DramConfig,
    banks: Vec<Bank>,
    window: [Queued; RING as usize],
    /// Taken places of the window, and those with writes. Places are taken round robin: rotated by `oldest`, the lowest bit is the
    /// request that came first.
    taken: Places,
    writes: Places,
    next_place: u32,
    /// How many of each there are.
    queued_reads: u32,
    queued_writes: u32,
    /// The card cycle before which no command can go, found when the last of a cycle had gone and void once a request enters.
    command_at: Cycle,
    /// Banks that are closed although a request waits for one of their rows.
    waiting: u64,
    /// Banks with requests to their open row.
    hitting: u64,
    writing: bool,
    /// Earliest times of the next column access by direction, and of the next activation.
    read_at: u64,
    write_at: u64,
    activate_at: u64,
    /// The ends of the windows that the last four activations opened, the oldest at `turn`.
    activations: [u64; 4],
    turn: usize,
    /// When the next refresh is due, and the end of all data so far.
    refresh_at: u64,
    data_end: u64,
    /// Reads whose data come: the cycle, port and id.
    flight: VecDeque<(Cycle, u32, u32)>,
    items: u64,
    counts: DramCounts,
    inputs: Vec<In<DramRequest>>,
    outputs: Vec<Out<DramAnswer>>,
}

impl DramConfig {
    /// Whether the values make a channel.
    ///
    /// # Errors
    /// The rule that is broken.
    pub fn check(&self) -> Result<(), String> {
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
            (self.write_high >= 1 && self.write_high <= self.window, "write_high must be 1 to window"),
        ];
        if let Some((_, rule)) = rules.iter().find(|(holds, _)| !holds) {
            return Err((*rule).to_owned());
        }
        match self.between_refreshes() {
            least if self.t_refi != 0 && u64::from(self.t_refi) <= least => Err(format!(
                "t_refi is {}, and must be 0 or more than {least}, so that requests are served between refreshes of t_rfc = {}",
                self.t_refi, self.t_rfc
            )),
            _ => Ok(()),
        }
    }

    /// With refreshes no farther apart than so many cycles, rows might be closed again and again before a request is served. A channel
    /// that spends half of its time on refreshes, or more, is none either.
    fn between_refreshes(&self) -> u64 {
        let c = |cycles: u32| u64::from(cycles);
        // 1. What was under way as the refresh came: data on the bus, rows that have to stay open.
        let bursts = c(LONGEST.div_ceil(self.burst_bytes) + 1);
        let data = c(self.cl.max(self.cwl)) + bursts * c(self.burst_cycles);
        let open = c(self.t_ras).max(data + c(self.t_wr)).max(bursts * c(self.burst_cycles) + c(self.t_rtp));
        // 2. The refresh, an activation and the access to its row, which waits for the bus as well.
        let activation = (open + c(self.t_rp) + c(self.t_rfc)).max(c(self.t_faw.max(self.t_rrd)));
        let access = (activation + c(self.t_rcd)).max(data + c(self.t_wtr.max(self.t_rtw)));
        // 3. Refreshes begin where cycles of the card do; what has time within one such cycle is served in it.
        let served =
            if c(self.clock / self.card_cycles) > access { 0 } else { access + c(self.clock.div_ceil(self.card_cycles)) };
        served.max(2 * c(self.t_rfc))
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
        let bank = Bank { row: CLOSED, column_at: 0, ready_at: 0, fresh: false, queue: 0, hits: 0 };
        Dram {
            banks: vec![bank; config.banks as usize],
            window: [Queued::default(); RING as usize],
            taken: 0,
            writes: 0,
            next_place: 0,
            queued_reads: 0,
            queued_writes: 0,
            command_at: 0,
            waiting: 0,
            hitting: 0,
            writing: false,
            read_at: 0,
            write_at: 0,
            activate_at: 0,
            activations: [0; 4],
            turn: 0,
            refresh_at: if config.t_refi == 0 { NEVER } else { u64::from(config.t_refi) },
            data_end: 0,
            flight: VecDeque::with_capacity(256),
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

    /// The request of a set that came first. Places are given out in a ring, so age is distance from the next one.
    #[inline(always)]
    fn oldest(&self, places: Places) -> usize {
        let turned = places.rotate_right(self.next_place);
        ((turned.trailing_zeros() + self.next_place) % RING) as usize
    }

    /// Requests that may go now.
    #[inline(always)]
    fn direction(&self) -> Places {
        if self.writing { self.taken & self.writes } else { self.taken & !self.writes }
    }

    /// Chooses the direction after the window has changed. Banks whose open row only the other direction wants are closed then.
    #[inline(always)]
    fn choose_direction(&mut self, time: u64) {
        let (reads, writes) = (self.queued_reads, self.queued_writes);
        let enough = if self.writing { self.config.write_high / 2 + 1 } else { self.config.write_high };
        let writing = writes > 0 && (reads == 0 || writes >= enough);
        if writing != self.writing {
            self.writing = writing;
            for number in 0..self.banks.len() {
                self.precharge(number, time);
            }
        }
    }

    /// Closes a bank's row if requests wait for the bank but none for that row.
    #[inline(always)]
    fn precharge(&mut self, number: usize, time: u64) {
        let direction = self.direction();
        let bank = &mut self.banks[number];
        if bank.row != CLOSED && bank.hits & direction == 0 && bank.queue & direction != 0 {
            bank.row = CLOSED;
            bank.hits = 0;
            bank.ready_at = bank.ready_at.max(time) + u64::from(self.config.t_rp);
            self.hitting &= !(1 << number);
            self.waiting |= 1 << number;
        }
    }

    /// The bank that opens a row next, and when: that of the oldest request among the banks that can go first. Any bank, and no
    /// later than it will be, if that is at `end` or later.
    #[inline(always)]
    fn next_activation(&self, time: u64, end: u64) -> Option<(u64, usize)> {
        if self.waiting == 0 {
            return None;
        }
        let floor = time.max(self.activate_at);
        if floor >= end {
            return Some((floor, 0));
        }
        let direction = self.direction();
        let mut ready = 0;
        let mut soonest = (NEVER, 0);
        each_bit(self.waiting, |number| {
            let bank = &self.banks[number];
            // Rows for the other direction wait for their turn: they would be closed again.
            let queue = bank.queue & direction;
            if queue != 0 {
                if bank.ready_at <= floor {
                    ready |= queue;
                } else if bank.ready_at < soonest.0 {
                    soonest = (bank.ready_at, number);
                }
            }
        });
        if ready != 0 {
            Some((floor, self.window[self.oldest(ready)].bank as usize))
        } else {
            (soonest.0 != NEVER).then_some(soonest)
        }
    }

    #[inline(always)]
    fn activate(&mut self, number: usize, at: u64) {
        let first = self.oldest(self.banks[number].queue & self.direction());
        let row = self.window[first].row;
        let bank = &mut self.banks[number];
        bank.row = row;
        bank.fresh = true;
        bank.column_at = at + u64::from(self.config.t_rcd);
        bank.ready_at = at + u64::from(self.config.t_ras);
        let (mut hits, mut places) = (0, bank.queue);
        while places != 0 {
            let place = places.trailing_zeros();
            hits |= Places::from(self.window[place as usize].row == row) << place;
            places &= places - 1;
        }
        bank.hits = hits;
        self.waiting &= !(1 << number);
        self.hitting |= 1 << number;
        // The ring holds from when a fifth activation may follow each of the last four.
        self.activations[self.turn] = at + u64::from(self.config.t_faw);
        self.turn = (self.turn + 1) & 3;
        self.activate_at = (at + u64::from(self.config.t_rrd)).max(self.activations[self.turn]);
    }

    /// The access that goes next, and when: the oldest among the row hits that can go first. Any, and no later than it will be, if
    /// that is at `end` or later.
    #[inline(always)]
    fn next_access(&self, time: u64, end: u64) -> Option<(u64, usize)> {
        if self.hitting == 0 {
            return None;
        }
        let direction = self.direction();
        let bus = time.max(if self.writing { self.write_at } else { self.read_at });
        if bus >= end {
            return Some((bus, 0));
        }
        let mut ready = 0;
        let mut soonest = NEVER;
        let mut soonest_hits = 0;
        each_bit(self.hitting, |number| {
            let bank = &self.banks[number];
            let hits = bank.hits & direction;
            if hits != 0 {
                if bank.column_at <= bus {
                    ready |= hits;
                } else if bank.column_at < soonest {
                    soonest = bank.column_at;
                    soonest_hits = hits;
                }
            }
        });
        if ready != 0 {
            Some((bus, self.oldest(ready)))
        } else if soonest != NEVER {
            Some((soonest, self.oldest(soonest_hits)))
        } else {
            None
        }
    }

    #[inline(always)]
    fn access(&mut self, place: usize, at: u64) {
        let c = &self.config;
        let request = self.window[place];
        let bank = &mut self.banks[request.bank as usize];
        let length = u64::from(request.bursts * c.burst_cycles);
        let bytes = u64::from(request.bursts * c.burst_bytes);
        let start = at + u64::from(if self.writing { c.cwl } else { c.cl });
        let end = start + length;
        self.data_end = end;
        if self.writing {
            self.queued_writes -= 1;
            bank.ready_at = bank.ready_at.max(end + u64::from(c.t_wr));
            self.write_at = at + length;
            self.read_at = (end + u64::from(c.t_wtr)).max(self.read_at);
            self.counts.write_bytes += bytes;
            self.items += 1;
        } else {
            self.queued_reads -= 1;
            bank.ready_at = bank.ready_at.max(at + length - u64::from(c.burst_cycles) + u64::from(c.t_rtp));
            self.read_at = at + length;
            self.write_at = (end + u64::from(c.t_rtw)).saturating_sub(u64::from(c.cwl)).max(self.write_at);
            self.counts.read_bytes += bytes;
            // The data are there when the last of them has gone over the bus.
            self.flight.push_back((c.cycle(end - 1) + 1, request.port, request.id));
        }
        self.counts.row_hits += u64::from(request.bursts - u32::from(bank.fresh));
        self.counts.row_misses += u64::from(bank.fresh);
        self.counts.bus_cycles += length;
        bank.fresh = false;
        bank.queue &= !(1 << place);
        bank.hits &= !(1 << place);
        self.taken &= !(1 << place);
        self.writes &= !(1 << place);
        if bank.hits == 0 {
            self.hitting &= !(1 << request.bank);
        }
        self.choose_direction(at);
        self.precharge(request.bank as usize, at);
    }

    /// All banks are closed and refreshed. Refreshes that were due while nothing was asked for have passed unseen.
    #[inline(always)]
    fn refresh(&mut self, time: u64) {
        let (interval, length) = (u64::from(self.config.t_refi), u64::from(self.config.t_rfc));
        let missed = (time - self.refresh_at) / interval;
        self.refresh_at += missed * interval;
        let mut start = self.refresh_at.max(if missed > 0 { 0 } else { self.data_end });
        let mut open = false;
        for bank in &self.banks {
            if bank.row != CLOSED {
                start = start.max(bank.ready_at);
                open = true;
            }
        }
        let end = start + length + if open { u64::from(self.config.t_rp) } else { 0 };
        for (number, bank) in self.banks.iter_mut().enumerate() {
            bank.row = CLOSED;
            bank.hits = 0;
            bank.ready_at = bank.ready_at.max(end);
            if bank.queue != 0 {
                self.waiting |= 1 << number;
            }
        }
        self.hitting = 0;
        self.refresh_at += interval;
        self.counts.refreshes += 1;
    }

    /// Issues the commands of a card cycle in the order of their time, and finds the cycle of the next. Returns whether there were
    /// any.
    #[inline(always)]
    fn command(&mut self, now: Cycle) -> bool {
        let (begin, end) = (self.config.ticks(now), self.config.ticks(now + 1));
        let mut any = false;
        while self.taken != 0 {
            if begin >= self.refresh_at {
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
                (_, Some((at, place))) => self.access(place, at),
                _ => unreachable!("one of both is next"),
            }
            any = true;
        }
        any
    }

    /// A request enters the window.
    #[inline(always)]
    fn accept(&mut self, request: DramRequest, port: usize, time: u64) {
        let place = self.next_place as usize;
        self.next_place = (self.next_place + 1) % RING;
        let (number, row) = self.config.place(request.address);
        let offset = request.address as u32 & (self.config.burst_bytes - 1);
        let bursts = (offset + u32::from(request.bytes)).div_ceil(self.config.burst_bytes);
        self.window[place] = Queued { row, bank: number, bursts, id: request.id, port: port as u32 };
        self.taken |= 1 << place;
        self.writes |= Places::from(request.write) << place;
        if request.write != 0 {
            self.queued_writes += 1;
        } else {
            self.queued_reads += 1;
        }
        self.command_at = 0;
        let bank = &mut self.banks[number as usize];
        bank.queue |= 1 << place;
        if bank.row == row {
            bank.hits |= 1 << place;
            self.hitting |= 1 << number;
        } else if bank.row == CLOSED {
            self.waiting |= 1 << number;
        }
        self.choose_direction(time);
        self.precharge(number as usize, time);
    }
}

impl<C> Unit<C> for Dram {
    #[inline]
    fn tick(&mut self, wires: &mut Wires, _: &mut C) -> Tick {
        let now = wires.now();
        let mut did = if self.taken != 0 || !self.flight.is_empty() { Tick::Working } else { Tick::Starved };
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
        if self.taken != 0 && now >= self.command_at && self.command(now) {
            did = Tick::Moved;
        }
        if self.taken != 0 {
            wires.sleep_until(self.command_at);
        }
        // 3. Requests enter the window, ports in turn.
        for port in 0..self.inputs.len() {
            while self.queued_reads + self.queued_writes < self.config.window && self.taken & (1 << self.next_place) == 0 {
                let Some(request) = wires.pop(&self.inputs[port]) else { break };
                self.accept(request, port, self.config.ticks(now));
                did = Tick::Moved;
            }
        }
        // 4. What comes next is known: data, a command, or a request.
        if did == Tick::Moved && !blocked {
            if let Some(&(there, ..)) = self.flight.front() {
                wires.sleep_until(there);
            }
            if self.taken != 0 {
                wires.sleep_until(self.command_at);
            }
            wires.rest(if self.taken != 0 || !self.flight.is_empty() { Tick::Working } else { Tick::Starved });
        }
        did
    }

    fn items(&self) -> u64 {
        self.items
    }

    fn resident(&self) -> u64 {
        u64::from(self.taken.count_ones()) + self.flight.len() as u64
    }
}
