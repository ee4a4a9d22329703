//! What sorting costs by the literature's formulae, against the machines' own counters: overlap of triangles and tiles (Molnar et al.
//! 1994), bytes that are sent again, and the peak of the slow-down by overlap (Chen et al. 1998).

mod machine_common;

use fillrate::accuracy::Random;
use fillrate::accuracy::synthetic::{Scene, events};
use fillrate::gfx::state::Compare;
use fillrate::machine::{Config, MachineReport};
use fillrate::sim::Clock;
use fillrate::unit::interleave::{Interleave, Pattern};
use fillrate::work::{Event, Segment, Shade};
use machine_common::{Figures, config, run};

/// A scene of these triangles, drawn without depth.
fn scene_of(width: u32, height: u32, shapes: Vec<[[f32; 2]; 3]>) -> Scene {
    Scene {
        width,
        height,
        draws: 1,
        segments: shapes.len().div_ceil(256) as u32,
        triangles: shapes.len() as u32,
        depth_format: None,
        compare: Compare::Always,
        textures: 0,
        instructions: 1,
        shapes,
        ..Scene::default()
    }
}

/// A run of a scene as a machine of this configuration wants it rendered.
fn replay(config: &Config, scene: &Scene) -> MachineReport {
    let covered = config.render_key().shade == Shade::Covered;
    run(config, &events(&Scene { covered, ..scene.clone() }), Clock::SkipIdle)
}

fn right_triangle(x: f32, y: f32, w: f32, h: f32) -> [[f32; 2]; 3] {
    [[x, y], [x + w, y], [x, y + h]]
}

/// Entries in lists of a machine that bins with tiles of this edge, and triangles in any list.
fn binned(tile: u32, overlap: &str, scene: &Scene) -> (u64, u64) {
    let tile = format!("bin.tile={tile}");
    let overlap = format!("bin.overlap={overlap}");
    let changes = ["pipelines=1", "geometry_units=1", "memory.kind=ideal", "color.cache_blocks=64", &tile, &overlap];
    let report = replay(&config("sort-middle-binned", &changes), scene);
    let f = Figures(&report.total);
    (f.at("sort.redistributed_items"), f.at("sort.sent"))
}

/// A triangle with legs along whole pixels, at every place in a tile: the sum of the tiles that it meets is known to the last. Its
/// samples are the centres of pixels; they span m = legs - 1 pixels, or one less under a hypotenuse that passes through centres.
#[test]
fn overlap_at_every_offset_is_the_formula_to_the_last_tile() {
    for (tile, legs) in [(16_u32, 21_u32), (32, 9)] {
        let offsets = (0..tile).flat_map(|y| (0..tile).map(move |x| (x, y)));
        let shapes = offsets.map(|(x, y)| right_triangle(x as f32, y as f32, legs as f32 + 0.5, legs as f32 + 0.5)).collect();
        let scene = scene_of(80, 80, shapes);
        // Pixel (i, j) of the triangle is in it if i + 1/2 + j + 1/2 < legs + 1/2: they span this many pixels beyond the first.
        let (m, t) = (u64::from(legs - 1), u64::from(tile));
        let (boxes, sent) = binned(tile, "bounding-box", &scene);
        assert_eq!(sent, t * t);
        assert_eq!(boxes, (m + t) * (m + t), "(1 + w/W)(1 + h/H), tiles of {tile}, legs {legs}");
        let (exact, sent) = binned(tile, "exact", &scene);
        assert_eq!(sent, t * t);
        // The box's excess is (wh - A)/(WH), of points with the hypotenuse's own half of a step.
        assert_eq!(exact, (m + t) * (m + t) - m * (m + 1) / 2, "1 + w/W + h/H + A/(WH), tiles of {tile}, legs {legs}");
    }
}

/// The mean and four times its standard error.
fn mean(values: &[f64]) -> (f64, f64) {
    let n = values.len() as f64;
    let mean = values.iter().sum::<f64>() / n;
    let variance = values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / (n - 1.0);
    (mean, 4.0 * (variance / n).sqrt())
}

