//! The checker: a trace that keeps the rules passes with its counts, and each broken rule is named with its command.

use std::fs;
use std::path::Path;

use trace::{Summary, Trace, TraceError, check};

/// Objects that the cases use; commands 0 to 24.
const PRELUDE: &str = r#"
    CreateBuffer(id: 0, size: 256),
    CreateBuffer(id: 1, size: 64),
    WriteBuffer(id: 0, data: (blob: "a.bin", size: 256)),
    CreateTexture(id: 0, desc: (size: (64, 32, 1), format: Rgba8Unorm)),
    CreateTexture(id: 1, desc: (size: (64, 32, 1), format: Depth24PlusStencil8)),
    CreateTexture(id: 2, desc: (size: (64, 32, 1), samples: 4, format: Rgba8Unorm)),
    CreateTexture(id: 3, desc: (size: (16, 16, 6), levels: 5, format: Bc1RgbaUnorm)),
    CreateView(id: 0, texture: 0),
    CreateView(id: 1, texture: 1),
    CreateView(id: 2, texture: 2),
    CreateView(id: 3, texture: 3, desc: (dimension: Cube)),
    CreateSampler(id: 0, desc: (mag: Linear, min: Linear, mipmap: Linear, anisotropy: 16)),
    CreateShader(id: 0, source: Wgsl("a.wgsl")),
    CreateBindGroupLayout(id: 0, entries: [(binding: 0, kind: Uniform(dynamic_offset: true)), (binding: 1, kind: Sampler)]),
    CreateBindGroupLayout(id: 1, entries: []),
    CreatePipelineLayout(id: 0, groups: [0, 1, None], immediate_size: 16),
    CreateBindGroup(id: 0, layout: 0, entries: [(binding: 1, resource: Sampler(0)), (binding: 0, resource: Buffer(buffer: 0, offset: 0, size: 64))]),
    CreateRenderPipeline(id: 0, desc: (layout: 0, vertex: (shader: 0), fragment: (shader: 0),
        buffers: [None, (stride: 16, attributes: [(format: Float32x3, offset: 0, location: 0)]),
            (stride: 8, step: Instance, attributes: [(format: Float32x2, offset: 0, location: 1)])],
        depth_stencil: (format: Depth24PlusStencil8, depth_write: true, depth_compare: Less),
        targets: [(format: Rgba8Unorm)])),
    CreateRenderPipeline(id: 1, desc: (vertex: (shader: 0), targets: [(format: Rgba8Unorm)], multisample: (count: 4))),
    CreateComputePipeline(id: 0, stage: (shader: 0)),
    GetBindGroupLayout(id: 2, pipeline: Compute(0), group: 0),
    CreateQuerySet(id: 0, kind: Occlusion, count: 4),
    CreateQuerySet(id: 1, kind: PipelineStatistics(8), count: 1),
    BeginBundle(id: 0), SetRenderPipeline(1), Draw(vertices: 5), EndBundle,
"#;

/// A render pass that is ready to draw.
const READY: &str = "BeginRenderPass(color: [(view: 0)], depth: (view: 1), occlusion: 0), SetRenderPipeline(0),
    SetBindGroup(index: 0, group: 0, offsets: [192]), SetVertexBuffer(slot: 1, buffer: 0), SetVertexBuffer(slot: 2, buffer: 1),
    SetIndexBuffer(buffer: 1, format: Uint16, offset: 4),";

fn open(dir: &Path, commands: &str) -> Trace {
    open_bare(dir, &format!("{PRELUDE}\n{commands}"))
}

/// A trace of these commands alone.
fn open_bare(dir: &Path, commands: &str) -> Trace {
    let files = [("a.bin", [7u8; 256].as_slice()), ("a.wgsl", b"// nothing"), ("b.wgsl", b"\xff"), ("c.spv", b"12345")];
    let mut listing = String::new();
    for (name, bytes) in files {
        fs::write(dir.join(name), bytes).unwrap();
        listing += &format!("{name:?}: (size: {}, hash: \"{}\"),", bytes.len(), blake3::hash(bytes).to_hex());
    }
    fs::write(dir.join("trace.ron"), format!("Trace(version: 1, files: {{{listing}}}, commands: [{commands}\n])")).unwrap();
    Trace::open(dir).unwrap()
}

