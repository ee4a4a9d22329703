//! The command processor: what a command takes, slots, clears, transfers, the order of events.

use std::collections::VecDeque;
use std::sync::Arc;

use super::kit::{Echo, FREE, Sink, memory, port, round_trip, settle, write_time};
use super::scenery::{attachment, card, draw, draw_with, pass, surface};
use crate::Card;
use crate::command::{Command, CommandConfig, CommandPorts, CullChoice};
use crate::scanout::ScanoutConfig;
use crate::token::{Ack, Kind, NextDraw, Piece};
use gfx::format::Format;
use mem::{ClientCounts, Ideal};
use num::{Cycle, OUR_FAULT};
use sim::{Circuit, Clock, In, One, Out, StallProbe, Tick, Unit, Wires, Wiring, run};
use work::*;

/// Stands for everything between the command processor and the ROPs. It reports a fence `after` cycles after it came. The colour and the
/// depth units both report the fence of a pass.
struct Pipeline {
    got: Vec<(Cycle, Kind)>,
    after: Cycle,
    held: VecDeque<(Cycle, Piece)>,
    /// Pipelines that have reported the current fence.
    reported: usize,
    input: In<Piece>,
    /// To the colour units' and the depth units' reports, a pipeline each.
    color: Vec<Out<Ack>>,
    depth: Vec<Out<Ack>>,
}

impl Unit<Card> for Pipeline {
    fn tick(&mut self, wires: &mut Wires, _: &mut Card) -> Tick {
        let mut did = Tick::Starved;
        while let Some(piece) = wires.pop(&self.input) {
            self.got.push((wires.now(), piece.kind));
            if piece.kind.is_fence() {
                self.held.push_back((wires.now() + self.after, piece));
            }
            did = Tick::Moved;
        }
        while let Some(&(at, Piece { slot, kind })) = self.held.front() {
            if at > wires.now() {
                wires.sleep_until(at);
                return did.or(Tick::Working);
            }
            // The second pipeline is 5 cycles behind the first.
            let number = self.reported;
            wires.push(&self.color[number], Ack { slot, kind });
            if kind == Kind::PASS {
                wires.push(&self.depth[number], Ack { slot, kind });
            }
            if number + 1 < self.color.len() {
                self.reported += 1;
                self.held[0].0 = wires.now() + 5;
                did = Tick::Moved;
                continue;
            }
            self.reported = 0;
            self.held.pop_front();
            did = Tick::Moved;
        }
        did
    }

    fn items(&self) -> u64 {
        self.got.len() as u64
    }

    fn resident(&self) -> u64 {
        self.held.len() as u64
    }
}

sim::circuit! {
    struct CommandCircuit for Card {
        command: One<Command>,
        pipeline: One<Pipeline>,
        compute: One<Echo<Piece, Ack>>,
        resolve: One<Echo<Piece, Ack>>,
        scanout: One<Echo<Piece, Ack>>,
        turns: Option<Sink<NextDraw>>,
        ideal: Option<Ideal>,
    }
}

fn config() -> CommandConfig {
    CommandConfig {
        command_cycles: 8,
        segments: 8,
        states: 8,
        state_cycles: 0,
        workgroup_runs: 2,
        copy_misses: 16,
        barrier_cycles: 50,
        skip_empty_passes: true,
        cull: CullChoice::None,
        cull_cycles: 5,
        ..CommandConfig::default()
    }
}

/// How the card clears, whether it shows frames, and its pipelines.
#[derive(Clone, Copy)]
struct Features {
    fast_clear: bool,
    scanout: bool,
    pipelines: usize,
}

const PLAIN: Features = Features { fast_clear: true, scanout: false, pipelines: 1 };

/// Cycles that each of the other units takes here from a command to its answer.
const REPLY: Cycle = 30;

