//! Bank timings to the cycle. Bandwidth against its formula is measured by `fillrate accuracy dram-runs`.

use super::client::Order;
use crate::{Dram, DramAnswer, DramConfig, DramRequest, PagePolicy, RefreshScope};
use num::{Cycle, Random};
use sim::{Circuit, Clock, In, Link, One, Out, Tick, Unit, Wires, Wiring, run};

/// Sends requests to one channel and notes when they are answered.
struct Driver {
    orders: Vec<Order>,
    next: usize,
    answered: Vec<(u32, Cycle)>,
    reads: usize,
    output: Out<DramRequest>,
    input: In<DramAnswer>,
}

impl Unit<()> for Driver {
    fn tick(&mut self, wires: &mut Wires, _: &mut ()) -> Tick {
        let mut did = Tick::Memory;
        while let Some(answer) = wires.pop(&self.input) {
            self.answered.push((answer.id, wires.now()));
            did = Tick::Moved;
        }
        while let Some(&order) = self.orders.get(self.next) {
            if order.from > wires.now() {
                wires.sleep_until(order.from);
                break;
            }
            let write = u16::from(!order.kind.is_answered());
            let request = DramRequest { address: order.address, id: self.next as u32, bytes: order.bytes as u16, write };
            if !wires.try_push(&self.output, request) {
                break;
            }
            self.next += 1;
            did = Tick::Moved;
        }
        did
    }

    fn items(&self) -> u64 {
        self.answered.len() as u64
    }

    fn resident(&self) -> u64 {
        0
    }
}

sim::circuit! {
    struct Rig for () {
        driver: One<Driver>,
        dram: One<Dram>,
    }
}

/// A shorter window than that of the preset.
pub fn ddr4() -> DramConfig {
    DramConfig { window: 32, ..DramConfig::ddr4_3200() }
}

fn still() -> DramConfig {
    DramConfig { t_refi: 0, ..ddr4() }
}

fn rig(config: DramConfig, orders: Vec<Order>) -> Rig {
    let mut wiring = Wiring::new();
    let (driver, dram) = (wiring.unit("driver", 0), wiring.unit("dram", 0));
    let (output, requests) = wiring.channel("dram_requests", 0, Link::items(64, 4, 1), driver, dram);
    let (answers, input) = wiring.channel("dram_answers", 0, Link::items(64, 4, 1), dram, driver);
    let reads = orders.iter().filter(|order| order.kind.is_answered()).count();
    Rig::new(
        wiring,
        One(Driver { orders, next: 0, answered: Vec::new(), reads, output, input }),
        One(Dram::new(config, vec![requests], vec![answers])),
    )
}

fn go(config: DramConfig, orders: Vec<Order>) -> Rig {
    let mut last = None;
    for clock in [Clock::SkipIdle, Clock::EveryCycle] {
        let mut machine = rig(config, orders.clone());
        let n = orders.len();
        run(&mut machine, &mut (), clock, 100_000, |m, _| {
            m.driver.next == n
                && m.driver.answered.len() == m.driver.reads
                && Unit::<()>::resident(&m.dram.0) == 0
                && m.wires().resident() == 0
        })
        .unwrap();
        machine.wires_mut().settle();
        let seen = (machine.driver.answered.clone(), machine.reading(), machine.dram.counts());
        if let Some(last) = &last {
            assert_eq!(&seen, last, "the clocks differ");
        }
        last = Some(seen);
        if clock == Clock::EveryCycle {
            return machine;
        }
    }
    unreachable!()
}

/// Cycle at which each order is answered.
fn answers(config: DramConfig, orders: Vec<Order>) -> Vec<Cycle> {
    let machine = go(config, orders);
    let mut times = machine.driver.answered.clone();
    times.sort();
    times.into_iter().map(|(_, time)| time).collect()
}

/// Hops: a cycle to the channel, one in which it enters the window, one back to the driver.
const HOPS: Cycle = 3;

