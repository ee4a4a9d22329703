//! The options of compiling a program.

/// The options of compiling a program.
#[derive(Clone, Copy, Debug, Default)]
pub struct Options<'a> {
    /// Values of pipeline-overridable constants by name, or by number where they have one.
    pub constants: &'a [(String, f64)],
    /// Locations of the user-defined outputs that are read; none: all are kept. Values that only other outputs need are not computed.
    pub outputs: Option<&'a [u32]>,
    /// Which optimisations are applied. The results are the same bits with any choice; only the time differs.
    pub optimisations: Optimisations,
    /// A fault to put in, for tests that prove that they would find it. None in all real use.
    pub inject_fault: Option<Fault>,
}

/// The optimisations of the compiler, each of which can be left out. A test that finds a wrong result with one of them and a
/// right one without it knows where to look.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Optimisations {
    /// Operations on constants are done by the compiler, and operations that change nothing are left out.
    pub fold: bool,
    /// Loops whose exits the compiler can decide are written out turn by turn.
    pub unroll: bool,
    /// Values that are the same for all invocations are computed once per draw, in the prologue.
    pub hoist: bool,
    /// Equal computations are done once.
    pub share: bool,
    /// Short branches without effects are computed by all lanes, without a mask.
    pub flatten: bool,
    /// A product and the sum that it is used in become one operation.
    pub fuse: bool,
    /// Computations whose results have no use are left out.
    pub drop_dead: bool,
    /// Branches with nothing in them are left out.
    pub drop_empty: bool,
}

impl Optimisations {
    /// Every optimisation.
    pub const ALL: Optimisations = Optimisations {
        fold: true,
        unroll: true,
        hoist: true,
        share: true,
        flatten: true,
        fuse: true,
        drop_dead: true,
        drop_empty: true,
    };

    /// No optimisation.
    pub const NONE: Optimisations = Optimisations {
        fold: false,
        unroll: false,
        hoist: false,
        share: false,
        flatten: false,
        fuse: false,
        drop_dead: false,
        drop_empty: false,
    };
}

impl Default for Optimisations {
    fn default() -> Optimisations {
        Optimisations::ALL
    }
}

/// A known fault of the compiler that a test puts back, to prove that the programs it generates find it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Fault {
    /// Registers: the life of a loop begins at the operation that opens it instead of after it. What is written just before the
    /// loop then counts as written inside, and loses its register after its last use in the body.
    LoopsBeginEarly,
}
