//! The same scenes drawn in different ways, and the work that is recorded of them.

use super::*;
use work::{PrimitiveOutcome, QUAD_SHADED};

/// Scenes that exercise different paths.
pub(super) fn variety() -> Vec<(&'static str, Scene)> {
    let mut out = Vec::new();
    let base = || Scene::new(soup(600, 1, true)).with_depth(Format::Depth32Float, Compare::Less, true, 1.0);
    out.push(("depth", base()));
    out.push(("no depth", Scene::new(soup(600, 2, true))));
    out.push(("screens", screens()));
    out.push(("screens samples", screens().samples(4)));
    out.push(("screens, scissored", Scene { scissor: Some(Rect { x: 3, y: 5, width: 95, height: 80 }), ..screens() }));
    let mut unseen = screens();
    unseen.target().write_mask = 0;
    out.push(("screens, nothing written", unseen));
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
    out.push(("screens per sample", Scene { source: sampled.source.clone(), ..screens().samples(4) }));
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
        .replace("return V(p, c)", "return V(array<f32, 2>(p.x + 0.3 * p.w, 0.5 * p.w - p.y * c.x), p, c)")
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
    *float.target() = ColorTarget { format: Format::Rgba16Float, blend: None, logic: None, write_mask: 0b0101 };
    out.push(("half float, masked", float));
    let mut integer = Scene::new(soup(300, 10, true));
    integer.format = Format::Rg32Uint;
    *integer.target() = ColorTarget { format: Format::Rg32Uint, blend: None, logic: None, write_mask: 15 };
    integer.source = PLAIN
        .replace("-> @location(0) vec4<f32>", "-> @location(0) vec2<u32>")
        .replace("return v.c;", "return vec2<u32>(bitcast<u32>(v.c.x), u32(v.p.x));");
    out.push(("integer", integer));
    out
}

/// Triangles and screens that cover all of the target, and a rectangle that covers no tile.
fn screens() -> Scene {
    const PART: [f32; 4] = [-0.5, -0.5, 0.7, 0.7];
    let screen = |c| rectangle([-1.0, -1.0, 3.0, 3.0], 0.5, c)[..3].to_vec();
    Scene::new([soup(200, 13, true), screen(RED), soup(100, 14, false), screen(GREEN), rectangle(PART, 0.5, RED)].concat())
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
        assert_eq!(usual.drawn.funnel, all.drawn.funnel, "{name}");
        let recorded = scene.draw_as(How { record: true, ..USUAL });
        same(name, "when recorded", &usual, &recorded);
        assert_eq!(usual.drawn.funnel, recorded.drawn.funnel, "{name}");
        let key = RenderKey { shade: work::Shade::Covered, ..RenderKey::default() };
        let covered = scene.draw_as(How { record: true, key, ..USUAL });
        same(name, "when everything covered is shaded", &usual, &covered);
        // A program that counts what is shaded counts as much where nothing is recorded.
        let counted = scene.draw_as(How { counted: true, key, ..USUAL });
        same(name, "when everything covered is shaded for its number", &usual, &counted);
        assert_eq!(counted.drawn.funnel, covered.drawn.funnel, "{name}");
        let late = RenderKey { early_z: false, ..RenderKey::default() };
        same(name, "with late tests", &usual, &scene.draw_as(How { key: late, ..USUAL }));
        same(name, "with late tests, recorded", &usual, &scene.draw_as(How { key: late, record: true, ..USUAL }));
        let counts = |how| scene.draw_as(How { count: true, ..how }).drawn.samples_passed;
        let passed = counts(USUAL);
        assert_eq!(passed, counts(How { skips: Skips::NONE, ..USUAL }), "{name}");
        assert_eq!(passed, counts(How { key: late, ..USUAL }), "{name}");
        assert_eq!(passed, counts(How { record: true, ..USUAL }), "{name}");
    }
}

