//! Translates actions into commands.

use std::ops::Range;
use std::path::{Path, PathBuf};
use std::rc::Rc;

use gfx::state::TextureDimension;
use num::CallSite;
use trace::command::*;
use trace::{Builder, Origin, Reading, TextLocation, Trace, TraceError};

use super::blob::Blobs;
use super::lifetime;
use super::objects::*;
use super::schema::{self, Action, Id};

/// Translates the actions of one trace, in order.
pub struct Translator {
    file: PathBuf,
    pub(super) objects: Objects,
    pub(super) blobs: Blobs,
    pub(super) builder: Builder,
    commands: Vec<Command>,
    places: Vec<TextLocation>,
    dropped: Vec<Object>,
    /// Number, name and place of the action that is translated.
    number: u64,
    name: String,
    place: TextLocation,
    /// The lines of the commands in the action that do work and are not translated yet.
    lines: std::vec::IntoIter<u64>,
    /// What the commands say of where they were made.
    stated: Option<CallSite>,
    /// The submission that is translated: it may yet turn out to have failed.
    submission: Submission,
    /// The limits that the program asked of its device.
    pub(super) limits: schema::Limits,
    /// The configurations of surfaces, each with what its textures are and how many of them were presented.
    surfaces: Vec<(String, u64)>,
    /// What is known beside the commands.
    origin: Origin,
}

/// A submission: its command buffers stand in actions of their own, and run only if none of them fails.
#[derive(Default)]
struct Submission {
    number: Option<u64>,
    /// The commands of its command buffers.
    commands: Vec<Range<usize>>,
    /// Why one of these cannot be translated.
    refused: Option<TraceError>,
}

/// Why an action ends the import.
pub struct Stop {
    pub error: TraceError,
    /// The data of the action are not there, or not all.
    pub data: bool,
}

impl Translator {
    /// A translator of the trace whose actions are in this file, a text of this number of bytes.
    pub fn new(file: &Path, reading: &Reading, text: u64) -> Translator {
        Translator {
            file: file.to_path_buf(),
            objects: Objects::new(),
            blobs: Blobs::new(file.parent().unwrap_or(Path::new("")), reading, text),
            builder: Builder::new(file),
            commands: Vec::new(),
            places: Vec::new(),
            dropped: Vec::new(),
            number: 0,
            name: String::new(),
            place: TextLocation { line: 1, column: 1 },
            lines: Vec::new().into_iter(),
            stated: None,
            submission: Submission::default(),
            limits: schema::Limits::default(),
            surfaces: Vec::new(),
            origin: Origin::default(),
        }
    }

    /// The trace. `cut` says how the end of the recording is cut.
    pub fn finish(mut self, cut: Option<String>) -> Result<Trace, TraceError> {
        self.settle()?;
        let destroyed = lifetime::destructions(&self.commands, &self.dropped);
        let mut destroyed = destroyed.into_iter().peekable();
        for (index, (command, &place)) in self.commands.into_iter().zip(&self.places).enumerate() {
            self.builder.push_at(command, place);
            while let Some((_, object)) = destroyed.next_if(|&(after, _)| after == index) {
                self.builder.push_at(Command::Destroy(object), place);
            }
        }
        let mut origin = self.origin;
        for (textures, presented) in self.surfaces {
            let presented = match presented {
                1 => "1 present".to_owned(),
                count => format!("{count} presents"),
            };
            origin.facts.push(("surface".into(), format!("{textures}, {presented}")));
        }
        origin.cut = cut;
        Ok(self.builder.finish().with_origin(origin))
    }

    /// Appends a command, behind what says where it was made if it does work.
    pub(super) fn emit(&mut self, command: Command) {
        if command.does_work() {
            let site = CallSite::Line(self.lines.next().unwrap_or(self.place.line as u64));
            if self.stated.replace(site) != Some(site) {
                self.append(Command::SetCallSite(site));
            }
        }
        self.append(command);
    }

