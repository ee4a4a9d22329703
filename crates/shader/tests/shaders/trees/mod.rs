//! Random programs as trees, written as SPIR-V and as WGSL, and run by a third way, which is the tree itself.
//!
//! The trees have what SPIR-V has and WGSL has not: cases that fall into the next one, under a condition or without one; branches out
//! of a switch to the end of the loop around; operations on numbers with a sign that have types without one, and the reverse. Every end of a
//! construct has an `OpPhi` that tells by which branch it was reached.

pub mod spirv;
mod suite;
mod wgsl;

use num::Random;

pub use suite::{run, run_words};

/// Variables. Those with an odd number have a signed type, and the first is a hash of the branches that were taken.
pub const VARIABLES: usize = 5;

/// Operations of one operand.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Unary {
    Negate,
    Not,
    SignedAbs,
    SignedSign,
    SignedHighest,
    UnsignedHighest,
    Lowest,
    Count,
    Reverse,
    /// Bits 3 to 10.
    SignedBits,
    UnsignedBits,
    /// To a floating-point number, whose bits are the result.
    SignedToFloat,
    UnsignedToFloat,
    /// From the floating-point number that bits 0 to 15 are.
    FloatToSigned,
    FloatToUnsigned,
}

const UNARIES: [Unary; 15] = [
    Unary::Negate,
    Unary::Not,
    Unary::SignedAbs,
    Unary::SignedSign,
    Unary::SignedHighest,
    Unary::UnsignedHighest,
    Unary::Lowest,
    Unary::Count,
    Unary::Reverse,
    Unary::SignedBits,
    Unary::UnsignedBits,
    Unary::SignedToFloat,
    Unary::UnsignedToFloat,
    Unary::FloatToSigned,
    Unary::FloatToUnsigned,
];

/// Operations of two operands. Divisors are not zero, shifts are less than 32, and quotients fit.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Binary {
    Add,
    Subtract,
    Multiply,
    And,
    Or,
    Xor,
    SignedDivide,
    SignedRemainder,
    SignedModulo,
    UnsignedDivide,
    UnsignedModulo,
    ShiftLeft,
    SignedShiftRight,
    UnsignedShiftRight,
    SignedMin,
    SignedMax,
    UnsignedMin,
    UnsignedMax,
    /// Comparisons give 1 or 0.
    SignedLess,
    UnsignedLess,
    Equal,
}

const BINARIES: [Binary; 21] = [
    Binary::Add,
    Binary::Subtract,
    Binary::Multiply,
    Binary::And,
    Binary::Or,
    Binary::Xor,
    Binary::SignedDivide,
    Binary::SignedRemainder,
    Binary::SignedModulo,
    Binary::UnsignedDivide,
    Binary::UnsignedModulo,
    Binary::ShiftLeft,
    Binary::SignedShiftRight,
    Binary::UnsignedShiftRight,
    Binary::SignedMin,
    Binary::SignedMax,
    Binary::UnsignedMin,
    Binary::UnsignedMax,
    Binary::SignedLess,
    Binary::UnsignedLess,
    Binary::Equal,
];

/// A value of 32 bits. The flags say whether SPIR-V's type of it is signed.
#[derive(Clone, Debug)]
pub enum Expression {
    Constant(u32, bool),
    /// The input of the invocation.
    Input,
    Variable(usize),
    Unary(Unary, bool, Box<Expression>),
    Binary(Binary, bool, Box<Expression>, Box<Expression>),
}

/// How a block is left.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Exit {
    Switch,
    Loop,
    Continue,
    Return,
    /// Into the next case.
    Fall,
}

#[derive(Clone, Debug)]
pub enum Statement {
    Set(usize, Expression),
    /// Where the condition is odd. Numbers: tags of the ends of the two blocks.
    If(Expression, Vec<Statement>, Vec<Statement>, [u32; 2]),
    Loop(Loop),
    Switch(Switch),
    /// An exit where the condition is odd, or in any case; its tag. A bare one is a branch without a selection around it.
    Exit(Option<(Expression, bool)>, Exit, u32),
}

