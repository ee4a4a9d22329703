//! Maps of what surrounds a point: the faces of a cube, and the picture in a mirror ball.

use anyhow::Result;

use super::kit::{Draw, Kit, Pass};
use super::{Scene, SceneRun};
use crate::Row;
use gfx::format::Format;
use gfx::state::ViewDimension;
use trace::command::{BoundResource, TextureDesc, ViewDesc};
use trace::record;

pub(super) const CUBE_MAP: Scene = Scene {
    name: "cube-map",
    group: "Reflection",
    what: "A cube map whose texels name their face and place, read in 16,384 directions: face and texel are those of f64. (5, -1, 2) reads +x at (0.3, 0.6).",
    fault: "directions are mirrored in z",
    play: cube_map,
};

pub(super) const SPHERE_MAP: Scene = Scene {
    name: "sphere-map",
    group: "Reflection",
    what: "Coordinates of a sphere map for directions at an angle t from the eye's: texels stretch by 1/cos^2(t/2), four times at 120 degrees.",
    fault: "coordinates are those of a parallel projection of the direction",
    play: sphere_map,
};

pub(super) const NEAR_MAP: Scene = Scene {
    name: "near-map",
    group: "Reflection",
    what: "A cube map of a round room, read for rays that begin beside its middle: as if the room were infinitely far, in the ray's direction, and where the ray meets the wall. \
           Texels are those of f64, and the error at a right angle is asin(a/R).",
    fault: "the room is twice as large",
    play: near_map,
};

const EDGE: u32 = 32;
const SIZE: [u32; 2] = [128, 128];

/// The direction that a pixel reads, in whole numbers. Pixel 0 reads (5, -1, 2).
fn direction(x: u32, y: u32) -> [f64; 3] {
    if [x, y] == [0, 0] {
        return [5.0, -1.0, 2.0];
    }
    let [a, b] = [f64::from(x), f64::from(y)];
    // Odd, even and half numbers: no two are equal, and no direction lies on an edge.
    [2.0 * a - 127.0, 2.0 * b - 126.0, (7.0 * a + 11.0 * b) % 129.0 - 64.5]
}

/// Face, and place in it from 0 to 1, by the table of OpenGL's specification.
pub(super) fn face([x, y, z]: [f64; 3]) -> (usize, [f64; 2]) {
    let [ax, ay, az] = [x, y, z].map(f64::abs);
    let (face, s, t, m) = if ax >= ay && ax >= az {
        if x > 0.0 { (0, -z, -y, ax) } else { (1, z, -y, ax) }
    } else if ay >= az {
        if y > 0.0 { (2, x, z, ay) } else { (3, x, -z, ay) }
    } else if z > 0.0 {
        (4, x, -y, az)
    } else {
        (5, -x, -y, az)
    };
    (face, [(s / m + 1.0) / 2.0, (t / m + 1.0) / 2.0])
}

fn cube_map(stage: &mut SceneRun) -> Result<()> {
    let mut kit = Kit::new("cube-map");
    let target = kit.target("target", SIZE, Format::Rgba8Unorm);
    let desc = TextureDesc { size: [EDGE, EDGE, 6], ..record::texture_2d(EDGE, EDGE, Format::Rgba8Unorm) };
    let texture = kit.card.create_texture("cube", desc);
    let texels = (0..6)
        .flat_map(|face| (0..EDGE * EDGE).flat_map(move |t| [8 * (t % EDGE) as u8, 8 * (t / EDGE) as u8, 50 * face, 255]));
    kit.card.write_level(texture, 0, "cube", &texels.collect::<Vec<u8>>());
    let view = kit.card.create_view_of(texture, ViewDesc { dimension: Some(ViewDimension::Cube), ..ViewDesc::default() });
    let sampler = kit.sampler(Default::default());
    let mirrored = if stage.fault() { "-1.0" } else { "1.0" };
    let source = format!(
        "@group(0) @binding(0) var cube: texture_cube<f32>;
        @group(0) @binding(1) var s: sampler;
        @fragment fn fs(@builtin(position) at: vec4f) -> @location(0) vec4f {{
            let p = floor(at.xy);
            let z = f32((7u * u32(p.x) + 11u * u32(p.y)) % 129u) - 64.5;
            let d = select(vec3f(2.0 * p - vec2f(127.0, 126.0), z), vec3f(5.0, -1.0, 2.0), all(p == vec2f(0.0)));
            return textureSampleLevel(cube, s, d * vec3f(1.0, 1.0, {mirrored}), 0.0);
        }}"
    );
    let show = Draw::cover(&source).with([BoundResource::View(view), sampler]);
    kit.pass(&Pass { color: vec![(target, Some([0.0; 4]))], ..Pass::default() }, &[show]);
    kit.present(target);
    let frames = stage.show(&kit.finish())?;
    let (mut faces, mut texels) = (0, 0);
    for (x, y) in frames[0].places() {
        let (face, place) = face(direction(x, y));
        let [r, g, b, _] = frames[0].rgba(x, y);
        faces += u64::from(b != 50 * face as u8);
        // A place on the border of two texels may be read in either.
        let near = |code: u8, place: f64| (place * f64::from(EDGE) - f64::from(code / 8) - 0.5).abs() <= 0.5 + 1e-4;
        texels += u64::from(b == 50 * face as u8 && !(near(r, place[0]) && near(g, place[1])));
    }
    stage.row(Row::none("directions that read another face", faces));
    stage.row(Row::none("directions that read another texel", texels));
    let [r, g, b, _] = frames[0].rgba(0, 0);
    for (name, expected, code) in
        [("face", 0.0, f64::from(b) / 50.0), ("s", 0.3, f64::from(r / 8) + 0.5), ("t", 0.6, f64::from(g / 8) + 0.5)]
    {
        let (measured, allowed) = if name == "face" { (code, 0.0) } else { (code / f64::from(EDGE), 0.5 / f64::from(EDGE)) };
        stage.row(Row::within(format!("(5, -1, 2): {name}"), expected, measured, allowed));
    }
    Ok(())
}

