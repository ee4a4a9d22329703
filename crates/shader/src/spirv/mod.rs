//! SPIR-V modules, rewritten where naga's front end would read them otherwise than the specification says.
//!
//! naga 30 makes wrong programs of some valid modules without a word (docs/upstream.md). So a module is taken apart into its
//! instructions, what naga gets wrong is replaced by what means the same and naga gets right, and what cannot be replaced is refused.
//! [`operations`] does so for single instructions, [`switches`] for control flow, of which [`flow`] has the structure.

mod flow;
mod operations;
mod switches;

use std::collections::HashMap;

use super::extent;

/// Why a module is refused: the word of the instruction, and the reason.
pub(super) type Refusal = (u32, String);

/// Codes of instructions.
mod op {
    pub const UNDEF: u32 = 1;
    pub const EXT_INST_IMPORT: u32 = 11;
    pub const EXT_INST: u32 = 12;
    pub const TYPE_BOOL: u32 = 20;
    pub const TYPE_INT: u32 = 21;
    pub const TYPE_VECTOR: u32 = 23;
    pub const TYPE_POINTER: u32 = 32;
    pub const CONSTANT_TRUE: u32 = 41;
    pub const CONSTANT: u32 = 43;
    pub const CONSTANT_COMPOSITE: u32 = 44;
    pub const SPEC_CONSTANT_OP: u32 = 52;
    pub const FUNCTION: u32 = 54;
    pub const FUNCTION_END: u32 = 56;
    pub const VARIABLE: u32 = 59;
    pub const LOAD: u32 = 61;
    pub const STORE: u32 = 62;
    pub const CONVERT_F_TO_U: u32 = 109;
    pub const CONVERT_F_TO_S: u32 = 110;
    pub const CONVERT_S_TO_F: u32 = 111;
    pub const CONVERT_U_TO_F: u32 = 112;
    pub const BITCAST: u32 = 124;
    pub const S_NEGATE: u32 = 126;
    pub const I_ADD: u32 = 128;
    pub const U_DIV: u32 = 134;
    pub const S_DIV: u32 = 135;
    pub const U_MOD: u32 = 137;
    pub const S_REM: u32 = 138;
    pub const S_MOD: u32 = 139;
    pub const LOGICAL_OR: u32 = 166;
    pub const LOGICAL_AND: u32 = 167;
    pub const LOGICAL_NOT: u32 = 168;
    pub const I_EQUAL: u32 = 170;
    pub const F_UNORD_EQUAL: u32 = 181;
    pub const F_ORD_NOT_EQUAL: u32 = 182;
    pub const F_ORD_LESS_THAN: u32 = 184;
    pub const F_UNORD_LESS_THAN: u32 = 185;
    pub const F_ORD_GREATER_THAN: u32 = 186;
    pub const F_UNORD_GREATER_THAN: u32 = 187;
    pub const F_ORD_LESS_THAN_EQUAL: u32 = 188;
    pub const F_UNORD_LESS_THAN_EQUAL: u32 = 189;
    pub const F_ORD_GREATER_THAN_EQUAL: u32 = 190;
    pub const F_UNORD_GREATER_THAN_EQUAL: u32 = 191;
    pub const SHIFT_RIGHT_LOGICAL: u32 = 194;
    pub const SHIFT_RIGHT_ARITHMETIC: u32 = 195;
    pub const SHIFT_LEFT_LOGICAL: u32 = 196;
    pub const BITWISE_OR: u32 = 197;
    pub const BITWISE_XOR: u32 = 198;
    pub const BITWISE_AND: u32 = 199;
    pub const BIT_FIELD_INSERT: u32 = 201;
    pub const BIT_FIELD_S_EXTRACT: u32 = 202;
    pub const BIT_FIELD_U_EXTRACT: u32 = 203;
    pub const BIT_REVERSE: u32 = 204;
    pub const BIT_COUNT: u32 = 205;
    pub const ATOMIC_S_MIN: u32 = 236;
    pub const ATOMIC_U_MIN: u32 = 237;
    pub const ATOMIC_S_MAX: u32 = 238;
    pub const ATOMIC_U_MAX: u32 = 239;
    pub const PHI: u32 = 245;
    pub const LOOP_MERGE: u32 = 246;
    pub const SELECTION_MERGE: u32 = 247;
    pub const LABEL: u32 = 248;
    pub const BRANCH: u32 = 249;
    pub const BRANCH_CONDITIONAL: u32 = 250;
    pub const SWITCH: u32 = 251;
    pub const UNREACHABLE: u32 = 255;
    pub const GROUP_S_MIN: u32 = 353;
    pub const GROUP_U_MIN: u32 = 354;
    pub const GROUP_S_MAX: u32 = 356;
    pub const GROUP_U_MAX: u32 = 357;
}

