//! Registers and operations: the last step of compiling.
//!
//! The registers of a batch are, in this order: uniforms, constants, registers that linear scan allocates, runs of registers that are
//! indexed at run time. A value lives from its definition to its last use. If it is defined before a loop and used inside, it lives to
//! the loop's end. A mutable register lives from its first to its last use.

use super::code::Code;
use super::interface::BindingKind;
use super::ir::{Builder, Def, Inst, NONE, V, texture_src as at};
use super::live;
use super::lower::Lowered;
use super::optimize::is_control;
use super::options::Fault;
use super::program::{Body, MemoryOp, NO_REG, Op, Placed, Program, Reg, Space, Width};
use super::scalar::{self, Counted};
use super::vector;
use work::Class;

/// Most registers of a program: operations number them with 16 bits.
const MAX_REGISTERS: usize = 60_000;

/// Where each value is.
struct Homes {
    values: Vec<Reg>,
    classes: Vec<Reg>,
    ranges: Vec<usize>,
}

impl Homes {
    fn of(&self, b: &Builder, v: V) -> Reg {
        if v == NONE {
            return NO_REG;
        }
        match b.defs[v as usize] {
            Def::Version(class) => self.classes[class as usize],
            Def::Element(range, k) => (self.ranges[range as usize] + k as usize) as Reg,
            _ => self.values[v as usize],
        }
    }
}

/// Uniforms and constants that a list of instructions and some more values use, in order of first use.
fn shared_values(b: &Builder, insts: &[Inst], more: &[V]) -> (Vec<V>, Vec<V>) {
    let mut seen = vec![false; b.defs.len()];
    let (mut uniforms, mut constants) = (Vec::new(), Vec::new());
    for &v in insts.iter().flat_map(|i| &i.src).chain(more) {
        if v == NONE || std::mem::replace(&mut seen[v as usize], true) {
            continue;
        }
        match b.defs[v as usize] {
            Def::Uniform => uniforms.push(v),
            Def::Const(_) => constants.push(v),
            _ => {}
        }
    }
    (uniforms, constants)
}

/// The life of a register, in half-steps: each instruction has one for its uses and one for its definitions.
#[derive(Clone, Copy)]
struct Life {
    start: usize,
    end: usize,
}

