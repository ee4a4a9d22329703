//! Small pipelines drawn whole and compared: with expected pixels, and one way of drawing with another.

use std::sync::Arc;

use super::*;
use crate::gfx::format::Format;
use crate::gfx::state::*;
use crate::num::ShaderId;
use crate::render::surface::{Shape, TileSurface};
use crate::shader::{Module, Source};
use crate::trace::command::{RenderPipelineDesc, Stage};
use crate::work::{self, Event, Outcome, QUAD_SHADED, Segment};

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
}

struct Image {
    color: TileSurface,
    depth: Option<TileSurface>,
    drawn: Drawn,
    draws: Vec<Arc<work::Draw>>,
    segments: Vec<Arc<Segment>>,
}

#[derive(Clone, Copy)]
struct How {
    threads: usize,
    skips: Skips,
    record: bool,
    key: RenderKey,
    count: bool,
}

const USUAL: How = How {
    threads: 2,
    skips: Skips { hierarchical_z: true, tile_reject: true, overwritten: true },
    record: false,
    key: RenderKey { early_z: true, shade: work::Shade::Visible },
    count: false,
};

fn stage(entry: &str) -> Stage {
    Stage { shader: ShaderId(0), entry: Some(entry.into()), constants: Vec::new(), zero_workgroup_memory: true }
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
        bias: 0,
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
                targets: vec![Some(ColorTarget { format: Format::Rgba8Unorm, blend: None, write_mask: 15 })],
            },
            scissor: None,
            viewport: None,
            reference: 0,
            draws: std::iter::once(0..n).collect(),
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

    fn draw_here(&self, how: How) -> Result<Image, String> {
        let module = Module::new("scene", Source::Wgsl(&self.source)).unwrap_or_else(|e| panic!("{e}"));
        let pipeline = RenderPipeline::new(&self.state, &module, Some(&module), "scene")?;
        let bytes: Vec<u8> = self.vertices.iter().flatten().flat_map(|v| v.to_le_bytes()).collect();
        let buffers = [Some(range_of(&bytes))];
        let index = self.indices.as_ref().map(|indices| {
            let bytes: Vec<u8> = indices.iter().flat_map(|i| i.to_le_bytes()).collect();
            IndexRange { range: range_of(&bytes), format: IndexFormat::Uint32 }
        });
        let (width, height) = self.extent;
        let samples = self.state.multisample.count;
        let mut color = TileSurface::new(Shape { format: self.format, width, height, samples });
        color.clear(self.color_words);
        let depth = self.depth.map(|(format, clear)| {
            let mut depth = TileSurface::new(Shape { format, width, height, samples });
            let code = crate::gfx::texel::encode(format, [clear.to_bits(), 0, 0, 0]);
            depth.clear(bytemuck::cast(code));
            depth
        });
        let mut pass = RenderPass::begin(width, height, samples, vec![Some((color, self.format))], depth);
        let (mut drawn, mut draws, mut segments) = (Drawn::default(), Vec::new(), Vec::new());
        for range in &self.draws {
            let call = DrawCall {
                number: 0,
                pipeline: &pipeline,
                vertex_buffers: &buffers,
                index: index.as_ref(),
                range: Range {
                    first: range.start,
                    count: range.end - range.start,
                    instances: self.instances,
                    ..Range::default()
                },
                vertex_resources: Resources::default(),
                fragment_resources: Some(Resources::default()),
                viewport: self.viewport.unwrap_or(Viewport {
                    x: 0.0,
                    y: 0.0,
                    width: width as f32,
                    height: height as f32,
                    min_depth: 0.0,
                    max_depth: 1.0,
                }),
                scissor: self.scissor.unwrap_or(Rect { x: 0, y: 0, width, height }),
                blend_constant: [0.0; 4],
                stencil_reference: self.reference,
                count_samples: how.count,
                key: how.key,
                record: how.record,
                skips: how.skips,
            };
            let one = pass.draw(&call, &mut |event| match event {
                Event::Draw(draw) => draws.push(draw),
                Event::Segment(segment) => segments.push(segment),
                other => panic!("{other:?}"),
            })?;
            drawn.samples_passed += one.samples_passed;
            drawn.funnel += one.funnel;
        }
        let ended = pass.end();
        let color = ended.color.into_iter().next().flatten().unwrap();
        Ok(Image { color, depth: ended.depth, drawn, draws, segments })
    }
}

