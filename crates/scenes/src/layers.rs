//! Ten opaque layers over every pixel, in an order that is drawn by lot for each of 1,200 cells: of ten fragments per pixel, the
//! expected number that pass the depth test is the tenth harmonic number, 2.929.
//!
//! A smaller picture of them is recorded in three orders: front first, by lot, back first. Nothing else differs.

use gfx::format::Format;
use gfx::state::*;
use trace::record::{self, Recorder};

use crate::maths::*;

const LAYERS: u32 = 10;

/// The order in which a cell's layers are drawn.
#[derive(Clone, Copy)]
enum Order {
    FrontFirst,
    ByLot,
    BackFirst,
}

impl Order {
    /// The layers of a cell in this order; 0 is nearest.
    fn of(self, cell: u32) -> Vec<u32> {
        let mut order: Vec<u32> = (0..LAYERS).collect();
        match self {
            Order::FrontFirst => {}
            Order::ByLot => {
                for last in (1..order.len()).rev() {
                    let pick = (uniform(23, cell, last as u32) * (last + 1) as f64) as usize;
                    order.swap(last, pick);
                }
            }
            Order::BackFirst => order.reverse(),
        }
        order
    }
}

pub fn record() -> Recorder {
    recorded("layers", [40, 30], Order::ByLot)
}

/// Cells in a row and rows of the smaller picture.
const SMALL: [u32; 2] = [16, 12];

pub fn front_first() -> Recorder {
    recorded("layers-front-first", SMALL, Order::FrontFirst)
}

pub fn random() -> Recorder {
    recorded("layers-random", SMALL, Order::ByLot)
}

pub fn back_first() -> Recorder {
    recorded("layers-back-first", SMALL, Order::BackFirst)
}

/// Cells in a row and rows; each is 16x16 pixels.
fn recorded(name: &str, [columns, rows]: [u32; 2], order: Order) -> Recorder {
    let mut card = Recorder::new(name);
    let orders: Vec<Vec<u32>> = (0..columns * rows).map(|cell| order.of(cell)).collect();
    // The k-th layer of all cells comes before the k+1-th of any. An instance: column, row, layer, tint.
    let mut instances = Vec::new();
    for turn in 0..LAYERS as usize {
        for (cell, order) in orders.iter().enumerate() {
            let cell = cell as u32;
            let tint = (uniform(29, cell, order[turn]) * 256.0) as u8;
            instances.extend([(cell % columns) as u8, (cell / columns) as u8, order[turn] as u8, tint]);
        }
    }
    let instances = card.create_buffer_init("instances", &instances);

    let target = card.create_texture("target", record::texture_2d(16 * columns, 16 * rows, Format::Rgba8UnormSrgb));
    let depth = card.create_texture("depth", record::texture_2d(16 * columns, 16 * rows, Format::Depth32Float));
    let (target_view, depth_view) = (card.create_view(target), card.create_view(depth));
    // The file has the cells of the larger picture.
    let shader = include_str!("layers.wgsl")
        .replace("columns = 40.0", &format!("columns = {columns}.0"))
        .replace("rows = 30.0", &format!("rows = {rows}.0"));
    let shader = card.create_shader("layers", &shader);
    let mut desc = record::render_pipeline(shader, Format::Rgba8UnormSrgb);
    desc.buffers = vec![record::instance_buffer(&[(0, VertexFormat::Uint8x4)])];
    desc.depth_stencil = Some(record::depth_less(Format::Depth32Float));
    let pipeline = card.create_render_pipeline("layers", desc);

    let clear = record::clear(target_view, [0.0, 0.0, 0.0, 1.0]);
    let mut pass = card.begin_render_pass([clear], record::clear_depth(depth_view, false));
    pass.set_pipeline(pipeline);
    pass.set_vertex_buffer(0, instances);
    pass.draw(6, columns * rows * LAYERS);
    drop(pass);
    card.present(target);
    card
}
