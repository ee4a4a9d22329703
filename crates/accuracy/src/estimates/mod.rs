//! How far estimates are off on scenes that nobody has chosen.

mod generated;

use anyhow::{Context, Result};

use crate::classes::{Errors, errors};
use run::replay::Options;

pub use generated::{record, scene};

/// The errors of `bound` on the scenes of some seeds, in every sort class.
///
/// # Errors
/// If a machine stops; the message names the scene.
pub fn generated(seeds: impl Iterator<Item = u64>, options: &Options) -> Result<Vec<Errors>> {
    let one = |seed| {
        let name = format!("scene {seed}");
        errors(&name, &scene(seed), options).with_context(|| name.clone())
    };
    seeds.map(one).collect()
}

/// Of the sizes of some errors: the median, what nine of ten do not exceed, and the largest.
pub fn spread(mut errors: Vec<f64>) -> Option<[f64; 3]> {
    errors.iter_mut().for_each(|error| *error = error.abs());
    errors.sort_by(f64::total_cmp);
    let last = errors.len().checked_sub(1)?;
    let at = |part: f64| errors[libm::ceil(part * last as f64) as usize];
    Some([at(0.5), at(0.9), errors[last]])
}

/// Median, ninth of ten and largest of all errors, by class, as a table in Markdown.
pub fn table(found: &[Errors]) -> String {
    let mut out = "| class | error in cycles: median | nine of ten within | largest | in DRAM bytes: median | nine of ten within | largest |\n|---|--:|--:|--:|--:|--:|--:|\n".to_owned();
    let Some(first) = found.first() else { return out };
    let classes = first.classes.len();
    let mut line = |name: &str, all: std::ops::Range<usize>| {
        out += &format!("| {name} |");
        for side in 0..2 {
            let errors = found.iter().flat_map(|scene| &scene.classes[all.clone()]).filter_map(|(_, errors)| errors[side]);
            for size in spread(errors.collect()).map_or([None; 3], |sizes| sizes.map(Some)) {
                out += &size.map_or(" - |".into(), |size| format!(" {:.1} % |", 100.0 * size));
            }
        }
        out.push('\n');
    };
    for (at, (name, _)) in first.classes.iter().enumerate() {
        line(name, at..at + 1);
    }
    line("all", 0..classes);
    out
}
