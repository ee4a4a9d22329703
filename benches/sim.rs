//! What the pieces of a cycle cost: channels, ticks, caches, memory.
//!
//! `cargo bench --bench sim`. An iteration of a grid is 1000 simulated cycles of 80 units and 160 channels.

use std::hint::black_box;

use criterion::{Criterion, criterion_group, criterion_main};
use fillrate::mem::{Cache, CacheShape, Dram, DramAnswer, DramConfig, DramRequest};
use fillrate::num::Random;
use fillrate::sim::{Circuit, Clock, In, Link, One, Out, Tick, Unit, Wires, Wiring, run};

/// Moves an item per cycle from each of its two inputs to the output beside it; makes `seeds` items of its own at first.
struct Stage {
    items: u64,
    seeds: [u32; 2],
    inputs: [In<u64>; 2],
    outputs: [Out<u64>; 2],
}

impl Unit<()> for Stage {
    #[inline]
    fn tick(&mut self, wires: &mut Wires, _: &mut ()) -> Tick {
        let mut did = Tick::Idle;
        for lane in 0..2 {
            if self.seeds[lane] > 0 {
                self.seeds[lane] -= u32::from(wires.try_push(&self.outputs[lane], 0));
                did = Tick::Moved;
                continue;
            }
            let Some(item) = wires.front(&self.inputs[lane]) else {
                did = did.or(Tick::Starved);
                continue;
            };
            if !wires.can_push(&self.outputs[lane]) {
                did = did.or(Tick::Blocked);
                continue;
            }
            wires.pop(&self.inputs[lane]);
            wires.push(&self.outputs[lane], item + 1);
            self.items += 1;
            did = Tick::Moved;
        }
        did
    }

    fn items(&self) -> u64 {
        self.items
    }

    fn resident(&self) -> u64 {
        self.seeds.iter().map(|&n| u64::from(n)).sum()
    }
}

fillrate::sim::circuit! {
    /// One ring of stages.
    struct Grid for () {
        a: Vec<Stage>,
        b: Vec<Stage>,
        c: Vec<Stage>,
        d: Vec<Stage>,
    }
}

/// A ring of 80 stages in four banks, in which every `every`-th stage starts with an item for each of its two outputs.
fn grid(every: usize) -> Grid {
    const EACH: usize = 20;
    const ALL: usize = 4 * EACH;
    let mut wiring = Wiring::new();
    let ids: Vec<_> = ["a", "b", "c", "d"].iter().flat_map(|&name| wiring.bank(name, EACH)).collect();
    let mut inputs: Vec<Vec<In<u64>>> = (0..ALL).map(|_| Vec::new()).collect();
    let mut outputs: Vec<Vec<Out<u64>>> = (0..ALL).map(|_| Vec::new()).collect();
    for stage in 0..ALL {
        for lane in 0..2 {
            let next = (stage + 1) % ALL;
            let (output, input) = wiring.channel("hop", 2 * stage + lane, Link::items(4, 1, 1), ids[stage], ids[next]);
            inputs[next].push(input);
            outputs[stage].push(output);
        }
    }
    let mut stages = inputs.into_iter().zip(outputs).enumerate().map(|(number, (inputs, outputs))| Stage {
        items: 0,
        seeds: [u32::from(number % every == 0); 2],
        inputs: inputs.try_into().expect("two inputs"),
        outputs: outputs.try_into().expect("two outputs"),
    });
    let mut bank = || stages.by_ref().take(EACH).collect::<Vec<_>>();
    Grid::new(wiring, bank(), bank(), bank(), bank())
}

fn thousand(machine: &mut Grid, clock: Clock) {
    let end = machine.wires().now() + 1000;
    run(machine, &mut (), clock, 1 << 40, |m, _| m.wires().now() >= end).expect("a ring moves for ever");
}

fn grids(c: &mut Criterion) {
    let mut group = c.benchmark_group("grid");
    for (name, every) in [("all-move", 1), ("a-quarter-moves", 4), ("one-in-20-moves", 20)] {
        for (clock, which) in [(Clock::SkipIdle, "skip-idle"), (Clock::EveryCycle, "every-cycle")] {
            let mut machine = grid(every);
            thousand(&mut machine, clock);
            group.bench_function(format!("{name}/{which}"), |b| b.iter(|| thousand(black_box(&mut machine), clock)));
        }
    }
    group.finish();
}

/// Hits and misses of a 4-way cache of 256 lines; an iteration is 1000 lookups.
fn caches(c: &mut Criterion) {
    let mut group = c.benchmark_group("cache");
    for (name, lines) in [("hits", 200u64), ("misses", 1 << 20)] {
        let mut cache = Cache::new(CacheShape::new(256, 4, 64, 64).expect("a cache"));
        let mut random = Random::new(1);
        let addresses: Vec<u64> = (0..1000).map(|_| u64::from(random.below(lines as u32))).collect();
        group.bench_function(name, |b| {
            b.iter(|| {
                let mut hits = 0;
                for &line in black_box(&addresses) {
                    hits += u32::from(cache.access(line, false).0);
                }
                hits
            });
        });
    }
    group.finish();
}

