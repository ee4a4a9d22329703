//! Contexts and share groups. The machine's fields hold the state of the context that is current in the thread that calls; the state of the
//! others is kept here, and exchanged with the machine's when another context becomes current.
//!
//! Textures, buffers, shaders, programs, render buffers, samplers and display lists belong to a share group. Frame buffer objects, vertex array
//! objects and all other state belong to one context. Texture objects of name 0 are shared too, as in Mesa.
//!
//! Up to the first call that makes a context current there is one that the recording need not make: recordings of GLInterceptor and parts of
//! recordings may have no such call.

use std::rc::Rc;

use num::NumberMap;

use super::arb;
use super::arrays::Arrays;
use super::buffers::{BufferObject, Mapping, UniformRange};
use super::call::{Fault, Outcome};
use super::consts as e;
use super::evaluator::Maps;
use super::framebuffer::{Framebuffer, Renderbuffer};
use super::glsl;
use super::image::PixelStore;
use super::lists::List;
use super::machine::Gl;
use super::materials::{Given, Tracked};
use super::pixel_data::PixelMaps;
use super::saved::Saved;
use super::state::{IMAGES, Stack, State, UNITS, Vertex};
use super::texture::Texture;

/// Maximum number of contexts of a recording.
const CONTEXTS_MAX: usize = 1 << 16;
/// Maximum number of contexts at once: each has some ten thousand bytes of state.
const ALIVE_MAX: usize = 1 << 10;
/// Maximum number of threads in which a context is current at once.
const THREADS_MAX: usize = 1 << 12;

/// Declares to whom each field of [`Gl`] belongs: to a context, to a share group, or to the machine. The initial values are those of a new
/// context and a new share group.
macro_rules! fields {
    (
        context { $($context:ident: $of_context:ty = $new_context:expr,)+ }
        group { $($group:ident: $of_group:ty = $new_group:expr,)+ }
        machine { $($machine:ident,)+ }
    ) => {
        /// The state of a context, by the fields of [`Gl`].
        pub struct Context {
            $(pub $context: $of_context,)+
            programs: arb::OfContext,
            /// The current GLSL program.
            program: u32,
        }

        /// The objects of a share group, by the fields of [`Gl`].
        pub struct ShareGroup {
            $(pub $group: $of_group,)+
            programs: arb::OfGroup,
            glsl: glsl::OfGroup,
        }

        impl Default for Context {
            fn default() -> Context {
                Context { $($context: $new_context,)+ programs: arb::OfContext::default(), program: 0 }
            }
        }

        impl Default for ShareGroup {
            fn default() -> ShareGroup {
                ShareGroup { $($group: $new_group,)+ programs: arb::OfGroup::default(), glsl: glsl::OfGroup::default() }
            }
        }

        /// Exchanges the state of the machine with that of a context and its share group.
        fn exchange(gl: &mut Gl, context: &mut Context, shared: &mut ShareGroup) {
            // A field that is in no list does not compile.
            let Gl { programs, glsl, $($context,)+ $($group,)+ $($machine: _,)+ } = gl;
            $(std::mem::swap($context, &mut context.$context);)+
            $(std::mem::swap($group, &mut shared.$group);)+
            programs.exchange(&mut context.programs, &mut shared.programs);
            glsl.exchange(&mut context.program, &mut shared.glsl);
        }
    };
}

