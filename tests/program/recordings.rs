//! Recorded wgpu programs whose actions failed, whose end is cut, or that draw nothing: what is replayed, what is said, and what is refused.

use std::fs;
use std::path::Path;

use fillrate::import;
use fillrate::machine::Config;
use fillrate::render::{Dependencies, Inspection, inspect};
use fillrate::run::replay::{Fidelity, Frame, Options, replay};
use fillrate::run::sample::Sampling;
use fillrate::trace::Trace;

use crate::cli::{refused, run};

const INIT: &str = "Init(desc: (label: None, required_features: \"SHADER_INT64 | IMMEDIATES\", required_limits: (maxTextureDimension2D: 8192, \
                    maxBindGroups: 4), memory_hints: Performance, trace: Off), backend: Vulkan)";

/// A module with stages that fit the target, and some that do not.
const SHADER: &str = "@group(0) @binding(0) var<uniform> tint: vec4f;
    @vertex fn vs(@builtin(vertex_index) i: u32) -> @builtin(position) vec4f {
        return vec4f(f32(i & 1u) * 4.0 - 1.0, f32(i & 2u) * 2.0 - 1.0, 0.5, 1.0);
    }
    @vertex fn one(@location(3) p: vec4f) -> @builtin(position) vec4f { return p; }
    @fragment fn fs() -> @location(0) vec4f { return tint; }
    @fragment fn plain() -> @location(0) vec4f { return vec4f(0.5, 0.25, 1.0, 1.0); }
    @fragment fn whole() -> @location(0) vec4u { return vec4u(1u); }
    @compute @workgroup_size(1) fn cs() {}";

const WIDE: &str = "@fragment fn fs() -> @location(0) vec4f {\n  let a = u64(tint.x);\n  return vec4f(f32(a));\n}\n\
                    @group(0) @binding(0) var<uniform> tint: vec4f;";

fn module(id: u32, source: &str) -> String {
    format!("CreateShaderModule(id: PointerId({id}), desc: (label: None), data: String(wgsl, {source:?}))")
}

/// A render pipeline of module 10, or of another fragment module; `change` is made to its text.
fn pipeline(id: u32, fragment: (u32, &str), change: (&str, &str)) -> String {
    let stage = |module: u32, entry: &str| {
        format!(
            "(module: PointerId({module}), entry_point: Some({entry:?}), constants: {{}}, zero_initialize_workgroup_memory: true)"
        )
    };
    let (vertex, fragment) = (stage(10, "vs"), stage(fragment.0, fragment.1));
    format!(
        "CreateGeneralRenderPipeline(id: PointerId({id}), desc: (label: Some(\"p{id}\"), layout: None, vertex: Vertex((stage: {vertex}, \
         buffers: [])), primitive: (topology: r#triangle-list, stripIndexFormat: None, frontFace: ccw, cullMode: None, unclippedDepth: \
         false, polygonMode: fill, conservative: false), depth_stencil: None, multisample: (count: 1, mask: 18446744073709551615, \
         alphaToCoverageEnabled: false), fragment: Some((stage: {fragment}, targets: [Some((format: \"rgba8unorm\", blend: None, \
         writeMask: 15))])), multiview_mask: None, cache: None))"
    )
    .replace(change.0, change.1)
}

fn pass(view: u32, commands: &str) -> String {
    format!(
        "RunRenderPass(pass: (label: None, commands: [{commands}], dynamic_offsets: [], string_data: [], immediates_data: []), \
         color_attachments: [Some((view: PointerId({view}), depth_slice: None, resolve_target: None, load_op: clear((r: 0.25, g: 0.5, b: 0.75, a: \
         1.0)), store_op: store))], depth_stencil_attachment: None, timestamp_writes: None, occlusion_query_set: None, multiview_mask: None)"
    )
}

const DRAW: &str = "Draw(vertex_count: 3, instance_count: 1, first_vertex: 0, first_instance: 0)";

fn set_pipeline(id: u32) -> String {
    format!("SetPipeline(PointerId({id}))")
}

