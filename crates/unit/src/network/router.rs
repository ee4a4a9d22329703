//! The router: what comes in at any input goes out where the table says.

use super::topology::{EXPAND, RouterPlan};
use super::{Arbitration, Parcel, next_from};
use num::Cycle;
use sim::{In, Out, Tick, Unit, Wires};

/// No place in the store.
const NIL: u32 = u32::MAX;

/// A parcel in the store.
#[derive(Clone, Copy, Debug)]
struct StoredParcel {
    parcel: Parcel,
    /// When it came.
    came: Cycle,
    /// The place of the one behind it in its queue, or the next free place.
    next: u32,
}

/// The parcels from one input for one output.
#[derive(Clone, Copy, Debug)]
struct Queue {
    head: u32,
    tail: u32,
}

/// A router of any number of inputs and outputs up to 64. Its items are parcels sent on, copies counted.
///
/// A parcel that finds its way free passes in the cycle in which it comes; what a hop takes is the link's. Each input has a store for
/// parcels, with a queue for each output, so that a parcel is not held up by one before it that goes elsewhere. An output
/// takes from one input after another what its link can carry, by the network's arbitration. Inputs do not compete inside.
///
/// On a ring, what comes from the node itself enters a link only if that leaves a slot free (a bubble), while what is on the ring
/// already goes on if there is any; the network's page says why.
#[derive(Clone, Debug)]
pub struct Router {
    inputs: Vec<In<Parcel>>,
    outputs: Vec<Out<Parcel>>,
    table: Box<[u8; 256]>,
    arbitration: Arbitration,
    /// On a ring, the inputs from other routers.
    through: Option<u64>,
    /// By input, the free places of its store.
    room: Vec<u32>,
    held: Vec<StoredParcel>,
    free: u32,
    /// Queues of parcels, by output and then input.
    queues: Vec<Queue>,
    /// By output, the inputs that hold a parcel for it.
    waiting: Vec<u64>,
    /// Outputs that a parcel is held for.
    wanted: u64,
    /// By output, the input whose turn it is.
    turn: Vec<u8>,
    resident: u64,
    items: u64,
}

impl Router {
    /// An empty router, with a store of `room` parcels for each input.
    pub(super) fn new(
        plan: &RouterPlan,
        arbitration: Arbitration,
        room: u32,
        inputs: Vec<In<Parcel>>,
        outputs: Vec<Out<Parcel>>,
    ) -> Router {
        assert!(inputs.len() <= 64 && outputs.len() <= 64, "ports fit a mask");
        // A parcel for all takes a place for each output.
        let room = if plan.table.contains(&EXPAND) { room + outputs.len() as u32 } else { room };
        let places = room * inputs.len() as u32;
        let parcel = Parcel::default();
        let held = (1..=places).map(|next| StoredParcel { parcel, came: 0, next: if next == places { NIL } else { next } });
        Router {
            table: plan.table.clone(),
            arbitration,
            through: plan.through,
            room: vec![room; inputs.len()],
            held: held.collect(),
            free: 0,
            queues: vec![Queue { head: NIL, tail: NIL }; inputs.len() * outputs.len()],
            waiting: vec![0; outputs.len()],
            wanted: 0,
            turn: vec![0; outputs.len()],
            resident: 0,
            items: 0,
            inputs,
            outputs,
        }
    }

    /// Puts a parcel into the queue of an input for an output; the input has room.
    #[inline(always)]
    fn hold(&mut self, input: usize, output: usize, parcel: Parcel, now: Cycle) {
        let place = self.free;
        let held = &mut self.held[place as usize];
        self.free = held.next;
        *held = StoredParcel { parcel, came: now, next: NIL };
        let queue = &mut self.queues[output * self.inputs.len() + input];
        if self.waiting[output] >> input & 1 == 0 {
            queue.head = place;
        } else {
            self.held[queue.tail as usize].next = place;
        }
        queue.tail = place;
        self.waiting[output] |= 1 << input;
        self.wanted |= 1 << output;
        self.room[input] -= 1;
        self.resident += 1;
    }

