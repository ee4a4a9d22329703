//! Compiling a function twice: for the host's baseline and for AVX2, chosen at run time.
//!
//! The bodies are the same Rust without fused or reordered arithmetic, so both give the same bits; only the width of the
//! vectors differs. `RUSTFLAGS="--cfg portable"` builds without the choice: what such a program writes must be the same bytes.

#[cfg(target_arch = "x86_64")]
use std::sync::atomic::{AtomicU8, Ordering::Relaxed};

/// Whether the host has all of these instruction sets, and the build has not left them out.
#[macro_export]
macro_rules! host_has {
    ($($set:tt),+) => { cfg!(not(portable)) $(&& std::arch::is_x86_feature_detected!($set))+ };
}

/// Whether the host has AVX2 and what came with it.
#[cfg(target_arch = "x86_64")]
#[inline(always)]
pub fn has_avx2() -> bool {
    // Asked once for each batch: the five questions are put together.
    match AVX2.load(Relaxed) {
        0 => find_avx2(),
        known => known == 2,
    }
}

/// 2 if the host has AVX2 and what came with it, 1 if not, 0 before that was asked.
#[cfg(target_arch = "x86_64")]
static AVX2: AtomicU8 = AtomicU8::new(0);

#[cfg(target_arch = "x86_64")]
#[cold]
fn find_avx2() -> bool {
    let has = host_has!("avx2", "bmi1", "bmi2", "lzcnt", "popcnt");
    AVX2.store(if has { 2 } else { 1 }, Relaxed);
    has
}

/// Defines a function whose body is compiled twice. `wide!` takes the function as it would be written, without `self`:
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
            #[cfg(target_arch = "x86_64")]
            {
                #[target_feature(enable = "avx2")]
                fn vectors $(<$($generic)*>)? ($($arg: $ty),*) $(-> $ret)? {
                    $body($($arg),*)
                }
                if $crate::host_has!("avx2") {
                    // SAFETY: the host has AVX2, which is all that the function requires.
                    return unsafe { vectors($($arg),*) };
                }
            }
            $body($($arg),*)
        }
    )*};
}

pub use {host_has, wide};
