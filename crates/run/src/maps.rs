//! Maps of a frame: what is drawn at each pixel, counted from the work of a rendering in the order of the trace. Every machine has the same.
//!
//! What only a machine knows is noted by one that draws the frame beside that: which of the hidden quads hierarchical Z rejects and which early
//! Z, which lines miss, and when a block is drawn. Its caches are empty when the frame begins.

use std::collections::BTreeMap;
use std::sync::{Arc, PoisonError};

use anyhow::Result;

use super::bound::{Bound, FrameEstimate};
use super::profiles::{Profiled, Reader};
use super::rendering::{Consumer, Rendering, Work};
use super::targets::TargetPictures;
use super::timeline::{Span, Timeline};
use machine::{BlockNotes, Config, Machine, PassNotes};
use num::{Cycle, Limits};
use render::{self, ConsumerMemory, FrameSet};
use sim::Clock;
use trace::Trace;
use unit::interleave::Interleave;
use work::{self, BLOCK, Draw, EndFrame, Event, Funnel, Pass, QUAD_SHADED, RenderKey, Segment, SurfaceKey, TileWork};

/// Cells of a map at most. Larger surfaces have cells of 2x2, 4x4 or more pixels.
const CELLS: u32 = 640 * 1024;

/// Surfaces of which maps are made: the first that a frame draws to.
const SURFACES: usize = 8;

/// Surfaces that are kept: that which is shown, and those with most fragments.
const KEPT: usize = 3;

/// Draws that are named.
const NAMED: usize = 20_000;

/// The quantity that a map counts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum MapKind {
    /// Fragments that triangles cover.
    Overdraw,
    /// Instructions of fragment shaders.
    Cost,
    /// Invocations outside their triangle.
    Waste,
    /// Fragments that are rejected before shading.
    Hidden,
    /// Lines that shaders ask for.
    Lines,
    /// The draw that was last.
    Draw,
    /// Quads that hierarchical Z rejects.
    HierarchicalZ,
    /// Quads that the early test rejects.
    EarlyZ,
    /// Lines that miss.
    Misses,
    /// The time at which it was drawn.
    When,
    /// The cycles of its tile.
    Tile,
}

impl MapKind {
    /// The kinds that are counted from the work, in the order of [`Surface::maps`].
    pub const COUNTED: [MapKind; 6] =
        [MapKind::Overdraw, MapKind::Cost, MapKind::Waste, MapKind::Hidden, MapKind::Lines, MapKind::Draw];

    /// The kinds that a machine notes.
    pub const NOTED: [MapKind; 4] = [MapKind::HierarchicalZ, MapKind::EarlyZ, MapKind::Misses, MapKind::When];

