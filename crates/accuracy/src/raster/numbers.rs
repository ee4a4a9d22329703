//! Interpolation and depth against `f64`.

use anyhow::{Result, ensure};

use super::draw::{Image, state, viewport, walk};
use crate::{Row, Section, Setting, Target};
use gfx::format::Format;
use gfx::interpolate::{self, PixelPoint, Site, Weights};
use gfx::reference::{self, Position};
use gfx::setup::{self, Screen, ScreenVertex, Triangle};
use gfx::texel::depth_code;
use num::{Lanes, QUADS, Random};

pub const INTERPOLATION: Target = Target {
    id: "interpolation",
    section: Section::Raster,
    what: "Attributes at covered samples against f64: constants, values at vertices, linear and perspective-correct ones",
    bound: "constants and vertices exact; 4 ULP of the largest of the three values; the conformance suite's model of rounding 1, weights \
            3 and division 8 ULP of a 10-bit mantissa; weights and 1/w rounded once",
    fault: "one edge function of each triangle, from which weights come, is off by 1/256 pixel's worth",
    check: interpolation,
};

pub const DEPTH: Target = Target {
    id: "depth",
    section: Section::Raster,
    what: "Depth of slanted planes at samples against f64, bounds on it in blocks; of 10,000 even depths from 0.1 to 10,000 how many \
           neighbours are stored alike, in 24 bits and as reversed floating point",
    bound: "(|dz/dx| + |dz/dy|)/512 + 2^-24; 1 point of 75.8 % (2 where the projection runs in f32 too); none equal or swapped reversed",
    fault: "depth is taken half a pixel to the right of the sample; every tenth of the even depths is the one before",
    check: depth,
};

/// Spacing of f32 numbers at a magnitude.
pub fn ulp(magnitude: f64) -> f64 {
    let magnitude = magnitude.abs().max(f64::from(f32::MIN_POSITIVE));
    libm::exp2(f64::from(libm::ilogb(magnitude) - 23))
}

fn positions(v: &[ScreenVertex; 3]) -> [Position; 3] {
    [0, 1, 2].map(|i| super::draw::position(&v[i]))
}

fn random_triangle(random: &mut Random, extent: i32, any_w: bool) -> [ScreenVertex; 3] {
    std::array::from_fn(|_| ScreenVertex {
        x: random.between(0, extent * 256),
        y: random.between(0, extent * 256),
        z: random.unit(),
        inv_w: if any_w { 1.0 / random.range(0.1, 4.0) } else { 1.0 },
    })
}

/// A covered sample of a triangle: where it is, and its lane in a batch of weights.
struct Covered<'a> {
    at: Position,
    lane: usize,
    weights: &'a Weights,
    inv_w: f32,
}

/// Interpolates at all samples that a triangle covers; of four, sample s alone.
fn covered<const S: usize>(t: &Triangle, sample: usize, mut visit: impl FnMut(Covered)) {
    let mut sites: Vec<(Site, u16)> = Vec::new();
    walk::<S>(t, |block| {
        sites.extend(block.quads().map(|q| (Site { triangle: 0, x: q.x, y: q.y }, q.mask >> (4 * sample) & 15)));
    });
    let place = if S == 1 { PixelPoint::Center } else { PixelPoint::Sample(sample) };
    let offset = reference::samples(S as u32)[sample];
    for chunk in sites.chunks(QUADS) {
        let batch: Vec<Site> = chunk.iter().map(|c| c.0).collect();
        let (mut weights, mut inv_w) = (Weights::default(), Lanes::ZERO);
        interpolate::perspective(&[*t], &batch, place, &mut weights, &mut inv_w);
        for (q, (site, mask)) in chunk.iter().enumerate() {
            for p in (0..4).filter(|p| mask >> p & 1 == 1) {
                let pixel = [i64::from(site.x) + (p & 1), i64::from(site.y) + (p >> 1)];
                let at = [0, 1].map(|k| pixel[k] * 256 + offset[k]);
                let lane = 4 * q + p as usize;
                visit(Covered { at, lane, weights: &weights, inv_w: inv_w.f32()[lane] });
            }
        }
    }
}

