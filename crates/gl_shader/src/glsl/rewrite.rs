//! Rewrites old GLSL dialects to version 4.50, which naga reads. Built-in names, attributes, varyings, uniforms and texture reads become
//! plain variables and functions, so that their meaning can be chosen later.

use std::collections::{BTreeMap, BTreeSet};

use super::blocks::{Block, is_row_major, members, variables};
use super::builtins::{self, Builtin};
use super::order::order;
use super::outline::{Item, initialiser, items};
use super::prelude;
use super::prepare::prepare;
use super::sampler::{Read, Sampler, read_of, sampler, stubs};
use super::specialise::specialise;
use super::tokens::{self, Dialect, Token, closing, parts};
use super::words::{LATER, RESERVED, component, is_type, number_in_brackets, signature};
use super::{TranslateResult, Wrong};
use crate::arb::program::ProgramStage;

/// Where a variable at global scope comes from or goes to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Storage {
    /// The program sets it.
    Uniform,
    /// It comes from the previous stage, or from the vertex.
    In,
    /// It goes to the next stage, or to the framebuffer.
    Out,
}

/// A global variable through which the stage gets or passes on values.
#[derive(Clone, Debug, PartialEq)]
pub struct Global {
    /// Its name in the source.
    pub name: String,
    /// Its name in the text for naga.
    pub renamed: String,
    /// Where it comes from or goes to.
    pub storage: Storage,
    /// `flat` or `noperspective`.
    pub interpolation: Option<&'static str>,
    /// The location that the source states.
    pub location: Option<u32>,
    /// The source of blending that the source states: 1 for the second one of its colour buffer.
    pub index: Option<u32>,
    /// The number of the uniform block that it is part of.
    pub block: Option<usize>,
}

/// A rewritten stage.
#[derive(Clone, Debug)]
pub struct RewrittenStage {
    /// The text for naga.
    pub text: String,
    /// Uniforms, inputs and outputs.
    pub globals: Vec<Global>,
    /// Samplers.
    pub samplers: Vec<Sampler>,
    /// Uniform blocks.
    pub blocks: Vec<Block>,
    /// Built-in names that occur, as in the text for naga.
    pub builtins: BTreeMap<String, Builtin>,
    /// Whether the position is that of the fixed-function pipeline.
    pub invariant: bool,
    /// Whether derivatives along y occur.
    pub flips: bool,
    /// Whether the position of a fragment is counted from the upper left corner, and whether centres of pixels are whole numbers.
    pub coordinates: [bool; 2],
    /// Maximum nesting of the tokens in that text.
    pub nesting: u64,
    /// Pairs of tokens of its functions.
    pub pairs: u64,
    /// The line of the source of each line of that text, after the first two.
    pub lines: Vec<u32>,
    /// Variables in that text that have an initialiser.
    pub initialised: BTreeSet<String>,
    /// Functions in the text for naga that stand for texture reads: their names, samplers, kinds of read.
    pub reads: BTreeMap<String, (usize, Read)>,
}

/// The factor of derivatives along y: rows of the card go down in a window.
pub const FLIP: &str = "glx_flip";

struct Rewriter {
    stage: ProgramStage,
    dialect: Dialect,
    out: Vec<Token>,
    source: RewrittenStage,
    /// Names at global scope that have been declared.
    declared: BTreeSet<String>,
    /// Words in the bodies of structures.
    members: BTreeSet<String>,
    /// Arrays of samplers: the number of the first sampler of each, and how many they are.
    arrays: BTreeMap<String, (usize, usize)>,
    /// Functions that have been declared: their names and the types of their parameters.
    functions: BTreeSet<String>,
    /// Names of all functions of the shaders.
    names: BTreeSet<String>,
    /// Functions of the prelude that are called.
    helpers: BTreeSet<String>,
}

/// Words of layouts that change nothing here, or that other code reads.
const HARMLESS: [&str; 9] =
    ["std140", "shared", "packed", "column_major", "row_major", "depth_any", "depth_greater", "depth_less", "depth_unchanged"];

