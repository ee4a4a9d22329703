//! From clip space or the window to counts of hits, through the stages that the renderer calls.

use gfx::clip::{ClipVolume, Clipped, Polygon};
use gfx::reference::Position;
use gfx::setup::{self, Bounds, DepthBias, Screen, ScreenVertex, SetupState, Triangle};
use gfx::state::{CullMode, FrontFace, Viewport};
use gfx::traverse;

/// A square viewport of `size` by `size` pixels.
pub fn viewport(size: i32) -> Viewport {
    Viewport { x: 0.0, y: 0.0, width: size as f32, height: size as f32, min_depth: 0.0, max_depth: 1.0 }
}

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

/// A vertex in the window with w = 1.
pub fn vertex([x, y]: [i32; 2]) -> ScreenVertex {
    ScreenVertex { x, y, z: 0.5, inv_w: 1.0 }
}

/// Where a vertex is.
pub fn position(v: &ScreenVertex) -> Position {
    [v.x.into(), v.y.into()]
}

/// Turns the rule for samples on one edge around: its function is moved by 1, the least step that it can take.
pub fn flip_rule(triangle: &mut Triangle, edge: usize) {
    let (lower, edge) = (triangle.lower_edges, &mut triangle.edges[edge]);
    edge.c += if edge.owns(lower) { -1 } else { 1 };
}

/// Walks a primitive tile by tile, as the renderer does.
pub fn walk<const S: usize>(primitive: &Triangle, mut visit: impl FnMut(traverse::Block<S>)) {
    let b = primitive.bounds;
    for ty in (b.y0 / 64..=(b.y1 - 1) / 64).map(|t| t * 64) {
        for tx in (b.x0 / 64..=(b.x1 - 1) / 64).map(|t| t * 64) {
            traverse::blocks::<S>(primitive, Bounds { x0: tx, y0: ty, x1: tx + 64, y1: ty + 64 }, &mut visit);
        }
    }
}

/// How often each sample of a rectangle of pixels was hit.
pub struct Image {
    window: [i32; 4],
    samples: usize,
    hits: Vec<i32>,
    /// Of every other triangle the rule for one edge is turned around.
    inject_fault: bool,
    drawn: u32,
    /// Hits outside of the rectangle, and blocks out of order or whose parts contradict each other.
    pub wrong: u64,
}

impl Image {
    /// A window that nothing has hit. With `inject_fault` the rule for one edge of every other triangle is turned around.
    pub fn new(window: [i32; 4], samples: usize, inject_fault: bool) -> Image {
        let pixels = (window[2] - window[0]) * (window[3] - window[1]);
        Image { window, samples, hits: vec![0; pixels as usize * samples], inject_fault, drawn: 0, wrong: 0 }
    }

    /// The rectangle.
    pub fn window(&self) -> [i32; 4] {
        self.window
    }

    /// Hits of a sample in the rectangle.
    pub fn hits(&self, x: i32, y: i32, sample: usize) -> i32 {
        let [x0, y0, x1, _] = self.window;
        self.hits[((y - y0) * (x1 - x0) + x - x0) as usize * self.samples + sample]
    }

    /// All of them: row by row, pixel by pixel, sample after sample.
    pub fn all(&self) -> &[i32] {
        &self.hits
    }

    /// Draws a triangle of the window; each hit counts as `count`.
    pub fn triangle(&mut self, v: &[ScreenVertex; 3], count: impl Fn(&Triangle) -> i32) {
        let Ok(mut triangle) = setup::triangle(&state(self.samples as u32, self.window), v) else { return };
        if self.inject_fault && self.drawn.is_multiple_of(2) {
            flip_rule(&mut triangle, 1);
        }
        self.drawn += 1;
        let count = count(&triangle);
        self.draw(&triangle, count);
    }

    /// Draws what was set up.
    pub fn draw(&mut self, primitive: &Triangle, count: i32) {
        match self.samples {
            1 => self.draw_samples::<1>(primitive, count),
            _ => self.draw_samples::<4>(primitive, count),
        }
    }

    fn draw_samples<const S: usize>(&mut self, primitive: &Triangle, count: i32) {
        let mut last = None;
        walk::<S>(primitive, |block| {
            let tile = (block.y / 64, block.x / 64);
            let place = Some((tile, block.y, block.x));
            let full = block.samples.iter().all(|&m| m == !0);
            self.wrong += u64::from(last >= place) + u64::from(block.full != full) + u64::from(block.pixels() == 0);
            last = place;
            for quad in block.quads() {
                for bit in (0..4 * S).filter(|bit| quad.mask >> bit & 1 == 1) {
                    let (x, y) = (i32::from(quad.x) + (bit as i32 & 1), i32::from(quad.y) + (bit as i32 >> 1 & 1));
                    let [x0, y0, x1, y1] = self.window;
                    if x < x0 || y < y0 || x >= x1 || y >= y1 {
                        self.wrong += 1;
                        continue;
                    }
                    self.hits[((y - y0) * (x1 - x0) + x - x0) as usize * S + bit / 4] += count;
                }
            }
        });
    }

    /// Draws a triangle given in clip space: cut, projected, snapped. `seen` sees the vertices of what is drawn.
    pub fn clip_space(
        &mut self,
        volume: &ClipVolume,
        screen: &Screen,
        position: [[f32; 4]; 3],
        mut seen: impl FnMut(&[ScreenVertex; 3]),
    ) -> Clipped {
        let mut polygon = Polygon::EMPTY;
        let clipped = volume.triangle(&position, position.map(|p| volume.outcode(p)), &mut polygon);
        let mut one = |v: [ScreenVertex; 3]| {
            seen(&v);
            self.triangle(&v, |_| 1);
        };
        match clipped {
            Clipped::Rejected => {}
            Clipped::Whole => one(position.map(|p| screen.vertex(p))),
            Clipped::Cut => {
                let vertices: Vec<ScreenVertex> = polygon.vertices().iter().map(|v| screen.clipped(v)).collect();
                for t in setup::fan(&vertices) {
                    one(t.map(|i| vertices[i]));
                }
            }
        }
        clipped
    }
}
