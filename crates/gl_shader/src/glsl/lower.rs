//! Functions, statements and expressions in the dialect that naga reads: names, scopes and types are resolved once, and what naga does not do
//! as the language says is written in words that it does right.

use std::collections::{BTreeMap, BTreeSet};

use super::arrays::{self, Reach};
use super::builtins;
use super::compare::{Comparisons, Structures};
use super::flow::{repeat, separate};
use super::link::Placed;
use super::prelude;
use super::print::Printer;
use super::rewrite::{FLIP, RewrittenStage};
use super::sampler::{read_of, sampler};
use super::scope::{Functions, SamplerValue, Scopes, Signature, Type, Variable, has_effect, members, signature};
use super::tokens::{Dialect, Token};
use super::tree::{Declaration, Declarator, Expr, ExprKind, Function, Kind, Qualifier, Sizes, Statement, StatementKind};
use super::words::{is_type, renamed};
use super::{TOKENS_MAX, TranslateResult, Wrong};
use crate::arb::program::ProgramStage;

/// A stage that is being lowered.
pub struct Lowering {
    /// The stage.
    pub stage: ProgramStage,
    /// The result so far.
    pub source: RewrittenStage,
    /// The dialect of the shader at hand.
    pub dialect: Dialect,
    /// The shader and the item at hand.
    pub at: (usize, usize),
    /// Names and their meaning.
    pub scopes: Scopes,
    /// Structures.
    pub structures: Structures,
    /// Functions.
    pub functions: Functions,
    /// The sizes of arrays as their indices need them.
    pub reach: Reach,
    /// Variables that have been lowered, and structures.
    pub out: Printer,
    /// Statements at the start of `main`.
    pub start: Vec<Statement>,
    /// Constants, and whether naga evaluates them: it cannot evaluate calls of functions.
    pub constants: BTreeMap<String, bool>,
    /// Functions that compare.
    pub comparisons: Comparisons,
    /// Functions of the prelude that are called.
    pub helpers: BTreeSet<String>,
    /// The function and the samplers of each copy, in the order in which calls to them were found.
    pub copies: Vec<(Signature, Vec<SamplerValue>)>,
    numbers: BTreeMap<(Signature, Vec<SamplerValue>), usize>,
    /// Loops that have got a variable.
    loops: usize,
}

/// Returns true if this is a type of samplers or images that the machine does not have.
fn is_other_sampler(name: &str) -> bool {
    let stem = name.strip_prefix(['i', 'u']).unwrap_or(name);
    let rest = ["sampler", "image"].iter().find_map(|start| stem.strip_prefix(start));
    let shape = rest.is_some_and(|rest| ["1D", "2D", "3D", "Cube", "Buffer"].iter().any(|shape| rest.starts_with(shape)));
    shape && sampler(name).is_none()
}

/// The numbers of the components that a word names.
fn components(word: &str) -> Option<Vec<usize>> {
    let names = ["xyzw", "rgba", "stpq"].into_iter().find(|names| word.chars().all(|c| names.contains(c)))?;
    Some(word.chars().filter_map(|c| names.find(c)).collect())
}

impl Lowering {
    /// A stage of which nothing has been lowered.
    pub fn new(stage: ProgramStage, functions: Functions, reach: Reach) -> Lowering {
        let mut scopes = Scopes::default();
        scopes.push();
        Lowering {
            stage,
            source: RewrittenStage::default(),
            dialect: Dialect { version: 110, embedded: false },
            at: (0, 0),
            scopes,
            structures: Structures::new(),
            functions,
            reach,
            out: Printer::default(),
            start: Vec::new(),
            constants: BTreeMap::new(),
            comparisons: Comparisons::default(),
            helpers: BTreeSet::new(),
            copies: Vec::new(),
            numbers: BTreeMap::new(),
            loops: 0,
        }
    }

    /// Renames a name that is reserved in version 4.50.
    pub fn rename(&self, name: &str) -> String {
        renamed(name, self.dialect)
    }

