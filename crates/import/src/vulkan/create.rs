//! Calls that create, fill and destroy objects.

use std::rc::Rc;

use gfx::state::*;
use trace::check::rules;
use trace::command::{LinearLayout, TextureDesc, TextureEnd, ViewDesc};

use super::args::{Args, EXTENT};
use super::fault::{Fault, Outcome, unsupported};
use super::formats;
use super::machine::Vulkan;
use super::objects::*;
use super::state::{self, Blend, Fixed};

/// Bytes of an image's level, of one aspect, that are packed tightly.
fn level_bytes(desc: &TextureDesc, level: u32, aspect: Aspect) -> Option<u64> {
    let block = trace::copy_block_bytes(desc.format, aspect)?;
    let [width, height, depth] = desc.level_size(level);
    let layout = LinearLayout { offset: 0, bytes_per_row: None, rows_per_image: None };
    Some(layout.extent(desc.format, block, [width, height, depth]).ok()?.end)
}

/// The size that an image can have here, with its format, levels and samples.
fn texture_desc(info: Args<'_>) -> Outcome<TextureDesc> {
    let dimension = formats::texture_dimension(info.u32("imageType")?)?;
    let ([width, height, depth], layers) = (info.triple("extent", EXTENT)?, info.u32("arrayLayers")?);
    if dimension == TextureDimension::D1 && layers > 1 {
        return unsupported("an array of 1D images");
    }
    let size = match dimension {
        TextureDimension::D2 => [width, height, layers],
        _ => [width, height, depth],
    };
    let (levels, samples) = (info.u32("mipLevels")?, info.u32("samples")?);
    if info.u32("flags")? & 7 != 0 {
        return unsupported("a sparse image");
    }
    let format = formats::format(info.u32("format")?)?;
    let desc = TextureDesc { dimension, size, levels, samples, format, opaque: false };
    rules::texture(&desc).map_err(Fault::Unsupported)?;
    Ok(desc)
}

fn sampler(info: Args<'_>) -> Outcome<Sampler> {
    if info.flag("unnormalizedCoordinates")? {
        return unsupported("a sampler with coordinates in texels");
    }
    let bias = info.f32("mipLodBias")?;
    if !bias.is_finite() {
        return Err(Fault::Damaged(format!("a sampler with a bias of {bias}")));
    }
    if info.chained("VkSamplerYcbcrConversionInfo").is_some() {
        return unsupported("a sampler that converts YCbCr");
    }
    let address = |name: &str| -> Outcome<AddressMode> { formats::address(info.u32(name)?) };
    let address = [address("addressModeU")?, address("addressModeV")?, address("addressModeW")?];
    let filters = [info.u32("magFilter")?, info.u32("minFilter")?, info.u32("mipmapMode")?];
    let [mag, min, mipmap] = [formats::filter(filters[0])?, formats::filter(filters[1])?, formats::filter(filters[2])?];
    let linear = [mag, min, mipmap] == [FilterMode::Linear; 3];
    let anisotropy =
        if info.flag("anisotropyEnable")? && linear { info.f32("maxAnisotropy")?.clamp(1.0, 16.0) as u16 } else { 1 };
    let border = match info.u32("borderColor")? {
        code if address.contains(&AddressMode::ClampToBorder) => formats::border(code)?,
        _ => BorderColor::default(),
    };
    let compare = if info.flag("compareEnable")? { Some(formats::compare(info.u32("compareOp")?)?) } else { None };
    let lod_min = info.f32("minLod")?.max(0.0);
    let lod_max = info.f32("maxLod")?.max(lod_min).min(1000.0);
    let desc = SamplerDesc { address, mag, min, mipmap, lod_min, lod_max, compare, anisotropy, border };
    Ok(Sampler { desc, bias })
}

