//! The requests that caches would have sent to memory during functional warming of a segment.

/// A touch of memory by a cache.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Touch {
    /// Number of the memory port.
    pub port: u16,
    /// First byte.
    pub address: u64,
    /// Bytes.
    pub bytes: u32,
    /// Whether they are written.
    pub write: bool,
}

/// Touches in order.
pub type Touching = Vec<Touch>;
