//! What is skipped because a scene does not need it: each skip switched off, with what that costs and proof that nothing else changes.

use std::time::Duration;

use anyhow::{Result, ensure};

use super::measure::{self, Measure};
use knob::{Allowed, Relax, Setting};
use machine::Config;
use render::{self, Skips};
use run::host::Stopwatch;
use run::machines::{self, Ran};
use sim::Clock;
use stats::Group;
use trace::Trace;
use work::{Event, FUNNEL, Funnel, RenderKey};

/// How a skip is switched off.
#[derive(Clone, Copy, Debug)]
enum Switch {
    /// In the renderer, by a field of [`Skips`]: saves host time only.
    Renderer(&'static str, fn(&mut Skips)),
    /// In the machine, by a knob whose declaration says that this value leaves work out ([`Relax::Skip`]). The settings come before it.
    Knob { base: &'static [&'static str], path: &'static str, value: &'static str },
    /// The clock: saves host time only.
    Clock,
}

/// A skip by a switch of the baseline, which has it on.
const fn by(path: &'static str) -> Switch {
    Switch::Knob { base: &[], path, value: "true" }
}

/// A skip.
#[derive(Clone, Copy, Debug)]
pub struct Skip {
    /// What it is called.
    pub name: &'static str,
    /// What is left out.
    pub what: &'static str,
    how: Switch,
    /// Removes from the counters what the skip changes by definition, both with the skip and without it, so that the rest can be
    /// compared.
    changes: fn(&mut Funnel),
    /// What it saves.
    work: Work,
}

/// What a skip saves, beside host time.
#[derive(Clone, Copy, Debug)]
enum Work {
    /// What nothing counts.
    Uncounted,
    /// Colours that the renderer computes.
    Colors,
    /// What a machine counts.
    Machine(Measure),
}

impl Skip {
    /// The switch, as a user of a machine turns it.
    ///
    /// # Errors
    /// If the knob is not declared as a skip.
    pub fn switch(&self, config: &Config) -> Result<String> {
        let options =
            |settings: &[String]| settings.iter().map(|setting| format!("--set {setting}")).collect::<Vec<_>>().join(" ");
        Ok(match self.how {
            Switch::Renderer(field, _) => format!("Skips::{field}"),
            Switch::Clock => "--clock every-cycle".to_owned(),
            Switch::Knob { base, path, value } => match settings(config, base, path, value)? {
                [on, off] if on.is_empty() => options(&off),
                [on, _] => format!("{} turns it on", options(&on)),
            },
        })
    }

    /// What it saves, as a machine counts it.
    fn measure(&self) -> Option<Measure> {
        if let Work::Machine(measure) = self.work { Some(measure) } else { None }
    }

    /// What it saves, in words; empty where nothing counts it.
    fn saves(&self) -> &'static str {
        match self.work {
            Work::Uncounted => "",
            Work::Colors => "colours computed",
            Work::Machine(measure) => measure.name,
        }
    }
}

/// No counter of the funnel changes.
fn nothing(_: &mut Funnel) {}

/// A cull of geometry: without it triangles go on that end in setup or traversal.
const fn culled(name: &'static str, what: &'static str, path: &'static str) -> Skip {
    Skip {
        name,
        what,
        how: by(path),
        changes: |funnel| funnel.triangles_setup = 0,
        work: Work::Machine(measure::TRIANGLES_SET_UP),
    }
}

