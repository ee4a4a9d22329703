//! Instruction counts of a program on a machine whose instructions work on up to four components at once.
//!
//! Between two places where the execution mask may change, up to four operations of the same code become one instruction if none of
//! them needs a result of another. Operands may be any components of any registers, negated or not, and a result may be clamped to
//! 0 to 1. These are the rules of the assembly languages for vertices and fragments of 2002 (`ARB_vertex_program`): a dot product, a
//! multiply-add and a comparison are one instruction each, and a transcendental one gives a single value. A quotient is a product with
//! a reciprocal, and quotients by the same value share one reciprocal.
//!
//! Coefficients of a light are one instruction (`LIT`): `max(x, 0)`, and `max(y, 0)` to the power `w` where `x` is above 0. Its operands are
//! components of one register, so that another instruction moves the exponent there. What leaves a program as it came in is moved to its
//! output, by an instruction for each output.
//!
//! An instruction reads one register of constants: what it needs of another one is moved before it. Nothing is computed once for a draw:
//! sums of constants are instructions, but products of two are constants too, as those of a light and a material (`state.lightprod`).
//!
//! An instruction is issued together with the next one if the next one does not need its result and one of the two has a single
//! component: the machine has a unit for four components and a unit for one (ATTILA's `simd4+scalar`).

use std::collections::{HashMap, HashSet};

use super::code::Code;
use super::ir::{Builder, Inst, NONE, V};
use super::program::Space;
use work::Class;

/// Components that an instruction works on.
const WIDTH: u32 = 4;

/// The most instructions with free components that are searched for an operation: this bounds the time of the search.
const OPEN: usize = 32;

type Counts = [u32; Class::COUNT];

/// A copy to a place that an instruction or an output asks for.
const MOVE: Inst = Inst { code: Code::Copy, dst: Vec::new(), src: Vec::new(), imm: 0, slots: [0; 3], line: 0 };

/// How an operation counts.
enum Cost {
    /// As this number of instructions of its own.
    Alone(Counts),
    /// As one instruction of single precision, issued with others as one of several components is.
    Whole,
    /// As an instruction for up to four of the same code.
    Shared(Class),
    /// As an instruction of a single component, which takes this number of times as long as the shortest of its class.
    Single(Class, u32),
    /// A product with the reciprocal of the second operand.
    Quotient,
    /// As nothing: it is part of the instruction before or behind it.
    Free,
}

/// Reciprocals and roots take twice as long as logarithms and exponentials, sines three times (ATTILA: 4, 2 and 6 cycles for four
/// invocations).
const RECIPROCAL: u32 = 2;
const SINE: u32 = 3;

fn cost(code: Code) -> Cost {
    let (class, count) = code.weight();
    match code {
        Code::FNeg | Code::FAbs | Code::FSaturate => Cost::Free,
        Code::Dot2 | Code::Dot3 | Code::Dot4 => Cost::Whole,
        // The square of the length, its root's reciprocal, the product.
        Code::Normalize2 | Code::Normalize3 => Cost::Alone([2, 0, RECIPROCAL, 0, 0]),
        // A logarithm, a product, an exponential.
        Code::Pow => Cost::Alone([1, 0, 2, 0, 0]),
        Code::FDiv => Cost::Quotient,
        Code::FSqrt | Code::FInvSqrt => Cost::Single(class, RECIPROCAL),
        Code::Sin | Code::Cos => Cost::Single(class, SINE),
        Code::Exp | Code::Exp2 | Code::Log | Code::Log2 => Cost::Single(class, 1),
        Code::MulAdd | Code::MulSub | Code::NegMulAdd | Code::Mov | Code::Copy => Cost::Shared(class),
        code if code.is_pure() && count == 1 && class != Class::Special => Cost::Shared(class),
        _ => {
            let mut alone = [0; Class::COUNT];
            alone[class as usize] = count;
            Cost::Alone(alone)
        }
    }
}

