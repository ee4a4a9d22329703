//! `continue` in the body of `do`, which goes on with the condition. Naga goes on with the body, so such a loop becomes one with `while`, whose
//! condition is not read the first time.

use std::collections::BTreeMap;

use super::outline::items;
use super::statements::{Event, walk};
use super::tokens::Token;

/// A loop that is rewritten.
struct Loop {
    /// The position of its second keyword.
    condition: usize,
    /// That of its last token.
    end: usize,
}

/// Rewrites the loops of one shader; none if there are no such loops.
pub fn loops(tokens: &[Token]) -> Option<Vec<Token>> {
    if !tokens.iter().any(|token| token.is("do")) || !tokens.iter().any(|token| token.is("continue")) {
        return None;
    }
    let mut found: BTreeMap<usize, Loop> = BTreeMap::new();
    for item in items(tokens) {
        let Some(open) = item.body(tokens) else { continue };
        // Scopes around a token: the first token of each, whether `continue` goes on with it, and its condition.
        let mut scopes: Vec<(usize, bool, usize)> = Vec::new();
        walk(tokens, open, &mut |event| match event {
            Event::Enter(at) => scopes.push((at, false, at)),
            Event::Condition(at) => scopes.last_mut().into_iter().for_each(|scope| scope.2 = at),
            Event::Token(at) if tokens[at].is("continue") => {
                let is_loop = |start: usize| matches!(tokens[start].text.as_str(), "do" | "while" | "for");
                let innermost = scopes.iter_mut().rev().find(|scope| is_loop(scope.0));
                innermost.into_iter().for_each(|scope| scope.1 = true);
            }
            Event::Token(_) => {}
            Event::Leave(end) => {
                if let Some((start, true, condition)) = scopes.pop()
                    && tokens[start].is("do")
                    && condition + 2 < end
                    && tokens[end].is(";")
                {
                    found.insert(start, Loop { condition, end });
                }
            }
        });
    }
    if found.is_empty() {
        return None;
    }
    let ends: BTreeMap<usize, usize> = found.values().map(|of| (of.condition, of.end)).collect();
    let (mut out, mut at) = (Vec::with_capacity(tokens.len()), 0);
    while at < tokens.len() {
        let line = tokens[at].line;
        if let Some(Loop { condition, end }) = found.get(&at) {
            let name = format!("glx_again{at}");
            let text = ["{", "bool", &name, "=", "false", ";", "while", "(", &name, "?", "("];
            out.extend(text.map(|text| Token::new(text, line)));
            out.extend(tokens[condition + 2..end - 1].iter().map(|token| Token::new(token.text.clone(), line)));
            out.extend([")", ":", "(", &name, "=", "true", ")", ")"].map(|text| Token::new(text, line)));
        } else if let Some(&end) = ends.get(&at) {
            out.push(Token::new("}", line));
            at = end;
        } else {
            out.push(tokens[at].clone());
        }
        at += 1;
    }
    Some(out)
}

#[cfg(test)]
mod tests {
    use super::super::tokens::{preprocess, print};
    use super::*;

    fn of(text: &str) -> Option<String> {
        let (_, tokens) = preprocess(text).expect("tokens");
        loops(&tokens).map(|tokens| print(&tokens).split_whitespace().collect::<Vec<_>>().join(" "))
    }

    #[test]
    fn continue_goes_on_with_the_condition() {
        assert_eq!(
            of("void f() { do { if (a) continue; do b; while (b); } while (c(d)); e; }").expect("a loop"),
            "void f ( ) { { bool glx_again5 = false ; while ( glx_again5 ? ( c ( d ) ) : ( glx_again5 = true ) ) \
             { if ( a ) continue ; do b ; while ( b ) ; } } e ; }"
        );
        // The loop inside has it.
        assert_eq!(of("void f() { do { for (;;) { continue; } } while (a); }"), None);
        assert_eq!(of("void f() { while (a) { do b; while (c); continue; } }"), None);
        for text in ["void f() { do { continue; } while ( }", "void f() { do continue", "void f() { do continue; while ; }"] {
            of(text);
        }
    }
}
