//! Instructions on whole numbers whose meaning the code says, where naga takes it from the types of the operands; and comparisons of
//! floating-point numbers that hold for a NaN.
//!
//! SPIR-V has `OpSDiv` and `OpUDiv` for one type of words, and types with a sign are only a hint. naga has one operator and takes the sign
//! of the type. So `OpBitcast` stands around each such instruction whose types are of the other kind.

use super::{Inst, Parts, Refusal, Whole, op};

/// Which sign a type must have.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Sign {
    Signed,
    Unsigned,
    /// That of the result's type.
    OfResult,
}

/// What naga needs of an instruction, for it to mean what its code says.
struct Need {
    /// Operands, by number, and their signs.
    operands: std::ops::Range<usize>,
    sign: Sign,
    /// The sign of the result; none: any, as the operands need not agree with it.
    result: Option<Sign>,
}

/// The numbers of instructions in `GLSL.std.450`.
mod glsl {
    pub const S_ABS: u32 = 5;
    pub const S_SIGN: u32 = 7;
    pub const U_MIN: u32 = 38;
    pub const S_MIN: u32 = 39;
    pub const U_MAX: u32 = 41;
    pub const S_MAX: u32 = 42;
    pub const U_CLAMP: u32 = 44;
    pub const S_CLAMP: u32 = 45;
    pub const LDEXP: u32 = 53;
    pub const PACK_SNORM_4X8: u32 = 54;
    pub const PACK_HALF_2X16: u32 = 58;
    pub const UNPACK_SNORM_2X16: u32 = 60;
    pub const UNPACK_UNORM_4X8: u32 = 64;
    pub const FIND_I_LSB: u32 = 73;
    pub const FIND_S_MSB: u32 = 74;
    pub const FIND_U_MSB: u32 = 75;
}

fn need(inst: &Inst, glsl_set: Option<u32>) -> Option<Need> {
    use Sign::{OfResult, Signed, Unsigned};
    let all = |operands, sign| Some(Need { operands, sign, result: Some(sign) });
    match inst.code {
        op::S_NEGATE => all(2..3, Signed),
        op::S_DIV | op::S_REM | op::S_MOD => all(2..4, Signed),
        op::U_DIV | op::U_MOD => all(2..4, Unsigned),
        // What they shift by may have either sign.
        op::SHIFT_RIGHT_ARITHMETIC => all(2..3, Signed),
        op::SHIFT_RIGHT_LOGICAL => all(2..3, Unsigned),
        op::SHIFT_LEFT_LOGICAL | op::BIT_COUNT | op::BIT_REVERSE => all(2..3, OfResult),
        op::BIT_FIELD_INSERT => all(2..4, OfResult),
        op::BIT_FIELD_S_EXTRACT => all(2..3, Signed),
        op::BIT_FIELD_U_EXTRACT => all(2..3, Unsigned),
        op::CONVERT_S_TO_F => Some(Need { operands: 2..3, sign: Signed, result: None }),
        op::CONVERT_U_TO_F => Some(Need { operands: 2..3, sign: Unsigned, result: None }),
        op::CONVERT_F_TO_S => Some(Need { operands: 0..0, sign: Signed, result: Some(Signed) }),
        op::CONVERT_F_TO_U => Some(Need { operands: 0..0, sign: Unsigned, result: Some(Unsigned) }),
        op::GROUP_S_MIN | op::GROUP_S_MAX => all(4..5, Signed),
        op::GROUP_U_MIN | op::GROUP_U_MAX => all(4..5, Unsigned),
        op::EXT_INST if Some(inst.operand(2)) == glsl_set => match inst.operand(3) {
            glsl::S_ABS | glsl::S_SIGN | glsl::FIND_S_MSB => all(4..5, Signed),
            glsl::FIND_U_MSB => all(4..5, Unsigned),
            glsl::FIND_I_LSB => all(4..5, OfResult),
            glsl::S_MIN | glsl::S_MAX => all(4..6, Signed),
            glsl::U_MIN | glsl::U_MAX => all(4..6, Unsigned),
            glsl::S_CLAMP => all(4..7, Signed),
            glsl::U_CLAMP => all(4..7, Unsigned),
            glsl::LDEXP => Some(Need { operands: 5..6, sign: Signed, result: None }),
            glsl::PACK_SNORM_4X8..=glsl::PACK_HALF_2X16 => {
                Some(Need { operands: 0..0, sign: Unsigned, result: Some(Unsigned) })
            }
            glsl::UNPACK_SNORM_2X16..=glsl::UNPACK_UNORM_4X8 => Some(Need { operands: 4..5, sign: Unsigned, result: None }),
            _ => None,
        },
        _ => None,
    }
}

