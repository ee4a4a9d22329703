//! Whole modules: other sources, refusals with their place, the recorded traces' shaders.

use super::*;

#[track_caller]
fn refused(source: &str, stage: Stage) -> ShaderError {
    match Module::new("bad.wgsl", ModuleSource::Wgsl(source)) {
        Err(e) => e,
        Ok(m) => compile(&m, stage, None, &Options::default()).expect_err("it must be refused"),
    }
}

#[test]
fn errors_name_module_entry_and_place() {
    let e = refused("@fragment fn fs() -> @location(0) vec4f {\n  return vec4f(1.0) + 1u;\n}", Stage::Fragment);
    assert_eq!(e.place.and_then(ShaderLocation::line), Some(2));
    assert!(e.to_string().starts_with("shader `bad.wgsl`"), "{e}");
    let e = refused("fn f( {", Stage::Fragment);
    assert!(e.place.is_some(), "{e}");
    let e = refused("@compute @workgroup_size(1) fn main() { var x = 1.0lf; }", Stage::Compute);
    assert_eq!(e.message, "64-bit floating-point numbers (feature SHADER_F64) are not supported");
    let e = refused("@vertex fn vs() -> @builtin(position) vec4f { return vec4f(); }", Stage::Fragment);
    assert!(e.to_string().contains("no such entry point"), "{e}");
    let two = "@compute @workgroup_size(1) fn a() {} @compute @workgroup_size(1) fn b() {}";
    assert!(refused(two, Stage::Compute).to_string().contains("several"));
}

/// Numbers of other widths are named with wgpu's feature, where they stand first.
#[test]
fn numbers_that_are_not_supported_are_named_as_features() {
    let compute =
        |body: &str| format!("fn f(x: f32) -> f32 {{ return x; }}\n@compute @workgroup_size(1) fn main() {{\n  {body}\n}}");
    let (int64, float64) = ("64-bit integers (feature SHADER_INT64)", "64-bit floating-point numbers (feature SHADER_F64)");
    let cases = [
        (compute("let a = f(2.0); let b = u64(a);"), int64, (3, 27)),
        (compute("var a: i64;"), int64, (3, 7)),
        (compute("let a = 5li + 1li;"), int64, (3, 11)),
        (compute("var a = vec3<u64>();"), int64, (3, 7)),
        (compute("var a = array<array<i64, 2>, 3>();"), int64, (3, 7)),
        (compute("let a = f64(f(1.0)) * 2.0lf;"), float64, (3, 11)),
        (compute("var a: mat2x2<f64>;"), float64, (3, 7)),
        (
            "struct S { a: u32, b: u64 }\n@group(0) @binding(0) var<storage> s: S;\n".to_owned() + &compute("let a = s.a;"),
            int64,
            (1, 1),
        ),
        ("\n@group(0) @binding(0) var<storage> s: array<f64>;\n".to_owned() + &compute("let a = s[0];"), float64, (2, 1)),
        ("\noverride o: f64 = 1.0lf;\n".to_owned() + &compute(""), float64, (2, 1)),
        ("fn g(x: u64) -> u32 { return 1u; }\n".to_owned() + &compute(""), int64, (1, 1)),
    ];
    for (source, numbers, (line, column)) in cases {
        let error = Module::new("wide.wgsl", ModuleSource::Wgsl(&source)).expect_err(&source);
        assert_eq!(error.message, format!("{numbers} are not supported"), "{source}");
        let Some(ShaderLocation::Text { line: l, column: c }) = error.place else { panic!("{source}: {error}") };
        // naga's spans begin at the declared name, or at the keyword in front of it.
        assert!(l == line && c.abs_diff(column) <= 23, "{source}: {error}");
    }
    let short = Module::new("short.wgsl", ModuleSource::Wgsl("enable wgpu_int16;\n")).expect_err("refused");
    assert_eq!(short.to_string(), "shader `short.wgsl`, 1:8: 16-bit integers (feature SHADER_I16) are not supported");
}

