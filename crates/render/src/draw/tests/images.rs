//! Pictures whose pixels are known.

use super::*;

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
            let near = bytemuck::cast::<_, [u32; 4]>(gfx::texel::encode(format, [0.25_f32.to_bits(), 0, 0, 0]));
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
        *scene.target() = ColorTarget { format: Format::R32Uint, blend: None, logic: None, write_mask: 15 };
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
    let fail = |scene: &Scene| scene.draw_here(USUAL).map(drop).unwrap_err().to_string();
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
    let reading = PLAIN.replace("fs(v: V)", "fs(v: V, @location(3) x: f32)");
    scene.source = reading.replace("return v.c;", "return v.c * x;");
    assert!(fail(&scene).contains("reads @location(3)"), "{}", fail(&scene));
}

#[test]
fn varyings_that_nobody_reads_are_passed_over() {
    let mut scene = Scene::new(rectangle(ALL, 0.5, RED));
    scene.source = "
        struct V { @builtin(position) p: vec4f, @location(0) unread: vec3f, @location(1) c: vec4f, @location(5) more: f32 }
        @vertex fn vs(@location(0) p: vec4f, @location(1) c: vec4f) -> V { return V(p, p.xyz, c, p.x); }
        @fragment fn fs(v: V) -> @location(0) vec4f { return v.c; }
    "
    .into();
    let plain = Scene::new(rectangle(ALL, 0.5, RED)).draw();
    same("unread varyings", "with and without", &scene.draw(), &plain);
}
