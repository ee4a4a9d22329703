//! Draws in halves, with geometry ahead of fragments: what comes out is what comes out of one draw after the other.

use std::panic::{AssertUnwindSafe, catch_unwind};

use super::ways::variety;
use super::*;

/// The scene in draws of `vertices` vertices.
fn cut(scene: &Scene, vertices: u32) -> Scene {
    let n = scene.indices.as_ref().map_or(scene.vertices.len(), Vec::len) as u32;
    let draws = (0..n).step_by(vertices as usize).map(|first| first..n.min(first + vertices)).collect();
    Scene { draws, ..scene.clone() }
}

#[test]
fn halves_of_draws_are_whole_draws() {
    for (name, scene) in variety() {
        // Draws of a side effect are not done in halves.
        if scene.storage.is_some() {
            continue;
        }
        for vertices in [6, 6000] {
            let scene = cut(&scene, vertices);
            let alone = scene.draw_as(How { threads: 1, ..USUAL });
            for threads in [1, 2, 4] {
                let what = format!("in draws of {vertices} vertices on {threads} threads");
                let halves = scene.draw_as(How { threads, ahead: true, ..USUAL });
                same(name, &what, &alone, &halves);
                assert_eq!((alone.drawn, alone.ledger.sums()), (halves.drawn, halves.ledger.sums()), "{name} {what}");
            }
        }
    }
}

/// Draws of several tasks of vertices and batches of primitives, in more rows at a time than there are threads.
#[test]
fn rows_beside_each_other_come_to_their_ends() {
    let scene = cut(&Scene::new(soup(4_000, 8, true)), 3900);
    let alone = scene.draw_as(How { threads: 1, ..USUAL });
    let pipeline = scene.pipeline().expect("a pipeline");
    let pool = rayon::ThreadPoolBuilder::new().num_threads(8).build().expect("threads");
    let rows = pool.install(|| {
        crate::parallel::map(0..40, 1..=1, |_, _| scene.draw_with(&pipeline, How { ahead: true, ..USUAL })).collect::<Vec<_>>()
    });
    for row in rows {
        same("rows", "beside each other", &alone, &row.expect("drawn"));
    }
}

#[test]
fn what_is_too_much_is_refused() {
    let mut scene = cut(&Scene::new(soup(600, 1, true)), 6);
    let pool = rayon::ThreadPoolBuilder::new().num_threads(3).build().expect("threads");
    scene.limits.work_quads = scene.limits.work_quads.with(2000);
    let refused = pool.install(|| scene.draw_here(How { ahead: true, ..USUAL })).err().expect("more than 2,000 quads");
    assert!(refused.contains("work.quads"), "{refused}");
}

#[test]
fn a_panic_in_either_half_ends_the_row() {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(2).build().expect("threads");
    let shape = Shape { format: Format::Rgba8Unorm, width: 8, height: 8, samples: 1 };
    for bad in [0, 7, 40, 99] {
        pool.install(|| {
            let color = vec![Some((TileSurface::new(shape), shape.format))];
            let mut pass = RenderPass::begin(8, 8, 1, color, None);
            let calls = |number: usize, _: &mut dyn FnMut(&DrawCall<'_>)| assert_ne!(number, bad, "no such draw");
            let row = || pass.draw_all(100, &calls, &mut |_, _| true);
            assert!(catch_unwind(AssertUnwindSafe(row)).is_err(), "{bad}");
        });
    }
}
