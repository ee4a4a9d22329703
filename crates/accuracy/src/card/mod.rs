//! Real cards: microbenchmarks whose answers are published, measured on the model of each card as they are measured on silicon.
//!
//! A [`Benchmark`] is a constant in the file of its family: it names a configuration, the published answer with its source and the deviation
//! that its [`Class`] allows, and a function that records a trace, replays it and reads the answer. Where the answer follows from knobs, a formula says
//! how: measurement and formula must agree to [`FORMULA_ALLOWED`] on any configuration, so that a wrong knob cannot hide behind a right formula.
//! A benchmark that the model does not reproduce names the missing mechanism ([`Because`]); it fails when it no longer needs this excuse, and when
//! its deviation grows. With its fault a benchmark measures a card that has a wrong knob, and must fail.

mod arithmetic;
mod bench;
mod geometry;
mod latency;
mod memory;
mod page;
mod recipes;
mod rop;
mod texture;

use anyhow::{Context, Result, anyhow};

use super::harness::on_threads;
use super::hint;
use machine::Config;
use trace::Trace;

use bench::Bench;
pub use page::{header, json, line, markdown, median, text};

/// The largest relative difference between a measurement and its formula.
pub const FORMULA_ALLOWED: f64 = 0.01;

/// How much farther off an excused benchmark may be than its excuse says.
const GROWTH_ALLOWED: f64 = 0.01;

/// What a benchmark measures.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Family {
    /// Cycles from one instruction or access to the next that depends on it.
    Latency,
    /// Rates of instructions, and how warps and independent instructions hide latency.
    Arithmetic,
    /// Bytes that loads and stores move.
    Memory,
    /// Texels by format and filter.
    Texture,
    /// Pixels by format, blending, samples and compression.
    Rop,
    /// Vertices, triangles and draws.
    Geometry,
}

impl Family {
    /// The name on the page.
    pub fn name(self) -> &'static str {
        match self {
            Family::Latency => "latency",
            Family::Arithmetic => "arithmetic",
            Family::Memory => "memory",
            Family::Texture => "texture",
            Family::Rop => "rop",
            Family::Geometry => "geometry",
        }
    }
}

/// The deviation that is allowed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Class {
    /// None: a count.
    Exact,
    /// 2 %: a data sheet.
    A,
    /// 10 %: measured silicon.
    B,
    /// 20 %: sources that differ.
    C,
    /// The shape of a curve: each point, as a share of the curve's largest, is within 0.1 of the published one.
    Shape,
}

impl Class {
    /// The letter on the page.
    pub fn letter(self) -> &'static str {
        match self {
            Class::Exact => "exact",
            Class::A => "A",
            Class::B => "B",
            Class::C => "C",
            Class::Shape => "S",
        }
    }

    /// The largest deviation.
    pub fn allowed(self) -> f64 {
        match self {
            Class::Exact => 0.0,
            Class::A => 0.02,
            Class::B | Class::Shape => 0.10,
            Class::C => 0.20,
        }
    }

    /// The deviation of a measurement: that of the point that is farthest off, with its sign; infinite where nothing can be compared.
    fn deviation(self, published: &[f64], measured: &[f64]) -> f64 {
        if published.len() != measured.len() || published.is_empty() {
            return f64::INFINITY;
        }
        let largest = |values: &[f64]| values.iter().copied().fold(f64::MIN, f64::max);
        let [scale, own] = [largest(published), largest(measured)];
        let of = |(&published, &measured): (&f64, &f64)| match self {
            Class::Shape => measured / own - published / scale,
            _ => (measured - published) / published,
        };
        let worst = published
            .iter()
            .zip(measured)
            .map(of)
            .fold(0.0, |worst: f64, off| if off.abs() > worst.abs() || off.is_nan() { off } else { worst });
        if worst.is_nan() { f64::INFINITY } else { worst }
    }
}

/// Where a published number comes from.
#[derive(Clone, Copy, Debug)]
pub struct Citation {
    /// The publication, and what it says.
    pub text: &'static str,
    /// Whether the number was seen in it; if not, it is quoted from memory.
    pub seen: bool,
}

