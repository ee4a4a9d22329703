//! The statements of a function: where their scopes begin and end.

use super::tokens::{Token, closing};

/// What happens at a token.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Event {
    /// A scope begins: that of a block, of a loop or of a branch. The token is its bracket or its keyword.
    Enter(usize),
    /// A token that is neither.
    Token(usize),
    /// The `while` after the body of `do`.
    Condition(usize),
    /// The innermost scope ends with this token.
    Leave(usize),
}

/// A statement that is not complete.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Frame {
    Block,
    /// `for`, `while` and `switch` before the end of the brackets, which are open `depth` deep.
    Header {
        depth: usize,
        branch: bool,
    },
    Body {
        branch: bool,
    },
    Do,
    /// After the body of `do`.
    Until,
}

/// Goes through the tokens of a function's body from its bracket at `open` on, in order; returns the position after it.
pub fn walk(tokens: &[Token], open: usize, visit: &mut dyn FnMut(Event)) -> usize {
    let (mut frames, mut depth, mut at): (Vec<Frame>, usize, usize) = (Vec::new(), 0, open);
    while let Some(token) = tokens.get(at) {
        let mut ended = false;
        match token.text.as_str() {
            // An initialiser is part of a statement.
            "{" if at > 0 && tokens[at - 1].is("=") => {
                let end = closing(tokens, at).unwrap_or(tokens.len() - 1);
                (at..=end).for_each(|at| visit(Event::Token(at)));
                at = end;
            }
            "{" => {
                frames.push(Frame::Block);
                visit(Event::Enter(at));
            }
            "}" => {
                while let Some(frame) = frames.pop() {
                    visit(Event::Leave(at));
                    if frame == Frame::Block {
                        break;
                    }
                }
                ended = true;
            }
            "while" if frames.last() == Some(&Frame::Until) => visit(Event::Condition(at)),
            "for" | "while" | "switch" | "if" => {
                frames.push(Frame::Header { depth, branch: token.is("if") });
                visit(Event::Enter(at));
            }
            "do" => {
                frames.push(Frame::Do);
                visit(Event::Enter(at));
            }
            // The branch before it has ended.
            "else" => {
                frames.push(Frame::Body { branch: false });
                visit(Event::Enter(at));
            }
            text => {
                visit(Event::Token(at));
                match text {
                    "(" | "[" => depth += 1,
                    ")" | "]" => {
                        depth = depth.saturating_sub(1);
                        if let Some(frame) = frames.last_mut()
                            && let Frame::Header { depth: outside, branch } = *frame
                            && outside == depth
                        {
                            *frame = Frame::Body { branch };
                        }
                    }
                    ";" => ended = !matches!(frames.last(), Some(Frame::Header { .. })),
                    _ => {}
                }
            }
        }
        if ended && frames.last() == Some(&Frame::Until) && token.is(";") {
            frames.pop();
            visit(Event::Leave(at));
        }
        while ended {
            match frames.last_mut() {
                Some(Frame::Body { branch }) => {
                    // What is around the branch ends after its `else`.
                    ended = !(*branch && tokens.get(at + 1).is_some_and(|next| next.is("else")));
                    frames.pop();
                    visit(Event::Leave(at));
                }
                Some(frame @ Frame::Do) => {
                    *frame = Frame::Until;
                    ended = false;
                }
                _ => ended = false,
            }
        }
        at += 1;
        if frames.is_empty() {
            break;
        }
    }
    at
}

#[cfg(test)]
mod tests {
    use super::super::tokens::preprocess;
    use super::*;

    #[test]
    fn scopes_begin_and_end_with_statements() {
        let of = |text: &str| {
            let (_, tokens) = preprocess(text).expect("tokens");
            let mut out = String::new();
            let end = walk(&tokens, 0, &mut |event| {
                let (mark, at) = match event {
                    Event::Enter(at) => ("<", at),
                    Event::Leave(at) => (">", at),
                    Event::Condition(at) => ("?", at),
                    Event::Token(at) => ("", at),
                };
                out += &if mark == ">" { mark.to_owned() } else { format!("{mark}{}", tokens[at].text) };
            });
            (out, end == tokens.len())
        };
        for (text, wanted) in [
            ("{ a; { b; } c; }", "<{a;<{b;>c;>"),
            ("{ if (a) b; else c; d; }", "<{<if(a)b;><elsec;>d;>"),
            ("{ for (;;) if (a) { b; } else for (c;;) d; e; }", "<{<for(;;)<if(a)<{b;>><else<for(c;;)d;>>>e;>"),
            ("{ do a; while (b); do { c; } while (d); e; }", "<{<doa;?while(b);><do<{c;>?while(d);>e;>"),
            ("{ if (a) do b; while (c); else d; e; }", "<{<if(a)<dob;?while(c);>><elsed;>e;>"),
            (
                "{ switch (a) { case 1: b; break; } while (a(b)) ; int c[2] = {1, 2}; }",
                "<{<switch(a)<{case1:b;break;>><while(a(b));>intc[2]={1,2};>",
            ),
        ] {
            assert_eq!(of(text), (wanted.to_owned(), true), "{text}");
        }
        for text in ["{ else } else ; }", "{ ( { ) } ; do", "while ( ;", "{ do } while (", "} {"] {
            of(text);
        }
    }
}