/// A frame that draws with pipeline 20 and bind group 31, with some more commands in front.
fn frame(number: u32, more: &str) -> String {
    let set = "SetBindGroup(index: 0, num_dynamic_offsets: 0, bind_group: Some(PointerId(31)))";
    let draw = pass(101, &format!("{}, {set}, {DRAW}", set_pipeline(20)));
    format!(
        "GetSurfaceTexture(id: PointerId(100), parent: PointerId(1)),\n\
         CreateTextureView(id: PointerId(101), parent: PointerId(100), desc: ()),\n\
         Submit({number}, [{more}{draw}]),\nPresent(PointerId(1)),\n"
    )
}

fn surface(width: u32) -> String {
    format!("ConfigureSurface(PointerId(1), (usage: \"RENDER_ATTACHMENT\", format: \"rgba8unorm\", width: {width}, height: 6))")
}

/// What a program makes before its frames.
fn setup() -> String {
    [
        INIT.to_owned(),
        surface(8),
        module(10, SHADER),
        pipeline(20, (10, "fs"), ("", "")),
        "GetRenderPipelineBindGroupLayout(id: PointerId(30), pipeline: PointerId(20), index: 0)".into(),
        "CreateBuffer(PointerId(40), (label: None, size: 16, usage: \"UNIFORM | COPY_DST\", mapped_at_creation: false))".into(),
        // 1.0, 0.5, 0.25, 1.0.
        "WriteBuffer(id: PointerId(40), data: Binary(bin, [0, 0, 128, 63, 0, 0, 0, 63, 0, 0, 128, 62, 0, 0, 128, 63]), offset: 0, size: 16, \
         queued: true)"
            .into(),
        "CreateBindGroup(PointerId(31), (label: None, layout: PointerId(30), entries: [(binding: 0, resource: Buffer((buffer: \
         PointerId(40), offset: 0, size: None)))]))"
            .into(),
    ]
    .map(|action| action + ",\n")
    .concat()
}

fn opened(text: &str) -> Result<Trace, String> {
    import::wgpu::import(Path::new("x/trace.ron"), text.as_bytes()).map_err(|error| error.to_string())
}

/// The pictures of a recording's frames.
fn pictures(text: &str) -> Result<Vec<Vec<u8>>, String> {
    let trace = opened(text)?;
    let options = Options::new(Config::built_in("baseline").expect("it is built in"), Fidelity::Functional);
    let replayed = replay(&trace, &options, &|_| {}).map_err(|error| format!("{error:#}"))?;
    let shown = |frame: Frame| frame.shown.map_or(Vec::new(), |(_, bytes)| bytes.to_vec());
    Ok(replayed.frames.into_iter().map(shown).collect())
}

