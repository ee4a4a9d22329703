//! One picture, whatever draws it.

use anyhow::{Context, Result};
use rayon::prelude::*;

use crate::draws::{DEPTH, Sheet, Stroke, work};
use crate::harness::{config, run};
use crate::skips::rendered;
use crate::{Row, Section, Setting, Target};
use gfx::format::Format;
use gfx::state::{Blend, BlendComponent, BlendFactor, BlendOp, Compare, DepthStencil};
use machine::Config;
use num::Random;
use render::Skips;
use synthetic::{Scene, events, in_two_passes};
use trace::Trace;
use trace::command::BoundResource;
use trace::record;
use work::{Event, Funnel, RenderKey, Shade};

pub(super) const IMAGE: Target = Target {
    id: "image",
    section: Section::Exact,
    what: "The same picture, bit for bit, of every sort class, number of pipelines, tile size, latency, cache size, with every skip on and \
           off, and for every number of threads: of machines that keep API order on all scenes, of sort-last-image on opaque ones",
    bound: "exact",
    fault: "machines whose order is switched off (order.keep=never)",
    check,
};

/// A scene as work for machines: shaded are quads visible in API order, or all that are covered.
struct Picture {
    /// Whether the order in which its triangles come is of no matter.
    opaque: bool,
    work: [Vec<Event>; 2],
}

/// Random triangles with a texture, in perspective, for the renderer; the last third of them blended, if any is. Without depths one
/// covers all that came before it.
fn painted(random: &mut Random, edge: u32, samples: u32, triangles: u32, blended: bool, depths: bool) -> Trace {
    let mut sheet = Sheet::new([edge, edge * 3 / 4], samples);
    let desc = record::texture_mipped(32, 32, 6, Format::Rgba8Unorm);
    let texture = sheet.card.create_texture("texture", desc);
    for level in 0..6 {
        let texels = (32 >> level) * (32 >> level);
        let bytes: Vec<u8> = (0..4 * texels).map(|_| random.bits() as u8).collect();
        sheet.card.write_level(texture, level, "texels", &bytes);
    }
    let view = sheet.card.create_view(texture);
    let sampler = sheet.card.create_sampler(record::trilinear_repeat());
    let source = "
        struct Vertex { @builtin(position) at: vec4f, @location(0) uv: vec2f, @location(1) tint: vec2f }
        @group(0) @binding(0) var t: texture_2d<f32>;
        @group(0) @binding(1) var s: sampler;
        @vertex fn vs(@location(0) p: vec4f, @location(1) q: vec4f) -> Vertex { return Vertex(p, q.xy, q.zw); }
        @fragment fn fs(v: Vertex) -> @location(0) vec4f { return textureSample(t, s, v.uv) * vec4f(v.tint, 1.0, v.tint.y); }";
    let over = |src, dst| BlendComponent { src, dst, op: BlendOp::Add };
    let over = over(BlendFactor::SrcAlpha, BlendFactor::OneMinusSrcAlpha);
    for (count, blend) in [(triangles, false), (triangles / 2, true)] {
        if blend && !blended {
            continue;
        }
        let mut vertices = Vec::new();
        for number in 0..count {
            let [x, y, size] = [random.range(-1.0, 1.0), random.range(-1.0, 1.0), random.range(0.1, 1.2)];
            let covers = !depths && number == count / 2;
            for corner in [[-1.0, -1.0], [3.0, -1.0], [-1.0, 3.0]] {
                let w = random.range(0.5, 3.0);
                let place = [x, y].map(|c| c + random.range(-size, size));
                let [x, y] = if covers { corner } else { place }.map(|c| c * w);
                let [u, v, a, b] = [(); 4].map(|()| random.unit());
                vertices.push([x, y, random.unit() * w, w, 4.0 * u, 4.0 * v, a, b]);
            }
        }
        sheet.draw(Stroke {
            attributes: vertices,
            resources: vec![BoundResource::View(view), BoundResource::Sampler(sampler)],
            depth: depths.then_some(DepthStencil {
                depth_write: !blend,
                depth_compare: Compare::Less,
                ..record::depth_less(DEPTH)
            }),
            blend: blend.then_some(Blend { color: over, alpha: over }),
            ..Stroke::new(source, 3 * count)
        });
    }
    sheet.finish()
}

/// Traces for the renderer: opaque, blended, multisampled, over each other.
fn traces(setting: &Setting, random: &mut Random) -> Vec<(bool, Trace)> {
    let (edge, triangles) = setting.pick((64, 20), (160, 80), (320, 600));
    vec![
        (true, painted(random, edge, 1, triangles, false, true)),
        (false, painted(random, edge, 1, triangles, true, true)),
        (false, painted(random, edge, 4, triangles / 2, true, true)),
        // More than one tile of the renderer: there it asks whether a triangle covers one whole.
        (false, painted(random, 2 * edge, 1, triangles, false, false)),
    ]
}

