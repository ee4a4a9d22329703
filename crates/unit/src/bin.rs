//! Binning: sorts the triangles of a pass into lists, one for each tile of the screen, in memory; then hands out tile after tile. If the
//! memory for lists is full, or as many segments are in lists as can be kept, what is there is drawn first: a partial render. A segment is
//! reported when all of it is binned: then the geometry in front of the bins is free for others.

use std::collections::VecDeque;

use super::card::{Card, TileEntry, Work};
use super::distribute::Overlap;
use super::network::Receiver;
use super::rendering_elimination;
use super::sorting::{Keep, Merge, OrderCounts, SortCounts};
use super::token::{Ack, Kind, TileToken, TriangleToken};
use gfx::stage::Stage;
use knob::Allowed;
use mem::{MemoryPort, REQUEST_BYTES, requests};
use sim::{Budget, Counted, In, Out, StallProbe, Tick, Unit, Wires};
use stats::Heading;
use work::{BLOCK, End, Signature, Triangle};

knob::choices! {
    /// How often vertices of triangles in lists are kept.
    pub enum Vertices {
        /// Once for all triangles of a segment that have them; those of clipped triangles for each.
        Once "once",
        /// For each triangle.
        Each "each",
    }
}

knob::knobs! {
    /// Binning of triangles into the lists of tiles.
    pub struct BinConfig {
        /// Edge of a tile, whose colours and depths are kept on the chip.
        tile: u32 ["pixels", Allowed::PowerOfTwo(8, 64), "16 (Arm Mali) to 32 (Imagination PowerVR)"]
            {estimate: Used, relax: Never, advice: []},
        /// Triangles binned per cycle.
        triangles_per_cycle: u32 ["triangles/cycle", Allowed::Range(1, 16), "assumed: one, as the clipper delivers them"]
            {estimate: Used, relax: Rate, advice: []},
        /// Entries of lists written per cycle.
        entries_per_cycle: u32 ["entries/cycle", Allowed::Range(1, 64), "assumed: one tile per cycle"]
            {estimate: Used, relax: Rate, advice: []},
        /// How precisely the tiles of a triangle are found.
        overlap: Overlap ["", Allowed::Choice(Overlap::NAMES), "exact (\"perfect tiling\") since 2010; bounding boxes before (Antochi et al. 2004)"]
            {estimate: Used, relax: Skip(&[("exact", "triangles binned exactly")]), advice: []},
        /// Bytes that are kept of a triangle besides its vertices, for all tiles that it is in the list of.
        triangle_bytes: u32 ["bytes", Allowed::Range(1, 1024), "assumed: three references to vertices"]
            {estimate: Used, relax: Never, advice: []},
        /// How often transformed vertices are kept.
        vertices: Vertices ["", Allowed::Choice(Vertices::NAMES), "assumed: as index buffers have them; a draw is kept in parts"]
            {estimate: Used, relax: Never, advice: []},
        /// Bytes that are kept of a vertex's position.
        position_bytes: u32 ["bytes", Allowed::Range(1, 64), "assumed: four components of 32 bits"]
            {estimate: RefusedUnless(AtMost(32), "long vertices in lists of tiles"), relax: Never, advice: []},
        /// Bytes that are kept of each word that a vertex has for the fragment stage.
        word_bytes: u32 ["bytes", Allowed::Range(1, 4), "assumed: 2, packed to 16 bits; 4 without compression"]
            {estimate: RefusedUnless(AtMost(2), "long vertices in lists of tiles"), relax: Never, advice: []},
        /// Whether entries of lists are stored as differences to the one before: 1 to 5 bytes instead of 4.
        compression: bool ["", Allowed::Switch, "variable-length differences"]
            {estimate: Used, relax: Skip(&[("true", "compressed bins")]), advice: []},
        /// Whether opaque quads of a tile are held back until it is known which of them are seen, and only these are shaded.
        hide: bool ["", Allowed::Switch, "deferred shading of Imagination PowerVR; others rely on early tests"]
            {estimate: RefusedUnless(Is(&["false"]), "quads that are held back"), relax: Skip(&[("true", "hidden surfaces removed by tiles")]), advice: []},
        /// Whether a tile is left out that memory has already, since all that goes into it is as when it was drawn last. Signatures are kept
        /// on the chip, and made while triangles are binned.
        skip_same_tiles: bool ["", Allowed::Switch, "rendering elimination (Anglada et al. 2019); Arm Mali compares what was drawn instead"]
            {estimate: RefusedUnless(Is(&["false"]), "tiles that are left out"), relax: Skip(&[("true", "unchanged tiles not drawn")]), advice: []},
        /// Memory for triangles and lists.
        memory_kib: u32 ["KiB", Allowed::Range(1, 4194304), "assumed: parameter buffers of 2 to 64 MB in phones"]
            {estimate: Used, relax: Never, advice: []},
        /// Segments of draws whose triangles are in lists, or on their way there.
        segments: u32 ["segments", Allowed::Range(1, 65535), "assumed: the states of draws lie in memory, as lists do"]
            {estimate: Used, relax: Room, advice: []},
        /// Requests for lists and triangles in flight, in each pipeline.
        misses: u32 ["requests", Allowed::Range(4, 1024), "assumed: covers the latency of memory"]
            {estimate: Used, relax: Room, advice: []},
        /// Lines of 64 bytes of triangles and vertices that each pipeline keeps for the next triangles.
        cache_lines: u32 ["lines", Allowed::PowerOfTwo(4, 4096), "assumed: 8 KB, the vertices of a tile and its neighbour"]
            {estimate: RefusedUnless(AtLeast(32), "vertices that tiles read again"), relax: Cache, advice: []},
        /// Triangles read ahead of their setup, in each pipeline.
        fifo: u32 ["triangles", Allowed::Range(1, 1024), "assumed: covers the latency of memory"]
            {estimate: Used, relax: Room, advice: []},
    }
}

