//! The server's state: what `glPushAttrib` saves.

mod light;
mod vertex;

pub use gl_shader::{COLORS_MAX, IMAGES, LIGHTS, PLANES, TARGETS, UNITS};
use glam::Mat4;

use super::consts as e;
use super::key::FogDistance;
use super::pixel_data::Transfer;
pub use light::{Derived, Light, Material};
pub use vertex::Vertex;

/// Generation of one texture coordinate.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Generation {
    /// `GL_EYE_LINEAR`, ...
    pub mode: u32,
    /// Object plane.
    pub object: [f32; 4],
    /// Eye plane, in eye space.
    pub eye: [f32; 4],
}

/// Texture environment of a unit.
#[derive(Clone, Debug, PartialEq)]
pub struct Environment {
    /// `GL_MODULATE`, ...
    pub mode: u32,
    /// Constant colour.
    pub color: [f32; 4],
    /// Combiners of colour and alpha.
    pub combine: [u32; 2],
    /// Sources of both.
    pub sources: [[u32; 4]; 2],
    /// Operands of both.
    pub operands: [[u32; 4]; 2],
    /// Scales of both.
    pub scales: [f32; 2],
    /// Bias of the level of detail.
    pub bias: f32,
}

/// A texture unit.
#[derive(Clone, Debug)]
pub struct Unit {
    /// Which of [`TARGETS`] are enabled.
    pub enabled: u8,
    /// Names of the textures that are bound to them.
    pub bound: [u32; 5],
    /// Which of s, t, r, q are generated.
    pub generated: u8,
    /// How each of them is generated.
    pub generation: [Generation; 4],
    /// Environment.
    pub environment: Environment,
}

impl Default for Unit {
    fn default() -> Unit {
        let plane = |k: usize| std::array::from_fn(|i| if i == k && k < 2 { 1.0 } else { 0.0 });
        Unit {
            enabled: 0,
            bound: [0; 5],
            generated: 0,
            generation: std::array::from_fn(|k| Generation { mode: e::EYE_LINEAR, object: plane(k), eye: plane(k) }),
            environment: Environment {
                mode: e::MODULATE,
                color: [0.0; 4],
                combine: [e::MODULATE; 2],
                sources: [[e::TEXTURE, e::PREVIOUS, e::CONSTANT, e::ZERO]; 2],
                operands: [
                    [e::SRC_COLOR, e::SRC_COLOR, e::SRC_ALPHA, e::ONE_MINUS_SRC_COLOR],
                    [e::SRC_ALPHA, e::SRC_ALPHA, e::SRC_ALPHA, e::ONE_MINUS_SRC_ALPHA],
                ],
                scales: [1.0; 2],
                bias: 0.0,
            },
        }
    }
}

/// Stencil state of one side.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Stencil {
    /// Comparison.
    pub compare: u32,
    /// Reference.
    pub reference: i32,
    /// Mask of the comparison.
    pub read: u32,
    /// Operations: fail, depth fail, pass.
    pub ops: [u32; 3],
    /// Mask of writes.
    pub write: u32,
}

/// How a colour buffer is blended and written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ColorWrites {
    /// Whether colours are blended.
    pub blended: bool,
    /// Blend factors: source and destination of colour, of alpha.
    pub factors: [u32; 4],
    /// Blend equations of colour and alpha.
    pub ops: [u32; 2],
    /// Channels that are written.
    pub mask: u8,
}

impl Default for ColorWrites {
    fn default() -> Self {
        ColorWrites { blended: false, factors: [e::ONE, e::ZERO, e::ONE, e::ZERO], ops: [e::FUNC_ADD; 2], mask: 15 }
    }
}

