//! The engine against the oracle: what both leave of a generated program must be the same bits, with any optimisation left out,
//! recorded or not.

use std::collections::BTreeMap;

use gfx::texture::{Sampler, View};
use naga::back::pipeline_constants::process_overrides;
use naga::valid::{Capabilities, ModuleInfo, ValidationFlags, Validator};
use num::{LANES, Lanes, Limits, Words};
use shader::{
    BufferRange, BuiltIn, Connection, Encloser, Executor, Extra, Fault, Module, ModuleSource, Optimisations, Options,
    Program as Compiled, Range, Recorder, Resources, Scalar, Stage, StorageImage, compile,
};

use super::generate::Program;
use super::oracle::{self, Bindings, Io, Resource};

/// How the engine runs a program.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Setting {
    pub optimisations: Optimisations,
    pub recorded: bool,
    pub fault: Option<Fault>,
}

impl Setting {
    /// All optimisations, not recorded.
    pub const USUAL: Setting = Setting { optimisations: Optimisations::ALL, recorded: false, fault: None };

    /// The settings of a program: the usual one, and two others in turn.
    pub fn of(seed: u64) -> [Setting; 3] {
        const ALL: Optimisations = Optimisations::ALL;
        let others = [
            Optimisations::NONE,
            Optimisations { fold: false, ..ALL },
            Optimisations { unroll: false, ..ALL },
            Optimisations { hoist: false, ..ALL },
            Optimisations { share: false, ..ALL },
            Optimisations { flatten: false, ..ALL },
            Optimisations { fuse: false, ..ALL },
            Optimisations { drop_dead: false, ..ALL },
            Optimisations { drop_empty: false, ..ALL },
            ALL,
            // What only loops at run time can show.
            Optimisations { unroll: true, ..Optimisations::NONE },
        ];
        let n = others.len() as u64;
        let other = |k: u64, recorded| Setting { optimisations: others[(k % n) as usize], recorded, fault: None };
        let third = (seed / n).wrapping_add(seed.wrapping_mul(3)).wrapping_add(1);
        [Setting::USUAL, other(seed, true), other(third, seed.is_multiple_of(2))]
    }
}

/// What became of a program.
#[derive(Clone, Debug, PartialEq)]
pub enum Verdict {
    /// The engine and the oracle agree.
    Same,
    /// naga does not take the program, or it means nothing.
    Refused(String),
    /// They differ, or one of them failed.
    Different { setting: Option<Setting>, what: String },
}

/// The outputs of a batch: by connection, for each component, a word for each invocation.
type Outputs = BTreeMap<Io, Vec<[u32; LANES]>>;

/// What the oracle left.
pub struct Expected {
    bindings: Bindings,
    live: u64,
    outputs: Outputs,
}

/// A module as naga has it, its constants known.
pub fn resolve(program: &Program) -> Result<(naga::Module, ModuleInfo), String> {
    let options = naga::front::wgsl::Options { parse_doc_comments: false, capabilities: Capabilities::all() };
    let mut front = naga::front::wgsl::Frontend::new_with_options(options);
    let parsed = front.parse(&program.source).map_err(|e| e.emit_to_string(&program.source))?;
    let info = Validator::new(ValidationFlags::all(), Capabilities::all()).validate(&parsed).map_err(|e| format!("{e:?}"))?;
    let constants = program.constants.iter().cloned().collect();
    let (module, info) =
        process_overrides(&parsed, &info, Some((program.stage, "main")), &constants).map_err(|e| format!("{e:?}"))?;
    Ok((module.into_owned(), info.into_owned()))
}

/// Runs the oracle.
pub fn expect(program: &Program) -> Result<Expected, Verdict> {
    let (module, info) = resolve(program).map_err(Verdict::Refused)?;
    let mut bindings = program.bindings.clone();
    const STEPS: u64 = 1 << 26;
    let result = if program.stage == naga::ShaderStage::Compute {
        oracle::run_compute(&module, &info, "main", program.groups, &mut bindings, STEPS)
            .map(|()| oracle::BatchResult::default())
    } else {
        oracle::run_batch(&module, &info, program.stage, "main", &program.batch, &mut bindings, STEPS)
    };
    match result {
        Ok(outcome) => Ok(Expected { bindings, live: outcome.live, outputs: outcome.outputs }),
        Err(oracle::Fault::Undefined(text)) => Err(Verdict::Refused(format!("it means nothing: {text}"))),
        Err(fault) => Err(Verdict::Different { setting: None, what: format!("the oracle: {fault:?}") }),
    }
}

