//! The walk in which notes are taken: objects are made, and nothing is drawn.

use std::collections::{BTreeSet, HashMap};
use std::sync::Arc;

use shader::Interface;
use trace::command::*;
use trace::{Trace, TraceError};

use super::notes::Notes;
use super::{Dependencies, Step, StepKind, Thing};
use crate::bind;
use crate::execute::{Options, Renderer, walk};
use crate::fault::{Fault, Reason};
use crate::ledger::{Claim, Ledger, TooMuchAlive};
use crate::resources::{NoObject, Resources};
use crate::sprites::Sprites;
use crate::state::{Bindings, StateError};

/// Takes the notes of a trace, up to a frame.
pub(super) fn notes(trace: &Trace, end: u32) -> Result<Dependencies, TraceError> {
    let ledger = Arc::new(Ledger::new(trace.limits()));
    let mut sink = |_| Ok(());
    let options = Options { frames: (0..end).into(), ..Options::default() };
    let mut renderer = Renderer::new(trace, options, ledger.clone(), &mut sink);
    let mut walker = Walker::default();
    walk(trace, &ledger, &mut |step| match step {
        crate::execute::Step::Command(command) => walker.command(&mut renderer, command, end),
        crate::execute::Step::End => walker.finish(&renderer),
    })?;
    let Walker { mut notes, frame, .. } = walker;
    notes.end();
    Ok(Dependencies { notes, frames: frame })
}

/// A pass under way.
#[derive(Default)]
struct Open {
    step: Step,
    pipeline: Option<u32>,
    bindings: Bindings,
    vertex: HashMap<u32, u32>,
    index: Option<u32>,
    occlusion: Option<u32>,
}

/// The purpose for which the memory of notes is claimed.
const NOTES: &str = "what passes read and write";

/// Takes notes.
#[derive(Default)]
struct Walker {
    claim: Option<Claim>,
    notes: Notes,
    frame: u32,
    render: Option<Open>,
    compute: Option<Open>,
    sprites: Sprites,
}

impl Walker {
    /// Counts memory of notes as alive.
    fn claim(&mut self, ledger: &Arc<Ledger>, bytes: u64) -> Result<(), TooMuchAlive> {
        match &mut self.claim {
            Some(claim) => claim.grow(NOTES, bytes),
            None => {
                self.claim = Some(ledger.claim(NOTES, bytes)?);
                Ok(())
            }
        }
    }

    fn note(&mut self, ledger: &Arc<Ledger>, step: Step) -> Result<(), Fault> {
        // A limit of memory is one of temporary files, too.
        let bytes = if self.notes.knows(&step) { 0 } else { step.bytes() };
        self.claim(ledger, bytes + size_of::<u64>() as u64)?;
        self.notes.add(step).map_err(|error| Fault::Reason(Reason::Notes(Arc::new(error))))
    }

    /// The end of a trace: one that shows nothing is a frame.
    fn finish(&mut self, renderer: &Renderer<'_, '_>) -> Result<(), Fault> {
        if self.frame == 0 {
            // The shown texture is not known here: take all textures.
            let textures = renderer.res.textures.iter();
            let reads = textures.flat_map(|(id, texture)| (0..texture.image.levels).map(move |level| Thing::Level(id, level)));
            let reads = reads.collect();
            self.note(&renderer.ledger, Step { kind: StepKind::Present, reads, ..Step::default() })?;
            self.frame = 1;
        }
        Ok(())
    }

    fn command(&mut self, renderer: &mut Renderer<'_, '_>, command: &Command, end: u32) -> Result<(), Fault> {
        if renderer.objects(command)? {
            return Ok(());
        }
        if let Some(mut open) = self.render.take() {
            if matches!(command, Command::EndRenderPass) {
                return self.note(&renderer.ledger, open.step);
            }
            let done = self.in_pass(renderer, &mut open, command);
            self.render = Some(open);
            return done;
        }
        if let Some(mut open) = self.compute.take() {
            let done = match command {
                Command::EndComputePass => return Ok(()),
                command => self.in_compute(renderer, &mut open, command),
            };
            self.compute = Some(open);
            return done;
        }
        self.outside(renderer, command, end)
    }

