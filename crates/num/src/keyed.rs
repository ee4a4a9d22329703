//! Enums that index tables.

/// Declares an enum and a table with an entry for each of its variants. A variant has its name in messages behind it.
///
/// ```
/// num::keyed! {
///     /// A side of a coin.
///     pub enum Side;
///     /// A table with an entry for each side.
///     pub struct SideMap;
///     /// The side with the face.
///     Head "head",
///     /// The other side.
///     Tail "tail",
/// }
///
/// let mut thrown = SideMap::<u32>::default();
/// thrown[Side::Tail] += 1;
/// assert_eq!(Side::ALL.map(|side| thrown[side]), [0, 1]);
/// assert_eq!(Side::Head.name(), "head");
/// ```
#[macro_export]
macro_rules! keyed {
    (
        $(#[$meta:meta])*
        pub enum $key:ident;
        $(#[$map_meta:meta])*
        pub struct $map:ident;
        $($(#[$doc:meta])* $variant:ident $name:literal,)+
    ) => {
        $(#[$meta])*
        #[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
        pub enum $key {
            $($(#[$doc])* $variant,)+
        }

        impl $key {
            /// The number of variants.
            pub const COUNT: usize = [$($name),+].len();

            /// All variants, in order.
            pub const ALL: [$key; $key::COUNT] = [$($key::$variant),+];

            /// The name in messages.
            pub const fn name(self) -> &'static str {
                match self {
                    $($key::$variant => $name,)+
                }
            }
        }

        $(#[$map_meta])*
        #[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
        pub struct $map<T>([T; $key::COUNT]);

        impl<T> $map<T> {
            /// A table whose entries are given in the order of the variants.
            pub const fn new(entries: [T; $key::COUNT]) -> $map<T> {
                $map(entries)
            }

            /// A table whose entries `entry` gives.
            pub fn from_fn(entry: impl FnMut($key) -> T) -> $map<T> {
                $map($key::ALL.map(entry))
            }

            /// The entries, in the order of the variants.
            pub fn values(&self) -> std::slice::Iter<'_, T> {
                self.0.iter()
            }

            /// The entries for writing, in the order of the variants.
            pub fn values_mut(&mut self) -> std::slice::IterMut<'_, T> {
                self.0.iter_mut()
            }
        }

        impl<T> std::ops::Index<$key> for $map<T> {
            type Output = T;

            #[inline(always)]
            fn index(&self, key: $key) -> &T {
                &self.0[key as usize]
            }
        }

        impl<T> std::ops::IndexMut<$key> for $map<T> {
            #[inline(always)]
            fn index_mut(&mut self, key: $key) -> &mut T {
                &mut self.0[key as usize]
            }
        }
    };
}
