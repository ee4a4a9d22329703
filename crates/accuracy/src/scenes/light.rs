//! Light by formulas, pixel by pixel, against the same formulas in f64.

use anyhow::Result;

use super::kit::{Draw, Kit, Pass};
use super::{Scene, SceneRun};
use crate::Row;
use gfx::format::Format;
use glam::{DVec3, dvec3};
use trace::Trace;

pub(super) const LIGHTS: Scene = Scene {
    name: "lights",
    group: "Light",
    what: "A plane under a directional, a point and a spot light, with ambient, diffuse, specular and emissive parts and 1/(a0 + a1 d + a2 d^2): within a code of \
           f64.",
    fault: "the point light does not weaken with the distance",
    play: lights,
};

pub(super) const FOG: Scene = Scene {
    name: "fog",
    group: "Light",
    what: "Six bands of fog: linear, exp and exp^2, of depth and of range: within a code of f64. So are three bands whose fog is that of vertices, 64 pixels apart.",
    fault: "exp^2 is exp",
    play: fog,
};

pub(super) const LOBES: Scene = Scene {
    name: "lobes",
    group: "Light",
    what: "Phong's lobe with exponent e and Blinn's with 4e, over the angle between the eye and the mirrored light, at normal incidence: the largest difference that \
           the card draws is the constant of each exponent.",
    fault: "Blinn's exponent is 3e",
    play: lobes,
};

pub(super) const SHADING: Scene = Scene {
    name: "shading",
    group: "Light",
    what: "A highlight inside one triangle: Phong shading shows it, flat and Gouraud shading have what the corners have, which is nothing.",
    fault: "normals of Gouraud shading are those of the middle",
    play: shading,
};

const SIZE: [u32; 2] = [128, 128];

fn covered(name: &str, size: [u32; 2], fragment: &str) -> Trace {
    let mut kit = Kit::new(name);
    let target = kit.target("target", size, Format::Rgba8Unorm);
    kit.pass(&Pass { color: vec![(target, Some([0.0; 4]))], ..Pass::default() }, &[Draw::cover(fragment)]);
    kit.present(target);
    kit.finish()
}

/// Diffuse and specular light of a plane with normal z, towards an eye.
fn parts(p: DVec3, to_light: DVec3, eye: DVec3) -> [f64; 2] {
    let (l, v) = (to_light.normalize(), (eye - p).normalize());
    let h = (l + v).normalize();
    [l.z.max(0.0), libm::pow(h.z.max(0.0), 20.0)]
}

fn lights(stage: &mut SceneRun) -> Result<()> {
    let falls = if stage.fault() { "1.0" } else { "1.0 / (0.5 + 0.3 * d + 0.4 * d * d)" };
    let source = format!(
        "fn parts(p: vec3f, to_light: vec3f) -> vec2f {{
            let l = normalize(to_light);
            let h = normalize(l + normalize(vec3f(0.0, 0.0, 3.0) - p));
            return vec2f(max(l.z, 0.0), pow(max(h.z, 0.0), 20.0));
        }}
        @fragment fn fs(@builtin(position) at: vec4f) -> @location(0) vec4f {{
            let p = vec3f(at.xy / 64.0 - 1.0, 0.0);
            var sum = vec3f(0.05, 0.04, 0.06) + vec3f(0.0, 0.02, 0.0);
            let sun = parts(p, vec3f(1.0, 2.0, 2.0));
            sum += vec3f(0.25, 0.2, 0.1) * sun.x + vec3f(0.1) * sun.y;
            let to_point = vec3f(-0.5, -0.4, 0.6) - p;
            let d = length(to_point);
            let point = parts(p, to_point) * ({falls});
            sum += vec3f(0.1, 0.2, 0.3) * point.x + vec3f(0.2) * point.y;
            let to_spot = vec3f(0.5, 0.5, 1.0) - p;
            let cone = normalize(to_spot).z;
            let spot = parts(p, to_spot) * pow(cone, 8.0);
            sum += vec3f(0.3, 0.1, 0.1) * spot.x + vec3f(0.1) * spot.y;
            return vec4f(sum, 1.0);
        }}"
    );
    let frames = stage.show(&covered("lights", SIZE, &source))?;
    let exact = |x: u32, y: u32| {
        let p = dvec3((f64::from(x) + 0.5) / 64.0 - 1.0, (f64::from(y) + 0.5) / 64.0 - 1.0, 0.0);
        let eye = 3.0 * DVec3::Z;
        let sun = parts(p, dvec3(1.0, 2.0, 2.0), eye);
        let to_point = dvec3(-0.5, -0.4, 0.6) - p;
        let d = to_point.length();
        let point = parts(p, to_point, eye).map(|part| part / (0.5 + 0.3 * d + 0.4 * d * d));
        let to_spot = dvec3(0.5, 0.5, 1.0) - p;
        let cone = libm::pow(to_spot.normalize().z, 8.0);
        let spot = parts(p, to_spot, eye).map(|part| part * cone);
        let colors = [[0.25, 0.1, 0.3], [0.2, 0.2, 0.1], [0.1, 0.3, 0.1]];
        let own = [0.05, 0.06, 0.06];
        std::array::from_fn(|c| {
            own[c]
                + colors[c][0] * sun[0]
                + colors[c][1] * point[0]
                + colors[c][2] * spot[0]
                + 0.1 * sun[1]
                + 0.2 * point[1]
                + 0.1 * spot[1]
        })
    };
    stage.row(Row::at_most("largest difference from f64, in codes", frames[0].worst(exact), 1.0));
    Ok(())
}