    /// The name.
    pub fn name(self) -> &'static str {
        match self {
            MapKind::Overdraw => "overdraw",
            MapKind::Cost => "shading cost",
            MapKind::Waste => "quad waste",
            MapKind::Hidden => "hidden before shading",
            MapKind::Lines => "memory lines",
            MapKind::Draw => "last draw",
            MapKind::HierarchicalZ => "hierarchical Z rejects",
            MapKind::EarlyZ => "early Z rejects",
            MapKind::Misses => "texture misses",
            MapKind::When => "when",
            MapKind::Tile => "tile cost",
        }
    }

    /// A description of the quantity.
    pub fn about(self) -> &'static str {
        match self {
            MapKind::Overdraw => "Fragments that triangles cover, hidden ones included.",
            MapKind::Cost => "Instructions of fragment shaders, those of helper invocations included.",
            MapKind::Waste => "Helper invocations: the pixel lies outside the triangle, and is shaded for its quad.",
            MapKind::Hidden => "Fragments of quads that depth or stencil rejects whole before shading.",
            MapKind::Lines => {
                "Lines of 64 bytes that the shaders of the pixel's quads ask of textures and buffers; each counts for all four pixels."
            }
            MapKind::HierarchicalZ => {
                "Quads of the block of 8x8 pixels that hierarchical Z rejects on this machine, before they are tested."
            }
            MapKind::EarlyZ => {
                "Quads of the block of 8x8 pixels that the early depth and stencil test rejects on this machine."
            }
            MapKind::Misses => {
                "Lines that the shaders of the block of 8x8 pixels ask for and that miss the texture cache of this machine."
            }
            MapKind::When => "The cycle of the frame in which the block of 8x8 pixels was written last on this machine.",
            MapKind::Tile => {
                "The cycles of the tile on this machine: from the last pixel of the tile before it in its pipeline to its own last, summed over passes."
            }
            MapKind::Draw => {
                "The draw whose fragment was shaded last, in the order of the trace. In a quad that is hidden in part, and behind a late depth test, it need not be the one that is seen."
            }
        }
    }

    /// The unit of a value, and the part of the surface that it belongs to if that is larger than a cell.
    pub fn unit(self) -> &'static str {
        match self {
            MapKind::Overdraw | MapKind::Hidden => "fragments",
            MapKind::Cost => "instructions",
            MapKind::Waste => "helper invocations",
            MapKind::Lines => "lines of 64 bytes",
            MapKind::Draw => "",
            MapKind::HierarchicalZ | MapKind::EarlyZ => "quads in the 8x8 block",
            MapKind::Misses => "lines in the 8x8 block",
            MapKind::When => "cycles after the frame began, for the 8x8 block",
            MapKind::Tile => "cycles for the tile",
        }
    }

    /// Whether values are numbers of draws, each one higher, and 0 is none.
    pub fn is_draw(self) -> bool {
        self == MapKind::Draw
    }
}

/// A map.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Map {
    /// The quantity that it counts.
    pub kind: MapKind,
    /// A value a cell, row by row: the sum over its pixels, or the last draw's.
    pub values: Vec<u32>,
}

/// The maps of a surface.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Surface {
    /// The texture, with its level and layer where they are not 0.
    pub name: String,
    /// Whether the frame shows this surface.
    pub shown: bool,
    /// Width in pixels.
    pub width: u32,
    /// Height in pixels.
    pub height: u32,
    /// Edge of a cell in pixels: a power of two.
    pub cell: u32,
    /// Cells in a row.
    pub columns: u32,
    /// Rows of cells.
    pub rows: u32,
    /// Passes that draw to it, by their numbers in the frame.
    pub passes: Vec<u32>,
    /// Maps, by [`MapKind::COUNTED`]; behind them those of [`MapKind::NOTED`], where a machine has drawn the frame.
    pub maps: Vec<Map>,
}

/// A draw of the frame.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Named {
    /// Its number in the frame.
    pub number: u32,
    /// Its label, or empty.
    pub label: String,
    /// Its pass.
    pub pass: u32,
}

/// The maps of a frame.
#[derive(Clone, Debug, Default)]
pub struct Maps {
    /// Surfaces: the one that is shown first, then those with most fragments.
    pub surfaces: Vec<Surface>,
    /// Surfaces that the frame draws to and that have no maps here.
    pub left_out: usize,
    /// The draws.
    pub draws: Vec<Named>,
    /// The counts of the frame's stages, in the order of the trace.
    pub funnel: Funnel,
}

/// Edge of a cell so that a surface has at most [`CELLS`].
fn cell(width: u32, height: u32) -> u32 {
    let mut cell = 1;
    while width.div_ceil(cell).saturating_mul(height.div_ceil(cell)) > CELLS {
        cell *= 2;
    }
    cell
}

/// Maps that grow with the events of a frame.
#[derive(Default)]
struct Growing {
    surfaces: Vec<(SurfaceKey, Surface)>,
    left_out: Vec<SurfaceKey>,
    draws: Vec<Named>,
    funnel: Funnel,
    /// The surface of the pass that is open, by its place.
    open: Option<usize>,
    pass: u32,
    draw: Option<Arc<Draw>>,
}

