//! Contexts and share groups. The machine has the state of the context that is current in the thread that calls; the state of the others is
//! stored here, and exchanged with the machine's when another context becomes current.
//!
//! Textures, buffers, shaders, programs, render buffers, samplers and display lists belong to a share group. Frame buffer objects, vertex array
//! objects and all other state belong to one context. Texture objects of name 0 are shared too, as in Mesa.
//!
//! Up to the first call that makes a context current there is one that the recording need not make: recordings of GLInterceptor and parts of
//! recordings may have no such call.

use std::rc::Rc;

use num::NumberMap;

use crate::gl::call::{Fault, GlResult};
use crate::gl::card::device::Card;
use crate::gl::geometry::vertex::Vertex;
use crate::gl::state::arb::{ProgramBindings, ProgramObjects};
use crate::gl::state::arrays::Arrays;
use crate::gl::state::bindings::lose;
use crate::gl::state::buffers::{BufferBindings, BufferObject, Mapping, UniformRange};
use crate::gl::state::evaluator::Maps;
use crate::gl::state::framebuffers::{Framebuffers, RenderMode, Renderbuffer};
use crate::gl::state::glsl::GlslObjects;
use crate::gl::state::lists::List;
use crate::gl::state::materials::{ChangingMaterial, MaterialTracking};
use crate::gl::state::saved::Saved;
use crate::gl::state::server::State;
use crate::gl::state::texture::{SamplerBindings, Texture};
use crate::gl::state::transform::Matrices;
use crate::gl::texels::transfer::PixelMaps;
use crate::gl::texels::unpack::PixelStore;
use crate::report::ContextFacts;

/// Maximum number of contexts of a recording.
const CONTEXTS_MAX: usize = 1 << 16;
/// Maximum number of contexts at once: each has some ten thousand bytes of state.
const ALIVE_MAX: usize = 1 << 10;
/// Maximum number of threads in which a context is current at once.
const THREADS_MAX: usize = 1 << 12;

/// The state of a context beside what `glPushAttrib` saves.
#[derive(Default)]
pub struct Context {
    /// Saved server states.
    pub saved: Vec<Saved>,
    /// Matrices.
    pub matrices: Matrices,
    /// Client arrays.
    pub arrays: Arrays,
    /// Saved client states, each with the groups that it has.
    pub saved_client: Vec<(u32, Box<(Arrays, PixelStore)>)>,
    /// Pixel storage modes for reading the client's pixels.
    pub unpack: PixelStore,
    /// Pixel maps.
    pub pixel_maps: PixelMaps,
    /// Buffer objects that are bound, beside those of arrays and of [`Context::unpack`].
    pub buffers: BufferBindings,
    /// Frame buffer objects.
    pub framebuffers: Framebuffers,
    /// How textures are sampled.
    pub samplers: SamplerBindings,
    /// The assembly programs that are bound, and their parameters.
    pub programs: ProgramBindings,
    /// The current GLSL program; 0: none.
    pub glsl_program: u32,
    /// The occlusion query that counts draws.
    pub query: Option<u64>,
    /// The list that is compiled: name, whether it is executed too.
    pub compiling: Option<(u32, bool, List)>,
    /// Evaluators.
    pub maps: Maps,
    /// Between Begin and End: the mode and the vertices.
    pub open_primitive: Option<(u32, Vec<Vertex>)>,
    /// How vertices get materials that change between Begin and End, if one has changed.
    pub changing_material: Option<ChangingMaterial>,
    /// The materials that `glMaterial` has set, for colour material.
    pub material_tracking: MaterialTracking,
    /// `GL_RENDER`, `GL_FEEDBACK` or `GL_SELECT`.
    pub render_mode: RenderMode,
    /// Whether it has been current with a window of a known size, which gave it its first viewport.
    pub has_size: bool,
}

/// The objects of a share group.
#[derive(Default)]
pub struct Objects {
    /// Buffer objects by name.
    pub buffers: NumberMap<u32, BufferObject>,
    /// Buffer objects that are mapped.
    pub mappings: Vec<Mapping>,
    /// Render buffers by name.
    pub renderbuffers: NumberMap<u32, Renderbuffer>,
    /// Texture objects by name.
    pub textures: NumberMap<u32, Texture>,
    /// Textures of name 0, by target.
    pub default_textures: NumberMap<u32, Texture>,
    /// Sampler objects by name, stored as textures of which only the sampling parameters are used.
    pub samplers: NumberMap<u32, Texture>,
    /// Display lists.
    pub lists: NumberMap<u32, Rc<List>>,
    /// Assembly programs.
    pub programs: ProgramObjects,
    /// Shaders and programs in GLSL.
    pub glsl: GlslObjects,
}

/// What is current in a thread.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Current {
    /// The context; none: calls have no effect.
    pub context: Option<u32>,
    /// The drawable that it draws to.
    pub draw: Option<u32>,
    /// The drawable that it reads.
    pub read: Option<u32>,
}

impl Current {
    /// No context.
    pub const NONE: Current = Current { context: None, draw: None, read: None };
    /// The context and the window that a recording need not make.
    const UNMADE: Current = Current { context: Some(0), draw: Some(0), read: Some(0) };
}

