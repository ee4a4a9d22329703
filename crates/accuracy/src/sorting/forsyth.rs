//! A sphere in an order made for vertex caches, and what a machine's reuse makes of it.

use std::collections::BTreeMap;

use anyhow::{Result, ensure};

use super::reuse::shaded;
use crate::{Row, Section, Setting, Target};
use num::Random;

pub(super) const FORSYTH: Target = Target {
    id: "forsyth",
    section: Section::Sorting,
    what: "Vertices shaded per triangle of a sphere (an icosahedron, 32 splits per edge, 20,480 triangles) in Forsyth's order (2006), the \
           last 12, 16, 20, 24, 28, 32, 1024 remembered, first in first out: the published .740 .715 .702 .691 .681 .672 .529",
    bound: "3 %",
    fault: "triangles come as the sphere is built",
    check,
};

/// Vertices remembered, and the published figures.
const PUBLISHED: [(u32, f64); 7] =
    [(12, 0.740), (16, 0.715), (20, 0.702), (24, 0.691), (28, 0.681), (32, 0.672), (1024, 0.529)];

/// Corners of the faces of an icosahedron.
const ICOSAHEDRON: [[u32; 3]; 20] = [
    [0, 1, 2],
    [0, 2, 3],
    [0, 3, 4],
    [0, 4, 5],
    [0, 5, 1],
    [1, 6, 2],
    [2, 7, 3],
    [3, 8, 4],
    [4, 9, 5],
    [5, 10, 1],
    [6, 7, 2],
    [7, 8, 3],
    [8, 9, 4],
    [9, 10, 5],
    [10, 6, 1],
    [11, 7, 6],
    [11, 8, 7],
    [11, 9, 8],
    [11, 10, 9],
    [11, 6, 10],
];

/// The triangles of an icosahedron with each edge split into `splits` parts, face by face, row by row. Vertices of an edge belong to both
/// faces: each is named by the corners that it lies between, and how near to them.
fn sphere(splits: u32) -> Vec<[u32; 3]> {
    let mut names = BTreeMap::new();
    let mut triangles = Vec::new();
    for face in ICOSAHEDRON {
        let mut vertex = |x: u32, y: u32| {
            let mut name: Vec<(u32, u32)> =
                face.into_iter().zip([splits - x - y, x, y]).filter(|&(_, share)| share > 0).collect();
            name.sort_unstable();
            let next = names.len() as u32;
            *names.entry(name).or_insert(next)
        };
        for y in 0..splits {
            for x in 0..splits - y {
                triangles.push([vertex(x, y), vertex(x + 1, y), vertex(x, y + 1)]);
                if x + y + 1 < splits {
                    triangles.push([vertex(x + 1, y), vertex(x + 1, y + 1), vertex(x, y + 1)]);
                }
            }
        }
    }
    triangles
}

/// The vertices that the order is made for.
const CACHE: usize = 32;

/// Forsyth's score of a vertex: by its place in a cache of the least recently used, and by how few triangles it still has to serve.
fn score(place: Option<usize>, left: usize) -> f32 {
    if left == 0 {
        return -1.0;
    }
    let recent = match place {
        None => 0.0,
        // Those of the last triangle, whichever of them it is: else strips would be favoured.
        Some(0..3) => 0.75,
        Some(place) => {
            let x = 1.0 - (place - 3) as f32 / (CACHE - 3) as f32;
            // To the power of 1.5.
            x * x.sqrt()
        }
    };
    recent + 2.0 / (left as f32).sqrt()
}

/// Triangles in Forsyth's order, "Linear-Speed Vertex Cache Optimisation", with its constants.
fn ordered(triangles: &[[u32; 3]]) -> Vec<[u32; 3]> {
    let vertices = triangles.iter().flatten().max().map_or(0, |&last| last as usize + 1);
    let mut users: Vec<Vec<usize>> = vec![Vec::new(); vertices];
    for (number, triangle) in triangles.iter().enumerate() {
        triangle.iter().for_each(|&vertex| users[vertex as usize].push(number));
    }
    let mut scores: Vec<f32> = users.iter().map(|users| score(None, users.len())).collect();
    let total = |scores: &[f32], number: usize| -> f32 { triangles[number].iter().map(|&v| scores[v as usize]).sum() };
    let mut drawn = vec![false; triangles.len()];
    let mut cache: Vec<u32> = Vec::new();
    let mut out = Vec::with_capacity(triangles.len());
    let mut best: Option<usize> = None;
    while out.len() < triangles.len() {
        // Where nothing that is left touches the cache, all of it is looked at.
        let number = best.take().unwrap_or_else(|| {
            let left = (0..triangles.len()).filter(|&number| !drawn[number]);
            left.reduce(|a, b| if total(&scores, b) > total(&scores, a) { b } else { a }).unwrap_or(0)
        });
        drawn[number] = true;
        let triangle = triangles[number];
        out.push(triangle);
        for vertex in triangle {
            users[vertex as usize].retain(|&user| user != number);
        }
        cache.retain(|vertex| !triangle.contains(vertex));
        cache.splice(0..0, triangle);
        for (place, &vertex) in cache.iter().enumerate() {
            scores[vertex as usize] = score((place < CACHE).then_some(place), users[vertex as usize].len());
        }
        cache.truncate(CACHE);
        let mut most = f32::MIN;
        for &user in cache.iter().flat_map(|&vertex| &users[vertex as usize]) {
            let total = total(&scores, user);
            if total > most {
                (best, most) = (Some(user), total);
            }
        }
    }
    out
}

fn check(setting: &Setting) -> Result<Vec<Row>> {
    let mut sphere = sphere(32);
    ensure!(sphere.len() == 20_480, "a sphere of {} triangles", sphere.len());
    // Which way a triangle is turned, and which of them comes first, is not said: it must not matter.
    let mut random = Random::new(setting.seed);
    let start = random.below(sphere.len() as u32) as usize;
    sphere.rotate_left(start);
    let triangles = if setting.inject_fault { sphere } else { ordered(&sphere) };
    let figures: &[(u32, f64)] = setting.pick(&PUBLISHED[2..5], &PUBLISHED, &PUBLISHED);
    figures
        .iter()
        .map(|&(reuse, expected)| {
            let measured = shaded(&triangles, reuse)? / triangles.len() as f64;
            Ok(Row::within(format!("{reuse} remembered"), expected, measured, 0.03 * expected))
        })
        .collect()
}
