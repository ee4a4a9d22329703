//! The preprocessor: directives and macros.
//!
//! A few macros can stand for any number of tokens, also inside of arguments where none of them comes out. So each token that is read,
//! from the text or from a macro, counts as a step, and what comes out is counted, too. Conditions take no stack; arguments inside arguments
//! are levels of nesting.

use std::collections::{HashMap, HashSet};
use std::rc::Rc;

use num::Limits;

use super::condition::evaluate;
use super::lexemes::{Lexeme, LexemeKind, Lexer};
use super::tokens::{Dialect, Token, dialect};
use super::{TranslateResult, Wrong};

/// Macros that OpenGL defines for supported extensions.
const EXTENSIONS: [&str; 4] =
    ["GL_ARB_texture_rectangle", "GL_ARB_shader_texture_lod", "GL_EXT_shader_texture_lod", "GL_OES_standard_derivatives"];

/// Steps for each token that may come out.
const STEPS: u64 = 4;

/// A macro.
#[derive(Debug, PartialEq)]
struct Macro {
    /// Parameters, if it has a list of them.
    parameters: Option<Vec<Rc<str>>>,
    body: Vec<LexemeKind>,
}

/// A conditional block that is open.
struct Block {
    line: u32,
    /// Whether one of its parts has been read, or none may be.
    decided: bool,
    /// Whether the text around it is skipped.
    skipped: bool,
    /// Whether it has had its `#else`.
    last: bool,
}

/// A macro that is being replaced.
struct Frame {
    name: Rc<str>,
    lexemes: Vec<Lexeme>,
    at: usize,
}

/// A stream of lexemes in which macros are replaced.
#[derive(Default)]
struct Stream {
    /// A list of lexemes; without it, the text.
    list: Option<std::vec::IntoIter<Lexeme>>,
    frames: Vec<Frame>,
    /// A lexeme that was read too early.
    back: Option<Lexeme>,
    /// Whether it is a condition, in which `defined` is an operator and unknown names are 0.
    condition: bool,
}

impl Stream {
    fn of(list: Vec<Lexeme>) -> Stream {
        Stream { list: Some(list.into_iter()), ..Stream::default() }
    }
}

struct Preprocessor<'l> {
    lexer: Lexer,
    macros: HashMap<Rc<str>, Rc<Macro>>,
    /// Names of macros that are being replaced: they are not replaced again inside.
    active: HashSet<Rc<str>>,
    blocks: Vec<Block>,
    skipping: bool,
    /// What `#line` adds to lines.
    offset: i64,
    line: u32,
    steps: u64,
    depth: u64,
    limits: &'l Limits,
}

/// The tokens of a text after the preprocessor.
///
/// # Errors
/// If a directive or a macro is wrong, or more comes of the text than the limits allow.
pub fn preprocess(text: &str, limits: &Limits) -> TranslateResult<(Dialect, Vec<Token>)> {
    let dialect = dialect(text);
    let mut own = Preprocessor {
        lexer: Lexer::new(text)?,
        macros: HashMap::new(),
        active: HashSet::new(),
        blocks: Vec::new(),
        skipping: false,
        offset: 0,
        line: 1,
        steps: 0,
        depth: 0,
        limits,
    };
    let mut defines = vec![("__VERSION__", u64::from(dialect.version))];
    defines.extend(EXTENSIONS.map(|name| (name, 1)));
    if dialect.embedded {
        defines.extend([("GL_ES", 1), ("GL_FRAGMENT_PRECISION_HIGH", 1)]);
    }
    for (name, value) in defines {
        own.macros.insert(name.into(), Rc::new(Macro { parameters: None, body: vec![LexemeKind::Whole(value, false)] }));
    }
    let (mut tokens, mut stream) = (Vec::new(), Stream::default());
    while let Some(lexeme) = own.next(&mut stream)? {
        // Line numbers do not decrease, so printed tokens keep their lines.
        tokens.push(Token::new(lexeme.text(), lexeme.line));
        limits.shader_constants.check(tokens.len() as u64).map_err(|error| Wrong::at(lexeme.line, error.to_string()))?;
    }
    match own.blocks.last() {
        Some(block) => Err(Wrong::at(block.line, "a conditional block without `#endif`")),
        None => Ok((dialect, tokens)),
    }
}

