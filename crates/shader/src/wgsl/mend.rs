//! What a text is rewritten to where naga refuses valid WGSL.
//!
//! Each of these is asked for by an error of naga, so that a text that naga takes is never touched. They work on tokens: a statement that is
//! rewritten begins after `;`, `{` or `}` and ends with its `;`; a call is a name, perhaps a template list, and brackets.

use std::collections::HashMap;
use std::ops::Range;

use super::edits::Edit;
use crate::tokens::{Token, Tokens};

/// An error of naga: where, and its words.
pub(super) struct Problem<'e> {
    /// The bytes that it points at first.
    pub span: Option<Range<usize>>,
    pub message: &'e str,
    /// What it says about them.
    pub label: &'e str,
}

/// A text and its tokens.
pub(super) struct Parsed<'t> {
    pub text: &'t str,
    pub tokens: Vec<(usize, Token<'t>)>,
    /// The bracket around each token, and the one that closes each bracket.
    around: Vec<Option<usize>>,
    closes: Vec<Option<usize>>,
}

/// Language extensions that cost nothing here: what they allow is allowed with or without them.
const LANGUAGE_EXTENSIONS: [&str; 4] =
    ["unrestricted_pointer_parameters", "swizzle_assignment", "subgroup_id", "immediate_address_space"];

