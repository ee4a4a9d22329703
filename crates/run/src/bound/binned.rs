//! Passes of tile-based machines: all of a pass is binned into lists in memory; then tile after tile is drawn with its colours and depths on
//! the chip. What lists move through the second level is found in the cache in miniature, as all else is.

use std::ops::Range;

use super::flow::{Pipeline, Rates, UNITS, Work, work_of};
use super::{BLOCKS, Bound, Roofs, compressed};
use mem::REQUEST_BYTES;
use unit::bin::Vertices;
use unit::compression::Codec;
use unit::distribute::Overlap;
use work::profile::{AttachmentProfile, BINS, Cell, DrawProfile, REUSE, Window};
use work::{LINE, TILE};

/// Bytes of a list that are allocated at a time.
const CHUNK: f64 = 256.0;

/// Bytes of a group that the cache in miniature follows.
const GROUP: f64 = 4.0 * LINE as f64;

/// Bytes of an entry, and of one that is compressed: differences of one or two groups of 7 bits.
const ENTRY: [f64; 2] = [4.0, 1.5];

/// Tiles that a pipeline has: four in its queue, and one in hand.
const QUEUED: usize = 5;

/// Bytes of a request in addition to what is written.
const HEADER: f64 = 8.0;

/// The first address of triangles and lists in the miniature cache, in groups of 256 bytes: above all memory that traces use.
const TRIANGLES: u32 = 3 << 28;
const LISTS: u32 = 7 << 27;

/// The lists of a pass.
pub(super) struct Lists {
    /// Entries for each triangle in a screen tile, by draw.
    entries: Vec<f64>,
    /// Bytes of an entry, and of a triangle with those vertices that are kept with it, on average.
    entry: f64,
    triangle: f64,
    /// The rounds of the pass. In each, a part of the pass is binned and then drawn: all of it, or what fits.
    pub rounds: Vec<Round>,
}

/// A part of a pass that is binned and then drawn.
#[derive(Clone, Debug, Default)]
pub(super) struct Round {
    /// The windows of the round.
    windows: Range<usize>,
    /// The first cell of these windows.
    first: usize,
    /// Triangles, and entries of lists.
    triangles: f64,
    entries: f64,
}

/// The followed parts of lists: their first lines, with bytes.
pub(super) struct Followed {
    /// Lines in the order in which they are written.
    pub written: Vec<(u32, u64)>,
    /// Lines in the order in which they are read.
    pub read: Vec<(u32, u64)>,
}

/// The work of a screen tile.
#[derive(Clone, Debug, Default)]
struct TileWork {
    owner: Option<u8>,
    entries: f64,
    /// Blocks with depths, and with colours, some of them again and again.
    blocks: [f64; 2],
    shaded: f64,
    latency: f64,
    work: Work,
}

impl Lists {
    /// Triangles, entries, and bytes of both, of all rounds.
    pub fn sums(&self) -> [f64; 3] {
        let sum = |of: fn(&Round) -> f64| self.rounds.iter().map(of).sum::<f64>();
        let [triangles, entries] = [sum(|round| round.triangles), sum(|round| round.entries)];
        [triangles, entries, triangles * self.triangle + entries * self.entry]
    }

    /// Bytes that are fetched because parts of sectors are written: those of entries.
    pub fn completed(&self) -> f64 {
        self.sums()[1] * self.entry
    }
}

