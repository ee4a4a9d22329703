//! Where a scene is played: its traces are rendered for the proof, then timed on every sort class.

use std::cell::RefCell;
use std::rc::Rc;

use anyhow::{Context, Result, ensure};

use crate::{Row, Setting};
use machine::config::SortClass;
use machine::{Config, Machine, PassOrderCounts, SORTING};
use render::Options;
use run::machines;
use run::stored_work::StoredWork;
use stats::Tree;
use trace::{Packing, Trace, write_archive};
use work::{RenderKey, Surface};

/// The baseline with changes.
fn config(changes: &[&str]) -> Result<Config> {
    let mut config = Config::built_in("four-pipelines")?;
    for change in changes {
        config.set(change)?;
    }
    config.check()?;
    Ok(config)
}

/// Pixels of a picture at most, each way.
const LARGEST: [u32; 2] = [400, 300];

/// Bytes of a recording at most.
const BYTES: usize = 150_000;

/// A rendered picture.
#[derive(Clone, Debug, PartialEq)]
pub struct Image {
    /// What it is.
    pub surface: Surface,
    /// Its bytes, row by row.
    pub bytes: Vec<u8>,
}

impl Image {
    /// Pixels each way.
    pub fn size(&self) -> [u32; 2] {
        [self.surface.width, self.surface.height]
    }

    /// The words of a pixel, for formats of whole words.
    fn words(&self, x: u32, y: u32, word: usize) -> [u8; 4] {
        let size = self.surface.format.block_bytes() as usize;
        let at = (y as usize * self.surface.width as usize + x as usize) * size + 4 * word;
        self.bytes[at..at + 4].try_into().expect("four bytes")
    }

    /// A pixel of a format of four bytes.
    pub fn rgba(&self, x: u32, y: u32) -> [u8; 4] {
        self.words(x, y, 0)
    }

    /// A channel of a pixel of a format of f32.
    pub fn float(&self, x: u32, y: u32, channel: usize) -> f32 {
        f32::from_le_bytes(self.words(x, y, channel))
    }

    /// A channel of a pixel of a format of u32.
    pub fn word(&self, x: u32, y: u32, channel: usize) -> u32 {
        u32::from_le_bytes(self.words(x, y, channel))
    }

    /// All pixels, row by row.
    pub fn places(&self) -> impl Iterator<Item = (u32, u32)> + use<> {
        let [width, height] = self.size();
        (0..height).flat_map(move |y| (0..width).map(move |x| (x, y)))
    }

    /// Pixels in which it differs from another of its size.
    pub fn differing(&self, other: &Image) -> u64 {
        self.places().filter(|&(x, y)| self.rgba(x, y) != other.rgba(x, y)).count() as u64
    }

    /// The largest difference of an 8-bit channel from what a function says, in codes of 255.
    pub fn worst(&self, mut at: impl FnMut(u32, u32) -> [f64; 3]) -> f64 {
        let mut worst = 0.0_f64;
        for (x, y) in self.places() {
            let (codes, exact) = (self.rgba(x, y), at(x, y));
            for channel in 0..3 {
                worst = worst.max((f64::from(codes[channel]) - 255.0 * exact[channel].clamp(0.0, 1.0)).abs());
            }
        }
        worst
    }

    /// Pixels that are not what a function says.
    pub fn wrong(&self, mut at: impl FnMut(u32, u32) -> [u8; 3]) -> u64 {
        self.places().filter(|&(x, y)| self.rgba(x, y)[..3] != at(x, y)).count() as u64
    }
}

/// The price of a scene on a sort class.
#[derive(Clone, Debug)]
pub struct Price {
    /// The class.
    pub class: SortClass,
    /// Cycles of all frames.
    pub cycles: u64,
    /// Frames that are not the renderer's.
    pub differing: u64,
    /// Passes that need an order which the class does not keep.
    pub disordered: u64,
}

/// A question asked of the card.
#[derive(Clone, Debug)]
pub struct Answer {
    /// What is asked.
    pub question: String,
    /// What the card says.
    pub answer: String,
}

/// What a scene leaves.
#[derive(Clone, Debug, Default)]
pub struct Played {
    /// What was measured.
    pub rows: Vec<Row>,
    /// The picture of its first frame.
    pub picture: Option<Image>,
    /// Bytes of the recording.
    pub bytes: u64,
    /// Prices by class.
    pub prices: Vec<Price>,
    /// Questions with their answers.
    pub answers: Vec<Answer>,
}

/// Traces whose work is kept.
const WORKS: usize = 4;

/// What decides a rendering: the hash of the trace's archive, and the render key.
type RenderingKey = (blake3::Hash, RenderKey);

/// Where a scene is played.
pub struct SceneRun {
    /// With what.
    pub setting: Setting,
    /// What it has left so far.
    pub played: Played,
    /// Work of the traces that were asked for last.
    known: RefCell<Vec<(RenderingKey, Rc<StoredWork>)>>,
}

