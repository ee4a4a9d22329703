//! Interpolation: depth, position and attributes for batches of up to 16 quads, each of its own primitive.
//!
//! The weights of a primitive's vertices come from its integer edge functions, evaluated exactly in f64 (|E| < 2^49), and are
//! rounded to f32 once: with `k_i = E_i / w_i`, the weight of vertex i is `k_i / (k_0 + k_1 + k_2)`. An attribute is
//! `a0 + (g1 d1 + g2 d2)`, `d_i = a_i - a0`, plus the same combination of what the differences lost to rounding. So a constant
//! stays exactly itself, and where a weight is 1 the attribute is exactly that vertex's.
//!
//! Pixels of a quad that the primitive does not cover are extrapolated, for derivatives. There 1/w is kept from falling below
//! a sixteenth of the least of the vertices', because behind the eye it has a pole.

use bytemuck::{Pod, Zeroable};
use num::{LANES, Lanes, QUADS, SUBPIXEL};

use super::simd::Simd;
use fearless_simd::{f32x8, prelude::*};

use super::setup::{DepthPlane, Edge, SAMPLES_4, Triangle};

/// Where a quad of a batch lies, and of which primitive it is.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Pod, Zeroable)]
#[repr(C)]
pub struct Site {
    /// Index of the primitive in the slice that goes with the batch.
    pub triangle: u32,
    /// Left column; even.
    pub x: u16,
    /// Upper row; even.
    pub y: u16,
}

/// Where in each pixel to evaluate.
#[derive(Clone, Copy, Debug)]
pub enum PixelPoint<'a> {
    /// The centre.
    Center,
    /// One of four samples.
    Sample(usize),
    /// For each lane 0 for the centre or `s + 1` for sample s of four, as [`centroids`] makes them.
    PerLane(&'a [u8; LANES]),
}

impl PixelPoint<'_> {
    /// The offset from the centre where it is the same in all pixels.
    #[inline(always)]
    fn same(&self) -> Option<Same> {
        match self {
            PixelPoint::Center => Some(Same([0, 0])),
            PixelPoint::Sample(s) => Some(Same(OFFSETS[(s + 1) & 7])),
            PixelPoint::PerLane(_) => None,
        }
    }
}

/// Weights of vertices 1 and 2 of each lane's primitive; vertex 0 has the rest to 1.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Weights {
    /// Weight of vertex 1 (of the end, in a line).
    pub one: Lanes,
    /// Weight of vertex 2.
    pub two: Lanes,
}

/// Offsets from the pixel's centre in 1/256 pixel, by a lane's code in [`PixelPoint::PerLane`]; unknown codes mean the centre.
const OFFSETS: [[i32; 2]; 8] = [[0, 0], SAMPLES_4[0], SAMPLES_4[1], SAMPLES_4[2], SAMPLES_4[3], [0, 0], [0, 0], [0, 0]];

