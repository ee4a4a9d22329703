//! Textures combined, halved, and turned.

use anyhow::Result;

use super::kit::{Draw, Kit, Pass};
use super::{Scene, SceneRun};
use crate::Row;
use crate::harness::counts;
use gfx::format::Format;
use num::Random;
use trace::Trace;
use trace::command::{BoundResource, ViewDesc};
use trace::record;
use unit::scanout::{DISPLAY, DisplayCounts};

pub(super) const COMBINE: Scene = Scene {
    name: "combine",
    group: "Light",
    what: "Six bands of combined textures: texture times colour, times a second texture, plus a highlight, mixed by a constant, by the colour's alpha and by the \
           texture's alpha: within a code of f64.",
    fault: "the mix by the texture's alpha takes the colour's",
    play: combine,
};

pub(super) const PYRAMID: Scene = Scene {
    name: "pyramid",
    group: "Sampling",
    what: "A texture of 262,144 bytes with all its levels, drawn level by level as means of four: 349,524 bytes; the last texel is the mean of all in f64, half a code a \
           level.",
    fault: "levels are every second texel",
    play: pyramid,
};

pub(super) const WHEEL: Scene = Scene {
    name: "wheel",
    group: "Sampling",
    what: "A wheel of twelve spokes turned by 23/24 of their pitch a frame: every frame is that of a wheel that is turned back by 1/24, but for texels on the border of a \
           spoke.",
    fault: "the wheel is turned by 22/24",
    play: wheel,
};

fn texture(kit: &mut Kit, seed: u64, edge: u32) -> (super::kit::Target, Vec<u8>) {
    let mut random = Random::new(seed);
    let texels: Vec<u8> = (0..4 * edge * edge).map(|_| random.bits() as u8).collect();
    let texture = kit.texture("texture", record::texture_2d(edge, edge, Format::Rgba8Unorm));
    kit.card.write_level(texture.texture, 0, "texels", &texels);
    (texture, texels)
}

fn combine(stage: &mut SceneRun) -> Result<()> {
    let mut kit = Kit::new("combine");
    let target = kit.target("target", [96, 96], Format::Rgba8Unorm);
    let (first, a) = texture(&mut kit, 1, 16);
    let (second, b) = texture(&mut kit, 2, 16);
    let alpha = if stage.fault() { "c.a" } else { "a.a" };
    let source = format!(
        "@group(0) @binding(0) var first: texture_2d<f32>;
        @group(0) @binding(1) var second: texture_2d<f32>;
        @fragment fn fs(@builtin(position) at: vec4f) -> @location(0) vec4f {{
            let place = vec2u(at.xy) / 6u;
            let a = textureLoad(first, place, 0);
            let b = textureLoad(second, place, 0);
            let c = vec4f(at.x / 96.0, 0.6, 1.0 - at.x / 96.0, 0.3);
            var color = a.rgb * c.rgb;
            switch u32(at.y) / 16u {{
                case 1u: {{ color *= b.rgb; }}
                case 2u: {{ color = color * 0.5 + 0.5 * pow(at.x / 96.0, 8.0); }}
                case 3u: {{ color = mix(a.rgb, b.rgb, 0.25); }}
                case 4u: {{ color = mix(a.rgb, c.rgb, c.a); }}
                case 5u: {{ color = mix(c.rgb, b.rgb, {alpha}); }}
                default: {{}}
            }}
            return vec4f(color, 1.0);
        }}"
    );
    let draw = Draw::cover(&source).with([first.bound(), second.bound()]);
    kit.pass(&Pass { color: vec![(target, Some([0.0; 4]))], ..Pass::default() }, &[draw]);
    kit.present(target);
    let frames = stage.show(&kit.finish())?;
    let exact = |x: u32, y: u32| {
        let texel = |of: &[u8], k: u32| f64::from(of[(4 * (y / 6 * 16 + x / 6) + k) as usize]) / 255.0;
        let u = (f64::from(x) + 0.5) / 96.0;
        let c = [u, 0.6, 1.0 - u];
        let mix = |from: f64, to: f64, t: f64| from + t * (to - from);
        std::array::from_fn(|k| {
            let (own, other) = (texel(&a, k as u32), texel(&b, k as u32));
            match y / 16 {
                0 => own * c[k],
                1 => own * c[k] * other,
                2 => own * c[k] * 0.5 + 0.5 * libm::pow(u, 8.0),
                3 => mix(own, other, 0.25),
                4 => mix(own, c[k], 0.3),
                _ => mix(c[k], other, texel(&a, 3)),
            }
        })
    };
    stage.row(Row::at_most("largest difference from f64, in codes", frames[0].worst(exact), 1.0));
    Ok(())
}