fn set_layout(info: Args<'_>) -> Outcome<SetLayout> {
    let binding = |of: Args<'_>| -> Outcome<LayoutBinding> {
        let kind = DescriptorKind::new(of.u32("descriptorType")?);
        let count = of.u32("descriptorCount")?;
        if count > 1 << 20 {
            return Err(Fault::Limit(format!("a binding of {count} descriptors")));
        }
        let samplers = matches!(kind, Ok(DescriptorKind::Sampler | DescriptorKind::Combined));
        let immutable = if samplers { of.numbers("pImmutableSamplers")? } else { Vec::new() };
        Ok(LayoutBinding { binding: of.u32("binding")?, kind, count, immutable })
    };
    let mut bindings: Vec<_> = info.list("pBindings")?.into_iter().map(binding).collect::<Outcome<_>>()?;
    bindings.sort_by_key(|binding| binding.binding);
    Ok(SetLayout { bindings })
}

/// A reference to an attachment; none: unused.
fn reference(of: Args<'_>) -> Outcome<Option<usize>> {
    let number = of.u32("attachment")?;
    Ok((number != !0).then_some(number as usize))
}

fn references(of: Args<'_>, name: &str) -> Outcome<Vec<Option<usize>>> {
    of.list(name)?.into_iter().map(reference).collect()
}

fn render_pass(info: Args<'_>) -> Outcome<RenderPass> {
    let attachment = |of: Args<'_>| -> Outcome<Attachment> {
        // The contents are lost only if the program does not care: 1 among stores.
        let is_one = |name: &str| -> Outcome<bool> { Ok(of.u32(name)? == 1) };
        Ok(Attachment {
            clear: is_one("loadOp")?,
            store: !is_one("storeOp")?,
            stencil_clear: is_one("stencilLoadOp")?,
            stencil_store: !is_one("stencilStoreOp")?,
        })
    };
    let masks = match info.chained("VkRenderPassMultiviewCreateInfo") {
        Some(multiview) => multiview.numbers("pViewMasks")?,
        None => Vec::new(),
    };
    let second = info.owner.starts_with("VkRenderPassCreateInfo2");
    let subpass = |(number, of): (usize, Args<'_>)| -> Outcome<Subpass> {
        let depth = of.maybe("pDepthStencilAttachment")?.map(reference).transpose()?.flatten();
        let resolve_depth = of.chained("VkSubpassDescriptionDepthStencilResolve");
        let resolves = match resolve_depth.map(|of| of.maybe("pDepthStencilResolveAttachment")).transpose()?.flatten() {
            Some(of) => reference(of)?.is_some(),
            None => false,
        };
        Ok(Subpass {
            color: references(of, "pColorAttachments")?,
            resolve: references(of, "pResolveAttachments")?,
            depth,
            input: references(of, "pInputAttachments")?.into_iter().flatten().collect(),
            views: if second { of.u32("viewMask")? } else { masks.get(number).map_or(0, |&mask| mask as u32) },
            refused: resolves.then(|| "a resolve of depth".to_owned()),
        })
    };
    Ok(RenderPass {
        attachments: info.list("pAttachments")?.into_iter().map(attachment).collect::<Outcome<_>>()?,
        subpasses: info.list("pSubpasses")?.into_iter().enumerate().map(subpass).collect::<Outcome<_>>()?,
    })
}

