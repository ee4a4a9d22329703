//! `fillrate inspect` of a capture of a Vulkan program.

use std::path::Path;

use anyhow::{Context, Result, bail};
use gfxr::{Body, Contents, Enum, Reader, Window, version_text};
use serde_json::json;

use super::{Arguments, cut_line};
use crate::cli::{Verdict, say_json};
use crate::host::{self, Links};
use crate::import::TraceKind;
use crate::import::vulkan::{Refusal, Survey, survey};
use crate::report::summary::{bytes, grouped};

pub fn run(arguments: &Arguments, file: &Path) -> Result<Verdict> {
    if arguments.shaders {
        bail!("--shaders: {} is no OpenGL recording", file.display());
    }
    if arguments.device_limits {
        bail!("--device-limits: {} is no wgpu trace", file.display());
    }
    let contents = Contents::read(&mut open(arguments, file)?);
    let survey = survey(file, Links::Follow, &arguments.reading.reading(file)?);
    let sound = contents.damaged_blocks == 0 && contents.cut.is_none();
    let accepted = survey.as_ref().is_ok_and(|survey| survey.refused.is_empty());
    let verdict = if sound && accepted { Verdict::Done } else { Verdict::Failed };
    if arguments.json {
        let mut json = json(&contents);
        json["translation"] = match &survey {
            Ok(survey) => translation(survey),
            Err(error) => json!({ "error": error.to_string() }),
        };
        say_json(&json)?;
        faults(&contents).iter().for_each(|fault| eprintln!("{fault}"));
        return Ok(verdict);
    }
    println!("{}: {} trace", arguments.trace.display(), TraceKind::Gfxr);
    program(&contents);
    let row = |name: &str, value: String| println!("  {name:<40}{value:>16}");
    row("frames", grouped(contents.frames));
    for (number, window) in contents.windows.iter().enumerate() {
        println!("  window {number}: {}", sizes(window));
    }
    if contents.frames == 0 {
        println!("  no call presents: the whole capture is one frame");
    }
    row("shader modules", grouped(contents.shaders));
    row("SPIR-V", bytes(contents.shader_bytes as f64));
    row("written to memory", bytes(contents.data_bytes as f64));
    println!("{} calls:", grouped(contents.all_calls()));
    contents.calls.iter().for_each(|(name, count)| row(name, grouped(*count)));
    contents.unknown.iter().for_each(|(number, count)| row(&format!("call {number:#x}, not known"), grouped(*count)));
    println!("{} other blocks:", grouped(contents.others.values().sum()));
    contents.others.iter().for_each(|(name, count)| row(name, grouped(*count)));
    for ((name, value), count) in &contents.failed {
        println!(
            "failed when it was recorded: {name}: {}: {} times",
            Enum { kind: "VkResult", value: *value },
            grouped(*count)
        );
    }
    match &survey {
        Ok(survey) => {
            row("shaders accepted", format!("{} of {}", grouped(survey.accepted()), grouped(survey.shaders)));
            let line = |what: &str, refusal: &Refusal| {
                let Refusal { cause, call, times, first } = refusal;
                println!("{what}: {cause}: {call}, {} times, first in block {first}", grouped(*times));
            };
            survey.refused_shaders.iter().for_each(|refusal| line("shader refused", refusal));
            survey.refused.iter().for_each(|refusal| line("refused", refusal));
        }
        Err(error) => println!("cannot be replayed: {error}"),
    }
    faults(&contents).iter().for_each(|fault| println!("{fault}"));
    if arguments.commands {
        for block in open(arguments, file)? {
            match block {
                Ok(block) => println!("{:>6}  {}", block.index, line(&block.body)),
                Err(error) => println!("        {error}"),
            }
        }
    }
    Ok(verdict)
}

fn open(arguments: &Arguments, file: &Path) -> Result<Reader<std::fs::File>> {
    let most = arguments.reading.limits()?.memory_bytes.get();
    let input = host::open(file, Links::Follow).with_context(|| format!("cannot read {}", file.display()))?;
    let reader = Reader::new(input).with_context(|| format!("cannot read {}", file.display()))?;
    Ok(reader.with_limits(gfxr::Limits { block: most, data: most }))
}

