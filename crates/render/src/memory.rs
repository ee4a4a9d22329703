//! Addresses in the card's memory.

use gfx::image::ImageDesc;
use gfx::tiling::{BlockLayout, Tiled};
use work::{LINE, LINES};

/// Bytes of addresses: work names memory by lines of 64 bytes, and copies of surfaces lie behind.
const ADDRESSES: u64 = LINE * LINES as u64;

/// Gives out addresses in order of creation. Nothing is given back: an address names one object for the whole trace, so that no
/// cache of a machine can mistake one for another.
#[derive(Clone, Debug)]
pub struct AddressSpace {
    next: u64,
}

/// Alignment of buffers in bytes, at least what any binding offset may need.
const BUFFER_ALIGN: u64 = 256;

/// Alignment of textures in bytes: a DRAM row of common parts, and a multiple of every block of texels.
const TEXTURE_ALIGN: u64 = 4096;

/// A card's addresses do not reach for an object.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error(
    "{bytes} bytes of addresses where {given} are given out: a card has {ADDRESSES}, and those of what is destroyed are not given out again; \
     replay fewer frames, or a trace that creates less"
)]
pub struct NoAddresses {
    /// Bytes of the object.
    pub bytes: u64,
    /// Bytes that are given out.
    pub given: u64,
}

/// Addresses cannot be skipped.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error(
    "address {to} is not between {given}, the end of the addresses that are given out, and {ADDRESSES}, the last that a card has"
)]
pub struct NoSkip {
    /// The address.
    pub to: u64,
    /// The end of the addresses that are given out.
    pub given: u64,
}

impl AddressSpace {
    /// An empty space. Address 0 is left out, so that it can mean nothing.
    pub fn new() -> AddressSpace {
        AddressSpace { next: TEXTURE_ALIGN }
    }

    /// An address for a buffer of `bytes` bytes.
    ///
    /// # Errors
    /// If fewer bytes are left.
    pub fn buffer(&mut self, bytes: u64) -> Result<u64, NoAddresses> {
        self.take(bytes, BUFFER_ALIGN)
    }

    /// An address for a texture: room for its tiled form, in which each image is padded to whole blocks.
    ///
    /// # Errors
    /// If fewer bytes are left.
    pub fn texture(&mut self, bytes: u64) -> Result<u64, NoAddresses> {
        self.take(bytes, TEXTURE_ALIGN)
    }

    /// The address behind all that are given out.
    pub fn end(&self) -> u64 {
        self.next
    }

    /// Gives out no address before `to`.
    ///
    /// # Errors
    /// If an address from `to` on is given out, or a card has no such address.
    pub fn skip(&mut self, to: u64) -> Result<(), NoSkip> {
        if !(self.next..=ADDRESSES).contains(&to) {
            return Err(NoSkip { to, given: self.next });
        }
        self.next = to;
        Ok(())
    }

    fn take(&mut self, bytes: u64, align: u64) -> Result<u64, NoAddresses> {
        let at = self.next.next_multiple_of(align);
        match at.checked_add(bytes.max(1)) {
            Some(end) if end <= ADDRESSES => {
                self.next = end;
                Ok(at)
            }
            _ => Err(NoAddresses { bytes, given: at }),
        }
    }
}

/// First byte of one image of a texture, seen as a render target, from the texture's address: images in order of level and
/// layer, each in blocks of 8x8 pixels.
pub fn target_offset(image: &ImageDesc, level: u32, layer: u32) -> u64 {
    let image_bytes = |level: u32| {
        let [width, height, _] = image.level_size(level);
        BlockLayout::new(width, height, image.samples, image.format).bytes()
    };
    let before: u64 = (0..level).map(|l| image_bytes(l) * u64::from(image.level_size(l)[2])).sum();
    before + u64::from(layer) * if level < image.levels { image_bytes(level) } else { 0 }
}

/// Bytes that a texture takes in the card's memory: room for its layout as a sampled texture and as a render target.
pub fn texture_bytes(image: &ImageDesc) -> u64 {
    Tiled::new(image).bytes().max(target_offset(image, image.levels, 0))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn addresses_are_aligned_and_apart() {
        let mut space = AddressSpace::new();
        let a = space.buffer(10).unwrap();
        let b = space.buffer(0).unwrap();
        let t = space.texture(5000).unwrap();
        let u = space.texture(1).unwrap();
        assert!(a >= TEXTURE_ALIGN && a.is_multiple_of(BUFFER_ALIGN));
        assert!(b >= a + 10 && t >= b && t.is_multiple_of(TEXTURE_ALIGN));
        assert_eq!(u, t + 8192);
    }

    #[test]
    fn addresses_are_skipped_forwards_only() {
        let mut space = AddressSpace::new();
        space.buffer(10).unwrap();
        let end = space.end();
        space.skip(end).unwrap();
        assert_eq!(space.skip(end - 1), Err(NoSkip { to: end - 1, given: end }));
        space.skip(3 * TEXTURE_ALIGN + 1).unwrap();
        assert_eq!(space.texture(1), Ok(4 * TEXTURE_ALIGN));
        assert!(space.skip(ADDRESSES + 1).is_err());
        space.skip(ADDRESSES).unwrap();
        assert!(space.buffer(1).is_err());
    }

    #[test]
    fn addresses_end_where_lines_would_begin_anew() {
        let mut space = AddressSpace::new();
        let first = space.buffer(ADDRESSES - TEXTURE_ALIGN - BUFFER_ALIGN).unwrap();
        assert_eq!(space.buffer(BUFFER_ALIGN), Ok(first + ADDRESSES - TEXTURE_ALIGN - BUFFER_ALIGN));
        let refused = space.buffer(1).unwrap_err().to_string();
        assert!(refused.starts_with(&format!("1 bytes of addresses where {ADDRESSES} are given out")), "{refused}");
        assert!(space.texture(u64::MAX).is_err());
    }
}