/// An instruction.
#[derive(Clone, Debug)]
struct Inst {
    /// The word of the module as it was given with which it begins, or with which the instruction that it stands for begins.
    at: u32,
    code: u32,
    operands: Vec<u32>,
}

impl Inst {
    /// An operand; 0, which is no id, where the instruction is too short.
    fn operand(&self, n: usize) -> u32 {
        self.operands.get(n).copied().unwrap_or(0)
    }
}

/// The type of whole numbers or of vectors of them.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
struct Whole {
    bits: u32,
    signed: bool,
    /// Components; 1: a scalar.
    components: u32,
}

/// A module, taken apart.
struct Parts {
    /// Magic number, version, generator, bound of ids, schema.
    header: [u32; 5],
    /// What comes before the functions.
    globals: Vec<Inst>,
    functions: Vec<Vec<Inst>>,
    /// What the ids that are types of whole numbers stand for, and the other way.
    wholes: HashMap<u32, Whole>,
    whole_ids: HashMap<Whole, u32>,
    /// Types of pointers into functions, by what they point to.
    pointers: HashMap<u32, u32>,
    /// Constants by type and value.
    constants: HashMap<(u32, u32), u32>,
    bool_type: Option<u32>,
    /// The type of each value.
    types: HashMap<u32, u32>,
    /// The least number that is no id yet.
    next: u32,
    changed: bool,
}

/// Numbers of ids below this are fine. SPIR-V allows 4,194,303 everywhere.
const IDS: u32 = 1 << 30;

impl Parts {
    /// None where the words are not instructions from the first to the last: naga says why.
    fn new(words: &[u32]) -> Option<Parts> {
        let header: [u32; 5] = words.get(..5)?.try_into().ok()?;
        let mut globals = Vec::new();
        let mut functions: Vec<Vec<Inst>> = Vec::new();
        let mut end = 5;
        for (at, code) in extent::instructions(words) {
            end = at + (words[at] >> 16) as usize;
            let inst = Inst { at: at as u32, code, operands: words.get(at + 1..end)?.to_vec() };
            if code == op::FUNCTION {
                functions.push(Vec::new());
            }
            functions.last_mut().unwrap_or(&mut globals).push(inst);
        }
        let mut parts = Parts {
            header,
            globals,
            functions,
            wholes: HashMap::new(),
            whole_ids: HashMap::new(),
            pointers: HashMap::new(),
            constants: HashMap::new(),
            bool_type: None,
            types: HashMap::new(),
            next: header[3],
            changed: false,
        };
        parts.learn();
        (end == words.len()).then_some(parts)
    }

    /// Finds types and constants, and the type of each value.
    fn learn(&mut self) {
        /// A storage class.
        const IN_FUNCTION: u32 = 7;
        let mut all_types = std::collections::HashSet::new();
        for inst in &self.globals {
            let (first, second, third) = (inst.operand(0), inst.operand(1), inst.operand(2));
            match inst.code {
                op::TYPE_BOOL => self.bool_type = Some(first),
                op::TYPE_INT => {
                    let whole = Whole { bits: second, signed: third != 0, components: 1 };
                    self.wholes.insert(first, whole);
                    self.whole_ids.entry(whole).or_insert(first);
                }
                op::TYPE_VECTOR => {
                    if let Some(&scalar) = self.wholes.get(&second) {
                        let whole = Whole { components: third, ..scalar };
                        self.wholes.insert(first, whole);
                        self.whole_ids.entry(whole).or_insert(first);
                    }
                }
                op::TYPE_POINTER if second == IN_FUNCTION => {
                    self.pointers.entry(third).or_insert(first);
                }
                op::CONSTANT if inst.operands.len() == 3 => {
                    self.constants.entry((first, third)).or_insert(second);
                }
                _ => {}
            }
            // All codes of types, from `OpTypeVoid` to `OpTypePipe`, have their own number first.
            if (19..=38).contains(&inst.code) {
                all_types.insert(first);
            }
            if (op::CONSTANT_TRUE..=op::SPEC_CONSTANT_OP).contains(&inst.code) || matches!(inst.code, op::VARIABLE | op::UNDEF)
            {
                self.types.insert(second, first);
            }
        }
        // Instructions of functions that begin with a type have a value of that type, whose number comes next.
        let mut labels = 0;
        for inst in self.functions.iter().flatten() {
            if inst.code == op::LABEL {
                labels = labels.max(inst.operand(0));
            }
            if all_types.contains(&inst.operand(0)) {
                self.types.insert(inst.operand(1), inst.operand(0));
            }
        }
        // The bound in the header is for naga's readers to check, and naga does not.
        let used = all_types.iter().chain(self.types.keys()).copied().max().unwrap_or(0).max(labels);
        self.next = self.next.max(used.saturating_add(1));
    }

