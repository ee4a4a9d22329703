//! Coverage by its definition, in exact arithmetic: slow, written independently of setup and traversal, for tests only.
//!
//! Positions are in 1/256 pixel, y down. Ties are not cases here: positions are moved by `(e, e^2)` with an e so small that it
//! decides nothing else, and what is left is strict geometry.

/// A position in 1/256 pixel.
pub type Position = [i64; 2];

/// The perturbation's scale: e = 2^-30 of 1/256 pixel, e^2 = 2^-60. An edge function is a whole number below 2^50, and moving
/// the point changes it by less than 2^25 e < 1: no strict inequality is touched.
const TRIANGLE_E: u32 = 30;

/// Whether a triangle, of either winding, covers a sample under the top-left rule.
///
/// The rule says that a sample on a left edge (inside to the right) or a top edge (inside below) is covered: that is, that the
/// sample moved by `(e, e^2)` is strictly inside.
pub fn triangle_covers(v: [Position; 3], sample: Position) -> bool {
    let e = |j: Position, k: Position| {
        let scale = |x: i64| i128::from(x) << (2 * TRIANGLE_E);
        let (sx, sy) = (scale(sample[0]) + (1 << TRIANGLE_E), scale(sample[1]) + 1);
        i128::from(k[0] - j[0]) * (sy - scale(j[1])) - i128::from(k[1] - j[1]) * (sx - scale(j[0]))
    };
    let signs = [e(v[0], v[1]), e(v[1], v[2]), e(v[2], v[0])].map(i128::signum);
    signs[0] != 0 && signs[0] == signs[1] && signs[1] == signs[2]
}

/// Whether a line draws a pixel under the diamond-exit rule, its ends moved by `-(e, e^2)`.
///
/// # Panics
/// In debug, if coordinates are 2^17 or more: the arithmetic would overflow.
pub fn line_draws(from: Position, to: Position, pixel: Position) -> bool {
    // Numbers that decide are whole multiples of 1/2^19 (products of two differences over one), e is below that, and e^2 below
    // e over such a product.
    const E: u32 = 21;
    debug_assert!(from.iter().chain(&to).chain(&pixel).all(|v| v.abs() < 1 << 17));
    let scale = |x: i64| i128::from(x) << (2 * E);
    let moved = |p: Position| [scale(p[0]) - (1 << E), scale(p[1]) - 1];
    let (p, q) = (moved(from), moved(to));
    let center = pixel.map(|v| scale(v * 256 + 128));
    let half = scale(128);
    let mut low: Option<(i128, i128)> = None;
    let mut high: Option<(i128, i128)> = None;
    let mut ends_inside = true;
    for (sx, sy) in [(1, 1), (1, -1), (-1, 1), (-1, -1)] {
        // f > 0 inside this side of the diamond; linear along the segment from f0 to f1.
        let f = |r: [i128; 2]| half - sx * (r[0] - center[0]) - sy * (r[1] - center[1]);
        let (f0, f1) = (f(p), f(q));
        ends_inside &= f1 > 0;
        // The zero lies at t = f0 / (f0 - f1).
        let (num, den) = if f0 > f1 { (f0, f0 - f1) } else { (-f0, f1 - f0) };
        if den == 0 {
            if f0 <= 0 {
                return false;
            }
        } else if f0 > f1 {
            if high.is_none_or(|(n, d)| num * d < n * den) {
                high = Some((num, den));
            }
        } else if low.is_none_or(|(n, d)| num * d > n * den) {
            low = Some((num, den));
        }
    }
    // Some t with low < t < high and 0 <= t <= 1.
    let below_one = low.is_none_or(|(n, d)| n < d);
    let above_zero = high.is_none_or(|(n, _)| n > 0);
    let open = match (low, high) {
        (Some((ln, ld)), Some((hn, hd))) => ln * hd < hn * ld,
        _ => true,
    };
    below_one && above_zero && open && !ends_inside
}

/// Whether the rectangle of width 1 about a line covers a sample: from the start on and before the end, and within half a
/// pixel on either side, the side of negative cross product included.
pub fn wide_line_covers(from: Position, to: Position, sample: Position) -> bool {
    let d = [0, 1].map(|i| i128::from(to[i] - from[i]));
    let s = [0, 1].map(|i| i128::from(sample[i] - from[i]));
    let along = d[0] * s[0] + d[1] * s[1];
    let across = d[0] * s[1] - d[1] * s[0];
    let length2 = d[0] * d[0] + d[1] * d[1];
    let (left, right) = (across * across, 128 * 128 * length2);
    0 <= along && along < length2 && (left < right || (left == right && across < 0))
}

/// Whether the square of side 1 about a point covers a sample.
pub fn wide_point_covers(point: Position, sample: Position) -> bool {
    (0..2).all(|i| sample[i] >= point[i] - 128 && sample[i] < point[i] + 128)
}
