//! Small pipelines drawn whole and compared: with expected pixels, and one way of drawing with another.

mod coverage;
mod cull;
mod images;
mod limits;
mod ways;

use std::sync::{Arc, Mutex};

use super::*;
use crate::fault::Reason;
use crate::pipeline::{PipelineError, RenderPipeline};
use crate::surface::{Shape, TileSurface};
use gfx::format::Format;
use gfx::state::*;
use num::{CallSite, Limits, ShaderId};
use shader::{Module, ModuleSource};
use trace::command::{self, RenderPipelineDesc};
use work::{self, Event, Segment};

/// Vertices come from a buffer: position (4), colour (4).
const PLAIN: &str = "
struct V { @builtin(position) p: vec4<f32>, @location(0) c: vec4<f32> }
@vertex fn vs(@location(0) p: vec4<f32>, @location(1) c: vec4<f32>) -> V { return V(p, c); }
@fragment fn fs(v: V) -> @location(0) vec4<f32> { return v.c; }
";

/// A pass of draws with one pipeline.
#[derive(Clone)]
struct Scene {
    source: String,
    vertices: Vec<[f32; 8]>,
    indices: Option<Vec<u32>>,
    instances: u32,
    extent: (u32, u32),
    format: Format,
    color_words: [u32; 4],
    depth: Option<(Format, f32)>,
    state: RenderPipelineDesc,
    scissor: Option<Rect>,
    viewport: Option<Viewport>,
    reference: u32,
    /// Vertex ranges drawn one after the other.
    draws: Vec<std::ops::Range<u32>>,
    /// The contents of the fragment shader's only binding, if it has one.
    storage: Option<Arc<Words>>,
    limits: Limits,
}

struct Image {
    color: TileSurface,
    depth: Option<TileSurface>,
    drawn: Drawn,
    draws: Vec<Arc<work::Draw>>,
    segments: Vec<Arc<Segment>>,
    ledger: Ledger,
}

#[derive(Clone, Copy)]
struct How {
    threads: usize,
    skips: Skips,
    record: bool,
    key: RenderKey,
    count: bool,
    /// A statistics query is open.
    counted: bool,
    need: Need,
    areas: bool,
}

const USUAL: How = How {
    threads: 2,
    skips: Skips { overwritten: true, full_blocks: true, repeated: true },
    record: false,
    key: RenderKey {
        early_z: true,
        shade: work::Shade::Visible,
        signatures: false,
        paths: false,
        vectors: false,
        needless: work::CulledLate::NONE,
        cull: work::Cull::None,
    },
    count: false,
    counted: false,
    need: Need::Colors,
    areas: false,
};

fn stage(entry: &str) -> command::StageDesc {
    command::StageDesc { shader: ShaderId(0), entry: Some(entry.into()), constants: Vec::new(), zero_workgroup_memory: true }
}

fn depth_state(format: Format, compare: Compare, write: bool) -> DepthStencil {
    DepthStencil {
        format,
        depth_write: write,
        depth_compare: compare,
        stencil_front: StencilFace::default(),
        stencil_back: StencilFace::default(),
        stencil_read_mask: 0xff,
        stencil_write_mask: 0xff,
        stencil_back_masks: None,
        bias: 0.0,
        bias_slope: 0.0,
        bias_clamp: 0.0,
    }
}

impl Scene {
    fn new(vertices: Vec<[f32; 8]>) -> Scene {
        let attribute = |location, offset| VertexAttribute { format: VertexFormat::Float32x4, offset, location };
        let n = vertices.len() as u32;
        Scene {
            source: PLAIN.into(),
            vertices,
            indices: None,
            instances: 1,
            extent: (100, 90),
            format: Format::Rgba8Unorm,
            color_words: [0; 4],
            depth: None,
            state: RenderPipelineDesc {
                layout: None,
                vertex: stage("vs"),
                buffers: vec![Some(VertexBufferLayout {
                    stride: 32,
                    step: StepMode::Vertex,
                    attributes: vec![attribute(0, 0), attribute(1, 16)],
                })],
                primitive: Primitive::default(),
                depth_stencil: None,
                multisample: Multisample::default(),
                fragment: Some(stage("fs")),
                targets: vec![Some(ColorTarget { format: Format::Rgba8Unorm, blend: None, logic: None, write_mask: 15 })],
            },
            scissor: None,
            viewport: None,
            reference: 0,
            draws: std::iter::once(0..n).collect(),
            storage: None,
            limits: Limits::default(),
        }
    }

