//! Historical cards compared with their data sheets: peak rates of pixels, texels, triangles and bytes. Each is measured on the model with
//! work that has no other limit.

use std::sync::Arc;

use crate::common::{Figures, run};
use fillrate::gfx::state::Compare;
use fillrate::machine::Config;
use fillrate::sim::Clock;
use fillrate::synthetic::{Scene, events};
use fillrate::work::*;

fn scene(side: u32, shapes: Vec<[[f32; 2]; 3]>, textures: u32) -> Scene {
    Scene {
        width: side,
        height: side,
        draws: 1,
        segments: shapes.len().div_ceil(256) as u32,
        triangles: shapes.len() as u32,
        depth_format: None,
        compare: Compare::Always,
        instructions: 1,
        textures,
        shapes,
        ..Scene::default()
    }
}

fn right_triangle(x: f32, y: f32, legs: f32) -> [[f32; 2]; 3] {
    [[x, y], [x + legs, y], [x, y + legs]]
}

/// Layers that cover the screen.
fn layers(side: u32, count: usize, textures: u32) -> Scene {
    scene(side, vec![right_triangle(0.0, 0.0, 2.0 * side as f32); count], textures)
}

/// A statistic and the cycles of a run. All texture requests read the same lines.
fn measured(config: &Config, scene: &Scene, figure: &str) -> (f64, f64) {
    let mut work = events(scene);
    for event in &mut work {
        let Event::Segment(segment) = event else { continue };
        Arc::make_mut(segment).tiles.iter_mut().flat_map(|tile| &mut tile.invocations.lines).for_each(|line| *line = 1 << 20);
    }
    let report = run(config, &work, Clock::SkipIdle);
    let f = Figures(&report.total);
    (f.at(figure) as f64, f.at("cycles") as f64)
}

/// A rate a second between a small and a large run, of each a statistic and the cycles: beginnings and ends are the same in both.
fn per_second(config: &Config, (less, before): (f64, f64), (more, after): (f64, f64)) -> f64 {
    (more - less) / (after - before) * f64::from(config.card.clock_mhz) * 1e6
}

/// The rate of a statistic a second.
fn rate(config: &Config, small: &Scene, large: &Scene, figure: &str) -> f64 {
    per_second(config, measured(config, small, figure), measured(config, large, figure))
}

/// Prints the measured value and that of the data sheet, and asserts that they differ by at most this share.
fn near(card: &str, what: &str, measured: f64, sheet: f64, share: f64) {
    let off = measured / sheet - 1.0;
    println!("{card}: {what} {:.4} of {:.4} billion/s, {:+.1} %", measured / 1e9, sheet / 1e9, 100.0 * off);
    assert!(off.abs() <= share, "{card}: {what} {measured:e} and not {sheet:e}");
}

/// Pixels, and texels with this number of textures.
fn fill(card: &str, side: u32, textures: u32, [pixels, texels]: [f64; 2]) {
    let config = Config::built_in(card).unwrap();
    let layers = |count, textures| layers(side, count, textures);
    let written = "funnel.fragments_written";
    near(card, "pixels", rate(&config, &layers(2, 0), &layers(10, 0), written), pixels, 0.05);
    let textured = rate(&config, &layers(4, textures), &layers(20, textures), written);
    near(card, "texels", f64::from(textures) * textured, texels, 0.05);
}

/// A dispatch of a number of workgroups of 64 invocations, each four of which load a line of their own, one after the other in memory.
fn loads(groups: u32) -> Vec<Event> {
    let shape = ShaderShape { registers: 16, inputs: 0, outputs: 0 };
    let dispatch = Dispatch {
        number: 0,
        label: String::new(),
        shape,
        groups: groups.into(),
        invocations: 64,
        shared_bytes: 0,
        reach: Reach::default(),
        programs: Programs::default(),
    };
    let step = |then| Step::dependent([1, 1, 0, 0, 0], then);
    let costs = CostTable::from(vec![Cost::from(vec![step(RequestKind::Load), step(RequestKind::End)])]);
    let lines = groups * 16;
    let work = Groups {
        groups,
        packets: (0..lines).map(|n| Packet { cost: 0, first_request: n, first_shared: 0 }).collect(),
        invocations: Invocations {
            costs,
            requests: (0..lines).map(|n| Request { first_line: n, lines: 1, operations: 4, ..Request::default() }).collect(),
            lines: (0..lines).map(|n| (1 << 20) + n).collect(),
        },
        ..Groups::default()
    };
    vec![Event::Dispatch(Arc::new(dispatch)), Event::Groups(Arc::new(work))]
}

