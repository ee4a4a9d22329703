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

    /// Clears the aspects of a depth attachment that the pass clears. Only where nothing of what was there is left can flags say so.
    pub fn depth(&mut self, store: &mut Store, attachment: &Attachment) {
        let format = attachment.surface.format;
        let depth = match attachment.load {
            Load::Clear(value) if format.has_depth() => Some(texel::depth_code(format, f32::from_bits(value[0]))),
            _ => None,
        };
        let stencil = match attachment.stencil_load {
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
