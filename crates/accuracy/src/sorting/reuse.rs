//! Vertices shaded per triangle, with the last few remembered.

use std::sync::Arc;

use anyhow::Result;

use super::scene_of;
use crate::harness::{config, funnel, run};
use crate::{Row, Section, Setting, Target};
use num::Random;
use synthetic::events;
use work::{Event, Segment, Vertex};

pub(super) const VERTEX_REUSE: Target = Target {
    id: "vertex-reuse",
    section: Section::Sorting,
    what: "Vertices shaded per triangle of a grid of W x W cells, row by row, with the last K remembered, first in first out: (W + 1)/W to \
           K = 2W, (W + 1)^2/(2W^2) from K = 2W + 3 on. In between the order within a cell decides: with (0 1 3)(2 0 3) of its corners \
           1 + 1/W^2 and one vertex more than all, so that 200, 201, 202 on 100 x 100 are 1.0100, 1.0001, 0.5101; with (0 2 1)(1 2 3) \
           all from 2W + 1 on. Triangles in random order come near to 3: two of a vertex are within (K - 1)/3 of each other by chance",
    bound: "exact; 4 standard deviations of the chance",
    fault: "the machine remembers one vertex fewer",
    check,
};

/// The two triangles of a cell, by its corners.
type Cell = [[usize; 3]; 2];

/// Orders in a cell: the first is the published one.
const PUBLISHED: Cell = [[0, 1, 3], [2, 0, 3]];
const STRIPS: Cell = [[0, 2, 1], [1, 2, 3]];

/// The vertices of a grid's triangles, row by row.
fn grid(edge: u32, cell: Cell) -> Vec<[u32; 3]> {
    let mut triangles = Vec::new();
    for y in 0..edge {
        for x in 0..edge {
            let (a, b) = (y * (edge + 1) + x, (y + 1) * (edge + 1) + x);
            let corners = [a, a + 1, b, b + 1];
            triangles.extend(cell.map(|triangle| triangle.map(|corner| corners[corner])));
        }
    }
    triangles
}

/// Vertices that a machine shades of these triangles, which draw nothing.
pub(super) fn shaded(triangles: &[[u32; 3]], reuse: u32) -> Result<f64> {
    let mut scene = scene_of(16, 16, vec![[[0.0; 2]; 3]; triangles.len()]);
    scene.segments = 1;
    let vertices = triangles.iter().flatten().max().map_or(0, |&last| last + 1);
    let work = events(&scene).into_iter().map(|event| {
        let Event::Segment(segment) = event else { return event };
        let mut segment: Segment = segment.as_ref().clone();
        segment.vertices = (0..vertices).map(|index| Vertex { index, instance: 0, cost: 0, first_request: 0 }).collect();
        segment.stream = triangles.iter().flatten().copied().collect();
        for (primitive, &triangle) in segment.primitives.iter_mut().zip(triangles) {
            primitive.vertices = triangle;
        }
        Event::Segment(Arc::new(segment))
    });
    let changes = [
        "pipelines=1",
        "geometry_units=1",
        "memory.kind=ideal",
        "scanout.enabled=false",
        "fetch.reuse_until=replaced",
        &format!("fetch.reuse={reuse}"),
    ];
    Ok(funnel(&run(&config("four-pipelines", &changes)?, work)?.total)?.vertices_shaded as f64)
}

fn check(setting: &Setting) -> Result<Vec<Row>> {
    let edges: &[u32] = setting.pick(&[24], &[40, 100], &[40, 100, 200]);
    let fewer = u32::from(setting.inject_fault);
    let mut rows = Vec::new();
    for &edge in edges {
        let (w, triangles) = (f64::from(edge), f64::from(2 * edge * edge));
        let (all, row_lost) = ((w + 1.0).powi(2), 2.0 * w * (w + 1.0));
        for (name, cell, cases) in [
            (
                "(0 1 3)(2 0 3)",
                PUBLISHED,
                &[
                    (16, row_lost),
                    (2 * edge, row_lost),
                    (2 * edge + 1, triangles + 2.0),
                    (2 * edge + 2, all + 1.0),
                    (2 * edge + 3, all),
                ][..],
            ),
            ("(0 2 1)(1 2 3)", STRIPS, &[(2 * edge, row_lost), (2 * edge + 1, all)]),
        ] {
            for &(reuse, vertices) in cases {
                let measured = shaded(&grid(edge, cell), reuse - fewer)?;
                rows.push(Row {
                    case: format!("{edge} x {edge}, {name}, {reuse} remembered (error: vertices)"),
                    expected: vertices / triangles,
                    measured: measured / triangles,
                    error: (measured - vertices).abs(),
                    allowed: 0.0,
                });
            }
        }
        let mut shuffled = grid(edge, STRIPS);
        Random::new(setting.seed).shuffle(&mut shuffled);
        let reuse = 16;
        // Pairs of triangles at a vertex, in both orders: six inside, three at a border, one and two at the corners.
        let pairs = 30.0 * (w - 1.0).powi(2) + 6.0 * 4.0 * (w - 1.0) + 4.0;
        let met = pairs * f64::from(reuse - 1) / 3.0 / triangles;
        rows.push(Row::within(
            format!("{edge} x {edge}, {reuse} remembered, random order"),
            3.0 - met / triangles,
            shaded(&shuffled, reuse - fewer)? / triangles,
            4.0 * met.sqrt() / triangles,
        ));
    }
    Ok(rows)
}
