//! What lies outside by its bounds is left out, and nothing else changes.

use super::ways::variety;
use super::*;
use gfx::clip::{BEHIND, BOTTOM, ClipVolume, FAR, LEFT, NEAR, RIGHT, TOP};
use work::{Cull, Culling};

/// Drawn with a way of culling, recorded or not.
fn drawn(scene: &Scene, cull: Cull, record: bool) -> Image {
    scene.draw_as(How { record, count: true, key: RenderKey { cull, ..RenderKey::default() }, ..USUAL })
}

/// The results of the tests of all draws.
fn culled(image: &Image) -> Culling {
    image.draws.iter().fold(Culling::default(), |sum, draw| Culling {
        tests: sum.tests + draw.culling.tests,
        draws: sum.draws + draw.culling.draws,
        instances: sum.instances + draw.culling.instances,
        primitives: sum.primitives + draw.culling.primitives,
        vertices: sum.vertices + draw.culling.vertices,
    })
}

/// Draws a scene with and without, and compares; what was left out of it by draws, and by instances.
fn compare(name: &str, scene: &Scene) -> [Culling; 2] {
    let plain = drawn(scene, Cull::None, true);
    assert_eq!(culled(&plain), Culling::default(), "{name}");
    [Cull::Draws, Cull::Instances].map(|cull| {
        let image = drawn(scene, cull, true);
        same(name, "when culled", &plain, &image);
        assert_eq!(plain.drawn.samples_passed, image.drawn.samples_passed, "{name}");
        let left = culled(&image);
        let (before, after) = (plain.drawn.funnel, image.drawn.funnel);
        assert_eq!(before.primitives_in, after.primitives_in + left.primitives, "{name}, {cull:?}");
        assert_eq!(before.vertices_in, after.vertices_in + left.vertices, "{name}, {cull:?}");
        // All of them would have ended there.
        assert_eq!(before.culled_frustum, after.culled_frustum + left.primitives, "{name}, {cull:?}");
        let rest =
            |funnel: Funnel| Funnel { primitives_in: 0, vertices_in: 0, vertices_shaded: 0, culled_frustum: 0, ..funnel };
        assert_eq!(rest(before), rest(after), "{name}, {cull:?}");
        let unrecorded = drawn(scene, cull, false);
        same(name, "when culled and not recorded", &plain, &unrecorded);
        assert_eq!(unrecorded.drawn.funnel.primitives_in, after.primitives_in, "{name}, {cull:?}");
        left
    })
}

/// A scene in small draws.
fn in_pieces(mut scene: Scene, size: u32) -> Scene {
    let end = scene.draws.last().map_or(0, |range| range.end);
    scene.draws = (0..end.div_ceil(size)).map(|i| i * size..((i + 1) * size).min(end)).collect();
    scene
}

#[test]
fn whole_draws_outside_are_left_out() {
    for (name, scene) in variety() {
        let mut scene = in_pieces(scene, 30);
        // Every third part of the soup goes far to the left, wherever it was.
        for (number, vertex) in scene.vertices.iter_mut().enumerate().filter(|(number, _)| number / 300 % 3 == 0) {
            vertex[0] = -5.0 - vertex[0].abs() - number as f32;
        }
        let draws = scene.draws.len() as u64;
        let [by_draw, by_instance] = compare(name, &scene);
        assert_eq!(by_draw.tests, draws, "{name}");
        assert!(by_draw.draws > 2 && by_draw.draws < draws / 2, "{name}: {by_draw:?}");
        assert_eq!(by_draw.instances, by_draw.draws * u64::from(scene.instances), "{name}");
        assert!(by_instance.instances >= by_draw.instances, "{name}");
    }
}

/// Triangles that instances move along x, by 0.9 each from -4.5 on.
fn moved(instances: u32, topology: Topology) -> Scene {
    let mut scene = Scene::new(soup(40, 3, false));
    for vertex in &mut scene.vertices {
        (vertex[0], vertex[1]) = (0.3 * vertex[0], 0.3 * vertex[1]);
    }
    scene.state.primitive.topology = topology;
    scene.source = PLAIN
        .replace("@location(1) c: vec4<f32>) -> V {", "@location(1) c: vec4<f32>, @builtin(instance_index) i: u32) -> V {")
        .replace("V(p, c)", "V(p + vec4<f32>(0.9 * (f32(i) - 5.0), 0.0, 0.0, 0.0), c)");
    scene.instances = instances;
    scene
}

