//! Which passes and dispatches have to be run, so that what is asked of each frame comes out right.
//!
//! A walk over the commands, in which nothing is drawn, notes what each pass, dispatch, upload and copy reads and writes ([`Dependencies`]).
//! A walk backwards over these notes then finds what the frames that are asked for need of what comes before them ([`Needs`]): liveness
//! of data, as a compiler finds it (Aho, Lam, Sethi and Ullman, Compilers, 2006, section 9.2.5). Images are told apart by texture and level;
//! buffers and query sets are taken whole. Only what is overwritten whole ends the life of what was there: where that is not
//! certain, the earlier contents are taken to be read. What a shader may read or write is found from its bindings, so that no data of the trace decide.

use std::collections::{BTreeSet, HashMap, HashSet};
use std::sync::Arc;

use shader::Interface;
use trace::command::*;
use trace::{Trace, TraceError};

use super::bind;
use super::execute::{Fault, Options, Renderer, walk};
use super::ledger::{Claim, Ledger};
use super::objects::is_about_objects;
use super::pipeline::RenderPipeline;
use super::resources::Resources;
use super::state::Bindings;

/// What is asked of a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Want {
    /// Nothing of its own: only what later frames read of it.
    Nothing,
    /// How many vertices, primitives, triangles, quads and covered fragments there are.
    Counts,
    /// Everything: its picture, its work.
    All,
}

/// What has to be done of a pass.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Need {
    /// Nothing is drawn.
    Nothing,
    /// Coverage, depth, stencil and what shaders write to memory, without colours.
    Coverage,
    /// Everything.
    Colors,
}

/// Something that commands read and write.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub(super) enum Thing {
    /// All layers of a level of a texture.
    Level(u32, u32),
    /// A buffer.
    Buffer(u32),
    /// A query set.
    Queries(u32),
}

/// What a step is.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
enum Kind {
    Pass,
    Dispatch,
    /// An upload or copy, which is always done.
    #[default]
    Copy,
    /// The end of a frame.
    Present,
}

/// A pass, dispatch, upload, copy or end of a frame.
#[derive(Clone, Debug, Default, PartialEq, Eq, Hash)]
struct Step {
    kind: Kind,
    /// What it overwrites whole, whether anything is drawn or not.
    fresh: BTreeSet<Thing>,
    /// What is read to find its extent: arguments of indirect commands.
    extent: BTreeSet<Thing>,
    /// What is read for coverage, depth and side effects.
    reads: BTreeSet<Thing>,
    /// What is read beside that for colours.
    color_reads: BTreeSet<Thing>,
    /// What is written without colours,
    writes: BTreeSet<Thing>,
    /// and with them.
    color_writes: BTreeSet<Thing>,
}

impl Step {
    /// Bytes that it takes, about.
    fn bytes(&self) -> u64 {
        let sets = [&self.fresh, &self.extent, &self.reads, &self.color_reads, &self.writes, &self.color_writes];
        let things: usize = sets.iter().map(|set| set.len()).sum();
        // A node of a tree is at least half full.
        (2 * size_of::<Step>() + 2 * things * size_of::<Thing>()) as u64
    }
}

/// What the passes, dispatches and copies of a trace read and write.
#[derive(Debug, Default)]
pub struct Dependencies {
    /// Different steps; those of most frames are alike.
    kinds: Vec<Arc<Step>>,
    /// Each step: which of these, and its frame.
    steps: Vec<(u32, u32)>,
    frames: u32,
}

/// Which passes and dispatches of a trace have to be run.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Needs {
    passes: Vec<Need>,
    dispatches: Vec<bool>,
    pictures: Vec<bool>,
}

impl Needs {
    /// What is needed of a pass, by its number in the trace.
    pub fn pass(&self, number: u32) -> Need {
        self.passes.get(number as usize).copied().unwrap_or(Need::Colors)
    }

    /// Whether a dispatch has to be run, by the number of its command among those that dispatch.
    pub fn dispatch(&self, number: u32) -> bool {
        self.dispatches.get(number as usize).copied().unwrap_or(true)
    }

    /// Whether the picture of a frame comes out.
    pub fn picture(&self, frame: u32) -> bool {
        self.pictures.get(frame as usize).copied().unwrap_or(true)
    }

    /// How many passes are left out, are drawn without colours, and are drawn whole.
    pub fn passes(&self) -> [u64; 3] {
        [Need::Nothing, Need::Coverage, Need::Colors]
            .map(|need| self.passes.iter().filter(|&&pass| pass == need).count() as u64)
    }
}

