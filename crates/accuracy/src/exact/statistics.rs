//! What the interfaces' pipeline statistics say of a draw, asked of the renderer and of machines of every sort class.

use anyhow::Result;

use super::machines::machines;
use crate::draws::{DEPTH, Sheet, Stroke};
use crate::harness::{config, funnel, items};
use crate::{Row, Section, Setting, Target};
use gfx::state::{Compare, DepthStencil, Topology};
use machine::Config;
use machine::class::Sorted;
use machine::config::SortClass;
use num::Random;
use run::replay::{Fidelity, Options, replay};
use sim::UNITS;
use stats::{Counter, Tree, counter};
use trace::Trace;
use trace::record;
use work::Funnel;

pub(super) const STATISTICS: Target = Target {
    id: "statistics",
    section: Section::Exact,
    what: "Rules of pipeline statistics, of the renderer and of machines of every sort class. Direct3D 11: a list of 4 triangles is 12 \
           vertices and 4 primitives, a strip of 4 is 6 vertices, 4 primitives and 6 to 12 runs of the vertex stage (where geometry is \
           not dealt to pipelines); each triangle meets the clipper once, and what is outside goes no further; fragments shaded lie \
           between those that pass the depth test and all, and are all where the shader writes depth. Vulkan's conformance tests: 16 \
           vertices make 16 points, 8 lines of a list, 15 of a strip, 5 triangles of a list, 14 of a strip or a fan (the tests ask for 8); \
           a covered target of 64 x 64 shades 4,096 fragments",
    bound: "exact",
    fault: "each draw lacks its last vertex",
    check,
};

/// Positions and nothing else.
const PLAIN: &str = "
    @vertex fn vs(@location(0) p: vec4f) -> @builtin(position) vec4f { return p; }
    @fragment fn fs() -> @location(0) vec4f { return vec4f(1.0); }";

/// The depth is the shader's, that of the vertices.
const OWN_DEPTH: &str = "
    struct Out { @location(0) color: vec4f, @builtin(frag_depth) depth: f32 }
    @vertex fn vs(@location(0) p: vec4f) -> @builtin(position) vec4f { return p; }
    @fragment fn fs(@builtin(position) p: vec4f) -> Out { return Out(vec4f(1.0), p.z); }";

/// Edge of the target.
const EDGE: f32 = 64.0;

/// A vertex at a pixel's corner.
fn at(x: f32, y: f32, z: f32) -> [f32; 8] {
    [x / EDGE * 2.0 - 1.0, 1.0 - y / EDGE * 2.0, z, 1.0, 0.0, 0.0, 0.0, 0.0]
}

/// Two triangles that cover a rectangle.
fn rectangle([x0, y0, x1, y1]: [f32; 4], z: f32) -> Vec<[f32; 8]> {
    [[x0, y0], [x1, y0], [x0, y1], [x0, y1], [x1, y0], [x1, y1]].map(|[x, y]| at(x, y, z)).to_vec()
}

/// A strip of `vertices` vertices in zigzag over the target, off the pixels' centres.
fn zigzag(vertices: u32, random: &mut Random) -> Vec<[f32; 8]> {
    let step = (EDGE - 8.0) / vertices as f32;
    (0..vertices).map(|k| at(4.1 + k as f32 * step, if k % 2 == 0 { 4.3 } else { 40.0 + 8.0 * random.unit() }, 0.5)).collect()
}

/// The machines to which a rule applies.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Of {
    /// Of all, and of the renderer.
    All,
    /// Of those with one frame buffer. Where pipelines have their own, each tests against what it has drawn itself.
    OneFrameBuffer,
    /// Of those with one geometry. Where primitives are dealt to pipelines, each has vertices and triangles of its own.
    OneGeometry,
}

impl Of {
    fn holds(self, sort: SortClass) -> bool {
        match self {
            Of::All => true,
            Of::OneFrameBuffer => sort.class().sorted != Sorted::Images,
            Of::OneGeometry => !sort.class().sorted.own_geometry(),
        }
    }
}

/// What is looked at.
#[derive(Clone, Copy)]
enum Figure {
    /// A counter of the funnel.
    Funnel(Counter<Funnel>),
    /// What went through all units of a kind, which the renderer has not.
    Items(&'static str),
}

impl Figure {
    fn name(self) -> &'static str {
        match self {
            Figure::Funnel(counter) => counter.name(),
            Figure::Items(units) => units,
        }
    }

