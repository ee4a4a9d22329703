//! The sort network: what carries triangles from geometry units to rasterisers, or quads to the ROPs that own their pixels.
//!
//! ```text
//! sending unit ── Sender ══► inject ══► Router ══► link ══► Router ══► eject ══► Receiver ── receiving unit
//!                   ▲                                                               │
//!                   └────────────────────────── CreditReturn ◄──────────────────────┘
//! ```
//!
//! A network joins up to [`MAX_ENDS`] senders with as many receivers, which need not be as many. [`NetworkPlan`] wires one into a
//! machine. What lies between is a matter of configuration ([`NetworkConfig`]); the units at both ends see a [`Sender`] and a
//! [`Receiver`] and nothing of it. Links are channels and count for themselves; [`NetworkMap`] finds the busiest.
//!
//! # Topologies
//!
//! | name | between the ends | links on the way |
//! |---|---|---|
//! | `point-to-point` | a channel for each pair | 1 |
//! | `bus` | an arbiter, one link, and what all receivers listen to | 2 short, 1 |
//! | `crossbar` | one router | 2 |
//! | `ring` | a router a node, both ways round, the shorter one taken | 2 short, up to half the nodes |
//! | `mesh` | a router a node in rows near a square; along the row, then along the column | 2 short, up to both edges |
//! | `butterfly` | stages of switches of `radix` ports | 1 more than stages |
//!
//! A link takes `link_bytes` per cycle and `link_latency` cycles; a short one, from a node into its own router or out of it, takes 1
//! cycle. A router takes none. A parcel moves from link to link as a whole (store and forward): on an empty network it takes for each
//! link its latency and, of the cycles that its bytes take, all but the first. There are as many nodes as there are senders or
//! receivers, whichever are more, and the fewer are spread evenly over them; a butterfly has the next power of its radix. Links that
//! are on no way from a sender to a receiver are not built.
//!
//! # Order
//!
//! For each pair there is one way, and all queues on it are first in, first out: parcels of one sender arrive at one receiver in the
//! order in which they were sent. Between senders there is no order; a receiver that needs one picks by [`Receiver::front`].
//!
//! # Why no network gets stuck
//!
//! A receiver that restores order refuses what has come from all senders but one, for as long as it likes. Were that to hold up what
//! is on links, the parcel that it waits for could be stuck behind others, and the machine with it. Hence:
//!
//! 1. A parcel is sent only with a credit for its sender and receiver, of which there are `receive_queue`: the receiver has a place
//!    for every parcel that is on its way to it. It takes in what arrives in every cycle in which it ticks, and arrivals wake it. So
//!    the last link of every way always empties, whatever the receiving unit does.
//! 2. Say that link a waits for link b if some way goes over a and then b. Where no link waits, over others, for itself, links empty
//!    in the order of waiting, from the last ones back, and every parcel arrives. On bus, crossbar and butterfly links only lead
//!    forwards, stage by stage. On the mesh a parcel goes along the row and then along the column, so that no column waits for a row,
//!    with one exception: from a last row too short to have the column a parcel first goes up. Links up out of the last row are waited for
//!    by that row only, and no way leads from another row into the last one and then along it: rows and columns above come after it.
//!    The queues of a router's store change nothing in this: a store empties if all its outputs do.
//! 3. On a ring links do wait for themselves. There, a parcel from the node itself enters a link only if it leaves a slot free
//!    (bubble flow control: Carrión et al. 1997), and what is on the ring moves on if there is any. Moving on frees the slot left
//!    behind, so that in each direction there is always a free slot in some link or store. What stands before it moves into it, unless
//!    it leaves the ring, which by 1 it can. If nothing stands before it, the link is empty, and the node's own parcels may enter.
//! 4. Credits come back over channels of their own, [`CreditReturn`] takes in whatever comes, and waits only for the link to a
//!    sender, which only holds up credits of that sender.
//!
//! # What the ends do without moving
//!
//! [`Receiver::poll`] takes arrivals off the last link, and does not count as a move of the receiving unit, whose account would else
//! call it busy while it waits for another sender. The clocks agree all the same. Everything that `poll` does follows from an arrival
//! or from room on the way of credits; it asks for both until the answer is no, so that the unit ticks in the cycle in which either
//! changes; and nothing leaves the network by it, as a parcel that is taken in still counts as inside. [`Sender::poll`] takes credits
//! in; there a unit that does nothing else has moved, as the last credit's arrival may be all that a run still waits for.
//!
//! # Deviations from hardware
//!
//! * Parcels are not cut into flits, and links have no virtual channels: a ring has bubbles instead.
//! * A router's outputs take from the store of an input without competing for a way out of it, so that a crossbar reaches its full
//!   width with any traffic, as real ones with speed-up nearly do.
//! * `oldest-first` knows how long a parcel has waited at this router, not since it was sent.
//! * Through traffic of a congested ring may hold back a node's own for as long as it lasts.

mod credit;
mod plan;
mod port;
mod router;
mod stall;
mod topology;
mod traffic;

use bytemuck::{Pod, Zeroable};

