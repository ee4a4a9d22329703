//! WGSL of a program's instructions: one line or block each.

use std::fmt::Write;

use super::program::*;
use crate::glsl::stage::way;

const LETTERS: [&str; 6] = ["x", "y", "z", "w", "0", "1"];

/// The variable of an input.
pub fn input_name(bit: u32) -> String {
    match bit {
        input::POSITION => "in_position".into(),
        input::COLOR => "in_color".into(),
        input::NORMAL => "in_normal".into(),
        input::SECONDARY => "in_secondary".into(),
        input::FOG => "in_fog".into(),
        input::TEXTURE..16 => format!("in_texture{}", bit - input::TEXTURE),
        _ => format!("in_generic{}", bit - input::GENERIC),
    }
}

/// The variable of a result.
pub fn output_name(output: Output) -> String {
    match output {
        Output::Position => "out_position".into(),
        Output::Color(k @ 0..4) => {
            ["out_color", "out_secondary", "out_back_color", "out_back_secondary"][usize::from(k)].into()
        }
        Output::Color(k) => format!("out_color{k}"),
        Output::Fog => "out_fog".into(),
        Output::PointSize => "out_size".into(),
        Output::Texture(unit) => format!("out_texture{unit}"),
        Output::Depth => "out_depth".into(),
        Output::Second => "out_second".into(),
    }
}

/// A literal that WGSL reads as the same number.
fn literal(value: f32) -> String {
    format!("{value:?}")
}

/// Variables of results and registers, and the instructions. Parameters are in the array `params` of the uniforms; units that are not in
/// `bound` have no complete texture.
pub fn body(program: &Program, params: &str, bound: &[usize], out: &mut String) {
    for &output in &program.outputs {
        line!(out, "    var {} = vec4f(0, 0, 0, 1);", output_name(output));
    }
    for (k, name) in program.temps.iter().enumerate() {
        let read = program.instructions.iter().flat_map(|i| &i.sources).any(|source| source.register == Register::Temp(k));
        let written = program.instructions.iter().filter_map(|i| i.destination).any(|to| to.register == Register::Temp(k));
        if read || written {
            line!(out, "    var {}: vec4f;", temp(k, name));
        }
    }
    for k in 0..program.addresses.len() {
        line!(out, "    var address{k}: i32;");
    }
    for instruction in &program.instructions {
        Emitter { program, params, instruction, bound }.emit(out);
    }
}

/// Temporaries keep the program's names if these are valid in WGSL.
fn temp(k: usize, name: &str) -> String {
    if name.chars().all(|c| c.is_ascii_alphanumeric() || c == '_') { format!("t{k}_{name}") } else { format!("t{k}") }
}

struct Emitter<'a> {
    program: &'a Program,
    params: &'a str,
    instruction: &'a Instruction,
    bound: &'a [usize],
}

