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

use std::collections::{BTreeSet, HashMap, HashSet};

use super::flow::{Block, ConstructKind, Edge, Flow, Function, Merge};
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
        // Each pass writes the innermost ones, and leaves no new ones.
        let mut left = flow.constructs.len();
        while !broken.is_empty() {
            left = left
                .checked_sub(broken.len())
                .ok_or_else(|| (function.blocks[0].at, "switches that cannot be written in another way".to_owned()))?;
            rewrite(parts, &mut function, broken)?;
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
    // The added blocks that values of phis come through, by target and the block that they came from before.
    let mut through: HashMap<(u32, u32), u32> = HashMap::new();
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
                through.insert((target, label), own);
                parts.changed = true;
            }
        }
    }
    insert_after(&mut function.blocks, added);
    if through.is_empty() {
        return;
    }
    for block in &mut function.blocks {
        for inst in block.insts.iter_mut().filter(|inst| inst.code == op::PHI) {
            for source in inst.operands.iter_mut().skip(3).step_by(2) {
                *source = through.get(&(block.label, *source)).copied().unwrap_or(*source);
            }
        }
    }
}

/// Inserts blocks, each after the block of a number; the numbers ascend.
fn insert_after(blocks: &mut Vec<Block>, added: Vec<(usize, Block)>) {
    let mut added = added.into_iter().peekable();
    let old = std::mem::take(blocks);
    for (number, block) in old.into_iter().enumerate() {
        blocks.push(block);
        while let Some((_, block)) = added.next_if(|(after, _)| *after == number) {
            blocks.push(block);
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
    insert_after(&mut function.blocks, added);
}

/// Makes a variable of each phi: the blocks that it names store into it, and it becomes a load.
fn variables_for_phis(parts: &mut Parts, function: &mut Function) {
    let numbers: HashMap<u32, usize> = function.blocks.iter().enumerate().map(|(n, block)| (block.label, n)).collect();
    let mut stores: Vec<Vec<Inst>> = vec![Vec::new(); function.blocks.len()];
    let mut variables = Vec::new();
    for block in &mut function.blocks {
        for inst in block.insts.iter_mut().filter(|inst| inst.code == op::PHI && inst.operands.len() >= 2) {
            let (at, ty, id) = (inst.at, inst.operand(0), inst.operand(1));
            let (pointer, variable) = (parts.pointer(ty), parts.fresh());
            variables.push(Inst { at, code: op::VARIABLE, operands: vec![pointer, variable, 7] });
            for pair in inst.operands[2..].chunks_exact(2) {
                if let Some(&number) = numbers.get(&pair[1]) {
                    stores[number].push(Inst { at, code: op::STORE, operands: vec![variable, pair[0]] });
                }
            }
            *inst = Inst { at, code: op::LOAD, operands: vec![ty, id, variable] };
        }
    }
    for (block, stores) in function.blocks.iter_mut().zip(stores) {
        let end = block.end();
        block.insts.splice(end..end, stores);
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
                Edge::Leave(to) if flow.constructs[to].kind != ConstructKind::Selection => to,
                _ => continue,
            };
            if flow.left(number, to).any(|(_, kind)| kind == ConstructKind::Loop) {
                flow.check(blocks, number, target)?;
            }
            all.extend(flow.left(number, to).filter(|(_, kind)| *kind == ConstructKind::Switch).map(|(n, _)| n));
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
            (ConstructKind::Case(target), Some(switch)) => places.get(&switch).map(|&place| (switch, place, target)),
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
    let falls: BTreeSet<(u32, u32)> = falls.iter().copied().collect();
    let mut into: HashMap<u32, Vec<u32>> = HashMap::new();
    let mut waits: HashMap<u32, usize> = HashMap::new();
    let fallen: HashSet<u32> = falls.iter().map(|&(_, to)| to).collect();
    for &(from, to) in &falls {
        into.entry(from).or_default().push(to);
        // Only what is itself fallen into has to come first.
        *waits.entry(to).or_default() += usize::from(fallen.contains(&from));
    }
    let mut ready: Vec<u32> = targets.iter().rev().copied().filter(|target| waits.get(target) == Some(&0)).collect();
    let mut ordered = Vec::new();
    while let Some(target) = ready.pop() {
        ordered.push(target);
        for to in into.get(&target).into_iter().flatten() {
            if let Some(count) = waits.get_mut(to) {
                *count -= 1;
                ready.extend((*count == 0).then_some(*to));
            }
        }
    }
    if ordered.len() < fallen.len() {
        return Err((at, "cases of a switch that fall into each other in a circle".to_owned()));
    }
    Ok(ordered)
}

/// How one switch is written in another way.
struct Plan {
    switch: Broken,
    at: u32,
    /// The variable that says what comes next, and its type and that of a pointer to it.
    next: u32,
    whole: u32,
    pointer: u32,
    /// Targets that cases fall into, in order, and targets around the switch: what may come next, and the constant that says so.
    comes: Vec<u32>,
    fallen: usize,
    codes: HashMap<u32, (u32, u32)>,
    zero: u32,
    /// The blocks that read it, one for each number; after the last of them the switch has ended.
    deciders: Vec<u32>,
    /// Blocks that stay in the switch, and those of cases that others fall into.
    own: Vec<Block>,
    cases: HashMap<u32, Vec<Block>>,
}

impl Plan {
    fn new(parts: &mut Parts, header: &Block, switch: Broken) -> Result<Plan, Refusal> {
        let at = header.terminator().map_or(0, |last| last.at);
        let mut comes = order(&switch.falls, &header.targets(), at)?;
        let fallen = comes.len();
        comes.extend(&switch.far);
        let whole = parts.whole(Whole { bits: 32, signed: false, components: 1 });
        let (pointer, next, zero) = (parts.pointer(whole), parts.fresh(), parts.constant(whole, 0));
        let codes = comes.iter().zip(1..).map(|(&label, code)| (label, (code, parts.constant(whole, code)))).collect();
        let mut deciders: Vec<u32> = comes.iter().map(|_| parts.fresh()).collect();
        deciders.push(switch.merge);
        let (own, cases) = (Vec::new(), HashMap::new());
        Ok(Plan { switch, at, next, whole, pointer, comes, fallen, codes, zero, deciders, own, cases })
    }

    fn inst(&self, code: u32, operands: Vec<u32>) -> Inst {
        Inst { at: self.at, code, operands }
    }

    /// A block that says what comes next, and leads there.
    fn step(&self, parts: &mut Parts, target: u32, to: u32) -> Block {
        let constant = self.codes.get(&target).map_or(self.zero, |&(_, constant)| constant);
        let insts = vec![self.inst(op::STORE, vec![self.next, constant]), self.inst(op::BRANCH, vec![to])];
        Block { label: parts.fresh(), insts, at: self.at }
    }

    fn header(&mut self, parts: &mut Parts, block: &mut Block) {
        let first = self.deciders[0];
        let end = block.end();
        block.insts.insert(end, self.inst(op::STORE, vec![self.next, self.zero]));
        if let Some(inst) = block.insts.iter_mut().find(|inst| inst.code == op::SELECTION_MERGE) {
            inst.operands[0] = first;
        }
        let mut targets = HashMap::from([(self.switch.merge, first)]);
        for &target in &self.comes[..self.fallen] {
            let to = self.step(parts, target, first);
            targets.insert(target, to.label);
            self.own.push(to);
        }
        if let Some(last) = block.insts.last_mut() {
            for (n, target) in last.operands.iter_mut().enumerate() {
                if n == 1 || n > 2 && n % 2 == 1 {
                    *target = targets.get(target).copied().unwrap_or(*target);
                }
            }
        }
    }

    /// A block of a case.
    fn inside(&mut self, parts: &mut Parts, mut block: Block, case: u32) {
        // The constants of cases that are fallen into count from 1, as their blocks do.
        let position = self.codes.get(&case).map(|&(code, _)| code as usize);
        let exit = self.deciders[position.unwrap_or(0)];
        let mut steps = Vec::new();
        for target in block.targets() {
            match self.switch.exits.get(&(block.label, target)) {
                Some(Exit::Leave) => block.retarget(target, exit),
                Some(Exit::Fall | Exit::Far) => {
                    let to = self.step(parts, target, exit);
                    block.retarget(target, to.label);
                    steps.push(to);
                }
                None => {}
            }
        }
        let list = if position.is_some() { self.cases.entry(case).or_default() } else { &mut self.own };
        list.push(block);
        list.extend(steps);
    }

    /// All blocks that come after the header.
    fn blocks(mut self, parts: &mut Parts) -> Vec<Block> {
        let mut out = std::mem::take(&mut self.own);
        for n in 0..self.comes.len() {
            let (target, label, after, loaded) = (self.comes[n], self.deciders[n], self.deciders[n + 1], parts.fresh());
            let (code, constant) = self.codes.get(&target).copied().unwrap_or((0, self.zero));
            let mut insts = vec![self.inst(op::LOAD, vec![self.whole, loaded, self.next])];
            if n < self.fallen {
                insts.push(self.inst(op::SELECTION_MERGE, vec![after, 0]));
                insts.push(self.inst(op::SWITCH, vec![loaded, after, code, target]));
            } else {
                let (boolean, equal) = (parts.boolean(), parts.fresh());
                insts.push(self.inst(op::I_EQUAL, vec![boolean, equal, loaded, constant]));
                insts.push(self.inst(op::SELECTION_MERGE, vec![after, 0]));
                insts.push(self.inst(op::BRANCH_CONDITIONAL, vec![equal, target, after]));
            }
            out.push(Block { label, insts, at: self.at });
            out.extend(self.cases.remove(&target).unwrap_or_default());
        }
        out
    }
}

/// Writes switches in another way, none of which is inside of another one.
fn rewrite(parts: &mut Parts, function: &mut Function, switches: Vec<Broken>) -> Result<(), Refusal> {
    let numbers: HashMap<u32, usize> = function.blocks.iter().enumerate().map(|(n, block)| (block.label, n)).collect();
    let mut plans = Vec::new();
    let (mut headers, mut cases) = (HashMap::new(), HashMap::new());
    for switch in switches {
        headers.insert(switch.header, plans.len());
        cases.extend(switch.cases.iter().map(|(&label, &case)| (label, (plans.len(), case))));
        let header = &function.blocks[numbers[&switch.header]];
        plans.push(Plan::new(parts, header, switch)?);
    }
    let mut outside = Vec::new();
    for mut block in std::mem::take(&mut function.blocks) {
        if let Some(&(plan, case)) = cases.get(&block.label) {
            plans[plan].inside(parts, block, case);
            continue;
        }
        if let Some(&plan) = headers.get(&block.label) {
            plans[plan].header(parts, &mut block);
        }
        outside.push(block);
    }
    let variables: Vec<Inst> = plans.iter().map(|plan| plan.inst(op::VARIABLE, vec![plan.pointer, plan.next, 7])).collect();
    let mut plans: Vec<Option<Plan>> = plans.into_iter().map(Some).collect();
    for block in outside {
        let plan = headers.get(&block.label).and_then(|&plan| plans[plan].take());
        function.blocks.push(block);
        function.blocks.extend(plan.map(|plan| plan.blocks(parts)).unwrap_or_default());
    }
    if let Some(first) = function.blocks.first_mut() {
        first.insts.splice(0..0, variables);
    }
    Ok(())
}
