//! Lines by programs, and the rasteriser in a program.

use anyhow::Result;

use super::kit::{COLORED, Draw, Kit, Pass};
use super::shapes::{Corner, center, clip, covers};
use super::{Scene, SceneRun};
use crate::Row;
use gfx::format::Format;
use gfx::state::Topology;
use num::Random;
use trace::command::{BoundResource, LinearLayout, TextureEnd};

pub(super) const LINES: Scene = Scene {
    name: "lines",
    group: "Lines",
    what: "Lines in all octants by the midpoint algorithm in compute are the card's line lists, last pixels aside. From (0, 0) to (16383, 5461) a DDA in f32 with \
           floor(y + 0.5) misses 1,638 rows, direct evaluation none. Of the same lines a DDA is the midpoint's, those whose pixels \
           share sides are the squares that integer arithmetic finds crossed (but for corners that are met), and those shaded by coverage are within a code of f64.",
    fault: "the midpoint's decision is off by a quarter of a pixel",
    play: lines,
};

pub(super) const SOFTWARE: Scene = Scene {
    name: "software",
    group: "Software",
    what: "A rasteriser in compute, with barycentric weights and the rule of the off-screen point for shared edges: a fan of triangles has the card's pixels, each in \
           one triangle.",
    fault: "pixels on shared edges belong to both triangles, and the weights are moved by one",
    play: software,
};

const SIZE: [u32; 2] = [128, 128];

/// Shows a buffer of words as a texture.
fn copied(kit: &mut Kit, from: &BoundResource, target: super::kit::Target, size: [u32; 2]) {
    let BoundResource::Buffer { buffer, .. } = from else { return };
    let end = TextureEnd { texture: target.texture, level: 0, origin: [0; 3], aspect: Default::default() };
    kit.card.copy_buffer_to_texture(
        *buffer,
        LinearLayout { offset: 0, bytes_per_row: None, rows_per_image: None },
        end,
        [size[0], size[1], 1],
    );
    kit.present(target);
}

/// Ends of lines from the middle, in all octants. The longer side is odd, so no pixel is half between two.
fn ends() -> Vec<[i64; 2]> {
    [
        [53, 17],
        [47, 38],
        [29, 51],
        [11, 57],
        [-13, 55],
        [-37, 45],
        [-51, 31],
        [-57, 9],
        [-55, -21],
        [-43, -40],
        [-26, -49],
        [-7, -53],
        [19, -55],
        [41, -47],
        [49, -27],
        [57, -5],
    ]
    .to_vec()
}

