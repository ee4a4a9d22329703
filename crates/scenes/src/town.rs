//! A town as an engine without culling sends it: every house, tree and lamp is a draw with a matrix of its own, the fences and the wood
//! around are instances, and from the middle of the street two thirds of all of it are behind or beside the camera.

use std::f64::consts::TAU;

use gfx::format::Format;
use gfx::state::*;
use num::{BindGroupId, BufferId};
use trace::command::{BindingKind, BoundResource};
use trace::record::{self, Recorder, RenderPass};

use crate::maths::*;
use crate::pixels::*;
use crate::solids::{Mesh, Solid};

const WIDTH: u32 = 320;
const HEIGHT: u32 = 240;
/// Where streets lie, all along z; houses stand on both sides.
const STREETS: [f64; 5] = [0.0, -21.0, 21.0, -42.0, 42.0];
const HOUSES_A_SIDE: u32 = 11;
const LAMPS_A_SIDE: u32 = 5;
const TREES: u32 = 60;
const POSTS: u32 = 500;
const WOOD: u32 = 560;
/// Bytes from one object to the next: what dynamic offsets are aligned to.
const OBJECT: u32 = 256;

/// Plaster with a window that has four panes and a sill.
fn wall(u: f64, v: f64) -> [f64; 4] {
    let rough = 0.85 + 0.3 * turbulence(3, u, v, 8);
    let plaster = dvec3(0.62, 0.57, 0.48) * rough;
    let (x, y) = ((u - 0.5).abs(), (v - 0.45).abs());
    if x < 0.2 && y < 0.24 {
        let bar = !(0.015..=0.17).contains(&x) || !(0.015..=0.21).contains(&y);
        return opaque(if bar {
            dvec3(0.75, 0.74, 0.70)
        } else {
            mix(dvec3(0.05, 0.07, 0.10), dvec3(0.30, 0.38, 0.46), ramp(0.2, 0.7, v - 0.3 * u))
        });
    }
    let sill = x < 0.24 && (0.69..0.74).contains(&v);
    opaque(if sill { dvec3(0.38, 0.35, 0.32) } else { plaster * if v > 0.93 { 0.55 } else { 1.0 } })
}

/// Courses of roof tiles with round ends.
fn tiles(u: f64, v: f64) -> [f64; 4] {
    let course = (v * 8.0).floor();
    let across = u * 8.0 + 0.5 * (course as i64).rem_euclid(2) as f64;
    let [x, y] = [across.fract() - 0.5, (v * 8.0).fract()];
    let tile = (across.floor() as i64).rem_euclid(8) as u32 + 8 * course as u32;
    let shade = (0.7 + 0.5 * uniform(21, tile, 0)) * (0.45 + 0.55 * ramp(0.0, 0.35, 1.0 - y - 1.2 * x * x));
    opaque(dvec3(0.42, 0.15, 0.09) * shade)
}

/// Leaves, grass, bark, stones: patches of light and dark.
fn patches(u: f64, v: f64) -> [f64; 4] {
    let value = turbulence(33, u, v, 8);
    opaque(DVec3::splat(0.82) * (0.35 + 0.9 * ramp(0.2, 0.8, value)))
}

/// A wall around the origin and gables under the roof.
fn house() -> Mesh {
    let (w, d, h, top) = (2.6, 2.9, 3.0, 4.9);
    let mut mesh = Mesh::default();
    mesh.quad(dvec3(-w, 0.0, d), dvec3(2.0 * w, 0.0, 0.0), dvec3(0.0, h, 0.0), [3.0, 1.0]);
    mesh.quad(dvec3(w, 0.0, -d), dvec3(-2.0 * w, 0.0, 0.0), dvec3(0.0, h, 0.0), [3.0, 1.0]);
    mesh.quad(dvec3(w, 0.0, d), dvec3(0.0, 0.0, -2.0 * d), dvec3(0.0, h, 0.0), [3.0, 1.0]);
    mesh.quad(dvec3(-w, 0.0, -d), dvec3(0.0, 0.0, 2.0 * d), dvec3(0.0, h, 0.0), [3.0, 1.0]);
    mesh.triangle([dvec3(-w, h, d), dvec3(w, h, d), dvec3(0.0, top, d)], [[0.0, 0.1], [0.2, 0.1], [0.1, 0.0]]);
    mesh.triangle([dvec3(w, h, -d), dvec3(-w, h, -d), dvec3(0.0, top, -d)], [[0.0, 0.1], [0.2, 0.1], [0.1, 0.0]]);
    mesh
}

