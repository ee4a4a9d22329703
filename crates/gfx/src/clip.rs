//! Homogeneous clipping of triangles and lines, with a guard band in x and y.
//!
//! Clip space is WebGPU's: visible is `-w <= x <= w`, `-w <= y <= w`, `0 <= z <= w`, `w > 0`. Outcodes settle almost all
//! primitives: outside one plane as a whole, rejected; inside everything that must be clipped, untouched. In x and y only
//! what leaves the guard band ([`GUARD_PIXELS`]) is cut; the rest is left to the scissor, as on real cards. The cut itself
//! runs in f64 and is symmetric in the direction of an edge, so that neighbours cut at the same point.
//!
//! Positions are homogeneous: multiplied by a power of two, all positions of a primitive give the same picture, bit for bit, as long
//! as they and their `w` stay normal numbers. A `w` below the least normal number counts as 0, as WGSL allows, and is not visible.

use num::{LANES, Lanes};

use super::state::Viewport;

/// Half-width of the guard band in pixels: window coordinates inside it fit 16.8 fixed point with a pixel to spare.
pub const GUARD_PIXELS: f32 = 32767.0;

/// The least `w` that cutting leaves, so that no vertex comes so near to the eye that its reciprocal exceeds that of the others beyond all
/// bounds. A primitive all of whose `w` are below [`W_SMALL`] is cut in a scale of its own ([`scale`]), where this holds likewise.
pub const W_MIN: f32 = 1.0 / (1u128 << 64) as f32;

/// The greatest `w` of a primitive below which it is cut in a scale of its own.
const W_SMALL: f32 = 1.0 / (1u64 << 32) as f32;

/// Vertices of a clipped triangle at most: each of the seven planes adds one, and so does each of eight clip distances.
pub const MAX_VERTICES: usize = 18;

/// Which planes a vertex is outside of: a set of `Outcode` bits.
pub type Outcode = u16;

/// x < -w.
pub const LEFT: Outcode = 1;
/// x > w.
pub const RIGHT: Outcode = 1 << 1;
/// y < -w.
pub const BOTTOM: Outcode = 1 << 2;
/// y > w.
pub const TOP: Outcode = 1 << 3;
/// z < 0, where depth is clipped.
pub const NEAR: Outcode = 1 << 4;
/// z > w, where depth is clipped.
pub const FAR: Outcode = 1 << 5;
/// w is not positive, or no normal number.
pub const BEHIND: Outcode = 1 << 6;
/// Beyond the left end of the guard band.
pub const GUARD_LEFT: Outcode = 1 << 7;
/// Beyond the right end of the guard band.
pub const GUARD_RIGHT: Outcode = 1 << 8;
/// Beyond the end of the guard band at negative y of clip space.
pub const GUARD_BOTTOM: Outcode = 1 << 9;
/// Beyond the end of the guard band at positive y of clip space.
pub const GUARD_TOP: Outcode = 1 << 10;
/// A component is NaN or infinite.
pub const NOT_FINITE: Outcode = 1 << 11;
/// w < [`W_MIN`]: behind the eye or very near to it, unless the primitive is small in all.
pub const EYE: Outcode = 1 << 12;

/// Planes of which all vertices being outside rejects a primitive.
const REJECT: Outcode = LEFT | RIGHT | BOTTOM | TOP | NEAR | FAR | BEHIND;

/// Planes of which any vertex being outside makes clipping necessary.
const CLIP: Outcode = NEAR | FAR | EYE | GUARD_LEFT | GUARD_RIGHT | GUARD_BOTTOM | GUARD_TOP;

/// The planes in the order in which they cut. That of the eye first: afterwards w > 0, and the others mean what they say.
const PLANES: [Outcode; 7] = [EYE, NEAR, FAR, GUARD_LEFT, GUARD_RIGHT, GUARD_BOTTOM, GUARD_TOP];

