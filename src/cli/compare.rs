//! `fillrate compare`

use std::path::{Path, PathBuf};

use anyhow::{Context, Result, anyhow, bail};
use image::DynamicImage;
use serde_json::{Map, Value, json};

use super::reading::Limiting;
use super::{Verdict, configs};
use crate::accuracy::references::{Manifest, Standing, TOLERANCE as TOLERANCE_OF_REFERENCES};
use crate::host;
use crate::host::{Links, one_line};
use crate::machine::config::BUILT_IN;
use crate::num::{Limits, nearest};
use crate::picture::{self, Difference, TOLERANCE};
use crate::report::compare::{self, Banks, Leaves, Size, StatisticDifference};
use crate::report::files::changed_json;
use crate::report::owned::check_replaceable;

/// Bytes of a statistics file at most: hours of frames.
const TEXT_MAX: u64 = 1 << 30;

/// Compare two outputs of replay, or two files of them: images (PSNR, pixels off by more than 2, and with --difference an
/// image of the differences), statistics (JSON or CSV), or configurations; or recorded programs with their reference images.
#[derive(clap::Args)]
#[command(after_help = "Examples:\n  fillrate compare before after --only total.\n  \
fillrate compare out/frame-0000.png ref.png --difference difference.png\n  \
fillrate compare before/stats.json after/stats.json --only total.units --each-bank\n  \
fillrate compare baseline out/config.ron\n\n\
Exit code 1 where images have more pixels off than --allow, or statistics, knobs or the lists of images differ.")]
pub struct Arguments {
    /// A folder that replay has written, an image (PNG), statistics (stats.json, stats.csv), or a configuration (RON, or a built-in name);
    /// or a manifest of recordings (RON)
    a: PathBuf,
    /// Another one of the same kind; the folder of a manifest's recordings
    b: PathBuf,
    /// Statistics and knobs: only those whose path starts with this
    #[arg(help_heading = "Statistics and knobs", long, value_name = "PATH")]
    only: Option<String>,
    /// Statistics: how many are shown; 0: all [default: 50]
    #[arg(help_heading = "Statistics and knobs", long, value_name = "N")]
    most: Option<usize>,
    /// Statistics: what makes a change large; the largest come first [default: relative]
    #[arg(help_heading = "Statistics and knobs", long, value_enum, value_name = "SIZE")]
    by: Option<By>,
    /// Statistics: show each bank of a unit by itself, not their sum
    #[arg(help_heading = "Statistics and knobs", long)]
    each_bank: bool,
    /// Images: percentage of pixels that may be off [default: 0]
    #[arg(help_heading = "Images", long, value_name = "PERCENT")]
    allow: Option<f64>,
    /// Images: where to write the difference image; of two folders: the folder for those of all images that differ
    #[arg(help_heading = "Images", long, value_name = "PNG|DIR")]
    difference: Option<PathBuf>,
    /// With --difference: replace files that fillrate has not written
    #[arg(help_heading = "Images", long, requires = "difference")]
    force: bool,
    /// Print one JSON document with all differences
    #[arg(help_heading = "Output", long, conflicts_with = "most")]
    json: bool,
    #[command(flatten, next_help_heading = "Reading files")]
    limiting: Limiting,
}

#[derive(Clone, Copy, clap::ValueEnum)]
enum By {
    /// The difference by the first value
    Relative,
    /// The difference itself
    Absolute,
}

/// As `println`, where no JSON document is asked for.
macro_rules! text {
    ($arguments:expr, $($text:tt)*) => { if !$arguments.json { println!($($text)*) } };
}

/// What can be compared.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Kind {
    Folder,
    Json,
    Csv,
    Configuration,
    Image,
    /// A manifest (RON) that is compared with a folder of recordings.
    Manifest,
}

impl Kind {
    /// By what lies at a path and by its name; a built-in configuration has no file.
    fn of(path: &Path) -> Kind {
        let is_built_in = || BUILT_IN.iter().any(|(name, _)| path.as_os_str() == *name);
        match path.extension().and_then(|extension| extension.to_str()) {
            _ if path.is_dir() => Kind::Folder,
            Some("json") => Kind::Json,
            Some("csv") => Kind::Csv,
            Some("ron") => Kind::Configuration,
            _ if !path.exists() && is_built_in() => Kind::Configuration,
            _ => Kind::Image,
        }
    }

    fn name(self) -> &'static str {
        match self {
            Kind::Folder => "a folder",
            Kind::Json => "a JSON file of statistics",
            Kind::Csv => "a CSV file of statistics",
            Kind::Configuration => "a configuration",
            Kind::Image => "an image",
            Kind::Manifest => "a manifest of recordings",
        }
    }
}

