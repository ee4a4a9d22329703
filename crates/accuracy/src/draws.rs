//! Draws recorded at run time, for targets that need shaders, textures and the renderer: small traces of one pass, and the work that
//! they leave.

use anyhow::Result;

use gfx::format::Format;
use gfx::state::{Blend, ColorTarget, Compare, DepthStencil, IndexFormat, Topology, VertexFormat};
use render::{self, Options};
use trace::Trace;
use trace::command::{AnyPipeline, BoundResource};
use trace::record::{self, Recorder};
use work::{Event, RenderKey};

/// Format of the depth buffer, where there is one.
pub const DEPTH: Format = Format::Depth32Float;

/// A draw of its own program.
pub struct Stroke {
    /// WGSL with one vertex and one fragment stage.
    pub source: String,
    /// What its vertices make.
    pub topology: Topology,
    /// How many they are, where there are no indices.
    pub vertices: u32,
    /// Their indices.
    pub indices: Option<Vec<u32>>,
    /// Four numbers each for locations 0 and 1 of every vertex.
    pub attributes: Vec<[f32; 8]>,
    /// What group 0 holds, by binding.
    pub resources: Vec<BoundResource>,
    /// The depth test.
    pub depth: Option<DepthStencil>,
    /// Blending.
    pub blend: Option<Blend>,
}

impl Stroke {
    /// A triangle list of `vertices` vertices.
    pub fn new(source: impl Into<String>, vertices: u32) -> Stroke {
        Stroke {
            source: source.into(),
            topology: Topology::TriangleList,
            vertices,
            indices: None,
            attributes: Vec::new(),
            resources: Vec::new(),
            depth: None,
            blend: None,
        }
    }
}

/// One pass over a cleared target, shown.
pub struct Sheet {
    /// Where its resources are made.
    pub card: Recorder,
    size: [u32; 2],
    samples: u32,
    strokes: Vec<Stroke>,
}

impl Sheet {
    /// A target of `size` pixels with `samples` samples per pixel.
    pub fn new(size: [u32; 2], samples: u32) -> Sheet {
        Sheet { card: Recorder::new("accuracy"), size, samples, strokes: Vec::new() }
    }

    /// Draws.
    pub fn draw(&mut self, stroke: Stroke) {
        self.strokes.push(stroke);
    }

    /// The trace of it.
    pub fn finish(self) -> Trace {
        let Sheet { mut card, size: [width, height], samples, strokes } = self;
        let format = Format::Rgba8Unorm;
        let target = card.create_texture("target", record::texture_2d(width, height, format));
        let target_view = card.create_view(target);
        let mut attachment = record::clear(target_view, [0.25, 0.0, 0.0, 1.0]);
        if samples > 1 {
            let texture = card.create_texture("samples", record::texture_multisampled(width, height, samples, format));
            let view = card.create_view(texture);
            attachment = record::clear_and_resolve(view, [0.25, 0.0, 0.0, 1.0], target_view);
        }
        let depth = strokes.iter().any(|stroke| stroke.depth.is_some()).then(|| {
            let texture = card.create_texture("depth", record::texture_multisampled(width, height, samples, DEPTH));
            card.create_view(texture)
        });
        let made: Vec<_> = strokes
            .into_iter()
            .map(|stroke| {
                let shader = card.create_shader("program", &stroke.source);
                let mut desc = record::render_pipeline(shader, format);
                desc.primitive.topology = stroke.topology;
                desc.multisample.count = samples;
                // Where one draw has a depth buffer all have one: it is the pass's.
                desc.depth_stencil = stroke.depth.or(depth.map(|_| DepthStencil {
                    depth_write: false,
                    depth_compare: Compare::Always,
                    ..record::depth_less(DEPTH)
                }));
                desc.targets[0] = Some(ColorTarget { blend: stroke.blend, ..record::target(format) });
                let attributes = (!stroke.attributes.is_empty()).then(|| {
                    desc.buffers = vec![record::vertex_buffer(&[(0, VertexFormat::Float32x4), (1, VertexFormat::Float32x4)])];
                    let bytes: Vec<u8> = stroke.attributes.iter().flatten().flat_map(|number| number.to_le_bytes()).collect();
                    card.create_buffer_init("attributes", &bytes)
                });
                let indices = stroke.indices.as_ref().map(|indices| {
                    let bytes: Vec<u8> = indices.iter().flat_map(|index| index.to_le_bytes()).collect();
                    (card.create_buffer_init("indices", &bytes), indices.len() as u32)
                });
                let pipeline = card.create_render_pipeline("", desc);
                let group = (!stroke.resources.is_empty()).then(|| {
                    let layout = card.get_bind_group_layout(AnyPipeline::Render(pipeline), 0);
                    card.create_bind_group(layout, (0..).zip(stroke.resources))
                });
                (pipeline, group, attributes, indices, stroke.vertices)
            })
            .collect();
        let mut pass = card.begin_render_pass([attachment], depth.and_then(|view| record::clear_depth(view, false)));
        for (pipeline, group, attributes, indices, vertices) in made {
            pass.set_pipeline(pipeline);
            if let Some(group) = group {
                pass.set_bind_group(0, group);
            }
            if let Some(buffer) = attributes {
                pass.set_vertex_buffer(0, buffer);
            }
            match indices {
                Some((buffer, count)) => {
                    pass.set_index_buffer(buffer, IndexFormat::Uint32);
                    pass.draw_indexed(count, 1);
                }
                None => pass.draw(vertices, 1),
            }
        }
        drop(pass);
        card.present(target);
        card.finish()
    }
}

/// What the renderer leaves of a trace for machines. It is rendered on the threads of the caller: whether the work is the same on any number of
/// them is asked of this.
///
/// # Errors
/// If it cannot be rendered.
pub fn work(trace: &Trace, key: RenderKey) -> Result<Vec<Event>> {
    let mut events = Vec::new();
    render::render(trace, &Options { record: true, key, ..Options::default() }, &mut |event| {
        events.push(event);
        Ok(())
    })?;
    Ok(events)
}

/// A vertex stage that covers the target with one triangle.
pub const COVER: &str = "
    @vertex fn vs(@builtin(vertex_index) i: u32) -> @builtin(position) vec4f {
        return vec4f(f32(i & 1u) * 4.0 - 1.0, f32(i >> 1u) * 4.0 - 1.0, 0.5, 1.0);
    }
";