    /// Lowers a function; `chosen` are the samplers that stand for its parameters.
    pub fn function(&mut self, mut of: Function, name: String, chosen: &[SamplerValue]) -> TranslateResult<Function> {
        self.qualifiers(&mut of.qualifiers);
        self.kind(&mut of.kind, true)?;
        of.name = name;
        self.scopes.push();
        let mut chosen = chosen.iter();
        let mut parameters = Vec::with_capacity(of.parameters.len());
        for mut parameter in std::mem::take(&mut of.parameters) {
            if sampler(&parameter.kind.name).is_some()
                && let Some(value) = chosen.next()
            {
                for name in parameter.names {
                    let kind = Type::plain(&value.kind);
                    let sampler = Some(value.clone());
                    self.scopes.declare(&name.name, Variable { kind, written: String::new(), sampler });
                }
                continue;
            }
            // Naga does not have both in one parameter.
            if parameter.has("const") {
                parameter.qualifiers.retain(|qualifier| qualifier.word != "in");
            }
            self.declaration(&mut parameter)?;
            parameters.push(parameter);
        }
        of.parameters = parameters;
        let line = of.line;
        of.body.iter_mut().try_for_each(|body| self.block(body, line))?;
        self.scopes.pop();
        Ok(of)
    }

    /// Removes qualifiers that change nothing here.
    fn qualifiers(&self, of: &mut Vec<Qualifier>) {
        of.retain(|of| !matches!(of.word.as_str(), "highp" | "mediump" | "lowp" | "invariant" | "precise"));
    }

    /// Lowers a type. `names` says that it declares something.
    pub fn kind(&mut self, of: &mut Kind, names: bool) -> TranslateResult {
        if names && is_other_sampler(&of.name) {
            return Err(Wrong::at(of.line, format!("the type {} is not supported", of.name)));
        }
        of.name = self.rename(&of.name);
        self.sizes(&mut of.sizes)?;
        if let Some(list) = &mut of.members {
            for member in list.iter_mut() {
                self.qualifiers(&mut member.qualifiers);
                self.kind(&mut member.kind, true)?;
                for name in &mut member.names {
                    name.name = self.rename(&name.name);
                    self.sizes(&mut name.sizes)?;
                }
            }
            self.structures.insert(of.name.clone(), members(list));
        }
        Ok(())
    }

    fn sizes(&mut self, of: &mut Sizes) -> TranslateResult {
        of.iter_mut().flatten().try_for_each(|size| self.expr(size).map(drop))
    }

    /// Lowers a variable of a type that has been lowered, and declares it: its initialiser does not know it.
    pub fn declarator(&mut self, of: &mut Declarator, kind: &Kind) -> TranslateResult {
        self.sizes(&mut of.sizes)?;
        if let Some(value) = &mut of.value {
            self.expr(value)?;
        }
        let mut written = self.rename(&of.name);
        if self.scopes.hides_sampler(&of.name) {
            // Samplers are replaced by their names.
            written = format!("glx_local_{}_", of.name);
        }
        let kind = Type::of(&kind.name, &kind.sizes, &of.sizes);
        let name = std::mem::replace(&mut of.name, written.clone());
        self.scopes.declare(&name, Variable { kind, written, sampler: None });
        Ok(())
    }

    /// Lowers a declaration.
    pub fn declaration(&mut self, of: &mut Declaration) -> TranslateResult {
        self.qualifiers(&mut of.qualifiers);
        self.kind(&mut of.kind, !of.names.is_empty())?;
        let Declaration { kind, names, .. } = of;
        names.iter_mut().try_for_each(|name| self.declarator(name, kind))
    }

    /// Lowers the statements of a block, which is a scope.
    fn block(&mut self, statements: &mut Vec<Statement>, line: u32) -> TranslateResult {
        self.scopes.push();
        arrays::block(statements, &self.reach);
        for statement in statements.iter_mut() {
            self.statement(statement)?;
        }
        if statements.iter().any(|of| matches!(of.kind, StatementKind::Label(_))) {
            separate(statements, line)?;
        }
        self.scopes.pop();
        Ok(())
    }