/// As [`covered`] by number of samples.
fn covered_at(t: &Triangle, samples: u32, sample: usize, visit: impl FnMut(Covered)) {
    match samples {
        1 => covered::<1>(t, sample, visit),
        _ => covered::<4>(t, sample, visit),
    }
}

/// The worst that interpolation did.
#[derive(Clone, Copy, Debug, Default)]
struct Worst {
    constants: u64,
    affine: f64,
    perspective: f64,
    /// In units of a 10-bit mantissa.
    coarse: f64,
    weights: f64,
    inv_w: f64,
    samples: u64,
}

impl Worst {
    fn and(self, other: Worst) -> Worst {
        Worst {
            constants: self.constants + other.constants,
            affine: self.affine.max(other.affine),
            perspective: self.perspective.max(other.perspective),
            coarse: self.coarse.max(other.coarse),
            weights: self.weights.max(other.weights),
            inv_w: self.inv_w.max(other.inv_w),
            samples: self.samples + other.samples,
        }
    }
}

fn one_triangle(random: &mut Random, case: u64, inject_fault: bool) -> Worst {
    let mut worst = Worst::default();
    let any_w = case % 2 == 1;
    let extent = [3, 10, 40, 300][case as usize / 2 % 4];
    let (samples, sample) = if case.is_multiple_of(3) { (4, random.below(4) as usize) } else { (1, 0) };
    let v = random_triangle(random, extent, any_w);
    // Of a large triangle a window.
    let [x, y] = [0, 1].map(|_| random.between(0, (extent - 40).max(1)));
    let Ok(mut t) = setup::triangle(&state(samples, [x, y, x + 41, y + 41]), &v) else { return worst };
    if inject_fault {
        t.edges[1].c += i64::from(t.edges[1].a);
    }
    let values: [f32; 3] = std::array::from_fn(|_| random.range(-10.0, 10.0));
    let largest = values.iter().fold(0.0f64, |most, v| most.max(f64::from(v.abs())));
    let constant = random.range(-1.0e6, 1.0e6);
    covered_at(&t, samples, sample, |c| {
        worst.samples += 1;
        let mut out = Lanes::ZERO;
        interpolate::attribute_uniform(c.weights, [constant; 3], &mut out);
        worst.constants += u64::from(out.f32()[c.lane] != constant);
        let (ideal, inv_w) = reference::perspective(positions(&v), v.map(|v| v.inv_w), c.at);
        for (got, ideal) in [(c.weights.one.f32()[c.lane], ideal[1]), (c.weights.two.f32()[c.lane], ideal[2])] {
            // What f64 itself loses is not counted.
            worst.weights = worst.weights.max(((f64::from(got) - ideal).abs() - 1.0e-14) / ulp(ideal));
        }
        worst.inv_w = worst.inv_w.max((f64::from(c.inv_w) - inv_w).abs() / ulp(inv_w));
        interpolate::attribute_uniform(c.weights, values, &mut out);
        let exact: f64 = (0..3).map(|i| ideal[i] * f64::from(values[i])).sum();
        let error = (f64::from(out.f32()[c.lane]) - exact).abs() / ulp(largest);
        let of_kind = if any_w { &mut worst.perspective } else { &mut worst.affine };
        *of_kind = of_kind.max(error);
        worst.coarse = worst.coarse.max(error / 8192.0);
    });
    worst
}

