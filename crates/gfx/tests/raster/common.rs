//! What the rasterisation tests share: plain state, and an image of hit counts.

use gfx::setup::{Bounds, DepthBias, SetupState, Triangle};
use gfx::state::{CullMode, FrontFace};
use gfx::traverse;

/// Setup state that draws everything in a rectangle of pixels.
pub fn state(samples: u32, [x0, y0, x1, y1]: [i32; 4]) -> SetupState {
    SetupState {
        bounds: Bounds { x0: x0 as u16, y0: y0 as u16, x1: x1 as u16, y1: y1 as u16 },
        depth_range: [0.0, 1.0],
        bias: DepthBias::NONE,
        front_face: FrontFace::Ccw,
        cull: CullMode::None,
        samples,
        lower_edges: false,
        unclipped_depth: false,
        half_width: None,
    }
}

/// How often each sample of a rectangle of pixels was hit.
pub struct Image {
    window: [i32; 4],
    hits: Vec<u32>,
}

impl Image {
    pub fn new(window: [i32; 4]) -> Image {
        let n = (window[2] - window[0]) * (window[3] - window[1]) * 4;
        Image { window, hits: vec![0; n as usize] }
    }

    fn index(&self, x: i32, y: i32, sample: usize) -> usize {
        let [x0, y0, x1, y1] = self.window;
        assert!(x >= x0 && y >= y0 && x < x1 && y < y1, "pixel {x} {y} outside the scissor {:?}", self.window);
        ((y - y0) * (x1 - x0) + x - x0) as usize * 4 + sample
    }

    pub fn hits(&self, x: i32, y: i32, sample: usize) -> u32 {
        self.hits[self.index(x, y, sample)]
    }

    pub fn total(&self) -> u32 {
        self.hits.iter().sum()
    }

    /// Draws a primitive tile by tile, as a renderer would, and checks the order and form of what traversal yields.
    pub fn draw<const S: usize>(&mut self, primitive: &Triangle) {
        let b = primitive.bounds;
        assert!(!b.is_empty());
        for ty in (b.y0 / 64..=(b.y1 - 1) / 64).map(|t| t * 64) {
            for tx in (b.x0 / 64..=(b.x1 - 1) / 64).map(|t| t * 64) {
                let mut last = None;
                traverse::blocks::<S>(primitive, Bounds { x0: tx, y0: ty, x1: tx + 64, y1: ty + 64 }, |block| {
                    assert!(block.x % 8 == 0 && block.y % 8 == 0 && block.pixels() != 0);
                    assert_eq!(block.full, block.samples.iter().all(|&m| m == !0));
                    assert!(last < Some((block.y, block.x)), "blocks out of order");
                    last = Some((block.y, block.x));
                    for quad in block.quads() {
                        assert!(quad.mask != 0);
                        for s in 0..S {
                            for p in 0..4 {
                                if quad.mask >> (4 * s + p) & 1 == 1 {
                                    let (x, y) = (i32::from(quad.x) + (p as i32 & 1), i32::from(quad.y) + (p as i32 >> 1));
                                    let i = self.index(x, y, s);
                                    self.hits[i] += 1;
                                }
                            }
                        }
                    }
                });
            }
        }
    }
}
