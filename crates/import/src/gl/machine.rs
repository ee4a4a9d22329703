//! The OpenGL machine: calls in, commands for the card out.

use std::collections::BTreeMap;
use std::path::Path;
use std::rc::Rc;

use num::{Limits, NameMap, NumberMap};
use trace::Trace;

use super::arb::{MATRIX0, Programs};
use super::arrays::Arrays;
use super::buffers::{BufferObject, Mapping, UniformRange};
use super::call::{Arg, Call, Fault, Function, INVALID_OPERATION, Outcome, Shape};
use super::card::Card;
use super::consts as e;
use super::contexts::{Context, Contexts, ShareGroup};
use super::evaluator::Maps;
use super::framebuffer::{Framebuffer, Renderbuffer};
use super::geometry::Geometry;
use super::glsl::Glsl;
use super::image::PixelStore;
use super::key::ShaderKey;
use super::lists::List;
use super::materials::{Given, Tracked};
use super::pixel_data::PixelMaps;
use super::prepare::{Packings, Prepared};
use super::primitive::{Batch, Elements};
use super::rectangles::Source;
use super::saved::Saved;
use super::state::{IMAGES, Stack, State, UNITS, Vertex};
use super::table::{self, Entry, Moment};
use super::texture::Texture;

/// Maximum width and height of a window.
pub(super) const WINDOW_MAX: u32 = 16_384;
/// Maximum number of objects of each kind, so that a recording cannot use much memory with few calls.
const NAMES_MAX: usize = 1 << 20;
/// Maximum number of calls that display lists run: this many, and more for each call of the recording. Nested lists cause much work with
/// few bytes.
const STEPS_MAX: u64 = 1 << 30;
const STEPS_A_CALL: u64 = 1 << 14;
/// Maximum number of list calls, nested ones included, that one recorded call runs: the size of the largest list. Without it, one list that
/// calls itself twice could use up the limit for the whole recording.
const STEPS_A_LIST: u64 = 1 << 24;
/// Steps between two checks of the numbers of objects: a call makes at most one object.
const STEPS_A_LOOK: u64 = 64;

/// How often something occurred, and where it first occurred.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Count {
    /// How often.
    pub times: u64,
    /// Number of the first call.
    pub first: u64,
}

/// Counts by name.
pub type Counts = NameMap<Count>;

