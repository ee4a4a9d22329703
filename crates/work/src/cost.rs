//! What running a shader costs: instructions by class, broken where memory or a texture is asked.

use serde::{Deserialize, Serialize};

use crate::Request;

/// Instruction classes, each issued at its own rate.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[repr(u8)]
pub enum Class {
    /// Single-precision add, multiply, compare, select, conversion, move.
    Float,
    /// Integer and bit operations, without multiplications.
    Integer,
    /// Reciprocals, roots, logarithms, exponentials, sines, conversions: the special function unit.
    Special,
    /// Branches, mask changes, barriers.
    Control,
    /// Multiplications of 32-bit integers, with the addition of a third operand.
    Multiply,
}

impl Class {
    /// Number of classes.
    pub const COUNT: usize = 5;

    /// All classes, in index order.
    pub const ALL: [Class; Class::COUNT] = [Class::Float, Class::Integer, Class::Special, Class::Control, Class::Multiply];
}

/// What a step ends with.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum RequestKind {
    /// Nothing: the shader's end.
    End,
    /// A texture instruction: the result comes back through the texture unit.
    Texture,
    /// A load from a buffer or a storage texture: the result comes back.
    Load,
    /// A store: nothing comes back.
    Store,
    /// An atomic: done at the second-level cache, the result comes back.
    Atomic,
    /// A load from a uniform buffer: the result comes back through the constant cache, or through the texture unit where a card has none.
    /// Its request stands behind all others of a run ([`Cost::asking`]).
    Constant,
    /// An access to workgroup memory, which the core has itself. Its request is among those of [`Groups::shared`](crate::Groups::shared).
    Shared,
    /// A workgroup barrier: all invocations of the group must arrive.
    Barrier,
}

num::keyed! {
    /// A unit that serves requests of shaders. Each answers them in their order.
    pub enum Service;
    /// A table with an entry for each service.
    pub struct ServiceMap;
    /// The texture unit: textures and memory. It also serves the requests to services for which a card has no unit.
    Texture "texture unit",
    /// The constant cache: uniform buffers.
    Constant "constant cache",
    /// Workgroup memory, which a core has itself.
    Shared "workgroup memory",
}

impl RequestKind {
    /// The service that the request is for. None if the step asks nobody.
    #[inline(always)]
    pub const fn service(self) -> Option<Service> {
        match self {
            RequestKind::End | RequestKind::Barrier => None,
            RequestKind::Texture | RequestKind::Load | RequestKind::Store | RequestKind::Atomic => Some(Service::Texture),
            RequestKind::Constant => Some(Service::Constant),
            RequestKind::Shared => Some(Service::Shared),
        }
    }

    /// Whether the step has an entry among the requests (ends, barriers and accesses to workgroup memory have none).
    #[inline(always)]
    pub const fn has_request(self) -> bool {
        match self.service() {
            Some(Service::Texture | Service::Constant) => true,
            Some(Service::Shared) | None => false,
        }
    }
}

/// Instructions, then one request.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Step {
    /// Instructions by [`Class`], for one invocation.
    pub instructions: [u32; Class::COUNT],
    /// The instructions of the longest chain among them: each one needs the result of the one before it. Those of the blocks of a step are
    /// added up, because a branch waits for what it depends on.
    pub chain: [u32; Class::COUNT],
    /// How many of the requests before it may be unanswered when it begins, because no instruction of it needs their results.
    pub in_flight: InFlight,
    /// What follows.
    pub then: RequestKind,
}

impl Step {
    /// Instructions that all wait for the one before them, and for all requests before them; then a request.
    pub const fn dependent(instructions: [u32; Class::COUNT], then: RequestKind) -> Step {
        Step { instructions, chain: instructions, in_flight: InFlight::NONE, then }
    }
}

/// Numbers of requests that may be unanswered, by service.
pub type InFlight = ServiceMap<u8>;

impl InFlight {
    /// All are answered.
    pub const NONE: InFlight = InFlight::new([0; Service::COUNT]);

    /// Any number may be unanswered.
    pub const ANY: InFlight = InFlight::new([u8::MAX; Service::COUNT]);

    /// The fewer of both.
    #[inline(always)]
    #[must_use]
    pub fn and(self, other: InFlight) -> InFlight {
        InFlight::from_fn(|service| self[service].min(other[service]))
    }
}

/// Index of a cost in its table.
pub type CostId = u16;

