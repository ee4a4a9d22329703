//! The uniforms of a draw. One list of fields both declares the block and fills it.

use gl_shader::arb::program::{GENERICS, input};
use gl_shader::key::{EnvironmentKey, ShaderKey, TexGenMode};
use gl_shader::wgsl::Field;
use gl_shader::{UNITS, consts as e};
use glam::Mat4;

use crate::gl::draw::pipeline::source_scale;
use crate::gl::geometry::clip::to_clip;
use crate::gl::geometry::vertex::Vertex;
use crate::gl::matrix;
use crate::gl::state::arb::ActiveProgram;
use crate::gl::state::lighting::Derived;
use crate::gl::state::prepared::Sampling;
use crate::gl::state::server::State;
use crate::gl::state::transform::Stack;

/// The values from which uniforms are computed.
pub struct UniformInputs<'a> {
    /// The state.
    pub state: &'a State,
    /// The modelview matrix.
    pub modelview: &'a Mat4,
    /// The projection matrix.
    pub projection: &'a Mat4,
    /// Texture matrices.
    pub texture: &'a [Stack; UNITS],
    /// Attributes that are the same for all vertices.
    pub constant: &'a Vertex,
    /// How the texture of each unit of the key is sampled.
    pub sampling: &'a [Sampling],
    /// The height of the render target in pixels.
    pub height: u32,
    /// Whether the first row of the render target is the lowest.
    pub upward: bool,
    /// How many times the program's viewport that of points and lines that become triangles is.
    pub wider: [f32; 2],
    /// The uniforms of a drawn pixel rectangle ([`crate::gl::state::prepared::PixelRectangle`]).
    pub pixels: [[f32; 4]; 4],
    /// The vertex program.
    pub vertex: Option<&'a ActiveProgram>,
    /// The fragment program.
    pub fragment: Option<&'a ActiveProgram>,
}