fields! {
    context {
        state: State = State::default(),
        saved: Vec<Saved> = Vec::new(),
        modelview: Stack = Stack::new(32),
        projection: Stack = Stack::new(32),
        texture_matrices: [Stack; UNITS] = std::array::from_fn(|_| Stack::new(10)),
        color_matrix: Stack = Stack::new(10),
        arrays: Arrays = Arrays::default(),
        saved_client: Vec<(u32, Box<(Arrays, PixelStore)>)> = Vec::new(),
        unpack: PixelStore = PixelStore::default(),
        uniform_buffers: NumberMap<u32, UniformRange> = NumberMap::new(),
        other_buffers: NumberMap<u32, u32> = NumberMap::new(),
        pack_buffer: u32 = 0,
        pixel_maps: PixelMaps = PixelMaps::default(),
        framebuffers: NumberMap<u32, Framebuffer> = NumberMap::new(),
        draw_framebuffer: u32 = 0,
        read_framebuffer: u32 = 0,
        read_buffer: u32 = e::BACK,
        renderbuffer: u32 = 0,
        clear_accum: [f32; 4] = [0.0; 4],
        query: Option<u64> = None,
        seamless: bool = false,
        bound_samplers: [u32; IMAGES] = [0; IMAGES],
        compiling: Option<(u32, bool, List)> = None,
        maps: Maps = Maps::default(),
        begun: Option<(u32, Vec<Vertex>)> = None,
        tracked: Option<Tracked> = None,
        given: Given = Given::default(),
        render_mode: u32 = e::RENDER,
        sized: bool = false,
    }
    group {
        buffers: NumberMap<u32, BufferObject> = NumberMap::new(),
        mappings: Vec<Mapping> = Vec::new(),
        renderbuffers: NumberMap<u32, Renderbuffer> = NumberMap::new(),
        textures: NumberMap<u32, Texture> = NumberMap::new(),
        default_textures: NumberMap<u32, Texture> = NumberMap::new(),
        samplers: NumberMap<u32, Texture> = NumberMap::new(),
        lists: NumberMap<u32, Rc<List>> = NumberMap::new(),
    }
    machine {
        card, contexts, pixels, indexed, listed, as_mesa, instance, elements_omitted, accumulates, queries, spare, lone, follows, prepared,
        batch, keep_draws, survey, elements, packings, shaders, texts, calls, unsupported, errors, versions, renamed, looks, number, functions, counted, depth,
        list_began, steps, limits,
    }
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

/// Facts about a context that the recording makes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ContextFacts {
    /// The call that makes it; of a context whose creation was not recorded, the first call that names it.
    pub call: u64,
    /// The number of an earlier context whose objects it shares.
    pub shares: Option<usize>,
}

/// A context. While it is current, its state is in the machine.
struct Held {
    state: Box<Context>,
    group: u32,
    /// Its number among [`Contexts::facts`].
    number: usize,
    /// Whether it is destroyed as soon as it is current in no thread.
    doomed: bool,
}

/// A share group. While one of its contexts is current, its objects are in the machine.
struct Group {
    objects: Box<ShareGroup>,
    /// Number of its contexts.
    contexts: u32,
}

/// All contexts.
pub struct Contexts {
    held: NumberMap<u32, Held>,
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
            held: NumberMap::new(),
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
        contexts.held.insert(0, Held { state: Box::default(), group: 0, number: 0, doomed: false });
        contexts
    }
}

impl Contexts {
    fn add(&mut self, call: u64, handle: u64, share: Option<u32>) -> Outcome<u32> {
        if self.facts.len() >= CONTEXTS_MAX || self.held.len() > ALIVE_MAX {
            return Err(Fault::Limit(format!("more than {CONTEXTS_MAX} contexts, or {ALIVE_MAX} at once")));
        }
        let key = self.keys;
        self.keys += 1;
        let shared = share.and_then(|share| self.held.get(share)).map(|held| (held.group, held.number));
        let group = shared.map_or(key, |(group, _)| group);
        self.groups.get_or_insert_with(group, || Group { objects: Box::default(), contexts: 0 }).contexts += 1;
        let number = self.facts.len();
        self.facts.push(ContextFacts { call, shares: shared.map(|(_, number)| number) });
        self.held.insert(key, Held { state: Box::default(), group, number, doomed: false });
        self.handles.insert(handle, key);
        Ok(key)
    }

    /// The objects of the other share groups.
    pub fn other_groups(&mut self) -> impl Iterator<Item = &mut ShareGroup> {
        // The current group's box holds nothing: its objects are in the machine.
        self.groups.values_mut().map(|group| &mut *group.objects)
    }

    /// The states of the other contexts that share the objects of the current one.
    pub fn sharing(&mut self) -> impl Iterator<Item = &mut Context> {
        // The current one's box holds a state without bindings: its state is in the machine.
        let group = self.now.context.and_then(|now| self.held.get(now)).map(|held| held.group);
        self.held.values_mut().filter(move |held| Some(held.group) == group).map(|held| &mut *held.state)
    }

    /// The context of a handle, if it is known.
    pub fn known(&self, handle: u64) -> Option<u32> {
        self.handles.get(handle).copied()
    }

    fn is_current(&self, key: u32) -> bool {
        self.now.context == Some(key) || self.threads.values().any(|current| current.context == Some(key))
    }
}

impl Context {
    /// Whether this GLSL program is current.
    pub fn uses(&self, program: u32) -> bool {
        self.program == program
    }

    /// Marks bindings to a texture that another context deletes.
    pub fn lose_texture(&mut self, name: u32) {
        lose(self.state.units.iter_mut().flat_map(|unit| &mut unit.bound), name);
        self.framebuffers.values_mut().for_each(|object| object.lose_texture(name));
    }

