//! Notes of what passes, dispatches and copies read and write, in their order. Sequences are long, so the notes are not kept in memory.

use std::collections::{BTreeSet, HashMap};
use std::io;
use std::sync::Arc;

use host::Spool;

use super::{Step, StepKind, Thing};

/// Different steps that are known in memory at a time. Those of most frames are alike.
const KNOWN: usize = 512;

/// Steps that are read at a time.
const READ: u64 = 4096;

/// Bytes of a step's place.
const PLACE: u64 = size_of::<u64>() as u64;

/// Steps in order.
#[derive(Debug, Default)]
pub(super) struct Notes {
    /// Different steps, one behind the other. One that was forgotten in the meantime is there again.
    kinds: Spool,
    /// Where each step begins in these.
    steps: Spool,
    /// Where those that are known begin.
    known: HashMap<Step, u64>,
}

impl Notes {
    /// Whether a step is known.
    pub fn knows(&self, step: &Step) -> bool {
        self.known.contains_key(step)
    }

    /// Adds a step.
    ///
    /// # Errors
    /// As [`Spool::add`].
    pub fn add(&mut self, step: Step) -> io::Result<()> {
        let place = match self.known.get(&step) {
            Some(&place) => place,
            None => {
                let place = self.kinds.len();
                self.kinds.add(&encoded(&step))?;
                if self.known.len() == KNOWN {
                    self.known.clear();
                }
                self.known.insert(step, place);
                place
            }
        };
        self.steps.add(&place.to_ne_bytes())
    }

    /// No step is added any more.
    pub fn end(&mut self) {
        self.known = HashMap::new();
    }

    /// Calls `each` with every step, the last first.
    ///
    /// # Errors
    /// As [`Spool::read`].
    pub fn backwards(&self, mut each: impl FnMut(&Step)) -> io::Result<()> {
        let mut known: HashMap<u64, Arc<Step>> = HashMap::new();
        let (mut left, mut places) = (self.steps.len() / PLACE, Vec::new());
        while left > 0 {
            let from = left.saturating_sub(READ);
            places.resize(((left - from) * PLACE) as usize, 0);
            self.steps.read(from * PLACE, &mut places)?;
            for place in places.rchunks_exact(PLACE as usize) {
                let place = u64::from_ne_bytes(std::array::from_fn(|at| place[at]));
                let step = match known.get(&place) {
                    Some(step) => step.clone(),
                    None => {
                        if known.len() == KNOWN {
                            known.clear();
                        }
                        let step = Arc::new(self.step(place)?);
                        known.insert(place, step.clone());
                        step
                    }
                };
                each(&step);
            }
            left = from;
        }
        Ok(())
    }

    /// The step that begins at a place.
    fn step(&self, place: u64) -> io::Result<Step> {
        let mut head = [0; HEAD];
        self.kinds.read(place, &mut head)?;
        let number = |at: usize| u32::from_ne_bytes(std::array::from_fn(|byte| head[4 * at + byte]));
        let kind = match number(0) {
            0 => StepKind::Pass,
            1 => StepKind::Dispatch,
            2 => StepKind::Copy,
            _ => StepKind::Present,
        };
        let mut next = place + HEAD as u64;
        let mut set = |at: usize| -> io::Result<BTreeSet<Thing>> {
            let mut bytes = vec![0; number(at) as usize * THING];
            self.kinds.read(next, &mut bytes)?;
            next += bytes.len() as u64;
            Ok(bytes.chunks_exact(THING).map(thing).collect())
        };
        Ok(Step {
            kind,
            fresh: set(1)?,
            extent: set(2)?,
            reads: set(3)?,
            color_reads: set(4)?,
            writes: set(5)?,
            color_writes: set(6)?,
        })
    }
}

/// Bytes in front of a step's things: its kind, and how many things are in each set.
const HEAD: usize = 7 * 4;

/// Bytes of a thing: what it is, and two numbers.
const THING: usize = 3 * 4;

fn encoded(step: &Step) -> Vec<u8> {
    let Step { kind, fresh, extent, reads, color_reads, writes, color_writes } = step;
    let sets = [fresh, extent, reads, color_reads, writes, color_writes];
    let kind = match kind {
        StepKind::Pass => 0,
        StepKind::Dispatch => 1,
        StepKind::Copy => 2,
        StepKind::Present => 3,
    };
    let mut numbers = vec![kind];
    numbers.extend(sets.map(|set| set.len() as u32));
    numbers.extend(sets.into_iter().flatten().flat_map(|thing| match *thing {
        Thing::Level(texture, level) => [0, texture, level],
        Thing::Buffer(buffer) => [1, buffer, 0],
        Thing::Queries(set) => [2, set, 0],
    }));
    numbers.into_iter().flat_map(u32::to_ne_bytes).collect()
}

fn thing(bytes: &[u8]) -> Thing {
    let number = |at: usize| u32::from_ne_bytes(std::array::from_fn(|byte| bytes[4 * at + byte]));
    match number(0) {
        0 => Thing::Level(number(1), number(2)),
        1 => Thing::Buffer(number(1)),
        _ => Thing::Queries(number(1)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn steps_come_back_the_last_first() {
        let step = |n: u32| {
            let things =
                |of: u32| (0..n % of).map(|at| [Thing::Level(at, n), Thing::Buffer(n), Thing::Queries(at)][at as usize % 3]);
            Step {
                kind: [StepKind::Pass, StepKind::Dispatch, StepKind::Copy, StepKind::Present][n as usize % 4],
                fresh: things(2).collect(),
                extent: things(3).collect(),
                reads: things(4).collect(),
                color_reads: things(5).collect(),
                writes: things(6).collect(),
                color_writes: things(7).collect(),
            }
        };
        // Twice all that are different, which are more than are known at a time.
        let number = |at: u32| at * 7 % 1000;
        let mut notes = Notes::default();
        (0..10_000).for_each(|at| notes.add(step(number(at))).expect("added"));
        assert!(notes.known.len() <= KNOWN);
        notes.end();
        let mut at = 10_000;
        let each = |found: &Step| {
            at -= 1;
            assert_eq!(found, &step(number(at)), "step {at}");
        };
        notes.backwards(each).expect("read");
        assert_eq!(at, 0);
    }
}
