//! What the simulated card costs: cycles and shaded fragments per second of host time, on work made by hand.
//!
//! `cargo bench --bench machine [-- CONFIG]`

use fillrate::machine::{Config, Machine};
use fillrate::sim::Clock;
use fillrate::synthetic::{Scene, events};

/// CPU time of this thread in seconds: what other programs on the host take does not count.
fn cpu_seconds() -> f64 {
    let text = std::fs::read_to_string("/proc/thread-self/schedstat").unwrap_or_default();
    let on_cpu = text.split(' ').next().and_then(|nanoseconds| nanoseconds.parse::<f64>().ok());
    on_cpu.map_or_else(|| std::time::UNIX_EPOCH.elapsed().map_or(0.0, |time| time.as_secs_f64()), |time| time * 1e-9)
}

fn measure(name: &str, config: &Config, scene: &Scene, clock: Clock) -> f64 {
    let work = events(scene);
    let mut best = f64::INFINITY;
    let mut figures = (0, 0.0);
    for _ in 0..3 {
        let mut machine = Machine::new(config).expect("a sound configuration");
        let start = cpu_seconds();
        let report = machine.run(work.iter().cloned(), clock).expect("a run");
        let seconds = cpu_seconds() - start;
        best = best.min(seconds);
        let shaded = report.total.number("funnel.fragments_shaded").expect("a counter");
        figures = (report.cycles, shaded);
    }
    let (cycles, shaded) = figures;
    println!(
        "{name:24} {clock:?}: {cycles} cycles, {shaded} fragments, {:.1} ms: {:.2} M cycles/s, {:.2} M fragments/s",
        best * 1e3,
        cycles as f64 / best / 1e6,
        shaded / best / 1e6
    );
    best
}

fn main() {
    let name = std::env::args().skip(1).find(|argument| !argument.starts_with("--")).unwrap_or_else(|| "baseline".to_owned());
    let config = Config::built_in(&name).expect("a built-in configuration");
    let large = Scene { width: 800, height: 600, triangles: 3000, size: 120.0, draws: 2, segments: 4, ..Scene::default() };
    let small = Scene { triangles: 60_000, size: 6.0, ..large.clone() };
    measure("large triangles", &config, &large, Clock::SkipIdle);
    measure("blended", &config, &Scene { blend: true, depth_format: None, ..large.clone() }, Clock::SkipIdle);
    measure("small triangles", &config, &small, Clock::SkipIdle);

    // One pipeline behind a memory of 400 cycles: most cycles are waits.
    let mut waiting = Config::built_in("tiny").expect("built in");
    for change in ["memory.kind=ideal", "memory.ideal_latency=400", "core.warps=1", "texture.fifo=1", "dispatch.reorder=1"] {
        waiting.set(change).expect("a knob");
    }
    let scene = Scene { textures: 4, triangles: 100, ..Scene::default() };
    let every = measure("400 cycles of latency", &waiting, &scene, Clock::EveryCycle);
    let skip = measure("400 cycles of latency", &waiting, &scene, Clock::SkipIdle);
    println!("skip-idle is {:.1} times as fast as every-cycle", every / skip);
}
