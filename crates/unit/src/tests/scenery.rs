//! Work made by hand, as little as a unit needs.

use std::sync::Arc;

use crate::card::{Ahead, Card, Group, PassState};
use crate::class_state::ClassState;
use crate::frame::BlockState;
use crate::interleave::{Interleave, Pattern};
use crate::token::{GroupToken, Kind, TriangleToken};
use crate::warp::{Execution, Item};
use gfx::format::Format;
use gfx::stage::{Stage, StageMap};
use gfx::state::{Compare, DepthStencil, StencilFace};
use work::*;

/// A card with nothing in flight, whose pipelines own tiles of 64x64 pixels.
pub fn card(pipelines: usize) -> Card {
    card_of_tiles(pipelines, 64)
}

/// A card whose pipelines own tiles of `tile` by `tile` pixels.
pub fn card_of_tiles(pipelines: usize, tile: u32) -> Card {
    Card::new(
        pipelines,
        8,
        4,
        Interleave::new(Pattern::Skewed, pipelines as u32, tile),
        Execution::Longest,
        ClassState::default(),
    )
}

/// A draw without attributes, tests and targets.
pub fn draw() -> Draw {
    draw_with(|_| {})
}

/// The same draw with another state.
pub fn draw_with(change: impl FnOnce(&mut RecordedState)) -> Draw {
    let shape = Some(ShaderShape { registers: 16, inputs: 0, outputs: 4 });
    let mut shapes = StageMap::default();
    (shapes[Stage::Vertex], shapes[Stage::Fragment]) = (shape, shape);
    let mut state = RecordedState {
        number: 0,
        label: String::new(),
        shapes,
        depth_stencil: None,
        stencil_references: [0; 2],
        targets: Vec::new(),
        blend_constant: [0.0; 4],
        depth_words: 0,
        payload_words: 0,
        early: true,
        hierarchical_z: true,
        depth_range: [0.0, 1.0],
    };
    change(&mut state);
    Draw {
        number: 0,
        site: num::CallSite::Command(0),
        groups: [].into(),
        state: state.into(),
        attributes: Vec::new(),
        signature: None,
        culling: Default::default(),
        reach: Default::default(),
    }
}

/// A depth test that writes.
pub fn depth_test(compare: Compare) -> DepthStencil {
    DepthStencil {
        format: Format::Depth32Float,
        depth_write: true,
        depth_compare: compare,
        stencil_front: StencilFace::default(),
        stencil_back: StencilFace::default(),
        stencil_read_mask: !0,
        stencil_write_mask: !0,
        stencil_back_masks: None,
        bias: 0.0,
        bias_slope: 0.0,
        bias_clamp: 0.0,
    }
}

/// A primitive that can be assembled once `stream_end` entries of the stream are read.
pub fn primitive(stream_end: u32, first_triangle: u32, triangles: u8, clipped: bool, outcome: PrimitiveOutcome) -> Primitive {
    Primitive { vertices: [0; 3], stream_end, first_triangle, triangles, clipped, cut_away: false, outcome }
}

/// A quad that is covered and shaded whole, whose payload begins at word 0.
pub const QUAD: Quad = Quad { coverage: 15, kept: 15, position: 0, flags: QUAD_SHADED, cost: 0, payload: 0, first_request: 0 };

/// A triangle over whole tiles of a row: `blocks` blocks of `quads` quads in each of `tiles` tiles. Its bounding box has the rows
/// of blocks that these take, and `rows` more.
pub fn row_of_tiles(tiles: u16, blocks: u32, quads: u8, rows: u16) -> Segment {
    let work = |x| TileWork {
        x,
        blocks: (0..blocks)
            .map(|b| Block { first_quad: b * u32::from(quads), x: x * 8 + b as u16 % 8, y: b as u16 / 8, quads, full: false })
            .collect(),
        quads: (0..blocks * u32::from(quads)).map(|q| Quad { position: (q % u32::from(quads)) as u8, ..QUAD }).collect(),
        payload: vec![0; 64],
        invocations: CostTable::from(vec![Cost::from(vec![step([1, 0, 0, 0, 0], RequestKind::End)])]).into(),
        ..TileWork::default()
    };
    Segment {
        triangles: vec![Triangle {
            primitive: 0,
            depth: Default::default(),
            back: false,
            bounds: [0, 0, tiles * 8, blocks.div_ceil(8) as u16 + rows],
            pixels: [0, 0, tiles * 64, (blocks.div_ceil(8) as u16 + rows) * 8],
            unclipped: u64::from(tiles) * 64 * (u64::from(blocks.div_ceil(8)) + u64::from(rows)) * 8,
            first_visit: 0,
            visits: u32::from(tiles),
            end: End::Nowhere,
        }],
        visits: (0..u32::from(tiles)).map(|tile| Visit { tile, first_block: 0, blocks }).collect(),
        tiles: (0..tiles).map(work).collect(),
        ..Segment::default()
    }
}

