//! The ends of a network: what the sending and the receiving unit hold.

use super::credit::Credit;
use super::stall::Stall;
use super::{ALL, MAX_ENDS, Parcel, next_from};
use num::Cycle;
use sim::{In, Out, Token, Wires};

/// No place in the store.
const NIL: u32 = u32::MAX;

stats::counters! {
    /// What a sender waits for.
    pub struct SenderCounts {
        /// Cycles in which it had something to send that the network did not take.
        network: "cycles",
        /// Cycles in which it had something to send, and the receiver no place for it.
        receiver: "cycles",
    }
}

/// A sending unit's end. The unit calls [`Sender::poll`] first in every tick.
#[derive(Clone, Debug)]
pub struct Sender<T> {
    to: ToNetwork<T>,
    /// Since when something waits, and whether for the network: if for both, for the network.
    waits: Option<(Cycle, bool)>,
    counts: SenderCounts,
}

#[derive(Clone, Debug)]
enum ToNetwork<T> {
    /// A channel to each receiver.
    Direct(Vec<Out<T>>),
    Routed(Box<Routed>),
}

/// A sender's way into routers.
#[derive(Clone, Debug)]
struct Routed {
    inject: Out<Parcel>,
    credits: In<Credit>,
    number: u8,
    /// Whether one transfer reaches all receivers.
    shared: bool,
    receivers: u8,
    /// Receivers without a place left.
    full: u64,
    /// By receiver, the places left.
    left: [u16; MAX_ENDS],
}

impl Routed {
    #[inline(always)]
    fn spend(&mut self, to: usize) {
        self.left[to] -= 1;
        self.full |= u64::from(self.left[to] == 0) << to;
    }
}

impl<T: Token> Sender<T> {
    /// A sender with a channel to each receiver.
    pub fn direct(outputs: Vec<Out<T>>) -> Sender<T> {
        Sender::new(ToNetwork::Direct(outputs))
    }

    fn new(to: ToNetwork<T>) -> Sender<T> {
        Sender { to, waits: None, counts: SenderCounts::default() }
    }

    pub(super) fn routed(
        number: u8,
        receivers: u8,
        places: u16,
        shared: bool,
        inject: Out<Parcel>,
        credits: In<Credit>,
    ) -> Sender<T> {
        let left = [places; MAX_ENDS];
        Sender::new(ToNetwork::Routed(Box::new(Routed { inject, credits, number, shared, receivers, full: 0, left })))
    }

    /// Why it stalls since its last [`Sender::poll`].
    #[inline(always)]
    pub fn stall(&self) -> Stall {
        match self.waits {
            None => Stall::None,
            Some((_, true)) => Stall::NetworkFull,
            Some((_, false)) => Stall::ReceiverFull,
        }
    }

    /// The counters of the unit's waits.
    pub fn counts(&self) -> SenderCounts {
        self.counts
    }

    /// Receivers.
    #[inline(always)]
    pub fn receivers(&self) -> usize {
        match &self.to {
            ToNetwork::Direct(outputs) => outputs.len(),
            ToNetwork::Routed(routed) => usize::from(routed.receivers),
        }
    }

    /// Whether one transfer reaches all receivers. If so, [`Sender::send_all`] costs one transfer, and when a token goes to several
    /// but not all, copies after the first may be sent with a weight of 0.
    pub fn is_shared(&self) -> bool {
        matches!(&self.to, ToNetwork::Routed(routed) if routed.shared)
    }

    /// Takes in credits; whether there were any, and thus the unit has moved.
    #[inline(always)]
    pub fn poll(&mut self, wires: &mut Wires) -> bool {
        if let Some((since, network)) = self.waits.take() {
            let cycles = wires.now() - since;
            *if network { &mut self.counts.network } else { &mut self.counts.receiver } += cycles;
        }
        let ToNetwork::Routed(routed) = &mut self.to else { return false };
        let mut moved = false;
        while let Some(credit) = wires.pop(&routed.credits) {
            debug_assert_eq!(credit.sender, routed.number);
            routed.left[usize::from(credit.receiver)] += credit.count;
            routed.full &= !(1 << credit.receiver);
            moved = true;
        }
        moved
    }

    /// Whether a token can be sent to a receiver in this cycle.
    #[inline(always)]
    pub fn can_send(&mut self, wires: &mut Wires, to: usize) -> bool {
        let can = match &self.to {
            ToNetwork::Direct(outputs) => wires.can_push(&outputs[to]),
            ToNetwork::Routed(routed) => routed.full >> to & 1 == 0 && wires.can_push(&routed.inject),
        };
        if !can {
            self.wait(wires, 1 << to);
        }
        can
    }

