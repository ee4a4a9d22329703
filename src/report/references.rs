//! Recorded programs against the reference images beside them: a manifest names the recordings and says how near their pictures come.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail};
use serde::Deserialize;

use crate::host::{self, Links};
use crate::import;
use crate::machine::Config;
use crate::picture::{self, picture};
use crate::run::replay::{Fidelity, Options, replay};

/// Bytes of a manifest at most.
const TEXT_MAX: u64 = 1 << 20;

/// A channel may differ by this much of 255 before its pixel counts as off: two right rasterisers round textures and colours differently.
pub const TOLERANCE: u8 = 8;

/// How near pictures must come to their references.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Limits {
    /// Least peak signal-to-noise ratio over red, green and blue, in dB.
    pub psnr: f64,
    /// Percentage of pixels of which a channel may be off by more than [`TOLERANCE`].
    pub off: f64,
}

impl Limits {
    fn hold(self, row: &Row) -> bool {
        row.psnr >= self.psnr && row.off <= self.off
    }
}

/// Limits of one recording that are wider than those of its kind.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Exception {
    /// See [`Limits::psnr`].
    pub psnr: f64,
    /// See [`Limits::off`].
    pub off: f64,
    /// Why the pictures differ more.
    pub reason: String,
}

/// A recording with reference images.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Recording {
    /// Its folder, below that which the command is given. References are `frameNNNN.png` or `.ppm` in it or in its folder `reference`;
    /// what stands behind the four digits is not read.
    pub folder: PathBuf,
    /// Which of [`Manifest::kinds`] it is.
    pub kind: String,
    /// The number that the reference of the first frame has: some recorders count from 1.
    #[serde(default)]
    pub first: u32,
    /// What the message must say with which the recording is refused; none: it must be replayed.
    #[serde(default)]
    pub refused: Option<String>,
    /// PSNR in dB that all its pictures have reached: one below it is a step back, also where the limits of its kind hold.
    #[serde(default)]
    pub least: Option<f64>,
    /// Where the limits of its kind do not hold.
    #[serde(default)]
    pub worse: Option<Exception>,
}

/// Recordings, and how near their pictures must come to the references.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Manifest {
    /// Limits by kind of recording.
    pub kinds: BTreeMap<String, Limits>,
    /// The recordings.
    pub recordings: Vec<Recording>,
}

impl Manifest {
    /// Reads a manifest in RON.
    ///
    /// # Errors
    /// If the file cannot be read, is no manifest, names no recording, or has one of a kind that it does not declare.
    pub fn read(path: &Path) -> Result<Manifest> {
        let fail = || format!("{} is not a manifest of recordings", path.display());
        let text = host::read_text(path, TEXT_MAX).with_context(|| format!("cannot read {}", path.display()))?;
        // Text that is nested without end is an error and no overflow of the stack.
        let options =
            ron::Options::default().with_recursion_limit(16).with_default_extension(ron::extensions::Extensions::IMPLICIT_SOME);
        let manifest: Manifest = options.from_str(&text).with_context(fail)?;
        if manifest.recordings.is_empty() {
            return Err(anyhow::Error::msg("it names no recording").context(fail()));
        }
        for recording in &manifest.recordings {
            if !manifest.kinds.contains_key(&recording.kind) {
                let kinds: Vec<&str> = manifest.kinds.keys().map(String::as_str).collect();
                let what =
                    format!("{}: kind \"{}\" is none of: {}", recording.folder.display(), recording.kind, kinds.join(", "));
                return Err(anyhow::Error::msg(what).context(fail()));
            }
        }
        Ok(manifest)
    }
}

/// A picture and its reference.
#[derive(Clone, Debug)]
pub struct Row {
    /// Number of the frame, from 0.
    pub frame: u32,
    /// Peak signal-to-noise ratio over red, green and blue, in dB; infinite for equal pictures.
    pub psnr: f64,
    /// Percentage of pixels of which a channel is off by more than [`TOLERANCE`].
    pub off: f64,
}

/// How a picture stands to the limits.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Standing {
    /// The limits of the kind hold.
    Near,
    /// Only those of the exception do.
    Excepted,
    /// Neither do, or the picture is worse than it was.
    Off,
}

