//! Captures of Vulkan programs, made by the writer of the format.

use gfxr::{Body, Call, Header, Struct, Value, Writer};

const VERTEX: &str = "@vertex fn main(@builtin(vertex_index) i: u32) -> @builtin(position) vec4f { return vec4f(f32(i)); }";

pub fn handles(list: &[u64]) -> Value {
    Value::Array(list.iter().map(|&handle| Value::Handle(handle)).collect())
}

/// A capture in the making.
pub struct Capture {
    pub header: Header,
    pub blocks: Vec<Body>,
    /// The text of the vertex stage of pipelines that follow.
    pub vertex: &'static str,
}

impl Capture {
    pub fn new() -> Capture {
        Capture {
            header: Header { major: 0, minor: 0, compression: gfxr::Compression::Zlib },
            blocks: Vec::new(),
            vertex: VERTEX,
        }
    }

    pub fn call(&mut self, call: Call) {
        self.blocks.push(Body::Call(call));
    }

    pub fn begin(&mut self) {
        self.call(Call::new("vkBeginCommandBuffer").with("commandBuffer", 12u64));
    }

    /// A window of 8 × 4 pixels with one image, and a command buffer.
    pub fn window(&mut self) {
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
    pub fn frame(&mut self) {
        self.call(Call::new("vkEndCommandBuffer").with("commandBuffer", 12u64));
        let submit = Struct::new("VkSubmitInfo").with("commandBufferCount", 1u32).with("pCommandBuffers", handles(&[12]));
        self.call(Call::new("vkQueueSubmit").with("submitCount", 1u32).with("pSubmits", submit));
        let info = Struct::new("VkPresentInfoKHR")
            .with("swapchainCount", 1u32)
            .with("pSwapchains", handles(&[10]))
            .with("pImageIndices", Value::Words(vec![0]));
        self.call(Call::new("vkQueuePresentKHR").with("pPresentInfo", info));
    }

    pub fn clear(&mut self, image: u64, red: f32) {
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

    /// The file.
    pub fn bytes(&self) -> Vec<u8> {
        let mut writer = Writer::new(Vec::new(), self.header).expect("a header");
        for block in &self.blocks {
            // A block that was changed may hold what a capture cannot; it is left out.
            let _ = writer.block(1, block);
        }
        writer.finish().expect("a capture")
    }
}

fn words(text: &str) -> Vec<u32> {
    words_with(text, |_| {})
}

/// The words of a module that is changed before it is written.
pub fn words_with(text: &str, change: impl FnOnce(&mut naga::Module)) -> Vec<u32> {
    let mut module = naga::front::wgsl::parse_str(text).expect("WGSL");
    change(&mut module);
    let all = naga::valid::Capabilities::all();
    let info = naga::valid::Validator::new(Default::default(), all).validate(&module).expect("a module");
    naga::back::spv::write_vec(&module, &info, &Default::default(), None).expect("words")
}

/// The module with its texture of several samples as an input attachment, read at the fragment.
fn as_attachment(mut words: Vec<u32>) -> Vec<u32> {
    const TYPE_IMAGE: u32 = 25;
    const DECORATE: u32 = 71;
    const IMAGE_FETCH: u32 = 95;
    const IMAGE_READ: u32 = 98;
    const BINDING: u32 = 33;
    const INPUT_ATTACHMENT_INDEX: u32 = 43;
    const SUBPASS_DATA: u32 = 6;
    let mut at = 5;
    while at < words.len() {
        let length = (words[at] >> 16) as usize;
        match words[at] & 0xffff {
            TYPE_IMAGE => (words[at + 3], words[at + 7]) = (SUBPASS_DATA, 2),
            IMAGE_FETCH => words[at] += IMAGE_READ - IMAGE_FETCH,
            DECORATE if words[at + 2] == BINDING => {
                let index = [4 << 16 | DECORATE, words[at + 1], INPUT_ATTACHMENT_INDEX, 0];
                words.splice(at..at, index);
                at += index.len();
            }
            _ => {}
        }
        at += length;
    }
    words
}

pub fn extent(width: u32, height: u32) -> Struct {
    Struct::new("VkExtent2D").with("width", width).with("height", height)
}

impl Capture {
    /// A buffer of 256 bytes in memory of its own.
    pub fn buffer(&mut self, handle: u64) {
        let memory = handle + 100;
        let info = Struct::new("VkMemoryAllocateInfo").with("allocationSize", 256u64);
        self.call(Call::new("vkAllocateMemory").with("pAllocateInfo", info).with("pMemory", memory));
        let info = Struct::new("VkBufferCreateInfo").with("size", 256u64);
        self.call(Call::new("vkCreateBuffer").with("pCreateInfo", info).with("pBuffer", handle));
        self.call(Call::new("vkBindBufferMemory").with("buffer", handle).with("memory", memory));
    }

    /// A pipeline without a fragment stage.
    pub fn pipeline(&mut self, handle: u64, topology: &str, restart: bool, cull: u32) {
        self.pipeline_with(handle, (topology, restart, cull), None);
    }

    /// A stage of a pipeline; its module has the number of the pipeline and more.
    pub fn stage(&mut self, module: u64, stage: &str, text: &str) -> Struct {
        self.stage_of(module, stage, words(text))
    }

    /// A stage of a pipeline with the words of its module.
    pub fn stage_of(&mut self, module: u64, stage: &str, words: Vec<u32>) -> Struct {
        let info = Struct::new("VkShaderModuleCreateInfo").with("pCode", Value::Words(words));
        self.call(Call::new("vkCreateShaderModule").with("pCreateInfo", info).with("pShaderModule", module));
        let of = Struct::new("VkPipelineShaderStageCreateInfo").with("stage", stage);
        of.with("module", module).with("pName", "main")
    }

    /// A pipeline, with the text of its fragment stage and its layout.
    pub fn pipeline_with(&mut self, handle: u64, state: (&str, bool, u32), fragment: Option<(&str, u64)>) {
        let mut stages = vec![self.stage(handle + 100, "VK_SHADER_STAGE_VERTEX_BIT", self.vertex)];
        if let Some((text, _)) = fragment {
            stages.push(self.stage(handle + 200, "VK_SHADER_STAGE_FRAGMENT_BIT", text));
        }
        self.pipeline_of(handle, state, stages, fragment.map_or(0, |(_, layout)| layout));
    }

    /// A pipeline of these stages, with its layout.
    pub fn pipeline_of(&mut self, handle: u64, (topology, restart, cull): (&str, bool, u32), stages: Vec<Struct>, layout: u64) {
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
            .with("stageCount", stages.len() as u32)
            .with("pStages", stages)
            .with("layout", layout)
            .with("pInputAssemblyState", assembly)
            .with("pViewportState", viewports)
            .with("pRasterizationState", raster);
        let blend = Struct::new("VkPipelineColorBlendAttachmentState").with("colorWriteMask", 15u32);
        let blend =
            Struct::new("VkPipelineColorBlendStateCreateInfo").with("attachmentCount", 1u32).with("pAttachments", blend);
        let info = info.with("pColorBlendState", blend);
        let create = Call::new("vkCreateGraphicsPipelines").with("createInfoCount", 1u32).with("pCreateInfos", info);
        self.call(create.with("pPipelines", handles(&[handle])));
    }

    pub fn view(&mut self) {
        self.view_of(11, 13);
    }

    /// A view of the first level of an image.
    pub fn view_of(&mut self, image: u64, view: u64) {
        let range = Struct::new("VkImageSubresourceRange")
            .with("aspectMask", "VK_IMAGE_ASPECT_COLOR_BIT")
            .with("levelCount", 1u32)
            .with("layerCount", 1u32);
        let info = Struct::new("VkImageViewCreateInfo")
            .with("image", image)
            .with("viewType", "VK_IMAGE_VIEW_TYPE_2D")
            .with("format", "VK_FORMAT_R8G8B8A8_UNORM")
            .with("subresourceRange", range);
        self.call(Call::new("vkCreateImageView").with("pCreateInfo", info).with("pView", view));
    }

    /// An image of 8-bit channels.
    pub fn image(&mut self, handle: u64, [width, height]: [u32; 2], levels: u32, samples: u32) {
        let size = Struct::new("VkExtent3D").with("width", width).with("height", height).with("depth", 1u32);
        let info = Struct::new("VkImageCreateInfo")
            .with("imageType", "VK_IMAGE_TYPE_2D")
            .with("format", "VK_FORMAT_R8G8B8A8_UNORM")
            .with("extent", size)
            .with("mipLevels", levels)
            .with("arrayLayers", 1u32)
            .with("samples", samples);
        self.call(Call::new("vkCreateImage").with("pCreateInfo", info).with("pImage", handle));
    }

    /// A descriptor set (55) with its layout (53) and a layout of pipelines (54): each binding has a type and as many descriptors as views.
    /// Buffers are buffer 20.
    pub fn set(&mut self, bindings: &[(&str, &[u64])], sampler: u64) {
        let binding = |(at, (kind, views)): (u32, &(&str, &[u64]))| {
            let of = Struct::new("VkDescriptorSetLayoutBinding").with("binding", at).with("descriptorType", *kind);
            of.with("descriptorCount", views.len() as u32)
        };
        let count = bindings.len() as u32;
        let info = Struct::new("VkDescriptorSetLayoutCreateInfo")
            .with("bindingCount", count)
            .with("pBindings", (0..).zip(bindings).map(binding).collect::<Vec<Struct>>());
        self.call(Call::new("vkCreateDescriptorSetLayout").with("pCreateInfo", info).with("pSetLayout", 53u64));
        let layouts =
            Struct::new("VkPipelineLayoutCreateInfo").with("setLayoutCount", 1u32).with("pSetLayouts", handles(&[53]));
        self.call(Call::new("vkCreatePipelineLayout").with("pCreateInfo", layouts).with("pPipelineLayout", 54u64));
        let info =
            Struct::new("VkDescriptorSetAllocateInfo").with("descriptorSetCount", 1u32).with("pSetLayouts", handles(&[53]));
        let sets = Call::new("vkAllocateDescriptorSets").with("pAllocateInfo", info);
        self.call(sets.with("pDescriptorSets", handles(&[55])));
        let write = |(at, (kind, views)): (u32, &(&str, &[u64]))| {
            let image = |&view: &u64| Struct::new("VkDescriptorImageInfo").with("imageView", view).with("sampler", sampler);
            let buffer = Struct::new("VkDescriptorBufferInfo").with("buffer", 20u64).with("range", 256u64);
            let of = Struct::new("VkWriteDescriptorSet").with("dstSet", 55u64).with("dstBinding", at);
            let of = of.with("descriptorType", *kind).with("descriptorCount", views.len() as u32);
            match kind.ends_with("BUFFER") {
                true => of.with("pBufferInfo", buffer),
                false => of.with("pImageInfo", views.iter().map(image).collect::<Vec<Struct>>()),
            }
        };
        let update = Call::new("vkUpdateDescriptorSets").with("descriptorWriteCount", count);
        self.call(update.with("pDescriptorWrites", (0..).zip(bindings).map(write).collect::<Vec<Struct>>()));
    }

    /// Binds descriptor set 55 and a pipeline for draws or dispatches.
    pub fn bind_with_set(&mut self, point: &str, pipeline: u64) {
        let bind = Call::new("vkCmdBindDescriptorSets").with("pipelineBindPoint", point).with("layout", 54u64);
        self.command(bind.with("descriptorSetCount", 1u32).with("pDescriptorSets", handles(&[55])));
        self.command(Call::new("vkCmdBindPipeline").with("pipelineBindPoint", point).with("pipeline", pipeline));
    }

    /// A compute pipeline with the layout of the set.
    pub fn compute_pipeline(&mut self, handle: u64, text: &str) {
        let stage = self.stage(handle + 100, "VK_SHADER_STAGE_COMPUTE_BIT", text);
        let info = Struct::new("VkComputePipelineCreateInfo").with("stage", stage).with("layout", 54u64);
        let create = Call::new("vkCreateComputePipelines").with("createInfoCount", 1u32).with("pCreateInfos", info);
        self.call(create.with("pPipelines", handles(&[handle])));
    }

    /// Copies buffer 20 to an image.
    pub fn copy_buffer_to(&mut self, image: u64, [width, height]: [u32; 2]) {
        let layers =
            Struct::new("VkImageSubresourceLayers").with("aspectMask", "VK_IMAGE_ASPECT_COLOR_BIT").with("layerCount", 1u32);
        let size = Struct::new("VkExtent3D").with("width", width).with("height", height).with("depth", 1u32);
        let region = Struct::new("VkBufferImageCopy").with("imageSubresource", layers).with("imageExtent", size);
        let copy = Call::new("vkCmdCopyBufferToImage").with("srcBuffer", 20u64).with("dstImage", image);
        self.command(copy.with("regionCount", 1u32).with("pRegions", region));
    }

    pub fn command(&mut self, call: Call) {
        self.call(call.with("commandBuffer", 12u64));
    }

    pub fn begin_rendering(&mut self) {
        self.begin_rendering_to(13);
    }

    /// Begins a pass that clears the image of a view.
    pub fn begin_rendering_to(&mut self, view: u64) {
        let target = Struct::new("VkRenderingAttachmentInfo").with("imageView", view).with("loadOp", 1u32);
        let info = Struct::new("VkRenderingInfo")
            .with("renderArea", Struct::new("VkRect2D").with("extent", extent(8, 4)))
            .with("layerCount", 1u32)
            .with("colorAttachmentCount", 1u32)
            .with("pColorAttachments", target);
        self.command(Call::new("vkCmdBeginRendering").with("pRenderingInfo", info));
    }

    pub fn bind(&mut self, pipeline: u64) {
        self.command(Call::new("vkCmdBindPipeline").with("pipeline", pipeline));
    }

    pub fn draw(&mut self, count: u32) {
        self.command(Call::new("vkCmdDraw").with("vertexCount", count).with("instanceCount", 1u32));
    }

    pub fn draw_indexed(&mut self, kind: &str, count: u32) {
        let bind = Call::new("vkCmdBindIndexBuffer").with("buffer", 20u64).with("indexType", kind);
        self.command(bind);
        let draw = Call::new("vkCmdDrawIndexed").with("indexCount", count).with("instanceCount", 1u32);
        self.command(draw.with("firstIndex", 3u32));
    }

    /// One attribute, at location 0, that changes after this number of instances, from buffer 20.
    pub fn attribute_of_instances(&mut self, divisor: u32) {
        let binding = Struct::new("VkVertexInputBindingDescription2EXT").with("stride", 4u32).with("inputRate", 1u32);
        let attribute = Struct::new("VkVertexInputAttributeDescription2EXT").with("format", "VK_FORMAT_R32_SFLOAT");
        let input = Call::new("vkCmdSetVertexInputEXT")
            .with("vertexBindingDescriptionCount", 1u32)
            .with("pVertexBindingDescriptions", binding.with("divisor", divisor))
            .with("vertexAttributeDescriptionCount", 1u32)
            .with("pVertexAttributeDescriptions", attribute);
        self.command(input);
        let bind = Call::new("vkCmdBindVertexBuffers").with("bindingCount", 1u32).with("pBuffers", handles(&[20]));
        self.command(bind.with("pOffsets", Value::Array(vec![Value::U64(0)])));
    }

    pub fn condition(&mut self, inverted: bool) {
        let info = Struct::new("VkConditionalRenderingBeginInfoEXT").with("buffer", 20u64).with("flags", u32::from(inverted));
        self.command(Call::new("vkCmdBeginConditionalRenderingEXT").with("pConditionalRenderingBegin", info));
    }

    pub fn end_rendering(&mut self) {
        self.command(Call::new("vkCmdEndRendering"));
    }
}

/// One frame of commands in a pass, with two pipelines that cull both faces (triangles, 30, and lines, 31), and two of lists with (32) and of
/// triangles without indices that end primitives (33).
pub fn drawn(commands: impl FnOnce(&mut Capture)) -> Capture {
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
    capture
}

/// Two frames that are cleared.
pub fn cleared_twice() -> Capture {
    let mut capture = Capture::new();
    capture.window();
    for red in [0.25, 0.5] {
        capture.begin();
        capture.clear(11, red);
        capture.frame();
    }
    capture
}

/// A frame with draws with indices and under a condition, a clear, and results of queries.
pub fn converted() -> Capture {
    drawn(|capture| {
        capture.bind(33);
        capture.draw_indexed("VK_INDEX_TYPE_UINT8", 5);
        capture.bind(32);
        capture.draw_indexed("VK_INDEX_TYPE_UINT16", 5);
        capture.condition(true);
        capture.draw(3);
        let rect = Struct::new("VkRect2D").with("extent", extent(2, 2));
        let rect = Struct::new("VkClearRect").with("rect", rect).with("layerCount", 1u32);
        let clear = Struct::new("VkClearAttachment").with("aspectMask", "VK_IMAGE_ASPECT_COLOR_BIT");
        let clear = Call::new("vkCmdClearAttachments").with("pAttachments", clear.with("clearValue", Value::Words(vec![0; 4])));
        capture.command(clear.with("attachmentCount", 1u32).with("rectCount", 1u32).with("pRects", rect));
        capture.command(Call::new("vkCmdEndConditionalRenderingEXT"));
        let indirect = Call::new("vkCmdDrawIndirect").with("buffer", 20u64).with("drawCount", 2u32).with("stride", 16u32);
        capture.command(indirect);
    })
}

/// A frame that draws with an image of a view that exchanges channels and a sampler with a bias, and a dispatch under a condition.
pub fn sampled() -> Capture {
    let mut capture = Capture::new();
    capture.window();
    capture.view();
    capture.buffer(20);
    capture.image(50, [4, 4], 2, 1);
    let range = Struct::new("VkImageSubresourceRange")
        .with("aspectMask", "VK_IMAGE_ASPECT_COLOR_BIT")
        .with("levelCount", 2u32)
        .with("layerCount", 1u32);
    let components =
        Struct::new("VkComponentMapping").with("r", "VK_COMPONENT_SWIZZLE_B").with("a", "VK_COMPONENT_SWIZZLE_ONE");
    let info = Struct::new("VkImageViewCreateInfo")
        .with("image", 50u64)
        .with("viewType", "VK_IMAGE_VIEW_TYPE_2D")
        .with("format", "VK_FORMAT_R8G8B8A8_UNORM")
        .with("components", components)
        .with("subresourceRange", range);
    capture.call(Call::new("vkCreateImageView").with("pCreateInfo", info).with("pView", 51u64));
    let info = Struct::new("VkSamplerCreateInfo").with("mipLodBias", 1f32).with("maxLod", 4f32);
    capture.call(Call::new("vkCreateSampler").with("pCreateInfo", info).with("pSampler", 52u64));
    capture.set(
        &[
            ("VK_DESCRIPTOR_TYPE_SAMPLED_IMAGE", &[51]),
            ("VK_DESCRIPTOR_TYPE_SAMPLER", &[0]),
            ("VK_DESCRIPTOR_TYPE_STORAGE_BUFFER", &[0]),
        ],
        52,
    );
    let text = "@group(0) @binding(0) var image: texture_2d<f32>; @group(0) @binding(1) var own: sampler;
        @fragment fn main() -> @location(0) vec4f { return textureSample(image, own, vec2f(0.5)); }";
    capture.pipeline_with(30, ("VK_PRIMITIVE_TOPOLOGY_TRIANGLE_LIST", false, 0), Some((text, 54)));
    let text = "@group(0) @binding(2) var<storage, read_write> all: array<u32>;
        @compute @workgroup_size(1) fn main() { all[1] = 1; }";
    capture.compute_pipeline(31, text);
    capture.blocks.push(Body::FillMemory { memory: 120, offset: 0, data: vec![1; 64] });
    capture.begin();
    capture.copy_buffer_to(50, [4, 4]);
    capture.bind_with_set("VK_PIPELINE_BIND_POINT_COMPUTE", 31);
    capture.bind_with_set("VK_PIPELINE_BIND_POINT_GRAPHICS", 30);
    capture.condition(false);
    let dispatch = Call::new("vkCmdDispatch").with("groupCountX", 1u32).with("groupCountY", 1u32).with("groupCountZ", 1u32);
    capture.command(dispatch);
    capture.command(Call::new("vkCmdEndConditionalRenderingEXT"));
    capture.begin_rendering();
    capture.draw(3);
    capture.end_rendering();
    capture.frame();
    capture
}

/// A triangle that covers the window.
const COVERING: &str = "@vertex fn main(@builtin(vertex_index) i: u32) -> @builtin(position) vec4f {
    return vec4f(f32(i & 1) * 4 - 1, f32(i >> 1) * 4 - 1, 0.5, 1.0);
}";

/// A frame whose second subpass reads the third of four samples that the first one draws: a quarter of red for each sample before, and green
/// that grows from column to column.
pub fn multisampled_attachment() -> Capture {
    let mut capture = Capture::new();
    capture.window();
    capture.view();
    capture.image(60, [8, 4], 1, 4);
    capture.view_of(60, 61);
    let attachment = |samples: u32| {
        let of = Struct::new("VkAttachmentDescription").with("format", "VK_FORMAT_R8G8B8A8_UNORM");
        of.with("samples", samples).with("loadOp", "VK_ATTACHMENT_LOAD_OP_CLEAR")
    };
    let reference = |attachment: u32| Struct::new("VkAttachmentReference").with("attachment", attachment);
    let subpass = |color: u32| {
        let of = Struct::new("VkSubpassDescription").with("colorAttachmentCount", 1u32);
        of.with("pColorAttachments", reference(color))
    };
    let reading = subpass(1).with("inputAttachmentCount", 1u32).with("pInputAttachments", reference(0));
    let info = Struct::new("VkRenderPassCreateInfo")
        .with("attachmentCount", 2u32)
        .with("pAttachments", vec![attachment(4), attachment(1)])
        .with("subpassCount", 2u32)
        .with("pSubpasses", vec![subpass(0), reading]);
    capture.call(Call::new("vkCreateRenderPass").with("pCreateInfo", info).with("pRenderPass", 62u64));
    let info = Struct::new("VkFramebufferCreateInfo").with("attachmentCount", 2u32).with("layers", 1u32);
    let info = info.with("pAttachments", handles(&[61, 13]));
    capture.call(Call::new("vkCreateFramebuffer").with("pCreateInfo", info).with("pFramebuffer", 63u64));
    capture.set(&[("VK_DESCRIPTOR_TYPE_INPUT_ATTACHMENT", &[61])], 0);
    let drawing = "@fragment fn main(@builtin(sample_index) i: u32, @builtin(position) p: vec4f) -> @location(0) vec4f {
        return vec4f(f32(i) * 0.25, floor(p.x) / 8.0, 0.0, 1.0);
    }";
    let reading = "@group(0) @binding(0) var own: texture_multisampled_2d<f32>;
        @fragment fn main() -> @location(0) vec4f { return textureLoad(own, vec2i(0), 2); }";
    let triangles = ("VK_PRIMITIVE_TOPOLOGY_TRIANGLE_LIST", false, 0);
    for (handle, fragment) in [(34, words(drawing)), (35, as_attachment(words(reading)))] {
        let stages = vec![
            capture.stage(handle + 100, "VK_SHADER_STAGE_VERTEX_BIT", COVERING),
            capture.stage_of(handle + 200, "VK_SHADER_STAGE_FRAGMENT_BIT", fragment),
        ];
        capture.pipeline_of(handle, triangles, stages, 54);
    }
    capture.begin();
    let info = Struct::new("VkRenderPassBeginInfo")
        .with("renderPass", 62u64)
        .with("framebuffer", 63u64)
        .with("renderArea", Struct::new("VkRect2D").with("extent", extent(8, 4)))
        .with("clearValueCount", 2u32)
        .with("pClearValues", Value::Array(vec![Value::Words(vec![0; 4]); 2]));
    capture.command(Call::new("vkCmdBeginRenderPass").with("pRenderPassBegin", info));
    capture.bind(34);
    capture.draw(3);
    capture.command(Call::new("vkCmdNextSubpass"));
    capture.bind_with_set("VK_PIPELINE_BIND_POINT_GRAPHICS", 35);
    capture.draw(3);
    capture.command(Call::new("vkCmdEndRenderPass"));
    capture.frame();
    capture
}

