//! Single programs on which the engine and the oracle must agree: places where one of them was, or may easily be, wrong.

use gfx::format::Format;
use gfx::image::ImageDesc;
use gfx::state::{AddressMode, Aspect, BorderColor, FilterMode, SamplerDesc, TextureDimension, ViewDimension};
use gfx::texture::{Sampler, View, ViewRange};
use naga::valid::ModuleInfo;
use num::Words;
use shader::{BufferRange, Executor, Module, ModuleSource, Options, Program, Resource, Resources, Stage, compile};

use crate::oracle::{self, Bindings, Texture, run_compute};
use crate::oracle_tests::{bytes, module};

/// A compiled compute program.
pub struct Engine(Program);

/// What a binding holds for the engine.
enum Held {
    Buffer(Words),
    Texture(Box<View>),
    Sampler(Sampler),
}

impl Engine {
    /// Compiles a program's only compute entry point.
    #[track_caller]
    pub fn new(source: &str) -> Engine {
        let program = Module::new("corner", ModuleSource::Wgsl(source))
            .and_then(|module| compile(&module, Stage::Compute, None, &Options::default()));
        Engine(program.unwrap_or_else(|error| panic!("{error}\n{source}")))
    }

    /// Runs one workgroup; what it leaves in binding 0 of group 0.
    pub fn run(&self, bindings: &Bindings) -> Result<Vec<u8>, String> {
        let words = |bytes: &[u8]| {
            let words = Words::new(bytes.len() as u64);
            words.write(0, bytes);
            words
        };
        let mut held = Vec::new();
        for at in &self.0.interface().bindings {
            held.push(match &bindings.resources[&(at.group, at.binding)][0] {
                oracle::Resource::Buffer(bytes) => Held::Buffer(words(bytes)),
                oracle::Resource::Texture(t) => {
                    let view = View::new(&words(&t.bytes), &t.desc, &t.range, 0);
                    Held::Texture(Box::new(view.map_err(|e| e.to_string())?))
                }
                oracle::Resource::Sampler(desc) => Held::Sampler(Sampler::new(desc)),
            });
        }
        fn resource(held: &Held) -> Resource<'_> {
            match held {
                Held::Buffer(words) => Resource::Buffer(BufferRange { words, offset: 0, size: words.len(), address: 0 }),
                Held::Texture(view) => Resource::Texture(view),
                Held::Sampler(sampler) => Resource::Sampler(sampler),
            }
        }
        let bound: Vec<Vec<Resource<'_>>> = held.iter().map(|h| vec![resource(h)]).collect();
        let resources = Resources { bindings: &bound, ..Resources::default() };
        let uniforms = self.0.uniforms(&resources);
        let mut executor = Executor::new();
        executor.bind(&self.0, &resources, &uniforms).run_groups(0..1, [1, 1, 1], None).map_err(|e| e.to_string())?;
        match held.first() {
            Some(Held::Buffer(words)) => Ok(words.to_vec()),
            _ => Err("the first binding is no buffer".into()),
        }
    }
}

/// What the oracle leaves of one workgroup in binding 0 of group 0.
pub fn oracle((module, info): &(naga::Module, ModuleInfo), mut bindings: Bindings) -> Result<Vec<u8>, String> {
    run_compute(module, info, "main", [1, 1, 1], &mut bindings, 1 << 20).map_err(|e| format!("{e:?}"))?;
    Ok(bindings.buffer(0, 0).unwrap_or_default().to_vec())
}

/// Runs both with the same bindings; what they leave.
#[track_caller]
fn both(source: &str, bindings: Bindings) -> Vec<u32> {
    let got = Engine::new(source).run(&bindings);
    let want = oracle(&module(source), bindings);
    assert_eq!(got, want, "{source}");
    got.unwrap_or_default().chunks_exact(4).map(|b| u32::from_le_bytes([b[0], b[1], b[2], b[3]])).collect()
}

fn buffer(words: &[u32]) -> Bindings {
    let mut bindings = Bindings::default();
    bindings.set_buffer(0, 0, bytes(words));
    bindings
}

