//! The reader: header, blocks, compression, meta commands.

use crate::block::*;
use crate::decode;
use crate::error::{Cause, Error, Fault};
use crate::layout::layout;
use std::io::{BufReader, ErrorKind, Read};

/// The most bytes that a reader takes into memory at once.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Limits {
    /// The most bytes of a block as the file has it.
    pub block: u64,
    /// The most bytes of the data of a block after decompression.
    pub data: u64,
}

impl Default for Limits {
    /// 2 GiB each.
    fn default() -> Self {
        Limits { block: 2 << 30, data: 2 << 30 }
    }
}

/// The place where a capture ends within a block.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Cut {
    /// The byte of the file at which the block begins.
    pub offset: u64,
    /// The bytes of the block that are there, with its size and type.
    pub found: u64,
}

/// Reads a capture block by block. It holds one block in memory.
///
/// A block that is damaged within gives an error, and the next call goes on with the block after it.
#[derive(Debug)]
pub struct Reader<R> {
    input: BufReader<R>,
    header: Header,
    limits: Limits,
    index: u64,
    offset: u64,
    buffer: Vec<u8>,
    cut: Option<Cut>,
    /// The file cannot be read on.
    done: bool,
}

impl<R: Read> Reader<R> {
    /// Reads the header.
    pub fn new(input: R) -> Result<Self, Error> {
        let mut input = BufReader::with_capacity(1 << 16, input);
        let mut offset = 0;
        let header = header(&mut input, &mut offset).map_err(|cause| Error {
            block: None,
            offset,
            name: None,
            member: String::new(),
            cause,
        })?;
        Ok(Reader { input, header, limits: Limits::default(), index: 0, offset, buffer: Vec::new(), cut: None, done: false })
    }

    /// With other limits.
    pub fn with_limits(self, limits: Limits) -> Self {
        Reader { limits, ..self }
    }

    /// The header.
    pub fn header(&self) -> &Header {
        &self.header
    }

    /// The place at which the capture ends within a block. It is known once the reader has come there, and None for a whole capture.
    pub fn cut(&self) -> Option<Cut> {
        self.cut
    }

    /// The byte of the file at which the next block begins.
    pub fn position(&self) -> u64 {
        self.offset
    }

    /// The input, and how many bytes are held.
    #[cfg(test)]
    pub(crate) fn state(&self) -> (&R, usize) {
        (self.input.get_ref(), self.buffer.capacity())
    }

    /// The next block. None at the end of the capture.
    pub fn next_block(&mut self) -> Result<Option<Block>, Error> {
        if self.done {
            return Ok(None);
        }
        let (index, offset) = (self.index, self.offset);
        let error = |name, member, cause| Error { block: Some(index), offset, name, member, cause };
        let kind = match self.load() {
            Ok(Some(kind)) => kind,
            Ok(None) => {
                self.done = true;
                return Ok(None);
            }
            Err(cause) => {
                self.done = true;
                return Err(error(None, String::new(), cause));
            }
        };
        let mut name = None;
        match self.body(kind, &mut name) {
            Ok((thread, body)) => Ok(Some(Block { index, offset, thread, body })),
            Err(fault) => Err(error(name, fault.path(), fault.cause)),
        }
    }

    /// Reads the bytes of the next block into the buffer, and gives its type. None at the end.
    fn load(&mut self) -> Result<Option<u32>, Cause> {
        let mut head = [0; 12];
        let found = fill(&mut self.input, &mut head)?;
        if found < head.len() {
            self.cut = (found > 0).then_some(Cut { offset: self.offset, found: found as u64 });
            return Ok(None);
        }
        let mut fields = Fields(&head);
        let (size, kind) = (fields.u64()?, fields.u32()?);
        if size > self.limits.block {
            return Err(Cause::Limit(size, self.limits.block));
        }
        self.buffer.clear();
        // It grows with what is there.
        let found = (&mut self.input).take(size).read_to_end(&mut self.buffer)? as u64;
        if found < size {
            self.cut = Some(Cut { offset: self.offset, found: found + head.len() as u64 });
            return Ok(None);
        }
        self.index += 1;
        self.offset += size + head.len() as u64;
        Ok(Some(kind))
    }