/// Vertices on the centres of pixels, any w, values of wildly different size: attributes there that are not the vertex's, and how many
/// were looked at.
fn at_vertices(random: &mut Random, inject_fault: bool) -> (u64, u64) {
    let v: [ScreenVertex; 3] = std::array::from_fn(|_| ScreenVertex {
        x: random.between(0, 20) * 256 + 128,
        y: random.between(0, 20) * 256 + 128,
        z: 0.5,
        inv_w: 1.0 / random.range(0.01, 100.0),
    });
    let Ok(mut t) = setup::triangle(&state(1, [0, 0, 32, 32]), &v) else { return (0, 0) };
    if inject_fault {
        t.edges[1].c += i64::from(t.edges[1].a);
    }
    let mut wrong = 0;
    let values: [f32; 3] = std::array::from_fn(|_| random.range(-1.0, 1.0) * libm::exp10f(random.between(-8, 9) as f32));
    for i in 0..3 {
        let (x, y) = ((v[i].x >> 8) as u16, (v[i].y >> 8) as u16);
        let site = Site { triangle: 0, x: x & !1, y: y & !1 };
        let (mut weights, mut inv_w, mut out) = (Weights::default(), Lanes::ZERO, Lanes::ZERO);
        interpolate::perspective(&[t], &[site], PixelPoint::Center, &mut weights, &mut inv_w);
        interpolate::attribute_uniform(&weights, values, &mut out);
        wrong += u64::from(out.f32()[usize::from(x & 1) + 2 * usize::from(y & 1)] != values[i]);
    }
    (wrong, 3)
}

fn interpolation(setting: &Setting) -> Result<Vec<Row>> {
    let all =
        setting.pieces(setting.pick(150, 20_000, 500_000), |case, random| one_triangle(random, case, setting.inject_fault));
    let worst = all.into_iter().fold(Worst::default(), Worst::and);
    ensure!(worst.samples > 1_000, "only {} samples", worst.samples);
    let vertices = setting.pieces(setting.pick(500, 50_000, 1_000_000), |_, random| at_vertices(random, setting.inject_fault));
    let (wrong, looked) = vertices.into_iter().fold((0, 0), |sum, one| (sum.0 + one.0, sum.1 + one.1));
    ensure!(looked > 300, "only {looked} vertices");
    Ok(vec![
        Row::none("constants: samples that are not the constant", worst.constants),
        Row::none("at vertices: values that are not the vertex's", wrong),
        Row::at_most("w = 1: worst, in f32 ULP", worst.affine, 4.0),
        Row::at_most("w from 0.1 to 4: worst, in f32 ULP", worst.perspective, 4.0),
        Row::at_most("any w: worst, in ULP of a 10-bit mantissa", worst.coarse, 12.0),
        Row::at_most("perspective-correct weights: worst, in f32 ULP", worst.weights, 0.501),
        Row::at_most("1/w: worst, in f32 ULP", worst.inv_w, 0.501),
    ])
}

/// What depth did on one triangle: the worst share of the bound, samples outside of a block's bounds, samples of a flat plane off it, and
/// samples.
fn one_plane(random: &mut Random, case: u64, inject_fault: bool) -> (f64, u64, u64, u64) {
    let extent = [4, 30, 250, 2000, 8000][case as usize % 5];
    let mut v = random_triangle(random, extent, false);
    let flat = case.is_multiple_of(7);
    if flat {
        (v[1].z, v[2].z) = (v[0].z, v[0].z);
    }
    let [x, y] = [0, 1].map(|_| random.between(0, extent));
    let (samples, sample) = if case.is_multiple_of(2) { (4, random.below(4) as usize) } else { (1, 0) };
    let Ok(t) = setup::triangle(&state(samples, [x, y, x + 24, y + 24]), &v) else { return (0.0, 0, 0, 0) };
    let slope = f64::from(t.depth.dzdx.abs()) + f64::from(t.depth.dzdy.abs());
    let (mut worst, mut outside, mut off, mut count) = (0.0f64, 0, 0, 0);
    covered_at(&t, samples, sample, |c| {
        count += 1;
        let ideal = reference::depth(positions(&v), v.map(|v| v.z), c.at);
        let at = c.at.map(|v| v as f32 / 256.0);
        let z = t.depth.at(at[0] + if inject_fault { 0.5 } else { 0.0 }, at[1]);
        worst = worst.max((f64::from(z) - ideal).abs() / (slope / 512.0 + libm::exp2(-24.0)));
        off += u64::from(flat && z != v[0].z);
        for size in [2, 8] {
            let corner = c.at.map(|v| (v / 256) as i32 & !(size - 1));
            let (low, high) = t.depth.block_range(corner[0], corner[1], size);
            outside += u64::from(!(low <= z && z <= high));
        }
    });
    (worst, outside, off, count)
}

