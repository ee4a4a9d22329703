//! Which variables code may write, and which are indexed at run time. Both are found before the code is walked.

use std::collections::HashSet;
use std::rc::Rc;

use naga::{Block, Expression, Function, GlobalVariable, Handle, LocalVariable, Statement, TypeInner};

use super::{Lowerer, Root, Val, Var};
use crate::types::{Ty, Types};

/// What a function writes that its caller can see.
#[derive(Clone, Debug, Default)]
pub(crate) struct Writes {
    pub args: HashSet<u32>,
    pub globals: Vec<Handle<GlobalVariable>>,
}

/// Variables that hold an array which is indexed at run time: these live in runs of registers.
#[derive(Default)]
pub(crate) struct Indexed {
    /// By function (entry point: none) and variable.
    pub locals: HashSet<(Option<Handle<Function>>, Handle<LocalVariable>)>,
    pub globals: HashSet<Handle<GlobalVariable>>,
}

/// The variable a pointer expression starts from.
fn root(function: &Function, mut h: Handle<Expression>) -> Handle<Expression> {
    loop {
        match function.expressions[h] {
            Expression::Access { base, .. } | Expression::AccessIndex { base, .. } => h = base,
            _ => return h,
        }
    }
}

/// Calls `f` for every statement, nested ones included.
pub(crate) fn each_statement<'b>(block: &'b Block, f: &mut impl FnMut(&'b Statement)) {
    for statement in block.iter() {
        f(statement);
        match statement {
            Statement::Block(b) => each_statement(b, f),
            Statement::If { accept, reject, .. } => {
                each_statement(accept, f);
                each_statement(reject, f);
            }
            Statement::Switch { cases, .. } => cases.iter().for_each(|c| each_statement(&c.body, f)),
            Statement::Loop { body, continuing, .. } => {
                each_statement(body, f);
                each_statement(continuing, f);
            }
            _ => {}
        }
    }
}

/// Finds the arrays indexed at run time, through pointer arguments too.
pub(crate) fn find_indexed(module: &naga::Module, info: &naga::valid::ModuleInfo, entry: usize) -> Indexed {
    let mut out = Indexed::default();
    // Arguments through which arrays are indexed, of the functions seen so far: callees come before their callers.
    let mut args: HashSet<(Handle<Function>, u32)> = HashSet::new();
    let functions = module.functions.iter().map(|(h, f)| (Some(h), f, &info[h]));
    let last = (None, &module.entry_points[entry].function, info.get_entry_point(entry));
    for (handle, function, info) in functions.chain([last]) {
        let mut found: Vec<Handle<Expression>> = Vec::new();
        for (_, e) in function.expressions.iter() {
            let Expression::Access { base, index } = *e else { continue };
            let TypeInner::Pointer { base: pointee, .. } = *info[base].ty.inner_with(&module.types) else { continue };
            let literal = matches!(function.expressions[index], Expression::Literal(_) | Expression::Constant(_));
            if matches!(module.types[pointee].inner, TypeInner::Array { .. }) && !literal {
                found.push(root(function, base));
            }
        }
        each_statement(&function.body, &mut |s| {
            if let Statement::Call { function: callee, arguments, .. } = s {
                for (i, &a) in arguments.iter().enumerate() {
                    if args.contains(&(*callee, i as u32)) {
                        found.push(root(function, a));
                    }
                }
            }
        });
        for h in found {
            match function.expressions[h] {
                Expression::LocalVariable(l) => {
                    out.locals.insert((handle, l));
                }
                Expression::GlobalVariable(g) => {
                    out.globals.insert(g);
                }
                Expression::FunctionArgument(i) => {
                    if let Some(handle) = handle {
                        args.insert((handle, i));
                    }
                }
                _ => {}
            }
        }
    }
    out
}

impl<'a> Lowerer<'a> {
    /// What a function writes of its callers' variables.
    pub fn function_writes(&mut self, handle: Handle<Function>) -> Rc<Writes> {
        if let Some(w) = self.writes.get(&handle) {
            return w.clone();
        }
        let function: &'a Function = &self.module.functions[handle];
        let mut out = Writes::default();
        let mut roots = Vec::new();
        self.pointers_written(&function.body, &mut |h| roots.push(h), &mut out.globals);
        for h in roots {
            match function.expressions[root(function, h)] {
                Expression::FunctionArgument(i) => {
                    out.args.insert(i);
                }
                Expression::GlobalVariable(g) => out.globals.push(g),
                _ => {}
            }
        }
        out.globals.sort();
        out.globals.dedup();
        let out = Rc::new(out);
        self.writes.insert(handle, out.clone());
        out
    }

    /// Calls `f` for each pointer expression of its function that the block may write through; globals written by callees are
    /// appended.
    fn pointers_written(
        &mut self,
        block: &'a Block,
        f: &mut impl FnMut(Handle<Expression>),
        globals: &mut Vec<Handle<GlobalVariable>>,
    ) {
        let mut calls = Vec::new();
        let mut statements = 0;
        each_statement(block, &mut |s| {
            statements += 1;
            match *s {
                Statement::Store { pointer, .. } | Statement::Atomic { pointer, .. } => f(pointer),
                Statement::Call { function: callee, ref arguments, .. } => calls.push((callee, arguments)),
                _ => {}
            }
        });
        self.b.steps += statements / 8;
        for (callee, arguments) in calls {
            let w = self.function_writes(callee);
            for &i in &w.args {
                f(arguments[i as usize]);
            }
            globals.extend(&w.globals);
        }
    }