/// Two slopes that reach over the walls, and a chimney.
fn roof() -> Mesh {
    let (w, d, h, top) = (3.0, 3.25, 2.72, 4.95);
    let mut mesh = Mesh::default();
    mesh.quad(dvec3(w, h, d), dvec3(0.0, 0.0, -2.0 * d), dvec3(-w, top - h, 0.0), [2.0, 1.0]);
    mesh.quad(dvec3(-w, h, -d), dvec3(0.0, 0.0, 2.0 * d), dvec3(w, top - h, 0.0), [2.0, 1.0]);
    mesh.quad(dvec3(0.0, top - 0.06, d), dvec3(0.0, 0.0, -2.0 * d), dvec3(-w, h - top, 0.0), [2.0, 1.0]);
    mesh.quad(dvec3(0.0, top - 0.06, -d), dvec3(0.0, 0.0, 2.0 * d), dvec3(w, h - top, 0.0), [2.0, 1.0]);
    let [x, z, y, side, high] = [1.0, -1.4, 3.6, 0.55, 1.9];
    mesh.quad(dvec3(x, y, z + side), dvec3(side, 0.0, 0.0), dvec3(0.0, high, 0.0), [0.3, 1.0]);
    mesh.quad(dvec3(x + side, y, z), dvec3(-side, 0.0, 0.0), dvec3(0.0, high, 0.0), [0.3, 1.0]);
    mesh.quad(dvec3(x + side, y, z + side), dvec3(0.0, 0.0, -side), dvec3(0.0, high, 0.0), [0.3, 1.0]);
    mesh.quad(dvec3(x, y, z), dvec3(0.0, 0.0, side), dvec3(0.0, high, 0.0), [0.3, 1.0]);
    mesh.quad(dvec3(x, y + high, z + side), dvec3(side, 0.0, 0.0), dvec3(0.0, 0.0, -side), [0.3, 0.3]);
    mesh
}

/// A matrix, and the colour that a texture is multiplied with.
type Object = (DMat4, DVec3);

fn turned(at: DVec3, turn: f64, size: f64) -> DMat4 {
    placed(at, turn, DVec3::splat(size))
}

/// Houses on both sides of every street, their fronts to it.
fn houses() -> Vec<Object> {
    let mut out = Vec::new();
    for (street, x) in (0..).zip(STREETS) {
        for i in 0..2 * HOUSES_A_SIDE {
            let (side, r) = (if i % 2 == 0 { 1.0 } else { -1.0 }, |channel| uniform(51, street * 64 + i, channel));
            let along = 9.0 * (f64::from(i / 2) - 5.0) + 1.6 * (r(0) - 0.5);
            let turn = side * TAU * 0.25 + 0.12 * (r(1) - 0.5);
            let tint = mix(dvec3(0.95, 0.90, 0.80), dvec3(0.75, 0.55, 0.45), r(2) * r(2));
            out.push((turned(dvec3(x + side * (6.6 + r(3)), 0.0, along), turn, 0.9 + 0.25 * r(4)), tint));
        }
    }
    out
}

/// Lamps at the kerb.
fn lamps() -> Vec<Object> {
    let place = |street: f64, i: u32| {
        let side = if i.is_multiple_of(2) { 1.0 } else { -1.0 };
        (
            turned(dvec3(street + 2.5 * side, 0.0, 18.0 * (f64::from(i / 2) - 2.0) + 5.0 * side), 0.0, 1.0),
            dvec3(0.20, 0.21, 0.22),
        )
    };
    STREETS.iter().flat_map(|&street| (0..2 * LAMPS_A_SIDE).map(move |i| place(street, i))).collect()
}

/// Trees between the back gardens; trunk and crown share a matrix.
fn trees() -> Vec<DMat4> {
    let tree = |i: u32| {
        let r = |channel| uniform(61, i, channel);
        let row = [-31.5, -10.8, 10.8, 31.5][i as usize % 4] + 1.2 * (r(0) - 0.5);
        turned(dvec3(row, 0.0, 96.0 * (f64::from(i) / f64::from(TREES) - 0.5) + 2.0 * r(1)), TAU * r(2), 0.9 + 0.6 * r(3))
    };
    (0..TREES).map(tree).collect()
}

/// Instances: place and size, sine, cosine and lightness.
fn instances(count: u32, one: impl Fn(u32) -> (DVec3, f64, f64, f64)) -> Vec<u8> {
    let words = |i| {
        let (at, size, turn, light) = one(i);
        floats([at.x, at.y, at.z, size, libm::sin(turn), libm::cos(turn), light, 0.0])
    };
    (0..count).flat_map(words).collect()
}

