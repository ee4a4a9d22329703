//! Texel buffers become storage buffers of words, and each access the conversion of their format.

use std::collections::HashMap;

use grammar::{Decoration as D, Dim, GlslStd450Op, Op, StorageClass};

use crate::formats::{self, Kind, Texel};
use crate::words::{Inst, Parts, Type, glsl};
use crate::{BoundFormat, Place, Refusal};

/// Rewrites all texel buffers, and says which there are.
///
/// # Errors
/// If the format of a buffer is not known, or one is used in a manner that a storage buffer does not have.
pub fn rewrite(parts: &mut Parts, bound: &[BoundFormat]) -> Result<Vec<Place>, Refusal> {
    let is_buffer = |inst: &Inst| inst.op == Op::TypeImage && inst.operand(2) == Dim::DimBuffer as u32;
    let images: HashMap<u32, Inst> =
        parts.globals.iter().filter(|inst| is_buffer(inst)).map(|inst| (inst.operand(0), inst.clone())).collect();
    if images.is_empty() {
        return Ok(Vec::new());
    }
    unwrap(parts, &images);
    let (buffers, places) = describe(parts, &images, bound)?;
    declare(parts, &images);
    let known = Known::new(parts);
    let mut writer = Writer {
        values: parts.values(),
        types: parts.types(),
        parts,
        known,
        images,
        buffers,
        loaded: HashMap::new(),
        out: Vec::new(),
    };
    for function in std::mem::take(&mut writer.parts.functions) {
        for inst in function {
            writer.instruction(inst)?;
        }
        let out = std::mem::take(&mut writer.out);
        writer.parts.functions.push(out);
    }
    Ok(places)
}

/// GLSL's `samplerBuffer` is a sampled image without a sampler: it becomes the image.
fn unwrap(parts: &mut Parts, images: &HashMap<u32, Inst>) {
    let is_wrapped = |inst: &&Inst| inst.op == Op::TypeSampledImage && images.contains_key(&inst.operand(1));
    let wrapped: HashMap<u32, u32> =
        parts.globals.iter().filter(is_wrapped).map(|inst| (inst.operand(0), inst.operand(1))).collect();
    parts.globals.retain(|inst| !(inst.op == Op::TypeSampledImage && wrapped.contains_key(&inst.operand(0))));
    let values = parts.values();
    for inst in parts.insts_mut() {
        let at = match inst.op {
            Op::TypeArray | Op::TypeRuntimeArray => 1,
            Op::TypePointer => 2,
            Op::Load | Op::CopyObject => 0,
            Op::Image => {
                if values.get(&inst.operand(2)).is_some_and(|ty| wrapped.contains_key(ty)) {
                    inst.op = Op::CopyObject;
                }
                continue;
            }
            _ => continue,
        };
        if let Some(&image) = wrapped.get(&inst.operand(at)) {
            inst.operands[at] = image;
        }
    }
}

