//! The shader objects of one stage as one text: a variable that several of them declare is one variable, and functions follow those that
//! they call, since naga's functions can only call earlier ones.

use std::collections::{BTreeMap, BTreeSet};

use super::outline::{Header, Item, Variables, initialiser, items};
use super::tokens::{Dialect, Token, closing, parts};
use super::{TranslateResult, Wrong};

/// A function by its name and its number of parameters.
type Group = (String, usize);

/// Each shader's declarations.
type Items = Vec<Vec<Item>>;

/// Puts variables before functions, and functions behind those that they call, if that is needed: there are several shader objects,
/// `moved` says that `main` uses variables that may be declared after it, or a function calls a later one.
///
/// # Errors
/// If two shader objects declare a variable or a structure in different ways, or if a function that is called has no body.
pub fn order(shaders: Vec<(Dialect, Vec<Token>)>, moved: bool) -> TranslateResult<Vec<(Dialect, Vec<Token>)>> {
    let all: Items = shaders.iter().map(|(_, tokens)| items(tokens)).collect();
    let calls = Calls::of(&shaders, &all);
    calls.check(&shaders, &all)?;
    if shaders.len() < 2 && !moved && !calls.forward {
        return Ok(shaders);
    }
    let mut out: Vec<(Dialect, Vec<Token>)> = Vec::new();
    let declared = Declared::of(&shaders, &all)?;
    for (k, ((dialect, tokens), items)) in shaders.iter().zip(&all).enumerate() {
        let mut variables = Vec::new();
        for item in items {
            let whole = &tokens[item.whole.clone()];
            match item.function {
                None => declared.write(k, whole, &mut variables),
                // A prototype of a function that is defined is not needed any more.
                Some(header) if item.body(tokens).is_none() => {
                    if !calls.groups.contains_key(&group(tokens, header)) {
                        variables.extend_from_slice(whole);
                    }
                }
                Some(_) => {}
            }
        }
        out.push((*dialect, variables));
    }
    for (k, at) in calls.sorted() {
        let (dialect, tokens) = &shaders[k];
        out.push((*dialect, tokens[all[k][at].whole.clone()].to_vec()));
    }
    Ok(out)
}

/// The group of a function.
fn group(tokens: &[Token], header: Header) -> Group {
    let parameters = parts(&tokens[header.open + 1..header.close.max(header.open + 1)]);
    let none = matches!(parameters.as_slice(), [[only]] if only.is("void"));
    (tokens[header.name].text.clone(), if none { 0 } else { parameters.len() })
}

/// Which functions call which.
struct Calls {
    /// Functions that are defined: the shader, and the number of the item.
    functions: Vec<(usize, usize)>,
    /// The groups that each of them calls.
    called: Vec<Vec<usize>>,
    /// The functions of each group.
    members: Vec<Vec<usize>>,
    /// Numbers of groups.
    groups: BTreeMap<Group, usize>,
    /// Groups that are called and have no function with a body.
    missing: BTreeSet<Group>,
    /// Whether a function calls a later one.
    forward: bool,
}

impl Calls {
    fn of(shaders: &[(Dialect, Vec<Token>)], all: &Items) -> Calls {
        let mut calls = Calls {
            functions: Vec::new(),
            called: Vec::new(),
            members: Vec::new(),
            groups: BTreeMap::new(),
            missing: BTreeSet::new(),
            forward: false,
        };
        for (k, ((_, tokens), items)) in shaders.iter().zip(all).enumerate() {
            for (at, item) in items.iter().enumerate() {
                let Some(header) = item.function.filter(|_| item.body(tokens).is_some()) else { continue };
                let next = calls.members.len();
                let number = *calls.groups.entry(group(tokens, header)).or_insert(next);
                if number == next {
                    calls.members.push(Vec::new());
                }
                calls.members[number].push(calls.functions.len());
                calls.functions.push((k, at));
            }
        }
        for (number, &(k, at)) in calls.functions.iter().enumerate() {
            let (tokens, whole) = (&shaders[k].1, all[k][at].whole.clone());
            let mut called: Vec<usize> = Vec::new();
            let body = all[k][at].body(tokens).unwrap_or(whole.end);
            for at in body..whole.end {
                let is_call = tokens[at].word && tokens.get(at + 1).is_some_and(|next| next.is("("));
                let Some(close) = is_call.then(|| closing(tokens, at + 1)).flatten() else { continue };
                let group = group(tokens, Header { name: at, open: at + 1, close });
                match calls.groups.get(&group) {
                    Some(&number) => called.push(number),
                    None => drop(calls.missing.insert(group)),
                }
            }
            // Overloads keep their order.
            let own = all[k][at].function.and_then(|header| calls.groups.get(&group(tokens, header)).copied());
            called.retain(|&group| Some(group) != own);
            called.sort_unstable();
            called.dedup();
            calls.forward |= called.iter().any(|&group| calls.members[group].last().is_some_and(|&other| other > number));
            calls.called.push(called);
        }
        calls
    }