    fn with_depth(mut self, format: Format, compare: Compare, write: bool, clear: f32) -> Scene {
        self.depth = Some((format, clear));
        self.state.depth_stencil = Some(depth_state(format, compare, write));
        self
    }

    fn samples(mut self, n: u32) -> Scene {
        self.state.multisample.count = n;
        self
    }

    fn target(&mut self) -> &mut ColorTarget {
        self.state.targets[0].as_mut().unwrap()
    }

    fn draw(&self) -> Image {
        self.draw_as(USUAL)
    }

    fn draw_as(&self, how: How) -> Image {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(how.threads).build().unwrap();
        pool.install(|| self.draw_here(how).unwrap())
    }

    fn draw_here(&self, how: How) -> Result<Image, Reason> {
        self.draw_with(&self.pipeline()?, how)
    }

    fn pipeline(&self) -> Result<Arc<RenderPipeline>, PipelineError> {
        let module =
            Module::with_limits("scene", ModuleSource::Wgsl(&self.source), &self.limits).unwrap_or_else(|e| panic!("{e}"));
        let module = Arc::new(module);
        let modules = StageMap::from_fn(|_| Some(module.clone()));
        RenderPipeline::new(&self.state, &modules, work::CulledLate::NONE, "scene").map(Arc::new)
    }

    fn draw_with(&self, pipeline: &Arc<RenderPipeline>, how: How) -> Result<Image, Reason> {
        let bytes: Vec<u8> = self.vertices.iter().flatten().flat_map(|v| v.to_le_bytes()).collect();
        let buffers = [Some(range_of(&bytes))];
        let index = self.indices.as_ref().map(|indices| {
            let bytes: Vec<u8> = indices.iter().flat_map(|i| i.to_le_bytes()).collect();
            IndexRange { range: range_of(&bytes), format: IndexFormat::Uint32 }
        });
        let storage = self.storage.iter().map(|words| {
            vec![shader::Resource::Buffer(shader::BufferRange { words, offset: 0, size: words.len(), address: 1 << 24 })]
        });
        let storage: Vec<_> = storage.collect();
        let (width, height) = self.extent;
        let samples = self.state.multisample.count;
        let mut color = TileSurface::new(Shape { format: self.format, width, height, samples });
        color.clear(self.color_words);
        let depth = self.depth.map(|(format, clear)| {
            let mut depth = TileSurface::new(Shape { format, width, height, samples });
            let code = gfx::texel::encode(format, [clear.to_bits(), 0, 0, 0]);
            depth.clear(bytemuck::cast(code));
            depth
        });
        let How { need, areas, key, record, skips, .. } = how;
        let options = PassOptions { need, areas, key, record, skips };
        let queries = OpenQueries { occlusion: how.count, statistics: how.counted };
        let mut pass = RenderPass::begin(width, height, samples, vec![Some((color, self.format))], depth, options);
        let (mut drawn, mut draws, mut segments) = (Drawn::default(), Vec::new(), Vec::new());
        let boxes = Mutex::default();
        let ledger = Ledger::new(&self.limits);
        let groups = [].into();
        let reach = Arc::default();
        let usual = DynamicState::new(width, height);
        let dynamic = DynamicState {
            viewport: self.viewport.unwrap_or(usual.viewport),
            scissor: self.scissor.unwrap_or(usual.scissor),
            stencil_references: [self.reference; 2],
            ..usual
        };
        let mut uniforms = StageMap::<Uniforms>::default();
        for range in &self.draws {
            let state = pass.state(pipeline, &dynamic, queries)?;
            let mut stages = StageMap::default();
            for (kind, uniforms) in Stage::ALL.into_iter().zip(uniforms.values_mut()) {
                let resources = match kind {
                    Stage::Fragment => Resources { bindings: &storage, ..Resources::default() },
                    Stage::Vertex | Stage::Compute => Resources::default(),
                };
                let stage = pipeline.stage(kind).filter(|_| state.runs(kind));
                stages[kind] = stage.map(|stage| BoundStage::new(stage, resources, uniforms));
            }
            let call = DrawCall {
                state: &state,
                number: 0,
                site: CallSite::Command(0),
                groups: &groups,
                vertex_buffers: &buffers,
                index: index.as_ref(),
                range: DrawRange {
                    first: range.start,
                    count: range.end - range.start,
                    instances: self.instances,
                    ..DrawRange::default()
                },
                stages,
                signature: None,
                reach: &reach,
                boxes: Some(&boxes),
                ledger: &ledger,
            };
            drawn += pass.draw(&call, &mut |event| match event {
                Event::Draw(draw) => draws.push(draw),
                Event::Segment(segment) => segments.push(segment),
                other => panic!("{other:?}"),
            })?;
        }
        let ended = pass.end();
        let color = ended.color.into_iter().next().flatten().unwrap();
        Ok(Image { color, depth: ended.depth, drawn, draws, segments, ledger })
    }
}

