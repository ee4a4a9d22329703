//! Whatever bytes are given as a capture of a Vulkan program, reading them ends with blocks or a message.

#![no_main]

#[path = "../../crates/gfxr/tests/hostile/oracle.rs"]
mod oracle;

libfuzzer_sys::fuzz_target!(|data: &[u8]| {
    oracle::read_everything(data);
});
