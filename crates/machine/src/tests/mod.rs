//! What can only be seen from inside a machine: each channel in each cycle, and how channels are wired.

mod apply;
mod little;
mod wiring;
