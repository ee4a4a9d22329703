//! A tree as SPIR-V: a small assembler, and how each statement becomes blocks.

use std::collections::HashMap;

use super::{Binary, Exit, Expression, Statement, Switch, Unary, VARIABLES, initial};

/// The words of a module that is being written.
#[derive(Default)]
struct Assembler {
    /// Capabilities to execution modes, decorations, types and constants, functions.
    head: Vec<u32>,
    decorations: Vec<u32>,
    globals: Vec<u32>,
    code: Vec<u32>,
    ids: u32,
    constants: HashMap<(u32, bool), u32>,
}

fn put(out: &mut Vec<u32>, code: u32, operands: &[u32]) {
    out.push(code | ((operands.len() as u32 + 1) << 16));
    out.extend_from_slice(operands);
}

/// Words of a text, after these operands.
fn text(before: &[u32], text: &str, after: &[u32]) -> Vec<u32> {
    let mut bytes = text.as_bytes().to_vec();
    bytes.push(0);
    bytes.resize(bytes.len().next_multiple_of(4), 0);
    let words = bytes.chunks_exact(4).map(|b| u32::from_le_bytes([b[0], b[1], b[2], b[3]]));
    before.iter().copied().chain(words).chain(after.iter().copied()).collect()
}

/// A block that ends a construct, and the branches to it: tag and block.
#[derive(Clone)]
struct End {
    label: u32,
    sources: Vec<(u32, u32)>,
}

/// Numbers that every module has.
#[derive(Default)]
struct Known {
    glsl: u32,
    boolean: u32,
    float: u32,
    unsigned: u32,
    signed: u32,
    variables: Vec<u32>,
    input: u32,
}

struct Writer {
    a: Assembler,
    known: Known,
    /// The block that is being written; 0: the last one has ended.
    block: u32,
    /// Ends of the constructs that may be left from here.
    switches: Vec<End>,
    loops: Vec<End>,
    turns: Vec<End>,
    next_cases: Vec<u32>,
    /// Whether the module computes a sum of its own, instead of that of the variables.
    by_hand: bool,
}

pub fn write(program: &[Statement]) -> Vec<u8> {
    Writer::new().finish(program)
}

/// A module that computes `OpSMod` of a vector by 3 and -3, and comparisons of a NaN and of numbers.
pub fn by_hand() -> Vec<u8> {
    let mut w = Writer::new();
    w.by_hand = true;
    w.finish(&[])
}

impl Writer {
    fn new() -> Writer {
        Writer {
            a: Assembler { ids: 1, ..Assembler::default() },
            known: Known::default(),
            block: 0,
            switches: Vec::new(),
            loops: Vec::new(),
            turns: Vec::new(),
            next_cases: Vec::new(),
            by_hand: false,
        }
    }

    fn finish(mut self, program: &[Statement]) -> Vec<u8> {
        self.module(program);
        let mut words = vec![0x0723_0203, 0x0001_0300, 0, self.a.ids, 0];
        words.extend(self.a.head.iter().chain(&self.a.decorations).chain(&self.a.globals).chain(&self.a.code));
        words.iter().flat_map(|word| word.to_le_bytes()).collect()
    }