impl<'t> Parsed<'t> {
    pub fn new(text: &'t str) -> Parsed<'t> {
        let tokens: Vec<(usize, Token<'t>)> = Tokens::new(text).collect();
        let (mut around, mut closes, mut open) = (Vec::with_capacity(tokens.len()), vec![None; tokens.len()], Vec::new());
        for (n, (_, token)) in tokens.iter().enumerate() {
            if let Token::Close(_) = token
                && let Some(begin) = open.pop()
            {
                closes[begin] = Some(n);
            }
            around.push(open.last().copied());
            if let Token::Open(_) = token {
                open.push(n);
            }
        }
        Parsed { text, tokens, around, closes }
    }

    pub(super) fn token(&self, n: usize) -> Option<Token<'t>> {
        self.tokens.get(n).map(|(_, token)| *token)
    }

    /// Where a token begins; the end of the text after the last one.
    pub fn at(&self, n: usize) -> usize {
        self.tokens.get(n).map_or(self.text.len(), |(at, _)| *at)
    }

    /// Where a token ends: what comes after it is blank up to the next one, but for comments.
    pub(super) fn end(&self, n: usize) -> usize {
        let at = self.at(n);
        let length = match self.token(n) {
            Some(Token::Word(text) | Token::Operator(text)) => text.len(),
            Some(Token::Open(_) | Token::Close(_) | Token::Separator(_)) => 1,
            _ => {
                let rest = &self.text[at..self.at(n + 1)];
                rest.find(|c: char| !(c.is_ascii_alphanumeric() || matches!(c, '.' | '+' | '-'))).unwrap_or(rest.len())
            }
        };
        at + length
    }

    /// The number of the first token at a byte or after it.
    fn number(&self, at: usize) -> usize {
        self.tokens.partition_point(|(begin, _)| *begin < at)
    }

    /// The number of the token that closes the bracket at `open`.
    pub(super) fn close(&self, open: usize) -> Option<usize> {
        self.closes.get(open).copied().flatten()
    }

    /// The bracket around a token.
    pub(super) fn around(&self, n: usize) -> Option<usize> {
        self.around.get(n).copied().flatten()
    }

    /// A name that the text does not have.
    pub(super) fn fresh(&self, name: &str) -> String {
        let mut name = format!("fillrate_{name}");
        while self.text.contains(&name) {
            name.push('_');
        }
        name
    }

    /// The arguments of a call whose opening bracket this is, as bytes.
    pub fn arguments(&self, open: usize) -> Option<Vec<Range<usize>>> {
        let close = self.close(open)?;
        let (mut arguments, mut begin, mut depth, mut angles) = (Vec::new(), open + 1, 0, 0);
        for n in open + 1..close {
            match self.tokens[n].1 {
                Token::Open(_) => depth += 1,
                Token::Close(_) => depth -= 1,
                // Template lists in arguments are those of types: a name stands before them.
                Token::Operator("<") if self.opens_template(n) => angles += 1,
                Token::Operator(">") if angles > 0 => angles -= 1,
                Token::Separator(',') if depth == 0 && angles == 0 => {
                    arguments.push(self.at(begin)..self.at(n));
                    begin = n + 1;
                }
                _ => {}
            }
        }
        if begin < close {
            arguments.push(self.at(begin)..self.at(close));
        }
        Some(arguments)
    }

    fn opens_template(&self, n: usize) -> bool {
        let Some(Token::Word(name)) = n.checked_sub(1).and_then(|n| self.token(n)) else { return false };
        name.starts_with("vec") || name.starts_with("mat") || matches!(name, "array" | "bitcast" | "ptr" | "atomic")
    }

    /// The edits that make naga take what it has refused; none where there are none.
    pub fn edits(&self, problem: &Problem<'_>) -> Option<Vec<Edit>> {
        let message = problem.message;
        let edits = if message == "the `subgroups` enable-extension is not yet supported" {
            self.directives("enable", &["subgroups"])
        } else if message.contains("language extension is not yet supported") || message.contains("unknown language extension")
        {
            self.directives("requires", &LANGUAGE_EXTENSIONS)
        } else if message.contains("@diagnostic") || problem.span.clone().is_some_and(|span| self.is_diagnostic(span.start)) {
            self.diagnostics()
        } else if message.contains("`subgroupElect`") {
            self.elect()
        } else if message.starts_with("invalid left-hand side") {
            self.swizzle(problem.span.clone()?)?
        } else if message.contains("concrete type") {
            self.concrete(problem.span.clone()?, problem.label)?
        } else {
            Vec::new()
        };
        (!edits.is_empty()).then_some(edits)
    }

    /// Takes names out of the directives of a kind.
    fn directives(&self, kind: &str, names: &[&str]) -> Vec<Edit> {
        let mut edits = Vec::new();
        let mut n = 0;
        // Directives come first.
        while let Some(Token::Word("enable" | "requires" | "diagnostic")) = self.token(n) {
            let Some(end) = (n..self.tokens.len()).find(|&n| self.token(n) == Some(Token::Separator(';'))) else { break };
            if self.token(n) == Some(Token::Word(kind)) {
                let listed = (n + 1..end).filter_map(|n| match self.token(n) {
                    Some(Token::Word(word)) => Some(word),
                    _ => None,
                });
                let (out, kept): (Vec<&str>, Vec<&str>) = listed.partition(|word| names.contains(word));
                if !out.is_empty() {
                    let text = if kept.is_empty() { String::new() } else { format!("{kind} {};", kept.join(", ")) };
                    edits.push(Edit::replace(self.at(n)..self.at(end) + 1, text));
                }
            }
            n = end + 1;
        }
        edits
    }

    fn is_diagnostic(&self, at: usize) -> bool {
        let n = self.number(at);
        self.token(n) == Some(Token::Operator("@")) && self.token(n + 1) == Some(Token::Word("diagnostic"))
    }

    /// Takes out `@diagnostic` of statements and of bodies, which has no effect on what a program computes.
    fn diagnostics(&self) -> Vec<Edit> {
        let mut edits = Vec::new();
        let mut depth = 0;
        for n in 0..self.tokens.len() {
            match self.tokens[n].1 {
                Token::Open('{') => depth += 1,
                Token::Close('}') => depth -= 1,
                Token::Operator("@") if self.token(n + 1) == Some(Token::Word("diagnostic")) => {
                    let Some(close) = self.close(n + 2).filter(|_| self.token(n + 2) == Some(Token::Open('('))) else {
                        continue;
                    };
                    let severity = matches!(self.token(n + 3), Some(Token::Word("off" | "info" | "warning" | "error")));
                    let names = matches!(self.token(n + 5), Some(Token::Word(_)));
                    let statement = match self.token(close + 1) {
                        Some(Token::Operator("@") | Token::Open('{')) => true,
                        Some(Token::Word(word)) => matches!(word, "if" | "switch" | "loop" | "while" | "for"),
                        _ => false,
                    };
                    if severity && names && statement && (depth > 0 || self.token(close + 1) == Some(Token::Open('{'))) {
                        edits.push(Edit::replace(self.at(n)..self.end(close), ""));
                    }
                }
                _ => {}
            }
        }
        edits
    }

    /// The first of the active invocations is the one with none before it.
    fn elect(&self) -> Vec<Edit> {
        let called = |n: &usize| {
            self.token(*n) == Some(Token::Word("subgroupElect"))
                && self.token(n + 1) == Some(Token::Open('('))
                && self.token(n + 2) == Some(Token::Close(')'))
        };
        let calls = (0..self.tokens.len()).filter(called);
        calls.map(|n| Edit::replace(self.at(n)..self.end(n + 2), "(subgroupExclusiveAdd(1u) == 0u)")).collect()
    }

    /// `v.zx = e;` computes all components before it stores them one by one.
    fn swizzle(&self, span: Range<usize>) -> Option<Vec<Edit>> {
        let first = self.number(span.start);
        let last = self.number(span.end).checked_sub(1)?;
        let (Some(Token::Word(letters)), Some(Token::Operator("."))) = (self.token(last), self.token(last.checked_sub(1)?))
        else {
            return None;
        };
        let set = ["xyzw", "rgba"].into_iter().find(|set| letters.chars().all(|c| set.contains(c)))?;
        let distinct = letters.char_indices().all(|(n, c)| !letters[..n].contains(c));
        let before = first.checked_sub(1).and_then(|n| self.token(n));
        let begins = matches!(before, Some(Token::Separator(';') | Token::Open('{') | Token::Close('}')));
        let in_block = self.around(first).is_some_and(|n| self.token(n) == Some(Token::Open('{')));
        if !distinct || letters.len() < 2 || letters.len() > 4 || !begins || !in_block {
            return None;
        }
        let end = (last..self.tokens.len()).find(|&n| self.token(n) == Some(Token::Separator(';')))?;
        // `=`, or an operator and `=`.
        let assigns = (last + 1..(last + 4).min(end)).find(|&n| self.token(n) == Some(Token::Operator("=")))?;
        let operator = &self.text[self.at(last + 1)..self.end(assigns)];
        let base = &self.text[self.at(first)..self.at(last - 1)];
        let right = &self.text[self.at(assigns + 1)..self.at(end)];
        let (pointer, value) = (self.fresh("place"), self.fresh("value"));
        // What an index says may change while the right side is computed; a path of members does not.
        let has_index = (first..last).any(|n| self.token(n) == Some(Token::Open('[')));
        let (head, base) = if has_index {
            (format!("let {pointer} = &({base}); "), format!("(*{pointer})"))
        } else {
            (String::new(), base.to_owned())
        };
        let stores: String = letters
            .chars()
            .zip(set.chars())
            .map(|(to, from)| {
                let from = "xyzw".chars().nth(set.find(from).unwrap_or(0)).unwrap_or('x');
                format!(" {base}.{to} = {value}.{from};")
            })
            .collect();
        // The variable has the type of the components, which the right side is converted to. The right side sees no name of this.
        let text = format!("{{ {head}var {value} = {base}.{letters}; {value} {operator} {right};{stores} }}");
        Some(vec![Edit::replace(self.at(first)..self.at(end) + 1, text)])
    }

    /// The last call in a part of the text that naga does not compute of abstract numbers: none of its arguments has another one.
    pub fn abstract_call(&self, span: Range<usize>) -> Option<Range<usize>> {
        let called = |n: &usize| {
            let known = matches!(self.token(*n), Some(Token::Word("mix" | "smoothstep" | "transpose" | "determinant")));
            known && self.token(n + 1) == Some(Token::Open('('))
        };
        let n = (self.number(span.start)..self.number(span.end)).rfind(called)?;
        Some(self.at(n)..self.end(self.close(n + 1)?))
    }

    /// A call of abstract numbers that naga does not compute: its first argument is made concrete, and the others follow.
    fn concrete(&self, span: Range<usize>, label: &str) -> Option<Vec<Edit>> {
        let name = self.number(span.start);
        let (Token::Word(function), Token::Open('(')) = (self.token(name)?, self.token(name + 1)?) else { return None };
        // What comes after it is part of the expression, too: an operator, or an index.
        if span.end > self.at(self.close(name + 1)? + 1) {
            return None;
        }
        let result = label.split('`').nth(1).or_else(|| label.strip_prefix("this expression has type "))?;
        let concrete = result.replace("{AbstractFloat}", "f32").replace("{AbstractInt}", "f32");
        if concrete == result {
            return None;
        }
        let arguments = self.arguments(name + 1)?;
        let first = arguments.first()?.clone();
        if self.abstract_call(self.end(name + 1)..span.end).is_some() {
            return None;
        }
        let ty = match function {
            "mix" | "smoothstep" => concrete,
            "transpose" => {
                let size = concrete.strip_prefix("mat")?.get(..3)?;
                let (columns, rows) = size.split_once('x')?;
                format!("mat{rows}x{columns}<f32>")
            }
            "determinant" => {
                let size = ["2", "3", "4"].into_iter().find(|n| self.text[first.clone()].contains(&format!("mat{n}x{n}")))?;
                format!("mat{size}x{size}<f32>")
            }
            _ => return None,
        };
        Some(vec![Edit::insert(first.start, format!("{ty}(")), Edit::insert(first.end, ")".to_owned())])
    }

    /// The type at a token, if it is a vector of two or of four 16-bit numbers: its components, and the number of the token behind it.
    fn half_vector(&self, n: usize, aliases: &HashMap<&'t str, Option<u32>>) -> Option<(u32, usize)> {
        match self.token(n)? {
            Token::Word("vec2h") => Some((2, n + 1)),
            Token::Word("vec4h") => Some((4, n + 1)),
            Token::Word(name @ ("vec2" | "vec4")) => {
                let names = [Token::Operator("<"), Token::Word("f16"), Token::Operator(">")];
                let is_half = (1..).zip(names).all(|(k, token)| self.token(n + k) == Some(token));
                is_half.then_some((if name == "vec2" { 2 } else { 4 }, n + 4))
            }
            Token::Word(name) => Some(((*aliases.get(name)?)?, n + 1)),
            _ => None,
        }
    }

    /// The components of each alias that stands for a vector of two or of four 16-bit numbers; none of other aliases.
    fn half_aliases(&self) -> HashMap<&'t str, Option<u32>> {
        let mut types: HashMap<&str, usize> = HashMap::new();
        for n in 0..self.tokens.len() {
            if let (Some(Token::Word("alias")), Some(Token::Word(name))) = (self.token(n), self.token(n + 1)) {
                types.insert(name, n + 3);
            }
        }
        let mut found: HashMap<&str, Option<u32>> = HashMap::new();
        for n in 0..self.tokens.len() {
            let (Some(Token::Word("alias")), Some(Token::Word(mut name))) = (self.token(n), self.token(n + 1)) else {
                continue;
            };
            // From alias to alias, until one is known. What is on the way counts as none, so that a circle has an end.
            let mut chain = Vec::new();
            let components = loop {
                if let Some(known) = found.get(name) {
                    break *known;
                }
                found.insert(name, None);
                chain.push(name);
                let ty = types[name];
                match self.token(ty) {
                    Some(Token::Word(next)) if types.contains_key(next) => name = next,
                    _ => break self.half_vector(ty, &found).map(|(components, _)| components),
                }
            };
            found.extend(chain.into_iter().map(|name| (name, components)));
        }
        found
    }