    fn outside(&mut self, renderer: &Renderer<'_, '_>, command: &Command, end: u32) -> Result<(), Fault> {
        let (res, ledger) = (&renderer.res, &renderer.ledger);
        match command {
            Command::BeginRenderPass { color, depth, occlusion, .. } => {
                let mut open = Open { step: Step { kind: StepKind::Pass, ..Step::default() }, ..Open::default() };
                open.occlusion = occlusion.map(|set| set.0);
                begin(res, &mut open.step, color, depth.as_ref())?;
                self.render = Some(open);
            }
            Command::BeginComputePass { .. } => self.compute = Some(Open::default()),
            &Command::SetSprite { index, view, x, y } => self.sprites.set(index, view, [x, y])?,
            Command::Present { texture } => {
                let mut reads: BTreeSet<Thing> = [Thing::Level(texture.0, 0)].into();
                for view in self.sprites.views() {
                    reads.extend(levels(res, view.0)?.0);
                }
                self.note(ledger, Step { kind: StepKind::Present, reads, ..Step::default() })?;
                self.frame += 1;
                return if self.frame < end { Ok(()) } else { Err(Fault::Stop) };
            }
            command => {
                if let Some(step) = copy(res, command)? {
                    self.note(ledger, step)?;
                }
            }
        }
        Ok(())
    }

    fn in_pass(&self, renderer: &Renderer<'_, '_>, open: &mut Open, command: &Command) -> Result<(), Fault> {
        let (res, ledger) = (&renderer.res, &renderer.ledger);
        match command {
            Command::SetRenderPipeline(id) => open.pipeline = Some(id.0),
            Command::SetBindGroup { index, group, offsets } => open.bindings.set(*index, *group, offsets)?,
            Command::SetIndexBuffer { buffer, .. } => open.index = Some(buffer.0),
            Command::SetVertexBuffer { slot, buffer, .. } => {
                match buffer {
                    Some(buffer) => open.vertex.insert(*slot, buffer.0),
                    None => open.vertex.remove(slot),
                };
            }
            Command::BeginOcclusionQuery { .. } => open.step.writes.extend(open.occlusion.map(Thing::Queries)),
            // They count fragments that are shaded.
            Command::BeginStatisticsQuery { set, .. } => {
                open.step.color_writes.insert(Thing::Queries(set.0));
            }
            Command::ExecuteBundles(ids) => {
                for id in ids {
                    let commands = res.bundles.get(id.0)?.clone();
                    open.forget();
                    for command in commands.iter() {
                        ledger.commands.charge(1)?;
                        self.in_pass(renderer, open, command)?;
                    }
                    open.forget();
                }
            }
            command => {
                if let Some(draws) = command.draws() {
                    match draws {
                        Draws::Direct { .. } => {}
                        Draws::Indirect { buffer, count_buffer, .. } => {
                            let buffers = [Some(buffer), count_buffer.map(|(buffer, _)| buffer)];
                            open.step.extent.extend(buffers.into_iter().flatten().map(|buffer| Thing::Buffer(buffer.0)));
                        }
                    }
                    draw((res, ledger), open, draws.indexed(), Amount::of(draws.vertices()))?;
                }
            }
        }
        Ok(())
    }

    fn in_compute(&mut self, renderer: &Renderer<'_, '_>, open: &mut Open, command: &Command) -> Result<(), Fault> {
        let (res, ledger) = (&renderer.res, &renderer.ledger);
        match command {
            Command::SetComputePipeline(id) => open.pipeline = Some(id.0),
            Command::SetBindGroup { index, group, offsets } => open.bindings.set(*index, *group, offsets)?,
            Command::Dispatch { .. } | Command::DispatchIndirect { .. } => {
                let id = open.pipeline.ok_or(StateError::DispatchWithoutPipeline)?;
                let mut step = Step { kind: StepKind::Dispatch, ..Step::default() };
                if let Command::DispatchIndirect { buffer, .. } = command {
                    step.extent.insert(Thing::Buffer(buffer.0));
                }
                let amount = match command {
                    Command::Dispatch { groups } => Amount::of(Some(groups.iter().all(|&n| n > 0).into())),
                    _ => Amount::Unknown,
                };
                match res.compute_pipeline(id) {
                    Ok(pipeline) if amount != Amount::Nothing => {
                        let interface = pipeline.program().interface();
                        touched((res, ledger), interface, &open.bindings, amount, &mut step.reads, &mut step.writes)?;
                    }
                    Err(fault) if amount != Amount::Unknown => return Err(fault),
                    _ => {}
                }
                self.note(ledger, step)?;
            }
            _ => {}
        }
        Ok(())
    }
}

