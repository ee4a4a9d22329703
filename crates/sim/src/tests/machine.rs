//! The watchdog, the statistics tree and the checks on wiring.

use super::units::{Item, Sink, Source};
use crate::{Cause, Circuit, Clock, In, Link, One, Out, Tick, Unit, Wires, Wiring, run};

crate::circuit! {
    struct Pair for () {
        source: One<Source>,
        sink: Vec<Sink>,
    }
}

fn pair(n: u64) -> Pair {
    let mut wiring = Wiring::new();
    let (source, sink) = (wiring.unit("source", 0), wiring.unit("sink", 0));
    let (output, input) = wiring.channel::<Item>("items", 0, Link::items(4, 1, 1), source, sink);
    Pair::new(wiring, One(Source::new(n, 1, output)), vec![Sink::new(1, input)])
}

#[test]
fn a_machine_that_waits_for_a_known_cycle_is_not_stuck_however_far_it_is() {
    for clock in [Clock::SkipIdle, Clock::EveryCycle, Clock::Shuffled(1)] {
        let mut machine = pair(3);
        machine.sink[0].rest = 100_000;
        run(&mut machine, &mut (), clock, 0, |m, _| m.sink[0].log.len() == 3).unwrap();
        assert_eq!(machine.wires().now(), 200_002, "{clock:?}");
    }
}

/// Wakes in every cycle, for nothing, and so does not sleep as long as its queue is empty.
struct Restless {
    input: In<Item>,
}

impl Unit<()> for Restless {
    fn tick(&mut self, wires: &mut Wires, _: &mut ()) -> Tick {
        let now = wires.now();
        match wires.pop(&self.input) {
            Some(_) => Tick::Moved,
            None => {
                wires.sleep_until(now + 1);
                Tick::Working
            }
        }
    }

    fn items(&self) -> u64 {
        0
    }

    fn resident(&self) -> u64 {
        0
    }
}

crate::circuit! {
    struct Polling for () {
        source: One<Source>,
        restless: One<Restless>,
    }
}

#[test]
fn a_machine_whose_units_wake_for_nothing_is_stopped_and_shows_its_queues() {
    for clock in [Clock::SkipIdle, Clock::EveryCycle] {
        let mut wiring = Wiring::new();
        let (source, restless) = (wiring.unit("source", 0), wiring.unit("restless", 0));
        let (output, input) = wiring.channel::<Item>("items", 0, Link::items(4, 1, 1), source, restless);
        let mut machine = Polling::new(wiring, One(Source::new(10, 1, output)), One(Restless { input }));
        let stuck = run(&mut machine, &mut (), clock, 500, |_, _| false).unwrap_err();
        // The last item leaves in cycle 10. Questions that may be asked: 4 for the channel, 8 for each unit.
        assert_eq!((stuck.since, stuck.cause), (10, Cause::Restless(521)));
        let text = stuck.to_string();
        let head =
            "nothing has moved since cycle 10, and units woke in 521 cycles without moving anything; the machine is stuck\n";
        assert!(text.starts_with(head), "{text}");
        assert!(text.contains("unit restless[0]: busy, 0 inside"), "{text}");
    }
}

/// Gives its own items before it takes those of its neighbour.
struct Giver {
    own: u64,
    taken: u64,
    input: In<Item>,
    output: Out<Item>,
}

impl Unit<()> for Giver {
    fn tick(&mut self, wires: &mut Wires, _: &mut ()) -> Tick {
        if self.own > 0 {
            if !wires.try_push(&self.output, Item { number: self.own, pushed: wires.now() }) {
                return Tick::Blocked;
            }
            self.own -= 1;
            return Tick::Moved;
        }
        let Some(_) = wires.pop(&self.input) else { return Tick::Starved };
        self.taken += 1;
        Tick::Moved
    }

    fn items(&self) -> u64 {
        self.taken
    }

    fn resident(&self) -> u64 {
        self.own
    }
}

crate::circuit! {
    struct Ring for () {
        giver: Vec<Giver>,
    }
}

/// A ring of `givers` givers, each with `own` items of its own, over channels of three slots.
fn ring(givers: usize, own: u64) -> Ring {
    let mut wiring = Wiring::new();
    let ids = wiring.bank("giver", givers);
    let (mut outputs, mut inputs) = (Vec::new(), Vec::new());
    for index in 0..givers {
        let link = Link::items(3, 1, 1);
        let (output, input) = wiring.channel::<Item>("gifts", index, link, ids[index], ids[(index + 1) % givers]);
        outputs.push(output);
        inputs.push(input);
    }
    inputs.rotate_right(1);
    let giver = |(output, input)| Giver { own, taken: 0, input, output };
    Ring::new(wiring, outputs.into_iter().zip(inputs).map(giver).collect())
}

