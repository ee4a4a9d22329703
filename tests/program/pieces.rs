//! Frames that are cut out of a trace replay alone as they do in the whole: the same pictures, statistics and cycles.

use std::fs;
use std::ops::Range;
use std::path::{Path, PathBuf};

use fillrate::gfx::format::Format;
use fillrate::gfx::state::Multisample;
use fillrate::import;
use fillrate::machine::Config;
use fillrate::num::QuerySetId;
use fillrate::render::piece;
use fillrate::run::replay::{Fidelity, Frame, Options, replay};
use fillrate::trace::command::*;
use fillrate::trace::record::{self, Recorder};
use fillrate::trace::{Packing, Reading, Trace, check, write_zip};

use crate::cli::{refused, run};

/// Replays some frames of a trace.
fn frames(trace: &Trace, range: Range<u32>, config: &str) -> Vec<Frame> {
    let config = Config::built_in(config).expect("it is built in");
    let options = Options { frames: range, per_draw: true, ..Options::new(config, Fidelity::Cycle) };
    replay(trace, &options, &|_| {}).unwrap_or_else(|error| panic!("{}: {error:#}", trace.file().display())).frames
}

/// What a frame is, without its number.
fn told(frame: &Frame) -> (Option<Vec<u8>>, String, String) {
    let picture = frame.shown.as_ref().map(|(_, bytes)| bytes.to_vec());
    (picture, format!("{:?}", frame.tree), format!("{:?}", frame.phases))
}

/// Cuts frames out of a trace, writes them, and compares their replay with that of the whole.
fn compare(whole: &Trace, range: Range<u32>, config: &str) -> Trace {
    let name = whole.file().display();
    let cut = piece(whole, range.clone()).unwrap_or_else(|error| panic!("{error}")).expect("it has these frames");
    let folder = tempfile::tempdir().expect("a folder");
    let file = folder.path().join("piece.zip");
    write_zip(&cut, &file, Packing::Deflated).unwrap_or_else(|error| panic!("{name}: {error}"));
    let opened = Trace::open(&file).unwrap_or_else(|error| panic!("{name}: {error}"));
    let [expected, found] = [frames(whole, range.clone(), config), frames(&opened, 0..u32::MAX, config)];
    assert_eq!(found.len(), range.len(), "{name}");
    for (at, (expected, found)) in expected.iter().zip(&found).enumerate() {
        assert_eq!((expected.number, found.number), (range.start + at as u32, at as u32), "{name}");
        let [(picture, tree, phases), (other, other_tree, other_phases)] = [told(expected), told(found)];
        assert!(picture == other, "{name}: frame {} has another picture", expected.number);
        assert_eq!(tree, other_tree, "{name}: frame {}", expected.number);
        assert_eq!(phases, other_phases, "{name}: frame {}", expected.number);
    }
    cut
}

/// Frames that begin with samples, depths, results of queries, time stamps, debug groups and a sprite of the frames before, among objects that
/// come and go.
fn accumulating() -> Trace {
    let mut card = Recorder::new("accumulating");
    let (width, height) = (40, 24);
    let target = card.create_texture("target", record::texture_2d(width, height, Format::Rgba8Unorm));
    let samples = card.create_texture("samples", record::texture_multisampled(width, height, 4, Format::Rgba8Unorm));
    let depths = card.create_texture("depths", record::texture_multisampled(width, height, 4, Format::Depth24PlusStencil8));
    let cursor = card.create_texture("cursor", record::texture_2d(2, 2, Format::Rgba8Unorm));
    let views = [target, samples, depths, cursor].map(|texture| card.create_view(texture));
    card.write_level(cursor, 0, "cursor", &[200; 16]);
    let shader = card.create_shader(
        "triangles",
        "@group(0) @binding(0) var<uniform> seen: vec4u;
         @vertex fn vs(@builtin(vertex_index) i: u32) -> @builtin(position) vec4f {
             let frame = f32(i / 3u);
             let corner = vec2f(f32(i % 3u) - 1.0, f32(i % 3u & 1u) * 1.7 - 0.9);
             return vec4f(corner + vec2f(frame * 0.21 - 0.4, f32(seen.x & 15u) / 40.0), 0.8 - 0.13 * frame + 0.2 * corner.x, 1.0);
         }
         @fragment fn fs() -> @location(0) vec4f {
             return vec4f(f32(seen.x & 255u) / 255.0, f32(seen.z & 63u) / 63.0, 0.5, 1.0);
         }",
    );
    let pipeline = record::render_pipeline(shader, Format::Rgba8Unorm);
    let pipeline = card.create_render_pipeline(
        "triangles",
        RenderPipelineDesc {
            multisample: Multisample { count: 4, ..Multisample::default() },
            depth_stencil: Some(record::depth_less(Format::Depth24PlusStencil8)),
            ..pipeline
        },
    );
    let unused = card.create_buffer("unused", 5000);
    let seen = card.create_buffer("seen", 16);
    let explicit = card.create_bind_group_layout([(0, BindingKind::Uniform { dynamic_offset: false })]);
    let layout = card.get_bind_group_layout(AnyPipeline::Render(pipeline), 0);
    let group = card.create_bind_group(layout, [(0, record::whole(seen))]);
    let [passed, times]: [QuerySetId; 2] =
        [QueryKind::Occlusion, QueryKind::Timestamp].map(|kind| card.create_query_set(kind, 1));
    card.push(Command::Destroy(Object::BindGroupLayout(layout)));
    card.push(Command::Destroy(Object::Shader(shader)));
    card.push(Command::PushDebugGroup("scene".into()));
    for frame in 0..6 {
        let passing = card.create_buffer("passing", 3000 * (frame + 1));
        card.push(Command::Destroy(Object::Buffer(passing)));
        if frame > 0 {
            card.resolve_queries(passed, 0, 1, seen, 0);
            card.resolve_queries(times, 0, 1, seen, 8);
        }
        if frame == 1 {
            card.set_sprite(0, Some(views[3]), [5, 6]);
        }
        let color = record::clear_and_resolve(views[1], [0.1, 0.2, 0.3, 1.0], views[0]);
        let depth = record::load_depth(views[2]);
        let (color, depth) = match frame {
            0 => (color, DepthAttachment { depth_clear: Some(1.0), stencil_clear: Some(7), ..depth }),
            _ => (ColorAttachment { clear: None, ..color }, depth),
        };
        let color = ColorAttachment { store: true, ..color };
        let mut pass = card.begin_render_pass_with([color], Some(depth), Some(passed));
        pass.set_pipeline(pipeline);
        pass.set_bind_group(0, group);
        pass.occlusion_query(0, |pass| pass.draw_from(3, 1, 3 * frame as u32, 0));
        pass.push(Command::WriteTimestamp { set: times, index: 0 });
        drop(pass);
        if frame == 4 {
            card.push(Command::Destroy(Object::Buffer(unused)));
            card.push(Command::Destroy(Object::BindGroupLayout(explicit)));
        }
        card.present(target);
    }
    card.finish()
}