/// Scenes of all kinds that machines tell apart.
fn scenes(setting: &Setting, round: u64) -> Vec<(bool, Scene)> {
    let (width, height, triangles) = setting.pick((72, 56, 16), (168, 136, 60), (400, 300, 500));
    let seed = setting.seed.wrapping_mul(101).wrapping_add(round);
    let plain = Scene { width, height, size: 0.5 * width as f32, triangles, seed, ..Scene::default() };
    let stencil = Some(Format::Depth24PlusStencil8);
    vec![
        (true, plain.clone()),
        (true, Scene { samples: 4, ..plain.clone() }),
        (true, Scene { compare: Compare::Greater, textures: 2, size: 9.0, triangles: 3 * triangles, ..plain.clone() }),
        (false, Scene { blend: true, ..plain.clone() }),
        (false, Scene { blend: true, depth_format: None, ..plain.clone() }),
        (false, Scene { blend: true, samples: 4, early: false, discard: true, ..plain.clone() }),
        (false, Scene { depth_format: stencil, stencil: true, draws: 4, ..plain.clone() }),
        (false, Scene { compares: vec![Compare::Less, Compare::Greater, Compare::Always], draws: 3, frames: 2, ..plain }),
    ]
}

fn pictures(setting: &Setting) -> Result<Vec<Picture>> {
    let mut all = Vec::new();
    for round in 0..setting.pick(1, 2, 4) {
        for (opaque, scene) in scenes(setting, round) {
            let work = [false, true].map(|covered| {
                let scene = Scene { covered, ..scene.clone() };
                if round % 2 == 1 { in_two_passes(&scene) } else { events(&scene) }
            });
            all.push(Picture { opaque: opaque && round % 2 == 0, work });
        }
        for (opaque, trace) in traces(setting, &mut Random::nth(setting.seed, round)) {
            let of = |shade| work(&trace, RenderKey { shade, ..RenderKey::default() });
            all.push(Picture { opaque, work: [of(Shade::Visible)?, of(Shade::Covered)?] });
        }
    }
    Ok(all)
}

/// Changes to the baseline, by what they are about. All keep API order.
const MACHINES: &[(&str, &[&[&str]])] = &[
    (
        "sort classes",
        &[
            &["sort=sort-first"],
            &["sort=sort-middle"],
            &["sort=sort-middle-binned"],
            &["sort=sort-middle-binned", "bin.hide=true", "bin.tile=16"],
            &["sort=sort-last-fragment"],
            &["sort=sort-last-fragment", "order.early=local", "network.topology=ring"],
            &["sort=sort-last-fragment", "order.early=remote", "network.topology=butterfly"],
        ],
    ),
    (
        "numbers of units",
        &[
            &["pipelines=1", "geometry_units=1"],
            &["pipelines=3", "geometry_units=5", "core.per_pipeline=2"],
            &["pipelines=8", "core.unified=false"],
            &["sort=sort-first", "pipelines=7"],
            &["sort=sort-last-fragment", "pipelines=8"],
        ],
    ),
    (
        "tiles",
        &[
            &["distribute.tile=8"],
            &["distribute.tile=16", "distribute.pattern=hashed", "distribute.overlap=bounding-box"],
            &["distribute.tile=128", "distribute.pattern=bands"],
            &["distribute.pattern=morton", "distribute.tile=32"],
            &["sort=sort-last-fragment", "distribute.tile=8"],
        ],
    ),
    (
        "latencies",
        &[
            &["memory.kind=ideal", "memory.ideal_latency=1", "memory.port_latency=1"],
            &["memory.kind=ideal", "memory.ideal_latency=900"],
            &["texture.latency=200", "color.latency=70", "clip.latency=40", "dispatch.output_latency=64"],
            &["memory.l2.latency=300", "memory.dram.t_rcd=90"],
        ],
    ),
    (
        "caches",
        &[
            &["depth.cache_blocks=4", "color.cache_blocks=4"],
            &["texture.cache_lines=1", "fetch.cache_lines=2", "fetch.reuse=0"],
            &["depth.cache_blocks=1024", "color.cache_blocks=1024", "texture.cache_lines=4096", "fetch.reuse=1024"],
            &["memory.l2.lines=64", "memory.l2.ways=2"],
            &["core.warps=2", "core.warp_width=8"],
        ],
    ),
    (
        "skips off",
        &[
            &["traverse.hierarchical_z=false"],
            &["depth.early=false"],
            &["color.fast_clear=false"],
            &["color.compression=false", "depth.compression=false"],
            &["sort=sort-middle-binned", "traverse.hierarchical_z=false", "depth.early=false", "color.fast_clear=false"],
        ],
    ),
];

