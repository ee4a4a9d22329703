//! Whatever choices the bytes make, the program that the generator makes of them leaves the same in the engine and in the oracle.

#![no_main]

#[path = "../../crates/shader/tests/shaders/differential.rs"]
#[allow(dead_code, reason = "the suite shrinks programs, the fuzzer shrinks bytes")]
mod differential;
#[path = "../../crates/shader/tests/shaders/generate/mod.rs"]
#[allow(dead_code, reason = "the suite makes programs of numbers, the fuzzer of bytes")]
mod generate;
#[path = "../../crates/shader/tests/shaders/oracle/mod.rs"]
mod oracle;

use differential::{Setting, Verdict, check};
use generate::{Random, generate};

libfuzzer_sys::fuzz_target!(|data: &[u8]| {
    let program = generate(&mut Random::from_bytes(data));
    // Each input has settings of its own, the same in every run.
    let turn = data.iter().fold(0u64, |sum, &byte| sum.wrapping_mul(31).wrapping_add(u64::from(byte))) >> 3;
    if let Verdict::Different { setting, what } = check(&program, &Setting::of(turn)) {
        panic!("{what}; {setting:?}\n{}", program.source);
    }
});
