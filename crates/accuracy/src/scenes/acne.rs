//! A plane that shadows itself.

use anyhow::Result;

use super::kit::{Draw, Kit, Pass};
use super::{Scene, SceneRun};
use crate::Row;
use gfx::format::Format;
use gfx::state::Compare;

pub(super) const ACNE: Scene = Scene {
    name: "acne",
    group: "Shadows",
    what: "A plane of slope m under a shadow map whose texels are s wide, compared with a bias b: the share 1/2 - b/(ms) of it shadows itself. One band of the \
           picture for each of eight biases.",
    fault: "the bias is doubled",
    play,
};

/// Pixels along the plane, and texels of the map: no common divisor, so that all phases occur.
const PIXELS: u32 = 400;
const TEXELS: u32 = 37;
const BANDS: u32 = 8;
const SLOPE: f32 = 0.75;

fn play(stage: &mut SceneRun) -> Result<()> {
    let mut kit = Kit::new("acne");
    let map = kit.target("map", [TEXELS, 1], Format::Depth32Float);
    let target = kit.target("target", [PIXELS, 8 * BANDS], Format::Rgba8Unorm);
    let plane = format!(
        "@vertex fn vs(@builtin(vertex_index) i: u32) -> @builtin(position) vec4f {{
            let x = f32(i & 1u) * 4.0 - 1.0;
            return vec4f(x, f32(i >> 1u) * 4.0 - 1.0, 0.1 + {SLOPE} * (x * 0.5 + 0.5), 1.0);
        }}"
    );
    let cast =
        Draw { depth_only: true, ..Draw::list(plane, 0, Vec::new()).count(3).depth(Format::Depth32Float, Compare::Less) };
    kit.pass(&Pass { depth: Some((map, Some((1.0, 0)))), ..Pass::default() }, &[cast]);
    let step = SLOPE / TEXELS as f32;
    let factor = if stage.fault() { 2.0 } else { 1.0 };
    let source = format!(
        "@group(0) @binding(0) var map: texture_depth_2d;
        @fragment fn fs(@builtin(position) at: vec4f) -> @location(0) vec4f {{
            let u = at.x / {PIXELS}.0;
            let stored = textureLoad(map, vec2u(u32(u * {TEXELS}.0), 0u), 0);
            let band = floor(at.y / 8.0);
            let bias = {factor:?} * {step:?} * (band / 12.0);
            return vec4f(vec3f(select(1.0, 0.2, 0.1 + {SLOPE} * u > stored + bias)), 1.0);
        }}"
    );
    let show = Draw::cover(&source).with([map.bound()]);
    kit.pass(&Pass { color: vec![(target, Some([0.0; 4]))], ..Pass::default() }, &[show]);
    kit.present(target);
    let frames = stage.show(&kit.finish())?;
    for band in 0..BANDS {
        let dark = (0..PIXELS).filter(|&x| frames[0].rgba(x, 8 * band)[0] < 128).count() as f64 / f64::from(PIXELS);
        let share = (0.5 - f64::from(band) / 12.0).max(0.0);
        stage.row(Row::within(
            format!("share in shadow of itself, bias {band}/12 ms, in points"),
            100.0 * share,
            100.0 * dark,
            0.5,
        ));
    }
    Ok(())
}
