//! The folder that a replay leaves: pictures and statistics, written beside the machine as frames end.

use std::io::{ErrorKind, Write};
use std::path::{Path, PathBuf};
use std::thread::JoinHandle;

use anyhow::{Context, Error, Result, anyhow, bail};
use crossbeam::channel::{self, Receiver, Sender};

use super::files::{About, json_head};
use crate::host::{self, Part};
use crate::machine::Shown;
use crate::picture;
use crate::rows::{self, csv_rows, draw_rows, json_end, json_frame, pass_rows};
use crate::run::replay::Frame;
use crate::stats::Tree;
use crate::unit::scanout::Collision;
use crate::work::Surface;

/// The file that is written last.
const STATISTICS: &str = "stats.json";

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
    Total(Box<Tree>, Box<Shown>),
}

impl Folder {
    /// A folder, which is made where it is missing. With the first frame it gets the resolved configuration, and the statistics and pictures of an
    /// earlier replay go: they must not be taken for those of this one. A replay without a frame leaves them.
    ///
    /// # Errors
    /// If it cannot be made or written to.
    pub fn create(out: &Path, about: About, config: &str, images: Images) -> Result<Folder> {
        std::fs::create_dir_all(out).with_context(|| format!("cannot create {}", out.display()))?;
        let pages = Pages {
            out: out.to_owned(),
            about,
            config: Some(config.to_owned()),
            frames: false,
            tables: [
                Growing::create(out, TABLES[0])?,
                Growing::create(out, TABLES[1])?,
                Growing::create(out, TABLES[2])?,
                Growing::create(out, TABLES[3])?,
            ],
            json: Growing::create(out, STATISTICS)?,
            album: (images == Images::All).then(|| Album { out: out.to_owned(), last: None }),
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

    /// The replay has ended; `display` is what a free-running display has shown behind the last frame.
    ///
    /// # Errors
    /// If a file cannot be written.
    pub fn end(mut self, total: Tree, display: Shown) -> Result<()> {
        self.send(Leaving::Total(Box::new(total), Box::new(display)))?;
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
        writer.join().map_err(|_| anyhow!("the thread that writes files stopped on an internal error"))?
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

/// Removes what an earlier replay left.
fn remove_earlier(out: &Path) -> Result<()> {
    let pictures = std::fs::read_dir(out).with_context(|| format!("cannot read {}", out.display()))?;
    let pictures = pictures.filter_map(|entry| entry.ok()?.file_name().into_string().ok()).filter(|name| is_picture(name));
    for name in TABLES.into_iter().chain([STATISTICS]).map(str::to_owned).chain(pictures) {
        let path = out.join(name);
        match std::fs::remove_file(&path) {
            Err(error) if error.kind() != ErrorKind::NotFound => {
                return Err(error).with_context(|| format!("cannot replace {}", path.display()));
            }
            _ => {}
        }
    }
    Ok(())
}

/// A file of the folder that grows.
struct Growing {
    path: PathBuf,
    part: Part,
    /// Whether nothing was added yet.
    empty: bool,
}

impl Growing {
    fn create(out: &Path, name: &str) -> Result<Growing> {
        let path = out.join(name);
        let part = Part::create(&path).with_context(|| format!("cannot write {}", path.display()))?;
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
}

impl Pages {
    fn write(mut self, receive: &Receiver<Leaving>) -> Result<()> {
        for leaving in receive {
            if let Some(config) = self.config.take() {
                remove_earlier(&self.out)?;
                put(&self.out, "config.ron", config.as_bytes())?;
            }
            match leaving {
                Leaving::Frame(frame) => self.frame(&frame)?,
                Leaving::Picture(frame) => self.picture(&frame)?,
                Leaving::Total(total, display) => {
                    self.display(&display)?;
                    return self.end(&total);
                }
            }
        }
        // The replay stopped before its end.
        Ok(())
    }

    fn picture(&mut self, frame: &Frame) -> Result<()> {
        let (Some(album), Some((surface, bytes))) = (&mut self.album, &frame.shown) else { return Ok(()) };
        album.put("frame", frame.number.into(), surface, bytes)
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
            album.put("shown", refresh.number, &surface, &bytes)
        })
    }

    fn end(self, total: &Tree) -> Result<()> {
        let Pages { about, frames, tables, mut json, .. } = self;
        // A table that has no row is none.
        for table in tables.into_iter().filter(|table| !table.empty) {
            table.part.keep().with_context(|| format!("cannot write {}", table.path.display()))?;
        }
        let head = json_head(&about, total)?;
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
    out: PathBuf,
    /// What was shown last, and its file: the same again takes no time.
    last: Option<(Surface, Vec<u8>, Vec<u8>)>,
}

impl Album {
    fn put(&mut self, what: &str, number: u64, surface: &Surface, bytes: &[u8]) -> Result<()> {
        let again = |(shown, known, _): &(Surface, Vec<u8>, Vec<u8>)| shown == surface && known == bytes;
        if !self.last.as_ref().is_some_and(again) {
            let image = picture::picture(surface, bytes).map_err(|reason| anyhow!("{what} {number}: {reason}"))?;
            self.last = Some((*surface, bytes.to_vec(), picture::png(&image)?));
        }
        let Some((.., png)) = &self.last else { return Ok(()) };
        put(&self.out, &format!("{what}-{number:04}.png"), png)
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
