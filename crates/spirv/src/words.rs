//! A module as a list of instructions, and what its types and constants are.

use std::collections::{HashMap, HashSet};

use grammar::{Op, StorageClass};

use crate::Refusal;

/// An instruction.
#[derive(Clone, Debug)]
pub struct Inst {
    /// The word of the module as it was given with which it begins, or with which the instruction that it stands for begins.
    pub at: u32,
    pub op: Op,
    pub operands: Vec<u32>,
}

impl Inst {
    /// An operand; 0, which is no id, where the instruction is too short.
    pub fn operand(&self, n: usize) -> u32 {
        self.operands.get(n).copied().unwrap_or(0)
    }

    /// The operands from this one on.
    pub fn from(&self, n: usize) -> &[u32] {
        self.operands.get(n..).unwrap_or_default()
    }

    /// A refusal of this instruction.
    pub fn refuse(&self, reason: impl Into<String>) -> Refusal {
        Refusal { word: self.at, instruction: format!("Op{:?}", self.op), reason: reason.into() }
    }

    /// The id that it defines.
    pub fn result(&self) -> Option<u32> {
        match result_at(self.op) {
            Some(at) => self.operands.get(at).copied(),
            None => None,
        }
    }
}

/// Which operand is the id that an instruction defines.
fn result_at(op: Op) -> Option<usize> {
    match op {
        Op::String | Op::ExtInstImport | Op::DecorationGroup | Op::Label => Some(0),
        _ if is_type(op) => Some(0),
        Op::Nop
        | Op::SourceContinued
        | Op::Source
        | Op::SourceExtension
        | Op::Name
        | Op::MemberName
        | Op::Line
        | Op::Extension
        | Op::MemoryModel
        | Op::EntryPoint
        | Op::ExecutionMode
        | Op::Capability
        | Op::TypeForwardPointer
        | Op::FunctionEnd
        | Op::Store
        | Op::CopyMemory
        | Op::CopyMemorySized
        | Op::Decorate
        | Op::MemberDecorate
        | Op::GroupDecorate
        | Op::GroupMemberDecorate
        | Op::ImageWrite
        | Op::EmitVertex
        | Op::EndPrimitive
        | Op::EmitStreamVertex
        | Op::EndStreamPrimitive
        | Op::ControlBarrier
        | Op::MemoryBarrier
        | Op::AtomicStore
        | Op::LoopMerge
        | Op::SelectionMerge
        | Op::Branch
        | Op::BranchConditional
        | Op::Switch
        | Op::Kill
        | Op::Return
        | Op::ReturnValue
        | Op::Unreachable
        | Op::LifetimeStart
        | Op::LifetimeStop
        | Op::NoLine
        | Op::ModuleProcessed
        | Op::ExecutionModeId
        | Op::DecorateId
        | Op::TerminateInvocation
        | Op::DemoteToHelperInvocation
        | Op::BeginInvocationInterlockEXT
        | Op::EndInvocationInterlockEXT
        | Op::DecorateString
        | Op::MemberDecorateString => None,
        _ => Some(1),
    }
}

/// Whether an instruction declares a type.
fn is_type(op: Op) -> bool {
    (Op::TypeVoid as u32..=Op::TypePipe as u32).contains(&(op as u32))
}

/// Whether instructions of this kind may stand in a module: those of shaders without extensions beyond those that are read.
fn is_known(op: Op) -> bool {
    let code = op as u32;
    code <= Op::NoLine as u32
        || (Op::SizeOf as u32..=Op::GroupNonUniformQuadSwap as u32).contains(&code)
        || matches!(
            op,
            Op::CopyLogical
                | Op::PtrEqual
                | Op::PtrNotEqual
                | Op::PtrDiff
                | Op::TerminateInvocation
                | Op::DemoteToHelperInvocation
                | Op::IsHelperInvocationEXT
                | Op::SubgroupBallotKHR
                | Op::SubgroupFirstInvocationKHR
                | Op::SubgroupAllKHR
                | Op::SubgroupAnyKHR
                | Op::SubgroupAllEqualKHR
                | Op::SubgroupReadInvocationKHR
                | Op::AtomicFAddEXT
                | Op::DecorateString
                | Op::MemberDecorateString
                | Op::BeginInvocationInterlockEXT
                | Op::EndInvocationInterlockEXT
        )
}

