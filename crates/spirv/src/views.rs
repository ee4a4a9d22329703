//! What views and samplers of Vulkan have and native ones do not: views exchange channels, samplers add to the level.

use std::collections::HashMap;

use grammar::{Decoration as D, ImageOperands, Op};

use crate::combined::samples;
use crate::memory::image_operands_at;
use crate::words::{Code, Inst, Parts, Type};
use crate::{Bias, Place, Refusal, SAMPLER_BINDINGS, Swizzle};

/// Function calls within function calls that descriptors are passed through, at most.
const CALLS: usize = 8;

/// Where images and samplers come from.
#[derive(Default)]
struct Origins {
    /// The descriptor of a pointer or of what was loaded; none: one of several.
    places: HashMap<u32, Option<Place>>,
    /// The index, as an id, of an element of an array of descriptors, or of what was loaded from it.
    indices: HashMap<u32, u32>,
    /// The samplers of joined images and samplers.
    samplers: HashMap<u32, u32>,
}

/// What descriptors ask for.
enum Asked<T> {
    /// The same, whichever element is read.
    Same(T),
    /// Something for each of some elements, by an index, which is an id.
    Each(u32, Vec<(u32, T)>),
}

impl Origins {
    fn new(parts: &Parts) -> Origins {
        let decorations = parts.decorations();
        let mut origins = Origins::default();
        for inst in parts.globals.iter().filter(|inst| inst.op == Op::Variable) {
            let value = |kind: D| {
                let all = decorations.get(&inst.operand(1)).into_iter().flatten();
                all.filter(|d| d.member.is_none() && d.kind == kind as u32).map(|d| d.value).next()
            };
            if let Some((set, binding)) = value(D::DescriptorSet).zip(value(D::Binding)) {
                let binding = binding % SAMPLER_BINDINGS;
                origins.places.insert(inst.operand(1), Some(Place { set, binding }));
            }
        }
        let mut parameters: HashMap<u32, Vec<u32>> = HashMap::new();
        for function in &parts.functions {
            let own = function.iter().filter(|inst| inst.op == Op::FunctionParameter).map(|inst| inst.operand(1)).collect();
            parameters.insert(function.first().map_or(0, |first| first.operand(1)), own);
        }
        for _ in 0..CALLS {
            let before = origins.places.clone();
            parts.functions.iter().flatten().for_each(|inst| origins.follow(inst, &parameters));
            if origins.places == before {
                break;
            }
        }
        origins
    }

    fn follow(&mut self, inst: &Inst, parameters: &HashMap<u32, Vec<u32>>) {
        match inst.op {
            Op::AccessChain | Op::InBoundsAccessChain | Op::CopyObject | Op::Load | Op::Image | Op::SampledImage => {
                if let Some(&place) = self.places.get(&inst.operand(2)) {
                    self.places.insert(inst.operand(1), place);
                }
                let index = match inst.op {
                    Op::AccessChain | Op::InBoundsAccessChain => inst.from(3).first().copied(),
                    _ => self.indices.get(&inst.operand(2)).copied(),
                };
                self.indices.extend(index.map(|index| (inst.operand(1), index)));
                let sampler = match inst.op {
                    Op::SampledImage => Some(inst.operand(3)),
                    Op::CopyObject => self.samplers.get(&inst.operand(2)).copied(),
                    _ => None,
                };
                self.samplers.extend(sampler.map(|sampler| (inst.operand(1), sampler)));
            }
            Op::FunctionCall => {
                let own = parameters.get(&inst.operand(2)).into_iter().flatten();
                for (parameter, argument) in own.zip(inst.from(3)) {
                    if let Some(&place) = self.places.get(argument) {
                        let known = self.places.entry(*parameter).or_insert(place);
                        if *known != place {
                            *known = None;
                        }
                    }
                }
            }
            _ => {}
        }
    }