    fn append(&mut self, command: Command) {
        self.commands.push(command);
        self.places.push(self.place);
    }

    /// An object that no later action can name.
    pub(super) fn gone(&mut self, object: Option<Object>) {
        self.dropped.extend(object);
    }

    /// Translates an action of this number, name and place, with the lines of the commands in it that do work.
    pub fn step(
        &mut self,
        (number, name, place): (u64, &str, TextLocation),
        action: Action,
        lines: Vec<u64>,
    ) -> Result<(), Stop> {
        (self.number, self.place, self.lines) = (number, place, lines.into_iter());
        self.name.clear();
        self.name.push_str(name);
        match action {
            Action::Submit(submission, commands) => self.submit(submission, commands),
            Action::FailedCommands { failed_at_submit, error, .. } => {
                self.failed(failed_at_submit, &error);
                Ok(())
            }
            Action::Present(surface) => {
                // What a submission that failed has drawn is not presented.
                self.settle().map_err(|error| Stop { error, data: false })?;
                match self.present(surface) {
                    Err(reason @ Reason::Invalid(_)) => Err(self.stop(reason)),
                    presented => self.done(presented),
                }
            }
            action => self.creation(action),
        }
    }

    /// The end of an action that makes no object.
    fn done(&mut self, done: Result<(), Reason>) -> Result<(), Stop> {
        done.or_else(|reason| self.refuse(reason, "").map(|_| ()))
    }

    /// Takes a command buffer of a submission.
    fn submit(&mut self, submission: u64, commands: Vec<schema::Command>) -> Result<(), Stop> {
        if self.submission.number != Some(submission) {
            self.settle().map_err(|error| Stop { error, data: false })?;
            self.submission.number = Some(submission);
        }
        if self.submission.refused.is_some() {
            return Ok(());
        }
        let begin = self.commands.len();
        let translated = commands.into_iter().try_for_each(|command| self.command(command));
        self.submission.commands.push(begin..self.commands.len());
        match translated {
            Ok(()) => Ok(()),
            Err(reason @ (Reason::Damaged(_) | Reason::Data(_))) => Err(self.stop(reason)),
            Err(reason) => {
                self.submission.refused = Some(self.stop(reason).error);
                Ok(())
            }
        }
    }

    /// Commands did not run. Where their submission failed, none of its command buffers ran.
    fn failed(&mut self, submission: Option<u64>, error: &str) {
        let what = match submission {
            Some(number) => format!("submission {number}"),
            None => "a command buffer".to_owned(),
        };
        if submission.is_some() && submission == self.submission.number {
            for range in std::mem::take(&mut self.submission).commands.into_iter().rev() {
                self.stated = None;
                self.places.drain(range.clone());
                self.commands.drain(range);
            }
        }
        self.skipped(&what, error);
    }

    /// The last submission has run.
    fn settle(&mut self) -> Result<(), TraceError> {
        std::mem::take(&mut self.submission).refused.map_or(Ok(()), Err)
    }

    /// Notes that this action made nothing, as when it was recorded.
    fn skipped(&mut self, object: &str, reason: &str) {
        let TextLocation { line, column } = self.place;
        let what = if object.is_empty() { String::new() } else { format!("{object}: ") };
        self.origin.skip(|| format!("{line}:{column}: action {} ({}): {what}{reason}", self.number, self.name));
    }

    /// An action that makes nothing; an error if that is no fault of the recorded program.
    fn refuse(&mut self, reason: Reason, object: &str) -> Result<Rc<Refusal>, Stop> {
        match reason {
            Reason::Damaged(_) | Reason::Data(_) => Err(self.stop(reason)),
            Reason::Refused(reason) => {
                self.skipped(object, &reason);
                Ok(self.refusal(object, reason))
            }
            Reason::Invalid(refusal) => {
                let Refusal { action, name, object: of, reason, .. } = &*refusal;
                self.skipped(object, &format!("it uses {of}, which action {action} ({name}) did not make: {reason}"));
                Ok(refusal)
            }
        }
    }

