//! All channels of a machine, the cycle it is in, and who wakes when.

use std::any::TypeId;
use std::marker::PhantomData;

use super::agenda::Agenda;
use super::channel::{Channel, ChannelCounts, Link, Slot};
use super::stall_probe::{StallProbe, StallProbeCounts, StallProbeState};
use super::unit::Tick;
use num::{Cycle, NEVER};
use stats::{Account, Cycles, Declaration, Group, Heading, Tree, counter};

/// Steps of the host for an item that goes through a channel: it is made, moved and used up.
const ITEM_STEPS: u64 = 8;

/// What a channel carries: at most 16 bytes of plain integers, without padding, so that any channel's ring has the same form.
/// More than that belongs in the machine's context, with an index to it in the token.
pub trait Token: bytemuck::Pod + std::fmt::Debug {}

impl<T: bytemuck::Pod + std::fmt::Debug> Token for T {}

#[inline(always)]
fn pack<T: Token>(item: T) -> [u64; 2] {
    const { assert!(size_of::<T>() <= 16, "a token has at most 16 bytes") };
    let mut data = [0u64; 2];
    bytemuck::bytes_of_mut(&mut data)[..size_of::<T>()].copy_from_slice(bytemuck::bytes_of(&item));
    data
}

#[inline(always)]
pub(super) fn unpack<T: Token>(data: &[u64; 2]) -> T {
    bytemuck::pod_read_unaligned(&bytemuck::bytes_of(data)[..size_of::<T>()])
}

/// The consuming end of a channel. There is one in a machine, and the unit that has it is the consumer. Clones are for clones of the
/// whole machine.
#[derive(Debug)]
pub struct In<T>(pub(super) u32, pub(super) PhantomData<fn() -> T>);

/// The producing end of a channel. There is one in a machine, and the unit that has it is the producer. Clones are for clones of the
/// whole machine.
#[derive(Debug)]
pub struct Out<T>(pub(super) u32, pub(super) PhantomData<fn(T)>);

impl<T> Clone for In<T> {
    fn clone(&self) -> In<T> {
        In(self.0, PhantomData)
    }
}

impl<T> Clone for Out<T> {
    fn clone(&self) -> Out<T> {
        Out(self.0, PhantomData)
    }
}

/// The number of a unit in its machine, in the order of declaration.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct UnitId(pub(super) u16);

/// A name and a number of its kind: `setup[2]`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Label {
    pub name: &'static str,
    pub index: usize,
}

impl std::fmt::Display for Label {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{}[{}]", self.name, self.index)
    }
}

/// The channels of a running machine, and its time.
#[derive(Clone, Debug)]
pub struct Wires {
    pub(super) now: Cycle,
    /// The earliest cycle at which the ticking unit could move, as far as it has asked.
    pub(super) next: Cycle,
    /// What the ticking unit does from the next cycle on if it moves in this one; [`Tick::Moved`] if it has not said.
    pub(super) rest: Tick,
    /// The last cycle before this one in which a unit moved something.
    pub(super) last_move: Cycle,
    /// Whether a unit has moved something in this cycle.
    pub(super) moved: bool,
    /// Whether a unit has found in this cycle that it had worked while it slept.
    pub(super) worked: bool,
    pub(super) agenda: Agenda,
    pub(super) channels: Vec<Channel>,
    pub(super) slots: Vec<Slot>,
    pub(super) units: Vec<Label>,
    pub(super) labels: Vec<Label>,
    pub(super) show: Vec<fn(&[u64; 2]) -> String>,
    /// The types of the items of all channels.
    pub(super) types: Vec<TypeId>,
    pub(super) probes: Vec<StallProbeState>,
}

impl Wires {
    /// The cycle that is being ticked; between ticks, the number of cycles gone by.
    #[inline(always)]
    pub fn now(&self) -> Cycle {
        self.now
    }

    /// The ticking unit could move at `cycle` even if nothing comes to it. A cycle that is not in the future means the next one.
    #[inline(always)]
    pub fn sleep_until(&mut self, cycle: Cycle) {
        self.next = self.next.min(cycle);
    }

    /// The ticking unit moves in this cycle, and knows that ticks after it would move nothing and give the reason `why` until
    /// something that it has asked about changes. It then sleeps from the next cycle on, as after such a tick.
    ///
    /// The unit must have asked after its last move: an item that it pushed or popped since makes what it asked before stale.
    #[inline(always)]
    pub fn rest(&mut self, why: Tick) {
        self.rest = why;
    }

