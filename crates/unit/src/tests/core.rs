//! Cores: issue by class, latency, registers, barriers, requests.

use std::sync::Arc;

use super::kit::{Echo, FREE, Sink, TokenSource, settle};
use super::scenery::{card, draw, step, warp};
use crate::card::{Card, ComputeWork, Fault};
use crate::core::{Core, CoreConfig, CoreCounts, CorePorts, Scheduling};
use crate::token::WarpToken;
use gfx::stage::Stage;
use num::Cycle;
use sim::{Circuit, Clock, One, Unit, Wiring, run};
use stats::Cycles;
use work::*;

sim::circuit! {
    struct CoreCircuit for Card {
        /// The sources of vertices, workgroups and fragments. The sinks have the same order.
        sources: Vec<TokenSource<WarpToken>>,
        core: One<Core>,
        texture: One<Echo<WarpToken>>,
        /// One, or none.
        constant: Vec<Echo<WarpToken>>,
        sinks: Vec<Sink<WarpToken>>,
    }
}

fn config() -> CoreConfig {
    CoreConfig {
        per_pipeline: 1,
        unified: true,
        warp_width: 32,
        warps: 8,
        registers: 65_536,
        register_granule: 1,
        register_files: 1,
        shared_bytes: 16_384,
        issue: 1,
        float_lanes: 32,
        integer_lanes: 32,
        special_lanes: 8,
        control_lanes: 32,
        multiply_lanes: 8,
        float_latency: 6,
        integer_latency: 6,
        special_latency: 20,
        control_latency: 8,
        multiply_latency: 30,
        scoreboard: true,
        in_flight: 63,
        shared_latency: 23,
        shared_banks: 32,
        scheduling: Scheduling::RoundRobin,
        overlap: true,
        output_queue: 8,
        ..CoreConfig::default()
    }
}

/// A warp for a core.
#[derive(Clone)]
struct Work {
    stage: Stage,
    steps: Vec<Step>,
    registers: u32,
    /// Its workgroup, that group's warps, and its workgroup memory.
    group: (u32, u32, u32),
    /// Words of workgroup memory that its accesses ask for, one access after another, and whether it changes them.
    words: Vec<Vec<u32>>,
    atomic: bool,
}

impl Work {
    fn fragments(steps: &[Step]) -> Work {
        let (words, atomic) = (Vec::new(), false);
        Work { stage: Stage::Fragment, steps: steps.to_vec(), registers: 16, group: (0, 1, 0), words, atomic }
    }

    /// A warp of a workgroup of `siblings` warps.
    fn of_group(steps: &[Step], number: u32, siblings: u32, shared: u32) -> Work {
        Work { stage: Stage::Compute, group: (number, siblings, shared), ..Work::fragments(steps) }
    }
}

/// Cycles that the texture unit takes here.
const TEXTURE: Cycle = 30;

/// Cycles that the constant cache takes here.
const CONSTANT: Cycle = 10;

fn circuit(config: &CoreConfig, work: &[Work]) -> (CoreCircuit, Card) {
    circuit_with(config, work, false)
}

