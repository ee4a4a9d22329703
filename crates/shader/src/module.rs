//! Shader modules: text or binary in, validated naga IR out.

use std::sync::Arc;

use naga::valid::{Capabilities, ModuleInfo, ValidationFlags, Validator};

use super::extent;
use super::guard::guarded;
use super::interface::Stage;
use super::nesting;
use super::stack::with_room_for;
use host::one_line;
use num::Limits;

/// The source of a shader module.
#[derive(Clone, Copy, Debug)]
pub enum Source<'a> {
    /// WGSL text.
    Wgsl(&'a str),
    /// A SPIR-V binary.
    SpirV(&'a [u8]),
    /// naga's own module, as RON (what wgpu's traces store for modules that were passed as IR).
    NagaIr(&'a str),
}

/// A place in the text of a module.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Place {
    /// Line, from 1.
    pub line: u32,
    /// Column in bytes, from 1.
    pub column: u32,
}

impl std::fmt::Display for Place {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{}:{}", self.line, self.column)
    }
}

/// Why a module or an entry point was refused. Everything that cannot run is refused here, before anything runs.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("shader `{module}`{}{}: {message}", entry_text(.entry), place_text(.place))]
pub struct ShaderError {
    /// Name of the module.
    pub module: String,
    /// Entry point, if the error belongs to one.
    pub entry: Option<String>,
    /// Place in the source, if the source has places (SPIR-V and naga IR have none).
    pub place: Option<Place>,
    /// What is wrong.
    pub message: String,
}

fn entry_text(entry: &Option<String>) -> String {
    entry.as_ref().map(|e| format!(", entry point `{}`", one_line(e))).unwrap_or_default()
}

fn place_text(place: &Option<Place>) -> String {
    place.map(|p| format!(", {p}")).unwrap_or_default()
}

/// A validated shader module.
#[derive(Clone, Debug)]
pub struct Module {
    pub(super) name: Arc<str>,
    pub(super) source: Arc<str>,
    pub(super) ir: Arc<Ir>,
    pub(super) info: Arc<ModuleInfo>,
    /// What compiling it may take.
    pub(super) limits: Limits,
}

/// naga's form of a module.
#[derive(Debug)]
pub(super) struct Ir(naga::Module);

impl std::ops::Deref for Ir {
    type Target = naga::Module;

    fn deref(&self) -> &naga::Module {
        &self.0
    }
}

impl Drop for Ir {
    fn drop(&mut self) {
        // This may be any thread.
        extent::take_apart(&mut self.0);
    }
}

/// What of naga's optional capabilities this implementation runs.
pub(super) fn capabilities() -> Capabilities {
    Capabilities::IMMEDIATES
        | Capabilities::PRIMITIVE_INDEX
        | Capabilities::TEXTURE_AND_SAMPLER_BINDING_ARRAY
        | Capabilities::BUFFER_BINDING_ARRAY
        | Capabilities::STORAGE_TEXTURE_BINDING_ARRAY
        | Capabilities::STORAGE_BUFFER_BINDING_ARRAY
        | Capabilities::STORAGE_TEXTURE_16BIT_NORM_FORMATS
        | Capabilities::EARLY_DEPTH_TEST
        | Capabilities::MULTISAMPLED_SHADING
        | Capabilities::DUAL_SOURCE_BLENDING
        | Capabilities::CUBE_ARRAY_TEXTURES
        | Capabilities::SUBGROUP
        | Capabilities::SUBGROUP_BARRIER
        | Capabilities::SUBGROUP_VERTEX_STAGE
        | Capabilities::SHADER_FLOAT32_ATOMIC
        | Capabilities::TEXTURE_ATOMIC
        | Capabilities::SHADER_FLOAT16
        | Capabilities::SHADER_FLOAT16_IN_FLOAT32
        | Capabilities::CLIP_DISTANCES
        | Capabilities::SHADER_BARYCENTRICS
        | Capabilities::DRAW_INDEX
        | Capabilities::TEXTURE_AND_SAMPLER_BINDING_ARRAY_NON_UNIFORM_INDEXING
        | Capabilities::BUFFER_BINDING_ARRAY_NON_UNIFORM_INDEXING
        | Capabilities::STORAGE_TEXTURE_BINDING_ARRAY_NON_UNIFORM_INDEXING
        | Capabilities::STORAGE_BUFFER_BINDING_ARRAY_NON_UNIFORM_INDEXING
        | Capabilities::MEMORY_DECORATION_COHERENT
        | Capabilities::MEMORY_DECORATION_VOLATILE
}

/// The first function that a SPIR-V module calls and does not have, on which naga 30 panics. Nothing is said of what is no such
/// module.
fn undefined_function(words: &[u32]) -> Option<u32> {
    const FUNCTION: u32 = 54;
    const FUNCTION_CALL: u32 = 57;
    let (mut defined, mut called) = (std::collections::BTreeSet::<u32>::new(), Vec::new());
    // Five words of header, then instructions: their length in words and their code, then their operands.
    let mut at = 5;
    while let Some(&first) = words.get(at) {
        let (length, code) = ((first >> 16) as usize, first & 0xffff);
        if length == 0 {
            break;
        }
        match code {
            FUNCTION => defined.extend(words.get(at + 2)),
            FUNCTION_CALL => called.extend(words.get(at + 3)),
            _ => {}
        }
        at += length;
    }
    called.into_iter().find(|id| !defined.contains(id))
}

