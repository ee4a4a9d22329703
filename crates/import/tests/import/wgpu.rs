//! Import of wgpu traces, against texts that the serialiser of wgpu-core 30.0.1 itself wrote: `tests/import/all` holds every
//! action and command that is imported, `tests/import/refused` what is refused, `tests/import/values.txt` every value of every
//! enumeration. `all.expected` lists the native commands of `all`; it was read through by hand, and setting `FILLRATE_BLESS`
//! writes it anew.

use std::path::{Path, PathBuf};

use gfx::format::Format;
use gfx::state;
use import::wgpu::schema;
use import::{self, FoundTrace, TraceKind};
use serde::Deserialize;
use trace::{self, Trace, TraceError};

fn folder(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/import").join(name)
}

fn text(name: &str) -> String {
    std::fs::read_to_string(folder(name)).expect(name)
}

/// The native commands, one per line.
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

/// The listing without what says where commands come from.
fn commands(trace: &Trace) -> Vec<String> {
    listing(trace).lines().filter(|line| !line.starts_with("SetCallSite")).map(str::to_owned).collect()
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

/// What is said of the only action that is left out.
fn left_out(text: &str) -> String {
    let trace = import_text(text).unwrap_or_else(|error| panic!("{text}: {error}"));
    let origin = trace.origin();
    let (count, lines) = origin.skipped();
    assert_eq!((count, lines.len()), (1, 1), "{text}: {lines:?}");
    lines[0].clone()
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
    assert_eq!(import::detect(home.path()).unwrap().kind, TraceKind::Native);
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
                let format = read::<TextureFormat>(value).known().unwrap_or_else(|error| panic!("{error}"));
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
        let text = format!("[\n{action}]");
        // What a submission asks for has run. What is only created is not missed until it is used.
        let said = if expected.contains("(Submit)") { message(&text) } else { left_out(&text) };
        let (action, reason) = expected.split_once(": ").expect("an action and a reason");
        assert!(said.contains(action) && said.ends_with(reason), "got {said}, expected {expected}");
    }
}

#[test]
fn errors_say_where_and_what() {
    let cases = [
        ("", "trace.ron:1:1: expected `[`, the beginning of a list of actions"),
        ("(1)", "trace.ron:1:1: expected `[`, the beginning of a list of actions"),
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
        ("[\nSubmit(1, [RunRender\nDropBuffer(PointerId(1)),\n", "action 0 (Submit): "),
        ("[\nSubmit(1, [RunRender\n]", "action 0 (Submit): "),
        (
            "[CreateBuffer(PointerId(1), (label: None, size: 4, usage: \"\", mapped_at_creation: false, color: 3))]",
            "there is no field color of ",
        ),
        (
            "[CreateTextureView(id: PointerId(1), parent: PointerId(2), desc: ())]",
            "trace.ron:1:2: action 0 (CreateTextureView): texture 2 is used, but no earlier action creates it",
        ),
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
        commands(&trace),
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
        commands(&trace),
        ["CreateBuffer(id:0,size:64)", "ClearBuffer(buffer:0,offset:0)", "Destroy(Buffer(0))", "CreateBuffer(id:1,size:4)",]
    );
}

