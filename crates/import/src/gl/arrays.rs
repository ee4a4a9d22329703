//! Client arrays, generic attributes and vertex array objects.

use std::rc::Rc;

use num::NumberMap;

use super::arb::{GENERICS, Stage};
use super::call::{Arg, Call, Fault, INVALID_ENUM, INVALID_OPERATION, INVALID_VALUE, Outcome, Scalar, Shape};
use super::components::{Element, scalar};
use super::consts as e;
use super::contexts::{lose, missing};
use super::elements::{Selection, Selector};
use super::machine::Gl;
use super::names;
use super::primitive::{Elements, Sent};
use super::restart::{RESTART_CLIENT, Restart};
use super::state::{UNITS, Vertex};

/// Slots of arrays: position, normal, colour, secondary colour, fog coordinate, edge flag, texture coordinates from 8 on, generic attributes
/// from 16 on. The bits are those of [`Vertex::over`].
const SLOTS: usize = GENERIC + GENERICS;
/// The slot of the first generic attribute.
pub const GENERIC: usize = 8 + UNITS;

/// Where the elements of an array are.
#[derive(Clone, Debug, Default)]
enum Source {
    /// No memory.
    #[default]
    None,
    /// In the client's memory, as the recorder saw it.
    Memory(Rc<[u8]>),
    /// In a buffer object, from this byte on.
    Buffer(u32, u64),
}

/// One array.
#[derive(Clone, Debug, Default)]
struct Array {
    enabled: bool,
    size: usize,
    kind: u32,
    stride: usize,
    source: Source,
    /// Integers of a generic attribute are normalised.
    normalized: bool,
    /// Blue comes first (`GL_BGRA`).
    blue_first: bool,
    /// This number of instances share an element; 0: each vertex has its own.
    divisor: u32,
    /// Whether shaders get its integers as such.
    whole: bool,
}

/// All client arrays.
#[derive(Clone, Debug, Default)]
pub struct Arrays {
    slots: [Array; SLOTS],
    /// The active client texture unit.
    pub active: usize,
    /// Indices that end primitives.
    pub restart: Restart,
    /// The bound buffers: of arrays, of indices.
    pub bound: [u32; 2],
    /// The bound vertex array object; 0: the default one.
    object: u32,
    /// The state of the others: slots and the buffer of indices.
    objects: NumberMap<u32, (Box<[Array; SLOTS]>, u32)>,
}

/// The slot of a client state.
pub(super) fn slot(gl: &Gl, array: u32) -> Outcome<usize> {
    Ok(match array {
        e::VERTEX_ARRAY => 0,
        e::NORMAL_ARRAY => 1,
        e::COLOR_ARRAY => 2,
        e::SECONDARY_COLOR_ARRAY => 3,
        e::FOG_COORD_ARRAY => 4,
        e::EDGE_FLAG_ARRAY => 5,
        e::INDEX_ARRAY => 6,
        e::TEXTURE_COORD_ARRAY => 8 + gl.arrays.active,
        _ => return Err(INVALID_ENUM),
    })
}

impl Arrays {
    /// Number of vertex array objects that are not bound.
    pub(super) fn objects(&self) -> usize {
        self.objects.len()
    }

    /// Gives a buffer object another name in the vertex array objects that are not bound; returns whether one of them has it.
    pub(super) fn rename(&mut self, from: u32, to: u32) -> bool {
        let mut found = false;
        for (slots, indices) in self.objects.values_mut() {
            let arrays = slots
                .iter_mut()
                .filter_map(|array| if let Source::Buffer(name, _) = &mut array.source { Some(name) } else { None });
            for name in arrays.chain([indices]).filter(|name| **name == from) {
                (*name, found) = (to, true);
            }
        }
        found
    }

    /// Enables or disables an array.
    pub(super) fn switch(&mut self, slot: usize, enabled: bool) {
        self.slots[slot].enabled = enabled;
    }

