//! Traces of microbenchmarks: kernels of compute shaders, layers that cover a target, grids of triangles.

use crate::scenes::kit::{COVER, Draw, Kit, Pass, Target};
use gfx::format::Format;
use gfx::state::*;
use num::Random;
use trace::Trace;
use trace::command::BoundResource;
use trace::record;

/// A buffer of a kernel.
#[derive(Clone, Debug)]
pub(super) enum Data {
    /// Zeros, in bytes.
    Zeroed(u64),
    /// Words.
    Words(Vec<u32>),
}

impl Data {
    /// Its buffer, bound whole.
    fn bound(&self, kit: &mut Kit) -> BoundResource {
        record::whole(match self {
            Data::Zeroed(bytes) => kit.card.create_buffer("zeroed", *bytes),
            Data::Words(words) => {
                let bytes: Vec<u8> = words.iter().flat_map(|word| word.to_le_bytes()).collect();
                kit.card.create_buffer_init("words", bytes)
            }
        })
    }
}

/// A dispatch of workgroups; the buffers are the bindings of group 0 in order.
pub(super) fn dispatch(source: &str, buffers: &[Data], groups: u32) -> Trace {
    let mut kit = Kit::new("kernel");
    let resources: Vec<_> = buffers.iter().map(|data| data.bound(&mut kit)).collect();
    kit.compute(source, resources, [groups, 1, 1]);
    kit.finish()
}

/// A ring of words that holds the index of the next at every `stride` bytes of a buffer, in order or in a random order.
pub(super) fn ring(bytes: u32, stride: u32, random: bool) -> Data {
    let step = stride / 4;
    let mut order: Vec<u32> = (0..bytes / stride).collect();
    if random {
        // The first stays: the chase begins there.
        Random::new(1).shuffle(&mut order[1..]);
    }
    let mut words = vec![0; (bytes / 4) as usize];
    for (&from, &to) in order.iter().zip(order.iter().skip(1).chain(order.first())) {
        words[(from * step) as usize] = to * step;
    }
    Data::Words(words)
}

/// One invocation that follows a ring: each load has the answer of the one before as its index.
pub(super) fn chase(ring: &Data, steps: u32) -> Trace {
    let source = format!(
        "@group(0) @binding(0) var<storage, read> a: array<u32>;
         @group(0) @binding(1) var<storage, read_write> out: array<u32>;
         @compute @workgroup_size(1) fn main(@builtin(global_invocation_id) id: vec3u) {{
             var p = id.x;
             {} out[id.x] = p;
         }}",
        "p = a[p];\n".repeat(steps as usize)
    );
    dispatch(&source, &[ring.clone(), Data::Zeroed(256)], 1)
}

/// Chains of statements, each of which needs the result of the one before in its chain.
#[derive(Clone, Copy, Debug)]
pub(super) struct Chains<'a> {
    /// Type of the values.
    pub of: &'a str,
    /// The statement, in which `X` is the chain's value and `y` differs from invocation to invocation.
    pub step: &'a str,
    /// Chains of an invocation.
    pub chains: u32,
    /// Further values that are needed at the end.
    pub held: u32,
    /// Invocations of a workgroup.
    pub width: u32,
    /// Workgroups.
    pub groups: u32,
}

/// One warp of 32 with one chain of single-precision values.
pub(super) const CHAIN: Chains<'static> =
    Chains { of: "f32", step: "X = fma(X, y, 1.5);", chains: 1, held: 0, width: 32, groups: 1 };

impl Chains<'_> {
    /// The kernel with `steps` steps.
    pub fn trace(&self, steps: u32) -> Trace {
        let Chains { of, step, chains, held, width, groups } = *self;
        let each = |of: &dyn Fn(u32) -> String| (0..chains).map(of).collect::<String>();
        let begin = each(&|n| format!("var x{n} = {of}(l) + {of}({});\n", n + 1));
        let steps = each(&|n| step.replace('X', &format!("x{n}")) + "\n").repeat(steps as usize);
        let sum = each(&|n| format!(" + x{n}"));
        let hold: String = (0..held).map(|n| format!("let z{n} = y * {of}({});\n", n + 2)).collect();
        let held: String = (0..held).map(|n| format!(" + z{n} * x0")).collect();
        let source = format!(
            "@group(0) @binding(0) var<storage, read_write> out: array<{of}>;
             @compute @workgroup_size({width}) fn main(@builtin(local_invocation_index) l: u32) {{
                 let y = {of}(l) / {of}(2) + {of}(1);
                 {begin}{hold}{steps}
                 if ({of}(0){sum}{held} == {of}(12345)) {{ out[l] = {of}(1); }}
             }}"
        );
        dispatch(&source, &[Data::Zeroed(4096)], groups)
    }
}