/// All skips.
pub const SKIPS: &[Skip] = &[
    Skip {
        name: "early Z",
        what: "hidden quads are not shaded",
        how: by("depth.early"),
        // Hidden fragments are discarded, too, where they are shaded.
        changes: |funnel| funnel.fragments_discarded = 0,
        work: Work::Machine(measure::FRAGMENTS_SHADED),
    },
    Skip {
        name: "hierarchical Z",
        what: "hidden blocks are not cut into quads",
        how: by("traverse.hierarchical_z"),
        changes: nothing,
        work: Work::Machine(measure::QUADS_TESTED),
    },
    Skip {
        name: "acceptance",
        what: "depths of blocks are not read where all samples are certain to pass (hierarchical Z with both bounds)",
        how: by("traverse.hierarchical_accept"),
        changes: nothing,
        work: Work::Machine(measure::DEPTH_READ),
    },
    Skip {
        name: "fast clear",
        what: "clears set flags instead of memory",
        how: by("color.fast_clear"),
        changes: nothing,
        work: Work::Machine(measure::CLEARED),
    },
    Skip {
        name: "hidden surfaces",
        what: "what a tile hides is not shaded (sort-middle-binned)",
        how: Switch::Knob { base: &["sort=sort-middle-binned"], path: "bin.hide", value: "true" },
        // What is overwritten is not written.
        changes: |funnel| (funnel.fragments_discarded, funnel.fragments_written) = (0, 0),
        work: Work::Machine(measure::FRAGMENTS_SHADED),
    },
    Skip {
        name: "rendering elimination",
        what: "a tile that memory has already is not drawn (sort-middle-binned)",
        how: Switch::Knob { base: &["sort=sort-middle-binned"], path: "bin.skip_same_tiles", value: "true" },
        // Nothing of such a tile is set up, tested or written.
        changes: |funnel| (funnel.fragments_covered, funnel.fragments_discarded, funnel.fragments_written) = (0, 0, 0),
        work: Work::Machine(measure::TILES_DRAWN),
    },
    Skip {
        name: "empty passes",
        what: "a pass without draws only clears, and no pipeline hears of it",
        how: by("command.skip_empty_passes"),
        changes: nothing,
        work: Work::Machine(measure::PASSES_DRAWN),
    },
    Skip {
        name: "overwritten blocks",
        what: "colours of a block that is overwritten whole are not read before",
        how: by("color.skip_reads"),
        changes: nothing,
        work: Work::Machine(measure::COLOR_READ),
    },
    culled("facing", "triangles that face away are not set up", "clip.cull_facing"),
    culled("frustum", "what lies outside the view volume is not set up", "clip.cull_frustum"),
    culled("scissor", "what lies outside the scissor rectangle is neither set up nor looked for", "clip.cull_scissor"),
    culled("no sample", "what has no area or covers no sample is neither set up nor looked for", "clip.cull_no_sample"),
    Skip {
        name: "unread attributes",
        what: "attributes of vertex buffers that the vertex stage does not read are not fetched",
        how: by("fetch.skip_attributes"),
        changes: nothing,
        work: Work::Machine(measure::ATTRIBUTE_LOOKUPS),
    },
    Skip {
        name: "unread varyings",
        what: "what the fragment stage does not read is neither computed nor interpolated",
        how: by("interpolate.skip_varyings"),
        changes: nothing,
        work: Work::Machine(measure::INSTRUCTIONS),
    },
    Skip {
        name: "unread levels",
        what: "texels of a level that has no weight are not read",
        how: by("texture.skip_levels"),
        changes: nothing,
        work: Work::Machine(measure::TEXTURE_LOOKUPS),
    },
    Skip {
        name: "draws out of view",
        what: "vertices of a draw whose bounds lie outside the view volume are neither read nor shaded",
        how: Switch::Knob { base: &[], path: "command.cull", value: "draws" },
        // What is left out is not assembled, and so not found outside (`command.primitives_culled` has it).
        changes: |funnel| (funnel.primitives_in, funnel.culled_frustum) = (0, 0),
        work: Work::Machine(measure::VERTICES_SHADED),
    },
    Skip {
        name: "instances out of view",
        what: "the same for each instance of a draw, beside whole draws",
        how: Switch::Knob { base: &[], path: "command.cull", value: "instances" },
        changes: |funnel| (funnel.primitives_in, funnel.culled_frustum) = (0, 0),
        work: Work::Machine(measure::VERTICES_SHADED),
    },
    Skip {
        name: "idle cycles",
        what: "cycles in which nothing can move",
        how: Switch::Clock,
        changes: nothing,
        work: Work::Uncounted,
    },
    Skip {
        name: "full blocks",
        what: "samples of blocks that lie inside of all edges are not tested",
        how: Switch::Renderer("full_blocks", |skips| skips.full_blocks = false),
        changes: nothing,
        work: Work::Uncounted,
    },
    Skip {
        name: "overwritten colours",
        what: "colours of a tile that a later opaque triangle covers whole are not computed",
        how: Switch::Renderer("overwritten", |skips| skips.overwritten = false),
        changes: nothing,
        work: Work::Colors,
    },
    Skip {
        name: "repeated colours",
        what: "colours of a triangle whose inputs are the same everywhere are computed once in a tile",
        how: Switch::Renderer("repeated", |skips| skips.repeated = false),
        changes: nothing,
        work: Work::Uncounted,
    },
];

/// A skip on a trace, on and off.
#[derive(Clone, Debug)]
pub struct Saving {
    /// The skip.
    pub skip: &'static Skip,
    /// Simulated cycles with it and without; none where it is the host's alone.
    pub cycles: Option<[f64; 2]>,
    /// Host time with it and without.
    pub host: HostTimes,
    /// The work that it is about, with it and without; none where nothing counts it.
    pub work: Option<[f64; 2]>,
    /// What changed that must not; none if all is well.
    pub differs: Option<String>,
}

