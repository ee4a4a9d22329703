//! The kinds of plots.

use std::fmt::Write;

use maud::{Markup, PreEscaped};

use super::axis::{Axis, Scale, label, labels};
use super::{SERIES, escaped};
use crate::report::summary::grouped;

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
        "<svg xmlns=\"http://www.w3.org/2000/svg\" class=\"plot\" viewBox=\"0 0 {width:.0} {height:.0}\" style=\"max-width:{width:.0}px\" role=\"img\" aria-label=\"{name}\">"
    )
}

/// What stands beside the horizontal axis.
#[derive(Clone, Copy, Debug)]
pub enum Marks<'m> {
    /// Round numbers.
    Round,
    /// The values that were run, as many as there is room for.
    Run(&'m [f64]),
    /// Names; the points' values are their numbers, from 0.
    Names(&'m [String]),
}

/// The width of a character, rather too large than too small.
const CHARACTER: f64 = 7.2;

/// The height of a line of text.
const LINE: f64 = 17.0;

/// Parts a text into lines of at most `most` characters, behind spaces and signs where it has these.
fn wrapped(text: &str, most: usize) -> Vec<String> {
    let (mut lines, mut line): (Vec<String>, Vec<char>) = (Vec::new(), Vec::new());
    for c in text.chars() {
        if line.len() == most {
            let end = line.iter().rposition(|c| " +-*/,=([".contains(*c)).map_or(most, |at| at + 1);
            let rest = line.split_off(end);
            lines.push(line.iter().collect::<String>().trim_end().to_owned());
            line = rest;
        }
        line.push(c);
    }
    lines.push(line.into_iter().collect());
    lines
}

/// Which of some texts, each around a place, have room beside each other: the first and the last, and of the others those that touch none.
fn with_room(marks: Vec<(f64, String)>) -> Vec<(f64, String)> {
    let half = |text: &String| 0.5 * CHARACTER * text.chars().count() as f64 + 4.0;
    let Some((last, last_text)) = marks.last().cloned() else { return marks };
    let (mut end, begin) = (f64::NEG_INFINITY, last - half(&last_text));
    let count = marks.len();
    let keeps = |(at, (x, text)): (usize, (f64, String))| {
        let own = half(&text);
        let fits = at + 1 == count || x - own >= end && (x + own <= begin || at == 0);
        if fits {
            end = x + own;
        }
        fits.then_some((x, text))
    };
    marks.into_iter().enumerate().filter_map(keeps).collect()
}

/// A frame with two axes.
struct Field {
    out: String,
    x: Axis,
    y: Axis,
    top: f64,
}

impl Field {
    /// A frame below `head` units of height, which hold the names of series. The name of the vertical axis stands there, too.
    fn new(names: [&str; 2], x: Axis, y: Axis, marks: Marks<'_>, head: f64) -> Field {
        let lines = |text: &str| wrapped(text, ((WIDTH - LEFT - RIGHT) / CHARACTER) as usize);
        let (below, above) = (lines(names[0]), lines(names[1]));
        let top = head + LINE * above.len() as f64;
        let height = HEIGHT + top + LINE * (below.len() - 1) as f64;
        let mut field = Field { out: open(WIDTH, height, &format!("{} by {}", names[1], names[0])), x, y, top };
        let (right, bottom) = (WIDTH - RIGHT, HEIGHT + top - BOTTOM);
        let ticks: Vec<(f64, String)> = match marks {
            Marks::Round => {
                let ticks = field.x.ticks(7);
                let texts = labels(&ticks);
                ticks.into_iter().zip(texts).collect()
            }
            Marks::Run(values) => values.iter().map(|&value| (value, exact(value))).collect(),
            Marks::Names(names) => names.iter().enumerate().map(|(at, name)| (at as f64, name.clone())).collect(),
        };
        let place = |(value, text): (f64, String)| (field.place(value, 0.0)[0], text);
        let mut ticks: Vec<(f64, String)> = ticks.into_iter().map(place).collect();
        ticks.sort_by(|a, b| a.0.total_cmp(&b.0));
        // Names all stand there, below each other where they would touch.
        let (rows, ticks) = match marks {
            Marks::Names(_) => (1 + usize::from(with_room(ticks.clone()).len() < ticks.len()), ticks),
            _ => (1, with_room(ticks)),
        };
        for (at, (x, text)) in ticks.iter().enumerate() {
            let text = escaped(text);
            let _ = write!(
                field.out,
                "<path class=\"grid\" d=\"M{x:.1} {:.1}V{bottom:.1}\"/><text x=\"{x:.1}\" y=\"{:.1}\" text-anchor=\"middle\">{text}</text>",
                TOP + top,
                bottom + if rows == 1 { 18.0 } else { 14.0 + 13.0 * (at % 2) as f64 }
            );
        }
        let ticks = field.y.ticks(6);
        for (&tick, text) in ticks.iter().zip(labels(&ticks)) {
            let [_, y] = field.place(0.0, tick);
            let _ = write!(
                field.out,
                "<path class=\"grid\" d=\"M{LEFT} {y:.1}H{right:.1}\"/><text x=\"{:.1}\" y=\"{:.1}\" text-anchor=\"end\">{text}</text>",
                LEFT - 6.0,
                y + 4.5
            );
        }
        let _ = write!(field.out, "<path class=\"axis\" fill=\"none\" d=\"M{LEFT} {:.1}V{bottom:.1}H{right:.1}\"/>", TOP + top);
        for (n, line) in above.iter().enumerate() {
            let y = head + 12.0 + LINE * n as f64;
            let _ = write!(field.out, "<text class=\"t\" x=\"6\" y=\"{y:.1}\">{}</text>", escaped(line));
        }
        for (n, line) in below.iter().enumerate() {
            let (x, y) = ((LEFT + right) / 2.0, bottom + 42.0 + LINE * n as f64);
            let _ = write!(
                field.out,
                "<text class=\"t\" x=\"{x:.1}\" y=\"{y:.1}\" text-anchor=\"middle\">{}</text>",
                escaped(line)
            );
        }
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

/// A value that was run, with all its digits: whole numbers in groups of three.
fn exact(value: f64) -> String {
    if value.fract() == 0.0 && (0.0..9e15).contains(&value) { grouped(value as u64) } else { format!("{value}") }
}

/// The names of series, each beside its dot: two in a row where all are short. Gives the height that they take.
fn legend(series: &[Series<'_>]) -> (String, f64) {
    let mut out = String::new();
    if series.len() < 2 {
        return (out, 0.0);
    }
    let longest = series.iter().map(|own| own.name.chars().count()).max().unwrap_or(0);
    let columns = if CHARACTER * longest as f64 <= 225.0 { 2 } else { 1 };
    let mut top = 12.0;
    for (row, own) in series.chunks(columns).enumerate() {
        let mut lines = 1;
        for (column, series) in own.iter().enumerate() {
            let left = LEFT + 250.0 * column as f64;
            let color = (row * columns + column) % SERIES;
            let _ = write!(out, "<circle cx=\"{left:.1}\" cy=\"{top:.1}\" r=\"5\" fill=\"var(--c{color})\"/>");
            let name = wrapped(series.name, ((WIDTH - LEFT - RIGHT - 10.0) / CHARACTER) as usize);
            lines = lines.max(name.len());
            for (n, line) in name.iter().enumerate() {
                let (x, y) = (left + 10.0, top + 4.5 + LINE * n as f64);
                let _ = write!(out, "<text class=\"t\" x=\"{x:.1}\" y=\"{y:.1}\">{}</text>", escaped(line));
            }
        }
        top += 18.0 + LINE * (lines - 1) as f64;
    }
    (out, top - 12.0 + 6.0)
}

/// Points beyond which a line is drawn without dots.
const DOTS: usize = 60;

/// Lines and points over two axes. Of points at one place, that of the first series is seen.
pub fn chart(x: &str, y: &str, x_scale: Scale, y_scale: Scale, marks: Marks<'_>, series: &[Series<'_>]) -> Markup {
    let all = || series.iter().flat_map(|series| series.points.iter().copied());
    let x_axis = match marks {
        Marks::Names(names) => Axis::of_names(names.len()),
        _ => Axis::new(x_scale, all().map(|point| point.0)),
    };
    let y_axis = Axis::new(y_scale, all().map(|point| point.1));
    let (names, head) = legend(series);
    let mut field = Field::new([x, y], x_axis, y_axis, marks, head);
    field.out.push_str(&names);
    for (n, series) in series.iter().enumerate().rev() {
        if series.line {
            field.path(&series.points, &format!("class=\"ln\" stroke=\"var(--c{})\"", n % SERIES));
        }
        if !series.line || series.points.len() <= DOTS {
            let values: Vec<f64> = series.points.iter().map(|point| point.1).collect();
            for (&(x, y), value) in series.points.iter().zip(labels(&values)) {
                let own = match marks {
                    Marks::Names(names) => names.get(x as usize).cloned().unwrap_or_default(),
                    _ => exact(x),
                };
                field.dot((x, y), n, "", &format!("{}: {own}, {value}", series.name));
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
    let mut field = Field::new(["instructions per byte of DRAM traffic", "instructions per cycle"], x, y, Marks::Round, 0.0);
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
    const BAR: f64 = 498.0;
    const NOTE: f64 = 92.0;
    let longest = rows.iter().map(|row| row.name.chars().count()).max().unwrap_or(0);
    let names = (CHARACTER * longest as f64 + 14.0).max(170.0);
    let width = names + BAR + NOTE;
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
        let _ = write!(
            out,
            "<text class=\"t\" x=\"{:.1}\" y=\"{:.1}\" text-anchor=\"end\">{}</text>",
            names - 8.0,
            y + 12.0,
            escaped(&row.name)
        );
        let mut x = names;
        for (color, share, tip) in &row.shares {
            let own = BAR * share.clamp(0.0, 1.0);
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
    let values: Vec<f64> = heat.values.iter().flatten().copied().flatten().collect();
    let mut texts = labels(&values).into_iter();
    let longest = |names: &[String]| names.iter().map(|name| name.chars().count()).max().unwrap_or(0) as f64;
    let left = 34.0 + CHARACTER * longest(&rows.1).max(4.0);
    // The widest text of a cell has the digits of all.
    let cells = longest(&labels(&values)).max(longest(&columns.1));
    let wide = CHARACTER * cells.max(5.0) + 12.0;
    let table = wide * columns.1.len() as f64;
    let width = (left + table + 10.0).max(34.0 + CHARACTER * columns.0.chars().count() as f64);
    let side = CHARACTER * rows.0.chars().count() as f64;
    let height = (56.0 + ROW * rows.1.len() as f64).max(side + 8.0);
    let mut out = open(width, height, title);
    let axis = Axis::new(Scale::Log, values.iter().copied());
    let _ = write!(
        out,
        "<text class=\"t\" x=\"{:.1}\" y=\"16\" text-anchor=\"middle\">{}</text><text class=\"t\" transform=\"translate(14 {:.1}) rotate(-90)\" text-anchor=\"middle\">{}</text>",
        (left + table / 2.0).max(0.5 * CHARACTER * columns.0.chars().count() as f64 + 20.0),
        escaped(columns.0),
        (48.0 + ROW * rows.1.len() as f64 / 2.0).max(side / 2.0 + 4.0),
        escaped(rows.0)
    );
    for (n, name) in columns.1.iter().enumerate() {
        let x = left + wide * (n as f64 + 0.5);
        let _ = write!(out, "<text x=\"{x:.1}\" y=\"38\" text-anchor=\"middle\">{}</text>", escaped(name));
    }
    for (r, name) in rows.1.iter().enumerate() {
        let y = 44.0 + ROW * r as f64;
        let _ = write!(out, "<text x=\"{:.1}\" y=\"{:.1}\" text-anchor=\"end\">{}</text>", left - 8.0, y + 19.0, escaped(name));
        for (c, value) in heat.values[r].iter().enumerate() {
            let x = left + wide * c as f64;
            let (fill, ink, text) = match value {
                Some(value) => {
                    let [red, green, blue] = color(1.0 - axis.place(*value));
                    let bright = 299 * u32::from(red) + 587 * u32::from(green) + 114 * u32::from(blue) > 130_000;
                    let ink = if bright { "#000" } else { "#fff" };
                    (format!("#{red:02x}{green:02x}{blue:02x}"), ink, texts.next().unwrap_or_default())
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
        let text = chart("x<", "y", Scale::Linear, Scale::FromZero, Marks::Round, &series).into_string();
        assert!(text.contains("&lt;a&amp;&quot;&gt;") && !text.contains("<a&"), "{text}");
        assert_eq!(text.matches("class=\"dot\"").count(), 3);
        assert!(text.starts_with("<svg") && text.ends_with("</svg>"));
    }

    /// The texts of a plot, in their order.
    fn texts(svg: &str) -> Vec<&str> {
        svg.split("<text").skip(1).filter_map(|part| part.split('>').nth(1)?.split('<').next()).collect()
    }

    #[test]
    fn ticks_are_the_values_that_were_run_and_names_are_whole() {
        let run = [2.0, 4.0, 8.0];
        let name =
            "caches.texture.misses/(caches.texture.accesses+caches.texture.hits+caches.texture.late_hits+caches.color.misses)";
        let series = [Series { name, points: run.map(|x| (x, x)).to_vec(), line: true }];
        let svg = chart("memory.dram.channels", name, Scale::Linear, Scale::FromZero, Marks::Run(&run), &series).into_string();
        let found = texts(&svg);
        assert_eq!(found[..3], ["2", "4", "8"]);
        assert_eq!(found.iter().filter(|text| text.starts_with("2.5") || text.starts_with("3")).count(), 0, "{found:?}");
        // The name of the axis stands in lines, all of it.
        assert!(found.windows(2).any(|pair| format!("{}{}", pair[0], pair[1]) == name), "{found:?}");
        // Values without room are left out, the first and the last are not.
        let many: Vec<f64> = (1000..1100).map(f64::from).collect();
        let points = many.iter().map(|&x| (x, x)).collect();
        let series = [Series { name: "a", points, line: true }];
        let svg = chart("x", "y", Scale::Linear, Scale::FromZero, Marks::Run(&many), &series).into_string();
        let found = texts(&svg);
        let own: Vec<&&str> = found.iter().take_while(|text| text.contains(',')).collect();
        assert!(own.len() < 20 && *own[0] == "1,000" && *own[own.len() - 1] == "1,099", "{found:?}");
        let names: Vec<String> =
            ["sort-middle-binned", "sort-last-fragment", "sort-last-image", "true", "false"].map(String::from).into();
        let series = [Series { name: "mean", points: (0..5).map(|at| (f64::from(at), 1.0)).collect(), line: false }];
        let svg = chart("sort", "cycles", Scale::Linear, Scale::FromZero, Marks::Names(&names), &series).into_string();
        assert!(names.iter().all(|name| texts(&svg).contains(&name.as_str())), "{svg}");
    }

    #[test]
    fn cells_have_digits_enough_to_differ_and_heads_are_whole() {
        let table = Heat {
            rows: ("sort", vec!["sort-middle-binned-and-more-than-22".into()]),
            columns: ("sort", vec!["sort-last-fragment".into(), "sort-last-image".into()]),
            values: vec![vec![Some(129_795.0), Some(129_952.0)]],
        };
        let svg = heat("t", &table);
        let found = texts(&svg);
        for text in ["sort-middle-binned-and-more-than-22", "sort-last-fragment", "sort-last-image", "129.8k", "130k"] {
            assert!(found.contains(&text), "{text}: {found:?}");
        }
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
