//! The contents of a trace, and what a rendering of it would refuse.
//!
//! The walk makes all objects and compiles all pipelines; nothing is drawn.

use std::collections::BTreeMap;
use std::sync::Arc;

use num::{NumberMap, TextureId};
use trace::check::Summary;
use trace::command::*;
use trace::{Trace, TraceError};

use super::execute::{Options, Renderer, Step, walk};
use super::fault::{Failure, Fault};
use super::ledger::Ledger;

/// The contents of a trace, and what a rendering of it would refuse.
#[derive(Debug)]
pub struct Inspection {
    /// Counts.
    pub summary: Summary,
    /// The kind of the frames.
    pub frames: Frames,
    /// Why objects that draws and dispatches use cannot be made: a rendering ends with one of these.
    pub refused: Vec<TraceError>,
    /// Why objects cannot be made that nothing uses.
    pub unused: Vec<TraceError>,
}

/// The kind of a trace's frames.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Frames {
    /// Each present ends one.
    Presents,
    /// Nothing is presented: the only frame shows what the last copy from a texture to a buffer reads.
    Copied(Image),
    /// Nothing is presented or copied: the only frame shows the last colour target.
    Drawn(Image),
    /// There is no picture.
    None,
}

/// An image of a texture.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Image {
    /// The texture's number.
    pub texture: u32,
    /// Its label.
    pub label: Option<String>,
    /// Level and layer.
    pub part: (u32, u32),
    /// Width and height in pixels.
    pub size: [u32; 2],
    /// The format's name.
    pub format: &'static str,
}

/// Inspects a trace.
///
/// # Errors
/// If the trace cannot be read or breaks a rule.
pub fn inspect(trace: &Trace) -> Result<Inspection, TraceError> {
    let ledger = Arc::new(Ledger::new(trace.limits()));
    let mut sink = |_| Ok(());
    let mut renderer = Renderer::new(trace, Options::default(), ledger.clone(), &mut sink);
    let mut inspector = Inspector::default();
    let summary = walk(trace, &ledger, &mut |step| match step {
        Step::Command(command) => inspector.command(&mut renderer, command),
        Step::End => {
            inspector.frames = Some(inspector.frames(&renderer));
            Ok(())
        }
    })?;
    let Inspector { refused, frames, .. } = inspector;
    let errors = |used: bool| {
        let failures = refused.iter().filter(|(_, wanted)| **wanted == used);
        failures.map(|((index, name, reason), _)| trace.error_at(*index, format!("{name}: {reason}"))).collect()
    };
    let (refused, unused) = (errors(true), errors(false));
    Ok(Inspection { summary: summary.unwrap_or_default(), frames: frames.unwrap_or(Frames::None), refused, unused })
}

/// A failure as a key: the number and name of the command that describes what cannot be made, and the reason.
type Key = (u64, &'static str, String);

#[derive(Default)]
struct Inspector {
    /// Why objects cannot be made, each with whether a draw or dispatch uses it.
    refused: BTreeMap<Key, bool>,
    /// The pipelines that cannot be compiled, by number; render and compute.
    broken: [NumberMap<u32, Key>; 2],
    labels: NumberMap<u32, String>,
    /// The pipeline that is set.
    pipeline: Option<u32>,
    /// The colour targets of the pass that is open, or was last.
    targets: Vec<(TextureId, u32, u32)>,
    copied: Option<(TextureId, u32, u32)>,
    drawn: Option<(TextureId, u32, u32)>,
    presents: bool,
    frames: Option<Frames>,
}

impl Inspector {
    fn command(&mut self, renderer: &mut Renderer<'_, '_>, command: &Command) -> Result<(), Fault> {
        if renderer.objects(command)? {
            return self.object(renderer, command);
        }
        match command {
            Command::BeginRenderPass { color, .. } => {
                self.pipeline = None;
                self.targets.clear();
                for target in color.iter().flatten() {
                    let view = renderer.res.views.get(target.resolve.unwrap_or(target.view).0)?;
                    let samples = renderer.res.textures.get(view.texture.0)?.image.samples;
                    let layer = view.range.base_layer + target.depth_slice.unwrap_or(0);
                    self.targets.extend((samples == 1).then_some((view.texture, view.range.base_level, layer)));
                }
            }
            Command::EndRenderPass => self.drawn = self.targets.last().copied().or(self.drawn),
            Command::BeginComputePass { .. } => self.pipeline = None,
            Command::CopyTextureToBuffer { from, .. } => self.copied = Some((from.texture, from.level, from.origin[2])),
            Command::Present { .. } => self.presents = true,
            command => self.inside(renderer, command)?,
        }
        Ok(())
    }

    fn object(&mut self, renderer: &Renderer<'_, '_>, command: &Command) -> Result<(), Fault> {
        let (kind, id, made) = match command {
            Command::CreateTexture { id, label: Some(label), .. } => {
                self.labels.insert(id.0, label.clone());
                return Ok(());
            }
            Command::CreateRenderPipeline { id, .. } => (0, id.0, renderer.res.render_pipeline(id.0).map(|_| ())),
            Command::CreateComputePipeline { id, .. } => (1, id.0, renderer.res.compute_pipeline(id.0).map(|_| ())),
            _ => return Ok(()),
        };
        match made {
            Err(Fault::Described(Failure { command: (index, name), reason })) => {
                let key = (index, name, reason.to_string());
                self.refused.entry(key.clone()).or_insert(false);
                self.broken[kind].insert(id, key);
                Ok(())
            }
            made => made,
        }
    }

    fn inside(&mut self, renderer: &Renderer<'_, '_>, command: &Command) -> Result<(), Fault> {
        match command {
            Command::SetRenderPipeline(id) => self.pipeline = Some(id.0),
            Command::SetComputePipeline(id) => self.pipeline = Some(id.0),
            Command::Dispatch { .. } | Command::DispatchIndirect { .. } => self.used(1),
            Command::ExecuteBundles(bundles) => {
                for bundle in bundles {
                    self.pipeline = None;
                    let commands = renderer.res.bundles.get(bundle.0)?.clone();
                    commands.iter().try_for_each(|command| self.inside(renderer, command))?;
                }
                self.pipeline = None;
            }
            // A draw of nothing uses no pipeline.
            command => {
                if command.draws().is_some_and(|draws| draws.vertices() != Some(0)) {
                    self.used(0);
                }
            }
        }
        Ok(())
    }

    fn used(&mut self, kind: usize) {
        let broken = self.pipeline.and_then(|id| self.broken[kind].get(id));
        if let Some(used) = broken.and_then(|key| self.refused.get_mut(key)) {
            *used = true;
        }
    }

    fn frames(&self, renderer: &Renderer<'_, '_>) -> Frames {
        let image = |&(texture, level, layer): &(TextureId, u32, u32)| {
            let image = renderer.res.textures.get(texture.0).ok()?.image;
            let [width, height, _] = image.level_size(level);
            let label = self.labels.get(texture.0).cloned();
            let (part, size, format) = ((level, layer), [width, height], image.format.name());
            Some(Image { texture: texture.0, label, part, size, format })
        };
        match (self.presents, self.copied.as_ref().and_then(image), self.drawn.as_ref().and_then(image)) {
            (true, ..) => Frames::Presents,
            (false, Some(image), _) => Frames::Copied(image),
            (false, None, Some(image)) => Frames::Drawn(image),
            (false, None, None) => Frames::None,
        }
    }
}