/// Defines a function of the batch that is compiled for the host's instruction set ([`crate::simd`]).
macro_rules! widest {
    ($(#[$doc:meta])* pub fn $name:ident($($arg:ident: $type:ty),* $(,)?) $body:block) => {
        $(#[$doc])*
        #[inline]
        pub fn $name($($arg: $type),*) {
            #[inline(always)]
            fn body($($arg: $type),*) $body
            $crate::simd::dispatch!(_simd => body($($arg),*))
        }
    };
}

/// Four lanes of a quad in double precision.
type Quad = [f64; 4];

#[inline(always)]
fn each(f: impl Fn(usize) -> f64) -> Quad {
    [f(0), f(1), f(2), f(3)]
}

/// An edge function in `f64`, in which all of it is exact: every term and sum is a whole number below 2^53.
#[derive(Clone, Copy)]
struct ExactEdge {
    /// Change for each 1/256 pixel to the right and down.
    slope: [f64; 2],
    /// Values in the pixels of the quad at the base.
    quad: Quad,
}

impl ExactEdge {
    #[inline(always)]
    fn new(edge: &Edge) -> ExactEdge {
        let slope = [f64::from(edge.a), f64::from(edge.b)];
        let (right, down) = (slope[0] * f64::from(SUBPIXEL), slope[1] * f64::from(SUBPIXEL));
        let c = edge.c as f64;
        ExactEdge { slope, quad: [c, c + right, c + down, c + (right + down)] }
    }

    /// The difference between the values at a position and those at the base. `x` and `y` are offsets from the base in 1/256 pixels.
    #[inline(always)]
    fn moved(&self, x: f64, y: f64) -> f64 {
        self.slope[0] * x + self.slope[1] * y
    }

    /// The values in the pixels of a quad: those of the quad at the base, plus `moved`.
    #[inline(always)]
    fn quad(&self, moved: f64) -> Quad {
        each(|p| self.quad[p] + moved)
    }
}

/// Where one edge function is evaluated in the pixels of a quad, in 1/256 pixel from the centres.
trait Offsets: Copy {
    /// The values of an edge function in the quad that lies `at` (in 1/256 pixel) from the base.
    fn values(self, edge: &ExactEdge, at: [f64; 2]) -> Quad;

    /// The offset of pixel p in pixels.
    fn pixels(self, p: usize) -> [f32; 2];
}

/// The same offset in all pixels.
#[derive(Clone, Copy)]
struct Same([i32; 2]);

/// An offset for each pixel, by code.
#[derive(Clone, Copy)]
struct Own([u8; 4]);

#[inline(always)]
fn to_pixels(offset: [i32; 2]) -> [f32; 2] {
    [offset[0] as f32 * (1.0 / SUBPIXEL as f32), offset[1] as f32 * (1.0 / SUBPIXEL as f32)]
}

impl Offsets for Same {
    #[inline(always)]
    fn values(self, edge: &ExactEdge, at: [f64; 2]) -> Quad {
        edge.quad(edge.moved(at[0] + f64::from(self.0[0]), at[1] + f64::from(self.0[1])))
    }

    #[inline(always)]
    fn pixels(self, _: usize) -> [f32; 2] {
        to_pixels(self.0)
    }
}

impl Offsets for Own {
    #[inline(always)]
    fn values(self, edge: &ExactEdge, at: [f64; 2]) -> Quad {
        each(|p| {
            let [dx, dy] = OFFSETS[usize::from(self.0[p]) & 7];
            edge.quad[p] + (edge.slope[0] * (at[0] + f64::from(dx)) + edge.slope[1] * (at[1] + f64::from(dy)))
        })
    }

    #[inline(always)]
    fn pixels(self, p: usize) -> [f32; 2] {
        to_pixels(OFFSETS[usize::from(self.0[p]) & 7])
    }
}

/// Chooses by place outside the loop over quads, and runs `$one` for each quad with its offsets.
macro_rules! for_each_quad {
    ($sites:ident, $place:ident, |$q:ident, $site:ident, $offsets:ident| $one:block) => {
        match $place {
            PixelPoint::Center | PixelPoint::Sample(_) => {
                let $offsets = $place.same().unwrap_or(Same([0, 0]));
                for ($q, $site) in $sites.iter().take(QUADS).enumerate() $one
            }
            PixelPoint::PerLane(codes) => {
                for ($q, $site) in $sites.iter().take(QUADS).enumerate() {
                    let $offsets = Own([codes[4 * $q], codes[4 * $q + 1], codes[4 * $q + 2], codes[4 * $q + 3]]);
                    $one
                }
            }
        }
    };
}

/// What the weights of a primitive are computed from.
#[derive(Clone, Copy)]
struct Basis {
    /// The edge functions opposite to vertices 1 and 2.
    edges: [ExactEdge; 2],
    /// The sum of all three.
    area: f64,
    inv_area: f64,
    /// 1/w of the vertices.
    inv_w: [f64; 3],
    /// The least that the sum of weights times 1/w may be.
    least: f64,
    /// What the sum's inverse is everywhere where every 1/w is 1, as in an orthographic view: there the sum is the area, exactly. Else 0.
    inverse: f64,
    base: [i32; 2],
}

impl Basis {
    #[inline(always)]
    fn new(t: &Triangle) -> Basis {
        let area = t.area() as f64;
        let [k0, k1, k2] = [f64::from(t.inv_w[0]), f64::from(t.inv_w[1]), f64::from(t.inv_w[2])];
        let k01 = if k0 < k1 { k0 } else { k1 };
        Basis {
            edges: [ExactEdge::new(&t.edges[1]), ExactEdge::new(&t.edges[2])],
            area,
            inv_area: t.inv_area,
            inv_w: [k0, k1, k2],
            least: (if k01 < k2 { k01 } else { k2 }) * area * (1.0 / 16.0),
            inverse: if [k0, k1, k2] == [1.0; 3] && area > 0.0 { 1.0 / area } else { 0.0 },
            base: t.base(),
        }
    }

    /// What E_1 and E_2 of quads differ by from those of the quad at the base: of all quads of a register together, which takes half of the
    /// instructions. Sums of whole numbers are the same in any order.
    #[inline(always)]
    fn moved(&self, sites: &[Site; QUADS], offset: Same) -> [[f64; QUADS]; 2] {
        let (mut x, mut y) = ([0.0; QUADS], [0.0; QUADS]);
        for q in 0..QUADS {
            x[q] = f64::from((i32::from(sites[q].x) - self.base[0]) * SUBPIXEL + offset.0[0]);
            y[q] = f64::from((i32::from(sites[q].y) - self.base[1]) * SUBPIXEL + offset.0[1]);
        }
        let moved = |edge: &ExactEdge| {
            let mut moved = [0.0; QUADS];
            for q in 0..QUADS {
                moved[q] = edge.moved(x[q], y[q]);
            }
            moved
        };
        [moved(&self.edges[0]), moved(&self.edges[1])]
    }

    /// Weights and 1/w of a quad.
    #[inline(always)]
    fn weigh(&self, q: usize, [e1, e2]: [Quad; 2], weights: &mut Weights, inv_w: &mut Lanes) {
        if self.inverse > 0.0 {
            // The same bits without a division for each lane, which takes most of the time.
            put(&mut weights.one, q, each(|p| e1[p] * self.inverse));
            put(&mut weights.two, q, each(|p| e2[p] * self.inverse));
            return put(inv_w, q, [self.area * self.inv_area; 4]);
        }
        let (area, [k0, k1, k2]) = (self.area, self.inv_w);
        let p1 = each(|p| e1[p] * k1);
        let p2 = each(|p| e2[p] * k2);
        let sum = each(|p| {
            let sum = ((area - e1[p]) - e2[p]) * k0 + p1[p] + p2[p];
            if sum > self.least { sum } else { self.least }
        });
        let inv = each(|p| 1.0 / sum[p]);
        put(&mut weights.one, q, each(|p| p1[p] * inv[p]));
        put(&mut weights.two, q, each(|p| p2[p] * inv[p]));
        put(inv_w, q, each(|p| sum[p] * self.inv_area));
    }

    /// E_1 and E_2 at the four pixels of a quad.
    #[inline(always)]
    fn values(&self, site: &Site, offsets: impl Offsets) -> [Quad; 2] {
        let at = [(i32::from(site.x) - self.base[0]) * SUBPIXEL, (i32::from(site.y) - self.base[1]) * SUBPIXEL];
        let at = [f64::from(at[0]), f64::from(at[1])];
        [offsets.values(&self.edges[0], at), offsets.values(&self.edges[1], at)]
    }
}

/// Writes a quad's lanes.
#[inline(always)]
fn put(out: &mut Lanes, q: usize, v: Quad) {
    let out = &mut out.f32_mut()[4 * q..4 * q + 4];
    for p in 0..4 {
        out[p] = v[p] as f32;
    }
}

widest! {
    /// Perspective-correct weights of each lane, and 1/w there (`position.w` of a fragment).
    ///
    /// At most [`QUADS`] sites count; lanes beyond them are left as they are.
    ///
    /// # Panics
    /// If a site names a primitive that is not there.
    pub fn perspective(triangles: &[Triangle], sites: &[Site], place: PixelPoint<'_>, weights: &mut Weights, inv_w: &mut Lanes) {
        let Some(first) = sites.first() else { return };
        let (mut current, mut basis) = (first.triangle, Basis::new(&triangles[first.triangle as usize]));
        if let Some(sites) = sites.first_chunk::<QUADS>()
            && let Some(offset) = place.same()
            && sites.iter().fold(0, |different, site| different | site.triangle ^ current) == 0
        {
            let [one, two] = basis.moved(sites, offset);
            for q in 0..QUADS {
                basis.weigh(q, [basis.edges[0].quad(one[q]), basis.edges[1].quad(two[q])], weights, inv_w);
            }
            return;
        }
        for_each_quad!(sites, place, |q, site, offsets| {
            // The quads of a primitive follow each other.
            if site.triangle != current {
                (current, basis) = (site.triangle, Basis::new(&triangles[site.triangle as usize]));
            }
            basis.weigh(q, basis.values(site, offsets), weights, inv_w);
        });
    }
}

widest! {
    /// Weights linear in the window (WGSL's `linear` interpolation).
    ///
    /// At most [`QUADS`] sites count; lanes beyond them are left as they are.
    ///
    /// # Panics
    /// If a site names a primitive that is not there.
    pub fn linear(triangles: &[Triangle], sites: &[Site], place: PixelPoint<'_>, weights: &mut Weights) {
        for_each_quad!(sites, place, |q, site, offsets| {
            let basis = Basis::new(&triangles[site.triangle as usize]);
            let [e1, e2] = basis.values(site, offsets);
            put(&mut weights.one, q, each(|p| e1[p] * basis.inv_area));
            put(&mut weights.two, q, each(|p| e2[p] * basis.inv_area));
        });
    }
}

widest! {
    /// Depth of each lane as the fragment stage sees it (`position.z`): [`depth`] without the clamp to the viewport's range.
    ///
    /// At most [`QUADS`] sites count; lanes beyond them are left as they are.
    ///
    /// # Panics
    /// If a site names a primitive that is not there.
    pub fn position_depth(triangles: &[Triangle], sites: &[Site], place: PixelPoint<'_>, out: &mut Lanes) {
        for_each_quad!(sites, place, |q, site, offsets| {
            let triangle = &triangles[site.triangle as usize];
            let [min, max] = triangle.depth_ends;
            depths(&DepthPlane { min, max, ..triangle.depth }, q, site, offsets, out);
        });
    }
}

/// Depths of a quad.
#[inline(always)]
fn depths(plane: &DepthPlane, q: usize, site: &Site, offsets: impl Offsets, out: &mut Lanes) {
    let out = &mut out.f32_mut()[4 * q..4 * q + 4];
    let (x, y) = (f32::from(site.x) + 0.5, f32::from(site.y) + 0.5);
    for p in 0..4 {
        let [dx, dy] = offsets.pixels(p);
        out[p] = plane.at(x + ((p & 1) as f32 + dx), y + ((p >> 1) as f32 + dy));
    }
}

widest! {
    /// Depth of each lane as it is tested and written, by [`super::setup::DepthPlane::at`].
    ///
    /// At most [`QUADS`] sites count; lanes beyond them are left as they are.
    ///
    /// # Panics
    /// If a site names a primitive that is not there.
    pub fn depth(triangles: &[Triangle], sites: &[Site], place: PixelPoint<'_>, out: &mut Lanes) {
        for_each_quad!(sites, place, |q, site, offsets| {
            depths(&triangles[site.triangle as usize].depth, q, site, offsets, out);
        });
    }
}

widest! {
    /// Window x and y of each lane in pixels.
    ///
    /// At most [`QUADS`] sites count; lanes beyond them are left as they are.
    pub fn window(sites: &[Site], place: PixelPoint<'_>, x: &mut Lanes, y: &mut Lanes) {
        for_each_quad!(sites, place, |q, site, offsets| {
            let (left, top) = (f32::from(site.x) + 0.5, f32::from(site.y) + 0.5);
            let (x, y) = (&mut x.f32_mut()[4 * q..4 * q + 4], &mut y.f32_mut()[4 * q..4 * q + 4]);
            for p in 0..4 {
                let [dx, dy] = offsets.pixels(p);
                x[p] = left + ((p & 1) as f32 + dx);
                y[p] = top + ((p >> 1) as f32 + dy);
            }
        });
    }
}

/// Where each lane evaluates attributes of centroid sampling, for quads of the given coverage (bit `4 sample + p`, four
/// samples): the centre where all samples or none are covered, else the first sample that is.
pub fn centroids(coverage: &[u16], out: &mut [u8; LANES]) {
    for (q, &mask) in coverage.iter().take(QUADS).enumerate() {
        for p in 0..4 {
            let samples = mask >> p & 0x1111;
            out[4 * q + p] = match samples {
                0 | 0x1111 => 0,
                some => (some.trailing_zeros() / 4 + 1) as u8,
            };
        }
    }
}

impl Weights {
    /// Whether no lane has an infinity or what is no number.
    #[inline(always)]
    pub fn are_finite(&self) -> bool {
        let most = |lanes: &Lanes| lanes.0.iter().fold(0, |most, bits| (bits & !SIGN).max(most));
        most(&self.one).max(most(&self.two)) < INFINITY
    }
}

/// Whether the weights of a triangle are finite numbers in all quads, those that it does not cover too. A weight is `E_i / w_i` by a sum which is
/// a sixteenth of the least 1/w times the area at least ([`perspective`]). Edge functions are below 2^49. So vertices whose 1/w differ by factors
/// below 2^65 have weights below 2^(49 + 65 + 4), and 2^127 is a finite `f32`.
#[inline(always)]
pub fn has_finite_weights(triangle: &Triangle) -> bool {
    let [a, b, c] = triangle.inv_w.map(f32::to_bits);
    let (least, most) = (a.min(b).min(c), a.max(b).max(c));
    // The bits of positive floats are in the floats' order, and 64 exponents are 64 steps of 2^23. Normal numbers only.
    least >= 1 << 23 && most < INFINITY && most - least <= 64 << 23 && triangle.area() >= 1
}

/// The sign of the bits of a number.
const SIGN: u32 = 1 << 31;
/// The bits of infinity: those of finite numbers without a sign are less.
const INFINITY: u32 = 0x7f80_0000;

/// Whether interpolation gives the first of these values, bit for bit, wherever weights are finite: all differences are 0 then, to which
/// nothing but a negative 0 is added that is not left as it is.
#[inline(always)]
pub fn is_constant([a, b, c]: [u32; 3]) -> bool {
    a == b && a == c && a != SIGN && a & INFINITY != INFINITY
}

/// What an attribute of one triangle becomes before it is spread over lanes: its value at vertex 0, the differences to it, and
/// what rounding took from the differences.
#[inline(always)]
fn coefficients([a, b, c]: [f32; 3]) -> [f32; 5] {
    let (d1, d2) = (b - a, c - a);
    [a, d1, d2, b - (a + d1), c - (a + d2)]
}

#[inline(always)]
fn combine([a, d1, d2, r1, r2]: [f32; 5], g1: f32, g2: f32) -> f32 {
    (a + (g1 * d1 + g2 * d2)) + (g1 * r1 + g2 * r2)
}

widest! {
    /// One attribute component; `values[i][q]` is its value at vertex i of quad q's primitive.
    pub fn attribute(weights: &Weights, values: &[[f32; QUADS]; 3], out: &mut Lanes) {
        let (one, two, out) = (weights.one.f32(), weights.two.f32(), out.f32_mut());
        let mut k = [[0.0; QUADS]; 5];
        for q in 0..QUADS {
            let c = coefficients([values[0][q], values[1][q], values[2][q]]);
            for i in 0..5 {
                k[i][q] = c[i];
            }
        }
        for q in 0..QUADS {
            for p in 0..4 {
                let lane = 4 * q + p;
                out[lane] = combine([k[0][q], k[1][q], k[2][q], k[3][q], k[4][q]], one[lane], two[lane]);
            }
        }
    }
}

/// One attribute component of the quads of one primitive, which has these values at its vertices; same bits as [`attribute`].
///
/// Two quads at a time: a loop over lanes becomes one over all sixteen quads, which has more numbers than registers.
#[inline(always)]
pub fn attribute_run<V: Simd>(simd: V, weights: &Weights, quads: std::ops::Range<usize>, values: [f32; 3], out: &mut Lanes) {
    let k = coefficients(values);
    let lanes = 4 * quads.start.min(QUADS)..4 * quads.end.min(QUADS);
    let (one, two) = (weights.one.f32()[lanes.clone()].as_chunks::<8>(), weights.two.f32()[lanes.clone()].as_chunks::<8>());
    let (pairs, last) = out.f32_mut()[lanes].as_chunks_mut::<8>();
    let [a, d1, d2, r1, r2] = k.map(|k| f32x8::splat(simd, k));
    for ((out, &one), &two) in pairs.iter_mut().zip(one.0).zip(two.0) {
        let (g1, g2) = (f32x8::simd_from(simd, one), f32x8::simd_from(simd, two));
        *out = ((a + (g1 * d1 + g2 * d2)) + (g1 * r1 + g2 * r2)).into();
    }
    for ((out, &one), &two) in last.iter_mut().zip(one.1).zip(two.1) {
        *out = combine(k, one, two);
    }
}

widest! {
    /// One attribute component of a batch whose quads are all of one primitive; same bits as [`attribute`].
    pub fn attribute_uniform(weights: &Weights, values: [f32; 3], out: &mut Lanes) {
        let (one, two, out) = (weights.one.f32(), weights.two.f32(), out.f32_mut());
        let k = coefficients(values);
        for lane in 0..LANES {
            out[lane] = combine(k, one[lane], two[lane]);
        }
    }
}