    /// The descriptor of an image or a sampler.
    fn place(&self, id: u32, inst: &Inst) -> Result<Option<Place>, Refusal> {
        match self.places.get(&id) {
            Some(None) => {
                Err(inst.refuse("it reads one of several descriptors, and views exchange channels or samplers add to levels"))
            }
            found => Ok(found.copied().flatten()),
        }
    }

    /// What the descriptor of an image or a sampler asks for, of all that descriptors do; none where it asks for nothing.
    fn asked<T: Copy>(
        &self,
        id: u32,
        inst: &Inst,
        all: &[(Place, Option<u32>, T)],
        constants: &HashMap<u32, u32>,
    ) -> Result<Option<Asked<T>>, Refusal> {
        let Some(place) = self.place(id, inst)? else { return Ok(None) };
        let own = all.iter().filter(|(of, ..)| *of == place);
        let each: Vec<(u32, T)> = own.clone().filter_map(|&(_, element, asked)| Some((element?, asked))).collect();
        if each.is_empty() {
            return Ok(own.map(|&(.., asked)| Asked::Same(asked)).next());
        }
        let Some(&index) = self.indices.get(&id) else {
            return Err(inst.refuse(
                "it reads an element of an array whose views exchange different channels or whose samplers add differently",
            ));
        };
        Ok(match constants.get(&index) {
            Some(element) => each.iter().find(|(of, _)| of == element).map(|&(_, asked)| Asked::Same(asked)),
            None => Some(Asked::Each(index, each)),
        })
    }
}

/// The value of the element that an index selects, or `other` for all elements beside these.
fn select(
    parts: &mut Parts,
    out: &mut Code,
    (at, ty): (u32, u32),
    (index, index_type): (u32, u32),
    each: &[(u32, u32)],
    other: u32,
) -> u32 {
    let boolean = parts.declared(Op::TypeBool, &[]);
    each.iter().fold(other, |other, &(element, value)| {
        let number = parts.constant(index_type, element);
        let equal = out.value(parts, at, Op::IEqual, boolean, &[index, number]);
        out.value(parts, at, Op::Select, ty, &[equal, value, other])
    })
}

/// Rewrites reads of images.
///
/// # Errors
/// If a read has no form with what its view or sampler asks for.
pub fn rewrite(parts: &mut Parts, swizzles: &[Swizzle], biases: &[Bias]) -> Result<(), Refusal> {
    if swizzles.is_empty() && biases.is_empty() {
        return Ok(());
    }
    let origins = Origins::new(parts);
    let swizzles: Vec<_> = swizzles.iter().map(|own| (own.place, own.element, own.channels)).collect();
    let biases: Vec<_> = biases.iter().map(|own| (own.place, own.element, own.bias)).collect();
    let (types, values, constants) = (parts.types(), parts.values(), parts.constants());
    for function in std::mem::take(&mut parts.functions) {
        let mut out = Code::default();
        for mut inst in function {
            let sampled = samples(inst.op);
            if !sampled && inst.op != Op::ImageFetch {
                out.0.push(inst);
                continue;
            }
            if sampled
                && let Some(&sampler) = origins.samplers.get(&inst.operand(2))
                && let Some(asked) = origins.asked(sampler, &inst, &biases, &constants)?
            {
                add_bias(parts, &types, &values, &mut inst, &asked, &mut out)?;
            }
            match origins.asked(inst.operand(2), &inst, &swizzles, &constants)? {
                Some(_) if inst.op == Op::ImageQueryLod => out.0.push(inst),
                Some(Asked::Same(channels)) => swizzle(parts, &types, &constants, inst, channels, &mut out)?,
                Some(Asked::Each(index, each)) => swizzle_each(parts, &types, &values, inst, (index, &each), &mut out)?,
                None => out.0.push(inst),
            }
        }
        parts.functions.push(out.0);
    }
    Ok(())
}

