//! The second-level cache in miniature: as much smaller as what is followed of a frame is less than the whole (`work::profile`).

use machine::Config;
use machine::config::MemoryKind;
use work::LINE;
use work::profile::Sampled;

/// The traffic that accesses cause in the second-level cache and in DRAM, scaled to all of memory.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Traffic {
    /// Lookups of the second-level cache.
    pub lookups: f64,
    /// Lookups that miss the second-level cache.
    pub misses: f64,
    /// Bytes read from DRAM.
    pub read: f64,
    /// Bytes written to DRAM.
    pub written: f64,
}

impl std::ops::AddAssign for Traffic {
    fn add_assign(&mut self, other: Traffic) {
        self.lookups += other.lookups;
        self.misses += other.misses;
        self.read += other.read;
        self.written += other.written;
    }
}

impl Traffic {
    /// This traffic, multiplied by `n`.
    pub(super) fn times(&self, n: f64) -> Traffic {
        Traffic { lookups: n * self.lookups, misses: n * self.misses, read: n * self.read, written: n * self.written }
    }

    /// The traffic that is left without `part`.
    pub(super) fn without(&self, part: &Traffic) -> Traffic {
        Traffic {
            lookups: self.lookups - part.lookups,
            misses: self.misses - part.misses,
            read: self.read - part.read,
            written: self.written - part.written,
        }
    }

    /// The part of the lookups that miss.
    pub fn miss_rate(&self) -> f64 {
        if self.lookups > 0.0 { self.misses / self.lookups } else { 0.0 }
    }
}

/// A place in a set: which sectors of its line are there, and which are newer than in DRAM.
#[derive(Clone, Copy, Debug, Default)]
struct Sectors {
    valid: u8,
    dirty: u8,
}

/// How many times as many ways sets have as those of the whole. These are found by addresses, so that what lies together fills them evenly. A hash
/// fills few large sets more evenly than many small ones.
const WIDER: usize = 8;

/// No line.
const EMPTY: u64 = u64::MAX;

/// The second-level cache: fewer and wider sets than the whole; least recently used; in sectors of [`LINE`].
pub(super) struct Shared {
    /// One group in 2 to this power is followed.
    shift: u8,
    /// Bytes of a line, as a power of two.
    line: u32,
    /// Lines of the whole cache, and ways of a set at most.
    all: usize,
    most: usize,
    /// Ways of a set.
    ways: usize,
    /// There is none: all goes to memory.
    ideal: bool,
    /// The lines, set after set.
    lines: Vec<u64>,
    /// The time of each line's last use; 0 where there is no line.
    used: Vec<u32>,
    /// The sectors of each line.
    sectors: Vec<Sectors>,
    clock: u32,
}

impl Shared {
    pub fn new(config: &Config) -> Shared {
        let l2 = &config.l2;
        let mut shared = Shared {
            shift: 0,
            line: l2.line_bytes.trailing_zeros(),
            all: l2.slices as usize * l2.lines as usize,
            most: WIDER * l2.ways as usize,
            ways: 0,
            ideal: config.memory.kind == MemoryKind::Ideal,
            lines: Vec::new(),
            used: Vec::new(),
            sectors: Vec::new(),
            clock: 0,
        };
        shared.clear();
        shared
    }

    /// Empties the cache, and gives it the number of lines that corresponds to the followed part of memory.
    fn clear(&mut self) {
        let part = (self.all >> self.shift.min(63)).max(1);
        self.ways = self.most.min(part);
        let places = part / self.ways * self.ways;
        self.lines = vec![EMPTY; places];
        self.used = vec![0; places];
        self.sectors = vec![Sectors::default(); places];
    }

    /// What is accessed from now on is one part of 2 to this power; what is not followed any more leaves.
    pub fn follow(&mut self, shift: u8) {
        if shift <= self.shift {
            return;
        }
        let (line, shift) = (self.line, shift.min(63));
        self.shift = shift;
        let old = self.lines.iter().zip(&self.used).zip(&self.sectors);
        let followed = |own: u64| own != EMPTY && Sampled::follows(((own << line) / LINE) as u32, shift);
        let mut old: Vec<(u32, u64, Sectors)> =
            old.filter(|((own, _), _)| followed(**own)).map(|((own, used), sectors)| (*used, *own, *sectors)).collect();
        old.sort_unstable_by_key(|slot| slot.0);
        self.clear();
        for (used, own, sectors) in old {
            let place = self.find(own).unwrap_or_else(|set| self.oldest(set));
            (self.lines[place], self.used[place], self.sectors[place]) = (own, used, sectors);
        }
    }

    /// Whether a line is followed.
    #[inline(always)]
    pub fn follows(&self, line: u32, shift: u8) -> bool {
        shift == self.shift || Sampled::follows(line, self.shift)
    }

    /// Whether a line that is in no profile is followed.
    pub fn follows_any(&self, line: u32) -> bool {
        Sampled::follows(line, self.shift)
    }

