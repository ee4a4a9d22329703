//! One bounded queue: its shape, its state, its arithmetic.

use super::wires::UnitId;
use crate::num::Cycle;

/// The shape of a channel.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Link {
    /// How many items it holds, those on their way included.
    pub capacity: u32,
    /// Cycles from push to the first cycle in which the item can be popped; at least 1.
    pub latency: u32,
    /// What the link carries in a cycle: items, or bytes if `by_bytes`.
    pub width: u32,
    /// Whether `width` counts bytes. An item of more bytes than the width takes several cycles, the last of which counts as its
    /// push; small items share a cycle.
    pub by_bytes: bool,
}

impl Link {
    /// A channel of `capacity` items that takes `width` items a cycle and hands them over after `latency` cycles.
    pub const fn items(capacity: u32, width: u32, latency: u32) -> Link {
        Link { capacity, latency, width, by_bytes: false }
    }

    /// A channel of `capacity` items that takes `width` bytes a cycle and hands an item over `latency` cycles after its last byte.
    pub const fn bytes(capacity: u32, width: u32, latency: u32) -> Link {
        Link { capacity, latency, width, by_bytes: true }
    }

    /// Whether the channel can carry its full width every cycle: a slot is lost for `latency` cycles under way and one more
    /// until the producer may fill it again.
    pub fn sustains_width(&self) -> bool {
        let items = if self.by_bytes { 1 } else { self.width };
        u64::from(self.capacity) >= u64::from(items) * (u64::from(self.latency) + 1)
    }
}

crate::counters! {
    /// What a channel counts about itself.
    pub struct ChannelCounts {
        /// Items pushed.
        items: "items",
        /// Bytes pushed.
        bytes: "bytes",
        /// Cycles in which the channel was full at the start, so that nothing could be pushed.
        full_cycles: "cycles",
        /// Items in the channel, summed over cycles; an item pushed in t and popped in u counts u - t.
        occupancy: "item cycles",
    }
}

/// A place of the ring: when its item can be popped, and the item.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Slot {
    pub ready: Cycle,
    pub data: [u64; 2],
}

/// The state of a channel. Its ring lies in the slab of [`Wires`](super::Wires).
#[derive(Clone, Debug)]
pub(super) struct Channel {
    /// Items popped since the start.
    pub head: u64,
    /// Items pushed since the start.
    pub tail: u64,
    /// The cycle of the last pop, and the number of pops in it: those slots cannot be filled before the next cycle.
    freed_at: Cycle,
    freed: u32,
    /// What the link carried in `link_cycle`, the last cycle in which it carried anything (possibly still to come).
    link_used: u32,
    link_cycle: Cycle,
    base: u32,
    mask: u32,
    pub capacity: u32,
    latency: u32,
    width: u32,
    pub producer: UnitId,
    pub consumer: UnitId,
    /// The consumer found the channel empty.
    pub starving: bool,
    /// The producer found the channel full.
    pub blocking: bool,
    by_bytes: bool,
    /// Bytes of an item pushed without a size.
    pub item_bytes: u32,
    full_since: Cycle,
    full_cycles: u64,
    /// Sum of pop cycles less sum of push cycles, wrapping: with the items still inside it is the integral of occupancy.
    residence: u64,
    bytes: u64,
}

impl Channel {
    pub fn new(link: Link, base: u32, item_bytes: u32, producer: UnitId, consumer: UnitId) -> Channel {
        Channel {
            head: 0,
            tail: 0,
            freed_at: 0,
            freed: 0,
            link_used: 0,
            link_cycle: 0,
            base,
            mask: link.capacity.next_power_of_two() - 1,
            capacity: link.capacity,
            latency: link.latency,
            width: link.width,
            producer,
            consumer,
            starving: false,
            blocking: false,
            by_bytes: link.by_bytes,
            item_bytes,
            full_since: 0,
            full_cycles: 0,
            residence: 0,
            bytes: 0,
        }
    }

    /// Places that the ring takes in the slab.
    pub fn places(capacity: u32) -> u32 {
        capacity.next_power_of_two()
    }

    #[inline(always)]
    pub fn len(&self) -> u64 {
        self.tail - self.head
    }

    /// The index in the slab of the item with that running number.
    #[inline(always)]
    pub fn place(&self, number: u64) -> usize {
        (self.base + (number as u32 & self.mask)) as usize
    }

    /// Slots that the producer may fill in cycle `now`; those freed in `now` are not among them.
    #[inline(always)]
    pub fn room(&self, now: Cycle) -> u32 {
        let freed = if self.freed_at == now { self.freed } else { 0 };
        self.capacity - self.len() as u32 - freed
    }

    /// Whether a slot was freed in `now`, so that there will be room in the next cycle.
    #[inline(always)]
    pub fn frees(&self, now: Cycle) -> bool {
        self.freed_at == now && self.freed > 0
    }

    /// The first cycle from `now` on in which the link can carry something.
    #[inline(always)]
    pub fn link_free(&self, now: Cycle) -> Cycle {
        if self.link_cycle < now { now } else { self.link_cycle + Cycle::from(self.link_used >= self.width) }
    }

    /// Books an item of `bytes` on the link, which is free, and in the ring, which has room. Returns the place and the cycle from
    /// which the item can be popped.
    #[inline(always)]
    pub fn push(&mut self, now: Cycle, bytes: u32) -> (usize, Cycle) {
        if self.link_cycle < now {
            self.link_cycle = now;
            self.link_used = 0;
        }
        if self.by_bytes {
            self.link_used += bytes;
            while self.link_used > self.width {
                self.link_used -= self.width;
                self.link_cycle += 1;
            }
        } else {
            self.link_used += 1;
        }
        self.bytes += u64::from(bytes);
        self.residence = self.residence.wrapping_sub(now);
        let place = self.place(self.tail);
        self.tail += 1;
        if self.len() == u64::from(self.capacity) {
            self.full_since = now;
        }
        (place, self.link_cycle + Cycle::from(self.latency))
    }

    /// Takes out the item at the head, which is there.
    #[inline(always)]
    pub fn pop(&mut self, now: Cycle) {
        if self.freed_at != now {
            self.freed_at = now;
            self.freed = 0;
        }
        self.freed += 1;
        if self.len() == u64::from(self.capacity) {
            self.full_cycles += now - self.full_since;
        }
        self.head += 1;
        self.residence = self.residence.wrapping_add(now);
    }

    /// The counts over the cycles before `now`.
    pub fn counts(&self, now: Cycle) -> ChannelCounts {
        let full = if self.len() == u64::from(self.capacity) { now.saturating_sub(self.full_since + 1) } else { 0 };
        ChannelCounts {
            items: self.tail,
            bytes: self.bytes,
            full_cycles: self.full_cycles + full,
            occupancy: self.residence.wrapping_add(self.len().wrapping_mul(now)),
        }
    }
}
