//! The executor: runs a program on batches of 64 lanes.
//!
//! Every operation does its work on whole registers, so that finding out which operation it is costs one jump for 64
//! invocations. Values that are assigned once are computed on all lanes, active or not; only variables, memory and side effects
//! look at the execution mask. Control flow is structured: a mask slot for each open construct remembers which lanes go on after
//! it, and a construct that no lane wants is jumped over.

mod compute;
mod kernels;
pub(super) mod memory;
mod record;
mod run;
mod subgroup;
mod texture;

use crate::num::{Lanes, Mask, Words};

use super::module::Place;
use super::program::{NO_REG, Program, Reg};
use super::resources::Resources;
use record::Scratch;
pub use record::{Extra, QuadCost, Recorder};
use run::{Machine, Stop};

/// How often a loop may go round in one entry before the run is stopped with an error: a program that needs more hangs a card.
pub const MAX_ITERATIONS: u32 = 1 << 20;

/// Why a run was stopped.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error(
    "shader `{module}`, entry point `{entry}`{}: a loop ran {MAX_ITERATIONS} times without an end",
    .place.map(|p| format!(", {p}")).unwrap_or_default()
)]
pub struct ShaderFault {
    /// Name of the module.
    pub module: String,
    /// The entry point.
    pub entry: String,
    /// Place of the loop, if known.
    pub place: Option<Place>,
}

/// What a run leaves beside its outputs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Outcome {
    /// Active lanes that were not discarded.
    pub mask: Mask,
}

/// Values that are the same for all invocations of a draw or dispatch: what the program computes from constants, uniform
/// buffers, read-only storage at constant places and immediates. Computed once, shared by all threads.
#[derive(Clone, Debug, Default)]
pub struct Uniforms {
    values: Vec<u32>,
}

impl Uniforms {
    /// The values, in the order of a batch's first registers.
    pub(super) fn values(&self) -> &[u32] {
        &self.values
    }
}

/// The register of a component of an input.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct InputRegister(Reg);

impl InputRegister {
    /// Its place in the register file.
    pub(super) fn index(self) -> usize {
        usize::from(self.0)
    }
}

impl Program {
    /// The register of a component of an input; none where the program does not read it.
    pub fn input_register(&self, slot: usize, component: usize) -> Option<InputRegister> {
        let register = *self.inputs.get(slot)?.get(component)?;
        (register != NO_REG).then_some(InputRegister(register))
    }

    /// Computes the values that all invocations share.
    ///
    /// # Errors
    /// None at present: the prologue is straight-line code.
    pub fn uniforms(&self, resources: &Resources<'_>) -> Uniforms {
        let mut file = vec![Lanes::ZERO; self.prologue.registers];
        for (register, &bits) in file.iter_mut().zip(&self.prologue_constants) {
            *register = Lanes::splat(bits);
        }
        let mut masks = vec![0; self.prologue.slots];
        let shared = Words::default();
        let mut machine = Machine::new(&self.prologue, resources, &shared, 1, 1);
        let stop = run::run::<false>(&mut machine, &mut file, &mut masks, &mut Scratch::default());
        debug_assert!(matches!(stop, Stop::End));
        Uniforms { values: self.uniform_sources.iter().map(|&r| file[usize::from(r)].0[0]).collect() }
    }
}

/// The register file of one thread; reused from draw to draw.
#[derive(Default)]
pub struct Executor {
    file: Vec<Lanes>,
    masks: Vec<Mask>,
    /// Register files of the batches of a workgroup that wait at a barrier.
    waiting: Vec<compute::Waiting>,
    shared: Words,
    scratch: Scratch,
}

impl Executor {
    /// An empty one.
    pub fn new() -> Executor {
        Executor::default()
    }

    /// Gets ready to run a program: loads uniforms and constants into the register file.
    pub fn bind<'a>(&'a mut self, program: &'a Program, resources: &'a Resources<'a>, uniforms: &'a Uniforms) -> Bound<'a> {
        self.file.resize(self.file.len().max(program.body.registers), Lanes::ZERO);
        self.masks.clear();
        self.masks.resize(program.body.slots, 0);
        load_shared(&mut self.file, program, uniforms);
        Bound { executor: self, program, resources, uniforms }
    }
}

fn load_shared(file: &mut [Lanes], program: &Program, uniforms: &Uniforms) {
    for (register, &bits) in file.iter_mut().zip(uniforms.values.iter().chain(&program.constants)) {
        *register = Lanes::splat(bits);
    }
}

/// An executor with a program and its resources.
pub struct Bound<'a> {
    executor: &'a mut Executor,
    program: &'a Program,
    resources: &'a Resources<'a>,
    uniforms: &'a Uniforms,
}

impl Bound<'_> {
    /// The program.
    pub fn program(&self) -> &Program {
        self.program
    }

    /// A register that [`Program::input_register`] names.
    ///
    /// # Panics
    /// If it is of another program.
    #[inline(always)]
    pub fn register_mut(&mut self, register: InputRegister) -> &mut Lanes {
        &mut self.executor.file[usize::from(register.0)]
    }

    /// The register of a component of an input, to be written before each run (a run may reuse it); none where the program
    /// does not read it.
    pub fn input_mut(&mut self, slot: usize, component: usize) -> Option<&mut Lanes> {
        let register = self.program.input_register(slot, component)?;
        Some(self.register_mut(register))
    }

    /// The value of a component of an output after a run; meaningful in lanes that ran.
    ///
    /// # Panics
    /// If the interface has no such output.
    pub fn output(&self, slot: usize, component: usize) -> &Lanes {
        &self.executor.file[usize::from(self.program.outputs[slot][component])]
    }

    /// Runs the batch. `active` lanes count; `helpers` only take part in derivatives and leave no side effects.
    ///
    /// # Errors
    /// If a loop does not end.
    pub fn run(&mut self, active: Mask, helpers: Mask) -> Result<Outcome, ShaderFault> {
        self.run_impl::<false>(active, helpers)
    }

    /// As [`Bound::run`], and records what it cost: [`Recorder::quads`] holds the result.
    ///
    /// # Errors
    /// If a loop does not end.
    pub fn run_recorded(&mut self, active: Mask, helpers: Mask, recorder: &mut Recorder) -> Result<Outcome, ShaderFault> {
        self.executor.scratch.begin(recorder.extra);
        let outcome = self.run_impl::<true>(active, helpers)?;
        recorder.finish(&mut self.executor.scratch);
        Ok(outcome)
    }

    fn run_impl<const RECORD: bool>(&mut self, active: Mask, helpers: Mask) -> Result<Outcome, ShaderFault> {
        let Executor { file, masks, shared, scratch, .. } = &mut *self.executor;
        let mut machine = Machine::new(&self.program.body, self.resources, shared, active | helpers, active);
        let stop = run::dispatch::<RECORD>(&mut machine, file, masks, scratch);
        match stop {
            Stop::End | Stop::Barrier => Ok(Outcome { mask: machine.live & active }),
            Stop::Loop(number) => Err(self.fault(number)),
        }
    }

    fn fault(&self, number: u32) -> ShaderFault {
        ShaderFault {
            module: self.program.module.clone(),
            entry: self.program.interface.entry.clone(),
            place: self.program.body.loops.get(number as usize).copied().flatten(),
        }
    }
}
