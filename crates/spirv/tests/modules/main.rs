//! Rewritten modules on the shader engine: what each rewriting leaves, and which recorded modules are accepted.

mod assembler;
mod buffers;
mod engine;
mod images;
mod interface;
mod peers;
mod round_trip;
mod specialization;

#[path = "../../../shader/tests/shaders/differential.rs"]
#[allow(dead_code, reason = "the suite of the engine compares WGSL")]
mod differential;
#[path = "../../../shader/tests/shaders/generate/mod.rs"]
#[allow(dead_code, reason = "the fuzzer makes programs of bytes")]
mod generate;
#[path = "../../../shader/tests/shaders/oracle/mod.rs"]
mod oracle;