/// Allocates registers from `first` on to all values that live. Returns how many.
fn allocate(
    b: &Builder,
    insts: &[Inst],
    inputs: &[V],
    outputs: &[V],
    uniform_temps: bool,
    first: usize,
    homes: &mut Homes,
    fault: Option<Fault>,
) -> usize {
    const NEVER: Life = Life { start: usize::MAX, end: 0 };
    let mut values = vec![NEVER; b.defs.len()];
    let mut classes = vec![NEVER; b.classes as usize];
    // Loops as ranges of half-steps. A loop begins after the operation that opens it. So a value that is written just before that
    // operation is written before the loop, and lives to the loop's end if the body reads it.
    let after = if fault == Some(Fault::LoopsBeginEarly) { 0 } else { 2 };
    let mut loops: Vec<(usize, usize)> = Vec::new();
    let mut open = Vec::new();
    for (i, inst) in insts.iter().enumerate() {
        match inst.code {
            Code::LoopBegin => {
                open.push(loops.len());
                loops.push((2 * i + after, 0));
            }
            Code::LoopEnd | Code::LoopEndIf => {
                if let Some(l) = open.pop() {
                    loops[l].1 = 2 * i + 1;
                }
            }
            _ => {}
        }
    }
    let touch = |values: &mut Vec<Life>, classes: &mut Vec<Life>, v: V, at: usize, inside: &[usize]| {
        let life = match b.defs[v as usize] {
            Def::Temp | Def::Input => &mut values[v as usize],
            Def::Uniform if uniform_temps => &mut values[v as usize],
            Def::Version(class) => &mut classes[class as usize],
            _ => return,
        };
        life.start = life.start.min(at);
        life.end = life.end.max(at);
        for &l in inside {
            if life.start < loops[l].0 {
                life.end = life.end.max(loops[l].1);
            }
        }
    };
    for &v in inputs {
        touch(&mut values, &mut classes, v, 0, &[]);
    }
    let mut inside = Vec::new();
    let mut next_loop = 0;
    for (i, inst) in insts.iter().enumerate() {
        if inst.code == Code::LoopBegin {
            inside.push(next_loop);
            next_loop += 1;
        }
        for &s in inst.src.iter().filter(|&&s| s != NONE) {
            touch(&mut values, &mut classes, s, 2 * i + 2, &inside);
        }
        for &d in inst.dst.iter().filter(|&&d| d != NONE) {
            touch(&mut values, &mut classes, d, 2 * i + 3, &inside);
        }
        if matches!(inst.code, Code::LoopEnd | Code::LoopEndIf) {
            inside.pop();
        }
    }
    for &v in outputs {
        touch(&mut values, &mut classes, v, 2 * insts.len() + 4, &[]);
    }
    // Linear scan over lives by their start.
    let mut order: Vec<(usize, usize, bool, usize)> = Vec::new();
    for (kind, lives) in [(false, &values), (true, &classes)] {
        for (k, life) in lives.iter().enumerate() {
            if life.start != usize::MAX {
                order.push((life.start, life.end, kind, k));
            }
        }
    }
    order.sort_unstable();
    let mut free: Vec<usize> = Vec::new();
    let mut active: std::collections::BinaryHeap<std::cmp::Reverse<(usize, usize)>> = Default::default();
    let mut used = 0;
    for (start, end, is_class, k) in order {
        while let Some(&std::cmp::Reverse((until, r))) = active.peek() {
            if until >= start {
                break;
            }
            active.pop();
            free.push(r);
        }
        // The register freed last is the one most likely still in the first-level cache.
        let r = free.pop().unwrap_or_else(|| {
            used += 1;
            used - 1
        });
        active.push(std::cmp::Reverse((end, r)));
        let home = (first + r).min(usize::from(NO_REG)) as Reg;
        if is_class {
            homes.classes[k] = home;
        } else {
            homes.values[k] = home;
        }
    }
    used
}