#[test]
fn a_piece_begins_with_what_earlier_frames_have_left() {
    let whole = accumulating();
    for config in ["tiny", "baseline", "sort-last-image"] {
        let cut = compare(&whole, 3..6, config);
        let summary = check(&cut).expect("it keeps the rules");
        assert_eq!(summary.frames, 3);
        // All textures and both query sets have contents that frames use.
        assert_eq!((summary.commands_named("RestoreTexture"), summary.commands_named("RestoreQueries")), (4, 2), "{config}");
        assert_eq!(summary.commands_named("SkipAddresses"), 2, "the objects of the whole that are left out");
        // A piece of the piece.
        compare(&cut, 1..2, config);
    }
    compare(&whole, 0..2, "tiny");
    assert!(piece(&whole, 6..9).expect("it can be read").is_none());
}

#[test]
fn pieces_of_recorded_scenes_replay_as_the_whole_does() {
    for (path, range) in [("traces/particles", 2..4), ("traces/flight.zip", 5..6)] {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join(path);
        let whole = import::open(&path).unwrap_or_else(|error| panic!("{error}"));
        compare(&whole, range, "baseline");
    }
}

#[test]
fn import_leaves_a_piece_and_names_missing_frames() {
    let out = tempfile::tempdir().expect("a folder");
    let file = |name: &str| out.path().join(name).display().to_string();
    let (code, _, message) = run(&["import", "traces/particles", "--frames", "2..4", "--out", &file("piece.zip")]);
    assert_eq!(code, 0, "{message}");
    let statistics = |trace: &str, frames: &str, name: &str| {
        let (code, _, message) = run(&["replay", trace, "--frames", frames, "--config", "tiny", "--out", &file(name)]);
        assert_eq!(code, 0, "{message}");
        let picture = fs::read_dir(file(name)).expect("a folder").filter_map(|entry| {
            let path = entry.expect("an entry").path();
            path.extension().is_some_and(|extension| extension == "png").then(|| fs::read(path).expect("a picture"))
        });
        (picture.collect::<Vec<_>>(), fs::read_to_string(Path::new(&file(name)).join("passes.csv")).expect("passes"))
    };
    let (expected, passes) = statistics("traces/particles", "3", "whole");
    let (found, own) = statistics(&file("piece.zip"), "1", "piece");
    assert_eq!(expected.len(), 1);
    assert!(expected == found, "another picture");
    let without_frame =
        |text: &str| text.lines().skip(1).map(|line| line.split_once(',').expect("columns").1.to_owned()).collect::<Vec<_>>();
    assert_eq!(without_frame(&passes), without_frame(&own), "passes have other numbers or cycles");
    assert!(passes.contains("3,") && own.contains("1,"), "{own}");
    let message = refused(&["import", "traces/particles", "--frames", "9..12", "--out", &file("none.zip")]);
    assert!(message.contains("no frame in 9..12; it has 4, numbered from 0"), "{message}");
}

/// The traces in a folder of recordings.
fn recordings(root: &Path) -> Vec<PathBuf> {
    let mut found = Vec::new();
    for kind in ["attila", "gl", "gl3", "vulkan", "wgpu"] {
        for entry in fs::read_dir(root.join(kind)).into_iter().flatten() {
            let path = entry.expect("an entry").path();
            found.extend(import::detect(&path).map(|found| found.path));
        }
    }
    found.sort();
    found
}

/// The last of the first four frames of each recording.
#[test]
fn pieces_of_recorded_programs_replay_as_the_whole_does() {
    let Some(root) = std::env::var_os("FILLRATE_PEERS") else {
        return eprintln!("left out: FILLRATE_PEERS is not set, so there are no recorded programs to cut");
    };
    let (mut compared, mut refused) = (0, 0);
    for path in recordings(Path::new(&root)) {
        let opened = |range: Range<u64>| import::open_frames(&path, &Reading { lenient: true, ..Reading::default() }, range);
        let Ok((trace, _)) = opened(0..4) else {
            refused += 1;
            continue;
        };
        let count = (1..=4).take_while(|&frames| trace.presents(frames)).count() as u32;
        let first = count.saturating_sub(1);
        let (whole, _) = opened(first.into()..u64::from(first) + 1).unwrap_or_else(|error| panic!("{error}"));
        eprintln!("{}: frame {first}", path.display());
        compare(&whole, first..first + 1, "baseline");
        compared += 1;
    }
    eprintln!("{compared} compared, {refused} refused");
    assert!(compared > 50, "{compared}");
}
