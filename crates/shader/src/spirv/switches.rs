//! Switches whose branches naga does not understand, written in another way.
//!
//! naga knows one way out of a switch, and puts its cases into an order of its own. So a branch from a case to the end of the loop around
//! becomes a `break` of the switch alone; a case may fall into the wrong one; and a default that leads out of the switch does nothing. Each
//! such switch is rewritten with a variable that says what comes next:
//!
//! ```text
//! switch (s) {                     next = 0;
//!     case 1: a(); break loop;     switch (s) { case 1: a(); next = 2; break;
//!     case 2: b(); // falls                     case 2: b(); next = 1; break;
//!     case 3: c();                              case 3: next = 1; break; }
//! }                                switch (next) { case 1: c(); }
//!                                  if (next == 2) { break loop; }
//! ```

use std::collections::{HashMap, HashSet};

use super::flow::{Block, Edge, Flow, Function, Kind, Merge};
use super::{Inst, Parts, Refusal, Whole, op};

/// Rewrites all functions.
///
/// # Errors
/// If a branch cannot be expressed: the word of its instruction, and why.
pub(super) fn mend(parts: &mut Parts) -> Result<(), Refusal> {
    for insts in std::mem::take(&mut parts.functions) {
        let mut function = Function::new(insts);
        tidy(parts, &mut function);
        let mut flow = Flow::new(&function.blocks)?;
        let mut broken = broken_switches(&flow, &function.blocks)?;
        if !broken.is_empty() {
            variables_for_phis(parts, &mut function);
            parts.changed = true;
        }
        // Each pass writes the innermost ones.
        while !broken.is_empty() {
            for switch in broken {
                rewrite(parts, &mut function, &switch)?;
            }
            flow = Flow::new(&function.blocks)?;
            broken = broken_switches(&flow, &function.blocks)?;
        }
        for (number, block) in function.blocks.iter().enumerate() {
            for target in block.targets() {
                flow.check(&function.blocks, number, target)?;
            }
        }
        parts.functions.push(function.insts());
    }
    Ok(())
}

/// Takes out what stands in the way of finding a structure: blocks that are never reached, conditions that decide nothing, ends that two
/// constructs share, and targets of switches that are no cases.
fn tidy(parts: &mut Parts, function: &mut Function) {
    let numbers: HashMap<u32, usize> = function.blocks.iter().enumerate().map(|(n, block)| (block.label, n)).collect();
    let mut reached = vec![false; function.blocks.len()];
    let mut open = vec![0];
    while let Some(number) = open.pop() {
        let Some(block) = function.blocks.get(number).filter(|_| !std::mem::replace(&mut reached[number], true)) else {
            continue;
        };
        open.extend(block.targets().into_iter().chain(ends_of(block)).filter_map(|label| numbers.get(&label)));
    }
    if reached.contains(&false) {
        let gone: HashSet<u32> =
            function.blocks.iter().zip(&reached).filter(|(_, reached)| !**reached).map(|(block, _)| block.label).collect();
        function.blocks.retain(|block| !gone.contains(&block.label));
        for inst in function.blocks.iter_mut().flat_map(|block| &mut block.insts).filter(|inst| inst.code == op::PHI) {
            let kept = inst.operands[2.min(inst.operands.len())..].chunks_exact(2).filter(|pair| !gone.contains(&pair[1]));
            inst.operands = inst.operands[..2.min(inst.operands.len())].iter().chain(kept.flatten()).copied().collect();
        }
        parts.changed = true;
    }
    share_no_end(parts, function);
    let ends: HashSet<u32> = function.blocks.iter().flat_map(ends_of).collect();
    let loops = function.blocks.iter().filter(|block| matches!(block.merge(), Merge::Loop(..))).map(|block| block.label);
    let loops: HashSet<u32> = loops.collect();
    let mut added: Vec<(usize, Block)> = Vec::new();
    // Phis whose value comes through an added block: target, and the block that it came from before.
    let mut through: Vec<(u32, u32, u32)> = Vec::new();
    for (number, block) in function.blocks.iter_mut().enumerate() {
        let (at, label, merge) = (block.at, block.label, block.merge());
        let Some(last) = block.insts.last_mut() else { continue };
        if last.code == op::BRANCH_CONDITIONAL && last.operand(1) == last.operand(2) && merge == Merge::None {
            *last = Inst { at: last.at, code: op::BRANCH, operands: vec![last.operand(1)] };
            parts.changed = true;
        }
        if last.code != op::SWITCH || last.operands.len() < 2 {
            continue;
        }
        // A case that leads where the default does.
        let default = last.operand(1);
        let cases: Vec<u32> = last.operands[2..].chunks_exact(2).filter(|pair| pair[1] != default).flatten().copied().collect();
        if cases.len() != last.operands.len() - 2 {
            last.operands.truncate(2);
            last.operands.extend(cases);
            parts.changed = true;
        }
        // A target that ends a construct around, or begins a loop around, becomes a block that leads there.
        for target in block.targets() {
            if merge != Merge::Selection(target) && (ends.contains(&target) || loops.contains(&target)) {
                let own = parts.fresh();
                block.retarget(target, own);
                let insts = vec![Inst { at, code: op::BRANCH, operands: vec![target] }];
                added.push((number, Block { label: own, insts, at }));
                through.push((target, label, own));
                parts.changed = true;
            }
        }
    }
    for (number, block) in added.into_iter().rev() {
        function.blocks.insert(number + 1, block);
    }
    for (target, from, to) in through {
        for block in function.blocks.iter_mut().filter(|block| block.label == target) {
            for inst in block.insts.iter_mut().filter(|inst| inst.code == op::PHI) {
                let sources = inst.operands.iter_mut().skip(3).step_by(2);
                sources.filter(|source| **source == from).for_each(|source| *source = to);
            }
        }
    }
}