/// The machine.
pub struct Gl {
    /// The card.
    pub card: Card,
    /// Contexts, of which one is current.
    pub contexts: Contexts,
    /// The server's state.
    pub state: State,
    /// Saved states.
    pub saved: Vec<Saved>,
    /// Matrices.
    pub modelview: Stack,
    /// Matrices.
    pub projection: Stack,
    /// Matrices.
    pub texture_matrices: [Stack; UNITS],
    /// Matrices of colours; they have no effect.
    pub color_matrix: Stack,
    /// Client arrays.
    pub arrays: Arrays,
    /// Saved client state.
    pub saved_client: Vec<(u32, Box<(Arrays, PixelStore)>)>,
    /// Programs in assembly.
    pub programs: Programs,
    /// Shaders and programs in GLSL.
    pub glsl: Glsl,
    /// Buffer objects.
    pub buffers: NumberMap<u32, BufferObject>,
    /// Pixel storage modes for reading the client's pixels.
    pub unpack: PixelStore,
    /// Buffer objects that uniform blocks read, by binding.
    pub uniform_buffers: NumberMap<u32, UniformRange>,
    /// The buffer objects that are bound to targets that no draw reads.
    pub other_buffers: NumberMap<u32, u32>,
    /// The buffer object that pixels are read back into.
    pub pack_buffer: u32,
    /// Buffer objects that are mapped.
    pub mappings: Vec<Mapping>,
    /// Pixel maps.
    pub pixel_maps: PixelMaps,
    /// The source of the pixel rectangle that is drawn.
    pub pixels: Option<Source>,
    /// Frame buffer objects by name.
    pub framebuffers: NumberMap<u32, Framebuffer>,
    /// The bound draw framebuffer; 0: the window.
    pub draw_framebuffer: u32,
    /// The bound read framebuffer.
    pub read_framebuffer: u32,
    /// The colour buffer of the window that is read.
    pub read_buffer: u32,
    /// Render buffers by name.
    pub renderbuffers: NumberMap<u32, Renderbuffer>,
    /// The bound renderbuffer.
    pub renderbuffer: u32,
    /// The clear value of the accumulation buffer.
    pub clear_accum: [f32; 4],
    /// Whether indices select the vertices of the draw that runs.
    pub indexed: bool,
    /// Whether the vertices that are drawn come from a display list.
    pub listed: bool,
    /// Whether what the standard leaves open is as in Mesa; else the recording is one of GLInterceptor, and its pictures are ATTILA's.
    pub as_mesa: bool,
    /// The instance that is drawn.
    pub instance: u32,
    /// Whether the recorder gives arrays in the program's memory for whole draws only, not for `glArrayElement`.
    pub elements_omitted: bool,
    /// Whether the window has an accumulation buffer, if the program has chosen the kind of window in the recording.
    pub accumulates: Option<bool>,
    /// The occlusion query that counts draws.
    pub query: Option<u64>,
    /// Uses of occlusion queries.
    pub queries: u64,
    /// Texture objects by name.
    pub textures: NumberMap<u32, Texture>,
    /// Whether filters cross the edges of cube map faces.
    pub seamless: bool,
    /// Sampler objects by name, stored as textures of which only the sampling parameters are used.
    pub samplers: NumberMap<u32, Texture>,
    /// The samplers of the units; 0: none.
    pub bound_samplers: [u32; IMAGES],
    /// Textures of name 0, by target.
    pub default_textures: NumberMap<u32, Texture>,
    /// Display lists.
    pub lists: NumberMap<u32, Rc<List>>,
    /// The list that is compiled: name, whether it is executed too.
    pub compiling: Option<(u32, bool, List)>,
    /// Evaluators.
    pub maps: Maps,
    /// Between Begin and End: the mode and the vertices.
    pub begun: Option<(u32, Vec<Vertex>)>,
    /// The vertex memory of the previous primitive, for reuse.
    pub spare: Vec<Vertex>,
    /// The primitives of a list that the batch began with.
    pub lone: Option<Rc<Geometry>>,
    /// Whether the last draw was one of few vertices of a list from the card's memory, and nothing has changed the state since.
    pub follows: bool,
    /// The last draw, if nothing has changed since that draws are prepared for.
    pub prepared: Option<Box<Prepared>>,
    /// How vertices get materials that change between Begin and End, if one has changed.
    pub tracked: Option<Tracked>,
    /// The materials that `glMaterial` has set, for colour material.
    pub given: Given,
    /// Primitives that wait for a draw.
    pub batch: Batch,
    /// Whether each primitive call is a draw, with its attributes in full.
    pub keep_draws: bool,
    /// Whether vertices are left out of draws, because only facts about the recording are collected.
    pub survey: bool,
    /// With `keep_draws`: what the arrays of the current call send.
    pub elements: Option<Elements>,
    /// `GL_RENDER`, `GL_FEEDBACK` or `GL_SELECT`.
    pub render_mode: u32,
    /// Layouts of vertices, by shader.
    pub packings: NumberMap<num::ShaderId, Packings>,
    /// Shaders by key.
    pub shaders: BTreeMap<ShaderKey, num::ShaderId>,
    /// Their labels and WGSL, in the order in which they were made.
    pub texts: Vec<(String, String)>,
    /// Calls by name.
    pub calls: NameMap<u64>,
    /// What is not supported.
    pub unsupported: Counts,
    /// Calls that raise an error.
    pub errors: Counts,
    /// Versions of contexts, as the recorded driver has called them.
    pub versions: NameMap<()>,
    /// Buffer objects that have got another name, since they were deleted while vertex array objects have them.
    pub renamed: u32,
    /// How often a vertex array object has been searched for a deleted buffer object.
    pub looks: u64,
    /// The number of the call that runs.
    pub number: u64,
    /// The functions that the recording calls, by their numbers.
    pub(super) functions: Vec<Option<(Entry, Rc<Function>)>>,
    pub(super) counted: Vec<(Rc<str>, u64)>,
    /// Whether the context has been current with a window of a known size, which gave it its first viewport.
    pub sized: bool,
    /// Nesting depth of the lists that run.
    pub depth: u32,
    /// The value of `steps` when the outermost running list began.
    pub list_began: u64,
    /// Calls that ran.
    pub steps: u64,
    /// Limits for the recording.
    pub limits: Limits,
}

