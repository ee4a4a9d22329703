//! How many values of a program live at once: the registers that an invocation needs.
//!
//! A value lives from its definition to its last use along every path that an invocation can take, a mutable register from each write to
//! the last read of what was written. An instruction may put its result where an operand was that nothing reads any more. Constants and
//! uniforms are operands that come from the constant bank, and need no register; outputs need one each in the end.
//!
//! A compiler with that many registers can give each value one, up to copies. The registers of the executor are others: it allocates them by
//! a linear scan, which is fast and needs more.

use super::code::Code;
use super::ir::{Builder, Def, Inst, NONE, V};

/// Most bits of the sets that are kept for loops. Programs with more get no count.
const MOST_BITS: usize = 1 << 28;

/// A set of values and mutable registers.
#[derive(Clone, Default, PartialEq)]
struct Set {
    words: Vec<u64>,
    count: usize,
}

impl Set {
    fn of(size: usize) -> Set {
        Set { words: vec![0; size.div_ceil(64)], count: 0 }
    }

    fn insert(&mut self, at: usize) {
        let (word, bit) = (&mut self.words[at / 64], 1 << (at % 64));
        self.count += usize::from(*word & bit == 0);
        *word |= bit;
    }

    fn remove(&mut self, at: usize) {
        let (word, bit) = (&mut self.words[at / 64], 1 << (at % 64));
        self.count -= usize::from(*word & bit != 0);
        *word &= !bit;
    }

    fn join(&mut self, other: &Set) {
        for (word, other) in self.words.iter_mut().zip(&other.words) {
            *word |= other;
        }
        self.count = self.words.iter().map(|word| word.count_ones() as usize).sum();
    }
}

/// A construct around an instruction, with what lives where it is left.
struct Frame {
    code: Code,
    slot: u16,
    /// Behind its end.
    end: Set,
    /// At the beginning of the other branch, or where a loop continues.
    other: Option<Set>,
}

/// Numbers of what lives: values by themselves, versions by their mutable register.
struct Numbers<'a> {
    b: &'a Builder,
}

impl Numbers<'_> {
    fn size(&self) -> usize {
        self.b.defs.len() + self.b.classes as usize
    }

    fn of(&self, v: V) -> Option<usize> {
        if v == NONE {
            return None;
        }
        match self.b.defs[v as usize] {
            Def::Temp | Def::Input => Some(v as usize),
            Def::Version(class) => Some(self.b.defs.len() + class as usize),
            Def::Const(_) | Def::Uniform | Def::Element(..) => None,
        }
    }
}

/// The most values that live at once. None where the program has too many loops to find out.
pub(super) fn most(b: &Builder, insts: &[Inst], outputs: &[V]) -> Option<usize> {
    let numbers = Numbers { b };
    let loops = insts.iter().filter(|inst| inst.code == Code::LoopBegin).count();
    if loops.checked_mul(numbers.size())? > MOST_BITS {
        return None;
    }
    // What lives at the beginning of each loop's body, which grows until it is what the end of the body jumps to.
    let mut heads = vec![Set::of(numbers.size()); b.loops.len()];
    loop {
        let before = heads.iter().map(|head| head.count).sum::<usize>();
        let most = pass(&numbers, insts, outputs, &mut heads);
        if heads.iter().map(|head| head.count).sum::<usize>() == before {
            return Some(most);
        }
    }
}