impl Emitter<'_> {
    fn register(&self, register: Register) -> String {
        match register {
            Register::Temp(k) => temp(k, &self.program.temps[k]),
            Register::Param(k) => match self.program.params[k] {
                _ if !self.inline() => format!("u.{}[{k}]", self.params),
                Param::Literal(v) if v == [v[0]; 4] => format!("vec4f({})", literal(v[0])),
                Param::Literal(v) => format!("vec4f({})", v.map(literal).join(", ")),
                _ => format!("u.{}[{k}]", self.params),
            },
            Register::Relative { first, address } => format!("u.{}[address{address} + {first}]", self.params),
            Register::Input(bit) => input_name(bit),
            Register::Output(output) => output_name(output),
            Register::Address(k) => format!("address{k}"),
        }
    }

    /// Whether constants are written as literals. The compiler evaluates an expression of literals only, and refuses one without a finite
    /// value.
    fn inline(&self) -> bool {
        let constant = |source: &&SourceOperand| matches!(source.register, Register::Param(k) if matches!(self.program.params[k], Param::Literal(_)));
        let sources = &self.instruction.sources;
        let plain = matches!(self.instruction.name, "MOV" | "SWZ");
        plain || sources.len() > 1 && sources.iter().filter(constant).count() <= 1
    }

    /// Components of an operand: a scalar or a vector.
    fn source(&self, k: usize, components: &[usize]) -> String {
        let source = &self.instruction.sources[k];
        let picked: Vec<usize> = components.iter().map(|&c| usize::from(source.swizzle[c])).collect();
        let negated: Vec<bool> = components.iter().map(|&c| source.negate[c]).collect();
        let register = self.register(source.register);
        let plain = picked.iter().all(|&c| c < 4) && negated.iter().all(|&n| n == negated[0]);
        if !plain {
            let one = |c: &usize, n: &bool| {
                let value = if *c < 4 { format!("{register}.{}", LETTERS[*c]) } else { format!("{}.0", c - 4) };
                if *n { format!("-{value}") } else { value }
            };
            let list: Vec<String> = picked.iter().zip(&negated).map(|(c, n)| one(c, n)).collect();
            return match list.len() {
                1 => list[0].clone(),
                n => format!("vec{n}f({})", list.join(", ")),
            };
        }
        let letters: String = picked.iter().map(|&c| LETTERS[c]).collect();
        let sign = if negated[0] { "-" } else { "" };
        if letters == "xyzw" { format!("{sign}{register}") } else { format!("{sign}{register}.{letters}") }
    }

    fn emit(&self, out: &mut String) {
        let Some(destination) = self.instruction.destination else {
            // Discards if any component is below 0.
            line!(out, "    if any({} < vec4f()) {{ discard; }}", self.source(0, &[0, 1, 2, 3]));
            return;
        };
        if self.instruction.name == "ARL" {
            line!(out, "    {} = i32(floor({}));", self.register(destination.register), self.source(0, &[0]));
            return;
        }
        let wanted: Vec<usize> = (0..4).filter(|&c| destination.mask[c]).collect();
        if wanted.is_empty() {
            return;
        }
        let (value, scalar) = match self.componentwise(&wanted) {
            Some(value) => (value, false),
            None => match self.scalar() {
                Some(value) => (value, true),
                None => {
                    let letters: String = wanted.iter().map(|&c| LETTERS[c]).collect();
                    let value = self.vector();
                    (if wanted.len() == 4 { value } else { format!("{value}.{letters}") }, false)
                }
            },
        };
        let value = if self.instruction.saturate { format!("saturate({value})") } else { value };
        let to = self.register(destination.register);
        match wanted[..] {
            [only] => line!(out, "    {to}.{} = {value};", LETTERS[only]),
            [_, _, _, _] if scalar => line!(out, "    {to} = vec4f({value});"),
            [_, _, _, _] => line!(out, "    {to} = {value};"),
            _ => {
                let mut text = format!("    {{ let v = {value};");
                for (k, &c) in wanted.iter().enumerate() {
                    let part = if scalar { String::new() } else { format!(".{}", LETTERS[k]) };
                    text += &format!(" {to}.{} = v{part};", LETTERS[c]);
                }
                line!(out, "{text} }}");
            }
        }
    }

    /// Instructions whose components do not depend on each other: the value of these components.
    fn componentwise(&self, wanted: &[usize]) -> Option<String> {
        let s = |k: usize| self.source(k, wanted);
        let wide = |value: &str| if wanted.len() == 1 { value.to_owned() } else { format!("vec{}f({value})", wanted.len()) };
        Some(match self.instruction.name {
            "ABS" => format!("abs({})", s(0)),
            "ADD" => format!("({} + {})", s(0), s(1)),
            "CMP" => format!("select({}, {}, {} < {})", s(2), s(1), s(0), wide("0.0")),
            "FLR" => format!("floor({})", s(0)),
            "FRC" => format!("fract({})", s(0)),
            "LRP" => format!("mix({}, {}, {})", s(2), s(1), s(0)),
            "MAD" => format!("({} * {} + {})", s(0), s(1), s(2)),
            "MAX" => format!("max({}, {})", s(0), s(1)),
            "MIN" => format!("min({}, {})", s(0), s(1)),
            "MOV" | "SWZ" => s(0),
            "MUL" => format!("({} * {})", s(0), s(1)),
            "SGE" => format!("select({}, {}, {} >= {})", wide("0.0"), wide("1.0"), s(0), s(1)),
            "SLT" => format!("select({}, {}, {} < {})", wide("0.0"), wide("1.0"), s(0), s(1)),
            "SUB" => format!("({} - {})", s(0), s(1)),
            _ => return None,
        })
    }

    /// Instructions with one result for all components.
    fn scalar(&self) -> Option<String> {
        let s = |k: usize| self.source(k, &[0]);
        let three = |k: usize| self.source(k, &[0, 1, 2]);
        let four = |k: usize| self.source(k, &[0, 1, 2, 3]);
        Some(match self.instruction.name {
            "COS" => format!("cos({})", s(0)),
            "SIN" => format!("sin({})", s(0)),
            "DP3" => format!("dot({}, {})", three(0), three(1)),
            "DP4" => format!("dot({}, {})", four(0), four(1)),
            "DPH" => format!("(dot({}, {}) + {})", three(0), three(1), self.source(1, &[3])),
            "EX2" => format!("exp2({})", s(0)),
            "LG2" => format!("log2({})", s(0)),
            "POW" => format!("pow({}, {})", s(0), s(1)),
            "RCP" => format!("(1.0 / {})", s(0)),
            "RSQ" => format!("inverseSqrt(abs({}))", s(0)),
            _ => return None,
        })
    }

    /// Instructions whose components differ: a vector of four.
    fn vector(&self) -> String {
        let s = |k: usize, c: usize| self.source(k, &[c]);
        let three = |k: usize| self.source(k, &[0, 1, 2]);
        match self.instruction.name {
            "DST" => format!("vec4f(1.0, {} * {}, {}, {})", s(0, 1), s(1, 1), s(0, 2), s(1, 3)),
            "EXP" => format!("vec4f(exp2(floor({0})), fract({0}), exp2({0}), 1.0)", s(0, 0)),
            // 0 to the power of 0 is 1.
            "LIT" => {
                let [x, y, w] = [0, 1, 3].map(|c| s(0, c));
                let power = format!("clamp({w}, -127.9961, 127.9961)");
                let gloss = format!("select(pow(max({y}, 0.0), {power}), 1.0, {w} == 0.0)");
                format!("vec4f(1.0, max({x}, 0.0), select(0.0, {gloss}, {x} > 0.0), 1.0)")
            }
            "LOG" => {
                let x = format!("abs({})", s(0, 0));
                format!("vec4f(floor(log2({x})), {x} / exp2(floor(log2({x}))), log2({x}), 1.0)")
            }
            "SCS" => format!("vec4f(cos({0}), sin({0}), 0.0, 1.0)", s(0, 0)),
            "XPD" => format!("vec4f(cross({}, {}), 1.0)", three(0), three(1)),
            name => {
                let unit = self.instruction.unit;
                if !self.bound.contains(&unit) {
                    // A texture that is not complete.
                    return "vec4f(0, 0, 0, 1)".into();
                }
                let at = match name {
                    "TXP" => format!("{} / {}", three(0), s(0, 3)),
                    _ => three(0),
                };
                let bias = if name == "TXB" { s(0, 3) } else { "0.0".into() };
                if self.program.ways(unit) & way::BIAS != 0 {
                    format!("texel{unit}({at}, {bias})")
                } else {
                    format!("texel{unit}({at})")
                }
            }
        }
    }
}
