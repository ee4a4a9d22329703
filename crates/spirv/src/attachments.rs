//! Input attachments become sampled images, read at the fragment's position.

use std::collections::{HashMap, HashSet};

use grammar::{Decoration as D, Dim, ImageOperands, Op};

use crate::interface::fragment_position;
use crate::words::{Inst, Parts, Type};
use crate::{InputAttachment, Place, Refusal};

/// Rewrites all input attachments, and says which there are.
///
/// # Errors
/// If an attachment has no place or no index, or is read with a coordinate that naga does not have.
pub fn rewrite(parts: &mut Parts) -> Result<Vec<InputAttachment>, Refusal> {
    let is_attachment = |inst: &Inst| inst.op == Op::TypeImage && inst.operand(2) == Dim::DimSubpassData as u32;
    // Whether the images of a type have several samples.
    let images: HashMap<u32, bool> =
        parts.globals.iter().filter(|inst| is_attachment(inst)).map(|inst| (inst.operand(0), inst.operand(5) != 0)).collect();
    if images.is_empty() {
        return Ok(Vec::new());
    }
    let found = describe(parts, &images)?;
    for inst in parts.globals.iter_mut().filter(|inst| is_attachment(inst)) {
        if inst.operands.len() < 8 {
            return Err(inst.refuse("it has too few operands"));
        }
        inst.operands[2] = Dim::Dim2D as u32;
        inst.operands[6] = 1;
    }
    parts.globals.retain(|inst| !(inst.op == Op::Decorate && inst.operand(1) == D::InputAttachmentIndex as u32));

    let values = parts.values();
    let reads = |inst: &Inst| {
        let image = values.get(&inst.operand(2)).and_then(|ty| images.get(ty));
        if inst.op == Op::ImageRead { image.copied() } else { None }
    };
    if !parts.functions.iter().flatten().any(|inst| reads(inst).is_some()) {
        return Ok(found);
    }
    let position = fragment_position(parts);
    let (float, int) = (parts.float_type(), parts.int_type(true));
    let (floats, pair, ints) = (parts.vector_type(float, 4), parts.vector_type(float, 2), parts.vector_type(int, 2));
    let zero = parts.constant(int, 0);
    let types = parts.types();
    for function in std::mem::take(&mut parts.functions) {
        let mut out = Vec::with_capacity(function.len());
        for mut inst in function {
            if let Some(is_multisampled) = reads(&inst) {
                let coordinate = inst.operand(3);
                if !values.get(&coordinate).is_some_and(|ty| is_pair(&types, *ty)) {
                    return Err(inst.refuse("an input attachment is read at an offset that is no vector of two signed numbers"));
                }
                let [here, corner, whole, sum] = [(); 4].map(|()| parts.fresh());
                let at = inst.at;
                out.push(Inst { at, op: Op::Load, operands: vec![floats, here, position] });
                out.push(Inst { at, op: Op::VectorShuffle, operands: vec![pair, corner, here, here, 0, 1] });
                out.push(Inst { at, op: Op::ConvertFToS, operands: vec![ints, whole, corner] });
                out.push(Inst { at, op: Op::IAdd, operands: vec![ints, sum, whole, coordinate] });
                inst.op = Op::ImageFetch;
                inst.operands[3] = sum;
                if !is_multisampled {
                    inst.operands.truncate(4);
                    inst.operands.extend([ImageOperands::LOD.bits(), zero]);
                }
            }
            out.push(inst);
        }
        parts.functions.push(out);
    }
    Ok(found)
}

fn is_pair(types: &HashMap<u32, Type>, ty: u32) -> bool {
    match types.get(&ty) {
        Some(Type::Vector { of, count: 2 }) => types.get(of) == Some(&Type::Int { bits: 32, signed: true }),
        _ => false,
    }
}

/// The variables of these images, with their places and indices.
fn describe(parts: &Parts, images: &HashMap<u32, bool>) -> Result<Vec<InputAttachment>, Refusal> {
    let (types, decorations) = (parts.types(), parts.decorations());
    let mut holders: HashSet<u32> = images.keys().copied().collect();
    let mut found = Vec::new();
    for inst in &parts.globals {
        match Parts::type_of(inst) {
            Some((id, Type::Array { of, .. } | Type::RuntimeArray { of } | Type::Pointer { to: of, .. }))
                if holders.contains(&of) =>
            {
                holders.insert(id);
            }
            _ if inst.op == Op::Variable && holders.contains(&inst.operand(0)) && types.contains_key(&inst.operand(0)) => {
                let value = |kind: D| {
                    let all = decorations.get(&inst.operand(1)).into_iter().flatten();
                    all.filter(|d| d.member.is_none() && d.kind == kind as u32).map(|d| d.value).next()
                };
                let place = value(D::DescriptorSet).zip(value(D::Binding)).zip(value(D::InputAttachmentIndex));
                let Some(((set, binding), index)) = place else {
                    return Err(inst.refuse("an input attachment has a set, a binding and an index"));
                };
                found.push(InputAttachment { place: Place { set, binding }, index });
            }
            _ => {}
        }
    }
    found.sort_unstable();
    found.dedup();
    Ok(found)
}
