//! Clears of a pass's attachments: by flag or in memory.

use std::collections::VecDeque;

use super::frame::{BlockState, Store};
use gfx::format::{Format, TexelKind};
use gfx::texel;
use work::{Attachment, Load};

/// The clears with which a pass begins.
#[derive(Clone, Debug, Default)]
pub struct Clears {
    /// Flags to be set, those of colours among them.
    pub flags: u32,
    /// See `flags`.
    pub color_flags: u32,
    /// Surfaces to be cleared in memory: address and bytes.
    pub writes: VecDeque<(u64, u64)>,
    fast: bool,
}

impl Clears {
    /// None yet. `fast`: by flag.
    pub fn new(fast: bool) -> Clears {
        Clears { fast, ..Clears::default() }
    }

    /// Clears a colour attachment, if the pass does.
    pub fn color(&mut self, store: &mut Store, attachment: &Attachment) {
        if let Load::Clear(value) = attachment.load {
            store.clear(texel::encode_code(attachment.surface.format, value));
            self.mark(store);
        }
    }

    /// Clears the aspects of a depth attachment that the pass clears. Flags can say so where nothing of what was there is left, or stencil
    /// values that are all the same.
    pub fn depth(&mut self, store: &mut Store, attachment: &Attachment) {
        let format = attachment.surface.format;
        let depth = match attachment.load {
            Load::Clear(value) if format.has_depth() => Some(texel::depth_code(format, f32::from_bits(value[0]))),
            _ => None,
        };
        let mut stencil = match attachment.stencil_load {
            Load::Clear(value) if format.has_stencil() => Some(value[1] & 0xff),
            _ => None,
        };
        let (mut code, mut mask) = ([0; 2], [0; 2]);
        // Where depth and stencil lie in the words of a texel.
        let (depth_mask, stencil_word, shift) = match format {
            Format::Depth24PlusStencil8 => (0x00ff_ffff, 0, 24),
            Format::Depth32FloatStencil8 => (u32::MAX, 1, 0),
            Format::Stencil8 => (0, 0, 0),
            _ => (u32::MAX, 0, 0),
        };
        if let Some(depth) = depth {
            code[0] |= depth & depth_mask;
            mask[0] |= depth_mask;
        }
        if let Some(stencil) = stencil {
            code[stencil_word] |= stencil << shift;
            mask[stencil_word] |= 0xff << shift;
        }
        if depth.is_some()
            && stencil.is_none()
            && let Some(value) = store.uniform(stencil_word as u32, 0xff << shift).filter(|_| format.has_stencil())
        {
            // All stencil values are the same: the flag can stand for them, too.
            code[stencil_word] |= value;
            mask[stencil_word] |= 0xff << shift;
            stencil = Some(value);
        }
        let whole = (depth.is_some() || !format.has_depth()) && (stencil.is_some() || !format.has_stencil());
        if whole {
            store.clear([code[0], code[1], 0, 0]);
        } else if depth.is_some() || stencil.is_some() {
            store.clear_masked(code, mask);
        }
        if whole && format.kind() == TexelKind::Depth {
            self.mark(store);
        }
    }

    /// Notes that a surface holds its clear value: by flag, or as a write to memory still to be done.
    fn mark(&mut self, store: &mut Store) {
        let blocks = store.blocks.len();
        if self.fast {
            store.blocks.fill(BlockState::Cleared);
            self.flags += blocks as u32;
        } else {
            let raw = store.block_bytes();
            store.blocks.fill(BlockState::Stored(raw as u16));
            self.writes.push_back((store.surface.address, blocks as u64 * u64::from(raw)));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::{BlockState, Clears, Store};
    use crate::tests::scenery::{attachment, surface};
    use gfx::format::Format;
    use work::{Attachment, Load};

    #[test]
    fn a_clear_of_depths_is_by_flag_where_all_stencil_values_are_the_same() {
        let surface = surface(1, Format::Depth24PlusStencil8, 4, 1);
        let attachment =
            Attachment { load: Load::Clear([1.0_f32.to_bits(), 0, 0, 0]), stencil_load: Load::Load, ..attachment(surface) };
        let cleared = |last: u32| {
            let mut store = Store::new(surface);
            store.clear([0x0500_0123, 0, 0, 0]);
            *store.codes.last_mut().expect("a texel") = last;
            let mut clears = Clears::new(true);
            clears.depth(&mut store, &attachment);
            (clears.flags, store.blocks[0], store.codes.to_vec())
        };
        let (flags, block, codes) = cleared(0x0500_0777);
        assert_eq!((flags, block), (4, BlockState::Cleared));
        assert!(codes.iter().all(|&code| code == 0x05ff_ffff));
        // One stencil value is another.
        let (flags, block, codes) = cleared(0x0600_0777);
        assert_eq!((flags, block), (0, BlockState::Stored(256)));
        assert_eq!((codes[0], codes[255]), (0x05ff_ffff, 0x06ff_ffff));
    }
}