/// Layers that cover a target.
#[derive(Clone, Debug)]
pub(super) struct Layers {
    /// Edge of the square target, in pixels.
    pub edge: u32,
    /// Formats of the colour targets; none: depth only.
    pub formats: Vec<Format>,
    /// Samples of a pixel.
    pub samples: u32,
    /// Body of the fragment stage, which gets `at: vec4f` and returns `Out`, or a `vec4f` for one target.
    pub fragment: String,
    /// Blending of every target.
    pub blend: Option<Blend>,
    /// Format of the depth buffer and the test against it, which writes.
    pub depth: Option<(Format, Compare)>,
    /// Whether the first target is resolved at the end of the pass.
    pub resolve: bool,
    /// Textures of group 0 by format, edge and levels, each with a sampler behind it.
    pub textures: Vec<(Format, u32, u32)>,
    /// The sampler.
    pub sampler: SamplerDesc,
}

impl Layers {
    /// Opaque layers of one colour.
    pub fn plain(edge: u32, format: Format) -> Layers {
        Layers {
            edge,
            formats: vec![format],
            samples: 1,
            fragment: "return vec4f(0.25, 0.5, 0.75, 0.5);".into(),
            blend: None,
            depth: None,
            resolve: false,
            textures: Vec::new(),
            sampler: SamplerDesc::default(),
        }
    }

    /// With a fragment stage.
    pub fn shaded(self, fragment: impl Into<String>) -> Layers {
        Layers { fragment: fragment.into(), ..self }
    }

    /// Blended.
    pub fn blended(self, blend: Blend) -> Layers {
        Layers { blend: Some(blend), ..self }
    }

    /// The shader.
    fn source(&self) -> String {
        let mut source = COVER.to_owned();
        for (at, (format, ..)) in self.textures.iter().enumerate() {
            let kind = if format.has_depth() { "texture_depth_2d" } else { "texture_2d<f32>" };
            source += &format!(
                "@group(0) @binding({}) var t{at}: {kind};\n@group(0) @binding({}) var s{at}: sampler;\n",
                2 * at,
                2 * at + 1
            );
        }
        let out = match self.formats.len() {
            0 => return source,
            1 => "@location(0) vec4f".to_owned(),
            many => {
                let fields: String = (0..many).map(|n| format!("@location({n}) c{n}: vec4f, ")).collect();
                source += &format!("struct Out {{ {fields} }}\n");
                "Out".to_owned()
            }
        };
        // A fragment stage that knows its sample runs for each of them.
        let sample = if self.fragment.contains("sample)") { ", @builtin(sample_index) sample: u32" } else { "" };
        source + &format!("@fragment fn fs(@builtin(position) at: vec4f{sample}) -> {out} {{ {} }}", self.fragment)
    }

    /// One pass of `layers` layers.
    pub fn trace(&self, layers: u32) -> Trace {
        let mut kit = Kit::new("layers");
        let resources =
            self.textures.clone().into_iter().flat_map(|texture| self.texture(&mut kit, texture)).collect::<Vec<_>>();
        let target = |kit: &mut Kit, format| {
            kit.texture("target", record::texture_multisampled(self.edge, self.edge, self.samples, format))
        };
        let color = self.formats.iter().map(|&format| (target(&mut kit, format), Some([0.0; 4]))).collect();
        let resolve = self.resolve.then(|| kit.target("resolved", [self.edge; 2], self.formats[0]));
        let depth = self.depth.map(|(format, _)| (target(&mut kit, format), Some((1.0, 0))));
        let mut draw = Draw::list(self.source(), 0, Vec::new()).count(3).with(resources);
        draw.instances = layers;
        draw.blend = self.blend;
        draw.depth_only = self.formats.is_empty();
        if let Some((format, compare)) = self.depth {
            draw = draw.depth(format, compare);
        }
        kit.pass(&Pass { color, depth, resolve, ..Pass::default() }, &[draw]);
        kit.finish()
    }

    /// A texture of noise with its view and sampler.
    fn texture(&self, kit: &mut Kit, (format, edge, levels): (Format, u32, u32)) -> [BoundResource; 2] {
        let desc = record::texture_mipped(edge, edge, levels, format);
        let texture = kit.texture("texture", desc);
        if !format.has_depth() {
            let mut numbers = Random::new(1);
            for level in 0..levels {
                let blocks = ((edge >> level).max(1)).div_ceil(format.block_dim());
                let bytes = blocks * blocks * format.block_bytes();
                let noise: Vec<u8> = (0..bytes).map(|_| (numbers.bits() & 0x3f) as u8).collect();
                kit.card.write_level(texture.texture, level, "noise", &noise);
            }
        }
        [texture.bound(), kit.sampler(self.sampler)]
    }
}