/// Makes a program of the result of lowering.
pub(super) fn assemble(module: &str, l: Lowered, fault: Option<Fault>) -> Result<Program, String> {
    let b = &l.builder;
    let slots = usize::from(b.slots) + b.loops.len();
    if slots > usize::from(u16::MAX) {
        return Err(format!(
            "control flow needs {slots} masks and counters, more than the {} that operations can number",
            u16::MAX
        ));
    }
    let inputs: Vec<V> = l.inputs.iter().flatten().copied().collect();
    let outputs: Vec<V> = l.outputs.iter().flatten().copied().collect();
    let no_homes = || Homes {
        values: vec![NO_REG; b.defs.len()],
        classes: vec![NO_REG; b.classes as usize],
        ranges: vec![0; b.ranges.len()],
    };

    // Loads at places that are known here come first in the prologue: they need no interpreter.
    let (placed, computed): (Vec<Inst>, Vec<Inst>) = b.prologue.iter().cloned().partition(|inst| is_placed(b, inst));
    let mut places = vec![None; b.defs.len()];
    for inst in &placed {
        let MemoryOp { space, offset, .. } = b.memory[inst.imm as usize];
        let components = inst.dst.iter().zip(0_u8..).filter(|(v, _)| **v != NONE);
        components.for_each(|(&v, c)| places[v as usize] = Some((space, offset, c)));
    }

    let (mut uniforms, constants) = shared_values(b, &b.insts, &outputs);
    // Most uniforms are loaded as they are. In the order of memory, runs of them are copied at once.
    uniforms.sort_by_key(|&v| places[v as usize].map_or((u16::MAX, 0, 0), |(space, offset, c)| (binding_of(space), offset, c)));
    let mut homes = no_homes();
    for (r, &v) in uniforms.iter().chain(&constants).enumerate() {
        homes.values[v as usize] = r.min(usize::from(NO_REG)) as Reg;
    }
    let first = uniforms.len() + constants.len();
    // Inputs that are read get a register; the others none.
    let mut read = vec![false; b.defs.len()];
    b.insts.iter().flat_map(|i| &i.src).chain(&outputs).filter(|&&v| v != NONE).for_each(|&v| read[v as usize] = true);
    let live_inputs: Vec<V> = inputs.iter().copied().filter(|&v| read[v as usize]).collect();
    let used = allocate(b, &b.insts, &live_inputs, &outputs, false, first, &mut homes, fault);
    let area = first + used;
    for (home, range) in homes.ranges.iter_mut().zip(&b.ranges) {
        *home = area + range.start as usize;
    }
    let registers = area + b.range_registers as usize;
    if registers > MAX_REGISTERS {
        return Err(format!(
            "the program needs {registers} registers, more than the {MAX_REGISTERS} that operations can number"
        ));
    }
    let mut body = emit(b, &b.insts, &l.outputs, &homes);
    body.registers = registers;

    // Of what is loaded, only what is computed from has a register of the prologue.
    let operands = computed.iter().flat_map(|inst| &inst.src).copied().filter(|&v| v != NONE);
    let loaded: Vec<V> = operands.filter(|&v| places[v as usize].is_some()).collect();
    let results: Vec<V> = uniforms.iter().copied().filter(|&v| places[v as usize].is_none()).collect();
    let (_, prologue_constants) = shared_values(b, &computed, &[]);
    let mut prologue_homes = no_homes();
    for (r, &v) in prologue_constants.iter().enumerate() {
        prologue_homes.values[v as usize] = r.min(usize::from(NO_REG)) as Reg;
    }
    let kept = allocate(b, &computed, &loaded, &results, true, prologue_constants.len(), &mut prologue_homes, fault);
    let mut prologue = emit(b, &computed, &[], &prologue_homes);
    let placed_loads = placed.len();
    let storage = |binding: u16| matches!(l.interface.bindings[usize::from(binding)].kind, BindingKind::Storage { .. });
    let places = placed
        .iter()
        .map(|inst| (binding_of(b.memory[inst.imm as usize].space), u64::from(b.memory[inst.imm as usize].offset)));
    let shared_loads: Vec<(u16, u64)> = places.filter(|&(binding, _)| storage(binding)).collect();
    let mut shared_counted = prologue.counts.last().copied().unwrap_or_default();
    let loads = prologue.memory.len() as u32;
    for counts in [&mut shared_counted.instructions, &mut shared_counted.chain] {
        let loads = loads.min(counts[Class::Integer as usize]);
        counts[Class::Integer as usize] -= loads;
    }
    let runs = |homes: &Homes| runs(placed.iter().flat_map(|inst| placed_words(&memory_operation(b, inst, homes))).collect());
    let (placed, placed_uniforms) = (runs(&prologue_homes), runs(&homes));
    prologue.steps.iter_mut().for_each(|steps| *steps += placed_loads as u64 * Code::Load.steps());
    prologue.registers = prologue_constants.len() + kept;
    if prologue.registers > MAX_REGISTERS {
        let needed = prologue.registers;
        return Err(format!(
            "the program needs {needed} uniform registers, more than the {MAX_REGISTERS} that operations can number"
        ));
    }
    let bits = |list: &[V]| list.iter().filter_map(|&v| b.known(v)).collect::<Vec<u32>>();
    let mut interface = l.interface;
    interface.registers = (live::most(b, &b.insts, &outputs).unwrap_or(used) + b.range_registers as usize) as u32;
    Ok(Program {
        module: module.to_owned(),
        uniforms: uniforms.len(),
        placed_uniforms,
        computed_uniforms: results.iter().map(|&v| (homes.of(b, v), prologue_homes.of(b, v))).collect(),
        prologue_constants: bits(&prologue_constants),
        constants: bits(&constants),
        shared_bytes: l.shared_bytes,
        inputs: l.inputs.iter().map(|v| v.iter().map(|&v| homes.of(b, v)).collect()).collect(),
        outputs: l.outputs.iter().map(|v| v.iter().map(|&v| homes.of(b, v)).collect()).collect(),
        interface,
        placed,
        placed_loads,
        shared_loads,
        shared_counted,
        prologue,
        body,
    })
}

