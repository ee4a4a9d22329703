//! Records the scenes that are kept in `traces/`: `record_scenes [DIR]`. A test records them again and compares the bytes.

use std::path::Path;
use std::process::ExitCode;

use fillrate::scenes;

fn main() -> ExitCode {
    let mut arguments = std::env::args().skip(1);
    let folder = arguments.next().unwrap_or_else(|| "traces".into());
    if arguments.next().is_some() || folder.starts_with('-') {
        eprintln!("usage: record_scenes [DIR]\n\nWrites all scenes into DIR (traces).");
        return ExitCode::from(2);
    }
    for scene in scenes::ALL {
        if let Err(error) = scene.save(Path::new(&folder)) {
            eprintln!("{error}");
            return ExitCode::from(1);
        }
    }
    ExitCode::SUCCESS
}