/// A vertex of a clipped primitive.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ClipVertex {
    /// Position in clip space, times `unit`; finite, `w >= W_MIN`, inside the guard band.
    pub position: [f32; 4],
    /// A power of two, by which the position was multiplied: 1 but for primitives whose `w` are all very small.
    pub unit: f32,
    /// Weights of the original vertices: attributes of this vertex are that linear combination ([`ClipVertex::combine`]).
    /// They add up to 1 within rounding; a line uses the first two.
    pub weights: [f32; 3],
}

impl ClipVertex {
    const ZERO: ClipVertex = ClipVertex { position: [0.0; 4], unit: 1.0, weights: [0.0; 3] };

    /// The attribute here, from those of the original vertices; a constant attribute stays exactly what it is.
    #[inline]
    pub fn combine(&self, original: [f32; 3]) -> f32 {
        let [a, b, c] = original;
        let [wa, wb, wc] = self.weights;
        // An original vertex keeps its value bit for bit, whatever the others are.
        if wa == 1.0 {
            a
        } else if wb == 1.0 {
            b
        } else if wc == 1.0 {
            c
        } else {
            a + (wb * (b - a) + wc * (c - a))
        }
    }
}

/// The outcome of clipping: a convex polygon to be drawn as a fan about its first vertex, or a line of two vertices.
#[derive(Clone, Copy, Debug)]
pub struct Polygon {
    vertices: [ClipVertex; MAX_VERTICES],
    len: usize,
}

impl Polygon {
    /// One without vertices.
    pub const EMPTY: Polygon = Polygon { vertices: [ClipVertex::ZERO; MAX_VERTICES], len: 0 };

    /// Makes it an uncut line or triangle.
    pub fn set(&mut self, position: &[[f32; 4]]) {
        self.len = position.len();
        let unit = scale(position);
        for (i, (vertex, &position)) in self.vertices.iter_mut().zip(position).enumerate() {
            let weights = std::array::from_fn(|k| if k == i { 1.0 } else { 0.0 });
            *vertex = ClipVertex { position: narrow(position.map(|v| f64::from(v) * unit)), unit: unit as f32, weights };
        }
    }

    /// Cuts away what has a negative (or no) distance to a further plane, where `original` are the distances of the original
    /// vertices; `closed` says that it is a triangle. Returns whether anything is left.
    pub fn cut(&mut self, original: [f32; 3], closed: bool) -> bool {
        let old = *self;
        let n = old.len;
        let edges = if closed { n } else { n - 1 };
        let distance = |v: &ClipVertex| {
            // 0 times an infinite distance of a vertex that has no part in this one is 0.
            let part = |i: usize| if v.weights[i] == 0.0 { 0.0 } else { f64::from(v.weights[i]) * f64::from(original[i]) };
            part(0) + part(1) + part(2)
        };
        self.len = 0;
        for i in 0..n {
            let a = old.vertices[i];
            let da = distance(&a);
            if da >= 0.0 {
                self.push(a);
            }
            if i >= edges {
                continue;
            }
            let b = old.vertices[(i + 1) % n];
            let db = distance(&b);
            if (da >= 0.0) != (db >= 0.0) {
                // From the inside to the outside, as everywhere. An outside that is infinitely far or NaN leaves the inside's end.
                let (from, to, df, dt) = if da >= 0.0 { (a, b, da, db) } else { (b, a, db, da) };
                let t = df / (df - dt);
                let t = if t.is_finite() { t } else { 0.0 };
                let mix = |x: f32, y: f32| (f64::from(x) + t * (f64::from(y) - f64::from(x))) as f32;
                self.push(ClipVertex {
                    unit: from.unit,
                    position: std::array::from_fn(|k| mix(from.position[k], to.position[k])),
                    weights: std::array::from_fn(|k| mix(from.weights[k], to.weights[k])),
                });
            }
        }
        self.len >= if closed { 3 } else { 2 }
    }

