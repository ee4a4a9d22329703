//! What a program leaves out before it draws.

use anyhow::Result;

use super::kit::{COLORED, Draw, Kit, Pass};
use super::{Scene, SceneRun};
use crate::Row;
use gfx::format::Format;
use gfx::state::Compare;
use glam::{DVec3, Vec3, dvec3};
use num::Random;
use trace::Trace;
use trace::command::{LinearLayout, QueryKind, TextureEnd};

pub(super) const FRUSTUM: Scene = Scene {
    name: "frustum",
    group: "Culling",
    what: "256 triangles around the eye in a tree of spheres, walked in f32: what is left out is what f64 leaves out sphere by sphere, and the picture is that of all \
           drawn.",
    fault: "the spheres of the leaves are half as large",
    play: frustum,
};

pub(super) const OCCLUSION: Scene = Scene {
    name: "occlusion",
    group: "Culling",
    what: "Sixteen squares behind a wall with a hole, each asked for by an occlusion query: the counts are those of integer arithmetic; without those that count none \
           the picture is the same.",
    fault: "the wall is not in the depth buffer",
    play: occlusion,
};

const SIZE: [u32; 2] = [128, 128];

type Sphere = (Vec3, f32);

/// Triangles in a shell around the eye, each with its sphere.
fn triangles() -> Vec<([Vec3; 3], Sphere)> {
    let mut random = Random::new(5);
    (0..256)
        .map(|_| {
            let mut any = |most: f32| Vec3::from_array(std::array::from_fn(|_| random.range(-most, most)));
            let c = any(4.0);
            let corners = [(); 3].map(|()| c + any(0.4));
            (corners, (c, corners.iter().map(|p| p.distance(c)).fold(0.0, f32::max) * 1.0001))
        })
        .collect()
}

/// The planes of a view along z with a field of 90 degrees and a near plane at 0.1: inside is positive.
const PLANES: [(DVec3, f64); 5] = [
    (dvec3(1.0, 0.0, 1.0), 0.0),
    (dvec3(-1.0, 0.0, 1.0), 0.0),
    (dvec3(0.0, 1.0, 1.0), 0.0),
    (dvec3(0.0, -1.0, 1.0), 0.0),
    (DVec3::Z, -0.1),
];

/// Whether a sphere lies outside of a plane, in f32 as a program does it.
fn outside((center, radius): Sphere) -> bool {
    PLANES.iter().any(|&(normal, d)| {
        let (normal, d) = (normal.as_vec3(), d as f32);
        normal.dot(center) + d < -radius * normal.length()
    })
}

/// The leaves that a tree of spheres leaves, halving by the longest axis; how many spheres it tested.
fn walked(all: &[([Vec3; 3], Sphere)], own: &mut [usize], shrink: f32, left: &mut Vec<usize>) -> u32 {
    if let [leaf] = own {
        let (center, radius) = all[*leaf].1;
        if !outside((center, radius * shrink)) {
            left.push(*leaf);
        }
        return 1;
    }
    let low = own.iter().map(|&i| all[i].1.0).fold(Vec3::MAX, Vec3::min);
    let high = own.iter().map(|&i| all[i].1.0).fold(Vec3::MIN, Vec3::max);
    let center = (low + high) / 2.0;
    let reach = |&i: &usize| all[i].1.0.distance(center) + all[i].1.1;
    let radius = own.iter().map(reach).fold(0.0, f32::max) * 1.0001;
    if outside((center, radius)) {
        return 1;
    }
    let axis = (0..3).max_by(|&a, &b| (high[a] - low[a]).total_cmp(&(high[b] - low[b]))).unwrap_or(0);
    own.sort_by(|&a, &b| all[a].1.0[axis].total_cmp(&all[b].1.0[axis]));
    let (first, second) = own.split_at_mut(own.len() / 2);
    1 + walked(all, first, shrink, left) + walked(all, second, shrink, left)
}

fn drawn(all: &[([Vec3; 3], Sphere)], which: &[usize]) -> Trace {
    let mut kit = Kit::new("frustum");
    let target = kit.target("target", SIZE, Format::Rgba8Unorm);
    let depth = kit.target("depth", SIZE, Format::Depth32Float);
    let vertices = which.iter().flat_map(|&i| {
        let color = [(i % 7) as f32 / 6.0, (i % 5) as f32 / 4.0, 0.3 + (i % 3) as f32 / 4.0, 1.0];
        all[i].0.iter().flat_map(move |p| [[p.x, p.y, p.z - 0.1, p.z], color].concat()).collect::<Vec<f32>>()
    });
    let draw = Draw::list(COLORED, 2, vertices.collect()).depth(Format::Depth32Float, Compare::Less);
    let pass =
        Pass { color: vec![(target, Some([0.0, 0.0, 0.0, 1.0]))], depth: Some((depth, Some((1.0, 0)))), ..Pass::default() };
    kit.pass(&pass, &[draw]);
    kit.present(target);
    kit.finish()
}

