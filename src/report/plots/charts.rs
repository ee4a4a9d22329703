//! The kinds of plots.

use std::fmt::Write;

use maud::{Markup, PreEscaped};

use super::axis::{Axis, Scale, label};
use super::{SERIES, escaped};

const WIDTH: f64 = 560.0;
const HEIGHT: f64 = 330.0;
const LEFT: f64 = 62.0;
const RIGHT: f64 = 16.0;
const TOP: f64 = 16.0;
const BOTTOM: f64 = 48.0;

/// Points of one name.
#[derive(Clone, Debug)]
pub struct Series<'s> {
    /// Its name.
    pub name: &'s str,
    /// Its points.
    pub points: Vec<(f64, f64)>,
    /// Whether they are joined.
    pub line: bool,
}

fn open(width: f64, height: f64, name: &str) -> String {
    let name = escaped(name);
    format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" class=\"plot\" viewBox=\"0 0 {width:.0} {height:.0}\" role=\"img\" aria-label=\"{name}\">"
    )
}

/// A frame with two axes.
struct Field {
    out: String,
    x: Axis,
    y: Axis,
    top: f64,
}

impl Field {
    fn new(names: [&str; 2], x: Axis, y: Axis, top: f64) -> Field {
        let mut field = Field { out: open(WIDTH, HEIGHT + top, &format!("{} by {}", names[1], names[0])), x, y, top };
        let (right, bottom) = (WIDTH - RIGHT, HEIGHT + top - BOTTOM);
        for tick in field.x.ticks(7) {
            let [x, _] = field.place(tick, 0.0);
            let text = label(tick);
            let _ = write!(
                field.out,
                "<path class=\"grid\" d=\"M{x:.1} {:.1}V{bottom:.1}\"/><text x=\"{x:.1}\" y=\"{:.1}\" text-anchor=\"middle\">{text}</text>",
                TOP + top,
                bottom + 18.0
            );
        }
        for tick in field.y.ticks(6) {
            let [_, y] = field.place(0.0, tick);
            let text = label(tick);
            let _ = write!(
                field.out,
                "<path class=\"grid\" d=\"M{LEFT} {y:.1}H{right:.1}\"/><text x=\"{:.1}\" y=\"{:.1}\" text-anchor=\"end\">{text}</text>",
                LEFT - 6.0,
                y + 4.5
            );
        }
        let _ = write!(
            field.out,
            "<path class=\"axis\" fill=\"none\" d=\"M{LEFT} {:.1}V{bottom:.1}H{right:.1}\"/>\
             <text class=\"t\" x=\"{:.1}\" y=\"{:.1}\" text-anchor=\"middle\">{}</text>\
             <text class=\"t\" transform=\"translate(14 {:.1}) rotate(-90)\" text-anchor=\"middle\">{}</text>",
            TOP + top,
            (LEFT + right) / 2.0,
            bottom + 40.0,
            escaped(names[0]),
            (TOP + top + bottom) / 2.0,
            escaped(names[1])
        );
        field
    }

    fn place(&self, x: f64, y: f64) -> [f64; 2] {
        let (width, height) = (WIDTH - LEFT - RIGHT, HEIGHT - TOP - BOTTOM);
        [LEFT + width * self.x.place(x), self.top + TOP + height * (1.0 - self.y.place(y))]
    }

    fn dot(&mut self, (x, y): (f64, f64), color: usize, class: &str, tip: &str) {
        let [x, y] = self.place(x, y);
        let _ = write!(
            self.out,
            "<circle class=\"dot{class}\" cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"4.5\" fill=\"var(--c{})\"><title>{}</title></circle>",
            color % SERIES,
            escaped(tip)
        );
    }

    fn path(&mut self, points: &[(f64, f64)], style: &str) {
        let mut d = String::new();
        for (n, &(x, y)) in points.iter().enumerate() {
            let [x, y] = self.place(x, y);
            let _ = write!(d, "{}{x:.1} {y:.1}", if n == 0 { "M" } else { "L" });
        }
        let _ = write!(self.out, "<path {style} d=\"{d}\"/>");
    }