/// Bytes per second that a stream of loads reads.
fn bytes(config: &Config) -> f64 {
    let of = |groups| {
        let report = run(config, &loads(groups), Clock::SkipIdle);
        let f = Figures(&report.total);
        (f.at("memory.dram.read_bytes") as f64, f.at("cycles") as f64)
    };
    per_second(config, of(1000), of(6000))
}

/// Multiplications and additions per second of workgroups of 256 invocations, each of which has eight chains of multiply-adds.
fn operations(config: &Config) -> f64 {
    let (groups, chain) = (2_000, 64);
    let of = |chain: u32| {
        let instructions = [8 * chain, 0, 0, 0, 0];
        let step = Step { chain: [chain, 0, 0, 0, 0], ..Step::dependent(instructions, RequestKind::End) };
        let shape = ShaderShape { registers: 16, inputs: 0, outputs: 0 };
        let dispatch = Dispatch {
            number: 0,
            label: String::new(),
            shape,
            groups: groups.into(),
            invocations: 256,
            shared_bytes: 0,
            reach: Reach::default(),
            programs: Programs::default(),
        };
        let costs = CostTable::from(vec![Cost::from(vec![step])]);
        let packets = vec![Packet { cost: 0, first_request: 0, first_shared: 0 }; 64 * groups as usize];
        let work = Groups { groups, invocations: costs.into(), packets, ..Groups::default() };
        let report = run(config, &[Event::Dispatch(Arc::new(dispatch)), Event::Groups(Arc::new(work))], Clock::SkipIdle);
        let f = Figures(&report.total);
        ((f.sum("shading.core", "float") * 2 * u64::from(config.core.warp_width)) as f64, f.at("cycles") as f64)
    };
    per_second(config, of(chain), of(3 * chain))
}

/// Triangles of three pixels in one quad, one after the other in the tiles of a row. Draws have the same vertices, so that they come
/// from the vertex cache but for the first.
fn triangles(card: &str, tiles: u32, count: u32) -> f64 {
    let config = Config::built_in(card).unwrap();
    let side = 16 * tiles;
    let place = |n: u32| right_triangle((n % tiles * 16 + n / tiles % 8 * 2) as f32, (n / tiles / 8 * 2 % side) as f32, 2.5);
    let draws = |draws| Scene { draws, segments: 1, ..scene(side, (0..count).map(place).collect(), 0) };
    rate(&config, &draws(2), &draws(6), "funnel.triangles_setup")
}

#[test]
fn geforce_2_ultra() {
    let card = "geforce2-ultra";
    // 4 pixels x 250 MHz, 2 textures each, a triangle every 8 cycles, 32 bytes x 230 MHz. The screen is as large as the colour cache: the
    // model reads a block before it writes it, and 8 bytes per pixel would be more than the memory moves.
    fill(card, 64, 2, [1.0e9, 2.0e9]);
    near(card, "triangles", triangles(card, 4, 1000), 31.0e6, 0.05);
    near(card, "bytes", bytes(&Config::built_in(card).unwrap()), 7.36e9, 0.05);
}

#[test]
fn gtx_titan() {
    let card = "gtx-titan";
    // 5 raster engines x 8 pixels x 837 MHz, 224 texture units, 5 raster engines x a triangle, 48 bytes x 6.008 GHz.
    fill(card, 160, 8, [33.48e9, 187.5e9]);
    near(card, "triangles", triangles(card, 5, 8000), 4.185e9, 0.06);
    // 2,688 lanes that multiply and add: 4.50 TFLOPS.
    near(card, "operations of a stream of multiply-adds", operations(&Config::built_in(card).unwrap()), 4.50e12, 0.06);
    // The data sheet gives the rate of the pins. Refresh takes a share of it, as on real boards; without refresh it is reached.
    let mut config = Config::built_in(card).unwrap();
    near(card, "bytes", bytes(&config), 288.4e9, 0.08);
    config.set("memory.dram.t_refi=0").unwrap();
    near(card, "bytes without refresh", bytes(&config), 288.4e9, 0.05);
}