/// An instruction of the current block.
struct Pack {
    code: Code,
    imm: u32,
    /// The first operation in it.
    first: usize,
    operations: u32,
    /// The earliest place that it may have: behind the instructions that it needs.
    needs: u32,
    cost: Counts,
    /// Whether another one may be issued with it, whether its operation always has a single component, and whether it is made of
    /// operations that were joined.
    paired: bool,
    single: bool,
    joined: bool,
}

/// Puts the operations of a program into instructions.
struct Packer {
    /// The first instruction that may use each value.
    ready: Vec<u32>,
    /// Instructions of the current block; the first has the number `base`.
    packs: Vec<Pack>,
    base: u32,
    /// Those with room, as places in `packs`.
    open: Vec<usize>,
    reciprocals: HashMap<V, u32>,
    /// The place of each constant that is read as it is: its register.
    registers: HashMap<V, (Space, u64)>,
    /// Constants that are in a register for other values.
    moved: HashSet<V>,
    /// What begins with each operation.
    begins: Vec<Counts>,
}

impl Packer {
    fn begin(&mut self, inst: &Inst, code: Code, needs: u32, cost: Counts, kind: (bool, bool)) -> u32 {
        let (paired, single) = kind;
        let first = self.begins.len() - 1;
        self.packs.push(Pack { code, imm: inst.imm, first, operations: 1, needs, cost, paired, single, joined: false });
        self.base + self.packs.len() as u32
    }

    /// Puts an operation with those of its code; the first instruction that may use its result.
    fn join(&mut self, inst: &Inst, code: Code, class: Class, needs: u32) -> u32 {
        let fits = |&at: &usize| {
            let pack = &self.packs[at];
            pack.code == code && pack.imm == inst.imm && self.base + at as u32 >= needs
        };
        if let Some(found) = self.open.iter().position(fits) {
            let at = self.open[found];
            self.packs[at].operations += 1;
            // It may be issued with the one before it as long as none of its operations needs that one.
            self.packs[at].needs = self.packs[at].needs.max(needs);
            if self.packs[at].operations == WIDTH {
                self.open.remove(found);
            }
            return self.base + at as u32 + 1;
        }
        if self.open.len() == OPEN {
            self.open.remove(0);
        }
        self.open.push(self.packs.len());
        let mut cost = [0; Class::COUNT];
        cost[class as usize] = 1;
        let ready = self.begin(inst, code, needs, cost, (true, false));
        self.packs.last_mut().expect("one was begun").joined = true;
        ready
    }

    /// Adds up what is the same for all invocations.
    fn add_constants(&mut self, b: &Builder) {
        for inst in b.prologue.iter().filter(|inst| inst.code != Code::Undef) {
            if inst.code == Code::Load {
                let memory = &b.memory[inst.imm as usize];
                let places = inst.dst.iter().zip((u64::from(memory.offset)..).step_by(4));
                self.registers.extend(places.map(|(&v, offset)| (v, (memory.space, offset / 16))));
            }
            if matches!(inst.code, Code::FAdd | Code::FSub | Code::MulAdd | Code::MulSub | Code::NegMulAdd) {
                let needs = inst.src.iter().filter(|&&v| v != NONE).map(|&v| self.ready[v as usize]).max().unwrap_or(0);
                let ready = self.join(inst, inst.code, Class::Float, needs);
                for &v in &inst.dst {
                    self.ready[v as usize] = ready;
                    self.moved.insert(v);
                }
            }
        }
    }

    /// Moves constants that an operation needs of more registers than one.
    fn move_constants(&mut self, b: &Builder, inst: &Inst) {
        let constant = |v: V| v != NONE && b.is_uniform(v) && b.known(v).is_none();
        let mut first = None;
        for &v in inst.src.iter().filter(|&&v| constant(v)) {
            let register = self.registers.get(&v).copied();
            match first {
                _ if self.moved.contains(&v) => {}
                None => first = Some((v, register)),
                Some((known, at)) if known == v || register.is_some() && register == at => {}
                Some(_) => {
                    self.ready[v as usize] = self.join(&MOVE, Code::Copy, Class::Float, 0);
                    self.moved.insert(v);
                }
            }
        }
    }

