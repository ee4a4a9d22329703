//! Whole traces on every sort class: the scenes kept in `traces/`, the visible wgpu traces and two recorded OpenGL programs, which are not
//! part of the repository (`FILLRATE_PEERS` names the folder that holds `wgpu/` and `gl/`). A machine that keeps API order draws what `render` draws, bit for bit; a
//! machine that does not names the passes that need it.

use std::path::{Path, PathBuf};

use crate::common::{config, entries, is_chosen, run};
use fillrate::import;
use fillrate::machine::Config;
use fillrate::render::{self, Options};
use fillrate::sim::Clock;
use fillrate::work::{Event, RenderKey, Shade};
use rayon::prelude::*;

/// A machine of each class; in those that sort last other pipelines have drawn most of what hides a quad.
const MACHINES: [(&str, &[&str]); 6] = [
    ("sort-first", &["pipelines=3"]),
    ("sort-middle", &["pipelines=5", "geometry_units=3", "distribute.tile=8"]),
    ("sort-middle-binned", &["pipelines=3", "bin.hide=true"]),
    ("sort-last-fragment", &["pipelines=3", "order.early=remote"]),
    ("sort-last-fragment", &["pipelines=4", "order.early=local", "network.topology=ring"]),
    ("sort-last-image", &["pipelines=3"]),
];

/// Scenes of `traces/` with passes that sort-last-image names: they blend, or draw over each other without depth.
const SCENES_NEEDING_ORDER: &[&str] = &["panel", "particles", "sprites"];

/// From this number of quads on, a trace is drawn by only one machine of each class, to save time.
const LARGE: u64 = 50_000;

/// Room for the largest workgroups of the programs.
const ROOM: [&str; 2] = ["core.warps=32", "core.registers=65536"];

/// The work of a trace.
fn work(trace: &Path, shade: Shade) -> Vec<Event> {
    let name = trace.display();
    let trace = import::open(trace).unwrap_or_else(|error| panic!("{error}"));
    let key = RenderKey { shade, ..RenderKey::default() };
    // Only the first frames of a long sequence.
    let options = Options { record: true, key, frames: (0..2).into(), ..Options::default() };
    let mut events = Vec::new();
    let mut keep = |event| {
        events.push(event);
        Ok(())
    };
    render::render(&trace, &options, &mut keep).unwrap_or_else(|error| panic!("{name}: {error}"));
    events
}

/// Draws each trace on every machine, or in the usual suite on every third one and by images; gives those whose passes need an order that sort-last-image does not keep, with their wrong pixels.
fn drawn(traces: &[PathBuf]) -> Vec<(String, u64, u64)> {
    let each = |(number, trace): (usize, &PathBuf)| {
        let name = trace.file_stem().expect("a name").to_string_lossy().into_owned();
        let works = [work(trace, Shade::Visible), work(trace, Shade::Covered)];
        let quads = |event: &Event| if let Event::Segment(segment) = event { segment.funnel.quads_rasterized } else { 0 };
        let large = works[0].iter().map(quads).sum::<u64>() > LARGE;
        let mut machines = MACHINES.to_vec();
        if large {
            machines.dedup_by_key(|&mut (class, _)| class);
        }
        let chosen = |&(at, (class, _)): &(usize, &(&str, &[&str]))| *class == "sort-last-image" || is_chosen(3, &[number, at]);
        let machines: Vec<Config> = machines
            .iter()
            .enumerate()
            .filter(chosen)
            .map(|(_, machine)| machine)
            .map(|(class, changes)| config(class, &[&ROOM, *changes].concat()))
            .collect();
        let found: Vec<Option<(String, u64, u64)>> = machines
            .par_iter()
            .map(|machine| {
                let covered = machine.render_key().shade == Shade::Covered;
                let report = run(machine, &works[usize::from(covered)], Clock::SkipIdle);
                let wrong: u64 =
                    report.frames.iter().flat_map(|frame| &frame.picture).map(|picture| picture.wrong_pixels).sum();
                assert!(report.frames.iter().any(|frame| frame.picture.is_some()), "{name} shows nothing");
                let needs = report.total.number("sort.passes_needing_order").unwrap_or(0.0) as u64;
                assert!(needs > 0 || wrong == 0, "{name} on {} with {:?}: {wrong} wrong pixels", machine.name, machine.order);
                (needs > 0).then(|| (name.clone(), needs, wrong))
            })
            .collect();
        found.into_iter().flatten().collect::<Vec<_>>()
    };
    traces.par_iter().enumerate().flat_map_iter(each).collect()
}

#[test]
fn every_scene_is_drawn_by_every_class() {
    let traces = entries(&Path::new(env!("CARGO_MANIFEST_DIR")).join("traces"));
    assert!(traces.len() >= 9, "{traces:?}");
    let unordered = drawn(&traces);
    let names: Vec<&str> = unordered.iter().map(|(name, ..)| name.as_str()).collect();
    assert_eq!(names, SCENES_NEEDING_ORDER, "{unordered:?}");
}

#[test]
fn every_visible_trace_is_drawn_by_every_class() {
    let Some(root) = std::env::var_os("FILLRATE_PEERS") else {
        eprintln!("left out: FILLRATE_PEERS is not set, so there are no recorded wgpu traces to draw");
        return;
    };
    let mut traces: Vec<PathBuf> = entries(&Path::new(&root).join("wgpu")).into_iter().filter(|path| path.is_dir()).collect();
    assert!(!traces.is_empty(), "no traces in FILLRATE_PEERS/wgpu");
    traces.extend(["glxgears", "atlantis"].map(|name| Path::new(&root).join("gl").join(name)));
    let unordered = drawn(&traces);
    // Blended and stencilled passes, and no others.
    for (name, passes, wrong) in &unordered {
        eprintln!("{name}: {passes} passes need an order that sort-last-image does not keep; {wrong} wrong pixels");
    }
    assert!(unordered.len() < traces.len());
}
