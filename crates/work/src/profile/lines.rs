//! How often and how soon a pass's fragments look the same line up again: what any first-level cache makes of it is computed from that.
//!
//! Lookups of a line by bundles of quads that follow each other are an *episode*. In it the line is asked for by one or several
//! requests of the shader. The bundles that come between two episodes of a line are their *gap*.

use std::collections::HashMap;
use std::hash::{BuildHasherDefault, Hasher};

/// One line in this number of lines is followed.
pub const FOLLOWED: u32 = 4;

/// Bundles that an episode may miss out.
const PAUSE: u32 = 2;

/// Buckets of gaps between episodes: none before, then half octaves of bundles.
pub const GAPS: usize = 40;

/// Buckets of an episode's length, in octaves of bundles; and of its requests: 1, 2, 3 and 4, up to 8, more.
pub const SPANS: [usize; 2] = [8, 5];

/// Gaps of both kinds.
const CLASSES: usize = (2 * GAPS - 1) * GAPS;

/// What is known of the lookups of a pass's fragments, of some lines that stand for all.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct LineProfile {
    /// Lookups, and these by bundle and request: a bundle's request looks a line up once or several times.
    pub lookups: [u64; 2],
    /// Episodes by their gap's class ([`gaps_of`]), and how many, in order.
    pub gaps: Vec<(u16, u32)>,
    /// Episodes by their length and requests (as [`SPANS`]), and how many.
    pub spans: [[u32; SPANS[1]]; SPANS[0]],
}

/// The gaps of a class: bundles since the last episode in the same screen tile, and whether all of them were that tile's, in one run;
/// and bundles since the last episode in any tile. None: there was none before.
pub fn gaps_of(class: u16) -> (Option<(f64, bool)>, Option<f64>) {
    let (tile, any) = (usize::from(class) / GAPS, usize::from(class) % GAPS);
    let tile = match tile {
        0 => None,
        tile if tile < GAPS => Some((gap(tile), false)),
        tile => Some((gap(tile + 1 - GAPS), true)),
    };
    (tile, (any > 0).then(|| gap(any)))
}

/// The middle of a bucket, in bundles.
fn gap(bucket: usize) -> f64 {
    let at = bucket - 1;
    if at == 0 {
        return 1.0;
    }
    (1_u64 << (at / 2)) as f64 * if at.is_multiple_of(2) { 1.2 } else { 1.7 }
}

/// The bucket of a gap: half octaves, the first of 1 bundle.
fn bucket(gap: u32) -> usize {
    let gap = gap.max(1);
    let octave = gap.ilog2();
    let half = octave > 0 && gap >> (octave - 1) & 1 != 0;
    (1 + 2 * octave as usize + usize::from(half)).min(GAPS - 1)
}

/// The length in bundles and the requests of a span's buckets.
pub fn span(length: usize, requests: usize) -> [f64; 2] {
    [(1_u64 << length) as f64 * if length == 0 { 1.0 } else { 1.4 }, [1.0, 2.0, 3.5, 6.0, 9.0][requests]]
}

/// Fibonacci hashing; nothing iterates over the maps.
#[derive(Default)]
pub(super) struct Fibonacci(u64);

impl Hasher for Fibonacci {
    fn finish(&self) -> u64 {
        self.0
    }

    fn write(&mut self, bytes: &[u8]) {
        bytes.iter().for_each(|&byte| self.write_u64(u64::from(byte)));
    }

    fn write_u32(&mut self, n: u32) {
        self.write_u64(u64::from(n));
    }

    fn write_u64(&mut self, n: u64) {
        self.0 = (self.0 ^ n).wrapping_mul(0x9e37_79b9_7f4a_7c15).rotate_left(32);
    }
}

type Map<K, V> = HashMap<K, V, BuildHasherDefault<Fibonacci>>;

/// A line's episode.
#[derive(Clone, Copy, Debug)]
struct Episode {
    first: u32,
    last: u32,
    /// The visit of a tile that it belongs to.
    visit: u32,
    /// The last request of it, and all.
    request: u8,
    requests: u64,
    /// It counts, or is only followed for larger caches.
    counted: bool,
}

/// Collects what is known of lines.
#[derive(Debug, Default)]
pub(super) struct Lines {
    profile: LineProfile,
    gaps: Vec<u32>,
    /// Each line's youngest episode, and its place.
    episodes: Vec<Episode>,
    places: Map<u32, u32>,
    /// When each tile has last begun to look a line up, and in which visit.
    tiles: Map<u64, (u32, u32)>,
}

/// Where a lookup is made.
#[derive(Clone, Copy, Debug)]
pub(super) struct LookupPosition {
    /// Bundles of the pass before.
    pub bundle: u32,
    /// The tile, and the visit of it: a run of quads without any of other tiles.
    pub tile: u32,
    pub visit: u32,
    /// The how-many-th request of its shader.
    pub request: u8,
}

impl Lines {
    /// Whether a line stands for others.
    #[inline(always)]
    pub fn follows(line: u32) -> bool {
        line.wrapping_mul(0x9e37_79b9) < u32::MAX / FOLLOWED
    }