/// A frame of two draws that fill a column for each number that the shader reads: five instances from 7 on, counted from a built-in value, with
/// an attribute that changes every two of them; or the third to fifth of several draws, by their own number.
pub fn numbered(builtin: naga::BuiltIn) -> Capture {
    let text = "@vertex fn main(
            @builtin(vertex_index) v: u32, @builtin(instance_index) i: u32, @location(0) a: f32, @location(7) number: u32,
        ) -> @builtin(position) vec4f {
            let column = select(i - number, number + 2, i == 0);
            return vec4f((f32(column + (v & 1))) / 4 - 1, f32(v >> 1) * 2 - 1, 0.5 + a, 1.0);
        }";
    let own = words_with(text, |module| {
        for argument in &mut module.entry_points[0].function.arguments {
            if matches!(argument.binding, Some(naga::Binding::Location { location: 7, .. })) {
                argument.binding = Some(naga::Binding::BuiltIn(builtin));
            }
        }
    });
    drawn(|capture| {
        let red = "@fragment fn main() -> @location(0) vec4f { return vec4f(1.0, 0.0, 0.0, 1.0); }";
        let stages = vec![
            capture.stage_of(134, "VK_SHADER_STAGE_VERTEX_BIT", own),
            capture.stage(234, "VK_SHADER_STAGE_FRAGMENT_BIT", red),
        ];
        capture.pipeline_of(34, ("VK_PRIMITIVE_TOPOLOGY_TRIANGLE_STRIP", false, 0), stages, 0);
        capture.bind(34);
        capture.attribute_of_instances(2);
        match builtin {
            naga::BuiltIn::DrawIndex => {
                let one = || Struct::new("VkMultiDrawInfoEXT").with("vertexCount", 4u32);
                let draw = Call::new("vkCmdDrawMultiEXT").with("drawCount", 3u32).with("instanceCount", 1u32);
                capture.command(draw.with("pVertexInfo", vec![one(), one(), one()]));
            }
            _ => {
                let draw = Call::new("vkCmdDraw").with("vertexCount", 4u32).with("instanceCount", 5u32);
                capture.command(draw.with("firstInstance", 7u32));
            }
        }
    })
}

