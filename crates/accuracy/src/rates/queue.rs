//! One server with a queue before it.

use anyhow::{Result, ensure};

use crate::{Row, Section, Setting, Target};
use num::{Cycle, Random};
use sim::kit::{Item, Sink, Worker};
use sim::{Circuit, Clock, Link, One, Out, Tick, Unit, Wires, Wiring, run};

/// A server with a queue before it, against the closed form.
pub const QUEUE: Target = Target {
    id: "queue",
    section: Section::Memory,
    what: "One server of S cycles an item, an item in every cycle with the same chance: it waits rho (S - 1)/(2 (1 - rho)) cycles on \
           average (discrete M/D/1), as the channel's own integral of occupancy has it beside the cycle on the link",
    bound: "2 %",
    fault: "the server takes a cycle longer",
    check,
};

/// Pushes items, one in each cycle with a chance of `chance` in `of`.
struct Arrivals {
    random: Random,
    chance: u32,
    of: u32,
    left: u64,
    next_at: Cycle,
    sent: u64,
    output: Out<Item>,
}

impl Arrivals {
    /// Cycles to the next arrival.
    fn gap(&mut self) -> Cycle {
        1 + (0..).take_while(|_| self.random.below(self.of) >= self.chance).count() as Cycle
    }
}

impl Unit<()> for Arrivals {
    fn tick(&mut self, wires: &mut Wires, _: &mut ()) -> Tick {
        if self.left == 0 {
            return Tick::Idle;
        }
        let now = wires.now();
        if now < self.next_at {
            wires.sleep_until(self.next_at);
            return Tick::Working;
        }
        if !wires.try_push(&self.output, Item { number: self.sent, pushed: now }) {
            return Tick::Blocked;
        }
        self.sent += 1;
        self.left -= 1;
        self.next_at = now + self.gap();
        Tick::Moved
    }

    fn items(&self) -> u64 {
        self.sent
    }

    fn resident(&self) -> u64 {
        self.left
    }
}

sim::circuit! {
    struct Server for () {
        arrivals: One<Arrivals>,
        worker: One<Worker>,
        sink: One<Sink>,
    }
}

/// Items of a run, each of which begins with an empty queue.
const ITEMS: u64 = 50_000;

/// Places of the queue: more than ever wait.
const PLACES: u32 = 4096;

/// The cycles that items spend in the queue in all.
fn residence(random: &mut Random, service: Cycle, chance: u32, of: u32) -> Result<u64> {
    let mut wiring = Wiring::new();
    let [source, server, end] = ["arrivals", "worker", "sink"].map(|name| wiring.unit(name, 0));
    let (output, input) = wiring.channel::<Item>("queue", 0, Link::items(PLACES, 1, 1), source, server);
    let (done, last) = wiring.channel::<Item>("done", 0, Link::items(2, 1, 1), server, end);
    let mut arrivals = Arrivals { random: random.clone(), chance, of, left: ITEMS, next_at: 0, sent: 0, output };
    arrivals.next_at = arrivals.gap() - 1;
    let mut machine = Server::new(wiring, One(arrivals), One(Worker::new(service, input, done)), One(Sink::new(1, last)));
    run(&mut machine, &mut (), Clock::SkipIdle, 1_000_000, |m, _| m.sink.log.len() as u64 == ITEMS)?;
    machine.wires_mut().settle();
    let reading = machine.reading();
    let queue = reading.channels[0];
    ensure!(queue.full_cycles == 0 && queue.items == ITEMS, "the queue was full");
    Ok(queue.occupancy)
}

fn check(setting: &Setting) -> Result<Vec<Row>> {
    let mut rows = Vec::new();
    for service in [4_u32, 16] {
        // Waits of a busy server depend on each other for long: they take more items to know.
        for (tenths, runs) in
            setting.pick(&[(2, 6), (5, 6)][..], &[(2, 10), (5, 20), (8, 80)][..], &[(2, 100), (5, 200), (8, 800)][..])
        {
            let given = service + u32::from(setting.inject_fault);
            // Arrives in a cycle: rho / S.
            let sums = setting.pieces(*runs, |_, random| residence(random, given.into(), *tenths, 10 * service));
            let sum = sums.into_iter().sum::<Result<u64>>()?;
            let rho = f64::from(*tenths) / 10.0;
            let expected = rho * f64::from(service - 1) / (2.0 * (1.0 - rho));
            let measured = sum as f64 / (ITEMS * runs) as f64 - 1.0;
            let case = format!("S = {service}, rho = {rho}, {} items: cycles", ITEMS * runs);
            rows.push(Row::within(case, expected, measured, 0.02 * expected));
        }
    }
    Ok(rows)
}
