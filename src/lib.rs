//! Fillrate replays recorded command traces on a cycle-approximate model of a graphics card.
//!
//! Floors, each a package or module that depends only on floors below:
//!
//! | floor | packages (`crates/`), modules of this library |
//! |---|---|
//! | 0 | [`num`], [`host`] |
//! | 1 | [`gfx`], [`trace`], [`knob`], [`stats`], [`sim`] |
//! | 2 | [`work`], [`shader`], [`mem`], [`import`] |
//! | 3 | [`render`], [`mod@unit`], [`synthetic`], [`picture`] |
//! | 4 | [`machine`] |
//! | 5 | [`run`] |
//! | 6 | [`accuracy`], [`rows`] |
//! | 7 | [`report`] |
//! | 8 | [`sweep`], [`why`](mod@why) |
//! | 9 | [`cli`] |

pub use {
    accuracy, gfx, host, import, knob, machine, mem, num, picture, render, rows, run, shader, sim, stats, synthetic, trace,
    unit, work,
};

pub mod report;

pub mod sweep;
pub mod why;

pub mod cli;
