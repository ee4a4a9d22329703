//! The funnel: how many of everything went in, and where they were thrown away.

use serde::{Deserialize, Serialize};

use super::Outcome;

macro_rules! funnel {
    ($($name:ident $meaning:literal),* $(,)?) => {
        /// Counts of what went in and where it was thrown away.
        #[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
        pub struct Funnel { $(#[doc = $meaning] pub $name: u64,)* }

        impl Funnel {
            /// Names in order.
            pub const NAMES: &'static [&'static str] = &[$(stringify!($name)),*];

            /// Meanings, in the order of the names.
            pub const MEANINGS: &'static [&'static str] = &[$($meaning),*];

            /// The counts of which `value` gives the values, by their names.
            pub fn collect(mut value: impl FnMut(&'static str) -> u64) -> Funnel {
                Funnel { $($name: value(stringify!($name))),* }
            }

            /// Values, in the order of the names.
            pub fn values(&self) -> Vec<u64> {
                vec![$(self.$name),*]
            }
        }

        impl std::ops::AddAssign for Funnel {
            fn add_assign(&mut self, other: Funnel) {
                $(self.$name += other.$name;)*
            }
        }

        impl std::ops::Sub for Funnel {
            type Output = Funnel;

            fn sub(self, other: Funnel) -> Funnel {
                Funnel { $($name: self.$name - other.$name),* }
            }
        }
    };
}

funnel! {
    vertices_in "Indices (or vertices of draws without them) read, restarts left out.",
    vertices_shaded "Vertex shader invocations.",
    primitives_in "Primitives assembled.",
    culled_degenerate "Primitives of zero area, with repeated vertices or NaN positions.",
    culled_backface "Primitives thrown away by facing.",
    culled_frustum "Primitives outside the view volume.",
    culled_scissor "Primitives outside the scissor rectangle.",
    culled_no_sample "Primitives set up that cover no sample.",
    clipped "Primitives cut by a plane of the view volume or guard band.",
    triangles_setup "Triangles, lines and points set up, after clipping.",
    tiles_visited "8x8 blocks that traversal visited with at least one covered sample.",
    tiles_hiz_culled "Visited blocks thrown away by hierarchical Z, which machines have: none without one.",
    quads_rasterized "Quads with at least one covered sample.",
    quads_early_culled "Quads of which no sample passed the early depth and stencil tests, hierarchical Z included.",
    quads_shaded "Quads that ran the fragment shader.",
    fragments_covered "Fragments (pixels of a primitive) with at least one covered sample.",
    fragments_shaded "Fragment shader invocations for covered fragments; with sample shading one a covered sample.",
    helper_fragments "Fragment shader invocations that only serve derivatives.",
    fragments_discarded "Shaded fragments that discard, sample mask or alpha to coverage left without a sample.",
    fragments_late_failed "Shaded fragments of which no sample passed the late depth and stencil tests.",
    fragments_written "Fragments of which at least one sample reached the colour or depth buffer.",
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
