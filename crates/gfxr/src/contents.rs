//! The contents of a capture in short.

use crate::block::{Body, DeviceProperties, Header, Marker};
use crate::error::Error;
use crate::reader::{Cut, Reader};
use crate::value::{Call, Enum, Struct, Value};
use std::collections::BTreeMap;
use std::io::Read;

/// The contents of a capture, counted in one reading.
#[derive(Debug, Default)]
pub struct Contents {
    /// The header.
    pub header: Header,
    /// The number of blocks.
    pub blocks: u64,
    /// The number of calls by name.
    pub calls: BTreeMap<&'static str, u64>,
    /// The number of other blocks by name.
    pub others: BTreeMap<&'static str, u64>,
    /// The number of calls that the table does not have, by their number in the capture.
    pub unknown: BTreeMap<u32, u64>,
    /// The number of calls that failed, by name and result.
    pub failed: BTreeMap<(&'static str, i32), u64>,
    /// The program's description of itself, once for all instances that have the same.
    pub applications: Vec<Application>,
    /// The devices of the recording.
    pub devices: Vec<DeviceProperties>,
    /// The extensions of all instances, in the order in which they were first asked for.
    pub instance_extensions: Vec<String>,
    /// The extensions of all devices, in the order in which they were first asked for.
    pub device_extensions: Vec<String>,
    /// The windows, by the surfaces that swapchains were made for.
    pub windows: Vec<Window>,
    /// The number of frames that end in the capture. A program without a window has none.
    pub frames: u64,
    /// The number in the program of the first frame, if the capture is trimmed.
    pub first_frame: Option<u64>,
    /// The shader modules.
    pub shaders: u64,
    /// The bytes of the shader modules.
    pub shader_bytes: u64,
    /// The bytes that the program wrote to mapped memory, and with which buffers and images began.
    pub data_bytes: u64,
    /// The place at which the capture ends within a block.
    pub cut: Option<Cut>,
    /// Blocks that cannot be read: the first hundred.
    pub damaged: Vec<Error>,
    /// The number of blocks that cannot be read.
    pub damaged_blocks: u64,
}

/// A program's description of itself, `VkApplicationInfo`.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Application {
    /// The name of the application.
    pub name: String,
    /// The name of its engine.
    pub engine: String,
    /// The version of Vulkan that it asks for.
    pub api_version: u32,
}

/// A window.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Window {
    /// The surface.
    pub surface: u64,
    /// The size and the format of each swapchain that differs from the one before.
    pub swapchains: Vec<([u32; 2], Enum)>,
}

/// Damaged blocks whose errors are kept.
const KEPT: usize = 100;

impl Contents {
    /// Reads a capture to its end. Blocks that are damaged are listed, and the reading goes on behind them, unless the file itself cannot be
    /// read on.
    pub fn read<R: Read>(reader: &mut Reader<R>) -> Self {
        let mut contents = Contents { header: *reader.header(), ..Contents::default() };
        for block in reader.by_ref() {
            contents.blocks += 1;
            match block {
                Ok(block) => contents.take(&block.body),
                Err(error) => {
                    contents.damaged_blocks += 1;
                    if contents.damaged.len() < KEPT {
                        contents.damaged.push(error);
                    }
                }
            }
        }
        contents.cut = reader.cut();
        contents
    }

    /// The number of all calls.
    pub fn all_calls(&self) -> u64 {
        self.calls.values().chain(self.unknown.values()).sum()
    }

    fn take(&mut self, body: &Body) {
        self.frames += u64::from(self.header.ends_frame(body));
        match body {
            Body::Call(call) => {
                *self.calls.entry(call.name).or_default() += 1;
                if let Some(Value::Enum(result)) = &call.result
                    && call.failed()
                {
                    *self.failed.entry((call.name, result.value)).or_default() += 1;
                } else {
                    self.call(call);
                }
                return;
            }
            Body::UnknownCall { number, .. } => {
                *self.unknown.entry(*number).or_default() += 1;
                return;
            }
            Body::DeviceProperties(device) if !self.devices.contains(device) => self.devices.push(device.clone()),
            Body::State { marker: Marker::End, number } => self.first_frame = Some(*number),
            Body::FillMemory { data, .. } | Body::InitBuffer { data, .. } | Body::InitImage { data, .. } => {
                self.data_bytes += data.len() as u64;
            }
            _ => {}
        }
        *self.others.entry(body.name()).or_default() += 1;
    }

    /// Takes note of a call that succeeded.
    fn call(&mut self, call: &Call) {
        let info = || call.get("pCreateInfo").value().optional();
        match call.name {
            "vkCreateInstance" => {
                let Some(info) = info() else { return };
                let of = |info: &Struct| Application {
                    name: info.get("pApplicationName").string().unwrap_or_default().to_owned(),
                    engine: info.get("pEngineName").string().unwrap_or_default().to_owned(),
                    api_version: info.get("apiVersion").u32().unwrap_or_default(),
                };
                let application = info.get("pApplicationInfo").optional().map(of).unwrap_or_default();
                if !self.applications.contains(&application) {
                    self.applications.push(application);
                }
                extensions(info, &mut self.instance_extensions);
            }
            "vkCreateDevice" => info().into_iter().for_each(|info| extensions(info, &mut self.device_extensions)),
            "vkCreateSwapchainKHR" => {
                let Some(info) = info() else { return };
                let (Ok(surface), Some(extent)) = (info.get("surface").handle(), info.get("imageExtent").value().optional())
                else {
                    return;
                };
                let side = |name| extent.get(name).u32().unwrap_or_default();
                let Ok(format) = info.get("imageFormat").constant() else { return };
                let swapchain = ([side("width"), side("height")], format);
                match self.windows.iter_mut().find(|window| window.surface == surface) {
                    Some(window) if window.swapchains.last() == Some(&swapchain) => {}
                    Some(window) => window.swapchains.push(swapchain),
                    None => self.windows.push(Window { surface, swapchains: vec![swapchain] }),
                }
            }
            "vkCreateShaderModule" => {
                self.shaders += 1;
                let words = info().and_then(|info| info.get("pCode").words().ok());
                self.shader_bytes += words.map_or(0, |words| size_of_val(words) as u64);
            }
            _ => {}
        }
    }
}

/// Adds the extensions that an instance or a device asks for.
fn extensions(info: &Struct, all: &mut Vec<String>) {
    for name in info.get("ppEnabledExtensionNames").strings().unwrap_or_default() {
        if !all.iter().any(|known| known == name) {
            all.push(name.to_owned());
        }
    }
}

/// A version of Vulkan as text: `1.3.230`.
pub fn version_text(version: u32) -> String {
    format!("{}.{}.{}", version >> 22 & 0x7f, version >> 12 & 0x3ff, version & 0xfff)
}
