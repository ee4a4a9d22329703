//! The page of a sweep: the answer, what each axis does, two axes at once, the Pareto front, and all machines.

use maud::{Markup, PreEscaped, html};

use super::answer;
use super::outcome::{Effect, FrontMachine, MachineResult, Reference, Response, SweepResult, Within, plain, ratio};
use crate::knob::Setting;
use crate::report::html::{Column, PageSection, bar, heads, page as whole, part, readable, sentence, share};
use crate::report::plots::{Heat, Marks, Scale, Series, alone, chart, heat};

/// Machines that the table lists.
const LISTED: usize = 2000;

/// Values of an axis up to which it is a side of a heat map, and up to which a column has a filter by its values.
const SIDE: usize = 16;

/// Series of a response curve: values of the second axis.
const CURVES: usize = 6;

/// A value of an axis as a place along it; none of a name.
fn place(setting: &Setting) -> Option<f64> {
    if let Setting::Number(value) = setting { Some(*value as f64) } else { None }
}

/// How the values of an axis go along: by powers where they span more than an eightfold, and are not 0.
fn scale(places: &[f64]) -> Scale {
    let (low, high) = places.iter().fold((f64::INFINITY, 0.0_f64), |(low, high), &place| (low.min(place), high.max(place)));
    if low > 0.0 && high / low >= 8.0 { Scale::Log } else { Scale::Linear }
}

/// What is drawn over an axis: cycles, or a measure by its place.
#[derive(Clone, Copy)]
enum Drawn {
    Cycles,
    Measure(usize),
}

impl Drawn {
    /// What the axis of a plot is called.
    fn name(self, sweep: &SweepResult<'_>) -> String {
        match self {
            Drawn::Cycles if sweep.estimated.is_empty() => "cycles (geometric mean)".into(),
            Drawn::Cycles => "estimated cycles (geometric mean)".into(),
            Drawn::Measure(at) => format!("{} (arithmetic mean)", sweep.measures[at]),
        }
    }

    fn mean(self, sweep: &SweepResult<'_>, of: impl Fn(&MachineResult) -> bool) -> Option<f64> {
        match self {
            Drawn::Cycles => sweep.mean(of).map(|mean| mean.0),
            Drawn::Measure(at) => sweep.mean_measure(at, None, of),
        }
    }

    /// How far apart the values of an axis are in it, by the largest.
    fn spread(self, sweep: &SweepResult<'_>, effect: &Effect) -> f64 {
        let told = |machine: &MachineResult| sweep.tells(effect.axis, machine);
        let own = |own: &Response| self.mean(sweep, |machine| machine.settings[effect.axis] == own.value && told(machine));
        let values: Vec<f64> = effect.responses.iter().filter_map(own).collect();
        let most = values.iter().copied().fold(0.0, f64::max);
        share(most - values.iter().copied().fold(f64::INFINITY, f64::min).min(most), most)
    }
}

/// Where the values of an axis stand along it: numbers at their own places, names and switches one behind another.
struct Along {
    places: Vec<f64>,
    names: Option<Vec<String>>,
}

impl Along {
    fn new(effect: &Effect) -> Along {
        match effect.responses.iter().map(|own| place(&own.value)).collect() {
            Some(places) => Along { places, names: None },
            None => Along {
                places: (0..effect.responses.len()).map(|at| at as f64).collect(),
                names: Some(effect.responses.iter().map(|own| plain(&own.value)).collect()),
            },
        }
    }

