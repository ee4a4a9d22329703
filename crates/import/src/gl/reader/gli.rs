//! Recordings of GLInterceptor: one call a line, and a memory file beside it.
//!
//! The first line is `GLI0.t` (numbers in decimal) or `GLI0.h` (floats as the hexadecimal digits of their bits). What follows is
//! `name(arguments)` or `name(arguments)=result`; `#` begins a comment.

use std::rc::Rc;

use num::{Limits, NameMap, NumberMap};

use crate::gl::call::{Arg, Call, Function, Scalar, core_name, shape};
use crate::gl::names;
use crate::gl::reader::chunks::{Chunks, Input, ReadError, Stop};

/// Maximum number of bytes of one call.
const CALL_MAX: usize = 64 << 20;
/// Functions that take floats, or doubles, and whose names have no type suffix.
const FLOATS: &[&str] = &[
    "ClearColor",
    "ClearAccum",
    "ClearDepth",
    "ClearIndex",
    "Ortho",
    "Frustum",
    "DepthRange",
    "PolygonOffset",
    "LineWidth",
    "PointSize",
    "AlphaFunc",
    "SampleCoverage",
    "PixelZoom",
    "PassThrough",
    "Accum",
    "BlendColor",
    "Bitmap",
    "ClipPlane",
];

/// The bytes that calls point to.
#[derive(Default)]
pub struct Memory {
    blobs: NumberMap<u64, Rc<[u8]>>,
}

impl Memory {
    /// Reads the two files: `BufferDescriptors.dat` has records of four u32 (number, address, size, region), `MemoryRegions.dat` has
    /// regions (number, address, size, bytes).
    pub fn parse(descriptors: &[u8], regions: &[u8]) -> Result<Memory, String> {
        let word = |bytes: &[u8], at: usize| bytes.get(at..at + 4).map(|b| u32::from_le_bytes([b[0], b[1], b[2], b[3]]));
        let mut by_number = NumberMap::new();
        let mut at = 0;
        while at < regions.len() {
            let header = (word(regions, at), word(regions, at + 4), word(regions, at + 8));
            let (Some(number), Some(address), Some(size)) = header else {
                return Err(format!("the memory file ends inside the header of a region, at byte {at}"));
            };
            let (start, end) = (at + 12, at + 12 + size as usize);
            let Some(bytes) = regions.get(start..end) else {
                return Err(format!("region {number} has {size} bytes, the memory file ends after {}", regions.len() - start));
            };
            by_number.insert(number, (address, bytes));
            at = end;
        }
        if !descriptors.len().is_multiple_of(16) {
            return Err(format!("the file of descriptors has {} bytes, no multiple of 16", descriptors.len()));
        }
        let mut blobs = NumberMap::new();
        // Several descriptors may refer to the same bytes.
        let mut shared = NumberMap::<(u32, u32), NumberMap<u32, Rc<[u8]>>>::new();
        for record in descriptors.chunks_exact(16) {
            let [id, address, size, region] = std::array::from_fn(|k| word(record, 4 * k).unwrap_or(0));
            let Some(&(base, bytes)) = by_number.get(region) else {
                return Err(format!("buffer {id} is in region {region}, which is not there"));
            };
            let start = address.wrapping_sub(base) as usize;
            let Some(part) = bytes.get(start..start.saturating_add(size as usize)) else {
                return Err(format!("buffer {id} reaches out of region {region}"));
            };
            let part = shared.get_or_insert_with((region, address), NumberMap::new).get_or_insert_with(size, || part.into());
            blobs.insert(u64::from(id), part.clone());
        }
        Ok(Memory { blobs })
    }
}

/// Reads calls one at a time.
pub struct GliText {
    bytes: Chunks,
    memory: Memory,
    hexadecimal: bool,
    functions: NameMap<Rc<Function>>,
    next: u64,
    line: u64,
    /// The size of the window, where a comment states it.
    pub window: Option<[u32; 2]>,
    /// See [`super::Reader::cut`].
    pub cut: Option<ReadError>,
}

impl GliText {
    /// Reads the first line; `start` is the file's first two bytes, which have been read.
    pub fn open(file: Input, start: [u8; 2], memory: Memory, limits: &Limits) -> Result<GliText, ReadError> {
        let bytes = Chunks::text(file, start, limits);
        let functions = NameMap::new();
        let mut reader = GliText { bytes, memory, hexadecimal: false, functions, next: 0, line: 0, window: None, cut: None };
        let first = reader.line().map_err(|stop| reader.broken(stop))?.unwrap_or_default();
        match first.trim_end() {
            "GLI0.t" => {}
            "GLI0.h" => reader.hexadecimal = true,
            _ => return Err(reader.broken(Stop::broken("does not begin with GLI0.t or GLI0.h"))),
        }
        Ok(reader)
    }

