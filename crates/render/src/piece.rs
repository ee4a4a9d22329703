//! Cuts frames out of a trace: a trace of its own that replays as these frames of the whole do.
//!
//! ```text
//! BeginSetup
//!   the objects that the frames use, at the addresses that they have in the whole
//!   their contents, results of queries, sprites and debug groups
//! EndSetup
//!   the commands of the frames
//! ```
//!
//! The whole is run up to the first of the frames. From there on commands are only kept, so that the state stays that of the beginning. At the
//! end it is known which objects the frames name: these, and those that they were made of, are set up. Ids are given anew, in the
//! same order, because ids of a trace are dense.

use std::collections::{BTreeMap, BTreeSet};
use std::mem::discriminant;
use std::ops::Range;
use std::rc::Rc;
use std::sync::Arc;

use num::{BufferId, CallSite, TextureId};
use trace::command::*;
use trace::record::Recorder;
use trace::{Bytes, Trace, TraceError};

use super::execute::{Options, Renderer, Step, walk};
use super::fault::Fault;
use super::ledger::Ledger;
use super::memory::{AddressSpace, texture_bytes};

/// An object that was created before the first of the frames.
struct Node {
    /// The number of its first command in the whole.
    order: u64,
    object: Object,
    /// The command that creates it; for a bundle, all its commands.
    commands: Vec<Command>,
    /// The text or code of a shader.
    source: Option<Bytes>,
    /// Its address in the card's memory, and its bytes there.
    memory: Option<(u64, u64)>,
    /// The objects that it was made of, some of which may be destroyed.
    parts: Vec<Rc<Node>>,
}

/// The objects of the whole at some command.
#[derive(Default)]
struct Objects {
    alive: BTreeMap<Object, Rc<Node>>,
    /// The bundle that is open.
    bundle: Option<Node>,
}

impl Objects {
    /// Notes the object that a command has created or destroyed.
    fn note(&mut self, index: u64, command: &Command, renderer: &Renderer<'_, '_>) -> Result<(), Fault> {
        if let Command::Destroy(object) = command {
            self.alive.remove(object);
            return Ok(());
        }
        let created = command.creates();
        if created.is_none() && self.bundle.is_none() {
            return Ok(());
        }
        let mut parts = Vec::new();
        command.for_each_object(|part| parts.extend(self.alive.get(&part).cloned()));
        let Some(object) = created else {
            let bundle = self.bundle.take().map(|mut node| {
                node.commands.push(command.clone());
                node.parts.append(&mut parts);
                node
            });
            match bundle {
                Some(node) if matches!(command, Command::EndBundle) => drop(self.alive.insert(node.object, Rc::new(node))),
                open => self.bundle = open,
            }
            return Ok(());
        };
        let (mut source, mut memory) = (None, None);
        match command {
            Command::CreateShader { source: of, .. } => source = Some(renderer.trace.blob(blob_of(of))?),
            Command::CreateBuffer { id, size, .. } => memory = Some((renderer.res.buffers.get(id.0)?.address, *size)),
            Command::CreateTexture { id, .. } => {
                let texture = renderer.res.textures.get(id.0)?;
                memory = Some((texture.address, texture_bytes(&texture.image)));
            }
            _ => {}
        }
        let node = Node { order: index, object, commands: vec![command.clone()], source, memory, parts };
        match object {
            Object::Bundle(_) => self.bundle = Some(node),
            _ => drop(self.alive.insert(object, Rc::new(node))),
        }
        Ok(())
    }

    /// The objects that are named, and all that they were made of, in the order of their creation.
    fn needed(&self, named: impl Iterator<Item = Object>) -> BTreeMap<u64, Rc<Node>> {
        let mut needed = BTreeMap::new();
        let mut open: Vec<&Rc<Node>> = named.filter_map(|object| self.alive.get(&object)).collect();
        while let Some(node) = open.pop() {
            if needed.insert(node.order, node.clone()).is_none() {
                open.extend(&node.parts);
            }
        }
        needed
    }
}

/// The name of the blob of a shader.
fn blob_of(source: &ShaderSource) -> &str {
    let (ShaderSource::Wgsl(name) | ShaderSource::SpirV(name) | ShaderSource::NagaIr(name)) = source;
    name
}

