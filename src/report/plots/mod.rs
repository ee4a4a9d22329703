//! Plots as SVG, drawn here: for pages, where they take the page's colours, and as files of their own.
//!
//! Coordinates are rounded to a tenth of a unit, so that the same numbers give the same bytes on every host.

mod axis;
mod charts;

pub use axis::Scale;
pub use charts::{Heat, Roofline, Series, Stack, bars, chart, heat, roofline};

/// A text as SVG has it.
pub(crate) fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}

/// Colours of series: of Okabe and Ito (2008), which readers with any kind of colour vision tell apart; darker where they are for lines.
pub const SERIES: usize = 8;

/// What a plot needs to be a file of its own: the colours of the pages, light and dark.
const STYLE: &str = "<style>svg{--card:#fff;--ink:#1b2330;--muted:#566173;--line:#dde2ea;--busy:#0072b2;--starved:#c9cfd9;--blocked:#d55e00;\
--memory:#e0a100;--latency:#8f5fb5;--idle:#eceff4;--draw:#0b6bb8;--other:#b8620a;--c0:#0072b2;--c1:#d55e00;--c2:#00835f;--c3:#a8578a;--c4:#946c00;--c5:#3e8fc4;\
--c6:#6b5bb5;--c7:#5f6b7a;background:var(--card);font-family:system-ui,sans-serif}\
text{fill:var(--muted);font-size:13px}text.t{fill:var(--ink)}.grid{stroke:var(--line)}.axis{stroke:var(--muted)}.frame{fill:none;stroke:var(--line)}\
.roof{fill:none;stroke:var(--ink);stroke-width:2}.dash{stroke-dasharray:5 4}.ln{fill:none;stroke-width:2}.dot{stroke:var(--card)}.faint{opacity:.45}</style>";

/// A plot as a file of its own.
pub fn alone(svg: &str) -> String {
    let end = svg.find('>').map_or(0, |at| at + 1);
    format!("{}{STYLE}{}\n", &svg[..end], &svg[end..])
}
