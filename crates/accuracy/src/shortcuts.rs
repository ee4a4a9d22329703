//! What the model does not do as hardware does, because the exact way is slow or the host's work is large: each such shortcut against
//! the exact way, where that can be had, on whole replays.

use anyhow::Result;
use serde_json::{Value, json};

use super::measure::{self, Measure};
use gfx::format::Format;
use machine::Config;
use run::machines::{self, Ran};
use sim::Clock;
use trace::Trace;
use trace::record::{self, Recorder};

/// A shortcut of the model.
#[derive(Clone, Copy, Debug)]
pub struct Shortcut {
    /// What it is called.
    pub name: &'static str,
    /// What the model does.
    pub what: &'static str,
    /// What the exact way is.
    pub exact: &'static str,
    /// Settings of both runs.
    both: &'static [&'static str],
    /// Settings of the exact run on top.
    on_top: &'static [&'static str],
    clock: Clock,
    /// What it is about, beside cycles.
    work: Option<Measure>,
}

/// All shortcuts that can be measured.
pub const SHORTCUTS: &[Shortcut] = &[
    Shortcut {
        name: "divergence",
        what: "a warp executes, step by step and class by class, the most that any of its parts needs",
        exact: "its parts' paths are followed: an instruction is executed once for all parts that are there at the time \
                (core.execution=lockstep)",
        both: &[],
        on_top: &["core.execution=lockstep"],
        clock: Clock::SkipIdle,
        work: Some(measure::INSTRUCTIONS),
    },
    Shortcut {
        name: "order of issue",
        what: "a warp issues the instructions of a step from the class that it has most of",
        exact: "in the order of the program (core.execution=in-order, against lockstep)",
        both: &["core.execution=lockstep"],
        on_top: &["core.execution=in-order"],
        clock: Clock::SkipIdle,
        work: Some(measure::INSTRUCTIONS),
    },
    Shortcut {
        name: "composed blocks",
        what: "sort-last-image writes composed blocks whole",
        exact: "compressed, as a ROP would (compose.compression=true)",
        both: &["sort=sort-last-image"],
        on_top: &["compose.compression=true"],
        clock: Clock::SkipIdle,
        work: Some(measure::COMPOSED),
    },
    Shortcut {
        name: "idle cycles",
        what: "units that nothing can move are not asked",
        exact: "every unit is asked in every cycle (--clock every-cycle)",
        both: &[],
        on_top: &[],
        clock: Clock::EveryCycle,
        work: None,
    },
];

/// Shortcuts for which the exact way cannot be had, and why.
pub const UNMEASURED: &[(&str, &str)] = &[
    (
        "blocks of 8x8 pixels",
        "hierarchical Z, flags and compression know blocks of the size of a line of the ROP's caches, and there is no cache of \
         another line to compare with; what a finer or coarser block would cull is another machine",
    ),
    (
        "who wrote a sample",
        "copies of a frame buffer know it without room in memory; what it takes on the network is compose.number_bytes",
    ),
    (
        "order of side effects",
        "compute and what shaders write to memory is executed once, in API order; a shader whose result depends on when others write \
         would have to run inside the machine",
    ),
    (
        "latency of the last instruction",
        "a request leaves with the last instruction before it, whose latency is taken to be part of the request's: costs do not \
         say which instruction it needs",
    ),
    (
        "order within a step",
        "costs have the length of the longest chain of instructions, not which instruction needs which: all waits of a step are \
         shortened by the same factor, as if a compiler had put independent instructions between those that wait",
    ),
    (
        "compressed sizes",
        "nothing is left out: blocks are put through the codec with the bytes that the machine's own ROPs have",
    ),
];

/// A picture without a purpose, in which neighbouring quads take different sides of a branch and go round loops a different number of
/// times: what the first of the shortcuts is worst at.
pub fn diverging(edge: u32) -> Trace {
    let mut card = Recorder::new("diverging");
    let target = card.create_texture("target", record::texture_2d(edge, edge, Format::Rgba8Unorm));
    let view = card.create_view(target);
    let shader = card.create_shader("diverging", DIVERGING);
    let pipeline = card.create_render_pipeline("diverging", record::render_pipeline(shader, Format::Rgba8Unorm));
    let mut pass = card.begin_render_pass([record::clear(view, [0.0; 4])], None);
    pass.set_pipeline(pipeline);
    pass.draw(3, 4);
    drop(pass);
    card.present(target);
    card.finish()
}

const DIVERGING: &str = "
@vertex fn vs(@builtin(vertex_index) v: u32) -> @builtin(position) vec4f {
    return vec4f(f32(v & 1u) * 4.0 - 1.0, f32(v >> 1u) * 4.0 - 1.0, 0.5, 1.0);
}
@fragment fn fs(@builtin(position) at: vec4f) -> @location(0) vec4f {
    let quad = vec2u(at.xy) / 2u;
    var r = at.x;
    if ((quad.x + quad.y) & 1u) == 0u {
        for (var k = 0u; k < 4u + (quad.x & 7u); k++) { r = sqrt(r * 0.75 + f32(k)); }
    } else {
        for (var k = 0u; k < 4u + (quad.y & 7u); k++) { r = fract(r * 1.5) + f32(k ^ quad.x); }
    }
    return vec4f(fract(r));
}
";