impl Dependencies {
    /// Walks over a trace, in which nothing is drawn, up to a frame.
    ///
    /// # Errors
    /// If the trace cannot be read, or names objects that are not there; the error names the command.
    pub fn of(trace: &Trace, end: u32) -> Result<Dependencies, TraceError> {
        let ledger = Arc::new(Ledger::new(trace.limits()));
        let mut sink = |_| Ok(());
        let options = Options { frames: (0..end).into(), ..Options::default() };
        let mut renderer = Renderer::new(trace, options, ledger.clone(), &mut sink);
        let mut walker = Walker::default();
        walk(trace, &ledger, &mut |command| match command {
            Some(command) => walker.command(&mut renderer, command, end),
            None => walker.finish(&renderer),
        })?;
        let Walker { notes, frame, .. } = walker;
        Ok(Dependencies { frames: frame, ..notes })
    }

    /// Frames that end.
    pub fn frames(&self) -> u32 {
        self.frames
    }

    /// What has to be run for what is wanted of each frame.
    pub fn needs(&self, want: impl Fn(u32) -> Want) -> Needs {
        let mut live: HashSet<Thing> = HashSet::new();
        let (mut passes, mut dispatches, mut pictures) = (Vec::new(), Vec::new(), Vec::new());
        for &(kind, frame) in self.steps.iter().rev() {
            let (step, want) = (&self.kinds[kind as usize], want(frame));
            let all = want == Want::All;
            let lives = |things: &BTreeSet<Thing>| things.iter().any(|thing| live.contains(thing));
            let colored = all || lives(&step.color_writes);
            let (run, extent) = match step.kind {
                Kind::Pass => {
                    let need = match colored {
                        true => Need::Colors,
                        false if want == Want::Counts || lives(&step.writes) => Need::Coverage,
                        false => Need::Nothing,
                    };
                    passes.push(need);
                    (need >= Need::Coverage, need >= Need::Coverage)
                }
                Kind::Dispatch => {
                    let run = all || lives(&step.writes);
                    dispatches.push(run);
                    (run, want == Want::Counts)
                }
                Kind::Copy => (all || lives(&step.writes), false),
                Kind::Present => {
                    pictures.push(all);
                    (all, false)
                }
            };
            step.fresh.iter().for_each(|thing| {
                live.remove(thing);
            });
            if run || extent {
                live.extend(&step.extent);
            }
            if run {
                live.extend(&step.reads);
            }
            if run && colored {
                live.extend(&step.color_reads);
            }
        }
        passes.reverse();
        dispatches.reverse();
        pictures.reverse();
        Needs { passes, dispatches, pictures }
    }
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

/// What the memory of notes is claimed for.
const NOTES: &str = "what passes read and write";

/// Takes notes.
#[derive(Default)]
struct Walker {
    claim: Option<Claim>,
    notes: Dependencies,
    known: HashMap<Arc<Step>, u32>,
    frame: u32,
    render: Option<Open>,
    compute: Option<Open>,
    bundle: Option<(u32, Vec<Command>)>,
    bundles: HashMap<u32, Arc<Vec<Command>>>,
}

impl Walker {
    fn note(&mut self, ledger: &Arc<Ledger>, step: Step) -> Result<(), Fault> {
        let mut claim = match self.claim.take() {
            Some(claim) => claim,
            None => ledger.claim(NOTES, 0)?,
        };
        let number = match self.known.get(&step) {
            Some(&number) => number,
            None => {
                claim.grow(NOTES, step.bytes())?;
                let (step, number) = (Arc::new(step), self.notes.kinds.len() as u32);
                self.known.insert(step.clone(), number);
                self.notes.kinds.push(step);
                number
            }
        };
        claim.grow(NOTES, size_of::<(u32, u32)>() as u64)?;
        self.claim = Some(claim);
        self.notes.steps.push((number, self.frame));
        Ok(())
    }

    /// The end of a trace: one that shows nothing is a frame.
    fn finish(&mut self, renderer: &Renderer<'_, '_>) -> Result<(), Fault> {
        if self.frame == 0 {
            // What is shown is not known here: all that there is.
            let textures = renderer.res.textures.iter();
            let reads = textures.flat_map(|(id, texture)| (0..texture.image.levels).map(move |level| Thing::Level(id, level)));
            let reads = reads.collect();
            self.note(&renderer.ledger, Step { kind: Kind::Present, reads, ..Step::default() })?;
            self.frame = 1;
        }
        Ok(())
    }

