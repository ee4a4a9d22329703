//! Whatever sequence of passes, copies and uploads the bytes choose, every machine shows what functional rendering shows.

#![no_main]

#[path = "../../crates/run/tests/stores/check.rs"]
mod check;
#[path = "../../crates/run/tests/stores/sequence.rs"]
#[allow(dead_code, reason = "the suite makes sequences of numbers, the fuzzer of bytes")]
mod sequence;

thread_local! {
    static MACHINES: check::Machines = check::Machines::new();
}

libfuzzer_sys::fuzz_target!(|data: &[u8]| {
    let sequence = sequence::sequence(&mut sequence::Choices::Bytes(data.iter()));
    MACHINES.with(|machines| machines.check(&sequence, 0, 1).unwrap_or_else(|reason| panic!("{reason}")));
});