/// The variables of texel buffers, which move to another storage class, and their places.
fn describe(
    parts: &mut Parts,
    images: &HashMap<u32, Inst>,
    bound: &[BoundFormat],
) -> Result<(HashMap<u32, Texel>, Vec<Place>), Refusal> {
    let decorations = parts.decorations();
    // The image that a type leads to.
    let mut holders: HashMap<u32, u32> = images.keys().map(|&id| (id, id)).collect();
    let mut buffers = HashMap::new();
    let (mut places, mut read_only) = (Vec::new(), Vec::new());
    for inst in &mut parts.globals {
        if let Some((id, ty)) = Parts::type_of(inst) {
            let of = match ty {
                Type::Array { of, .. } | Type::RuntimeArray { of } => of,
                Type::Pointer { to, .. } => {
                    if holders.contains_key(&to) {
                        inst.operands[1] = StorageClass::StorageBuffer as u32;
                    }
                    to
                }
                _ => continue,
            };
            if let Some(&image) = holders.get(&of) {
                holders.insert(id, image);
            }
            continue;
        }
        let Some(image) = holders.get(&inst.operand(0)).filter(|_| inst.op == Op::Variable).map(|id| &images[id]) else {
            continue;
        };
        let id = inst.operand(1);
        let value = |kind: D| {
            let all = decorations.get(&id).into_iter().flatten();
            all.filter(|d| d.member.is_none() && d.kind == kind as u32).map(|d| d.value).next()
        };
        let Some((set, binding)) = value(D::DescriptorSet).zip(value(D::Binding)) else {
            return Err(inst.refuse("a texel buffer has a set and a binding"));
        };
        let given = bound.iter().find(|bound| (bound.set, bound.binding) == (set, binding));
        let texel = match given {
            Some(given) => formats::texel(given.format).ok_or_else(|| {
                inst.refuse(format!(
                    "the texel buffer of set {set}, binding {binding} has format {}, which is not supported",
                    given.format
                ))
            })?,
            None => formats::texel_of_image(image.operand(7)).ok_or_else(|| {
                inst.refuse(format!("the format of the texel buffer of set {set}, binding {binding} is not known"))
            })?,
        };
        inst.operands[2] = StorageClass::StorageBuffer as u32;
        places.push(Place { set, binding });
        buffers.insert(id, texel);
        if image.operand(6) == 1 {
            read_only.push(Inst { at: inst.at, op: Op::Decorate, operands: vec![id, D::NonWritable as u32] });
        }
    }
    let at = parts.first_type();
    parts.globals.splice(at..at, read_only);
    places.sort_unstable();
    places.dedup();
    Ok((buffers, places))
}

/// Makes blocks of words of the types of images.
fn declare(parts: &mut Parts, images: &HashMap<u32, Inst>) {
    let unsigned = parts.hoist(Op::TypeInt, &[32, 0]);
    let array = parts.fresh();
    let mut decorated = vec![(Op::Decorate, vec![array, D::ArrayStride as u32, 4])];
    let mut out = Vec::with_capacity(parts.globals.len() + 1);
    let mut is_first = true;
    for mut inst in std::mem::take(&mut parts.globals) {
        if inst.op == Op::TypeImage && images.contains_key(&inst.operand(0)) {
            if std::mem::take(&mut is_first) {
                out.push(Inst { at: inst.at, op: Op::TypeRuntimeArray, operands: vec![array, unsigned] });
            }
            let id = inst.operand(0);
            inst.op = Op::TypeStruct;
            inst.operands = vec![id, array];
            decorated.push((Op::Decorate, vec![id, D::Block as u32]));
            decorated.push((Op::MemberDecorate, vec![id, 0, D::Offset as u32, 0]));
        }
        out.push(inst);
    }
    parts.globals = out;
    let at = parts.first_type();
    let word = parts.globals.get(at).map_or(5, |inst| inst.at);
    parts.globals.splice(at..at, decorated.into_iter().map(|(op, operands)| Inst { at: word, op, operands }));
}

/// Types and constants that accesses need.
struct Known {
    unsigned: u32,
    signed: u32,
    float: u32,
    boolean: u32,
    pair: u32,
    quad: u32,
    pointer: u32,
    glsl: u32,
}

impl Known {
    fn new(parts: &mut Parts) -> Known {
        let (unsigned, signed, float) = (parts.int_type(false), parts.int_type(true), parts.float_type());
        Known {
            unsigned,
            signed,
            float,
            boolean: parts.declared(Op::TypeBool, &[]),
            pair: parts.vector_type(float, 2),
            quad: parts.vector_type(float, 4),
            pointer: parts.pointer_type(StorageClass::StorageBuffer, unsigned),
            glsl: glsl(parts),
        }
    }
}

struct Writer<'p> {
    parts: &'p mut Parts,
    known: Known,
    values: HashMap<u32, u32>,
    types: HashMap<u32, Type>,
    images: HashMap<u32, Inst>,
    /// The texels of buffers, by pointers to them.
    buffers: HashMap<u32, Texel>,
    /// Texel buffers that were loaded: the pointers to them.
    loaded: HashMap<u32, u32>,
    out: Vec<Inst>,
}

