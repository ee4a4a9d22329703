//! What a target is, and what one measures.

use std::sync::Mutex;

use anyhow::Result;
use rayon::prelude::*;

use num::Random;

/// What a target is about.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Section {
    /// Identities that hold on every trace.
    Exact,
    /// Rasterisation and numbers.
    Raster,
    /// Geometry, sorting, tiling.
    Sorting,
    /// Depth.
    Depth,
    /// Texture and memory.
    Memory,
    /// Fixed functions of OpenGL.
    Gl,
}

impl Section {
    /// All of them, in order.
    pub const ALL: [Section; 6] =
        [Section::Exact, Section::Raster, Section::Sorting, Section::Depth, Section::Memory, Section::Gl];

    /// Its letter and title.
    pub fn title(self) -> &'static str {
        match self {
            Section::Exact => "A. Exact, on every trace",
            Section::Raster => "B. Rasterisation and numbers",
            Section::Sorting => "C. Geometry, sorting, tiling",
            Section::Depth => "D. Depth",
            Section::Memory => "E. Texture and memory",
            Section::Gl => "F. Fixed functions of OpenGL",
        }
    }
}

/// How much a check does.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Size {
    /// What the test suite can afford.
    Small,
    /// As much as a target asks for, or more.
    Standard,
    /// Far more: minutes.
    Large,
}

/// What a check is run with.
#[derive(Clone, Copy, Debug)]
pub struct Setting {
    /// Where random numbers begin.
    pub seed: u64,
    /// How much is done.
    pub size: Size,
    /// What is under test is spoiled, as the target's `fault` says: the check must fail.
    pub inject_fault: bool,
}

impl Setting {
    /// One of three by size.
    pub fn pick<T>(&self, small: T, standard: T, large: T) -> T {
        match self.size {
            Size::Small => small,
            Size::Standard => standard,
            Size::Large => large,
        }
    }

    /// Runs `n` independent pieces of work on all threads, each with random numbers of its own. Returns their results in order.
    pub fn pieces<T: Send>(&self, n: u64, run: impl Fn(u64, &mut Random) -> T + Sync) -> Vec<T> {
        let done: Vec<Mutex<Option<T>>> = (0..n).map(|_| Mutex::new(None)).collect();
        in_parallel(n, &|piece| {
            let result = run(piece, &mut Random::nth(self.seed, piece));
            *done[piece as usize].lock().expect("no piece panicked") = Some(result);
        });
        done.into_iter().map(|result| result.into_inner().expect("no piece panicked").expect("every piece ran")).collect()
    }
}

/// One thing measured.
#[derive(Clone, Debug, PartialEq)]
pub struct Row {
    /// What was measured.
    pub case: String,
    /// What it must be.
    pub expected: f64,
    /// What it is.
    pub measured: f64,
    /// How far off that is, in the unit in which `allowed` is.
    pub error: f64,
    /// How far off it may be.
    pub allowed: f64,
}

impl Row {
    /// A number whose error may be `allowed`.
    pub fn within(case: impl Into<String>, expected: f64, measured: f64, allowed: f64) -> Row {
        Row { case: case.into(), expected, measured, error: (measured - expected).abs(), allowed }
    }

    /// A number that must be exactly that.
    pub fn exact(case: impl Into<String>, expected: f64, measured: f64) -> Row {
        Row::within(case, expected, measured, 0.0)
    }

    /// A count of things that must not be.
    pub fn none(case: impl Into<String>, found: u64) -> Row {
        Row::exact(case, 0.0, found as f64)
    }

    /// The worst error that was seen, which may be at most so large.
    pub fn at_most(case: impl Into<String>, worst: f64, allowed: f64) -> Row {
        Row::within(case, 0.0, worst, allowed)
    }

    /// A number that must be at least that.
    pub fn at_least(case: impl Into<String>, expected: f64, measured: f64) -> Row {
        let short = expected - measured;
        Row { case: case.into(), expected, measured, error: if short < 0.0 { 0.0 } else { short }, allowed: 0.0 }
    }

    /// Whether it is as it must be; what is no number is not.
    pub fn holds(&self) -> bool {
        self.error <= self.allowed
    }
}

/// A yardstick.
#[derive(Debug)]
pub struct Target {
    /// Its name.
    pub id: &'static str,
    /// What it is about.
    pub section: Section,
    /// What must hold.
    pub what: &'static str,
    /// How far off that may be.
    pub bound: &'static str,
    /// What is spoiled to see the check fail.
    pub fault: &'static str,
    /// Measures it.
    pub check: fn(&Setting) -> Result<Vec<Row>>,
}

/// A target that was run.
#[derive(Clone, Debug)]
pub struct TargetResult {
    /// Which one.
    pub target: &'static Target,
    /// With what.
    pub setting: Setting,
    /// What was measured.
    pub rows: Vec<Row>,
}

impl TargetResult {
    /// Whether everything is as it must be; nothing measured is nothing shown.
    pub fn holds(&self) -> bool {
        !self.rows.is_empty() && self.rows.iter().all(Row::holds)
    }
}

impl Target {
    /// Runs its check.
    ///
    /// # Errors
    /// If what it runs does not run.
    pub fn run(&'static self, setting: &Setting) -> Result<TargetResult> {
        let rows = (self.check)(setting)?;
        Ok(TargetResult { target: self, setting: *setting, rows })
    }
}

/// Runs all pieces on all threads. No type parameter: what joins threads is compiled once, not for each target.
fn in_parallel(pieces: u64, work: &(dyn Fn(u64) + Sync)) {
    (0..pieces).into_par_iter().for_each(work);
}
