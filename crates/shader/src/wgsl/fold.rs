//! Constants that naga does not compute, computed by the engine.
//!
//! A call in a constant expression is written into a shader of its own, together with the constants and types that it names. The engine runs
//! it, and the call is replaced by its value. So a value is the same, bit for bit, whether it is computed before a program runs or while
//! it runs.

use std::collections::{HashMap, HashSet};
use std::fmt::Write;
use std::ops::Range;

use naga::{ScalarKind, TypeInner};
use num::{Limits, Words};

use super::edits::Edit;
use super::mend::Parsed;
use crate::tokens::Token;
use crate::{BufferRange, Executor, Module, Options, Resource, Resources, Stage, compile};

/// Components of a value; the largest is a matrix.
const WORDS: u64 = 16;

/// How the value of a call is written.
struct Shape {
    /// What stands before the components, and its closing bracket if it has one.
    constructor: String,
    components: Vec<String>,
    kind: ScalarKind,
    /// The letter after a number.
    suffix: &'static str,
}

impl Parsed<'_> {
    /// The call at a place, replaced by its value. None: it is no call, or needs what has no value of its own.
    ///
    /// # Errors
    /// If the value is not finite.
    pub fn folded(&self, span: Range<usize>, limits: &Limits) -> Result<Option<Vec<Edit>>, String> {
        let first = self.first_at(span.start);
        let Some(open) = self.opens_call(first) else { return Ok(None) };
        let Some(close) = self.close(open) else { return Ok(None) };
        // A result that is a structure has no type that a text could name: one member of it is taken.
        let member = match (self.token(close + 1), self.token(close + 2)) {
            (Some(Token::Operator(".")), Some(Token::Word(name))) => Some(name),
            _ => None,
        };
        let Some((declared, local)) = self.needed(first, close) else { return Ok(None) };
        let call = &self.text[self.at(first)..self.end(close)];
        let enable = if self.text.contains("f16") || self.text.contains("vec2h") { "enable f16;\n" } else { "" };
        let (words, value, main) = (self.fresh("words"), self.fresh("value"), self.fresh("main"));
        let shader = |stores: &str, call: &str| {
            format!(
                "{enable}{declared}\n@group(0) @binding(0) var<storage, read_write> {words}: array<u32, {WORDS}>;\n\
                 @compute @workgroup_size(1) fn {main}() {{ {local}\nvar {value} = {call}; {stores} }}"
            )
        };
        let shape = |call: &str| {
            let text = shader(&format!("_ = {value};"), call);
            let (module, read) = super::read(&text, limits, false).ok()?;
            let function = &module.entry_points.first()?.function;
            let (_, variable) = function.local_variables.iter().find(|(_, local)| local.name.as_ref() == Some(&value))?;
            shape_of(&module.types[variable.ty].inner, &value, read.has_made_concrete)
        };
        let (range, call, shape) = match (shape(call), member) {
            (Some(shape), _) => (self.at(first)..self.end(close), call.to_owned(), shape),
            (None, Some(member)) => {
                let call = format!("{call}.{member}");
                let Some(shape) = shape(&call) else { return Ok(None) };
                (self.at(first)..self.end(close + 2), call, shape)
            }
            (None, None) => return Ok(None),
        };
        let mut stores = String::new();
        for (n, component) in shape.components.iter().enumerate() {
            let bits = match shape.kind {
                ScalarKind::Bool => format!("select(0u, 1u, {component})"),
                ScalarKind::Float => format!("bitcast<u32>(f32({component}))"),
                _ => format!("bitcast<u32>({component})"),
            };
            write!(stores, "{words}[{n}] = {bits};").expect("text");
        }
        let Some(bits) = run(&shader(&stores, &call), limits) else { return Ok(None) };
        let mut parts = Vec::new();
        for &bits in &bits[..shape.components.len()] {
            let number = f32::from_bits(bits);
            if shape.kind == ScalarKind::Float && !number.is_finite() {
                return Err(format!("the value of this constant expression is {number}, which WGSL does not allow"));
            }
            parts.push(match shape.kind {
                ScalarKind::Bool => (bits != 0).to_string(),
                ScalarKind::Float => format!("{:?}{}", f64::from(number), shape.suffix),
                ScalarKind::Sint => format!("i32({})", bits as i32),
                _ => format!("{bits}u"),
            });
        }
        let parts = parts.join(", ");
        Ok(Some(vec![Edit::replace(range, format!("{}({parts})", shape.constructor))]))
    }

    /// The first token at a byte or after it.
    fn first_at(&self, at: usize) -> usize {
        self.tokens.partition_point(|(begin, _)| *begin < at)
    }

    /// The opening bracket of the call that begins with a token.
    fn opens_call(&self, first: usize) -> Option<usize> {
        let Some(Token::Word(_)) = self.token(first) else { return None };
        if self.token(first + 1) == Some(Token::Open('(')) {
            return Some(first + 1);
        }
        if self.token(first) != Some(Token::Word("bitcast")) {
            return None;
        }
        (first..self.tokens.len()).find(|&n| self.token(n) == Some(Token::Open('(')))
    }

    /// The declarations that some tokens need: at the top, and constants of the function around. None: something has no value before the
    /// program runs.
    fn needed(&self, first: usize, last: usize) -> Option<(String, String)> {
        let (mut seen, mut top, mut local): (HashSet<usize>, Vec<Range<usize>>, Vec<Range<usize>>) = Default::default();
        let declarations = self.declarations();
        let mut open: Vec<(usize, usize)> = vec![(first, last)];
        while let Some((from, to)) = open.pop() {
            for n in from..=to {
                let Some(Token::Word(word)) = self.token(n) else { continue };
                if n > 0 && self.token(n - 1) == Some(Token::Operator(".")) {
                    continue;
                }
                let Some(named) = declarations.get(word) else { continue };
                let Some((keyword, end, is_local)) = self.declaration(named, n) else { continue };
                if !matches!(self.token(keyword), Some(Token::Word("const" | "alias" | "struct"))) {
                    return None;
                }
                if seen.insert(keyword) {
                    let list = if is_local { &mut local } else { &mut top };
                    list.push(keyword..end);
                    open.push((keyword + 2, end));
                }
            }
        }
        let text = |mut list: Vec<Range<usize>>| {
            list.sort_unstable_by_key(|range| range.start);
            list.iter().map(|range| format!("{}\n", &self.text[self.at(range.start)..self.end(range.end)])).collect()
        };
        Some((text(top), text(local)))
    }

    /// The tokens that name something where it is declared, by name.
    fn declarations(&self) -> HashMap<&str, Vec<usize>> {
        let mut all: HashMap<&str, Vec<usize>> = HashMap::new();
        for n in 1..self.tokens.len() {
            let keyword = matches!(
                self.token(n - 1),
                Some(Token::Word("const" | "let" | "var" | "override" | "alias" | "struct" | "fn") | Token::Operator(">"))
            );
            if let Some(Token::Word(name)) = self.token(n).filter(|_| keyword) {
                all.entry(name).or_default().push(n);
            }
        }
        all
    }

    /// The declaration that a name stands for at a place, of those of that name: its keyword, its end, and whether it is in the function
    /// around.
    fn declaration(&self, named: &[usize], at: usize) -> Option<(usize, usize, bool)> {
        let mut best: Option<(usize, bool)> = None;
        for &n in named {
            let around = self.around(n);
            let visible = around.is_none_or(|open| n < at && open < at && self.close(open).is_none_or(|close| close > at));
            if visible && (best.is_none() || around.is_some()) {
                best = Some((n, around.is_some()));
            }
        }
        let (n, is_local) = best?;
        let keyword = n - 1;
        let end = match self.token(keyword) {
            Some(Token::Word("struct")) => self.close(n + 1)?,
            _ => (n..self.tokens.len()).find(|&n| self.token(n) == Some(Token::Separator(';')))?,
        };
        Some((keyword, end, is_local))
    }
}