fn frustum(stage: &mut SceneRun) -> Result<()> {
    let all = triangles();
    let mut left = Vec::new();
    let shrink = if stage.fault() { 0.5 } else { 1.0 };
    let tests = walked(&all, &mut (0..all.len()).collect::<Vec<_>>(), shrink, &mut left);
    left.sort_unstable();
    let culled = drawn(&all, &left);
    let whole = drawn(&all, &(0..all.len()).collect::<Vec<_>>());
    let frames = stage.show(&culled)?;
    let other = stage.frames(&whole)?;
    let exact = |&(center, radius): &Sphere| {
        PLANES.iter().any(|(normal, d)| normal.dot(center.as_dvec3()) + d < -f64::from(radius) * normal.length())
    };
    let wrong = (0..all.len()).filter(|&i| exact(&all[i].1) == left.contains(&i)).count();
    stage.row(Row::none("triangles about which f64 decides otherwise", wrong as u64));
    stage.row(Row::none("pixels that differ from the picture of all drawn", frames[0].differing(&other[0])));
    stage.row(Row::at_least("triangles left out", 100.0, (all.len() - left.len()) as f64));
    if !stage.fault() {
        let (few, many) = (stage.time(&culled, &[])?.0, stage.time(&whole, &[])?.0);
        stage.row(Row::at_least("cycles that culling saves", 1.0, many - few));
        let answer =
            format!("{tests} tests of spheres leave {} of 256 triangles: {few} cycles, and {many} for all.", left.len());
        stage.answer("When does culling by the program pay?", answer);
    }
    Ok(())
}

/// A rectangle of pixels.
fn square([x, y]: [u32; 2], [width, height]: [u32; 2], z: f32, color: [f32; 4]) -> Vec<f32> {
    let corner = |i: u32, j: u32| {
        let [x, y] = [x + i * width, y + j * height].map(|c| c as f32 / 64.0 - 1.0);
        [[x, -y, z, 1.0], color].concat()
    };
    [[0, 0], [1, 0], [0, 1], [0, 1], [1, 0], [1, 1]].iter().flat_map(|&[i, j]| corner(i, j)).collect()
}

fn occlusion(stage: &mut SceneRun) -> Result<()> {
    // A wall over all columns but 40 to 70, in two rectangles.
    let wall =
        [square([0, 0], [40, 128], 0.3, [0.5, 0.5, 0.5, 1.0]), square([70, 0], [58, 128], 0.3, [0.5, 0.5, 0.5, 1.0])].concat();
    let place = |k: u32| [3 + 32 * (k % 4), 5 + 32 * (k / 4)];
    let visible = |k: u32| {
        let [x, _] = place(k);
        (x..x + 20).filter(|x| (40..70).contains(x)).count() as u32 * 20
    };
    let square_of = |k: u32| square(place(k), [20, 20], 0.7, [0.2 + 0.05 * k as f32, 0.9 - 0.05 * k as f32, 0.2, 1.0]);
    let mut kit = Kit::new("occlusion");
    let target = kit.target("target", SIZE, Format::Rgba8Unorm);
    let depth = kit.target("depth", SIZE, Format::Depth32Float);
    let counts = kit.target("counts", [32, 1], Format::R32Uint);
    let set = kit.card.create_query_set(QueryKind::Occlusion, 16);
    let compare = if stage.fault() { Compare::Always } else { Compare::Less };
    let wall_draw = || Draw::list(COLORED, 2, wall.clone()).depth(Format::Depth32Float, Compare::Less);
    let clear = |queries| Pass {
        color: vec![(target, Some([0.0, 0.0, 0.2, 1.0]))],
        depth: Some((depth, Some((1.0, 0)))),
        queries,
        ..Pass::default()
    };
    let asked =
        (0..16).map(|k| Draw { query: Some(k), ..Draw::list(COLORED, 2, square_of(k)).depth(Format::Depth32Float, compare) });
    kit.pass(&clear(Some(set)), &std::iter::once(wall_draw()).chain(asked).collect::<Vec<_>>());
    kit.present(target);
    let seen: Vec<u32> = (0..16).filter(|&k| visible(k) > 0).collect();
    let again = seen.iter().map(|&k| Draw::list(COLORED, 2, square_of(k)).depth(Format::Depth32Float, Compare::Less));
    kit.pass(&clear(None), &std::iter::once(wall_draw()).chain(again).collect::<Vec<_>>());
    kit.present(target);
    let (buffer, _) = kit.words("counts", 32);
    kit.card.resolve_queries(set, 0, 16, buffer, 0);
    let end = TextureEnd { texture: counts.texture, level: 0, origin: [0; 3], aspect: Default::default() };
    kit.card.copy_buffer_to_texture(
        buffer,
        LinearLayout { offset: 0, bytes_per_row: None, rows_per_image: None },
        end,
        [32, 1, 1],
    );
    kit.present(counts);
    let frames = stage.show(&kit.finish())?;
    let wrong = (0..16).filter(|&k| frames[2].word(2 * k, 0, 0) != visible(k)).count();
    stage.row(Row::none("queries that count other than integer arithmetic", wrong as u64));
    stage.row(Row::exact(
        "squares that no sample shows",
        16.0 - seen.len() as f64,
        (0..16).filter(|&k| frames[2].word(2 * k, 0, 0) == 0).count() as f64,
    ));
    stage.row(Row::none("pixels that differ without those", frames[0].differing(&frames[1])));
    Ok(())
}