#[test]
fn closed_hit_and_conflict_latencies() {
    let c = still();
    let row = u64::from(c.row_bytes);
    let other = row * u64::from(c.banks);
    // Far apart, so that nothing overlaps: first a closed bank, then a hit, then a conflict, which also waits for the precharge.
    let times = answers(c, vec![Order::read(0, 0, 64), Order::read(1000, 64, 64), Order::read(2000, other, 64)]);
    let data = Cycle::from(c.cl + c.burst_cycles);
    assert_eq!(times[0], HOPS + Cycle::from(c.t_rcd) + data);
    assert_eq!(times[1] - 1000, HOPS + data);
    // The row is closed when the request is seen: one cycle earlier than a command of the next cycle could be.
    assert_eq!(times[2] - 2000, HOPS + Cycle::from(c.t_rp + c.t_rcd) + data - 1);
}

#[test]
fn a_row_stays_open_for_its_time_and_a_bank_for_its_cycle() {
    let c = still();
    let conflict = u64::from(c.row_bytes * c.banks);
    let times = answers(c, vec![Order::read(0, 0, 64), Order::read(0, conflict, 64)]);
    // tRC from activation to activation, tRAS + tRP.
    assert_eq!(times[1] - times[0], Cycle::from(c.t_ras + c.t_rp));
}

#[test]
fn activations_keep_trrd_and_tfaw() {
    let c = DramConfig { burst_cycles: 1, ..still() };
    let orders = (0..6).map(|bank| Order::read(0, bank * u64::from(c.row_bytes), 64)).collect();
    let times = answers(c, orders);
    let from_first: Vec<Cycle> = times.iter().map(|time| time - times[0]).collect();
    assert_eq!(from_first, [0, 4, 8, 12, 34, 38]);
}

#[test]
fn a_read_after_a_write_waits_for_the_turn() {
    let c = still();
    let times = answers(c, vec![Order::write(0, 0, 64), Order::read(0, 64, 64)]);
    // Reads go first: the write comes after it, and the turn does not matter.
    assert_eq!(times[0], HOPS + Cycle::from(c.t_rcd + c.cl + c.burst_cycles));
    let times = answers(c, vec![Order::write(0, 0, 64), Order::read(Cycle::from(c.t_rcd) + 2, 64, 64)]);
    // The write's column access is at 2 + tRCD; its data end, then tWTR, then the read.
    let column = 2 + c.t_rcd + c.cwl + c.burst_cycles + c.t_wtr;
    assert_eq!(times[0], Cycle::from(column + c.cl + c.burst_cycles) + 1);
}

#[test]
fn an_open_row_streams_at_the_peak() {
    let c = still();
    let n = 64;
    let orders = (0..n).map(|i| Order::read(0, i * 64, 64)).collect();
    let times = answers(c, orders);
    for pair in times.windows(2) {
        assert_eq!(pair[1] - pair[0], Cycle::from(c.burst_cycles));
    }
    let machine = go(c, (0..n).map(|i| Order::read(0, i * 64, 64)).collect());
    let counts = machine.dram.counts();
    assert_eq!((counts.row_hits, counts.row_misses, counts.read_bytes), (n - 1, 1, n * 64));
    assert_eq!(counts.bus_cycles, n * u64::from(c.burst_cycles));
}

#[test]
fn row_hits_go_before_older_conflicts_and_writes_after_reads() {
    let c = still();
    let conflict = u64::from(c.row_bytes * c.banks);
    let machine = go(c, vec![Order::read(0, 0, 64), Order::read(0, conflict, 64), Order::read(0, 64, 64)]);
    let order: Vec<u32> = machine.driver.answered.iter().map(|&(id, _)| id).collect();
    assert_eq!(order, [0, 2, 1]);
}

/// Where reads follow each other at other distances than a burst: the number of the read behind the gap, and the gap.
fn gaps(times: &[Cycle], burst: u32) -> Vec<(usize, Cycle)> {
    let pairs = times.windows(2).enumerate().map(|(at, pair)| (at + 1, pair[1] - pair[0]));
    pairs.filter(|&(_, gap)| gap != Cycle::from(burst)).collect()
}

