//! Which memory commands may touch, by which it is known whether one depends on another.

/// A run of bytes in the card's memory.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Extent {
    /// First byte.
    pub begin: u64,
    /// The byte behind the last.
    pub end: u64,
}

impl Extent {
    /// `bytes` bytes from an address on.
    pub fn new(address: u64, bytes: u64) -> Extent {
        Extent { begin: address, end: address.saturating_add(bytes) }
    }
}

/// A set of bytes in the card's memory.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Extents {
    /// In the order of their addresses, with bytes between any two.
    list: Vec<Extent>,
}

impl Extents {
    /// Adds bytes.
    pub fn add(&mut self, extent: Extent) {
        if extent.begin >= extent.end {
            return;
        }
        // Those that overlap it or border on it become one with it.
        let first = self.list.partition_point(|known| known.end < extent.begin);
        let behind = first + self.list[first..].partition_point(|known| known.begin <= extent.end);
        let own = &self.list[first..behind];
        let begin = own.first().map_or(extent.begin, |known| known.begin.min(extent.begin));
        let end = own.last().map_or(extent.end, |known| known.end.max(extent.end));
        if own.len() == 1 {
            self.list[first] = Extent { begin, end };
        } else {
            self.list.splice(first..behind, [Extent { begin, end }]);
        }
    }

    /// Whether some bytes are in both sets.
    pub fn meets(&self, other: &Extents) -> bool {
        let (few, many) = if self.list.len() < other.list.len() { (self, other) } else { (other, self) };
        few.list.iter().any(|extent| {
            let first = many.list.partition_point(|known| known.end <= extent.begin);
            many.list.get(first).is_some_and(|known| known.begin < extent.end)
        })
    }
}

/// The memory that a command may read and write: all that is bound to its programs, what it names, the images that it draws into.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Reach {
    /// What it may read.
    pub reads: Extents,
    /// What it may write.
    pub writes: Extents,
}

impl Reach {
    /// Whether the result depends on which of two commands comes first: one may write what the other may read or write.
    pub fn conflicts(&self, other: &Reach) -> bool {
        self.writes.meets(&other.writes) || self.writes.meets(&other.reads) || self.reads.meets(&other.writes)
    }

    /// Adds what another command may touch.
    pub fn add(&mut self, other: &Reach) {
        other.reads.list.iter().for_each(|&extent| self.reads.add(extent));
        other.writes.list.iter().for_each(|&extent| self.writes.add(extent));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A set of a few small extents, and the same byte by byte.
    fn random(chance: &mut num::Random) -> (Extents, [bool; 64]) {
        let (mut extents, mut bytes) = (Extents::default(), [false; 64]);
        for _ in 0..chance.below(6) {
            let begin = chance.below(60);
            let count = chance.below(5);
            extents.add(Extent::new(begin.into(), count.into()));
            bytes[begin as usize..][..count as usize].fill(true);
        }
        (extents, bytes)
    }

    #[test]
    fn spans_are_the_sets_of_their_bytes() {
        let mut chance = num::Random::new(3);
        let mut met = 0;
        for _ in 0..20_000 {
            let ((a, of_a), (b, of_b)) = (random(&mut chance), random(&mut chance));
            let mut listed = [false; 64];
            a.list.iter().for_each(|extent| listed[extent.begin as usize..extent.end as usize].fill(true));
            assert_eq!(listed, of_a, "{a:?}");
            assert!(a.list.windows(2).all(|pair| pair[0].end < pair[1].begin), "{a:?}");
            let meet = of_a.iter().zip(&of_b).any(|(a, b)| *a && *b);
            assert_eq!((a.meets(&b), b.meets(&a)), (meet, meet), "{a:?} and {b:?}");
            met += u32::from(meet);
        }
        assert!((4_000..16_000).contains(&met), "{met}");
    }

    #[test]
    fn only_what_both_read_does_not_conflict() {
        let of = |reads: &[u64], writes: &[u64]| {
            let mut reach = Reach::default();
            reads.iter().for_each(|&at| reach.reads.add(Extent::new(at, 16)));
            writes.iter().for_each(|&at| reach.writes.add(Extent::new(at, 16)));
            reach
        };
        let one = of(&[0, 64], &[128]);
        for (other, conflict) in [
            (of(&[0, 64], &[144]), false),
            (of(&[128], &[]), true),
            (of(&[], &[136]), true),
            (of(&[], &[64]), true),
            (of(&[], &[48]), false),
            (of(&[], &[]), false),
        ] {
            assert_eq!((one.conflicts(&other), other.conflicts(&one)), (conflict, conflict), "{other:?}");
        }
    }
}