    fn fresh(&mut self) -> u32 {
        self.next += 1;
        self.next - 1
    }

    /// Declares something before the functions.
    fn declare(&mut self, code: u32, operands: Vec<u32>) {
        let at = self.globals.last().map_or(5, |inst| inst.at);
        self.globals.push(Inst { at, code, operands });
    }

    fn whole(&mut self, whole: Whole) -> u32 {
        if let Some(&id) = self.whole_ids.get(&whole) {
            return id;
        }
        let scalar = (whole.components > 1).then(|| self.whole(Whole { components: 1, ..whole }));
        let id = self.fresh();
        match scalar {
            Some(scalar) => self.declare(op::TYPE_VECTOR, vec![id, scalar, whole.components]),
            None => self.declare(op::TYPE_INT, vec![id, whole.bits, whole.signed.into()]),
        }
        self.wholes.insert(id, whole);
        self.whole_ids.insert(whole, id);
        id
    }

    fn boolean(&mut self) -> u32 {
        if let Some(id) = self.bool_type {
            return id;
        }
        let id = self.fresh();
        self.declare(op::TYPE_BOOL, vec![id]);
        self.bool_type = Some(id);
        id
    }

    /// The type of pointers to variables of functions.
    fn pointer(&mut self, to: u32) -> u32 {
        if let Some(&id) = self.pointers.get(&to) {
            return id;
        }
        let id = self.fresh();
        self.declare(op::TYPE_POINTER, vec![id, 7, to]);
        self.pointers.insert(to, id);
        id
    }

    /// A constant of 32 bits, in all components.
    fn constant(&mut self, ty: u32, value: u32) -> u32 {
        if let Some(&id) = self.constants.get(&(ty, value)) {
            return id;
        }
        let whole = self.wholes.get(&ty).copied().filter(|whole| whole.components > 1);
        let id = match whole {
            Some(whole) => {
                let scalar = self.whole(Whole { components: 1, ..whole });
                let component = self.constant(scalar, value);
                let id = self.fresh();
                let components = std::iter::repeat_n(component, whole.components as usize);
                self.declare(op::CONSTANT_COMPOSITE, [ty, id].into_iter().chain(components).collect());
                id
            }
            None => {
                let id = self.fresh();
                self.declare(op::CONSTANT, vec![ty, id, value]);
                id
            }
        };
        self.constants.insert((ty, value), id);
        id
    }

    fn words(&self) -> Mended {
        let mut mended = Mended { words: self.header.to_vec(), origins: Vec::new() };
        mended.words[3] = self.next;
        for inst in self.globals.iter().chain(self.functions.iter().flatten()) {
            mended.origins.push((mended.words.len() as u32, inst.at));
            mended.words.push(inst.code | ((inst.operands.len() as u32 + 1) << 16));
            mended.words.extend_from_slice(&inst.operands);
        }
        mended
    }
}

/// A module that was rewritten.
#[derive(Clone, Debug)]
pub(super) struct Mended {
    pub words: Vec<u32>,
    /// Where each instruction begins, here and in the module as it was given.
    pub origins: Vec<(u32, u32)>,
}

/// Rewrites a module; none where nothing has to be changed.
///
/// # Errors
/// If naga would make another program of it, and nothing here can change that.
pub(super) fn mend(words: &[u32]) -> Result<Option<Mended>, Refusal> {
    let Some(mut parts) = Parts::new(words) else { return Ok(None) };
    if parts.next > IDS {
        return Err((3, format!("ids up to {}, which is more than SPIR-V allows", parts.next - 1)));
    }
    operations::mend(&mut parts)?;
    switches::mend(&mut parts)?;
    Ok(parts.changed.then(|| parts.words()))
}
