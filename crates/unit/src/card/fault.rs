//! Why a run must stop.

use num::OUR_FAULT;
use work::{NotHeld, SurfaceKey};

/// Something that the machine cannot do, or that the work got wrong; the run stops with it.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum Fault {
    /// The order of events is not one.
    #[error("event {event} of the work comes where it cannot: {what}. {OUR_FAULT}")]
    Order {
        /// Number of the event, from 0.
        event: u64,
        /// The damage that was found.
        what: &'static str,
    },
    /// A workgroup does not fit a core.
    #[error("dispatch {dispatch}: {what} asks for {asked}, and a core of this machine has {has} (configuration key {key})")]
    Resources {
        /// The dispatch.
        dispatch: u32,
        /// The resource that is short.
        what: &'static str,
        /// The amount that a workgroup needs.
        asked: u64,
        /// The amount that a core has.
        has: u64,
        /// The knob that says so.
        key: &'static str,
    },
    /// More primitives in a pass than pipelines with copies can number.
    #[error("a pass has {most} primitives or more, which pipelines with copies of their own cannot number")]
    Primitives {
        /// How many are too many.
        most: u32,
    },
    /// A machine cannot warm functionally.
    #[error(
        "functional warming of a segment was asked for, but machines of class {class} keep the pixels of a pass elsewhere until it ends"
    )]
    FunctionalWarming {
        /// The sort class.
        class: &'static str,
    },
    /// A free-running display cannot show a frame.
    #[error("frame {frame} cannot be shown: {what}")]
    Display {
        /// The frame's number in the trace.
        frame: u32,
        /// Why, and what to do.
        what: String,
    },
    /// A quad passed this machine's early tests but was not shaded in API order.
    #[error(
        "draw {draw}: a quad in block ({x}, {y}) passed early depth and stencil tests here, but not in API order. {OUR_FAULT}"
    )]
    Visibility {
        /// The draw.
        draw: u32,
        /// Block column.
        x: u32,
        /// Block row.
        y: u32,
    },
    /// Work asks for an image that the machine's stores do not hold.
    #[error(transparent)]
    NotHeld(#[from] NotHeld),
    /// A copy of a whole image cannot be made.
    #[error("an image of {from:?} cannot be copied to {to:?} in the machine's stores. {OUR_FAULT}")]
    Copy {
        /// The image that is copied.
        from: SurfaceKey,
        /// The one that becomes its copy.
        to: SurfaceKey,
    },
}
