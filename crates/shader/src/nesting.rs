//! How deep a WGSL text is nested and how far its constants reach, found before naga reads it.
//!
//! naga's front end calls itself for nested constructs, copies the value of a constant to each use, and calls itself for each declaration
//! that another one needs. So a short text can take any amount of stack and memory. One pass over the tokens finds bounds of both. It
//! knows no grammar except brackets, operators and the names that are declared. Its bounds are never too small for a valid text; naga
//! refuses an invalid one.

use std::collections::HashMap;

use super::graph::{Graph, Reach};
use super::module::ShaderLocation;
use super::tokens::{Token, Tokens};
use super::zeros::{Zero, Zeros};
use num::{LimitExceeded, Limits};

/// Why a text is refused, and where.
pub(super) type Refusal = (ShaderLocation, String);

/// The size of a text.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Extent {
    /// Levels of nesting.
    pub nesting: u64,
    /// Declarations at the top.
    pub declarations: u64,
    /// Tokens, with constants and zero values of arrays written out.
    pub tokens: u64,
    /// Pairs of tokens of one function, for all functions together: see [`pairs`].
    pub pairs: u64,
    /// Where brackets and operators are nested deepest.
    pub deepest: ShaderLocation,
}

/// Pairs of tokens of a function that has `own` tokens, and `all` with constants written out. For each expression that it reads, naga goes
/// over those that the function has so far. Constants at the top count as one function.
pub(super) fn pairs(own: u64, all: u64) -> u64 {
    own.saturating_mul(all.max(own))
}

/// The state of the scan between an opening bracket and its closing one.
#[derive(Default)]
struct Level {
    /// Brackets and operators around.
    outside: u64,
    /// Operators since the last separator: the left operand of each may be all text before it.
    operators: u64,
    /// Nesting of the brackets since the last separator.
    inside: u64,
    /// The deepest so far.
    deepest: u64,
    /// A block has just ended, and the statement with it unless `else` comes.
    after_block: bool,
    /// Names of `for` loops that have begun and not ended.
    loops: u32,
    /// A local declaration that has begun: it holds from the next separator on.
    declaring: Option<(u32, u32)>,
}

impl Level {
    fn depth(&self) -> u64 {
        self.operators + self.inside
    }

    fn separate(&mut self) {
        self.deepest = self.deepest.max(self.depth());
        (self.operators, self.inside, self.after_block) = (0, 0, false);
    }
}

/// Which name is declared next.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Expected {
    Nothing,
    /// After `fn`, `struct`, `alias`, `const`, `override`.
    Name,
    /// After `var`: a template list may come first.
    Variable,
    /// In the template list of a `var`, which names no declaration.
    Template,
}

