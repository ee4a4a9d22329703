//! Shaders: a stage of a pipeline is translated when the first draw needs it, and once for each choice that the draw makes.

use std::collections::BTreeMap;
use std::rc::Rc;

use gfx::stage::Stage as Kind;
use num::{Limits, ShaderId};
use shader::{BuiltIn, Interface, Module, ModuleSource};
use trace::record::Recorder;

use super::fault::{Fault, Outcome, unsupported};
use super::objects::Stage;
use super::points;

/// What is bound, as far as shaders depend on it: each with its set and binding.
#[derive(Clone, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub struct Bound {
    /// Formats of images and texel buffers, as `VkFormat`.
    pub formats: Vec<(u32, u32, u32)>,
    /// What the channels of views read, as `VkComponentSwizzle`, where that is not the channels themselves: of an element, or of all.
    pub swizzles: Vec<(u32, u32, Option<u32>, [u32; 4])>,
    /// What samplers add to the level, as bits of floating-point numbers: of an element, or of all.
    pub biases: Vec<(u32, u32, Option<u32>, u32)>,
}

/// Numbers of a draw or dispatch that shaders read, where the native one has others.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub struct Numbers {
    /// The first instance of a draw that is cut.
    pub base_instance: Option<u32>,
    /// The number of the draw among several.
    pub draw: Option<u32>,
    /// The first workgroup of a dispatch on each axis.
    pub base_workgroup: [u32; 3],
}

impl Numbers {
    /// The numbers that a shader reads; the others are as if there were none.
    pub fn read_by(self, interface: &Interface) -> Numbers {
        let reads = |builtin| interface.input(builtin).is_some();
        let workgroups = reads(BuiltIn::WorkGroupId) || reads(BuiltIn::GlobalInvocationId);
        Numbers {
            base_instance: self.base_instance.filter(|_| reads(BuiltIn::BaseInstance)),
            draw: self.draw.filter(|_| reads(BuiltIn::DrawIndex)),
            base_workgroup: if workgroups { self.base_workgroup } else { [0; 3] },
        }
    }
}

/// What a draw chooses of a shader's form.
#[derive(Clone, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub struct Form {
    /// Positions are turned, as clip space points down in Vulkan.
    pub flip: bool,
    /// Depths of clip space begin at -w.
    pub from_minus_one: bool,
    /// The view that is drawn, in a pass of several.
    pub view: Option<u32>,
    /// Numbers of a draw or dispatch that the native one does not have.
    pub numbers: Numbers,
    /// What is bound, as far as shaders depend on it.
    pub bound: Bound,
    /// The fragment stage runs for each sample.
    pub each_sample: bool,
    /// Points become squares, in a viewport of this size in pixels, as bits of floating-point numbers.
    pub points: Option<[u32; 2]>,
    /// The location at which the place in a point goes from vertex to fragment stage.
    pub point_coord: Option<u32>,
}

/// A shader that the card has.
#[derive(Debug)]
pub struct Shader {
    /// The native shader.
    pub id: ShaderId,
    /// The entry point in it.
    pub entry: String,
    /// Its interface.
    pub interface: Interface,
    /// What it binds in another form than the program: images with samplers, texel buffers.
    pub translated: spirv::Translated,
}

#[derive(PartialEq, Eq, PartialOrd, Ord)]
struct Key {
    module: u64,
    stage: u32,
    entry: String,
    constants: Rc<Vec<(u32, Vec<u8>)>>,
    form: Form,
}

/// Shaders that have been translated, or refused.
#[derive(Default)]
pub struct Shaders {
    known: BTreeMap<Key, Outcome<Rc<Shader>>>,
}

/// The stage of a `VkShaderStageFlagBits`.
fn kinds(stage: u32) -> Outcome<(spirv::Stage, Kind)> {
    Ok(match stage {
        1 => (spirv::Stage::Vertex, Kind::Vertex),
        16 => (spirv::Stage::Fragment, Kind::Fragment),
        32 => (spirv::Stage::Compute, Kind::Compute),
        other => return unsupported(format!("shader stage {}", super::formats::name("VkShaderStageFlagBits", other))),
    })
}