    /// Marks bindings to a buffer object that another context deletes.
    pub(super) fn lose_buffer(&mut self, name: u32) {
        let objects = self.objects.values_mut().map(|(slots, indices)| (&mut **slots, indices));
        let [_, indices] = &mut self.bound;
        for (slots, indices) in objects.chain([(&mut self.slots, indices)]) {
            let names = slots.iter_mut().filter_map(|array| match &mut array.source {
                Source::Buffer(name, _) => Some(name),
                _ => None,
            });
            lose(names.chain([indices]), name);
        }
        lose(&mut self.bound[..1], name);
    }
}

fn set_enabled(gl: &mut Gl, array: u32, enabled: bool) -> Outcome {
    if array == RESTART_CLIENT && gl.arrays.restart.switch(array, enabled) {
        return Ok(());
    }
    let slot = slot(gl, array)?;
    gl.arrays.switch(slot, enabled);
    Ok(())
}

pub(super) fn enable(gl: &mut Gl, call: &Call, _: Shape) -> Outcome {
    set_enabled(gl, call.u32(0)?, true)
}

pub(super) fn disable(gl: &mut Gl, call: &Call, _: Shape) -> Outcome {
    set_enabled(gl, call.u32(0)?, false)
}

pub(super) fn client_active(gl: &mut Gl, call: &Call, _: Shape) -> Outcome {
    let unit = call.unit(0)?;
    gl.arrays.active = unit;
    Ok(())
}

/// The size of an array whose elements are colours with blue first.
const BLUE_FIRST: usize = e::BGRA as usize;

/// The argument that is the size of an array's elements: at least this, or `GL_BGRA` where colours can have it. Packed elements have four
/// components.
fn size_of(call: &Call, argument: usize, kind: u32, least: usize, colors: bool) -> Outcome<usize> {
    let size = call.size(argument)? as usize;
    let scalar = scalar(kind).map(|(scalar, _)| scalar);
    let packed = matches!(scalar, Some(Scalar::Packed | Scalar::PackedSigned));
    match size {
        BLUE_FIRST if !colors => Err(INVALID_VALUE),
        BLUE_FIRST if !packed && scalar != Some(Scalar::Ubyte) => Err(INVALID_OPERATION),
        BLUE_FIRST => Ok(size),
        _ if !(least..=4).contains(&size) => Err(INVALID_VALUE),
        _ if packed && size != 4 => Err(INVALID_OPERATION),
        _ => Ok(size),
    }
}

fn point(gl: &mut Gl, slot: usize, size: usize, kind: u32, stride: i32, data: &Arg) -> Outcome {
    let stride = usize::try_from(stride).map_err(|_| INVALID_VALUE)?;
    let source = match data {
        Arg::Blob(bytes) => Source::Memory(bytes.clone()),
        Arg::Pointer(at) if gl.arrays.bound[0] != 0 => Source::Buffer(gl.arrays.bound[0], *at),
        Arg::Num(at) if gl.arrays.bound[0] != 0 => Source::Buffer(gl.arrays.bound[0], *at as u64),
        Arg::Null if gl.arrays.bound[0] != 0 => Source::Buffer(gl.arrays.bound[0], 0),
        // The recorder gives the contents right before the draw.
        _ => Source::None,
    };
    let Array { enabled, divisor, .. } = gl.arrays.slots[slot];
    let (size, blue_first) = if size == BLUE_FIRST { (4, true) } else { (size, false) };
    gl.arrays.slots[slot] = Array { enabled, size, kind, stride, source, normalized: false, blue_first, divisor, whole: false };
    Ok(())
}

macro_rules! sized {
    ($($name:ident $slot:expr, $least:literal, $colors:literal;)+) => { $(
        pub(super) fn $name(gl: &mut Gl, call: &Call, _: Shape) -> Outcome {
            let kind = call.u32(1)?;
            let size = size_of(call, 0, kind, $least, $colors)?;
            let slot: fn(&Gl) -> usize = $slot;
            point(gl, slot(gl), size, kind, call.i32(2)?, call.arg(3))
        }
    )+ };
}

sized! {
    vertex_pointer |_| 0, 2, false;
    color_pointer |_| 2, 3, true;
    secondary_pointer |_| 3, 3, true;
    texture_pointer |gl| 8 + gl.arrays.active, 1, false;
}

pub(super) fn normal_pointer(gl: &mut Gl, call: &Call, _: Shape) -> Outcome {
    point(gl, 1, 3, call.u32(0)?, call.i32(1)?, call.arg(2))
}