impl Gl {
    /// A machine in its initial state; messages about its commands use `name`.
    pub fn new(name: &Path, limits: &Limits) -> Gl {
        let (context, group) = (Context::default(), ShareGroup::default());
        Gl {
            card: Card::new(name),
            contexts: Contexts::default(),
            state: context.state,
            saved: context.saved,
            modelview: context.modelview,
            projection: context.projection,
            texture_matrices: context.texture_matrices,
            color_matrix: context.color_matrix,
            arrays: context.arrays,
            saved_client: context.saved_client,
            programs: Programs::default(),
            glsl: Glsl::default(),
            buffers: group.buffers,
            unpack: context.unpack,
            uniform_buffers: context.uniform_buffers,
            other_buffers: context.other_buffers,
            pack_buffer: context.pack_buffer,
            mappings: group.mappings,
            pixel_maps: context.pixel_maps,
            pixels: None,
            framebuffers: context.framebuffers,
            draw_framebuffer: context.draw_framebuffer,
            read_framebuffer: context.read_framebuffer,
            read_buffer: context.read_buffer,
            renderbuffers: group.renderbuffers,
            renderbuffer: context.renderbuffer,
            clear_accum: context.clear_accum,
            indexed: false,
            listed: false,
            as_mesa: true,
            instance: 0,
            elements_omitted: false,
            accumulates: None,
            query: context.query,
            queries: 0,
            textures: group.textures,
            seamless: context.seamless,
            samplers: group.samplers,
            bound_samplers: context.bound_samplers,
            default_textures: group.default_textures,
            lists: group.lists,
            compiling: context.compiling,
            maps: context.maps,
            begun: context.begun,
            spare: Vec::new(),
            lone: None,
            follows: false,
            prepared: None,
            tracked: context.tracked,
            given: context.given,
            batch: Batch::default(),
            keep_draws: false,
            survey: false,
            elements: None,
            render_mode: context.render_mode,
            packings: NumberMap::new(),
            shaders: BTreeMap::new(),
            texts: Vec::new(),
            calls: NameMap::new(),
            unsupported: Counts::new(),
            errors: Counts::new(),
            versions: NameMap::new(),
            renamed: 0,
            looks: 0,
            number: 0,
            functions: Vec::new(),
            counted: Vec::new(),
            sized: context.sized,
            depth: 0,
            list_began: 0,
            steps: 0,
            limits: *limits,
        }
    }

    /// How many of a primitive's `count` vertices are read: a survey needs only the first few to find what a draw requires.
    pub fn vertices_read(&self, count: usize) -> usize {
        if self.survey { count.min(4) } else { count }
    }

    /// Counts a feature that is not supported.
    pub fn refuse(&mut self, what: String) {
        let count = self.unsupported.get_or_insert_with(&what, || Count { times: 0, first: self.number });
        count.times += 1;
    }

    /// Counts an OpenGL error of the call that runs.
    pub fn note_error(&mut self, what: &str) {
        self.errors.get_or_insert_with(what, || Count { times: 0, first: self.number }).times += 1;
    }