    fn statement(&mut self, of: &mut Statement) -> TranslateResult {
        let line = of.line;
        match &mut of.kind {
            StatementKind::Empty | StatementKind::Jump(_) => {}
            StatementKind::Block(all) => self.block(all, line)?,
            StatementKind::Declaration(of) => self.declaration(of)?,
            StatementKind::Expression(of) => drop(self.expr(of)?),
            StatementKind::Label(of) | StatementKind::Return(of) => drop(of.as_mut().map(|of| self.expr(of)).transpose()?),
            StatementKind::If(condition, accept, reject) => {
                self.expr(condition)?;
                self.statement(accept)?;
                reject.iter_mut().try_for_each(|of| self.statement(of))?;
            }
            StatementKind::For(header, step, body) => {
                self.scopes.push();
                header.iter_mut().try_for_each(|of| self.statement(of))?;
                step.iter_mut().try_for_each(|of| self.expr(of).map(drop))?;
                self.statement(body)?;
                self.scopes.pop();
            }
            StatementKind::While(condition, body) => {
                self.expr(condition)?;
                self.statement(body)?;
            }
            StatementKind::Do(body, condition) => {
                self.statement(body)?;
                self.expr(condition)?;
                let nothing = Box::new(Statement::new(line, StatementKind::Empty));
                let body = std::mem::replace(body, nothing);
                let condition = std::mem::replace(condition, Expr::name(line, ""));
                self.loops += 1;
                of.kind = repeat(body, condition, line, self.loops);
            }
            StatementKind::Switch(value, all) => {
                self.expr(value)?;
                self.block(all, line)?;
            }
        }
        Ok(())
    }

    /// Lowers an expression; returns its type if that is known.
    pub fn expr(&mut self, of: &mut Expr) -> TranslateResult<Option<Type>> {
        let line = of.line;
        if self.element_of_built_in(of)? {
            return Ok(Some(Type::plain("vec4")));
        }
        Ok(match &mut of.kind {
            ExprKind::Number(_) => None,
            ExprKind::Name(name) => match name.strip_prefix("gl_").map(str::to_owned) {
                Some(built_in) => {
                    let kind = self.built_in(&built_in, line)?;
                    *name = format!("glx_{built_in}");
                    Some(kind)
                }
                None => {
                    let known = self.scopes.find(name).filter(|known| known.sampler.is_none()).cloned();
                    *name = known.as_ref().map_or_else(|| self.rename(name), |known| known.written.clone());
                    known.map(|known| known.kind)
                }
            },
            ExprKind::Prefix("++" | "--", target) | ExprKind::Postfix(_, target) => self.target(target)?,
            ExprKind::Prefix(_, operand) => self.expr(operand)?,
            ExprKind::Assign(_, target, value) => {
                let kind = self.target(target)?;
                self.expr(value)?;
                kind
            }
            ExprKind::Binary(..) => self.binary(of)?,
            ExprKind::Choice(all) => {
                let [condition, accept, reject] = &mut **all;
                self.expr(condition)?;
                let kind = self.expr(accept)?;
                self.expr(reject)?;
                kind
            }
            ExprKind::Sequence(all) | ExprKind::List(all) => {
                let mut kind = None;
                for of in all {
                    kind = self.expr(of)?;
                }
                kind
            }
            ExprKind::Call(..) => self.call(of)?,
            ExprKind::Method(value, name, arguments) => {
                self.expr(value)?;
                self.all(arguments)?;
                *name = self.rename(name);
                None
            }
            ExprKind::Member(value, _) => {
                let kind = self.expr(value)?;
                self.member(of, kind)
            }
            ExprKind::Index(array, index) => {
                let kind = self.expr(array)?;
                self.expr(index)?;
                kind.and_then(|kind| kind.element())
            }
        })
    }

    /// Renames the member that an expression names, whose value has been lowered; returns the member's type.
    fn member(&self, of: &mut Expr, kind: Option<Type>) -> Option<Type> {
        let ExprKind::Member(_, name) = &mut of.kind else { return None };
        *name = self.rename(name);
        let kind = kind.filter(|kind| kind.sizes.is_empty())?;
        self.structures.get(&kind.name)?.iter().find(|member| member.0 == *name).map(|member| member.1.clone())
    }

    /// Replaces `gl_TexCoord[0]` and `gl_FragData[0]` by the names of variables. Returns true if it is such an element.
    fn element_of_built_in(&mut self, of: &mut Expr) -> TranslateResult<bool> {
        let ExprKind::Index(array, index) = &of.kind else { return Ok(false) };
        let name = array.as_name().and_then(|name| name.strip_prefix("gl_"));
        let Some(name) = name.filter(|name| matches!(*name, "TexCoord" | "FragData")) else { return Ok(false) };
        let ExprKind::Number(number) = &index.kind else { return Err(without_number(name, array.line)) };
        let Ok(number) = number.parse::<u32>() else { return Err(without_number(name, array.line)) };
        let (name, line) = (format!("{name}_{number}"), array.line);
        self.built_in(&name, line)?;
        *of = Expr::name(line, format!("glx_{name}"));
        Ok(true)
    }

