//! What lists of tiles take: vertices once, by their size, and what is read of them.

use crate::common::{self, config};
use fillrate::gfx::format::Format;
use fillrate::gfx::state::*;
use fillrate::run::replay::{Fidelity, Options, Replay, replay};
use fillrate::sim::Clock;
use fillrate::synthetic::{Scene, events};
use fillrate::trace::record::{self, Recorder};

/// Cells along an edge of the grid.
const CELLS: u32 = 8;

/// Vertices of the grid, and triangles.
const VERTICES: f64 = ((CELLS + 1) * (CELLS + 1)) as f64;
const TRIANGLES: f64 = (2 * CELLS * CELLS) as f64;

/// Bytes of an entry of a list.
const ENTRY: f64 = 4.0;

const SHADER: &str = "
struct Varying { @builtin(position) position: vec4<f32>, @location(0) tint: vec3<f32> }
@vertex fn vertex(@location(0) at: vec4<f32>) -> Varying { return Varying(at, at.xyz); }
@fragment fn fragment(in: Varying) -> @location(0) vec4<f32> { return vec4<f32>(in.tint, 1.0); }
";

/// An indexed grid of triangles over an image of 64x64 pixels; and, beside it if `clipped`, one that a plane cuts in two.
fn grid(clipped: bool) -> Recorder {
    let mut card = Recorder::new("grid");
    let corner = |n: u32| (n as f32) / CELLS as f32 * 2.0 - 1.0;
    let mut points: Vec<[f32; 4]> =
        (0..=CELLS).flat_map(|y| (0..=CELLS).map(move |x| [corner(x), corner(y), 0.5, 1.0])).collect();
    let row = CELLS + 1;
    let cell = |x: u32, y: u32| [0, 1, row, 1, row + 1, row].map(|k| (y * row + x + k) as u16);
    let mut indices: Vec<u16> = (0..CELLS).flat_map(|y| (0..CELLS).flat_map(move |x| cell(x, y))).collect();
    if clipped {
        indices.extend([0, 1, 2].map(|k| points.len() as u16 + k));
        // The near plane leaves a quad of it.
        points.extend([[-0.5, -0.5, 0.2, 1.0], [0.5, -0.5, 0.2, 1.0], [0.0, 0.5, -0.2, 1.0]]);
    }
    let bytes: Vec<u8> = points.iter().flatten().flat_map(|word| word.to_le_bytes()).collect();
    let vertices = card.create_buffer_init("vertices", &bytes);
    let triangles = card.create_buffer_init("triangles", bytemuck::cast_slice(&indices));
    let target = card.create_texture("target", record::texture_2d(64, 64, Format::Rgba8Unorm));
    let view = card.create_view(target);
    let mut desc = record::render_pipeline(card.create_shader("grid", SHADER), Format::Rgba8Unorm);
    desc.buffers = vec![record::vertex_buffer(&[(0, VertexFormat::Float32x4)])];
    let pipeline = card.create_render_pipeline("grid", desc);
    let mut pass = card.begin_render_pass([record::clear(view, [0.0; 4])], None);
    pass.set_pipeline(pipeline);
    pass.set_vertex_buffer(0, vertices);
    pass.set_index_buffer(triangles, IndexFormat::Uint16);
    pass.draw_indexed(indices.len() as u32, 1);
    drop(pass);
    card.present(target);
    card
}

fn run(clipped: bool, changes: &[&str]) -> Replay {
    let options = Options::new(config("sort-middle-binned", changes), Fidelity::Cycle);
    replay(&grid(clipped).finish(), &options, &|_| ()).expect("it runs")
}

/// Numbers of the binning unit.
fn binning<const N: usize>(of: &Replay, names: [&str; N]) -> [f64; N] {
    names.map(|name| of.total.number(&format!("binning.{name}")).expect("a number"))
}

