//! Import of captures of Vulkan programs.

use std::path::PathBuf;

use gfxr::{Body, Call, Marker, Struct, Value};
use host::Links;
use import::TraceKind;
use import::vulkan::Refusal;
use tempfile::TempDir;
use trace::command::Command;
use trace::{Reading, Trace, TraceError};

use crate::capture::{self, Capture, drawn, extent};

fn commands(trace: &Trace) -> Vec<Command> {
    let mut all = Vec::new();
    let kept = trace.for_each_command(|_, command| {
        all.push(command.clone());
        Ok::<(), TraceError>(())
    });
    kept.expect("commands");
    all
}

fn save(capture: &Capture) -> (TempDir, PathBuf) {
    let home = tempfile::tempdir().expect("a folder");
    let path = home.path().join("made.gfxr");
    std::fs::write(&path, capture.bytes()).expect("a file");
    (home, path)
}

#[test]
fn a_capture_becomes_a_trace_that_keeps_the_rules() {
    let (home, path) = save(&capture::cleared_twice());
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
    let (_home, path) = save(&capture::cleared_twice());
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
    let (_home, path) = save(&capture);
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
    let (_home, path) = save(&capture);
    let error = import::open(&path).err().expect("an error");
    assert!(!error.unsupported);
    assert!(error.to_string().contains("block 4, vkCmdClearColorImage: there is no image 99"), "{error}");
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
    let (_home, path) = save(&drawn(|capture| {
        capture.bind(30);
        capture.draw(3);
        capture.bind(31);
        capture.draw(2);
    }));
    assert_eq!(work(&path), [Command::Draw { vertices: 2, instances: 1, first_vertex: 0, first_instance: 0 }]);
}

#[test]
fn indices_of_8_bits_and_those_that_end_lists_are_converted() {
    let (_home, path) = save(&drawn(|capture| {
        capture.bind(33);
        capture.draw_indexed("VK_INDEX_TYPE_UINT8", 5);
        capture.bind(32);
        capture.draw_indexed("VK_INDEX_TYPE_UINT16", 5);
    }));
    let all = work(&path);
    let one = Command::Dispatch { groups: [1, 1, 1] };
    let plain = Command::DrawIndexed { indices: 5, instances: 1, first_index: 0, base_vertex: 0, first_instance: 0 };
    assert_eq!(all[..3], [one.clone(), one, plain]);
    assert!(matches!(all[3..], [Command::DrawIndirect { indexed: true, count: 1, count_buffer: None, .. }]), "{all:?}");
}

#[test]
fn conditions_hold_for_draws_and_clears_inverted_or_not() {
    for (inverted, dispatches) in [(false, 0), (true, 2)] {
        let (_home, path) = save(&drawn(|capture| {
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
        }));
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
    let (_home, path) = save(&capture);
    assert_eq!(work(&path), [Command::Dispatch { groups: [1, 1, 1] }]);
}

#[test]
fn what_views_and_samplers_ask_for_goes_into_shaders() {
    let (_home, path) = save(&capture::sampled());
    let all = work(&path);
    let one = Command::Dispatch { groups: [1, 1, 1] };
    assert_eq!(all[0], one, "the condition of the dispatch");
    assert!(matches!(all[1..], [Command::DispatchIndirect { offset: 0, .. }, Command::Draw { vertices: 3, .. }]), "{all:?}");
}

#[test]
fn frame_markers_end_frames_of_version_0_1_and_presents_do_not() {
    let frames = |minor: u32, marked: bool| {
        let mut capture = Capture::new();
        capture.header.minor = minor;
        capture.window();
        for number in 1..3 {
            for red in [0.25, 0.5] {
                capture.begin();
                capture.clear(11, red);
                capture.frame();
            }
            if marked {
                capture.blocks.push(Body::Frame { marker: Marker::End, number });
            }
        }
        let (_home, path) = save(&capture);
        let trace = import::open(&path).expect("a trace");
        trace::check(&trace).expect("rules");
        commands(&trace).iter().filter(|command| matches!(command, Command::Present { .. })).count()
    };
    assert_eq!([frames(0, false), frames(1, true), frames(1, false)], [4, 2, 0]);
}

#[test]
fn damaged_captures_are_translated_or_refused() {
    let home = tempfile::tempdir().expect("a folder");
    let path = home.path().join("damaged.gfxr");
    let mut state = 0x9e37_79b9_7f4a_7c15u64;
    for _ in 0..300 {
        let mut byte = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 56) as u8
        };
        let choices: Vec<u8> = (0..1 + usize::from(byte() % 4) * 6).map(|_| byte()).collect();
        crate::damaged::import_damaged(&path, &choices);
    }
}

