//! Ten opaque layers over every pixel, in an order that is drawn by lot for each of 1,200 cells: of ten fragments a pixel, the
//! expected number that pass the depth test is the tenth harmonic number, 2.929.

use fillrate::gfx::format::Format;
use fillrate::gfx::state::*;
use fillrate::trace::record::{self, Recorder};

use super::maths::*;

/// Cells in a row and rows; each is 16x16 pixels.
const COLUMNS: u32 = 40;
const ROWS: u32 = 30;
const LAYERS: u32 = 10;

pub fn record() -> Recorder {
    let mut card = Recorder::new("layers");
    // A random permutation of the layers for each cell.
    let orders: Vec<Vec<u32>> = (0..COLUMNS * ROWS)
        .map(|cell| {
            let mut order: Vec<u32> = (0..LAYERS).collect();
            for last in (1..order.len()).rev() {
                let pick = (uniform(23, cell, last as u32) * (last + 1) as f64) as usize;
                order.swap(last, pick);
            }
            order
        })
        .collect();
    // The k-th layer of all cells comes before the k+1-th of any. An instance: column, row, layer, tint.
    let mut instances = Vec::new();
    for turn in 0..LAYERS as usize {
        for (cell, order) in orders.iter().enumerate() {
            let cell = cell as u32;
            let tint = (uniform(29, cell, order[turn]) * 256.0) as u8;
            instances.extend([(cell % COLUMNS) as u8, (cell / COLUMNS) as u8, order[turn] as u8, tint]);
        }
    }
    let instances = card.create_buffer_init("instances", &instances);

    let target = card.create_texture("target", record::texture_2d(16 * COLUMNS, 16 * ROWS, Format::Rgba8UnormSrgb));
    let depth = card.create_texture("depth", record::texture_2d(16 * COLUMNS, 16 * ROWS, Format::Depth32Float));
    let (target_view, depth_view) = (card.create_view(target), card.create_view(depth));
    let shader = card.create_shader("layers", include_str!("layers.wgsl"));
    let mut desc = record::render_pipeline(shader, Format::Rgba8UnormSrgb);
    desc.buffers = vec![record::instance_buffer(&[(0, VertexFormat::Uint8x4)])];
    desc.depth_stencil = Some(record::depth_less(Format::Depth32Float));
    let pipeline = card.create_render_pipeline("layers", desc);

    let clear = record::clear(target_view, [0.0, 0.0, 0.0, 1.0]);
    let mut pass = card.begin_render_pass([clear], record::clear_depth(depth_view, false));
    pass.set_pipeline(pipeline);
    pass.set_vertex_buffer(0, instances);
    pass.draw(6, COLUMNS * ROWS * LAYERS);
    drop(pass);
    card.present(target);
    card
}
