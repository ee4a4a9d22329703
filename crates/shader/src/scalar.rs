//! Instruction counts of a program on a machine whose instructions work on one component, and the longest chain of instructions that need
//! each other.
//!
//! The costs are those of NVIDIA's instruction set of 2014 (Maxwell, "CUDA Binary Utilities", and what its compilers make of GLSL). A product
//! and a sum are one instruction, so a dot product of `n` components is `n` instructions. A quotient is a reciprocal and a product, a root is a
//! reciprocal root and a product, and a unit vector is a dot product, a reciprocal root and a product for each component. The special
//! function unit computes reciprocals, reciprocal roots, logarithms and exponentials to the base 2, sines and cosines, and converts between
//! integers and floating-point numbers. Negation, magnitude and clamping to 0 to 1 are part of the instruction that reads or makes the value.
//!
//! Between two places where the execution mask may change, a compiler may order instructions as it likes: what takes a warp longest there is
//! the longest chain, or the issue of all instructions. So chains are found for each such block, and a step of a program has the sum of those
//! of its blocks.
//!
//! A value that is made for a mutable register is made there: the copy is no instruction if nothing else reads the value and nothing reads or
//! writes the register in between.

use std::collections::HashMap;

use super::code::Code;
use super::ir::{Builder, Def, Inst, NONE, V};
use super::optimize::is_control;
use super::program::Space;
use work::{Class, InFlight, Service, ServiceMap};

/// Instructions by class.
pub(super) type Counts = [u32; Class::COUNT];

/// Instructions of a piece of a program.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Counted {
    /// All of them.
    pub instructions: Counts,
    /// Those of the longest chain.
    pub chain: Counts,
}

impl Counted {
    /// Instructions that all wait for the one before them.
    pub fn dependent(instructions: Counts) -> Counted {
        Counted { instructions, chain: instructions }
    }

    /// What is counted up to `self` and not up to `from`.
    #[inline(always)]
    pub fn since(&self, from: &Counted) -> Counted {
        let without = |to: &Counts, from: &Counts| std::array::from_fn(|k| to[k].wrapping_sub(from[k]));
        Counted { instructions: without(&self.instructions, &from.instructions), chain: without(&self.chain, &from.chain) }
    }

    /// Adds what is counted elsewhere.
    #[inline(always)]
    pub fn add(&mut self, more: &Counted) {
        let sums = self.instructions.iter_mut().chain(&mut self.chain);
        sums.zip(more.instructions.iter().chain(&more.chain)).for_each(|(sum, n)| *sum = sum.wrapping_add(*n));
    }
}

/// How far an instruction is from one that needs its result, by class: which of two chains is the longer depends on it, nothing else.
/// 6, 14 and 86 (a multiplication) were measured on Maxwell (Jia et al. 2019, table 4.1), and a branch is assumed to take 10.
const LATENCY: Counts = [6, 6, 14, 10, 86];

/// Counts of single precision, integers, the special function unit and multiplications.
const fn arithmetic(float: u32, integer: u32, special: u32, multiply: u32) -> Counts {
    [float, integer, special, 0, multiply]
}