    /// The end of the import at this action.
    fn stop(&self, reason: Reason) -> Stop {
        let here = format!("action {} ({})", self.number, self.name);
        let data = matches!(reason, Reason::Data(_));
        let (place, reason) = match reason {
            Reason::Damaged(reason) | Reason::Data(reason) | Reason::Refused(reason) => {
                (self.place, format!("{here}: {reason}"))
            }
            Reason::Invalid(refusal) => {
                let Refusal { action, name, place, object, reason } = &*refusal;
                (*place, format!("action {action} ({name}): {reason}; {here} uses {object}"))
            }
        };
        Stop { error: TraceError::new(&self.file, reason).at(Some(place)), data }
    }

    /// Makes an id name what an action has made, or an invalid object where it made nothing.
    fn make<T: AddressedObject>(
        &mut self,
        table: fn(&mut Objects) -> &mut Table<T>,
        (id, label): (Id, Option<String>),
        made: Result<T, Reason>,
    ) -> Result<(), Stop> {
        let made = match made {
            Ok(made) => Ok(made),
            Err(reason) => {
                let kind = table(&mut self.objects).kind;
                let name = label.map_or_else(|| id.address().to_string(), |label| format!("{label:?}"));
                Err(self.refuse(reason, &format!("{kind} {name}"))?)
            }
        };
        let old = table(&mut self.objects).set(id, made);
        self.gone(old.map(|old| old.object()));
        Ok(())
    }

    /// Translates an action outside of submissions.
    fn creation(&mut self, action: Action) -> Result<(), Stop> {
        match action {
            Action::CreateBuffer(id, desc) => {
                let (label, made) = (desc.label.clone(), self.create_buffer(desc));
                self.make(|o| &mut o.buffers, (id, label), made)
            }
            Action::CreateTexture(id, desc) => {
                let (label, made) = (desc.label.clone(), self.create_texture(desc));
                self.make(|o| &mut o.textures, (id, label), made)
            }
            Action::CreateTextureError(id, _) => {
                let made = Err("the texture was invalid when it was recorded".into());
                self.make(|o| &mut o.textures, (id, None), made)
            }
            Action::GetSurfaceTexture { id, parent } => {
                let made = self.acquire(id, parent);
                self.make(|o| &mut o.textures, (id, Some("surface".into())), made)
            }
            Action::CreateTextureView { id, parent, desc } => {
                let (label, made) = (desc.label.clone(), self.create_view(parent, desc));
                self.make(|o| &mut o.views, (id, label), made)
            }
            Action::CreateSampler(id, desc) => {
                let (label, made) = (desc.label.clone(), self.create_sampler(desc));
                self.make(|o| &mut o.samplers, (id, label), made)
            }
            Action::CreateQuerySet { id, desc } => {
                let (label, made) = (desc.label.clone(), self.create_query_set(desc));
                self.make(|o| &mut o.query_sets, (id, label), made)
            }
            Action::CreateBindGroupLayout(id, desc) => {
                let label = desc.label.clone();
                match self.create_group_layout(id, desc).transpose() {
                    Some(made) => self.make(|o| &mut o.group_layouts, (id, label), made),
                    None => Ok(()),
                }
            }
            Action::GetRenderPipelineBindGroupLayout { id, pipeline, index } => {
                let pipeline = self.objects.render_pipelines.get(pipeline);
                let known = pipeline.map(|pipeline| (AnyPipeline::Render(pipeline.id), pipeline.groups.clone()));
                match self.get_group_layout(id, known, index).transpose() {
                    Some(made) => self.make(|o| &mut o.group_layouts, (id, None), made),
                    None => Ok(()),
                }
            }
            Action::GetComputePipelineBindGroupLayout { id, pipeline, index } => {
                let pipeline = self.objects.compute_pipelines.get(pipeline);
                let known = pipeline.map(|pipeline| (AnyPipeline::Compute(pipeline.id), pipeline.groups.clone()));
                match self.get_group_layout(id, known, index).transpose() {
                    Some(made) => self.make(|o| &mut o.group_layouts, (id, None), made),
                    None => Ok(()),
                }
            }
            Action::CreateBindGroup(id, desc) => {
                let (label, made) = (desc.label.clone(), self.create_bind_group(desc));
                self.make(|o| &mut o.bind_groups, (id, label), made)
            }
            Action::CreatePipelineLayout(id, desc) => {
                let (label, made) = (desc.label.clone(), self.create_pipeline_layout(desc));
                self.make(|o| &mut o.pipeline_layouts, (id, label), made)
            }
            Action::CreateShaderModule { id, desc, data } => {
                let (label, made) = (desc.label.clone(), self.create_shader(desc.label, data));
                self.make(|o| &mut o.shaders, (id, label), made)
            }
            Action::CreateShaderModulePassthrough { id, data, label, .. } => {
                let made = self.create_passthrough(label.clone(), data);
                self.make(|o| &mut o.shaders, (id, label), made)
            }
            Action::CreateComputePipeline { id, desc } => {
                let (label, made) = (desc.label.clone(), self.create_compute_pipeline(*desc));
                self.make(|o| &mut o.compute_pipelines, (id, label), made)
            }
            Action::CreateGeneralRenderPipeline { id, desc } => {
                let (label, made) = (desc.label.clone(), self.create_render_pipeline(*desc));
                self.make(|o| &mut o.render_pipelines, (id, label), made)
            }
            Action::CreateRenderBundle { id, desc, base } => {
                let (label, begin) = (desc.label.clone(), self.commands.len());
                let made = self.create_bundle(desc, base);
                if made.is_err() {
                    self.stated = None;
                    self.commands.truncate(begin);
                    self.places.truncate(begin);
                }
                self.make(|o| &mut o.bundles, (id, label), made)
            }
            other => {
                let done = self.other(other);
                self.done(done)
            }
        }
    }

