//! Scan-out: reads the shown surface at the end of a frame, or all the time.

mod display;
mod sprites;

use super::card::Card;
use super::frame::BlockState;
use super::stream::Stream;
use super::token::{Ack, Kind, Piece};
use display::Display;
use knob::Allowed;
use mem::MemoryPort;
use num::Cycle;
use sim::{Counted, In, Out, Tick, Unit, Wires};
use stats::Heading;

pub use display::{DISPLAY, DisplayCounts, Refresh};
pub use sprites::{Collision, SpriteCounts};

knob::choices! {
    /// When frames are read for the screen.
    pub enum ScanoutMode {
        /// At the end of each; the next one waits for that.
        AfterFrame "after-frame",
        /// All the time, line after line, while the next one is drawn.
        FreeRunning "free-running",
    }
}

knob::choices! {
    /// What a free-running display does with a finished frame.
    pub enum Swap {
        /// It is shown from the line on that is being sent.
        Immediate "immediate",
        /// It is shown from the next vertical blank on.
        Vsync "vsync",
        /// It is copied to the buffer that is shown, and shown from the end of the copy on.
        Copy "copy",
    }
}

knob::knobs! {
    /// Scan-out of finished frames.
    pub struct ScanoutConfig {
        /// Whether the shown surface is read once per frame.
        enabled: bool ["", Allowed::Switch, "assumed; ATTILA bGPU.ini DAC RefreshFrame = TRUE"]
            {estimate: Used, relax: Skip(&[("false", "no scan-out")]), advice: [ScanOut]},
        /// Requests to memory in flight.
        misses: u32 ["requests", Allowed::Range(1, 1024), "assumed; ATTILA bGPU.ini DAC BlockRequestQueueSize = 32"]
            {estimate: Used, relax: Room, advice: []},
        /// Whether frames are read as the ROPs have stored them: compressed blocks compressed, and blocks that were cleared by flag not at
        /// all. After frames only.
        compressed: bool ["", Allowed::Switch, "assumed; ATTILA's DAC reads so; most displays had to have frames decompressed"]
            {estimate: RefusedUnless(Is(&["false"]), "compressed scan-out"), relax: Skip(&[("true", "compressed scan-out")]), advice: []},
        /// When frames are read for the screen.
        mode: ScanoutMode ["", Allowed::Choice(ScanoutMode::NAMES), "assumed; ATTILA reads a frame when it has been drawn; displays run free"]
            {estimate: Used, relax: Never, advice: []},
        /// Free-running: cycles of a line.
        line_cycles: u32 ["cycles", Allowed::Range(1, 16_777_216), "assumed: 1080 lines and 45 of blank, 60 times a second: at 1,126 MHz 16,681"]
            {estimate: Used, relax: Never, advice: []},
        /// Free-running: lines of the vertical blank. The first line is read in it.
        blank_lines: u32 ["lines", Allowed::Range(1, 65536), "CEA-861 1080p: 45"] {estimate: Used, relax: Never, advice: []},
        /// Free-running: buffers of frames, that which is shown among them. With one, drawing is shown while it goes on.
        buffers: u32 ["buffers", Allowed::Range(1, 3), "assumed: double buffering"] {estimate: Used, relax: Never, advice: []},
        /// Free-running: what is done with a finished frame.
        swap: Swap ["", Allowed::Choice(Swap::NAMES), "most programs ask for vertical synchronisation; who times frames switches it off"]
            {estimate: RefusedUnless(Is(&["immediate"]), "frames that wait for a display or are copied to it"), relax: Never, advice: []},
        /// Free-running: whether the run goes on until the last frame has been shown whole. If not, the display is switched off behind it.
        show_last: bool ["", Allowed::Switch, "assumed: who asks for the time of frames stops the clock with the last one"]
            {estimate: RefusedUnless(Is(&["false"]), "the time that the last frame is shown"), relax: Never, advice: []},
        /// Free-running: bytes between memory and the screen.
        fifo: u32 ["bytes", Allowed::Range(512, 16_777_216), "assumed; ATTILA bGPU.ini DAC BlockRequestQueueSize = 32 blocks of 256 bytes"]
            {estimate: Ignored("cycles hardly depend on it"), relax: Room, advice: []},
    }
}

impl ScanoutConfig {
    /// Whether there is a display that runs while frames are drawn.
    pub fn runs_free(&self) -> bool {
        self.enabled && self.mode == ScanoutMode::FreeRunning
    }

    /// Why frames do not take the same time with another display before them; none: they do. What it reads meanwhile is little.
    pub fn ties_frames(&self) -> Option<&'static str> {
        if self.runs_free() && self.swap == Swap::Vsync {
            Some(
                "with scanout.swap=\"vsync\" each frame waits for a free-running display, and that depends on all frames before",
            )
        } else if self.runs_free() && self.show_last {
            Some(
                "what a free-running display shows depends on all frames before; scanout.show_last=false shows none behind the last",
            )
        } else {
            None
        }
    }
}

/// Scan-out. Its items are frames; of a free-running display, those handed to it.
#[derive(Clone)]
pub struct Scanout {
    input: In<Piece>,
    output: Out<Ack>,
    memory: MemoryPort,
    stream: Stream,
    /// Whether blocks are read as they are stored, and the next one.
    compressed: bool,
    block: usize,
    active: bool,
    items: u64,
    /// A display that runs free.
    display: Option<Display>,
    /// For frames that are read at their end: counts of sprites, and the pictures with sprites that have not been taken.
    sprites: SpriteCounts,
    shown: Vec<Refresh>,
}

