//! Names of trace objects: dense small integers, one type a kind, never reused inside one trace.

use serde::{Deserialize, Serialize};

macro_rules! ids {
    ($($(#[$doc:meta])* $name:ident),* $(,)?) => {$(
        $(#[$doc])*
        #[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
        #[serde(transparent)]
        pub struct $name(pub u32);

        impl std::fmt::Display for $name {
            fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
                write!(f, concat!(stringify!($name), "({})"), self.0)
            }
        }

        impl crate::Number for $name {
            fn to_number(self) -> u64 {
                u64::from(self.0)
            }

            fn of_number(number: u64) -> $name {
                $name(number as u32)
            }
        }

        impl $name {
            /// The id as an index.
            pub fn index(self) -> usize {
                self.0 as usize
            }
        }
    )*};
}

ids! {
    /// A buffer.
    BufferId,
    /// A texture.
    TextureId,
    /// A view of a texture.
    ViewId,
    /// A sampler.
    SamplerId,
    /// A shader module.
    ShaderId,
    /// A bind group layout.
    BindGroupLayoutId,
    /// A pipeline layout.
    PipelineLayoutId,
    /// A bind group.
    BindGroupId,
    /// A render pipeline.
    RenderPipelineId,
    /// A compute pipeline.
    ComputePipelineId,
    /// A render bundle.
    BundleId,
    /// A query set.
    QuerySetId,
}