impl Vulkan {
    /// Runs a call that creates, fills or destroys objects. Answers whether it is one.
    pub fn create(&mut self, name: &str, call: Args<'_>) -> Outcome<bool> {
        let plain = name.strip_suffix("KHR").or_else(|| name.strip_suffix("EXT")).unwrap_or(name);
        match plain {
            "vkAllocateMemory" => {
                let size = call.of("pAllocateInfo")?.u64("allocationSize")?;
                let memory = Memory { size, mapped: 0, end: 0, native: None, linear: Vec::new() };
                self.objects.memories.insert(call.u64("pMemory")?, memory);
            }
            "vkFreeMemory" => self.free_memory(call.u64("memory")?),
            "vkMapMemory" => self.map(call.u64("memory")?, call.u64("offset")?)?,
            "vkMapMemory2" => {
                let info = call.of("pMemoryMapInfo")?;
                self.map(info.u64("memory")?, info.u64("offset")?)?;
            }
            "vkCreateBuffer" => {
                let info = call.of("pCreateInfo")?;
                if info.u32("flags")? & 7 != 0 {
                    return unsupported("a sparse buffer");
                }
                self.objects.buffers.insert(call.u64("pBuffer")?, Buffer { size: info.u64("size")?, bound: None });
            }
            "vkDestroyBuffer" => drop(self.objects.buffers.remove(call.u64("buffer")?)),
            "vkBindBufferMemory" => self.bind_buffer(call)?,
            "vkBindBufferMemory2" => call.list("pBindInfos")?.into_iter().try_for_each(|info| self.bind_buffer(info))?,
            "vkCreateImage" => {
                let info = call.of("pCreateInfo")?;
                let desc = match texture_desc(info) {
                    Err(damaged @ Fault::Damaged(_)) => return Err(damaged),
                    desc => desc,
                };
                let linear = info.u32("tiling")? == 1;
                self.objects.images.insert(call.u64("pImage")?, new_image(desc, linear));
            }
            "vkDestroyImage" => self.destroy_image(call.u64("image")?),
            "vkBindImageMemory" => self.bind_image(call)?,
            "vkBindImageMemory2" => call.list("pBindInfos")?.into_iter().try_for_each(|info| self.bind_image(info))?,
            "vkGetImageSubresourceLayout" => self.linear_layout(call, call.of("pSubresource")?, call.maybe("pLayout")?)?,
            "vkGetImageSubresourceLayout2" => {
                let layout = call.maybe("pLayout")?.map(|of| of.of("subresourceLayout")).transpose()?;
                self.linear_layout(call, call.of("pSubresource")?.of("imageSubresource")?, layout)?;
            }
            "vkCreateImageView" => self.create_view(call.of("pCreateInfo")?, call.u64("pView")?)?,
            "vkDestroyImageView" => drop(self.objects.views.remove(call.u64("imageView")?)),
            "vkCreateBufferView" => {
                let info = call.of("pCreateInfo")?;
                let range = Some(info.u64("range")?).filter(|&range| range != !0);
                let view =
                    BufferView { buffer: info.u64("buffer")?, code: info.u32("format")?, offset: info.u64("offset")?, range };
                self.objects.buffer_views.insert(call.u64("pView")?, view);
            }
            "vkDestroyBufferView" => drop(self.objects.buffer_views.remove(call.u64("bufferView")?)),
            "vkCreateSampler" => {
                let made = match sampler(call.of("pCreateInfo")?) {
                    Err(damaged @ Fault::Damaged(_)) => return Err(damaged),
                    made => made,
                };
                self.objects.rewritten |= made.as_ref().is_ok_and(|made| made.bias != 0.0);
                self.objects.samplers.insert(call.u64("pSampler")?, made);
            }
            "vkDestroySampler" => drop(self.objects.samplers.remove(call.u64("sampler")?)),
            "vkCreateDescriptorSetLayout" => {
                let layout = set_layout(call.of("pCreateInfo")?)?;
                self.objects.set_layouts.insert(call.u64("pSetLayout")?, Rc::new(layout));
            }
            "vkDestroyDescriptorSetLayout" => drop(self.objects.set_layouts.remove(call.u64("descriptorSetLayout")?)),
            "vkCreatePipelineLayout" => {
                let handles = call.of("pCreateInfo")?.numbers("pSetLayouts")?;
                let set = |handle: Handle| self.objects.set_layouts.get(handle).cloned();
                let sets = handles.into_iter().map(set).collect();
                self.objects.pipeline_layouts.insert(call.u64("pPipelineLayout")?, Rc::new(PipelineLayout { sets }));
            }
            "vkDestroyPipelineLayout" => drop(self.objects.pipeline_layouts.remove(call.u64("pipelineLayout")?)),
            "vkCreateRenderPass" | "vkCreateRenderPass2" => {
                let pass = render_pass(call.of("pCreateInfo")?)?;
                self.objects.render_passes.insert(call.u64("pRenderPass")?, Rc::new(pass));
            }
            "vkDestroyRenderPass" => drop(self.objects.render_passes.remove(call.u64("renderPass")?)),
            "vkCreateFramebuffer" => {
                let info = call.of("pCreateInfo")?;
                let views = if info.u32("flags")? & 1 != 0 { Vec::new() } else { info.numbers("pAttachments")? };
                self.objects
                    .framebuffers
                    .insert(call.u64("pFramebuffer")?, Rc::new(Framebuffer { views, layers: info.u32("layers")? }));
            }
            "vkDestroyFramebuffer" => drop(self.objects.framebuffers.remove(call.u64("framebuffer")?)),
            "vkCreateShaderModule" => {
                let module = self.shader_module(call.of("pCreateInfo")?)?;
                self.objects.modules.insert(call.u64("pShaderModule")?, module);
            }
            "vkDestroyShaderModule" => drop(self.objects.modules.remove(call.u64("shaderModule")?)),
            "vkCreateGraphicsPipelines" | "vkCreateComputePipelines" => {
                let handles = call.numbers("pPipelines")?;
                for (info, handle) in call.list("pCreateInfos")?.into_iter().zip(handles) {
                    if handle != 0 {
                        let pipeline = self.pipeline(info)?;
                        self.objects.pipelines.insert(handle, Rc::new(pipeline));
                    }
                }
            }
            "vkDestroyPipeline" => {
                if let Some(pipeline) = self.objects.pipelines.remove(call.u64("pipeline")?) {
                    self.pipelines.forget(pipeline.number, &mut self.card);
                }
            }
            "vkCreateSwapchain" => self.create_swapchain(call.of("pCreateInfo")?, call.u64("pSwapchain")?)?,
            "vkGetSwapchainImages" => {
                let handle = call.u64("swapchain")?;
                let images = if call.is_some("pSwapchainImages")? { call.numbers("pSwapchainImages")? } else { Vec::new() };
                let swapchain = known(self.objects.swapchains.get_mut(handle), "swapchain", handle)?;
                for image in images {
                    if !swapchain.images.contains(&image) {
                        swapchain.images.push(image);
                        self.objects.images.insert(image, new_image(swapchain.desc.clone(), false));
                    }
                }
            }
            "vkDestroySwapchain" => {
                let images = self.objects.swapchains.remove(call.u64("swapchain")?).map(|swapchain| swapchain.images);
                images.into_iter().flatten().for_each(|image| self.destroy_image(image));
            }
            "vkCreateQueryPool" => {
                let info = call.of("pCreateInfo")?;
                let kind = match info.u32("queryType")? {
                    0 => PoolKind::Occlusion,
                    1 => PoolKind::Statistics(info.u32("pipelineStatistics")?),
                    2 => PoolKind::Timestamp,
                    _ => PoolKind::Other,
                };
                let pool = QueryPool { kind, count: info.u32("queryCount")?, native: None, uncounted: false };
                self.objects.query_pools.insert(call.u64("pQueryPool")?, pool);
            }
            "vkDestroyQueryPool" => self.destroy_query_pool(call.u64("queryPool")?),
            "vkAllocateCommandBuffers" => {
                let pool = call.of("pAllocateInfo")?.u64("commandPool")?;
                for handle in call.numbers("pCommandBuffers")? {
                    self.objects.commands.insert(handle, CommandBuffer { pool, list: Rc::default() });
                }
            }
            "vkFreeCommandBuffers" => {
                for handle in call.numbers("pCommandBuffers")? {
                    self.objects.commands.remove(handle);
                }
            }
            "vkDestroyCommandPool" => {
                let pool = call.u64("commandPool")?;
                let of = |commands: &CommandBuffer| commands.pool == pool;
                let gone: Vec<Handle> =
                    self.objects.commands.iter().filter(|(_, commands)| of(commands)).map(|(handle, _)| handle).collect();
                gone.into_iter().for_each(|handle| drop(self.objects.commands.remove(handle)));
            }
            "vkResetCommandPool" => {
                let pool = call.u64("commandPool")?;
                let own = self.objects.commands.values_mut().filter(|commands| commands.pool == pool);
                own.for_each(|commands| commands.list = Rc::default());
            }
            "vkBeginCommandBuffer" | "vkResetCommandBuffer" => {
                let handle = call.u64("commandBuffer")?;
                known(self.objects.commands.get_mut(handle), "command buffer", handle)?.list = Rc::default();
            }
            _ => return self.describe(plain, call),
        }
        Ok(true)
    }