/// What a code counts as: its instructions, and those among them that wait for each other.
pub(super) fn cost(code: Code) -> Counted {
    use Code as C;
    let (instructions, chain) = match code {
        // Parts of the instructions around them.
        C::FNeg | C::FAbs | C::FSaturate | C::INeg => return Counted::default(),
        C::MulAdd | C::MulSub | C::NegMulAdd => return Counted::dependent(arithmetic(1, 0, 0, 0)),
        C::Dot2 => return Counted::dependent(arithmetic(2, 0, 0, 0)),
        C::Dot3 => return Counted::dependent(arithmetic(3, 0, 0, 0)),
        C::Dot4 => return Counted::dependent(arithmetic(4, 0, 0, 0)),
        C::Normalize2 => (arithmetic(4, 0, 1, 0), arithmetic(3, 0, 1, 0)),
        C::Normalize3 => (arithmetic(6, 0, 1, 0), arithmetic(4, 0, 1, 0)),
        // Two bounds, two operations.
        C::FClamp | C::FFract | C::FSign => return Counted::dependent(arithmetic(2, 0, 0, 0)),
        // To 16 bits and back.
        C::Quantize => return Counted::dependent(arithmetic(2, 0, 0, 0)),
        C::FInvSqrt | C::Exp2 | C::Log2 => return Counted::dependent(arithmetic(0, 0, 1, 0)),
        // The other base, the angle in turns, the divisor's reciprocal, the root's.
        C::Exp | C::Log | C::Sin | C::Cos | C::FDiv | C::FSqrt => return Counted::dependent(arithmetic(1, 0, 1, 0)),
        // A sine, a cosine, its reciprocal.
        C::Tan => (arithmetic(2, 0, 3, 0), arithmetic(2, 0, 2, 0)),
        // A quotient, its whole part, the rest.
        C::FRem => return Counted::dependent(arithmetic(3, 0, 1, 0)),
        C::Pow => return Counted::dependent(arithmetic(1, 0, 2, 0)),
        // A root and a polynomial; a reciprocal where the argument is above 1, and a polynomial.
        C::Asin | C::Acos => return Counted::dependent(arithmetic(7, 0, 1, 0)),
        C::Atan => return Counted::dependent(arithmetic(8, 0, 1, 0)),
        // The quadrant besides.
        C::Atan2 => return Counted::dependent(arithmetic(11, 0, 1, 0)),
        // An exponential, its reciprocal, their sum; their quotient.
        C::Sinh | C::Cosh => return Counted::dependent(arithmetic(3, 0, 2, 0)),
        C::Tanh => return Counted::dependent(arithmetic(4, 0, 3, 0)),
        // A root, a sum, a logarithm; a quotient, a logarithm.
        C::Asinh | C::Acosh => return Counted::dependent(arithmetic(4, 0, 2, 0)),
        C::Atanh => return Counted::dependent(arithmetic(4, 0, 2, 0)),
        C::FToS | C::FToU | C::HalfToS | C::HalfToU | C::SToF | C::UToF => return Counted::dependent(arithmetic(0, 0, 1, 0)),
        // Scaled, clamped, converted.
        C::ToSnorm8 | C::ToUnorm8 | C::ToSnorm16 | C::ToUnorm16 => return Counted::dependent(arithmetic(2, 0, 1, 0)),
        C::PopCount | C::Clz | C::FirstLeadingU | C::FirstLeadingS => return Counted::dependent(arithmetic(0, 0, 1, 0)),
        // The bits reversed.
        C::Ctz | C::FirstTrailing => return Counted::dependent(arithmetic(0, 1, 1, 0)),
        C::ISign => return Counted::dependent(arithmetic(0, 2, 0, 0)),
        C::IMul => return Counted::dependent(arithmetic(0, 0, 0, 1)),
        // An estimate in floating point, corrected twice; the signs; the rest.
        C::UDiv => (arithmetic(1, 5, 3, 3), arithmetic(1, 4, 3, 2)),
        C::SDiv => (arithmetic(1, 9, 3, 3), arithmetic(1, 6, 3, 2)),
        C::URem => (arithmetic(1, 5, 3, 4), arithmetic(1, 4, 3, 3)),
        C::SRem => (arithmetic(1, 9, 3, 4), arithmetic(1, 6, 3, 3)),
        code => {
            let (class, count) = code.weight();
            let mut counts = [0; Class::COUNT];
            counts[class as usize] = count;
            return Counted::dependent(counts);
        }
    };
    Counted { instructions, chain }
}

/// A chain of instructions, and how long it takes.
#[derive(Clone, Copy, Default)]
struct Chain {
    cycles: u64,
    counts: Counts,
}

impl Chain {
    fn longer(self, other: Chain) -> Chain {
        if other.cycles > self.cycles { other } else { self }
    }

