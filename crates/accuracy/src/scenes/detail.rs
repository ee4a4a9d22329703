//! What a program leaves out because it is small on the screen: whole things, and their triangles.

use anyhow::Result;

use super::kit::{COLORED, Draw, Kit, Pass};
use super::{Scene, SceneRun};
use crate::Row;
use gfx::format::Format;
use gfx::state::Compare;
use glam::{DVec3, Vec3, dvec3, vec2, vec3};
use num::Random;
use trace::Trace;

pub(super) const DETAIL: Scene = Scene {
    name: "detail",
    group: "Culling",
    what: "600 triangles at 2 to 60 units. Those whose sphere has a radius below 0.6 pixels on the screen are left out, in f32: they are those of f64, and every pixel \
           that differs from the picture of all drawn has its centre in the rectangle of a triangle that was left out.",
    fault: "spheres are taken to be half as large",
    play: detail,
};

pub(super) const LOD: Scene = Scene {
    name: "lod",
    group: "Culling",
    what: "Balls at 5 to 60 units, each drawn with the coarsest of four meshes that is at most half a pixel off. The levels are those of f64, and a pixel differs from \
           the ball that f64 rays find only where the ray passes between the ball and the one that its mesh contains.",
    fault: "meshes may be two pixels off",
    play: lod,
};

const SIZE: [u32; 2] = [128, 128];
/// Pixels of a length of one at a distance of one.
const FOCAL: f64 = 64.0;
const SMALLEST: f64 = 0.6;

type Triangle = [Vec3; 3];

/// The middle of a triangle's corners and how far they are from it.
fn sphere(corners: &Triangle) -> (Vec3, f32) {
    let c = corners.iter().sum::<Vec3>() / 3.0;
    (c, corners.iter().map(|p| p.distance(c)).fold(0.0, f32::max))
}

fn triangles() -> Vec<Triangle> {
    let mut random = Random::new(9);
    (0..600)
        .map(|_| {
            let z = random.range(2.0, 60.0);
            let middle = vec3(random.range(-0.9, 0.9) * z, random.range(-0.9, 0.9) * z, z);
            let edge = random.range(0.1, 0.9);
            [(); 3].map(|()| middle + edge * Vec3::from_array(std::array::from_fn(|_| random.range(-1.0, 1.0))))
        })
        .collect()
}

fn shown(vertices: Vec<f32>, name: &str) -> Trace {
    let mut kit = Kit::new(name);
    let target = kit.target("target", SIZE, Format::Rgba8Unorm);
    let depth = kit.target("depth", SIZE, Format::Depth32Float);
    let pass =
        Pass { color: vec![(target, Some([0.0, 0.0, 0.0, 1.0]))], depth: Some((depth, Some((1.0, 0)))), ..Pass::default() };
    kit.pass(&pass, &[Draw::list(COLORED, 2, vertices).depth(Format::Depth32Float, Compare::Less)]);
    kit.present(target);
    kit.finish()
}

fn vertex(at: Vec3, color: [f32; 3]) -> [f32; 8] {
    [at.x, at.y, at.z - 0.1, at.z, color[0], color[1], color[2], 1.0]
}

