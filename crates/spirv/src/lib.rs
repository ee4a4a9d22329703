//! Floor 0: SPIR-V of Vulkan programs, rewritten into SPIR-V that the shader engine reads.
//!
//! The engine reads SPIR-V with naga, which knows what WebGPU has. Programs for Vulkan use more. [`translate`] takes one entry point out of a
//! module, puts the values of the pipeline in, and writes what naga does not know in another form of the same meaning. What has no such form
//! is refused: a [`Refusal`] names the instruction, its word and the reason.
//!
//! Words go in and words come out, so that the result is a module like any other: a trace stores it, and the engine mends and validates it as
//! it does with SPIR-V from elsewhere. [`Translated::origin`] leads from its words back to those that were given. Nothing here trusts the
//! words: the work and the size of the result are bounded by the size of the module.
//!
//! ```text
//! what a module has                       what it becomes                                     what must be bound
//! combined image samplers                 an image and a sampler                              Translated::combined
//! input attachments                       images, read at the fragment's position             Translated::input_attachments
//! texel buffers                           storage buffers of words, and their conversion      Translated::texel_buffers
//! uniform blocks with dense arrays        storage buffers that are only read                  Translated::uniform_as_storage
//! storage images without a format         images of the format of Options::formats            as before
//! channels that views exchange             exchanges behind each read                          as before, without them
//! biases of samplers                      sums of levels                                      as before, without them
//! specialization constants                constants; what is computed from them is folded     nothing
//! the number of the view                  a constant                                          nothing
//! Options::base_instance, draw_index      constants                                           nothing
//! Options::base_workgroup                 sums of numbers of workgroups and invocations       nothing
//! the memory model of Vulkan              that of GLSL                                        nothing
//! matrices by rows or distant columns     arrays of vectors                                   as before
//! offsets of loads from images            sums of coordinates                                 nothing
//! matrices and arrays between stages      vectors, each at its location                        as before
//! modf and rounding to 16 bits            other operations                                    nothing
//! ```
//!
//! Refused by name: tessellation and geometry stages, stages that choose a viewport or a layer, atomic operations on images, arrays of several
//! buffers, inputs and outputs that begin within a location, smallest levels and several offsets of samples, comparisons at levels other than the first, writes to texels of a buffer
//! that are smaller than a word. naga reads past many of these without a word.
//!
//! **Points.** `gl_PointSize` and `gl_PointCoord` stay what they are: the built-in output and input of the module, which naga keeps
//! (`PointSize`, `PointCoord`). The engine ignores the size, and its points are single pixels. Who draws larger points draws triangles, as the
//! importer of OpenGL does: its vertex stage is written to move a corner by the size, and `gl_PointCoord` comes from the place of the corner.
//!
//! # Example
//!
//! ```
//! use spirv::{Options, Stage, translate};
//!
//! // Compilers write modules; here naga writes one of WGSL.
//! let text = "@vertex fn main() -> @builtin(position) vec4f { return vec4f(1, 2, 0, 1); }";
//! let module = naga::front::wgsl::parse_str(text)?;
//! let info = naga::valid::Validator::new(Default::default(), Default::default()).validate(&module)?;
//! let words = naga::back::spv::write_vec(&module, &info, &Default::default(), None)?;
//!
//! let options = Options { flip_y: true, ..Options::default() };
//! let translated = translate(&words, "main", Stage::Vertex, &options)?;
//! assert!(translated.combined.is_empty());
//! let module = shader::Module::new("corner", shader::ModuleSource::SpirV(&translated.bytes()))?;
//! shader::compile(&module, shader::Stage::Vertex, Some("main"), &shader::Options::default())?;
//!
//! let refusal = translate(&words, "other", Stage::Vertex, &options).unwrap_err();
//! assert_eq!(refusal.to_string(), "word 0, OpEntryPoint: the module has no entry point `other` of the vertex stage");
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

use std::fmt;

mod attachments;
mod blocks;
mod combined;
mod declarations;
mod entry;
mod floats;
mod formats;
mod images;
mod interface;
mod matrices;
mod memory;
mod specialize;
mod texels;
mod varyings;
mod views;
mod words;