    fn and(mut self, counts: &Counts) -> Chain {
        for (class, &count) in counts.iter().enumerate() {
            self.cycles += u64::from(count) * u64::from(LATENCY[class]);
            self.counts[class] = self.counts[class].saturating_add(count);
        }
        self
    }
}

/// Where values are: each by itself, versions in their register, elements in their range.
struct Homes<'a> {
    b: &'a Builder,
}

impl Homes<'_> {
    fn of(&self, v: V) -> (u8, u32) {
        match self.b.defs[v as usize] {
            Def::Version(class) => (1, class),
            Def::Element(range, _) => (2, range),
            _ => (0, v),
        }
    }
}

/// What is known of a home in the current block.
#[derive(Clone, Copy, Default)]
struct Home {
    /// The chain that ends with its contents.
    chain: Chain,
    /// The last operation that read or wrote it.
    touched: usize,
    /// The operation of the block that made it, if one did.
    made: Option<usize>,
}

/// Running counts of instructions: entry `i` counts those of the operations before operation `i`. Operations are the instructions that are
/// not [`Code::Undef`], and the end. The longest chain of a block counts with its first operation, except for the last operation, which
/// counts with itself: a jump may lead there.
pub(super) fn counts(b: &Builder, insts: &[Inst], outputs: &[V]) -> Vec<Counted> {
    let homes = Homes { b };
    let mut uses = vec![0_u32; b.defs.len()];
    for &v in insts.iter().flat_map(|inst| &inst.src).chain(outputs).filter(|&&v| v != NONE) {
        uses[v as usize] += 1;
    }
    let insts: Vec<&Inst> = insts.iter().filter(|inst| inst.code != Code::Undef).collect();
    let mut each = vec![Counted::default(); insts.len() + 1];
    let mut known: HashMap<(u8, u32), Home> = HashMap::new();
    let (mut first, mut longest) = (0, Chain::default());
    for (at, inst) in insts.iter().enumerate() {
        let sources = || inst.src.iter().filter(|&&v| v != NONE).map(|&v| homes.of(v));
        let in_place = matches!(inst.code, Code::Mov | Code::Copy) && {
            let (from, to) = (inst.src[0], homes.of(inst.dst[0]));
            let alone = b.defs[from as usize] == Def::Temp && uses[from as usize] == 1;
            let made = known.get(&homes.of(from)).and_then(|home| home.made);
            alone && made.is_some_and(|made| known.get(&to).is_none_or(|home| home.touched <= made))
        };
        // A sum of a product that nothing else needs is part of the multiplication.
        let made = |v: V| known.get(&homes.of(v)).and_then(|home| home.made);
        let product = |v: V| v != NONE && uses[v as usize] == 1 && made(v).is_some_and(|made| insts[made].code == Code::IMul);
        let with_product = inst.code == Code::IAdd && inst.src.iter().any(|&v| product(v));
        let own = if in_place || with_product { Counted::default() } else { cost(inst.code) };
        each[at].instructions = own.instructions;
        let needs =
            sources().filter_map(|home| known.get(&home)).fold(Chain::default(), |chain, home| chain.longer(home.chain));
        if inst.code.breaks_block() {
            each[first].chain = longest.counts;
            each[at].chain = std::array::from_fn(|k| each[at].chain[k] + own.chain[k]);
            (first, longest) = (at + 1, Chain::default());
            known.clear();
            continue;
        }
        for home in sources() {
            known.entry(home).or_default().touched = at;
        }
        let chain = needs.and(&own.chain);
        longest = longest.longer(chain);
        let stored = (inst.code == Code::StoreIndexed).then(|| inst.src[0]);
        for &v in inst.dst.iter().chain(&stored).filter(|&&v| v != NONE) {
            *known.entry(homes.of(v)).or_default() = Home { chain, touched: at, made: Some(at) };
        }
    }
    each[first].chain = longest.counts;
    let mut sum = Counted::default();
    let mut counts = Vec::with_capacity(each.len() + 1);
    counts.push(sum);
    for one in &each {
        sum.add(one);
        counts.push(sum);
    }
    counts
}

