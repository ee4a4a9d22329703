//! The shaders of a stage as one text of version 4.50, which naga reads. Built-in names, attributes, varyings, uniforms and texture reads
//! become plain variables and functions, so that their meaning can be chosen later.

use std::collections::{BTreeMap, BTreeSet};

use super::TranslateResult;
use super::arrays::{globals, reach};
use super::blocks::Block;
use super::builtins::{self, Builtin};
use super::flow::returns;
use super::link::join;
use super::lower::Lowering;
use super::parse::parse;
use super::prelude;
use super::sampler::{Read, Sampler, stubs};
use super::scope::Functions;
use super::tokens::{self, Dialect, Token};
use super::tree::{Expr, ExprKind, Item, Statement, StatementKind};
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
#[derive(Clone, Debug, Default)]
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
    /// True if the position is that of the fixed-function pipeline.
    pub invariant: bool,
    /// True if derivatives along y occur.
    pub flips: bool,
    /// True if the position of a fragment is counted from the upper left corner, and true if centres of pixels are whole numbers.
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

/// A shader object.
#[derive(Clone, Debug)]
pub struct Shader {
    /// Its dialect.
    pub dialect: Dialect,
    /// Its declarations.
    pub items: Vec<Item>,
}

/// Rewrites the shaders of one stage: dialect and tokens of each.
///
/// # Errors
/// If a shader is wrong or is not supported.
pub fn rewrite(stage: ProgramStage, texts: Vec<(Dialect, Vec<Token>)>) -> TranslateResult<RewrittenStage> {
    let count = |name: &str| texts.iter().flat_map(|(_, tokens)| tokens).filter(|token| token.is(name)).count();
    // The only use of the position may be that of the fixed-function pipeline.
    let uses = ["gl_Position", "gl_ClipVertex", "return"].map(count);
    let (mut shaders, mut first) = (Vec::new(), 0);
    for (number, (dialect, mut tokens)) in texts.into_iter().enumerate() {
        // Lines of the second shader follow those of the first.
        tokens.iter_mut().for_each(|token| token.line += first);
        first = tokens.last().map_or(first, |token| token.line);
        shaders.push(Shader { dialect, items: parse(dialect, &tokens, number)? });
    }
    let invariant = stage == ProgramStage::Vertex && uses == [1, 0, 0] && take_invariant(&mut shaders);
    for item in shaders.iter_mut().flat_map(|shader| &mut shader.items) {
        if let Item::Function(of) = item {
            returns(of);
        }
    }
    let reach = reach(&shaders);
    globals(&mut shaders, &reach);
    let dialects: Vec<Dialect> = shaders.iter().map(|shader| shader.dialect).collect();
    let functions = Functions::of(&shaders);
    let joined = join(shaders)?;
    let mut lowering = Lowering::new(stage, functions, reach);
    lowering.source.invariant = invariant;
    lowering.variables(joined.variables, &dialects)?;
    let functions = lowering.functions(joined.functions, &dialects)?;
    let out = [lowering.out.out, lowering.comparisons.out, functions].concat();
    Ok(finish(lowering.source, &lowering.helpers, &out))
}

/// Removes `gl_Position = ftransform();` if it stands directly in the block of a function. Returns true if it was there.
fn take_invariant(shaders: &mut [Shader]) -> bool {
    let is_wanted = |of: &Statement| {
        let StatementKind::Expression(Expr { kind: ExprKind::Assign("=", target, value), .. }) = &of.kind else { return false };
        let call = matches!(&value.kind, ExprKind::Call(name, _, arguments) if name == "ftransform" && arguments.is_empty());
        target.as_name() == Some("gl_Position") && call
    };
    for item in shaders.iter_mut().flat_map(|shader| &mut shader.items) {
        if let Item::Function(of) = item
            && let Some(body) = &mut of.body
            && let Some(at) = body.iter().position(is_wanted)
        {
            body.remove(at);
            return true;
        }
    }
    false
}

/// The text of a stage with what it needs before it.
fn finish(mut source: RewrittenStage, helpers: &BTreeSet<String>, out: &[Token]) -> RewrittenStage {
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
    let mut before = String::new();
    helpers.iter().for_each(|name| prelude::text(name, &mut before));
    text += &before.replace('\n', " ");
    text.push('\n');
    let (printed, lines) = tokens::lines(out);
    source.text = text + &printed;
    source.lines = lines;
    source.nesting = tokens::nesting(out);
    source.pairs = tokens::pairs(out);
    source
}
