//! Work made by hand: random triangles, set up and traversed by `gfx`, with made-up shading costs, texture lines and colours, and the
//! picture that API order gives.

#![allow(dead_code)]

use std::sync::Arc;

use fillrate::gfx::format::Format;
use fillrate::gfx::rop::{ColorState, DepthStencilState};
use fillrate::gfx::setup::{self, Bounds, DepthBias, SAMPLES_1, SAMPLES_4, ScreenVertex, SetupState};
use fillrate::gfx::state::{
    Blend, BlendComponent, BlendFactor, BlendOp, ColorTarget, Compare, CullMode, DepthStencil, FrontFace, Rect, StencilFace,
    StencilOp, StepMode, Viewport,
};
use fillrate::gfx::traverse;
use fillrate::work::*;

/// A small generator of numbers.
pub struct Random(pub u64);

impl Random {
    pub fn next(&mut self) -> u32 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 33) as u32
    }

    pub fn below(&mut self, n: u32) -> u32 {
        ((u64::from(self.next()) * u64::from(n)) >> 31) as u32
    }

    pub fn unit(&mut self) -> f32 {
        self.below(1 << 20) as f32 / (1 << 20) as f32
    }
}

/// What a scene is made of.
#[derive(Clone, Debug)]
pub struct Scene {
    pub width: u32,
    pub height: u32,
    pub samples: u32,
    pub draws: u32,
    pub triangles: u32,
    /// Edge of the square in which a triangle lies, in pixels.
    pub size: f32,
    pub compare: Compare,
    /// Comparisons of the draws, over and over; that above if there are none.
    pub compares: Vec<Compare>,
    pub depth_format: Option<Format>,
    pub early: bool,
    pub blend: bool,
    /// Steps with a texture request, and instructions in each.
    pub textures: u32,
    pub instructions: u32,
    pub frames: u32,
    pub segments: u32,
    /// Where the format has a stencil, every other draw counts there what fails, and all are let through only where the count is even.
    pub stencil: bool,
    pub discard: bool,
    /// Every covered quad is shaded, as for machines whose early tests do not see all depths.
    pub covered: bool,
    /// Corners of the triangles of each draw, in pixels; random ones if there are none.
    pub shapes: Vec<[[f32; 2]; 3]>,
    pub seed: u64,
}

impl Default for Scene {
    fn default() -> Scene {
        Scene {
            width: 200,
            height: 136,
            samples: 1,
            draws: 2,
            triangles: 60,
            size: 60.0,
            compare: Compare::Less,
            compares: Vec::new(),
            depth_format: Some(Format::Depth32Float),
            early: true,
            blend: false,
            textures: 1,
            instructions: 20,
            frames: 1,
            segments: 2,
            stencil: false,
            discard: false,
            covered: false,
            shapes: Vec::new(),
            seed: 7,
        }
    }
}

const COLOR: SurfaceKey = SurfaceKey { texture: 1, level: 0, layer: 0 };
const DEPTH: SurfaceKey = SurfaceKey { texture: 2, level: 0, layer: 0 };
const RESOLVED: SurfaceKey = SurfaceKey { texture: 3, level: 0, layer: 0 };

/// A reference buffer: codes by pixel and sample.
struct Reference {
    width: u32,
    samples: u32,
    color: Vec<u32>,
    depth: Vec<u32>,
}

impl Reference {
    fn at(&self, x: u32, y: u32, s: u32) -> usize {
        ((y * self.width + x) * self.samples + s) as usize
    }

    /// The run of a quad: sample after sample, four pixels each. Pixels outside are zero.
    fn run(&self, buffer: &[u32], x: u32, y: u32) -> Vec<u32> {
        let mut run = Vec::new();
        for s in 0..self.samples {
            for p in 0..4 {
                run.push(*buffer.get(self.at(x + p % 2, y + p / 2, s)).filter(|_| x + p % 2 < self.width).unwrap_or(&0));
            }
        }
        run
    }

