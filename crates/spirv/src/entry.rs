//! The entry point that is asked for, alone.

use std::collections::{HashMap, HashSet};

use grammar::{ExecutionModel, Op, StorageClass};

use crate::words::{Inst, Parts, text};
use crate::{Refusal, Stage};

/// Keeps one entry point and the functions that it calls, and gives the id of its function.
///
/// # Errors
/// If there is no entry point of this name and stage, or the stage is one that the engine does not have.
pub fn select(parts: &mut Parts, name: &str, stage: Stage) -> Result<u32, Refusal> {
    let model = match stage {
        Stage::Vertex => ExecutionModel::Vertex,
        Stage::TessellationControl => ExecutionModel::TessellationControl,
        Stage::TessellationEvaluation => ExecutionModel::TessellationEvaluation,
        Stage::Geometry => ExecutionModel::Geometry,
        Stage::Fragment => ExecutionModel::Fragment,
        Stage::Compute => ExecutionModel::GLCompute,
    };
    let is_asked = |inst: &&Inst| {
        let named = || text(inst.from(2)).is_some_and(|(text, _)| text == name);
        inst.op == Op::EntryPoint && inst.operand(0) == model as u32 && named()
    };
    let Some(entry) = parts.globals.iter().find(is_asked).cloned() else {
        return Err(Refusal {
            word: 0,
            instruction: "OpEntryPoint".to_owned(),
            reason: format!("the module has no entry point `{}` of the {stage} stage", name.escape_debug()),
        });
    };
    if matches!(stage, Stage::TessellationControl | Stage::TessellationEvaluation | Stage::Geometry) {
        return Err(entry.refuse(format!("the {stage} stage is not supported")));
    }
    let id = entry.operand(1);

    let numbers: HashMap<u32, usize> =
        parts.functions.iter().enumerate().filter_map(|(n, insts)| Some((insts.first()?.result()?, n))).collect();
    let mut kept = HashSet::new();
    let mut open = vec![id];
    while let Some(function) = open.pop() {
        let Some(&number) = numbers.get(&function).filter(|_| kept.insert(function)) else { continue };
        for call in parts.functions[number].iter().filter(|inst| inst.op == Op::FunctionCall) {
            if !numbers.contains_key(&call.operand(2)) {
                return Err(call.refuse(format!("%{} is no function of the module", call.operand(2))));
            }
            open.push(call.operand(2));
        }
    }
    if !kept.contains(&id) {
        return Err(entry.refuse(format!("%{id} is no function of the module")));
    }
    parts.functions.retain(|insts| insts.first().and_then(|inst| inst.result()).is_some_and(|id| kept.contains(&id)));
    parts.globals.retain(|inst| match inst.op {
        Op::EntryPoint => inst.at == entry.at,
        Op::ExecutionMode | Op::ExecutionModeId => inst.operand(0) == id,
        _ => true,
    });
    forget_variables(parts);
    // Names serve nobody here, and those of functions that are gone would name nothing.
    parts.globals.retain(|inst| {
        !matches!(
            inst.op,
            Op::Name
                | Op::MemberName
                | Op::String
                | Op::Line
                | Op::NoLine
                | Op::Source
                | Op::SourceContinued
                | Op::SourceExtension
                | Op::ModuleProcessed
        )
    });
    for insts in &mut parts.functions {
        insts.retain(|inst| !matches!(inst.op, Op::Line | Op::NoLine | Op::Nop));
    }
    Ok(id)
}

/// Takes away the variables that the entry point does not use: those of others may be what it cannot have.
fn forget_variables(parts: &mut Parts) {
    let Some(entry) = parts.globals.iter_mut().find(|inst| inst.op == Op::EntryPoint) else { return };
    let before = 2 + text(entry.from(2)).map_or(0, |(_, words)| words);
    let listed: HashSet<u32> = entry.from(before).iter().copied().collect();
    let used: HashSet<u32> = parts.functions.iter().flatten().flat_map(|inst| inst.operands.iter().copied()).collect();
    let stages = [StorageClass::Input, StorageClass::Output].map(|class| class as u32);
    let is_gone = |inst: &&Inst| {
        let id = inst.operand(1);
        let is_kept = if stages.contains(&inst.operand(2)) { listed.contains(&id) } else { used.contains(&id) };
        inst.op == Op::Variable && !is_kept
    };
    let gone: HashSet<u32> = parts.globals.iter().filter(is_gone).map(|inst| inst.operand(1)).collect();
    parts.globals.retain(|inst| match inst.op {
        Op::Variable => !gone.contains(&inst.operand(1)),
        Op::Decorate | Op::DecorateId | Op::DecorateString => !gone.contains(&inst.operand(0)),
        _ => true,
    });
    if let Some(entry) = parts.globals.iter_mut().find(|inst| inst.op == Op::EntryPoint) {
        let kept: Vec<u32> = entry.from(before).iter().copied().filter(|id| !gone.contains(id)).collect();
        entry.operands.truncate(before);
        entry.operands.extend(kept);
    }
}