#[test]
fn writes_go_from_the_high_watermark_down_to_the_low_one() {
    // With as many as the low watermark or fewer it is half of the high one; a queue that is full is at its high one.
    let half = |write_high: u32| write_high / 2;
    for (write_queue, high, low, [write_high, write_low]) in [
        (8, 4, 1, [4, 1]),
        (8, 4, 3, [4, 3]),
        (8, 8, 0, [8, 0]),
        (8, 5, 2, [5, 2]),
        (8, 4, 20, [4, half(4)]),
        (5, 64, 2, [5, 2]),
        (6, 64, 63, [6, half(6)]),
    ] {
        let c = DramConfig { write_queue, write_high: high, write_low: low, window: 8, ..still() };
        // Reads of one row, with as many writes of it as are given behind the first sixteen of them.
        let reads_of = |writes: u32| {
            let read = |i: u32| Order::read(0, u64::from(i) * 64, 64);
            let write = |i: u32| Order::write(0, 4096 + u64::from(i) * 64, 64);
            let orders = (0..16).map(read).chain((0..writes).map(write)).chain((16..48).map(read)).collect();
            let machine = go(c, orders);
            assert_eq!(machine.dram.counts().write_bytes, u64::from(writes) * 64);
            let mut times: Vec<Cycle> = machine.driver.answered.iter().map(|&(_, time)| time).collect();
            times.sort_unstable();
            gaps(&times, c.burst_cycles)
        };
        // One write fewer waits for the end of the reads.
        assert_eq!(reads_of(write_high - 1), [], "{write_high} and {write_low}");
        // The turn to writes, all those above the low watermark, and the turn back.
        let gap = c.cl + c.t_rtw + c.t_wtr + (write_high - write_low + 1) * c.burst_cycles;
        let seen = reads_of(write_high);
        assert_eq!(seen.iter().map(|&(_, gap)| gap).collect::<Vec<_>>(), [Cycle::from(gap)], "{write_high} and {write_low}");
    }
}

#[test]
fn writes_that_wait_take_no_room_from_reads() {
    let c = DramConfig { window: 4, write_queue: 8, write_high: 8, write_low: 4, ..still() };
    // A row each: four banks have to be opened at once.
    let read = |i: u64| Order::read(0, i * u64::from(c.row_bytes), 64);
    let write = |i: u64| Order::write(0, (40 + i) * u64::from(c.row_bytes), 64);
    let with: Vec<Order> = (0..4).map(read).chain((0..7).map(write)).chain((4..40).map(read)).collect();
    let without = (0..40).map(read).collect();
    assert_eq!(answers(c, with)[8..40], answers(c, without)[8..40]);
}

