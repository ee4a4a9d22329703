//! The vertices that a draw selects.

use crate::gl::call::Scalar;

/// The vertices that a draw selects.
pub struct Selection {
    /// Their numbers.
    pub numbers: Vec<u32>,
    /// How the program gives them.
    pub by: Selector,
}

/// How a program selects vertices.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Selector {
    /// Consecutive ones.
    Sequence,
    /// With indices in its own memory.
    Memory,
    /// With indices in a buffer object.
    Buffer {
        /// The buffer object.
        name: u32,
        /// Where the first index is, in bytes.
        at: usize,
        /// Type of the indices.
        kind: Scalar,
        /// Added to each index.
        base: i32,
    },
}

impl Selection {
    /// Consecutive vertices.
    pub fn sequence(first: u32, count: u32) -> Selection {
        Selection { numbers: (first..first.saturating_add(count)).collect(), by: Selector::Sequence }
    }

    /// Adds a number to each index.
    pub fn add(&mut self, added: i32) {
        self.numbers.iter_mut().for_each(|index| *index = index.wrapping_add_signed(added));
        if let Selector::Buffer { base, .. } = &mut self.by {
            *base = added;
        }
    }
}
