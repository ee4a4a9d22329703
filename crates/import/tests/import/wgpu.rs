//! Import of wgpu traces, against texts that the serialiser of wgpu-core 30.0.1 itself wrote: `tests/import/all` holds every
//! action and command that is imported, `tests/import/refused` what is refused, `tests/import/values.txt` every value of every
//! enumeration. `all.expected` lists the native commands of `all`; it was read through by hand, and setting `FILLRATE_BLESS`
//! writes it anew.

use std::path::{Path, PathBuf};

use gfx::format::Format;
use gfx::state;
use import::{self, Found, Kind};
use serde::Deserialize;
use trace::{self, Trace, TraceError};
use wgpu_text as schema;

fn folder(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/import").join(name)
}

fn text(name: &str) -> String {
    std::fs::read_to_string(folder(name)).expect(name)
}

/// The native commands, one a line.
fn listing(trace: &Trace) -> String {
    let mut text = String::new();
    trace
        .for_each_command::<TraceError>(|_, command| {
            text += &ron::to_string(command).expect("a command");
            text.push('\n');
            Ok(())
        })
        .unwrap_or_else(|error| panic!("{error}"));
    text
}

/// Imports a text as if it were the trace in `tests/import/all`, whose files are there.
fn import_text(text: &str) -> Result<Trace, TraceError> {
    import::wgpu::import(&folder("all").join("trace.ron"), text.as_bytes())
}

fn message(text: &str) -> String {
    match import_text(text) {
        Ok(_) => panic!("imported: {text}"),
        Err(error) => {
            assert!(error.place.is_some(), "without a place: {error}");
            let message = error.to_string();
            let start = message.find("trace.ron:").expect("the file");
            message[start..].to_owned()
        }
    }
}

#[test]
fn every_action_and_command_means_what_it_says() {
    let trace = import::open(folder("all")).unwrap_or_else(|error| panic!("{error}"));
    let listing = listing(&trace);
    if std::env::var_os("FILLRATE_BLESS").is_some() {
        std::fs::write(folder("all.expected"), &listing).unwrap();
    }
    let expected = text("all.expected");
    for (number, (got, want)) in listing.lines().zip(expected.lines()).enumerate() {
        assert_eq!(got, want, "command {number}");
    }
    assert_eq!(listing.lines().count(), expected.lines().count());
    assert_eq!(listing, self::listing(&import::open(folder("all")).unwrap()), "two imports differ");
}

#[test]
fn written_as_a_native_trace_it_stays_the_same() {
    let imported = import::open(folder("all")).unwrap();
    let home = tempfile::tempdir().unwrap();
    trace::write(&imported, home.path()).unwrap_or_else(|error| panic!("{error}"));
    assert_eq!(import::detect(home.path()).unwrap().kind, Kind::Native);
    let native = import::open(home.path()).unwrap_or_else(|error| panic!("{error}"));
    assert_eq!(listing(&imported), listing(&native));
    let names: Vec<_> = imported.blob_names().collect();
    assert_eq!(names, native.blob_names().collect::<Vec<_>>());
    for name in names {
        assert_eq!(imported.blob(name).unwrap(), native.blob(name).unwrap(), "{name}");
    }
}

