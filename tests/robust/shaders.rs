//! What must hold of any bytes as a shader module, for the property tests and the fuzz target: it is refused with a message, or
//! every entry point is refused with a message or runs a few invocations and ends.

use fillrate::gfx::format::Format;
use fillrate::gfx::image::ImageDesc;
use fillrate::gfx::state::{Aspect, Compare, FilterMode, SamplerDesc, TextureDimension, ViewDimension};
use fillrate::gfx::texture::{Sampler, View, ViewRange};
use fillrate::num::{Limits, Meter, Words};
use fillrate::shader::{
    BindingKind, BufferRange, Executor, Module, ModuleSource, Options, Recorder, Resource, Resources, SampleKind, Stage,
    StorageImage, compile,
};

/// Invocations of a workgroup that are still run here; larger ones only take longer.
const LARGEST_GROUP: u32 = 1 << 10;

/// Steps that one entry point may take: a second or so.
const STEPS: u64 = 20_000_000;

/// The first byte chooses: SPIR-V, naga's own form, or else WGSL.
pub fn run_everything(data: &[u8]) {
    let Some((&kind, rest)) = data.split_first() else { return };
    let text = std::str::from_utf8(rest);
    let source = match (kind, text) {
        (b'S', _) => ModuleSource::SpirV(rest),
        (b'N', Ok(text)) => ModuleSource::NagaIr(text),
        (_, Ok(text)) => ModuleSource::Wgsl(text),
        _ => return,
    };
    let module = match Module::new("fuzzed", source) {
        Ok(module) => module,
        Err(error) => {
            assert!(!error.message.is_empty() && error.to_string().contains("fuzzed"), "{error}");
            return;
        }
    };
    let entries: Vec<(Stage, String)> = module.entry_points().map(|(stage, name)| (stage, name.to_owned())).collect();
    for (stage, name) in entries.iter().take(4) {
        run(&module, *stage, name);
    }
}

/// A small image of each kind that a binding may want, with its bytes.
struct Store {
    words: Words,
    desc: ImageDesc,
    dimension: ViewDimension,
}

impl Store {
    fn new(dimension: ViewDimension, format: Format, samples: u32) -> Store {
        let (storage, size) = match dimension {
            ViewDimension::D1 => (TextureDimension::D1, [8, 1, 1]),
            ViewDimension::D3 => (TextureDimension::D3, [4, 4, 4]),
            ViewDimension::Cube => (TextureDimension::D2, [4, 4, 6]),
            ViewDimension::CubeArray => (TextureDimension::D2, [4, 4, 12]),
            ViewDimension::D2Array => (TextureDimension::D2, [8, 4, 3]),
            ViewDimension::D2 => (TextureDimension::D2, [8, 4, 1]),
        };
        let desc = ImageDesc { dimension: storage, size, levels: 1, samples, format };
        let bytes = u64::from(size.iter().product::<u32>() * samples) * u64::from(format.block_bytes());
        let words = Words::new(bytes.next_multiple_of(4));
        (0..words.words().len()).for_each(|i| words.store(i, (i as u32).wrapping_mul(0x9e37_79b9) >> 3));
        Store { words, desc, dimension }
    }

    fn view(&self) -> Option<View> {
        let range = ViewRange {
            dimension: self.dimension,
            format: self.desc.format,
            aspect: if self.desc.format.is_depth_stencil() { Aspect::DepthOnly } else { Aspect::All },
            base_level: 0,
            levels: 1,
            base_layer: 0,
            layers: if self.desc.dimension == TextureDimension::D2 { self.desc.size[2] } else { 1 },
        };
        View::new(&self.words, &self.desc, &range, 0).ok()
    }
}

fn run(module: &Module, stage: Stage, entry: &str) {
    let program = match compile(module, stage, Some(entry), &Options::default()) {
        Ok(program) => program,
        Err(error) => {
            assert!(!error.message.is_empty() && error.to_string().contains("fuzzed"), "{error}");
            return;
        }
    };
    let interface = program.interface();
    if interface.workgroup_size.iter().product::<u32>() > LARGEST_GROUP {
        return;
    }
    let stores: Vec<Option<Store>> = interface
        .bindings
        .iter()
        .map(|b| match b.kind {
            BindingKind::Texture { dimension, multisampled, sample } => {
                let format = match sample {
                    SampleKind::Float => Format::Rgba8Unorm,
                    SampleKind::Uint => Format::R32Uint,
                    SampleKind::Sint => Format::Rgba8Sint,
                    SampleKind::Depth => Format::Depth32Float,
                };
                Some(Store::new(dimension, format, if multisampled { 4 } else { 1 }))
            }
            BindingKind::StorageTexture { dimension, format, .. } => Some(Store::new(dimension, format, 1)),
            _ => None,
        })
        .collect();
    let views: Vec<Option<View>> = stores.iter().map(|s| s.as_ref().and_then(Store::view)).collect();
    let samplers = [None, Some(Compare::Less)].map(|compare| {
        Sampler::new(&SamplerDesc { compare, mag: FilterMode::Linear, min: FilterMode::Linear, ..SamplerDesc::default() })
    });
    let buffer = Words::new(256);
    (0..64).for_each(|i| buffer.store(i, [i as u32, (i as f32 * 0.37).to_bits()][i & 1]));
    let bindings: Vec<Vec<Resource<'_>>> = interface
        .bindings
        .iter()
        .zip(stores.iter().zip(&views))
        .map(|(binding, (store, view))| {
            let resource = match (binding.kind, store, view) {
                (BindingKind::Sampler { comparison }, ..) => Resource::Sampler(&samplers[usize::from(comparison)]),
                (BindingKind::Texture { .. }, _, Some(view)) => Resource::Texture(view),
                (BindingKind::StorageTexture { .. }, Some(store), _) => Resource::Storage(StorageImage {
                    words: &store.words,
                    desc: store.desc,
                    level: 0,
                    base_layer: 0,
                    layers: if store.desc.dimension == TextureDimension::D2 { store.desc.size[2] } else { 1 },
                    address: 0,
                }),
                (BindingKind::Uniform { .. } | BindingKind::Storage { .. }, ..) => {
                    Resource::Buffer(BufferRange { words: &buffer, offset: 0, size: 256, address: 0 })
                }
                _ => Resource::None,
            };
            vec![resource; binding.count.map_or(1, |_| 2)]
        })
        .collect();
    let resources = Resources { bindings: &bindings, immediates: &[1, 2, 3, 4], ..Resources::default() };
    let uniforms = program.uniforms(&resources);
    let mut executor = Executor::new();
    let mut recorder = Recorder::new();
    // Loops inside of loops stop with an error, and so does one that does not end.
    let steps = Meter::new(Limits::default().work_steps.with(STEPS));
    let mut bound = executor.bind(&program, &resources, &uniforms).within(&steps, None);
    let stopped = if stage == Stage::Compute {
        let mut packets = Vec::new();
        bound.run_groups(0..2, [2, 1, 1], Some((&mut recorder, &mut packets))).err()
    } else {
        for (slot, input) in interface.inputs.iter().enumerate() {
            for component in 0..input.components as usize {
                if let Some(lanes) = bound.input_mut(slot, component) {
                    lanes.f32_mut().iter_mut().enumerate().for_each(|(i, x)| *x = i as f32 * 0.125 - component as f32);
                }
            }
        }
        bound.run_recorded(!0 << 8, 0xff, &mut recorder).err()
    };
    if let Some(fault) = stopped {
        let text = fault.to_string();
        assert!(text.contains("without an end") || text.contains("--limit work.shader_steps"), "{fault}");
    }
}
