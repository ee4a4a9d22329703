//! Where statements go on. What follows `return`, `discard`, `break` or `continue` in its block never runs, and naga refuses some of it. A
//! function that has a result may end without `return` where no run gets there, but naga wants a `return`. A case of WGSL does not go on with
//! the next case, so such a case gets a copy of the statements that follow. After `continue` naga goes on with the body of `do` and not with
//! the condition, so such a loop is written with `while`, and its condition is not read the first time.

use super::print::Printer;
use super::tree::{Declaration, Declarator, Expr, ExprKind, Function, Kind, Statement, StatementKind};
use super::words::is_type;
use super::{TOKENS_MAX, TranslateResult, Wrong};

/// Removes what never runs from the statements of a block. `labels` says that it is the block of `switch`. Returns whether no run gets to
/// its end.
fn trim(statements: &mut Vec<Statement>, labels: bool) -> bool {
    let mut ended = false;
    statements.retain_mut(|statement| {
        // naga knows the end of a case by its `break`.
        if labels && matches!(statement.kind, StatementKind::Label(_) | StatementKind::Jump("break")) {
            ended = false;
        }
        let runs = !ended;
        if runs {
            ended = leaves(statement);
        }
        runs
    });
    ended
}

/// Removes what never runs from a statement. Returns whether no run goes on behind it.
fn leaves(statement: &mut Statement) -> bool {
    match &mut statement.kind {
        StatementKind::Jump(_) | StatementKind::Return(_) => true,
        StatementKind::Block(all) => trim(all, false),
        StatementKind::If(_, accept, reject) => {
            let accept = leaves(accept);
            reject.as_mut().is_some_and(|reject| leaves(reject)) && accept
        }
        StatementKind::For(_, _, body) | StatementKind::While(_, body) | StatementKind::Do(body, _) => {
            leaves(body);
            false
        }
        StatementKind::Switch(_, all) => {
            trim(all, true);
            false
        }
        _ => false,
    }
}

/// Returns true if no run goes on behind the last of these statements. Statements that never run have been removed. With `naga`, a run goes
/// on behind `discard`.
fn ends(statements: &[Statement], naga: bool) -> bool {
    statements.last().is_some_and(|last| match &last.kind {
        StatementKind::Jump("discard") => !naga,
        StatementKind::Jump(_) | StatementKind::Return(_) => true,
        StatementKind::Block(all) => ends(all, naga),
        StatementKind::If(_, accept, Some(reject)) => {
            [accept, reject].into_iter().all(|branch| ends(std::slice::from_ref(&**branch), naga))
        }
        _ => false,
    })
}

/// Removes what never runs from a function, and puts a `return`, which no run reaches if the function is right, at its end if it needs that.
pub fn returns(of: &mut Function) {
    let (kind, line) = (&of.kind, of.end);
    let Some(body) = &mut of.body else { return };
    trim(body, false);
    if kind.name == "void" && kind.sizes.is_empty() || ends(body, true) {
        return;
    }
    let result = |value: Expr| Statement::new(line, StatementKind::Return(Some(value)));
    if kind.sizes.is_empty() && is_type(&kind.name) {
        body.push(result(Expr::call(line, &kind.name, vec![Expr::number(line, 0)])));
        return;
    }
    // A variable of any type begins with zeros.
    let variable = Declaration::plain(Kind { line, ..kind.clone() }, Declarator::plain(line, "glx_none", None));
    let variable = Statement::new(line, StatementKind::Declaration(variable));
    body.push(Statement::new(line, StatementKind::Block(vec![variable, result(Expr::name(line, "glx_none"))])));
}

/// The end of a case.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Ending {
    /// With `break`, as naga knows it.
    Break,
    /// It goes on with the next case.
    Next,
    /// With another statement behind which no run goes on.
    Other,
}

