//! How points, lines, polygons and pixel rectangles are rasterised.

use gl_shader::consts as e;

use crate::gl::geometry::vertex::Vertex;
use crate::gl::texels::transfer::Transfer;

/// How polygons are rasterised.
#[derive(Clone, Debug)]
pub struct Polygon {
    /// Faces that are culled.
    pub cull: u32,
    /// Winding of front faces.
    pub front: u32,
    /// Modes: front, back.
    pub modes: [u32; 2],
    /// Factor and units of the depth offset.
    pub offset: [f32; 2],
    /// Stipple pattern: rows from the bottom.
    pub stipple: [u32; 32],
}

impl Default for Polygon {
    fn default() -> Self {
        Polygon { cull: e::BACK, front: e::CCW, modes: [e::FILL; 2], offset: [0.0; 2], stipple: [!0; 32] }
    }
}

/// How lines are rasterised.
#[derive(Clone, Debug)]
pub struct Line {
    /// Width.
    pub width: f32,
    /// Factor and pattern.
    pub stipple: (u32, u32),
}

impl Default for Line {
    fn default() -> Self {
        Line { width: 1.0, stipple: (1, 0xffff) }
    }
}

/// How points are rasterised.
#[derive(Clone, Debug)]
pub struct Point {
    /// Size.
    pub size: f32,
    /// Minimum, maximum, fade threshold.
    pub limits: [f32; 3],
    /// Constant, linear, quadratic.
    pub attenuation: [f32; 3],
    /// Units whose coordinates sprites replace.
    pub sprites: u8,
    /// Whether the second coordinate of sprites grows upward.
    pub sprites_up: bool,
}

impl Default for Point {
    fn default() -> Self {
        Point { size: 1.0, limits: [0.0, 2048.0, 1.0], attenuation: [1.0, 0.0, 0.0], sprites: 0, sprites_up: false }
    }
}

/// The raster position.
#[derive(Clone, Debug)]
pub struct RasterPosition {
    /// Its place in window space, if it is valid.
    pub position: Option<[f32; 4]>,
    /// Its attributes: the current ones after lighting and texture coordinate generation.
    pub vertex: Vertex,
}

impl Default for RasterPosition {
    fn default() -> Self {
        RasterPosition { position: Some([0.0, 0.0, 0.0, 1.0]), vertex: Vertex::default() }
    }
}

/// How pixel rectangles are drawn.
#[derive(Clone, Debug)]
pub struct PixelModes {
    /// Zoom.
    pub zoom: [f32; 2],
    /// Pixel transfer.
    pub transfer: Transfer,
}

impl Default for PixelModes {
    fn default() -> Self {
        PixelModes { zoom: [1.0; 2], transfer: Transfer::default() }
    }
}