pub(super) fn fog_pointer(gl: &mut Gl, call: &Call, _: Shape) -> Outcome {
    point(gl, 4, 1, call.u32(0)?, call.i32(1)?, call.arg(2))
}

pub(super) fn edge_pointer(gl: &mut Gl, call: &Call, _: Shape) -> Outcome {
    point(gl, 5, 1, e::UNSIGNED_BYTE, call.i32(0)?, call.arg(1))
}

/// An array of an interleaved format: its number of components, and their offset.
type Part = Option<(usize, usize)>;

/// An interleaved format: the arrays of texture coordinates, colours, normals and positions, and the bytes of a vertex.
struct Interleaving(u32, [Part; 4], usize);

/// OpenGL 1.5, table 2.5.
const INTERLEAVINGS: [Interleaving; 14] = [
    Interleaving(e::V2F, [None, None, None, Some((2, 0))], 8),
    Interleaving(e::V3F, [None, None, None, Some((3, 0))], 12),
    Interleaving(e::C4UB_V2F, [None, Some((4, 0)), None, Some((2, 4))], 12),
    Interleaving(e::C4UB_V3F, [None, Some((4, 0)), None, Some((3, 4))], 16),
    Interleaving(e::C3F_V3F, [None, Some((3, 0)), None, Some((3, 12))], 24),
    Interleaving(e::N3F_V3F, [None, None, Some((3, 0)), Some((3, 12))], 24),
    Interleaving(e::C4F_N3F_V3F, [None, Some((4, 0)), Some((3, 16)), Some((3, 28))], 40),
    Interleaving(e::T2F_V3F, [Some((2, 0)), None, None, Some((3, 8))], 20),
    Interleaving(e::T4F_V4F, [Some((4, 0)), None, None, Some((4, 16))], 32),
    Interleaving(e::T2F_C4UB_V3F, [Some((2, 0)), Some((4, 8)), None, Some((3, 12))], 24),
    Interleaving(e::T2F_C3F_V3F, [Some((2, 0)), Some((3, 8)), None, Some((3, 20))], 32),
    Interleaving(e::T2F_N3F_V3F, [Some((2, 0)), None, Some((3, 8)), Some((3, 20))], 32),
    Interleaving(e::T2F_C4F_N3F_V3F, [Some((2, 0)), Some((4, 8)), Some((3, 24)), Some((3, 36))], 48),
    Interleaving(e::T4F_C4F_N3F_V4F, [Some((4, 0)), Some((4, 16)), Some((3, 32)), Some((4, 44))], 60),
];

/// `glInterleavedArrays(format, stride, pointer)`: enables the arrays of the format and disables the others.
pub(super) fn interleaved(gl: &mut Gl, call: &Call, _: Shape) -> Outcome {
    let format = call.u32(0)?;
    let Interleaving(_, parts, vertex) = INTERLEAVINGS.iter().find(|known| known.0 == format).ok_or(INVALID_ENUM)?;
    let stride = match call.i32(1)? {
        0 => *vertex as i32,
        stride => stride,
    };
    let bytes = [e::C4UB_V2F, e::C4UB_V3F, e::T2F_C4UB_V3F].contains(&format);
    let data = call.arg(2);
    for (slot, part) in [8 + gl.arrays.active, 2, 1, 0].into_iter().zip(*parts) {
        let kind = if slot == 2 && bytes { e::UNSIGNED_BYTE } else { e::FLOAT };
        if let Some((size, at)) = part {
            let data = match data {
                Arg::Blob(bytes) => Arg::Blob(bytes.get(at..).unwrap_or_default().into()),
                Arg::Pointer(start) => Arg::Pointer(start.saturating_add(at as u64)),
                Arg::Num(start) => Arg::Num(start + at as f64),
                Arg::Null if gl.arrays.bound[0] != 0 => Arg::Pointer(at as u64),
                other => other.clone(),
            };
            point(gl, slot, size, kind, stride, &data)?;
        }
        gl.arrays.slots[slot].enabled = part.is_some();
    }
    // The arrays of secondary colours, fog coordinates and generic attributes are unchanged.
    for slot in [5, 6] {
        gl.arrays.slots[slot].enabled = false;
    }
    Ok(())
}