    fn command(&mut self, renderer: &mut Renderer<'_, '_>, command: &Command, end: u32) -> Result<(), Fault> {
        if is_about_objects(command) {
            return renderer.objects(command);
        }
        if let Some((id, mut commands)) = self.bundle.take() {
            if matches!(command, Command::EndBundle) {
                self.bundles.insert(id, Arc::new(commands));
            } else {
                commands.push(command.clone());
                self.bundle = Some((id, commands));
            }
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
            Command::BeginBundle { id } => self.bundle = Some((id.0, Vec::new())),
            Command::BeginRenderPass { color, depth, occlusion, .. } => {
                let mut open = Open { step: Step { kind: Kind::Pass, ..Step::default() }, ..Open::default() };
                open.occlusion = occlusion.map(|set| set.0);
                begin(res, &mut open.step, color, depth.as_ref())?;
                self.render = Some(open);
            }
            Command::BeginComputePass { .. } => self.compute = Some(Open::default()),
            Command::Present { texture } => {
                let reads = [Thing::Level(texture.0, 0)].into();
                self.note(ledger, Step { kind: Kind::Present, reads, ..Step::default() })?;
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
            Command::Draw { .. } => draw((res, ledger), open, false)?,
            Command::DrawIndexed { .. } => draw((res, ledger), open, true)?,
            Command::DrawIndirect { buffer, indexed, count_buffer, .. } => {
                open.step.extent.insert(Thing::Buffer(buffer.0));
                open.step.extent.extend(count_buffer.map(|(buffer, _)| Thing::Buffer(buffer.0)));
                draw((res, ledger), open, *indexed)?;
            }
            Command::BeginOcclusionQuery { .. } => open.step.writes.extend(open.occlusion.map(Thing::Queries)),
            // They count fragments that are shaded.
            Command::BeginStatisticsQuery { set, .. } => {
                open.step.color_writes.insert(Thing::Queries(set.0));
            }
            Command::ExecuteBundles(ids) => {
                for id in ids {
                    let commands = self.bundles.get(&id.0).cloned().unwrap_or_default();
                    open.forget();
                    for command in commands.iter() {
                        ledger.commands.charge(1)?;
                        self.in_pass(renderer, open, command)?;
                    }
                    open.forget();
                }
            }
            _ => {}
        }
        Ok(())
    }

    fn in_compute(&mut self, renderer: &Renderer<'_, '_>, open: &mut Open, command: &Command) -> Result<(), Fault> {
        let (res, ledger) = (&renderer.res, &renderer.ledger);
        match command {
            Command::SetComputePipeline(id) => open.pipeline = Some(id.0),
            Command::SetBindGroup { index, group, offsets } => open.bindings.set(*index, *group, offsets)?,
            Command::Dispatch { .. } | Command::DispatchIndirect { .. } => {
                let id = open.pipeline.ok_or("a dispatch without a pipeline")?;
                let pipeline = res.compute_pipelines.get(id)?.clone();
                let mut step = Step { kind: Kind::Dispatch, ..Step::default() };
                if let Command::DispatchIndirect { buffer, .. } = command {
                    step.extent.insert(Thing::Buffer(buffer.0));
                }
                touched((res, ledger), pipeline.program().interface(), &open.bindings, &mut step.reads, &mut step.writes)?;
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
fn levels(res: &Resources, view: u32) -> Result<(Vec<Thing>, bool), String> {
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
) -> Result<(), String> {
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

/// What a program's bindings are.
fn touched(
    (res, ledger): (&Resources, &Ledger),
    interface: &Interface,
    bindings: &Bindings,
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
        match bind::bound(res, binding, bindings)? {
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

fn draw((res, ledger): (&Resources, &Ledger), open: &mut Open, indexed: bool) -> Result<(), Fault> {
    let id = open.pipeline.ok_or("a draw without a pipeline")?;
    let pipeline: &RenderPipeline = res.render_pipelines.get(id)?;
    let Step { reads, color_reads, writes, .. } = &mut open.step;
    reads.extend(open.vertex.values().map(|&buffer| Thing::Buffer(buffer)));
    if indexed {
        reads.extend(open.index.map(Thing::Buffer));
    }
    touched((res, ledger), pipeline.vertex().interface(), &open.bindings, reads, writes)?;
    if let Some(fragment) = pipeline.fragment() {
        let reads = if pipeline.shades_for_coverage() { reads } else { color_reads };
        touched((res, ledger), fragment.interface(), &open.bindings, reads, writes)?;
    }
    Ok(())
}

/// An upload, copy or clear; none for what touches nothing that is read.
fn copy(res: &Resources, command: &Command) -> Result<Option<Step>, String> {
    let level = |end: &TextureEnd| Thing::Level(end.texture.0, end.level);
    let whole = |buffer: num::BufferId, offset: u64, size: u64| -> Result<BTreeSet<Thing>, String> {
        let whole = offset == 0 && size == res.buffers.get(buffer.0)?.words.len();
        Ok(whole.then_some(Thing::Buffer(buffer.0)).into_iter().collect())
    };
    let (read, written, fresh) = match command {
        // What an upload leaves is there whatever was drawn: only where it leaves nothing of it does that matter.
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
        kind: Kind::Copy,
        fresh,
        reads: read.into_iter().collect(),
        writes: written.into_iter().collect(),
        ..Step::default()
    }))
}