    /// The ticking unit has worked on what is inside it since its last tick, where no other unit sees it: it does not wake in vain.
    #[inline(always)]
    pub fn works(&mut self) {
        self.worked = true;
    }

    /// How a unit of one stage ends its tick where it stands before `why`, which it has just asked about: if it has moved before,
    /// it rests.
    #[inline(always)]
    pub fn stop(&mut self, did: Tick, why: Tick) -> Tick {
        if did == Tick::Moved {
            self.rest = why;
        }
        did.or(why)
    }

    /// The item at the head, if one can be popped in this cycle.
    #[inline(always)]
    pub fn front<T: Token>(&mut self, port: &In<T>) -> Option<T> {
        let channel = &self.channels[port.0 as usize];
        if channel.poppable > self.now {
            self.next = self.next.min(channel.poppable);
            return None;
        }
        Some(unpack(&self.slots[channel.head()].data))
    }

    /// Whether an item can be popped in this cycle.
    #[inline(always)]
    pub fn can_pop<T: Token>(&mut self, port: &In<T>) -> bool {
        self.front(port).is_some()
    }

    /// Takes the item at the head, if one can be popped in this cycle.
    #[inline(always)]
    pub fn pop<T: Token>(&mut self, port: &In<T>) -> Option<T> {
        let item = self.front(port)?;
        self.take(port);
        Some(item)
    }

    /// Takes the item at the head that [`Wires::front`] has shown in this cycle.
    ///
    /// # Panics
    /// If there is none that can be popped: the unit is wrong.
    #[inline(always)]
    pub fn take<T: Token>(&mut self, port: &In<T>) {
        self.drop_head(port.0);
    }

    // Not inlined, as [`Wires::put`].
    #[inline(never)]
    fn drop_head(&mut self, number: u32) {
        let now = self.now;
        let channel = &mut self.channels[number as usize];
        if channel.poppable > now {
            self.misuse(number, "taken from without looking, and nothing can be popped");
        }
        let was_full = channel.pop(now, &mut self.slots);
        if was_full || channel.pressed {
            channel.pressed = false;
            let producer = channel.producer;
            self.wake_at(producer, now + 1);
        }
    }

    /// Whether an item can be pushed in this cycle: there is a slot, and the width is not spent.
    #[inline(always)]
    pub fn can_push<T: Token>(&mut self, port: &Out<T>) -> bool {
        let pushable = self.channels[port.0 as usize].pushable;
        if pushable > self.now {
            self.next = self.next.min(pushable);
        }
        pushable <= self.now
    }

    /// Slots for items in this cycle; the width may still spread them over several.
    pub fn room<T: Token>(&mut self, port: &Out<T>) -> u32 {
        let channel = &self.channels[port.0 as usize];
        let free = (1..=channel.capacity).take_while(|&items| channel.room_at(items, &self.slots) <= self.now).count() as u32;
        if free == 0 {
            // It wakes when there are.
            self.can_push(port);
        }
        free
    }

    /// Whether there is a slot in this cycle, whatever the width says. Who asks is not woken by it.
    #[inline(always)]
    pub fn has_place<T: Token>(&self, port: &Out<T>) -> bool {
        self.channels[port.0 as usize].room_at(1, &self.slots) <= self.now
    }

    /// Whether there are slots for `items` in this cycle; the width may still spread them over several.
    #[inline(always)]
    pub fn has_room<T: Token>(&mut self, port: &Out<T>, items: u32) -> bool {
        let channel = &mut self.channels[port.0 as usize];
        let free = channel.room_at(items, &self.slots);
        if free > self.now {
            self.next = self.next.min(free);
            channel.pressed = true;
        }
        free <= self.now
    }

    /// Pushes an item; the caller has made sure by [`Wires::can_push`] that it can be pushed in this cycle.
    ///
    /// # Panics
    /// If it cannot: the unit is wrong.
    #[inline(always)]
    pub fn push<T: Token>(&mut self, port: &Out<T>, item: T) {
        self.put(port.0, size_of::<T>() as u32, pack(item));
    }

    /// [`Wires::push`] of an item that stands for `bytes` bytes.
    ///
    /// # Panics
    /// As [`Wires::push`].
    #[inline(always)]
    pub fn push_sized<T: Token>(&mut self, port: &Out<T>, item: T, bytes: u32) {
        self.put(port.0, bytes, pack(item));
    }