/// Actions that fail, or ask for what is not supported: each with a part of what is said of it.
fn failures() -> Vec<(&'static str, String, &'static str)> {
    let texture = |id: u32, change: (&str, &str)| {
        format!(
            "CreateTexture(PointerId({id}), (label: Some(\"t{id}\"), size: (width: 4, height: 4, depthOrArrayLayers: 1), mip_level_count: 1, \
             sample_count: 1, dimension: r#2d, format: \"rgba8unorm\", usage: \"COPY_DST | TEXTURE_BINDING\", view_formats: []))"
        )
        .replace(change.0, change.1)
    };
    let write = |bytes: usize, row: &str| {
        format!(
            "WriteTexture(to: (texture: PointerId(50), mip_level: 0, origin: (x: 0, y: 0, z: 0), aspect: all), data: Binary(bin, [{}]), layout: \
             (offset: 0, bytes_per_row: {row}, rows_per_image: None), size: (width: 4, height: 4, depthOrArrayLayers: 1))",
            "9, ".repeat(bytes)
        )
    };
    let poison = |offset: u32, size: usize| {
        format!(
            "WriteBuffer(id: PointerId(40), data: Binary(bin, [{}]), offset: {offset}, size: {size}, queued: true)",
            "9, ".repeat(size)
        )
    };
    let view = "CreateTextureView(id: PointerId(51), parent: PointerId(50), desc: ())";
    let bound = "CreateBindGroupLayout(PointerId(52), (label: None, entries: [(binding: 0, visibility: \"FRAGMENT\", ty: Texture(sample_type: \
                 float(filterable: true), view_dimension: r#2d, multisampled: false), count: None)])),\nCreateBindGroup(PointerId(53), (label: \
                 None, layout: PointerId(52), entries: [(binding: 0, resource: TextureView(PointerId(51)))]))";
    let compute = "CreateComputePipeline(id: PointerId(21), desc: (label: Some(\"c\"), layout: None, stage: (module: PointerId(10), entry_point: \
                   Some(\"nowhere\"), constants: {}, zero_initialize_workgroup_memory: true), cache: None))";
    let entry = "(binding: 0, visibility: \"FRAGMENT\", ty: Sampler(filtering), count: None)";
    let bundle = "CreateRenderBundle(id: PointerId(60), desc: (label: None, color_formats: [Some(\"rgba8unorm\")], depth_stencil: None, \
                  sample_count: 1, multiview: None), base: (label: None, commands: [SetPipeline(PointerId(21))], dynamic_offsets: [], string_data: \
                  [], immediates_data: []))";
    let mesh = ("vertex: Vertex((stage:", "vertex: Mesh((), (stage:");
    vec![
        // The renderer tells these when they are used; `inspect` always does.
        ("entry point", pipeline(21, (10, "nowhere"), ("", "")), "render pipeline `p21`"),
        ("compute entry point", compute.into(), "compute pipeline `c`"),
        ("target", pipeline(21, (10, "whole"), ("", "")), "the fragment stage writes Uint"),
        ("no output", pipeline(21, (10, "plain"), ("targets: [", "targets: [None, ")), "no such output"),
        ("attribute", pipeline(21, (10, "plain"), ("\"vs\"", "\"one\"")), "no vertex buffer gives @location(3)"),
        ("64-bit integers", format!("{},\n{}", module(11, WIDE), pipeline(21, (11, "fs"), ("", ""))), "SHADER_INT64"),
        ("text", format!("{},\n{}", module(11, "fn fs( {"), pipeline(21, (11, "fs"), ("", ""))), "shader `inline"),
        (
            "layout of a broken one",
            format!(
                "{},\nGetRenderPipelineBindGroupLayout(id: PointerId(32), pipeline: PointerId(21), index: 0)",
                pipeline(21, (10, "nowhere"), ("", ""))
            ),
            "p21",
        ),
        // The importer tells these.
        ("mesh", pipeline(21, (10, "plain"), mesh), "mesh pipelines are not supported"),
        (
            "multiview",
            pipeline(21, (10, "plain"), ("multiview_mask: None", "multiview_mask: Some(3)")),
            "multiview is not supported",
        ),
        (
            "conservative",
            pipeline(21, (10, "plain"), ("conservative: false", "conservative: true")),
            "conservative rasterisation",
        ),
        ("8 samples", pipeline(21, (10, "plain"), ("count: 1,", "count: 8,")), "sample count 8"),
        (
            "etc2 target",
            pipeline(21, (10, "plain"), ("\"rgba8unorm\"", "\"etc2-rgb8unorm\"")),
            "texture format \"etc2-rgb8unorm\"",
        ),
        (
            "blended integers",
            pipeline(
                21,
                (10, "whole"),
                (
                    "format: \"rgba8unorm\", blend: None",
                    "format: \"rgba8uint\", blend: Some((color: (srcFactor: one, dstFactor: one, operation: add), alpha: (srcFactor: one, dstFactor: one, operation: add)))",
                ),
            ),
            "cannot be blended",
        ),
        (
            "nothing to draw on",
            pipeline(
                21,
                (10, "plain"),
                ("targets: [Some((format: \"rgba8unorm\", blend: None, writeMask: 15))]", "targets: []"),
            ),
            "neither a colour target",
        ),
        (
            "9 groups",
            format!(
                "CreatePipelineLayout(PointerId(22), (label: None, bind_group_layouts: [{}], immediate_size: 0))",
                "None, ".repeat(9)
            ),
            "9 groups, at most 8",
        ),
        (
            "immediates",
            "CreatePipelineLayout(PointerId(22), (label: None, bind_group_layouts: [], immediate_size: 6))".into(),
            "6 bytes of immediates",
        ),
        (
            "binding twice",
            format!("CreateBindGroupLayout(PointerId(33), (label: None, entries: [{entry}, {entry}]))"),
            "binding 0 is given twice",
        ),
        (
            "no group",
            format!(
                "CreatePipelineLayout(PointerId(22), (label: None, bind_group_layouts: [], immediate_size: 0)),\n{},\nGetRenderPipelineBindGroupLayout(id: PointerId(32), pipeline: PointerId(21), index: 1)",
                pipeline(21, (10, "plain"), ("layout: None", "layout: Some(PointerId(22))"))
            ),
            "no group 1",
        ),
        ("bundle", format!("{},\n{bundle}", pipeline(21, (10, "plain"), mesh)), "it uses render pipeline \"p21\""),
        ("empty texture", texture(50, ("width: 4", "width: 0")), "width is 0"),
        ("large texture", texture(50, ("width: 4", "width: 9000")), "the device allows 8192 (maxTextureDimension2D)"),
        ("levels", texture(50, ("mip_level_count: 1", "mip_level_count: 7")), "7 levels"),
        ("2 samples", texture(50, ("sample_count: 1", "sample_count: 2")), "sample count 2"),
        (
            "etc2",
            format!("{},\n{view},\n{bound},\n{}", texture(50, ("rgba8unorm", "etc2-rgb8unorm")), write(64, "Some(16)")),
            "texture format \"etc2-rgb8unorm\"",
        ),
        ("write past the end", poison(12, 16), "16 bytes at offset 12 reach past the end of the buffer of 16 bytes"),
        ("write at an odd place", poison(2, 4), "multiples of 4"),
        ("write of an odd size", poison(0, 3), "multiples of 4"),
        ("few texels", format!("{},\n{}", texture(50, ("", "")), write(60, "Some(16)")), "64 bytes are needed"),
        ("texels without pitch", format!("{},\n{}", texture(50, ("", "")), write(64, "None")), "several rows"),
        (
            "texels without usage",
            format!("{},\n{}", texture(50, ("COPY_DST | ", "")), write(64, "Some(16)")),
            "no usage COPY_DST",
        ),
        (
            "texels of no texture",
            format!("{},\n{}", texture(50, ("width: 4", "width: 0")), write(64, "Some(16)")),
            "it uses texture \"t50\"",
        ),
        (
            "commands",
            "FailedCommands(commands: None, failed_at_submit: None, error: \"a bad pass\")".into(),
            "a command buffer: a bad pass",
        ),
        ("empty surface", surface(0), "a surface of 0x6"),
        ("acceleration structure", "CreateBlas(id: PointerId(70), desc: (), sizes: ())".into(), "ray tracing"),
    ]
}

