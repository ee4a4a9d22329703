//! Recordings of apitrace: the container, and the events in it. Versions 1 to 6.
//!
//! The stream has *enter* events, with a call's function and arguments, and *leave* events, with its outputs. A call is returned at its
//! leave event, as in apitrace's own player.

use std::rc::Rc;

use num::{Limits, NumberMap};

use crate::gl::call::{Arg, Call, Function};
use crate::gl::reader::chunks::{Chunks, Input, ReadError, Stop};

/// The newest version that is read.
const VERSION_MAX: u64 = 6;
/// Maximum nesting depth of arrays and structures.
const NESTING_MAX: u32 = 32;
/// Maximum number of elements of an array; bulk data are blobs.
const ELEMENTS_MAX: u64 = 1 << 24;
/// Maximum number of calls that are entered and not left: normally one for each thread of the program.
const OPEN_MAX: usize = 4096;
/// Maximum numbers of signatures of one kind, and of arguments of a function.
const SIGNATURES_MAX: u64 = 1 << 20;
const ARGUMENTS_MAX: u64 = 1 << 10;

/// Reads calls one at a time.
pub struct Apitrace {
    bytes: Chunks,
    version: u64,
    functions: Table<(Rc<Function>, u32)>,
    /// Old enumerants have their value in the signature.
    enums: Table<f64>,
    bitmasks: Table<()>,
    /// Members of structures.
    structs: Table<u64>,
    frames: Table<()>,
    /// The call that was entered last, if it has not been left.
    last: Option<Call>,
    /// Earlier calls that have not been left.
    open: NumberMap<u64, Call>,
    /// Memory for reuse: argument lists of finished calls, and arrays by their length.
    spare: Vec<Vec<Arg>>,
    spare_arrays: [Option<Rc<[f64]>>; FEW + 1],
    next: u64,
    /// The number of the call whose event is read.
    current: u64,
    ended: bool,
    /// See [`super::Reader::cut`].
    pub cut: Option<ReadError>,
}

/// Maximum number of argument lists kept for reuse.
const SPARE_MAX: usize = 8;
/// Arrays up to this length (vectors and matrices) are read at once.
const FEW: usize = 16;

/// Signatures by their number. apitrace numbers them from 0; only a damaged recording has large numbers.
struct Table<T> {
    small: Vec<Option<T>>,
    large: NumberMap<u64, T>,
    count: u64,
}

/// Signature numbers below this are stored in `small`.
const SMALL: u64 = 1 << 14;

impl<T> Default for Table<T> {
    fn default() -> Self {
        Table { small: Vec::new(), large: NumberMap::new(), count: 0 }
    }
}

impl<T: Clone> Table<T> {
    #[inline]
    fn get(&self, id: u64) -> Option<&T> {
        match self.small.get(id as usize) {
            Some(place) if id < SMALL => place.as_ref(),
            _ => self.large.get(id),
        }
    }

    fn insert(&mut self, id: u64, value: T) -> Result<T, Stop> {
        if self.count >= SIGNATURES_MAX {
            return broken(format!("more than {SIGNATURES_MAX} signatures"));
        }
        self.count += 1;
        if id < SMALL {
            if self.small.len() <= id as usize {
                self.small.resize(id as usize + 1, None);
            }
            self.small[id as usize] = Some(value.clone());
        } else {
            self.large.insert(id, value.clone());
        }
        Ok(value)
    }
}

fn broken<T>(reason: impl Into<String>) -> Result<T, Stop> {
    Err(Stop::broken(reason))
}

impl Apitrace {
    /// Reads the header; `start` is the file's first two bytes, which have been read.
    pub fn open(file: Input, start: [u8; 2], limits: &Limits) -> Result<Apitrace, ReadError> {
        let bytes = Chunks::apitrace(file, start, limits);
        let mut reader = Apitrace {
            bytes,
            version: 0,
            functions: Table::default(),
            enums: Table::default(),
            bitmasks: Table::default(),
            structs: Table::default(),
            frames: Table::default(),
            last: None,
            open: NumberMap::new(),
            spare: Vec::new(),
            spare_arrays: [const { None }; FEW + 1],
            next: 0,
            current: 0,
            ended: false,
            cut: None,
        };
        match reader.header() {
            Ok(()) => Ok(reader),
            Err(stop) => Err(reader.broken(stop)),
        }
    }

