//! Captures of Vulkan programs, as `inspect` shows them.

use std::fs;

use super::cli::run;
use fillrate::gfxr::{Call, Compression, Header, Struct, Value, Writer};

/// A capture of a program with a window that presents two frames.
fn capture() -> Vec<u8> {
    let application =
        Struct::new("VkApplicationInfo").with("pApplicationName", "gears").with("apiVersion", 1 << 22 | 2 << 12 | 7);
    let instance = Struct::new("VkInstanceCreateInfo").with("pApplicationInfo", application);
    let device = Struct::new("VkDeviceCreateInfo").with("ppEnabledExtensionNames", vec!["VK_KHR_swapchain"]);
    let extent = Struct::new("VkExtent2D").with("width", 320).with("height", 240);
    let swapchain = Struct::new("VkSwapchainCreateInfoKHR").with("surface", 5).with("imageExtent", extent);
    let swapchain = swapchain.with("imageFormat", "VK_FORMAT_B8G8R8A8_UNORM");
    let swapchains = Value::from([Value::Handle(6)]);
    let present = || {
        let info = Struct::new("VkPresentInfoKHR").with("swapchainCount", 1);
        info.with("pSwapchains", swapchains.clone()).with("pImageIndices", Value::Words(vec![0]))
    };
    let calls = [
        Call::new("vkCreateInstance").with("pCreateInfo", instance),
        Call::new("vkCreateDevice").with("pCreateInfo", device),
        Call::new("vkCreateSwapchainKHR").with("pCreateInfo", swapchain).with("pSwapchain", 6),
        Call::new("vkGetSwapchainImagesKHR").with("swapchain", 6).with("pSwapchainImages", Value::from([Value::Handle(7)])),
        Call::new("vkAcquireNextImageKHR").returning("VK_ERROR_OUT_OF_DATE_KHR"),
        Call::new("vkQueuePresentKHR").with("pPresentInfo", present()),
        Call::new("vkQueuePresentKHR").with("pPresentInfo", present()),
    ];
    let mut writer = Writer::new(Vec::new(), Header { compression: Compression::Zlib, ..Header::default() }).expect("memory");
    calls.into_iter().for_each(|call| writer.call(1, call).expect("a call"));
    writer.finish().expect("memory")
}

#[test]
fn inspect_shows_a_capture() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("gears.gfxr");
    let bytes = capture();
    fs::write(&path, &bytes).expect("a file");
    let path = path.display().to_string();
    let (code, text, message) = run(&["inspect", &path, "--commands"]);
    assert_eq!(code, 0, "{message}");
    for part in [
        ": GFXReconstruct trace\n  version: Vulkan 1.2.7\n  application: gears, engine: no name\n",
        "  device extensions: VK_KHR_swapchain\n",
        "  capture: version 0.0, zlib, whole\n",
        "  window 0: 320x240, B8G8R8A8_UNORM\n",
        "7 calls:\n",
        "failed when it was recorded: vkAcquireNextImageKHR: VK_ERROR_OUT_OF_DATE_KHR: 1 times\n",
        "     4  vkAcquireNextImageKHR(",
    ] {
        assert!(text.contains(part), "no `{part}` in\n{text}");
    }
    let frames = text.lines().find(|line| line.starts_with("  frames")).expect("a row");
    assert!(frames.ends_with(" 2"), "{frames}");
    // A folder that holds one is it, and one whose end is missing is shown up to there.
    fs::write(folder.path().join("gears.gfxr"), &bytes[..bytes.len() - 3]).expect("a file");
    let (code, json, message) = run(&["inspect", &folder.path().display().to_string(), "--json"]);
    assert_eq!(code, 1, "{message}");
    let json: serde_json::Value = serde_json::from_str(&json).expect("JSON");
    assert_eq!((&json["frames"], &json["calls"]["vkCreateDevice"]), (&1.into(), &1.into()));
    assert!(message.contains("the file ends within the block at byte "), "{message}");
}
