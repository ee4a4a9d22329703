//! Shadows of solids on a floor: projected, and by volumes in the stencil buffer.

use anyhow::Result;

use super::kit::{COLORED, Draw, Kit, Pass};
use super::{Scene, SceneRun};
use crate::Row;
use gfx::format::Format;
use gfx::state::*;
use glam::{DVec3, dvec3};
use machine::config::SortClass;
use trace::Trace;
use trace::record;

pub(super) const FLAT: Scene = Scene {
    name: "flat-shadow",
    group: "Shadows",
    what: "A tetrahedron projected onto the floor by the matrix of a point light, drawn once a pixel by the stencil: at most 1 pixel of 65,536 is not as f64 rays find.",
    fault: "the light that projects is a tenth higher",
    play: flat,
};

pub(super) const VOLUMES: Scene = Scene {
    name: "volumes",
    group: "Shadows",
    what: "The shadow of a tetrahedron by volumes of all its faces or of its silhouette, extruded to w = 0 and counted in the stencil. From above z-pass and z-fail are as f64 rays find, \
           at most 1 pixel of 65,536 off. With the eye inside of the volume z-fail is still right, and z-pass is wrong in most pixels.",
    fault: "the volume has no cap at infinity and no cap at the solid",
    play: volumes,
};

const SIZE: [u32; 2] = [256, 256];
const DEPTH: Format = Format::Depth24PlusStencil8;

const SOLID: [DVec3; 4] =
    [dvec3(-0.31, 0.4, -0.27), dvec3(0.37, 0.43, -0.11), dvec3(0.02, 0.47, 0.33), dvec3(0.05, 0.93, 0.01)];
/// Faces, wound so that they are counter-clockwise from outside.
const FACES: [[usize; 3]; 4] = [[0, 1, 2], [0, 3, 1], [1, 3, 2], [2, 3, 0]];
const LIGHT: DVec3 = dvec3(0.23, 2.1, -0.37);

/// Whether a segment from `a` to `b` meets a triangle, by signed volumes.
fn meets(a: DVec3, b: DVec3, [p, q, r]: [DVec3; 3]) -> bool {
    let volume = |a: DVec3, b: DVec3, c: DVec3, d: DVec3| (b - a).cross(c - a).dot(d - a) > 0.0;
    volume(a, p, q, r) != volume(b, p, q, r) && {
        let side = volume(a, b, p, q);
        side == volume(a, b, q, r) && side == volume(a, b, r, p)
    }
}

fn shadowed(p: DVec3, solid: &[DVec3; 4]) -> bool {
    FACES.iter().any(|face| meets(p, LIGHT, face.map(|k| solid[k])))
}

/// A camera: its columns of rotation are those of the axes below, with focal length 1.
#[derive(Clone, Copy)]
struct Camera {
    eye: DVec3,
    /// To the right, up and forward.
    axes: [DVec3; 3],
}

const NEAR: f64 = 0.01;

impl Camera {
    /// Clip coordinates with an infinite far plane: depth 1 - near/w.
    fn clip(&self, p: DVec3, w: f64) -> [f32; 4] {
        let [x, y, z] = self.axes.map(|axis| axis.dot(p - w * self.eye));
        [x as f32, y as f32, (z - NEAR * w) as f32, z as f32]
    }

    /// The floor's point that a pixel sees.
    fn floor(&self, x: u32, y: u32) -> Option<DVec3> {
        let [a, b] = [(f64::from(x) + 0.5) / 128.0 - 1.0, 1.0 - (f64::from(y) + 0.5) / 128.0];
        let d = a * self.axes[0] + b * self.axes[1] + self.axes[2];
        let t = -self.eye.y / d.y;
        (t > 0.0).then(|| self.eye + t * d)
    }
}

/// From above the floor, looking down.
fn above(eye: DVec3) -> Camera {
    Camera { eye, axes: [DVec3::X, DVec3::Z, DVec3::NEG_Y] }
}

fn vertex(clip: [f32; 4], shade: f32) -> Vec<f32> {
    [clip, [shade, shade, shade, 1.0]].concat()
}