/// Goes over a program from its end to its beginning, and adds what lives at the beginnings of loops.
fn pass(numbers: &Numbers<'_>, insts: &[Inst], outputs: &[V], heads: &mut [Set]) -> usize {
    let mut live = Set::of(numbers.size());
    outputs.iter().filter_map(|&v| numbers.of(v)).for_each(|at| live.insert(at));
    let mut most = outputs.len();
    let mut frames: Vec<Frame> = Vec::new();
    let left = |frames: &[Frame], first: u16| {
        frames.iter().rev().find(|frame| frame.slot + 1 == first && frame.code != Code::EndIf).map(|frame| frame.end.clone())
    };
    for inst in insts.iter().rev() {
        let slots = inst.slots;
        match inst.code {
            Code::EndIf | Code::RegionEnd | Code::LoopEnd | Code::LoopEndIf => {
                frames.push(Frame { code: inst.code, slot: slots[0], end: live.clone(), other: None });
                match inst.code {
                    Code::LoopEnd => live = heads[usize::from(slots[1])].clone(),
                    Code::LoopEndIf => live.join(&heads[usize::from(slots[1])]),
                    _ => {}
                }
            }
            Code::Else => {
                if let Some(frame) = frames.last_mut() {
                    frame.other = Some(std::mem::replace(&mut live, frame.end.clone()));
                }
            }
            Code::If => {
                if let Some(frame) = frames.pop() {
                    live.join(frame.other.as_ref().unwrap_or(&frame.end));
                }
            }
            Code::RegionBegin => drop(frames.pop()),
            Code::Continuing => {
                if let Some(frame) = frames.last_mut() {
                    frame.other = Some(live.clone());
                }
            }
            Code::LoopBegin => {
                heads[usize::from(slots[1])].join(&live);
                frames.pop();
            }
            Code::Exit => {
                if let Some(end) = left(&frames, slots[1]) {
                    live = end;
                }
            }
            Code::BreakIf | Code::BreakIfNot => {
                if let Some(end) = left(&frames, slots[1]) {
                    live.join(&end);
                }
            }
            Code::Continue => {
                let continued = frames.iter().rev().find(|frame| frame.slot == slots[0] && frame.code != Code::EndIf);
                if let Some(other) = continued.and_then(|frame| frame.other.clone()) {
                    live = other;
                }
            }
            _ => {}
        }
        // A result that nothing reads needs a register all the same.
        inst.dst.iter().filter_map(|&v| numbers.of(v)).for_each(|at| live.insert(at));
        most = most.max(live.count);
        inst.dst.iter().filter_map(|&v| numbers.of(v)).for_each(|at| live.remove(at));
        inst.src.iter().filter_map(|&v| numbers.of(v)).for_each(|at| live.insert(at));
        most = most.max(live.count);
    }
    most
}

#[cfg(test)]
mod tests {
    use crate::{Module, ModuleSource, Options, Stage, compile};

    /// The registers of a compute shader with this body.
    fn registers(body: &str) -> u32 {
        let source = format!(
            "@group(0) @binding(0) var<storage, read_write> o: array<f32>;
             @compute @workgroup_size(64) fn main(@builtin(global_invocation_id) id: vec3u) {{ let i = id.x; {body} }}"
        );
        let module = Module::new("test", ModuleSource::Wgsl(&source)).expect("valid");
        compile(&module, Stage::Compute, None, &Options::default()).expect("it compiles").interface().registers
    }

    /// `n` values that are made, go round a loop, and are summed up.
    fn values(n: usize, turns: &str) -> u32 {
        let each = |of: &dyn Fn(usize) -> String| (0..n).map(of).collect::<String>();
        registers(&format!(
            "{} for (var k = 0u; k < {turns}; k++) {{ {} }} o[i] = {};",
            each(&|k| format!("var x{k} = o[i + {k}u];")),
            each(&|k| format!("x{k} = x{k} * x{} + 1.5;", (k + 1) % n)),
            (0..n).map(|k| format!("x{k}")).collect::<Vec<_>>().join(" + "),
        ))
    }

    #[test]
    fn registers_are_values_that_live_at_once() {
        // Besides the values: the invocation's number, the counter, its bound, and the first of the values, which the last one needs.
        for (n, most) in [(8, 12), (32, 36)] {
            for turns in ["i", "40u"] {
                let used = values(n, turns);
                assert!((n as u32..=most).contains(&used), "{n} values, {turns} turns: {used}");
            }
        }
        // One after another, values share a register.
        let chain = (0..30).map(|k| format!("x = x * x + {k}.5;")).collect::<String>();
        assert!(registers(&format!("var x = o[i]; {chain} o[i] = x;")) <= 3);
    }

    #[test]
    fn branches_need_the_more_of_both() {
        let sum = |n: usize| (0..n).map(|k| format!("o[i + {k}u]")).collect::<Vec<_>>().join(" + ");
        let held = |n: usize| {
            let made = (0..n).map(|k| format!("let y{k} = o[i * {}u];", k + 2)).collect::<String>();
            let used = (0..n).map(|k| format!("y{k}")).collect::<Vec<_>>();
            format!("{made} x = ({}) * ({});", used.join(" + "), used.join(" - "))
        };
        let branch = |a: usize, b: usize| {
            registers(&format!("var x = {}; if (x > 1.0) {{ {} }} else {{ {} }} o[i] = x;", sum(2), held(a), held(b)))
        };
        assert_eq!(branch(4, 12), branch(12, 4));
        assert!((12..=16).contains(&branch(4, 12)), "{}", branch(4, 12));
        // What is needed after a loop is held through it; what a break leaves is not held by those that go on.
        let kept = registers(
            "let a = o[i]; let b = o[i + 1u]; var x = 0.0;
             loop { x += o[u32(x)]; if (x > 9.0) { x = x * b; break; } }
             o[i] = x + a;",
        );
        assert!((4..=7).contains(&kept), "{kept}");
    }
}
