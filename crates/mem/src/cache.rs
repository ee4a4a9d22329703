//! The tags of a cache: set-associative, in sectors, least recently used, write-back.

stats::counters! {
    /// What a cache counts.
    pub struct CacheCounts {
        /// Lookups.
        accesses: "lookups",
        /// Lookups that found their line, on its way included.
        hits: "lookups",
        /// Lookups that did not.
        misses: "lookups",
        /// Lines that gave way to others.
        evictions: "lines",
    }
}

/// Where caches of all kinds count.
pub const CACHES: stats::Heading = stats::Heading::new(
    "caches.NAME[i]",
    "Caches: `vertex` (attributes), `position`, `texture`, `constant` and `constant-second` (both levels of constant caches), `depth`, `early` (the copies of early tests), `color`, `l2`.",
);

/// The geometry of a cache, checked.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct CacheShape {
    sets: u32,
    ways: u32,
    line: u32,
    sector: u32,
}

/// Values that make no cache.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[allow(missing_docs, reason = "the message explains each variant")]
pub enum ShapeError {
    #[error("line {line} and sector {sector} must be powers of two, a sector of at least 4 bytes")]
    Powers { line: u32, sector: u32 },
    #[error("a line of {line} bytes must have 1 to 8 sectors, not sectors of {sector}")]
    Sectors { line: u32, sector: u32 },
    #[error("{lines} lines in {ways} ways make no power of two of sets")]
    Sets { lines: u32, ways: u32 },
}

impl CacheShape {
    /// A cache of `lines` lines of `line` bytes in sectors of `sector` bytes, `ways` to a set.
    ///
    /// # Errors
    /// The rule that is broken: lines, line and sector are powers of two, a line has 1 to 8 sectors of at least 4 bytes, and the
    /// sets are a power of two.
    pub fn new(lines: u32, ways: u32, line: u32, sector: u32) -> Result<CacheShape, ShapeError> {
        if !line.is_power_of_two() || !sector.is_power_of_two() || sector < 4 {
            return Err(ShapeError::Powers { line, sector });
        }
        if sector > line || line / sector > 8 {
            return Err(ShapeError::Sectors { line, sector });
        }
        if ways == 0 || lines == 0 || !lines.is_multiple_of(ways) || !(lines / ways).is_power_of_two() {
            return Err(ShapeError::Sets { lines, ways });
        }
        Ok(CacheShape { sets: lines / ways, ways, line, sector })
    }

    /// Lines.
    pub fn lines(&self) -> u32 {
        self.sets * self.ways
    }

    /// Bytes of a line.
    pub fn line(&self) -> u32 {
        self.line
    }

    /// Bytes of a sector.
    pub fn sector(&self) -> u32 {
        self.sector
    }
}

/// The place of a line: set and way in one number.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct CacheSlot(pub u32);

/// No line has this number: lines are addresses divided by at least 4.
const EMPTY: u64 = u64::MAX;

/// A line's state in addition to its tag.
#[derive(Clone, Copy, Debug, Default)]
struct State {
    used: u32,
    valid: u8,
    dirty: u8,
    fetching: u8,
}

/// The tags of a cache. Sectors are named by a mask, bit 0 the first in the line.
#[derive(Clone, Debug)]
pub struct Cache {
    shape: CacheShape,
    tags: Vec<u64>,
    states: Vec<State>,
    clock: u32,
    /// Where lines were found or filled last, by [`Cache::hint`]: what is looked up again is mostly there, without a look at the
    /// ways of its set.
    hints: Vec<u32>,
    counts: CacheCounts,
}

impl Cache {
    /// An empty cache.
    pub fn new(shape: CacheShape) -> Cache {
        let lines = shape.lines() as usize;
        Cache {
            shape,
            tags: vec![EMPTY; lines],
            states: vec![State::default(); lines],
            clock: 0,
            hints: vec![0; (2 * lines).next_power_of_two()],
            counts: CacheCounts::default(),
        }
    }

    /// Its geometry.
    pub fn shape(&self) -> CacheShape {
        self.shape
    }

    /// What it has counted.
    pub fn counts(&self) -> CacheCounts {
        self.counts
    }

    /// Puts the counts back to what they were before something that is not to be counted.
    pub fn recount(&mut self, counts: CacheCounts) {
        self.counts = counts;
    }

    /// The line of an address.
    #[inline(always)]
    pub fn line_of(&self, address: u64) -> u64 {
        address >> self.shape.line.trailing_zeros()
    }

    /// The sectors touched by `bytes` bytes at `offset` in a line.
    #[inline(always)]
    pub fn sectors(&self, offset: u32, bytes: u32) -> u8 {
        let shift = self.shape.sector.trailing_zeros();
        let (first, last) = (offset >> shift, (offset + bytes - 1) >> shift);
        ((2u32 << last) - (1 << first)) as u8
    }

    /// The sectors that `bytes` bytes at `offset` in a line cover wholly.
    #[inline(always)]
    pub fn covered(&self, offset: u32, bytes: u32) -> u8 {
        let shift = self.shape.sector.trailing_zeros();
        let first = (offset + self.shape.sector - 1) >> shift;
        let end = (offset + bytes) >> shift;
        if end > first { ((1u32 << end) - (1 << first)) as u8 } else { 0 }
    }

    #[inline(always)]
    fn set(&self, line: u64) -> usize {
        // The upper bits are folded in, so that a stride of the number of sets does not fall into one set. One set needs none.
        let folded = line ^ (line >> 8) ^ (line >> 16);
        (folded as u32 & (self.shape.sets - 1)) as usize * self.shape.ways as usize
    }