/// The labels with which what a block begins ends.
fn ends_of(block: &Block) -> impl Iterator<Item = u32> + use<> {
    let ends = match block.merge() {
        Merge::None => [None, None],
        Merge::Selection(merge) => [Some(merge), None],
        Merge::Loop(merge, continuing) => [Some(merge), Some(continuing)],
    };
    ends.into_iter().flatten()
}

/// Gives a selection whose end also ends another construct an end of its own, which nothing reaches: its branches go where they went.
fn share_no_end(parts: &mut Parts, function: &mut Function) {
    let loops = function.blocks.iter().filter(|block| matches!(block.merge(), Merge::Loop(..)));
    let mut ends: HashSet<u32> = loops.flat_map(ends_of).collect();
    let mut added: Vec<(usize, Block)> = Vec::new();
    for (number, block) in function.blocks.iter_mut().enumerate() {
        let Merge::Selection(merge) = block.merge() else { continue };
        if ends.insert(merge) {
            continue;
        }
        let (at, own) = (block.at, parts.fresh());
        if let Some(inst) = block.insts.iter_mut().find(|inst| inst.code == op::SELECTION_MERGE) {
            inst.operands[0] = own;
        }
        added.push((number, Block { label: own, insts: vec![Inst { at, code: op::UNREACHABLE, operands: vec![] }], at }));
        parts.changed = true;
    }
    for (number, block) in added.into_iter().rev() {
        function.blocks.insert(number + 1, block);
    }
}

/// Makes a variable of each phi: the blocks that it names store into it, and it becomes a load.
fn variables_for_phis(parts: &mut Parts, function: &mut Function) {
    let numbers: HashMap<u32, usize> = function.blocks.iter().enumerate().map(|(n, block)| (block.label, n)).collect();
    let mut stores: Vec<(usize, Inst)> = Vec::new();
    let mut variables = Vec::new();
    for block in &mut function.blocks {
        for inst in block.insts.iter_mut().filter(|inst| inst.code == op::PHI && inst.operands.len() >= 2) {
            let (at, ty, id) = (inst.at, inst.operand(0), inst.operand(1));
            let (pointer, variable) = (parts.pointer(ty), parts.fresh());
            variables.push(Inst { at, code: op::VARIABLE, operands: vec![pointer, variable, 7] });
            for pair in inst.operands[2..].chunks_exact(2) {
                if let Some(&number) = numbers.get(&pair[1]) {
                    stores.push((number, Inst { at, code: op::STORE, operands: vec![variable, pair[0]] }));
                }
            }
            *inst = Inst { at, code: op::LOAD, operands: vec![ty, id, variable] };
        }
    }
    for (number, store) in stores {
        let block = &mut function.blocks[number];
        let end = block.end();
        block.insts.insert(end, store);
    }
    if let Some(first) = function.blocks.first_mut() {
        first.insts.splice(0..0, variables);
    }
}

