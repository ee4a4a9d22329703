//! Blocks of a capture.

use crate::value::Call;
use std::fmt;

/// The header of a capture.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Header {
    /// The major version of the format.
    pub major: u32,
    /// The minor version of the format: 0, or 1 for a recorder from version 1.0.1 on.
    pub minor: u32,
    /// The compression of its blocks.
    pub compression: Compression,
}

impl Default for Header {
    /// Version 0.0 without compression.
    fn default() -> Self {
        Header { major: 0, minor: 0, compression: Compression::None }
    }
}

impl Header {
    /// True if a block ends a frame. In version 0.0 a present or a frame boundary does, in version 0.1 a frame marker.
    pub fn ends_frame(&self, body: &Body) -> bool {
        match body {
            Body::Call(call) if call.name == "vkQueuePresentKHR" => self.minor == 0,
            Body::Call(call) => self.minor == 0 && call.name == "vkFrameBoundaryANDROID",
            Body::Frame { marker, .. } => *marker == Marker::End,
            _ => false,
        }
    }
}

/// The compression of a capture. Recorders store a block as it is if compression does not make it smaller.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Compression {
    /// Not at all.
    #[default]
    None,
    /// Blocks of LZ4 without a frame.
    Lz4,
    /// Streams of zlib.
    Zlib,
    /// Frames of Zstandard.
    Zstd,
}

impl fmt::Display for Compression {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Compression::None => "no compression",
            Compression::Lz4 => "LZ4",
            Compression::Zlib => "zlib",
            Compression::Zstd => "Zstandard",
        })
    }
}

/// A block of a capture.
#[derive(Clone, Debug, PartialEq)]
pub struct Block {
    /// Its number, from 0. The header does not count.
    pub index: u64,
    /// The byte of the file at which it begins.
    pub offset: u64,
    /// The thread of the program, from 1. Zero for blocks without one.
    pub thread: u64,
    /// Its content.
    pub body: Body,
}

