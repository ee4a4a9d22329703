//! A run of memory that is read, written, or both, piece after piece: the engine of copies, clears and scan-out.

use super::misses::Misses;
use mem::{MemoryPort, REQUEST_BYTES};
use sim::{Tick, Wires};

/// A run under way.
#[derive(Clone, Debug)]
pub struct Stream {
    from: Option<u64>,
    to: Option<u64>,
    bytes: u64,
    read: u64,
    written: u64,
    misses: Misses,
    /// Number of the first read of this run.
    first: u32,
    /// Reads issued in this run.
    reads: u32,
}

impl Stream {
    /// Nothing under way; at most `misses` reads will be in flight.
    pub fn new(misses: u32) -> Stream {
        Stream { from: None, to: None, bytes: 0, read: 0, written: 0, misses: Misses::new(misses), first: 0, reads: 0 }
    }

    /// Begins a run of `bytes` bytes.
    pub fn begin(&mut self, from: Option<u64>, to: Option<u64>, bytes: u64) {
        (self.from, self.to, self.bytes) = (from, to, bytes);
        (self.read, self.written, self.reads) = (0, 0, 0);
        self.first = self.misses.issued();
    }

    /// Whether all is read and written.
    pub fn done(&self) -> bool {
        let read = self.from.is_none() || self.read == self.bytes && !self.misses.any();
        let written = self.to.is_none() || self.written == self.bytes;
        read && written
    }

    /// Whether all reads of this run are sent. Another run that only reads may begin then.
    pub fn sent(&self) -> bool {
        self.read == self.bytes
    }

    /// Reads in flight.
    pub fn resident(&self) -> u64 {
        u64::from(self.misses.in_flight())
    }

    /// The end of the request that begins `at` bytes into a run at an address.
    fn stop(&self, start: u64, at: u64) -> u64 {
        let next = ((start + at) / REQUEST_BYTES + 1) * REQUEST_BYTES - start;
        next.min(self.bytes)
    }

    /// A cycle: takes answers, sends what can be sent.
    pub fn step(&mut self, wires: &mut Wires, port: &MemoryPort) -> Tick {
        let mut did = if self.done() { Tick::Starved } else { Tick::Memory };
        while let Some(tag) = port.answer(wires) {
            self.misses.answer(tag);
            did = Tick::Moved;
        }
        // Writes first: they free what was read.
        if let Some(to) = self.to {
            while self.written < self.bytes {
                let stop = self.stop(to, self.written);
                let here = match self.from {
                    None => true,
                    Some(from) => {
                        // The read that covers the last byte of the piece must be back.
                        let number = ((from + stop - 1) / REQUEST_BYTES - from / REQUEST_BYTES) as u32 + 1;
                        number <= self.reads && self.misses.reached(self.first.wrapping_add(number))
                    }
                };
                if !here {
                    break;
                }
                if !port.can_send(wires) {
                    did = did.or(Tick::Blocked);
                    break;
                }
                port.write(wires, to + self.written, (stop - self.written) as u32);
                self.written = stop;
                did = Tick::Moved;
            }
        }
        if let Some(from) = self.from {
            while self.read < self.bytes && self.misses.room() > 0 {
                if !port.can_send(wires) {
                    did = did.or(Tick::Blocked);
                    break;
                }
                let stop = self.stop(from, self.read);
                let tag = self.misses.issue();
                port.read(wires, from + self.read, (stop - self.read) as u32, tag);
                self.read = stop;
                self.reads += 1;
                did = Tick::Moved;
            }
        }
        did
    }
}