/// Positions are homogeneous: the picture is that of their directions.
#[test]
fn the_scale_of_positions_changes_no_pixel() {
    let mut scenes = variety();
    // Across the eye, and at it, without a plane that cuts nearer.
    let mut near = Scene::new(soup(400, 17, true));
    near.state.primitive.unclipped_depth = true;
    for (i, vertex) in near.vertices.iter_mut().enumerate() {
        vertex[3] = if i % 5 == 0 { 0.0 } else { vertex[3] };
    }
    scenes.push(("at the eye", near.with_depth(Format::Depth32Float, Compare::Greater, true, 0.0)));
    for (name, mut scene) in scenes {
        // So that multiplication by the least power is exact: no digit is below 2^-149.
        scene.vertices.iter_mut().for_each(|v| v[..4].iter_mut().for_each(|x| *x = (*x * 262_144.0).round() / 262_144.0));
        let usual = scene.draw();
        // Of what crosses the eye, parts have a w that is as much smaller as one likes.
        let crosses = scene.vertices.iter().any(|v| v[3] < 1.0);
        for exponent in [if crosses { -100 } else { -120 }, -66, -63, -31, 40, 100] {
            let mut scaled = scene.clone();
            let unit = 2f64.powi(exponent);
            scaled.vertices.iter_mut().for_each(|v| v[..4].iter_mut().for_each(|x| *x = (f64::from(*x) * unit) as f32));
            let scaled = scaled.draw();
            same(name, &format!("with positions times 2^{exponent}"), &usual, &scaled);
            // What is cut away at the eye reaches to a w of 2^-126. With a smaller scale it is larger in proportion, which parts slivers that cover no
            // sample otherwise.
            if !crosses || exponent > -62 {
                assert_eq!(usual.drawn.funnel, scaled.drawn.funnel, "{name}, 2^{exponent}");
            }
        }
    }
    // Other factors round; below the least normal number there is nothing in front of the eye.
    let one = |unit: f32| {
        let mut scene = Scene::new(rectangle(ALL, 0.5, RED));
        scene.vertices.iter_mut().for_each(|v| v[..4].iter_mut().for_each(|x| *x *= unit));
        scene.draw().drawn.funnel.fragments_written
    };
    assert_eq!([one(1.0), one(1e-20), one(1e-37), one(1e30)], [9000; 4]);
    assert_eq!(one(1e-38), 0);
}

#[test]
fn what_is_overwritten_is_counted_and_not_computed() {
    let left_out = |scene: &Scene| scene.draw().drawn.overwritten;
    for samples in [1, 4] {
        let scene = screens().samples(samples);
        let f = scene.draw().drawn.funnel;
        // All but the second screen and what is drawn on it.
        let last = scene.draws[0].end - 6..scene.draws[0].end;
        let seen = Scene { draws: vec![last], ..scene.clone() }.draw().drawn.funnel.fragments_shaded;
        assert_eq!(left_out(&scene), f.fragments_shaded - seen - 100 * 90, "{samples} samples");
        assert_eq!((f.fragments_shaded, f.fragments_written), (f.fragments_covered, f.fragments_covered));
        assert_eq!(f.culled_no_sample, scene.draw_as(How { skips: Skips::NONE, ..USUAL }).drawn.funnel.culled_no_sample);
        assert!(f.culled_no_sample > 0, "{f:?}");

        // What reads the target, tests, counts or discards leaves nothing out.
        let mut masked = scene.clone();
        masked.target().write_mask = 7;
        let mut blended = scene.clone();
        let add = BlendComponent { src: BlendFactor::One, dst: BlendFactor::One, op: BlendOp::Add };
        blended.target().blend = Some(Blend { color: add, alpha: add });
        let discards =
            Scene { source: PLAIN.replace("{ return v.c; }", "{ if v.c.x > 0.6 { discard; } return v.c; }"), ..scene.clone() };
        let tested = scene.clone().with_depth(Format::Depth32Float, Compare::LessEqual, true, 1.0);
        for other in [masked, blended, discards, tested] {
            assert_eq!(left_out(&other), 0);
        }
        assert_eq!(scene.draw_as(How { count: true, ..USUAL }).drawn.overwritten, 0);
        // Nor does a screen in the tile of which it leaves a corner free: of 36 x 64 pixels, upper right.
        let corner = rectangle([-1.0, -1.0, 2.9, 3.0], 0.5, RED)[..3].repeat(2);
        assert_eq!(left_out(&Scene::new(corner).samples(samples)), 100 * 90 - 36 * 64);
    }
}

/// Triangles of all sizes, each of one colour, that are added to what is there.
fn panes(source: String) -> Scene {
    let mut vertices = [soup(200, 15, true), soup(40, 16, false)].concat();
    for triangle in vertices.chunks_exact_mut(3) {
        let color = triangle[0][4..].to_vec();
        triangle.iter_mut().for_each(|vertex| vertex[4..].copy_from_slice(&color));
    }
    let mut scene = Scene { source, ..Scene::new(vertices) };
    let add = BlendComponent { src: BlendFactor::SrcAlpha, dst: BlendFactor::One, op: BlendOp::Add };
    scene.target().blend = Some(Blend { color: add, alpha: add });
    scene
}