impl Scanout {
    /// An idle scan-out unit, whose port to memory brings `port_width` bytes per cycle.
    pub fn new(config: ScanoutConfig, port_width: u32, input: In<Piece>, output: Out<Ack>, memory: MemoryPort) -> Scanout {
        let (stream, compressed) = (Stream::new(config.misses), config.compressed);
        let display = config.runs_free().then(|| Display::new(config, port_width));
        Scanout {
            input,
            output,
            memory,
            stream,
            compressed,
            block: 0,
            active: false,
            items: 0,
            display,
            sprites: SpriteCounts::default(),
            shown: Vec::new(),
        }
    }

    /// The counters of a free-running display.
    #[cfg(test)]
    pub(super) fn display_counts(&self) -> Option<DisplayCounts> {
        self.display.as_ref().map(|display| display.counts)
    }

    /// The refreshes, tears and dry lines that have not been taken yet.
    #[cfg(test)]
    #[expect(clippy::type_complexity, reason = "for tests alone")]
    pub(super) fn shown(&self) -> (&[Refresh], &[(u64, u32)], &[(u64, u32)]) {
        self.display.as_ref().map_or((&[], &[], &[]), |display| (&display.done, &display.tears, &display.dry))
    }

    /// Whether a line has begun that is to be read from what is drawn.
    #[inline(always)]
    pub fn captures(&self) -> bool {
        self.display.as_ref().is_some_and(Display::captures)
    }

    /// Reads that line. For the time between cycles, when all units have ticked: then what is drawn does not depend on their order.
    pub fn capture(&mut self, card: &Card) -> bool {
        self.display.as_mut().is_some_and(|display| display.capture(card))
    }

    /// Cycles of a refresh, while a display that runs free has a frame to show.
    pub fn period(&self) -> Option<Cycle> {
        self.display.as_ref().and_then(Display::period)
    }

    /// Takes what the screen has shown since it was asked last; where the display does not run free, frames with sprites alone.
    pub fn take_shown(&mut self) -> Shown {
        let Some(display) = &mut self.display else {
            return Shown { refreshes: std::mem::take(&mut self.shown), ..Shown::default() };
        };
        let (refreshes, tears) = (std::mem::take(&mut display.done), std::mem::take(&mut display.tears));
        Shown { refreshes, tears, dry: std::mem::take(&mut display.dry) }
    }
}

/// The output of a free-running display.
#[derive(Clone, Debug, Default)]
pub struct Shown {
    /// The refreshes, in order.
    pub refreshes: Vec<Refresh>,
    /// Refresh and line of each tear.
    pub tears: Vec<(u64, u32)>,
    /// Refresh and line of each dry line.
    pub dry: Vec<(u64, u32)>,
}

impl Unit<Card> for Scanout {
    fn tick(&mut self, wires: &mut Wires, card: &mut Card) -> Tick {
        if let Some(display) = &mut self.display {
            return display.tick(wires, card, (&self.input, &self.output, &self.memory));
        }
        // 1. The surface to be shown.
        let Some(piece) = wires.front(&self.input) else { return Tick::Starved };
        if !self.active {
            let surface = &card.frame.stores[usize::from(piece.slot)].surface;
            let texel = u64::from(surface.format.block_bytes()) * u64::from(surface.samples);
            let bytes = u64::from(surface.width) * u64::from(surface.height) * texel;
            self.stream.begin(Some(surface.address), None, if self.compressed { 0 } else { bytes });
            self.block = 0;
            self.active = true;
            if let Some(frame) = card.presented.pop_front() {
                // Each of these frames is one picture, under its own number.
                let refresh = Refresh { number: frame.frame.into(), parts: vec![(0, frame)], live: Vec::new() };
                self.sprites += refresh.sprite_counts();
                self.shown.push(refresh);
            }
        }

        // 2. Read it.
        let mut did = self.stream.step(wires, &self.memory);
        if self.compressed {
            let store = &card.frame.stores[usize::from(piece.slot)];
            while self.stream.sent() && self.block < store.blocks.len() {
                if let BlockState::Stored(bytes) | BlockState::Shared(bytes) = store.blocks[self.block] {
                    self.stream.begin(Some(store.address(self.block as u32)), None, bytes.into());
                    did = self.stream.step(wires, &self.memory).or(did);
                }
                self.block += 1;
            }
        }
        if !self.stream.done() || self.compressed && self.block < card.frame.stores[usize::from(piece.slot)].blocks.len() {
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
        self.display.as_ref().map_or(self.items, |display| display.counts.presented)
    }

    fn resident(&self) -> u64 {
        u64::from(self.active) + self.stream.resident() + self.display.as_ref().map_or(0, Display::resident)
    }

    fn counted(groups: &mut Counted<Self>) {
        let about = "Sprites that the display has laid over its lines.";
        groups.group(Heading::new("sprites", about), |unit| {
            let mut counts = unit.sprites;
            counts += unit.display.as_ref().map_or(SpriteCounts::default(), |display| display.sprites);
            counts
        });
        groups.group_if(DISPLAY, |unit| unit.display.as_ref().map(|display| display.counts));
    }
}
