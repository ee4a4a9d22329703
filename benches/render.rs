//! The functional draw path on the four speed workloads: milliseconds per frame, clears included, reading and loading left out.
//!
//! `cargo bench --bench render -- [w1|w2|w3|w4]... [frames N] [no-skips] [record]`; instead of all skips one of them goes by
//! `no-overwritten` or `no-full-blocks`. A path in place of a workload is a trace, whose first frame is rendered, loading included.

#[path = "../examples/record_workloads/mesh.rs"]
mod mesh;

use std::path::Path;
use std::sync::Arc;
use std::time::Instant;

use fillrate::gfx::format::Format;
use fillrate::gfx::image::ImageDesc;
use fillrate::gfx::stage::{self, StageMap};
use fillrate::gfx::state::*;
use fillrate::gfx::texture;
use fillrate::import;
use fillrate::num::{CallSite, Limits, ShaderId, Words};
use fillrate::render::draw::{
    BoundStage, BufferRange, DrawCall, DrawRange, DynamicState, IndexRange, OpenQueries, PassOptions, RenderPass, Skips,
};
use fillrate::render::pipeline::RenderPipeline;
use fillrate::render::surface::{Shape, TileSurface};
use fillrate::render::{Ledger, Need, Options, render};
use fillrate::shader::{self, Module, Resource, Resources, Uniforms};
use fillrate::trace::command::{RenderPipelineDesc, StageDesc};
use fillrate::work::RenderKey;
use mesh::{HEIGHT, Mesh, STRIDE, WIDTH};

const COMMON: &str = "
@group(0) @binding(0) var<uniform> camera: mat4x4<f32>;
@group(0) @binding(1) var image: texture_2d<f32>;
@group(0) @binding(2) var image_sampler: sampler;
fn place(position: vec4<f32>) -> vec4<f32> {
    let clip = camera * position;
    return vec4<f32>(clip.xy, (clip.z + clip.w) * 0.5, clip.w);
}
";

const FLAT: &str = "
struct Varying { @builtin(position) position: vec4<f32>, @location(0) @interpolate(flat) color: vec4<f32> }
@vertex fn vertex(@location(0) position: vec4<f32>, @location(2) color: vec4<f32>) -> Varying {
    return Varying(place(position), color);
}
@fragment fn fragment(in: Varying) -> @location(0) vec4<f32> { return in.color; }
";

const TEXTURED: &str = "
struct Varying { @builtin(position) position: vec4<f32>, @location(0) uv: vec2<f32> }
@vertex fn vertex(@location(0) position: vec4<f32>, @location(1) uv: vec2<f32>) -> Varying {
    return Varying(place(position), uv);
}
@fragment fn fragment(in: Varying) -> @location(0) vec4<f32> { return textureSample(image, image_sampler, in.uv); }
";

const TEXTURED_GOURAUD: &str = "
struct Varying { @builtin(position) position: vec4<f32>, @location(0) uv: vec2<f32>, @location(1) color: vec4<f32> }
@vertex fn vertex(@location(0) position: vec4<f32>, @location(1) uv: vec2<f32>, @location(2) color: vec4<f32>) -> Varying {
    return Varying(place(position), uv, color);
}
@fragment fn fragment(in: Varying) -> @location(0) vec4<f32> {
    return textureSample(image, image_sampler, in.uv) * in.color;
}
";

const BLINN_PHONG: &str = "
struct Varying { @builtin(position) clip: vec4<f32>, @location(0) position: vec3<f32>, @location(1) normal: vec3<f32> }
@vertex fn vertex(@location(0) position: vec4<f32>, @location(3) normal: vec3<f32>) -> Varying {
    return Varying(place(position), position.xyz, normal);
}
const light = vec3<f32>(4.0, 5.0, 8.0);
const eye = vec3<f32>(0.0, 0.0, 6.2);
@fragment fn fragment(in: Varying) -> @location(0) vec4<f32> {
    let n = normalize(in.normal);
    let l = normalize(light - in.position);
    let v = normalize(eye - in.position);
    let h = normalize(l + v);
    let diffuse = max(dot(n, l), 0.0);
    let specular = pow(max(dot(n, h), 0.0), 32.0);
    return vec4<f32>(vec3<f32>(0.8, 0.5, 0.3) * (0.1 + diffuse) + vec3<f32>(0.6) * specular, 1.0);
}
";

