//! Short ways to record a scene: targets, passes and draws whose layouts are derived from their shaders.

use gfx::format::Format;
use gfx::state::*;
use num::{BufferId, QuerySetId, TextureId, ViewId};
use trace::Trace;
use trace::command::{AnyPipeline, BoundResource, ColorAttachment, DepthAttachment, TextureDesc};
use trace::record::{self, Recorder};

/// A vertex stage that covers the target with one triangle.
pub const COVER: &str = "
@vertex fn vs(@builtin(vertex_index) i: u32) -> @builtin(position) vec4f {
    return vec4f(f32(i & 1u) * 4.0 - 1.0, f32(i >> 1u) * 4.0 - 1.0, 0.5, 1.0);
}
";

/// Positions in clip space and a colour for each vertex, passed on as they are.
pub const COLORED: &str = "
struct Vertex { @builtin(position) at: vec4f, @location(0) color: vec4f }
@vertex fn vs(@location(0) at: vec4f, @location(1) color: vec4f) -> Vertex { return Vertex(at, color); }
@fragment fn fs(v: Vertex) -> @location(0) vec4f { return v.color; }
";

/// The alpha-weighted mean of a colour and what is behind it.
pub const OVER: Blend = {
    let over = BlendComponent { src: BlendFactor::SrcAlpha, dst: BlendFactor::OneMinusSrcAlpha, op: BlendOp::Add };
    Blend { color: over, alpha: BlendComponent { src: BlendFactor::One, ..over } }
};

/// The sum of a colour and what is there.
pub const ADD: Blend = {
    let add = BlendComponent { src: BlendFactor::One, dst: BlendFactor::One, op: BlendOp::Add };
    Blend { color: add, alpha: add }
};

/// A texture with its view.
#[derive(Clone, Copy, Debug)]
pub struct Target {
    /// The texture.
    pub texture: TextureId,
    /// A view of all of it.
    pub view: ViewId,
    /// Its format.
    pub format: Format,
    /// Samples per texel.
    pub samples: u32,
}

impl Target {
    /// As a resource.
    pub fn bound(&self) -> BoundResource {
        BoundResource::View(self.view)
    }
}

/// A draw.
#[derive(Clone, Debug)]
pub struct Draw {
    /// WGSL with a vertex stage `vs` and, unless `depth_only`, a fragment stage `fs`.
    pub source: String,
    /// Entry points, if they have other names.
    pub entries: [&'static str; 2],
    /// Whether it has no fragment stage.
    pub depth_only: bool,
    /// Attributes of the vertices: each vertex has `vectors` values of type `vec4f`, from location 0 on.
    pub attributes: Vec<f32>,
    /// The number of `vec4f` attributes of each vertex.
    pub vectors: u32,
    /// Vertices.
    pub count: u32,
    /// Instances.
    pub instances: u32,
    /// What vertices make.
    pub topology: Topology,
    /// Which faces are thrown away.
    pub cull: CullMode,
    /// What group 0 holds, by binding.
    pub resources: Vec<BoundResource>,
    /// The tests of depth and stencil; none: those of the pass let all pass and write nothing.
    pub depth: Option<DepthStencil>,
    /// Blending of every target.
    pub blend: Option<Blend>,
    /// Channels written.
    pub mask: u8,
    /// Reference of the stencil test.
    pub stencil: u32,
    /// The occlusion query that counts its samples.
    pub query: Option<u32>,
}

impl Draw {
    /// One triangle over the whole target, with a fragment stage.
    pub fn cover(fragment: &str) -> Draw {
        Draw::list(format!("{COVER}{fragment}"), 0, Vec::new()).count(3)
    }

    /// A list of triangles.
    pub fn list(source: impl Into<String>, vectors: u32, attributes: Vec<f32>) -> Draw {
        Draw {
            source: source.into(),
            entries: ["vs", "fs"],
            depth_only: false,
            count: if vectors == 0 { 0 } else { attributes.len() as u32 / (4 * vectors) },
            attributes,
            vectors,
            instances: 1,
            topology: Topology::TriangleList,
            cull: CullMode::None,
            resources: Vec::new(),
            depth: None,
            blend: None,
            mask: 15,
            stencil: 0,
            query: None,
        }
    }

    /// With `count` vertices.
    pub fn count(self, count: u32) -> Draw {
        Draw { count, ..self }
    }

    /// With these resources.
    pub fn with(self, resources: impl IntoIterator<Item = BoundResource>) -> Draw {
        Draw { resources: resources.into_iter().collect(), ..self }
    }

    /// With a depth test that writes.
    pub fn depth(self, format: Format, depth_compare: Compare) -> Draw {
        Draw { depth: Some(DepthStencil { depth_compare, ..record::depth_less(format) }), ..self }
    }

    /// Blended.
    pub fn blend(self, blend: Blend) -> Draw {
        Draw { blend: Some(blend), ..self }
    }
}

/// A pass.
#[derive(Clone, Debug, Default)]
pub struct Pass {
    /// Colour targets, with what they are cleared to, if they are.
    pub color: Vec<(Target, Option<[f64; 4]>)>,
    /// Depth buffer, with what its depths and stencils are cleared to, if they are.
    pub depth: Option<(Target, Option<(f32, u32)>)>,
    /// Where samples of the first target are resolved to.
    pub resolve: Option<Target>,
    /// Where occlusion queries go.
    pub queries: Option<QuerySetId>,
}

/// A recording under way.
pub struct Kit {
    /// Where it goes.
    pub card: Recorder,
}

impl Kit {
    /// An empty recording with the name `name`.
    pub fn new(name: &str) -> Kit {
        Kit { card: Recorder::new(name) }
    }

