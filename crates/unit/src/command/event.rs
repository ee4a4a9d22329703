//! The work that each event of the stream begins.

use std::sync::Arc;

use super::super::card::{Card, ComputeWork, Fault};
use super::super::phase::PhaseKind;
use super::super::token::{Kind, Piece};
use super::ongoing::Doing;
use super::{Command, EndStage, Ending, Moving, State};
use num::Cycle;
use sim::Wires;
use work::{Event, Reach, TransferKind};

impl Command {
    /// Hands the next event out; `None` if it has to wait.
    pub(super) fn event(&mut self, wires: &mut Wires, card: &mut Card) -> Option<()> {
        let now = wires.now();
        let order = |event: u64, what: &'static str| Fault::Order { event, what };
        let drained = self.free.len() == self.reports.len() && self.pieces.is_empty();
        let in_pass = self.in_pass;
        let wrong = match card.events.front()? {
            Event::Draw(_) | Event::Segment(_) | Event::Applied(_) | Event::EndPass(_) if !in_pass => Some("outside a pass"),
            Event::Segment(_) | Event::Applied(_) if self.draw.is_none() => Some("a segment without a draw"),
            Event::Groups(_) if self.dispatch.is_none() => Some("workgroups without a dispatch"),
            Event::BeginPass(_) | Event::Dispatch(_) | Event::Groups(_) | Event::Contents(_) | Event::EndFrame(_)
                if in_pass =>
            {
                Some("inside a pass")
            }
            _ => None,
        };
        if let Some(what) = wrong {
            let event = self.items;
            card.stop(order(event, what));
            return None;
        }
        // An event that is not part of a dispatch waits for the dispatch, or for the work it depends on.
        if !matches!(card.events.front()?, Event::Groups(_)) {
            if !self.tracks && self.computing() {
                return None;
            }
            self.ongoing.close_dispatch();
        }
        if self.tracks && self.must_hold(card) {
            return None;
        }
        if std::mem::take(&mut self.held) {
            self.counts.waited += 1;
            // Memory that was written since may be stale in caches of read-only data.
            card.epoch += 1;
            if self.barrier > now {
                self.busy_until = self.barrier;
                return Some(());
            }
        }
        let mut cycles = Cycle::from(self.config.command_cycles);
        match card.events.front()? {
            Event::Segment(segment) => {
                if self.segments == self.config.segments {
                    return None;
                }
                let slot = self.free.pop()?;
                self.segments += 1;
                self.states.install(slot);
                let (segment, draw) = (segment.clone(), self.draw.clone()?);
                card.install(slot, segment, draw, self.draws);
                self.reports[usize::from(slot)] = self.pipelines;
                if !self.ports.next_draw.is_empty() {
                    self.flying.push_back((slot, self.draws));
                }
                self.pieces.push_back(Piece { slot, kind: Kind::DATA });
                self.pieces.push_back(Piece { slot, kind: Kind::SEGMENT });
            }
            // Waits until nothing is in flight; then it is taken from here ([`Command::apply`]).
            Event::Applied(_) => return None,
            // The machine takes it when it stops.
            Event::FramesFollow => return None,
            Event::Draw(draw) => {
                let draw = draw.clone();
                let changes = self.states.differs(draw.state.number);
                if changes && !self.states.has_room() {
                    return None;
                }
                if self.tracks && self.draw.as_ref().is_none_or(|last| !Arc::ptr_eq(&last.reach, &draw.reach)) {
                    self.ongoing.widen(&draw.reach);
                }
                self.draw = Some(draw.clone());
                self.draws = self.draws.wrapping_add(1);
                card.phases.draw(&draw, self.draws);
                let culling = draw.culling;
                self.counts.bounds_tested += culling.tests;
                self.counts.draws_culled += culling.draws;
                self.counts.instances_culled += culling.instances;
                self.counts.primitives_culled += culling.primitives;
                self.counts.vertices_culled += culling.vertices;
                cycles = self.begin_tests(culling.tests);
                if changes {
                    self.states.change(draw.state.number);
                    self.counts.state_changes += 1;
                    cycles += Cycle::from(self.config.state_cycles);
                }
            }
            Event::BeginPass(pass) => {
                let pass = pass.clone();
                let next = card.events.get(1);
                let skips =
                    self.config.skip_empty_passes && !pass.color.iter().flatten().any(|target| target.resolve.is_some());
                if skips && next.is_none() && !card.closed {
                    return None;
                }
                if self.tracks {
                    self.begin_ongoing(Doing::Pass, pass.reach());
                }
                let skipped = skips && matches!(next, Some(Event::EndPass(_)));
                card.phases.begin(PhaseKind::Pass, pass.number, &pass.label, now);
                if skipped {
                    cycles += self.skip_pass(card, &pass);
                    self.take_event(card);
                    self.ongoing.close_pass().into_iter().for_each(|number| self.ongoing.end(number));
                } else {
                    cycles += self.begin_pass(card, &pass);
                }
                card.epoch += 1;
                self.state = State::Clearing;
            }
            Event::EndPass(_) => {
                let pass = card.passes.last()?;
                self.pieces.push_back(Piece { slot: pass.into(), kind: Kind::PASS });
                let (number, stage) = (self.ongoing.close_pass(), EndStage::Reports(2 * self.pipelines));
                self.endings.push_back(Ending { pass, number, stage });
                self.state = if self.tracks { State::Ready } else { State::Ending };
                self.in_pass = false;
                self.draw = None;
            }
            Event::Dispatch(dispatch) => {
                card.phases.begin(PhaseKind::Dispatch, dispatch.number, &dispatch.label, now);
                self.dispatch = Some(dispatch.clone());
                if self.tracks {
                    self.begin_ongoing(Doing::Dispatch, dispatch.reach.clone());
                }
                card.epoch += 1;
            }
            Event::Groups(groups) => {
                let slot = self.free_runs.pop()?;
                let (dispatch, groups) = (self.dispatch.clone()?, groups.clone());
                if card.class_state.same_tiles {
                    card.frame.forget_lines(groups.invocations.lines.iter());
                }
                card.compute[usize::from(slot)] = Some(ComputeWork { dispatch, groups, epoch: card.epoch });
                self.ongoing.begin_run(slot);
                self.pieces.push_back(Piece { slot, kind: Kind::DATA });
                self.state = State::Ready;
            }
            Event::Contents(contents) => {
                let index = card.frame.surface(&contents.surface);
                let store = &mut card.frame.stores[index];
                if !store.load(&contents.bytes) {
                    let event = self.items;
                    card.stop(order(event, "contents of a surface have the wrong number of bytes"));
                    return None;
                }
                store.in_memory();
                let key = contents.surface.key;
                self.forget_depths(key);
                cycles = 0;
            }
            Event::Transfer(transfer) => {
                if !drained && !self.tracks {
                    return None;
                }
                let transfer = *transfer;
                if let (true, Some(to)) = (card.class_state.same_tiles, transfer.to) {
                    card.frame.forget_range(to, transfer.bytes);
                }
                card.phases.begin(PhaseKind::Transfers, 0, "", now);
                self.stream.begin(transfer.from, transfer.to, transfer.bytes);
                let number = self.tracks.then(|| self.begin_ongoing(Doing::Copy, transfer.reach()));
                self.moving = Some(Moving { from: now + cycles, number, surfaces: transfer.surfaces });
                self.state = if self.tracks { State::Ready } else { State::Moving };
                card.epoch += 1;
            }
            Event::EndFrame(end) => {
                let end = end.clone();
                if !drained {
                    return None;
                }
                if self.present.is_some() {
                    return self.end_frame(wires, card);
                }
                self.state = match end.shown.as_ref().and_then(|shown| card.frame.find(shown.key)) {
                    Some(index) if self.scanout => {
                        if !wires.try_push(&self.ports.scanout, Piece { slot: index as u16, kind: Kind::DATA }) {
                            return None;
                        }
                        Command::overlay(wires, card, &end);
                        State::Scanning
                    }
                    _ => State::Over,
                };
                card.phases.begin(PhaseKind::ScanOut, 0, "", now);
                card.interleave.end_frame();
                self.ended = Some(end);
            }
        }
        self.take_event(card);
        self.busy_until = now + cycles;
        Some(())
    }

