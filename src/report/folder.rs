//! The folder that a replay leaves: pictures and statistics, written beside the machine as frames end.

use std::io::Write;
use std::path::{Path, PathBuf};
use std::thread::JoinHandle;

use anyhow::{Context, Error, Result, anyhow, bail};
use crossbeam::channel::{self, Receiver, Sender};

use super::files::{About, json_head};
use super::owned::Owned;
use super::rows::{self, csv_rows, draw_rows, json_end, json_frame, pass_rows};
use crate::host::{self, PartialFile};
use crate::machine::Shown;
use crate::num::OUR_FAULT;
use crate::picture;
use crate::run::replay::Frame;
use crate::stats::Tree;
use crate::unit::scanout::Collision;
use crate::work::Surface;

/// The file that is written last.
const STATISTICS: &str = "stats.json";

/// The resolved configuration.
const CONFIGURATION: &str = "config.ron";

/// The report as text, without the host's time.
pub const REPORT: &str = "report.txt";

/// The table of the frames.
const TABLE: &str = "stats.csv";

/// All tables.
const TABLES: [&str; 4] = [TABLE, rows::PASSES, rows::DRAWS, "shown.csv"];

/// Frames that wait to be written. A machine that is faster than the disk waits.
const FRAMES_IN_FLIGHT: usize = 2;

/// A folder that takes frames as they end.
///
/// Each frame's picture is written when the frame comes, unless no pictures are wanted. Statistics grow in `stats.csv.part` and
/// `stats.json.part`, frame by frame, and get their names at the end: a folder that has `stats.json` is complete.
pub struct Folder {
    /// None: the writer has been told the end.
    send: Option<Sender<Leaving>>,
    /// None: the writer has answered.
    writer: Option<JoinHandle<Result<()>>>,
}

/// Which pictures a folder takes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Images {
    /// One for each frame that shows something.
    All,
    /// None: statistics only.
    None,
}

/// What leaves a replay.
enum Leaving {
    Frame(Box<Frame>),
    /// A frame's picture alone.
    Picture(Box<Frame>),
    Total(Box<Tree>, Box<Shown>, String),
}

impl Folder {
    /// A folder, which is made where it is missing. With the first frame it gets the resolved configuration, and the statistics and pictures of an
    /// earlier replay go: they must not be taken for those of this one. A replay without a frame leaves them. With `force`, files of other programs
    /// that are named as those of a replay go too.
    ///
    /// # Errors
    /// If it cannot be made or written to, if another replay writes to it, or without `force` if it has a file that is named as those of a replay and
    /// that no replay has written.
    pub fn create(out: &Path, about: About, config: &str, images: Images, force: bool) -> Result<Folder> {
        let mut owned = Owned::lock(out, is_output, force)?;
        let mut growing = |name| Growing::create(&mut owned, out, name);
        let pages = Pages {
            out: out.to_owned(),
            about,
            config: Some(config.to_owned()),
            frames: false,
            tables: [growing(TABLES[0])?, growing(TABLES[1])?, growing(TABLES[2])?, growing(TABLES[3])?],
            json: growing(STATISTICS)?,
            album: (images == Images::All).then_some(Album { last: None }),
            owned,
        };
        let (send, receive) = channel::bounded(FRAMES_IN_FLIGHT);
        let named = std::thread::Builder::new().name("writer".into());
        let writer = named.spawn(move || pages.write(&receive)).context("cannot start the thread that writes files")?;
        Ok(Folder { send: Some(send), writer: Some(writer) })
    }

    /// A frame has ended.
    ///
    /// # Errors
    /// If this frame's or an earlier one's files cannot be written.
    pub fn put(&mut self, frame: Frame) -> Result<()> {
        self.send(Leaving::Frame(Box::new(frame)))
    }