    /// The components of the state that a block of the current function may write, in order.
    pub fn assigned(&mut self, blocks: &[&'a Block]) -> Vec<usize> {
        let function: &'a Function = self.frame().function;
        let (mut pointers, mut globals) = (Vec::new(), Vec::new());
        for block in blocks {
            self.pointers_written(block, &mut |h| pointers.push(h), &mut globals);
        }
        // Ranges of components, so that a variable that is written often is listed once in the end.
        let mut out: Vec<(usize, usize)> = Vec::new();
        let types = self.types;
        for h in pointers {
            let frame = self.frame();
            let (mut at, mut path) = (h, Vec::new());
            let (var, ty) = loop {
                match function.expressions[at] {
                    Expression::Access { base, .. } => {
                        path.push(None);
                        at = base;
                    }
                    Expression::AccessIndex { base, index } => {
                        path.push(Some(index));
                        at = base;
                    }
                    Expression::LocalVariable(l) => {
                        break (frame.locals[l.index()], Ty::Named(function.local_variables[l].ty));
                    }
                    Expression::FunctionArgument(i) => match &frame.args[i as usize] {
                        // Through a pointer argument the place is the caller's: take the whole part it points to.
                        Val::Place(p) => {
                            if let Root::Var(Var::State { base }) = p.root {
                                let n = reach(types, p);
                                out.push((base + n.0, base + n.0 + n.1));
                            }
                            break (Var::Range { id: 0 }, p.ty);
                        }
                        _ => break (Var::Range { id: 0 }, Ty::Scalar(naga::Scalar::U32)),
                    },
                    Expression::GlobalVariable(g) => match self.globals.get(&g) {
                        Some(Val::Place(p)) => match p.root {
                            Root::Var(v) => break (v, p.ty),
                            Root::Memory { .. } => break (Var::Range { id: 0 }, p.ty),
                        },
                        _ => break (Var::Range { id: 0 }, Ty::Scalar(naga::Scalar::U32)),
                    },
                    _ => break (Var::Range { id: 0 }, Ty::Scalar(naga::Scalar::U32)),
                }
            };
            let Var::State { base } = var else { continue };
            let (mut ty, mut offset) = (ty, 0);
            while let Some(Some(index)) = path.pop() {
                match types.part(ty, index) {
                    Some((part, components, _)) => {
                        ty = part;
                        offset += components;
                    }
                    None => break,
                }
            }
            let first = base + offset as usize;
            out.push((first, first + types.components(ty) as usize));
        }
        for g in globals {
            if let Some(Val::Place(p)) = self.globals.get(&g)
                && let Root::Var(Var::State { base }) = p.root
            {
                out.push((base, base + types.components(p.ty) as usize));
            }
        }
        out.sort_unstable();
        let mut all = Vec::new();
        let mut end = 0;
        for (first, last) in out {
            all.extend(first.max(end)..last);
            end = end.max(last);
        }
        self.b.steps += all.len() as u64 / 8;
        all
    }
}

/// First component and number of components that a place in a variable may denote.
fn reach(types: Types<'_>, p: &super::AccessPath) -> (usize, usize) {
    let span: u32 = p.choices.iter().map(|c| (c.count - 1) * c.stride).sum();
    (p.offset as usize, (types.components(p.ty) + span) as usize)
}

/// Whether a function returns anywhere but at its very end.
pub(crate) fn returns_early(function: &Function) -> bool {
    let mut returns = 0;
    each_statement(&function.body, &mut |s| returns += usize::from(matches!(s, Statement::Return { .. })));
    let tail = matches!(function.body.last(), Some(Statement::Return { .. }));
    returns > usize::from(tail)
}

/// Whether a block breaks out of the switch it is a case of, elsewhere than at its end.
pub(crate) fn breaks_early(block: &Block) -> bool {
    fn nested(block: &Block) -> bool {
        block.iter().any(|s| match s {
            Statement::Break => true,
            Statement::Block(b) => nested(b),
            Statement::If { accept, reject, .. } => nested(accept) || nested(reject),
            _ => false,
        })
    }
    let n = block.len();
    block.iter().enumerate().any(|(i, s)| match s {
        Statement::Break => i + 1 != n,
        Statement::Block(b) => nested(b),
        Statement::If { accept, reject, .. } => nested(accept) || nested(reject),
        _ => false,
    })
}

/// Whether a loop body continues the loop anywhere.
pub(crate) fn continues(block: &Block) -> bool {
    block.iter().any(|s| match s {
        Statement::Continue => true,
        Statement::Block(b) => continues(b),
        Statement::If { accept, reject, .. } => continues(accept) || continues(reject),
        Statement::Switch { cases, .. } => cases.iter().any(|c| continues(&c.body)),
        _ => false,
    })
}
