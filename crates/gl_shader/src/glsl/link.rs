//! The shader objects of one stage as one text. A variable that several of them declare is one variable. A function follows the functions
//! that it calls, since naga lets a function call earlier functions only.

use std::collections::{BTreeMap, BTreeSet};

use super::print::{text, words};
use super::rewrite::Shader;
use super::tree::{Declaration, Declarator, ExprKind, Function, Item, Kind};
use super::{TranslateResult, Wrong};

/// A declaration and where it stands: the number of its shader, and its number there.
pub struct Placed<T> {
    /// The shader and the item.
    pub at: (usize, usize),
    /// The declaration.
    pub of: T,
}

/// The declarations of a stage.
pub struct Joined {
    /// Variables, structures and blocks.
    pub variables: Vec<Placed<Item>>,
    /// Functions with a body, each after the functions that it calls.
    pub functions: Vec<Placed<Function>>,
}

/// A function by its name and its number of parameters.
type Group<'a> = (&'a str, usize);

/// Joins the shaders of a stage.
///
/// # Errors
/// If two shader objects declare a variable or a structure in different ways, or if a function that is called has no body.
pub fn join(shaders: Vec<Shader>) -> TranslateResult<Joined> {
    let (mut functions, mut prototypes, mut items) = (Vec::new(), Vec::new(), Vec::new());
    for (k, shader) in shaders.into_iter().enumerate() {
        for (number, item) in shader.items.into_iter().enumerate() {
            let at = (k, number);
            match item {
                // naga takes a prototype for a function without statements.
                Item::Function(of) if of.body.is_none() => prototypes.push(of),
                Item::Function(of) => functions.push(Placed { at, of }),
                of => items.push(Placed { at, of }),
            }
        }
    }
    let order = sorted(&functions, &prototypes)?;
    let mut functions: Vec<Option<Placed<Function>>> = functions.into_iter().map(Some).collect();
    let functions = order.into_iter().filter_map(|k| functions[k].take()).collect();
    let declared = Declared::of(&items)?;
    let variables = items.into_iter().filter_map(|item| declared.kept(item)).collect();
    Ok(Joined { variables, functions })
}

fn group(of: &Function) -> Group<'_> {
    (&of.name, of.parameters.len())
}

/// The order of functions, each after the functions that it calls. Calls in a circle, which the language does not have, keep their order, and so do
/// overloads.
///
/// # Errors
/// If a function that is called has only a prototype.
fn sorted(functions: &[Placed<Function>], prototypes: &[Function]) -> TranslateResult<Vec<usize>> {
    let (mut numbers, mut members): (BTreeMap<Group, usize>, Vec<Vec<usize>>) = Default::default();
    for (k, function) in functions.iter().enumerate() {
        let number = *numbers.entry(group(&function.of)).or_insert(members.len());
        if number == members.len() {
            members.push(Vec::new());
        }
        members[number].push(k);
    }
    let missing = prototypes.iter().filter(|of| !numbers.contains_key(&group(of)));
    let missing: BTreeMap<Group, u32> = missing.map(|of| (group(of), of.line)).collect();
    // The groups that each function calls.
    let mut called = Vec::new();
    for function in functions {
        let (mut groups, mut wrong) = (BTreeSet::new(), None);
        function.of.each(&mut |of| {
            let ExprKind::Call(name, _, arguments) = &of.kind else { return };
            let wanted = (name.as_str(), arguments.len());
            match numbers.get(&wanted) {
                Some(&number) => drop(groups.insert(number)),
                None => wrong = wrong.or(missing.get(&wanted).map(|&line| (line, name))),
            }
        });
        if let Some((line, name)) = wrong {
            return Err(Wrong::at(line, format!("the function {name} has no body")));
        }
        groups.remove(&numbers[&group(&function.of)]);
        called.push(groups);
    }
    let (mut order, mut done, mut seen) = (Vec::new(), vec![false; members.len()], vec![false; functions.len()]);
    for root in 0..functions.len() {
        // Functions that wait, each with the functions that it still waits for, last first.
        let mut stack: Vec<(usize, Vec<usize>)> = Vec::new();
        let mut next = Some(root);
        loop {
            if let Some(function) = next.take().filter(|&function| !std::mem::replace(&mut seen[function], true)) {
                let groups = called[function].iter().filter(|&&group| !std::mem::replace(&mut done[group], true));
                let mut waits: Vec<usize> = groups.flat_map(|&group| members[group].iter().copied()).collect();
                waits.sort_unstable_by(|a, b| b.cmp(a));
                stack.push((function, waits));
            }
            let Some((function, waits)) = stack.last_mut() else { break };
            next = waits.pop();
            if next.is_none() {
                order.push(*function);
                stack.pop();
            }
        }
    }
    Ok(order)
}