fn run(commands: &str) -> Result<Summary, TraceError> {
    let dir = tempfile::tempdir().unwrap();
    check(&open(dir.path(), commands))
}

#[test]
fn a_good_trace_passes_with_its_counts() {
    let summary = run(&format!(
        "{READY} Draw(vertices: 16, instances: 8), DrawIndexed(indices: 30, base_vertex: -5), DrawIndirect(buffer: 0, offset: 16, count: 15),
         SetViewport((x: -5.0, y: 0.0, width: 100.0, height: 50.0, min_depth: 1.0, max_depth: 0.0)), SetScissor((x: 64, y: 0, width: 0, height: 32)),
         BeginOcclusionQuery(index: 3), Draw(vertices: 0), EndOcclusionQuery, EndRenderPass,
         BeginRenderPass(color: [(view: 2, clear: (0, 0, 0, 0), resolve: 0, store: false)]), ExecuteBundles([0, 0]), EndRenderPass,
         BeginComputePass(), SetComputePipeline(0), BeginStatisticsQuery(set: 1, index: 0), Dispatch(groups: (65535, 0, 1)), EndStatisticsQuery, EndComputePass,
         CopyTextureToBuffer(from: (texture: 1, aspect: StencilOnly), to: 0, layout: (bytes_per_row: 32), size: (8, 8, 1)),
         CopyBufferToTexture(from: 0, layout: (offset: 8), to: (texture: 3, level: 3), size: (2, 2, 6)),
         ResolveQuerySet(set: 0, first: 1, count: 3, to: 1, to_offset: 40), ClearBuffer(buffer: 1, offset: 8), Present(texture: 0), Present(texture: 0),
         Destroy(Texture(2)), CreateBuffer(id: 2, size: 8192)"
    ))
    .unwrap();
    let count = |name| summary.commands_named(name);
    assert_eq!((summary.frames, summary.presented, count("Present")), (2, Some([64, 32]), 2));
    assert_eq!((summary.render_passes, summary.compute_passes, summary.draws, summary.dispatches), (2, 1, 6, 1));
    assert_eq!(summary.vertices, 16 * 8 + 30 + 5 + 5);
    assert_eq!(summary.buffer_bytes, 256 + 64 + 8192);
    // 64x32 at 4 bytes, twice, then times four samples, and the blocks of a cube's five levels.
    assert_eq!(summary.texture_bytes, 2 * 8192 + 32_768 + 6 * 8 * (16 + 4 + 1 + 1 + 1));
    assert_eq!(summary.peak_bytes, summary.texture_bytes + 320);
    assert_eq!((summary.blobs, summary.blob_bytes, summary.written_bytes), (2, 256 + 10, 256));
    assert_eq!(summary.by_name.values().sum::<u64>(), summary.commands);
    assert_eq!(run("").unwrap().frames, 1);
}

