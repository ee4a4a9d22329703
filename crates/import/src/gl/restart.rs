//! Indices that end a primitive and begin the next one.

use super::call::{Call, Fault, INVALID_ENUM, Outcome, Shape};
use super::consts as e;
use super::elements::{Selection, Selector};
use super::machine::Gl;

/// Capabilities: with the program's index, and with the greatest one of the type.
pub const RESTART: u32 = 0x8f9d;
pub const RESTART_FIXED: u32 = 0x8d69;
/// The client state of `NV_primitive_restart`.
pub const RESTART_CLIENT: u32 = 0x8558;

/// Primitives of one draw at most.
const PARTS_MAX: usize = 1 << 16;

/// Whether indices end primitives, and which.
#[derive(Clone, Copy, Debug, Default)]
pub struct Restart {
    on: bool,
    fixed: bool,
    index: u32,
}

impl Restart {
    /// Switches a capability; false if it is another one.
    pub fn switch(&mut self, cap: u32, on: bool) -> bool {
        match cap {
            RESTART | RESTART_CLIENT => self.on = on,
            RESTART_FIXED => self.fixed = on,
            _ => return false,
        }
        true
    }

    /// Whether `glArrayElement` of an index ends a primitive.
    pub fn of_element(&self, index: u32) -> Outcome<bool> {
        if self.fixed && [0xff, 0xffff, u32::MAX].contains(&index) {
            return Err(Fault::Unsupported("glArrayElement with GL_PRIMITIVE_RESTART_FIXED_INDEX".into()));
        }
        Ok(self.on && !self.fixed && index == self.index)
    }

    /// The index that ends primitives, among those of a type; none: none does.
    pub fn of(&self, kind: u32) -> Option<u32> {
        let greatest = match kind {
            e::UNSIGNED_BYTE => 0xff,
            e::UNSIGNED_SHORT => 0xffff,
            _ => u32::MAX,
        };
        if self.fixed { Some(greatest) } else { self.on.then_some(self.index) }
    }
}

/// `glPrimitiveRestartIndex(index)`
pub(super) fn index(gl: &mut Gl, call: &Call, _: Shape) -> Outcome {
    gl.arrays.restart.index = call.u32(0)?;
    Ok(())
}

/// Parts a draw at the indices of this type that end primitives. `base` is added to the others.
pub(super) fn parts(gl: &Gl, mut all: Selection, kind: u32, base: i32) -> Outcome<Vec<Selection>> {
    let Some(end) = gl.arrays.restart.of(kind).filter(|end| all.numbers.contains(end)) else {
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