/// The end of a case with these statements.
fn ending(body: &[Statement]) -> Ending {
    match body {
        [before @ .., Statement { kind: StatementKind::Jump("break"), .. }] if !ends(before, false) => Ending::Break,
        _ if !ends(body, false) => Ending::Next,
        _ => Ending::Other,
    }
}

/// Puts the statements of a case where naga does not see how they end, and `break` behind them.
fn enclose(body: &mut Vec<Statement>, line: u32) {
    let block = Box::new(Statement::new(line, StatementKind::Block(std::mem::take(body))));
    body.push(Statement::new(line, StatementKind::If(Expr::name(line, "true"), block, None)));
    body.push(Statement::new(line, StatementKind::Jump("break")));
}

/// The number of tokens of statements.
fn length(statements: &[Statement]) -> usize {
    let mut printer = Printer::default();
    statements.iter().for_each(|of| printer.statement(of));
    printer.out.len()
}

/// Writes the cases of a block of `switch` so that each ends with `break` and none goes on with the next case. The cases of blocks in it have
/// been written before.
///
/// # Errors
/// If the cases have too many tokens by that.
pub fn separate(statements: &mut Vec<Statement>, line: u32) -> TranslateResult {
    // Statements before the first label, and cases: their labels and their statements.
    let mut before = Vec::new();
    let mut cases: Vec<[Vec<Statement>; 2]> = Vec::new();
    for statement in std::mem::take(statements) {
        let label = matches!(statement.kind, StatementKind::Label(_));
        match cases.last_mut() {
            Some([labels, body]) if label && body.is_empty() => labels.push(statement),
            _ if label => cases.push([vec![statement], Vec::new()]),
            Some([_, body]) => body.push(statement),
            None => before.push(statement),
        }
    }
    statements.append(&mut before);
    // naga leaves the last case by itself.
    let plain = cases.iter().rev().skip(1).all(|[_, body]| ending(body) == Ending::Break);
    if !plain {
        let mut size = 0;
        let mut next: Option<Vec<Statement>> = None;
        for [_, body] in cases.iter_mut().rev() {
            match (ending(body), &next) {
                (Ending::Break, _) => {}
                (Ending::Next, Some(next)) => {
                    size += length(next);
                    if size > TOKENS_MAX {
                        let what = format!("more than {TOKENS_MAX} tokens of cases that go on with the next one");
                        return Err(Wrong::at(line, what));
                    }
                    body.extend_from_slice(next);
                }
                (Ending::Next, None) => body.push(Statement::new(line, StatementKind::Jump("break"))),
                (Ending::Other, _) => enclose(body, line),
            }
            next = Some(body.clone());
        }
    }
    statements.extend(cases.into_iter().flatten().flatten());
    Ok(())
}

/// Returns true if the statement has a `continue` that belongs to the loop around it.
fn continues(of: &Statement) -> bool {
    match &of.kind {
        StatementKind::Jump(word) => *word == "continue",
        StatementKind::Block(all) | StatementKind::Switch(_, all) => all.iter().any(continues),
        StatementKind::If(_, accept, reject) => [accept].into_iter().chain(reject).any(|of| continues(of)),
        _ => false,
    }
}

/// Writes a loop whose condition follows its body, with `while` if that is needed. `number` tells apart the loops of a stage.
pub fn repeat(body: Box<Statement>, condition: Expr, line: u32, number: usize) -> StatementKind {
    if !continues(&body) {
        return StatementKind::Do(body, condition);
    }
    let name = format!("glx_again{number}");
    let first = Expr::assign(line, &name, Expr::name(line, "true"));
    let condition = ExprKind::Choice(Box::new([Expr::name(line, &name), condition, first]));
    let variable = Declarator::plain(line, name, Some(Expr::name(line, "false")));
    let variable = Declaration::plain(Kind::plain(line, "bool"), variable);
    StatementKind::Block(vec![
        Statement::new(line, StatementKind::Declaration(variable)),
        Statement::new(line, StatementKind::While(Expr::new(line, condition), body)),
    ])
}