/// A loop of some turns.
#[derive(Clone, Debug)]
pub struct Loop {
    pub turns: u32,
    /// Whether the condition stands at the end.
    pub last: bool,
    pub body: Vec<Statement>,
    /// Tags of its end by the condition, and of the end of a turn.
    pub tags: [u32; 2],
}

#[derive(Clone, Debug)]
pub struct Switch {
    /// Taken modulo 6.
    pub selector: Expression,
    pub cases: Vec<Case>,
    /// The tag of no case, where there is no default.
    pub tag: u32,
}

#[derive(Clone, Debug)]
pub struct Case {
    pub values: Vec<u32>,
    pub default: bool,
    pub body: Vec<Statement>,
    /// The tag of the end of its body, which leaves the switch or falls into the next case.
    pub tag: u32,
    pub falls: bool,
}

/// What may be left from where a statement stands.
#[derive(Clone, Copy, Default)]
struct Around {
    inside_loop: bool,
    inside_switch: bool,
    may_fall: bool,
}

/// Makes programs.
pub struct Maker {
    random: Random,
    tags: u32,
    statements: u32,
}

impl Maker {
    fn below(&mut self, n: u32) -> u32 {
        self.random.below(n)
    }

    fn tag(&mut self) -> u32 {
        self.tags += 1;
        self.tags
    }

    fn expression(&mut self, depth: u32) -> Expression {
        let signed = self.below(2) == 0;
        match self.below(if depth == 0 { 3 } else { 8 }) {
            0 => {
                let bits = [self.below(9), self.random.bits(), 0x8000_0000, u32::MAX][self.below(4) as usize];
                Expression::Constant(bits, signed)
            }
            1 => Expression::Input,
            2 => Expression::Variable(self.below(VARIABLES as u32) as usize),
            3 | 4 => {
                let operation = UNARIES[self.below(UNARIES.len() as u32) as usize];
                Expression::Unary(operation, signed, Box::new(self.expression(depth - 1)))
            }
            _ => {
                let operation = BINARIES[self.below(BINARIES.len() as u32) as usize];
                let (mut a, mut b) = (self.expression(depth - 1), self.expression(depth - 1));
                let with = |operation, e, constant| {
                    Expression::Binary(operation, signed, Box::new(e), Box::new(Expression::Constant(constant, signed)))
                };
                match operation {
                    Binary::SignedDivide | Binary::SignedRemainder | Binary::SignedModulo => {
                        a = with(Binary::SignedShiftRight, a, 1);
                        b = with(Binary::Or, b, 1);
                    }
                    Binary::UnsignedDivide | Binary::UnsignedModulo => b = with(Binary::Or, b, 1),
                    Binary::ShiftLeft | Binary::SignedShiftRight | Binary::UnsignedShiftRight => b = with(Binary::And, b, 31),
                    _ => {}
                }
                Expression::Binary(operation, signed, Box::new(a), Box::new(b))
            }
        }
    }

    fn exit(&mut self, around: Around) -> Option<Exit> {
        let mut exits = vec![Exit::Return];
        exits.extend(around.inside_loop.then_some([Exit::Loop, Exit::Loop, Exit::Continue]).into_iter().flatten());
        exits.extend(around.inside_switch.then_some([Exit::Switch, Exit::Switch]).into_iter().flatten());
        exits.extend(around.may_fall.then_some([Exit::Fall, Exit::Fall]).into_iter().flatten());
        let n = self.below(exits.len() as u32 + 1) as usize;
        exits.get(n).copied()
    }