/// The content of a block.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum Body {
    /// A call of Vulkan.
    Call(Call),
    /// A call whose number the table does not have.
    UnknownCall {
        /// The number, with the family in the upper half.
        number: u32,
        /// The parameters, decompressed.
        data: Vec<u8>,
    },
    /// The program wrote to mapped memory.
    FillMemory {
        /// The memory object.
        memory: u64,
        /// The place, counted from the pointer that `vkMapMemory` gave.
        offset: u64,
        /// The bytes.
        data: Vec<u8>,
    },
    /// The content of a buffer when a trimmed capture begins.
    InitBuffer {
        /// The device.
        device: u64,
        /// The buffer.
        buffer: u64,
        /// All its bytes.
        data: Vec<u8>,
    },
    /// The content of an aspect of an image when a trimmed capture begins.
    InitImage {
        /// The device.
        device: u64,
        /// The image.
        image: u64,
        /// The aspect, a bit of `VkImageAspectFlagBits`.
        aspect: u32,
        /// The layout that the image has when the frames begin, a `VkImageLayout`.
        layout: u32,
        /// The bytes of each mip level, with padding.
        levels: Vec<u64>,
        /// The levels one after the other. Each has its layers one after the other, tightly packed.
        data: Vec<u8>,
    },
    /// The program gave a window its size.
    ResizeWindow {
        /// The surface of the window.
        surface: u64,
        /// Its width in pixels.
        width: u32,
        /// Its height in pixels.
        height: u32,
        /// The rotation in quarters of a circle. None in the older form of the block.
        rotation: Option<u32>,
    },
    /// The state of the images of a swapchain when a trimmed capture begins.
    SwapchainImages {
        /// The device.
        device: u64,
        /// The swapchain.
        swapchain: u64,
        /// The index of the image that was presented last.
        last_presented: u32,
        /// Its images. There may be fewer than the swapchain has.
        images: Vec<SwapchainImage>,
    },
    /// The contents of buffers and images follow.
    BeginResources {
        /// The device.
        device: u64,
        /// The size of the largest resource, or of all in a newer file.
        size: u64,
        /// The size of the largest copy.
        largest_copy: u64,
    },
    /// The contents of buffers and images end.
    EndResources {
        /// The device.
        device: u64,
    },
    /// The device of the recording.
    DeviceProperties(DeviceProperties),
    /// The memory of the device of the recording.
    MemoryProperties {
        /// The physical device.
        physical_device: u64,
        /// The flags and the heap of each type of memory.
        types: Vec<(u32, u32)>,
        /// The size and the flags of each heap.
        heaps: Vec<(u64, u32)>,
    },
    /// The address that a buffer or a memory object had. It stands before the call that creates the object.
    OpaqueAddress {
        /// The device.
        device: u64,
        /// The object.
        object: u64,
        /// Its device address.
        address: u64,
    },
    /// The program's file.
    ExeFile(ExeFile),
    /// The driver's description of itself.
    Driver(String),
    /// A frame begins or ends. Only files of version 0.1 have it.
    Frame {
        /// Begin or end.
        marker: Marker,
        /// The number of the frame in the program.
        number: u64,
    },
    /// The state at the beginning of a trimmed capture begins or ends.
    State {
        /// Begin or end.
        marker: Marker,
        /// The number of the first frame in the program.
        number: u64,
    },
    /// A text of the recorder or of another tool.
    Annotation {
        /// Its form: 1 plain, 2 JSON, 3 XML.
        form: u32,
        /// Its label, such as `operation`.
        label: String,
        /// The text.
        text: String,
    },
    /// A message for the person who replays the capture.
    Message(String),
    /// A block that this package does not take apart.
    Other {
        /// The type of the block, without the bit of compression.
        kind: u32,
        /// The number of the meta command, for a block of type 3.
        meta: Option<u32>,
        /// Its name, empty if it is not known.
        name: &'static str,
        /// True if the type of the block has the bit of compression.
        compressed: bool,
        /// The bytes behind the thread of a meta command, or else all bytes, as the file has them.
        data: Vec<u8>,
    },
}

impl Body {
    /// The name of the call, or of the kind of block.
    pub fn name(&self) -> &'static str {
        match self {
            Body::Call(call) => call.name,
            Body::UnknownCall { .. } => "a call of an unknown number",
            Body::FillMemory { .. } => "FillMemory",
            Body::InitBuffer { .. } => "InitBuffer",
            Body::InitImage { .. } => "InitImage",
            Body::ResizeWindow { rotation: None, .. } => "ResizeWindow",
            Body::ResizeWindow { .. } => "ResizeWindow2",
            Body::SwapchainImages { .. } => "SetSwapchainImageState",
            Body::BeginResources { .. } => "BeginResourceInit",
            Body::EndResources { .. } => "EndResourceInit",
            Body::DeviceProperties(_) => "SetDeviceProperties",
            Body::MemoryProperties { .. } => "SetDeviceMemoryProperties",
            Body::OpaqueAddress { .. } => "SetOpaqueAddress",
            Body::ExeFile(_) => "ExeFileInfo",
            Body::Driver(_) => "DriverInfo",
            Body::Frame { .. } => "frame marker",
            Body::State { .. } => "state marker",
            Body::Annotation { .. } => "annotation",
            Body::Message(_) => "DisplayMessage",
            Body::Other { name: "", .. } => "a block of an unknown kind",
            Body::Other { name, .. } => name,
        }
    }
}

/// The two kinds of markers of frames and of the state.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Marker {
    /// It begins.
    Begin,
    /// It ends.
    End,
}

/// An image of a swapchain when a trimmed capture begins.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SwapchainImage {
    /// The image.
    pub image: u64,
    /// Its index in the swapchain.
    pub index: u32,
    /// Its layout, a `VkImageLayout`.
    pub layout: u32,
    /// True if the program has acquired it and not presented it.
    pub acquired: bool,
    /// The device mask of the acquisition.
    pub device_mask: u32,
    /// The semaphore that the acquisition signals, or zero.
    pub semaphore: u64,
    /// The fence that the acquisition signals, or zero.
    pub fence: u64,
    /// The queue that presented it last, or zero.
    pub queue: u64,
}