impl SceneRun {
    /// A stage on which nothing was played.
    pub fn new(setting: Setting) -> SceneRun {
        SceneRun { setting, played: Played::default(), known: RefCell::default() }
    }

    /// Whether the scene is spoiled.
    pub fn fault(&self) -> bool {
        self.setting.inject_fault
    }

    /// Adds what was measured.
    pub fn row(&mut self, row: Row) {
        self.played.rows.push(row);
    }

    /// The work of a trace, which is rendered once for its pictures and for all machines.
    ///
    /// # Errors
    /// If it cannot be rendered, or its work does not fit in memory.
    fn work(&self, trace: &Trace, key: RenderKey) -> Result<Rc<StoredWork>> {
        let mut archive = std::io::Cursor::new(Vec::new());
        write_archive(trace, trace.file(), &mut archive, Packing::Stored)?;
        let of = (blake3::hash(archive.get_ref()), key);
        let mut known = self.known.borrow_mut();
        if let Some((_, work)) = known.iter().find(|(known, _)| *known == of) {
            return Ok(work.clone());
        }
        let most = trace.limits().memory_bytes.get() / 4;
        // Machines run one after another; those of this class have the most surfaces.
        let images = Machine::images(&config(&["sort=sort-last-image"])?);
        let work = StoredWork::render(trace, &Options::default(), key, images, most)?;
        let work =
            Rc::new(work.with_context(|| format!("the work of {} takes more than {most} bytes", trace.file().display()))?);
        known.truncate(WORKS - 1);
        known.insert(0, (of, work.clone()));
        Ok(work)
    }

    /// The renderer's pictures of a trace.
    ///
    /// # Errors
    /// If it cannot be rendered, or a frame shows nothing.
    pub fn frames(&self, trace: &Trace) -> Result<Vec<Image>> {
        let work = self.work(trace, RenderKey::default())?;
        let frames = work.pictures().map(|shown| shown.map(|(surface, bytes)| Image { surface, bytes: bytes.to_vec() }));
        frames.collect::<Option<Vec<_>>>().context("a frame shows nothing")
    }

    /// Renders the scene's trace; its first frame is its picture. Then all classes draw it.
    ///
    /// # Errors
    /// If it is too large, cannot be rendered, or a machine stops.
    pub fn show(&mut self, trace: &Trace) -> Result<Vec<Image>> {
        let frames = self.frames(trace)?;
        let first = frames.first().context("the scene shows nothing")?;
        ensure!(first.size()[0] <= LARGEST[0] && first.size()[1] <= LARGEST[1], "{:?} pixels are too many", first.size());
        let mut archive = std::io::Cursor::new(Vec::new());
        write_archive(trace, trace.file(), &mut archive, Packing::Stored)?;
        let bytes = archive.into_inner().len();
        ensure!(bytes <= BYTES, "a recording of {bytes} bytes is too large");
        self.played.bytes = bytes as u64;
        self.played.picture = Some(first.clone());
        // A fault spoils the proof; prices have none.
        if !self.fault() {
            self.price(trace, &frames)?;
        }
        Ok(frames)
    }

    fn price(&mut self, trace: &Trace, frames: &[Image]) -> Result<()> {
        for &class in SortClass::ALL {
            let name = class.name();
            let config = config(&[&format!("sort={name}")])?;
            let ran = self.work(trace, config.render_key())?.run(&config)?;
            ensure!(ran.shown.len() == frames.len(), "{name} shows {} frames of {}", ran.shown.len(), frames.len());
            let same = |(shown, frame): &(&machines::Shown, &Image)| {
                shown.picture == Some((frame.surface, blake3::hash(&frame.bytes)))
            };
            let differing = ran.shown.iter().zip(frames).filter(|pair| !same(pair)).count() as u64;
            let PassOrderCounts { passes_needing_order: disordered } = SORTING.sum(&ran.total);
            // Only a class that names the passes whose order it does not keep may show another picture.
            if disordered == 0 {
                self.row(Row::none(format!("{name}: frames that are not the renderer's"), differing));
            }
            self.played.prices.push(Price { class, cycles: ran.cycles, differing, disordered });
        }
        Ok(())
    }

    /// Passes of the scene that need an order which a class does not keep.
    pub fn disordered(&self, class: SortClass) -> u64 {
        self.played.prices.iter().find(|price| price.class == class).map_or(0, |price| price.disordered)
    }

    /// Cycles of a trace on the baseline with changes, and the statistics.
    ///
    /// # Errors
    /// If a change is none, or the machine stops.
    pub fn time(&self, trace: &Trace, changes: &[&str]) -> Result<(f64, Tree)> {
        let config = config(changes)?;
        let ran = self.work(trace, config.render_key())?.run(&config)?;
        Ok((ran.cycles as f64, ran.total))
    }

    /// Adds an answer.
    pub fn answer(&mut self, question: &str, answer: String) {
        self.played.answers.push(Answer { question: question.into(), answer });
    }
}
