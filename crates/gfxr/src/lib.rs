//! Floor 0: captures of Vulkan programs by [GFXReconstruct](https://github.com/LunarG/gfxreconstruct) (`.gfxr`), read and written.
//!
//! A [`Reader`] gives block by block what a program did: calls of Vulkan with all parameters and results by name, and what it wrote to mapped
//! memory. It needs nothing but the bytes: no Vulkan, no driver. It holds one block at a time, so that memory does not grow with the length of a
//! capture. [`Contents`] says what a capture holds. A [`Writer`] makes captures.
//!
//! ```
//! use gfxr::{Body, Call, Header, Reader, Struct, Writer};
//!
//! // A capture of two calls.
//! let mut writer = Writer::new(Vec::new(), Header::default())?;
//! let info = Struct::new("VkBufferCreateInfo").with("size", 64).with("usage", "VK_BUFFER_USAGE_VERTEX_BUFFER_BIT");
//! let device = 1;
//! writer.call(1, Call::new("vkCreateBuffer").with("device", device).with("pCreateInfo", info).with("pBuffer", 2))?;
//! writer.call(1, Call::new("vkCmdDraw").with("vertexCount", 3).with("instanceCount", 1))?;
//! let file = writer.finish()?;
//!
//! let mut reader = Reader::new(&file[..])?;
//! let (mut buffers, mut vertices) = (Vec::new(), 0);
//! while let Some(block) = reader.next_block()? {
//!     let Body::Call(call) = &block.body else { continue };
//!     match call.name {
//!         "vkCreateBuffer" => {
//!             let info = call.get("pCreateInfo").structure()?;
//!             buffers.push((call.get("pBuffer").handle()?, info.get("size").u64()?));
//!         }
//!         "vkCmdDraw" => vertices += call.get("vertexCount").u32()?,
//!         _ => {}
//!     }
//! }
//! assert_eq!((buffers, vertices), (vec![(2, 64)], 3));
//! assert!(reader.cut().is_none(), "the file is whole");
//!
//! // What is wrong has its place.
//! let error = Reader::new(&file[..]).unwrap().with_limits(gfxr::Limits { block: 50, data: 50 }).next_block().unwrap_err();
//! assert_eq!(error.to_string(), "block 0 at byte 24: 96 bytes exceed the limit of 50");
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! # The format
//!
//! All numbers are little endian, and nothing is aligned. A file is a header and then blocks to its end:
//!
//! ```text
//! header   "GFXR", u32 major (0), u32 minor (0 or 1), u32 options, options x (u32 key, u32 value)
//!          key 1: compression: 0 none, 1 LZ4 blocks, 2 zlib streams, 3 Zstandard frames
//! block    u64 size of the body, u32 type (bit 31: compressed), body
//!   1, 2   frame marker, state marker: u32 (1 begin, 2 end), u64 frame
//!   3      meta command: u32 family << 16 | kind, u64 thread, fields, data
//!   4      call: u32 family << 16 | number, u64 thread, [u64 size of the parameters when decompressed], parameters
//!   5      annotation: u32 form, u32 length of the label, u64 length of the text, label, text
//! ```
//!
//! Only the last part of a block is compressed: the parameters of a call, the data of a meta command. A recorder compresses what gets smaller.
//!
//! The parameters of a call stand in the order of its declaration, and then its result. Numbers have their own width; constants, truth values and
//! flags have 32 bits, flags of newer types 64; objects and addresses have 64. A structure by value is its members. Every pointer and every array,
//! one of a fixed length too, begins with a word of attributes:
//!
//! ```text
//! 0x001 null: nothing follows          0x040 the address in the program follows, 8 bytes
//! 0x002 one value                      0x080 the content follows
//! 0x004 an array                       0x100 an array of arrays, each with a word of its own
//! 0x008, 0x010 a string of 8, 16 bits  0x020 of structures
//! ```
//!
//! After the address stands the length in elements, for arrays and strings, and then the content. In a chain, `pNext` is such a pointer to a
//! structure that begins with its `sType`; the rest of the outer structure stands after the whole chain. Unions have a form each: clear values are
//! arrays of four words, others follow the member before them. The data of an update template are the three counts of image infos, buffer infos
//! and texel buffer views, what they count, and then acceleration structures and inline uniform blocks, if there are any. Which call has which
//! parameters is in a table that is made of the Khronos registry.
//!
//! Objects are numbers from 1 on that are never used again in a capture. Writes to mapped memory are recorded as [`Body::FillMemory`] before the
//! call that makes them visible: a submission, a flush or an unmapping. A frame ends with a present in version 0.0, and with a frame marker in
//! version 0.1 ([`Header::ends_frame`]). A trimmed capture begins with calls that make all objects that were alive, between two state markers;
//! [`Body::InitBuffer`], [`Body::InitImage`] and [`Body::SwapchainImages`] have what was in them.
//!
//! # Damage
//!
//! Every length is checked against the bytes that are there, and memory for decompressed data against [`Limits`]. An [`Error`] names block, call
//! and member; blocks behind a damaged one are read. A capture of a program that was killed ends within a block: [`Reader::cut`] says where.
//! Blocks of a kind that is not known are handed on as bytes. Seven structures of newer extensions hold unions that no description covers: a call
//! with one of them is an error that names it.

mod block;
mod build;
mod contents;
mod decode;
mod encode;
mod error;
mod layout;
mod reader;
#[cfg(test)]
mod tests;
mod value;
mod writer;

pub use block::{Block, Body, Compression, DeviceProperties, ExeFile, Header, MAGIC, Marker, SwapchainImage};
pub use contents::{Application, Contents, Window, version_text};
pub use error::{Cause, Error};
pub use layout::{call_names, constant, constant_name, structure_names};
pub use reader::{Cut, Limits, Reader};
pub use value::{Call, Chain, Enum, Member, Struct, Value, ValueError};
pub use writer::Writer;
