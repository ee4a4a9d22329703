//! The writer: what is written reads back the same, and the same trace gives the same bytes.

use std::fs;

use gfx::format::Format;
use gfx::state::*;
use num::*;
use trace::command::*;
use trace::record::{self, Recorder};
use trace::{Packing, Trace, TraceError, write, write_zip};

/// A recording that has something of everything.
fn sample() -> Trace {
    let mut card = Recorder::new("sample");
    let buffer = card.create_buffer_init("Vertex data/1", &[1, 2, 3, 4]);
    let same = card.create_buffer_init("same contents", &[1, 2, 3, 4]);
    card.write_buffer(same, 2, "Vertex data/1", &[9; 70_000]);
    let image = card.create_texture("image", record::texture_mipped(8, 4, 2, Format::Rgba8UnormSrgb));
    card.write_level(image, 1, "level", &[5; 32]);
    let view = card.create_view_of(image, ViewDesc { levels: Some(1), aspect: Aspect::All, ..ViewDesc::default() });
    let sampler = card.create_sampler(SamplerDesc { lod_max: 0.1, compare: Some(Compare::Less), ..record::trilinear_repeat() });
    let shader = card.create_shader("quote\" and \\", "// \u{e9}\n@fragment fn f() {}");
    let layout = card.create_bind_group_layout([(0, record::UNIFORM), (3, record::SAMPLER)]);
    let group = card.create_bind_group(layout, [(0, record::whole(buffer)), (3, BoundResource::Sampler(sampler))]);
    let mut desc = record::render_pipeline(shader, Format::Rgba8UnormSrgb);
    desc.vertex.constants.push(("scale".into(), 1.0 / 3.0));
    desc.buffers = vec![None, record::vertex_buffer(&[(0, VertexFormat::Unorm16x4), (1, VertexFormat::Snorm8x4)])];
    desc.targets.push(None);
    desc.depth_stencil = Some(DepthStencil {
        bias: 1.25,
        bias_slope: f32::MIN_POSITIVE,
        stencil_back: StencilFace { fail_op: StencilOp::Invert, ..StencilFace::default() },
        ..record::depth_less(Format::Depth24PlusStencil8)
    });
    let pipeline = card.create_render_pipeline("", desc);
    let bundle = {
        let mut bundle = card.begin_bundle();
        bundle.set_pipeline(pipeline);
        bundle.draw_from(3, 2, 1, 0);
        bundle.id()
    };
    {
        let mut pass = card.begin_render_pass([record::clear(view, [0.1, -0.0, f64::INFINITY, 1e300])], None);
        pass.set_bind_group_at(0, group, &[256]);
        pass.set_immediates(4, &[1, u32::MAX]);
        pass.execute_bundles(&[bundle]);
        pass.draw_indexed_from(6, 1, 0, -7, 0);
    }
    card.push(Command::SetBindGroup { index: 1, group: None, offsets: vec![] });
    card.push(Command::PushDebugGroup("a \"b\"\n c".into()));
    card.push(Command::Destroy(Object::Buffer(BufferId(0))));
    card.push(Command::BeginRenderPass { color: vec![None], depth: None, occlusion: None, timestamps: None, label: None });
    card.present(image);
    card.finish()
}

fn commands(trace: &Trace) -> Vec<Command> {
    let mut all = Vec::new();
    trace
        .for_each_command(|_, command| {
            all.push(command.clone());
            Ok::<_, TraceError>(())
        })
        .unwrap();
    all
}

fn assert_same(a: &Trace, b: &Trace) {
    assert_eq!(commands(a), commands(b));
    assert_eq!(a.blob_names().collect::<Vec<_>>(), b.blob_names().collect::<Vec<_>>());
    for name in a.blob_names() {
        assert!(a.blob(name).unwrap() == b.blob(name).unwrap(), "{name}");
    }
}

