//! `fillrate compare`

use std::path::{Path, PathBuf};

use anyhow::{Context, Result, anyhow, bail};
use image::DynamicImage;
use serde_json::{Map, Value, json};

use super::beside::{Replayed, of_sweep};
use super::reading::Limiting;
use super::{Verdict, configs};
use crate::host;
use crate::host::{Links, one_line};
use crate::machine::Config;
use crate::machine::config::BUILT_IN;
use crate::num::{Limits, nearest};
use crate::picture::{self, Difference, TOLERANCE};
use crate::report::beside;
use crate::report::compare::{self, Banks, KnobDifference, Leaves, Size, StatisticDifference};
use crate::report::files::changed_json;
use crate::report::html as pages;
use crate::report::owned::check_replaceable;
use crate::report::references::{Manifest, Standing, TOLERANCE as TOLERANCE_OF_REFERENCES};

/// Bytes of a statistics file at most: hours of frames.
const TEXT_MAX: u64 = 1 << 30;

/// Compare two outputs of replay, or two machines of a sweep: time, phases, funnel, memory, caches and losses first, then pictures, knobs and all
/// other statistics. Or compare two files: images (PSNR, pixels off by more than 2, and with --difference an image of the differences), statistics
/// (JSON or CSV), or configurations; or recorded programs with their reference images.
#[derive(clap::Args)]
#[command(
    after_help = "Examples:\n  fillrate compare before after\n  fillrate compare before after --report page.html\n  fillrate compare results:1 results:11\n  \
fillrate compare before after --only total.\n  \
fillrate compare out/frame-0000.png ref.png --difference difference.png\n  \
fillrate compare before/stats.json after/stats.json --only total.units --each-bank\n  \
fillrate compare baseline out/config.ron\n\n\
Exit code 1 where images have more pixels off than --allow, or statistics, knobs or the lists of images differ."
)]
pub struct Arguments {
    /// A folder that replay has written, a machine of a sweep (its folder, a colon, its number), an image (PNG), statistics (stats.json,
    /// stats.csv), or a configuration (RON, or a built-in name); or a manifest of recordings (RON)
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
    /// Folders and machines of sweeps: write a page (one HTML file) with both beside each other
    #[arg(help_heading = "Output", long, value_name = "FILE.html")]
    report: Option<PathBuf>,
    /// With --difference and --report: replace files that fillrate has not written
    #[arg(help_heading = "Output", long)]
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
enum InputKind {
    Folder,
    /// A machine of a sweep.
    Machine,
    Json,
    Csv,
    Configuration,
    Image,
    /// A manifest (RON) that is compared with a folder of recordings.
    Manifest,
}

impl InputKind {
    /// By what lies at a path and by its name; a built-in configuration has no file.
    fn of(path: &Path) -> InputKind {
        let is_built_in = || BUILT_IN.iter().any(|(name, _)| path.as_os_str() == *name);
        match path.extension().and_then(|extension| extension.to_str()) {
            _ if path.is_dir() => InputKind::Folder,
            _ if of_sweep(path).is_some() => InputKind::Machine,
            Some("json") => InputKind::Json,
            Some("csv") => InputKind::Csv,
            Some("ron") => InputKind::Configuration,
            _ if !path.exists() && is_built_in() => InputKind::Configuration,
            _ => InputKind::Image,
        }
    }

    fn name(self) -> &'static str {
        match self {
            InputKind::Folder => "a folder",
            InputKind::Machine => "a machine of a sweep",
            InputKind::Json => "a JSON file of statistics",
            InputKind::Csv => "a CSV file of statistics",
            InputKind::Configuration => "a configuration",
            InputKind::Image => "an image",
            InputKind::Manifest => "a manifest of recordings",
        }
    }
}

/// An option that is not about what is compared is an error: a user who gives it expects an effect.
fn refuse_ignored(arguments: &Arguments, kind: InputKind) -> Result<()> {
    let (images, statistics) =
        (kind == InputKind::Image, matches!(kind, InputKind::Json | InputKind::Csv | InputKind::Machine));
    let given = [
        ("--report", arguments.report.is_some(), kind == InputKind::Machine),
        ("--force", arguments.force, arguments.difference.is_some() || arguments.report.is_some()),
        ("--difference", arguments.difference.is_some(), images),
        ("--allow", arguments.allow.is_some(), images),
        ("--only", arguments.only.is_some(), statistics || kind == InputKind::Configuration),
        ("--each-bank", arguments.each_bank, statistics && kind != InputKind::Machine),
        ("--by", arguments.by.is_some(), statistics),
        ("--most", arguments.most.is_some(), statistics),
    ];
    match given.into_iter().find(|&(_, given, used)| given && !used) {
        // A folder has files of all kinds.
        Some((option, ..)) if kind != InputKind::Folder => {
            bail!("{option} does not apply to {}, and would be ignored here", kind.name())
        }
        _ => Ok(()),
    }
}

