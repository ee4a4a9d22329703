//! Runs translated modules on the shader engine.

use std::collections::BTreeMap;

use gfx::format::Format;
use gfx::image::ImageDesc;
use gfx::state::{AddressMode, Aspect, SamplerDesc, TextureDimension, ViewDimension};
use gfx::texture::{Sampler, View, ViewRange};
use num::Words;
use shader::{BufferRange, Executor, Module, ModuleSource, Program, Resource, Resources, StorageImage, compile};
use spirv::{Options, Refusal, Stage, Translated, translate};

use crate::assembler::assemble;

/// What is bound, by set and binding.
#[derive(Default)]
pub struct Bound(BTreeMap<(u32, u32), Held>);

enum Held {
    Buffer(Words),
    Texture(Box<View>),
    Storage(ImageDesc, Words),
    Sampler(Box<Sampler>),
}

pub fn words_of(words: &[u32]) -> Words {
    let buffer = Words::new(words.len() as u64 * 4);
    words.iter().enumerate().for_each(|(n, &word)| buffer.store(n, word));
    buffer
}

impl Bound {
    pub fn buffer(mut self, set: u32, binding: u32, words: &[u32]) -> Bound {
        self.0.insert((set, binding), Held::Buffer(words_of(words)));
        self
    }

    /// A texture of 32-bit numbers, 4 texels wide.
    pub fn texture(mut self, set: u32, binding: u32, format: Format, texels: &[u32]) -> Bound {
        let desc = image(format, texels.len());
        let range = ViewRange {
            dimension: ViewDimension::D2,
            format,
            aspect: Aspect::All,
            base_level: 0,
            levels: 1,
            base_layer: 0,
            layers: 1,
        };
        let view = View::new(&words_of(texels), &desc, &range, 0).expect("a view");
        self.0.insert((set, binding), Held::Texture(Box::new(view)));
        self
    }

    /// A storage image, 4 texels wide.
    pub fn storage(mut self, set: u32, binding: u32, format: Format, texels: &[u32]) -> Bound {
        self.0.insert((set, binding), Held::Storage(image(format, texels.len()), words_of(texels)));
        self
    }

    pub fn sampler(mut self, set: u32, binding: u32, address: AddressMode) -> Bound {
        let sampler = Sampler::new(&SamplerDesc { address: [address; 3], ..SamplerDesc::default() });
        self.0.insert((set, binding), Held::Sampler(Box::new(sampler)));
        self
    }

    /// What a buffer or a storage image holds.
    pub fn words(&self, set: u32, binding: u32) -> Vec<u32> {
        match &self.0[&(set, binding)] {
            Held::Buffer(words) | Held::Storage(_, words) => (0..words.words().len()).map(|n| words.load(n)).collect(),
            _ => panic!("no words"),
        }
    }

    fn resource(&self, set: u32, binding: u32) -> Resource<'_> {
        match self.0.get(&(set, binding)) {
            Some(Held::Buffer(words)) => Resource::Buffer(BufferRange { words, offset: 0, size: words.len(), address: 0 }),
            Some(Held::Texture(view)) => Resource::Texture(view),
            Some(Held::Storage(desc, words)) => {
                Resource::Storage(StorageImage { words, desc: *desc, level: 0, base_layer: 0, layers: 1, address: 0 })
            }
            Some(Held::Sampler(sampler)) => Resource::Sampler(sampler),
            None => panic!("nothing is bound at {set}, {binding}"),
        }
    }
}

fn image(format: Format, texels: usize) -> ImageDesc {
    ImageDesc { dimension: TextureDimension::D2, size: [4, texels as u32 / 4, 1], levels: 1, samples: 1, format }
}

pub fn engine_stage(stage: Stage) -> shader::Stage {
    match stage {
        Stage::Vertex => shader::Stage::Vertex,
        Stage::Fragment => shader::Stage::Fragment,
        _ => shader::Stage::Compute,
    }
}

