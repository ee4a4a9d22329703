//! Which core gets the next batch of vertices.

use super::super::token::Packing;
use super::{FetchConfig, VertexDeal};
use num::Cycle;

/// The core whose turn it is.
///
/// Where vertices follow fragments, one pointer says which core gets the next warp of either kind (ATTILA, FragmentFIFO):
///
/// * A warp of fragments takes it to its own core, and after `deal_warps` warps of both kinds that a core got, to the next one. A batch of
///   vertices goes where it is, and takes it to the next core.
/// * The pipelines are searched for a full warp in a circle. The search begins, and so ends, at the pipeline that was last held up by its
///   core, or at the first of all since a draw began. In a cycle without a batch of vertices, quads that wait there for a full warp take the
///   pointer to their core.
#[derive(Clone)]
pub(super) struct Deal {
    deal: VertexDeal,
    core: usize,
    /// The core that the batch at the head is for, where that is settled when its attributes are there.
    settled: Option<usize>,
    /// Warps of one core after which the pointer goes on, and how many each core has got since.
    warps: u32,
    got: Vec<u32>,
    /// The pipeline at which the search begins.
    begins: usize,
    /// The last message of each pipeline.
    pipelines: Vec<Packing>,
    /// When a batch was dealt last.
    last: Option<Cycle>,
}

impl Deal {
    pub fn new(config: &FetchConfig, cores: usize, pipelines: usize) -> Deal {
        Deal {
            deal: config.deal,
            core: 0,
            settled: None,
            warps: config.deal_warps,
            got: vec![0; cores],
            begins: 0,
            pipelines: vec![Packing::default(); pipelines],
            last: None,
        }
    }

    /// A pipeline has told something of its quads.
    pub fn told(&mut self, pipeline: usize, packing: Packing) {
        if packing.has(Packing::FIRST) {
            self.begins = 0;
        }
        if packing.has(Packing::STARTED) {
            self.core = usize::from(packing.core);
            self.got[self.core] += 1;
        }
        self.pipelines[pipeline] = packing;
    }

    /// All that was told in a cycle is there; `started`: a warp of fragments among it.
    pub fn settle(&mut self, started: bool) {
        let pipelines = self.pipelines.len();
        let circle = (0..pipelines).map(|step| (self.begins + step) % pipelines);
        if let Some(held_up) = circle.into_iter().find(|&at| self.pipelines[at].has(Packing::BLOCKED)) {
            self.begins = held_up;
        }
        if started && !self.waits() && self.got[self.core] >= self.warps {
            self.got[self.core] = 0;
            self.core = (self.core + 1) % self.got.len();
        }
    }

    /// Whether quads wait where the search begins.
    fn waits(&self) -> bool {
        self.pipelines.get(self.begins).is_some_and(|packing| packing.has(Packing::WAITING))
    }

    /// The core of the batch at the head: the first in the order of turns that has room.
    pub fn choose(&mut self, now: Cycle, mut has_room: impl FnMut(usize) -> bool) -> Option<usize> {
        let cores = self.got.len();
        if self.deal != VertexDeal::AfterFragments {
            return (0..cores).map(|ahead| (self.core + ahead) % cores).find(|&core| has_room(core));
        }
        // A batch that waits for its core keeps it, so that it does not matter in which cycles this is asked.
        let core = match self.settled {
            Some(core) => core,
            None => {
                if self.waits() && self.last.is_none_or(|last| last + 1 < now) {
                    self.core = usize::from(self.pipelines[self.begins].core);
                }
                *self.settled.insert(self.core)
            }
        };
        has_room(core).then_some(core)
    }

    /// A core has got a batch.
    pub fn dealt(&mut self, now: Cycle, core: usize) {
        self.settled = None;
        self.last = Some(now);
        if self.deal != VertexDeal::First {
            self.got[core] = self.got[core].saturating_add(1);
            self.core = (core + 1) % self.got.len();
        }
    }
}