fn lines(stage: &mut SceneRun) -> Result<()> {
    let mut kit = Kit::new("lines");
    let target = kit.target("target", SIZE, Format::Rgba8Unorm);
    let words = kit.target("midpoint", SIZE, Format::R32Uint);
    let rows = kit.target("rows", [2, 1], Format::R32Uint);
    let pixel = |c: [i64; 2]| clip([256 * c[0] + 128, 256 * c[1] + 128], SIZE, 0.5);
    let white = [1.0_f32; 4];
    let all = ends()
        .iter()
        .flat_map(|e| [[64, 64], [64 + e[0], 64 + e[1]]].into_iter().flat_map(|c| [pixel(c), white].concat()))
        .collect();
    let draw = Draw { topology: Topology::LineList, ..Draw::list(COLORED, 2, all) };
    kit.pass(&Pass { color: vec![(target, Some([0.0, 0.0, 0.0, 1.0]))], ..Pass::default() }, &[draw]);
    kit.present(target);
    let (_, drawn) = kit.words("drawn", u64::from(SIZE[0] * SIZE[1]));
    let ends_of: Vec<f32> = ends().iter().flat_map(|e| [e[0] as f32, e[1] as f32]).collect();
    let ends_bound = kit.numbers("ends", &ends_of);
    let off = if stage.fault() { "major / 2" } else { "0" };
    let midpoint = format!(
        "@group(0) @binding(0) var<storage, read_write> drawn: array<u32>;
        @group(0) @binding(1) var<storage, read> ends: array<vec2f>;
        @compute @workgroup_size(16) fn main(@builtin(global_invocation_id) id: vec3u) {{
            let d = vec2i(ends[id.x]);
            let a = abs(d);
            let s = sign(d);
            let steep = a.y > a.x;
            let major = max(a.x, a.y);
            let minor = min(a.x, a.y);
            var decision = 2 * minor - major + {off};
            var p = vec2i(64);
            for (var k = 0; k < major; k++) {{
                drawn[p.y * 128 + p.x] = 1u;
                if decision > 0 {{
                    if steep {{ p.x += s.x; }} else {{ p.y += s.y; }}
                    decision -= 2 * major;
                }}
                if steep {{ p.y += s.y; }} else {{ p.x += s.x; }}
                decision += 2 * minor;
            }}
        }}"
    );
    kit.compute(&midpoint, [drawn.clone(), ends_bound], [1, 1, 1]);
    copied(&mut kit, &drawn, words, SIZE);
    // The row of column x is the nearest to x / 3 (16383 = 3 * 5461), which is never half between two.
    let (_, missed) = kit.words("missed", 2);
    let dda = "
        @group(0) @binding(0) var<storage, read_write> missed: array<u32>;
        @compute @workgroup_size(1) fn main() {
            let slope = 5461.0 / 16383.0;
            var y = 0.0;
            var wrong = vec2u(0u);
            for (var x = 0u; x <= 16383u; x++) {
                let row = (2u * x + 3u) / 6u;
                wrong += vec2u(u32(u32(floor(y + 0.5)) != row), u32(u32(floor(f32(x) * 5461.0 / 16383.0 + 0.5)) != row));
                y += slope;
            }
            missed[0] = wrong.x;
            missed[1] = wrong.y;
        }";
    kit.compute(dda, [missed.clone()], [1, 1, 1]);
    copied(&mut kit, &missed, rows, [2, 1]);
    others(&mut kit, &ends_of, stage.fault());
    let frames = stage.show(&kit.finish())?;
    let last = |x: u32, y: u32| ends().iter().any(|e| [64 + e[0], 64 + e[1]] == [i64::from(x), i64::from(y)]);
    let set = |x, y| frames[0].rgba(x, y)[0] == 255;
    let differing = frames[0].places().filter(|&(x, y)| !last(x, y) && set(x, y) != (frames[1].word(x, y, 0) == 1)).count();
    stage.row(Row::none("pixels in which midpoint and line lists differ", differing as u64));
    stage.row(Row::at_least("pixels of lines", 700.0, frames[0].places().filter(|&(x, y)| set(x, y)).count() as f64));
    stage.row(Row::exact("rows that the DDA misses", 1_638.0, f64::from(frames[2].word(0, 0, 0))));
    stage.row(Row::exact("rows that direct evaluation misses", 0.0, f64::from(frames[2].word(1, 0, 0))));
    other_rows(stage, &frames);
    Ok(())
}

/// The same lines by a DDA (bit 0) and with pixels that share sides (bit 1), and shaded by coverage.
fn others(kit: &mut Kit, ends: &[f32], fault: bool) {
    let words = kit.target("other lines", SIZE, Format::R32Uint);
    let shaded = kit.target("shaded lines", SIZE, Format::Rgba8Unorm);
    let (_, drawn) = kit.words("drawn", u64::from(SIZE[0] * SIZE[1]));
    let (_, pixels) = kit.words("pixels", u64::from(SIZE[0] * SIZE[1]));
    let bound = kit.numbers("ends", ends);
    let source = "
        @group(0) @binding(0) var<storage, read_write> drawn: array<atomic<u32>>;
        @group(0) @binding(1) var<storage, read> ends: array<vec2f>;
        @compute @workgroup_size(16) fn main(@builtin(global_invocation_id) id: vec3u) {
            if id.x >= arrayLength(&ends) { return; }
            let d = ends[id.x];
            let steps = max(abs(d.x), abs(d.y));
            var p = vec2f(64.0);
            for (var k = 0; k <= i32(steps); k++) {
                let at = vec2u(floor(p + 0.5));
                atomicOr(&drawn[at.y * 128u + at.x], 1u);
                p += d / steps;
            }
            // One step each way at a time: the one that stays nearer to the line.
            let e = vec2i(d);
            let s = sign(e);
            var q = vec2i(0);
            for (var k = 0; k <= abs(e.x) + abs(e.y); k++) {
                atomicOr(&drawn[u32(q.y + 64) * 128u + u32(q.x + 64)], 2u);
                let side = q.x * e.y - q.y * e.x;
                if abs(side + s.x * e.y) < abs(side - s.y * e.x) { q.x += s.x; } else { q.y += s.y; }
            }
        }";
    kit.compute(source, [drawn.clone(), bound.clone()], [1, 1, 1]);
    copied(kit, &drawn, words, SIZE);
    let width = if fault { "0.5" } else { "1.0" };
    let source = format!(
        "@group(0) @binding(0) var<storage, read_write> pixels: array<u32>;
        @group(0) @binding(1) var<storage, read> ends: array<vec2f>;
        @compute @workgroup_size(8, 8) fn main(@builtin(global_invocation_id) id: vec3u) {{
            let p = vec2f(id.xy) - 64.0;
            var best = 0.0;
            for (var k = 0u; k < arrayLength(&ends); k++) {{
                let d = ends[k];
                let along = dot(p, d);
                if along >= 0.0 && along <= dot(d, d) {{
                    best = max(best, {width} - abs(p.x * d.y - p.y * d.x) / length(d));
                }}
            }}
            pixels[id.y * 128u + id.x] = u32(best * 255.0 + 0.5) * 0x10101u + 0xff000000u;
        }}"
    );
    kit.compute(&source, [pixels.clone(), bound], [SIZE[0] / 8, SIZE[1] / 8, 1]);
    copied(kit, &pixels, shaded, SIZE);
}