/// Maximum number of samplers in an array.
const SAMPLERS_MAX: usize = 64;

/// Rewrites the shaders of one stage: dialect and tokens of each.
pub fn rewrite(stage: ProgramStage, shaders: Vec<(Dialect, Vec<Token>)>) -> TranslateResult<RewrittenStage> {
    let source = RewrittenStage {
        text: String::new(),
        globals: Vec::new(),
        samplers: Vec::new(),
        blocks: Vec::new(),
        builtins: BTreeMap::new(),
        invariant: false,
        flips: false,
        coordinates: [false; 2],
        nesting: 0,
        pairs: 0,
        lines: Vec::new(),
        initialised: BTreeSet::new(),
        reads: BTreeMap::new(),
    };
    let dialect = shaders.first().map_or(Dialect { version: 110, embedded: false }, |&(dialect, _)| dialect);
    let (mut members, mut shaders) = (BTreeSet::new(), shaders);
    drop_undefined(&mut shaders);
    for (_, tokens) in &mut shaders {
        name_structures(tokens);
    }
    for (_, tokens) in &shaders {
        for (at, _) in tokens.iter().enumerate().filter(|(_, token)| token.is("struct")) {
            let open = tokens[at..].iter().position(|token| token.is("{")).map(|k| at + k);
            let body = open.and_then(|open| Some(&tokens[open..closing(tokens, open)?]));
            members.extend(body.into_iter().flatten().map(|token| token.text.clone()));
        }
    }
    let mut rewriter = Rewriter {
        stage,
        dialect,
        out: Vec::new(),
        source,
        declared: BTreeSet::new(),
        members,
        arrays: BTreeMap::new(),
        functions: BTreeSet::new(),
        names: BTreeSet::new(),
        helpers: BTreeSet::new(),
    };
    rewriter.invariant(&mut shaders);
    let mut first = 0;
    for (_, tokens) in &mut shaders {
        // Lines of the second shader follow those of the first.
        tokens.iter_mut().for_each(|token| token.line += first);
        first = tokens.last().map_or(first, |token| token.line);
    }
    let prepared = prepare(&mut shaders, &rewriter.members);
    rewriter.names = prepared.functions;
    specialise(&mut shaders)?;
    let shaders = order(shaders, prepared.moved)?;
    for (dialect, tokens) in shaders {
        rewriter.dialect = dialect;
        rewriter.globals(&tokens)?;
    }
    let kept: Vec<String> = prepared.kept.iter().map(|name| rewriter.rename(name)).collect();
    rewriter.source.initialised.extend(kept);
    Ok(rewriter.finish())
}

/// Whether this is a type of samplers or images that the machine does not have.
fn is_other_sampler(name: &str) -> bool {
    let stem = name.strip_prefix(['i', 'u']).unwrap_or(name);
    let rest = ["sampler", "image"].iter().find_map(|start| stem.strip_prefix(start));
    let shape = rest.is_some_and(|rest| ["1D", "2D", "3D", "Cube", "Buffer"].iter().any(|shape| rest.starts_with(shape)));
    shape && sampler(name).is_none()
}

/// Removes prototypes of functions that no shader defines and none calls.
fn drop_undefined(shaders: &mut [(Dialect, Vec<Token>)]) {
    let (mut defined, mut words) = (BTreeSet::new(), BTreeMap::<String, isize>::new());
    for (_, tokens) in shaders.iter() {
        for item in items(tokens).into_iter().filter(|item| item.body(tokens).is_some()) {
            defined.extend(item.function.map(|header| tokens[header.name].text.clone()));
        }
    }
    let name_of = |tokens: &[Token], item: &Item| {
        let header = item.function?;
        let prototype = header.close + 2 == item.whole.end && tokens[item.whole.end - 1].is(";");
        let name = &tokens[header.name];
        let undefined = prototype && header.name > item.whole.start && name.word && !defined.contains(&name.text);
        undefined.then(|| name.text.clone())
    };
    for (_, tokens) in shaders.iter() {
        for name in items(tokens).iter().filter_map(|item| name_of(tokens, item)) {
            *words.entry(name).or_default() += 1;
        }
    }
    if words.is_empty() {
        return;
    }
    for (_, tokens) in shaders.iter() {
        for pair in tokens.windows(2).filter(|pair| pair[1].is("(")) {
            // A call is one more than the prototypes: its function is missed later.
            if let Some(left) = words.get_mut(&pair[0].text) {
                *left -= 1;
            }
        }
    }
    for (_, tokens) in shaders {
        let gone = |item: &Item| name_of(tokens, item).is_some_and(|name| words.get(&name) == Some(&0));
        let gone: Vec<_> = items(tokens).into_iter().filter(gone).map(|item| item.whole).collect();
        for range in gone.into_iter().rev() {
            tokens.drain(range);
        }
    }
}