#[test]
fn memory_stays_where_it_is_while_draws_wait() {
    let (_home, path) = save(&drawn(|capture| {
        let mut before = Capture::new();
        let info = Struct::new("VkMemoryAllocateInfo").with("allocationSize", 4096u64);
        before.call(Call::new("vkAllocateMemory").with("pAllocateInfo", info).with("pMemory", 60u64));
        for (buffer, offset) in [(61u64, 0u64), (62, 2048)] {
            let info = Struct::new("VkBufferCreateInfo").with("size", 256u64);
            before.call(Call::new("vkCreateBuffer").with("pCreateInfo", info).with("pBuffer", buffer));
            let bind = Call::new("vkBindBufferMemory").with("buffer", buffer).with("memory", 60u64);
            before.call(bind.with("memoryOffset", offset));
        }
        capture.blocks.splice(0..0, before.blocks);
        capture.bind(33);
        for buffer in [61u64, 62] {
            capture.command(Call::new("vkCmdBindIndexBuffer").with("buffer", buffer));
            capture.command(Call::new("vkCmdDrawIndexed").with("indexCount", 3u32).with("instanceCount", 1u32));
        }
    }));
    // The second buffer is first used while the first draw waits for the pass to end.
    assert_eq!(work(&path).len(), 2);
}

#[test]
fn draws_are_cut_where_attributes_of_several_instances_change() {
    let (_home, path) = save(&drawn(|capture| {
        capture.vertex = "@vertex fn main(@location(0) a: f32) -> @builtin(position) vec4f { return vec4f(a); }";
        capture.pipeline(34, "VK_PRIMITIVE_TOPOLOGY_TRIANGLE_LIST", false, 0);
        capture.bind(34);
        capture.attribute_of_instances(2);
        let draw = Call::new("vkCmdDraw").with("vertexCount", 3u32).with("instanceCount", 5u32).with("firstInstance", 7u32);
        capture.command(draw);
    }));
    let all = work(&path);
    let draws: Vec<(u32, u32)> = all
        .iter()
        .filter_map(|command| match command {
            Command::Draw { first_instance, instances, .. } => Some((*first_instance, *instances)),
            _ => None,
        })
        .collect();
    assert_eq!(draws, [(7, 2), (9, 2), (11, 1)]);
    let offsets: Vec<u64> = commands(&import::open(&path).expect("a trace"))
        .iter()
        .filter_map(|command| match command {
            Command::SetVertexBuffer { offset, .. } => Some(*offset),
            _ => None,
        })
        .collect();
    assert_eq!(offsets, [28, 32, 36]);
}

#[test]
fn shaders_have_the_numbers_of_the_programs_draws_and_dispatches() {
    let shaders = |capture: &Capture| {
        let (_home, path) = save(capture);
        let trace = import::open(&path).expect("a trace");
        trace::check(&trace).expect("rules");
        let all = commands(&trace);
        let of = |name: fn(&Command) -> bool| all.iter().filter(|command| name(command)).count();
        let draws = of(|command| matches!(command, Command::Draw { .. } | Command::Dispatch { .. }));
        (draws, of(|command| matches!(command, Command::CreateShader { .. })))
    };
    // Of each the shader as it is, one for each number, and the fragment stage.
    assert_eq!(shaders(&capture::numbered(naga::BuiltIn::BaseInstance)), (3, 3));
    assert_eq!(shaders(&capture::numbered(naga::BuiltIn::DrawIndex)), (3, 5));
    assert_eq!(shaders(&capture::dispatched_from()), (2, 3));
}

#[test]
fn a_survey_counts_shaders_and_what_is_refused() {
    let (_home, path) = save(&capture::with_geometry());
    let survey = import::vulkan::survey(&path, Links::Follow, &Reading::default()).expect("a survey");
    assert_eq!((survey.shaders, survey.accepted()), (6, 5));
    let [Refusal { cause, call, times: 2, .. }] = &survey.refused[..] else { panic!("{survey:?}") };
    assert_eq!((cause.as_str(), call.as_str()), ("a geometry stage", "vkCmdDraw"));
    let [shader] = &survey.refused_shaders[..] else { panic!("{survey:?}") };
    assert_eq!(shader.cause, "shader stage VK_SHADER_STAGE_GEOMETRY_BIT");
}
