//! The ends of functions. What follows `return`, `discard`, `break` or `continue` in its block never runs: naga refuses some of it. A function that
//! has a result may end without `return` where no run gets there, but naga wants one.

use super::outline::items;
use super::statements::{Event, walk};
use super::tokens::Token;
use super::words::is_type;

/// A statement or a block that is not complete.
struct Scope {
    /// Its first token.
    start: usize,
    /// Whether it is a block: what follows in it has no scope of its own.
    block: bool,
    /// Whether it is the block of `switch`.
    labels: bool,
    /// Whether its last statement is one after which control goes elsewhere.
    leaving: bool,
    /// Whether no run gets to its end.
    ended: bool,
    /// Whether no run gets behind the `if` whose `else` follows in it.
    branch: bool,
}

/// What is wrong with the ends of a function.
struct Ends {
    /// Positions of tokens that never run.
    dead: Vec<usize>,
    /// Whether a run may get to the end of the function.
    open: bool,
}

/// Statements behind which no run goes on. For naga, a run goes on behind the last one.
const LEAVING: [&str; 4] = ["return", "break", "continue", "discard"];

/// Looks at the function whose body begins at `open`; no run goes on behind statements of these kinds.
fn ends(tokens: &[Token], open: usize, leaving: &[&str]) -> Ends {
    let mut scopes: Vec<Scope> = Vec::new();
    let mut ends = Ends { dead: Vec::new(), open: true };
    walk(tokens, open, &mut |event| {
        let unreached = |scopes: &[Scope]| scopes.iter().any(|scope| scope.block && scope.ended);
        match event {
            Event::Enter(at) => {
                if unreached(&scopes) {
                    ends.dead.push(at);
                }
                let block = tokens[at].is("{");
                let labels = block && scopes.last().is_some_and(|outer| tokens[outer.start].is("switch"));
                scopes.push(Scope { start: at, block, labels, leaving: false, ended: false, branch: false });
            }
            Event::Token(at) => {
                let Some(scope) = scopes.last_mut() else { return };
                let text = tokens[at].text.as_str();
                // naga knows the end of a case by its `break`.
                if scope.labels && matches!(text, "case" | "default" | "break") {
                    scope.ended = false;
                }
                scope.leaving |= leaving.contains(&text);
                let left = text == ";" && std::mem::take(&mut scope.leaving);
                if unreached(&scopes) {
                    ends.dead.push(at);
                }
                if let Some(scope) = scopes.last_mut().filter(|_| left) {
                    scope.ended = true;
                }
            }
            Event::Condition(at) => {
                if unreached(&scopes) {
                    ends.dead.push(at);
                }
            }
            Event::Leave(at) => {
                let Some(scope) = scopes.pop() else { return };
                if scope.block && unreached(&scopes) {
                    ends.dead.push(at);
                }
                let Some(outer) = scopes.last_mut() else {
                    ends.open = !scope.ended;
                    return;
                };
                match tokens[scope.start].text.as_str() {
                    "{" => outer.ended |= scope.ended,
                    "if" => outer.branch = scope.ended && tokens.get(at + 1).is_some_and(|next| next.is("else")),
                    "else" => outer.ended |= std::mem::take(&mut outer.branch) && scope.ended,
                    _ => {}
                }
            }
        }
    });
    ends
}

/// Whether a case with these statements goes on with the next one.
pub fn falls_through(body: &[Token]) -> bool {
    let bracket = |text| Token::new(text, 0);
    let block: Vec<Token> = [bracket("{")].into_iter().chain(body.iter().cloned()).chain([bracket("}")]).collect();
    ends(&block, 0, &LEAVING).open
}

