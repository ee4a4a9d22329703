//! The scratch memory of each thread.

use std::sync::Mutex;

use crate::ledger::Ledger;
use gfx::interpolate::Weights;
use gfx::stage::StageMap;
use gfx::traverse::Blocks;
use num::{LANES, Lanes, LimitOverrun};
use shader::{Executor, Recorder};

use super::Drawn;
use super::pending::Pending;
use super::record::Room;

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
    /// What runs the program of each stage.
    pub executors: StageMap<Executor>,
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
            ledger.steps.add(worker.executors.values_mut().map(Executor::take_steps).sum());
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