    /// A plot over the axis.
    fn chart(&self, x: &str, y: &str, mut series: Vec<(String, Vec<(f64, f64)>)>) -> Option<Markup> {
        series.retain(|(_, points)| !points.is_empty());
        series.iter_mut().for_each(|(_, points)| points.sort_by(|a, b| a.0.total_cmp(&b.0)));
        let values: Vec<f64> = series.iter().flat_map(|(_, points)| points.iter().map(|point| point.1)).collect();
        if values.is_empty() {
            return None;
        }
        let own = |(name, points)| Series { name, points, line: self.names.is_none() };
        let series: Vec<Series<'_>> = series.iter().map(|(name, points)| (name.as_str(), points.clone())).map(own).collect();
        let marks = self.names.as_ref().map_or(Marks::Run(&self.places), |names| Marks::Names(names));
        // If values differ by less than a power, an axis from 0 shows how little that is.
        let y_scale = if scale(&values) == Scale::Log { Scale::Log } else { Scale::FromZero };
        Some(chart(x, y, scale(&self.places), y_scale, marks, &series))
    }
}

/// Cycles or a measure by the values of an axis, with a curve for each value of the other axis that does most.
fn curve(sweep: &SweepResult<'_>, effects: &[Effect], effect: &Effect, drawn: Drawn) -> Option<Markup> {
    let along = (effect.responses.len() > 1).then(|| Along::new(effect))?;
    // Where not all combinations were run, curves by another axis would be of different machines.
    let few =
        |other: &&Effect| other.axis != effect.axis && (2..=CURVES).contains(&other.responses.len()) && !sweep.is_fitted();
    let spread = |other: &&Effect| drawn.spread(sweep, other);
    let other = effects.iter().filter(few).max_by(|a, b| spread(a).total_cmp(&spread(b))).filter(|other| spread(other) > 0.001);
    let points = |second: Option<(usize, &Setting)>| -> Vec<(f64, f64)> {
        let point = |(response, &place): (&Response, &f64)| {
            let own = |machine: &MachineResult| {
                machine.settings[effect.axis] == response.value
                    && sweep.tells(effect.axis, machine)
                    && second.is_none_or(|(axis, value)| machine.settings[axis] == *value)
            };
            let value = match (drawn, second) {
                (Drawn::Cycles, None) => response.cycles,
                _ => drawn.mean(sweep, own)?,
            };
            Some((place, value))
        };
        effect.responses.iter().zip(&along.places).filter_map(point).collect()
    };
    let series: Vec<(String, Vec<(f64, f64)>)> = match other {
        Some(other) => {
            let own = other.responses.iter();
            own.map(|own| (format!("{}={}", other.path, plain(&own.value)), points(Some((other.axis, &own.value))))).collect()
        }
        None => vec![("mean".into(), points(None))],
    };
    along.chart(&effect.path, &drawn.name(sweep), series)
}

/// The table of an axis: every value.
fn table(sweep: &SweepResult<'_>, effect: &Effect, reference: &Reference) -> Markup {
    let most = effect.responses.iter().map(|own| own.cycles).fold(0.0, f64::max);
    let over = format!("Geometric mean of the speed-ups over {}.", reference.name());
    let mut columns = vec![
        Column("value", place(&effect.responses[0].value).is_some(), ""),
        Column("machines", true, ""),
        Column(if sweep.estimated.is_empty() { "cycles" } else { "estimated cycles" }, true, "Geometric mean of the machines."),
        Column("speed-up", true, &over),
    ];
    columns.extend(sweep.measures.iter().map(|name| Column(name, true, "Arithmetic mean of the machines.")));
    let measure = |own: &Response, at: usize| sweep.axis_measure(effect.axis, &own.value, at, None);
    html! { div.scroll { table.sortable {
        (heads(&columns))
        tbody { @for own in &effect.responses { tr {
            @match place(&own.value) { Some(number) => td.n data-value=(number) { (readable(number)) }, None => td.name { (plain(&own.value)) } }
            td.n data-value=(own.machines) { (own.machines) }
            td.n data-value=(own.cycles) { (readable(own.cycles.round())) }
            td.n data-value=(reference.cycles / own.cycles) { (format!("{:.3}", reference.cycles / own.cycles)) }
            @for at in 0..sweep.measures.len() { (measured(measure(own, at))) }
            td.wide { (bar("bar", &[("b-read", own.cycles / most, String::new())])) }
        } } }
    } } }
}

