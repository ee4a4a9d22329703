//! What a program's bindings hold at a draw or dispatch.

use std::sync::Arc;

use gfx::image::ImageDesc;
use gfx::texture::{self, Sampler, ViewRange};
use num::{BufferId, TextureId, ViewId, Words};
use shader::{Binding, BindingKind, BufferRange, Interface, Resource, StorageImage};
use trace::command::BoundResource;
use work::{Extent, Reach};

use super::draw::Signer;
use super::fault::Reason;
use super::resources::{NoObject, Resources};
use super::state::Bindings;

/// One bound object, kept alive for the length of a draw.
enum BoundObject {
    Buffer {
        words: Arc<Words>,
        offset: u64,
        size: u64,
        address: u64,
        buffer: BufferId,
    },
    /// With the texture's memory, which no other has, the version of its contents, and which part of it the view shows.
    Texture {
        view: Arc<texture::View>,
        extent: Extent,
        version: u64,
        range: ViewRange,
    },
    Storage {
        words: Arc<Words>,
        desc: ImageDesc,
        level: u32,
        base_layer: u32,
        layers: u32,
        /// The texture's memory.
        extent: Extent,
        texture: u32,
    },
    Sampler(Arc<Sampler>),
}

/// The objects of all bindings of a program, in the order of its interface.
#[derive(Default)]
pub(super) struct ResolvedBindings {
    held: Vec<BoundObject>,
    /// The end of each binding's objects, if a binding is an array. Empty if each binding has one object.
    ends: Vec<usize>,
    immediates: Vec<u32>,
}

/// Bindings of a program that are lent without a list of their own.
const FEW: usize = 8;

/// The parts of [`ResolvedBindings`] that are lent to the executor.
#[derive(Default)]
pub(super) struct Lent<'a> {
    few: [Resource<'a>; FEW],
    single: Vec<Resource<'a>>,
    arrays: Vec<Vec<Resource<'a>>>,
}

impl ResolvedBindings {
    /// Finds what is bound to each binding of an interface.
    ///
    /// # Errors
    /// If something is missing, of the wrong kind, or too small.
    pub fn new(res: &mut Resources, interface: &Interface, bound: &Bindings) -> Result<ResolvedBindings, Reason> {
        let mut resolved = ResolvedBindings::default();
        resolved.resolve(res, interface, bound)?;
        Ok(resolved)
    }

    /// As [`ResolvedBindings::new`], in the memory of others.
    ///
    /// # Errors
    /// As there.
    pub fn resolve(&mut self, res: &mut Resources, interface: &Interface, bound: &Bindings) -> Result<(), Reason> {
        self.clear();
        self.held.reserve(interface.bindings.len());
        for (number, binding) in interface.bindings.iter().enumerate() {
            resolve(res, binding, bound, &mut self.held).map_err(|reason| missing(interface, binding, reason))?;
            let single = self.ends.is_empty() && self.held.len() == number + 1;
            if !single {
                if self.ends.is_empty() {
                    self.ends.extend(1..=number);
                }
                self.ends.push(self.held.len());
            }
        }
        self.immediates.extend_from_slice(&bound.immediates);
        Ok(())
    }

    /// Holds nothing any more, and keeps its memory.
    pub fn clear(&mut self) {
        self.held.clear();
        self.ends.clear();
        self.immediates.clear();
    }

    /// The objects of each binding.
    fn bindings(&self) -> impl Iterator<Item = &[BoundObject]> {
        let count = if self.ends.is_empty() { self.held.len() } else { self.ends.len() };
        (0..count).map(|number| match &*self.ends {
            [] => &self.held[number..=number],
            ends => &self.held[if number == 0 { 0 } else { ends[number - 1] }..ends[number]],
        })
    }