    /// Translates an action that makes no object of a table.
    fn other(&mut self, action: Action) -> Result<(), Reason> {
        match action {
            Action::Init { desc, .. } => {
                let features: Vec<&str> = desc.required_features.names().collect();
                let features = if features.is_empty() { "none".to_owned() } else { features.join(" | ") };
                self.origin.facts.push(("features asked for".into(), features));
                self.origin
                    .details
                    .extend(desc.required_limits.0.iter().map(|(name, value)| (name.clone(), value.to_string())));
                self.limits = desc.required_limits;
                Ok(())
            }

            Action::WriteBuffer { id, data, offset, size, queued } => self.write_buffer(id, data, (offset, size), queued),
            Action::WriteTexture { to, data, layout, size } => self.write_texture(to, data, layout, size),

            Action::ConfigureSurface(id, desc) => self.configure_surface(id, desc),
            Action::DiscardSurfaceTexture(surface) | Action::ReleaseSurfaceTexture(surface) => {
                let acquired = self.objects.surface(surface).acquired.take();
                self.gone(acquired.and_then(|acquired| acquired.texture.ok()).map(Object::Texture));
                Ok(())
            }

            Action::CreateExternalTexture { .. } => Err("external textures are not supported".into()),
            Action::CreateBlas { .. } | Action::CreateTlas { .. } => {
                Err("ray tracing (acceleration structures) is not supported".into())
            }
            // A cache does not change what a pipeline does.
            Action::CreatePipelineCache { .. } | Action::DropPipelineCache(_) => Ok(()),
            // Their creation is refused, so there is nothing to drop.
            Action::DropExternalTexture(_) | Action::DestroyExternalTexture(_) | Action::DropBlas(_) | Action::DropTlas(_) => {
                Ok(())
            }
            Action::DestroyTexture(id) => {
                for surface in self.objects.surfaces.values_mut() {
                    if let Some(acquired) = surface.acquired.as_mut().filter(|acquired| acquired.id == id) {
                        acquired.destroyed = true;
                    }
                }
                self.drop_object(Action::DestroyTexture(id));
                Ok(())
            }
            drop => {
                self.drop_object(drop);
                Ok(())
            }
        }
    }