    /// Refuses calls of functions that only have a prototype: naga takes these for functions without statements.
    fn check(&self, shaders: &[(Dialect, Vec<Token>)], all: &Items) -> TranslateResult {
        let mut empty = BTreeMap::new();
        for ((_, tokens), items) in shaders.iter().zip(all) {
            let prototypes = items.iter().filter(|item| item.body(tokens).is_none()).filter_map(|item| item.function);
            let missing = prototypes.filter(|&header| !self.groups.contains_key(&group(tokens, header)));
            empty.extend(missing.map(|header| (group(tokens, header), tokens[header.name].line)));
        }
        match self.missing.iter().find_map(|group| Some((group, empty.get(group)?))) {
            Some((group, &line)) => Err(Wrong::at(line, format!("the function {} has no body", group.0))),
            None => Ok(()),
        }
    }

    /// The functions, each after those that it calls. Calls in a circle, which the language does not have, keep their order.
    fn sorted(&self) -> Vec<(usize, usize)> {
        let (mut out, mut done) = (Vec::new(), vec![false; self.members.len()]);
        let mut seen = vec![false; self.functions.len()];
        for root in 0..self.functions.len() {
            // Functions on the way, each with the functions that it still waits for, last first.
            let mut stack: Vec<(usize, Vec<usize>)> = Vec::new();
            let mut next = Some(root);
            loop {
                if let Some(function) = next.take().filter(|&function| !std::mem::replace(&mut seen[function], true)) {
                    let groups = self.called[function].iter().filter(|&&group| !std::mem::replace(&mut done[group], true));
                    let mut waits: Vec<usize> = groups.flat_map(|&group| self.members[group].iter().copied()).collect();
                    waits.sort_unstable_by(|a, b| b.cmp(a));
                    stack.push((function, waits));
                }
                let Some((function, waits)) = stack.last_mut() else { break };
                next = waits.pop();
                if next.is_none() {
                    out.push(self.functions[*function]);
                    stack.pop();
                }
            }
        }
        out
    }
}

/// A variable that is declared: the shader whose declaration stays, its type, and its initialiser.
struct DeclaredVariable {
    shader: usize,
    kind: String,
    value: Option<String>,
}

/// Variables and structures that several shaders declare.
struct Declared {
    variables: BTreeMap<String, DeclaredVariable>,
    structures: BTreeMap<String, (usize, String)>,
}

fn text(tokens: &[Token]) -> String {
    tokens.iter().map(|token| token.text.as_str()).collect::<Vec<_>>().join(" ")
}

/// The variables of a declaration; none if it declares others things, like blocks.
fn variables(whole: &[Token]) -> Option<Variables<'_>> {
    let plain = |of: &Variables| of.names.iter().all(|name| !name[0].text.starts_with("gl_"));
    Variables::of(whole).filter(|of| plain(of) && !whole[0].is("precision"))
}

/// The name of the structure that a type declares.
fn structure(kind: &[Token]) -> Option<&Token> {
    kind.get(1).filter(|name| kind[0].is("struct") && name.word)
}

impl Declared {
    fn of(shaders: &[(Dialect, Vec<Token>)], all: &Items) -> TranslateResult<Declared> {
        let mut declared = Declared { variables: BTreeMap::new(), structures: BTreeMap::new() };
        for (k, ((_, tokens), items)) in shaders.iter().zip(all).enumerate() {
            for item in items.iter().filter(|item| item.function.is_none()) {
                let Some(of) = variables(&tokens[item.whole.clone()]) else { continue };
                if let Some(name) = structure(of.kind) {
                    let (_, known) = declared.structures.entry(name.text.clone()).or_insert_with(|| (k, text(of.kind)));
                    if *known != text(of.kind) {
                        let what = format!("the structure {} in two shader objects in different ways", name.text);
                        return Err(Wrong::at(name.line, format!("{what} is not supported")));
                    }
                }
                for name in &of.names {
                    declared.variable(k, &of, name)?;
                }
            }
        }
        Ok(declared)
    }

    /// Notes one variable.
    fn variable(&mut self, shader: usize, of: &Variables, name: &[Token]) -> TranslateResult {
        let value = initialiser(name);
        let brackets = &name[1..value.map_or(name.len(), |at| at - 1)];
        let kind = structure(of.kind).map_or_else(|| text(of.kind), |name| name.text.clone());
        let own = if of.is_own() { if of.has("const") { "const " } else { "" } } else { "other " };
        let kind = format!("{own}{kind} {}{}", text(of.count), text(brackets));
        let value = value.map(|at| text(&name[at..]));
        match self.variables.get_mut(&name[0].text) {
            None => {
                self.variables.insert(name[0].text.clone(), DeclaredVariable { shader, kind, value });
            }
            Some(known) if known.shader == shader => {}
            Some(known) => {
                // Precision and interpolation may differ.
                let differs = known.kind != kind || known.value.is_some() && value.is_some() && known.value != value;
                if differs {
                    let what = format!("the variable {} in two shader objects in different ways", name[0].text);
                    return Err(Wrong::at(name[0].line, format!("{what} is not supported")));
                }
                if known.value.is_none() && value.is_some() {
                    *known = DeclaredVariable { shader, kind, value };
                }
            }
        }
        Ok(())
    }

