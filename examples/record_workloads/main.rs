//! Records the four speed workloads W1 to W4 as native traces: `record_workloads DIR [FRAMES]`. For benchmarks only: they are
//! large, so they are made where they are needed.
//!
//! Each frame is one pass that clears colour and depth, one indexed draw, and a present.

mod mesh;

use std::path::Path;
use std::process::ExitCode;

use fillrate::gfx::format::Format;
use fillrate::gfx::state::*;
use fillrate::trace::command::BoundResource;
use fillrate::trace::record::{self, Recorder};
use fillrate::trace::{Packing, TraceError};

use mesh::{HEIGHT, Mesh, STRIDE, WIDTH};

/// What the workloads share: the uniform matrix, and GL's depth range mapped to the one of this format.
const COMMON: &str = "\
@group(0) @binding(0) var<uniform> camera: mat4x4<f32>;

// The definition clips z to -w..w, a trace to 0..w.
fn place(position: vec4<f32>) -> vec4<f32> {
    let clip = camera * position;
    return vec4<f32>(clip.xy, (clip.z + clip.w) * 0.5, clip.w);
}
";

const FLAT: &str = "
struct Varying {
    @builtin(position) position: vec4<f32>,
    @location(0) @interpolate(flat) color: vec4<f32>,
}

@vertex
fn vertex(@location(0) position: vec4<f32>, @location(2) color: vec4<f32>) -> Varying {
    return Varying(place(position), color);
}

@fragment
fn fragment(in: Varying) -> @location(0) vec4<f32> {
    return in.color;
}
";

const TEXTURED: &str = "
@group(0) @binding(1) var image: texture_2d<f32>;
@group(0) @binding(2) var image_sampler: sampler;

struct Varying {
    @builtin(position) position: vec4<f32>,
    @location(0) uv: vec2<f32>,
}

@vertex
fn vertex(@location(0) position: vec4<f32>, @location(1) uv: vec2<f32>) -> Varying {
    return Varying(place(position), uv);
}

@fragment
fn fragment(in: Varying) -> @location(0) vec4<f32> {
    return textureSample(image, image_sampler, in.uv);
}
";

const TEXTURED_GOURAUD: &str = "
@group(0) @binding(1) var image: texture_2d<f32>;
@group(0) @binding(2) var image_sampler: sampler;

struct Varying {
    @builtin(position) position: vec4<f32>,
    @location(0) uv: vec2<f32>,
    @location(1) color: vec4<f32>,
}

@vertex
fn vertex(@location(0) position: vec4<f32>, @location(1) uv: vec2<f32>, @location(2) color: vec4<f32>) -> Varying {
    return Varying(place(position), uv, color);
}

@fragment
fn fragment(in: Varying) -> @location(0) vec4<f32> {
    return textureSample(image, image_sampler, in.uv) * in.color;
}
";

const BLINN_PHONG: &str = "
struct Varying {
    @builtin(position) clip: vec4<f32>,
    @location(0) position: vec3<f32>,
    @location(1) normal: vec3<f32>,
}

@vertex
fn vertex(@location(0) position: vec4<f32>, @location(3) normal: vec3<f32>) -> Varying {
    return Varying(place(position), position.xyz, normal);
}

const light = vec3<f32>(4.0, 5.0, 8.0);
const eye = vec3<f32>(0.0, 0.0, 6.2);

@fragment
fn fragment(in: Varying) -> @location(0) vec4<f32> {
    let n = normalize(in.normal);
    let l = normalize(light - in.position);
    let v = normalize(eye - in.position);
    let h = normalize(l + v);
    let diffuse = max(dot(n, l), 0.0);
    let specular = pow(max(dot(n, h), 0.0), 32.0);
    return vec4<f32>(vec3<f32>(0.8, 0.5, 0.3) * (0.1 + diffuse) + vec3<f32>(0.6) * specular, 1.0);
}
";

const IDENTITY: [f32; 16] = [1., 0., 0., 0., 0., 1., 0., 0., 0., 0., 1., 0., 0., 0., 0., 1.];

/// A workload.
struct Workload {
    name: &'static str,
    mesh: Mesh,
    camera: [f32; 16],
    shader: &'static str,
    /// Locations and formats that the shader reads; offsets are those of the common vertex.
    attributes: &'static [u32],
    texture: Option<Texture>,
    primitive: Primitive,
    depth_test: bool,
}

struct Texture {
    size: u32,
    seed: u32,
    mipmaps: bool,
}

