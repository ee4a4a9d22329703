//! Unread data cost nothing: attributes, varyings and texture levels that shaders do not use.

use fillrate::gfx::format::Format;
use fillrate::gfx::state::*;
use fillrate::machine::Config;
use fillrate::run::replay::{Fidelity, Options, Replay, replay};
use fillrate::trace::command::BoundResource;
use fillrate::trace::record::{self, Recorder};

/// Additional data of a scene: unread, or (`Read`) read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Extra {
    Nothing,
    /// An attribute in the layout only, one that the shader declares and does not use, a varying that is written and never read.
    Unread,
    /// Levels below the first, which the shader does not sample.
    Levels,
    Read,
}

const HEAD: &str = "
@group(0) @binding(0) var image: texture_2d<f32>;
@group(0) @binding(1) var image_sampler: sampler;
struct Varying { @builtin(position) position: vec4<f32>, @location(0) uv: vec2<f32> EXTRA_OUTPUT }
@vertex fn vertex(@location(0) at: vec2<f32> EXTRA_INPUT) -> Varying {
    return Varying(vec4<f32>(at, 0.0, 1.0), at EXTRA_VALUE);
}
@fragment fn fragment(@location(0) uv: vec2<f32> FRAGMENT_INPUT) -> @location(0) vec4<f32> {
    return textureSampleLevel(image, image_sampler, 0.5 * uv, LEVEL) FRAGMENT_VALUE;
}
";

fn shader(extra: Extra) -> String {
    let (output, input, value) = match extra {
        Extra::Unread | Extra::Read => {
            (", @location(1) more: vec4<f32>", ", @location(2) unused: vec4<f32>", ", vec4<f32>(at, at)")
        }
        Extra::Nothing | Extra::Levels => ("", "", ""),
    };
    let (input, value) = if extra == Extra::Read { (input, ", unused") } else { (input, value) };
    let (fragment, used) = if extra == Extra::Read { (", @location(1) more: vec4<f32>", "+ 0.001 * more") } else { ("", "") };
    let level = if extra == Extra::Read { "1.0" } else { "0.0" };
    HEAD.replace("EXTRA_OUTPUT", output)
        .replace("EXTRA_INPUT", input)
        .replace("EXTRA_VALUE", value)
        .replace("FRAGMENT_INPUT", fragment)
        .replace("FRAGMENT_VALUE", used)
        .replace("LEVEL", level)
}

fn record(extra: Extra) -> Recorder {
    let mut card = Recorder::new("unread");
    let attributes = matches!(extra, Extra::Unread | Extra::Read);
    let bytes = |values: Vec<f32>| values.into_iter().flat_map(f32::to_le_bytes).collect::<Vec<u8>>();
    // A grid of triangles, and 32 bytes per vertex beside their positions.
    let at = |i: u32| [i % 17, i / 17].map(|i| i as f32 / 8.0 - 1.0);
    let indices: Vec<u16> = (0..16 * 16).flat_map(|i| [0, 1, 17].map(|k| (i / 16 * 17 + i % 16 + k) as u16)).collect();
    let vertices = card.create_buffer_init("positions", bytes((0..17 * 17).flat_map(at).collect()));
    let more = card.create_buffer_init("more", bytes(vec![0.25; 17 * 17 * 8]));
    let triangles = card.create_buffer_init("triangles", bytemuck::cast_slice(&indices));
    let target = card.create_texture("target", record::texture_2d(64, 64, Format::Rgba8Unorm));
    let view = card.create_view(target);
    let sampler = card.create_sampler(record::trilinear_repeat());
    // The last of all, so that nothing lies elsewhere because of its levels.
    let levels = if matches!(extra, Extra::Levels | Extra::Read) { 6 } else { 1 };
    let image = card.create_texture("image", record::texture_mipped(32, 32, levels, Format::Rgba8Unorm));
    for level in 0..levels {
        card.write_level(image, level, &format!("level-{level}"), &vec![80 + level as u8; 4 << (2 * (5 - level))]);
    }
    let image = card.create_view(image);
    let layout = card.create_bind_group_layout([(0, record::TEXTURE), (1, record::SAMPLER)]);
    let group = card.create_bind_group(layout, [(0, BoundResource::View(image)), (1, BoundResource::Sampler(sampler))]);
    let mut desc = record::render_pipeline(card.create_shader("unread", &shader(extra)), Format::Rgba8Unorm);
    desc.layout = Some(card.create_pipeline_layout([layout], 0));
    desc.buffers = vec![record::vertex_buffer(&[(0, VertexFormat::Float32x2)])];
    if attributes {
        desc.buffers.push(record::vertex_buffer(&[(1, VertexFormat::Float32x4), (2, VertexFormat::Float32x4)]));
    }
    let pipeline = card.create_render_pipeline("unread", desc);
    let mut pass = card.begin_render_pass([record::clear(view, [0.0; 4])], None);
    pass.set_pipeline(pipeline);
    pass.set_bind_group(0, group);
    pass.set_vertex_buffer(0, vertices);
    pass.set_vertex_buffer(1, more);
    pass.set_index_buffer(triangles, IndexFormat::Uint16);
    pass.draw_indexed(indices.len() as u32, 1);
    drop(pass);
    card.present(target);
    card
}

