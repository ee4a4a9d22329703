//! `==` and `!=` of arrays and of structures, which naga does not have: calls of functions that compare their elements and members.

use std::collections::{BTreeMap, BTreeSet};

use super::outline::{Variables, initialiser, items};
use super::tokens::{Dialect, Token, closing};
use super::words::is_type;

/// Maximum number of elements of arrays that are compared without a function.
const ELEMENTS_MAX: usize = 16;

/// A type: its name, and the size of an array.
type DeclaredType = (String, Option<String>);

/// The types of names.
#[derive(Default)]
struct Types {
    /// Members of structures, in order.
    structures: BTreeMap<String, Vec<(String, DeclaredType)>>,
    /// Global variables, and the results of functions. None: of several types.
    globals: BTreeMap<String, Option<DeclaredType>>,
    results: BTreeMap<String, Option<DeclaredType>>,
}

/// Rewrites the comparisons in a stage's shaders.
pub fn equality(shaders: &mut [(Dialect, Vec<Token>)]) {
    let is_comparison = |token: &Token| token.is("==") || token.is("!=");
    let aggregates = |token: &Token| token.is("struct") || token.is("[");
    let any = |wanted: &dyn Fn(&Token) -> bool| shaders.iter().any(|(_, tokens)| tokens.iter().any(wanted));
    if !any(&is_comparison) || !any(&aggregates) {
        return;
    }
    let mut types = Types::default();
    for (_, tokens) in shaders.iter() {
        types.declare(tokens);
    }
    let mut written = BTreeSet::new();
    for (_, tokens) in shaders {
        let mut out = Vec::with_capacity(tokens.len());
        for item in items(tokens) {
            let whole = &tokens[item.whole.clone()];
            match item.body(tokens) {
                Some(_) => {
                    let (body, compared) = types.rewritten(whole);
                    for kind in compared {
                        let mut text = String::new();
                        types.function(&kind, &mut written, &mut text);
                        out.extend(plain(&text, whole[0].line));
                    }
                    out.extend(body);
                }
                None => out.extend_from_slice(whole),
            }
        }
        *tokens = out;
    }
}

/// The tokens of a text with spaces between them.
fn plain(text: &str, line: u32) -> impl Iterator<Item = Token> {
    text.split_whitespace().map(move |word| Token::new(word, line))
}

fn text(tokens: &[Token]) -> String {
    tokens.iter().map(|token| token.text.as_str()).collect::<Vec<_>>().join(" ")
}

/// Notes the type of a name.
fn note(to: &mut BTreeMap<String, Option<DeclaredType>>, name: &str, kind: DeclaredType) {
    let known = to.entry(name.to_owned()).or_insert_with(|| Some(kind.clone()));
    if known.as_ref() != Some(&kind) {
        *known = None;
    }
}

/// The names that a declaration gives and their types.
fn declared(tokens: &[Token]) -> Vec<(String, DeclaredType)> {
    let Some(of) = Variables::of(tokens) else { return Vec::new() };
    let base = if of.kind[0].is("struct") { of.kind.get(1) } else { of.kind.first() };
    let Some(base) = base else { return Vec::new() };
    let one = |name: &&[Token]| {
        let brackets = &name[1..initialiser(name).map_or(name.len(), |at| at - 1)];
        let brackets = if brackets.is_empty() { of.count } else { brackets };
        let size = match brackets {
            [open, inner @ .., close] if open.is("[") && close.is("]") => Some(text(inner)),
            _ => None,
        };
        (name[0].text.clone(), (base.text.clone(), size))
    };
    of.names.iter().map(one).collect()
}

impl Types {
    /// Notes what a shader declares at global scope.
    fn declare(&mut self, tokens: &[Token]) {
        for item in items(tokens) {
            let whole = &tokens[item.whole.clone()];
            if let Some(header) = item.function {
                let before = &tokens[item.whole.start..header.name];
                if let Some(kind) = before.last().filter(|token| token.word) {
                    note(&mut self.results, &tokens[header.name].text, (kind.text.clone(), None));
                }
                continue;
            }
            for (name, kind) in declared(whole) {
                note(&mut self.globals, &name, kind);
            }
            let at = whole.iter().position(|token| token.is("struct"));
            if let Some([_, name, open, ..]) = at.map(|at| &whole[at..])
                && open.is("{")
                && let Some(close) = at.and_then(|at| closing(whole, at + 2))
                && let Some(body) = at.and_then(|at| whole.get(at + 3..close))
            {
                let members = body.split_inclusive(|token| token.is(";")).flat_map(declared).collect();
                self.structures.entry(name.text.clone()).or_insert(members);
            }
        }
    }

