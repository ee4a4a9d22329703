//! Handing frames to a free-running display.
//!
//! A frame that is handed over keeps its bytes: the display reads them in a buffer of their own, and the texture's name goes on with
//! another. A pass that loads the texture then needs the bytes there, too, and they are copied first. With one buffer there is no other,
//! and what is drawn is what is shown. With `swap` `copy` it is the frame that is copied, each time.

use std::collections::VecDeque;
use std::sync::Arc;

use super::{Command, State};
use crate::card::{Card, Presented};
use crate::phase::PhaseKind;
use crate::scanout::{ScanoutConfig, Swap};
use crate::token::{Kind, Piece};
use num::Cycle;
use sim::{Tick, Wires};
use work::{EndFrame, Event, Load, Pass, Surface, SurfaceKey};

/// The distance between the buffers in memory: they lie behind all surfaces and the copies that pipelines have of them.
const BUFFER: u64 = 1 << 46;

/// The command processor's state of the display.
#[derive(Clone, Debug)]
pub(super) struct Present {
    swap: Swap,
    buffers: u32,
    /// Frames handed over, and those of them that wait for a vertical blank.
    frames: u64,
    waiting: u32,
    /// Textures whose bytes are in the display's buffers alone, and the address there.
    renamed: Vec<(SurfaceKey, u64)>,
    /// Copies to be made before a pass: from, to, bytes.
    pub(super) copies: VecDeque<(u64, u64, u64)>,
    /// Whether the end of the frames has been reported to the display.
    end_reported: bool,
}

/// Bytes of a surface.
fn bytes(surface: &Surface) -> u64 {
    u64::from(surface.width) * u64::from(surface.height) * u64::from(surface.samples) * u64::from(surface.format.block_bytes())
}

impl Present {
    pub(super) fn new(config: &ScanoutConfig) -> Present {
        let (swap, buffers) = (config.swap, config.buffers);
        Present { swap, buffers, frames: 0, waiting: 0, renamed: Vec::new(), copies: VecDeque::new(), end_reported: false }
    }

    /// Whether no buffer is left to be drawn in: all hold the shown frame or frames that wait. A single buffer is drawn in while its frame is
    /// shown.
    pub(super) fn waits(&self) -> bool {
        self.waiting > self.buffers.saturating_sub(2)
    }

    /// The address at which the display reads the next frame.
    fn address(&self, surface: &Surface) -> u64 {
        match (self.swap, u64::from(self.buffers)) {
            (Swap::Copy, _) => surface.address + BUFFER,
            (_, 1) => surface.address,
            (_, buffers) => surface.address + BUFFER * (1 + self.frames % buffers),
        }
    }
}

impl Command {
    /// Takes the swaps that the display reports, and reports to it, once, that no frame follows.
    pub(super) fn wait_for_display(&mut self, wires: &mut Wires, card: &Card) -> Tick {
        // Behind the last frame, too: it is over when the display has been switched off.
        let idle = self.idle() || self.frame_over();
        let Some(present) = &mut self.present else { return Tick::Starved };
        let mut did = Tick::Starved;
        while wires.pop(&self.ports.scanned).is_some() {
            present.waiting -= 1;
            did = Tick::Moved;
        }
        if !present.end_reported && idle && card.closed && card.events.is_empty() {
            if !wires.try_push(&self.ports.scanout, Piece { slot: 0, kind: Kind::END }) {
                return did.or(Tick::Blocked);
            }
            present.end_reported = true;
            did = Tick::Moved;
        }
        did
    }

    /// A frame ends: its picture goes to the display, after a copy where frames are copied. `None` if it has to wait.
    pub(super) fn end_frame(&mut self, wires: &mut Wires, card: &mut Card) -> Option<()> {
        let Some(Event::EndFrame(end)) = card.events.front() else { return None };
        let end = end.clone();
        let present = self.present.as_mut()?;
        present.end_reported = false;
        self.ended = Some(end.clone());
        match end.shown {
            None => self.state = State::Over,
            Some(surface) if present.swap == Swap::Copy => {
                let to = present.address(&surface);
                self.stream.begin(Some(surface.address), Some(to), bytes(&surface));
                self.counts.present_copies += 1;
                self.counts.present_bytes += bytes(&surface);
                self.state = State::Presenting;
            }
            Some(_) => {
                if self.hand_over(wires, card).is_none() {
                    self.ended = None;
                    return None;
                }
            }
        }
        card.phases.begin(PhaseKind::ScanOut, 0, "", wires.now());
        card.interleave.end_frame();
        self.take_event(card);
        self.busy_until = wires.now() + Cycle::from(self.config.command_cycles);
        Some(())
    }

    /// A frame with sprites that is read for the screen at its end: what is laid over its lines goes with it.
    pub(super) fn overlay(wires: &Wires, card: &mut Card, end: &EndFrame) {
        let Some(surface) = end.shown.filter(|_| !end.sprites.is_empty()) else { return };
        let (frame, address, at, sprites) = (end.number, surface.address, wires.now(), end.sprites.clone());
        card.presented.push_back(Presented { frame, surface, address, bytes: picture(card, end), at, sprites });
    }

    /// Hands the frame that has ended to the display; `None` if the way is full. Nothing is in flight that could change it.
    pub(super) fn hand_over(&mut self, wires: &mut Wires, card: &mut Card) -> Option<()> {
        let (present, end) = (self.present.as_mut()?, self.ended.as_ref()?);
        let surface = end.shown?;
        // Its event may have been taken.
        let last = card.closed
            && !card.events.iter().any(|event| !matches!(event, Event::EndFrame(other) if other.number == end.number));
        let kind = if last { Kind::END } else { Kind::DATA };
        if !wires.try_push(&self.ports.scanout, Piece { slot: 0, kind }) {
            return None;
        }
        let address = present.address(&surface);
        let (bytes, sprites) = (picture(card, end), end.sprites.clone());
        card.presented.push_back(Presented { frame: end.number, surface, address, bytes, at: wires.now(), sprites });
        if present.swap != Swap::Copy && present.buffers > 1 {
            present.renamed.retain(|(known, _)| *known != surface.key);
            present.renamed.push((surface.key, address));
        }
        present.end_reported = last;
        present.frames += 1;
        present.waiting += u32::from(present.swap == Swap::Vsync);
        self.state = if present.swap == Swap::Vsync { State::Scanning } else { State::Over };
        Some(())
    }

    /// A pass begins: what it loads of textures that only the display's buffers hold is copied first.
    pub(super) fn load_presented(&mut self, pass: &Pass) {
        let Some(present) = &mut self.present else { return };
        for attachment in pass.color.iter().flatten() {
            let surface = &attachment.surface;
            let Some(at) = present.renamed.iter().position(|(known, _)| *known == surface.key) else { continue };
            let (_, from) = present.renamed.swap_remove(at);
            if attachment.load == Load::Load {
                present.copies.push_back((from, surface.address, bytes(surface)));
                self.counts.present_copies += 1;
                self.counts.present_bytes += bytes(surface);
            }
        }
    }
}

/// The picture of a frame: the machine's own bytes, unless the last writer was no draw.
fn picture(card: &Card, end: &EndFrame) -> Arc<[u8]> {
    card.drawn_picture(end).map_or_else(|| end.reference.clone(), |store| store.to_bytes().into())
}
