//! `==` and `!=` of arrays and of structures, which naga does not have: calls of functions that compare their elements and members.

use std::collections::{BTreeMap, BTreeSet};

use super::scope::Type;
use super::tokens::Token;
use super::tree::{Expr, ExprKind};

/// Maximum number of elements of arrays that are compared without a function.
const ELEMENTS_MAX: u64 = 16;

/// The members of structures and their types, as in the text for naga.
pub type Structures = BTreeMap<String, Vec<(String, Type)>>;

/// The functions that compare. A function for a part of a type precedes the function for the type.
#[derive(Default)]
pub struct Comparisons {
    /// Types that have a function.
    written: BTreeSet<Type>,
    /// The functions.
    pub out: Vec<Token>,
}

impl Comparisons {
    /// The comparison of two values of a type. None if naga is to refuse it. `members` says that at least one of them is a member of a structure:
    /// naga gives an array in a structure another type than an array outside.
    pub fn equal(&mut self, operands: [&Expr; 2], kind: &Type, members: bool, structures: &Structures) -> Option<Expr> {
        let line = operands[0].line;
        match &kind.sizes[..] {
            [size] if members => {
                let count: u64 = size.parse().ok().filter(|count| (1..=ELEMENTS_MAX).contains(count))?;
                // Each of them is read several times.
                let changes = |of: &Expr| {
                    matches!(of.kind, ExprKind::Call(..) | ExprKind::Prefix("++" | "--", _) | ExprKind::Postfix(..))
                };
                if operands.iter().any(|of| of.any(changes)) {
                    return None;
                }
                let element = Type::plain(&kind.name);
                let index = |of: &Expr, k: u64| {
                    let index = ExprKind::Index(Box::new(of.clone()), Box::new(Expr::number(line, k)));
                    Expr::new(line, index)
                };
                let tests = (0..count).map(|k| {
                    let [a, b] = operands.map(|of| index(of, k));
                    match structures.contains_key(&kind.name) {
                        true => self.equal([&a, &b], &element, false, structures),
                        false => Some(Expr::new(line, ExprKind::Binary("==", Box::new(a), Box::new(b)))),
                    }
                });
                let both = |a: Expr, b: Expr| Expr::new(line, ExprKind::Binary("&&", Box::new(a), Box::new(b)));
                tests.collect::<Option<Vec<_>>>()?.into_iter().reduce(both)
            }
            [] | [_] => {
                self.function(kind, structures, line);
                Some(Expr::call(line, "glx_equal", operands.map(Expr::clone).into()))
            }
            _ => None,
        }
    }

    /// Writes the function that compares values of a type, after the functions for its parts.
    fn function(&mut self, kind: &Type, structures: &Structures, line: u32) {
        if !self.written.insert(kind.clone()) {
            return;
        }
        let name = &kind.name;
        let same = |kind: &str, a: &str, b: &str| match structures.contains_key(kind) {
            true => format!("glx_equal ( {a} , {b} )"),
            false => format!("( {a} == {b} )"),
        };
        let differ = |test: &str| format!("if ( ! {test} ) {{ return false ; }} ");
        let each = |size: &str, test: &str| format!("for ( int i = 0 ; i < {size} ; i ++ ) {{ {}}} ", differ(test));
        let text = match (kind.sizes.first(), structures.get(name)) {
            (Some(size), structure) => {
                if structure.is_some() {
                    self.function(&Type::plain(name), structures, line);
                }
                let test = same(name, "a [ i ]", "b [ i ]");
                format!("bool glx_equal ( {name} a [ {size} ] , {name} b [ {size} ] ) {{ {}return true ; }}", each(size, &test))
            }
            (None, Some(members)) => {
                let mut body = String::new();
                for (member, of) in members {
                    if structures.contains_key(&of.name) {
                        self.function(&Type::plain(&of.name), structures, line);
                    }
                    body += &match of.sizes.first() {
                        Some(size) => {
                            each(size, &same(&of.name, &format!("a . {member} [ i ]"), &format!("b . {member} [ i ]")))
                        }
                        None => differ(&same(&of.name, &format!("a . {member}"), &format!("b . {member}"))),
                    };
                }
                format!("bool glx_equal ( {name} a , {name} b ) {{ {body}return true ; }}")
            }
            (None, None) => return,
        };
        self.out.extend(text.split_whitespace().map(|word| Token::new(word, line)));
    }
}
