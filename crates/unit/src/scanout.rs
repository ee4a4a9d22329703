//! Scan-out: reads the shown surface at the end of a frame.

use super::card::Card;
use super::stream::Stream;
use super::token::{Ack, Kind, Piece};
use knob::Allowed;
use mem::MemoryPort;
use sim::{In, Out, Tick, Unit, Wires};

knob::knobs! {
    /// Scan-out of finished frames.
    pub struct ScanoutConfig {
        /// Whether the shown surface is read once a frame.
        enabled: bool ["", Allowed::Switch, "ATTILA bGPU.ini DAC RefreshFrame = TRUE"],
        /// Requests to memory in flight.
        misses: u32 ["requests", Allowed::Range(1, 1024), "ATTILA bGPU.ini DAC BlockRequestQueueSize = 32"],
    }
}

/// Scan-out. Its items are frames.
pub struct Scanout {
    input: In<Piece>,
    output: Out<Ack>,
    memory: MemoryPort,
    stream: Stream,
    active: bool,
    items: u64,
}

impl Scanout {
    /// An idle one.
    pub fn new(config: ScanoutConfig, input: In<Piece>, output: Out<Ack>, memory: MemoryPort) -> Scanout {
        Scanout { input, output, memory, stream: Stream::new(config.misses), active: false, items: 0 }
    }
}

impl Unit<Card> for Scanout {
    fn tick(&mut self, wires: &mut Wires, card: &mut Card) -> Tick {
        // 1. The surface to be shown.
        let Some(piece) = wires.front(&self.input) else { return Tick::Starved };
        if !self.active {
            let surface = &card.frame.stores[usize::from(piece.slot)].surface;
            let texel = u64::from(surface.format.block_bytes()) * u64::from(surface.samples);
            self.stream.begin(Some(surface.address), None, u64::from(surface.width) * u64::from(surface.height) * texel);
            self.active = true;
        }

        // 2. Read it.
        let did = self.stream.step(wires, &self.memory);
        if !self.stream.done() {
            return did;
        }

        // 3. Done.
        if !wires.try_push(&self.output, Ack { slot: piece.slot, kind: Kind::DATA }) {
            return did.or(Tick::Blocked);
        }
        wires.pop(&self.input);
        self.active = false;
        self.items += 1;
        Tick::Moved
    }

    fn items(&self) -> u64 {
        self.items
    }

    fn resident(&self) -> u64 {
        u64::from(self.active) + self.stream.resident()
    }
}
