//! The key of a draw's shader: only what the current state requires.

use gl_shader::arb::program::{GENERICS, input};
use gl_shader::key::*;
use gl_shader::{PLANES, UNITS, consts as e};
use glam::{Mat4, Vec4};

use crate::gl::call::{Fault, GlResult, INVALID_OPERATION};
use crate::gl::geometry::primitive::{Batch, Class, SentAttributes};
use crate::gl::geometry::summary::Summary;
use crate::gl::machine::Gl;
use crate::gl::state::bindings::{GONE, missing};
use crate::gl::state::materials::{tracked_parameters, tracks};
use crate::gl::state::texture::BoundTexture;
use crate::gl::state::texturing::{COMBINE4, DOT3_RGB, DOT3_RGBA, kind_of, later};

impl Gl {
    /// The key of a unit, and the texture of a target if it is complete.
    pub fn unit(&mut self, unit: usize, target: Option<usize>, class: Class) -> GlResult<(UnitKey, Option<BoundTexture>)> {
        let bound = match target {
            None => None,
            Some(target) => {
                let name = self.state.texturing.units[unit].bound[target];
                if [name, self.context.samplers.bound[unit]].contains(&GONE) {
                    return Err(missing(GONE, INVALID_OPERATION));
                }
                self.texture(unit, target);
                let (table, key) = if name == 0 {
                    (&mut self.objects.default_textures, target as u32)
                } else {
                    (&mut self.objects.textures, name)
                };
                match table.get_mut(key) {
                    Some(texture) => match self.objects.samplers.get_mut(self.context.samplers.bound[unit]) {
                        Some(sampler) => {
                            texture.exchange_sampling(sampler);
                            let bound = texture.bind(&mut self.card);
                            texture.exchange_sampling(sampler);
                            bound?
                        }
                        None => texture.bind(&mut self.card)?,
                    },
                    None => None,
                }
            }
        };
        let state = &self.state.texturing.units[unit];
        let made: [Option<TexGenMode>; 4] = std::array::from_fn(|k| {
            let on = state.generated & 1 << k != 0;
            on.then(|| match state.generation[k].mode {
                e::OBJECT_LINEAR => TexGenMode::Object,
                e::SPHERE_MAP => TexGenMode::Sphere,
                e::REFLECTION_MAP => TexGenMode::Reflection,
                e::NORMAL_MAP => TexGenMode::Normal,
                _ => TexGenMode::Eye,
            })
        });
        // Further units are read by programs alone.
        let fixed = unit < UNITS;
        let m = if fixed { self.context.matrices.texture[unit].top } else { Mat4::IDENTITY };
        let env = &state.environment;
        let environment = match env.mode {
            e::COMBINE => {
                // What the fourth argument is does not matter.
                let three = |of: [[u32; 4]; 2]| of.map(|[a, b, c, _]| [a, b, c, 0]);
                let dot = matches!(env.combine[0], DOT3_RGB | DOT3_RGBA);
                if dot && env.scales[0] != 1.0 {
                    return Err(Fault::Unsupported("dot products of EXT_texture_env_dot3 with a scale".into()));
                }
                let functions = [later(env.combine[0]), env.combine[1]];
                EnvironmentKey::Combine(functions, three(env.sources), three(env.operands), env.scales != [1.0; 2])
            }
            COMBINE4 => {
                if env.combine.iter().any(|function| ![e::ADD, e::ADD_SIGNED].contains(function)) {
                    return Err(Fault::Unsupported(
                        "GL_COMBINE4_NV with a function other than GL_ADD and GL_ADD_SIGNED".into(),
                    ));
                }
                EnvironmentKey::Combine(env.combine.map(|of| of | FOUR), env.sources, env.operands, env.scales != [1.0; 2])
            }
            mode => EnvironmentKey::Mode(mode),
        };
        let sprite =
            fixed && class == Class::Points && self.state.is(e::POINT_SPRITE) && self.state.point.sprites & 1 << unit != 0;
        let key = UnitKey {
            unit,
            coordinates: false,
            sampled: false,
            kind: target.map_or(TextureShape::D2, kind_of),
            base: bound.as_ref().map_or(Base::Rgba, |bound| bound.base),
            swizzle: bound.as_ref().map_or([0, 1, 2, 3], |bound| bound.swizzle),
            face_edges: !self.context.samplers.seamless && bound.as_ref().is_some_and(|bound| bound.face_edges),
            border: bound.as_ref().is_some_and(|bound| bound.border.is_some()),
            clamp: bound.as_ref().map_or([false; 3], |bound| bound.clamp),
            mirror: bound.as_ref().map_or([false; 3], |bound| bound.mirror),
            depth: bound.as_ref().map_or(DepthRead::No, |bound| bound.depth),
            matrix: m != Mat4::IDENTITY && !sprite,
            projective: made[3].is_some() || m.row(3) != Vec4::W,
            bias: env.bias + bound.as_ref().map_or(0.0, |bound| bound.bias) != 0.0,
            made,
            sprite,
            sprite_up: sprite && self.state.point.sprites_up,
            environment,
        };
        Ok((key, bound))
    }