/// A number that was seen in its source.
const fn seen(text: &'static str) -> Citation {
    Citation { text, seen: true }
}

/// A number whose source was not at hand to check it.
const fn unconfirmed(text: &'static str) -> Citation {
    Citation { text, seen: false }
}

/// Why a benchmark is not met.
#[derive(Clone, Copy, Debug)]
pub struct Because {
    /// The mechanism that the model lacks, or the choice that the configuration had to make.
    pub what: &'static str,
    /// The deviation that it explains, as a share, with its sign.
    pub off: f64,
}

/// A microbenchmark with a published answer.
#[derive(Clone, Copy, Debug)]
pub struct Benchmark {
    /// Its name, which is its own among the benchmarks of its card.
    pub name: &'static str,
    /// What it measures.
    pub family: Family,
    /// The configuration of the card.
    pub card: &'static str,
    /// The workload in a few words.
    pub what: &'static str,
    /// The unit of its numbers.
    pub unit: &'static str,
    /// The published answer: a number, or the points of a curve.
    pub published: &'static [f64],
    /// The deviation allowed.
    pub class: Class,
    /// Where the answer is published.
    pub source: Citation,
    /// The answer by the knobs of a configuration, where it follows from them.
    formula: Option<fn(&Config) -> Vec<f64>>,
    /// Assignments that make the card a wrong one.
    pub fault: &'static [&'static str],
    /// Why it is not met; none: it is.
    pub because: Option<Because>,
    /// Whether it is one of the cheap ones that the test suite runs.
    pub quick: bool,
    /// Measures it.
    measure: fn(&Bench) -> Result<Vec<f64>>,
}

impl Benchmark {
    /// A benchmark of the GeForce GTX 980 that measures nothing yet: what those of a family have in common.
    const fn of(family: Family, class: Class) -> Benchmark {
        Benchmark {
            name: "",
            family,
            card: "gtx-980",
            what: "",
            unit: "",
            published: &[],
            class,
            source: seen(""),
            formula: None,
            fault: &[],
            because: None,
            quick: false,
            measure: |_| Ok(Vec::new()),
        }
    }
}

/// What was found of a benchmark.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Verdict {
    /// The deviation is within the class.
    Met,
    /// It is not, and the benchmark says why.
    Excused,
    /// It is not, and the benchmark does not say why.
    Off,
    /// It is within the class, although the benchmark says why it is not.
    NeedlessExcuse,
    /// It is larger than the excuse says, or to the other side.
    WorseThanExcused,
    /// The measurement is not what the formula says.
    NotTheFormula,
}

impl Verdict {
    /// Whether the benchmark holds.
    pub fn holds(self) -> bool {
        matches!(self, Verdict::Met | Verdict::Excused)
    }

    /// The verdict in words.
    pub fn text(self) -> &'static str {
        match self {
            Verdict::Met => "pass",
            Verdict::Excused => "excused",
            Verdict::Off => "FAIL: off",
            Verdict::NeedlessExcuse => "FAIL: met, its excuse is needless",
            Verdict::WorseThanExcused => "FAIL: not off as its excuse says",
            Verdict::NotTheFormula => "FAIL: not what its formula says",
        }
    }
}

/// A benchmark that was run.
#[derive(Clone, Debug)]
pub struct BenchmarkResult {
    /// Which one.
    pub benchmark: &'static Benchmark,
    /// The answer of the model.
    pub measured: Vec<f64>,
    /// The deviation of the point that is farthest off, as a share.
    pub deviation: f64,
    /// The relative difference to the formula, where there is one.
    pub from_formula: Option<f64>,
}

impl BenchmarkResult {
    /// The verdict.
    pub fn verdict(&self) -> Verdict {
        let off = self.deviation.abs();
        let met = off <= self.benchmark.class.allowed();
        match self.benchmark.because {
            // What is missing may be what the formula has.
            None if self.from_formula.is_some_and(|off| off.abs() > FORMULA_ALLOWED) => Verdict::NotTheFormula,
            None if met => Verdict::Met,
            None => Verdict::Off,
            Some(_) if met => Verdict::NeedlessExcuse,
            Some(because) if off > because.off.abs() + GROWTH_ALLOWED || self.deviation * because.off < 0.0 => {
                Verdict::WorseThanExcused
            }
            Some(_) => Verdict::Excused,
        }
    }