fn said_by(trace: &Trace) -> String {
    let Inspection { refused, unused, .. } = inspect(trace).unwrap_or_else(|error| panic!("{error}"));
    assert!(refused.is_empty(), "{refused:?}");
    let unused: Vec<String> = unused.iter().map(ToString::to_string).collect();
    format!("{}\n{}", trace.origin().skipped().1.join("\n"), unused.join("\n"))
}

#[test]
fn actions_that_failed_change_no_picture_and_are_listed() {
    let text = |more: &str| format!("[\n{}{more}{}{}]", setup(), frame(1, ""), frame(2, ""));
    let expected = pictures(&text("")).unwrap_or_else(|error| panic!("{error}"));
    assert_eq!(expected.len(), 2);
    assert!(expected.iter().all(|picture| picture.chunks(4).all(|texel| texel == [255, 128, 64, 255])), "{expected:?}");
    for (name, actions, reason) in failures() {
        let text = text(&(actions + ",\n"));
        let drawn = pictures(&text).unwrap_or_else(|error| panic!("{name}: {error}"));
        assert!(drawn == expected, "{name} changes the picture");
        let said = said_by(&opened(&text).expect("it was opened before"));
        assert!(said.contains(reason), "{name}: {said}");
    }
    // A submission whose second command buffer fails draws nothing: not even the first.
    let red = pass(101, "").replace("0.25", "1.0");
    let failed = frame(3, "").replace(
        "Submit(",
        &format!("Submit(2, [{red}]), FailedCommands(commands: None, failed_at_submit: Some(2), error: \"x\"),\nSubmit("),
    );
    let drawn = pictures(&format!("[\n{}{}{failed}]", setup(), frame(1, ""))).unwrap_or_else(|error| panic!("{error}"));
    assert!(drawn == expected, "a failed submission has drawn");
}

