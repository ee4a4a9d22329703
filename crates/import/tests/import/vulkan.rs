//! Captures of Vulkan programs, made by the writer of the format.

use std::path::PathBuf;

use gfxr::{Call, Header, Struct, Value, Writer};
use import::TraceKind;
use tempfile::TempDir;
use trace::command::Command;
use trace::{Reading, Trace, TraceError};

/// A capture in the making.
struct Capture {
    writer: Writer<Vec<u8>>,
}

fn handles(list: &[u64]) -> Value {
    Value::Array(list.iter().map(|&handle| Value::Handle(handle)).collect())
}

impl Capture {
    fn new() -> Capture {
        let header = Header { major: 0, minor: 0, compression: gfxr::Compression::Zlib };
        Capture { writer: Writer::new(Vec::new(), header).expect("a header") }
    }

    fn call(&mut self, call: Call) {
        self.writer.call(1, call).expect("a block");
    }

    fn begin(&mut self) {
        self.call(Call::new("vkBeginCommandBuffer").with("commandBuffer", 12u64));
    }

    /// A window of 8 × 4 pixels with one image, and a command buffer.
    fn window(&mut self) {
        let extent = Struct::new("VkExtent2D").with("width", 8u32).with("height", 4u32);
        let info = Struct::new("VkSwapchainCreateInfoKHR")
            .with("imageExtent", extent)
            .with("imageFormat", "VK_FORMAT_R8G8B8A8_UNORM")
            .with("imageArrayLayers", 1u32);
        self.call(Call::new("vkCreateSwapchainKHR").with("pCreateInfo", info).with("pSwapchain", 10u64));
        self.call(Call::new("vkGetSwapchainImagesKHR").with("swapchain", 10u64).with("pSwapchainImages", handles(&[11])));
        let info = Struct::new("VkCommandBufferAllocateInfo").with("commandBufferCount", 1u32);
        let buffers = Call::new("vkAllocateCommandBuffers").with("pAllocateInfo", info);
        self.call(buffers.with("pCommandBuffers", handles(&[12])));
    }

    /// Submits the command buffer and shows the image.
    fn frame(&mut self) {
        self.call(Call::new("vkEndCommandBuffer").with("commandBuffer", 12u64));
        let submit = Struct::new("VkSubmitInfo").with("commandBufferCount", 1u32).with("pCommandBuffers", handles(&[12]));
        self.call(Call::new("vkQueueSubmit").with("submitCount", 1u32).with("pSubmits", submit));
        let info = Struct::new("VkPresentInfoKHR")
            .with("swapchainCount", 1u32)
            .with("pSwapchains", handles(&[10]))
            .with("pImageIndices", Value::Words(vec![0]));
        self.call(Call::new("vkQueuePresentKHR").with("pPresentInfo", info));
    }

    fn clear(&mut self, image: u64, red: f32) {
        let range = Struct::new("VkImageSubresourceRange")
            .with("aspectMask", "VK_IMAGE_ASPECT_COLOR_BIT")
            .with("levelCount", 1u32)
            .with("layerCount", 1u32);
        let clear = Call::new("vkCmdClearColorImage")
            .with("commandBuffer", 12u64)
            .with("image", image)
            .with("pColor", Value::Words(vec![red.to_bits(), 0, 0, 1f32.to_bits()]))
            .with("rangeCount", 1u32)
            .with("pRanges", range);
        self.call(clear);
    }

    fn save(self) -> (TempDir, PathBuf) {
        let home = tempfile::tempdir().expect("a folder");
        let path = home.path().join("made.gfxr");
        std::fs::write(&path, self.writer.finish().expect("a capture")).expect("a file");
        (home, path)
    }
}

fn commands(trace: &Trace) -> Vec<Command> {
    let mut all = Vec::new();
    let kept = trace.for_each_command(|_, command| {
        all.push(command.clone());
        Ok::<(), TraceError>(())
    });
    kept.expect("commands");
    all
}

fn cleared_twice() -> (TempDir, PathBuf) {
    let mut capture = Capture::new();
    capture.window();
    for red in [0.25, 0.5] {
        capture.begin();
        capture.clear(11, red);
        capture.frame();
    }
    capture.save()
}

#[test]
fn a_capture_becomes_a_trace_that_keeps_the_rules() {
    let (home, path) = cleared_twice();
    assert_eq!(import::detect(home.path()).expect("a capture").kind, TraceKind::Gfxr);
    let trace = import::open(&path).expect("a trace");
    let summary = trace::check(&trace).expect("rules");
    assert_eq!((summary.frames, summary.presented), (2, Some([8, 4])));
    let clears: Vec<f64> = commands(&trace)
        .into_iter()
        .filter_map(|command| match command {
            Command::BeginRenderPass { color, .. } => color.first()?.as_ref()?.clear.map(|clear| clear[0]),
            _ => None,
        })
        .collect();
    assert_eq!(clears, [0.25, 0.5], "the command buffer ran once as it was recorded each time");
}

#[test]
fn a_long_capture_is_a_stream_of_the_same_commands() {
    let (_home, path) = cleared_twice();
    let short = commands(&import::open(&path).expect("a trace"));
    let streamed = import::open_with(&path, &Reading { in_memory: Some(0), ..Reading::default() }).expect("a stream");
    assert!(streamed.is_stream());
    assert_eq!(commands(&streamed), short);
    assert_eq!(commands(&streamed), short, "a second reader gets the same");
}

#[test]
fn what_is_not_supported_is_refused_by_name_or_left_out() {
    let mut capture = Capture::new();
    capture.window();
    capture.begin();
    capture.call(Call::new("vkCmdDrawMeshTasksEXT").with("commandBuffer", 12u64));
    capture.clear(11, 1.0);
    capture.frame();
    let (_home, path) = capture.save();
    let error = import::open(&path).err().expect("a refusal");
    assert!(error.unsupported, "{error}");
    let text = error.to_string();
    assert!(text.contains("vkCmdDrawMeshTasksEXT: this command (1 times, first in block 4)"), "{text}");
    let trace = import::open_with(&path, &Reading { lenient: true, ..Reading::default() }).expect("a trace");
    assert!(trace.origin().left_out.is_some_and(|left| left.contains("vkCmdDrawMeshTasksEXT")));
    assert_eq!(trace::check(&trace).expect("rules").frames, 1);
}

#[test]
fn a_capture_that_contradicts_itself_names_block_and_call() {
    let mut capture = Capture::new();
    capture.window();
    capture.begin();
    capture.clear(99, 1.0);
    capture.frame();
    let (_home, path) = capture.save();
    let error = import::open(&path).err().expect("an error");
    assert!(!error.unsupported);
    assert!(error.to_string().contains("block 4, vkCmdClearColorImage: there is no image 99"), "{error}");
}