    fn push(&mut self, vertex: ClipVertex) {
        if self.len < MAX_VERTICES {
            self.vertices[self.len] = vertex;
            self.len += 1;
        }
    }

    /// Its vertices in order.
    #[inline]
    pub fn vertices(&self) -> &[ClipVertex] {
        &self.vertices[..self.len]
    }
}

/// The power of two that brings the greatest `w` of a primitive to between 1 and 2 where it is below [`W_SMALL`]; else 1.
///
/// Intersections with planes would otherwise be rounded to subnormal numbers, or lie before the plane at [`W_MIN`].
fn scale(position: &[[f32; 4]]) -> f64 {
    let w = position.iter().fold(f32::MIN_POSITIVE, |most, p| if p[3] > most { p[3] } else { most });
    if w >= W_SMALL {
        return 1.0;
    }
    let exponent = u64::from(w.to_bits() >> 23 & 255);
    // 2 to the power of 127 - exponent.
    f64::from_bits((1023 + 127 - exponent) << 52)
}

/// A position in `f32`. Only depths that are not clipped can exceed its range.
fn narrow(position: [f64; 4]) -> [f32; 4] {
    position.map(|v| v.clamp(f64::from(f32::MIN), f64::from(f32::MAX)) as f32)
}

/// What clipping did.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Clipped {
    /// Nothing is left: outside, behind the eye, or not finite.
    Rejected,
    /// The original is to be drawn untouched; the polygon was not written.
    Whole,
    /// The polygon holds what is left.
    Cut,
}

/// What primitives are clipped to.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ClipVolume {
    /// Ends of the guard band in normalised device coordinates: least x, greatest x, least y, greatest y.
    guard: [f32; 4],
    /// Whether the near and far planes clip.
    depth: bool,
}

/// A vertex in the cut's own precision.
#[derive(Clone, Copy)]
struct Wide {
    p: [f64; 4],
    b: [f64; 3],
    code: Outcode,
}

impl ClipVolume {
    /// The volume of a viewport; with `unclipped_depth` the near and far planes do not clip.
    pub fn new(viewport: &Viewport, unclipped_depth: bool) -> ClipVolume {
        let axis = |start: f32, size: f32, flip: f32| {
            let half = size * 0.5;
            let center = start + half;
            let at = |pixels: f32| {
                let ndc = flip * (pixels - center) / half;
                // An empty viewport has no band: everything lands on its centre.
                if ndc.is_nan() { 0.0 } else { ndc.clamp(f32::MIN, f32::MAX) }
            };
            let (a, b) = (at(-GUARD_PIXELS), at(GUARD_PIXELS));
            (a.min(b), a.max(b))
        };
        let (x0, x1) = axis(viewport.x, viewport.width, 1.0);
        let (y0, y1) = axis(viewport.y, viewport.height, -1.0);
        ClipVolume { guard: [x0, x1, y0, y1], depth: !unclipped_depth }
    }

    /// Where a position lies.
    #[inline(always)]
    pub fn outcode(&self, [x, y, z, w]: [f32; 4]) -> Outcode {
        let bit = |on: bool, code: Outcode| if on { code } else { 0 };
        let [x0, x1, y0, y1] = self.guard;
        let finite = x.is_finite() & y.is_finite() & z.is_finite() & w.is_finite();
        bit(x < -w, LEFT)
            | bit(x > w, RIGHT)
            | bit(y < -w, BOTTOM)
            | bit(y > w, TOP)
            | bit(self.depth & (z < 0.0), NEAR)
            | bit(self.depth & (z > w), FAR)
            | bit(w < f32::MIN_POSITIVE, BEHIND)
            | bit(w < W_MIN, EYE)
            // A product that overflows has the right sign and exceeds every coordinate: the comparison stays true to the reals.
            | bit(x < x0 * w, GUARD_LEFT)
            | bit(x > x1 * w, GUARD_RIGHT)
            | bit(y < y0 * w, GUARD_BOTTOM)
            | bit(y > y1 * w, GUARD_TOP)
            | bit(!finite, NOT_FINITE)
    }