    /// `bitcast` to vectors of 16-bit numbers. naga forgets what the target's components are as wide as.
    pub fn half_targets(&self) -> Vec<Edit> {
        let mut edits = Vec::new();
        let mut needs_four = false;
        let (four, aliases) = (self.fresh("halves"), self.half_aliases());
        for n in 0..self.tokens.len() {
            if self.token(n) != Some(Token::Word("bitcast")) || self.token(n + 1) != Some(Token::Operator("<")) {
                continue;
            }
            let Some((count, end)) = self.half_vector(n + 2, &aliases) else { continue };
            let open = end + 1;
            let Some(close) = self.close(open).filter(|_| self.token(open) == Some(Token::Open('('))) else { continue };
            needs_four |= count == 4;
            let (head, tail) = match count {
                2 => ("vec2<f16>(unpack2x16float(bitcast<u32>(".to_owned(), ")))"),
                _ => (format!("{four}(bitcast<vec2<u32>>("), "))"),
            };
            edits.push(Edit::replace(self.at(n)..self.end(open), head));
            edits.push(Edit::replace(self.at(close)..self.end(close), tail));
        }
        if needs_four {
            let function = format!(
                "\nfn {four}(v: vec2<u32>) -> vec4<f16> {{ return vec4<f16>(vec2<f16>(unpack2x16float(v.x)), \
                 vec2<f16>(unpack2x16float(v.y))); }}"
            );
            edits.push(Edit::insert(self.text.len(), function));
        }
        edits
    }