#[test]
fn vertices_are_kept_once_by_their_size() {
    // One pipeline draws a tile, and reads each line once.
    let whole = ["bin.tile=64", "bin.cache_lines=4096"];
    let pictures = run(false, &whole).frames[0].shown.clone();
    for (vertices, per_vertex) in [("once", VERTICES), ("each", 3.0 * TRIANGLES)] {
        // Three words for the fragment stage.
        for (word, position, own) in [(2, 16, 12), (4, 16, 12), (1, 12, 6)] {
            let sizes = [
                format!("bin.word_bytes={word}"),
                format!("bin.position_bytes={position}"),
                format!("bin.triangle_bytes={own}"),
                format!("bin.vertices={vertices}"),
            ];
            let changes: Vec<&str> = whole.iter().copied().chain(sizes.iter().map(String::as_str)).collect();
            let replay = run(false, &changes);
            let kept = per_vertex * f64::from(position + 3 * word) + TRIANGLES * f64::from(own);
            let read = (kept / 64.0).ceil() * 64.0 + TRIANGLES * ENTRY;
            assert_eq!(
                binning(&replay, ["vertices", "triangle_bytes", "list_bytes", "read_bytes"]),
                [per_vertex, kept, TRIANGLES * ENTRY, read],
                "{changes:?}"
            );
            assert!(replay.frames[0].shown == pictures, "{changes:?}");
        }
    }
}

#[test]
fn clipped_triangles_have_vertices_of_their_own() {
    let [vertices, bytes] = binning(&run(true, &["bin.tile=64"]), ["vertices", "triangle_bytes"]);
    // Two triangles are left of one that is cut.
    assert_eq!(vertices, VERTICES + 2.0 * 3.0);
    assert_eq!(bytes, vertices * f64::from(16 + 3 * 2) + (TRIANGLES + 2.0) * 12.0);
}

#[test]
fn what_is_drawn_in_parts_keeps_its_vertices_in_each() {
    let all = run(false, &["bin.tile=16"]);
    let parts = run(false, &["bin.tile=16", "bin.memory_kib=6"]);
    let [[renders, vertices], [none, once]] = [&parts, &all].map(|of| binning(of, ["partial_renders", "vertices"]));
    assert_eq!((none, once), (0.0, VERTICES));
    // A row of vertices, or two that are open, are kept again in each part.
    let again = vertices - VERTICES;
    let row = f64::from(CELLS + 1);
    assert!(renders > 0.0 && again >= renders * (row - 2.0) && again <= renders * (row + 2.0), "{renders} parts, {again}");
    assert!(parts.frames[0].shown == all.frames[0].shown);
}

#[test]
fn a_small_cache_reads_vertices_again() {
    let read = |lines: &str| {
        let replay = run(false, &["bin.tile=64", &format!("bin.cache_lines={lines}")]);
        let [read] = binning(&replay, ["read_bytes"]);
        (read, replay)
    };
    let ((most, small), (least, large)) = (read("4"), read("4096"));
    assert!(most > 1.5 * least, "{most} and {least} bytes");
    assert!(small.frames[0].shown == large.frames[0].shown);
}

#[test]
fn bins_are_dealt_to_all_pipelines_whatever_the_tiles_of_the_screen() {
    // An even load: triangles of 8 pixels everywhere on 256 x 256.
    let place = |n: u32| [(n % 32 * 8) as f32, (n / 32 * 8) as f32];
    let shapes = (0..1024).map(|n| {
        let [x, y] = place(n);
        [[x, y], [x + 8.0, y], [x, y + 8.0]]
    });
    let work = events(&Scene::plain(256, 256, shapes.collect(), 64));
    for pattern in ["morton", "skewed", "blocks"] {
        for tile in [8, 16, 32, 64] {
            let (tile, pattern) = (format!("distribute.tile={tile}"), format!("distribute.pattern={pattern}"));
            let config = config("sort-middle-binned", &[&tile, &pattern]);
            let imbalance =
                common::run(&config, &work, Clock::SkipIdle).total.number("sort.load_imbalance").expect("a statistic");
            assert!(imbalance < 1.05, "{tile} {pattern}: the busiest pipeline has {imbalance} of the mean");
        }
    }
}