/// Instructions, then what follows.
pub fn step(instructions: [u32; Class::COUNT], then: RequestKind) -> Step {
    Step::dependent(instructions, then)
}

/// A triangle, or a mark.
pub fn triangle(kind: Kind, sequence: u32, triangle: u32) -> TriangleToken {
    TriangleToken { slot: 0, kind, sequence, triangle }
}

/// A group of `count` quads of a block of the segment in a slot, whole, from quad `first` of its first tile on.
pub fn group(card: &mut Card, slot: u16, block: u32, first: u32, count: u8) -> GroupToken {
    let mut live = [0; 4];
    live[..usize::from(count)].fill(15);
    let group = Group { slot, count, triangle: 0, tile: 0, first, block, live, ahead: Ahead::Nothing };
    GroupToken { group: card.groups[0].insert(group), sequence: 0, kind: Kind::DATA, quads: count, pool: 0 }
}

/// A mark among groups.
pub fn mark(kind: Kind, slot: u16) -> GroupToken {
    GroupToken { group: u32::from(slot), sequence: 0, kind, quads: 0, pool: 0 }
}

/// A warp of one stage whose parts all have the first cost of a table.
pub fn warp(card: &mut Card, stage: Stage, parts: u32, registers: u32, costs: &CostTable) -> u32 {
    let index = card.warps[0].insert(stage, 0, registers);
    let warp = &mut card.warps[0][index];
    for _ in 0..parts {
        warp.items.push(Item::default());
    }
    warp.merge(|_| costs);
    index
}

/// A surface of `blocks` blocks in a row. Its address leaves room for any surface before it.
pub fn surface(texture: u32, format: Format, blocks: u32, samples: u32) -> Surface {
    let key = SurfaceKey { texture, level: 0, layer: 0 };
    Surface { key, format, width: blocks * BLOCK, height: BLOCK, samples, address: u64::from(texture) << 24, opaque: false }
}

/// An attachment that is loaded and stored.
pub fn attachment(surface: Surface) -> Attachment {
    let load = Load::Load;
    let keeps = Aspects::of(surface.format);
    Attachment { surface, load, store: true, stencil_load: load, stencil_store: true, keeps, resolve: None }
}

/// A pass over attachments of one row of blocks.
pub fn pass(color: Vec<Option<Attachment>>, depth: Option<Attachment>) -> Pass {
    let surface = color.iter().flatten().chain(&depth).next().expect("an attachment").surface;
    let Surface { width, height, samples, .. } = surface;
    Pass { number: 0, label: String::new(), width, height, samples, color, depth }
}

/// Begins a pass as the command processor would. All blocks of its attachments are in memory, or cleared by flag.
pub fn begin_pass(card: &mut Card, pass: Pass, cleared: bool) {
    let mut install = |attachment: &Attachment| {
        let index = card.frame.surface(&attachment.surface);
        if cleared {
            card.frame.stores[index].blocks.fill(BlockState::Cleared);
        }
        index
    };
    let color = pass.color.iter().map(|attachment| attachment.as_ref().map(&mut install)).collect();
    let depth = pass.depth.as_ref().map(&mut install);
    let blocks_across = pass.width / BLOCK;
    let blocks = (blocks_across * pass.height / BLOCK) as usize;
    card.passes.begin(PassState {
        number: 0,
        depth_start: None,
        blocks,
        pass: Arc::new(pass),
        color,
        depth,
        blocks_across,
        primitives: 0,
        order: Default::default(),
        signature: None,
        raised: false,
        lowered: false,
    });
}
