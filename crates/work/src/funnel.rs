//! The funnel: how many of everything went in, and where they were thrown away.

use serde::{Deserialize, Serialize};
use stats::Heading;

use super::Outcome;

/// Where the funnel stands.
pub const FUNNEL: Heading = Heading::new(
    "funnel",
    "What went in, and where it was thrown away. Under `--fidelity functional` as a sort-middle card without hierarchical Z would \
     count it that reuses all vertices and culls geometry early; `depth.early` and `command.cull` are the configuration's, and so is what \
     is shaded inside of pipeline statistics queries, whose results a program can show.",
);

stats::counters! {
    /// Counts of what went in and where it was thrown away.
    #[derive(Serialize, Deserialize)]
    pub struct Funnel {
        /// Indices (or vertices of draws without them) read, restarts left out.
        vertices_in: "count",
        /// Vertex shader invocations.
        vertices_shaded: "count",
        /// Primitives assembled.
        primitives_in: "count",
        /// Primitives of zero area, with repeated vertices or NaN positions.
        culled_degenerate: "count",
        /// Primitives thrown away by facing.
        culled_backface: "count",
        /// Primitives outside the view volume.
        culled_frustum: "count",
        /// Primitives outside the scissor rectangle.
        culled_scissor: "count",
        /// Primitives set up that cover no sample.
        culled_no_sample: "count",
        /// Primitives cut by a plane of the view volume or guard band.
        clipped: "count",
        /// Triangles, lines and points set up, after clipping.
        triangles_setup: "count",
        /// 8x8 blocks that traversal visited with at least one covered sample.
        tiles_visited: "count",
        /// Visited blocks thrown away by hierarchical Z, which machines have: none without one.
        tiles_hiz_culled: "count",
        /// Quads with at least one covered sample; with sample shading one for each sample that it covers.
        quads_rasterized: "count",
        /// Quads of which no sample passed the early depth and stencil tests, hierarchical Z included.
        quads_early_culled: "count",
        /// Quads that ran the fragment shader.
        quads_shaded: "count",
        /// Fragments (pixels of a primitive) with at least one covered sample; with sample shading one for each covered sample.
        fragments_covered: "count",
        /// Fragment shader invocations for covered fragments; with sample shading one a covered sample.
        fragments_shaded: "count",
        /// Fragment shader invocations that only serve derivatives.
        helper_fragments: "count",
        /// Shaded fragments that discard, sample mask or alpha to coverage left without a sample.
        fragments_discarded: "count",
        /// Shaded fragments of which no sample passed the late depth and stencil tests.
        fragments_late_failed: "count",
        /// Fragments of which at least one sample reached the colour or depth buffer.
        fragments_written: "count",
    }
}

impl Funnel {
    /// Counts how a primitive ended.
    pub fn end(&mut self, outcome: Outcome) {
        match outcome {
            Outcome::Drawn => {}
            Outcome::Degenerate => self.culled_degenerate += 1,
            Outcome::Backface => self.culled_backface += 1,
            Outcome::Frustum => self.culled_frustum += 1,
            Outcome::Scissor => self.culled_scissor += 1,
            Outcome::NoSample => self.culled_no_sample += 1,
        }
    }
}
