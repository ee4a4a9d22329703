//! A few frames of particles that a compute pass moves: workgroup memory and a barrier for their common centre, an atomic count
//! of those that came round, and an indirect draw.

use gfx::format::Format;
use gfx::state::*;
use trace::command::*;
use trace::record::{self, Recorder};

const WIDTH: u32 = 640;
const HEIGHT: u32 = 480;
const PARTICLES: u32 = 4_096;
const WORKGROUP: u32 = 64;
const FRAMES: u32 = 4;

pub fn record() -> Recorder {
    let mut card = Recorder::new("particles");
    let particles = card.create_buffer("particles", u64::from(PARTICLES) * 16);
    let centers = card.create_buffer("centers", u64::from(PARTICLES / WORKGROUP) * 8);
    // Vertices, instances, first vertex, first instance.
    let draw: Vec<u8> = [4u32, 0, 0, 0].iter().flat_map(|word| word.to_le_bytes()).collect();
    let draw = card.create_buffer_init("draw", &draw);

    let move_layout = card.create_bind_group_layout([(0, record::STORAGE), (1, record::STORAGE), (2, record::STORAGE)]);
    let move_group = card
        .create_bind_group(move_layout, [(0, record::whole(particles)), (1, record::whole(centers)), (2, record::whole(draw))]);
    let move_pipelines = card.create_pipeline_layout([move_layout], 4);
    let shader = card.create_shader("particles", include_str!("particles.wgsl"));
    let scatter = card.create_compute_pipeline("scatter", Some(move_pipelines), record::stage_entry(shader, "scatter"));
    let advance = card.create_compute_pipeline("advance", Some(move_pipelines), record::stage_entry(shader, "advance"));

    let show_layout = card.create_bind_group_layout([(0, record::STORAGE_READ)]);
    let show_group = card.create_bind_group(show_layout, [(0, record::whole(particles))]);
    let show_pipelines = card.create_pipeline_layout([show_layout], 0);
    let shader = card.create_shader("glow", include_str!("glow.wgsl"));
    let mut desc = record::render_pipeline(shader, Format::Rgba8Unorm);
    desc.layout = Some(show_pipelines);
    desc.primitive.topology = Topology::TriangleStrip;
    let add = BlendComponent { src: BlendFactor::One, dst: BlendFactor::One, op: BlendOp::Add };
    desc.targets =
        vec![Some(ColorTarget { blend: Some(Blend { color: add, alpha: add }), ..record::target(Format::Rgba8Unorm) })];
    let show = card.create_render_pipeline("glow", desc);

    let target = card.create_texture("target", record::texture_2d(WIDTH, HEIGHT, Format::Rgba8Unorm));
    let view = card.create_view(target);
    for frame in 0..FRAMES {
        // The advance pass counts the instances anew.
        card.push(Command::ClearBuffer { buffer: draw, offset: 4, size: Some(4) });
        {
            let mut pass = card.begin_compute_pass();
            pass.set_bind_group(0, move_group);
            if frame == 0 {
                pass.set_pipeline(scatter);
                pass.dispatch(PARTICLES / WORKGROUP, 1, 1);
            }
            pass.set_pipeline(advance);
            pass.set_immediates(0, &[frame]);
            pass.dispatch(PARTICLES / WORKGROUP, 1, 1);
        }
        {
            let mut pass = card.begin_render_pass([record::clear(view, [0.008, 0.010, 0.022, 1.0])], None);
            pass.set_pipeline(show);
            pass.set_bind_group(0, show_group);
            pass.draw_indirect(draw, 0, false);
        }
        card.present(target);
    }
    card
}