/// Gives names to structures without one, as naga wants.
fn name_structures(tokens: &mut Vec<Token>) {
    let nameless = |pair: &[Token]| pair[0].is("struct") && pair[1].is("{");
    if !tokens.windows(2).any(nameless) {
        return;
    }
    let mut out: Vec<Token> = Vec::with_capacity(tokens.len());
    for token in std::mem::take(tokens) {
        if token.is("{") && out.last().is_some_and(|before| before.is("struct")) {
            out.push(Token::new(format!("glx_nameless{}", out.len()), token.line));
        }
        out.push(token);
    }
    *tokens = out;
}

impl Rewriter {
    /// Checks whether the only use of the position is `gl_Position = ftransform();` directly in the block of `main`, and removes that
    /// statement.
    fn invariant(&mut self, shaders: &mut [(Dialect, Vec<Token>)]) {
        let count = |name: &str| shaders.iter().flat_map(|(_, tokens)| tokens).filter(|token| token.is(name)).count();
        if self.stage != ProgramStage::Vertex
            || count("gl_Position") != 1
            || count("gl_ClipVertex") != 0
            || count("return") != 0
        {
            return;
        }
        let wanted = ["gl_Position", "=", "ftransform", "(", ")", ";"];
        for (_, tokens) in shaders {
            let at = tokens.windows(wanted.len()).position(|part| part.iter().zip(wanted).all(|(token, text)| token.is(text)));
            if let Some(at) = at {
                let depth = |open: &str| tokens[..at].iter().filter(|token| token.is(open)).count();
                if depth("{") == depth("}") + 1 && tokens[at - 1].text != ")" && tokens[at - 1].text != "else" {
                    tokens.drain(at..at + wanted.len());
                    self.source.invariant = true;
                }
            }
        }
    }

