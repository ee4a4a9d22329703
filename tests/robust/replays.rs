//! What must hold of any text as a trace that is replayed, for the property tests and the fuzz target: it is refused with a message
//! that names the place, or it runs to its end. What would only take long (large images, many vertices or invocations) is left out.

use std::path::Path;

use fillrate::gfx::format::Format;
use fillrate::gfx::state::*;
use fillrate::render::{self, Dependencies, Options};
use fillrate::trace::command::*;
use fillrate::trace::record::{self, Recorder};
use fillrate::trace::{Bytes, Trace, TraceError};
use fillrate::work::{Event, Funnel};

const LARGEST_BUFFER: u64 = 1 << 24;
const LARGEST_IMAGE: u64 = 1 << 20;
const MOST_VERTICES: u64 = 1 << 14;
const MOST_GROUPS: u64 = 1 << 8;
const MOST_COMMANDS: u64 = 1 << 12;

fn texels(desc: &TextureDesc) -> u64 {
    desc.size.iter().fold(u64::from(desc.samples), |n, &side| n.saturating_mul(u64::from(side)))
}

/// Whether running it could take long.
fn is_long(trace: &Trace) -> bool {
    let (mut long, mut vertices, mut commands) = (false, 0u64, 0);
    let outcome = trace.for_each_command::<TraceError>(|_, command| {
        commands += 1;
        match command {
            Command::CreateBuffer { size, .. } => long |= *size > LARGEST_BUFFER,
            Command::CreateTexture { desc, .. } => long |= texels(desc) > LARGEST_IMAGE,
            Command::Draw { vertices: n, instances, .. } | Command::DrawIndexed { indices: n, instances, .. } => {
                vertices = vertices.saturating_add(u64::from(*n).saturating_mul(u64::from(*instances)));
            }
            Command::Dispatch { groups } => {
                long |= groups.iter().fold(1u64, |n, &g| n.saturating_mul(u64::from(g))) > MOST_GROUPS
            }
            // The contents of buffers are known only when they are read.
            Command::DispatchIndirect { .. } | Command::DrawIndirect { .. } => long = true,
            _ => {}
        }
        Ok(())
    });
    long || outcome.is_err() || vertices > MOST_VERTICES || commands > MOST_COMMANDS
}

/// A small trace of many commands: its text, and its other files.
pub struct Small {
    pub text: Vec<u8>,
    files: Vec<(String, Vec<u8>)>,
}

impl Small {
    /// Records it, writes it and reads the files.
    pub fn new() -> Small {
        let folder = std::env::temp_dir().join(format!("fillrate-small-{}", std::process::id()));
        record().save(&folder).unwrap_or_else(|error| panic!("{error}"));
        let mut small = Small { text: Vec::new(), files: Vec::new() };
        for entry in std::fs::read_dir(&folder).expect("the folder just written") {
            let entry = entry.expect("an entry");
            let bytes = std::fs::read(entry.path()).expect("a file just written");
            match entry.file_name().to_string_lossy().into_owned() {
                name if name == "trace.ron" => small.text = bytes,
                name => small.files.push((name, bytes)),
            }
        }
        std::fs::remove_dir_all(&folder).expect("the folder just written");
        small
    }

    /// Replays a text whose files are this trace's; whether it ran to its end. Recording changes neither pictures nor counters.
    pub fn replay(&self, text: &[u8]) -> bool {
        let files = self.files.iter().map(|(name, bytes)| (name.as_str(), Bytes::from(bytes.clone())));
        let trace = match Trace::open_files(Path::new("fuzzed.ron"), text.to_vec(), files) {
            Ok(trace) => trace,
            Err(error) => {
                assert!(!error.reason.is_empty());
                return false;
            }
        };
        if is_long(&trace) {
            return false;
        }
        let [plain, recorded] = [false, true].map(|record| {
            let options = Options { record, ..Options::default() };
            let (mut frames, mut funnel) = (Vec::new(), Funnel::default());
            let rendered = render::render(&trace, &options, &mut |event| {
                match event {
                    Event::Segment(segment) => funnel += segment.funnel,
                    Event::EndFrame(end) => frames.push((end.number, end.reference.to_vec())),
                    _ => {}
                }
                Ok(())
            });
            match rendered {
                Ok(_) => Some((frames, funnel)),
                Err(error) => {
                    assert!(!error.reason.is_empty() && (error.place.is_some() || error.command.is_some()), "{error}");
                    None
                }
            }
        });
        assert!(plain == recorded, "recording changes what is drawn or counted");
        // Every walk over a trace knows the same objects.
        if let Some((frames, _)) = &plain {
            let dependencies = Dependencies::of(&trace, u32::MAX).unwrap_or_else(|error| panic!("{error}"));
            assert_eq!(dependencies.frames() as usize, frames.len());
            let inspection = render::inspect(&trace).unwrap_or_else(|error| panic!("{error}"));
            assert!(inspection.refused.is_empty(), "{:?}", inspection.refused);
        }
        plain.is_some()
    }
}

