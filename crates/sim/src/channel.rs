//! One bounded queue: its shape, its state, its arithmetic.

use super::wires::UnitId;
use num::{Cycle, NEVER};

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
    /// A channel of `capacity` items that takes `width` items per cycle and hands them over after `latency` cycles.
    pub const fn items(capacity: u32, width: u32, latency: u32) -> Link {
        Link { capacity, latency, width, by_bytes: false }
    }

    /// A channel of `capacity` items that takes `width` bytes per cycle and hands an item over `latency` cycles after its last byte.
    pub const fn bytes(capacity: u32, width: u32, latency: u32) -> Link {
        Link { capacity, latency, width, by_bytes: true }
    }
}

stats::counters! {
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

/// The state of a channel. The ring lies in the slab of [`Wires`](super::Wires).
///
/// The two questions that units ask most are answered by one comparison each: an item can be popped from `poppable` on and
/// pushed from `pushable` on. Each push and each pop updates both; [`NEVER`] means that only the other end can
/// change it.
///
/// Whether the width counts items or bytes is one rule: an item takes `cost` of what the link carries in a cycle. Pushes and pops
/// choose by arithmetic and not by branches, which no host could foresee for a hundred channels.
#[derive(Clone, Debug)]
#[repr(C, align(64))]
pub(super) struct Channel {
    /// The cycle from which the item at the head can be popped; [`NEVER`] when the channel is empty.
    pub poppable: Cycle,
    /// The cycle from which the next item can be pushed; [`NEVER`] when the channel is full.
    pub pushable: Cycle,
    /// The cycles of all pops less those of all pushes; wrapping. An item that came in t and left in u has added u - t.
    stayed: u64,
    /// The place in the slab of the item at the head.
    head: u32,
    /// The place in the slab of the next item to come.
    tail: u32,
    /// Items inside.
    len: u32,
    pub capacity: u32,
    /// Places of the ring less one; the ring starts at a multiple of its places.
    mask: u32,
    /// What the link carries in `link_cycle`.
    link_used: u32,
    /// The last cycle in which the link carries anything, possibly still to come.
    link_cycle: Cycle,

    /// What the link carries in a cycle: items or bytes.
    link_width: u32,
    latency: u16,
    pub producer: UnitId,
    pub consumer: UnitId,
    /// All ones if the width counts bytes, else none.
    byte_mask: u32,
    /// The producer found room, but not for as many as it wants.
    pub pressed: bool,
    /// Items pushed since the start, and their bytes.
    pushed: u64,
    bytes: u64,
    /// The cycle of the last push.
    last_push: Cycle,
    /// Cycles at whose start the channel was full, up to the last pop from a full channel.
    full_cycles: u64,
}

/// [`NEVER`], which is all ones, or zero.
#[inline(always)]
fn never_if(condition: bool) -> Cycle {
    const { assert!(NEVER == Cycle::MAX) };
    0_u64.wrapping_sub(u64::from(condition))
}

impl Channel {
    pub fn new(link: Link, base: u32, producer: UnitId, consumer: UnitId) -> Channel {
        Channel {
            poppable: NEVER,
            pushable: 0,
            stayed: 0,
            head: base,
            tail: base,
            len: 0,
            capacity: link.capacity,
            mask: Channel::places(link.capacity) - 1,
            link_used: 0,
            link_cycle: 0,
            link_width: link.width,
            latency: u16::try_from(link.latency).unwrap_or(u16::MAX),
            producer,
            consumer,
            byte_mask: if link.by_bytes { u32::MAX } else { 0 },
            pressed: false,
            pushed: 0,
            bytes: 0,
            last_push: 0,
            full_cycles: 0,
        }
    }

    /// The first cycle from `now` on in which the link can carry something.
    #[inline(always)]
    fn link_free(&self, now: Cycle) -> Cycle {
        let free = self.link_cycle + Cycle::from(self.link_used >= self.link_width);
        if self.link_cycle < now { now } else { free }
    }

    /// Places that the ring takes in the slab.
    pub fn places(capacity: u32) -> u32 {
        capacity.next_power_of_two()
    }

    /// Its shape.
    pub fn link(&self) -> Link {
        let by_bytes = self.byte_mask != 0;
        Link { capacity: self.capacity, latency: self.latency.into(), width: self.link_width, by_bytes }
    }

    /// Items inside.
    #[inline(always)]
    pub fn len(&self) -> u32 {
        self.len
    }

    /// Items pushed since the start.
    pub fn pushed(&self) -> u64 {
        self.pushed
    }

    /// The place of the item that was pushed last but `back`.
    pub fn pushed_at(&self, back: u32) -> usize {
        self.step(self.tail, 0_u32.wrapping_sub(back + 1)) as usize
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

    /// Puts an item of `bytes` bytes at the tail, after `pushable` has allowed it.
    #[inline(always)]
    pub fn push(&mut self, now: Cycle, bytes: u32, data: [u64; 2], slots: &mut [Slot]) {
        self.pushed += 1;
        self.bytes += u64::from(bytes);
        self.stayed = self.stayed.wrapping_sub(now);
        let (mut cycle, mut used) = (self.link_cycle, self.link_used);
        if cycle < now {
            (cycle, used) = (now, 0);
        }
        used += bytes & self.byte_mask | !self.byte_mask & 1;
        while used > self.link_width {
            used -= self.link_width;
            cycle += 1;
        }
        (self.link_cycle, self.link_used) = (cycle, used);
        let ready = cycle + Cycle::from(self.latency);
        let slot = &mut slots[self.tail as usize];
        slot.ready = ready;
        slot.data = data;
        self.tail = self.step(self.tail, 1);
        // Of an empty channel it is NEVER, and no item is ready before those ahead of it.
        self.poppable = self.poppable.min(ready);
        self.len += 1;
        self.last_push = now;
        // The next item takes the place of the one that came `capacity` before it.
        let place = slots[self.step(self.tail, 0_u32.wrapping_sub(self.capacity)) as usize].free;
        let link = cycle + Cycle::from(used >= self.link_width);
        self.pushable = link.max(place) | never_if(self.len == self.capacity);
    }

    /// Takes out the item at the head, which `poppable` allows; returns whether the channel was full.
    #[inline(always)]
    pub fn pop(&mut self, now: Cycle, slots: &mut [Slot]) -> bool {
        self.stayed = self.stayed.wrapping_add(now);
        slots[self.head as usize].free = now + 1;
        self.head = self.step(self.head, 1);
        let ready = slots[self.head as usize].ready;
        self.len -= 1;
        self.poppable = ready | never_if(self.len == 0);
        let was_full = self.pushable == NEVER;
        if was_full {
            self.pushable = self.link_free(now + 1);
            // The last push is the one that filled it.
            self.full_cycles += now - self.last_push;
        }
        was_full
    }

    /// The counts over the cycles before `now`.
    pub fn counts(&self, now: Cycle) -> ChannelCounts {
        let full = if self.pushable == NEVER { now.saturating_sub(self.last_push + 1) } else { 0 };
        // As if those inside left now.
        let occupancy = self.stayed.wrapping_add(u64::from(self.len).wrapping_mul(now));
        ChannelCounts { items: self.pushed, bytes: self.bytes, full_cycles: self.full_cycles + full, occupancy }
    }
}
