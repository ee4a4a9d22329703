//! Components of components that are written: `v.zyx.x = 1.0` becomes `v.z = 1.0`, since naga has no such place.

use std::collections::BTreeSet;

use super::tokens::Token;

/// The numbers of the components that a word names.
fn components(word: &str) -> Option<Vec<usize>> {
    let names = ["xyzw", "rgba", "stpq"].into_iter().find(|names| word.chars().all(|c| names.contains(c)))?;
    (!word.is_empty() && word.len() <= 4).then(|| word.chars().filter_map(|c| names.find(c)).collect())
}

/// The number of the component that brackets name, if they have a number.
fn index(tokens: &[Token]) -> Option<Vec<usize>> {
    match tokens.get(..3)? {
        [open, number, close] if open.is("[") && close.is("]") => Some(vec![number.text.parse().ok()?]),
        _ => None,
    }
}

/// Rewrites them in one shader. `members` are words in the bodies of structures.
pub fn swizzles(tokens: &mut Vec<Token>, members: &BTreeSet<String>) {
    let (mut out, mut at): (Vec<Token>, usize) = (Vec::with_capacity(tokens.len()), 0);
    while let Some(token) = tokens.get(at) {
        let first = tokens.get(at + 1).filter(|_| token.is(".")).filter(|name| !members.contains(&name.text));
        let mut chosen = first.and_then(|name| components(&name.text));
        let mut end = at + 2;
        while let Some(all) = &chosen {
            let dot = tokens.get(end).is_some_and(|token| token.is("."));
            let (next, length) = if dot {
                (tokens.get(end + 1).and_then(|name| components(&name.text)), 2)
            } else {
                (tokens.get(end..).and_then(index), 3)
            };
            let Some(next) = next else { break };
            let of: Option<Vec<usize>> = next.iter().map(|&k| all.get(k).copied()).collect();
            if of.is_none() {
                break;
            }
            chosen = of;
            end += length;
        }
        let is_written = || {
            let operators = ["=", "+=", "-=", "*=", "/=", "++", "--"];
            tokens.get(end).is_some_and(|next| operators.contains(&next.text.as_str()))
        };
        match chosen.filter(|_| end > at + 2 && is_written()) {
            Some(chosen) => {
                out.push(token.clone());
                let name: String = chosen.iter().map(|&k| ['x', 'y', 'z', 'w'][k]).collect();
                out.push(Token::new(name, token.line));
                at = end;
            }
            None => {
                out.push(token.clone());
                at += 1;
            }
        }
    }
    *tokens = out;
}

#[cfg(test)]
mod tests {
    use super::super::tokens::{preprocess, print};
    use super::*;

    #[test]
    fn components_of_written_components_are_named_at_once() {
        for (text, wanted) in [
            ("v.xzy.z = 1;", "v . y = 1 ;"),
            ("v.bgr.yx.x += w.xyz.zyx.x;", "v . y += w . xyz . zyx . x ;"),
            (
                "v.wzyx[2] = 1; v.wzyx[i] = 1; v[2] = 1; v.xy[2] = 1;",
                "v . y = 1 ; v . wzyx [ i ] = 1 ; v [ 2 ] = 1 ; v . xy [ 2 ] = 1 ;",
            ),
            ("s.xy.x = 1; v.yx.x == 1;", "s . xy . x = 1 ; v . yx . x == 1 ;"),
        ] {
            let (_, mut tokens) = preprocess(text).expect("tokens");
            // `xy` is the name of a member.
            let members = if text.starts_with('s') { ["xy".to_owned()].into() } else { BTreeSet::new() };
            swizzles(&mut tokens, &members);
            assert_eq!(print(&tokens).split_whitespace().collect::<Vec<_>>().join(" "), wanted);
        }
    }
}
