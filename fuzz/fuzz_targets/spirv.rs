//! Whatever words are given as a SPIR-V module of a Vulkan program, it is refused with its place, or rewritten into words that the engine
//! refuses with a message or compiles.

#![no_main]

use fillrate::shader::{Module, ModuleSource, Options as Compile, Stage as Compiled, compile};
use spirv::{Bias, BoundFormat, Constant, Options, Place, Stage, Swizzle, translate};

/// The fuzzer's hook ends the process at every panic; those of naga that the library reports as errors are none of ours.
fn let_guarded_panics_pass() {
    let report = std::panic::take_hook();
    std::panic::set_hook(Box::new(move |panic| {
        if !fillrate::host::is_guarded() {
            report(panic);
        }
    }));
}

// The first word chooses the stage and what the pipeline says; the module begins behind it.
libfuzzer_sys::fuzz_target!(init: let_guarded_panics_pass(), |data: &[u8]| {
    let mut words = data.chunks_exact(4).map(|word| u32::from_le_bytes([word[0], word[1], word[2], word[3]]));
    let Some(choice) = words.next() else { return };
    let words: Vec<u32> = words.collect();
    let stages = [
        (Stage::Vertex, Compiled::Vertex),
        (Stage::Fragment, Compiled::Fragment),
        (Stage::Compute, Compiled::Compute),
        (Stage::Geometry, Compiled::Vertex),
    ];
    let (stage, compiled) = stages[(choice & 3) as usize];
    let value = (choice >> 8).to_le_bytes();
    let specialization = [0, 1, 2, 3].map(|id| Constant { id, bytes: &value });
    let format = choice >> 16 & 127;
    let formats = [0, 1, 2, 3].map(|binding| BoundFormat { set: 0, binding, format });
    let places = [0, 1, 2, 3].map(|binding| Place { set: 0, binding });
    let channels = [0, 3, 6, 9].map(|bit| choice >> (8 + bit) & 7);
    let element = (choice & 256 != 0).then_some(choice >> 9 & 3);
    let swizzles = places.map(|place| Swizzle { place, element, channels });
    let biases = places.map(|place| Bias { place, element, bias: f32::from_bits(choice) });
    let options = Options {
        specialization: if choice & 4 == 0 { &[] } else { &specialization },
        view_index: Some(choice >> 24),
        base_instance: (choice & 256 != 0).then_some(choice >> 20),
        draw_index: (choice & 512 != 0).then_some(choice >> 28),
        base_workgroup: [0, 10, 20].map(|bit| choice >> bit & 1023),
        flip_y: choice & 8 != 0,
        from_minus_one: choice & 64 != 0,
        each_sample: choice & 128 != 0,
        formats: if choice & 16 == 0 { &[] } else { &formats },
        swizzles: if choice & 32 == 0 { &[] } else { &swizzles },
        biases: if choice & 32 == 0 { &[] } else { &biases },
    };
    let translated = match translate(&words, "main", stage, &options) {
        Ok(translated) => translated,
        Err(refusal) => {
            assert!(!refusal.reason.is_empty() && (refusal.word as usize) < words.len().max(5), "{refusal}");
            return;
        }
    };
    assert!(translated.origins.iter().all(|&(_, origin)| (origin as usize) < words.len()));
    let Ok(module) = Module::new("fuzzed", ModuleSource::SpirV(&translated.bytes())) else { return };
    if let Err(error) = compile(&module, compiled, Some("main"), &Compile::default()) {
        assert!(!error.message.is_empty(), "{error}");
    }
});
