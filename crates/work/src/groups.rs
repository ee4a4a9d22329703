//! Compute dispatches and their workgroups.

use crate::{CostId, Invocations, Programs, Reach, Request, ShaderShape};

impl Groups {
    /// Bytes that they take.
    pub fn bytes(&self) -> u64 {
        let shared = size_of_val(&*self.shared) + size_of_val(&*self.words);
        (size_of_val(&*self.packets) + shared) as u64 + self.invocations.bytes()
    }
}

/// A compute dispatch.
#[derive(Clone, Debug)]
pub struct Dispatch {
    /// Number in its frame, from 0.
    pub number: u32,
    /// Label of the pipeline, or empty.
    pub label: String,
    /// The shader.
    pub shape: ShaderShape,
    /// Workgroups in all.
    pub groups: u64,
    /// Invocations per group.
    pub invocations: u32,
    /// Bytes of workgroup memory a group.
    pub shared_bytes: u32,
    /// Memory that it may touch.
    pub reach: Reach,
    /// Its program.
    pub programs: Programs,
}

/// Four consecutive invocations of a workgroup.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Packet {
    /// Cost of running them.
    pub cost: CostId,
    /// First of their requests.
    pub first_request: u32,
    /// First of their accesses to workgroup memory.
    pub first_shared: u32,
}

/// Consecutive workgroups of a dispatch.
#[derive(Clone, Debug, Default)]
pub struct Groups {
    /// Workgroups here.
    pub groups: u32,
    /// Packets: `ceil(invocations / 4)` a group, in order.
    pub packets: Vec<Packet>,
    /// Their costs and memory requests.
    pub invocations: Invocations,
    /// Their accesses to workgroup memory. The lines of such a request are entries of `words`, its operations the words that each invocation
    /// moves, 0 for an atomic.
    pub shared: Vec<Request>,
    /// The first words of these accesses, each once a packet; those of an atomic are one for each invocation.
    pub words: Vec<u32>,
}
