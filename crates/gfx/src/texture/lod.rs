//! Level of detail and anisotropy, from derivatives (Vulkan, "Level-of-Detail Operation" and "Scale Factor Operation").

use super::cube::project;
use super::{Lod, Sample, Sampler, View};
use crate::math::log2;
use crate::state::ViewDimension;
use num::{LANES, QUADS};

/// Range of a shader's level-of-detail bias (WGSL).
pub(super) const BIAS: (f32, f32) = (-16.0, 15.99);

/// What a sample reads, lane by lane.
pub(super) struct Selection {
    /// Level of detail, clamped by the sampler; not yet by the view.
    pub lambda: [f32; LANES],
    /// Probes along the major axis: 1 without anisotropy.
    pub probes: [u8; LANES],
    /// The footprint's major axis in coordinates of the texture; zero with one probe.
    pub major: [[f32; LANES]; 2],
}

/// How much of a footprint one pixel covers.
#[derive(Clone, Copy)]
struct Footprint {
    lambda: f32,
    probes: u8,
    major: [f32; 2],
}

impl Selection {
    pub(super) fn new(view: &View, sampler: &Sampler, args: &Sample<'_>) -> Selection {
        let mut out = Selection { lambda: [0.0; LANES], probes: [1; LANES], major: [[0.0; LANES]; 2] };
        if !plain_lambda(view, sampler, args, &mut out.lambda) {
            out.measure(view, sampler, args);
            bias_and_clamp(sampler, args, &mut out.lambda);
        }
        out
    }

    /// Measures the footprints of the lanes: not yet biased, nor clamped.
    fn measure(&mut self, view: &View, sampler: &Sampler, args: &Sample<'_>) {
        let Lod::Gradient { dx, dy } = args.lod else { return self.measure_quads(view, sampler, args) };
        for i in 0..LANES {
            let at = args.coords.map(|c| c.f32()[i]);
            self.set(i, measure(view, sampler, at, dx.map(|d| d.f32()[i]), dy.map(|d| d.f32()[i])));
        }
    }

    /// Measures the footprint of every quad from the differences of its coordinates.
    fn measure_quads(&mut self, view: &View, sampler: &Sampler, args: &Sample<'_>) {
        for q in 0..QUADS {
            let lane = |p: usize| args.coords.map(|c| c.f32()[4 * q + p]);
            let (a, b, c) = (lane(0), lane(1), lane(2));
            let (dx, dy) = (std::array::from_fn(|i| b[i] - a[i]), std::array::from_fn(|i| c[i] - a[i]));
            let footprint = measure(view, sampler, a, dx, dy);
            for p in 0..4 {
                // On a cube the same change of direction moves each pixel differently, and maybe on another face.
                let own = if view.is_cube() { measure(view, sampler, lane(p), dx, dy) } else { footprint };
                self.set(4 * q + p, own);
            }
        }
    }

    fn set(&mut self, lane: usize, footprint: Footprint) {
        self.lambda[lane] = footprint.lambda;
        self.probes[lane] = footprint.probes;
        self.major[0][lane] = footprint.major[0];
        self.major[1][lane] = footprint.major[1];
    }
}

/// The clamped levels of detail alone: where they are [plain](plain_lambda), the rest of a selection takes longer to make than they do.
pub(super) fn lambda(view: &View, sampler: &Sampler, args: &Sample<'_>, out: &mut [f32; LANES]) {
    if !plain_lambda(view, sampler, args, out) {
        *out = Selection::new(view, sampler, args).lambda;
    }
}

/// The clamped levels of detail where no footprint has to be measured for them; false, where one has to be.
#[inline(always)]
fn plain_lambda(view: &View, sampler: &Sampler, args: &Sample<'_>, out: &mut [f32; LANES]) -> bool {
    // With one level and one filter the level of detail changes nothing.
    if view.levels.len() == 1 && sampler.mag_linear == sampler.min_linear && sampler.anisotropy <= 1.0 {
        *out = [0.0; LANES];
        return true;
    }
    let flat = matches!(view.dimension, ViewDimension::D2 | ViewDimension::D2Array) && sampler.anisotropy <= 1.0;
    match args.lod {
        Lod::Zero => *out = [0.0; LANES],
        Lod::Level(level) => *out = *level.f32(),
        Lod::Auto | Lod::Bias(_) if flat => flat_lambda(view, args, out),
        Lod::Auto | Lod::Bias(_) | Lod::Gradient { .. } => return false,
    }
    bias_and_clamp(sampler, args, out);
    true
}

#[inline(always)]
fn bias_and_clamp(sampler: &Sampler, args: &Sample<'_>, lambda: &mut [f32; LANES]) {
    if let Lod::Bias(bias) = args.lod {
        for (lambda, bias) in lambda.iter_mut().zip(bias.f32()) {
            *lambda += bias.clamp(BIAS.0, BIAS.1);
        }
    }
    clamp(lambda, sampler);
}