    fn put(&self, buffer: &mut [u32], x: u32, y: u32, run: &[u32]) {
        for s in 0..self.samples {
            for p in 0..4 {
                let at = self.at(x + p % 2, y + p / 2, s);
                if x + p % 2 < self.width && at < buffer.len() {
                    buffer[at] = run[(4 * s + p) as usize];
                }
            }
        }
    }
}

/// The events of a scene.
pub fn events(scene: &Scene) -> Vec<Event> {
    let mut random = Random(scene.seed);
    let mut out = Vec::new();
    let surface =
        |key, format, samples, address| Surface { key, format, width: scene.width, height: scene.height, samples, address };
    let color = surface(COLOR, Format::Rgba8Unorm, scene.samples, 1 << 20);
    let resolve = (scene.samples > 1).then(|| surface(RESOLVED, Format::Rgba8Unorm, 1, 1 << 26));
    let clear = [0.25_f32.to_bits(), 0, 0, 1.0_f32.to_bits()];
    let attachment = |surface, load| Attachment {
        surface,
        load,
        store: true,
        stencil_load: Load::Clear([0, 0, 0, 0]),
        stencil_store: true,
        resolve: None,
    };
    let far = match scene.compare {
        Compare::Greater | Compare::GreaterEqual => 0.0_f32,
        _ => 1.0,
    };
    for frame in 0..scene.frames {
        let depth = scene
            .depth_format
            .map(|format| attachment(surface(DEPTH, format, scene.samples, 1 << 24), Load::Clear([far.to_bits(), 0, 0, 0])));
        let pass = Pass {
            number: frame,
            label: String::new(),
            width: scene.width,
            height: scene.height,
            samples: scene.samples,
            color: vec![Some(Attachment { resolve, ..attachment(color, Load::Clear(clear)) })],
            depth,
        };
        out.push(Event::BeginPass(Arc::new(pass)));
        let pixels = (scene.width * scene.height * scene.samples) as usize;
        let cleared = fillrate::gfx::texel::encode_code(color.format, clear)[0];
        let far_code = scene.depth_format.map_or(0, |format| fillrate::gfx::texel::depth_code(format, far));
        let mut reference = Reference {
            width: scene.width,
            samples: scene.samples,
            color: vec![cleared; pixels],
            depth: vec![far_code; pixels],
        };
        for number in 0..scene.draws {
            draw(scene, number, &mut random, &mut reference, &mut out);
        }
        out.push(Event::EndPass);
        let shown = resolve.unwrap_or(color);
        let bytes: Vec<u8> = if scene.samples == 1 {
            reference.color.iter().flat_map(|code| code.to_le_bytes()).collect()
        } else {
            let resolve = |samples: &[u32]| {
                let mut pixel = [0];
                fillrate::gfx::rop::resolve(color.format, samples, &mut pixel);
                pixel[0].to_le_bytes()
            };
            reference.color.chunks_exact(scene.samples as usize).flat_map(resolve).collect()
        };
        out.push(Event::EndFrame(EndFrame { number: frame, shown: Some(shown), reference: bytes.into(), drawn: true }));
    }
    out
}

fn cost(scene: &Scene, extra: u32) -> Cost {
    let mut steps = Vec::new();
    for _ in 0..scene.textures {
        steps.push(Step { instructions: [scene.instructions, 2, 1, 0], then: RequestKind::Texture });
    }
    steps.push(Step { instructions: [scene.instructions + extra, 0, 1, 1], then: RequestKind::End });
    Cost { steps }
}