    /// Whether every position of a box (least and greatest x, y, z, w) is outside of one and the same plane, by the comparisons of
    /// [`ClipVolume::outcode`]: no primitive between such positions is drawn.
    pub fn rejects(&self, [x, y, z, w]: [(f32, f32); 4]) -> bool {
        // -w is least where w is greatest.
        x.1 < -w.1 || x.0 > w.1 || y.1 < -w.1 || y.0 > w.1 || self.depth && (z.1 < 0.0 || z.0 > w.1) || w.1 < f32::MIN_POSITIVE
    }

    /// The outcodes of the first positions (x, y, z, w) of a batch.
    #[inline(always)]
    pub fn outcodes<const N: usize>(&self, position: [&Lanes; 4], out: &mut [Outcode; N]) {
        const { assert!(N <= LANES) };
        let [x, y, z, w] = position.map(Lanes::f32);
        for i in 0..N {
            out[i] = self.outcode([x[i], y[i], z[i], w[i]]);
        }
    }

    /// What outcodes alone say of a primitive with the given vertices' codes: `None` if it has to be cut.
    #[inline(always)]
    pub fn trivial(codes: &[Outcode]) -> Option<Clipped> {
        let (mut all, mut any) = (!0, 0);
        for &code in codes {
            all &= code;
            any |= code;
        }
        if all & REJECT != 0 || any & NOT_FINITE != 0 {
            Some(Clipped::Rejected)
        } else if any & CLIP == 0 {
            Some(Clipped::Whole)
        } else {
            None
        }
    }

    /// Whether vertices have places in the window without cutting what they span: those of a primitive that is not drawn may lie outside
    /// of the viewport.
    pub fn is_in_band(codes: &[Outcode]) -> bool {
        codes.iter().all(|code| code & (CLIP | NOT_FINITE) == 0) && codes.iter().fold(!0, |all, code| all & code) & REJECT != 0
    }

    /// Whether a point is drawn: its position lies in the view volume, so points are not drawn in part at the border.
    #[inline]
    pub fn point(&self, code: Outcode) -> bool {
        code & (REJECT | CLIP & !EYE | NOT_FINITE) == 0
    }

    /// Clips a triangle; `codes` are the outcodes of its vertices.
    #[inline]
    pub fn triangle(&self, position: &[[f32; 4]; 3], codes: [Outcode; 3], out: &mut Polygon) -> Clipped {
        Self::trivial(&codes).unwrap_or_else(|| self.cut(position, codes, out))
    }

    /// Clips a line; `codes` are the outcodes of its vertices.
    #[inline]
    pub fn line(&self, position: &[[f32; 4]; 2], codes: [Outcode; 2], out: &mut Polygon) -> Clipped {
        Self::trivial(&codes).unwrap_or_else(|| self.cut(position, codes, out))
    }

    /// How far inside of a plane a position lies, where that of the eye is at the `least` w; negative outside. Not normalised.
    #[inline(always)]
    fn distance(&self, plane: Outcode, least: f64, [x, y, z, w]: [f64; 4]) -> f64 {
        let [x0, x1, y0, y1] = self.guard.map(f64::from);
        match plane {
            EYE => w - least,
            NEAR => z,
            FAR => w - z,
            GUARD_LEFT => x - x0 * w,
            GUARD_RIGHT => x1 * w - x,
            GUARD_BOTTOM => y - y0 * w,
            _ => y1 * w - y,
        }
    }

    /// Moves a position that rounding left beside a plane onto it.
    #[inline(always)]
    fn pin(&self, plane: Outcode, least: f64, p: &mut [f64; 4]) {
        let [x0, x1, y0, y1] = self.guard.map(f64::from);
        match plane {
            EYE => p[3] = least,
            NEAR => p[2] = 0.0,
            FAR => p[2] = p[3],
            GUARD_LEFT => p[0] = x0 * p[3],
            GUARD_RIGHT => p[0] = x1 * p[3],
            GUARD_BOTTOM => p[1] = y0 * p[3],
            _ => p[1] = y1 * p[3],
        }
    }