    /// Rewrites the declarations at global scope.
    fn globals(&mut self, tokens: &[Token]) -> TranslateResult {
        let mut at = 0;
        while at < tokens.len() {
            let line = tokens[at].line;
            let missing = || Wrong::at(line, "a declaration without an end");
            let semicolon =
                |from: usize| tokens[from..].iter().position(|token| token.is(";")).map(|k| from + k).ok_or_else(missing);
            if tokens[at].is(";") {
                at += 1;
                continue;
            }
            if tokens[at].is("precision") {
                at = semicolon(at)? + 1;
                continue;
            }
            let start = at;
            let mut storage = None;
            let (mut interpolation, mut location, mut index, mut invariant) = (None, None, None, false);
            let (mut binding, mut row_major, mut coordinates) = (None, false, [false; 2]);
            while let Some(token) = tokens.get(at) {
                match token.text.as_str() {
                    "attribute" => storage = Some(Storage::In),
                    "varying" if self.stage == ProgramStage::Vertex => storage = Some(Storage::Out),
                    "varying" => storage = Some(Storage::In),
                    "uniform" => storage = Some(Storage::Uniform),
                    "in" => storage = Some(Storage::In),
                    "out" => storage = Some(Storage::Out),
                    "flat" => interpolation = Some("flat"),
                    "noperspective" => interpolation = Some("linear"),
                    "smooth" | "centroid" | "highp" | "mediump" | "lowp" | "precise" => {}
                    "invariant" => invariant = true,
                    "layout" if tokens.get(at + 1).is_some_and(|token| token.is("(")) => {
                        let end = closing(tokens, at + 1).ok_or_else(missing)?;
                        row_major |= is_row_major(&tokens[at..end]);
                        for part in parts(&tokens[at + 2..end]) {
                            match part {
                                [name, equals, value] if name.is("location") && equals.is("=") => {
                                    location = value.text.parse().ok();
                                }
                                [name, equals, value] if name.is("index") && equals.is("=") => {
                                    index = value.text.parse().ok();
                                }
                                [name, equals, value] if name.is("binding") && equals.is("=") => {
                                    binding = value.text.parse().ok();
                                }
                                [name] if name.is("origin_upper_left") => coordinates[0] = true,
                                [name] if name.is("pixel_center_integer") => coordinates[1] = true,
                                [name] if HARMLESS.contains(&name.text.as_str()) => {}
                                [] => {}
                                [name, ..] => {
                                    let what = format!("layout({}) of this form is not supported", name.text);
                                    return Err(Wrong::at(name.line, what));
                                }
                            }
                        }
                        at = end;
                    }
                    _ => break,
                }
                at += 1;
            }
            let Some(storage) = storage else {
                if invariant {
                    at = semicolon(at)? + 1;
                    continue;
                }
                at = self.own(tokens, start)?;
                continue;
            };
            if tokens.get(at).is_some_and(|token| token.is(";")) {
                // `layout(row_major) uniform;` would change the blocks that follow.
                if row_major {
                    return Err(Wrong::at(line, "row_major in a uniform block is not supported"));
                }
                continue;
            }
            let mut kind = tokens
                .get(at)
                .filter(|token| token.word)
                .ok_or_else(|| Wrong::at(line, "a declaration without a type"))?
                .clone();
            if kind.is("struct") {
                let open = at + tokens[at..].iter().position(|token| token.is("{")).ok_or_else(missing)?;
                let end = closing(tokens, open).ok_or_else(missing)?;
                kind = tokens
                    .get(at + 1)
                    .filter(|_| open == at + 2)
                    .ok_or_else(|| Wrong::at(line, "a structure without a name"))?
                    .clone();
                let body = self.body(&tokens[at..=end])?;
                self.out.extend(body);
                self.out.push(Token::new(";", tokens[end].line));
                at = end;
            } else if tokens.get(at + 1).is_some_and(|token| token.is("{")) {
                if storage != Storage::Uniform {
                    return Err(Wrong::at(line, format!("the interface block {} is not supported", kind.text)));
                }
                if row_major {
                    return Err(Wrong::at(line, "row_major in a uniform block is not supported"));
                }
                at = self.block(tokens, at, Block { name: kind.text, binding })?;
                continue;
            }
            let end = semicolon(at)?;
            let mut names = &tokens[at + 1..end];
            // `vec4[2] name`
            let mut count: &[Token] = &[];
            if names.first().is_some_and(|token| token.is("[")) {
                let close = closing(names, 0).ok_or_else(missing)?;
                (count, names) = names.split_at(close + 1);
            }
            for declarator in parts(names) {
                let name = declarator.first().filter(|token| token.word).ok_or_else(missing)?;
                if name.is("gl_FragCoord") {
                    let all = &mut self.source.coordinates;
                    *all = [all[0] || coordinates[0], all[1] || coordinates[1]];
                }
                if name.text.starts_with("gl_") || !self.declared.insert(name.text.clone()) {
                    continue;
                }
                if let Some((target, dimensions, shadow)) = sampler(&kind.text) {
                    let one = Sampler { name: name.text.clone(), target, dimensions, shadow, location };
                    let brackets = [&declarator[1..], count].concat();
                    if brackets.is_empty() {
                        self.source.samplers.push(one);
                        continue;
                    }
                    let Some(count) =
                        number_in_brackets(&brackets).filter(|&count| brackets.len() == 3 && count <= SAMPLERS_MAX)
                    else {
                        let what =
                            format!("the array {} of samplers, whose size is no number up to {SAMPLERS_MAX},", name.text);
                        return Err(Wrong::at(line, format!("{what} is not supported")));
                    };
                    self.arrays.insert(name.text.clone(), (self.source.samplers.len(), count));
                    self.source.samplers.extend((0..count).map(|k| Sampler {
                        name: format!("{}[{k}]", name.text),
                        location: location.map(|first| first + k as u32),
                        ..one.clone()
                    }));
                    continue;
                }
                if kind.text.contains("sampler") || kind.text.contains("image") {
                    return Err(Wrong::at(line, format!("the type {} is not supported", kind.text)));
                }
                let mut declaration = vec![kind.clone()];
                declaration.extend_from_slice(count);
                declaration.extend_from_slice(declarator);
                declaration.push(Token::new(";", tokens[end].line));
                let body = self.body(&declaration)?;
                self.out.extend(body);
                let renamed = self.rename(&name.text);
                if initialiser(declarator).is_some() {
                    self.source.initialised.insert(renamed.clone());
                }
                let name = name.text.clone();
                self.source.globals.push(Global { name, renamed, storage, interpolation, location, index, block: None });
            }
            at = end + 1;
        }
        Ok(())
    }