    /// Writes the part of a declaration that stays.
    fn write(&self, shader: usize, whole: &[Token], out: &mut Vec<Token>) {
        let Some(of) = variables(whole) else {
            out.extend_from_slice(whole);
            return;
        };
        let stays = |name: &&&[Token]| self.variables.get(&name[0].text).is_none_or(|kept| kept.shader == shader);
        let names: Vec<&[Token]> = of.names.iter().filter(stays).copied().collect();
        let known = structure(of.kind).filter(|name| self.structures.get(&name.text).is_some_and(|of| of.0 != shader));
        // The structure stays if only its variables do not.
        if names.is_empty() && (structure(of.kind).is_none() || known.is_some()) {
            return;
        }
        out.extend_from_slice(of.qualifiers);
        match known {
            Some(name) => out.push(name.clone()),
            None => out.extend_from_slice(of.kind),
        }
        out.extend_from_slice(of.count);
        let line = whole[0].line;
        out.extend(names.join(&Token::new(",", line)));
        out.extend(whole.last().cloned());
    }
}

#[cfg(test)]
mod tests {
    use super::super::tokens::{preprocess, print};
    use super::*;

    fn of(texts: &[&str]) -> Result<String, Wrong> {
        let shaders = texts.iter().map(|text| preprocess(text).expect("tokens")).collect();
        let text: String = order(shaders, false)?.iter().map(|(_, tokens)| print(tokens)).collect();
        Ok(text.split_whitespace().collect::<Vec<_>>().join(" "))
    }

    #[test]
    fn functions_follow_those_that_they_call() {
        let text = "float f(float x); float g(float x) { return f(x); } void main() { g(1.0); } float k;\n\
            float f(float x) { return h(x); } float h(float x) { return k; }";
        let wanted = "float k ; float h ( float x ) { return k ; } float f ( float x ) { return h ( x ) ; } \
            float g ( float x ) { return f ( x ) ; } void main ( ) { g ( 1.0 ) ; }";
        assert_eq!(of(&[text]).expect("an order"), wanted);
        // Overloads of another number of parameters are others; prototypes without a definition stay.
        let text = "float f(float x, float y) { return g(x); } float f(float x); void f() { f(1.0, 2.0); }";
        assert_eq!(of(&[text]).expect("an order"), preprocess_again(text));
        let wrong = of(&["float f(float x);\nfloat g() { return f(1.0); }"]).expect_err("a function without a body");
        assert_eq!((wrong.line, wrong.reason.as_str()), (1, "the function f has no body"));
        // Overloads that call each other keep their order.
        let text = "void main() { f(1.0); } float f(int x) { return 1.0; } float f(vec2 x) { return f(1); } float f(float x) { return f(vec2(x)); }";
        let wanted = "float f ( int x ) { return 1.0 ; } float f ( vec2 x ) { return f ( 1 ) ; } \
            float f ( float x ) { return f ( vec2 ( x ) ) ; } void main ( ) { f ( 1.0 ) ; }";
        assert_eq!(of(&[text]).expect("an order"), wanted);
        // A circle ends.
        assert!(of(&["void f() { g(); } void g() { f(); }"]).expect("an order").contains("void g ( )"));
    }

    fn preprocess_again(text: &str) -> String {
        print(&preprocess(text).expect("tokens").1).split_whitespace().collect::<Vec<_>>().join(" ")
    }

    #[test]
    fn a_variable_of_two_objects_is_one() {
        let one = "struct S { float x; }; float a, b; uniform float u; const int n = 1; void f() { a = b; }";
        let two = "struct S { float x; } s; float b = 1.0, c; uniform float u; const int n = 1; void main() { f(); }";
        let wanted = "struct S { float x ; } ; float a ; uniform float u ; const int n = 1 ; S s ; float b = 1.0 , c ; \
            void f ( ) { a = b ; } void main ( ) { f ( ) ; }";
        assert_eq!(of(&[one, two]).expect("an order"), wanted);
        for (one, two) in [
            ("float a;", "\nvec2 a;"),
            ("float a = 1.0;", "\nfloat a = 2.0;"),
            ("const float a = 1.0;", "\nfloat a;"),
            ("float a;", "\nuniform float a;"),
            ("struct S { float x; };", "\nstruct S { vec2 x; };"),
        ] {
            let wrong = of(&[one, two]).expect_err("two variables");
            assert!(wrong.reason.contains("in different ways"), "{}", wrong.reason);
        }
    }

    #[test]
    fn damaged_declarations_are_left_alone() {
        for text in
            ["void f() { g(", "void g(; void f() { g(1); }", "struct {", "struct S { } = ;", "float , = ;", "( ) { }", "f ( x"]
        {
            let _ = of(&[text, text]);
        }
    }
}