/// Ways to compose frame buffers, for opaque scenes.
const COMPOSED: &[&[&str]] = &[
    &["sort=sort-last-image"],
    &["sort=sort-last-image", "pipelines=3", "compose.scheme=direct-send"],
    &["sort=sort-last-image", "pipelines=8", "compose.scheme=pipeline", "distribute.tile=8"],
    &["sort=sort-last-image", "pipelines=5", "assembly.deal=contiguous", "color.fast_clear=false"],
];

/// The pictures of API order.
fn frames(events: &[Event]) -> Vec<&[u8]> {
    fn frame(event: &Event) -> Option<&[u8]> {
        if let Event::EndFrame(end) = event { Some(&end.reference) } else { None }
    }
    events.iter().filter_map(frame).collect()
}

/// How many pictures there are of a scene, how many a machine draws, and how many of these are not those of API order.
fn drawn(machine: &Config, picture: &Picture) -> Result<[u64; 3]> {
    let key = machine.render_key();
    let events = &picture.work[usize::from(key.shade == Shade::Covered)];
    let expected = frames(events);
    let report = run(machine, events.iter().cloned())?;
    let mut differ = 0;
    for (frame, expected) in report.frames.iter().zip(&expected) {
        let picture = frame.picture.as_ref().context("a frame has no picture")?;
        differ += u64::from(picture.bytes != *expected || picture.wrong_pixels > 0);
    }
    Ok([expected.len() as u64, report.frames.len() as u64, differ])
}

/// What machines of one kind make of pictures.
fn of_machines(setting: &Setting, about: &str, kinds: &[&[&str]], pictures: &[&Picture]) -> Result<[Row; 2]> {
    let machines = kinds.iter().map(|changes| {
        let keep: &[&str] = if setting.inject_fault { &["order.keep=never"] } else { &[] };
        config("four-pipelines", &[*changes, keep].concat())
    });
    let machines = machines.collect::<Result<Vec<Config>>>()?;
    let runs: Vec<(&Config, &Picture)> =
        machines.iter().flat_map(|machine| pictures.iter().map(move |&picture| (machine, picture))).collect();
    let counts = runs.into_par_iter().map(|(machine, picture)| drawn(machine, picture)).collect::<Result<Vec<_>>>()?;
    let sum = |which: usize| counts.iter().map(|counts| counts[which]).sum::<u64>();
    Ok([
        Row::exact(format!("{about}: pictures"), sum(0) as f64, sum(1) as f64),
        Row::none(format!("{about}: pictures that differ"), sum(2)),
    ])
}

fn check(setting: &Setting) -> Result<Vec<Row>> {
    let all = pictures(setting)?;
    let mut rows = Vec::new();
    for (about, kinds) in MACHINES {
        rows.extend(of_machines(setting, about, kinds, &all.iter().collect::<Vec<_>>())?);
    }
    // Composition keeps no order that could be switched off.
    let opaque: Vec<&Picture> = all.iter().filter(|picture| picture.opaque).collect();
    rows.extend(of_machines(&Setting { inject_fault: false, ..*setting }, "composition", COMPOSED, &opaque)?);
    let (mut skips, mut colors, mut threads) = (0, 0, 0);
    for (_, trace) in traces(setting, &mut Random::nth(setting.seed, 0)) {
        let events = work(&trace, RenderKey::default())?;
        let [usual, all] = [rendered(&trace, Skips::default())?, rendered(&trace, Skips::NONE)?];
        let mut funnel = Funnel::default();
        events.iter().for_each(|event| {
            if let Event::Segment(segment) = event {
                funnel += segment.funnel
            }
        });
        skips += u64::from(usual.pictures != all.pictures || !frames(&events).into_iter().map(blake3::hash).eq(all.pictures));
        skips += u64::from(usual.funnel != all.funnel || funnel != all.funnel);
        colors += u64::from(usual.colors < all.colors);
        for number in [1, 2, 3, 8] {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(number).build()?;
            let other = pool.install(|| work(&trace, RenderKey::default()))?;
            // The work, too, not the picture alone.
            let same =
                other.len() == events.len() && other.par_iter().zip(&events).all(|(a, b)| format!("{a:?}") == format!("{b:?}"));
            threads += u64::from(!same);
        }
    }
    rows.push(Row::none("the renderer, nothing skipped, and recording: pictures and counters that differ", skips));
    rows.push(Row::exact("traces with colours that it left out", 1.0, colors as f64));
    rows.push(Row::none("the renderer on 1, 2, 3, 8 threads: works and pictures that differ", threads));
    Ok(rows)
}
