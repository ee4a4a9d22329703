//! Knobs of the card as a whole.

use super::Config;
use crate::class::SortClass;
use knob::Allowed;
use mem::MemoryConfig;

knob::knobs! {
    /// The card as a whole.
    pub struct CardConfig {
        /// Clock of the card, all units included; turns cycles into seconds.
        clock_mhz: u32 ["MHz", Allowed::Range(1, 10000), "1 GHz: a mid-range card of 2014 (GeForce GTX 960: 1,127)"],
        /// What is sorted, and where.
        sort: SortClass ["", Allowed::Choice(SortClass::NAMES), "Molnar et al. 1994; what desktop cards do"],
        /// Pipelines of rasteriser, fragment cores and ROPs, each owning part of the screen.
        pipelines: u32 ["pipelines", Allowed::Range(1, 64), "2 to 6 in mid-range cards since 2010; ATTILA 4"],
        /// Geometry units: clipping, culling and distribution.
        geometry_units: u32 ["units", Allowed::Range(1, 16), "one for each two pipelines"],
        /// Cycles in which units wake and none moves, one after another, after which the run is stopped as stuck. Waiting for a known
        /// cycle is not waking, however long it takes.
        watchdog: u32 ["cycles", Allowed::Range(1000, 1000000000), "none is ever needed: a guard against units that ask for ever"],
    }
}

impl Config {
    /// The memory behind the ports.
    ///
    /// # Errors
    /// If its shape is none.
    pub fn memory(&self) -> Result<MemoryConfig, String> {
        MemoryConfig::new(&self.memory, self.l2, self.dram)
    }
}
