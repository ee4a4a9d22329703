//! Waves that pixels are too far apart for.

use anyhow::Result;

use super::kit::{Draw, Kit, Pass};
use super::{Scene, SceneRun};
use crate::Row;
use gfx::format::Format;

pub(super) const NYQUIST: Scene = Scene {
    name: "nyquist",
    group: "Sampling",
    what: "A wave of f cycles per pixel has its peak at f below 0.5, and at 1 - f above: 0.9 peaks at 0.1. One band for each f; the spectrum is an f64 sum.",
    fault: "the waves have 0.02 cycles per pixel less",
    play,
};

const PIXELS: u32 = 200;
const WAVES: [f64; 5] = [0.1, 0.3, 0.45, 0.7, 0.9];

fn play(stage: &mut SceneRun) -> Result<()> {
    let mut kit = Kit::new("nyquist");
    let target = kit.target("target", [PIXELS, 50], Format::Rgba8Unorm);
    let less = if stage.fault() { 0.02 } else { 0.0 };
    let waves = WAVES.map(|f| format!("{:?}", f - less)).join(", ");
    let source = format!(
        "@fragment fn fs(@builtin(position) at: vec4f) -> @location(0) vec4f {{
            var waves = array({waves});
            let f = waves[u32(at.y) / 10u];
            return vec4f(vec3f(0.5 + 0.5 * cos(6.2831853 * f * floor(at.x))), 1.0);
        }}"
    );
    kit.pass(&Pass { color: vec![(target, Some([0.0; 4]))], ..Pass::default() }, &[Draw::cover(&source)]);
    kit.present(target);
    let frames = stage.show(&kit.finish())?;
    for (band, f) in (0..).zip(WAVES) {
        let power = |k: u32| {
            let (mut re, mut im) = (0.0, 0.0);
            for x in 0..PIXELS {
                let value = f64::from(frames[0].rgba(x, 10 * band)[0]) / 255.0 - 0.5;
                let angle = std::f64::consts::TAU * f64::from(k * x) / f64::from(PIXELS);
                re += value * libm::cos(angle);
                im += value * libm::sin(angle);
            }
            re * re + im * im
        };
        let peak = (1..=PIXELS / 2).max_by(|&a, &b| power(a).total_cmp(&power(b))).unwrap_or(0);
        let expected = if f > 0.5 { 1.0 - f } else { f };
        stage.row(Row::within(format!("peak of {f} cycles per pixel"), expected, f64::from(peak) / f64::from(PIXELS), 1e-9));
    }
    Ok(())
}