fn workloads() -> [Workload; 4] {
    let plain = Primitive { provoking_last: true, ..Primitive::default() };
    [
        Workload {
            name: "w1",
            mesh: mesh::w1(),
            camera: IDENTITY,
            shader: FLAT,
            attributes: &[0, 2],
            texture: None,
            primitive: plain,
            depth_test: true,
        },
        Workload {
            name: "w2",
            mesh: mesh::w2(100),
            camera: IDENTITY,
            shader: TEXTURED,
            attributes: &[0, 1],
            texture: Some(Texture { size: 1024, seed: 7, mipmaps: true }),
            primitive: plain,
            depth_test: false,
        },
        Workload {
            name: "w3",
            mesh: mesh::w3(),
            camera: IDENTITY,
            shader: TEXTURED_GOURAUD,
            attributes: &[0, 1, 2],
            texture: Some(Texture { size: 512, seed: 5, mipmaps: false }),
            primitive: plain,
            depth_test: true,
        },
        Workload {
            name: "w4",
            mesh: mesh::w4(),
            camera: mesh::w4_camera(),
            shader: BLINN_PHONG,
            attributes: &[0, 3],
            texture: None,
            primitive: Primitive { cull_mode: CullMode::Back, ..plain },
            depth_test: true,
        },
    ]
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

fn record(workload: &Workload, frames: u32) -> Recorder {
    let mut card = Recorder::new(workload.name);
    let vertices = card.create_buffer_init("vertices", workload.mesh.vertex_bytes());
    let indices = card.create_buffer_init("indices", workload.mesh.index_bytes());
    let camera = card.create_buffer_init("camera", bytemuck::cast_slice(&workload.camera));

    let mut kinds = vec![(0, record::UNIFORM)];
    let mut bound = vec![(0, record::whole(camera))];
    if let Some(texture) = &workload.texture {
        let levels = if texture.mipmaps { texture.size.ilog2() + 1 } else { 1 };
        let desc = record::texture_mipped(texture.size, texture.size, levels, Format::Rgba8Unorm);
        let image = card.create_texture("image", desc);
        let mut texels = mesh::texture(texture.size, texture.seed);
        for level in 0..levels {
            card.write_level(image, level, &format!("image-{level}"), &texels);
            texels = mesh::next_level(&texels, texture.size >> level);
        }
        let view = card.create_view(image);
        let sampler = card.create_sampler(record::trilinear_repeat());
        kinds.extend([(1, record::TEXTURE), (2, record::SAMPLER)]);
        bound.extend([(1, BoundResource::View(view)), (2, BoundResource::Sampler(sampler))]);
    }
    let layout = card.create_bind_group_layout(kinds);
    let group = card.create_bind_group(layout, bound);
    let pipeline_layout = card.create_pipeline_layout([layout], 0);

    let color = card.create_texture("color", record::texture_2d(WIDTH, HEIGHT, Format::Rgba8Unorm));
    let depth = card.create_texture("depth", record::texture_2d(WIDTH, HEIGHT, Format::Depth32Float));
    let (color_view, depth_view) = (card.create_view(color), card.create_view(depth));

    let shader = card.create_shader(workload.name, &format!("{COMMON}{}", workload.shader));
    let mut desc = record::render_pipeline(shader, Format::Rgba8Unorm);
    desc.layout = Some(pipeline_layout);
    desc.buffers = vec![Some(VertexBufferLayout {
        stride: STRIDE,
        step: StepMode::Vertex,
        attributes: workload.attributes.iter().map(|&location| attribute(location)).collect(),
    })];
    desc.primitive = workload.primitive;
    let less = record::depth_less(Format::Depth32Float);
    desc.depth_stencil = Some(if workload.depth_test {
        less
    } else {
        DepthStencil { depth_write: false, depth_compare: Compare::Always, ..less }
    });
    let pipeline = card.create_render_pipeline(workload.name, desc);

    for _ in 0..frames {
        let attachment = record::clear(color_view, [0.0, 0.0, 0.0, 1.0]);
        let mut pass = card.begin_render_pass([attachment], record::clear_depth(depth_view, true));
        pass.set_pipeline(pipeline);
        pass.set_bind_group(0, group);
        pass.set_vertex_buffer(0, vertices);
        pass.set_index_buffer(indices, IndexFormat::Uint32);
        pass.draw_indexed(workload.mesh.indices.len() as u32, 1);
        drop(pass);
        card.present(color);
    }
    card
}

fn main() -> ExitCode {
    let mut arguments = std::env::args().skip(1);
    let folder = arguments.next();
    let frames = arguments.next().map_or(Ok(1), |text| text.parse());
    let (Some(folder), Ok(frames), None) = (folder, frames, arguments.next()) else {
        eprintln!("usage: record_workloads DIR [FRAMES]\n\nWrites w1.zip, w2.zip, w3.zip and w4.zip into DIR.");
        return ExitCode::from(2);
    };
    match write_all(Path::new(&folder), frames) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("{error}");
            ExitCode::from(1)
        }
    }
}

fn write_all(folder: &Path, frames: u32) -> Result<(), TraceError> {
    std::fs::create_dir_all(folder).map_err(|error| TraceError::new(folder, error))?;
    for workload in workloads() {
        record(&workload, frames).save_zip(folder.join(format!("{}.zip", workload.name)), Packing::Stored)?;
    }
    Ok(())
}
