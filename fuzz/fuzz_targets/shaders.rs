//! Whatever bytes are given as a shader module, it is refused with a message or runs a few invocations.

#![no_main]

#[path = "../../tests/robust/shaders.rs"]
mod oracle;

/// The fuzzer's hook ends the process at every panic; those of naga that the library reports as errors are none of ours.
fn let_guarded_panics_pass() {
    let report = std::panic::take_hook();
    std::panic::set_hook(Box::new(move |panic| {
        if !fillrate::host::is_guarded() {
            report(panic);
        }
    }));
}

libfuzzer_sys::fuzz_target!(init: let_guarded_panics_pass(), |data: &[u8]| {
    oracle::run_everything(data);
});