fn generic_slot(call: &Call) -> Outcome<usize> {
    let index = call.u32(0)? as usize;
    if index < GENERICS { Ok(GENERIC + index) } else { Err(INVALID_VALUE) }
}

pub(super) fn enable_generic(gl: &mut Gl, call: &Call, _: Shape) -> Outcome {
    gl.arrays.slots[generic_slot(call)?].enabled = true;
    Ok(())
}

pub(super) fn disable_generic(gl: &mut Gl, call: &Call, _: Shape) -> Outcome {
    gl.arrays.slots[generic_slot(call)?].enabled = false;
    Ok(())
}

/// `glVertexAttribPointer(index, size, type, normalized, stride, pointer)`
pub(super) fn generic_pointer(gl: &mut Gl, call: &Call, _: Shape) -> Outcome {
    let (slot, kind, normalized) = (generic_slot(call)?, call.u32(2)?, call.bool(3)?);
    let size = size_of(call, 1, kind, 1, true)?;
    if size == BLUE_FIRST && !normalized {
        return Err(INVALID_OPERATION);
    }
    point(gl, slot, size, kind, call.i32(4)?, call.arg(5))?;
    gl.arrays.slots[slot].normalized = normalized;
    Ok(())
}

/// `glVertexAttribIPointer(index, size, type, stride, pointer)`
pub(super) fn whole_pointer(gl: &mut Gl, call: &Call, _: Shape) -> Outcome {
    let (slot, kind) = (generic_slot(call)?, call.u32(2)?);
    let size = size_of(call, 1, kind, 1, false)?;
    point(gl, slot, size, kind, call.i32(3)?, call.arg(4))?;
    gl.arrays.slots[slot].whole = true;
    Ok(())
}

/// Data beyond the end of a buffer object, as wide as the widest element.
const ZEROS: [u8; 32] = [0; 32];

/// `glVertexAttribDivisor(index, divisor)`
pub(super) fn divisor(gl: &mut Gl, call: &Call, _: Shape) -> Outcome {
    let slot = generic_slot(call)?;
    gl.arrays.slots[slot].divisor = call.u32(1)?;
    Ok(())
}

/// An enabled array that is ready to be read.
pub struct Ready {
    /// Its slot.
    pub slot: usize,
    /// Its elements.
    pub element: Element,
    /// Whether integers of a generic attribute are normalised.
    pub normalized: bool,
    /// Bytes from one element to the next.
    pub stride: usize,
    /// Where the first element is, in bytes.
    pub start: usize,
    /// The bytes.
    pub data: Rc<[u8]>,
    /// The buffer object that it is in. Arrays in memory were recorded for their draw, so that all elements must be present.
    pub buffer: Option<u32>,
    /// The element for all vertices, if the array has one for each instance.
    pub instance: Option<u32>,
}

impl Gl {
    /// Enabled arrays, and a bit for each.
    fn ready(&self) -> Outcome<(Vec<Ready>, u32)> {
        let mut ready = Vec::new();
        let mut bits = 0;
        for (slot, array) in self.arrays.slots.iter().enumerate().filter(|(slot, array)| array.enabled && *slot != 6) {
            let refused = || Fault::Unsupported(format!("vertex arrays of type {}", names::name(array.kind)));
            if array.whole {
                return Err(Fault::Unsupported("vertex arrays of whole numbers (glVertexAttribIPointer)".into()));
            }
            let (scalar, _) = scalar(array.kind).ok_or_else(refused)?;
            let element = Element { scalar, size: array.size, blue_first: array.blue_first };
            let (data, start, buffer) = match &array.source {
                Source::None => return Err(Fault::Damaged("an enabled array has no contents".into())),
                Source::Memory(bytes) => (bytes.clone(), 0, None),
                Source::Buffer(name, at) => {
                    let object = self.buffers.get(*name).ok_or_else(|| missing(*name, INVALID_OPERATION))?;
                    (object.bytes()?.clone(), *at as usize, Some(*name))
                }
            };
            let stride = if array.stride == 0 { element.bytes() } else { array.stride };
            let normalized = array.normalized;
            let instance = array.divisor.checked_sub(1).map(|_| self.instance / array.divisor);
            ready.push(Ready { slot, element, normalized, stride, start, data, buffer, instance });
            bits |= 1 << slot;
        }
        Ok((ready, bits))
    }

