//! Whatever text is given as a configuration, reading it ends with a configuration or a message.

#![no_main]

#[path = "../../tests/robust/configs.rs"]
mod oracle;

libfuzzer_sys::fuzz_target!(|data: &[u8]| {
    oracle::read_everything(data);
});
