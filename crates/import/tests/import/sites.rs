//! Draws, dispatches, copies and clears of every importer say where the recorded program made them, and in which debug groups.

use std::path::Path;

use gfxr::{Call, Struct};
use import::gl::import_bytes;
use num::CallSite;
use trace::command::Command;
use trace::{Reading, Trace, TraceError};

use crate::capture::drawn;
use crate::recorder::{Value, Writer};

/// A command that does work: its name, where it was made, and the debug groups that are open.
type Made = (&'static str, Option<CallSite>, Vec<String>);

fn made(trace: &Trace) -> Vec<Made> {
    let (mut all, mut site, mut groups) = (Vec::new(), None, Vec::new());
    let read = trace.for_each_command(|_, command| {
        match command {
            Command::SetCallSite(stated) => site = Some(*stated),
            Command::PushDebugGroup(label) => groups.push(label.clone()),
            Command::PopDebugGroup => drop(groups.pop().expect("a group")),
            command if command.does_work() => all.push((command.name(), site, groups.clone())),
            _ => {}
        }
        Ok::<(), TraceError>(())
    });
    read.expect("commands");
    all
}

/// The same when it has been written as a native trace and read again.
fn natively(trace: &Trace) -> Vec<Made> {
    let home = tempfile::tempdir().expect("a folder");
    trace::write(trace, home.path()).unwrap_or_else(|error| panic!("{error}"));
    made(&Trace::open(home.path()).unwrap_or_else(|error| panic!("{error}")))
}

#[test]
fn lines_of_a_wgpu_trace_hold_the_commands() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/import/all");
    let text = std::fs::read_to_string(folder.join("trace.ron")).expect("a trace");
    let lines: Vec<&str> = text.lines().map(str::trim_start).collect();
    let trace = import::open(&folder).unwrap_or_else(|error| panic!("{error}"));
    let all = made(&trace);
    assert!(all.len() > 15, "{all:?}");
    for (name, site, _) in &all {
        let Some(CallSite::Line(line)) = *site else { panic!("{name}: {site:?}") };
        let wanted: &[&str] = match *name {
            "BeginRenderPass" => &["RunRenderPass("],
            "DrawIndirect" => &["DrawIndirect(", "MultiDrawIndirectCount("],
            "Dispatch" => &["DispatchWorkgroups("],
            "DispatchIndirect" => &["DispatchWorkgroupsIndirect("],
            "ExecuteBundles" => &["ExecuteBundle("],
            name => &[name],
        };
        let there = lines[line as usize - 1];
        assert!(wanted.iter().any(|wanted| there.starts_with(wanted)), "{name}: line {line} is {there}");
    }
    assert_eq!(natively(&trace), all);
}

#[test]
fn draws_of_a_capture_have_the_blocks_of_their_calls_and_labels() {
    let label = |text: &str| Struct::new("VkDebugUtilsLabelEXT").with("pLabelName", text);
    let begin = |text: &str| Call::new("vkCmdBeginDebugUtilsLabelEXT").with("pLabelInfo", label(text));
    let end = || Call::new("vkCmdEndDebugUtilsLabelEXT");
    let mut blocks = Vec::new();
    let capture = drawn(|capture| {
        let passes = capture.blocks.len() as u64 - 1;
        capture.bind(33);
        capture.command(begin("scene"));
        blocks.extend([passes, capture.blocks.len() as u64]);
        capture.draw(3);
        capture.command(begin("trees"));
        blocks.push(capture.blocks.len() as u64);
        capture.draw(6);
        capture.command(end());
        capture.command(end());
        // One that began before the capture did.
        capture.command(end());
        blocks.push(capture.blocks.len() as u64);
        capture.draw(9);
    });
    let home = tempfile::tempdir().expect("a folder");
    let path = home.path().join("made.gfxr");
    std::fs::write(&path, capture.bytes()).expect("a file");
    let trace = import::open(&path).unwrap_or_else(|error| panic!("{error}"));
    let all = made(&trace);
    let site = |at: usize| Some(CallSite::Block(blocks[at]));
    let groups = |labels: &[&str]| labels.iter().map(|&label| label.to_owned()).collect::<Vec<_>>();
    let expected = [
        ("BeginRenderPass", site(0), groups(&[])),
        ("Draw", site(1), groups(&["scene"])),
        ("Draw", site(2), groups(&["scene", "trees"])),
        ("Draw", site(3), groups(&[])),
    ];
    assert_eq!(all, expected);
    assert_eq!(natively(&trace), all);
}

#[test]
fn draws_of_an_opengl_recording_have_the_numbers_of_their_calls_and_groups() {
    use Value::*;
    let mut w = Writer::new(6);
    // The number of the call that ends the triangle, which is when there is something to draw.
    let triangle = |w: &mut Writer| {
        w.call("glBegin", &[Enum(4)]);
        for [x, y] in [[-1.0, -1.0], [1.0, -1.0], [0.0, 1.0]] {
            w.call("glVertex3f", &[Float(x), Float(y), Float(0.0)]);
        }
        w.call("glEnd", &[]);
        w.calls - 1
    };
    let push = |w: &mut Writer, label: &str| {
        w.call("glPushDebugGroup", &[Enum(0x824a), Uint(1), Uint(5), Blob(label.into())]);
    };
    w.call("glViewport", &[Uint(0), Uint(0), Uint(32), Uint(16)]);
    w.call("glClear", &[Uint(0x4000)]);
    let clear = w.calls - 1;
    push(&mut w, "scene");
    let first = triangle(&mut w);
    // Of the same state: it is joined with the one before.
    triangle(&mut w);
    w.call("glEnable", &[Enum(0xbe2)]);
    push(&mut w, "trees");
    let second = triangle(&mut w);
    w.call("glPopDebugGroup", &[]);
    w.call("glDisable", &[Enum(0xbe2)]);
    w.call("glPopDebugGroup", &[]);
    let third = triangle(&mut w);
    w.call("glXSwapBuffers", &[Uint(1), Uint(2)]);
    let (trace, _) = import_bytes(Path::new("x.trace"), w.file(1 << 16), [&[], &[]], &Reading::default())
        .unwrap_or_else(|error| panic!("{error}"));
    let all = made(&trace);
    let groups = |labels: &[&str]| labels.iter().map(|&label| label.to_owned()).collect::<Vec<_>>();
    let site = |call| Some(CallSite::Call(call));
    let expected = [
        ("BeginRenderPass", site(clear), groups(&[])),
        ("DrawIndexed", site(first), groups(&["scene"])),
        ("DrawIndexed", site(second), groups(&["scene", "trees"])),
        ("DrawIndexed", site(third), groups(&[])),
    ];
    assert_eq!(all, expected);
    assert_eq!(natively(&trace), all);
}
