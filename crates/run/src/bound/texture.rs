//! The misses of first-level texture caches, with the warps under way that share them.
//!
//! A core has warps under way at all steps of their program at once. In its own time, counted in requests of bundles of quads, bundle
//! `i` asks for its request `s` at `i K + s W`: `K` requests a bundle, `W` bundles at once. Two lookups of a line by one quad's
//! neighbouring requests lie `W` apart, not 1. From the times between lookups of the same line follows how many other lines come in a
//! time (average eviction time: Hu et al., Kinetic Modeling of Data Eviction in Cache, 2016), and from that how likely they push a
//! line out of its set (Smith, A Comparative Study of Set Associative Memory Mapping Algorithms, 1978).

use work::profile::{LineProfile, SPANS, gaps_of, span};

/// Buckets of times an octave, and octaves.
const FINE: usize = 4;
const OCTAVES: usize = 24;

/// How a pass's warps share caches.
#[derive(Clone, Copy, Debug)]
pub(super) struct Sharing {
    /// Requests of a bundle.
    pub requests: f64,
    /// Bundles under way in a core.
    pub resident: f64,
    /// Pipelines that tiles belong to.
    pub pipelines: f64,
    /// Sets of a core's cache, and their ways.
    pub sets: f64,
    pub ways: u32,
    /// Bundles of the pass.
    pub bundles: f64,
    /// Lines in all for each that is followed.
    pub followed: f64,
}

/// The misses of first-level caches.
#[derive(Clone, Debug, Default)]
pub(super) struct Missed {
    /// The probability that the first lookup of an episode misses, by the episode's class. For classes beyond the list it is 1.
    classes: Vec<f64>,
    /// Misses per lookup.
    pub rate: f64,
    /// Misses per request of a bundle.
    pub bundle: f64,
    /// All misses inside of episodes. The second-level cache has their lines.
    pub inner: f64,
}

impl Missed {
    /// How likely the lookup is missed that begins an episode of a class.
    pub fn class(&self, class: u16) -> f64 {
        self.classes.get(usize::from(class)).copied().unwrap_or(1.0)
    }
}

/// The bucket of a time: quarters of octaves, linear in each; the last has all beyond.
fn bucket(time: f64) -> usize {
    const MANTISSA: u32 = f64::MANTISSA_DIGITS - 1 - FINE.trailing_zeros();
    let at = (time.max(1.0).to_bits() >> MANTISSA) - (1.0_f64.to_bits() >> MANTISSA);
    (at as usize).min(FINE * OCTAVES)
}

/// Where a bucket begins.
fn begin(bucket: usize) -> f64 {
    (1_u64 << (bucket / FINE)) as f64 * (1.0 + (bucket % FINE) as f64 / FINE as f64)
}

/// How likely as many of the lines that have come, `load` a set on average, are in one set as it has ways.
fn pushed_out(load: f64, ways: u32) -> f64 {
    // Far from the middle there is nothing to sum up.
    let ways_f = f64::from(ways);
    let spread = 6.0 * load.sqrt() + 6.0;
    if (load - ways_f).abs() > spread || load > 600.0 {
        return f64::from(u8::from(load > ways_f));
    }
    let (mut term, mut below) = (libm::exp(-load), 0.0);
    for k in 0..ways {
        below += term;
        term *= load / f64::from(k + 1);
    }
    (1.0 - below).clamp(0.0, 1.0)
}