fn fog(stage: &mut SceneRun) -> Result<()> {
    let square = if stage.fault() { "1.0" } else { "t" };
    let source = format!(
        "@fragment fn fs(@builtin(position) at: vec4f) -> @location(0) vec4f {{
            let band = u32(at.y) / 16u;
            let z = 1.0 + at.x / 32.0;
            let side = (at.y % 16.0) / 8.0;
            let far = select(z, length(vec2f(z, side)), band >= 3u);
            let t = 0.4 * far;
            var f = (5.0 - far) / 4.0;
            if band % 3u == 1u {{ f = exp(-t); }}
            if band % 3u == 2u {{ f = exp(-t * {square}); }}
            return vec4f(mix(vec3f(0.7, 0.8, 0.9), vec3f(0.9, 0.2, 0.1), clamp(f, 0.0, 1.0)), 1.0);
        }}"
    );
    let frames = stage.show(&covered("fog", [128, 96], &source))?;
    let exact = |x: u32, y: u32| {
        let (band, z) = (y / 16, 1.0 + (f64::from(x) + 0.5) / 32.0);
        let side = (f64::from(y % 16) + 0.5) / 8.0;
        let far = if band >= 3 { libm::hypot(z, side) } else { z };
        let t = 0.4 * far;
        let f = [(5.0 - far) / 4.0, libm::exp(-t), libm::exp(-t * t)][(band % 3) as usize].clamp(0.0, 1.0);
        let (fog, own) = ([0.7, 0.8, 0.9], [0.9, 0.2, 0.1]);
        std::array::from_fn(|c| fog[c] + f * (own[c] - fog[c]))
    };
    stage.row(Row::at_most("largest difference from f64, in codes", frames[0].worst(exact), 1.0));
    by_vertex(stage)
}

