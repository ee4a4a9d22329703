//! Captures of Vulkan programs by GFXReconstruct (`.gfxr`): a reader of versions 0.0 and 0.1.

mod block;
mod build;
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
pub use error::{Cause, Error};
pub use layout::{constant, constant_name};
pub use reader::{Cut, Limits, Reader};
pub use value::{Call, Chain, Enum, Member, Struct, Value, ValueError};
pub use writer::Writer;
