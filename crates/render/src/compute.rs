//! Compute pipelines, passes and dispatches.

use std::sync::Arc;

use gfx::stage::{Stage, StageMap};
use host::one_line;
use num::LANES;
use shader::{self, Executor, Extra, Module, Program, QuadCost, Recorder, ShaderError};
use trace::command::{Command, PassTimestamps, StageDesc};
use work::{Dispatch, Event, Extent, Groups, Packet, Programs, Reach, ShaderShape};

use super::bind::{Lent, ResolvedBindings};
use super::execute::Renderer;
use super::fault::Fault;
use super::ledger::WORKGROUP_STEPS;
use super::state::{Bindings, StateError};

/// Packets (four invocations each) that one piece of recorded work holds at most, unless a single workgroup has more.
const PACKETS_A_PIECE: u64 = 1 << 18;

/// Workgroups along an axis, at most (WebGPU's limit).
const MAX_GROUPS: u32 = 65_535;

/// A compute pipeline.
#[derive(Debug)]
pub struct ComputePipeline {
    label: String,
    /// Number among all pipelines that the trace creates: no other has it, whatever its id.
    pub(super) number: u64,
    program: Program,
}

/// A compute pipeline does not compile.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("compute pipeline `{}`: {error}", one_line(.label))]
pub struct ComputeError {
    /// The pipeline's label.
    pub label: String,
    /// What is wrong with its shader.
    pub error: Box<ShaderError>,
}

impl ComputePipeline {
    /// Compiles a stage.
    ///
    /// # Errors
    /// If it does not compile; the message names the place.
    pub fn new(stage: &StageDesc, module: &Module, label: &str) -> Result<ComputePipeline, ComputeError> {
        let options = shader::Options { constants: &stage.constants, outputs: None, ..Default::default() };
        let program = shader::compile(module, Stage::Compute, stage.entry.as_deref(), &options)
            .map_err(|error| ComputeError { label: label.to_owned(), error: Box::new(error) })?;
        Ok(ComputePipeline { label: label.to_owned(), number: 0, program })
    }

    /// The program that the pipeline runs.
    pub fn program(&self) -> &Program {
        &self.program
    }
}

/// Whether the next command that dispatches has to be run.
fn needed(renderer: &mut Renderer<'_, '_>) -> bool {
    let number = renderer.dispatching;
    renderer.dispatching += 1;
    renderer.options.needs.as_ref().is_none_or(|needs| needs.dispatch(number))
}

/// A compute pass between its begin and its end.
pub(super) struct ActiveCompute {
    pipeline: Option<u32>,
    bindings: Bindings,
    executor: Executor,
    timestamps: Option<PassTimestamps>,
    /// The open statistics query: set, index, invocations so far.
    open_statistics: Option<(u32, u32, u64)>,
}

impl ActiveCompute {
    /// Begins a pass.
    pub fn begin(renderer: &mut Renderer<'_, '_>, timestamps: Option<PassTimestamps>) -> Result<ActiveCompute, Fault> {
        if let Some(PassTimestamps { set, begin: Some(index), .. }) = timestamps {
            renderer.write_timestamp(set, index)?;
        }
        Ok(ActiveCompute {
            pipeline: None,
            bindings: Bindings::default(),
            executor: Executor::new(),
            timestamps,
            open_statistics: None,
        })
    }

    /// Runs one command of the pass.
    pub fn run(&mut self, renderer: &mut Renderer<'_, '_>, command: &Command) -> Result<(), Fault> {
        renderer.count(command);
        match command {
            Command::SetComputePipeline(id) => self.pipeline = Some(id.0),
            Command::SetBindGroup { index, group, offsets } => self.bindings.set(*index, *group, offsets)?,
            Command::SetImmediates { offset, words } => self.bindings.set_immediates(*offset, words)?,
            Command::Dispatch { groups } => {
                let needed = needed(renderer);
                self.dispatch(renderer, *groups, None, needed)?;
            }
            &Command::DispatchIndirect { buffer, offset } => {
                let needed = needed(renderer);
                let arguments = renderer.res.buffers.get(buffer.0)?;
                let (words, extent) = (&arguments.words, Extent::new(arguments.address.saturating_add(offset), 12));
                if offset.checked_add(12).is_none_or(|end| end > words.len()) {
                    return Err(StateError::IndirectDispatch { offset, bytes: words.len(), buffer: buffer.0 }.into());
                }
                let groups = std::array::from_fn(|i| words.u32_at(offset as usize + 4 * i));
                // WebGPU: a dispatch beyond the limit that only the card sees does nothing.
                if groups.iter().all(|&n| n <= MAX_GROUPS) {
                    self.dispatch(renderer, groups, Some(extent), needed)?;
                }
            }
            &Command::WriteTimestamp { set, index } => renderer.write_timestamp(set, index)?,
            &Command::BeginStatisticsQuery { set, index } => self.open_statistics = Some((set.0, index, 0)),
            Command::EndStatisticsQuery => {
                let (set, index, invocations) = self.open_statistics.take().ok_or(StateError::NoStatisticsQuery)?;
                renderer.res.query_sets.get_mut(set)?.write_statistics(index, &Default::default(), invocations)?;
            }
            Command::PushDebugGroup(_) | Command::PopDebugGroup => renderer.groups.note(command),
            Command::InsertDebugMarker(_) => {}
            Command::SetCallSite(site) => renderer.site = Some(*site),
            command => return Err(StateError::WrongScope { name: command.name(), scope: "in a compute pass" }.into()),
        }
        Ok(())
    }

