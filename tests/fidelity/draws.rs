//! Draws that stand for all draws of a frame.

use std::path::Path;

use fillrate::machine::Config;
use fillrate::run::draws::{Census, DrawSampling, Told, census};
use fillrate::run::replay::{Fidelity, Options, Replay, replay};
use fillrate::run::sample::{Clusters, Interval, random};
use fillrate::run::sampled::counted;
use fillrate::sim::Clock;
use fillrate::stats::Tree;
use fillrate::trace::Trace;

fn town() -> Trace {
    Trace::open(Path::new(env!("CARGO_MANIFEST_DIR")).join("traces/town.zip")).expect("a trace of the repository")
}

fn options(fidelity: Fidelity, changes: &[&str]) -> Options {
    let mut config = Config::built_in("baseline").expect("it is built in");
    for change in changes {
        config.set(change).expect("a knob");
    }
    Options { config, fidelity, clock: Clock::SkipIdle, frames: 0..u32::MAX, watch: None }
}

fn sampled(samples: u32, seed: u64, warm_up: u32, changes: &[&str]) -> anyhow::Result<Replay> {
    let sampling = DrawSampling { samples, seed, warm_up };
    replay(&town(), &options(Fidelity::SampledDraws(sampling), changes), &|_| ())
}

const PATHS: [&str; 8] = [
    "cycles",
    "memory.dram.bytes",
    "memory.clients.color.write_bytes",
    "memory.clients.depth.read_bytes",
    "memory.clients.texture.read_bytes",
    "memory.clients.vertex.read_bytes",
    "caches.l2.misses",
    "caches.texture.misses",
];

fn truth(census: &Census, path: &str) -> f64 {
    census.inner.iter().chain(&census.rest).map(|tree| counted(tree, path)).sum()
}

#[test]
fn pieces_add_up_to_the_frame_and_stand_for_it() {
    let whole = replay(&town(), &options(Fidelity::Cycle, &[]), &|_| ()).expect("a replay");
    let census = census(&town(), &options(Fidelity::Cycle, &[])).expect("a replay");
    // All pieces are the frame, in cycles and in what caches and memory count.
    assert_eq!(Some(census.cycles as f64), whole.total.number("cycles"));
    for path in PATHS {
        assert_eq!(truth(&census, path), counted(&whole.total, path), "{path}");
    }

    // One draw of pieces, simulated: the picture is the machine's own and right, and what is counted is near what the same pieces
    // counted with all others simulated too.
    let told = |drawn: &[usize], clusters: &Clusters, path: &str| {
        let own: Vec<&Tree> = drawn.iter().map(|&at| &census.inner[at]).collect();
        let rest: Vec<&Tree> = census.rest.iter().collect();
        Told { expected: &census.pieces.expected, clusters, drawn, own: &own, rest: &rest }.total(path)
    };
    let clusters = Clusters::new(&census.pieces.signatures, 8);
    for seed in [1, 2] {
        let run = sampled(8, seed, 2, &[]).expect("a replay");
        for (run, whole) in run.frames.iter().zip(&whole.frames) {
            assert!(run.shown == whole.shown, "seed {seed}: the picture");
        }
        assert_eq!(run.total.number("sort.wrong_pixels"), Some(0.0));
        let simulated = run.total.number("sampled.simulated_pieces").expect("it is told");
        assert!(simulated < 0.4 * run.total.number("sampled.pieces").expect("it is told"), "{simulated} pieces");
        let drawn = clusters.draw(&mut random(seed));
        let window = run.total.number("cycles").expect("cycles") / told(&drawn, &clusters, "cycles").value - 1.0;
        assert!(window.abs() < 0.005, "seed {seed}: pieces take {:+.2} % among others that are not simulated", 100.0 * window);
        let margins = "sampled.margins";
        let margin = match run.total.get(margins) {
            Some(fillrate::stats::Node::Tree(tree)) => tree.number("cycles").expect("an interval"),
            _ => panic!("no {margins}"),
        };
        assert!((run.total.number("cycles").expect("cycles") - census.cycles as f64).abs() <= margin, "seed {seed}");
    }

    // Over a thousand draws intervals hold the truth, and mostly it is not far.
    for samples in [8, 12, 16] {
        let clusters = Clusters::new(&census.pieces.signatures, samples);
        for path in PATHS {
            let truth = truth(&census, path);
            let found: Vec<_> = (0..1000).map(|seed| told(&clusters.draw(&mut random(seed)), &clusters, path)).collect();
            let held = found.iter().filter(|found| found.covers(truth)).count();
            let mean = |of: &dyn Fn(&Interval) -> f64| found.iter().map(of).sum::<f64>() / 10.0 / truth;
            let (off, margin) = (mean(&|found| (found.value - truth).abs()), mean(&|found| found.margin));
            assert!(held >= 990, "{samples} pieces, {path}: {held} of 1000 hold, {margin:.1} % wide");
            assert!(path != "cycles" || off < 6.0, "{samples} pieces are off by {off:.1} %");
        }
    }
}

#[test]
fn what_cannot_be_sampled_is_refused_by_name() {
    let refused = |found: anyhow::Result<Replay>, with: &str| {
        let error = found.expect_err("it is refused").to_string();
        assert!(error.contains(with), "{error}");
    };
    refused(sampled(7, 1, 1, &[]), "8 are the least");
    refused(sampled(8, 1, 0, &[]), "--warm-up 1");
    refused(sampled(40, 1, 1, &[]), "too few to sample 40");
    refused(sampled(8, 1, 1, &["sort=sort-middle-binned"]), "tile after tile");
    refused(sampled(8, 1, 1, &["sort=sort-last-image"]), "copies");
    refused(sampled(8, 1, 1, &["sort=sort-last-fragment", "order.early=local"]), "order.early");
    refused(sampled(8, 1, 1, &["sort=sort-last-fragment", "order.keep=never"]), "order.keep");
}
