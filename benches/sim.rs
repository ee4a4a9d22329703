//! What the pieces of a cycle cost: channels, ticks, caches, memory.
//!
//! `cargo bench --bench sim`. An iteration of a grid is 1000 simulated cycles of 80 units and 160 channels.

use std::hint::black_box;

use criterion::{Criterion, criterion_group, criterion_main};
use fillrate::sim::{Circuit, Clock, In, Link, Out, Tick, Unit, Wires, Wiring, run};

/// Moves an item a cycle from each of its two inputs to the output beside it; makes `seeds` items of its own at first.
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

fillrate::circuit! {
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

criterion_group! {
    name = benches;
    config = Criterion::default().warm_up_time(std::time::Duration::from_millis(300)).measurement_time(std::time::Duration::from_secs(1));
    targets = grids
}
criterion_main!(benches);
