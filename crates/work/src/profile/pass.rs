//! Profiles of render passes.

use std::sync::Arc;

use super::apart::{APART, Apart, DEALT, Test};
use super::caches::{BLOCK_CACHES, Caches, batched_vertices, dealt_vertices, shaded_vertices};
use super::lines::{Lines, LookupPosition};
use super::shader::asking;
use super::touch::{BUNDLE, Touch, Toucher, Touches, WHOLE};
use super::{ApartProfile, AttachmentProfile, BINS, Cell, DrawProfile, PhaseProfile, WINDOW, Window};
use crate::{
    Attachment, AttributeFetch, BLOCK, Block, Draw, LINE, Load, Pass, QUAD_SHADED, Quad, RequestKind, Segment, Stored, Surface,
    TILE, Target, TileWork, Triangle, Vertex, Visit,
};
use gfx::codec::CODECS;
use gfx::stage::{Stage, StageMap};
use gfx::state::{DepthStencil, StencilFace, StepMode};

/// A pass of which not all is known yet.
#[derive(Debug)]
pub(super) struct OpenPass {
    phase: PhaseProfile,
    /// When each block was put in the caches, those of covered blocks and those of shaded ones.
    caches: Caches,
    memory: Memory,
    lines: Lines,
    /// Depths of pipelines that draw apart.
    apart: Option<Apart>,
    /// Shaded quads so far, and how often they have gone on in another tile.
    shaded: u32,
    visits: u32,
    tile: [u16; 2],
    /// Nobody asks what batches of primitives shade again.
    whole: bool,
}

/// Where a pass and its draw have what they touch.
#[derive(Debug, Default)]
struct Memory {
    /// Blocks across, and the address and bytes of the first block of each colour attachment, and of depth.
    across: u64,
    color: Vec<Option<(u64, u64)>>,
    depth: Option<(u64, u64)>,
    /// Streams of attributes: address, stride, and whether by instance.
    streams: Vec<(u64, u64, bool)>,
    /// Colour targets that the draw writes, whether it tests depth or stencil, and whether it may write them.
    written: Vec<u8>,
    /// Of these those that replace what is stored, a bit each.
    replaces: u8,
    tests: bool,
    writes_depth: bool,
    /// Blocks can be hidden.
    hides: bool,
    /// How depths are tested.
    test: Test,
    /// What the requests of the segment's costs ask, tile by tile and cost by cost; and where each cost's begin and end.
    kinds: Vec<RequestKind>,
    costs: Vec<[u32; 2]>,
    /// Where each tile's costs begin.
    tiles: Vec<u32>,
}

fn texel_bytes(surface: &Surface) -> u64 {
    u64::from(surface.format.block_bytes()) * u64::from(surface.samples)
}

impl OpenPass {
    pub fn new(pass: &Pass, covered: bool, whole: bool) -> OpenPass {
        let profile = |attachment: &Attachment, clears: bool| {
            let resolved = |to: &Surface| u64::from(to.width) * u64::from(to.height) * texel_bytes(to);
            AttachmentProfile {
                line: (attachment.surface.address / LINE) as u32,
                block_bytes: 64 * texel_bytes(&attachment.surface),
                multisampled: attachment.surface.samples > 1,
                texel: attachment.surface.format.texel_class(),
                samples: attachment.surface.samples,
                loads: !clears,
                stores: attachment.store || attachment.stencil_store || attachment.resolve.is_some(),
                resolved: attachment.resolve.as_ref().map_or(0, resolved),
                lines: [texel_bytes(&attachment.surface) as f32; CODECS],
            }
        };
        let clears = |load: Load| matches!(load, Load::Clear(_));
        let depth = pass.depth.as_ref().map(|a| {
            let format = a.surface.format;
            let whole = (clears(a.load) || !format.has_depth()) && (clears(a.stencil_load) || !format.has_stencil());
            profile(a, whole)
        });
        let place = |attachment: &Attachment| (attachment.surface.address, 64 * texel_bytes(&attachment.surface));
        OpenPass {
            phase: PhaseProfile::Pass {
                number: pass.number,
                label: pass.label.clone(),
                size: [pass.width, pass.height],
                draws: Vec::new(),
                windows: Vec::new(),
                cells: Vec::new(),
                color: pass.color.iter().flatten().map(|a| profile(a, clears(a.load))).collect(),
                depth,
                blocks: [0; 2],
                block_misses: [[0; BLOCK_CACHES.len()]; 2],
                copies: [0; APART.len()],
                lines: Box::default(),
            },
            lines: Lines::default(),
            apart: covered.then(|| {
                let clear = pass.depth.as_ref().and_then(|a| match a.load {
                    Load::Clear(value) if a.surface.format.has_depth() => Some(f32::from_bits(value[0])),
                    _ => None,
                });
                Apart::new(pass, clear)
            }),
            whole,
            shaded: 0,
            visits: 0,
            tile: [u16::MAX; 2],
            caches: Caches::new(pass),
            memory: Memory {
                across: u64::from(pass.width.div_ceil(BLOCK)),
                color: pass.color.iter().map(|a| a.as_ref().map(place)).collect(),
                depth: pass.depth.as_ref().map(place),
                ..Memory::default()
            },
        }
    }

