//! Storage images without a format, offsets of loads, and operands of samples that naga reads past.

use std::collections::{BTreeSet, HashMap, HashSet};

use grammar::{Decoration as D, ImageOperands, Op};

use crate::memory::image_operands_at;
use crate::words::{Code, Inst, Parts, Type};
use crate::{BoundFormat, Refusal, formats};

/// Gives storage images the formats of what is bound, and rewrites accesses to images.
///
/// # Errors
/// If a format is not known, or an access has operands that naga does not have.
pub fn rewrite(parts: &mut Parts, bound: &[BoundFormat]) -> Result<(), Refusal> {
    give_formats(parts, bound)?;
    let (types, values) = (parts.types(), parts.values());
    let constants = Constants::new(parts);
    for function in std::mem::take(&mut parts.functions) {
        let mut out = Code::default();
        for mut inst in function {
            match inst.op {
                Op::ImageTexelPointer => return Err(inst.refuse("atomic operations on images are not supported")),
                Op::ImageFetch | Op::ImageRead => offset(parts, &types, &values, &mut inst, &mut out)?,
                _ => {
                    if let Some(at) = image_operands_at(inst.op) {
                        sample(&constants, &mut inst, at)?;
                    }
                }
            }
            out.0.push(inst);
        }
        parts.functions.push(out.0);
    }
    Ok(())
}

/// The ids of constants.
struct Constants {
    all: HashSet<u32>,
    /// Numbers that are zero.
    zero: HashSet<u32>,
}

impl Constants {
    fn new(parts: &Parts) -> Constants {
        let is_constant = |inst: &&Inst| matches!(inst.op, Op::Constant | Op::ConstantComposite | Op::ConstantNull);
        let is_zero = |inst: &&Inst| match inst.op {
            Op::Constant => inst.from(2).iter().all(|&word| word == 0),
            _ => inst.op == Op::ConstantNull,
        };
        let all = parts.globals.iter().filter(is_constant);
        Constants {
            all: all.clone().map(|inst| inst.operand(1)).collect(),
            zero: all.filter(is_zero).map(|inst| inst.operand(1)).collect(),
        }
    }
}

/// Whether an instruction declares a storage image without a format.
fn is_open(inst: &Inst) -> bool {
    inst.op == Op::TypeImage && inst.operand(6) == 2 && inst.operand(7) == 0 && inst.operands.len() >= 8
}

/// Types of images of which each variable gets its own, by format.
struct Formats {
    /// Image types without a format, and arrays of and pointers to them: the declarations.
    open: HashMap<u32, Inst>,
    /// The same with a format.
    made: HashMap<(u32, u32), u32>,
}

impl Formats {
    /// The type with this format. New ones stand behind all declarations.
    fn with(&mut self, parts: &mut Parts, ty: u32, format: u32) -> u32 {
        if let Some(&id) = self.made.get(&(ty, format)) {
            return id;
        }
        let Some(mut inst) = self.open.get(&ty).cloned() else { return ty };
        match inst.op {
            Op::TypeImage => inst.operands[7] = format,
            Op::TypePointer => inst.operands[2] = self.with(parts, inst.operand(2), format),
            _ => inst.operands[1] = self.with(parts, inst.operand(1), format),
        }
        let id = parts.fresh();
        inst.operands[0] = id;
        parts.globals.push(inst);
        self.made.insert((ty, format), id);
        id
    }
}