fn other_rows(stage: &mut SceneRun, frames: &[super::Image]) {
    let at = |x: u32, y: u32| [i64::from(x) - 64, i64::from(y) - 64];
    let last = |x: u32, y: u32| ends().contains(&at(x, y));
    let dda = |x, y| frames[3].word(x, y, 0) & 1 == 1;
    let differing = frames[3].places().filter(|&(x, y)| !last(x, y) && dda(x, y) != (frames[1].word(x, y, 0) == 1)).count();
    stage.row(Row::none("pixels in which DDA and midpoint differ", differing as u64));
    // The square of a pixel is crossed if its centre's distance from the line, times the line's length, is below half of |dx| + |dy|.
    let crossed = |x: u32, y: u32| {
        let [px, py] = at(x, y);
        let mut found = [false; 2];
        for [ex, ey] in ends() {
            let [side, reach] = [2 * (px * ey - py * ex).abs(), ex.abs() + ey.abs()];
            let within = px * ex.signum() >= 0 && py * ey.signum() >= 0 && px.abs() <= ex.abs() && py.abs() <= ey.abs();
            found[0] |= within && side < reach;
            found[1] |= within && side == reach;
        }
        found
    };
    let sides = |x, y| frames[3].word(x, y, 0) & 2 == 2;
    let wrong = frames[3].places().filter(|&(x, y)| {
        let [crossed, corner] = crossed(x, y);
        sides(x, y) != crossed && !corner
    });
    stage.row(Row::none("pixels of lines with shared sides that are not crossed, or missing", wrong.count() as u64));
    let exact = |x: u32, y: u32| {
        let p = at(x, y);
        let mut best = 0.0_f64;
        for d in ends() {
            let along = p[0] * d[0] + p[1] * d[1];
            if (0..=d[0] * d[0] + d[1] * d[1]).contains(&along) {
                let [side, square] = [p[0] * d[1] - p[1] * d[0], d[0] * d[0] + d[1] * d[1]].map(|c| c as f64);
                best = best.max(1.0 - side.abs() / square.sqrt());
            }
        }
        [best; 3]
    };
    stage.row(Row::at_most("shaded by coverage: largest difference from f64, in codes", frames[4].worst(exact), 1.0));
    let [eight, four] = [1, 2].map(|bit| frames[3].places().filter(|&(x, y)| frames[3].word(x, y, 0) & bit != 0).count());
    let grey = frames[4].places().filter(|&(x, y)| frames[4].rgba(x, y)[0] > 0).count();
    stage.row(Row::at_least("pixels with shared sides over those of the DDA", 1.0, four as f64 / eight as f64));
    stage.answer(
        "How many pixels has a line?",
        format!("All lines together {eight} by DDA and midpoint, {four} where pixels share sides, {grey} shaded by coverage."),
    );
}

/// A fan of triangles around a point, on the grid of 1/16 pixel.
fn fan() -> Vec<[Corner; 3]> {
    let mut random = Random::new(11);
    let middle = [64 * 256 + 16 * 3, 63 * 256 + 16 * 5];
    let rim: Vec<Corner> = (0..16)
        .map(|k| {
            let angle = std::f64::consts::TAU * f64::from(k) / 16.0;
            let radius = 35.0 + 25.0 * f64::from(random.unit());
            [
                middle[0] + 16 * (16.0 * radius * libm::cos(angle)) as i64,
                middle[1] + 16 * (16.0 * radius * libm::sin(angle)) as i64,
            ]
        })
        .collect();
    (0..16).map(|k| [middle, rim[k], rim[(k + 1) % 16]]).collect()
}