/// Adds to the level that an instruction samples.
fn add_bias(
    parts: &mut Parts,
    types: &HashMap<u32, Type>,
    values: &HashMap<u32, u32>,
    inst: &mut Inst,
    asked: &Asked<f32>,
    out: &mut Code,
) -> Result<(), Refusal> {
    let gathers = matches!(inst.op, Op::ImageGather | Op::ImageDrefGather | Op::ImageQueryLod);
    let Some(at) = image_operands_at(inst.op).filter(|_| !gathers) else { return Ok(()) };
    let float = parts.float_type();
    let word = inst.at;
    // A number that follows from the bias.
    let number = |parts: &mut Parts, out: &mut Code, of: fn(f32) -> f32| match asked {
        Asked::Same(bias) => Ok(parts.constant(float, of(*bias).to_bits())),
        Asked::Each(index, each) => {
            let ids: Vec<_> = each.iter().map(|&(at, bias)| (at, parts.constant(float, of(bias).to_bits()))).collect();
            let none = parts.constant(float, of(0.0).to_bits());
            let index = index_of(*index, values, types, inst)?;
            Ok(select(parts, out, (word, float), index, &ids, none))
        }
    };
    let mask = ImageOperands::from_bits_retain(inst.operand(at));
    let derived = mask.contains(ImageOperands::GRAD) && !mask.intersects(ImageOperands::BIAS | ImageOperands::LOD);
    // A level more is twice the distance.
    let added = number(parts, out, if derived { f32::exp2 } else { |bias| bias })?;
    if inst.operands.len() <= at {
        inst.operands.push(0);
    }
    let short = |inst: &Inst| inst.refuse("it has too few image operands");
    if mask.intersects(ImageOperands::BIAS | ImageOperands::LOD) {
        let Some(&own) = inst.operands.get(at + 1) else { return Err(short(inst)) };
        inst.operands[at + 1] = out.value(parts, word, Op::FAdd, float, &[own, added]);
    } else if derived {
        for place in [at + 1, at + 2] {
            let Some(&own) = inst.operands.get(place) else { return Err(short(inst)) };
            let Some(&ty) = values.get(&own) else { return Err(short(inst)) };
            let op = if matches!(types.get(&ty), Some(Type::Vector { .. })) { Op::VectorTimesScalar } else { Op::FMul };
            inst.operands[place] = out.value(parts, word, op, ty, &[own, added]);
        }
    } else {
        inst.operands[at] = (mask | ImageOperands::BIAS).bits();
        inst.operands.insert(at + 1, added);
    }
    Ok(())
}

/// An index and its type.
fn index_of(index: u32, values: &HashMap<u32, u32>, types: &HashMap<u32, Type>, inst: &Inst) -> Result<(u32, u32), Refusal> {
    match values.get(&index) {
        Some(ty) if matches!(types.get(ty), Some(Type::Int { bits: 32, .. })) => Ok((index, *ty)),
        _ => Err(inst.refuse("an index that is no number of 32 bits, of an array whose views or samplers differ")),
    }
}