/// Instructions that are being written.
struct Writer<'p> {
    parts: &'p mut Parts,
    out: Vec<Inst>,
}

impl Writer<'_> {
    /// Writes an instruction with a value, whose number it gives.
    fn value(&mut self, at: u32, code: u32, ty: u32, operands: &[u32]) -> u32 {
        let id = self.parts.fresh();
        self.result(at, code, ty, id, operands);
        id
    }

    fn result(&mut self, at: u32, code: u32, ty: u32, id: u32, operands: &[u32]) {
        self.out.push(Inst { at, code, operands: [ty, id].iter().chain(operands).copied().collect() });
        self.parts.types.insert(id, ty);
    }

    /// A type of whole numbers with the other sign, if it has not this one.
    fn other(&mut self, ty: u32, signed: bool) -> Option<u32> {
        let whole = self.parts.wholes.get(&ty).copied().filter(|whole| whole.signed != signed)?;
        Some(self.parts.whole(Whole { signed, ..whole }))
    }

    fn instruction(&mut self, mut inst: Inst, glsl_set: Option<u32>) -> Result<(), Refusal> {
        let result = inst.operand(0);
        if matches!(inst.code, op::ATOMIC_S_MIN | op::ATOMIC_U_MIN | op::ATOMIC_S_MAX | op::ATOMIC_U_MAX) {
            let signed = matches!(inst.code, op::ATOMIC_S_MIN | op::ATOMIC_S_MAX);
            if self.other(result, signed).is_some() {
                let (of, on) = if signed { ("signed", "an unsigned") } else { ("unsigned", "a signed") };
                let message = format!(
                    "an atomic minimum or maximum of {of} numbers on {on} type, which is not supported: the variable's type must be \
                     declared {of}"
                );
                return Err((inst.at, message));
            }
        }
        let before = self.out.len();
        let Some(need) = need(&inst, glsl_set) else { return self.comparison(inst) };
        let result_signed = self.parts.wholes.get(&result).is_some_and(|whole| whole.signed);
        let is_signed = |sign| match sign {
            Sign::Signed => true,
            Sign::Unsigned => false,
            Sign::OfResult => result_signed,
        };
        for n in need.operands {
            let Some(&value) = inst.operands.get(n) else { break };
            let Some(&ty) = self.parts.types.get(&value) else { continue };
            if let Some(other) = self.other(ty, is_signed(need.sign)) {
                inst.operands[n] = self.value(inst.at, op::BITCAST, other, &[value]);
            }
        }
        let back = need.result.and_then(|sign| self.other(result, is_signed(sign)));
        let (at, id) = (inst.at, inst.operand(1));
        if let Some(other) = back {
            inst.operands[0] = other;
            inst.operands[1] = self.parts.fresh();
        }
        let computed = inst.operand(1);
        if inst.code == op::S_MOD && inst.operands.len() == 4 {
            self.modulo(&inst);
        } else {
            self.out.push(inst);
        }
        if back.is_some() {
            self.result(at, op::BITCAST, result, id, &[computed]);
        }
        self.parts.changed |= self.out.len() > before + 1;
        Ok(())
    }

    /// `OpSMod` of signed types: naga divides as floating-point numbers, which have 24 bits, and in vectors not at all. The remainder has
    /// the sign of the dividend; where it is not zero and the divisor has the other sign, the divisor is added.
    fn modulo(&mut self, inst: &Inst) {
        let (at, ty, id, x, y) = (inst.at, inst.operand(0), inst.operand(1), inst.operand(2), inst.operand(3));
        let rest = self.value(at, op::S_REM, ty, &[x, y]);
        let differ = self.value(at, op::BITWISE_XOR, ty, &[rest, y]);
        let negative = self.value(at, op::S_NEGATE, ty, &[rest]);
        let is_some = self.value(at, op::BITWISE_OR, ty, &[rest, negative]);
        let both = self.value(at, op::BITWISE_AND, ty, &[differ, is_some]);
        let unsigned = self.parts.wholes.get(&ty).map(|whole| Whole { signed: false, ..*whole });
        let unsigned = unsigned.map_or(ty, |whole| self.parts.whole(whole));
        let by = self.parts.constant(unsigned, 31);
        let mask = self.value(at, op::SHIFT_RIGHT_ARITHMETIC, ty, &[both, by]);
        let added = self.value(at, op::BITWISE_AND, ty, &[mask, y]);
        self.result(at, op::I_ADD, ty, id, &[rest, added]);
    }

    /// The code of an operation on booleans of this type: naga has the logical ones for single booleans, and takes those on bits for vectors.
    fn logical(&self, code: u32, ty: u32) -> u32 {
        match code {
            _ if self.parts.bool_type == Some(ty) => code,
            op::LOGICAL_AND => op::BITWISE_AND,
            _ => op::BITWISE_OR,
        }
    }

    /// Comparisons that naga takes for those that differ for a NaN, and logical operations.
    fn comparison(&mut self, inst: Inst) -> Result<(), Refusal> {
        let opposite = match inst.code {
            op::F_UNORD_LESS_THAN => op::F_ORD_GREATER_THAN_EQUAL,
            op::F_UNORD_GREATER_THAN => op::F_ORD_LESS_THAN_EQUAL,
            op::F_UNORD_LESS_THAN_EQUAL => op::F_ORD_GREATER_THAN,
            op::F_UNORD_GREATER_THAN_EQUAL => op::F_ORD_LESS_THAN,
            op::F_UNORD_EQUAL | op::F_ORD_NOT_EQUAL => op::LOGICAL_OR,
            op::LOGICAL_OR | op::LOGICAL_AND => {
                let code = self.logical(inst.code, inst.operand(0));
                self.parts.changed |= code != inst.code;
                self.out.push(Inst { code, ..inst });
                return Ok(());
            }
            _ => {
                self.out.push(inst);
                return Ok(());
            }
        };
        let (at, ty, id, operands) = (inst.at, inst.operand(0), inst.operand(1), &inst.operands[2.min(inst.operands.len())..]);
        self.parts.changed = true;
        if opposite != op::LOGICAL_OR {
            let not = self.value(at, opposite, ty, operands);
            self.result(at, op::LOGICAL_NOT, ty, id, &[not]);
            return Ok(());
        }
        let less = self.value(at, op::F_ORD_LESS_THAN, ty, operands);
        let greater = self.value(at, op::F_ORD_GREATER_THAN, ty, operands);
        let or = self.logical(op::LOGICAL_OR, ty);
        if inst.code == op::F_ORD_NOT_EQUAL {
            self.result(at, or, ty, id, &[less, greater]);
        } else {
            let differ = self.value(at, or, ty, &[less, greater]);
            self.result(at, op::LOGICAL_NOT, ty, id, &[differ]);
        }
        Ok(())
    }
}

/// Rewrites the instructions that naga would take for others.
///
/// # Errors
/// If one cannot be rewritten.
pub(super) fn mend(parts: &mut Parts) -> Result<(), Refusal> {
    let name = |inst: &&Inst| {
        let bytes: Vec<u8> = inst.operands[1.min(inst.operands.len())..].iter().flat_map(|word| word.to_le_bytes()).collect();
        bytes.split(|&byte| byte == 0).next() == Some(b"GLSL.std.450")
    };
    let imports = parts.globals.iter().filter(|inst| inst.code == op::EXT_INST_IMPORT);
    let glsl_set = imports.filter(name).map(|inst| inst.operand(0)).next_back();
    for function in std::mem::take(&mut parts.functions) {
        let mut writer = Writer { out: Vec::with_capacity(function.len()), parts };
        for inst in function {
            writer.instruction(inst, glsl_set)?;
        }
        let out = writer.out;
        parts.functions.push(out);
    }
    Ok(())
}