fn detail(stage: &mut SceneRun) -> Result<()> {
    let all = triangles();
    let shrink = if stage.fault() { 0.5 } else { 1.0 };
    let kept: Vec<bool> = all
        .iter()
        .map(|triangle| {
            let (center, radius) = sphere(triangle);
            radius * shrink * FOCAL as f32 >= SMALLEST as f32 * center.z
        })
        .collect();
    let trace = |kept: &dyn Fn(usize) -> bool| {
        let one = |k: usize| {
            let color = [0.3 + (k % 8) as f32 / 10.0, 0.3 + (k % 5) as f32 / 7.0, 0.3 + (k % 3) as f32 / 4.0];
            all[k].iter().flat_map(move |&p| vertex(p, color))
        };
        shown((0..all.len()).filter(|&k| kept(k)).flat_map(one).collect(), "detail")
    };
    let (culled, whole) = (trace(&|k| kept[k]), trace(&|_| true));
    let frames = stage.show(&culled)?;
    let other = stage.frames(&whole)?;
    let exact = |triangle: &Triangle| {
        let p = triangle.map(|p| p.as_dvec3());
        let c = p.iter().sum::<DVec3>() / 3.0;
        p.iter().map(|p| p.distance(c)).fold(0.0, f64::max) * FOCAL >= SMALLEST * c.z
    };
    let wrong = all.iter().zip(&kept).filter(|(triangle, kept)| exact(triangle) != **kept).count();
    stage.row(Row::none("triangles about which f64 decides otherwise", wrong as u64));
    // Rectangles of those that f64 leaves out, a 256th of a pixel wider for the grid of positions.
    let boxes: Vec<[f64; 4]> = all
        .iter()
        .filter(|triangle| !exact(triangle))
        .map(|triangle| {
            let x = triangle.map(|p| 64.0 + FOCAL * f64::from(p[0]) / f64::from(p[2]));
            let y = triangle.map(|p| 64.0 - FOCAL * f64::from(p[1]) / f64::from(p[2]));
            let low = |v: [f64; 3]| v.iter().copied().fold(f64::MAX, f64::min) - 1.0 / 256.0;
            let high = |v: [f64; 3]| v.iter().copied().fold(f64::MIN, f64::max) + 1.0 / 256.0;
            [low(x), low(y), high(x), high(y)]
        })
        .collect();
    let holds = |x: u32, y: u32| {
        let [x, y] = [x, y].map(|c| f64::from(c) + 0.5);
        boxes.iter().any(|b| b[0] <= x && x <= b[2] && b[1] <= y && y <= b[3])
    };
    let stated = frames[0].places().filter(|&(x, y)| holds(x, y)).count();
    let differs = |x, y| frames[0].rgba(x, y) != other[0].rgba(x, y);
    let elsewhere = frames[0].places().filter(|&(x, y)| differs(x, y) && !holds(x, y)).count();
    stage.row(Row::none("pixels that differ where nothing is left out", elsewhere as u64));
    let differing = frames[0].differing(&other[0]);
    stage.row(Row::at_most("pixels that differ, of 16,384", differing as f64, stated as f64));
    let left = kept.iter().filter(|&&kept| kept).count();
    stage.row(Row::at_least("triangles left out", 100.0, (all.len() - left) as f64));
    if !stage.fault() {
        let (few, many) = (stage.time(&culled, &[])?.0, stage.time(&whole, &[])?.0);
        stage.row(Row::at_least("cycles that culling saves", 1.0, many - few));
        let answer = format!(
            "{left} of {} triangles take {few} cycles, all {many}; {differing} of 16384 pixels differ, and at most {stated} could.",
            all.len()
        );
        stage.answer("What does detail culling save, and what is lost?", answer);
    }
    Ok(())
}

/// Segments around the axis of each mesh, from coarse to fine; half as many along it.
const MESHES: [u32; 4] = [6, 8, 12, 16];

/// The triangles of a ball of radius 1.
fn mesh(segments: u32) -> Vec<[DVec3; 3]> {
    let rings = segments / 2;
    let at = |ring: u32, segment: u32| {
        let [up, around] = [
            std::f64::consts::PI * f64::from(ring) / f64::from(rings),
            std::f64::consts::TAU * f64::from(segment % segments) / f64::from(segments),
        ];
        // The poles are points.
        let out = if ring == 0 || ring == rings { 0.0 } else { libm::sin(up) };
        dvec3(out * libm::cos(around), libm::cos(up), out * libm::sin(around))
    };
    let mut triangles = Vec::new();
    for ring in 0..rings {
        for segment in 0..segments {
            let [a, b] = [at(ring, segment), at(ring, segment + 1)];
            let [c, d] = [at(ring + 1, segment), at(ring + 1, segment + 1)];
            if ring > 0 {
                triangles.push([a, b, c]);
            }
            if ring + 1 < rings {
                triangles.push([b, d, c]);
            }
        }
    }
    triangles
}

/// The radius of the ball that a mesh contains: the distance of its nearest plane.
fn contained(mesh: &[[DVec3; 3]]) -> f64 {
    let distance = |&[a, b, c]: &[DVec3; 3]| (b - a).cross(c - a).normalize().dot(a).abs();
    mesh.iter().map(distance).fold(1.0, f64::min)
}

/// Balls: centre and radius. None is behind another.
fn balls() -> Vec<(Vec3, f32)> {
    let distances: [f32; 9] = [5.0, 6.0, 7.0, 9.0, 12.0, 17.0, 22.0, 30.0, 60.0];
    let place = |k: usize| vec2((k % 3) as f32 * 0.6 - 0.6, (k / 3) as f32 * 0.6 - 0.6);
    (0..).zip(distances).map(|(k, z)| (place(k).extend(1.0) * z, 0.8)).collect()
}