fn circuit(config: &CommandConfig, of: Features, events: &[Event]) -> (CommandCircuit, Card) {
    let mut wiring = Wiring::new();
    let ids = ["command", "pipeline", "compute", "resolve", "scanout"].map(|name| wiring.unit(name, 0));
    let (told, turns) = if config.drain {
        let distribution = wiring.unit("turns", 0);
        let (told, heeded) = wiring.channel("turns", 0, FREE, ids[0], distribution);
        (vec![told], Some(Sink::new(heeded)))
    } else {
        (Vec::new(), None)
    };
    let mut plan = memory(&mut wiring);
    let (fetch, at_fetch) = wiring.channel("pieces", 0, FREE, ids[0], ids[1]);
    let acks = (0..2 * of.pipelines).map(|index| wiring.channel("acks", index, FREE, ids[1], ids[0]));
    let (mut color, acks): (Vec<_>, Vec<_>) = acks.unzip();
    let depth = color.split_off(of.pipelines);
    let mut outputs = Vec::new();
    let mut inputs = Vec::new();
    let mut echoes = Vec::new();
    for (index, &id) in ids[2..].iter().enumerate() {
        let (to, input) = wiring.channel("tasks", index, FREE, ids[0], id);
        let (output, from) = wiring.channel("answers", index, FREE, id, ids[0]);
        outputs.push(to);
        inputs.push(from);
        echoes.push(One(Echo::answering(REPLY, |Piece { slot, kind }, _| Ack { slot, kind }, input, output)));
    }
    let mut outputs = outputs.into_iter();
    let mut inputs = inputs.into_iter();
    let mut next = || (outputs.next().expect("three"), inputs.next().expect("three"));
    let ((compute, computed), (resolve, resolved), (scanout, scanned)) = (next(), next(), next());
    let ports = CommandPorts {
        fetch,
        compute,
        computed,
        resolve: vec![resolve],
        resolved: vec![resolved],
        scanout,
        scanned,
        compose: Vec::new(),
        composed: Vec::new(),
        acks,
        binned: Vec::new(),
        next_draw: told,
        memory: port(&mut plan, &mut wiring, ids[0]),
        probe: StallProbe::default(),
    };
    let mut card = card(1);
    card.events.extend(events.iter().cloned());
    card.closed = true;
    // The pipelines together clear 4 blocks per cycle by flag.
    let shows = ScanoutConfig { enabled: of.scanout, ..ScanoutConfig::default() };
    let command = Command::new(config.clone(), (of.pipelines as u32, config.segments), (of.fast_clear, 4), &shows, ports);
    let held = VecDeque::new();
    let pipeline = Pipeline { got: Vec::new(), after: REPLY, held, reported: 0, input: at_fetch, color, depth };
    let mut echoes = echoes.into_iter();
    let mut next = || echoes.next().expect("three");
    let (compute, resolve, scanout) = (next(), next(), next());
    let ideal = plan.build(&mut wiring).ideal;
    (CommandCircuit::new(wiring, One(command), One(pipeline), compute, resolve, scanout, turns, ideal), card)
}

/// A circuit of which the stores hold the image that passes here load.
fn loaded(config: &CommandConfig, of: Features, events: &[Event]) -> (CommandCircuit, Card) {
    let (circuit, mut card) = circuit(config, of, events);
    let contents = Contents { surface: surface(1, Format::Rgba8Unorm, 16, 1), bytes: [].into() };
    card.holdings.apply(&Event::Contents(contents)).expect("it needs nothing");
    (circuit, card)
}

/// The results of the command processor.
#[derive(Debug, PartialEq)]
struct Commanded {
    /// When pieces came to vertex fetch.
    pieces: Vec<(Cycle, Kind)>,
    /// When runs of workgroups, attachments to be resolved, and frames to be shown came to their units.
    compute: Vec<Cycle>,
    resolve: Vec<Cycle>,
    scanout: Vec<Cycle>,
    /// When it told which draw may be rasterised.
    turns: Vec<(Cycle, u32)>,
    /// The cycle after the one in which the frame was over.
    over: Cycle,
    memory: ClientCounts,
}

/// Runs events, the last of which ends a frame.
fn commanded(config: &CommandConfig, of: Features, events: &[Event]) -> Commanded {
    // Writes may still be on their way when the command processor is done.
    let written = settle(
        || loaded(config, of, events),
        |c, _| c.command.frame_over() && c.wires().resident() == 0,
        |c, _| c.ideal.as_ref().unwrap().counts()[0],
    );
    settle(
        || loaded(config, of, events),
        |c, _| c.command.frame_over(),
        |c, card| {
            assert!(card.events.is_empty() && card.work.iter().all(Option::is_none));
            assert_eq!(c.command.items(), events.len() as u64);
            Commanded {
                pieces: c.pipeline.got.clone(),
                compute: c.compute.times(),
                resolve: c.resolve.times(),
                scanout: c.scanout.times(),
                turns: c.turns.as_ref().map_or(Vec::new(), |turns| turns.log(|turn| turn.draw)),
                over: c.wires().now(),
                memory: written,
            }
        },
    )
}