/// The level of detail of every quad of a flat texture without anisotropy, not yet clamped: [`measure`] without its choices.
#[inline(always)]
pub(super) fn flat_lambda(view: &View, args: &Sample<'_>, out: &mut [f32; LANES]) {
    let mut rho = [0.0; QUADS];
    quad_rho(view, args, &mut rho);
    for r in &mut rho {
        *r = quad_lambda(*r);
    }
    for i in 0..LANES {
        out[i] = rho[i / 4];
    }
}

/// The squared length of the longer derivative of every quad, in texels of the first level.
#[inline(always)]
pub(super) fn quad_rho(view: &View, args: &Sample<'_>, out: &mut [f32; QUADS]) {
    let (u, v) = (args.coords[0].f32(), args.coords[1].f32());
    let (w, h) = (view.levels[0].size[0] as f32, view.levels[0].size[1] as f32);
    for q in 0..QUADS {
        let (x, y) = (&u[4 * q..4 * q + 4], &v[4 * q..4 * q + 4]);
        let (ux, uy) = ((x[1] - x[0]) * w, (x[2] - x[0]) * w);
        let (vx, vy) = ((y[1] - y[0]) * h, (y[2] - y[0]) * h);
        let (dx, dy) = (ux * ux + vx * vx, uy * uy + vy * vy);
        out[q] = if dx > dy { dx } else { dy };
    }
}

/// The level of detail for what [`quad_rho`] finds.
#[inline(always)]
pub(super) fn quad_lambda(rho: f32) -> f32 {
    0.5 * log2(rho)
}

/// Clamps a level of detail to the sampler's range; NaN becomes the lower bound.
#[inline(always)]
pub(super) fn clamp_one(lambda: f32, sampler: &Sampler) -> f32 {
    let lambda = if lambda > sampler.lod_min { lambda } else { sampler.lod_min };
    if lambda < sampler.lod_max { lambda } else { sampler.lod_max }
}

/// Clamps levels of detail, as [`clamp_one`].
#[inline(always)]
pub(super) fn clamp(lambda: &mut [f32; LANES], sampler: &Sampler) {
    for l in lambda {
        *l = clamp_one(*l, sampler);
    }
}

/// Measures the footprint of a pixel from the derivatives of its coordinates.
fn measure(view: &View, sampler: &Sampler, at: [f32; 3], dx: [f32; 3], dy: [f32; 3]) -> Footprint {
    let [w, h, d] = view.levels[0].size.map(|n| n as f32);
    // Derivatives in coordinates of the texture, in two dimensions but for volumes.
    let (gx, gy) = if view.is_cube() {
        let on = project(at);
        let flat = |g: [f32; 2]| [g[0], g[1], 0.0];
        (flat(on.derivative(dx)), flat(on.derivative(dy)))
    } else {
        let keep = |g: [f32; 3]| match view.dimension {
            ViewDimension::D1 => [g[0], 0.0, 0.0],
            ViewDimension::D3 => g,
            _ => [g[0], g[1], 0.0],
        };
        (keep(dx), keep(dy))
    };
    let squared = |g: [f32; 3]| (g[0] * w) * (g[0] * w) + (g[1] * h) * (g[1] * h) + (g[2] * d) * (g[2] * d);
    let (x, y) = (squared(gx), squared(gy));
    let (most, least, major) = if x > y { (x, y, gx) } else { (y, x, gy) };
    // In two dimensions anisotropy is that of [`super::ellipse`].
    if sampler.anisotropy <= 1.0 || !view.is_cube() || !most.is_finite() || most <= 0.0 {
        return Footprint { lambda: 0.5 * log2(most), probes: 1, major: [0.0; 2] };
    }
    // The ratio of the axes, at most the sampler's; an infinite one where the minor axis vanishes.
    let ratio = (most / least).sqrt();
    let eta = if ratio < sampler.anisotropy { ratio } else { sampler.anisotropy };
    let probes = eta.ceil() as u8;
    let major = if probes > 1 { [major[0], major[1]] } else { [0.0; 2] };
    Footprint { lambda: 0.5 * log2(most / (eta * eta)), probes, major }
}

/// The levels that a level of detail reads, and the weight of the second.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Levels {
    pub first: usize,
    pub second: usize,
    pub weight: f32,
    /// Whether texels of a level are filtered.
    pub linear: bool,
}

impl Levels {
    /// Chooses levels for a clamped level of detail.
    #[inline(always)]
    pub(super) fn new(lambda: f32, count: usize, sampler: &Sampler) -> Levels {
        let linear = if lambda > 0.0 { sampler.min_linear } else { sampler.mag_linear };
        let last = (count - 1) as f32;
        let d = if lambda > 0.0 { lambda } else { 0.0 };
        let d = if d < last { d } else { last };
        if sampler.mip_linear {
            let first = d as usize;
            Levels { first, second: (first + 1).min(count - 1), weight: d - first as f32, linear }
        } else {
            let first = ((d + 0.5) as usize).min(count - 1);
            Levels { first, second: first, weight: 0.0, linear }
        }
    }
}
