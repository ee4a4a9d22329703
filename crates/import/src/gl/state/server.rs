//! The server's state: what `glPushAttrib` saves.

use gl_shader::{LIGHTS, PLANES, consts as e};

use crate::gl::geometry::vertex::Vertex;
use crate::gl::state::fragments::{ColorState, DepthTest, StencilTest};
use crate::gl::state::lighting::{Fog, Lighting};
use crate::gl::state::raster::{Line, PixelModes, Point, Polygon, RasterPosition};
use crate::gl::state::texturing::Texturing;
use crate::gl::state::transform::Transform;

/// The server state, in the groups that `glPushAttrib` saves.
#[derive(Clone, Debug)]
pub struct State {
    /// Current vertex attributes.
    pub current: Vertex,
    /// Enabled capabilities: a bit of [`capability`] each.
    pub enabled: u64,
    /// Switches of programs (`arb::switch`).
    pub programs: u8,
    /// Viewport, clip planes and the current matrix.
    pub transform: Transform,
    /// Lights, materials and shading.
    pub lighting: Lighting,
    /// Fog.
    pub fog: Fog,
    /// Polygons.
    pub polygon: Polygon,
    /// Lines.
    pub line: Line,
    /// Points.
    pub point: Point,
    /// The depth test.
    pub depth: DepthTest,
    /// The stencil test.
    pub stencil: StencilTest,
    /// How colours are written.
    pub color: ColorState,
    /// Scissor: x, y, width, height.
    pub scissor: [i32; 4],
    /// Texture units.
    pub texturing: Texturing,
    /// Added to the names of lists that `glCallLists` calls.
    pub list_base: u32,
    /// Evaluator grids: count, from, to in u and v.
    pub grids: [(i32, f32, f32); 2],
    /// The raster position.
    pub raster: RasterPosition,
    /// How pixel rectangles are drawn.
    pub pixels: PixelModes,
}

impl Default for State {
    fn default() -> State {
        State {
            current: Vertex::default(),
            enabled: capability(e::DITHER).unwrap_or(0) | capability(e::MULTISAMPLE).unwrap_or(0),
            programs: 0,
            transform: Transform::default(),
            lighting: Lighting::default(),
            fog: Fog::default(),
            polygon: Polygon::default(),
            line: Line::default(),
            point: Point::default(),
            depth: DepthTest::default(),
            stencil: StencilTest::default(),
            color: ColorState::default(),
            scissor: [0; 4],
            texturing: Texturing::default(),
            list_base: 0,
            grids: [(1, 0.0, 1.0); 2],
            raster: RasterPosition::default(),
            pixels: PixelModes::default(),
        }
    }
}

/// Capabilities that are a bit of the state.
const CAPABILITIES: &[(u32, u32)] = &[
    (e::ALPHA_TEST, e::COLOR_BUFFER_BIT),
    (e::AUTO_NORMAL, e::EVAL_BIT),
    (e::COLOR_LOGIC_OP, e::COLOR_BUFFER_BIT),
    (e::COLOR_MATERIAL, e::LIGHTING_BIT),
    (e::COLOR_SUM, e::FOG_BIT),
    (e::CULL_FACE, e::POLYGON_BIT),
    (e::DEPTH_TEST, e::DEPTH_BUFFER_BIT),
    (e::DITHER, e::COLOR_BUFFER_BIT),
    (e::FOG, e::FOG_BIT),
    (e::FRAMEBUFFER_SRGB, e::COLOR_BUFFER_BIT),
    (e::LIGHTING, e::LIGHTING_BIT),
    (e::LINE_SMOOTH, e::LINE_BIT),
    (e::LINE_STIPPLE, e::LINE_BIT),
    (e::MULTISAMPLE, e::MULTISAMPLE_BIT),
    (e::NORMALIZE, e::TRANSFORM_BIT),
    (e::POINT_SMOOTH, e::POINT_BIT),
    (e::POINT_SPRITE, e::POINT_BIT),
    (e::POLYGON_OFFSET_FILL, e::POLYGON_BIT),
    (e::POLYGON_OFFSET_LINE, e::POLYGON_BIT),
    (e::POLYGON_OFFSET_POINT, e::POLYGON_BIT),
    (e::POLYGON_SMOOTH, e::POLYGON_BIT),
    (e::POLYGON_STIPPLE, e::POLYGON_BIT),
    (e::RESCALE_NORMAL, e::TRANSFORM_BIT),
    (e::SCISSOR_TEST, e::SCISSOR_BIT),
    (e::STENCIL_TEST, e::STENCIL_BUFFER_BIT),
    (e::STENCIL_TEST_TWO_SIDE_EXT, e::STENCIL_BUFFER_BIT),
    // These have no effect with one sample per pixel.
    (e::SAMPLE_ALPHA_TO_COVERAGE, e::MULTISAMPLE_BIT),
    (e::SAMPLE_ALPHA_TO_ONE, e::MULTISAMPLE_BIT),
    (e::SAMPLE_COVERAGE, e::MULTISAMPLE_BIT),
];

