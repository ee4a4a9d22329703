//! The watchdog, the statistics tree and the checks on wiring.

use super::units::{Item, Sink, Source};
use crate::sim::{Circuit, Clock, Link, One, Wiring, run};

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