    fn broken(&self, stop: Stop) -> ReadError {
        let reason = match stop {
            Stop::End => "the recording ends inside a call or its header".into(),
            Stop::ReadError(failure) => failure.reason,
        };
        ReadError { call: self.current, place: self.bytes.offset(), reason }
    }

    fn header(&mut self) -> Result<(), Stop> {
        self.version = self.uint()?;
        if !(1..=VERSION_MAX).contains(&self.version) {
            return broken(format!("apitrace container of version {}, versions 1 to {VERSION_MAX} are read", self.version));
        }
        if self.version >= 6 {
            let _semantic = self.uint()?;
            while !self.string()?.is_empty() {
                self.string()?;
            }
        }
        Ok(())
    }

    /// The next call; none at the end of the recording.
    pub fn next(&mut self) -> Result<Option<Call>, ReadError> {
        match self.step() {
            Ok(call) => Ok(call),
            Err(Stop::ReadError(failure)) if !failure.cut => Err(self.broken(Stop::ReadError(failure))),
            Err(stop) => {
                // A call that was not entered as a whole is not run.
                self.cut = Some(self.broken(stop));
                self.ended = true;
                Ok(self.unreturned())
            }
        }
    }

    /// The first call that was entered and not left.
    fn unreturned(&mut self) -> Option<Call> {
        let first = self.open.keys().next();
        first.and_then(|number| self.open.remove(number)).or_else(|| self.last.take())
    }

    fn step(&mut self) -> Result<Option<Call>, Stop> {
        while !self.ended {
            let place = self.bytes.offset();
            match self.bytes.byte() {
                Ok(0) => self.enter(place)?,
                Ok(1) => {
                    let number = self.uint()?;
                    self.current = number;
                    let last = self.last.take_if(|call| call.number == number);
                    let Some(mut call) = last.or_else(|| self.open.remove(number)) else {
                        return broken(format!("call {number} is left, but was not entered"));
                    };
                    if let Err(stop) = self.details(&mut call) {
                        // Where the end is cut, it has been entered at least.
                        self.open.insert(number, call);
                        return Err(stop);
                    }
                    return Ok(Some(call));
                }
                Ok(other) => return broken(format!("an event of kind {other}")),
                Err(Stop::End) => self.ended = true,
                Err(stop) => return Err(stop),
            }
        }
        let call = self.unreturned();
        if let (Some(call), None) = (&call, &self.cut) {
            let reason = format!("the program ended inside this call of {}", call.function.name);
            self.cut = Some(ReadError { call: call.number, place: call.place, reason });
        }
        Ok(call)
    }

    /// Takes back a call that has run, to reuse the memory of its arguments.
    pub fn done(&mut self, call: Call) {
        if self.spare.len() < SPARE_MAX {
            let mut args = call.args;
            for arg in args.drain(..) {
                if let Arg::Nums(numbers) = arg
                    && let Some(room) = self.spare_arrays.get_mut(numbers.len())
                    && Rc::strong_count(&numbers) == 1
                {
                    *room = Some(numbers);
                }
            }
            self.spare.push(args);
        }
    }

    fn enter(&mut self, place: u64) -> Result<(), Stop> {
        let number = self.next;
        self.next += 1;
        self.current = number;
        let thread = if self.version >= 4 { self.uint()? as u32 } else { 0 };
        let id = self.uint()?;
        let (function, count) = match self.functions.get(id) {
            Some((function, count)) => (function.clone(), *count),
            None => {
                let name = self.string()?;
                let count = self.uint()?;
                if count > ARGUMENTS_MAX {
                    return broken(format!("function {name:?} with {count} arguments"));
                }
                for _ in 0..count {
                    self.string()?;
                }
                let function = Rc::new(Function { id: self.functions.count as u32, name: name.into() });
                self.functions.insert(id, (function, count as u32))?
            }
        };
        let mut args = self.spare.pop().unwrap_or_default();
        args.resize_with(count as usize, || Arg::Null);
        let mut call = Call { number, place, thread, function, args, result: Arg::Null };
        self.details(&mut call)?;
        if let Some(before) = self.last.replace(call) {
            // Another thread's call, or one within a call.
            if self.open.len() >= OPEN_MAX {
                return broken(format!("more than {OPEN_MAX} calls are entered and not left"));
            }
            self.open.insert(before.number, before);
        }
        Ok(())
    }

