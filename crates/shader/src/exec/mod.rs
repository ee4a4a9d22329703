//! The executor: runs a program on batches of 64 lanes.
//!
//! Every operation works on whole registers, so that 64 invocations share the cost of one dispatch. Values that are assigned once are
//! computed on all lanes, active or not; only variables, memory and side effects depend on the execution mask. Control flow is
//! structured: a mask slot for each open construct stores which lanes go on after it, and a construct that no lane enters is skipped.

mod compute;
mod kernels;
pub(super) mod memory;
mod record;
mod run;
mod subgroup;
mod texture;

use std::cell::RefCell;
use std::ops::Range;
use std::sync::atomic::Ordering::Relaxed;

use num::{Lanes, LimitOverrun, Mask, Meter, Words};

use super::module::ShaderLocation;
use super::program::{NO_REG, Program, Reg};
use super::resources::Resources;
use kernels::{CHUNK, CHUNKS};
use record::Scratch;
pub use record::{Extra, QuadCost, Recorder};
use run::{BatchState, PAUSE, Stop};

/// The limit at which a run was stopped.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum ExceededLimit {
    /// One loop made too many turns.
    #[error("a loop ran {turns} times without an end; --limit work.loop_turns=N allows more")]
    Loop {
        /// How many are allowed.
        turns: u64,
    },
    /// All work together exceeded its limit. No place is given: it would be where one of the threads was by chance.
    #[error(transparent)]
    Limit(#[from] LimitOverrun),
}

/// Why a run was stopped.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("shader `{module}`, entry point `{entry}`{}: {why}", .place.map(|p| format!(", {p}")).unwrap_or_default())]
pub struct ShaderFault {
    /// The limit.
    pub why: ExceededLimit,
    /// Name of the module.
    pub module: String,
    /// The entry point.
    pub entry: String,
    /// Place of the loop, if known.
    pub place: Option<ShaderLocation>,
}

/// Results of a run other than its outputs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Survivors {
    /// Active lanes that were not discarded.
    pub mask: Mask,
}

/// Values that are the same for all invocations of a draw or dispatch: what the program computes from constants, uniform
/// buffers, read-only storage at constant places and immediates. Computed once, shared by all threads.
#[derive(Clone, Debug, Default)]
pub struct Uniforms {
    values: Vec<u32>,
    /// What it takes a warp to compute and load them. Components of uniform buffers at known places take nothing: they are operands.
    work: record::SharedWork,
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
    /// This program was stopped.
    pub fn fault(&self, why: ExceededLimit, place: Option<ShaderLocation>) -> ShaderFault {
        ShaderFault { why, module: self.module.clone(), entry: self.interface.entry.clone(), place }
    }

    /// It was stopped in the loop of this number.
    fn loop_fault(&self, number: u32) -> ShaderFault {
        let place = self.body.loops.get(number as usize).copied().flatten();
        self.fault(ExceededLimit::Loop { turns: self.body.loop_turns }, place)
    }

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
        let mut uniforms = Uniforms::default();
        self.uniforms_into(resources, &mut uniforms);
        uniforms
    }

    /// As [`Program::uniforms`], in the memory of others.
    pub fn uniforms_into(&self, resources: &Resources<'_>, uniforms: &mut Uniforms) {
        thread_local! {
            /// Registers and masks: each draw computes two such sets, and to clear fresh memory took a third of that time.
            static ROOM: RefCell<Executor> = RefCell::default();
        }
        let values = &mut uniforms.values;
        values.clear();
        values.resize(self.uniforms, 0);
        memory::load_placed(
            resources,
            &self.placed_uniforms,
            values,
            |values, first, words| {
                values[first..][..words.len()].iter_mut().zip(words).for_each(|(value, word)| *value = word.load(Relaxed));
            },
            |values, number, bits| values[number] = bits,
        );
        uniforms.work.counted = self.shared_counted;
        let loads = &mut uniforms.work.loads;
        loads.clear();
        loads.extend(self.shared_loads.iter().map(|&(binding, offset)| {
            let (line, part) = memory::line_of(resources, binding, offset);
            record::SharedLoad { line, constant: false, part }
        }));
        if self.computed_uniforms.is_empty() {
            return;
        }
        ROOM.with_borrow_mut(|Executor { file, masks, shared, scratch, .. }| {
            // As in runs, no value is read before it is written.
            file.resize(file.len().max(self.prologue.registers), Lanes::ZERO);
            masks.clear();
            masks.resize(self.prologue.slots, 0);
            for (register, &bits) in file.iter_mut().zip(&self.prologue_constants) {
                register.0[..CHUNK].fill(bits);
            }
            memory::load_placed(
                resources,
                &self.placed,
                file,
                |file, first, words| {
                    let registers = file[first..][..words.len()].iter_mut();
                    registers.zip(words).for_each(|(register, word)| register.0[..CHUNK].fill(word.load(Relaxed)));
                },
                |file, register, bits| file[register].0[..CHUNK].fill(bits),
            );
            let mut machine = BatchState::new(&self.prologue, resources, shared, 1, 1).narrow();
            let stop = if self.prologue.memory.is_empty() {
                run::dispatch::<false>(&mut machine, file, masks, scratch)
            } else {
                scratch.begin(Extra::default(), &record::SharedWork::default(), 1);
                let stop = run::dispatch::<true>(&mut machine, file, masks, scratch);
                loads.extend(scratch.loads_together());
                stop
            };
            debug_assert!(matches!(stop, Stop::End));
            for &(number, register) in &self.computed_uniforms {
                values[usize::from(number)] = file[usize::from(register)].0[0];
            }
        });
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
    /// Steps that have not been charged to a meter yet.
    spent: u64,
}