use grammar::BuiltIn;
use words::Parts;

/// Bindings of samplers that are split from images: the binding of the image, and this.
pub const SAMPLER_BINDINGS: u32 = 1 << 16;

/// Bindings of storage buffers that uniform blocks became: the binding of the block, and this. Another stage may read the same block as a
/// uniform buffer.
pub const UNIFORM_BINDINGS: u32 = 2 << 16;

/// A stage of Vulkan.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Stage {
    /// Vertices.
    Vertex,
    /// Refused.
    TessellationControl,
    /// Refused.
    TessellationEvaluation,
    /// Refused.
    Geometry,
    /// Fragments.
    Fragment,
    /// Compute.
    Compute,
}

impl fmt::Display for Stage {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Stage::Vertex => "vertex",
            Stage::TessellationControl => "tessellation control",
            Stage::TessellationEvaluation => "tessellation evaluation",
            Stage::Geometry => "geometry",
            Stage::Fragment => "fragment",
            Stage::Compute => "compute",
        })
    }
}

/// The value of a specialization constant.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Constant<'a> {
    /// The constant's id: `constant_id` in GLSL.
    pub id: u32,
    /// The bytes as the program gives them; a boolean has four.
    pub bytes: &'a [u8],
}

/// The format of what is bound.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct BoundFormat {
    /// The descriptor set.
    pub set: u32,
    /// The binding in it.
    pub binding: u32,
    /// The number of the view's `VkFormat`.
    pub format: u32,
}

/// A view that exchanges channels.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Swizzle {
    /// The descriptor that holds it.
    pub place: Place,
    /// The element of an array of descriptors; none: all of them.
    pub element: Option<u32>,
    /// What each channel reads, as `VkComponentSwizzle`.
    pub channels: [u32; 4],
}

/// A sampler that adds to the level.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bias {
    /// The descriptor that holds it.
    pub place: Place,
    /// The element of an array of descriptors; none: all of them.
    pub element: Option<u32>,
    /// What it adds.
    pub bias: f32,
}

/// What the pipeline says of a module.
#[derive(Clone, Copy, Debug, Default)]
pub struct Options<'a> {
    /// Values of specialization constants. Others keep their defaults.
    pub specialization: &'a [Constant<'a>],
    /// The view that a multiview pass draws: the value of `gl_ViewIndex`. None: 0.
    pub view_index: Option<u32>,
    /// The value of `gl_BaseInstance`. None: that of the native draw.
    pub base_instance: Option<u32>,
    /// The value of `gl_DrawID`. None: that of the native draw.
    pub draw_index: Option<u32>,
    /// The number of the first workgroup of the dispatch on each axis.
    pub base_workgroup: [u32; 3],
    /// Turns y of positions: for viewports of positive height, as Vulkan's y points down.
    pub flip_y: bool,
    /// Depths of positions are from -w to w, and become those from 0 to w.
    pub from_minus_one: bool,
    /// The fragment stage runs once for each sample: its inputs are interpolated there.
    pub each_sample: bool,
    /// Formats of what is bound, for storage images whose type has none, and for texel buffers.
    pub formats: &'a [BoundFormat],
    /// Views that exchange channels.
    pub swizzles: &'a [Swizzle],
    /// Samplers that add to the level.
    pub biases: &'a [Bias],
}

/// A descriptor's place.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Place {
    /// The descriptor set.
    pub set: u32,
    /// The binding in it.
    pub binding: u32,
}

/// A combined image sampler that became an image at its place and a sampler.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Combined {
    /// The descriptor. The image has its place.
    pub place: Place,
    /// The binding of the sampler, in the same set: the descriptor's and [`SAMPLER_BINDINGS`].
    pub sampler_binding: u32,
}

/// A descriptor that is bound in another form at another binding.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Moved {
    /// The descriptor.
    pub place: Place,
    /// The binding in the same set.
    pub binding: u32,
}

/// An input attachment that became a sampled image at its place.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct InputAttachment {
    /// The descriptor.
    pub place: Place,
    /// Its index among the input attachments of the subpass.
    pub index: u32,
}