/// Keeps the source of a shader.
fn keep_source(recorder: &mut Recorder, source: &mut ShaderSource, bytes: &Bytes) {
    let (ShaderSource::Wgsl(name) | ShaderSource::SpirV(name) | ShaderSource::NagaIr(name)) = source;
    let (stem, extension) = name.rsplit_once('.').unwrap_or((name, "bin"));
    *name = recorder.keep(stem, extension, bytes[..].into());
}

/// Keeps the bytes that a command carries.
fn keep_bytes(recorder: &mut Recorder, trace: &Trace, command: &mut Command) -> Result<(), TraceError> {
    match command {
        Command::CreateShader { source, .. } => {
            let bytes = trace.blob(blob_of(source))?;
            keep_source(recorder, source, &bytes);
        }
        Command::WriteBuffer { data, .. }
        | Command::WriteTexture { data, .. }
        | Command::RestoreTexture { data, .. }
        | Command::RestoreQueries { data, .. } => {
            let bytes = trace.data(data)?;
            let stem = data.blob.rsplit_once('.').map_or(&*data.blob, |(stem, _)| stem);
            *data = recorder.data(stem, &bytes[..]);
        }
        _ => {}
    }
    Ok(())
}

/// A piece of a trace: a trace that replays alone, with the pictures and the cycles that a replay of these frames of the whole has. None if
/// the whole has no such frame.
///
/// # Errors
/// If the trace cannot be read, or a command before the first of the frames cannot be run; the error names the command.
pub fn piece(trace: &Trace, frames: Range<u32>) -> Result<Option<Trace>, TraceError> {
    let ledger = Arc::new(Ledger::new(trace.limits()));
    let options = Options { frames: frames.clone().into(), pictures: false, ..Options::default() };
    let mut sink = |_| Ok(());
    let mut renderer = Renderer::new(trace, options, ledger.clone(), &mut sink);
    let (mut objects, mut recorder) = (Objects::default(), Recorder::new(trace.file()));
    let (mut index, mut kept, mut ended) = (0, Vec::new(), 0);
    let (mut in_bundle, mut stated) = (false, false);
    walk(trace, &ledger, &mut |step| {
        if let Step::Command(command) = step {
            if renderer.frame < frames.start {
                renderer.run(command)?;
                objects.note(index, command, &renderer)?;
                index += 1;
                return Ok(());
            }
            match command {
                Command::SetCallSite(_) => stated = true,
                Command::BeginBundle { .. } => in_bundle = true,
                Command::EndBundle => in_bundle = false,
                // A command of a trace that does not say where it was made is called after its number in the whole.
                command if command.does_work() && !in_bundle && !stated && renderer.site.is_none() => {
                    kept.push(Command::SetCallSite(CallSite::Command(index)));
                }
                _ => {}
            }
            index += 1;
            let mut command = command.clone();
            keep_bytes(&mut recorder, trace, &mut command)?;
            ended += u32::from(matches!(command, Command::Present { .. }));
            kept.push(command);
            if ended < frames.end - frames.start {
                return Ok(());
            }
        }
        if frames.start > 0 && ended > 0 {
            kept = set_up(&renderer, &objects, &mut recorder, std::mem::take(&mut kept))?;
        }
        Err(Fault::Stop)
    })?;
    if frames.start > 0 && ended == 0 {
        return Ok(None);
    }
    renumber(&mut kept);
    kept.into_iter().for_each(|command| recorder.push(command));
    Ok(Some(recorder.finish()))
}

