//! Arrays in declarations. Naga gives the brackets of a variable to the variables that follow it in the same declaration, so each of these
//! gets a declaration of its own. Arrays without a size get the size that the language gives them (OpenGL Shading Language 1.20, section
//! 4.1.9).

use std::collections::{BTreeMap, BTreeSet};

use super::rewrite::Shader;
use super::tree::{Declaration, Declarator, Expr, ExprKind, Item, Sizes, Statement, StatementKind};

/// For each name, the largest number that stands in brackets behind it, plus 1.
pub type Reach = BTreeMap<String, u64>;

/// The reach of the names of a stage.
pub fn reach(shaders: &[Shader]) -> Reach {
    let mut reach = Reach::new();
    for item in shaders.iter().flat_map(|shader| &shader.items) {
        item.each(&mut |of| {
            let ExprKind::Index(array, index) = &of.kind else { return };
            if let (ExprKind::Name(name) | ExprKind::Member(_, name), Some(index)) = (&array.kind, index.as_number()) {
                let reach = reach.entry(name.clone()).or_default();
                *reach = index.saturating_add(1).max(*reach);
            }
        });
    }
    reach
}

/// The variables that a scope declares.
#[derive(Default)]
struct Scope {
    /// Arrays that a declaration gives no size.
    open: BTreeSet<String>,
    /// The sizes that are known.
    sizes: BTreeMap<String, Sizes>,
    /// Variables with values.
    given: BTreeSet<String>,
    /// Variables that have been declared.
    declared: BTreeSet<String>,
}

/// A declaration, or a part of it.
enum Part {
    Declaration(Declaration),
    /// A variable that has been declared before gets its value.
    Value(String, Expr),
}

/// The brackets of a variable.
fn brackets<'a>(of: &'a Declaration, name: &'a Declarator) -> &'a Sizes {
    if name.sizes.is_empty() { &of.kind.sizes } else { &name.sizes }
}

/// The size of an array that a constructor makes.
pub fn size_of(value: &Expr) -> Option<Expr> {
    match &value.kind {
        ExprKind::Call(_, sizes, arguments) if sizes.len() == 1 => {
            Some(sizes[0].clone().unwrap_or_else(|| Expr::number(value.line, arguments.len())))
        }
        _ => None,
    }
}

impl Scope {
    /// Notes a declaration.
    fn note(&mut self, of: &Declaration) {
        for name in &of.names {
            let size = match &brackets(of, name)[..] {
                [] => continue,
                [None] => {
                    self.open.insert(name.name.clone());
                    name.value.as_ref().and_then(size_of).map(|size| vec![Some(size)])
                }
                all => Some(all.to_vec()),
            };
            if name.value.is_some() {
                self.given.insert(name.name.clone());
            }
            if let Some(size) = size {
                self.sizes.entry(name.name.clone()).or_insert(size);
            }
        }
    }

    /// Splits a declaration so that no variable follows an array. With `global`, a later declaration may hold the value of a variable.
    fn parts(&mut self, mut of: Declaration, reach: &Reach, global: bool) -> Vec<Part> {
        let is_open = |name: &Declarator| self.open.contains(&name.name);
        let arrays = of.names.iter().rev().skip(1).any(|name| !name.sizes.is_empty());
        if !arrays && !of.names.iter().any(is_open) {
            return vec![Part::Declaration(of)];
        }
        let mut parts = Vec::new();
        for mut name in std::mem::take(&mut of.names) {
            let mut part = of.clone();
            if self.open.contains(&name.name) {
                if self.declared.contains(&name.name) {
                    parts.extend(name.value.map(|value| Part::Value(name.name, value)));
                    continue;
                }
                if name.value.is_none() && global && self.given.contains(&name.name) {
                    continue;
                }
                self.declared.insert(name.name.clone());
                if matches!(brackets(&of, &name)[..], [None]) {
                    let known = self.sizes.get(&name.name).cloned();
                    let least = reach.get(&name.name).copied().unwrap_or(1);
                    name.sizes = known.unwrap_or_else(|| vec![Some(Expr::number(name.line, least))]);
                    part.kind.sizes.clear();
                }
            }
            parts.push(Part::Declaration(Declaration { names: vec![name], ..part }));
            // The structure has been declared.
            of.kind.members = None;
        }
        parts
    }
}

/// Completes the declarations at global scope. A variable that several shaders declare has one size.
pub fn globals(shaders: &mut [Shader], reach: &Reach) {
    let mut scope = Scope::default();
    for item in shaders.iter_mut().flat_map(|shader| &mut shader.items) {
        if let Item::Declaration(of) = item {
            members(of, reach);
            scope.note(of);
        }
    }
    for shader in shaders {
        let mut items = Vec::with_capacity(shader.items.len());
        for item in std::mem::take(&mut shader.items) {
            match item {
                Item::Declaration(of) => items.extend(scope.parts(of, reach, true).into_iter().filter_map(|part| match part {
                    Part::Declaration(of) => Some(Item::Declaration(of)),
                    Part::Value(..) => None,
                })),
                Item::Interface(mut of) => {
                    all(&mut of.members, reach);
                    items.push(Item::Interface(of));
                }
                other => items.push(other),
            }
        }
        shader.items = items;
    }
}

/// Completes the members of a structure.
fn members(of: &mut Declaration, reach: &Reach) {
    if let Some(members) = &mut of.kind.members {
        all(members, reach);
    }
}

/// Completes declarations that follow each other.
fn all(list: &mut Vec<Declaration>, reach: &Reach) {
    let mut scope = Scope::default();
    for of in list.iter_mut() {
        members(of, reach);
        scope.note(of);
    }
    let parts = std::mem::take(list).into_iter().flat_map(|of| scope.parts(of, reach, false));
    let parts: Vec<Declaration> =
        parts.filter_map(|part| if let Part::Declaration(of) = part { Some(of) } else { None }).collect();
    *list = parts;
}

/// Completes the declarations of a block, but not of the blocks in it.
pub fn block(statements: &mut Vec<Statement>, reach: &Reach) {
    let mut scope = Scope::default();
    for statement in statements.iter_mut() {
        if let StatementKind::Declaration(of) = &mut statement.kind {
            members(of, reach);
            scope.note(of);
        }
    }
    let mut out = Vec::with_capacity(statements.len());
    for Statement { line, kind } in std::mem::take(statements) {
        let StatementKind::Declaration(of) = kind else {
            out.push(Statement { line, kind });
            continue;
        };
        out.extend(scope.parts(of, reach, false).into_iter().map(|part| match part {
            Part::Declaration(of) => Statement { line, kind: StatementKind::Declaration(of) },
            Part::Value(name, value) => Statement { line, kind: StatementKind::Expression(Expr::assign(line, name, value)) },
        }));
    }
    *statements = out;
}