/// Runs a program both ways, with each of the settings.
pub fn check(program: &Program, settings: &[Setting]) -> Verdict {
    let expected = match expect(program) {
        Ok(expected) => expected,
        Err(verdict) => return verdict,
    };
    check_against(program, &expected, settings)
}

/// Runs the engine with each of the settings and compares with what the oracle left.
pub fn check_against(program: &Program, expected: &Expected, settings: &[Setting]) -> Verdict {
    // No loop of a generated program turns more often: one that a fault makes endless is stopped soon.
    let mut limits = Limits::default();
    limits.set("work.loop_turns=10000").expect("a limit of this name");
    let module = match Module::with_limits("generated", ModuleSource::Wgsl(&program.source), &limits) {
        Ok(module) => module,
        // The oracle runs it, so what the engine says no to is its own.
        Err(error) => return Verdict::Different { setting: None, what: error.to_string() },
    };
    check_module(&module, program, expected, settings)
}

/// As [`check_against`], with the program in another form.
pub fn check_module(module: &Module, program: &Program, expected: &Expected, settings: &[Setting]) -> Verdict {
    for &setting in settings {
        if let Err(what) = run(module, program, expected, setting) {
            return Verdict::Different { setting: Some(setting), what };
        }
    }
    Verdict::Same
}

/// Something bound, in the engine's form.
enum Store {
    Buffer(Words),
    Texture(Words, Option<View>, oracle::Texture),
    Sampler(Sampler),
}

impl Store {
    fn new(resource: &Resource) -> Result<Store, String> {
        let words = |bytes: &[u8]| {
            let words = Words::new(bytes.len() as u64);
            words.write(0, bytes);
            words
        };
        Ok(match resource {
            Resource::Buffer(bytes) => Store::Buffer(words(bytes)),
            Resource::Texture(texture) => {
                let words = words(&texture.bytes);
                // A storage texture's view is never looked through.
                let view = View::new(&words, &texture.desc, &texture.range, 0).map_err(|e| e.to_string())?;
                Store::Texture(words, Some(view), texture.clone())
            }
            Resource::Sampler(desc) => Store::Sampler(Sampler::new(desc)),
        })
    }

    fn resource(&self, storage: bool) -> shader::Resource<'_> {
        use shader::Resource as R;
        match self {
            Store::Buffer(words) => R::Buffer(BufferRange { words, offset: 0, size: words.len(), address: 0 }),
            Store::Texture(words, _, texture) if storage => R::Storage(StorageImage {
                words,
                desc: texture.desc,
                level: texture.range.base_level,
                base_layer: texture.range.base_layer,
                layers: texture.range.layers,
                address: 0,
            }),
            Store::Texture(_, view, _) => view.as_ref().map_or(R::None, R::Texture),
            Store::Sampler(sampler) => R::Sampler(sampler),
        }
    }
}

fn stage_of(program: &Program) -> Stage {
    match program.stage {
        naga::ShaderStage::Vertex => Stage::Vertex,
        naga::ShaderStage::Fragment => Stage::Fragment,
        _ => Stage::Compute,
    }
}

/// The oracle's name of a connection.
fn io_of(connection: Connection) -> Option<Io> {
    Some(match connection {
        Connection::Location { location, blend_src, .. } => Io::Location { location, second: blend_src == 1 },
        Connection::BuiltIn(builtin) => Io::BuiltIn(match builtin {
            BuiltIn::Position => naga::BuiltIn::Position { invariant: false },
            BuiltIn::VertexIndex => naga::BuiltIn::VertexIndex,
            BuiltIn::InstanceIndex => naga::BuiltIn::InstanceIndex,
            BuiltIn::ClipDistances => naga::BuiltIn::ClipDistances,
            BuiltIn::FrontFacing => naga::BuiltIn::FrontFacing,
            BuiltIn::SampleIndex => naga::BuiltIn::SampleIndex,
            BuiltIn::SampleMask => naga::BuiltIn::SampleMask,
            BuiltIn::FragDepth => naga::BuiltIn::FragDepth,
            BuiltIn::PrimitiveIndex => naga::BuiltIn::PrimitiveIndex,
            _ => return None,
        }),
    })
}