#[test]
fn bursts_of_one_bank_group_keep_their_distance_and_those_of_others_go_between() {
    let c = DramConfig { bank_groups: 4, t_ccd_l: 10, ..still() };
    let row = u64::from(c.row_bytes);
    let (gap, burst) = (Cycle::from(c.t_ccd_l), Cycle::from(c.burst_cycles));
    // Once the rows are open: the distances of the last reads, of banks in turn.
    let distances = |banks: &[u64]| {
        let order = |i: u64| Order::read(0, banks[i as usize % banks.len()] * row + i * 64, 64);
        let times = answers(c, (0..24).map(order).collect());
        times[12..].windows(2).map(|pair| pair[1] - pair[0]).collect::<Vec<_>>()
    };
    assert_eq!(distances(&[0]), [gap; 11]);
    assert_eq!(distances(&[0, 4]), [gap; 11], "banks 0 and 4 are of one group");
    assert_eq!(distances(&[0, 1, 2, 3]), [burst; 11]);
    // Of two groups, the second burst of a pair goes one burst behind the first.
    let mut two = distances(&[0, 1]);
    two.sort_unstable();
    assert_eq!((&two[..5], &two[6..]), (&[burst; 5][..], &[gap - burst; 5][..]));
    // Where there is one group, and where the distance is no longer than a burst, there is none.
    for config in [DramConfig { bank_groups: 1, ..c }, DramConfig { t_ccd_l: 4, ..c }] {
        let times = answers(config, (0..24).map(|i| Order::read(0, i * 64, 64)).collect());
        assert_eq!(gaps(&times, c.burst_cycles), []);
    }
    // A request of four bursts, alone, and two of two groups, whose bursts alternate.
    let times = answers(c, vec![Order::read(0, 0, 256), Order::read(1000, 256, 256), Order::read(1000, row, 256)]);
    assert_eq!(times[0], HOPS + Cycle::from(c.t_rcd + c.cl) + 3 * gap + burst);
    let machine = go(c, vec![Order::read(0, 0, 256), Order::read(0, row, 256), Order::write(1000, 0, 256)]);
    let counts = machine.dram.counts();
    assert_eq!((counts.read_bytes, counts.write_bytes, counts.bus_cycles), (512, 256, 12 * burst));
    // The second row is opened tRRD behind the first, after which the bursts of the first go between.
    let ends: Vec<Cycle> = machine.driver.answered.iter().map(|&(_, time)| time).collect();
    assert_eq!(ends[1] - ends[0], Cycle::from(c.t_rrd));
}

#[test]
fn a_row_without_requests_is_closed_as_the_page_policy_says() {
    let row = u64::from(still().row_bytes);
    let data = Cycle::from(still().cl + still().burst_cycles);
    let (open, precharge) = (Cycle::from(still().t_rcd), Cycle::from(still().t_rp));
    // Of the same row, and of another row of the bank, some time later.
    let later = |page: PagePolicy, page_idle: u32, from: Cycle| {
        let c = DramConfig { page, page_idle, ..still() };
        let same = answers(c, vec![Order::read(0, 0, 64), Order::read(from, 64, 64)])[1] - from - HOPS;
        let other = answers(c, vec![Order::read(0, 0, 64), Order::read(from, row * 16, 64)])[1] - from - HOPS;
        (same, other)
    };
    assert_eq!(later(PagePolicy::Open, 100, 5000), (data, precharge + open + data - 1));
    assert_eq!(later(PagePolicy::Closed, 100, 5000), (open + data, open + data));
    assert_eq!(later(PagePolicy::Idle, 100, 5000), (open + data, open + data));
    // The access is at 2 + tRCD, and the row is used until its burst has gone. A request is seen in the cycle after it was sent: first
    // the last one for which the row is open, then the first one for which it is closed, which waits for the precharge.
    let used = 2 + open + Cycle::from(still().burst_cycles);
    let idle = 100;
    let last = used + idle - 2;
    assert_eq!(later(PagePolicy::Idle, idle as u32, last).0, data);
    assert_eq!(later(PagePolicy::Idle, idle as u32, last + 1).0, precharge + open + data - 1);
    // A closed page is closed no sooner than tRAS allows, and serves all requests that wait for it before.
    let c = DramConfig { page: PagePolicy::Closed, ..still() };
    let times = answers(c, vec![Order::read(0, 0, 64), Order::read(0, 64, 64), Order::read(40, 128, 64)]);
    assert_eq!(times[1] - times[0], Cycle::from(c.burst_cycles));
    assert_eq!(times[2], 2 + Cycle::from(c.t_ras) + precharge + open + data + 1);
}