impl Preprocessor<'_> {
    fn wrong<T>(&self, reason: impl Into<String>) -> TranslateResult<T> {
        Err(Wrong::at(self.line, reason))
    }

    /// Counts steps.
    fn count(&mut self, steps: usize) -> TranslateResult {
        self.steps += steps as u64;
        let limit = self.limits.shader_constants;
        if self.steps <= limit.get().saturating_mul(STEPS) {
            return Ok(());
        }
        self.wrong(format!(
            "the preprocessor takes more than {} steps, {STEPS} for each token that --limit {}=N allows",
            limit.get().saturating_mul(STEPS),
            limit.info().name
        ))
    }

    /// The next lexeme after the replacement of macros.
    fn next(&mut self, stream: &mut Stream) -> TranslateResult<Option<Lexeme>> {
        while let Some(lexeme) = self.raw(stream)? {
            let LexemeKind::Name(name) = &lexeme.kind else { return Ok(Some(lexeme)) };
            let value = |value: u64| Ok(Some(Lexeme { kind: LexemeKind::Whole(value, false), ..lexeme.clone() }));
            if stream.condition && &**name == "defined" {
                let defined = self.defined(stream)?;
                return value(u64::from(defined));
            }
            if &**name == "__LINE__" {
                return match u64::try_from(i64::from(lexeme.line) + self.offset) {
                    Ok(line) => value(line),
                    Err(_) => self.wrong("the number of a line is less than 0"),
                };
            }
            if self.replace(name, lexeme.line, stream)? {
                continue;
            }
            return if stream.condition { value(0) } else { Ok(Some(lexeme)) };
        }
        Ok(None)
    }

    /// The next lexeme.
    fn raw(&mut self, stream: &mut Stream) -> TranslateResult<Option<Lexeme>> {
        self.count(1)?;
        if let Some(lexeme) = stream.back.take() {
            return Ok(Some(lexeme));
        }
        while let Some(frame) = stream.frames.last_mut() {
            if let Some(lexeme) = frame.lexemes.get(frame.at) {
                frame.at += 1;
                return Ok(Some(lexeme.clone()));
            }
            self.active.remove(&frame.name);
            stream.frames.pop();
        }
        match &mut stream.list {
            Some(list) => Ok(list.next()),
            None => self.read(),
        }
    }

    /// Begins to replace a macro. Returns whether there is one.
    fn replace(&mut self, name: &Rc<str>, line: u32, stream: &mut Stream) -> TranslateResult<bool> {
        if self.active.contains(name) {
            return Ok(false);
        }
        let Some(own) = self.macros.get(name).cloned() else { return Ok(false) };
        let mut arguments = Vec::new();
        if let Some(parameters) = &own.parameters {
            match self.raw(stream)? {
                Some(lexeme) if lexeme.is("(") => {}
                // Without arguments its name is a name.
                other => {
                    stream.back = other;
                    return Ok(false);
                }
            }
            arguments = self.arguments(name, stream)?;
            if parameters.is_empty() && matches!(&arguments[..], [one] if one.is_empty()) {
                arguments.clear();
            }
            if arguments.len() != parameters.len() {
                return self.wrong(format!("{name} has {} parameters, not {}", parameters.len(), arguments.len()));
            }
            self.depth += 1;
            self.limits.shader_nesting.check(self.depth).map_err(|error| Wrong::at(self.line, error.to_string()))?;
            for argument in &mut arguments {
                *argument = self.expand(Stream::of(std::mem::take(argument)))?;
            }
            self.depth -= 1;
        }
        let mut lexemes = Vec::with_capacity(own.body.len());
        let parameter = |kind: &LexemeKind| match (kind, &own.parameters) {
            (LexemeKind::Name(name), Some(parameters)) => parameters.iter().position(|own| own == name),
            _ => None,
        };
        for kind in &own.body {
            match parameter(kind) {
                Some(k) => {
                    self.count(arguments[k].len())?;
                    lexemes.extend_from_slice(&arguments[k]);
                }
                None => lexemes.push(Lexeme { kind: kind.clone(), line, spaced: true, first: false }),
            }
        }
        self.count(own.body.len())?;
        lexemes.iter_mut().for_each(|lexeme| lexeme.line = line);
        self.active.insert(name.clone());
        stream.frames.push(Frame { name: name.clone(), lexemes, at: 0 });
        Ok(true)
    }

    /// The arguments of a macro up to its closing bracket.
    fn arguments(&mut self, name: &str, stream: &mut Stream) -> TranslateResult<Vec<Vec<Lexeme>>> {
        let (mut arguments, mut depth, begin) = (vec![Vec::new()], 0_u64, self.line);
        while let Some(lexeme) = self.raw(stream)? {
            match lexeme.kind {
                LexemeKind::Mark("(") => depth += 1,
                LexemeKind::Mark(")") if depth == 0 => return Ok(arguments),
                LexemeKind::Mark(")") => depth -= 1,
                LexemeKind::Mark(",") if depth == 0 => {
                    arguments.push(Vec::new());
                    continue;
                }
                _ => {}
            }
            arguments.last_mut().into_iter().for_each(|argument| argument.push(lexeme.clone()));
        }
        Err(Wrong::at(begin, format!("the arguments of {name} have no end")))
    }

    /// All lexemes of a list after the replacement of macros.
    fn expand(&mut self, mut stream: Stream) -> TranslateResult<Vec<Lexeme>> {
        let mut out = Vec::new();
        while let Some(lexeme) = self.next(&mut stream)? {
            out.push(lexeme);
        }
        Ok(out)
    }

    /// What `defined` says of the name that follows.
    fn defined(&mut self, stream: &mut Stream) -> TranslateResult<bool> {
        let mut lexeme = self.raw(stream)?;
        let bracket = lexeme.as_ref().is_some_and(|lexeme| lexeme.is("("));
        if bracket {
            lexeme = self.raw(stream)?;
        }
        let Some(Lexeme { kind: LexemeKind::Name(name), .. }) = lexeme else { return self.wrong("`defined` without a name") };
        if bracket && !self.raw(stream)?.is_some_and(|lexeme| lexeme.is(")")) {
            return self.wrong("`defined(` without `)`");
        }
        Ok(self.macros.contains_key(&name))
    }

    /// The next lexeme of the text. Directives are followed.
    fn read(&mut self) -> TranslateResult<Option<Lexeme>> {
        while let Some(lexeme) = self.lexer.next() {
            self.line = lexeme.line;
            match lexeme.kind {
                LexemeKind::NewLine => {}
                LexemeKind::Hash if lexeme.first => self.directive()?,
                _ if self.skipping => {}
                _ => return lexeme.known().map(Some),
            }
        }
        Ok(None)
    }

    /// The rest of a line.
    fn rest(&mut self) -> Vec<Lexeme> {
        self.lexer.by_ref().take_while(|lexeme| lexeme.kind != LexemeKind::NewLine).collect()
    }

    /// Reads a directive after its `#`.
    fn directive(&mut self) -> TranslateResult {
        let rest = self.rest();
        let Some((word, rest)) = rest.split_first() else { return Ok(()) };
        let LexemeKind::Name(word) = &word.kind else {
            return if self.skipping { Ok(()) } else { self.wrong(format!("`#` before `{}`", word.text())) };
        };
        match (&**word, self.skipping) {
            ("if" | "ifdef" | "ifndef", true) => {
                self.blocks.push(Block { line: self.line, decided: true, skipped: true, last: false });
            }
            ("if" | "ifdef" | "ifndef", false) => {
                let holds = match &**word {
                    "if" => self.condition(rest)?,
                    word => self.macros.contains_key(&self.single_name(rest)?) == (word == "ifdef"),
                };
                self.blocks.push(Block { line: self.line, decided: holds, skipped: false, last: false });
                self.skipping = !holds;
            }
            ("elif", _) => self.elif(rest)?,
            ("else", _) => {
                let Some(block) = self.blocks.last_mut() else { return self.wrong("`#else` without `#if`") };
                if std::mem::replace(&mut block.last, true) {
                    return self.wrong("a second `#else` of one `#if`");
                }
                self.skipping = block.decided;
            }
            ("endif", _) => match self.blocks.pop() {
                Some(block) => self.skipping = block.skipped,
                None => return self.wrong("`#endif` without `#if`"),
            },
            (_, true) => {}
            ("define", false) => self.define(rest)?,
            ("undef", false) => {
                let name = self.single_name(rest)?;
                self.macros.remove(&name);
            }
            ("error", false) => {
                let words: Vec<String> = rest.iter().take(40).map(Lexeme::text).collect();
                return self.wrong(format!("`#error {}`", words.join(" ")));
            }
            ("line", false) => self.renumber(rest)?,
            // The version has been read, extensions are known or not, and pragmas ask for nothing.
            ("version" | "extension" | "pragma", false) => {}
            (word, false) => return self.wrong(format!("there is no directive `#{word}`")),
        }
        Ok(())
    }

    fn elif(&mut self, rest: &[Lexeme]) -> TranslateResult {
        let Some(block) = self.blocks.last() else { return self.wrong("`#elif` without `#if`") };
        if block.last {
            return self.wrong("`#elif` after `#else`");
        }
        // The condition of a part that is skipped anyway may be anything.
        self.skipping = true;
        if !block.decided && self.condition(rest)? {
            self.skipping = false;
            self.blocks.last_mut().into_iter().for_each(|block| block.decided = true);
        }
        Ok(())
    }

    /// The name that is all of the rest of a directive.
    fn single_name(&self, rest: &[Lexeme]) -> TranslateResult<Rc<str>> {
        match rest {
            [Lexeme { kind: LexemeKind::Name(name), .. }] => Ok(name.clone()),
            _ => self.wrong("the directive needs one name"),
        }
    }

    fn condition(&mut self, rest: &[Lexeme]) -> TranslateResult<bool> {
        let list = rest.iter().cloned().map(Lexeme::known).collect::<TranslateResult<Vec<_>>>()?;
        let lexemes = self.apart(Stream { condition: true, ..Stream::of(list) })?;
        match evaluate(&lexemes) {
            Ok(value) => Ok(value != 0),
            Err(reason) => self.wrong(reason),
        }
    }

    /// Expands what is no part of the text around it, so that macros that are being replaced there count as any.
    fn apart(&mut self, stream: Stream) -> TranslateResult<Vec<Lexeme>> {
        let around = std::mem::take(&mut self.active);
        let lexemes = self.expand(stream);
        self.active = around;
        lexemes
    }

    fn renumber(&mut self, rest: &[Lexeme]) -> TranslateResult {
        let lexemes = self.apart(Stream::of(rest.to_vec()))?;
        match lexemes.iter().map(|lexeme| &lexeme.kind).collect::<Vec<_>>()[..] {
            [&LexemeKind::Whole(line, _)] | [&LexemeKind::Whole(line, _), LexemeKind::Whole(..)] if line < 1 << 32 => {
                self.offset = line as i64 - i64::from(self.line);
                Ok(())
            }
            _ => self.wrong("`#line` needs the number of a line"),
        }
    }

    fn define(&mut self, rest: &[Lexeme]) -> TranslateResult {
        let Some((Lexeme { kind: LexemeKind::Name(name), .. }, mut rest)) = rest.split_first() else {
            return self.wrong("`#define` without a name");
        };
        let mut parameters = None;
        if rest.first().is_some_and(|lexeme| lexeme.is("(") && !lexeme.spaced) {
            let Some(close) = rest.iter().position(|lexeme| lexeme.is(")")) else {
                return self.wrong(format!("the parameters of {name} have no end"));
            };
            parameters = Some(self.parameters(&rest[1..close])?);
            rest = &rest[close + 1..];
        }
        let body =
            rest.iter().cloned().map(|lexeme| lexeme.known().map(|lexeme| lexeme.kind)).collect::<TranslateResult<Vec<_>>>()?;
        let own = Rc::new(Macro { parameters, body });
        if self.macros.get(name).is_some_and(|before| *before != own) {
            return self.wrong(format!("{name} is defined a second time, and otherwise"));
        }
        self.macros.insert(name.clone(), own);
        Ok(())
    }

    fn parameters(&self, list: &[Lexeme]) -> TranslateResult<Vec<Rc<str>>> {
        let (mut names, mut seen) = (Vec::new(), HashSet::new());
        if list.is_empty() {
            return Ok(names);
        }
        for (k, lexeme) in list.iter().enumerate() {
            match &lexeme.kind {
                LexemeKind::Name(name) if k % 2 == 0 => {
                    if !seen.insert(name.clone()) {
                        return self.wrong(format!("two parameters have the name {name}"));
                    }
                    names.push(name.clone());
                }
                LexemeKind::Mark(",") if k % 2 == 1 => {}
                _ => return self.wrong("parameters of a macro are names between commas"),
            }
        }
        if list.len().is_multiple_of(2) {
            return self.wrong("a parameter of a macro has no name");
        }
        Ok(names)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(text: &str) -> TranslateResult<String> {
        let (_, tokens) = preprocess(text, &Limits::default())?;
        Ok(tokens.iter().map(|token| token.text.as_str()).collect::<Vec<_>>().join(" "))
    }

    #[track_caller]
    fn gives(text: &str, wanted: &str) {
        assert_eq!(of(text).as_deref(), Ok(wanted), "{text}");
    }

    #[track_caller]
    fn refused(text: &str, line: u32, reason: &str) {
        let wrong = of(text).expect_err(text);
        assert!(wrong.line == line && wrong.reason.contains(reason), "{wrong:?}");
    }

    #[test]
    fn macros_are_replaced() {
        gives("#define A 1.5\n#define B A + A\nB;", "1.5 + 1.5 ;");
        gives("#define F(x, y) x * (y)\nF(1 + a, g(b, c));", "1 + a * ( g ( b , c ) ) ;");
        gives("#define F() 1\nF() F( ) F;", "1 1 F ;");
        gives("#define F(x) [x]\nF\n(\n1)\nF (2)", "[ 1 ] [ 2 ]");
        gives("#define F (x)\nF", "( x )");
        gives("#define F(x) x x\nF() F(F(1))", "1 1 1 1");
        gives("#define A\nA x A", "x");
        gives("#define A B\n#define B 2\n#undef B\nA", "B");
        gives("#define A 1\n#define A 1\nA", "1");
        // An argument that ends in the name of a macro takes the bracket behind.
        gives("#define F(x) x\n#define G(x) <x>\nF(G)(1)", "< 1 >");
        gives("#define long_name 1\\\n + 2\nlong_name", "1 + 2");
    }

    #[test]
    fn a_macro_is_not_replaced_inside_itself() {
        gives("#define A A + 1\nA", "A + 1");
        gives("#define A B\n#define B A\nA B", "A B");
        gives("#define f(x) f(x + 1)\nf(f(2))", "f ( f ( 2 + 1 ) + 1 )");
    }

    #[test]
    fn blocks_are_read_or_skipped() {
        let all = "#ifdef A\na\n#elif defined(B) && B > 1\nb\n#elif B\nc\n#else\nd\n#endif\ne";
        gives(all, "d e");
        gives(&format!("#define A\n{all}"), "a e");
        gives(&format!("#define B 2\n{all}"), "b e");
        gives(&format!("#define B 1\n{all}"), "c e");
        gives("#if 0\n#if 1\na\n#else\nb\n#endif\n#nonsense don't é 1e\n#endif\nc", "c");
        gives("#if 1\na\n#elif 1 /\nb\n#endif", "a");
        gives("#ifndef A\na\n#endif", "a");
        gives("#if defined A || !defined (B)\na\n#endif", "a");
        gives("#define HAS_Y defined(Y)\n#define Y\n#if HAS_Y && !defined Z\na\n#endif", "a");
        gives("#\n # /* x */ if 1 // y\na\n#endif", "a");
    }

    #[test]
    fn predefined_macros_are_those_of_the_dialect() {
        gives("#version 300 es\n#if __VERSION__ == 300 && GL_ES\na\n#endif", "a");
        gives("#version 130\n#ifdef GL_ES\na\n#endif\n__VERSION__ GL_ARB_texture_rectangle", "130 1");
        gives("\n__LINE__\n#line 40\n__LINE__ // 41\n", "2 41");
        gives("#define A __LINE__\n\nA", "3");
    }

    #[test]
    fn errors_have_their_lines() {
        refused("a\n#if 1\nb", 2, "without `#endif`");
        refused("\n#endif", 2, "without `#if`");
        refused("#if 1\n#else\n#else\n#endif", 3, "second `#else`");
        refused("#if 1\n#else\n#elif 1\n#endif", 3, "after `#else`");
        refused("\n\n#error no such card", 3, "no such card");
        refused("#define A 1\n#define A 2", 2, "second time");
        refused("#define F(x) x\nF(1, 2)", 2, "has 1 parameters, not 2");
        refused("#define F(x) x\n\nF(1", 3, "no end");
        refused("#define F(x, x) x", 1, "two parameters");
        refused("#define F(x,) x", 1, "no name");
        refused("#define F(x", 1, "no end");
        refused("\na # b", 2, "`#`");
        refused("a @", 1, "'@'");
        refused("#if 1 +\n#endif", 1, "without an end");
        refused("#nonsense", 1, "#nonsense");
    }

    #[test]
    fn what_macros_stand_for_is_counted_wherever_it_is_made() {
        let mut limits = Limits::default();
        limits.shader_constants = limits.shader_constants.with(5_000);
        let refused = |text: &str, line: u32, reason: &str| {
            let wrong = preprocess(text, &limits).expect_err("too long");
            assert!(wrong.line == line && wrong.reason.contains(reason), "{wrong:?}");
        };
        // 2^40 tokens; in conditions; in arguments, of which nothing comes out; and by arguments of arguments, doubly exponential.
        let doubled: String = (0..40).map(|k| format!("#define A{} A{k} A{k}\n", k + 1)).collect();
        refused(&format!("{doubled}\nA40"), 42, "shader.constants");
        refused(&format!("{doubled}\n#if A40\n#endif"), 42, "shader.constants");
        refused(&format!("{doubled}#define NONE(x)\nNONE(A40)"), 42, "shader.constants");
        let empty: String = (0..40).map(|k| format!("#define A{} A{k} A{k}\n", k + 1)).collect();
        refused(&format!("#define A0\n{empty}A40"), 42, "steps");
        let inner: String = (1..8).map(|k| format!("#define A{k}(x) A{}(A{}(x))\n", k - 1, k - 1)).collect();
        refused(&format!("#define A0(x) x+x\n{inner}A7(a)"), 9, "steps");
        let line = |n: usize| format!("#define F(x) x\n{}1{}", "F(".repeat(n), ")".repeat(n));
        gives(&line(40), "1");
        // Each level reads the argument again.
        refused(&line(200), 2, "steps");
        let chain: String = (0..300).map(|k| format!("#define A{} A{k}\n", k + 1)).collect();
        refused(&format!("{chain}{}", "A300 ".repeat(200)), 301, "steps");
    }

    #[test]
    fn arguments_inside_arguments_are_levels() {
        let mut limits = Limits::default();
        limits.shader_nesting = limits.shader_nesting.with(10);
        let text = |n: usize| format!("#define F(x) x\n{}1{}", "F(".repeat(n), ")".repeat(n));
        assert!(preprocess(&text(10), &limits).is_ok());
        let wrong = preprocess(&text(11), &limits).expect_err("11 levels");
        assert!(wrong.line == 2 && wrong.reason.contains("--limit shader.nesting=N"), "{wrong:?}");
    }
}
