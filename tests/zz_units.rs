#![allow(unused, missing_docs)]
use fillrate::{circuit, gfx, mem, num, sim, stats, unit, work};
#[path = "../src/unit/tests/mod.rs"]
mod tests;
