//! Shader programs run by the engine and by an oracle: a plain interpreter of naga's IR that shares no code with the compiler.

mod corners;
mod differential;
mod generate;
mod layouts;
mod loops;
mod oracle;
mod oracle_tests;
mod refusals;
mod suite;
mod trees;
mod valid;
