//! Removes what the walk leaves over: values without a use, branches without content. Joins a product with the sum that it is used in.

use std::collections::HashMap;

use super::code::Code;
use super::ir::{Def, Inst, NONE, V};
use super::lower::Lowered;

/// Which values, mutable registers and ranges are used.
struct Wanted {
    values: Vec<bool>,
    classes: Vec<bool>,
    ranges: Vec<bool>,
}

impl Wanted {
    /// The number of the value, register or range that holds a value.
    fn home(&self, defs: &[Def], v: V) -> usize {
        match defs[v as usize] {
            Def::Version(class) => self.values.len() + class as usize,
            Def::Element(range, _) => self.values.len() + self.classes.len() + range as usize,
            _ => v as usize,
        }
    }

    /// Marks a value as used. Returns whether it was not marked before.
    fn mark(&mut self, defs: &[Def], v: V) -> bool {
        if v == NONE {
            return false;
        }
        let slot = match defs[v as usize] {
            Def::Version(class) => &mut self.classes[class as usize],
            Def::Element(range, _) => &mut self.ranges[range as usize],
            _ => &mut self.values[v as usize],
        };
        !std::mem::replace(slot, true)
    }

    fn is(&self, defs: &[Def], v: V) -> bool {
        // A result that does not exist has no use, such as that of an atomic operation that runs for its effect.
        if v == NONE {
            return false;
        }
        match defs[v as usize] {
            Def::Version(class) => self.classes[class as usize],
            Def::Element(range, _) => self.ranges[range as usize],
            _ => self.values[v as usize],
        }
    }
}

/// Whether an instruction has an effect beside its results.
fn has_effect(code: Code) -> bool {
    matches!(
        code,
        Code::Store
            | Code::Atomic
            | Code::TextureStore
            | Code::TextureAtomic
            | Code::Barrier
            | Code::Discard
            | Code::If
            | Code::Else
            | Code::EndIf
            | Code::RegionBegin
            | Code::RegionEnd
            | Code::LoopBegin
            | Code::Continuing
            | Code::LoopEnd
            | Code::LoopEndIf
            | Code::Exit
            | Code::BreakIf
            | Code::BreakIfNot
            | Code::Continue
            | Code::End
    )
}

/// Whether an instruction begins, ends or leaves a block.
pub(super) fn is_control(code: Code) -> bool {
    has_effect(code) && !matches!(code, Code::Store | Code::Atomic | Code::TextureStore | Code::TextureAtomic)
}

/// Rounds of removing dead code.
const ROUNDS: usize = 100;

pub(super) fn run(l: &mut Lowered) {
    let outputs: Vec<V> = l.outputs.iter().flatten().copied().collect();
    let wanted = l.builder.optimisations;
    if wanted.fuse {
        fuse(&mut l.builder.insts, &l.builder.defs, &outputs);
    }
    // Each round can empty the branch around those that the round before has removed. Empty branches that are nested deeper than the
    // number of rounds stay: they cost only their own operations.
    for _ in 0..ROUNDS {
        if wanted.drop_dead {
            drop_dead(l, &outputs);
        }
        if !wanted.drop_empty || !drop_empty_branches(&mut l.builder.insts) {
            break;
        }
    }
    let mut used = vec![false; l.builder.defs.len()];
    for &v in l.builder.insts.iter().flat_map(|i| &i.src).chain(&outputs).filter(|&&v| v != NONE) {
        used[v as usize] = true;
    }
    for (slot, values) in l.interface.inputs.iter_mut().zip(&l.inputs) {
        slot.used = values.iter().any(|&v| used[v as usize]);
    }
}

/// What an instruction writes: its results, and the range that it stores in.
fn written(inst: &Inst) -> impl Iterator<Item = V> + '_ {
    let stored = (inst.code == Code::StoreIndexed).then(|| inst.src[0]);
    inst.dst.iter().copied().chain(stored).filter(|&v| v != NONE)
}