    fn present(&mut self, surface: Id) -> Result<(), Reason> {
        let acquired = self.objects.surface(surface).acquired.take();
        let acquired = acquired.ok_or("the surface has no texture acquired, so there is none to present")?;
        let texture = acquired.texture.map_err(Reason::Invalid)?;
        self.gone(Some(Object::Texture(texture)));
        if acquired.destroyed {
            return Err("the texture that is presented was destroyed before".into());
        }
        self.surfaces[acquired.configuration].1 += 1;
        self.emit(Command::Present { texture });
        Ok(())
    }

    /// Notes that an object was dropped. It stays usable: a submit that was encoded before may come later in the file. A trace also
    /// drops objects that no action creates (derived pipeline layouts): these drops are ignored.
    fn drop_object(&mut self, action: Action) {
        fn known<T: AddressedObject>(table: &Table<T>, id: Id) -> Option<Object> {
            table.find(id).map(AddressedObject::object)
        }
        let o = &self.objects;
        let object = match action {
            Action::DropBuffer(id) | Action::DestroyBuffer(id) => known(&o.buffers, id),
            Action::DropTexture(id) | Action::DestroyTexture(id) => known(&o.textures, id),
            Action::DropTextureView(id) => known(&o.views, id),
            Action::DropSampler(id) => known(&o.samplers, id),
            Action::DropBindGroupLayout(id) => known(&o.group_layouts, id),
            Action::DropPipelineLayout(id) => known(&o.pipeline_layouts, id),
            Action::DropBindGroup(id) => known(&o.bind_groups, id),
            Action::DropShaderModule(id) => known(&o.shaders, id),
            Action::DropComputePipeline(id) => known(&o.compute_pipelines, id),
            Action::DropRenderPipeline(id) => known(&o.render_pipelines, id),
            Action::DropRenderBundle(id) => known(&o.bundles, id),
            Action::DropQuerySet(id) | Action::DestroyQuerySet(id) => known(&o.query_sets, id),
            _ => None,
        };
        self.gone(object);
    }

    /// A surface keeps its configuration where wgpu refuses another one.
    fn configure_surface(&mut self, id: Id, desc: schema::SurfaceConfiguration) -> Result<(), Reason> {
        let (width, height) = (desc.width, desc.height);
        if width == 0 || height == 0 {
            return Err(format!("a surface of {width}x{height}").into());
        }
        let most = self.limits.get("maxTextureDimension2D").unwrap_or(u64::MAX);
        if u64::from(width.max(height)) > most {
            return Err(format!("a surface of {width}x{height}, the device allows {most}x{most}").into());
        }
        if self.objects.surface(id).acquired.is_some() {
            return Err("the surface has given out a texture that is neither presented nor discarded".into());
        }
        let format = desc.format.known();
        let name = format.as_ref().map_or_else(String::clone, |format| format.name().to_owned());
        let desc_of = |format| TextureDesc {
            dimension: TextureDimension::D2,
            size: [width, height, 1],
            levels: 1,
            samples: 1,
            format,
            opaque: false,
        };
        let textures = match format {
            Ok(format) => Ok(desc_of(format)),
            Err(reason) => Err(self.refusal(&format!("surface {}", id.address()), reason)),
        };
        let number = self.surfaces.len();
        self.surfaces.push((format!("{width}x{height}, {name}"), 0));
        let writable = desc.usage.has("COPY_DST");
        self.objects.surface(id).textures = Some(SurfaceTextures { desc: textures, writable, number });
        Ok(())
    }

    pub(super) fn refusal(&self, object: &str, reason: String) -> Rc<Refusal> {
        let (name, object) = (self.name.clone(), object.to_owned());
        Rc::new(Refusal { action: self.number, name, place: self.place, object, reason })
    }
}