#[test]
fn every_value_of_every_enumeration_is_known() {
    use schema::*;
    fn read<T: for<'a> Deserialize<'a>>(value: &str) -> T {
        ron::from_str(value).unwrap_or_else(|error| panic!("{value}: {error}"))
    }
    let (mut formats, mut vertex_formats) = (Vec::new(), Vec::new());
    let lines = text("values.txt");
    for line in lines.lines() {
        let (ty, value) = line.split_once(' ').expect("a type and a value");
        // Where native names are WebGPU's in another spelling, the meaning can be checked without a second table.
        let name = value.trim_start_matches("r#").replace(['-', '"'], "").to_lowercase();
        let same = |native: String| assert_eq!(native.to_lowercase(), name, "{line}");
        match ty {
            "BlendFactor" => same(format!("{:?}", state::BlendFactor::from(read::<BlendFactor>(value)))),
            "BlendOperation" => same(format!("{:?}", state::BlendOp::from(read::<BlendOperation>(value)))),
            "PrimitiveTopology" => same(format!("{:?}", state::Topology::from(read::<PrimitiveTopology>(value)))),
            "FrontFace" => same(format!("{:?}", state::FrontFace::from(read::<FrontFace>(value)))),
            "Face" => same(format!("{:?}", state::CullMode::from(read::<Face>(value)))),
            "PolygonMode" => same(format!("{:?}", state::PolygonMode::from(read::<PolygonMode>(value)))),
            "IndexFormat" => same(format!("{:?}", state::IndexFormat::from(read::<IndexFormat>(value)))),
            "StencilOperation" => same(format!("{:?}", state::StencilOp::from(read::<StencilOperation>(value)))),
            "CompareFunction" => same(format!("{:?}", state::Compare::from(read::<CompareFunction>(value)))),
            "AddressMode" => same(format!("{:?}", state::AddressMode::from(read::<AddressMode>(value)))),
            "FilterMode" => same(format!("{:?}", state::FilterMode::from(read::<FilterMode>(value)))),
            "VertexStepMode" => same(format!("{:?}", state::StepMode::from(read::<VertexStepMode>(value)))),
            "TextureDimension" | "TextureViewDimension" => {
                let native = match ty {
                    "TextureDimension" => {
                        format!("{:?}", state::TextureDimension::from(read::<TextureDimension>(value)))
                    }
                    _ => format!("{:?}", state::ViewDimension::from(read::<TextureViewDimension>(value))),
                };
                let digits = name.replace("1d", "d1").replace("2d", "d2").replace("3d", "d3");
                assert_eq!(native.to_lowercase(), digits, "{line}");
            }
            "SamplerBorderColor" => match read(value) {
                SamplerBorderColor::Zero => {}
                color => same(format!("{:?}", state::BorderColor::from(color))),
            },
            "TextureAspect" => same(format!("{:?}", read::<TextureAspect>(value))),
            "StoreOp" => same(format!("{:?}", read::<StoreOp>(value))),
            "LoadOp" => same(format!("{:?}", read::<LoadOp<u32>>(value))),
            "DrawCommandFamily" => same(format!("{:?}", read::<DrawCommandFamily>(value))),
            "DataKind" => same(format!("{:?}", read::<DataKind>(value))),
            "Data" => {
                let data = read::<Data>(value);
                assert!(data.kind().is_some(), "{line}");
            }
            "QueryType" => drop(read::<QueryType>(value)),
            "TextureFormat" => {
                let TextureFormat(format) = read(value);
                assert_eq!(format!("{:?}", format.name()), value);
                formats.push(format);
            }
            "VertexFormat" => {
                let VertexFormat(format) = read(value);
                assert_eq!(format.name(), value.trim_start_matches("r#"));
                vertex_formats.push(format);
            }
            other => panic!("unexpected type {other}"),
        }
    }
    // And all that is known natively can be said in a wgpu trace.
    formats.sort();
    assert_eq!(formats, {
        let mut all = Format::ALL.to_vec();
        all.sort();
        all
    });
    assert!(state::VertexFormat::ALL.iter().all(|format| vertex_formats.contains(format)));
}

#[test]
fn recorded_programs_pass_the_checker() {
    for (name, draws) in [("culling", 15), ("deferred", 15), ("formats", 55)] {
        let imported = import::open(folder(name)).unwrap_or_else(|error| panic!("{error}"));
        let summary = trace::check(&imported).unwrap_or_else(|error| panic!("{error}"));
        assert_eq!(summary.draws, draws, "{name}");
        let home = tempfile::tempdir().unwrap();
        trace::write(&imported, home.path()).unwrap_or_else(|error| panic!("{error}"));
        assert_eq!(listing(&imported), listing(&import::open(home.path()).unwrap()), "{name}");
    }
}