/// A triangle at random places, also between pixels. A tile meets it where it has the centre of a covered pixel, so tiles of W pixels
/// are intervals of W - 1 between centres, and the triangle's extent counts from centre to centre: w - 1 on average.
#[test]
fn overlap_at_random_offsets_is_the_formula() {
    let mut random = Random::new(11);
    for (tile, w, h) in [(16.0_f32, 40.0_f32, 24.0_f32), (32.0, 20.0, 50.0), (64.0, 70.0, 70.0)] {
        // Batches of triangles, each of which is one value.
        let (mut boxes, mut exact) = (Vec::new(), Vec::new());
        for _ in 0..16 {
            let shapes: Vec<_> = (0..128).map(|_| right_triangle(tile * random.unit(), tile * random.unit(), w, h)).collect();
            let scene = scene_of(144, 144, shapes);
            let of = |overlap: &str| {
                let (copies, sent) = binned(tile as u32, overlap, &scene);
                assert_eq!(sent, 128);
                copies as f64 / sent as f64
            };
            boxes.push(of("bounding-box"));
            exact.push(of("exact"));
        }
        let [tile, w, h] = [tile, w, h].map(f64::from);
        let (measured, error) = mean(&boxes);
        let expected = (1.0 + (w - 1.0) / tile) * (1.0 + (h - 1.0) / tile);
        assert!((measured - expected).abs() < error, "boxes: {measured} and not {expected} +- {error}");
        assert!(error < 0.05 * expected, "too few to tell: {error}");
        // The formula itself is for tiles that meet any point of the triangle: a bound from above. A triangle that has a centre of
        // a pixel wherever a tile reaches it by more than a pixel is the bound from below.
        let (measured, error) = mean(&exact);
        let formula = |w: f64, h: f64| 1.0 + w / tile + h / tile + w * h / 2.0 / (tile * tile);
        let (low, high) = (formula(w - 3.0, h - 3.0) - error, formula(w, h) + error);
        assert!((low..high).contains(&measured), "exact: {measured} is not in {low}..{high}");
    }
}

/// The pipelines that own blocks of each triangle, of so many.
fn owners(events: &[Event], interleave: &Interleave) -> Vec<u64> {
    let mut masks = Vec::new();
    for event in events {
        let Event::Segment(segment) = event else { continue };
        let segment: &Segment = segment;
        for triangle in &segment.triangles {
            let visits = &segment.visits[triangle.first_visit as usize..][..triangle.visits as usize];
            let blocks = visits.iter().flat_map(|visit| {
                &segment.tiles[visit.tile as usize].blocks[visit.first_block as usize..][..visit.blocks as usize]
            });
            masks.push(blocks.fold(0, |mask, block| mask | 1 << interleave.owner(block.x.into(), block.y.into())));
        }
    }
    masks
}

const COUNTS: [u32; 9] = [1, 2, 3, 5, 8, 16, 31, 32, 64];

fn machine(class: &str, pipelines: u32, more: &[&str]) -> Config {
    let pipelines = format!("pipelines={pipelines}");
    let changes = [&["memory.kind=ideal", "distribute.tile=16", "distribute.pattern=morton", &pipelines], more].concat();
    config(class, &changes)
}

#[test]
fn bytes_of_every_class_are_those_of_what_it_sorts() {
    let scene = Scene { width: 128, height: 128, triangles: 40, draws: 1, size: 50.0, depth_format: None, ..Scene::default() };
    for pipelines in COUNTS {
        let interleave = Interleave::new(Pattern::Morton, pipelines, 16);
        let masks = owners(&events(&scene), &interleave);
        let copies: u64 = masks.iter().map(|mask: &u64| u64::from(mask.count_ones())).sum();
        let sent = masks.iter().filter(|&&mask| mask != 0).count() as u64;
        assert!(pipelines == 1 || copies > sent, "nothing to see");

        // Sort-first: three numbers of vertices and a mark for each copy of a primitive, or three vertices of 32 bytes.
        let report = replay(&machine("sort-first", pipelines, &[]), &scene);
        let f = Figures(&report.total);
        assert_eq!((f.at("sort.sent"), f.at("sort.redistributed_items")), (sent, copies), "sort-first, {pipelines}");
        assert_eq!(f.at("sort.redistributed_bytes"), 16 * copies, "sort-first, {pipelines}");
        assert_eq!(f.at("sort.retained_bytes"), 16 * copies);
        assert_eq!(f.at("sort.immediate_bytes"), (4 + 3 * 32) * copies);
        let report = replay(&machine("sort-first", pipelines, &["route.mode=immediate"]), &scene);
        assert_eq!(Figures(&report.total).at("sort.redistributed_bytes"), 100 * copies, "sort-first, immediate, {pipelines}");

        // Sort-middle: a transformed triangle for each copy: the overlap times the triangles to be displayed.
        let report = replay(&machine("sort-middle", pipelines, &[]), &scene);
        let f = Figures(&report.total);
        assert_eq!((f.at("sort.sent"), f.at("sort.redistributed_items")), (sent, copies), "sort-middle, {pipelines}");
        assert_eq!(f.at("sort.redistributed_bytes"), 144 * copies, "sort-middle, {pipelines}");

        // Sort-last, sparse: fragments, that is shaded quads with what their shader has written; no overlap.
        let report = replay(&machine("sort-last-fragment", pipelines, &[]), &scene);
        let f = Figures(&report.total);
        let quads = f.at("funnel.quads_shaded");
        assert_eq!(quads, f.at("funnel.quads_rasterized"));
        assert_eq!(f.at("sort.redistributed_items"), quads, "sort-last, {pipelines}");
        assert_eq!(f.at("sort.redistributed_bytes"), quads * (24 + 4 * 4), "sort-last, {pipelines}");
    }
}

