//! The page of two replays beside each other.

use maud::{Markup, html};
use serde_json::Value;

use super::{Column, bar, heads, inline, part, readable};
use crate::report::beside::{Row, Section, Unit};
use crate::report::compare::{KnobDifference, StatisticDifference};

/// Statistics that the page lists at most, those that change most.
const LISTED: usize = 200;

/// What the page is made from.
pub struct Input<'i> {
    /// One line for each replay.
    pub about: [&'i str; 2],
    /// How the times compare.
    pub verdict: Option<String>,
    /// The quantities of both.
    pub sections: &'i [Section],
    /// The picture that the page shows: its name, how it differs, and PNGs of both replays and of the difference.
    pub picture: Option<(&'i str, &'i str, &'i [Vec<u8>; 3])>,
    /// Knobs that differ.
    pub knobs: &'i [KnobDifference],
    /// Statistics that differ, those that change most first.
    pub changed: &'i [StatisticDifference],
}

/// The page.
pub fn page(input: &Input<'_>) -> String {
    let [a, b] = input.about;
    let head = html! {
        h1 { "Two replays" }
        p.sub { b { "A" } " " (a) }
        p.sub { b { "B" } " " (b) }
        @if let Some(verdict) = &input.verdict { p { b { (verdict) } } }
    };
    let ids = ["time", "phases", "funnel", "memory", "caches", "pipelines"];
    let titles = ["Time", "Cycles of phases", "Funnel", "Memory", "Caches", "Cycles of pipelines"];
    let found = |title: &str| input.sections.iter().find(|section| section.title == title);
    let mut parts: Vec<_> = std::iter::zip(ids, titles)
        .filter_map(|(id, title)| part(id, title, found(title).map(|section| table(&section.rows))))
        .collect();
    let picture = input.picture.map(pictures);
    parts.extend(part("picture", "Picture", picture));
    let knobs = (!input.knobs.is_empty()).then(|| knobs(input.knobs));
    parts.extend(part("knobs", "Knobs", knobs));
    let statistics = (!input.changed.is_empty()).then(|| statistics(input.changed));
    parts.extend(part("statistics", "All statistics that differ", statistics));
    super::page("Two replays", &head, &parts, &[])
}

/// Rows with a bar for each replay, both to the scale of the larger one.
fn table(rows: &[Row]) -> Markup {
    let cell = |unit: Unit, value: Option<f64>| match value {
        Some(value) => html! { td.n data-value=(value) { (unit.text(value)) } },
        None => html! { td.n data-value="" { "\u{2013}" } },
    };
    let columns = [
        Column("", false, ""),
        Column("A", true, ""),
        Column("B", true, ""),
        Column("change", true, "From A to B, as a share of A; of shares in percentage points."),
    ];
    html! { div.scroll { table.sortable {
        (heads(&columns))
        tbody { @for row in rows {
            @let most = [row.a, row.b].into_iter().flatten().fold(0.0, f64::max);
            @let shares = [row.a, row.b].map(|value| if most > 0.0 { value.unwrap_or(0.0) / most } else { 0.0 });
            tr {
                td.name {
                    (row.name)
                    @for ((class, share), name) in [("b-read", shares[0]), ("b-write", shares[1])].into_iter().zip(["A", "B"]) {
                        (bar("bar", &[(class, share, format!("{name} {:.1} %", 100.0 * share))]))
                    }
                }
                (cell(row.unit, row.a))
                (cell(row.unit, row.b))
                td.n data-value=(moved(row)) { (row.change()) }
            }
        } }
    } } }
}

/// The size of a change, by which rows are sorted.
fn moved(row: &Row) -> f64 {
    let (a, b) = (row.a.unwrap_or(0.0), row.b.unwrap_or(0.0));
    if a == 0.0 { b } else { (b - a) / a }
}

fn pictures((name, found, pictures): (&str, &str, &[Vec<u8>; 3])) -> Markup {
    html! {
        p { (name) ": " (found) }
        div.two { @for (title, png) in ["A", "B", "Difference"].into_iter().zip(pictures) {
            figure { img.shot src=(inline("image/png", png)) alt=(format!("{title}: {name}")); figcaption { (title) } }
        } }
    }
}

fn knobs(knobs: &[KnobDifference]) -> Markup {
    html! { div.scroll { table.sortable {
        (heads(&[Column("knob", false, ""), Column("A", true, ""), Column("B", true, "")]))
        tbody { @for KnobDifference { path, a, b } in knobs {
            tr { td.name { code { (path) } } td.n { (a) } td.n { (b) } }
        } }
    } } }
}

fn statistics(changed: &[StatisticDifference]) -> Markup {
    let value = |value: &Option<Value>| match value {
        Some(value) => match value.as_f64() {
            Some(number) => html! { td.n data-value=(number) { (readable(number)) } },
            None => html! { td.n { (value) } },
        },
        None => html! { td.n data-value="" { "\u{2013}" } },
    };
    let columns = [Column("statistic", false, ""), Column("A", true, ""), Column("B", true, ""), Column("change", true, "")];
    let listed = changed.iter().filter(|d| !d.path.starts_with("frames["));
    let (all, shown) = (listed.clone().count(), listed.take(LISTED));
    html! {
        @if all > LISTED { p.note { "The " (LISTED) " that change most, of " (all) "." } }
        div.scroll.tall { table.sortable {
            (heads(&columns))
            tbody { @for d in shown {
                tr {
                    td.name { code { (d.path) } }
                    (value(&d.a))
                    (value(&d.b))
                    @match d.relative() {
                        Some(share) => td.n data-value=(share) { (format!("{:+.1} %", 100.0 * share)) },
                        None => td.n data-value="" {},
                    }
                }
            } }
        } }
    }
}
