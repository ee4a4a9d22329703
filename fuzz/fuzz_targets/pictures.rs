//! Whatever bytes are given as a picture, reading them ends with a picture of as many pixels as are allowed, or with a message.

#![no_main]

#[path = "../../tests/robust/pictures.rs"]
mod oracle;

libfuzzer_sys::fuzz_target!(|data: &[u8]| {
    oracle::read_everything(data);
});