/// A pass over 16 blocks, with that load.
fn begin(load: Load, resolve: bool) -> Event {
    let target = surface(1, Format::Rgba8Unorm, 16, 1);
    let resolve = resolve.then(|| surface(2, Format::Rgba8Unorm, 16, 1));
    Event::BeginPass(Arc::new(pass(vec![Some(Attachment { load, resolve, ..attachment(target) })], None)))
}

fn draws(segments: usize) -> Vec<Event> {
    let mut events = vec![Event::Draw(Arc::new(draw()))];
    events.extend((0..segments).map(|_| Event::Segment(Arc::new(Segment::default()))));
    events
}

/// A frame that shows the surface of the passes here.
fn end() -> Event {
    let shown = Some(surface(1, Format::Rgba8Unorm, 16, 1));
    Event::EndFrame(EndFrame { number: 0, shown, reference: Vec::new().into(), drawn: false, sprites: [].into() })
}

/// A pass with one draw of `segments` segments, and the end of the frame.
fn frame(load: Load, resolve: bool, segments: usize) -> Vec<Event> {
    [vec![begin(load, resolve)], draws(segments), vec![Event::EndPass(None), end()]].concat()
}

#[test]
fn commands_take_their_cycles() {
    // The pass begins in cycle 0, is decoded by 8 and has nothing to clear: the draw is read in 9 and takes no time; segments in 10, 18
    // and 26, the end of the pass in 34. What each brings is sent a cycle later, and is a cycle on the way.
    let got = commanded(&config(), PLAIN, &frame(Load::Load, false, 3));
    let times = [(12, Kind::DATA), (12, Kind::SEGMENT), (20, Kind::DATA), (20, Kind::SEGMENT), (28, Kind::DATA)];
    assert_eq!(got.pieces[..5], times);
    assert_eq!(got.pieces[5..], [(28, Kind::SEGMENT), (36, Kind::PASS)]);
    // The pipeline reports the end in 36 + 30, seen a cycle later; a cycle to find nothing to be resolved; then the barrier. The frame
    // ends in the cycle after it.
    let ended = 36 + REPLY + 1;
    assert_eq!(got.over, ended + 1 + 50 + 1);
    // Without a barrier the next event is read in the cycle after.
    let none = CommandConfig { barrier_cycles: 0, ..config() };
    assert_eq!(commanded(&none, PLAIN, &frame(Load::Load, false, 3)).over, ended + 1 + 1 + 1);
}

#[test]
fn a_segment_needs_a_slot() {
    // One slot: the second segment is read when the first, which came to the pipeline in cycle 12, is reported: seen in 12 + 30 + 1.
    let one = CommandConfig { segments: 1, ..config() };
    let got = commanded(&one, PLAIN, &frame(Load::Load, false, 3));
    let data: Vec<_> = got.pieces.iter().filter(|(_, kind)| *kind == Kind::DATA).map(|&(at, _)| at).collect();
    let turn = REPLY + 1 + 2;
    assert_eq!(data, [12, 12 + turn, 12 + 2 * turn]);
    // All pipelines must have reported it; the second does so 5 cycles later.
    let two = Features { pipelines: 2, ..PLAIN };
    let got = commanded(&one, two, &frame(Load::Load, false, 3));
    let data: Vec<_> = got.pieces.iter().filter(|(_, kind)| *kind == Kind::DATA).map(|&(at, _)| at).collect();
    assert_eq!(data, [12, 12 + turn + 5, 12 + 2 * (turn + 5)]);
}

#[test]
fn draws_are_rasterised_in_turn() {
    // Draws of two segments and of one, 8 cycles apart. The turn of the first draw is sent in cycle 11, the one after its segment is read, and
    // is a cycle on the way. Its second segment comes to the pipeline in 20, and is reported in 50: then it is the turn of the second draw.
    let drain = CommandConfig { drain: true, ..config() };
    let events = [vec![begin(Load::Load, false)], draws(2), draws(1), vec![Event::EndPass(None), end()]].concat();
    let got = commanded(&drain, PLAIN, &events);
    assert_eq!(got.turns, [(12, 1), (20 + REPLY + 1 + 1, 2)]);
    let plain = commanded(&config(), PLAIN, &events);
    assert_eq!(Commanded { turns: Vec::new(), ..got }, plain);
}