fn run(extra: Extra) -> Replay {
    run_with(extra, &[])
}

fn run_with(extra: Extra, changes: &[&str]) -> Replay {
    let mut config = Config::built_in("four-pipelines").expect("it is built in");
    for change in changes {
        config.set(change).expect("a knob");
    }
    let options = Options::new(config, Fidelity::Cycle);
    replay(&record(extra).finish(), &options, &|_| ()).expect("it runs")
}

#[test]
fn what_nobody_reads_costs_nothing() {
    let plain = run(Extra::Nothing);
    let cost = |of: &Replay, path: &str| of.total.number(path).expect("a number");
    let fetched = "memory.clients.vertex.read_bytes";
    let texels = "memory.clients.texture.read_bytes";
    assert!(cost(&plain, fetched) > 0.0 && cost(&plain, texels) > 0.0);
    for extra in [Extra::Unread, Extra::Levels] {
        let other = run(extra);
        assert!(other.frames[0].shown == plain.frames[0].shown, "{extra:?}");
        // Each level comes to the card by a transfer of its own, whether or not anything reads it.
        let uploads = "memory.clients.command.write_bytes";
        let more = if extra == Extra::Levels { (16 * 16 + 8 * 8 + 4 * 4 + 2 * 2 + 1) * 4 } else { 0 };
        assert_eq!(cost(&other, uploads), cost(&plain, uploads) + f64::from(more), "{extra:?}");
        for path in [fetched, texels, "memory.clients.color.write_bytes", "shading.core[0].float"] {
            assert_eq!(cost(&other, path), cost(&plain, path), "{extra:?}: {path}");
        }
        if extra == Extra::Unread {
            assert_eq!(cost(&other, "cycles"), cost(&plain, "cycles"));
        }
    }
    // If they are read: 16 more bytes for each vertex, and instructions that use them.
    let read = run(Extra::Read);
    assert!(cost(&read, fetched) >= cost(&plain, fetched) + f64::from(17 * 17 * 16));
    assert!(cost(&read, "shading.core[0].float") > cost(&plain, "shading.core[0].float"));
    assert!(cost(&read, texels) != cost(&plain, texels));
}

/// A sum over all units of a kind.
fn sum(of: &Replay, list: &str, leaf: &str) -> f64 {
    (0..).map_while(|i| of.total.number(&format!("{list}[{i}].{leaf}"))).sum()
}

#[test]
fn a_card_that_does_not_know_what_is_read_pays_for_all() {
    let cost = |of: &Replay, path: &str| of.total.number(path).expect("a number");
    let fetched = "memory.clients.vertex.read_bytes";
    let off = [["fetch.skip_attributes=false"], ["interpolate.skip_varyings=false"], ["texture.skip_levels=false"]];
    for (extra, saves) in
        [(Extra::Nothing, [false, false, false]), (Extra::Unread, [true, true, false]), (Extra::Levels, [false, false, true])]
    {
        let narrow = "interpolate.words_per_cycle=4";
        let on = run_with(extra, &[narrow]);
        for (switch, saves) in off.iter().zip(saves) {
            let other = run_with(extra, &[narrow, switch[0]]);
            let context = format!("{extra:?} with {switch:?}");
            assert!(other.frames[0].shown == on.frames[0].shown, "{context}");
            for path in ["funnel.fragments_covered", "funnel.fragments_written", "funnel.vertices_in", "funnel.quads_shaded"] {
                assert_eq!(cost(&other, path), cost(&on, path), "{context}: {path}");
            }
            let same = other.total.json() == on.total.json();
            assert_eq!(same, !saves, "{context}");
            if !saves {
                continue;
            }
            match extra {
                // The buffer that nobody reads, 32 bytes per vertex (no triangle has the last); and six words interpolated in two turns
                // instead of two in one.
                Extra::Unread if switch[0].starts_with("fetch") => {
                    assert!(cost(&other, fetched) >= cost(&on, fetched) + f64::from((17 * 17 - 1) * 32), "{context}");
                }
                Extra::Unread => {
                    let busy = |of: &Replay| sum(of, "units.interpolate", "busy");
                    assert!(busy(&other) > 1.25 * busy(&on), "{context}: {} and {}", busy(&other), busy(&on));
                    assert_eq!(cost(&other, fetched), cost(&on, fetched), "{context}");
                }
                // All samples are of the first level, and would read the second, whose weight is 0, too.
                _ => {
                    let lines = |of: &Replay| sum(of, "caches.texture", "accesses");
                    let misses = |of: &Replay| sum(of, "caches.texture", "misses");
                    assert!(lines(&other) > 1.5 * lines(&on), "{context}: {} and {}", lines(&other), lines(&on));
                    assert!(misses(&other) > misses(&on), "{context}");
                }
            }
        }
    }
}