    fn end(mut self) -> String {
        self.out.push_str("</svg>");
        self.out
    }
}

/// Points beyond which a line is drawn without dots.
const DOTS: usize = 60;

/// Lines and points over two axes.
pub fn chart(x: &str, y: &str, x_scale: Scale, y_scale: Scale, series: &[Series<'_>]) -> Markup {
    let all = || series.iter().flat_map(|series| series.points.iter().copied());
    // Names stand above, in rows of two.
    let rows = if series.len() > 1 { series.len().min(SERIES).div_ceil(2) } else { 0 };
    let axes = [Axis::new(x_scale, all().map(|point| point.0)), Axis::new(y_scale, all().map(|point| point.1))];
    let [x_axis, y_axis] = axes;
    let mut field = Field::new([x, y], x_axis, y_axis, 18.0 * rows as f64);
    for (n, series) in series.iter().enumerate() {
        let color = n % SERIES;
        if rows > 0 && n < SERIES {
            let (left, top) = (LEFT + 250.0 * (n % 2) as f64, 12.0 + 18.0 * (n / 2) as f64);
            let name: String = series.name.chars().take(32).collect();
            let _ = write!(
                field.out,
                "<circle cx=\"{left:.1}\" cy=\"{top:.1}\" r=\"5\" fill=\"var(--c{color})\"/><text class=\"t\" x=\"{:.1}\" y=\"{:.1}\">{}</text>",
                left + 10.0,
                top + 4.5,
                escaped(&name)
            );
        }
        if series.line {
            field.path(&series.points, &format!("class=\"ln\" stroke=\"var(--c{color})\""));
        }
        if !series.line || series.points.len() <= DOTS {
            for &(x, y) in &series.points {
                field.dot((x, y), color, "", &format!("{}: {}, {}", series.name, label(x), label(y)));
            }
        }
    }
    PreEscaped(field.end())
}

/// A roofline: roofs, and what was reached.
#[derive(Clone, Debug)]
pub struct Roofline {
    /// Bytes per cycle.
    pub bandwidth: f64,
    /// Instructions per cycle.
    pub peak: f64,
    /// Name, instructions per byte, instructions per cycle.
    pub points: Vec<(String, f64, f64)>,
}

/// Draws a roofline, both axes logarithmic.
pub fn roofline(roofs: &Roofline) -> String {
    let knee = roofs.peak / roofs.bandwidth;
    let own = roofs.points.iter().map(|point| point.1);
    let low = own.clone().fold(knee, f64::min) / 8.0;
    let high = own.fold(knee, f64::max) * 8.0;
    let bottom = roofs.points.iter().map(|point| point.2).fold(low * roofs.bandwidth, f64::min).max(roofs.peak / 1e6);
    let x = Axis::new(Scale::Log, [low, high].into_iter());
    let y = Axis::new(Scale::Log, [bottom, roofs.peak * 1.5].into_iter());
    let mut field = Field::new(["instructions per byte of DRAM traffic", "instructions per cycle"], x, y, 0.0);
    field.path(&[(low, low * roofs.bandwidth), (knee, roofs.peak), (high, roofs.peak)], "class=\"roof\"");
    let [knee_x, knee_y] = field.place(knee, roofs.peak);
    let _ = write!(field.out, "<text x=\"{:.1}\" y=\"{:.1}\">knee {}</text>", knee_x + 6.0, knee_y + 20.0, label(knee));
    for (n, (name, intensity, rate)) in roofs.points.iter().enumerate() {
        let roof = roofs.peak.min(intensity * roofs.bandwidth);
        field.path(&[(*intensity, *rate), (*intensity, roof)], "class=\"axis dash\"");
        field.dot(
            (*intensity, *rate),
            n + 1,
            "",
            &format!("{name}: {} per byte, {} per cycle", label(*intensity), label(*rate)),
        );
        let [x, y] = field.place(*intensity, *rate);
        let _ = write!(field.out, "<text class=\"t\" x=\"{:.1}\" y=\"{:.1}\">{}</text>", x + 8.0, y + 4.5, escaped(name));
    }
    field.end()
}

/// A row of bars one behind another.
#[derive(Clone, Debug)]
pub struct Stack {
    /// Its name.
    pub name: String,
    /// Shares of the whole, each with the variable of its colour and its name.
    pub shares: Vec<(&'static str, f64, String)>,
    /// What stands behind it.
    pub note: String,
}

/// Rows of shares.
pub fn bars(title: &str, key: &[(&str, &str)], rows: &[Stack]) -> String {
    const ROW: f64 = 22.0;
    const NAME: f64 = 170.0;
    const NOTE: f64 = 92.0;
    let width = 760.0;
    let height = 40.0 + ROW * rows.len() as f64 + 10.0;
    let mut out = open(width, height, title);
    let mut left = 10.0;
    for (color, name) in key {
        let _ = write!(
            out,
            "<rect x=\"{left:.1}\" y=\"10\" width=\"12\" height=\"12\" rx=\"3\" fill=\"var(--{color})\"/><text x=\"{:.1}\" y=\"21\">{}</text>",
            left + 17.0,
            escaped(name)
        );
        left += 34.0 + 7.2 * name.chars().count() as f64;
    }
    for (n, row) in rows.iter().enumerate() {
        let y = 36.0 + ROW * n as f64;
        let name: String = row.name.chars().take(24).collect();
        let _ = write!(
            out,
            "<text class=\"t\" x=\"{:.1}\" y=\"{:.1}\" text-anchor=\"end\">{}</text>",
            NAME - 8.0,
            y + 12.0,
            escaped(&name)
        );
        let (mut x, all) = (NAME, width - NAME - NOTE);
        for (color, share, tip) in &row.shares {
            let own = all * share.clamp(0.0, 1.0);
            let _ = write!(
                out,
                "<rect x=\"{x:.1}\" y=\"{y:.1}\" width=\"{own:.1}\" height=\"15\" fill=\"var(--{color})\"><title>{}</title></rect>",
                escaped(tip)
            );
            x += own;
        }
        let _ = write!(
            out,
            "<text x=\"{:.1}\" y=\"{:.1}\" text-anchor=\"end\">{}</text>",
            width - 4.0,
            y + 12.0,
            escaped(&row.note)
        );
    }
    out.push_str("</svg>");
    out
}

/// A table of numbers in colours.
#[derive(Clone, Debug)]
pub struct Heat<'h> {
    /// The name of the rows, and their values.
    pub rows: (&'h str, Vec<String>),
    /// The name of the columns, and their values.
    pub columns: (&'h str, Vec<String>),
    /// Values by row, then column.
    pub values: Vec<Vec<Option<f64>>>,
}

/// Colours from dark to light, in which order is seen with any kind of colour vision (viridis, Smith and van der Walt 2015).
const VIRIDIS: [[u8; 3]; 10] = [
    [68, 1, 84],
    [72, 40, 120],
    [62, 73, 137],
    [49, 104, 142],
    [38, 130, 142],
    [31, 158, 137],
    [53, 183, 121],
    [110, 206, 88],
    [181, 222, 43],
    [253, 231, 37],
];

/// The colour of a share from 0 to 1.
fn color(share: f64) -> [u8; 3] {
    let at = share.clamp(0.0, 1.0) * (VIRIDIS.len() - 1) as f64;
    let low = (at as usize).min(VIRIDIS.len() - 2);
    let part = at - low as f64;
    std::array::from_fn(|c| {
        let [a, b] = [VIRIDIS[low][c], VIRIDIS[low + 1][c]].map(f64::from);
        (a + (b - a) * part).round() as u8
    })
}

/// Draws a table of numbers in colours, on a logarithmic scale: few is light.
pub fn heat(title: &str, heat: &Heat<'_>) -> String {
    const ROW: f64 = 30.0;
    let (rows, columns) = (&heat.rows, &heat.columns);
    let longest = rows.1.iter().map(|name| name.chars().count()).max().unwrap_or(0).clamp(4, 22);
    let left = 34.0 + 7.5 * longest as f64;
    let wide = ((WIDTH - left - 10.0) / columns.1.len().max(1) as f64).clamp(40.0, 96.0);
    let (width, height) = (left + wide * columns.1.len() as f64 + 10.0, 48.0 + ROW * rows.1.len() as f64 + 8.0);
    let mut out = open(width, height, title);
    let all = || heat.values.iter().flatten().copied().flatten();
    let axis = Axis::new(Scale::Log, all());
    let _ = write!(
        out,
        "<text class=\"t\" x=\"{:.1}\" y=\"16\" text-anchor=\"middle\">{}</text><text class=\"t\" transform=\"translate(14 {:.1}) rotate(-90)\" text-anchor=\"middle\">{}</text>",
        left + wide * columns.1.len() as f64 / 2.0,
        escaped(columns.0),
        48.0 + ROW * rows.1.len() as f64 / 2.0,
        escaped(rows.0)
    );
    let short = |name: &String, most: usize| escaped(&name.chars().take(most).collect::<String>());
    for (n, name) in columns.1.iter().enumerate() {
        let x = left + wide * (n as f64 + 0.5);
        let _ = write!(out, "<text x=\"{x:.1}\" y=\"38\" text-anchor=\"middle\">{}</text>", short(name, (wide / 7.0) as usize));
    }
    for (r, name) in rows.1.iter().enumerate() {
        let y = 44.0 + ROW * r as f64;
        let _ =
            write!(out, "<text x=\"{:.1}\" y=\"{:.1}\" text-anchor=\"end\">{}</text>", left - 8.0, y + 19.0, short(name, 22));
        for (c, value) in heat.values[r].iter().enumerate() {
            let x = left + wide * c as f64;
            let (fill, ink, text) = match value {
                Some(value) => {
                    let [red, green, blue] = color(1.0 - axis.place(*value));
                    let bright = 299 * u32::from(red) + 587 * u32::from(green) + 114 * u32::from(blue) > 130_000;
                    (format!("#{red:02x}{green:02x}{blue:02x}"), if bright { "#000" } else { "#fff" }, label(*value))
                }
                None => ("none".into(), "currentColor", "\u{2013}".into()),
            };
            let _ = write!(
                out,
                "<rect class=\"frame\" x=\"{x:.1}\" y=\"{y:.1}\" width=\"{wide:.1}\" height=\"{ROW}\" style=\"fill:{fill}\"/>\
                 <text x=\"{:.1}\" y=\"{:.1}\" text-anchor=\"middle\" style=\"fill:{ink}\">{text}</text>",
                x + wide / 2.0,
                y + 19.5
            );
        }
    }
    out.push_str("</svg>");
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_escaped_and_every_point_is_drawn() {
        let series = [
            Series { name: "<a&\">", points: vec![(1.0, 2.0), (2.0, 3.0)], line: true },
            Series { name: "b", points: vec![(1.5, 1.0)], line: false },
        ];
        let text = chart("x<", "y", Scale::Linear, Scale::FromZero, &series).into_string();
        assert!(text.contains("&lt;a&amp;&quot;&gt;") && !text.contains("<a&"), "{text}");
        assert_eq!(text.matches("class=\"dot\"").count(), 3);
        assert!(text.starts_with("<svg") && text.ends_with("</svg>"));
    }

    #[test]
    fn the_knee_of_a_roofline_is_where_both_roofs_meet() {
        let roofs = Roofline { bandwidth: 16.0, peak: 64.0, points: vec![("frame".into(), 4.0, 32.0)] };
        let text = roofline(&roofs);
        assert!(text.contains("knee 4<") && text.contains(">frame<"), "{text}");
    }

    #[test]
    fn colours_run_from_dark_to_light() {
        assert_eq!([color(0.0), color(1.0), color(2.0)], [[68, 1, 84], [253, 231, 37], [253, 231, 37]]);
        let table = Heat {
            rows: ("r", vec!["1".into()]),
            columns: ("c", vec!["1".into(), "2".into()]),
            values: vec![vec![Some(10.0), None]],
        };
        assert_eq!(heat("t", &table).matches("<rect").count(), 2);
    }
}
