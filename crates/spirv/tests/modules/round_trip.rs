//! Generated programs as SPIR-V: naga writes them, and what the engine leaves of the rewritten module is what the oracle leaves of the
//! program's WGSL.

use naga::back::spv;
use naga::proc::{BoundsCheckPolicies, BoundsCheckPolicy};
use shader::{Module, ModuleSource};
use spirv::{Options, Stage, translate};

use crate::differential::{Setting, Verdict, check_module, expect, resolve};
use crate::generate::{Program, Random, generate};

/// Programs of the suite.
const PROGRAMS: u64 = 150;

/// A program's words without constants of the pipeline, as naga writes them.
fn written(program: &Program) -> Option<Vec<u32>> {
    let (module, info) = resolve(program).ok()?;
    // WGSL says what an index out of bounds gives, SPIR-V does not.
    let bounds_check_policies = BoundsCheckPolicies { index: BoundsCheckPolicy::Restrict, ..BoundsCheckPolicies::default() };
    let options = spv::Options {
        bounds_check_policies,
        lang_version: (1, 4),
        flags: spv::WriterFlags::empty(),
        zero_initialize_workgroup_memory: spv::ZeroInitializeWorkgroupMemoryMode::None,
        use_storage_input_output_16: false,
        force_loop_bounding: false,
        ..spv::Options::default()
    };
    spv::write_vec(&module, &info, &options, None).ok()
}

#[test]
fn rewritten_modules_leave_what_the_programs_leave() {
    let (mut same, mut refused, mut unwritten) = (0, 0, 0);
    for seed in 0..PROGRAMS {
        let program = generate(&mut Random::seeded(seed));
        let Ok(expected) = expect(&program) else { continue };
        let words = written(&program);
        // The values of constants are in the words.
        let program = Program { constants: Vec::new(), ..program };
        let Some(words) = words else {
            unwritten += 1;
            continue;
        };
        let stage = match program.stage {
            naga::ShaderStage::Vertex => Stage::Vertex,
            naga::ShaderStage::Fragment => Stage::Fragment,
            _ => Stage::Compute,
        };
        let bytes: Vec<u8> = words.iter().flat_map(|word| word.to_le_bytes()).collect();
        let verdict = |bytes: &[u8]| match Module::new("written", ModuleSource::SpirV(bytes)) {
            Ok(module) => check_module(&module, &program, &expected, &[Setting::USUAL]),
            Err(error) => Verdict::Refused(error.to_string()),
        };
        let direct = verdict(&bytes);
        let translated = match translate(&words, "main", stage, &Options::default()) {
            Ok(translated) => verdict(&translated.bytes()),
            Err(refusal) => Verdict::Refused(refusal.to_string()),
        };
        match (&direct, &translated) {
            (_, Verdict::Same) => same += 1,
            // What naga itself reads otherwise than it wrote it is none of the rewritings.
            (Verdict::Refused(_) | Verdict::Different { .. }, _)
                if std::mem::discriminant(&direct) == std::mem::discriminant(&translated) =>
            {
                refused += 1;
                println!("seed {seed}: {translated:?}");
            }
            _ => panic!("seed {seed}: {translated:?} where the module as it is gives {direct:?}\n{}", program.source),
        }
    }
    println!("{same} the same, {refused} that naga reads otherwise than it writes, {unwritten} that it does not write");
    // The others have arrays of buffers and of images, numbers of 8 bits, dot products of packed numbers, or `frexp`.
    assert!(same * 10 >= PROGRAMS * 7, "{same} of {PROGRAMS} programs are compared");
}
