//! The objects of a trace while it runs.

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering::Relaxed};

use gfx::format::Format;
use gfx::image::ImageDesc;
use gfx::state::{TextureDimension, ViewDimension};
use gfx::texture::{self, Sampler, ViewRange};
use num::{BufferId, NumberMap, TextureId, Words};
use shader::Module;
use trace::command::{BindGroupEntry, BindingKind, BoundResource, Command, LayoutEntry, QueryKind, ViewDesc};
use work::{Extent, Funnel, Holdings, Surface, SurfaceKey};

use super::deferred::Deferred;
use super::fault::Reason;
use super::ledger::{Claim, Ledger};
use super::memory::{target_offset, texture_bytes};
use super::objects::{DeferredCompute, DeferredRender, ShaderText};
use super::parallel;
use super::surface::TileSurface;

/// Objects of one kind by id.
#[derive(Debug)]
pub struct Table<T> {
    kind: &'static str,
    objects: NumberMap<u32, (T, Claim)>,
}

impl<T> Table<T> {
    /// An empty table; `kind` names its objects in errors.
    pub fn new(kind: &'static str) -> Table<T> {
        Table { kind, objects: NumberMap::new() }
    }

    /// Adds an object, with its claim of memory.
    ///
    /// # Errors
    /// If the id is taken.
    pub fn add(&mut self, id: u32, object: T, claim: Claim) -> Result<(), ObjectError> {
        match self.objects.insert(id, (object, claim)) {
            None => Ok(()),
            Some(_) => Err(ObjectError::CreatedTwice { kind: self.kind, id }),
        }
    }

    /// The object of an id.
    ///
    /// # Errors
    /// If there is none.
    pub fn get(&self, id: u32) -> Result<&T, NoObject> {
        self.objects.get(id).map(|(object, _)| object).ok_or(NoObject { kind: self.kind, id })
    }

    /// The object of an id, to change.
    ///
    /// # Errors
    /// If there is none.
    pub fn get_mut(&mut self, id: u32) -> Result<&mut T, NoObject> {
        let kind = self.kind;
        self.objects.get_mut(id).map(|(object, _)| object).ok_or(NoObject { kind, id })
    }

    /// Takes an object out.
    ///
    /// # Errors
    /// If there is none.
    pub fn remove(&mut self, id: u32) -> Result<T, NoObject> {
        self.objects.remove(id).map(|(object, _)| object).ok_or(NoObject { kind: self.kind, id })
    }

    /// All of them, by id.
    pub fn iter(&self) -> impl Iterator<Item = (u32, &T)> {
        self.objects.iter().map(|(id, (object, _))| (id, object))
    }
}

/// An object that a command names does not exist.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{kind} {id} does not exist")]
pub struct NoObject {
    /// The kind of the object.
    pub kind: &'static str,
    /// Its id.
    pub id: u32,
}

