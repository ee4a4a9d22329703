//! Transparency without sorted draws: lists of fragments, the nearest four of them, and weighted sums.

use anyhow::Result;

use super::kit::{COLORED, Draw, Kit, Pass};
use super::shapes::{Corner, center, clip, covers};
use super::{Image, Scene, SceneRun};
use crate::Row;
use crate::harness::funnel;
use gfx::format::Format;
use gfx::state::{Aspect, Blend, BlendComponent, BlendFactor, BlendOp};
use num::Random;
use trace::Trace;
use trace::command::{LinearLayout, TextureEnd};

pub(super) const ABUFFER: Scene = Scene {
    name: "abuffer",
    group: "Transparency",
    what: "Twelve transparent triangles leave a list of fragments for each pixel, linked by atomics; a second pass sorts and composites them. Three orders of \
           draws give one picture, which is the sorted composite of f64; nodes are the pixels that exact arithmetic finds covered.",
    fault: "the second pass does not sort",
    play: |stage| lists(stage, 64),
};

pub(super) const KBUFFER: Scene = Scene {
    name: "kbuffer",
    group: "Transparency",
    what: "As abuffer, with the nearest four fragments of each pixel alone; the error against all of them is that of f64.",
    fault: "the second pass does not sort",
    play: |stage| lists(stage, 4),
};

pub(super) const WEIGHTED: Scene = Scene {
    name: "weighted",
    group: "Transparency",
    what: "The same triangles as weighted sums: colours times alpha and (1 - z)^3, and the product of 1 - alpha. The picture is that of f64 in any order of \
           draws; its error against sorting is stated.",
    fault: "weights are (1 - z)^2",
    play: weighted,
};

const SIZE: [u32; 2] = [64, 64];
const LAYERS: usize = 12;

/// Triangles, each with its depth and colour; depths all differ.
struct Layer {
    corners: [Corner; 3],
    z: f32,
    color: [f32; 4],
}

fn layers() -> Vec<Layer> {
    let mut random = Random::new(7);
    (0..LAYERS)
        .map(|k| Layer {
            corners: std::array::from_fn(|_| [random.below(64 * 256).into(), random.below(64 * 256).into()]),
            z: (1 + (5 * k) % LAYERS) as f32 / 16.0,
            color: std::array::from_fn(|c| if c == 3 { 0.25 + 0.5 * random.unit() } else { random.unit() }),
        })
        .collect()
}

/// The layers that cover a pixel, from front to back.
fn covering(layers: &[Layer], x: u32, y: u32) -> Vec<&Layer> {
    let mut found: Vec<&Layer> = layers.iter().filter(|layer| covers(layer.corners, center(x, y))).collect();
    found.sort_by(|a, b| a.z.total_cmp(&b.z));
    found
}

/// The composite of layers from front to back over white.
fn composite<'l>(layers: impl DoubleEndedIterator<Item = &'l &'l Layer>) -> [f64; 3] {
    layers.rev().fold([1.0; 3], |behind, layer| {
        let alpha = f64::from(layer.color[3]);
        std::array::from_fn(|c| alpha * f64::from(layer.color[c]) + (1.0 - alpha) * behind[c])
    })
}

fn vertices(layers: &[Layer], order: &[usize]) -> Vec<f32> {
    let vertex = |layer: &Layer, k: usize| [clip(layer.corners[k], SIZE, layer.z), layer.color].concat();
    order.iter().flat_map(|&which| (0..3).flat_map(move |k| vertex(&layers[which], k))).collect()
}

fn orders() -> [Vec<usize>; 3] {
    let mut shuffled: Vec<usize> = (0..LAYERS).collect();
    Random::new(3).shuffle(&mut shuffled);
    [(0..LAYERS).collect(), (0..LAYERS).rev().collect(), shuffled]
}

const BUILD: &str = "
struct Node { next: u32, z: f32, color: vec4f }
@group(0) @binding(0) var<storage, read_write> heads: array<atomic<u32>>;
@group(0) @binding(1) var<storage, read_write> nodes: array<Node>;
struct Vertex { @builtin(position) at: vec4f, @location(0) @interpolate(flat) color: vec4f }
@vertex fn vs(@location(0) at: vec4f, @location(1) color: vec4f) -> Vertex { return Vertex(at, color); }
@fragment fn fs(v: Vertex) -> @location(0) vec4f {
    // Head 0 is the counter; 0 ends a list.
    let node = atomicAdd(&heads[0], 1u) + 1u;
    let pixel = 1u + u32(v.at.y) * 64u + u32(v.at.x);
    nodes[node] = Node(atomicExchange(&heads[pixel], node), v.at.z, v.color);
    return vec4f(0.0);
}";