struct Workload {
    mesh: Mesh,
    camera: [f32; 16],
    source: &'static str,
    locations: &'static [u32],
    /// Edge length, seed, whether it has levels.
    texture: Option<(u32, u32, bool)>,
    cull: CullMode,
    depth_test: bool,
}

fn workload(name: &str) -> Option<Workload> {
    let identity = std::array::from_fn(|i| if i % 5 == 0 { 1.0 } else { 0.0 });
    let plain = |mesh, source, locations, texture, depth_test| Workload {
        mesh,
        camera: identity,
        source,
        locations,
        texture,
        cull: CullMode::None,
        depth_test,
    };
    Some(match name {
        "w1" => plain(mesh::w1(), FLAT, &[0, 2], None, true),
        "w2" => plain(mesh::w2(100), TEXTURED, &[0, 1], Some((1024, 7, true)), false),
        "w3" => plain(mesh::w3(), TEXTURED_GOURAUD, &[0, 1, 2], Some((512, 5, false)), true),
        "w4" => {
            Workload { camera: mesh::w4_camera(), cull: CullMode::Back, ..plain(mesh::w4(), BLINN_PHONG, &[0, 3], None, true) }
        }
        _ => return None,
    })
}

fn attribute(location: u32) -> VertexAttribute {
    let (format, offset) = match location {
        0 => (VertexFormat::Float32x4, 0),
        1 => (VertexFormat::Float32x2, 16),
        2 => (VertexFormat::Unorm8x4, 24),
        _ => (VertexFormat::Float32x3, 28),
    };
    VertexAttribute { format, offset, location }
}

fn buffer(bytes: &[u8]) -> BufferRange {
    let words = Words::new(bytes.len() as u64);
    words.write(0, bytes);
    BufferRange { size: words.len(), words: Arc::new(words), offset: 0, address: 0, version: 0 }
}

fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).filter(|a| a != "--bench").collect();
    let has = |word: &str| arguments.iter().any(|a| a == word);
    let after = |word: &str| arguments.iter().position(|a| a == word).and_then(|i| arguments.get(i + 1)?.parse().ok());
    let frames: usize = after("frames").unwrap_or(9);
    let skips = Skips {
        overwritten: !has("no-skips") && !has("no-overwritten"),
        full_blocks: !has("no-skips") && !has("no-full-blocks"),
        repeated: !has("no-skips") && !has("no-repeated"),
    };
    for path in arguments.iter().filter(|a| a.contains('/')) {
        render_trace(Path::new(path), frames, skips);
    }
    if arguments.iter().any(|a| a.contains('/')) {
        return;
    }
    let names: Vec<&str> = arguments.iter().map(String::as_str).filter(|a| a.starts_with('w')).collect();
    let names = if names.is_empty() { vec!["w1", "w2", "w3", "w4"] } else { names };
    for name in names {
        let Some(workload) = workload(name) else {
            eprintln!("no workload {name}");
            continue;
        };
        run(name, &workload, frames, skips, has("record"));
    }
}

fn render_trace(path: &Path, runs: usize, skips: Skips) {
    let trace = import::open(path).unwrap_or_else(|e| panic!("{e:#}"));
    let options = Options { skips, frames: (0..1).into(), ..Options::default() };
    let mut times = Vec::new();
    for _ in 0..runs {
        let start = Instant::now();
        render(&trace, &options, &mut |event| {
            drop(event);
            Ok(())
        })
        .unwrap_or_else(|e| panic!("{e:#}"));
        times.push(start.elapsed().as_secs_f64() * 1e3);
    }
    times.sort_by(f64::total_cmp);
    println!("{}: {:.1} ms a frame (least {:.1})", path.display(), times[times.len() / 2], times[0]);
}