impl Open {
    /// Forgets what a bundle sets.
    fn forget(&mut self) {
        self.pipeline = None;
        self.bindings = Bindings::default();
        self.vertex.clear();
        self.index = None;
    }
}

/// Levels of the texture of a view; whether they are all of an image each.
fn levels(res: &Resources, view: u32) -> Result<(Vec<Thing>, bool), NoObject> {
    let view = res.views.get(view)?;
    let image = res.textures.get(view.texture.0)?.image;
    let levels = view.range.base_level..view.range.base_level + view.range.levels;
    let whole = image.level_size(view.range.base_level)[2] == 1;
    Ok((levels.map(|level| Thing::Level(view.texture.0, level)).collect(), whole))
}

/// Attachments.
fn begin(
    res: &Resources,
    step: &mut Step,
    color: &[Option<ColorAttachment>],
    depth: Option<&DepthAttachment>,
) -> Result<(), NoObject> {
    for attachment in color.iter().flatten() {
        let (things, whole) = levels(res, attachment.view.0)?;
        if whole && (attachment.clear.is_some() || !attachment.store) {
            step.fresh.extend(&things);
        }
        if attachment.clear.is_none() {
            step.color_reads.extend(&things);
        }
        if attachment.store {
            step.color_writes.extend(&things);
        }
        if let Some(resolve) = attachment.resolve {
            let (things, whole) = levels(res, resolve.0)?;
            if whole {
                step.fresh.extend(&things);
            }
            step.color_writes.extend(&things);
        }
    }
    if let Some(attachment) = depth {
        let (things, whole) = levels(res, attachment.view.0)?;
        let format = res.views.get(attachment.view.0)?.range.format;
        let (has_depth, has_stencil) = (format.has_depth(), format.has_stencil());
        let cleared = (attachment.depth_clear.is_some() || !has_depth) && (attachment.stencil_clear.is_some() || !has_stencil);
        let keeps = |store: bool, read_only: bool, has: bool| has && (store || read_only);
        let kept = keeps(attachment.depth_store, attachment.depth_read_only, has_depth)
            || keeps(attachment.stencil_store, attachment.stencil_read_only, has_stencil);
        if whole && (cleared || !kept) {
            step.fresh.extend(&things);
        }
        if !cleared {
            step.reads.extend(&things);
        }
        if kept {
            step.writes.extend(&things);
        }
    }
    Ok(())
}

/// How much a draw or dispatch does.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Amount {
    /// It has no vertex, instance or workgroup: rendering does not look at what it would use.
    Nothing,
    /// It has some: rendering refuses it where what it uses is not there.
    Some,
    /// Its numbers are in memory. Rendering refuses it if it has some.
    Unknown,
}

impl Amount {
    /// Of a number of vertices or workgroups, if it is known.
    fn of(count: Option<u64>) -> Amount {
        match count {
            Some(0) => Amount::Nothing,
            Some(_) => Amount::Some,
            None => Amount::Unknown,
        }
    }
}

