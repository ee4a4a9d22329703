//! A display that runs while the next frame is drawn: a line every L cycles, from a FIFO that memory fills and that can run dry.
//!
//! Refresh r begins its first line in cycle `origin + r P` of `P = (lines + blank_lines) L` and its vertical blank `lines L` cycles
//! later. In that cycle a swap with vsync takes place, and reads for the next refresh begin. The bytes of a refresh are read in the order of
//! their addresses, a line has an equal part of them, and leaves the FIFO at a constant rate over its L cycles. Bytes that come after they
//! are due are read all the same, and thrown away: their line is dry. What has not been asked for when the blank begins is not read at
//! all, and its lines are dry: memory that is too slow for a display does not fall behind by more than a refresh.
//!
//! Frames of another size, format or number of samples than those before change the display's mode: what is being sent ends where it is, and
//! counts as no refresh, and a vertical blank of the new mode begins. With vsync that is so in the vertical blank.
//!
//! Behind the last frame the display goes on until it has shown it whole, or is switched off at once (`show_last`).
//!
//! What a line shows is settled when it is on the screen. What the FIFO holds of a line ahead of a swap counts as that of the new frame.

use std::collections::VecDeque;
use std::ops::Range;

use super::sprites::{Collision, SpriteCounts, collisions, lay};
use super::{ScanoutConfig, Swap};
use crate::card::{Card, Fault, Presented};
use crate::misses::Misses;
use crate::token::{Ack, Kind, Piece};
use mem::{MemoryPort, REQUEST_BYTES};
use num::Cycle;
use sim::{In, Out, Tick, Wires};
use stats::Heading;
use work::Surface;

/// The picture that the screen showed in one refresh.
#[derive(Clone, Debug)]
pub struct Refresh {
    /// Its number, from 0.
    pub number: u64,
    /// First line, and the frame that is shown from it on; the first is line 0.
    pub parts: Vec<(u32, Presented)>,
    /// With a single buffer the bytes of the lines as each was when it began; else empty.
    pub live: Vec<u8>,
}

impl Refresh {
    /// The picture: bytes of all lines, laid out as those of the frames.
    pub fn picture(&self) -> (Surface, Vec<u8>) {
        let surface = self.parts[0].1.surface;
        let row = surface.width as usize * surface.samples as usize * surface.format.block_bytes() as usize;
        let mut bytes = self.live.clone();
        if bytes.is_empty() {
            bytes.reserve(row * surface.height as usize);
            for (lines, frame) in self.lines() {
                bytes.extend_from_slice(&frame.bytes[lines.start as usize * row..lines.end as usize * row]);
            }
        }
        for (lines, frame) in self.lines() {
            lay(&frame.sprites, &surface, &mut bytes, lines);
        }
        (surface, bytes)
    }

    /// The frames, each with the lines on which it is shown.
    fn lines(&self) -> impl Iterator<Item = (Range<u32>, &Presented)> {
        let height = self.parts[0].1.surface.height;
        let ends = self.parts.iter().skip(1).map(|(line, _)| *line).chain([height]);
        self.parts.iter().zip(ends).map(|((first, frame), end)| (*first..end, frame))
    }

    /// The pairs of sprites that meet on the screen, each once for each frame that is shown, with that frame's number.
    pub fn collisions(&self) -> Vec<(u32, Collision)> {
        let of = |(lines, frame): (Range<u32>, &Presented)| {
            let (width, number) = (frame.surface.width, frame.frame);
            collisions(&frame.sprites, width, lines).into_iter().map(move |found| (number, found))
        };
        self.lines().flat_map(of).collect()
    }

    /// The sprite counters of the picture. A pair that collides in both parts of a torn picture counts once.
    pub(super) fn sprite_counts(&self) -> SpriteCounts {
        let register = self.collisions().iter().fold(0, |bits, (_, found)| bits | found.bit());
        let shown = self.parts.iter().map(|(_, frame)| frame.sprites.len() as u64).max().unwrap_or(0);
        SpriteCounts { shown, collisions: u64::from(register.count_ones()) }
    }
}

