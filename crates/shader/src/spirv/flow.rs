//! The structured control flow of a SPIR-V function: which construct each block is in, and what each branch does.
//!
//! naga makes a tree of statements of the blocks, in one pass. A branch to the end of a construct becomes `break`, `continue`, or
//! nothing, by what kind of end it is, and not by what lies between: so it is right for some branches and wrong for others. Here each branch is
//! classified by the constructs that it leaves.

use std::collections::{HashMap, HashSet};

use super::{Inst, Refusal, op};

/// A block: from its label to its terminator.
#[derive(Clone, Debug)]
pub(super) struct Block {
    pub label: u32,
    /// Without the label.
    pub insts: Vec<Inst>,
    /// The word of the label.
    pub at: u32,
}

/// What ends a construct is declared by the block that begins it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Merge {
    None,
    /// The block after a selection.
    Selection(u32),
    /// The block after a loop, and the one with which its continuing part begins.
    Loop(u32, u32),
}

impl Block {
    pub fn terminator(&self) -> Option<&Inst> {
        self.insts.last()
    }

    pub fn merge(&self) -> Merge {
        let found = self.insts.iter().rev().find_map(|inst| match inst.code {
            op::SELECTION_MERGE => Some(Merge::Selection(inst.operand(0))),
            op::LOOP_MERGE => Some(Merge::Loop(inst.operand(0), inst.operand(1))),
            _ => None,
        });
        found.unwrap_or(Merge::None)
    }

    /// Where the terminator may lead, without repetition. Those of a switch: the default first.
    pub fn targets(&self) -> Vec<u32> {
        let mut targets = Vec::new();
        let mut add = |target: u32| {
            if !targets.contains(&target) {
                targets.push(target);
            }
        };
        if let Some(last) = self.terminator() {
            match last.code {
                op::BRANCH => add(last.operand(0)),
                op::BRANCH_CONDITIONAL => [1, 2].into_iter().for_each(|n| add(last.operand(n))),
                op::SWITCH => {
                    let mut seen = HashSet::new();
                    add(last.operand(1));
                    seen.insert(last.operand(1));
                    for pair in last.operands[2.min(last.operands.len())..].chunks_exact(2) {
                        if seen.insert(pair[1]) {
                            targets.push(pair[1]);
                        }
                    }
                }
                _ => {}
            }
        }
        targets
    }

    /// Replaces a target of the terminator.
    pub fn retarget(&mut self, from: u32, to: u32) {
        let Some(last) = self.insts.last_mut() else { return };
        let swap = |target: &mut u32| {
            if *target == from {
                *target = to;
            }
        };
        match last.code {
            op::BRANCH => last.operands.iter_mut().for_each(swap),
            op::BRANCH_CONDITIONAL => last.operands.iter_mut().skip(1).take(2).for_each(swap),
            op::SWITCH => {
                let targets = last.operands.iter_mut().enumerate().filter(|(n, _)| *n == 1 || *n > 2 && n % 2 == 1);
                targets.for_each(|(_, target)| swap(target));
            }
            _ => {}
        }
    }

    /// The place among the instructions in front of the terminator and of the merge instruction.
    pub fn end(&self) -> usize {
        let merges = |inst: &Inst| matches!(inst.code, op::SELECTION_MERGE | op::LOOP_MERGE);
        self.insts.iter().position(merges).unwrap_or(self.insts.len().saturating_sub(1))
    }
}

/// A function, taken apart.
pub(super) struct Function {
    /// What comes before the blocks, and the end.
    pub head: Vec<Inst>,
    pub blocks: Vec<Block>,
    pub tail: Vec<Inst>,
}

impl Function {
    pub fn new(insts: Vec<Inst>) -> Function {
        let mut function = Function { head: Vec::new(), blocks: Vec::new(), tail: Vec::new() };
        for inst in insts {
            if inst.code == op::LABEL {
                function.blocks.push(Block { label: inst.operand(0), insts: Vec::new(), at: inst.at });
            } else if inst.code == op::FUNCTION_END || !function.tail.is_empty() {
                function.tail.push(inst);
            } else if let Some(block) = function.blocks.last_mut() {
                block.insts.push(inst);
            } else {
                function.head.push(inst);
            }
        }
        function
    }

