//! Units and wires as one machine.

use super::agenda::GROUP;
use super::sheet::{Counted, Description, Sheet};
use super::unit::{Tick, Unit};
use super::wires::{Reading, Wires};
use super::wiring::Wiring;
use num::Cycle;
use stats::{Cycles, Tree};

/// A row of units of one kind: what a field of a [`circuit!`](crate::circuit) is. [`One`], `Vec` or `Option`.
pub trait Bank<C>: Sized {
    /// What each is.
    type Unit: Unit<C>;

    /// The bank of these.
    ///
    /// # Panics
    /// If a bank of this kind cannot hold this number of units: the machine is wrong.
    fn of(name: &str, units: Vec<Self::Unit>) -> Self;

    /// The units.
    fn units(&self) -> &[Self::Unit];

    /// How many units.
    fn count(&self) -> usize;

    /// Appends what each has counted in addition to its items, before a cycle.
    fn read(&self, cycle: Cycle, sheet: &mut Sheet) {
        Counted::of::<C>().read(self.units(), cycle, sheet);
    }

    /// Lets each attribute its cycles before `cycle` more exactly ([`Unit::account`]). The accounts are those of all units, the bank's first
    /// ones in front. Appends the items
    /// that each held, summed over the cycles, and returns the accounts behind the bank's.
    fn accounts<'a>(&self, cycle: Cycle, accounts: &'a mut [Cycles], held: &mut Vec<u64>) -> &'a mut [Cycles] {
        let (own, others) = accounts.split_at_mut(self.count());
        for (unit, account) in self.units().iter().zip(own) {
            let total = account.total();
            let (exact, items) = unit.account(*account, cycle);
            debug_assert_eq!(exact.total(), total, "each cycle is attributed once");
            *account = exact;
            held.push(items);
        }
        others
    }

    /// Appends what the units of such a bank count.
    fn describe(list: &mut Vec<Description>) {
        Counted::<Self::Unit>::of::<C>().describe(list);
    }

    /// Ticks all; the first has number `base` in the machine.
    fn tick_all(&mut self, base: usize, wires: &mut Wires, context: &mut C);

    /// Ticks unit `index`, between [`Wires`]' taking note of its beginning and its end.
    fn tick_one(&mut self, index: usize, wires: &mut Wires, context: &mut C) -> Tick;

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
    type Unit = U;

    fn of(name: &str, units: Vec<U>) -> One<U> {
        let [unit] = <[U; 1]>::try_from(units).unwrap_or_else(|units| panic!("a machine has one {name}, not {}", units.len()));
        One(unit)
    }

    fn units(&self) -> &[U] {
        std::slice::from_ref(&self.0)
    }

    fn count(&self) -> usize {
        1
    }

    #[inline(always)]
    fn tick_all(&mut self, base: usize, wires: &mut Wires, context: &mut C) {
        tick(&mut self.0, base, wires, context);
    }

    #[inline(always)]
    fn tick_one(&mut self, _: usize, wires: &mut Wires, context: &mut C) -> Tick {
        self.0.tick(wires, context)
    }

    fn tally(&self, done: &mut Vec<u64>, resident: &mut Vec<u64>) {
        done.push(self.0.items());
        resident.push(self.0.resident());
    }
}

impl<C, U: Unit<C>> Bank<C> for Vec<U> {
    type Unit = U;

    fn of(_: &str, units: Vec<U>) -> Vec<U> {
        units
    }

    fn units(&self) -> &[U] {
        self
    }

    fn count(&self) -> usize {
        self.len()
    }

    #[inline(always)]
    fn tick_all(&mut self, base: usize, wires: &mut Wires, context: &mut C) {
        for (index, unit) in self.iter_mut().enumerate() {
            tick(unit, base + index, wires, context);
        }
    }

    #[inline(always)]
    fn tick_one(&mut self, index: usize, wires: &mut Wires, context: &mut C) -> Tick {
        self[index].tick(wires, context)
    }

    fn tally(&self, done: &mut Vec<u64>, resident: &mut Vec<u64>) {
        // Not `extend`: it would be compiled twice for each kind of unit.
        for unit in self {
            done.push(unit.items());
            resident.push(unit.resident());
        }
    }
}

impl<C, U: Unit<C>> Bank<C> for Option<U> {
    type Unit = U;