/// Says what the program is, and what it was recorded on.
fn program(contents: &Contents) {
    for application in &contents.applications {
        // A program that says no version of Vulkan gets the first.
        let version = if application.api_version == 0 { "1.0".into() } else { version_text(application.api_version) };
        println!("  version: Vulkan {version}");
        let or_none = |name: &str| if name.is_empty() { "no name".to_owned() } else { name.to_owned() };
        println!("  application: {}, engine: {}", or_none(&application.name), or_none(&application.engine));
    }
    for (what, names) in [("instance", &contents.instance_extensions), ("device", &contents.device_extensions)] {
        let names = if names.is_empty() { "none".to_owned() } else { names.join(" ") };
        println!("  {what} extensions: {names}");
    }
    for device in &contents.devices {
        println!("  recorded on: {}, Vulkan {}", device.name, version_text(device.api_version));
    }
    let header = &contents.header;
    let from = contents.first_frame.map_or("whole".to_owned(), |first| format!("trimmed, from frame {first} on"));
    println!("  capture: version {}.{}, {}, {from}", header.major, header.minor, header.compression);
}

/// The sizes and formats that the swapchains of a window had.
fn sizes(window: &Window) -> String {
    let swapchain = |([width, height], format): &([u32; 2], Enum)| {
        let format = format.to_string();
        format!("{width}x{height}, {}", format.strip_prefix("VK_FORMAT_").unwrap_or(&format))
    };
    window.swapchains.iter().map(swapchain).collect::<Vec<_>>().join(", then ")
}

/// The faults of the file.
fn faults(contents: &Contents) -> Vec<String> {
    let mut faults: Vec<String> = contents.damaged.iter().map(|error| format!("damaged: {error}")).collect();
    let more = contents.damaged_blocks - contents.damaged.len() as u64;
    if more > 0 {
        faults.push(format!("damaged: {} more blocks", grouped(more)));
    }
    if let Some(cut) = contents.cut {
        faults.push(format!("the file ends within the block at byte {}, {} bytes behind its start", cut.offset, cut.found));
    }
    faults
}

fn json(contents: &Contents) -> serde_json::Value {
    let header = &contents.header;
    json!({
        "format": format!("{}.{}", header.major, header.minor),
        "compression": header.compression.to_string(),
        "applications": contents.applications.iter().map(|application| json!({
            "name": application.name,
            "engine": application.engine,
            "api_version": version_text(application.api_version),
        })).collect::<Vec<_>>(),
        "devices": contents.devices.iter().map(|device| json!({
            "name": device.name,
            "api_version": version_text(device.api_version),
        })).collect::<Vec<_>>(),
        "instance_extensions": contents.instance_extensions,
        "device_extensions": contents.device_extensions,
        "frames": contents.frames,
        "first_frame": contents.first_frame,
        "windows": contents.windows.iter().map(|window| json!({
            "swapchains": window.swapchains.iter().map(|([width, height], format)| json!({
                "width": width,
                "height": height,
                "format": format.to_string(),
            })).collect::<Vec<_>>(),
        })).collect::<Vec<_>>(),
        "shaders": contents.shaders,
        "shader_bytes": contents.shader_bytes,
        "data_bytes": contents.data_bytes,
        "blocks": contents.blocks,
        "calls": contents.calls,
        "unknown_calls": contents.unknown.iter().map(|(number, count)| (format!("{number:#x}"), *count)).collect::<std::collections::BTreeMap<_, _>>(),
        "other_blocks": contents.others,
        "damaged_blocks": contents.damaged_blocks,
        "cut_at": contents.cut.map(|cut| cut.offset),
    })
}

fn translation(survey: &Survey) -> serde_json::Value {
    let list = |all: &[Refusal]| -> Vec<serde_json::Value> {
        let one = |Refusal { cause, call, times, first }: &Refusal| json!({ "cause": cause, "call": call, "times": times, "first_block": first });
        all.iter().map(one).collect()
    };
    json!({
        "shaders": survey.shaders,
        "accepted_shaders": survey.accepted(),
        "refused_shaders": list(&survey.refused_shaders),
        "refused": list(&survey.refused),
    })
}

/// A block on one line.
fn line(body: &Body) -> String {
    let text = match body {
        Body::Call(call) => call.to_string(),
        Body::UnknownCall { number, data } => format!("call {number:#x}, {} bytes", data.len()),
        Body::FillMemory { memory, offset, data } => format!("FillMemory #{memory}, from {offset}: {} bytes", data.len()),
        Body::InitBuffer { buffer, data, .. } => format!("InitBuffer #{buffer}: {} bytes", data.len()),
        Body::InitImage { image, data, .. } => format!("InitImage #{image}: {} bytes", data.len()),
        Body::Other { data, .. } => format!("{}, {} bytes", body.name(), data.len()),
        body => format!("{body:?}"),
    };
    cut_line(text)
}