pub use credit::{Credit, CreditReturn};
pub use plan::{Names, Network, NetworkError, NetworkPlan};
pub use port::{Receiver, Sender, SenderCounts};
pub use router::Router;
pub use stall::Stall;
pub use traffic::{HOT_SPOT, HOTTEST_SHARE, LINKS, LinkCounts, MEAN_SHARE, NetworkMap, Traffic};

use knob::Allowed;
use sim::Token;

/// Most senders, and most receivers, of a network: a set of them is a 64-bit mask.
pub const MAX_ENDS: usize = 64;

/// The receiver of a parcel that is for all.
const ALL: u8 = 0xff;

knob::choices! {
    /// What lies between senders and receivers.
    pub enum Topology {
        /// A channel of its own for each sender and receiver.
        PointToPoint "point-to-point",
        /// One link for all, which all receivers listen to.
        Bus "bus",
        /// One router.
        Crossbar "crossbar",
        /// A ring in both directions.
        Ring "ring",
        /// Rows and columns.
        Mesh "mesh",
        /// Stages of switches.
        Butterfly "butterfly",
    }
}

knob::choices! {
    /// Which of several inputs an output of a router takes from.
    pub enum Arbitration {
        /// One after another.
        RoundRobin "round-robin",
        /// The one whose parcel has waited longest at this router.
        OldestFirst "oldest-first",
    }
}

knob::knobs! {
    /// The network that sorts.
    pub struct NetworkConfig {
        /// What lies between senders and receivers.
        topology: Topology ["", Allowed::Choice(Topology::NAMES), "a crossbar in cards; ring and mesh in processors (Molnar et al. 1994 compare them)"]
            {estimate: Used, relax: Never, advice: []},
        /// Bytes that each link takes per cycle.
        link_bytes: u32 ["bytes/cycle", Allowed::Range(1, 65536), "assumed: a triangle of 144 bytes per cycle: one setup unit at its end"]
            {estimate: Used, relax: Rate, advice: []},
        /// Cycles on a link between routers, or between an end and a router that is not in its node.
        link_latency: u32 ["cycles", Allowed::Range(1, 256), "assumed: a synchroniser and some millimetres of wire"]
            {estimate: Used, relax: Latency, advice: []},
        /// Parcels that a link between routers holds, those under way included; as many again in the store behind it.
        queue: u32 ["parcels", Allowed::Range(2, 1024), "assumed: more than the latency, so that the link carries its width"]
            {estimate: Ignored("cycles hardly depend on it"), relax: Room, advice: []},
        /// Parcels that a receiver has places for, for each sender.
        receive_queue: u32 ["parcels", Allowed::Range(1, 4096), "assumed: raster engines work on several tiles at a time; ATTILA bGPU.ini SetupFIFOSize = 32"]
            {estimate: RefusedUnless(AtLeast(16), "short queues behind the network that sorts"), relax: Room, advice: []},
        /// Cycles from a receiver that gives places free to the sender that may use them; no matter in a point-to-point network.
        credit_latency: u32 ["cycles", Allowed::Range(2, 256), "assumed: the way back, without queues"]
            {estimate: Ignored("cycles hardly depend on it"), relax: Latency, advice: []},
        /// Which of several inputs an output of a router takes from.
        arbitration: Arbitration ["", Allowed::Choice(Arbitration::NAMES), "round-robin (Dally and Towles 2004, 18.3)"]
            {estimate: Ignored("cycles hardly depend on it"), relax: Never, advice: []},
        /// Inputs, and outputs, of a butterfly's switches.
        radix: u32 ["ports", Allowed::PowerOfTwo(2, 8), "assumed: 4: three stages for 64 ends"]
            {estimate: Ignored("cycles hardly depend on it"), relax: Never, advice: []},
    }
}

/// A token on its way over links and routers.
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
#[repr(C)]
pub struct Parcel {
    payload: [u32; 3],
    /// The bytes that it takes on a link.
    pub bytes: u16,
    /// The sender.
    pub from: u8,
    /// The receiver.
    pub to: u8,
}

impl Parcel {
    #[inline(always)]
    fn new<T: Token>(token: T, from: u8, to: u8, bytes: u32) -> Parcel {
        const { assert!(size_of::<T>() <= 12, "a parcel has room for 12 bytes") };
        assert!(bytes <= u32::from(u16::MAX), "a parcel weighs less than 64 KB");
        let mut payload = [0u32; 3];
        bytemuck::bytes_of_mut(&mut payload)[..size_of::<T>()].copy_from_slice(bytemuck::bytes_of(&token));
        Parcel { payload, bytes: bytes as u16, from, to }
    }

    #[inline(always)]
    fn token<T: Token>(&self) -> T {
        bytemuck::pod_read_unaligned(&bytemuck::bytes_of(&self.payload)[..size_of::<T>()])
    }
}

/// The first of a set from `turn` on, and from 0 after the last; the set is not empty.
#[inline(always)]
fn next_from(set: u64, turn: u8) -> usize {
    let ahead = set & (u64::MAX << turn);
    if ahead != 0 { ahead } else { set }.trailing_zeros() as usize
}

#[cfg(test)]
mod tests;