/// The whole server state.
#[derive(Clone, Debug)]
pub struct State {
    /// Current vertex attributes.
    pub current: Vertex,
    /// Enabled capabilities: a bit of [`capability`] each.
    pub enabled: u64,
    /// Switches of programs (`arb::switch`).
    pub programs: u8,
    /// x, y, width, height.
    pub viewport: [i32; 4],
    /// Near and far depth.
    pub depth_range: [f32; 2],
    /// Current matrix mode.
    pub matrix_mode: u32,
    /// Clip planes in eye space.
    pub planes: [[f32; 4]; PLANES],
    /// Lights.
    pub lights: [Light; LIGHTS],
    /// Ambient light of the scene.
    pub model_ambient: [f32; 4],
    /// Whether the viewer is in the scene.
    pub local_viewer: bool,
    /// Whether back faces are lit.
    pub two_side: bool,
    /// Whether specular light is added after texturing.
    pub separate_specular: bool,
    /// Materials: front, back.
    pub materials: [Material; 2],
    /// Faces and mode of colour material.
    pub color_material: [u32; 2],
    /// Flat shading.
    pub flat: bool,
    /// Whether the first vertex of a primitive gives its flat values.
    pub provoking_first: bool,
    /// Fog.
    pub fog_mode: u32,
    /// Fog.
    pub fog_color: [f32; 4],
    /// Density, start, end.
    pub fog: [f32; 3],
    /// The distance that it uses.
    pub fog_distance: FogDistance,
    /// Whether fog takes the fog coordinate.
    pub fog_from_coordinate: bool,
    /// Faces that are culled.
    pub cull: u32,
    /// Winding of front faces.
    pub front: u32,
    /// Polygon modes: front, back.
    pub polygon_modes: [u32; 2],
    /// Factor and units.
    pub polygon_offset: [f32; 2],
    /// Polygon stipple pattern: rows from the bottom.
    pub stipple: [u32; 32],
    /// Line width.
    pub line_width: f32,
    /// Factor and pattern.
    pub line_stipple: (u32, u32),
    /// Point size.
    pub point_size: f32,
    /// Minimum, maximum, fade threshold.
    pub point_limits: [f32; 3],
    /// Constant, linear, quadratic.
    pub point_attenuation: [f32; 3],
    /// Units whose coordinates sprites replace.
    pub point_sprites: u8,
    /// Whether the second coordinate of sprites grows upward.
    pub sprites_up: bool,
    /// Depth test.
    pub depth_func: u32,
    /// Depth test.
    pub depth_write: bool,
    /// Depth test.
    pub clear_depth: f32,
    /// Front and back.
    pub stencil: [Stencil; 2],
    /// The active stencil face, if the program has set one (EXT_stencil_two_side).
    pub stencil_face: Option<u32>,
    /// Stencil.
    pub clear_stencil: i32,
    /// Alpha test: comparison and reference.
    pub alpha: (u32, f32),
    /// How each of the colour buffers is blended and written, in the order in which they are drawn to.
    pub writes: [ColorWrites; COLORS_MAX],
    /// Blend constant.
    pub blend_color: [f32; 4],
    /// Logic operation.
    pub logic: u32,
    /// Clear colour.
    pub clear_color: [f32; 4],
    /// Colour buffer that is drawn to.
    pub draw_buffer: u32,
    /// Scissor: x, y, width, height.
    pub scissor: [i32; 4],
    /// Texture units up to the last one that the program has used, and at least those of fixed functions.
    pub units: Vec<Unit>,
    /// The active texture unit; it is among them.
    pub active: usize,
    /// Display lists.
    pub list_base: u32,
    /// Evaluator grids: count, from, to in u and v.
    pub grids: [(i32, f32, f32); 2],
    /// Raster position in window space, and whether it is valid.
    pub raster: Option<[f32; 4]>,
    /// Attributes of the raster position: the current ones after lighting and texture coordinate generation.
    pub raster_vertex: Vertex,
    /// Zoom of pixel rectangles.
    pub zoom: [f32; 2],
    /// Pixel transfer.
    pub transfer: Transfer,
}

