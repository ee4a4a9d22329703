//! Shadows of a light that shines in all directions.

use anyhow::Result;

use super::cube_map::face;
use super::kit::{Draw, Kit, Pass, Target};
use super::{Scene, SceneRun};
use crate::Row;
use gfx::format::Format;
use gfx::state::{Compare, ViewDimension};
use glam::{DVec3, dvec3};
use num::Random;
use trace::Trace;
use trace::command::{BoundResource, TextureDesc, ViewDesc};
use trace::record;

pub(super) const OMNI: Scene = Scene {
    name: "omni",
    group: "Shadows",
    what: "Eight triangles around a point light, drawn into the six faces of a cube of distances, and their shadows on the six walls of a room, unfolded. A pixel is in shadow \
           exactly if a ray of f64 from the light through the centre of the texel that it reads meets a triangle; pixels within 1/1000 texel of two texels and texels within \
           1/100 of an edge are left aside.",
    fault: "the maps of +z and -z are exchanged",
    play,
};

const TILE: u32 = 64;
const EDGE: u32 = 64;
const LIGHT: DVec3 = dvec3(0.31, -0.23, 0.37);
const NEAR: f64 = 0.05;

/// Axes of a face: to where s grows, to where t grows, and forward, by the table of OpenGL's specification.
fn axes(face: usize) -> [DVec3; 3] {
    let [x, y, z] = DVec3::AXES;
    [[-z, -y, x], [z, -y, -x], [x, z, y], [x, -z, -y], [x, -y, z], [-x, -y, -z]][face]
}

/// Corners as seen from the light.
fn triangles() -> Vec<[DVec3; 3]> {
    let mut random = Random::new(17);
    (0..8)
        .map(|_| {
            let mut any = |most: f32| DVec3::from_array(std::array::from_fn(|_| f64::from(random.range(-most, most))));
            let middle = 0.9 * any(1.0).normalize();
            [(); 3].map(|()| middle + any(0.8))
        })
        .collect()
}

/// The wall's point that a pixel shows, as seen from the light: six tiles, in two rows.
fn place(x: u32, y: u32) -> DVec3 {
    let [a, b] = [x % TILE, y % TILE].map(|c| (f64::from(c) + 0.5) / f64::from(TILE / 2) - 1.0);
    let [s, t, forward] = axes((y / TILE * 3 + x / TILE) as usize);
    2.0 * (a * s + b * t + forward) - LIGHT
}

/// How far a direction, where it meets the plane of a triangle, is inside of it: the sign says whether, and the size is the sine of the angle to the
/// nearest edge. A triangle behind is not met.
fn inside(d: DVec3, [a, b, c]: [DVec3; 3]) -> f64 {
    let turned = a.cross(b).dot(c).signum();
    let side = |p: DVec3, q: DVec3| turned * p.cross(q).normalize().dot(d.normalize());
    side(a, b).min(side(b, c)).min(side(c, a))
}

