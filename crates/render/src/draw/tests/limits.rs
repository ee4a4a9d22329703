//! Limits of work: exactly as much is allowed, one more is refused, and the words do not depend on the number of threads.

use super::*;
use num::{Limit, Meter};

/// Many triangles over many tiles, in several batches, with a loop in either stage.
fn busy() -> Scene {
    let mut vertices = Vec::new();
    for i in 0..1500 {
        let (x, y) = (-1.0 + 0.02 * (i % 100) as f32, -1.0 + 0.12 * (i / 100) as f32);
        for (dx, dy) in [(0.0, 0.0), (0.1, 0.0), (0.0, 0.1)] {
            vertices.push([x + dx, y + dy, 0.5, 1.0, 1.0, 0.5, 0.25, 1.0]);
        }
    }
    let mut scene = Scene::new(vertices);
    scene.extent = (260, 140);
    scene.source = "
        struct V { @builtin(position) p: vec4<f32>, @location(0) c: vec4<f32> }
        @vertex fn vs(@location(0) p: vec4<f32>, @location(1) c: vec4<f32>) -> V {
            var v = V(p, c);
            for (var i = 0; i < i32(8.0 * c.y); i++) { v.c.x *= 0.99; }
            return v;
        }
        @fragment fn fs(v: V) -> @location(0) vec4<f32> {
            var c = v.c;
            var i = 0.0;
            loop { c.y += 0.001; i += 1.0; if (i >= 6.0 * v.c.y) { break; } }
            return c;
        }"
    .into();
    scene
}

fn drawn(scene: &Scene, how: How) -> Result<(), String> {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(how.threads).build().expect("threads");
    pool.install(|| scene.draw_here(how)).map(drop).map_err(|reason| reason.to_string())
}

#[test]
fn blending_texels_of_other_than_four_bytes_takes_steps_of_its_own() {
    let one = BlendComponent { src: BlendFactor::One, dst: BlendFactor::One, op: BlendOp::Add };
    let drawn = |format, blend: Option<Blend>, samples| {
        let mut scene = busy().samples(samples);
        scene.format = format;
        *scene.target() = ColorTarget { format, blend, logic: None, write_mask: 15 };
        let image = scene.draw_as(How { skips: Skips::NONE, ..USUAL });
        (image.ledger.steps.spent(), image.drawn.funnel.quads_rasterized)
    };
    let blend = Some(Blend { color: one, alpha: one });
    for samples in [1, 4] {
        let (bytes, quads) = drawn(Format::Rgba8Unorm, blend, samples);
        let (floats, same) = drawn(Format::Rgba16Float, blend, samples);
        assert_eq!((floats - bytes, same), (24 * u64::from(samples) * quads, quads), "{samples} samples");
        assert_eq!(drawn(Format::Rgba16Float, None, samples).0, drawn(Format::Rgba8Unorm, None, samples).0);
    }
}

/// Draws with one limit at what is needed, and at one less.
fn at_the_edge(
    mut scene: Scene,
    name: &str,
    limit: fn(&mut Limits) -> &mut Limit,
    needed: fn(&Ledger) -> &Meter,
    record: bool,
) {
    let how = How { record, ..USUAL };
    let image = scene.draw_as(how);
    let needed = needed(&image.ledger).spent();
    assert!(needed > 0, "{name}");
    for threads in [1, 2, 8] {
        let how = How { threads, ..how };
        let again = scene.draw_as(how);
        assert_eq!(again.ledger.meters().map(Meter::spent), image.ledger.meters().map(Meter::spent), "{threads} threads");
    }
    let mut refused = Vec::new();
    for threads in [1, 2, 8] {
        let how = How { threads, ..how };
        *limit(&mut scene.limits) = limit(&mut scene.limits).with(needed);
        assert_eq!(drawn(&scene, how), Ok(()), "{name}, {threads} threads");
        for less in [needed - 1, needed / 3] {
            *limit(&mut scene.limits) = limit(&mut scene.limits).with(less);
            refused.push((less, drawn(&scene, how).expect_err(name)));
        }
    }
    for (less, text) in &refused {
        assert!(
            text.contains(&format!("the limit; --limit {name}=N")) || text.contains(&format!("limit of {less};")),
            "{text}"
        );
        assert!(refused.iter().all(|(other, same)| other != less || same == text), "{refused:?}");
    }
}

