//! The traffic of a pass between the first-level caches and the second level.

use super::binned::{Followed, Lists};
use super::images::{copy, drawn_by};
use super::memory::Traffic;
use super::texture::Missed;
use super::{Bound, Touched, places};
use machine::class::Sorted;
use work::LINE;
use work::profile::{AttachmentProfile, BLOCK_CACHES, FIRST, Touch, Toucher, WHOLE};

/// The traffic that a pass causes in the second-level cache.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct PassTraffic {
    pub all: Traffic,
    pub textures: Traffic,
    /// Blocks read, of colour and of depth.
    pub fills: [Traffic; 2],
    /// Blocks of colour that are missed, and of these those that are written whole and not read.
    pub replaced: [f64; 2],
    /// Traffic of resolves, at the end.
    pub resolved: Traffic,
    /// Traffic of indices, and of attributes.
    pub indices: Traffic,
    pub attributes: Traffic,
    /// On machines that bin: traffic while they bin, and traffic of lists while these are read.
    pub binned: Traffic,
    pub listed: Traffic,
}

/// How blocks of attachments go between their caches and the second level.
struct Blocks<'p> {
    /// Colour attachments by location, and that of depth.
    color: [Option<&'p AttachmentProfile>; 8],
    depth: Option<&'p AttachmentProfile>,
    /// Misses of caches as large as [`BLOCK_CACHES`] says have left the cache of colours, or of depths, up to this one.
    levels: [u8; 2],
    /// The part of their touches by covered quads that changes something.
    shown: f64,
    /// Copies that a block is drawn in, and blocks that are resolved for each that is drawn.
    copies: f64,
    resolved: f64,
    /// Share of the pass's blocks that are drawn.
    drawn: f64,
    /// Blocks stay on the chip from their first touch to the end of their tile.
    on_chip: bool,
}

