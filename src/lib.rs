//! Fillrate replays recorded command traces on a cycle-approximate model of a graphics card.
//!
//! Floors, each importing only floors below; within a floor a module imports those listed before it:
//!
//! | floor | modules |
//! |---|---|
//! | 0 | [`num`], [`host`] |
//! | 1 | [`gfx`], [`trace`], [`stats`], [`sim`] |
//! | 2 | [`shader`], [`mem`], [`work`], [`import`] |
//! | 3 | [`render`], [`mod@unit`] |
//! | 4 | [`machine`] |
//! | 5 | [`run`], [`report`] |
//! | 6 | [`accuracy`] |
//! | 7 | [`cli`] |

pub mod host;
pub mod num;

pub mod gfx;
pub mod sim;
pub mod stats;
pub mod trace;

pub mod import;
pub mod mem;
pub mod shader;
pub mod work;

pub mod render;
pub mod unit;

pub mod machine;

pub mod report;
pub mod run;

pub mod accuracy;

pub mod cli;