fn shape_of(inner: &TypeInner, value: &str, is_abstract: bool) -> Option<Shape> {
    let (scalar, constructor, components) = match *inner {
        TypeInner::Scalar(scalar) => (scalar, String::new(), vec![value.to_owned()]),
        TypeInner::Vector { size, scalar } => {
            let components = (0..size as u32).map(|n| format!("{value}[{n}]")).collect();
            (scalar, format!("vec{}", size as u32), components)
        }
        TypeInner::Matrix { columns, rows, scalar } => {
            let places = (0..columns as u32).flat_map(|c| (0..rows as u32).map(move |r| (c, r)));
            let components = places.map(|(c, r)| format!("{value}[{c}][{r}]")).collect();
            (scalar, format!("mat{}x{}", columns as u32, rows as u32), components)
        }
        _ => return None,
    };
    let (name, suffix) = match (scalar.kind, scalar.width) {
        (ScalarKind::Float, 4) if is_abstract => ("", ""),
        (ScalarKind::Float, 4) => ("f32", "f"),
        (ScalarKind::Float, 2) => ("f16", "h"),
        (ScalarKind::Sint, 4) => ("i32", ""),
        (ScalarKind::Uint, 4) => ("u32", ""),
        (ScalarKind::Bool, _) => ("bool", ""),
        _ => return None,
    };
    let constructor = if constructor.is_empty() || name.is_empty() { constructor } else { format!("{constructor}<{name}>") };
    Some(Shape { constructor, components, kind: scalar.kind, suffix })
}

/// Runs a shader once; what it leaves.
fn run(text: &str, limits: &Limits) -> Option<Vec<u32>> {
    let module = Module::constant(text, limits)?;
    let program = compile(&module, Stage::Compute, None, &Options::default()).ok()?;
    let words = Words::new(4 * WORDS);
    let bindings = [vec![Resource::Buffer(BufferRange { words: &words, offset: 0, size: words.len(), address: 0 })]];
    let resources = Resources { bindings: &bindings, ..Resources::default() };
    let uniforms = program.uniforms(&resources);
    let mut executor = Executor::new();
    executor.bind(&program, &resources, &uniforms).run_groups(0..1, [1, 1, 1], None).ok()?;
    Some((0..WORDS as usize).map(|n| words.load(n)).collect())
}