/// Posts along the gardens of the main street, with gaps for gates.
fn post(i: u32) -> (DVec3, f64, f64, f64) {
    let (side, at) = (if i.is_multiple_of(2) { 1.0 } else { -1.0 }, f64::from(i / 2));
    let r = |channel| uniform(71, i, channel);
    (dvec3(side * 3.3, 0.0, 0.36 * at + 0.9 * (at / 25.0).floor() - 49.0), 0.9 + 0.15 * r(0), 0.3 * r(1), 0.75 + 0.4 * r(2))
}

/// The wood around the town.
fn fir(i: u32) -> (DVec3, f64, f64, f64) {
    let r = |channel| uniform(73, i, channel);
    let (turn, away) = (TAU * f64::from(i) / f64::from(WOOD), 66.0 + 22.0 * r(0));
    (dvec3(away * libm::cos(turn), -0.2, away * libm::sin(turn)), 1.6 + 1.5 * r(1), TAU * r(2), 0.6 + 0.5 * r(3))
}

/// Objects' uniforms, and where the next one goes.
struct Objects {
    bytes: Vec<u8>,
}

impl Objects {
    /// The dynamic offset of a new one.
    fn add(&mut self, (model, tint): Object) -> u32 {
        let at = self.bytes.len();
        self.bytes.extend(matrix(model));
        self.bytes.extend(floats(tint.to_array()));
        self.bytes.resize(at + OBJECT as usize, 0);
        at as u32
    }
}

/// What is drawn with one mesh and texture.
struct Kind<'a> {
    solid: &'a Solid,
    material: BindGroupId,
    offsets: Vec<u32>,
    instances: Option<(BufferId, u32)>,
}

fn draw(pass: &mut RenderPass, kind: &Kind, objects: BindGroupId) {
    pass.set_bind_group(1, kind.material);
    pass.set_vertex_buffer(0, kind.solid.vertices);
    pass.set_index_buffer(kind.solid.indices, IndexFormat::Uint16);
    if let Some((buffer, _)) = kind.instances {
        pass.set_vertex_buffer(1, buffer);
    }
    for &offset in &kind.offsets {
        pass.set_bind_group_at(2, objects, &[offset]);
        pass.draw_indexed(kind.solid.count, kind.instances.map_or(1, |(_, count)| count));
    }
}

