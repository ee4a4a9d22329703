//! Reading of tiles, one unit per pipeline of a binning machine: reads the list of a tile and its triangles from memory, and sends the
//! triangles to setup in the list's order.

use std::collections::VecDeque;

use super::bin::{BinConfig, distinct};
use super::card::Card;
use super::misses::Misses;
use super::network::Stall;
use super::tags::Tags;
use super::token::{Kind, TileToken, TriangleToken};
use mem::{MemoryPort, REQUEST_BYTES, requests};
use sim::{In, Out, StallProbe, Tick, Unit, Wires};
use work::LINE;

/// Ways of the cache of triangles and vertices.
const WAYS: u32 = 4;

/// Ports of tile reading.
#[derive(Clone)]
pub struct TileFetchPorts {
    /// Tiles and fences.
    pub input: In<TileToken>,
    /// All lists are read, to binning.
    pub read: Out<TileToken>,
    /// Triangles, to setup.
    pub output: Out<TriangleToken>,
    /// Memory.
    pub memory: MemoryPort,
    /// Its state is what the unit waits for.
    pub probe: StallProbe,
}

/// A triangle whose bytes are on their way, or a mark.
#[derive(Clone, Copy, Debug)]
struct FetchedTriangle {
    token: TriangleToken,
    needs: u32,
}

/// Tile reading. Its items are triangles.
#[derive(Clone)]
pub struct TileFetch {
    config: BinConfig,
    ports: TileFetchPorts,
    misses: Misses,
    /// The next entry of the current tile, the bytes of its list before that entry, and the chunks of the list requested.
    next: usize,
    offset: u64,
    chunks: usize,
    /// Lines of triangles and vertices that are here or on their way: all that came before an entry is waited for with it.
    tags: Tags<()>,
    /// Requests to be sent: address and bytes.
    requests: VecDeque<(u64, u32)>,
    fifo: VecDeque<FetchedTriangle>,
    items: u64,
}

impl TileFetch {
    /// An idle unit that reads tiles.
    pub fn new(config: BinConfig, ports: TileFetchPorts) -> TileFetch {
        TileFetch {
            misses: Misses::new(config.misses),
            next: 0,
            offset: 0,
            chunks: 0,
            tags: Tags::new(config.cache_lines, WAYS),
            requests: VecDeque::new(),
            fifo: VecDeque::with_capacity(config.fifo as usize + 1),
            items: 0,
            config,
            ports,
        }
    }

    /// Requests bytes; gives how many.
    fn request(&mut self, address: u64, bytes: u32) -> u64 {
        self.requests.extend(requests(address, bytes));
        u64::from(bytes)
    }

    /// Requests those lines of some bytes that are not here; gives how many bytes. Neighbours are one request.
    fn request_lines(&mut self, address: u64, bytes: u64) -> u64 {
        let mut asked = 0;
        for line in address / LINE..(address + bytes).div_ceil(LINE) {
            if self.tags.find(line).is_some() {
                continue;
            }
            let place = self.tags.victim(line, |()| true).expect("any line may go");
            self.tags.replace(place, line, ());
            asked += LINE;
            match self.requests.back_mut() {
                Some((last, length))
                    if *last + u64::from(*length) == line * LINE && !(line * LINE).is_multiple_of(REQUEST_BYTES) =>
                {
                    *length += LINE as u32;
                }
                _ => self.requests.push_back((line * LINE, LINE as u32)),
            }
        }
        asked
    }

    /// Requests a triangle and its vertices; gives how many bytes.
    fn request_triangle(&mut self, card: &Card, slot: u16, triangle: u32, record: u64) -> u64 {
        let work = card.work(slot);
        let (vertex, own) = (self.config.vertex_bytes(work), u64::from(self.config.triangle_bytes));
        let vertices = distinct(work, triangle);
        if !self.config.shares(work, triangle) {
            let before = vertices.count() as u64 * vertex;
            return self.request_lines(record - before, before + own);
        }
        let of_vertices: u64 = vertices
            .map(|n| self.request_lines(card.kept.of(slot, n).expect("binning keeps the vertices of what it lists"), vertex))
            .sum();
        of_vertices + self.request_lines(record, own)
    }