#[test]
fn every_broken_rule_is_named_with_its_command() {
    // Commands after the prelude, the number of the bad one among them, and what is said of it.
    let cases: &[(&str, u64, &str)] = &[
        // Identity.
        ("CreateBuffer(id: 0, size: 1)", 0, "buffer 0 is created a second time"),
        ("WriteBuffer(id: 9, data: (blob: \"a.bin\", size: 1))", 0, "buffer 9 is used before it is created"),
        (
            "Destroy(Buffer(0)), WriteBuffer(id: 0, data: (blob: \"a.bin\", size: 1))",
            1,
            "buffer 0 is used after it was destroyed",
        ),
        ("Destroy(Buffer(0)), CreateBuffer(id: 0, size: 1)", 1, "buffer 0 is created a second time"),
        ("CreateBuffer(id: 4000000000, size: 1)", 0, "buffer 4000000000 is out of line"),
        // Data.
        ("WriteBuffer(id: 0, data: (blob: \"none\", size: 1))", 0, "there is no blob \"none\""),
        (
            "WriteBuffer(id: 0, data: (blob: \"a.bin\", offset: 250, size: 7))",
            0,
            "bytes 250 + 7 of blob \"a.bin\" reach past its 256",
        ),
        (
            "WriteBuffer(id: 0, offset: 1, data: (blob: \"a.bin\", size: 256))",
            0,
            "bytes 1 + 256 reach past the 256 of BufferId(0)",
        ),
        ("WriteBuffer(id: 0, offset: 18446744073709551615, data: (blob: \"a.bin\", size: 256))", 0, "reach past the 256"),
        ("CreateShader(id: 1, source: Wgsl(\"b.wgsl\"))", 0, "blob \"b.wgsl\" is not UTF-8 text: byte 0 is invalid"),
        ("CreateShader(id: 1, source: SpirV(\"c.spv\"))", 0, "of 5 bytes is not made of whole words"),
        // Sizes.
        ("CreateBuffer(id: 2, size: 4294967297)", 0, "a buffer of 4294967297 bytes, it must be 4294967296 at most"),
        ("CreateBuffer(id: 2, size: 18446744073709551615)", 0, "bytes, it must be 4294967296 at most"),
        ("CreateTexture(id: 9, desc: (size: (16385, 1, 1), format: R8Unorm))", 0, "width is 16385, it must be 1 to 16384"),
        ("CreateTexture(id: 9, desc: (size: (1, 0, 1), format: R8Unorm))", 0, "height is 0"),
        (
            "CreateTexture(id: 9, desc: (size: (1, 1, 2049), format: R8Unorm))",
            0,
            "depth or layers is 2049, it must be 1 to 2048",
        ),
        (
            "CreateTexture(id: 9, desc: (dimension: D3, size: (2049, 1, 1), format: R8Unorm))",
            0,
            "width is 2049, it must be 1 to 2048",
        ),
        (
            "CreateTexture(id: 9, desc: (dimension: D3, size: (2048, 2048, 2048), format: Rgba32Float))",
            0,
            "a texture of 137438953472 bytes, it must be 4294967296 at most",
        ),
        (
            "CreateTexture(id: 9, desc: (size: (8, 4, 1), levels: 5, format: R8Unorm))",
            0,
            "5 levels, a 8x4x1 texture has 1 to 4",
        ),
        ("CreateTexture(id: 9, desc: (size: (8, 4, 1), samples: 2, format: R8Unorm))", 0, "2 samples"),
        ("CreateTexture(id: 9, desc: (size: (8, 4, 2), samples: 4, format: R8Unorm))", 0, "one level and one layer"),
        ("CreateTexture(id: 9, desc: (size: (8, 6, 1), format: Bc7RgbaUnorm))", 0, "whole 4x4 blocks"),
        ("CreateTexture(id: 9, desc: (dimension: D3, size: (8, 6, 1), format: Depth32Float))", 0, "only 2D textures"),
        // Views and samplers.
        ("CreateView(id: 9, texture: 3, desc: (base_level: 5))", 0, "levels 5 + 0 are not in the texture's 5"),
        ("CreateView(id: 9, texture: 3, desc: (base_layer: 1, dimension: Cube))", 0, "layers 1 + 6 are not in the texture's 6"),
        ("CreateView(id: 9, texture: 3, desc: (dimension: D2, layers: 2))", 0, "a D2 view of 2 layers"),
        ("CreateView(id: 9, texture: 3, desc: (dimension: D3))", 0, "a D3 view of a D2 texture"),
        ("CreateView(id: 9, texture: 0, desc: (format: Bgra8Unorm))", 0, "a bgra8unorm view of a rgba8unorm texture"),
        ("CreateView(id: 9, texture: 0, desc: (aspect: DepthOnly))", 0, "rgba8unorm has no aspect DepthOnly"),
        ("CreateSampler(id: 9, desc: (anisotropy: 2))", 0, "anisotropy asks for linear filters"),
        ("CreateSampler(id: 9, desc: (lod_min: 2.0, lod_max: 1.0))", 0, "levels of detail from 2 to 1 are no range"),
        ("CreateSampler(id: 9, desc: (lod_max: NaN))", 0, "are no range"),
        // Binding.
        (
            "CreateBindGroupLayout(id: 9, entries: [(binding: 1, kind: Sampler), (binding: 1, kind: Texture)])",
            0,
            "binding 1 is given twice",
        ),
        ("CreateBindGroupLayout(id: 9, entries: [(binding: 1, kind: Sampler, count: 0)])", 0, "an array of 0"),
        ("CreatePipelineLayout(id: 9, groups: [7])", 0, "bind group layout 7 is used before"),
        ("CreatePipelineLayout(id: 9, groups: [], immediate_size: 3)", 0, "3 bytes of immediates"),
        (
            "CreateBindGroup(id: 9, layout: 0, entries: [(binding: 1, resource: Sampler(0))])",
            0,
            "binding 0 of the layout is missing",
        ),
        (
            "CreateBindGroup(id: 9, layout: 0, entries: [(binding: 1, resource: Sampler(0)), (binding: 0, resource: View(0))])",
            0,
            "binding 0 is a view, the layout says Uniform",
        ),
        (
            "CreateBindGroup(id: 9, layout: 1, entries: [(binding: 4, resource: Sampler(0))])",
            0,
            "binding 4 is not in the layout",
        ),
        (
            "CreateBindGroup(id: 9, layout: 2, entries: [(binding: 4, resource: Buffer(buffer: 1, offset: 60, size: 8))])",
            0,
            "binding 4: bytes 60 + 8 reach past the 64",
        ),
        // Pipelines.
        (
            "CreateRenderPipeline(id: 9, desc: (vertex: (shader: 3), targets: [(format: R8Unorm)]))",
            0,
            "shader 3 is used before",
        ),
        ("CreateRenderPipeline(id: 9, desc: (vertex: (shader: 0)))", 0, "neither a colour target nor depth"),
        (
            "CreateRenderPipeline(id: 9, desc: (vertex: (shader: 0), targets: [(format: Depth16Unorm)]))",
            0,
            "depth16unorm cannot be rendered to",
        ),
        (
            "CreateRenderPipeline(id: 9, desc: (vertex: (shader: 0), targets: [(format: R8Uint, blend: (color: (src: One, dst: One, op: Add), alpha: (src: One, dst: One, op: Add)))]))",
            0,
            "r8uint cannot be blended",
        ),
        (
            "CreateRenderPipeline(id: 9, desc: (vertex: (shader: 0), targets: [(format: R8Unorm)], primitive: (line_width: 0)))",
            0,
            "lines of a width of 0, it must be above 0 and 255 at most",
        ),
        (
            "CreateRenderPipeline(id: 9, desc: (vertex: (shader: 0), targets: [(format: R8Unorm)], primitive: (line_width: NaN)))",
            0,
            "lines of a width of NaN",
        ),
        (
            "CreateRenderPipeline(id: 9, desc: (vertex: (shader: 0), targets: [(format: R8Unorm, logic: Xor), (format: Rgba8UnormSrgb, logic: Xor)]))",
            0,
            "colour target 1: rgba8unorm-srgb has no logic operations",
        ),
        (
            "CreateRenderPipeline(id: 9, desc: (vertex: (shader: 0), targets: [(format: R8Unorm, logic: Nand), (format: R8Unorm, blend: (color: (src: One, dst: One, op: Add), alpha: (src: One, dst: One, op: Add)))]))",
            0,
            "colour target 0: the logic operation Nand in a pipeline that blends",
        ),
        (
            "CreateRenderPipeline(id: 9, desc: (vertex: (shader: 0), targets: [(format: R8Unorm)], multisample: (alpha_to_coverage: true)))",
            0,
            "alpha to coverage without",
        ),
        (
            "CreateRenderPipeline(id: 9, desc: (vertex: (shader: 0), targets: [(format: R8Unorm)], buffers: [(stride: 4, attributes: [(format: Float32x2, offset: 0, location: 0)])]))",
            0,
            "attribute 0: bytes 0 + 8 reach past the stride 4",
        ),
        (
            "CreateRenderPipeline(id: 9, desc: (vertex: (shader: 0), depth_stencil: (format: Stencil8, depth_write: true)))",
            0,
            "a depth test with stencil8",
        ),
        (
            "CreateRenderPipeline(id: 9, desc: (vertex: (shader: 0), depth_stencil: (format: Depth32Float, bias: -inf)))",
            0,
            "a depth bias of constant -inf, slope 0 and clamp 0",
        ),
        ("GetBindGroupLayout(id: 9, pipeline: Render(0), group: 5)", 0, "the pipeline's layout has no group 5"),
        // Copies.
        ("CopyBufferToBuffer(from: 0, from_offset: 0, to: 0, to_offset: 8, size: 9)", 0, "source and destination overlap"),
        (
            "CopyBufferToBuffer(from: 0, from_offset: 0, to: 1, to_offset: 8, size: 64)",
            0,
            "bytes 8 + 64 reach past the 64 of BufferId(1)",
        ),
        (
            "CopyBufferToTexture(from: 0, layout: (), to: (texture: 0), size: (64, 2, 1))",
            0,
            "bytes 0 + 512 reach past the 256 of BufferId(0)",
        ),
        (
            "CopyBufferToTexture(from: 0, layout: (bytes_per_row: 12), to: (texture: 0), size: (4, 2, 1))",
            0,
            "bytes_per_row is 12, a row has 16",
        ),
        (
            "CopyBufferToTexture(from: 0, layout: (), to: (texture: 0, origin: (60, 0, 0)), size: (5, 1, 1))",
            0,
            "x 60 + 5 reaches past the 64 texels of level 0",
        ),
        ("CopyBufferToTexture(from: 0, layout: (), to: (texture: 0, level: 1), size: (5, 1, 1))", 0, "level 1 is not in the 1"),
        (
            "CopyBufferToTexture(from: 0, layout: (), to: (texture: 3, origin: (2, 0, 0)), size: (4, 4, 1))",
            0,
            "x 2 + 4 cuts blocks",
        ),
        ("CopyBufferToTexture(from: 0, layout: (), to: (texture: 1), size: (4, 4, 1))", 0, "is not one plane of texels"),
        ("CopyBufferToTexture(from: 0, layout: (), to: (texture: 2), size: (4, 4, 1))", 0, "is multisampled"),
        (
            "WriteTexture(to: (texture: 0), data: (blob: \"a.bin\", size: 256), layout: (offset: 4), size: (64, 1, 1))",
            0,
            "bytes 4 + 256 reach past the 256 of the data",
        ),
        (
            "WriteTexture(to: (texture: 0), data: (blob: \"a.bin\", size: 256), layout: (bytes_per_row: 4294967295, rows_per_image: 4294967295), size: (1, 2, 1))",
            0,
            "reach past the 256 of the data",
        ),
        ("CopyTextureToTexture(from: (texture: 0), to: (texture: 3), size: (4, 4, 1))", 0, "from rgba8unorm to bc1-rgba-unorm"),
        ("CopyTextureToTexture(from: (texture: 0), to: (texture: 2), size: (4, 4, 1))", 0, "from 1 samples to 4"),
        (
            "CopyTextureToTexture(from: (texture: 0), to: (texture: 0, origin: (3, 3, 0)), size: (4, 4, 1))",
            0,
            "overlap in TextureId(0)",
        ),
        (
            "ClearTexture(texture: 3, aspect: All, base_level: 4, levels: 2, base_layer: 0, layers: None)",
            0,
            "levels 4 + 2 are not in the texture's 5",
        ),
        ("ResolveQuerySet(set: 0, first: 2, count: 3, to: 1, to_offset: 0)", 0, "queries 2 + 3 are not in the set's 4"),
        ("ResolveQuerySet(set: 0, first: 0, count: 4, to: 1, to_offset: 40)", 0, "bytes 40 + 32 reach past the 64"),
        ("WriteTimestamp(set: 0, index: 0)", 0, "counts Occlusion"),
        ("Present(texture: 1)", 0, "no single-sampled 2D colour texture"),
        ("SetSprite(index: 8, view: 0, x: 0, y: 0)", 0, "sprite 8: a display has 8, from 0 to 7"),
        ("SetSprite(index: 0, view: 9, x: 0, y: 0)", 0, "SetSprite: "),
        ("SetSprite(index: 0, view: 1, x: 0, y: 0)", 0, "is depth24plus-stencil8: a sprite is rgba8unorm or bgra8unorm"),
        ("SetSprite(index: 0, view: 2, x: 0, y: 0)", 0, "is multisampled: a sprite has one sample a texel"),
        (
            "CreateTexture(id: 4, desc: (size: (65, 2, 1), format: Bgra8Unorm)), CreateView(id: 4, texture: 4), SetSprite(index: 7, view: 4, x: 0, y: 0)",
            2,
            "has 65 x 2 texels: a sprite has at most 64 x 64; cut it into several",
        ),
        (
            "CreateTexture(id: 4, desc: (size: (4, 4, 2), format: Rgba8Unorm)), CreateView(id: 4, texture: 4), SetSprite(index: 7, view: 4, x: 0, y: 0)",
            2,
            "is more than one level and layer of a 2D texture",
        ),
        (
            "CreateTexture(id: 4, desc: (size: (4, 4, 1), format: Rgba16Float)), SetSprite(index: 1, view: 0, x: -3, y: 4), Present(texture: 4)",
            2,
            "sprites lie over pictures of rgba8unorm or bgra8unorm",
        ),
        ("SetSprite(index: 1, view: 0, x: 0, y: 0), Destroy(View(0)), Present(texture: 0)", 2, "sprite 1: "),
        ("BeginComputePass(), SetSprite(index: 0, x: 0, y: 0)", 1, "not allowed inside a compute pass"),
        // Setups.
        ("BeginSetup", 0, "a setup begins a trace"),
        ("EndSetup(moments: 3)", 0, "only allowed inside a setup"),
        ("SkipAddresses(to: 4096)", 0, "only allowed inside a setup"),
        // Passes.
        ("EndRenderPass", 0, "no render pass is open"),
        ("BeginComputePass(), EndRenderPass", 1, "no render pass is open"),
        ("BeginComputePass(), BeginComputePass()", 1, "not allowed inside a compute pass"),
        ("BeginComputePass(), Present(texture: 0)", 1, "not allowed inside a compute pass"),
        ("BeginComputePass()", 0, "the trace ends inside a compute pass"),
        ("Draw(vertices: 3)", 0, "only allowed inside a pass"),
        ("PopDebugGroup", 0, "no debug group is open"),
        ("BeginRenderPass(color: [])", 0, "the pass has no attachment"),
        ("BeginRenderPass(color: [(view: 3)])", 0, "bc1-rgba-unorm cannot be rendered to"),
        ("BeginRenderPass(color: [(view: 0), (view: 0)])", 0, "colour attachment 1 is an attachment already"),
        ("BeginRenderPass(color: [(view: 2)], depth: (view: 1))", 0, "the depth attachment has 1 samples, other attachments 4"),
        ("BeginRenderPass(color: [(view: 0, resolve: 0)])", 0, "is resolved, but has one sample"),
        ("BeginRenderPass(color: [(view: 0)], depth: (view: 1, depth_clear: 1.5))", 0, "depth is cleared to 1.5"),
        (
            "BeginRenderPass(color: [(view: 0)], depth: (view: 1, depth_clear: 1.0, depth_read_only: true))",
            0,
            "read-only depth is cleared",
        ),
        ("BeginRenderPass(color: [(view: 0)], occlusion: 1)", 0, "counts PipelineStatistics"),
        ("BeginRenderPass(color: [(view: 0)]), SetRenderPipeline(0)", 1, "format is depth24plus-stencil8, the pass has none"),
        ("BeginRenderPass(color: [(view: 0)]), SetRenderPipeline(1)", 1, "the pipeline has 4 samples, the pass 1"),
        ("BeginRenderPass(color: [(view: 0)]), ExecuteBundles([0])", 1, "the pipeline has 4 samples, the pass 1"),
        (
            "BeginRenderPass(color: [None], depth: (view: 1)), SetRenderPipeline(0)",
            1,
            "colour targets are [rgba8unorm], the pass has []",
        ),
        (
            "BeginRenderPass(color: [(view: 0)], depth: (view: 1, depth_read_only: true)), SetRenderPipeline(0)",
            1,
            "writes depth, which is read-only",
        ),
        // Draws.
        (
            "READY SetRenderPipeline(0), SetBindGroup(index: 0, group: 0, offsets: [193])",
            7,
            "bytes 193 + 64 reach past the 256",
        ),
        ("READY SetBindGroup(index: 0, group: 0, offsets: [])", 6, "0 dynamic offsets, BindGroupId(0) has 1"),
        ("READY SetBindGroup(index: 8, group: 0)", 6, "group 8, there are 8"),
        ("READY SetBindGroup(index: 0), Draw(vertices: 3)", 7, "bind group 0 is not set"),
        ("READY Draw(vertices: 17)", 6, "vertices 0 + 17 need 268 bytes, vertex buffer 1 has 256"),
        ("READY Draw(vertices: 2, first_vertex: 15)", 6, "vertices 15 + 2 need 268 bytes"),
        ("READY Draw(vertices: 4294967295, first_vertex: 4294967295)", 6, "vertex buffer 1 has 256"),
        ("READY Draw(vertices: 3, instances: 9)", 6, "instances 0 + 9 need 72 bytes, vertex buffer 2 has 64"),
        ("READY DrawIndexed(indices: 31)", 6, "indices 0 + 31 reach past the 30 of the index buffer"),
        ("READY DrawIndirect(buffer: 0, offset: 0, count: 17)", 6, "bytes 0 + 272 reach past the 256"),
        ("READY DrawIndirect(buffer: 0, offset: 0, count_buffer: (1, 61))", 6, "bytes 61 + 4 reach past the 64"),
        ("READY SetVertexBuffer(slot: 1), Draw(vertices: 3)", 7, "vertex buffer 1 is not set"),
        ("READY SetVertexBuffer(slot: 16, buffer: 0)", 6, "slot 16, there are 16"),
        ("READY SetIndexBuffer(buffer: 1, format: Uint32, offset: 2)", 6, "offset 2 is no multiple of the 4"),
        ("READY ExecuteBundles([]), Draw(vertices: 3)", 7, "no render pipeline is set"),
        ("READY SetScissor((x: 0, y: 1, width: 64, height: 32))", 6, "reaches out of the 64x32 target"),
        (
            "READY SetViewport((x: 0.0, y: NaN, width: 1.0, height: 1.0, min_depth: 0.0, max_depth: 1.0))",
            6,
            "a viewport at 0, NaN",
        ),
        (
            "READY SetViewport((x: 0.0, y: 0.0, width: 1.0, height: 1.0, min_depth: 0.0, max_depth: 1.1))",
            6,
            "a depth range of 0 to 1.1",
        ),
        ("READY SetImmediates(offset: 4092, words: [1, 2])", 6, "bytes 4092 + 8 are no words"),
        ("READY BeginOcclusionQuery(index: 4)", 6, "query 4 is not in the 4"),
        ("READY BeginOcclusionQuery(index: 0), EndRenderPass", 7, "a query is still open"),
        ("READY EndStatisticsQuery", 6, "no statistics query is open"),
        ("READY SetComputePipeline(0)", 6, "not allowed here"),
        ("BeginBundle(id: 1), Draw(vertices: 3)", 1, "no render pipeline is set"),
        (
            "BeginBundle(id: 1), SetViewport((x: 0.0, y: 0.0, width: 1.0, height: 1.0, min_depth: 0.0, max_depth: 1.0))",
            1,
            "not allowed here",
        ),
        ("BeginComputePass(), Dispatch(groups: (1, 1, 1))", 1, "no compute pipeline is set"),
        ("BeginComputePass(), SetComputePipeline(0), Dispatch(groups: (1, 65536, 1))", 2, "at most 65535"),
        (
            "BeginComputePass(), SetComputePipeline(0), DispatchIndirect(buffer: 1, offset: 56)",
            2,
            "bytes 56 + 12 reach past the 64",
        ),
        ("BeginComputePass(), Draw(vertices: 3)", 1, "not allowed inside a compute pass"),
    ];
    let prelude = run("").unwrap().commands;
    for (commands, number, reason) in cases {
        let commands = commands.replace("READY", READY);
        let message = match run(&commands) {
            Ok(_) => panic!("{commands}: accepted"),
            Err(error) => error.to_string(),
        };
        let number = format!("command {}: ", prelude + number);
        assert!(message.contains(&number) && message.contains(reason), "{commands}:\n{message}\nwanted: {number}… {reason}");
    }
}