fn recorded(swapped: bool, culled: bool) -> Trace {
    let mut kit = Kit::new("omni");
    let target = kit.target("target", [3 * TILE, 2 * TILE], Format::Rgba8Unorm);
    let desc = TextureDesc { size: [EDGE, EDGE, 6], ..record::texture_2d(EDGE, EDGE, Format::R32Float) };
    let texture = kit.card.create_texture("distances", desc);
    let depth = kit.target("depth", [EDGE; 2], Format::Depth32Float);
    let source = "struct Vertex { @builtin(position) at: vec4f, @location(0) apart: vec3f }
        @vertex fn vs(@location(0) at: vec4f, @location(1) apart: vec4f) -> Vertex { return Vertex(at, apart.xyz); }
        @fragment fn fs(v: Vertex) -> @location(0) vec4f { return vec4f(length(v.apart)); }";
    for layer in 0..6 {
        let view = ViewDesc { base_layer: layer, layers: Some(1), ..ViewDesc::default() };
        let view = kit.card.create_view_of(texture, view);
        let face = if swapped && layer >= 4 { 9 - layer } else { layer };
        let axes = axes(face as usize);
        let mut vertices: Vec<f32> = Vec::new();
        for triangle in triangles() {
            // Outside of one side of the face's pyramid with all corners: nothing of it is in the map.
            let sides = [[1.0, 0.0], [-1.0, 0.0], [0.0, 1.0], [0.0, -1.0]];
            let out = |[u, v]: [f64; 2]| triangle.iter().all(|&p| (u * axes[0] + v * axes[1]).dot(p) > axes[2].dot(p));
            if culled && sides.into_iter().any(out) {
                continue;
            }
            for p in triangle {
                let [s, t, m] = axes.map(|axis| axis.dot(p));
                vertices.extend([s, -t, m - NEAR, m, p.x, p.y, p.z, 1.0].map(|c| c as f32));
            }
        }
        let map = Target { texture, view, format: Format::R32Float, samples: 1 };
        let pass = Pass { color: vec![(map, Some([1e9; 4]))], depth: Some((depth, Some((1.0, 0)))), ..Pass::default() };
        let draw = Draw::list(source, 2, vertices).depth(Format::Depth32Float, Compare::Less);
        kit.pass(&pass, if draw.count == 0 { &[] } else { std::slice::from_ref(&draw) });
    }
    let view = kit.card.create_view_of(texture, ViewDesc { dimension: Some(ViewDimension::Cube), ..ViewDesc::default() });
    let sampler = kit.sampler(Default::default());
    let rows: Vec<f32> =
        (0..6).flat_map(|face| axes(face).map(|axis| axis.extend(0.0).to_array()).concat()).map(|c| c as f32).collect();
    let axes_bound = kit.numbers("axes", &rows);
    let show = format!(
        "@group(0) @binding(0) var distances: texture_cube<f32>;
        @group(0) @binding(1) var s: sampler;
        @group(0) @binding(2) var<storage, read> axes: array<vec4f>;
        @fragment fn fs(@builtin(position) at: vec4f) -> @location(0) vec4f {{
            let tile = vec2u(at.xy) / {TILE}u;
            let ab = (at.xy - vec2f(tile * {TILE}u)) / {}.0 - 1.0;
            let wall = 3u * (tile.y * 3u + tile.x);
            let d = 2.0 * (ab.x * axes[wall].xyz + ab.y * axes[wall + 1u].xyz + axes[wall + 2u].xyz) - vec3f({:?}, {:?}, {:?});
            let lit = textureSampleLevel(distances, s, d, 0.0).r >= length(d);
            let shade = select(0.2, 1.0, lit);
            return vec4f(shade, shade * (0.6 + 0.08 * f32(wall / 3u)), shade * 0.6, 1.0);
        }}",
        TILE / 2,
        LIGHT.x,
        LIGHT.y,
        LIGHT.z,
    );
    let show = Draw::cover(&show).with([BoundResource::View(view), sampler, axes_bound]);
    kit.pass(&Pass { color: vec![(target, Some([0.0; 4]))], ..Pass::default() }, &[show]);
    kit.present(target);
    kit.finish()
}

fn play(stage: &mut SceneRun) -> Result<()> {
    let trace = recorded(stage.fault(), true);
    let frames = stage.show(&trace)?;
    let triangles = triangles();
    let (mut wrong, mut aside, mut dark, mut faces) = (0, 0, 0, [0; 6]);
    for (x, y) in frames[0].places() {
        let d = place(x, y);
        let (face, at) = face(d.to_array());
        let texels = at.map(|c| c * f64::from(EDGE));
        // The centre of the texel, as a direction.
        let [s, t] = texels.map(|c| 2.0 * (c.floor() + 0.5) / f64::from(EDGE) - 1.0);
        let [right, down, forward] = axes(face);
        let through = s * right + t * down + forward;
        let inside = triangles.iter().map(|&triangle| inside(through, triangle)).fold(f64::MIN, f64::max);
        let near = triangles.iter().any(|&triangle| self::inside(through, triangle).abs() < 0.02 / f64::from(EDGE));
        if texels.iter().any(|c| (c - c.round()).abs() < 1e-3) || near {
            aside += 1;
            continue;
        }
        let shadow = inside > 0.0;
        dark += u64::from(shadow);
        faces[face] += u64::from(shadow);
        wrong += u64::from((frames[0].rgba(x, y)[0] == 51) != shadow);
    }
    let pixels = f64::from(6 * TILE * TILE);
    stage.row(Row::none("pixels that are not as rays through texels find", wrong));
    stage.row(Row::at_most("share of pixels left aside", aside as f64 / pixels, 0.05));
    stage.row(Row::at_least("pixels in shadow", 2_000.0, dark as f64));
    stage.row(Row::exact("maps that have a shadow", 6.0, faces.iter().filter(|&&found| found > 0).count() as f64));
    if !stage.fault() {
        let whole = recorded(false, false);
        let same = stage.frames(&whole)?[0].differing(&frames[0]);
        stage.row(Row::none("pixels that differ when each map gets all triangles", same));
        let (few, many) = (stage.time(&trace, &[])?.0, stage.time(&whole, &[])?.0);
        stage.row(Row::within("cycles with triangles in their maps alone over those with all in each", 1.0, few / many, 0.05));
        let answer = format!(
            "With the triangles that lie in each map {few} cycles, with all triangles in each {many}: clipping and culling leave out the others at once."
        );
        stage.answer("Does it pay to sort triangles by the maps in which they lie?", answer);
    }
    Ok(())
}