/// The codes that even depths from 0.1 to 10,000 are stored as: each as the depth of a small triangle, projected and set up.
fn even_depths(format: Format, project: impl Fn(f64) -> [f32; 2], inject_fault: bool) -> Vec<u32> {
    let screen = Screen::new(&viewport(8));
    let codes = (0..10_000).map(|i| {
        let i = if inject_fault && i % 10 == 1 { i - 1 } else { i };
        let [z, w] = project(0.1 + (1.0e4 - 0.1) * f64::from(i) / 9999.0);
        let v = [[-0.5, -0.5], [0.5, -0.5], [0.0, 0.5]].map(|[x, y]| screen.vertex([x * w, y * w, z, w]));
        setup::triangle(&state(1, [0, 0, 8, 8]), &v).map_or(u32::MAX, |t| depth_code(format, t.depth.at(4.5, 4.5)))
    });
    codes.collect()
}

fn depth(setting: &Setting) -> Result<Vec<Row>> {
    let inject_fault = setting.inject_fault;
    let planes = setting.pieces(setting.pick(400, 100_000, 2_000_000), |case, random| one_plane(random, case, inject_fault));
    let (worst, outside, off, count) =
        planes.into_iter().fold((0.0f64, 0, 0, 0), |s, p| (s.0.max(p.0), s.1 + p.1, s.2 + p.2, s.3 + p.3));
    ensure!(count > 2_000, "only {count} samples");
    let (n, f) = (0.1, 1.0e4);
    let pairs = |codes: &[u32], holds: fn(u32, u32) -> bool| {
        codes.windows(2).filter(|pair| holds(pair[0], pair[1])).count() as f64 / (codes.len() - 1) as f64
    };
    // 1. The depth is rounded once, and stored.
    let given = even_depths(Format::Depth24Plus, |d| [(f / (f - n) * (1.0 - n / d)) as f32, 1.0], inject_fault);
    // 2. As a vertex shader projects.
    let projected = |a: f64, b: f64| move |d: f64| [a as f32 * d as f32 + b as f32, d as f32];
    let shader = even_depths(Format::Depth24Plus, projected(f / (f - n), -f * n / (f - n)), inject_fault);
    let reversed = even_depths(Format::Depth32Float, projected(-n / (f - n), f * n / (f - n)), inject_fault);
    let mut seen = Image::new([0, 0, 8, 8], 1, false);
    let corners = [[1, 1], [7, 1], [4, 7]].map(|p: [i32; 2]| super::draw::vertex(p.map(|v| v * 256)));
    seen.triangle(&corners, |_| 1);
    ensure!(seen.hits(4, 4, 0) == 1, "the sample at which even depths are taken is not covered");
    Ok(vec![
        Row::at_most("slanted planes: worst, as a share of the bound", worst, 1.0),
        Row::none("flat planes: samples at another depth", off),
        Row::none("samples outside the bounds of their block", outside),
        Row::within("24 bits: neighbours stored alike", 0.758, pairs(&given, |a, b| a == b), 0.01),
        Row::within("24 bits, projected in f32: stored alike", 0.758, pairs(&shader, |a, b| a == b), 0.02),
        Row::exact("reversed floating point: stored alike", 0.0, pairs(&reversed, |a, b| a == b)),
        Row::exact("reversed floating point: swapped", 0.0, pairs(&reversed, |a, b| a < b)),
    ])
}

#[cfg(test)]
mod tests {
    #[test]
    fn a_unit_in_the_last_place() {
        for (x, expected) in [(1.0, f32::EPSILON), (1.99, f32::EPSILON), (0.99, f32::EPSILON / 2.0), (0.0, 1.0e-45)] {
            assert_eq!(super::ulp(x), f64::from(expected), "{x}");
        }
    }
}