impl BinConfig {
    /// Bytes that are kept of a vertex of a segment.
    pub fn vertex_bytes(&self, work: &Work) -> u64 {
        let words = work.draw.shape(Stage::Fragment).inputs;
        u64::from(self.position_bytes + words * self.word_bytes)
    }

    /// Whether a triangle shares its vertices with others. Clipping makes new ones.
    pub fn shares(&self, work: &Work, triangle: u32) -> bool {
        let primitive = work.segment.triangles[triangle as usize].primitive;
        self.vertices == Vertices::Once && !work.segment.primitives[primitive as usize].clipped
    }
}

/// The vertices of a triangle, line or point, each once.
pub(super) fn distinct(work: &Work, triangle: u32) -> impl Iterator<Item = u32> + use<> {
    let primitive = work.segment.triangles[triangle as usize].primitive;
    let own = work.segment.primitives[primitive as usize].vertices;
    (0..3).filter(move |&n| !own[..n].contains(&own[n])).map(move |n| own[n])
}

/// The heading of binning in the statistics.
pub const BINNING: Heading = Heading::new("binning", "Sort-middle-binned: the lists of tiles.");

stats::counters! {
    /// What binning costs.
    pub struct BinCounts {
        /// Vertices written.
        vertices: "vertices",
        /// Bytes of triangles and vertices written.
        triangle_bytes: "bytes",
        /// Bytes of list entries written.
        list_bytes: "bytes",
        /// Bytes of lists, triangles and vertices read back.
        read_bytes: "bytes",
        /// Tiles drawn.
        tiles: "tiles",
        /// Tiles whose lists are empty.
        empty_tiles: "tiles",
        /// Tiles that rendering elimination did not draw.
        same_tiles: "tiles",
        /// Times that tiles had to be drawn before all of the pass was binned.
        partial_renders: "times",
        /// Of these, times that the memory for triangles and lists was full.
        memory_full: "times",
        /// Of these, times that as many segments were in lists as can be kept.
        segments_full: "times",
    }
}

/// The first address of triangles, with their vertices, and of lists in memory: above all memory that traces use.
const TRIANGLES: u64 = 1 << 40;
const LISTS: u64 = 1 << 41;

/// Bytes of lists that are allocated at a time.
pub(super) const CHUNK: u64 = 256;

/// A tile's list as it is written.
#[derive(Clone, Copy, Debug, Default)]
struct Writing {
    /// Bytes of entries, and the address of the open chunk.
    bytes: u64,
    chunk: u64,
    /// The number of the triangle that its last entry names.
    last: u64,
    /// The signature of all triangles in the list.
    signature: Signature,
}

