//! Billboards that turn around an axis.

use anyhow::Result;

use super::kit::{Draw, Kit, Pass};
use super::{Scene, SceneRun};
use crate::Row;
use gfx::format::Format;
use gfx::state::Compare;
use glam::{DVec2, DVec3, Vec3Swizzles, dvec3};

pub(super) const AXIAL: Scene = Scene {
    name: "axial",
    group: "Transparency",
    what: "Twelve trunks as rectangles that the vertex shader turns around their vertical axes until they face an eye above them: pixels are those of f64, which finds each \
           rectangle as the silhouette of its axis at half its width, across the direction to the eye; pixels within 1/100 pixel of an edge are left aside.",
    fault: "rectangles face along the view's direction",
    play,
};

const SIZE: [u32; 2] = [128, 128];
const EYE: DVec3 = dvec3(0.5, 2.5, -3.0);
const HALF: f64 = 0.25;
const HEIGHT: f64 = 1.5;

/// Feet of the axes, on no row or column.
fn feet() -> [[f64; 2]; 12] {
    std::array::from_fn(|k| [(k % 4) as f64 * 1.3 - 1.75, (k / 4) as f64 * 1.5 + 0.125 * (k % 4) as f64])
}

fn color(k: usize) -> [u8; 3] {
    [51 * (1 + k as u8 % 4), 51 * (1 + k as u8 / 4), 102]
}

/// Right and depth are x and z; the eye looks down by a slope of 1/2.
fn seen(p: DVec3) -> DVec3 {
    let p = p - EYE;
    dvec3(p.x, p.y + 0.5 * p.z, p.z - 0.5 * p.y)
}

fn play(stage: &mut SceneRun) -> Result<()> {
    let toward = if stage.fault() { "vec2f(0.0, -1.0)" } else { "vec2f(0.5, -3.0) - foot.xy" };
    let source = format!(
        "struct Vertex {{ @builtin(position) at: vec4f, @location(0) @interpolate(flat) color: vec4f }}
        @vertex fn vs(@location(0) foot: vec4f, @location(1) color: vec4f) -> Vertex {{
            let to = normalize({toward});
            // Across the direction to the eye, on the ground.
            let ground = foot.xy + vec2f(-to.y, to.x) * foot.z;
            let p = vec3f(ground.x, foot.w, ground.y) - vec3f(0.5, 2.5, -3.0);
            let depth = p.z - 0.5 * p.y;
            return Vertex(vec4f(p.x, p.y + 0.5 * p.z, depth - 0.1, depth), color);
        }}
        @fragment fn fs(v: Vertex) -> @location(0) vec4f {{ return v.color; }}"
    );
    let mut vertices: Vec<f32> = Vec::new();
    for (k, [x, z]) in feet().into_iter().enumerate() {
        for [side, top] in [[-1.0, 0.0], [1.0, 0.0], [-1.0, 1.0], [-1.0, 1.0], [1.0, 0.0], [1.0, 1.0]] {
            let [r, g, b] = color(k).map(|code| f64::from(code) / 255.0);
            vertices.extend([x, z, side * HALF, top * HEIGHT, r, g, b, 1.0].map(|c| c as f32));
        }
    }
    let mut kit = Kit::new("axial");
    let target = kit.target("target", SIZE, Format::Rgba8Unorm);
    let depth = kit.target("depth", SIZE, Format::Depth32Float);
    let pass =
        Pass { color: vec![(target, Some([0.0, 0.0, 0.0, 1.0]))], depth: Some((depth, Some((1.0, 0)))), ..Pass::default() };
    kit.pass(&pass, &[Draw::list(source, 2, vertices).depth(Format::Depth32Float, Compare::Less)]);
    kit.present(target);
    let trace = kit.finish();
    let frames = stage.show(&trace)?;
    // A ray meets the vertical plane through an axis whose normal is the direction to the eye on the ground.
    let (mut wrong, mut aside, mut drawn) = (0, 0, 0);
    for (x, y) in frames[0].places() {
        let [a, b] = [(f64::from(x) + 0.5) / 64.0 - 1.0, 1.0 - (f64::from(y) + 0.5) / 64.0];
        // The inverse of `seen` for a depth of one: y + z/2 = b and z - y/2 = 1.
        let d = dvec3(a, (b - 0.5) / 1.25, (1.0 + 0.5 * b) / 1.25);
        let mut nearest: Option<(f64, usize)> = None;
        let mut edge = false;
        for (k, foot) in feet().map(DVec2::from).into_iter().enumerate() {
            let to = EYE.xz() - foot;
            let t = -to.length_squared() / to.dot(d.xz());
            let p = EYE + t * d;
            let across = to.normalize().perp_dot(p.xz() - foot);
            // A pixel is depth / 64 wide.
            let near = seen(p).z / 6_400.0;
            let off = [HALF - across.abs(), p.y.min(HEIGHT - p.y)].into_iter().fold(f64::MAX, f64::min);
            edge |= t > 0.0 && off.abs() < 2.0 * near;
            if t > 0.0 && off > 0.0 && nearest.is_none_or(|(other, _)| t < other) {
                nearest = Some((t, k));
            }
        }
        if edge {
            aside += 1;
            continue;
        }
        let right = nearest.map_or([0; 3], |(_, k)| color(k));
        drawn += u64::from(nearest.is_some());
        wrong += u64::from(frames[0].rgba(x, y)[..3] != right);
    }
    stage.row(Row::none("pixels that are not as rays find", wrong));
    stage.row(Row::at_most("share of pixels left aside", aside as f64 / f64::from(SIZE[0] * SIZE[1]), 0.05));
    stage.row(Row::at_least("pixels of rectangles", 1_000.0, drawn as f64));
    Ok(())
}