    /// Reads the current tile as far as there is room.
    fn read(&mut self, wires: &mut Wires, card: &mut Card) -> Tick {
        let mut did = Tick::Starved;
        loop {
            let Some(TileToken { tile, slot, kind }) = wires.front(&self.ports.input) else { return did };
            if self.fifo.len() >= self.config.fifo as usize {
                return did.or(Tick::Blocked);
            }
            if !self.requests.is_empty() {
                return did.or(Tick::Memory);
            }
            let needs = self.misses.issued();
            // 1. A fence goes on behind the triangles before it; the last token of a round only says that all is read.
            if kind == Kind::END {
                if !wires.try_push(&self.ports.read, TileToken { tile, slot, kind }) {
                    return did.or(Tick::Blocked);
                }
                // The next round's triangles lie where these were.
                self.tags.clear();
                wires.take(&self.ports.input);
                did = Tick::Moved;
                continue;
            }
            if kind != Kind::DATA {
                let token = TriangleToken { slot, kind, sequence: 0, triangle: 0 };
                self.fifo.push_back(FetchedTriangle { token, needs });
                wires.take(&self.ports.input);
                did = Tick::Moved;
                continue;
            }
            // 2. The end of the tile.
            let Some(&entry) = card.bins[tile as usize].entries.get(self.next) else {
                let token = TriangleToken { slot, kind: Kind::TILE, sequence: tile, triangle: 0 };
                self.fifo.push_back(FetchedTriangle { token, needs });
                (self.next, self.offset, self.chunks) = (0, 0, 0);
                wires.take(&self.ports.input);
                did = Tick::Moved;
                continue;
            };
            // 3. A triangle: the chunk of the list that names it, its own bytes, and its vertices.
            let list = &card.bins[tile as usize];
            let end = self.offset + u64::from(entry.bytes);
            let mut bytes = 0;
            while self.chunks < list.chunks.len() && (self.chunks as u64) * super::bin::CHUNK < end {
                let chunk = list.chunks[self.chunks];
                let length = (list.bytes - self.chunks as u64 * super::bin::CHUNK).min(super::bin::CHUNK);
                bytes += self.request(chunk, length as u32);
                self.chunks += 1;
            }
            bytes += self.request_triangle(card, entry.slot, entry.triangle, entry.address);
            card.bins[tile as usize].read_bytes += bytes;
            self.offset = end;
            self.next += 1;
            let needs = self.misses.issued().wrapping_add(self.requests.len() as u32);
            let token = TriangleToken { slot: entry.slot, kind: Kind::DATA, sequence: tile, triangle: entry.triangle };
            self.fifo.push_back(FetchedTriangle { token, needs });
            did = Tick::Moved;
        }
    }
}

impl TileFetch {
    fn step(&mut self, wires: &mut Wires, card: &mut Card) -> Tick {
        // 1. Memory.
        let mut did = Tick::Starved;
        while let Some(tag) = self.ports.memory.answer(wires) {
            self.misses.answer(tag);
            did = Tick::Moved;
        }

        // 2. Triangles that are here go on.
        while let Some(&FetchedTriangle { token, needs }) = self.fifo.front() {
            if !self.misses.reached(needs) {
                did = did.or(Tick::Memory);
                break;
            }
            if !wires.try_push(&self.ports.output, token) {
                did = did.or(Tick::Blocked);
                break;
            }
            self.items += u64::from(token.kind == Kind::DATA);
            self.fifo.pop_front();
            did = Tick::Moved;
        }

        // 3. Requests go to memory, and the next are made.
        loop {
            while let Some(&(address, bytes)) = self.requests.front() {
                if self.misses.room() == 0 {
                    return did.or(Tick::Memory);
                }
                if !self.ports.memory.can_send(wires) {
                    return did.or(Tick::Blocked);
                }
                let tag = self.misses.issue();
                self.ports.memory.read(wires, address, bytes, tag);
                self.requests.pop_front();
                did = Tick::Moved;
            }
            let read = self.read(wires, card);
            did = did.or(read);
            if self.requests.is_empty() {
                return did;
            }
        }
    }
}

impl Unit<Card> for TileFetch {
    fn tick(&mut self, wires: &mut Wires, card: &mut Card) -> Tick {
        let did = self.step(wires, card);
        wires.set_probe(&self.ports.probe, Stall::of_front(did) as u8);
        did
    }

    fn items(&self) -> u64 {
        self.items
    }

    fn resident(&self) -> u64 {
        (self.fifo.len() + self.requests.len() + self.next) as u64 + u64::from(self.misses.in_flight())
    }
}
