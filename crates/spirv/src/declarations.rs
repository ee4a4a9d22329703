//! Declarations that ask for what is there, or say nothing that changes what a program computes.

use std::collections::HashSet;

use grammar::{Capability, Decoration as D, ExecutionMode, Op};

use crate::words::{Inst, Parts, text};

/// Capabilities that naga does not know by name. What they allow is read, rewritten, or refused where it is used.
const ALLOWED: &[Capability] = &[
    Capability::DrawParameters,
    Capability::ImageGatherExtended,
    Capability::InterpolationFunction,
    Capability::MinLod,
    Capability::InputAttachment,
    Capability::SampledBuffer,
    Capability::ImageBuffer,
    Capability::StorageImageReadWithoutFormat,
    Capability::StorageImageWriteWithoutFormat,
    Capability::SampledImageArrayDynamicIndexing,
    Capability::StorageImageArrayDynamicIndexing,
    Capability::ShaderNonUniform,
    Capability::InputAttachmentArrayDynamicIndexing,
    Capability::UniformTexelBufferArrayDynamicIndexing,
    Capability::StorageTexelBufferArrayDynamicIndexing,
    Capability::UniformBufferArrayNonUniformIndexing,
    Capability::SampledImageArrayNonUniformIndexing,
    Capability::StorageBufferArrayNonUniformIndexing,
    Capability::StorageImageArrayNonUniformIndexing,
    Capability::InputAttachmentArrayNonUniformIndexing,
    Capability::UniformTexelBufferArrayNonUniformIndexing,
    Capability::StorageTexelBufferArrayNonUniformIndexing,
    Capability::DemoteToHelperInvocation,
    Capability::DenormPreserve,
    Capability::DenormFlushToZero,
    Capability::SignedZeroInfNanPreserve,
    Capability::RoundingModeRTE,
    Capability::DeviceGroup,
    Capability::StorageInputOutput16,
    Capability::GroupNonUniformQuad,
    Capability::ShaderLayer,
    Capability::ShaderViewportIndex,
    Capability::ShaderViewportIndexLayerEXT,
    Capability::MultiViewport,
    // They are those of other entry points: these stages are refused.
    Capability::Tessellation,
    Capability::TessellationPointSize,
    Capability::GeometryPointSize,
];

/// Modes that say which rounding and which denormal numbers are wanted, or what holds without them.
const MODES: &[ExecutionMode] = &[
    ExecutionMode::DenormPreserve,
    ExecutionMode::DenormFlushToZero,
    ExecutionMode::SignedZeroInfNanPreserve,
    ExecutionMode::RoundingModeRTE,
    ExecutionMode::SubgroupUniformControlFlowKHR,
    ExecutionMode::MaximallyReconvergesKHR,
];

/// Takes away capabilities, extensions, names of semantics, and instructions that only debuggers read.
pub fn rewrite(parts: &mut Parts) {
    let is_debug = |name: &str| name.starts_with("NonSemantic.") || name == "OpenCL.DebugInfo.100";
    let imports = parts.globals.iter().filter(|inst| inst.op == Op::ExtInstImport);
    let debug: HashSet<u32> = imports
        .filter(|inst| text(inst.from(1)).is_some_and(|(name, _)| is_debug(&name)))
        .map(|inst| inst.operand(0))
        .collect();
    parts.globals.retain(|inst| match inst.op {
        Op::Capability => !ALLOWED.iter().any(|&capability| capability as u32 == inst.operand(0)),
        // What an extension adds has capabilities, instructions, modes or decorations of its own.
        Op::Extension | Op::DecorateString | Op::MemberDecorateString => false,
        Op::ExtInstImport => !debug.contains(&inst.operand(0)),
        Op::ExtInst => !debug.contains(&inst.operand(2)),
        Op::ExecutionMode => !MODES.iter().any(|&mode| mode as u32 == inst.operand(1)),
        Op::DecorateId => inst.operand(1) != D::UniformId as u32,
        _ => true,
    });
    for function in &mut parts.functions {
        function.retain(|inst| inst.op != Op::ExtInst || !debug.contains(&inst.operand(2)));
        // It ends an invocation as `OpKill` does.
        for inst in function.iter_mut().filter(|inst| inst.op == Op::TerminateInvocation) {
            inst.op = Op::Kill;
        }
    }
    demote(parts);
}

/// An invocation that is demoted to a helper goes on, and so it does in the engine after `OpKill` in a function that it calls.
fn demote(parts: &mut Parts) {
    let is_demotion = |inst: &&Inst| inst.op == Op::DemoteToHelperInvocation;
    let Some(at) = parts.functions.iter().flatten().find(is_demotion).map(|inst| inst.at) else { return };
    let void = parts.declared(Op::TypeVoid, &[]);
    let signature = parts.declared(Op::TypeFunction, &[void]);
    let function = parts.fresh();
    let mut functions = std::mem::take(&mut parts.functions);
    for inst in functions.iter_mut().flatten().filter(|inst| inst.op == Op::DemoteToHelperInvocation) {
        inst.op = Op::FunctionCall;
        inst.operands = vec![void, parts.fresh(), function];
    }
    let body = [
        (Op::Function, vec![void, function, 0, signature]),
        (Op::Label, vec![parts.fresh()]),
        (Op::Kill, Vec::new()),
        (Op::FunctionEnd, Vec::new()),
    ];
    functions.push(body.into_iter().map(|(op, operands)| Inst { at, op, operands }).collect());
    parts.functions = functions;
}