    /// The sum that the module leaves: see the test.
    fn sum_by_hand(&mut self, x: u32) -> u32 {
        let (signed, unsigned, boolean, float) = (self.known.signed, self.known.unsigned, self.known.boolean, self.known.float);
        let [pair, one, two] = [(); 3].map(|()| self.id());
        self.global(23, &[pair, signed, 2]);
        for (id, value) in [(one, 1f32), (two, 2.0)] {
            self.global(43, &[float, id, value.to_bits()]);
        }
        let bits = self.constant(f32::NAN.to_bits(), false);
        let nan = self.value(124, float, &[bits]);
        let (three, minus) = (self.constant(3, true), self.constant(-3i32 as u32, true));
        let x = self.cast(x, false, true);
        let both = self.value(80, pair, &[x, x]);
        let by = self.value(80, pair, &[three, minus]);
        let rest = self.value(139, pair, &[both, by]);
        let mut sum = self.constant(0, false);
        for (component, factor) in [(0, 1), (1, 100)] {
            let part = self.value(81, signed, &[rest, component]);
            let part = self.cast(part, true, false);
            let factor = self.constant(factor, false);
            let part = self.value(132, unsigned, &[part, factor]);
            sum = self.value(128, unsigned, &[sum, part]);
        }
        // FUnordLessThan and FOrdNotEqual of a NaN, and of numbers.
        for (code, left, weight) in [(185, nan, 1000), (182, nan, 3000), (185, one, 20_000), (182, one, 200_000)] {
            let holds = self.value(code, boolean, &[left, two]);
            let (weight, zero) = (self.constant(weight, false), self.constant(0, false));
            let part = self.value(169, unsigned, &[holds, weight, zero]);
            sum = self.value(128, unsigned, &[sum, part]);
        }
        sum
    }

    fn id(&mut self) -> u32 {
        self.a.ids += 1;
        self.a.ids - 1
    }

    fn global(&mut self, code: u32, operands: &[u32]) {
        put(&mut self.a.globals, code, operands);
    }

    fn code(&mut self, code: u32, operands: &[u32]) {
        put(&mut self.a.code, code, operands);
    }

    fn value(&mut self, code: u32, ty: u32, operands: &[u32]) -> u32 {
        let id = self.id();
        let operands: Vec<u32> = [ty, id].iter().chain(operands).copied().collect();
        self.code(code, &operands);
        id
    }

    fn ty(&self, signed: bool) -> u32 {
        if signed { self.known.signed } else { self.known.unsigned }
    }

    fn constant(&mut self, bits: u32, signed: bool) -> u32 {
        if let Some(&id) = self.a.constants.get(&(bits, signed)) {
            return id;
        }
        let (id, ty) = (self.id(), self.ty(signed));
        self.global(43, &[ty, id, bits]);
        self.a.constants.insert((bits, signed), id);
        id
    }

    fn module(&mut self, program: &[Statement]) {
        let [glsl, main, builtin, run] = [(); 4].map(|()| self.id());
        put(&mut self.a.head, 17, &[1]);
        put(&mut self.a.head, 11, &text(&[glsl], "GLSL.std.450", &[]));
        put(&mut self.a.head, 14, &[0, 1]);
        put(&mut self.a.head, 15, &text(&[5, main], "main", &[builtin]));
        put(&mut self.a.head, 16, &[main, 17, 64, 1, 1]);
        let [void, boolean, float, unsigned, signed, vector, array, block, buffers, element, vectors] =
            [(); 11].map(|()| self.id());
        let [action, run_type, unsigned_private, signed_private, results, inputs] = [(); 6].map(|()| self.id());
        put(&mut self.a.decorations, 71, &[builtin, 11, 28]);
        put(&mut self.a.decorations, 71, &[array, 6, 4]);
        put(&mut self.a.decorations, 71, &[block, 2]);
        put(&mut self.a.decorations, 72, &[block, 0, 35, 0]);
        for (binding, buffer) in [results, inputs].into_iter().enumerate() {
            put(&mut self.a.decorations, 71, &[buffer, 34, 0]);
            put(&mut self.a.decorations, 71, &[buffer, 33, binding as u32]);
        }
        self.global(19, &[void]);
        self.global(20, &[boolean]);
        self.global(22, &[float, 32]);
        self.global(21, &[unsigned, 32, 0]);
        self.global(21, &[signed, 32, 1]);
        self.global(23, &[vector, unsigned, 3]);
        self.global(29, &[array, unsigned]);
        self.global(30, &[block, array]);
        self.global(32, &[buffers, 12, block]);
        self.global(32, &[element, 12, unsigned]);
        self.global(32, &[vectors, 1, vector]);
        self.global(32, &[unsigned_private, 6, unsigned]);
        self.global(32, &[signed_private, 6, signed]);
        self.global(33, &[action, void]);
        self.global(33, &[run_type, void, unsigned]);
        self.global(59, &[vectors, builtin, 1]);
        self.global(59, &[buffers, results, 12]);
        self.global(59, &[buffers, inputs, 12]);
        let variables: Vec<u32> = (0..VARIABLES)
            .map(|n| {
                let id = self.id();
                self.global(59, &[if n % 2 == 1 { signed_private } else { unsigned_private }, id, 6]);
                id
            })
            .collect();
        let input = self.id();
        self.known = Known { glsl, boolean, float, unsigned, signed, variables, input };

        self.code(54, &[void, run, 0, run_type]);
        self.code(55, &[unsigned, input]);
        let first = self.id();
        self.begin(first);
        self.block(program);
        if self.block != 0 {
            self.code(253, &[]);
        }
        self.code(56, &[]);

        self.code(54, &[void, main, 0, action]);
        let first = self.id();
        self.begin(first);
        let id = self.value(61, vector, &[builtin]);
        let index = self.value(81, unsigned, &[id, 0]);
        let zero = self.constant(0, false);
        let at = self.value(65, element, &[inputs, zero, index]);
        let x = self.value(61, unsigned, &[at]);
        let [start, last] = [0, 4].map(|n| initial(0)[n]);
        let (start, last, seven) = (self.constant(start, false), self.constant(last, false), self.constant(7, false));
        let not = self.value(200, unsigned, &[x]);
        let times = self.value(132, unsigned, &[x, seven]);
        for (n, value) in [start, x, not, times, last].into_iter().enumerate() {
            self.store(n, value, false);
        }
        self.value(57, void, &[run, x]);
        let factor = self.constant(31, false);
        let mut sum = zero;
        for n in 0..VARIABLES {
            let (v, signed) = self.load(n);
            let v = self.cast(v, signed, false);
            sum = self.value(198, unsigned, &[sum, v]);
            sum = self.value(132, unsigned, &[sum, factor]);
        }
        if self.by_hand {
            sum = self.sum_by_hand(x);
        }
        let at = self.value(65, element, &[results, zero, index]);
        self.code(62, &[at, sum]);
        self.code(253, &[]);
        self.code(56, &[]);
    }