/// With or without a constant cache.
fn circuit_with(config: &CoreConfig, work: &[Work], has_constants: bool) -> (CoreCircuit, Card) {
    let mut wiring = Wiring::new();
    let from = wiring.bank("sources", 3);
    let core = wiring.unit("core", 0);
    let texture = wiring.unit("texture", 0);
    let caches = wiring.bank("constant", usize::from(has_constants));
    let to = wiring.bank("sinks", 3);
    let mut outputs = Vec::new();
    let mut ends = Vec::new();
    let mut sinks = Vec::new();
    for (index, (&from, &to)) in from.iter().zip(&to).enumerate() {
        let (output, input) = wiring.channel("in", index, FREE, from, core);
        let (out, got) = wiring.channel("out", index, FREE, core, to);
        outputs.push(output);
        ends.push((input, out));
        sinks.push(Sink::new(got));
    }
    let (ask, asked) = wiring.channel("ask", 0, FREE, core, texture);
    let (answer, answered) = wiring.channel("answer", 0, FREE, texture, core);
    let mut card = card(1);
    card.install(0, Arc::new(Segment::default()), Arc::new(draw()), 0);
    let dispatch = Dispatch {
        number: 7,
        label: String::new(),
        shape: ShaderShape::default(),
        groups: 1,
        invocations: 1,
        shared_bytes: 0,
        reach: Default::default(),
        programs: Programs::default(),
    };
    let mut groups = Groups::default();
    let mut tokens = [Vec::new(), Vec::new(), Vec::new()];
    for work in work {
        let costs = CostTable::from(vec![Cost::from(work.steps.clone())]);
        let index = warp(&mut card, work.stage, 1, work.registers, &costs);
        let warp = &mut card.warps[0][index];
        (warp.number, warp.siblings, warp.shared_bytes) = work.group;
        warp.items[0].next[Service::Shared] = groups.shared.len() as u32;
        for words in &work.words {
            let (first_line, operations) = (groups.words.len() as u32, u8::from(!work.atomic));
            groups.shared.push(Request { first_line, lines: words.len() as u8, operations, ..Request::default() });
            groups.words.extend(words);
        }
        let to = match work.stage {
            Stage::Vertex => 0,
            Stage::Compute => 1,
            Stage::Fragment => 2,
        };
        tokens[to].push((0, WarpToken { warp: index }));
    }
    card.compute[0] = Some(ComputeWork { dispatch: Arc::new(dispatch), groups: Arc::new(groups), epoch: 0 });
    let mut ends = ends.into_iter();
    let mut next = || ends.next();
    let place = |token: WarpToken, card: &mut Card| WarpToken { warp: card.warps[0][token.warp].place };
    let (mut constant, mut constants) = (None, Vec::new());
    for &cache in &caches {
        let (ask, asked) = wiring.channel("constants", 0, FREE, core, cache);
        let (answer, answered) = wiring.channel("constant answers", 0, FREE, cache, core);
        constants.push(Echo::answering(CONSTANT, place, asked, answer));
        constant = Some((ask, answered));
    }
    let stages = [(Stage::Vertex, next()), (Stage::Compute, next()), (Stage::Fragment, next())];
    let services = [(Service::Texture, Some((ask, answered))), (Service::Constant, constant)];
    let ports = CorePorts::new(stages, services);
    let sources = tokens.into_iter().zip(outputs).map(|(items, output)| TokenSource::new(items, output)).collect();
    let core = One(Core::new(config.clone(), 0, ports));
    let texture = One(Echo::answering(TEXTURE, place, asked, answer));
    (CoreCircuit::new(wiring, sources, core, texture, constants, sinks), card)
}

/// When warps of vertices, workgroups and fragments leave.
fn run_all(config: &CoreConfig, work: &[Work]) -> [Vec<(Cycle, u32)>; 3] {
    run_with(config, work, false)
}

/// The same with or without a constant cache.
fn run_with(config: &CoreConfig, work: &[Work], has_constants: bool) -> [Vec<(Cycle, u32)>; 3] {
    let sinks = |c: &CoreCircuit| [0, 1, 2].map(|of| c.sinks[of].log(number));
    settle(
        || circuit_with(config, work, has_constants),
        |c, _| c.core.resident() == 0 && sinks(c).iter().map(Vec::len).sum::<usize>() == work.len(),
        |c, card| {
            let asked: u64 = work.iter().flat_map(|work| &work.steps).flat_map(|step| step.instructions).map(u64::from).sum();
            assert_eq!(c.core.items(), asked, "every instruction is issued once");
            assert_eq!(card.warps[0].len(), c.sinks[2].got.len(), "fragments are given up where they are put in order");
            sinks(c)
        },
    )
}

fn number(token: &WarpToken) -> u32 {
    token.warp
}

/// Instructions of each class, then the end.
fn to_the_end(instructions: [u32; Class::COUNT]) -> [Step; 1] {
    [step(instructions, RequestKind::End)]
}

/// When the last of `warps` warps of fragments issues its last instruction, counted from the core's first issue.
fn shade(config: &CoreConfig, warps: usize, instructions: [u32; Class::COUNT], registers: u32) -> Cycle {
    let work = vec![Work { registers, ..Work::fragments(&to_the_end(instructions)) }; warps];
    // Taken in cycle 1, first issue in cycle 2, sent on in the cycle after the last, a cycle on the way.
    run_all(config, &work)[2].last().unwrap().0 - 2 - 1 - 1
}