fn give_formats(parts: &mut Parts, bound: &[BoundFormat]) -> Result<(), Refusal> {
    let mut formats = Formats { open: HashMap::new(), made: HashMap::new() };
    for inst in &parts.globals {
        let is_made_of = |operand: usize| formats.open.contains_key(&inst.operand(operand));
        let holds = match inst.op {
            Op::TypeArray | Op::TypeRuntimeArray => is_made_of(1),
            Op::TypePointer => is_made_of(2),
            _ => is_open(inst),
        };
        // A descriptor is an image or an array of images.
        if formats.open.len() > 1 << 10 {
            return Err(inst.refuse("there are too many types of storage images without a format"));
        }
        if holds {
            formats.open.insert(inst.operand(0), inst.clone());
        }
    }
    if formats.open.is_empty() {
        return Ok(());
    }
    let decorations = parts.decorations();
    let is_image = |inst: &Inst| inst.op == Op::Variable && formats.open.contains_key(&inst.operand(0));
    let (variables, globals): (Vec<Inst>, Vec<Inst>) = std::mem::take(&mut parts.globals).into_iter().partition(is_image);
    parts.globals = globals;
    // Formats by pointer.
    let mut known: HashMap<u32, u32> = HashMap::new();
    let mut different = BTreeSet::new();
    for mut inst in variables {
        let id = inst.operand(1);
        let value = |kind: D| {
            let all = decorations.get(&id).into_iter().flatten();
            all.filter(|d| d.member.is_none() && d.kind == kind as u32).map(|d| d.value).next()
        };
        let Some((set, binding)) = value(D::DescriptorSet).zip(value(D::Binding)) else {
            return Err(inst.refuse("a storage image has a set and a binding"));
        };
        let given = bound.iter().find(|bound| (bound.set, bound.binding) == (set, binding));
        let Some(given) = given else {
            return Err(inst.refuse(format!("the format of the storage image of set {set}, binding {binding} is not known")));
        };
        let Some(format) = formats::image(given.format) else {
            let reason = format!(
                "the storage image of set {set}, binding {binding} has format {}, which storage images do not have",
                given.format
            );
            return Err(inst.refuse(reason));
        };
        known.insert(id, format as u32);
        different.insert(format as u32);
        inst.operands[0] = formats.with(parts, inst.operand(0), format as u32);
        parts.globals.push(inst);
    }
    // A parameter has the format of all images, if they have the same.
    let shared = if let (1, Some(&format)) = (different.len(), different.first()) { Some(format) } else { None };
    for inst in parts.globals.iter_mut().filter(|inst| inst.op == Op::TypeFunction) {
        if let (None, true) = (shared, inst.operands.iter().any(|ty| formats.open.contains_key(ty))) {
            return Err(inst.refuse("a storage image without a format is a parameter, and images have several formats"));
        }
    }
    for function in std::mem::take(&mut parts.functions) {
        let mut out = Vec::with_capacity(function.len());
        for mut inst in function {
            if formats.open.contains_key(&inst.operand(0)) {
                let format = match inst.op {
                    Op::FunctionParameter => shared,
                    _ => known.get(&inst.operand(2)).copied().or(shared),
                };
                let Some(format) = format else {
                    return Err(inst.refuse("the format of a storage image is not known"));
                };
                known.insert(inst.operand(1), format);
                inst.operands[0] = formats.with(parts, inst.operand(0), format);
            }
            out.push(inst);
        }
        parts.functions.push(out);
    }
    // Signatures come last: they are made of types that now stand behind them.
    let (mut signatures, globals): (Vec<Inst>, Vec<Inst>) =
        std::mem::take(&mut parts.globals).into_iter().partition(|inst| inst.op == Op::TypeFunction);
    parts.globals = globals;
    for inst in &mut signatures {
        let operands = inst.from(1).to_vec();
        for (n, ty) in operands.into_iter().enumerate() {
            if let Some(format) = shared.filter(|_| formats.open.contains_key(&ty)) {
                inst.operands[n + 1] = formats.with(parts, ty, format);
            }
        }
    }
    parts.globals.extend(signatures);
    // naga refuses a declaration without a format, even if nothing is of this type.
    parts.globals.retain(|inst| inst.operands.is_empty() || !is_type(inst) || !formats.open.contains_key(&inst.operand(0)));
    Ok(())
}

fn is_type(inst: &Inst) -> bool {
    Parts::type_of(inst).is_some()
}