/// An option that is not about what is compared is an error: a user who gives it expects an effect.
fn refuse_ignored(arguments: &Arguments, kind: Kind) -> Result<()> {
    let (images, statistics) = (kind == Kind::Image, matches!(kind, Kind::Json | Kind::Csv));
    let given = [
        ("--difference", arguments.difference.is_some(), images),
        ("--allow", arguments.allow.is_some(), images),
        ("--only", arguments.only.is_some(), statistics || kind == Kind::Configuration),
        ("--each-bank", arguments.each_bank, statistics),
        ("--by", arguments.by.is_some(), statistics),
        ("--most", arguments.most.is_some(), statistics),
    ];
    match given.into_iter().find(|&(_, given, used)| given && !used) {
        // A folder has files of all kinds.
        Some((option, ..)) if kind != Kind::Folder => {
            bail!("{option} does not apply to {}, and would be ignored here", kind.name())
        }
        _ => Ok(()),
    }
}

/// What is not there is of no kind.
fn exists(path: &Path) -> Result<()> {
    if path.exists() || Kind::of(path) != Kind::Image || path.extension().is_some() {
        return Ok(());
    }
    let names = BUILT_IN.iter().map(|(name, _)| *name);
    let nearest = nearest(names, &path.to_string_lossy()).map_or(String::new(), |name| format!("; {name} is the nearest"));
    bail!("there is no {}: neither a file or folder nor a built-in configuration{nearest}", path.display());
}

pub fn run(arguments: &Arguments) -> Result<Verdict> {
    let (a, b) = (arguments.a.as_path(), arguments.b.as_path());
    for path in [a, b] {
        exists(path)?;
    }
    if Kind::of(a) == Kind::of(b) {
        refuse_ignored(arguments, Kind::of(a))?;
    }
    let mut document = Map::new();
    let same = match (Kind::of(a), Kind::of(b)) {
        (Kind::Folder, Kind::Folder) => folders(arguments, &mut document)?,
        (Kind::Json, Kind::Json) | (Kind::Csv, Kind::Csv) => statistics(a, b, arguments, &mut document)?,
        (Kind::Configuration, Kind::Configuration) => configurations(a, b, arguments, &mut document)?,
        (Kind::Image, Kind::Image) => {
            if let Some(path) = &arguments.difference {
                check_replaceable(path, picture::MARK, arguments.force)?;
            }
            let d = difference(a, b, &arguments.limiting.limits()?)?;
            text!(arguments, "{}", found(&d));
            document.insert("images".into(), json!([image_json(&b.display().to_string(), &d)]));
            if let Some(path) = &arguments.difference {
                write(path, &d)?;
            }
            fits(&d, arguments)
        }
        (Kind::Configuration, Kind::Folder) if a.extension().is_some() => {
            refuse_ignored(arguments, Kind::Manifest)?;
            if arguments.json {
                bail!("--json does not apply to {}", Kind::Manifest.name());
            }
            recordings(a, b, &arguments.limiting.limits()?)?
        }
        (x, y) => {
            bail!("{} is {}, and {} is {}: they are not of one kind", a.display(), x.name(), b.display(), y.name())
        }
    };
    if arguments.json {
        let mut whole = json!({ "same": same, "a": a.display().to_string(), "b": b.display().to_string() });
        whole.as_object_mut().into_iter().for_each(|fields| fields.extend(std::mem::take(&mut document)));
        super::say_json(&whole)?;
    }
    Ok(if same { Verdict::Done } else { Verdict::Failed })
}

/// Replays the recordings of a manifest, and compares their pictures with the references.
fn recordings(manifest: &Path, root: &Path, limits: &Limits) -> Result<bool> {
    let manifest = Manifest::read(manifest)?;
    let width = manifest.recordings.iter().map(|r| r.folder.display().to_string().len()).max().unwrap_or(0);
    let (mut all, mut near) = (0, 0);
    println!("{:<width$}  frame  PSNR, dB  off by more than {TOLERANCE_OF_REFERENCES}", "recording");
    for recording in &manifest.recordings {
        let name = recording.folder.display().to_string();
        let rows = match recording.compare(root, limits) {
            Ok(rows) => rows,
            Err(error) => {
                println!("{}", one_line(&format!("{name:<width$}  {error:#}")));
                all += 1;
                continue;
            }
        };
        for row in rows {
            all += 1;
            let standing = recording.standing(&manifest, &row);
            near += usize::from(standing != Standing::Off);
            let note = match (standing, &recording.worse) {
                (Standing::Near, _) => String::new(),
                (Standing::Excepted, Some(worse)) => worse.reason.clone(),
                _ => "OFF".to_owned(),
            };
            let line = format!("{name:<width$}  {:>5}  {:>8.2}  {:>7.3} %  {note}", row.frame, row.psnr, row.off);
            println!("{}", one_line(line.trim_end()));
        }
    }
    println!("{near} of {all} pictures are as near to their references as they must be");
    Ok(near == all)
}

