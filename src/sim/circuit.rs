//! Units and wires as one machine.

use super::unit::{Tick, Unit};
use super::wires::{Wires, Wiring};
use crate::stats::Tree;

/// A row of units of one kind: what a field of a [`circuit!`](crate::circuit) is. [`One`], `Vec` or `Option`.
pub trait Bank<C> {
    /// How many units.
    fn count(&self) -> usize;

    /// Ticks those that are due, or all if `ALL`; the first has number `base` in the machine.
    fn tick_due<const ALL: bool>(&mut self, base: usize, wires: &mut Wires, context: &mut C);

    /// Ticks unit `index`.
    fn tick_one(&mut self, index: usize, base: usize, wires: &mut Wires, context: &mut C);

    /// Appends the items done by each, and the items inside each.
    fn tally(&self, done: &mut Vec<u64>, resident: &mut Vec<u64>);
}

#[inline(always)]
fn tick<C, U: Unit<C>>(unit: &mut U, number: usize, wires: &mut Wires, context: &mut C) {
    wires.begin_tick();
    let done: Tick = unit.tick(wires, context);
    wires.end_tick(number, done);
}

/// A bank of exactly one unit, which it dereferences to. (A unit cannot be a bank itself: the compiler would have to know that
/// no `Vec` is ever a unit.)
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct One<U>(pub U);

impl<U> std::ops::Deref for One<U> {
    type Target = U;

    #[inline(always)]
    fn deref(&self) -> &U {
        &self.0
    }
}

impl<U> std::ops::DerefMut for One<U> {
    #[inline(always)]
    fn deref_mut(&mut self) -> &mut U {
        &mut self.0
    }
}

impl<C, U: Unit<C>> Bank<C> for One<U> {
    fn count(&self) -> usize {
        1
    }

    #[inline(always)]
    fn tick_due<const ALL: bool>(&mut self, base: usize, wires: &mut Wires, context: &mut C) {
        if ALL || wires.due(base) {
            tick(&mut self.0, base, wires, context);
        }
    }

    fn tick_one(&mut self, _: usize, base: usize, wires: &mut Wires, context: &mut C) {
        tick(&mut self.0, base, wires, context);
    }

    fn tally(&self, done: &mut Vec<u64>, resident: &mut Vec<u64>) {
        done.push(self.0.items());
        resident.push(self.0.resident());
    }
}

impl<C, U: Unit<C>> Bank<C> for Vec<U> {
    fn count(&self) -> usize {
        self.len()
    }

    #[inline(always)]
    fn tick_due<const ALL: bool>(&mut self, base: usize, wires: &mut Wires, context: &mut C) {
        if ALL {
            for (index, unit) in self.iter_mut().enumerate() {
                tick(unit, base + index, wires, context);
            }
            return;
        }
        for (row, units) in self.chunks_mut(64).enumerate() {
            let base = base + 64 * row;
            let mut candidates = wires.candidates(base, units.len());
            while candidates != 0 {
                let index = candidates.trailing_zeros() as usize;
                candidates &= candidates - 1;
                if wires.due(base + index) {
                    tick(&mut units[index], base + index, wires, context);
                }
            }
        }
    }

    fn tick_one(&mut self, index: usize, base: usize, wires: &mut Wires, context: &mut C) {
        tick(&mut self[index], base + index, wires, context);
    }

    fn tally(&self, done: &mut Vec<u64>, resident: &mut Vec<u64>) {
        done.extend(self.iter().map(Unit::items));
        resident.extend(self.iter().map(Unit::resident));
    }
}

impl<C, U: Unit<C>> Bank<C> for Option<U> {
    fn count(&self) -> usize {
        usize::from(self.is_some())
    }

    #[inline(always)]
    fn tick_due<const ALL: bool>(&mut self, base: usize, wires: &mut Wires, context: &mut C) {
        if let Some(unit) = self
            && (ALL || wires.due(base))
        {
            tick(unit, base, wires, context);
        }
    }

    fn tick_one(&mut self, _: usize, base: usize, wires: &mut Wires, context: &mut C) {
        if let Some(unit) = self {
            tick(unit, base, wires, context);
        }
    }

    fn tally(&self, done: &mut Vec<u64>, resident: &mut Vec<u64>) {
        done.extend(self.iter().map(Unit::items));
        resident.extend(self.iter().map(Unit::resident));
    }
}

/// A machine made by [`circuit!`](crate::circuit).
pub trait Circuit {
    /// What its units share.
    type Context;

    /// Its channels and its time.
    fn wires(&self) -> &Wires;

    /// Its channels and its time.
    fn wires_mut(&mut self) -> &mut Wires;

    /// Ticks all units, or those that are due, in the order of the fields.
    fn cycle<const ALL: bool>(&mut self, context: &mut Self::Context);

    /// Ticks all units in the given order of their numbers. For tests: the order must not matter.
    fn cycle_in(&mut self, order: &[usize], context: &mut Self::Context);

    /// The items done by each unit, and the items inside each.
    fn tally(&self) -> (Vec<u64>, Vec<u64>);

    /// The leaves `units` and `channels` of the statistics, over the cycles gone by.
    fn tree(&self) -> Tree {
        let mut tree = Tree::new();
        tree.child("units").extend(self.wires().unit_tree(&self.tally().0));
        tree.child("channels").extend(self.wires().channel_tree());
        tree
    }
}