    fn broken(&self, stop: Stop) -> ReadError {
        let reason = match stop {
            Stop::End => "the recording ends inside a call".into(),
            Stop::ReadError(failure) => failure.reason,
        };
        ReadError { call: self.next, place: self.line, reason }
    }

    /// A line with its end; none at the end of the text.
    fn line(&mut self) -> Result<Option<String>, Stop> {
        let mut line = Vec::new();
        loop {
            match self.bytes.line(&mut line) {
                Ok(true) => break,
                Ok(false) => {}
                Err(Stop::End) if line.is_empty() => return Ok(None),
                Err(Stop::End) => break,
                Err(stop) => return Err(stop),
            }
            if line.len() > CALL_MAX {
                return Err(Stop::broken(format!("a line of more than {CALL_MAX} bytes")));
            }
        }
        self.line += 1;
        Ok(Some(String::from_utf8_lossy(&line).into_owned()))
    }

    /// The next call; none at the end of the text.
    pub fn next(&mut self) -> Result<Option<Call>, ReadError> {
        if self.cut.is_some() {
            return Ok(None);
        }
        match self.step() {
            Ok(call) => Ok(call),
            Err(Stop::ReadError(failure)) if !failure.cut => Err(self.broken(Stop::ReadError(failure))),
            Err(stop) => {
                self.cut = Some(self.broken(stop));
                Ok(None)
            }
        }
    }

    fn step(&mut self) -> Result<Option<Call>, Stop> {
        loop {
            let Some(mut text) = self.line()? else { return Ok(None) };
            let place = self.line;
            if let Some(size) = text.trim_start().strip_prefix("#!") {
                self.directive(size);
                continue;
            }
            if text.trim().is_empty() || text.trim_start().starts_with('#') {
                continue;
            }
            // A program's text spans lines.
            let mut open = opens(&text);
            while open {
                let line = self.line()?.ok_or(Stop::End)?;
                open ^= opens(&line);
                text.push_str(&line);
                if text.len() > CALL_MAX {
                    return Err(Stop::broken(format!("a call of more than {CALL_MAX} bytes")));
                }
            }
            // Each line has an end but one where the text is cut.
            let wrong = |reason| if text.ends_with('\n') { Stop::broken(reason) } else { Stop::cut(reason) };
            let call = self.call(text.trim(), place).map_err(wrong)?;
            self.next += 1;
            return Ok(Some(call));
        }
    }

    /// `#! RES 384x364`
    fn directive(&mut self, text: &str) {
        let size = text.trim().strip_prefix("RES").and_then(|size| size.trim().split_once('x'));
        let parsed = size.and_then(|(w, h)| Some([w.trim().parse().ok()?, h.trim().parse().ok()?]));
        self.window = parsed.filter(|size: &[u32; 2]| size.iter().all(|&edge| edge > 0)).or(self.window);
    }

    fn call(&mut self, text: &str, place: u64) -> Result<Call, String> {
        let Some((name, rest)) = text.split_once('(') else { return Err(format!("no call: {:?}", start(text))) };
        let name = name.trim();
        let plain = |c: char| c.is_ascii_alphanumeric() || c == '_';
        if name.is_empty() || name.len() > 128 || !name.chars().all(plain) {
            return Err(format!("no name of a function: {:?}", start(name)));
        }
        let function = match self.functions.get(name) {
            Some(function) => function.clone(),
            None => {
                let function = Rc::new(Function { id: self.functions.len() as u32, name: name.into() });
                self.functions.insert(name, function.clone());
                function
            }
        };
        let floats = self.hexadecimal && takes_floats(name);
        let mut tokens = Tokens { text: rest, floats, memory: &self.memory };
        let args = tokens.list(')').map_err(|reason| format!("{name}: {reason}"))?;
        let result = tokens
            .text
            .trim_start()
            .strip_prefix('=')
            .map_or(Arg::Null, |text| number(text.trim(), false).unwrap_or(Arg::Null));
        Ok(Call { number: self.next, place, thread: 0, function, args, result })
    }
}

/// Whether a line has one quote more that opens than quotes that close, or one less.
fn opens(line: &str) -> bool {
    line.bytes().filter(|&byte| byte == b'"').count() % 2 == 1
}

