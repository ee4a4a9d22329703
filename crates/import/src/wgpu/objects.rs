//! The objects of a wgpu trace by address, and their native ids.
//!
//! wgpu writes down many actions before it knows whether they are valid. One that it refused makes an invalid object, or does nothing, and
//! the program goes on; nothing in the recording says so. So an object that cannot be made here is invalid as well, with the reason
//! ([`Refusal`]). Who makes another object of it makes an invalid object. It is an error only where a command that ran uses it.

use std::rc::Rc;

use gfx::format::Format;
use gfx::state::ViewDimension;
use num::*;
use trace::TextLocation;
use trace::command::*;

use super::schema::Id;

/// Why an action is not translated.
#[derive(Debug)]
pub enum Reason {
    /// No recorder writes this: the recording is damaged.
    Damaged(String),
    /// The data of the action are not there, or not all.
    Data(String),
    /// wgpu refuses the action, or it asks for what is not supported.
    Refused(String),
    /// It names an object that a refused action should have made.
    Invalid(Rc<Refusal>),
}

impl Reason {
    /// As it is of a part of the action.
    pub fn within(self, part: std::fmt::Arguments<'_>) -> Reason {
        match self {
            Reason::Damaged(reason) => Reason::Damaged(format!("{part}: {reason}")),
            Reason::Data(reason) => Reason::Data(format!("{part}: {reason}")),
            Reason::Refused(reason) => Reason::Refused(format!("{part}: {reason}")),
            invalid @ Reason::Invalid(_) => invalid,
        }
    }
}

impl From<String> for Reason {
    fn from(reason: String) -> Reason {
        Reason::Refused(reason)
    }
}

impl From<&str> for Reason {
    fn from(reason: &str) -> Reason {
        Reason::Refused(reason.to_owned())
    }
}

/// An action that made no object.
#[derive(Debug)]
pub struct Refusal {
    /// Number of the action in the file.
    pub action: u64,
    /// Its name.
    pub name: String,
    /// Where it begins.
    pub place: TextLocation,
    /// The object that it should have made.
    pub object: String,
    /// Why it did not.
    pub reason: String,
}

/// A buffer.
#[derive(Clone, Copy, Debug)]
pub struct Buffer {
    pub id: BufferId,
    pub size: u64,
    /// The queue may write to it.
    pub writable: bool,
}

/// A texture.
#[derive(Clone, Debug)]
pub struct Texture {
    pub id: TextureId,
    pub desc: TextureDesc,
    /// The queue may write to it.
    pub writable: bool,
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
    /// How it was configured last; none: not yet.
    pub textures: Option<SurfaceTextures>,
    /// The texture that was acquired and has neither been presented nor discarded.
    pub acquired: Option<Acquired>,
}

/// What the textures of a surface are.
#[derive(Clone, Debug)]
pub struct SurfaceTextures {
    pub desc: Result<TextureDesc, Rc<Refusal>>,
    /// The queue may write to them.
    pub writable: bool,
    /// Its number among the configurations of all surfaces.
    pub number: usize,
}

/// A texture that a surface gave out.
#[derive(Clone, Debug)]
pub struct Acquired {
    /// The id that the trace has for it.
    pub id: Id,
    pub texture: Result<TextureId, Rc<Refusal>>,
    /// The configuration that it is of.
    pub configuration: usize,
    /// The program destroyed it: it cannot be presented.
    pub destroyed: bool,
}

/// An object that a trace knows by address.
pub trait AddressedObject {
    /// The native object.
    fn object(&self) -> Object;
}

macro_rules! known {
    ($($ty:ty: $object:ident $(. $field:ident)?),* $(,)?) => {
        $(
            impl AddressedObject for $ty {
                fn object(&self) -> Object {
                    Object::$object((*self)$(.$field)?)
                }
            }
        )*
    };
}

known! {
    Buffer: Buffer.id, Texture: Texture.id, View: View.id, SamplerId: Sampler, ShaderId: Shader, GroupLayout: BindGroupLayout.id,
    PipelineLayout: PipelineLayout.id, BindGroupId: BindGroup, RenderPipeline: RenderPipeline.id,
    ComputePipeline: ComputePipeline.id, BundleId: Bundle, QuerySetId: QuerySet,
}

/// Objects of one kind by address.
pub struct Table<T> {
    /// What messages call an object of the kind.
    pub kind: &'static str,
    by_address: NumberMap<u64, Result<T, Rc<Refusal>>>,
}

impl<T> Table<T> {
    fn new(kind: &'static str) -> Table<T> {
        Table { kind, by_address: NumberMap::new() }
    }

    /// The object that an id names now.
    pub fn get(&self, id: Id) -> Result<&T, Reason> {
        let (kind, address) = (self.kind, id.address());
        match self.by_address.get(address) {
            Some(Ok(object)) => Ok(object),
            Some(Err(refusal)) => Err(Reason::Invalid(refusal.clone())),
            None => Err(Reason::Damaged(format!("{kind} {address} is used, but no earlier action creates it"))),
        }
    }

    /// The object that an id names now, if there is one.
    pub fn find(&self, id: Id) -> Option<&T> {
        self.by_address.get(id.address())?.as_ref().ok()
    }

    /// Makes the id name this object, or an invalid one. Returns the object that it named before.
    pub fn set(&mut self, id: Id, object: Result<T, Rc<Refusal>>) -> Option<T> {
        self.by_address.insert(id.address(), object)?.ok()
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
    pub surfaces: NumberMap<u64, Surface>,
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
            surfaces: NumberMap::new(),
            next: [0; 12],
        }
    }
}

impl Objects {
    /// The surface of an id. Nothing creates surfaces in a trace.
    pub fn surface(&mut self, id: Id) -> &mut Surface {
        self.surfaces.get_or_insert_with(id.address(), Surface::default)
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
