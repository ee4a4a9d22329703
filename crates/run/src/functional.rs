//! The `functional` fidelity: what is counted in API order, without time.

use super::frame_sink::{Frame, FrameSink, reference};
use super::rendering::{Consumer, Work};
use render::ConsumerMemory;
use stats::{Group, Tree};
use work::{Event, FUNNEL, Funnel};

/// Counts what is done, and adds it up in `total`.
pub(super) fn counting<'c>(mut sink: FrameSink<'c>, total: &'c mut Funnel) -> Consumer<'c> {
    let memory = ConsumerMemory { frames: sink.keeps, ..ConsumerMemory::default() };
    let run = move |work: Work| {
        let mut funnel = Funnel::default();
        for event in work {
            match event {
                Event::Segment(segment) => funnel += segment.funnel,
                Event::EndFrame(end) => {
                    let own = std::mem::take(&mut funnel);
                    *total += own;
                    sink.put(Frame {
                        number: end.number,
                        shown: reference(&end),
                        tree: tree(&own),
                        phases: Vec::new(),
                        display: Default::default(),
                    })?;
                }
                _ => {}
            }
        }
        Ok(())
    };
    Consumer { memory, recorded: false, stored: false, run: Box::new(run) }
}

/// The statistics of a functional run.
pub(super) fn tree(funnel: &Funnel) -> Tree {
    let mut tree = Tree::new();
    FUNNEL.at(&mut tree, 0).extend(funnel.tree());
    tree
}