/// A piece of a program without a branch or a request in it.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub struct Span {
    /// Where in the program it begins. Of two places that invocations of a warp have got to, they meet again at the later one.
    pub at: u32,
    /// Its instructions in order, as runs of one class: the class, and the number of its instructions one after another.
    pub runs: Vec<(Class, u32)>,
    /// The same by line of the source: the line, from 1, and the number of its instructions. Line 0 is what has no line.
    pub lines: Vec<(u32, u32)>,
    /// The instructions of the longest chain among them ([`Step::chain`]).
    pub chain: [u32; Class::COUNT],
}

/// A span that was executed, and what followed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Point {
    /// The span, in the table of costs.
    pub span: u32,
    /// How many requests may be unanswered when it begins ([`Step::in_flight`]).
    pub in_flight: InFlight,
    /// The request made after it; [`RequestKind::End`] for none.
    pub then: RequestKind,
}

/// The cost of one path through a shader; the last step, and only it, ends with [`RequestKind::End`].
#[derive(Clone, Debug, Default, PartialEq, Eq, Hash)]
pub struct Cost {
    /// Steps in order.
    pub steps: Vec<Step>,
    /// The spans of the path in order, where paths are recorded ([`RenderKey::paths`](super::RenderKey)); else none.
    pub path: Vec<Point>,
}

impl From<Vec<Step>> for Cost {
    /// Of a program without branches.
    fn from(steps: Vec<Step>) -> Cost {
        Cost { steps, path: Vec::new() }
    }
}

impl Cost {
    /// Instructions of all steps by class.
    pub fn instructions(&self) -> [u32; Class::COUNT] {
        let mut sum = [0; Class::COUNT];
        for step in &self.steps {
            for (sum, n) in sum.iter_mut().zip(step.instructions) {
                *sum += n;
            }
        }
        sum
    }

    /// The steps with a request, in the order of the requests of a run: loads from uniform buffers are behind all others.
    pub fn asking(&self) -> impl Iterator<Item = &Step> {
        let of = |constant: bool| {
            let asks = move |step: &&Step| step.then.has_request() && (step.then == RequestKind::Constant) == constant;
            self.steps.iter().filter(asks)
        };
        of(false).chain(of(true))
    }

    /// Steps with a request.
    pub fn requests(&self) -> usize {
        self.steps.iter().filter(|s| s.then.has_request()).count()
    }
}

/// The costs of a shader's paths. A table belongs to one thread's piece of work (a segment's vertices, its quads in one tile, a
/// run of workgroups), so that paths are found in parallel without a merge; equal paths share an entry.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct CostTable {
    /// Entry `CostId`.
    pub costs: Vec<Cost>,
    /// Spans of the program that paths name.
    pub spans: Vec<Span>,
}

impl CostTable {
    /// Bytes that it takes.
    pub fn bytes(&self) -> u64 {
        let cost = |cost: &Cost| size_of::<Cost>() + size_of_val(&*cost.steps) + size_of_val(&*cost.path);
        self.costs.iter().map(|one| cost(one) as u64).sum::<u64>() + size_of_val(&*self.spans) as u64
    }
}

/// Invocations of one stage: their costs, and the memory that they ask for.
#[derive(Clone, Debug, Default)]
pub struct Invocations {
    /// Costs that invocations name.
    pub costs: CostTable,
    /// Their requests, of which each invocation names the first.
    pub requests: Vec<Request>,
    /// Lines of the requests: address / [`LINE`](crate::LINE).
    pub lines: Vec<u32>,
}

impl Invocations {
    /// Bytes that they take.
    pub fn bytes(&self) -> u64 {
        (size_of_val(&*self.requests) + size_of_val(&*self.lines)) as u64 + self.costs.bytes()
    }

    /// Gives unused memory back.
    pub fn shrink_to_fit(&mut self) {
        self.requests.shrink_to_fit();
        self.lines.shrink_to_fit();
    }
}

impl From<CostTable> for Invocations {
    /// Invocations with these costs that ask for nothing.
    fn from(costs: CostTable) -> Invocations {
        Invocations { costs, ..Invocations::default() }
    }
}

impl From<Vec<Cost>> for CostTable {
    fn from(costs: Vec<Cost>) -> CostTable {
        CostTable { costs, spans: Vec::new() }
    }
}

impl std::ops::Index<CostId> for CostTable {
    type Output = Cost;

    fn index(&self, id: CostId) -> &Cost {
        &self.costs[usize::from(id)]
    }
}