/// The operations of a list of instructions.
fn emit(b: &Builder, insts: &[Inst], outputs: &[Vec<V>], homes: &Homes) -> Body {
    let mut body = Body {
        subgroup: b.subgroup.clone(),
        table: b.table.clone(),
        slots: usize::from(b.slots) + b.loops.len(),
        first_counter: usize::from(b.slots),
        loops: b.loops.clone(),
        ..Body::default()
    };
    for inst in insts {
        if inst.code == Code::Undef {
            continue;
        }
        let op = operation(b, inst, homes, &mut body);
        body.ops.push(op);
        body.lines.push(inst.line);
    }
    body.ops.push(Op { code: Code::End, r: [NO_REG; 9], imm: 0 });
    body.lines.push(0);
    link(&mut body.ops);
    body.vectors = vector::counts(b, insts, outputs).into_iter().map(Counted::dependent).collect();
    let outputs = outputs.concat();
    body.counts = scalar::counts(b, insts, &outputs);
    body.in_flight = scalar::in_flight(b, insts, &outputs);
    let mut steps = 0;
    body.steps.push(steps);
    for op in &body.ops {
        steps += op.code.steps();
        body.steps.push(steps);
    }
    body
}

/// Whether an instruction loads from a buffer at a place that is known when the program is compiled.
fn is_placed(b: &Builder, inst: &Inst) -> bool {
    let buffer = |inst: &Inst| matches!(b.memory[inst.imm as usize].space, Space::Buffer(_));
    inst.code == Code::Load && inst.src.iter().all(|&v| v == NONE) && buffer(inst)
}

/// The components of a load from a buffer.
fn placed_words(op: &MemoryOp) -> Vec<Placed> {
    let components = op.data.iter().zip(0..u64::from(op.count)).filter(|(register, _)| **register != NO_REG);
    let one = |(&register, c)| Placed {
        register,
        binding: binding_of(op.space),
        offset: u64::from(op.offset) + op.width.bytes() * c,
        width: op.width,
        count: 1,
        words: None,
    };
    components.map(one).collect()
}

/// The binding that a load at a known place reads.
fn binding_of(space: Space) -> u16 {
    match space {
        Space::Buffer(binding) => binding,
        // No load at a known place is of these.
        Space::Shared | Space::Immediate => u16::MAX,
    }
}

/// Joins components that lie side by side in memory, and go to registers side by side.
fn runs(mut components: Vec<Placed>) -> Vec<Placed> {
    components.sort_by_key(|placed| (placed.binding, placed.offset, placed.register));
    let mut runs: Vec<Placed> = Vec::new();
    for placed in components {
        match runs.last_mut() {
            Some(run)
                if (run.binding, run.width) == (placed.binding, placed.width)
                    && run.offset + run.width.bytes() * u64::from(run.count) == placed.offset
                    && run.register + run.count == placed.register =>
            {
                run.count += 1;
            }
            _ => runs.push(placed),
        }
    }
    for run in &mut runs {
        let first = u32::try_from(run.offset / 4).ok().filter(|_| run.width == Width::Word && run.offset.is_multiple_of(4));
        run.words = first.and_then(|first| Some(first..first.checked_add(u32::from(run.count))?));
    }
    runs
}

/// A load, store or atomic with its registers.
fn memory_operation(b: &Builder, inst: &Inst, homes: &Homes) -> MemoryOp {
    let home = |v: V| homes.of(b, v);
    let src = |k: usize| inst.src.get(k).map_or(NO_REG, |&v| home(v));
    let dst = |k: usize| inst.dst.get(k).map_or(NO_REG, |&v| home(v));
    let data = match inst.code {
        Code::Load => [dst(0), dst(1), dst(2), dst(3)],
        Code::Store => [src(2), src(3), src(4), src(5)],
        _ => [dst(0), src(2), src(3), dst(1)],
    };
    MemoryOp { address: src(0), element: src(1), data, ..b.memory[inst.imm as usize] }
}