impl Bound<'_> {
    /// Bytes that are kept of a triangle of a draw. Triangles that are drawn have vertices in common as all of the draw have; those of clipped
    /// primitives have their own.
    fn kept_bytes(&self, draw: &DrawProfile) -> f64 {
        let bin = &self.config.bin;
        let primitives = draw.primitives.max(1) as f64;
        let vertices = match bin.vertices {
            Vertices::Each => 3.0,
            Vertices::Once => {
                let clipped = draw.clipped as f64 / primitives;
                let shared = (draw.shaded_vertices[REUSE.len() - 1] as f64 / primitives).min(3.0);
                3.0 * clipped + (1.0 - clipped) * shared
            }
        };
        let vertex = u64::from(bin.position_bytes) + draw.varyings * u64::from(bin.word_bytes);
        f64::from(bin.triangle_bytes) + vertices * vertex as f64
    }

    /// The lists of a pass.
    pub(super) fn lists(&self, draws: &[DrawProfile], windows: &[Window], cells: &[Cell]) -> Lists {
        let bin = &self.config.bin;
        let at = BINS.iter().position(|&edge| edge == bin.tile).unwrap_or(BINS.len() - 1);
        let exact = usize::from(bin.overlap == Overlap::Bounds);
        let ratio = |draw: &DrawProfile| draw.bins[exact][at] as f64 / draw.visits.max(1) as f64;
        let entries: Vec<f64> = draws.iter().map(ratio).collect();
        let own: f64 = windows.iter().map(|window| f64::from(window.triangles)).sum();
        let kept = |window: &Window| f64::from(window.triangles) * self.kept_bytes(&draws[window.draw as usize]);
        let triangle = windows.iter().map(kept).sum::<f64>() / own.max(1.0);
        let triangle = if own > 0.0 { triangle } else { f64::from(bin.triangle_bytes) };
        let entry = ENTRY[usize::from(bin.compression)];
        let (mut rounds, mut round, mut segments, mut first) = (Vec::new(), Round::default(), 0, 0);
        // Fences of all segments that can be kept but one are held back.
        let most = bin.segments.saturating_sub(1).max(1);
        let room = f64::from(bin.memory_kib) * 1024.0;
        for (number, window) in windows.iter().enumerate() {
            let own: f64 = cells[first..window.end as usize].iter().map(|cell| f64::from(cell.triangles)).sum();
            let added = own * entries[window.draw as usize];
            let listed = round.entries + added;
            let kept =
                (round.triangles + f64::from(window.triangles)) * triangle + listed * entry.max(CHUNK / listed.max(64.0));
            if window.begins && segments == most || kept > room && round.triangles > 0.0 {
                let next = Round { windows: number..number, first, ..Round::default() };
                rounds.push(std::mem::replace(&mut round, next));
                segments = 0;
            }
            segments += u32::from(window.begins);
            round.windows.end = number + 1;
            round.triangles += f64::from(window.triangles);
            round.entries += added;
            first = window.end as usize;
        }
        rounds.push(round);
        Lists { entries, entry, triangle, rounds }
    }

    /// Groups of lists and triangles that the cache in miniature follows, in the order in which they are written and read.
    pub(super) fn followed(&self, lists: &Lists, windows: &[Window], cells: &[Cell], size: [u32; 2]) -> Followed {
        let side = (TILE / self.config.bin.tile) as usize;
        let across = size[0].div_ceil(TILE) as usize;
        let follow = |group: u32| self.shared.follows_any(group << 2).then_some((group << 2, 4 * LINE));
        // A run of bytes from a group on, group by group.
        let run = |base: u32, from: f64, to: f64| {
            let [from, to] = [from, to].map(|bytes| bytes as u64);
            let group = GROUP as u64;
            (from / group..to.div_ceil(group)).filter_map(move |at| {
                let own = (base + at as u32) << 2;
                let [begin, end] = [from.max(at * group), to.min((at + 1) * group)].map(|bytes| bytes - at * group);
                let first = begin / LINE;
                self.shared.follows_any(own).then(|| (own + first as u32, end - first * LINE))
            })
        };
        let mut followed = Followed { written: Vec::new(), read: Vec::new() };
        for round in &lists.rounds {
            // 1. Triangles one after another, and lists.
            let groups = |bytes: f64| (bytes / GROUP).ceil() as u32;
            let chunks = groups(round.entries * lists.entry);
            let all = groups(round.triangles * lists.triangle);
            for group in 0..all {
                followed.written.extend(follow(TRIANGLES + group));
                let [from, to] = [group, group + 1].map(|at| u64::from(at) * u64::from(chunks) / u64::from(all.max(1)));
                followed.written.extend((from..to).filter_map(|chunk| follow(LISTS + chunk as u32)));
            }
            // 2. By rows of screen tiles: what of each window is in which.
            let mut rows: Vec<Vec<(u16, f64, f64, f64)>> = vec![Vec::new(); size[1].div_ceil(TILE) as usize];
            let (mut first, mut before) = (round.first, 0.0);
            for window in &windows[round.windows.clone()] {
                // Each cell has its run of the window's triangles.
                let own = &cells[first..window.end as usize];
                let part = f64::from(window.triangles) / own.iter().map(|cell| f64::from(cell.triangles)).sum::<f64>().max(1.0);
                for cell in own {
                    let triangles = f64::from(cell.triangles);
                    let entries = triangles * lists.entries[window.draw as usize];
                    if let Some(row) = rows.get_mut(usize::from(cell.tile[1])) {
                        row.push((cell.tile[0], entries, before, triangles * part));
                    }
                    before += triangles * part;
                }
                first = window.end as usize;
            }
            let (mut listed, mut due) = (0.0, 0.0);
            for row in &mut rows {
                row.sort_by_key(|own| own.0);
                for part in 0..side {
                    for tile in (0..across.min(usize::from(u16::MAX))).filter(|_| !row.is_empty()) {
                        let begin = row.partition_point(|own| usize::from(own.0) < tile);
                        let end = row.partition_point(|own| usize::from(own.0) <= tile);
                        for column in 0..side {
                            let share = 1.0 / (side * side) as f64;
                            for &(_, entries, before, triangles) in &row[begin..end] {
                                // Neighbours on the screen are neighbours in memory.
                                let own = (entries * share).min(triangles);
                                let place = (part * side + column) as f64 * share * triangles;
                                let from = ((before + place) as u64) as f64 * lists.triangle;
                                due += own;
                                followed.read.extend(run(TRIANGLES, from, from + (due as u64) as f64 * lists.triangle));
                                due -= (due as u64) as f64;
                                let [from, to] = [listed, listed + entries * share].map(|n| n * lists.entry);
                                followed.read.extend(run(LISTS, from, to));
                                listed += entries * share;
                            }
                        }
                    }
                }
            }
        }
        followed
    }

    /// Cycles of binning a pass, and then of drawing its tiles, round after round. Reads of lists take `latency`, and the first item of a round `fill`.
    pub(super) fn tiles(
        &self,
        roofs: &mut [Roofs; 2],
        lists: &Lists,
        rates: &[Rates],
        (owners, size): (&[Option<u8>], [u32; 2]),
        (windows, cells): (&[Window], &[Cell]),
        (color, depth): (&[AttachmentProfile], Option<&AttachmentProfile>),
        [latency, fill]: [f64; 2],
    ) -> [f64; 2] {
        let grid = size.map(|pixels| pixels.div_ceil(TILE) as usize);
        let (config, pipelines) = (self.config, self.config.card.pipelines as usize);
        let bin = &config.bin;
        // 1. Binning: triangles in whole requests, and a write for each entry.
        let [triangles, entries, bytes] = lists.sums();
        let bytes = bytes + HEADER * (triangles * lists.triangle / REQUEST_BYTES as f64 + entries);
        let port = f64::from(config.memory.port_width);
        let taken = triangles / f64::from(bin.triangles_per_cycle);
        let units = [("bin", taken.max(entries / f64::from(bin.entries_per_cycle))), ("bin port", bytes / port)];
        units.into_iter().for_each(|(unit, cycles)| roofs[0].add(unit, cycles));
        let binning = units[0].1.max(units[1].1);
        // 2. Reading, line by line, with `bin.misses` requests on their way, for `bin.fifo` triangles at most.
        let entry = (lists.triangle / LINE as f64 * latency / f64::from(bin.misses)).max(lists.triangle / port)
            + lists.entry / CHUNK * latency / f64::from(bin.misses);
        let entry = entry.max((latency + lists.triangle / port) / f64::from(bin.fifo));
        // 3. At the end of a tile its blocks leave one per cycle, and over the port; meanwhile nothing goes on.
        let subtiles = f64::from((TILE / bin.tile).pow(2));
        let leave = |attachment: &AttachmentProfile, codec: Option<Codec>| {
            let part = compressed(attachment, codec);
            if attachment.stores { (attachment.block_bytes as f64 * part / port).max(1.0) } else { 0.0 }
        };
        let color_block: f64 = color.iter().map(|target| leave(target, self.color_codec())).sum();
        let depth_block = depth.map_or(0.0, |depth| leave(depth, self.depth_codec()));

        let mut time = [0.0; 2];
        let waiting = self.waiting()[1];
        // Triangles between reading and rasteriser.
        let ahead = f64::from(bin.fifo + 2 * config.setup.queue);
        let mut sums = vec![[0.0; UNITS.len() + 1]; pipelines];
        for round in &lists.rounds {
            let (mut first, mut geometry) = (round.first, [0.0; 3]);
            let mut tiles: Vec<TileWork> = vec![TileWork::default(); grid[0] * grid[1]];
            for window in &windows[round.windows.clone()] {
                let rates = &rates[window.draw as usize];
                let primitives = f64::from(window.primitives);
                let units = [rates.geometry, rates.vertex_core, rates.vertex_texture];
                geometry.iter_mut().zip(units).for_each(|(sum, cycles)| *sum += primitives * cycles);
                let range = first..window.end as usize;
                for (cell, &owner) in cells[range.clone()].iter().zip(&owners[range]) {
                    let [x, y] = cell.tile.map(usize::from);
                    let Some(tile) = tiles.get_mut(y * grid[0] + x) else { continue };
                    tile.owner = owner;
                    tile.entries += f64::from(cell.triangles) * lists.entries[window.draw as usize];
                    tile.blocks[0] += f64::from(cell.seen);
                    tile.blocks[1] += f64::from(cell.pins);
                    tile.shaded += f64::from(cell.shaded);
                    tile.latency = tile.latency.max(if cell.shaded > 0 { rates.shaded } else { 0.0 });
                    tile.work.iter_mut().zip(work_of(cell, rates)).for_each(|(sum, cycles)| *sum += cycles);
                }
                first = window.end as usize;
            }
            let mut done = vec![Pipeline::default(); pipelines];
            // Tiles are handed out row by row, each when its pipeline's queue has room.
            let mut handed = 0.0_f64;
            let side = (TILE / bin.tile) as usize;
            let places = (0..grid[1] * side)
                .flat_map(|y| (0..grid[0] * side).map(move |x| (y / side * grid[0] + x / side, y % side * side + x % side)));
            for (place, part) in places {
                let tile = &tiles[place];
                // If triangles are few, not all parts have one.
                let parts = subtiles.min(tile.entries);
                if part as f64 >= parts {
                    continue;
                }
                let part = 1.0 / parts.ceil();
                let mut work = tile.work.map(|cycles| cycles * part);
                let entries = tile.entries * part;
                let fetch = entries * entry;
                // The unit that reads lists stands in front of setup.
                let setup = work[0];
                work[0] = setup.max(fetch);
                let whole = |blocks: f64| (blocks * part).min(f64::from(BLOCKS * BLOCKS) / subtiles);
                work[2] += whole(tile.blocks[0]) * depth_block + f64::from(config.depth.latency);
                work[UNITS.len() - 1] += whole(tile.blocks[1]) * color_block + f64::from(config.color.latency);
                let (owners, share) = match tile.owner {
                    Some(pipeline) => (usize::from(pipeline)..usize::from(pipeline) + 1, 1.0),
                    None => (0..pipelines, 1.0 / pipelines as f64),
                };
                for at in owners {
                    let own = work.map(|cycles| cycles * share);
                    handed = handed.max(done[at].read(QUEUED, ahead));
                    done[at].take([entries * share, tile.shaded * part * share], [handed; 2], &own, waiting, tile.latency);
                    sums[at].iter_mut().zip(own).for_each(|(sum, cycles)| *sum += cycles);
                    sums[at][0] += (setup - work[0]) * share;
                    sums[at][UNITS.len()] += fetch * share;
                }
            }
            let share = if triangles > 0.0 { round.triangles / triangles } else { 0.0 };
            time[0] += geometry.into_iter().fold(binning * share, f64::max);
            time[1] += done.iter().map(Pipeline::written).fold(0.0, f64::max);
        }
        for (at, unit) in UNITS.into_iter().chain(["tile_fetch"]).enumerate() {
            roofs[1].add(unit, sums.iter().map(|sums| sums[at]).fold(0.0, f64::max));
        }
        // Between two rounds everything is drained.
        let between = (lists.rounds.len() - 1) as f64 * (fill + rates.iter().map(|rates| rates.shaded).fold(0.0, f64::max));
        [time[0], time[1] + between]
    }
}
