//! The beginning of a pass: attachments are cleared or known, copies begin.

use super::Command;
use std::sync::Arc;

use super::super::card::{Card, DepthStart, PassState};
use super::super::clears::Clears;
use super::super::copies;
use super::super::rendering_elimination::{self, Use};
use super::super::stamps::PassOrder;
use gfx::hierarchical::depth_key;
use gfx::texel;
use num::Cycle;
use work::{Attachment, BLOCK, Event, Load, Pass, SurfaceKey};

impl Command {
    /// Clears what a pass clears of the surfaces themselves; gives the index of each attachment's.
    pub(super) fn clear(
        &self,
        card: &mut Card,
        pass: &Pass,
        of: Use,
        clears: &mut Clears,
    ) -> (Vec<Option<usize>>, Option<usize>) {
        let color = pass.color.iter().map(|attachment| {
            attachment.map(|attachment| {
                let index = card.frame.surface(&attachment.surface);
                let store = &mut card.frame.stores[index];
                if card.class_state.same_tiles {
                    rendering_elimination::begin(store, &attachment, of, self.fast_clear);
                }
                clears.color(store, &attachment);
                index
            })
        });
        let color = color.collect();
        clears.color_flags = clears.flags;
        let depth = pass.depth.map(|attachment| {
            let index = card.frame.surface(&attachment.surface);
            let store = &mut card.frame.stores[index];
            store.signatures.forget();
            clears.depth(store, &attachment);
            index
        });
        (color, depth)
    }

    /// Does all that a pass without draws asks for: it clears. The surfaces are in memory, where the pass before has left them.
    pub(super) fn skip_pass(&mut self, card: &mut Card, pass: &Pass) -> Cycle {
        let mut clears = Clears::new(self.fast_clear);
        self.clear(card, pass, Use::Empty, &mut clears);
        if let Some(attachment) = &pass.depth
            && let Some(bounds) = cleared_depths(attachment)
        {
            let key = attachment.surface.key;
            // Pipelines would still have the bounds of before.
            self.depth_known = self.depth_known.filter(|&known| known != key);
            self.depth_cleared = Some((key, bounds));
        }
        self.counts.empty_passes += 1;
        self.clears = clears.writes;
        u64::from(clears.flags).div_ceil(u64::from(self.clears_per_cycle))
    }

    /// Installs a pass: its surfaces, its clears.
    pub(super) fn begin_pass(&mut self, card: &mut Card, pass: &Arc<Pass>) -> Cycle {
        let signature = if card.class_state.same_tiles && self.fast_clear { rendering_elimination::sign(pass) } else { None };
        let of = if signature.is_some() { Use::Signed } else { Use::Drawn };
        for target in pass.color.iter().flatten().filter_map(|attachment| attachment.resolve) {
            if let Some(index) = card.frame.find(target.key) {
                card.frame.stores[index].signatures.forget();
            }
        }
        let mut clears = Clears::new(self.fast_clear);
        let (color, depth) = self.clear(card, pass, of, &mut clears);
        let Clears { mut flags, color_flags, writes: mut clears, .. } = clears;
        let depth_start = pass.depth.map(|attachment| {
            let key = attachment.surface.key;
            let bounds = match cleared_depths(&attachment) {
                Some(bounds) => Some(bounds),
                None if self.depth_known == Some(key) && card.class_state.copies.is_empty() => None,
                None => {
                    Some(self.depth_cleared.filter(|(cleared, _)| *cleared == key).map_or((0, u32::MAX), |(_, bounds)| bounds))
                }
            };
            self.depth_known = Some(key);
            self.depth_cleared = self.depth_cleared.filter(|(cleared, _)| *cleared != key);
            if let Some(bounds) = bounds {
                self.depth_began = (self.passes, bounds);
            }
            DepthStart { bounds, began: self.depth_began }
        });
        let (across, down) = (pass.width.div_ceil(BLOCK), pass.height.div_ceil(BLOCK));
        let number = self.passes;
        self.passes += 1;
        let blocks = (across * down) as usize;
        let (order, primitives) = (PassOrder::default(), primitives_ahead(card));
        let state = PassState {
            number,
            depth_start,
            blocks,
            pass: pass.clone(),
            color,
            depth,
            blocks_across: across,
            primitives,
            order,
            signature,
            raised: false,
            lowered: false,
        };
        if let Some(surface) = state.depth
            && !card.class_state.seen.is_empty()
        {
            // Each pipeline's copy of the depths is cleared as the surface is: by flag, or in memory.
            flags += (flags - color_flags) * card.class_state.seen.len() as u32;
            let address = card.frame.stores[surface].surface.address;
            let written = clears.iter().find(|&&(at, _)| at == address).copied();
            copies::begin_seen(&card.frame, &mut card.class_state.seen, surface, written.is_some());
            if let Some((address, bytes)) = written {
                clears.extend((0..card.class_state.seen.len()).map(|pipeline| (address + copies::behind(pipeline), bytes)));
            }
        }
        if !card.class_state.copies.is_empty() {
            let cleared = |&&surface: &&usize| {
                let address = card.frame.stores[surface].surface.address;
                clears.iter().any(|&(at, _)| at == address)
            };
            let written: Vec<usize> = state.color.iter().flatten().chain(&state.depth).filter(cleared).copied().collect();
            copies::begin(&card.frame, &mut card.class_state.copies, &state, &written);
            // Beside the surfaces all copies are cleared; a single pipeline's is the surface.
            let pipelines = card.class_state.copies.len();
            if pipelines > 1 {
                let own = clears.clone();
                for pipeline in 0..pipelines {
                    let behind = copies::offset(pipeline, pipelines);
                    clears.extend(own.iter().map(|&(address, bytes)| (address + behind, bytes)));
                }
                flags *= pipelines as u32 + 1;
            }
        }
        self.load_presented(pass);
        self.states.begin_pass();
        self.counts.passes += 1;
        self.in_pass = true;
        card.passes.begin(state);
        card.interleave.begin_pass(pass.width, pass.height);
        self.clears = clears;
        u64::from(flags).div_ceil(u64::from(self.clears_per_cycle))
    }

    /// Something other than a draw has written a surface.
    pub(super) fn forget_depths(&mut self, key: SurfaceKey) {
        self.depth_known = self.depth_known.filter(|&known| known != key);
        self.depth_cleared = self.depth_cleared.filter(|(cleared, _)| *cleared != key);
    }
}

/// The bounds of all blocks of a depth attachment that a pass clears, as ordered keys; none: it does not.
fn cleared_depths(attachment: &Attachment) -> Option<(u32, u32)> {
    let format = attachment.surface.format;
    match attachment.load {
        Load::Clear(value) if format.has_depth() => {
            let key = depth_key(format, texel::depth_code(format, f32::from_bits(value[0])));
            Some((key, key))
        }
        _ => None,
    }
}

/// Primitives up to the end of the pass, of the events that are here.
fn primitives_ahead(card: &Card) -> u64 {
    let pass = card.events.iter().skip(1).take_while(|event| !matches!(event, Event::EndPass(_)));
    let primitives = |event: &Event| if let Event::Segment(segment) = event { segment.primitives.len() as u64 } else { 0 };
    pass.map(primitives).sum()
}