    /// The key of a draw whose units have these keys, into a target of this size.
    pub fn key(&self, batch: &Batch, summary: &Summary, mut units: Vec<UnitKey>, size: [u32; 2]) -> GlResult<ShaderKey> {
        let state = &self.state;
        for unit in units.iter_mut().filter(|unit| !unit.projective && !unit.sprite) {
            unit.projective = summary.projective(unit.unit);
        }
        let back = batch.polygon == Some(true) && state.lighting.two_side;
        let lighting = state.is(e::LIGHTING).then(|| {
            let lights = state.lighting.lights.iter().enumerate().filter(|(k, _)| state.is(e::LIGHT0 + *k as u32));
            let lights: Vec<LightKey> = lights
                .map(|(_, light)| LightKey {
                    directional: light.directional(),
                    spot: light.spot_cutoff != 180.0,
                    attenuated: light.attenuation != [1.0, 0.0, 0.0],
                })
                .collect();
            let color_material = tracked_parameters(state);
            let two_side = state.lighting.two_side && batch.class == Class::Triangles;
            let shiny = |face: usize| {
                state.lighting.materials[face].specular[..3] != [0.0; 3] || color_material.contains(&tracks::SPECULAR)
            };
            LightingKey {
                specular: !lights.is_empty() && (shiny(0) || two_side && shiny(1) || back && shiny(1)),
                lights,
                local_viewer: state.lighting.local_viewer,
                two_side,
                separate: state.lighting.separate_specular,
                color_material,
            }
        });
        let normalize = if state.is(e::NORMALIZE) { 1 } else { 2 * u8::from(state.is(e::RESCALE_NORMAL)) };
        let attenuated_point = batch.class == Class::Points && state.point.attenuation != [1.0, 0.0, 0.0];
        let sprite = units.iter().any(|unit| unit.sprite);
        let apart = batch.class != Class::Triangles && self.reaches_out_of(size);
        let expand = match batch.class {
            Class::Points if state.is(e::POINT_SMOOTH) && !state.is(e::POINT_SPRITE) => Expand::SmoothPoint,
            Class::Points if state.point.size > 1.0 || attenuated_point || sprite || apart => Expand::Point,
            Class::Lines if state.is(e::LINE_SMOOTH) => Expand::SmoothLine,
            Class::Lines if state.line.width >= 1.5 || apart => Expand::Line,
            _ => Expand::No,
        };
        Ok(ShaderKey {
            varying: Varying::default(),
            lighting,
            normalize,
            units,
            color_sum: state.is(e::COLOR_SUM) && !state.is(e::LIGHTING),
            flat: state.lighting.flat,
            fog: state.is(e::FOG).then_some(state.fog.mode),
            fog_distance: state.fog.distance,
            fog_coordinate: state.is(e::FOG) && state.fog.from_coordinate,
            alpha: (state.is(e::ALPHA_TEST) && state.color.alpha_test.0 != e::ALWAYS).then_some(state.color.alpha_test.0),
            planes: (0..PLANES).filter(|&k| state.is(e::CLIP_PLANE0 + k as u32)).fold(0, |all, k| all | 1 << k),
            stipple: batch.class == Class::Triangles && state.is(e::POLYGON_STIPPLE),
            offset: self.offsets(batch.class) && batch.vertices.iter().any(|vertex| vertex.offset != 0.0),
            pixels: self.drawing.pixels.is_some(),
            expand,
            attenuated_point,
            projective_eye: summary.position == 4 || self.context.matrices.modelview.top.row(3) != Vec4::W,
            back,
            vertex: None,
            fragment: None,
            colors: Colors::default(),
        })
    }
}

/// Attributes that come from the vertex buffer: those that are read and differ between vertices, and those that are always sent.
pub fn varying(batch: &Batch, summary: &Summary, key: &ShaderKey) -> Varying {
    let all = Varying { color: true, normal: true, secondary: true, fog: true, texture: [true; UNITS], generic: u16::MAX };
    let mut varying = if batch.sent == Some(SentAttributes::Read) { all } else { summary.varying };
    varying.color &= key.color();
    varying.normal &= key.normal();
    varying.secondary &= key.vertex_secondary();
    varying.fog &= key.vertex_fog();
    for unit in 0..UNITS {
        varying.texture[unit] &= key.vertex_texture(unit);
    }
    for k in 0..GENERICS {
        varying.generic &= !(u16::from(!key.reads(input::GENERIC + k as u32)) << k);
    }
    varying
}