    fn block(&mut self, depth: u32, around: Around) -> Vec<Statement> {
        let mut out = Vec::new();
        for _ in 0..1 + self.below(3) {
            self.statements += 1;
            let deep = depth > 0 && self.statements < 60;
            out.push(match self.below(if deep { 9 } else { 3 }) {
                0 | 1 => Statement::Set(1 + self.below(VARIABLES as u32 - 1) as usize, self.expression(2)),
                2 => match self.exit(around) {
                    Some(exit) => {
                        let bare = self.below(2) == 0;
                        Statement::Exit(Some((self.expression(1), bare)), exit, self.tag())
                    }
                    None => Statement::Set(1, self.expression(2)),
                },
                3 | 4 => {
                    let (yes, no) = (self.block(depth - 1, around), self.block(depth - 1, around));
                    let no = if self.below(2) == 0 { Vec::new() } else { no };
                    Statement::If(self.expression(1), yes, no, [self.tag(), self.tag()])
                }
                5 | 6 => Statement::Loop(Loop {
                    turns: 1 + self.below(4),
                    last: self.below(2) == 0,
                    body: self.block(depth - 1, Around { inside_loop: true, ..Around::default() }),
                    tags: [self.tag(), self.tag()],
                }),
                _ => Statement::Switch(self.switch(depth - 1, around)),
            });
        }
        if self.below(5) == 0
            && let Some(exit) = self.exit(around)
        {
            out.push(Statement::Exit(None, exit, self.tag()));
        }
        out
    }

    fn switch(&mut self, depth: u32, around: Around) -> Switch {
        let count = 1 + self.below(4) as usize;
        let default = self.below(count as u32 + 1) as usize;
        let mut values: Vec<u32> = (0..6).collect();
        self.random.shuffle(&mut values);
        let cases = (0..count)
            .map(|n| {
                let own = if n == default { self.below(3) } else { 1 + self.below(2) } as usize;
                let values = values.split_off(values.len().saturating_sub(own.min(values.len().saturating_sub(count - n))));
                let may_fall = n + 1 < count;
                let around = Around { inside_loop: around.inside_loop, inside_switch: true, may_fall };
                Case {
                    values,
                    default: n == default,
                    // A case that is nothing but a branch.
                    body: match self.exit(around).filter(|_| self.below(5) == 0) {
                        Some(exit) => vec![Statement::Exit(None, exit, self.tag())],
                        None => self.block(depth, around),
                    },
                    tag: self.tag(),
                    falls: may_fall && self.below(4) == 0,
                }
            })
            .filter(|case| case.default || !case.values.is_empty())
            .collect::<Vec<Case>>();
        Switch { selector: self.expression(1), cases, tag: self.tag() }
    }
}

/// The program of a seed.
pub fn program(seed: u64) -> Vec<Statement> {
    let mut maker = Maker { random: Random::new(seed), tags: 0, statements: 0 };
    let mut out = Vec::new();
    while maker.statements < 12 {
        out.extend(maker.block(3, Around::default()));
        // What comes after an exit is never reached.
        if matches!(out.last(), Some(Statement::Exit(None, ..))) {
            out.pop();
        }
    }
    out
}

/// Runs a tree.
pub struct Run {
    pub input: u32,
    pub variables: [u32; VARIABLES],
}

/// The values that the variables begin with.
pub fn initial(input: u32) -> [u32; VARIABLES] {
    [17, input, !input, input.wrapping_mul(7), 0x8000_0001]
}

/// What a program leaves.
pub fn result(variables: &[u32; VARIABLES]) -> u32 {
    variables.iter().fold(0, |sum, &v| (sum ^ v).wrapping_mul(31))
}

impl Run {
    /// Notes the end of a construct and how it was reached.
    fn reach(&mut self, tag: u32) {
        self.variables[0] = self.variables[0].wrapping_mul(31).wrapping_add(tag);
    }

    /// None: the end of the block was reached.
    pub fn block(&mut self, block: &[Statement]) -> Option<(Exit, u32)> {
        block.iter().find_map(|statement| self.statement(statement))
    }

