//! One bounded queue: its shape, its state, its arithmetic.

use super::wires::UnitId;
use crate::num::{Cycle, NEVER};

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

/// A place of a ring.
#[derive(Clone, Copy, Debug, Default)]
#[repr(C, align(32))]
pub(super) struct Slot {
    /// The cycle from which its item can be popped.
    pub ready: Cycle,
    /// The cycle from which it can be filled again once its item is popped.
    pub free: Cycle,
    /// The item.
    pub data: [u64; 2],
}

/// The state of a channel: a cache line that every push and pop touches, and one that only some do. The ring lies in the slab of
/// [`Wires`](super::Wires).
///
/// The two questions that units ask most are answered by one comparison each: an item can be popped from `poppable` on and
/// pushed from `pushable` on. Both are kept up to date by whoever pushes or pops; [`NEVER`] means that it takes the other end.
#[derive(Clone, Debug)]
#[repr(C, align(64))]
pub(super) struct Channel {
    /// The cycle from which the item at the head can be popped; [`NEVER`] when the channel is empty.
    pub poppable: Cycle,
    /// The cycle from which the next item can be pushed; [`NEVER`] when the channel is full.
    pub pushable: Cycle,
    /// Items pushed since the start.
    pushed: u64,
    /// Cycles that items spent beyond the latency, summed; wrapping.
    waited: u64,
    /// The place in the slab of the item at the head.
    head: u32,
    /// The place in the slab of the next item to come.
    tail: u32,
    /// Items inside.
    len: u32,
    pub capacity: u32,
    /// Places of the ring less one; the ring starts at a multiple of its places.
    mask: u32,
    latency: u16,
    /// Items a cycle, at most the capacity; for a channel that counts bytes, the capacity.
    width: u16,
    pub producer: UnitId,
    pub consumer: UnitId,
    /// The producer found room, but not for as many as it wants.
    pub pressed: bool,
    /// The width counts bytes.
    by_bytes: bool,

    /// Bytes of an item pushed without a size.
    item_bytes: u32,
    /// Bytes a cycle.
    link_width: u32,
    /// What the link carries in `link_cycle`, the last one in which it carries anything, possibly still to come.
    link_used: u32,
    link_cycle: Cycle,
    /// Bytes pushed less `item_bytes` an item, wrapping.
    extra_bytes: u64,
    /// The cycle of the push that filled the channel last.
    full_since: Cycle,
    /// Cycles at whose start the channel was full, up to the last pop from a full channel.
    full_cycles: u64,
}

impl Channel {
    pub fn new(link: Link, item_bytes: u32, base: u32, producer: UnitId, consumer: UnitId) -> Channel {
        let narrow = |value: u32| u16::try_from(value).unwrap_or(u16::MAX);
        Channel {
            poppable: NEVER,
            pushable: 0,
            pushed: 0,
            waited: 0,
            head: base,
            tail: base,
            len: 0,
            capacity: link.capacity,
            mask: Channel::places(link.capacity) - 1,
            latency: narrow(link.latency),
            width: narrow(if link.by_bytes { link.capacity } else { link.width.min(link.capacity) }),
            producer,
            consumer,
            pressed: false,
            by_bytes: link.by_bytes,
            item_bytes,
            link_width: link.width,
            link_used: 0,
            link_cycle: 0,
            extra_bytes: 0,
            full_since: 0,
            full_cycles: 0,
        }
    }

    /// The first cycle from `now` on in which the link can carry something.
    #[inline(always)]
    fn link_free(&self, now: Cycle) -> Cycle {
        if self.link_cycle < now { now } else { self.link_cycle + Cycle::from(self.link_used >= self.link_width) }
    }

    /// Books `bytes` on the link, which is free, and returns the cycle of the last of them.
    #[inline(always)]
    fn carry(&mut self, now: Cycle, bytes: u32) -> Cycle {
        if self.link_cycle < now {
            self.link_cycle = now;
            self.link_used = 0;
        }
        self.link_used += bytes;
        while self.link_used > self.link_width {
            self.link_used -= self.link_width;
            self.link_cycle += 1;
        }
        self.link_cycle
    }

    /// Places that the ring takes in the slab.
    pub fn places(capacity: u32) -> u32 {
        capacity.next_power_of_two()
    }