    /// Takes a lookup, which counts where the line stands for others; the class of the episode that it begins.
    #[inline(always)]
    pub fn look_up(&mut self, line: u32, place: LookupPosition, counted: bool) -> Option<u16> {
        self.profile.lookups[0] += u64::from(counted);
        let known = self.places.get(&line).copied();
        if let Some(at) = known {
            let open = &mut self.episodes[at as usize];
            if open.visit == place.visit && place.bundle - open.last <= PAUSE {
                let same = open.last == place.bundle && open.request == place.request;
                self.profile.lookups[1] += u64::from(counted && !same);
                (open.last, open.request) = (place.bundle, place.request);
                open.requests |= 1 << place.request.min(63);
                return None;
            }
        }
        Some(self.begin(line, known, place, counted))
    }

    #[inline(never)]
    fn begin(&mut self, line: u32, known: Option<u32>, place: LookupPosition, counted: bool) -> u16 {
        let LookupPosition { bundle, tile, visit, request } = place;
        let new = Episode { first: bundle, last: bundle, visit, request, requests: 1 << request.min(63), counted };
        let before = match known {
            Some(at) => Some(std::mem::replace(&mut self.episodes[at as usize], new)),
            None => {
                self.places.insert(line, self.episodes.len() as u32);
                self.episodes.push(new);
                None
            }
        };
        let any = before.map_or(0, |before| bucket(bundle - before.last));
        // Of the tile's own last episode the end is known if it was the line's youngest, else its beginning.
        let own = self.tiles.insert(u64::from(line) << 32 | u64::from(tile), (bundle, visit));
        let own = own.map_or(0, |(begun, run)| {
            let last = before.filter(|before| before.visit == run).map_or(begun, |before| before.last);
            bucket(bundle - last) + if run == visit { GAPS - 1 } else { 0 }
        });
        let class = own * GAPS + any;
        if counted {
            self.profile.lookups[1] += 1;
            if self.gaps.is_empty() {
                self.gaps = vec![0; CLASSES];
            }
            self.gaps[class] += 1;
        }
        if let Some(before) = &before {
            self.close(before);
        }
        class as u16
    }

    fn close(&mut self, episode: &Episode) {
        let length = ((episode.last - episode.first + 1).ilog2() as usize).min(SPANS[0] - 1);
        let requests = match episode.requests.count_ones() {
            0 | 1 => 0,
            2 => 1,
            3 | 4 => 2,
            5..=8 => 3,
            _ => 4,
        };
        self.profile.spans[length][requests] += u32::from(episode.counted);
    }

    /// What is known of the pass.
    pub fn end(mut self) -> LineProfile {
        for episode in std::mem::take(&mut self.episodes) {
            self.close(&episode);
        }
        let counted = self.gaps.iter().zip(0..).filter(|(count, _)| **count > 0);
        LineProfile { gaps: counted.map(|(&count, class)| (class, count)).collect(), ..self.profile }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn buckets_hold_what_is_in_their_middle() {
        // There is nothing between 1 and 2.
        for at in (1..GAPS - 1).filter(|&at| at != 2) {
            assert_eq!(bucket(gap(at).round() as u32), at, "{at}: {}", gap(at));
        }
        assert_eq!((bucket(0), bucket(1), bucket(2), bucket(3), bucket(4), bucket(u32::MAX)), (1, 1, 3, 4, 5, GAPS - 1));
    }

    #[test]
    fn a_line_that_is_looked_up_again_later_begins_an_episode() {
        let mut lines = Lines::default();
        let place = |bundle, tile, visit, request| LookupPosition { bundle, tile, visit, request };
        // Four bundles in a row by two requests, then another tile, then the first tile again.
        for bundle in 0..4 {
            for request in 0..2 {
                let class = lines.look_up(7, place(bundle, 1, 1, request), true);
                assert_eq!(class.is_some(), bundle == 0 && request == 0);
                lines.look_up(7, place(bundle, 1, 1, request), true);
            }
        }
        let other = lines.look_up(7, place(11, 2, 2, 0), true).expect("another tile");
        assert_eq!(gaps_of(other), (None, Some(gap(bucket(8)))));
        let again = lines.look_up(7, place(43, 1, 3, 0), true).expect("another visit");
        // That it ended in bundle 3 is not known any more.
        assert_eq!(gaps_of(again), (Some((gap(bucket(43)), false)), Some(gap(bucket(32)))));
        let soon = lines.look_up(7, place(59, 1, 3, 0), true).expect("after a pause");
        assert_eq!(gaps_of(soon), (Some((gap(bucket(16)), true)), Some(gap(bucket(16)))));
        let profile = lines.end();
        assert_eq!(profile.lookups, [19, 11]);
        assert_eq!(profile.gaps.iter().map(|gap| gap.1).sum::<u32>(), 4);
        assert_eq!((profile.spans[2][1], profile.spans[0][0]), (1, 3));
    }
}