/// What a branch out of a case does.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Exit {
    /// It leaves the switch.
    Leave,
    /// It goes into another case.
    Fall,
    /// It leaves the switch and what is around it.
    Far,
}

/// A switch with branches that naga does not understand. Blocks are named by their labels.
struct Broken {
    header: u32,
    merge: u32,
    /// The case that each block inside is in, as the target of the switch with which it begins.
    cases: HashMap<u32, u32>,
    /// Branches by block and target.
    exits: HashMap<(u32, u32), Exit>,
    /// From one case into another one.
    falls: Vec<(u32, u32)>,
    /// Targets around the switch.
    far: Vec<u32>,
}

/// The switches with branches that naga does not understand and with none inside that has such branches.
fn broken_switches(flow: &Flow, blocks: &[Block]) -> Result<Vec<Broken>, Refusal> {
    let mut all: HashSet<usize> = HashSet::new();
    for (number, block) in blocks.iter().enumerate() {
        for target in block.targets() {
            let to = match flow.edge(blocks, number, target) {
                Edge::Fall(to) => to,
                Edge::Leave(to) if flow.constructs[to].kind != Kind::Selection => to,
                _ => continue,
            };
            if flow.left(number, to).any(|(_, kind)| kind == Kind::Loop) {
                flow.check(blocks, number, target)?;
            }
            all.extend(flow.left(number, to).filter(|(_, kind)| *kind == Kind::Switch).map(|(n, _)| n));
            if flow.edge(blocks, number, target) == Edge::Fall(to) {
                all.insert(to);
            }
        }
    }
    let outer: HashSet<usize> = all.iter().flat_map(|&n| flow.around(flow.constructs[n].outer)).collect();
    let mut inner: Vec<usize> = all.difference(&outer).copied().collect();
    inner.sort_unstable();
    let places: HashMap<usize, usize> = inner.iter().enumerate().map(|(place, &n)| (n, place)).collect();
    let mut broken: Vec<Broken> = inner
        .iter()
        .map(|&n| Broken {
            header: blocks[flow.constructs[n].header].label,
            merge: flow.constructs[n].merge,
            cases: HashMap::new(),
            exits: HashMap::new(),
            falls: Vec::new(),
            far: Vec::new(),
        })
        .collect();
    for (number, block) in blocks.iter().enumerate() {
        let case = flow.around(flow.within(number)).find_map(|n| match (flow.constructs[n].kind, flow.constructs[n].outer) {
            (Kind::Case(target), Some(switch)) => places.get(&switch).map(|&place| (switch, place, target)),
            _ => None,
        });
        let Some((switch, place, case)) = case else { continue };
        let of = &mut broken[place];
        of.cases.insert(block.label, case);
        for target in block.targets() {
            let exit = match flow.edge(blocks, number, target) {
                Edge::Leave(to) if to == switch => Exit::Leave,
                Edge::Fall(to) if to == switch => Exit::Fall,
                Edge::Leave(to) if flow.left(number, to).any(|(n, _)| n == switch) => Exit::Far,
                _ => continue,
            };
            of.exits.insert((block.label, target), exit);
            if exit == Exit::Fall {
                of.falls.push((case, target));
            }
            if exit == Exit::Far && !of.far.contains(&target) {
                of.far.push(target);
            }
        }
    }
    Ok(broken)
}

/// The targets of a switch that cases fall into, in an order in which each comes after those that fall into it.
fn order(falls: &[(u32, u32)], targets: &[u32], at: u32) -> Result<Vec<u32>, Refusal> {
    let mut waiting: Vec<u32> = targets.iter().copied().filter(|target| falls.iter().any(|(_, to)| to == target)).collect();
    let mut ordered = Vec::new();
    while !waiting.is_empty() {
        let ready = |target: &u32| !falls.iter().any(|(from, to)| to == target && waiting.contains(from));
        let Some(n) = waiting.iter().position(ready) else {
            return Err((at, "cases of a switch that fall into each other in a circle".to_owned()));
        };
        ordered.push(waiting.remove(n));
    }
    Ok(ordered)
}