    /// The thread and the content of the block in the buffer.
    fn body(&self, kind: u32, name: &mut Option<&'static str>) -> Result<(u64, Body), Fault> {
        let compressed = kind & block_type::COMPRESSED != 0;
        let mut fields = Fields(&self.buffer);
        let other = |kind, meta, name, data: &[u8]| Body::Other { kind, meta, name, compressed, data: data.to_vec() };
        match kind & !block_type::COMPRESSED {
            block_type::CALL => {
                let (number, thread) = (fields.u32()?, fields.u64()?);
                let unpacked;
                let data = if compressed {
                    let size = fields.u64()?;
                    unpacked = self.unpack(fields.0, size)?;
                    &unpacked
                } else {
                    fields.0
                };
                let Some(of) = layout().call(number) else {
                    return Ok((thread, Body::UnknownCall { number, data: data.to_vec() }));
                };
                *name = Some(of.name);
                Ok((thread, Body::Call(decode::call(of, data)?)))
            }
            block_type::META => {
                let (id, thread) = (fields.u32()?, fields.u64()?);
                // The upper half is the family of the interface, which older files leave out for some.
                let kind = id & 0xffff;
                let body = match self.meta(kind, fields, compressed, name)? {
                    Some(body) => body,
                    None => other(block_type::META, Some(id), meta::name(kind), fields.0),
                };
                Ok((thread, body))
            }
            kind @ (block_type::FRAME | block_type::STATE) => {
                *name = Some(if kind == block_type::FRAME { "frame marker" } else { "state marker" });
                let marker = match fields.u32()? {
                    1 => Marker::Begin,
                    2 => Marker::End,
                    other => return Err(Cause::Marker(other).into()),
                };
                let number = fields.u64()?;
                Ok((0, if kind == block_type::FRAME { Body::Frame { marker, number } } else { Body::State { marker, number } }))
            }
            block_type::ANNOTATION => {
                *name = Some("annotation");
                let (form, label, text) = (fields.u32()?, fields.u32()?, fields.u64()?);
                Ok((0, Body::Annotation { form, label: fields.text(label.into())?, text: fields.text(text)? }))
            }
            kind => {
                Ok((0, other(kind, None, if kind == block_type::METHOD { "a method call of Direct3D" } else { "" }, fields.0)))
            }
        }
    }