impl Writer<'_> {
    fn instruction(&mut self, inst: Inst) -> Result<(), Refusal> {
        match inst.op {
            Op::AccessChain | Op::InBoundsAccessChain | Op::CopyObject => {
                if let Some(&buffer) = self.buffers.get(&inst.operand(2)) {
                    self.buffers.insert(inst.operand(1), buffer);
                }
                if let Some(&pointer) = self.loaded.get(&inst.operand(2)) {
                    self.loaded.insert(inst.operand(1), pointer);
                    return Ok(());
                }
            }
            Op::Load if self.images.contains_key(&inst.operand(0)) => {
                self.loaded.insert(inst.operand(1), inst.operand(2));
                return Ok(());
            }
            Op::ImageFetch | Op::ImageRead => {
                if let Some((pointer, texel)) = self.buffer(&inst, 2)? {
                    return self.read(&inst, pointer, texel);
                }
            }
            Op::ImageWrite => {
                if let Some((pointer, texel)) = self.buffer(&inst, 0)? {
                    return self.write(&inst, pointer, texel);
                }
            }
            Op::ImageQuerySize => {
                if let Some((pointer, texel)) = self.buffer(&inst, 2)? {
                    return self.size(&inst, pointer, texel);
                }
            }
            _ => {}
        }
        self.out.push(inst);
        Ok(())
    }

    /// The pointer behind an operand that is a texel buffer, and the buffer's texels.
    fn buffer(&self, inst: &Inst, operand: usize) -> Result<Option<(u32, Texel)>, Refusal> {
        let Some(&pointer) = self.loaded.get(&inst.operand(operand)) else { return Ok(None) };
        match self.buffers.get(&pointer) {
            Some(&texel) => Ok(Some((pointer, texel))),
            None => Err(inst.refuse("a texel buffer is a parameter of a function, whose format is not known")),
        }
    }

    fn value(&mut self, at: u32, op: Op, ty: u32, operands: &[u32]) -> u32 {
        let id = self.parts.fresh();
        self.result(at, op, ty, id, operands);
        id
    }

    fn result(&mut self, at: u32, op: Op, ty: u32, id: u32, operands: &[u32]) {
        self.out.push(Inst { at, op, operands: [ty, id].iter().chain(operands).copied().collect() });
    }

    fn unsigned(&mut self, value: u32) -> u32 {
        self.parts.constant(self.known.unsigned, value)
    }

    fn float(&mut self, value: f32) -> u32 {
        self.parts.constant(self.known.float, value.to_bits())
    }

    /// A value of 32 bits as one of another type.
    fn cast(&mut self, at: u32, value: u32, from: u32, to: u32) -> u32 {
        if from == to { value } else { self.value(at, Op::Bitcast, to, &[value]) }
    }

    /// The number of a texel.
    fn index(&mut self, inst: &Inst, operand: usize) -> Result<u32, Refusal> {
        let id = inst.operand(operand);
        match self.values.get(&id).map(|ty| (*ty, self.types.get(ty))) {
            Some((ty, Some(Type::Int { bits: 32, .. }))) => Ok(self.cast(inst.at, id, ty, self.known.unsigned)),
            _ => Err(inst.refuse("the number of a texel is no number of 32 bits")),
        }
    }

    /// A pointer to a word of a buffer.
    fn word(&mut self, at: u32, buffer: u32, index: u32) -> u32 {
        let zero = self.unsigned(0);
        self.value(at, Op::AccessChain, self.known.pointer, &[buffer, zero, index])
    }

    /// Words of a texel of whole words: a number and the words after it.
    fn nth(&mut self, at: u32, index: u32, words: u32, word: u32) -> u32 {
        let unsigned = self.known.unsigned;
        let mut number = index;
        if words > 1 {
            let by = self.unsigned(words);
            number = self.value(at, Op::IMul, unsigned, &[number, by]);
        }
        if word > 0 {
            let by = self.unsigned(word);
            number = self.value(at, Op::IAdd, unsigned, &[number, by]);
        }
        number
    }

    /// The type of components and their number of the value of a read or write.
    fn shape(&self, ty: u32) -> Option<(u32, u32)> {
        match self.types.get(&ty)? {
            &Type::Vector { of, count: count @ 2..=4 } => Some((of, count)),
            Type::Int { bits: 32, .. } | Type::Float { bits: 32 } => Some((ty, 1)),
            _ => None,
        }
    }

    fn read(&mut self, inst: &Inst, pointer: u32, texel: Texel) -> Result<(), Refusal> {
        let (at, unsigned) = (inst.at, self.known.unsigned);
        let wrong = || inst.refuse("the value of a texel has another type than the format");
        let (of, count) = self.shape(inst.operand(0)).ok_or_else(wrong)?;
        let is_float = matches!(self.types.get(&of), Some(Type::Float { bits: 32 }));
        let is_int = matches!(self.types.get(&of), Some(Type::Int { bits: 32, .. }));
        if is_float == matches!(texel.kind, Kind::Uint | Kind::Sint) || !(is_float || is_int) {
            return Err(wrong());
        }
        let index = self.index(inst, 3)?;
        let bytes = texel.bytes();
        let mut words = Vec::new();
        if bytes < 4 {
            // Several texels in a word.
            let in_word = 4 / bytes;
            let (by, mask, bits) = (self.unsigned(in_word.ilog2()), self.unsigned(in_word - 1), self.unsigned(bytes * 8));
            let number = self.value(at, Op::ShiftRightLogical, unsigned, &[index, by]);
            let word = self.word(at, pointer, number);
            let word = self.value(at, Op::Load, unsigned, &[word]);
            let texel = self.value(at, Op::BitwiseAnd, unsigned, &[index, mask]);
            let shift = self.value(at, Op::IMul, unsigned, &[texel, bits]);
            words.push(self.value(at, Op::ShiftRightLogical, unsigned, &[word, shift]));
        } else {
            for word in 0..bytes / 4 {
                let number = self.nth(at, index, bytes / 4, word);
                let word = self.word(at, pointer, number);
                words.push(self.value(at, Op::Load, unsigned, &[word]));
            }
        }
        let mut components = Vec::new();
        for component in 0..count {
            components.push(if component < texel.components {
                let (offset, bits) = texel.place(component);
                self.component(at, texel.kind, words[(offset / 32) as usize], offset % 32, bits, of)
            } else {
                let one = if is_float { 1f32.to_bits() } else { 1 };
                self.parts.constant(of, if component == 3 { one } else { 0 })
            });
        }
        let (ty, id) = (inst.operand(0), inst.operand(1));
        match components[..] {
            [one] => self.result(at, Op::CopyObject, ty, id, &[one]),
            _ => self.result(at, Op::CompositeConstruct, ty, id, &components),
        }
        Ok(())
    }

    /// A component of a texel, from bits of a word.
    fn component(&mut self, at: u32, kind: Kind, word: u32, offset: u32, bits: u32, of: u32) -> u32 {
        let (unsigned, signed, float) = (self.known.unsigned, self.known.signed, self.known.float);
        let mut whole = |is_signed: bool| {
            let ty = if is_signed { signed } else { unsigned };
            let word = self.cast(at, word, unsigned, ty);
            if bits == 32 {
                return word;
            }
            let (offset, count) = (self.unsigned(offset), self.unsigned(bits));
            let op = if is_signed { Op::BitFieldSExtract } else { Op::BitFieldUExtract };
            self.value(at, op, ty, &[word, offset, count])
        };
        match kind {
            Kind::Uint => {
                let number = whole(false);
                self.cast(at, number, unsigned, of)
            }
            Kind::Sint => {
                let number = whole(true);
                self.cast(at, number, signed, of)
            }
            Kind::Unorm => {
                let number = whole(false);
                let number = self.value(at, Op::ConvertUToF, float, &[number]);
                let most = self.float(((1u64 << bits) - 1) as f32);
                self.value(at, Op::FDiv, float, &[number, most])
            }
            Kind::Snorm => {
                let number = whole(true);
                let number = self.value(at, Op::ConvertSToF, float, &[number]);
                let (most, least) = (self.float(((1u64 << (bits - 1)) - 1) as f32), self.float(-1.0));
                let number = self.value(at, Op::FDiv, float, &[number, most]);
                // The least number stands for -1, too.
                let is_less = self.value(at, Op::FOrdLessThan, self.known.boolean, &[number, least]);
                self.value(at, Op::Select, float, &[is_less, least, number])
            }
            Kind::Float if bits == 32 => self.value(at, Op::Bitcast, float, &[word]),
            Kind::Float => {
                let half = whole(false);
                let pair =
                    self.value(at, Op::ExtInst, self.known.pair, &[self.known.glsl, GlslStd450Op::UnpackHalf2x16 as u32, half]);
                self.value(at, Op::CompositeExtract, float, &[pair, 0])
            }
        }
    }

    fn write(&mut self, inst: &Inst, pointer: u32, texel: Texel) -> Result<(), Refusal> {
        let at = inst.at;
        let wrong = || inst.refuse("the value of a texel has another type than the format");
        let value = inst.operand(2);
        let (of, count) = self.values.get(&value).and_then(|ty| self.shape(*ty)).ok_or_else(wrong)?;
        let is_float = matches!(self.types.get(&of), Some(Type::Float { bits: 32 }));
        if is_float == matches!(texel.kind, Kind::Uint | Kind::Sint) {
            return Err(wrong());
        }
        if texel.bytes() < 4 || texel.is_packed() || texel.bgra {
            return Err(inst.refuse("a write to a texel buffer of this format is not supported: its texels are no whole words"));
        }
        if count < texel.components {
            return Err(inst.refuse("the value of a texel has fewer components than the format"));
        }
        let index = self.index(inst, 1)?;
        let components: Vec<u32> = match count {
            1 => vec![value],
            _ => (0..texel.components).map(|n| self.value(at, Op::CompositeExtract, of, &[value, n])).collect(),
        };
        let in_word = (32 / texel.bits) as usize;
        for (number, all) in (0..).zip(components.chunks(in_word)) {
            let word = self.pack(at, texel, of, all);
            let number = self.nth(at, index, texel.bytes() / 4, number);
            let place = self.word(at, pointer, number);
            self.out.push(Inst { at, op: Op::Store, operands: vec![place, word] });
        }
        Ok(())
    }

    /// A word of components.
    fn pack(&mut self, at: u32, texel: Texel, of: u32, all: &[u32]) -> u32 {
        let unsigned = self.known.unsigned;
        if texel.bits == 32 {
            return self.cast(at, all[0], of, unsigned);
        }
        let packed = match (texel.kind, texel.bits) {
            (Kind::Float, _) => Some(GlslStd450Op::PackHalf2x16),
            (Kind::Unorm, 8) => Some(GlslStd450Op::PackUnorm4x8),
            (Kind::Unorm, _) => Some(GlslStd450Op::PackUnorm2x16),
            (Kind::Snorm, 8) => Some(GlslStd450Op::PackSnorm4x8),
            (Kind::Snorm, _) => Some(GlslStd450Op::PackSnorm2x16),
            (Kind::Uint | Kind::Sint, _) => None,
        };
        if let Some(op) = packed {
            let ty = if texel.bits == 8 { self.known.quad } else { self.known.pair };
            let vector = self.value(at, Op::CompositeConstruct, ty, all);
            return self.value(at, Op::ExtInst, unsigned, &[self.known.glsl, op as u32, vector]);
        }
        let mut word = self.unsigned(0);
        for (n, &component) in (0..).zip(all) {
            let component = self.cast(at, component, of, unsigned);
            let (offset, bits) = (self.unsigned(n * texel.bits), self.unsigned(texel.bits));
            word = self.value(at, Op::BitFieldInsert, unsigned, &[word, component, offset, bits]);
        }
        word
    }

    /// The number of texels.
    fn size(&mut self, inst: &Inst, pointer: u32, texel: Texel) -> Result<(), Refusal> {
        let (at, unsigned) = (inst.at, self.known.unsigned);
        let (ty, id) = (inst.operand(0), inst.operand(1));
        if !matches!(self.types.get(&ty), Some(Type::Int { bits: 32, .. })) {
            return Err(inst.refuse("the number of texels is no number of 32 bits"));
        }
        let words = self.value(at, Op::ArrayLength, unsigned, &[pointer, 0]);
        let bytes = texel.bytes();
        let (op, by) = if bytes < 4 { (Op::IMul, 4 / bytes) } else { (Op::UDiv, bytes / 4) };
        let by = self.unsigned(by);
        let texels = self.value(at, op, unsigned, &[words, by]);
        self.result(at, if ty == unsigned { Op::CopyObject } else { Op::Bitcast }, ty, id, &[texels]);
        Ok(())
    }
}
