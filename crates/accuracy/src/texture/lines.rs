//! Misses of a fully associative cache under a texture that is walked in scan-lines, a texel per pixel.
//!
//! A machine draws blocks of pixels, not scan-lines: so each line of the screen is a triangle of its own here, a pixel high, and the
//! core holds one warp at a time, so that requests come in order. Places lie between four texels.

use anyhow::Result;

use super::{ALONE, bilinear, misses, rendered, textured};
use crate::draws::{Sheet, Stroke};
use crate::harness::{config, run};
use crate::{Row, Section, Setting, Target};
use gfx::format::Format;
use num::Random;
use trace::Trace;
use trace::record;
use work::{Event, LINE};

pub(super) const TEXTURE_LRU: Target = Target {
    id: "texture-lru",
    section: Section::Memory,
    what: "Lines of a x b texels, fully associative, the least recently used goes, scan-lines W wide, bilinear, a texel per pixel: with \
           W/a lines or fewer (W/a + 1)(1 + 1/b)/W misses per fragment, with 2W/a + 1 or more (W/a + 1)(H/b + 1)/(WH); \
           W = 512 and a = b = 4: .3149 to .0640 at 257 lines, 16.4 KB (Hakura and Gupta 1997: at most 16 KB). With one line \
           fewer each row of lines misses two more, the last row one",
    bound: "exact",
    fault: "the cache has one line fewer",
    check: lru,
};

pub(super) const ORIENTATION: Target = Target {
    id: "orientation",
    section: Section::Memory,
    what: "In blocked layout as many misses along a texture as across it. In lines of 16 x 1, as buffers have, 1/16 a fragment along \
           (beside borders: (W/16 + 1)(H + 1)/(WH)), but 1 + 1/16 across, (W + 1)(1 + 1/16)/W, while the cache holds W lines or fewer, \
           and the same as along from 2W + 1 on",
    bound: "exact",
    fault: "the cache has a line more than the image is wide",
    check: orientation,
};

/// Which way scan-lines walk the texture.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum ScanDirection {
    Along,
    Across,
}

/// A triangle for each line of the screen: it covers the line's pixels, from the left border to beyond the right one, and no others.
fn lines_of(width: u32, height: u32) -> String {
    format!(
        "@vertex fn vs(@builtin(vertex_index) i: u32) -> @builtin(position) vec4f {{
            let corner = i % 3u;
            let x = select(-1.0, {width}.0 * 2.0 + 1.0, corner == 1u);
            let y = f32(i / 3u) + select(0.25, 1.0, corner == 2u);
            return vec4f(x / {width}.0 * 2.0 - 1.0, 1.0 - y / {height}.0 * 2.0, 0.5, 1.0);
        }}\n"
    )
}

/// A texture of this format, walked from a texel on.
fn of_texture([width, height]: [u32; 2], format: Format, [x, y]: [u32; 2], way: ScanDirection) -> Trace {
    let edge = width.max(height) + 64;
    let place = if way == ScanDirection::Along { "p.xy" } else { "p.yx" };
    let color = format!("textureSampleLevel(t, s, ({place} + vec2f({x}.5, {y}.5)) / {edge}.0, 0.0)");
    let texture = record::texture_2d(edge, edge, format);
    textured([width, height], texture, bilinear(), 3 * height, &lines_of(width, height), &color)
}

/// Rows of a buffer, of which each fragment reads four words as a bilinear filter would.
fn of_buffer(edge: u32, way: ScanDirection) -> Trace {
    let mut sheet = Sheet::new([edge, edge], 1);
    let pitch = edge + 16;
    let buffer = sheet.card.create_buffer("rows", 4 * u64::from(pitch) * u64::from(pitch));
    let place = if way == ScanDirection::Along { "vec2u(p.xy)" } else { "vec2u(p.yx)" };
    let source = format!(
        "@group(0) @binding(0) var<storage, read> rows: array<f32>;
        @fragment fn fs(@builtin(position) p: vec4f) -> @location(0) vec4f {{
            let at = {place};
            let i = at.y * {pitch}u + at.x;
            return vec4f(rows[i], rows[i + 1u], rows[i + {pitch}u], rows[i + {pitch}u + 1u]);
        }}"
    );
    sheet.draw(Stroke { resources: vec![record::whole(buffer)], ..Stroke::new(lines_of(edge, edge) + &source, 3 * edge) });
    sheet.finish()
}

