//! Every pipeline of the recorded wgpu programs compiles: their shaders are WGSL, SPIR-V and naga IR as wgpu wrote them.

use std::collections::HashMap;
use std::path::{Path, PathBuf};

use num::ShaderId;
use shader::{self, Module, ModuleSource, Options};
use trace::command::{Command, ShaderSource, StageDesc};
use trace::{Trace, TraceError};

fn load(trace: &Trace, source: &ShaderSource) -> Module {
    let (ShaderSource::Wgsl(name) | ShaderSource::SpirV(name) | ShaderSource::NagaIr(name)) = source;
    let bytes = trace.blob(name).unwrap();
    let text = || std::str::from_utf8(&bytes).unwrap();
    let source = match source {
        ShaderSource::Wgsl(_) => ModuleSource::Wgsl(text()),
        ShaderSource::SpirV(_) => ModuleSource::SpirV(&bytes),
        ShaderSource::NagaIr(_) => ModuleSource::NagaIr(text()),
    };
    Module::new(name, source).unwrap_or_else(|error| panic!("{}: {error}", trace.file().display()))
}

fn compile_all(folder: &Path) -> usize {
    let trace = import::open(folder).unwrap_or_else(|error| panic!("{error}"));
    let mut modules: HashMap<ShaderId, Module> = HashMap::new();
    let mut compiled = 0;
    let mut compile = |modules: &HashMap<ShaderId, Module>, stage: &StageDesc, kind: shader::Stage| {
        let options = Options { constants: &stage.constants, ..Options::default() };
        shader::compile(&modules[&stage.shader], kind, stage.entry.as_deref(), &options)
            .unwrap_or_else(|error| panic!("{}: {error}", folder.display()));
        compiled += 1;
    };
    trace
        .for_each_command::<TraceError>(|_, command| {
            match command {
                Command::CreateShader { id, source, .. } => drop(modules.insert(*id, load(&trace, source))),
                Command::CreateRenderPipeline { desc, .. } => {
                    compile(&modules, &desc.vertex, shader::Stage::Vertex);
                    desc.fragment.iter().for_each(|stage| compile(&modules, stage, shader::Stage::Fragment));
                }
                Command::CreateComputePipeline { stage, .. } => compile(&modules, stage, shader::Stage::Compute),
                _ => {}
            }
            Ok(())
        })
        .unwrap();
    compiled
}

#[test]
fn kept_programs_compile() {
    for (name, stages) in [("culling", 8), ("deferred", 9), ("formats", 24), ("window", 4)] {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/import").join(name);
        assert_eq!(compile_all(&folder), stages, "{name}");
    }
}

#[test]
fn visible_programs_compile() {
    let Some(root) = std::env::var_os("FILLRATE_PEERS") else {
        eprintln!("left out: FILLRATE_PEERS is not set, so there are no recorded wgpu traces to compile");
        return;
    };
    let mut folders: Vec<PathBuf> =
        std::fs::read_dir(Path::new(&root).join("wgpu")).unwrap().map(|entry| entry.unwrap().path()).collect();
    folders.sort();
    folders.iter().filter(|path| path.is_dir()).for_each(|folder| assert!(compile_all(folder) > 0));
}