/// The heading of a free-running display in the statistics.
pub const DISPLAY: Heading =
    Heading::new("display", "What a free-running display has shown (`scanout.mode`), and what became of frames.");

stats::counters! {
    /// What a free-running display has shown.
    pub struct DisplayCounts {
        /// Pictures sent to the screen.
        refreshes: "refreshes",
        /// Frames handed to the display.
        presented: "frames",
        /// Frames of which a line was shown.
        shown: "frames",
        /// Frames of which no line was shown: another replaced them before, or the display was switched off.
        dropped: "frames",
        /// Refreshes that show one frame whole, as the refresh before did.
        repeated: "refreshes",
        /// Frames of another size, format or number of samples than the one before: the display has changed its mode.
        modes: "frames",
        /// Swaps while a picture was being sent: it is torn.
        tears: "tears",
        /// The lines of these, added up.
        tear_lines: "lines",
        /// Lines of which some bytes came after they were due.
        dry_lines: "lines",
        /// Cycles from handing frames over to the first line of each, of frames that were shown.
        present_to_line: "cycles",
    }
}

/// The screen while it is on.
#[derive(Clone, Debug)]
struct Screen {
    surface: Surface,
    lines: u64,
    line_bytes: u64,
    /// Cycles of a line and of a refresh.
    line_cycles: Cycle,
    period: Cycle,
    /// Refreshes before this mode of the display.
    before: u64,
    /// The cycle in which refresh 0 of this mode begins, and the current refresh: that being sent, or in the blank in front of it.
    origin: Cycle,
    refresh: u64,
    sending: bool,
    front: Presented,
    /// Number of `front` among the frames presented, from 1.
    ordinal: u64,
    /// First line, frame, its number among the frames, and when it was first sent, of the current refresh.
    parts: Vec<(u32, Presented, u64, Cycle)>,
    /// The last refresh, if it showed one frame whole: that frame's number among the frames.
    whole: Option<u64>,
    /// Refreshes whose bytes may be asked for, and bytes asked for of all of them.
    allowed: u64,
    issued: u64,
    /// The last line, counted over all refreshes, that is known to be dry.
    dry: Option<u64>,
    /// No refresh follows.
    stops: bool,
    /// With a single buffer: lines begun of the current refresh, and the bytes of those that were read.
    begun: Option<u64>,
    live: Vec<u8>,
}

impl Screen {
    /// A mode for a frame, the first of its kind, that begins with a vertical blank in a cycle, behind `before` refreshes.
    fn new(config: &ScanoutConfig, now: Cycle, before: u64, frame: Presented, ordinal: u64) -> Screen {
        let line_cycles = Cycle::from(config.line_cycles);
        let lines = u64::from(frame.surface.height);
        let blank = u64::from(config.blank_lines);
        let texel = u64::from(frame.surface.samples) * u64::from(frame.surface.format.block_bytes());
        Screen {
            surface: frame.surface,
            lines,
            line_bytes: u64::from(frame.surface.width) * texel,
            line_cycles,
            period: (lines + blank) * line_cycles,
            before,
            origin: now + blank * line_cycles,
            refresh: 0,
            sending: false,
            front: frame,
            ordinal,
            parts: Vec::new(),
            whole: None,
            allowed: 1,
            issued: 0,
            dry: None,
            stops: false,
            begun: (config.buffers == 1).then_some(0),
            live: Vec::new(),
        }
    }

    /// Whether a frame is shown in this mode.
    fn fits(&self, frame: &Presented) -> bool {
        let kind = |surface: &Surface| (surface.width, surface.height, surface.samples, surface.format);
        kind(&self.surface) == kind(&frame.surface)
    }

    /// The number, over all modes, of a refresh of this one.
    fn number(&self, refresh: u64) -> u64 {
        self.before + refresh
    }

    /// Bytes of a refresh.
    fn bytes(&self) -> u64 {
        self.lines * self.line_bytes
    }

    /// The first cycle before which `bytes` bytes, counted over all refreshes, have left the FIFO.
    fn left_by(&self, bytes: u64) -> Cycle {
        let Some(last) = bytes.checked_sub(1) else { return 0 };
        let cycles = self.line_cycles;
        let (refresh, of) = (last / self.bytes(), last % self.bytes());
        let part = (of % self.line_bytes + 1) * cycles;
        self.origin + refresh * self.period + of / self.line_bytes * cycles + part.div_ceil(self.line_bytes)
    }