/// A grid of cells of two triangles that fills a square target.
#[derive(Clone, Debug)]
pub(super) struct Grid {
    /// Cells along an edge.
    pub cells: u32,
    /// Edge of the target, in pixels.
    pub edge: u32,
    /// Which faces are thrown away.
    pub cull: CullMode,
    /// Size of the indices.
    pub indices: IndexFormat,
    /// Body of the fragment stage, which gets `at: vec4f` and returns a `vec4f`.
    pub fragment: String,
}

impl Grid {
    /// A grid all of whose triangles are drawn in one colour.
    pub fn plain(cells: u32, edge: u32) -> Grid {
        Grid {
            cells,
            edge,
            cull: CullMode::None,
            indices: IndexFormat::Uint16,
            fragment: "return vec4f(0.25, 0.5, 0.75, 0.5);".into(),
        }
    }

    /// Corners of a row of the grid.
    fn corners(&self) -> u32 {
        self.cells + 1
    }

    /// Three indices for each triangle, row by row in strips of 32 cells.
    fn list(&self) -> Vec<u32> {
        let (cells, corners) = (self.cells, self.corners());
        let mut list = Vec::with_capacity((6 * cells * cells) as usize);
        for strip in (0..cells).step_by(32) {
            for y in 0..cells {
                for x in strip..(strip + 32).min(cells) {
                    let [a, b, c, d] = [(0, 0), (1, 0), (0, 1), (1, 1)].map(|(dx, dy)| (y + dy) * corners + x + dx);
                    list.extend([a, b, c, b, d, c]);
                }
            }
        }
        list
    }

    /// One pass that draws the grid `draws` times.
    pub fn trace(&self, draws: u32) -> Trace {
        self.parts(draws, u32::MAX)
    }

    /// One pass of `draws` draws. Each draws at most `triangles` triangles of the grid, one part of it after the other.
    pub fn parts(&self, draws: u32, triangles: u32) -> Trace {
        let list = self.list();
        let most = list.len() as u32 / 3;
        let triangles = triangles.min(most);
        let places = most / triangles;
        let mesh = Mesh { positions: self.positions(), indices: list, format: self.indices };
        let draws: Vec<[u32; 2]> = (0..draws).map(|n| [n % places * triangles, triangles]).collect();
        mesh.trace(self.edge, self.cull, &self.fragment, &draws)
    }

    fn positions(&self) -> Vec<[f32; 2]> {
        let corners = self.corners();
        let at = |n: u32| n as f32 / self.cells as f32 * 2.0 - 1.0;
        (0..corners * corners).map(|n| [at(n % corners), -at(n / corners)]).collect()
    }
}

/// Indexed triangles.
#[derive(Clone, Debug)]
pub(super) struct Mesh {
    /// Positions in clip space.
    pub positions: Vec<[f32; 2]>,
    /// Three indices for each triangle.
    pub indices: Vec<u32>,
    /// Size of the indices.
    pub format: IndexFormat,
}

impl Mesh {
    /// One pass of draws, each of which has the first of its triangles and their number.
    pub fn trace(&self, edge: u32, cull: CullMode, fragment: &str, draws: &[[u32; 2]]) -> Trace {
        let mut kit = Kit::new("mesh");
        let target: Target = kit.target("target", [edge, edge], Format::Rgba8Unorm);
        let positions: Vec<f32> = self.positions.iter().flatten().copied().collect();
        let vertices = kit.floats("positions", &positions);
        let bytes: Vec<u8> = match self.format {
            IndexFormat::Uint16 => self.indices.iter().flat_map(|&index| (index as u16).to_le_bytes()).collect(),
            IndexFormat::Uint32 => self.indices.iter().flat_map(|index| index.to_le_bytes()).collect(),
        };
        let indices = kit.card.create_buffer_init("indices", bytes);
        let source = format!(
            "@vertex fn vs(@location(0) at: vec2f) -> @builtin(position) vec4f {{ return vec4f(at, 0.5, 1.0); }}
             @fragment fn fs(@builtin(position) at: vec4f) -> @location(0) vec4f {{ {fragment} }}"
        );
        let shader = kit.card.create_shader("program", &source);
        let mut desc = record::render_pipeline(shader, target.format);
        desc.vertex = record::stage_entry(shader, "vs");
        desc.fragment = Some(record::stage_entry(shader, "fs"));
        desc.buffers = vec![record::vertex_buffer(&[(0, VertexFormat::Float32x2)])];
        desc.primitive.cull_mode = cull;
        let pipeline = kit.card.create_render_pipeline("", desc);
        let mut pass = kit.card.begin_render_pass([record::clear(target.view, [0.0; 4])], None);
        pass.set_pipeline(pipeline);
        pass.set_vertex_buffer(0, vertices);
        pass.set_index_buffer(indices, self.format);
        for [first, triangles] in draws {
            pass.draw_indexed_from(3 * triangles, 1, 3 * first, 0, 0);
        }
        drop(pass);
        kit.finish()
    }
}