/// The instructions of a function that is being rewritten.
#[derive(Default)]
pub struct Code(pub Vec<Inst>);

impl Code {
    /// Writes an instruction that has a value, and gives its id.
    pub fn value(&mut self, parts: &mut Parts, at: u32, op: Op, ty: u32, operands: &[u32]) -> u32 {
        let id = parts.fresh();
        self.0.push(Inst { at, op, operands: [ty, id].iter().chain(operands).copied().collect() });
        id
    }
}

/// What a type is. Types that no rewriting looks at are [`Type::Other`].
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Type {
    Bool,
    Int { bits: u32, signed: bool },
    Float { bits: u32 },
    Vector { of: u32, count: u32 },
    Matrix { column: u32, count: u32 },
    Image { sampled: u32, dim: u32, depth: u32, arrayed: u32, multisampled: u32, usage: u32, format: u32 },
    Sampler,
    SampledImage { image: u32 },
    Array { of: u32, length: u32 },
    RuntimeArray { of: u32 },
    Struct { members: Vec<u32> },
    Pointer { class: u32, to: u32 },
    Other,
}

/// A decoration of an id or, with a number, of a member of a structure.
#[derive(Clone, Copy, Debug)]
pub struct Decoration {
    pub member: Option<u32>,
    pub kind: u32,
    /// The first operand; 0 where it has none.
    pub value: u32,
}

/// A module, taken apart.
#[derive(Clone, Debug)]
pub struct Parts {
    /// Magic number, version, generator, bound of ids, schema.
    header: [u32; 5],
    /// What comes before the functions.
    pub globals: Vec<Inst>,
    pub functions: Vec<Vec<Inst>>,
    /// The least number that is no id yet.
    next: u32,
    /// Types of numbers and vectors, and declarations that were asked for: instruction and operands, and the id.
    made: HashMap<(Op, Vec<u32>), u32>,
}

/// Numbers of ids below this are read. SPIR-V allows 4,194,303 everywhere.
const IDS: u32 = 1 << 22;

impl Parts {
    /// Takes a module apart.
    ///
    /// # Errors
    /// If the words are no module, or have an instruction that no shader of Vulkan has.
    pub fn new(words: &[u32]) -> Result<Parts, Refusal> {
        let whole = |word: usize, reason: &str| Refusal {
            word: word as u32,
            instruction: "the header".to_owned(),
            reason: reason.to_owned(),
        };
        let header: [u32; 5] = match words.get(..5).map(TryInto::try_into) {
            Some(Ok(header)) => header,
            _ => return Err(whole(0, "a module has at least 5 words")),
        };
        if header[0] != grammar::MAGIC_NUMBER {
            return Err(whole(0, "this is no SPIR-V: the magic number is wrong"));
        }
        if header[3] > IDS {
            return Err(whole(3, "ids up to a bound that SPIR-V does not allow"));
        }
        let mut globals = Vec::new();
        let mut functions: Vec<Vec<Inst>> = Vec::new();
        let mut defined = HashSet::new();
        let mut at = 5;
        while let Some(&word) = words.get(at) {
            let (count, code) = ((word >> 16) as usize, word & 0xffff);
            let refuse =
                |reason: &str| Refusal { word: at as u32, instruction: format!("opcode {code}"), reason: reason.to_owned() };
            let op = Op::from_u32(code).filter(|&op| is_known(op)).ok_or_else(|| refuse("the instruction is not supported"))?;
            let operands = match words.get(at + 1..at + count) {
                Some(operands) if count > 0 => operands.to_vec(),
                _ => return Err(refuse("the instruction ends behind the module")),
            };
            let inst = Inst { at: at as u32, op, operands };
            if result_at(op).is_some() {
                let id = inst.result().unwrap_or(0);
                if id == 0 || id >= header[3] {
                    return Err(inst.refuse("its result is no id below the bound"));
                }
                if !defined.insert(id) {
                    return Err(inst.refuse(format!("%{id} has two definitions")));
                }
            }
            if op == Op::Function {
                functions.push(Vec::new());
            }
            functions.last_mut().unwrap_or(&mut globals).push(inst);
            at += count;
        }
        let is_plain = |op: Op| matches!(op, Op::TypeVoid | Op::TypeBool | Op::TypeInt | Op::TypeFloat | Op::TypeVector);
        let plain = globals.iter().filter(|inst| is_plain(inst.op));
        let made = plain.map(|inst| ((inst.op, inst.from(1).to_vec()), inst.operand(0))).collect();
        Ok(Parts { header, globals, functions, next: header[3], made })
    }

