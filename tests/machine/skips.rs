//! Unneeded work of a scene is skipped, and nothing else changes.

use std::path::Path;
use std::time::Duration;

use fillrate::accuracy::skips::{SKIPS, Saving, Turns, savings};
use fillrate::gfx::format::Format;
use fillrate::machine::Config;
use fillrate::trace::Trace;
use fillrate::trace::record::{self, Recorder};

/// Screens drawn over each other without depths, by one draw.
fn screens() -> Trace {
    let mut card = Recorder::new("screens");
    let target = card.create_texture("target", record::texture_2d(96, 80, Format::Rgba8Unorm));
    let view = card.create_view(target);
    let shader = card.create_shader(
        "screens",
        "struct Varying { @builtin(position) position: vec4f, @location(0) tint: vec4f }
         @vertex fn whole(@builtin(vertex_index) index: u32, @builtin(instance_index) screen: u32) -> Varying {
             let at = vec2f(f32(index & 1u), f32(index >> 1u)) * 4.0 - 1.0;
             return Varying(vec4f(at, 0.5, 1.0), vec4f(f32(screen) / 4.0, f32(index), 0.5, 1.0));
         }
         @fragment fn tinted(in: Varying) -> @location(0) vec4f { return in.tint; }",
    );
    let pipeline = card.create_render_pipeline("screens", record::render_pipeline(shader, Format::Rgba8Unorm));
    {
        let mut pass = card.begin_render_pass([record::clear(view, [0.0; 4])], None);
        pass.set_pipeline(pipeline);
        pass.draw(3, 4);
    }
    card.present(target);
    card.finish()
}

fn scene(name: &str) -> Trace {
    Trace::open(Path::new(env!("CARGO_MANIFEST_DIR")).join("traces").join(name)).expect("a trace of the repository")
}

fn all(trace: &Trace) -> Vec<Saving> {
    let turns = Turns { least: 1, time: Duration::ZERO };
    savings(trace, &Config::built_in("four-pipelines").expect("it is built in"), turns).expect("all run")
}

#[test]
fn skips_change_no_picture_and_save_work() {
    // One after the other: a replay on a thread of the pool waits for its renderer, which needs threads of the pool.
    // The command of `docs/data/skips.md` ends with an error if something changes on the cube.
    let scenes = ["panel.zip", "viewer.zip", "town.zip"];
    let traces = scenes.into_iter().map(scene).chain([screens()]);
    let found: Vec<Vec<Saving>> = traces.map(|trace| all(&trace)).collect();
    for saving in found.iter().flatten() {
        assert_eq!(saving.differs, None, "{}", saving.skip.name);
    }
    for (at, skip) in SKIPS.iter().enumerate() {
        let saves = |saving: &Saving| saving.work.is_some_and(|[on, off]| on < off);
        // Nothing counts what idle cycles and full blocks save the host.
        if found[0][at].work.is_some() {
            assert!(found.iter().any(|savings| saves(&savings[at])), "{} saves nothing", skip.name);
        }
    }
}
