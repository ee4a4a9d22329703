//! Section E: texture and memory.

use anyhow::Result;

use super::{Row, Section, Setting, Target};
use mem::{Dram, DramAnswer, DramConfig, DramCounts, DramRequest};
use num::{Cycle, Random};
use sim::{Circuit, Clock, In, Link, One, Out, Tick, Unit, Wires, Wiring, run};

/// Targets of the section, in order.
pub const TARGETS: &[Target] = &[DRAM_RUNS, DRAM_LATENCY];

const DRAM_RUNS: Target = Target {
    id: "dram-runs",
    section: Section::Memory,
    what: "Runs of k bursts in one row at random rows: bandwidth min(peak, k g A)(1 - tRFC/tREFI), with bursts of g bytes and A = \
           min(4/tFAW, 1/tRRD, banks/tRC) activations a cycle; of the bursts (k - 1)/k hit an open row (one channel of DDR4-3200)",
    bound: "5 %; 2 points of the hit rate",
    fault: "the channel lets a fifth more time pass between activations",
    check: runs,
};

const DRAM_LATENCY: Target = Target {
    id: "dram-latency",
    section: Section::Memory,
    what: "Alone, a read takes tRCD + CL + burst where its bank is closed, CL + burst where its row is open, tRP more than the first \
           where another one is; one row read in a stream reaches the peak (without refresh; beside the hops to the channel)",
    bound: "2 %",
    fault: "the data come four cycles later than the timing says",
    check: latency,
};

/// Reads from a channel at given times, and notes when they are answered.
struct Reader {
    /// Not before when, and where.
    orders: Vec<(Cycle, u64)>,
    next: usize,
    answered: Vec<Cycle>,
    answers: usize,
    output: Out<DramRequest>,
    input: In<DramAnswer>,
}

impl Unit<()> for Reader {
    fn tick(&mut self, wires: &mut Wires, _: &mut ()) -> Tick {
        let mut did = Tick::Memory;
        while let Some(answer) = wires.pop(&self.input) {
            self.answered[answer.id as usize] = wires.now();
            self.answers += 1;
            did = Tick::Moved;
        }
        while let Some(&(from, address)) = self.orders.get(self.next) {
            if from > wires.now() {
                wires.sleep_until(from);
                break;
            }
            let request = DramRequest { address, id: self.next as u32, bytes: BURST, write: 0 };
            if !wires.try_push(&self.output, request) {
                break;
            }
            self.next += 1;
            did = Tick::Moved;
        }
        did
    }

    fn items(&self) -> u64 {
        self.answers as u64
    }

    fn resident(&self) -> u64 {
        0
    }
}

sim::circuit! {
    struct Channel for () {
        reader: One<Reader>,
        dram: One<Dram>,
    }
}

/// Bytes of a burst.
const BURST: u16 = 64;

/// A cycle to the channel, one in which a request enters the window, one back.
const HOPS: Cycle = 3;

/// Cycle of each answer, what the channel has counted, and the cycles of all.
fn read(config: DramConfig, orders: Vec<(Cycle, u64)>) -> Result<(Vec<Cycle>, DramCounts, Cycle)> {
    let mut wiring = Wiring::new();
    let (reader, dram) = (wiring.unit("reader", 0), wiring.unit("dram", 0));
    let (output, requests) = wiring.channel("dram_requests", 0, Link::items(64, 4, 1), reader, dram);
    let (answers, input) = wiring.channel("dram_answers", 0, Link::items(64, 4, 1), dram, reader);
    let n = orders.len();
    let mut machine = Channel::new(
        wiring,
        One(Reader { orders, next: 0, answered: vec![0; n], answers: 0, output, input }),
        One(Dram::new(config, vec![requests], vec![answers])),
    );
    run(&mut machine, &mut (), Clock::SkipIdle, 100_000, |m, _| m.reader.answers == n)?;
    let cycles = machine.wires().now();
    Ok((std::mem::take(&mut machine.reader.answered), machine.dram.counts(), cycles))
}