fn lod(stage: &mut SceneRun) -> Result<()> {
    let (meshes, balls) = (MESHES.map(mesh), balls());
    let off = meshes.each_ref().map(|mesh| 1.0 - contained(mesh));
    let allowed = if stage.fault() { 2.0_f32 } else { 0.5 };
    let finest = MESHES.len() - 1;
    // The coarsest whose distance from the ball, at the ball's nearest point, is small enough.
    let level = |&(center, radius): &(Vec3, f32)| {
        let fits = |&mesh: &usize| off[mesh] as f32 * radius * FOCAL as f32 <= allowed * (center.z - radius);
        (0..finest).find(fits).unwrap_or(finest)
    };
    let levels: Vec<usize> = balls.iter().map(level).collect();
    let color = |k: usize| [1.0, 0.2 + 0.1 * (k % 8) as f32, 0.2 + 0.25 * (k % 3) as f32];
    let trace = |levels: &[usize]| {
        let mut out = Vec::new();
        for (k, (&(center, radius), &level)) in balls.iter().zip(levels).enumerate() {
            for p in meshes[level].iter().flatten() {
                out.extend(vertex(center + radius * p.as_vec3(), color(k)));
            }
        }
        shown(out, "lod")
    };
    let (culled, whole) = (trace(&levels), trace(&vec![finest; balls.len()]));
    let frames = stage.show(&culled)?;
    let other = stage.frames(&whole)?;
    let exact = |&(center, radius): &(Vec3, f32)| {
        let fits = |&mesh: &usize| {
            let [z, radius] = [center.z, radius].map(f64::from);
            off[mesh] * radius * FOCAL / (z - radius) <= 0.5
        };
        (0..finest).find(fits).unwrap_or(finest)
    };
    let wrong = balls.iter().zip(&levels).filter(|(ball, level)| exact(ball) != **level).count();
    stage.row(Row::none("levels that f64 chooses otherwise", wrong as u64));
    // A ray's distance from each ball's centre: outside of the ball nothing may be drawn, inside of the contained one all must be.
    let (mut elsewhere, mut between) = (0, 0);
    for (x, y) in frames[0].places() {
        let d = dvec3((f64::from(x) + 0.5 - 64.0) / FOCAL, (64.0 - f64::from(y) - 0.5) / FOCAL, 1.0);
        let drawn = frames[0].rgba(x, y)[0] == 255;
        let (mut inside, mut outside) = (false, true);
        for ball in &balls {
            let (c, radius) = (ball.0.as_dvec3(), f64::from(ball.1));
            let distance = c.reject_from(d).length();
            // The grid of positions moves an outline by a 256th of a pixel.
            let grid = (c.z + radius) / FOCAL / 256.0;
            let own = off[exact(ball)];
            inside |= distance < radius * (1.0 - own) - grid;
            outside &= distance > radius + grid;
        }
        elsewhere += u64::from(inside && !drawn || outside && drawn);
        between += u64::from(!inside && !outside);
    }
    stage.row(Row::none("pixels that are wrong elsewhere than between a ball and the one in its mesh", elsewhere));
    let differing = frames[0].differing(&other[0]);
    stage.row(Row::at_most("pixels that differ from the picture of the finest meshes", differing as f64, between as f64));
    let [few, many] =
        [&levels[..], &vec![finest; balls.len()]].map(|levels| levels.iter().map(|&l| meshes[l].len()).sum::<usize>());
    stage.row(Row::at_least("triangles left out", 500.0, (many - few) as f64));
    stage.row(Row::exact(
        "levels in use",
        MESHES.len() as f64,
        (0..=finest).filter(|level| levels.contains(level)).count() as f64,
    ));
    if !stage.fault() {
        let (short, long) = (stage.time(&culled, &[])?.0, stage.time(&whole, &[])?.0);
        stage.row(Row::at_least("cycles that levels of detail save", 1.0, long - short));
        let answer = format!("{few} of {many} triangles take {short} cycles, all {long}; {differing} of 16384 pixels differ.");
        stage.answer("What do levels of detail save, and what is lost?", answer);
    }
    Ok(())
}