/// Writes one switch in another way.
fn rewrite(parts: &mut Parts, function: &mut Function, switch: &Broken) -> Result<(), Refusal> {
    let Some(header) = function.blocks.iter().position(|block| block.label == switch.header) else { return Ok(()) };
    let merge = switch.merge;
    let at = function.blocks[header].terminator().map_or(0, |last| last.at);
    let fallen = order(&switch.falls, &function.blocks[header].targets(), at)?;

    // What comes next, as a number: 0 is what follows the switch.
    let whole = parts.whole(Whole { bits: 32, signed: false, components: 1 });
    let (pointer, next) = (parts.pointer(whole), parts.fresh());
    let codes: HashMap<u32, u32> = fallen.iter().chain(&switch.far).copied().zip(1..).collect();
    let ids: Vec<u32> = (0..=codes.len() as u32).map(|code| parts.constant(whole, code)).collect();
    // The blocks that read it, one for each number; after the last of them the switch has ended.
    let mut deciders: Vec<u32> = codes.iter().map(|_| parts.fresh()).collect();
    deciders.push(merge);
    let inst = |code, operands| Inst { at, code, operands };
    // A block that says what comes next, and leads there.
    let step = |parts: &mut Parts, target: u32, to: u32| {
        let insts = vec![inst(op::STORE, vec![next, ids[codes[&target] as usize]]), inst(op::BRANCH, vec![to])];
        Block { label: parts.fresh(), insts, at }
    };

    // Blocks that stay in the switch, those of cases that others fall into, and those outside.
    let mut own: Vec<Block> = Vec::new();
    let mut cases: HashMap<u32, Vec<Block>> = HashMap::new();
    let mut outside: Vec<Block> = Vec::new();
    let mut place = 0;
    for mut block in std::mem::take(&mut function.blocks) {
        if let Some(case) = switch.cases.get(&block.label) {
            let position = fallen.iter().position(|target| target == case);
            let exit = deciders[position.map_or(0, |n| n + 1)];
            let mut steps = Vec::new();
            for target in block.targets() {
                match switch.exits.get(&(block.label, target)) {
                    Some(Exit::Leave) => block.retarget(target, exit),
                    Some(Exit::Fall | Exit::Far) => {
                        let to = step(parts, target, exit);
                        block.retarget(target, to.label);
                        steps.push(to);
                    }
                    None => {}
                }
            }
            let list = if position.is_some() { cases.entry(*case).or_default() } else { &mut own };
            list.push(block);
            list.extend(steps);
            continue;
        }
        if block.label == switch.header {
            let end = block.end();
            block.insts.insert(end, inst(op::STORE, vec![next, ids[0]]));
            block.retarget(merge, deciders[0]);
            if let Some(inst) = block.insts.iter_mut().find(|inst| inst.code == op::SELECTION_MERGE) {
                inst.operands[0] = deciders[0];
            }
            for &target in &fallen {
                let to = step(parts, target, deciders[0]);
                block.retarget(target, to.label);
                own.push(to);
            }
            place = outside.len() + 1;
        }
        outside.push(block);
    }
    for (n, target) in fallen.iter().chain(&switch.far).enumerate() {
        let (label, after, loaded) = (deciders[n], deciders[n + 1], parts.fresh());
        let mut insts = vec![inst(op::LOAD, vec![whole, loaded, next])];
        if n < fallen.len() {
            insts.push(inst(op::SELECTION_MERGE, vec![after, 0]));
            insts.push(inst(op::SWITCH, vec![loaded, after, codes[target], *target]));
        } else {
            let (boolean, equal) = (parts.boolean(), parts.fresh());
            insts.push(inst(op::I_EQUAL, vec![boolean, equal, loaded, ids[codes[target] as usize]]));
            insts.push(inst(op::SELECTION_MERGE, vec![after, 0]));
            insts.push(inst(op::BRANCH_CONDITIONAL, vec![equal, *target, after]));
        }
        own.push(Block { label, insts, at });
        own.extend(cases.remove(target).unwrap_or_default());
    }
    outside.splice(place..place, own);
    if let Some(first) = outside.first_mut() {
        first.insts.insert(0, inst(op::VARIABLE, vec![pointer, next, 7]));
    }
    function.blocks = outside;
    Ok(())
}