    pub fn draw(&mut self, draw: &Arc<Draw>) {
        let PhaseProfile::Pass { draws, .. } = &mut self.phase else { return };
        let written = || draw.targets.iter().flatten().filter(|target| target.write_mask != 0);
        let line = |a: &AttributeFetch| if a.stride == 0 { 0 } else { a.stride.min(LINE).max(u64::from(a.bytes)) };
        // Attributes that lie between each other are one stream of lines.
        let streams = &mut self.memory.streams;
        streams.clear();
        for attribute in draw.attributes.iter().filter(|a| a.stride > 0) {
            let same =
                |&&(at, stride, _): &&(u64, u64, bool)| stride == attribute.stride && at.abs_diff(attribute.address) < stride;
            if streams.iter().find(same).is_none() {
                streams.push((attribute.address, attribute.stride, attribute.step == StepMode::Instance));
            }
        }
        // Vertices whose strides do not divide a line may lie across two.
        let lines =
            |&(_, stride, _): &(u64, u64, bool)| LINE + if LINE.is_multiple_of(stride) { 0 } else { stride.min(LINE) - 1 };
        let targets = (0..).zip(&draw.targets).filter(|(_, target)| target.as_ref().is_some_and(|t| t.write_mask != 0));
        self.memory.written = targets.map(|(at, _)| at).collect();
        let replaces = |target: &Target| !target.combines() && target.write_mask & 15 == 15;
        let replacing = (0..8).zip(&draw.targets).filter(|(_, target)| target.as_ref().is_some_and(replaces));
        self.memory.replaces = replacing.fold(0, |mask, (at, _)| mask | 1 << at);
        self.memory.writes_depth = draw.depth_stencil.is_some_and(|state| {
            let keeps = StencilFace::default();
            state.depth_write || state.stencil_front != keeps || state.stencil_back != keeps
        });
        let no_stencil = |state: &DepthStencil| [state.stencil_front, state.stencil_back] == [StencilFace::default(); 2];
        let plain = draw.depth_stencil.as_ref().is_some_and(no_stencil);
        self.memory.hides = draw.early && draw.hierarchical_z && draw.shades() && plain;
        self.memory.test = Test::new(draw.depth_stencil.as_ref(), draw.early);
        self.memory.tests = draw.depth_stencil.is_some();
        draws.push(DrawProfile {
            number: draw.number,
            attributes: draw.attributes.len() as u64,
            streams: streams.len() as u64,
            stream_lines: streams.iter().map(lines).sum(),
            vertex_bytes: streams.iter().map(|s| s.1).sum::<u64>().min(draw.attributes.iter().map(line).sum()),
            registers: StageMap::from_fn(|stage| draw.shape(stage).registers),
            varyings: u64::from(draw.shape(Stage::Fragment).inputs),
            payload: u64::from(draw.payload_words),
            depth: draw.depth_stencil.is_some(),
            writes_depth: self.memory.writes_depth,
            early: draw.early,
            targets: written().count() as u64,
            blended: written().filter(|target| target.combines()).count() as u64,
            ..DrawProfile::default()
        });
    }

