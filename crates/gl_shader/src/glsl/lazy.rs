//! `&&` and `||`, whose right sides must not run where the left side decides (OpenGL Shading Language 1.20, section 5.9). Naga runs both sides,
//! so those whose right sides have effects become conditional expressions, of which naga runs one branch.

use std::collections::BTreeSet;

use super::tokens::{Dialect, Token};

/// The operands of one level of brackets that are not yet complete.
struct Level {
    /// Where the operands of `||` and of `&&` begin.
    or_start: usize,
    and_start: usize,
    /// The operators whose right sides are not yet complete.
    or: Option<usize>,
    and: Option<usize>,
    /// Whether a statement follows the closing bracket.
    control: bool,
}

impl Level {
    fn from(start: usize, control: bool) -> Level {
        Level { or_start: start, and_start: start, or: None, and: None, control }
    }
}

/// What is changed in the tokens of a shader.
struct Changes<'a> {
    /// Effects before each token.
    effects: &'a [u32],
    /// Operators that are replaced.
    operators: BTreeSet<usize>,
    /// Brackets that open before a token, and ends of expressions before a token with the value that a skipped right side has.
    opens: Vec<usize>,
    ends: Vec<(usize, &'static str)>,
}

impl Changes<'_> {
    /// Completes an operator: its expression begins at `start`, and its right side ends before `end`.
    fn complete(&mut self, operator: Option<usize>, start: usize, end: usize, is_or: bool) {
        let Some(operator) = operator.filter(|&operator| self.effects[end] > self.effects[operator]) else { return };
        self.operators.insert(operator);
        self.opens.push(start);
        self.ends.push((end, if is_or { "" } else { "false" }));
    }

    fn complete_all(&mut self, level: &mut Level, end: usize) {
        self.complete(level.and.take(), level.and_start, end, false);
        self.complete(level.or.take(), level.or_start, end, true);
    }
}

/// Rewrites `&&` and `||` in one shader. `functions` are the functions of all shaders of the stage.
pub fn lazy(tokens: &[Token], functions: &BTreeSet<String>) -> Option<Vec<Token>> {
    if !tokens.iter().any(|token| token.is("&&") || token.is("||")) {
        return None;
    }
    let mut effects = vec![0_u32];
    for (at, token) in tokens.iter().enumerate() {
        let calls = || token.word && functions.contains(&token.text) && tokens.get(at + 1).is_some_and(|next| next.is("("));
        effects.push(effects[at] + u32::from(is_assignment(token) || calls()));
    }
    let mut changes = Changes { effects: &effects, operators: BTreeSet::new(), opens: Vec::new(), ends: Vec::new() };
    let mut levels = vec![Level::from(0, false)];
    for (at, token) in tokens.iter().enumerate() {
        let level = levels.last_mut().expect("the outermost level stays");
        match token.text.as_str() {
            "(" | "[" | "{" => {
                if token.is("{") {
                    changes.complete_all(level, at);
                }
                let control =
                    at > 0 && matches!(tokens[at - 1].text.as_str(), "if" | "while" | "for" | "switch") || token.is("{");
                levels.push(Level::from(at + 1, control));
            }
            ")" | "]" | "}" => {
                changes.complete_all(level, at);
                let control = level.control;
                let outermost = levels.len() == 1;
                if !outermost {
                    levels.pop();
                }
                if control || outermost {
                    levels.last_mut().into_iter().for_each(|level| *level = Level::from(at + 1, level.control));
                }
            }
            "&&" => {
                changes.complete(level.and.replace(at), level.and_start, at, false);
            }
            "||" => {
                changes.complete_all(level, at);
                level.or = Some(at);
                level.and_start = at + 1;
            }
            "^^" => {
                changes.complete(level.and.take(), level.and_start, at, false);
                level.and_start = at + 1;
            }
            "," | ";" | "?" | ":" | "return" | "else" | "case" | "do" => {
                changes.complete_all(level, at);
                *level = Level::from(at + 1, level.control);
            }
            _ if is_assignment(token) && !matches!(token.text.as_str(), "++" | "--") => {
                changes.complete_all(level, at);
                *level = Level::from(at + 1, level.control);
            }
            _ => {}
        }
    }
    while let Some(mut level) = levels.pop() {
        changes.complete_all(&mut level, tokens.len());
    }
    (!changes.operators.is_empty()).then(|| written(tokens, &changes))
}

