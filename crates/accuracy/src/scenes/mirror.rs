//! A mirror by a second drawing.

use anyhow::Result;

use super::kit::{Draw, Kit, Pass};
use super::{Scene, SceneRun};
use crate::Row;
use gfx::format::Format;
use gfx::state::{Compare, CullMode};

pub(super) const MIRROR: Scene = Scene {
    name: "mirror",
    group: "Reflection",
    what: "Lit solids above a mirror, seen from its height; scaled by -1 across the mirror with the other faces culled and the light mirrored they are the upper half \
           upside down, exactly.",
    fault: "the light is not mirrored",
    play,
};

const SIZE: [u32; 2] = [192, 128];

fn play(stage: &mut SceneRun) -> Result<()> {
    let mut kit = Kit::new("mirror");
    let target = kit.target("target", SIZE, Format::Rgba8Unorm);
    let depth = kit.target("depth", SIZE, Format::Depth32Float);
    // Pyramids: an apex over three corners, at several places.
    let mut vertices = Vec::new();
    for (x, z, size) in [(-0.9_f32, 3.1_f32, 0.7_f32), (0.3, 2.3, 0.5), (1.4, 4.2, 1.1)] {
        let p = [[-1.0, 0.31, -0.83], [0.97, 0.29, -0.61], [0.07, 0.33, 0.93], [0.03, 1.27, 0.0]]
            .map(|p: [f32; 3]| [x + size * p[0], size * p[1], z + size * p[2]]);
        for [a, b, c] in [[0, 3, 1], [1, 3, 2], [2, 3, 0], [0, 1, 2]] {
            let sub = |i: usize, j: usize| [0, 1, 2].map(|k| p[i][k] - p[j][k]);
            let (u, v) = (sub(b, a), sub(c, a));
            let n = [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]];
            for k in [a, b, c] {
                vertices.extend([p[k][0], p[k][1], p[k][2], 1.0, n[0], n[1], n[2], 0.0]);
            }
        }
    }
    let source = |mirrored: f32, light: f32| {
        format!(
            "struct Vertex {{ @builtin(position) at: vec4f, @location(0) @interpolate(flat) color: vec4f }}
            @vertex fn vs(@location(0) p: vec4f, @location(1) n: vec4f) -> Vertex {{
                let m = vec3f(1.0, {mirrored:?}, 1.0);
                let at = p.xyz * m;
                let diffuse = max(dot(normalize(n.xyz * m), normalize(vec3f(-1.0, 1.7 * {light:?}, -1.3))), 0.0);
                return Vertex(vec4f(at.x, at.y * 1.5, at.z - 0.5, at.z), vec4f(vec3f(0.9, 0.7, 0.4) * (0.15 + 0.8 * diffuse), 1.0));
            }}
            @fragment fn fs(v: Vertex) -> @location(0) vec4f {{ return v.color; }}"
        )
    };
    // A mirror turns the winding around.
    let draw = |mirrored, light, cull| Draw {
        cull,
        ..Draw::list(source(mirrored, light), 2, vertices.clone()).depth(Format::Depth32Float, Compare::Less)
    };
    let upright = draw(1.0, 1.0, CullMode::Back);
    let turned = draw(-1.0, if stage.fault() { 1.0 } else { -1.0 }, CullMode::Front);
    let pass =
        Pass { color: vec![(target, Some([0.2, 0.3, 0.5, 1.0]))], depth: Some((depth, Some((1.0, 0)))), ..Pass::default() };
    kit.pass(&pass, &[upright, turned]);
    kit.present(target);
    let frames = stage.show(&kit.finish())?;
    let image = &frames[0];
    let half = SIZE[1] / 2;
    let differing = image.places().filter(|&(x, y)| y < half && image.rgba(x, y) != image.rgba(x, SIZE[1] - 1 - y)).count();
    stage.row(Row::none("pixels of the upper half that are not those of the lower", differing as u64));
    let colors: std::collections::BTreeSet<_> = image.places().map(|(x, y)| image.rgba(x, y)).collect();
    let drawn = image.places().filter(|&(x, y)| y < half && image.rgba(x, y) != image.rgba(0, 0)).count();
    stage.row(Row::at_least("colours, the background and two of faces", 3.0, colors.len() as f64));
    stage.row(Row::at_least("pixels of solids in the upper half", 1_000.0, drawn as f64));
    Ok(())
}