/// The state of binning.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum State {
    /// Triangles come in.
    Binning,
    /// Tiles are handed out, from this one on; whether more of the pass follows.
    Drawing { tile: u32, partial: bool },
    /// Fences that have arrived are sent on to the pipelines that have not received the first.
    Fences { pending: u64, partial: bool },
    /// Lists are read: reports still to come.
    Reading { left: u32 },
}

/// Ports of binning.
#[derive(Clone)]
pub struct BinPorts {
    /// Triangles from all geometry units.
    pub input: Receiver<TriangleToken>,
    /// Tiles to each pipeline.
    pub tiles: Vec<Out<TileToken>>,
    /// Reports of pipelines, each that it has read all lists.
    pub read: Vec<In<TileToken>>,
    /// Segments that are binned, to the command processor.
    pub binned: Out<Ack>,
    /// Memory, for lists.
    pub memory: MemoryPort,
}

/// Binning. Its items are triangles.
#[derive(Clone)]
pub struct Bin {
    config: BinConfig,
    /// Segments that can be kept: one less of their fences is held back, so that one more can be binned meanwhile.
    segments: u32,
    ports: BinPorts,
    state: State,
    merge: Merge,
    /// Tiles of the current triangle that have still to be listed: a rectangle or a list, and the next of them.
    tiles: Vec<u32>,
    next: usize,
    /// Lists as they are written, by tile.
    lists: Vec<Writing>,
    /// Triangles kept, bytes that they and their vertices take, and those of these bytes that have been given to the port.
    triangles: u64,
    kept: u64,
    sent: u64,
    /// The address of the current triangle's record.
    record: u64,
    /// Chunks allocated.
    chunks: u64,
    /// Fences held back until tiles are drawn.
    fences: VecDeque<(u16, Kind)>,
    /// Writes that wait for the port: address and bytes. Neighbours are one.
    writes: VecDeque<(u64, u32)>,
    /// The inputs of the pass's tiles are not all known: a draw has no signature, or some tiles have been drawn already.
    unsigned: bool,
    counts: BinCounts,
    sorting: SortCounts,
}

/// Writes that may wait for the port before binning does.
const WRITES: usize = 64;

impl Bin {
    /// An empty bin unit, for a machine that keeps `segments` segments.
    pub fn new(config: BinConfig, keep: Keep, segments: u32, ports: BinPorts) -> Bin {
        Bin {
            config,
            segments,
            merge: Merge::new(keep, StallProbe::default(), &ports.input),
            ports,
            state: State::Binning,
            tiles: Vec::new(),
            next: 0,
            lists: Vec::new(),
            triangles: 0,
            kept: 0,
            sent: 0,
            record: 0,
            chunks: 0,
            fences: VecDeque::new(),
            writes: VecDeque::new(),
            unsigned: false,
            counts: BinCounts::default(),
            sorting: SortCounts::default(),
        }
    }

    /// The counters of the unit.
    pub fn counts(&self) -> BinCounts {
        self.counts
    }

    /// Triangles and their copies in lists.
    pub fn sorting(&self) -> SortCounts {
        self.sorting
    }

    /// The counters of the unit's waits for the order.
    pub fn order(&self) -> OrderCounts {
        self.merge.counts()
    }

    /// Blocks across a tile.
    fn side(&self) -> u32 {
        self.config.tile / BLOCK
    }

    /// Tiles across and down the pass.
    fn grid(&self, card: &Card) -> (u32, u32) {
        let pass = card.passes.current().map_or((0, 0), |pass| (pass.pass.width, pass.pass.height));
        (pass.0.div_ceil(self.config.tile), pass.1.div_ceil(self.config.tile))
    }