#[test]
fn what_is_written_reads_back_the_same() {
    let trace = sample();
    assert_eq!(
        trace.blob_names().collect::<Vec<_>>(),
        ["level.bin", "quote--and--.wgsl", "vertex-data-1-1.bin", "vertex-data-1.bin"]
    );
    let dir = tempfile::tempdir().unwrap();
    write(&trace, dir.path().join("folder")).unwrap();
    write_zip(&trace, dir.path().join("stored.zip"), Packing::Stored).unwrap();
    write_zip(&trace, dir.path().join("deflated.zip"), Packing::Deflated).unwrap();
    for name in ["folder", "stored.zip", "deflated.zip"] {
        assert_same(&trace, &Trace::open(dir.path().join(name)).unwrap());
    }
    assert!(fs::metadata(dir.path().join("deflated.zip")).unwrap().len() < 5_000);
}

#[test]
fn the_same_trace_gives_the_same_bytes() {
    let dir = tempfile::tempdir().unwrap();
    let path = |name: &str| dir.path().join(name);
    for packing in [Packing::Stored, Packing::Deflated] {
        write_zip(&sample(), path("a"), packing).unwrap();
        // What was read is written the same, and a trace can be written over itself.
        write_zip(&Trace::open(path("a")).unwrap(), path("b"), packing).unwrap();
        let again = Trace::open(path("b")).unwrap();
        write_zip(&again, path("b"), packing).unwrap();
        assert_same(&again, &sample());
        assert!(fs::read(path("a")).unwrap() == fs::read(path("b")).unwrap());
    }
    write(&sample(), path("c")).unwrap();
    write(&Trace::open(path("a")).unwrap(), path("d")).unwrap();
    for file in fs::read_dir(path("c")).unwrap() {
        let name = file.unwrap().file_name();
        assert!(fs::read(path("c").join(&name)).unwrap() == fs::read(path("d").join(&name)).unwrap(), "{name:?}");
    }
    // No byte of the text tells where it was written.
    assert!(fs::read_to_string(path("c").join("trace.ron")).unwrap().starts_with("Trace(\n    version: 1,\n    files: {\n"));
}

#[test]
fn a_folder_zipped_with_its_name_is_read() {
    use std::io::Write;
    let dir = tempfile::tempdir().unwrap();
    write(&sample(), dir.path().join("scene")).unwrap();
    let mut zip = zip::ZipWriter::new(fs::File::create(dir.path().join("scene.zip")).unwrap());
    for file in fs::read_dir(dir.path().join("scene")).unwrap() {
        let file = file.unwrap();
        let name = format!("scene/{}", file.file_name().to_str().unwrap());
        zip.start_file(name, zip::write::SimpleFileOptions::default()).unwrap();
        zip.write_all(&fs::read(file.path()).unwrap()).unwrap();
    }
    zip.finish().unwrap();
    assert_same(&sample(), &Trace::open(dir.path().join("scene.zip")).unwrap());
}

#[test]
fn damaged_archives_are_refused() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("a.zip");
    for packing in [Packing::Stored, Packing::Deflated] {
        write_zip(&sample(), &path, packing).unwrap();
        let good = fs::read(&path).unwrap();
        let read = |bytes: &[u8]| -> Result<(), TraceError> {
            fs::write(&path, bytes).unwrap();
            let trace = Trace::open(&path)?;
            trace.for_each_command(|_, _| Ok::<_, TraceError>(()))?;
            trace.blob_names().try_for_each(|name| trace.blob(name).map(|_| ()))
        };
        read(&good).unwrap();
        for length in [0, 1, good.len() / 2, good.len() - 1] {
            let message = read(&good[..length]).unwrap_err().to_string();
            assert!(message.contains("not a zip archive"), "{message}");
        }
        // A byte in the contents of the commands, and one in those of the large blob.
        // The last place of a name is in the directory, the one before it in front of the contents.
        let header = |name: &[u8]| {
            let places: Vec<usize> = (0..good.len() - name.len()).filter(|&at| good[at..].starts_with(name)).collect();
            places[places.len() - 2]
        };
        let text = header(b"trace.ron") + 70;
        let blob = header(b"vertex-data-1-1.bin") + if packing == Packing::Stored { 1000 } else { 25 };
        for (at, reason) in [(text, "damaged"), (blob, "vertex-data-1-1.bin")] {
            let mut bad = good.clone();
            bad[at] ^= 0x10;
            let message = read(&bad).unwrap_err().to_string();
            println!("{message}");
            assert!(message.contains(reason) || message.contains("inflated"), "{packing:?}: {message}");
        }
    }
}
