//! The declaration of a machine: its units, channels and probes before it runs.

use std::any::TypeId;
use std::marker::PhantomData;

use super::agenda::Agenda;
use super::channel::{Channel, Link, Slot};
use super::stall_probe::{StallProbe, StallProbeState};
use super::unit::Tick;
use super::wires::{In, Label, Out, Token, UnitId, Wires, unpack};
use num::NEVER;

/// Declares the units and channels of a machine before it runs.
#[derive(Debug, Default)]
pub struct Wiring {
    units: Vec<Label>,
    channels: Vec<Channel>,
    labels: Vec<Label>,
    show: Vec<fn(&[u64; 2]) -> String>,
    types: Vec<TypeId>,
    probes: Vec<StallProbeState>,
    places: u32,
}

impl Wiring {
    /// Nothing declared yet.
    pub fn new() -> Wiring {
        Wiring::default()
    }

    /// Declares the next unit. Units are declared in the order of the machine's fields, those of a bank by their index.
    pub fn unit(&mut self, name: &'static str, index: usize) -> UnitId {
        let id = u16::try_from(self.units.len()).expect("fewer than 65,536 units");
        self.units.push(Label { name, index });
        UnitId(id)
    }

    /// Declares units 0 to `count - 1` of a bank.
    pub fn bank(&mut self, name: &'static str, count: usize) -> Vec<UnitId> {
        (0..count).map(|index| self.unit(name, index)).collect()
    }

    /// Joins two units by channel `index` of those called `name`; an item counts as the bytes of its token unless it is pushed
    /// with a size.
    ///
    /// # Panics
    /// If the link is not one: capacity, width and latency are at least 1, the latency below 65,536, which a checked configuration guarantees.
    pub fn channel<T: Token>(
        &mut self,
        name: &'static str,
        index: usize,
        link: Link,
        from: UnitId,
        to: UnitId,
    ) -> (Out<T>, In<T>) {
        let sound = link.capacity >= 1 && link.width >= 1 && (1..=0xffff).contains(&link.latency);
        assert!(sound, "{name}[{index}] is no channel: {link:?}");
        let number = self.channels.len() as u32;
        self.places = self.places.next_multiple_of(Channel::places(link.capacity));
        self.channels.push(Channel::new(link, self.places, from, to));
        self.labels.push(Label { name, index });
        self.show.push(|data| format!("{:?}", unpack::<T>(data)));
        self.types.push(TypeId::of::<T>());
        self.places += Channel::places(link.capacity);
        (Out(number, PhantomData), In(number, PhantomData))
    }

    /// A channel ends at another unit than the one that it was declared with, which is given back.
    pub fn redirect<T>(&mut self, input: &In<T>, to: UnitId) -> UnitId {
        std::mem::replace(&mut self.channels[input.0 as usize].consumer, to)
    }

    /// The name and number of a unit, as messages have them.
    pub fn label(&self, unit: UnitId) -> String {
        self.units[usize::from(unit.0)].to_string()
    }

    /// A probe that watches these units, in state 0.
    pub fn stall_probe(&mut self, units: &[UnitId]) -> StallProbe {
        let number = u16::try_from(self.probes.len()).expect("fewer than 65,536 probes");
        self.probes.push(StallProbeState::new(units));
        StallProbe(number)
    }

    /// Declarations done: the wires at cycle 0, all channels empty and every unit awake.
    pub(super) fn finish(self) -> Wires {
        Wires {
            now: 0,
            next: NEVER,
            rest: Tick::Moved,
            last_move: 0,
            moved: true,
            worked: false,
            agenda: Agenda::new(self.units.len()),
            channels: self.channels,
            slots: vec![Slot::default(); self.places as usize],
            units: self.units,
            labels: self.labels,
            show: self.show,
            types: self.types,
            probes: self.probes,
        }
    }

    pub(super) fn unit_labels(&self) -> &[Label] {
        &self.units
    }
}