    fn of(name: &str, mut units: Vec<U>) -> Option<U> {
        assert!(units.len() <= 1, "a machine has one {name} at most, not {}", units.len());
        units.pop()
    }

    fn units(&self) -> &[U] {
        self.as_slice()
    }

    fn count(&self) -> usize {
        usize::from(self.is_some())
    }

    #[inline(always)]
    fn tick_all(&mut self, base: usize, wires: &mut Wires, context: &mut C) {
        if let Some(unit) = self {
            tick(unit, base, wires, context);
        }
    }

    #[inline(always)]
    fn tick_one(&mut self, _: usize, wires: &mut Wires, context: &mut C) -> Tick {
        self.as_mut().map_or(Tick::Idle, |unit| unit.tick(wires, context))
    }

    fn tally(&self, done: &mut Vec<u64>, resident: &mut Vec<u64>) {
        if let Some(unit) = self {
            done.push(unit.items());
            resident.push(unit.resident());
        }
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

    /// Ticks all units in the given order of their numbers. For `Clock::Shuffled`, which `fillrate accuracy clocks` runs: results must
    /// not depend on the order.
    fn cycle_in(&mut self, order: &[usize], context: &mut Self::Context);

    /// The items done by each unit, and the items inside each.
    fn tally(&self) -> (Vec<u64>, Vec<u64>);

    /// The counts of every channel and the account of every unit over the cycles before `cycle`, which lies behind the last that was ticked:
    /// of the cycles that a clock has jumped over, in which nothing moves, each can be read.
    fn reading_at(&self, cycle: Cycle) -> Reading;

    /// The same over the cycles gone by.
    fn reading(&self) -> Reading {
        self.reading_at(self.wires().now())
    }

    /// The leaves `units` and `channels` of the statistics, over the cycles gone by.
    fn tree(&self) -> Tree {
        self.wires().tree(&self.reading(), &self.tally().0)
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

/// For each unit the number of its field, and its place in it, in groups as the agenda has them.
#[doc(hidden)]
pub fn places(fields: &[(&str, usize)]) -> Box<[[(u8, u32); GROUP]]> {
    let places = fields.iter().enumerate().flat_map(|(field, &(_, count))| {
        (0..count).map(move |place| (u8::try_from(field).expect("fewer than 256 fields"), place as u32))
    });
    let mut places = places.peekable();
    let mut groups = Vec::new();
    while places.peek().is_some() {
        groups.push(std::array::from_fn(|_| places.next().unwrap_or((u8::MAX, 0))));
    }
    groups.into()
}

/// Declares a machine as its units in data-flow order. The struct reads as the block diagram:
///
/// ```
/// use sim::{Circuit, Clock, In, Link, One, Out, Tick, Unit, Wires, Wiring, run};
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
/// sim::circuit! {
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
/// After `for` stands the type of what all units share. A field is [`One`](crate::One) unit, a `Vec` of units or an `Option` of
/// one. `new` takes
/// the wiring, whose units were declared in the order of the fields, and the fields.
///
/// A machine that is built in several ways names four more types, which this declares from the same fields:
///
/// ```
/// # use sim::{Circuit, In, Link, One, Out, Tick, Unit, Wires, Wiring};
/// # struct Source { output: Out<u32> }
/// # impl Unit<()> for Source {
/// #     fn tick(&mut self, _: &mut Wires, _: &mut ()) -> Tick { Tick::Idle }
/// #     fn items(&self) -> u64 { 0 }
/// #     fn resident(&self) -> u64 { 0 }
/// # }
/// # struct Sink { input: In<u32> }
/// # impl Unit<()> for Sink {
/// #     fn tick(&mut self, _: &mut Wires, _: &mut ()) -> Tick { Tick::Idle }
/// #     fn items(&self) -> u64 { 0 }
/// #     fn resident(&self) -> u64 { 0 }
/// # }
/// #[derive(Clone, Copy, PartialEq)]
/// enum Stage { Front, Back }
///
/// sim::circuit! {
///     /// Sources and sinks.
///     struct Pairs for (), sizes Sizes of usize, numbers Numbers, banks Banks, stages Stage {
///         source: Vec<Source> [Front] = all,
///         sink: Vec<Sink> [Back],
///     }
/// }
///
/// fn all(pairs: &usize) -> usize { *pairs }
///
/// let sizes = Sizes { sink: 2, ..Sizes::of(&2) };
/// let mut wiring = Wiring::new();
/// let numbers = Numbers::declare(&sizes, &mut wiring);
/// let mut banks = Banks::default();
/// for (n, (&source, &sink)) in numbers.source.iter().zip(&numbers.sink).enumerate() {
///     let (output, input) = wiring.channel("numbers", n, Link::items(4, 1, 3), source, sink);
///     banks.source.push(Source { output });
///     banks.sink.push(Sink { input });
/// }
/// let pairs = Pairs::new(wiring, banks);
/// assert_eq!(pairs.wires().units().count(), 4);
/// assert!(Pairs::stages(Stage::Back).eq(["sink"]));
/// ```
///
/// `Sizes` says how many units each bank has. After `=` stands a function of what follows `of`, which gives the number of units that every
/// machine has; `Sizes::of` has these, and none in the other banks. `Numbers` says what numbers the wiring gave them, `Banks` holds the units made so far. The
/// name in brackets is the stage that a bank belongs to, if any: a variant of the type after `stages`.
#[macro_export]
macro_rules! circuit {
    ($(#[$meta:meta])* $vis:vis struct $name:ident for $context:ty {
        $($(#[$doc:meta])* $field:ident: $bank:ty),* $(,)?
    }) => {
        $crate::circuit! { @circuit [$(#[$meta])*] $vis $name $context; $([$(#[$doc])*] $field: $bank,)* }

        impl $name {
            /// The machine at cycle 0.
            ///
            /// # Panics
            /// If the wiring's units are not these.
            $vis fn new(wiring: $crate::Wiring, $($field: $bank),*) -> $name {
                let fields = [$((stringify!($field), $crate::Bank::<$context>::count(&$field))),*];
                $name { places: $crate::places(&fields), wires: $crate::assemble(wiring, &fields), $($field),* }
            }
        }
    };

    ($(#[$meta:meta])* $vis:vis struct $name:ident for $context:ty,
        sizes $sizes:ident of $config:ty, numbers $numbers:ident, banks $banks:ident, stages $stage:ident {
        $($(#[$doc:meta])* $field:ident: $bank:ty $([$in:ident])? $(= $count:ident)?),* $(,)?
    }) => {
        $crate::circuit! { @circuit [$(#[$meta])*] $vis $name $context; $([$(#[$doc])*] $field: $bank,)* }

        /// How many units each bank has.
        #[derive(Clone, Copy, Debug, Default)]
        $vis struct $sizes {
            $($(#[$doc])* pub $field: usize,)*
        }

        impl $sizes {
            /// As many units as the fields say that every machine has; none in the other banks.
            $vis fn of(config: &$config) -> $sizes {
                $sizes { $($field: $crate::circuit!(@count config $($count)?),)* }
            }
        }

        /// Numbers of the units in the wiring.
        $vis struct $numbers {
            $($(#[$doc])* pub $field: Vec<$crate::UnitId>,)*
        }

        impl $numbers {
            /// Declares the units.
            $vis fn declare(sizes: &$sizes, wiring: &mut $crate::Wiring) -> $numbers {
                $numbers { $($field: wiring.bank(stringify!($field), sizes.$field),)* }
            }

            /// The banks of a stage.
            $vis fn of_stage(&self, stage: $stage) -> impl Iterator<Item = &[$crate::UnitId]> {
                let banks = [$((&self.$field[..], $crate::circuit!(@stage $stage $([$in])?))),*];
                banks.into_iter().filter(move |&(_, of)| of == Some(stage)).map(|(bank, _)| bank)
            }
        }

        /// The units made so far.
        #[derive(Default)]
        $vis struct $banks {
            $($(#[$doc])* pub $field: Vec<<$bank as $crate::Bank<$context>>::Unit>,)*
        }

        impl $name {
            /// The machine at cycle 0.
            ///
            /// # Panics
            /// If the wiring's units are not these.
            $vis fn new(wiring: $crate::Wiring, banks: $banks) -> $name {
                let fields = [$((stringify!($field), banks.$field.len())),*];
                $name {
                    places: $crate::places(&fields),
                    wires: $crate::assemble(wiring, &fields),
                    $($field: $crate::Bank::<$context>::of(stringify!($field), banks.$field),)*
                }
            }

            /// Names of the banks of a stage.
            $vis fn stages(stage: $stage) -> impl Iterator<Item = &'static str> {
                let banks = [$((stringify!($field), $crate::circuit!(@stage $stage $([$in])?))),*];
                banks.into_iter().filter(move |&(_, of)| of == Some(stage)).map(|(name, _)| name)
            }

            /// What the units have counted in addition to their items.
            $vis fn sheet(&self) -> $crate::Sheet {
                let mut sheet = $crate::Sheet::default();
                let cycle = self.wires.now();
                $($crate::Bank::<$context>::read(&self.$field, cycle, &mut sheet);)*
                sheet
            }

            /// What they count.
            $vis fn descriptions() -> Vec<$crate::Description> {
                let mut list = Vec::new();
                $(<$bank as $crate::Bank<$context>>::describe(&mut list);)*
                list
            }
        }
    };

    (@count $config:ident $count:ident) => { $count($config) };
    (@count $config:ident) => { 0 };

    (@stage $stage:ident [$in:ident]) => { Some($stage::$in) };
    (@stage $stage:ident) => { None };

    (@circuit [$(#[$meta:meta])*] $vis:vis $name:ident $context:ty; $([$(#[$doc:meta])*] $field:ident: $bank:ty,)*) => {
        $(#[$meta])*
        $vis struct $name {
            wires: $crate::Wires,
            /// For each unit the number of its field, and its place in it.
            places: Box<[[(u8, u32); $crate::GROUP]]>,
            $($(#[$doc])* pub $field: $bank,)*
        }

        impl $crate::Circuit for $name {
            type Context = $context;

            fn wires(&self) -> &$crate::Wires {
                &self.wires
            }

            fn wires_mut(&mut self) -> &mut $crate::Wires {
                &mut self.wires
            }

            #[inline]
            #[allow(unused_assignments, non_upper_case_globals)]
            fn cycle<const ALL: bool>(&mut self, context: &mut $context) {
                if ALL {
                    let mut base = 0;
                    $(
                        $crate::Bank::<$context>::tick_all(&mut self.$field, base, &mut self.wires, context);
                        base += $crate::Bank::<$context>::count(&self.$field);
                    )*
                    return;
                }
                // The numbers of the fields, by which a unit that is due is found with one jump.
                #[repr(u8)]
                #[allow(non_camel_case_types, clippy::upper_case_acronyms)]
                enum Field { $($field),* }
                $(#[allow(non_upper_case_globals)] const $field: u8 = Field::$field as u8;)*
                for (group, places) in self.places.iter().enumerate() {
                    let mut candidates = self.wires.candidates(group);
                    while candidates != 0 {
                        let member = candidates.trailing_zeros() as usize;
                        let number = group * $crate::GROUP + member;
                        candidates &= candidates - 1;
                        if !self.wires.due(number) {
                            continue;
                        }
                        // What surrounds a tick stands here once, not in every arm: the loop has to fit the host's
                        // instruction cache beside the units.
                        let (field, place) = places[member];
                        self.wires.begin_tick();
                        let done = match field {
                            $($field => $crate::Bank::<$context>::tick_one(
                                &mut self.$field, place as usize, &mut self.wires, context,
                            ),)*
                            _ => $crate::Tick::Idle,
                        };
                        self.wires.end_tick(number, done);
                    }
                }
            }

            fn cycle_in(&mut self, order: &[usize], context: &mut $context) {
                for &number in order {
                    let mut base = 0;
                    $(
                        let count = $crate::Bank::<$context>::count(&self.$field);
                        if (base..base + count).contains(&number) {
                            self.wires.begin_tick();
                            let done = $crate::Bank::<$context>::tick_one(
                                &mut self.$field, number - base, &mut self.wires, context,
                            );
                            self.wires.end_tick(number, done);
                        }
                        base += count;
                    )*
                    assert!(number < base, "unit {number} of {base}");
                }
            }

            fn reading_at(&self, cycle: $crate::Cycle) -> $crate::Reading {
                let mut reading = self.wires.reading_at(cycle);
                let accounts = &mut reading.units[..];
                $(let accounts = $crate::Bank::<$context>::accounts(&self.$field, cycle, accounts, &mut reading.held);)*
                debug_assert!(accounts.is_empty(), "each unit belongs to a bank");
                reading
            }

            fn tally(&self) -> (Vec<u64>, Vec<u64>) {
                let (mut done, mut resident) = (Vec::new(), Vec::new());
                $($crate::Bank::<$context>::tally(&self.$field, &mut done, &mut resident);)*
                (done, resident)
            }
        }
    };
}