    /// When the current refresh begins.
    fn begins(&self) -> Cycle {
        self.origin + self.refresh * self.period
    }

    /// The cycle of the next event of the display's clock.
    fn next(&self) -> Cycle {
        let lines = self.begun.filter(|_| self.sending).unwrap_or(self.lines);
        self.begins() + if self.sending { lines * self.line_cycles } else { 0 }
    }
}

/// Counts the frames of the parts of a refresh of which a line was shown, and those in between.
fn count(counts: &mut DisplayCounts, parts: &[(u32, Presented, u64, Cycle)]) {
    for (_, frame, ordinal, from) in parts {
        // Numbers of frames only grow; those in between had no line.
        let before = counts.shown + counts.dropped;
        if *ordinal > before {
            counts.dropped += ordinal - before - 1;
            counts.shown += 1;
            counts.present_to_line += from - frame.at;
        }
    }
}

/// A free-running display.
#[derive(Clone, Debug)]
pub(super) struct Display {
    config: ScanoutConfig,
    /// Bytes per cycle that memory's port brings.
    port_width: u32,
    screen: Option<Screen>,
    pending: VecDeque<Presented>,
    /// Swaps that have not been reported to the command processor.
    acks: u32,
    /// No frame follows.
    ended: bool,
    misses: Misses,
    /// Requests in flight, in order: the number behind each, and its bytes counted over all refreshes.
    flight: VecDeque<(u32, u64, u64)>,
    pub(super) counts: DisplayCounts,
    pub(super) sprites: SpriteCounts,
    /// Refreshes sent, until they are taken.
    pub(super) done: Vec<Refresh>,
    /// Refresh and line of each tear, and of each dry line, until they are taken.
    pub(super) tears: Vec<(u64, u32)>,
    pub(super) dry: Vec<(u64, u32)>,
    /// With a single buffer: the line that has begun, to be read from what is drawn when the cycle is over.
    capture: Option<u32>,
}

impl Display {
    pub(super) fn new(config: ScanoutConfig, port_width: u32) -> Display {
        Display {
            misses: Misses::new(config.misses),
            config,
            port_width,
            screen: None,
            pending: VecDeque::new(),
            acks: 0,
            ended: false,
            flight: VecDeque::new(),
            counts: DisplayCounts::default(),
            sprites: SpriteCounts::default(),
            done: Vec::new(),
            tears: Vec::new(),
            dry: Vec::new(),
            capture: None,
        }
    }

    pub(super) fn period(&self) -> Option<Cycle> {
        self.screen.as_ref().map(|screen| screen.period)
    }

    pub(super) fn captures(&self) -> bool {
        self.capture.is_some()
    }

    /// Reads the line that has begun.
    pub(super) fn capture(&mut self, card: &Card) -> bool {
        let (Some(line), Some(screen)) = (self.capture.take(), &mut self.screen) else { return false };
        match card.frame.find(screen.surface.key) {
            Some(index) => screen.live.extend(card.frame.stores[index].row_bytes(line)),
            // Nothing was drawn: the frame was put there otherwise.
            None => {
                let row = screen.line_bytes as usize;
                screen.live.extend_from_slice(&screen.front.bytes[line as usize * row..][..row]);
            }
        }
        true
    }

    pub(super) fn resident(&self) -> u64 {
        u64::from(self.screen.is_some()) + u64::from(self.misses.in_flight()) + u64::from(self.acks)
    }

    /// Why a frame cannot be shown.
    fn refusal(&self, frame: &Presented) -> Option<String> {
        let Surface { width, samples, format, .. } = frame.surface;
        let bytes = u64::from(width) * u64::from(samples) * u64::from(format.block_bytes());
        let brought = u64::from(self.port_width) * u64::from(self.config.line_cycles);
        (bytes > brought).then(|| {
            format!(
                "a line has {bytes} bytes, and in {} cycles (scanout.line_cycles) memory brings at most {brought}: no FIFO serves \
                 that; use {} cycles or more",
                self.config.line_cycles,
                bytes.div_ceil(u64::from(self.port_width))
            )
        })
    }