/// The cell of a measure.
fn measured(value: Option<f64>) -> Markup {
    html! { @match value {
        Some(value) => td.n data-value=(value) { (answer::measured(value)) },
        None => td.n data-value="" { "\u{2013}" },
    } }
}

fn run(sweep: &SweepResult<'_>) -> Markup {
    let experiment = &sweep.inputs.experiment;
    let mut base = experiment.base.clone();
    experiment.set.iter().for_each(|set| base.push_str(&format!(" --set {set}")));
    let failed = sweep.machines.iter().filter(|machine| machine.cycles.is_none()).count();
    let estimated = sweep.planned as usize - sweep.machines.len();
    html! {
        div.scroll { table { tbody {
            tr { th scope="row" { "traces" } td { code { (experiment.traces.join(", ")) } } }
            tr { th scope="row" { "frames" } td { (if experiment.frames == ".." { "all" } else { &experiment.frames }) } }
            tr { th scope="row" { "base" } td { code { (base) } } }
            @for axis in &experiment.vary { tr { th scope="row" { "axis" } td { code { (axis) } } } }
            @for variable in &experiment.variables { tr { th scope="row" { "variable" } td { code { (variable) } } } }
            @for condition in &experiment.conditions { tr { th scope="row" { "condition" } td { code { (condition) } } } }
            @for link in &experiment.link { tr { th scope="row" { "link" } td { code { (link) } } } }
            @for measure in &experiment.measures { tr { th scope="row" { "measure" } td { code { (measure) } } } }
            @if !experiment.cost.is_empty() { tr { th scope="row" { "cost" } td { code { (experiment.cost) } } } }
            tr { th scope="row" { "machines" } td { (sweep.planned) " planned, " (sweep.timed().count()) " with a result, " (failed) " with an error" @if estimated > 0 { ", " (estimated) (if sweep.ended { " estimated only (screen.csv)" } else { " without a result so far" }) } } }
            tr { th scope="row" { "program" } td { "fillrate " (sweep.inputs.fillrate) } }
        } } }
        p.note { "The same again: " code { "fillrate sweep experiment.ron --out DIR" } ", with experiment.ron of this folder." }
    }
}

fn answer(sweep: &SweepResult<'_>) -> Markup {
    html! {
        p.verdict { (sentence(&answer::fastest(sweep))) }
        @let scope = answer::scope(sweep);
        @if !scope.is_empty() { p { (sentence(&scope)) } }
        ul { @for finding in answer::findings(sweep) { li {
            (sentence(&finding.text))
            @if !finding.by.is_empty() || !finding.measures.is_empty() { details {
                summary { "On what this depends, and measures" }
                ul {
                    @for text in &finding.by { li { (sentence(text)) } }
                    @for measure in &finding.measures { li { (sentence(measure)) } }
                }
            } }
        } } }
    }
}

/// What each axis does on each trace: how much, and then the cycles and measures of each value.
fn by_trace(sweep: &SweepResult<'_>, effects: &[Effect]) -> Option<Markup> {
    let traces = sweep.trace_names();
    (traces.len() > 1 && !effects.is_empty()).then(|| {
        let mut columns = vec![Column("axis", false, "")];
        columns.extend(traces.iter().map(|name| Column(name, true, "Cycles at the worst value divided by those at the best.")));
        html! {
            div.scroll { table.sortable {
                (heads(&columns))
                tbody { @for effect in effects { tr {
                    td.name { code { (effect.path) } }
                    @for trace in 0..traces.len() {
                        @let own = ratio(&sweep.responses(effect.axis, Within::Trace(trace)));
                        td.n data-value=(own) { (format!("{own:.3}")) }
                    }
                } } }
            } }
            p.note { "Cycles at an axis's worst value divided by those at its best, geometric means over the machines. Elsewhere on this page cycles are geometric means over the traces, too." }
            @for effect in effects { @if effect.responses.len() > 1 {
                h3 { code { (effect.path) } " by " (sweep.trace_axis()) }
                div.two { @for (_, plot) in trace_plots(sweep, effect) { figure { (plot) } } }
                @for at in (0..sweep.measures.len()).filter(|at| answer::moves(sweep, effect, *at)) { (measure_by_trace(sweep, effect, at, &traces)) }
            } }
        }
    })
}