    /// A meta command. None if it is not taken apart.
    fn meta(
        &self,
        kind: u32,
        mut fields: Fields,
        compressed: bool,
        name: &mut Option<&'static str>,
    ) -> Result<Option<Body>, Fault> {
        let f = &mut fields;
        Ok(Some(match kind {
            meta::MESSAGE => Body::Message(f.text(f.0.len() as u64)?),
            meta::FILL_MEMORY => {
                *name = Some("FillMemory");
                let (memory, offset, size) = (f.u64()?, f.u64()?, f.u64()?);
                Body::FillMemory { memory, offset, data: self.data(f.0, size, compressed)? }
            }
            meta::RESIZE_WINDOW | meta::RESIZE_WINDOW_2 => {
                *name = Some("ResizeWindow");
                let (surface, width, height) = (f.u64()?, f.u32()?, f.u32()?);
                let rotation = (kind == meta::RESIZE_WINDOW_2).then(|| f.u32()).transpose()?;
                Body::ResizeWindow { surface, width, height, rotation }
            }
            meta::SWAPCHAIN_IMAGES => {
                *name = Some("SetSwapchainImageState");
                let (device, swapchain, last_presented, count) = (f.u64()?, f.u64()?, f.u32()?, f.u32()?);
                let image = |f: &mut Fields| {
                    Ok(SwapchainImage {
                        image: f.u64()?,
                        index: f.u32()?,
                        layout: f.u32()?,
                        acquired: f.u32()? != 0,
                        device_mask: f.u32()?,
                        semaphore: f.u64()?,
                        fence: f.u64()?,
                        queue: f.u64()?,
                    })
                };
                Body::SwapchainImages { device, swapchain, last_presented, images: f.list(count, image)? }
            }
            meta::BEGIN_RESOURCES => {
                *name = Some("BeginResourceInit");
                Body::BeginResources { device: f.u64()?, size: f.u64()?, largest_copy: f.u64()? }
            }
            meta::END_RESOURCES => {
                *name = Some("EndResourceInit");
                Body::EndResources { device: f.u64()? }
            }
            meta::INIT_BUFFER => {
                *name = Some("InitBuffer");
                let (device, buffer, size) = (f.u64()?, f.u64()?, f.u64()?);
                Body::InitBuffer { device, buffer, data: self.data(f.0, size, compressed)? }
            }
            meta::INIT_IMAGE => {
                *name = Some("InitImage");
                let (device, image, size) = (f.u64()?, f.u64()?, f.u64()?);
                let (aspect, layout, count) = (f.u32()?, f.u32()?, f.u32()?);
                let levels = f.list(count, Fields::u64)?;
                Body::InitImage { device, image, aspect, layout, levels, data: self.data(f.0, size, compressed)? }
            }
            meta::DEVICE_PROPERTIES => {
                *name = Some("SetDeviceProperties");
                let (physical_device, api_version, driver_version) = (f.u64()?, f.u32()?, f.u32()?);
                let (vendor, device, device_type, cache_uuid) = (f.u32()?, f.u32()?, f.u32()?, f.take()?);
                let length = f.u32()?;
                let name = f.text(length.into())?;
                Body::DeviceProperties(DeviceProperties {
                    physical_device,
                    api_version,
                    driver_version,
                    vendor,
                    device,
                    device_type,
                    cache_uuid,
                    name,
                })
            }
            meta::MEMORY_PROPERTIES => {
                *name = Some("SetDeviceMemoryProperties");
                let (physical_device, types, heaps) = (f.u64()?, f.u32()?, f.u32()?);
                let types = f.list(types, |f| Ok((f.u32()?, f.u32()?)))?;
                let heaps = f.list(heaps, |f| Ok((f.u64()?, f.u32()?)))?;
                Body::MemoryProperties { physical_device, types, heaps }
            }
            meta::OPAQUE_ADDRESS => {
                *name = Some("SetOpaqueAddress");
                Body::OpaqueAddress { device: f.u64()?, object: f.u64()?, address: f.u64()? }
            }
            meta::EXE_FILE => {
                *name = Some("ExeFileInfo");
                Body::ExeFile(ExeFile {
                    product_version: f.fixed_text(EXE_TEXT)?,
                    file_version: f.fixed_text(EXE_TEXT)?,
                    version: [f.u32()?, f.u32()?, f.u32()?, f.u32()?],
                    application: f.fixed_text(EXE_TEXT)?,
                    company: f.fixed_text(EXE_TEXT)?,
                    description: f.fixed_text(EXE_TEXT)?,
                    internal_name: f.fixed_text(EXE_TEXT)?,
                    original_file: f.fixed_text(EXE_TEXT)?,
                    product: f.fixed_text(EXE_TEXT)?,
                })
            }
            meta::DRIVER => {
                *name = Some("DriverInfo");
                Body::Driver(f.fixed_text(f.0.len())?)
            }
            _ => return Ok(None),
        }))
    }

    /// The bytes at the end of a meta command.
    fn data(&self, bytes: &[u8], size: u64, compressed: bool) -> Result<Vec<u8>, Cause> {
        match bytes.len() as u64 {
            _ if compressed => self.unpack(bytes, size),
            found if found == size => Ok(bytes.to_vec()),
            found => Err(Cause::Size { said: size, found }),
        }
    }

    /// Decompresses what has `size` bytes then.
    fn unpack(&self, bytes: &[u8], size: u64) -> Result<Vec<u8>, Cause> {
        if size > self.limits.data {
            return Err(Cause::Limit(size, self.limits.data));
        }
        let read = |input: &mut dyn Read| {
            // Data that shrink to less than this grow as they are read. One byte more shows that there is more.
            let mut data = Vec::with_capacity((size as usize).min(bytes.len().saturating_mul(64)));
            input.take(size.saturating_add(1)).read_to_end(&mut data).map_err(|error| error.to_string()).map(|_| data)
        };
        let data = match self.header.compression {
            Compression::None => return Err(Cause::Uncompressed),
            // A byte of LZ4 stands for 255 at most: more is not there, and not reserved.
            Compression::Lz4 if size / 255 > bytes.len() as u64 => Err("it is too short".to_owned()),
            Compression::Lz4 => lz4_flex::block::decompress(bytes, size as usize).map_err(|error| error.to_string()),
            Compression::Zlib => read(&mut flate2::read::ZlibDecoder::new(bytes)),
            Compression::Zstd => match ruzstd::decoding::StreamingDecoder::new(bytes) {
                Ok(mut decoder) => read(&mut decoder),
                Err(error) => Err(error.to_string()),
            },
        };
        let data = data.map_err(Cause::Damaged)?;
        match data.len() as u64 {
            found if found == size => Ok(data),
            found => Err(Cause::Size { said: size, found }),
        }
    }
}

