//! The watchdog, the statistics tree and the checks on wiring.

use super::units::{Item, Sink, Source};
use crate::sim::{Circuit, Clock, In, Link, One, Out, Tick, Unit, Wires, Wiring, run};

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
fn a_stuck_machine_is_stopped_and_shows_its_queues() {
    for clock in [Clock::SkipIdle, Clock::EveryCycle] {
        let mut machine = pair(10);
        machine.sink[0].rest = 100_000;
        let stuck = run(&mut machine, &mut (), clock, 500, |m, _| m.sink[0].log.len() == 10).unwrap_err();
        // The sink takes an item at 1 and rests; the source fills four slots more.
        assert_eq!((stuck.since, stuck.cycle), (4, 504));
        let text = stuck.to_string();
        assert!(text.starts_with("nothing moved from cycle 4 to cycle 504; the machine is stuck\n"), "{text}");
        assert!(text.contains("unit source[0]: blocked, 5 inside"), "{text}");
        let queue = "channel items[0] (source[0] to sink[0]): 4 of 4, head Item { number: 1, pushed: 1 } from cycle 2";
        assert!(text.contains(queue), "{text}");
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

/// So many givers in a ring, each with that many items of its own, over channels of three places.
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
        assert_eq!(text.lines().count(), 1 + 4 + 4, "{text}");
    }
}

#[test]
fn a_machine_that_can_never_move_again_is_stopped_at_once_when_cycles_are_skipped() {
    let mut machine = pair(1);
    let stuck = run(&mut machine, &mut (), Clock::SkipIdle, 1 << 40, |_, _| false).unwrap_err();
    assert_eq!(stuck.since, 1);
}

#[test]
fn a_run_goes_on_where_the_last_one_ended_and_readings_give_frames() {
    let mut machine = pair(5);
    run(&mut machine, &mut (), Clock::SkipIdle, 100, |m, _| m.sink[0].log.len() == 5).unwrap();
    machine.wires_mut().settle();
    let first = machine.tree();
    machine.source.n = 8;
    machine.wires_mut().wake_all();
    run(&mut machine, &mut (), Clock::SkipIdle, 100, |m, _| m.sink[0].log.len() == 8).unwrap();
    machine.wires_mut().settle();
    let frame = machine.tree().since(&first);
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