fn pyramid(stage: &mut SceneRun) -> Result<()> {
    let edge = 256_u32;
    let mut kit = Kit::new("pyramid");
    // The finest level is drawn, so that the recording is small.
    let levels = 9;
    let desc = record::texture_mipped(edge, edge, levels, Format::Rgba8Unorm);
    let bytes: u64 = (0..levels).map(|level| desc.level_size(level).map(u64::from).iter().product::<u64>() * 4).sum();
    let texture = kit.card.create_texture("pyramid", desc);
    let level = |kit: &mut Kit, base_level| super::kit::Target {
        texture,
        view: kit.card.create_view_of(texture, ViewDesc { base_level, levels: Some(1), ..ViewDesc::default() }),
        format: Format::Rgba8Unorm,
        samples: 1,
    };
    let finest = level(&mut kit, 0);
    let fill = "@fragment fn fs(@builtin(position) at: vec4f) -> @location(0) vec4f {
        let p = vec2u(at.xy);
        return vec4f(f32(p.x), f32(p.y), f32((p.x * p.y) & 255u), 255.0) / 255.0;
    }";
    kit.pass(&Pass { color: vec![(finest, Some([0.0; 4]))], ..Pass::default() }, &[Draw::cover(fill)]);
    let sum = if stage.fault() {
        "textureLoad(above, p, 0)"
    } else {
        "(textureLoad(above, p, 0) + textureLoad(above, p + vec2u(1u, 0u), 0) + textureLoad(above, p + vec2u(0u, 1u), 0) + textureLoad(above, p + vec2u(1u), 0)) / 4.0"
    };
    let halve = format!(
        "@group(0) @binding(0) var above: texture_2d<f32>;
        @fragment fn fs(@builtin(position) at: vec4f) -> @location(0) vec4f {{ let p = 2u * vec2u(at.xy); return {sum}; }}"
    );
    let mut above = finest;
    for base in 1..levels {
        let own = level(&mut kit, base);
        kit.pass(&Pass { color: vec![(own, Some([0.0; 4]))], ..Pass::default() }, &[Draw::cover(&halve).with([above.bound()])]);
        above = own;
    }
    // All levels as squares beside each other, half, a quarter, and so on, of the picture.
    let show = "@group(0) @binding(0) var all: texture_2d<f32>;
        @fragment fn fs(@builtin(position) at: vec4f) -> @location(0) vec4f {
            let p = vec2u(at.xy);
            var left = 0u;
            for (var level = 1u; level < 9u; level++) {
                let edge = 256u >> level;
                if p.x >= left && p.x < left + edge && p.y < edge { return textureLoad(all, p - vec2u(left, 0u), level); }
                left += edge;
            }
            return vec4f(0.0, 0.0, 0.0, 1.0);
        }";
    let target = kit.target("target", [256, 128], Format::Rgba8Unorm);
    let view = kit.card.create_view(texture);
    kit.pass(
        &Pass { color: vec![(target, Some([0.0; 4]))], ..Pass::default() },
        &[Draw::cover(show).with([BoundResource::View(view)])],
    );
    kit.present(target);
    let frames = stage.show(&kit.finish())?;
    stage.row(Row::exact("bytes of all levels", 349_524.0, bytes as f64));
    let means: [f64; 3] = std::array::from_fn(|c| {
        let codes = (0..edge).flat_map(|y| (0..edge).map(move |x| [x, y, (x * y) & 255][c]));
        codes.map(f64::from).sum::<f64>() / f64::from(edge * edge)
    });
    // The coarsest level is the last square, one texel.
    let last = frames[0].rgba(254, 0);
    for (c, name) in ["red", "green", "blue"].iter().enumerate() {
        stage.row(Row::within(format!("mean of {name}, in codes"), means[c], f64::from(last[c]), 4.0));
    }
    Ok(())
}