impl Growing {
    fn begin(&mut self, pass: &Pass) {
        let attachment = pass.color.iter().flatten().next().or(pass.depth.as_ref());
        (self.open, self.pass) = (None, pass.number);
        let Some(key) = attachment.map(|attachment| attachment.surface.key) else { return };
        let at = self.surfaces.iter().position(|(known, _)| *known == key);
        if at.is_none() && self.surfaces.len() == SURFACES {
            if !self.left_out.contains(&key) {
                self.left_out.push(key);
            }
            return;
        }
        let at = at.unwrap_or_else(|| {
            self.surfaces.push((key, Surface::new(key, pass.width, pass.height)));
            self.surfaces.len() - 1
        });
        self.surfaces[at].1.passes.push(pass.number);
        self.open = Some(at);
    }

    fn segment(&mut self, segment: &Segment) {
        self.funnel += segment.funnel;
        let (Some(at), Some(draw)) = (self.open, &self.draw) else { return };
        for tile in &segment.tiles {
            self.surfaces[at].1.tile(tile, draw);
        }
    }

    fn end(self, end: &EndFrame) -> Maps {
        let mut surfaces: Vec<Surface> = Vec::new();
        for (key, mut surface) in self.surfaces {
            surface.shown = end.shown.is_some_and(|shown| shown.key == key);
            surfaces.push(surface);
        }
        let fragments = |surface: &Surface| surface.maps[0].values.iter().map(|&value| u64::from(value)).sum::<u64>();
        surfaces.retain(|surface| fragments(surface) > 0);
        surfaces.sort_by_cached_key(|surface| (!surface.shown, std::cmp::Reverse(fragments(surface))));
        let left_out = self.left_out.len() + surfaces.len().saturating_sub(KEPT);
        surfaces.truncate(KEPT);
        Maps { surfaces, left_out, draws: self.draws, funnel: self.funnel }
    }
}

impl Surface {
    fn new(key: SurfaceKey, width: u32, height: u32) -> Surface {
        let mut name = format!("texture {}", key.texture);
        if key.level > 0 {
            name.push_str(&format!(", level {}", key.level));
        }
        if key.layer > 0 {
            name.push_str(&format!(", layer {}", key.layer));
        }
        let cell = cell(width, height);
        let (columns, rows) = (width.div_ceil(cell), height.div_ceil(cell));
        let cells = columns as usize * rows as usize;
        let maps = MapKind::COUNTED.map(|kind| Map { kind, values: vec![0; cells] }).to_vec();
        Surface { name, shown: false, width, height, cell, columns, rows, passes: Vec::new(), maps }
    }

    /// Adds the maps of what a machine has noted. Cells have the value of their block, larger ones that of all their blocks.
    fn add_notes(&mut self, notes: &[PassNotes]) {
        let own: Vec<&PassNotes> = notes.iter().filter(|of| self.passes.contains(&of.pass)).collect();
        for kind in MapKind::NOTED {
            let value = |of: &BlockNotes| match kind {
                MapKind::HierarchicalZ => of.hierarchical.into(),
                MapKind::EarlyZ => of.early.into(),
                MapKind::Misses => of.misses.into(),
                _ => of.drawn,
            };
            let join = |a: u64, b: u64| if kind == MapKind::When { a.max(b) } else { a + b };
            let side = self.cell.div_ceil(BLOCK);
            let at = |cell: u32| {
                let [column, row] = [cell % self.columns, cell / self.columns].map(|at| at * self.cell / BLOCK);
                let blocks = (row..row + side).flat_map(|y| (column..column + side).map(move |x| (x, y)));
                let of = |notes: &PassNotes, (x, y): (u32, u32)| {
                    let inside = x < notes.across;
                    notes.blocks.get((y * notes.across + x) as usize).filter(|_| inside).map_or(0, value)
                };
                let all = blocks.flat_map(|at| own.iter().map(move |notes| of(notes, at)));
                all.fold(0, join).min(u32::MAX.into()) as u32
            };
            let values = (0..self.columns * self.rows).map(at).collect();
            self.maps.push(Map { kind, values });
        }
    }