fn resolve(most: usize, sort: bool) -> String {
    let compare = if sort { "z[j - 1u] > z[j]" } else { "false" };
    format!(
        "
struct Node {{ next: u32, z: f32, color: vec4f }}
@group(0) @binding(0) var<storage, read> heads: array<u32>;
@group(0) @binding(1) var<storage, read> nodes: array<Node>;
@fragment fn fs(@builtin(position) at: vec4f) -> @location(0) vec4f {{
    var z: array<f32, 16>;
    var color: array<vec4f, 16>;
    var count = 0u;
    var node = heads[1u + u32(at.y) * 64u + u32(at.x)];
    while node != 0u && count < 16u {{
        z[count] = nodes[node].z;
        color[count] = nodes[node].color;
        for (var j = count; j > 0u && {compare}; j--) {{
            let (_z, _c) = (0, 0);
        }}
        count++;
        node = nodes[node].next;
    }}
    var sum = vec3f(0.0);
    var through = 1.0;
    for (var i = 0u; i < min(count, {most}u); i++) {{
        sum += through * color[i].a * color[i].rgb;
        through *= 1.0 - color[i].a;
    }}
    return vec4f(sum + vec3f(through), 1.0);
}}"
    )
    .replace("            let (_z, _c) = (0, 0);\n", SWAP)
}

const SWAP: &str = "
            let y = z[j]; z[j] = z[j - 1u]; z[j - 1u] = y;
            let c = color[j]; color[j] = color[j - 1u]; color[j - 1u] = c;
";

fn listed(layers: &[Layer], most: usize, sort: bool) -> Trace {
    let mut kit = Kit::new("abuffer");
    let target = kit.target("target", SIZE, Format::Rgba8Unorm);
    let scratch = kit.target("scratch", SIZE, Format::Rgba8Unorm);
    let count = kit.target("count", [1, 1], Format::R32Uint);
    let pixels = u64::from(SIZE[0] * SIZE[1]);
    for order in orders() {
        let (heads, bound) = kit.words("heads", 1 + pixels);
        let (_, nodes) = kit.words("nodes", 8 * (1 + pixels * LAYERS as u64));
        let build = Draw::list(BUILD, 2, vertices(layers, &order)).with([bound.clone(), nodes.clone()]);
        kit.pass(&Pass { color: vec![(scratch, Some([0.0; 4]))], ..Pass::default() }, &[Draw { mask: 0, ..build }]);
        let show = Draw::cover(&resolve(most, sort)).with([bound, nodes]);
        kit.pass(&Pass { color: vec![(target, Some([0.0; 4]))], ..Pass::default() }, &[show]);
        kit.present(target);
        let layout = LinearLayout { offset: 0, bytes_per_row: None, rows_per_image: None };
        let end = TextureEnd { texture: count.texture, level: 0, origin: [0; 3], aspect: Aspect::All };
        kit.card.copy_buffer_to_texture(heads, layout, end, [1, 1, 1]);
        kit.present(count);
    }
    kit.finish()
}

/// The largest and the mean difference of two functions over a picture, in codes.
fn errors(a: impl Fn(u32, u32) -> [f64; 3], b: impl Fn(u32, u32) -> [f64; 3]) -> [f64; 2] {
    let (mut worst, mut sum) = (0.0_f64, 0.0);
    for (x, y) in (0..SIZE[1]).flat_map(|y| (0..SIZE[0]).map(move |x| (x, y))) {
        let (a, b) = (a(x, y), b(x, y));
        for c in 0..3 {
            worst = worst.max(255.0 * (a[c] - b[c]).abs());
            sum += 255.0 * (a[c] - b[c]).abs() / f64::from(3 * SIZE[0] * SIZE[1]);
        }
    }
    [worst, sum]
}

fn all(layers: &[Layer], x: u32, y: u32) -> [f64; 3] {
    composite(covering(layers, x, y).iter())
}

fn lists(stage: &mut SceneRun, most: usize) -> Result<()> {
    let layers = layers();
    let trace = listed(&layers, most, !stage.fault());
    let frames = stage.show(&trace)?;
    let pictures: Vec<&Image> = frames.iter().step_by(2).collect();
    let covered: usize = pictures[0].places().map(|(x, y)| covering(&layers, x, y).len()).sum();
    for (order, counted) in frames.iter().skip(1).step_by(2).enumerate() {
        stage.row(Row::exact(format!("nodes, order {order}"), covered as f64, f64::from(counted.word(0, 0, 0))));
    }
    let differing = pictures.iter().map(|picture| picture.differing(pictures[0])).sum();
    stage.row(Row::none("pixels in which the orders of draws differ", differing));
    let nearest = |x, y| {
        let found = covering(&layers, x, y);
        composite(found[..found.len().min(most)].iter())
    };
    stage.row(Row::at_most("largest difference from f64, in codes", pictures[0].worst(nearest), 1.0));
    if most < LAYERS {
        let [worst, mean] = errors(nearest, |x, y| all(&layers, x, y));
        let measured = pictures[0].worst(|x, y| all(&layers, x, y));
        stage.row(Row::within("largest error of the nearest four, in codes", worst, measured, 1.0));
        stage.answer("What is lost?", format!("The nearest four are {worst:.1} codes off at worst and {mean:.2} on average."));
    } else if !stage.fault() {
        let (cycles, total) = stage.time(&trace, &[])?;
        let (cycles, shaded) = (cycles / 3.0, funnel(&total)?.fragments_shaded as f64);
        let pixels = f64::from(SIZE[0] * SIZE[1]);
        stage.row(Row::exact("fragments shaded, less those of the second passes", 3.0 * covered as f64, shaded - 3.0 * pixels));
        let mut sorted: Vec<usize> = (0..LAYERS).collect();
        sorted.sort_by(|&a, &b| layers[b].z.total_cmp(&layers[a].z));
        let mut kit = Kit::new("sorted");
        let target = kit.target("target", SIZE, Format::Rgba8Unorm);
        let draw = Draw::list(COLORED, 2, vertices(&layers, &sorted)).blend(super::kit::OVER);
        kit.pass(&Pass { color: vec![(target, Some([1.0; 4]))], ..Pass::default() }, &[draw]);
        kit.present(target);
        let blended = stage.time(&kit.finish(), &[])?.0;
        stage.row(Row::at_least("cycles of lists over those of sorted draws", 1.0, cycles / blended));
        stage.answer(
            "A-buffer or sorting?",
            format!("A frame of lists takes {cycles:.0} cycles, sorted draws with blending {blended}."),
        );
    }
    Ok(())
}

