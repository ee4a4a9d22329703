//! Shader modules: text or binary in, validated naga IR out.

use std::sync::Arc;

use naga::valid::{Capabilities, ModuleInfo, ValidationFlags, Validator};

use super::extent;
use super::interface::stage_of;
use super::spirv;
use super::unsupported;
use super::wgsl;
use gfx::stage::Stage;
use host::{guarded, one_line, ron_reason, with_room_for};
use num::Limits;

/// The source of a shader module.
#[derive(Clone, Copy, Debug)]
pub enum ModuleSource<'a> {
    /// WGSL text.
    Wgsl(&'a str),
    /// A SPIR-V binary.
    SpirV(&'a [u8]),
    /// naga's own module, as RON (what wgpu's traces store for modules that were passed as IR).
    NagaIr(&'a str),
}

/// A place in the source of a module.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ShaderLocation {
    /// In a text.
    Text {
        /// Line, from 1.
        line: u32,
        /// Column in bytes, from 1.
        column: u32,
    },
    /// In a SPIR-V binary: the word of this number, from 0, with which an instruction begins.
    Word(u32),
}

impl ShaderLocation {
    /// The line, from 1, in a text.
    pub fn line(self) -> Option<u32> {
        match self {
            ShaderLocation::Text { line, .. } => Some(line),
            ShaderLocation::Word(_) => None,
        }
    }
}

impl std::fmt::Display for ShaderLocation {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            ShaderLocation::Text { line, column } => write!(f, "{line}:{column}"),
            ShaderLocation::Word(word) => write!(f, "word {word}"),
        }
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
    /// Place in the source, if it is known. naga IR has places only while it is read: afterwards messages name its handles.
    pub place: Option<ShaderLocation>,
    /// What is wrong.
    pub message: String,
}

fn entry_text(entry: &Option<String>) -> String {
    entry.as_ref().map(|e| format!(", entry point `{}`", one_line(e))).unwrap_or_default()
}

fn place_text(place: &Option<ShaderLocation>) -> String {
    place.map(|p| format!(", {p}")).unwrap_or_default()
}

/// Pairs of tokens that take about as long as a byte of source.
pub(super) const PAIRS: u64 = 1 << 10;

/// A validated shader module.
#[derive(Clone, Debug)]
pub struct Module {
    pub(super) name: Arc<str>,
    pub(super) places: Places,
    pub(super) ir: Arc<Ir>,
    pub(super) info: Arc<ModuleInfo>,
    /// The limits of compiling it.
    pub(super) limits: Limits,
    /// The length of its source, and [pairs](super::nesting::pairs) of what stands in it, as often as naga has read it.
    work: (u64, u64),
}

/// What the spans of naga's form of a module refer to.
#[derive(Clone, Debug)]
pub(super) enum Places {
    /// Bytes of a text, as it was rewritten; errors name places of the one that was given.
    Text(Arc<str>, Arc<wgsl::Text>),
    /// Bytes of a SPIR-V binary. If it was rewritten: where each instruction begins, and where it began before.
    Binary(Arc<[(u32, u32)]>),
    /// Nothing.
    None,
}

impl Places {
    /// The place of a span.
    pub fn of(&self, span: naga::Span) -> Option<ShaderLocation> {
        let at = span.to_range()?.start;
        match self {
            Places::Text(text, rewritten) => Some(wgsl::place(text, rewritten.origin(at))),
            Places::Binary(origins) => Some(ShaderLocation::Word(origin(origins, (at / 4) as u32))),
            Places::None => None,
        }
    }
}

/// The word at which an instruction began before its module was rewritten.
fn origin(origins: &[(u32, u32)], word: u32) -> u32 {
    let after = origins.partition_point(|&(at, _)| at <= word);
    after.checked_sub(1).map_or(word, |last| origins[last].1)
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
        // This may run on any thread.
        extent::take_apart(&mut self.0);
    }
}