    fn load(&mut self, n: usize) -> (u32, bool) {
        let (ty, variable) = (self.ty(n % 2 == 1), self.known.variables[n]);
        (self.value(61, ty, &[variable]), n % 2 == 1)
    }

    fn store(&mut self, n: usize, value: u32, signed: bool) {
        let value = self.cast(value, signed, n % 2 == 1);
        self.code(62, &[self.known.variables[n], value]);
    }

    fn cast(&mut self, value: u32, from: bool, to: bool) -> u32 {
        if from == to { value } else { self.value(124, self.ty(to), &[value]) }
    }

    fn begin(&mut self, label: u32) {
        self.code(248, &[label]);
        self.block = label;
    }

    fn end(&mut self) -> End {
        End { label: self.id(), sources: Vec::new() }
    }

    fn branch(&mut self, label: u32) {
        self.code(249, &[label]);
        self.block = 0;
    }

    /// Begins the block that ends a construct: a phi tells how it was reached. False: no branch leads there.
    fn reach(&mut self, end: &End) -> bool {
        self.begin(end.label);
        if end.sources.is_empty() {
            return false;
        }
        let sources: Vec<u32> = end.sources.iter().flat_map(|&(tag, block)| [self.constant(tag, false), block]).collect();
        let tag = self.value(245, self.known.unsigned, &sources);
        let (old, _) = self.load(0);
        let factor = self.constant(31, false);
        let product = self.value(132, self.known.unsigned, &[old, factor]);
        let sum = self.value(128, self.known.unsigned, &[product, tag]);
        self.store(0, sum, false);
        true
    }

    /// Begins the block after a selection.
    fn merge(&mut self, end: &End) {
        if !self.reach(end) {
            self.code(255, &[]);
            self.block = 0;
        }
    }

    fn block(&mut self, block: &[Statement]) {
        for statement in block {
            if self.block == 0 {
                return;
            }
            self.statement(statement);
        }
    }