    /// Finds the tiles of a triangle.
    fn find_tiles(&mut self, card: &Card, work: &Work, triangle: &Triangle) {
        self.tiles.clear();
        self.next = 0;
        let (across, _) = self.grid(card);
        let side = self.side();
        match if triangle.end == End::Nowhere { self.config.overlap } else { Overlap::Bounds } {
            Overlap::Bounds => {
                let [x0, y0, x1, y1] = triangle.bounds.map(u32::from);
                if x0 < x1 && y0 < y1 {
                    for y in y0 / side..y1.div_ceil(side) {
                        self.tiles.extend((x0 / side..x1.div_ceil(side)).map(|x| y * across + x));
                    }
                }
            }
            Overlap::Exact => {
                for visit in work.visits(triangle) {
                    let tile = &work.segment.tiles[visit.tile as usize];
                    for block in &tile.blocks[visit.first_block as usize..][..visit.blocks as usize] {
                        let number = u32::from(block.y) / side * across + u32::from(block.x) / side;
                        if self.tiles.last() != Some(&number) {
                            self.tiles.push(number);
                        }
                    }
                }
                self.tiles.sort_unstable();
                self.tiles.dedup();
            }
        }
    }

    /// Bytes that an entry takes in a list.
    fn entry_bytes(&self, tile: u32) -> u32 {
        if !self.config.compression {
            return 4;
        }
        let difference = self.triangles - 1 - self.lists[tile as usize].last;
        (u64::BITS - (difference | 1).leading_zeros()).div_ceil(7)
    }

    /// Bytes of memory in use.
    fn used(&self) -> u64 {
        self.kept + self.chunks * CHUNK
    }

    /// Keeps a triangle, whose tiles are known, with those of its vertices that are not kept yet.
    fn keep(&mut self, card: &mut Card, token: TriangleToken) {
        let Card { work, kept, .. } = card;
        let work = work[usize::from(token.slot)].as_ref().expect("a triangle's segment is in flight");
        let (before, bytes) = (self.kept, self.config.vertex_bytes(work));
        for vertex in distinct(work, token.triangle) {
            let shared = self.config.shares(work, token.triangle);
            if shared && kept.of(token.slot, vertex).is_some() {
                continue;
            }
            if shared {
                kept.keep(token.slot, (vertex, work.segment.vertices.len()), TRIANGLES + self.kept);
            }
            self.kept += bytes;
            self.counts.vertices += 1;
        }
        self.record = TRIANGLES + self.kept;
        self.kept += u64::from(self.config.triangle_bytes);
        self.triangles += 1;
        self.counts.triangle_bytes += self.kept - before;
        self.send(self.kept / REQUEST_BYTES * REQUEST_BYTES);
    }

    /// Gives what is kept to the port, up to some byte: whole requests, until the last.
    fn send(&mut self, to: u64) {
        if to > self.sent {
            self.writes.extend(requests(TRIANGLES + self.sent, (to - self.sent) as u32));
            self.sent = to;
        }
    }

    fn write(&mut self, address: u64, bytes: u32) {
        if let Some((last, length)) = self.writes.back_mut()
            && *last + u64::from(*length) == address
            && *last / REQUEST_BYTES == (address + u64::from(bytes) - 1) / REQUEST_BYTES
        {
            *length += bytes;
            return;
        }
        self.writes.extend(requests(address, bytes));
    }

    /// Appends the current triangle to a tile's list.
    fn append(&mut self, card: &mut Card, tile: u32, token: TriangleToken) {
        let bytes = self.entry_bytes(tile);
        // The current triangle is kept already.
        let number = self.triangles - 1;
        let list = &mut self.lists[tile as usize];
        let mut left = u64::from(bytes);
        let mut parts = [(0, 0); 2];
        for part in &mut parts {
            if left == 0 {
                break;
            }
            if list.bytes.is_multiple_of(CHUNK) {
                list.chunk = LISTS + self.chunks * CHUNK;
                self.chunks += 1;
                card.bins[tile as usize].chunks.push(list.chunk);
            }
            let run = left.min(CHUNK - list.bytes % CHUNK);
            *part = (list.chunk + list.bytes % CHUNK, run as u32);
            list.bytes += run;
            left -= run;
        }
        list.last = number;
        if card.passes.current().is_some_and(|pass| pass.signature.is_some()) {
            match rendering_elimination::add(list.signature, card.work(token.slot), token.triangle) {
                Some(signature) => list.signature = signature,
                None => self.unsigned = true,
            }
        }
        for (address, bytes) in parts.into_iter().filter(|&(_, bytes)| bytes > 0) {
            self.write(address, bytes);
        }
        let TriangleToken { slot, triangle, .. } = token;
        card.bins[tile as usize].push(TileEntry { slot, bytes: bytes as u8, triangle, address: self.record });
        self.counts.list_bytes += u64::from(bytes);
        self.sorting.copy(1, bytes, false);
    }