#[test]
fn a_refresh_closes_rows_and_holds_requests_up() {
    let c = DramConfig { t_refi: 2000, t_rfc: 500, ..ddr4() };
    // A request just after the refresh is due waits for its end, and finds its row closed.
    let times = answers(c, vec![Order::read(0, 0, 64), Order::read(2001, 64, 64)]);
    let end = 2000 + Cycle::from(c.t_rfc + c.t_rp);
    assert_eq!(times[1], end + Cycle::from(c.t_rcd + c.cl + c.burst_cycles) + 1);
    // One that comes when it is over finds the row closed, no more. Refreshes while nothing was asked for took their time alone.
    let times = answers(c, vec![Order::read(0, 0, 64), Order::read(9000, 64, 64)]);
    assert_eq!(times[1] - 9000, HOPS + Cycle::from(c.t_rcd + c.cl + c.burst_cycles));
}

#[test]
fn a_refresh_of_one_bank_leaves_the_others_open() {
    let c = DramConfig { refresh: RefreshScope::PerBank, t_refi: 16_000, t_rfc: 500, ..ddr4() };
    let row = u64::from(c.row_bytes);
    let (open, precharge) = (Cycle::from(c.t_rcd), Cycle::from(c.t_rp));
    let data = Cycle::from(c.cl + c.burst_cycles);
    // The banks are refreshed in turn, one of 16 every 1000 cycles: first the first.
    let later = |bank: u64, from: Cycle| {
        answers(c, vec![Order::read(0, bank * row, 64), Order::read(from, bank * row + 64, 64)])[1] - from
    };
    assert_eq!(later(0, 900), HOPS + data);
    assert_eq!(later(0, 1001), 1000 + precharge + 500 + open + data + 1 - 1001);
    assert_eq!((later(1, 1001), later(15, 1001)), (HOPS + data, HOPS + data));
    // A row whose refresh is over is closed, no more; that of a bank whose turn has not come is open.
    assert_eq!((later(3, 5900), later(4, 5900), later(5, 5900)), (HOPS + open + data, HOPS + open + data, HOPS + data));
    assert_eq!(later(5, 6100), 6000 + precharge + 500 + open + data + 1 - 6100);
    // After a long time all have been refreshed, the last one just now.
    assert_eq!((later(7, 160_500), later(14, 160_500)), (HOPS + open + data, HOPS + open + data));
    assert_eq!(later(15, 160_100), 160_000 + precharge + 500 + open + data + 1 - 160_100);
    // A stream over all banks loses a bank at a time, where a refresh of all stops it.
    let stream: Vec<Order> = (0..4000).map(|i| Order::read(0, i * 64, 64)).collect();
    let end = |refresh| *answers(DramConfig { refresh, t_refi: 4000, t_rfc: 600, ..c }, stream.clone()).last().unwrap();
    let (one, all) = (end(RefreshScope::PerBank), end(RefreshScope::AllBanks));
    assert!(one < all && all > 4000 * Cycle::from(c.burst_cycles) * 110 / 100, "{one} {all}");
}

#[test]
fn a_faster_and_a_slower_clock_of_the_card() {
    for (clock, per) in [(2, 1), (1, 2), (7, 5), (5, 7)] {
        let c = DramConfig { clock, card_cycles: per, ..still() };
        let n = 400;
        let times = answers(c, (0..n).map(|i| Order::read(0, i * 64, 64)).collect());
        let cycles = (times[n as usize - 1] - times[0]) as f64;
        let expected = (n - 1) as f64 * f64::from(c.burst_cycles * per) / f64::from(clock);
        assert!((cycles - expected).abs() <= 1.0, "{clock}/{per}: {cycles} {expected}");
    }
}

#[test]
fn mixed_reads_and_writes_at_random_are_all_served_and_the_clocks_agree() {
    let mut generator = Random::new(5);
    let mut random = |bound: u64| u64::from(generator.below(bound as u32));
    for config in [
        ddr4(),
        DramConfig {
            clock: 3,
            card_cycles: 2,
            t_refi: 3000,
            hash_banks: true,
            window: 7,
            write_queue: 5,
            write_high: 3,
            write_low: 1,
            ..ddr4()
        },
    ] {
        let mut from = 0;
        let orders: Vec<Order> = (0..3000)
            .map(|_| {
                from += random(12) * random(2) + if random(500) == 0 { 20_000 } else { 0 };
                let address = random(40) * u64::from(config.row_bytes) + random(32) * 256;
                if random(3) == 0 { Order::write(from, address, 256) } else { Order::read(from, address, 64) }
            })
            .collect();
        let machine = go(config, orders.clone());
        let sum =
            |reads: bool| orders.iter().filter(|o| o.kind.is_answered() == reads).map(|o| u64::from(o.bytes)).sum::<u64>();
        assert_eq!(machine.dram.counts().read_bytes, sum(true));
        assert_eq!(machine.dram.counts().write_bytes, sum(false));
    }
}