/// The same program from WGSL, from SPIR-V and from naga's IR gives the same results.
#[test]
fn all_sources_agree() {
    let source = "
        struct Item { a: u32, b: vec2f }
        @group(0) @binding(0) var<storage, read_write> result: array<u32>;
        @group(0) @binding(1) var<storage, read> input: array<u32>;
        fn f(x: u32) -> u32 {
            switch (x % 5u) { case 0u: { return x * 2u; } case 1u, 3u: { return x + 9u; } default: {} }
            var sum = 0u;
            for (var k = 0u; k < x; k++) { if (k == 7u) { continue; } sum += k; if (sum > 300u) { break; } }
            return sum;
        }
        @compute @workgroup_size(64) fn main(@builtin(global_invocation_id) id: vec3u) {
            var item = Item(f(input[id.x]), vec2f(f32(id.x), 0.5));
            item.b.y *= item.b.x;
            result[id.x] = item.a * 1000u + u32(item.b.y * 4.0);
        }";
    let module = naga::front::wgsl::parse_str(source).expect("parses");
    let info = naga::valid::Validator::new(naga::valid::ValidationFlags::all(), naga::valid::Capabilities::empty())
        .validate(&module)
        .expect("valid");
    let words = naga::back::spv::write_vec(&module, &info, &naga::back::spv::Options::default(), None).expect("written");
    let spirv: Vec<u8> = words.iter().flat_map(|w| w.to_le_bytes()).collect();
    let ron = ron::to_string(&module).expect("a module is text");
    // A call (of code 57 and, with one argument, five words) of a function that is not there is refused by its number.
    let mut broken = words.clone();
    let call = broken.iter().position(|&word| word == 5 << 16 | 57).expect("a call with one argument");
    broken[call + 3] = 4321;
    let broken: Vec<u8> = broken.iter().flat_map(|w| w.to_le_bytes()).collect();
    let error = Module::new("bad.spv", ModuleSource::SpirV(&broken)).expect_err("refused");
    assert!(error.to_string().contains("a call of %4321"), "{error}");
    assert_eq!(error.place, Some(ShaderLocation::Word(call as u32)));
    let mut results = Vec::new();
    for source in [ModuleSource::Wgsl(source), ModuleSource::SpirV(&spirv), ModuleSource::NagaIr(&ron)] {
        let module = Module::new("test", source).unwrap_or_else(|e| panic!("{e}"));
        let p = compile(&module, Stage::Compute, Some("main"), &Options::default()).unwrap_or_else(|e| panic!("{e}"));
        let out = Words::new(256);
        let input = words_of(&(0..64).collect::<Vec<_>>());
        run_with(&p, [1, 1, 1], &[(0, &out), (1, &input)]);
        results.push(out.to_vec());
    }
    assert!(results[0].iter().any(|&b| b != 0));
    assert_eq!(results[0], results[1], "SPIR-V");
    assert_eq!(results[0], results[2], "naga IR");
}

/// naga's form of a text, and what it is as SPIR-V.
fn forms(source: &str) -> (naga::Module, Vec<u32>) {
    let module = naga::front::wgsl::parse_str(source).expect("parses");
    let mut validator = naga::valid::Validator::new(naga::valid::ValidationFlags::all(), naga::valid::Capabilities::empty());
    let info = validator.validate(&module).expect("valid");
    let words = naga::back::spv::write_vec(&module, &info, &naga::back::spv::Options::default(), None).expect("written");
    (module, words)
}

fn spirv_error(words: &[u32]) -> ShaderError {
    let bytes: Vec<u8> = words.iter().flat_map(|w| w.to_le_bytes()).collect();
    Module::new("bad.spv", ModuleSource::SpirV(&bytes)).expect_err("refused")
}