/// A variable that is declared: the shader whose declaration stays, its type, and its initialiser.
struct Variable {
    shader: usize,
    kind: String,
    value: Option<String>,
}

/// Variables and structures that several shaders declare.
struct Declared {
    variables: BTreeMap<String, Variable>,
    structures: BTreeMap<String, (usize, String)>,
}

/// Qualifiers of variables that are not the stage's own.
const INTERFACE: [&str; 7] = ["uniform", "attribute", "varying", "in", "out", "buffer", "shared"];

/// Returns true if a declaration is that of variables or constants of the stage's own.
pub fn is_own(of: &Declaration) -> bool {
    !INTERFACE.iter().any(|word| of.has(word))
}

/// Returns true if a declaration is that of a built-in variable.
fn is_built_in(of: &Declaration) -> bool {
    of.names.iter().any(|name| name.name.starts_with("gl_"))
}

impl Declared {
    fn of(items: &[Placed<Item>]) -> TranslateResult<Declared> {
        let mut declared = Declared { variables: BTreeMap::new(), structures: BTreeMap::new() };
        for item in items {
            let Item::Declaration(of) = &item.of else { continue };
            if is_built_in(of) {
                continue;
            }
            if let Some(members) = &of.kind.members {
                let members = words(|printer| members.iter().for_each(|member| printer.declaration(member)));
                let known = declared.structures.entry(of.kind.name.clone()).or_insert_with(|| (item.at.0, members.clone()));
                if known.1 != members {
                    return different("structure", &of.kind.name, of.kind.line);
                }
            }
            for name in &of.names {
                declared.variable(item.at.0, of, name)?;
            }
        }
        Ok(declared)
    }

    /// Notes a variable.
    fn variable(&mut self, shader: usize, of: &Declaration, name: &Declarator) -> TranslateResult {
        let own = match (is_own(of), of.has("const")) {
            (true, true) => "const",
            (true, false) => "",
            (false, _) => "other",
        };
        // Precision and interpolation may differ.
        let sizes = words(|printer| [&of.kind.sizes, &name.sizes].into_iter().for_each(|sizes| printer.sizes(sizes, 0)));
        let kind = format!("{own} {} {sizes}", of.kind.name);
        let value = name.value.as_ref().map(text);
        match self.variables.get_mut(&name.name) {
            None => {
                self.variables.insert(name.name.clone(), Variable { shader, kind, value });
            }
            Some(known) if known.shader == shader => {}
            Some(known) => {
                if known.kind != kind || known.value.is_some() && value.is_some() && known.value != value {
                    return different("variable", &name.name, name.line);
                }
                if known.value.is_none() && value.is_some() {
                    *known = Variable { shader, kind, value };
                }
            }
        }
        Ok(())
    }

    /// The part of an item that stays.
    fn kept(&self, item: Placed<Item>) -> Option<Placed<Item>> {
        let Placed { at, of: Item::Declaration(mut of) } = item else { return Some(item) };
        if is_built_in(&of) {
            return Some(Placed { at, of: Item::Declaration(of) });
        }
        of.names.retain(|name| self.variables.get(&name.name).is_none_or(|kept| kept.shader == at.0));
        if self.structures.get(&of.kind.name).is_some_and(|known| known.0 != at.0) {
            of.kind = Kind { members: None, ..of.kind };
        }
        // The structure stays if only its variables do not.
        (!of.names.is_empty() || of.kind.members.is_some()).then_some(Placed { at, of: Item::Declaration(of) })
    }
}

fn different<T>(what: &str, name: &str, line: u32) -> TranslateResult<T> {
    Err(Wrong::at(line, format!("the {what} {name} in two shader objects in different ways is not supported")))
}