fn range_of(bytes: &[u8]) -> BufferRange {
    let words = Words::new(bytes.len() as u64);
    words.write(0, bytes);
    BufferRange { size: words.len(), words: Arc::new(words), offset: 0, address: 1 << 20, version: 0 }
}

/// A vertex in clip space.
fn v(x: f32, y: f32, z: f32, c: [f32; 4]) -> [f32; 8] {
    [x, y, z, 1.0, c[0], c[1], c[2], c[3]]
}

const RED: [f32; 4] = [1.0, 0.0, 0.0, 1.0];
const GREEN: [f32; 4] = [0.0, 1.0, 0.0, 1.0];

/// Two triangles over a rectangle.
fn rectangle([x0, y0, x1, y1]: [f32; 4], z: f32, c: [f32; 4]) -> Vec<[f32; 8]> {
    let p = |x, y| v(x, y, z, c);
    vec![p(x0, y0), p(x1, y0), p(x0, y1), p(x0, y1), p(x1, y0), p(x1, y1)]
}

const ALL: [f32; 4] = [-1.0, -1.0, 1.0, 1.0];

/// Triangles all over the place, of all sizes, some of them clipped.
fn soup(n: u32, seed: u32, w: bool) -> Vec<[f32; 8]> {
    let mut random = num::Random::new(seed.into());
    let mut next = || random.unit();
    let mut out = Vec::new();
    for _ in 0..n {
        let (cx, cy) = (2.4 * next() - 1.2, 2.4 * next() - 1.2);
        let size = [0.02, 0.1, 0.5, 2.5][(next() * 4.0) as usize & 3];
        for _ in 0..3 {
            let weight = if w { 2.5 * next() - 0.3 } else { 1.0 };
            let (x, y, z) = (cx + size * (next() - 0.5), cy + size * (next() - 0.5), next());
            out.push([x * weight, y * weight, z * weight, weight, next(), next(), next(), next()]);
        }
    }
    out
}

fn code(image: &Image, x: u32, y: u32) -> u32 {
    image.color.texel(x, y, 0)[0]
}

/// Asserts that two pictures are equal.
fn same(name: &str, what: &str, a: &Image, b: &Image) {
    assert!(a.color.to_bytes() == b.color.to_bytes(), "{name}: colours differ {what}");
    let depth = |i: &Image| i.depth.as_ref().map(TileSurface::to_bytes);
    assert!(depth(a) == depth(b), "{name}: depths differ {what}");
}
