//! Only tiles that memory already has are left out: a change of any input of a tile makes it a different tile.

use fillrate::gfx::format::Format;
use fillrate::gfx::state::*;
use fillrate::machine::Config;
use fillrate::run::replay::{Fidelity, Options, Replay, replay};
use fillrate::sim::Clock;
use fillrate::trace::command::{BoundResource, LinearLayout, TextureEnd};
use fillrate::trace::record::{self, Recorder};

const WIDTH: u32 = 64;
const HEIGHT: u32 = 48;
/// Tiles of 16 pixels.
const TILES: f64 = 12.0;

const SHADER: &str = "
enable primitive_index;
@group(0) @binding(0) var<uniform> color: vec4<f32>;
@group(0) @binding(1) var image: texture_2d<f32>;
@group(0) @binding(2) var<storage, read_write> sum: array<vec4<f32>>;
struct Varying { @builtin(position) position: vec4<f32>, @location(0) tint: vec4<f32> }

@vertex fn whole(@builtin(vertex_index) index: u32) -> Varying {
    let at = vec2<f32>(f32(index & 1u), f32(index >> 1u)) * 4.0 - 1.0;
    return Varying(vec4<f32>(at, 0.5, 1.0), vec4<f32>(1.0));
}
@vertex fn part(@location(0) at: vec2<f32>, @location(1) tint: vec4<f32>) -> Varying {
    return Varying(vec4<f32>(at, 0.25, 1.0), tint);
}
@fragment fn colored(in: Varying) -> @location(0) vec4<f32> {
    let texel = textureLoad(image, vec2<u32>(in.position.xy) % 4u, 0);
    return vec4<f32>(0.5 * color.rgb + 0.25 * texel.rgb + 0.25 * in.position.x / 64.0, 0.5) * in.tint;
}
@fragment fn numbered(in: Varying, @builtin(primitive_index) number: u32) -> @location(0) vec4<f32> {
    return vec4<f32>(f32(number) / 8.0, 0.5, 0.5, 1.0);
}
@fragment fn writing(in: Varying) -> @location(0) vec4<f32> {
    sum[0] = vec4<f32>(1.0);
    return in.tint;
}
";

/// The difference in the second frame, or in both.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Other {
    Nothing,
    Vertices,
    Varyings,
    Uniform,
    Texture,
    Clear,
    Scissor,
    BlendConstant,
    Pipeline,
    Drawn,
    /// In both frames.
    Loads,
    StoresDepth,
    Writes,
    Numbered,
    /// Between the frames.
    Uploaded,
    DrawnOver,
    Wiped,
    Copied,
}

use Other::*;

