//! The memory model of Vulkan becomes that of GLSL.
//!
//! The engine runs what has side effects in the order of the API, so that what is written is available and visible at once. The operands
//! that ask for it are cut, and so is what is said of alignment.

use grammar::{AddressingModel, Capability, ImageOperands, MemoryModel, Op};

use crate::Refusal;
use crate::words::{Inst, Parts, text};

/// Takes the memory model away.
///
/// # Errors
/// If memory is addressed by pointers that are numbers.
pub fn rewrite(parts: &mut Parts) -> Result<(), Refusal> {
    parts.globals.retain(|inst| match inst.op {
        Op::Capability => ![Capability::VulkanMemoryModel, Capability::VulkanMemoryModelDeviceScope]
            .map(|c| c as u32)
            .contains(&inst.operand(0)),
        Op::Extension => text(&inst.operands).is_none_or(|(name, _)| name != "SPV_KHR_vulkan_memory_model"),
        _ => true,
    });
    for inst in &mut parts.globals {
        if inst.op == Op::MemoryModel {
            if inst.operand(0) != AddressingModel::Logical as u32 {
                return Err(inst.refuse("buffers that are addressed by pointers are not supported"));
            }
            inst.operands = vec![AddressingModel::Logical as u32, MemoryModel::GLSL450 as u32];
        }
    }
    for inst in parts.functions.iter_mut().flatten() {
        cut(inst)?;
    }
    Ok(())
}

/// Cuts the operands that are about memory.
fn cut(inst: &mut Inst) -> Result<(), Refusal> {
    match inst.op {
        Op::Load => inst.operands.truncate(3),
        Op::Store | Op::CopyMemory => inst.operands.truncate(2),
        _ => {
            if let Some(at) = image_operands_at(inst.op) {
                cut_image_operands(inst, at)?;
            }
        }
    }
    Ok(())
}

/// Which operand of an instruction on an image is the mask of its further operands.
pub fn image_operands_at(op: Op) -> Option<usize> {
    match op {
        Op::ImageSampleImplicitLod
        | Op::ImageSampleExplicitLod
        | Op::ImageSampleProjImplicitLod
        | Op::ImageSampleProjExplicitLod
        | Op::ImageFetch
        | Op::ImageRead => Some(4),
        Op::ImageSampleDrefImplicitLod
        | Op::ImageSampleDrefExplicitLod
        | Op::ImageSampleProjDrefImplicitLod
        | Op::ImageSampleProjDrefExplicitLod
        | Op::ImageGather
        | Op::ImageDrefGather => Some(5),
        Op::ImageWrite => Some(3),
        _ => None,
    }
}

fn cut_image_operands(inst: &mut Inst, at: usize) -> Result<(), Refusal> {
    let Some(&mask) = inst.operands.get(at) else { return Ok(()) };
    let mask = ImageOperands::from_bits_retain(mask);
    // The bits in the order of their operands, with the number of operands of each.
    let with_operands = [
        (ImageOperands::BIAS, 1),
        (ImageOperands::LOD, 1),
        (ImageOperands::GRAD, 2),
        (ImageOperands::CONST_OFFSET, 1),
        (ImageOperands::OFFSET, 1),
        (ImageOperands::CONST_OFFSETS, 1),
        (ImageOperands::SAMPLE, 1),
        (ImageOperands::MIN_LOD, 1),
    ];
    let kept = with_operands.iter().fold(ImageOperands::NONE, |all, &(bit, _)| all | bit);
    let cut = ImageOperands::MAKE_TEXEL_AVAILABLE
        | ImageOperands::MAKE_TEXEL_VISIBLE
        | ImageOperands::NON_PRIVATE_TEXEL
        | ImageOperands::VOLATILE_TEXEL
        | ImageOperands::SIGN_EXTEND
        | ImageOperands::ZERO_EXTEND
        | ImageOperands::NONTEMPORAL;
    if !(mask - kept - cut).is_empty() {
        return Err(inst.refuse(format!("image operands {:#x} are not supported", (mask - kept - cut).bits())));
    }
    let words: usize = with_operands.iter().filter(|&&(bit, _)| mask.contains(bit)).map(|&(_, words)| words).sum();
    if inst.operands.len() < at + 1 + words {
        return Err(inst.refuse("it has too few image operands"));
    }
    inst.operands.truncate(at + 1 + words);
    inst.operands[at] = (mask & kept).bits();
    if (mask & kept).is_empty() {
        inst.operands.truncate(at);
    }
    Ok(())
}
