//! What each event of the stream begins.

use super::super::card::{Card, ComputeWork, Fault};
use super::super::phase::PhaseKind;
use super::super::token::{Kind, Piece};
use super::{Command, State};
use num::Cycle;
use sim::Wires;
use work::Event;

impl Command {
    /// Hands the next event out; `None` if it has to wait.
    pub(super) fn event(&mut self, wires: &mut Wires, card: &mut Card) -> Option<()> {
        let now = wires.now();
        let order = |event: u64, what: &'static str| Fault::Order { event, what };
        let drained = self.free.len() == self.reports.len() && self.pieces.is_empty();
        let in_pass = card.pass.is_some();
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
        // What is not part of a dispatch waits for the dispatch.
        if self.computing() && !matches!(card.events.front()?, Event::Groups(_)) {
            return None;
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
                if !self.ports.turns.is_empty() {
                    self.flying.push_back((slot, self.draws));
                }
                self.pieces.push_back(Piece { slot, kind: Kind::DATA });
                self.pieces.push_back(Piece { slot, kind: Kind::SEGMENT });
            }
            // Waits until nothing is in flight; then it is taken from here ([`Command::apply`]).
            Event::Applied(_) => return None,
            Event::Draw(draw) => {
                let draw = draw.clone();
                let changes = self.states.differs(draw.state);
                if changes && !self.states.has_room() {
                    return None;
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
                    self.states.change(draw.state);
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
                let skipped = skips && matches!(next, Some(Event::EndPass(_)));
                card.phases.begin(PhaseKind::Pass, pass.number, &pass.label, now);
                if skipped {
                    cycles += self.skip_pass(card, &pass);
                    self.take_event(card);
                } else {
                    cycles += self.begin_pass(card, &pass);
                }
                card.epoch += 1;
                self.state = State::Clearing;
            }
            Event::EndPass(_) => {
                self.pieces.push_back(Piece { slot: 0, kind: Kind::PASS });
                self.state = State::Ending(2 * self.pipelines);
                self.draw = None;
            }
            Event::Dispatch(dispatch) => {
                card.phases.begin(PhaseKind::Dispatch, dispatch.number, &dispatch.label, now);
                self.dispatch = Some(dispatch.clone());
                card.epoch += 1;
            }
            Event::Groups(groups) => {
                let slot = self.free_runs.pop()?;
                let (dispatch, groups) = (self.dispatch.clone()?, groups.clone());
                if card.class_state.same_tiles {
                    card.frame.forget_lines(groups.lines.iter());
                }
                card.compute[usize::from(slot)] = Some(ComputeWork { dispatch, groups });
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
                if !drained {
                    return None;
                }
                let transfer = *transfer;
                if let (true, Some(to)) = (card.class_state.same_tiles, transfer.to) {
                    card.frame.forget_range(to, transfer.bytes);
                }
                card.phases.begin(PhaseKind::Transfers, 0, "", now);
                self.stream.begin(transfer.from, transfer.to, transfer.bytes);
                self.state = State::Moving(transfer.surfaces);
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
