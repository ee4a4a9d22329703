//! The modules of recorded Vulkan programs, which are not in the repository: `FILLRATE_PEERS` names the folder of the recordings.

use std::collections::{BTreeMap, BTreeSet};
use std::fs::File;
use std::io::BufReader;
use std::path::{Path, PathBuf};

use gfxr::{Body, Reader, Value};
use spirv::{Options, Stage, translate};

use crate::engine::engine_stage;

/// Modules of the recorded programs.
const MODULES: usize = 138;

/// Modules that compile after they were rewritten. The others are tessellation and geometry stages.
const ACCEPTED: usize = 133;

/// The folders of captures; none where they are not there.
fn captures() -> Option<Vec<PathBuf>> {
    let peers = PathBuf::from(std::env::var_os("FILLRATE_PEERS")?).join("vulkan");
    let entries = std::fs::read_dir(peers).ok()?;
    let mut found: Vec<PathBuf> = entries.filter_map(|entry| Some(entry.ok()?.path())).filter(|path| path.is_dir()).collect();
    found.sort();
    Some(found)
}

fn words(value: &Value) -> Option<Vec<u32>> {
    match value {
        Value::Words(words) => Some(words.to_vec()),
        Value::Bytes(bytes) => Some(bytes.chunks_exact(4).map(|b| u32::from_le_bytes([b[0], b[1], b[2], b[3]])).collect()),
        _ => None,
    }
}

/// The modules of a capture by handle.
fn modules(folder: &Path) -> BTreeMap<u64, Vec<u32>> {
    let name = folder.file_name().expect("a folder").to_string_lossy().into_owned();
    let file = File::open(folder.join(format!("{name}.gfxr"))).expect("a capture");
    let mut reader = Reader::new(BufReader::new(file)).expect("a header");
    let mut found = BTreeMap::new();
    while let Some(block) = reader.next_block().expect("a block") {
        let Body::Call(call) = &block.body else { continue };
        if call.name != "vkCreateShaderModule" {
            continue;
        }
        let Ok(Value::Handle(handle)) = call.get("pShaderModule").handle().map(Value::Handle) else { continue };
        let info = call.get("pCreateInfo").structure().expect("a structure");
        found.insert(handle, words(info.get("pCode").value()).expect("words"));
    }
    found
}

/// The stage and the name of the first entry point.
fn entry(words: &[u32]) -> Option<(Stage, String)> {
    let mut at = 5;
    while let Some(&word) = words.get(at) {
        if word & 0xffff == 15 {
            let stage = [
                Stage::Vertex,
                Stage::TessellationControl,
                Stage::TessellationEvaluation,
                Stage::Geometry,
                Stage::Fragment,
                Stage::Compute,
            ]
            .into_iter()
            .nth(*words.get(at + 1)? as usize)?;
            let bytes = words[at + 3..].iter().flat_map(|word| word.to_le_bytes()).take_while(|&byte| byte != 0);
            return Some((stage, String::from_utf8(bytes.collect()).ok()?));
        }
        at += (word >> 16).max(1) as usize;
    }
    None
}

#[test]
fn modules_of_recorded_programs_compile() {
    let Some(captures) = captures() else { return };
    let (mut all, mut accepted) = (0, 0);
    let mut reasons = BTreeSet::new();
    println!("| capture | modules | accepted | refused |\n| --- | --- | --- | --- |");
    for folder in captures {
        let modules = modules(&folder);
        let mut refused = Vec::new();
        for words in modules.values() {
            let (stage, name) = entry(words).expect("an entry point");
            let compiled = translate(words, &name, stage, &Options { flip_y: true, ..Options::default() })
                .map_err(|refusal| refusal.to_string())
                .and_then(|translated| {
                    let module = shader::Module::new("recorded", shader::ModuleSource::SpirV(&translated.bytes()));
                    let module = module.map_err(|error| error.to_string())?;
                    let options = shader::Options::default();
                    shader::compile(&module, engine_stage(stage), Some(&name), &options).map_err(|error| error.to_string())
                });
            if let Err(reason) = compiled {
                refused.push(reason);
            }
        }
        let name = folder.file_name().expect("a folder").to_string_lossy().into_owned();
        println!("| {name} | {} | {} | {} |", modules.len(), modules.len() - refused.len(), refused.join("; "));
        all += modules.len();
        accepted += modules.len() - refused.len();
        reasons.extend(refused.into_iter().map(|reason| reason.split(": ").last().unwrap_or_default().to_owned()));
    }
    println!("| all | {all} | {accepted} | |");
    assert_eq!((all, accepted), (MODULES, ACCEPTED));
    let stages = ["geometry", "tessellation control", "tessellation evaluation"];
    assert_eq!(reasons, stages.map(|stage| format!("the {stage} stage is not supported")).into());
}
