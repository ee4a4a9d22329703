//! Whatever text is given as an experiment, reading and planning it ends with machines or a message.

#![no_main]

#[path = "../../tests/robust/experiments.rs"]
mod oracle;

libfuzzer_sys::fuzz_target!(|data: &[u8]| {
    oracle::plan_everything(data);
});