#[test]
fn what_is_out_of_scope_is_refused_by_name() {
    let expected = [
        "action 0 (CreateExternalTexture): external textures are not supported",
        "action 0 (CreateBlas): ray tracing (acceleration structures) is not supported",
        "action 0 (CreateTlas): ray tracing (acceleration structures) is not supported",
        "action 0 (CreateBindGroupLayout): binding 3: ray tracing (acceleration structures) is not supported",
        "action 0 (CreateBindGroupLayout): binding 4: external textures are not supported",
        "action 0 (CreateTexture): texture format \"nv12\" is not supported",
        "action 0 (CreateTexture): texture format \"p010\" is not supported",
        "action 0 (CreateTexture): texture format \"etc2-rgb8a1unorm-srgb\" is not supported",
        "action 0 (CreateTexture): texture format \"astc-10x6-hdr\" is not supported",
        "action 0 (CreateTexture): sample count 8 is not supported, only 1 and 4 are",
        "action 0 (CreateShaderModule): shaders in GLSL are not supported",
        "action 0 (CreateShaderModulePassthrough): passthrough shaders in DXIL, HLSL, Metal library are not supported",
        "action 0 (CreateGeneralRenderPipeline): mesh pipelines are not supported",
        "action 0 (CreateGeneralRenderPipeline): sample count 16 is not supported, only 1 and 4 are",
        "action 0 (CreateGeneralRenderPipeline): multiview is not supported",
        "action 0 (CreateGeneralRenderPipeline): conservative rasterisation is not supported",
        "action 0 (CreateRenderBundle): multiview is not supported",
        "action 0 (Submit): command 0 of the pass: mesh shading is not supported",
        "action 0 (Submit): multiview is not supported",
        "action 0 (Submit): ray tracing (acceleration structures) is not supported",
    ];
    let text = text("refused/trace.ron");
    let mut actions = Vec::new();
    let mut action = String::new();
    for line in text.lines().filter(|line| !matches!(*line, "[" | "]")) {
        action += line;
        action.push('\n');
        if line.starts_with([')', ']']) {
            actions.push(std::mem::take(&mut action));
        }
    }
    assert_eq!(actions.len(), expected.len());
    for (action, expected) in actions.iter().zip(expected) {
        let message = message(&format!("[\n{action}]"));
        assert!(message.ends_with(expected), "got {message}, expected {expected}");
    }
}

#[test]
fn errors_say_where_and_what() {
    let cases = [
        ("", "trace.ron:1:1: expected `[`, the beginning of a list of actions"),
        ("(1)", "trace.ron:1:1: expected `[`, the beginning of a list of actions"),
        ("[", "trace.ron:1:2: the file ends after 0 actions without the closing `]`: truncated, or its recorder was killed"),
        (
            "[\nDropBuffer(PointerId(1)),\n",
            "trace.ron:3:1: the file ends after 1 actions without the closing `]`: truncated, or its recorder was killed",
        ),
        ("[\n] x", "trace.ron:2:3: there is text after the end of the list"),
        (
            "[\n  DropBuffer(PointerId(1)) DropBuffer(PointerId(2))]",
            "trace.ron:2:28: expected `,` or `]` after action 0 (DropBuffer)",
        ),
        (
            "[DropBuffer(PointerId(1)),\n Explode(3),]",
            "trace.ron:2:9: action 1 (Explode): there is no variant Explode of Action",
        ),
        ("[DropBuffer(PointerId(0))]", "action 0 (DropBuffer): "),
        ("[DropBuffer(\n  7)]", "trace.ron:2:3: action 0 (DropBuffer): "),
        ("[Submit(1, [RunRender", "the file ends inside this action, it is truncated"),
        (
            "[CreateBuffer(PointerId(1), (label: None, size: 4, usage: \"\", mapped_at_creation: false, color: 3))]",
            "there is no field color of ",
        ),
        (
            "[CreateTextureView(id: PointerId(1), parent: PointerId(2), desc: ())]",
            "trace.ron:1:2: action 0 (CreateTextureView): texture 2 is used, but no earlier action creates it",
        ),
        ("[Present(PointerId(1))]", "action 0 (Present): the surface has no texture acquired"),
        ("[GetSurfaceTexture(id: PointerId(1), parent: PointerId(2))]", "was never configured"),
        (
            "[Submit(1, [ClearBuffer(dst: PointerId(1), offset: 0, size: None)])]",
            "action 0 (Submit): buffer 1 is used, but no earlier action creates it",
        ),
    ];
    for (text, expected) in cases {
        let message = message(text);
        assert!(message.contains(expected), "got {message}, expected {expected}");
    }
    let bad = import::wgpu::import(Path::new("x/trace.ron"), b"[\n\xff]").err().expect("an error").to_string();
    assert_eq!(bad, "x/trace.ron:2:1: is not UTF-8 text");
}

