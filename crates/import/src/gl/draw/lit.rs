//! Lighting of one vertex, for raster positions (OpenGL 1.5, section 2.14.1). Vertices that are drawn are lit by the shader.

use gl_shader::consts as e;
use glam::{Mat4, Vec3, Vec4, vec3};

use crate::gl::geometry::vertex::Vertex;
use crate::gl::machine::Gl;
use crate::gl::matrix;
use crate::gl::state::server::{State, capability};

fn power(base: f32, exponent: f32) -> f32 {
    libm::pow(f64::from(base), f64::from(exponent)) as f32
}

/// The primary and secondary colour of a vertex of a polygon, by the side that it shows.
pub fn colors_of_side(state: &State, modelview: &Mat4, vertex: &Vertex, back: bool) -> ([f32; 4], [f32; 3]) {
    if !back || !state.lighting.two_side {
        return colors(state, modelview, vertex);
    }
    // The back is lit as the front of a surface whose normals point the other way.
    let mut turned = state.clone();
    turned.lighting.materials.swap(0, 1);
    turned.lighting.color_material[0] = match state.lighting.color_material[0] {
        e::FRONT => e::BACK,
        e::BACK => e::FRONT,
        both => both,
    };
    let mut vertex = vertex.clone();
    vertex.normal = vertex.normal.map(|value| -value);
    colors(&turned, modelview, &vertex)
}

/// The primary and secondary colour of a vertex.
pub fn colors(state: &State, modelview: &Mat4, vertex: &Vertex) -> ([f32; 4], [f32; 3]) {
    let unit = |value: f32| value.clamp(0.0, 1.0);
    if !state.is(e::LIGHTING) {
        return (vertex.color.map(unit), vertex.secondary.map(unit));
    }
    let mut material = state.lighting.materials[0].clone();
    if state.is(e::COLOR_MATERIAL) && state.lighting.color_material[0] != e::BACK {
        match state.lighting.color_material[1] {
            e::AMBIENT => material.ambient = vertex.color,
            e::DIFFUSE => material.diffuse = vertex.color,
            e::SPECULAR => material.specular = vertex.color,
            e::EMISSION => material.emission = vertex.color,
            _ => (material.ambient, material.diffuse) = (vertex.color, vertex.color),
        }
    }
    let eye = place(modelview, vertex);
    let n = eye_normal(state, modelview, vertex);
    let mut primary: [f32; 3] =
        std::array::from_fn(|c| material.emission[c] + material.ambient[c] * state.lighting.model_ambient[c]);
    let mut shine = [0.0; 3];
    for (_, light) in state.lighting.lights.iter().enumerate().filter(|(k, _)| state.is(e::LIGHT0 + *k as u32)) {
        let [lx, ly, lz, lw] = light.position;
        let (to_light, mut strength) = if lw == 0.0 {
            (vec3(lx, ly, lz).normalize_or_zero(), 1.0)
        } else {
            let way = vec3(lx, ly, lz) / lw - eye;
            let distance = way.length();
            let [constant, linear, quadratic] = light.attenuation;
            (way.normalize_or_zero(), 1.0 / (constant + distance * (linear + distance * quadratic)))
        };
        if light.spot_cutoff != 180.0 {
            let spot = -to_light.dot(Vec3::from(light.spot_direction).normalize_or_zero());
            let least = libm::cos(f64::from(light.spot_cutoff).to_radians()) as f32;
            strength *= if spot >= least { power(spot.max(0.0), light.spot_exponent) } else { 0.0 };
        }
        let facing = n.dot(to_light);
        let viewer = if state.lighting.local_viewer { (-eye).normalize_or_zero() } else { Vec3::Z };
        let half = (to_light + viewer).normalize_or_zero();
        let gloss = if facing > 0.0 { power(n.dot(half).max(0.0), material.shininess) } else { 0.0 };
        for c in 0..3 {
            primary[c] +=
                strength * (material.ambient[c] * light.ambient[c] + facing.max(0.0) * material.diffuse[c] * light.diffuse[c]);
            shine[c] += strength * gloss * material.specular[c] * light.specular[c];
        }
    }
    if !state.lighting.separate_specular {
        (primary, shine) = (std::array::from_fn(|c| primary[c] + shine[c]), [0.0; 3]);
    }
    let [r, g, b] = primary.map(unit);
    ([r, g, b, unit(material.diffuse[3])], shine.map(unit))
}

