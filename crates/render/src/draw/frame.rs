//! The state of a draw, resolved once, and the scratch memory of each thread.

use std::ops::Deref;
use std::sync::Mutex;

use crate::ledger::Ledger;
use crate::pipeline::{Attribute, RenderPipeline, VaryingClass};
use gfx::interpolate::Weights;
use gfx::traverse::Blocks;
use gfx::vertex::VertexSource;
use num::{LANES, Lanes, LimitOverrun, Words};
use shader::{BuiltIn, Executor, Program, Recorder, Resources, Uniforms};

use super::pending::Pending;
use super::record::Room;
use super::settings::Settings;
use super::{BufferRange, DrawCall, Drawn};

/// A draw, checked and prepared: all that its stages read.
pub struct PreparedDraw<'a> {
    settings: &'a Settings,
    pub pipeline: &'a RenderPipeline,
    // Vertices.
    pub vertex_resources: Resources<'a>,
    pub vertex_uniforms: &'a Uniforms,
    vertex_buffers: &'a [Option<BufferRange>],
    pub vertex_builtins: &'a [(usize, BuiltIn)],
    pub base_vertex: u32,
    pub first_instance: u32,
    pub draw_index: u32,
    // Fragments.
    pub fragment_resources: Resources<'a>,
    pub fragment_uniforms: &'a Uniforms,
    /// The fragment program, where one has to run.
    pub fragment: Option<&'a Program>,
    pub classes: &'a [VaryingClass],
    pub fragment_builtins: &'a [(usize, BuiltIn)],
    /// Where work is counted.
    pub ledger: &'a Ledger,
}

impl Deref for PreparedDraw<'_> {
    type Target = Settings;

    #[inline(always)]
    fn deref(&self) -> &Settings {
        self.settings
    }
}

impl<'a> PreparedDraw<'a> {
    /// Prepares a call that has these settings. Uniforms are computed in the memory of others: those of the vertex program, then those of the
    /// fragment program.
    pub fn new(call: &DrawCall<'a>, settings: &'a Settings, uniforms: &'a mut [Uniforms; 2]) -> PreparedDraw<'a> {
        let [vertex_uniforms, fragment_uniforms] = uniforms;
        call.pipeline.vertex().uniforms_into(&call.vertex_resources, vertex_uniforms);
        let pipeline: &RenderPipeline = call.pipeline;
        let fragment = pipeline.fragment().filter(|_| settings.shades);
        if let Some(program) = fragment {
            program.uniforms_into(&call.fragment_resources.unwrap_or_default(), fragment_uniforms);
        }
        PreparedDraw {
            settings,
            pipeline,
            vertex_resources: call.vertex_resources,
            vertex_uniforms,
            vertex_buffers: call.vertex_buffers,
            vertex_builtins: &pipeline.builtins[0],
            base_vertex: if call.index.is_some() { call.range.base_vertex as u32 } else { call.range.first },
            first_instance: call.range.first_instance,
            draw_index: call.range.draw_index,
            fragment_resources: call.fragment_resources.unwrap_or_default(),
            fragment_uniforms,
            classes: fragment.map_or(&[], |_| &pipeline.classes),
            fragment_builtins: fragment.map_or(&[], |_| &pipeline.builtins[1]),
            fragment,
            ledger: call.ledger,
        }
    }

    /// Where an attribute is read from.
    pub fn source(&self, attribute: &Attribute) -> VertexSource<'a> {
        static NOTHING: std::sync::OnceLock<Words> = std::sync::OnceLock::new();
        match self.vertex_buffers.get(attribute.buffer) {
            Some(Some(range)) => {
                VertexSource { words: &range.words, offset: range.offset, size: range.size, stride: attribute.stride }
            }
            // Robust: what is not bound reads as zeros.
            _ => {
                let nothing = NOTHING.get_or_init(Words::default);
                VertexSource { words: nothing, offset: 0, size: 0, stride: attribute.stride }
            }
        }
    }
}

/// Weights of a batch's vertices, and 1/w.
#[derive(Default)]
pub struct FragmentWeights {
    pub weights: Weights,
    pub inv_w: Lanes,
}

/// Room for the blocks of a triangle in a tile, for one and for four samples per pixel: to make it anew for each tile took as long as to find
/// the blocks of two triangles.
#[derive(Default)]
pub struct BlockRoom {
    one: Blocks<1>,
    four: Blocks<4>,
}

impl AsMut<Blocks<1>> for BlockRoom {
    fn as_mut(&mut self) -> &mut Blocks<1> {
        &mut self.one
    }
}

impl AsMut<Blocks<4>> for BlockRoom {
    fn as_mut(&mut self) -> &mut Blocks<4> {
        &mut self.four
    }
}

/// Memory that a thread keeps from task to task.
#[derive(Default)]
pub struct Worker {
    pub blocks: BlockRoom,
    pub vertex: Executor,
    pub fragment: Executor,
    pub pending: Pending,
    pub weights: FragmentWeights,
    pub recorder: Recorder,
    /// The amount that was recorded of the last tiles.
    pub room: Room,
    /// Counts of the current segment, if it has drawn any of it.
    pub drawn: Option<Drawn>,
    /// Pairs of tile and triangle, before they are sorted.
    pub pairs: Vec<(u32, u32)>,
}

/// Scratch memory, one per thread of the pool.
pub struct Workers(Vec<Mutex<Worker>>);

impl Workers {
    /// Scratch for every thread of the current pool, and for one that is not of it.
    pub fn new() -> Workers {
        Workers((0..=rayon::current_num_threads()).map(|_| Mutex::default()).collect())
    }

    /// Whether there is a worker for every thread of the current pool.
    pub fn suffice(&self) -> bool {
        self.0.len() > rayon::current_num_threads()
    }

    /// Runs a task with the scratch of this thread. The task must not wait for other tasks.
    pub fn with<R>(&self, task: impl FnOnce(&mut Worker) -> R) -> R {
        let at = rayon::current_thread_index().map_or(0, |i| i + 1) % self.0.len();
        // A poisoned lock means that a task panicked; its scratch holds no invariant that the next one needs.
        let mut worker = self.0[at].lock().unwrap_or_else(std::sync::PoisonError::into_inner);
        task(&mut worker)
    }

    /// Charges to the ledger the steps of all threads that were not charged yet; whether they are still allowed.
    ///
    /// # Errors
    /// If they are more than the limit.
    pub fn settle(&self, ledger: &Ledger) -> Result<(), LimitOverrun> {
        for worker in &self.0 {
            let mut worker = worker.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
            let Worker { vertex, fragment, .. } = &mut *worker;
            ledger.steps.add(vertex.take_steps() + fragment.take_steps());
        }
        ledger.steps.verify()
    }

    /// Takes the counts of all threads, which are sums, and so the same however the work was shared.
    pub fn take_counts(&self) -> Drawn {
        let mut counts = Drawn::default();
        for worker in &self.0 {
            let mut worker = worker.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
            if let Some(drawn) = worker.drawn.take() {
                counts += drawn;
            }
        }
        counts
    }
}

const _: () = assert!(LANES == 64, "masks of blocks are lane masks");
