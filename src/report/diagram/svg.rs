//! A diagram as a picture: the data flow downwards, memory in a frame of its own.

use super::layout::{BoxPosition, place};
use super::{Bank, Cable, Diagram, shape, times};

const BOX_WIDTH: f64 = 128.0;
const LINE: f64 = 13.0;
/// A letter of the small and of the large writing.
const LETTER: f64 = 6.1;
const MARGIN: f64 = 16.0;
const TOP: f64 = 52.0;
/// White around writing that lines may cross.
const HALO: &str = "stroke=\"white\" stroke-width=\"3\" paint-order=\"stroke\"";
const SORTS: &str = "#c05000";
const PLAIN: &str = "#44546a";

/// A box of the picture.
#[derive(Clone, Debug)]
struct Box {
    bank: usize,
    row: usize,
    column: usize,
    x: f64,
    y: f64,
    height: f64,
    /// Small writing below the name.
    notes: Vec<String>,
    /// Whether the bank sorts within itself: no line shows it.
    sorts: bool,
}

impl Box {
    fn middle(&self) -> f64 {
        self.x + BOX_WIDTH / 2.0
    }
}

/// All cables between two boxes, in both directions.
#[derive(Clone, Debug)]
struct Line<'a> {
    /// Boxes: the one that is further up, or to the left, and the other.
    a: usize,
    b: usize,
    down: Vec<&'a Cable>,
    up: Vec<&'a Cable>,
    /// The track that its vertical part takes, if it has one beside the boxes.
    track: f64,
}

impl Line<'_> {
    fn cables(&self) -> impl Iterator<Item = &Cable> {
        self.down.iter().chain(&self.up).copied()
    }

    fn straight(&self, boxes: &[Box]) -> bool {
        boxes[self.a].column == boxes[self.b].column && boxes[self.a].row + 1 == boxes[self.b].row
    }

    /// The gap between columns in which its vertical part lies: that left of this column.
    fn gap(&self, boxes: &[Box]) -> usize {
        boxes[self.a].column.max(boxes[self.b].column)
    }

    /// Writing beside it, with arrows for the two directions.
    fn labels(&self, down: &str, up: &str) -> Vec<String> {
        let label = |arrow: &str, cable: &Cable| format!("{arrow} {}", times(cable.name, cable.count));
        let downs = self.down.iter().map(|cable| label(down, cable));
        downs.chain(self.up.iter().map(|cable| label(up, cable))).collect()
    }

    /// Letters of the longest writing.
    fn longest(&self) -> usize {
        self.labels(" ", " ").iter().map(|label| label.chars().count()).max().unwrap_or(0)
    }

    fn colour(&self) -> &'static str {
        if self.cables().any(|cable| cable.sorts) { SORTS } else { PLAIN }
    }

    fn width(&self) -> f64 {
        8.0 + LINE * (self.down.len() + self.up.len()) as f64
    }
}

/// Boxes and lines of one group, from its own corner.
struct Group<'a> {
    boxes: Vec<Box>,
    lines: Vec<Line<'a>>,
    width: f64,
    height: f64,
}

/// Small writing in a bank's box.
fn notes(diagram: &Diagram, bank: usize) -> Vec<String> {
    let mut notes = Vec::new();
    for cable in &diagram.cables {
        if cable.from == bank && cable.to == bank {
            notes.push(times(cable.name, cable.count));
        } else if cable.from == bank && diagram.is_memory(cable.to) && !diagram.is_memory(bank) {
            notes.push(times("memory port", cable.count));
        }
    }
    notes
}