/// Adds the offset of a load to its coordinate: naga reads past it.
fn offset(
    parts: &mut Parts,
    types: &HashMap<u32, Type>,
    values: &HashMap<u32, u32>,
    inst: &mut Inst,
    out: &mut Code,
) -> Result<(), Refusal> {
    let mask = ImageOperands::from_bits_retain(inst.operand(4));
    let offset = mask & (ImageOperands::CONST_OFFSET | ImageOperands::OFFSET);
    let kept = ImageOperands::LOD | ImageOperands::SAMPLE;
    if !(mask - kept - offset).is_empty() || offset.bits().count_ones() > 1 {
        return Err(inst.refuse(format!("a load with image operands {:#x} is not supported", mask.bits())));
    }
    if offset.is_empty() {
        return Ok(());
    }
    // It stands behind the level.
    let place = 5 + usize::from(mask.contains(ImageOperands::LOD));
    if inst.operands.len() <= place {
        return Err(inst.refuse("it has too few image operands"));
    }
    let by = inst.operands.remove(place);
    inst.operands[4] = (mask - offset).bits();
    if inst.operands[4] == 0 {
        inst.operands.truncate(4);
    }
    let coordinate = inst.operand(3);
    let shape = |id: u32| {
        let ty = *values.get(&id)?;
        match *types.get(&ty)? {
            Type::Vector { of, count: count @ 2..=4 } => Some((ty, of, count)),
            Type::Int { .. } => Some((ty, ty, 1)),
            _ => None,
        }
    };
    let (Some((ty, scalar, count)), Some((_, of, offsets))) = (shape(coordinate), shape(by)) else {
        return Err(inst.refuse("the coordinate and the offset of a load are whole numbers"));
    };
    let at = inst.at;
    // The coordinate may have a layer behind, and another sign.
    let mut sums = Vec::new();
    for n in 0..count {
        let mut part = |parts: &mut Parts, id: u32, of: u32, count: u32| {
            if count == 1 { id } else { out.value(parts, at, Op::CompositeExtract, of, &[id, n]) }
        };
        let own = part(parts, coordinate, scalar, count);
        if n >= offsets {
            sums.push(own);
            continue;
        }
        let mut added = part(parts, by, of, offsets);
        if of != scalar {
            added = out.value(parts, at, Op::Bitcast, scalar, &[added]);
        }
        sums.push(out.value(parts, at, Op::IAdd, scalar, &[own, added]));
    }
    inst.operands[3] = match sums[..] {
        [one] => one,
        _ => out.value(parts, at, Op::CompositeConstruct, ty, &sums),
    };
    Ok(())
}

/// Refuses operands of samples that naga reads past or takes for others.
fn sample(constants: &Constants, inst: &mut Inst, at: usize) -> Result<(), Refusal> {
    let mask = ImageOperands::from_bits_retain(inst.operand(at));
    // naga has offsets that are constants; the operand of either kind is the same.
    let mut others = ImageOperands::CONST_OFFSETS | ImageOperands::MIN_LOD;
    let behind = |bits: ImageOperands| {
        (mask & bits).bits().count_ones() as usize + usize::from((mask & bits).contains(ImageOperands::GRAD))
    };
    let before = ImageOperands::BIAS | ImageOperands::LOD | ImageOperands::GRAD;
    if mask.contains(ImageOperands::OFFSET) && !mask.contains(ImageOperands::CONST_OFFSET) {
        let by = inst.operand(at + 1 + behind(before));
        if constants.all.contains(&by) {
            inst.operands[at] = (mask - ImageOperands::OFFSET | ImageOperands::CONST_OFFSET).bits();
        } else {
            others |= ImageOperands::OFFSET;
        }
    }
    if mask.intersects(others) {
        return Err(inst.refuse(format!("image operands {:#x} are not supported", (mask & others).bits())));
    }
    // With a comparison naga takes each level for the first.
    let compares = matches!(inst.op, Op::ImageSampleDrefExplicitLod | Op::ImageSampleProjDrefExplicitLod);
    if compares {
        let is_first = mask.contains(ImageOperands::LOD) && constants.zero.contains(&inst.operand(at + 1));
        if !is_first {
            return Err(inst.refuse("a comparison at a level other than the constant 0 is not supported"));
        }
    }
    if matches!(inst.op, Op::ImageSampleDrefImplicitLod | Op::ImageSampleProjDrefImplicitLod)
        && mask.contains(ImageOperands::BIAS)
    {
        return Err(inst.refuse("a comparison with a bias is not supported"));
    }
    Ok(())
}