#[test]
fn a_setup_restores_what_frames_begin_with_and_draws_nothing() {
    let objects = "BeginSetup, SkipAddresses(to: 12288), CreateBuffer(id: 0, size: 256), WriteBuffer(id: 0, data: (blob: \"a.bin\", size: 256)),
        CreateTexture(id: 0, desc: (size: (4, 4, 1), samples: 4, format: Rgba8Unorm)),
        CreateTexture(id: 1, desc: (size: (8, 8, 2), levels: 2, format: Bc1RgbaUnorm)),
        CreateQuerySet(id: 0, kind: PipelineStatistics(3), count: 2), PushDebugGroup(\"scene\"),
        RestoreTexture(texture: 0, data: (blob: \"a.bin\", size: 256)),
        RestoreTexture(texture: 1, level: 1, layer: 1, data: (blob: \"a.bin\", offset: 8, size: 8)),
        RestoreQueries(set: 0, data: (blob: \"a.bin\", size: 32)),";
    let run = |more: &str| {
        let dir = tempfile::tempdir().unwrap();
        check(&open_bare(dir.path(), &format!("{objects} {more}")))
    };
    let summary = run("EndSetup(moments: 17), PopDebugGroup").unwrap();
    assert_eq!((summary.commands_named("RestoreTexture"), summary.written_bytes), (2, 256 + 256 + 8));
    let data = "data: (blob: \"a.bin\", size: 8)";
    for (more, reason) in [
        ("".to_owned(), "the trace ends inside a setup"),
        ("ClearBuffer(buffer: 0, offset: 0)".to_owned(), "ClearBuffer: not allowed inside a setup"),
        ("BeginComputePass()".to_owned(), "BeginComputePass: not allowed inside a setup"),
        ("BeginSetup".to_owned(), "BeginSetup: not allowed inside a setup"),
        ("BeginBundle(id: 0), SkipAddresses(to: 0)".to_owned(), "SkipAddresses: not allowed inside a bundle"),
        (format!("RestoreTexture(texture: 0, {data})"), "8 bytes for an image of 256"),
        (format!("RestoreTexture(texture: 1, level: 2, {data})"), "level 2 is not in the 2 of TextureId(1)"),
        (format!("RestoreTexture(texture: 1, layer: 2, {data})"), "layer 2 is not in the 2 of level 0 of TextureId(1)"),
        (format!("RestoreQueries(set: 0, {data})"), "8 bytes for 32 of results"),
        ("EndSetup(moments: 0), SkipAddresses(to: 0)".to_owned(), "SkipAddresses: only allowed inside a setup"),
    ] {
        let error = run(&more).unwrap_err().to_string();
        assert!(error.contains(reason), "{more}: {error}");
    }
}