fn operation(b: &Builder, inst: &Inst, homes: &Homes, body: &mut Body) -> Op {
    let home = |v: V| homes.of(b, v);
    let src = |k: usize| inst.src.get(k).map_or(NO_REG, |&v| home(v));
    let dst = |k: usize| inst.dst.get(k).map_or(NO_REG, |&v| home(v));
    let mut op = Op { code: inst.code, r: [NO_REG; 9], imm: inst.imm };
    match inst.code {
        Code::Load | Code::Store | Code::Atomic => {
            body.memory.push(memory_operation(b, inst, homes));
            op.imm = (body.memory.len() - 1) as u32;
        }
        Code::ArrayLength => {
            let (binding, offset, stride) = b.lengths[inst.imm as usize];
            op.r[..5].copy_from_slice(&[dst(0), src(0), binding, stride as Reg, (stride >> 16) as Reg]);
            op.imm = offset;
        }
        Code::LoadConst => {
            let (first, n) = b.tables[inst.imm as usize];
            op.r[..4].copy_from_slice(&[dst(0), src(0), n as Reg, (n >> 16) as Reg]);
            op.imm = first;
        }
        Code::Texture | Code::TextureStore | Code::TextureAtomic | Code::TextureQuery => {
            let mut t = b.textures[inst.imm as usize];
            t.texture_element = src(at::ELEMENT);
            t.sampler_element = src(at::SAMPLER_ELEMENT);
            t.layer = src(at::LAYER);
            t.sample = src(at::SAMPLE);
            t.level = src(at::LEVEL);
            t.reference = src(at::REFERENCE);
            for k in 0..3 {
                t.coordinate[k] = src(at::COORDINATE + k);
                t.gradient_x[k] = src(at::GRADIENT_X + k);
                t.gradient_y[k] = src(at::GRADIENT_Y + k);
            }
            for k in 0..4 {
                let store = matches!(inst.code, Code::TextureStore | Code::TextureAtomic);
                t.data[k] = if store { src(at::DATA + k) } else { dst(k) };
            }
            body.textures.push(t);
            op.imm = (body.textures.len() - 1) as u32;
        }
        Code::Subgroup => {
            op.r[..6].copy_from_slice(&[dst(0), dst(1), dst(2), dst(3), src(0), src(1)]);
        }
        Code::If => op.r[..2].copy_from_slice(&[inst.slots[0], src(0)]),
        Code::LoopBegin | Code::LoopEnd | Code::LoopEndIf => {
            op.r[..3].copy_from_slice(&[inst.slots[0], b.slots + inst.slots[1], src(0)]);
        }
        Code::BreakIf | Code::BreakIfNot => op.r[..3].copy_from_slice(&[src(0), inst.slots[1], inst.slots[2]]),
        code if is_control(code) => op.r[..3].copy_from_slice(&inst.slots),
        _ => {
            let regs = inst.dst.iter().chain(&inst.src).map(|&v| home(v));
            for (r, v) in op.r.iter_mut().zip(regs) {
                *r = v;
            }
        }
    }
    op
}

/// Fills in jump targets. An operation that leaves its mask empty jumps to the *join* of the construct around it: the next place
/// where lanes that are not in its mask may go on.
fn link(ops: &mut [Op]) {
    // Pass 1, backwards: the join that follows each operation, by nesting.
    let end = ops.len() - 1;
    let mut joins = vec![end];
    let mut back_edges: Vec<usize> = Vec::new();
    for i in (0..ops.len()).rev() {
        let code = ops[i].code;
        let join = *joins.last().unwrap_or(&end);
        match code {
            Code::EndIf | Code::RegionEnd => {
                ops[i].imm = join as u32;
                joins.push(i);
            }
            Code::LoopEnd | Code::LoopEndIf => {
                ops[i].r[3] = join as Reg;
                ops[i].r[4] = (join >> 16) as Reg;
                joins.push(i);
                back_edges.push(i);
            }
            Code::Continuing => {
                ops[i].imm = join as u32;
                joins.pop();
                joins.push(i);
            }
            Code::Else => {
                ops[i].imm = join as u32;
                joins.pop();
                joins.push(i);
            }
            Code::If => {
                ops[i].imm = join as u32;
                joins.pop();
            }
            Code::RegionBegin => {
                joins.pop();
            }
            Code::LoopBegin => {
                joins.pop();
                if let Some(e) = back_edges.pop() {
                    ops[e].imm = i as u32 + 1;
                }
            }
            Code::Exit | Code::Continue | Code::BreakIf | Code::BreakIfNot | Code::Discard => {
                ops[i].imm = join as u32;
            }
            _ => {}
        }
    }
}