/// Work that every pipeline owns as much of as any other: of N copies, or of N quads, one stays in its own pipeline.
#[test]
fn all_but_an_nth_leaves_its_own_pipeline_where_routing_is_uniform() {
    let whole = right_triangle(0.0, 0.0, 300.0, 300.0);
    let scene = scene_of(128, 128, vec![whole; 4]);
    for pipelines in COUNTS {
        let even = pipelines.is_power_of_two();
        for class in ["sort-first", "sort-middle", "sort-last-fragment"] {
            // A batch is a primitive, so that all geometry takes part.
            let report = replay(&machine(class, pipelines, &["assembly.batch=1"]), &scene);
            let f = Figures(&report.total);
            let n = u64::from(pipelines);
            let (all, foreign) = (f.at("sort.redistributed_items"), f.at("sort.foreign_items"));
            let (bytes, foreign_bytes) = (f.at("sort.redistributed_bytes"), f.at("sort.foreign_bytes"));
            if class != "sort-last-fragment" || even {
                assert_eq!(n * foreign, (n - 1) * all, "{class}, {pipelines}");
                assert_eq!(n * foreign_bytes, (n - 1) * bytes, "{class}, {pipelines}");
            } else {
                // 64 tiles cannot be dealt evenly to an odd number: within a tile more or less for each.
                let share = foreign as f64 / all as f64;
                let expected = (n - 1) as f64 / n as f64;
                assert!((share - expected).abs() <= 1.0 / 64.0, "{class}, {pipelines}: {share} and not {expected}");
            }
        }
    }
}

/// Cycles of so many right triangles with legs of so many pixels at random places, and quads of each.
fn cycles(class: &str, interval: u32, legs: f32) -> (f64, f64) {
    const TRIANGLES: usize = 400;
    let mut random = Random::new(5);
    let shapes = (0..TRIANGLES)
        .map(|_| right_triangle((192.0 - legs) * random.unit(), (192.0 - legs) * random.unit(), legs, legs))
        .collect();
    let scene = scene_of(192, 192, shapes);
    // Nothing but setup and traversal, at one quad a cycle, is to take time.
    let interval = format!("setup.interval={interval}");
    let changes = [
        "pipelines=1",
        "geometry_units=1",
        "memory.kind=ideal",
        "memory.ideal_latency=1",
        "memory.ideal_bytes_per_cycle=65536",
        "memory.port_width=4096",
        "bin.tile=16",
        "bin.triangles_per_cycle=16",
        "bin.entries_per_cycle=64",
        "fetch.indices_per_cycle=32",
        "fetch.lookups_per_cycle=32",
        "traverse.quads_per_cycle=1",
        "traverse.tests_per_cycle=64",
        "traverse.blocks_per_cycle=8",
        "color.quads_per_cycle=16",
        "core.issue=8",
        "scanout.enabled=false",
        &interval,
    ];
    let report = replay(&config(class, &changes), &scene);
    let f = Figures(&report.total);
    (f.at("cycles") as f64, f.at("funnel.quads_rasterized") as f64 / TRIANGLES as f64)
}

/// Tiles make triangles be set up once for each tile. Where setup takes longer than the pixels anyway, that costs more the larger the
/// triangles; where the pixels take longer, setup hides behind them again. In between the slow-down peaks: where both take as long.
#[test]
fn the_slow_down_by_overlap_peaks_where_setup_and_pixels_take_as_long() {
    for interval in [16, 48] {
        let sweep: Vec<(f64, f64)> = [4.0_f32, 6.0, 8.0, 11.0, 16.0, 23.0, 32.0]
            .into_iter()
            .map(|legs| {
                // Both draw the same quads; only the one that bins has tiles.
                let (tiled, _) = cycles("sort-middle-binned", interval, legs);
                let (whole, quads) = cycles("sort-middle", interval, legs);
                // The time of a triangle's pixels by that of its setup, and the slow-down.
                (quads / f64::from(interval), tiled / whole)
            })
            .collect();
        let peak = (0..sweep.len()).max_by(|&a, &b| sweep[a].1.total_cmp(&sweep[b].1)).unwrap();
        assert!((0.5..2.0).contains(&sweep[peak].0), "set-up takes {interval} cycles: {sweep:?}");
        let (first, last) = (sweep[0].1, sweep[sweep.len() - 1].1);
        assert!(sweep[peak].1 > 1.2 * first.max(last), "no peak: {sweep:?}");
    }
}