#[test]
fn one_warp_is_bound_by_latency_and_many_by_issue() {
    // The last instruction issues after all latencies but its own.
    assert_eq!(shade(&config(), 1, [10, 0, 0, 0, 0], 16), 9 * 6);
    assert_eq!(shade(&config(), 1, [0, 10, 0, 0, 0], 16), 9 * 6);
    assert_eq!(shade(&config(), 1, [0, 0, 10, 0, 0], 16), 9 * 20);
    assert_eq!(shade(&config(), 1, [0, 0, 0, 10, 0], 16), 9 * 8);
    // Six warps hide six cycles of latency, eight more than that: one instruction per cycle.
    assert_eq!(shade(&config(), 6, [10, 0, 0, 0, 0], 16), 6 * 10 - 1);
    assert_eq!(shade(&config(), 8, [10, 0, 0, 0, 0], 16), 8 * 10 - 1);
    // Five do not: the last begins 4 cycles after the first, and waits like it.
    assert_eq!(shade(&config(), 5, [10, 0, 0, 0, 0], 16), 4 + 9 * 6);
    // Classes share the schedulers.
    assert_eq!(shade(&config(), 8, [5, 5, 0, 0, 0], 16), 8 * 10 - 1);
}

#[test]
fn lanes_bound_each_class() {
    // Half as many lanes take twice as long; a quarter for transcendentals.
    assert_eq!(shade(&CoreConfig { float_lanes: 16, ..config() }, 8, [10, 0, 0, 0, 0], 16), 2 * (8 * 10 - 1));
    assert_eq!(shade(&config(), 8, [0, 0, 10, 0, 0], 16), 4 * (8 * 10 - 1));
    assert_eq!(shade(&CoreConfig { integer_lanes: 8, ..config() }, 8, [0, 10, 0, 0, 0], 16), 4 * (8 * 10 - 1));
    assert_eq!(shade(&CoreConfig { control_lanes: 16, ..config() }, 8, [0, 0, 0, 10, 0], 16), 2 * (8 * 10 - 1));
    // Two instructions per cycle need lanes for two.
    let two = CoreConfig { issue: 2, warps: 16, ..config() };
    assert_eq!(shade(&two, 16, [10, 0, 0, 0, 0], 16), 160 - 1);
    assert_eq!(shade(&CoreConfig { float_lanes: 64, ..two }, 16, [10, 0, 0, 0, 0], 16), 160 / 2 - 1);
}

#[test]
fn registers_bound_the_warps_in_flight() {
    // 1024 registers are two warps of 32 invocations of 16. The second issues its tenth instruction in cycle 1 + 54; a warp that ends
    // in t leaves in t + 1, and the next issues for the first time in t + 2: four pairs, 56 cycles from one to the next.
    let config = CoreConfig { registers: 1024, ..config() };
    assert_eq!(shade(&config, 8, [10, 0, 0, 0, 0], 16), 1 + 54 + 3 * 56);
    // One that asks for more than there is runs alone.
    assert_eq!(shade(&config, 3, [10, 0, 0, 0, 0], 64), 54 + 2 * 56);
}

#[test]
fn registers_come_in_granules_and_files() {
    // The occupancy of a card with 65,536 registers in four files, of which a warp gets multiples of 256.
    let card = CoreConfig { warps: 64, register_granule: 256, register_files: 4, ..config() };
    let warps = [32, 33, 64, 65, 128, 255].map(|registers| card.resident_warps(registers));
    assert_eq!(warps, [64, 48, 32, 28, 16, 8]);
    // Without granules and files the same registers hold more.
    assert_eq!([33, 65].map(|registers| CoreConfig { warps: 64, ..config() }.resident_warps(registers)), [62, 31]);
    // A core holds as many. Of 1,024 registers in two files, a warp of 32 invocations of 5 takes 192 in granules of 64: two fit a file.
    // Four warps end after 54 cycles, and the fifth begins two cycles later.
    let small = CoreConfig { registers: 1024, register_granule: 64, register_files: 2, issue: 8, float_lanes: 256, ..config() };
    assert_eq!(small.resident_warps(5), 4);
    assert_eq!(shade(&small, 5, [10, 0, 0, 0, 0], 5), 54 + 56);
    assert_eq!(shade(&CoreConfig { register_files: 1, ..small }, 5, [10, 0, 0, 0, 0], 5), 54);
}