    /// Whether the event at the head waits for something under way that it may not run beside.
    fn must_hold(&mut self, card: &Card) -> bool {
        match card.events.front() {
            Some(Event::BeginPass(pass)) => !card.passes.has_room() || self.must_wait(Doing::Pass, &pass.reach()),
            Some(Event::Draw(draw)) if self.ongoing.others() => self.must_wait(Doing::Pass, &draw.reach.clone()),
            Some(Event::Dispatch(dispatch)) if !self.ongoing.is_empty() => self.must_wait(Doing::Dispatch, &dispatch.reach),
            // The stream makes one at a time. Results of queries depend on more than memory.
            Some(Event::Transfer(transfer)) => {
                self.moving.is_some()
                    || if transfer.kind == TransferKind::Other {
                        self.must_drain()
                    } else {
                        self.must_wait(Doing::Copy, &transfer.reach())
                    }
            }
            Some(Event::Contents(contents)) => {
                let mut reach = Reach::default();
                reach.writes.add(contents.surface.extent());
                self.must_wait(Doing::Copy, &reach)
            }
            Some(Event::EndFrame(_)) => self.must_drain(),
            _ => false,
        }
    }

    /// Begins something beside what is under way.
    fn begin_ongoing(&mut self, doing: Doing, reach: Reach) -> u32 {
        self.counts.overlapped += u64::from(!self.ongoing.is_empty());
        self.ongoing.begin(doing, reach)
    }

    /// Takes the event at the head, which is carried out.
    pub(super) fn take_event(&mut self, card: &mut Card) {
        let Some(event) = card.events.pop_front() else { return };
        self.items += 1;
        if let Err(wrong) = card.holdings.apply(&event) {
            card.stop(wrong.into());
        }
    }

    /// Begins tests of bounds; the cycles of the first of them.
    pub(super) fn begin_tests(&mut self, tests: u64) -> Cycle {
        let cycles = Cycle::from(self.config.cull_cycles);
        self.tests = if cycles > 0 { tests.saturating_sub(1) } else { 0 };
        cycles * tests.min(1)
    }
}
