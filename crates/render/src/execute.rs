//! Runs a trace's commands in order.

use std::collections::VecDeque;
use std::ops::Range;
use std::sync::{Arc, Mutex};

use num::*;
use trace::check::Checker;
use trace::command::*;
use trace::{Trace, TraceError};
use work::{EndFrame, Event, Funnel, RenderKey, Segment, Surface, SurfaceKey};

use super::compute::ActiveCompute;
use super::debug_groups::DebugGroups;
use super::draw::{Boxes, Skips};
use super::fault::{Failure, Fault};
use super::ledger::{Claim, ConsumerMemory, Ledger, Watch};
use super::memory::AddressSpace;
use super::needs::Needs;
use super::objects::OpenBundle;
use super::pass::ActivePass;
use super::resources::*;
use super::sprites::Sprites;
use super::state::StateError;
use super::targets::TargetReader;

/// Some of a trace's frames, in ranges.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct FrameSet(Vec<Range<u32>>);

impl FrameSet {
    /// Whether a frame is among them.
    pub fn contains(&self, frame: u32) -> bool {
        self.0.iter().any(|range| range.contains(&frame))
    }

    /// The ranges, in the order in which they were given.
    pub fn ranges(&self) -> &[Range<u32>] {
        &self.0
    }

    /// The number behind the last.
    pub fn end(&self) -> u32 {
        self.0.iter().map(|range| range.end).max().unwrap_or(0)
    }

    /// How many there are, of ranges that do not overlap.
    pub fn count(&self) -> u64 {
        self.0.iter().map(|range| range.len() as u64).sum()
    }
}

impl From<Range<u32>> for FrameSet {
    fn from(range: Range<u32>) -> FrameSet {
        FrameSet(std::iter::once(range).collect())
    }
}

impl FromIterator<Range<u32>> for FrameSet {
    fn from_iter<I: IntoIterator<Item = Range<u32>>>(ranges: I) -> FrameSet {
        FrameSet(ranges.into_iter().collect())
    }
}

/// How a trace is rendered.
#[derive(Clone, Debug)]
pub struct Options {
    /// The key on which the recorded work depends.
    pub key: RenderKey,
    /// Whether work is recorded; if not, segments carry their funnels only.
    pub record: bool,
    /// The frames whose work is recorded. None: all frames.
    pub recorded: Option<FrameSet>,
    /// Frames in which a machine begins that knows nothing of the frames before.
    pub begins: Option<FrameSet>,
    /// The commands that have to be run. None: all commands.
    pub needs: Option<Arc<Needs>>,
    /// Whether recorded passes end with the memory that the blocks of their attachments take.
    pub stored: bool,
    /// Whether segments carry the number of pixels that their primitives are expected to cover, from their areas.
    pub areas: bool,
    /// Whether frames end with the picture that is shown; if not, with its size and format only.
    pub pictures: bool,
    /// Frames whose events are handed on; the others are rendered for what they leave behind.
    pub frames: FrameSet,
    /// Shortcuts that leave the image as it is.
    pub skips: Skips,
    /// The memory that the consumer keeps of the events.
    pub consumer_memory: ConsumerMemory,
    /// Watches the rendering: gets its ledger when it begins.
    pub watch: Option<Arc<Watch>>,
    /// Reads attachments as passes end, in the frames whose events are handed on.
    pub targets: Option<TargetReader>,
}

impl Default for Options {
    fn default() -> Self {
        Options {
            key: RenderKey::default(),
            record: false,
            recorded: None,
            begins: None,
            needs: None,
            stored: false,
            areas: false,
            pictures: true,
            frames: (0..u32::MAX).into(),
            skips: Skips::default(),
            consumer_memory: ConsumerMemory::default(),
            watch: None,
            targets: None,
        }
    }
}

/// The receiver has had enough: rendering stops without an error.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Stop;

/// Takes events in order.
pub type Sink<'s> = dyn FnMut(Event) -> Result<(), Stop> + 's;

/// The outcome of a rendering.
#[derive(Clone, Debug)]
pub struct Summary {
    /// Frames in the trace.
    pub frames: u32,
    /// Commands run.
    pub commands: u64,
    /// Fragments whose colours were not computed ([`Skips::overwritten`]).
    pub overwritten: u64,
    /// The work that was done, and the memory that was alive.
    pub ledger: Arc<Ledger>,
}

/// Bytes that a frame's statistics take where they are kept, about.
const FRAME: u64 = 16 << 10;

