//! Opens captures: the blocks of a reader run on the state, and its commands become a trace or a stream.

use std::cell::Cell;
use std::fs::File;
use std::io::{BufReader, Read};
use std::ops::{ControlFlow, Range};
use std::path::{Path, PathBuf};
use std::rc::Rc;
use std::sync::{Mutex, PoisonError};

use gfxr::{Body, Reader};
use host::Links;
use trace::command::Command;
use trace::{CommandChunk, Origin, Reading, Stream, Trace, TraceError};

use super::args::Args;
use super::fault::Fault;
use super::machine::Vulkan;
use super::objects::{Recorded, known};
use super::pass::Open;
use super::submission::Stop;
use super::survey::Survey;

/// By default, a capture stays in memory up to this length of its file.
const IN_MEMORY: u64 = 16 << 20;
/// Bytes of commands and payload of a part of a stream, about.
const PART: u64 = 1 << 20;

/// A capture in a file.
struct Recording {
    path: PathBuf,
    links: Links,
    reading: Reading,
    frames: Range<u64>,
    length: u64,
    origin: Mutex<Origin>,
}

/// Opens a capture of GFXReconstruct, up to the last of the wanted frames. A long one is not held in memory: its commands are made each time that
/// they are read (`reading.in_memory`), and what is not supported then ends them.
///
/// # Errors
/// If it is damaged, or asks for more than a limit allows, or for what is not supported and `reading.lenient` is not set.
pub fn open(path: &Path, links: Links, reading: &Reading, frames: Range<u64>) -> Result<Trace, TraceError> {
    let length = host::length(path, links).map_err(|error| TraceError::new(path, error))?;
    reading.limits.trace_bytes.check(length).map_err(|error| TraceError::new(path, error))?;
    let (reading, origin) = (*reading, Mutex::default());
    let recording = Recording { path: path.to_path_buf(), links, reading, frames, length, origin };
    if length > reading.in_memory.unwrap_or(IN_MEMORY) {
        return Ok(Trace::from_stream(path, Box::new(recording), reading.limits));
    }
    let (vulkan, origin) = recording.import(&mut None, Vulkan::new(path, &reading.limits))?;
    Ok(vulkan.card.finish().with_limits(reading.limits).with_origin(origin))
}

/// Reads a capture for what of it is accepted and refused. Memory does not grow with its length.
///
/// # Errors
/// If it is damaged, or asks for more than a limit allows.
pub fn survey(path: &Path, links: Links, reading: &Reading) -> Result<Survey, TraceError> {
    let length = host::length(path, links).map_err(|error| TraceError::new(path, error))?;
    reading.limits.trace_bytes.check(length).map_err(|error| TraceError::new(path, error))?;
    let (reading, origin) = (Reading { lenient: true, ..*reading }, Mutex::default());
    let recording = Recording { path: path.to_path_buf(), links, reading, frames: 0..u64::MAX, length, origin };
    let mut vulkan = Vulkan::new(path, &reading.limits);
    vulkan.stages = Some(Default::default());
    let mut forget = |_: CommandChunk| ControlFlow::Continue(());
    let (mut vulkan, _) = recording.import(&mut Some(&mut forget), vulkan)?;
    Ok(Survey::new(&mut vulkan))
}

/// A function that takes the parts of a stream.
type Take<'a> = &'a mut dyn FnMut(CommandChunk) -> ControlFlow<()>;

impl Stream for Recording {
    fn make(&self, take: &mut dyn FnMut(CommandChunk) -> ControlFlow<()>) -> Result<(), TraceError> {
        let (_, origin) = self.import(&mut Some(take), Vulkan::new(&self.path, &self.reading.limits))?;
        *self.origin.lock().unwrap_or_else(PoisonError::into_inner) = origin;
        Ok(())
    }

    fn length(&self) -> u64 {
        self.length
    }

    fn origin(&self) -> Origin {
        self.origin.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }
}

/// A file, and how much of it has been read.
struct Counting {
    file: File,
    read: Rc<Cell<u64>>,
}

impl Read for Counting {
    fn read(&mut self, bytes: &mut [u8]) -> std::io::Result<usize> {
        let read = self.file.read(bytes)?;
        self.read.set(self.read.get() + read as u64);
        Ok(read)
    }
}