impl Shaders {
    /// The shader of a stage in this form.
    pub fn get(&mut self, stage: &Stage, form: &Form, card: &mut Recorder, limits: &Limits) -> Outcome<Rc<Shader>> {
        let (constants, form) = (stage.constants.clone(), form.clone());
        let key = Key { module: stage.module.number, stage: stage.stage, entry: stage.entry.clone(), constants, form };
        if let Some(known) = self.known.get(&key) {
            return known.clone();
        }
        let made = translate(stage, &key.form, card, limits).map(Rc::new);
        self.known.insert(key, made.clone());
        made
    }

    /// Why draws and dispatches did not get a stage in any form; none if no draw or dispatch asked for it.
    pub fn verdict(&self, stage: &Stage) -> Option<Outcome> {
        let is_own = |key: &Key| (key.module, key.stage, &key.entry) == (stage.module.number, stage.stage, &stage.entry);
        let mut found = self.known.iter().filter(|(key, _)| is_own(key)).map(|(_, made)| made.as_ref().map(|_| ()));
        let first = found.next()?;
        Some(found.fold(first, |all, next| all.or(next)).map_err(Fault::clone))
    }
}

fn translate(stage: &Stage, form: &Form, card: &mut Recorder, limits: &Limits) -> Outcome<Shader> {
    let (spirv_stage, kind) = kinds(stage.stage)?;
    let refused = |reason: String| Fault::Unsupported(format!("{} shader: {reason}", kind.name()));
    let constant = |(id, bytes): &'_ (u32, Vec<u8>)| (*id, bytes.clone());
    let constants: Vec<(u32, Vec<u8>)> = stage.constants.iter().map(constant).collect();
    let specialization: Vec<spirv::Constant<'_>> =
        constants.iter().map(|(id, bytes)| spirv::Constant { id: *id, bytes }).collect();
    let bound = |&(set, binding, format): &(u32, u32, u32)| spirv::BoundFormat { set, binding, format };
    let formats: Vec<spirv::BoundFormat> = form.bound.formats.iter().map(bound).collect();
    let place = |set, binding| spirv::Place { set, binding };
    let swizzle = |&(set, binding, element, channels): &_| spirv::Swizzle { place: place(set, binding), element, channels };
    let swizzles: Vec<spirv::Swizzle> = form.bound.swizzles.iter().map(swizzle).collect();
    let bias =
        |&(set, binding, element, bits): &_| spirv::Bias { place: place(set, binding), element, bias: f32::from_bits(bits) };
    let biases: Vec<spirv::Bias> = form.bound.biases.iter().map(bias).collect();
    let options = spirv::Options {
        specialization: &specialization,
        view_index: form.view,
        base_instance: form.numbers.base_instance,
        draw_index: form.numbers.draw,
        base_workgroup: form.numbers.base_workgroup,
        flip_y: form.flip,
        from_minus_one: form.from_minus_one,
        each_sample: form.each_sample,
        formats: &formats,
        swizzles: &swizzles,
        biases: &biases,
    };
    let translated = spirv::translate(&stage.module.words, &stage.entry, spirv_stage, &options)
        .map_err(|refusal| refused(refusal.to_string()))?;
    let bytes = translated.bytes();
    let text = points::rewritten(&translated.words, form).map_err(refused)?;
    let source = match &text {
        Some(text) => ModuleSource::NagaIr(text),
        None => ModuleSource::SpirV(&bytes),
    };
    let module = Module::with_limits("spirv", source, limits).map_err(|error| refused(error.message))?;
    let entry = stage.entry.as_str();
    let program = shader::compile(&module, kind, Some(entry), &Default::default()).map_err(|error| refused(error.message))?;
    let interface = program.interface().clone();
    let id = match &text {
        Some(text) => card.create_shader_naga_ir(kind.name(), text),
        None => card.create_shader_spirv(kind.name(), &bytes),
    };
    Ok(Shader { id, entry: stage.entry.clone(), interface, translated })
}