const DRAWN: &str = "
    struct Uniforms { shift: vec4f, tint: vec4f }
    @group(0) @binding(0) var<uniform> u: Uniforms;
    @group(0) @binding(1) var t: texture_2d<f32>;
    @group(0) @binding(2) var s: sampler;
    struct V { @builtin(position) p: vec4f, @location(0) uv: vec2f, @location(1) @interpolate(flat) i: u32 }
    @vertex fn vs(@location(0) p: vec2f, @location(1) uv: vec2f, @builtin(instance_index) i: u32) -> V {
        return V(vec4f(p * (1.0 - 0.3 * f32(i)), 0.2 * f32(i), 1.0) + u.shift, uv, i);
    }
    @fragment fn fs(v: V) -> @location(0) vec4f {
        if v.i == 2u && v.uv.x < 0.25 { discard; }
        return textureSample(t, s, v.uv * 3.0) * u.tint;
    }";

const COMPUTED: &str = "
    @group(0) @binding(0) var<storage, read_write> sums: array<atomic<u32>, 16>;
    @group(0) @binding(1) var from_: texture_2d<f32>;
    @group(0) @binding(2) var to_: texture_storage_2d<rgba8unorm, write>;
    override gain: f32 = 2.0;
    var<workgroup> part: atomic<u32>;
    @compute @workgroup_size(8, 8) fn main(@builtin(global_invocation_id) id: vec3u, @builtin(local_invocation_index) i: u32) {
        let texel = textureLoad(from_, id.xy, 0);
        atomicAdd(&part, u32(texel.x * 255.0));
        workgroupBarrier();
        if i == 0u { atomicAdd(&sums[id.x & 15u], atomicLoad(&part)); }
        textureStore(to_, id.xy, texel * gain);
    }";