    pub fn segment(&mut self, segment: &Segment, touches: &mut Touches) {
        let PhaseProfile::Pass { draws, windows, cells, .. } = &mut self.phase else { return };
        let number = draws.len().saturating_sub(1) as u32;
        let Some(draw) = draws.last_mut() else { return };
        draw.segments += 1;
        draw.pipeline = segment.programs.pipeline;
        draw.indices += segment.stream.len() as u64;
        draw.index_bytes = segment.index_address.map_or(0, |_| u64::from(segment.index_bytes));
        draw.shaded_vertices.iter_mut().zip(shaded_vertices(segment)).for_each(|(sum, own)| *sum += own);
        draw.batched_vertices += batched_vertices(segment);
        if !self.whole {
            draw.dealt_vertices += dealt_vertices(segment, DEALT);
        }
        let invocations = &segment.invocations[Stage::Vertex];
        for vertex in &segment.vertices {
            draw.costs[Stage::Vertex]
                .add(&invocations.costs[vertex.cost], &invocations.requests[vertex.first_request as usize..]);
        }
        segment.tiles.iter().for_each(|tile| draw.costs[Stage::Fragment].add_tile(tile));
        self.memory.vertices(segment, touches);
        self.memory.learn(segment);
        draw.primitives += segment.primitives.len() as u64;
        draw.clipped += segment.primitives.iter().filter(|primitive| primitive.clipped).count() as u64;

        let mut open = Window { draw: number, begins: true, end: cells.len() as u32, ..Window::default() };
        let (mut first, mut groups) = (cells.len(), 0);
        for (number_in_segment, primitive) in (0..).zip(&segment.primitives) {
            open.primitives += 1;
            let triangles = &segment.triangles[primitive.first_triangle as usize..][..usize::from(primitive.triangles)];
            for triangle in triangles.iter().filter(|triangle| triangle.visits > 0) {
                open.triangles += 1;
                draw.triangles += 1;
                bounds(triangle).zip(&mut draw.bins[1]).for_each(|(n, sum)| *sum += n);
                draw.visits += u64::from(triangle.visits);
                for visit in &segment.visits[triangle.first_visit as usize..][..triangle.visits as usize] {
                    let tile = &segment.tiles[visit.tile as usize];
                    let at = match cells[first..].iter().position(|cell| cell.tile == [tile.x, tile.y]) {
                        Some(at) => first + at,
                        None => {
                            cells.push(Cell { tile: [tile.x, tile.y], ..Cell::default() });
                            cells.len() - 1
                        }
                    };
                    let before = cells[at].groups;
                    if self.tile != [tile.x, tile.y] {
                        self.tile = [tile.x, tile.y];
                        self.visits += 1;
                    }
                    let (blocks, hidden) = (cells[at].blocks, &mut draw.apart);
                    let mut apart = self.apart.as_mut().map(|apart| (apart, number_in_segment, hidden));
                    let (memory, visits) = (&self.memory, self.visits);
                    let mut followed = Followed { lines: &mut self.lines, touches, memory, visit: visits, apart: apart.take() };
                    draw.quads += cells[at].add(triangle, tile, visit, &mut self.caches, &mut self.shaded, &mut followed);
                    groups += cells[at].groups - before;
                    draw.bins[0][0] += u64::from(cells[at].blocks - blocks);
                    covered(tile, visit).into_iter().zip(&mut draw.bins[0][1..]).for_each(|(n, sum)| *sum += n);
                }
            }
            if open.triangles >= WINDOW[0] || open.primitives >= WINDOW[1] || groups >= WINDOW[2] {
                open.end = cells.len() as u32;
                windows.push(open);
                (first, groups) = (cells.len(), 0);
                open = Window { draw: number, ..Window::default() };
            }
        }
        if open.primitives > 0 {
            windows.push(Window { end: cells.len() as u32, ..open });
        }
        if let Some(apart) = &mut self.apart {
            apart.end_segment(segment.primitives.len() as u32);
        }
    }