    /// Notes that a built-in name occurs; returns its type.
    fn built_in(&mut self, name: &str, line: u32) -> TranslateResult<Type> {
        if matches!(name, "TexCoord" | "FragData") {
            return Err(without_number(name, line));
        }
        let Some(builtin) = builtins::find(self.stage, name) else {
            return Err(Wrong::at(line, format!("gl_{name} is not supported")));
        };
        let sizes = builtin.count.iter().map(usize::to_string).collect();
        let kind = Type { name: builtin.kind.trim_start_matches("const ").to_owned(), sizes };
        self.source.builtins.insert(format!("glx_{name}"), builtin);
        Ok(kind)
    }

    /// Lowers an expression that is written.
    fn target(&mut self, of: &mut Expr) -> TranslateResult<Option<Type>> {
        let (kind, numbers) = self.place(of)?;
        // naga cannot write a component of a matrix's column by its name.
        if let (Some([number]), ExprKind::Member(value, _)) = (numbers.as_deref(), &mut of.kind)
            && matches!(value.kind, ExprKind::Index(..))
        {
            let value = std::mem::replace(&mut **value, Expr::name(of.line, ""));
            of.kind = ExprKind::Index(Box::new(value), Box::new(Expr::number(of.line, number)));
        }
        Ok(kind)
    }

    /// Lowers an expression that is written. Returns its type, and the numbers of the components that it names. Components of components are
    /// named at once, since naga cannot write them.
    fn place(&mut self, of: &mut Expr) -> TranslateResult<(Option<Type>, Option<Vec<usize>>)> {
        if self.element_of_built_in(of)? {
            return Ok((Some(Type::plain("vec4")), None));
        }
        let (kind, chosen, own) = match &mut of.kind {
            ExprKind::Member(value, name) => {
                let (kind, chosen) = self.place(value)?;
                let own = components(name).filter(|_| chosen.is_some() || kind.as_ref().is_some_and(Type::is_vector));
                (self.member(of, kind), chosen, own)
            }
            ExprKind::Index(value, index) => {
                let (kind, chosen) = self.place(value)?;
                self.expr(index)?;
                let own = index.as_number().filter(|_| chosen.is_some()).map(|number| vec![number as usize]);
                (kind.and_then(|kind| kind.element()), chosen, own)
            }
            _ => return Ok((self.expr(of)?, None)),
        };
        let (Some(own), Some(all)) = (&own, &chosen) else { return Ok((kind, own)) };
        let numbers: Option<Vec<usize>> = own.iter().map(|&k| all.get(k).copied()).collect();
        if let Some(numbers) = &numbers
            && let ExprKind::Member(value, _) | ExprKind::Index(value, _) = &mut of.kind
            && let ExprKind::Member(inner, _) = &mut value.kind
        {
            let name = numbers.iter().map(|&k| ['x', 'y', 'z', 'w'][k]).collect();
            let inner = std::mem::replace(inner, Box::new(Expr::name(of.line, "")));
            of.kind = ExprKind::Member(inner, name);
        }
        Ok((kind, numbers))
    }

    fn binary(&mut self, of: &mut Expr) -> TranslateResult<Option<Type>> {
        let line = of.line;
        let ExprKind::Binary(operator, left, right) = &mut of.kind else { return Ok(None) };
        let operator = *operator;
        // The right side must not run where the left side decides (OpenGL Shading Language 1.20, section 5.9). Naga runs both sides, but
        // only the chosen branch of `?`.
        let lazy = matches!(operator, "&&" | "||") && has_effect(right, &self.functions);
        let kinds = [self.expr(left)?, self.expr(right)?];
        let take = |of: &mut Box<Expr>| std::mem::replace(&mut **of, Expr::name(line, ""));
        if lazy {
            let (left, right) = (take(left), take(right));
            let branches = match operator {
                "&&" => [left, right, Expr::name(line, "false")],
                _ => [left, Expr::name(line, "true"), right],
            };
            of.kind = ExprKind::Choice(Box::new(branches));
        } else if matches!(operator, "==" | "!=")
            && let [Some(kind), other] = kinds
            && (!kind.sizes.is_empty() || self.structures.contains_key(&kind.name))
            && other.is_none_or(|other| other == kind)
        {
            let is_member = |of: &Expr| matches!(of.kind, ExprKind::Member(..));
            let members = left.any(is_member) || right.any(is_member);
            if let Some(equal) = self.comparisons.equal([left, right], &kind, members, &self.structures) {
                of.kind = if operator == "==" { equal.kind } else { ExprKind::Prefix("!", Box::new(equal)) };
            }
        }
        Ok(None)
    }