    fn odd(&mut self, e: &Expression) -> u32 {
        let (value, signed) = self.expression(e);
        let value = self.cast(value, signed, false);
        let one = self.constant(1, false);
        let bit = self.value(199, self.known.unsigned, &[value, one]);
        self.value(170, self.known.boolean, &[bit, one])
    }

    /// The label that an exit leads to; none: a return. Notes the branch.
    fn leads_to(&mut self, exit: Exit, tag: u32) -> Option<u32> {
        let block = self.block;
        let list = match exit {
            Exit::Return => return None,
            Exit::Fall => return self.next_cases.last().copied(),
            Exit::Switch => &mut self.switches,
            Exit::Loop => &mut self.loops,
            Exit::Continue => &mut self.turns,
        };
        let end = list.last_mut().expect("an exit has what it leaves");
        end.sources.push((tag, block));
        Some(end.label)
    }

    fn exit(&mut self, exit: Exit, tag: u32) {
        match self.leads_to(exit, tag) {
            Some(label) => self.branch(label),
            None => {
                self.code(253, &[]);
                self.block = 0;
            }
        }
    }

    fn statement(&mut self, statement: &Statement) {
        match statement {
            Statement::Set(n, e) => {
                let (value, signed) = self.expression(e);
                self.store(*n, value, signed);
            }
            Statement::Exit(None, exit, tag) => self.exit(*exit, *tag),
            Statement::Exit(Some((condition, bare)), exit, tag) => {
                let condition = self.odd(condition);
                let next = self.id();
                if *bare && let Some(label) = self.leads_to(*exit, *tag) {
                    self.code(250, &[condition, label, next]);
                } else {
                    let inner = self.id();
                    self.code(247, &[next, 0]);
                    self.code(250, &[condition, inner, next]);
                    self.begin(inner);
                    self.exit(*exit, *tag);
                }
                self.begin(next);
            }
            Statement::If(condition, yes, no, tags) => {
                let condition = self.odd(condition);
                let mut end = self.end();
                let (accept, reject) = (self.id(), self.id());
                self.code(247, &[end.label, 0]);
                let reject = if no.is_empty() { end.label } else { reject };
                self.code(250, &[condition, accept, reject]);
                if no.is_empty() {
                    end.sources.push((tags[1], self.block));
                }
                for (label, block, tag) in [(accept, yes, tags[0]), (reject, no, tags[1])] {
                    if label == end.label {
                        continue;
                    }
                    self.begin(label);
                    self.block(block);
                    if self.block != 0 {
                        end.sources.push((tag, self.block));
                        self.branch(end.label);
                    }
                }
                self.merge(&end);
            }
            Statement::Loop(it) => {
                let before = self.block;
                let (header, body, counted, counter) = (self.id(), self.id(), self.id(), self.id());
                let (mut end, turn) = (self.end(), self.end());
                self.branch(header);
                self.begin(header);
                let (unsigned, zero) = (self.known.unsigned, self.constant(0, false));
                self.code(245, &[unsigned, counter, zero, before, counted, turn.label]);
                let turns = self.constant(it.turns, false);
                let done = |w: &mut Writer, value| w.value(174, w.known.boolean, &[value, turns]);
                if it.last {
                    self.code(246, &[end.label, turn.label, 0]);
                    self.branch(body);
                } else if it.turns.is_multiple_of(2) {
                    let done = done(self, counter);
                    self.code(246, &[end.label, turn.label, 0]);
                    self.code(250, &[done, end.label, body]);
                    end.sources.push((it.tags[0], header));
                } else {
                    let test = self.id();
                    self.code(246, &[end.label, turn.label, 0]);
                    self.branch(test);
                    self.begin(test);
                    let done = done(self, counter);
                    self.code(250, &[done, end.label, body]);
                    end.sources.push((it.tags[0], test));
                }
                let switches = std::mem::take(&mut self.switches);
                let cases = std::mem::take(&mut self.next_cases);
                self.loops.push(end);
                self.turns.push(turn);
                self.begin(body);
                self.block(&it.body);
                if self.block != 0 {
                    self.exit(Exit::Continue, it.tags[1]);
                }
                let (mut end, turn) = (self.loops.pop().expect("its end"), self.turns.pop().expect("its turn"));
                (self.switches, self.next_cases) = (switches, cases);
                let reached = self.reach(&turn);
                let one = self.constant(1, false);
                self.code(128, &[unsigned, counted, counter, one]);
                if it.last && reached {
                    let done = done(self, counted);
                    self.code(250, &[done, end.label, header]);
                    end.sources.push((it.tags[0], self.block));
                } else {
                    self.branch(header);
                }
                self.merge(&end);
            }
            Statement::Switch(it) => self.switch(it),
        }
    }