    /// Takes frames of which the picture alone is wanted, from any thread. The folder must end behind it.
    pub fn pictures(&self) -> impl Fn(Frame) -> Result<()> + Sync + 'static {
        let send = self.send.clone();
        move |frame| {
            let sent = send.as_ref().is_some_and(|send| send.send(Leaving::Picture(Box::new(frame))).is_ok());
            if sent { Ok(()) } else { bail!("the files of an earlier picture cannot be written") }
        }
    }

    /// The replay has failed. Gives why: what the writer stopped on comes first.
    pub fn fail(mut self, error: Error) -> Error {
        self.answer().err().unwrap_or(error)
    }

    /// The replay has ended; `display` is what a free-running display has shown behind the last frame, and `report` the report as text.
    ///
    /// # Errors
    /// If a file cannot be written.
    pub fn end(mut self, total: Tree, display: Shown, report: String) -> Result<()> {
        self.send(Leaving::Total(Box::new(total), Box::new(display), report))?;
        self.answer()
    }

    fn send(&mut self, leaving: Leaving) -> Result<()> {
        let sent = self.send.as_ref().is_some_and(|send| send.send(leaving).is_ok());
        if sent { Ok(()) } else { self.answer() }
    }

    /// Waits for the writer's end.
    fn answer(&mut self) -> Result<()> {
        drop(self.send.take());
        let Some(writer) = self.writer.take() else { return Ok(()) };
        writer.join().map_err(|_| anyhow!("the thread that writes files stopped on an internal error. {OUR_FAULT}"))?
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        // A replay that failed has said why; without a total the writer removes its tables.
        let _ = self.answer();
    }
}

/// Whether a file is named as the pictures of a replay are: `frame-NNNN.png` or `shown-NNNN.png`, of four digits or more.
fn is_picture(name: &str) -> bool {
    let number = name.strip_prefix("frame-").or_else(|| name.strip_prefix("shown-")).and_then(|name| name.strip_suffix(".png"));
    number.is_some_and(|number| number.len() >= 4 && number.bytes().all(|digit| digit.is_ascii_digit()))
}

/// Whether a replay writes files of this name.
fn is_output(name: &str) -> bool {
    let whole = name.strip_suffix(".part").unwrap_or(name);
    is_picture(name) || name == CONFIGURATION || name == REPORT || TABLES.contains(&whole) || whole == STATISTICS
}

/// A file of the folder that grows.
struct Growing {
    path: PathBuf,
    part: PartialFile,
    /// Whether nothing was added yet.
    empty: bool,
}

impl Growing {
    fn create(owned: &mut Owned, out: &Path, name: &str) -> Result<Growing> {
        let path = out.join(name);
        owned.add(&format!("{name}.part"))?;
        let part = PartialFile::create(&path).with_context(|| format!("cannot write {}", path.display()))?;
        Ok(Growing { path, part, empty: true })
    }

    fn add(&mut self, text: &str) -> Result<()> {
        self.empty &= text.is_empty();
        self.part.add(text.as_bytes()).with_context(|| format!("cannot write {}", self.path.display()))
    }
}

/// What the writer writes.
struct Pages {
    out: PathBuf,
    about: About,
    /// The resolved configuration, until it is written.
    config: Option<String>,
    /// Whether there was a frame.
    frames: bool,
    /// The tables.
    tables: [Growing; TABLES.len()],
    /// The frames alone, as `stats.json` will have them: behind the total, which comes last.
    json: Growing,
    /// None: no pictures are wanted.
    album: Option<Album>,
    /// The folder's files. Dropped last: until then no other replay writes there.
    owned: Owned,
}

impl Pages {
    fn write(mut self, receive: &Receiver<Leaving>) -> Result<()> {
        for leaving in receive {
            if let Some(config) = self.config.take() {
                // It is replaced, and until then stays as it is.
                self.owned.add(CONFIGURATION)?;
                self.owned.remove_earlier()?;
                put(&self.out, CONFIGURATION, config.as_bytes())?;
            }
            match leaving {
                Leaving::Frame(frame) => self.frame(&frame)?,
                Leaving::Picture(frame) => self.picture(&frame)?,
                Leaving::Total(total, display, report) => {
                    self.display(&display)?;
                    self.owned.add(REPORT)?;
                    put(&self.out, REPORT, host::printable(&report).as_bytes())?;
                    return self.end(&total);
                }
            }
        }
        // The replay stopped before its end.
        Ok(())
    }