    fn all(&mut self, list: &mut [Expr]) -> TranslateResult {
        list.iter_mut().try_for_each(|of| self.expr(of).map(drop))
    }

    fn call(&mut self, of: &mut Expr) -> TranslateResult<Option<Type>> {
        let line = of.line;
        let ExprKind::Call(name, sizes, arguments) = &mut of.kind else { return Ok(None) };
        if let [size] = &mut sizes[..]
            && size.is_none()
        {
            *size = Some(Expr::number(line, arguments.len()));
        }
        if !sizes.is_empty() || self.structures.contains_key(&self.rename(name)) {
            self.all(arguments)?;
            self.sizes(sizes)?;
            *name = self.rename(name);
            return Ok(Some(Type::of(name, sizes, &Vec::new())));
        }
        if self.functions.is_declared(name, self.at) {
            let mut written = self.rename(&self.functions.written(name));
            let kind = self.functions.result(name).map(|kind| Type { name: self.rename(&kind.name), ..kind });
            if let Some((number, signature)) = self.copy(name, arguments, line)? {
                written = copy_name(number, &written);
                let mut k = 0..;
                arguments.retain(|_| k.next().is_some_and(|k| signature.2.iter().all(|of| of.0 != k)));
            } else if self.sampler_of(arguments.first())?.is_some() {
                return Err(Wrong::at(line, format!("the function {name} with a sampler is not supported")));
            }
            *name = written;
            self.all(arguments)?;
            return Ok(kind);
        }
        if let Some(sampler) = self.sampler_of(arguments.first())? {
            let Some((read, number)) = read_of(name) else {
                return Err(Wrong::at(line, format!("the function {name} with a sampler is not supported")));
            };
            let of = &self.source.samplers[sampler];
            let one = if of.shadow && number { "One" } else { "" };
            let word = of.name.replace('[', "_at").replace(']', "_");
            *name = format!("glx_{read:?}{one}_{word}x");
            self.source.reads.insert(name.clone(), (sampler, read));
            arguments.remove(0);
            self.all(arguments)?;
            return Ok(None);
        }
        self.all(arguments)?;
        match name.as_str() {
            "ftransform" => {
                self.built_in("ModelViewProjectionMatrix", line)?;
                self.built_in("Vertex", line)?;
                let names = ["glx_ModelViewProjectionMatrix", "glx_Vertex"];
                let [matrix, vertex] = names.map(|name| Box::new(Expr::name(line, name)));
                of.kind = ExprKind::Binary("*", matrix, vertex);
                Ok(Some(Type::plain("vec4")))
            }
            "dFdy" => {
                self.source.flips = true;
                let call = Expr::call(line, "dFdy", std::mem::take(arguments));
                of.kind = ExprKind::Binary("*", Box::new(Expr::name(line, FLIP)), Box::new(call));
                Ok(None)
            }
            _ => {
                let kind = is_type(name).then(|| Type::plain(&*name));
                *name = match prelude::renamed(name) {
                    Some(helper) => {
                        self.helpers.insert(helper.clone());
                        helper
                    }
                    None => self.rename(name),
                };
                Ok(kind)
            }
        }
    }

    /// The number of the sampler that is the first argument of a call.
    fn sampler_of(&self, argument: Option<&Expr>) -> TranslateResult<Option<usize>> {
        let Some(argument) = argument else { return Ok(None) };
        if let Some(SamplerValue { first, count: None, .. }) = self.sampler_value(argument) {
            return Ok(Some(first));
        }
        let (root, index) = match &argument.kind {
            ExprKind::Index(array, index) => (&**array, index.as_number()),
            _ => (argument, None),
        };
        let Some(count) = self.sampler_value(root).and_then(|value| value.count) else { return Ok(None) };
        let name = root.as_name().unwrap_or_default();
        let what = match index {
            Some(k) => format!("element {k} of the array {name} of {count} samplers"),
            None => format!("the array {name} of samplers with an index that is no number is not supported"),
        };
        Err(Wrong::at(argument.line, what))
    }

