//! Questions of pipelines that draw here without owning pixels: they ask for the depths of this ROP's pixels, as they are when the question is
//! answered.

use std::collections::VecDeque;

use super::Depth;
use crate::card::Card;
use crate::depths::test_ahead;
use crate::token::{Answer, GroupToken, Kind, Question};
use num::Cycle;
use sim::{In, Out, Tick, Wires};

/// Ways to and from each pipeline.
#[derive(Clone)]
pub struct QuestionPorts {
    /// Questions.
    pub questions: Vec<In<Question>>,
    /// Answers.
    pub answers: Vec<Out<Answer>>,
}

/// A question between lookup and answer.
#[derive(Clone, Copy, Debug)]
struct PendingQuestion {
    question: Question,
    asker: usize,
    line: u32,
    from: Cycle,
}

/// Questions taken in and not answered yet.
#[derive(Clone)]
pub(super) struct Questions {
    ports: QuestionPorts,
    asked: VecDeque<PendingQuestion>,
    /// The pipeline whose question is taken next, if it has one.
    turn: usize,
}

impl Questions {
    pub fn new(ports: QuestionPorts) -> Questions {
        Questions { ports, asked: VecDeque::new(), turn: 0 }
    }

    pub fn resident(&self) -> usize {
        self.asked.len()
    }
}

impl Depth {
    /// Answers what is ready: the block's depths are there. Each question takes as long as a test of its quads.
    pub(super) fn answer(&mut self, wires: &mut Wires, card: &mut Card) -> Tick {
        let mut did = Tick::Starved;
        let rate = u64::from(self.config.quads_per_cycle);
        let Some(questions) = &mut self.questions else { return did };
        while let Some(&PendingQuestion { question, asker, line, from }) = questions.asked.front() {
            let now = wires.now();
            if from > now {
                wires.sleep_until(from);
                return did.or(Tick::Working);
            }
            if !self.cache.ready(line as usize) {
                return did.or(Tick::Memory);
            }
            if self.free_at >= (now + 1) * rate {
                wires.sleep_until(self.free_at / rate);
                return did.or(Tick::Working);
            }
            if !wires.can_push(&questions.ports.answers[asker]) {
                return did.or(Tick::Blocked);
            }
            let Card { groups, work, passes, frame, .. } = card;
            let group = &mut groups[usize::from(self.pipeline)][question.group];
            let work = work[usize::from(group.slot)].as_ref().expect("a group's segment is in flight");
            let pass = passes.get(work.pass).expect("quads are tested in a pass");
            let quads = group.live.iter().filter(|&&live| live != 0).count() as u32;
            let mut bytes = 0;
            if let (Some(state), Some(surface)) = (&work.ahead, pass.depth) {
                let store = &mut frame.stores[surface];
                bytes = quads * 4 * store.surface.samples * store.surface.format.block_bytes();
                test_ahead(&state.read_only(), work, group, pass.blocks_across, store);
            }
            self.cache.release(line as usize, false);
            self.free_at = self.free_at.max(now * rate) + u64::from(quads.max(1));
            self.items += u64::from(quads);
            wires.push_sized(&questions.ports.answers[asker], Answer { ticket: question.ticket, bytes }, bytes);
            questions.asked.pop_front();
            did = Tick::Moved;
        }
        did
    }

    /// Takes questions in, of one pipeline after the other, and looks their blocks up.
    pub(super) fn take_questions(&mut self, wires: &mut Wires, card: &mut Card) -> Tick {
        let mut did = Tick::Starved;
        let mut budget = self.config.quads_per_cycle;
        let Some(mut questions) = self.questions.take() else { return did };
        let askers = questions.ports.questions.len();
        let mut idle = 0;
        while idle < askers {
            let asker = questions.turn;
            questions.turn = if asker + 1 < askers { asker + 1 } else { 0 };
            let Some(question) = wires.front(&questions.ports.questions[asker]) else {
                idle += 1;
                continue;
            };
            let full = questions.asked.len() as u32 >= self.config.fifo;
            if full || budget == 0 {
                questions.turn = asker;
                did = did.or(if full { Tick::Blocked } else { Tick::Moved });
                break;
            }
            let group = &card.groups[usize::from(self.pipeline)][question.group];
            let quads = group.count;
            let token = GroupToken { group: question.group, sequence: 0, kind: Kind::DATA, quads, pool: self.pipeline };
            match self.look_up(card, token) {
                Ok(Some(line)) => {
                    let from = wires.now() + Cycle::from(self.config.latency);
                    questions.asked.push_back(PendingQuestion { question, asker, line, from });
                }
                Ok(None) => unreachable!("what is asked for is tested here"),
                Err(stall) => {
                    questions.turn = asker;
                    did = did.or(stall);
                    break;
                }
            }
            wires.take(&questions.ports.questions[asker]);
            budget = budget.saturating_sub(u32::from(quads));
            idle = 0;
            did = Tick::Moved;
        }
        self.questions = Some(questions);
        did
    }
}