pub fn record() -> Recorder {
    let mut card = Recorder::new("town");
    let mut flat = Mesh::default();
    flat.quad(dvec3(-110.0, 0.0, 110.0), dvec3(220.0, 0.0, 0.0), dvec3(0.0, 0.0, -220.0), [60.0, 60.0]);
    let mut road = Mesh::default();
    road.quad(dvec3(-2.2, 0.02, 60.0), dvec3(4.4, 0.0, 0.0), dvec3(0.0, 0.0, -120.0), [3.0, 90.0]);
    let lamp = [(0.11, 0.0), (0.07, 0.3), (0.05, 2.9), (0.06, 3.0), (0.2, 3.3), (0.16, 3.5), (0.0, 3.62)];
    let crown = [(0.2, 1.3), (1.15, 2.0), (1.3, 2.7), (0.85, 3.5), (0.0, 3.9)];
    let fir_profile = [(1.0, 0.25), (0.5, 1.6), (0.0, 3.6)];
    let mut solid = |label: &str, mesh: Mesh| mesh.upload(&mut card, label);
    let (ground, road, house, roof) =
        (solid("ground", flat), solid("road", road), solid("house", house()), solid("roof", roof()));
    let lamp = solid("lamp", Mesh::turned(&lamp, 5));
    let trunk = solid("trunk", Mesh::turned(&[(0.22, 0.0), (0.15, 0.6), (0.12, 1.6)], 6));
    let crown = solid("crown", Mesh::turned(&crown, 7));
    let fir_solid = solid("fir", Mesh::turned(&fir_profile, 4));
    let post_solid = solid("post", Mesh::turned(&[(0.07, 0.0), (0.07, 0.85), (0.0, 1.0)], 4));

    let wall = mipped_texture(&mut card, "wall", &[Image::paint(64, wall)], true).1;
    let tile = mipped_texture(&mut card, "tiles", &[Image::paint(64, tiles)], true).1;
    let patch = mipped_texture(&mut card, "patches", &[Image::paint(64, patches)], true).1;
    let sampler = card.create_sampler(record::trilinear_repeat());
    let posts = card.create_buffer_init("posts", instances(POSTS, post));
    let firs = card.create_buffer_init("firs", instances(WOOD, fir));

    let material_layout = card.create_bind_group_layout([(0, record::TEXTURE), (1, record::SAMPLER)]);
    let mut material =
        |view| card.create_bind_group(material_layout, [(0, BoundResource::View(view)), (1, BoundResource::Sampler(sampler))]);
    let (wall, tile, patch) = (material(wall), material(tile), material(patch));

    let still = DMat4::IDENTITY;
    let mut objects = Objects { bytes: Vec::new() };
    let mut kind = |solid, material, list: Vec<Object>, instances| {
        let offsets = list.into_iter().map(|object| objects.add(object)).collect();
        Kind { solid, material, offsets, instances }
    };
    let both = |tint: DVec3| trees().into_iter().map(|model| (model, tint)).collect::<Vec<Object>>();
    let white = |(model, _): Object| (model, DVec3::ONE);
    let roads = STREETS.map(|x| (DMat4::from_translation(dvec3(x, 0.0, 0.0)), dvec3(0.30, 0.29, 0.30))).to_vec();
    let ones = [
        kind(&house, wall, houses(), None),
        kind(&roof, tile, houses().into_iter().map(white).collect(), None),
        kind(&lamp, patch, lamps(), None),
        kind(&trunk, patch, both(dvec3(0.30, 0.21, 0.14)), None),
        kind(&crown, patch, both(dvec3(0.32, 0.42, 0.12)), None),
        kind(&road, patch, roads, None),
        kind(&ground, patch, vec![(still, dvec3(0.20, 0.29, 0.10))], None),
    ];
    let crowds = [
        kind(&post_solid, patch, vec![(still, dvec3(0.70, 0.62, 0.50))], Some((posts, POSTS))),
        kind(&fir_solid, patch, vec![(still, dvec3(0.17, 0.29, 0.15))], Some((firs, WOOD))),
    ];

    let eye = dvec3(0.9, 1.75, 6.0);
    let camera = perspective(52f64.to_radians(), f64::from(WIDTH) / f64::from(HEIGHT), 0.1, 160.0)
        * look_at_mat4(eye, dvec3(-1.4, 2.3, -8.0), DVec3::Y);
    let sun = dvec3(0.55, 0.62, 0.48).normalize();
    let mut bytes = matrix(camera);
    bytes.extend(floats([eye, sun].into_iter().flat_map(|at| at.extend(0.0).to_array())));
    let scene = card.create_buffer_init("scene", &bytes);
    let object_buffer = card.create_buffer_init("objects", &objects.bytes);
    let scene_layout = card.create_bind_group_layout([(0, record::UNIFORM)]);
    let object_layout = card.create_bind_group_layout([(0, BindingKind::Uniform { dynamic_offset: true })]);
    let scene_group = card.create_bind_group(scene_layout, [(0, record::whole(scene))]);
    let one = BoundResource::Buffer { buffer: object_buffer, offset: 0, size: Some(80) };
    let object_group = card.create_bind_group(object_layout, [(0, one)]);
    let layout = card.create_pipeline_layout([scene_layout, material_layout, object_layout], 0);

    let shader = card.create_shader("town", include_str!("town.wgsl"));
    let mut desc = record::render_pipeline(shader, Format::Rgba8UnormSrgb);
    desc.layout = Some(layout);
    desc.vertex = record::stage_entry(shader, "one");
    desc.buffers = vec![Mesh::layout()];
    desc.primitive.cull_mode = CullMode::Back;
    desc.depth_stencil = Some(record::depth_less(Format::Depth24Plus));
    let single = card.create_render_pipeline("one", desc.clone());
    desc.vertex = record::stage_entry(shader, "many");
    let Some(mut each) = record::instance_buffer(&[(3, VertexFormat::Float32x4), (4, VertexFormat::Float32x4)]) else {
        unreachable!("a layout is given")
    };
    each.stride = 32;
    desc.buffers = vec![Mesh::layout(), Some(each)];
    let many = card.create_render_pipeline("many", desc);

    let target = card.create_texture("target", record::texture_2d(WIDTH, HEIGHT, Format::Rgba8UnormSrgb));
    let depth = card.create_texture("depth", record::texture_2d(WIDTH, HEIGHT, Format::Depth24Plus));
    let (target_view, depth_view) = (card.create_view(target), card.create_view(depth));
    let clear = record::clear(target_view, [0.52, 0.58, 0.64, 1.0]);
    let mut pass = card.begin_render_pass([clear], record::clear_depth(depth_view, false));
    pass.set_pipeline(single);
    pass.set_bind_group(0, scene_group);
    for kind in &ones {
        draw(&mut pass, kind, object_group);
    }
    pass.set_pipeline(many);
    for kind in &crowds {
        draw(&mut pass, kind, object_group);
    }
    drop(pass);
    card.present(target);
    card
}