    /// Takes triangles in.
    fn bin(&mut self, wires: &mut Wires, card: &mut Card) -> Tick {
        let mut did = Tick::Starved;
        let mut triangles = Budget::new(self.config.triangles_per_cycle);
        let mut entries = Budget::new(self.config.entries_per_cycle);
        loop {
            if self.writes.len() >= WRITES {
                return did.or(Tick::Blocked);
            }
            let Some((from, token)) = self.merge.next(wires, &self.ports.input) else { return did };
            match token.kind {
                Kind::DATA => {}
                Kind::END => {
                    self.merge.take(wires, &mut self.ports.input, from, token);
                    did = Tick::Moved;
                    continue;
                }
                kind => {
                    // A fence is held back until what came before it is drawn: at the end of the pass, or when no more can be.
                    let partial = kind != Kind::PASS;
                    if partial && !wires.try_push(&self.ports.binned, Ack { slot: token.slot, kind }) {
                        return did.or(Tick::Blocked);
                    }
                    self.merge.take(wires, &mut self.ports.input, from, token);
                    self.fences.push_back((token.slot, kind));
                    if !partial {
                        self.draw(false);
                        return Tick::Moved;
                    }
                    if self.fences.len() as u32 + 1 >= self.segments {
                        self.counts.segments_full += 1;
                        self.draw(true);
                        return Tick::Moved;
                    }
                    did = Tick::Moved;
                    continue;
                }
            }
            // A triangle: its tiles are found, then entered one after the other.
            if self.tiles.is_empty() {
                if !triangles.spend() {
                    return Tick::Moved;
                }
                let (across, down) = self.grid(card);
                let tiles = (across * down) as usize;
                if self.lists.len() != tiles {
                    self.lists = vec![Writing::default(); tiles];
                    card.bins.resize_with(tiles, Default::default);
                }
                let work = card.work[usize::from(token.slot)].as_ref().expect("a triangle's segment is in flight");
                let triangle = &work.segment.triangles[token.triangle as usize];
                // The largest triangle takes a chunk in every list, and no vertex of it is kept.
                self.find_tiles(card, work, triangle);
                let vertices = 3 * self.config.vertex_bytes(work);
                let need = vertices + u64::from(self.config.triangle_bytes) + self.tiles.len() as u64 * CHUNK;
                if self.triangles > 0 && self.used() + need > u64::from(self.config.memory_kib) << 10 {
                    self.tiles.clear();
                    self.counts.memory_full += 1;
                    self.draw(true);
                    return Tick::Moved;
                }
                self.sorting.sorted_items += 1;
                did = Tick::Moved;
                if self.tiles.is_empty() {
                    self.merge.take(wires, &mut self.ports.input, from, token);
                    continue;
                }
                self.sorting.sent += 1;
                self.keep(card, token);
            }
            while let Some(&tile) = self.tiles.get(self.next) {
                if !entries.spend() || self.writes.len() >= WRITES {
                    return Tick::Moved;
                }
                self.append(card, tile, token);
                self.next += 1;
                did = Tick::Moved;
            }
            self.tiles.clear();
            self.merge.take(wires, &mut self.ports.input, from, token);
        }
    }

    /// Begins to draw.
    fn draw(&mut self, partial: bool) {
        self.counts.partial_renders += u64::from(partial);
        self.unsigned |= partial;
        self.send(self.kept);
        self.state = State::Drawing { tile: 0, partial };
    }

    /// Whether rendering elimination leaves out a tile: memory holds its result, and all of the pass is binned.
    fn eliminates(&self, card: &mut Card, tile: u32) -> bool {
        let grid = self.grid(card);
        let Card { passes, frame, .. } = card;
        match passes.current() {
            Some(pass) if !self.unsigned && (grid.0 * grid.1) as usize == self.lists.len() => {
                rendering_elimination::eliminate(frame, pass, self.lists[tile as usize].signature, tile, grid, self.side())
            }
            _ => false,
        }
    }