    pub fn insts(self) -> Vec<Inst> {
        let mut out = self.head;
        for block in self.blocks {
            out.push(Inst { at: block.at, code: op::LABEL, operands: vec![block.label] });
            out.extend(block.insts);
        }
        out.extend(self.tail);
        out
    }
}

/// A part of a function that is entered by one block and left in known ways.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum ConstructKind {
    Selection,
    Switch,
    /// What one target of the switch around it leads to.
    Case(u32),
    Loop,
    /// The continuing part of the loop around it.
    Continuing,
}

#[derive(Clone, Copy, Debug)]
pub(super) struct Construct {
    pub kind: ConstructKind,
    pub outer: Option<usize>,
    /// The block that begins it, by number.
    pub header: usize,
    /// The label after it. Of a case and of a continuing part: 0.
    pub merge: u32,
    /// Of a loop: the label of its continuing part.
    pub continuing: u32,
}

/// What a branch does.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Edge {
    /// It goes on in the same construct, or enters one.
    On,
    /// It leaves a construct, which has this number, to its end.
    Leave(usize),
    /// It begins the next turn of a loop.
    Continue(usize),
    /// It is the last branch of a turn.
    Back(usize),
    /// It goes from one case of a switch into another one.
    Fall(usize),
}

/// The structure of a function.
pub(super) struct Flow {
    /// Numbers of blocks by label.
    pub numbers: HashMap<u32, usize>,
    pub constructs: Vec<Construct>,
    /// The construct that each block is in; the outer none: it is not reached. Its header is outside of a selection and inside of a loop.
    pub inside: Vec<Option<Option<usize>>>,
    /// Selections that the blocks begin.
    pub begins: Vec<Option<usize>>,
    /// The targets of the switches, by construct.
    targets: HashMap<usize, HashSet<u32>>,
}

/// The role of labels that end constructs.
struct Ends {
    merges: HashMap<u32, usize>,
    continuings: HashMap<u32, usize>,
}