#[test]
fn a_channel_with_refreshes_as_near_as_is_allowed_serves_every_request() {
    let mut generator = Random::new(11);
    let mut random = |bound: u32| generator.below(bound);
    for _ in 0..200 {
        let mut time = || {
            let size = 2 << random(9);
            1 + random(size)
        };
        let mut c = DramConfig {
            burst_cycles: time().min(64),
            t_rcd: time(),
            t_rp: time(),
            cl: time(),
            cwl: time(),
            t_ras: time(),
            t_rrd: time(),
            t_faw: time(),
            t_rtp: time(),
            t_wr: time(),
            t_wtr: time(),
            t_rtw: time(),
            t_rfc: time(),
            t_refi: 0,
            ..ddr4()
        };
        (c.clock, c.card_cycles) = (1 + random(9), 1 + random(9));
        (c.burst_bytes, c.row_bytes, c.banks) = (8 << random(6), 256 << random(5), 1 + random(4));
        c.window = 1 + random(8);
        c.write_queue = 1 + random(8);
        c.write_high = 1 + random(20);
        c.write_low = random(64);
        (c.bank_groups, c.t_ccd_l) = (1 << random(5), 1 + random(40));
        c.page = [PagePolicy::Open, PagePolicy::Idle, PagePolicy::Closed][random(3) as usize];
        c.page_idle = 1 + random(200);
        c.refresh = [RefreshScope::AllBanks, RefreshScope::PerBank][random(2) as usize];
        c.t_refi = (1..100_000).find(|&t_refi| DramConfig { t_refi, ..c }.check().is_ok()).expect("some interval");
        let orders: Vec<Order> = (0..40)
            .map(|_| {
                let address = u64::from(random(20)) * 256;
                if random(2) == 0 { Order::write(0, address, 256) } else { Order::read(0, address, 256) }
            })
            .collect();
        let mut machine = rig(c, orders);
        run(&mut machine, &mut (), Clock::SkipIdle, 100, |m, _| {
            // Between two refreshes a request is served.
            assert!(m.wires().now() < 1 << 24, "{c:?} serves nothing");
            m.driver.answered.len() == m.driver.reads && m.driver.next == 40 && m.wires().resident() == 0
        })
        .unwrap();
    }
}

#[test]
fn wrong_values_are_refused() {
    assert!(ddr4().check().is_ok());
    for (config, rule) in [
        (DramConfig { banks: 65, ..ddr4() }, "banks"),
        (DramConfig { row_bytes: 1000, ..ddr4() }, "row_bytes"),
        (DramConfig { window: 0, ..ddr4() }, "window"),
        (DramConfig { write_queue: 65, ..ddr4() }, "write_queue must be 1 to 64"),
        (DramConfig { write_high: 0, ..ddr4() }, "write_high must be at least 1"),
        (DramConfig { bank_groups: 3, ..ddr4() }, "bank_groups must be a power of two"),
        (DramConfig { t_refi: 1120, ..ddr4() }, "t_refi is 1120, and must be 0 or more than 1120, so that"),
        // One cycle for each row: it would be closed before it is read.
        (DramConfig { t_refi: 1, t_rfc: 0, ..ddr4() }, "t_refi is 1, and must be 0 or more than 111, so that"),
    ] {
        assert!(config.check().unwrap_err().to_string().contains(rule));
    }
}
