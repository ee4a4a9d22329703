//! Knobs of the card as a whole.

use super::Config;
use crate::class::SortClass;
use knob::Allowed;
use mem::{MemoryConfig, ShapeError};

knob::knobs! {
    /// The card as a whole.
    pub struct CardConfig {
        /// Clock of the card, all units included; turns cycles into seconds.
        clock_mhz: u32 ["MHz", Allowed::Range(1, 10000), "1,126 MHz: the base clock (NVIDIA 2014, GeForce GTX 980 white paper, p. 7)"]
            {estimate: Ignored("no cycle depends on it"), relax: Never, advice: []},
        /// What is sorted, and where.
        sort: SortClass ["", Allowed::Choice(SortClass::NAMES), "Molnar et al. 1994; what desktop cards do"]
            {estimate: Used, relax: Never, advice: []},
        /// Pipelines of rasteriser, fragment cores and ROPs, each owning part of the screen.
        pipelines: u32 ["pipelines", Allowed::Range(1, 64), "four clusters (GPCs), each with a raster engine (NVIDIA 2014, GeForce GTX 980 white paper, p. 6)"]
            {estimate: Used, relax: Units("twice the pipelines"), advice: []},
        /// Geometry units: clipping, culling and distribution.
        geometry_units: u32 ["units", Allowed::Range(1, 16), "16 PolyMorph engines, each a primitive in two cycles (NVIDIA 2014, GeForce GTX 980 white paper, p. 7; the rate is unconfirmed): as many as 8 that take one"]
            {estimate: Used, relax: Units("twice the geometry units"), advice: []},
        /// Cycles in which units wake and none moves, one after another, after which the run is stopped as stuck. Waiting for a known
        /// cycle is not waking, however long it takes.
        watchdog: u32 ["cycles", Allowed::Range(1000, 1000000000), "assumed: none is ever needed: a guard against units that ask for ever"]
            {estimate: Ignored("no cycle depends on it"), relax: Never, advice: []},
    }
}

impl Config {
    /// The memory behind the ports.
    ///
    /// # Errors
    /// If its shape is none.
    pub fn memory(&self) -> Result<MemoryConfig, ShapeError> {
        MemoryConfig::new(&self.memory, self.l2, self.dram)
    }
}