/// Reads the channels of an instruction's result as the view of the element that is read has them.
fn swizzle_each(
    parts: &mut Parts,
    types: &HashMap<u32, Type>,
    values: &HashMap<u32, u32>,
    mut inst: Inst,
    (index, each): (u32, &[(u32, [u32; 4])]),
    out: &mut Code,
) -> Result<(), Refusal> {
    let index = index_of(index, values, types, &inst)?;
    let (ty, id, at) = (inst.operand(0), inst.operand(1), inst.at);
    let gathers = matches!(inst.op, Op::ImageGather | Op::ImageDrefGather);
    let of = match types.get(&ty) {
        Some(&Type::Vector { of, count: 4 }) if !gathers => of,
        _ => return Err(inst.refuse("a gather or a comparison with an array of views that exchange different channels")),
    };
    let one = one(types, of, &inst)?;
    let read = parts.fresh();
    inst.operands[1] = read;
    if each.iter().any(|(_, channels)| channels.iter().any(|channel| *channel > 6)) {
        return Err(inst.refuse("a view has no such channel"));
    }
    out.0.push(inst);
    let own: [u32; 4] = std::array::from_fn(|c| out.value(parts, at, Op::CompositeExtract, of, &[read, c as u32]));
    let mut operands = vec![ty, id];
    for c in 0..4 {
        let value = |parts: &mut Parts, channels: &[u32; 4]| match channels[c] {
            0 => own[c],
            1 => parts.constant(of, 0),
            2 => parts.constant(of, one),
            channel => own[channel as usize - 3],
        };
        let values: Vec<(u32, u32)> = each.iter().map(|(element, channels)| (*element, value(parts, channels))).collect();
        operands.push(select(parts, out, (at, of), index, &values, own[c]));
    }
    out.0.push(Inst { at, op: Op::CompositeConstruct, operands });
    Ok(())
}

/// The bits of 1 in a type of channels.
fn one(types: &HashMap<u32, Type>, of: u32, inst: &Inst) -> Result<u32, Refusal> {
    match types.get(&of) {
        Some(Type::Float { bits: 32 }) => Ok(1f32.to_bits()),
        Some(Type::Int { bits: 32, .. }) => Ok(1),
        _ => Err(inst.refuse("texels that are no numbers of 32 bits, of a view that exchanges channels")),
    }
}

/// Reads the channels of an instruction's result as a view has them.
fn swizzle(
    parts: &mut Parts,
    types: &HashMap<u32, Type>,
    constants: &HashMap<u32, u32>,
    mut inst: Inst,
    channels: [u32; 4],
    out: &mut Code,
) -> Result<(), Refusal> {
    let own = |at: usize| if channels[at] == 0 { 3 + at as u32 } else { channels[at] };
    let (ty, id, at) = (inst.operand(0), inst.operand(1), inst.at);
    let Some(&Type::Vector { of, count: 4 }) = types.get(&ty) else {
        if own(0) == 3 {
            out.0.push(inst);
            return Ok(());
        }
        return Err(inst.refuse("a comparison with a view that exchanges its first channel is not supported"));
    };
    let mut wanted: [u32; 4] = std::array::from_fn(own);
    match inst.op {
        Op::ImageDrefGather if wanted[0] == 3 => wanted = [3, 4, 5, 6],
        Op::ImageDrefGather => {
            return Err(inst.refuse("a comparison with a view that exchanges its first channel is not supported"));
        }
        Op::ImageGather => {
            let component = constants.get(&inst.operand(4)).copied().unwrap_or(u32::MAX);
            let Some(&channel) = wanted.get(component as usize) else {
                return Err(inst.refuse("a gather of a channel that is no constant, of a view that exchanges channels"));
            };
            wanted = match channel {
                1 | 2 => [channel; 4],
                channel => {
                    let int = parts.int_type(true);
                    inst.operands[4] = parts.constant(int, channel.saturating_sub(3));
                    [3, 4, 5, 6]
                }
            };
        }
        _ => {}
    }
    if wanted == [3, 4, 5, 6] {
        out.0.push(inst);
        return Ok(());
    }
    let one = one(types, of, &inst)?;
    let read = parts.fresh();
    inst.operands[1] = read;
    out.0.push(inst);
    let mut operands = vec![ty, id];
    for channel in wanted {
        operands.push(match channel {
            1 => parts.constant(of, 0),
            2 => parts.constant(of, one),
            3..=6 => out.value(parts, at, Op::CompositeExtract, of, &[read, channel - 3]),
            other => {
                let inst = Inst { at, op: Op::CompositeConstruct, operands: Vec::new() };
                return Err(inst.refuse(format!("a view has no channel {other}")));
            }
        });
    }
    out.0.push(Inst { at, op: Op::CompositeConstruct, operands });
    Ok(())
}