/// A shortcut on a trace.
#[derive(Clone, Debug)]
pub struct ShortcutResult {
    /// Which one.
    pub shortcut: &'static Shortcut,
    /// Cycles with the shortcut, and the exact way.
    pub cycles: [f64; 2],
    /// What it is about, with it and the exact way: cycles, where it is about nothing else.
    pub work: [f64; 2],
    /// Whether both show the same pictures: shortcuts are about time.
    pub same_pictures: bool,
}

/// How far off the first of a pair is, relative to the second.
fn off([shortcut, exact]: [f64; 2]) -> f64 {
    if exact == shortcut { 0.0 } else { shortcut / exact - 1.0 }
}

impl ShortcutResult {
    /// How far off the cycles are, relative to the exact ones.
    pub fn error(&self) -> f64 {
        off(self.cycles)
    }

    /// How far off the work is.
    pub fn work_error(&self) -> f64 {
        off(self.work)
    }
}

/// Every shortcut on a trace, against the exact way.
///
/// # Errors
/// If the trace cannot be rendered, or a machine stops.
pub fn shortcuts(trace: &Trace, config: &Config) -> Result<Vec<ShortcutResult>> {
    // Each machine once, however many shortcuts are measured on it.
    let mut settings: Vec<(Vec<&str>, Clock)> = Vec::new();
    let mut place = |of: Vec<&'static str>, clock: Clock| {
        settings.iter().position(|known| *known == (of.clone(), clock)).unwrap_or_else(|| {
            settings.push((of, clock));
            settings.len() - 1
        })
    };
    let of_shortcut = |shortcut: &Shortcut| {
        let exact = [shortcut.both, shortcut.on_top].concat();
        [place(shortcut.both.to_vec(), Clock::SkipIdle), place(exact, shortcut.clock)]
    };
    let pairs: Vec<[usize; 2]> = SHORTCUTS.iter().map(of_shortcut).collect();
    let set = |(settings, clock): &(Vec<&str>, Clock)| -> Result<(Config, Clock)> {
        let mut config = config.clone();
        settings.iter().try_for_each(|setting| config.set(setting))?;
        config.check()?;
        Ok((config, *clock))
    };
    let machines = settings.iter().map(set).collect::<Result<Vec<_>>>()?;
    let machines: Vec<(&Config, Clock)> = machines.iter().map(|(config, clock)| (config, *clock)).collect();
    let ran = machines::run(trace, &machines)?;
    let taken = |(shortcut, places): (&'static Shortcut, [usize; 2])| {
        let runs: [&Ran; 2] = places.map(|at| &ran[at]);
        let cycles = runs.map(|run| run.cycles as f64);
        ShortcutResult {
            shortcut,
            cycles,
            work: shortcut.work.map_or(cycles, |measure| runs.map(|run| (measure.read)(&run.total) as f64)),
            same_pictures: runs[0].shown == runs[1].shown,
        }
    };
    Ok(SHORTCUTS.iter().zip(pairs).map(taken).collect())
}

/// How far off cycles are on traces, by shortcut, as a table in Markdown.
pub fn table(traces: &[(String, Vec<ShortcutResult>)]) -> String {
    let row = |cells: Vec<String>| format!("| {} |\n", cells.join(" | "));
    let names = traces.iter().map(|(name, _)| name.clone());
    let mut out = row(["shortcut".to_owned()].into_iter().chain(names).chain(["worst".to_owned()]).collect());
    out.push_str(&format!("|---|{}\n", "--:|".repeat(traces.len() + 1)));
    let percent = |error: f64| if error.abs() < 5e-5 { "0".to_owned() } else { format!("{:+.2} %", 100.0 * error) };
    for (at, shortcut) in SHORTCUTS.iter().enumerate() {
        let mut put = |what: &str, error: fn(&ShortcutResult) -> f64| {
            let errors: Vec<f64> = traces.iter().map(|(_, taken)| error(&taken[at])).collect();
            let worst =
                errors.iter().copied().fold(0.0, |worst: f64, error| if error.abs() > worst.abs() { error } else { worst });
            let cells = errors.into_iter().chain([worst]).map(percent);
            out.push_str(&row([format!("{}: {what}", shortcut.name)].into_iter().chain(cells).collect()));
        };
        put("cycles", ShortcutResult::error);
        if let Some(measure) = shortcut.work {
            put(measure.name, ShortcutResult::work_error);
        }
    }
    out
}

/// What was measured, as JSON.
pub fn json(traces: &[(String, Vec<ShortcutResult>)]) -> Value {
    let one = |taken: &ShortcutResult| {
        json!({
            "shortcut": taken.shortcut.name,
            "cycles": { "shortcut": taken.cycles[0], "exact": taken.cycles[1], "error": taken.error() },
            "work": {
                "of": taken.shortcut.work.map_or("cycles", |measure| measure.name),
                "shortcut": taken.work[0],
                "exact": taken.work[1],
                "error": taken.work_error(),
            },
            "same_pictures": taken.same_pictures,
        })
    };
    let trace = |(name, taken): &(String, Vec<ShortcutResult>)| json!({ "trace": name, "shortcuts": taken.iter().map(one).collect::<Vec<_>>() });
    Value::Array(traces.iter().map(trace).collect())
}
