//! The same events, pictures and errors for any number of threads.

use super::common::*;
use gfx::format::Format;
use gfx::state::{Blend, BlendComponent, BlendFactor, BlendOp, Compare, DepthStencil, VertexFormat};
use num::Limits;
use render::{Options, render};
use trace::Trace;
use trace::command::*;
use trace::record::{self, Recorder};
use work::{Event, Funnel};

const SHADER: &str = "
    struct V { @builtin(position) p: vec4<f32>, @location(0) c: vec4<f32> }
    @group(0) @binding(0) var<uniform> u: vec4<f32>;
    @vertex fn vs(@location(0) p: vec2<f32>) -> V { return V(vec4(p * u.x + u.yz, 0.5, 1.0), vec4(abs(p), u.w, 0.5)); }
    @fragment fn fs(v: V) -> @location(0) vec4<f32> {
        var c = v.c;
        loop { c.x += 0.01; if (u.w >= 0.0 || c.x < -1.0) { break; } }
        return c;
    }";

/// Frames of a cleared pass and of one that loads what it has drawn, each of many small draws. The uniforms of all draws are one buffer, which
/// is written again before each pass. In frame `endless` a loop of a shader has no end.
fn frames(count: usize, endless: Option<usize>) -> Trace {
    let mut card = Recorder::new("frames");
    let mut next = unit_noise(5);
    let size = 96;
    let texture = card.create_texture("", record::texture_2d(size, size, Format::Rgba8Unorm));
    let view = card.create_view(texture);
    let shader = card.create_shader("program", SHADER);
    let mut desc = record::render_pipeline(shader, Format::Rgba8Unorm);
    desc.buffers = vec![record::vertex_buffer(&[(0, VertexFormat::Float32x2)])];
    let pipeline = card.create_render_pipeline("", desc);
    let uniforms = card.create_buffer("uniforms", 16);
    let layout = card.get_bind_group_layout(AnyPipeline::Render(pipeline), 0);
    let group = card.create_bind_group(layout, [(0, record::whole(uniforms))]);
    let vertices = card.create_buffer_init("vertices", bytes(&bits(&[-0.2, -0.2, 0.2, -0.1, 0.0, 0.3])));
    for frame in 0..count {
        for attachment in [record::clear(view, [0.1, 0.2, 0.3, 1.0]), record::load(view)] {
            let blue = if endless == Some(frame) { -1.0 } else { next() };
            card.write_buffer(uniforms, 0, "uniforms", bytes(&bits(&[1.0 + next(), next() - 0.5, next() - 0.5, blue])));
            let mut pass = card.begin_render_pass([attachment], None);
            pass.set_pipeline(pipeline);
            pass.set_bind_group(0, group);
            pass.set_vertex_buffer(0, vertices);
            for _ in 0..50 {
                pass.draw(3, 1);
            }
        }
        card.present(texture);
    }
    card.finish()
}