#[test]
fn steps_are_counted_the_same_on_any_number_of_threads() {
    for record in [false, true] {
        at_the_edge(busy(), "work.shader_steps", |limits| &mut limits.work_steps, |ledger| &ledger.steps, record);
    }
}

#[test]
fn quads_are_counted_the_same_on_any_number_of_threads() {
    for record in [false, true] {
        // What shaders do takes time, and no quads.
        let plain = Scene { source: PLAIN.into(), ..busy() };
        at_the_edge(plain, "work.quads", |limits| &mut limits.work_quads, |ledger| &ledger.quads, record);
    }
}

#[test]
fn an_overrun_comes_before_a_loop_that_does_not_end() {
    let mut scene = busy();
    scene.source = scene.source.replace("i >= 6.0 * v.c.y", "i < 0.0 && v.c.y > 0.0");
    let turns = scene.limits.work_loop_turns;
    scene.limits.work_loop_turns = turns.with(1 << 12);
    let text = drawn(&scene, USUAL).expect_err("no end");
    assert!(text.contains("a loop ran 4096 times without an end") && text.contains("work.loop_turns"), "{text}");
    scene.limits.work_loop_turns = turns;
    scene.limits.work_steps = scene.limits.work_steps.with(3 << 16);
    for threads in [1, 2, 8] {
        let text = drawn(&scene, How { threads, ..USUAL }).expect_err("no end");
        let wanted = "shader `scene`, entry point `fs`: more than 196608 shader steps, the limit; --limit work.shader_steps=N allows more";
        assert_eq!(text, wanted, "{threads} threads");
    }
}

#[test]
fn recorded_work_is_refused_before_it_fills_the_memory() {
    let mut scene = busy();
    scene.limits.memory_bytes = scene.limits.memory_bytes.with(1 << 20);
    for threads in [1, 2, 8] {
        assert_eq!(drawn(&scene, How { threads, ..USUAL }), Ok(()));
        let text = drawn(&scene, How { threads, record: true, ..USUAL }).expect_err("more than a megabyte");
        assert!(text.contains("--limit memory.bytes=N allows more"), "{text}");
    }
}

/// Three tiles. A loop reads memory in all of them; in the first it does little else, so that it records much and takes few steps.
fn recorded() -> Scene {
    let mut scene = Scene::new(rectangle(ALL, 0.5, RED));
    scene.extent = (192, 64);
    scene.storage = Some(Arc::new(Words::new(64)));
    scene.source = "
        @group(0) @binding(0) var<storage> b: array<f32>;
        @vertex fn vs(@location(0) p: vec4<f32>, @location(1) c: vec4<f32>) -> @builtin(position) vec4<f32> { return p; }
        @fragment fn fs(@builtin(position) p: vec4<f32>) -> @location(0) vec4<f32> {
            var sum = 0.0;
            for (var i = 0u; i < u32(p.y / 8.0) + 20u; i++) {
                sum += b[i & 7u];
                for (var k = 0.0; k < 4.0 && p.x > 64.0; k += 1.0) { sum = sum * 0.5 + k; }
            }
            return vec4(sum);
        }"
    .into();
    scene
}

#[test]
fn of_two_limits_any_number_of_threads_names_the_same() {
    let mut scene = recorded();
    let how = How { record: true, ..USUAL };
    scene.limits.memory_bytes = scene.limits.memory_bytes.with(1 << 30);
    let steps = scene.draw_as(how).ledger.steps.spent();
    scene.limits.memory_bytes = scene.limits.memory_bytes.with(400 << 10);
    // Exactly enough, one less; and what threads together come to sooner than one of them alone.
    for (allowed, name) in [
        (steps, "memory.bytes"),
        (steps - 1, "work.shader_steps"),
        (steps / 2, "work.shader_steps"),
        (steps / 3, "work.shader_steps"),
        (steps / 4, "work.shader_steps"),
        (steps / 5, "work.shader_steps"),
    ] {
        scene.limits.work_steps = scene.limits.work_steps.with(allowed);
        let mut texts = std::collections::BTreeSet::new();
        for threads in [1, 2, 4, 8] {
            texts.insert(drawn(&scene, How { threads, ..how }).expect_err("too much"));
        }
        assert!(texts.len() == 1 && texts.iter().all(|text| text.contains(name)), "{allowed} of {steps} steps: {texts:?}");
    }
}
