//! A tree as WGSL, where all values are `u32`.

use std::fmt::Write;

use super::{Binary, Exit, Expression, Statement, Unary, VARIABLES, initial};

struct Writer {
    out: String,
    names: u32,
    /// The switches around inside of the innermost loop, from the outermost: the variable that says which case comes next.
    switches: Vec<u32>,
    inside_loop: bool,
}

pub fn write(program: &[Statement]) -> String {
    let mut writer = Writer { out: String::new(), names: 0, switches: Vec::new(), inside_loop: false };
    writer.block(program);
    let results = (0..VARIABLES).map(|n| format!("r = (r ^ v{n}) * 31u;")).collect::<String>();
    let first = initial(0);
    format!(
        "@group(0) @binding(0) var<storage, read_write> results: array<u32>;
         @group(0) @binding(1) var<storage, read> inputs: array<u32>;
         var<private> v0: u32; var<private> v1: u32; var<private> v2: u32; var<private> v3: u32; var<private> v4: u32;
         fn smod(a: u32, b: u32) -> u32 {{
             let s = bitcast<i32>(a); let t = bitcast<i32>(b); let r = s % t;
             return bitcast<u32>(select(r, r + t, r != 0 && (r < 0) != (t < 0)));
         }}
         fn run(x: u32, z: u32) {{
             var tag = 0u; var out = 0u;
             {}
         }}
         @compute @workgroup_size(64) fn main(@builtin(global_invocation_id) id: vec3u) {{
             let x = inputs[id.x];
             v0 = {}u; v1 = x; v2 = ~x; v3 = x * 7u; v4 = {}u;
             run(x, inputs[id.x] - x);
             var r = 0u; {results}
             results[id.x] = r;
         }}",
        writer.out, first[0], first[4]
    )
}

fn reach(tag: &str) -> String {
    format!("v0 = v0 * 31u + {tag};\n")
}

impl Writer {
    fn block(&mut self, block: &[Statement]) {
        for statement in block {
            self.statement(statement);
        }
    }

    fn line(&mut self, text: &str) {
        self.out.push_str(text);
        self.out.push('\n');
    }

    fn exit(&mut self, exit: Exit, tag: u32) {
        match exit {
            Exit::Return => self.line("return;"),
            Exit::Continue => self.line(&format!("tag = {tag}u; continue;")),
            Exit::Switch => self.line(&format!("tag = {tag}u; break;")),
            // From inside of switches it goes out step by step.
            Exit::Loop => self.line(&format!("tag = {tag}u; out = 1u; break;")),
            Exit::Fall => {
                let next = self.switches.last().copied().unwrap_or(0);
                self.line(&format!("n{next} += 1u; break;"));
            }
        }
    }

    fn statement(&mut self, statement: &Statement) {
        match statement {
            Statement::Set(n, e) => {
                let text = format!("v{n} = {};", value(e));
                self.line(&text);
            }
            Statement::If(condition, yes, no, tags) => {
                self.line(&format!("if (({} & 1u) != 0u) {{", value(condition)));
                self.block(yes);
                self.line(&format!("{}}} else {{", reach(&format!("{}u", tags[0]))));
                self.block(no);
                self.line(&format!("{}}}", reach(&format!("{}u", tags[1]))));
            }
            Statement::Exit(None, exit, tag) => self.exit(*exit, *tag),
            Statement::Exit(Some((condition, _)), exit, tag) => {
                self.line(&format!("if (({} & 1u) != 0u) {{", value(condition)));
                self.exit(*exit, *tag);
                self.line("}");
            }
            Statement::Loop(it) => {
                self.names += 1;
                let k = self.names;
                let switches = std::mem::take(&mut self.switches);
                let inside = std::mem::replace(&mut self.inside_loop, true);
                self.line(&format!("var k{k} = 0u; loop {{"));
                if !it.last {
                    self.line(&format!("if (k{k} >= {}u) {{ tag = {}u; break; }}", it.turns, it.tags[0]));
                }
                self.block(&it.body);
                // The end of the body is the end of a turn.
                self.line(&format!("tag = {}u; continuing {{ {} k{k} += 1u;", it.tags[1], reach("tag")));
                if it.last {
                    // A loop that ends by its condition has that tag.
                    self.line(&format!(
                        "if (k{k} >= {}u) {{ tag = {}u; }} break if k{k} >= {}u;",
                        it.turns, it.tags[0], it.turns
                    ));
                }
                self.line(&format!("}} }} out = 0u; {}", reach("tag")));
                self.switches = switches;
                self.inside_loop = inside;
            }
            Statement::Switch(it) => {
                self.names += 1;
                let k = self.names;
                let default = it.cases.iter().position(|case| case.default).unwrap_or(99);
                self.line(&format!("var n{k} = 99u; tag = {}u; switch ({} % 6u) {{", it.tag, value(&it.selector)));
                for (n, case) in it.cases.iter().enumerate() {
                    for v in &case.values {
                        self.line(&format!("case {v}u: {{ n{k} = {n}u; }}"));
                    }
                }
                self.line(&format!("default: {{ n{k} = {default}u; }} }}"));
                self.switches.push(k);
                for (n, case) in it.cases.iter().enumerate() {
                    self.line(&format!("if (n{k} == {n}u) {{ switch (0) {{ default: {{"));
                    self.block(&case.body);
                    if case.falls {
                        self.exit(Exit::Fall, 0);
                    } else {
                        self.line(&format!("tag = {}u;", case.tag));
                    }
                    self.line("} } }");
                }
                self.switches.pop();
                // Out of the loop around, by way of the switches around this one.
                if self.inside_loop {
                    self.line("if (out != 0u) { break; }");
                }
                self.line(&reach("tag"));
            }
        }
    }
}