fn sphere_map(stage: &mut SceneRun) -> Result<()> {
    let mut kit = Kit::new("sphere-map");
    let picture = kit.target("picture", [160, 64], Format::Rgba8Unorm);
    let target = kit.target("target", [160, 2], Format::Rg32Float);
    let half = if stage.fault() {
        "d.xy / 2.0 + 0.5"
    } else {
        "d.xy / (2.0 * sqrt(d.x * d.x + d.y * d.y + (d.z + 1.0) * (d.z + 1.0))) + 0.5"
    };
    let coordinates = format!(
        "fn coordinates(t: f32, a: f32) -> vec2f {{
            let d = vec3f(sin(t) * cos(a), sin(t) * sin(a), cos(t));
            return {half};
        }}"
    );
    let checks = format!(
        "{coordinates}
        @fragment fn fs(@builtin(position) at: vec4f) -> @location(0) vec4f {{
            let c = floor(32.0 * coordinates(radians(at.x), at.y / 64.0 * 6.2831853));
            return vec4f(vec3f(0.2 + 0.6 * ((c.x + c.y) % 2.0)), 1.0);
        }}"
    );
    kit.pass(&Pass { color: vec![(picture, Some([0.0; 4]))], ..Pass::default() }, &[Draw::cover(&checks)]);
    kit.present(picture);
    // Row 0 at azimuth 0; row 1 a hundredth of a radian on.
    let source = format!(
        "{coordinates}
        @fragment fn fs(@builtin(position) at: vec4f) -> @location(0) vec4f {{
            return vec4f(coordinates(radians(floor(at.x)), 0.01 * floor(at.y)), 0.0, 0.0);
        }}"
    );
    kit.pass(&Pass { color: vec![(target, Some([0.0; 4]))], ..Pass::default() }, &[Draw::cover(&source)]);
    kit.present(target);
    let frames = stage.show(&kit.finish())?;
    for degrees in [30, 60, 90, 120, 150_u32] {
        let at = |x: u32, y: u32| [0, 1].map(|c| f64::from(frames[1].float(x, y, c)));
        let apart = |a: [f64; 2], b: [f64; 2]| libm::hypot(a[0] - b[0], a[1] - b[1]);
        let t = f64::from(degrees).to_radians();
        // Along the angle and around the axis, in coordinates per radian.
        let along = apart(at(degrees + 1, 0), at(degrees - 1, 0)) / 2.0_f64.to_radians();
        let around = apart(at(degrees, 1), at(degrees, 0)) / (0.01 * libm::sin(t));
        let half = libm::cos(t / 2.0);
        stage.row(Row::within(
            format!("stretch at {degrees} degrees"),
            1.0 / (half * half),
            around / along,
            0.01 / (half * half),
        ));
    }
    Ok(())
}

/// A ray at (0, 0, a) towards (cos t, 0, sin t) on +x: where it meets a sphere of radius 2 around the middle.
fn meets_wall(a: f64, t: f64) -> [f64; 3] {
    let d = [libm::cos(t), libm::sin(t)];
    let along = a * d[1];
    let far = (along * along + 4.0 - a * a).sqrt() - along;
    [far * d[0], 0.0, a + far * d[1]]
}

