//! Hostile input, made by rule: one form for each production of a language, of any size. The tests of this folder and the seeds of the fuzz
//! targets use them.

pub mod binary;
pub mod calls;
pub mod glsl;
pub mod grammar;
pub mod ron;
pub mod wgsl;
pub mod work;

/// The name of a form, and a function that writes a text of it of a given size.
pub type TextForm = (&'static str, fn(usize) -> String);

/// Joins `n` lines.
fn lines(n: usize, line: impl Fn(usize) -> String) -> String {
    (0..n).map(line).collect::<Vec<_>>().join("\n")
}

/// `n` times `open`, the middle, `n` times `close`.
fn nested(open: &str, middle: &str, close: &str, n: usize) -> String {
    format!("{}{middle}{}", open.repeat(n), close.repeat(n))
}
