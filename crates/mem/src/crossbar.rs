//! The ways between clients and slices.

use super::port::{AccessKind, Answer, HEADER, Request, SliceAnswer, SliceRequest};
use super::system::Interleave;
use super::tlb::{TLB, TlbConfig, TlbCounts, Translation};
use sim::{Counted, In, Out, Tick, Unit, Wires};
use stats::Heading;

/// Where the clients of memory count.
pub const CLIENTS: Heading = Heading::new("memory.clients.NAME", "What each client asked of the memory system.");

stats::counters! {
    /// What a client asked of memory.
    pub struct ClientCounts {
        /// Bytes read.
        read_bytes: "bytes",
        /// Bytes written.
        write_bytes: "bytes",
        /// Requests, of either kind.
        requests: "requests",
    }
}

impl ClientCounts {
    /// Counts a request.
    #[inline(always)]
    pub fn count(&mut self, request: &Request) {
        let bytes = u64::from(request.bytes);
        self.requests += 1;
        match request.kind() {
            AccessKind::Read => self.read_bytes += bytes,
            AccessKind::Write => self.write_bytes += bytes,
            AccessKind::Atomic => {
                self.read_bytes += bytes;
                self.write_bytes += bytes;
            }
        }
    }
}

/// From clients to slices: each client sends and each slice's link takes what its width allows; clients take turns. Where addresses are
/// translated, requests whose translation is not there step aside. Its items are requests.
#[derive(Clone, Debug)]
pub struct Crossbar {
    interleave: Interleave,
    /// The client that is asked first.
    turn: usize,
    items: u64,
    counts: Vec<ClientCounts>,
    inputs: Vec<In<Request>>,
    outputs: Vec<Out<SliceRequest>>,
    translation: Option<Translation>,
}

impl Crossbar {
    /// A crossbar with nothing in it.
    pub fn new(
        interleave: Interleave,
        tlb: Option<TlbConfig>,
        inputs: Vec<In<Request>>,
        outputs: Vec<Out<SliceRequest>>,
    ) -> Crossbar {
        assert_eq!(interleave.slices() as usize, outputs.len(), "one output a slice");
        let translation = tlb.and_then(|tlb| Translation::new(tlb, inputs.len()));
        let counts = vec![ClientCounts::default(); inputs.len()];
        Crossbar { interleave, turn: 0, items: 0, counts, inputs, outputs, translation }
    }

    /// What translation has done, where addresses are translated.
    pub fn translations(&self) -> Option<TlbCounts> {
        self.translation.as_ref().map(Translation::counts)
    }

    /// The next request of a client that can go on: one that has waited for its translation, by its place, or the head of its port. A head whose
    /// translation is not there steps aside, if there is room; says whether one did.
    #[inline(always)]
    fn front(&mut self, wires: &mut Wires, client: usize) -> (Option<(Option<usize>, Request)>, bool) {
        let Some(translation) = &mut self.translation else {
            return (wires.front(&self.inputs[client]).map(|request| (None, request)), false);
        };
        let now = wires.now();
        let (mut head, mut aside) = (wires.front(&self.inputs[client]).map(|request| (None, request)), false);
        if let Some((_, request)) = head
            && let Some(until) = translation.waits_until(client, request.address, now)
        {
            if translation.has_room(client) {
                wires.take(&self.inputs[client]);
                translation.wait(client, request, until);
                aside = true;
            }
            head = None;
        }
        (translation.translated(client, now).map(|(place, request)| (Some(place), request)).or(head), aside)
    }

    /// Has an address of a port translated without any time, for functional warming: its page is known then, and nothing is counted.
    pub fn visit(&mut self, port: u16, address: u64) {
        if let Some(translation) = &mut self.translation {
            translation.visit(port.into(), address);
        }
    }

    /// How addresses are dealt to slices.
    pub fn interleave(&self) -> Interleave {
        self.interleave
    }

    /// What each port asked for.
    pub fn counts(&self) -> &[ClientCounts] {
        &self.counts
    }
}

