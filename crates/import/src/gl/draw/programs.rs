//! The programs that a draw uses, and the values of their parameters.

use std::rc::Rc;

use gl_shader::arb::program::ProgramStage;
use gl_shader::glsl::stage;
use naga::ScalarKind;

use crate::gl::call::{Fault, GlResult, INVALID_OPERATION};
use crate::gl::draw::program_values::{self, state};
use crate::gl::machine::Gl;
use crate::gl::state::arb::{ActiveProgram, NumberedProgram};
use crate::gl::state::glsl::CodeKey;

impl Gl {
    /// The stage of the current program.
    pub fn glsl_program(&mut self, stage: ProgramStage) -> GlResult<Option<ActiveProgram>> {
        let index = stage as usize - 1;
        let object = self.objects.glsl.programs.get(self.context.glsl_program).ok_or(INVALID_OPERATION)?;
        let refused =
            |reason: &str| Fault::Unsupported(format!("drawing with GLSL program {}: {reason}", self.context.glsl_program));
        let linked = match &object.executable.linked {
            None => return Err(INVALID_OPERATION),
            Some(Err(reason)) => return Err(refused(reason)),
            Some(Ok(linked)) => linked,
        };
        let Some(translated) = &linked.stages[index] else { return Ok(None) };
        let unit = |name: &str| object.executable.units.get(name).copied().unwrap_or(0);
        let units = translated.samplers.iter().map(|sampler| unit(&sampler.name)).collect();
        let attribute = |name: &str| object.attributes.get(name).copied();
        let output = |name: &str| object.outputs.get(name).copied();
        let location =
            |name: &str| if stage == ProgramStage::Vertex { attribute(name).map(|at| [at, 0]) } else { output(name) };
        let chosen = translated.variables.iter().map(|variable| location(&variable.global.name)).collect();
        let key: CodeKey = (linked.number, stage, units, chosen);
        let loaded = match self.glsl.codes.get(&key) {
            Some(loaded) => loaded.clone(),
            None => {
                let joints = stage::Joints { attribute: &attribute, output: &output, unit: &unit };
                let program = stage::program(linked.stages(), stage, &joints);
                let number = self.programs.number();
                let loaded = program.map(|program| NumberedProgram { number, program: Rc::new(program) });
                self.glsl.codes.insert(key, loaded.clone());
                loaded
            }
        };
        let object = self.objects.glsl.programs.get(self.context.glsl_program).ok_or(INVALID_OPERATION)?;
        let NumberedProgram { number, program } = loaded.map_err(|reason| refused(&reason))?;
        let given = object.executable.values[index].iter().zip(&translated.slots);
        let values = given.map(|(value, slot)| match slot {
            None => *value,
            Some((param, component)) => {
                let mut value = state(self, *param);
                value.rotate_left(usize::from(*component));
                value
            }
        });
        let mut values: Vec<[f32; 4]> = values.collect();
        for of in &translated.filled {
            let block = &translated.blocks[of.block];
            let binding = object.executable.bindings.get(&block.name).copied().or(block.binding).unwrap_or(0);
            let bytes = self.uniform_bytes(binding)?;
            for k in 0..of.components {
                // What is behind the end of a buffer is zero, as in Mesa.
                let at = of.offset + 4 * k;
                let word = bytes.get(at..at + 4).map_or([0; 4], |word| [word[0], word[1], word[2], word[3]]);
                let word = u32::from_le_bytes(word);
                let value = if of.kind == ScalarKind::Bool { f32::from(u8::from(word != 0)) } else { f32::from_bits(word) };
                values[of.slot][k] = value;
            }
        }
        Ok(Some(ActiveProgram { number, program, values }))
    }
}

impl Gl {
    /// The enabled program of a stage.
    pub fn active_program(&mut self, stage: ProgramStage) -> GlResult<Option<ActiveProgram>> {
        if self.context.glsl_program != 0 {
            return self.glsl_program(stage);
        }
        if self.state.programs & stage as u8 == 0 {
            return Ok(None);
        }
        let object = self.objects.programs.bound(&self.context.programs, stage).clone();
        match object.text {
            // Drawing without a program is an error.
            None => Err(INVALID_OPERATION),
            Some(Err(reason)) => Err(Fault::Unsupported(format!("drawing with a program whose {reason}"))),
            Some(Ok(NumberedProgram { number, program })) => {
                let environment = self.context.programs.environment(stage);
                let values = program_values::values(self, &program, environment, &object.local);
                Ok(Some(ActiveProgram { number, program, values }))
            }
        }
    }
}
