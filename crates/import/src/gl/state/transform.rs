//! Matrix stacks.

use gl_shader::{PLANES, UNITS, consts as e};
use glam::Mat4;

/// Viewport, clip planes and the current matrix.
#[derive(Clone, Debug)]
pub struct Transform {
    /// x, y, width, height.
    pub viewport: [i32; 4],
    /// Near and far depth.
    pub depth_range: [f32; 2],
    /// Current matrix mode.
    pub matrix_mode: u32,
    /// Clip planes in eye space.
    pub planes: [[f32; 4]; PLANES],
}

impl Default for Transform {
    fn default() -> Self {
        Transform { viewport: [0; 4], depth_range: [0.0, 1.0], matrix_mode: e::MODELVIEW, planes: [[0.0; 4]; PLANES] }
    }
}

/// A stack of matrices.
#[derive(Clone, Debug)]
pub struct Stack {
    /// The current matrix.
    pub top: Mat4,
    below: Vec<Mat4>,
    most: usize,
}

impl Stack {
    /// A stack with the identity; it holds `most` matrices.
    pub fn new(most: usize) -> Stack {
        Stack { top: Mat4::IDENTITY, below: Vec::new(), most }
    }

    /// Pushes a copy of the top; returns whether there was room.
    pub fn push(&mut self) -> bool {
        let room = self.below.len() + 1 < self.most;
        if room {
            self.below.push(self.top);
        }
        room
    }

    /// Removes the top; returns whether there was one below.
    pub fn pop(&mut self) -> bool {
        let below = self.below.pop();
        if let Some(matrix) = below {
            self.top = matrix;
        }
        below.is_some()
    }
}

/// The matrix stacks of a context. Those of colours have no effect.
pub struct Matrices {
    /// From object space to eye space.
    pub modelview: Stack,
    /// From eye space to clip space.
    pub projection: Stack,
    /// Of texture coordinates, for the units of fixed functions.
    pub texture: [Stack; UNITS],
    /// Of colours.
    pub color: Stack,
}

impl Default for Matrices {
    fn default() -> Self {
        let texture = std::array::from_fn(|_| Stack::new(10));
        Matrices { modelview: Stack::new(32), projection: Stack::new(32), texture, color: Stack::new(10) }
    }
}
