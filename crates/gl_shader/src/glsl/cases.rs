//! Cases of `switch` that go on with the next one. WGSL has none, so such a case gets a copy of what it goes on with.

use super::outline::items;
use super::returns::falls_through;
use super::tokens::{Token, closing};

/// Maximum number of tokens of a shader with its copies.
const TOKENS_MAX: usize = 1 << 18;

/// A case: where its labels begin, where its statements begin, and where they end.
struct Case {
    labels: usize,
    start: usize,
    end: usize,
}

/// The cases of the block that begins at `open`.
fn cases(tokens: &[Token], open: usize, close: usize) -> Vec<Case> {
    let (mut list, mut at): (Vec<Case>, usize) = (Vec::new(), open + 1);
    while at < close {
        if matches!(tokens[at].text.as_str(), "case" | "default") {
            let Some(colon) = tokens[at..close].iter().position(|token| token.is(":")) else { break };
            let start = at + colon + 1;
            match list.last_mut() {
                // Several labels are one case.
                Some(last) if last.start == at => (last.start, last.end) = (start, close),
                last => {
                    last.into_iter().for_each(|last| last.end = at);
                    list.push(Case { labels: at, start, end: close });
                }
            }
            at = start;
        } else {
            let bracket = matches!(tokens[at].text.as_str(), "{" | "(" | "[");
            at = if bracket { closing(tokens, at).unwrap_or(close) } else { at } + 1;
        }
    }
    list
}

/// How a case ends.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Ending {
    /// With `break`, as naga knows it.
    Break,
    /// It goes on with the next case.
    Next,
    /// With another statement behind which no run goes on.
    Other,
}

/// How a case with these statements ends.
fn ending(body: &[Token]) -> Ending {
    match body {
        [before @ .., last, end] if last.is("break") && end.is(";") && falls_through(before) => Ending::Break,
        _ if falls_through(body) => Ending::Next,
        _ => Ending::Other,
    }
}

/// Puts the statements of a case where naga does not see how they end, and `break` behind them.
fn enclose(body: &mut Vec<Token>, line: u32) {
    let word = |text| Token::new(text, line);
    let inside = std::mem::take(body);
    body.extend(["if", "(", "true", ")", "{"].map(word));
    body.extend(inside);
    body.extend(["}", "break", ";"].map(word));
}

/// Writes the cases of one shader so that none goes on with the next one, and each ends with `break`. A shader that gets too long by that is left for naga to refuse.
pub fn separate(tokens: &mut Vec<Token>) {
    if !tokens.iter().any(|token| token.is("switch")) {
        return;
    }
    let inside: Vec<usize> = items(tokens)
        .iter()
        .filter_map(|item| item.body(tokens).map(|open| open..item.whole.end))
        .flat_map(|body| body.filter(|&at| tokens[at].is("switch")).collect::<Vec<_>>())
        .collect();
    // The last one first: it is in those before it, or behind them.
    for at in inside.into_iter().rev() {
        let Some(open) = closing(tokens, at + 1).map(|end| end + 1).filter(|&open| tokens.get(open).is_some_and(|t| t.is("{")))
        else {
            continue;
        };
        let Some(close) = closing(tokens, open) else { continue };
        let cases = cases(tokens, open, close);
        let Some((last, others)) = cases.split_last() else { continue };
        let line = tokens[close].line;
        let all = others.iter().map(|case| ending(&tokens[case.start..case.end]));
        // naga leaves the last case by itself.
        if all.chain([Ending::Break]).all(|ending| ending == Ending::Break) {
            continue;
        }
        // What each case runs, from the last one on.
        let mut bodies: Vec<Vec<Token>> = Vec::new();
        let mut length = tokens.len();
        for case in others.iter().chain([last]).rev() {
            let mut body = tokens[case.start..case.end].to_vec();
            match (ending(&body), bodies.last()) {
                (Ending::Break, _) => {}
                (Ending::Next, Some(next)) => {
                    length += next.len();
                    if length > TOKENS_MAX {
                        return;
                    }
                    body.extend_from_slice(next);
                    if ending(&body) == Ending::Other {
                        enclose(&mut body, line);
                    }
                }
                (Ending::Next, None) => body.extend(["break", ";"].map(|text| Token::new(text, line))),
                (Ending::Other, _) => enclose(&mut body, line),
            }
            bodies.push(body);
        }
        let mut block = tokens[open + 1..cases[0].labels].to_vec();
        for (case, body) in cases.iter().zip(bodies.into_iter().rev()) {
            block.extend_from_slice(&tokens[case.labels..case.start]);
            block.extend(body);
        }
        tokens.splice(open + 1..close, block);
    }
}

#[cfg(test)]
mod tests {
    use super::super::tokens::{preprocess, print};
    use super::*;

    fn of(text: &str) -> String {
        let (_, mut tokens) = preprocess(text).expect("tokens");
        separate(&mut tokens);
        print(&tokens).split_whitespace().collect::<Vec<_>>().join(" ")
    }

    #[test]
    fn a_case_that_goes_on_has_what_it_goes_on_with() {
        assert_eq!(
            of("void f() { switch (a) { case 0: b; case 1: case 2: { c; } default: d; break; case 3: e; } }"),
            "void f ( ) { switch ( a ) { case 0 : b ; { c ; } d ; break ; case 1 : case 2 : { c ; } d ; break ; default : d ; break ; case 3 : e ; break ; } }"
        );
        // The inner one first.
        assert_eq!(
            of("void f() { switch (a) { case 0: switch (b) { case 1: c; case 2: d; } case 3: e; break; } }"),
            "void f ( ) { switch ( a ) { case 0 : switch ( b ) { case 1 : c ; d ; break ; case 2 : d ; break ; } e ; break ; case 3 : e ; break ; } }"
        );
    }

    #[test]
    fn a_case_that_returns_ends_with_break_too() {
        assert_eq!(
            of("void f() { switch (a) { case 0: return; case 1: b; case 2: { discard; } break; default: return; } }"),
            "void f ( ) { switch ( a ) { case 0 : if ( true ) { return ; } break ; \
             case 1 : b ; if ( true ) { { discard ; } break ; } break ; case 2 : if ( true ) { { discard ; } break ; } break ; \
             default : if ( true ) { return ; } break ; } }"
        );
    }

    #[test]
    fn others_stay_as_they_are() {
        for text in [
            "void f ( ) { switch ( a ) { case 0 : b ; break ; case 1 : if ( c ) return ; d ; break ; default : return ; } }",
            "void f ( ) { switch ( a ) { } }",
        ] {
            assert_eq!(of(text), text);
        }
        for text in ["void f() { switch", "void f() { switch ( a ) { case", "void f() { switch () { case 1: { } case 2: ) } }"]
        {
            of(text);
        }
    }

    #[test]
    fn copies_have_a_bound() {
        let all: String = (0..1000).map(|k| format!("case {k}: a(b, c, d);")).collect();
        let text = format!("void f() {{ switch (a) {{ {all} }} }}");
        let plain = print(&preprocess(&text).expect("tokens").1);
        assert_eq!(of(&text), plain.split_whitespace().collect::<Vec<_>>().join(" "));
    }
}