/// The device of the recording.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct DeviceProperties {
    /// The physical device.
    pub physical_device: u64,
    /// The version of Vulkan that it supports.
    pub api_version: u32,
    /// The version of the driver, in the driver's own form.
    pub driver_version: u32,
    /// The number of its vendor.
    pub vendor: u32,
    /// The number of the device.
    pub device: u32,
    /// The kind of device, a `VkPhysicalDeviceType`.
    pub device_type: u32,
    /// The UUID of the driver's pipeline caches.
    pub cache_uuid: [u8; 16],
    /// The name of the device.
    pub name: String,
}

/// The program's file. Most of it is empty unless the program ran on Windows.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct ExeFile {
    /// The version of the product.
    pub product_version: String,
    /// The version of the file.
    pub file_version: String,
    /// The four numbers of the version of the application.
    pub version: [u32; 4],
    /// The name of the application.
    pub application: String,
    /// The company.
    pub company: String,
    /// A description of the file.
    pub description: String,
    /// The internal name.
    pub internal_name: String,
    /// The name that the file had first.
    pub original_file: String,
    /// The name of the product.
    pub product: String,
}

/// Kinds of meta commands.
pub(crate) mod meta {
    pub const MESSAGE: u32 = 1;
    pub const FILL_MEMORY: u32 = 2;
    pub const RESIZE_WINDOW: u32 = 3;
    pub const SWAPCHAIN_IMAGES: u32 = 4;
    pub const BEGIN_RESOURCES: u32 = 5;
    pub const END_RESOURCES: u32 = 6;
    pub const INIT_BUFFER: u32 = 7;
    pub const INIT_IMAGE: u32 = 8;
    pub const DEVICE_PROPERTIES: u32 = 11;
    pub const MEMORY_PROPERTIES: u32 = 12;
    pub const RESIZE_WINDOW_2: u32 = 13;
    pub const OPAQUE_ADDRESS: u32 = 14;
    pub const EXE_FILE: u32 = 18;
    pub const DRIVER: u32 = 22;

    /// The name of a kind that this package does not take apart.
    pub fn name(kind: u32) -> &'static str {
        match kind {
            9 | 24 | 35 => "CreateHardwareBuffer",
            10 => "DestroyHardwareBuffer",
            15 => "SetRayTracingShaderGroupHandles",
            27 => "ParentToChildDependency",
            28 => "BuildAccelerationStructures",
            29 => "CopyAccelerationStructures",
            30 => "WriteAccelerationStructuresProperties",
            32 => "SetEnvironmentVariables",
            33 => "ViewRelativeLocation",
            34 => "ExecuteBlocksFromFile",
            37 => "SetOpaqueCaptureDescriptorData",
            39 => "InitTensor",
            16 | 17 | 19..=21 | 26 | 36 | 38 => "a meta command of Direct3D 12",
            _ => "",
        }
    }
}

/// Types of blocks.
pub(crate) mod block_type {
    pub const FRAME: u32 = 1;
    pub const STATE: u32 = 2;
    pub const META: u32 = 3;
    pub const CALL: u32 = 4;
    pub const ANNOTATION: u32 = 5;
    pub const METHOD: u32 = 6;
    /// Set in the type of a block that is compressed.
    pub const COMPRESSED: u32 = 1 << 31;
}

/// The bytes of a text in [`ExeFile`].
pub(crate) const EXE_TEXT: usize = 256;
/// The bytes of the text of [`Body::Driver`].
pub(crate) const DRIVER_TEXT: usize = 1024;
/// The key of the option of the header that names the compression.
pub(crate) const COMPRESSION_KEY: u32 = 1;
/// The first bytes of a capture.
pub const MAGIC: [u8; 4] = *b"GFXR";