    /// Hands out tiles and fences.
    fn hand_out(&mut self, wires: &mut Wires, card: &mut Card) -> Tick {
        let mut did = Tick::Starved;
        loop {
            match self.state {
                State::Binning => return did,
                State::Drawing { tile, partial } => {
                    // Lists are read when they are written.
                    if !self.writes.is_empty() {
                        return did.or(Tick::Blocked);
                    }
                    if tile as usize == self.lists.len() || card.passes.current().is_none() {
                        self.unsigned &= partial;
                        self.state = State::Fences { pending: 0, partial };
                        did = Tick::Moved;
                        continue;
                    }
                    let eliminated = card.class_state.same_tiles && self.eliminates(card, tile);
                    if card.bins[tile as usize].entries.is_empty() {
                        self.counts.empty_tiles += 1;
                    } else if eliminated {
                        self.counts.same_tiles += 1;
                    } else {
                        let (across, _) = self.grid(card);
                        let side = self.side();
                        let owner = card.interleave.owner(tile % across * side, tile / across * side);
                        let token = TileToken { tile, slot: u16::from(partial), kind: Kind::DATA };
                        if !wires.try_push(&self.ports.tiles[usize::from(owner)], token) {
                            return did.or(Tick::Blocked);
                        }
                        self.counts.tiles += 1;
                    }
                    self.state = State::Drawing { tile: tile + 1, partial };
                    did = Tick::Moved;
                }
                State::Fences { pending, partial } => {
                    // Before its end, a pass has fences of segments only; the last token says that lists are read.
                    let (slot, kind) = self.fences.front().copied().unwrap_or((0, Kind::END));
                    let all = u64::MAX >> (64 - self.ports.tiles.len());
                    let mut still = if pending == 0 { all } else { pending };
                    let mut left = still;
                    while left != 0 {
                        let to = left.trailing_zeros() as usize;
                        left &= left - 1;
                        if wires.try_push(&self.ports.tiles[to], TileToken { tile: 0, slot, kind }) {
                            still &= !(1 << to);
                            did = Tick::Moved;
                        }
                    }
                    if still != 0 {
                        self.state = State::Fences { pending: still, partial };
                        return did.or(Tick::Blocked);
                    }
                    self.fences.pop_front();
                    self.state = if kind == Kind::END {
                        State::Reading { left: self.ports.read.len() as u32 }
                    } else {
                        State::Fences { pending: 0, partial }
                    };
                    did = Tick::Moved;
                }
                State::Reading { .. } => return did,
            }
        }
    }
}

impl Unit<Card> for Bin {
    fn tick(&mut self, wires: &mut Wires, card: &mut Card) -> Tick {
        self.merge.begin(wires.now());
        self.ports.input.poll(wires);
        let mut did = Tick::Starved;

        // 1. Lists go to memory.
        while let Some(&(address, bytes)) = self.writes.front() {
            if !self.ports.memory.can_send(wires) {
                did = did.or(Tick::Blocked);
                break;
            }
            self.ports.memory.write(wires, address, bytes);
            self.writes.pop_front();
            did = Tick::Moved;
        }

        // 2. When all pipelines have read theirs, the memory is free.
        if let State::Reading { left } = &mut self.state {
            for port in &self.ports.read {
                while wires.pop(port).is_some() {
                    *left -= 1;
                    did = Tick::Moved;
                }
            }
            if *left == 0 {
                for (list, tile) in self.lists.iter_mut().zip(&mut card.bins) {
                    self.counts.read_bytes += tile.read_bytes;
                    *list = Writing::default();
                    tile.clear();
                }
                card.kept.clear();
                (self.triangles, self.kept, self.sent, self.chunks) = (0, 0, 0, 0);
                self.state = State::Binning;
                did = Tick::Moved;
            }
        }

        // 3. Tiles are handed out, or triangles taken in.
        did = did.or(self.hand_out(wires, card));
        if self.state == State::Binning {
            did = did.or(self.bin(wires, card));
            if self.state != State::Binning {
                card.phases.flush(wires.now());
            }
        }
        did
    }

    fn items(&self) -> u64 {
        self.sorting.sorted_items
    }

    fn resident(&self) -> u64 {
        self.ports.input.resident()
            + (self.fences.len() + self.writes.len() + self.tiles.len()) as u64
            + u64::from(self.state != State::Binning)
            + self.triangles
    }

    fn counted(groups: &mut Counted<Self>) {
        groups.group(BINNING, |unit| unit.counts);
    }
}