#[test]
fn a_change_of_state_takes_cycles_and_waits_for_a_free_state() {
    // A draw with a state, and its segment.
    let drawn = |states: &[u32]| {
        let one = |&state: &u32| {
            [Event::Draw(Arc::new(draw_with(|of| of.number = state))), Event::Segment(Arc::new(Segment::default()))]
        };
        [vec![begin(Load::Load, false)], states.iter().flat_map(one).collect(), vec![Event::EndPass(None), end()]].concat()
    };
    let data = |config: &CommandConfig, states: &[u32]| -> Vec<Cycle> {
        let got = commanded(config, PLAIN, &drawn(states));
        got.pieces.iter().filter(|(_, kind)| *kind == Kind::DATA).map(|&(at, _)| at).collect()
    };
    // The first draw sets its state. A draw is read in one cycle, and its segment takes 8; those that change nothing take no more.
    assert_eq!(data(&config(), &[3, 3, 3, 4]), [12, 21, 30, 39]);
    let slow = CommandConfig { state_cycles: 20, ..config() };
    assert_eq!(data(&slow, &[3, 3, 3, 3]), [31, 40, 49, 58]);
    assert_eq!(data(&slow, &[3, 3, 4, 3]), [31, 40, 49 + 19, 58 + 2 * 19]);
    // With one state the draw with another is read when the last segment with the first one is reported: its fence comes to the pipeline in
    // cycle 21, and is seen to be reported in 21 + 30 + 1.
    let one = CommandConfig { states: 1, ..config() };
    assert_eq!(data(&one, &[3, 3, 4, 4]), [12, 21, 21 + REPLY + 1 + 1 + 2, 21 + REPLY + 1 + 1 + 2 + 9]);
    // With two states the third draw waits for the first.
    let two = CommandConfig { states: 2, ..config() };
    assert_eq!(data(&two, &[3, 4, 5]), [12, 21, 12 + REPLY + 1 + 1 + 2]);
    // The next pass sets its state anew.
    let twice = [drawn(&[3])[..4].to_vec(), drawn(&[3])].concat();
    let changes = |config: &CommandConfig, events: &[Event]| {
        settle(|| loaded(config, PLAIN, events), |c, _| c.command.frame_over(), |c, _| c.command.counts().state_changes)
    };
    assert_eq!(changes(&config(), &twice), 2);
    assert_eq!(changes(&config(), &drawn(&[3, 3, 4, 3])), 3);
}

#[test]
fn clears_set_flags_or_write_memory() {
    let clear = Load::Clear([0; 4]);
    // Sixteen flags at four per cycle: 4 cycles more before the draw.
    let got = commanded(&config(), PLAIN, &frame(clear, false, 1));
    assert_eq!((got.pieces[0].0, got.memory.write_bytes), (12 + 4, 0));
    // Sixteen blocks of 256 bytes: begun in cycle 8, the first sent in 9; when the last is sent, a cycle to see that, and the draw.
    let slow = Features { fast_clear: false, ..PLAIN };
    let got = commanded(&config(), slow, &frame(clear, false, 1));
    let done = 9 + write_time(15, 256);
    assert_eq!((got.pieces[0].0, got.memory.write_bytes), (done + 1 + 1 + 1 + 2, 16 * 256));
}

#[test]
fn attachments_are_resolved_when_the_pass_is_over() {
    let got = commanded(&config(), PLAIN, &frame(Load::Load, true, 1));
    let plain = commanded(&config(), PLAIN, &frame(Load::Load, false, 1));
    // The end of the pass came in 20 to the pipeline and is seen in 20 + 30 + 1; the resolve is asked for a cycle later, and a cycle
    // on the way; its answer takes as long as any. That much later the pass is over.
    assert_eq!(got.resolve, [20 + REPLY + 1 + 1 + 1]);
    assert_eq!(got.over, plain.over + 1 + REPLY + 1);
}

#[test]
fn a_frame_is_shown_before_it_is_over() {
    let shown = commanded(&config(), Features { scanout: true, ..PLAIN }, &frame(Load::Load, false, 1));
    let plain = commanded(&config(), PLAIN, &frame(Load::Load, false, 1));
    // Asked for in the cycle in which the frame would be over; a cycle on the way, and one back. (The command takes 8 cycles, which
    // are over by then.)
    assert_eq!(shown.scanout, [plain.over - 1 + 1]);
    assert_eq!(shown.over, plain.over + 1 + REPLY + 1);
}

fn transfer(from: Option<u64>, to: Option<u64>, bytes: u64) -> Event {
    let reach = |at: Option<u64>| at.map(|at| Extent::new(at, bytes));
    Event::Transfer(Transfer {
        kind: TransferKind::Copy,
        from,
        to,
        bytes,
        reads: reach(from),
        writes: reach(to),
        surfaces: None,
    })
}