#[test]
fn a_triangle_of_one_colour_is_shaded_once_in_a_tile() {
    let one = Skips { repeated: false, ..USUAL.skips };
    let steps = |image: &Image| image.ledger.steps.spent();
    let with = |from: &str, to: &str| PLAIN.replace(from, to);
    let sided = with("fs(v: V)", "fs(v: V, @builtin(front_facing) front: bool)")
        .replace("return v.c;", "return select(v.c.bgra, v.c, front);");
    let derived = with("return v.c;", "return v.c + 16.0 * fwidth(v.c);");
    for (name, source) in [("plain", PLAIN.to_string()), ("two sides", sided), ("derivatives", derived)] {
        let scene = panes(source);
        for scene in [scene.clone(), scene.with_depth(Format::Depth32Float, Compare::LessEqual, true, 1.0)] {
            let (usual, each) = (scene.draw(), scene.draw_as(How { skips: one, ..USUAL }));
            same(name, "where colours are repeated", &usual, &each);
            assert_eq!(usual.drawn.funnel, each.drawn.funnel, "{name}");
            assert!(steps(&usual) < steps(&each), "{name}: {} and {} steps", steps(&usual), steps(&each));
        }
    }
    // Where fragments differ for another reason, each is shaded; where colours differ, too.
    let placed = with("return v.c;", "return v.c + vec4(fract(v.p.x * 0.37));");
    let discarded = with("return v.c;", "if v.c.x > 0.6 { discard; } return v.c;");
    let many = Scene { vertices: soup(200, 15, true), ..panes(PLAIN.into()) };
    for (name, scene) in [("place", panes(placed)), ("discard", panes(discarded)), ("many colours", many)] {
        let (usual, each) = (scene.draw(), scene.draw_as(How { skips: one, ..USUAL }));
        same(name, "without repeated colours", &usual, &each);
        assert_eq!(steps(&usual), steps(&each), "{name}");
    }
}

#[test]
fn the_funnel_adds_up() {
    for (name, scene) in variety() {
        let f = scene.draw_as(How { skips: Skips::NONE, ..USUAL }).drawn.funnel;
        let thrown = f.culled_degenerate + f.culled_backface + f.culled_frustum + f.culled_scissor + f.culled_no_sample;
        assert!(thrown < f.primitives_in, "{name}: {f:?}");
        assert_eq!(f.triangles_setup, f.primitives_in - thrown + f.setup_culled + f.setup_parts, "{name}: {f:?}");
        assert!(f.quads_early_culled <= f.quads_rasterized, "{name}: {f:?}");
        assert!(f.fragments_written + f.fragments_discarded + f.fragments_late_failed <= f.fragments_covered * 4, "{name}");
        let recorded = scene.draw_as(How { record: true, ..USUAL });
        let mut sum = Funnel::default();
        recorded.segments.iter().for_each(|s| sum += s.funnel);
        let ended = |o| recorded.segments.iter().flat_map(|s| &s.primitives).filter(|p| p.outcome == o).count() as u64;
        assert_eq!(sum.primitives_in, recorded.segments.iter().map(|s| s.primitives.len() as u64).sum::<u64>(), "{name}");
        assert_eq!(sum.culled_degenerate, ended(PrimitiveOutcome::Degenerate), "{name}");
        assert_eq!(sum.culled_backface, ended(PrimitiveOutcome::Backface), "{name}");
        assert_eq!(sum.culled_frustum, ended(PrimitiveOutcome::Frustum), "{name}");
        assert_eq!(sum.culled_scissor, ended(PrimitiveOutcome::Scissor), "{name}");
        assert_eq!(sum.culled_no_sample, ended(PrimitiveOutcome::NoSample), "{name}");
        assert_eq!(f.primitives_in - thrown, ended(PrimitiveOutcome::Drawn), "{name}");
        assert_eq!(sum.vertices_in, f.vertices_in, "{name}");
        assert_eq!(sum.vertices_shaded, f.vertices_shaded, "{name}");
        // What is counted is what a machine gets to do: a quad of each sample where the program runs once per sample.
        let quads = || recorded.segments.iter().flat_map(|s| &s.tiles).flat_map(|t| &t.quads);
        let pixels = |mask: u16| (mask | mask >> 4 | mask >> 8 | mask >> 12) & 15;
        let fragments = quads().map(|quad| u64::from(pixels(quad.coverage).count_ones())).sum::<u64>();
        let shaded = quads().filter(|quad| quad.flags & QUAD_SHADED != 0).count() as u64;
        assert_eq!([f.quads_rasterized, sum.quads_rasterized], [quads().count() as u64; 2], "{name}");
        assert_eq!([f.fragments_covered, sum.fragments_covered], [fragments; 2], "{name}");
        if f.quads_shaded > 0 {
            assert_eq!(f.quads_rasterized - f.quads_early_culled, shaded, "{name}");
        }
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
                assert!((v.cost as usize) < s.invocations[Stage::Vertex].costs.costs.len(), "{name}");
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
                    let cost = &tile.invocations.costs[q.cost];
                    assert!(q.first_request as usize + cost.requests() <= tile.invocations.requests.len(), "{name}");
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