fn draw(scene: &Scene, number: u32, random: &mut Random, reference: &mut Reference, out: &mut Vec<Event>) {
    let factor = |src, dst| BlendComponent { src, dst, op: BlendOp::Add };
    let over = factor(BlendFactor::SrcAlpha, BlendFactor::OneMinusSrcAlpha);
    let blend = scene.blend.then_some(Blend { color: over, alpha: over });
    let compare = scene.compares.get(number as usize % scene.compares.len().max(1)).copied().unwrap_or(scene.compare);
    let stencil = scene.stencil && scene.depth_format.is_some_and(|format| format.has_stencil());
    let counts = StencilOp::IncrementWrap;
    let even = StencilFace { compare: Compare::Equal, fail_op: counts, depth_fail_op: counts, pass_op: StencilOp::Keep };
    let face = if stencil { even } else { StencilFace::default() };
    let state = scene.depth_format.map(|format| DepthStencil {
        format,
        depth_write: true,
        depth_compare: compare,
        stencil_front: face,
        stencil_back: face,
        stencil_read_mask: if stencil { 1 } else { !0 },
        stencil_write_mask: if stencil && number % 2 == 1 { 0 } else { !0 },
        bias: 0,
        bias_slope: 0.0,
        bias_clamp: 0.0,
    });
    // Every other draw of a late scene is early, so that both kinds meet.
    let early = scene.early || number % 2 == 1;
    let target = Target {
        blend,
        write_mask: 15,
        payload: Some(0),
        words: if scene.blend { 4 } else { 1 },
        packed: !scene.blend,
        second: None,
    };
    let words = 4 * target.words;
    let draw = Draw {
        number,
        label: String::new(),
        vertex: ShaderShape { registers: 16, inputs: 8, outputs: 8 },
        fragment: Some(ShaderShape { registers: 24, inputs: 8, outputs: 4 }),
        attributes: vec![AttributeFetch { address: 1 << 22, stride: 32, step: StepMode::Vertex, bytes: 32 }],
        depth_stencil: state,
        stencil_reference: 0,
        targets: vec![Some(target)],
        blend_constant: [0.0; 4],
        depth_words: 0,
        payload_words: words,
        early,
        hierarchical_z: early && !stencil,
        depth_range: [0.0, 1.0],
    };
    out.push(Event::Draw(Arc::new(draw)));
    let depth = state.map(|state| DepthStencilState::new(&state, 0, [0.0, 1.0]));
    let color = ColorState::new(&ColorTarget { format: Format::Rgba8Unorm, blend: target.blend, write_mask: 15 }, [0.0; 4]);
    let view =
        Viewport { x: 0.0, y: 0.0, width: scene.width as f32, height: scene.height as f32, min_depth: 0.0, max_depth: 1.0 };
    let scissor = Rect { x: 0, y: 0, width: scene.width, height: scene.height };
    let setup_state = SetupState::new(
        (scene.width, scene.height),
        &view,
        scissor,
        FrontFace::Ccw,
        CullMode::None,
        scene.samples,
        DepthBias::NONE,
    );
    let each = scene.triangles.div_ceil(scene.segments);
    for segment in 0..scene.segments {
        let count = each.min(scene.triangles - (each * segment).min(scene.triangles));
        let made = match scene.samples {
            1 => segment_of::<1>(
                scene,
                count,
                segment * each,
                random,
                reference,
                &setup_state,
                depth.as_ref(),
                &color,
                early,
                blend.is_some(),
            ),
            _ => segment_of::<4>(
                scene,
                count,
                segment * each,
                random,
                reference,
                &setup_state,
                depth.as_ref(),
                &color,
                early,
                blend.is_some(),
            ),
        };
        out.push(Event::Segment(Arc::new(made)));
    }
}