#[test]
fn transfers_read_and_write_as_fast_as_the_port_goes() {
    let over = |config: &CommandConfig, from, to, bytes| {
        let got = commanded(config, PLAIN, &[transfer(from, to, bytes), end()]);
        (got.over, got.memory.read_bytes, got.memory.write_bytes)
    };
    // Decoded by cycle 8. Four reads go out in it; their answers come 4 cycles apart, each is written in the cycle in which it comes.
    // The frame ends in the cycle after the last.
    let read = |n: Cycle| 8 + round_trip(256) + 4 * n;
    assert_eq!(over(&config(), Some(1 << 20), Some(2 << 20), 1024), (read(3) + 1 + 1, 1024, 1024));
    // One read at a time, each behind the write before it.
    let one = CommandConfig { copy_misses: 1, ..config() };
    let last = 8 + 4 * round_trip(256) + 3 * write_time(1, 256);
    assert_eq!(over(&one, Some(1 << 20), Some(2 << 20), 1024), (last + 1 + 1, 1024, 1024));
    // Only written, or only read.
    assert_eq!(over(&config(), None, Some(2 << 20), 1024), (8 + write_time(3, 256) + 1 + 1, 0, 1024));
    assert_eq!(over(&config(), Some(1 << 20), None, 1024), (read(3) + 1 + 1, 1024, 0));
    // A run that does not begin at a multiple of 256 takes one request more, of as many bytes in all: no more time.
    assert_eq!(over(&config(), Some((1 << 20) + 156), None, 1024), (read(3) + 1 + 1, 1024, 0));
}

#[test]
fn runs_of_workgroups_need_places_and_passes_wait_for_them() {
    let dispatch = Dispatch {
        number: 0,
        label: String::new(),
        shape: ShaderShape::default(),
        groups: 3,
        invocations: 32,
        shared_bytes: 0,
        reach: Reach::default(),
        programs: Programs::default(),
    };
    let groups = || Event::Groups(Arc::new(Groups::default()));
    let events =
        [vec![Event::Dispatch(Arc::new(dispatch)), groups(), groups(), groups()], frame(Load::Load, false, 1)].concat();
    let got = commanded(&config(), PLAIN, &events);
    // The dispatch is read in cycle 0, runs in 8 and 16, sent a cycle later and a cycle on the way. There are two places: the third run
    // is read when the first is done: 10 + 30 + 1.
    let third = 10 + REPLY + 1;
    assert_eq!(got.compute, [10, 18, third + 2]);
    // The pass begins when the third is done, and goes on as it does from cycle 0.
    let pass = third + 2 + REPLY + 1;
    assert_eq!(got.pieces[0], (pass + 12, Kind::DATA));
}

/// A pass over 16 blocks of a texture, with one segment of a draw that may touch this.
fn pass_of(texture: u32, reads: &[u32]) -> Vec<Event> {
    let target = attachment(surface(texture, Format::Rgba8Unorm, 16, 1));
    let clear = Attachment { load: Load::Clear([0; 4]), ..target };
    let mut reach = Reach::default();
    reads.iter().for_each(|&texture| reach.reads.add(surface(texture, Format::Rgba8Unorm, 16, 1).extent()));
    let draw = Draw { reach: Arc::new(reach), ..draw() };
    let pass = Event::BeginPass(Arc::new(pass(vec![Some(clear)], None)));
    vec![pass, Event::Draw(Arc::new(draw)), Event::Segment(Arc::new(Segment::default())), Event::EndPass(None)]
}

/// The processor with these switches. Clears take no time, so that passes are decoded as those that load.
fn beside(overlap: bool, async_compute: bool) -> CommandConfig {
    CommandConfig { overlap, async_compute, ..config() }
}