    fn switch(&mut self, it: &Switch) {
        let (value, signed) = self.expression(&it.selector);
        let value = self.cast(value, signed, false);
        let six = self.constant(6, false);
        let selected = self.value(137, self.known.unsigned, &[value, six]);
        // A selector may have either sign.
        let selected = self.cast(selected, false, it.tag.is_multiple_of(2));
        let end = self.end();
        let merge = end.label;
        self.switches.push(end);
        // A case that is one branch needs no block, unless another one falls into it, or another branch of the header leads there.
        let mut direct: Vec<u32> = Vec::new();
        let mut labels = Vec::new();
        let has_default = it.cases.iter().any(|case| case.default);
        if !has_default {
            self.leads_to(Exit::Switch, it.tag);
            direct.push(merge);
        }
        for (n, case) in it.cases.iter().enumerate() {
            let fallen_into = n > 0 && (it.cases[n - 1].falls || falls(&it.cases[n - 1].body));
            let list = match case.body[..] {
                [Statement::Exit(None, Exit::Switch, _)] => self.switches.last(),
                [Statement::Exit(None, Exit::Loop, _)] => self.loops.last(),
                [Statement::Exit(None, Exit::Continue, _)] => self.turns.last(),
                _ => None,
            };
            let label = list.map(|end| end.label).filter(|label| !fallen_into && !direct.contains(label));
            if let (Some(label), [Statement::Exit(None, exit, tag)]) = (label, &case.body[..]) {
                self.leads_to(*exit, *tag);
                direct.push(label);
                labels.push(label);
            } else {
                labels.push(self.id());
            }
        }
        let default = it.cases.iter().position(|case| case.default).map_or(merge, |n| labels[n]);
        let mut operands = vec![selected, default];
        for (case, &label) in it.cases.iter().zip(&labels) {
            operands.extend(case.values.iter().flat_map(|&value| [value, label]));
        }
        self.code(247, &[merge, 0]);
        self.code(251, &operands);
        self.block = 0;
        for (n, case) in it.cases.iter().enumerate().filter(|(n, _)| !direct.contains(&labels[*n])) {
            self.next_cases.push(labels.get(n + 1).copied().unwrap_or(0));
            self.begin(labels[n]);
            self.block(&case.body);
            if self.block != 0 {
                self.exit(if case.falls { Exit::Fall } else { Exit::Switch }, case.tag);
            }
            self.next_cases.pop();
        }
        let end = self.switches.pop().expect("its end");
        self.merge(&end);
    }

