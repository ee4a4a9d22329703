//! Billboards with transparent texels.

use anyhow::Result;

use super::kit::{Draw, Kit, OVER, Pass};
use super::{Scene, SceneRun};
use crate::Row;
use gfx::format::Format;
use gfx::state::Compare;
use trace::record;

pub(super) const CUTOUT: Scene = Scene {
    name: "cutout",
    group: "Transparency",
    what: "A billboard of 16 by 16 texels, magnified six times, in front of a wall that is drawn after it: with an alpha test the picture is right; with blending \
           alone the wall is missing in exactly the transparent texels.",
    fault: "the frame with the alpha test has none",
    play,
};

const SIZE: [u32; 2] = [128, 128];
const LEFT: u32 = 16;

/// Whether a texel is opaque: a leaf.
fn opaque(u: u32, v: u32) -> bool {
    let [x, y] = [u, v].map(|c| 2 * i64::from(c) - 15);
    x * x + 2 * y * y < 180 && (x + y) % 8 != 0
}

const SOURCE: &str = "
struct Vertex { @builtin(position) at: vec4f, @location(0) uv: vec4f }
@group(0) @binding(0) var leaf: texture_2d<f32>;
@group(0) @binding(1) var s: sampler;
@vertex fn vs(@location(0) at: vec4f, @location(1) uv: vec4f) -> Vertex { return Vertex(at, uv); }
@fragment fn tested(v: Vertex) -> @location(0) vec4f {
    let color = textureSample(leaf, s, v.uv.xy);
    if color.a < 0.5 { discard; }
    return color;
}
@fragment fn fs(v: Vertex) -> @location(0) vec4f { return textureSample(leaf, s, v.uv.xy); }";

const WALL: &str = "
@vertex fn vs(@builtin(vertex_index) i: u32) -> @builtin(position) vec4f {
    return vec4f(f32(i & 1u) * 4.0 - 1.0, f32(i >> 1u) * 4.0 - 1.0, 0.8, 1.0);
}
@fragment fn fs() -> @location(0) vec4f { return vec4f(1.0, 0.0, 0.0, 1.0); }";

fn play(stage: &mut SceneRun) -> Result<()> {
    let mut kit = Kit::new("cutout");
    let target = kit.target("target", SIZE, Format::Rgba8Unorm);
    let depth = kit.target("depth", SIZE, Format::Depth32Float);
    let leaf = kit.texture("leaf", record::texture_2d(16, 16, Format::Rgba8Unorm));
    let texels: Vec<u8> = (0..256).flat_map(|t| [0, 200, 0, if opaque(t % 16, t / 16) { 255 } else { 0 }]).collect();
    kit.card.write_level(leaf.texture, 0, "leaf", &texels);
    let sampler = kit.sampler(Default::default());
    let corner = |i: u32, j: u32| {
        let [x, y] = [i, j].map(|c| (LEFT + 96 * c) as f32 / 64.0 - 1.0);
        [x, -y, 0.4, 1.0, i as f32, j as f32, 0.0, 0.0]
    };
    let board: Vec<f32> = [[0, 0], [1, 0], [0, 1], [0, 1], [1, 0], [1, 1]].iter().flat_map(|&[i, j]| corner(i, j)).collect();
    for tested in [!stage.fault(), false] {
        let entries = ["vs", if tested { "tested" } else { "fs" }];
        let board = Draw::list(SOURCE, 2, board.clone()).with([leaf.bound(), sampler.clone()]).blend(OVER);
        let board = Draw { entries, ..board.depth(Format::Depth32Float, Compare::Less) };
        let wall = Draw::list(WALL, 0, Vec::new()).count(3).depth(Format::Depth32Float, Compare::Less);
        let pass =
            Pass { color: vec![(target, Some([0.0, 0.0, 1.0, 1.0]))], depth: Some((depth, Some((1.0, 0)))), ..Pass::default() };
        kit.pass(&pass, &[board, wall]);
        kit.present(target);
    }
    let frames = stage.show(&kit.finish())?;
    let texel = |x: u32, y: u32| {
        let inside = |c: u32| (LEFT..LEFT + 96).contains(&c);
        (inside(x) && inside(y)).then(|| opaque((x - LEFT) / 6, (y - LEFT) / 6))
    };
    let right = |x, y| if texel(x, y) == Some(true) { [0, 200, 0] } else { [255, 0, 0] };
    stage.row(Row::none("wrong pixels with the alpha test", frames[0].wrong(right)));
    let hidden = |x, y| if texel(x, y) == Some(false) { [0, 0, 255] } else { right(x, y) };
    stage.row(Row::none("without: pixels that are not as hidden by transparent texels", frames[1].wrong(hidden)));
    let expected = frames[1].places().filter(|&(x, y)| texel(x, y) == Some(false)).count();
    stage.row(Row::exact("without: wrong pixels", expected as f64, frames[1].wrong(right) as f64));
    Ok(())
}