/// The counters that no skip may change, except those that this skip says it changes.
fn kept(skip: &Skip, funnel: Funnel) -> Funnel {
    let mut kept = Funnel {
        primitives_in: funnel.primitives_in,
        culled_degenerate: funnel.culled_degenerate,
        culled_backface: funnel.culled_backface,
        culled_frustum: funnel.culled_frustum,
        culled_scissor: funnel.culled_scissor,
        culled_no_sample: funnel.culled_no_sample,
        triangles_setup: funnel.triangles_setup,
        fragments_covered: funnel.fragments_covered,
        fragments_discarded: funnel.fragments_discarded,
        fragments_written: funnel.fragments_written,
        ..Funnel::default()
    };
    (skip.changes)(&mut kept);
    kept
}

/// How long both sides of a skip are run by turns to tell their host times apart.
#[derive(Clone, Copy, Debug)]
pub struct Turns {
    /// Pairs of runs, at least.
    pub least: usize,
    /// Further pairs as long as all have taken less.
    pub time: Duration,
}

/// Host times of runs with a skip and without, by turns.
#[derive(Clone, Debug)]
pub struct HostTimes(Vec<[Duration; 2]>);

impl HostTimes {
    /// Runs both sides by turns; which of them is first changes every time, since what a host has else to do changes, too.
    fn take(turns: Turns, first: [Duration; 2], mut run: impl FnMut(usize) -> Result<Duration>) -> Result<HostTimes> {
        let watch = Stopwatch::start();
        let mut pairs = vec![first];
        while pairs.len() < turns.least || watch.clock() < turns.time {
            let mut pair = [Duration::ZERO; 2];
            let first = pairs.len() % 2;
            for side in [first, 1 - first] {
                pair[side] = run(side)?;
            }
            pairs.push(pair);
        }
        Ok(HostTimes(pairs))
    }

    /// The share of the time without the skip that it saves: the median over the pairs, which runs that something else
    /// held up do not move, and two standard errors of it (of normal noise: 1.2533 deviations over the root of their number, with
    /// 1.4826 median absolute deviations for one; Huber, Robust Statistics, 1981). Infinite for one pair.
    pub fn saved(&self) -> (f64, f64) {
        let median = |values: &mut [f64]| {
            values.sort_by(f64::total_cmp);
            (values[(values.len() - 1) / 2] + values[values.len() / 2]) / 2.0
        };
        let mut shares: Vec<f64> = self.0.iter().map(|[on, off]| 1.0 - on.as_secs_f64() / off.as_secs_f64()).collect();
        let middle = median(&mut shares);
        let mut off: Vec<f64> = shares.iter().map(|share| (share - middle).abs()).collect();
        let count = shares.len() as f64;
        let error = if shares.len() == 1 { f64::INFINITY } else { 2.0 * 1.2533 * 1.4826 * median(&mut off) / count.sqrt() };
        (middle, error)
    }
}

/// The first counter that differs: none may.
fn differing(on: &Funnel, off: &Funnel) -> Option<String> {
    let mut counts = on.named().zip(off.values());
    counts.find(|&((_, on), off)| on != off).map(|((name, _), _)| format!("{FUNNEL}.{name}"))
}

/// What differs between two replays that must be the same, beside what the skip is about.
fn differs(skip: &Skip, on: &Ran, off: &Ran) -> Option<String> {
    if on.shown.len() != off.shown.len() {
        return Some("number of frames".into());
    }
    if let Some((frame, _)) = on.shown.iter().zip(&off.shown).find(|(a, b)| a != b) {
        return Some(format!("picture of frame {}", frame.number));
    }
    let [on, off] = [on, off].map(|ran| kept(skip, FUNNEL.sum(&ran.total)));
    differing(&on, &off)
}

/// What the renderer leaves where it does not record.
pub(super) struct Rendered {
    /// A hash of each frame's picture.
    pub pictures: Vec<blake3::Hash>,
    /// Counters of all frames.
    pub funnel: Funnel,
    /// Fragments whose colours it computed.
    pub colors: f64,
    time: Duration,
}