    /// Ends the pass.
    pub fn end(self, renderer: &mut Renderer<'_, '_>) -> Result<(), Fault> {
        if let Some(PassTimestamps { set, end: Some(index), .. }) = self.timestamps {
            renderer.write_timestamp(set, index)?;
        }
        Ok(())
    }

    /// Runs a dispatch, whose size may lie in memory. For a dispatch that is not needed, only the size is reported.
    fn dispatch(
        &mut self,
        renderer: &mut Renderer<'_, '_>,
        count: [u32; 3],
        arguments: Option<Extent>,
        needed: bool,
    ) -> Result<(), Fault> {
        let id = self.pipeline.ok_or(StateError::DispatchWithoutPipeline)?;
        let pipeline = renderer.res.compute_pipeline(id)?;
        let number = renderer.numbers.dispatches;
        renderer.numbers.dispatches += 1;
        let groups: u64 = count.iter().map(|&n| u64::from(n)).product();
        let interface = pipeline.program.interface();
        let invocations: u32 = interface.workgroup_size.iter().product();
        if let Some((.., counted)) = &mut self.open_statistics {
            *counted += groups * u64::from(invocations);
        }
        if groups == 0 {
            return Ok(());
        }
        let mut instructions = StageMap::default();
        instructions[Stage::Compute] = pipeline.program.instructions();
        let announced = |pipeline: &ComputePipeline, reach: Reach| Dispatch {
            reach,
            number,
            label: pipeline.label.clone(),
            shape: ShaderShape { registers: interface.registers, inputs: 3, outputs: 0 },
            groups,
            invocations,
            shared_bytes: interface.workgroup_bytes,
            programs: Programs { pipeline: pipeline.number, instructions },
        };
        if !renderer.recording() {
            renderer.emit(Event::Dispatch(Arc::new(announced(&pipeline, Reach::default()))))?;
        }
        if !needed {
            return Ok(());
        }
        let ledger = renderer.ledger.clone();
        ledger.workgroups.charge(groups)?;
        // Every batch does all operations at least once. The batches of a group are at most these: small groups share one.
        let batches = groups.saturating_mul(u64::from(invocations)).div_ceil(LANES as u64);
        ledger.steps.check(batches.saturating_mul(pipeline.program.steps()))?;
        ledger.bytes.charge(groups.saturating_mul(u64::from(interface.workgroup_bytes)))?;
        let files = u64::from(invocations).div_ceil(LANES as u64) * pipeline.program.register_bytes();
        ledger.passing("a workgroup", files + u64::from(interface.workgroup_bytes))?;
        let resolved = ResolvedBindings::new(&mut renderer.res, interface, &self.bindings)?;
        ledger.bytes.charge(resolved.cost())?;
        ledger.steps.charge(WORKGROUP_STEPS.saturating_mul(groups).saturating_add(pipeline.program.uniform_steps()))?;
        let mut lent = Lent::default();
        let resources = resolved.lend(&mut lent);
        let uniforms = pipeline.program.uniforms(&resources);
        let growth = ledger.growth();
        let mut bound = self.executor.bind(&pipeline.program, &resources, &uniforms).within(&ledger.steps, Some(&growth));
        if renderer.recording() {
            let packets_a_group = u64::from(invocations.div_ceil(4));
            let mut reach = Reach::default();
            resolved.reach(interface, &mut reach);
            arguments.into_iter().for_each(|extent| reach.reads.add(extent));
            renderer.emit(Event::Dispatch(Arc::new(announced(&pipeline, reach))))?;
            let step = (PACKETS_A_PIECE / packets_a_group).max(1);
            let mut recorder = Recorder::with(Extra::of(&renderer.options.key));
            let mut at = 0;
            while at < groups {
                let end = (at + step).min(groups);
                let mut costs = Vec::with_capacity(((end - at) * packets_a_group) as usize);
                // A piece that has been handed on counts as what it takes itself.
                growth.restart(ledger.alive());
                bound.run_groups(at..end, count, Some((&mut recorder, &mut costs)))?;
                growth.add(recorder.take_bytes());
                growth.verify()?;
                let packet =
                    |&QuadCost { cost, first_request, first_shared }: &QuadCost| Packet { cost, first_request, first_shared };
                let packets = costs.iter().map(packet).collect();
                let invocations = recorder.take();
                let (shared, words) = recorder.take_shared();
                let piece = Groups { groups: (end - at) as u32, packets, invocations, shared, words };
                renderer.emit(Event::Groups(Arc::new(piece)))?;
                at = end;
            }
        } else {
            bound.run_groups(0..groups, count, None)?;
        }
        ledger.steps.add(self.executor.take_steps());
        ledger.steps.verify()?;
        Ok(resolved.note_writes(&mut renderer.res, interface)?)
    }
}
