//! A segment of a scene: its triangles set up, traversed, tested and shaded in API order.

use crate::{Reference, Scene, cost};
use gfx::format::Format;
use gfx::rop::{ColorState, DepthStencilState};
use gfx::setup::{self, Bounds, SAMPLES_1, SAMPLES_4, ScreenVertex, SetupState};
use gfx::stage::Stage;
use gfx::texel::encode_code;
use gfx::traverse;
use num::Random;
use num::snap;
use work::*;

/// Draws a scene's triangles into its reference and keeps the work.
pub(super) struct SegmentRecorder<'a> {
    pub(super) scene: &'a Scene,
    pub(super) random: &'a mut Random,
    pub(super) reference: &'a mut Reference,
    pub(super) setup: &'a SetupState,
    pub(super) depth: Option<&'a DepthStencilState>,
    pub(super) color: &'a ColorState,
    pub(super) early: bool,
    pub(super) blend: bool,
}

/// What the quads of a triangle have in common.
struct Look {
    tint: [f32; 4],
    plane: setup::DepthPlane,
    back: bool,
}

impl SegmentRecorder<'_> {
    /// The segment of the `count` triangles from number `first` on.
    pub(super) fn segment<const S: usize>(&mut self, count: u32, first: u32) -> Segment {
        let (tiles_x, tiles_y) = (self.scene.width.div_ceil(TILE), self.scene.height.div_ceil(TILE));
        let mut tiles: Vec<TileWork> = Vec::new();
        for y in 0..tiles_y {
            for x in 0..tiles_x {
                let mut costs = CostTable::default();
                costs.costs.push(cost(self.scene, 0));
                costs.costs.push(cost(self.scene, 9));
                tiles.push(TileWork { x: x as u16, y: y as u16, invocations: costs.into(), ..TileWork::default() });
            }
        }
        let mut segment =
            Segment { index_address: Some((1 << 23) + u64::from(first) * 12), index_bytes: 4, ..Segment::default() };
        let cost = Cost::from(vec![Step::dependent([30, 4, 1, 0, 0], RequestKind::End)]);
        segment.invocations[Stage::Vertex] = CostTable::from(vec![cost]).into();
        for t in 0..count {
            // Two new vertices per triangle: the third is shared with the one before.
            let base = if t == 0 { 0 } else { segment.vertices.len() as u32 - 1 };
            while (segment.vertices.len() as u32) < base + 3 {
                let index = first * 2 + segment.vertices.len() as u32;
                segment.vertices.push(Vertex { index, instance: 0, cost: 0, first_request: 0 });
            }
            segment.stream.extend([base, base + 1, base + 2]);
            let (cx, cy) = (self.random.unit() * self.scene.width as f32, self.random.unit() * self.scene.height as f32);
            let index = (first + t) as usize;
            let corners: [ScreenVertex; 3] = std::array::from_fn(|corner| {
                let size = self.scene.size;
                let (x, y) = (cx + (self.random.unit() - 0.5) * size, cy + (self.random.unit() - 0.5) * size);
                let [x, y] = self.scene.shapes.get(index).map_or([x, y], |shape| shape[corner]);
                let z = self.random.unit();
                let z = self.scene.depths.get(index).copied().unwrap_or(z);
                ScreenVertex { x: snap(x), y: snap(y), z, inv_w: 1.0 }
            });
            let tint = [self.random.unit(), self.random.unit(), self.random.unit(), self.random.unit()];
            let first_triangle = segment.triangles.len() as u32;
            let mut outcome = PrimitiveOutcome::Drawn;
            let mut triangles = 0;
            match setup::triangle(self.setup, &corners) {
                Err(setup::Culled::Degenerate) => outcome = PrimitiveOutcome::Degenerate,
                Err(setup::Culled::Face) => outcome = PrimitiveOutcome::Backface,
                Err(setup::Culled::NoSample) => outcome = PrimitiveOutcome::NoSample,
                Err(setup::Culled::Scissor) => outcome = PrimitiveOutcome::Scissor,
                Ok(triangle) => {
                    triangles = 1;
                    let b = triangle.bounds;
                    let bounds = [b.x0 / 8, b.y0 / 8, b.x1.div_ceil(8), b.y1.div_ceil(8)];
                    let first_visit = segment.visits.len() as u32;
                    let look = Look { tint, plane: triangle.depth, back: !triangle.front };
                    for ty in 0..tiles_y {
                        for tx in 0..tiles_x {
                            let index = (ty * tiles_x + tx) as usize;
                            let area = Bounds {
                                x0: (tx * TILE) as u16,
                                y0: (ty * TILE) as u16,
                                x1: ((tx + 1) * TILE) as u16,
                                y1: ((ty + 1) * TILE) as u16,
                            };
                            let first_block = tiles[index].blocks.len() as u32;
                            traverse::blocks::<S>(&triangle, area, |block| self.block::<S>(&look, &mut tiles[index], &block));
                            let blocks = tiles[index].blocks.len() as u32 - first_block;
                            if blocks > 0 {
                                segment.visits.push(Visit { tile: index as u32, first_block, blocks });
                            }
                        }
                    }
                    let visits = segment.visits.len() as u32 - first_visit;
                    if visits == 0 {
                        outcome = PrimitiveOutcome::NoSample;
                    }
                    segment.triangles.push(Triangle {
                        primitive: t,
                        depth: triangle.depth,
                        back: !triangle.front,
                        bounds,
                        pixels: [b.x0, b.y0, b.x1, b.y1],
                        unclipped: self.setup.unclipped(triangle.shape, &corners),
                        first_visit,
                        visits,
                        end: End::Nowhere,
                    });
                }
            }
            segment.primitives.push(Primitive {
                vertices: [base, base + 1, base + 2],
                stream_end: segment.stream.len() as u32,
                first_triangle,
                triangles,
                clipped: t % 11 == 3,
                cut_away: false,
                outcome,
            });
        }
        // Tiles without work do not appear in work.
        let mut number = vec![0; tiles.len()];
        let mut kept = Vec::new();
        for (index, tile) in tiles.into_iter().enumerate() {
            if !tile.blocks.is_empty() {
                number[index] = kept.len() as u32;
                kept.push(tile);
            }
        }
        for visit in &mut segment.visits {
            visit.tile = number[visit.tile as usize];
        }
        segment.tiles = kept;
        segment
    }

    fn block<const S: usize>(&mut self, look: &Look, tile: &mut TileWork, block: &traverse::Block<S>) {
        let first_quad = tile.quads.len() as u32;
        for quad in block.quads() {
            let made = self.quad::<S>(look, tile, quad);
            tile.quads.push(made);
        }
        let quads = (tile.quads.len() as u32 - first_quad) as u8;
        tile.blocks.push(Block { first_quad, x: block.x / 8, y: block.y / 8, quads, full: block.full });
    }

    /// One quad in API order: tests, shades, writes the reference.
    fn quad<const S: usize>(&mut self, look: &Look, tile: &mut TileWork, quad: traverse::QuadCoverage) -> Quad {
        let (x, y) = (u32::from(quad.x), u32::from(quad.y));
        let positions: &[[i32; 2]] = if S == 1 { &SAMPLES_1 } else { &SAMPLES_4 };
        let mut live = quad.mask;
        let kept = if self.scene.discard { quad.mask & self.random.bits() as u16 } else { quad.mask };
        let codes: Vec<[u32; 4]> = positions
            .iter()
            .map(|&[dx, dy]| {
                std::array::from_fn(|p| {
                    let px = (x + p as u32 % 2) as f32 + 0.5 + dx as f32 / 256.0;
                    let py = (y + p as u32 / 2) as f32 + 0.5 + dy as f32 / 256.0;
                    self.depth.map_or(0, |state| state.code(look.plane.at(px, py)))
                })
            })
            .collect();
        let test = |live: u16, reference: &mut Reference| match self.depth {
            None => live,
            Some(state) => {
                let mut run = reference.run(&reference.depth, x, y);
                let passed = state.test_quad(S, look.back, live, &codes, &mut run);
                let mut depth = std::mem::take(&mut reference.depth);
                reference.put(&mut depth, x, y, &run);
                reference.depth = depth;
                passed
            }
        };
        // With an early test nothing is discarded in these scenes; without a depth buffer there is none.
        let kept = if self.early && self.depth.is_some() { quad.mask } else { kept };
        if self.early {
            live = test(live, self.reference);
        }
        let shaded = live != 0 || self.scene.covered;
        let mut payload = 0;
        let first_request = tile.invocations.requests.len() as u32;
        let variant = u16::from((x / 2 + y / 2) % 7 == 0);
        if shaded {
            payload = tile.payload.len() as u32;
            let mut colors = [[0_u32; 4]; 4];
            for (c, channel) in colors.iter_mut().enumerate() {
                for (p, value) in channel.iter_mut().enumerate() {
                    let shade = ((x + p as u32 % 2) + (y + p as u32 / 2)) as f32 / 512.0;
                    *value = (look.tint[c] * 0.7 + shade).min(1.0).to_bits();
                }
            }
            for _ in 0..self.scene.textures {
                let first_line = tile.invocations.lines.len() as u32;
                let line = (1 << 20) + (y / 4) * 64 + x / 4;
                tile.invocations.lines.extend([line, line + 1]);
                tile.invocations.requests.push(Request { first_line, lines: 2, operations: 4, ..Request::default() });
            }
            live = if self.early { live & kept } else { test(live & kept, self.reference) };
            let mut run = self.reference.run(&self.reference.color, x, y);
            if self.blend {
                tile.payload.extend(colors.iter().flatten());
                self.color.blend_quad(S, live, &colors, &[[0; 4]; 4], &mut run);
            } else {
                let packed: Vec<u32> =
                    (0..4).map(|p| encode_code(Format::Rgba8Unorm, std::array::from_fn(|c| colors[c][p]))[0]).collect();
                self.color.put_quad(S, live, &packed, &mut run);
                tile.payload.extend(packed);
            }
            let mut color = std::mem::take(&mut self.reference.color);
            self.reference.put(&mut color, x, y, &run);
            self.reference.color = color;
        }
        let position = ((x % 8) / 2 + (y % 8) / 2 * 4) as u8;
        let flags = if shaded { QUAD_SHADED } else { 0 };
        Quad { coverage: quad.mask, kept, position, flags, cost: variant, payload, first_request }
    }
}