    /// Rewrites a uniform block, whose name is at `at`; returns the position after it. Without a name of an instance its members are
    /// variables of their own, or else those of a structure.
    fn block(&mut self, tokens: &[Token], at: usize, block: Block) -> TranslateResult<usize> {
        let line = tokens[at].line;
        let missing = || Wrong::at(line, "a declaration without an end");
        let close = closing(tokens, at + 1).ok_or_else(missing)?;
        let end = tokens[close..].iter().position(|token| token.is(";")).map(|k| close + k).ok_or_else(missing)?;
        let members = members(&tokens[at + 2..close])?;
        let number = self.source.blocks.len();
        self.members.extend(tokens[at + 2..close].iter().map(|token| token.text.clone()));
        let Some(variables) = variables(number, members, &tokens[close + 1..end]) else {
            return Err(Wrong::at(line, format!("the array of the uniform block {} is not supported", block.name)));
        };
        for (declaration, name) in variables {
            let body = self.body(&declaration)?;
            self.out.extend(body);
            let renamed = self.rename(&name);
            let (storage, interpolation, location, index) = (Storage::Uniform, None, None, None);
            let name = format!("{}.{name}", block.name);
            self.source.globals.push(Global { name, renamed, storage, interpolation, location, index, block: Some(number) });
        }
        self.source.blocks.push(block);
        Ok(end + 1)
    }

    /// Rewrites a function, a structure, or a plain global variable; returns the position after it.
    fn own(&mut self, tokens: &[Token], start: usize) -> TranslateResult<usize> {
        let line = tokens[start].line;
        let mut at = start;
        let mut function = false;
        let mut header = None;
        loop {
            let token = tokens.get(at).ok_or_else(|| Wrong::at(line, "a declaration without an end"))?;
            match token.text.as_str() {
                "(" | "[" => {
                    let end = closing(tokens, at).ok_or_else(|| Wrong::at(token.line, "a bracket that is not closed"))?;
                    if token.is("(") && !function {
                        // Naga refuses a bracket without a name before it.
                        function = at > start && !tokens[start..at].iter().any(|token| token.is("="));
                        header = function.then(|| signature(&tokens[at - 1], &tokens[at + 1..end]));
                    }
                    at = end;
                }
                "{" => {
                    at = closing(tokens, at).ok_or_else(|| Wrong::at(token.line, "a bracket that is not closed"))?;
                    if function {
                        break;
                    }
                }
                ";" => break,
                _ => {}
            }
            at += 1;
        }
        if let Some(header) = header {
            // Naga accepts a prototype once, and none after the function.
            let known = !self.functions.insert(header);
            if known && tokens[at].is(";") {
                return Ok(at + 1);
            }
        }
        let body = self.body(&tokens[start..=at])?;
        self.out.extend(body);
        Ok(at + 1)
    }

