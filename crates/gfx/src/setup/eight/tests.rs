use super::*;
use crate::setup::{self, DepthBias};
use crate::simd::dispatch;
use crate::state::{CullMode, FrontFace};
use crate::traverse;

#[test]
fn eight_at_once_are_eight_one_by_one() {
    let mut generator = num::Random::new(11);
    let mut random = |n: i32| generator.between(0, n);
    let (mut small, mut covered, mut straddling) = (0, 0, 0);
    for case in 0..6000 {
        let state = SetupState {
            bounds: [Bounds { x0: 3, y0: 5, x1: 250, y1: 201 }, Bounds { x0: 0, y0: 0, x1: 512, y1: 512 }][case % 2],
            depth_range: [[0.0, 1.0], [0.3, 0.6]][case / 2 % 2],
            bias: DepthBias::NONE,
            front_face: [FrontFace::Ccw, FrontFace::Cw][case / 4 % 2],
            cull: CullMode::None,
            samples: 1,
            lower_edges: case / 8 % 2 == 1,
            unclipped_depth: false,
            half_width: None,
        };
        let area = [Bounds { x0: 0, y0: 0, x1: 64, y1: 64 }, Bounds { x0: 192, y0: 128, x1: 250, y1: 192 }][case % 2];
        let mut triangles = [[ScreenVertex::default(); 3]; 8];
        for triangle in &mut triangles {
            loop {
                // About the area, its borders and those of blocks; on samples and between.
                let grid = [1, 64, 128][random(3) as usize];
                let center = [random(70) + i32::from(area.x0) - 3, random(70) + i32::from(area.y0) - 3];
                let size = [300, 900, 1500][random(3) as usize];
                for v in triangle.iter_mut() {
                    *v = ScreenVertex {
                        x: (center[0] * 256 + random(size)) / grid * grid,
                        y: (center[1] * 256 + random(size)) / grid * grid,
                        z: random(1 << 24) as f32 / (1 << 24) as f32,
                        inv_w: 1.0,
                    };
                }
                if let Ok(bounds) = setup::bounds(&state, triangle)
                    && is_small(triangle, &bounds)
                {
                    break;
                }
            }
        }
        let mut eight = Eight::default();
        dispatch!(simd => eight.set_up(simd, &state, &area, &triangles));
        let mut list = [EightQuad(0); 48];
        let n = eight.quads(8, &mut list);
        assert!(list[..n].is_sorted_by_key(|q| q.triangle()));
        let mut number = 0;
        for (i, v) in triangles.iter().enumerate() {
            let expected = setup::triangle(&state, v).unwrap();
            assert_eq!(eight.depth(i), expected.depth, "{v:?}");
            assert_eq!(eight.is_front(i), expected.front, "{v:?}");
            let mut blocks = Vec::new();
            traverse::blocks::<1>(&expected, area, |b| blocks.push(b));
            number += blocks.len();
            let own = list[..n].iter().filter(|q| q.triangle() == i);
            let mut own: Vec<_> = own.map(|q| (eight.pixel(*q), q.in_tile(), q.coverage() as u16)).collect();
            let in_tile = |x: u16, y: u16| u32::from(y % 64 / 8 * 128 + x % 64 / 8 * 16 + y % 8 / 2 * 4 + x % 8 / 2);
            let quads = blocks.iter().flat_map(|b| b.quads()).map(|q| ([q.x, q.y], in_tile(q.x, q.y), q.mask));
            let mut quads: Vec<_> = quads.collect();
            own.sort_unstable();
            quads.sort_unstable();
            assert_eq!(own, quads, "{v:?} in {area:?}");
            assert_eq!(eight.pixels(i).count_ones(), blocks.iter().map(|b| b.pixels().count_ones()).sum::<u32>());
            for quad in list[..n].iter().filter(|q| q.triangle() == i) {
                let [x, y] = eight.pixel(*quad).map(i32::from);
                let depths: [f32; 4] = eight.depths(crate::simd::base(), *quad).into();
                assert_eq!(depths, expected.depth.quad(x, y), "{v:?}");
            }
            small += 1;
            covered += usize::from(!blocks.is_empty());
            straddling += usize::from(blocks.len() > 1);
        }
        assert_eq!(eight.blocks(8) as usize, number);
    }
    assert!(covered > small / 3 && straddling > small / 50, "{small} {covered} {straddling}");
}

#[test]
fn bounds_of_eight_are_those_of_each() {
    let mut generator = num::Random::new(5);
    let mut random = |n: i32| generator.between(0, n);
    let mut outcomes = [0; 6];
    for case in 0..12_000 {
        let state = SetupState {
            bounds: Bounds { x0: 3, y0: 5, x1: 130, y1: 111 },
            depth_range: [0.0, 1.0],
            bias: DepthBias::NONE,
            front_face: [FrontFace::Ccw, FrontFace::Cw][case / 4 % 2],
            cull: [CullMode::None, CullMode::Front, CullMode::Back][case % 3],
            samples: [1, 4][case / 8 % 2],
            lower_edges: case / 16 % 2 == 1,
            unclipped_depth: false,
            half_width: None,
        };
        let triangles: [[ScreenVertex; 3]; 8] = std::array::from_fn(|_| {
            let grid = [1, 64, 128][random(3) as usize];
            let center = [random(150) - 10, random(130) - 10];
            let size = [50, 300, 900, 2000, 20_000, 1 << 22][random(6) as usize];
            std::array::from_fn(|_| ScreenVertex {
                x: (center[0] * 256 + random(size)) / grid * grid,
                y: (center[1] * 256 + random(size)) / grid * grid,
                z: 0.5,
                inv_w: 1.0,
            })
        });
        let eight = dispatch!(simd => EightBounds::find(simd, &state, &triangles));
        for (i, v) in triangles.iter().enumerate() {
            if eight.large >> i & 1 == 1 {
                outcomes[5] += 1;
                continue;
            }
            let expected = setup::bounds(&state, v);
            assert_eq!(eight.get(i), expected, "{v:?}");
            if let Ok(b) = &expected {
                assert_eq!(eight.small >> i & 1 == 1, is_small(v, b), "{v:?}");
            }
            outcomes[match expected {
                Ok(_) => 0,
                Err(Culled::Degenerate) => 1,
                Err(Culled::Face) => 2,
                Err(Culled::NoSample) => 3,
                Err(Culled::Scissor) => 4,
            }] += 1;
        }
    }
    assert!(outcomes.iter().all(|&n| n > 500), "{outcomes:?}");
}