impl Module {
    /// Parses and validates a module; `name` is used in messages only.
    ///
    /// # Errors
    /// If the text does not parse, or naga's validation refuses it, or it needs a capability that is not implemented.
    pub fn new(name: &str, source: Source<'_>) -> Result<Module, ShaderError> {
        Module::with_limits(name, source, &Limits::default())
    }

    /// As [`Module::new`], with limits other than the default ones.
    pub fn with_limits(name: &str, source: Source<'_>, limits: &Limits) -> Result<Module, ShaderError> {
        let fail = |message| ShaderError { module: name.to_owned(), entry: None, place: None, message };
        let length = match source {
            Source::Wgsl(text) | Source::NagaIr(text) => text.len(),
            Source::SpirV(bytes) => bytes.len(),
        };
        limits.shader_source.check(length as u64).map_err(|error| fail(error.to_string()))?;
        let parse = || guarded(|| Module::parse(name, source, limits)).unwrap_or_else(|message| Err(fail(message)));
        with_room_for(limits.shader_nesting.get(), parse).unwrap_or_else(|message| Err(fail(message)))
    }

    fn parse(name: &str, source: Source<'_>, limits: &Limits) -> Result<Module, ShaderError> {
        let fail = |place, message| ShaderError { module: name.to_owned(), entry: None, place, message };
        let (ir, text) = match source {
            Source::Wgsl(text) => {
                let extent = nesting::check(text, limits).map_err(|(place, message)| fail(Some(place), message))?;
                let options = naga::front::wgsl::Options { parse_doc_comments: false, capabilities: capabilities() };
                let ir = naga::front::wgsl::Frontend::new_with_options(options).parse(text).map_err(|e| {
                    let place = e.location(text).map(place_of);
                    // The only error that names no place.
                    if place.is_none() && e.emit_to_string("").contains("recursion limit") {
                        let message = "brackets, templates and blocks inside each other go deeper than naga's parser can follow, which is \
                                       200 levels and fixed; give parts of it names of their own";
                        return fail(Some(extent.deepest), message.to_owned());
                    }
                    let labels: Vec<&str> = e.labels().map(|l| l.1).filter(|l| !l.is_empty()).collect();
                    let mut message = e.message().to_owned();
                    if message.starts_with("brace nesting limit") {
                        message.push_str(": more than 127 blocks inside each other, which WGSL does not have; a part can be a function");
                    }
                    if !labels.is_empty() {
                        message = format!("{message} ({})", labels.join("; "));
                    }
                    fail(place, message)
                })?;
                (ir, text)
            }
            Source::SpirV(bytes) => {
                let options = naga::front::spv::Options {
                    // What wgpu does: its convention is Vulkan's, with y flipped in the vertex stage.
                    adjust_coordinate_space: false,
                    strict_capabilities: true,
                    block_ctx_dump_prefix: None,
                };
                let word = |word: &[u8]| u32::from_le_bytes([word[0], word[1], word[2], word[3]]);
                let words: Vec<u32> = bytes.chunks_exact(4).map(word).collect();
                extent::check_spirv(&words, limits).map_err(|message| fail(None, message))?;
                if let Some(id) = undefined_function(&words) {
                    return Err(fail(None, format!("a call of %{id}, which is no function of the module")));
                }
                let ir = naga::front::spv::parse_u8_slice(bytes, &options).map_err(|e| fail(None, chain(&e)))?;
                (ir, "")
            }
            Source::NagaIr(ron) => {
                let ir = ir_text::read(ron).map_err(|e| fail(None, format!("naga IR at {}: {}", e.span.start, e.code)))?;
                (ir, "")
            }
        };
        extent::check_ir(&ir, limits).map_err(|message| fail(None, message))?;
        let info = Validator::new(ValidationFlags::all(), capabilities())
            .validate(&ir)
            .map_err(|e| fail(e.location(text).map(place_of), chain(e.as_inner())))?;
        Ok(Module { name: name.into(), source: text.into(), ir: Arc::new(Ir(ir)), info: Arc::new(info), limits: *limits })
    }

    /// The entry points: stage and name, in source order. Stages beyond raster and compute are left out.
    pub fn entry_points(&self) -> impl Iterator<Item = (Stage, &str)> {
        self.ir.entry_points.iter().filter_map(|e| Some((Stage::from_naga(e.stage)?, e.name.as_str())))
    }

    /// The name given at creation.
    pub fn name(&self) -> &str {
        &self.name
    }
}

pub(super) fn place_of(l: naga::SourceLocation) -> Place {
    Place { line: l.line_number, column: l.line_position }
}

/// An error with its causes, on one line.
pub(super) fn chain(e: &dyn std::error::Error) -> String {
    let mut text = e.to_string();
    let mut cause = e.source();
    while let Some(c) = cause {
        let next = c.to_string();
        if !text.ends_with(&next) {
            text.push_str(": ");
            text.push_str(&next);
        }
        cause = c.source();
    }
    text
}