    /// Its value; none where there are no units to ask.
    fn of(self, tree: &Tree) -> Result<Option<f64>> {
        Ok(match self {
            Figure::Funnel(counter) => Some(counter.of(&funnel(tree)?) as f64),
            Figure::Items(_) if UNITS.find(tree).is_empty() => None,
            Figure::Items(units) => Some(items(tree, units)?),
        })
    }
}

impl From<Counter<Funnel>> for Figure {
    fn from(counter: Counter<Funnel>) -> Figure {
        Figure::Funnel(counter)
    }
}

/// What is looked at, and how.
struct Rule {
    /// A figure of the statistics.
    figure: Figure,
    /// It lies between these.
    least: u64,
    most: u64,
    of: Of,
}

fn exactly(figure: impl Into<Figure>, count: u64) -> Rule {
    between(figure, count, count)
}

fn between(figure: impl Into<Figure>, least: u64, most: u64) -> Rule {
    Rule { figure: figure.into(), least, most, of: Of::All }
}

/// A picture and what its statistics must be.
struct Case {
    name: String,
    trace: Trace,
    rules: Vec<Rule>,
}

impl Case {
    fn new(setting: &Setting, name: impl Into<String>, strokes: Vec<Stroke>, rules: Vec<Rule>) -> Case {
        let mut sheet = Sheet::new([EDGE as u32; 2], 1);
        for mut stroke in strokes {
            if setting.inject_fault {
                stroke.vertices -= 1;
                stroke.indices = stroke.indices.map(|mut indices| {
                    indices.pop();
                    indices
                });
            }
            sheet.draw(stroke);
        }
        Case { name: name.into(), trace: sheet.finish(), rules }
    }
}

/// A draw of these vertices.
fn stroke(topology: Topology, attributes: Vec<[f32; 8]>) -> Stroke {
    Stroke { topology, vertices: attributes.len() as u32, attributes, ..Stroke::new(PLAIN, 0) }
}

/// A list, a strip, and triangles outside, with indices and without.
fn assembled(setting: &Setting, random: &mut Random) -> Vec<Case> {
    let triangle = |random: &mut Random| {
        let (x, y) = (1.0 + 40.0 * random.unit(), 1.0 + 40.0 * random.unit());
        [[x, y], [x + 20.0, y], [x, y + 20.0]].map(|[x, y]| at(x, y, 0.5))
    };
    let list: Vec<_> = (0..4).flat_map(|_| triangle(random)).collect();
    let mut outside = list.clone();
    outside[3..9].iter_mut().for_each(|vertex| vertex[0] += 2.5);
    let mut indexed = stroke(Topology::TriangleList, zigzag(6, random));
    indexed.indices = Some(vec![0, 1, 2, 2, 1, 3, 2, 3, 4, 4, 3, 5]);
    let once = |rule| Rule { of: Of::OneGeometry, ..rule };
    let of_four = |vertices, [least, most]: [u64; 2]| {
        vec![
            exactly(counter!(Funnel, vertices_in), vertices),
            exactly(counter!(Funnel, primitives_in), 4),
            once(between(counter!(Funnel, vertices_shaded), least, most)),
            once(exactly(Figure::Items("clip"), 4)),
        ]
    };
    let mut of_outside = of_four(12, [12, 12]);
    of_outside.extend([exactly(counter!(Funnel, culled_frustum), 2), once(exactly(counter!(Funnel, triangles_setup), 2))]);
    vec![
        Case::new(setting, "list of 4 triangles", vec![stroke(Topology::TriangleList, list)], of_four(12, [12, 12])),
        Case::new(setting, "list of 4, two outside", vec![stroke(Topology::TriangleList, outside)], of_outside),
        Case::new(
            setting,
            "strip of 4 triangles",
            vec![stroke(Topology::TriangleStrip, zigzag(6, random))],
            of_four(6, [6, 12]),
        ),
        Case::new(setting, "list of 4 with indices", vec![indexed], of_four(12, [6, 12])),
    ]
}

/// What 16 vertices make.
fn topologies(setting: &Setting, random: &mut Random) -> Vec<Case> {
    [
        (Topology::PointList, 16),
        (Topology::LineList, 8),
        (Topology::LineStrip, 15),
        (Topology::TriangleList, 5),
        (Topology::TriangleStrip, 14),
        (Topology::TriangleFan, 14),
    ]
    .into_iter()
    .map(|(topology, primitives)| {
        let strokes = vec![stroke(topology, zigzag(16, random))];
        let rules = vec![exactly(counter!(Funnel, primitives_in), primitives)];
        Case::new(setting, format!("16 vertices, {topology:?}"), strokes, rules)
    })
    .collect()
}

