//! Functions that end with a loop. Their results may all be given in it, but naga wants a `return` after it.

use super::outline::items;
use super::statements::{Event, walk};
use super::tokens::Token;
use super::words::is_type;

/// Puts a `return`, which no run reaches if the function is right, at the end of such functions of one shader.
pub fn returns(tokens: &mut Vec<Token>) {
    let mut added = Vec::new();
    for item in items(tokens) {
        let (Some(open), Some(header)) = (item.body(tokens), item.function) else { continue };
        let result = &tokens[header.name.saturating_sub(1)];
        if header.name <= item.whole.start || !is_type(&result.text) || result.is("void") {
            continue;
        }
        // The last statement in the block of the function.
        let (mut depth, mut last) = (0_u32, None);
        walk(tokens, open, &mut |event| match event {
            Event::Enter(at) => {
                depth += 1;
                last = if depth == 2 { Some(at) } else { last };
            }
            Event::Leave(_) => depth = depth.saturating_sub(1),
            Event::Token(_) if depth == 1 => last = None,
            Event::Token(_) | Event::Condition(_) => {}
        });
        if last.is_some_and(|at| matches!(tokens[at].text.as_str(), "for" | "while" | "do")) {
            added.push((item.whole.end - 1, result.text.clone()));
        }
    }
    for (at, kind) in added.into_iter().rev() {
        let line = tokens[at].line;
        let statement = ["return", &kind, "(", "0", ")", ";"].map(|text| Token::new(text, line));
        tokens.splice(at..at, statement);
    }
}

#[cfg(test)]
mod tests {
    use super::super::tokens::{preprocess, print};
    use super::*;

    #[test]
    fn a_function_that_ends_with_a_loop_returns_after_it() {
        let text = "bool f() { for (;;) if (a) return true; else return false; } void g() { while (a) b; } \
            float h() { do return 1.0; while (a); } int k() { for (;;) ; return 1; } int l() { if (a) return 1; else { for (;;) ; } }";
        let (_, mut tokens) = preprocess(text).expect("tokens");
        returns(&mut tokens);
        assert_eq!(
            print(&tokens).split_whitespace().collect::<Vec<_>>().join(" "),
            "bool f ( ) { for ( ; ; ) if ( a ) return true ; else return false ; return bool ( 0 ) ; } void g ( ) { while ( a ) b ; } \
             float h ( ) { do return 1.0 ; while ( a ) ; return float ( 0 ) ; } int k ( ) { for ( ; ; ) ; return 1 ; } \
             int l ( ) { if ( a ) return 1 ; else { for ( ; ; ) ; } }"
        );
    }
}