    /// Marks bindings to a render buffer that another context deletes.
    pub fn lose_renderbuffer(&mut self, name: u32) {
        self.framebuffers.values_mut().for_each(|object| object.lose_renderbuffer(name));
    }

    /// Marks bindings to a buffer object that another context deletes.
    pub fn lose_buffer(&mut self, name: u32) {
        self.arrays.lose_buffer(name);
        lose(self.uniform_buffers.values_mut().map(UniformRange::buffer), name);
        lose(self.other_buffers.values_mut().chain([&mut self.unpack.buffer, &mut self.pack_buffer]), name);
    }

    /// Marks bindings to a sampler that another context deletes.
    pub fn lose_sampler(&mut self, name: u32) {
        lose(&mut self.bound_samplers, name);
    }
}

/// The name in bindings to objects that are deleted in another context, or while they are attached to a frame buffer object that is not bound. OpenGL
/// keeps such objects as long as something needs them; here their use is refused.
pub const GONE: u32 = u32::MAX;

/// Replaces a name in bindings by [`GONE`].
pub fn lose<'a>(bindings: impl IntoIterator<Item = &'a mut u32>, name: u32) {
    bindings.into_iter().filter(|bound| **bound == name).for_each(|bound| *bound = GONE);
}

/// The fault of a binding whose object is missing.
pub fn missing(name: u32, fault: Fault) -> Fault {
    match name {
        GONE => Fault::Unsupported(
            "objects that are deleted while they are bound in another context, or attached to a frame buffer object that is not bound".into(),
        ),
        _ => fault,
    }
}

impl Gl {
    /// Makes a context. It replaces one of the same handle, which the program must have destroyed in a way that was not recorded.
    pub fn create_context(&mut self, handle: u64, share: Option<u64>) -> Outcome {
        self.destroy_context(handle)?;
        let share = share.map(|share| self.context(share)).transpose()?;
        self.contexts.add(self.number, handle, share).map(drop)
    }

    /// The context of a handle. The first one whose creation was not recorded is the one that has run all calls so far.
    pub fn context(&mut self, handle: u64) -> Outcome<u32> {
        if let Some(key) = self.contexts.known(handle) {
            return Ok(key);
        }
        if std::mem::replace(&mut self.contexts.adopted, true) {
            self.refuse("several contexts of which the recording does not have the creation".into());
            return self.contexts.add(self.number, handle, Some(0));
        }
        let number = self.contexts.facts.len();
        self.contexts.facts.push(ContextFacts { call: self.number, shares: None });
        if let Some(held) = self.contexts.held.get_mut(0) {
            held.number = number;
        }
        self.contexts.handles.insert(handle, 0);
        Ok(0)
    }

    /// Makes a context current in the thread that calls; `Current::NONE` makes none current.
    pub fn make_current(&mut self, to: Current) -> Outcome {
        let before = self.contexts.now;
        if !std::mem::replace(&mut self.contexts.explicit, true)
            && to.context != Some(0)
            && let Some(window) = self.card.windows.at(0)
        {
            // The calls before it had no context: a clear of them is none of the window.
            window.early = Default::default();
        }
        if to.context.is_none() {
            self.contexts.threads.remove(self.contexts.thread);
        } else {
            self.contexts.threads.insert(self.contexts.thread, to);
        }
        if self.contexts.threads.len() > THREADS_MAX {
            return Err(Fault::Limit(format!("contexts that are current in more than {THREADS_MAX} threads")));
        }
        self.switch(to)?;
        if let Some(key) = before.context {
            self.free_context(key);
        }
        self.free_windows([before.draw, before.read]);
        Ok(())
    }

    /// Continues with a call of another thread.
    pub fn enter_thread(&mut self, thread: u32) -> Outcome {
        self.contexts.thread = thread;
        let unknown = if self.contexts.explicit { Current::NONE } else { Current::UNMADE };
        let to = self.contexts.threads.get(thread).copied().unwrap_or(unknown);
        self.switch(to)
    }

    /// Exchanges what is current.
    fn switch(&mut self, to: Current) -> Outcome {
        let from = self.contexts.now;
        if from == to {
            return Ok(());
        }
        // Primitives that wait belong to what was current.
        self.flush()?;
        self.prepared = None;
        if from.context != to.context {
            self.exchange(from.context);
            self.exchange(to.context);
        }
        self.contexts.now = to;
        (self.card.windows.draw, self.card.windows.read) = (to.draw, to.read);
        self.fit();
        Ok(())
    }