/// A command describes an object that cannot be, or reaches outside an object.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[allow(missing_docs, reason = "the message explains each variant")]
pub enum ObjectError {
    #[error("{kind} {id} is created twice")]
    CreatedTwice { kind: &'static str, id: u32 },
    #[error("offset {offset} is beyond the {bytes} bytes of buffer {buffer}")]
    Offset { offset: u64, bytes: u64, buffer: u32 },
    #[error("{size} bytes at offset {offset} are beyond the {bytes} bytes of buffer {buffer}")]
    Range { size: u64, offset: u64, bytes: u64, buffer: u32 },
    #[error("{what} {base}..+{count} are not inside the {all} of texture {texture}")]
    ViewRange { what: &'static str, base: u32, count: u32, all: u32, texture: u32 },
    #[error("a {dimension:?} view of {layers} layers does not fit texture {texture} ({of:?})")]
    ViewDimension { dimension: ViewDimension, layers: u32, texture: u32, of: TextureDimension },
    #[error("a view as {} of texture {texture} in {}", .format.name(), .of.name())]
    ViewFormat { format: Format, texture: u32, of: Format },
    #[error("binding {0} is given twice")]
    BindingTwice(u32),
    #[error("the layout has no binding {0}")]
    NotInLayout(u32),
    #[error("binding {binding} is a {kind:?} in the layout, not {resource:?}")]
    BindingKind { binding: u32, kind: BindingKind, resource: BoundResource },
    #[error("query {index} of a set of {queries}")]
    Query { index: u32, queries: usize },
    #[error("a pipeline statistics query in a set of another kind")]
    StatisticsKind,
}

/// A buffer.
#[derive(Debug)]
pub struct Buffer {
    /// Its bytes.
    pub words: Arc<Words>,
    /// Where it is in the card's memory.
    pub address: u64,
    version: AtomicU64,
}

impl Buffer {
    /// A buffer of these words, at this address.
    pub fn new(words: Words, address: u64) -> Buffer {
        Buffer { words: Arc::new(words), address, version: AtomicU64::new(0) }
    }

    /// The card's memory of it.
    pub fn extent(&self) -> Extent {
        Extent::new(self.address, self.words.len())
    }

    /// Counts changes of the contents.
    pub fn version(&self) -> u64 {
        self.version.load(Relaxed)
    }

    /// Notes that the contents have changed, or may have.
    pub fn changed(&self) {
        self.version.fetch_add(1, Relaxed);
    }

    /// The byte range `offset .. offset + size`, size none meaning the rest.
    ///
    /// # Errors
    /// If the range is not inside.
    pub fn range(&self, id: BufferId, offset: u64, size: Option<u64>) -> Result<(u64, u64), ObjectError> {
        let len = self.words.len();
        let size = match size {
            Some(size) => size,
            None => len.checked_sub(offset).ok_or(ObjectError::Offset { offset, bytes: len, buffer: id.0 })?,
        };
        match offset.checked_add(size) {
            Some(end) if end <= len => Ok((offset, size)),
            _ => Err(ObjectError::Range { size, offset, bytes: len, buffer: id.0 }),
        }
    }
}

/// State of one image (a layer or slice of a level) of a texture.
#[derive(Debug, Default)]
pub struct ImageState {
    /// The newest contents, where a pass left them.
    pub tiles: Option<TileSurface>,
    /// The words have these contents too.
    pub stored: bool,
    /// A pass began with what the words had: the next one will too, so that tiles are kept when they are stored.
    pub loaded: bool,
    /// Memory of the tiles, here or in the pass that draws on them.
    pub working: Option<Claim>,
}

/// A texture.
#[derive(Debug)]
pub struct Texture {
    /// Shape.
    pub image: ImageDesc,
    /// Its bytes; see [`Texture::flush`].
    pub words: Arc<Words>,
    /// Where it is in the card's memory.
    pub address: u64,
    /// Counts changes of the contents.
    pub version: u64,
    /// Whether the display ignores its alpha when it is shown.
    pub opaque: bool,
    /// Images by (level, layer) that passes have touched.
    pub images: NumberMap<(u32, u32), ImageState>,
}

impl Texture {
    /// Brings the words up to date with what passes have drawn; the bytes that are written.
    fn flush(&mut self) -> u64 {
        let image = self.image;
        let mut written = 0;
        // Asked for each draw that reads it; keys in order are a list that is made.
        if self.images.values_mut().all(|state| state.stored || state.tiles.is_none()) {
            return written;
        }
        for (level, layer) in self.images.keys() {
            let Some(state) = self.images.get_mut((level, layer)) else { continue };
            if state.stored {
                continue;
            }
            if let Some(mut tiles) = state.tiles.take() {
                tiles.store(&self.words, image.offset(level, layer));
                written += tiles.shape().bytes();
                if state.loaded {
                    (state.tiles, state.stored) = (Some(tiles), true);
                } else {
                    state.working = None;
                }
            }
        }
        written
    }

    /// Notes that something other than a draw has written an image; the words must be flushed before.
    fn overwritten(&mut self, level: u32, layer: u32) {
        self.version += 1;
        if let Some(state) = self.images.get_mut((level, layer)) {
            debug_assert!(state.stored || state.tiles.is_none(), "the newest contents were in tiles");
            (state.tiles, state.working, state.stored) = (None, None, false);
        }
    }

    /// The card's memory of all its images.
    pub fn extent(&self) -> Extent {
        Extent::new(self.address, texture_bytes(&self.image))
    }

    /// One image as a surface.
    pub fn surface(&self, id: TextureId, level: u32, layer: u32) -> Surface {
        let [width, height, _] = self.image.level_size(level);
        Surface {
            key: SurfaceKey { texture: id.0, level, layer },
            format: self.image.format,
            width,
            height,
            samples: self.image.samples,
            address: self.address + target_offset(&self.image, level, layer),
            opaque: self.opaque,
        }
    }

    /// The newest bytes of one image. What a pass has drawn stays in its tiles, for the next one.
    pub fn image_bytes(&self, level: u32, layer: u32) -> Arc<[u8]> {
        let mut bytes: Arc<[u8]> = std::iter::repeat_n(0, self.image.layer_bytes(level) as usize).collect();
        let unshared = Arc::get_mut(&mut bytes).expect("nobody else has it yet");
        match self.images.get((level, layer)).and_then(|state| state.tiles.as_ref()) {
            Some(tiles) => tiles.read(unshared),
            None => self.words.read(self.image.offset(level, layer), unshared),
        }
        bytes
    }
}

/// A view with every default filled in.
#[derive(Debug)]
pub struct View {
    /// The texture of the view.
    pub texture: TextureId,
    /// Which part, as what.
    pub range: ViewRange,
    /// Texels ready for sampling, and the version of the texture that they show.
    prepared: Option<(u64, Arc<texture::View>, Claim)>,
}

impl View {
    /// Resolves a description against its texture.
    ///
    /// # Errors
    /// If it reaches outside the texture, or its format cannot be a view of the texture's.
    pub fn new(texture: TextureId, image: &ImageDesc, desc: &ViewDesc) -> Result<View, ObjectError> {
        let all_layers = if image.dimension == TextureDimension::D3 { 1 } else { image.size[2] };
        let range = |what: &'static str, base: u32, count: Option<u32>, all: u32| {
            let count = count.unwrap_or_else(|| all.saturating_sub(base));
            match base.checked_add(count) {
                Some(end) if end <= all && count > 0 => Ok(count),
                _ => Err(ObjectError::ViewRange { what, base, count, all, texture: texture.0 }),
            }
        };
        let levels = range("levels", desc.base_level, desc.levels, image.levels)?;
        let layers = match (desc.layers, desc.dimension) {
            (None, Some(ViewDimension::D1 | ViewDimension::D2 | ViewDimension::D3)) => Some(1),
            (None, Some(ViewDimension::Cube)) => Some(6),
            (layers, _) => layers,
        };
        let layers = range("layers", desc.base_layer, layers, all_layers)?;
        let dimension = desc.dimension.unwrap_or(match image.dimension {
            TextureDimension::D1 => ViewDimension::D1,
            TextureDimension::D3 => ViewDimension::D3,
            TextureDimension::D2 if layers == 1 && (desc.layers.is_some() || all_layers == 1) => ViewDimension::D2,
            TextureDimension::D2 => ViewDimension::D2Array,
        });
        let fits = match dimension {
            ViewDimension::D1 => image.dimension == TextureDimension::D1 && layers == 1,
            ViewDimension::D2 => image.dimension == TextureDimension::D2 && layers == 1,
            ViewDimension::D2Array => image.dimension == TextureDimension::D2,
            ViewDimension::Cube => image.dimension == TextureDimension::D2 && layers == 6,
            ViewDimension::CubeArray => image.dimension == TextureDimension::D2 && layers.is_multiple_of(6),
            ViewDimension::D3 => image.dimension == TextureDimension::D3,
        };
        if !fits {
            return Err(ObjectError::ViewDimension { dimension, layers, texture: texture.0, of: image.dimension });
        }
        let format = desc.format.unwrap_or(image.format);
        let compatible = format == image.format
            || format.block_bytes() == image.format.block_bytes() && format.block_dim() == image.format.block_dim()
            || image.format.is_depth_stencil();
        if !compatible {
            return Err(ObjectError::ViewFormat { format, texture: texture.0, of: image.format });
        }
        // A view of one aspect is named by that aspect's format, but its texels are stored in the texture's.
        let format = if image.format.is_depth_stencil() { image.format } else { format };
        let range = ViewRange {
            dimension,
            format,
            aspect: desc.aspect,
            base_level: desc.base_level,
            levels,
            base_layer: desc.base_layer,
            layers,
        };
        Ok(View { texture, range, prepared: None })
    }
}

/// A bind group: its entries, sorted by binding, and which of them take dynamic offsets.
#[derive(Debug)]
pub struct BindGroup {
    /// Entries in order of binding.
    pub entries: Vec<BindGroupEntry>,
    /// Bindings that take a dynamic offset, in order.
    pub dynamic: Vec<u32>,
}

impl BindGroup {
    /// Checks entries against a layout; none: derived from shaders, and checked by the draw or dispatch that knows them.
    ///
    /// # Errors
    /// If a binding is not in the layout, given twice, or of the wrong kind. (One that is missing is an error of the draw that
    /// needs it.)
    pub fn new(layout: Option<&[LayoutEntry]>, mut entries: Vec<BindGroupEntry>) -> Result<BindGroup, ObjectError> {
        entries.sort_by_key(|entry| entry.binding);
        if let Some(layout) = layout {
            entries.iter().try_for_each(|entry| in_layout(entry, layout))?;
        }
        if let Some(pair) = entries.windows(2).find(|pair| pair[0].binding == pair[1].binding) {
            return Err(ObjectError::BindingTwice(pair[0].binding));
        }
        let dynamic = |slot: &&LayoutEntry| {
            matches!(
                slot.kind,
                BindingKind::Uniform { dynamic_offset: true } | BindingKind::Storage { dynamic_offset: true, .. }
            )
        };
        let mut dynamic: Vec<u32> = layout.unwrap_or_default().iter().filter(dynamic).map(|slot| slot.binding).collect();
        dynamic.sort_unstable();
        Ok(BindGroup { entries, dynamic })
    }