    fn single(&mut self, inst: &Inst, class: Class, count: u32, needs: u32) -> u32 {
        let mut cost = [0; Class::COUNT];
        cost[class as usize] = count;
        self.begin(inst, inst.code, needs, cost, (true, true))
    }

    /// Ends a block: instructions that are issued together count as one, the longer of both.
    fn end_block(&mut self) {
        let mut at = 0;
        while at < self.packs.len() {
            let pack = &self.packs[at];
            let single = |pack: &Pack| pack.single || pack.joined && pack.operations == 1;
            let beside = self.packs.get(at + 1).filter(|next| {
                pack.paired && next.paired && (single(pack) || single(next)) && next.needs <= self.base + at as u32
            });
            let mut cost = pack.cost;
            if let Some(next) = beside {
                let special = Class::Special as usize;
                if cost[special] < next.cost[special] {
                    cost = next.cost;
                }
            }
            for (sum, count) in self.begins[pack.first].iter_mut().zip(cost) {
                *sum = sum.saturating_add(count);
            }
            at += 1 + usize::from(beside.is_some());
        }
        self.base += self.packs.len() as u32;
        self.packs.clear();
        self.open.clear();
        self.reciprocals.clear();
    }
}

/// What an operation is in an instruction for the coefficients of a light.
enum LightTerm {
    /// All of it: the operation that this counts at, and what it needs besides its own operands.
    Whole(V),
    /// Something that it does besides.
    Rest,
}

/// The operations that coefficients of lights are made of, by their place.
fn lights(b: &Builder, insts: &[Inst]) -> HashMap<usize, LightTerm> {
    let mut parts = HashMap::new();
    if !insts.iter().any(|inst| inst.code == Code::Pow) {
        return parts;
    }
    let (mut made, mut users) = (vec![None; b.defs.len()], vec![Vec::new(); b.defs.len()]);
    for (at, inst) in insts.iter().enumerate() {
        inst.dst.iter().filter(|&&v| v != NONE).for_each(|&v| made[v as usize] = Some(at));
        inst.src.iter().filter(|&&v| v != NONE).for_each(|&v| users[v as usize].push(at));
    }
    let made_by = |v: V, code: Code| made[v as usize].filter(|&at: &usize| insts[at].code == code);
    let number = |v: V| b.known(v).map(f32::from_bits);
    // The number that a maximum with a constant that only keeps it from being negative is of.
    let above_zero = |at: usize| {
        let [x, y] = insts[at].src[..] else { return None };
        let small = |v: V| number(v).is_some_and(|c| (0.0..1e-9).contains(&c));
        small(y).then_some(x).or(small(x).then_some(y))
    };
    for (at, inst) in insts.iter().enumerate().filter(|(_, inst)| inst.code == Code::Pow) {
        let Some(bounded) = made_by(inst.src[0], Code::FMax).filter(|&at| above_zero(at).is_some()) else { continue };
        // From the power to the choice between it and 0.
        let (mut value, mut choices, mut scaled) = (inst.dst[0], Vec::new(), false);
        let found = loop {
            let &[user] = &users[value as usize][..] else { break None };
            let next = &insts[user];
            match next.code {
                Code::Select => {
                    let other = if next.src[1] == value { next.src[2] } else { next.src[1] };
                    choices.push(user);
                    match number(other) {
                        Some(0.0) => break Some(next.src[0]),
                        // Where the exponent is 0.
                        Some(1.0) if b.is_uniform(next.src[0]) => {}
                        _ => break None,
                    }
                }
                Code::FMul if !scaled => scaled = true,
                _ => break None,
            }
            value = next.dst[0];
        };
        let Some(condition) = found else { continue };
        let compare = made_by(condition, Code::FLt).filter(|&at| number(insts[at].src[0]) == Some(0.0));
        let needs = compare.map_or(condition, |at| insts[at].src[1]);
        parts.insert(at, LightTerm::Whole(needs));
        parts.extend(choices.into_iter().map(|at| (at, LightTerm::Rest)));
        if users[inst.src[0] as usize].len() == 1 {
            parts.insert(bounded, LightTerm::Rest);
        }
        if let Some(compare) = compare {
            if users[condition as usize].len() == 1 {
                parts.insert(compare, LightTerm::Rest);
            }
            let same =
                users[needs as usize].iter().filter(|&&at| insts[at].code == Code::FMax && above_zero(at) == Some(needs));
            parts.extend(same.map(|&at| (at, LightTerm::Rest)));
        }
    }
    parts
}

