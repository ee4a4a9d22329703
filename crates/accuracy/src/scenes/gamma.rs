//! Stored codes and light.

use anyhow::Result;

use super::kit::{Draw, Kit, Pass};
use super::{Scene, SceneRun};
use crate::Row;
use gfx::format::Format;

pub(super) const GAMMA: Scene = Scene {
    name: "gamma",
    group: "Sampling",
    what: "A ramp of light on an sRGB target and on a linear one: half is stored as 188, 90 codes lie below a tenth of the light (26 in linear), and every stored \
           code is that of the standard's formula in f64, ties within 1e-4 of a code aside.",
    fault: "the sRGB target is linear",
    play,
};

const SIZE: [u32; 2] = [400, 40];

/// The sRGB transfer function.
fn encoded(light: f64) -> f64 {
    if light <= 0.003_130_8 { 12.92 * light } else { 1.055 * libm::pow(light, 1.0 / 2.4) - 0.055 }
}

fn play(stage: &mut SceneRun) -> Result<()> {
    let mut kit = Kit::new("gamma");
    let srgb = if stage.fault() { Format::Rgba8Unorm } else { Format::Rgba8UnormSrgb };
    // Column x of 400, row y of 40: 16,000 amounts of light, then half.
    let source = "@fragment fn fs(@builtin(position) at: vec4f) -> @location(0) vec4f {
        let n = floor(at.x) * 40.0 + floor(at.y);
        return vec4f(vec3f(n / 16000.0), 1.0);
    }";
    for format in [srgb, Format::Rgba8Unorm] {
        let target = kit.target("target", SIZE, format);
        kit.pass(&Pass { color: vec![(target, Some([0.0; 4]))], ..Pass::default() }, &[Draw::cover(source)]);
        kit.present(target);
    }
    let frames = stage.show(&kit.finish())?;
    let light = |x: u32, y: u32| f64::from(x * 40 + y) / 16_000.0;
    stage.row(Row::exact("code of half the light", 188.0, f64::from(frames[0].rgba(200, 0)[0])));
    let far = |x, y| (255.0 * encoded(light(x, y)) - f64::from(frames[0].rgba(x, y)[0])).abs() > 0.5 + 1e-4;
    stage.row(Row::none("codes that are not the formula's", frames[0].places().filter(|&(x, y)| far(x, y)).count() as u64));
    for (frame, name, expected) in [(0, "sRGB", 90.0), (1, "linear", 26.0)] {
        // A code lies below a tenth if it decodes to less: 0.1 itself is stored as the nearest.
        let tenth = 0.1;
        let below = (0..256).filter(|&code| {
            let seen = frames[frame].places().filter(|&(x, y)| u32::from(frames[frame].rgba(x, y)[0]) == code);
            let lights: Vec<f64> = seen.map(|(x, y)| light(x, y)).collect();
            !lights.is_empty() && lights.iter().sum::<f64>() / (lights.len() as f64) < tenth
        });
        stage.row(Row::exact(format!("{name} codes below a tenth"), expected, below.count() as f64));
    }
    Ok(())
}