/// The pass over a text.
struct Scan<'t> {
    text: &'t str,
    tokens: Vec<(usize, Token<'t>)>,
    graph: Graph,
    /// Names at the top, and where they stand.
    tops: HashMap<&'t str, u32>,
    /// Names that are declared inside a function: those that hold now, innermost last.
    locals: HashMap<&'t str, Vec<u32>>,
    /// What each open scope has declared.
    scopes: Vec<Vec<&'t str>>,
    /// Uses of names that are not local: user and name.
    uses: Vec<(u32, &'t str)>,
    levels: Vec<Level>,
    /// The declaration at the top that the scan is in.
    top: u32,
    /// The tokens before it.
    begun: usize,
    /// Declarations at the top whose expressions count: the first node, its own tokens, and whether it is a function.
    measured: Vec<(u32, u64, bool)>,
    /// The declaration that tokens belong to: the same, or a local one in it.
    node: u32,
    /// Word that begins the declaration at the top.
    keyword: &'t str,
    expected: Expected,
    /// The name that a local declaration has, until it holds.
    name: &'t str,
    /// Which tokens name declarations: those at the top, and those of constants in functions.
    names: HashMap<u32, usize>,
    /// Which local declaration a token names.
    mentions: HashMap<usize, u32>,
    zeros: Vec<Zero>,
}

/// Checks a text against the limits.
///
/// # Errors
/// If it is nested deeper, has more declarations, or its constants reach further than the limits allow.
pub(super) fn check(text: &str, limits: &Limits) -> Result<Extent, Refusal> {
    let mut scan = Scan {
        text,
        tokens: Vec::new(),
        graph: Graph::default(),
        tops: HashMap::new(),
        locals: HashMap::new(),
        scopes: vec![Vec::new()],
        uses: Vec::new(),
        levels: vec![Level::default()],
        top: 0,
        begun: 0,
        measured: Vec::new(),
        node: 0,
        keyword: "",
        expected: Expected::Nothing,
        name: "",
        names: HashMap::new(),
        mentions: HashMap::new(),
        zeros: Vec::new(),
    };
    scan.begin(0);
    let mut declarations = 0;
    let mut deepest = (0, 0);
    let mut before = Token::Other;
    let mut stream = Tokens::new(text).peekable();
    while let Some((at, token)) = stream.next() {
        let refuse = |error: LimitExceeded| (place(text, at), error.to_string());
        scan.tokens.push((at, token));
        limits.shader_constants.check(scan.tokens.len() as u64).map_err(refuse)?;
        if scan.keyword.is_empty() && !matches!(token, Token::Close(_) | Token::Separator(_)) {
            declarations += 1;
            limits.shader_declarations.check(declarations).map_err(refuse)?;
        }
        let next = stream.peek().map(|(_, next)| *next);
        if token == Token::Open('(') && next == Some(Token::Close(')')) {
            scan.zeros.push(Zero { bracket: scan.tokens.len() - 1, node: scan.node });
        }
        scan.token(at, token, before, next == Some(Token::Separator(':')));
        let depth = scan.levels.last().map_or(0, |level| level.outside + level.depth());
        limits.shader_nesting.check(depth).map_err(refuse)?;
        if depth > deepest.0 {
            deepest = (depth, at);
        }
        before = token;
    }
    scan.end();
    for (user, name) in std::mem::take(&mut scan.uses) {
        if let Some(&used) = scan.tops.get(name) {
            scan.graph.uses(user, used);
        }
    }
    // Types and constants that are part of a length are followed as deep as they are nested.
    for (node, Reach { depth, .. }) in scan.graph.reaches().into_iter().enumerate() {
        limits.shader_nesting.check(depth).map_err(|error| reaches_too_far(text, scan.graph.nodes[node].at, &error))?;
    }
    scan.count_zeros()?;
    let mut out = Extent { nesting: 0, declarations, tokens: 0, pairs: 0, deepest: place(text, deepest.1) };
    let reaches = scan.graph.reaches();
    for (node, Reach { depth, size, .. }) in reaches.iter().copied().enumerate() {
        let own = scan.graph.nodes[node];
        out.nesting = out.nesting.max(depth);
        // A type is stored once, whatever its size; a constant is copied to each use.
        out.tokens = out.tokens.saturating_add(if own.is_type { own.tokens } else { size });
        limits.shader_constants.check(size.max(out.tokens)).map_err(|error| reaches_too_far(text, own.at, &error))?;
    }
    let mut others = (0_u64, 0_u64);
    for (k, &(top, own, is_function)) in scan.measured.iter().enumerate() {
        let end = scan.measured.get(k + 1).map_or(reaches.len(), |&(next, ..)| next as usize);
        let values = (top as usize..end).filter(|&node| !scan.graph.nodes[node].is_type);
        let all = values.map(|node| reaches[node].size).fold(0, u64::saturating_add);
        if is_function {
            out.pairs = out.pairs.saturating_add(pairs(own, all));
        } else if !scan.graph.nodes[top as usize].is_type {
            others = (others.0 + own, others.1.saturating_add(all));
        }
        let sum = out.pairs.saturating_add(pairs(others.0, others.1));
        limits.shader_pairs.check(sum).map_err(|error| (place(text, scan.graph.nodes[top as usize].at), error.to_string()))?;
    }
    out.pairs = out.pairs.saturating_add(pairs(others.0, others.1));
    Ok(out)
}

/// A declaration that begins here is refused, because it and the declarations that it needs exceed a limit.
fn reaches_too_far(text: &str, at: usize, error: &LimitExceeded) -> Refusal {
    (place(text, at), format!("a declaration and those that it needs have {error}"))
}

/// The place of a byte.
fn place(text: &str, at: usize) -> ShaderLocation {
    let before = &text.as_bytes()[..at];
    let line = before.iter().filter(|&&byte| byte == b'\n').count() as u32 + 1;
    let begin = before.iter().rposition(|&byte| byte == b'\n').map_or(0, |newline| newline + 1);
    ShaderLocation::Text { line, column: (at - begin) as u32 + 1 }
}

impl<'t> Scan<'t> {
    /// Begins a declaration at the top.
    fn begin(&mut self, at: usize) {
        self.top = self.graph.add(at);
        self.node = self.top;
        self.begun = self.tokens.len();
        self.keyword = "";
        self.expected = Expected::Nothing;
    }

    /// Ends it.
    fn end(&mut self) {
        let level = self.levels.last_mut().expect("the outermost level stays");
        level.separate();
        let depth = std::mem::take(&mut level.deepest);
        self.graph.nodes[self.top as usize].depth = depth;
        self.measured.push((self.top, (self.tokens.len() - self.begun) as u64, self.keyword == "fn"));
        // The parameters, which the head has declared, end with the function.
        self.leave();
        self.scopes.push(Vec::new());
    }

    /// Counts the elements of the zero values as tokens of the declarations that they stand in.
    fn count_zeros(&mut self) -> Result<(), Refusal> {
        if self.zeros.is_empty() {
            return Ok(());
        }
        let Scan { text, ref tokens, ref tops, ref names, mentions: ref locals, .. } = *self;
        let mut zeros = Zeros { text, tokens, tops, names, locals, known: HashMap::new() };
        let templates = zeros.templates();
        for &zero in &self.zeros {
            let Some(begin) = zeros.begin(zero, &templates) else { continue };
            let node = &mut self.graph.nodes[zero.node as usize];
            // A constant may be used anywhere.
            if !node.copied && zeros.is_kept(begin, zero) {
                continue;
            }
            let Some(elements) = zeros.elements(begin) else {
                let message = "the zero value of an array whose length is not known before compiling: its length must be \
                               made of whole numbers and constants, or the value be stored in a variable of its own";
                return Err((place(text, tokens[begin].0), message.to_owned()));
            };
            node.tokens = node.tokens.saturating_add(elements);
        }
        Ok(())
    }

    fn leave(&mut self) {
        for name in self.scopes.pop().unwrap_or_default() {
            if let Some(held) = self.locals.get_mut(name) {
                held.pop();
            }
        }
    }

    fn declare(&mut self, name: &'t str, node: u32) {
        self.locals.entry(name).or_default().push(node);
        if let Some(scope) = self.scopes.last_mut() {
            scope.push(name);
        }
    }

    fn level(&mut self) -> &mut Level {
        self.levels.last_mut().expect("the outermost level stays")
    }

    /// A separator: what was declared before it holds from here on.
    fn separate(&mut self) {
        let level = self.level();
        level.separate();
        if let Some((node, outer)) = level.declaring.take() {
            // The brackets of the text are counted elsewhere. Arrays of earlier declarations make values deeper than the text is.
            let own = &mut self.graph.nodes[node as usize];
            own.depth = own.arrays;
            self.declare(self.name, node);
            self.node = outer;
        }
    }

    fn token(&mut self, at: usize, token: Token<'t>, before: Token<'t>, label: bool) {
        self.graph.nodes[self.node as usize].tokens += 1;
        if self.level().after_block && token != Token::Word("else") {
            self.separate();
        }
        let outermost = self.levels.len() == 1;
        if outermost && self.keyword.is_empty() && !matches!(token, Token::Separator(_) | Token::Close(_)) {
            self.graph.nodes[self.top as usize].at = at;
            self.keyword = "@";
        }
        match token {
            Token::Word(word) => self.word(at, word, before, label),
            Token::Operator(operator) => {
                self.level().operators += 1;
                match (self.expected, operator) {
                    (Expected::Variable, "<") => self.expected = Expected::Template,
                    (Expected::Template, ">") => self.expected = Expected::Name,
                    _ => {}
                }
            }
            Token::Open(bracket) => {
                let level = self.level();
                // An index has what it indexes as its left operand.
                level.operators += u64::from(bracket == '[');
                let outside = level.outside + level.operators + 1;
                self.levels.push(Level { outside, ..Level::default() });
                if bracket == '{' {
                    self.scopes.push(Vec::new());
                }
            }
            Token::Close(bracket) => self.close(bracket),
            Token::Separator(';') if outermost && self.keyword.is_empty() => {}
            Token::Separator(';') if outermost => {
                self.end();
                self.begin(at);
            }
            Token::Separator(':') => {}
            // A comma of a template list does not end a declaration.
            Token::Separator(',') => self.level().separate(),
            Token::Separator(_) => self.separate(),
            Token::Other => {}
        }
    }

    fn close(&mut self, bracket: char) {
        if self.levels.len() == 1 {
            return;
        }
        self.separate();
        let depth = self.levels.pop().map_or(0, |level| level.deepest) + 1;
        let outermost = self.levels.len() == 1;
        let level = self.level();
        level.inside = level.inside.max(depth);
        if bracket != '}' {
            return;
        }
        level.after_block = true;
        let loops = std::mem::take(&mut level.loops);
        for _ in 0..=loops {
            self.leave();
        }
        if outermost && matches!(self.keyword, "fn" | "struct") {
            self.end();
            self.begin(self.text.len());
        }
    }

    fn word(&mut self, at: usize, word: &'t str, before: Token<'t>, label: bool) {
        let outermost = self.levels.len() == 1;
        if self.expected != Expected::Nothing {
            if self.expected == Expected::Template {
                return;
            }
            self.expected = Expected::Nothing;
            let node = if outermost {
                self.tops.insert(word, self.top);
                self.top
            } else {
                self.name = word;
                self.node
            };
            self.names.insert(node, self.tokens.len() - 1);
            return;
        }
        // Members and attributes have names of their own.
        if before == Token::Operator(".") || before == Token::Operator("@") {
            return;
        }
        match word {
            "fn" | "struct" | "alias" | "const" | "override" | "var" if outermost => {
                self.keyword = word;
                self.expected = if word == "var" { Expected::Variable } else { Expected::Name };
                self.graph.nodes[self.top as usize].copied = matches!(word, "const" | "override");
                self.graph.nodes[self.top as usize].is_type = matches!(word, "struct" | "alias");
            }
            "const" | "let" | "var" => {
                let outer = self.node;
                let node = self.graph.add(at);
                self.graph.nodes[node as usize].copied = word == "const";
                self.graph.needs(outer, node);
                self.node = node;
                let outer = self.level().declaring.map_or(outer, |(_, outer)| outer);
                self.level().declaring = Some((node, outer));
                self.expected = if word == "var" { Expected::Variable } else { Expected::Name };
            }
            "else" => {
                let level = self.level();
                level.operators += 1;
                level.after_block = false;
            }
            "for" => {
                self.scopes.push(Vec::new());
                self.level().loops += 1;
            }
            // Members of a structure and parameters of a function.
            _ if label && self.keyword == "struct" => {}
            _ if label && self.keyword == "fn" && self.levels.len() == 2 && !self.in_body() => {
                let node = self.graph.add(at);
                self.declare(word, node);
            }
            _ => {
                self.graph.nodes[self.node as usize].arrays += u64::from(word == "array");
                match self.locals.get(word).and_then(|held| held.last()) {
                    Some(&node) => {
                        self.mentions.insert(self.tokens.len() - 1, node);
                        self.graph.uses(self.node, node);
                    }
                    None => self.uses.push((self.node, word)),
                }
            }
        }
    }

    /// Whether the scan is in the braces of a function: they have a scope, its head has none but that of the declaration.
    fn in_body(&self) -> bool {
        self.scopes.len() > 1
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn extent(text: &str) -> Extent {
        check(text, &Limits::default()).unwrap_or_else(|(place, message)| panic!("{place}: {message}"))
    }

    /// Nesting of a statement, without that of the function around it.
    fn levels(statement: &str) -> u64 {
        let of = |body: &str| extent(&format!("fn f() {{ {body} }}")).nesting;
        of(statement) - of("")
    }

    #[test]
    fn operators_and_brackets_add_up() {
        assert_eq!(levels("!!!x;"), 3);
        assert_eq!(levels("x + x + x;"), 2);
        assert_eq!(levels("x; x + x; x;"), 1);
        assert_eq!(levels("f(x + x, x, -x);"), 2);
        assert_eq!(levels("(x) + (x + x) + x;"), 4);
        assert_eq!(levels("x[x[x]].y;"), 5);
        assert_eq!(levels("if x { y(); } else if x { z(); } else { }"), 4);
        assert_eq!(levels("if x { } if x { } if x { { } }"), 2);
        assert_eq!(levels("/* (((( */ x; // ((((\n"), 0);
    }

    #[test]
    fn chains_of_declarations_add_up() {
        let chain = "fn c() { } fn a() { b(); } fn b() { c(); c(); }";
        // Braces, and brackets inside them; `c` has none inside.
        assert_eq!(extent(chain).nesting, 2 + 2 + 1);
        assert_eq!(extent("const a = 1; const b = a + 1; const c = -b;").nesting, 1 + 2 + 2);
        // Members, parameters and variables are not what they are called like.
        let names = "struct S { b: u32 } fn b(c: u32) -> u32 { return c; } fn c(s: S) { let a = s.b; } fn a() { }";
        // An operator in an initial value in the braces of `c`, and the braces of `S`.
        assert_eq!(extent(names).nesting, 3 + 1);
    }

    #[test]
    fn names_hold_in_their_scopes() {
        let size = |body: &str| extent(&format!("const big = array(1, 2, 3, 4, 5, 6, 7, 8);\nfn f() {{ {body} }}")).tokens;
        let large = size("big;") - size("x;");
        assert!(large >= 16, "{large}");
        assert_eq!(size("let big = x; big;"), size("let gib = x; gib;"));
        assert_eq!(size("{ let big = x; } big;") - size("{ let gib = x; } x;"), large);
        assert_eq!(size("for (var big = x; x; x) { } big;") - size("for (var gib = x; x; x) { } x;"), large);
        assert_eq!(size("for (var big = x; x; x) { big; }"), size("for (var gib = x; x; x) { gib; }"));
        assert_eq!(size("let a = big; a; a;") - size("let a = x; a; a;"), large);
        assert_eq!(size("const a = big; a; a;") - size("const a = x; a; a;"), 3 * large);
    }

    /// Tokens of a text beyond those of the same text with other zero values.
    fn elements(text: &str, zero: &str) -> u64 {
        let of = |zero: &str| extent(&text.replace("ZERO", zero)).tokens;
        of(zero) - of(&zero.replace("array", "vec2").replace("()", "(1)"))
    }

    #[test]
    fn zero_values_of_arrays_count_their_elements() {
        let compared = "const x = ZERO == y;";
        assert_eq!(elements(compared, "array<i32, 1000>()"), 1000 - 1);
        assert_eq!(elements(compared, "array<array<vec2<f32>, 10>, 0x20u,>()"), 320 - 1);
        for length in ["7 * (N - 1) + 1", "u32(N) + M", "max(M, 1 << 5u) / 2 + 6", "(N | M) + 10 % 5 + min(0, N)"] {
            let text = format!("{compared} const N: u32 = 4; const M = N * 5 - 2;");
            assert_eq!(elements(&text, &format!("array<i32, {length}>()")), 22 - 1, "{length}");
        }
        // A type of the text, wherever it stands.
        let size = |length: u32| {
            let types = format!("alias A = array<S, 2>; struct S {{ @size(64) a: u32, b: array<f32, {length}>, }}");
            extent(&format!("const x = !A(); {types}")).tokens
        };
        assert_eq!(size(1000) - size(1), 2 * 999);
        // A constant is copied to where it is used.
        let uses = |uses: &str| extent(&format!("const c = array<i32, 1000>(); fn f() {{ {uses} }}")).tokens;
        assert!((3000..3100).contains(&(uses("x = c == c; y = -c;") - uses("x = d == d; y = -d;"))));
        // Names of a function hold ahead of those at the top.
        let local = "const n = 5; fn f() { const n = 2 * n; x = -ZERO; }";
        assert_eq!(elements(local, "array<i32, n>()"), 10 - 1);
    }

    #[test]
    fn zero_values_that_are_kept_count_nothing() {
        for text in [
            "fn f() { var x = ZERO; let y: array<i32, 9> = ZERO; x = ZERO; return ZERO; }",
            "var<private> x: array<i32, 9> = ZERO;",
        ] {
            extent(&text.replace("ZERO", "array<i32, 2000000000>()"));
            extent(&text.replace("ZERO", "array<i32, select(1, 2, x)>()"));
        }
        extent("var<workgroup> a: array<u32, 4096>; var<private> b: array<array<u32, 4096>, 4096>; fn f() { g(); }");
    }

    #[test]
    fn zero_values_that_are_too_long_are_refused() {
        let refused = |text: &str| check(text, &Limits::default()).expect_err(text);
        for text in [
            "const X = array<i32, 500000000>() == array<i32, 500000000>();",
            "fn f() { let b = array<i32,30000000>() == array<i32,30000000>(); }",
            "const c = array<i32, 300000>();",
            "const n = 600; const c = array<array<i32, n>, n>();",
            "fn f() { let b = x >= array<i32, 300000>(); }",
            "struct S { a: array<i32, 300000> } fn f() { g(S()); }",
            "const c = array<i32, 1000>(); const d = array(c, c, c); const e = array(d, d, d, d, d, d, d, d, d, d); fn f() { \
             _ = e == e; _ = e == e; _ = e == e; _ = e == e; _ = e == e; }",
        ] {
            let (_, message) = refused(text);
            assert!(message.contains("more than the limit of 262144") && message.contains("shader.constants"), "{message}");
        }
        for length in ["n[1]", "4294967295 + 1", "1 - 2", "0u - 1u", "3.5", "m", "1 / 0", "65536 * 65536", "u32(3.0)", "x"] {
            let text = format!("const n = array(1, 2);\nconst m = m; override x: u32;\nconst c = array<i32, {length}>();");
            let (place, message) = refused(&text);
            assert_eq!(
                (place, message.contains("length is not known")),
                (ShaderLocation::Text { line: 3, column: 11 }, true),
                "{length}: {message}"
            );
        }
    }

    #[test]
    fn pairs_are_those_of_each_function() {
        let of = |text: &str| extent(text).pairs;
        let statements = |n: usize| format!("fn f() {{ {} }}\n", "x += 1u; ".repeat(n));
        assert_eq!(of("fn f() { x; }") - of(""), 8 * 8);
        assert_eq!(of(&statements(10).repeat(3)), 3 * of(&statements(10)));
        // A constant is copied to each use.
        let uses = |name: &str| of(&format!("const big = array(1, 2, 3, 4, 5, 6, 7, 8); fn f() {{ {name}; {name}; }}"));
        assert!(uses("big") > uses("x") + 10 * 2 * 16);
        let (place, message) = check(&format!("\n{}", statements(20_000)), &Limits::default()).expect_err("too many");
        assert_eq!((place, message.contains("--limit shader.pairs=N")), (ShaderLocation::Text { line: 2, column: 1 }, true));
        check(&statements(10_000), &Limits::default()).expect("few enough");
    }

    #[test]
    fn a_refusal_has_the_place() {
        let limits = Limits { shader_nesting: Limits::default().shader_nesting.with(3), ..Limits::default() };
        let (place, message) = check("fn f() {\n  ((x));\n  - - - x; }", &limits).expect_err("too deep");
        assert_eq!((place, message.contains("shader.nesting")), (ShaderLocation::Text { line: 3, column: 7 }, true));
        let (place, _) =
            check("fn f() { }\nfn a() { b(); } fn b() { c(); } fn c() { d(); } fn d() { }", &limits).expect_err("too deep");
        assert_eq!(place.line(), Some(2));
        let limits = Limits { shader_declarations: Limits::default().shader_declarations.with(2), ..Limits::default() };
        assert_eq!(check("struct A { a: u32 }; alias B = A;;;", &limits).map(|e| e.declarations), Ok(2));
        assert!(check("struct A { a: u32 }; alias B = A; fn f() { }", &limits).is_err());
    }
}