    fn picture(&mut self, frame: &Frame) -> Result<()> {
        let (Some(album), Some((surface, bytes))) = (&mut self.album, &frame.shown) else { return Ok(()) };
        let name = format!("frame-{:04}.png", frame.number);
        self.owned.add(&name)?;
        put(&self.out, &name, album.png(&name, surface, bytes)?)
    }

    fn frame(&mut self, frame: &Frame) -> Result<()> {
        self.picture(frame)?;
        self.display(&frame.display)?;
        let first = !std::mem::replace(&mut self.frames, true);
        for (table, rows) in self.tables.iter_mut().zip([csv_rows, pass_rows, draw_rows]) {
            table.add(&rows(frame, table.empty))?;
        }
        self.json.add(&json_frame(frame, first)?)
    }

    /// What a free-running display has shown: pictures, and rows of the table.
    fn display(&mut self, shown: &Shown) -> Result<()> {
        let table = &mut self.tables[TABLES.len() - 1];
        table.add(&shown_rows(shown, table.empty))?;
        let Some(album) = &mut self.album else { return Ok(()) };
        shown.refreshes.iter().try_for_each(|refresh| {
            let (surface, bytes) = refresh.picture();
            let name = format!("shown-{:04}.png", refresh.number);
            self.owned.add(&name)?;
            put(&self.out, &name, album.png(&name, &surface, &bytes)?)
        })
    }

    fn end(self, total: &Tree) -> Result<()> {
        // What is bound first is dropped last: the list is written when no file changes any more.
        let Pages { mut owned, about, frames, tables, mut json, .. } = self;
        // A table that has no row is none.
        for (table, name) in tables.into_iter().zip(TABLES).filter(|(table, _)| !table.empty) {
            owned.add(name)?;
            table.part.keep().with_context(|| format!("cannot write {}", table.path.display()))?;
        }
        let head = json_head(&about, total)?;
        owned.add(STATISTICS)?;
        host::replace(&json.path, |file| {
            file.write_all(head.as_bytes())?;
            json.part.copy_to(file)?;
            file.write_all(json_end(frames).as_bytes())
        })
        .with_context(|| format!("cannot write {}", json.path.display()))
    }
}

/// Pictures.
struct Album {
    /// What was shown last, and its file: the same again takes no time.
    last: Option<(Surface, Vec<u8>, Vec<u8>)>,
}

impl Album {
    /// The bytes of a file with a picture.
    fn png(&mut self, name: &str, surface: &Surface, bytes: &[u8]) -> Result<&[u8]> {
        let last = match self.last.take() {
            Some(last) if last.0 == *surface && last.1 == bytes => last,
            _ => {
                let image = picture::picture(surface, bytes).map_err(|reason| anyhow!("{name}: {reason}"))?;
                (*surface, bytes.to_vec(), picture::png(&image)?)
            }
        };
        Ok(&self.last.insert(last).2)
    }
}

/// Rows of `shown.csv`: for each refresh the frames that it shows, each from a line on (a line other than 0 is where the picture is torn), and
/// the lines that were dry; for each pair of sprites that meets, the first line. With a head if they are the first.
fn shown_rows(shown: &Shown, first: bool) -> String {
    let mut rows = String::new();
    for refresh in &shown.refreshes {
        for (line, frame) in &refresh.parts {
            rows.push_str(&format!("{},{line},frame,{}\n", refresh.number, frame.frame));
        }
        for (frame, Collision { pair: [low, high], line }) in refresh.collisions() {
            rows.push_str(&format!("{},{line},collision {low}+{high},{frame}\n", refresh.number));
        }
    }
    for (refresh, line) in &shown.dry {
        rows.push_str(&format!("{refresh},{line},dry,\n"));
    }
    if first && !rows.is_empty() { format!("refresh,line,what,frame\n{rows}") } else { rows }
}

/// Writes a file into a folder: complete under its name, or not there.
fn put(out: &Path, name: &str, bytes: &[u8]) -> Result<()> {
    let path = out.join(name);
    host::write_file(&path, bytes).with_context(|| format!("cannot write {}", path.display()))
}