/// Runs the engine once.
fn run(module: &Module, program: &Program, expected: &Expected, setting: Setting) -> Result<(), String> {
    let options = Options {
        constants: &program.constants,
        optimisations: setting.optimisations,
        inject_fault: setting.fault,
        ..Options::default()
    };
    let compiled = compile(module, stage_of(program), Some("main"), &options).map_err(|e| e.to_string())?;
    let interface = compiled.interface();
    let mut stores: Vec<((u32, u32), Vec<Store>)> = Vec::new();
    for binding in &interface.bindings {
        let key = (binding.group, binding.binding);
        let bound = program.bindings.resources.get(&key).map_or(&[][..], Vec::as_slice);
        stores.push((key, bound.iter().map(Store::new).collect::<Result<_, _>>()?));
    }
    let bindings: Vec<Vec<shader::Resource<'_>>> = interface
        .bindings
        .iter()
        .zip(&stores)
        .map(|(binding, (_, stores))| {
            let storage = matches!(binding.kind, shader::BindingKind::StorageTexture { .. });
            stores.iter().map(|store| store.resource(storage)).collect()
        })
        .collect();
    let resources = Resources { bindings: &bindings, immediates: &program.bindings.immediates, ..Resources::default() };
    let uniforms = compiled.uniforms(&resources);
    let mut executor = Executor::new();
    let mut bound = executor.bind(&compiled, &resources, &uniforms);
    let mut recorder = match program.source.len() % 2 {
        0 => Recorder::new(),
        _ => Recorder::with(Extra { paths: true, both_levels: true, vectors: true }),
    };
    if program.stage == naga::ShaderStage::Compute {
        let count = program.groups.iter().map(|&n| u64::from(n)).product();
        let mut packets = Vec::new();
        let record = setting.recorded.then_some((&mut recorder, &mut packets));
        bound.run_groups(0..count, program.groups, record).map_err(|e| e.to_string())?;
    } else {
        let batch = &program.batch;
        for (slot, input) in interface.inputs.iter().enumerate() {
            let given = io_of(input.connection).and_then(|io| batch.inputs.get(&io)).ok_or("an input is not given")?;
            for (component, words) in given.iter().enumerate() {
                if let Some(register) = bound.input_mut(slot, component) {
                    *register = Lanes(*words);
                }
            }
        }
        let outcome = if setting.recorded {
            bound.run_recorded(batch.active, batch.helpers, &mut recorder)
        } else {
            bound.run(batch.active, batch.helpers)
        };
        let live = outcome.map_err(|e| e.to_string())?.mask;
        if live != expected.live {
            return Err(format!("invocations that were not discarded: {live:#x}, expected {:#x}", expected.live));
        }
        for (slot, output) in interface.outputs.iter().enumerate() {
            let wanted = io_of(output.connection).and_then(|io| expected.outputs.get(&io)).ok_or("an output is missing")?;
            for (component, words) in wanted.iter().enumerate() {
                let got = bound.output(slot, component);
                compare_lanes(&got.0, words, live, output.scalar == Scalar::Float)
                    .map_err(|what| format!("output {:?}, component {component}, {what}", output.connection))?;
            }
        }
        if program.stage == naga::ShaderStage::Vertex {
            enclose(&compiled, &resources, &uniforms, program, expected)?;
        }
    }
    if setting.recorded {
        check_costs(&mut recorder)?;
    }
    compare_memory(&stores, &expected.bindings)
}

/// What was recorded is whole: every request has its lines, every quad its cost.
fn check_costs(recorder: &mut Recorder) -> Result<(), String> {
    let quads = recorder.quads;
    let work::Invocations { costs, requests, lines } = recorder.take();
    if let Some(quad) = quads.iter().find(|quad| usize::from(quad.cost) >= costs.costs.len()) {
        return Err(format!("{quad:?} of {} costs", costs.costs.len()));
    }
    match requests.iter().find(|r| r.first_line as usize + usize::from(r.lines) > lines.len()) {
        Some(request) => Err(format!("{request:?} of {} lines", lines.len())),
        None => Ok(()),
    }
}

fn is_nan(bits: u32) -> bool {
    f32::from_bits(bits).is_nan()
}

fn compare_lanes(got: &[u32; LANES], want: &[u32; LANES], live: u64, float: bool) -> Result<(), String> {
    let same = |i: usize| got[i] == want[i] || float && is_nan(got[i]) && is_nan(want[i]);
    match (0..LANES).find(|&i| live >> i & 1 != 0 && !same(i)) {
        Some(i) => Err(format!("invocation {i}: {:#x} ({}), expected {:#x}", got[i], f32::from_bits(got[i]), want[i])),
        None => Ok(()),
    }
}

/// Buffers that hold numbers in floating point, whose NaN need not be the same.
const NUMBERS: [(u32, u32); 2] = [(0, 4), (0, 9)];