    /// Runs a call. An error ends the import.
    pub fn call(&mut self, call: &Call) -> Result<(), String> {
        self.number = call.number;
        if call.thread != self.contexts.thread {
            let entered = self.enter_thread(call.thread);
            self.settle(call, entered)?;
        }
        let id = call.function.id as usize;
        if self.functions.len() <= id {
            self.functions.resize(id + 1, None);
            self.counted.resize(id + 1, ("".into(), 0));
        }
        let (entry, _) = self.functions[id].get_or_insert_with(|| (table::find(&call.function.name), call.function.clone()));
        let entry = *entry;
        let counted = &mut self.counted[id];
        if counted.1 == 0 {
            counted.0 = call.function.name.clone();
        }
        counted.1 += 1;
        if self.contexts.now.context.is_none() && entry.moment != Moment::System {
            // As in Mesa, it does nothing.
            let outcome = if entry.moment == Moment::Ignored { Ok(()) } else { Err(Fault::Error("no current context")) };
            return self.settle(call, outcome);
        }
        if matches!(entry.moment, Moment::Server | Moment::Matrix | Moment::Vertex)
            && let Some((name, execute, list)) = self.compiling.take()
        {
            self.compiling = Some((name, execute, self.compile(list, entry, call)?));
            if !execute {
                return Ok(());
            }
        }
        let outcome = self.execute(entry, call);
        self.settle(call, outcome)
    }

    /// A function that has been called.
    pub fn function(&self, id: u32) -> Option<(Entry, Rc<Function>)> {
        self.functions.get(id as usize)?.clone()
    }

    /// Runs a call, whether it was recorded or comes from a list.
    pub fn execute(&mut self, entry: Entry, call: &Call) -> Outcome {
        match entry.moment {
            Moment::Vertex | Moment::Element | Moment::Ignored => return (entry.run)(self, call, entry.shape),
            Moment::System => {}
            _ if self.begun.is_some() => return Err(INVALID_OPERATION),
            Moment::Server | Moment::Matrix => self.flush()?,
            Moment::Client | Moment::Arrays => {}
        }
        let idle = || entry.idle.is_some_and(|idle| idle(self, call) == Ok(true));
        if matches!(entry.moment, Moment::Matrix | Moment::Arrays) || idle() {
            return (entry.run)(self, call, entry.shape);
        }
        // Some functions change the state for draws of their own.
        self.prepared = None;
        let outcome = (entry.run)(self, call, entry.shape);
        self.prepared = None;
        outcome
    }

    /// Counts the error or the unsupported feature of a call.
    pub fn settle(&mut self, call: &Call, outcome: Outcome) -> Result<(), String> {
        match outcome {
            Ok(()) => {}
            Err(Fault::Unsupported(what)) => self.refuse(what),
            Err(Fault::Error(error)) => self.note_error(&format!("{}: {error}", call.function.name)),
            Err(Fault::Damaged(reason)) | Err(Fault::Limit(reason)) => {
                let name = &*call.function.name;
                // With nested lists, the name is put in front only once.
                return Err(if reason.starts_with(name) { reason } else { format!("{name}: {reason}") });
            }
        }
        self.steps += 1;
        if self.depth > 0 && self.steps - self.list_began > STEPS_A_LIST {
            return Err(format!("{}: display lists of more than {STEPS_A_LIST} calls run in one", call.function.name));
        }
        if self.steps > STEPS_MAX.saturating_add(self.number.saturating_mul(STEPS_A_CALL)) {
            return Err(format!("{}: display lists of more than {STEPS_MAX} calls run", call.function.name));
        }
        if let Err(error) = self.limits.memory_bytes.check(self.card.bytes + self.card.kept_bytes) {
            return Err(format!("{}: {error}", call.function.name));
        }
        if self.steps.is_multiple_of(STEPS_A_LOOK) && self.objects() > NAMES_MAX {
            return Err(format!("{}: more than {NAMES_MAX} objects of one kind", call.function.name));
        }
        Ok(())
    }

    /// The number of objects of the most numerous kind.
    fn objects(&self) -> usize {
        let objects = [
            self.textures.len(),
            self.samplers.len(),
            self.lists.len(),
            self.buffers.len(),
            self.uniform_buffers.len(),
            self.framebuffers.len(),
            self.renderbuffers.len(),
            self.programs.len(),
            self.glsl.len(),
        ];
        objects.into_iter().max().unwrap_or(0)
    }