/// What comes out of a rendering.
#[derive(Debug, PartialEq)]
struct Seen {
    /// Kinds of events with their counts.
    events: Vec<(&'static str, Funnel)>,
    images: Vec<Vec<u8>>,
    error: Option<String>,
}

/// The events and pictures of a trace that is rendered on `threads` threads.
fn seen(trace: &Trace, threads: usize, pictures: bool) -> Seen {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads");
    pool.install(|| {
        let (mut events, mut images) = (Vec::new(), Vec::new());
        let options = Options { pictures, ..Options::default() };
        let result = render(trace, &options, &mut |event| {
            events.push(match event {
                Event::Segment(segment) => ("segment", segment.funnel),
                Event::BeginPass(_) => ("begin", Funnel::default()),
                Event::EndPass(_) => ("end", Funnel::default()),
                Event::EndFrame(end) => {
                    images.push(end.reference.to_vec());
                    ("frame", Funnel::default())
                }
                _ => ("other", Funnel::default()),
            });
            Ok(())
        });
        Seen { events, images, error: result.err().map(|error| error.to_string()) }
    })
}

#[test]
fn any_number_of_threads_hands_on_the_same() {
    let trace = frames(12, None);
    for pictures in [false, true] {
        let alone = seen(&trace, 1, pictures);
        assert_eq!(alone.error, None);
        assert_eq!(alone.events.iter().filter(|(kind, _)| *kind == "segment").count(), 24);
        assert!(!pictures || alone.images[0] != alone.images[11], "frames differ");
        for threads in [2, 3, 8] {
            assert!(seen(&trace, threads, pictures) == alone, "{threads} threads, pictures: {pictures}");
        }
    }
}

#[test]
fn a_loop_without_an_end_is_refused_by_the_same_draw() {
    let trace = frames(8, Some(5));
    let alone = seen(&trace, 1, false);
    let text = alone.error.as_ref().expect("no end");
    assert!(text.contains("Draw") && text.contains("without an end"), "{text}");
    for threads in [2, 8] {
        assert_eq!(seen(&trace, threads, false), alone, "{threads} threads");
    }
}

#[test]
fn quads_beyond_the_limit_are_refused_by_the_same_draw() {
    let within = |quads: u64| {
        let mut limits = Limits::default();
        limits.work_quads = limits.work_quads.with(quads);
        frames(2, None).with_limits(limits)
    };
    let (mut refused, mut least) = (0, 1 << 20);
    while least - refused > 1 {
        let middle = (refused + least) / 2;
        let all = seen(&within(middle), 1, false).error.is_none();
        if all { least = middle } else { refused = middle }
    }
    for quads in [least, least - 1, least * 3 / 4, least * 5 / 8, least / 2, least / 4, least / 8, 1] {
        let trace = within(quads);
        for pictures in [false, true] {
            let alone = seen(&trace, 1, pictures);
            let text = alone.error.as_deref().unwrap_or("work.quads");
            assert_eq!((alone.error.is_none(), text.contains("work.quads")), (quads == least, true), "{quads}: {text}");
            for threads in [2, 3, 8] {
                let same = seen(&trace, threads, pictures) == alone;
                assert!(same, "{threads} threads, {quads} of {least}, pictures: {pictures}");
            }
        }
    }
}

/// Five passes on images of their own. The first covers its image six times and takes long. Each of the others covers a part of its image once.
fn uneven() -> Trace {
    let mut card = Recorder::new("uneven");
    let shader = card.create_shader(
        "program",
        "@vertex fn vs(@builtin(vertex_index) v: u32, @builtin(instance_index) i: u32) -> @builtin(position) vec4f {
            let p = vec2f(f32(v % 3u / 2u) * 4.0 - 1.0, f32(v % 3u % 2u) * 4.0 - 1.0);
            return vec4f(select(p, p * 0.5, i > 1u), 0.5, 1.0);
        }
        @fragment fn fs(@builtin(position) p: vec4f) -> @location(0) vec4f {
            var c = p;
            for (var k = 0; k < i32(p.z * 6000.0); k++) { c = c * 0.5 + p; }
            return c;
        }
        @fragment fn plain(@builtin(position) p: vec4f) -> @location(0) vec4f { return p; }",
    );
    let mut pipeline = |entry: &str| {
        let mut desc = record::render_pipeline(shader, Format::Rgba8Unorm);
        desc.fragment = desc.fragment.map(|_| record::stage_entry(shader, entry));
        card.create_render_pipeline(entry, desc)
    };
    let (slow, plain) = (pipeline("fs"), pipeline("plain"));
    let images: Vec<_> = (0..5)
        .map(|_| {
            let texture = card.create_texture("", record::texture_2d(96, 96, Format::Rgba8Unorm));
            (texture, card.create_view(texture))
        })
        .collect();
    for (at, (_, view)) in images.iter().enumerate() {
        let mut pass = card.begin_render_pass([record::clear(*view, [0.0; 4])], None);
        match at {
            0 => {
                pass.set_pipeline(slow);
                pass.draw(3, 1);
                pass.set_pipeline(plain);
                (0..5).for_each(|_| pass.draw(3, 1));
            }
            _ => {
                pass.set_pipeline(plain);
                pass.draw_from(3, 1, 0, 2);
            }
        }
    }
    card.present(images[0].0);
    card.finish()
}