fn run(name: &str, workload: &Workload, frames: usize, skips: Skips, record: bool) {
    let vertices = [Some(buffer(&workload.mesh.vertex_bytes()))];
    let indices = IndexRange { range: buffer(&workload.mesh.index_bytes()), format: IndexFormat::Uint32 };
    let camera = buffer(bytemuck::cast_slice(&workload.camera));
    let image = workload.texture.map(|(size, seed, levels)| prepare(size, seed, levels));
    let sampler = texture::Sampler::new(&SamplerDesc {
        address: [AddressMode::Repeat; 3],
        mag: FilterMode::Linear,
        min: FilterMode::Linear,
        mipmap: FilterMode::Linear,
        ..SamplerDesc::default()
    });
    let module = Module::new(name, shader::ModuleSource::Wgsl(&format!("{COMMON}{}", workload.source)))
        .unwrap_or_else(|e| panic!("{e}"));
    let stage = || StageDesc { shader: ShaderId(0), entry: None, constants: Vec::new(), zero_workgroup_memory: true };
    let depth = DepthStencil {
        format: Format::Depth32Float,
        depth_write: workload.depth_test,
        depth_compare: if workload.depth_test { Compare::Less } else { Compare::Always },
        stencil_front: StencilFace::default(),
        stencil_back: StencilFace::default(),
        stencil_read_mask: 0,
        stencil_write_mask: 0,
        stencil_back_masks: None,
        bias: 0.0,
        bias_slope: 0.0,
        bias_clamp: 0.0,
    };
    let desc = RenderPipelineDesc {
        layout: None,
        vertex: stage(),
        buffers: vec![Some(VertexBufferLayout {
            stride: STRIDE,
            step: StepMode::Vertex,
            attributes: workload.locations.iter().map(|&l| attribute(l)).collect(),
        })],
        primitive: Primitive { cull_mode: workload.cull, provoking_last: true, ..Primitive::default() },
        depth_stencil: Some(depth),
        multisample: Multisample::default(),
        fragment: Some(stage()),
        targets: vec![Some(ColorTarget { format: Format::Rgba8Unorm, blend: None, logic: None, write_mask: 15 })],
    };
    let module = Arc::new(module);
    let modules = StageMap::from_fn(|_| Some(module.clone()));
    let pipeline =
        RenderPipeline::new(&desc, &modules, RenderKey::default().needless, name).map_or_else(|e| panic!("{e}"), Arc::new);
    let groups = [].into();
    let bound = |kind: stage::Stage| -> Vec<Vec<Resource<'_>>> {
        let resource = |binding: &shader::Binding| match binding.binding {
            0 => Resource::Buffer(shader::BufferRange { words: &camera.words, offset: 0, size: 64, address: 0 }),
            1 => Resource::Texture(image.as_ref().expect("a texture")),
            _ => Resource::Sampler(&sampler),
        };
        let bindings = pipeline.stage(kind).map_or(&[][..], |stage| &stage.interface().bindings);
        bindings.iter().map(|binding| vec![resource(binding)]).collect()
    };
    let bindings = StageMap::from_fn(bound);
    let mut uniforms = StageMap::<Uniforms>::default();
    let options = PassOptions { need: Need::Colors, areas: false, key: RenderKey::default(), record, skips };
    let shape = |format| Shape { format, width: WIDTH, height: HEIGHT, samples: 1 };
    let mut color = Some(TileSurface::new(shape(Format::Rgba8Unorm)));
    let mut depth = Some(TileSurface::new(shape(Format::Depth32Float)));
    let ledger = Ledger::new(&Limits::default());
    let mut times = Vec::new();
    let mut last = None;
    let mut spent = 0.0;
    for frame in 0..frames + 1 {
        let start = Instant::now();
        spent = if frame == 1 { processor_seconds() } else { spent };
        let (mut c, mut d) = (color.take().expect("colour"), depth.take().expect("depth"));
        c.clear([0xff00_0000, 0, 0, 0]);
        d.clear([1.0_f32.to_bits(), 0, 0, 0]);
        let mut pass = RenderPass::begin(WIDTH, HEIGHT, 1, vec![Some((c, Format::Rgba8Unorm))], Some(d), options);
        let state =
            pass.state(&pipeline, &DynamicState::new(WIDTH, HEIGHT), OpenQueries::default()).unwrap_or_else(|e| panic!("{e}"));
        let mut stages = StageMap::default();
        for (kind, uniforms) in stage::Stage::ALL.into_iter().zip(uniforms.values_mut()) {
            let resources = Resources { bindings: &bindings[kind], ..Resources::default() };
            stages[kind] = pipeline.stage(kind).map(|stage| BoundStage::new(stage, resources, uniforms));
        }
        let reach = Default::default();
        let call = DrawCall {
            state: &state,
            number: 0,
            site: CallSite::Command(0),
            groups: &groups,
            vertex_buffers: &vertices,
            index: Some(&indices),
            range: DrawRange { count: workload.mesh.indices.len() as u32, instances: 1, ..DrawRange::default() },
            stages,
            signature: None,
            reach: &reach,
            boxes: None,
            ledger: &ledger,
        };
        let drawn = pass.draw(&call, &mut |event| drop(event)).unwrap_or_else(|e| panic!("{e}"));
        let ended = pass.end();
        times.push(start.elapsed().as_secs_f64() * 1e3);
        color = ended.color.into_iter().next().flatten();
        depth = ended.depth;
        last = Some(drawn);
    }
    let spent = (processor_seconds() - spent) * 1e3 / frames as f64;
    times.remove(0);
    times.sort_by(f64::total_cmp);
    let median = times[times.len() / 2];
    let funnel = last.expect("a frame").funnel;
    println!(
        "{name}: {median:.1} ms a frame (least {:.1}; {spent:.0} ms of processor time), {} quads, {} of {} fragments shaded",
        times[0], funnel.quads_shaded, funnel.fragments_shaded, funnel.fragments_covered
    );
    if std::env::var_os("FILLRATE_BENCH_IMAGE").is_some() {
        let bytes = color.expect("colour").to_bytes();
        let image = image::RgbaImage::from_raw(WIDTH, HEIGHT, bytes).expect("an image");
        image.save(format!("{name}.png")).expect("an image file");
    }
}