#[test]
fn independent_instructions_overlap() {
    // A warp of k chains issues k instructions in the time of one, at most one per cycle.
    let chains = |k: u32, count: u32, warps: usize, config: &CoreConfig| {
        let step = Step { chain: [count / k, 0, 0, 0, 0], ..to_the_end([count, 0, 0, 0, 0])[0] };
        let work = vec![Work::fragments(&[step]); warps];
        run_all(config, &work)[2].last().unwrap().0 - 4
    };
    for (k, each) in [(1, 6.0), (2, 3.0), (3, 2.0), (4, 1.5), (6, 1.0), (8, 1.0)] {
        assert_eq!(chains(k, 240, 1, &config()), (each * 239.0) as Cycle, "{k} chains");
    }
    let apart = CoreConfig { scoreboard: false, ..config() };
    assert_eq!(chains(4, 240, 1, &apart), 6 * 239);
    // Warps and chains hide the same latency: two warps of three chains issue in every cycle.
    assert_eq!(chains(3, 240, 2, &config()), 480 - 1);
    // Two in a cycle, where a warp may and lanes take both: twelve chains hide six cycles then.
    let dual = CoreConfig { dual_issue: true, float_lanes: 64, ..config() };
    assert_eq!(chains(12, 240, 1, &dual), 240 / 2 - 1);
    assert_eq!(chains(12, 240, 1, &CoreConfig { float_lanes: 32, ..dual.clone() }), 239);
    assert_eq!(chains(1, 240, 1, &dual), 6 * 239);
    // Two chains are pairs that wait for the pair before.
    assert_eq!(chains(2, 240, 1, &dual), 6 * 119);
}

#[test]
fn lanes_that_are_no_multiple_of_a_warp_take_turns() {
    // Warps of 32 on 48 lanes: three instructions in two cycles. On 12 lanes one takes 8/3 of a cycle.
    let two = CoreConfig { issue: 2, warps: 16, float_lanes: 48, ..config() };
    assert_eq!(shade(&two, 16, [9, 0, 0, 0, 0], 16), 16 * 9 * 2 / 3 - 1);
    assert_eq!(
        shade(&CoreConfig { multiply_lanes: 12, multiply_latency: 6, ..config() }, 8, [0, 0, 0, 0, 9], 16),
        (8 * 9 - 1) * 8 / 3
    );
    // The latency of a multiplication is longer than the wheel of waits.
    assert_eq!(shade(&CoreConfig { multiply_lanes: 32, multiply_latency: 100, ..config() }, 1, [0, 0, 0, 0, 4], 16), 300);
}

#[test]
fn a_warp_issues_in_order_the_class_it_has_most_of() {
    // Four single-precision instructions and two transcendental ones, of which a warp takes the lanes for 4 cycles: F F F S F S, and
    // of equals the first. Alone it waits for latencies: 6 + 6 + 6 + 20 + 6.
    assert_eq!(shade(&config(), 1, [4, 0, 2, 0, 0], 16), 3 * 6 + 20 + 6);
    // Of two warps the second, a cycle behind, finds the lanes taken for 3 cycles more at its first S, though they would take its F.
    assert_eq!(shade(&config(), 2, [4, 0, 2, 0, 0], 16), 3 * 6 + 4 + 20 + 6);
}

#[test]
fn an_instruction_keeps_the_lanes_of_all_classes_where_they_do_not_overlap() {
    // Of one transcendental instruction, 4 cycles of its lanes, and eight others: alone it makes no difference.
    let apart = CoreConfig { overlap: false, ..config() };
    assert_eq!(shade(&apart, 1, [8, 0, 1, 0, 0], 16), shade(&config(), 1, [8, 0, 1, 0, 0], 16));
    // Eight warps issue 64 instructions in a cycle each, and eight that take four; the last issue of all is of one cycle. With lanes of
    // their own, transcendental instructions cost a cycle like the others.
    let work = |count: usize| -> Vec<Work> {
        let kinds = [to_the_end([8, 0, 0, 0, 0]), to_the_end([0, 0, 2, 0, 0])];
        (0..count).map(|n| Work::fragments(&kinds[n % 2])).collect()
    };
    let last = |config: &CoreConfig| run_all(config, &work(8))[2].iter().map(|&(at, _)| at - 4).max();
    let fast = |config| CoreConfig { float_latency: 1, special_latency: 1, ..config };
    assert_eq!(last(&fast(config())), Some(4 * 8 + 4 * 2 - 1));
    assert_eq!(last(&fast(apart)), Some(4 * 8 + 4 * 2 * 4 - 1));
}

#[test]
fn schedulers_go_round_or_keep_to_the_oldest() {
    let work = vec![Work::fragments(&to_the_end([10, 0, 0, 0, 0])); 2];
    let ends = |scheduling| {
        let config = CoreConfig { scheduling, float_latency: 1, ..config() };
        run_all(&config, &work)[2].iter().map(|&(at, warp)| (at - 4, warp)).collect::<Vec<_>>()
    };
    assert_eq!(ends(Scheduling::RoundRobin), [(18, 0), (19, 1)]);
    assert_eq!(ends(Scheduling::Oldest), [(9, 0), (19, 1)]);
}

