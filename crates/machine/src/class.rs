//! What a sort class is: a description of it in a file of its own, and a line in the list below.

use super::blocks::Built;
use super::config::{Config, Rule};
use super::parts::Parts;
use mem::{MemoryError, ShapeError};
use num::OUR_FAULT;
use unit::assembly::Deal;
use unit::class_state::ClassState;
use unit::network::{NetworkError, SenderCounts};
use unit::sorting::{EarlyTest, Keep, SortCounts};
use work::Shade;

/// What goes through the network that sorts: with that it is known what is in front of the network and what behind.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Sorted {
    /// Primitives: all stages of the pipelines are behind the network.
    Primitives,
    /// Triangles: geometry is in front of it, and belongs to no pipeline.
    Triangles,
    /// Fragments: only the ROPs are behind it.
    Fragments,
    /// Frame buffers: all stages are in front of it.
    Images,
}

impl Sorted {
    /// What its items are called.
    pub fn items(self) -> &'static str {
        match self {
            Sorted::Primitives => "primitives",
            Sorted::Triangles => "triangles",
            Sorted::Fragments => "quads",
            Sorted::Images => "samples",
        }
    }

    /// Whether each pipeline has its own geometry.
    pub fn own_geometry(self) -> bool {
        self != Sorted::Triangles
    }
}

/// A rule that knobs break.
pub(crate) type Refusal = fn(&Config) -> Result<(), Rule>;

/// Why units cannot be joined to a machine.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[allow(missing_docs, reason = "the message explains each variant")]
pub enum BuildError {
    #[error(transparent)]
    Network(#[from] NetworkError),
    #[error(transparent)]
    Shape(#[from] ShapeError),
    #[error(transparent)]
    Memory(#[from] MemoryError),
    #[error("a machine has a memory")]
    NoMemory,
    #[error("no unit takes an end of {name}[{index}], from {from} to {to}. {OUR_FAULT}")]
    Untaken { name: &'static str, index: usize, from: String, to: String },
}

/// A sort class.
pub struct Class {
    /// What is sorted.
    pub sorted: Sorted,
    /// Whether a pass's pixels are in the machine's own surfaces while it is drawn, so that functional warming can draw a segment.
    pub in_place: bool,
    /// Whether all that is sorted comes to one place, where it stays until the pass is complete: then no pipeline waits for what the network
    /// cannot give to another.
    pub one_place: bool,
    /// Which quads it shades.
    pub(crate) shade: Shade,
    /// Whether it looks at signatures of tiles.
    pub(crate) signatures: fn(&Config) -> bool,
    /// What knobs it refuses, in addition to what all machines do.
    pub(crate) refusals: &'static [Refusal],
    /// The state that it adds to the card.
    pub(crate) state: fn(&Config) -> ClassState,
    /// Joins the units.
    pub(crate) build: fn(&Config) -> Result<Built, BuildError>,
    /// What sorting has cost.
    pub(crate) sorting: fn(&Parts) -> SortCounts,
    /// What each sender of the network that sorts has waited for.
    pub(crate) senders: fn(&Parts) -> Vec<SenderCounts>,
    /// How long each unit that restores the order behind it has waited, where senders wait for those.
    pub(crate) order: fn(&Parts) -> Vec<u64>,
}

/// Declares the sort classes, each with the module that describes it.
macro_rules! classes {
    ($($(#[doc = $doc:literal])+ $variant:ident $text:literal $module:ident),* $(,)?) => {
        knob::choices! {
            /// Where work is sorted to the pipelines that own the pixels.
            pub enum SortClass { $($(#[doc = $doc])+ $variant $text,)* }
        }

        impl SortClass {
            /// All, in order.
            pub const ALL: &'static [SortClass] = &[$(SortClass::$variant),*];

            /// What it is.
            pub fn class(self) -> &'static Class {
                match self { $(SortClass::$variant => &super::$module::CLASS,)* }
            }
        }
    };
}

classes! {
    /// Primitives, before geometry, by bounds that a pre-transformation finds.
    First "sort-first" sort_first,
    /// Screen-space triangles, between geometry and rasterisation, as they come.
    Middle "sort-middle" sort_middle,
    /// Screen-space triangles, into the lists of tiles, which are drawn one after the other when the pass is complete.
    MiddleBinned "sort-middle-binned" sort_middle_binned,
    /// Shaded quads, between the cores and the ROPs.
    LastFragment "sort-last-fragment" sort_last_fragment,
    /// Whole frame buffers, one per pipeline, when the pass is drawn.
    LastImage "sort-last-image" sort_last_image,
}

/// Pipelines cannot have one run of a pass each.
pub(crate) fn no_runs(config: &Config) -> Result<(), Rule> {
    if config.assembly.deal == Deal::Contiguous {
        let sort = config.card.sort.name();
        let must = format!("another where sort is \"{sort}\": only sort-last-image gives each pipeline one run of a pass");
        return Err(Rule::must("assembly.deal", "\"contiguous\"", must));
    }
    Ok(())
}

/// The order of quads is kept everywhere or nowhere.
pub(crate) fn no_order_where_needed(config: &Config) -> Result<(), Rule> {
    if config.order.keep == Keep::WhereNeeded {
        return Err(Rule::Order { keep: config.order.keep, sort: config.card.sort });
    }
    Ok(())
}

/// Pipelines draw no pixels that others own.
pub(crate) fn no_early_tests(config: &Config) -> Result<(), Rule> {
    if config.order.early != EarlyTest::None {
        let sort = config.card.sort.name();
        let must =
            format!("\"none\" where sort is \"{sort}\": only in sort-last-fragment pipelines draw pixels that others own");
        return Err(Rule::must("order.early", format_args!("\"{}\"", config.order.early.name()), must));
    }
    Ok(())
}