impl Executor {
    /// An executor without memory for registers yet.
    pub fn new() -> Executor {
        Executor::default()
    }

    /// Steps that were not charged to a meter ([`BoundProgram::within`]); the caller charges them.
    pub fn take_steps(&mut self) -> u64 {
        std::mem::take(&mut self.spent)
    }

    /// Gets ready to run a program. A run loads uniforms and constants into as much of the register file as it computes.
    pub fn bind<'a>(
        &'a mut self,
        program: &'a Program,
        resources: &'a Resources<'a>,
        uniforms: &'a Uniforms,
    ) -> BoundProgram<'a> {
        self.file.resize(self.file.len().max(program.body.registers), Lanes::ZERO);
        self.masks.clear();
        self.masks.resize(program.body.slots, 0);
        BoundProgram { executor: self, program, resources, uniforms, loaded: 0, allowance: Allowance::default() }
    }
}

/// Loads uniforms and constants into some [chunks](CHUNK) of their registers.
fn load_shared(file: &mut [Lanes], program: &Program, uniforms: &Uniforms, chunks: Range<usize>) {
    match (chunks.start, chunks.end) {
        // With a loop for each width that is frequent.
        (0, 1) => load_chunks(file, program, uniforms, 0..1),
        (0, 4) => load_chunks(file, program, uniforms, 0..4),
        (0, CHUNKS) => load_chunks(file, program, uniforms, 0..CHUNKS),
        _ => load_chunks(file, program, uniforms, chunks),
    }
}

#[inline(always)]
fn load_chunks(file: &mut [Lanes], program: &Program, uniforms: &Uniforms, chunks: Range<usize>) {
    let (first, others) = file.split_at_mut(uniforms.values.len());
    for (registers, values) in [(first, &uniforms.values), (others, &program.constants)] {
        for (register, &bits) in registers.iter_mut().zip(values) {
            for chunk in &mut register.0.as_chunks_mut::<CHUNK>().0[chunks.clone()] {
                *chunk = [bits; CHUNK];
            }
        }
    }
}

/// An executor with a program and its resources.
pub struct BoundProgram<'a> {
    executor: &'a mut Executor,
    program: &'a Program,
    resources: &'a Resources<'a>,
    uniforms: &'a Uniforms,
    /// How many chunks of the registers have uniforms and constants, from the first on. Draws of few vertices, and of few pixels, leave most
    /// of a register empty.
    loaded: usize,
    allowance: Allowance<'a>,
}

/// Recorded bytes after which they are added to the meter.
const RECORDED_PAUSE: u64 = if cfg!(test) { 1 << 16 } else { 1 << 24 };

/// The meters that runs are charged to.
#[derive(Clone, Copy, Default)]
struct Allowance<'a> {
    steps: Option<&'a Meter>,
    recorded: Option<&'a Meter>,
    forgets: bool,
}

impl Allowance<'_> {
    /// Charges the steps to their meter, and counts from 0 again.
    #[cold]
    fn tell_steps(&self, spent: &mut u64) -> Result<(), LimitOverrun> {
        let spent = std::mem::take(spent);
        match self.steps {
            Some(meter) if !meter.add(spent) => Err(meter.overrun()),
            _ => Ok(()),
        }
    }

    /// Charges the bytes of a recorder and of runs that have not ended to their meter. Returns whether what was recorded must be dropped.
    fn tell_recorded(&self, recorder: &mut Recorder, unfinished: u64) -> Result<bool, LimitOverrun> {
        let bytes = recorder.metered() + unfinished;
        let more = bytes.saturating_sub(recorder.told);
        let Some(meter) = self.recorded.filter(|_| more >= RECORDED_PAUSE) else { return Ok(false) };
        recorder.told = bytes;
        match (meter.add(more), self.forgets) {
            (true, _) => Ok(false),
            (false, true) => {
                recorder.take();
                recorder.take_shared();
                Ok(true)
            }
            (false, false) => Err(meter.overrun()),
        }
    }
}