/// Running counts of such instructions: entry `i` counts those that begin before operation `i`. Operations are the instructions that are
/// not [`Code::Undef`], and the end; `outputs` are the components of each output.
pub(super) fn counts(b: &Builder, insts: &[Inst], outputs: &[Vec<V>]) -> Vec<Counts> {
    let mut packer = Packer {
        ready: vec![0; b.defs.len()],
        packs: Vec::new(),
        base: 0,
        open: Vec::new(),
        reciprocals: HashMap::new(),
        registers: HashMap::new(),
        moved: HashSet::new(),
        begins: Vec::with_capacity(insts.len() + 1),
    };
    let parts = lights(b, insts);
    // Values that an instruction of this program leaves in a register.
    let mut made = vec![false; b.defs.len()];
    for (at, inst) in insts.iter().enumerate().filter(|(_, inst)| inst.code != Code::Undef) {
        packer.begins.push([0; Class::COUNT]);
        if packer.begins.len() == 1 {
            packer.add_constants(b);
        }
        // The rows of a matrix are in registers of their own, whatever its layout in memory.
        if matches!(cost(inst.code), Cost::Shared(_)) {
            packer.move_constants(b, inst);
        }
        let needs = inst.src.iter().filter(|&&v| v != NONE).map(|&v| packer.ready[v as usize]).max().unwrap_or(0);
        let cost = cost(inst.code);
        let leaves = !matches!(cost, Cost::Free) || inst.src.iter().any(|&v| v != NONE && made[v as usize]);
        let after = match (parts.get(&at), cost) {
            (Some(&LightTerm::Whole(x)), _) => {
                let exponent = packer.ready[inst.src[1] as usize];
                packer.single(&MOVE, Class::Float, 1, exponent);
                packer.begin(inst, inst.code, needs.max(packer.ready[x as usize]), [1, 0, 0, 0, 0], (true, false))
            }
            (Some(LightTerm::Rest), _) | (None, Cost::Free) => needs,
            (None, Cost::Alone(cost)) => packer.begin(inst, inst.code, needs, cost, (false, false)),
            (None, Cost::Whole) => packer.begin(inst, inst.code, needs, [1, 0, 0, 0, 0], (true, false)),
            (None, Cost::Single(class, count)) => packer.single(inst, class, count, needs),
            (None, Cost::Shared(class)) => packer.join(inst, inst.code, class, needs),
            (None, Cost::Quotient) => {
                let divisor = inst.src[1];
                let known = packer.reciprocals.get(&divisor).copied();
                let inverse = known.unwrap_or_else(|| {
                    let needs = packer.ready[divisor as usize];
                    let ready = packer.single(inst, Class::Special, RECIPROCAL, needs);
                    packer.reciprocals.insert(divisor, ready);
                    ready
                });
                packer.join(inst, Code::FMul, Class::Float, needs.max(inverse))
            }
        };
        for &v in inst.dst.iter().filter(|&&v| v != NONE) {
            packer.ready[v as usize] = after;
            made[v as usize] = leaves;
        }
        if inst.code.breaks_block() {
            packer.end_block();
        }
    }
    // The end counts what is moved to outputs.
    packer.begins.push([0; Class::COUNT]);
    for output in outputs {
        let moved = output.iter().filter(|&&v| v != NONE && !made[v as usize]).count();
        if moved > 0 {
            packer.begin(&MOVE, Code::Copy, 0, [1, 0, 0, 0, 0], (true, moved == 1));
        }
    }
    packer.end_block();
    let mut sum = [0_u32; Class::COUNT];
    let mut counts = vec![sum];
    for begins in &packer.begins {
        for (sum, count) in sum.iter_mut().zip(begins) {
            *sum = sum.saturating_add(*count);
        }
        counts.push(sum);
    }
    counts
}