/// How many requests may be unanswered where a block begins with an operation: those of which no operation of the block needs a result. What is
/// asked before a branch is answered when the block behind the branch begins.
pub(super) fn in_flight(b: &Builder, insts: &[Inst], outputs: &[V]) -> Vec<InFlight> {
    let homes = Homes { b };
    let insts: Vec<&Inst> = insts.iter().filter(|inst| inst.code != Code::Undef).collect();
    let mut all = vec![InFlight::NONE; insts.len() + 1];
    // The results of what is asked and may be unanswered, oldest first.
    let mut asked = ServiceMap::<Vec<Vec<(u8, u32)>>>::default();
    let (mut begin, mut behind_branch) = (0, false);
    let mut needed: Vec<(u8, u32)> = Vec::new();
    for at in 0..=insts.len() {
        let Some(inst) = insts.get(at) else {
            needed.extend(outputs.iter().filter(|&&v| v != NONE).map(|&v| homes.of(v)));
            all[begin] = if behind_branch { InFlight::NONE } else { allowed(&asked, &needed) };
            break;
        };
        // A copy under the mask keeps what it does not write, so that its target is an operand too.
        needed.extend(inst.src.iter().chain(&inst.dst).filter(|&&v| v != NONE).map(|&v| homes.of(v)));
        if !inst.code.breaks_block() {
            continue;
        }
        let service = match inst.code {
            Code::Load | Code::Store | Code::Atomic => match &b.memory[inst.imm as usize] {
                op if op.space == Space::Shared => Service::Shared,
                op if op.constant => Service::Constant,
                _ => Service::Texture,
            },
            _ => Service::Texture,
        };
        let results: Vec<(u8, u32)> = inst.dst.iter().filter(|&&v| v != NONE).map(|&v| homes.of(v)).collect();
        // Its own results are no operands.
        needed.truncate(needed.len() - results.len());
        let unanswered = if behind_branch { InFlight::NONE } else { allowed(&asked, &needed) };
        all[begin] = unanswered;
        needed.clear();
        behind_branch = is_control(inst.code);
        if behind_branch {
            asked = Default::default();
        } else if !is_immediate(b, inst) {
            for (asked, &left) in asked.values_mut().zip(unanswered.values()) {
                let answered = asked.len().saturating_sub(usize::from(left));
                asked.drain(..answered);
            }
            asked[service].push(results);
        }
        begin = at + 1;
    }
    all
}

/// Whether a load is of immediates, which are in registers.
fn is_immediate(b: &Builder, inst: &Inst) -> bool {
    inst.code == Code::Load && b.memory[inst.imm as usize].space == Space::Immediate
}

/// How many requests may be unanswered where these values are needed.
fn allowed(asked: &ServiceMap<Vec<Vec<(u8, u32)>>>, needed: &[(u8, u32)]) -> InFlight {
    let left = |asked: &[Vec<(u8, u32)>]| {
        let last = asked.iter().rposition(|results| results.iter().any(|result| needed.contains(result)));
        last.map_or(u8::MAX, |last| (asked.len() - 1 - last).min(usize::from(u8::MAX)) as u8)
    };
    InFlight::from_fn(|service| left(&asked[service]))
}

#[cfg(test)]
mod tests {
    use super::super::program::{AtomicOp, MemoryOp, NO_REG, Width};
    use super::*;

    fn inst(code: Code, dst: &[V], src: &[V]) -> Inst {
        Inst { code, dst: dst.to_vec(), src: src.to_vec(), imm: 0, slots: [0; 3], line: 0 }
    }