fn wheel(stage: &mut SceneRun) -> Result<()> {
    let (frames_drawn, spokes) = (6, 12);
    let mut kit = Kit::new("wheel");
    let target = kit.target("target", [96, 96], Format::Rgba8Unorm);
    let step = if stage.fault() { 22.0 } else { 23.0 };
    for frame in 0..frames_drawn {
        let turn = kit.numbers("turn", &[frame as f32 * step / 24.0, 0.0, 0.0, 0.0]);
        let source = "@group(0) @binding(0) var<uniform> turn: vec4f;
            @fragment fn fs(@builtin(position) at: vec4f) -> @location(0) vec4f {
                let p = at.xy - 48.0;
                let spoke = fract(atan2(p.y, p.x) / 6.2831853 * 12.0 - turn.x);
                return vec4f(vec3f(f32(length(p) < 45.0 && spoke < 0.4)), 1.0);
            }";
        kit.pass(&Pass { color: vec![(target, Some([0.0; 4]))], ..Pass::default() }, &[Draw::cover(source).with([turn])]);
        kit.present(target);
    }
    let trace = kit.finish();
    let frames = stage.show(&trace)?;
    let (mut wrong, mut borders) = (0, 0);
    for (number, frame) in (0..).zip(&frames) {
        for (x, y) in frame.places() {
            let [px, py] = [x, y].map(|c| f64::from(c) + 0.5 - 48.0);
            let place = libm::atan2(py, px) / std::f64::consts::TAU * f64::from(spokes) + f64::from(number) / 24.0;
            let spoke = place - place.floor();
            if (spoke - 0.4).abs() < 1e-4 || !(1e-4..1.0 - 1e-4).contains(&spoke) {
                borders += 1;
                continue;
            }
            let white = libm::hypot(px, py) < 45.0 && spoke < 0.4;
            wrong += u64::from((frame.rgba(x, y)[0] == 255) != white);
        }
    }
    stage.row(Row::none("pixels that are not those of a wheel that turns back", wrong));
    stage.row(Row::at_most("share of pixels on borders", f64::from(borders) / f64::from(frames_drawn * 96 * 96), 0.01));
    if !stage.fault() { tearing(stage, &trace, f64::from(frames_drawn)) } else { Ok(()) }
}

/// When a picture tears: with swaps at once and by the vertical blank, of a display that is slower and faster than what is drawn.
fn tearing(stage: &mut SceneRun, trace: &Trace, frames: f64) -> Result<()> {
    let mut told = Vec::new();
    for line_cycles in [16, 40, 200] {
        let line = format!("scanout.line_cycles={line_cycles}");
        let tears = |stage: &SceneRun, swap: &str| {
            let swap = format!("scanout.swap={swap}");
            let free = ["scanout.mode=free-running", "scanout.show_last=true", "scanout.buffers=2"];
            let (_, total) = stage.time(trace, &[&free[..], &[&line, &swap]].concat())?;
            Ok::<_, anyhow::Error>(counts::<DisplayCounts>(&total, DISPLAY)?.tears as f64)
        };
        let (torn, kept) = (tears(stage, "immediate")?, tears(stage, "vsync")?);
        if line_cycles < 200 {
            stage.row(Row::at_least(format!("tears with immediate swaps, {line_cycles} cycles a line"), 1.0, torn));
        } else {
            // All frames come in the blank in front of the first refresh.
            stage.row(Row::exact("tears when all swaps lie in a vertical blank", 0.0, torn));
        }
        stage.row(Row::exact(format!("tears with vsync, {line_cycles} cycles a line"), 0.0, kept));
        told.push(format!("{torn} of {} swaps with {line_cycles} cycles a line", frames - 1.0));
    }
    stage.answer(
        "When does a picture tear?",
        format!("When it is swapped at once, unless in the vertical blank: {}; never with vsync.", told.join(", ")),
    );
    Ok(())
}