    /// From now on, until the next tick, something waits for the network, or for a place at one of some receivers.
    #[inline(never)]
    fn wait(&mut self, wires: &Wires, receivers: u64) {
        let network = match &self.to {
            ToNetwork::Direct(outputs) => wires.has_place(&outputs[receivers.trailing_zeros() as usize]),
            ToNetwork::Routed(routed) => routed.full & receivers == 0,
        };
        self.waits = Some((wires.now(), network || self.waits.is_some_and(|(_, network)| network)));
    }

    /// Sends a token to a receiver, as [`Sender::can_send`] has allowed in this cycle. On links the token takes `bytes` bytes.
    ///
    /// # Panics
    /// If it cannot be sent: the unit is wrong.
    #[inline(always)]
    pub fn send(&mut self, wires: &mut Wires, to: usize, token: T, bytes: u32) {
        match &mut self.to {
            ToNetwork::Direct(outputs) => wires.push_sized(&outputs[to], token, bytes),
            ToNetwork::Routed(routed) => {
                assert!(routed.full >> to & 1 == 0, "receiver {to} has no place left for sender {}", routed.number);
                routed.spend(to);
                wires.push_sized(&routed.inject, Parcel::new(token, routed.number, to as u8, bytes), bytes);
            }
        }
    }

    /// Whether [`Sender::send_all`] can be called in this cycle. Never if no single transfer reaches all receivers.
    #[inline(always)]
    pub fn can_send_all(&mut self, wires: &mut Wires) -> bool {
        let ToNetwork::Routed(routed) = &self.to else { return false };
        let can = routed.shared && routed.full == 0 && wires.can_push(&routed.inject);
        if !can {
            self.wait(wires, u64::MAX);
        }
        can
    }

    /// Sends a token to all receivers in one transfer, as [`Sender::can_send_all`] has allowed in this cycle.
    ///
    /// # Panics
    /// If it cannot be sent: the unit is wrong.
    #[inline(always)]
    pub fn send_all(&mut self, wires: &mut Wires, token: T, bytes: u32) {
        match &mut self.to {
            ToNetwork::Routed(routed) if routed.shared => {
                assert!(routed.full == 0, "not all receivers have a place left for sender {}", routed.number);
                for to in 0..usize::from(routed.receivers) {
                    routed.spend(to);
                }
                wires.push_sized(&routed.inject, Parcel::new(token, routed.number, ALL, bytes), bytes);
            }
            _ => panic!("one transfer does not reach all receivers of this network"),
        }
    }
}

/// A receiving unit's end. The unit calls [`Receiver::poll`] first in every tick.
#[derive(Clone, Debug)]
pub struct Receiver<T>(FromNetwork<T>);

#[derive(Clone, Debug)]
enum FromNetwork<T> {
    /// A channel from each sender.
    Direct(Vec<In<T>>),
    Routed(Box<Arrived<T>>),
}

/// A token that has arrived.
#[derive(Clone, Copy, Debug)]
struct ArrivedToken<T> {
    token: T,
    /// The next one from the same sender, or the next free place.
    next: u32,
}

/// The tokens that have arrived, by sender.
#[derive(Clone, Debug)]
struct Arrived<T> {
    eject: In<Parcel>,
    credits: Out<Credit>,
    number: u8,
    senders: u8,
    /// The number of credits that are given back at a time.
    bundle: u16,
    entries: Vec<ArrivedToken<T>>,
    free: u32,
    /// Senders that something is here from.
    here: u64,
    held: u32,
    /// By sender, the first and the last entry.
    queues: [(u32, u32); MAX_ENDS],
    /// By sender, places given free and not yet given back.
    owed: [u16; MAX_ENDS],
    /// Senders whose bundle is complete.
    due: u64,
    turn: u8,
}

impl<T: Token> Arrived<T> {
    #[inline(always)]
    fn insert(&mut self, parcel: Parcel) {
        let from = usize::from(parcel.from);
        let entry = ArrivedToken { token: parcel.token(), next: NIL };
        let place = self.free;
        let place = if place == NIL {
            // Grows until as many are here as ever will be.
            self.entries.push(entry);
            (self.entries.len() - 1) as u32
        } else {
            self.free = self.entries[place as usize].next;
            self.entries[place as usize] = entry;
            place
        };
        let queue = &mut self.queues[from];
        if self.here >> from & 1 == 0 {
            queue.0 = place;
            self.here |= 1 << from;
        } else {
            self.entries[queue.1 as usize].next = place;
        }
        queue.1 = place;
        self.held += 1;
    }