impl<'a> BoundProgram<'a> {
    /// Runs stop when a meter is over its limit: that of steps, or that of the bytes that recorders hold. Meters are charged from time to
    /// time; the caller charges the rest ([`Executor::take_steps`], [`Recorder::take_bytes`]). So no sum depends on which thread ran what.
    pub fn within(mut self, steps: &'a Meter, recorded: Option<&'a Meter>) -> BoundProgram<'a> {
        self.allowance = Allowance { steps: Some(steps), recorded, forgets: false };
        self
    }

    /// Runs go on when the meter of recorded bytes is over its limit, and what was recorded is dropped. So where several threads run a
    /// program, the steps of all runs are counted, no matter which thread reached the limit of memory first.
    pub fn forgetting(mut self) -> BoundProgram<'a> {
        self.allowance.forgets = true;
        self
    }
}

impl BoundProgram<'_> {
    /// Loads uniforms and constants into the first chunks of their registers.
    #[inline(always)]
    fn load(&mut self, chunks: usize) {
        if self.loaded < chunks {
            load_shared(&mut self.executor.file, self.program, self.uniforms, self.loaded..chunks);
            self.loaded = chunks;
        }
    }

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
    #[inline(always)]
    pub fn output(&self, slot: usize, component: usize) -> &Lanes {
        &self.executor.file[usize::from(self.program.outputs[slot][component])]
    }

    /// Runs the batch. `active` lanes count; `helpers` only take part in derivatives and leave no side effects.
    ///
    /// # Errors
    /// If a loop does not end.
    pub fn run(&mut self, active: Mask, helpers: Mask) -> Result<Survivors, ShaderFault> {
        self.run_impl::<false>(active, helpers, None)
    }

    /// As [`BoundProgram::run`], and records what it cost: [`Recorder::quads`] holds the result.
    ///
    /// # Errors
    /// If a loop does not end.
    pub fn run_recorded(&mut self, active: Mask, helpers: Mask, recorder: &mut Recorder) -> Result<Survivors, ShaderFault> {
        self.executor.scratch.begin(recorder.extra, &self.uniforms.work, active | helpers);
        let outcome = self.run_impl::<true>(active, helpers, Some(recorder))?;
        recorder.finish(&mut self.executor.scratch);
        self.tell_recorded(recorder)?;
        Ok(outcome)
    }

    fn tell_recorded(&self, recorder: &mut Recorder) -> Result<(), ShaderFault> {
        let told = self.allowance.tell_recorded(recorder, 0);
        told.map(drop).map_err(|over| self.program.fault(over.into(), None))
    }

    fn run_impl<const RECORD: bool>(
        &mut self,
        active: Mask,
        helpers: Mask,
        mut recorder: Option<&mut Recorder>,
    ) -> Result<Survivors, ShaderFault> {
        self.load(run::computed::<RECORD>(run::chunks_of(active | helpers)));
        let BoundProgram { executor, program, resources, allowance, .. } = &mut *self;
        let Executor { file, masks, shared, scratch, spent, .. } = &mut **executor;
        let mut machine = BatchState::new(&program.body, resources, shared, active | helpers, active).narrow();
        *spent += program.body.all_steps();
        loop {
            let stop = run::dispatch::<RECORD>(&mut machine, file, masks, scratch);
            *spent += std::mem::take(&mut machine.spent);
            if *spent >= PAUSE {
                let mut told = allowance.tell_steps(spent);
                if let Some(recorder) = &mut recorder
                    && told.is_ok()
                {
                    told = allowance.tell_recorded(recorder, scratch.metered()).map(|forget| {
                        if forget {
                            scratch.forget();
                        }
                    });
                }
                told.map_err(|over| program.fault(over.into(), None))?;
            }
            match stop {
                Stop::Pause => {}
                Stop::End | Stop::Barrier => return Ok(Survivors { mask: machine.live & active }),
                Stop::Loop(number) => {
                    if let Some(recorder) = recorder {
                        recorder.passed += scratch.metered();
                    }
                    return Err(program.loop_fault(number));
                }
            }
        }
    }
}
