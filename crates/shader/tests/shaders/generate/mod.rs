//! Makes shader programs from choices: WGSL text with everything that it is bound to.
//!
//! A program ends by construction: every loop has a counter that only grows, with a small bound, and the work of one invocation
//! is counted while the text is made. A program has no races by construction: an invocation writes its own part of memory
//! (words of `out`, an element of `cells`, a texel), reads what others wrote only between two barriers, and changes what is
//! shared only by atomics that commute and whose results are not used.
//!
//! Faults of a compiler hide in what programs rarely do together. So each program first draws its [`Style`]: which of the
//! language's means it uses at all and how often, how many variables it has, whether they live to the end. Programs of one
//! style in a hundred lines differ more than programs that use a little of everything. Variables that die in a loop, and
//! conditions that the compiler cannot know, are the rule and not the exception. What a variable holds is stored on the way,
//! not at the end alone, so that a wrong value is seen where it arises, and the variable need not live on.

mod builtins;
mod control;
mod declarations;
mod expression;
mod memory;
mod random;
mod stages;
mod statement;
mod texture;
mod types;

use super::oracle::{Batch, Bindings};
pub use random::Random;
use types::{Scalar, Struct, Ty};

/// Words of `out` for each invocation.
pub const STRIDE: u32 = 16;

/// A generated program with what it is bound to.
#[derive(Clone, Debug)]
pub struct Program {
    pub source: String,
    pub stage: naga::ShaderStage,
    /// Values of pipeline constants.
    pub constants: Vec<(String, f64)>,
    pub bindings: Bindings,
    /// Workgroups of a dispatch.
    pub groups: [u32; 3],
    /// Inputs of a vertex or fragment stage.
    pub batch: Batch,
}

/// Which means a program uses: shares in a hundred, or numbers.
#[derive(Clone, Debug)]
struct Style {
    /// Variables at the beginning.
    variables: u32,
    /// Depth of expressions.
    depth: u32,
    /// Statements in all.
    statements: u32,
    /// Scalars: which types are used.
    scalars: Vec<Scalar>,
    /// Share of variables that are vectors, matrices, arrays, structures.
    composite: u32,
    /// Share of variables that are looked at once more at the end.
    final_looks: u32,
    /// Share of loops whose bound is known to the compiler.
    known_bounds: u32,
    /// Share of statements that are loops, ifs, switches, leaving.
    loops: u32,
    ifs: u32,
    switches: u32,
    leaves: u32,
    /// Helper functions.
    functions: u32,
    /// Share of statements that touch memory other than `out`.
    memory: u32,
    atomics: u32,
    barriers: bool,
    subgroups: bool,
    textures: u32,
    derivatives: bool,
    discards: bool,
    /// Early returns from the entry point. Without them (and without `barriers`) the flow of the whole program is uniform at
    /// its top.
    returns: bool,
    half: bool,
    /// Little more than loops.
    tight: bool,
    /// Everything, in long straight lines.
    broad: bool,
    /// Share of indices that are computed and may be out of range.
    wild: u32,
    /// Share of numeric expressions that are built-in functions.
    builtins: u32,
    puts: u32,
}

/// A name in scope.
#[derive(Clone, Debug)]
struct Item {
    text: String,
    ty: Ty,
    write: bool,
    /// Address space of what a pointer may be taken to.
    pointer: Option<&'static str>,
    /// Counters may grow, nothing else.
    counter: bool,
}