#[test]
fn what_a_failed_action_should_have_made_is_refused_by_name_where_it_is_used() {
    let used = |actions: &str, commands: &str| {
        format!("[\n{}{actions},\n{}]", setup(), frame(1, &format!("{}, ", pass(101, commands))))
    };
    let draw = format!("{}, {DRAW}", set_pipeline(21));
    let bundle = "SetPipeline(PointerId(20)), ExecuteBundle(PointerId(60))";
    let group = format!(
        "{}, SetBindGroup(index: 0, num_dynamic_offsets: 0, bind_group: Some(PointerId(53))), {DRAW}",
        set_pipeline(20)
    );
    let mut checked = 0;
    for (name, actions, reason) in failures() {
        let commands = match name {
            // Nothing dispatches; the pass refuses it before; another action fails.
            "compute entry point" | "no output" | "layout of a broken one" | "no group" => continue,
            "bundle" => bundle,
            "etc2" => &group,
            _ if actions.contains("PointerId(21), desc") => &draw,
            _ => continue,
        };
        let message = pictures(&used(&actions, commands)).expect_err(name);
        // The bundle's pipeline is what failed.
        let reason = if name == "bundle" { "mesh pipelines are not supported" } else { reason };
        assert!(message.contains("x/trace.ron:") && message.contains(reason), "{name}: {message}");
        if let Some((_, user)) = message.split_once("; ") {
            assert!(user.contains("(Submit) uses "), "{name}: {message}");
        }
        checked += 1;
    }
    assert!(checked >= 14, "{checked}");
    // The place is that of the creation, which is what has to be mended.
    let text = used(&pipeline(21, (10, "nowhere"), ("", "")), &draw);
    let line = text.lines().position(|line| line.contains("p21")).expect("it is there") + 1;
    let message = pictures(&text).expect_err("refused");
    assert!(
        message.contains(&format!("x/trace.ron:{line}:1: command ")) && message.contains("CreateRenderPipeline"),
        "{message}"
    );
    let inspection = inspect(&opened(&text).expect("it opens")).expect("it is inspected");
    assert_eq!((inspection.refused.len(), inspection.unused.len()), (1, 0));
    assert!(message.ends_with(&inspection.refused[0].reason), "{message}: {:?}", inspection.refused);
    // Set, and not drawn with, it is not used.
    assert!(pictures(&used(&pipeline(21, (10, "nowhere"), ("", "")), &set_pipeline(21))).is_ok());
}

/// Twelve frames, each with a bundle and a buffer of its own; both are dropped behind it.
fn bundles() -> String {
    let mut text = format!("[\n{}", setup());
    for number in 1..=12u32 {
        let draws = format!("{DRAW}, ").repeat((number % 4 + 1) as usize);
        let set = "SetBindGroup(index: 0, num_dynamic_offsets: 0, bind_group: Some(PointerId(31)))";
        text += &format!(
            "CreateRenderBundle(id: PointerId(60), desc: (label: None, color_formats: [Some(\"rgba8unorm\")], depth_stencil: None, \
             sample_count: 1, multiview: None), base: (label: None, commands: [{}, {set}, {draws}], dynamic_offsets: [], string_data: [], \
             immediates_data: [])),\n\
             CreateBuffer(PointerId(41), (label: None, size: 16, usage: \"COPY_DST\", mapped_at_creation: false)),\n",
            set_pipeline(20)
        );
        let executes = format!("{}, ", pass(101, "ExecuteBundle(PointerId(60))"));
        text += &frame(number, &executes);
        text += "DropRenderBundle(PointerId(60)),\nDropBuffer(PointerId(41)),\n";
    }
    text + "]"
}

