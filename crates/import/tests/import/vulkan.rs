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

fn words(text: &str) -> Value {
    let module = naga::front::wgsl::parse_str(text).expect("WGSL");
    let info = naga::valid::Validator::new(Default::default(), Default::default()).validate(&module).expect("a module");
    Value::Words(naga::back::spv::write_vec(&module, &info, &Default::default(), None).expect("words"))
}

fn extent(width: u32, height: u32) -> Struct {
    Struct::new("VkExtent2D").with("width", width).with("height", height)
}

impl Capture {
    /// A buffer of 256 bytes in memory of its own.
    fn buffer(&mut self, handle: u64) {
        let memory = handle + 100;
        let info = Struct::new("VkMemoryAllocateInfo").with("allocationSize", 256u64);
        self.call(Call::new("vkAllocateMemory").with("pAllocateInfo", info).with("pMemory", memory));
        let info = Struct::new("VkBufferCreateInfo").with("size", 256u64);
        self.call(Call::new("vkCreateBuffer").with("pCreateInfo", info).with("pBuffer", handle));
        self.call(Call::new("vkBindBufferMemory").with("buffer", handle).with("memory", memory));
    }

    /// A pipeline of triangles, or of another topology, with a number.
    fn pipeline(&mut self, handle: u64, topology: &str, restart: bool, cull: u32) {
        let text = "@vertex fn main(@builtin(vertex_index) i: u32) -> @builtin(position) vec4f { return vec4f(f32(i)); }";
        let info = Struct::new("VkShaderModuleCreateInfo").with("pCode", words(text));
        self.call(Call::new("vkCreateShaderModule").with("pCreateInfo", info).with("pShaderModule", handle + 100));
        let stage = Struct::new("VkPipelineShaderStageCreateInfo")
            .with("stage", "VK_SHADER_STAGE_VERTEX_BIT")
            .with("module", handle + 100)
            .with("pName", "main");
        let assembly = Struct::new("VkPipelineInputAssemblyStateCreateInfo")
            .with("topology", topology)
            .with("primitiveRestartEnable", u32::from(restart));
        let viewport = Struct::new("VkViewport").with("width", 8f32).with("height", 4f32).with("maxDepth", 1f32);
        let viewports = Struct::new("VkPipelineViewportStateCreateInfo")
            .with("viewportCount", 1u32)
            .with("pViewports", viewport)
            .with("scissorCount", 1u32)
            .with("pScissors", Struct::new("VkRect2D").with("extent", extent(8, 4)));
        let raster = Struct::new("VkPipelineRasterizationStateCreateInfo").with("cullMode", cull).with("lineWidth", 1f32);
        let info = Struct::new("VkGraphicsPipelineCreateInfo")
            .with("stageCount", 1u32)
            .with("pStages", stage)
            .with("pInputAssemblyState", assembly)
            .with("pViewportState", viewports)
            .with("pRasterizationState", raster);
        let create = Call::new("vkCreateGraphicsPipelines").with("createInfoCount", 1u32).with("pCreateInfos", info);
        self.call(create.with("pPipelines", handles(&[handle])));
    }

    fn view(&mut self) {
        let range = Struct::new("VkImageSubresourceRange")
            .with("aspectMask", "VK_IMAGE_ASPECT_COLOR_BIT")
            .with("levelCount", 1u32)
            .with("layerCount", 1u32);
        let info = Struct::new("VkImageViewCreateInfo")
            .with("image", 11u64)
            .with("viewType", "VK_IMAGE_VIEW_TYPE_2D")
            .with("format", "VK_FORMAT_R8G8B8A8_UNORM")
            .with("subresourceRange", range);
        self.call(Call::new("vkCreateImageView").with("pCreateInfo", info).with("pView", 13u64));
    }

    fn command(&mut self, call: Call) {
        self.call(call.with("commandBuffer", 12u64));
    }

    fn begin_rendering(&mut self) {
        let target = Struct::new("VkRenderingAttachmentInfo").with("imageView", 13u64).with("loadOp", 1u32);
        let info = Struct::new("VkRenderingInfo")
            .with("renderArea", Struct::new("VkRect2D").with("extent", extent(8, 4)))
            .with("layerCount", 1u32)
            .with("colorAttachmentCount", 1u32)
            .with("pColorAttachments", target);
        self.command(Call::new("vkCmdBeginRendering").with("pRenderingInfo", info));
    }

    fn bind(&mut self, pipeline: u64) {
        self.command(Call::new("vkCmdBindPipeline").with("pipeline", pipeline));
    }

    fn draw(&mut self, count: u32) {
        self.command(Call::new("vkCmdDraw").with("vertexCount", count).with("instanceCount", 1u32));
    }

    fn draw_indexed(&mut self, kind: &str, count: u32) {
        let bind = Call::new("vkCmdBindIndexBuffer").with("buffer", 20u64).with("indexType", kind);
        self.command(bind);
        let draw = Call::new("vkCmdDrawIndexed").with("indexCount", count).with("instanceCount", 1u32);
        self.command(draw.with("firstIndex", 3u32));
    }