#[test]
fn errors_of_spirv_name_the_word() {
    let (_, words) = forms(
        "@group(0) @binding(0) var<storage, read_write> b: array<u32>;
        @compute @workgroup_size(1) fn main() { var x = b[0]; loop { x += 1u; if (x == 3u) { break; } } b[1] = x; }",
    );
    // The first sum, whose code no instruction has, whose operand nothing defines, and at whose second word the file ends.
    let sum = words.iter().position(|&word| word == 5 << 16 | 128).expect("a sum");
    let with =
        |at: usize, word: u32| words.iter().enumerate().map(|(i, &w)| if i == at { word } else { w }).collect::<Vec<u32>>();
    for broken in [with(sum, 5 << 16 | 0xfff0), with(sum + 3, 4321), words[..sum + 2].to_vec()] {
        let error = spirv_error(&broken);
        assert!(error.to_string().starts_with(&format!("shader `bad.spv`, word {sum}: ")), "{error}");
    }
    // What naga's validation finds: a workgroup of no invocation.
    let size = words.windows(3).position(|w| w[0] == 6 << 16 | 16 && w[2] == 17).expect("a size");
    let error = spirv_error(&with(size + 3, 0));
    assert!(error.to_string().contains("main"), "{error}");
    // A loop that does not end is named by its place when it runs.
    let bytes: Vec<u8> = words.iter().flat_map(|w| w.to_le_bytes()).collect();
    let limits = Limits { work_loop_turns: Limits::default().work_loop_turns.with(1), ..Limits::default() };
    let module = Module::with_limits("good.spv", ModuleSource::SpirV(&bytes), &limits).expect("valid");
    let program = compile(&module, Stage::Compute, Some("main"), &Options::default()).expect("compiles");
    let words = Words::new(8);
    let resources = [vec![Resource::Buffer(BufferRange { words: &words, offset: 0, size: 8, address: 0 })]];
    let resources = Resources { bindings: &resources, ..Resources::default() };
    let uniforms = program.uniforms(&resources);
    let mut executor = Executor::new();
    let fault = executor.bind(&program, &resources, &uniforms).run_groups(0..1, [1; 3], None).expect_err("too many turns");
    assert!(fault.to_string().starts_with("shader `good.spv`, entry point `main`, word "), "{fault}");
}

#[test]
fn errors_of_naga_ir_name_the_place_or_the_handle() {
    let error = Module::new("bad.ron", ModuleSource::NagaIr("(\n  types: [7])")).expect_err("refused");
    assert!(error.to_string().starts_with("shader `bad.ron`, 2:"), "{error}");
    let limits = Limits { shader_nesting: Limits::default().shader_nesting.with(3), ..Limits::default() };
    let refused = |source: &str| {
        let ron = ron::to_string(&forms(source).0).expect("a module is text");
        Module::with_limits("deep.ron", ModuleSource::NagaIr(&ron), &limits).expect_err("too deep").to_string()
    };
    let text = refused("@compute @workgroup_size(1) fn main() { if true { if true { if true { return; } } } }");
    assert!(text.starts_with("shader `deep.ron`: entry point `main`: 4 levels of nesting"), "{text}");
    let text =
        refused("fn deep() { if true { if true { if true { return; } } } } @compute @workgroup_size(1) fn main() { deep(); }");
    assert!(text.starts_with("shader `deep.ron`: function [0] `deep`: 4 levels of nesting"), "{text}");
    let text = refused("var<private> a: array<array<array<f32, 1>, 1>, 1>; @compute @workgroup_size(1) fn main() { }");
    assert!(text.starts_with("shader `deep.ron`: type [3]: 4 levels of nesting"), "{text}");
}

/// naga computes what depends on a pipeline constant without a look at types, and writes zero values out for it.
#[test]
fn operators_on_long_zero_values_are_refused_in_nagas_form() {
    let source = "override o: u32 = 1; override p: u32 = o + 2; var<private> z: array<u32, LENGTH>;
        @compute @workgroup_size(1) fn main() { z[0] = p; }";
    let of = |length: &str| {
        let mut module = naga::front::wgsl::parse_str(&source.replace("LENGTH", length)).expect("parses");
        let (array, _) =
            module.types.iter().find(|(_, ty)| matches!(ty.inner, naga::TypeInner::Array { .. })).expect("an array");
        let (two, _) = module
            .global_expressions
            .iter()
            .find(|(_, e)| matches!(e, naga::Expression::Literal(naga::Literal::U32(2))))
            .expect("2");
        module.global_expressions[two] = naga::Expression::ZeroValue(array);
        let ron = ron::to_string(&module).expect("a module is text");
        let module = Module::new("zero.ron", ModuleSource::NagaIr(&ron))?;
        compile(&module, Stage::Compute, None, &Options::default())
    };
    let text = of("500000000").expect_err("too long").to_string();
    assert!(text.contains("constant expression [") && text.contains("shader.constants"), "{text}");
    // No operator takes an array, but a short one costs nothing.
    let text = of("50").expect_err("no sum").to_string();
    assert!(!text.contains("shader.constants"), "{text}");
}