#[test]
fn bundles_that_are_destroyed_replay_in_every_fidelity() {
    let trace = opened(&bundles()).unwrap_or_else(|error| panic!("{error}"));
    let sampling = Sampling { samples: 4, ..Sampling::default() };
    let fidelities =
        [Fidelity::Functional, Fidelity::Bound, Fidelity::BoundSampled(sampling), Fidelity::Sampled(sampling), Fidelity::Cycle];
    for fidelity in fidelities {
        let options = Options::new(Config::built_in("baseline").expect("it is built in"), fidelity);
        let replayed = replay(&trace, &options, &|_| {}).unwrap_or_else(|error| panic!("{}: {error:#}", fidelity.name()));
        assert!(replayed.frames.len() >= 5, "{}", fidelity.name());
    }
}

/// Every walk over a trace knows the same objects: what is rendered can also be looked through for what depends on what.
#[test]
fn every_trace_is_walked_as_it_is_rendered() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let mut folders = vec![root.join("traces"), root.join("crates/import/tests/import")];
    match std::env::var_os("FILLRATE_PEERS") {
        Some(peers) => folders.push(Path::new(&peers).join("wgpu")),
        None => eprintln!("left out: FILLRATE_PEERS is not set"),
    }
    let mut walked = 0;
    for folder in folders {
        for entry in fs::read_dir(&folder).unwrap_or_else(|error| panic!("{}: {error}", folder.display())) {
            let path = entry.expect("an entry").path();
            // Traces of single actions are no programs.
            let single = path.ends_with("all") || path.ends_with("refused");
            if single || import::detect(&path).is_none() {
                continue;
            }
            let trace = import::open(&path).unwrap_or_else(|error| panic!("{error}"));
            let inspection = inspect(&trace).unwrap_or_else(|error| panic!("{error}"));
            assert!(inspection.refused.is_empty() && inspection.unused.is_empty(), "{}: {inspection:?}", path.display());
            let dependencies = Dependencies::of(&trace, u32::MAX).unwrap_or_else(|error| panic!("{error}"));
            assert_eq!(u64::from(dependencies.frames()), inspection.summary.frames, "{}", path.display());
            walked += 1;
        }
    }
    assert!(walked > 20, "{walked}");
}

fn folder_with(text: &str) -> (tempfile::TempDir, String) {
    let folder = tempfile::tempdir().expect("a folder");
    fs::write(folder.path().join("trace.ron"), text).expect("written");
    let name = folder.path().display().to_string();
    (folder, name)
}

#[test]
fn a_recording_of_a_killed_program_is_replayed_as_far_as_it_is_whole() {
    let whole = format!("[\n{}{}{}{}]", setup(), frame(1, ""), frame(2, ""), frame(3, ""));
    let expected = pictures(&whole).expect("it replays");
    let begin = whole.rfind("Submit(3").expect("it is there");
    let (_folder, name) = folder_with(&whole[..begin + 40]);
    let (code, out, message) = run(&["replay", &name, "--fidelity", "functional"]);
    assert_eq!(code, 0, "{message}");
    assert!(out.contains("2 frames"), "{out}");
    assert!(message.contains("warning: ") && message.contains("inside action 18 (Submit), which is left out"), "{message}");
    let (code, _, message) = run(&["inspect", &name]);
    assert!(code == 0 && message.contains("warning: ") && message.contains("the recording ends after 18 actions"), "{message}");
    // Wherever it is cut: what is drawn of it is what the whole draws, or it is refused by name.
    let mut shown = vec![0; 4];
    for end in (0..whole.len()).step_by(61).chain([whole.len() - 1]) {
        match pictures(&whole[..end]) {
            Ok(drawn) => {
                let presented = whole[..end].matches("Present(PointerId(1))").count();
                shown[presented] += 1;
                // A trace that presents nothing is one frame.
                assert!(presented == 0 && drawn.len() == 1 || drawn == expected[..presented], "cut at {end}");
            }
            Err(message) => assert!(end == 0 && message.contains("trace.ron:1:1: expected `[`"), "cut at {end}: {message}"),
        }
    }
    assert!(shown.iter().all(|&count| count > 0), "{shown:?}");
    // Damage before the end is none of a cut.
    let damaged = whole.replacen("vertex_count: 3", "vertex_count: \"", 1);
    assert!(refused(&["replay", &folder_with(&damaged).1]).contains("trace.ron"));
}