fn drop_dead(l: &mut Lowered, outputs: &[V]) {
    let b = &mut l.builder;
    let mut wanted = Wanted {
        values: vec![false; b.defs.len()],
        classes: vec![false; b.classes as usize],
        ranges: vec![false; b.ranges.len()],
    };
    // What writes each home: instructions by the homes of their results.
    let homes = b.defs.len() + wanted.classes.len() + wanted.ranges.len();
    let mut first = vec![0u32; homes + 1];
    for v in b.insts.iter().flat_map(written) {
        first[wanted.home(&b.defs, v) + 1] += 1;
    }
    for k in 0..homes {
        first[k + 1] += first[k];
    }
    let mut next = first.clone();
    let mut writers = vec![0u32; first[homes] as usize];
    for (i, inst) in b.insts.iter().enumerate() {
        for v in written(inst) {
            let home = wanted.home(&b.defs, v);
            writers[next[home] as usize] = i as u32;
            next[home] += 1;
        }
    }
    let mut open: Vec<V> = outputs.iter().copied().filter(|&v| wanted.mark(&b.defs, v)).collect();
    for inst in b.insts.iter().filter(|inst| has_effect(inst.code)) {
        open.extend(inst.src.iter().copied().filter(|&s| wanted.mark(&b.defs, s)));
    }
    while let Some(v) = open.pop() {
        let home = wanted.home(&b.defs, v);
        for &i in &writers[first[home] as usize..first[home + 1] as usize] {
            open.extend(b.insts[i as usize].src.iter().copied().filter(|&s| wanted.mark(&b.defs, s)));
        }
    }
    for inst in b.prologue.iter().rev() {
        if inst.dst.iter().any(|&d| wanted.is(&b.defs, d)) {
            for &s in &inst.src {
                wanted.mark(&b.defs, s);
            }
        }
    }
    let keep = |inst: &Inst| {
        has_effect(inst.code)
            || inst.dst.iter().any(|&d| wanted.is(&b.defs, d))
            || (inst.code == Code::StoreIndexed && wanted.is(&b.defs, inst.src[0]))
    };
    b.insts.retain(&keep);
    b.prologue.retain(&keep);
    // Memory and texture accesses need not deliver results without a use.
    for inst in &mut b.insts {
        if matches!(inst.code, Code::Load | Code::Texture | Code::Atomic | Code::Subgroup) {
            for d in &mut inst.dst {
                if *d != NONE && !wanted.is(&b.defs, *d) {
                    *d = NONE;
                }
            }
        }
    }
}

/// Drops `if`s with nothing in them.
fn drop_empty_branches(insts: &mut Vec<Inst>) -> bool {
    let before = insts.len();
    let mut out: Vec<Inst> = Vec::with_capacity(insts.len());
    for inst in insts.drain(..) {
        match (inst.code, out.last().map(|i| i.code)) {
            (Code::EndIf, Some(Code::If)) => {
                out.pop();
            }
            (Code::EndIf, Some(Code::Else)) => {
                // An empty else: the `if` alone.
                out.pop();
                if out.last().map(|i| i.code) == Some(Code::If) {
                    out.pop();
                } else {
                    out.push(inst);
                }
            }
            _ => out.push(inst),
        }
    }
    *insts = out;
    insts.len() != before
}

/// Makes one operation of a product used once and the sum or difference it is used in. Both roundings stay.
fn fuse(insts: &mut Vec<Inst>, defs: &[Def], outputs: &[V]) {
    let mut uses = vec![0u32; defs.len()];
    for inst in insts.iter() {
        for &s in &inst.src {
            if s != NONE {
                uses[s as usize] += 1;
            }
        }
    }
    for &v in outputs {
        uses[v as usize] += 2;
    }
    let mut products: HashMap<V, usize> = HashMap::new();
    let mut dead = vec![false; insts.len()];
    for i in 0..insts.len() {
        let code = insts[i].code;
        // Registers may change here, so that no earlier computation moves across.
        if is_control(code) || matches!(code, Code::Mov | Code::Copy | Code::StoreIndexed) {
            products.clear();
            continue;
        }
        match code {
            Code::FMul if uses[insts[i].dst[0] as usize] == 1 => {
                products.insert(insts[i].dst[0], i);
            }
            Code::FAdd | Code::FSub => {
                let (a, b) = (insts[i].src[0], insts[i].src[1]);
                let (product, other, fused) = if let Some(&p) = products.get(&a) {
                    (p, b, if code == Code::FAdd { Code::MulAdd } else { Code::MulSub })
                } else if let Some(&p) = products.get(&b) {
                    (p, a, if code == Code::FAdd { Code::MulAdd } else { Code::NegMulAdd })
                } else {
                    continue;
                };
                let (x, y) = (insts[product].src[0], insts[product].src[1]);
                insts[i].code = fused;
                insts[i].src = vec![x, y, other];
                dead[product] = true;
            }
            _ => {}
        }
    }
    let mut k = 0;
    insts.retain(|_| {
        k += 1;
        !dead[k - 1]
    });
}
