//! The visible wgpu traces import. They are not part of the repository: set `FILLRATE_PEERS` to the folder that holds `wgpu/`.

use std::path::{Path, PathBuf};

use import::{self, TraceKind};
use trace::command::Command;
use trace::{Trace, TraceError};

fn peers() -> Option<Vec<PathBuf>> {
    let Some(root) = std::env::var_os("FILLRATE_PEERS") else {
        eprintln!("left out: FILLRATE_PEERS is not set, so there are no recorded wgpu traces to import");
        return None;
    };
    let mut folders: Vec<PathBuf> = std::fs::read_dir(Path::new(&root).join("wgpu"))
        .expect("the folder of wgpu traces")
        .map(|entry| entry.expect("an entry").path())
        .filter(|path| path.is_dir())
        .collect();
    folders.sort();
    assert!(!folders.is_empty(), "no traces in FILLRATE_PEERS/wgpu");
    Some(folders)
}

fn commands(trace: &Trace) -> Vec<Command> {
    let mut all = Vec::new();
    trace
        .for_each_command::<TraceError>(|_, command| {
            all.push(command.clone());
            Ok(())
        })
        .expect("commands");
    all
}

#[test]
fn every_visible_trace_imports() {
    for folder in peers().into_iter().flatten() {
        let found = import::detect(&folder).expect("a trace");
        assert_eq!(found.kind, TraceKind::Wgpu);
        let trace = import::open(&folder).unwrap_or_else(|error| panic!("{error}"));
        let commands = commands(&trace);
        let count = |test: fn(&Command) -> bool| commands.iter().filter(|c| test(c)).count();
        eprintln!(
            "{}: {} commands, {} passes, {} draws, {} destroyed",
            folder.display(),
            commands.len(),
            count(|c| matches!(c, Command::BeginRenderPass { .. } | Command::BeginComputePass { .. })),
            count(|c| matches!(c, Command::Draw { .. } | Command::DrawIndexed { .. })),
            count(|c| matches!(c, Command::Destroy(_))),
        );
        assert!(count(|c| matches!(c, Command::CopyTextureToBuffer { .. })) == 1);
        // All payload is there, with the bytes that the commands ask for.
        for command in &commands {
            match command {
                Command::WriteBuffer { data, .. } | Command::WriteTexture { data, .. } => {
                    assert_eq!(trace.data(data).unwrap().len() as u64, data.size);
                }
                Command::CreateShader { source: trace::command::ShaderSource::Wgsl(name), .. } => {
                    assert!(trace.text(name).unwrap().contains("fn "));
                }
                _ => {}
            }
        }
        trace::check(&trace).unwrap_or_else(|error| panic!("{error}"));
        // Written as a native trace it says the same.
        let home = tempfile::tempdir().unwrap();
        trace::write(&trace, home.path()).unwrap_or_else(|error| panic!("{error}"));
        assert!(self::commands(&import::open(home.path()).unwrap()) == commands, "{}", folder.display());
    }
}
