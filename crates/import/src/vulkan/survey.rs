//! What of a capture is accepted, and what is refused.

use std::collections::BTreeMap;

use super::fault::{Fault, Log, Refusal};
use super::machine::Vulkan;
use super::objects::Stage;
use super::shaders::Form;

/// The stages of all pipelines of a capture, each once, with the block that asked for it first.
#[derive(Default)]
pub struct Stages(BTreeMap<(u64, u32, String), (u64, Stage)>);

impl Stages {
    /// Adds a stage that a block asks for.
    pub fn add(&mut self, stage: &Stage, block: u64) {
        let key = (stage.module.number, stage.stage, stage.entry.clone());
        self.0.entry(key).or_insert_with(|| (block, stage.clone()));
    }
}

/// What of a capture is accepted, and what is refused.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Survey {
    /// The shaders of pipelines: entry points of modules.
    pub shaders: u64,
    /// Shaders that are refused, by the first block that made a pipeline of them.
    pub refused_shaders: Vec<Refusal>,
    /// Calls that are refused, by the first block. What is refused because of something else comes behind that.
    pub refused: Vec<Refusal>,
}

impl Survey {
    /// The survey of a capture that was read to its end with its stages kept.
    pub(super) fn new(vulkan: &mut Vulkan) -> Survey {
        let stages = vulkan.stages.take().unwrap_or_default().0;
        let (shaders, mut log) = (stages.len() as u64, Log::default());
        for (block, stage) in stages.into_values() {
            let verdict = match vulkan.shaders.verdict(&stage) {
                Some(verdict) => verdict,
                // No draw needed it.
                None => vulkan.shaders.get(&stage, &Form::default(), &mut vulkan.card, &vulkan.limits).map(|_| ()),
            };
            if let Err(Fault::Unsupported(cause) | Fault::Limit(cause) | Fault::Damaged(cause)) = verdict {
                log.refuse("a pipeline", block, &cause);
            }
        }
        let owned = |log: &Log| log.refusals().into_iter().cloned().collect();
        Survey { shaders, refused_shaders: owned(&log), refused: owned(&vulkan.log) }
    }

    /// The number of shaders that are accepted.
    pub fn accepted(&self) -> u64 {
        self.shaders - self.refused_shaders.iter().map(|refusal| refusal.times).sum::<u64>()
    }
}
