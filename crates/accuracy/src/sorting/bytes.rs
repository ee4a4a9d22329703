//! Bytes that machines of every sort class send again.

use anyhow::Result;

use super::{Counts, right_triangle, scene_of};
use crate::harness::{config, counts, replay};
use crate::{Row, Section, Setting, Target};
use machine::config::SortClass;
use machine::{Config, SORTING};
use num::Random;
use synthetic::{Scene, events};
use unit::interleave::{Interleave, Pattern};
use unit::sorting::SortCounts;
use work::Event;

pub(super) const SORT_BYTES: Target = Target {
    id: "sort-bytes",
    section: Section::Sorting,
    what: "What is sent again on N = 1 to 64 pipelines: sort-first, a primitive for each copy; sort-middle, overlap x displayed \
           primitives; sort-last sparse, shaded quads, whatever N is. Of it (N - 1)/N leaves its own pipeline where routing is uniform \
           (sort-last full: see compositing)",
    bound: "exact; 1/64 of the share where 64 tiles cannot be dealt evenly",
    fault: "the first triangle is lost on its way to the machine",
    check,
};

/// The edge of the tiles that are dealt to pipelines.
const TILE: u32 = 16;

fn machine(class: SortClass, pipelines: u32, more: &[&str]) -> Result<Config> {
    let (pipelines, tile) = (format!("pipelines={pipelines}"), format!("distribute.tile={TILE}"));
    // The formulas are those of primitives that one pipeline draws each.
    let changes =
        [&["memory.kind=ideal", "distribute.pattern=morton", "assembly.by_size=false", &tile, &pipelines], more].concat();
    config(class.name(), &changes)
}

/// What a scene has to be sorted.
#[derive(Default)]
struct Sorted {
    /// Triangles that cover a sample.
    displayed: f64,
    /// Pipelines of each of them, in all.
    copies: f64,
    quads: f64,
}

/// Counts, in the work itself, the pipelines that own blocks of each triangle.
fn sorted(events: &[Event], interleave: &Interleave) -> Sorted {
    let mut sorted = Sorted::default();
    for event in events {
        let Event::Segment(segment) = event else { continue };
        sorted.quads += segment.tiles.iter().map(|tile| tile.quads.len()).sum::<usize>() as f64;
        for triangle in &segment.triangles {
            let visits = &segment.visits[triangle.first_visit as usize..][..triangle.visits as usize];
            let blocks = visits.iter().flat_map(|visit| {
                &segment.tiles[visit.tile as usize].blocks[visit.first_block as usize..][..visit.blocks as usize]
            });
            let owners: u64 = blocks.fold(0, |mask, block| mask | 1 << interleave.owner(block.x.into(), block.y.into()));
            sorted.displayed += f64::from(u8::from(owners != 0));
            sorted.copies += f64::from(owners.count_ones());
        }
    }
    sorted
}

/// The classes, with how many bytes an item has: three numbers of vertices and a mark, or three vertices of 32 bytes; a transformed
/// triangle; a quad with what its shader has written.
const CLASSES: [(SortClass, &str, &[&str], f64); 4] = [
    (SortClass::First, "sort-first, retained", &[], 16.0),
    (SortClass::First, "sort-first, immediate", &["route.mode=immediate"], 100.0),
    (SortClass::Middle, "sort-middle", &[], 144.0),
    (SortClass::LastFragment, "sort-last, sparse", &[], 40.0),
];

fn check(setting: &Setting) -> Result<Vec<Row>> {
    let numbers: &[u32] = setting.pick(&[1, 3, 8, 64], &[1, 2, 3, 5, 8, 16, 31, 32, 64], &[1, 2, 3, 5, 8, 16, 31, 32, 64]);
    let (edge, triangles) = (setting.pick(128, 128, 256), setting.pick(20, 40, 400));
    let mut random = Random::new(setting.seed);
    let shapes: Vec<_> = (0..triangles)
        .map(|_| {
            let [x, y] = [random.unit(), random.unit()].map(|at| edge as f32 * at);
            std::array::from_fn(|_| [x + random.range(-25.0, 25.0), y + random.range(-25.0, 25.0)])
        })
        .collect();
    let scene = scene_of(edge, edge, shapes);
    let mut given = scene.clone();
    if setting.inject_fault {
        given.shapes[0] = [[0.0; 2]; 3];
    }
    let work = events(&Scene { covered: true, ..scene });
    let mut rows = Vec::new();
    for (class, name, more, bytes) in CLASSES {
        let fragments = class == SortClass::LastFragment;
        let [mut primitives, mut items, mut sent] = [(); 3].map(|()| Counts::default());
        for &pipelines in numbers {
            let sorted = sorted(&work, &Interleave::new(Pattern::Morton, pipelines, TILE));
            let total = replay(&machine(class, pipelines, more)?, &given)?.total;
            let expected = if fragments { sorted.quads } else { sorted.copies };
            let sorting: SortCounts = counts(&total, SORTING)?;
            items.add(expected, sorting.redistributed_items as f64);
            sent.add(bytes * expected, sorting.redistributed_bytes as f64);
            if !fragments {
                primitives.add(sorted.displayed, sorting.sent as f64);
            }
        }
        if !fragments {
            rows.push(primitives.row(format!("{name}: primitives sent, all N")));
        }
        rows.push(items.row(format!("{name}: {} sent, all N", if fragments { "quads" } else { "copies" })));
        rows.push(sent.row(format!("{name}: bytes sent, all N")));
    }
    uniform(numbers, &mut rows)?;
    Ok(rows)
}

/// Work that every pipeline owns as much of as any other: of N copies, or of N quads, one stays in its own pipeline.
fn uniform(numbers: &[u32], rows: &mut Vec<Row>) -> Result<()> {
    let scene = scene_of(128, 128, vec![right_triangle(0.0, 0.0, 300.0, 300.0); 4]);
    for class in [SortClass::First, SortClass::Middle, SortClass::LastFragment] {
        let [mut items, mut bytes] = [(); 2].map(|()| Counts::default());
        let mut uneven: f64 = 0.0;
        for &pipelines in numbers {
            // A batch is a primitive, so that all geometry takes part.
            let total = replay(&machine(class, pipelines, &["assembly.batch=1"])?, &scene)?.total;
            let n = f64::from(pipelines);
            let sorting: SortCounts = counts(&total, SORTING)?;
            let (all, foreign) = (sorting.redistributed_items as f64, sorting.foreign_items as f64);
            if class != SortClass::LastFragment || pipelines.is_power_of_two() {
                items.add((n - 1.0) * all, n * foreign);
                bytes.add((n - 1.0) * sorting.redistributed_bytes as f64, n * sorting.foreign_bytes as f64);
            } else {
                uneven = uneven.max((foreign / all - (n - 1.0) / n).abs());
            }
        }
        let name = class.name();
        rows.push(items.row(format!("{name}, uniform: N x items that leave, all N")));
        rows.push(bytes.row(format!("{name}, uniform: N x bytes that leave, all N")));
        if class == SortClass::LastFragment {
            rows.push(Row::at_most(format!("{name}, uneven N: share that leaves off (N - 1)/N"), uneven, 1.0 / 64.0));
        }
    }
    Ok(())
}
