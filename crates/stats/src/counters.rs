//! Declaring counters.

use super::Tree;

/// What one counter is: the generated page and the report read this.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Declaration {
    /// The name of the leaf in the statistics tree.
    pub name: &'static str,
    /// What is counted: `items`, `cycles`, `bytes`…
    pub unit: &'static str,
    /// One or two sentences.
    pub meaning: &'static str,
}

impl Declaration {
    /// The declaration of a statistic that is no counter, such as a share or a name.
    pub const fn new(name: &'static str, unit: &'static str, meaning: &'static str) -> Declaration {
        Declaration { name, unit, meaning }
    }
}

/// A set of counters declared by [`counters!`](crate::counters).
pub trait Group: Copy + Default + std::ops::AddAssign + std::iter::Sum + 'static {
    /// The counters, in the order of their declaration.
    const DECLARATIONS: &'static [Declaration];

    /// The values, in the same order.
    fn values(&self) -> impl Iterator<Item = u64> + Clone;

    /// The counters of which `value` gives the values, by their names.
    fn collect(value: impl FnMut(&'static str) -> u64) -> Self;

    /// The names with the values.
    fn named(&self) -> impl Iterator<Item = (&'static str, u64)> + Clone {
        Self::DECLARATIONS.iter().map(|declaration| declaration.name).zip(self.values())
    }

    /// The values as leaves.
    fn tree(&self) -> Tree {
        let mut tree = Tree::with_capacity(Self::DECLARATIONS.len());
        self.named().for_each(|(name, value)| tree.count(name, value));
        tree
    }
}

/// One counter of a set, with the name that its declaration gives it. [`counter!`](crate::counter) makes it.
pub struct Counter<G> {
    name: &'static str,
    of: fn(&G) -> u64,
}

impl<G> Counter<G> {
    /// For [`counter!`](crate::counter), which takes both from a field.
    #[doc(hidden)]
    pub const fn new(name: &'static str, of: fn(&G) -> u64) -> Counter<G> {
        Counter { name, of }
    }

    /// The name of its leaf.
    pub const fn name(&self) -> &'static str {
        self.name
    }

    /// Whether a counter of another set has the same name, so that readers of either set find it.
    pub const fn is_named_as<H>(&self, other: &Counter<H>) -> bool {
        let (own, other) = (self.name.as_bytes(), other.name.as_bytes());
        let mut at = 0;
        while at < own.len() && at < other.len() && own[at] == other[at] {
            at += 1;
        }
        at == own.len() && at == other.len()
    }

    /// Its value in a set.
    pub fn of(&self, counts: &G) -> u64 {
        (self.of)(counts)
    }

    /// Puts a value as its leaf.
    pub fn put(&self, tree: &mut Tree, value: u64) {
        tree.count(self.name, value);
    }
}

impl<G> Clone for Counter<G> {
    fn clone(&self) -> Counter<G> {
        *self
    }
}

impl<G> Copy for Counter<G> {}

/// Fields of one struct are equal where their names are.
impl<G> PartialEq for Counter<G> {
    fn eq(&self, other: &Counter<G>) -> bool {
        self.name == other.name
    }
}

impl<G> Eq for Counter<G> {}

impl<G> std::fmt::Debug for Counter<G> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(self.name)
    }
}

/// The counter of a set that a field declares: `counter!(ClientCounts, read_bytes)`.
///
/// ```
/// stats::counters! {
///     /// What a port counts.
///     pub struct PortCounts {
///         /// Bytes that it took.
///         bytes: "bytes",
///     }
/// }
/// let bytes = stats::counter!(PortCounts, bytes);
/// assert_eq!((bytes.name(), bytes.of(&PortCounts { bytes: 3 })), ("bytes", 3));
/// ```
#[macro_export]
macro_rules! counter {
    ($group:ty, $field:ident) => {
        $crate::Counter::<$group>::new(stringify!($field), |counts| counts.$field)
    };
}

/// Declares a struct of `u64` counters, each with its documentation and unit:
///
/// ```
/// stats::counters! {
///     /// What set-up counts.
///     pub struct SetupCounters {
///         /// Triangles that faced away.
///         culled_backface: "triangles",
///     }
/// }
/// use stats::Group;
/// let mut counters = SetupCounters::default();
/// counters.culled_backface += 1;
/// assert_eq!(SetupCounters::DECLARATIONS[0].meaning, "Triangles that faced away.");
/// assert_eq!(counters.tree().json()["culled_backface"], 1);
/// ```
///
/// The struct has public fields, adds with `+=` and subtracts with `since`.
#[macro_export]
macro_rules! counters {
    ($(#[$meta:meta])* $vis:vis struct $name:ident {
        $($(#[doc = $doc:literal])+ $field:ident: $unit:literal),* $(,)?
    }) => {
        $(#[$meta])*
        #[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
        $vis struct $name {
            $($(#[doc = $doc])+ pub $field: u64,)*
        }

        impl $crate::Group for $name {
            const DECLARATIONS: &'static [$crate::Declaration] = &[
                $($crate::Declaration {
                    name: stringify!($field),
                    unit: $unit,
                    meaning: concat!($($doc),+).trim_ascii(),
                },)*
            ];

            fn values(&self) -> impl Iterator<Item = u64> + Clone {
                [$(self.$field),*].into_iter()
            }

            fn collect(mut value: impl FnMut(&'static str) -> u64) -> $name {
                $name { $($field: value(stringify!($field)),)* }
            }
        }

        impl std::ops::AddAssign for $name {
            fn add_assign(&mut self, other: $name) {
                $(self.$field += other.$field;)*
            }
        }

        impl std::iter::Sum for $name {
            fn sum<I: Iterator<Item = $name>>(counts: I) -> $name {
                counts.fold($name::default(), |mut sum, counts| {
                    sum += counts;
                    sum
                })
            }
        }

        impl $name {
            /// What was counted since `earlier`, a reading of the same counters.
            #[allow(dead_code)]
            $vis fn since(&self, earlier: &$name) -> $name {
                $name { $($field: self.$field - earlier.$field,)* }
            }
        }
    };
}