#[test]
fn damaged_input_is_refused() {
    assert!(Module::new("x", ModuleSource::SpirV(&[1, 2, 3])).is_err());
    assert!(Module::new("x", ModuleSource::SpirV(&[3, 2, 0x23, 7, 0, 0, 1, 0])).is_err());
    assert!(Module::new("x", ModuleSource::NagaIr("(types: [")).is_err());
    assert!(Module::new("x", ModuleSource::Wgsl("\u{0}\u{ffff}")).is_err());
}

#[test]
fn interfaces_are_reflected() {
    let source = "
        struct U { a: vec3f, b: mat4x4f }
        @group(2) @binding(1) var<uniform> u: U;
        @group(0) @binding(4) var<storage, read> list: array<vec4f>;
        @group(0) @binding(2) var tex: texture_depth_2d_array;
        @group(0) @binding(3) var cmp: sampler_comparison;
        @group(0) @binding(9) var<storage, read> unused: array<u32>;
        struct In { @builtin(position) p: vec4f, @location(2) @interpolate(flat) k: u32, @location(1) @interpolate(linear, sample) l: vec2f, @builtin(sample_index) s: u32 }
        struct Out { @location(1) c: vec4f, @builtin(frag_depth) d: f32, @builtin(sample_mask) m: u32 }
        @fragment fn fs(in: In) -> Out {
            let x = textureSampleCompareLevel(tex, cmp, in.l, 1, 0.5);
            return Out(list[in.k] * u.b[1] + x, in.p.z, in.s);
        }";
    let module = Module::new("test", ModuleSource::Wgsl(source)).expect("valid");
    let p = compile(&module, Stage::Fragment, Some("fs"), &Options::default()).expect("compiles");
    let i = p.interface();
    let places: Vec<_> = i.bindings.iter().map(|b| (b.group, b.binding)).collect();
    assert_eq!(places, [(0, 2), (0, 3), (0, 4), (2, 1)]);
    assert_eq!(i.bindings[2].kind, BindingKind::Storage { min_size: 16, writable: false });
    assert_eq!(i.bindings[3].kind, BindingKind::Uniform { min_size: 80 });
    assert_eq!(i.bindings[1].kind, BindingKind::Sampler { comparison: true });
    assert!(i.per_sample && i.writes_sample_mask && i.writes_depth == Some(DepthPromise::Any));
    let flat = i.inputs.iter().find(|slot| slot.location() == Some(2)).expect("input");
    assert!(matches!(flat.connection, Connection::Location { interpolation: Interpolation::Flat, .. }));
    assert_eq!(i.output_location(1), Some(0));
}

/// The shaders of the recorded traces, where they are at hand: `FILLRATE_PEERS` names their folder.
#[test]
fn shaders_of_recorded_traces_compile() {
    let Some(folder) = std::env::var_os("FILLRATE_PEERS") else { return };
    let mut seen = 0;
    let traces = std::fs::read_dir(std::path::Path::new(&folder).join("wgpu")).expect("the folder of traces");
    for trace in traces.flatten() {
        let Ok(files) = std::fs::read_dir(trace.path().join("trace")) else { continue };
        for file in files.flatten().filter(|f| f.path().extension().is_some_and(|e| e == "wgsl")) {
            let text = std::fs::read_to_string(file.path()).expect("text");
            let name = file.path().display().to_string();
            let module = Module::new(&name, ModuleSource::Wgsl(&text)).unwrap_or_else(|e| panic!("{e}"));
            for (stage, entry) in module.entry_points() {
                let p = compile(&module, stage, Some(entry), &Options::default()).unwrap_or_else(|e| panic!("{e}"));
                println!("{name} {entry}: {:?} operations, {} registers", p.operations(), p.interface().registers);
                seen += 1;
            }
        }
    }
    assert!(seen >= 20, "{seen} entry points");
}