/// The start of a text, for a message.
fn start(text: &str) -> &str {
    const MOST: usize = 60;
    text.char_indices().nth(MOST).map_or(text, |(end, _)| &text[..end])
}

/// Whether hexadecimal arguments of a function are the bits of floats.
fn takes_floats(name: &str) -> bool {
    let Some(core) = core_name(name) else { return false };
    let typed = shape(core).is_some_and(|(_, shape)| matches!(shape.scalar, Scalar::Float | Scalar::Double));
    typed || FLOATS.contains(&core)
}

/// The remaining text of a call's arguments.
struct Tokens<'a> {
    text: &'a str,
    floats: bool,
    memory: &'a Memory,
}

impl Tokens<'_> {
    /// Arguments up to a closing bracket.
    fn list(&mut self, close: char) -> Result<Vec<Arg>, String> {
        let mut list = Vec::new();
        loop {
            self.text = self.text.trim_start();
            if let Some(rest) = self.text.strip_prefix(close) {
                self.text = rest;
                return Ok(list);
            }
            let value = self.value()?;
            list.push(value);
            self.text = self.text.trim_start();
            if let Some(rest) = self.text.strip_prefix(',') {
                self.text = rest;
            } else if !self.text.starts_with(close) {
                return Err(format!("no `,` or `{close}` after argument {}", list.len() - 1));
            }
        }
    }

    fn value(&mut self) -> Result<Arg, String> {
        if let Some(rest) = self.text.strip_prefix('"') {
            let (text, rest) = rest.split_once('"').ok_or("text without an end")?;
            self.text = rest;
            return Ok(Arg::Str(text.into()));
        }
        if let Some(rest) = self.text.strip_prefix('{') {
            // Nested arrays do not occur.
            self.text = rest;
            let end = rest.find('}').ok_or("an array without an end")?;
            let numbers = rest[..end].split(',').map(str::trim).filter(|text| !text.is_empty());
            let numbers: Result<Vec<f64>, String> = numbers
                .map(|text| match number(text, self.floats) {
                    Some(Arg::Num(number)) => Ok(number),
                    _ => Err(format!("{:?} in an array is no number", start(text))),
                })
                .collect();
            self.text = &rest[end + 1..];
            return Ok(Arg::Nums(numbers?.into()));
        }
        let end = self.text.find([',', ')']).ok_or("arguments without an end")?;
        let (word, rest) = (self.text[..end].trim(), &self.text[end..]);
        self.text = rest;
        if let Some(id) = word.strip_prefix('*') {
            let id: u64 = id.parse().map_err(|_| format!("{:?} is no number of a buffer", start(word)))?;
            return self
                .memory
                .blobs
                .get(id)
                .map(|bytes| Arg::Blob(bytes.clone()))
                .ok_or_else(|| format!("there is no buffer {id}"));
        }
        if word.starts_with('U') {
            // A pointer to data that was not recorded.
            return Ok(Arg::Null);
        }
        number(word, self.floats).ok_or_else(|| format!("{:?} is no argument", start(word)))
    }
}

/// A number, or names of enumerants joined by `|`.
fn number(text: &str, floats: bool) -> Option<Arg> {
    if let Some((low, high)) = text.split_once('.').filter(|(low, high)| low.starts_with("0x") && high.starts_with("0x")) {
        let bits = u64::from(hexadecimal(low)?) | u64::from(hexadecimal(high)?) << 32;
        return Some(Arg::Num(f64::from_bits(bits)));
    }
    if let Some(digits) = text.strip_prefix("0x") {
        let bits = u64::from_str_radix(digits, 16).ok()?;
        let float = u32::try_from(bits).ok().filter(|_| floats).map(|bits| f64::from(f32::from_bits(bits)));
        return Some(Arg::Num(float.unwrap_or(bits as f64)));
    }
    if let Ok(number) = text.parse() {
        return Some(Arg::Num(number));
    }
    // The text that Windows prints for NaN and infinity.
    if let Some(rest) = text.trim_start_matches('-').strip_prefix("1.#") {
        let infinite = if text.starts_with('-') { f64::NEG_INFINITY } else { f64::INFINITY };
        return Some(Arg::Num(if rest.starts_with("INF") { infinite } else { f64::NAN }));
    }
    let bits = text.split('|').map(|name| names::value(name.trim())).try_fold(0, |all, value| Some(all | value?))?;
    Some(Arg::Num(f64::from(bits)))
}

fn hexadecimal(text: &str) -> Option<u32> {
    u32::from_str_radix(text.strip_prefix("0x")?, 16).ok()
}