fn compare_memory(stores: &[((u32, u32), Vec<Store>)], expected: &Bindings) -> Result<(), String> {
    for (key, elements) in stores {
        for (store, wanted) in elements.iter().zip(expected.resources.get(key).into_iter().flatten()) {
            let (words, bytes) = match (store, wanted) {
                (Store::Buffer(words), Resource::Buffer(bytes)) => (words, bytes),
                (Store::Texture(words, ..), Resource::Texture(texture)) => (words, &texture.bytes),
                _ => continue,
            };
            let half = |x: u32| x & 0x7fff > 0x7c00;
            let both = |a: u32, b: u32| a == b || half(a) && half(b);
            for (k, want) in bytes.chunks_exact(4).enumerate() {
                let (got, want) = (words.load(k), u32::from_le_bytes([want[0], want[1], want[2], want[3]]));
                let nan = is_nan(got) && is_nan(want) || both(got & 0xffff, want & 0xffff) && both(got >> 16, want >> 16);
                if got != want && !(NUMBERS.contains(key) && nan) {
                    return Err(format!("binding {key:?}, word {k}: {got:#x}, expected {want:#x}"));
                }
            }
        }
    }
    Ok(())
}

/// The bounds of the outputs hold what the oracle computes.
fn enclose(
    compiled: &Compiled,
    resources: &Resources<'_>,
    uniforms: &shader::Uniforms,
    program: &Program,
    expected: &Expected,
) -> Result<(), String> {
    let interface = compiled.interface();
    let active = |words: &[u32; LANES]| -> Vec<u32> {
        (0..LANES).filter(|i| program.batch.active >> i & 1 != 0).map(|i| words[i]).collect()
    };
    let mut given = Vec::new();
    for (slot, input) in interface.inputs.iter().enumerate() {
        let words = io_of(input.connection).and_then(|io| program.batch.inputs.get(&io)).ok_or("an input is not given")?;
        for (component, words) in words.iter().enumerate() {
            if let Some(register) = compiled.input_register(slot, component) {
                given.push((register, Range::all(&active(words))));
            }
        }
    }
    let mut encloser = Encloser::new();
    if !encloser.enclose(compiled, resources, uniforms, &given) {
        return Ok(());
    }
    for (slot, output) in interface.outputs.iter().enumerate() {
        let wanted = io_of(output.connection).and_then(|io| expected.outputs.get(&io)).ok_or("an output is missing")?;
        for (component, words) in wanted.iter().enumerate() {
            let range = encloser.output(compiled, slot, component);
            for bits in active(words) {
                let x = f32::from_bits(bits);
                let inside = range.bits().is_none_or(|only| only == bits || is_nan(only) && is_nan(bits))
                    && range.ends().is_none_or(|(least, most)| least <= x && x <= most);
                if !inside {
                    let place = output.connection;
                    return Err(format!(
                        "output {place:?}, component {component} is {bits:#x} ({x}), which is not in {range:?}"
                    ));
                }
            }
        }
    }
    Ok(())
}

/// Leaves out statements and blocks as long as the program still differs: the smallest program found.
pub fn shrink(program: &Program, settings: &[Setting]) -> Program {
    let mut best = program.clone();
    let mut tries = 0;
    loop {
        let lines: Vec<&str> = best.source.lines().collect();
        let mut smaller = None;
        'search: for size in [16, 8, 4, 2, 1] {
            for first in 0..lines.len() {
                let Some(last) = piece(&lines, first, size) else { continue };
                let kept = [&lines[..first], &lines[last..]].concat().join("\n");
                let candidate = Program { source: kept, ..best.clone() };
                tries += 1;
                if tries > 2000 {
                    return best;
                }
                if matches!(check(&candidate, settings), Verdict::Different { setting: Some(_), .. }) {
                    smaller = Some(candidate);
                    break 'search;
                }
            }
        }
        match smaller {
            Some(candidate) => best = candidate,
            None => return best,
        }
    }
}

/// The end of `size` whole statements that begin at a line, or of a block if it opens one.
fn piece(lines: &[&str], first: usize, size: usize) -> Option<usize> {
    let (mut depth, mut at, mut statements) = (0i32, first, 0);
    while at < lines.len() {
        // Without these the invocations would write each other's memory, and the program would mean nothing.
        if ["lane = ", "base = ", "li = "].iter().any(|own| lines[at].starts_with(own)) {
            return None;
        }
        for c in lines[at].chars() {
            depth += i32::from(c == '{') - i32::from(c == '}');
            if depth < 0 {
                return None;
            }
        }
        at += 1;
        if depth == 0 && !lines.get(at).is_some_and(|next| next.starts_with("} else")) {
            statements += 1;
            if statements == size {
                return Some(at);
            }
        }
    }
    None
}
