//! Plots as SVG, drawn here: for pages, where they take the page's colours, and as files of their own.
//!
//! Coordinates are rounded to a tenth of a unit, so that the same numbers give the same bytes on every host.

mod axis;
mod charts;

pub use axis::Scale;
pub use charts::{Heat, Marks, Roofline, Series, Stack, bars, chart, heat, roofline};

/// A text as SVG has it.
pub(crate) fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}

/// Colours of series: of Okabe and Ito (2008), which readers with any kind of colour vision tell apart; darker where they are for lines.
pub const SERIES: usize = 8;

/// The colours of a plot that is a file of its own: those of light pages. Programs that turn SVG into pictures know no variables.
const COLORS: [(&str, &str); 20] = [
    ("card", "#ffffff"),
    ("ink", "#1b2330"),
    ("muted", "#566173"),
    ("line", "#dde2ea"),
    ("busy", "#0072b2"),
    ("starved", "#c9cfd9"),
    ("blocked", "#d55e00"),
    ("memory", "#e0a100"),
    ("latency", "#8f5fb5"),
    ("idle", "#eceff4"),
    ("draw", "#0b6bb8"),
    ("other", "#b8620a"),
    ("c0", "#0072b2"),
    ("c1", "#d55e00"),
    ("c2", "#00835f"),
    ("c3", "#a8578a"),
    ("c4", "#946c00"),
    ("c5", "#3e8fc4"),
    ("c6", "#6b5bb5"),
    ("c7", "#5f6b7a"),
];

/// The style of a plot that is a file of its own.
const STYLE: &str = "<style>svg{font-family:sans-serif}text{fill:var(--muted);font-size:13px}text.t{fill:var(--ink)}.grid{stroke:var(--line)}\
.axis{stroke:var(--muted)}.frame{fill:none;stroke:var(--line)}.roof{fill:none;stroke:var(--ink);stroke-width:2}.dash{stroke-dasharray:5 4}\
.ln{fill:none;stroke-width:2}.dot{stroke:var(--card)}.faint{opacity:.45}</style><rect width=\"100%\" height=\"100%\" fill=\"var(--card)\"/>";

/// A plot as a file of its own: on a white ground, in colours that are written out.
pub fn alone(svg: &str) -> String {
    let end = svg.find('>').map_or(0, |at| at + 1);
    let text = format!("{}{STYLE}{}\n", &svg[..end], &svg[end..]);
    COLORS.iter().fold(text, |text, (name, color)| text.replace(&format!("var(--{name})"), color))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_plot_alone_has_no_variable() {
        let series = [Series { name: "a", points: vec![(1.0, 2.0), (2.0, 3.0)], line: true }];
        let drawn = chart("x", "y", Scale::Linear, Scale::FromZero, Marks::Round, &series).into_string();
        let roofs = Roofline { bandwidth: 16.0, peak: 64.0, points: vec![("frame".into(), 4.0, 32.0)] };
        let stacks =
            [Stack { name: "n".into(), shares: vec![("busy", 0.5, "b".into()), ("idle", 0.5, "i".into())], note: "1".into() }];
        for svg in [drawn, roofline(&roofs), bars("t", &[("memory", "m"), ("latency", "l"), ("starved", "s")], &stacks)] {
            let text = alone(&svg);
            assert!(svg.contains("var(") && !text.contains("var("), "{text}");
        }
    }
}