/// Lays a group of banks out.
fn group<'a>(diagram: &'a Diagram, banks: &[usize], end: &str) -> Group<'a> {
    let places: Vec<BoxPosition> = place(diagram, banks, end);
    let mut boxes: Vec<Box> = places
        .iter()
        .map(|&BoxPosition { bank, row, column }| {
            let notes = notes(diagram, bank);
            let height = 24.0 + LINE * notes.len() as f64;
            let sorts = diagram.cables.iter().any(|cable| cable.sorts && cable.from == bank && cable.to == bank);
            Box { bank, row, column, x: 0.0, y: 0.0, height, notes, sorts }
        })
        .collect();

    // 1. Lines: one for each pair of boxes.
    let mut lines: Vec<Line<'a>> = Vec::new();
    let number = |bank: usize| boxes.iter().position(|b| b.bank == bank);
    for cable in &diagram.cables {
        let (Some(from), Some(to)) = (number(cable.from), number(cable.to)) else { continue };
        if from == to {
            continue;
        }
        let key = |n: usize| (boxes[n].row, boxes[n].column);
        let down = key(from) < key(to);
        let (a, b) = if down { (from, to) } else { (to, from) };
        let at = lines.iter().position(|line| (line.a, line.b) == (a, b)).unwrap_or_else(|| {
            lines.push(Line { a, b, down: Vec::new(), up: Vec::new(), track: 0.0 });
            lines.len() - 1
        });
        if down { lines[at].down.push(cable) } else { lines[at].up.push(cable) }
    }

    // 2. Rows: room for the highest box, and for the writing between it and the next.
    let rows = boxes.iter().map(|b| b.row + 1).max().unwrap_or(0);
    let mut y = 0.0;
    for row in 0..rows {
        let beside = lines.iter().filter(|line| line.straight(&boxes) && boxes[line.a].row == row);
        let labels = beside.map(|line| line.down.len() + line.up.len()).max().unwrap_or(1).max(1);
        let mut tallest = 0.0_f64;
        for b in boxes.iter_mut().filter(|b| b.row == row) {
            b.y = y;
            tallest = tallest.max(b.height);
        }
        // Writing along the vertical part of a line from this row to the next.
        let along =
            lines.iter().filter(|line| !line.straight(&boxes) && boxes[line.a].row == row && boxes[line.b].row == row + 1);
        let longest = along.map(|line| line.longest()).max().unwrap_or(0);
        y += (tallest + 24.0 + LINE * labels as f64).max(LETTER * longest as f64 + 14.0);
    }

    // 3. Tracks: in each gap, the shortest lines nearest to the boxes on its right.
    let columns = boxes.iter().map(|b| b.column + 1).max().unwrap_or(0);
    let mut x = 0.0;
    for column in 0..columns {
        let mut here: Vec<usize> =
            (0..lines.len()).filter(|&n| !lines[n].straight(&boxes) && lines[n].gap(&boxes) == column).collect();
        let span = |line: &Line| (boxes[line.a].y, boxes[line.b].y + boxes[line.b].height);
        here.sort_by(|&a, &b| {
            let length = |n: usize| span(&lines[n]).1 - span(&lines[n]).0;
            length(a).total_cmp(&length(b)).then(a.cmp(&b))
        });
        // Each takes the first place in which none that it would meet lies.
        let mut laid: Vec<(usize, f64)> = Vec::new();
        for n in here {
            let (top, bottom) = span(&lines[n]);
            let meets = |m: usize| span(&lines[m]).0 < bottom && top < span(&lines[m]).1;
            let offset =
                laid.iter().filter(|(m, _)| meets(*m)).map(|&(m, offset)| offset + lines[m].width()).fold(10.0, f64::max);
            laid.push((n, offset));
        }
        let gap = laid.iter().map(|&(n, offset)| offset + lines[n].width()).fold(0.0, f64::max);
        // Writing beside straight lines of the column before sticks out.
        let gap = gap + if column == 0 { 0.0 } else { 24.0 };
        x += gap;
        for (n, offset) in laid {
            lines[n].track = x - offset;
        }
        for b in boxes.iter_mut().filter(|b| b.column == column) {
            b.x = x;
        }
        let beside = lines.iter().filter(|line| line.straight(&boxes) && boxes[line.a].column == column);
        let longest = beside.map(|line| line.longest()).max().unwrap_or(0);
        x += BOX_WIDTH.max(BOX_WIDTH / 2.0 + 8.0 + LETTER * longest as f64);
    }
    Group { boxes, lines, width: x, height: y }
}