    /// The vertex of an index.
    pub fn fetch(&self, ready: &[Ready], index: u32) -> Outcome<Vertex> {
        let mut vertex = self.state.current.clone();
        for array in ready {
            let index = array.instance.unwrap_or(index);
            let at = (index as usize).saturating_mul(array.stride).saturating_add(array.start);
            let element = match array.data.get(at..at.saturating_add(array.element.bytes())) {
                Some(element) => element,
                // Some programs read beyond the end of their buffer objects; Mesa returns zeros.
                None if array.buffer.is_some() => &ZEROS[..array.element.bytes()],
                None if array.instance.is_some() => {
                    return Err(Fault::Unsupported(
                        "elements of instances in memory, of which the recorder gives too few".into(),
                    ));
                }
                None => {
                    return Err(Fault::Damaged(format!("vertex {index} is outside of an array's {} bytes", array.data.len())));
                }
            };
            let (plain, normalized) = array.element.components(element);
            match array.slot {
                0 => vertex.position = plain,
                1 => vertex.normal = [normalized[0], normalized[1], normalized[2]],
                2 => vertex.color = normalized,
                3 => vertex.secondary = [normalized[0], normalized[1], normalized[2]],
                4 => vertex.fog = plain[0],
                5 => vertex.edge = plain[0] != 0.0,
                GENERIC => vertex.position = if array.normalized { normalized } else { plain },
                slot if slot > GENERIC => vertex.set_generic(slot - GENERIC, if array.normalized { normalized } else { plain }),
                slot => vertex.set_texture(slot - 8, plain),
            }
        }
        Ok(vertex)
    }

    /// Sets the attributes of an element's arrays, and sends a vertex if positions are among them.
    pub fn send_element(&mut self, vertex: &Vertex, bits: u32) {
        let current = vertex.over(&self.state.current, bits);
        if let (Some((_, vertices)), true) = (&mut self.begun, bits & (1 | 1 << GENERIC) != 0) {
            vertices.push(current.clone());
        }
        let position = std::mem::replace(&mut self.state.current, current).position;
        self.state.current.position = position;
    }

    /// Draws elements of the arrays.
    pub(super) fn elements(&mut self, mode: u32, selection: &Selection) -> Outcome {
        if mode > e::POLYGON {
            return Err(INVALID_ENUM);
        }
        self.materials_meet()?;
        let (ready, bits) = self.ready()?;
        // A vertex program may take its position from any attribute, or from none.
        let program = self.glsl.has(Stage::Vertex) || self.state.programs & Stage::Vertex as u8 != 0;
        if bits & (1 | 1 << GENERIC) == 0 && !program {
            return Ok(());
        }
        // The number of the vertex takes the place of the fog coordinate.
        let numbered = self.compiling.is_none() && self.glsl.numbers_vertices();
        let bits = if numbered { bits | 1 << 4 } else { bits };
        if !numbered && self.draw_resident(mode, &ready, selection)? {
            return Ok(());
        }
        let fetch = |gl: &Gl, index: u32| -> Outcome<Vertex> {
            let mut vertex = gl.fetch(&ready, index)?;
            if numbered {
                vertex.fog = f32::from_bits(index);
            }
            Ok(vertex)
        };
        let indices = &selection.numbers[..self.vertices_read(selection.numbers.len())];
        let mut vertices: Vec<Vertex> = Vec::with_capacity(indices.len());
        // Most vertices are named several times: of each, the place of the first.
        let most = indices.iter().max().map_or(0, |&most| most as usize);
        let mut places = vec![u32::MAX; if most < 4 * indices.len() { most + 1 } else { 0 }];
        for &index in indices {
            let vertex = match places.get_mut(index as usize) {
                Some(&mut place) if place != u32::MAX => vertices[place as usize].clone(),
                first => {
                    if let Some(place) = first {
                        *place = vertices.len() as u32;
                    }
                    fetch(self, index)?
                }
            };
            vertices.push(vertex);
        }
        if self.keep_draws && self.compiling.is_none() {
            let mut named = indices.to_vec();
            named.sort_unstable();
            named.dedup();
            let number = |index: &u32| named.binary_search(index).expect("each index is named") as u32;
            let position = ready.iter().find(|array| matches!(array.slot, 0 | GENERIC)).map_or(4, |array| array.element.size);
            self.elements = Some(Elements {
                vertices: named.iter().map(|&index| fetch(self, index)).collect::<Outcome<_>>()?,
                numbers: indices.iter().map(number).collect(),
                sent: Sent::Arrays { position, slots: bits },
                indexed: selection.by != Selector::Sequence,
            });
        }
        self.batch.quads = None;
        let outcome = self.vertices(mode, vertices, bits);
        (self.elements, self.batch.quads) = (None, None);
        outcome
    }
}