/// Keeps a channel supplied with reads at addresses `stride` apart in a 16 MiB range.
struct Reader {
    stride: u64,
    sent: u64,
    answers: u64,
    output: Out<DramRequest>,
    input: In<DramAnswer>,
}

impl Unit<()> for Reader {
    #[inline]
    fn tick(&mut self, wires: &mut Wires, _: &mut ()) -> Tick {
        let mut did = Tick::Memory;
        while wires.pop(&self.input).is_some() {
            self.answers += 1;
            did = Tick::Moved;
        }
        while wires.can_push(&self.output) {
            let address = self.sent.wrapping_mul(self.stride) & 0xff_ffc0;
            wires.push(&self.output, DramRequest { address, id: 0, bytes: 64, write: 0 });
            self.sent += 1;
            did = Tick::Moved;
        }
        did
    }

    fn items(&self) -> u64 {
        self.answers
    }

    fn resident(&self) -> u64 {
        0
    }
}

fillrate::sim::circuit! {
    struct Rig for () {
        reader: One<Reader>,
        dram: One<Dram>,
    }
}

/// A DRAM channel that is never short of requests; an iteration is 1000 of them.
fn dram(c: &mut Criterion) {
    let config = DramConfig {
        channels: 1,
        clock: 7,
        card_cycles: 4,
        latency: 1,
        banks: 16,
        bank_groups: 1,
        row_bytes: 2048,
        burst_bytes: 64,
        burst_cycles: 2,
        t_rcd: 24,
        t_rp: 24,
        cl: 24,
        cwl: 8,
        t_ras: 56,
        t_rrd: 12,
        t_faw: 46,
        t_rtp: 4,
        t_wr: 28,
        t_wtr: 10,
        t_rtw: 4,
        t_rfc: 230,
        t_refi: 6800,
        window: 32,
        write_queue: 32,
        write_high: 16,
        write_low: 8,
        hash_banks: true,
        ..DramConfig::default()
    };
    let mut group = c.benchmark_group("dram");
    for (name, stride) in [("one-row-after-another", 64), ("scattered", 0x9e37_79b9_7f4a_7c15)] {
        let mut wiring = Wiring::new();
        let (reader, dram) = (wiring.unit("reader", 0), wiring.unit("dram", 0));
        let (output, requests) = wiring.channel("dram_requests", 0, Link::items(32, 2, 1), reader, dram);
        let (answers, input) = wiring.channel("dram_answers", 0, Link::items(8, 2, 1), dram, reader);
        let reader = Reader { stride, sent: 0, answers: 0, output, input };
        let mut machine = Rig::new(wiring, One(reader), One(Dram::new(config, vec![requests], vec![answers])));
        group.bench_function(name, |b| {
            b.iter(|| {
                let end = machine.reader.answers + 1000;
                run(&mut machine, &mut (), Clock::SkipIdle, 10_000, |m, _| m.reader.answers >= end).expect("memory answers");
            });
        });
    }
    group.finish();
}

fillrate::sim::circuit! {
    struct Two for () {
        stage: Vec<Stage>,
    }
}

/// Two stages that pass items to each other: an iteration is 1000 cycles of 2 ticks and 4 pairs of push and pop.
fn channel(c: &mut Criterion) {
    let mut wiring = Wiring::new();
    let ids = wiring.bank("stage", 2);
    let mut ways = |from: usize| {
        let mut way = |lane| wiring.channel("hop", 2 * from + lane, Link::items(4, 1, 1), ids[from], ids[1 - from]);
        let ((out0, in0), (out1, in1)) = (way(0), way(1));
        ([out0, out1], [in0, in1])
    };
    let ((outputs_a, inputs_b), (outputs_b, inputs_a)) = (ways(0), ways(1));
    let stage = |inputs, outputs| Stage { items: 0, seeds: [1; 2], inputs, outputs };
    let mut machine = Two::new(wiring, vec![stage(inputs_a, outputs_a), stage(inputs_b, outputs_b)]);
    c.bench_function("channel/2-ticks-4-transfers", |b| {
        b.iter(|| {
            let end = machine.wires().now() + 1000;
            run(&mut machine, &mut (), Clock::SkipIdle, 1 << 40, |m, _| m.wires().now() >= end).expect("a ring moves for ever");
        });
    });
}

criterion_group! {
    name = benches;
    config = Criterion::default().warm_up_time(std::time::Duration::from_millis(300)).measurement_time(std::time::Duration::from_secs(1));
    targets = grids, channel, caches, dram
}
criterion_main!(benches);
