//! Heights, rotations, cylinders, light in space, and two eyes.

use anyhow::Result;

use super::kit::{COLORED, Draw, Kit, Pass};
use super::{Image, Scene, SceneRun};
use crate::Row;
use gfx::format::Format;
use gfx::state::{FilterMode, SamplerDesc, TextureDimension};
use glam::{DMat3, DVec3, dvec3};
use num::Random;
use trace::Trace;
use trace::command::{BoundResource, TextureDesc};
use trace::record;

pub(super) const BUMP: Scene = Scene {
    name: "bump",
    group: "Light",
    what: "Normals from a texture of 64 by 64 heights by central differences, under a directional light: within a code of f64.",
    fault: "slopes have the other sign",
    play: bump,
};

pub(super) const QUATERNIONS: Scene = Scene {
    name: "quaternions",
    group: "Light",
    what: "A vector turned by the slerp of two quaternions, one step a column, its coordinates as a colour: within a code of f64.",
    fault: "quaternions are mixed linearly and not normalised",
    play: quaternions,
};

pub(super) const CYLINDER: Scene = Scene {
    name: "cylinder",
    group: "Light",
    what: "An image around a cylinder, which rays from the eye meet: its coordinates are the angle and the height, within a code of f64.",
    fault: "the angle is the side coordinate alone",
    play: cylinder,
};

pub(super) const ROOM: Scene = Scene {
    name: "room",
    group: "Light",
    what: "Light that falls off with the square of the distance, in a 3D texture of 8 by 8 by 8, filtered: within a code of the trilinear mean of its texels in f64.",
    fault: "the texture is not filtered",
    play: room,
};

pub(super) const STEREO: Scene = Scene {
    name: "stereo",
    group: "Sampling",
    what: "Three squares for a red and a cyan eye: their centres are f e (1/z - 1/z0) pixels apart, within half a pixel.",
    fault: "the eyes are half as far apart",
    play: stereo,
};

const SIZE: [u32; 2] = [128, 96];

fn covered(kit: &mut Kit, source: &str, resources: Vec<BoundResource>) {
    let target = kit.target("target", SIZE, Format::Rgba8Unorm);
    kit.pass(&Pass { color: vec![(target, Some([0.0; 4]))], ..Pass::default() }, &[Draw::cover(source).with(resources)]);
    kit.present(target);
}

fn compare(stage: &mut SceneRun, trace: &Trace, exact: impl FnMut(u32, u32) -> [f64; 3]) -> Result<Image> {
    let mut frames = stage.show(trace)?;
    stage.row(Row::at_most("largest difference from f64, in codes", frames[0].worst(exact), 1.0));
    Ok(frames.remove(0))
}

fn bump(stage: &mut SceneRun) -> Result<()> {
    let mut kit = Kit::new("bump");
    let mut random = Random::new(9);
    let heights: Vec<u8> = (0..64 * 64).map(|_| (random.bits() >> 24) as u8).collect();
    let texture = kit.texture("heights", record::texture_2d(64, 64, Format::R8Unorm));
    kit.card.write_level(texture.texture, 0, "heights", &heights);
    let sign = if stage.fault() { "1.0" } else { "-1.0" };
    let source = format!(
        "@group(0) @binding(0) var heights: texture_2d<f32>;
        fn height(p: vec2i) -> f32 {{ return textureLoad(heights, p & vec2i(63), 0).r; }}
        @fragment fn fs(@builtin(position) at: vec4f) -> @location(0) vec4f {{
            let p = vec2i(at.xy) / 2;
            let dx = (height(p + vec2i(1, 0)) - height(p - vec2i(1, 0))) * 0.5;
            let dy = (height(p + vec2i(0, 1)) - height(p - vec2i(0, 1))) * 0.5;
            let n = normalize(vec3f(vec2f(dx, dy) * {sign}, 1.0));
            return vec4f(vec3f(0.9, 0.8, 0.6) * max(dot(n, normalize(vec3f(1.0, 1.0, 1.0))), 0.0), 1.0);
        }}"
    );
    covered(&mut kit, &source, vec![texture.bound()]);
    compare(stage, &kit.finish(), |x, y| {
        let height = |x: u32, y: u32| f64::from(heights[(64 * (y & 63) + (x & 63)) as usize]) / 255.0;
        let (x, y) = (x / 2 + 64, y / 2 + 64);
        let [dx, dy] = [(height(x + 1, y) - height(x - 1, y)) / 2.0, (height(x, y + 1) - height(x, y - 1)) / 2.0];
        let light = dvec3(-dx, -dy, 1.0).normalize().dot(DVec3::ONE.normalize()).max(0.0);
        (dvec3(0.9, 0.8, 0.6) * light).to_array()
    })?;
    Ok(())
}