/// The commands of a piece: those of its frames behind those that set the state up in which they begin.
fn set_up(
    renderer: &Renderer<'_, '_>,
    objects: &Objects,
    recorder: &mut Recorder,
    frames: Vec<Command>,
) -> Result<Vec<Command>, Fault> {
    let sprites: Vec<Command> = renderer.sprites.commands().collect();
    let mut named = BTreeSet::new();
    for command in frames.iter().chain(&sprites).filter(|command| !matches!(command, Command::Destroy(_))) {
        command.for_each_object(|object| {
            named.insert(object);
        });
    }
    let needed = objects.needed(named.into_iter());
    let mut commands = vec![Command::BeginSetup];
    let (mut space, mut gone) = (AddressSpace::new(), Vec::new());
    for node in needed.values() {
        if let Some((address, bytes)) = node.memory {
            let take = |space: &mut AddressSpace| match node.object {
                Object::Texture(_) => space.texture(bytes),
                _ => space.buffer(bytes),
            };
            if take(&mut space.clone())? != address {
                space.skip(address)?;
                commands.push(Command::SkipAddresses { to: address });
            }
            take(&mut space)?;
        }
        for command in &node.commands {
            let mut command = command.clone();
            if let (Command::CreateShader { source, .. }, Some(bytes)) = (&mut command, &node.source) {
                keep_source(recorder, source, bytes);
            }
            commands.push(command);
        }
        if !objects.alive.contains_key(&node.object) {
            gone.push(Command::Destroy(node.object));
        }
    }
    commands.append(&mut gone);
    if space.end() != renderer.addresses.end() {
        commands.push(Command::SkipAddresses { to: renderer.addresses.end() });
    }
    for node in needed.values().filter(|node| objects.alive.contains_key(&node.object)) {
        match node.object {
            Object::Buffer(id) => commands.extend(buffer(renderer, recorder, id)?),
            Object::Texture(id) => textures(renderer, recorder, id, &mut commands)?,
            Object::QuerySet(set) => {
                let values = &renderer.res.query_sets.get(set.0)?.values;
                if values.iter().any(|&value| value != 0) {
                    let bytes: Vec<u8> = values.iter().flat_map(|value| value.to_le_bytes()).collect();
                    commands.push(Command::RestoreQueries { set, data: recorder.data("queries", bytes) });
                }
            }
            _ => {}
        }
    }
    commands.extend(sprites);
    commands.extend(renderer.groups.open().map(|label| Command::PushDebugGroup(label.to_owned())));
    commands.extend(renderer.site.map(Command::SetCallSite));
    commands.push(Command::EndSetup { moments: renderer.moment });
    let mut known: BTreeSet<Object> = needed.values().map(|node| node.object).collect();
    for command in frames {
        known.extend(command.creates());
        // Objects that the frames only destroy are not set up.
        if !matches!(&command, Command::Destroy(object) if !known.contains(object)) {
            commands.push(command);
        }
    }
    Ok(commands)
}

/// The command that gives a buffer its contents; none if it is empty or all zero.
fn buffer(renderer: &Renderer<'_, '_>, recorder: &mut Recorder, id: BufferId) -> Result<Option<Command>, Fault> {
    let words = &renderer.res.buffers.get(id.0)?.words;
    let mut bytes = vec![0; words.len() as usize];
    words.read(0, &mut bytes);
    let written = bytes.iter().any(|&byte| byte != 0);
    Ok(written.then(|| Command::WriteBuffer { id, offset: 0, data: recorder.data("buffer", bytes) }))
}

/// Adds the commands that give a texture its contents: one for each image that is not all zero.
fn textures(
    renderer: &Renderer<'_, '_>,
    recorder: &mut Recorder,
    id: TextureId,
    commands: &mut Vec<Command>,
) -> Result<(), Fault> {
    let texture = renderer.res.textures.get(id.0)?;
    for level in 0..texture.image.levels {
        for layer in 0..texture.image.level_size(level)[2] {
            let bytes = texture.image_bytes(level, layer);
            if bytes.iter().any(|&byte| byte != 0) {
                let data = recorder.data("texture", &bytes[..]);
                commands.push(Command::RestoreTexture { texture: id, level, layer, data });
            }
        }
    }
    Ok(())
}

/// Gives the objects of a trace dense ids, in the order of the ids that they have.
fn renumber(commands: &mut [Command]) {
    let created: BTreeSet<Object> = commands.iter().filter_map(Command::creates).collect();
    let (mut ids, mut last, mut next) = (BTreeMap::new(), None, 0);
    for object in created {
        let kind = discriminant(&object);
        if last.replace(kind) != Some(kind) {
            next = 0;
        }
        ids.insert(object, next);
        next += 1;
    }
    // An object that is not created keeps its id, and the checker names it.
    commands.iter_mut().for_each(|command| command.renumber(|object| ids.get(&object).copied().unwrap_or(u32::MAX)));
}