/// The misses of a machine whose texture cache holds `lines` lines of `bytes` bytes.
fn missed(work: &[Event], lines: u32, bytes: u32) -> Result<f64> {
    let lines = format!("texture.cache_lines={lines}");
    let [bytes, sector] = ["line", "sector"].map(|of| format!("texture.{of}_bytes={bytes}"));
    let changes =
        [&ALONE[..], &["core.warps=1", "core.warp_width=4", "texture.cache_ways=65536", &lines, &bytes, &sector]].concat();
    misses(&run(&config("four-pipelines", &changes)?, work.iter().cloned())?)
}

/// Misses, shown by the fragment and compared as they are.
fn row(case: String, fragments: u32, expected: u32, measured: f64) -> Row {
    let (fragments, expected) = (f64::from(fragments), f64::from(expected));
    Row {
        case: format!("{case} (error: misses)"),
        expected: expected / fragments,
        measured: measured / fragments,
        error: (measured - expected).abs(),
        allowed: 0.0,
    }
}

fn lru(setting: &Setting) -> Result<Vec<Row>> {
    let sizes: &[[u32; 2]] = setting.pick(&[[64, 24]], &[[512, 256]], &[[512, 256], [1024, 512]]);
    let mut random = Random::new(setting.seed);
    let mut rows = Vec::new();
    for &[w, h] in sizes {
        // Longer lines hold blocks that stand side by side.
        for (a, b, format) in
            [(4, 4, Format::Rgba8Unorm), (8, 4, Format::Rgba8Unorm), (16, 4, Format::Rgba8Unorm), (8, 8, Format::R8Unorm)]
        {
            let bytes = LINE as u32 * a / b;
            // Wherever the walk begins, as long as it begins with a line.
            let first = [a * random.below(4), b * random.below(4)];
            let events = rendered(&of_texture([w, h], format, first, ScanDirection::Along))?;
            let (across, down) = (w / a, h / b);
            let (lost, once) = ((across + 1) * (h + down), (across + 1) * (down + 1));
            for (lines, misses) in [
                (across / 2, lost),
                (across, lost),
                (2 * across, once + 2 * down - 1),
                (2 * across + 1, once),
                (4 * across, once),
            ] {
                let measured = missed(&events, lines - u32::from(setting.inject_fault), bytes)?;
                rows.push(row(format!("{w} x {h}, lines of {a} x {b}, {lines} of them"), w * h, misses, measured));
            }
        }
    }
    Ok(rows)
}

fn orientation(setting: &Setting) -> Result<Vec<Row>> {
    let edges: &[u32] = setting.pick(&[48], &[256], &[256, 512]);
    let mut rows = Vec::new();
    for &edge in edges {
        let inject_fault = u32::from(setting.inject_fault);
        for way in [ScanDirection::Along, ScanDirection::Across] {
            let events = rendered(&of_texture([edge, edge], Format::Rgba8Unorm, [0, 0], way))?;
            let blocks = edge / 4;
            for (lines, misses) in [(blocks, (blocks + 1) * (edge + blocks)), (2 * blocks + 1, (blocks + 1) * (blocks + 1))] {
                let measured = missed(&events, lines, LINE as u32)?;
                rows.push(row(format!("{edge} x {edge}, {way:?}, {lines} lines of 4 x 4"), edge * edge, misses, measured));
            }
        }
        for way in [ScanDirection::Along, ScanDirection::Across] {
            let events = rendered(&of_buffer(edge, way))?;
            let (runs, once) = (edge / 16, (edge / 16 + 1) * (edge + 1));
            let narrow = if way == ScanDirection::Along { once } else { (edge + 1) * (edge + runs) };
            for (lines, misses) in [(edge, narrow), (2 * edge + 1, once)] {
                let measured = missed(&events, lines + inject_fault, LINE as u32)?;
                rows.push(row(format!("{edge} x {edge}, {way:?}, {lines} lines of 16 x 1"), edge * edge, misses, measured));
            }
        }
    }
    Ok(rows)
}
