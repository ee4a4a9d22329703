//! The funnel: how many of everything went in, and where they were thrown away.

use serde::{Deserialize, Serialize};
use stats::Heading;

use super::{Primitive, PrimitiveOutcome};

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
        /// Primitives that cover no sample: found by their bounds, or when they are set up and traversed.
        culled_no_sample: "count",
        /// Primitives cut by a plane of the view volume or guard band.
        clipped: "count",
        /// Primitives that are set up although nothing of them is drawn. Each is counted with the others that are culled for its reason, too.
        setup_culled: "count",
        /// Triangles, lines and points beyond the first of a primitive that is set up: of clipping, and of polygons drawn as lines or points.
        setup_parts: "count",
        /// Triangles, lines and points set up again by another pipeline, where primitives are sorted before setup.
        setup_copies: "count",
        /// Triangles, lines and points set up, after clipping: `primitives_in` less all that is culled, and `setup_culled`, `setup_parts` and
        /// `setup_copies`.
        triangles_setup: "count",
        /// 8x8 blocks that traversal visited with at least one covered sample.
        tiles_visited: "count",
        /// Visited blocks thrown away by hierarchical Z, which machines have: none without one.
        tiles_hiz_culled: "count",
        /// Quads with at least one covered sample; with sample shading one for each sample that it covers.
        quads_rasterized: "count",
        /// Quads thrown away by hierarchical Z, alone or with their block.
        quads_hiz_culled: "count",
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
    /// Counts how a primitive ended, and what is set up of it beside one triangle of each primitive that is drawn. `pipelines` set it up.
    pub fn end(&mut self, primitive: &Primitive, pipelines: u32) {
        match primitive.outcome {
            PrimitiveOutcome::Drawn => {}
            PrimitiveOutcome::Degenerate => self.culled_degenerate += 1,
            PrimitiveOutcome::Backface => self.culled_backface += 1,
            PrimitiveOutcome::Frustum => self.culled_frustum += 1,
            PrimitiveOutcome::Scissor => self.culled_scissor += 1,
            PrimitiveOutcome::NoSample => self.culled_no_sample += 1,
        }
        let triangles = u64::from(primitive.triangles);
        if triangles > 0 && pipelines > 0 {
            self.setup_culled += u64::from(primitive.outcome != PrimitiveOutcome::Drawn);
            self.setup_parts += triangles - 1;
            self.setup_copies += triangles * u64::from(pipelines - 1);
        }
    }
}