/// What of a rendering on one thread is counted of quads.
fn quads(trace: &Trace) -> u64 {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().expect("a thread");
    pool.install(|| render(trace, &Options::default(), &mut |_| Ok(()))).expect("a picture").ledger.quads.spent()
}

#[test]
fn a_short_pass_behind_a_long_one_is_refused_by_the_same_draw() {
    let all = quads(&uneven());
    for (allowed, refused) in [(all, None), (all - 1, Some(4)), (all * 13 / 15, Some(2))] {
        let mut limits = Limits::default();
        limits.work_quads = limits.work_quads.with(allowed);
        let trace = uneven().with_limits(limits);
        let alone = seen(&trace, 1, true);
        let begun = alone.events.iter().filter(|(kind, _)| *kind == "begin").count();
        assert_eq!(alone.error.is_some().then(|| begun - 1), refused, "{:?}", alone.error);
        for threads in [2, 3, 8] {
            let together = seen(&trace, threads, true);
            assert_eq!(together.error, alone.error, "{threads} threads, {allowed} of {all}");
            assert!(together == alone, "{threads} threads, {allowed} of {all}");
        }
    }
}

/// One pass of `draws` small blended draws. The loop of draw `endless` has no end.
fn long(draws: u32, endless: Option<u32>) -> Trace {
    let mut card = Recorder::new("long");
    let mut next = unit_noise(11);
    let texture = card.create_texture("", record::texture_2d(96, 96, Format::Rgba8Unorm));
    let view = card.create_view(texture);
    let shader = card.create_shader("program", SHADER);
    let mut desc = record::render_pipeline(shader, Format::Rgba8Unorm);
    desc.buffers = vec![record::vertex_buffer(&[(0, VertexFormat::Float32x2)])];
    let component = BlendComponent { src: BlendFactor::SrcAlpha, dst: BlendFactor::OneMinusSrcAlpha, op: BlendOp::Add };
    desc.targets[0].as_mut().expect("a target").blend = Some(Blend { color: component, alpha: component });
    let pipeline = card.create_render_pipeline("", desc);
    let layout = card.get_bind_group_layout(AnyPipeline::Render(pipeline), 0);
    let mut group = |blue: f32| {
        let buffer = card.create_buffer_init("u", bytes(&bits(&[0.5 + next(), next() - 0.5, next() - 0.5, blue])));
        card.create_bind_group(layout, [(0, record::whole(buffer))])
    };
    let groups: Vec<_> = (0..7).map(|i| group(i as f32 / 7.0)).collect();
    let without_end = group(-1.0);
    let vertices = card.create_buffer_init("vertices", bytes(&bits(&[-0.2, -0.2, 0.2, -0.1, 0.0, 0.3])));
    let mut pass = card.begin_render_pass([record::clear(view, [0.1, 0.2, 0.3, 1.0])], None);
    pass.set_pipeline(pipeline);
    pass.set_vertex_buffer(0, vertices);
    for draw in 0..draws {
        pass.set_bind_group(0, if endless == Some(draw) { without_end } else { groups[draw as usize % groups.len()] });
        pass.draw(3, 1);
    }
    drop(pass);
    card.present(texture);
    card.finish()
}