#[test]
fn passes_overlap_unless_one_writes_what_the_other_touches() {
    // Clears of 16 blocks by flag take 4 cycles, at 4 per cycle: each pass is decoded by 12.
    let times = |overlap: bool, passes: &[Vec<Event>]| {
        let got = commanded(&beside(overlap, false), PLAIN, &[passes.concat(), vec![end()]].concat());
        let data = got.pieces.iter().filter(|(_, kind)| *kind == Kind::DATA).map(|&(at, _)| at).collect::<Vec<_>>();
        (data, got.over)
    };
    // The first pass's segment comes to the pipeline in 16, and its end, read in 22, in 24. It is reported in 24 + 30 and seen a cycle later; a
    // cycle later it has ended, and behind the barrier the next pass is read.
    let ended = 24 + REPLY + 1 + 1;
    let next = ended + 50;
    let one_by_one = (vec![16, next + 16], 2 * next + 1);
    assert_eq!(times(false, &[pass_of(1, &[]), pass_of(3, &[])]), one_by_one);
    // With overlap it is read when the end of the first is decoded, 22 + 8; the frame ends behind both.
    let both = (vec![16, 30 + 16], 30 + next + 1);
    assert_eq!(times(true, &[pass_of(1, &[]), pass_of(3, &[])]), both);
    assert_eq!(times(true, &[pass_of(1, &[5]), pass_of(3, &[5])]), both);
    // It draws into what the first has drawn into, or has read.
    assert_eq!(times(true, &[pass_of(1, &[]), pass_of(1, &[])]), one_by_one);
    assert_eq!(times(true, &[pass_of(1, &[3]), pass_of(3, &[])]), one_by_one);
    // Its draw reads what the first has drawn. The pass itself, decoded by 42, is ahead of it: the draw is read behind the barrier, and its
    // segment a cycle later.
    let (data, over) = times(true, &[pass_of(1, &[]), pass_of(3, &[1])]);
    assert_eq!(data, [16, next + 1 + 2]);
    // Its end is read 8 cycles behind the segment, and takes as long as the first's.
    assert_eq!(over, next + 1 + 8 + (ended - 22) + 50 + 1);
}

#[test]
fn four_passes_are_in_flight_at_most() {
    let passes: Vec<Event> = (0..6).flat_map(|number| pass_of(1 + 2 * number, &[])).collect();
    let got = commanded(&beside(true, false), PLAIN, &[passes, vec![end()]].concat());
    let data: Vec<_> = got.pieces.iter().filter(|(_, kind)| *kind == Kind::DATA).map(|&(at, _)| at).collect();
    // A pass each 30 cycles; one has ended 26 cycles after its end was read: by then the next but one has not begun.
    assert_eq!(data, [16, 46, 76, 106, 136, 166]);
    // Behind an answer that takes 200 cycles the fifth waits for the first, which has ended in 24 + 202, and depends on nothing.
    let (mut circuit, mut card) =
        circuit(&beside(true, false), PLAIN, &[(0..6).flat_map(|n| pass_of(1 + 2 * n, &[])).collect(), vec![end()]].concat());
    circuit.pipeline.0.after = 200;
    run(&mut circuit, &mut card, Clock::SkipIdle, 1000, |c, _| c.command.frame_over()).expect("it ends");
    let data: Vec<_> = circuit.pipeline.got.iter().filter(|(_, kind)| *kind == Kind::DATA).map(|&(at, _)| at).collect();
    assert_eq!(data, [16, 46, 76, 106, 226 + 16, 226 + 30 + 16]);
}

#[test]
fn copies_run_beside_passes_that_do_not_touch_their_memory() {
    let times = |overlap: bool, from: u64, to: u64, texture: u32| {
        let events = [pass_of(1, &[]), vec![transfer(Some(from), Some(to), 4096)], pass_of(texture, &[]), vec![end()]];
        let got = commanded(&beside(overlap, false), PLAIN, &events.concat());
        assert_eq!((got.memory.read_bytes, got.memory.write_bytes), (4096, 4096));
        let data: Vec<_> = got.pieces.iter().filter(|(_, kind)| *kind == Kind::DATA).map(|&(at, _)| at).collect();
        data[1]
    };
    let of = |texture: u64| texture << 24;
    // What is read behind a copy that is the first command.
    let copy = commanded(&config(), PLAIN, &[transfer(Some(of(7)), Some(of(8)), 4096), end()]).over - 1;
    assert!(copy > 8 + round_trip(256) + 4 * 15, "{copy}");
    let ended = 24 + REPLY + 1 + 1 + 50;
    assert_eq!(times(false, of(7), of(8), 3), ended + copy + 16);
    // The copy is read in 30, and the pass behind it in 38.
    assert_eq!(times(true, of(7), of(8), 3), 38 + 16);
    // The copy writes what the second pass draws into, or reads it.
    assert_eq!(times(true, of(7), of(3), 3), 30 + copy + 16);
    assert_eq!(times(true, of(3), of(7), 3), 30 + copy + 16);
    // It reads, or writes, what the first has drawn: it waits for that, and the second pass begins beside it.
    assert_eq!(times(true, of(1), of(8), 3), ended + 8 + 16);
    assert_eq!(times(true, of(8), of(1), 3), ended + 8 + 16);
    // It ends in front of what the second pass draws into, or one request behind.
    assert_eq!(times(true, of(7), of(3) - 3840, 3), 30 + copy + 16);
    assert_eq!(times(true, of(7), of(3) - 4096, 3), 38 + 16);
}