/// A measure at each value of an axis, on each trace.
fn measure_by_trace(sweep: &SweepResult<'_>, effect: &Effect, at: usize, traces: &[String]) -> Markup {
    let numbers = place(&effect.responses[0].value).is_some();
    let mut columns = vec![Column(&sweep.measures[at], numbers, "")];
    columns.extend(traces.iter().map(|name| Column(name, true, "Arithmetic mean of the machines.")));
    html! { div.scroll { table.sortable {
        (heads(&columns))
        tbody { @for own in &effect.responses { tr {
            @match place(&own.value) { Some(number) => td.n data-value=(number) { (readable(number)) }, None => td.name { (plain(&own.value)) } }
            @for trace in 0..traces.len() { (measured(sweep.axis_measure(effect.axis, &own.value, at, Some(trace)))) }
        } } }
    } } }
}

/// What an axis does on each trace: of numbers a curve for each trace, of cycles and of each measure; of others a map of cycles. Each with the
/// end of its file's name.
fn trace_plots(sweep: &SweepResult<'_>, effect: &Effect) -> Vec<(String, Markup)> {
    let traces = sweep.trace_names();
    let cycles: Vec<Vec<Response>> =
        (0..traces.len()).map(|trace| sweep.responses(effect.axis, Within::Trace(trace))).collect();
    let along = Along::new(effect);
    if along.names.is_some() {
        let columns = effect.responses.iter().map(|own| plain(&own.value)).collect();
        let cell = |own: &Response, value: &Setting| (own.value == *value).then_some(own.cycles);
        let row = |own: &Vec<Response>| -> Vec<Option<f64>> {
            effect.responses.iter().map(|wanted| own.iter().find_map(|own| cell(own, &wanted.value))).collect()
        };
        let table = Heat {
            rows: (sweep.trace_axis(), traces),
            columns: (&effect.path, columns),
            values: cycles.iter().map(row).collect(),
        };
        let svg = heat(&format!("Cycles by {} and {}", sweep.trace_axis(), effect.path), &table);
        return vec![(format!("trace-{}", effect.path), PreEscaped(svg))];
    }
    let mut plots = Vec::new();
    let mut put = |file: String, drawn: Drawn, curves: Vec<Vec<(f64, f64)>>| {
        let series = traces.iter().cloned().zip(curves).collect();
        plots.extend(along.chart(&effect.path, &drawn.name(sweep), series).map(|plot| (file, plot)));
    };
    let points = |own: &Vec<Response>| own.iter().filter_map(|own| Some((place(&own.value)?, own.cycles))).collect();
    put(format!("trace-{}", effect.path), Drawn::Cycles, cycles.iter().map(points).collect());
    for at in 0..sweep.measures.len() {
        let points = |trace: usize| -> Vec<(f64, f64)> {
            let point =
                |own: &Response| Some((place(&own.value)?, sweep.axis_measure(effect.axis, &own.value, at, Some(trace))?));
            effect.responses.iter().filter_map(point).collect()
        };
        let curves = (0..traces.len()).map(points).collect();
        put(format!("trace-measure-{}-{}", at + 1, effect.path), Drawn::Measure(at), curves);
    }
    plots
}

/// What an axis does at least to fill its bar: an effect of a few thousandths looks small.
const LITTLE: f64 = 0.05;

