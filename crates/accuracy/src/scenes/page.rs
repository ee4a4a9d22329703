//! Scenes as lines of text, as a page, and as pictures.

use std::fmt::Write;
use std::path::Path;

use anyhow::{Result, anyhow};

use super::{SCENES, SceneResult};
use crate::Row;
use host;
use run::picture;

fn number(value: f64) -> String {
    if value.fract() == 0.0 && value.abs() < 1e12 { format!("{}", value + 0.0) } else { format!("{value:.4}") }
}

/// What a row asks for: more than a number without an error is a number that bounds from below.
fn asked(row: &Row) -> String {
    let least = row.error == 0.0 && row.measured > row.expected;
    format!("{}{}", if least { "at least " } else { "" }, number(row.expected))
}

fn verdict(row: &Row) -> &'static str {
    if row.holds() { "pass" } else { "FAIL" }
}

/// The rows, prices and answers of a scene as lines.
pub fn text(outcome: &SceneResult) -> String {
    let mut text = format!("{}\n", outcome.scene.name);
    for row in &outcome.played.rows {
        let (expected, [measured, allowed]) = (asked(row), [row.measured, row.allowed].map(number));
        let _ = writeln!(text, "  {}  {}: {measured} (expected {expected}, may be off by {allowed})", verdict(row), row.case);
    }
    let prices = outcome.played.prices.iter().map(|price| match price.disordered {
        0 => format!("{} {}", price.class.name(), price.cycles),
        passes => format!("{} {} ({passes} passes need an order that it does not keep)", price.class.name(), price.cycles),
    });
    let prices: Vec<_> = prices.collect();
    if !prices.is_empty() {
        let _ = writeln!(text, "  cycles: {}", prices.join(", "));
    }
    for answer in &outcome.played.answers {
        let _ = writeln!(text, "  {} {}", answer.question, answer.answer);
    }
    text
}

/// Writes the picture of each scene into a folder: `NAME.png`.
///
/// # Errors
/// If a picture cannot be made or written.
pub fn pictures(outcomes: &[SceneResult], folder: &Path) -> Result<()> {
    std::fs::create_dir_all(folder)?;
    for outcome in outcomes {
        let Some(image) = &outcome.played.picture else { continue };
        let shown =
            picture::colors(&image.surface, &image.bytes).map_err(|reason| anyhow!("{}: {reason}", outcome.scene.name))?;
        let png = picture::png(&shown)?;
        host::write_file(&folder.join(format!("{}.png", outcome.scene.name)), &png)?;
    }
    Ok(())
}

/// The content of a table's cell.
fn cell(text: &str) -> String {
    text.replace('|', "\\|")
}

/// The page of all scenes: pictures lie beside it in `folder`.
pub fn markdown(outcomes: &[SceneResult], folder: &str) -> String {
    let failed = outcomes.iter().filter(|outcome| !outcome.holds()).count();
    let mut text = format!(
        "# Techniques\n\nScenes of a graphics course. The picture of each scene is proven with arithmetic that is not the renderer's. \
         `fillrate accuracy scenes --page docs/data` writes this page: {} of {} scenes hold. `--inject-fault` spoils each scene by its fault, \
         and its proof must then fail. The last table of a scene has the cycles of the baseline with each sort class, all frames together. `*` \
         marks a class that names passes whose order it does not keep.\n",
        outcomes.len() - failed,
        SCENES.len(),
    );
    let mut group = "";
    for outcome in outcomes {
        let (scene, played) = (outcome.scene, &outcome.played);
        if std::mem::replace(&mut group, scene.group) != scene.group {
            let _ = write!(text, "\n## {group}\n");
        }
        let _ = write!(text, "\n### {}\n\n![{}]({folder}/{}.png)\n\n", scene.name, scene.name, scene.name);
        let _ = write!(
            text,
            "| about | |\n|---|---|\n| scene | {} |\n| fault | {} |\n| recording | {} bytes |\n",
            cell(scene.what),
            cell(scene.fault),
            played.bytes
        );
        for answer in &played.answers {
            let _ = writeln!(text, "| {} | {} |", cell(&answer.question), cell(&answer.answer));
        }
        text.push_str("\n| proof | expected | measured | may be off by | |\n|---|--:|--:|--:|---|\n");
        for row in played.rows.iter().filter(|row| !row.case.contains("not the renderer's")) {
            let (expected, [measured, allowed]) = (asked(row), [row.measured, row.allowed].map(number));
            let _ = writeln!(text, "| {} | {expected} | {measured} | {allowed} | {} |", row.case, verdict(row));
        }
        let classes: Vec<_> = played.prices.iter().map(|price| price.class.name()).collect();
        let star = |disordered: u64| if disordered > 0 { "\\*" } else { "" };
        let cycles: Vec<_> = played.prices.iter().map(|price| format!("{}{}", price.cycles, star(price.disordered))).collect();
        let _ = write!(text, "\n| {} |\n|{}\n| {} |\n", classes.join(" | "), "--:|".repeat(classes.len()), cycles.join(" | "));
    }
    text
}