    /// Adds the cycles of tiles, of a machine whose pipelines draw them one after another.
    fn add_tiles(&mut self, notes: &[PassNotes], config: &Config) {
        let side = (config.bin.tile / BLOCK).max(1);
        let across = self.width.div_ceil(config.bin.tile);
        let mut costs = vec![0; (across * self.height.div_ceil(config.bin.tile)) as usize];
        let mut interleave = Interleave::new(config.distribute.pattern, config.card.pipelines, config.owned_tile());
        interleave.begin_pass(self.width, self.height);
        for pass in notes.iter().filter(|of| self.passes.contains(&of.pass)) {
            // By pipeline, when each tile was drawn: the first and the last of it.
            let mut drawn: BTreeMap<(u8, u32), [Cycle; 2]> = BTreeMap::new();
            for (at, block) in (0..).zip(&pass.blocks).filter(|(_, block)| block.drawn > 0) {
                let [x, y] = [at % pass.across / side, at / pass.across / side];
                let times = drawn.entry((interleave.owner(x * side, y * side), y * across + x)).or_insert([block.drawn; 2]);
                *times = [times[0].min(block.drawn), times[1].max(block.drawn)];
            }
            let mut tiles: Vec<(u8, [Cycle; 2], u32)> =
                drawn.into_iter().map(|((owner, tile), at)| (owner, at, tile)).collect();
            tiles.sort_by_key(|&(owner, [_, last], tile)| (owner, last, tile));
            let mut before = None;
            for (owner, [first, last], tile) in tiles {
                let since = before.filter(|&(known, _)| known == owner).map_or(first, |(_, last)| last);
                if let Some(cost) = costs.get_mut(tile as usize) {
                    *cost += last - since;
                }
                before = Some((owner, last));
            }
        }
        let at = |cell: u32| {
            let [x, y] = [cell % self.columns, cell / self.columns].map(|at| at * self.cell / config.bin.tile);
            costs.get((y * across + x) as usize).map_or(0, |&cost| cost.min(u32::MAX.into()) as u32)
        };
        let values = (0..self.columns * self.rows).map(at).collect();
        self.maps.push(Map { kind: MapKind::Tile, values });
    }

    /// Counts the quads of a draw in a screen tile.
    fn tile(&mut self, tile: &TileWork, draw: &Draw) {
        // The instructions of each cost.
        let costs: Vec<u32> = tile.invocations.costs.costs.iter().map(|cost| cost.instructions().iter().sum()).collect();
        let requests: Vec<usize> = tile.invocations.costs.costs.iter().map(work::Cost::requests).collect();
        let shades = draw.shades();
        for block in &tile.blocks {
            let first = block.first_quad as usize;
            for quad in &tile.quads[first..first + usize::from(block.quads)] {
                let shaded = quad.flags & QUAD_SHADED != 0;
                let (cost, lines) = if shaded && shades {
                    let own = quad.first_request as usize..quad.first_request as usize + requests[usize::from(quad.cost)];
                    let lines = tile.invocations.requests[own].iter().map(|request| u32::from(request.lines)).sum();
                    (costs[usize::from(quad.cost)], lines)
                } else {
                    (0, 0)
                };
                for pixel in 0..4 {
                    let has = |samples: u16| samples >> pixel & 0x1111 != 0;
                    let x = u32::from(block.x) * BLOCK + u32::from(quad.position % 4) * 2 + (pixel & 1);
                    let y = u32::from(block.y) * BLOCK + u32::from(quad.position / 4) * 2 + (pixel >> 1);
                    // Helpers of the last column or row may lie outside.
                    if x >= self.width || y >= self.height {
                        continue;
                    }
                    let at = (y / self.cell * self.columns + x / self.cell) as usize;
                    let covered = has(quad.coverage);
                    let mut add = |kind: MapKind, value: u32| {
                        let cell = &mut self.maps[kind as usize].values[at];
                        *cell = cell.saturating_add(value);
                    };
                    add(MapKind::Overdraw, u32::from(covered));
                    add(MapKind::Cost, cost);
                    add(MapKind::Lines, lines);
                    add(MapKind::Waste, u32::from(shades && shaded && !covered));
                    add(MapKind::Hidden, u32::from(shades && !shaded && covered));
                    if has(quad.kept) && (shaded || !shades) {
                        self.maps[MapKind::Draw as usize].values[at] = draw.number.saturating_add(1);
                    }
                }
            }
        }
    }
}

