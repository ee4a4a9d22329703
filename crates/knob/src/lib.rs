//! Floor 1: declaring knobs. A unit's configuration is a struct declared with [`knobs!`](crate::knobs), once, with unit, allowed values
//! and source. The reader, the messages, the resolved text and the documentation all come from that declaration.
//!
//! Beside the unit that it configures, a knob has three more readers: estimates of cycles, experiments that find out what holds a machine
//! back, and the advice on a page. The declaration says what each of them does with the knob. It does not compile otherwise.
//!
//! ```
//! use knob::{Allowed, Section, Setting};
//!
//! knob::knobs! {
//!     /// A queue.
//!     pub struct QueueConfig {
//!         /// Items that the queue holds.
//!         capacity: u32 ["items", Allowed::PowerOfTwo(1, 64), "assumed"] {estimate: Used, relax: Room, advice: []},
//!     }
//! }
//!
//! let mut queue = QueueConfig::default();
//! assert!(queue.set("capacity", &Setting::Number(16)) && queue.capacity == 16);
//! // A value outside of the range is refused, and the message follows from the declaration.
//! assert!(!queue.set("capacity", &Setting::Number(17)));
//! assert_eq!(QueueConfig::KNOBS[0].allowed.to_string(), "a power of two from 1 to 64");
//! ```

use std::fmt;

/// What values a knob takes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Allowed {
    /// Whole numbers from the first to the second.
    Range(u64, u64),
    /// Powers of two from the first to the second.
    PowerOfTwo(u64, u64),
    /// `true` or `false`.
    Switch,
    /// One of these names, in quotes.
    Choice(&'static [&'static str]),
}

impl fmt::Display for Allowed {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Allowed::Range(low, high) => write!(f, "a whole number from {low} to {high}"),
            Allowed::PowerOfTwo(low, high) => write!(f, "a power of two from {low} to {high}"),
            Allowed::Switch => write!(f, "true or false"),
            Allowed::Choice(names) => {
                write!(f, "one of ")?;
                for (i, name) in names.iter().enumerate() {
                    write!(f, "{}\"{name}\"", if i == 0 { "" } else { ", " })?;
                }
                Ok(())
            }
        }
    }
}

/// Values of a knob.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Values {
    /// One of these, written without quotes.
    Is(&'static [&'static str]),
    /// This number and larger ones.
    AtLeast(u64),
    /// This number and smaller ones.
    AtMost(u64),
    /// The first number, the second, and those between.
    Between(u64, u64),
}

impl Values {
    /// Whether a value is one of these.
    pub fn contain(self, setting: &Setting) -> bool {
        match (self, setting) {
            (Values::Is(values), setting) => values.iter().any(|&value| Setting::from(value) == *setting),
            (Values::AtLeast(least), Setting::Number(number)) => *number >= least,
            (Values::AtMost(most), Setting::Number(number)) => *number <= most,
            (Values::Between(least, most), Setting::Number(number)) => (least..=most).contains(number),
            (Values::AtLeast(_) | Values::AtMost(_) | Values::Between(..), _) => false,
        }
    }
}

impl fmt::Display for Values {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Values::Is(values) => write!(f, "{}", values.join(" or ")),
            Values::AtLeast(least) => write!(f, "{least} or more"),
            Values::AtMost(most) => write!(f, "{most} or less"),
            Values::Between(least, most) => write!(f, "{least} to {most}"),
        }
    }
}