/// The contents that a program's bindings read and write.
fn touched(
    (res, ledger): (&Resources, &Ledger),
    interface: &Interface,
    bindings: &Bindings,
    amount: Amount,
    reads: &mut BTreeSet<Thing>,
    writes: &mut BTreeSet<Thing>,
) -> Result<(), Fault> {
    for binding in &interface.bindings {
        let mut seen = 0;
        let mut add = |thing: Thing| {
            seen += size_of::<Thing>() as u64;
            reads.insert(thing);
            if binding.written {
                writes.insert(thing);
            }
        };
        let bound = match bind::bound(res, binding, bindings) {
            Err(_) if amount == Amount::Unknown => continue,
            bound => bound.map_err(|reason| bind::missing(interface, binding, reason))?,
        };
        match bound {
            BoundResource::Buffer { buffer, .. } => add(Thing::Buffer(buffer.0)),
            BoundResource::Buffers(buffers) => buffers.iter().for_each(|(buffer, ..)| add(Thing::Buffer(buffer.0))),
            BoundResource::View(view) => levels(res, view.0)?.0.into_iter().for_each(&mut add),
            BoundResource::Views(views) => {
                for view in views {
                    levels(res, view.0)?.0.into_iter().for_each(&mut add);
                }
            }
            BoundResource::Sampler(_) | BoundResource::Samplers(_) => {}
        }
        ledger.bytes.charge(seen)?;
    }
    Ok(())
}

fn draw((res, ledger): (&Resources, &Ledger), open: &mut Open, indexed: bool, amount: Amount) -> Result<(), Fault> {
    let id = open.pipeline.ok_or(StateError::DrawWithoutPipeline)?;
    if amount == Amount::Nothing {
        return Ok(());
    }
    let pipeline = match res.render_pipeline(id) {
        Err(_) if amount == Amount::Unknown => return Ok(()),
        pipeline => pipeline?,
    };
    let Step { reads, color_reads, writes, .. } = &mut open.step;
    reads.extend(open.vertex.values().map(|&buffer| Thing::Buffer(buffer)));
    if indexed {
        reads.extend(open.index.map(Thing::Buffer));
    }
    for stage in pipeline.stages() {
        let for_coverage = stage.kind().is_geometry() || pipeline.shades_for_coverage();
        let reads = if for_coverage { &mut *reads } else { &mut *color_reads };
        touched((res, ledger), stage.interface(), &open.bindings, amount, reads, writes)?;
    }
    Ok(())
}

/// An upload, copy or clear; none for what touches nothing that is read.
fn copy(res: &Resources, command: &Command) -> Result<Option<Step>, NoObject> {
    let level = |end: &TextureEnd| Thing::Level(end.texture.0, end.level);
    let whole = |buffer: num::BufferId, offset: u64, size: u64| -> Result<BTreeSet<Thing>, NoObject> {
        let whole = offset == 0 && size == res.buffers.get(buffer.0)?.words.len();
        Ok(whole.then_some(Thing::Buffer(buffer.0)).into_iter().collect())
    };
    let (read, written, fresh) = match command {
        // The data of an upload are there no matter what was drawn. Earlier contents matter only if the upload leaves part of them.
        Command::ClearBuffer { buffer, offset, size } => {
            let length = res.buffers.get(buffer.0)?.words.len();
            (None, None, whole(*buffer, *offset, size.unwrap_or(length.saturating_sub(*offset)))?)
        }
        Command::CopyBufferToBuffer { from, to, to_offset, size, .. } => {
            (Some(Thing::Buffer(from.0)), Some(Thing::Buffer(to.0)), whole(*to, *to_offset, *size)?)
        }
        Command::CopyBufferToTexture { from, to, .. } => (Some(Thing::Buffer(from.0)), Some(level(to)), BTreeSet::new()),
        Command::CopyTextureToBuffer { from, to, .. } => (Some(level(from)), Some(Thing::Buffer(to.0)), BTreeSet::new()),
        Command::CopyTextureToTexture { from, to, .. } => (Some(level(from)), Some(level(to)), BTreeSet::new()),
        Command::ResolveQuerySet { set, to, .. } => (Some(Thing::Queries(set.0)), Some(Thing::Buffer(to.0)), BTreeSet::new()),
        _ => return Ok(None),
    };
    Ok(Some(Step {
        kind: StepKind::Copy,
        fresh,
        reads: read.into_iter().collect(),
        writes: written.into_iter().collect(),
        ..Step::default()
    }))
}