    fn details(&mut self, call: &mut Call) -> Result<(), Stop> {
        loop {
            match self.bytes.byte()? {
                0 => return Ok(()),
                1 => {
                    let index = self.uint()?;
                    let value = match self.number_here() {
                        Some(number) => Arg::Num(number),
                        None => self.value(0)?,
                    };
                    match call.args.get_mut(index as usize) {
                        Some(place) => *place = value,
                        None => return broken(format!("{} has no argument {index}", call.function.name)),
                    }
                }
                2 => call.result = self.value(0)?,
                3 => call.thread = self.uint()? as u32,
                5 => {
                    // Flags.
                    self.uint()?;
                }
                4 => {
                    for _ in 0..self.uint()? {
                        self.frame()?;
                    }
                }
                other => return broken(format!("a detail of kind {other} in {}", call.function.name)),
            }
        }
    }

    /// A frame of a backtrace.
    fn frame(&mut self) -> Result<(), Stop> {
        let id = self.uint()?;
        if self.frames.get(id).is_some() {
            return Ok(());
        }
        loop {
            match self.bytes.byte()? {
                0 => return self.frames.insert(id, ()),
                1..=3 => drop(self.string()?),
                4 | 5 => drop(self.uint()?),
                other => return broken(format!("a backtrace with a part of kind {other}")),
            }
        }
    }

    /// A number of the most frequent kinds, if all its bytes are in the current piece.
    #[inline(always)]
    fn number_here(&mut self) -> Option<f64> {
        let (number, bytes) = match *self.bytes.here() {
            [5, a, b, c, d, ..] => (f64::from(f32::from_le_bytes([a, b, c, d])), 5),
            [4, small, ..] if small < 0x80 => (f64::from(small), 2),
            [6, a, b, c, d, e, f, g, h, ..] => (f64::from_le_bytes([a, b, c, d, e, f, g, h]), 9),
            _ => return None,
        };
        self.bytes.pass(bytes);
        Some(number)
    }

    fn value(&mut self, depth: u32) -> Result<Arg, Stop> {
        if depth > NESTING_MAX {
            return broken(format!("values nested more than {NESTING_MAX} deep"));
        }
        let kind = self.bytes.byte()?;
        self.value_of(kind, depth)
    }

    fn value_of(&mut self, kind: u8, depth: u32) -> Result<Arg, Stop> {
        Ok(match kind {
            0 => Arg::Null,
            1 => Arg::Num(0.0),
            2 => Arg::Num(1.0),
            3 => Arg::Num(-(self.uint()? as f64)),
            4 => Arg::Num(self.uint()? as f64),
            5 => Arg::Num(f64::from(f32::from_le_bytes(self.bytes.array()?))),
            6 => Arg::Num(f64::from_le_bytes(self.bytes.array()?)),
            7 => Arg::Str(self.string()?.into()),
            8 => {
                let length = self.uint()?;
                Arg::Blob(self.bytes.bytes(length)?)
            }
            9 => Arg::Num(self.enumerant()?),
            10 => {
                self.bitmask()?;
                Arg::Num(self.uint()? as f64)
            }
            11 => self.array(depth)?,
            12 => {
                let members = self.structure()?;
                let mut values = Vec::new();
                for _ in 0..members {
                    values.push(self.value(depth + 1)?);
                }
                Arg::List(values.into())
            }
            13 => Arg::Pointer(self.uint()?),
            14 => {
                let _human = self.value(depth + 1)?;
                self.value(depth + 1)?
            }
            15 => {
                let length = self.uint()?;
                self.bytes.allow(length)?;
                let mut text = String::new();
                for _ in 0..length {
                    text.push(u32::try_from(self.uint()?).ok().and_then(char::from_u32).unwrap_or('\u{fffd}'));
                }
                Arg::Str(text.into())
            }
            other => return broken(format!("a value of kind {other}")),
        })
    }

