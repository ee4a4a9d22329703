//! Clears of a pass's attachments: by flag or in memory.

use std::collections::VecDeque;

use super::frame::{BlockState, Store};
use gfx::format::TexelKind;
use gfx::texel;
use work::{Attachment, Load};

/// The clears with which a pass begins.
#[derive(Clone, Debug, Default)]
pub struct Clears {
    /// The number of flags to be set.
    pub flags: u32,
    /// The flags of colours among `flags`.
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
        let value = |load: Load| if let Load::Clear(value) = load { Some(value) } else { None };
        let depth = value(attachment.load).map(|value| f32::from_bits(value[0]));
        let stencil = value(attachment.stencil_load).map(|value| value[1]);
        let (mut code, mut mask) = texel::depth_stencil_code(format, depth, stencil);
        let (depth_mask, stencil_mask) = texel::aspect_masks(format);
        let both: [u32; 4] = std::array::from_fn(|w| depth_mask[w] | stencil_mask[w]);
        let stencil_word = stencil_mask.iter().position(|&bits| bits != 0);
        if mask == depth_mask
            && mask != both
            && format.has_depth()
            && let Some(word) = stencil_word
            && let Some(value) = store.uniform(word as u32, stencil_mask[word])
        {
            // All stencil values are the same: the flag can stand for them, too.
            code[word] |= value;
            mask = both;
        }
        let whole = mask == both;
        if whole {
            store.clear(code);
        } else if mask != [0; 4] {
            store.clear_masked([code[0], code[1]], [mask[0], mask[1]]);
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
