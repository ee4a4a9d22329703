//! The writer: header, blocks, compression, meta commands.

use crate::block::*;
use crate::encode;
use crate::error::{Cause, Error, Fault};
use crate::layout::layout;
use crate::value::Call;
use std::io::{Read, Write};

/// Writes a capture block by block.
#[derive(Debug)]
pub struct Writer<W> {
    output: W,
    header: Header,
    index: u64,
    offset: u64,
}

impl<W: Write> Writer<W> {
    /// Writes the header.
    pub fn new(output: W, header: Header) -> Result<Self, Error> {
        let mut writer = Writer { output, header, index: 0, offset: 0 };
        let Header { major, minor, compression } = writer.header;
        let compression: u32 = match compression {
            Compression::None => 0,
            Compression::Lz4 => 1,
            Compression::Zlib => 2,
            Compression::Zstd => 3,
        };
        let mut bytes = MAGIC.to_vec();
        for word in [major, minor, 1, COMPRESSION_KEY, compression] {
            bytes.extend(word.to_le_bytes());
        }
        writer.put(&bytes).map_err(|cause| Error { block: None, offset: 0, name: None, member: String::new(), cause })?;
        Ok(writer)
    }

    /// Writes a call, as [`Writer::block`] does.
    pub fn call(&mut self, thread: u64, call: Call) -> Result<(), Error> {
        self.block(thread, &Body::Call(call))
    }

    /// Writes a block. Markers and annotations have no thread.
    pub fn block(&mut self, thread: u64, body: &Body) -> Result<(), Error> {
        let written = self.encode(thread, body).and_then(|(kind, bytes)| {
            let mut block = (bytes.len() as u64).to_le_bytes().to_vec();
            block.extend(kind.to_le_bytes());
            block.extend(bytes);
            Ok(self.put(&block)?)
        });
        written.map_err(|fault| Error {
            block: Some(self.index),
            offset: self.offset,
            name: Some(body.name()),
            member: fault.path(),
            cause: fault.cause,
        })?;
        self.index += 1;
        Ok(())
    }

    /// Flushes the output and gives it back.
    pub fn finish(mut self) -> Result<W, Error> {
        let flushed = self.output.flush();
        flushed.map_err(|error| Error {
            block: Some(self.index),
            offset: self.offset,
            name: None,
            member: String::new(),
            cause: error.into(),
        })?;
        Ok(self.output)
    }

    fn put(&mut self, bytes: &[u8]) -> Result<(), Cause> {
        self.output.write_all(bytes)?;
        self.offset += bytes.len() as u64;
        Ok(())
    }

    /// The type and the bytes of a block.
    fn encode(&self, thread: u64, body: &Body) -> Result<(u32, Vec<u8>), Fault> {
        let mut f = Fields(Vec::new());
        // Meta commands begin with their kind, in the family of Vulkan, and the thread.
        let command = |kind: u32| Fields([&(1 << 16 | kind).to_le_bytes()[..], &thread.to_le_bytes()].concat());
        match body {
            Body::Call(call) => {
                let of = layout().call(call.number).filter(|of| of.name == call.name);
                let of = of.ok_or_else(|| Cause::Value(format!("{} is no call of number {:#x}", call.name, call.number)))?;
                let data = encode::call(of, call)?;
                return self.function(call.number, thread, &data);
            }
            Body::UnknownCall { number, data } => return self.function(*number, thread, data),
            Body::FillMemory { memory, offset, data } => {
                let head = command(meta::FILL_MEMORY).u64(*memory).u64(*offset).u64(data.len() as u64);
                return self.with_data(head, data);
            }
            Body::InitBuffer { device, buffer, data } => {
                let head = command(meta::INIT_BUFFER).u64(*device).u64(*buffer).u64(data.len() as u64);
                return self.with_data(head, data);
            }
            Body::InitImage { device, image, aspect, layout, levels, data } => {
                let head = command(meta::INIT_IMAGE).u64(*device).u64(*image).u64(data.len() as u64);
                let head = head.u32(*aspect).u32(*layout).u32(count(levels.len())?);
                let head = levels.iter().fold(head, |head, level| head.u64(*level));
                return self.with_data(head, data);
            }
            Body::ResizeWindow { surface, width, height, rotation } => {
                let kind = if rotation.is_some() { meta::RESIZE_WINDOW_2 } else { meta::RESIZE_WINDOW };
                f = command(kind).u64(*surface).u32(*width).u32(*height);
                if let Some(rotation) = rotation {
                    f = f.u32(*rotation);
                }
            }
            Body::SwapchainImages { device, swapchain, last_presented, images } => {
                f = command(meta::SWAPCHAIN_IMAGES).u64(*device).u64(*swapchain).u32(*last_presented).u32(count(images.len())?);
                for image in images {
                    f = f.u64(image.image).u32(image.index).u32(image.layout).u32(image.acquired.into());
                    f = f.u32(image.device_mask).u64(image.semaphore).u64(image.fence).u64(image.queue);
                }
            }
            Body::BeginResources { device, size, largest_copy } => {
                f = command(meta::BEGIN_RESOURCES).u64(*device).u64(*size).u64(*largest_copy);
            }
            Body::EndResources { device } => f = command(meta::END_RESOURCES).u64(*device),
            Body::DeviceProperties(of) => {
                f = command(meta::DEVICE_PROPERTIES).u64(of.physical_device).u32(of.api_version).u32(of.driver_version);
                f = f.u32(of.vendor).u32(of.device).u32(of.device_type).bytes(&of.cache_uuid);
                f = f.u32(count(of.name.len())?).bytes(of.name.as_bytes());
            }
            Body::MemoryProperties { physical_device, types, heaps } => {
                f = command(meta::MEMORY_PROPERTIES).u64(*physical_device).u32(count(types.len())?).u32(count(heaps.len())?);
                f = types.iter().fold(f, |f, (flags, heap)| f.u32(*flags).u32(*heap));
                f = heaps.iter().fold(f, |f, (size, flags)| f.u64(*size).u32(*flags));
            }
            Body::OpaqueAddress { device, object, address } => {
                f = command(meta::OPAQUE_ADDRESS).u64(*device).u64(*object).u64(*address);
            }
            Body::ExeFile(of) => {
                f = command(meta::EXE_FILE).text(&of.product_version, EXE_TEXT)?.text(&of.file_version, EXE_TEXT)?;
                f = of.version.iter().fold(f, |f, number| f.u32(*number));
                for text in [&of.application, &of.company, &of.description, &of.internal_name, &of.original_file, &of.product] {
                    f = f.text(text, EXE_TEXT)?;
                }
            }
            Body::Driver(text) => f = command(meta::DRIVER).text(text, DRIVER_TEXT)?,
            Body::Frame { marker, number } => return Ok((block_type::FRAME, f.marker(*marker).u64(*number).0)),
            Body::State { marker, number } => return Ok((block_type::STATE, f.marker(*marker).u64(*number).0)),
            Body::Annotation { form, label, text } => {
                f = f.u32(*form).u32(count(label.len())?).u64(text.len() as u64).bytes(label.as_bytes()).bytes(text.as_bytes());
                return Ok((block_type::ANNOTATION, f.0));
            }
            Body::Message(text) => f = command(meta::MESSAGE).bytes(text.as_bytes()),
            Body::Other { kind, meta, compressed, data, .. } => {
                if let Some(meta) = meta {
                    f = f.u32(*meta).u64(thread);
                }
                return Ok((kind | if *compressed { block_type::COMPRESSED } else { 0 }, f.bytes(data).0));
            }
        }
        Ok((block_type::META, f.0))
    }