    /// An array: of numbers if all are numbers.
    fn array(&mut self, depth: u32) -> Result<Arg, Stop> {
        let length = self.uint()?;
        self.bytes.allow(length)?;
        if length > ELEMENTS_MAX {
            return broken(format!("an array of {length} elements"));
        }
        // Most are vectors and matrices.
        if length <= FEW as u64 && depth == 0 {
            let mut numbers = [0.0; FEW];
            let mut known = 0;
            for place in &mut numbers[..length as usize] {
                *place = match self.number_here() {
                    Some(number) => number,
                    None => match self.value(depth + 1)? {
                        Arg::Num(number) => number,
                        other => return self.rest_of_array(&numbers[..known], other, length, depth),
                    },
                };
                known += 1;
            }
            let numbers = &numbers[..known];
            if let Some(mut room) = self.spare_arrays[known].take()
                && let Some(place) = Rc::get_mut(&mut room)
            {
                place.copy_from_slice(numbers);
                return Ok(Arg::Nums(room));
            }
            return Ok(Arg::Nums(numbers.into()));
        }
        let mut numbers = Vec::new();
        for _ in 0..length {
            if let Some(number) = self.number_here() {
                numbers.push(number);
                continue;
            }
            match self.value(depth + 1)? {
                Arg::Num(number) => numbers.push(number),
                other => return self.rest_of_array(&numbers, other, length, depth),
            }
        }
        Ok(Arg::Nums(numbers.into()))
    }

    /// An array with a value that is not a number: the numbers before it, the value, and the rest.
    #[cold]
    fn rest_of_array(&mut self, numbers: &[f64], other: Arg, length: u64, depth: u32) -> Result<Arg, Stop> {
        let mut list: Vec<Arg> = numbers.iter().copied().map(Arg::Num).collect();
        list.push(other);
        while (list.len() as u64) < length {
            list.push(self.value(depth + 1)?);
        }
        Ok(Arg::List(list.into()))
    }

    fn enumerant(&mut self) -> Result<f64, Stop> {
        let id = self.uint()?;
        if self.version < 3 {
            // Each name is a signature of its own.
            return match self.enums.get(id) {
                Some(&value) => Ok(value),
                None => {
                    self.string()?;
                    let value = self.sint()?;
                    self.enums.insert(id, value)
                }
            };
        }
        if self.enums.get(id).is_none() {
            for _ in 0..self.uint()? {
                self.string()?;
                self.sint()?;
            }
            self.enums.insert(id, 0.0)?;
        }
        self.sint()
    }

    fn bitmask(&mut self) -> Result<(), Stop> {
        let id = self.uint()?;
        if self.bitmasks.get(id).is_none() {
            for _ in 0..self.uint()? {
                self.string()?;
                self.uint()?;
            }
            self.bitmasks.insert(id, ())?;
        }
        Ok(())
    }

    fn structure(&mut self) -> Result<u64, Stop> {
        let id = self.uint()?;
        if let Some(&members) = self.structs.get(id) {
            return Ok(members);
        }
        let name = self.string()?;
        let members = self.uint()?;
        if members > ARGUMENTS_MAX {
            return broken(format!("structure {name:?} with {members} members"));
        }
        for _ in 0..members {
            self.string()?;
        }
        self.structs.insert(id, members)
    }

    /// An integer of 7 bits per byte, low bits first.
    #[inline(always)]
    fn uint(&mut self) -> Result<u64, Stop> {
        let byte = self.bytes.byte()?;
        if byte & 0x80 == 0 { Ok(u64::from(byte)) } else { self.long_uint(byte) }
    }

    /// An integer of several bytes, of which the first has been read.
    fn long_uint(&mut self, first: u8) -> Result<u64, Stop> {
        let mut value = u64::from(first & 0x7f);
        let mut shift = 7;
        loop {
            let byte = self.bytes.byte()?;
            let bits = u64::from(byte & 0x7f);
            if shift >= 64 || (bits << shift) >> shift != bits {
                return broken("a number of more than 64 bits");
            }
            value |= bits << shift;
            if byte & 0x80 == 0 {
                return Ok(value);
            }
            shift += 7;
        }
    }

    fn sint(&mut self) -> Result<f64, Stop> {
        match self.bytes.byte()? {
            3 => Ok(-(self.uint()? as f64)),
            4 => Ok(self.uint()? as f64),
            other => broken(format!("an enumerant with a value of kind {other}")),
        }
    }

    fn string(&mut self) -> Result<String, Stop> {
        let length = self.uint()?;
        let bytes = self.bytes.bytes(length)?;
        Ok(String::from_utf8_lossy(&bytes).into_owned())
    }
}