impl Flow {
    /// Finds the structure.
    ///
    /// # Errors
    /// If there is none: with the word of the instruction.
    pub fn new(blocks: &[Block]) -> Result<Flow, Refusal> {
        let numbers: HashMap<u32, usize> = blocks.iter().enumerate().map(|(n, block)| (block.label, n)).collect();
        let mut flow = Flow {
            numbers,
            constructs: Vec::new(),
            inside: vec![None; blocks.len()],
            begins: vec![None; blocks.len()],
            targets: HashMap::new(),
        };
        if let Some(block) = blocks.iter().enumerate().find(|&(n, block)| flow.numbers.get(&block.label) != Some(&n)) {
            return Err((block.1.at, format!("a second block of the number %{}", block.1.label)));
        }
        let mut ends = Ends { merges: HashMap::new(), continuings: HashMap::new() };
        // Blocks that branches of their own construct lead to, and from where.
        let mut entered: HashMap<usize, usize> = HashMap::new();
        let mut open: Vec<usize> = Vec::new();
        if !blocks.is_empty() {
            flow.inside[0] = Some(None);
            open.push(0);
        }
        while let Some(number) = open.pop() {
            let block = &blocks[number];
            let here = flow.inside[number].flatten();
            let Some(last) = block.terminator() else { continue };
            let mut within = here;
            let declared = |ends: &mut Ends, label: u32, construct: usize, continuing: bool| {
                let twice = ends.merges.contains_key(&label) || ends.continuings.contains_key(&label);
                let list = if continuing { &mut ends.continuings } else { &mut ends.merges };
                list.insert(label, construct);
                if twice { Err((last.at, format!("%{label} ends two constructs"))) } else { Ok(()) }
            };
            match block.merge() {
                Merge::None if last.code == op::SWITCH => {
                    return Err((last.at, "a switch without OpSelectionMerge before it".to_owned()));
                }
                Merge::None => {}
                Merge::Loop(merge, continuing) => {
                    let construct = flow.constructs.len();
                    flow.constructs.push(Construct {
                        kind: ConstructKind::Loop,
                        outer: here,
                        header: number,
                        merge,
                        continuing,
                    });
                    flow.inside[number] = Some(Some(construct));
                    within = Some(construct);
                    declared(&mut ends, merge, construct, false)?;
                    flow.enter(blocks, &mut open, merge, here, last.at)?;
                    // A loop whose header is its continuing part has one part.
                    if continuing != block.label {
                        declared(&mut ends, continuing, construct, true)?;
                        let part = flow.constructs.len();
                        flow.constructs.push(Construct {
                            kind: ConstructKind::Continuing,
                            outer: Some(construct),
                            header: number,
                            merge: 0,
                            continuing: 0,
                        });
                        flow.enter(blocks, &mut open, continuing, Some(part), last.at)?;
                    }
                }
                Merge::Selection(merge) => {
                    let construct = flow.constructs.len();
                    let kind = if last.code == op::SWITCH { ConstructKind::Switch } else { ConstructKind::Selection };
                    flow.constructs.push(Construct { kind, outer: here, header: number, merge, continuing: 0 });
                    flow.begins[number] = Some(construct);
                    if kind == ConstructKind::Switch {
                        flow.targets.insert(construct, block.targets().into_iter().collect());
                    }
                    within = Some(construct);
                    declared(&mut ends, merge, construct, false)?;
                    flow.enter(blocks, &mut open, merge, here, last.at)?;
                }
            }
            for target in block.targets() {
                if flow.special(within, target).is_some() {
                    continue;
                }
                let Some(&to) = flow.numbers.get(&target) else {
                    return Err((last.at, format!("a branch to %{target}, which is no block of the function")));
                };
                // A case that another one falls into is entered by the switch.
                if last.code != op::SWITCH && flow.falls_to(within, target).is_some() {
                    continue;
                }
                if let Some(&from) = entered.get(&to) {
                    if from != number {
                        let message = format!("a branch to %{target}, where another branch leads and no construct ends");
                        return Err((last.at, message));
                    }
                    continue;
                }
                entered.insert(to, number);
                let inner = if last.code == op::SWITCH {
                    let case = flow.constructs.len();
                    let kind = ConstructKind::Case(target);
                    flow.constructs.push(Construct { kind, outer: within, header: number, merge: 0, continuing: 0 });
                    Some(case)
                } else {
                    within
                };
                flow.enter(blocks, &mut open, target, inner, last.at)?;
            }
        }
        Ok(flow)
    }

    /// Notes that a block is in a construct.
    fn enter(
        &mut self,
        blocks: &[Block],
        open: &mut Vec<usize>,
        label: u32,
        construct: Option<usize>,
        at: u32,
    ) -> Result<(), Refusal> {
        let Some(&number) = self.numbers.get(&label) else {
            return Err((at, format!("%{label}, which ends a construct, is no block of the function")));
        };
        if self.inside[number].is_some() {
            return Err((at, format!("%{} is part of two constructs", blocks[number].label)));
        }
        self.inside[number] = Some(construct);
        open.push(number);
        Ok(())
    }

    /// The constructs around, from the innermost.
    pub fn around(&self, construct: Option<usize>) -> impl Iterator<Item = usize> {
        std::iter::successors(construct, |&inner| self.constructs[inner].outer)
    }

    /// What a branch to the end or the beginning of a construct around does.
    fn special(&self, within: Option<usize>, target: u32) -> Option<Edge> {
        self.around(within).find_map(|n| {
            let construct = &self.constructs[n];
            match construct.kind {
                ConstructKind::Case(_) | ConstructKind::Continuing => None,
                _ if construct.merge == target => Some(Edge::Leave(n)),
                ConstructKind::Loop if construct.continuing == target => Some(Edge::Continue(n)),
                ConstructKind::Loop if self.numbers.get(&target) == Some(&construct.header) => Some(Edge::Back(n)),
                _ => None,
            }
        })
    }