pub(super) fn array_element(gl: &mut Gl, call: &Call, shape: Shape) -> Outcome {
    // What an earlier draw left may be the contents of another array, or fewer of its elements.
    let omitted = |array: &Array| array.enabled && matches!(array.source, Source::Memory(_) | Source::None);
    let slots = gl.arrays.slots.iter().enumerate();
    if gl.elements_omitted && slots.filter(|(slot, _)| *slot != 6).any(|(_, array)| omitted(array)) {
        return Err(Fault::Unsupported("glArrayElement with arrays in memory, which apitrace does not record".into()));
    }
    match gl.arrays.restart.of_element(call.u32(0)?)? {
        true if gl.compiling.is_some() => {
            return Err(Fault::Unsupported("glArrayElement of an index that ends a primitive in a list".into()));
        }
        true => return super::immediate::restart(gl, call, shape),
        false => {}
    }
    let (ready, bits) = gl.ready()?;
    let vertex = gl.fetch(&ready, call.u32(0)?)?;
    gl.element(vertex, bits)
}

/// Maximum number of vertex array objects.
const OBJECTS_MAX: usize = 1 << 16;

pub(super) fn bind_vertex_array(gl: &mut Gl, call: &Call, _: Shape) -> Outcome {
    let (name, arrays) = (call.u32(0)?, &mut gl.arrays);
    if name != arrays.object {
        if arrays.objects.len() >= OBJECTS_MAX {
            return Err(Fault::Limit(format!("more than {OBJECTS_MAX} vertex array objects")));
        }
        let (slots, indices) = arrays.objects.remove(name).unwrap_or_default();
        let old = (Box::new(std::mem::replace(&mut arrays.slots, *slots)), arrays.bound[1]);
        arrays.objects.insert(arrays.object, old);
        (arrays.bound[1], arrays.object) = (indices, name);
    }
    Ok(())
}

pub(super) fn delete_vertex_arrays(gl: &mut Gl, call: &Call, shape: Shape) -> Outcome {
    let names = call.numbers(1)?.into_owned();
    for name in names.into_iter().map(|name| name as u32).filter(|&name| name != 0) {
        if name == gl.arrays.object {
            bind_vertex_array(gl, &Call { args: vec![Arg::Num(0.0)], ..call.clone() }, shape)?;
        }
        gl.arrays.objects.remove(name);
    }
    Ok(())
}

pub(super) fn push_client(gl: &mut Gl, call: &Call, _: Shape) -> Outcome {
    if gl.saved_client.len() >= 16 {
        return Err(Fault::Error("GL_STACK_OVERFLOW"));
    }
    gl.saved_client.push((call.u32(0)?, Box::new((gl.arrays.clone(), gl.unpack))));
    Ok(())
}

pub(super) fn pop_client(gl: &mut Gl, _: &Call, _: Shape) -> Outcome {
    let (mask, saved) = gl.saved_client.pop().ok_or(Fault::Error("GL_STACK_UNDERFLOW"))?;
    let (arrays, unpack) = *saved;
    if mask & e::CLIENT_VERTEX_ARRAY_BIT != 0 {
        gl.arrays = arrays;
    }
    if mask & e::CLIENT_PIXEL_STORE_BIT != 0 {
        gl.unpack = unpack;
    }
    Ok(())
}
