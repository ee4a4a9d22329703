//! A wheel of thin spokes with four samples per pixel, resolved.

use gfx::format::Format;
use gfx::state::Multisample;
use trace::record::{self, Recorder};

const WIDTH: u32 = 640;
const HEIGHT: u32 = 480;

pub fn record() -> Recorder {
    let mut card = Recorder::new("spokes-msaa");
    let shader = card.create_shader("spokes", include_str!("msaa.wgsl"));
    let mut desc = record::render_pipeline(shader, Format::Rgba8UnormSrgb);
    desc.multisample = Multisample { count: 4, ..Multisample::default() };
    let pipeline = card.create_render_pipeline("spokes", desc);

    let samples = card.create_texture("samples", record::texture_multisampled(WIDTH, HEIGHT, 4, Format::Rgba8UnormSrgb));
    let target = card.create_texture("target", record::texture_2d(WIDTH, HEIGHT, Format::Rgba8UnormSrgb));
    let (samples_view, target_view) = (card.create_view(samples), card.create_view(target));
    let attachment = record::clear_and_resolve(samples_view, [0.85, 0.82, 0.76, 1.0], target_view);
    let mut pass = card.begin_render_pass([attachment], None);
    pass.set_pipeline(pipeline);
    // Two triangles a spoke and ring segment.
    pass.draw(6, 72);
    pass.draw_from(6, 144, 0, 72);
    drop(pass);
    card.present(target);
    card
}
