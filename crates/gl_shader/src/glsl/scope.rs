//! Names and their types.

use std::collections::{BTreeMap, BTreeSet};

use super::print::text;
use super::rewrite::Shader;
use super::sampler::sampler;
use super::tree::{Declaration, Expr, Function, Item, Sizes};

/// A type: its name, and the sizes of an array, outermost first.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Type {
    /// The name of the type, or that of an element.
    pub name: String,
    /// The sizes as they are written.
    pub sizes: Vec<String>,
}

impl Type {
    /// A type that is no array.
    pub fn plain(name: impl Into<String>) -> Type {
        Type { name: name.into(), sizes: Vec::new() }
    }

    /// A type with the brackets after it and after the variable.
    pub fn of(name: &str, after_kind: &Sizes, after_name: &Sizes) -> Type {
        let sizes = after_name.iter().chain(after_kind).map(|size| size.as_ref().map_or(String::new(), text));
        Type { name: name.to_owned(), sizes: sizes.collect() }
    }

    /// The type of an element of an array, or of a column of a matrix.
    pub fn element(&self) -> Option<Type> {
        if let Some((_, sizes)) = self.sizes.split_first() {
            return Some(Type { name: self.name.clone(), sizes: sizes.to_vec() });
        }
        // `mat2x3` has columns with three rows.
        Some(Type::plain(format!("vec{}", self.name.strip_prefix("mat")?.chars().next_back()?)))
    }

    /// Returns true if it is a vector.
    pub fn is_vector(&self) -> bool {
        let stem = self.name.strip_suffix(['2', '3', '4']).filter(|_| self.sizes.is_empty());
        matches!(stem, Some("vec" | "ivec" | "uvec" | "bvec"))
    }
}

/// The sampler that a name or an element of an array stands for.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct SamplerValue {
    /// Its type.
    pub kind: String,
    /// The number of the first sampler.
    pub first: usize,
    /// The number of samplers, if it is an array.
    pub count: Option<usize>,
}

impl SamplerValue {
    /// Its type as that of a parameter.
    pub fn parameter(&self) -> String {
        format!("{}{}", self.kind, if self.count.is_some() { "[]" } else { "" })
    }
}

/// A variable.
#[derive(Clone, Debug)]
pub struct Variable {
    /// Its type.
    pub kind: Type,
    /// Its name in the text for naga.
    pub written: String,
    /// The sampler that it stands for, if it is one.
    pub sampler: Option<SamplerValue>,
}

/// The variables of nested scopes.
#[derive(Default)]
pub struct Scopes {
    list: Vec<BTreeMap<String, Variable>>,
}

impl Scopes {
    /// Begins a scope.
    pub fn push(&mut self) {
        self.list.push(BTreeMap::new());
    }

    /// Ends the innermost scope.
    pub fn pop(&mut self) {
        self.list.pop();
    }

    /// Declares a variable in the innermost scope.
    pub fn declare(&mut self, name: &str, variable: Variable) {
        if let Some(scope) = self.list.last_mut() {
            scope.insert(name.to_owned(), variable);
        }
    }

    /// The variable with this name.
    pub fn find(&self, name: &str) -> Option<&Variable> {
        self.list.iter().rev().find_map(|scope| scope.get(name))
    }

    /// Returns true if a sampler of the program has this name and the innermost scope is not the global scope.
    pub fn hides_sampler(&self, name: &str) -> bool {
        self.list.len() > 1 && self.list[0].get(name).is_some_and(|of| of.sampler.is_some())
    }
}

/// The part of a function's type that concerns samplers: its name, its number of parameters, and the parameters that are samplers with their
/// types.
pub type Signature = (String, usize, Vec<(usize, String)>);

/// The signature of a function.
pub fn signature(of: &Function) -> Signature {
    let kinds = of.parameters.iter().enumerate().filter(|(_, parameter)| sampler(&parameter.kind.name).is_some());
    let kinds = kinds.map(|(k, parameter)| {
        let array = !parameter.kind.sizes.is_empty() || parameter.names.iter().any(|name| !name.sizes.is_empty());
        (k, format!("{}{}", parameter.kind.name, if array { "[]" } else { "" }))
    });
    (of.name.clone(), of.parameters.len(), kinds.collect())
}

/// The functions of a stage.
#[derive(Default)]
pub struct Functions {
    /// The types of their results; none if overloads have several.
    results: BTreeMap<String, Option<Type>>,
    /// The items that declare each function first, by shader.
    declared: BTreeMap<(usize, String), usize>,
    /// Functions whose names are also called where they are not declared. Such a call is that of a built-in function.
    hidden: BTreeSet<String>,
    /// Functions with samplers as parameters, by name.
    pub of_samplers: BTreeMap<String, BTreeSet<Signature>>,
}

impl Functions {
    /// The functions of these shaders.
    pub fn of(shaders: &[Shader]) -> Functions {
        let mut all = Functions::default();
        let items = || {
            shaders
                .iter()
                .enumerate()
                .flat_map(|(k, shader)| shader.items.iter().enumerate().map(move |(number, item)| ((k, number), item)))
        };
        for ((shader, number), item) in items() {
            let Item::Function(of) = item else { continue };
            all.declared.entry((shader, of.name.clone())).or_insert(number);
            let kind = Type::of(&of.kind.name, &of.kind.sizes, &Vec::new());
            let known = all.results.entry(of.name.clone()).or_insert_with(|| Some(kind.clone()));
            if known.as_ref() != Some(&kind) {
                *known = None;
            }
            let signature = signature(of);
            if !signature.2.is_empty() {
                all.of_samplers.entry(of.name.clone()).or_default().insert(signature);
            }
        }
        for (at, item) in items() {
            item.each(&mut |of| {
                if let super::tree::ExprKind::Call(name, ..) = &of.kind
                    && all.results.contains_key(name)
                    && !all.is_declared(name, at)
                {
                    all.hidden.insert(name.clone());
                }
            });
        }
        all
    }

    /// Returns true if a function of this name is declared where an item stands. A built-in function of the same name is meant otherwise
    /// (OpenGL Shading Language 1.10, section 6.1).
    pub fn is_declared(&self, name: &str, (shader, item): (usize, usize)) -> bool {
        self.declared.get(&(shader, name.to_owned())).is_some_and(|&first| first <= item)
    }

    /// Returns true if any shader has a function of this name.
    pub fn has(&self, name: &str) -> bool {
        self.results.contains_key(name)
    }

    /// The name of a function in the text for naga.
    pub fn written(&self, name: &str) -> String {
        if self.hidden.contains(name) { format!("glx_own_{name}_") } else { name.to_owned() }
    }

    /// The type of a function's result.
    pub fn result(&self, name: &str) -> Option<Type> {
        self.results.get(name).cloned().flatten()
    }
}

/// The members of a structure and their types.
pub fn members(list: &[Declaration]) -> Vec<(String, Type)> {
    let one = |of: &Declaration| {
        let kind = of.kind.clone();
        let names = of.names.clone().into_iter();
        names.map(move |name| (name.name, Type::of(&kind.name, &kind.sizes, &name.sizes))).collect::<Vec<_>>()
    };
    list.iter().flat_map(one).collect()
}

/// Returns true if an expression may change a variable: it assigns, or it calls a function of the program.
pub fn has_effect(of: &Expr, functions: &Functions) -> bool {
    use super::tree::ExprKind::{Assign, Call, Postfix, Prefix};
    of.any(|of| match &of.kind {
        Assign(..) | Postfix(..) | Prefix("++" | "--", _) => true,
        Call(name, ..) => functions.has(name),
        _ => false,
    })
}