impl Recording {
    /// Runs the blocks. With a function that takes parts, commands are handed over as they are made.
    fn import(&self, take: &mut Option<Take<'_>>, mut vulkan: Vulkan) -> Result<(Vulkan, Origin), TraceError> {
        let path = &self.path;
        let broken = |error: gfxr::Error| TraceError::new(path, error);
        let file = host::open(path, self.links).map_err(|error| TraceError::new(path, error))?;
        let read = Rc::new(Cell::new(0));
        let counting = Counting { file, read: read.clone() };
        let mut reader = Reader::new(BufReader::with_capacity(1 << 16, counting)).map_err(broken)?;
        let header = *reader.header();
        if take.is_some() {
            vulkan.card.keep_each();
        }
        let (mut stopped, mut shown) = (false, false);
        while vulkan.frames < self.frames.end {
            let Some(block) = reader.next_block().map_err(broken)? else { break };
            let ends = header.ends_frame(&block.body);
            let index = block.index;
            vulkan.log.block = index;
            let name = block.body.name();
            let presented = vulkan.block(block.body);
            match presented {
                Ok(()) => {}
                Err((block, name, Fault::Unsupported(what))) => vulkan.log.refuse(name, block, &what),
                Err((block, name, Fault::Damaged(reason) | Fault::Limit(reason))) => {
                    return Err(TraceError::new(path, format!("block {block}, {name}: {reason}")));
                }
            }
            if ends {
                match vulkan.show() {
                    Ok(with_picture) => shown |= with_picture,
                    Err(Fault::Unsupported(what)) => vulkan.log.refuse(name, index, &what),
                    Err(Fault::Damaged(reason) | Fault::Limit(reason)) => {
                        return Err(TraceError::new(path, format!("block {index}, {name}: {reason}")));
                    }
                }
            }
            if let Some(take) = take {
                // Commands after something that is not supported would give wrong pictures.
                if !self.reading.lenient
                    && let Some(refusal) = vulkan.log.refusal()
                {
                    return Err(unsupported(path, &refusal));
                }
                if vulkan.card.bytes() > PART && hand_over(&mut vulkan, take, read.get()).is_break() {
                    stopped = true;
                    break;
                }
            }
        }
        if !stopped && !shown && vulkan.frames < self.frames.end {
            vulkan.show_copied_out();
        }
        let refusal = vulkan.log.refusal();
        if let Some(refusal) = refusal.as_ref().filter(|_| !self.reading.lenient) {
            return Err(unsupported(path, refusal));
        }
        if let Some(take) = take.as_mut().filter(|_| !stopped) {
            // This is the last part.
            let _ = hand_over(&mut vulkan, take, read.get());
        }
        let mut origin = Origin::default();
        (origin.left_out, origin.notes) = (refusal, std::mem::take(&mut vulkan.log.notes));
        origin.facts = std::mem::take(&mut vulkan.facts);
        origin.cut = reader.cut().map(|cut| {
            format!(
                "the end of the capture is missing: the block at byte {} is not whole; those before are replayed",
                cut.offset
            )
        });
        Ok((vulkan, origin))
    }
}

fn hand_over(vulkan: &mut Vulkan, take: &mut Take<'_>, read: u64) -> ControlFlow<()> {
    take(CommandChunk { read, ..vulkan.card.drain() })
}

fn unsupported(path: &Path, refusal: &str) -> TraceError {
    TraceError::unsupported(path, format!("not supported: {refusal}; --lenient leaves it out"))
}

impl Vulkan {
    /// Runs a block.
    fn block(&mut self, body: Body) -> Result<(), Stop> {
        let (index, name) = (self.log.block, body.name());
        let stop = |fault: Fault| (index, name, fault);
        match body {
            Body::Call(call) => self.call(call),
            Body::UnknownCall { number, .. } => Err(stop(Fault::Unsupported(format!("call {number:#x}")))),
            Body::FillMemory { memory, offset, data } => self.fill_memory(memory, offset, data).map_err(stop),
            Body::InitBuffer { buffer, data, .. } => self.init_buffer(buffer, data).map_err(stop),
            Body::InitImage { image, aspect, levels, data, .. } => self.init_image(image, aspect, &levels, &data).map_err(stop),
            Body::DeviceProperties(device) => {
                let version = device.api_version;
                let api = format!("{}.{}.{}", version >> 22 & 127, version >> 12 & 1023, version & 4095);
                self.fact("Vulkan", api);
                self.fact("device", device.name);
                Ok(())
            }
            _ => Ok(()),
        }
    }

    fn fact(&mut self, name: &str, value: String) {
        if !value.is_empty() && self.facts.iter().all(|(known, _)| known != name) {
            self.facts.push((name.to_owned(), value));
        }
    }

