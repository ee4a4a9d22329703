//! Draws with indices that end a primitive and begin the next one.

use gl_shader::consts as e;

use crate::gl::call::{Call, Fault, GlResult, INVALID_ENUM, Shape};
use crate::gl::machine::Gl;
use crate::gl::state::selection::{Selection, Selector};

/// Primitives of one draw at most.
const PARTS_MAX: usize = 1 << 16;

/// `glPrimitiveRestartIndex(index)`
pub fn index(gl: &mut Gl, call: &Call, _: Shape) -> GlResult {
    gl.context.arrays.restart.index = call.u32(0)?;
    Ok(())
}

/// Parts a draw at the indices of this type that end primitives. `base` is added to the others.
pub fn parts(gl: &Gl, mut all: Selection, kind: u32, base: i32) -> GlResult<Vec<Selection>> {
    let Some(end) = gl.context.arrays.restart.of(kind).filter(|end| all.numbers.contains(end)) else {
        all.add(base);
        return Ok(vec![all]);
    };
    let bytes = match kind {
        e::UNSIGNED_BYTE => 1,
        e::UNSIGNED_SHORT => 2,
        e::UNSIGNED_INT => 4,
        _ => return Err(INVALID_ENUM),
    };
    let (mut parts, mut first) = (Vec::new(), 0);
    for numbers in all.numbers.split(|&index| index == end) {
        if parts.len() >= PARTS_MAX {
            return Err(Fault::Limit(format!("more than {PARTS_MAX} primitives in one draw")));
        }
        let by = match all.by {
            Selector::Buffer { name, at, kind, base } => Selector::Buffer { name, at: at + first * bytes, kind, base },
            by => by,
        };
        if !numbers.is_empty() {
            let mut part = Selection { numbers: numbers.to_vec(), by };
            part.add(base);
            parts.push(part);
        }
        first += numbers.len() + 1;
    }
    Ok(parts)
}