    /// A value and whether its type is signed.
    fn expression(&mut self, e: &Expression) -> (u32, bool) {
        let unsigned = self.known.unsigned;
        match e {
            Expression::Constant(bits, signed) => (self.constant(*bits, *signed), *signed),
            Expression::Input => (self.known.input, false),
            Expression::Variable(n) => self.load(*n),
            Expression::Unary(operation, signed, a) => {
                let (a, of) = self.expression(a);
                let (ty, glsl) = (self.ty(*signed), self.known.glsl);
                let float = self.known.float;
                let id = match operation {
                    Unary::Negate => self.value(126, ty, &[a]),
                    Unary::Not => self.value(200, ty, &[a]),
                    Unary::SignedAbs => self.value(12, ty, &[glsl, 5, a]),
                    Unary::SignedSign => self.value(12, ty, &[glsl, 7, a]),
                    Unary::SignedHighest => self.value(12, ty, &[glsl, 74, a]),
                    Unary::UnsignedHighest => self.value(12, ty, &[glsl, 75, a]),
                    Unary::Lowest => self.value(12, ty, &[glsl, 73, a]),
                    Unary::Count => self.value(205, ty, &[a]),
                    // Their operands have the type of their results.
                    Unary::Reverse => {
                        let a = self.cast(a, of, *signed);
                        self.value(204, ty, &[a])
                    }
                    Unary::SignedBits | Unary::UnsignedBits => {
                        let a = self.cast(a, of, *signed);
                        // Offset and count may have either sign.
                        let (offset, count) = (self.constant(3, of), self.constant(8, !of));
                        let code = if *operation == Unary::SignedBits { 202 } else { 203 };
                        self.value(code, ty, &[a, offset, count])
                    }
                    Unary::SignedToFloat | Unary::UnsignedToFloat => {
                        let code = if *operation == Unary::SignedToFloat { 111 } else { 112 };
                        let converted = self.value(code, float, &[a]);
                        self.value(124, ty, &[converted])
                    }
                    Unary::FloatToSigned | Unary::FloatToUnsigned => {
                        let a = self.cast(a, of, false);
                        let mask = self.constant(0xffff, false);
                        let low = self.value(199, unsigned, &[a, mask]);
                        let converted = self.value(112, float, &[low]);
                        if *operation == Unary::FloatToSigned {
                            self.value(110, ty, &[converted])
                        } else {
                            // Its result must be unsigned.
                            let whole = self.value(109, unsigned, &[converted]);
                            self.cast(whole, false, *signed)
                        }
                    }
                };
                (id, *signed)
            }
            Expression::Binary(operation, signed, a, b) => {
                let ((a, a_sign), (b, b_sign)) = (self.expression(a), self.expression(b));
                let (ty, glsl, boolean) = (self.ty(*signed), self.known.glsl, self.known.boolean);
                let code = match operation {
                    Binary::Add => 128,
                    Binary::Subtract => 130,
                    Binary::Multiply => 132,
                    Binary::And => 199,
                    Binary::Or => 197,
                    Binary::Xor => 198,
                    Binary::SignedDivide => 135,
                    Binary::SignedRemainder => 138,
                    Binary::SignedModulo => 139,
                    Binary::UnsignedDivide => 134,
                    Binary::UnsignedModulo => 137,
                    Binary::ShiftLeft => 196,
                    Binary::SignedShiftRight => 195,
                    Binary::UnsignedShiftRight => 194,
                    Binary::SignedMin => 39,
                    Binary::SignedMax => 42,
                    Binary::UnsignedMin => 38,
                    Binary::UnsignedMax => 41,
                    Binary::SignedLess => 177,
                    Binary::UnsignedLess => 176,
                    Binary::Equal => 170,
                };
                let id = match operation {
                    Binary::SignedMin | Binary::SignedMax | Binary::UnsignedMin | Binary::UnsignedMax => {
                        self.value(12, ty, &[glsl, code, a, b])
                    }
                    Binary::SignedLess | Binary::UnsignedLess | Binary::Equal => {
                        let holds = self.value(code, boolean, &[a, b]);
                        let (one, zero) = (self.constant(1, *signed), self.constant(0, *signed));
                        self.value(169, ty, &[holds, one, zero])
                    }
                    // Their types must be unsigned.
                    Binary::UnsignedDivide | Binary::UnsignedModulo => {
                        let (a, b) = (self.cast(a, a_sign, false), self.cast(b, b_sign, false));
                        let id = self.value(code, unsigned, &[a, b]);
                        self.cast(id, false, *signed)
                    }
                    _ => self.value(code, ty, &[a, b]),
                };
                (id, *signed)
            }
        }
    }
}

/// Whether a body has an exit into the next case.
fn falls(block: &[Statement]) -> bool {
    block.iter().any(|statement| match statement {
        Statement::Exit(_, exit, _) => *exit == Exit::Fall,
        Statement::If(_, yes, no, _) => falls(yes) || falls(no),
        _ => false,
    })
}