/// What is not there is of no kind.
fn exists(path: &Path) -> Result<()> {
    if path.exists() || InputKind::of(path) != InputKind::Image || path.extension().is_some() {
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
    if InputKind::of(a) == InputKind::of(b) {
        refuse_ignored(arguments, InputKind::of(a))?;
    }
    let mut document = Map::new();
    let same = match (InputKind::of(a), InputKind::of(b)) {
        (InputKind::Folder, InputKind::Folder) => folders(arguments, &mut document)?,
        (InputKind::Machine, InputKind::Machine) => {
            let of = |path| of_sweep(path).context("a machine of a sweep");
            machines(of(a)?, of(b)?, arguments, &mut document)?
        }
        (InputKind::Json, InputKind::Json) => {
            let sides = [Replayed::read(a)?, Replayed::read(b)?];
            summarize(arguments, &sides, &mut document);
            let [a, b] = sides.map(|side| compare::leaves(&side.json));
            statistics(a, b, arguments, &mut document).is_empty()
        }
        (InputKind::Csv, InputKind::Csv) => statistics(leaves(a)?, leaves(b)?, arguments, &mut document).is_empty(),
        (InputKind::Configuration, InputKind::Configuration) => configurations(a, b, arguments, &mut document)?.is_empty(),
        (InputKind::Image, InputKind::Image) => {
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
        (InputKind::Configuration, InputKind::Folder) if a.extension().is_some() => {
            refuse_ignored(arguments, InputKind::Manifest)?;
            if arguments.json {
                bail!("--json does not apply to {}", InputKind::Manifest.name());
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
        if let Some(refused) = &recording.refused {
            (all, near) = (all + 1, near + 1);
            println!("{}", one_line(&format!("{name:<width$}  refused: {refused}")));
        }
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

/// Two outputs of replay: what changed in sum, all images, their configurations, and their statistics.
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
    let mut sides = None;
    if both("stats.json") {
        let read = [Replayed::read(&a.join("stats.json"))?, Replayed::read(&b.join("stats.json"))?];
        summarize(arguments, &read, document);
        sides = Some(read);
    }
    let limits = arguments.limiting.limits()?;
    let (mut images, mut different) = (Vec::new(), 0);
    let mut shown: Option<Shown> = None;
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
        // The page shows the picture in which most pixels differ.
        if arguments.report.is_some() && shown.as_ref().is_none_or(|shown| d.different > shown.different) {
            shown = Some(Shown::new([&a.join(name), &b.join(name)], name, &d, &limits)?);
        }
    }
    text!(arguments, "{different} of {} images differ", images.len());
    document.insert("images".into(), images.into());
    let mut knobs = Vec::new();
    if both("config.ron") {
        knobs = configurations(&a.join("config.ron"), &b.join("config.ron"), arguments, document)?;
        same &= knobs.is_empty();
    }
    // Both hold the same statistics, the second those of frames only.
    let mut changed = Vec::new();
    if let Some([a, b]) = &sides {
        changed = statistics(compare::leaves(&a.json), compare::leaves(&b.json), arguments, document);
        same &= changed.is_empty();
    } else if both("stats.csv") {
        same &= statistics(leaves(&a.join("stats.csv"))?, leaves(&b.join("stats.csv"))?, arguments, document).is_empty();
    }
    if let Some(path) = &arguments.report {
        let Some(sides) = &sides else { bail!("--report needs a stats.json in both folders") };
        report(path, arguments, sides, &knobs, &changed, shown)?;
    }
    Ok(same)
}

/// Two machines of sweeps: what changed in sum, their configurations, and their statistics.
fn machines(a: (PathBuf, u32), b: (PathBuf, u32), arguments: &Arguments, document: &mut Map<String, Value>) -> Result<bool> {
    let (a, of_a) = Replayed::machine(&a.0, a.1)?;
    let (b, of_b) = Replayed::machine(&b.0, b.1)?;
    let sides = [a, b];
    summarize(arguments, &sides, document);
    let knobs = knobs(&of_a, &of_b, arguments, document);
    let [a, b] = &sides;
    let changed = statistics(compare::leaves(&a.json), compare::leaves(&b.json), arguments, document);
    if let Some(path) = &arguments.report {
        report(path, arguments, &sides, &knobs, &changed, None)?;
    }
    Ok(knobs.is_empty() && changed.is_empty())
}

/// Says what changed in sum, unless single statistics are asked for.
fn summarize(arguments: &Arguments, sides: &[Replayed; 2], document: &mut Map<String, Value>) {
    let [Some(a), Some(b)] = [&sides[0].side, &sides[1].side] else { return };
    if arguments.only.is_some() {
        return;
    }
    let sections = beside::sections(a, b);
    text!(arguments, "A: {}", one_line(&sides[0].about));
    text!(arguments, "B: {}", one_line(&sides[1].about));
    let verdict = beside::verdict(a, b);
    if let Some(verdict) = &verdict {
        text!(arguments, "\n{verdict}");
    }
    text!(arguments, "\n{}", beside::text(&sections));
    document.insert("verdict".into(), json!(verdict));
    document.insert("summary".into(), beside::json(&sections));
}

/// A picture of both replays, and where it differs.
struct Shown {
    name: String,
    different: u64,
    found: String,
    pictures: [Vec<u8>; 3],
}

impl Shown {
    fn new(paths: [&Path; 2], name: &str, d: &Difference, limits: &Limits) -> Result<Shown> {
        let png = |path: &Path| anyhow::Ok(picture::png(&open(path, limits)?.into_rgb8())?);
        let pictures = [png(paths[0])?, png(paths[1])?, picture::png(&d.picture)?];
        Ok(Shown { name: name.to_owned(), different: d.different, found: found(d), pictures })
    }
}

/// Writes the page.
fn report(
    path: &Path,
    arguments: &Arguments,
    sides: &[Replayed; 2],
    knobs: &[KnobDifference],
    changed: &[StatisticDifference],
    shown: Option<Shown>,
) -> Result<()> {
    check_replaceable(path, pages::MARK, arguments.force)?;
    let [Some(a), Some(b)] = [&sides[0].side, &sides[1].side] else { bail!("--report needs whole statistics of both replays") };
    let page = pages::beside::page(&pages::beside::Input {
        about: [&sides[0].about, &sides[1].about],
        verdict: beside::verdict(a, b),
        sections: &beside::sections(a, b),
        picture: shown.as_ref().map(|shown| (shown.name.as_str(), shown.found.as_str(), &shown.pictures)),
        knobs,
        changed,
    });
    host::write_file(path, page.as_bytes()).with_context(|| format!("cannot write {}", path.display()))?;
    text!(arguments, "the page: {}", path.display());
    Ok(())
}

/// Reads a picture.
fn open(path: &Path, limits: &Limits) -> Result<DynamicImage> {
    let fail = || format!("cannot read {}", path.display());
    let file = host::open(path, Links::Follow).with_context(fail)?;
    picture::read(file, limits).with_context(fail)
}

/// How two pictures differ: in their colours only, if one of them has no alpha.
fn difference(a: &Path, b: &Path, limits: &Limits) -> Result<Difference> {
    let images = (open(a, limits)?, open(b, limits)?);
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

fn configurations(a: &Path, b: &Path, arguments: &Arguments, document: &mut Map<String, Value>) -> Result<Vec<KnobDifference>> {
    let open = |path: &Path| configs::load(path.to_str().with_context(|| format!("{} is not UTF-8", path.display()))?, &[]);
    Ok(knobs(&open(a)?, &open(b)?, arguments, document))
}

fn knobs(a: &Config, b: &Config, arguments: &Arguments, document: &mut Map<String, Value>) -> Vec<KnobDifference> {
    let mut found = compare::configurations(a, b);
    found.retain(|d| arguments.only.as_ref().is_none_or(|only| d.path.starts_with(only.as_str())));
    let width = found.iter().map(|d| d.path.len()).max().unwrap_or(0);
    for d in &found {
        text!(arguments, "{:<width$}  {} -> {}", d.path, d.a, d.b);
    }
    text!(arguments, "{}", counted(found.len(), "knob"));
    document.insert("knobs".into(), changed_json(&found));
    found
}

/// "1 knob differs", "2 knobs differ".
fn counted(n: usize, what: &str) -> String {
    if n == 1 { format!("1 {what} differs") } else { format!("{n} {what}s differ") }
}

/// The statistics of a CSV file.
fn leaves(path: &Path) -> Result<Leaves> {
    let text = host::read_text(path, TEXT_MAX).with_context(|| format!("cannot read {}", path.display()))?;
    let not = || format!("{} is not a statistics file", path.display());
    compare::table(&text).map_err(anyhow::Error::msg).with_context(not)
}

/// All statistics that differ, those that change most first. Says the first of them.
fn statistics(a: Leaves, b: Leaves, arguments: &Arguments, document: &mut Map<String, Value>) -> Vec<StatisticDifference> {
    let only = |mut leaves: Leaves| {
        if let Some(only) = &arguments.only {
            leaves.retain(|(path, _)| compare::is_under(path, only));
        }
        leaves
    };
    let banks = if arguments.each_bank { Banks::Each } else { Banks::Sum };
    let mut found = compare::statistics(only(a), only(b), banks);
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
        return found;
    }
    // Frames repeat what is in the total.
    let of_frames = |d: &&StatisticDifference| d.path.starts_with("frames[");
    let totals = found.iter().any(|d| d.path.starts_with("total."));
    let listed: Vec<&StatisticDifference> = found.iter().filter(|d| !totals || !of_frames(d)).collect();
    let frames = all - listed.len();
    let most = arguments.most.unwrap_or(50);
    let shown = if most == 0 { listed.len() } else { most.min(listed.len()) };
    table(&listed[..shown]);
    if shown < listed.len() {
        println!("{} more: --most 0 shows all", listed.len() - shown);
    }
    if frames > 0 {
        println!("{frames} of single frames: --only frames shows them");
    }
    println!("{}", counted(all, "statistic"));
    found
}

/// A difference, whose values are null in a file that lacks the statistic.
fn statistic_json(d: &StatisticDifference) -> Value {
    json!({ "path": d.path, "a": d.a, "b": d.b, "absolute": d.absolute(), "relative": d.relative() })
}

/// A line for each difference: path, values, change, relative change.
fn table(found: &[&StatisticDifference]) {
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