fn quaternions(stage: &mut SceneRun) -> Result<()> {
    let mut kit = Kit::new("quaternions");
    let mix = if stage.fault() { "a * (1.0 - t) + b * t" } else { "(a * sin((1.0 - t) * w) + b * sin(t * w)) / sin(w)" };
    // From no turn to 150 degrees about an axis.
    let source = format!(
        "@fragment fn fs(@builtin(position) at: vec4f) -> @location(0) vec4f {{
            let t = at.x / 128.0;
            let a = vec4f(0.0, 0.0, 0.0, 1.0);
            let w = radians(75.0);
            let b = vec4f(normalize(vec3f(1.0, 2.0, 2.0)) * sin(w), cos(w));
            let q = {mix};
            let v = normalize(vec3f(1.0, at.y / 96.0, 0.2));
            let u = cross(q.xyz, v) * 2.0;
            return vec4f((v + q.w * u + cross(q.xyz, u)) * 0.5 + 0.5, 1.0);
        }}"
    );
    covered(&mut kit, &source, Vec::new());
    compare(stage, &kit.finish(), |x, y| {
        // A slerp from no turn is a turn by a part of the angle.
        let angle = 150.0_f64.to_radians() * (f64::from(x) + 0.5) / 128.0;
        let turn = DMat3::from_axis_angle(dvec3(1.0, 2.0, 2.0) / 3.0, angle);
        let v = dvec3(1.0, (f64::from(y) + 0.5) / 96.0, 0.2).normalize();
        (0.5 + 0.5 * (turn * v)).to_array()
    })?;
    Ok(())
}

fn cylinder(stage: &mut SceneRun) -> Result<()> {
    let mut kit = Kit::new("cylinder");
    let angle = if stage.fault() { "p.x" } else { "atan2(p.x, -p.z)" };
    // The eye at z = -3, a cylinder of radius 1 around y.
    let source = format!(
        "@fragment fn fs(@builtin(position) at: vec4f) -> @location(0) vec4f {{
            let d = vec3f((at.x - 64.0) / 160.0, (48.0 - at.y) / 96.0, 1.0);
            let a = d.x * d.x + 1.0;
            let h = 9.0 - a * 8.0;
            if h < 0.05 {{ return vec4f(0.0, 0.0, 0.0, 1.0); }}
            let p = d * ((3.0 - sqrt(h)) / a) + vec3f(0.0, 0.0, -3.0);
            let u = {angle};
            return vec4f(0.5 + 0.5 * sin(3.0 * u), 0.5 + 0.4 * p.y, 0.5 + 0.5 * cos(2.0 * u), 1.0);
        }}"
    );
    covered(&mut kit, &source, Vec::new());
    let image = compare(stage, &kit.finish(), |x, y| {
        let d = [(f64::from(x) + 0.5 - 64.0) / 160.0, (48.0 - f64::from(y) - 0.5) / 96.0];
        let a = d[0] * d[0] + 1.0;
        let h = 9.0 - a * 8.0;
        if h < 0.05 {
            return [0.0; 3];
        }
        let t = (3.0 - h.sqrt()) / a;
        let u = libm::atan2(d[0] * t, 3.0 - t);
        [0.5 + 0.5 * libm::sin(3.0 * u), 0.5 + 0.4 * d[1] * t, 0.5 + 0.5 * libm::cos(2.0 * u)]
    })?;
    let on = image.places().filter(|&(x, y)| image.rgba(x, y)[..3] != [0; 3]).count() as f64;
    stage.row(Row::at_least("pixels of the cylinder", 5_000.0, on));
    Ok(())
}

