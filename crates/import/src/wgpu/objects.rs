//! The objects of a wgpu trace by address, and their native ids.

use gfx::format::Format;
use gfx::state::ViewDimension;
use num::*;
use trace::command::*;

use wgpu_text::Id;

/// Why an action cannot be imported.
pub type Reason = String;

/// A buffer.
#[derive(Clone, Copy, Debug)]
pub struct Buffer {
    pub id: BufferId,
    pub size: u64,
}

/// A texture.
#[derive(Clone, Debug)]
pub struct Texture {
    pub id: TextureId,
    pub desc: TextureDesc,
}

/// A view, with the properties of its texture that passes need.
#[derive(Clone, Copy, Debug)]
pub struct View {
    pub id: ViewId,
    /// The texture's format.
    pub format: Format,
}

/// A bind group layout.
#[derive(Clone, Debug)]
pub struct GroupLayout {
    pub id: BindGroupLayoutId,
    pub origin: LayoutOrigin,
}

/// Where a bind group layout comes from. Layouts of equal origin are interchangeable.
#[derive(Clone, Debug, PartialEq)]
pub enum LayoutOrigin {
    /// Created with these entries, in order of their bindings.
    Explicit(Vec<LayoutEntry>),
    /// Derived by a pipeline from its shaders, for one of its groups.
    Derived(AnyPipeline, u32),
}

/// The layout of a pipeline: its bind group layouts, or none where the layout is derived from shaders.
pub type Groups = Option<Vec<Option<GroupLayout>>>;

/// A render pipeline.
#[derive(Clone, Debug)]
pub struct RenderPipeline {
    pub id: RenderPipelineId,
    pub groups: Groups,
}

/// A compute pipeline.
#[derive(Clone, Debug)]
pub struct ComputePipeline {
    pub id: ComputePipelineId,
    pub groups: Groups,
}

/// A pipeline layout.
#[derive(Clone, Debug)]
pub struct PipelineLayout {
    pub id: PipelineLayoutId,
    pub groups: Vec<Option<GroupLayout>>,
}

/// A surface.
#[derive(Clone, Debug, Default)]
pub struct Surface {
    /// What its textures are.
    pub desc: Option<TextureDesc>,
    /// The texture that was acquired and has neither been presented nor discarded.
    pub acquired: Option<TextureId>,
}

/// Objects of one kind by address.
pub struct Table<T> {
    kind: &'static str,
    by_address: NumberMap<u64, Option<T>>,
}

impl<T> Table<T> {
    fn new(kind: &'static str) -> Table<T> {
        Table { kind, by_address: NumberMap::new() }
    }

    /// The object that an id names now.
    pub fn get(&self, id: Id) -> Result<&T, Reason> {
        let (kind, address) = (self.kind, id.address());
        match self.by_address.get(address) {
            Some(Some(object)) => Ok(object),
            Some(None) => Err(format!("{kind} {address} is used, but was invalid when it was recorded")),
            None => Err(format!("{kind} {address} is used, but no earlier action creates it")),
        }
    }

    /// The object that an id names now, if there is one.
    pub fn find(&self, id: Id) -> Option<&T> {
        self.by_address.get(id.address())?.as_ref()
    }

    /// Makes the id name this object. Returns the object that it named before.
    pub fn set(&mut self, id: Id, object: T) -> Option<T> {
        self.by_address.insert(id.address(), Some(object)).flatten()
    }

    /// Makes the id name an object that is invalid. Returns the object that it named before.
    pub fn set_invalid(&mut self, id: Id) -> Option<T> {
        self.by_address.insert(id.address(), None).flatten()
    }
}

impl Table<Surface> {
    /// The surface of an id. Nothing creates surfaces in a trace.
    pub fn surface(&mut self, id: Id) -> &mut Surface {
        self.by_address.get_or_insert_with(id.address(), || None).get_or_insert_default()
    }
}

/// All objects, and the next native id of each kind.
pub struct Objects {
    pub buffers: Table<Buffer>,
    pub textures: Table<Texture>,
    pub views: Table<View>,
    pub samplers: Table<SamplerId>,
    pub shaders: Table<ShaderId>,
    pub group_layouts: Table<GroupLayout>,
    pub pipeline_layouts: Table<PipelineLayout>,
    pub bind_groups: Table<BindGroupId>,
    pub render_pipelines: Table<RenderPipeline>,
    pub compute_pipelines: Table<ComputePipeline>,
    pub bundles: Table<BundleId>,
    pub query_sets: Table<QuerySetId>,
    pub surfaces: Table<Surface>,
    next: [u32; 12],
}

macro_rules! fresh_ids {
    ($($function:ident $id:ident $slot:literal),* $(,)?) => {
        impl Objects {
            $(
                /// A new native id.
                pub fn $function(&mut self) -> $id {
                    let id = $id(self.next[$slot]);
                    self.next[$slot] += 1;
                    id
                }
            )*
        }
    };
}

fresh_ids! {
    new_buffer BufferId 0, new_texture TextureId 1, new_view ViewId 2, new_sampler SamplerId 3, new_shader ShaderId 4,
    new_group_layout BindGroupLayoutId 5, new_pipeline_layout PipelineLayoutId 6, new_bind_group BindGroupId 7,
    new_render_pipeline RenderPipelineId 8, new_compute_pipeline ComputePipelineId 9, new_bundle BundleId 10,
    new_query_set QuerySetId 11,
}

impl Objects {
    /// No objects.
    pub fn new() -> Objects {
        Objects {
            buffers: Table::new("buffer"),
            textures: Table::new("texture"),
            views: Table::new("texture view"),
            samplers: Table::new("sampler"),
            shaders: Table::new("shader module"),
            group_layouts: Table::new("bind group layout"),
            pipeline_layouts: Table::new("pipeline layout"),
            bind_groups: Table::new("bind group"),
            render_pipelines: Table::new("render pipeline"),
            compute_pipelines: Table::new("compute pipeline"),
            bundles: Table::new("render bundle"),
            query_sets: Table::new("query set"),
            surfaces: Table::new("surface"),
            next: [0; 12],
        }
    }
}

/// The view dimension that wgpu uses where none is given.
pub fn default_dimension(desc: &TextureDesc) -> ViewDimension {
    use gfx::state::TextureDimension;
    match desc.dimension {
        TextureDimension::D1 => ViewDimension::D1,
        TextureDimension::D2 if desc.size[2] == 1 => ViewDimension::D2,
        TextureDimension::D2 => ViewDimension::D2Array,
        TextureDimension::D3 => ViewDimension::D3,
    }
}