/// Removes what never runs from the functions of one shader, and puts a `return`, which no run reaches if the function is right, at the end of those
/// that need one.
pub fn returns(tokens: &mut Vec<Token>) {
    const QUALIFIERS: [&str; 4] = ["highp", "mediump", "lowp", "precise"];
    let (mut dead, mut added) = (Vec::new(), Vec::new());
    for item in items(tokens) {
        let (Some(open), Some(header)) = (item.body(tokens), item.function) else { continue };
        dead.extend(ends(tokens, open, &LEAVING).dead);
        let kind: Vec<String> = tokens[item.whole.start..header.name.max(item.whole.start)]
            .iter()
            .filter(|token| !QUALIFIERS.contains(&token.text.as_str()))
            .map(|token| token.text.clone())
            .collect();
        if !kind.is_empty() && kind != ["void"] && ends(tokens, open, &LEAVING[..3]).open {
            added.push((item.whole.end - 1, kind));
        }
    }
    if dead.is_empty() && added.is_empty() {
        return;
    }
    let (mut dead, mut added) = (dead.into_iter().peekable(), added.into_iter().peekable());
    let mut out = Vec::with_capacity(tokens.len());
    for (at, token) in std::mem::take(tokens).into_iter().enumerate() {
        if let Some((_, kind)) = added.next_if(|&(end, _)| end == at) {
            let text: Vec<&str> = match &kind[..] {
                [one] if is_type(one) => vec!["return", one, "(", "0", ")", ";"],
                // A variable of any type begins with zeros.
                kind => {
                    let kind = kind.iter().map(String::as_str);
                    ["{"].into_iter().chain(kind).chain(["glx_none", ";", "return", "glx_none", ";", "}"]).collect()
                }
            };
            out.extend(text.into_iter().map(|text| Token::new(text, token.line)));
        }
        if dead.next_if_eq(&at).is_none() {
            out.push(token);
        }
    }
    *tokens = out;
}

#[cfg(test)]
mod tests {
    use super::super::tokens::{preprocess, print};
    use super::*;

    fn of(text: &str) -> String {
        let (_, mut tokens) = preprocess(text).expect("tokens");
        returns(&mut tokens);
        print(&tokens).split_whitespace().collect::<Vec<_>>().join(" ")
    }

    #[test]
    fn a_function_whose_end_can_be_reached_returns_there() {
        assert_eq!(
            of("bool f() { for (;;) if (a) return true; else return false; } void g() { while (a) b; } \
                float h() { do return 1.0; while (a); } int k() { for (;;) ; return 1; } \
                int l() { if (a) return 1; else { for (;;) ; } } int m() { if (a) return 1; else { return 2; } }"),
            "bool f ( ) { for ( ; ; ) if ( a ) return true ; else return false ; return bool ( 0 ) ; } void g ( ) { while ( a ) b ; } \
             float h ( ) { do return 1.0 ; while ( a ) ; return float ( 0 ) ; } int k ( ) { for ( ; ; ) ; return 1 ; } \
             int l ( ) { if ( a ) return 1 ; else { for ( ; ; ) ; } return int ( 0 ) ; } \
             int m ( ) { if ( a ) return 1 ; else { return 2 ; } }"
        );
        assert_eq!(
            of(
                "vec4 f() { if (a) return b; else if (c) return d; } S g() { if (a) return b; } highp float[2] h() { } vec2 k() { discard; }"
            ),
            "vec4 f ( ) { if ( a ) return b ; else if ( c ) return d ; return vec4 ( 0 ) ; } \
             S g ( ) { if ( a ) return b ; { S glx_none ; return glx_none ; } } \
             highp float [ 2 ] h ( ) { { float [ 2 ] glx_none ; return glx_none ; } } vec2 k ( ) { discard ; return vec2 ( 0 ) ; }"
        );
    }

    #[test]
    fn what_never_runs_is_removed() {
        for (text, kept) in [
            ("void f() { a; return; b; { c; } for (;;) d; }", "void f ( ) { a ; return ; }"),
            ("void f() { if (a) { return; b; } c; }", "void f ( ) { if ( a ) { return ; } c ; }"),
            (
                "void f() { for (;;) { if (a) break; else continue; do { b; } while (c); } d; }",
                "void f ( ) { for ( ; ; ) { if ( a ) break ; else continue ; } d ; }",
            ),
            ("void f() { { discard; } a; }", "void f ( ) { { discard ; } }"),
            (
                "void f() { switch (a) { case 0: return; b; case 1: c; break; d; default: { return; } break; } e; }",
                "void f ( ) { switch ( a ) { case 0 : return ; case 1 : c ; break ; default : { return ; } break ; } e ; }",
            ),
            (
                "void f() { if (a) if (b) return; else return; c; }",
                "void f ( ) { if ( a ) if ( b ) return ; else return ; c ; }",
            ),
            (
                "void f() { if (a) return; else { b; return; } c[1] = d(e); }",
                "void f ( ) { if ( a ) return ; else { b ; return ; } }",
            ),
        ] {
            assert_eq!(of(text), kept, "{text}");
        }
        for text in
            ["void f() { return; } }", "int f() { return 1; { ", "int f() { else } else ; }", "int f( { return ; ) a; }"]
        {
            of(text);
        }
    }
}