    /// The sampler, or the array of samplers, that an argument names.
    fn sampler_value(&self, argument: &Expr) -> Option<SamplerValue> {
        let ExprKind::Index(array, index) = &argument.kind else {
            return self.scopes.find(argument.as_name()?)?.sampler.clone();
        };
        let (value, k) = (self.sampler_value(array)?, index.as_number()? as usize);
        value.count.filter(|&count| k < count)?;
        Some(SamplerValue { first: value.first + k, count: None, ..value })
    }

    /// The copy of a function with samplers as parameters that a call needs: naga's front end and WGSL have no such values. None if the
    /// function has no such parameters.
    ///
    /// # Errors
    /// If an argument for a sampler names none.
    fn copy(&mut self, name: &str, arguments: &[Expr], line: u32) -> TranslateResult<Option<(usize, Signature)>> {
        let all = self.functions.of_samplers.get(name).into_iter().flatten();
        let mut overloads = all.filter(|of| of.1 == arguments.len()).peekable();
        if overloads.peek().is_none() {
            return Ok(None);
        }
        let values: Vec<Option<SamplerValue>> = arguments.iter().map(|of| self.sampler_value(of)).collect();
        let kinds = values.iter().enumerate().filter_map(|(k, value)| Some((k, value.as_ref()?.parameter())));
        let wanted: Vec<(usize, String)> = kinds.collect();
        let Some(of) = overloads.find(|of| of.2 == wanted).cloned() else {
            if arguments.iter().any(|argument| argument.any(|of| self.sampler_value(of).is_some())) {
                let what = format!("a call of the function {name} whose samplers are not those of its parameters");
                return Err(Wrong::at(line, format!("{what} is not supported")));
            }
            return Ok(None);
        };
        let values: Vec<SamplerValue> = values.into_iter().flatten().collect();
        let next = self.copies.len();
        let number = *self.numbers.entry((of.clone(), values.clone())).or_insert(next);
        if number == next {
            self.copies.push((of.clone(), values));
        }
        Ok(Some((number, of)))
    }

    /// Lowers functions, in order. A function with samplers as parameters is lowered for each choice of samplers.
    ///
    /// # Errors
    /// If a function is not supported, or if the copies have too many tokens.
    pub fn functions(&mut self, functions: Vec<Placed<Function>>, dialects: &[Dialect]) -> TranslateResult<Vec<Token>> {
        let mut printed: Vec<Vec<Token>> = vec![Vec::new(); functions.len()];
        let signatures: Vec<Signature> = functions.iter().map(|function| signature(&function.of)).collect();
        let mut one = |own: &mut Lowering, k: usize, copy: Option<usize>, chosen: &[SamplerValue]| -> TranslateResult<usize> {
            let Placed { at, of } = &functions[k];
            (own.at, own.dialect) = (*at, dialects[at.0]);
            let name = own.rename(&own.functions.written(&of.name));
            let name = copy.map_or(name.clone(), |number| copy_name(number, &name));
            let mut lowered = own.function(of.clone(), name, chosen)?;
            if of.name == "main"
                && let Some(body) = &mut lowered.body
            {
                body.splice(0..0, own.start.drain(..));
            }
            let mut printer = Printer::default();
            printer.function(&lowered);
            printed[k].extend_from_slice(&printer.out);
            Ok(printer.out.len())
        };
        // Calls outside of such functions come first. Calls in copies find further copies.
        for (k, (_, _, samplers)) in signatures.iter().enumerate() {
            if samplers.is_empty() {
                one(self, k, None, &[])?;
            }
        }
        let (mut number, mut size) = (0, 0);
        while let Some((wanted, chosen)) = self.copies.get(number).cloned() {
            for (k, _) in signatures.iter().enumerate().filter(|(_, own)| **own == wanted) {
                size += one(self, k, Some(number), &chosen)?;
                if size > TOKENS_MAX {
                    let what = format!("more than {TOKENS_MAX} tokens of functions that are copied for their samplers");
                    return Err(Wrong::at(functions[k].of.line, what));
                }
            }
            number += 1;
        }
        Ok(printed.concat())
    }
}

/// The name of a copy.
fn copy_name(number: usize, of: &str) -> String {
    format!("glx_copy{number}_{of}_")
}

fn without_number(name: &str, line: u32) -> Wrong {
    Wrong::at(line, format!("gl_{name} without a number in brackets is not supported"))
}
