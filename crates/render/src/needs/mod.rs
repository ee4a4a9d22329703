//! Which passes and dispatches have to be run, so that what is asked of each frame comes out right.
//!
//! A walk over the commands, in which nothing is drawn, notes what each pass, dispatch, upload and copy reads and writes ([`Dependencies`]).
//! A walk backwards over these notes then finds what the frames that are asked for need of what comes before them ([`Needs`]): liveness
//! of data, as a compiler finds it (Aho, Lam, Sethi and Ullman, Compilers, 2006, section 9.2.5). Images are told apart by texture and level;
//! buffers and query sets are taken whole. Only what is overwritten whole ends the life of what was there: where that is not
//! certain, the earlier contents are taken to be read. What a shader may read or write is found from its bindings, so that no data of the trace decide.

mod notes;
mod walk;

use std::collections::{BTreeSet, HashSet};
use std::io;

use notes::Notes;
use trace::{Trace, TraceError};

/// The results of a frame that are wanted.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Want {
    /// Nothing of its own: only what later frames read of it.
    Nothing,
    /// How many vertices, primitives and triangles there are, and about how much they cover and is seen of them ([`work::Areas`]).
    Counts,
    /// Everything: its picture, its work.
    All,
}

/// The part of a pass that has to be done.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Need {
    /// Nothing is drawn.
    Nothing,
    /// Vertices and primitives; depth and stencil of one screen tile in four. What primitives cover is estimated by their areas.
    Survey,
    /// Coverage, depth, stencil and what shaders write to memory, without colours.
    Coverage,
    /// Everything.
    Colors,
}

/// All, in their order.
const NEEDS: [Need; 4] = [Need::Nothing, Need::Survey, Need::Coverage, Need::Colors];

/// Something that commands read and write.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
enum Thing {
    /// All layers of a level of a texture.
    Level(u32, u32),
    /// A buffer.
    Buffer(u32),
    /// A query set.
    Queries(u32),
}

/// The kind of a step.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
enum StepKind {
    Pass,
    Dispatch,
    /// An upload or copy, which is always done.
    #[default]
    Copy,
    /// The end of a frame.
    Present,
}

/// A pass, dispatch, upload, copy or end of a frame.
#[derive(Clone, Debug, Default, PartialEq, Eq, Hash)]
struct Step {
    kind: StepKind,
    /// The things that it overwrites whole, whether anything is drawn or not.
    fresh: BTreeSet<Thing>,
    /// The things that are read to find its extent: arguments of indirect commands.
    extent: BTreeSet<Thing>,
    /// The things that are read for coverage, depth and side effects.
    reads: BTreeSet<Thing>,
    /// The further things that are read for colours.
    color_reads: BTreeSet<Thing>,
    /// The things that are written even if no colours are needed.
    writes: BTreeSet<Thing>,
    /// The further things that are written with colours.
    color_writes: BTreeSet<Thing>,
}

impl Step {
    /// Bytes that it takes, about.
    fn bytes(&self) -> u64 {
        let sets = [&self.fresh, &self.extent, &self.reads, &self.color_reads, &self.writes, &self.color_writes];
        let things: usize = sets.iter().map(|set| set.len()).sum();
        // A node of a tree is at least half full.
        (2 * size_of::<Step>() + 2 * things * size_of::<Thing>()) as u64
    }
}

/// What the passes, dispatches and copies of a trace read and write.
#[derive(Debug, Default)]
pub struct Dependencies {
    notes: Notes,
    frames: u32,
}

/// Which passes and dispatches of a trace have to be run: two bits for a pass, one for a dispatch and for a frame.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Needs {
    passes: Answers<2>,
    dispatches: Answers<1>,
    pictures: Answers<1>,
}

/// A list of numbers of `BITS` bits each, the last first.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
struct Answers<const BITS: u32> {
    words: Vec<u64>,
    len: u32,
}

impl<const BITS: u32> Answers<BITS> {
    const WORD: u32 = u64::BITS / BITS;

    fn add(&mut self, answer: u8) {
        let shift = self.len % Self::WORD * BITS;
        if shift == 0 {
            self.words.push(0);
        }
        let word = self.words.len() - 1;
        self.words[word] |= u64::from(answer) << shift;
        self.len += 1;
    }