    fn exchange(&mut self, key: Option<u32>) {
        let Some(mut held) = key.and_then(|key| self.contexts.held.remove(key)) else { return };
        if let Some(mut group) = self.contexts.groups.remove(held.group) {
            exchange(self, &mut held.state, &mut group.objects);
            self.contexts.groups.insert(held.group, group);
        }
        if let Some(key) = key {
            self.contexts.held.insert(key, held);
        }
    }

    /// Gives a context that is current with a window for the first time a viewport and a scissor of the window's size.
    pub fn fit(&mut self) {
        let [width, height] = self.card.size();
        if !self.sized && self.contexts.now.context.is_some() && width > 0 {
            let whole = [0, 0, width as i32, height as i32];
            (self.state.viewport, self.state.scissor, self.sized) = (whole, whole, true);
        }
    }

    /// Destroys a context as soon as it is current in no thread.
    pub fn destroy_context(&mut self, handle: u64) -> Outcome {
        let Some(key) = self.contexts.handles.remove(handle) else { return Ok(()) };
        if let Some(held) = self.contexts.held.get_mut(key) {
            held.doomed = true;
        }
        self.free_context(key);
        Ok(())
    }

    /// Frees a context that is destroyed and current in no thread, and the objects that nobody shares any more.
    fn free_context(&mut self, key: u32) {
        if self.contexts.held.get(key).is_none_or(|held| !held.doomed) || self.contexts.is_current(key) {
            return;
        }
        let Some(held) = self.contexts.held.remove(key) else { return };
        let Some(group) = self.contexts.groups.get_mut(held.group) else { return };
        group.contexts -= 1;
        if group.contexts == 0
            && let Some(group) = self.contexts.groups.remove(held.group)
        {
            self.free_objects(*group.objects);
        }
    }

    /// Frees what the card has of the objects of a share group.
    fn free_objects(&mut self, mut group: ShareGroup) {
        let card = &mut self.card;
        for texture in group.textures.values_mut().chain(group.default_textures.values_mut()) {
            texture.free(card);
        }
        for buffer in group.renderbuffers.values_mut() {
            buffer.free(card);
        }
        for name in group.buffers.keys().collect::<Vec<_>>() {
            if let Some(buffer) = group.buffers.remove(name) {
                card.free_copy(buffer);
            }
        }
        for list in group.lists.values_mut() {
            list.free(card);
        }
    }

    /// Lets a context share the objects of another one from now on (`wglShareLists`).
    pub fn share(&mut self, from: u64, with: u64) -> Outcome {
        let (from, with) = (self.context(from)?, self.context(with)?);
        // The state of both is kept here meanwhile.
        let now = self.contexts.now;
        self.switch(Current::NONE)?;
        let of = |contexts: &Contexts, key| contexts.held.get(key).map(|held| (held.group, held.number));
        if let (Some((group, number)), Some((old, other))) = (of(&self.contexts, from), of(&self.contexts, with))
            && group != old
        {
            let users = self.contexts.groups.get(old).map_or(0, |group| group.contexts);
            let has_objects = self.contexts.groups.get(old).is_some_and(|group| !group.objects.is_empty());
            if users > 1 || has_objects {
                self.refuse("wglShareLists of a context that has objects".into());
            } else {
                self.contexts.groups.remove(old);
                if let Some(group) = self.contexts.groups.get_mut(group) {
                    group.contexts += 1;
                }
                if let Some(held) = self.contexts.held.get_mut(with) {
                    held.group = group;
                }
                self.contexts.facts[other].shares = Some(number);
            }
        }
        self.switch(now)
    }

    /// Destroys a drawable as soon as it is current in no thread.
    pub fn destroy_window(&mut self, handle: u64) {
        if let Some(number) = self.card.windows.forget(handle) {
            if let Some(window) = self.card.windows.at(number) {
                window.doomed = true;
            }
            self.free_windows([Some(number), None]);
        }
    }

    /// Frees those of these drawables that are destroyed and current in no thread.
    fn free_windows(&mut self, numbers: [Option<u32>; 2]) {
        for number in numbers.into_iter().flatten() {
            let is_in = |current: &Current| [current.draw, current.read].contains(&Some(number));
            if self.card.windows.at(number).is_some_and(|window| window.doomed)
                && !is_in(&self.contexts.now)
                && !self.contexts.threads.values().any(is_in)
            {
                self.card.free_window(number);
            }
        }
    }
}

impl ShareGroup {
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