    /// Renames a name that is reserved in version 4.50.
    fn rename(&self, name: &str) -> String {
        // `mat2x3` is a type since version 1.20.
        let matrix = self.dialect.version < 120
            && !self.dialect.embedded
            && name.starts_with("mat")
            && name.contains('x')
            && is_type(name);
        let later = self.dialect.version < 130 && LATER.contains(&name) || matrix;
        if later || RESERVED.contains(&name) { format!("{name}_") } else { name.to_owned() }
    }

    /// Tokens in naga's dialect.
    fn body(&mut self, tokens: &[Token]) -> TranslateResult<Vec<Token>> {
        let mut out: Vec<Token> = Vec::with_capacity(tokens.len());
        let mut at = 0;
        while let Some(token) = tokens.get(at) {
            let line = token.line;
            at += 1;
            if !token.word || at >= 2 && tokens[at - 2].is(".") {
                let written = tokens
                    .get(at)
                    .is_some_and(|next| matches!(next.text.as_str(), "=" | "+=" | "-=" | "*=" | "/=" | "++" | "--"));
                match component(&token.text).filter(|_| written && out.len() >= 2 && !self.members.contains(&token.text)) {
                    // naga cannot write a component of a matrix's column by its name.
                    Some(component) if out[out.len() - 1].is(".") && out[out.len() - 2].is("]") => {
                        out.pop();
                        out.extend(["[", component, "]"].map(|text| Token::new(text, line)));
                    }
                    _ if token.word => out.push(Token::new(self.rename(&token.text), line)),
                    _ => out.push(token.clone()),
                }
                continue;
            }
            let called = tokens.get(at).is_some_and(|token| token.is("("));
            let arguments = |open: usize| -> TranslateResult<usize> {
                closing(tokens, open).ok_or_else(|| Wrong::at(line, "a bracket that is not closed"))
            };
            match token.text.as_str() {
                "highp" | "mediump" | "lowp" | "invariant" | "precise" => {}
                "precision" => {
                    while tokens.get(at).is_some_and(|token| !token.is(";")) {
                        at += 1;
                    }
                    at += 1;
                }
                "ftransform" if called => {
                    self.builtin("ModelViewProjectionMatrix", line)?;
                    self.builtin("Vertex", line)?;
                    let text = ["(", "glx_ModelViewProjectionMatrix", "*", "glx_Vertex", ")"];
                    out.extend(text.map(|text| Token::new(text, line)));
                    at = arguments(at)? + 1;
                }
                "dFdy" if called => {
                    self.source.flips = true;
                    let end = arguments(at)?;
                    out.extend(["(", FLIP, "*", "dFdy"].map(|text| Token::new(text, line)));
                    let inner = self.body(&tokens[at..=end])?;
                    out.extend(inner);
                    out.push(Token::new(")", line));
                    at = end + 1;
                }
                // Naga does not have both in one parameter.
                "in" if out.last().is_some_and(|before| before.is("const")) => {}
                name if called && !self.names.contains(name) && prelude::renamed(name).is_some() => {
                    let name = prelude::renamed(name).unwrap_or_default();
                    out.push(Token::new(name.clone(), line));
                    self.helpers.insert(name);
                }
                name if name.starts_with("gl_") => {
                    let mut name = name["gl_".len()..].to_owned();
                    if matches!(name.as_str(), "TexCoord" | "FragData") {
                        let index = match tokens.get(at..at + 3) {
                            Some([open, index, close]) if open.is("[") && close.is("]") => index.text.parse::<u32>().ok(),
                            _ => None,
                        };
                        let Some(index) = index else {
                            return Err(Wrong::at(line, format!("gl_{name} without a number in brackets is not supported")));
                        };
                        name = format!("{name}_{index}");
                        at += 3;
                    }
                    self.builtin(&name, line)?;
                    out.push(Token::new(format!("glx_{name}"), line));
                }
                name if is_other_sampler(name) && tokens.get(at).is_some_and(|token| token.word) => {
                    return Err(Wrong::at(line, format!("the type {name} is not supported")));
                }
                name => {
                    let first = if called { self.sampler_of(&tokens[at + 1..], line)? } else { None };
                    match (read_of(name), first) {
                        (Some((read, number)), Some((sampler, length))) => {
                            let end = arguments(at)?;
                            let of = &self.source.samplers[sampler];
                            let one = of.shadow && number;
                            let word = of.name.replace('[', "_at").replace(']', "_");
                            let name = format!("glx_{read:?}{}_{word}x", if one { "One" } else { "" });
                            self.source.reads.insert(name.clone(), (sampler, read));
                            out.push(Token::new(name, line));
                            out.push(tokens[at].clone());
                            let rest = at + 1 + length;
                            let rest = rest + usize::from(tokens[rest].is(","));
                            let inner = self.body(&tokens[rest..=end])?;
                            out.extend(inner);
                            at = end + 1;
                        }
                        (None, Some(_)) => {
                            return Err(Wrong::at(line, format!("the function {name} with a sampler is not supported")));
                        }
                        _ => out.push(Token::new(self.rename(name), line)),
                    }
                }
            }
        }
        Ok(out)
    }

