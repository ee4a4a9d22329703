//! `fillrate compare`

use std::io::{BufReader, Cursor};
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail};
use image::{ImageFormat, ImageReader};
use serde_json::Value;

use super::Verdict;
use crate::host;
use crate::host::Links;
use crate::report::compare::{self, TOLERANCE};

/// Bytes of a statistics file at most: hours of frames.
const TEXT_MAX: u64 = 1 << 30;

/// Compare two images (difference image, PSNR, pixels off by more than 2), or two statistics files.
#[derive(clap::Args)]
#[command(after_help = "Examples:\n  fillrate compare out/frame-0000.png ref.png --difference difference.png\n  \
fillrate compare before/stats.json after/stats.json --only total.cycles\n\n\
Exit code 1 where images have more pixels off than --allow, or statistics differ.")]
pub struct Arguments {
    /// First image (PNG) or statistics file (JSON)
    a: PathBuf,
    /// Second one, of the same kind
    b: PathBuf,
    /// Where to write the difference image
    #[arg(long, value_name = "PNG")]
    difference: Option<PathBuf>,
    /// Percentage of pixels that may be off
    #[arg(long, value_name = "PERCENT", default_value_t = 0.0)]
    allow: f64,
    /// Statistics: only those whose path starts with this
    #[arg(long, value_name = "PATH")]
    only: Option<String>,
}

pub fn run(arguments: &Arguments) -> Result<Verdict> {
    let is_json = |path: &Path| path.extension().is_some_and(|e| e == "json");
    match (is_json(&arguments.a), is_json(&arguments.b)) {
        (true, true) => statistics(arguments),
        (false, false) => images(arguments),
        _ => bail!("{} and {} are not of one kind", arguments.a.display(), arguments.b.display()),
    }
}

fn images(arguments: &Arguments) -> Result<Verdict> {
    let open = |path: &Path| {
        let fail = || format!("cannot read {}", path.display());
        let file = BufReader::new(host::open(path, Links::Follow).with_context(fail)?);
        anyhow::Ok(ImageReader::with_format(file, ImageFormat::Png).decode().with_context(fail)?.into_rgba8())
    };
    let (a, b) = (open(&arguments.a)?, open(&arguments.b)?);
    let d = compare::images(&a, &b).map_err(anyhow::Error::msg)?;
    println!(
        "{} pixels, {} different, {} off by more than {TOLERANCE} ({:.4} %), largest difference {}, PSNR {:.2} dB",
        d.pixels,
        d.different,
        d.off,
        100.0 * d.off_share(),
        d.largest,
        d.psnr
    );
    if let Some(path) = &arguments.difference {
        let fail = || format!("cannot write {}", path.display());
        let mut png = Vec::new();
        d.picture.write_to(&mut Cursor::new(&mut png), ImageFormat::Png).with_context(fail)?;
        host::write_file(path, &png).with_context(fail)?;
    }
    Ok(if 100.0 * d.off_share() > arguments.allow { Verdict::Failed } else { Verdict::Done })
}

fn statistics(arguments: &Arguments) -> Result<Verdict> {
    let open = |path: &Path| -> Result<Value> {
        let text = host::read_text(path, TEXT_MAX).with_context(|| format!("cannot read {}", path.display()))?;
        serde_json::from_str(&text).with_context(|| format!("{} is not a statistics file", path.display()))
    };
    let (a, b) = (open(&arguments.a)?, open(&arguments.b)?);
    let mut found = compare::statistics(&a, &b);
    if let Some(only) = &arguments.only {
        found.retain(|d| d.path.starts_with(only.as_str()));
    }
    let show = |value: &Option<Value>| value.as_ref().map_or_else(|| "-".to_owned(), Value::to_string);
    for d in &found {
        let relative = d.relative().map(|r| format!("  {:+.3} %", 100.0 * r)).unwrap_or_default();
        println!("{}  {} -> {}{relative}", d.path, show(&d.a), show(&d.b));
    }
    println!("{} statistics differ", found.len());
    Ok(if found.is_empty() { Verdict::Done } else { Verdict::Failed })
}