    /// Whether it is as its benchmark says.
    pub fn holds(&self) -> bool {
        self.verdict().holds()
    }
}

/// The cards in the order of the page: configuration and name.
pub const CARDS: &[(&str, &str)] = &[
    ("gtx-980", "GeForce GTX 980 (GM204, 2014)"),
    ("gtx-titan", "GeForce GTX Titan (GK110, 2013)"),
    ("rx-5700-xt", "Radeon RX 5700 XT (Navi 10, 2019)"),
    ("mali-g57-mc2", "Mali-G57 MC2 (Helio G96, 2021)"),
    ("radeon-x700-xt", "Radeon X700 XT (RV410, 2004)"),
    ("geforce2-ultra", "GeForce2 Ultra (NV15, 2000)"),
];

/// All benchmarks, by card and family.
pub fn benchmarks() -> impl Iterator<Item = &'static Benchmark> {
    const FAMILIES: [&[Benchmark]; 6] = [
        latency::BENCHMARKS,
        arithmetic::BENCHMARKS,
        memory::BENCHMARKS,
        texture::BENCHMARKS,
        rop::BENCHMARKS,
        geometry::BENCHMARKS,
    ];
    let of = |card: &'static str| FAMILIES.into_iter().flatten().filter(move |benchmark| benchmark.card == card);
    CARDS.iter().flat_map(move |&(card, _)| of(card))
}

/// The benchmarks of that name, on whichever cards; or all of a card.
///
/// # Errors
/// If there is none: the message names one that is near.
pub fn find(name: &str) -> Result<Vec<&'static Benchmark>> {
    let found: Vec<_> = benchmarks().filter(|benchmark| [benchmark.name, benchmark.card].contains(&name)).collect();
    if found.is_empty() {
        let names = benchmarks().flat_map(|benchmark| [benchmark.name, benchmark.card]);
        return Err(anyhow!("there is no benchmark {name}{}", hint(names, name)));
    }
    Ok(found)
}

impl Benchmark {
    /// Its card with changes.
    fn config(&self, changes: &[&str]) -> Result<Config> {
        let mut config = Config::built_in(self.card)?;
        for change in changes {
            config.set(change)?;
        }
        config.check()?;
        Ok(config)
    }

    /// Measures it on its card with changes.
    ///
    /// # Errors
    /// If the card does not take a change, a trace cannot be replayed, or nothing can be read from it.
    pub fn run(&'static self, changes: &[&str]) -> Result<BenchmarkResult> {
        let of = || format!("{} on {}", self.name, self.card);
        let bench = Bench::new(self.config(changes).with_context(of)?);
        let measured = (self.measure)(&bench).with_context(of)?;
        let deviation = self.class.deviation(self.published, &measured);
        let from_formula = self.formula.map(|formula| Class::Exact.deviation(&formula(bench.config()), &measured));
        Ok(BenchmarkResult { benchmark: self, measured, deviation, from_formula })
    }
}

/// Measures benchmarks on all threads; with their faults, or with changes of their cards.
///
/// # Errors
/// As [`Benchmark::run`].
pub fn run(benchmarks: &[&'static Benchmark], changes: &[&str], inject_fault: bool) -> Result<Vec<BenchmarkResult>> {
    on_threads(benchmarks.len(), "benchmark", &|at| {
        let benchmark = benchmarks[at];
        let fault = if inject_fault { benchmark.fault } else { &[] };
        benchmark.run(&[fault, changes].concat())
    })
}

/// A number as a function of the configuration.
fn count(knob: u32) -> f64 {
    f64::from(knob)
}

/// Cores of a card.
fn cores(config: &Config) -> f64 {
    count(config.card.pipelines) * count(config.core.per_pipeline)
}

/// A trace by a length.
type ByLength<'a> = &'a dyn Fn(u32) -> Trace;