/// What an estimate of cycles does with a knob.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Estimate {
    /// It reads the knob.
    Used,
    /// It calls this function, which reads the knob.
    UsedBy(&'static str),
    /// It does not read the knob, for this reason.
    Ignored(&'static str),
    /// It holds for these values of the knob, and a machine with another value is refused. The text names what such a machine has that is
    /// not estimated.
    RefusedUnless(Values, &'static str),
}

/// How an experiment gives a machine more of the resource that a knob limits.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Relax {
    /// It does not change the knob.
    Never,
    /// A number of items or bytes per cycle, which it doubles with all others of the section.
    Rate,
    /// The cycles of one item, which it halves with all others of the section.
    Interval,
    /// Room for what is in flight, which it doubles with all other room of the section.
    Room,
    /// The size of a cache, which it doubles, and then multiplies until the cache is never full.
    Cache,
    /// A latency, which it halves with all others.
    Latency,
    /// A wait between items of work, which it halves. The text is the experiment's title.
    Wait(&'static str),
    /// A number of units, which it doubles. The text is the experiment's title.
    Units(&'static str),
    /// A number of channels, or of bytes per cycle, that a memory has: it doubles the memory's bandwidth with it.
    Bandwidth,
    /// The size of the parts in which work is dealt, which it divides by 2 and by 8. The text names the parts.
    Parts(&'static str),
    /// One of several names, each of which it tries. The text comes before the name in the experiment's title.
    Each(&'static str),
    /// A switch that leaves work out. It tries each of these values, which have the titles of the experiments beside them.
    Skip(&'static [(&'static str, &'static str)]),
}

/// A finding in the statistics of a frame for which a page advises to change knobs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Advice {
    /// Few lookups hit in the cache of this name in the statistics.
    Cache(&'static str),
    /// Many shaded fragments fail their depth tests.
    LateFailures,
    /// Much more is covered than written, and nothing is hidden before shading.
    NothingHidden,
    /// The busiest pipeline has more to do than the mean.
    Imbalance,
    /// Scan-out takes a large share of the cycles.
    ScanOut,
    /// Uploads and copies take a large share of the cycles.
    Transfers,
}

/// What one knob is.
#[derive(Clone, Copy, Debug)]
pub struct Knob {
    /// Its key in its section.
    pub name: &'static str,
    /// What it does.
    pub meaning: &'static str,
    /// What its value counts.
    pub unit: &'static str,
    /// Which values it takes.
    pub allowed: Allowed,
    /// Where the baseline's value comes from.
    pub source: &'static str,
    /// What an estimate does with it.
    pub estimate: Estimate,
    /// How an experiment changes it.
    pub relax: Relax,
    /// The advice that it belongs to.
    pub advice: &'static [Advice],
}

impl Knob {
    /// Its path, if it is in a section of this path. The outermost section has none.
    pub fn path(&self, section: &str) -> String {
        if section.is_empty() { self.name.to_owned() } else { format!("{section}.{}", self.name) }
    }
}

/// The value of a knob as written: what all configuration texts are made of.
#[derive(Clone, Debug, PartialEq)]
pub enum Setting {
    /// A whole number.
    Number(u64),
    /// A truth value.
    Switch(bool),
    /// A name in quotes.
    Name(String),
}

impl fmt::Display for Setting {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Setting::Number(value) => write!(f, "{value}"),
            Setting::Switch(value) => write!(f, "{value}"),
            Setting::Name(name) => write!(f, "\"{name}\""),
        }
    }
}

impl From<&str> for Setting {
    /// What is written without quotes.
    fn from(text: &str) -> Setting {
        match (text, text.parse()) {
            ("true", _) => Setting::Switch(true),
            ("false", _) => Setting::Switch(false),
            (_, Ok(number)) => Setting::Number(number),
            (name, Err(_)) => Setting::Name(name.to_owned()),
        }
    }
}

/// A type that a knob can have.
pub trait Value: Sized {
    /// From what is written, which [`Allowed::admits`] has let through.
    fn from_setting(setting: &Setting) -> Option<Self>;

    /// As it is written.
    fn to_setting(&self) -> Setting;
}

impl Value for u32 {
    fn from_setting(setting: &Setting) -> Option<u32> {
        match setting {
            Setting::Number(value) => u32::try_from(*value).ok(),
            _ => None,
        }
    }

    fn to_setting(&self) -> Setting {
        Setting::Number(u64::from(*self))
    }
}

impl Value for bool {
    fn from_setting(setting: &Setting) -> Option<bool> {
        match setting {
            Setting::Switch(value) => Some(*value),
            _ => None,
        }
    }

    fn to_setting(&self) -> Setting {
        Setting::Switch(*self)
    }
}

impl Allowed {
    /// Whether a value is one of those allowed.
    pub fn admits(&self, setting: &Setting) -> bool {
        match (self, setting) {
            (Allowed::Range(low, high), Setting::Number(value)) => (low..=high).contains(&value),
            (Allowed::PowerOfTwo(low, high), Setting::Number(value)) => {
                value.is_power_of_two() && (low..=high).contains(&value)
            }
            (Allowed::Switch, Setting::Switch(_)) => true,
            (Allowed::Choice(names), Setting::Name(name)) => names.contains(&name.as_str()),
            _ => false,
        }
    }
}

/// A group of knobs under one path of a configuration.
pub trait Section {
    /// The knobs, in order.
    fn knobs(&self) -> &'static [Knob];

    /// What the section configures.
    fn about(&self) -> &'static str;

    /// Sets one; false when there is no such knob or it does not take this value.
    fn set(&mut self, name: &str, setting: &Setting) -> bool;

    /// Reads one.
    fn get(&self, name: &str) -> Option<Setting>;
}

/// Declares an enumeration that a knob chooses from, with the names used in configurations.
#[macro_export]
macro_rules! choices {
    ($(#[$meta:meta])* $vis:vis enum $name:ident { $($(#[doc = $doc:literal])+ $variant:ident $text:literal),* $(,)? }) => {
        $(#[$meta])*
        #[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
        $vis enum $name { #[default] $($(#[doc = $doc])+ $variant,)* }

        impl $name {
            /// The names, in order.
            pub const NAMES: &'static [&'static str] = &[$($text),*];

            /// Its name.
            pub const fn name(self) -> &'static str {
                match self { $($name::$variant => $text,)* }
            }
        }

        impl $crate::Value for $name {
            fn from_setting(setting: &$crate::Setting) -> Option<Self> {
                match setting {
                    $($crate::Setting::Name(name) if name == $text => Some($name::$variant),)*
                    _ => None,
                }
            }

            fn to_setting(&self) -> $crate::Setting {
                $crate::Setting::Name(self.name().to_owned())
            }
        }
    };
}

/// Declares a section of knobs. The braces have the names of [`Estimate`], [`Values`], [`Relax`] and [`Advice`] in scope:
///
/// ```
/// knob::knobs! {
///     /// A unit that counts.
///     pub struct CounterConfig {
///         /// Items counted per cycle.
///         rate: u32 ["items/cycle", knob::Allowed::Range(1, 8), "made up"] {estimate: Used, relax: Rate, advice: []},
///         /// Items that wait.
///         queue: u32 ["items", knob::Allowed::Range(1, 64), "made up"]
///             {estimate: RefusedUnless(AtLeast(4), "short queues"), relax: Room, advice: []},
///     }
/// }
/// use knob::{Estimate, Section, Setting};
/// let mut config = CounterConfig::default();
/// assert!(config.set("rate", &Setting::Number(3)) && config.rate == 3);
/// assert!(!config.set("rate", &Setting::Number(9)) && !config.set("speed", &Setting::Number(3)));
/// assert_eq!(config.knobs()[0].estimate, Estimate::Used);
/// ```
///
/// A knob that does not answer to estimates, experiments and advice does not compile:
///
/// ```compile_fail
/// knob::knobs! {
///     /// A unit that counts.
///     pub struct CounterConfig {
///         /// Items counted per cycle.
///         rate: u32 ["items/cycle", knob::Allowed::Range(1, 8), "made up"],
///     }
/// }
/// ```
#[macro_export]
macro_rules! knobs {
    ($(#[doc = $about:literal])+ $(#[derive($more:ident)])? $vis:vis struct $name:ident {
        $($(#[doc = $doc:literal])+ $field:ident: $type:ty [$unit:expr, $allowed:expr, $source:expr]
            {estimate: $estimate:expr, relax: $relax:expr, advice: [$($advice:expr),*]}),* $(,)?
    }) => {
        $(#[doc = $about])+
        #[derive(Clone, Debug, Default, PartialEq $(, $more)?)]
        $vis struct $name {
            $($(#[doc = $doc])+ pub $field: $type,)*
        }

        impl $name {
            /// The declarations.
            pub const KNOBS: &'static [$crate::Knob] = &[
                $($crate::Knob {
                    name: stringify!($field),
                    meaning: concat!($($doc),+).trim_ascii(),
                    unit: $unit,
                    allowed: $allowed,
                    source: $source,
                    estimate: {
                        #[allow(unused_imports, reason = "most declarations need some of the names")]
                        use $crate::{Estimate::*, Values::*};
                        $estimate
                    },
                    relax: {
                        use $crate::Relax::*;
                        $relax
                    },
                    advice: {
                        #[allow(unused_imports, reason = "most knobs belong to no advice")]
                        use $crate::Advice::*;
                        &[$($advice),*]
                    },
                },)*
            ];
        }

        impl $crate::Section for $name {
            fn knobs(&self) -> &'static [$crate::Knob] {
                Self::KNOBS
            }

            fn about(&self) -> &'static str {
                concat!($($about),+).trim_ascii()
            }

            fn set(&mut self, name: &str, setting: &$crate::Setting) -> bool {
                use $crate::Value;
                let Some(knob) = Self::KNOBS.iter().find(|knob| knob.name == name) else { return false };
                if !knob.allowed.admits(setting) {
                    return false;
                }
                match name {
                    $(stringify!($field) => match <$type as Value>::from_setting(setting) {
                        Some(value) => self.$field = value,
                        None => return false,
                    },)*
                    _ => return false,
                }
                true
            }

            fn get(&self, name: &str) -> Option<$crate::Setting> {
                use $crate::Value;
                match name {
                    $(stringify!($field) => Some(self.$field.to_setting()),)*
                    _ => None,
                }
            }
        }
    };
}