#[test]
fn a_ring_that_waits_for_itself_is_stopped_and_shows_every_queue() {
    for clock in [Clock::SkipIdle, Clock::EveryCycle, Clock::Shuffled(3)] {
        // Three items fit on the way to each neighbour: all is taken.
        let mut machine = ring(4, 3);
        run(&mut machine, &mut (), clock, 50, |m, _| m.giver.iter().all(|giver| giver.taken == 3)).unwrap();
        // A fourth does not, and nobody takes before he has given. The last push was in cycle 2.
        let mut machine = ring(4, 4);
        let stuck = run(&mut machine, &mut (), clock, 50, |m, _| m.giver.iter().all(|giver| giver.taken == 4)).unwrap_err();
        assert_eq!(stuck.since, 2);
        let text = stuck.to_string();
        for giver in 0..4 {
            let next = (giver + 1) % 4;
            assert!(text.contains(&format!("\nunit giver[{giver}]: blocked, 1 inside\n")), "{text}");
            let queue = format!(
                "\nchannel gifts[{giver}] (giver[{giver}] to giver[{next}]): 3 of 3, head Item {{ number: 4, pushed: 0 }} from cycle 1\n"
            );
            assert!(text.contains(&queue), "{text}");
        }
        // The reason, whom to tell, the units and the channels.
        assert_eq!(text.lines().count(), 2 + 4 + 4, "{text}");
    }
}

#[test]
fn a_machine_that_can_never_move_again_is_stopped_at_once() {
    for clock in [Clock::SkipIdle, Clock::EveryCycle, Clock::Shuffled(2)] {
        let mut machine = pair(1);
        let stuck = run(&mut machine, &mut (), clock, 1 << 40, |_, _| false).unwrap_err();
        assert_eq!((stuck.since, stuck.cause), (1, Cause::Dead), "{clock:?}");
    }
}

#[test]
fn a_run_goes_on_where_the_last_one_ended_and_readings_give_frames() {
    let mut machine = pair(5);
    run(&mut machine, &mut (), Clock::SkipIdle, 100, |m, _| m.sink[0].log.len() == 5).unwrap();
    machine.wires_mut().settle();
    let first = machine.reading();
    machine.source.n = 8;
    machine.wires_mut().wake_all();
    run(&mut machine, &mut (), Clock::SkipIdle, 100, |m, _| m.sink[0].log.len() == 8).unwrap();
    machine.wires_mut().settle();
    let frame = machine.wires().tree(&machine.reading().since(&first), &[3, 3]);
    for (path, expected) in [
        ("units.source[0].items", 3.0),
        ("units.source[0].busy", 3.0),
        ("units.source[0].idle", 1.0),
        ("units.sink[0].busy", 3.0),
        ("units.sink[0].starved", 1.0),
        ("channels.items[0].items", 3.0),
        ("channels.items[0].bytes", 48.0),
        ("channels.items[0].mean_occupancy", 0.75),
        ("channels.items[0].capacity", 4.0),
    ] {
        assert_eq!(frame.number(path), Some(expected), "{path}");
    }
}

#[test]
#[should_panic(expected = "the units are declared as")]
fn units_declared_out_of_order_are_refused() {
    let mut wiring = Wiring::new();
    let (sink, source) = (wiring.unit("sink", 0), wiring.unit("source", 0));
    let (output, input) = wiring.channel::<Item>("items", 0, Link::items(4, 1, 1), source, sink);
    Pair::new(wiring, One(Source::new(1, 1, output)), vec![Sink::new(1, input)]);
}

#[test]
#[should_panic(expected = "cycle 0: items[0] is pushed into without asking")]
fn a_push_without_room_names_channel_and_cycle() {
    let mut wiring = Wiring::new();
    let (source, sink) = (wiring.unit("source", 0), wiring.unit("sink", 0));
    let (output, input) = wiring.channel::<u32>("items", 0, Link::items(1, 1, 1), source, sink);
    let mut wires = wiring.finish();
    wires.push(&output, 1);
    assert!(!wires.can_push(&output));
    assert!(!wires.can_pop(&input));
    wires.push(&output, 2);
}