    fn function(&self, number: u32, thread: u64, data: &[u8]) -> Result<(u32, Vec<u8>), Fault> {
        let head = Fields(Vec::new()).u32(number).u64(thread);
        match self.pack(data)? {
            // Its size stands only where it is compressed.
            Some(packed) if packed.len() + 8 < data.len() => {
                Ok((block_type::CALL | block_type::COMPRESSED, head.u64(data.len() as u64).bytes(&packed).0))
            }
            _ => Ok((block_type::CALL, head.bytes(data).0)),
        }
    }

    /// A meta command whose fields end with the size of the data.
    fn with_data(&self, head: Fields, data: &[u8]) -> Result<(u32, Vec<u8>), Fault> {
        match self.pack(data)? {
            Some(packed) if packed.len() < data.len() => Ok((block_type::META | block_type::COMPRESSED, head.bytes(&packed).0)),
            _ => Ok((block_type::META, head.bytes(data).0)),
        }
    }

    /// The compressed data. None if the capture is not compressed.
    fn pack(&self, data: &[u8]) -> Result<Option<Vec<u8>>, Cause> {
        Ok(Some(match self.header.compression {
            Compression::None => return Ok(None),
            Compression::Lz4 => lz4_flex::block::compress(data),
            Compression::Zlib => {
                let mut packed = Vec::new();
                flate2::read::ZlibEncoder::new(data, flate2::Compression::default()).read_to_end(&mut packed)?;
                packed
            }
            Compression::Zstd => ruzstd::encoding::compress_to_vec(data, ruzstd::encoding::CompressionLevel::Fastest),
        }))
    }
}

fn count(length: usize) -> Result<u32, Cause> {
    length.try_into().map_err(|_| Cause::Value(format!("{length} items are too many")))
}

/// Bytes that grow by fields.
struct Fields(Vec<u8>);

impl Fields {
    fn bytes(mut self, bytes: &[u8]) -> Self {
        self.0.extend_from_slice(bytes);
        self
    }

    fn u32(self, number: u32) -> Self {
        self.bytes(&number.to_le_bytes())
    }

    fn u64(self, number: u64) -> Self {
        self.bytes(&number.to_le_bytes())
    }

    fn marker(self, marker: Marker) -> Self {
        self.u32(match marker {
            Marker::Begin => 1,
            Marker::End => 2,
        })
    }

    /// A text in a field of a fixed length, with a NUL behind it.
    fn text(mut self, text: &str, length: usize) -> Result<Self, Cause> {
        if text.len() >= length || text.contains('\0') {
            return Err(Cause::Value(format!("a text of {} bytes in a field of {length}", text.len())));
        }
        let end = self.0.len() + length;
        self.0.extend_from_slice(text.as_bytes());
        self.0.resize(end, 0);
        Ok(self)
    }
}