/// The optional capabilities of naga that this implementation supports.
pub(crate) fn capabilities() -> Capabilities {
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

/// The first function that a SPIR-V module calls and does not have, and the word of the call: naga 30 panics on it. None where the words are
/// not a SPIR-V module.
fn undefined_function(words: &[u32]) -> Option<(u32, u32)> {
    const FUNCTION: u32 = 54;
    const FUNCTION_CALL: u32 = 57;
    let (mut defined, mut called) = (std::collections::BTreeSet::<u32>::new(), Vec::new());
    for (at, code) in extent::instructions(words) {
        match code {
            FUNCTION => defined.extend(words.get(at + 2)),
            FUNCTION_CALL => called.extend(words.get(at + 3).map(|&id| (id, at as u32))),
            _ => {}
        }
    }
    called.into_iter().find(|(id, _)| !defined.contains(id))
}

/// Reads a SPIR-V module. naga's errors have no place, but naga reads one word after the other, so that the last one read is known.
fn read_spirv(words: &[u32], options: &naga::front::spv::Options) -> Result<naga::Module, (Option<u32>, String)> {
    let taken = std::cell::Cell::new(0);
    let counted = words.iter().copied().inspect(|_| taken.set(taken.get() + 1));
    let parsed = guarded(|| {
        let parsed = naga::front::spv::Frontend::new(counted, options).parse();
        parsed.map_err(|error| (matches!(error, naga::front::spv::Error::IncompleteData), chain(&error)))
    });
    parsed.unwrap_or_else(|message| Err((false, message))).map_err(|(is_cut, message)| {
        // The last word that naga read belongs to the instruction at fault. An error that naga finds after all words has no place.
        let within = is_cut || taken.get() < words.len();
        let begins = |&(at, _): &(usize, u32)| at < taken.get();
        let at = extent::instructions(words).take_while(begins).last().map_or(0, |(at, _)| at as u32);
        (within.then_some(at), message)
    })
}

impl Module {
    /// Parses and validates a module; `name` is used in messages only.
    ///
    /// # Errors
    /// If the text does not parse, or naga's validation refuses it, or it needs a capability that is not implemented.
    pub fn new(name: &str, source: ModuleSource<'_>) -> Result<Module, ShaderError> {
        Module::with_limits(name, source, &Limits::default())
    }

    /// As [`Module::new`], with limits other than the default ones.
    pub fn with_limits(name: &str, source: ModuleSource<'_>, limits: &Limits) -> Result<Module, ShaderError> {
        let fail = |message| ShaderError { module: name.to_owned(), entry: None, place: None, message };
        let length = match source {
            ModuleSource::Wgsl(text) | ModuleSource::NagaIr(text) => text.len(),
            ModuleSource::SpirV(bytes) => bytes.len(),
        };
        limits.shader_source.check(length as u64).map_err(|error| fail(error.to_string()))?;
        let parse = || guarded(|| Module::parse(name, source, limits)).unwrap_or_else(|message| Err(fail(message)));
        with_room_for(limits.shader_nesting.get(), parse).unwrap_or_else(|message| Err(fail(message)))
    }

    fn parse(name: &str, source: ModuleSource<'_>, limits: &Limits) -> Result<Module, ShaderError> {
        let fail = |place, message| ShaderError { module: name.to_owned(), entry: None, place, message };
        let (ir, places, work) = match source {
            ModuleSource::Wgsl(text) => {
                let (ir, read) = wgsl::parse(text, limits).map_err(|(place, message)| fail(place, message))?;
                (ir, Places::Text(text.into(), Arc::new(read.text)), read.work)
            }
            ModuleSource::SpirV(bytes) => {
                let options = naga::front::spv::Options {
                    // What wgpu does: its convention is Vulkan's, with y flipped in the vertex stage.
                    adjust_coordinate_space: false,
                    strict_capabilities: true,
                    block_ctx_dump_prefix: None,
                };
                let word = |word: &[u8]| u32::from_le_bytes([word[0], word[1], word[2], word[3]]);
                let words: Vec<u32> = bytes.chunks_exact(4).map(word).collect();
                if words.len() * 4 != bytes.len() {
                    return Err(fail(None, format!("{} bytes are no whole number of words", bytes.len())));
                }
                let place = |at: u32| Some(ShaderLocation::Word(at));
                let pairs = extent::check_spirv(&words, limits).map_err(|(at, message)| fail(place(at), message))?;
                if let Some((id, at)) = undefined_function(&words) {
                    return Err(fail(place(at), format!("a call of %{id}, which is no function of the module")));
                }
                let mended = spirv::mend(&words).map_err(|(at, message)| fail(place(at), message))?;
                let (words, origins) = mended.map_or((words, Vec::new()), |mended| (mended.words, mended.origins));
                let ir = read_spirv(&words, &options)
                    .map_err(|(word, message)| fail(word.map(|word| ShaderLocation::Word(origin(&origins, word))), message))?;
                (ir, Places::Binary(origins.into()), (bytes.len() as u64, pairs))
            }
            ModuleSource::NagaIr(ron) => {
                let ir = ron::from_str(ron).map_err(|e: ron::error::SpannedError| {
                    let at = e.span.start;
                    fail(
                        Some(ShaderLocation::Text { line: at.line as u32, column: at.col as u32 }),
                        format!("no naga IR: {}", ron_reason(&e.code)),
                    )
                })?;
                (ir, Places::None, (ron.len() as u64, 0))
            }
        };
        Module::validated(name, ir, places, work, limits)
    }

    /// The module that computes a constant, which must not need others.
    pub(super) fn constant(text: &str, limits: &Limits) -> Option<Module> {
        let (ir, read) = wgsl::read(text, limits, false).ok()?;
        Module::validated("constant", ir, Places::Text(text.into(), Arc::new(read.text)), read.work, limits).ok()
    }

    fn validated(
        name: &str,
        ir: naga::Module,
        places: Places,
        work: (u64, u64),
        limits: &Limits,
    ) -> Result<Module, ShaderError> {
        let fail = |place, message| ShaderError { module: name.to_owned(), entry: None, place, message };
        extent::check_ir(&ir, limits).map_err(|(span, message)| fail(places.of(span), message))?;
        let info =
            Validator::new(ValidationFlags::all(), capabilities()).validate(&ir).map_err(|e| {
                match unsupported::scalar(&ir) {
                    Some((span, message)) => fail(places.of(span), message),
                    None => fail(e.spans().next().and_then(|(span, _)| places.of(*span)), chain(e.as_inner())),
                }
            })?;
        Ok(Module { name: name.into(), places, ir: Arc::new(Ir(ir)), info: Arc::new(info), limits: *limits, work })
    }

    /// The work of reading it, in bytes of source: its length, and one byte more for each [`PAIRS`] pairs of tokens inside its functions.
    pub fn work(&self) -> u64 {
        self.work.0.saturating_add(self.work.1 / PAIRS)
    }

    /// The entry points: stage and name, in source order. Stages beyond raster and compute are left out.
    pub fn entry_points(&self) -> impl Iterator<Item = (Stage, &str)> {
        self.ir.entry_points.iter().filter_map(|e| Some((stage_of(e.stage)?, e.name.as_str())))
    }

    /// The name given at creation.
    pub fn name(&self) -> &str {
        &self.name
    }
}

pub(crate) fn place_of(l: naga::SourceLocation) -> ShaderLocation {
    ShaderLocation::Text { line: l.line_number, column: l.line_position }
}

/// An error with its causes, on one line.
pub(crate) fn chain(e: &dyn std::error::Error) -> String {
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