/// The first bits of lights, clip planes and evaluators.
const LIGHT_BIT: u32 = 32;
const PLANE_BIT: u32 = LIGHT_BIT + LIGHTS as u32;
const MAP_BIT: u32 = PLANE_BIT + PLANES as u32;

/// The bit of a capability, or none if the state has no bit for it.
pub fn capability(cap: u32) -> Option<u64> {
    let bit = match cap {
        e::LIGHT0..0x4008 => LIGHT_BIT + cap - e::LIGHT0,
        e::CLIP_PLANE0..0x3006 => PLANE_BIT + cap - e::CLIP_PLANE0,
        e::MAP1_COLOR_4..=e::MAP1_VERTEX_4 => MAP_BIT + cap - e::MAP1_COLOR_4,
        e::MAP2_COLOR_4..=e::MAP2_VERTEX_4 => MAP_BIT + 9 + cap - e::MAP2_COLOR_4,
        _ => CAPABILITIES.iter().position(|&(known, _)| known == cap)? as u32,
    };
    Some(1 << bit)
}

/// The capabilities in the attribute groups of `mask`.
fn capabilities_of(mask: u32) -> u64 {
    if mask & e::ENABLE_BIT != 0 {
        return !0;
    }
    let mut bits = 0;
    for (k, &(_, group)) in CAPABILITIES.iter().enumerate() {
        bits |= u64::from(mask & group != 0) << k;
    }
    let range = |first: u32, count: u32| ((1_u64 << count) - 1) << first;
    let groups = [
        (e::LIGHTING_BIT, range(LIGHT_BIT, LIGHTS as u32)),
        (e::TRANSFORM_BIT, range(PLANE_BIT, PLANES as u32)),
        (e::EVAL_BIT, range(MAP_BIT, 18)),
    ];
    groups.iter().filter(|&&(group, _)| mask & group != 0).fold(bits, |all, &(_, range)| all | range)
}

impl State {
    /// Whether a capability is enabled.
    pub fn is(&self, cap: u32) -> bool {
        capability(cap).is_some_and(|bit| self.enabled & bit != 0)
    }

    /// Restores the attribute groups of `mask` from a saved state.
    pub fn restore(&mut self, mask: u32, saved: State) {
        let caps = capabilities_of(mask);
        self.enabled = self.enabled & !caps | saved.enabled & caps;
        self.texturing.restore(mask, &saved.texturing);
        let stipple = self.polygon.stipple;
        macro_rules! take {
            ($($bit:ident => $($field:ident),+;)+) => { $(if mask & e::$bit != 0 { $(self.$field = saved.$field;)+ })+ };
        }
        if mask & (e::ENABLE_BIT | e::COLOR_BUFFER_BIT) == e::ENABLE_BIT {
            for (writes, old) in self.color.writes.iter_mut().zip(&saved.color.writes) {
                writes.blended = old.blended;
            }
        }
        if mask & e::VIEWPORT_BIT != 0 {
            (self.transform.viewport, self.transform.depth_range) = (saved.transform.viewport, saved.transform.depth_range);
        }
        if mask & e::TRANSFORM_BIT != 0 {
            (self.transform.matrix_mode, self.transform.planes) = (saved.transform.matrix_mode, saved.transform.planes);
        }
        let pattern = if mask & e::POLYGON_STIPPLE_BIT != 0 { saved.polygon.stipple } else { stipple };
        take! {
            CURRENT_BIT => current, raster;
            ENABLE_BIT => programs;
            LIGHTING_BIT => lighting;
            FOG_BIT => fog;
            POLYGON_BIT => polygon;
            LINE_BIT => line;
            POINT_BIT => point;
            DEPTH_BUFFER_BIT => depth;
            STENCIL_BUFFER_BIT => stencil;
            COLOR_BUFFER_BIT => color;
            SCISSOR_BIT => scissor;
            LIST_BIT => list_base;
            EVAL_BIT => grids;
            PIXEL_MODE_BIT => pixels;
        }
        self.polygon.stipple = pattern;
    }
}