/// Has a machine draw the frame, and takes what it notes.
fn noting<'c>(config: &Config, limits: &Limits, out: &'c mut (Vec<PassNotes>, Option<Timeline>)) -> Result<Consumer<'c>> {
    let mut machine = Machine::new(config)?.within(limits);
    let mut timeline = Timeline::new(config, None)?;
    machine.watch_blocks();
    machine.watch_draws();
    let memory = ConsumerMemory { images: Machine::images(config), pieces: Machine::pieces(config), frames: false };
    let run = move |work: Work| {
        let mut phases = Vec::new();
        machine.run_watched(work, Clock::default(), |frame| phases = Span::of(&frame), Some(&mut timeline))?;
        timeline.phases = phases;
        *out = (machine.take_notes(), Some(timeline));
        Ok(())
    };
    Ok(Consumer { memory, recorded: true, stored: false, run: Box::new(run) })
}

/// Counts the maps of the frame that the events are of.
fn counting<'c>(out: &'c mut Maps) -> Consumer<'c> {
    let run = move |work: Work| {
        let mut growing = Growing::default();
        for event in work {
            match event {
                Event::BeginPass(pass) => growing.begin(&pass),
                Event::Draw(draw) => {
                    if growing.draws.len() < NAMED {
                        growing.draws.push(Named { number: draw.number, label: draw.label.clone(), pass: growing.pass });
                    }
                    growing.draw = Some(draw);
                }
                Event::Segment(segment) => growing.segment(&segment),
                Event::EndPass(_) => growing.open = None,
                Event::EndFrame(end) => *out = std::mem::take(&mut growing).end(&end),
                _ => {}
            }
        }
        Ok(())
    };
    Consumer { memory: ConsumerMemory::default(), recorded: true, stored: false, run: Box::new(run) }
}

/// The details of a frame that one more rendering of it finds.
#[derive(Debug, Default)]
pub struct FrameDetails {
    /// The maps.
    pub maps: Maps,
    /// The time of its phases by counts and rates; none where the machine has a knob whose effect is not estimated. What earlier frames have left
    /// in caches is not in it.
    pub estimate: Option<FrameEstimate>,
    /// The activity of units and channels, if a machine has drawn the frame.
    pub timeline: Option<Timeline>,
    /// Small pictures of the attachments of its passes.
    pub targets: TargetPictures,
}

/// Renders one frame for its maps and its estimate; `timed`: has a machine draw it, too, which notes what only it knows.
///
/// # Errors
/// If the trace cannot be rendered.
pub fn details(trace: &Trace, config: &Config, frame: u32, timed: bool) -> Result<FrameDetails> {
    let (mut details, mut notes) = (FrameDetails::default(), (Vec::new(), None));
    let (reader, targets) = TargetPictures::reader();
    let frames = FrameSet::from(frame..frame.saturating_add(1));
    let options = render::Options { frames, targets: Some(reader), ..render::Options::default() };
    let mut rendering = Rendering::new(trace, options);
    let key: RenderKey = config.render_key();
    rendering.consume(key, counting(&mut details.maps));
    if timed {
        rendering.consume(key, noting(config, rendering.limits(), &mut notes)?);
    }
    if let Ok(mut bound) = Bound::new(config) {
        let out = &mut details.estimate;
        let read = move |frames: &[Profiled]| {
            if let Some(frame) = frames.last() {
                *out = Some(bound.frame(&frame.profile));
            }
            Ok(())
        };
        rendering.profile(key, Reader { keeps: false, read: Box::new(read) });
    }
    rendering.run()?;
    details.targets = std::mem::take(&mut targets.lock().unwrap_or_else(PoisonError::into_inner));
    if timed {
        for surface in &mut details.maps.surfaces {
            surface.add_notes(&notes.0);
            if config.card.sort.class().one_place {
                surface.add_tiles(&notes.0, config);
            }
        }
        details.timeline = notes.1;
    }
    Ok(details)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn large_surfaces_have_larger_cells() {
        assert_eq!([cell(800, 600), cell(1920, 1080), cell(16384, 16384), cell(1, 1)], [1, 2, 32, 1]);
    }
}