fn sensitivities(sweep: &SweepResult<'_>, effects: &[Effect]) -> Option<Markup> {
    let most = effects.iter().map(|effect| effect.ratio - 1.0).fold(0.0, f64::max);
    let end = |effect: &Effect, worst: bool| {
        let order = |a: &&Response, b: &&Response| a.cycles.total_cmp(&b.cycles);
        let own = effect.responses.iter();
        if worst { own.max_by(order) } else { own.min_by(order) }.map_or(String::new(), |own| plain(&own.value))
    };
    (!effects.is_empty()).then(|| {
        html! {
            div.scroll { table.sortable {
                (heads(&[Column("axis", false, ""), Column("worst divided by best", true, "Geometric mean of the cycles at the worst value, divided by that at the best."), Column("best value", false, ""), Column("worst value", false, "")]))
                tbody { @for effect in effects { tr {
                    td.name { code { (effect.path) } }
                    td.n data-value=(effect.ratio) { (format!("{:.3}", effect.ratio)) }
                    td { (end(effect, false)) } td { (end(effect, true)) }
                    td.wide { (bar("bar", &[("b-read", (effect.ratio - 1.0) / most.max(LITTLE), String::new())])) }
                } } }
            } }
            p.note {
                "Each value stands for the geometric mean of the " (if sweep.estimated.is_empty() { "cycles" } else { "estimated cycles" }) " of all machines that have it"
                @if sweep.is_fitted() { "; as not all combinations were run, for the least-squares mean" } "."
            }
        }
    })
}

fn responses(sweep: &SweepResult<'_>, effects: &[Effect]) -> Option<Markup> {
    let reference = sweep.reference()?;
    Some(html! { @for effect in effects {
        h3 { code { (effect.path) } }
        div.two {
            @if let Some(curve) = curve(sweep, effects, effect, Drawn::Cycles) { figure { (curve) } }
            @for at in 0..sweep.measures.len() {
                @if let Some(curve) = curve(sweep, effects, effect, Drawn::Measure(at)) { figure { (curve) } }
            }
            div { (table(sweep, effect, &reference)) }
        }
    } })
}

/// The two axes that do most as a table of cycles in colours. None if cells would be of machines that differ in further axes.
fn map(sweep: &SweepResult<'_>, effects: &[Effect]) -> Option<String> {
    if sweep.is_fitted() && sweep.axes.len() > 2 {
        return None;
    }
    let mut sides: Vec<&Effect> =
        effects.iter().filter(|effect| (2..=SIDE).contains(&effect.responses.len())).take(2).collect();
    sides.sort_by_key(|effect| effect.axis);
    let [rows, columns] = sides[..] else { return None };
    let names = |effect: &Effect| effect.responses.iter().map(|own| plain(&own.value)).collect::<Vec<_>>();
    let cell = |row: &Response, column: &Response| {
        let both = |machine: &MachineResult| {
            machine.settings[rows.axis] == row.value && machine.settings[columns.axis] == column.value
        };
        sweep.mean(both).map(|(cycles, _)| cycles)
    };
    let values = rows.responses.iter().map(|row| columns.responses.iter().map(|column| cell(row, column)).collect()).collect();
    let table = Heat { rows: (&rows.path, names(rows)), columns: (&columns.path, names(columns)), values };
    Some(heat(&format!("Cycles by {} and {}", rows.path, columns.path), &table))
}

/// Cycles against cost, with the machines of the front.
fn pareto(sweep: &SweepResult<'_>) -> Option<(Markup, Markup)> {
    let (name, front) = sweep.front()?;
    let (_, costs) = sweep.costs()?;
    let best: Vec<(f64, f64)> = front.iter().map(|own| (own.cost, own.cycles)).collect();
    let is_on = |machine: &MachineResult| front.iter().any(|own| own.machine.number == machine.number);
    let others = sweep.timed().zip(&costs).filter(|((machine, _), _)| !is_on(machine));
    let others: Vec<(f64, f64)> = others.map(|((_, cycles), &cost)| (cost, cycles)).collect();
    let cycles: Vec<f64> = sweep.timed().map(|machine| machine.1).collect();
    let series =
        [Series { name: "on the front", points: best, line: true }, Series { name: "others", points: others, line: false }];
    let plot = chart(&name, "cycles", scale(&costs), scale(&cycles), Marks::Round, &series);
    let table = html! {
        div.scroll.tall { table.sortable id="front" {
            (heads(&[Column("machine", true, ""), Column("cycles", true, ""), Column(&name, true, ""), Column("machines alike", true, "Other machines with as many cycles and as much cost, within the tolerance."), Column("settings", false, "")]))
            tbody { @for FrontMachine { machine, cycles, cost, alike } in &front { tr {
                td.n data-value=(machine.number) { (machine.number) }
                td.n data-value=(cycles) { (readable(cycles.round())) }
                td.n data-value=(cost) { (readable(*cost)) }
                td.n data-value=(alike) { (alike) }
                td.name { (sweep.described(machine)) }
            } } }
        } }
    };
    Some((plot, table))
}

