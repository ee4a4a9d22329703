//! Small captures that hold each call, each structure and each kind of block.

use gfxr::{
    Body, Call, Compression, DeviceProperties, ExeFile, Header, Marker, Struct, SwapchainImage, Writer, call_names,
    structure_names,
};

/// A program that draws a triangle in three frames.
pub fn triangle(header: Header) -> Vec<u8> {
    let mut writer = Writer::new(Vec::new(), header).expect("memory");
    let mut put = |body| writer.block(1, &body).unwrap_or_else(|error| panic!("{error}"));
    let mut call = |call| put(Body::Call(call));
    let application =
        Struct::new("VkApplicationInfo").with("pApplicationName", "triangle").with("apiVersion", 1 << 22 | 3 << 12);
    let info = Struct::new("VkInstanceCreateInfo")
        .with("pApplicationInfo", application)
        .with("ppEnabledExtensionNames", vec!["VK_KHR_surface"]);
    call(Call::new("vkCreateInstance").with("pCreateInfo", info.with("enabledExtensionCount", 1)).with("pInstance", 1));
    call(
        Call::new("vkEnumeratePhysicalDevices")
            .with("instance", 1)
            .with("pPhysicalDeviceCount", 1)
            .with("pPhysicalDevices", [2]),
    );
    let features = Struct::new("VkPhysicalDeviceVulkan13Features").with("dynamicRendering", true);
    let features = Struct::new("VkPhysicalDeviceFeatures2").chain(features);
    let queue = Struct::new("VkDeviceQueueCreateInfo").with("queueCount", 1).with("pQueuePriorities", [1.0f32]);
    let info = Struct::new("VkDeviceCreateInfo").with("queueCreateInfoCount", 1).with("pQueueCreateInfos", queue);
    let info = info.with("enabledExtensionCount", 1).with("ppEnabledExtensionNames", vec!["VK_KHR_swapchain"]).chain(features);
    call(Call::new("vkCreateDevice").with("physicalDevice", 2).with("pCreateInfo", info).with("pDevice", 3));
    let extent = Struct::new("VkExtent2D").with("width", 320).with("height", 240);
    let info = Struct::new("VkSwapchainCreateInfoKHR")
        .with("surface", 4)
        .with("imageExtent", extent)
        .with("imageFormat", "VK_FORMAT_B8G8R8A8_UNORM");
    call(Call::new("vkCreateSwapchainKHR").with("device", 3).with("pCreateInfo", info).with("pSwapchain", 5));
    let info = Struct::new("VkShaderModuleCreateInfo").with("codeSize", 20).with("pCode", [0x0723_0203, 0x0001_0000, 0, 1, 0]);
    call(Call::new("vkCreateShaderModule").with("device", 3).with("pCreateInfo", info).with("pShaderModule", 6));
    let stage = Struct::new("VkPipelineShaderStageCreateInfo")
        .with("stage", "VK_SHADER_STAGE_VERTEX_BIT")
        .with("module", 6)
        .with("pName", "main");
    let info = Struct::new("VkGraphicsPipelineCreateInfo").with("stageCount", 1).with("pStages", stage);
    call(
        Call::new("vkCreateGraphicsPipelines")
            .with("device", 3)
            .with("createInfoCount", 1)
            .with("pCreateInfos", info)
            .with("pPipelines", [7]),
    );
    for frame in 0..3u64 {
        call(Call::new("vkCmdPushConstants").with("commandBuffer", 8).with("size", 4).with("pValues", vec![frame as u8; 4]));
        call(Call::new("vkCmdDraw").with("commandBuffer", 8).with("vertexCount", 3).with("instanceCount", 1));
        let info = Struct::new("VkPresentInfoKHR")
            .with("swapchainCount", 1)
            .with("pSwapchains", [5])
            .with("pImageIndices", vec![frame]);
        call(Call::new("vkQueuePresentKHR").with("queue", 9).with("pPresentInfo", info));
    }
    writer.finish().expect("memory")
}

/// Each kind of block that is no call.
pub fn blocks(header: Header) -> Vec<u8> {
    let mut writer = Writer::new(Vec::new(), header).expect("memory");
    let image =
        SwapchainImage { image: 1, index: 0, layout: 2, acquired: true, device_mask: 1, semaphore: 3, fence: 0, queue: 4 };
    let device = DeviceProperties {
        physical_device: 1,
        api_version: 1 << 22,
        driver_version: 1,
        vendor: 2,
        device: 3,
        device_type: 4,
        cache_uuid: [5; 16],
        name: "card".into(),
    };
    let bodies = [
        Body::ExeFile(ExeFile { application: "program".into(), ..ExeFile::default() }),
        Body::Annotation { form: 2, label: "operation".into(), text: "{}".into() },
        Body::State { marker: Marker::Begin, number: 3 },
        Body::DeviceProperties(device),
        Body::MemoryProperties { physical_device: 1, types: vec![(7, 0), (1, 0)], heaps: vec![(1 << 30, 1)] },
        Body::OpaqueAddress { device: 1, object: 2, address: 3 },
        Body::BeginResources { device: 1, size: 4096, largest_copy: 4096 },
        Body::InitBuffer { device: 1, buffer: 2, data: vec![0; 300] },
        Body::InitImage { device: 1, image: 2, aspect: 1, layout: 1, levels: vec![256, 64], data: vec![9; 320] },
        Body::EndResources { device: 1 },
        Body::SwapchainImages { device: 1, swapchain: 2, last_presented: 0, images: vec![image] },
        Body::ResizeWindow { surface: 1, width: 320, height: 240, rotation: None },
        Body::ResizeWindow { surface: 1, width: 320, height: 240, rotation: Some(0) },
        Body::State { marker: Marker::End, number: 3 },
        Body::Frame { marker: Marker::Begin, number: 3 },
        Body::FillMemory { memory: 1, offset: 64, data: vec![1; 300] },
        Body::Frame { marker: Marker::End, number: 3 },
        Body::Message("text".into()),
        Body::Driver("driver".into()),
        Body::UnknownCall { number: 0x1_ffff, data: vec![1, 2, 3] },
        Body::Other { kind: 3, meta: Some(0x1_0022), name: "ExecuteBlocksFromFile", compressed: false, data: vec![0; 8] },
    ];
    bodies.iter().for_each(|body| writer.block(1, body).unwrap_or_else(|error| panic!("{error}")));
    writer.finish().expect("memory")
}

/// All captures: these two in each compression, and one for each call and each structure of a chain, with values of zero.
pub fn all() -> Vec<Vec<u8>> {
    let mut all = Vec::new();
    for compression in [Compression::None, Compression::Lz4, Compression::Zlib, Compression::Zstd] {
        for minor in [0, 1] {
            let header = Header { minor, compression, ..Header::default() };
            all.extend([triangle(header), blocks(header)]);
        }
    }
    let one = |call: Call| {
        let mut writer = Writer::new(Vec::new(), Header::default()).expect("memory");
        // A union whose form is not known is refused.
        writer.call(1, call).ok()?;
        writer.finish().ok()
    };
    all.extend(call_names().filter_map(|name| one(Call::new(name))));
    let chained = |name| {
        let next = Struct::new(name);
        let can_follow = next.members.first().is_some_and(|(member, _)| *member == "sType");
        can_follow.then(|| Call::new("vkCreateBuffer").with("pCreateInfo", Struct::new("VkBufferCreateInfo").chain(next)))
    };
    all.extend(structure_names().filter_map(chained).filter_map(one));
    all
}
