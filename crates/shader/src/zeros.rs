//! The number of elements of the zero values in a WGSL text: `array<i32, 1000>()` has a thousand.
//!
//! naga stores such a value as one expression. But where it evaluates an operator or a built-in function at compile time, it first makes
//! a list of all elements, and only then finds that arrays have no operators: `array<i32, 500000000>() == x` takes 8 GB before it is refused.
//! So this module counts the elements from the text. A length is a sum or product of numbers and constants, or it is not known.

use std::collections::HashMap;

use super::tokens::Token;

/// Operands and results of arithmetic are below this: no type of numbers wraps around there.
const EXACT: u64 = 1 << 31;

/// A value constructor without arguments.
#[derive(Clone, Copy, Debug)]
pub(super) struct Zero {
    /// Its opening bracket, by the number of the token.
    pub bracket: usize,
    /// The declaration that it stands in.
    pub node: u32,
}

/// A text whose declarations are known.
pub(super) struct Zeros<'t, 's> {
    pub text: &'t str,
    pub tokens: &'s [(usize, Token<'t>)],
    /// Names at the top.
    pub tops: &'s HashMap<&'t str, u32>,
    /// Names of declarations, by the numbers of their tokens.
    pub names: &'s HashMap<u32, usize>,
    /// Which declaration of a function a token names, for tokens that name one.
    pub locals: &'s HashMap<usize, u32>,
    /// Elements of a value of a type, or the number of a constant; none while it is being found.
    pub known: HashMap<u32, Option<u64>>,
}

