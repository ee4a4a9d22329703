//! The `functional` fidelity: what is counted in API order, without time.

use super::frame_sink::{Frame, FrameSink, reference};
use super::rendering::{Consumer, Work};
use render::ConsumerMemory;
use stats::{Node, Tree};
use work::{Event, Funnel};

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
    Consumer { memory, recorded: false, run: Box::new(run) }
}

/// The statistics of a functional run.
pub(super) fn tree(funnel: &Funnel) -> Tree {
    let mut tree = Tree::new();
    tree.set("funnel", Node::Tree(funnel_tree(funnel)));
    tree
}

/// The funnel of a run's statistics.
pub fn funnel_of(tree: &Tree) -> Funnel {
    let Some(Node::Tree(funnel)) = tree.get("funnel") else { return Funnel::default() };
    Funnel::collect(|name| funnel.number(name).unwrap_or(0.0) as u64)
}

/// A funnel as a subtree of counters.
pub(super) fn funnel_tree(funnel: &Funnel) -> Tree {
    let mut tree = Tree::new();
    for (name, value) in Funnel::NAMES.iter().zip(funnel.values()) {
        tree.count(name, value);
    }
    tree
}
