//! What a trilinear filter must read whatever the cache.

use anyhow::Result;

use super::{ALONE, misses, rendered, textured};
use crate::draws::COVER;
use crate::harness::{config, run};
use crate::{Row, Section, Setting, Target};
use gfx::format::Format;
use gfx::state::{FilterMode, SamplerDesc};
use trace::record;

pub(super) const TRILINEAR: Target = Target {
    id: "trilinear",
    section: Section::Memory,
    what: "Compulsory texels per fragment of a trilinear filter, axis-aligned: 1.25 x 4^f, f the fraction of the level of detail (of two \
           levels, the lines of an endless cache; the texture repeats, so that there is no border)",
    bound: "1 %",
    fault: "the sampler reads the nearest level only",
    check,
};

/// Texels of a line of 64 bytes: 4 x 4 of four bytes.
const TEXELS: f64 = 16.0;

/// Texels read per fragment where a texture of `texels` edges fills a screen of `pixels`, somewhere on it.
fn texels_a_fragment(setting: &Setting, texels: u32, pixels: u32, from: [f32; 2]) -> Result<f64> {
    let texture = record::texture_mipped(texels, texels, texels.ilog2() + 1, Format::Rgba8Unorm);
    let mipmap = if setting.inject_fault { FilterMode::Nearest } else { FilterMode::Linear };
    let sampler = SamplerDesc { mipmap, ..record::trilinear_repeat() };
    let [u, v] = from;
    let color = format!("textureSample(t, s, p.xy / {pixels}.0 + vec2f({u:?}, {v:?}))");
    let events = rendered(&textured([pixels; 2], texture, sampler, 3, COVER, &color))?;
    let changes = [&ALONE[..], &["texture.cache_lines=65536", "texture.cache_ways=64"]].concat();
    let lines = misses(&run(&config("four-pipelines", &changes)?, events)?)?;
    Ok(lines * TEXELS / f64::from(pixels * pixels))
}

fn check(setting: &Setting) -> Result<Vec<Row>> {
    let texels: u32 = setting.pick(128, 512, 1024);
    // No whole level, of which only one is read.
    let levels: &[f64] = setting.pick(
        &[0.25, 0.5, 1.75],
        &[0.1, 0.25, 0.5, 0.75, 0.9, 1.25, 1.5, 2.75],
        &[0.1, 0.25, 0.5, 0.75, 0.9, 1.1, 1.25, 1.5, 2.75, 3.5],
    );
    let rows = setting.pieces(levels.len() as u64, |piece, random| -> Result<Row> {
        let level = levels[piece as usize];
        // As near to it as whole pixels come.
        let pixels = (f64::from(texels) / libm::exp2(level)).round() as u32;
        let from = [random.unit(), random.unit()];
        let ratio = f64::from(texels) / f64::from(pixels);
        let expected = 1.25 * libm::pow(4.0, libm::log2(ratio) - level.floor());
        let measured = texels_a_fragment(setting, texels, pixels, from)?;
        Ok(Row::within(format!("level {level}: texels a fragment"), expected, measured, 0.01 * expected))
    });
    rows.into_iter().collect()
}