    /// Takes the first parcel of an input for an output out of the store.
    #[inline(always)]
    fn release(&mut self, input: usize, output: usize) -> Parcel {
        let queue = &mut self.queues[output * self.inputs.len() + input];
        let place = queue.head;
        let held = &mut self.held[place as usize];
        queue.head = held.next;
        held.next = self.free;
        self.free = place;
        if queue.head == NIL {
            self.waiting[output] &= !(1 << input);
            self.wanted &= !(u64::from(self.waiting[output] == 0) << output);
        }
        self.room[input] += 1;
        self.resident -= 1;
        self.held[place as usize].parcel
    }

    /// Takes in what has come to an input, as far as there is room; whether anything was, and whether that was all.
    #[inline(always)]
    fn take_in(&mut self, input: usize, wires: &mut Wires) -> (bool, bool) {
        let mut took = false;
        loop {
            if self.room[input] == 0 {
                return (took, false);
            }
            let Some(parcel) = wires.front(&self.inputs[input]) else { return (took, true) };
            let output = self.table[usize::from(parcel.to)];
            if output == EXPAND {
                if (self.room[input] as usize) < self.outputs.len() {
                    return (took, false);
                }
                for output in 0..self.outputs.len() {
                    self.hold(input, output, parcel, wires.now());
                }
            } else {
                self.hold(input, usize::from(output), parcel, wires.now());
            }
            wires.take(&self.inputs[input]);
            took = true;
        }
    }

    /// The input, of those given, that an output takes from next.
    #[inline(always)]
    fn choose(&self, output: usize, candidates: u64) -> usize {
        let next = next_from(candidates, self.turn[output]);
        if self.arbitration == Arbitration::RoundRobin {
            return next;
        }
        // The one that came first; of several, the one whose turn it is.
        let queues = &self.queues[output * self.inputs.len()..][..self.inputs.len()];
        let came = |input: usize| self.held[queues[input].head as usize].came;
        let (mut best, mut since) = (next, came(next));
        let mut left = candidates.rotate_right(next as u32);
        while left != 0 {
            let input = (next + left.trailing_zeros() as usize) % 64;
            left &= left - 1;
            if came(input) < since {
                (best, since) = (input, came(input));
            }
        }
        best
    }

    /// Sends what an output's link can carry; whether anything was sent.
    #[inline(always)]
    fn send(&mut self, output: usize, wires: &mut Wires) -> bool {
        let mut sent = false;
        while self.waiting[output] != 0 && wires.can_push(&self.outputs[output]) {
            let mut candidates = self.waiting[output];
            if let Some(through) = self.through
                && candidates & !through != 0
                && !wires.has_room(&self.outputs[output], 2)
            {
                candidates &= through;
                if candidates == 0 {
                    break;
                }
            }
            let input = self.choose(output, candidates);
            let parcel = self.release(input, output);
            wires.push_sized(&self.outputs[output], parcel, u32::from(parcel.bytes));
            self.turn[output] = (input as u8 + 1) % 64;
            self.items += 1;
            sent = true;
        }
        sent
    }
}

impl<C> Unit<C> for Router {
    fn tick(&mut self, wires: &mut Wires, _: &mut C) -> Tick {
        // 1. First in, then out: a parcel passes in the cycle in which it comes.
        let (mut moved, mut all) = (false, true);
        for input in 0..self.inputs.len() {
            let (took, everything) = self.take_in(input, wires);
            moved |= took;
            all &= everything;
        }
        // 2. Each output that anything waits for.
        let mut wanted = self.wanted;
        while wanted != 0 {
            let output = wanted.trailing_zeros() as usize;
            wanted &= wanted - 1;
            moved |= self.send(output, wires);
        }
        let why = if self.wanted != 0 { Tick::Blocked } else { Tick::Starved };
        if !moved {
            return why;
        }
        // 3. With nothing left at the inputs, the next cycle would find only what blocks now.
        if all {
            wires.rest(why);
        }
        Tick::Moved
    }

    fn items(&self) -> u64 {
        self.items
    }

    fn resident(&self) -> u64 {
        self.resident
    }
}