#[test]
fn variables_live_on_after_a_continue() {
    let wrap = |body: &str| {
        format!(
            "@group(0) @binding(0) var<storage, read_write> b: array<u32>;
             fn same(x: u32) -> u32 {{ return x; }}
             @compute @workgroup_size(1) fn main() {{ {body} }}"
        )
    };
    let sums = wrap(
        "var i = 1u; var s = 0u;
         for (i = 1u; i < 7u; i++) { s += i; b[8u + i] = s; if b[1] == 0u { continue; } b[5] = 1u; }",
    );
    assert_eq!(both(&sums, buffer(&[0; 16]))[9..15], [1, 3, 6, 10, 15, 21]);
    let turns = wrap(
        "var m = 0u;
         loop { m += 1u; if m > 6u { break; } b[8u + m] = m; if b[1] == 0u { continue; } continuing { b[3] = b[6]; } }",
    );
    assert_eq!(both(&turns, buffer(&[0; 16]))[9..15], [1, 2, 3, 4, 5, 6]);
    let called = wrap(
        "var m = 0u;
         loop { m += 1u; if m > 6u { break; } let t = same(m); m += b[2]; if b[1] == 0u { continue; } b[5] = 1u;
                continuing { b[8u + m] = t; } }",
    );
    assert_eq!(both(&called, buffer(&[0, 0, 1, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0]))[8..], [0, 0, 1, 0, 3, 0, 5, 0]);
}

#[test]
fn a_power_of_two_is_multiplied_with_one_rounding() {
    // 2^-10 (1 + 2^-10 + 2^-15): with 9 bits of the fraction left, it is just above a tie. Rounded to 13 bits first, it is one.
    let x = 2f32.powi(-10) * (1.0 + 2f32.powi(-10) + 2f32.powi(-15));
    let source = "
        @group(0) @binding(0) var<storage, read_write> b: array<u32>;
        @compute @workgroup_size(1) fn main() { b[0] = bitcast<u32>(ldexp(bitcast<f32>(b[0]), -130)); }";
    assert_eq!(both(source, buffer(&[x.to_bits()])), [(1 << 9) + 1]);
}

#[test]
fn sums_of_16_bit_numbers_are_such_numbers() {
    let source = "
        enable f16;
        @group(0) @binding(0) var<storage, read_write> b: array<u32, 3>;
        @compute @workgroup_size(64) fn main(@builtin(local_invocation_index) i: u32) {
            let h = f16(f32(i) * 0.001);
            b[0] = bitcast<u32>(f32(subgroupAdd(h)));
            if i == 40u { b[1] = bitcast<u32>(f32(subgroupMul(h))); }
            let scan = f32(subgroupInclusiveAdd(h));
            if i == 63u { b[2] = bitcast<u32>(scan); }
        }";
    let got = both(source, buffer(&[0; 3]));
    assert!(got.iter().all(|bits| bits & 0x1fff == 0 && *bits != 0), "{got:x?}");
}

#[test]
fn a_layer_beyond_the_greatest_signed_number_is_the_last_one() {
    let desc = ImageDesc { dimension: TextureDimension::D2, size: [1, 1, 3], levels: 1, samples: 1, format: Format::R32Float };
    let range = ViewRange {
        dimension: ViewDimension::D2Array,
        format: Format::R32Float,
        aspect: Aspect::All,
        base_level: 0,
        levels: 1,
        base_layer: 0,
        layers: 3,
    };
    let texels = bytes(&[1.0f32, 2.0, 3.0, 0.0].map(f32::to_bits));
    let sampler = SamplerDesc {
        address: [AddressMode::ClampToEdge; 3],
        mag: FilterMode::Nearest,
        min: FilterMode::Nearest,
        mipmap: FilterMode::Nearest,
        lod_min: 0.0,
        lod_max: 32.0,
        compare: None,
        anisotropy: 1,
        border: BorderColor::TransparentBlack,
    };
    let mut bindings = buffer(&[0, 1, 3, u32::MAX, 0, 0, 0, 0]);
    bindings.resources.insert((0, 1), vec![oracle::Resource::Texture(Texture { desc, range, bytes: texels })]);
    bindings.resources.insert((0, 2), vec![oracle::Resource::Sampler(sampler)]);
    let source = "
        @group(0) @binding(0) var<storage, read_write> b: array<u32, 8>;
        @group(0) @binding(1) var t: texture_2d_array<f32>;
        @group(0) @binding(2) var s: sampler;
        @compute @workgroup_size(4) fn main(@builtin(local_invocation_index) i: u32) {
            let k = b[i];
            let u = textureSampleLevel(t, s, vec2f(0.5), k, 0.0).x;
            let v = textureSampleLevel(t, s, vec2f(0.5), bitcast<i32>(k), 0.0).x;
            let g = textureGather(0, t, s, vec2f(0.5), k).x;
            b[i] = u32(u) + 10u * u32(v) + 100u * u32(g);
            b[4u + i] = u32(textureLoad(t, vec2u(0u), k, 0).x);
        }";
    assert_eq!(both(source, bindings), [111, 222, 333, 313, 1, 2, 0, 0]);
}
