//! Alignments of structures that are members of others.
//!
//! WGSL: the alignment of a structure is the largest of its members', and `@align` counts. naga 30 forgets it as soon as the structure is
//! the type of something else: its members are then placed by the alignments of their types alone. So each member whose type has such
//! an alignment gets an `@align` of its own before naga reads the text.

use std::collections::{BTreeSet, HashMap};
use std::ops::Range;

use super::edits::Edit;
use crate::tokens::Token;

type Tokens<'t> = [(usize, Token<'t>)];

/// The alignment of a type.
#[derive(Clone, Debug, Default)]
struct Alignment {
    /// Of the types alone, as naga finds it.
    plain: u32,
    /// With attributes that are numbers.
    known: u32,
    /// Attributes that are not.
    unknown: BTreeSet<String>,
}

impl Alignment {
    fn of(n: u32) -> Alignment {
        Alignment { plain: n, known: n, unknown: BTreeSet::new() }
    }

    fn is_lost(&self) -> bool {
        self.known > self.plain || !self.unknown.is_empty()
    }

    /// The attribute that says it.
    fn attribute(&self) -> String {
        let known = self.known.to_string();
        let all = self.unknown.iter().fold(known, |all, one| format!("max(i32({one}), {all})"));
        format!("@align({all}) ")
    }
}

/// A member of a structure: numbers of tokens.
#[derive(Clone)]
struct Member {
    begin: usize,
    name: usize,
    /// What stands in the brackets of its `@align`.
    align: Option<Range<usize>>,
    ty: Range<usize>,
}

enum Declaration {
    Struct(Vec<Member>),
    Alias(Range<usize>),
}

/// The pass over a text.
struct Layouts<'t, 's> {
    text: &'t str,
    tokens: &'s Tokens<'t>,
    declarations: HashMap<&'t str, Declaration>,
    found: HashMap<&'t str, Alignment>,
    /// Types that are being looked at: a type that has itself is naga's to refuse.
    open: Vec<&'t str>,
}

/// The attributes that a text lacks.
///
/// # Errors
/// If an `@align` is less than the alignment of the member's type, or one of them is not known: the byte, and why.
pub(super) fn attributes(text: &str, tokens: &Tokens<'_>) -> Result<Vec<Edit>, (usize, String)> {
    let mut layouts = Layouts { text, tokens, declarations: HashMap::new(), found: HashMap::new(), open: Vec::new() };
    layouts.collect();
    let mut names: Vec<&str> = layouts.declarations.keys().copied().collect();
    names.sort_unstable();
    let mut edits = Vec::new();
    for name in names {
        let Declaration::Struct(members) = &layouts.declarations[name] else { continue };
        for Member { begin, name: member, align, ty } in members.clone() {
            let alignment = layouts.of_type(ty);
            if !alignment.is_lost() {
                continue;
            }
            let Some(align) = align else {
                edits.push(Edit::insert(tokens[begin].0, alignment.attribute()));
                continue;
            };
            let at = tokens[member].0;
            match layouts.number(&align) {
                Some(n) if n >= alignment.known && alignment.unknown.is_empty() => {}
                Some(n) if n < alignment.known => {
                    let message =
                        format!("an @align of {n}, which is less than the alignment of the member's type, {}", alignment.known);
                    return Err((at, message));
                }
                _ => {
                    let message = "the alignment of this member and that of its type cannot be compared, because one of \
                                   them is not written as a number";
                    return Err((at, message.to_owned()));
                }
            }
        }
    }
    Ok(edits)
}