/// Renders a trace and hands its work on.
///
/// # Errors
/// If the trace cannot be read, or a command cannot be run; the error names the command.
pub fn render(trace: &Trace, options: &Options, sink: &mut Sink<'_>) -> Result<Summary, TraceError> {
    let ledger = Arc::new(Ledger::new(trace.limits()));
    if let Some(watch) = &options.watch {
        watch.begin(&ledger);
    }
    let mut renderer = Renderer::new(trace, options.clone(), ledger.clone(), sink);
    walk(trace, &ledger, &mut |step| match step {
        Step::Command(command) => renderer.run(command),
        Step::End => renderer.finish(),
    })?;
    let frames = renderer.frame.max(u32::from(renderer.implicit_frame));
    Ok(Summary { frames, commands: ledger.command().0 + 1, overwritten: renderer.overwritten, ledger })
}

/// The next step of a walk over a trace.
pub(super) enum Step<'c> {
    /// A command.
    Command(&'c Command),
    /// Its end.
    End,
}

/// Checks the commands of a trace and hands them on in order; what the trace holds, if it was not stopped before its end.
///
/// # Errors
/// What is wrong with the trace or with a command, which is named.
pub(super) fn walk(
    trace: &Trace,
    ledger: &Ledger,
    each: &mut dyn FnMut(Step<'_>) -> Result<(), Fault>,
) -> Result<Option<trace::Summary>, TraceError> {
    let mut checker = Checker::new(trace);
    let (mut commands, mut summary, mut site) = (0, None, None);
    let mut result = trace.for_each_command(|index, command| {
        commands = index;
        if let Command::SetCallSite(stated) = command {
            site = Some(*stated);
        }
        ledger.begin(index, command.name())?;
        checker.command(index, command)?;
        each(Step::Command(command))
    });
    if result.is_ok() {
        result = checker.finish().map_err(Fault::Trace).and_then(|found| {
            summary = Some(found);
            each(Step::End)
        });
    }
    let done = match result {
        Ok(()) => Ok(summary),
        Err(Fault::Stop) => Ok(None),
        Err(Fault::Reason(reason)) => Err(trace.error_at(commands, format!("{}: {reason}", ledger.command().1))),
        Err(Fault::Described(Failure { command: (index, name), reason })) => {
            Err(trace.error_at(index, format!("{name}: {reason}")))
        }
        Err(Fault::Trace(error)) if error.command.is_none() => Err(error.in_command(commands)),
        Err(Fault::Trace(error)) => Err(error),
    };
    done.map_err(|mut error| {
        // The commands of an imported trace have numbers that no tool of its recorder knows. A line stands in front of the reason already.
        let told = error.unsupported || error.place.is_some() && matches!(site, Some(CallSite::Line(_)));
        if let Some(site) = site.filter(|_| !told) {
            error.reason.push_str(&format!(" ({site} of the recording)"));
        }
        error
    })
}

/// The pass that is open between its begin and its end.
enum Scope {
    Outside,
    Render(Box<ActivePass>),
    Compute(Box<ActiveCompute>),
}

/// Bytes and memory of images of a texture, by level and layer.
type ImageClaims = NumberMap<(u32, u32), (u64, Claim)>;

/// What has been begun in a frame so far. Names count anew in each frame, so that they do not depend on what was read of earlier frames.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct FrameNumbers {
    /// Render passes.
    pub passes: u32,
    /// Draws, of indirect commands each.
    pub draws: u32,
    /// Dispatches.
    pub dispatches: u32,
}

/// A trace in execution.
pub(super) struct Renderer<'t, 's> {
    pub(super) trace: &'t Trace,
    pub(super) options: Options,
    pub(super) res: Resources,
    pub(super) addresses: AddressSpace,
    sink: &'s mut Sink<'s>,
    scope: Scope,
    /// The setup of a trace that was cut out of a longer one is open: commands belong to no frame.
    setup: bool,
    /// The bundle that is recorded.
    pub(super) bundle: Option<OpenBundle>,
    /// Number of the current frame.
    pub(super) frame: u32,
    /// The trace had no present, so that its end was the end of frame 0.
    implicit_frame: bool,
    /// Render passes begun in the trace.
    pub(super) passes: u32,
    /// Passes, draws and dispatches begun in the current frame.
    pub(super) numbers: FrameNumbers,
    /// The debug groups that are open.
    pub(super) groups: DebugGroups,
    /// Where the recorded program made the command that runs, if the trace says it.
    pub(super) site: Option<CallSite>,
    /// Fragments whose colours were not computed.
    pub(super) overwritten: u64,
    /// Render pipelines created.
    pub(super) pipelines: u64,
    /// Commands that dispatch.
    pub(super) dispatching: u32,
    /// Commands that count as moments of time, for time stamps.
    pub(super) moment: u64,
    /// The image that the last texture-to-buffer copy read.
    pub(super) copied: Option<(TextureId, u32, u32)>,
    /// The last colour target written.
    pub(super) drawn: Option<(TextureId, u32, u32)>,
    /// Ranges of buffers that tests of bounds know.
    pub(super) boxes: Arc<Mutex<Boxes>>,
    /// Work, and memory of all that is alive.
    pub(super) ledger: Arc<Ledger>,
    /// Memory of the pieces of work that the receiver may still have, the oldest first.
    pieces: VecDeque<Claim>,
    /// Memory of the images that the receiver keeps.
    images: NumberMap<TextureId, ImageClaims>,
    /// Memory of frames that have ended.
    frames: Option<Claim>,
    /// The sprites that the display lays over its lines.
    pub(super) sprites: Sprites,
    /// The image that was shown last, by the address of its texture, and the version of the contents.
    shown: Option<(u64, SurfaceKey, u64, Arc<[u8]>)>,
}