    /// Its shape, as far as it is kept: items wider than the capacity are not told from those as wide.
    #[cfg(test)]
    pub fn link(&self) -> Link {
        let width = if self.by_bytes { self.link_width } else { u32::from(self.width) };
        Link { capacity: self.capacity, latency: self.latency.into(), width, by_bytes: self.by_bytes }
    }

    /// Items inside.
    #[inline(always)]
    pub fn len(&self) -> u32 {
        self.len
    }

    /// The place of the item at the head.
    #[inline(always)]
    pub fn head(&self) -> usize {
        self.head as usize
    }

    /// The place `steps` after (or before, as a two's complement) another in the ring.
    #[inline(always)]
    fn step(&self, place: u32, steps: u32) -> u32 {
        (place & !self.mask) | (place.wrapping_add(steps) & self.mask)
    }

    /// The cycle from which there are places for `items` more, as far as that is known: [`NEVER`] if not even with those freed in
    /// this cycle.
    #[inline(always)]
    pub fn room_at(&self, items: u32, slots: &[Slot]) -> Cycle {
        if self.len + items > self.capacity {
            return NEVER;
        }
        // The last of them takes the place of the item that came `capacity` before it, once that has left in an earlier cycle.
        slots[self.step(self.tail, (items - 1).wrapping_sub(self.capacity)) as usize].free
    }

    /// Puts an item at the tail, which `pushable` allows; `bytes` is its size if it is not that of all items.
    #[inline(always)]
    pub fn push(&mut self, now: Cycle, bytes: Option<u32>, data: [u64; 2], slots: &mut [Slot]) {
        let mut entered = now;
        if let Some(bytes) = bytes {
            self.extra_bytes = self.extra_bytes.wrapping_add(u64::from(bytes)).wrapping_sub(u64::from(self.item_bytes));
        }
        if self.by_bytes {
            entered = self.carry(now, bytes.unwrap_or(self.item_bytes));
            self.waited = self.waited.wrapping_add(entered - now);
        }
        let ready = entered + Cycle::from(self.latency);
        let slot = &mut slots[self.tail as usize];
        slot.ready = ready;
        slot.data = data;
        self.tail = self.step(self.tail, 1);
        self.pushed += 1;
        if self.len == 0 {
            self.poppable = ready;
        }
        self.len += 1;
        self.pushable = if self.len == self.capacity {
            self.full_since = now;
            NEVER
        } else if self.width == 1 {
            // Whatever place is next, it is free by then.
            now + 1
        } else if self.by_bytes {
            self.link_free(now).max(self.room_at(1, slots))
        } else if slots[self.step(self.tail, 0u32.wrapping_sub(u32::from(self.width))) as usize].ready == ready {
            // The item before by the width came in this cycle: the width is spent.
            now + 1
        } else {
            self.room_at(1, slots)
        };
    }

    /// Takes out the item at the head, which `poppable` allows; returns whether the channel was full.
    #[inline(always)]
    pub fn pop(&mut self, now: Cycle, slots: &mut [Slot]) -> bool {
        self.waited = self.waited.wrapping_add(now - self.poppable);
        slots[self.head as usize].free = now + 1;
        self.head = self.step(self.head, 1);
        self.len -= 1;
        self.poppable = if self.len == 0 { NEVER } else { slots[self.head as usize].ready };
        let was_full = self.pushable == NEVER;
        if was_full {
            self.pushable = if self.by_bytes { self.link_free(now + 1) } else { now + 1 };
            self.full_cycles += now - self.full_since;
        }
        was_full
    }

    /// The counts over the cycles before `now`, with the whole slab to find the items inside.
    pub fn counts(&self, slots: &[Slot], now: Cycle) -> ChannelCounts {
        let full = if self.pushable == NEVER { now.saturating_sub(self.full_since + 1) } else { 0 };
        let mut occupancy = self.waited.wrapping_add((self.pushed - u64::from(self.len)) * u64::from(self.latency));
        for number in 0..self.len {
            let entered = slots[self.step(self.head, number) as usize].ready - u64::from(self.latency);
            occupancy = occupancy.wrapping_add(now.wrapping_sub(entered));
        }
        ChannelCounts {
            items: self.pushed,
            bytes: (self.pushed * u64::from(self.item_bytes)).wrapping_add(self.extra_bytes),
            full_cycles: self.full_cycles + full,
            occupancy,
        }
    }
}