const BUFFER: &str = "CreateBuffer(PointerId(16), (label: None, size: 64, usage: \"COPY_DST\", mapped_at_creation: false))";

#[test]
fn payload_is_checked() {
    let write = |data: &str, offset: u64, size: u64| {
        format!("[{BUFFER},\nWriteBuffer(id: PointerId(16), data: {data}, offset: {offset}, size: {size}, queued: true)]")
    };
    let cases = [
        (write("File(\"data999.bin\")", 0, 4), "data999.bin: No such file"),
        (write("File(\"data1.bin\")", 0, 20), "data \"data1.bin\" has 16 bytes, 20 are needed"),
        (write("Binary(bin, [1, 2])", 0, 4), "has 2 bytes, 4 are needed"),
        (write("File(\"data1.bin\")", 60, 8), "8 bytes at offset 60 reach past the end of the buffer of 64 bytes"),
        (write("File(\"data1.bin\")", u64::MAX, 8), "reach past the end"),
        (write("File(\"../all/data1.bin\")", 0, 4), "blob name"),
        (write("File(\"..\")", 0, 4), "blob name"),
        (write("File(\"\")", 0, 4), "blob name"),
        (
            "[CreateShaderModule(id: PointerId(1), desc: (label: None), data: File(\"x.cso\"))]".into(),
            "does not say its language",
        ),
        ("[CreateShaderModule(id: PointerId(1), desc: (label: None), data: Binary(spv, [1]))]".into(), "no whole words"),
    ];
    for (text, expected) in cases {
        let message = message(&text);
        assert!(message.contains(expected), "got {message}, expected {expected}");
    }
    // Longer than stated is what recorders write: just the stated bytes are taken.
    let trace = import_text(&write("File(\"data1.bin\")", 0, 12)).unwrap();
    assert!(listing(&trace).contains("WriteBuffer(id:0,data:(blob:\"data1.bin\",size:12))"));
    // Nothing is written by a write of nothing.
    let trace = import_text(&write("File(\"data1.bin\")", 64, 0)).unwrap();
    assert!(!listing(&trace).contains("WriteBuffer"));
}

#[test]
fn pass_streams_are_taken_in_order_and_checked() {
    let pass = |command: &str| {
        format!(
            "[Submit(1, [RunComputePass(pass: (label: None, commands: [PopDebugGroup, {command}], dynamic_offsets: [1, 2], \
             string_data: [97, 255], immediates_data: [5]), timestamp_writes: None)])]"
        )
    };
    let cases = [
        (
            "SetBindGroup(index: 0, num_dynamic_offsets: 3, bind_group: None)",
            "command 1 of the pass: 3 dynamic offsets are asked for, 2 are left",
        ),
        ("SetImmediate(offset: 0, size_bytes: 6, values_offset: 0)", "6 bytes of immediates are no whole words"),
        (
            "SetImmediate(offset: 0, size_bytes: 8, values_offset: 0)",
            "2 words of immediates from word 0 on are asked for, there are 1",
        ),
        ("SetImmediate(offset: 0, size_bytes: 4, values_offset: 4294967295)", "there are 1"),
        ("PushDebugGroup(color: 0, len: 3)", "a command needs a label of 3 bytes, and 2 bytes of labels are left"),
        ("PushDebugGroup(color: 0, len: 2)", "a label is not UTF-8 text"),
    ];
    for (command, expected) in cases {
        let message = message(&pass(command));
        assert!(message.contains(expected), "got {message}, expected {expected}");
    }
}

#[test]
fn addresses_come_back_for_new_objects() {
    let text = format!(
        "[{BUFFER}, DropBuffer(PointerId(16)), // comments are allowed
         /* also /* nested */ ones */ {BUFFER},
         Submit(1, [ClearBuffer(dst: PointerId(16), offset: 0, size: None)]), DropBuffer(PointerId(16)), {BUFFER},
         Submit(2, [ClearBuffer(dst: PointerId(16), offset: 4, size: None)])]"
    );
    let trace = import_text(&text).unwrap_or_else(|error| panic!("{error}"));
    assert_eq!(
        listing(&trace).lines().collect::<Vec<_>>(),
        [
            "CreateBuffer(id:0,size:64)",
            "Destroy(Buffer(0))",
            "CreateBuffer(id:1,size:64)",
            "ClearBuffer(buffer:1,offset:0)",
            "Destroy(Buffer(1))",
            "CreateBuffer(id:2,size:64)",
            "ClearBuffer(buffer:2,offset:4)",
        ]
    );
}