impl<'t, 's> Renderer<'t, 's> {
    pub(super) fn new<'a: 's>(
        trace: &'t Trace,
        options: Options,
        ledger: Arc<Ledger>,
        sink: &'s mut Sink<'a>,
    ) -> Renderer<'t, 's> {
        Renderer {
            trace,
            options,
            res: Resources::new(ledger.clone()),
            addresses: AddressSpace::new(),
            sink,
            scope: Scope::Outside,
            setup: false,
            bundle: None,
            frame: 0,
            implicit_frame: false,
            passes: 0,
            numbers: FrameNumbers::default(),
            groups: DebugGroups::default(),
            site: None,
            overwritten: 0,
            pipelines: 0,
            dispatching: 0,
            moment: 0,
            copied: None,
            drawn: None,
            boxes: Arc::default(),
            ledger,
            pieces: VecDeque::new(),
            images: NumberMap::new(),
            frames: None,
            sprites: Sprites::default(),
            shown: None,
        }
    }

    /// Whether the current frame's events are handed on.
    pub(super) fn in_range(&self) -> bool {
        self.options.frames.contains(self.frame) && !self.setup
    }

    /// Whether work is recorded now.
    pub(super) fn recording(&self) -> bool {
        let recorded = self.options.recorded.as_ref().is_none_or(|frames| frames.contains(self.frame));
        self.options.record && recorded && self.in_range()
    }

    /// Hands an event on, if the frame is wanted.
    pub(super) fn emit(&mut self, event: Event) -> Result<(), Fault> {
        if !self.in_range() {
            return Ok(());
        }
        if self.recording() {
            self.res.holdings.apply(&event)?;
        }
        let piece = match &event {
            // Counts alone are small, and the picture has its own claim.
            Event::Segment(_) if !self.recording() => 0,
            Event::EndFrame(_) => 0,
            event => event.bytes(),
        };
        if piece > 0 {
            if self.pieces.len() as u64 >= self.options.consumer_memory.pieces {
                self.pieces.pop_front();
            }
            self.pieces.push_back(self.ledger.claim("recorded work", piece)?);
        }
        Ok((self.sink)(event)?)
    }

    /// Claims the images that the receiver keeps of an attachment; it keeps them to the end.
    pub(super) fn claim_images(&mut self, surface: &Surface) -> Result<(), Fault> {
        let (texels, copies) = (u64::from(surface.width) * u64::from(surface.height), self.options.consumer_memory.images);
        // Words of 4 bytes per sample, at least.
        let words = u64::from(surface.samples) * u64::from(surface.format.block_bytes().div_ceil(4));
        let bytes = texels.saturating_mul(4 * words).saturating_mul(copies);
        let SurfaceKey { texture, level, layer } = surface.key;
        let claims = self.images.get_or_insert_with(TextureId(texture), NumberMap::new);
        if bytes == 0 || claims.get((level, layer)).is_some_and(|(claimed, _)| *claimed == bytes) {
            return Ok(());
        }
        claims.remove((level, layer));
        let claim = self.ledger.claim("the machine's images of an attachment", bytes)?;
        claims.insert((level, layer), (bytes, claim));
        Ok(())
    }

    pub(super) fn run(&mut self, command: &Command) -> Result<(), Fault> {
        if self.objects(command)? {
            return Ok(());
        }
        match std::mem::replace(&mut self.scope, Scope::Outside) {
            Scope::Outside => self.outside(command),
            Scope::Render(mut pass) => {
                if matches!(command, Command::EndRenderPass) {
                    return pass.end(self);
                }
                let result = pass.run(self, command);
                self.scope = Scope::Render(pass);
                result
            }
            Scope::Compute(mut pass) => {
                if matches!(command, Command::EndComputePass) {
                    return pass.end(self);
                }
                let result = pass.run(self, command);
                self.scope = Scope::Compute(pass);
                result
            }
        }
    }