/// The misses of a pass's fragments.
pub(super) fn missed(lines: &LineProfile, sharing: &Sharing) -> Missed {
    let touched = lines.lookups[1] as f64;
    if touched == 0.0 || sharing.bundles <= 0.0 {
        return Missed::default();
    }
    // 1. Times since the last lookup by the same core, in lookups of lines by bundles.
    let Sharing { requests, resident, pipelines, .. } = *sharing;
    let dense = touched * sharing.followed / (sharing.bundles * requests.max(1.0));
    let neighbours = requests.max(1.0);
    let episodes = lines.spans.iter().flatten().map(|&n| f64::from(n)).sum::<f64>().max(1.0);
    let spans = || {
        let cells = (0..SPANS[0]).flat_map(|length| (0..SPANS[1]).map(move |requests| (length, requests)));
        cells.map(|(length, requests)| (span(length, requests), f64::from(lines.spans[length][requests])))
    };
    let reach = spans().map(|([_, requests], n)| (requests - 1.0) * n).sum::<f64>() / episodes;
    let between = |gap: Option<(f64, bool)>| {
        let (gap, run) = gap?;
        let own = if run { gap } else { gap / pipelines };
        Some(bucket((own * requests - reach * resident).max(neighbours) * dense))
    };
    // Two tiles belong to the same pipeline with this probability.
    let shared = 1.0 / pipelines;
    let of_class = |class: u16| {
        let (tile, any) = gaps_of(class);
        let run = tile.is_some_and(|tile| tile.1);
        [between(any.map(|gap| (gap, run))), between(tile)]
    };
    let mut counts = [0.0; FINE * OCTAVES + 1];
    let mut left_over = touched;
    for &(class, n) in &lines.gaps {
        for (place, part) in of_class(class).into_iter().zip([shared, 1.0 - shared]) {
            counts[place.unwrap_or(FINE * OCTAVES)] += f64::from(n) * part;
        }
        left_over -= f64::from(n);
    }
    let inner = |length: f64| bucket((resident - length * requests).max(neighbours) * dense);
    for ([length, requests], n) in spans() {
        counts[inner(length)] += (requests - 1.0) * n;
        left_over -= (requests - 1.0) * n;
    }
    // All others are looked up again by the next bundle.
    counts[bucket(neighbours * dense)] += left_over.max(0.0);

    // 2. How many other lines have come in a time, and whether they push a line out: at a bucket's end.
    let mut out = [1.0; FINE * OCTAVES + 1];
    let (mut left, mut held, mut from) = (counts.iter().sum::<f64>(), 0.0, 0.0);
    let all = left;
    for (at, out) in out[..FINE * OCTAVES].iter_mut().enumerate() {
        let to = begin(at + 1);
        held += (to - from) * (left - 0.5 * counts[at]) / all;
        *out = pushed_out(held / sharing.sets, sharing.ways);
        if *out >= 1.0 {
            break;
        }
        (left, from) = (left - counts[at], to);
    }

    // 3. Misses.
    let classes = lines.gaps.last().map_or(0, |last| usize::from(last.0) + 1);
    let mut missed = Missed { classes: vec![1.0; classes], ..Missed::default() };
    let mut count = 0.0;
    for &(class, n) in &lines.gaps {
        let [any, tile] = of_class(class).map(|place| place.map_or(1.0, |place| out[place]));
        let likely = shared * any + (1.0 - shared) * tile;
        missed.classes[usize::from(class)] = likely;
        count += likely * f64::from(n);
    }
    let inside: f64 = spans().map(|([length, requests], n)| (requests - 1.0) * n * out[inner(length)]).sum();
    count += inside;
    missed.inner = inside * sharing.followed;
    missed.rate = (count / lines.lookups[0] as f64).min(1.0);
    missed.bundle = count * sharing.followed / (sharing.bundles * requests.max(1.0));
    missed
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_set_is_full_when_more_have_come_than_it_has_ways() {
        assert!(pushed_out(2.0, 16) < 1e-6 && pushed_out(60.0, 16) > 0.999);
        assert_eq!((pushed_out(1000.0, 4096), pushed_out(5000.0, 4096)), (0.0, 1.0));
        // Poisson's, at its mean.
        assert!((pushed_out(16.0, 16) - 0.5).abs() < 0.05);
        assert!((pushed_out(1.0, 1) - (1.0 - libm::exp(-1.0))).abs() < 1e-12);
    }

    #[test]
    fn buckets_are_quarters_of_octaves() {
        assert!((0..FINE * OCTAVES).all(|at| bucket(begin(at)) == at && bucket(begin(at + 1) * 0.999_999) == at));
        assert_eq!((bucket(0.0), bucket(f64::INFINITY)), (0, FINE * OCTAVES));
    }
}
