//! The resources that are bound to a program when it runs.

use gfx::image::ImageDesc;
use gfx::texture;
use num::Words;

/// A range of a buffer.
#[derive(Clone, Copy, Debug)]
pub struct BufferRange<'a> {
    /// The buffer's bytes.
    pub words: &'a Words,
    /// First byte, a multiple of 4.
    pub offset: u64,
    /// Bytes. A range that is longer than the buffer ends with the buffer.
    pub size: u64,
    /// Address of the first byte of the range in the card's memory; only recorded memory lines use it.
    pub address: u64,
}

/// One level of a texture, for loads, stores and atomics without filtering.
#[derive(Clone, Copy, Debug)]
pub struct StorageImage<'a> {
    /// The texture's bytes.
    pub words: &'a Words,
    /// The texture's shape; its format is the view's.
    pub desc: ImageDesc,
    /// The level.
    pub level: u32,
    /// First layer of the view (2D arrays).
    pub base_layer: u32,
    /// Layers of the view (2D arrays).
    pub layers: u32,
    /// Address of the texture in the card's memory; only recorded memory lines use it.
    pub address: u64,
}

/// Something bound.
#[derive(Clone, Copy, Default)]
pub enum Resource<'a> {
    /// Nothing: reads give zero, writes are dropped.
    #[default]
    None,
    /// A buffer.
    Buffer(BufferRange<'a>),
    /// A sampled texture.
    Texture(&'a texture::View),
    /// A storage texture.
    Storage(StorageImage<'a>),
    /// A sampler.
    Sampler(&'a texture::Sampler),
}

/// The resources of a draw or dispatch.
#[derive(Clone, Copy, Default)]
pub struct Resources<'a> {
    /// For each binding of the interface, in its order, the elements: one, or those of the binding array.
    pub bindings: &'a [Vec<Resource<'a>>],
    /// The one element of each, where no binding is an array; then there are no `bindings`. Lists of one element take long to make where draws
    /// are small.
    pub single: &'a [Resource<'a>],
    /// Immediates, in words; missing ones read as zero.
    pub immediates: &'a [u32],
}

impl<'a> Resources<'a> {
    /// Element `element` of binding `binding`; out of range reads as the last element, as an unbound one if there is none.
    #[inline]
    pub(super) fn get(&self, binding: u16, element: u32) -> Resource<'a> {
        if let Some(resource) = self.single.get(usize::from(binding)) {
            return *resource;
        }
        match self.bindings.get(usize::from(binding)) {
            Some(elements) if !elements.is_empty() => elements[(element as usize).min(elements.len() - 1)],
            _ => Resource::None,
        }
    }
}