    /// A texture to draw to, of one sample and level.
    pub fn target(&mut self, label: &str, [width, height]: [u32; 2], format: Format) -> Target {
        self.texture(label, record::texture_2d(width, height, format))
    }

    /// Any texture.
    pub fn texture(&mut self, label: &str, desc: TextureDesc) -> Target {
        let (format, samples) = (desc.format, desc.samples);
        let texture = self.card.create_texture(label, desc);
        Target { texture, view: self.card.create_view(texture), format, samples }
    }

    /// A buffer of numbers.
    pub fn floats(&mut self, label: &str, numbers: &[f32]) -> BufferId {
        let bytes: Vec<u8> = numbers.iter().flat_map(|number| number.to_le_bytes()).collect();
        self.card.create_buffer_init(label, &bytes)
    }

    /// A buffer of numbers, bound whole.
    pub fn numbers(&mut self, label: &str, numbers: &[f32]) -> BoundResource {
        record::whole(self.floats(label, numbers))
    }

    /// A zeroed buffer of `words` words, bound whole.
    pub fn words(&mut self, label: &str, words: u64) -> (BufferId, BoundResource) {
        let buffer = self.card.create_buffer(label, 4 * words);
        (buffer, record::whole(buffer))
    }

    /// A sampler.
    pub fn sampler(&mut self, desc: SamplerDesc) -> BoundResource {
        BoundResource::Sampler(self.card.create_sampler(desc))
    }

    /// A pass of draws.
    pub fn pass(&mut self, pass: &Pass, draws: &[Draw]) {
        let samples =
            pass.color.first().map_or(pass.depth.as_ref().map_or(1, |depth| depth.0.samples), |color| color.0.samples);
        let made: Vec<_> = draws
            .iter()
            .map(|draw| {
                let shader = self.card.create_shader("program", &draw.source);
                let mut desc = record::render_pipeline(shader, Format::Rgba8Unorm);
                desc.vertex = record::stage_entry(shader, draw.entries[0]);
                desc.fragment = (!draw.depth_only).then(|| record::stage_entry(shader, draw.entries[1]));
                let target = |target: &(Target, Option<[f64; 4]>)| {
                    Some(ColorTarget { format: target.0.format, blend: draw.blend, logic: None, write_mask: draw.mask })
                };
                desc.targets = pass.color.iter().map(target).collect();
                desc.primitive.topology = draw.topology;
                desc.primitive.cull_mode = draw.cull;
                desc.multisample.count = samples;
                let none = |(target, _): &(Target, _)| DepthStencil {
                    depth_write: false,
                    depth_compare: Compare::Always,
                    ..record::depth_less(target.format)
                };
                desc.depth_stencil = draw.depth.or(pass.depth.as_ref().map(none));
                let attributes = (draw.vectors > 0).then(|| {
                    let places: Vec<_> = (0..draw.vectors).map(|at| (at, VertexFormat::Float32x4)).collect();
                    desc.buffers = vec![record::vertex_buffer(&places)];
                    self.floats("attributes", &draw.attributes)
                });
                let pipeline = self.card.create_render_pipeline("", desc);
                let group = (!draw.resources.is_empty()).then(|| {
                    let layout = self.card.get_bind_group_layout(AnyPipeline::Render(pipeline), 0);
                    self.card.create_bind_group(layout, (0..).zip(draw.resources.iter().cloned()))
                });
                (pipeline, group, attributes, draw)
            })
            .collect();
        let color: Vec<_> = pass
            .color
            .iter()
            .enumerate()
            .map(|(at, &(target, clear))| ColorAttachment {
                view: target.view,
                depth_slice: None,
                resolve: pass.resolve.filter(|_| at == 0).map(|target| target.view),
                clear,
                store: true,
            })
            .collect();
        let depth = pass.depth.map(|(target, clear)| DepthAttachment {
            depth_clear: clear.map(|(depth, _)| depth).filter(|_| target.format.has_depth()),
            stencil_clear: clear.map(|(_, stencil)| stencil).filter(|_| target.format.has_stencil()),
            ..record::load_depth(target.view)
        });
        let mut open = self.card.begin_render_pass_with(color, depth, pass.queries);
        for (pipeline, group, attributes, draw) in made {
            open.set_pipeline(pipeline);
            if let Some(group) = group {
                open.set_bind_group(0, group);
            }
            if let Some(buffer) = attributes {
                open.set_vertex_buffer(0, buffer);
            }
            open.set_stencil_reference(draw.stencil);
            match draw.query {
                Some(query) => open.occlusion_query(query, |open| open.draw(draw.count, draw.instances)),
                None => open.draw(draw.count, draw.instances),
            }
        }
    }

    /// Workgroups of a compute shader whose entry point is `main`.
    pub fn compute(&mut self, source: &str, resources: impl IntoIterator<Item = BoundResource>, groups: [u32; 3]) {
        let shader = self.card.create_shader("program", source);
        let pipeline = self.card.create_compute_pipeline("", None, record::stage_entry(shader, "main"));
        let layout = self.card.get_bind_group_layout(AnyPipeline::Compute(pipeline), 0);
        let group = self.card.create_bind_group(layout, (0..).zip(resources));
        let mut pass = self.card.begin_compute_pass();
        pass.set_pipeline(pipeline);
        pass.set_bind_group(0, group);
        pass.dispatch(groups[0], groups[1], groups[2]);
    }

    /// Ends a frame.
    pub fn present(&mut self, target: Target) {
        self.card.present(target.texture);
    }

    /// The trace.
    pub fn finish(self) -> Trace {
        self.card.finish()
    }
}
