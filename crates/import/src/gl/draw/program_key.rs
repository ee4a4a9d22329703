//! The fixed-function stages that remain beside programs.

use gl_shader::arb::program::{Output, input};
use gl_shader::consts as e;
use gl_shader::expand::BOTH_ENDS_MAX;
use gl_shader::key::*;

use crate::gl::call::{Fault, GlResult};
use crate::gl::geometry::primitive::{Batch, Class};
use crate::gl::machine::Gl;
use crate::gl::state::arb::{ActiveProgram, switch};

impl Gl {
    /// Changes the fixed-function key for the stages that programs replace.
    pub fn programmed(
        &self,
        key: &mut ShaderKey,
        batch: &Batch,
        vertex: Option<&ActiveProgram>,
        fragment: Option<&ActiveProgram>,
    ) -> GlResult {
        if let Some(active) = fragment {
            let inputs = active.program.inputs;
            key.fragment = Some(FragmentKey { number: active.number, inputs });
            key.fog = active.program.fog;
            key.fog_coordinate = self.state.fog.from_coordinate;
            key.color_sum = inputs & 1 << input::SECONDARY != 0 && key.lighting.is_none();
        }
        if let Some(active) = vertex {
            let (program, on) = (&active.program, |bit: u8| self.state.programs & bit != 0);
            key.vertex = Some(VertexKey {
                number: active.number,
                inputs: program.inputs,
                two_side: on(switch::TWO_SIDE) && batch.class == Class::Triangles,
                size: on(switch::POINT_SIZE) && program.outputs.contains(&Output::PointSize),
                invariant: program.invariant,
            });
            let clips = program.code.as_ref().is_some_and(|code| code.clip.is_some());
            if !program.invariant && !clips && program.code.is_some() && key.planes != 0 {
                return Err(Fault::Unsupported("clip planes with a vertex shader without gl_ClipVertex".into()));
            }
            if !program.invariant {
                if !clips {
                    key.planes = 0;
                }
                let faces = batch.polygon.is_some()
                    && (self.state.is(e::CULL_FACE) || self.state.polygon.modes[0] != self.state.polygon.modes[1]);
                let repeatable = program.code.as_ref().is_none_or(|code| code.is_repeatable());
                let (wide, many) = (key.both_ends(), program.inputs.count_ones() > BOTH_ENDS_MAX);
                let refused = [
                    (batch.class == Class::Lines && self.line_stippled(), "stippled lines"),
                    (faces, "polygons as lines or points, by their face,"),
                    // An offset without slope is the same for all polygons.
                    (key.offset && self.state.polygon.offset[0] != 0.0, "polygons as lines or points, offset by their slope,"),
                    (wide && key.planes != 0, "wide lines and clip planes"),
                    (wide && many, "wide lines of many attributes"),
                    (wide && !repeatable, "wide lines, initial values of variables or interpolation without perspective,"),
                ];
                if let Some((_, what)) = refused.into_iter().find(|of| of.0) {
                    return Err(Fault::Unsupported(format!("{what} with a vertex program that computes positions")));
                }
            }
            key.lighting = None;
            key.normalize = 0;
            key.attenuated_point = false;
            key.projective_eye = false;
            key.back = false;
            key.color_sum = self.state.is(e::COLOR_SUM);
            key.fog_coordinate = true;
            let sprite = key.units.iter().any(|unit| unit.sprite);
            let size = key.vertex.is_some_and(|vertex| vertex.size);
            if batch.class == Class::Points && key.expand != Expand::SmoothPoint {
                key.expand = if size || sprite || self.state.point.size > 1.0 { Expand::Point } else { Expand::No };
            }
        }
        Ok(())
    }
}