    /// The sampler that these tokens begin with, and how many of them name it.
    fn sampler_of(&self, tokens: &[Token], line: u32) -> TranslateResult<Option<(usize, usize)>> {
        let Some(name) = tokens.first() else { return Ok(None) };
        if let Some(&(first, count)) = self.arrays.get(&name.text) {
            let Some(k) = number_in_brackets(&tokens[1..]) else {
                let what = format!("the array {} of samplers with an index that is no number is not supported", name.text);
                return Err(Wrong::at(line, what));
            };
            if k >= count {
                return Err(Wrong::at(line, format!("element {k} of the array {} of {count} samplers", name.text)));
            }
            return Ok(Some((first + k, 4)));
        }
        Ok(self.source.samplers.iter().position(|known| name.is(&known.name)).map(|sampler| (sampler, 1)))
    }

    fn builtin(&mut self, name: &str, line: u32) -> TranslateResult {
        let Some(builtin) = builtins::find(self.stage, name) else {
            return Err(Wrong::at(line, format!("gl_{name} is not supported")));
        };
        self.source.builtins.insert(format!("glx_{name}"), builtin);
        Ok(())
    }

    fn finish(self) -> RewrittenStage {
        let Rewriter { mut source, out, helpers, .. } = self;
        // All on the second line, so that lines of the source stay countable.
        let mut text = String::from("#version 450\n");
        let mut structures = BTreeSet::new();
        for (name, builtin) in &source.builtins {
            if structures.insert(builtin.structure) {
                text += builtin.structure;
            }
            match (&builtin.role, builtin.count) {
                (builtins::Role::Constant(value), _) => text += &format!("{} {name} = {value};", builtin.kind),
                (_, Some(count)) => text += &format!("{} {name}[{count}];", builtin.kind),
                _ => text += &format!("{} {name};", builtin.kind),
            }
        }
        if source.flips {
            text += &format!("float {FLIP};");
        }
        for (name, &(sampler, read)) in &source.reads {
            stubs(name, &source.samplers[sampler], read, &mut text);
        }
        let mut prelude = String::new();
        helpers.iter().for_each(|name| prelude::text(name, &mut prelude));
        text += &prelude.replace('\n', " ");
        text.push('\n');
        let (printed, lines) = tokens::lines(&out);
        source.text = text + &printed;
        source.lines = lines;
        source.nesting = tokens::nesting(&out);
        source.pairs = tokens::pairs(&out);
        source
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A function's bracket follows its name; at the start of a shader there is no name.
    #[test]
    fn a_bracket_at_the_start_of_a_shader_is_no_function() {
        for text in ["(1)\nvoid main() {}", "(sampler2D s)\nvoid main() {}"] {
            let source = rewrite(ProgramStage::Fragment, vec![tokens::preprocess(text).expect("tokens")])
                .expect("text for naga to refuse");
            assert!(source.text.contains("main"), "{}", source.text);
        }
    }
}