    /// A function with its comparisons rewritten, and the types that these compare.
    fn rewritten(&self, tokens: &[Token]) -> (Vec<Token>, Vec<DeclaredType>) {
        let mut locals = BTreeMap::new();
        let is_kind = |token: &Token| token.word && (is_type(&token.text) || self.structures.contains_key(&token.text));
        for (at, token) in tokens.iter().enumerate().filter(|(_, token)| is_kind(token)) {
            // A type before a name begins a declaration or a parameter.
            let mut name = at + 1;
            let mut size = None;
            if tokens.get(name).is_some_and(|next| next.is("[")) {
                let Some(close) = closing(tokens, name) else { continue };
                size = Some(text(&tokens[name + 1..close]));
                name = close + 1;
            }
            let is_name = |at: usize| tokens.get(at).is_some_and(|token| token.word);
            while is_name(name) && !tokens.get(name + 1).is_some_and(|next| next.is("(")) {
                let mut next = name + 1;
                let mut own = size.clone();
                if tokens.get(next).is_some_and(|next| next.is("["))
                    && let Some(close) = closing(tokens, next)
                {
                    own = Some(text(&tokens[next + 1..close]));
                    next = close + 1;
                }
                note(&mut locals, &tokens[name].text, (token.text.clone(), own));
                // What follows an initialiser gets no type, so it is not compared.
                if !tokens.get(next).is_some_and(|next| next.is(",")) {
                    break;
                }
                name = next + 1;
            }
        }
        let (mut out, mut compared, mut at): (Vec<Token>, Vec<DeclaredType>, usize) =
            (Vec::with_capacity(tokens.len()), Vec::new(), 0);
        // The place in `out` of each token.
        let mut places = Vec::with_capacity(tokens.len());
        while let Some(token) = tokens.get(at) {
            places.push(out.len());
            if (token.is("==") || token.is("!="))
                && let Some(start) = before(tokens, at)
                && let Some(end) = after(tokens, at + 1)
                && let (Some(left), right) = (self.kind(&tokens[start..at], &locals), self.kind(&tokens[at + 1..end], &locals))
                && (left.1.is_some() || self.structures.contains_key(&left.0))
                && right.is_none_or(|right| right == left)
            {
                let line = token.line;
                let operands = [&tokens[start..at], &tokens[at + 1..end]];
                if left.1.is_some() && operands.iter().any(|of| of.iter().any(|token| token.is("."))) {
                    let Some(test) = self.each(operands, &left, token.is("!=")) else {
                        out.push(token.clone());
                        at += 1;
                        continue;
                    };
                    out.truncate(places[start]);
                    out.extend(plain(&test, line));
                    places.resize(end, out.len());
                    compared.push((left.0, None));
                    at = end;
                    continue;
                }
                let function = if token.is("==") { "glx_equal" } else { "! glx_equal" };
                let inserted: Vec<Token> = plain(function, line).chain(plain("(", line)).collect();
                out.splice(places[start]..places[start], inserted);
                out.push(Token::new(",", line));
                out.extend_from_slice(&tokens[at + 1..end]);
                out.push(Token::new(")", line));
                places.resize(end, out.len());
                compared.push(left);
                at = end;
                continue;
            }
            out.push(token.clone());
            at += 1;
        }
        (out, compared)
    }

    /// The comparison of two arrays of which one is a member of a structure, element by element, if they are only read by that.
    fn each(&self, operands: [&[Token]; 2], kind: &DeclaredType, differ: bool) -> Option<String> {
        let count: usize = kind.1.as_ref()?.parse().ok().filter(|count| (1..=ELEMENTS_MAX).contains(count))?;
        if operands.iter().any(|of| of.iter().any(|token| token.is("(") || token.is("++") || token.is("--"))) {
            return None;
        }
        let [a, b] = operands.map(text);
        let structure = self.structures.contains_key(&kind.0);
        let one = |k: usize| match structure {
            true => format!("glx_equal ( {a} [ {k} ] , {b} [ {k} ] )"),
            false => format!("( {a} [ {k} ] == {b} [ {k} ] )"),
        };
        let tests = (0..count).map(one).collect::<Vec<_>>().join(" && ");
        Some(format!("{} ( {tests} )", if differ { "!" } else { "" }))
    }