/// The files of a folder that replay has written, in order.
fn outputs(folder: &Path) -> Result<Vec<String>> {
    let fail = || format!("cannot read {}", folder.display());
    let mut names = Vec::new();
    for entry in std::fs::read_dir(folder).with_context(fail)? {
        let Ok(name) = entry.with_context(fail)?.file_name().into_string() else { continue };
        let is_image = name.starts_with("frame-") && name.ends_with(".png");
        if is_image || matches!(name.as_str(), "config.ron" | "stats.json" | "stats.csv") {
            names.push(name);
        }
    }
    if names.is_empty() {
        bail!("{} holds nothing that replay writes: no frame-NNNN.png, stats.json, stats.csv or config.ron", folder.display());
    }
    names.sort();
    Ok(names)
}

/// Two outputs of replay: their configurations, their statistics, and all images.
fn folders(arguments: &Arguments, document: &mut Map<String, Value>) -> Result<bool> {
    let (a, b) = (arguments.a.as_path(), arguments.b.as_path());
    let (in_a, in_b) = (outputs(a)?, outputs(b)?);
    let both = |name: &str| in_a.iter().any(|n| n == name) && in_b.iter().any(|n| n == name);
    let mut same = true;
    for (key, folder, names, others) in [("only_in_a", a, &in_a, &in_b), ("only_in_b", b, &in_b, &in_a)] {
        let only: Vec<&String> = names.iter().filter(|name| !others.contains(name)).collect();
        only.iter().for_each(|name| text!(arguments, "{name} is in {} only", folder.display()));
        same &= only.is_empty();
        document.insert(key.into(), json!(only));
    }
    if both("config.ron") {
        same &= configurations(&a.join("config.ron"), &b.join("config.ron"), arguments, document)?;
    }
    // Both hold the same statistics, the second those of frames only.
    if let Some(name) = ["stats.json", "stats.csv"].into_iter().find(|name| both(name)) {
        same &= statistics(&a.join(name), &b.join(name), arguments, document)?;
    }
    let limits = arguments.limiting.limits()?;
    let (mut images, mut different) = (Vec::new(), 0);
    for name in in_a.iter().filter(|name| name.ends_with(".png") && both(name)) {
        let d = difference(&a.join(name), &b.join(name), &limits)?;
        images.push(image_json(name, &d));
        if d.different > 0 {
            different += 1;
            text!(arguments, "{name}: {}", found(&d));
            if let Some(folder) = &arguments.difference {
                std::fs::create_dir_all(folder).with_context(|| format!("cannot make {}", folder.display()))?;
                let path = folder.join(name);
                check_replaceable(&path, picture::MARK, arguments.force)?;
                write(&path, &d)?;
            }
        }
        same &= fits(&d, arguments);
    }
    text!(arguments, "{different} of {} images differ", images.len());
    document.insert("images".into(), images.into());
    Ok(same)
}

/// How two pictures differ: in their colours only, if one of them has no alpha.
fn difference(a: &Path, b: &Path, limits: &Limits) -> Result<Difference> {
    let open = |path: &Path| {
        let fail = || format!("cannot read {}", path.display());
        let file = host::open(path, Links::Follow).with_context(fail)?;
        anyhow::Ok(picture::read(file, limits).with_context(fail)?)
    };
    let images = (open(a)?, open(b)?);
    let alpha = images.0.color().has_alpha() && images.1.color().has_alpha();
    // Without alpha a picture is read as one whose alpha is 255.
    let rgba = |image: DynamicImage| if alpha { image } else { image.into_rgb8().into() }.into_rgba8();
    let images = (rgba(images.0), rgba(images.1));
    picture::compare(&images.0, &images.1).map_err(|reason| anyhow!("{} and {}: {reason}", a.display(), b.display()))
}

fn image_json(name: &str, d: &Difference) -> Value {
    json!({
        "image": name,
        "pixels": d.pixels,
        "different": d.different,
        "off": d.off,
        "largest": d.largest,
        // Equal pictures have an infinite ratio, which JSON does not know.
        "psnr": d.psnr.is_finite().then_some(d.psnr),
    })
}

fn found(d: &Difference) -> String {
    format!(
        "{} pixels, {} different, {} off by more than {TOLERANCE} ({:.4} %), largest difference {}, PSNR {:.2} dB",
        d.pixels,
        d.different,
        d.off,
        100.0 * d.off_share(),
        d.largest,
        d.psnr
    )
}

fn write(path: &Path, d: &Difference) -> Result<()> {
    let fail = || format!("cannot write {}", path.display());
    let png = picture::marked(&d.picture).with_context(fail)?;
    host::write_file(path, &png).with_context(fail)
}

/// Whether no more pixels are off than may be.
fn fits(d: &Difference, arguments: &Arguments) -> bool {
    100.0 * d.off_share() <= arguments.allow.unwrap_or(0.0)
}