/// A module translated and compiled.
pub fn build(words: &[u32], entry: &str, stage: Stage, options: &Options<'_>) -> Result<(Translated, Program), String> {
    let translated = translate(words, entry, stage, options).map_err(|refusal| refusal.to_string())?;
    let module = Module::new("test", ModuleSource::SpirV(&translated.bytes())).map_err(|error| error.to_string())?;
    let program = compile(&module, engine_stage(stage), Some(entry), &shader::Options::default()).map_err(|e| e.to_string())?;
    Ok((translated, program))
}

/// The resources of a program, in the order of its bindings.
pub fn resources<'a>(program: &Program, bound: &'a Bound) -> Vec<Vec<Resource<'a>>> {
    let bindings = &program.interface().bindings;
    let elements = |count: Option<u32>, set, binding| vec![bound.resource(set, binding); count.unwrap_or(1).max(1) as usize];
    bindings.iter().map(|at| elements(at.count, at.group, at.binding)).collect()
}

/// Runs one workgroup.
#[track_caller]
pub fn run(words: &[u32], options: &Options<'_>, bound: &Bound) -> Translated {
    let (translated, program) = build(words, "main", Stage::Compute, options).unwrap_or_else(|error| panic!("{error}"));
    let bindings = resources(&program, bound);
    let resources = Resources { bindings: &bindings, ..Resources::default() };
    let uniforms = program.uniforms(&resources);
    let mut executor = Executor::new();
    executor.bind(&program, &resources, &uniforms).run_groups(0..1, [1, 1, 1], None).expect("it ends");
    translated
}

/// A compute module of one invocation. The block `%out` at set 0, binding 0 has words; `body` has `%u0` to `%u9`, types, and lines
/// `out N %value` that store a word.
pub fn compute(capabilities: &str, decorations: &str, globals: &str, body: &str) -> Vec<u32> {
    let mut numbers = String::new();
    for n in 0..16 {
        numbers += &format!("%u{n} = OpConstant %uint {n}\n%i{n} = OpConstant %int {n}\n");
    }
    let mut code = String::new();
    for (number, line) in body.lines().enumerate() {
        match line.trim().strip_prefix("out ") {
            Some(rest) => {
                let (slot, value) = rest.split_once(' ').expect("a slot and a value");
                code +=
                    &format!("%place{number} = OpAccessChain %ptr_uint %out %u0 %u{slot}\nOpStore %place{number} {value}\n");
            }
            None => code += &format!("{line}\n"),
        }
    }
    let text = format!(
        "OpCapability Shader
         {capabilities}
         %glsl = OpExtInstImport \"GLSL.std.450\"
         OpMemoryModel Logical GLSL450
         OpEntryPoint GLCompute %main \"main\"
         OpExecutionMode %main LocalSize 1 1 1
         {decorations}
         OpDecorate %out DescriptorSet 0
         OpDecorate %out Binding 0
         OpDecorate %words ArrayStride 4
         OpDecorate %block Block
         OpMemberDecorate %block 0 Offset 0
         %void = OpTypeVoid
         %signature = OpTypeFunction %void
         %bool = OpTypeBool
         %uint = OpTypeInt 32 0
         %int = OpTypeInt 32 1
         %float = OpTypeFloat 32
         %v2float = OpTypeVector %float 2
         %v3float = OpTypeVector %float 3
         %v4float = OpTypeVector %float 4
         %v2int = OpTypeVector %int 2
         %v3int = OpTypeVector %int 3
         %v2uint = OpTypeVector %uint 2
         %v4uint = OpTypeVector %uint 4
         %words = OpTypeRuntimeArray %uint
         %block = OpTypeStruct %words
         %ptr_block = OpTypePointer StorageBuffer %block
         %ptr_uint = OpTypePointer StorageBuffer %uint
         %out = OpVariable %ptr_block StorageBuffer
         {numbers}
         %f0 = OpConstant %float 0.0
         {globals}
         %main = OpFunction %void None %signature
         %begin = OpLabel
         {code}
         OpReturn
         OpFunctionEnd"
    );
    assemble(3, &text)
}

/// The refusal of a compute module.
#[track_caller]
pub fn refusal(words: &[u32], options: &Options<'_>) -> Refusal {
    translate(words, "main", Stage::Compute, options).expect_err("it is refused")
}