    // Not inlined: a machine pushes at some hundred places, and its code has to fit the host's instruction cache.
    #[inline(never)]
    fn put(&mut self, number: u32, bytes: u32, data: [u64; 2]) {
        let now = self.now;
        let channel = &mut self.channels[number as usize];
        if channel.pushable > now {
            self.misuse(number, "pushed into without asking, and it takes nothing now");
        }
        let was_empty = channel.len() == 0;
        channel.push(now, bytes, data, &mut self.slots);
        if was_empty {
            let (consumer, ready) = (channel.consumer, channel.poppable);
            self.wake_at(consumer, ready);
        }
    }

    /// Pushes an item if it can be pushed in this cycle, and tells whether it was.
    #[inline(always)]
    pub fn try_push<T: Token>(&mut self, port: &Out<T>, item: T) -> bool {
        let can = self.can_push(port);
        if can {
            self.push(port, item);
        }
        can
    }

    /// Sets the state of a probe from this cycle on. The unit that has the probe does so in every tick.
    #[inline(always)]
    pub fn set_probe(&mut self, probe: &StallProbe, state: u8) {
        if let Some(probe) = self.probes.get_mut(usize::from(probe.0))
            && probe.state != state
        {
            probe.change(state, self.now, &self.agenda);
        }
    }

    /// The counts of all probes, in the order of declaration.
    pub fn stall_probes(&self) -> impl Iterator<Item = StallProbeCounts> {
        self.probes.iter().map(|probe| probe.counts(self.now, &self.agenda))
    }

    #[cold]
    #[inline(never)]
    fn misuse(&self, channel: u32, what: &str) -> ! {
        panic!("cycle {}: {} is {what}", self.now, self.labels[channel as usize]);
    }

    #[inline(always)]
    fn wake_at(&mut self, unit: UnitId, cycle: Cycle) {
        self.agenda.wake(unit.0 as usize, cycle, self.now);
    }

    /// The cycle begins.
    #[inline(always)]
    pub(super) fn begin_cycle(&mut self) {
        self.agenda.begin(self.now);
    }

    /// Of a group of units those that may be due in this cycle. For the code that [`circuit!`](crate::circuit) makes.
    #[doc(hidden)]
    #[inline(always)]
    pub fn candidates(&self, group: usize) -> u64 {
        self.agenda.candidates(group)
    }

    /// Whether the unit wakes in this cycle or before. For the code that [`circuit!`](crate::circuit) makes.
    #[doc(hidden)]
    #[inline(always)]
    pub fn due(&self, unit: usize) -> bool {
        self.agenda.due(unit, self.now)
    }

    /// A unit is about to tick. For the code that [`circuit!`](crate::circuit) makes.
    #[doc(hidden)]
    #[inline(always)]
    pub fn begin_tick(&mut self) {
        self.next = NEVER;
        self.rest = Tick::Moved;
    }

    /// A unit has ticked. For the code that [`circuit!`](crate::circuit) makes.
    #[doc(hidden)]
    #[inline(always)]
    pub fn end_tick(&mut self, unit: usize, tick: Tick) {
        let now = self.now;
        let moved = tick == Tick::Moved;
        self.moved |= moved;
        // What it does from the next cycle on: if it moves without having said more, it ticks again.
        let then = if moved { self.rest } else { tick };
        let wake = if then == Tick::Moved { now + 1 } else { self.next.max(now + 1) };
        let account = self.agenda.set(unit, wake, now);
        account.note(now, tick.why());
        if then != tick {
            account.note(now + 1, then.why());
        }
    }

    /// The next cycle at which any unit could move, [`NEVER`] if none. After a move that is the next cycle: the unit that moved
    /// ticks again, and the loop asks after each move whether the run is done.
    #[inline(always)]
    pub(super) fn next_event(&self) -> Cycle {
        if self.moved { self.now + 1 } else { self.agenda.next(self.now) }
    }

    #[inline(always)]
    pub(super) fn advance(&mut self, to: Cycle) {
        if self.moved {
            self.last_move = self.now;
        }
        (self.moved, self.worked) = (false, false);
        self.now = to;
    }

    #[inline(always)]
    pub(super) fn last_move(&self) -> Cycle {
        self.last_move
    }

    /// Whether a unit has moved or worked in this cycle.
    #[inline(always)]
    pub(super) fn lives(&self) -> bool {
        self.moved | self.worked
    }

