//! Calls of client arrays, generic attributes and vertex array objects.

use std::rc::Rc;

use gl_shader::arb::program::{GENERICS, ProgramStage};
use gl_shader::consts as e;

use crate::gl::call::{Arg, Call, Fault, GlResult, INVALID_ENUM, INVALID_OPERATION, INVALID_VALUE, Scalar, Shape};
use crate::gl::calls::immediate::restart;
use crate::gl::elements::scalar;
use crate::gl::geometry::listed::Geometry;
use crate::gl::geometry::primitive::{Elements, SentAttributes};
use crate::gl::geometry::vertex::Vertex;
use crate::gl::machine::Gl;
use crate::gl::state::arrays::{Array, ArrayData, Arrays, BLUE_FIRST, GENERIC};
use crate::gl::state::lists::Step;
use crate::gl::state::restart::RESTART_CLIENT;
use crate::gl::state::selection::{Selection, Selector};

fn set_enabled(gl: &mut Gl, array: u32, enabled: bool) -> GlResult {
    if array == RESTART_CLIENT && gl.context.arrays.restart.switch(array, enabled) {
        return Ok(());
    }
    let slot = gl.context.arrays.slot(array)?;
    gl.context.arrays.switch(slot, enabled);
    Ok(())
}

pub fn enable(gl: &mut Gl, call: &Call, _: Shape) -> GlResult {
    set_enabled(gl, call.u32(0)?, true)
}

pub fn disable(gl: &mut Gl, call: &Call, _: Shape) -> GlResult {
    set_enabled(gl, call.u32(0)?, false)
}

pub fn client_active(gl: &mut Gl, call: &Call, _: Shape) -> GlResult {
    let unit = call.unit(0)?;
    gl.context.arrays.active = unit;
    Ok(())
}

