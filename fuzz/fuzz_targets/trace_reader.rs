//! Whatever bytes are given as a trace, reading and checking them ends with a trace or a message.

#![no_main]

#[path = "../../crates/trace/tests/trace/oracle.rs"]
mod oracle;

libfuzzer_sys::fuzz_target!(|data: &[u8]| {
    oracle::read_everything(data);
});