    /// The place of a line, or the first place of its set if it is not here.
    #[inline(always)]
    fn find(&self, line: u64) -> Result<usize, usize> {
        let sets = self.lines.len() / self.ways;
        // Lines that are followed lie evenly: sets are given by a hash that leaves nothing of that (the end of MurmurHash3).
        let hash = (line ^ line >> 33).wrapping_mul(0xff51_afd7_ed55_8ccd);
        let hash = (hash ^ hash >> 33).wrapping_mul(0xc4ce_b9fe_1a85_ec53) >> 32;
        let set = (hash * sets as u64 >> 32) as usize * self.ways;
        self.lines[set..set + self.ways].iter().position(|own| *own == line).map(|way| set + way).ok_or(set)
    }

    /// The place in a set that was not used for longest, or never.
    fn oldest(&self, set: usize) -> usize {
        let used = &self.used[set..set + self.ways];
        let least = used.iter().copied().fold(u32::MAX, u32::min);
        set + used.iter().position(|used| *used == least).unwrap_or(0)
    }

    /// Reads `bytes` bytes from the beginning of a line of [`LINE`] bytes on, or writes them whole.
    pub fn access(&mut self, line: impl Into<u64>, bytes: u64, write: bool) -> Traffic {
        let scale = (1_u64 << self.shift.min(63)) as f64;
        let begin = line.into() * LINE;
        let end = begin + bytes.max(1);
        let mut traffic = Traffic::default();
        let mut at = begin;
        while at < end {
            let own = at >> self.line;
            let next = end.min((own + 1) << self.line);
            // Lines of less than a sector are whole ones.
            let sector = |at: u64| (at - (own << self.line)) / LINE;
            let mask = ((1_u32 << (sector(next - 1) + 1)) - (1 << sector(at))) as u8;
            traffic.lookups += scale;
            self.line(own, mask, write, scale, &mut traffic);
            at = next;
        }
        traffic
    }

    fn line(&mut self, line: u64, mask: u8, write: bool, scale: f64, traffic: &mut Traffic) {
        let bytes = |mask: u8| f64::from(mask.count_ones()) * (LINE.min(1 << self.line)) as f64 * scale;
        if self.ideal {
            *(if write { &mut traffic.written } else { &mut traffic.read }) += bytes(mask);
            return;
        }
        let place = match self.find(line) {
            Ok(place) => place,
            Err(set) => {
                let place = self.oldest(set);
                traffic.written += bytes(self.sectors[place].dirty);
                // A read finds below that all its sectors are missing.
                traffic.misses += if write { scale } else { 0.0 };
                (self.lines[place], self.sectors[place]) = (line, Sectors::default());
                place
            }
        };
        let Sectors { valid, dirty } = self.sectors[place];
        let missing = mask & !valid;
        if !write && missing != 0 {
            traffic.misses += scale;
            traffic.read += bytes(missing);
        }
        self.clock += 1;
        self.used[place] = self.clock;
        self.sectors[place] = Sectors { valid: valid | mask, dirty: dirty | if write { mask } else { 0 } };
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn shared(lines: u32, ways: u32) -> Shared {
        let mut config = Config::built_in("four-pipelines").expect("it is built in");
        (config.l2.slices, config.l2.lines, config.l2.ways) = (1, lines, ways);
        Shared::new(&config)
    }

    #[test]
    fn the_least_recently_used_leaves_and_is_written_if_dirty() {
        let mut l2 = shared(4, 4);
        // Two groups of two lines fill it; the first is written.
        assert_eq!(l2.access(0_u32, 256, true), Traffic { lookups: 2.0, misses: 2.0, ..Traffic::default() });
        assert_eq!(l2.access(4_u32, 256, false).read, 256.0);
        assert_eq!(l2.access(0_u32, 64, false), Traffic { lookups: 1.0, ..Traffic::default() });
        // The second line of the first group is the oldest.
        assert_eq!(l2.access(8_u32, 128, false), Traffic { lookups: 1.0, misses: 1.0, read: 128.0, written: 128.0 });
        assert_eq!(l2.access(0_u32, 64, false).misses, 0.0);
    }

    #[test]
    fn a_part_of_a_line_is_some_of_its_sectors() {
        let mut l2 = shared(64, 16);
        assert_eq!(l2.access(5_u32, 64, false).read, 64.0);
        assert_eq!(l2.access(4_u32, 64, false), Traffic { lookups: 1.0, misses: 1.0, read: 64.0, written: 0.0 });
        assert_eq!(l2.access(4_u32, 128, false).misses, 0.0);
        assert_eq!(l2.access(4_u32, 1024, false).misses, 7.0);
    }

    #[test]
    fn following_less_keeps_what_is_followed() {
        let mut l2 = shared(1 << 16, 16);
        for group in 0..1024_u32 {
            l2.access(group * 4, 256, true);
        }
        l2.follow(3);
        let left: Vec<u32> = (0..1024).filter(|group| Sampled::follows(group * 4, 3)).collect();
        assert!(left.len().abs_diff(128) < 16);
        for group in left {
            assert_eq!(l2.access(group * 4, 256, false), Traffic { lookups: 16.0, ..Traffic::default() });
        }
    }
}