#[test]
fn a_request_is_waited_for_and_others_go_on() {
    // Two instructions, in cycles 2 and 8; the request goes out in 8 and is back two channels and 30 cycles later: in 40. The last
    // instruction is issued in that cycle. A second warp does all this a cycle later.
    let steps = [step([2, 0, 0, 0, 0], RequestKind::Texture), step([1, 0, 0, 0, 0], RequestKind::End)];
    let work = vec![Work::fragments(&steps); 2];
    let back = 8 + 1 + TEXTURE + 1;
    assert_eq!(run_all(&config(), &work)[2], [(back + 2, 0), (back + 3, 1)]);
    // A step without instructions asks as soon as the warp is in, in cycle 2.
    let steps = [step([0; Class::COUNT], RequestKind::Load), step([1, 0, 0, 0, 0], RequestKind::End)];
    assert_eq!(run_all(&config(), &[Work::fragments(&steps)])[2], [(2 + 1 + TEXTURE + 1 + 2, 0)]);
}

#[test]
fn loads_from_uniform_buffers_are_answered_apart() {
    // A sample, a load from a uniform buffer, and a step that needs the load, the sample, or both.
    let steps = |memory: u8, constant: u8| {
        let of = |count, then, memory, constant| {
            let in_flight = InFlight::new([memory, constant, u8::MAX]);
            Step { in_flight, ..step([count, 0, 0, 0, 0], then) }
        };
        let any = u8::MAX;
        [
            of(1, RequestKind::Texture, any, any),
            of(1, RequestKind::Constant, any, any),
            of(4, RequestKind::Store, memory, constant),
            of(1, RequestKind::End, any, any),
        ]
    };
    let ends = |has, memory, constant| run_with(&config(), &[Work::fragments(&steps(memory, constant))], has)[2][0].0;
    let (texture, cached) = (1 + TEXTURE + 1, 1 + CONSTANT + 1);
    // Both ask in 2 and 3. Four instructions take 18 cycles from the first to the last, with which the store asks. In the end all is answered.
    let rest = 18 + texture + 2;
    assert_eq!(ends(true, 1, 0), 3 + cached + rest);
    assert_eq!(ends(true, 0, 1), 2 + texture + rest);
    assert_eq!(ends(true, 0, 0), 2 + texture + rest);
    assert_eq!(ends(true, 1, 1), 4 + rest);
    // Without a cache the texture unit answers both, in order.
    assert_eq!(ends(false, 1, 0), 3 + texture + rest);
    assert_eq!(ends(false, 0, 1), 2 + texture + rest);
    assert_eq!(ends(false, 0, 0), 3 + texture + rest);
    // One request at a time: each is waited for, no matter which unit answers it.
    let one = CoreConfig { in_flight: 1, ..config() };
    let each = |has: bool| run_with(&one, &[Work::fragments(&steps(1, 1))], has)[2][0].0;
    assert_eq!([each(false), each(true)], [2 + 2 * texture + rest, 2 + texture + cached + rest]);
}

#[test]
fn a_warp_goes_on_until_it_needs_an_answer() {
    // Two requests, and a step that needs the first, both, or neither.
    let steps = |allowed: u8| {
        let any = |instructions, then, memory| Step { in_flight: InFlight::new([memory, 0, 0]), ..step(instructions, then) };
        [
            any([1, 0, 0, 0, 0], RequestKind::Texture, u8::MAX),
            any([1, 0, 0, 0, 0], RequestKind::Load, u8::MAX),
            any([4, 0, 0, 0, 0], RequestKind::Store, allowed),
            any([1, 0, 0, 0, 0], RequestKind::End, u8::MAX),
        ]
    };
    let ends = |config: &CoreConfig, allowed| run_all(config, &[Work::fragments(&steps(allowed))])[2][0].0;
    let trip = 1 + TEXTURE + 1;
    // Both ask in 2 and 3. Four instructions take 18 cycles from the first to the last, with which the third asks. In the end all is answered.
    assert_eq!(ends(&config(), 0), 3 + trip + 18 + trip + 2);
    assert_eq!(ends(&config(), 1), 2 + trip + 18 + trip + 2);
    assert_eq!(ends(&config(), 2), 4 + 18 + trip + 2);
    // One request at a time: each is waited for.
    let each = 2 + trip + trip + 18 + trip + 2;
    assert_eq!(ends(&CoreConfig { in_flight: 1, ..config() }, 2), each);
    assert_eq!(ends(&CoreConfig { scoreboard: false, ..config() }, 2), each);
    // Two at a time: the third step begins when one is answered.
    assert_eq!(ends(&CoreConfig { in_flight: 2, ..config() }, 2), ends(&config(), 1));
}