impl<'t> Layouts<'t, '_> {
    fn token(&self, at: usize) -> Option<Token<'t>> {
        self.tokens.get(at).map(|(_, token)| *token)
    }

    /// The number of the token after the bracket that closes the one at `at`.
    fn after(&self, at: usize) -> usize {
        let mut depth = 0;
        for n in at..self.tokens.len() {
            match self.tokens[n].1 {
                Token::Open(_) => depth += 1,
                Token::Close(_) => {
                    depth -= 1;
                    if depth == 0 {
                        return n + 1;
                    }
                }
                _ => {}
            }
        }
        self.tokens.len()
    }

    /// The end of a type that begins at `at`: a comma or a closing bracket outside of its template list.
    fn end_of_type(&self, mut at: usize) -> usize {
        let mut depth = 0;
        while let Some(token) = self.token(at) {
            match token {
                Token::Operator("<") => depth += 1,
                Token::Operator(">") => depth -= 1,
                Token::Separator(',') if depth <= 0 => return at,
                Token::Separator(';') | Token::Close(_) => return at,
                Token::Open(_) => {
                    at = self.after(at);
                    continue;
                }
                _ => {}
            }
            at += 1;
        }
        at
    }

    /// Finds the structures and the aliases.
    fn collect(&mut self) {
        let mut at = 0;
        while let Some(token) = self.token(at) {
            match (token, self.token(at + 1), self.token(at + 2)) {
                (Token::Word("struct"), Some(Token::Word(name)), Some(Token::Open('{'))) => {
                    let end = self.after(at + 2);
                    let members = self.members(at + 3, end.saturating_sub(1));
                    self.declarations.insert(name, Declaration::Struct(members));
                    at = end;
                }
                (Token::Word("alias"), Some(Token::Word(name)), Some(Token::Operator("="))) => {
                    let end = self.end_of_type(at + 3);
                    self.declarations.insert(name, Declaration::Alias(at + 3..end));
                    at = end;
                }
                (Token::Open(_), ..) => at = self.after(at),
                _ => at += 1,
            }
        }
    }

    fn members(&self, mut at: usize, end: usize) -> Vec<Member> {
        let mut members = Vec::new();
        while at < end {
            let begin = at;
            let mut align = None;
            while self.token(at) == Some(Token::Operator("@")) {
                let is_align = self.token(at + 1) == Some(Token::Word("align"));
                at += 2;
                if self.token(at) == Some(Token::Open('(')) {
                    let after = self.after(at);
                    if is_align {
                        align = Some(at + 1..after.saturating_sub(1));
                    }
                    at = after;
                }
            }
            if !matches!(self.token(at), Some(Token::Word(_))) || self.token(at + 1) != Some(Token::Separator(':')) {
                // No member: naga says what is wrong.
                return members;
            }
            let to = self.end_of_type(at + 2).min(end);
            members.push(Member { begin, name: at, align, ty: at + 2..to });
            at = to + 1;
        }
        members
    }

    /// The text of some tokens.
    fn part(&self, range: &Range<usize>) -> &'t str {
        let start = self.tokens.get(range.start).map_or(self.text.len(), |token| token.0);
        let end = self.tokens.get(range.end).map_or(self.text.len(), |token| token.0);
        &self.text[start.min(end)..end]
    }

    /// What an attribute says, if it is a number. A trailing comma is allowed.
    fn number(&self, range: &Range<usize>) -> Option<u32> {
        let has_comma = range.len() == 2 && self.token(range.start + 1) == Some(Token::Separator(','));
        if range.len() != 1 && !has_comma || self.token(range.start) != Some(Token::Other) {
            return None;
        }
        let digits = self.part(&(range.start..range.start + 1));
        let digits: String = digits.chars().take_while(char::is_ascii_alphanumeric).collect();
        let digits = digits.trim_end_matches(['i', 'u']);
        match digits.strip_prefix("0x").or_else(|| digits.strip_prefix("0X")) {
            Some(hexadecimal) => u32::from_str_radix(hexadecimal, 16).ok(),
            None => digits.parse().ok(),
        }
    }

    fn of_name(&mut self, name: &'t str) -> Alignment {
        if let Some(found) = self.found.get(name) {
            return found.clone();
        }
        if self.open.contains(&name) {
            return Alignment::default();
        }
        self.open.push(name);
        let alignment = match &self.declarations[name] {
            Declaration::Alias(ty) => self.of_type(ty.clone()),
            Declaration::Struct(members) => {
                let members: Vec<(Option<Range<usize>>, Range<usize>)> =
                    members.iter().map(|member| (member.align.clone(), member.ty.clone())).collect();
                let mut all = Alignment::default();
                for (align, ty) in members {
                    let own = self.of_type(ty);
                    all.plain = all.plain.max(own.plain);
                    match align.as_ref().map(|align| self.number(align)) {
                        None => {
                            all.known = all.known.max(own.known);
                            all.unknown.extend(own.unknown);
                        }
                        Some(Some(n)) => all.known = all.known.max(n),
                        Some(None) => {
                            all.known = all.known.max(own.plain);
                            let text = align.map(|align| self.part(&align).trim().trim_end_matches(',').to_owned());
                            all.unknown.extend(text);
                        }
                    }
                }
                all
            }
        };
        self.open.pop();
        self.found.insert(name, alignment.clone());
        alignment
    }

    fn of_type(&mut self, ty: Range<usize>) -> Alignment {
        let Some(Token::Word(name)) = self.token(ty.start).filter(|_| !ty.is_empty()) else { return Alignment::default() };
        if self.declarations.contains_key(name) {
            return self.of_name(name);
        }
        let inner = (self.token(ty.start + 1) == Some(Token::Operator("<"))).then(|| {
            let begin = ty.start + 2;
            begin..self.end_of_template(begin).min(ty.end)
        });
        let scalar = |this: &mut Self| match name.as_bytes().last() {
            Some(b'h') => 2,
            Some(b'f' | b'i' | b'u') => 4,
            _ => inner.clone().map_or(0, |inner| this.of_type(inner).plain),
        };
        Alignment::of(match name {
            "array" | "binding_array" => return inner.map_or_else(Alignment::default, |inner| self.of_type(inner)),
            "f16" => 2,
            "bool" | "i32" | "u32" | "f32" | "atomic" => 4,
            "i64" | "u64" | "f64" => 8,
            _ if name.starts_with("vec2") => 2 * scalar(self),
            _ if name.starts_with("vec3") || name.starts_with("vec4") => 4 * scalar(self),
            _ if name.starts_with("mat") && name.as_bytes().get(5) == Some(&b'2') => 2 * scalar(self),
            _ if name.starts_with("mat") => 4 * scalar(self),
            _ => 0,
        })
    }

    /// The end of the first part of a template list.
    fn end_of_template(&self, mut at: usize) -> usize {
        let mut depth = 0;
        while let Some(token) = self.token(at) {
            match token {
                Token::Operator("<") => depth += 1,
                Token::Operator(">") if depth == 0 => return at,
                Token::Operator(">") => depth -= 1,
                Token::Separator(',') if depth == 0 => return at,
                Token::Open(_) => {
                    at = self.after(at);
                    continue;
                }
                Token::Close(_) | Token::Separator(';') => return at,
                _ => {}
            }
            at += 1;
        }
        at
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tokens::Tokens as Stream;

    fn rewritten(text: &str) -> Result<String, (usize, String)> {
        let tokens: Vec<(usize, Token<'_>)> = Stream::new(text).collect();
        let mut out = text.to_owned();
        let mut edits = attributes(text, &tokens)?;
        edits.sort_by_key(|edit| std::cmp::Reverse(edit.at));
        edits.iter().for_each(|edit| out.insert_str(edit.at, &edit.text));
        Ok(out)
    }

    #[test]
    fn members_get_the_alignment_of_their_types() {
        let inner = "struct I { @align(16) a: f32, b: vec2<f32> }";
        for (outer, wanted) in [
            ("struct O { a: f32, i: I }", "struct O { a: f32, @align(16) i: I }"),
            ("struct O { a: f32, i: array<I, 3> }", "struct O { a: f32, @align(16) i: array<I, 3> }"),
            (
                "struct O { a: f32, @size(64) i: A } alias A = array<B>; alias B = I;",
                "struct O { a: f32, @align(16) @size(64) i: A } alias A = array<B>; alias B = I;",
            ),
            (
                "struct O { i: I } struct P { a: u32, o: O }",
                "struct O { @align(16) i: I } struct P { a: u32, @align(16) o: O }",
            ),
            ("struct O { a: vec4f, @align(32) i: I }", "struct O { a: vec4f, @align(32) i: I }"),
            // Nothing is lost.
            (
                "struct O { a: f32, v: vec4f } struct P { a: f32, o: O }",
                "struct O { a: f32, v: vec4f } struct P { a: f32, o: O }",
            ),
        ] {
            assert_eq!(rewritten(&format!("{inner} {outer}")), Ok(format!("{inner} {wanted}")));
        }
        let text = "const N = 32; struct I { @align(N) a: f32, v: vec3<f16> } struct O { a: f32, i: I }";
        assert!(rewritten(text).is_ok_and(|text| text.contains("@align(max(i32(N), 8)) i: I")));
        let low = "struct I { @align(16) a: f32 } struct O { a: f32, @align(8) i: I }";
        assert!(rewritten(low).is_err_and(|(at, what)| at == 60 && what.contains("less than the alignment")));
        let unknown = "const N = 16; struct I { @align(N) a: f32 } struct O { @align(8) i: I }";
        assert!(rewritten(unknown).is_err_and(|(_, what)| what.contains("written as a number")));
        // What is no text is naga's.
        for text in ["struct S { @align(", "struct S { a: S, @align(8) b: u32 }", "alias A = A; struct S { @align(16) a: A }"] {
            assert!(rewritten(text).is_ok(), "{text}");
        }
    }
}
