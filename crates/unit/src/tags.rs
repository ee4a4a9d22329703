//! Tags of a set-associative cache with least-recently-used replacement. Bytes live elsewhere.

pub use mem::CacheCounts;

/// No line.
const EMPTY: u64 = u64::MAX;

/// Tags, their ages, and for each line what its user keeps with it.
#[derive(Clone, Debug)]
pub struct Tags<T> {
    keys: Vec<u64>,
    used: Vec<u64>,
    data: Vec<T>,
    ways: usize,
    sets: u64,
    /// Whether the upper bits of a key are folded into the number of its set.
    folded: bool,
    clock: u64,
    counts: CacheCounts,
    /// The places where lines were found last, by [`Tags::hint`]. A line that is looked up again, as almost all lines are, is found without a
    /// search of the ways of its set.
    hints: Vec<u16>,
}

/// The most hints, which are places of 16 bits.
const HINTS: usize = 1 << 16;

/// The way that holds a key. Few ways are all looked at: leaving at the right one would be a branch that the host cannot foresee.
#[inline(always)]
fn way_of(keys: &[u64], key: u64) -> Option<usize> {
    if keys.len() > 16 {
        return keys.iter().position(|&k| k == key);
    }
    let found = keys.iter().rev().fold(0_u32, |found, &k| found << 1 | u32::from(k == key));
    (found != 0).then_some(found.trailing_zeros() as usize)
}

impl<T: Copy + Default> Tags<T> {
    /// Empty tags of `lines` lines, `ways` to a set (at most `lines`).
    pub fn new(lines: u32, ways: u32) -> Tags<T> {
        let ways = ways.min(lines).max(1) as usize;
        let sets = (lines as usize / ways).max(1);
        Tags {
            keys: vec![EMPTY; sets * ways],
            used: vec![0; sets * ways],
            data: vec![T::default(); sets * ways],
            ways,
            sets: sets as u64,
            folded: true,
            clock: 0,
            counts: CacheCounts::default(),
            hints: vec![0; (8 * sets * ways).next_power_of_two().min(HINTS)],
        }
    }

    /// The same, whose sets are given by the lowest bits of keys alone.
    pub fn unfolded(self) -> Tags<T> {
        Tags { folded: false, ..self }
    }

    /// Sets.
    pub fn sets(&self) -> u64 {
        self.sets
    }

    /// Ways of a set.
    #[inline(always)]
    pub fn ways(&self) -> usize {
        self.ways
    }

    /// The number of a key's set.
    #[inline(always)]
    pub fn set_of(&self, key: u64) -> usize {
        self.set(key) / self.ways
    }

    #[inline(always)]
    fn set(&self, key: u64) -> usize {
        // Folding the upper bits in keeps strides from falling into one set.
        let mixed = if self.folded { key ^ key >> 7 ^ key >> 15 } else { key };
        let set = if self.sets.is_power_of_two() { mixed & (self.sets - 1) } else { mixed % self.sets };
        set as usize * self.ways
    }

    /// Which hint is a line's.
    #[inline(always)]
    fn hint(&self, key: u64) -> usize {
        (key ^ key >> 11) as usize & (self.hints.len() - 1)
    }

    /// The place of a line, which becomes the youngest of its set. Counted as a hit; a miss is counted when the line is put in.
    #[inline(always)]
    pub fn find(&mut self, key: u64) -> Option<usize> {
        let hint = self.hint(key);
        let mut place = usize::from(self.hints[hint]);
        if self.keys[place] != key {
            let set = self.set(key);
            place = set + way_of(&self.keys[set..set + self.ways], key)?;
            // A place beyond 16 bits is hinted at wrongly, and looked for in its set.
            self.hints[hint] = place as u16;
        }
        self.clock += 1;
        self.used[place] = self.clock;
        self.counts.accesses += 1;
        self.counts.hits += 1;
        Some(place)
    }

    /// The place that a missing line would take: an empty one, else the least recently used of those that may go.
    #[inline(always)]
    pub fn victim(&self, key: u64, may_go: impl Fn(&T) -> bool) -> Option<usize> {
        let set = self.set(key);
        let mut best = None;
        let mut oldest = u64::MAX;
        for place in set..set + self.ways {
            if self.keys[place] == EMPTY {
                return Some(place);
            }
            if self.used[place] < oldest && may_go(&self.data[place]) {
                oldest = self.used[place];
                best = Some(place);
            }
        }
        best
    }

    /// The place of the least recently used line of a missing line's set that may go.
    pub fn oldest(&self, key: u64, may_go: impl Fn(&T) -> bool) -> Option<usize> {
        let set = self.set(key);
        let may = |&place: &usize| self.keys[place] != EMPTY && may_go(&self.data[place]);
        (set..set + self.ways).filter(may).min_by_key(|&place| self.used[place])
    }

    /// Puts a line into a place; what was there is gone.
    #[inline(always)]
    pub fn replace(&mut self, place: usize, key: u64, data: T) {
        self.counts.accesses += 1;
        self.counts.misses += 1;
        if self.keys[place] != EMPTY {
            self.counts.evictions += 1;
        }
        self.clock += 1;
        self.used[place] = self.clock;
        self.keys[place] = key;
        self.data[place] = data;
        let hint = self.hint(key);
        self.hints[hint] = place as u16;
    }

    /// The line in a place.
    #[inline(always)]
    pub fn key(&self, place: usize) -> Option<u64> {
        (self.keys[place] != EMPTY).then(|| self.keys[place])
    }

    /// The data that is kept with the line in a place.
    #[inline(always)]
    pub fn data(&mut self, place: usize) -> &mut T {
        &mut self.data[place]
    }

    /// Places in all.
    pub fn len(&self) -> usize {
        self.keys.len()
    }

    /// Whether no place holds a line.
    pub fn is_empty(&self) -> bool {
        self.keys.iter().all(|&key| key == EMPTY)
    }

    /// Forgets the line in a place.
    pub fn forget(&mut self, place: usize) {
        self.keys[place] = EMPTY;
        self.data[place] = T::default();
    }

    /// Forgets all lines.
    pub fn clear(&mut self) {
        self.keys.fill(EMPTY);
        self.data.fill(T::default());
    }

    /// Puts the counts back to what they were before something that is not to be counted.
    pub fn recount(&mut self, counts: CacheCounts) {
        self.counts = counts;
    }

    /// The counters.
    pub fn counts(&self) -> CacheCounts {
        self.counts
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_least_recently_used_line_goes() {
        let mut tags = Tags::<bool>::new(2, 2);
        for key in [1, 2] {
            assert_eq!(tags.find(key), None);
            let place = tags.victim(key, |_| true).unwrap();
            tags.replace(place, key, false);
        }
        assert!(tags.find(1).is_some());
        let place = tags.victim(3, |_| true).unwrap();
        assert_eq!(tags.key(place), Some(2));
        *tags.data(place) = true;
        let other = tags.victim(3, |pinned| !pinned).unwrap();
        assert_eq!(tags.key(other), Some(1));
        tags.replace(place, 3, false);
        assert_eq!(tags.find(2), None);
        let counts = tags.counts();
        assert_eq!((counts.accesses, counts.hits, counts.misses, counts.evictions), (4, 1, 3, 1));
    }
}