    /// How often units can wake one after another without moving, if all are sound. A unit that moves nothing changes nothing, so it
    /// wakes at most once for each cycle that its state holds: of each channel when its head can be popped and when there is room
    /// at its tail, of each unit the ends of what it has begun, and a wake time that is out of date.
    pub(super) fn questions(&self) -> u64 {
        4 * self.channels.len() as u64 + 8 * self.units.len() as u64
    }

    pub(super) fn unit_labels(&self) -> &[Label] {
        &self.units
    }

    pub(super) fn account(&self, unit: usize) -> &Account {
        self.agenda.account(unit)
    }

    /// Wakes every unit in the next cycle that is ticked: the context has changed from outside, as when new work has come.
    pub fn wake_all(&mut self) {
        self.agenda.wake_all(self.now);
    }

    /// Items in all channels.
    pub fn resident(&self) -> u64 {
        self.channels.iter().map(|channel| u64::from(channel.len())).sum()
    }

    /// The name of each unit and its number among those of that name, in the order of declaration, which is that of the data flow.
    pub fn units(&self) -> impl Iterator<Item = (&'static str, usize)> {
        self.units.iter().map(|label| (label.name, label.index))
    }

    /// Each channel, in the order of declaration.
    pub fn wires(&self) -> impl Iterator<Item = Wire> {
        self.labels.iter().zip(&self.channels).map(|(label, channel)| Wire {
            name: label.name,
            index: label.index,
            link: channel.link(),
            from: usize::from(channel.producer.0),
            to: usize::from(channel.consumer.0),
        })
    }

    /// Items in each channel, in the order of declaration.
    pub fn fills(&self) -> impl Iterator<Item = u32> {
        self.channels.iter().map(Channel::len)
    }

    /// Whether a channel, by its place in the order of declaration, carries items of this type.
    pub fn carries<T: Token>(&self, channel: usize) -> bool {
        self.types[channel] == TypeId::of::<T>()
    }

    /// Items that have been pushed into a channel since the start, and items inside of it.
    pub fn carried(&self, channel: usize) -> (u64, u32) {
        let channel = &self.channels[channel];
        (channel.pushed(), channel.len())
    }

    /// The item inside of a channel that was pushed last but `back`. None if there are not that many, or they are of another type.
    pub fn newest<T: Token>(&self, channel: usize, back: u32) -> Option<T> {
        let of = &self.channels[channel];
        let inside = self.carries::<T>(channel) && back < of.len();
        inside.then(|| unpack(&self.slots[of.pushed_at(back)].data))
    }

    /// A line for each channel that holds something: fill, when its head can be popped, and the head.
    pub(super) fn contents(&self) -> Vec<String> {
        let mut lines = Vec::new();
        for (number, channel) in self.channels.iter().enumerate().filter(|(_, channel)| channel.len() > 0) {
            let slot = &self.slots[channel.head()];
            lines.push(format!(
                "{} ({} to {}): {} of {}, head {} from cycle {}",
                self.labels[number],
                self.units[channel.producer.0 as usize],
                self.units[channel.consumer.0 as usize],
                channel.len(),
                channel.capacity,
                self.show[number](&slot.data),
                slot.ready,
            ));
        }
        lines
    }

    /// What the host has done for the cycles before `at`, in steps of about 40 ns: cycles in which units were busy, and [`ITEM_STEPS`] for each item that
    /// has gone into a channel. Nothing may have moved since `at`, so that both clocks count the same.
    pub fn steps_at(&self, at: Cycle) -> u64 {
        let busy: u64 = self.agenda.accounts().map(|account| account.read(at).busy).sum();
        let items: u64 = self.channels.iter().map(|channel| channel.counts(at).items).sum();
        busy.saturating_add(ITEM_STEPS.saturating_mul(items))
    }

    /// Closes the accounts of all units: who is starved now was idle since. Called at the end of a frame, before reading.
    pub fn settle(&mut self) {
        for account in self.agenda.accounts_mut() {
            account.settle(self.now);
        }
    }

    /// [`Circuit::reading_at`](crate::Circuit::reading_at) as the results of ticks give it. For the code that [`circuit!`](crate::circuit) makes.
    #[doc(hidden)]
    pub fn reading_at(&self, cycle: Cycle) -> Reading {
        Reading {
            cycle,
            channels: self.channels.iter().map(|channel| channel.counts(cycle)).collect(),
            units: self.agenda.accounts().map(|account| account.read(cycle)).collect(),
            held: Vec::with_capacity(self.units.len()),
        }
    }

