//! Indices that end a primitive and begin the next one.

use gl_shader::consts as e;

use crate::gl::call::{Fault, GlResult};

/// Capabilities: with the program's index, and with the greatest one of the type.
const RESTART: u32 = 0x8f9d;
const RESTART_FIXED: u32 = 0x8d69;
/// The client state of `NV_primitive_restart`.
pub const RESTART_CLIENT: u32 = 0x8558;

/// Whether indices end primitives, and which.
#[derive(Clone, Copy, Debug, Default)]
pub struct Restart {
    on: bool,
    fixed: bool,
    /// The index that ends primitives, if they are ended by one of the program.
    pub index: u32,
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
    pub fn of_element(&self, index: u32) -> GlResult<bool> {
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
