//! Nanoseconds per invocation of typical programs, over full batches.

use std::hint::black_box;
use std::time::Duration;

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use fillrate::num::{LANES, Lanes, Words};
use fillrate::shader::{BufferRange, Executor, Module, ModuleSource, Options, Recorder, Resource, Resources, Stage, compile};

const BLINN_PHONG: &str = "
    @fragment fn fs(@location(0) wp: vec3f, @location(1) wn: vec3f) -> @location(0) vec4f {
        let light = vec3f(4.0, 5.0, 8.0); let eye = vec3f(0.0, 0.0, 6.2);
        let n = normalize(wn); let l = normalize(light - wp); let v = normalize(eye - wp); let h = normalize(l + v);
        let d = max(dot(n, l), 0.0); let s = pow(max(dot(n, h), 0.0), 32.0);
        return vec4f(vec3f(0.8, 0.5, 0.3) * (0.1 + d) + vec3f(0.6) * s, 1.0);
    }";

const LOOP: &str = "
    @fragment fn fs(@location(0) a: vec2f) -> @location(0) vec4f {
        var z = vec2f(0.0); var n = 0.0;
        for (var k = 0; k < 32; k++) {
            z = vec2f(z.x * z.x - z.y * z.y, 2.0 * z.x * z.y) + a;
            if (dot(z, z) > 4.0) { break; }
            n += 1.0;
        }
        return vec4f(n);
    }";

const STRAIGHT_LOOP: &str = "
    @fragment fn fs(@location(0) a: vec2f) -> @location(0) vec4f {
        var x = a.x;
        for (var k = 0; k < 32; k++) { x = x * 0.99 + a.y; x = max(x, 0.25) - 0.125; }
        return vec4f(x);
    }";

const PASSTHROUGH: &str = "@fragment fn fs(@location(0) c: vec4f) -> @location(0) vec4f { return c; }";

const TRANSFORM: &str = "
    struct Out { @builtin(position) p: vec4f, @location(0) wp: vec3f, @location(1) wn: vec3f }
    @group(0) @binding(0) var<uniform> m: mat4x4f;
    @vertex fn vs(@location(0) p: vec4f, @location(1) n: vec3f) -> Out { return Out(m * p, p.xyz, n); }";

/// Times batches of one program, with or without a recorder.
fn batches(c: &mut Criterion, name: &str, source: &str, stage: Stage, record: bool) {
    let module = Module::new(name, ModuleSource::Wgsl(source)).expect("the program is valid");
    let program = compile(&module, stage, None, &Options::default()).expect("the program compiles");
    let words = Words::new(256);
    for i in 0..16 {
        words.store(i, (0.1 * i as f32).to_bits());
    }
    let buffer = vec![Resource::Buffer(BufferRange { words: &words, offset: 0, size: 256, address: 0 })];
    let bindings = vec![buffer; program.interface().bindings.len()];
    let resources = Resources { bindings: &bindings, ..Resources::default() };
    let uniforms = program.uniforms(&resources);
    let mut executor = Executor::new();
    let mut bound = executor.bind(&program, &resources, &uniforms);
    let mut recorder = Recorder::new();
    let slots: Vec<usize> = program.interface().inputs.iter().map(|s| s.components as usize).collect();
    let mut group = c.benchmark_group("shader");
    group.throughput(Throughput::Elements(LANES as u64)).measurement_time(Duration::from_secs(1));
    group.warm_up_time(Duration::from_millis(300));
    group.bench_function(name, |b| {
        b.iter(|| {
            for (slot, &components) in slots.iter().enumerate() {
                for k in 0..components {
                    if let Some(lanes) = bound.input_mut(slot, k) {
                        *lanes = Lanes(std::array::from_fn(|i| (0.01 * i as f32 + 0.1 * k as f32).to_bits()));
                    }
                }
            }
            let outcome = if record { bound.run_recorded(!0, 0, &mut recorder) } else { bound.run(!0, 0) }.expect("it ends");
            black_box((outcome, bound.output(0, 0).0[5]));
            if record && recorder.requests.len() > 100_000 {
                recorder.take();
            }
        });
    });
    group.finish();
}

fn all(c: &mut Criterion) {
    batches(c, "passthrough", PASSTHROUGH, Stage::Fragment, false);
    batches(c, "blinn-phong", BLINN_PHONG, Stage::Fragment, false);
    batches(c, "blinn-phong-recorded", BLINN_PHONG, Stage::Fragment, true);
    batches(c, "loop-divergent-32", LOOP, Stage::Fragment, false);
    batches(c, "loop-straight-32", STRAIGHT_LOOP, Stage::Fragment, false);
    batches(c, "vertex-transform", TRANSFORM, Stage::Vertex, false);
}

criterion_group!(benches, all);
criterion_main!(benches);