fn weighted(stage: &mut SceneRun) -> Result<()> {
    let layers = layers();
    let power = if stage.fault() { "w * w" } else { "w * w * w" };
    let mut kit = Kit::new("weighted");
    let target = kit.target("target", SIZE, Format::Rgba8Unorm);
    let sums = kit.target("sums", SIZE, Format::Rgba16Float);
    let through = kit.target("through", SIZE, Format::R16Float);
    let source = format!(
        "struct Vertex {{ @builtin(position) at: vec4f, @location(0) @interpolate(flat) color: vec4f }}
         struct Out {{ @location(0) sum: vec4f }}
         @vertex fn vs(@location(0) at: vec4f, @location(1) color: vec4f) -> Vertex {{ return Vertex(at, color); }}
         @fragment fn fs(v: Vertex) -> @location(0) vec4f {{
             let w = 1.0 - v.at.z;
             return vec4f(v.color.rgb, 1.0) * (v.color.a * {power});
         }}
         @fragment fn through(v: Vertex) -> @location(0) vec4f {{ return vec4f(v.color.a); }}"
    );
    let product = BlendComponent { src: BlendFactor::Zero, dst: BlendFactor::OneMinusSrc, op: BlendOp::Add };
    let show = "
        @group(0) @binding(0) var sums: texture_2d<f32>;
        @group(0) @binding(1) var through: texture_2d<f32>;
        @fragment fn fs(@builtin(position) at: vec4f) -> @location(0) vec4f {
            let sum = textureLoad(sums, vec2u(at.xy), 0);
            let t = textureLoad(through, vec2u(at.xy), 0).r;
            return vec4f((1.0 - t) * sum.rgb / max(sum.a, 1e-5) + t, 1.0);
        }";
    for order in orders() {
        let draw = Draw::list(source.clone(), 2, vertices(&layers, &order));
        let add = draw.clone().blend(super::kit::ADD);
        kit.pass(&Pass { color: vec![(sums, Some([0.0; 4]))], ..Pass::default() }, &[add]);
        let product = Draw { entries: ["vs", "through"], ..draw.blend(Blend { color: product, alpha: product }) };
        kit.pass(&Pass { color: vec![(through, Some([1.0; 4]))], ..Pass::default() }, &[product]);
        let show = Draw::cover(show).with([sums.bound(), through.bound()]);
        kit.pass(&Pass { color: vec![(target, Some([0.0; 4]))], ..Pass::default() }, &[show]);
        kit.present(target);
    }
    let frames = stage.show(&kit.finish())?;
    let exact = |x, y| {
        let (mut sum, mut weights, mut through) = ([0.0; 3], 0.0, 1.0);
        for layer in covering(&layers, x, y) {
            let alpha = f64::from(layer.color[3]);
            let w = alpha * (1.0 - f64::from(layer.z)).powi(3);
            (0..3).for_each(|c| sum[c] += w * f64::from(layer.color[c]));
            weights += w;
            through *= 1.0 - alpha;
        }
        std::array::from_fn(|c| (1.0 - through) * sum[c] / f64::max(weights, 1e-5) + through)
    };
    for (order, frame) in frames.iter().enumerate() {
        stage.row(Row::at_most(
            format!("largest difference from f64 with halves as sums, in codes, order {order}"),
            frame.worst(exact),
            2.0,
        ));
    }
    let [worst, mean] = errors(exact, |x, y| all(&layers, x, y));
    stage.row(Row::within("largest error against sorting, in codes", worst, frames[0].worst(|x, y| all(&layers, x, y)), 2.0));
    stage.answer("What is lost?", format!("Weighted sums are {worst:.1} codes off at worst and {mean:.2} on average."));
    Ok(())
}