fn value(e: &Expression) -> String {
    let mut out = String::new();
    match e {
        // What is added is 0, and nobody knows.
        Expression::Constant(bits, _) => write!(out, "(z + {bits}u)"),
        Expression::Input => write!(out, "x"),
        Expression::Variable(n) => write!(out, "v{n}"),
        Expression::Unary(operation, _, a) => {
            let a = value(a);
            let s = format!("bitcast<i32>({a})");
            match operation {
                Unary::Negate => write!(out, "(z - {a})"),
                Unary::Not => write!(out, "(~{a})"),
                Unary::SignedAbs => write!(out, "bitcast<u32>(abs({s}))"),
                Unary::SignedSign => write!(out, "bitcast<u32>(sign({s}))"),
                Unary::SignedHighest => write!(out, "bitcast<u32>(firstLeadingBit({s}))"),
                Unary::UnsignedHighest => write!(out, "firstLeadingBit({a})"),
                Unary::Lowest => write!(out, "firstTrailingBit({a})"),
                Unary::Count => write!(out, "countOneBits({a})"),
                Unary::Reverse => write!(out, "reverseBits({a})"),
                Unary::SignedBits => write!(out, "bitcast<u32>(extractBits({s}, 3u, 8u))"),
                Unary::UnsignedBits => write!(out, "extractBits({a}, 3u, 8u)"),
                Unary::SignedToFloat => write!(out, "bitcast<u32>(f32({s}))"),
                Unary::UnsignedToFloat => write!(out, "bitcast<u32>(f32({a}))"),
                Unary::FloatToSigned => write!(out, "bitcast<u32>(i32(f32({a} & 0xffffu)))"),
                Unary::FloatToUnsigned => write!(out, "u32(f32({a} & 0xffffu))"),
            }
        }
        Expression::Binary(operation, _, a, b) => {
            let (a, b) = (value(a), value(b));
            let (s, t) = (format!("bitcast<i32>({a})"), format!("bitcast<i32>({b})"));
            match operation {
                Binary::Add => write!(out, "({a} + {b})"),
                Binary::Subtract => write!(out, "({a} - {b})"),
                Binary::Multiply => write!(out, "({a} * {b})"),
                Binary::And => write!(out, "({a} & {b})"),
                Binary::Or => write!(out, "({a} | {b})"),
                Binary::Xor => write!(out, "({a} ^ {b})"),
                Binary::SignedDivide => write!(out, "bitcast<u32>({s} / {t})"),
                Binary::SignedRemainder => write!(out, "bitcast<u32>({s} % {t})"),
                Binary::SignedModulo => write!(out, "smod({a}, {b})"),
                Binary::UnsignedDivide => write!(out, "({a} / {b})"),
                Binary::UnsignedModulo => write!(out, "({a} % {b})"),
                Binary::ShiftLeft => write!(out, "({a} << {b})"),
                Binary::SignedShiftRight => write!(out, "bitcast<u32>({s} >> {b})"),
                Binary::UnsignedShiftRight => write!(out, "({a} >> {b})"),
                Binary::SignedMin => write!(out, "bitcast<u32>(min({s}, {t}))"),
                Binary::SignedMax => write!(out, "bitcast<u32>(max({s}, {t}))"),
                Binary::UnsignedMin => write!(out, "min({a}, {b})"),
                Binary::UnsignedMax => write!(out, "max({a}, {b})"),
                Binary::SignedLess => write!(out, "select(0u, 1u, {s} < {t})"),
                Binary::UnsignedLess => write!(out, "select(0u, 1u, {a} < {b})"),
                Binary::Equal => write!(out, "select(0u, 1u, {a} == {b})"),
            }
        }
    }
    .expect("text");
    out
}
