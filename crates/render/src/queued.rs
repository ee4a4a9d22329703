//! A draw with all that it reads, so that it can be done by another thread, later, and again.

use std::sync::{Arc, Mutex};

use gfx::state::{Rect, Viewport};
use work::{Event, Reach, RenderKey, Signature};

use super::bind::{Lent, ResolvedBindings};
use super::draw::{self, Boxes, BufferRange, DrawCall, DrawError, Drawn, IndexRange, RenderPass};
use super::ledger::Ledger;
use super::needs::Need;
use super::pipeline::RenderPipeline;

/// The state that all draws of a pass share.
#[derive(Clone)]
pub(super) struct Shared {
    pub key: RenderKey,
    pub areas: bool,
    pub skips: draw::Skips,
    pub need: Need,
    pub boxes: Arc<Mutex<Boxes>>,
}

/// The resources bound to the slots of a draw. The lists are used again for draws that are not kept.
#[derive(Default)]
pub(super) struct Bound {
    pub vertex_buffers: Vec<Option<BufferRange>>,
    /// The bindings of the vertex and of the fragment program.
    pub resolved: [ResolvedBindings; 2],
}

impl Bound {
    /// Holds nothing any more, and keeps its memory.
    pub fn clear(&mut self) {
        self.vertex_buffers.clear();
        self.resolved.iter_mut().for_each(ResolvedBindings::clear);
    }
}

/// A draw, looked up.
pub(super) struct QueuedDraw {
    /// Number in the trace.
    pub number: u32,
    pub group: Arc<str>,
    pub pipeline: Arc<RenderPipeline>,
    pub bound: Bound,
    pub index: Option<IndexRange>,
    pub range: draw::Range,
    pub viewport: Viewport,
    pub scissor: Rect,
    pub blend_constant: [f32; 4],
    pub stencil_reference: u32,
    pub count_samples: bool,
    /// A statistics query is open.
    pub counted: bool,
    pub record: bool,
    pub signature: Option<Signature>,
    /// Memory that it may touch beside attachments.
    pub reach: Arc<Reach>,
    /// Number of its state in the pass.
    pub state: u32,
}

impl QueuedDraw {
    /// Draws it.
    ///
    /// # Errors
    /// As [`RenderPass::draw`].
    pub fn draw(
        &self,
        pass: &mut RenderPass,
        shared: &Shared,
        ledger: &Ledger,
        sink: &mut dyn FnMut(Event),
    ) -> Result<Drawn, DrawError> {
        self.lend(shared, ledger, |call| pass.draw(call, sink))
    }

    /// Does something with it as the call that it is.
    pub fn lend<R>(&self, shared: &Shared, ledger: &Ledger, work: impl FnOnce(&DrawCall<'_>) -> R) -> R {
        let [mut vertex, mut fragment] = <[Lent<'_>; 2]>::default();
        let [vertex, fragment] = [self.bound.resolved[0].lend(&mut vertex), self.bound.resolved[1].lend(&mut fragment)];
        let call = DrawCall {
            number: self.number,
            group: &self.group,
            pipeline: &self.pipeline,
            vertex_buffers: &self.bound.vertex_buffers,
            index: self.index.as_ref(),
            range: self.range,
            vertex_resources: vertex,
            fragment_resources: self.pipeline.fragment().map(|_| fragment),
            viewport: self.viewport,
            scissor: self.scissor,
            blend_constant: self.blend_constant,
            stencil_reference: self.stencil_reference,
            count_samples: self.count_samples,
            counted: self.counted,
            need: shared.need,
            areas: shared.areas,
            key: shared.key,
            record: self.record,
            signature: self.signature,
            reach: &self.reach,
            state: self.state,
            skips: shared.skips,
            boxes: (!self.counted).then_some(&*shared.boxes),
            ledger,
        };
        work(&call)
    }
}
