//! What two machines are compared by: work as each has counted it.

use mem::{CACHES, CLIENTS, CacheCounts, ClientCounts};
use sim::{UNITS, UnitCounts};
use stats::Tree;
use unit::bin::{BINNING, BinCounts};
use unit::command::{COMMANDS, CommandCounts};
use unit::core::{CORES, CoreCounts};
use work::{FUNNEL, Funnel};

/// What of the statistics a comparison is about: its name, and how it is read from them.
#[derive(Clone, Copy, Debug)]
pub struct Measure {
    /// What it is called.
    pub name: &'static str,
    /// Reads it; counters that a machine does not have are 0.
    pub read: fn(&Tree) -> u64,
}

/// What is called `name`, and how it is read.
const fn measure(name: &'static str, read: fn(&Tree) -> u64) -> Measure {
    Measure { name, read }
}

fn client(total: &Tree, name: &'static str) -> ClientCounts {
    CLIENTS.named(name).sum(total)
}

fn cache(total: &Tree, name: &'static str) -> CacheCounts {
    CACHES.named(name).sum(total)
}

fn items(total: &Tree, units: &'static str) -> u64 {
    UNITS.named(units).sum::<UnitCounts>(total).items
}

fn funnel(total: &Tree) -> Funnel {
    FUNNEL.sum(total)
}

/// Fragments whose shader has run.
pub const FRAGMENTS_SHADED: Measure = measure("fragments shaded", |total| funnel(total).fragments_shaded);

/// Invocations of vertex shaders.
pub const VERTICES_SHADED: Measure = measure("vertices shaded", |total| funnel(total).vertices_shaded);

/// Triangles that setup has taken.
pub const TRIANGLES_SET_UP: Measure = measure("triangles set up", |total| items(total, "setup"));

/// Quads that the depth units have tested.
pub const QUADS_TESTED: Measure = measure("quads tested", |total| items(total, "depth"));

/// Bytes of depth and stencil that were read.
pub const DEPTH_READ: Measure = measure("bytes of depth read", |total| client(total, "depth").read_bytes);

/// Bytes of colours that were read.
pub const COLOR_READ: Measure = measure("bytes read for blending", |total| client(total, "color").read_bytes);

/// Bytes that a clear writes, or that ROPs read back because it has written them.
pub const CLEARED: Measure = measure("bytes to memory", |total| {
    client(total, "command").write_bytes + client(total, "color").read_bytes + client(total, "depth").read_bytes
});

/// Bytes that composition has written.
pub const COMPOSED: Measure = measure("bytes written", |total| client(total, "compose").write_bytes);

/// Tiles that a machine with bins has drawn.
pub const TILES_DRAWN: Measure = measure("tiles drawn", |total| BINNING.sum::<BinCounts>(total).tiles);

/// Passes that pipelines have drawn.
pub const PASSES_DRAWN: Measure = measure("passes drawn", |total| COMMANDS.sum::<CommandCounts>(total).passes);

/// Lookups of the cache of attributes.
pub const ATTRIBUTE_LOOKUPS: Measure = measure("lines of attributes looked up", |total| cache(total, "vertex").accesses);

/// Lookups of the first level of textures.
pub const TEXTURE_LOOKUPS: Measure = measure("lines of textures looked up", |total| cache(total, "texture").accesses);

/// Instructions that warps have issued.
pub const INSTRUCTIONS: Measure = measure("instructions", |total| {
    let core: CoreCounts = CORES.sum(total);
    core.float + core.integer + core.special + core.control + core.multiply
});
