//! Whatever bits a primitive has, clipping, setup and traversal leave finite numbers and no sample hit twice.

#![no_main]

#[path = "../../tests/robust/raster.rs"]
mod oracle;

libfuzzer_sys::fuzz_target!(|data: &[u8]| {
    oracle::draw_everything(data);
});