    /// The whole, resolved; with what its blocks take in memory.
    pub fn end(mut self, touches: &mut Touches, resolves: &[(Surface, Surface)], stored: Option<&Stored>) -> PhaseProfile {
        self.learn_stored(touches, stored);
        for (from, to) in resolves {
            let [read, written] = [from, to].map(|surface| 64 * texel_bytes(surface));
            // Only blocks that were drawn are read.
            for (block, &drawn) in (0..).zip(&self.caches.blocks[1].touches) {
                let line = ((from.address + block * read) / LINE) as u32;
                if drawn > 0 && touches.follows(line) {
                    touches.push(Touch { line, by: Toucher::Resolve, ..Touch::default() });
                }
                touches.run(to.address + block * written, written, written, Toucher::Write);
            }
        }
        if let PhaseProfile::Pass { blocks, block_misses, copies, lines, .. } = &mut self.phase {
            *copies = self.apart.as_ref().map_or([0; APART.len()], |apart| apart.copies);
            **lines = self.lines.end();
            for (at, caches) in self.caches.blocks.iter().enumerate() {
                (blocks[at], block_misses[at]) = (caches.distinct, caches.misses());
            }
        }
        self.phase
    }

    /// Takes over what blocks take in memory; raw where the work does not say.
    fn learn_stored(&mut self, touches: &mut Touches, stored: Option<&Stored>) {
        let PhaseProfile::Pass { color, depth, .. } = &mut self.phase else { return };
        let none = Stored::default();
        let (stored, memory) = (stored.unwrap_or(&none), &self.memory);
        let of_color = |at: usize| stored.color.get(at).and_then(Option::as_ref);
        // Blocks count as often as they are touched, and alike where none is.
        let mean = |stored: &Vec<[u8; CODECS]>, touched: &[u32]| -> [f32; CODECS] {
            let alike = u64::from(touched.iter().all(|&n| n == 0));
            let weights = || touched.iter().map(|&n| u64::from(n) + alike);
            let all = weights().sum::<u64>().max(1) as f64;
            let lines = |codec: usize| stored.iter().zip(weights()).map(|(lines, n)| u64::from(lines[codec]) * n).sum::<u64>();
            std::array::from_fn(|codec| (lines(codec) as f64 / all) as f32)
        };
        let places = (0..memory.color.len()).filter(|&at| memory.color[at].is_some());
        for (attachment, at) in color.iter_mut().zip(places) {
            let found = of_color(at).map(|stored| mean(stored, &self.caches.blocks[1].touches));
            attachment.lines = found.unwrap_or(attachment.lines);
        }
        if let (Some(attachment), Some(stored)) = (depth, &stored.depth) {
            attachment.lines = mean(stored, &self.caches.blocks[0].touches);
        }
        for touch in touches.of_phase() {
            let (place, stored) = match touch.by {
                Toucher::Color => {
                    let at = usize::from(touch.step & !WHOLE);
                    (memory.color.get(at).copied().flatten(), of_color(at))
                }
                Toucher::Depth => (memory.depth, stored.depth.as_ref()),
                _ => continue,
            };
            let Some((address, bytes)) = place else { continue };
            let block = (u64::from(touch.line) * LINE).saturating_sub(address) / bytes;
            let lines = stored.and_then(|stored| stored.get(block as usize)).copied();
            touch.stored = lines.unwrap_or([(bytes / LINE) as u8; CODECS]);
        }
    }
}