    /// The type of an operand that is a name or a call with indices and members after it.
    fn kind(&self, operand: &[Token], locals: &BTreeMap<String, Option<DeclaredType>>) -> Option<DeclaredType> {
        let (first, mut rest) = operand.split_first()?;
        let close = |rest: &[Token]| closing(rest, 0).map(|close| close + 1);
        let mut kind = if rest.first().is_some_and(|next| next.is("(")) {
            rest = &rest[close(rest)?..];
            if self.structures.contains_key(&first.text) {
                (first.text.clone(), None)
            } else {
                self.results.get(&first.text)?.clone()?
            }
        } else if rest.first().is_some_and(|next| next.is("["))
            && (is_type(&first.text) || self.structures.contains_key(&first.text))
        {
            // `float[2](1.0, 2.0)`
            let end = close(rest)?;
            let size = text(&rest[1..end - 1]);
            rest = &rest[end..];
            rest = &rest[close(rest)?..];
            (first.text.clone(), Some(size))
        } else {
            locals.get(&first.text).or_else(|| self.globals.get(&first.text))?.clone()?
        };
        while let Some(token) = rest.first() {
            match token.text.as_str() {
                "[" => {
                    kind.1.take()?;
                    rest = &rest[close(rest)?..];
                }
                "." => {
                    let members = self.structures.get(&kind.0).filter(|_| kind.1.is_none())?;
                    kind = members.iter().find(|member| rest.get(1).is_some_and(|name| name.is(&member.0)))?.1.clone();
                    rest = &rest[2..];
                }
                _ => return None,
            }
        }
        Some(kind)
    }

    /// Writes the function that compares values of a type, after those of its parts.
    fn function(&self, kind: &DeclaredType, written: &mut BTreeSet<DeclaredType>, out: &mut String) {
        if !written.insert(kind.clone()) {
            return;
        }
        let same = |kind: &DeclaredType, a: &str, b: &str| {
            if kind.1.is_some() || self.structures.contains_key(&kind.0) {
                format!("glx_equal ( {a} , {b} )")
            } else {
                format!("( {a} == {b} )")
            }
        };
        let name = &kind.0;
        match (&kind.1, self.structures.get(name)) {
            (Some(size), structure) => {
                let element = (name.clone(), None);
                if structure.is_some() {
                    self.function(&element, written, out);
                }
                let test = same(&element, "a [ i ]", "b [ i ]");
                *out += &format!(
                    "bool glx_equal ( {name} a [ {size} ] , {name} b [ {size} ] ) {{ for ( int i = 0 ; i < {size} ; i ++ ) \
                     {{ if ( ! {test} ) {{ return false ; }} }} return true ; }} "
                );
            }
            (None, Some(members)) => {
                let mut body = String::new();
                for (member, (of, size)) in members {
                    let one = (of.clone(), None);
                    if self.structures.contains_key(of) {
                        self.function(&one, written, out);
                    }
                    // Naga's arrays in structures are of other types than those outside, so these are compared here.
                    body += &match size {
                        Some(size) => {
                            let test = same(&one, &format!("a . {member} [ i ]"), &format!("b . {member} [ i ]"));
                            format!("for ( int i = 0 ; i < {size} ; i ++ ) {{ if ( ! {test} ) {{ return false ; }} }} ")
                        }
                        None => {
                            let test = same(&one, &format!("a . {member}"), &format!("b . {member}"));
                            format!("if ( ! {test} ) {{ return false ; }} ")
                        }
                    };
                }
                *out += &format!("bool glx_equal ( {name} a , {name} b ) {{ {body}return true ; }} ");
            }
            (None, None) => {}
        }
    }
}

