//! Checks for any bits as a primitive, for the property tests and the fuzz target: clipping, setup and traversal give finite numbers
//! inside their bounds, and no primitive hits a sample twice.

use std::collections::HashSet;

use fillrate::gfx::clip::{ClipVolume, Clipped, Polygon};
use fillrate::gfx::setup::{self, Bounds, DepthBias, Screen, ScreenVertex, SetupState, Triangle};
use fillrate::gfx::simd;
use fillrate::gfx::state::{CullMode, FrontFace, Rect, Viewport};
use fillrate::gfx::traverse::Blocks;

/// Edge of the target.
const SIZE: u32 = 128;

/// Takes numbers from bytes; zeros when they are used up.
struct Bytes<'a>(&'a [u8]);

impl Bytes<'_> {
    fn byte(&mut self) -> u8 {
        let (first, rest) = self.0.split_first().unwrap_or((&0, &[]));
        self.0 = rest;
        *first
    }

    fn word(&mut self) -> u32 {
        u32::from_le_bytes([self.byte(), self.byte(), self.byte(), self.byte()])
    }

    /// Any bits, or (as any bits are mostly huge) a number near the view volume, on the sub-pixel grid or not.
    fn coordinate(&mut self, how: u8) -> f32 {
        let bits = self.word();
        match how {
            0 => f32::from_bits(bits),
            1 => (bits % 1024) as f32 / 256.0 - 2.0,
            _ => (f64::from(bits) / f64::from(1u32 << 30) - 2.0) as f32,
        }
    }
}

pub fn draw_everything(data: &[u8]) {
    let mut bytes = Bytes(data);
    let flags = bytes.byte();
    let how = bytes.byte();
    let samples = if flags & 1 == 0 { 1 } else { 4 };
    let pick = |b: bool, x, y| if b { x } else { y };
    let near = f32::from(bytes.byte()) / 255.0;
    let viewport = Viewport {
        x: f32::from(bytes.byte()) - 64.0,
        y: f32::from(bytes.byte()) * 0.5 - 32.0,
        width: f32::from(bytes.byte()) * 1.25,
        height: f32::from(bytes.byte()),
        min_depth: near,
        max_depth: 1.0 - near * 0.5,
    };
    let scissor = Rect { x: u32::from(bytes.byte()) / 8, y: u32::from(bytes.byte()) / 8, width: 100, height: 90 };
    let front = pick(flags & 2 == 0, FrontFace::Ccw, FrontFace::Cw);
    let cull = [CullMode::None, CullMode::Back, CullMode::Front][usize::from(flags >> 2 & 3) % 3];
    let state = SetupState::new((SIZE, SIZE), &viewport, scissor, front, cull, samples, DepthBias::NONE);
    let volume = ClipVolume::new(&viewport, flags & 16 != 0);
    let screen = Screen::new(&viewport);
    let corners = 3 - usize::from(flags >> 5 & 3).min(2);
    let mut position = [[0.0f32; 4]; 3];
    for p in position.iter_mut().take(corners) {
        for (c, x) in p.iter_mut().enumerate() {
            *x = bytes.coordinate(how >> (2 * c) & 3);
        }
    }
    let codes = position.map(|p| volume.outcode(p));
    let mut polygon = Polygon::EMPTY;
    let clipped = match corners {
        3 => volume.triangle(&position, codes, &mut polygon),
        2 => volume.line(&[position[0], position[1]], [codes[0], codes[1]], &mut polygon),
        _ if volume.point(codes[0]) => Clipped::Whole,
        _ => Clipped::Rejected,
    };
    let vertices: Vec<ScreenVertex> = match clipped {
        Clipped::Rejected => return,
        Clipped::Whole => position[..corners].iter().map(|&p| screen.vertex(p)).collect(),
        Clipped::Cut => {
            for v in polygon.vertices() {
                assert!(v.position.iter().all(|x| x.is_finite()) && v.position[3] > 0.0, "{v:?}");
                let sum: f32 = v.weights.iter().sum();
                assert!((sum - 1.0).abs() < 1e-3 && v.weights.iter().all(|w| (-1e-3..=1.001).contains(w)), "{v:?}");
            }
            polygon.vertices().iter().map(|v| screen.clipped(v)).collect()
        }
    };
    // Snapping may make the outline of a cut sliver cross itself; its triangles are then more than the outline, and may overlap.
    let area = |[a, b, c]: [usize; 3]| {
        let p = |i: usize| [i64::from(vertices[i].x), i64::from(vertices[i].y)];
        let ([ax, ay], [bx, by], [cx, cy]) = (p(a), p(b), p(c));
        (bx - ax) * (cy - ay) - (cx - ax) * (by - ay)
    };
    let outline: i64 = (2..vertices.len()).map(|i| area([0, i - 1, i])).sum();
    let simple = corners != 3 || setup::fan(&vertices).map(|t| area(t).abs()).sum::<i64>() == outline.abs();
    let primitives: Vec<Triangle> = match corners {
        3 => setup::fan(&vertices).filter_map(|t| setup::triangle(&state, &t.map(|i| vertices[i])).ok()).collect(),
        2 => setup::line(&state, &[vertices[0], vertices[1]], true).into_iter().collect(),
        _ => setup::point(&state, &vertices[0], true).into_iter().collect(),
    };
    let mut hits = HashSet::new();
    for primitive in &primitives {
        if !simple {
            hits.clear();
        }
        match samples {
            1 => walk::<1>(&state, primitive, &mut hits),
            _ => walk::<4>(&state, primitive, &mut hits),
        }
    }
}

fn walk<const S: usize>(state: &SetupState, primitive: &Triangle, hits: &mut HashSet<(u16, u16, usize)>) {
    let allowed = state.bounds;
    for tile in 0..(SIZE / 64).pow(2) as u16 {
        let (x0, y0) = (tile % 2 * 64, tile / 2 * 64);
        let area = Bounds { x0, y0, x1: x0 + 64, y1: y0 + 64 };
        let (mut one_way, mut other) = (Blocks::<S>::new(), Blocks::<S>::new());
        one_way.find(primitive, area);
        other.find_with(simd::base(), primitive, area);
        assert_eq!(one_way[..], other[..], "instruction sets differ");
        for block in one_way.iter() {
            for quad in block.quads() {
                for bit in 0..4 * S {
                    if quad.mask >> bit & 1 == 0 {
                        continue;
                    }
                    let (x, y) = (quad.x + (bit as u16 & 1), quad.y + (bit as u16 >> 1 & 1));
                    assert!(
                        (allowed.x0..allowed.x1).contains(&x) && (allowed.y0..allowed.y1).contains(&y),
                        "{x}, {y} of {allowed:?}"
                    );
                    assert!(hits.insert((x, y, bit / 4)), "sample {} of {x}, {y} is hit twice", bit / 4);
                    let depth = primitive.depth.at(f32::from(x) + 0.5, f32::from(y) + 0.5);
                    assert!(!depth.is_nan(), "depth at {x}, {y}");
                }
            }
        }
    }
}