    /// That of a number, counted from the first, which was added last.
    fn get(&self, number: u32) -> Option<u8> {
        let at = self.len.checked_sub(number.checked_add(1)?)?;
        let word = self.words.get((at / Self::WORD) as usize)?;
        Some((word >> (at % Self::WORD * BITS)) as u8 & ((1 << BITS) - 1))
    }
}

impl Needs {
    /// The part of a pass that is needed, by the pass's number in the trace.
    pub fn pass(&self, number: u32) -> Need {
        self.passes.get(number).map_or(Need::Colors, |need| NEEDS[need as usize])
    }

    /// Whether a dispatch has to be run, by the number of its command among those that dispatch.
    pub fn dispatch(&self, number: u32) -> bool {
        self.dispatches.get(number).is_none_or(|runs| runs == 1)
    }

    /// Whether the picture of a frame comes out.
    pub fn picture(&self, frame: u32) -> bool {
        self.pictures.get(frame).is_none_or(|comes| comes == 1)
    }

    /// How many passes are left out, surveyed, drawn without colours, and drawn whole.
    pub fn passes(&self) -> [u64; 4] {
        let count = |need: Need| (0..self.passes.len).filter(|&pass| self.pass(pass) == need).count() as u64;
        NEEDS.map(count)
    }
}

impl Dependencies {
    /// Walks over a trace, in which nothing is drawn, up to a frame.
    ///
    /// # Errors
    /// If the trace cannot be read, or names objects that are not there; the error names the command.
    pub fn of(trace: &Trace, end: u32) -> Result<Dependencies, TraceError> {
        walk::notes(trace, end)
    }

    /// Frames that end.
    pub fn frames(&self) -> u32 {
        self.frames
    }

    /// The steps that have to be run for the wanted results of each frame.
    ///
    /// # Errors
    /// If what was noted cannot be read.
    pub fn needs(&self, want: impl Fn(u32) -> Want) -> io::Result<Needs> {
        let mut live: HashSet<Thing> = HashSet::new();
        let (mut passes, mut dispatches, mut pictures) = (Answers::default(), Answers::default(), Answers::default());
        // Commands after the last frame's end belong to a frame that does not end.
        let mut frame = self.frames;
        self.notes.backwards(|step| {
            if step.kind == StepKind::Present {
                frame = frame.saturating_sub(1);
            }
            let want = want(frame);
            let all = want == Want::All;
            let lives = |things: &BTreeSet<Thing>| things.iter().any(|thing| live.contains(thing));
            let colored = all || lives(&step.color_writes);
            let (run, extent) = match step.kind {
                StepKind::Pass => {
                    let need = match colored {
                        true => Need::Colors,
                        false if lives(&step.writes) => Need::Coverage,
                        false if want == Want::Counts => Need::Survey,
                        false => Need::Nothing,
                    };
                    passes.add(need as u8);
                    (need > Need::Nothing, need > Need::Nothing)
                }
                StepKind::Dispatch => {
                    let run = all || lives(&step.writes);
                    dispatches.add(run.into());
                    (run, want == Want::Counts)
                }
                StepKind::Copy => (all || lives(&step.writes), false),
                StepKind::Present => {
                    pictures.add(all.into());
                    (all, false)
                }
            };
            step.fresh.iter().for_each(|thing| {
                live.remove(thing);
            });
            if run || extent {
                live.extend(&step.extent);
            }
            if run {
                live.extend(&step.reads);
            }
            if run && colored {
                live.extend(&step.color_reads);
            }
        })?;
        Ok(Needs { passes, dispatches, pictures })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn answers_are_counted_from_the_one_added_last() {
        let mut answers = Answers::<2>::default();
        (0..100).for_each(|at| answers.add(at % 4 * 3 % 4));
        for number in 0..100 {
            assert_eq!(answers.get(number), Some((99 - number as u8) % 4 * 3 % 4), "{number}");
        }
        assert_eq!((answers.get(100), answers.get(u32::MAX), answers.words.len()), (None, None, 4));
    }
}