    /// A builder with inputs 0 to 9, results 10 to 39, and a mutable register of which 40 and 41 are versions.
    fn builder() -> Builder {
        let mut b = Builder::default();
        for _ in 0..10 {
            b.define(Def::Input);
        }
        for _ in 10..40 {
            b.define(Def::Temp);
        }
        let class = b.class();
        for _ in 40..42 {
            b.version(class);
        }
        b
    }

    /// All instructions, and the longest chain.
    fn all(insts: &[Inst]) -> (Counts, Counts) {
        let last = *counts(&builder(), insts, &[]).last().expect("there is one");
        (last.instructions, last.chain)
    }

    #[test]
    fn a_product_and_a_sum_are_one_instruction() {
        let chain: Vec<Inst> = (0..4).map(|k| inst(Code::MulAdd, &[10 + k], &[if k == 0 { 0 } else { 9 + k }, 1, 2])).collect();
        assert_eq!(all(&chain), ([4, 0, 0, 0, 0], [4, 0, 0, 0, 0]));
        // Four chains of two.
        let chains: Vec<Inst> = (0..8).map(|k| inst(Code::MulAdd, &[10 + k], &[if k < 4 { k } else { 6 + k }, 8, 9])).collect();
        assert_eq!(all(&chains), ([8, 0, 0, 0, 0], [2, 0, 0, 0, 0]));
        // Integers: a multiplication with its sum, and a sum alone.
        let sum = [inst(Code::IMul, &[10], &[0, 1]), inst(Code::IAdd, &[11], &[10, 2])];
        assert_eq!(all(&sum), ([0, 0, 0, 0, 1], [0, 0, 0, 0, 1]));
        let twice = [sum[0].clone(), sum[1].clone(), inst(Code::IAdd, &[12], &[10, 3])];
        assert_eq!(all(&twice), ([0, 2, 0, 0, 1], [0, 1, 0, 0, 1]));
    }

    #[test]
    fn what_an_instruction_set_lacks_is_made_of_what_it_has() {
        let one = |code, src: &[V]| all(&[inst(code, &[10], src)]).0;
        assert_eq!(one(Code::Dot3, &[0, 1, 2, 3, 4, 5]), [3, 0, 0, 0, 0]);
        assert_eq!(one(Code::Dot4, &[0, 1, 2, 3, 4, 5, 6, 7]), [4, 0, 0, 0, 0]);
        assert_eq!(one(Code::FDiv, &[0, 1]), [1, 0, 1, 0, 0]);
        assert_eq!(one(Code::FSqrt, &[0]), [1, 0, 1, 0, 0]);
        assert_eq!(one(Code::FInvSqrt, &[0]), [0, 0, 1, 0, 0]);
        assert_eq!(one(Code::FNeg, &[0]), [0; 5]);
        assert_eq!(one(Code::UDiv, &[0, 1]), [1, 5, 3, 0, 3]);
        let unit = inst(Code::Normalize3, &[10, 11, 12], &[0, 1, 2]);
        assert_eq!(all(std::slice::from_ref(&unit)), ([6, 0, 1, 0, 0], [4, 0, 1, 0, 0]));
    }

    #[test]
    fn a_value_is_made_in_the_register_that_it_is_for() {
        let made = inst(Code::FMul, &[10], &[40, 0]);
        let moved = inst(Code::Mov, &[41], &[10]);
        assert_eq!(all(&[made.clone(), moved.clone()]).0, [1, 0, 0, 0, 0]);
        // The old contents are read after the value is made: a copy.
        let read = inst(Code::FAdd, &[11], &[40, 1]);
        assert_eq!(all(&[made.clone(), read, moved.clone()]).0, [3, 0, 0, 0, 0]);
        // Something else reads the value.
        let again = inst(Code::FAdd, &[11], &[10, 1]);
        assert_eq!(all(&[made, moved, again]).0, [3, 0, 0, 0, 0]);
    }

