//! Hostile native traces: commands that are repeated, and small traces that ask for endless work of one kind.

use fillrate::gfx::format::Format;
use fillrate::gfx::state::*;
use fillrate::num::{BindGroupId, BufferId, ComputePipelineId, RenderPipelineId, TextureId, ViewId};
use fillrate::trace::command::*;
use fillrate::trace::record::{self, Recorder, RenderPass};

/// The name of a form, and a function that records it with a number of commands, or with this amount of work.
pub type Recorded = (&'static str, fn(usize) -> Recorder);

const FORMAT: Format = Format::Rgba8Unorm;

/// A recording with one object of each kind.
struct Scene {
    card: Recorder,
    texture: TextureId,
    view: ViewId,
    buffer: BufferId,
    pipeline: RenderPipelineId,
    compute: ComputePipelineId,
    group: BindGroupId,
}

/// What shaders of a scene compute: a vertex shader that needs no buffer, and one fragment shader and one compute shader with these bodies.
struct Bodies {
    fragment: &'static str,
    compute: &'static str,
}

const PLAIN: Bodies = Bodies { fragment: "return p;", compute: "b[0] += 1u;" };

/// A triangle that covers the whole target, for each three vertices.
const WHOLE: &str = "vec4f(f32(v % 3u / 2u) * 4.0 - 1.0, f32(v % 3u % 2u) * 4.0 - 1.0, 0.5, 1.0)";
/// A triangle that covers no pixel, for each three vertices.
const TINY: &str = "vec4f(f32(v % 3u / 2u) * 0.001, f32(v % 3u % 2u) * 0.001, 0.5, 1.0)";

impl Scene {
    fn of(desc: TextureDesc, position: &str, bodies: Bodies, change: impl FnOnce(&mut RenderPipelineDesc)) -> Scene {
        let mut card = Recorder::new("hostile");
        let samples = desc.samples;
        let texture = card.create_texture("target", desc);
        let view = card.create_view(texture);
        let buffer = card.create_buffer("buffer", 4096);
        let Bodies { fragment, compute } = bodies;
        let source = format!(
            "@group(0) @binding(0) var<storage, read_write> b: array<u32>;
            @vertex fn vs(@builtin(vertex_index) v: u32) -> @builtin(position) vec4f {{ return {position}; }}
            @fragment fn fs(@builtin(position) p: vec4f) -> @location(0) vec4f {{ {fragment} }}
            @compute @workgroup_size(64) fn main(@builtin(local_invocation_index) i: u32) {{ {compute} }}"
        );
        let shader = card.create_shader("hostile", &source);
        let mut desc = record::render_pipeline(shader, FORMAT);
        desc.multisample.count = samples;
        change(&mut desc);
        let pipeline = card.create_render_pipeline("hostile", desc);
        let compute = card.create_compute_pipeline("hostile", None, record::stage_entry(shader, "main"));
        let layout = card.get_bind_group_layout(AnyPipeline::Compute(compute), 0);
        let group = card.create_bind_group(layout, [(0, record::whole(buffer))]);
        Scene { card, texture, view, buffer, pipeline, compute, group }
    }

    fn new(size: u32, position: &str) -> Scene {
        Scene::of(record::texture_2d(size, size, FORMAT), position, PLAIN, |_| ())
    }

    /// One pass.
    fn pass(mut self, draw: impl FnOnce(&mut RenderPass<'_>, RenderPipelineId)) -> Recorder {
        let mut pass = self.card.begin_render_pass([record::clear(self.view, [0.0; 4])], None);
        pass.set_pipeline(self.pipeline);
        draw(&mut pass, self.pipeline);
        drop(pass);
        self.shown()
    }

    fn dispatches(mut self, groups: &[[u32; 3]]) -> Recorder {
        let mut pass = self.card.begin_compute_pass();
        pass.set_pipeline(self.compute);
        pass.set_bind_group(0, self.group);
        groups.iter().for_each(|&[x, y, z]| pass.dispatch(x, y, z));
        drop(pass);
        self.shown()
    }

    /// Of one sample only.
    fn shown(mut self) -> Recorder {
        self.card.present(self.texture);
        self.card
    }

    fn each(mut self, n: usize, command: impl Fn(&mut Scene, usize)) -> Recorder {
        (0..n).for_each(|k| command(&mut self, k));
        self.shown()
    }
}

fn small() -> Scene {
    Scene::new(8, WHOLE)
}

fn end(texture: TextureId) -> TextureEnd {
    TextureEnd { texture, level: 0, origin: [0; 3], aspect: Aspect::All }
}

/// Each command, `n` times, with what it needs.
pub const COMMANDS: &[Recorded] = &[
    ("buffers", |n| {
        small().each(n, |s, _| {
            s.card.create_buffer("", 4);
        })
    }),
    ("contents of buffers", |n| {
        small().each(n, |s, k| s.card.write_buffer(s.buffer, 0, "data", &(k as u32 % 4).to_le_bytes()[..]))
    }),
    ("textures", |n| {
        small().each(n, |s, _| {
            s.card.create_texture("", record::texture_2d(1, 1, FORMAT));
        })
    }),
    ("contents of textures", |n| small().each(n, |s, k| s.card.write_level(s.texture, 0, "data", &[k as u8; 256]))),
    ("views", |n| {
        small().each(n, |s, _| {
            s.card.create_view(s.texture);
        })
    }),
    ("samplers", |n| {
        small().each(n, |s, _| {
            s.card.create_sampler(record::trilinear_repeat());
        })
    }),
    ("shaders", |n| {
        small().each(n, |s, _| {
            s.card.create_shader("again", "@compute @workgroup_size(1) fn main() {}");
        })
    }),
    ("different shaders", |n| {
        small().each(n, |s, k| {
            let source = format!("@compute @workgroup_size(1) fn main() {{ var x = {k}; }}");
            let shader = s.card.create_shader("other", &source);
            let pipeline = s.card.create_compute_pipeline("", None, record::stage(shader));
            let mut pass = s.card.begin_compute_pass();
            pass.set_pipeline(pipeline);
            pass.dispatch(1, 1, 1);
        })
    }),
    ("compute pipelines", |n| {
        let mut scene = small();
        let shader = scene.card.create_shader("again", "@compute @workgroup_size(1) fn main() {}");
        scene.each(n, move |s, _| {
            let pipeline = s.card.create_compute_pipeline("", None, record::stage(shader));
            let mut pass = s.card.begin_compute_pass();
            pass.set_pipeline(pipeline);
            pass.dispatch(1, 1, 1);
        })
    }),
    ("render pipelines", |n| {
        let mut scene = small();
        let source = format!(
            "@vertex fn vs(@builtin(vertex_index) v: u32) -> @builtin(position) vec4f {{ return {WHOLE}; }}
            @fragment fn fs() -> @location(0) vec4f {{ return vec4f(1.0); }}"
        );
        let shader = scene.card.create_shader("again", &source);
        scene.each(n, move |s, _| {
            let pipeline = s.card.create_render_pipeline("", record::render_pipeline(shader, FORMAT));
            let mut pass = s.card.begin_render_pass([record::clear(s.view, [0.0; 4])], None);
            pass.set_pipeline(pipeline);
            pass.draw(3, 1);
        })
    }),
    ("bind groups", |n| {
        let mut scene = small();
        let layout = scene.card.create_bind_group_layout([(0, record::STORAGE)]);
        scene.each(n, move |s, _| {
            s.card.create_bind_group(layout, [(0, record::whole(s.buffer))]);
        })
    }),
    ("layouts", |n| {
        small().each(n, |s, _| {
            s.card.create_bind_group_layout([(0, record::STORAGE)]);
        })
    }),
    ("derived layouts", |n| {
        small().each(n, |s, _| {
            s.card.get_bind_group_layout(AnyPipeline::Compute(s.compute), 0);
        })
    }),
    ("query sets", |n| {
        small().each(n, |s, _| {
            s.card.create_query_set(QueryKind::Occlusion, 1);
        })
    }),
    ("empty passes", |n| small().each(n, |s, _| drop(s.card.begin_render_pass([record::load(s.view)], None)))),
    ("clears", |n| small().each(n, |s, _| drop(s.card.begin_render_pass([record::clear(s.view, [0.0; 4])], None)))),
    ("passes with a draw", |n| {
        small().each(n, |s, _| {
            let mut pass = s.card.begin_render_pass([record::load(s.view)], None);
            pass.set_pipeline(s.pipeline);
            pass.draw(3, 1);
        })
    }),
    ("passes with a small draw", |n| {
        Scene::new(8, TINY).each(n, |s, _| {
            let mut pass = s.card.begin_render_pass([record::load(s.view)], None);
            pass.set_pipeline(s.pipeline);
            pass.draw(3, 1);
        })
    }),
    ("draws", |n| small().pass(|pass, _| (0..n).for_each(|_| pass.draw(3, 1)))),
    ("draws of nothing", |n| small().pass(|pass, _| (0..n).for_each(|_| pass.draw(0, 0)))),
    ("draws of a thousand vertices", |n| small().pass(|pass, _| (0..n).for_each(|_| pass.draw(1000, 1)))),
    ("draws over a large target", |n| Scene::new(1024, WHOLE).pass(|pass, _| (0..n).for_each(|_| pass.draw(3, 1)))),
    ("indirect draws", |n| {
        let buffer = small().buffer;
        small().pass(move |pass, _| (0..n).for_each(|_| pass.draw_indirect(buffer, 0, false)))
    }),
    ("states", |n| {
        small().pass(|pass, _| {
            (0..n).for_each(|k| pass.set_scissor(Rect { x: k as u32 % 4, y: 0, width: 2, height: 2 }));
            pass.draw(3, 1);
        })
    }),
    ("states and draws", |n| {
        small().pass(|pass, _| {
            (0..n).for_each(|k| {
                pass.set_scissor(Rect { x: k as u32 % 4, y: 0, width: 2, height: 2 });
                pass.set_blend_constant([k as f64, 0.0, 0.0, 0.0]);
                pass.draw(3, 1);
            })
        })
    }),
    ("pipelines and draws", |n| {
        small().pass(|pass, pipeline| {
            (0..n).for_each(|_| {
                pass.set_pipeline(pipeline);
                pass.draw(3, 1);
            })
        })
    }),
    ("bundles", |n| {
        small().each(n, |s, _| {
            let mut bundle = s.card.begin_bundle();
            bundle.set_pipeline(s.pipeline);
            bundle.draw(3, 1);
        })
    }),
    ("executions of a bundle", |n| {
        let mut scene = small();
        let mut bundle = scene.card.begin_bundle();
        bundle.set_pipeline(scene.pipeline);
        (0..100).for_each(|_| bundle.draw(3, 1));
        let id = bundle.id();
        drop(bundle);
        scene.pass(move |pass, _| pass.execute_bundles(&vec![id; n]))
    }),
    ("dispatches", |n| small().dispatches(&vec![[1; 3]; n])),
    ("dispatches of nothing", |n| small().dispatches(&vec![[0; 3]; n])),
    ("dispatches of many workgroups", |n| small().dispatches(&vec![[64, 1, 1]; n])),
    ("compute passes", |n| {
        small().each(n, |s, _| {
            let mut pass = s.card.begin_compute_pass();
            pass.set_pipeline(s.compute);
            pass.set_bind_group(0, s.group);
            pass.dispatch(1, 1, 1);
        })
    }),
    ("copies of buffers", |n| small().each(n, |s, _| s.card.copy_buffer_to_buffer((s.buffer, 0), (s.buffer, 2048), 1024))),
    ("copies of textures", |n| {
        let mut scene = small();
        let other = scene.card.create_texture("other", record::texture_2d(8, 8, FORMAT));
        scene.each(n, move |s, _| s.card.copy_texture_to_texture(end(s.texture), end(other), [8, 8, 1]))
    }),
    ("copies to and fro", |n| {
        small().each(n, |s, _| {
            let rows = LinearLayout { offset: 0, bytes_per_row: Some(256), rows_per_image: Some(8) };
            s.card.copy_texture_to_buffer(end(s.texture), s.buffer, rows, [8, 8, 1]);
            s.card.copy_buffer_to_texture(s.buffer, rows, end(s.texture), [8, 8, 1]);
        })
    }),
    ("clears of buffers", |n| {
        small().each(n, |s, _| s.card.push(Command::ClearBuffer { buffer: s.buffer, offset: 0, size: None }))
    }),
    ("queries", |n| {
        let mut scene = small();
        let set = scene.card.create_query_set(QueryKind::Occlusion, 4);
        scene.each(n, move |s, _| s.card.resolve_queries(set, 0, 4, s.buffer, 0))
    }),
    ("presents", |n| small().each(n, |s, _| s.card.present(s.texture))),
    ("presents of passes", |n| {
        small().each(n, |s, k| {
            drop(s.card.begin_render_pass([record::clear(s.view, [(k % 7) as f64 / 7.0; 4])], None));
            s.card.present(s.texture);
        })
    }),
    ("sprites", |n| small().each(n, |s, k| s.card.set_sprite(k as u32 % 4, Some(s.view), [0, 0]))),
    ("objects destroyed", |n| {
        small().each(n, |s, _| {
            let buffer = s.card.create_buffer("", 4);
            s.card.push(Command::Destroy(Object::Buffer(buffer)));
        })
    }),
];

/// `rows` draws of all pixels in one draw: as many instances.
fn fill(scene: Scene, n: u32) -> Recorder {
    scene.pass(|pass, _| pass.draw(3, n))
}

fn blended(desc: &mut RenderPipelineDesc) {
    let one = BlendComponent { src: BlendFactor::SrcAlpha, dst: BlendFactor::OneMinusSrcAlpha, op: BlendOp::Add };
    desc.targets[0].as_mut().expect("a target").blend = Some(Blend { color: one, alpha: one });
}

/// Traces of a few kilobytes that ask for work of one kind, as much as `n` allows. Each limit ends at least one of them.
pub const ENDLESS: &[Recorded] = &[
    ("vertices", |n| {
        Scene::new(8, "vec4f(2.0, 2.0, 2.0, 1.0)").pass(|pass, _| (0..16).for_each(|_| pass.draw(3 * n as u32, 50)))
    }),
    ("instances", |n| {
        Scene::new(8, "vec4f(2.0, 2.0, 2.0, 1.0)").pass(|pass, _| (0..16).for_each(|_| pass.draw(3, 50 * n as u32)))
    }),
    ("triangles without pixels", |n| Scene::new(8, TINY).pass(|pass, _| (0..16).for_each(|_| pass.draw(3 * n as u32, 50)))),
    ("triangles of a pixel", |n| {
        let position = "vec4f(f32(v % 3u / 2u) * 0.25, f32(v % 3u % 2u) * 0.25, 0.5, 1.0)";
        Scene::new(8, position).pass(|pass, _| (0..16).for_each(|_| pass.draw(3 * n as u32, 50)))
    }),
    ("triangles cut", |n| {
        let position = "vec4f(f32(v % 3u / 2u) * 4.0 - 1.0, f32(v % 3u % 2u) * 4.0 - 1.0, f32(v % 2u) * 3.0 - 1.0, 1.0)";
        Scene::new(8, position).pass(|pass, _| (0..16).for_each(|_| pass.draw(3 * n as u32, 50)))
    }),
    ("long thin triangles", |n| {
        let position =
            "vec4f(f32(v % 3u / 2u) * 2.0 - 1.0, f32(v % 3u / 2u) * 1.9 - 1.0 + f32(v % 3u % 2u) * 0.0001, 0.5, 1.0)";
        Scene::new(4096, position).pass(|pass, _| (0..16).for_each(|_| pass.draw(3 * n as u32, 50)))
    }),
    ("pixels", |n| fill(Scene::new(4096, WHOLE), n as u32)),
    ("pixels blended", |n| fill(Scene::of(record::texture_2d(4096, 4096, FORMAT), WHOLE, PLAIN, blended), n as u32)),
    ("pixels of floats blended", |n| {
        let scene = Scene::of(record::texture_2d(4096, 4096, Format::Rgba16Float), WHOLE, PLAIN, |desc| {
            desc.targets[0].as_mut().expect("a target").format = Format::Rgba16Float;
            blended(desc);
        });
        fill(scene, n as u32)
    }),
    ("pixels discarded", |n| {
        let bodies = Bodies { fragment: "if p.x > 0.0 { discard; } return p;", ..PLAIN };
        fill(Scene::of(record::texture_2d(4096, 4096, FORMAT), WHOLE, bodies, |_| ()), n as u32)
    }),
    ("pixels of a constant", |n| {
        let bodies = Bodies { fragment: "return vec4f(0.5);", ..PLAIN };
        fill(Scene::of(record::texture_2d(4096, 4096, FORMAT), WHOLE, bodies, |_| ()), n as u32)
    }),
    ("pixels in many draws", |n| {
        let count = 16.min(n);
        Scene::of(record::texture_2d(4096, 4096, FORMAT), WHOLE, PLAIN, blended)
            .pass(|pass, _| (0..count).for_each(|_| pass.draw(3, (n / count) as u32)))
    }),
    ("loops of a fragment shader", |n| {
        let bodies =
            Bodies { fragment: "var f = p.x; for (var k = 0; k < 1000; k++) { f = f * 1.5 + 1.0; } return vec4f(f);", ..PLAIN };
        fill(Scene::of(record::texture_2d(512, 512, FORMAT), WHOLE, bodies, |_| ()), n as u32)
    }),
    ("workgroups of nothing", |n| {
        let bodies = Bodies { compute: "if i > 64u { b[0] = 1u; }", ..PLAIN };
        Scene::of(record::texture_2d(8, 8, FORMAT), WHOLE, bodies, |_| ()).dispatches(&[[65_535, n as u32, 1]; 4])
    }),
    ("workgroups", |n| small().dispatches(&[[65_535, n as u32, 1]; 4])),
    ("workgroups that write", |n| {
        let bodies = Bodies { compute: "b[i] = b[i * 7u & 63u] + 1u;", ..PLAIN };
        Scene::of(record::texture_2d(8, 8, FORMAT), WHOLE, bodies, |_| ()).dispatches(&[[65_535, n as u32, 1]; 4])
    }),
    ("loops of a workgroup", |n| {
        let bodies = Bodies { compute: "var x = i; for (var k = 0; k < 100000; k++) { x = x * 3u + 1u; } b[i] = x;", ..PLAIN };
        Scene::of(record::texture_2d(8, 8, FORMAT), WHOLE, bodies, |_| ()).dispatches(&[[n as u32, 1, 1]; 4])
    }),
    ("loops of a workgroup over memory", |n| {
        let bodies = Bodies { compute: "for (var k = 0; k < 10000; k++) { b[i] += b[k & 1023]; }", ..PLAIN };
        Scene::of(record::texture_2d(8, 8, FORMAT), WHOLE, bodies, |_| ()).dispatches(&[[n as u32, 1, 1]; 4])
    }),
    ("loops of barriers", |n| {
        let bodies = Bodies { compute: "for (var k = 0; k < 10000; k++) { workgroupBarrier(); } b[i] = 1u;", ..PLAIN };
        Scene::of(record::texture_2d(8, 8, FORMAT), WHOLE, bodies, |_| ()).dispatches(&[[n as u32, 1, 1]; 4])
    }),
    ("atomics", |n| {
        let mut scene = small();
        let source = "@group(0) @binding(0) var<storage, read_write> b: array<atomic<u32>>;
            @compute @workgroup_size(64) fn main(@builtin(local_invocation_index) i: u32) { for (var k = 0; k < 10000; k++) { atomicAdd(&b[0], i); } }";
        let shader = scene.card.create_shader("atomics", source);
        scene.compute = scene.card.create_compute_pipeline("atomics", None, record::stage(shader));
        let layout = scene.card.get_bind_group_layout(AnyPipeline::Compute(scene.compute), 0);
        scene.group = scene.card.create_bind_group(layout, [(0, record::whole(scene.buffer))]);
        scene.dispatches(&[[n as u32, 1, 1]; 4])
    }),
    ("bytes copied", |n| {
        let mut scene = small();
        let large = scene.card.create_buffer("large", 256 << 20);
        scene.each(n.min(20_000), move |s, _| s.card.copy_buffer_to_buffer((large, 0), (large, 128 << 20), 128 << 20))
    }),
    ("bytes cleared", |n| {
        let mut scene = small();
        let large = scene.card.create_buffer("large", 256 << 20);
        scene.each(n.min(20_000), move |s, _| s.card.push(Command::ClearBuffer { buffer: large, offset: 0, size: None }))
    }),
    ("bytes created", |n| {
        small().each(n.min(10_000), |s, _| {
            let buffer = s.card.create_buffer("", 256 << 20);
            s.card.push(Command::ClearBuffer { buffer, offset: 0, size: None });
            s.card.push(Command::Destroy(Object::Buffer(buffer)));
        })
    }),
    ("texels copied", |n| {
        let mut scene = Scene::new(4096, WHOLE);
        let other = scene.card.create_texture("other", record::texture_2d(4096, 4096, FORMAT));
        scene.each(n.min(10_000), move |s, _| s.card.copy_texture_to_texture(end(s.texture), end(other), [4096, 4096, 1]))
    }),
    ("texels copied to and fro", |n| {
        let mut scene = Scene::new(4096, WHOLE);
        let large = scene.card.create_buffer("large", 64 << 20);
        scene.each(n.min(5_000), move |s, _| {
            let rows = LinearLayout { offset: 0, bytes_per_row: Some(4 * 4096), rows_per_image: Some(4096) };
            s.card.copy_texture_to_buffer(end(s.texture), large, rows, [4096, 4096, 1]);
            s.card.copy_buffer_to_texture(large, rows, end(s.texture), [4096, 4096, 1]);
        })
    }),
    ("passes over large targets", |n| {
        Scene::new(4096, WHOLE).each(n.min(10_000), |s, k| {
            let target = if k % 2 == 0 { record::clear(s.view, [0.5; 4]) } else { record::load(s.view) };
            let mut pass = s.card.begin_render_pass([target], None);
            pass.set_pipeline(s.pipeline);
            pass.draw(3, 1);
        })
    }),
    ("loads of large targets", |n| {
        Scene::new(4096, TINY).each(n.min(10_000), |s, _| {
            let mut pass = s.card.begin_render_pass([record::load(s.view)], None);
            pass.set_pipeline(s.pipeline);
            pass.draw(3, 1);
        })
    }),
    ("presents of large pictures", |n| {
        Scene::new(4096, WHOLE).each(n.min(10_000), |s, k| {
            drop(s.card.begin_render_pass([record::clear(s.view, [(k % 7) as f64 / 7.0; 4])], None));
            s.card.present(s.texture);
        })
    }),
    ("indirect draws of nothing", |n| {
        let mut scene = small();
        let large = scene.card.create_buffer("large", 16 << 20);
        let count = 1 << 20;
        scene.pass(move |pass, _| {
            (0..n.min(100)).for_each(|_| {
                pass.push(Command::DrawIndirect { buffer: large, offset: 0, indexed: false, count, count_buffer: None });
            })
        })
    }),
    ("bundles of draws", |n| {
        let mut scene = small();
        let mut bundle = scene.card.begin_bundle();
        bundle.set_pipeline(scene.pipeline);
        (0..100).for_each(|_| bundle.draw(3, 1));
        let id = bundle.id();
        drop(bundle);
        scene.pass(move |pass, _| (0..100).for_each(|_| pass.execute_bundles(&vec![id; n.min(2000)])))
    }),
    ("frames", |n| small().each(n.min(100_000), |s, _| s.card.present(s.texture))),
];
