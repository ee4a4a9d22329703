//! What a frame touches in memory, some of it standing for all.
//!
//! Some groups of 256 bytes of memory are followed, chosen by a hash of the address. Caches that are smaller by the same factor behave
//! on what is followed as the whole ones do on all (Waldspurger et al., Efficient MRC Construction with SHARDS, 2015, and Cache
//! Modeling and Optimization using Miniature Simulations, 2017). A frame begins with all groups, and halves their number
//! whenever more has come together than is to be kept; what follows later in the trace never has more than what came before.

use gfx::codec::CODECS;

use super::super::LINE;

/// Lines of a group, as a power of two.
const GROUP: u32 = 2;

/// Touches of a frame that are kept at most.
const MOST: usize = 32768;

/// Who touches memory.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Toucher {
    /// A texture request or a load of a fragment.
    #[default]
    Texture,
    /// A store or an atomic.
    Store,
    /// Vertex fetch, or a vertex's shader.
    Vertex,
    /// The depth test, a block.
    Depth,
    /// The ROP, a block of the attachment [`Touch::step`].
    Color,
    /// A resolve, a block of it.
    Resolve,
    /// A transfer or scan-out that reads.
    Read,
    /// A transfer or a resolve that writes.
    Write,
}

/// A line or block that is followed is touched.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Touch {
    /// Its first line: address by [`LINE`].
    pub line: u32,
    /// The phase, among those of the frame.
    pub phase: u16,
    /// Of textures: the class of the gaps before ([`gaps_of`](super::gaps_of)); else the groups that it stands for, 0 for a line alone.
    pub class: u16,
    /// Of blocks: how many of [`BLOCK_CACHES`](super::BLOCK_CACHES) have lost it since, and [`FIRST`] where the pass has not touched it before.
    pub near: u8,
    /// Of depth: 1 if it is written; of colour: the attachment, with [`WHOLE`] where all of the block's colours are replaced.
    pub step: u8,
    /// Of blocks: memory lines that it takes as the pass leaves it, by each codec ([`gfx::codec::lines`]).
    pub stored: [u8; CODECS],
    /// By whom.
    pub by: Toucher,
}

/// A block that its pass has not touched before.
pub const FIRST: u8 = u8::MAX;

/// Of [`Touch::step`]: a block of colours is written whole, and nothing of what was there is needed.
pub const WHOLE: u8 = 0x40;

/// Shaded quads that are taken together.
pub const BUNDLE: u32 = 8;

/// Touches as they are collected.
#[derive(Debug)]
pub(super) struct Touches {
    /// One group of 2 to this power is followed.
    shift: u8,
    limit: u32,
    all: Vec<Touch>,
    /// The phase under way.
    pub phase: u16,
}

impl Default for Touches {
    fn default() -> Touches {
        Touches { shift: 0, limit: u32::MAX, all: Vec::new(), phase: 0 }
    }
}

/// The hash of a line's group. Fibonacci hashing: of neighbours as many are followed as should be.
fn hash(line: u32) -> u32 {
    (line >> GROUP).wrapping_mul(0x9e37_79b9)
}

impl Touches {
    /// Whether a line is followed.
    #[inline(always)]
    pub fn follows(&self, line: u32) -> bool {
        hash(line) <= self.limit
    }

    /// Takes a touch of a line that is followed.
    pub fn push(&mut self, touch: Touch) {
        self.all.push(Touch { phase: self.phase, ..touch });
        if self.all.len() > MOST {
            self.thin();
        }
    }

    /// The touches of the phase under way.
    pub fn of_phase(&mut self) -> impl Iterator<Item = &mut Touch> {
        let phase = self.phase;
        let begin = self.all.partition_point(|touch| touch.phase < phase);
        self.all[begin..].iter_mut()
    }

    /// Takes a touch unless it is like one just before.
    #[inline(always)]
    pub fn push_once(&mut self, touch: Touch) {
        let same = |t: &Touch| t.line == touch.line && t.by == touch.by && t.phase == self.phase;
        if !self.all.iter().rev().take(8).any(same) {
            self.push(touch);
        }
    }

    /// Takes all pieces of a run of bytes: groups, or blocks as large as several, of which the first group stands for all.
    pub fn run(&mut self, address: u64, bytes: u64, piece: u64, by: Toucher) {
        let groups = piece.div_ceil(LINE << GROUP).clamp(1, u64::from(u16::MAX));
        let mut group = address / LINE >> GROUP;
        while group << GROUP < (address + bytes).div_ceil(LINE) {
            let line = (group << GROUP) as u32;
            if self.follows(line) {
                self.push(Touch { line, class: groups as u16, by, ..Touch::default() });
            }
            group += groups;
        }
    }

    /// Follows half as many groups from now on.
    #[cold]
    fn thin(&mut self) {
        while self.all.len() > MOST && self.shift < 31 {
            self.shift += 1;
            self.limit >>= 1;
            let limit = self.limit;
            self.all.retain(|touch| hash(touch.line) <= limit);
        }
    }

    /// The touches of the frame that ends, in order.
    pub fn end_frame(&mut self) -> Sampled {
        self.phase = 0;
        Sampled { shift: self.shift, touches: std::mem::take(&mut self.all) }
    }
}

/// What a frame touches in memory.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Sampled {
    /// One group of 256 bytes of 2 to this power is in it.
    pub shift: u8,
    /// The touches in order.
    pub touches: Vec<Touch>,
}

impl Sampled {
    /// Whether a line is in what is followed at that power.
    pub fn follows(line: u32, shift: u8) -> bool {
        hash(line) <= u32::MAX >> shift.min(31)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_followed_stands_for_all() {
        let mut touches = Touches::default();
        touches.run(1 << 20, 8 << 20, 1, Toucher::Read);
        let sampled = touches.end_frame();
        assert!(sampled.touches.len() <= MOST && sampled.touches.len() > MOST / 3, "{}", sampled.touches.len());
        let all = sampled.touches.len() << sampled.shift;
        assert!(all.abs_diff(32768) < 32768 / 20, "{all} of 32768");
        assert!(sampled.touches.iter().all(|touch| Sampled::follows(touch.line, sampled.shift)));
    }

    #[test]
    fn what_is_touched_again_at_once_is_one_touch() {
        let mut touches = Touches::default();
        for line in [5, 9, 5, 9, 5] {
            touches.push_once(Touch { line, ..Touch::default() });
        }
        (20..40).for_each(|line| touches.push(Touch { line, ..Touch::default() }));
        touches.push_once(Touch { line: 5, ..Touch::default() });
        assert_eq!(touches.end_frame().touches.len(), 23);
    }
}
