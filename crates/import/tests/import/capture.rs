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

fn words(text: &str) -> Value {
    let module = naga::front::wgsl::parse_str(text).expect("WGSL");
    let info = naga::valid::Validator::new(Default::default(), Default::default()).validate(&module).expect("a module");
    Value::Words(naga::back::spv::write_vec(&module, &info, &Default::default(), None).expect("words"))
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
        let info = Struct::new("VkShaderModuleCreateInfo").with("pCode", words(text));
        self.call(Call::new("vkCreateShaderModule").with("pCreateInfo", info).with("pShaderModule", module));
        let of = Struct::new("VkPipelineShaderStageCreateInfo").with("stage", stage);
        of.with("module", module).with("pName", "main")
    }

    /// A pipeline, with the text of its fragment stage and its layout.
    pub fn pipeline_with(&mut self, handle: u64, (topology, restart, cull): (&str, bool, u32), fragment: Option<(&str, u64)>) {
        let mut stages = vec![Value::from(self.stage(handle + 100, "VK_SHADER_STAGE_VERTEX_BIT", self.vertex))];
        if let Some((text, _)) = fragment {
            stages.push(self.stage(handle + 200, "VK_SHADER_STAGE_FRAGMENT_BIT", text).into());
        }
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
            .with("pStages", Value::Array(stages))
            .with("layout", fragment.map_or(0, |(_, layout)| layout))
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

    pub fn command(&mut self, call: Call) {
        self.call(call.with("commandBuffer", 12u64));
    }

    pub fn begin_rendering(&mut self) {
        let target = Struct::new("VkRenderingAttachmentInfo").with("imageView", 13u64).with("loadOp", 1u32);
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
    let size = Struct::new("VkExtent3D").with("width", 4u32).with("height", 4u32).with("depth", 1u32);
    let info = Struct::new("VkImageCreateInfo")
        .with("imageType", "VK_IMAGE_TYPE_2D")
        .with("format", "VK_FORMAT_R8G8B8A8_UNORM")
        .with("extent", size.clone())
        .with("mipLevels", 2u32)
        .with("arrayLayers", 1u32)
        .with("samples", 1u32);
    capture.call(Call::new("vkCreateImage").with("pCreateInfo", info).with("pImage", 50u64));
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
    let kinds = ["VK_DESCRIPTOR_TYPE_SAMPLED_IMAGE", "VK_DESCRIPTOR_TYPE_SAMPLER", "VK_DESCRIPTOR_TYPE_STORAGE_BUFFER"];
    let binding = |(at, kind): (u32, &&str)| {
        let of = Struct::new("VkDescriptorSetLayoutBinding").with("binding", at).with("descriptorType", *kind);
        Value::from(of.with("descriptorCount", 1u32))
    };
    let info = Struct::new("VkDescriptorSetLayoutCreateInfo")
        .with("bindingCount", 3u32)
        .with("pBindings", Value::Array((0..).zip(&kinds).map(binding).collect()));
    capture.call(Call::new("vkCreateDescriptorSetLayout").with("pCreateInfo", info).with("pSetLayout", 53u64));
    let info = Struct::new("VkPipelineLayoutCreateInfo").with("setLayoutCount", 1u32).with("pSetLayouts", handles(&[53]));
    capture.call(Call::new("vkCreatePipelineLayout").with("pCreateInfo", info).with("pPipelineLayout", 54u64));
    let info = Struct::new("VkDescriptorSetAllocateInfo").with("descriptorSetCount", 1u32).with("pSetLayouts", handles(&[53]));
    let sets = Call::new("vkAllocateDescriptorSets").with("pAllocateInfo", info);
    capture.call(sets.with("pDescriptorSets", handles(&[55])));
    let write = |(at, kind): (u32, &&str)| {
        let image = Struct::new("VkDescriptorImageInfo").with("imageView", 51u64).with("sampler", 52u64);
        let buffer = Struct::new("VkDescriptorBufferInfo").with("buffer", 20u64).with("range", 256u64);
        let of = Struct::new("VkWriteDescriptorSet").with("dstSet", 55u64).with("dstBinding", at).with("descriptorType", *kind);
        let of = of.with("descriptorCount", 1u32);
        Value::from(if at == 2 { of.with("pBufferInfo", buffer) } else { of.with("pImageInfo", image) })
    };
    let update = Call::new("vkUpdateDescriptorSets").with("descriptorWriteCount", 3u32);
    capture.call(update.with("pDescriptorWrites", Value::Array((0..).zip(&kinds).map(write).collect())));
    let text = "@group(0) @binding(0) var image: texture_2d<f32>; @group(0) @binding(1) var own: sampler;
        @fragment fn main() -> @location(0) vec4f { return textureSample(image, own, vec2f(0.5)); }";
    capture.pipeline_with(30, ("VK_PRIMITIVE_TOPOLOGY_TRIANGLE_LIST", false, 0), Some((text, 54)));
    let text = "@group(0) @binding(2) var<storage, read_write> all: array<u32>;
        @compute @workgroup_size(1) fn main() { all[1] = 1; }";
    let stage = capture.stage(131, "VK_SHADER_STAGE_COMPUTE_BIT", text);
    let info = Struct::new("VkComputePipelineCreateInfo").with("stage", stage).with("layout", 54u64);
    let create = Call::new("vkCreateComputePipelines").with("createInfoCount", 1u32).with("pCreateInfos", info);
    capture.call(create.with("pPipelines", handles(&[31])));
    capture.blocks.push(Body::FillMemory { memory: 120, offset: 0, data: vec![1; 64] });
    capture.begin();
    let layers =
        Struct::new("VkImageSubresourceLayers").with("aspectMask", "VK_IMAGE_ASPECT_COLOR_BIT").with("layerCount", 1u32);
    let region = Struct::new("VkBufferImageCopy").with("imageSubresource", layers).with("imageExtent", size);
    let copy = Call::new("vkCmdCopyBufferToImage").with("srcBuffer", 20u64).with("dstImage", 50u64);
    capture.command(copy.with("regionCount", 1u32).with("pRegions", region));
    for (point, pipeline) in [("VK_PIPELINE_BIND_POINT_COMPUTE", 31u64), ("VK_PIPELINE_BIND_POINT_GRAPHICS", 30)] {
        let bind = Call::new("vkCmdBindDescriptorSets").with("pipelineBindPoint", point).with("layout", 54u64);
        capture.command(bind.with("descriptorSetCount", 1u32).with("pDescriptorSets", handles(&[55])));
        capture.command(Call::new("vkCmdBindPipeline").with("pipelineBindPoint", point).with("pipeline", pipeline));
    }
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
