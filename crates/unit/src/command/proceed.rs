//! What is under way goes on: draws, dispatches, transfers, resolves, the ends of passes.

use super::super::card::Card;
use super::super::token::{Kind, Piece};
use super::present::Present;
use super::{Command, State};
use num::Cycle;
use sim::{Tick, Wires};
use work::Attachment;

impl Command {
    /// Takes reports; true if any came.
    pub(super) fn collect(&mut self, wires: &mut Wires, card: &mut Card) -> bool {
        let mut moved = false;
        for (unit, port) in self.ports.acks.iter().enumerate() {
            while let Some(ack) = wires.pop(port) {
                moved = true;
                if ack.kind == Kind::PASS {
                    if let State::Ending(left) = &mut self.state {
                        *left -= 1;
                        self.waits.ended(unit, wires.now(), *left == 0);
                    }
                    continue;
                }
                let slot = usize::from(ack.slot);
                self.reports[slot] -= 1;
                if self.reports[slot] == 0 {
                    let funnel = card.funnel.retire(ack.slot);
                    if let Some(work) = card.work[slot].take() {
                        card.phases.retire(work.draw_number, funnel, wires.now());
                    }
                    if self.ports.binned.is_empty() {
                        self.segments -= 1;
                        self.states.retire(ack.slot);
                    }
                    self.free.push(ack.slot);
                    self.flying.retain(|&(slot, _)| slot != ack.slot);
                }
            }
        }
        // Where segments are binned, their lists are still to be drawn.
        for port in &self.ports.binned {
            while let Some(ack) = wires.pop(port) {
                self.segments -= 1;
                self.states.retire(ack.slot);
                moved = true;
            }
        }
        while let Some(ack) = wires.pop(&self.ports.computed) {
            card.compute[usize::from(ack.slot)] = None;
            self.free_runs.push(ack.slot);
            moved = true;
        }
        moved
    }

    /// The pass is drawn: its attachments are resolved.
    pub(super) fn begin_resolves(&mut self, card: &Card) {
        let Some(pass) = &card.pass else { return };
        let resolves = |attachment: &Option<Attachment>| attachment.is_some_and(|a| a.resolve.is_some());
        let locations = pass.pass.color.iter().enumerate().filter(|(_, attachment)| resolves(attachment));
        self.resolves = locations.map(|(location, _)| location as u16).collect();
        self.state = State::Resolving((self.resolves.len() * self.ports.resolve.len()) as u32);
    }

    /// Goes on with what takes longer than an event.
    pub(super) fn proceed(&mut self, wires: &mut Wires, card: &mut Card) -> Tick {
        match &mut self.state {
            State::Ready | State::Over => Tick::Starved,
            State::Clearing => {
                if self.stream.done() {
                    if let Some((from, to, bytes)) = self.present.as_mut().and_then(|present| present.copies.pop_front()) {
                        self.stream.begin(Some(from), Some(to), bytes);
                        return Tick::Moved;
                    }
                    match self.clears.pop_front() {
                        Some((address, bytes)) => self.stream.begin(None, Some(address), bytes),
                        None => self.state = State::Ready,
                    }
                    return Tick::Moved;
                }
                self.stream.step(wires, &self.ports.memory)
            }
            State::Ending(left) => {
                if *left > 0 {
                    return Tick::Starved;
                }
                let Some(pass) = &card.pass else { return Tick::Starved };
                if pass.order.drawn {
                    if pass.order.matters && card.class_state.copies.len() > 1 {
                        card.disordered.push((pass.pass.number, pass.pass.label.clone()));
                    }
                    self.state = State::Composing(0, self.ports.compose.len());
                    return Tick::Moved;
                }
                self.begin_resolves(card);
                Tick::Moved
            }
            State::Composing(told, left) => {
                let mut did = Tick::Starved;
                while *told < self.ports.compose.len() {
                    if !wires.try_push(&self.ports.compose[*told], Piece { slot: 0, kind: Kind::PASS }) {
                        did = Tick::Blocked;
                        break;
                    }
                    *told += 1;
                    did = Tick::Moved;
                }
                for port in &self.ports.composed {
                    while wires.pop(port).is_some() {
                        *left -= 1;
                        did = Tick::Moved;
                    }
                }
                if *left == 0 {
                    self.begin_resolves(card);
                    did = Tick::Moved;
                }
                did
            }
            State::Resolving(left) => {
                let mut did = Tick::Starved;
                while let Some(&location) = self.resolves.front() {
                    if !self.ports.resolve.iter().all(|port| wires.can_push(port)) {
                        did = Tick::Blocked;
                        break;
                    }
                    let piece = Piece { slot: location, kind: Kind::DATA };
                    self.ports.resolve.iter().for_each(|port| wires.push(port, piece));
                    self.resolves.pop_front();
                    did = Tick::Moved;
                }
                for port in &self.ports.resolved {
                    while wires.pop(port).is_some() {
                        *left -= 1;
                        did = Tick::Moved;
                    }
                }
                if *left == 0 {
                    card.pass = None;
                    card.epoch += 1;
                    self.state = State::Ready;
                    self.busy_until = wires.now() + Cycle::from(self.config.barrier_cycles);
                    did = Tick::Moved;
                }
                did
            }
            State::Moving(surfaces) => {
                let did = self.stream.step(wires, &self.ports.memory);
                if !self.stream.done() {
                    return did;
                }
                if let Some((from, to)) = surfaces.take() {
                    if let Err(fault) = card.frame.copy(&from, &to) {
                        card.stop(fault);
                    }
                    self.forget_depths(to.key);
                }
                self.state = State::Ready;
                Tick::Moved
            }
            State::Presenting => {
                let did = self.stream.step(wires, &self.ports.memory);
                if !self.stream.done() {
                    return did;
                }
                match self.hand_over(wires, card) {
                    Some(()) => Tick::Moved,
                    None => did.or(Tick::Blocked),
                }
            }
            State::Scanning if self.present.is_some() => {
                if self.present.as_ref().is_some_and(Present::waits) {
                    return Tick::Starved;
                }
                self.state = State::Over;
                Tick::Moved
            }
            State::Scanning => {
                if wires.pop(&self.ports.scanned).is_none() {
                    return Tick::Starved;
                }
                self.state = State::Over;
                Tick::Moved
            }
        }
    }
}