fn machines(sweep: &SweepResult<'_>) -> Option<Markup> {
    let over = sweep.timed().find(|(machine, _)| sweep.is_base(machine));
    let title = over.map_or(String::new(), |(base, _)| format!("Speed-up over the base, machine {}.", base.number));
    sweep.timed().next()?;
    let (dram, cost) = (sweep.machines.iter().any(|machine| machine.dram.is_some()), !sweep.inputs.experiment.cost.is_empty());
    let numeric: Vec<bool> = (0..sweep.parameters.len())
        .map(|at| sweep.machines.iter().all(|machine| place(&machine.settings[at]).is_some()))
        .collect();
    let mut columns = vec![Column("machine", true, "Its number in the plan.")];
    columns.extend(sweep.parameters.iter().zip(&numeric).map(|(path, numbers)| Column(path, *numbers, "")));
    let mean = if sweep.inputs.experiment.traces.len() > 1 {
        "Of all frames, the geometric mean over the traces."
    } else {
        "Of all frames."
    };
    columns.push(Column("cycles", true, mean));
    if over.is_some() {
        columns.push(Column("speed-up", true, &title));
    }
    columns.extend(sweep.measures.iter().map(|name| Column(name, true, "")));
    if dram {
        columns.push(Column("DRAM bytes", true, ""));
    }
    if cost {
        columns.push(Column("cost", true, "As the experiment says."));
    }
    let cycles_at = 1 + sweep.parameters.len();
    let left = sweep.machines.len().saturating_sub(LISTED);
    Some(html! {
        div.filters data-table="machines" {
            @for (at, axis) in sweep.axes.iter().enumerate().filter(|(_, axis)| axis.values.len() <= SIDE) {
                label { (axis.path) " " select data-column=(at + 1) {
                    option value="" { "all" }
                    @for value in &axis.values { option value=(shown(value)) { (shown(value)) } }
                } }
            }
            label { "at most " input type="number" min="0" data-column=(cycles_at) placeholder="cycles" aria-label="Maximum number of cycles"; " cycles" }
            span { "shown: " output {} }
        }
        div.scroll.tall { table.sortable id="machines" {
            (heads(&columns))
            tbody { @for machine in sweep.machines.iter().take(LISTED) { tr {
                td.n data-value=(machine.number) { (machine.number) }
                @for (setting, numbers) in machine.settings.iter().zip(&numeric) {
                    @match place(setting).filter(|_| *numbers) { Some(number) => td.n data-value=(number) { (shown(setting)) }, None => td { (shown(setting)) } }
                }
                @match machine.cycles {
                    Some(cycles) => td.n data-value=(cycles.round()) { (readable(cycles.round())) },
                    None => td.n data-value="" title=[machine.error.as_deref()] { "error" },
                }
                @if let Some((_, base)) = over { @match machine.cycles {
                    Some(cycles) => td.n data-value=(base / cycles) { (format!("{:.3}", base / cycles)) },
                    None => td.n data-value="" { "\u{2013}" },
                } }
                @for value in &machine.measures { (measured(*value)) }
                @if dram { @match machine.dram { Some(bytes) => td.n data-value=(bytes) { (readable(bytes)) }, None => td.n data-value="" { "\u{2013}" } } }
                @if cost { @match machine.cost { Some(cost) => td.n data-value=(cost) { (readable(cost as f64)) }, None => td.n data-value="" { "\u{2013}" } } }
            } } }
        } }
        @if left > 0 { p.note { (left) " more stand in machines.csv." } }
    })
}

