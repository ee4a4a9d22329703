//! Floor 2: the work that `render` leaves for a machine to do, as plain data: the micro-trace.
//!
//! Work depends on the trace and on a [`RenderKey`], never on a machine: no unit count, cache size, latency or sort class is
//! in it. It comes as a stream of [`Event`]s in API order, in bounded pieces ([`Segment`]s), so that a frame larger than memory
//! flows through; a sweep keeps the pieces and times every machine from them.
//!
//! Addresses are bytes in the card's memory, given out by `render`; a *line* is an address divided by [`LINE`]. Larger cache
//! lines are unions of these.
//!
//! # Example
//!
//! The cost of a shader that reads a texture and computes with the result:
//!
//! ```
//! use work::{Class, Cost, RequestKind, Step};
//!
//! let reads = Step::dependent([4, 1, 0, 0, 0], RequestKind::Texture);
//! let ends = Step::dependent([20, 0, 1, 0, 0], RequestKind::End);
//! let cost = Cost::from(vec![reads, ends]);
//! assert_eq!(cost.instructions()[Class::Float as usize], 24);
//! // The end of the program asks nobody.
//! assert_eq!(cost.requests(), 1);
//! ```

mod cost;
mod draw;
mod funnel;
mod groups;
mod held;
mod key;
mod pass;
pub mod profile;
mod reach;
mod segment;

use std::sync::Arc;

use gfx::codec::CODECS;

pub use cost::{Class, Cost, CostId, CostTable, InFlight, Invocations, Point, RequestKind, Service, ServiceMap, Span, Step};
pub use draw::{AttributeFetch, Culling, DebugPath, Draw, RecordedState, ShaderShape, Target};
pub use funnel::{FUNNEL, Funnel};
pub use groups::{Dispatch, Groups, Packet};
pub use held::{Aspects, Holdings, NotHeld, StoreShape};
pub use key::{Cull, CulledLate, RenderKey, Shade, Signature};
pub use pass::{Attachment, Contents, EndFrame, Load, Pass, Sprite, Surface, SurfaceKey, Transfer, TransferKind};
pub use reach::{Extent, Extents, Reach};
pub use segment::{
    Areas, Block, End, LINES, Primitive, PrimitiveOutcome, Programs, QUAD_SHADED, Quad, Request, Segment, TileWork, Triangle,
    Vertex, Visit,
};

/// Bytes of a memory line, the granularity at which work names memory.
pub const LINE: u64 = 64;

/// Width and height of a traversal block in pixels: the unit of hierarchical Z, of fast clear and of compression.
pub const BLOCK: u32 = 8;

/// Width and height in pixels of the screen tiles in which work is grouped.
pub const TILE: u32 = 64;

/// What the blocks of a pass's attachments take in memory as the pass leaves them: memory lines by each codec ([`gfx::codec::lines`]), block
/// after block, row by row.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Stored {
    /// Of colour attachments by location.
    pub color: Vec<Option<Vec<[u8; CODECS]>>>,
    /// Of depth and stencil.
    pub depth: Option<Vec<[u8; CODECS]>>,
}

impl Stored {
    fn bytes(&self) -> u64 {
        self.color.iter().chain([&self.depth]).flatten().map(|blocks| (CODECS * blocks.len()) as u64).sum()
    }
}

/// One step of the stream.
#[derive(Clone, Debug)]
pub enum Event {
    /// A surface has these bytes now, put there by something that is not a draw (upload, copy, compute). Comes before a pass that
    /// loads it, when the machine cannot know the contents.
    Contents(Contents),
    /// A render pass begins.
    BeginPass(Arc<Pass>),
    /// The next segments belong to this draw.
    Draw(Arc<Draw>),
    /// A piece of the current draw.
    Segment(Arc<Segment>),
    /// A piece of the current draw for functional warming: it changes pixels, caches and hierarchical Z and takes no cycles, where a run
    /// simulates only some frames. Rendering makes none of these.
    Applied(Arc<Segment>),
    /// The render pass ends: attachments are stored and resolved. With what their blocks take, where somebody wants to know.
    EndPass(Option<Arc<Stored>>),
    /// A compute dispatch begins.
    Dispatch(Arc<Dispatch>),
    /// A run of workgroups of the current dispatch.
    Groups(Arc<Groups>),
    /// Memory is copied, cleared or uploaded.
    Transfer(Transfer),
    /// A frame ends.
    EndFrame(EndFrame),
    /// The events end here, and frames follow that are not among them. A free-running display is not switched off, and a frame does not wait
    /// for it. Rendering makes none of these.
    FramesFollow,
}

impl Event {
    /// Bytes of the work in it; what is shared with the renderer and small is not counted.
    pub fn bytes(&self) -> u64 {
        match self {
            Event::Segment(segment) | Event::Applied(segment) => segment.bytes(),
            Event::Groups(groups) => groups.bytes(),
            Event::Contents(contents) => contents.bytes.len() as u64,
            Event::EndPass(Some(stored)) => stored.bytes(),
            Event::EndFrame(end) => {
                end.reference.len() as u64 + end.sprites.iter().map(|sprite| sprite.texels.len() as u64).sum::<u64>()
            }
            _ => 0,
        }
    }
}