#[test]
fn a_drop_before_the_submit_keeps_the_object() {
    let text = format!(
        "[{BUFFER}, DropBuffer(PointerId(16)), Submit(1, [ClearBuffer(dst: PointerId(16), offset: 0, size: None)]),
         CreateBuffer(PointerId(32), (label: None, size: 4, usage: \"\", mapped_at_creation: false))]"
    );
    let trace = import_text(&text).unwrap();
    assert_eq!(
        listing(&trace).lines().collect::<Vec<_>>(),
        ["CreateBuffer(id:0,size:64)", "ClearBuffer(buffer:0,offset:0)", "Destroy(Buffer(0))", "CreateBuffer(id:1,size:4)",]
    );
}

#[test]
fn a_texture_that_was_invalid_can_be_dropped_but_not_used() {
    let create = "CreateTextureError(PointerId(16), (label: None, format: \"none\"))";
    assert_eq!(listing(&import_text(&format!("[{create}, DropTexture(PointerId(16))]")).unwrap()), "");
    let message = message(&format!("[{create}, CreateTextureView(id: PointerId(1), parent: PointerId(16), desc: ())]"));
    assert!(message.contains("texture 16 is used, but was invalid when it was recorded"), "{message}");
}

#[test]
fn kinds_are_told_apart() {
    let home = tempfile::tempdir().unwrap();
    let put = |name: &str, bytes: &[u8]| {
        let path = home.path().join(name);
        std::fs::create_dir_all(path.parent().unwrap()).unwrap();
        std::fs::write(&path, bytes).unwrap();
        path
    };
    let found = |kind, path: &Path| Some(Found { kind, path: path.to_path_buf() });

    let native = put("native/trace.ron", b"// A trace.\nTrace(version: 1)");
    assert_eq!(import::detect(&home.path().join("native")), found(Kind::Native, &native));
    let wgpu = put("wgpu/trace/trace.ron", b"/* from\nwgpu */ [\n]");
    assert_eq!(import::detect(&home.path().join("wgpu")), found(Kind::Wgpu, &wgpu));
    assert_eq!(import::detect(&home.path().join("wgpu/trace")), found(Kind::Wgpu, &wgpu));
    assert_eq!(import::detect(&wgpu), found(Kind::Wgpu, &wgpu));
    let zip = put("a.zip", b"PK\x03\x04");
    assert_eq!(import::detect(&zip), found(Kind::Native, &zip));
    let apitrace = put("gl/x.trace", b"at\x10\0\0\0");
    assert_eq!(import::detect(&home.path().join("gl")), found(Kind::Apitrace, &apitrace));
    let gli = put("gli/tracefile.txt", b"GLI0.t\n");
    assert_eq!(import::detect(&home.path().join("gli")), found(Kind::GlInterceptor, &gli));
    let none = put("notes/notes.txt", b"hello");
    assert_eq!(import::detect(&none), None);
    assert_eq!(import::detect(none.parent().unwrap()), None);
    assert_eq!(import::detect(Path::new("/does/not/exist")), None);

    let refused = |path: &Path| import::open(path).err().expect("an error").to_string();
    let ended = refused(&apitrace);
    assert!(ended.contains("x.trace: call 0, byte 0: ends inside a chunk: 0 of its 16 bytes"), "{ended}");
    assert!(refused(&none).contains("is no trace"));
    assert!(refused(Path::new("/does/not/exist")).contains("No such file"));
}

#[test]
fn a_trace_cut_anywhere_is_refused() {
    let text = text("all/trace.ron");
    let end = text.rfind(']').unwrap();
    for cut in (0..end).step_by(211).chain(end - 40..end) {
        if text.is_char_boundary(cut) {
            assert!(import_text(&text[..cut]).is_err(), "cut at byte {cut}");
        }
    }
}