fn floor(camera: Camera, shade: f32) -> Vec<f32> {
    let corners = [[-9.0, -9.0], [9.0, -9.0], [9.0, 9.0], [-9.0, 9.0]].map(|[x, z]| dvec3(x, 0.0, z));
    [0, 1, 2, 0, 2, 3].iter().flat_map(|&k: &usize| vertex(camera.clip(corners[k], 1.0), shade)).collect()
}

/// How the stencil decides and counts.
fn stencil(compare: Compare, face: impl Fn(bool) -> StencilFace, depth_compare: Compare) -> DepthStencil {
    let set = |front| StencilFace { compare, ..face(front) };
    DepthStencil {
        depth_write: false,
        depth_compare,
        stencil_front: set(true),
        stencil_back: set(false),
        ..record::depth_less(DEPTH)
    }
}

fn wrong(frame: &super::Image, camera: Camera, solid: &[DVec3; 4]) -> u64 {
    let shade = |x, y| match camera.floor(x, y) {
        Some(p) if shadowed(p, solid) => [51; 3],
        Some(_) => [204; 3],
        None => [0; 3],
    };
    frame.wrong(shade)
}

fn flat(stage: &mut SceneRun) -> Result<()> {
    let camera = above(dvec3(0.1, 1.9, 0.05));
    let mut kit = Kit::new("flat-shadow");
    let target = kit.target("target", SIZE, Format::Rgba8Unorm);
    let depth = kit.target("depth", SIZE, DEPTH);
    let mut light = LIGHT;
    light.y *= if stage.fault() { 1.1 } else { 1.0 };
    // The matrix of a point light onto y = 0, applied to the corners.
    let project = |p: DVec3| -> DVec3 {
        let t = light.y / (light.y - p.y);
        light + t * (p - light)
    };
    let shadow = FACES.iter().flatten().flat_map(|&k| vertex(camera.clip(project(SOLID[k]), 1.0), 0.2)).collect();
    let once = stencil(
        Compare::Equal,
        |_| StencilFace { pass_op: StencilOp::IncrementClamp, ..StencilFace::default() },
        Compare::Always,
    );
    let draws = [
        Draw::list(COLORED, 2, floor(camera, 0.8)).depth(DEPTH, Compare::Less),
        Draw { depth: Some(once), ..Draw::list(COLORED, 2, shadow) },
    ];
    kit.pass(
        &Pass { color: vec![(target, Some([0.0, 0.0, 0.0, 1.0]))], depth: Some((depth, Some((1.0, 0)))), ..Pass::default() },
        &draws,
    );
    kit.present(target);
    let frames = stage.show(&kit.finish())?;
    stage.row(Row::at_most("pixels of 65,536 that are not as rays find", wrong(&frames[0], camera, &SOLID) as f64, 1.0));
    let dark = frames[0].places().filter(|&(x, y)| frames[0].rgba(x, y)[0] == 51).count() as f64;
    stage.row(Row::at_least("pixels in shadow", 1_000.0, dark));
    Ok(())
}

/// The volume of a solid, with caps at the solid and at infinity: each face's prism from the face to infinity away from the light, for faces that see the light.
fn volume(camera: Camera, solid: &[DVec3; 4], Volume { caps: [near, infinite], silhouette, .. }: Volume) -> Vec<f32> {
    let mut out = Vec::new();
    let mut triangle = |corners: [(DVec3, f64); 3]| {
        for (p, w) in corners {
            out.extend(vertex(camera.clip(p, w), 1.0));
        }
    };
    let inside = solid.iter().sum::<DVec3>() / 4.0;
    let normal = |face: [usize; 3]| {
        let [a, b, c] = face.map(|k| solid[k]);
        (b - a).cross(c - a)
    };
    let lit = FACES.into_iter().filter(|&face| {
        let (n, a) = (normal(face), solid[face[0]]);
        (n.dot(LIGHT - a) > 0.0) != (n.dot(inside - a) > 0.0)
    });
    // Counter-clockwise from the light.
    let lit: Vec<[usize; 3]> = lit
        .map(|face| {
            let [a, b, c] = face;
            if normal(face).dot(LIGHT - solid[a]) > 0.0 { face } else { [a, c, b] }
        })
        .collect();
    let sides = |[a, b, c]: [usize; 3]| [[a, b], [b, c], [c, a]];
    let far = |k: usize| (solid[k] - LIGHT, 0.0);
    let own = |k: usize| (solid[k], 1.0);
    for &face in &lit {
        for [from, to] in sides(face) {
            // Two faces that see the light have no edge of the silhouette between them: what one counts up there, the other counts down.
            if !(silhouette && lit.iter().any(|&other| sides(other).contains(&[to, from]))) {
                triangle([own(from), far(from), own(to)]);
                triangle([own(to), far(from), far(to)]);
            }
        }
        let [a, b, c] = face;
        if near {
            triangle([own(a), own(b), own(c)]);
        }
        if infinite {
            triangle([far(a), far(c), far(b)]);
        }
    }
    out
}