/// A context. While it is current, its state is in the machine.
pub struct StoredContext {
    state: Box<State>,
    context: Box<Context>,
    group: u32,
    /// Its number among [`Contexts::facts`].
    number: usize,
    /// Whether it is destroyed as soon as it is current in no thread.
    doomed: bool,
}

/// A share group. While one of its contexts is current, its objects are in the machine.
struct Group {
    objects: Box<Objects>,
    /// Number of its contexts.
    contexts: u32,
}

/// All contexts.
pub struct Contexts {
    stored: NumberMap<u32, StoredContext>,
    groups: NumberMap<u32, Group>,
    /// Keys of `held` by the values that the recording calls contexts by.
    handles: NumberMap<u64, u32>,
    /// What is current in the threads that have a context.
    threads: NumberMap<u32, Current>,
    /// The thread whose call ran last.
    pub thread: u32,
    /// What is current in that thread.
    pub now: Current,
    /// Whether a call has made a context current.
    pub explicit: bool,
    /// Whether a context whose creation was not recorded is the one that recordings need not make.
    adopted: bool,
    /// Keys given to contexts and groups so far.
    keys: u32,
    /// Facts about all contexts that the recording makes.
    pub facts: Vec<ContextFacts>,
}

impl Default for Contexts {
    fn default() -> Self {
        let mut contexts = Contexts {
            stored: NumberMap::new(),
            groups: NumberMap::new(),
            handles: NumberMap::new(),
            threads: NumberMap::new(),
            thread: 0,
            now: Current::UNMADE,
            explicit: false,
            adopted: false,
            keys: 1,
            facts: Vec::new(),
        };
        contexts.groups.insert(0, Group { objects: Box::default(), contexts: 1 });
        contexts.stored.insert(0, StoredContext::new(0, 0));
        contexts
    }
}

impl Contexts {
    /// Makes a context that shares the objects of another one, or none.
    pub fn add(&mut self, call: u64, handle: u64, share: Option<u32>) -> GlResult<u32> {
        if self.facts.len() >= CONTEXTS_MAX || self.stored.len() > ALIVE_MAX {
            return Err(Fault::Limit(format!("more than {CONTEXTS_MAX} contexts, or {ALIVE_MAX} at once")));
        }
        let key = self.keys;
        self.keys += 1;
        let shared = share.and_then(|share| self.stored.get(share)).map(|stored| (stored.group, stored.number));
        let group = shared.map_or(key, |(group, _)| group);
        self.groups.get_or_insert_with(group, || Group { objects: Box::default(), contexts: 0 }).contexts += 1;
        let number = self.facts.len();
        self.facts.push(ContextFacts { call, shares: shared.map(|(_, number)| number) });
        self.stored.insert(key, StoredContext::new(group, number));
        self.handles.insert(handle, key);
        Ok(key)
    }

    /// Gives a handle to the context that recordings need not make. None if another handle has it.
    pub fn adopt(&mut self, call: u64, handle: u64) -> Option<u32> {
        if std::mem::replace(&mut self.adopted, true) {
            return None;
        }
        let number = self.facts.len();
        self.facts.push(ContextFacts { call, shares: None });
        if let Some(stored) = self.stored.get_mut(0) {
            stored.number = number;
        }
        self.handles.insert(handle, 0);
        Some(0)
    }

    /// Notes what is current in the thread that calls.
    pub fn set_current(&mut self, to: Current) -> GlResult {
        if to.context.is_none() {
            self.threads.remove(self.thread);
        } else {
            self.threads.insert(self.thread, to);
        }
        if self.threads.len() > THREADS_MAX {
            return Err(Fault::Limit(format!("contexts that are current in more than {THREADS_MAX} threads")));
        }
        Ok(())
    }

    /// What is current in a thread.
    pub fn current_in(&self, thread: u32) -> Current {
        let unknown = if self.explicit { Current::NONE } else { Current::UNMADE };
        self.threads.get(thread).copied().unwrap_or(unknown)
    }

    /// Exchanges the state of a context and the objects of its share group with those of the machine.
    pub fn exchange(&mut self, key: u32, state: &mut State, context: &mut Context, objects: &mut Objects) {
        let Some(stored) = self.stored.get_mut(key) else { return };
        std::mem::swap(state, &mut stored.state);
        std::mem::swap(context, &mut stored.context);
        if let Some(group) = self.groups.get_mut(stored.group) {
            std::mem::swap(objects, &mut group.objects);
        }
    }

    /// Destroys the context of a handle as soon as it is current in no thread.
    pub fn doom(&mut self, handle: u64) -> Option<u32> {
        let key = self.handles.remove(handle)?;
        if let Some(stored) = self.stored.get_mut(key) {
            stored.doomed = true;
        }
        Some(key)
    }

