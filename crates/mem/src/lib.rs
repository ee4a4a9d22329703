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
//!
//! # Example
//!
//! The tags of a cache of four lines of 64 bytes, in two sets. A request never crosses a multiple of 256 bytes:
//!
//! ```
//! use mem::{Cache, CacheShape, requests};
//!
//! assert!(requests(192, 128).eq([(192, 64), (256, 64)]));
//!
//! let mut cache = Cache::new(CacheShape::new(4, 2, 64, 32)?);
//! let lines = [0, 64, 0, 128, 256, 0].map(|address| cache.line_of(address));
//! let hits = lines.map(|line| cache.access(line, false).0);
//! // The lines of 0, 128 and 256 share a set of two ways. When 256 comes, 0 is the least recently used.
//! assert_eq!(hits, [false, false, true, false, false, false]);
//! assert_eq!((cache.counts().misses, cache.counts().evictions), (5, 2));
//! # Ok::<(), mem::ShapeError>(())
//! ```

mod cache;
mod crossbar;
mod dram;
mod ideal;
mod l2;
mod misses;
mod port;
mod system;
mod tlb;

pub use cache::{CACHES, Cache, CacheCounts, CacheShape, CacheSlot, ShapeError};
pub use crossbar::{CLIENTS, ClientCounts, Crossbar, ReturnPath};
pub use dram::{BUSY_CYCLES, DRAM, Dram, DramConfig, DramCounts, DramError, PagePolicy, RefreshScope};
pub use ideal::{Ideal, IdealConfig};
pub use l2::{L2Config, L2Counts, L2Slice, SLICES};
pub use misses::Misses;
pub use port::{
    AccessKind, Answer, DramAnswer, DramRequest, HEADER, MemoryPort, REQUEST_BYTES, Request, SliceAnswer, SliceRequest,
    requests,
};
pub use system::{
    ChannelShare, Interleave, Memory, MemoryConfig, MemoryCounts, MemoryError, MemoryIds, MemoryKind, MemoryKnobs, MemoryPlan,
    MemoryUnits, PortShape,
};
pub use tlb::{TLB, TlbConfig, TlbCounts};
#[cfg(test)]
mod tests;
