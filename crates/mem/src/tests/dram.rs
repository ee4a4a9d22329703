//! Bank timings to the cycle. Bandwidth against its formula is measured by `fillrate accuracy dram-runs`.

use super::client::Order;
use crate::{Dram, DramAnswer, DramConfig, DramRequest};
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
        let seen = (machine.driver.answered.clone(), machine.wires().reading(), machine.dram.counts());
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
    for config in
        [ddr4(), DramConfig { clock: 3, card_cycles: 2, t_refi: 3000, hash_banks: true, window: 7, write_high: 3, ..ddr4() }]
    {
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
        c.write_high = 1 + random(c.window);
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
        (DramConfig { t_refi: 1120, ..ddr4() }, "t_refi is 1120, and must be 0 or more than 1120, so that"),
        // One cycle for each row: it would be closed before it is read.
        (DramConfig { t_refi: 1, t_rfc: 0, ..ddr4() }, "t_refi is 1, and must be 0 or more than 111, so that"),
    ] {
        assert!(config.check().unwrap_err().contains(rule));
    }
}