fn near_map(stage: &mut SceneRun) -> Result<()> {
    const FINE: u32 = 128;
    let mut kit = Kit::new("near-map");
    let target = kit.target("target", SIZE, Format::Rgba8Unorm);
    let desc = TextureDesc { size: [FINE, FINE, 6], ..record::texture_2d(FINE, FINE, Format::R8Unorm) };
    let texture = kit.card.create_texture("cube", desc);
    // Texels name their column; they are drawn, so that the recording is small.
    let column = "@fragment fn fs(@builtin(position) at: vec4f) -> @location(0) vec4f { return vec4f(floor(at.x) / 255.0); }";
    for layer in 0..6 {
        let view = ViewDesc { base_layer: layer, layers: Some(1), ..ViewDesc::default() };
        let view = kit.card.create_view_of(texture, view);
        let face = super::kit::Target { texture, view, format: Format::R8Unorm, samples: 1 };
        kit.pass(&Pass { color: vec![(face, Some([0.0; 4]))], ..Pass::default() }, &[Draw::cover(column)]);
    }
    let view = kit.card.create_view_of(texture, ViewDesc { dimension: Some(ViewDimension::Cube), ..ViewDesc::default() });
    let sampler = kit.sampler(Default::default());
    let square = if stage.fault() { "16.0" } else { "4.0" };
    let source = format!(
        "@group(0) @binding(0) var cube: texture_cube<f32>;
        @group(0) @binding(1) var s: sampler;
        @fragment fn fs(@builtin(position) at: vec4f) -> @location(0) vec4f {{
            let a = floor(at.x) / 128.0;
            let t = (floor(at.y) - 80.0) / 128.0;
            let d = vec3f(cos(t), 0.0, sin(t));
            let along = a * d.z;
            let p = vec3f(0.0, 0.0, a) + d * (sqrt(along * along + {square} - a * a) - along);
            let far = textureSampleLevel(cube, s, d, 0.0).r;
            let near = textureSampleLevel(cube, s, p, 0.0).r;
            return vec4f(far, near, abs(far - near), 1.0);
        }}"
    );
    let show = Draw::cover(&source).with([BoundResource::View(view), sampler]);
    kit.pass(&Pass { color: vec![(target, Some([0.0; 4]))], ..Pass::default() }, &[show]);
    kit.present(target);
    let frames = stage.show(&kit.finish())?;
    let (mut wrong, mut worst) = ([0; 2], [0.0_f64; 2]);
    for (x, y) in frames[0].places() {
        let (a, t) = (f64::from(x) / 128.0, (f64::from(y) - 80.0) / 128.0);
        let directions = [[libm::cos(t), 0.0, libm::sin(t)], meets_wall(a, t)];
        let codes = [0, 1].map(|k| f64::from(frames[0].rgba(x, y)[k]));
        for k in 0..2 {
            let (own, [s, _]) = face(directions[k]);
            // A place on the border of two texels may be read in either.
            wrong[k] += u64::from(own == 0 && (s * f64::from(FINE) - codes[k] - 0.5).abs() > 0.5 + 1e-4);
        }
        // On +x, -z grows with s: the angle is that of a texel's middle.
        if directions.iter().all(|&d| face(d).0 == 0) {
            let angle = |code: f64| -libm::atan(2.0 * (code + 0.5) / f64::from(FINE) - 1.0);
            let off = |[a, b]: [f64; 2]| (a - b).abs().to_degrees();
            worst[0] = worst[0].max(off(directions.map(|d| libm::atan2(d[2], d[0]))));
            worst[1] = worst[1].max(off(codes.map(angle)));
        }
    }
    stage.row(Row::none("infinitely far: texels that are not those of f64", wrong[0]));
    stage.row(Row::none("where the wall is met: texels that are not those of f64", wrong[1]));
    stage.row(Row::within("largest error of the angle on +x, in degrees", worst[0], worst[1], 1.0));
    // Straight on, at a right angle to the way from the middle: row 80, one pixel from the right end.
    let a = 127.0 / 128.0;
    let [far, near] = [0, 1].map(|k| f64::from(frames[0].rgba(127, 80)[k]));
    let angle = |code: f64| libm::atan(2.0 * (code + 0.5) / f64::from(FINE) - 1.0).to_degrees();
    stage.row(Row::within(
        "error at a right angle, in degrees",
        libm::asin(a / 2.0).to_degrees(),
        angle(far) - angle(near),
        1.0,
    ));
    stage.answer(
        "What is the error of a map that is taken to be infinitely far?",
        format!("At half the way to the wall up to {:.1} degrees, asin(a/R) at a right angle.", worst[0]),
    );
    Ok(())
}