impl<'t> Zeros<'t, '_> {
    fn token(&self, at: usize) -> Option<Token<'t>> {
        self.tokens.get(at).map(|(_, token)| *token)
    }

    fn is(&self, at: usize, token: Token<'_>) -> bool {
        self.token(at) == Some(token)
    }

    /// Where the types begin whose template lists end ahead of a bracket, by the numbers of their tokens.
    pub fn templates(&self) -> HashMap<usize, usize> {
        let mut begins = HashMap::new();
        // Template lists that are open, and a mark for each bracket. A comparison that looks like a list ends with its bracket.
        let mut open: Vec<Option<usize>> = Vec::new();
        for (at, (_, token)) in self.tokens.iter().enumerate() {
            match *token {
                Token::Operator("<") if at > 0 && matches!(self.tokens[at - 1].1, Token::Word(_)) => open.push(Some(at - 1)),
                Token::Operator(">") => {
                    if let Some(Some(begin)) = open.pop_if(|open| open.is_some()) {
                        begins.insert(at + 1, begin);
                    }
                }
                Token::Open(_) => open.push(None),
                Token::Close(_) => while open.pop().flatten().is_some() {},
                Token::Separator(';') => while open.pop_if(|open| open.is_some()).is_some() {},
                _ => {}
            }
        }
        begins
    }

    /// The first token of the type of a zero value, if it is one of an array or of a type of the text.
    pub fn begin(&self, zero: Zero, templates: &HashMap<usize, usize>) -> Option<usize> {
        let begin = templates.get(&zero.bracket).copied().or_else(|| zero.bracket.checked_sub(1))?;
        match self.token(begin)? {
            Token::Word("array") => Some(begin),
            Token::Word(name) => self.tops.get(name).filter(|node| self.is_type(**node)).map(|_| begin),
            _ => None,
        }
    }

    /// Whether a zero value is stored or returned without change: then naga makes no list of its elements.
    pub fn is_kept(&self, begin: usize, zero: Zero) -> bool {
        let (Some(before), true) = (begin.checked_sub(1), self.is(zero.bracket + 2, Token::Separator(';'))) else {
            return false;
        };
        match self.tokens[before] {
            (_, Token::Word("return")) => true,
            // `>=` and its like are two tokens here, and no assignment.
            (at, Token::Operator("=")) => {
                before.checked_sub(1).is_none_or(|i| !matches!(self.tokens[i], (a, Token::Operator(_)) if a + 1 == at))
            }
            _ => false,
        }
    }

    /// The first word of a declaration: `const`, `alias` or `struct`; empty for all others.
    fn keyword(&self, node: u32) -> &'t str {
        match self.names.get(&node).and_then(|name| self.token(name.checked_sub(1)?)) {
            Some(Token::Word(word @ ("const" | "alias" | "struct"))) => word,
            _ => "",
        }
    }

    fn is_type(&self, node: u32) -> bool {
        matches!(self.keyword(node), "alias" | "struct")
    }

    /// The number of elements of a value of the type that begins at a token; none if it is not known.
    pub fn elements(&mut self, begin: usize) -> Option<u64> {
        self.type_at(begin).map(|(elements, _)| elements)
    }

    /// As [`Zeros::elements`], and the token after the type.
    fn type_at(&mut self, at: usize) -> Option<(u64, usize)> {
        match self.token(at)? {
            Token::Word("array") if self.is(at + 1, Token::Operator("<")) => {
                let (mut elements, mut at) = self.type_at(at + 2)?;
                if self.is(at, Token::Separator(',')) && !self.is(at + 1, Token::Operator(">")) {
                    let (length, after) = self.number(at + 1, 0)?;
                    (elements, at) = (elements.saturating_mul(length), after);
                }
                at += usize::from(self.is(at, Token::Separator(',')));
                self.is(at, Token::Operator(">")).then_some((elements, at + 1))
            }
            Token::Word(name) => {
                let elements = match self.tops.get(name) {
                    Some(&node) if self.is_type(node) => self.declared(node)?,
                    _ => 1,
                };
                Some((elements, self.after_template(at + 1)?))
            }
            _ => None,
        }
    }

    /// The token after a template list, if one begins here.
    fn after_template(&self, at: usize) -> Option<usize> {
        if !self.is(at, Token::Operator("<")) {
            return Some(at);
        }
        let mut open = 0;
        for (i, (_, token)) in self.tokens.iter().enumerate().skip(at) {
            match token {
                Token::Operator("<") => open += 1,
                Token::Operator(">") => open -= 1,
                Token::Word(_) | Token::Separator(',') | Token::Other => {}
                _ => return None,
            }
            if open == 0 {
                return Some(i + 1);
            }
        }
        None
    }

    /// Elements of a value of a declared type, or the number that a constant is.
    fn declared(&mut self, node: u32) -> Option<u64> {
        if let Some(known) = self.known.get(&node) {
            return *known;
        }
        // A declaration that needs itself is not valid.
        self.known.insert(node, None);
        let name = *self.names.get(&node)?;
        let found = match self.keyword(node) {
            "alias" if self.is(name + 1, Token::Operator("=")) => self.elements(name + 2),
            "struct" => self.members(name + 1),
            "const" => {
                let in_head = |token: &Token<'_>| !matches!(token, Token::Operator("=") | Token::Separator(';'));
                let head = self.tokens[name..].iter().take_while(|(_, token)| in_head(token)).count();
                let value = self.number(name + head + 1, 0);
                value.filter(|(_, end)| self.is(*end, Token::Separator(';'))).map(|(value, _)| value)
            }
            _ => None,
        };
        self.known.insert(node, found);
        found
    }

    /// Elements of all members of a structure whose brace stands here.
    fn members(&mut self, brace: usize) -> Option<u64> {
        let mut elements = 0u64;
        let mut at = brace + 1;
        loop {
            match self.token(at)? {
                Token::Close('}') => return Some(elements),
                Token::Operator("@") => {
                    at += 2;
                    if self.is(at, Token::Open('(')) {
                        let mut open = 0;
                        loop {
                            match self.token(at)? {
                                Token::Open(_) => open += 1,
                                Token::Close(_) => open -= 1,
                                _ => {}
                            }
                            at += 1;
                            if open == 0 {
                                break;
                            }
                        }
                    }
                }
                Token::Word(_) if self.is(at + 1, Token::Separator(':')) => {
                    let (of_member, after) = self.type_at(at + 2)?;
                    elements = elements.saturating_add(of_member);
                    at = after + usize::from(self.is(after, Token::Separator(',')));
                }
                _ => return None,
            }
        }
    }

    /// The value of an expression whose operators bind more tightly than `loosest`, and the token after it.
    fn number(&mut self, at: usize, loosest: u32) -> Option<(u64, usize)> {
        let exact = |value: u64| Some(value).filter(|value| *value < EXACT);
        let (mut left, mut at) = self.operand(at)?;
        while let Some(Token::Operator(operator)) = self.token(at) {
            let binding = match operator {
                "|" => 1,
                "^" => 2,
                "&" => 3,
                "<<" => 4,
                "+" | "-" => 5,
                "*" | "/" | "%" => 6,
                _ => break,
            };
            if binding <= loosest {
                break;
            }
            let (right, after) = self.number(at + 1, binding)?;
            let (a, b) = (exact(left)?, exact(right)?);
            let value = match operator {
                "|" => a | b,
                "^" => a ^ b,
                "&" => a & b,
                "<<" => a.checked_shl(b as u32).filter(|_| b < 32)?,
                "+" => a + b,
                "-" => a.checked_sub(b)?,
                "*" => a * b,
                "/" => a.checked_div(b)?,
                _ => a.checked_rem(b)?,
            };
            (left, at) = (exact(value)?, after);
        }
        Some((left, at))
    }

    fn operand(&mut self, at: usize) -> Option<(u64, usize)> {
        match self.token(at)? {
            Token::Open('(') => self.number(at + 1, 0).filter(|(_, end)| self.is(*end, Token::Close(')'))).map(after),
            Token::Other => Some((literal(&self.text[self.tokens[at].0..])?, at + 1)),
            Token::Word("u32" | "i32") if self.is(at + 1, Token::Open('(')) => {
                self.operand(at + 1).filter(|(value, _)| *value < EXACT)
            }
            Token::Word(name @ ("min" | "max")) if self.is(at + 1, Token::Open('(')) => {
                let (a, comma) = self.number(at + 2, 0).filter(|(_, end)| self.is(*end, Token::Separator(',')))?;
                let (b, end) = self.number(comma + 1, 0).filter(|(_, end)| self.is(*end, Token::Close(')')))?;
                if a.max(b) >= EXACT {
                    return None;
                }
                Some((if name == "min" { a.min(b) } else { a.max(b) }, end + 1))
            }
            Token::Word(name) => {
                let node = self.locals.get(&at).or_else(|| self.tops.get(name)).copied()?;
                (self.keyword(node) == "const").then_some(())?;
                Some((self.declared(node)?, at + 1))
            }
            _ => None,
        }
    }
}

/// A number, and the token after the bracket that it ends at.
fn after((value, end): (u64, usize)) -> (u64, usize) {
    (value, end + 1)
}

/// The whole number that a text begins with, with or without a suffix of its type.
fn literal(text: &str) -> Option<u64> {
    let end = text.find(|c: char| !(c.is_ascii_alphanumeric() || c == '.')).unwrap_or(text.len());
    let (digits, radix) = match text[..end].strip_prefix("0x").or_else(|| text[..end].strip_prefix("0X")) {
        Some(digits) => (digits, 16),
        None => (&text[..end], 10),
    };
    u64::from_str_radix(digits.trim_end_matches(['u', 'i']), radix).ok()
}
