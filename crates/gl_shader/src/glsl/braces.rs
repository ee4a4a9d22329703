//! A declaration that is the whole body of a branch or a loop. It has a scope of its own, which naga gives to blocks only.

use super::declarators::declaration;
use super::outline::items;
use super::statements::{Event, walk};
use super::tokens::{Token, closing};

/// Puts such declarations of one shader into blocks.
pub fn braces(tokens: &mut Vec<Token>) {
    let (mut opens, mut closes) = (Vec::new(), Vec::new());
    for item in items(tokens) {
        let Some(open) = item.body(tokens) else { continue };
        walk(tokens, open, &mut |event| {
            let Event::Enter(at) = event else { return };
            let body = match tokens[at].text.as_str() {
                "do" | "else" => Some(at + 1),
                "if" | "for" | "while" => closing(tokens, at + 1).map(|close| close + 1),
                _ => None,
            };
            if let Some(body) = body
                && let Some(end) = declaration(tokens, body)
            {
                opens.push(body);
                closes.push(end + 1);
            }
        });
    }
    if opens.is_empty() {
        return;
    }
    opens.sort_unstable();
    closes.sort_unstable();
    let (mut opens, mut closes) = (opens.into_iter().peekable(), closes.into_iter().peekable());
    let mut out = Vec::with_capacity(tokens.len());
    for at in 0..=tokens.len() {
        let line = tokens.get(at).or(tokens.last()).map_or(0, |token| token.line);
        while closes.next_if_eq(&at).is_some() {
            out.push(Token::new("}", line));
        }
        while opens.next_if_eq(&at).is_some() {
            out.push(Token::new("{", line));
        }
        out.extend(tokens.get(at).cloned());
    }
    *tokens = out;
}

#[cfg(test)]
mod tests {
    use super::super::tokens::{preprocess, print};
    use super::*;

    #[test]
    fn a_declaration_that_is_a_body_gets_a_block() {
        let text =
            "void f() { if (a) int i = 1; else float i; do int i = g(), j; while (i < 2); for (int k;;) if (b) { int i; } }";
        let (_, mut tokens) = preprocess(text).expect("tokens");
        braces(&mut tokens);
        assert_eq!(
            print(&tokens).split_whitespace().collect::<Vec<_>>().join(" "),
            "void f ( ) { if ( a ) { int i = 1 ; } else { float i ; } do { int i = g ( ) , j ; } while ( i < 2 ) ; \
             for ( int k ; ; ) if ( b ) { int i ; } }"
        );
    }
}
