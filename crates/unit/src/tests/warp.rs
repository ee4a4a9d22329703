//! The instructions that a warp executes on the paths of its parts.

use crate::warp::{Execution, Item, Warps};
use gfx::stage::Stage;
use work::{Class, Cost, CostTable, InFlight, Point, RequestKind, Span, Step};

use Class::{Float, Integer, Special};
use RequestKind::{End, Texture};

/// A program: what begins where, and its instructions.
const PROGRAM: [(u32, &[(Class, u32)]); 5] = [
    (0, &[(Float, 2), (Integer, 1)]),
    // A branch,
    (10, &[(Float, 5)]),
    (20, &[(Float, 4), (Special, 1)]),
    // a loop,
    (30, &[(Integer, 3)]),
    // and the end.
    (40, &[(Float, 1)]),
];

/// Instructions that all wait for the one before them.
fn span(at: u32, runs: &[(Class, u32)]) -> Span {
    let mut chain = [0; Class::COUNT];
    runs.iter().for_each(|&(class, count)| chain[class as usize] += count);
    Span { at, runs: runs.to_vec(), lines: Vec::new(), chain }
}

/// A path through it, with the steps that it makes.
fn cost(path: &[(u32, RequestKind)]) -> Cost {
    let mut steps = vec![];
    let mut instructions = [0; Class::COUNT];
    for (at, &(span, then)) in path.iter().enumerate() {
        for &(class, count) in PROGRAM[span as usize].1 {
            instructions[class as usize] += count;
        }
        if then != End || at + 1 == path.len() {
            steps.push(Step::dependent(std::mem::take(&mut instructions), then));
        }
    }
    Cost { steps, path: path.iter().map(|&(span, then)| Point { span, in_flight: InFlight::NONE, then }).collect() }
}

/// A warp whose parts have these paths.
fn merged(execution: Execution, paths: &[&[(u32, RequestKind)]]) -> crate::warp::Warp {
    let spans = PROGRAM.iter().map(|&(at, runs)| span(at, runs)).collect();
    let table = CostTable { costs: paths.iter().map(|path| cost(path)).collect(), spans };
    let mut warps = Warps::new(execution);
    let index = warps.insert(Stage::Fragment, 0, 8);
    let warp = &mut warps[index];
    warp.items = (0..paths.len() as u16).map(|cost| Item::new(0, 0, cost)).collect();
    warp.merge(|_| &table);
    warp.clone()
}

fn step(instructions: [u32; Class::COUNT], then: RequestKind) -> Step {
    Step::dependent(instructions, then)
}

#[test]
fn both_sides_of_a_branch_are_executed() {
    let paths: [&[_]; 2] = [&[(0, End), (1, End), (4, End)], &[(0, End), (2, End), (4, End)]];
    // The longer side, class by class: 2 + 5 + 1 and 2 + 4 + 1 floats.
    assert_eq!(merged(Execution::Longest, &paths).steps, [step([8, 1, 1, 0, 0], End)]);
    // Both: 2 + 5 + 4 + 1.
    assert_eq!(merged(Execution::Lockstep, &paths).steps, [step([12, 1, 1, 0, 0], End)]);
    let ordered = merged(Execution::InOrder, &paths);
    assert_eq!(ordered.steps, [step([12, 1, 1, 0, 0], End)]);
    assert_eq!(ordered.order(0), [(Float, 2), (Integer, 1), (Float, 9), (Special, 1), (Float, 1)]);
    assert!(merged(Execution::Lockstep, &paths).order(0).is_empty());
}

#[test]
fn loops_go_round_as_often_as_the_part_that_stays_longest() {
    let paths: [&[_]; 3] =
        [&[(0, End), (3, End), (3, End), (3, End), (4, End)], &[(0, End), (4, End)], &[(0, End), (3, End), (4, End)]];
    for execution in [Execution::Longest, Execution::Lockstep, Execution::InOrder] {
        assert_eq!(merged(execution, &paths).steps, [step([3, 10, 0, 0, 0], End)], "{execution:?}");
    }
}

#[test]
fn requests_are_made_by_those_that_are_there() {
    let paths: [&[_]; 3] = [&[(0, End), (1, Texture), (4, End)], &[(0, End), (2, Texture), (4, End)], &[(0, End), (4, End)]];
    // As if both sides asked at once.
    let longest = merged(Execution::Longest, &paths);
    assert_eq!(longest.steps, [step([7, 1, 1, 0, 0], Texture), step([1, 0, 0, 0, 0], End)]);
    // One side after the other.
    let mut lockstep = merged(Execution::Lockstep, &paths);
    assert_eq!(lockstep.steps, [step([7, 1, 0, 0, 0], Texture), step([4, 0, 1, 0, 0], Texture), step([1, 0, 0, 0, 0], End)]);
    let asks =
        |warp: &crate::warp::Warp| [0, 1, 2].map(|part| warp.then(warp.step, part, || unreachable!("paths are followed")));
    assert_eq!(asks(&lockstep), [Texture, End, End]);
    lockstep.step = 1;
    assert_eq!(asks(&lockstep), [End, Texture, End]);
    lockstep.step = 2;
    assert_eq!(asks(&lockstep), [End; 3]);
}

#[test]
fn without_paths_steps_are_all_there_is() {
    let costs = vec![Cost::from(vec![step([8, 0, 0, 0, 0], End)]), Cost::from(vec![step([7, 2, 0, 0, 0], End)])];
    let table = CostTable::from(costs);
    let mut warps = Warps::new(Execution::InOrder);
    let index = warps.insert(Stage::Vertex, 0, 8);
    warps[index].items = (0..2).map(|cost| Item::new(0, 0, cost)).collect();
    warps[index].merge(|_| &table);
    assert_eq!(warps[index].steps, [step([8, 2, 0, 0, 0], End)]);
    assert!(warps[index].order(0).is_empty());
}
