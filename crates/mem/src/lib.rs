//! Floor 2: memory, in time only. Tags, misses, ways through the crossbar, banks and rows; bytes live elsewhere.
//!
//! ```text
//! clients ─► Crossbar ─► L2 slices ─► DRAM channels
//!    ▲                      │  ▲            │
//!    └──── ReturnPath ◄─────┘  └────────────┘
//! ```
//!
//! A client has a [`MemoryPort`]: a channel of [`Request`]s and one of [`Answer`]s. What is behind it is either this, or an
//! [`Ideal`] memory of fixed latency and bandwidth; [`MemoryPlan`] wires either into a machine.

mod cache;
mod crossbar;
mod dram;
mod ideal;
mod l2;
mod misses;
mod port;
mod system;
mod tlb;

pub use cache::{CACHES, Cache, CacheCounts, CacheShape, Place};
pub use crossbar::{CLIENTS, ClientCounts, Crossbar, ReturnPath};
pub use dram::{DRAM, Dram, DramConfig, DramCounts, PagePolicy, RefreshScope};
pub use ideal::{Ideal, IdealConfig};
pub use l2::{L2Config, L2Counts, L2Slice, SLICES};
pub use misses::Misses;
pub use port::{
    Answer, DramAnswer, DramRequest, HEADER, Kind, MemoryPort, REQUEST_BYTES, Request, SliceAnswer, SliceRequest, requests,
};
pub use system::{
    ChannelShare, Interleave, Memory, MemoryConfig, MemoryIds, MemoryKind, MemoryKnobs, MemoryPlan, MemoryUnits, PortShape,
    client_sums, memory_tree,
};
pub use tlb::{TLB, TlbConfig, TlbCounts};
#[cfg(test)]
mod tests;