    /// The resource that is bound to a binding.
    pub fn find(&self, binding: u32) -> Option<&BoundResource> {
        let at = self.entries.binary_search_by_key(&binding, |entry| entry.binding).ok()?;
        Some(&self.entries[at].resource)
    }
}

/// Checks that a layout has the binding of an entry, and of its kind.
fn in_layout(entry: &BindGroupEntry, layout: &[LayoutEntry]) -> Result<(), ObjectError> {
    let slot = layout.iter().find(|slot| slot.binding == entry.binding).ok_or(ObjectError::NotInLayout(entry.binding))?;
    let fits = matches!(
        (slot.kind, &entry.resource),
        (BindingKind::Uniform { .. } | BindingKind::Storage { .. }, BoundResource::Buffer { .. } | BoundResource::Buffers(_))
            | (BindingKind::Texture | BindingKind::StorageTexture, BoundResource::View(_) | BoundResource::Views(_))
            | (BindingKind::Sampler, BoundResource::Sampler(_) | BoundResource::Samplers(_))
    );
    if !fits {
        let (binding, kind, resource) = (entry.binding, slot.kind, entry.resource.clone());
        return Err(ObjectError::BindingKind { binding, kind, resource });
    }
    Ok(())
}

/// A query set.
#[derive(Debug)]
pub struct QuerySet {
    /// The kind of the query.
    pub kind: QueryKind,
    /// Results; one a query, or one a counted statistic a query.
    pub values: Vec<u64>,
}

impl QuerySet {
    /// Values a query.
    pub fn stride(&self) -> usize {
        self.kind.results() as usize
    }