#[test]
fn dispatches_run_beside_passes_and_each_other_where_the_card_lets_them() {
    let dispatch_of = |reads: u32, writes: u32| {
        let mut reach = Reach::default();
        reach.reads.add(surface(reads, Format::Rgba8Unorm, 16, 1).extent());
        reach.writes.add(surface(writes, Format::Rgba8Unorm, 16, 1).extent());
        let dispatch = Dispatch {
            number: 0,
            label: String::new(),
            shape: ShaderShape::default(),
            groups: 1,
            invocations: 32,
            shared_bytes: 0,
            reach,
            programs: Programs::default(),
        };
        vec![Event::Dispatch(Arc::new(dispatch)), Event::Groups(Arc::new(Groups::default()))]
    };
    let run = |config: CommandConfig, parts: [Vec<Event>; 3]| {
        let got = commanded(&config, PLAIN, &[parts.concat(), vec![end()]].concat());
        let data: Vec<_> = got.pieces.iter().filter(|(_, kind)| *kind == Kind::DATA).map(|&(at, _)| at).collect();
        (data, got.compute)
    };
    let ended = 24 + REPLY + 1 + 1 + 50;
    // A dispatch is decoded in 8 cycles, and its run is read then, sent a cycle later and one on the way. It is done 31 cycles later.
    let done = 10 + REPLY + 1;
    let parts = || [pass_of(1, &[]), dispatch_of(5, 7), pass_of(3, &[])];
    let alone = (vec![16, ended + done + 16], vec![ended + 10]);
    assert_eq!(run(beside(false, false), parts()), alone);
    // Beside passes, but these not beside each other; and all beside all.
    assert_eq!(run(beside(false, true), parts()), (vec![16, ended + 16], vec![30 + 10]));
    assert_eq!(run(beside(true, true), parts()), (vec![16, 46 + 16], vec![30 + 10]));
    // Passes overlap, and a dispatch waits for both kinds.
    assert_eq!(run(beside(true, false), parts()), alone);
    // The dispatch reads what the first pass has drawn; or writes what the second draws into.
    let reads = [pass_of(1, &[]), dispatch_of(1, 7), pass_of(3, &[])];
    assert_eq!(run(beside(true, true), reads), (vec![16, ended + 16 + 16], vec![ended + 10]));
    let writes = [pass_of(1, &[]), dispatch_of(5, 3), pass_of(3, &[])];
    assert_eq!(run(beside(true, true), writes), (vec![16, ended + 16], vec![30 + 10]));
    // Two dispatches, and the second reads what the first writes.
    let two = |reads| [dispatch_of(5, 7), dispatch_of(reads, 9), Vec::new()];
    assert_eq!(run(beside(false, false), two(5)).1, [10, done + 10]);
    assert_eq!(run(beside(false, true), two(5)).1, [10, 16 + 10]);
    assert_eq!(run(beside(false, true), two(7)).1, [10, done + 10]);
}

#[test]
fn events_out_of_order_are_refused_by_number() {
    let segment = || Event::Segment(Arc::new(Segment::default()));
    let clear = Load::Clear([0; 4]);
    let cases: [(Vec<Event>, &str); 6] = [
        (draws(0), "event 0 of the work comes where it cannot: outside a pass"),
        (vec![Event::EndPass(None)], "event 0 of the work comes where it cannot: outside a pass"),
        (vec![begin(clear, false), segment()], "event 1 of the work comes where it cannot: a segment without a draw"),
        (vec![begin(clear, false), end()], "event 1 of the work comes where it cannot: inside a pass"),
        (
            vec![Event::Groups(Arc::new(Groups::default()))],
            "event 0 of the work comes where it cannot: workgroups without a dispatch",
        ),
        (
            vec![Event::Contents(Contents { surface: surface(1, Format::Rgba8Unorm, 16, 1), bytes: vec![0; 5].into() })],
            "event 0 of the work comes where it cannot: contents of a surface have the wrong number of bytes",
        ),
    ];
    for (events, text) in cases {
        for clock in [Clock::EveryCycle, Clock::SkipIdle] {
            let (mut circuit, mut card) = circuit(&config(), PLAIN, &events);
            let _ = run(&mut circuit, &mut card, clock, 100, |_, card| card.fault.is_some());
            assert_eq!(card.fault.map(|fault| fault.to_string()), Some(format!("{text}. {OUR_FAULT}")));
        }
    }
}