/// A function that can be called.
#[derive(Clone, Debug)]
struct Function {
    name: String,
    /// Types, and for pointers their address space.
    parameters: Vec<(Ty, Option<&'static str>)>,
    result: Option<Ty>,
    /// Work of a call.
    cost: u32,
}

/// What may be done at a place in the program.
#[derive(Clone, Debug, Default)]
struct Flow {
    can_break: bool,
    can_continue: bool,
    /// The function's result; none: it cannot return here.
    can_return: Option<Option<Ty>>,
    /// All invocations of the workgroup are here.
    uniform: bool,
    /// How often this place is reached, at most.
    turns: u32,
    /// Open blocks.
    depth: u32,
}

/// Work of an invocation, in statements, that no program exceeds by much.
const WORK: u32 = 1500;

/// The state of the generator.
struct Generator<'a, 'b> {
    r: &'a mut Random<'b>,
    style: Style,
    stage: naga::ShaderStage,
    structs: Vec<Struct>,
    /// Declarations before the functions.
    globals: String,
    /// Statements of the function being written.
    body: String,
    items: Vec<Item>,
    functions: Vec<Function>,
    /// Statements that may still be written.
    budget: u32,
    /// Work of an invocation so far.
    work: u32,
    fresh: u32,
    /// Indices in indices.
    nesting: u32,
    /// Counters declared before all other variables, for loops that are not open.
    counters: Vec<String>,
    /// How often the statement being written runs, at most.
    turns: u32,
    /// Texture bindings, by what they are.
    textures: Vec<texture::GeneratedTexture>,
    bindings: Bindings,
    constants: Vec<(String, f64)>,
    /// Invocations of a workgroup.
    size: u32,
    has: memory::Has,
}

/// Makes a program.
pub fn generate(r: &mut Random<'_>) -> Program {
    let (stage, style) = Style::draw(r);
    let g = Generator {
        r,
        budget: style.statements,
        style,
        stage,
        structs: Vec::new(),
        globals: String::new(),
        body: String::new(),
        items: Vec::new(),
        functions: Vec::new(),
        work: 0,
        fresh: 0,
        turns: 1,
        counters: Vec::new(),
        nesting: 0,
        textures: Vec::new(),
        bindings: Bindings::default(),
        constants: Vec::new(),
        size: 1,
        has: memory::Has::default(),
    };
    g.program()
}

impl Style {
    fn draw(r: &mut Random<'_>) -> (naga::ShaderStage, Style) {
        use naga::ShaderStage as S;
        let stage = *r.one(&[S::Compute, S::Compute, S::Compute, S::Compute, S::Compute, S::Fragment, S::Fragment, S::Vertex]);
        let half = r.percent(15);
        // Half of the programs are a few integers and loops: the rest of the language must not dilute what control flow does.
        let plain = r.percent(60);
        // And half of those are little more than a loop, so that every variable has few uses.
        let tight = plain && r.percent(50);
        let mut scalars = vec![Scalar::U32];
        if !plain || r.percent(30) {
            for (scalar, share) in [(Scalar::I32, 50), (Scalar::Bool, 40), (Scalar::F32, 60)] {
                if r.percent(share) {
                    scalars.push(scalar);
                }
            }
            if half {
                scalars.push(Scalar::F16);
            }
        }
        let some = |r: &mut Random<'_>, share: u32, most: u32| if !plain && r.percent(share) { 1 + r.below(most) } else { 0 };
        // And some use everything, in long straight lines.
        let broad = !plain && r.percent(30);
        if broad {
            scalars = vec![Scalar::U32, Scalar::I32, Scalar::F32, Scalar::Bool];
            if half {
                scalars.push(Scalar::F16);
            }
        }
        let style = Style {
            variables: 1 + r.below(if tight { 3 } else { 6 }),
            depth: if broad { 2 } else { r.below(if tight { 2 } else { 4 }) },
            statements: if tight { 12 + r.below(20) } else { 10 + r.below(60) },
            composite: some(r, 60, 70),
            final_looks: *r.one(&[0, 0, 30, 100]),
            known_bounds: *r.one(&[0, 10, 50, 100]),
            loops: if plain { 30 + r.below(90) } else { 8 + r.below(30) },
            ifs: 5 + r.below(30),
            switches: r.below(20),
            leaves: 30 + r.below(60),
            functions: if r.percent(50) { 1 + r.below(3) } else { 0 },
            memory: some(r, 60, 40),
            atomics: some(r, 30, 20),
            barriers: stage == S::Compute && r.percent(30),
            subgroups: !plain && r.percent(if broad { 50 } else { 12 }),
            textures: some(r, 35, 40),
            derivatives: stage == S::Fragment && r.percent(40),
            discards: stage == S::Fragment && r.percent(40),
            returns: r.percent(40),
            tight,
            broad,
            half,
            wild: *r.one(&[0, 20, 60]),
            builtins: if plain { r.below(10) } else { r.below(60) + if broad { 30 } else { 0 } },
            puts: r.below(40),
            scalars,
        };
        (stage, style)
    }
}
