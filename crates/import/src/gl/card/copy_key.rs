//! What a draw that computes an image from another image is made from.

use gfx::state::*;
use trace::command::*;

/// What a copying draw reads.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CopySource {
    /// Colours, not filtered.
    Color,
    /// Colours, filtered.
    Filtered,
    /// Depths.
    Depth,
    /// Stencil values, as numbers.
    Stencil,
}

/// How results are combined with the stored values.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Combine {
    /// Results replace the stored values.
    Replace,
    /// Results are added.
    Add,
    /// Stored values are multiplied by the constant; results are not used.
    Scale,
}

/// The key of a copy pipeline.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct CopyKey {
    /// What is read.
    pub from: CopySource,
    /// WGSL of the result, computed from the value that is read, `c`, and a number, `u.source.z`.
    pub result: &'static str,
    /// The format that is written, by its name.
    pub format: &'static str,
    /// Blending.
    pub combine: Combine,
    /// Channels.
    pub mask: u8,
}

/// Maps pixels of the target to pixels of the source: source = from + (target - to) * scale, in pixel coordinates.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Map {
    /// A point in the target.
    pub to: [f32; 2],
    /// The corresponding point in the source.
    pub from: [f32; 2],
    /// Source pixels for one target pixel.
    pub scale: [f32; 2],
}

/// Each target pixel maps to the source pixel at the same position.
pub const SAME: Map = Map { to: [0.0; 2], from: [0.0; 2], scale: [1.0; 2] };

/// The row of a surface at which a pixel row, counted from the bottom, begins.
pub fn row_edge(height: u32, upward: bool, y: f32) -> f32 {
    if upward { y } else { height as f32 - y }
}

/// A view of one image of a texture.
pub fn one_image(level: u32, layer: u32, aspect: Aspect) -> ViewDesc {
    ViewDesc {
        base_level: level,
        levels: Some(1),
        base_layer: layer,
        layers: Some(1),
        dimension: Some(ViewDimension::D2),
        aspect,
        ..ViewDesc::default()
    }
}
