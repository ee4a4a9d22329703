//! Supersampling where a picture has edges, by a program.

use anyhow::Result;

use super::kit::Kit;
use super::{Scene, SceneRun};
use crate::Row;
use gfx::format::Format;
use trace::Trace;
use trace::command::{LinearLayout, TextureEnd};

pub(super) const ADAPTIVE: Scene = Scene {
    name: "adaptive",
    group: "Sampling",
    what: "Rings, rays and a scatter of dots, evaluated by a compute shader at a pixel's corners and centre, and at 16 places where these five do not agree: samples and codes \
           are those of integer arithmetic, and so are the pixels in which 16 samples everywhere are different.",
    fault: "two opposite corners and the centre decide",
    play,
};

const SIZE: [u32; 2] = [128, 128];

/// Whether a place on the grid of 1/8 pixel is white, in whole numbers.
fn white(x: i64, y: i64) -> bool {
    let [dx, dy] = [x - 403, y - 455];
    let square = dx * dx + dy * dy;
    let ring = square > 200 * 200 && square < 260 * 260 || square < 60 * 60;
    let ray = (7 * dx - 3 * dy).abs() < 130 && dx > 0;
    let [u, v] = [x % 88 - 44, y % 72 - 36];
    ring || ray || u * u + v * v < 30
}

fn recorded(most: bool, fault: bool) -> Trace {
    let mut kit = Kit::new("adaptive");
    let target = kit.target("target", SIZE, Format::Rgba8Unorm);
    let count = kit.target("count", [1, 1], Format::R32Uint);
    let (pixels, pixels_bound) = kit.words("pixels", u64::from(SIZE[0] * SIZE[1]));
    let (samples, samples_bound) = kit.words("samples", 1);
    let decides = match (most, fault) {
        // The four corners are evaluated here too, and always pass.
        (true, _) => {
            "u32(white(c)) + u32(white(c + vec2i(8, 0))) + u32(white(c + vec2i(0, 8))) + u32(white(c + vec2i(8, 8))) <= 4u"
        }
        (false, true) => "middle != white(c) || middle != white(c + vec2i(8, 8))",
        (false, false) => {
            "middle != white(c) || middle != white(c + vec2i(8, 0)) || middle != white(c + vec2i(0, 8)) || middle != white(c + vec2i(8, 8))"
        }
    };
    let source = format!(
        "@group(0) @binding(0) var<storage, read_write> pixels: array<u32>;
        @group(0) @binding(1) var<storage, read_write> samples: array<atomic<u32>>;
        fn white(p: vec2i) -> bool {{
            let d = p - vec2i(403, 455);
            let square = d.x * d.x + d.y * d.y;
            let ring = square > 200 * 200 && square < 260 * 260 || square < 60 * 60;
            let ray = abs(7 * d.x - 3 * d.y) < 130 && d.x > 0;
            let u = p % vec2i(88, 72) - vec2i(44, 36);
            return ring || ray || u.x * u.x + u.y * u.y < 30;
        }}
        @compute @workgroup_size(8, 8) fn main(@builtin(global_invocation_id) id: vec3u) {{
            let c = vec2i(id.xy) * 8;
            let middle = white(c + vec2i(4, 4));
            var code = select(0u, 255u, middle);
            var taken = 5u;
            if {decides} {{
                var hits = 0u;
                for (var k = 0; k < 16; k++) {{
                    hits += u32(white(c + vec2i(1 + 2 * (k % 4), 1 + 2 * (k / 4))));
                }}
                code = (hits * 255u + 8u) / 16u;
                taken += 16u;
            }}
            pixels[id.y * 128u + id.x] = code * 0x10101u + 0xff000000u;
            atomicAdd(&samples[0], taken);
        }}"
    );
    kit.compute(&source, [pixels_bound, samples_bound], [SIZE[0] / 8, SIZE[1] / 8, 1]);
    for (buffer, target, size) in [(pixels, target, [SIZE[0], SIZE[1], 1]), (samples, count, [1; 3])] {
        let layout = LinearLayout { offset: 0, bytes_per_row: None, rows_per_image: None };
        let end = TextureEnd { texture: target.texture, level: 0, origin: [0; 3], aspect: Default::default() };
        kit.card.copy_buffer_to_texture(buffer, layout, end, size);
        kit.present(target);
    }
    kit.finish()
}

fn play(stage: &mut SceneRun) -> Result<()> {
    let (own, all) = (recorded(false, stage.fault()), recorded(true, false));
    let frames = stage.show(&own)?;
    let other = stage.frames(&all)?;
    // Hits of 16 places, and whether corners and centre agree.
    let exact = |x: u32, y: u32| {
        let [x, y] = [x, y].map(|c| 8 * i64::from(c));
        let five = [[0, 0], [8, 0], [0, 8], [8, 8], [4, 4]].map(|[dx, dy]| white(x + dx, y + dy));
        let hits = (0..16).filter(|k| white(x + 1 + 2 * (k % 4), y + 1 + 2 * (k / 4))).count() as u32;
        (hits, five.iter().all(|&w| w == five[4]).then_some(five[4]))
    };
    let code = |hits: u32| f64::from(hits) / 16.0;
    let gray = |value: f64| [value; 3];
    let fewer = |x, y| {
        let (hits, agreed) = exact(x, y);
        gray(agreed.map_or(code(hits), |white| f64::from(u8::from(white))))
    };
    stage.row(Row::at_most("largest difference from integer arithmetic, in codes", frames[0].worst(fewer), 0.5));
    stage.row(Row::at_most("16 samples: largest difference, in codes", other[0].worst(|x, y| gray(code(exact(x, y).0))), 0.5));
    let split = frames[0].places().filter(|&(x, y)| exact(x, y).1.is_none()).count();
    let taken = (5 * SIZE[0] * SIZE[1]) as usize + 16 * split;
    stage.row(Row::exact("samples", taken as f64, f64::from(frames[1].word(0, 0, 0))));
    let missed = frames[0].places().filter(|&(x, y)| {
        let (hits, agreed) = exact(x, y);
        agreed.is_some_and(|white| hits != if white { 16 } else { 0 })
    });
    let missed = missed.count() as f64;
    stage.row(Row::exact("pixels in which 16 samples everywhere are different", missed, frames[0].differing(&other[0]) as f64));
    stage.row(Row::at_least("of these, for the five places do not see all", 1.0, missed));
    if !stage.fault() {
        let (few, many) = (stage.time(&own, &[])?.0, stage.time(&all, &[])?.0);
        stage.row(Row::at_least("cycles that fewer samples save", 1.0, many - few));
        stage.answer(
            "What does adaptive supersampling save, and what is lost?",
            format!("{taken} samples take {few} cycles, 21 a pixel {many}; {missed} of 16384 pixels differ."),
        );
    }
    Ok(())
}