/// The first token of the operand before an operator: a name or a call with indices and members after it.
fn before(tokens: &[Token], operator: usize) -> Option<usize> {
    let mut at = operator;
    loop {
        at = at.checked_sub(1)?;
        let mut depth = 0_u32;
        // Back to the bracket that opens.
        while matches!(tokens[at].text.as_str(), ")" | "]") || depth > 0 {
            match tokens[at].text.as_str() {
                ")" | "]" => depth += 1,
                "(" | "[" => depth -= 1,
                ";" | "{" | "}" => return None,
                _ => {}
            }
            at = at.checked_sub(1)?;
        }
        if !tokens[at].word {
            return None;
        }
        match at.checked_sub(1).map(|before| tokens[before].text.as_str()) {
            Some(".") => at -= 1,
            _ => return Some(at),
        }
    }
}

/// The position after the operand that begins here.
fn after(tokens: &[Token], start: usize) -> Option<usize> {
    tokens.get(start).filter(|token| token.word)?;
    let mut at = start + 1;
    while let Some(token) = tokens.get(at) {
        match token.text.as_str() {
            "(" | "[" => at = closing(tokens, at)? + 1,
            "." => at += 2,
            _ => break,
        }
    }
    (at <= tokens.len()).then_some(at)
}

#[cfg(test)]
mod tests {
    use super::super::tokens::{preprocess, print};
    use super::*;

    fn of(text: &str) -> String {
        let mut shaders = [preprocess(text).expect("tokens")];
        equality(&mut shaders);
        print(&shaders[0].1).split_whitespace().collect::<Vec<_>>().join(" ")
    }

    #[test]
    fn arrays_and_structures_are_compared_by_functions() {
        let head = "struct T { float t [ 2 ] ; } ; struct S { vec2 v ; T t ; } ; uniform S s [ 2 ] ; ";
        let text = "S f ( S p ) { if ( p == f ( s [ 1 ] ) && s [ i ] . t != p . t || p . v == s [ 0 ] . v ) { } }";
        let array = "bool glx_equal ( float a [ 2 ] , float b [ 2 ] ) { for ( int i = 0 ; i < 2 ; i ++ ) \
            { if ( ! ( a [ i ] == b [ i ] ) ) { return false ; } } return true ; }";
        let wanted = format!(
            "{head}bool glx_equal ( T a , T b ) {{ for ( int i = 0 ; i < 2 ; i ++ ) \
             {{ if ( ! ( a . t [ i ] == b . t [ i ] ) ) {{ return false ; }} }} return true ; }} \
             bool glx_equal ( S a , S b ) {{ if ( ! ( a . v == b . v ) ) {{ return false ; }} \
             if ( ! glx_equal ( a . t , b . t ) ) {{ return false ; }} return true ; }} \
             S f ( S p ) {{ if ( glx_equal ( p , f ( s [ 1 ] ) ) && ! glx_equal ( s [ i ] . t , p . t ) || p . v == s [ 0 ] . v ) {{ }} }}"
        );
        assert_eq!(of(&format!("{head}{text}")), wanted);
        let text = "struct T { float t [ 2 ] ; } ; void f ( T a , T b ) { if ( a . t != b . t ) { } }";
        let wanted = text.replace("a . t != b . t", "! ( ( a . t [ 0 ] == b . t [ 0 ] ) && ( a . t [ 1 ] == b . t [ 1 ] ) )");
        assert_eq!(of(text), wanted);
        let text = "void main() { float a[2], b = a[1]; if (a == float[2](1.0, b) && b == a[0]) { } }";
        let wanted = "{ float a [ 2 ] , b = a [ 1 ] ; if ( glx_equal ( a , float [ 2 ] ( 1.0 , b ) ) && b == a [ 0 ] ) { } }";
        assert_eq!(of(text), format!("{array} void main ( ) {wanted}"));
    }

    #[test]
    fn others_and_damaged_ones_are_left_alone() {
        for text in [
            "void f ( ) { float a [ 2 ] ; vec2 b ; b == b ; a [ 0 ] == b . x ; ( a ) == a ; }",
            // Of two types.
            "void f ( ) { { float a [ 2 ] ; } { float a ; a == a ; } }",
            "struct S { } ; void f ( ) { S s ; s == ; == s ; s . == s ) == ] == a }",
        ] {
            assert_eq!(of(text), text);
        }
        for text in ["struct S { S s; }; void f() { S a; a == a; }", "struct S { float a[ == }", "void f() { ) == ( [ == . }"] {
            of(text);
        }
    }
}