#[test]
fn banks_of_workgroup_memory_have_a_word_a_cycle() {
    // A warp accesses words of a stride, then ends: the last instruction is issued when the answer is there, a latency after the access, which
    // is made with the first instruction in 2. All words of a bank but the first take a cycle each.
    let steps = [step([1, 0, 0, 0, 0], RequestKind::Shared), step([1, 0, 0, 0, 0], RequestKind::End)];
    let access = |words: Vec<u32>| Work { words: vec![words], ..Work::of_group(&steps, 1, 1, 64) };
    let end = |config: &CoreConfig, work: Work| run_all(config, &[work])[1][0].0;
    let stride = |stride: u32| access((0..32).map(|lane| lane * stride).collect());
    for (step, conflicts) in [(1, 0), (2, 1), (3, 0), (4, 3), (8, 7), (16, 15), (32, 31), (33, 0)] {
        assert_eq!(end(&config(), stride(step)), 2 + 23 + conflicts + 2, "stride {step}");
    }
    // All read the same word; half of them one, half another of the same bank. What is read for one is there for all.
    assert_eq!(end(&config(), access(vec![5; 32])), 27);
    assert_eq!(end(&config(), access((0..32).map(|lane| lane % 2 * 32).collect())), 28);
    // An atomic changes the word for each.
    assert_eq!(end(&config(), Work { atomic: true, ..access(vec![5; 32]) }), 27 + 31);
    assert_eq!(end(&CoreConfig { shared_banks: 16, ..config() }, stride(1)), 28);
    assert_eq!(end(&CoreConfig { shared_latency: 40, ..config() }, stride(1)), 44);
    // The banks are busy with one access at a time: a second warp, a cycle behind, waits for the first.
    let two = run_all(&config(), &[stride(8), stride(8)]);
    assert_eq!(two[1], [(2 + 23 + 7 + 2, 1), (2 + 23 + 7 + 8 + 2, 1)]);
    // A warp goes on while its access is under way.
    let ahead = [
        steps[0],
        Step { in_flight: InFlight::new([0, 0, 1]), ..steps[0] },
        Step { in_flight: InFlight::new([0, 0, 1]), ..step([1, 0, 0, 0, 0], RequestKind::Load) },
        steps[1],
    ];
    let work = Work { words: vec![vec![0], vec![1]], ..Work::of_group(&ahead, 1, 1, 64) };
    // Accesses in 2 and 3; the load is asked for when the first is answered, in 25.
    assert_eq!(end(&config(), work), 25 + 1 + TEXTURE + 1 + 2);
}

#[test]
fn a_barrier_holds_the_warps_of_a_group() {
    let steps = |before| [step([before, 0, 0, 0, 0], RequestKind::Barrier), step([1, 0, 0, 0, 0], RequestKind::End)];
    // The ninth instruction of the second warp is issued in 3 + 48; the others of its group go on with it in the cycle after. A warp
    // of another group, which issues its third in 4 + 12 and waits for nobody, is long gone.
    let group = |before, number, siblings| Work::of_group(&steps(before), number, siblings, 0);
    let work = [group(3, 1, 2), group(9, 1, 2), group(3, 2, 1)];
    assert_eq!(run_all(&config(), &work)[1], [(16 + 1 + 2, 2), (52 + 2, 1), (53 + 2, 1)]);
    // A warp that ends does not hold the others up.
    let work = [Work::of_group(&to_the_end([1, 0, 0, 0, 0]), 1, 2, 0), group(3, 1, 2)];
    assert_eq!(run_all(&config(), &work)[1], [(2 + 2, 1), (3 + 12 + 1 + 2, 1)]);
}

#[test]
fn a_workgroup_comes_whole() {
    // Three places, groups of two: the second group comes when two places are free. Its warps issue their tenth instructions in
    // 58 + 54 and a cycle later.
    let group = |number| Work::of_group(&to_the_end([10, 0, 0, 0, 0]), number, 2, 0);
    let work = [group(1), group(1), group(2), group(2)];
    let config = CoreConfig { warps: 3, ..config() };
    assert_eq!(run_all(&config, &work)[1], [(56 + 2, 1), (57 + 2, 1), (58 + 54 + 2, 2), (59 + 54 + 2, 2)]);
}

