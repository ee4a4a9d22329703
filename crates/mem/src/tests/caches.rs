//! Tags alone.

use crate::{Cache, CacheShape, CacheSlot, Misses};

fn fully_associative(lines: u32) -> Cache {
    Cache::new(CacheShape::new(lines, lines, 64, 64).unwrap())
}

#[test]
fn geometry_is_checked() {
    assert!(CacheShape::new(96, 3, 64, 32).is_ok());
    assert!(CacheShape::new(96, 4, 64, 32).is_err());
    assert!(CacheShape::new(64, 4, 48, 16).is_err());
    assert!(CacheShape::new(64, 4, 256, 16).is_err());
    assert!(CacheShape::new(64, 0, 64, 32).is_err());
    assert!(CacheShape::new(0, 1, 64, 32).is_err());
}

#[test]
fn sectors_touched_and_covered() {
    let cache = Cache::new(CacheShape::new(4, 4, 128, 32).unwrap());
    assert_eq!(cache.sectors(0, 128), 0b1111);
    assert_eq!(cache.sectors(31, 2), 0b0011);
    assert_eq!(cache.sectors(96, 1), 0b1000);
    assert_eq!(cache.covered(0, 128), 0b1111);
    assert_eq!(cache.covered(31, 33), 0b0010);
    assert_eq!(cache.covered(1, 62), 0);
    assert_eq!(cache.covered(40, 8), 0);
}

#[test]
fn the_least_recently_used_goes_and_dirty_lines_are_handed_out() {
    let mut cache = fully_associative(2);
    assert_eq!(cache.access(1, true), (false, None));
    assert_eq!(cache.access(2, false), (false, None));
    assert_eq!(cache.access(1, false), (true, None));
    assert_eq!(cache.access(3, false), (false, None), "2 goes, clean");
    assert_eq!(cache.access(4, false), (false, Some(1)), "1 goes, dirty");
    assert_eq!(cache.access(3, true), (true, None));
    let counts = cache.counts();
    assert_eq!((counts.accesses, counts.hits, counts.misses, counts.evictions), (6, 2, 4, 2));
    let mut flushed = Vec::new();
    cache.flush(|line, _| flushed.push(line));
    assert_eq!(flushed, [3]);
    cache.flush(|line, _| panic!("{line} is clean"));
    assert_eq!(cache.access(3, false), (true, None), "a flush keeps lines");
    cache.clear();
    assert_eq!(cache.access(3, false), (false, None));
}

#[test]
fn a_line_on_its_way_stays() {
    let mut cache = fully_associative(2);
    for line in [1, 2] {
        let place = cache.victim(line).unwrap();
        cache.replace(place, line);
        cache.fetch(place, 1);
    }
    assert_eq!(cache.victim(3), None);
    let two = cache.find(2).unwrap();
    cache.fill(two, 1);
    assert_eq!(cache.victim(3), Some(two));
}

/// Waiters are served in the order of their coming, each when all it needs is there.
#[test]
fn misses_are_merged_and_served() {
    let mut misses = Misses::new(8, 1, 4);
    assert!(misses.has_register() && misses.has_waiter());
    misses.open();
    assert!(!misses.has_register());
    for (who, needs) in [(10, 0b01), (11, 0b11), (12, 0b01), (13, 0b10)] {
        misses.wait(CacheSlot(5), who, needs);
    }
    assert!(!misses.has_waiter());
    let mut served = Vec::new();
    misses.serve(CacheSlot(5), 0b01, |who| served.push(who));
    assert_eq!(served, [10, 12]);
    assert!(misses.has_waiter());
    misses.wait(CacheSlot(5), 14, 0b10);
    misses.serve(CacheSlot(5), 0b11, |who| served.push(who));
    assert_eq!(served, [10, 12, 11, 13, 14]);
    misses.close(CacheSlot(5));
    assert!(misses.is_empty());
}

/// Bilinear, 1:1, scan-line order, blocks of b x b texels, texture as wide as the screen with one texel of border to the right and
/// below: each fragment reads texels (x, y) to (x + 1, y + 1).
fn misses_per_fragment(width: u64, height: u64, block: [u64; 2], lines: u32, down: bool) -> (u64, u64) {
    let mut cache = fully_associative(lines);
    let pitch = width / block[0] + 1;
    let (outer, inner) = if down { (width, height) } else { (height, width) };
    for o in 0..outer {
        for i in 0..inner {
            let (x, y) = if down { (o, i) } else { (i, o) };
            let mut last = u64::MAX;
            for (dx, dy) in [(0, 0), (1, 0), (0, 1), (1, 1)] {
                let line = (y + dy) / block[1] * pitch + (x + dx) / block[0];
                if line != last {
                    cache.access(line, false);
                }
                last = line;
            }
        }
    }
    (cache.counts().misses, width * height)
}

/// texture-lru: capacity <= W/b lines: (W/b + 1)(1 + 1/b)/W misses per fragment; capacity >= 2 W/b + 1: (W/b + 1)(H/b + 1)/(WH).
#[test]
fn a_texture_cache_misses_as_the_closed_form_says() {
    let (w, b) = (512u64, 4u64);
    let per_row = w / b + 1;
    for lines in [16, 64, 128] {
        // Every row of texel rows touched: each block row is fetched again in each of its b rows, and once more as the row below.
        let (misses, fragments) = misses_per_fragment(w, 64, [b, b], lines, false);
        let expected = per_row * 64 * (b + 1) / b;
        assert_eq!(misses, expected, "{lines} lines");
        let rate = misses as f64 / fragments as f64;
        assert!((rate - 0.3149).abs() < 1e-4, "{rate}");
    }
    let (misses, fragments) = misses_per_fragment(w, 512, [b, b], 257, false);
    assert_eq!(misses, per_row * (512 / b + 1));
    assert!((misses as f64 / fragments as f64 - 0.0635).abs() < 1e-4);
    assert!(misses_per_fragment(w, 512, [b, b], 256, false).0 > misses, "257 lines is the knee");
}

/// orientation: a blocked layout misses alike along and across; 16 x 1 lines miss 1/16 along and 1 + 1/16 across below W lines.
#[test]
fn blocks_do_not_care_for_the_direction_and_rows_do() {
    let square = |down| misses_per_fragment(256, 256, [4, 4], 32, down).0;
    assert_eq!(square(false), square(true));
    let (along, fragments) = misses_per_fragment(512, 512, [16, 1], 128, false);
    // Each texel row is read twice, as the upper and as the lower of a footprint: once from the cache when it holds a row.
    assert_eq!(along, (512 / 16 + 1) * 513);
    assert!((along as f64 / fragments as f64 - 1.0 / 16.0).abs() < 0.003);
    let (across, fragments) = misses_per_fragment(512, 512, [16, 1], 64, true);
    let rate = across as f64 / fragments as f64;
    assert!((rate - (1.0 + 1.0 / 16.0)).abs() < 0.005, "{rate}");
}