/// Two frames of a picture on a cleared target: a triangle over all of it and one over a corner.
fn record(other: Other, samples: u32) -> Recorder {
    let mut card = Recorder::new("same-tiles");
    let bytes = |values: &[f32]| values.iter().flat_map(|value| value.to_le_bytes()).collect::<Vec<u8>>();
    let corner = |size: f32, tint: f32| {
        let at = [[-1.0, 1.0], [-1.0, 1.0 - size], [-1.0 + size, 1.0]];
        bytes(&at.iter().flat_map(|&[x, y]| [x, y, tint, tint, tint, 1.0]).collect::<Vec<f32>>())
    };
    let vertices = card.create_buffer_init("corner", corner(0.5, 0.5));
    let uniform = card.create_buffer_init("color", bytes(&[0.2, 0.4, 0.6, 1.0]));
    let sum = card.create_buffer("sum", 16);
    let image = card.create_texture("image", record::texture_2d(4, 4, Format::Rgba8Unorm));
    let texels: Vec<u8> = (0..64).map(|i| i * 3).collect();
    card.write_level(image, 0, "image", &texels);
    let image_view = card.create_view(image);
    let entries = [(0, record::UNIFORM), (1, record::TEXTURE), (2, record::STORAGE)];
    let layout = card.create_bind_group_layout(entries);
    let entries = [(0, record::whole(uniform)), (1, BoundResource::View(image_view)), (2, record::whole(sum))];
    let group = card.create_bind_group(layout, entries);
    let pipeline_layout = card.create_pipeline_layout([layout], 0);
    let shader = card.create_shader("same-tiles", SHADER);
    let constant = BlendComponent { src: BlendFactor::Constant, dst: BlendFactor::Zero, op: BlendOp::Add };
    let fragment = match other {
        Writes => "writing",
        Numbered => "numbered",
        _ => "colored",
    };
    let mut pipeline = |vertex: &str, fragment: &str| {
        let mut desc = record::render_pipeline(shader, Format::Rgba8Unorm);
        desc.layout = Some(pipeline_layout);
        desc.multisample.count = samples;
        desc.vertex = record::stage_entry(shader, vertex);
        desc.fragment = Some(record::stage_entry(shader, fragment));
        desc.depth_stencil = Some(record::depth_less(Format::Depth32Float));
        if vertex == "part" {
            desc.buffers = vec![record::vertex_buffer(&[(0, VertexFormat::Float32x2), (1, VertexFormat::Float32x4)])];
        }
        let blend = Some(Blend { color: constant, alpha: constant });
        desc.targets = vec![Some(ColorTarget { blend, ..record::target(Format::Rgba8Unorm) })];
        card.create_render_pipeline(vertex, desc)
    };
    let (whole, part, another) = (pipeline("whole", fragment), pipeline("part", "colored"), pipeline("whole", "colored"));

    let texture = |samples, format| record::texture_multisampled(WIDTH, HEIGHT, samples, format);
    let shown = card.create_texture("shown", texture(1, Format::Rgba8Unorm));
    let shown_view = card.create_view(shown);
    let target = if samples == 1 { shown } else { card.create_texture("target", texture(samples, Format::Rgba8Unorm)) };
    let target_view = card.create_view(target);
    let spare = card.create_texture("spare", texture(1, Format::Rgba8Unorm));
    let depth = card.create_texture("depth", texture(samples, Format::Depth32Float));
    let depth_view = card.create_view(depth);
    for frame in 0..2 {
        let now = |what: Other| frame == 1 && other == what;
        if now(Vertices) || now(Varyings) {
            let (size, tint) = if other == Vertices { (0.4, 0.5) } else { (0.5, 0.25) };
            card.write_buffer(vertices, 0, "corner-1", corner(size, tint));
        }
        if now(Uniform) {
            card.write_buffer(uniform, 0, "color-1", bytes(&[0.2, 0.4, 0.7, 1.0]));
        }
        if now(Texture) {
            card.write_level(image, 0, "image-1", &texels.iter().rev().copied().collect::<Vec<u8>>());
        }
        let picture = |card: &mut Recorder| {
            let bytes: Vec<u8> = (0..WIDTH * HEIGHT * 4).map(|i| (i % 251) as u8).collect();
            let layout = LinearLayout { offset: 0, bytes_per_row: Some(WIDTH * 4), rows_per_image: None };
            let to = TextureEnd { texture: shown, level: 0, origin: [0; 3], aspect: Aspect::All };
            card.write_texture(to, layout, [WIDTH, HEIGHT, 1], "upload", &bytes);
        };
        if now(Uploaded) && samples == 1 {
            picture(&mut card);
        }
        if now(Copied) {
            let end = |texture| TextureEnd { texture, level: 0, origin: [0; 3], aspect: Aspect::All };
            card.copy_texture_to_texture(end(spare), end(shown), [WIDTH, HEIGHT, 1]);
        }
        if other == Wiped {
            drop(card.begin_render_pass([record::clear(target_view, [0.5; 4])], None));
        }
        let clear = if now(Clear) { [0.1; 4] } else { [0.0; 4] };
        let mut color = record::clear(target_view, clear);
        if samples > 1 {
            color = record::clear_and_resolve(target_view, clear, shown_view);
        }
        if other == Loads {
            color.clear = None;
            color.store = true;
        }
        let mut pass = card.begin_render_pass([color], record::clear_depth(depth_view, other == StoresDepth));
        if now(Scissor) {
            pass.set_scissor(Rect { x: 1, y: 1, width: WIDTH - 2, height: HEIGHT - 2 });
        }
        pass.set_blend_constant(if now(BlendConstant) { [0.5; 4] } else { [1.0; 4] });
        pass.set_bind_group(0, group);
        pass.set_pipeline(if now(Pipeline) { another } else { whole });
        pass.draw(3, 1);
        pass.set_pipeline(part);
        pass.set_vertex_buffer(0, vertices);
        pass.draw(3, 1);
        drop(pass);
        if frame == 0 && other == DrawnOver || now(Drawn) {
            let color = record::load(target_view);
            let mut pass = card.begin_render_pass([color], record::clear_depth(depth_view, false));
            pass.set_blend_constant([0.25; 4]);
            pass.set_bind_group(0, group);
            pass.set_pipeline(part);
            pass.set_vertex_buffer(0, vertices);
            pass.draw(3, 1);
            drop(pass);
        }
        card.present(shown);
    }
    card
}