/// Processor time of all threads so far, where the system tells.
fn processor_seconds() -> f64 {
    let stat = std::fs::read_to_string("/proc/self/stat").unwrap_or_default();
    let after = stat.rsplit(')').next().unwrap_or_default();
    // User and system time, in hundredths of a second: fields 14 and 15 of the whole, 12 and 13 after the name.
    after.split_whitespace().skip(11).take(2).filter_map(|f| f.parse::<f64>().ok()).sum::<f64>() / 100.0
}

fn prepare(size: u32, seed: u32, mipmapped: bool) -> texture::View {
    let levels = if mipmapped { size.ilog2() + 1 } else { 1 };
    let desc =
        ImageDesc { dimension: TextureDimension::D2, size: [size, size, 1], levels, samples: 1, format: Format::Rgba8Unorm };
    let words = Words::new(desc.bytes());
    let mut texels = mesh::texture(size, seed);
    for level in 0..levels {
        words.write(desc.offset(level, 0), &texels);
        texels = mesh::next_level(&texels, size >> level);
    }
    let range = texture::ViewRange {
        dimension: ViewDimension::D2,
        format: desc.format,
        aspect: Aspect::All,
        base_level: 0,
        levels,
        base_layer: 0,
        layers: 1,
    };
    texture::View::new(&words, &desc, &range, 0).unwrap_or_else(|e| panic!("{e}"))
}
