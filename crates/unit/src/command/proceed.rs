//! Continues the work under way: draws, dispatches, transfers, resolves, the ends of passes.

use std::collections::VecDeque;

use super::super::card::Card;
use super::super::resolve::piece_of;
use super::super::token::{Kind, Piece};
use super::present::Present;
use super::{Command, EndStage, Ending, Moving, State};
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
                    // With another pass behind it, a pipeline that has ended this one does not wait.
                    let alone = !self.in_pass && self.endings.len() == 1;
                    let ending = self.endings.iter_mut().find(|ending| u16::from(ending.pass) == ack.slot);
                    if let Some(Ending { stage: EndStage::Reports(left), .. }) = ending {
                        *left -= 1;
                        self.waits.ended(unit, wires.now(), *left == 0 && alone);
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
            self.ongoing.end_run(ack.slot);
            moved = true;
        }
        moved
    }

    /// A pass is drawn: its attachments are resolved.
    fn resolves(&self, card: &Card, pass: u8) -> EndStage {
        let resolves = |attachment: &Option<Attachment>| attachment.is_some_and(|a| a.resolve.is_some());
        let color = card.passes.get(pass).map_or(&[][..], |state| &state.pass.color);
        let locations = color.iter().enumerate().filter(|(_, attachment)| resolves(attachment));
        let locations: VecDeque<u16> = locations.map(|(location, _)| location as u16).collect();
        let reports = (locations.len() * self.ports.resolve.len()) as u32;
        EndStage::Resolving(locations, reports)
    }

    /// Goes on with the end of the pass that drains first.
    pub(super) fn end_passes(&mut self, wires: &mut Wires, card: &mut Card) -> Tick {
        let Some(Ending { pass, number, mut stage }) = self.endings.pop_front() else { return Tick::Starved };
        let mut did = Tick::Starved;
        match &mut stage {
            EndStage::Reports(0) => {
                let order = card.passes.get(pass).map(|state| (state.order.drawn, state.order.matters, state.pass.clone()));
                stage = match order {
                    Some((true, matters, of)) => {
                        if matters && card.class_state.copies.len() > 1 {
                            card.disordered.push((of.number, of.label.clone()));
                        }
                        EndStage::Composing(0, self.ports.compose.len())
                    }
                    _ => self.resolves(card, pass),
                };
                did = Tick::Moved;
            }
            EndStage::Reports(_) => {}
            EndStage::Composing(told, left) => {
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
                    stage = self.resolves(card, pass);
                    did = Tick::Moved;
                }
            }
            EndStage::Resolving(locations, left) => {
                while let Some(&location) = locations.front() {
                    if !self.ports.resolve.iter().all(|port| wires.can_push(port)) {
                        did = Tick::Blocked;
                        break;
                    }
                    let piece = piece_of(pass, location);
                    self.ports.resolve.iter().for_each(|port| wires.push(port, piece));
                    locations.pop_front();
                    did = Tick::Moved;
                }
                for port in &self.ports.resolved {
                    while wires.pop(port).is_some() {
                        *left -= 1;
                        did = Tick::Moved;
                    }
                }
                if *left == 0 {
                    card.passes.end(pass);
                    number.into_iter().for_each(|number| self.ongoing.end(number));
                    let next = wires.now() + Cycle::from(self.config.barrier_cycles);
                    self.barrier = self.barrier.max(next.max(wires.now() + 1));
                    if matches!(self.state, State::Ending) {
                        self.state = State::Ready;
                        self.busy_until = next;
                    }
                    return Tick::Moved;
                }
            }
        }
        self.endings.push_front(Ending { pass, number, stage });
        did
    }

    /// Goes on with a transfer.
    pub(super) fn move_memory(&mut self, wires: &mut Wires, card: &mut Card) -> Tick {
        let Some(Moving { from, number, surfaces }) = self.moving else { return Tick::Starved };
        if wires.now() < from {
            wires.sleep_until(from);
            return Tick::Working;
        }
        let did = self.stream.step(wires, &self.ports.memory);
        if !self.stream.done() {
            return did;
        }
        if let Some((from, to)) = surfaces {
            if let Err(fault) = card.frame.copy(&from, &to) {
                card.stop(fault);
            }
            self.forget_depths(to.key);
        }
        number.into_iter().for_each(|number| self.ongoing.end(number));
        self.moving = None;
        self.barrier = self.barrier.max(wires.now() + 1);
        if matches!(self.state, State::Moving) {
            self.state = State::Ready;
        }
        Tick::Moved
    }

    /// Goes on with what takes longer than an event.
    pub(super) fn proceed(&mut self, wires: &mut Wires, card: &mut Card) -> Tick {
        match &self.state {
            State::Ready | State::Over => Tick::Starved,
            State::Clearing => {
                // A transfer that is under way has the stream.
                let writes = !self.clears.is_empty() || self.present.as_ref().is_some_and(|present| !present.copies.is_empty());
                if self.moving.is_some() && writes {
                    return Tick::Starved;
                }
                if self.moving.is_some() || self.stream.done() {
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
            State::Ending => self.end_passes(wires, card),
            State::Moving => self.move_memory(wires, card),
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