/// Whether a token writes a variable.
fn is_assignment(token: &Token) -> bool {
    let text = token.text.as_str();
    matches!(text, "=" | "++" | "--") || text.len() >= 2 && text.ends_with('=') && !matches!(text, "==" | "!=" | "<=" | ">=")
}

/// The tokens with the changes.
fn written(tokens: &[Token], changes: &Changes) -> Vec<Token> {
    let mut opens = changes.opens.clone();
    opens.sort_unstable();
    // In the order in which they were complete, inner ones first; sorting keeps that.
    let mut ends = changes.ends.clone();
    ends.sort_by_key(|&(at, _)| at);
    let (mut opens, mut ends) = (opens.into_iter().peekable(), ends.into_iter().peekable());
    let mut out = Vec::with_capacity(tokens.len());
    for at in 0..=tokens.len() {
        let line = tokens.get(at).or(tokens.last()).map_or(0, |token| token.line);
        let mut put = |text: &str| out.push(Token::new(text, line));
        while let Some((_, skipped)) = ends.next_if(|&(end, _)| end == at) {
            if !skipped.is_empty() {
                put(":");
                put(skipped);
            }
            put(")");
        }
        while opens.next_if(|&open| open == at).is_some() {
            put("(");
        }
        match tokens.get(at) {
            Some(token) if changes.operators.contains(&at) => {
                put("?");
                if token.is("||") {
                    put("true");
                    put(":");
                }
            }
            Some(token) => out.push(token.clone()),
            None => {}
        }
    }
    out
}

/// The names of all functions of a stage.
pub fn functions(shaders: &[(Dialect, Vec<Token>)]) -> BTreeSet<String> {
    let of = |tokens: &Vec<Token>| {
        let items = super::outline::items(tokens).into_iter();
        items.filter_map(|item| Some(tokens[item.function?.name].text.clone())).collect::<Vec<_>>()
    };
    shaders.iter().flat_map(|(_, tokens)| of(tokens)).collect()
}

#[cfg(test)]
mod tests {
    use super::super::tokens::{preprocess, print};
    use super::*;

    fn of(text: &str) -> Option<String> {
        let (_, tokens) = preprocess(text).expect("tokens");
        let functions = ["f", "g"].map(String::from).into();
        let of = |tokens: Vec<Token>| print(&tokens).split_whitespace().collect::<Vec<_>>().join(" ");
        lazy(&tokens, &functions).map(of)
    }

    #[test]
    fn right_sides_with_effects_become_branches() {
        for (text, wanted) in [
            ("a = b && f();", "a = ( b ? f ( ) : false ) ;"),
            ("a = b || i++ > 1;", "a = ( b ? true : i ++ > 1 ) ;"),
            ("if (a && b && f()) x;", "if ( ( a && b ? f ( ) : false ) ) x ;"),
            ("if (a && f() && g()) x;", "if ( ( ( a ? f ( ) : false ) ? g ( ) : false ) ) x ;"),
            ("a || b && f();", "( a ? true : ( b ? f ( ) : false ) ) ;"),
            ("a && b || f() && c || d;", "( a && b ? true : f ( ) && c ) || d ;"),
            ("a ^^ b && f() ^^ c || f();", "( a ^^ ( b ? f ( ) : false ) ^^ c ? true : f ( ) ) ;"),
            ("x ? a && f() : b || (c = d);", "x ? ( a ? f ( ) : false ) : ( b ? true : ( c = d ) ) ;"),
            ("if (x) a && f(); else b && f();", "if ( x ) ( a ? f ( ) : false ) ; else ( b ? f ( ) : false ) ;"),
            ("return a && !f();", "return ( a ? ! f ( ) : false ) ;"),
            ("h(a && f(), v[int(b || f())])", "h ( ( a ? f ( ) : false ) , v [ int ( ( b ? true : f ( ) ) ) ] )"),
            ("{ a; } b && f(); } c || f()", "{ a ; } ( b ? f ( ) : false ) ; } ( c ? true : f ( ) )"),
        ] {
            assert_eq!(of(text).as_deref(), Some(wanted), "{text}");
        }
    }

    #[test]
    fn others_stay_as_they_are() {
        for text in ["a && b || c == d", "f() && a", "a && sin(b) > 0.5", "x = a <= b && c", "&& || ) ( &&"] {
            assert_eq!(of(text), None, "{text}");
        }
    }
}