impl Bound<'_> {
    /// The traffic that a pass causes in the second-level cache. On a tile-based machine geometry comes first, with lists that are written. The
    /// lists are read as tiles are drawn.
    pub(super) fn traffic(
        &mut self,
        color: &[AttachmentProfile],
        depth: Option<&AttachmentProfile>,
        missed: &Missed,
        touched: &Touched,
        lists: Option<(&Lists, &Followed)>,
        [shown, copies, resolved, drawn]: [f64; 4],
    ) -> PassTraffic {
        let c = self.config;
        let mut sum = PassTraffic::default();
        // A block has left its cache where as many others have come as all pipelines' caches hold.
        let class = |blocks: f64| BLOCK_CACHES.iter().position(|&known| known as f64 * std::f64::consts::SQRT_2 > blocks);
        let level = |blocks: f64| class(blocks * self.pipelines / copies).unwrap_or(BLOCK_CACHES.len() - 1) as u8;
        let held = color.iter().map(places).sum::<f64>().max(1.0);
        let levels =
            [level(f64::from(c.color.cache_blocks) / held), level(f64::from(c.depth.cache_blocks) / depth.map_or(1.0, places))];
        let mut targets = [None; 8];
        targets.iter_mut().zip(color).for_each(|(target, attachment)| *target = Some(attachment));
        let blocks = Blocks { color: targets, depth, levels, shown, copies, resolved, drawn, on_chip: lists.is_some() };
        self.drawn.clear();
        // A lookup that misses with a probability of one half misses every other time.
        let mut due = [0.0; 4];
        // A line that is missed again soon is in the second level, unless this has hardly more room than all first levels together.
        let first = f64::from(c.texture.cache_lines * c.texture.line_bytes * c.core.per_pipeline) * self.pipelines;
        let second = f64::from(c.l2.slices) * f64::from(c.l2.lines * c.l2.line_bytes);
        let lost = if second < 2.0 * first { missed.inner } else { 0.0 };
        let inner = Traffic { lookups: missed.inner, misses: lost, read: lost * LINE as f64, written: 0.0 };
        (sum.textures, sum.all) = (inner, inner);
        let Some((lists, followed)) = lists else {
            touched.touches.iter().for_each(|touch| self.touch(&mut sum, touch, &blocks, missed, &mut due, touched));
            return sum;
        };
        // Lists and the rest come in proportion to their numbers.
        for (write, groups) in [(true, &followed.written), (false, &followed.read)] {
            let own = |touch: &&Touch| (touch.by == Toucher::Vertex) == write;
            let count = touched.touches.iter().filter(own).count().max(1);
            let mut begin = 0;
            for (at, touch) in touched.touches.iter().filter(own).map(Some).chain([None]).enumerate() {
                let end = if touch.is_some() { groups.len() * at / count } else { groups.len() };
                for &(line, bytes) in &groups[begin..end] {
                    sum.listed += self.shared.access(line, bytes, write);
                }
                begin = end;
                if let Some(touch) = touch {
                    self.touch(&mut sum, touch, &blocks, missed, &mut due, touched);
                }
            }
            if write {
                sum.listed.read += lists.completed();
                sum.binned = sum.all;
                sum.binned += std::mem::take(&mut sum.listed);
                sum.all = sum.binned;
            }
        }
        sum.all += sum.listed;
        sum
    }

    /// Adds what a touch does; `due`: what textures have missed of a whole line so far, what is hidden of a block, how many blocks have come back,
    /// and what is resolved of a line.
    fn touch(
        &mut self,
        sum: &mut PassTraffic,
        touch: &Touch,
        blocks: &Blocks,
        missed: &Missed,
        due: &mut [f64; 4],
        touched: &Touched,
    ) {
        let c = self.config;
        if !self.shared.follows(touch.line, touched.sampled.shift) {
            return;
        }
        let (attachment, level, compression, fast_clear) = match touch.by {
            Toucher::Texture => {
                due[0] += missed.class(touch.class);
                if due[0] >= 0.5 {
                    due[0] -= 1.0;
                    let traffic = self.plain(touch, touched.sampled.shift);
                    sum.textures += traffic;
                    sum.all += traffic;
                }
                return;
            }
            Toucher::Resolve => {
                if let Some(attachment) = blocks.color.iter().flatten().find(|attachment| attachment.resolved > 0) {
                    let bytes = (attachment.block_bytes as f64 * self.left(attachment)) as u64;
                    let traffic = self.shared.access(touch.line, bytes, false);
                    sum.resolved += traffic.times(blocks.resolved);
                }
                return;
            }
            Toucher::Write => {
                let resolved = blocks.color.into_iter().flatten().find(|attachment| attachment.resolved > 0);
                let part = resolved.map_or(1.0, |attachment| self.pixels(attachment, blocks.drawn));
                // Whole lines, and what is left of one with the next.
                due[3] += 4.0 * f64::from(touch.class) * part;
                let lines = due[3].floor();
                due[3] -= lines;
                sum.resolved += self.shared.access(touch.line, lines as u64 * LINE, true);
                return;
            }
            Toucher::Color => {
                let target = blocks.color[usize::from(touch.step & !WHOLE).min(7)].or(blocks.color[0]);
                (target, blocks.levels[0], c.color.compression, c.color.fast_clear)
            }
            Toucher::Depth => (blocks.depth, blocks.levels[1], c.depth.compression, c.color.fast_clear),
            _ => {
                let traffic = self.plain(touch, touched.sampled.shift);
                if touch.by == Toucher::Vertex {
                    *(if touch.class > 0 { &mut sum.indices } else { &mut sum.attributes }) += traffic;
                }
                sum.all += traffic;
                return;
            }
        };
        let Some(attachment) = attachment else { return };
        if touch.near <= level || blocks.on_chip && touch.near != FIRST {
            return;
        }
        // For what is hidden the ROP reads depths, and no more.
        due[1] += if touch.near == FIRST { 0.0 } else { 1.0 - blocks.shown };
        let hidden = due[1] >= 0.5;
        due[1] -= f64::from(u8::from(hidden));
        if hidden && touch.by == Toucher::Color {
            return;
        }
        let codec = if touch.by == Toucher::Color { c.color.codec } else { c.depth.codec };
        let bytes = if compression { u64::from(touch.stored[codec as usize]) * LINE } else { attachment.block_bytes };
        // Each of a block's copies is touched for a first time. The copies come back one after another.
        let apart = self.sorted == Sorted::Images && self.pipelines > 1.0;
        let mut own = vec![u64::from(touch.line)];
        if apart {
            let block = u64::from(touch.line - attachment.line) * LINE / attachment.block_bytes.max(1);
            let copies = drawn_by(block as u32, blocks.copies, c.card.pipelines);
            own = copies.map(|pipeline| copy(touch.line, pipeline)).collect();
        }
        if touch.near != FIRST {
            due[2] += 1.0;
            own = vec![own[due[2] as usize % own.len()]];
        }
        let left = attachment.stores || !blocks.on_chip;
        let replaced = c.color.skip_reads && touch.by == Toucher::Color && touch.step & WHOLE != 0;
        if touch.by == Toucher::Color {
            sum.replaced[0] += 1.0;
            sum.replaced[1] += f64::from(u8::from(replaced));
        }
        let mut traffic = Traffic::default();
        for own in own {
            // Until a pipeline has written a block of its own it reads the surface's.
            if !replaced && (touch.near != FIRST || attachment.loads || !fast_clear) {
                let fill = self.shared.access(if touch.near == FIRST { touch.line.into() } else { own }, bytes, false);
                sum.fills[usize::from(touch.by == Toucher::Depth)] += fill;
                traffic += fill;
            }
            // A block that is only read leaves without traffic, and so does a block of a tile that is not wanted.
            if left && !hidden && (touch.by == Toucher::Color || touch.step != 0) {
                traffic += self.shared.access(own, bytes, true);
                self.drawn.insert(touch.line);
            }
        }
        sum.all += traffic;
    }
}
