//! Floor 1: traces: commands, reader, writer, check. Versioned.

pub mod command;