/// A setting in a table.
fn shown(setting: &Setting) -> String {
    place(setting).map_or_else(|| plain(setting), readable)
}

fn errors(sweep: &SweepResult<'_>) -> Option<Markup> {
    let failed: Vec<(&MachineResult, &str)> = sweep.failed().collect();
    (!failed.is_empty()).then(|| {
        html! { div.scroll.tall { table {
            thead { tr { th.n scope="col" { "machine" } th scope="col" { "settings" } th scope="col" { "error" } } }
            tbody { @for (machine, error) in failed.iter().take(LISTED) { tr { td.n { (machine.number) } td.name { (sweep.described(machine)) } td { (error) } } } }
        } } }
    })
}

/// The page, as one file.
pub fn page(sweep: &SweepResult<'_>) -> String {
    let question = &sweep.inputs.experiment.question;
    let title = if question.is_empty() { "A sweep" } else { question.as_str() };
    let effects = sweep.effects();
    let head = html! { h1 { (title) } p.sub { (readable(f64::from(sweep.planned))) " machines, " (sweep.axes.len()) " axes: " (sweep.axes.iter().map(|axis| axis.path.as_str()).collect::<Vec<_>>().join(", ")) } };
    let map = map(sweep, &effects).map(|svg| html! { figure { (PreEscaped(svg)) figcaption { "Cycles, geometric means over the other axes. Lighter is faster; colours go by powers." } } });
    let pareto = match pareto(sweep) {
        Some((plot, table)) => {
            html! { figure { (plot) figcaption { "Each machine on the front takes fewer cycles than all that cost less. Machines within " (answer::tolerance()) " of each other in both count as one." } } (table) }
        }
        None => {
            html! { p.note { "There is no cost that all machines have: the experiment names none, and does not keep memory.dram." } }
        }
    };
    let parts: Vec<PageSection> = [
        part("answer", "Answer", Some(answer(sweep))),
        part("run", "What was run", Some(run(sweep))),
        part("sensitivities", "Sensitivities", sensitivities(sweep, &effects)),
        part("responses", "Response curves", responses(sweep, &effects)),
        part("traces", format!("By {}", sweep.trace_axis()), by_trace(sweep, &effects)),
        part("map", "Two axes", map),
        part("pareto", "Cycles against cost", Some(pareto)),
        part("machines-section", "All machines", machines(sweep)),
        part("errors", "Machines with an error", errors(sweep)),
    ]
    .into_iter()
    .flatten()
    .collect();
    whole(title, &head, &parts, &[("sweep", &sweep.json())])
}

/// The plots as files of their own, each with its name.
pub fn plots(sweep: &SweepResult<'_>) -> Vec<(String, String)> {
    let effects = sweep.effects();
    let mut plots: Vec<(String, String)> = Vec::new();
    for effect in &effects {
        let mut put = |name: String, drawn: Drawn| {
            plots.extend(curve(sweep, &effects, effect, drawn).map(|svg| (name, svg.into_string())));
        };
        put(format!("response-{}", effect.path), Drawn::Cycles);
        (0..sweep.measures.len()).for_each(|at| put(format!("measure-{}-{}", at + 1, effect.path), Drawn::Measure(at)));
        if sweep.inputs.experiment.traces.len() > 1 && effect.responses.len() > 1 {
            plots.extend(trace_plots(sweep, effect).into_iter().map(|(name, plot)| (name, plot.into_string())));
        }
    }
    plots.extend(map(sweep, &effects).map(|svg| ("two-axes".to_owned(), svg)));
    plots.extend(pareto(sweep).map(|(plot, _)| ("pareto".to_owned(), plot.into_string())));
    plots.into_iter().map(|(name, svg)| (name, alone(&svg))).collect()
}