/// The argument that is the size of an array's elements: at least this, or `GL_BGRA` where colours can have it. Packed elements have four
/// components.
fn size_of(call: &Call, argument: usize, kind: u32, least: usize, colors: bool) -> GlResult<usize> {
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

macro_rules! sized {
    ($($name:ident $slot:expr, $least:literal, $colors:literal;)+) => { $(
        pub fn $name(gl: &mut Gl, call: &Call, _: Shape) -> GlResult {
            let kind = call.u32(1)?;
            let size = size_of(call, 0, kind, $least, $colors)?;
            let slot: fn(&Arrays) -> usize = $slot;
            gl.context.arrays.point(slot(&gl.context.arrays), size, kind, call.i32(2)?, call.arg(3))
        }
    )+ };
}

sized! {
    vertex_pointer |_| 0, 2, false;
    color_pointer |_| 2, 3, true;
    secondary_pointer |_| 3, 3, true;
    texture_pointer |arrays| 8 + arrays.active, 1, false;
}

pub fn normal_pointer(gl: &mut Gl, call: &Call, _: Shape) -> GlResult {
    gl.context.arrays.point(1, 3, call.u32(0)?, call.i32(1)?, call.arg(2))
}

pub fn fog_pointer(gl: &mut Gl, call: &Call, _: Shape) -> GlResult {
    gl.context.arrays.point(4, 1, call.u32(0)?, call.i32(1)?, call.arg(2))
}

pub fn edge_pointer(gl: &mut Gl, call: &Call, _: Shape) -> GlResult {
    gl.context.arrays.point(5, 1, e::UNSIGNED_BYTE, call.i32(0)?, call.arg(1))
}

/// An array of an interleaved format: its number of components, and their offset.
type InterleavedArray = Option<(usize, usize)>;

/// An interleaved format: the arrays of texture coordinates, colours, normals and positions, and the bytes of a vertex.
struct Interleaving(u32, [InterleavedArray; 4], usize);

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
pub fn interleaved(gl: &mut Gl, call: &Call, _: Shape) -> GlResult {
    let format = call.u32(0)?;
    let Interleaving(_, parts, vertex) = INTERLEAVINGS.iter().find(|known| known.0 == format).ok_or(INVALID_ENUM)?;
    let stride = match call.i32(1)? {
        0 => *vertex as i32,
        stride => stride,
    };
    let bytes = [e::C4UB_V2F, e::C4UB_V3F, e::T2F_C4UB_V3F].contains(&format);
    let data = call.arg(2);
    for (slot, part) in [8 + gl.context.arrays.active, 2, 1, 0].into_iter().zip(*parts) {
        let kind = if slot == 2 && bytes { e::UNSIGNED_BYTE } else { e::FLOAT };
        if let Some((size, at)) = part {
            let data = match data {
                Arg::Blob(bytes) => Arg::Blob(bytes.get(at..).unwrap_or_default().into()),
                Arg::Pointer(start) => Arg::Pointer(start.saturating_add(at as u64)),
                Arg::Num(start) => Arg::Num(start + at as f64),
                Arg::Null if gl.context.arrays.bound[0] != 0 => Arg::Pointer(at as u64),
                other => other.clone(),
            };
            gl.context.arrays.point(slot, size, kind, stride, &data)?;
        }
        gl.context.arrays.switch(slot, part.is_some());
    }
    // The arrays of secondary colours, fog coordinates and generic attributes are unchanged.
    for slot in [5, 6] {
        gl.context.arrays.switch(slot, false);
    }
    Ok(())
}

fn generic_slot(call: &Call) -> GlResult<usize> {
    let index = call.u32(0)? as usize;
    if index < GENERICS { Ok(GENERIC + index) } else { Err(INVALID_VALUE) }
}

pub fn enable_generic(gl: &mut Gl, call: &Call, _: Shape) -> GlResult {
    gl.context.arrays.switch(generic_slot(call)?, true);
    Ok(())
}

pub fn disable_generic(gl: &mut Gl, call: &Call, _: Shape) -> GlResult {
    gl.context.arrays.switch(generic_slot(call)?, false);
    Ok(())
}

/// `glVertexAttribPointer(index, size, type, normalized, stride, pointer)`
pub fn generic_pointer(gl: &mut Gl, call: &Call, _: Shape) -> GlResult {
    let (slot, kind, normalized) = (generic_slot(call)?, call.u32(2)?, call.bool(3)?);
    let size = size_of(call, 1, kind, 1, true)?;
    if size == BLUE_FIRST && !normalized {
        return Err(INVALID_OPERATION);
    }
    gl.context.arrays.point(slot, size, kind, call.i32(4)?, call.arg(5))?;
    gl.context.arrays.normalize(slot, normalized);
    Ok(())
}

/// `glVertexAttribIPointer(index, size, type, stride, pointer)`
pub fn whole_pointer(gl: &mut Gl, call: &Call, _: Shape) -> GlResult {
    let (slot, kind) = (generic_slot(call)?, call.u32(2)?);
    let size = size_of(call, 1, kind, 1, false)?;
    gl.context.arrays.point(slot, size, kind, call.i32(3)?, call.arg(4))?;
    gl.context.arrays.keep_integers(slot);
    Ok(())
}

/// `glVertexAttribDivisor(index, divisor)`
pub fn divisor(gl: &mut Gl, call: &Call, _: Shape) -> GlResult {
    let slot = generic_slot(call)?;
    gl.context.arrays.set_divisor(slot, call.u32(1)?);
    Ok(())
}

impl Gl {
    /// Sets the attributes of an element's arrays, and sends a vertex if positions are among them.
    pub fn send_element(&mut self, vertex: &Vertex, bits: u32) {
        let current = vertex.over(&self.state.current, bits);
        if let (Some((_, vertices)), true) = (&mut self.context.open_primitive, bits & (1 | 1 << GENERIC) != 0) {
            vertices.push(current.clone());
        }
        let position = std::mem::replace(&mut self.state.current, current).position;
        self.state.current.position = position;
    }

    /// Draws elements of the arrays.
    pub fn elements(&mut self, mode: u32, selection: &Selection) -> GlResult {
        if mode > e::POLYGON {
            return Err(INVALID_ENUM);
        }
        self.apply_materials()?;
        let (ready, bits) = self.array_views()?;
        // A vertex program may take its position from any attribute, or from none.
        let program = self.objects.glsl.has(self.context.glsl_program, ProgramStage::Vertex)
            || self.state.programs & ProgramStage::Vertex as u8 != 0;
        if bits & (1 | 1 << GENERIC) == 0 && !program {
            return Ok(());
        }
        // The number of the vertex takes the place of the fog coordinate.
        let numbered = self.context.compiling.is_none() && self.objects.glsl.numbers_vertices(self.context.glsl_program);
        let bits = if numbered { bits | 1 << 4 } else { bits };
        if !numbered && self.draw_resident(mode, &ready, selection)? {
            return Ok(());
        }
        let fetch = |gl: &Gl, index: u32| -> GlResult<Vertex> {
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
        if self.options.keep_draws && self.context.compiling.is_none() {
            let mut named = indices.to_vec();
            named.sort_unstable();
            named.dedup();
            let number = |index: &u32| named.binary_search(index).expect("each index is named") as u32;
            let position = ready.iter().find(|array| matches!(array.slot, 0 | GENERIC)).map_or(4, |array| array.element.size);
            self.drawing.elements = Some(Elements {
                vertices: named.iter().map(|&index| fetch(self, index)).collect::<GlResult<_>>()?,
                numbers: indices.iter().map(number).collect(),
                sent: SentAttributes::Arrays { position, slots: bits },
                indexed: selection.by != Selector::Sequence,
            });
        }
        self.drawing.batch.quads = None;
        let outcome = self.vertices(mode, vertices, bits);
        (self.drawing.elements, self.drawing.batch.quads) = (None, None);
        outcome
    }

    /// Draws vertices of client arrays, or stores them in the list that is compiled. `arrays` has a bit for each attribute of the arrays.
    pub fn vertices(&mut self, mode: u32, vertices: Vec<Vertex>, arrays: u32) -> GlResult {
        if let Some((_, execute, list)) = &mut self.context.compiling {
            let execute = *execute;
            if !vertices.is_empty() {
                list.add(Step::Primitive(Rc::new(Geometry::new(mode, vertices.clone().into(), arrays))))
                    .map_err(Fault::Limit)?;
            }
            if !execute {
                return Ok(());
            }
        }
        self.primitive(mode, &vertices)
    }

    /// Sends an element of client arrays, or stores it in the list that is compiled.
    pub fn element(&mut self, vertex: Vertex, arrays: u32) -> GlResult {
        if let Some((_, execute, list)) = &mut self.context.compiling {
            let execute = *execute;
            list.known = 0;
            list.add(Step::Element(Box::new(vertex.clone()), arrays)).map_err(Fault::Limit)?;
            if !execute {
                return Ok(());
            }
        }
        self.send_element(&vertex, arrays);
        Ok(())
    }
}

pub fn array_element(gl: &mut Gl, call: &Call, shape: Shape) -> GlResult {
    // What an earlier draw left may be the contents of another array, or fewer of its elements.
    let omitted = |(_, array): (usize, &Array)| matches!(array.source, ArrayData::Memory(_) | ArrayData::None);
    if gl.options.elements_omitted && gl.context.arrays.enabled().any(omitted) {
        return Err(Fault::Unsupported("glArrayElement with arrays in memory, which apitrace does not record".into()));
    }
    match gl.context.arrays.restart.of_element(call.u32(0)?)? {
        true if gl.context.compiling.is_some() => {
            return Err(Fault::Unsupported("glArrayElement of an index that ends a primitive in a list".into()));
        }
        true => return restart(gl, call, shape),
        false => {}
    }
    let (ready, bits) = gl.array_views()?;
    let vertex = gl.fetch(&ready, call.u32(0)?)?;
    gl.element(vertex, bits)
}

pub fn bind_vertex_array(gl: &mut Gl, call: &Call, _: Shape) -> GlResult {
    gl.context.arrays.bind(call.u32(0)?)
}

pub fn delete_vertex_arrays(gl: &mut Gl, call: &Call, _: Shape) -> GlResult {
    call.numbers(1)?
        .iter()
        .map(|&name| name as u32)
        .filter(|&name| name != 0)
        .try_for_each(|name| gl.context.arrays.delete(name))
}

pub fn push_client(gl: &mut Gl, call: &Call, _: Shape) -> GlResult {
    if gl.context.saved_client.len() >= 16 {
        return Err(Fault::Error("GL_STACK_OVERFLOW"));
    }
    gl.context.saved_client.push((call.u32(0)?, Box::new((gl.context.arrays.clone(), gl.context.unpack))));
    Ok(())
}

pub fn pop_client(gl: &mut Gl, _: &Call, _: Shape) -> GlResult {
    let (mask, saved) = gl.context.saved_client.pop().ok_or(Fault::Error("GL_STACK_UNDERFLOW"))?;
    let (arrays, unpack) = *saved;
    if mask & e::CLIENT_VERTEX_ARRAY_BIT != 0 {
        gl.context.arrays = arrays;
    }
    if mask & e::CLIENT_PIXEL_STORE_BIT != 0 {
        gl.context.unpack = unpack;
    }
    Ok(())
}
