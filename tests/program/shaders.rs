//! `fillrate shaders`: the cost of shaders by line of their source.

use std::path::Path;

use fillrate::gfx::format::Format;
use fillrate::gfx::stage::Stage;
use fillrate::record::{self, Recorder};
use fillrate::report::shaders::{ShaderListing, listings};
use fillrate::run::shader_cost::shader_costs;
use fillrate::{Trace, import};
use serde_json::Value;

use crate::cli::{refused, run};

fn listed(trace: &Trace) -> Vec<ShaderListing> {
    let costs = shader_costs(trace, 0).unwrap_or_else(|error| panic!("{error:#}"));
    listings(trace, &costs).unwrap_or_else(|error| panic!("{error}"))
}

#[test]
fn lines_add_up_to_all_instructions() {
    for name in ["cube", "shadow", "particles", "spokes-msaa", "viewer.zip"] {
        let trace = import::open(Path::new("traces").join(name)).unwrap_or_else(|error| panic!("{error}"));
        let costs = shader_costs(&trace, 0).unwrap_or_else(|error| panic!("{name}: {error:#}"));
        assert!(costs.values().any(|cost| cost.instructions > 0), "{name}");
        for (stage, cost) in &costs {
            assert_eq!(cost.lines.values().sum::<u64>(), cost.instructions, "{name}, {stage:?}");
        }
        let all = listed(&trace);
        let sum = |of: &dyn Fn(&ShaderListing) -> u64| all.iter().map(of).sum::<u64>();
        assert_eq!(
            sum(&|listing| listing.cost.instructions),
            costs.values().map(|cost| cost.instructions).sum::<u64>(),
            "{name}"
        );
        // Lines of the text have most of it: what all invocations share, and what the program begins with, has none.
        let named = sum(&|listing| listing.lines().iter().map(|(_, cost, _)| cost).sum());
        assert!(2 * named > sum(&|listing| listing.cost.instructions), "{name}: {named}");
    }
}

/// A shader with a loop that only the pixels left of a column make.
fn divided(column: u32) -> Trace {
    let mut card = Recorder::new("divided");
    let shader = card.create_shader(
        "divided",
        &format!(
            "@vertex fn vs(@builtin(vertex_index) v: u32) -> @builtin(position) vec4f {{
                 return vec4f(f32(v & 1u) * 4.0 - 1.0, f32(v >> 1u) * 4.0 - 1.0, 0.0, 1.0);
             }}
             @fragment fn fs(@builtin(position) p: vec4f) -> @location(0) vec4f {{
                 var x = p.y;
                 if p.x < {column}.0 {{
                     for (var i = 0; i < i32(p.y) % 4 + 3; i++) {{
                         x = sin(x) * cos(x);
                     }}
                 }}
                 return vec4f(x);
             }}"
        ),
    );
    let target = card.create_texture("target", record::texture_2d(64, 64, Format::Rgba8Unorm));
    let view = card.create_view(target);
    let pipeline = card.create_render_pipeline("divided", record::render_pipeline(shader, Format::Rgba8Unorm));
    {
        let mut pass = card.begin_render_pass([record::clear(view, [0.0; 4])], None);
        pass.set_pipeline(pipeline);
        pass.draw(3, 1);
    }
    card.present(target);
    card.finish()
}

#[test]
fn a_line_counts_the_invocations_that_execute_it() {
    let [half, quarter] = [32, 16].map(|column| {
        let all = listed(&divided(column));
        let fragment = all.into_iter().find(|listing| listing.stage == Stage::Fragment).expect("a fragment stage");
        assert_eq!(fragment.cost.invocations, 64 * 64);
        assert_eq!(fragment.file, "divided.wgsl");
        let of = |part: &str| {
            let line = fragment.lines().into_iter().find(|(.., text)| text.contains(part));
            line.unwrap_or_else(|| panic!("{part}: {fragment:?}")).1
        };
        (of("sin(x)"), of("return vec4f(x)"), of("@fragment"))
    });
    assert!(half.0 > 0 && half.0 == 2 * quarter.0, "{half:?}, {quarter:?}");
    assert_eq!((half.1, half.2), (quarter.1, quarter.2), "what all invocations execute");
}

#[test]
fn text_and_json_tell_the_same_costs() {
    let (code, text, message) = run(&["shaders", "traces/shadow"]);
    assert_eq!(code, 0, "{message}");
    let (_, json, _) = run(&["shaders", "traces/shadow", "--json"]);
    let json: Value = serde_json::from_str(&json).expect("JSON");
    let shaders = json["shaders"].as_array().expect("shaders");
    assert!(shaders.len() > 1 && text.starts_with("frame 0: "), "{text}");
    for shader in shaders {
        let file = shader["file"].as_str().expect("a file");
        assert!(text.contains(&format!("\n{file}")), "{file}: {text}");
        let lines = shader["lines"].as_array().expect("lines");
        let sum: u64 = lines.iter().filter_map(|line| line["instructions"].as_u64()).sum();
        assert_eq!(Some(sum), shader["instructions"].as_u64());
    }
    assert!(refused(&["shaders", "traces/cube", "--frame", "3"]).contains("the trace has no frame 3"));
}