/// Called for a field with its name, the index of the element if it is an array, and its vectors.
pub type Visit<'a> = &'a mut dyn FnMut(&'static str, Option<usize>, &[[f32; 4]]);

/// The size of a point without smoothing: an integer (OpenGL 1.5, section 3.3.1). Rounding of a half is left open; llvmpipe rounds down.
fn whole_point(size: f32) -> f32 {
    (size - 0.5).ceil().max(1.0)
}

/// The reference with which alpha is compared, and how much both may differ where they have to be equal. Alpha and the reference have eight
/// bits (OpenGL 1.5, section 4.1.4): not alpha is rounded, but the reference is moved to where roundings change.
fn alpha_reference(compare: u32, reference: f32, float: bool) -> [f32; 4] {
    if float {
        return [reference, 0.0, 0.0, 0.0];
    }
    const HALF: f32 = 0.5 / 255.0;
    let code = (reference * 255.0).round() / 255.0;
    let moved = match compare {
        e::LESS | e::GEQUAL => code - HALF,
        e::LEQUAL | e::GREATER => code + HALF,
        _ => code,
    };
    [moved, HALF, 0.0, 0.0]
}

/// Visits all fields of a shader with this key, in order.
fn visit(key: &ShaderKey, source: &UniformInputs, field: Visit) {
    let (state, constant) = (source.state, source.constant);
    let wide = |v: [f32; 3], w: f32| [v[0], v[1], v[2], w];
    let mut mvp = to_clip(source.projection, source.modelview);
    if source.upward {
        for column in [&mut mvp.x_axis, &mut mvp.y_axis, &mut mvp.z_axis, &mut mvp.w_axis] {
            column.y *= -1.0;
        }
    }
    field("mvp", None, &mvp.to_cols_array_2d());
    if key.eye() {
        field("modelview", None, &source.modelview.to_cols_array_2d());
    }
    if key.normal() && key.vertex.is_none() {
        let normals = matrix::normal_matrix(source.modelview);
        field("normal_matrix", None, &normals.to_cols_array_2d().map(|column| wide(column, 0.0)));
        if key.normalize == 2 {
            field("rescale", None, &[[matrix::normal_scale(source.modelview); 4]]);
        }
    }
    if key.normal() && !key.varying.normal {
        field("normal", None, &[wide(constant.normal, 0.0)]);
    }
    if key.color() && !key.varying.color {
        field("color", None, &[constant.color]);
    }
    if key.vertex_secondary() && !key.varying.secondary {
        field("secondary", None, &[wide(constant.secondary, 0.0)]);
    }
    if key.fog.is_some() {
        let [density, start, end] = state.fog.terms;
        field("fog_color", None, &[state.fog.color]);
        let scale = if end == start { 1.0 } else { 1.0 / (end - start) };
        field("fog_terms", None, &[[density, start, end, scale]]);
    }
    if key.vertex_fog() && !key.varying.fog {
        field("fog_coordinate", None, &[[constant.fog; 4]]);
    }
    for k in (0..UNITS).filter(|&k| key.vertex_texture(k) && !key.varying.texture[k]) {
        field("texture", Some(k), &[constant.texture(k)]);
    }
    for k in (1..GENERICS).filter(|&k| key.reads(input::GENERIC + k as u32) && key.varying.generic & 1 << k == 0) {
        field("generic", Some(k), &[constant.generic(k)]);
    }
    if key.vertex.is_some_and(|vertex| !vertex.invariant) {
        field("upward", None, &[[if source.upward { -1.0 } else { 1.0 }; 4]]);
    }
    for (name, program) in [("vertex_params", source.vertex), ("fragment_params", source.fragment)] {
        if let Some(program) = program.filter(|program| !program.values.is_empty()) {
            field(name, None, &program.values);
        }
    }
    lighting(key, source, field);
    for (unit, sampling) in key.units.iter().zip(source.sampling) {
        let (k, of) = (unit.unit, &state.texturing.units[unit.unit]);
        let planes = |wanted: TexGenMode, plane: &dyn Fn(usize) -> [f32; 4]| {
            let any = unit.made.contains(&Some(wanted));
            any.then(|| std::array::from_fn::<_, 4, _>(plane))
        };
        if let Some(planes) = planes(TexGenMode::Object, &|k| of.generation[k].object) {
            field("object_planes", Some(k), &planes);
        }
        if let Some(planes) = planes(TexGenMode::Eye, &|k| of.generation[k].eye) {
            field("eye_planes", Some(k), &planes);
        }
        if unit.matrix {
            field("texture_matrix", Some(k), &source.texture[k].top.to_cols_array_2d());
        }
        if unit.border {
            field("border", Some(k), &[sampling.border]);
        }
        if unit.bias {
            field("bias", Some(k), &[[sampling.bias; 4]]);
        }
        let constant = match &unit.environment {
            EnvironmentKey::Mode(mode) => *mode == e::BLEND,
            EnvironmentKey::Combine(_, sources, _, _) => sources.iter().flatten().any(|&source| source == e::CONSTANT),
        };
        if constant {
            field("environment", Some(k), &[of.environment.color]);
        }
        if let EnvironmentKey::Combine(.., true) = unit.environment {
            let [rgb, alpha] = of.environment.scales;
            field("scales", Some(k), &[[rgb, rgb, rgb, alpha]]);
        }
    }
    if key.colors.scaled {
        let [r, g, b] = source_scale(state).unwrap_or([1.0; 3]);
        field("blend_scale", None, &[[r, g, b, 1.0]]);
    }
    if let Some(compare) = key.alpha {
        field("alpha_reference", None, &[alpha_reference(compare, state.color.alpha_test.1, key.colors.float)]);
    }
    for plane in 0..state.transform.planes.len() {
        if key.planes & 1 << plane != 0 {
            field("plane", Some(plane), &[state.transform.planes[plane]]);
        }
    }
    let place = key.fragment.is_some_and(|fragment| fragment.inputs & 1 << input::POSITION != 0);
    if key.stipple {
        let rows: [[f32; 4]; 8] =
            std::array::from_fn(|k| std::array::from_fn(|i| f32::from_bits(state.polygon.stipple[4 * k + i])));
        field("stipple", None, &rows);
    }
    if key.stipple || key.pixels || place {
        // Converts the card's rows to rows counted from the bottom, and these to rows from the top.
        let [first, step] = if source.upward { [0.0, 1.0] } else { [source.height as f32, -1.0] };
        field("height", None, &[[first, step, source.height as f32, 0.0]]);
    }
    if key.pixels {
        field("pixels", None, &source.pixels);
    }
    if key.expand != gl_shader::key::Expand::No {
        let [_, _, width, height] = state.transform.viewport.map(|value| value as f32);
        let lines = matches!(key.expand, gl_shader::key::Expand::Line | gl_shader::key::Expand::SmoothLine);
        let size = if lines { state.line.width } else { state.point.size };
        // Without smoothing, widths are whole.
        let size = match key.expand {
            gl_shader::key::Expand::Line => (size + 0.5).floor().max(1.0),
            gl_shader::key::Expand::Point if !key.attenuated_point && !state.is(e::POINT_SPRITE) => whole_point(size),
            _ => size,
        };
        field("screen", None, &[[0.5 * width, 0.5 * height, size, f32::from(u8::from(!source.upward))]]);
        let [x, y] = source.wider;
        field("part", None, &[[1.0 / x, 1.0 / y, 0.0, 0.0]]);
        if key.attenuated_point {
            field("point_attenuation", None, &[wide(state.point.attenuation, 0.0)]);
            field("point_limits", None, &[wide(state.point.limits, 0.0)]);
        }
    }
}

fn lighting(key: &ShaderKey, source: &UniformInputs, field: Visit) {
    let Some(lighting) = &key.lighting else { return };
    let state = source.state;
    field("model_ambient", None, &[state.lighting.model_ambient]);
    for (face, name) in ["front_material", "back_material"].into_iter().enumerate() {
        let wanted = if lighting.two_side { true } else { (face == 1) == key.back };
        if wanted {
            let m = &state.lighting.materials[face];
            let [r, g, b, _] = m.specular;
            field(name, None, &[m.ambient, m.diffuse, [r, g, b, m.shininess], m.emission]);
        }
    }
    let lights =
        (0..state.lighting.lights.len()).filter(|&k| state.is(e::LIGHT0 + k as u32)).map(|k| &state.lighting.lights[k]);
    for (k, light) in lights.enumerate() {
        let Derived { position, half, spot } = light.derived;
        let [a, b, c] = light.attenuation;
        let terms = [light.spot_exponent, a, b, c];
        field("light", Some(k), &[light.ambient, light.diffuse, light.specular, position, half, terms, spot]);
    }
}

/// The fields of the block.
pub fn fields(key: &ShaderKey, source: &UniformInputs) -> Vec<Field> {
    let mut fields = Vec::new();
    visit(key, source, &mut |name, index, vectors| fields.push(Field { name, index, count: vectors.len() }));
    fields
}

/// The bytes of the block.
pub fn bytes(key: &ShaderKey, source: &UniformInputs) -> Vec<u8> {
    // Most blocks are smaller. A vector that grows with each field is copied again and again.
    let mut bytes = Vec::with_capacity(1024);
    visit(key, source, &mut |_, _, vectors| {
        for vector in vectors {
            bytes.extend_from_slice(vector.map(f32::to_le_bytes).as_flattened());
        }
    });
    bytes
}

#[cfg(test)]
mod tests {
    #[test]
    fn alpha_is_compared_in_eight_bits() {
        use super::{alpha_reference, e};
        let passes = |compare: u32, alpha: u8, off: f32| {
            let (alpha, [reference, half, ..]) = ((f32::from(alpha) + off) / 255.0, alpha_reference(compare, 0.5, false));
            match compare {
                e::LESS => alpha < reference,
                e::LEQUAL => alpha <= reference,
                e::GREATER => alpha > reference,
                e::GEQUAL => alpha >= reference,
                _ => (alpha - reference).abs() <= half,
            }
        };
        // 0.5 is 128 of 255.
        for off in [-0.4, 0.0, 0.4] {
            let of = |compare: u32| [127, 128, 129].map(|alpha| passes(compare, alpha, off));
            assert_eq!(of(e::LESS), [true, false, false]);
            assert_eq!(of(e::LEQUAL), [true, true, false]);
            assert_eq!(of(e::EQUAL), [false, true, false]);
            assert_eq!(of(e::GEQUAL), [false, true, true]);
            assert_eq!(of(e::GREATER), [false, false, true]);
        }
        assert_eq!(alpha_reference(e::GREATER, 0.3, true), [0.3, 0.0, 0.0, 0.0]);
    }

    #[test]
    fn points_have_whole_sizes() {
        let sizes = [0.2, 1.0, 1.5, 1.6, 2.0, 2.5, 2.51, 3.4].map(super::whole_point);
        assert_eq!(sizes, [1.0, 1.0, 1.0, 2.0, 2.0, 2.0, 3.0, 3.0]);
    }
}