/// How volumes are drawn and counted.
#[derive(Clone, Copy)]
struct Volume {
    /// What is behind the floor is counted (z-fail), not what is in front of it.
    fail: bool,
    /// Caps at the solid and at infinity.
    caps: [bool; 2],
    /// Edges of the silhouette alone, not of all faces that see the light.
    silhouette: bool,
    /// A wall hides all, drawn first.
    wall: bool,
}

fn volumed(camera: Camera, solid: &[DVec3; 4], how: Volume) -> Trace {
    volumes_of(camera, std::slice::from_ref(solid), how)
}

fn volumes_of(camera: Camera, solids: &[[DVec3; 4]], how: Volume) -> Trace {
    let mut kit = Kit::new("volumes");
    let target = kit.target("target", SIZE, Format::Rgba8Unorm);
    let depth = kit.target("depth", SIZE, DEPTH);
    let count = move |front: bool| {
        let op = if front != how.fail { StencilOp::IncrementWrap } else { StencilOp::DecrementWrap };
        if how.fail {
            StencilFace { depth_fail_op: op, ..StencilFace::default() }
        } else {
            StencilFace { pass_op: op, ..StencilFace::default() }
        }
    };
    let lit = stencil(Compare::Equal, |_| StencilFace::default(), Compare::Equal);
    let wall = [[-1.0, -1.0], [3.0, -1.0], [-1.0, 3.0]].iter().flat_map(|&[x, y]| vertex([x, y, 0.001, 1.0], 0.4)).collect();
    let wall = how.wall.then(|| Draw::list(COLORED, 2, wall).depth(DEPTH, Compare::Less));
    let draws = wall.into_iter().chain([
        Draw::list(COLORED, 2, floor(camera, 0.2)).depth(DEPTH, Compare::Less),
        Draw {
            depth: Some(stencil(Compare::Always, count, Compare::Less)),
            mask: 0,
            ..Draw::list(COLORED, 2, solids.iter().flat_map(|solid| volume(camera, solid, how)).collect())
        },
        Draw { depth: Some(lit), ..Draw::list(COLORED, 2, floor(camera, 0.8)) },
    ]);
    let draws: Vec<Draw> = draws.collect();
    kit.pass(
        &Pass { color: vec![(target, Some([0.0, 0.0, 0.0, 1.0]))], depth: Some((depth, Some((1.0, 0)))), ..Pass::default() },
        &draws,
    );
    kit.present(target);
    kit.finish()
}

