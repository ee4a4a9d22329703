//! Traces: written, read, checked, damaged, and those that the repository keeps.

mod check;
mod fuzz;
mod oracle;
mod read;
mod write;