    fn condition(&mut self, inverted: bool) {
        let info = Struct::new("VkConditionalRenderingBeginInfoEXT").with("buffer", 20u64).with("flags", u32::from(inverted));
        self.command(Call::new("vkCmdBeginConditionalRenderingEXT").with("pConditionalRenderingBegin", info));
    }

    fn end_rendering(&mut self) {
        self.command(Call::new("vkCmdEndRendering"));
    }
}

/// One frame of commands in a pass, with two pipelines that cull both faces (triangles, 30, and lines, 31), and two of lists with (32) and of
/// triangles without indices that end primitives (33).
fn drawn(commands: impl FnOnce(&mut Capture)) -> (TempDir, PathBuf) {
    let mut capture = Capture::new();
    capture.window();
    capture.view();
    capture.buffer(20);
    let list = "VK_PRIMITIVE_TOPOLOGY_TRIANGLE_LIST";
    capture.pipeline(30, list, false, 3);
    capture.pipeline(31, "VK_PRIMITIVE_TOPOLOGY_LINE_LIST", false, 3);
    capture.pipeline(32, list, true, 0);
    capture.pipeline(33, list, false, 0);
    capture.begin();
    capture.begin_rendering();
    commands(&mut capture);
    capture.end_rendering();
    capture.frame();
    capture.save()
}

/// The draws and dispatches of a capture that keeps the rules.
fn work(path: &std::path::Path) -> Vec<Command> {
    let trace = import::open(path).expect("a trace");
    trace::check(&trace).expect("rules");
    let mut all = commands(&trace);
    all.retain(|command| {
        use Command::*;
        matches!(command, Draw { .. } | DrawIndexed { .. } | DrawIndirect { .. } | Dispatch { .. } | DispatchIndirect { .. })
    });
    all
}

#[test]
fn culling_of_both_faces_leaves_lines_and_points() {
    let (_home, path) = drawn(|capture| {
        capture.bind(30);
        capture.draw(3);
        capture.bind(31);
        capture.draw(2);
    });
    assert_eq!(work(&path), [Command::Draw { vertices: 2, instances: 1, first_vertex: 0, first_instance: 0 }]);
}

#[test]
fn indices_of_8_bits_and_those_that_end_lists_are_converted() {
    let (_home, path) = drawn(|capture| {
        capture.bind(33);
        capture.draw_indexed("VK_INDEX_TYPE_UINT8", 5);
        capture.bind(32);
        capture.draw_indexed("VK_INDEX_TYPE_UINT16", 5);
    });
    let all = work(&path);
    let one = Command::Dispatch { groups: [1, 1, 1] };
    let plain = Command::DrawIndexed { indices: 5, instances: 1, first_index: 0, base_vertex: 0, first_instance: 0 };
    assert_eq!(all[..3], [one.clone(), one, plain]);
    assert!(matches!(all[3..], [Command::DrawIndirect { indexed: true, count: 1, count_buffer: None, .. }]), "{all:?}");
}

#[test]
fn conditions_hold_for_draws_and_clears_inverted_or_not() {
    for (inverted, dispatches) in [(false, 0), (true, 2)] {
        let (_home, path) = drawn(|capture| {
            capture.condition(inverted);
            capture.bind(33);
            capture.draw(3);
            let rect = Struct::new("VkClearRect")
                .with("rect", Struct::new("VkRect2D").with("extent", extent(2, 2)))
                .with("layerCount", 1u32);
            let clear = Struct::new("VkClearAttachment").with("aspectMask", "VK_IMAGE_ASPECT_COLOR_BIT");
            let clear =
                Call::new("vkCmdClearAttachments").with("pAttachments", clear.with("clearValue", Value::Words(vec![0; 4])));
            capture.command(clear.with("attachmentCount", 1u32).with("rectCount", 1u32).with("pRects", rect));
            capture.command(Call::new("vkCmdEndConditionalRenderingEXT"));
            capture.draw(6);
        });
        let all = work(&path);
        let is_counted = |command: &&Command| matches!(command, Command::DrawIndirect { count: 1, count_buffer: Some(_), .. });
        assert_eq!(all.iter().filter(is_counted).count(), 2, "{all:?}");
        assert_eq!(all.iter().filter(|command| matches!(command, Command::Dispatch { .. })).count(), dispatches);
        assert!(matches!(all.last(), Some(Command::Draw { vertices: 6, .. })));
    }
}

#[test]
fn results_of_queries_are_written_in_32_bits() {
    let mut capture = Capture::new();
    capture.window();
    capture.buffer(20);
    let info = Struct::new("VkQueryPoolCreateInfo").with("queryType", "VK_QUERY_TYPE_OCCLUSION").with("queryCount", 4u32);
    capture.call(Call::new("vkCreateQueryPool").with("pCreateInfo", info).with("pQueryPool", 40u64));
    capture.begin();
    let copy = Call::new("vkCmdCopyQueryPoolResults").with("queryPool", 40u64).with("queryCount", 4u32);
    capture.command(copy.with("dstBuffer", 20u64).with("stride", 4u64).with("flags", 2u32));
    capture.clear(11, 1.0);
    capture.frame();
    let (_home, path) = capture.save();
    assert_eq!(work(&path), [Command::Dispatch { groups: [1, 1, 1] }]);
}