fn software(stage: &mut SceneRun) -> Result<()> {
    let mut kit = Kit::new("software");
    let target = kit.target("target", SIZE, Format::Rgba8Unorm);
    let words = kit.target("words", SIZE, Format::R32Uint);
    let color = |k: usize| [(k % 4) as f32 / 3.0, (k / 4) as f32 / 3.0, 0.5, 1.0];
    let all = fan().iter().enumerate().flat_map(|(k, t)| t.map(|c| [clip(c, SIZE, 0.5), color(k)].concat()).concat()).collect();
    let mut card = Kit::new("software");
    let fixed = card.target("target", SIZE, Format::Rgba8Unorm);
    let draw = Draw::list(COLORED, 2, all);
    for (kit, target) in [(&mut kit, target), (&mut card, fixed)] {
        kit.pass(&Pass { color: vec![(target, Some([0.0, 0.0, 0.0, 1.0]))], ..Pass::default() }, std::slice::from_ref(&draw));
        kit.present(target);
    }
    let corners: Vec<f32> = fan().iter().flatten().flat_map(|c| [(c[0] / 16) as f32, (c[1] / 16) as f32]).collect();
    let corners = kit.numbers("corners", &corners);
    let (_, covered) = kit.words("covered", u64::from(SIZE[0] * SIZE[1]));
    let (rule, moved) =
        if stage.fault() { ("w == 0", "-400") } else { ("w == 0 && side(a, b, vec2i(-16 * 3, -16 * 7)) * turned > 0", "0") };
    let source = format!(
        "@group(0) @binding(0) var<storage, read_write> covered: array<u32>;
        @group(0) @binding(1) var<storage, read> corners: array<vec2f>;
        fn side(a: vec2i, b: vec2i, p: vec2i) -> i32 {{ return (b.x - a.x) * (p.y - a.y) - (b.y - a.y) * (p.x - a.x); }}
        @compute @workgroup_size(8, 8) fn main(@builtin(global_invocation_id) id: vec3u) {{
            let p = vec2i(id.xy) * 16 + 8;
            var found = 0u;
            for (var t = 0u; t < 16u; t++) {{
                var c = array(vec2i(corners[3u * t]), vec2i(corners[3u * t + 1u]), vec2i(corners[3u * t + 2u]));
                let turned = sign(side(c[0], c[1], c[2]));
                var inside = true;
                for (var k = 0u; k < 3u; k++) {{
                    let a = c[k];
                    let b = c[(k + 1u) % 3u];
                    let w = side(a, b, p) * turned - {moved};
                    inside &= w > 0 || ({rule});
                }}
                // The triangle's number, and how many there are.
                if inside {{ found += 256u + t; }}
            }}
            covered[id.y * 128u + id.x] = found;
        }}"
    );
    kit.compute(&source, [covered.clone(), corners.clone()], [SIZE[0] / 8, SIZE[1] / 8, 1]);
    copied(&mut kit, &covered, words, SIZE);
    let trace = kit.finish();
    let frames = stage.show(&trace)?;
    let found = |x, y| frames[1].word(x, y, 0);
    let card_has = |x, y| frames[0].rgba(x, y)[2] != 0;
    let differing = frames[0].places().filter(|&(x, y)| card_has(x, y) != (found(x, y) != 0)).count();
    stage.row(Row::none("pixels that one has and the other has not", differing as u64));
    stage.row(Row::none("pixels in two triangles", frames[0].places().filter(|&(x, y)| found(x, y) >= 512).count() as u64));
    let other = frames[0].places().filter(|&(x, y)| {
        let own = fan().iter().filter(|t| covers(**t, center(x, y))).count();
        (own != 0) != card_has(x, y)
    });
    stage.row(Row::none("pixels of the card that exact arithmetic does not have", other.count() as u64));
    if !stage.fault() {
        let (both, fixed) = (stage.time(&trace, &[])?.0, stage.time(&card.finish(), &[])?.0);
        stage.row(Row::at_least("cycles of the program over those of the fixed-function units", 1.0, (both - fixed) / fixed));
        stage.answer(
            "What do the fixed-function units save?",
            format!("They draw the fan in {fixed} cycles, the program in {}.", both - fixed),
        );
    }
    Ok(())
}