    /// The account of every unit over the cycles gone by, in the order of declaration, as the results of ticks give it.
    pub fn accounts(&self) -> impl Iterator<Item = Cycles> {
        self.agenda.accounts().map(|account| account.read(self.now))
    }

    /// The leaves of the statistics under [`UNITS`] and [`CHANNELS`]; `items` gives each unit's own count, in the order of declaration.
    pub fn tree(&self, reading: &Reading, items: &[u64]) -> Tree {
        let mut tree = Tree::new();
        let (units, ..) = UNITS.above(&mut tree);
        for ((account, label), items) in reading.units.iter().zip(&self.units).zip(items) {
            let leaves = units.element(label.name, label.index);
            leaves.reserve(1 + Cycles::DECLARATIONS.len());
            leaves.extend(UnitCounts { items: *items }.tree());
            leaves.extend(account.tree());
        }
        let (channels, ..) = CHANNELS.above(&mut tree);
        for ((counts, channel), label) in reading.channels.iter().zip(self.channels.iter()).zip(&self.labels) {
            let leaves = channels.element(label.name, label.index);
            leaves.reserve(5);
            counter!(ChannelCounts, items).put(leaves, counts.items);
            counter!(ChannelCounts, bytes).put(leaves, counts.bytes);
            counter!(ChannelCounts, full_cycles).put(leaves, counts.full_cycles);
            leaves.ratio(MEAN_OCCUPANCY.name, counts.occupancy, reading.cycle);
            leaves.level(CAPACITY.name, u64::from(channel.capacity));
        }
        tree
    }
}

/// Where units count.
pub const UNITS: Heading = Heading::new("units.NAME[i]", "One entry per unit. The six kinds of cycles add up to `cycles`.");

/// The mean number of items in a channel.
pub const MEAN_OCCUPANCY: Declaration = Declaration::new(
    "mean_occupancy",
    "items",
    "Time integral of the items inside, by the cycles: by Little's law the items per cycle times their stay.",
);

/// The size of a channel.
pub const CAPACITY: Declaration = Declaration::new("capacity", "items", "Room.");

/// Where channels count.
pub const CHANNELS: Heading = Heading::new("channels.NAME[i]", "The bounded FIFOs between units, by what they carry.");

stats::counters! {
    /// What every unit counts, in addition to the account of its cycles.
    pub struct UnitCounts {
        /// What went through: vertices, primitives, triangles, quads, warps, requests or bursts.
        items: "items",
    }
}

/// A channel as it is wired: its name and number, its shape, and the units at its ends, by their place in the order of declaration.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Wire {
    /// What the channels of its kind are called.
    pub name: &'static str,
    /// Which of them it is.
    pub index: usize,
    /// Its shape.
    pub link: Link,
    /// The unit that pushes.
    pub from: usize,
    /// The unit that pops.
    pub to: usize,
}

/// All that the wires count, up to a cycle or between two.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Reading {
    /// Cycles gone by.
    pub cycle: Cycle,
    /// By channel, in the order of declaration.
    pub channels: Vec<ChannelCounts>,
    /// By unit, in the order of declaration.
    pub units: Vec<Cycles>,
    /// By unit, the items that it held, summed over the cycles; 0 for units that do not count this.
    pub held: Vec<u64>,
}

impl Reading {
    /// What was counted since an earlier reading of the same wires.
    pub fn since(&self, earlier: &Reading) -> Reading {
        Reading {
            cycle: self.cycle - earlier.cycle,
            channels: self.channels.iter().zip(&earlier.channels).map(|(now, then)| now.since(then)).collect(),
            units: self.units.iter().zip(&earlier.units).map(|(now, then)| now.since(then)).collect(),
            held: self.held.iter().zip(&earlier.held).map(|(now, then)| now - then).collect(),
        }
    }

    /// Adds what equal wires have counted.
    pub fn add(&mut self, later: &Reading) {
        self.cycle += later.cycle;
        self.channels.iter_mut().zip(&later.channels).for_each(|(sum, own)| *sum += *own);
        self.units.iter_mut().zip(&later.units).for_each(|(sum, own)| *sum += *own);
        self.held.iter_mut().zip(&later.held).for_each(|(sum, own)| *sum += *own);
    }
}