    /// The same as the executor takes them.
    pub fn lend<'a>(&'a self, lent: &'a mut Lent<'a>) -> shader::Resources<'a> {
        let Lent { few, single, arrays } = lent;
        if !self.ends.is_empty() {
            arrays.extend(self.bindings().map(|elements| elements.iter().map(BoundObject::lend).collect::<Vec<_>>()));
        }
        let single = match few.get_mut(..self.held.len()) {
            _ if !self.ends.is_empty() => &[],
            Some(few) => {
                few.iter_mut().zip(&self.held).for_each(|(resource, held)| *resource = held.lend());
                &*few
            }
            None => {
                single.extend(self.held.iter().map(BoundObject::lend));
                &**single
            }
        };
        shader::Resources { bindings: arrays, single, immediates: &self.immediates }
    }

    /// Bytes that were looked up and copied for it, about.
    pub fn cost(&self) -> u64 {
        (self.held.len() * size_of::<BoundObject>() + size_of_val(&*self.immediates)) as u64
    }

    /// Signs what the program reads: the bytes of buffers, textures by the version of their contents, samplers, and some immediates.
    pub fn sign(&self, signer: &mut Signer, immediates: usize) {
        for elements in self.bindings() {
            signer.value(&elements.len());
            for held in elements {
                match held {
                    BoundObject::Buffer { words, offset, size, .. } => {
                        let mut bytes = vec![0; words.len().saturating_sub(*offset).min(*size) as usize];
                        words.read(*offset, &mut bytes);
                        signer.bytes(&bytes);
                    }
                    BoundObject::Texture { extent, version, range, .. } => signer.value(&(extent.begin, version, range)),
                    // A storage texture that is only read: its contents have no version apart from the texture's.
                    BoundObject::Storage { words, desc, level, base_layer, layers, .. } => {
                        signer.value(&(desc, level, base_layer, layers));
                        signer.bytes(&words.to_vec());
                    }
                    BoundObject::Sampler(sampler) => signer.value(sampler),
                }
            }
        }
        // Immediates that are not set read as zeros.
        let words = |at: usize| self.immediates.get(at).copied().unwrap_or(0);
        signer.words(&(0..immediates).map(words).collect::<Vec<u32>>());
    }

    /// Adds the memory that the program of this interface may read and write: of textures, all of them.
    pub fn reach(&self, interface: &Interface, reach: &mut Reach) {
        for (binding, elements) in interface.bindings.iter().zip(self.bindings()) {
            for held in elements {
                let extent = match held {
                    BoundObject::Buffer { words, offset, size, address, .. } => {
                        Extent::new(*address, words.len().saturating_sub(*offset).min(*size))
                    }
                    BoundObject::Texture { extent, .. } | BoundObject::Storage { extent, .. } => *extent,
                    BoundObject::Sampler(_) => continue,
                };
                reach.reads.add(extent);
                if binding.written {
                    reach.writes.add(extent);
                }
            }
        }
    }

    /// Notes that the program of this interface has written what it may write.
    ///
    /// # Errors
    /// If a texture or buffer is gone.
    pub fn note_writes(&self, res: &mut Resources, interface: &Interface) -> Result<(), NoObject> {
        for (_, elements) in interface.bindings.iter().zip(self.bindings()).filter(|(binding, _)| binding.written) {
            for held in elements {
                match held {
                    BoundObject::Storage { texture, .. } => res.overwritten_all(TextureId(*texture))?,
                    BoundObject::Buffer { buffer, .. } => res.buffers.get(buffer.0)?.changed(),
                    BoundObject::Texture { .. } | BoundObject::Sampler(_) => {}
                }
            }
        }
        Ok(())
    }
}

impl BoundObject {
    fn lend(&self) -> Resource<'_> {
        match self {
            BoundObject::Buffer { words, offset, size, address, .. } => {
                Resource::Buffer(BufferRange { words, offset: *offset, size: *size, address: *address })
            }
            BoundObject::Texture { view, .. } => Resource::Texture(view),
            BoundObject::Storage { words, desc, level, base_layer, layers, extent, .. } => Resource::Storage(StorageImage {
                words,
                desc: *desc,
                level: *level,
                base_layer: *base_layer,
                layers: *layers,
                address: extent.begin,
            }),
            BoundObject::Sampler(sampler) => Resource::Sampler(sampler),
        }
    }
}

/// A program needs a resource that is not bound as it needs it.
#[derive(Clone, Debug, thiserror::Error)]
#[allow(missing_docs, reason = "the message explains each variant")]
pub enum BindError {
    #[error("the bind group has no such binding")]
    NoBinding,
    #[error("no bind group is set at index {0}")]
    NoGroup(u32),
    #[error("{0} dynamic offsets are given")]
    DynamicOffsets(usize),
    #[error("the shader wants {kind:?}, bound is {resource:?}")]
    Kind { kind: BindingKind, resource: BoundResource },
    #[error("{size} bytes of buffer {buffer} are bound, the shader needs {least}")]
    TooSmall { size: u64, buffer: u32, least: u64 },
    #[error("entry point {entry}, group {group}, binding {binding}: {reason}")]
    Missing { entry: String, group: u32, binding: u32, reason: Box<Reason> },
}

/// The bind group that has a binding, as it is set and as it was made.
fn group_of<'b>(
    res: &'b Resources,
    binding: &Binding,
    bound: &'b Bindings,
) -> Result<(&'b super::state::BoundGroup, &'b super::resources::BindGroup), Reason> {
    let group = bound.groups.get(binding.group as usize).and_then(Option::as_ref).ok_or(BindError::NoGroup(binding.group))?;
    Ok((group, res.bind_groups.get(group.group.0)?))
}