    /// The innermost switch around, if the label is one of its targets.
    fn falls_to(&self, within: Option<usize>, target: u32) -> Option<usize> {
        let switch = self.around(within).find(|&n| self.constructs[n].kind == ConstructKind::Switch)?;
        self.targets.get(&switch)?.contains(&target).then_some(switch)
    }

    /// The construct that the branches of a block are in: the one that it begins, or the one that it is in.
    pub fn within(&self, number: usize) -> Option<usize> {
        self.begins[number].or(self.inside[number].flatten())
    }

    /// What a branch does.
    pub fn edge(&self, blocks: &[Block], number: usize, target: u32) -> Edge {
        let within = self.within(number);
        if let Some(edge) = self.special(within, target) {
            return edge;
        }
        let is_switch = blocks[number].terminator().is_some_and(|last| last.code == op::SWITCH);
        match self.falls_to(within, target) {
            Some(switch) if !is_switch => Edge::Fall(switch),
            _ => Edge::On,
        }
    }

    /// The kinds of the constructs that a branch leaves on its way out to one of them, from the innermost.
    pub fn left(&self, number: usize, to: usize) -> impl Iterator<Item = (usize, ConstructKind)> {
        self.around(self.within(number)).take_while(move |&n| n != to).map(|n| (n, self.constructs[n].kind))
    }

    /// Checks that naga understands a branch.
    ///
    /// # Errors
    /// If it does not.
    pub fn check(&self, blocks: &[Block], number: usize, target: u32) -> Result<(), Refusal> {
        let block = &blocks[number];
        let Some(last) = block.terminator() else { return Ok(()) };
        let refuse = |what: &str| Err((last.at, format!("a branch to %{target} {what}")));
        let edge = self.edge(blocks, number, target);
        let (Edge::Leave(to) | Edge::Continue(to) | Edge::Back(to) | Edge::Fall(to)) = edge else { return Ok(()) };
        let left: Vec<ConstructKind> = self.left(number, to).map(|(_, kind)| kind).collect();
        if left.contains(&ConstructKind::Loop) {
            return refuse("leaves two constructs at once, the inner one a loop, which SPIR-V does not allow");
        }
        // The continuing part of a loop ends with one block, which goes back, under a condition or without one.
        let back_and_out = || {
            let header = self.constructs[to].header;
            let mut ends = [blocks[header].label, self.constructs[to].merge];
            let mut targets = block.targets();
            ends.sort_unstable();
            targets.sort_unstable();
            targets == ends && last.code == op::BRANCH_CONDITIONAL
        };
        match (edge, self.constructs[to].kind) {
            (Edge::Leave(_), ConstructKind::Loop)
                if left.contains(&ConstructKind::Continuing) && (left != [ConstructKind::Continuing] || !back_and_out()) =>
            {
                return refuse("leaves a loop from its continuing part, which naga understands of its last block only");
            }
            (Edge::Leave(_), ConstructKind::Loop | ConstructKind::Switch) if left.contains(&ConstructKind::Switch) => {
                return refuse("leaves a switch and what is around it at once");
            }
            (Edge::Leave(_), ConstructKind::Selection) if left.iter().any(|kind| !matches!(kind, ConstructKind::Case(_))) => {
                return refuse("leaves two constructs at once, the outer one a selection, which SPIR-V does not allow");
            }
            (Edge::Continue(_), _) if left.contains(&ConstructKind::Continuing) => {
                return refuse("begins a turn of a loop from its continuing part");
            }
            (Edge::Back(_), _) if left != [ConstructKind::Continuing] || last.code != op::BRANCH && !back_and_out() => {
                return refuse("begins a turn of a loop and is not the last one of its continuing part");
            }
            (Edge::Fall(_), _) => return refuse("falls into another case of a switch"),
            _ => {}
        }
        Ok(())
    }
}
