//! Whatever text is given as a small trace, it is refused with a message or runs to its end.

#![no_main]

#[path = "../../tests/robust/replays.rs"]
mod oracle;

thread_local! {
    static SMALL: oracle::Small = oracle::Small::new();
}

libfuzzer_sys::fuzz_target!(|data: &[u8]| {
    SMALL.with(|small| {
        small.replay(data);
    });
});