#[test]
fn a_pass_of_many_draws_ends_with_one_sum_or_at_the_same_draw() {
    const DRAWS: u32 = 1000;
    for endless in [None, Some(20), Some(530), Some(DRAWS - 1)] {
        let trace = long(DRAWS, endless);
        let alone = seen(&trace, 1, true);
        let kinds: Vec<&str> = alone.events.iter().map(|(kind, _)| *kind).filter(|kind| *kind != "other").collect();
        match endless {
            None => assert_eq!(kinds, ["begin", "segment", "end", "frame"], "one sum per pass"),
            Some(_) => assert!(alone.error.as_deref().is_some_and(|text| text.contains("without an end")), "{endless:?}"),
        }
        for threads in [2, 8] {
            assert!(seen(&trace, threads, true) == alone, "{endless:?}, {threads} threads");
        }
    }
}

/// Frames that clear colours alone. Most of their draws leave depths alone, those of frames 3 and 7 write them, and those of frame 9 are tested.
fn depths(count: usize) -> Trace {
    let mut card = Recorder::new("depths");
    let mut next = unit_noise(7);
    let size = 96;
    let mut image = |format: Format| {
        let texture = card.create_texture("", record::texture_2d(size, size, format));
        (texture, card.create_view(texture))
    };
    let ((texture, view), (_, depth_view)) = (image(Format::Rgba8Unorm), image(Format::Depth24PlusStencil8));
    let shader = card.create_shader("program", SHADER);
    let mut desc = record::render_pipeline(shader, Format::Rgba8Unorm);
    desc.buffers = vec![record::vertex_buffer(&[(0, VertexFormat::Float32x2)])];
    let mut pipeline = |depth_write: bool, depth_compare: Compare| {
        let state = DepthStencil { depth_write, depth_compare, ..record::depth_less(Format::Depth24PlusStencil8) };
        desc.depth_stencil = Some(state);
        card.create_render_pipeline("", desc.clone())
    };
    let [idle, writes, tested] =
        [(false, Compare::Always), (true, Compare::Less), (false, Compare::Less)].map(|(w, c)| pipeline(w, c));
    let uniforms = card.create_buffer("uniforms", 16);
    let vertices = card.create_buffer_init("vertices", bytes(&bits(&[-0.2, -0.2, 0.2, -0.1, 0.0, 0.3])));
    for frame in 0..count {
        let aside = if frame == 9 { 0.1 } else { 0.0 };
        card.write_buffer(uniforms, 0, "uniforms", bytes(&bits(&[2.0, aside, 0.0, next()])));
        let first = frame == 0;
        let depth = DepthAttachment {
            depth_clear: first.then_some(1.0),
            stencil_clear: first.then_some(0),
            ..record::load_depth(depth_view)
        };
        let pipeline = match frame {
            3 | 7 => writes,
            9 => tested,
            _ => idle,
        };
        let layout = card.get_bind_group_layout(AnyPipeline::Render(pipeline), 0);
        let group = card.create_bind_group(layout, [(0, record::whole(uniforms))]);
        let mut pass = card.begin_render_pass([record::clear(view, [0.1, 0.2, 0.3, 1.0])], Some(depth));
        pass.set_pipeline(pipeline);
        pass.set_bind_group(0, group);
        pass.set_vertex_buffer(0, vertices);
        for _ in 0..50 {
            pass.draw(3, 1);
        }
        drop(pass);
        card.present(texture);
    }
    card.finish()
}

#[test]
fn depths_last_through_passes_that_do_not_write_them() {
    let trace = depths(11);
    for pictures in [false, true] {
        let alone = seen(&trace, 1, pictures);
        assert_eq!(alone.error, None);
        let drawn: Vec<_> = alone.events.iter().filter(|(kind, _)| *kind == "segment").map(|(_, funnel)| funnel).collect();
        assert_eq!(drawn.len(), 11);
        let written = |frame: usize| drawn[frame].fragments_written;
        assert!(written(9) > 0 && written(9) < written(8), "some of frame 9 is hidden");
        for threads in [2, 3, 8] {
            assert!(seen(&trace, threads, pictures) == alone, "{threads} threads, pictures: {pictures}");
        }
    }
}