fn volumes(stage: &mut SceneRun) -> Result<()> {
    let caps = [!stage.fault(); 2];
    let fail = Volume { fail: true, caps, silhouette: false, wall: false };
    // Beside the shadow, and inside of it, below the solid.
    let (outside, inside) = (above(dvec3(-1.3, 1.7, 1.2)), above(dvec3(0.0, 0.2, 0.05)));
    let outside_fail = volumed(outside, &SOLID, fail);
    let frames = stage.show(&outside_fail)?;
    stage.row(Row::at_most(
        "z-fail from outside: pixels that are not as rays find",
        wrong(&frames[0], outside, &SOLID) as f64,
        1.0,
    ));
    let dark = frames[0].places().filter(|&(x, y)| frames[0].rgba(x, y)[0] == 51).count() as f64;
    stage.row(Row::at_least("pixels in shadow", 1_000.0, dark));
    // Counted in front of the floor, a volume needs no cap at infinity.
    let pass_trace = volumed(outside, &SOLID, Volume { fail: false, caps: [caps[0], false], ..fail });
    let picture = stage.frames(&pass_trace)?;
    stage.row(Row::at_most(
        "z-pass from outside: pixels that are not as rays find",
        wrong(&picture[0], outside, &SOLID) as f64,
        1.0,
    ));
    let silhouette = volumed(outside, &SOLID, Volume { silhouette: true, ..fail });
    let picture = stage.frames(&silhouette)?;
    stage.row(Row::at_most(
        "z-fail with edges of the silhouette alone: pixels that are not as rays find",
        wrong(&picture[0], outside, &SOLID) as f64,
        1.0,
    ));
    let [fails, passes] =
        [fail, Volume { fail: false, caps: [caps[0], false], ..fail }].map(|how| volumed(inside, &SOLID, how));
    let picture = stage.frames(&fails)?;
    stage.row(Row::at_most(
        "z-fail from inside: pixels that are not as rays find",
        wrong(&picture[0], inside, &SOLID) as f64,
        1.0,
    ));
    let picture = stage.frames(&passes)?;
    stage.row(Row::at_least("z-pass from inside: wrong pixels", 32_769.0, wrong(&picture[0], inside, &SOLID) as f64));
    if !stage.fault() {
        let mut costs = Vec::new();
        for class in [SortClass::First, SortClass::Middle, SortClass::MiddleBinned, SortClass::LastFragment] {
            let class = class.name();
            let class_knob = format!("sort={class}");
            let fail = stage.time(&outside_fail, &[&class_knob])?.0;
            let pass = stage.time(&pass_trace, &[&class_knob])?.0;
            let off = [class_knob.as_str(), "traverse.hierarchical_z=false"];
            let without = [stage.time(&outside_fail, &off)?.0, stage.time(&pass_trace, &off)?.0];
            costs.push(format!("{class} {fail} against {pass} ({} against {} without hierarchical Z)", without[0], without[1]));
            stage.row(Row::at_least(format!("cycles of z-fail over z-pass, on {class}"), 1.0, fail / pass));
        }
        stage.answer(
            "What does z-fail cost against z-pass?",
            format!(
                "Its cap at infinity, and that hierarchical Z throws nothing away that fails and is counted. In cycles: {}.",
                costs.join("; ")
            ),
        );
        hidden(stage, outside)?;
        let (all, edges) = (stage.time(&outside_fail, &[])?.0, stage.time(&silhouette, &[])?.0);
        stage.row(Row::at_least("cycles that edges of the silhouette save", 1.0, all - edges));
        stage.answer(
            "Volumes of all edges or of the silhouette?",
            format!("All edges of faces that see the light take {all} cycles, those of the silhouette {edges}."),
        );
        maps(stage)?;
        let disordered = stage.disordered(SortClass::LastImage);
        stage.row(Row::exact("passes that sort-last-image names", 1.0, disordered as f64));
        stage.answer(
            "Why can sort-last-image not do stencil?",
            "Each copy counts the volumes of its own pipeline, and depth alone decides between copies: the pass is named."
                .into(),
        );
    }
    Ok(())
}

/// What hierarchical Z saves of volumes that a wall hides: with z-pass they fail the test and change nothing, so that whole blocks of them are
/// thrown away; with z-fail just those that fail are counted, and none may be. The floor behind the wall is thrown away in both, and is what
/// is saved where there are no volumes.
fn hidden(stage: &mut SceneRun, camera: Camera) -> Result<()> {
    let mut told = Vec::new();
    let floor = volumes_of(camera, &[], Volume { fail: true, caps: [true; 2], silhouette: false, wall: true });
    let floor = stage.time(&floor, &["traverse.hierarchical_z=false"])?.0 - stage.time(&floor, &[])?.0;
    for (name, fail, share) in [("z-pass", false, 0.25), ("z-fail", true, 0.05)] {
        let how = Volume { fail, caps: [true, fail], silhouette: false, wall: true };
        let trace = volumes_of(camera, &crowd(16), how);
        let with = stage.time(&trace, &[])?.0;
        let without = stage.time(&trace, &["traverse.hierarchical_z=false"])?.0;
        let saved = (without - with - floor) / without;
        told.push(format!("{name} takes {with} cycles with it and {without} without"));
        let case = format!("share of the cycles of hidden {name} that hierarchical Z saves beside the floor");
        stage.row(if fail { Row::at_most(case, saved.abs(), share) } else { Row::at_least(case, share, saved) });
    }
    stage.answer(
        "What does hierarchical Z save of hidden volumes?",
        format!("Of 16 volumes behind a wall, {}: what fails the test is what z-fail has to count.", told.join("; ")),
    );
    Ok(())
}