    #[test]
    fn a_block_waits_for_the_requests_that_it_needs() {
        let mut b = builder();
        let sample = |k: V| inst(Code::Texture, &[10 + k], &[k]);
        let add = |to: V, x: V, y: V| inst(Code::FAdd, &[to], &[x, y]);
        // Three samples; the sum of the first two; the third.
        let insts = [sample(0), sample(1), sample(2), add(20, 10, 11), sample(3), add(21, 20, 13)];
        let memory = |b: &Builder, insts: &[Inst], outputs: &[V]| {
            in_flight(b, insts, outputs).iter().map(|of| of[Service::Texture]).collect::<Vec<_>>()
        };
        assert_eq!(memory(&b, &insts, &[21]), [255, 255, 255, 1, 0, 0, 0]);
        // What only an output needs is waited for in the end.
        assert_eq!(memory(&b, &insts[..3], &[10, 11])[3], 1);
        assert_eq!(memory(&b, &insts[..3], &[12])[3], 0);
        assert_eq!(memory(&b, &insts[..3], &[])[3], 255);
        // A coordinate that another sample gives.
        let chase = [sample(0), inst(Code::Texture, &[11], &[10]), inst(Code::Texture, &[12], &[11])];
        assert_eq!(memory(&b, &chase, &[12]), [255, 0, 0, 0]);
        // Behind a branch all is there, and so it is where a jump leads.
        let branch = [sample(0), inst(Code::If, &[], &[5]), add(20, 1, 2), inst(Code::EndIf, &[], &[]), add(21, 3, 4)];
        assert_eq!(memory(&b, &branch, &[21])[1..], [255, 0, 0, 0, 0][..]);
        // Workgroup memory and uniform buffers are answered apart.
        let memory_op = MemoryOp {
            space: Space::Shared,
            element: NO_REG,
            data: [NO_REG; 4],
            count: 1,
            width: Width::Word,
            address: NO_REG,
            offset: 0,
            uniform: false,
            constant: false,
            atomic: AtomicOp::Add,
        };
        let shared = b.memory_entry(memory_op);
        let buffer = b.memory_entry(MemoryOp { space: Space::Buffer(0), ..memory_op });
        let load = |to: V, entry: u32| Inst { imm: entry, ..inst(Code::Load, &[to], &[0]) };
        let both = [load(10, shared), load(11, buffer), load(12, shared), add(20, 11, 1), load(13, buffer), add(21, 10, 20)];
        let found: Vec<_> = in_flight(&b, &both, &[21]).iter().map(|of| (of[Service::Texture], of[Service::Shared])).collect();
        assert_eq!(found, [(255, 255), (255, 255), (255, 255), (0, 255), (0, 0), (255, 1), (0, 0)]);
        let constant = b.memory_entry(MemoryOp { space: Space::Buffer(1), constant: true, ..memory_op });
        let both =
            [load(10, constant), load(11, buffer), load(12, constant), add(20, 11, 1), load(13, buffer), add(21, 10, 20)];
        let found: Vec<_> =
            in_flight(&b, &both, &[21]).iter().map(|of| (of[Service::Texture], of[Service::Constant])).collect();
        assert_eq!(found, [(255, 255), (255, 255), (255, 255), (0, 255), (0, 0), (255, 1), (0, 0)]);
    }

    #[test]
    fn the_chains_of_blocks_add_up() {
        let block = |first: V| [inst(Code::FAdd, &[first], &[0, 1]), inst(Code::FAdd, &[first + 1], &[2, 3])];
        let mut insts = block(10).to_vec();
        insts.push(inst(Code::If, &[], &[4]));
        insts.extend(block(12));
        insts.push(inst(Code::EndIf, &[], &[]));
        assert_eq!(all(&insts), ([4, 0, 0, 1, 0], [2, 0, 0, 1, 0]));
        // A jump to the end of the branch counts nothing of the block before it.
        let counts = counts(&builder(), &insts, &[]);
        assert_eq!(counts[6].since(&counts[5]), Counted::default());
        assert_eq!(counts[5].since(&counts[3]).chain, [1, 0, 0, 0, 0]);
    }
}