#[test]
fn instances_outside_are_left_out() {
    for topology in [Topology::TriangleList, Topology::TriangleStrip, Topology::TriangleFan, Topology::PointList] {
        let [by_draw, by_instance] = compare("instances", &moved(11, topology));
        assert_eq!((by_draw.tests, by_draw.instances), (1, 0), "{topology:?}");
        assert_eq!((by_instance.tests, by_instance.draws), (1 + 11, 0), "{topology:?}");
        assert!((6..=9).contains(&by_instance.instances), "{topology:?}: {by_instance:?}");
        // A single one is tested once, and a crowd of which none is seen too.
        let [_, one] = compare("one", &moved(1, topology));
        assert_eq!((one.tests, one.draws, one.instances), (1, 1, 1), "{topology:?}");
        let [_, few] = compare("few", &moved(3, topology));
        assert_eq!((few.tests, few.draws, few.instances), (1, 1, 3), "{topology:?}");
    }
    // Instances in the middle go, so that the rest is in two runs; segments are cut inside and between them.
    let mut split = moved(300, Topology::TriangleList);
    split.source = split.source.replace("(f32(i) - 5.0)", "select(0.0, 9.0, i > 100u && i < 200u)");
    let [_, left] = compare("two runs", &split);
    assert_eq!((left.tests, left.instances), (301, 99));
    let recorded = drawn(&split, Cull::Instances, true);
    let instances = recorded.segments.iter().flat_map(|segment| &segment.vertices).map(|vertex| vertex.instance);
    let mut seen: Vec<u32> = instances.collect();
    seen.dedup();
    assert_eq!(seen, (0..=100).chain(200..300).collect::<Vec<u32>>());
}

#[test]
fn what_could_show_a_difference_is_not_tested() {
    let outside = |scene: &Scene| {
        let mut scene = scene.clone();
        scene.vertices.iter_mut().for_each(|vertex| vertex[0] = -2.0);
        scene
    };
    let plain = outside(&Scene::new(soup(20, 1, false)));
    assert_eq!(culled(&drawn(&plain, Cull::Draws, true)).draws, 1);
    let tests = |replace: [(&str, &str); 2]| {
        let source = replace.iter().fold(plain.source.clone(), |source, (from, to)| source.replace(from, to));
        assert_ne!(source, plain.source);
        culled(&drawn(&Scene { source, ..plain.clone() }, Cull::Instances, true)).tests
    };
    let nothing = ("", "");
    assert_eq!(tests([("return v.c;", "return v.c + subgroupAdd(v.c);"), nothing]), 0, "fragments that see each other");
    assert_eq!(tests([("return V(p, c)", "return V(p, subgroupMax(c))"), nothing]), 0, "vertices that see each other");
    let number = ("fs(v: V)", "fs(v: V, @builtin(subgroup_invocation_id) s: u32)");
    assert_eq!(tests([number, ("return v.c;", "return v.c * f32(s);")]), 0, "fragments that know their place");
    // What has no bounds is tested, and drawn.
    let unbounded = ("return V(p, c)", "return V(vec4<f32>(p.x + 0.0 * sin(p.y), p.yzw), c)");
    assert_eq!(tests([unbounded, nothing]), 1);
    let crowd = Scene { source: plain.source.replace(unbounded.0, unbounded.1), instances: 50, ..plain.clone() };
    assert_eq!(culled(&drawn(&crowd, Cull::Instances, true)).tests, 2, "where the first instance has no bounds, none has");
}

#[test]
fn a_box_is_rejected_only_with_all_that_is_in_it() {
    let mut random = num::Random::new(1);
    let mut next = || random.range(-1.0, 1.0);
    let viewport = Viewport { x: 0.0, y: 0.0, width: 64.0, height: 64.0, min_depth: 0.0, max_depth: 1.0 };
    let (mut rejected, mut least) = (0, [0; 7]);
    for unclipped in [false, true] {
        let volume = ClipVolume::new(&viewport, unclipped);
        for _ in 0..20_000 {
            let ends: [(f32, f32); 4] = std::array::from_fn(|_| {
                let (a, b) = (2.0 * next(), 2.0 * next());
                let b = if next() > 0.0 { a + 0.1 * b } else { b };
                (a.min(b), a.max(b))
            });
            let corners = (0..16).map(|i: usize| std::array::from_fn(|c| if i >> c & 1 == 0 { ends[c].0 } else { ends[c].1 }));
            let common = corners.map(|corner| volume.outcode(corner)).fold(!0, |a, b| a & b);
            let planes = [LEFT, RIGHT, BOTTOM, TOP, NEAR, FAR, BEHIND];
            let outside = planes.map(|plane| common & plane != 0);
            // Corners are extremes of each plane's distance: a box is outside where they are.
            assert_eq!(volume.rejects(ends), outside.contains(&true), "{ends:?}");
            rejected += u32::from(volume.rejects(ends));
            least.iter_mut().zip(outside).for_each(|(n, outside)| *n += u32::from(outside));
        }
    }
    assert!(rejected > 5_000 && least.iter().all(|&n| n > 500), "{rejected} rejected, by plane {least:?}");
}