/// Fog of depth that is found at vertices, and what that leaves out.
fn by_vertex(stage: &mut SceneRun) -> Result<()> {
    let square = if stage.fault() { "1.0" } else { "t" };
    let source = format!(
        "struct Vertex {{ @builtin(position) at: vec4f, @location(0) f: f32 }}
        @vertex fn vs(@location(0) at: vec4f) -> Vertex {{
            let t = 0.4 * at.z;
            var f = (5.0 - at.z) / 4.0;
            if at.w == 1.0 {{ f = exp(-t); }}
            if at.w == 2.0 {{ f = exp(-t * {square}); }}
            return Vertex(vec4f(at.xy, 0.5, 1.0), clamp(f, 0.0, 1.0));
        }}
        @fragment fn fs(v: Vertex) -> @location(0) vec4f {{ return vec4f(mix(vec3f(0.7, 0.8, 0.9), vec3f(0.9, 0.2, 0.1), v.f), 1.0); }}"
    );
    let mut vertices: Vec<f32> = Vec::new();
    for (band, piece) in (0..3).flat_map(|band| (0..2).map(move |piece| (band as f32, piece as f32))) {
        for [i, j] in [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [0.0, 1.0], [1.0, 0.0], [1.0, 1.0]] {
            // 32 pixels are one unit of depth.
            let [x, y]: [f32; 2] = [piece + i, band + j];
            vertices.extend([x - 1.0, 1.0 - y * 2.0 / 3.0, 1.0 + 2.0 * x, band]);
        }
    }
    let mut kit = Kit::new("fog");
    let target = kit.target("target", [128, 48], Format::Rgba8Unorm);
    kit.pass(&Pass { color: vec![(target, Some([0.0; 4]))], ..Pass::default() }, &[Draw::list(source, 1, vertices)]);
    kit.present(target);
    let frames = stage.frames(&kit.finish())?;
    let factor = |band: u32, z: f64| {
        let t = 0.4 * z;
        [(5.0 - z) / 4.0, libm::exp(-t), libm::exp(-t * t)][band as usize].clamp(0.0, 1.0)
    };
    let color = |f: f64| {
        let (fog, own) = ([0.7, 0.8, 0.9], [0.9, 0.2, 0.1]);
        std::array::from_fn(|c| fog[c] + f * (own[c] - fog[c]))
    };
    let depth = |x: u32| 1.0 + (f64::from(x) + 0.5) / 32.0;
    let straight = |x: u32, y: u32| {
        let left = f64::from(x / 64 * 2) + 1.0;
        let [from, to] = [factor(y / 16, left), factor(y / 16, left + 2.0)];
        color(from + (depth(x) - left) / 2.0 * (to - from))
    };
    stage.row(Row::at_most("by vertex: largest difference from f64, in codes", frames[0].worst(straight), 1.0));
    let by_pixel = |x: u32, y: u32| color(factor(y / 16, depth(x)));
    let off = frames[0]
        .places()
        .map(|(x, y)| {
            let (a, b): ([f64; 3], [f64; 3]) = (straight(x, y), by_pixel(x, y));
            (0..3).map(|c| 255.0 * (a[c] - b[c]).abs()).fold(0.0, f64::max)
        })
        .fold(0.0, f64::max);
    stage.row(Row::within("by vertex: largest difference from fog by pixel, in codes", off, frames[0].worst(by_pixel), 1.0));
    stage.answer(
        "Fog by vertex or by pixel?",
        format!("With vertices 64 pixels apart fog by vertex is {off:.1} codes off at worst."),
    );
    Ok(())
}

fn lobes(stage: &mut SceneRun) -> Result<()> {
    let mut kit = Kit::new("lobes");
    let factor = if stage.fault() { "3.0" } else { "4.0" };
    let lobes = format!(
        "fn lobes(t: f32, e: f32) -> vec2f {{ return vec2f(pow(max(cos(t), 0.0), e), pow(max(cos(t / 2.0), 0.0), {factor} * e)); }}"
    );
    let picture = format!(
        "{lobes}
        @fragment fn fs(@builtin(position) at: vec4f) -> @location(0) vec4f {{
            let f = lobes(radians(at.x - 100.0), 10.0);
            let y = 1.0 - at.y / 100.0;
            return vec4f(f32(y < f.x), f32(y < f.y), 0.2, 1.0);
        }}"
    );
    let target = kit.target("picture", [200, 100], Format::Rgba8Unorm);
    kit.pass(&Pass { color: vec![(target, Some([0.0; 4]))], ..Pass::default() }, &[Draw::cover(&picture)]);
    kit.present(target);
    let source = format!(
        "{lobes}
        @fragment fn fs(@builtin(position) at: vec4f) -> @location(0) vec4f {{
            var exponents = array(5.0, 10.0, 20.0, 50.0);
            let f = lobes(radians(at.x * 0.25), exponents[u32(at.y)]);
            return vec4f(abs(f.x - f.y), f.x, f.y, 0.0);
        }}"
    );
    let values = kit.target("values", [360, 4], Format::Rgba32Float);
    kit.pass(&Pass { color: vec![(values, Some([0.0; 4]))], ..Pass::default() }, &[Draw::cover(&source)]);
    kit.present(values);
    let frames = stage.show(&kit.finish())?;
    for (row, (e, constant)) in (0..).zip([(5, 0.0301), (10, 0.0142), (20, 0.0069), (50, 0.0027)]) {
        let worst = (0..360).map(|x| f64::from(frames[1].float(x, row, 0))).fold(0.0, f64::max);
        stage.row(Row::within(format!("largest difference, e = {e}"), constant, worst, 0.00006));
    }
    Ok(())
}