    fn statement(&mut self, statement: &Statement) -> Option<(Exit, u32)> {
        match statement {
            Statement::Set(n, e) => self.variables[*n] = self.value(e),
            Statement::If(condition, yes, no, tags) => {
                let odd = self.value(condition) & 1 != 0;
                if let Some(exit) = self.block(if odd { yes } else { no }) {
                    return Some(exit);
                }
                self.reach(tags[usize::from(!odd)]);
            }
            Statement::Loop(it) => {
                let mut turn = 0;
                loop {
                    if !it.last && turn >= it.turns {
                        self.reach(it.tags[0]);
                        break;
                    }
                    match self.block(&it.body) {
                        Some((Exit::Loop, tag)) => {
                            self.reach(tag);
                            break;
                        }
                        Some((Exit::Continue, tag)) => self.reach(tag),
                        None => self.reach(it.tags[1]),
                        out => return out,
                    }
                    turn += 1;
                    if it.last && turn >= it.turns {
                        self.reach(it.tags[0]);
                        break;
                    }
                }
            }
            Statement::Switch(it) => {
                let selected = self.value(&it.selector) % 6;
                let case = it.cases.iter().position(|case| case.values.contains(&selected));
                let Some(mut at) = case.or_else(|| it.cases.iter().position(|case| case.default)) else {
                    self.reach(it.tag);
                    return None;
                };
                loop {
                    let case = &it.cases[at];
                    match self.block(&case.body) {
                        Some((Exit::Switch, tag)) => self.reach(tag),
                        None if !case.falls => self.reach(case.tag),
                        None | Some((Exit::Fall, _)) => {
                            at += 1;
                            continue;
                        }
                        out => return out,
                    }
                    break;
                }
            }
            Statement::Exit(condition, exit, tag) => {
                if condition.as_ref().is_none_or(|(condition, _)| self.value(condition) & 1 != 0) {
                    return Some((*exit, *tag));
                }
            }
        }
        None
    }

    fn value(&self, e: &Expression) -> u32 {
        match e {
            Expression::Constant(bits, _) => *bits,
            Expression::Input => self.input,
            Expression::Variable(n) => self.variables[*n],
            Expression::Unary(operation, _, a) => {
                let a = self.value(a);
                let s = a as i32;
                match operation {
                    Unary::Negate => a.wrapping_neg(),
                    Unary::Not => !a,
                    Unary::SignedAbs => s.wrapping_abs() as u32,
                    Unary::SignedSign => s.signum() as u32,
                    Unary::SignedHighest => {
                        let differing = if s < 0 { !a } else { a };
                        31u32.wrapping_sub(differing.leading_zeros())
                    }
                    Unary::UnsignedHighest => 31u32.wrapping_sub(a.leading_zeros()),
                    Unary::Lowest => a.checked_ilog2().map_or(u32::MAX, |_| a.trailing_zeros()),
                    Unary::Count => a.count_ones(),
                    Unary::Reverse => a.reverse_bits(),
                    Unary::SignedBits => (((s << 21) >> 24) as u32).wrapping_add(0),
                    Unary::UnsignedBits => a >> 3 & 0xff,
                    Unary::SignedToFloat => (s as f32).to_bits(),
                    Unary::UnsignedToFloat => (a as f32).to_bits(),
                    Unary::FloatToSigned | Unary::FloatToUnsigned => a & 0xffff,
                }
            }
            Expression::Binary(operation, _, a, b) => {
                let (a, b) = (self.value(a), self.value(b));
                let (s, t) = (a as i32, b as i32);
                match operation {
                    Binary::Add => a.wrapping_add(b),
                    Binary::Subtract => a.wrapping_sub(b),
                    Binary::Multiply => a.wrapping_mul(b),
                    Binary::And => a & b,
                    Binary::Or => a | b,
                    Binary::Xor => a ^ b,
                    Binary::SignedDivide => (s / t) as u32,
                    Binary::SignedRemainder => (s % t) as u32,
                    Binary::SignedModulo => {
                        let rest = i64::from(s) % i64::from(t);
                        (if rest != 0 && (rest < 0) != (t < 0) { rest + i64::from(t) } else { rest }) as u32
                    }
                    Binary::UnsignedDivide => a / b,
                    Binary::UnsignedModulo => a % b,
                    Binary::ShiftLeft => a << b,
                    Binary::SignedShiftRight => (s >> t) as u32,
                    Binary::UnsignedShiftRight => a >> b,
                    Binary::SignedMin => s.min(t) as u32,
                    Binary::SignedMax => s.max(t) as u32,
                    Binary::UnsignedMin => a.min(b),
                    Binary::UnsignedMax => a.max(b),
                    Binary::SignedLess => (s < t).into(),
                    Binary::UnsignedLess => (a < b).into(),
                    Binary::Equal => (a == b).into(),
                }
            }
        }
    }
}