    /// Makes the window that is drawn to at least this large. If a recording does not state its size, its first viewport gives it.
    pub fn window(&mut self, size: [u32; 2], fixed: bool) -> Outcome {
        check_size(size)?;
        let old = self.card.size();
        let Some(window) = self.card.windows.drawn() else { return Ok(()) };
        let stated = window.fixed;
        window.fixed |= fixed;
        let new = if fixed { size } else { [old[0].max(size[0]), old[1].max(size[1])] };
        if (fixed || !stated) && new != old && !new.contains(&0) {
            self.flush()?;
            self.prepared = None;
            self.card.resize(new);
        }
        self.fit();
        Ok(())
    }

    /// Swaps the buffers of a window.
    pub fn swap(&mut self, window: u32) -> Outcome {
        self.flush()?;
        if self.card.is_shown(window) && self.card.frames + 1 == self.card.first_frame {
            self.card.end_pass();
            self.upload_changes();
        }
        self.card.present(window);
        Ok(())
    }

    /// Shows what has been drawn since the last frame as a frame, if that is wanted.
    pub fn show_rest(&mut self) -> Outcome {
        self.flush()?;
        if self.card.is_wanted() {
            self.card.end_pass();
            if let Some(window) = self.card.windows.to_show().filter(|_| self.card.drawn) {
                return self.swap(window);
            }
        }
        Ok(())
    }

    /// Calls by name.
    pub fn finish_counts(&mut self) {
        for (name, count) in self.counted.drain(..).filter(|&(_, count)| count > 0) {
            *self.calls.get_or_insert_with(&name, || 0) += count;
        }
    }

    /// The finished trace.
    pub fn finish(mut self) -> Outcome<Trace> {
        self.flush()?;
        self.card.end_pass();
        Ok(self.card.recorder.finish())
    }

    /// The current matrix stack. Only the texture units of fixed functions have matrices.
    pub fn stack(&mut self) -> Outcome<&mut Stack> {
        Ok(match self.state.matrix_mode {
            e::PROJECTION => &mut self.projection,
            e::TEXTURE => self.texture_matrices.get_mut(self.state.active).ok_or(INVALID_OPERATION)?,
            e::COLOR => &mut self.color_matrix,
            mode @ MATRIX0.. => &mut self.programs.matrices[(mode - MATRIX0) as usize],
            _ => &mut self.modelview,
        })
    }
}

/// Checks the size of a window.
pub fn check_size(size: [u32; 2]) -> Outcome {
    if size.into_iter().any(|edge| edge > WINDOW_MAX) {
        return Err(Fault::Limit(format!("a window of {} x {} pixels, at most {WINDOW_MAX} each", size[0], size[1])));
    }
    Ok(())
}

/// Components of a typed call from the argument `first` on. They are in an array if its name ends in `v`.
pub fn components(call: &Call, shape: Shape, first: usize) -> Outcome<([f64; 4], usize)> {
    let mut values = [0.0, 0.0, 0.0, 1.0];
    let count = shape.count.clamp(1, 4);
    if shape.vector {
        match call.arg(first) {
            Arg::Nums(numbers) => {
                let numbers =
                    numbers.get(..count).ok_or_else(|| Fault::Damaged(format!("an array of fewer than {count} numbers")))?;
                values[..count].copy_from_slice(numbers);
            }
            _ => values[0] = call.f64(first)?,
        }
    } else {
        for k in 0..count {
            values[k] = call.f64(first + k)?;
        }
    }
    Ok((values, count))
}

/// As [`parameters`], of a call whose parameter may be a colour or a place. One that has a single number gives zeros for the others, as
/// Mesa takes it.
pub fn padded(call: &Call, shape: Shape, first: usize) -> Outcome<Vec<f64>> {
    let mut values = parameters(call, first)?;
    if !shape.vector {
        values.resize(4, 0.0);
    }
    Ok(values)
}

/// Parameters of a typed call without a number in its name, from the argument `first` on.
pub fn parameters(call: &Call, first: usize) -> Outcome<Vec<f64>> {
    call.numbers(first).map(|numbers| numbers.into_owned())
}
