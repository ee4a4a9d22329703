//! From a module's entry point to a program.

use naga::back::PipelineConstants;
use naga::back::pipeline_constants::process_overrides;

use super::assemble::assemble;
use super::interface::naga_stage;
use super::lower;
use super::module::{Module, ShaderError, chain};
use super::optimize;
use super::options::Options;
use super::program::Program;
use gfx::stage::Stage;
use host::{guarded, with_room_for};

/// Compiles an entry point. Without a name, the module's only one of the stage.
///
/// # Errors
/// If there is no such entry point, a constant is missing or unknown, or the program needs something that is not supported:
/// whatever is missing is reported here, with its name and place, and never when the program runs.
pub fn compile(module: &Module, stage: Stage, entry: Option<&str>, options: &Options<'_>) -> Result<Program, ShaderError> {
    let levels = module.limits.shader_nesting.get();
    with_room_for(levels, || compile_here(module, stage, entry, options)).unwrap_or_else(|message| {
        Err(ShaderError { module: module.name().to_owned(), entry: entry.map(str::to_owned), place: None, message })
    })
}

/// As [`compile`], on the stack of this thread.
fn compile_here(module: &Module, stage: Stage, entry: Option<&str>, options: &Options<'_>) -> Result<Program, ShaderError> {
    let fail = |entry: Option<&str>, message: String| ShaderError {
        module: module.name().to_owned(),
        entry: entry.map(str::to_owned),
        place: None,
        message,
    };
    let mut candidates = module.entry_points().filter(|(s, n)| *s == stage && entry.is_none_or(|e| e == *n));
    let Some((_, name)) = candidates.next() else {
        return Err(fail(entry, format!("there is no such entry point of the {stage:?} stage")));
    };
    if candidates.next().is_some() {
        return Err(fail(None, format!("there are several entry points of the {stage:?} stage; one must be named")));
    }
    let mut constants = PipelineConstants::default();
    for (key, value) in options.constants {
        constants.insert(key.clone(), *value);
    }
    let resolve = || {
        let entry = Some((naga_stage(stage), name));
        process_overrides(&module.ir, &module.info, entry, &constants).map_err(|e| chain(&e))
    };
    let (ir, info) = guarded(resolve).and_then(|resolved| resolved).map_err(|message| fail(Some(name), message))?;
    let index = ir
        .entry_points
        .iter()
        .position(|e| e.stage == naga_stage(stage) && e.name == name)
        .ok_or_else(|| fail(Some(name), "the entry point was lost while constants were resolved".to_owned()))?;
    let keep = |location: u32| options.outputs.is_none_or(|kept| kept.contains(&location));
    let mut lowered = lower::lower(module, &ir, &info, index, &keep, options.optimisations)?;
    optimize::run(&mut lowered);
    let assembled = assemble(module.name(), lowered, options.inject_fault);
    let mut program = assembled.map_err(|message| fail(Some(name), message))?;
    program.body.loop_turns = module.limits.work_loop_turns.get();
    Ok(program)
}