impl Memory {
    /// What vertices touch.
    fn vertices(&self, segment: &Segment, touches: &mut Touches) {
        if let Some(address) = segment.index_address {
            touches.run(address, segment.stream.len() as u64 * u64::from(segment.index_bytes), 1, Toucher::Vertex);
        }
        let touch = |line: u32| Touch { line, by: Toucher::Vertex, ..Touch::default() };
        let invocations = &segment.invocations[Stage::Vertex];
        for (vertex, asked) in segment.vertices.iter().map(|vertex| (vertex, invocations.costs[vertex.cost].requests())) {
            for &(address, stride, instanced) in &self.streams {
                let Vertex { index, instance, .. } = *vertex;
                let line = ((address + u64::from(if instanced { instance } else { index }) * stride) / LINE) as u32;
                if touches.follows(line) {
                    touches.push_once(touch(line));
                }
            }
            for request in &invocations.requests[vertex.first_request as usize..][..asked] {
                for &line in &invocations.lines[request.first_line as usize..][..usize::from(request.lines)] {
                    if touches.follows(line) {
                        touches.push_once(touch(line));
                    }
                }
            }
        }
    }

    /// What the costs of a segment's tiles ask.
    fn learn(&mut self, segment: &Segment) {
        self.kinds.clear();
        self.costs.clear();
        self.tiles.clear();
        for tile in &segment.tiles {
            self.tiles.push(self.costs.len() as u32);
            for cost in &tile.invocations.costs.costs {
                let begin = self.kinds.len() as u32;
                self.kinds.extend(asking(cost).map(|step| step.then));
                self.costs.push([begin, self.kinds.len() as u32]);
            }
        }
    }

    /// A block is touched by depth test or ROP.
    #[inline(always)]
    fn block(&self, at: (u64, u64), [x, y]: [u16; 2], touch: Touch, touches: &mut Touches) {
        let block = u64::from(y) * self.across + u64::from(x);
        let line = ((at.0 + block * at.1) / LINE) as u32;
        if touches.follows(line) {
            touches.push(Touch { line, ..touch });
        }
    }
}

/// Blocks along the edge of a screen tile.
const EDGE: u16 = (TILE / BLOCK) as u16;

/// What is followed of a segment's lines and blocks.
struct Followed<'p> {
    lines: &'p mut Lines,
    touches: &'p mut Touches,
    memory: &'p Memory,
    visit: u32,
    /// Copies of pipelines that draw apart, the number of the primitive in its segment, and what they hide of its draw.
    apart: Option<(&'p mut Apart, u32, &'p mut ApartProfile)>,
}

/// How many tiles of [`BINS`] pixels a triangle's bounds touch.
fn bounds(triangle: &Triangle) -> impl Iterator<Item = u64> {
    let [x0, y0, x1, y1] = triangle.bounds.map(u32::from);
    BINS.into_iter().map(move |edge| {
        let side = edge / BLOCK;
        let span = |a: u32, b: u32| u64::from(b.div_ceil(side).saturating_sub(a / side));
        span(x0, x1) * span(y0, y1)
    })
}

/// In how many tiles of 16, 32 and 64 pixels a visit has blocks.
fn covered(tile: &TileWork, visit: &Visit) -> [u64; BINS.len() - 1] {
    let (mut small, mut middle) = (0_u16, 0_u8);
    for block in &tile.blocks[visit.first_block as usize..][..visit.blocks as usize] {
        let [x, y] = [block.x % EDGE, block.y % EDGE];
        small |= 1 << (y / 2 * 4 + x / 2);
        middle |= 1 << (y / 4 * 2 + x / 4);
    }
    [u64::from(small.count_ones()), u64::from(middle.count_ones()), u64::from(small != 0)]
}

/// Whether all of a block is drawn: covered, shaded and kept.
fn whole_block(tile: &TileWork, block: &Block) -> bool {
    let quads = &tile.quads[block.first_quad as usize..][..usize::from(block.quads)];
    block.full && quads.iter().all(|quad| quad.flags & QUAD_SHADED != 0 && quad.kept & quad.coverage == quad.coverage)
}