    fn map(&mut self, handle: Handle, offset: u64) -> Outcome {
        known(self.objects.memories.get_mut(handle), "memory object", handle)?.mapped = offset;
        Ok(())
    }

    fn bind_buffer(&mut self, info: Args<'_>) -> Outcome {
        let (handle, memory) = (info.u64("buffer")?, info.u64("memory")?);
        let offset = info.u64("memoryOffset")?;
        let buffer = known(self.objects.buffers.get_mut(handle), "buffer", handle)?;
        buffer.bound = Some((memory, offset));
        if let Some(memory) = self.objects.memories.get_mut(memory) {
            memory.end = memory.end.max(offset.saturating_add(buffer.size).min(memory.size));
        }
        Ok(())
    }

    fn bind_image(&mut self, info: Args<'_>) -> Outcome {
        let (handle, memory) = (info.u64("image")?, info.u64("memory")?);
        let offset = info.u64("memoryOffset")?;
        // An image of a swapchain can be bound a second time, to no memory.
        let Some(image) = self.objects.images.get_mut(handle) else {
            return unsupported("an image that shares the memory of a window's");
        };
        image.bound = Some((memory, offset));
        if image.linear
            && let Some(memory) = self.objects.memories.get_mut(memory)
        {
            memory.linear.push(handle);
        }
        Ok(())
    }