fn configurations(a: &Path, b: &Path, arguments: &Arguments, document: &mut Map<String, Value>) -> Result<bool> {
    let open = |path: &Path| configs::load(path.to_str().with_context(|| format!("{} is not UTF-8", path.display()))?, &[]);
    let mut found = compare::configurations(&open(a)?, &open(b)?);
    found.retain(|d| arguments.only.as_ref().is_none_or(|only| d.path.starts_with(only.as_str())));
    let width = found.iter().map(|d| d.path.len()).max().unwrap_or(0);
    for d in &found {
        text!(arguments, "{:<width$}  {} -> {}", d.path, d.a, d.b);
    }
    text!(arguments, "{}", counted(found.len(), "knob"));
    document.insert("knobs".into(), changed_json(&found));
    Ok(found.is_empty())
}

/// "1 knob differs", "2 knobs differ".
fn counted(n: usize, what: &str) -> String {
    if n == 1 { format!("1 {what} differs") } else { format!("{n} {what}s differ") }
}

fn statistics(a: &Path, b: &Path, arguments: &Arguments, document: &mut Map<String, Value>) -> Result<bool> {
    let open = |path: &Path| -> Result<Leaves> {
        let text = host::read_text(path, TEXT_MAX).with_context(|| format!("cannot read {}", path.display()))?;
        let not = || format!("{} is not a statistics file", path.display());
        let mut leaves = if Kind::of(path) == Kind::Csv {
            compare::table(&text).map_err(anyhow::Error::msg).with_context(not)?
        } else {
            let tree: Value = serde_json::from_str(&text).with_context(not)?;
            if !tree.is_object() {
                return Err(anyhow!("it holds no object").context(not()));
            }
            compare::leaves(&tree)
        };
        if let Some(only) = &arguments.only {
            leaves.retain(|(path, _)| compare::is_under(path, only));
        }
        Ok(leaves)
    };
    let banks = if arguments.each_bank { Banks::Each } else { Banks::Sum };
    let mut found = compare::statistics(open(a)?, open(b)?, banks);
    let all = found.len();
    compare::largest_first(
        &mut found,
        match arguments.by {
            None | Some(By::Relative) => Size::Relative,
            Some(By::Absolute) => Size::Absolute,
        },
    );
    document.insert("statistics".into(), found.iter().map(statistic_json).collect());
    if arguments.json {
        return Ok(all == 0);
    }
    // Frames repeat what is in the total.
    let of_frames = |d: &StatisticDifference| d.path.starts_with("frames[");
    let mut frames = 0;
    if found.iter().any(|d| d.path.starts_with("total.")) {
        found.retain(|d| !of_frames(d));
        frames = all - found.len();
    }
    let most = arguments.most.unwrap_or(50);
    let shown = if most == 0 { found.len() } else { most.min(found.len()) };
    table(&found[..shown]);
    if shown < found.len() {
        println!("{} more: --most 0 shows all", found.len() - shown);
    }
    if frames > 0 {
        println!("{frames} of single frames: --only frames shows them");
    }
    println!("{}", counted(all, "statistic"));
    Ok(all == 0)
}

/// A difference, whose values are null in a file that lacks the statistic.
fn statistic_json(d: &StatisticDifference) -> Value {
    json!({ "path": d.path, "a": d.a, "b": d.b, "absolute": d.absolute(), "relative": d.relative() })
}

/// A line for each difference: path, values, change, relative change.
fn table(found: &[StatisticDifference]) {
    let show = |value: &Option<Value>| value.as_ref().map_or_else(|| "-".to_owned(), Value::to_string);
    let rows: Vec<[String; 4]> = found
        .iter()
        .map(|d| {
            let change = d.absolute().map(signed).unwrap_or_default();
            let relative = d.relative().map(|r| format!("{:+.3} %", 100.0 * r)).unwrap_or_default();
            [one_line(&d.path).to_string(), format!("{} -> {}", show(&d.a), show(&d.b)), change, relative]
        })
        .collect();
    // Texts may be long, and nothing follows them.
    let numbers = || rows.iter().filter(|row| !row[2].is_empty());
    let width = |column: usize| numbers().map(|row| row[column].chars().count()).max().unwrap_or(0);
    let [path, values, change, relative] = [0, 1, 2, 3].map(width);
    for [p, v, c, r] in &rows {
        println!("{}", format!("{p:<path$}  {v:<values$}  {c:>change$}  {r:>relative$}").trim_end());
    }
}

/// A change with its sign: whole where it is whole, else to four digits or so.
fn signed(change: f64) -> String {
    match change.abs() {
        _ if change.fract() == 0.0 => format!("{change:+}"),
        size if size >= 1e-2 => format!("{change:+.4}"),
        _ => format!("{change:+.3e}"),
    }
}