#[cfg(test)]
mod tests {
    use super::super::ir::Def;
    use super::super::program::{AtomicOp, MemoryOp, NO_REG, Width};
    use super::*;

    fn inst(code: Code, dst: V, src: &[V]) -> Inst {
        Inst { code, dst: vec![dst], src: src.to_vec(), imm: 0, slots: [0; 3], line: 0 }
    }

    /// Values 0 to 15 are inputs, the others results.
    fn builder() -> Builder {
        let mut builder = Builder::default();
        for v in 0..64 {
            builder.define(if v < 16 { Def::Input } else { Def::Temp });
        }
        builder
    }

    fn with_outputs(b: &Builder, insts: &[Inst], outputs: &[Vec<V>]) -> Counts {
        let counts = counts(b, insts, outputs);
        assert_eq!(counts.len(), insts.len() + 2);
        *counts.last().expect("there are counts")
    }

    fn last(insts: &[Inst]) -> Counts {
        with_outputs(&builder(), insts, &[])
    }

    #[test]
    fn four_operations_of_a_code_are_one_instruction() {
        // A product of a matrix and a vector, row by row: inputs 0 to 3, matrix 4 to 19, rows from 20 on.
        let mut insts = Vec::new();
        for row in 0..4 {
            let at = 20 + 4 * row;
            insts.push(inst(Code::FMul, at, &[0, 4 + row]));
            for k in 1..4 {
                insts.push(inst(Code::MulAdd, at + k, &[k, 4 + 4 * k + row, at + k - 1]));
            }
        }
        assert_eq!(last(&insts), [4, 0, 0, 0, 0]);
        // A fifth operation of the code is another instruction, of a single component: it is issued with the next one that does not need it.
        let five: Vec<_> = (0..5).map(|k| inst(Code::FAdd, 20 + k, &[k, k])).collect();
        assert_eq!(last(&five), [1, 0, 0, 0, 0]);
        let nine: Vec<_> = (0..9).map(|k| inst(Code::FAdd, 20 + k, &[k, k])).collect();
        assert_eq!(last(&nine), [2, 0, 0, 0, 0]);
    }

    #[test]
    fn what_needs_another_comes_behind_it() {
        let chain = [inst(Code::FAdd, 20, &[0, 1]), inst(Code::FAdd, 21, &[20, 1]), inst(Code::FAdd, 22, &[21, 1])];
        assert_eq!(last(&chain), [3, 0, 0, 0, 0]);
        // Two single components side by side.
        let two = [inst(Code::FAdd, 20, &[0, 1]), inst(Code::FMul, 21, &[2, 3])];
        assert_eq!(last(&two), [1, 0, 0, 0, 0]);
        // Two of two components are not.
        let pairs = [
            inst(Code::FAdd, 20, &[0, 1]),
            inst(Code::FAdd, 21, &[1, 1]),
            inst(Code::FMul, 22, &[2, 3]),
            inst(Code::FMul, 23, &[3, 3]),
        ];
        assert_eq!(last(&pairs), [2, 0, 0, 0, 0]);
    }