/// Renders without recording. No rendering is shared: what is measured is the renderer itself, its time and what it leaves out.
///
/// # Errors
/// If the trace cannot be rendered.
pub(super) fn rendered(trace: &Trace, skips: Skips) -> Result<Rendered> {
    let watch = Stopwatch::start();
    let (mut pictures, mut funnel) = (Vec::new(), Funnel::default());
    let options = render::Options { skips, key: RenderKey::default(), ..render::Options::default() };
    let summary = render::render(trace, &options, &mut |event| {
        match event {
            Event::Segment(segment) => funnel += segment.funnel,
            Event::EndFrame(end) => pictures.push(blake3::hash(&end.reference)),
            _ => {}
        }
        Ok(())
    })?;
    let colors = (funnel.fragments_shaded - summary.overwritten) as f64;
    Ok(Rendered { pictures, funnel, colors, time: watch.clock() })
}

/// The value of a knob without a skip: the other one of a switch, or the name before that of the skip, which leaves less out.
fn without(allowed: Allowed, value: &str) -> Setting {
    match allowed {
        Allowed::Choice(names) => {
            let at = names.iter().position(|&name| name == value).unwrap_or(0);
            Setting::Name(names[at.saturating_sub(1)].to_owned())
        }
        _ => Setting::Switch(value != "true"),
    }
}

/// The settings of a skip by a knob, with it and without, on top of a machine. With it there is none for a knob that has the value.
fn settings(config: &Config, base: &[&str], path: &str, value: &str) -> Result<[Vec<String>; 2]> {
    let (knob, now) = config.knob("a skip", path)?;
    ensure!(
        matches!(knob.relax, Relax::Skip(values) if values.iter().any(|&(own, _)| own == value)),
        "{path}={value} is not declared as a skip"
    );
    let base = || base.iter().map(|&setting| setting.to_owned());
    let on = (now != Setting::from(value)).then(|| format!("{path}={value}"));
    let off = match without(knob.allowed, value) {
        Setting::Name(name) => name,
        other => other.to_string(),
    };
    Ok([base().chain(on).collect(), base().chain([format!("{path}={off}")]).collect()])
}

/// A machine by its settings on top of others, and its clock.
type Timed = (Vec<String>, Clock);

/// The machines of a skip, with it and without; none for a skip of the renderer's.
fn sides(skip: &Skip, config: &Config) -> Result<Option<[Timed; 2]>> {
    Ok(match skip.how {
        Switch::Renderer(..) => None,
        Switch::Knob { base, path, value } => {
            Some(settings(config, base, path, value)?.map(|settings| (settings, Clock::SkipIdle)))
        }
        Switch::Clock => Some([Clock::SkipIdle, Clock::EveryCycle].map(|clock| (Vec::new(), clock))),
    })
}

/// Every skip on a trace, on and off. Machines are run behind one rendering, each once however many skips need it, and again for their host
/// times: from one time to the next in the other order.
///
/// # Errors
/// If the trace cannot be rendered, or a machine stops.
pub fn savings(trace: &Trace, config: &Config, turns: Turns) -> Result<Vec<Saving>> {
    let mut timed: Vec<Timed> = Vec::new();
    let mut place = |machine: Timed| {
        timed.iter().position(|known| *known == machine).unwrap_or_else(|| {
            timed.push(machine);
            timed.len() - 1
        })
    };
    let sides = SKIPS.iter().map(|skip| sides(skip, config)).collect::<Result<Vec<_>>>()?;
    let places: Vec<Option<[usize; 2]>> = sides.into_iter().map(|sides| sides.map(|sides| sides.map(&mut place))).collect();
    let set = |(settings, clock): &Timed| -> Result<(Config, Clock)> {
        let mut config = config.clone();
        settings.iter().try_for_each(|setting| config.set(setting))?;
        Ok((config, *clock))
    };
    let machines = timed.iter().map(set).collect::<Result<Vec<_>>>()?;
    let machines: Vec<(&Config, Clock)> = machines.iter().map(|(config, clock)| (config, *clock)).collect();
    let watch = Stopwatch::start();
    let ran = machines::run(trace, &machines)?;
    let mut times: Vec<Vec<Duration>> = vec![ran.iter().map(|ran| ran.machine_time).collect()];
    let skips = places.iter().flatten().count() as u32;
    while times.len() < turns.least || watch.clock() < skips * turns.time {
        let reversed = times.len() % 2 == 1;
        let order = |mut machines: Vec<_>| {
            if reversed {
                machines.reverse();
            }
            machines
        };
        let again = machines::run(trace, &order(machines.clone()))?;
        let mut own: Vec<Duration> = again.iter().map(|ran| ran.machine_time).collect();
        if reversed {
            own.reverse();
        }
        times.push(own);
    }

    let plain_render = rendered(trace, Skips::default())?;
    let mut found = Vec::new();
    for (skip, places) in SKIPS.iter().zip(places) {
        let saving = match (skip.how, places) {
            (Switch::Renderer(_, off), _) => {
                let mut skips = [Skips::default(); 2];
                off(&mut skips[1]);
                let (on, off) = (&plain_render, rendered(trace, skips[1])?);
                let same = on.pictures == off.pictures;
                let differs = if same { differing(&on.funnel, &off.funnel) } else { Some("picture".to_owned()) };
                let host = HostTimes::take(turns, [on.time, off.time], |side| Ok(rendered(trace, skips[side])?.time))?;
                let work = matches!(skip.work, Work::Colors).then_some([on.colors, off.colors]);
                Saving { skip, cycles: None, host, work, differs }
            }
            (how, Some(places)) => {
                let pair = places.map(|at| &ran[at]);
                let host = HostTimes(times.iter().map(|times| places.map(|at| times[at])).collect());
                let differs = differs(skip, pair[0], pair[1]);
                if let Switch::Clock = how {
                    let other = || (pair[0].total != pair[1].total).then(|| "statistics".to_owned());
                    Saving { skip, cycles: None, host, work: None, differs: differs.or_else(other) }
                } else {
                    let work = skip.measure().map(|measure| pair.map(|run| (measure.read)(&run.total) as f64));
                    Saving { skip, cycles: Some(pair.map(|run| run.cycles as f64)), host, work, differs }
                }
            }
            (_, None) => continue,
        };
        found.push(saving);
    }
    Ok(found)
}