    /// Runs a call: commands are kept in their list, others run at once.
    fn call(&mut self, call: gfxr::Call) -> Result<(), Stop> {
        let (index, name) = (self.log.block, call.name);
        let stop = |fault: Fault| (index, name, fault);
        if call.failed() {
            return Ok(());
        }
        if name.starts_with("vkCmd") {
            let handle = Args::from(&call).u64("commandBuffer").map_err(stop)?;
            let commands = known(self.objects.commands.get_mut(handle), "command buffer", handle).map_err(stop)?;
            let list = Rc::get_mut(&mut commands.list);
            let list = list.ok_or_else(|| stop(Fault::Damaged(format!("command buffer {handle} runs"))))?;
            list.push(Recorded { block: index, call });
            return Ok(());
        }
        let args = Args::from(&call);
        match name {
            "vkQueueSubmit" => {
                for submit in args.list("pSubmits").map_err(stop)? {
                    let buffers = submit.numbers("pCommandBuffers").map_err(stop)?;
                    self.submit(&buffers)?;
                }
                Ok(())
            }
            "vkQueueSubmit2" | "vkQueueSubmit2KHR" => {
                for submit in args.list("pSubmits").map_err(stop)? {
                    let infos = submit.list("pCommandBufferInfos").map_err(stop)?;
                    let buffers = infos.into_iter().map(|info| info.u64("commandBuffer")).collect::<Result<Vec<_>, _>>();
                    self.submit(&buffers.map_err(stop)?)?;
                }
                Ok(())
            }
            "vkQueuePresentKHR" => {
                let info = args.of("pPresentInfo").map_err(stop)?;
                let swapchain = info.numbers("pSwapchains").map_err(stop)?.first().copied();
                let image = info.numbers("pImageIndices").map_err(stop)?.first().copied();
                self.presented = swapchain.zip(image);
                Ok(())
            }
            "vkQueueBeginDebugUtilsLabelEXT" => {
                let label = args.of("pLabelInfo").and_then(|info| info.text("pLabelName")).map_err(stop)?;
                self.push_group(label, &mut Open::Nothing);
                Ok(())
            }
            "vkQueueEndDebugUtilsLabelEXT" => {
                self.pop_group(&mut Open::Nothing);
                Ok(())
            }
            "vkCreateInstance" => {
                let info = args.of("pCreateInfo").and_then(|info| info.maybe("pApplicationInfo")).map_err(stop)?;
                if let Some(info) = info {
                    self.fact("application", info.text("pApplicationName").map_err(stop)?.to_owned());
                }
                Ok(())
            }
            _ => match self.create(name, args).map_err(stop)? {
                true => Ok(()),
                false if is_ignored(name) => Ok(()),
                false => Err(stop(Fault::Unsupported("this call".into()))),
            },
        }
    }

    /// Ends a frame with the image that was presented last. Answers whether there is one.
    fn show(&mut self) -> Result<bool, Fault> {
        let Some((handle, index)) = self.presented.take() else { return Ok(false) };
        let swapchain = known(self.objects.swapchains.get(handle), "swapchain", handle)?;
        let image = known(swapchain.images.get(index as usize).copied(), "image of the swapchain", index)?;
        let texture = self.texture(image)?;
        self.card.present(texture);
        self.frames += 1;
        Ok(true)
    }

    /// Ends the only frame of a program without a window: it shows what was copied out last.
    fn show_copied_out(&mut self) {
        if let Some((texture, _)) = self.copied_out.take() {
            self.card.push(Command::Present { texture });
            self.frames += 1;
        }
    }
}

/// Calls that change nothing of a picture: questions, synchronisation, and objects that are not modelled.
fn is_ignored(name: &str) -> bool {
    const STARTS: [&str; 20] = [
        "vkGet",
        "vkEnumerate",
        "vkWait",
        "vkSetDebug",
        "vkDebug",
        "vkSubmitDebug",
        "vkDestroy",
        "vkReset",
        "vkTrim",
        "vkAcquire",
        "vkRelease",
        "vkFlushMapped",
        "vkInvalidateMapped",
        "vkUnmapMemory",
        "vkDeviceWaitIdle",
        "vkQueueWaitIdle",
        "vkImport",
        "vkQueueInsertDebug",
        "vkSetHdr",
        "vkSetPrivateData",
    ];
    const CREATED: [&str; 14] = [
        "vkCreateInstance",
        "vkCreateDevice",
        "vkCreateFence",
        "vkCreateSemaphore",
        "vkCreateEvent",
        "vkCreatePipelineCache",
        "vkCreateCommandPool",
        "vkCreateDescriptorPool",
        "vkCreateDebug",
        "vkCreateValidationCache",
        "vkCreatePrivateDataSlot",
        "vkCreateHeadlessSurface",
        "vkCreateDisplay",
        "vkCreateSamplerYcbcrConversion",
    ];
    const OTHERS: [&str; 9] = [
        "vkSignalSemaphore",
        "vkSignalSemaphoreKHR",
        "vkSetEvent",
        "vkEndCommandBuffer",
        "vkMergePipelineCaches",
        "vkSetDeviceMemoryPriorityEXT",
        "vkSetLatencyMarkerNV",
        "vkTransitionImageLayout",
        "vkTransitionImageLayoutEXT",
    ];
    let surface = name.starts_with("vkCreate") && name.contains("Surface");
    let starts = |list: &[&str]| list.iter().any(|start| name.starts_with(start));
    starts(&STARTS) || starts(&CREATED) || OTHERS.contains(&name) || surface
}