    #[inline(always)]
    fn remove(&mut self, from: usize) {
        assert!(self.here >> from & 1 == 1, "nothing is here from sender {from}");
        let place = self.queues[from].0;
        let next = self.entries[place as usize].next;
        self.queues[from].0 = next;
        self.here &= !(u64::from(next == NIL) << from);
        self.entries[place as usize].next = self.free;
        self.free = place;
        self.held -= 1;
    }

    /// Gives back complete bundles as far as their channel takes them.
    #[inline(always)]
    fn give_back(&mut self, wires: &mut Wires) {
        while self.due != 0 && wires.can_push(&self.credits) {
            let sender = next_from(self.due, self.turn);
            self.turn = (sender as u8 + 1) % 64;
            self.due &= !(1 << sender);
            let count = std::mem::take(&mut self.owed[sender]);
            wires.push(&self.credits, Credit { sender: sender as u8, receiver: self.number, count });
        }
    }
}

impl<T: Token> Receiver<T> {
    /// A receiver with a channel from each sender.
    pub fn direct(inputs: Vec<In<T>>) -> Receiver<T> {
        Receiver(FromNetwork::Direct(inputs))
    }

    pub(super) fn routed(number: u8, senders: u8, places: u16, eject: In<Parcel>, credits: Out<Credit>) -> Receiver<T> {
        Receiver(FromNetwork::Routed(Box::new(Arrived {
            eject,
            credits,
            number,
            senders,
            // A sender may always use three quarters of its places, and has one at least.
            bundle: (places / 4).max(1),
            entries: Vec::new(),
            free: NIL,
            here: 0,
            held: 0,
            queues: [(NIL, NIL); MAX_ENDS],
            owed: [0; MAX_ENDS],
            due: 0,
            turn: 0,
        })))
    }

    /// Senders.
    #[inline(always)]
    pub fn senders(&self) -> usize {
        match &self.0 {
            FromNetwork::Direct(inputs) => inputs.len(),
            FromNetwork::Routed(arrived) => usize::from(arrived.senders),
        }
    }

    /// Takes in what has arrived. For the unit's account this is no move; see the network's page.
    #[inline(always)]
    pub fn poll(&mut self, wires: &mut Wires) {
        let FromNetwork::Routed(arrived) = &mut self.0 else { return };
        while let Some(parcel) = wires.pop(&arrived.eject) {
            arrived.insert(parcel);
        }
        arrived.give_back(wires);
    }

    /// The first token from a sender, if it is here.
    #[inline(always)]
    pub fn front(&self, wires: &mut Wires, from: usize) -> Option<T> {
        match &self.0 {
            FromNetwork::Direct(inputs) => wires.front(&inputs[from]),
            FromNetwork::Routed(arrived) => {
                let here = arrived.here >> from & 1 == 1;
                here.then(|| arrived.entries[arrived.queues[from].0 as usize].token)
            }
        }
    }

    /// The first sender whose first token is the one sought, and that token. Where it is known which senders have
    /// nothing here, they are not looked at.
    #[inline(always)]
    pub fn find(&self, wires: &mut Wires, sought: impl Fn(&T) -> bool) -> Option<(usize, T)> {
        match &self.0 {
            FromNetwork::Direct(inputs) => {
                for (from, input) in inputs.iter().enumerate() {
                    if let Some(token) = wires.front(input)
                        && sought(&token)
                    {
                        return Some((from, token));
                    }
                }
                None
            }
            FromNetwork::Routed(arrived) => {
                let mut here = arrived.here;
                while here != 0 {
                    let from = here.trailing_zeros() as usize;
                    here &= here - 1;
                    let token = arrived.entries[arrived.queues[from].0 as usize].token;
                    if sought(&token) {
                        return Some((from, token));
                    }
                }
                None
            }
        }
    }

    /// Takes the first token from a sender, which the unit has seen in this cycle, and gives its place back.
    ///
    /// # Panics
    /// If there is none: the unit is wrong.
    #[inline(always)]
    pub fn take(&mut self, wires: &mut Wires, from: usize) {
        match &mut self.0 {
            FromNetwork::Direct(inputs) => wires.take(&inputs[from]),
            FromNetwork::Routed(arrived) => {
                arrived.remove(from);
                arrived.owed[from] += 1;
                if arrived.owed[from] >= arrived.bundle {
                    arrived.due |= 1 << from;
                    arrived.give_back(wires);
                }
            }
        }
    }

    /// Tokens taken in and not yet taken: for the unit's own [`resident`](sim::Unit::resident).
    pub fn resident(&self) -> u64 {
        match &self.0 {
            FromNetwork::Direct(_) => 0,
            FromNetwork::Routed(arrived) => u64::from(arrived.held),
        }
    }
}