fn run(card: Recorder, settings: &[&str], clock: Clock) -> Replay {
    let mut config = Config::built_in("four-pipelines").expect("it is built in");
    for setting in ["sort=sort-middle-binned", "bin.tile=16", "pipelines=2"].iter().chain(settings) {
        config.set(setting).expect("a knob");
    }
    config.check().expect("knobs fit");
    let options = Options { clock, ..Options::new(config, Fidelity::Cycle) };
    replay(&card.finish(), &options, &|_| ()).expect("it runs")
}

/// Tiles of the second frame that are left out. The pictures are those of a machine that draws all.
fn same(other: Other, samples: u32) -> f64 {
    let on = run(record(other, samples), &["bin.skip_same_tiles=true"], Clock::SkipIdle);
    let off = run(record(other, samples), &[], Clock::SkipIdle);
    let pictures = |of: &Replay| of.frames.iter().map(|frame| frame.shown.clone()).collect::<Vec<_>>();
    assert!(pictures(&on) == pictures(&off), "{other:?}: other pictures");
    for frame in &on.frames {
        assert_eq!(frame.tree.number("sort.wrong_pixels"), Some(0.0), "{other:?}");
    }
    for path in ["funnel.primitives_in", "funnel.triangles_setup", "binning.list_bytes", "binning.triangle_bytes"] {
        assert_eq!(on.total.number(path), off.total.number(path), "{other:?}: {path}");
    }
    assert_eq!(off.total.number("binning.same_tiles"), Some(0.0));
    let tiles =
        |of: &Replay, frame: usize, name: &str| of.frames[frame].tree.number(&format!("binning.{name}")).expect("it counts");
    assert_eq!(tiles(&on, 0, "same_tiles"), 0.0, "{other:?}: the first frame");
    assert_eq!(tiles(&on, 1, "same_tiles") + tiles(&on, 1, "tiles"), tiles(&off, 1, "tiles"), "{other:?}");
    tiles(&on, 1, "same_tiles")
}

#[test]
fn a_tile_is_drawn_again_only_if_anything_about_it_is_other() {
    for samples in [1, 4] {
        assert_eq!(same(Nothing, samples), TILES, "{samples} samples");
        // The corner lies in the four tiles of the left upper quarter; half of it, and some more, as they were.
        for other in [Vertices, Varyings] {
            let same = same(other, samples);
            assert!((6.0..TILES).contains(&same), "{other:?}: {same} tiles");
        }
    }
    for other in [Uniform, Texture, Clear, Scissor, BlendConstant, Pipeline] {
        assert_eq!(same(other, 1), 0.0, "{other:?}");
    }
}

#[test]
fn passes_whose_results_are_wanted_otherwise_are_drawn() {
    for other in [Loads, StoresDepth, Writes, Numbered] {
        assert_eq!(same(other, 1), 0.0, "{other:?}");
    }
}

#[test]
fn what_something_else_has_written_is_drawn() {
    for other in [Uploaded, DrawnOver, Copied] {
        assert_eq!(same(other, 1), 0.0, "{other:?}");
    }
    // A clear by flag leaves memory as it is. What is drawn over a frame afterwards has no part in it.
    assert_eq!(same(Wiped, 1), TILES);
    assert_eq!(same(Drawn, 1), TILES);
}

#[test]
fn time_and_bytes_are_saved_on_either_clock() {
    let settings = ["bin.skip_same_tiles=true"];
    let (on, off) = (run(record(Nothing, 1), &settings, Clock::SkipIdle), run(record(Nothing, 1), &[], Clock::SkipIdle));
    let second = |of: &Replay, path: &str| of.frames[1].tree.number(path).expect("a number");
    assert!(second(&on, "cycles") < second(&off, "cycles"));
    assert_eq!(second(&on, "memory.clients.color.write_bytes"), 0.0);
    assert_eq!(second(&on, "funnel.fragments_shaded"), 0.0);
    assert!(second(&off, "memory.clients.color.write_bytes") > 0.0);
    for clock in [Clock::EveryCycle, Clock::Shuffled(3)] {
        assert!(run(record(Nothing, 1), &settings, clock).total.json() == on.total.json(), "{clock:?}");
    }
    // Memory for lists that does not hold the pass: tiles are drawn before all of it is known.
    let partial = run(record(Nothing, 1), &["bin.skip_same_tiles=true", "bin.memory_kib=1"], Clock::SkipIdle);
    assert!(partial.total.number("binning.partial_renders") > Some(0.0));
    assert_eq!(partial.total.number("binning.same_tiles"), Some(0.0));
    // Clears that write memory leave nothing there.
    let slow = run(record(Nothing, 1), &["bin.skip_same_tiles=true", "color.fast_clear=false"], Clock::SkipIdle);
    assert_eq!(slow.total.number("binning.same_tiles"), Some(0.0));
}