fn runs(setting: &Setting) -> Result<Vec<Row>> {
    let c = DramConfig::ddr4_3200();
    let mut given = c;
    if setting.inject_fault {
        (given.t_faw, given.t_rrd) = (c.t_faw * 6 / 5, c.t_rrd * 6 / 5 + 1);
    }
    let mut rows = Vec::new();
    for k in [1_u64, 2, 4, 8] {
        let runs = setting.pick(8_000, 60_000, 1_000_000) / k;
        let mut random = Random::nth(setting.seed, k);
        let mut orders = Vec::new();
        for _ in 0..runs {
            let row = u64::from(random.below(1 << 20)) * u64::from(c.row_bytes);
            orders.extend((0..k).map(|burst| (0, row + burst * u64::from(BURST))));
        }
        let (_, counts, cycles) = read(given, orders)?;
        let [faw, rrd, cycle] = [c.t_faw, c.t_rrd, c.t_ras + c.t_rp].map(f64::from);
        let activations = (4.0 / faw).min(1.0 / rrd).min(f64::from(c.banks) / cycle);
        let bytes = f64::from(BURST);
        let usable = 1.0 - f64::from(c.t_rfc) / f64::from(c.t_refi);
        let expected = (bytes / f64::from(c.burst_cycles)).min(k as f64 * bytes * activations) * usable;
        let measured = counts.read_bytes as f64 / cycles as f64;
        rows.push(Row::within(format!("runs of {k}: bytes a cycle"), expected, measured, 0.05 * expected));
        let hits = counts.row_hits as f64 / (counts.row_hits + counts.row_misses) as f64;
        rows.push(Row::within(format!("runs of {k}: share of bursts in an open row"), (k - 1) as f64 / k as f64, hits, 0.02));
    }
    Ok(rows)
}

fn latency(setting: &Setting) -> Result<Vec<Row>> {
    let c = DramConfig { t_refi: 0, ..DramConfig::ddr4_3200() };
    let given = if setting.inject_fault { DramConfig { cl: c.cl + 4, ..c } } else { c };
    let row = u64::from(c.row_bytes);
    let mut random = Random::new(setting.seed);
    let mut rows = Vec::new();
    // Far apart, so that nothing overlaps: a closed bank, then its row, then another row of the bank.
    let places = setting.pick(16, 200, 10_000);
    let data = c.cl + c.burst_cycles;
    let expected = [c.t_rcd + data, data, c.t_rp + c.t_rcd + data].map(f64::from);
    let mut worst = expected;
    for _ in 0..places {
        let [bank, at, next] = [c.banks, 1 << 12, 63].map(|n| u64::from(random.below(n)));
        let address = |row_of_bank: u64| (row_of_bank * u64::from(c.banks) + bank) * row;
        let orders = vec![(0, address(at)), (1000, address(at) + (1 + next) * u64::from(BURST)), (2000, address(at + 1))];
        let (answers, _, _) = read(given, orders)?;
        for (which, &answer) in answers.iter().enumerate() {
            let took = (answer - 1000 * which as u64 - HOPS) as f64;
            if (took - expected[which]).abs() >= (worst[which] - expected[which]).abs() {
                worst[which] = took;
            }
        }
    }
    for (which, name) in ["a closed bank", "an open row", "another row open"].into_iter().enumerate() {
        let case = format!("{name}: cycles, the worst of {places} places");
        rows.push(Row::within(case, expected[which], worst[which], 0.02 * expected[which]));
    }
    let n = setting.pick(2_000, 20_000, 1_000_000);
    let start = u64::from(random.below(1 << 12)) * row;
    let (answers, _, _) = read(given, (0..n).map(|k| (0, start + k * u64::from(BURST))).collect())?;
    let peak = f64::from(BURST) / f64::from(c.burst_cycles);
    let measured = ((n - 1) * u64::from(BURST)) as f64 / (answers[n as usize - 1] - answers[0]) as f64;
    rows.push(Row::within("a stream: bytes a cycle", peak, measured, 0.02 * peak));
    Ok(rows)
}