/// The resource that is bound to a binding, as the trace names it.
///
/// # Errors
/// If nothing is.
pub(super) fn bound<'b>(res: &'b Resources, binding: &Binding, bound: &'b Bindings) -> Result<&'b BoundResource, Reason> {
    Ok(group_of(res, binding, bound)?.1.find(binding.binding).ok_or(BindError::NoBinding)?)
}

/// Why a binding of a program is not there.
pub(super) fn missing(interface: &Interface, binding: &Binding, reason: Reason) -> BindError {
    let &Binding { group, binding, .. } = binding;
    BindError::Missing { entry: interface.entry.clone(), group, binding, reason: Box::new(reason) }
}

/// Appends the objects of a binding.
fn resolve(res: &mut Resources, binding: &Binding, bound: &Bindings, held: &mut Vec<BoundObject>) -> Result<(), Reason> {
    let (group, bind_group) = group_of(res, binding, bound)?;
    let resource = bind_group.find(binding.binding).ok_or(BindError::NoBinding)?.clone();
    let dynamic = match bind_group.dynamic.binary_search(&binding.binding) {
        Ok(at) => u64::from(*group.offsets.get(at).ok_or(BindError::DynamicOffsets(group.offsets.len()))?),
        Err(_) => 0,
    };
    match (binding.kind, resource) {
        (
            kind @ (BindingKind::Uniform { .. } | BindingKind::Storage { .. }),
            BoundResource::Buffer { buffer, offset, size },
        ) => held.push(hold_buffer(res, kind, buffer, offset, size, dynamic)?),
        (kind @ (BindingKind::Uniform { .. } | BindingKind::Storage { .. }), BoundResource::Buffers(elements)) => {
            for (buffer, offset, size) in elements {
                held.push(hold_buffer(res, kind, buffer, offset, size, dynamic)?);
            }
        }
        (BindingKind::Texture { .. }, BoundResource::View(view)) => held.push(hold_texture(res, view)?),
        (BindingKind::Texture { .. }, BoundResource::Views(views)) => {
            for view in views {
                held.push(hold_texture(res, view)?);
            }
        }
        (BindingKind::StorageTexture { .. }, BoundResource::View(view)) => held.push(hold_storage(res, view)?),
        (BindingKind::StorageTexture { .. }, BoundResource::Views(views)) => {
            for view in views {
                held.push(hold_storage(res, view)?);
            }
        }
        (BindingKind::Sampler { .. }, BoundResource::Sampler(sampler)) => {
            held.push(BoundObject::Sampler(res.samplers.get(sampler.0)?.clone()));
        }
        (BindingKind::Sampler { .. }, BoundResource::Samplers(samplers)) => {
            for sampler in samplers {
                held.push(BoundObject::Sampler(res.samplers.get(sampler.0)?.clone()));
            }
        }
        (kind, resource) => return Err(BindError::Kind { kind, resource }.into()),
    }
    Ok(())
}

fn hold_buffer(
    res: &Resources,
    kind: BindingKind,
    id: BufferId,
    offset: u64,
    size: Option<u64>,
    dynamic: u64,
) -> Result<BoundObject, Reason> {
    let buffer = res.buffers.get(id.0)?;
    let (offset, size) = match size {
        Some(size) => buffer.range(id, offset + dynamic, Some(size))?,
        // "To the end" is fixed when the group is made, before a dynamic offset moves it.
        None => {
            let (offset, size) = buffer.range(id, offset, None)?;
            (offset + dynamic, size.saturating_sub(dynamic))
        }
    };
    let least = match kind {
        BindingKind::Uniform { min_size } | BindingKind::Storage { min_size, .. } => min_size,
        _ => 0,
    };
    if size < least {
        return Err(BindError::TooSmall { size, buffer: id.0, least }.into());
    }
    Ok(BoundObject::Buffer { words: buffer.words.clone(), offset, size, address: buffer.address + offset, buffer: id })
}

fn hold_texture(res: &mut Resources, id: ViewId) -> Result<BoundObject, Reason> {
    let prepared = res.prepare_view(id.0)?;
    let view = res.views.get(id.0)?;
    let texture = res.textures.get(view.texture.0)?;
    Ok(BoundObject::Texture { view: prepared, extent: texture.extent(), version: texture.version, range: view.range })
}

fn hold_storage(res: &mut Resources, id: ViewId) -> Result<BoundObject, Reason> {
    let view = res.views.get(id.0)?;
    let (id, range) = (view.texture, view.range);
    let texture = res.flushed(id)?;
    Ok(BoundObject::Storage {
        words: texture.words.clone(),
        desc: ImageDesc { format: range.format, ..texture.image },
        level: range.base_level,
        base_layer: range.base_layer,
        layers: range.layers,
        extent: texture.extent(),
        texture: id.0,
    })
}