    fn linear_layout(&mut self, call: Args<'_>, part: Args<'_>, layout: Option<Args<'_>>) -> Outcome {
        let handle = call.u64("image")?;
        let image = known(self.objects.images.get_mut(handle), "image", handle)?;
        if let (Some(layout), 0, 0) = (layout, part.u32("mipLevel")?, part.u32("arrayLayer")?) {
            image.texels = Some(LinearTexels { offset: layout.u64("offset")?, row: layout.u64("rowPitch")? });
        }
        Ok(())
    }

    fn create_view(&mut self, info: Args<'_>, handle: Handle) -> Outcome {
        let image = info.u64("image")?;
        let owner = known(self.objects.images.get(image), "image", image)?;
        let range = info.of("subresourceRange")?;
        let rest = |name: &str| -> Outcome<Option<u32>> { Ok(Some(range.u32(name)?).filter(|&count| count != !0)) };
        let swizzle = info.of("components")?;
        let channel =
            |name: &str, own: u32| -> Outcome<u32> { Ok(Some(swizzle.u32(name)?).filter(|&code| code != own).unwrap_or(0)) };
        let swizzle = [channel("r", 3)?, channel("g", 4)?, channel("b", 5)?, channel("a", 6)?];
        let dimension = formats::view_dimension(info.u32("viewType")?)?;
        let layers = rest("layerCount")?;
        // A format that an image cannot have is refused with the image.
        let format = match &owner.desc {
            Ok(desc) => Some(formats::format(info.u32("format")?)?).filter(|&format| format != desc.format),
            Err(_) => None,
        };
        let flat = matches!(dimension, ViewDimension::D1 | ViewDimension::D2 | ViewDimension::D3);
        let desc = ViewDesc {
            format,
            dimension: Some(dimension),
            aspect: Aspect::All,
            base_level: range.u32("baseMipLevel")?,
            levels: rest("levelCount")?,
            base_layer: range.u32("baseArrayLayer")?,
            layers: if flat { None } else { layers },
        };
        let (aspects, code) = (range.u32("aspectMask")?, info.u32("format")?);
        let swizzle = (swizzle != [0; 4]).then_some(swizzle);
        self.objects.rewritten |= swizzle.is_some();
        self.objects.views.insert(handle, View { image, desc, aspects, code, swizzle });
        Ok(())
    }

    /// A module from its create info.
    pub fn shader_module(&mut self, info: Args<'_>) -> Outcome<Rc<ShaderModule>> {
        self.made += 1;
        Ok(Rc::new(ShaderModule { number: self.made, words: info.words("pCode")?.into_owned() }))
    }