    #[test]
    fn an_instruction_reads_one_register_of_constants() {
        // Constants: 64 to 66 and 67 to 69 computed for the draw, 70 and 71 read from one place of 16 bytes, 72 from the next.
        let mut b = builder();
        (64..73).for_each(|v| assert_eq!(b.define(Def::Uniform), v));
        let load = |offset| MemoryOp {
            space: Space::Buffer(0),
            element: NO_REG,
            data: [NO_REG; 4],
            count: 1,
            width: Width::Word,
            address: NO_REG,
            offset,
            uniform: true,
            constant: false,
            atomic: AtomicOp::Add,
        };
        b.memory = vec![load(0), load(4), load(16)];
        b.prologue = (0..3).map(|k| Inst { imm: k, ..inst(Code::Load, 70 + k as V, &[]) }).collect();
        let scaled = |by: V, plus: V| inst(Code::MulAdd, 20, &[0, by, plus]);
        let both: Vec<_> = (0..3).map(|k| inst(Code::MulAdd, 20 + k, &[k, 64 + k, 67 + k])).collect();
        assert_eq!(with_outputs(&b, &both, &[]), [2, 0, 0, 0, 0]);
        // It is moved once.
        let mut again = both.clone();
        again.extend((0..3).map(|k| inst(Code::MulAdd, 30 + k, &[20 + k, 64 + k, 67 + k])));
        assert_eq!(with_outputs(&b, &again, &[]), [3, 0, 0, 0, 0]);
        assert_eq!(with_outputs(&b, &[scaled(70, 71)], &[]), [1, 0, 0, 0, 0]);
        assert_eq!(with_outputs(&b, &[scaled(70, 72)], &[]), [2, 0, 0, 0, 0]);
        assert_eq!(with_outputs(&b, &[scaled(64, 64)], &[]), [1, 0, 0, 0, 0]);
    }

    #[test]
    fn sums_of_constants_are_instructions_and_products_are_not() {
        let mut b = builder();
        (64..80).for_each(|v| assert_eq!(b.define(Def::Uniform), v));
        let of = |code, at: V, of: V| (0..3).map(move |k| inst(code, at + k, &[of + k, of + k]));
        let body: Vec<_> = of(Code::FMul, 20, 0).chain(of(Code::FMul, 23, 20)).collect();
        assert_eq!(with_outputs(&b, &body, &[]), [2, 0, 0, 0, 0]);
        b.prologue = of(Code::FMul, 67, 64).collect();
        assert_eq!(with_outputs(&b, &body, &[]), [2, 0, 0, 0, 0]);
        b.prologue.extend(of(Code::FAdd, 70, 67));
        assert_eq!(with_outputs(&b, &body, &[]), [3, 0, 0, 0, 0]);
    }

    #[test]
    fn dots_quotients_and_signs() {
        assert_eq!(last(&[inst(Code::Dot3, 20, &[0, 1, 2, 3, 4, 5])]), [1, 0, 0, 0, 0]);
        // Three quotients by one value: a reciprocal, and one product that needs it.
        let quotients: Vec<_> = (0..3).map(|k| inst(Code::FDiv, 20 + k, &[k, 5])).collect();
        assert_eq!(last(&quotients), [1, 0, RECIPROCAL, 0, 0]);
        // By two values: reciprocals side by side.
        let two = [inst(Code::FDiv, 20, &[0, 5]), inst(Code::FDiv, 21, &[1, 6])];
        assert_eq!(last(&two), [1, 0, 2 * RECIPROCAL, 0, 0]);
        let free = [inst(Code::FNeg, 20, &[0]), inst(Code::FAdd, 21, &[20, 1]), inst(Code::FSaturate, 22, &[21])];
        assert_eq!(last(&free), [1, 0, 0, 0, 0]);
        // A logarithm beside a vector takes its own time alone.
        let beside = [inst(Code::Log2, 20, &[0]), inst(Code::FAdd, 21, &[1, 1]), inst(Code::FAdd, 22, &[2, 2])];
        assert_eq!(last(&beside), [0, 0, 1, 0, 0]);
    }

    #[test]
    fn blocks_end_where_masks_may_change() {
        let control = |code| Inst { code, dst: Vec::new(), src: vec![0], imm: 0, slots: [0; 3], line: 0 };
        let insts = [inst(Code::FAdd, 20, &[0, 1]), control(Code::If), inst(Code::FAdd, 21, &[1, 2]), control(Code::EndIf)];
        // Entry by entry: what is skipped counts nothing.
        assert_eq!(
            counts(&builder(), &insts, &[]),
            [[0, 0, 0, 0, 0], [1, 0, 0, 0, 0], [1, 0, 0, 1, 0], [2, 0, 0, 1, 0], [2, 0, 0, 1, 0], [2, 0, 0, 1, 0]]
        );
    }

