//! Replays a trace on several cards, prints counters of each, and writes the picture: `replay [TRACE [CARD]...]`. Without a trace it takes a
//! built-in scene, without cards two of them.

use std::error::Error;

use fillrate::mem::{CACHES, CLIENTS, CacheCounts, ClientCounts};
use fillrate::num::Limits;
use fillrate::stats::{FRAME, FrameCounts};
use fillrate::{Config, Fidelity, Options, Replay, ReplayError, import, picture, replay, scenes};

fn main() -> Result<(), Box<dyn Error>> {
    let mut arguments = std::env::args().skip(1);
    let trace = match arguments.next() {
        Some(path) => import::open(path)?,
        None => scenes::named("cube").ok_or("there is no scene cube")?.open(&Limits::default())?,
    };
    let mut cards: Vec<String> = arguments.collect();
    if cards.is_empty() {
        cards = ["baseline", "sort-middle-binned"].map(String::from).to_vec();
    }

    println!("{:<20}{:>14}{:>16}{:>18}", "card", "cycles", "texture misses", "bytes of colours");
    for name in &cards {
        let mut config = Config::built_in(name)?;
        // A knob is set by its path, as by `--set`. What it allows is checked.
        config.set("scanout.enabled=false")?;
        config.check()?;
        let done = match replay(&trace, &Options::new(config, Fidelity::Cycle), &|_| ()) {
            // Whatever the machine stops on is about this card alone.
            Err(ReplayError::Machine(error)) => {
                eprintln!("{name}: {error}");
                continue;
            }
            done => done?,
        };
        let FrameCounts { cycles } = FRAME.sum(&done.total);
        let CacheCounts { misses, .. } = CACHES.sum_of(&done.total, "texture");
        let ClientCounts { write_bytes, .. } = CLIENTS.sum_of(&done.total, "color");
        println!("{name:<20}{cycles:>14}{misses:>16}{write_bytes:>18}");
        write_picture(name, &done)?;
    }
    Ok(())
}

/// Writes the picture of the last frame, in the folder for temporary files.
fn write_picture(name: &str, done: &Replay) -> Result<(), Box<dyn Error>> {
    let Some((surface, bytes)) = done.frames.last().and_then(|frame| frame.shown.as_ref()) else { return Ok(()) };
    let file = std::env::temp_dir().join(format!("fillrate-{name}.png"));
    std::fs::write(&file, picture::png(&picture::picture(surface, bytes)?)?)?;
    println!("  {}", file.display());
    Ok(())
}