impl Recording {
    /// How one of its pictures stands.
    pub fn standing(&self, manifest: &Manifest, row: &Row) -> Standing {
        match &self.worse {
            _ if self.least.is_some_and(|least| row.psnr < least) => Standing::Off,
            _ if manifest.kinds[&self.kind].hold(row) => Standing::Near,
            Some(worse) if (Limits { psnr: worse.psnr, off: worse.off }).hold(row) => Standing::Excepted,
            _ => Standing::Off,
        }
    }

    /// Replays the recording as far as its last reference, and compares. A recording that must be refused has no pictures.
    ///
    /// # Errors
    /// If there is no recording or no reference, if either cannot be read, if the recording asks for what is not supported, or if sizes
    /// differ.
    pub fn compare(&self, root: &Path, limits: &num::Limits) -> Result<Vec<Row>> {
        let folder = root.join(&self.folder);
        if let Some(refused) = &self.refused {
            let Some(found) = import::detect(&folder) else { bail!("{} holds no recording", folder.display()) };
            match import::open(&found.path) {
                Err(error) if error.unsupported && error.reason.contains(refused.as_str()) => return Ok(Vec::new()),
                Err(error) => return Err(anyhow::Error::new(error).context(format!("it is not refused for {refused}"))),
                Ok(_) => bail!("{} is replayed; it must be refused for {refused}", found.path.display()),
            }
        }
        let numbered = |(number, path): (u32, PathBuf)| (number.saturating_sub(self.first), path);
        let references: BTreeMap<u32, PathBuf> = references(&folder)?.into_iter().map(numbered).collect();
        let Some(last) = references.keys().next_back() else {
            bail!("{} has no reference: no frameNNNN.png or .ppm", folder.display());
        };
        let Some(found) = import::detect(&folder) else { bail!("{} holds no recording", folder.display()) };
        let trace = import::open(&found.path)?;
        let config = Config::built_in("baseline").context("no baseline")?;
        let options = Options { frames: 0..last + 1, ..Options::new(config, Fidelity::Functional) };
        let mut replayed = replay(&trace, &options, &|_| ()).with_context(|| found.path.display().to_string())?;
        let mut rows = Vec::new();
        for (&number, path) in &references {
            let frame = replayed.frames.iter_mut().find(|frame| frame.number == number).and_then(|frame| frame.shown.take());
            let (surface, bytes) = frame.with_context(|| format!("{} shows no frame {number}", found.path.display()))?;
            let ours = picture(&surface, &bytes).map_err(anyhow::Error::msg)?;
            let wanted = read_image(path, limits)?;
            if ours.dimensions() != wanted.dimensions() {
                let ((w, h), (rw, rh)) = (ours.dimensions(), wanted.dimensions());
                bail!("frame {number} of {} is {w} x {h} pixels, {} {rw} x {rh}", found.path.display(), path.display());
            }
            let (off, psnr) = picture::rgb_difference(&ours, &wanted, TOLERANCE);
            let pixels = f64::from(wanted.width()) * f64::from(wanted.height());
            rows.push(Row { frame: number, psnr, off: 100.0 * off as f64 / pixels });
        }
        Ok(rows)
    }
}

/// The references of a recording by number of frame.
fn references(folder: &Path) -> Result<BTreeMap<u32, PathBuf>> {
    let mut found = BTreeMap::new();
    for folder in [folder.to_owned(), folder.join("reference")] {
        if found.is_empty() && folder.is_dir() {
            for entry in std::fs::read_dir(&folder).with_context(|| format!("cannot read {}", folder.display()))? {
                let path = entry.with_context(|| format!("cannot read {}", folder.display()))?.path();
                let name = path.file_name().and_then(|name| name.to_str()).unwrap_or_default();
                // Other programs have marks of their own behind the number: `frame0012.sim.ppm`.
                let image = name.ends_with(".png") || name.ends_with(".ppm");
                let number = name.strip_prefix("frame").filter(|_| image).and_then(|rest| rest.split('.').next());
                if let Some(number) = number.filter(|digits| digits.len() == 4).and_then(|digits| digits.parse().ok()) {
                    found.insert(number, path);
                }
            }
        }
    }
    Ok(found)
}

fn read_image(path: &Path, limits: &num::Limits) -> Result<image::RgbImage> {
    let fail = || format!("cannot read {}", path.display());
    let file = host::open(path, Links::Follow).with_context(fail)?;
    Ok(picture::read(file, limits).with_context(fail)?.into_rgb8())
}