/// `count` copies of the solid, each a little beside the one before.
fn crowd(count: usize) -> Vec<[DVec3; 4]> {
    (0..count).map(|k| SOLID.map(|p| p + 0.01 * k as f64 * dvec3(1.0, 0.0, -1.0))).collect()
}

/// The same shadows by a map of depths as the light sees them, looking down.
fn mapped(camera: Camera, solids: &[[DVec3; 4]]) -> Trace {
    let mut kit = Kit::new("shadow-map");
    let target = kit.target("target", SIZE, Format::Rgba8Unorm);
    let map = kit.target("map", SIZE, Format::Depth32Float);
    let light = above(LIGHT);
    let corners = solids.iter().flat_map(|solid| FACES.iter().flatten().map(|&k| solid[k]));
    let solid = corners.flat_map(|p| vertex(light.clip(p, 1.0), 1.0)).collect();
    let cast = Draw { depth_only: true, ..Draw::list(COLORED, 2, solid).depth(Format::Depth32Float, Compare::Less) };
    kit.pass(&Pass { depth: Some((map, Some((1.0, 0)))), ..Pass::default() }, &[cast]);
    let compare = kit.sampler(SamplerDesc { compare: Some(Compare::LessEqual), ..SamplerDesc::default() });
    let source = "
        struct Vertex { @builtin(position) at: vec4f, @location(0) light: vec4f }
        @group(0) @binding(0) var map: texture_depth_2d;
        @group(0) @binding(1) var compare: sampler_comparison;
        @vertex fn vs(@location(0) at: vec4f, @location(1) light: vec4f) -> Vertex { return Vertex(at, light); }
        @fragment fn fs(v: Vertex) -> @location(0) vec4f {
            let p = v.light.xyz / v.light.w;
            let lit = textureSampleCompareLevel(map, compare, p.xy * vec2f(0.5, -0.5) + 0.5, p.z);
            return vec4f(vec3f(0.2 + 0.6 * lit), 1.0);
        }";
    let corners = [[-9.0, -9.0], [9.0, -9.0], [9.0, 9.0], [-9.0, 9.0]].map(|[x, z]| dvec3(x, 0.0, z));
    let floor =
        [0, 1, 2, 0, 2, 3].iter().flat_map(|&k: &usize| [camera, light].map(|view| view.clip(corners[k], 1.0)).concat());
    let receive = Draw::list(source, 2, floor.collect()).with([map.bound(), compare]);
    kit.pass(&Pass { color: vec![(target, Some([0.0, 0.0, 0.0, 1.0]))], ..Pass::default() }, &[receive]);
    kit.present(target);
    kit.finish()
}

/// Which are cheaper, maps or volumes, for solids whose shadows lie over each other.
fn maps(stage: &mut SceneRun) -> Result<()> {
    let camera = above(dvec3(-1.3, 1.7, 1.2));
    let picture = stage.frames(&mapped(camera, &crowd(1)))?;
    let share = wrong(&picture[0], camera, &SOLID) as f64 / 65_536.0;
    stage.row(Row::at_most("shadow map: share of pixels that are not as rays find", share, 0.02));
    let (mut told, mut ratios) = (Vec::new(), Vec::new());
    for count in [1, 4, 16] {
        let volumes = stage
            .time(
                &volumes_of(camera, &crowd(count), Volume { fail: true, caps: [true; 2], silhouette: false, wall: false }),
                &[],
            )?
            .0;
        let maps = stage.time(&mapped(camera, &crowd(count)), &[])?.0;
        told.push(format!("{maps} against {volumes} for {count}"));
        ratios.push(volumes / maps);
    }
    stage.row(Row::at_least("16 solids over each other: cycles of volumes over those of a map", 1.0, ratios[2]));
    stage.row(Row::at_least("how much more that is than with one", 1.0, ratios[2] / ratios[0]));
    let answer = format!(
        "Cycles of maps against volumes, by the number of solids: {}. A volume is drawn over its whole shadow. A map is read once.",
        told.join(", ")
    );
    stage.answer("Shadow maps or volumes?", answer);
    Ok(())
}