    pub fn fresh(&mut self) -> u32 {
        self.next += 1;
        self.next - 1
    }

    /// Writes the words of the module, and where each instruction begins in them and began in the module as it was given.
    pub fn write(&self, words: &mut Vec<u32>, origins: &mut Vec<(u32, u32)>) -> Result<(), Refusal> {
        words.extend(self.header);
        words[3] = self.next;
        for inst in self.insts() {
            origins.push((words.len() as u32, inst.at));
            let count = u16::try_from(inst.operands.len() + 1).map_err(|_| inst.refuse("it has too many operands"))?;
            words.push(inst.op as u32 | (u32::from(count) << 16));
            words.extend_from_slice(&inst.operands);
        }
        Ok(())
    }

    /// All instructions.
    pub fn insts(&self) -> impl Iterator<Item = &Inst> {
        self.globals.iter().chain(self.functions.iter().flatten())
    }

    /// All instructions, to be changed.
    pub fn insts_mut(&mut self) -> impl Iterator<Item = &mut Inst> {
        self.globals.iter_mut().chain(self.functions.iter_mut().flatten())
    }

    /// What the types are.
    pub fn types(&self) -> HashMap<u32, Type> {
        self.globals.iter().filter_map(Parts::type_of).collect()
    }

    /// The id of a type and what it is, where an instruction declares one.
    pub fn type_of(inst: &Inst) -> Option<(u32, Type)> {
        is_type(inst.op).then(|| (inst.operand(0), type_of(inst)))
    }

    /// The type of each value.
    pub fn values(&self) -> HashMap<u32, u32> {
        let typed = self.insts().filter(|inst| result_at(inst.op) == Some(1));
        typed.map(|inst| (inst.operand(1), inst.operand(0))).collect()
    }

    /// The values of constants of at most 32 bits that are no specialization constants.
    pub fn constants(&self) -> HashMap<u32, u32> {
        let plain = self.globals.iter().filter(|inst| inst.op == Op::Constant && inst.operands.len() == 3);
        plain.map(|inst| (inst.operand(1), inst.operand(2))).collect()
    }

    /// The decorations of each id. Groups of decorations, which no compiler writes, are left alone.
    pub fn decorations(&self) -> HashMap<u32, Vec<Decoration>> {
        let mut all: HashMap<u32, Vec<Decoration>> = HashMap::new();
        for inst in &self.globals {
            let (id, member, rest) = match inst.op {
                Op::Decorate => (inst.operand(0), None, 1),
                Op::MemberDecorate => (inst.operand(0), Some(inst.operand(1)), 2),
                _ => continue,
            };
            let decoration = Decoration { member, kind: inst.operand(rest), value: inst.operand(rest + 1) };
            all.entry(id).or_default().push(decoration);
        }
        all
    }

    /// Where declarations of types begin.
    pub fn first_type(&self) -> usize {
        let is_declaration = |inst: &Inst| {
            is_type(inst.op)
                || inst.op == Op::TypeForwardPointer
                || matches!(result_at(inst.op), Some(1))
                || inst.op == Op::Line
        };
        self.globals.iter().position(is_declaration).unwrap_or(self.globals.len())
    }

    /// Declares something behind all declarations, and gives its id. `operands` come without it.
    fn declare(&mut self, op: Op, operands: &[u32]) -> u32 {
        let id = self.fresh();
        let at = self.globals.last().map_or(5, |inst| inst.at);
        let place = result_at(op).unwrap_or(0).min(operands.len());
        let mut all = operands.to_vec();
        all.insert(place, id);
        self.globals.push(Inst { at, op, operands: all });
        id
    }

