//! The programmable stages, and tables with an entry for each of them.

num::keyed! {
    /// A programmable stage. Stages of a render pipeline compare in the order in which data flow through them.
    #[derive(Default)]
    pub enum Stage;
    /// A table with an entry for each stage.
    pub struct StageMap;
    /// Once per vertex.
    #[default]
    Vertex "vertex",
    /// Once per fragment (or sample).
    Fragment "fragment",
    /// Once per invocation of a dispatch.
    Compute "compute",
}

impl Stage {
    /// Whether the stage comes before the rasteriser. The last such stage of a pipeline is its geometry stage: the rasteriser reads its outputs.
    pub const fn is_geometry(self) -> bool {
        match self {
            Stage::Vertex => true,
            Stage::Fragment | Stage::Compute => false,
        }
    }

    /// Whether invocations belong to workgroups, which share memory and wait for each other.
    pub const fn has_workgroups(self) -> bool {
        match self {
            Stage::Vertex | Stage::Fragment => false,
            Stage::Compute => true,
        }
    }
}