    fn stage(&mut self, of: Args<'_>) -> Outcome<Stage> {
        let handle = of.u64("module")?;
        let module = match of.chained("VkShaderModuleCreateInfo") {
            Some(info) if handle == 0 => self.shader_module(info)?,
            _ => known(self.objects.modules.get(handle), "shader module", handle)?.clone(),
        };
        let mut constants = Vec::new();
        if let Some(info) = of.maybe("pSpecializationInfo")? {
            let data = info.bytes("pData")?;
            for entry in info.list("pMapEntries")? {
                let (offset, size) = (entry.u64("offset")?, entry.u64("size")?);
                let range = usize::try_from(offset).ok().zip(usize::try_from(offset.saturating_add(size)).ok());
                let bytes = range.and_then(|(start, end)| data.get(start..end));
                let bytes = bytes.ok_or_else(|| Fault::Damaged("a specialisation constant lies outside of its data".into()))?;
                constants.push((entry.u32("constantID")?, bytes.to_vec()));
            }
        }
        let (stage, entry) = (of.u32("stage")?, of.text("pName")?.to_owned());
        let stage = Stage { stage, module, entry, constants: Rc::new(constants) };
        if let Some(stages) = &mut self.stages {
            stages.add(&stage, self.log.block);
        }
        Ok(stage)
    }

    fn pipeline(&mut self, info: Args<'_>) -> Outcome<Pipeline> {
        self.made += 1;
        let number = self.made;
        let layout = self.objects.pipeline_layouts.get(info.u64("layout")?).cloned();
        let layout = layout.unwrap_or_else(|| Rc::new(PipelineLayout { sets: Vec::new() }));
        let mut pipeline =
            Pipeline { number, stages: Vec::new(), layout, fixed: Fixed::default(), dynamic: Vec::new(), refused: None };
        if info.owner.starts_with("VkComputePipeline") {
            pipeline.stages.push(self.stage(info.of("stage")?)?);
            return Ok(pipeline);
        }
        self.add_libraries(info, &mut pipeline)?;
        for of in info.list("pStages")? {
            let stage = self.stage(of)?;
            pipeline.stages.push(stage);
        }
        let names =
            [(2, "tessellation"), (4, "tessellation"), (8, "a geometry stage"), (64, "a task stage"), (128, "a mesh stage")];
        for (bit, name) in names {
            if pipeline.stages.iter().any(|stage| stage.stage == bit) {
                pipeline.refused = Some(Fault::Unsupported(name.to_owned()));
            }
        }
        for (state, chained, name) in [
            ("pRasterizationState", "VkPipelineRasterizationConservativeStateCreateInfo", "conservative rasterisation"),
            ("pMultisampleState", "VkPipelineSampleLocationsStateCreateInfo", "samples at places of the program's"),
        ] {
            let state = info.maybe(state)?;
            let asked = state.and_then(|state| state.chained(chained)).map(|of| match chained.contains("Conservative") {
                true => of.u32("conservativeRasterizationMode"),
                false => of.u32("sampleLocationsEnable"),
            });
            if asked.transpose()?.is_some_and(|value| value != 0) {
                pipeline.refused = Some(Fault::Unsupported(name.to_owned()));
            }
        }
        if let Some(of) = info.maybe("pDynamicState")? {
            pipeline.dynamic.extend(of.numbers("pDynamicStates")?.into_iter().map(|state| state as u32));
        }
        fixed_state(info, &mut pipeline.fixed)?;
        Ok(pipeline)
    }

    /// Takes over the parts that pipeline libraries bring.
    fn add_libraries(&mut self, info: Args<'_>, pipeline: &mut Pipeline) -> Outcome {
        let Some(libraries) = info.chained("VkPipelineLibraryCreateInfo") else { return Ok(()) };
        for handle in libraries.numbers("pLibraries")? {
            let library = known(self.objects.pipelines.get(handle), "pipeline library", handle)?;
            pipeline.stages.extend(library.stages.iter().cloned());
            pipeline.dynamic.extend(&library.dynamic);
            pipeline.refused = pipeline.refused.take().or_else(|| library.refused.clone());
            pipeline.fixed.join(&library.fixed);
            if pipeline.layout.sets.is_empty() {
                pipeline.layout = library.layout.clone();
            }
        }
        Ok(())
    }

    fn create_swapchain(&mut self, info: Args<'_>, handle: Handle) -> Outcome {
        let [width, height] = info.pair("imageExtent", ["width", "height"])?;
        let layers = info.u32("imageArrayLayers")?;
        let desc = formats::format(info.u32("imageFormat")?).map(|format| TextureDesc {
            dimension: TextureDimension::D2,
            size: [width, height, layers.max(1)],
            levels: 1,
            samples: 1,
            format,
            opaque: true,
        });
        self.windows = true;
        self.objects.swapchains.insert(handle, Swapchain { desc, images: Vec::new() });
        Ok(())
    }