fn segment_of<const S: usize>(
    scene: &Scene,
    count: u32,
    first: u32,
    random: &mut Random,
    reference: &mut Reference,
    setup_state: &SetupState,
    depth: Option<&DepthStencilState>,
    color: &ColorState,
    early: bool,
    blend: bool,
) -> Segment {
    let (tiles_x, tiles_y) = (scene.width.div_ceil(TILE), scene.height.div_ceil(TILE));
    let mut tiles: Vec<TileWork> = Vec::new();
    for y in 0..tiles_y {
        for x in 0..tiles_x {
            let mut costs = CostTable::default();
            costs.costs.push(cost(scene, 0));
            costs.costs.push(cost(scene, 9));
            tiles.push(TileWork { x: x as u16, y: y as u16, costs, ..TileWork::default() });
        }
    }
    let mut segment = Segment {
        index_address: Some((1 << 23) + u64::from(first) * 12),
        index_bytes: 4,
        costs: CostTable { costs: vec![Cost { steps: vec![Step { instructions: [30, 4, 1, 0], then: RequestKind::End }] }] },
        ..Segment::default()
    };
    for t in 0..count {
        // Two new vertices a triangle: the third is shared with the one before.
        let base = if t == 0 { 0 } else { segment.vertices.len() as u32 - 1 };
        while (segment.vertices.len() as u32) < base + 3 {
            let index = first * 2 + segment.vertices.len() as u32;
            segment.vertices.push(Vertex { index, instance: 0, cost: 0, first_request: 0 });
        }
        segment.stream.extend([base, base + 1, base + 2]);
        let (cx, cy) = (random.unit() * scene.width as f32, random.unit() * scene.height as f32);
        let corners: [ScreenVertex; 3] = std::array::from_fn(|corner| {
            let (x, y) = (cx + (random.unit() - 0.5) * scene.size, cy + (random.unit() - 0.5) * scene.size);
            let [x, y] = scene.shapes.get((first + t) as usize).map_or([x, y], |shape| shape[corner]);
            ScreenVertex { x: fillrate::num::snap(x), y: fillrate::num::snap(y), z: random.unit(), inv_w: 1.0 }
        });
        let tint = [random.unit(), random.unit(), random.unit(), random.unit()];
        let first_triangle = segment.triangles.len() as u32;
        let mut outcome = Outcome::Drawn;
        let mut triangles = 0;
        match setup::triangle(setup_state, &corners) {
            Err(setup::Culled::Degenerate) => outcome = Outcome::Degenerate,
            Err(setup::Culled::Face) => outcome = Outcome::Backface,
            Err(setup::Culled::NoSample) => outcome = Outcome::NoSample,
            Err(setup::Culled::Scissor) => outcome = Outcome::Scissor,
            Ok(triangle) => {
                triangles = 1;
                let b = triangle.bounds;
                let bounds = [b.x0 / 8, b.y0 / 8, b.x1.div_ceil(8), b.y1.div_ceil(8)];
                let first_visit = segment.visits.len() as u32;
                let mut shading = Shading {
                    scene,
                    random,
                    reference,
                    depth,
                    color,
                    early,
                    blend,
                    tint,
                    plane: triangle.depth,
                    back: !triangle.front,
                };
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
                        traverse::blocks::<S>(&triangle, area, |block| shading.block::<S>(&mut tiles[index], &block));
                        let blocks = tiles[index].blocks.len() as u32 - first_block;
                        if blocks > 0 {
                            segment.visits.push(Visit { tile: index as u32, first_block, blocks });
                        }
                    }
                }
                let visits = segment.visits.len() as u32 - first_visit;
                if visits == 0 {
                    outcome = Outcome::NoSample;
                }
                segment.triangles.push(Triangle {
                    primitive: t,
                    depth: triangle.depth,
                    back: !triangle.front,
                    bounds,
                    first_visit,
                    visits,
                });
            }
        }
        segment.primitives.push(Primitive {
            vertices: [base, base + 1, base + 2],
            stream_end: segment.stream.len() as u32,
            first_triangle,
            triangles,
            clipped: t % 11 == 3,
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

struct Shading<'a> {
    scene: &'a Scene,
    random: &'a mut Random,
    reference: &'a mut Reference,
    depth: Option<&'a DepthStencilState>,
    color: &'a ColorState,
    early: bool,
    blend: bool,
    tint: [f32; 4],
    plane: setup::DepthPlane,
    back: bool,
}

impl Shading<'_> {
    fn block<const S: usize>(&mut self, tile: &mut TileWork, block: &traverse::Block<S>) {
        let first_quad = tile.quads.len() as u32;
        for quad in block.quads() {
            let made = self.quad::<S>(tile, quad);
            tile.quads.push(made);
        }
        let quads = (tile.quads.len() as u32 - first_quad) as u8;
        tile.blocks.push(Block { first_quad, x: block.x / 8, y: block.y / 8, quads, full: block.full });
    }

    /// One quad in API order: tests, shades, writes the reference.
    fn quad<const S: usize>(&mut self, tile: &mut TileWork, quad: traverse::QuadCoverage) -> Quad {
        let (x, y) = (u32::from(quad.x), u32::from(quad.y));
        let positions: &[[i32; 2]] = if S == 1 { &SAMPLES_1 } else { &SAMPLES_4 };
        let mut live = quad.mask;
        let kept = if self.scene.discard { quad.mask & self.random.next() as u16 } else { quad.mask };
        let codes: Vec<[u32; 4]> = positions
            .iter()
            .map(|&[dx, dy]| {
                std::array::from_fn(|p| {
                    let px = (x + p as u32 % 2) as f32 + 0.5 + dx as f32 / 256.0;
                    let py = (y + p as u32 / 2) as f32 + 0.5 + dy as f32 / 256.0;
                    self.depth.map_or(0, |state| state.code(self.plane.at(px, py)))
                })
            })
            .collect();
        let test = |live: u16, reference: &mut Reference| match self.depth {
            None => live,
            Some(state) => {
                let mut run = reference.run(&reference.depth, x, y);
                let passed = state.test_quad(S, self.back, live, &codes, &mut run);
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
        let first_request = tile.requests.len() as u32;
        let variant = u16::from((x / 2 + y / 2) % 7 == 0);
        if shaded {
            payload = tile.payload.len() as u32;
            let mut colors = [[0_u32; 4]; 4];
            for (c, channel) in colors.iter_mut().enumerate() {
                for (p, value) in channel.iter_mut().enumerate() {
                    let shade = ((x + p as u32 % 2) + (y + p as u32 / 2)) as f32 / 512.0;
                    *value = (self.tint[c] * 0.7 + shade).min(1.0).to_bits();
                }
            }
            for _ in 0..self.scene.textures {
                let first_line = tile.lines.len() as u32;
                let line = (1 << 20) + (y / 4) * 64 + x / 4;
                tile.lines.extend([line, line + 1]);
                tile.requests.push(Request { first_line, lines: 2, operations: 4 });
            }
            live = if self.early { live & kept } else { test(live & kept, self.reference) };
            let mut run = self.reference.run(&self.reference.color, x, y);
            if self.blend {
                tile.payload.extend(colors.iter().flatten());
                self.color.blend_quad(S, live, &colors, &[[0; 4]; 4], &mut run);
            } else {
                let packed: Vec<u32> = (0..4)
                    .map(|p| fillrate::gfx::texel::encode_code(Format::Rgba8Unorm, std::array::from_fn(|c| colors[c][p]))[0])
                    .collect();
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

/// The events of a scene of one frame with its draws in two passes, the second of which loads what the first has drawn.
pub fn in_two_passes(scene: &Scene) -> Vec<Event> {
    let mut out = Vec::new();
    let mut pass = None;
    for event in events(scene) {
        if let Event::BeginPass(begun) = &event {
            pass = Some(begun.as_ref().clone());
        }
        if matches!(&event, Event::Draw(draw) if draw.number == 1) {
            let mut second = pass.clone().expect("a pass");
            second.number = 1;
            second.color.iter_mut().flatten().chain(&mut second.depth).for_each(|attachment| {
                attachment.load = Load::Load;
                attachment.stencil_load = Load::Load;
            });
            out.extend([Event::EndPass, Event::BeginPass(Arc::new(second))]);
        }
        out.push(event);
    }
    out
}