/// Finishes a wiring for fields of the given names and counts.
///
/// # Panics
/// If the units were not declared in the order of the fields: the machine is wrong.
#[doc(hidden)]
pub fn assemble(wiring: Wiring, fields: &[(&str, usize)]) -> Wires {
    let expected = fields.iter().flat_map(|&(name, count)| (0..count).map(move |index| format!("{name}[{index}]")));
    let declared = wiring.unit_labels().iter().map(ToString::to_string);
    assert!(
        expected.clone().eq(declared.clone()),
        "the units are declared as {:?} but the machine has {:?}",
        declared.collect::<Vec<_>>(),
        expected.collect::<Vec<_>>()
    );
    wiring.finish()
}

/// Declares a machine as its units in data-flow order. The struct reads as the block diagram:
///
/// ```
/// use fillrate::sim::{Circuit, Clock, In, Link, One, Out, Tick, Unit, Wires, Wiring, run};
///
/// struct Source { left: u32, output: Out<u32> }
/// impl Unit<()> for Source {
///     fn tick(&mut self, wires: &mut Wires, _: &mut ()) -> Tick {
///         if self.left == 0 {
///             return Tick::Idle;
///         }
///         if !wires.try_push(&self.output, self.left) {
///             return Tick::Blocked;
///         }
///         self.left -= 1;
///         Tick::Moved
///     }
///     fn items(&self) -> u64 { 0 }
///     fn resident(&self) -> u64 { u64::from(self.left) }
/// }
///
/// struct Sink { items: u64, input: In<u32> }
/// impl Unit<()> for Sink {
///     fn tick(&mut self, wires: &mut Wires, _: &mut ()) -> Tick {
///         let Some(_) = wires.pop(&self.input) else { return Tick::Starved };
///         self.items += 1;
///         Tick::Moved
///     }
///     fn items(&self) -> u64 { self.items }
///     fn resident(&self) -> u64 { 0 }
/// }
///
/// fillrate::circuit! {
///     /// One source, one sink; several would be `sink: Vec<Sink>`.
///     struct Pair for () {
///         source: One<Source>,
///         sink: One<Sink>,
///     }
/// }
///
/// let mut wiring = Wiring::new();
/// let (source, sink) = (wiring.unit("source", 0), wiring.unit("sink", 0));
/// let (output, input) = wiring.channel("numbers", 0, Link::items(4, 1, 3), source, sink);
/// let mut pair = Pair::new(wiring, One(Source { left: 10, output }), One(Sink { items: 0, input }));
/// run(&mut pair, &mut (), Clock::SkipIdle, 1000, |pair, _| pair.sink.items == 10).unwrap();
/// assert_eq!(pair.wires().now(), 13);
/// assert_eq!(pair.tree().number("units.source[0].busy"), Some(10.0));
/// ```
///
/// After `for` stands the type of what all units share. A field is [`One`](crate::sim::One) unit, a `Vec` of units or an `Option` of
/// one. `new` takes
/// the wiring, whose units were declared in the order of the fields, and the fields.
#[macro_export]
macro_rules! circuit {
    ($(#[$meta:meta])* $vis:vis struct $name:ident for $context:ty {
        $($(#[$doc:meta])* $field:ident: $bank:ty),* $(,)?
    }) => {
        $(#[$meta])*
        $vis struct $name {
            wires: $crate::sim::Wires,
            $($(#[$doc])* pub $field: $bank,)*
        }

        impl $name {
            /// The machine at cycle 0.
            ///
            /// # Panics
            /// If the wiring's units are not these.
            $vis fn new(wiring: $crate::sim::Wiring, $($field: $bank),*) -> $name {
                let fields = [$((stringify!($field), $crate::sim::Bank::<$context>::count(&$field))),*];
                $name { wires: $crate::sim::assemble(wiring, &fields), $($field),* }
            }
        }

        impl $crate::sim::Circuit for $name {
            type Context = $context;

            fn wires(&self) -> &$crate::sim::Wires {
                &self.wires
            }

            fn wires_mut(&mut self) -> &mut $crate::sim::Wires {
                &mut self.wires
            }

            #[inline]
            #[allow(unused_assignments)]
            fn cycle<const ALL: bool>(&mut self, context: &mut $context) {
                let mut base = 0;
                $(
                    $crate::sim::Bank::<$context>::tick_due::<ALL>(&mut self.$field, base, &mut self.wires, context);
                    base += $crate::sim::Bank::<$context>::count(&self.$field);
                )*
            }

            fn cycle_in(&mut self, order: &[usize], context: &mut $context) {
                for &number in order {
                    let mut base = 0;
                    $(
                        let count = $crate::sim::Bank::<$context>::count(&self.$field);
                        if (base..base + count).contains(&number) {
                            $crate::sim::Bank::<$context>::tick_one(
                                &mut self.$field, number - base, base, &mut self.wires, context,
                            );
                        }
                        base += count;
                    )*
                    assert!(number < base, "unit {number} of {base}");
                }
            }

            fn tally(&self) -> (Vec<u64>, Vec<u64>) {
                let (mut done, mut resident) = (Vec::new(), Vec::new());
                $($crate::sim::Bank::<$context>::tally(&self.$field, &mut done, &mut resident);)*
                (done, resident)
            }
        }
    };
}