/// A target that is covered; and a near rectangle with a far one behind it, which tests pass and fail.
fn fragments(setting: &Setting, random: &mut Random) -> Vec<Case> {
    let whole = vec![stroke(Topology::TriangleList, rectangle([0.0, 0.0, EDGE, EDGE], 0.5))];
    let covered = vec![exactly(counter!(Funnel, fragments_covered), 4096), exactly(counter!(Funnel, fragments_shaded), 4096)];
    let mut cases = vec![Case::new(setting, "a covered target", whole, covered)];
    for (name, source) in [("depths of the triangle", PLAIN), ("depths of the shader", OWN_DEPTH)] {
        let [near, far] = [1 + random.below(63), 1 + random.below(63)];
        let (near, far) = (near.max(far), near.min(far));
        let drawn = [([0.0, 0.0, near as f32, EDGE], 0.25), ([far as f32, 0.0, EDGE, EDGE], 0.75)];
        let less = DepthStencil { depth_compare: Compare::Less, ..record::depth_less(DEPTH) };
        let strokes = drawn
            .into_iter()
            .map(|(area, z)| {
                let rectangle = stroke(Topology::TriangleList, rectangle(area, z));
                Stroke { source: source.to_owned(), depth: Some(less), ..rectangle }
            })
            .collect();
        let (passing, failing) = (4096, 64 * u64::from(near - far));
        let all = passing + failing;
        let least = if source == PLAIN { passing } else { all };
        let shaded = between(counter!(Funnel, fragments_shaded), least, all);
        let tested = |rule| Rule { of: Of::OneFrameBuffer, ..rule };
        let mut rules = vec![
            exactly(counter!(Funnel, fragments_covered), all),
            tested(exactly(counter!(Funnel, fragments_written), passing)),
            shaded,
        ];
        if source == OWN_DEPTH {
            rules.push(tested(exactly(counter!(Funnel, fragments_late_failed), failing)));
        }
        cases.push(Case::new(setting, name, strokes, rules));
    }
    cases
}

/// Statistics of the renderer alone and of each machine, and what it sorts.
fn statistics(trace: &Trace, machines: &[Config]) -> Result<Vec<(Tree, SortClass)>> {
    let run = |config: &Config, fidelity| -> Result<(Tree, SortClass)> {
        let options = Options::new(config.clone(), fidelity);
        Ok((replay(trace, &options, &|_| ())?.total, config.card.sort))
    };
    let alone = config("four-pipelines", &[])?;
    let alone = std::iter::once((&alone, Fidelity::Functional));
    alone
        .chain(machines.iter().map(|machine| (machine, Fidelity::Cycle)))
        .map(|(config, fidelity)| run(config, fidelity))
        .collect()
}

fn check(setting: &Setting) -> Result<Vec<Row>> {
    let rounds = setting.pick(1, 4, 40);
    let mut machines = machines()?;
    machines.push(config("four-pipelines", &["depth.early=false"])?);
    let mut rows: Vec<Row> = Vec::new();
    for round in 0..rounds {
        let mut random = Random::nth(setting.seed, round);
        let cases = [assembled(setting, &mut random), topologies(setting, &mut random), fragments(setting, &mut random)]
            .into_iter()
            .flatten();
        for case in cases {
            let measured = statistics(&case.trace, &machines)?;
            for rule in &case.rules {
                let (mut worst, mut error) = (rule.least as f64, 0.0);
                for (tree, _) in measured.iter().filter(|&&(_, sort)| rule.of.holds(sort)) {
                    let Some(count) = rule.figure.of(tree)? else { continue };
                    let off = (rule.least as f64 - count).max(count - rule.most as f64).max(0.0);
                    if off >= error {
                        (worst, error) = (count, off);
                    }
                }
                let name = rule.figure.name();
                let range = if rule.least == rule.most { String::new() } else { format!(" (at most {})", rule.most) };
                let row = Row {
                    case: format!("{}: {name}{range}", case.name),
                    expected: rule.least as f64,
                    measured: worst,
                    error,
                    allowed: 0.0,
                };
                // Rounds differ in places only: the worst of each is shown.
                match rows.iter_mut().find(|known| known.case == row.case) {
                    Some(known) if row.error > known.error => *known = row,
                    Some(_) => {}
                    None => rows.push(row),
                }
            }
        }
    }
    Ok(rows)
}