/// The groups of a diagram, the second where the first has room for it, with the corners of both.
fn groups(diagram: &Diagram) -> [(Group<'_>, f64, f64); 2] {
    let (memory, others): (Vec<_>, Vec<_>) = (0..diagram.banks.len()).partition(|&bank| diagram.is_memory(bank));
    let main = group(diagram, &others, "color");
    let memory = group(diagram, &memory, "dram");
    // Beside what there is in the rows that it would stand in, from the third on.
    let top = main.boxes.iter().filter(|b| b.row <= 2).map(|b| b.y + b.height).fold(0.0, f64::max) + 48.0;
    let bottom = top + memory.height + 40.0;
    let tracks = main.lines.iter().filter(|line| !line.straight(&main.boxes));
    let crossing =
        tracks.filter(|line| main.boxes[line.a].y < bottom && main.boxes[line.b].y + main.boxes[line.b].height > top);
    let beside = main.boxes.iter().filter(|b| b.y < bottom && b.y + b.height > top).map(|b| b.x + 2.0 * BOX_WIDTH);
    let x = beside.chain(crossing.map(|line| line.track + 24.0)).fold(0.0, f64::max) + 36.0;
    [(main, MARGIN, TOP), (memory, MARGIN + x, TOP + top)]
}

/// Corner, width and height of each box. For tests.
#[cfg(test)]
pub(super) fn boxes(diagram: &Diagram) -> Vec<(f64, f64, f64, f64)> {
    let of = |(group, x, y): &(Group<'_>, f64, f64)| {
        group.boxes.iter().map(|b| (b.x + x, b.y + y, BOX_WIDTH, b.height)).collect::<Vec<_>>()
    };
    groups(diagram).iter().flat_map(of).collect()
}

fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}

/// How busy a bank is, from 0 to 1; none where that is not shown.
type Busy<'b> = &'b dyn Fn(&str) -> Option<f64>;

/// The fill of a bank's box, and the colour of writing on it: with a contrast of 4.5 at least.
fn fill(busy: Option<f64>) -> (String, &'static str) {
    let Some(busy) = busy else { return ("#e8eef7".into(), "#555") };
    let part = |light: f64, dark: f64| (light + (dark - light) * busy.clamp(0.0, 1.0)).round() as u8;
    let color = format!("#{:02x}{:02x}{:02x}", part(243.0, 8.0), part(247.0, 81.0), part(252.0, 156.0));
    (color, if busy > 0.77 { "#fff" } else { "#000" })
}

/// The whole file.
pub(super) fn draw(diagram: &Diagram, busy: Busy<'_>) -> String {
    let groups = groups(diagram);
    let width = groups.iter().map(|(group, x, _)| x + group.width).fold(0.0, f64::max) + MARGIN;
    let height = groups.iter().map(|(group, _, y)| y + group.height).fold(0.0, f64::max) + MARGIN;
    let mut text = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {width:.0} {height:.0}\" width=\"{width:.0}\" height=\"{height:.0}\" \
         font-family=\"DejaVu Sans, Verdana, sans-serif\" font-size=\"10\" text-rendering=\"geometricPrecision\">\n"
    );
    text.push_str("<defs>\n");
    for (name, colour) in [("plain", PLAIN), ("sorts", SORTS)] {
        text.push_str(&format!(
            "<marker id=\"{name}\" viewBox=\"0 0 8 8\" refX=\"8\" refY=\"4\" markerWidth=\"7\" markerHeight=\"7\" \
             orient=\"auto-start-reverse\" markerUnits=\"userSpaceOnUse\"><path d=\"M0 0 8 4 0 8z\" fill=\"{colour}\"/></marker>\n"
        ));
    }
    text.push_str("</defs>\n");
    text.push_str(&format!("<rect width=\"{width:.0}\" height=\"{height:.0}\" fill=\"white\"/>\n"));
    let title = escaped(&diagram.title);
    text.push_str(&format!("<text x=\"{MARGIN}\" y=\"24\" font-size=\"15\" font-weight=\"bold\">{title}</text>\n"));
    text.push_str(&format!(
        "<text x=\"{MARGIN}\" y=\"40\" fill=\"#555\">Stacked boxes are banks of equal units, xN counts units or parallel channels; \
         <tspan fill=\"{SORTS}\">here work is sorted</tspan></text>\n"
    ));
    for (n, (group, x, y)) in groups.iter().enumerate() {
        text.push_str(&format!("<g transform=\"translate({x:.1} {y:.1})\">\n"));
        if n == 1 {
            text.push_str(&format!(
                "<rect x=\"-14\" y=\"-30\" width=\"{:.1}\" height=\"{:.1}\" fill=\"none\" stroke=\"#999\" stroke-dasharray=\"5 4\"/>\n\
                 <text x=\"-6\" y=\"-16\" fill=\"#555\">memory, behind all ports</text>\n",
                group.width + 28.0,
                group.height + 10.0
            ));
        }
        lines(&mut text, group, diagram);
        for b in &group.boxes {
            let bank = &diagram.banks[b.bank];
            draw_box(&mut text, b, bank, busy(bank.name));
        }
        text.push_str("</g>\n");
    }
    text.push_str("</svg>\n");
    text
}