    fn outside(&mut self, command: &Command) -> Result<(), Fault> {
        self.count(command);
        match command {
            Command::BeginRenderPass { color, depth, occlusion, timestamps, label } => {
                let label = label.clone().unwrap_or_default();
                let pass = ActivePass::begin(self, color, depth.as_ref(), *occlusion, timestamps.clone(), label)?;
                self.scope = Scope::Render(Box::new(pass));
            }
            Command::BeginComputePass { timestamps, .. } => {
                let pass = ActiveCompute::begin(self, timestamps.clone())?;
                self.scope = Scope::Compute(Box::new(pass));
            }
            Command::PushDebugGroup(_) | Command::PopDebugGroup => self.groups.note(command),
            Command::InsertDebugMarker(_) => {}
            Command::SetCallSite(site) => self.site = Some(*site),
            Command::BeginSetup => self.setup = true,
            &Command::EndSetup { moments } => (self.setup, self.moment) = (false, moments),
            command => self.transfer(command)?,
        }
        Ok(())
    }

    /// Counts a command as a moment of time. What says where commands come from is none, so that a trace's results do not depend on it.
    pub(super) fn count(&mut self, command: &Command) {
        self.moment += u64::from(!matches!(command, Command::SetCallSite(_)));
    }

    /// Where the command that runs was made: its own number, if the trace does not say it.
    pub(super) fn call_site(&self) -> CallSite {
        self.site.unwrap_or(CallSite::Command(self.ledger.command().0))
    }

    /// Time stamps count commands: no clock is known here, and a trace's results must not depend on the machine.
    pub(super) fn write_timestamp(&mut self, set: QuerySetId, index: u32) -> Result<(), Fault> {
        let moment = self.moment;
        self.res.query_sets.get_mut(set.0)?.slot(index)?[0] = moment;
        Ok(())
    }

    /// The next frame begins.
    pub(super) fn begin_frame(&mut self) {
        self.frame += 1;
        self.numbers = FrameNumbers::default();
        if self.options.begins.as_ref().is_some_and(|frames| frames.contains(self.frame)) {
            self.res.holdings.forget_all();
        }
    }

    pub(super) fn end_frame(&mut self, shown: Option<(TextureId, u32, u32)>) -> Result<(), Fault> {
        if !self.in_range() {
            return Ok(());
        }
        let frames = self.frames.take();
        let mut frames = frames.map_or_else(|| self.ledger.claim("the statistics of frames", 0), Ok)?;
        let kept = self.options.consumer_memory.frames;
        if kept {
            frames.grow("the statistics of a frame", FRAME)?;
        }
        let mut end = EndFrame { number: self.frame, shown: None, reference: Arc::from([]), drawn: false, sprites: [].into() };
        if let Some((id, level, layer)) = shown
            && !(self.options.pictures && self.options.needs.as_ref().is_none_or(|needs| needs.picture(self.frame)))
        {
            end.shown = Some(self.res.textures.get(id.0)?.surface(id, level, layer));
            self.show_sprites(None)?;
        } else if let Some((id, level, layer)) = shown {
            let format = self.res.textures.get(id.0)?.image.format;
            end.sprites = self.show_sprites(Some(format))?.into();
            let texture = self.res.textures.get(id.0)?;
            let surface: Surface = texture.surface(id, level, layer);
            let (address, version, bytes) = (texture.address, texture.version, texture.image.layer_bytes(level));
            end.drawn = self.res.holdings.is_drawn(&surface);
            end.shown = Some(surface);
            self.ledger.bytes.charge(bytes)?;
            match &self.shown {
                // A surface that is shown again unchanged is the same picture.
                Some((at, key, known, bytes)) if (*at, *key, *known) == (address, surface.key, version) => {
                    end.reference = bytes.clone();
                }
                _ => {
                    self.shown = None;
                    match kept {
                        true => frames.grow("the picture of a frame", bytes)?,
                        false => self.ledger.passing("the picture of a frame", bytes)?,
                    }
                    end.reference = self.res.textures.get(id.0)?.image_bytes(level, layer);
                    self.shown = Some((address, surface.key, version, end.reference.clone()));
                }
            }
        }
        self.frames = Some(frames);
        self.emit(Event::EndFrame(end))
    }

    fn finish(&mut self) -> Result<(), Fault> {
        if !matches!(self.scope, Scope::Outside) || self.bundle.is_some() {
            return Err(StateError::OpenScope.into());
        }
        if self.frame == 0 {
            self.implicit_frame = true;
            let exists = |shown: &(TextureId, u32, u32)| self.res.textures.get(shown.0.0).is_ok();
            let shown = self.copied.filter(exists).or(self.drawn.filter(exists));
            self.end_frame(shown)?;
        }
        Ok(())
    }
}

/// An event that has counts only.
pub(super) fn counts(funnel: Funnel) -> Event {
    Event::Segment(Arc::new(Segment { funnel, ..Segment::default() }))
}