#[test]
fn what_no_store_holds_stops_the_run_and_is_called_our_fault() {
    let of = |texture| surface(texture, Format::Rgba8Unorm, 16, 1);
    let fault = |events: &[Event]| {
        let (mut circuit, mut card) = circuit(&config(), PLAIN, events);
        let _ = run(&mut circuit, &mut card, Clock::SkipIdle, 100, |_, card| card.fault.is_some());
        card.fault.expect("a fault").to_string()
    };
    let lacks = |what: &str, texture: u32| {
        format!(
            "{what} takes the colours of texture {texture}, level 0, layer 0 from the machine's stores, which do not hold them. {OUR_FAULT}"
        )
    };
    assert_eq!(fault(&[begin(Load::Load, false), Event::EndPass(None), end()]), lacks("pass 0", 1));
    let copy = Transfer {
        kind: TransferKind::Copy,
        from: Some(1 << 24),
        to: Some(1 << 25),
        bytes: 64,
        reads: None,
        writes: None,
        surfaces: Some((of(7), of(8))),
    };
    assert_eq!(fault(&[Event::Transfer(copy), end()]), lacks("a copy of a whole image", 7));
}

#[test]
fn passes_without_draws_only_clear() {
    let clear = Load::Clear([0; 4]);
    let empty = |load, resolve| vec![begin(load, resolve), Event::EndPass(None), end()];
    // Read in cycle 0 and decoded by 8; sixteen flags at four per cycle; a cycle to find nothing more to be cleared, and the frame's end.
    let got = commanded(&config(), PLAIN, &empty(clear, false));
    assert_eq!((got.pieces.len(), got.over), (0, 8 + 4 + 1 + 1));
    assert_eq!(commanded(&config(), PLAIN, &empty(Load::Load, false)).over, 8 + 1 + 1);
    // In memory: as with draws, and then the end of the frame instead of the draw.
    let slow = Features { fast_clear: false, ..PLAIN };
    let got = commanded(&config(), slow, &empty(clear, false));
    assert_eq!((got.memory.write_bytes, got.over), (16 * 256, 9 + write_time(15, 256) + 1 + 1 + 1));
    // Pipelines hear of the pass where it is not skipped, and where samples have to be resolved.
    let all = CommandConfig { skip_empty_passes: false, ..config() };
    let heard = commanded(&all, PLAIN, &empty(clear, false));
    assert_eq!(heard.pieces.len(), 1);
    assert!(heard.over > got.over);
    let resolved = commanded(&config(), PLAIN, &empty(clear, true));
    assert_eq!((resolved.pieces.len(), resolved.resolve.len()), (1, 1));
}

#[test]
fn tests_of_bounds_take_their_time_one_by_one() {
    let tested = |tests, cull_cycles| {
        let culling = Culling { tests, draws: 1, instances: 3, primitives: 12, vertices: 36 };
        let drawn = Event::Draw(Arc::new(Draw { culling, ..draw() }));
        let mut events = vec![begin(Load::Load, false), drawn];
        events.extend([Event::Segment(Arc::new(Segment::default())), Event::EndPass(None), end()]);
        let config = CommandConfig { cull_cycles, ..config() };
        let counts = settle(
            || loaded(&config, PLAIN, &events),
            |c, _| c.command.frame_over(),
            |c, _| {
                let counts = c.command.counts();
                [
                    counts.bounds_tested,
                    counts.draws_culled,
                    counts.instances_culled,
                    counts.primitives_culled,
                    counts.vertices_culled,
                ]
            },
        );
        assert_eq!(counts, [tests, 1, 3, 12, 36]);
        commanded(&config, PLAIN, &events).pieces[0].0
    };
    let untested = tested(0, 5);
    assert_eq!(tested(1, 0), untested);
    assert_eq!(tested(7, 0), untested);
    for (tests, cycles) in [(1, 1), (1, 5), (2, 5), (40, 3), (3, 300)] {
        // A draw that is not tested costs the cycle in which it is read; the tests begin in it.
        assert_eq!(tested(tests, cycles), untested + tests * u64::from(cycles) - 1, "{tests} tests of {cycles} cycles");
    }
    // More of them than units may wake in vain, which is 10,000 times here.
    assert_eq!(tested(20_000, 8), untested + 160_000 - 1);
}
