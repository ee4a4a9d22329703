//! Traces that ask for memory without a bound: they are refused before it is allocated.

use fillrate::gfx::format::Format;
use fillrate::trace::command::*;
use fillrate::trace::record::{self, Recorder};

use super::endless::Hostile;
use super::process::{below_mib, done, fillrate, refused};

/// The parts of a refusal's message: the command and its place, the bytes requested, the bytes in use, the limit and the option that raises it.
fn texts<'a>(command: &'a str, asked: &'a str, what: &'a str) -> [&'a str; 7] {
    ["trace.ron:", ": command ", command, asked, what, " are alive: ", "; --limit memory.bytes=N allows more"]
}

#[test]
fn query_sets_are_counted() {
    let mut card = Recorder::new("hostile");
    for _ in 0..1000 {
        card.create_query_set(QueryKind::Occlusion, 1 << 20);
    }
    let hostile = Hostile::new(card);
    let output = hostile.replay(&["--limit", "memory.bytes=200_000_000"]);
    refused(&output, &texts("CreateQuerySet: ", "asks for 8388864", " bytes for a query set where "));
    refused(&output, &["command 23:", "the limit of 200000000;"]);
    below_mib(&output, 400);
}

#[test]
fn textures_of_all_sizes_are_refused_before_they_are_made() {
    let texture = |size: u32, format: Format, count: u32| {
        let mut card = Recorder::new("hostile");
        for _ in 0..count {
            card.create_texture("large", record::texture_2d(size, size, format));
        }
        Hostile::new(card)
    };
    // 4 GiB, one texel's worth too many for one texture where it is 16 bytes per texel.
    let output = texture(16_384, Format::Rgba32Float, 1).replay(&["--limit", "memory.bytes=1_000_000_000"]);
    refused(&output, &texts("CreateTexture: ", "asks for 4294967296", " bytes for a texture where "));
    below_mib(&output, 200);
    let output = texture(65_536, Format::R8Unorm, 1).replay(&[]);
    refused(&output, &["trace.ron:", "CreateTexture: ", "width is 65536, it must be 1 to 16384"]);
    let output = texture(4096, Format::Rgba8Unorm, 40).replay(&["--limit", "memory.bytes=1_000_000_000"]);
    refused(&output, &texts("CreateTexture: ", "asks for 67108864", " bytes for a texture where "));
    below_mib(&output, 1200);
}

#[test]
fn small_images_with_large_tiles_are_counted_as_tiles() {
    let mut card = Recorder::new("hostile");
    let size = TextureDesc { size: [1, 1, 2048], ..record::texture_2d(1, 1, Format::Rgba32Float) };
    for _ in 0..4 {
        let texture = card.create_texture("thin", size.clone());
        for layer in 0..2048 {
            let one = ViewDesc { base_layer: layer, layers: Some(1), ..ViewDesc::default() };
            let one = ViewDesc { dimension: Some(gfx::state::ViewDimension::D2), ..one };
            let view = card.create_view_of(texture, one);
            drop(card.begin_render_pass([record::clear(view, [1.0; 4])], None));
        }
    }
    let output = Hostile::new(card).replay(&["--limit", "memory.bytes=100_000_000"]);
    refused(&output, &texts("BeginRenderPass: ", "asks for 65536", " bytes for the tiles of an attachment where "));
    below_mib(&output, 300);
}

#[test]
fn pictures_go_as_frames_end() {
    let mut card = Recorder::new("hostile");
    let texture = card.create_texture("shown", record::texture_2d(512, 512, Format::Rgba8Unorm));
    let view = card.create_view(texture);
    for k in 0..600 {
        if k < 10 {
            // Most frames show the same again.
            drop(card.begin_render_pass([record::clear(view, [f64::from(k) / 10.0; 4])], None));
        }
        card.present(texture);
    }
    let hostile = Hostile::new(card);
    let out = tempfile::TempDir::new().expect("a folder");
    for fidelity in ["functional", "bound"] {
        let arguments = ["replay".as_ref(), hostile.path().as_os_str(), "--out".as_ref(), out.path().as_os_str()];
        let run = fillrate(arguments).arg("--fidelity").arg(fidelity);
        // 600 pictures of 1 MiB.
        let output = run.memory_mib(1000).run();
        done(&output);
        below_mib(&output, 250);
        let [first, last] = ["frame-0009.png", "frame-0599.png"].map(|name| std::fs::read(out.path().join(name)).expect(name));
        assert!(first == last && !first.is_empty());
    }
}

#[test]
fn frames_without_end_leave_as_they_end() {
    let mut card = Recorder::new("hostile");
    let texture = card.create_texture("shown", record::texture_2d(64, 64, Format::Rgba8Unorm));
    (0..10_000).for_each(|_| card.present(texture));
    let hostile = Hostile::new(card);
    // Nothing is claimed for frames that have left.
    for fidelity in ["functional", "cycle"] {
        let run = fillrate(["replay".as_ref(), hostile.path().as_os_str()]).arg("--fidelity").arg(fidelity);
        let output = run.arg("--config").arg("tiny").arg("--limit").arg("memory.bytes=1_000_000").run();
        done(&output);
        below_mib(&output, 100);
    }
}

#[test]
fn what_is_created_and_destroyed_again_is_work() {
    let mut card = Recorder::new("hostile");
    for _ in 0..20_000 {
        let texture = card.create_texture("short", record::texture_2d(1024, 1024, Format::Rgba8Unorm));
        card.push(Command::ClearTexture {
            texture,
            aspect: gfx::state::Aspect::All,
            base_level: 0,
            levels: None,
            base_layer: 0,
            layers: None,
        });
        card.push(Command::Destroy(Object::Texture(texture)));
    }
    let output = Hostile::new(card).replay(&["--limit", "work.bytes=100_000_000"]);
    refused(&output, &["trace.ron:", ": command ", "the limit of 100000000; --limit work.bytes=N allows more"]);
    below_mib(&output, 300);
}