    /// Writes into mapped memory.
    pub fn fill_memory(&mut self, handle: Handle, offset: u64, bytes: Vec<u8>) -> Outcome {
        let memory = known(self.objects.memories.get(handle), "memory object", handle)?;
        let first = memory.mapped.saturating_add(offset);
        let end = first.saturating_add(bytes.len() as u64);
        if end > memory.size {
            return Err(Fault::Damaged(format!("bytes {first} to {end} of memory object {handle}, which has {}", memory.size)));
        }
        for image in memory.linear.clone() {
            if let Some(image) = self.objects.images.get_mut(image)
                && let Some((_, at)) = image.bound
                && at < end
            {
                image.stale = true;
            }
        }
        if !bytes.is_empty() {
            let buffer = self.memory(handle, end)?;
            self.card.write_buffer(buffer, first, "memory", bytes);
        }
        Ok(())
    }

    /// Gives a buffer its contents at the start of a trimmed capture.
    pub fn init_buffer(&mut self, handle: Handle, bytes: Vec<u8>) -> Outcome {
        let (id, offset, _) = self.range(handle, 0, Some(bytes.len() as u64))?;
        if !bytes.is_empty() {
            self.card.write_buffer(id, offset, "buffer", bytes);
        }
        Ok(())
    }

    /// Gives an aspect of an image its contents at the start of a trimmed capture.
    pub fn init_image(&mut self, handle: Handle, aspects: u32, level_sizes: &[u64], bytes: &[u8]) -> Outcome {
        if bytes.is_empty() {
            return Ok(());
        }
        let (texture, desc) = (self.texture(handle)?, self.texture_desc(handle)?);
        let aspect = formats::aspect(aspects, desc.format)?;
        let mut start = 0u64;
        for (level, &size) in level_sizes.iter().enumerate().take(desc.levels as usize) {
            let level = level as u32;
            let packed = level_bytes(&TextureDesc { samples: 1, ..desc.clone() }, level, aspect)
                .ok_or_else(|| Fault::Damaged(format!("image {handle} has no aspect {aspects}")))?;
            let range = usize::try_from(start).ok().zip(usize::try_from(start.saturating_add(packed)).ok());
            let Some(texels) = range.and_then(|(start, end)| bytes.get(start..end)) else {
                return Err(Fault::Damaged(format!("level {level} of image {handle} has too few bytes")));
            };
            start = start.saturating_add(size);
            let layout = LinearLayout { offset: 0, bytes_per_row: None, rows_per_image: None };
            if desc.samples > 1 {
                self.spread_samples(handle, texels)?;
                continue;
            }
            let to = TextureEnd { texture, level, origin: [0; 3], aspect };
            self.card.write_texture(to, layout, desc.level_size(level), "image", texels);
        }
        Ok(())
    }
}

fn new_image(desc: Outcome<TextureDesc>, linear: bool) -> Image {
    Image { desc, linear, bound: None, texels: None, stale: false, native: None, views: Vec::new() }
}