#[test]
fn workgroup_memory_is_held_until_the_whole_group_is_done() {
    // The first warp ends after one instruction, the second after ten: in 3 + 54, and leaves a cycle later. Only then is there
    // memory for the second group, whose warps issue for the first time in 59 and 60.
    let group = |number, count| Work::of_group(&to_the_end([count, 0, 0, 0, 0]), number, 2, 10_000);
    let work = [group(1, 1), group(1, 10), group(2, 1), group(2, 1)];
    assert_eq!(run_all(&config(), &work)[1], [(2 + 2, 1), (57 + 2, 1), (59 + 2, 2), (60 + 2, 2)]);
}

#[test]
fn vertices_come_before_workgroups_and_fragments() {
    // One place. A warp of one instruction is taken in t, issues in t + 1, leaves in t + 2, in which the next is taken.
    let of = |stage| Work { stage, ..Work::fragments(&to_the_end([1, 0, 0, 0, 0])) };
    let work = [of(Stage::Fragment), of(Stage::Compute), of(Stage::Vertex)];
    let config = CoreConfig { warps: 1, ..config() };
    let [vertices, groups, fragments] = run_all(&config, &work);
    assert_eq!((vertices[0].0, groups[0].0, fragments[0].0), (3 + 1, 5 + 1, 7 + 1));
}

/// When the warps of a workgroup leave a core that has a place for one.
fn in_turns(steps: &[&[Step]]) -> Vec<Cycle> {
    let group = |steps: &&[Step]| Work::of_group(steps, 1, 3, 0);
    let work: Vec<Work> = steps.iter().map(group).collect();
    let times = |config: &CoreConfig| run_all(config, &work)[1].iter().map(|&(at, _)| at).collect::<Vec<_>>();
    let one = times(&CoreConfig { warps: 1, ..config() });
    // With registers for one it is the same. One that asks for more than there is runs alone.
    assert_eq!(times(&CoreConfig { registers: 512, ..config() }), one);
    assert_eq!(times(&CoreConfig { registers: 500, ..config() }), one);
    one
}

#[test]
fn warps_of_a_workgroup_that_is_larger_than_the_core_run_in_turns() {
    // Without a barrier they come one after another: taken in t, issued in t + 1, gone in t + 2, in which the next is taken.
    let end = to_the_end([1, 0, 0, 0, 0]);
    assert_eq!(in_turns(&[&end, &end, &end]), [4, 6, 8]);
    // At a barrier a warp makes place in the cycle of its last instruction. The third does in 4, and all may go on.
    let barrier = step([1, 0, 0, 0, 0], RequestKind::Barrier);
    let once = [barrier, end[0]];
    assert_eq!(in_turns(&[&once, &once, &once]), [7, 9, 11]);
    let twice = [barrier, barrier, end[0]];
    assert_eq!(in_turns(&[&twice, &twice, &twice]), [10, 12, 14]);
    // One that ends does not hold the others up: it has left in 3, they meet in 5.
    assert_eq!(in_turns(&[&end, &once, &once]), [4, 8, 10]);
    // It may be the last of all, which finds the others at the barrier: it ends in 4, leaves in 5, and they go on in that cycle.
    assert_eq!(in_turns(&[&once, &once, &end]), [6, 8, 10]);
    // A request is answered to the place that the warp has then.
    let asks = [barrier, step([1, 0, 0, 0, 0], RequestKind::Load), end[0]];
    let (first, each) = (5 + 1 + TEXTURE + 1 + 2, 1 + 1 + TEXTURE + 1 + 1);
    assert_eq!(in_turns(&[&asks, &asks, &asks]), [first, first + each, first + 2 * each]);
}

#[test]
fn a_workgroup_in_turns_has_the_core_for_itself() {
    // Two places. The group of three comes when the two of one warp each have left, and the one behind it when it has.
    let steps = [step([1, 0, 0, 0, 0], RequestKind::Barrier), step([1, 0, 0, 0, 0], RequestKind::End)];
    let group = |number, siblings, shared| Work::of_group(&steps, number, siblings, shared);
    let mut work = vec![group(1, 1, 8_000), group(2, 1, 8_000)];
    work.extend(vec![group(3, 3, 16_000); 3]);
    work.push(group(4, 1, 16_000));
    let config = CoreConfig { warps: 2, ..config() };
    let order: Vec<u32> = run_all(&config, &work)[1].iter().map(|&(_, number)| number).collect();
    assert_eq!(order, [1, 2, 3, 3, 3, 4]);
}

