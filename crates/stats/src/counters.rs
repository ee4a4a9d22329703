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

/// A set of counters declared by [`counters!`](crate::counters).
pub trait Group: Copy + Default + std::ops::AddAssign + 'static {
    /// The counters, in the order of their declaration.
    const DECLARATIONS: &'static [Declaration];

    /// The values, in the same order.
    fn values(&self) -> impl Iterator<Item = u64>;

    /// The counters of which `value` gives the values, by their names.
    fn collect(value: impl FnMut(&'static str) -> u64) -> Self;

    /// The values as leaves.
    fn tree(&self) -> Tree {
        let mut tree = Tree::new();
        for (declaration, value) in Self::DECLARATIONS.iter().zip(self.values()) {
            tree.count(declaration.name, value);
        }
        tree
    }
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

            fn values(&self) -> impl Iterator<Item = u64> {
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
