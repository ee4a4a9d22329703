//! Vectors: one source for all hosts. A function that is generic over [`Simd`] takes the token of an instruction set and is compiled for that set
//! where [`dispatch!`] calls it: on x86-64 for AVX2 with what came with it and for SSE2, chosen at run time; on AArch64 for NEON; elsewhere for
//! arrays of lanes.
//!
//! The operations are neither fused nor reordered, and every lane has a defined result, so all sets give the same bits.
//! `RUSTFLAGS="--cfg portable"` builds without the choice: what such a program writes must be the same bytes.

use fearless_simd::Level;
pub use fearless_simd::Simd;
use fearless_simd::prelude::*;

/// The token of the instruction set that every host of the architecture has.
#[cfg(target_arch = "x86_64")]
pub type Base = fearless_simd::Sse2;
/// The token of the instruction set that every host of the architecture has.
#[cfg(target_arch = "aarch64")]
pub type Base = fearless_simd::Neon;
/// The token of the instruction set that every host of the architecture has.
#[cfg(not(any(target_arch = "x86_64", target_arch = "aarch64")))]
pub type Base = fearless_simd::Fallback;

/// The instruction set that this host runs best.
#[derive(Clone, Copy, Debug)]
pub enum Host {
    /// 256 bits.
    #[cfg(target_arch = "x86_64")]
    Wide(fearless_simd::Avx2),
    /// What every host of the architecture has.
    Base(Base),
}

/// The instruction set that this host runs best.
#[inline]
pub fn host() -> Host {
    #[cfg(target_arch = "x86_64")]
    if let Some(simd) = Level::new().as_avx2().filter(|_| cfg!(not(portable))) {
        return Host::Wide(simd);
    }
    Host::Base(base())
}

/// The instruction set that every host of the architecture has.
#[inline]
pub fn base() -> Base {
    let level = Level::baseline();
    #[cfg(target_arch = "x86_64")]
    let base = level.as_sse2();
    #[cfg(target_arch = "aarch64")]
    let base = level.as_neon();
    #[cfg(not(any(target_arch = "x86_64", target_arch = "aarch64")))]
    let base = if let Level::Fallback(simd) = level { Some(simd) } else { None };
    base.expect("part of the architecture")
}

/// Whether bytes of a vector are chosen by those of another in an instruction.
#[inline(always)]
pub fn shuffles_bytes<V: Simd>(simd: V) -> bool {
    #[cfg(target_arch = "x86_64")]
    let shuffles = simd.level().as_avx2().is_some();
    #[cfg(not(target_arch = "x86_64"))]
    let shuffles = !simd.level().is_fallback();
    shuffles
}

/// A closure of vector operations that is called in several places: `inlined(#[inline(always)] |v| v + v)`. Were it left to the compiler to
/// inline it, it could stay a function of its own, which is compiled for the architecture's least instruction set.
#[inline(always)]
pub(crate) fn inlined<A, R, F: Fn(A) -> R>(f: F) -> F {
    f
}

/// The lesser of each pair of lanes; the second where they are equal or one is NaN.
#[inline(always)]
pub(crate) fn least<V: Simd, T: SimdFloat<V>>(a: T, b: T) -> T {
    a.simd_lt(b).select(a, b)
}

/// The greater of each pair of lanes; the second where they are equal or one is NaN.
#[inline(always)]
pub(crate) fn most<V: Simd, T: SimdFloat<V>>(a: T, b: T) -> T {
    a.simd_gt(b).select(a, b)
}

/// Evaluates an expression compiled for the host's instruction set, of which `$simd` is the token:
/// `dispatch!(simd => blocks(simd, triangle))`, where `blocks` is an `#[inline(always)]` function that is generic over [`Simd`].
///
/// To be used once for much work, a tile or a batch: functions below take the token as an argument. One that is not inlined enters the
/// instruction set again with [`Simd::vectorize`].
#[macro_export]
macro_rules! dispatch {
    ($simd:ident => $body:expr) => {
        match $crate::simd::host() {
            #[cfg(target_arch = "x86_64")]
            $crate::simd::Host::Wide($simd) => $crate::simd::Simd::vectorize(
                $simd,
                #[inline(always)]
                || $body,
            ),
            $crate::simd::Host::Base($simd) => $crate::simd::Simd::vectorize(
                $simd,
                #[inline(always)]
                || $body,
            ),
        }
    };
}

/// Defines a function whose loops the compiler vectorises for the host's instruction set. `wide!` takes the function as it would be written,
/// without `self`:
///
/// ```ignore
/// wide! {
///     /// What it does.
///     pub fn name(a: &Lanes, b: &mut Lanes) -> u32 = body;
/// }
/// ```
///
/// where `body` is an `#[inline(always)]` function of the same arguments.
#[macro_export]
macro_rules! wide {
    ($($(#[$doc:meta])* $vis:vis fn $name:ident $([$($generic:tt)*])? ($($arg:ident: $ty:ty),* $(,)?) $(-> $ret:ty)? = $body:expr;)*) => {$(
        $(#[$doc])*
        #[inline]
        $vis fn $name $(<$($generic)*>)? ($($arg: $ty),*) $(-> $ret)? {
            $crate::dispatch!(_simd => $body($($arg),*))
        }
    )*};
}

pub use {dispatch, wide};