impl<C> Unit<C> for Crossbar {
    #[inline]
    fn tick(&mut self, wires: &mut Wires, _: &mut C) -> Tick {
        let mut why = Tick::Starved;
        let mut first = None;
        let mut more = false;
        // 1. Every client in turn sends one request, if the link to its slice takes it.
        for step in 0..self.inputs.len() {
            let client =
                if self.turn + step < self.inputs.len() { self.turn + step } else { self.turn + step - self.inputs.len() };
            let (next, aside) = self.front(wires, client);
            if aside {
                (first, more) = (first.or(Some(client)), true);
            }
            let Some((waited, request)) = next else { continue };
            let (slice, address) = self.interleave.split(request.address);
            let output = &self.outputs[slice as usize];
            if !wires.can_push(output) {
                why = Tick::Blocked;
                continue;
            }
            match (waited, &mut self.translation) {
                (Some(place), Some(translation)) => translation.take(client, place),
                _ => wires.take(&self.inputs[client]),
            }
            let bytes = if request.kind() == AccessKind::Read { HEADER } else { HEADER + u32::from(request.bytes) };
            wires.push_sized(output, SliceRequest::new(request, client as u16, address), bytes);
            self.counts[client].count(&request);
            self.items += 1;
            first = first.or(Some(client));
            more |= wires.can_pop(&self.inputs[client]);
        }
        // 2. Requests that wait for translations go on when these are there.
        if let Some(next) = self.translation.as_ref().and_then(Translation::next) {
            wires.sleep_until(next.max(wires.now() + 1));
            why = if why == Tick::Starved { Tick::Working } else { why };
        }
        // 3. Who was served first is asked last in the next cycle.
        let Some(client) = first else { return why };
        self.turn = if client + 1 < self.inputs.len() { client + 1 } else { 0 };
        // 4. With nothing more at hand, the next cycle would find only what blocks now.
        if !more {
            wires.rest(why);
        }
        Tick::Moved
    }

    fn items(&self) -> u64 {
        self.items
    }

    fn resident(&self) -> u64 {
        self.translation.as_ref().map_or(0, Translation::resident)
    }

    fn counted(groups: &mut Counted<Self>) {
        groups.group_if(TLB, Crossbar::translations);
    }
}

/// From slices back to clients: slices take turns. Its items are answers.
#[derive(Clone, Debug)]
pub struct ReturnPath {
    turn: usize,
    items: u64,
    inputs: Vec<In<SliceAnswer>>,
    outputs: Vec<Out<Answer>>,
}

impl ReturnPath {
    /// A return path with nothing on it.
    pub fn new(inputs: Vec<In<SliceAnswer>>, outputs: Vec<Out<Answer>>) -> ReturnPath {
        ReturnPath { turn: 0, items: 0, inputs, outputs }
    }
}

impl<C> Unit<C> for ReturnPath {
    #[inline]
    fn tick(&mut self, wires: &mut Wires, _: &mut C) -> Tick {
        let mut why = Tick::Starved;
        let mut first = None;
        let mut more = false;
        for step in 0..self.inputs.len() {
            let slice =
                if self.turn + step < self.inputs.len() { self.turn + step } else { self.turn + step - self.inputs.len() };
            let Some(answer) = wires.front(&self.inputs[slice]) else { continue };
            let output = &self.outputs[usize::from(answer.client)];
            if !wires.can_push(output) {
                why = Tick::Blocked;
                continue;
            }
            wires.take(&self.inputs[slice]);
            wires.push_sized(output, Answer { tag: answer.tag }, u32::from(answer.bytes));
            self.items += 1;
            first = first.or(Some(slice));
            more |= wires.can_pop(&self.inputs[slice]);
        }
        let Some(slice) = first else { return why };
        self.turn = if slice + 1 < self.inputs.len() { slice + 1 } else { 0 };
        if !more {
            wires.rest(why);
        }
        Tick::Moved
    }

    fn items(&self) -> u64 {
        self.items
    }

    fn resident(&self) -> u64 {
        0
    }
}