#[test]
fn a_workgroup_whose_memory_does_not_fit_is_refused_by_name() {
    let work = vec![Work::of_group(&to_the_end([1, 0, 0, 0, 0]), 1, 2, 16_385); 2];
    for clock in [Clock::EveryCycle, Clock::SkipIdle] {
        let (mut circuit, mut card) = circuit(&config(), &work);
        // Nothing can move after it: the machine looks for the fault before it looks for what is stuck.
        let ran = run(&mut circuit, &mut card, clock, 100, |_, card| card.fault.is_some());
        let fault = card.fault.unwrap_or_else(|| panic!("{clock:?}: {ran:?}"));
        assert!(matches!(fault, Fault::Resources { dispatch: 7, .. }));
        assert_eq!(
            fault.to_string(),
            "dispatch 7: workgroup memory asks for 16385, and a core of this machine has 16384 (configuration key \
             core.shared_bytes)"
        );
    }
}

/// What a core counts in a run: its account, and its own counters.
fn counted(config: &CoreConfig, work: &[Work]) -> (Cycles, CoreCounts) {
    settle(
        || circuit(config, work),
        |c, _| c.core.resident() == 0 && c.sinks.iter().map(|sink| sink.got.len()).sum::<usize>() == work.len(),
        |c, _| {
            let core = c.wires().units().position(|(name, _)| name == "core").expect("a core");
            (c.reading().units[core], c.core.counts(c.wires().now()))
        },
    )
}

#[test]
fn a_core_is_busy_where_lanes_take_in_instructions() {
    // One warp of ten instructions: each waits for the latency of the one before it. Taken in cycle 1, it leaves behind the last.
    let warp = || Work::fragments(&to_the_end([10, 0, 0, 0, 0]));
    let (one, counts) = counted(&config(), &[warp()]);
    assert_eq!((one.busy, one.latency, one.memory, one.blocked), (10, 1 + 9 * 5, 0, 0));
    assert_eq!((counts.warp_cycles, counts.slot_cycles), (1 + 54 + 1, 8 * one.total()));
    // Six hide the latency.
    let (six, counts) = counted(&config(), &vec![warp(); 6]);
    assert_eq!((six.busy, six.latency), (60, 1));
    assert_eq!((counts.full_warps, counts.full_registers, counts.full_workgroups), (0, 0, 0));
    // A warp of 32 holds 8 lanes for four cycles, in which it is taken in; it does not wait for them behind its last instruction.
    let (special, _) = counted(&config(), &[Work::fragments(&to_the_end([0, 0, 10, 0, 0]))]);
    assert_eq!((special.busy, special.latency), (9 * 4 + 2, 1 + 9 * 16));
}

#[test]
fn a_core_waits_for_what_its_oldest_warp_waits_for() {
    let load = [step([1, 0, 0, 0, 0], RequestKind::Texture), step([1, 0, 0, 0, 0], RequestKind::End)];
    let (account, counts) = counted(&config(), &[Work::fragments(&load)]);
    // The request is on its way for a cycle, and so is the answer.
    assert_eq!((account.busy, account.memory, counts.texture_waits), (2, TEXTURE + 1, TEXTURE + 1));
    // Another warp works in a part of this time.
    let mut work = vec![Work::fragments(&load)];
    work.extend(vec![Work::fragments(&to_the_end([5, 0, 0, 0, 0])); 2]);
    let (both, _) = counted(&config(), &work);
    assert_eq!((both.busy, both.busy + both.memory), (12, account.busy + account.memory));
}

#[test]
fn a_core_counts_why_a_warp_is_not_taken_in() {
    let warp = || Work::fragments(&to_the_end([10, 0, 0, 0, 0]));
    let full = |config: &CoreConfig, work: &[Work]| {
        let (_, counts) = counted(config, work);
        [counts.full_warps, counts.full_registers, counts.full_workgroups].map(|cycles| cycles > 0)
    };
    assert_eq!(full(&config(), &vec![warp(); 8]), [false; 3]);
    assert_eq!(full(&config(), &vec![warp(); 9]), [true, false, false]);
    assert_eq!(full(&CoreConfig { registers: 1024, ..config() }, &vec![warp(); 3]), [false, true, false]);
    let group = |number| Work::of_group(&to_the_end([10, 0, 0, 0, 0]), number, 1, 16_000);
    assert_eq!(full(&config(), &[group(1), group(2)]), [false, false, true]);
}