#[test]
fn a_texture_that_was_invalid_can_be_dropped_but_not_used() {
    let create = "CreateTextureError(PointerId(16), (label: None, format: \"none\"))";
    assert_eq!(listing(&import_text(&format!("[{create}, DropTexture(PointerId(16))]")).unwrap()), "");
    let clear = "Submit(1, [ClearTexture(dst: PointerId(16), subresource_range: (aspect: all, baseMipLevel: 0, mipLevelCount: None, baseArrayLayer: 0, arrayLayerCount: None))])";
    let message = message(&format!("[{create}, {clear}]"));
    let expected = "trace.ron:1:2: action 0 (CreateTextureError): the texture was invalid when it was recorded; action 1 (Submit) \
                    uses texture 16";
    assert_eq!(message, expected);
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
    let found = |kind, path: &Path| Some(FoundTrace { kind, path: path.to_path_buf() });

    let native = put("native/trace.ron", b"// A trace.\nTrace(version: 1)");
    assert_eq!(import::detect(&home.path().join("native")), found(TraceKind::Native, &native));
    let wgpu = put("wgpu/trace/trace.ron", b"/* from\nwgpu */ [\n]");
    assert_eq!(import::detect(&home.path().join("wgpu")), found(TraceKind::Wgpu, &wgpu));
    assert_eq!(import::detect(&home.path().join("wgpu/trace")), found(TraceKind::Wgpu, &wgpu));
    assert_eq!(import::detect(&wgpu), found(TraceKind::Wgpu, &wgpu));
    let zip = put("a.zip", b"PK\x03\x04");
    assert_eq!(import::detect(&zip), found(TraceKind::Native, &zip));
    let apitrace = put("gl/x.trace", b"at\x10\0\0\0");
    assert_eq!(import::detect(&home.path().join("gl")), found(TraceKind::Apitrace, &apitrace));
    let gli = put("gli/tracefile.txt", b"GLI0.t\n");
    assert_eq!(import::detect(&home.path().join("gli")), found(TraceKind::GlInterceptor, &gli));
    let capture = put("vulkan/cube.gfxr", b"GFXR\0\0\0\0");
    assert_eq!(import::detect(&home.path().join("vulkan")), found(TraceKind::Gfxr, &capture));
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

/// What is said of a trace's end, and its commands.
fn cut(text: &[u8]) -> (Option<String>, String) {
    let trace = import::wgpu::import(&folder("all").join("trace.ron"), text).unwrap_or_else(|error| panic!("{error}"));
    (trace.origin().cut, listing(&trace))
}

#[test]
fn a_trace_cut_anywhere_keeps_the_actions_that_are_whole() {
    let text = text("all/trace.ron");
    let (warning, whole) = cut(text.as_bytes());
    assert_eq!(warning, None);
    let end = text.rfind(']').unwrap();
    let (mut begins, mut at) = (vec![], 0);
    for line in text.split_inclusive('\n') {
        if line.starts_with(|c: char| c.is_ascii_uppercase()) {
            begins.push(at);
        }
        at += line.len();
    }
    let mut last = String::new();
    for cut_at in (2..end).step_by(97).chain(end - 40..end).chain(begins.iter().flat_map(|&at| [at, at + 1])) {
        let (warning, commands) = cut(&text.as_bytes()[..cut_at]);
        let warning = warning.unwrap_or_else(|| panic!("cut at byte {cut_at}: no warning"));
        // The comma behind an action is not a part of it.
        let ended = |&&begin: &&usize| begin < cut_at;
        let begun = begins.iter().filter(ended).count();
        let counts = [begun, begun.saturating_sub(1)].map(|count| format!("the recording ends after {count} actions "));
        assert!(counts.iter().any(|count| warning.contains(count)), "cut at byte {cut_at}, {begun} have begun: {warning}");
        assert!(warning.contains("its program was killed"), "{warning}");
        // Objects are destroyed after the last use that is known.
        let made =
            |listing: &str| listing.lines().filter(|line| !line.starts_with("Destroy")).map(str::to_owned).collect::<Vec<_>>();
        assert!(made(&whole).starts_with(&made(&commands)), "cut at byte {cut_at}: {commands}");
        last = commands;
    }
    assert!(!last.is_empty());
}

#[test]
fn the_warning_of_a_cut_names_the_action() {
    let warning = |text: &[u8]| cut(text).0.unwrap_or_default();
    assert!(warning(b"[").starts_with("1:2: the recording ends after 0 actions without the closing `]`: its program"));
    assert!(warning(b"[\nDropBuffer(PointerId(1)),\n").starts_with("3:1: the recording ends after 1 actions without"));
    let half = warning(b"[\nDropBuffer(PointerId(1)),\nSubmit(1, [RunRen");
    assert!(
        half.starts_with("3:1: the recording ends after 1 actions without the closing `]` and inside action 1 (Submit), which"),
        "{half}"
    );
    // Inside a character of two bytes.
    let split = "[\nDropBuffer(PointerId(1)),\nSubmit(1, [PushDebugGroup(\"\u{e9}".as_bytes();
    assert!(warning(&split[..split.len() - 1]).contains("inside action 1 (Submit)"));
    // The data of the last action are lost too.
    let write = format!(
        "[\n{BUFFER},\nWriteBuffer(id: PointerId(16), data: File(\"data999.bin\"), offset: 0, size: 4, queued: true),\n"
    );
    let (lost, commands) = cut(write.as_bytes());
    assert!(
        lost.as_ref().is_some_and(|lost| lost.contains("left out is action 1 (WriteBuffer): data file"))
            && commands.starts_with("CreateBuffer"),
        "{lost:?}"
    );
    // In the middle, or where the recorder has ended the list, it is damage.
    assert!(message(&(write.clone() + "DropBuffer(PointerId(16)),\n")).contains("data999.bin"));
    assert!(message(&(write + "]")).contains("data999.bin"));
}

#[test]
fn writes_that_wgpu_refuses_do_nothing() {
    let texture = |format: &str, usage: &str, size: &str| {
        format!(
            "CreateTexture(PointerId(16), (label: None, size: {size}, mip_level_count: 1, sample_count: 1, dimension: r#2d, format: \
             {format:?}, usage: {usage:?}, view_formats: []))"
        )
    };
    let small = "(width: 4, height: 4, depthOrArrayLayers: 2)";
    let write = |layout: &str, origin: &str, size: &str, aspect: &str| {
        format!(
            "WriteTexture(to: (texture: PointerId(16), mip_level: 0, origin: {origin}, aspect: {aspect}), data: Binary(bin, [{}]), layout: \
             {layout}, size: {size})",
            "7,".repeat(64)
        )
    };
    let layout =
        |offset: u64, row: &str, rows: &str| format!("(offset: {offset}, bytes_per_row: {row}, rows_per_image: {rows})");
    let (dense, zero) = (layout(0, "Some(16)", "Some(4)"), "(x: 0, y: 0, z: 0)");
    let whole = "(width: 4, height: 4, depthOrArrayLayers: 1)";
    let rgba = texture("rgba8unorm", "COPY_DST | TEXTURE_BINDING", small);
    let good = import_text(&format!("[{rgba}, {}]", write(&dense, zero, whole, "all"))).unwrap();
    assert!(listing(&good).contains("WriteTexture") && good.origin().skipped().0 == 0, "{}", listing(&good));
    let cases = [
        (
            rgba.clone(),
            write(&layout(4, "Some(16)", "Some(4)"), zero, whole, "all"),
            "68 bytes are needed, data \"inline0.bin\" has 64",
        ),
        (rgba.clone(), write(&layout(0, "Some(12)", "Some(4)"), zero, whole, "all"), "rows of 16 bytes are 12 bytes apart"),
        (rgba.clone(), write(&layout(0, "None", "Some(4)"), zero, whole, "all"), "several rows without the number of bytes"),
        (
            rgba.clone(),
            write(&layout(0, "Some(16)", "None"), zero, "(width: 4, height: 1, depthOrArrayLayers: 2)", "all"),
            "several images without",
        ),
        (rgba.clone(), write(&layout(0, "Some(16)", "Some(3)"), zero, whole, "all"), "images of 4 rows are 3 rows apart"),
        (rgba.clone(), write(&dense, "(x: 1, y: 0, z: 0)", whole, "all"), "texels 1 + 4 reach past the 4 of level 0"),
        (rgba.clone(), write(&dense, "(x: 0, y: 0, z: 2)", whole, "all"), "texels 2 + 1 reach past the 2 of level 0"),
        (rgba.clone(), write(&dense, zero, whole, "r#stencil-only"), "rgba8unorm has no aspect StencilOnly"),
        (
            texture("rgba8unorm", "TEXTURE_BINDING", small),
            write(&dense, zero, whole, "all"),
            "the texture has no usage COPY_DST",
        ),
        (
            texture("depth32float", "COPY_DST", small),
            write(&dense, zero, whole, "all"),
            "the depth of depth32float cannot be written",
        ),
        (
            texture("depth16unorm", "COPY_DST", small),
            write(&dense, zero, "(width: 2, height: 4, depthOrArrayLayers: 1)", "all"),
            "a part of level 0",
        ),
        (
            texture("depth24plus-stencil8", "COPY_DST", small),
            write(&dense, zero, whole, "all"),
            "both aspects of depth24plus-stencil8",
        ),
        (
            texture("bc1-rgba-unorm", "COPY_DST", "(width: 8, height: 8, depthOrArrayLayers: 1)"),
            write(&dense, "(x: 2, y: 0, z: 0)", whole, "all"),
            "no whole blocks",
        ),
        (
            BUFFER.to_owned(),
            "WriteBuffer(id: PointerId(16), data: File(\"data1.bin\"), offset: 60, size: 8, queued: true)".to_owned(),
            "8 bytes at offset 60 reach past the end of the buffer of 64 bytes",
        ),
        (
            BUFFER.to_owned(),
            "WriteBuffer(id: PointerId(16), data: File(\"data1.bin\"), offset: 18446744073709551612, size: 8, queued: true)"
                .to_owned(),
            "reach past the end",
        ),
        (
            BUFFER.to_owned(),
            "WriteBuffer(id: PointerId(16), data: File(\"data1.bin\"), offset: 2, size: 8, queued: true)".to_owned(),
            "both must be multiples of 4",
        ),
        (
            BUFFER.to_owned(),
            "WriteBuffer(id: PointerId(16), data: File(\"data1.bin\"), offset: 0, size: 6, queued: true)".to_owned(),
            "both must be multiples of 4",
        ),
        (
            BUFFER.replace("COPY_DST", "VERTEX"),
            "WriteBuffer(id: PointerId(16), data: File(\"data1.bin\"), offset: 0, size: 8, queued: true)".to_owned(),
            "the buffer has no usage COPY_DST",
        ),
    ];
    for (create, write, expected) in cases {
        let text = format!("[{create}, {write}]");
        let said = left_out(&text);
        assert!(said.contains("action 1 (Write") && said.contains(expected), "got {said}, expected {expected}");
        assert!(!listing(&import_text(&text).unwrap()).contains("Write"), "{text}");
    }
}

#[test]
fn a_submission_that_failed_ran_in_no_part() {
    let clear = |offset: u64| format!("[ClearBuffer(dst: PointerId(16), offset: {offset}, size: None)]");
    let failed = |number: &str| format!("FailedCommands(commands: None, failed_at_submit: {number}, error: \"destroyed\")");
    // Another thread may create objects in between.
    let text = format!(
        "[{BUFFER}, Submit(1, {}), Submit(2, {}), CreateBuffer(PointerId(32), (label: None, size: 4, usage: \"\", mapped_at_creation: \
         false)), Submit(2, {}), {}, Submit(3, {}), {}]",
        clear(4),
        clear(8),
        clear(12),
        failed("Some(2)"),
        clear(16),
        failed("None"),
    );
    let trace = import_text(&text).unwrap_or_else(|error| panic!("{error}"));
    let expected = [
        "CreateBuffer(id:0,size:64)",
        "ClearBuffer(buffer:0,offset:4)",
        "CreateBuffer(id:1,size:4)",
        "ClearBuffer(buffer:0,offset:16)",
    ];
    assert_eq!(commands(&trace), expected);
    assert_eq!(trace.origin().skipped().0, 2);
    // What cannot be translated matters only if it ran.
    let mesh = "Submit(2, [BuildAccelerationStructures(blas: (), tlas: ())])";
    assert!(import_text(&format!("[{mesh}, {}]", failed("Some(2)"))).is_ok());
    assert!(message(&format!("[{mesh}, {}]", failed("Some(1)"))).contains("ray tracing"));
}

#[test]
fn surfaces_keep_a_configuration_that_wgpu_does_not_replace() {
    let configure = |width: u32| {
        format!(
            "ConfigureSurface(PointerId(1), (usage: \"RENDER_ATTACHMENT\", format: \"rgba8unorm\", width: {width}, height: 6))"
        )
    };
    let acquire = |id: u32| format!("GetSurfaceTexture(id: PointerId({id}), parent: PointerId(1))");
    let present = "Present(PointerId(1))";
    let of = |actions: &[&str]| {
        listing(&import_text(&format!("[{}]", actions.join(", "))).unwrap_or_else(|error| panic!("{error}")))
    };
    let texture = |id: u32, width: u32| {
        format!("CreateTexture(id:{id},desc:(size:({width},6,1),format:Rgba8Unorm),label:Some(\"surface\"))\n")
    };
    let show = |id: u32| format!("Present(texture:{id})\n");
    // A window that is minimised.
    let minimised = of(&[&configure(5), &configure(0), &acquire(2), present]);
    assert_eq!(minimised, texture(0, 5) + &show(0));
    // A texture is out.
    let out = of(&[&configure(5), &acquire(2), &configure(7), present]);
    assert_eq!(out, texture(0, 5) + &show(0));
    // Twice presented, and destroyed before.
    assert_eq!(of(&[&configure(5), &acquire(2), present, present]), texture(0, 5) + &show(0));
    assert_eq!(of(&[&configure(5), &acquire(2), "DestroyTexture(PointerId(2))", present]), texture(0, 5));
    // The facts name each configuration.
    let text = format!(
        "[{}, {}, {present}, {}, {}, {present}, {}, {present}]",
        configure(5),
        acquire(2),
        configure(7),
        acquire(3),
        acquire(4)
    );
    let trace = import_text(&text).unwrap();
    let facts: Vec<String> = trace.origin().facts.iter().map(|(name, value)| format!("{name} {value}")).collect();
    assert_eq!(facts, ["surface 5x6, rgba8unorm, 1 present", "surface 7x6, rgba8unorm, 2 presents"]);
}