    #[test]
    fn what_comes_out_as_it_came_in_is_moved() {
        let b = builder();
        // A whole register, two of them, and one component beside three results.
        assert_eq!(with_outputs(&b, &[], &[vec![0, 1, 2, 3, 0]]), [1, 0, 0, 0, 0]);
        assert_eq!(with_outputs(&b, &[], &[vec![0, 1, 2, 3, 0], vec![4, 5, 6, 7, 0]]), [2, 0, 0, 0, 0]);
        let sums: Vec<_> = (0..3).map(|k| inst(Code::FAdd, 20 + k, &[k, k])).collect();
        assert_eq!(with_outputs(&b, &sums, &[vec![20, 21, 22]]), [1, 0, 0, 0, 0]);
        // The move of a single component is issued with the sums.
        assert_eq!(with_outputs(&b, &sums, &[vec![20, 21, 22, 3]]), [1, 0, 0, 0, 0]);
        assert_eq!(with_outputs(&b, &sums, &[vec![20, 21, 2, 3]]), [2, 0, 0, 0, 0]);
        // A clamp of an input is done by the move, that of a result with the result.
        let clamped = [inst(Code::FSaturate, 20, &[0]), inst(Code::FAdd, 21, &[1, 2]), inst(Code::FSaturate, 22, &[21])];
        assert_eq!(with_outputs(&b, &clamped, &[vec![22]]), [1, 0, 0, 0, 0]);
        // The sum has a single component, so that the move of two is issued with it.
        assert_eq!(with_outputs(&b, &clamped, &[vec![20, 0]]), [1, 0, 0, 0, 0]);
        assert_eq!(with_outputs(&b, &clamped[..1], &[vec![20, 0]]), [1, 0, 0, 0, 0]);
    }

    #[test]
    fn coefficients_of_a_light_are_one_instruction() {
        let mut b = builder();
        let (zero, small, one) = (b.float(0.0), b.float(1e-30), b.float(1.0));
        let exponent = b.define(Def::Uniform);
        let lit = |scaled: bool| {
            let mut insts = vec![
                inst(Code::Dot3, 20, &[0, 1, 2, 3, 4, 5]),
                inst(Code::FMax, 21, &[20, zero]),
                inst(Code::Dot3, 22, &[0, 1, 2, 6, 7, 8]),
                inst(Code::FMax, 23, &[22, small]),
                inst(Code::Pow, 24, &[23, exponent]),
                inst(Code::FLt, 25, &[zero, 20]),
            ];
            if scaled {
                insts.push(inst(Code::FMul, 26, &[24, 9]));
            }
            insts.push(inst(Code::Select, 27, &[25, if scaled { 26 } else { 24 }, zero]));
            insts
        };
        // Two dot products, the second one beside the move of the exponent, and the coefficients.
        assert_eq!(last_of(&b, &lit(false)), [3, 0, 0, 0, 0]);
        assert_eq!(last_of(&b, &lit(true)), [4, 0, 0, 0, 0]);
        // Where the exponent may be 0, the power is chosen once more.
        let mut zero_exponent = lit(false);
        let at_zero = b.define(Def::Uniform);
        zero_exponent.insert(6, inst(Code::Select, 28, &[at_zero, one, 24]));
        zero_exponent[7].src[1] = 28;
        assert_eq!(last_of(&b, &zero_exponent), [3, 0, 0, 0, 0]);
        // A comparison with anything else is an instruction of its own, and so is a maximum that something else needs.
        let mut spot = lit(false);
        spot[5] = inst(Code::FLe, 25, &[10, 20]);
        assert_eq!(last_of(&b, &spot), [4, 0, 0, 0, 0]);
        // A power that is used elsewhere too is a logarithm, a product and an exponential.
        let mut used = lit(false);
        used.push(inst(Code::FAdd, 29, &[24, 24]));
        assert!(last_of(&b, &used)[2] > 0);
    }

    fn last_of(b: &Builder, insts: &[Inst]) -> Counts {
        with_outputs(b, insts, &[])
    }
}