    /// Frees a context that is destroyed and current in no thread. Returns the objects that no context shares any more.
    pub fn free(&mut self, key: u32) -> Option<Objects> {
        if self.stored.get(key).is_none_or(|stored| !stored.doomed) || self.is_current(key) {
            return None;
        }
        let group = self.stored.remove(key)?.group;
        let shared = self.groups.get_mut(group)?;
        shared.contexts -= 1;
        if shared.contexts > 0 {
            return None;
        }
        self.groups.remove(group).map(|group| *group.objects)
    }

    /// Lets a context share the objects of another one from now on. False if it has objects of its own, which is not supported. No context
    /// is current.
    pub fn share(&mut self, from: u32, with: u32) -> bool {
        let of = |key| self.stored.get(key).map(|stored| (stored.group, stored.number));
        let (Some((group, number)), Some((old, other))) = (of(from), of(with)) else { return true };
        if group == old {
            return true;
        }
        if self.groups.get(old).is_some_and(|group| group.contexts > 1 || !group.objects.is_empty()) {
            return false;
        }
        self.groups.remove(old);
        if let Some(group) = self.groups.get_mut(group) {
            group.contexts += 1;
        }
        if let Some(stored) = self.stored.get_mut(with) {
            stored.group = group;
        }
        self.facts[other].shares = Some(number);
        true
    }

    /// The objects of the other share groups.
    pub fn other_groups(&mut self) -> impl Iterator<Item = &mut Objects> {
        // The current group's box holds nothing: its objects are in the machine.
        self.groups.values_mut().map(|group| &mut *group.objects)
    }

    /// The other contexts that share the objects of the current one.
    pub fn sharing(&mut self) -> impl Iterator<Item = &mut StoredContext> {
        // The current one's boxes hold a state without bindings: its state is in the machine.
        let group = self.now.context.and_then(|now| self.stored.get(now)).map(|stored| stored.group);
        self.stored.values_mut().filter(move |stored| Some(stored.group) == group)
    }

    /// The context of a handle, if it is known.
    pub fn known(&self, handle: u64) -> Option<u32> {
        self.handles.get(handle).copied()
    }

    /// Whether a window is current in any thread.
    pub fn uses_window(&self, number: u32) -> bool {
        let is_in = |current: &Current| [current.draw, current.read].contains(&Some(number));
        is_in(&self.now) || self.threads.values().any(is_in)
    }

    fn is_current(&self, key: u32) -> bool {
        self.now.context == Some(key) || self.threads.values().any(|current| current.context == Some(key))
    }
}

impl StoredContext {
    fn new(group: u32, number: usize) -> StoredContext {
        StoredContext { state: Box::default(), context: Box::default(), group, number, doomed: false }
    }

    /// Whether this GLSL program is current.
    pub fn uses(&self, program: u32) -> bool {
        self.context.glsl_program == program
    }

    /// Marks bindings to a texture that another context deletes.
    pub fn lose_texture(&mut self, name: u32) {
        lose(self.state.texturing.units.iter_mut().flat_map(|unit| &mut unit.bound), name);
        self.context.framebuffers.objects.values_mut().for_each(|object| object.lose_texture(name));
    }

    /// Marks bindings to a render buffer that another context deletes.
    pub fn lose_renderbuffer(&mut self, name: u32) {
        self.context.framebuffers.objects.values_mut().for_each(|object| object.lose_renderbuffer(name));
    }

    /// Marks bindings to a buffer object that another context deletes.
    pub fn lose_buffer(&mut self, name: u32) {
        let Context { arrays, buffers, unpack, .. } = &mut *self.context;
        arrays.lose_buffer(name);
        lose(buffers.uniform.values_mut().map(UniformRange::buffer), name);
        lose(buffers.other.values_mut().chain([&mut unpack.buffer, &mut buffers.pack]), name);
    }

    /// Marks bindings to a sampler that another context deletes.
    pub fn lose_sampler(&mut self, name: u32) {
        lose(&mut self.context.samplers.bound, name);
    }
}

impl Objects {
    /// Frees what the card has of the objects.
    pub fn free(mut self, card: &mut Card) {
        for texture in self.textures.values_mut().chain(self.default_textures.values_mut()) {
            texture.free(card);
        }
        for buffer in self.renderbuffers.values_mut() {
            buffer.free(card);
        }
        for name in self.buffers.keys().collect::<Vec<_>>() {
            if let Some(buffer) = self.buffers.remove(name) {
                card.free_copy(buffer);
            }
        }
        for list in self.lists.values_mut() {
            list.free(card);
        }
    }

    /// The number of objects of the most numerous kind.
    pub fn most(&self) -> usize {
        let counts = [
            self.textures.len(),
            self.samplers.len(),
            self.lists.len(),
            self.buffers.len(),
            self.renderbuffers.len(),
            self.programs.len(),
            self.glsl.len(),
        ];
        counts.into_iter().max().unwrap_or(0)
    }

    /// Whether it has no objects.
    fn is_empty(&self) -> bool {
        self.buffers.is_empty()
            && self.renderbuffers.is_empty()
            && self.textures.is_empty()
            && self.samplers.is_empty()
            && self.lists.is_empty()
            && self.programs.is_empty()
            && self.glsl.is_empty()
    }
}