/// A module that was rewritten, and what the user of it binds in another form than the descriptors say.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Translated {
    /// The words of the module. It has one entry point, of the name that was asked for.
    pub words: Vec<u32>,
    /// Where each instruction begins, in these words and in the words that were given.
    pub origins: Vec<(u32, u32)>,
    /// Combined image samplers. A module that uses no sampler of one has it here all the same.
    pub combined: Vec<Combined>,
    /// Input attachments.
    pub input_attachments: Vec<InputAttachment>,
    /// Texel buffers that became storage buffers, at the same binding. The range that is bound is that of the view; it begins at a multiple of 4.
    pub texel_buffers: Vec<Place>,
    /// Uniform blocks that became storage buffers that are only read, at the binding and [`UNIFORM_BINDINGS`].
    pub uniform_as_storage: Vec<Moved>,
}

impl Translated {
    /// The module as bytes.
    pub fn bytes(&self) -> Vec<u8> {
        self.words.iter().flat_map(|word| word.to_le_bytes()).collect()
    }

    /// The word of the module as it was given for a word of this one, or the first word if there is none.
    pub fn origin(&self, word: u32) -> u32 {
        let after = self.origins.partition_point(|&(at, _)| at <= word);
        after.checked_sub(1).map_or(0, |last| self.origins[last].1)
    }
}

/// Why a module is refused.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("word {word}, {instruction}: {reason}")]
pub struct Refusal {
    /// The word with which the instruction begins.
    pub word: u32,
    /// The name of the instruction.
    pub instruction: String,
    /// What is wrong with it.
    pub reason: String,
}

/// Takes an entry point out of a module and rewrites it for the engine.
///
/// # Errors
/// If the words are no module, it has no such entry point, or something in it cannot be expressed.
pub fn translate(words: &[u32], entry: &str, stage: Stage, options: &Options<'_>) -> Result<Translated, Refusal> {
    let mut parts = Parts::new(words)?;
    let mut translated = Translated::default();
    let function = entry::select(&mut parts, entry, stage)?;
    declarations::rewrite(&mut parts);
    memory::rewrite(&mut parts)?;
    specialize::rewrite(&mut parts, function, stage, options.specialization)?;
    floats::rewrite(&mut parts)?;
    let mut around = interface::Around::default();
    varyings::rewrite(&mut parts, stage, &mut around)?;
    interface::rewrite(&mut parts, stage)?;
    let mut fixed = vec![(BuiltIn::ViewIndex, options.view_index.unwrap_or(0)), (BuiltIn::DeviceIndex, 0)];
    fixed.extend(options.base_instance.map(|value| (BuiltIn::BaseInstance, value)));
    fixed.extend(options.draw_index.map(|value| (BuiltIn::DrawIndex, value)));
    interface::fix(&mut parts, &fixed)?;
    if stage == Stage::Compute && options.base_workgroup != [0; 3] {
        interface::move_workgroups(&mut parts, &mut around, options.base_workgroup)?;
    }
    translated.texel_buffers = texels::rewrite(&mut parts, options.formats)?;
    translated.combined = combined::rewrite(&mut parts)?;
    translated.input_attachments = attachments::rewrite(&mut parts)?;
    views::rewrite(&mut parts, options.swizzles, options.biases)?;
    images::rewrite(&mut parts, options.formats)?;
    matrices::rewrite(&mut parts)?;
    blocks::refuse_arrays(&parts)?;
    blocks::allow_reads(&mut parts);
    translated.uniform_as_storage = blocks::move_uniforms(&mut parts)?;
    if options.each_sample && stage == Stage::Fragment {
        interface::sample_inputs(&mut parts);
    }
    if (options.flip_y || options.from_minus_one) && stage == Stage::Vertex {
        interface::move_positions(&mut parts, &mut around, options.flip_y, options.from_minus_one);
    }
    interface::surround(&mut parts, function, around)?;
    parts.write(&mut translated.words, &mut translated.origins)?;
    Ok(translated)
}