/// Reads the fixed state of a pipeline. Parts that do not count may hold anything or be missing.
fn fixed_state(info: Args<'_>, fixed: &mut Fixed) -> Outcome {
    if let Some(of) = info.maybe("pVertexInputState")? {
        let divisors = match of.chained("VkPipelineVertexInputDivisorStateCreateInfo") {
            Some(of) => of.list("pVertexBindingDivisors")?,
            None => Vec::new(),
        };
        let divisor = |binding: u32| -> Outcome<Option<u32>> {
            for of in &divisors {
                if of.u32("binding")? == binding {
                    return Ok(Some(of.u32("divisor")?));
                }
            }
            Ok(None)
        };
        let binding = |of: Args<'_>| state::vertex_binding(of, divisor(of.u32("binding")?)?);
        fixed.bindings = of.list("pVertexBindingDescriptions")?.into_iter().map(binding).collect::<Outcome<_>>()?;
        let attributes = of.list("pVertexAttributeDescriptions")?;
        fixed.attributes = attributes.into_iter().map(state::vertex_attribute).collect::<Outcome<_>>()?;
    }
    if let Some(of) = info.maybe("pInputAssemblyState")? {
        fixed.topology = of.u32("topology")?;
        fixed.restart = of.flag("primitiveRestartEnable")?;
    }
    if let Some(of) = info.maybe("pViewportState")? {
        fixed.viewports = of.list("pViewports")?.into_iter().map(state::viewport).collect::<Outcome<_>>()?;
        fixed.scissors = of.list("pScissors")?.into_iter().map(state::Area::new).collect::<Outcome<_>>()?;
        if let Some(of) = of.chained("VkPipelineViewportDepthClipControlCreateInfo") {
            fixed.negative_one_to_one = of.flag("negativeOneToOne")?;
        }
    }
    if let Some(of) = info.maybe("pRasterizationState")? {
        fixed.depth_clamp = of.flag("depthClampEnable")?;
        fixed.discard = of.flag("rasterizerDiscardEnable")?;
        fixed.polygon_mode = of.u32("polygonMode")?;
        fixed.cull_mode = of.u32("cullMode")?;
        fixed.front_face = of.u32("frontFace")?;
        fixed.depth_bias = of.flag("depthBiasEnable")?;
        fixed.bias = [of.f32("depthBiasConstantFactor")?, of.f32("depthBiasClamp")?, of.f32("depthBiasSlopeFactor")?];
        fixed.line_width = of.f32("lineWidth")?;
        if let Some(of) = of.chained("VkPipelineRasterizationDepthClipStateCreateInfo") {
            fixed.depth_clip = Some(of.flag("depthClipEnable")?);
        }
        if let Some(of) = of.chained("VkPipelineRasterizationProvokingVertexStateCreateInfo") {
            fixed.provoking_last = of.u32("provokingVertexMode")? == 1;
        }
        if let Some(of) = of.chained("VkPipelineRasterizationLineStateCreateInfo") {
            fixed.line_mode = of.u32("lineRasterizationMode")?;
            fixed.stippled = of.flag("stippledLineEnable")?;
        }
    }
    if let Some(of) = info.maybe("pMultisampleState")? {
        fixed.samples = of.u32("rasterizationSamples")?;
        fixed.sample_shading = if of.flag("sampleShadingEnable")? { of.f32("minSampleShading")? } else { 0.0 };
        fixed.sample_mask = of.words("pSampleMask")?.first().copied().unwrap_or(!0);
        fixed.alpha_to_coverage = of.flag("alphaToCoverageEnable")?;
        fixed.alpha_to_one = of.flag("alphaToOneEnable")?;
    }
    if let Some(of) = info.maybe("pDepthStencilState")? {
        fixed.depth_test = of.flag("depthTestEnable")?;
        fixed.depth_write = of.flag("depthWriteEnable")?;
        fixed.depth_compare = of.u32("depthCompareOp")?;
        fixed.depth_bounds = of.flag("depthBoundsTestEnable")?;
        fixed.stencil_test = of.flag("stencilTestEnable")?;
        fixed.stencil = [state::stencil(of.of("front")?)?, state::stencil(of.of("back")?)?];
    }
    if let Some(of) = info.maybe("pColorBlendState")? {
        fixed.logic_op_enable = of.flag("logicOpEnable")?;
        fixed.logic_op = Some(of.u32("logicOp")?);
        let blend = |of: Args<'_>| -> Outcome<Blend> {
            let (enabled, write_mask) = (of.flag("blendEnable")?, of.u32("colorWriteMask")?);
            Ok(Blend { enabled, equation: state::equation(of)?, write_mask })
        };
        fixed.blend = of.list("pAttachments")?.into_iter().map(blend).collect::<Outcome<_>>()?;
        let constants = of.floats("blendConstants")?;
        fixed.blend_constants.iter_mut().zip(constants).for_each(|(slot, value)| *slot = value);
        if let Some(of) = of.chained("VkPipelineColorWriteCreateInfo") {
            fixed.color_write = of.numbers("pColorWriteEnables")?.into_iter().map(|on| on != 0).collect();
        }
    }
    Ok(())
}