fn range_of(bytes: &[u8]) -> BufferRange {
    let words = Words::new(bytes.len() as u64);
    words.write(0, bytes);
    BufferRange { size: words.len(), words: Arc::new(words), offset: 0, address: 1 << 20 }
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
    let mut state = seed;
    let mut next = || {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        (state >> 8) as f32 / (1 << 24) as f32
    };
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

#[test]
fn a_triangle_is_where_it_should_be() {
    let mut scene = Scene::new(vec![v(-1.0, 1.0, 0.0, RED), v(1.0, 1.0, 0.0, RED), v(-1.0, -1.0, 0.0, RED)]);
    scene.extent = (70, 70);
    let image = scene.draw();
    for y in 0..70 {
        for x in 0..70 {
            // The diagonal's centres are on an edge that is neither top nor left.
            let expected = if x + y < 69 { 0xff00_00ff } else { 0 };
            assert_eq!(code(&image, x, y), expected, "{x} {y}");
        }
    }
    assert_eq!(image.drawn.funnel.fragments_written, 69 * 70 / 2);
    assert_eq!(image.drawn.funnel.vertices_shaded, 3);
}

#[test]
fn two_triangles_fill_a_rectangle_once() {
    let mut scene = Scene::new(rectangle(ALL, 0.5, [0.2, 0.2, 0.2, 0.2]));
    let one = BlendComponent { src: BlendFactor::One, dst: BlendFactor::One, op: BlendOp::Add };
    scene.target().blend = Some(Blend { color: one, alpha: one });
    let image = scene.draw();
    for y in 0..90 {
        for x in 0..100 {
            assert_eq!(code(&image, x, y), 0x3333_3333);
        }
    }
    assert_eq!(image.drawn.funnel.fragments_covered, 9000);
}

#[test]
fn scissor_and_viewport_bound_what_is_drawn() {
    let mut scene = Scene::new(rectangle(ALL, 0.5, RED));
    scene.scissor = Some(Rect { x: 10, y: 20, width: 30, height: 5 });
    let inside = |image: &Image, x0, y0, x1, y1| {
        for y in 0..90 {
            for x in 0..100 {
                let expected = (x0..x1).contains(&x) && (y0..y1).contains(&y);
                assert_eq!(code(image, x, y) != 0, expected, "{x} {y}");
            }
        }
    };
    inside(&scene.draw(), 10, 20, 40, 25);
    scene.scissor = None;
    scene.viewport = Some(Viewport { x: 50.0, y: 40.0, width: 20.0, height: 30.0, min_depth: 0.0, max_depth: 1.0 });
    inside(&scene.draw(), 50, 40, 70, 70);
}

#[test]
fn depth_decides_and_is_written() {
    for format in [
        Format::Depth16Unorm,
        Format::Depth24Plus,
        Format::Depth24PlusStencil8,
        Format::Depth32Float,
        Format::Depth32FloatStencil8,
    ] {
        for samples in [1, 4] {
            let mut vertices = rectangle(ALL, 0.5, RED);
            vertices.extend(rectangle([-1.0, -1.0, 0.0, 1.0], 0.25, GREEN));
            vertices.extend(rectangle([0.0, -1.0, 1.0, 1.0], 0.75, GREEN));
            let scene = Scene::new(vertices).with_depth(format, Compare::Less, true, 1.0).samples(samples);
            let image = scene.draw();
            assert_eq!(code(&image, 10, 10), 0xff00_ff00, "{format:?}");
            assert_eq!(code(&image, 60, 10), 0xff00_00ff, "{format:?}");
            let depth = image.depth.unwrap();
            let near = bytemuck::cast::<_, [u32; 4]>(crate::gfx::texel::encode(format, [0.25_f32.to_bits(), 0, 0, 0]));
            assert_eq!(depth.texel(10, 10, samples - 1), near, "{format:?}");
        }
    }
}

#[test]
fn stencil_counts_layers() {
    for format in [Format::Stencil8, Format::Depth24PlusStencil8, Format::Depth32FloatStencil8] {
        for samples in [1, 4] {
            let mut vertices = rectangle(ALL, 0.5, RED);
            vertices.extend(rectangle([-1.0, -1.0, 0.0, 1.0], 0.5, GREEN));
            let mut scene = Scene::new(vertices).with_depth(format, Compare::Always, false, 0.0).samples(samples);
            let face = StencilFace { compare: Compare::Always, pass_op: StencilOp::IncrementClamp, ..StencilFace::default() };
            let state = scene.state.depth_stencil.as_mut().unwrap();
            (state.stencil_front, state.stencil_back) = (face, face);
            let image = scene.draw();
            let stencil = |x| {
                let words = image.depth.as_ref().unwrap().texel(x, 5, samples - 1);
                match format {
                    Format::Stencil8 => words[0],
                    Format::Depth24PlusStencil8 => words[0] >> 24,
                    _ => words[1],
                }
            };
            assert_eq!((stencil(10), stencil(90)), (2, 1), "{format:?}");
        }
    }
}

#[test]
fn blending_follows_api_order() {
    let half = [1.0, 1.0, 1.0, 0.5];
    let mut vertices = rectangle(ALL, 0.5, RED);
    vertices.extend(rectangle([-0.5, -0.5, 0.5, 0.5], 0.5, half));
    vertices.extend(rectangle([-0.5, -0.5, 0.0, 0.5], 0.5, [0.0, 0.0, 1.0, 0.5]));
    let mut scene = Scene::new(vertices);
    let over = BlendComponent { src: BlendFactor::SrcAlpha, dst: BlendFactor::OneMinusSrcAlpha, op: BlendOp::Add };
    scene.target().blend = Some(Blend { color: over, alpha: over });
    let image = scene.draw();
    assert_eq!(code(&image, 2, 2) & 0xff_ffff, 0x0000ff);
    assert_eq!(code(&image, 60, 45) & 0xff_ffff, 0x8080ff);
    // Alpha 0.5 is code 128 of 255: of the red 255 there stays 255 * 127 / 255 = 127.
    assert_eq!(code(&image, 40, 45) & 0xff_ffff, 0xc0407f);
}

/// Scenes that exercise different paths.
fn variety() -> Vec<(&'static str, Scene)> {
    let mut out = Vec::new();
    let base = || Scene::new(soup(600, 1, true)).with_depth(Format::Depth32Float, Compare::Less, true, 1.0);
    out.push(("depth", base()));
    out.push(("no depth", Scene::new(soup(600, 2, true))));
    out.push((
        "flat quads",
        Scene::new(soup(300, 3, false)).with_depth(Format::Depth24PlusStencil8, Compare::LessEqual, true, 1.0),
    ));
    out.push(("reversed", Scene::new(soup(300, 4, false)).with_depth(Format::Depth16Unorm, Compare::Greater, true, 0.0)));
    out.push(("equal", Scene::new(soup(300, 4, false)).with_depth(Format::Depth16Unorm, Compare::NotEqual, true, 0.0)));
    out.push(("samples", base().samples(4)));
    let mut sprites = Scene::new(soup(500, 5, true));
    let over = BlendComponent { src: BlendFactor::SrcAlpha, dst: BlendFactor::OneMinusSrcAlpha, op: BlendOp::Add };
    sprites.target().blend = Some(Blend { color: over, alpha: over });
    out.push(("blended", sprites.clone()));
    out.push(("blended samples", sprites.samples(4)));
    let mut discards = base();
    discards.source = PLAIN.replace("{ return v.c; }", "{ if v.c.x > 0.6 { discard; } return v.c; }");
    out.push(("discard", discards));
    let mut deep = base().samples(4);
    deep.source = "
        struct V { @builtin(position) p: vec4<f32>, @location(0) c: vec4<f32> }
        struct F { @location(0) c: vec4<f32>, @builtin(frag_depth) z: f32, @builtin(sample_mask) m: u32 }
        @vertex fn vs(@location(0) p: vec4<f32>, @location(1) c: vec4<f32>) -> V { return V(p, c); }
        @fragment fn fs(v: V) -> F { return F(v.c, v.c.y, select(5u, 15u, v.c.z > 0.5)); }
    "
    .into();
    out.push(("frag depth and mask", deep));
    let mut sampled = base().samples(4);
    sampled.source = "
        struct V { @builtin(position) p: vec4<f32>, @location(0) @interpolate(perspective, sample) c: vec4<f32> }
        @vertex fn vs(@location(0) p: vec4<f32>, @location(1) c: vec4<f32>) -> V { return V(p, c); }
        @fragment fn fs(v: V, @builtin(sample_index) s: u32) -> @location(0) vec4<f32> { return v.c * f32(s + 1u) * 0.25; }
    "
    .into();
    out.push(("per sample", sampled));
    let mut coverage = base().samples(4);
    coverage.state.multisample.alpha_to_coverage = true;
    coverage.state.multisample.mask = 0b1011;
    out.push(("alpha to coverage", coverage));
    let mut lines = Scene::new(soup(300, 6, true)).with_depth(Format::Depth32Float, Compare::Less, true, 1.0);
    lines.state.primitive.topology = Topology::LineStrip;
    out.push(("lines", lines.clone()));
    out.push(("lines samples", lines.clone().samples(4)));
    lines.state.primitive.topology = Topology::PointList;
    out.push(("points", lines));
    let mut edges = base();
    edges.state.primitive.polygon_mode = PolygonMode::Line;
    out.push(("edges", edges));
    let mut strip = base();
    strip.state.primitive.topology = Topology::TriangleStrip;
    strip.state.primitive.cull_mode = CullMode::Back;
    out.push(("strip", strip.clone()));
    strip.state.primitive.topology = Topology::TriangleFan;
    strip.state.primitive.cull_mode = CullMode::None;
    out.push(("fan", strip));
    let mut indexed = base();
    indexed.indices = Some((0..1800).map(|i| (i * 7) % 1800).collect());
    indexed.instances = 3;
    out.push(("indexed instances", indexed));
    let mut clipped = base();
    clipped.source = PLAIN
        .replace("struct V {", "enable clip_distances;\nstruct V { @builtin(clip_distances) d: array<f32, 2>,")
        .replace("return V(p, c)", "return V(array<f32, 2>(p.x + 0.3, 0.5 - p.y * c.x), p, c)")
        .replace("@fragment fn fs(v: V)", "@fragment fn fs(@location(0) c: vec4<f32>)")
        .replace("return v.c", "return c");
    out.push(("clip distances", clipped));
    let mut unclipped = base();
    unclipped.state.primitive.unclipped_depth = true;
    out.push(("unclipped depth", unclipped));
    let mut only_depth = base();
    only_depth.state.fragment = None;
    only_depth.state.targets.clear();
    out.push(("depth only", only_depth));
    let mut stencil = Scene::new(soup(300, 8, true)).with_depth(Format::Depth24PlusStencil8, Compare::Less, true, 1.0);
    let face = StencilFace {
        compare: Compare::NotEqual,
        fail_op: StencilOp::IncrementWrap,
        depth_fail_op: StencilOp::Invert,
        pass_op: StencilOp::Replace,
    };
    let state = stencil.state.depth_stencil.as_mut().unwrap();
    (state.stencil_front, state.stencil_back) = (face, StencilFace { compare: Compare::Less, ..face });
    stencil.reference = 3;
    out.push(("stencil", stencil));
    let mut float = Scene::new(soup(300, 9, true));
    float.format = Format::Rgba16Float;
    *float.target() = ColorTarget { format: Format::Rgba16Float, blend: None, write_mask: 0b0101 };
    out.push(("half float, masked", float));
    let mut integer = Scene::new(soup(300, 10, true));
    integer.format = Format::Rg32Uint;
    *integer.target() = ColorTarget { format: Format::Rg32Uint, blend: None, write_mask: 15 };
    integer.source = PLAIN
        .replace("-> @location(0) vec4<f32>", "-> @location(0) vec2<u32>")
        .replace("return v.c;", "return vec2<u32>(bitcast<u32>(v.c.x), u32(v.p.x));");
    out.push(("integer", integer));
    out
}

fn same(name: &str, what: &str, a: &Image, b: &Image) {
    assert!(a.color.to_bytes() == b.color.to_bytes(), "{name}: colours differ {what}");
    let depth = |i: &Image| i.depth.as_ref().map(TileSurface::to_bytes);
    assert!(depth(a) == depth(b), "{name}: depths differ {what}");
}

#[test]
fn nothing_depends_on_the_number_of_threads() {
    for (name, scene) in variety() {
        let one = scene.draw_as(How { threads: 1, ..USUAL });
        let four = scene.draw_as(How { threads: 4, ..USUAL });
        same(name, "with the number of threads", &one, &four);
        assert_eq!(one.drawn, four.drawn, "{name}");
        assert!(one.drawn.funnel.fragments_written > 0, "{name}: {:?}", one.drawn.funnel);
        let record = |threads| scene.draw_as(How { threads, record: true, ..USUAL });
        let (one, four) = (record(1), record(4));
        for (a, b) in one.segments.iter().zip(&four.segments) {
            assert_eq!(format!("{a:?}"), format!("{b:?}"), "{name}");
        }
    }
}

#[test]
fn skips_and_recording_change_no_pixel() {
    for (name, scene) in variety() {
        let usual = scene.draw();
        let all = scene.draw_as(How { skips: Skips::NONE, ..USUAL });
        same(name, "with skips", &usual, &all);
        let recorded = scene.draw_as(How { record: true, ..USUAL });
        same(name, "when recorded", &usual, &recorded);
        let covered = RenderKey { early_z: true, shade: work::Shade::Covered };
        let covered = scene.draw_as(How { record: true, key: covered, ..USUAL });
        same(name, "when everything covered is shaded", &usual, &covered);
        let late = RenderKey { early_z: false, shade: work::Shade::Visible };
        same(name, "with late tests", &usual, &scene.draw_as(How { key: late, ..USUAL }));
        same(name, "with late tests, recorded", &usual, &scene.draw_as(How { key: late, record: true, ..USUAL }));
        let counts = |how| scene.draw_as(How { count: true, ..how }).drawn.samples_passed;
        let passed = counts(USUAL);
        assert_eq!(passed, counts(How { skips: Skips::NONE, ..USUAL }), "{name}");
        assert_eq!(passed, counts(How { key: late, ..USUAL }), "{name}");
        assert_eq!(passed, counts(How { record: true, ..USUAL }), "{name}");
    }
}

#[test]
fn the_funnel_adds_up() {
    for (name, scene) in variety() {
        let f = scene.draw_as(How { skips: Skips::NONE, ..USUAL }).drawn.funnel;
        let thrown = f.culled_degenerate + f.culled_backface + f.culled_frustum + f.culled_scissor + f.culled_no_sample;
        assert!(thrown < f.primitives_in, "{name}: {f:?}");
        assert!(f.quads_early_culled <= f.quads_rasterized, "{name}: {f:?}");
        assert!(f.fragments_written + f.fragments_discarded + f.fragments_late_failed <= f.fragments_covered * 4, "{name}");
        let recorded = scene.draw_as(How { record: true, ..USUAL });
        let mut sum = Funnel::default();
        recorded.segments.iter().for_each(|s| sum += s.funnel);
        let ended = |o| recorded.segments.iter().flat_map(|s| &s.primitives).filter(|p| p.outcome == o).count() as u64;
        assert_eq!(sum.primitives_in, recorded.segments.iter().map(|s| s.primitives.len() as u64).sum::<u64>(), "{name}");
        assert_eq!(sum.culled_degenerate, ended(Outcome::Degenerate), "{name}");
        assert_eq!(sum.culled_backface, ended(Outcome::Backface), "{name}");
        assert_eq!(sum.culled_frustum, ended(Outcome::Frustum), "{name}");
        assert_eq!(sum.culled_scissor, ended(Outcome::Scissor), "{name}");
        assert_eq!(sum.culled_no_sample, ended(Outcome::NoSample), "{name}");
        assert_eq!(f.primitives_in - thrown, ended(Outcome::Drawn), "{name}");
        assert_eq!(sum.vertices_in, f.vertices_in, "{name}");
        assert_eq!(sum.vertices_shaded, f.vertices_shaded, "{name}");
        let quads = recorded.segments.iter().flat_map(|s| &s.tiles).map(|t| t.quads.len()).sum::<usize>() as u64;
        assert!(quads >= sum.quads_rasterized && sum.fragments_covered == f.fragments_covered, "{name}");
    }
}

#[test]
fn recorded_work_is_consistent() {
    for (name, scene) in variety() {
        let image = scene.draw_as(How { record: true, ..USUAL });
        let draw = &image.draws[0];
        for s in &image.segments {
            let mut visits = 0;
            for (i, t) in s.triangles.iter().enumerate() {
                assert_eq!(t.first_visit, visits, "{name}");
                visits += t.visits;
                let p = &s.primitives[t.primitive as usize];
                let own = p.first_triangle as usize..p.first_triangle as usize + usize::from(p.triangles);
                assert!(own.contains(&i), "{name}");
                let here = &s.visits[t.first_visit as usize..visits as usize];
                assert!(here.is_sorted_by_key(|v| v.tile), "{name}");
                for v in here {
                    let tile = &s.tiles[v.tile as usize];
                    for b in &tile.blocks[v.first_block as usize..(v.first_block + v.blocks) as usize] {
                        assert_eq!((b.x / 8, b.y / 8), (tile.x, tile.y), "{name}");
                        assert!((t.bounds[0]..t.bounds[2]).contains(&b.x) && (t.bounds[1]..t.bounds[3]).contains(&b.y));
                        assert!(b.quads > 0);
                    }
                }
            }
            assert_eq!(visits as usize, s.visits.len(), "{name}");
            let (mut entries, mut last) = (0, 0);
            for p in &s.primitives {
                assert!(p.vertices.iter().all(|v| (*v as usize) < s.vertices.len()), "{name}");
                assert!(p.stream_end >= last && p.stream_end as usize <= s.stream.len(), "{name}");
                last = p.stream_end;
                assert!(p.vertices.iter().all(|v| s.stream[..last as usize].contains(v)), "{name}");
                entries += usize::from(p.triangles);
            }
            assert_eq!(entries, s.triangles.len(), "{name}");
            for v in &s.vertices {
                assert!((v.cost as usize) < s.costs.costs.len(), "{name}");
            }
            for tile in &s.tiles {
                let mut quad = 0;
                for b in &tile.blocks {
                    assert_eq!(b.first_quad, quad, "{name}");
                    quad += u32::from(b.quads);
                }
                assert_eq!(quad as usize, tile.quads.len(), "{name}");
                for q in tile.quads.iter().filter(|q| q.flags & QUAD_SHADED != 0) {
                    assert_eq!(q.kept & !q.coverage, 0, "{name}");
                    assert!(q.payload as usize + usize::from(draw.payload_words) <= tile.payload.len(), "{name}");
                    let cost = &tile.costs[q.cost];
                    assert!(q.first_request as usize + cost.requests() <= tile.requests.len(), "{name}");
                }
            }
        }
    }
}

#[test]
fn large_draws_come_in_several_segments_with_the_same_image() {
    let scene = Scene::new(soup(70_000, 11, false)).with_depth(Format::Depth32Float, Compare::Less, true, 1.0);
    let plain = scene.draw();
    let recorded = scene.draw_as(How { record: true, ..USUAL });
    assert!(recorded.segments.len() > 1);
    same("many", "in segments", &plain, &recorded);
    assert_eq!(plain.drawn.funnel.vertices_in, 210_000);
    let mut strip = Scene::new(soup(30_000, 12, false));
    strip.state.primitive.topology = Topology::TriangleStrip;
    let (plain, recorded) = (strip.draw(), strip.draw_as(How { record: true, ..USUAL }));
    assert!(recorded.segments.len() > 1);
    same("strip", "in segments", &plain, &recorded);
    assert_eq!(recorded.drawn.funnel.vertices_in, 90_000);
    assert_eq!(recorded.drawn.funnel.primitives_in, 89_998);
}

#[test]
fn flat_varyings_come_from_the_provoking_vertex() {
    let colors = [[1.0, 0.0, 0.0, 1.0], [0.0, 1.0, 0.0, 1.0], [0.0, 0.0, 1.0, 1.0]];
    let corners = [[-1.0, -1.0], [3.0, -1.0], [-1.0, 3.0]];
    let mut scene = Scene::new((0..3).map(|i| v(corners[i][0], corners[i][1], 0.5, colors[i])).collect());
    scene.source = PLAIN
        .replace("@location(0) c", "@location(0) @interpolate(flat) c")
        .replace("fn vs(@location(0) @interpolate(flat) c", "fn vs(@location(0) c");
    assert_eq!(code(&scene.draw(), 50, 50), 0xff00_00ff);
    scene.state.primitive.provoking_last = true;
    assert_eq!(code(&scene.draw(), 50, 50), 0xffff_0000);
}

#[test]
fn built_in_values_are_right() {
    let mut vertices = rectangle([-1.0, -1.0, 0.0, 1.0], 0.5, RED);
    // The second rectangle faces the other way.
    let mut other = rectangle([0.0, -1.0, 1.0, 1.0], 0.25, RED);
    other.chunks_exact_mut(3).for_each(|t| t.swap(0, 1));
    vertices.extend(other);
    let mut scene = Scene::new(vertices);
    scene.instances = 2;
    scene.format = Format::Rgba32Float;
    scene.target().format = Format::Rgba32Float;
    scene.source = "
        struct V { @builtin(position) p: vec4<f32>, @location(0) @interpolate(flat) i: u32 }
        @vertex fn vs(@location(0) p: vec4<f32>, @builtin(vertex_index) v: u32, @builtin(instance_index) i: u32) -> V {
            return V(p, v * 10u + i);
        }
        @fragment fn fs(v: V, @builtin(front_facing) f: bool) -> @location(0) vec4<f32> {
            return vec4<f32>(v.p.x, v.p.z, f32(v.i), select(0.0, 1.0, f) + v.p.w);
        }
    "
    .into();
    let image = scene.draw();
    let value = |x, y| image.color.texel(x, y, 0).map(f32::from_bits);
    assert_eq!(value(3, 85)[..3], [3.5, 0.5, 1.0]);
    assert_eq!(value(97, 85)[1], 0.25);
    let (left, right) = (value(3, 85)[3], value(97, 85)[3]);
    assert_eq!((left, right), (2.0, 1.0), "front faces are counter-clockwise");
}

#[test]
fn primitives_are_numbered_in_their_instance() {
    // Strips and lists, cut into segments in the middle, in two instances that draw side by side.
    for topology in [Topology::TriangleList, Topology::TriangleStrip] {
        let columns = 70_000_u32;
        let place = |i: u32| -1.0 + 2.0 * (i % 64) as f32 / 64.0;
        let mut vertices = Vec::new();
        if topology == Topology::TriangleList {
            for i in 0..columns {
                let x = place(i);
                vertices.extend([v(x, -1.0, 0.5, RED), v(x + 0.1, -1.0, 0.5, RED), v(x, 1.0, 0.5, RED)]);
            }
        } else {
            vertices.extend((0..columns + 2).map(|i| v(place(i / 2), if i % 2 == 0 { -1.0 } else { 1.0 }, 0.5, RED)));
        }
        let mut scene = Scene::new(vertices);
        scene.state.primitive.topology = topology;
        scene.instances = 2;
        scene.extent = (64, 16);
        scene.format = Format::R32Uint;
        *scene.target() = ColorTarget { format: Format::R32Uint, blend: None, write_mask: 15 };
        scene.source = "
            enable primitive_index;
            @vertex fn vs(@location(0) p: vec4<f32>, @builtin(instance_index) i: u32) -> @builtin(position) vec4<f32> {
                return vec4<f32>(p.x, p.y * 0.5 + f32(i) - 0.5, p.z, 1.0);
            }
            @fragment fn fs(@builtin(primitive_index) i: u32) -> @location(0) u32 { return i; }
        "
        .into();
        let image = scene.draw();
        // (The strip jumps back behind its last column but one.)
        for x in 0..62 {
            let (upper, lower) = (code(&image, x, 4), code(&image, x, 12));
            assert_eq!(upper, lower, "{topology:?} {x}: both instances count from 0");
            assert!(lower > columns - 300 && lower < columns, "{topology:?} {x}: {lower}");
        }
        let recorded = scene.draw_as(How { record: true, ..USUAL });
        same("numbers", "when recorded", &image, &recorded);
    }
}

#[test]
fn many_small_instances_are_drawn_like_few_large_ones() {
    let mut scene = Scene::new(rectangle([-0.01, -0.01, 0.01, 0.01], 0.5, RED));
    scene.instances = 5_000;
    scene.source = "
        struct V { @builtin(position) p: vec4<f32>, @location(0) @interpolate(flat) c: vec4<f32> }
        @vertex fn vs(@location(0) p: vec4<f32>, @builtin(instance_index) i: u32) -> V {
            let at = vec2<f32>(f32(i % 100u) + 0.5, f32(i / 100u) + 0.5) / 50.0 - vec2<f32>(1.0);
            return V(vec4<f32>(p.xy + at, p.zw), vec4<f32>(f32(i % 256u) / 255.0, f32(i / 256u) / 255.0, 0.0, 1.0));
        }
        @fragment fn fs(v: V) -> @location(0) vec4<f32> { return v.c; }
    "
    .into();
    scene.extent = (100, 100);
    let image = scene.draw();
    for i in 0..5_000 {
        let (x, y) = (i % 100, 99 - i / 100);
        assert_eq!(code(&image, x, y), 0xff00_0000 | i / 256 << 8 | i % 256, "{i}");
    }
    assert_eq!(image.drawn.funnel.primitives_in, 10_000);
    assert_eq!(image.drawn.funnel.vertices_shaded, 30_000);
    same("instances", "when recorded", &image, &scene.draw_as(How { record: true, ..USUAL }));
}

#[test]
fn clip_distances_cut() {
    let mut scene = Scene::new(rectangle(ALL, 0.5, RED));
    scene.source = "
        enable clip_distances;
        struct V { @builtin(position) p: vec4<f32>, @builtin(clip_distances) d: array<f32, 1> }
        @vertex fn vs(@location(0) p: vec4<f32>) -> V { return V(p, array<f32, 1>(p.x)); }
        @fragment fn fs() -> @location(0) vec4<f32> { return vec4<f32>(1.0); }
    "
    .into();
    let image = scene.draw();
    for x in 0..100 {
        assert_eq!(code(&image, x, 33) != 0, x >= 50, "{x}");
    }
}

#[test]
fn resolving_takes_the_mean() {
    let mut scene = Scene::new(rectangle([-1.0, -1.0, -0.005, 1.0], 0.5, [1.0; 4])).samples(4);
    scene.extent = (100, 10);
    let image = scene.draw();
    let resolved = image.color.resolve(Format::Rgba8Unorm);
    let value = |x| resolved.texel(x, 5, 0)[0];
    assert_eq!(value(48), 0xffff_ffff);
    // The edge is at 49.75: the sample at 0.875 is outside.
    assert_eq!(value(49), 0xbfbf_bfbf);
    assert_eq!(value(50), 0);
}

#[test]
fn mistakes_are_named() {
    let fail = |scene: &Scene| scene.draw_here(USUAL).map(drop).unwrap_err();
    let mut scene = Scene::new(rectangle(ALL, 0.5, RED));
    scene.state.buffers[0].as_mut().unwrap().attributes.pop();
    assert!(fail(&scene).contains("no vertex buffer gives @location(1)"), "{}", fail(&scene));
    let mut scene = Scene::new(rectangle(ALL, 0.5, RED));
    scene.format = Format::Bgra8Unorm;
    assert!(fail(&scene).contains("target 0 is rgba8unorm in a pass with bgra8unorm"), "{}", fail(&scene));
    let mut scene = Scene::new(rectangle(ALL, 0.5, RED));
    scene.target().format = Format::Rgba8Uint;
    assert!(fail(&scene).contains("target 0 is rgba8uint and the fragment stage writes Float"), "{}", fail(&scene));
    let mut scene = Scene::new(rectangle(ALL, 0.5, RED));
    scene.source = PLAIN.replace("fs(v: V)", "fs(v: V, @location(3) x: f32)");
    assert!(fail(&scene).contains("reads @location(3)"), "{}", fail(&scene));
}
