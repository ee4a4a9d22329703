//! Whatever bytes are given as a shader module, it is refused with a message or runs a few invocations.

#![no_main]

#[path = "../../tests/fuzz/shaders.rs"]
mod oracle;

libfuzzer_sys::fuzz_target!(|data: &[u8]| {
    oracle::run_everything(data);
});