fn record() -> Recorder {
    let mut card = Recorder::new("small");
    let bytes = |words: &[u32]| -> Vec<u8> { words.iter().flat_map(|w| w.to_le_bytes()).collect() };
    let floats = |numbers: &[f32]| bytes(&numbers.iter().map(|x| x.to_bits()).collect::<Vec<_>>());
    let corners = [-0.9f32, -0.8, 0.0, 0.0, 0.9, -0.9, 1.0, 0.0, -0.8, 0.9, 0.0, 1.0, 0.9, 0.9, 1.0, 1.0];
    let vertices = card.create_buffer_init("vertices", floats(&corners));
    let indices = card.create_buffer_init("indices", bytes(&[0x0001_0000, 0x0002_0002, 0x0003_0001]));
    let uniforms: Vec<f32> = (0..128).map(|k| if k % 64 < 4 { 0.01 * k as f32 } else { 0.8 }).collect();
    let uniforms = card.create_buffer_init("uniforms", floats(&uniforms));
    let texture = card.create_texture("texels", record::texture_mipped(8, 8, 4, Format::Rgba8Unorm));
    for level in 0..4u32 {
        let texels: Vec<u32> = (0..(64 >> (2 * level))).map(|k: u32| k.wrapping_mul(0x9e37_79b9) | 0xff00_0000).collect();
        card.write_level(texture, level, "texels", &bytes(&texels));
    }
    let view = card.create_view(texture);
    let sampler = card.create_sampler(record::trilinear_repeat());
    let [many, color, other] = [(4, "many"), (1, "color"), (1, "other")]
        .map(|(samples, name)| card.create_texture(name, record::texture_multisampled(32, 32, samples, Format::Rgba8Unorm)));
    let depth = card.create_texture("depth", record::texture_multisampled(32, 32, 4, Format::Depth24PlusStencil8));
    let [many, color_view, other_view, depth] = [many, color, other, depth].map(|t| card.create_view(t));
    let shader = card.create_shader("drawn", DRAWN);
    let layout = card.create_bind_group_layout([
        (0, BindingKind::Uniform { dynamic_offset: true }),
        (1, record::TEXTURE),
        (2, record::SAMPLER),
    ]);
    let pipeline_layout = card.create_pipeline_layout([layout], 0);
    let mut desc = record::render_pipeline(shader, Format::Rgba8Unorm);
    desc.layout = Some(pipeline_layout);
    desc.buffers = vec![record::vertex_buffer(&[(0, VertexFormat::Float32x2), (1, VertexFormat::Float32x2)])];
    desc.multisample.count = 4;
    desc.depth_stencil = Some(record::depth_less(Format::Depth24PlusStencil8));
    desc.targets[0].as_mut().expect("a target").blend = Some(Blend {
        color: BlendComponent { src: BlendFactor::SrcAlpha, dst: BlendFactor::OneMinusSrcAlpha, op: BlendOp::Add },
        alpha: BlendComponent { src: BlendFactor::One, dst: BlendFactor::Zero, op: BlendOp::Max },
    });
    let pipeline = card.create_render_pipeline("drawn", desc);
    let window = BoundResource::Buffer { buffer: uniforms, offset: 0, size: Some(32) };
    let group =
        card.create_bind_group(layout, [(0, window), (1, BoundResource::View(view)), (2, BoundResource::Sampler(sampler))]);
    let queries = card.create_query_set(QueryKind::Occlusion, 2);
    let bundle = {
        let mut bundle = card.begin_bundle();
        bundle.set_pipeline(pipeline);
        bundle.set_bind_group_at(0, group, &[256]);
        bundle.set_vertex_buffer(0, vertices);
        bundle.draw(3, 1);
        bundle.id()
    };
    {
        let clear = record::clear_and_resolve(many, [0.1, 0.2, 0.3, 1.0], color_view);
        let depth = record::clear_depth(depth, true).map(|d| DepthAttachment { stencil_clear: Some(3), ..d });
        let mut pass = card.begin_render_pass_with([clear], depth, Some(queries));
        pass.set_pipeline(pipeline);
        pass.set_bind_group_at(0, group, &[0]);
        pass.set_vertex_buffer(0, vertices);
        pass.set_index_buffer(indices, IndexFormat::Uint16);
        pass.set_viewport(Viewport { x: 1.0, y: 2.5, width: 30.0, height: 28.0, min_depth: 0.1, max_depth: 0.9 });
        pass.set_scissor(Rect { x: 2, y: 0, width: 28, height: 31 });
        pass.occlusion_query(1, |pass| pass.draw_indexed(6, 3));
        pass.execute_bundles(&[bundle]);
    }
    let sums = card.create_buffer("sums", 64);
    let results = card.create_buffer("results", 64 + 256 * 32);
    let shader = card.create_shader("computed", COMPUTED);
    let stage = StageDesc { constants: vec![("gain".into(), 1.5)], ..record::stage(shader) };
    let compute = card.create_compute_pipeline("computed", None, stage);
    let layout = card.get_bind_group_layout(AnyPipeline::Compute(compute), 0);
    let resources = [record::whole(sums), BoundResource::View(color_view), BoundResource::View(other_view)];
    let group = card.create_bind_group(layout, (0..).zip(resources));
    {
        let mut pass = card.begin_compute_pass();
        pass.set_pipeline(compute);
        pass.set_bind_group(0, group);
        pass.dispatch(4, 4, 1);
    }
    let end = |texture| TextureEnd { texture, level: 0, origin: [0; 3], aspect: Aspect::All };
    card.resolve_queries(queries, 0, 2, results, 0);
    card.copy_buffer_to_buffer((sums, 0), (results, 16), 48);
    let rows = LinearLayout { offset: 64, bytes_per_row: Some(256), rows_per_image: Some(32) };
    card.copy_texture_to_buffer(end(other), results, rows, [32, 32, 1]);
    card.copy_buffer_to_texture(results, rows, end(color), [16, 16, 1]);
    card.copy_texture_to_texture(end(texture), TextureEnd { origin: [4, 4, 0], ..end(color) }, [8, 8, 1]);
    card.push(Command::ClearBuffer { buffer: sums, offset: 4, size: Some(8) });
    card.present(color);
    card
}