fn draw_box(text: &mut String, b: &Box, bank: &Bank, busy: Option<f64>) {
    let (x, y, height) = (b.x, b.y, b.height);
    let (fill, ink) = fill(busy);
    // A box without a share is written as it always was.
    let (name_ink, share) = match busy {
        Some(busy) => (format!(" fill=\"{ink}\""), format!(", busy in {:.1} % of its cycles", 100.0 * busy)),
        None => (String::new(), String::new()),
    };
    // A page has colours of its own for shares: its style mixes them by `--use`, and writes in dark letters from half of the cycles on.
    let class = busy.map_or(String::new(), |busy| {
        format!(" class=\"use{}\" style=\"--use:{:.1}%\"", if busy > 0.52 { " dark" } else { "" }, 100.0 * busy.clamp(0.0, 1.0))
    });
    text.push_str(&format!("<g{class}><title>{}{share}</title>\n", escaped(&times(bank.name, bank.count))));
    let (edge, thick) = if b.sorts { (SORTS, " stroke-width=\"2\"") } else { ("#44546a", "") };
    let behind: &[f64] = if bank.count > 1 { &[6.0, 3.0, 0.0] } else { &[0.0] };
    for offset in behind {
        text.push_str(&format!(
            "<rect x=\"{:.1}\" y=\"{:.1}\" width=\"{BOX_WIDTH}\" height=\"{height}\" rx=\"3\" fill=\"{fill}\" stroke=\"{edge}\"{thick}/>\n",
            x + offset,
            y - offset
        ));
    }
    let middle = b.middle();
    text.push_str(&format!(
        "<text x=\"{middle:.1}\" y=\"{:.1}\" text-anchor=\"middle\" font-size=\"12\" font-weight=\"bold\"{name_ink}>{}</text>\n",
        y + 16.0,
        times(bank.name, bank.count)
    ));
    for (n, note) in b.notes.iter().enumerate() {
        text.push_str(&format!(
            "<text x=\"{middle:.1}\" y=\"{:.1}\" text-anchor=\"middle\" fill=\"{ink}\">{note}</text>\n",
            y + 16.0 + LINE * (n + 1) as f64
        ));
    }
    text.push_str("</g>\n");
}