impl Default for State {
    fn default() -> State {
        let black = [0.0, 0.0, 0.0, 1.0];
        let white = [1.0; 4];
        let mut light = Light {
            ambient: black,
            diffuse: black,
            specular: black,
            position: [0.0, 0.0, 1.0, 0.0],
            spot_direction: [0.0, 0.0, -1.0],
            spot_exponent: 0.0,
            spot_cutoff: 180.0,
            attenuation: [1.0, 0.0, 0.0],
            derived: Derived::default(),
        };
        light.derive();
        let mut lights: [Light; LIGHTS] = std::array::from_fn(|_| light.clone());
        (lights[0].diffuse, lights[0].specular) = (white, white);
        let material = Material {
            ambient: [0.2, 0.2, 0.2, 1.0],
            diffuse: [0.8, 0.8, 0.8, 1.0],
            specular: black,
            emission: black,
            shininess: 0.0,
        };
        let stencil = Stencil { compare: e::ALWAYS, reference: 0, read: !0, ops: [e::KEEP; 3], write: !0 };
        let first = Vertex::default();
        State {
            current: first.clone(),
            enabled: capability(e::DITHER).unwrap_or(0) | capability(e::MULTISAMPLE).unwrap_or(0),
            programs: 0,
            viewport: [0; 4],
            depth_range: [0.0, 1.0],
            matrix_mode: e::MODELVIEW,
            planes: [[0.0; 4]; PLANES],
            lights,
            model_ambient: [0.2, 0.2, 0.2, 1.0],
            local_viewer: false,
            two_side: false,
            separate_specular: false,
            materials: [material.clone(), material],
            color_material: [e::FRONT_AND_BACK, e::AMBIENT_AND_DIFFUSE],
            flat: false,
            provoking_first: false,
            fog_mode: e::EXP,
            fog_color: [0.0; 4],
            fog: [1.0, 0.0, 1.0],
            fog_distance: FogDistance::Absolute,
            fog_from_coordinate: false,
            cull: e::BACK,
            front: e::CCW,
            polygon_modes: [e::FILL; 2],
            polygon_offset: [0.0; 2],
            stipple: [!0; 32],
            line_width: 1.0,
            line_stipple: (1, 0xffff),
            point_size: 1.0,
            point_limits: [0.0, 2048.0, 1.0],
            point_attenuation: [1.0, 0.0, 0.0],
            point_sprites: 0,
            sprites_up: false,
            depth_func: e::LESS,
            depth_write: true,
            clear_depth: 1.0,
            stencil: [stencil; 2],
            stencil_face: None,
            clear_stencil: 0,
            alpha: (e::ALWAYS, 0.0),
            writes: [ColorWrites::default(); COLORS_MAX],
            blend_color: [0.0; 4],
            logic: e::COPY,
            clear_color: [0.0; 4],
            draw_buffer: e::BACK,
            scissor: [0; 4],
            units: vec![Unit::default(); UNITS],
            active: 0,
            list_base: 0,
            grids: [(1, 0.0, 1.0); 2],
            raster: Some([0.0, 0.0, 0.0, 1.0]),
            raster_vertex: first.clone(),
            zoom: [1.0; 2],
            transfer: Transfer::default(),
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
    /// Makes sure that a texture unit is among those that are stored.
    pub fn reach(&mut self, unit: usize) {
        if self.units.len() <= unit {
            self.units.resize(unit + 1, Unit::default());
        }
    }

    /// Whether a capability is enabled.
    pub fn is(&self, cap: u32) -> bool {
        capability(cap).is_some_and(|bit| self.enabled & bit != 0)
    }

    /// Restores the attribute groups of `mask` from a saved state.
    pub fn restore(&mut self, mask: u32, saved: State) {
        let caps = capabilities_of(mask);
        self.enabled = self.enabled & !caps | saved.enabled & caps;
        let has = |bit: u32| mask & bit != 0;
        macro_rules! take {
            ($bit:expr => $($field:ident),+) => { if has($bit) { $(self.$field = saved.$field.clone();)+ } };
        }
        take!(e::CURRENT_BIT => current, raster, raster_vertex);
        take!(e::ENABLE_BIT => programs);
        take!(e::VIEWPORT_BIT => viewport, depth_range);
        take!(e::TRANSFORM_BIT => matrix_mode, planes);
        take!(e::LIGHTING_BIT => lights, model_ambient, local_viewer, two_side, separate_specular, materials, color_material, flat, provoking_first);
        take!(e::FOG_BIT => fog_mode, fog_color, fog, fog_distance, fog_from_coordinate);
        take!(e::POLYGON_BIT => cull, front, polygon_modes, polygon_offset);
        take!(e::POLYGON_STIPPLE_BIT => stipple);
        take!(e::LINE_BIT => line_width, line_stipple);
        take!(e::POINT_BIT => point_size, point_limits, point_attenuation, point_sprites, sprites_up);
        take!(e::DEPTH_BUFFER_BIT => depth_func, depth_write, clear_depth);
        take!(e::STENCIL_BUFFER_BIT => stencil, stencil_face, clear_stencil);
        take!(e::COLOR_BUFFER_BIT => alpha, writes, blend_color, logic, clear_color, draw_buffer);
        if has(e::ENABLE_BIT) {
            for (writes, old) in self.writes.iter_mut().zip(&saved.writes) {
                writes.blended = old.blended;
            }
        }
        take!(e::SCISSOR_BIT => scissor);
        take!(e::LIST_BIT => list_base);
        take!(e::EVAL_BIT => grids);
        take!(e::PIXEL_MODE_BIT => zoom, transfer);
        if has(e::TEXTURE_BIT) {
            self.active = saved.active;
        }
        let unused = Unit::default();
        for (unit, old) in self.units.iter_mut().zip(saved.units.iter().chain(std::iter::repeat(&unused))) {
            if has(e::TEXTURE_BIT) {
                unit.clone_from(old);
            } else if has(e::ENABLE_BIT) {
                (unit.enabled, unit.generated) = (old.enabled, old.generated);
            }
        }
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