/// A frame of what dispatches of two workgroups, the first of which is 3, and then 9, leave: white words at their numbers, and at those of their
/// invocations, of which each has one, 16 words behind.
pub fn dispatched_from() -> Capture {
    let mut capture = Capture::new();
    capture.window();
    capture.buffer(20);
    capture.set(&[("VK_DESCRIPTOR_TYPE_STORAGE_BUFFER", &[0])], 0);
    let text = "@group(0) @binding(0) var<storage, read_write> all: array<u32>;
        @compute @workgroup_size(1) fn main(@builtin(workgroup_id) group: vec3u, @builtin(global_invocation_id) own: vec3u) {
            all[group.x] = 0xffffffff;
            all[16 + own.x] = 0xffffffff;
        }";
    capture.compute_pipeline(31, text);
    capture.begin();
    capture.bind_with_set("VK_PIPELINE_BIND_POINT_COMPUTE", 31);
    for base in [3u32, 9] {
        let dispatch = Call::new("vkCmdDispatchBase").with("baseGroupX", base);
        capture.command(dispatch.with("groupCountX", 2u32).with("groupCountY", 1u32).with("groupCountZ", 1u32));
    }
    capture.copy_buffer_to(11, [8, 4]);
    capture.frame();
    capture
}

/// A frame of two draws of a pipeline with a geometry stage.
pub fn with_geometry() -> Capture {
    drawn(|capture| {
        let stages = vec![
            capture.stage(134, "VK_SHADER_STAGE_VERTEX_BIT", VERTEX),
            capture.stage(234, "VK_SHADER_STAGE_GEOMETRY_BIT", "@compute @workgroup_size(1) fn main() {}"),
        ];
        capture.pipeline_of(34, ("VK_PRIMITIVE_TOPOLOGY_TRIANGLE_LIST", false, 0), stages, 0);
        capture.bind(34);
        capture.draw(3);
        capture.draw(6);
    })
}

/// A frame of two passes, with a barrier between them if it is asked for: the first draws to an image of its own or to the window, the second to
/// the window.
pub fn two_passes(own: bool, barrier: bool) -> Capture {
    let mut capture = Capture::new();
    capture.window();
    capture.view();
    capture.image(60, [8, 4], 1, 1);
    capture.view_of(60, 61);
    capture.vertex = COVERING;
    let blue = "@fragment fn main() -> @location(0) vec4f { return vec4f(0.0, 0.0, 1.0, 1.0); }";
    capture.pipeline_with(34, ("VK_PRIMITIVE_TOPOLOGY_TRIANGLE_LIST", false, 0), Some((blue, 0)));
    capture.begin();
    for view in [if own { 61 } else { 13 }, 13] {
        capture.begin_rendering_to(view);
        capture.bind(34);
        capture.draw(3);
        capture.end_rendering();
        if barrier {
            let stages = Call::new("vkCmdPipelineBarrier").with("srcStageMask", "VK_PIPELINE_STAGE_ALL_GRAPHICS_BIT");
            capture.command(stages.with("dstStageMask", "VK_PIPELINE_STAGE_ALL_GRAPHICS_BIT"));
        }
    }
    capture.frame();
    capture
}