/// Where lines that are not straight leave their boxes: spread over the side, by where they go.
fn ports(group: &Group<'_>) -> Vec<(f64, f64)> {
    let mut ports = vec![(0.0, 0.0); group.lines.len()];
    for (n, b) in group.boxes.iter().enumerate() {
        for left in [true, false] {
            let side = |line: &Line<'_>| (line.track < b.x) == left;
            let mut here: Vec<usize> = (0..group.lines.len())
                .filter(|&l| {
                    let line = &group.lines[l];
                    (line.a == n || line.b == n) && !line.straight(&group.boxes) && side(line)
                })
                .collect();
            // Those that come from above first; of them those whose tracks are further away last, of the others first.
            here.sort_by(|&l, &m| {
                let key = |l: usize| {
                    let line = &group.lines[l];
                    let far = (line.track - b.x).abs();
                    if line.b == n { (0, -far) } else { (1, far) }
                };
                let (k, j) = (key(l), key(m));
                k.0.cmp(&j.0).then(j.1.total_cmp(&k.1)).then(l.cmp(&m))
            });
            let step = b.height / (here.len() + 1) as f64;
            for (place, l) in here.into_iter().enumerate() {
                let y = b.y + step * (place + 1) as f64;
                if group.lines[l].a == n { ports[l].0 = y } else { ports[l].1 = y }
            }
        }
    }
    ports
}

/// Lines first, then what is written at them.
fn lines(text: &mut String, group: &Group<'_>, diagram: &Diagram) {
    let ports = ports(group);
    let mut written = String::new();
    for (line, (from_y, to_y)) in group.lines.iter().zip(ports) {
        let (a, b) = (&group.boxes[line.a], &group.boxes[line.b]);
        let colour = line.colour();
        let marker = if colour == SORTS { "sorts" } else { "plain" };
        let end = if line.down.is_empty() { String::new() } else { format!(" marker-end=\"url(#{marker})\"") };
        let start = if line.up.is_empty() { String::new() } else { format!(" marker-start=\"url(#{marker})\"") };
        let thick = if colour == SORTS { 2.0 } else { 1.0 };
        let tips: Vec<String> = line
            .cables()
            .map(|cable| {
                let (from, to) = (diagram.banks[cable.from].name, diagram.banks[cable.to].name);
                format!("{} from {from} to {to}: {}", times(cable.name, cable.count), shape(&cable.link))
            })
            .collect();
        text.push_str(&format!("<g><title>{}</title>\n", escaped(&tips.join("; "))));
        let style = format!("fill=\"none\" stroke=\"{colour}\" stroke-width=\"{thick}\"{start}{end}");
        // The stack behind a box sticks out above it and to the right.
        let sticks = |b: &Box| if diagram.banks[b.bank].count > 1 { 6.0 } else { 0.0 };
        if line.straight(&group.boxes) {
            let (top, bottom) = (a.y + a.height, b.y - sticks(b));
            text.push_str(&format!("<path d=\"M{0:.1} {top:.1}V{bottom:.1}\" {style}/>\n", a.middle()));
            let labels = line.labels("\u{2193}", "\u{2191}");
            let first = (top + bottom) / 2.0 - LINE * (labels.len() as f64 - 1.0) / 2.0 + 3.5;
            for (n, label) in labels.iter().enumerate() {
                let (x, y) = (a.middle() + 6.0, first + LINE * n as f64);
                written.push_str(&format!("<text x=\"{x:.1}\" y=\"{y:.1}\" fill=\"{colour}\" {HALO}>{label}</text>\n"));
            }
        } else {
            let side = |b: &Box| if line.track < b.x { b.x } else { b.x + BOX_WIDTH + sticks(b) };
            let (from_x, to_x, track) = (side(a), side(b), line.track);
            text.push_str(&format!("<path d=\"M{from_x:.1} {from_y:.1}H{track:.1}V{to_y:.1}H{to_x:.1}\" {style}/>\n"));
            // Writing goes up along the line, on its left.
            let middle = (from_y + to_y) / 2.0;
            for (n, label) in line.labels("\u{2190}", "\u{2192}").iter().enumerate() {
                let x = track - 4.0 - LINE * n as f64;
                written.push_str(&format!(
                    "<text transform=\"translate({x:.1} {middle:.1}) rotate(-90)\" text-anchor=\"middle\" fill=\"{colour}\" {HALO}>{label}</text>\n"
                ));
            }
        }
        text.push_str("</g>\n");
    }
    text.push_str(&written);
}