    /// The values of a query, to write.
    ///
    /// # Errors
    /// If the set has no such query.
    pub fn slot(&mut self, index: u32) -> Result<&mut [u64], ObjectError> {
        let stride = self.stride();
        let queries = self.values.len() / stride.max(1);
        let at = index as usize * stride;
        self.values.get_mut(at..at + stride).ok_or(ObjectError::Query { index, queries })
    }
}

impl QuerySet {
    /// Writes the chosen statistics of a query in WebGPU-native order: vertex invocations, primitives into and out of the
    /// clipper, fragment and compute invocations.
    ///
    /// # Errors
    /// If the set is of another kind or has no such query.
    pub fn write_statistics(&mut self, index: u32, funnel: &Funnel, compute: u64) -> Result<(), ObjectError> {
        let QueryKind::PipelineStatistics(mask) = self.kind else {
            return Err(ObjectError::StatisticsKind);
        };
        // Primitives inside the view volume leave the clipper, even if culling throws them away afterwards.
        let clipped = funnel.primitives_in - funnel.culled_frustum;
        let all = [funnel.vertices_shaded, funnel.primitives_in, clipped, funnel.fragments_shaded, compute];
        let chosen = (0..all.len()).filter(|bit| mask >> bit & 1 != 0).map(|bit| all[bit]);
        for (slot, value) in self.slot(index)?.iter_mut().zip(chosen) {
            *slot = value;
        }
        Ok(())
    }
}

/// A shader module and the bytes of its source.
#[derive(Debug)]
pub struct Shader {
    /// The module, which is read when the first pipeline with it is compiled.
    pub module: Deferred<ShaderText, Module>,
    /// Bytes of its source.
    pub bytes: u64,
}

/// All objects.
#[allow(missing_docs, reason = "each field is the table of what it is named for")]
pub struct Resources {
    pub buffers: Table<Buffer>,
    pub textures: Table<Texture>,
    pub views: Table<View>,
    pub samplers: Table<Arc<Sampler>>,
    pub shaders: Table<Arc<Shader>>,
    /// The entries of each; none: derived from the shaders of a pipeline.
    pub bind_group_layouts: Table<Option<Vec<LayoutEntry>>>,
    pub pipeline_layouts: Table<()>,
    pub bind_groups: Table<BindGroup>,
    pub render_pipelines: Table<Arc<DeferredRender>>,
    pub compute_pipelines: Table<Arc<DeferredCompute>>,
    pub bundles: Table<Arc<Vec<Command>>>,
    pub query_sets: Table<QuerySet>,
    pub ledger: Arc<Ledger>,
    /// The contents of the stores of a machine that has taken all events so far.
    pub holdings: Holdings,
}

impl Resources {
    /// Notes that something other than a draw has written an image of a texture; its words must be flushed before.
    ///
    /// # Errors
    /// If the texture does not exist.
    pub fn overwritten(&mut self, texture: TextureId, level: u32, layer: u32) -> Result<(), NoObject> {
        self.textures.get_mut(texture.0)?.overwritten(level, layer);
        self.holdings.forget(SurfaceKey { texture: texture.0, level, layer });
        Ok(())
    }