/// The place of a vertex in eye space.
fn place(modelview: &Mat4, vertex: &Vertex) -> Vec3 {
    let eye = *modelview * Vec4::from(vertex.position);
    eye.truncate() / eye.w
}

/// The normal of a vertex in eye space, as lighting has it.
fn eye_normal(state: &State, modelview: &Mat4, vertex: &Vertex) -> Vec3 {
    let n = matrix::normal_matrix(modelview) * Vec3::from(vertex.normal);
    if state.is(e::NORMALIZE) || state.is(e::RESCALE_NORMAL) { n.normalize_or_zero() } else { n }
}

/// One of the texture coordinates s, t, r that a map of the surroundings has (OpenGL 1.5, section 2.10.4); q stays as it is.
pub fn map_coordinate(state: &State, modelview: &Mat4, vertex: &Vertex, mode: u32, k: usize) -> f32 {
    let n = eye_normal(state, modelview, vertex);
    let way = place(modelview, vertex).normalize_or_zero();
    let reflected = way - 2.0 * n.dot(way) * n;
    match mode {
        e::SPHERE_MAP if k < 2 => {
            let m = 2.0 * (reflected + Vec3::Z).length();
            reflected[k] / m + 0.5
        }
        e::REFLECTION_MAP if k < 3 => reflected[k],
        e::NORMAL_MAP if k < 3 => n[k],
        _ => vertex.texture(0)[k],
    }
}

impl Gl {
    /// Gives vertices the colours that lighting gives them.
    pub fn light(&self, vertices: &mut [Vertex], back: bool) {
        for vertex in vertices {
            (vertex.color, vertex.secondary) = colors_of_side(&self.state, &self.context.matrices.modelview.top, vertex, back);
        }
    }

    /// The enabled capabilities for vertices that have been lit.
    pub fn without_lighting(&self) -> u64 {
        let bit = |cap: u32| capability(cap).unwrap_or(0);
        let enabled = self.state.enabled;
        if !self.state.is(e::LIGHTING) {
            return enabled;
        }
        let sum = if self.state.lighting.separate_specular { bit(e::COLOR_SUM) } else { 0 };
        enabled & !bit(e::LIGHTING) & !bit(e::COLOR_SUM) | sum
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gl::state::server::capability;

    #[test]
    fn a_raster_colour_is_lit_as_a_vertex() {
        let mut state = State::default();
        let mut vertex = state.current.clone();
        vertex.color = [0.25, 2.0, -1.0, 0.5];
        assert_eq!(colors(&state, &Mat4::IDENTITY, &vertex).0, [0.25, 1.0, 0.0, 0.5]);
        state.enabled |= capability(e::LIGHTING).unwrap_or(0) | capability(e::LIGHT0).unwrap_or(0);
        // Ambient 0.2 * 0.2 of the scene and diffuse 0.8 of a white light in front: 0.04 + 0.8.
        let (lit, _) = colors(&state, &Mat4::IDENTITY, &vertex);
        assert!(lit[..3].iter().all(|value| (value - 0.84).abs() < 1e-6) && lit[3] == 1.0, "{lit:?}");
        // At 60 degrees half of the diffuse light is left.
        let mut tilted = vertex;
        tilted.normal = [0.75_f32.sqrt(), 0.0, 0.5];
        let (lit, _) = colors(&state, &Mat4::IDENTITY, &tilted);
        assert!((lit[0] - 0.44).abs() < 1e-6, "{lit:?}");
    }
}