impl<R: Read> Iterator for Reader<R> {
    type Item = Result<Block, Error>;

    fn next(&mut self) -> Option<Self::Item> {
        self.next_block().transpose()
    }
}

/// Reads until the buffer is full or the file ends. Gives the number of bytes.
fn fill(input: &mut impl Read, buffer: &mut [u8]) -> Result<usize, Cause> {
    let mut found = 0;
    while found < buffer.len() {
        match input.read(&mut buffer[found..]) {
            Ok(0) => break,
            Ok(count) => found += count,
            Err(error) if error.kind() == ErrorKind::Interrupted => {}
            Err(error) => return Err(error.into()),
        }
    }
    Ok(found)
}

/// Reads the header. `offset` counts its bytes.
fn header(input: &mut impl Read, offset: &mut u64) -> Result<Header, Cause> {
    /// More than the format has, and few enough to read them all.
    const OPTIONS: u32 = 64;
    let mut word = || {
        let mut bytes = [0; 4];
        match fill(input, &mut bytes)? {
            4 => {
                *offset += 4;
                Ok(u32::from_le_bytes(bytes))
            }
            _ => Err(Cause::Header),
        }
    };
    if word().map_err(|cause| if matches!(cause, Cause::Header) { Cause::Magic } else { cause })?.to_le_bytes() != MAGIC {
        return Err(Cause::Magic);
    }
    let (major, minor, count) = (word()?, word()?, word()?);
    if major != 0 || minor > 1 {
        return Err(Cause::Version(major, minor));
    }
    if count > OPTIONS {
        return Err(Cause::Options(count));
    }
    let mut compression = Compression::None;
    for _ in 0..count {
        let (key, value) = (word()?, word()?);
        if key == COMPRESSION_KEY {
            compression = match value {
                0 => Compression::None,
                1 => Compression::Lz4,
                2 => Compression::Zlib,
                3 => Compression::Zstd,
                other => return Err(Cause::Compression(other)),
            };
        }
    }
    Ok(Header { major, minor, compression })
}

/// The fixed fields of a block.
#[derive(Clone, Copy)]
struct Fields<'a>(&'a [u8]);

impl Fields<'_> {
    fn take<const N: usize>(&mut self) -> Result<[u8; N], Cause> {
        let (first, rest) = self.0.split_first_chunk().ok_or(Cause::End)?;
        self.0 = rest;
        Ok(*first)
    }

    fn u32(&mut self) -> Result<u32, Cause> {
        self.take().map(u32::from_le_bytes)
    }

    fn u64(&mut self) -> Result<u64, Cause> {
        self.take().map(u64::from_le_bytes)
    }

    fn list<T>(&mut self, count: u32, mut item: impl FnMut(&mut Self) -> Result<T, Cause>) -> Result<Vec<T>, Cause> {
        // It ends where the data end.
        (0..count).map(|_| item(self)).collect()
    }

    fn text(&mut self, length: u64) -> Result<String, Cause> {
        let split = usize::try_from(length).ok().and_then(|length| self.0.split_at_checked(length));
        let (text, rest) = split.ok_or(Cause::Length(length))?;
        self.0 = rest;
        Ok(String::from_utf8_lossy(text).into_owned())
    }

    /// A text of a fixed length, up to its first NUL.
    fn fixed_text(&mut self, length: usize) -> Result<String, Cause> {
        let (text, rest) = self.0.split_at_checked(length).ok_or(Cause::End)?;
        self.0 = rest;
        let end = text.iter().position(|byte| *byte == 0).unwrap_or(length);
        Ok(String::from_utf8_lossy(&text[..end]).into_owned())
    }
}