    /// Notes that something other than a draw may have written any image of a texture.
    ///
    /// # Errors
    /// If the texture does not exist.
    pub fn overwritten_all(&mut self, texture: TextureId) -> Result<(), NoObject> {
        let of = self.textures.get_mut(texture.0)?;
        of.version += 1;
        for (level, layer) in of.images.keys() {
            of.overwritten(level, layer);
        }
        self.holdings.forget_texture(texture.0);
        Ok(())
    }

    /// No objects.
    pub fn new(ledger: Arc<Ledger>) -> Resources {
        Resources {
            buffers: Table::new("buffer"),
            textures: Table::new("texture"),
            views: Table::new("view"),
            samplers: Table::new("sampler"),
            shaders: Table::new("shader"),
            bind_group_layouts: Table::new("bind group layout"),
            pipeline_layouts: Table::new("pipeline layout"),
            bind_groups: Table::new("bind group"),
            render_pipelines: Table::new("render pipeline"),
            compute_pipelines: Table::new("compute pipeline"),
            bundles: Table::new("bundle"),
            query_sets: Table::new("query set"),
            ledger,
            holdings: Holdings::default(),
        }
    }

    /// A texture whose words are up to date with what passes have drawn.
    ///
    /// # Errors
    /// If it does not exist, or too much has been copied.
    pub fn flushed(&mut self, id: TextureId) -> Result<&mut Texture, Reason> {
        let written = self.textures.get_mut(id.0)?.flush();
        if written > 0 {
            self.ledger.bytes.charge(written)?;
        }
        Ok(self.textures.get_mut(id.0)?)
    }

    /// The newest contents of a view, ready for sampling; passes' results are flushed into the texture first.
    ///
    /// # Errors
    /// If the view or its texture does not exist.
    pub fn prepare_view(&mut self, id: u32) -> Result<Arc<texture::View>, Reason> {
        let texture = self.views.get(id)?.texture;
        self.flushed(texture)?;
        let view = self.views.get_mut(id)?;
        let texture = self.textures.get(texture.0)?;
        if let Some((version, prepared, _)) = &view.prepared
            && *version == texture.version
        {
            return Ok(prepared.clone());
        }
        view.prepared = None;
        let bytes = texture::View::bytes(&texture.image, &view.range);
        self.ledger.bytes.charge(bytes)?;
        let claim = self.ledger.claim("a view that is ready for sampling", bytes)?;
        let each = |parts: usize, part: &(dyn Fn(usize) + Sync)| parallel::each_number(parts, parallel::ANY, part);
        let made = texture::View::new_in_parts(&texture.words, &texture.image, &view.range, texture.address, &each);
        let prepared = Arc::new(made?);
        view.prepared = Some((texture.version, prepared.clone(), claim));
        Ok(prepared)
    }
}