fn room(stage: &mut SceneRun) -> Result<()> {
    let mut kit = Kit::new("room");
    let light = |x: u32, y: u32, z: u32| -> u8 {
        let [a, b, c] = [x, y, z].map(|c| f64::from(c) / 7.0);
        let square = (a - 0.3) * (a - 0.3) + (b - 0.6) * (b - 0.6) + (c - 0.4) * (c - 0.4);
        libm::round(255.0 * 0.2 / (0.2 + square)) as u8
    };
    let desc = TextureDesc { dimension: TextureDimension::D3, size: [8; 3], ..record::texture_2d(8, 8, Format::R8Unorm) };
    let texture = kit.texture("room", desc);
    let texels: Vec<u8> = (0..512).map(|t| light(t % 8, t / 8 % 8, t / 64)).collect();
    kit.card.write_level(texture.texture, 0, "room", &texels);
    let filter = if stage.fault() { FilterMode::Nearest } else { FilterMode::Linear };
    let sampler = kit.sampler(SamplerDesc { mag: filter, min: filter, ..SamplerDesc::default() });
    let source = "@group(0) @binding(0) var room: texture_3d<f32>;
        @group(0) @binding(1) var s: sampler;
        @fragment fn fs(@builtin(position) at: vec4f) -> @location(0) vec4f {
            let p = vec3f(at.xy / vec2f(128.0, 96.0), 0.3 + 0.4 * at.x / 128.0);
            return vec4f(vec3f(1.0, 0.9, 0.6) * textureSampleLevel(room, s, p, 0.0).r, 1.0);
        }";
    covered(&mut kit, source, vec![texture.bound(), sampler]);
    compare(stage, &kit.finish(), |x, y| {
        let u = (f64::from(x) + 0.5) / 128.0;
        let place = [u, (f64::from(y) + 0.5) / 96.0, 0.3 + 0.4 * u].map(|c| (8.0 * c - 0.5).clamp(0.0, 7.0));
        let mut sum = 0.0;
        for corner in 0..8_u32 {
            let (mut weight, mut texel) = (1.0, [0; 3]);
            for k in 0..3 {
                let (low, upper) = (place[k].floor(), corner >> k & 1);
                let part = place[k] - low;
                weight *= if upper == 1 { part } else { 1.0 - part };
                texel[k] = (low as u32 + upper).min(7);
            }
            sum += weight * f64::from(light(texel[0], texel[1], texel[2])) / 255.0;
        }
        [sum, 0.9 * sum, 0.6 * sum]
    })?;
    Ok(())
}

fn stereo(stage: &mut SceneRun) -> Result<()> {
    let mut kit = Kit::new("stereo");
    let target = kit.target("target", SIZE, Format::Rgba8Unorm);
    // Focal length in pixels, distance of the eyes, and the depth of the screen.
    let (focal, apart, screen) = (64.0_f32, 0.4_f32, 4.0_f32);
    let drawn = if stage.fault() { apart / 2.0 } else { apart };
    let squares = [(-1.0_f32, 0.9_f32, 3.0_f32), (0.5, 0.0, 4.0), (1.5, -2.0, 7.0)];
    let draws: Vec<Draw> = [(-1.0_f32, 1_u8), (1.0, 6)]
        .into_iter()
        .map(|(eye, mask)| {
            let mut all = Vec::new();
            for (x, y, z) in squares {
                for [i, j] in [[0, 0], [1, 0], [0, 1], [0, 1], [1, 0], [1, 1]] {
                    let [dx, dy] = [i, j].map(|c| (c as f32 - 0.5) * 0.2 * z);
                    // An eye to the side sees through a window that is moved the other way.
                    let side = eye * drawn / 2.0;
                    let px = focal * ((x + dx - side) / z + side / screen);
                    let py = focal * (y + dy) / z;
                    all.extend([px / 64.0, py / 48.0, 0.5, 1.0, 1.0, 1.0, 1.0, 1.0]);
                }
            }
            Draw { mask, ..Draw::list(COLORED, 2, all) }
        })
        .collect();
    kit.pass(&Pass { color: vec![(target, Some([0.0, 0.0, 0.0, 1.0]))], ..Pass::default() }, &draws);
    kit.present(target);
    let frames = stage.show(&kit.finish())?;
    for (x, y, z) in squares {
        let row = (48.0 - focal * y / z) as u32;
        let middle = |channel: usize| {
            // Of the pixels of the row that are nearer to this square than to others.
            let near = |c: &u32| (f64::from(*c) - 64.0 - f64::from(focal * x / z)).abs() < 16.0;
            let own: Vec<f64> =
                (0..SIZE[0]).filter(near).filter(|&c| frames[0].rgba(c, row)[channel] == 255).map(f64::from).collect();
            own.iter().sum::<f64>() / own.len().max(1) as f64
        };
        let expected = f64::from(focal * apart) * (1.0 / f64::from(z) - 1.0 / f64::from(screen));
        stage.row(Row::within(format!("disparity at depth {z}, in pixels"), expected, middle(0) - middle(1), 0.5));
    }
    Ok(())
}
