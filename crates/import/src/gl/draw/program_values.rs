//! The values of a program's parameters in the machine's state.

use gl_shader::arb::program::*;
use glam::{Mat4, Vec3, vec3};

use crate::gl::machine::Gl;
use crate::gl::matrix;
use crate::gl::state::lighting::Light;

/// The values of all parameters of a program.
pub fn values(gl: &Gl, program: &Program, environment: &[[f32; 4]], local: &[[f32; 4]]) -> Vec<[f32; 4]> {
    let given = |list: &[[f32; 4]], k: u32| list.get(k as usize).copied().unwrap_or_default();
    program
        .params
        .iter()
        .map(|param| match *param {
            Param::Literal(value) => value,
            Param::Environment(k) => given(environment, k),
            Param::Local(k) => given(local, k),
            other => state(gl, other),
        })
        .collect()
}

/// The value of a parameter that is bound to the machine's state.
pub fn state(gl: &Gl, param: Param) -> [f32; 4] {
    let state = &gl.state;
    let wide = |[x, y, z]: [f32; 3], w: f32| [x, y, z, w];
    let material = |face: u8, term: Term| {
        let m = &state.lighting.materials[usize::from(face)];
        match term {
            Term::Ambient => m.ambient,
            Term::Diffuse => m.diffuse,
            Term::Specular => m.specular,
            Term::Emission => m.emission,
            _ => [m.shininess, 0.0, 0.0, 1.0],
        }
    };
    match param {
        Param::Literal(_) | Param::Environment(_) | Param::Local(_) => [0.0; 4],
        Param::Material(face, term) => material(face, term),
        Param::Light(k, term) => light(&state.lighting.lights[usize::from(k)], term),
        Param::ModelAmbient => state.lighting.model_ambient,
        Param::SceneColor(face) => {
            let (ambient, emission) = (material(face, Term::Ambient), material(face, Term::Emission));
            let sum = std::array::from_fn(|c| emission[c] + state.lighting.model_ambient[c] * ambient[c]);
            wide(sum, material(face, Term::Diffuse)[3])
        }
        Param::Product(k, face, term) => {
            let (a, b) = (light(&state.lighting.lights[usize::from(k)], term), material(face, term));
            std::array::from_fn(|c| a[c] * b[c])
        }
        Param::Generation(unit, eye, coordinate) => {
            let generation = &state.texturing.units[usize::from(unit)].generation[usize::from(coordinate)];
            if eye { generation.eye } else { generation.object }
        }
        Param::Environ(unit) => state.texturing.units[usize::from(unit)].environment.color,
        Param::Instance => [f32::from_bits(gl.drawing.instance); 4],
        Param::NormalScale => [matrix::normal_scale(&gl.context.matrices.modelview.top); 4],
        Param::FogColor => state.fog.color,
        Param::FogTerms => {
            let [density, start, end] = state.fog.terms;
            [density, start, end, if end == start { 1.0 } else { 1.0 / (end - start) }]
        }
        Param::Plane(plane) => state.transform.planes[usize::from(plane)],
        Param::PointSize => {
            let [least, most, fade] = state.point.limits;
            [state.point.size, least, most, fade]
        }
        Param::PointAttenuation => wide(state.point.attenuation, 1.0),
        Param::DepthRange => {
            let [near, far] = state.transform.depth_range;
            [near, far, far - near, 1.0]
        }
        Param::Row { matrix, inverse, transpose, row } => {
            let mut m = match matrix {
                Matrix::Modelview => gl.context.matrices.modelview.top,
                Matrix::Projection => gl.context.matrices.projection.top,
                Matrix::Mvp => gl.context.matrices.projection.top * gl.context.matrices.modelview.top,
                Matrix::Texture(unit) => gl.context.matrices.texture[usize::from(unit)].top,
                Matrix::Program(k) => gl.context.programs.matrices[usize::from(k)].top,
            };
            if inverse {
                m = matrix::inverse(&m).unwrap_or(Mat4::IDENTITY);
            }
            if transpose {
                m = m.transpose();
            }
            m.row(usize::from(row)).to_array()
        }
    }
}

fn light(light: &Light, term: Term) -> [f32; 4] {
    let [x, y, z, w] = light.position;
    match term {
        Term::Ambient => light.ambient,
        Term::Diffuse => light.diffuse,
        Term::Specular => light.specular,
        Term::Attenuation => {
            let [a, b, c] = light.attenuation;
            [a, b, c, light.spot_exponent]
        }
        Term::Spot => {
            let [x, y, z] = light.spot_direction;
            [x, y, z, libm::cos(f64::from(light.spot_cutoff).to_radians()) as f32]
        }
        Term::Cutoff => [light.spot_cutoff, 0.0, 0.0, 1.0],
        Term::Half => {
            let half = (vec3(x, y, z).normalize_or_zero() + Vec3::Z).normalize_or_zero();
            half.extend(1.0).to_array()
        }
        _ => [x, y, z, w],
    }
}
