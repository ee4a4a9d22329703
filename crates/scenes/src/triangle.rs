//! One triangle with a colour at each corner.

use gfx::format::Format;
use gfx::state::VertexFormat;
use trace::record::{self, Recorder};

use crate::maths::floats;

pub fn record() -> Recorder {
    let mut card = Recorder::new("triangle");
    let mut bytes = Vec::new();
    for (position, color) in [([0.0, 0.8], [255, 64, 64]), ([-0.7, -0.6], [64, 255, 96]), ([0.7, -0.6], [80, 112, 255])] {
        bytes.extend(floats(position));
        bytes.extend(color);
        bytes.push(255);
    }
    let vertices = card.create_buffer_init("vertices", &bytes);
    let target = card.create_texture("target", record::texture_2d(640, 480, Format::Rgba8Unorm));
    let view = card.create_view(target);
    let shader = card.create_shader("triangle", include_str!("triangle.wgsl"));
    let mut desc = record::render_pipeline(shader, Format::Rgba8Unorm);
    desc.buffers = vec![record::vertex_buffer(&[(0, VertexFormat::Float32x2), (1, VertexFormat::Unorm8x4)])];
    let pipeline = card.create_render_pipeline("triangle", desc);

    let mut pass = card.begin_render_pass([record::clear(view, [0.06, 0.07, 0.09, 1.0])], None);
    pass.set_pipeline(pipeline);
    pass.set_vertex_buffer(0, vertices);
    pass.draw(3, 1);
    drop(pass);
    card.present(target);
    card
}