#[test]
fn a_trace_that_draws_nothing_says_so() {
    let (folder, name) = folder_with(&format!("[\n{INIT},\n]"));
    let out = folder.path().join("out").display().to_string();
    for fidelity in ["functional", "bound", "cycle"] {
        let (code, report, message) = run(&["replay", &name, "--fidelity", fidelity, "--out", &out]);
        assert_eq!((code, message.as_str()), (0, ""), "{fidelity}");
        assert!(report.contains("nothing is drawn") && !report.contains("frames per second"), "{fidelity}: {report}");
        let json = fs::read_to_string(folder.path().join("out/stats.json")).expect("statistics");
        let json: serde_json::Value = serde_json::from_str(&json).expect("JSON");
        assert_eq!(json["frames"].as_array().map(Vec::len), Some(1), "a trace without present is a single frame");
        assert!(!folder.path().join("out/frame-0000.png").exists());
    }
    let page = folder.path().join("page.html");
    let message = refused(&["replay", &name, "--report", &page.display().to_string()]);
    assert!(message.contains("draws nothing") && !page.exists(), "{message}");
    assert!(refused(&["why", &name]).contains("draws nothing"));
    let (code, report, _) = run(&["inspect", &name, "--device-limits"]);
    assert_eq!(code, 0);
    for part in ["nothing is drawn", "features asked for: SHADER_INT64 | IMMEDIATES", "maxTextureDimension2D", "8192"] {
        assert!(report.contains(part), "no `{part}` in {report}");
    }
}

#[test]
fn inspect_says_what_frames_are_and_what_will_be_refused() {
    let text = format!("[\n{}{}{}]", setup(), frame(1, ""), frame(2, ""));
    let (code, report, message) = run(&["inspect", &folder_with(&text).1]);
    assert_eq!((code, message.as_str()), (0, ""));
    for part in
        ["shows what is presented", "surface: 8x6, rgba8unorm, 2 presents", "features asked for: SHADER_INT64 | IMMEDIATES"]
    {
        assert!(report.contains(part), "no `{part}` in {report}");
    }
    assert!(!report.contains("refused") && !report.contains("left out"), "{report}");

    let draw = format!("{}, {DRAW}", set_pipeline(21));
    let wide = format!("{},\n{}", module(11, WIDE), pipeline(21, (11, "fs"), ("", "")));
    let refusing = format!("[\n{}{wide},\n{}]", setup(), frame(1, &format!("{}, ", pass(101, &draw))));
    let (_folder, name) = folder_with(&refusing);
    let (code, report, _) = run(&["inspect", &name]);
    assert_eq!(code, 1, "{report}");
    let line = report.lines().find(|line| line.starts_with("will be refused: ")).unwrap_or_else(|| panic!("{report}"));
    assert!(line.ends_with("2:11: 64-bit integers (feature SHADER_INT64) are not supported"), "{line}");
    let message = refused(&["replay", &name, "--fidelity", "functional"]);
    assert!(message.trim_end().ends_with("2:11: 64-bit integers (feature SHADER_INT64) are not supported"), "{message}");

    let target = "CreateTexture(PointerId(80), (label: Some(\"canvas\"), size: (width: 4, height: 5, depthOrArrayLayers: 1), mip_level_count: 1, \
                  sample_count: 1, dimension: r#2d, format: \"rgba8unorm\", usage: \"RENDER_ATTACHMENT\", view_formats: [])),\n\
                  CreateTextureView(id: PointerId(81), parent: PointerId(80), desc: ()),\n";
    let offscreen = format!("[\n{}{target}Submit(1, [{}]),\n]", setup(), pass(81, ""));
    let (code, report, _) = run(&["inspect", &folder_with(&offscreen).1]);
    assert_eq!(code, 0);
    assert!(
        report.contains("one frame, which shows the last colour target, texture 0 \"canvas\": 4x5, rgba8unorm"),
        "{report}"
    );
}