    /// A frame comes.
    fn take(&mut self, now: Cycle, frame: Presented) {
        self.counts.presented += 1;
        let vsync = self.config.swap == Swap::Vsync;
        let Some(screen) = &mut self.screen else {
            self.screen = Some(Screen::new(&self.config, now, self.counts.refreshes, frame, self.counts.presented));
            self.acks += u32::from(vsync);
            return;
        };
        if vsync {
            self.pending.push_back(frame);
            return;
        }
        if !screen.fits(&frame) {
            count(&mut self.counts, &screen.parts);
            return self.change_mode(now, frame, self.counts.presented);
        }
        (screen.front, screen.ordinal) = (frame, self.counts.presented);
        if !screen.sending {
            return;
        }
        // The line being sent is the first that shows it. In the cycle in which the first line begins nothing is torn.
        let since = now - screen.begins();
        let line = (since / screen.line_cycles) as u32;
        if screen.parts.last().is_some_and(|part| part.0 == line) {
            screen.parts.pop();
        }
        screen.parts.push((line, screen.front.clone(), screen.ordinal, now));
        if since > 0 {
            self.counts.tears += 1;
            self.counts.tear_lines += u64::from(line);
            self.tears.push((screen.number(screen.refresh), line));
        }
    }

    /// A frame of another kind is shown from here on. What has been asked for of the one before comes, and is thrown away.
    fn change_mode(&mut self, now: Cycle, frame: Presented, ordinal: u64) {
        self.counts.modes += 1;
        self.flight.clear();
        self.capture = None;
        self.screen = Some(Screen::new(&self.config, now, self.counts.refreshes, frame, ordinal));
    }

    /// What the clock brings: the first line of a refresh, or its vertical blank.
    fn turn(&mut self) {
        let Some(screen) = &mut self.screen else { return };
        let now = screen.next();
        if !screen.sending {
            screen.sending = true;
            screen.parts = vec![(0, screen.front.clone(), screen.ordinal, now)];
        } else if screen.begun.is_none_or(|begun| begun == screen.lines) {
            return self.end_refresh(now);
        }
        if let Some(begun) = &mut screen.begun {
            self.capture = Some(*begun as u32);
            *begun += 1;
        }
    }

    /// The vertical blank begins.
    fn end_refresh(&mut self, now: Cycle) {
        let Some(screen) = &mut self.screen else { return };
        let parts = std::mem::take(&mut screen.parts);
        count(&mut self.counts, &parts);
        let whole = (parts.len() == 1).then(|| parts[0].2);
        self.counts.refreshes += 1;
        self.counts.repeated += u64::from(whole.is_some() && whole == screen.whole);
        screen.whole = whole;
        let shown = parts.into_iter().map(|(line, frame, ..)| (line, frame)).collect();
        screen.begun = screen.begun.map(|_| 0);
        let refresh = Refresh { number: screen.number(screen.refresh), parts: shown, live: std::mem::take(&mut screen.live) };
        self.sprites += refresh.sprite_counts();
        self.done.push(refresh);
        (screen.sending, screen.refresh) = (false, screen.refresh + 1);
        let mut other = None;
        if let Some(next) = self.pending.pop_front() {
            screen.ordinal = self.counts.presented - self.pending.len() as u64;
            self.acks += 1;
            if screen.fits(&next) {
                screen.front = next;
            } else {
                other = Some((next, screen.ordinal));
            }
        }
        screen.stops = self.ended && whole == Some(screen.ordinal);
        let end = screen.allowed * screen.bytes();
        let missing = self.flight.front().map_or(screen.issued, |&(_, first, _)| first);
        if missing < end {
            let first = (missing / screen.line_bytes).max(screen.dry.map_or(0, |known| known + 1));
            for line in first..screen.allowed * screen.lines {
                self.counts.dry_lines += 1;
                self.dry.push((screen.number(line / screen.lines), (line % screen.lines) as u32));
            }
            screen.dry = Some(screen.allowed * screen.lines - 1);
        }
        screen.issued = end;
        screen.allowed += u64::from(!screen.stops);
        if let Some((frame, ordinal)) = other {
            self.change_mode(now, frame, ordinal);
        }
    }