impl Followed<'_> {
    /// A quad's requests.
    #[inline(always)]
    fn quad(&mut self, tile: &TileWork, quad: &Quad, [begin, end]: [u32; 2], bundle: u32) {
        let requests = &tile.invocations.requests[quad.first_request as usize..][..(end - begin) as usize];
        for (step, request) in requests.iter().enumerate() {
            for &line in &tile.invocations.lines[request.first_line as usize..][..usize::from(request.lines)] {
                let counted = Lines::follows(line);
                if counted || self.touches.follows(line) {
                    self.line(line, counted, tile, begin as usize, step, bundle);
                }
            }
        }
    }

    fn line(&mut self, line: u32, counted: bool, tile: &TileWork, begin: usize, step: usize, bundle: u32) {
        match self.memory.kinds[begin + step] {
            RequestKind::Texture | RequestKind::Load => {
                let request = step.min(usize::from(u8::MAX)) as u8;
                let tile = u32::from(tile.y) << 16 | u32::from(tile.x);
                let class = self.lines.look_up(line, LookupPosition { bundle, tile, visit: self.visit, request }, counted);
                if let Some(class) = class.filter(|_| self.touches.follows(line)) {
                    self.touches.push(Touch { line, class, by: Toucher::Texture, ..Touch::default() });
                }
            }
            RequestKind::Constant => {}
            _ if self.touches.follows(line) => self.touches.push_once(Touch { line, by: Toucher::Store, ..Touch::default() }),
            _ => {}
        }
    }

    /// A block's colours are written.
    fn colors(&mut self, tile: &TileWork, block: &Block, near: u8) {
        let mut whole = None;
        for &target in &self.memory.written {
            let Some((address, bytes)) = self.memory.color.get(usize::from(target)).copied().flatten() else { continue };
            let at = address + (u64::from(block.y) * self.memory.across + u64::from(block.x)) * bytes;
            let line = (at / LINE) as u32;
            if self.touches.follows(line) {
                let replaced =
                    self.memory.replaces >> (target & 7) & 1 != 0 && *whole.get_or_insert_with(|| whole_block(tile, block));
                let step = target | if replaced { WHOLE } else { 0 };
                self.touches.push(Touch { line, near, step, by: Toucher::Color, ..Touch::default() });
            }
        }
    }
}

impl Cell {
    /// Adds the blocks of a triangle; their quads.
    fn add(
        &mut self,
        triangle: &Triangle,
        tile: &TileWork,
        visit: &Visit,
        caches: &mut Caches,
        shaded: &mut u32,
        followed: &mut Followed,
    ) -> u64 {
        let memory = followed.memory;
        let [x0, y0, x1, y1] = triangle.bounds;
        let span = |a: u16, b: u16, at: u16| u32::from(b.min((at + 1) * EDGE).saturating_sub(a.max(at * EDGE)));
        self.triangles += 1;
        self.tested += span(x0, x1, tile.x) * span(y0, y1, tile.y);
        let costs = &memory.costs[memory.tiles[visit.tile as usize] as usize..];
        let mut all = 0;
        for block in &tile.blocks[visit.first_block as usize..][..visit.blocks as usize] {
            let quads = &tile.quads[block.first_quad as usize..][..usize::from(block.quads)];
            self.blocks += 1;
            all += u64::from(block.quads);
            if let Some((apart, primitive, hidden)) = &mut followed.apart {
                apart.block(*primitive, triangle, block, quads, memory.test, hidden);
            }
            // What early tests hide whole, hierarchical Z throws away.
            if memory.hides && quads.iter().all(|quad| quad.flags & QUAD_SHADED == 0) {
                continue;
            }
            self.seen += 1;
            self.groups += u32::from(block.quads).div_ceil(4);
            let near = caches.blocks[0].touch(block.x, block.y);
            if let Some(depth) = memory.depth.filter(|_| memory.tests && near > 0) {
                let step = u8::from(memory.writes_depth);
                let touch = Touch { near, step, by: Toucher::Depth, ..Touch::default() };
                memory.block(depth, [block.x, block.y], touch, followed.touches);
            }
            let before = self.shaded;
            for quad in quads.iter().filter(|quad| quad.flags & QUAD_SHADED != 0) {
                followed.quad(tile, quad, costs[usize::from(quad.cost)], *shaded / BUNDLE);
                self.shaded += 1;
                *shaded += 1;
            }
            if self.shaded > before {
                self.pins += 1;
                let near = caches.blocks[1].touch(block.x, block.y);
                if near > 0 {
                    followed.colors(tile, block, near);
                }
            }
        }
        all
    }
}