/// What is saved of what there would be, as text.
fn saved(pair: Option<[f64; 2]>) -> String {
    match pair {
        Some([_, 0.0]) | None => "-".into(),
        Some([on, off]) => {
            let percent = 100.0 * (1.0 - on / off);
            // No minus sign where nothing is left of the number.
            format!("{:.1} %", if percent.abs() < 0.05 { 0.0 } else { percent })
        }
    }
}

/// What a table over several traces has.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Saved {
    /// Work.
    Work,
    /// Simulated cycles.
    Cycles,
    /// Host time, in per cent with two standard errors; empty where a trace has nothing to skip.
    Host,
}

/// The savings of several traces as one table in Markdown, a row a skip and a column a trace.
pub fn across(what: Saved, traces: &[(String, Vec<Saving>)]) -> String {
    let row = |cells: Vec<String>| format!("| {} |\n", cells.join(" | "));
    let names = traces.iter().map(|(name, _)| name.clone());
    let mut out = row(["skip".to_owned()].into_iter().chain(names).collect());
    out.push_str(&format!("|---|{}\n", "--:|".repeat(traces.len())));
    let cell = |saving: &Saving| match what {
        Saved::Work => saved(saving.work),
        Saved::Cycles => saved(saving.cycles),
        Saved::Host if saving.work.is_some_and(|[on, off]| on == off) => String::new(),
        Saved::Host => {
            let (host, error) = saving.host.saved();
            format!("{:.1} ± {:.1}", 100.0 * host, 100.0 * error)
        }
    };
    for (at, skip) in SKIPS.iter().enumerate() {
        // A skip of the host's alone saves no work of the card and no cycles.
        let is_there = |saving: &Saving| match what {
            Saved::Work => saving.work.is_some() && !matches!(skip.how, Switch::Renderer(..)),
            Saved::Cycles => saving.cycles.is_some(),
            Saved::Host => true,
        };
        let savings: Vec<&Saving> = traces.iter().map(|(_, savings)| &savings[at]).collect();
        if savings.iter().any(|saving| is_there(saving)) {
            out.push_str(&row([skip.name.to_owned()].into_iter().chain(savings.into_iter().map(cell)).collect()));
        }
    }
    out
}

/// The savings of a trace as a table in Markdown.
pub fn table(name: &str, savings: &[Saving]) -> String {
    let mut out = format!(
        "{name}\n\n| skip | work | work saved | cycles saved | host time saved | same picture and counters |\n|---|---|--:|--:|--:|---|\n"
    );
    for saving in savings {
        let (host, error) = saving.host.saved();
        out.push_str(&format!(
            "| {} | {} | {} | {} | {} | {} |\n",
            saving.skip.name,
            saving.skip.saves(),
            saved(saving.work),
            saved(saving.cycles),
            format_args!("{:.1} ± {:.1} %", 100.0 * host, 100.0 * error),
            saving.differs.as_deref().map_or("yes".to_owned(), |what| format!("**no: {what}**"))
        ));
    }
    out
}