    /// Which hint is a line's.
    #[inline(always)]
    fn hint(&self, line: u64) -> usize {
        (line ^ line >> 13) as usize & (self.hints.len() - 1)
    }

    /// Where a line is, if it is: nothing is counted, and its age stays.
    #[inline(always)]
    pub fn find(&self, line: u64) -> Option<CacheSlot> {
        let hint = self.hints[self.hint(line)];
        if self.tags[hint as usize] == line {
            return Some(CacheSlot(hint));
        }
        let set = self.set(line);
        let tags = &self.tags[set..set + self.shape.ways as usize];
        if tags.len() > 16 {
            return tags.iter().position(|&tag| tag == line).map(|way| CacheSlot((set + way) as u32));
        }
        // All ways are looked at: leaving at the right one would be a branch that the host cannot foresee.
        let found = tags.iter().rev().fold(0_u32, |found, &tag| found << 1 | u32::from(tag == line));
        (found != 0).then(|| CacheSlot(set as u32 + found.trailing_zeros()))
    }

    /// Makes a line the youngest of its set.
    #[inline(always)]
    pub fn touch(&mut self, place: CacheSlot) {
        self.clock = self.clock.wrapping_add(1);
        self.states[place.0 as usize].used = self.clock;
        let hint = self.hint(self.tags[place.0 as usize]);
        self.hints[hint] = place.0;
    }

    /// Counts a lookup.
    #[inline(always)]
    pub fn count(&mut self, hit: bool) {
        self.counts.accesses += 1;
        self.counts.hits += u64::from(hit);
        self.counts.misses += u64::from(!hit);
    }

    /// The place that a line which is not there would take: an empty one, else the least recently used with nothing on its way.
    /// `None` if all lines of the set are being fetched.
    #[inline(always)]
    pub fn victim(&self, line: u64) -> Option<CacheSlot> {
        let set = self.set(line);
        let mut best = None;
        let mut oldest = 0;
        for place in set..set + self.shape.ways as usize {
            if self.tags[place] == EMPTY {
                return Some(CacheSlot(place as u32));
            }
            // Ages are differences, so that the clock may wrap; the youngest has age 0 and still is a victim if it is the only.
            let age = self.clock.wrapping_sub(self.states[place].used);
            if self.states[place].fetching == 0 && (best.is_none() || age > oldest) {
                (best, oldest) = (Some(CacheSlot(place as u32)), age);
            }
        }
        best
    }

    /// Puts a line without any valid sector into a place, as the youngest. Returns the line that was there and its dirty sectors.
    #[inline(always)]
    pub fn replace(&mut self, place: CacheSlot, line: u64) -> Option<(u64, u8)> {
        let old = self.tags[place.0 as usize];
        let dirty = self.states[place.0 as usize].dirty;
        self.tags[place.0 as usize] = line;
        self.states[place.0 as usize] = State::default();
        self.touch(place);
        if old == EMPTY {
            return None;
        }
        self.counts.evictions += 1;
        Some((old, dirty))
    }

    /// The line in a place.
    #[inline(always)]
    pub fn line(&self, place: CacheSlot) -> u64 {
        self.tags[place.0 as usize]
    }

    /// Sectors that are there.
    #[inline(always)]
    pub fn valid(&self, place: CacheSlot) -> u8 {
        self.states[place.0 as usize].valid
    }

    /// Sectors on their way.
    #[inline(always)]
    pub fn fetching(&self, place: CacheSlot) -> u8 {
        self.states[place.0 as usize].fetching
    }

    /// Sectors are on their way from now on; until they come, the line stays.
    #[inline(always)]
    pub fn fetch(&mut self, place: CacheSlot, sectors: u8) {
        self.states[place.0 as usize].fetching |= sectors;
    }

    /// Sectors have come.
    #[inline(always)]
    pub fn fill(&mut self, place: CacheSlot, sectors: u8) {
        let state = &mut self.states[place.0 as usize];
        state.fetching &= !sectors;
        state.valid |= sectors;
    }

    /// Sectors are written: those `whole` are valid by that, and all of `sectors` must be written back.
    #[inline(always)]
    pub fn write(&mut self, place: CacheSlot, sectors: u8, whole: u8) {
        let state = &mut self.states[place.0 as usize];
        state.valid |= whole;
        state.dirty |= sectors;
    }

    /// A lookup of a cache that is always filled at once and whole: reads a line, or writes all of it. Returns whether it hit, and
    /// the dirty line that had to go. For tags without a time of their own.
    #[inline(always)]
    pub fn access(&mut self, line: u64, write: bool) -> (bool, Option<u64>) {
        let found = self.find(line);
        self.count(found.is_some());
        let mut gone = None;
        let place = match found {
            Some(place) => {
                self.touch(place);
                place
            }
            None => {
                let place = self.victim(line).expect("nothing is on its way");
                gone = self.replace(place, line).and_then(|(old, dirty)| (dirty != 0).then_some(old));
                self.states[place.0 as usize].valid = u8::MAX;
                place
            }
        };
        if write {
            self.states[place.0 as usize].dirty = u8::MAX;
        }
        (found.is_some(), gone)
    }

    /// Calls `write_back` with each line that has dirty sectors, which are clean then.
    pub fn flush(&mut self, mut write_back: impl FnMut(u64, u8)) {
        for (&tag, state) in self.tags.iter().zip(&mut self.states) {
            if tag != EMPTY && state.dirty != 0 {
                write_back(tag, std::mem::take(&mut state.dirty));
            }
        }
    }

    /// Forgets all lines. Nothing may be dirty or on its way that still matters.
    pub fn clear(&mut self) {
        self.tags.fill(EMPTY);
        self.states.fill(State::default());
    }
}