    /// `bitcast` of vectors of 16-bit numbers to words: the call at a place, or else in the statement there, or else the last one before it.
    /// A function stands for it that takes nothing else, so that another call is never taken for it.
    pub fn half_source(&self, span: Range<usize>) -> Option<Vec<Edit>> {
        let first = self.number(span.start);
        let end = (first..self.tokens.len()).find(|&n| self.token(n) == Some(Token::Separator(';')))?;
        let aliases = self.half_aliases();
        let casts = |&n: &usize| {
            let to_half = self.half_vector(n + 2, &aliases).is_some();
            self.token(n) == Some(Token::Word("bitcast")) && self.token(n + 1) == Some(Token::Operator("<")) && !to_half
        };
        let n = (first..end).find(casts).or_else(|| (0..first).rev().find(casts))?;
        let open = (n..self.tokens.len()).find(|&n| self.token(n) == Some(Token::Open('(')))?;
        let close = self.close(open)?;
        let target = self.text[self.at(n + 2)..self.at(open)].trim_end().strip_suffix('>')?.trim();
        let components = if target.starts_with("vec2") { 4 } else { 2 };
        let function = self.fresh("words");
        let (result, value) = if components == 2 {
            ("u32", "pack2x16float(vec2<f32>(v))".to_owned())
        } else {
            ("vec2<u32>", "vec2<u32>(pack2x16float(vec2<f32>(v.xy)), pack2x16float(vec2<f32>(v.zw)))".to_owned())
        };
        Some(vec![
            Edit::replace(self.at(n)..self.end(open), format!("bitcast<{target}>({function}(")),
            Edit::replace(self.at(close)..self.end(close), "))"),
            Edit::insert(
                self.text.len(),
                format!("\nfn {function}(v: vec{components}<f16>) -> {result} {{ return {value}; }}"),
            ),
        ])
    }
}