fn shading(stage: &mut SceneRun) -> Result<()> {
    // Corners, and normals that lean outwards: in the middle they add up to z, which mirrors the light to the eye.
    let lean = if stage.fault() { 0.0 } else { 1.0 };
    let corners = [[-0.9_f32, -0.9], [0.9, -0.9], [0.0, 0.9]];
    let normals = |lean: f32| -> Vec<f32> {
        let vertex = |[x, y]: [f32; 2]| [x, y, 0.5, 1.0, lean * x, lean * (y + 0.3), 1.0, 0.0];
        corners.into_iter().flat_map(vertex).collect()
    };
    let light = "fn light(n: vec3f) -> vec4f { return vec4f(vec3f(0.1 + 0.9 * pow(normalize(n).z, 60.0)), 1.0); }";
    let phong = format!(
        "{light}
        struct Vertex {{ @builtin(position) at: vec4f, @location(0) n: vec3f }}
        @vertex fn vs(@location(0) at: vec4f, @location(1) n: vec4f) -> Vertex {{ return Vertex(at, n.xyz); }}
        @fragment fn fs(v: Vertex) -> @location(0) vec4f {{ return light(v.n); }}"
    );
    let gouraud = |flat: &str| {
        format!(
            "{light}
            struct Vertex {{ @builtin(position) at: vec4f, @location(0) {flat} color: vec4f }}
            @vertex fn vs(@location(0) at: vec4f, @location(1) n: vec4f) -> Vertex {{ return Vertex(at, light(n.xyz)); }}
            @fragment fn fs(v: Vertex) -> @location(0) vec4f {{ return v.color; }}"
        )
    };
    let one = |source: &str, lean: f32| {
        let mut kit = Kit::new("shading");
        let target = kit.target("target", SIZE, Format::Rgba8Unorm);
        let draw = Draw::list(source, 2, normals(lean));
        kit.pass(&Pass { color: vec![(target, Some([0.0, 0.0, 0.3, 1.0]))], ..Pass::default() }, &[draw]);
        kit.present(target);
        kit.finish()
    };
    let traces = [one(&phong, 1.0), one(&gouraud(""), lean), one(&gouraud("@interpolate(flat)"), lean)];
    let frames = stage.show(&traces[0])?;
    let brightest = |image: &super::Image| image.places().map(|(x, y)| image.rgba(x, y)[0]).max().unwrap_or(0);
    let of = |[x, y]: [f64; 2]| 255.0 * (0.1 + 0.9 * libm::pow(dvec3(x, y + 0.3, 1.0).normalize().z, 60.0));
    let corner = corners.iter().map(|c| of([f64::from(c[0]), f64::from(c[1])])).fold(0.0, f64::max);
    stage.row(Row::within("brightest code, Phong shading", 255.0, f64::from(brightest(&frames[0])), 1.0));
    for (name, trace) in [("Gouraud", &traces[1]), ("flat", &traces[2])] {
        let image = stage.frames(trace)?;
        stage.row(Row::at_most(
            format!("brightest code less that of the brightest corner, {name}"),
            (f64::from(brightest(&image[0])) - corner).max(0.0),
            1.0,
        ));
    }
    if !stage.fault() {
        let [phong, gouraud, _] = &traces;
        let alu = |trace| stage.time(trace, &[]).map(|run| run.0);
        let (phong, gouraud) = (alu(phong)?, alu(gouraud)?);
        stage.row(Row::at_least("cycles of Phong over Gouraud shading", 1.0, phong / gouraud));
        stage.answer("Gouraud or Phong shading?", format!("Gouraud shading takes {gouraud} cycles, Phong shading {phong}."));
    }
    Ok(())
}