    /// The id of a declaration without decorations, which is added behind all others where it is none of a number or vector that the module
    /// has.
    pub fn declared(&mut self, op: Op, operands: &[u32]) -> u32 {
        if let Some(&id) = self.made.get(&(op, operands.to_vec())) {
            return id;
        }
        let id = self.declare(op, operands);
        self.made.insert((op, operands.to_vec()), id);
        id
    }

    /// A type that is made of no others, before all other types.
    pub fn hoist(&mut self, op: Op, operands: &[u32]) -> u32 {
        let own = self.globals.iter().position(|inst| inst.op == op && inst.from(1) == operands);
        let at = self.first_type();
        match own {
            Some(own) => {
                let declared = self.globals.remove(own);
                let id = declared.operand(0);
                self.globals.insert(at.min(own), declared);
                id
            }
            None => {
                let id = self.fresh();
                let word = self.globals.get(at).map_or(5, |inst| inst.at);
                self.made.insert((op, operands.to_vec()), id);
                let operands = std::iter::once(id).chain(operands.iter().copied()).collect();
                self.globals.insert(at, Inst { at: word, op, operands });
                id
            }
        }
    }

    pub fn int_type(&mut self, signed: bool) -> u32 {
        self.declared(Op::TypeInt, &[32, signed.into()])
    }

    pub fn float_type(&mut self) -> u32 {
        self.declared(Op::TypeFloat, &[32])
    }

    pub fn vector_type(&mut self, of: u32, count: u32) -> u32 {
        self.declared(Op::TypeVector, &[of, count])
    }

    pub fn pointer_type(&mut self, class: StorageClass, to: u32) -> u32 {
        self.declared(Op::TypePointer, &[class as u32, to])
    }

    /// A constant of 32 bits.
    pub fn constant(&mut self, ty: u32, value: u32) -> u32 {
        self.declared(Op::Constant, &[ty, value])
    }
}

fn type_of(inst: &Inst) -> Type {
    let (a, b) = (inst.operand(1), inst.operand(2));
    match inst.op {
        Op::TypeBool => Type::Bool,
        Op::TypeInt => Type::Int { bits: a, signed: b != 0 },
        Op::TypeFloat => Type::Float { bits: a },
        Op::TypeVector => Type::Vector { of: a, count: b },
        Op::TypeMatrix => Type::Matrix { column: a, count: b },
        Op::TypeImage => Type::Image {
            sampled: a,
            dim: b,
            depth: inst.operand(3),
            arrayed: inst.operand(4),
            multisampled: inst.operand(5),
            usage: inst.operand(6),
            format: inst.operand(7),
        },
        Op::TypeSampler => Type::Sampler,
        Op::TypeSampledImage => Type::SampledImage { image: a },
        Op::TypeArray => Type::Array { of: a, length: b },
        Op::TypeRuntimeArray => Type::RuntimeArray { of: a },
        Op::TypeStruct => Type::Struct { members: inst.from(1).to_vec() },
        Op::TypePointer => Type::Pointer { class: a, to: b },
        _ => Type::Other,
    }
}

/// The text that begins with these words, and the number of words that it takes.
pub fn text(words: &[u32]) -> Option<(String, usize)> {
    let mut bytes = Vec::new();
    for (n, word) in words.iter().enumerate() {
        for byte in word.to_le_bytes() {
            if byte == 0 {
                return Some((String::from_utf8_lossy(&bytes).into_owned(), n + 1));
            }
            bytes.push(byte);
        }
    }
    None
}

/// The set of GLSL's instructions.
pub fn glsl(parts: &mut Parts) -> u32 {
    let is_glsl =
        |inst: &&Inst| inst.op == Op::ExtInstImport && text(inst.from(1)).is_some_and(|(name, _)| name == "GLSL.std.450");
    if let Some(import) = parts.globals.iter().find(is_glsl) {
        return import.operand(0);
    }
    let id = parts.fresh();
    let at = parts.globals.iter().position(|inst| inst.op == Op::MemoryModel).unwrap_or(0);
    let name = *b"GLSL.std.450\0\0\0\0";
    let words = name.chunks_exact(4).map(|word| u32::from_le_bytes([word[0], word[1], word[2], word[3]]));
    let operands = std::iter::once(id).chain(words).collect();
    parts.globals.insert(at, Inst { at: 5, op: Op::ExtInstImport, operands });
    id
}