    /// No frame follows, and nothing more is shown. What has been asked for comes, and is thrown away.
    fn switch_off(&mut self) {
        self.acks += self.pending.len() as u32;
        self.pending.clear();
        if let Some(screen) = &mut self.screen {
            count(&mut self.counts, &screen.parts);
            screen.issued = screen.allowed * screen.bytes();
            screen.stops = true;
            self.flight.clear();
        }
        self.counts.dropped = self.counts.presented - self.counts.shown;
    }

    /// Requests that have come back, in order.
    fn arrive(&mut self, now: Cycle) {
        let Some(screen) = &mut self.screen else { return };
        while let Some(&(number, first, end)) = self.flight.front()
            && self.misses.reached(number)
        {
            self.flight.pop_front();
            let mut at = first;
            while at < end {
                let line = at / screen.line_bytes;
                // It leaves the FIFO in the cycle before it has left.
                if now >= screen.left_by(at + 1) && screen.dry.is_none_or(|known| line > known) {
                    screen.dry = Some(line);
                    self.counts.dry_lines += 1;
                    self.dry.push((screen.number(line / screen.lines), (line % screen.lines) as u32));
                }
                at = (line + 1) * screen.line_bytes;
            }
        }
    }

    pub(super) fn tick(
        &mut self,
        wires: &mut Wires,
        card: &mut Card,
        (input, output, memory): (&In<Piece>, &Out<Ack>, &MemoryPort),
    ) -> Tick {
        let now = wires.now();
        let mut moved = false;

        // 1. Bytes that have come.
        while let Some(tag) = memory.answer(wires) {
            self.misses.answer(tag);
            moved = true;
        }
        self.arrive(now);

        // 2. The clock. The unit wakes in every cycle in which it brings something.
        while self.screen.as_ref().is_some_and(|screen| !screen.stops && screen.next() <= now) {
            self.turn();
            moved = true;
        }

        // 3. Frames.
        while let Some(piece) = wires.pop(input) {
            moved = true;
            self.ended = piece.kind != Kind::DATA;
            if let Some(frame) = card.presented.pop_front() {
                if let Some(what) = self.refusal(&frame) {
                    card.stop(Fault::Display { frame: frame.frame, what });
                    return Tick::Moved;
                }
                self.take(now, frame);
            }
            if self.ended && !self.config.show_last {
                self.switch_off();
            }
        }
        let mut did = Tick::moved_or(moved, Tick::Starved);
        while self.acks > 0 {
            if !wires.try_push(output, Ack { slot: 0, kind: Kind::DATA }) {
                did = did.or(Tick::Blocked);
                break;
            }
            self.acks -= 1;
            did = Tick::Moved;
        }

        // 4. Requests for what the FIFO has room for.
        let fifo = u64::from(self.config.fifo);
        while let Some(screen) = &mut self.screen {
            if !screen.stops {
                wires.sleep_until(screen.next());
            }
            let end = screen.allowed * screen.bytes();
            if screen.issued == end {
                if screen.stops && !self.misses.any() {
                    self.screen = None;
                    did = Tick::Moved;
                }
                break;
            }
            let of = screen.issued % screen.bytes();
            let address = screen.front.address + of;
            let bytes = (REQUEST_BYTES - address % REQUEST_BYTES).min(screen.bytes() - of);
            let room = screen.left_by((screen.issued + bytes).saturating_sub(fifo));
            if now < room {
                // The FIFO is full until then.
                wires.sleep_until(room);
                did = did.or(Tick::Blocked);
                break;
            }
            if self.misses.room() == 0 {
                break;
            }
            if !memory.can_send(wires) {
                did = did.or(Tick::Blocked);
                break;
            }
            let tag = self.misses.issue();
            memory.read(wires, address, bytes as u32, tag);
            self.flight.push_back((self.misses.issued(), screen.issued, screen.issued + bytes));
            screen.issued += bytes;
            did = Tick::Moved;
        }
        if self.misses.any() { did.or(Tick::Memory) } else { did }
    }
}