    /// The vertex where the edge from `from`, inside of a plane, to `to`, outside, leaves it.
    fn meet(&self, plane: Outcode, least: f64, from: &Wide, to: &Wide) -> Wide {
        // Original vertices lie where their outcodes, computed in f32, say; in f64 they may lie a hair beyond.
        let inside = self.distance(plane, least, from.p).max(0.0);
        let outside = self.distance(plane, least, to.p).min(0.0);
        // Two weights: with one alone, a vertex that is very much farther away would swallow the other's part.
        let sum = inside - outside;
        let (f, t) = if inside > 0.0 { (-outside / sum, inside / sum) } else { (1.0, 0.0) };
        let mut v = *from;
        for k in 0..4 {
            v.p[k] = f * from.p[k] + t * to.p[k];
        }
        for k in 0..3 {
            v.b[k] = f * from.b[k] + t * to.b[k];
        }
        self.pin(plane, least, &mut v.p);
        v.code = 0;
        for other in PLANES {
            if other != plane && (self.depth || other & (NEAR | FAR) == 0) && self.distance(other, least, v.p) < 0.0 {
                v.code |= other;
            }
        }
        v
    }

    /// Sutherland and Hodgman's algorithm, plane by plane.
    ///
    /// Two triangles that share an edge cut it at the same points: a cut is always computed from the inside to the outside,
    /// planes come in one order, and which side an original vertex is on is its outcode's word, here and in
    /// [`ClipVolume::trivial`] alike.
    #[cold]
    fn cut<const N: usize>(&self, position: &[[f32; 4]; N], codes: [Outcode; N], out: &mut Polygon) -> Clipped {
        let unit = scale(position);
        let least = f64::from(W_MIN).max(f64::from(f32::MIN_POSITIVE) * unit);
        let codes: [Outcode; N] = std::array::from_fn(|i| {
            let near = f64::from(position[i][3]) * unit < least;
            codes[i] & !EYE | if near { EYE } else { 0 }
        });
        if let Some(clipped) = Self::trivial(&codes) {
            return clipped;
        }
        let mut now = [Wide { p: [0.0; 4], b: [0.0; 3], code: 0 }; MAX_VERTICES];
        let mut next = now;
        let mut n = N;
        for i in 0..N {
            now[i] = Wide { p: position[i].map(|v| f64::from(v) * unit), b: [0.0; 3], code: codes[i] };
            now[i].b[i] = 1.0;
        }
        for plane in PLANES {
            if now[..n].iter().all(|v| v.code & plane == 0) {
                continue;
            }
            let mut m = 0;
            let mut keep = |v: Wide| {
                // A convex polygon gains one vertex a plane; rounding cannot be allowed to find more.
                if m < MAX_VERTICES {
                    next[m] = v;
                    m += 1;
                }
            };
            for i in 0..n {
                let (a, b) = (&now[i], &now[(i + 1) % n]);
                let (a_in, b_in) = (a.code & plane == 0, b.code & plane == 0);
                if a_in {
                    keep(*a);
                }
                // A line has no edge back from its end.
                if a_in != b_in && (N > 2 || i + 1 < n) {
                    keep(if a_in { self.meet(plane, least, a, b) } else { self.meet(plane, least, b, a) });
                }
            }
            std::mem::swap(&mut now, &mut next);
            n = m;
            if n < N.min(3) {
                out.len = 0;
                return Clipped::Rejected;
            }
        }
        for i in 0..n {
            let mut position = narrow(now[i].p);
            position[3] = position[3].max(least as f32);
            out.vertices[i] = ClipVertex { position, unit: unit as f32, weights: now[i].b.map(|v| v as f32) };
        }
        out.len = n;
        Clipped::Cut
    }
}
