//! What every way of sorting counts, whatever it sorts: primitives before geometry, triangles before rasterisation, or quads before
//! the ROPs.

use crate::num::Cycle;

crate::counters! {
    /// What sorting costs.
    pub struct SortCounts {
        /// Items that were sorted: primitives, triangles or quads, by the sort class; those that nobody needs included.
        sorted_items: "items",
        /// Items sent to at least one receiver.
        sent: "items",
        /// Items sent, each copy counted.
        redistributed_items: "items",
        /// Their bytes.
        redistributed_bytes: "bytes",
        /// Of the items, those that went to another pipeline than the one of that number which sent them.
        foreign_items: "items",
        /// Their bytes.
        foreign_bytes: "bytes",
        /// Sort-first: bytes if scenes are kept in memory, three numbers of vertices a primitive.
        retained_bytes: "bytes",
        /// Sort-first: bytes if they are not, three vertices with all attributes.
        immediate_bytes: "bytes",
        /// Marks sent so that receivers can restore the order.
        marks: "marks",
    }
}

impl SortCounts {
    /// A copy was sent.
    #[inline(always)]
    pub fn copy(&mut self, items: u32, bytes: u32, foreign: bool) {
        self.redistributed_items += u64::from(items);
        self.redistributed_bytes += u64::from(bytes);
        if foreign {
            self.foreign_items += u64::from(items);
            self.foreign_bytes += u64::from(bytes);
        }
    }
}

crate::counters! {
    /// What restoring the order costs.
    pub struct OrderCounts {
        /// Cycles in which something had come and none of it was next in order, summed over those who restore it.
        order_waiting_cycles: "cycles",
    }
}

/// Counts the cycles in which what has come waits for its turn.
#[derive(Debug, Default)]
pub struct OrderClock {
    since: Option<Cycle>,
    counts: OrderCounts,
}

impl OrderClock {
    /// A tick begins: whatever was, is over.
    #[inline(always)]
    pub fn begin(&mut self, now: Cycle) {
        if let Some(since) = self.since.take() {
            self.counts.order_waiting_cycles += now - since;
        }
    }

    /// From now on, until the next tick, something waits for its turn.
    #[inline(always)]
    pub fn wait(&mut self, now: Cycle) {
        self.since = Some(now);
    }

    /// What was counted.
    pub fn counts(&self) -> OrderCounts {
        self.counts
    }
}
