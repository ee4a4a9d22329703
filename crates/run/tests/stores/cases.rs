//! Small passes whose pixels are known by hand, on functional rendering and on every machine.

use gfx::format::{Format, TexelKind};
use gfx::state::*;
use num::*;
use trace::command::*;
use trace::record::{self, Recorder};

use super::check::Machines;
use super::sequence::{EVERYWHERE, instance, shader};

/// Width and height of images: an eighth is 1.5 pixels.
const SMALL: [u32; 2] = [12, 8];

/// The texel that every row of a picture has in a column.
type Texel<'t> = &'t dyn Fn(u32) -> Vec<u8>;

/// A draw of everything: its pipeline, its depth in eighths and the number of its colour.
type Layer = (RenderPipelineId, u32, u32);

struct CaseRecorder {
    card: Recorder,
    module: ShaderId,
    size: [u32; 2],
}

impl CaseRecorder {
    fn new(size: [u32; 2]) -> CaseRecorder {
        let mut card = Recorder::new("case");
        let module = card.create_shader("draw", &shader(&[Some(TexelKind::Float)], false));
        CaseRecorder { card, module, size }
    }

    fn texture(&mut self, format: Format, samples: u32) -> TextureId {
        self.card.create_texture("image", record::texture_multisampled(self.size[0], self.size[1], samples, format))
    }

    fn view(&mut self, texture: TextureId, format: Format) -> ViewId {
        self.card.create_view_of(texture, ViewDesc { format: Some(format), ..ViewDesc::default() })
    }

    fn pipeline(&mut self, format: Format, samples: u32, depth_stencil: Option<DepthStencil>) -> RenderPipelineId {
        let desc = RenderPipelineDesc {
            depth_stencil,
            multisample: Multisample { count: samples, ..Multisample::default() },
            ..record::render_pipeline(self.module, format)
        };
        self.card.create_render_pipeline("draw", desc)
    }

    /// A pass with one draw in eighths of the image.
    fn draw(&mut self, color: ColorAttachment, pipeline: RenderPipelineId, [low, high]: [[u32; 2]; 2], of: u32) {
        let mut pass = self.card.begin_render_pass([color], None);
        pass.set_pipeline(pipeline);
        pass.draw_from(6, 1, 0, instance(low, high, 0, of));
    }

    /// A pass that loads a view and draws nothing.
    fn load(&mut self, view: ViewId) {
        drop(self.card.begin_render_pass([record::load(view)], None));
    }

    /// Asserts what the presented frames show.
    fn shows(self, what: &str, frames: &[Texel<'_>]) {
        let [width, height] = self.size;
        let trace = self.card.finish();
        let picture = |texel: &Texel<'_>| (0..height).flat_map(|_| (0..width).flat_map(texel)).collect();
        let expected: Vec<Vec<u8>> = frames.iter().map(picture).collect();
        Machines::new().show(&trace, &expected).unwrap_or_else(|error| panic!("{what}: {error}"));
    }
}

const BLACK: [f64; 4] = [0.0, 0.0, 0.0, 1.0];
/// Its alpha is that of [`red`].
const WHITE: [f64; 4] = [1.0, 1.0, 1.0, 0.0625];

/// The number of a colour whose red is a number of sixteenths; its alpha is one sixteenth.
fn red(sixteenths: u32) -> u32 {
    sixteenths
}

#[test]
fn a_copied_image_is_loaded_from_a_texture_that_no_pass_had() {
    for samples in [1, 4] {
        let mut stage = CaseRecorder::new(SMALL);
        let [from, to] = [(); 2].map(|()| stage.texture(Format::Rgba8Unorm, samples));
        let [from_view, to_view] = [from, to].map(|texture| stage.view(texture, Format::Rgba8Unorm));
        let pipeline = stage.pipeline(Format::Rgba8Unorm, samples, None);
        // Columns 0 to 5.
        stage.draw(record::clear(from_view, BLACK), pipeline, [[0, 0], [4, 8]], red(8));
        let end = |texture| TextureEnd { texture, level: 0, origin: [0; 3], aspect: Aspect::All };
        stage.card.copy_texture_to_texture(end(from), end(to), [SMALL[0], SMALL[1], 1]);
        if samples == 1 {
            stage.load(to_view);
            stage.card.present(to);
        } else {
            let shown = stage.texture(Format::Rgba8Unorm, 1);
            let view = stage.view(shown, Format::Rgba8Unorm);
            drop(stage.card.begin_render_pass([ColorAttachment { resolve: Some(view), ..record::load(to_view) }], None));
            stage.card.present(shown);
        }
        // 8/16 and 1/16 as bytes.
        stage.shows("a copy", &[&|x| if x < 6 { vec![128, 0, 0, 16] } else { vec![0, 0, 0, 255] }]);
    }
}

#[test]
fn views_with_and_without_srgb_share_one_image() {
    let (plain, srgb) = (Format::Rgba8Unorm, Format::Rgba8UnormSrgb);
    let mut stage = CaseRecorder::new(SMALL);
    let texture = stage.texture(plain, 1);
    let [plain_view, srgb_view] = [plain, srgb].map(|format| stage.view(texture, format));
    let [plain_draw, srgb_draw] = [plain, srgb].map(|format| stage.pipeline(format, 1, None));
    stage.draw(record::clear(srgb_view, BLACK), srgb_draw, [[0, 0], [4, 8]], red(8));
    stage.load(plain_view);
    stage.card.present(texture);
    // Through the plain view columns 3 to 5 are drawn again; through the other one all is loaded.
    stage.draw(record::load(plain_view), plain_draw, [[2, 0], [4, 8]], red(8));
    stage.load(srgb_view);
    stage.card.present(texture);
    // 0.5 is 188 with sRGB's function, 128 without.
    let first = |x| if x < 6 { vec![188, 0, 0, 16] } else { vec![0, 0, 0, 255] };
    let second = |x| if (3..6).contains(&x) { vec![128, 0, 0, 16] } else { first(x) };
    stage.shows("views", &[&first, &second]);
}

#[test]
fn samples_are_resolved_as_values_of_the_view() {
    for (of, expected) in [(Format::Rgba8Unorm, 128), (Format::Rgba8UnormSrgb, 188)] {
        let mut stage = CaseRecorder::new(SMALL);
        let [many, shown] = [4, 1].map(|samples| stage.texture(Format::Rgba8Unorm, samples));
        let [many_view, shown_view] = [many, shown].map(|texture| stage.view(texture, of));
        let pipeline = stage.pipeline(of, 4, None);
        // The left edge of what is drawn black is in the middle of column 4: two of its four samples stay white.
        let color = ColorAttachment { resolve: Some(shown_view), ..record::clear(many_view, WHITE) };
        stage.draw(color, pipeline, [[3, 0], [8, 8]], red(0));
        stage.card.present(shown);
        // Their mean is 0.5, which sRGB's function makes 188.
        let texel = |x| match x {
            0..4 => vec![255, 255, 255, 16],
            4 => vec![expected, expected, expected, 16],
            _ => vec![0, 0, 0, 16],
        };
        stage.shows(of.name(), &[&texel]);
    }
}

/// The stencil test that passes where a value equals the reference, or the depth test that passes where the draw is not behind.
fn test(format: Format, stencil: bool) -> DepthStencil {
    let compare = if stencil { Compare::Equal } else { Compare::Always };
    let face = StencilFace { compare, ..StencilFace::default() };
    DepthStencil {
        depth_write: false,
        depth_compare: if stencil { Compare::Always } else { Compare::LessEqual },
        stencil_front: face,
        stencil_back: face,
        ..record::depth_less(format)
    }
}

/// What of a depth attachment's aspects is there after a pass that clears it to depth 0.5 and stencil value 0x17f, as tests of a second pass see it.
fn tested(format: Format, stores: [bool; 2], in_one_pass: bool, asks: &[(bool, u32, bool)]) {
    for samples in [1, 4] {
        let mut stage = CaseRecorder::new(SMALL);
        let [color, depth] = [Format::Rgba8Unorm, format].map(|format| stage.texture(format, samples));
        let [color_view, depth_view] = [color, depth].map(|texture| stage.card.create_view(texture));
        let shown = stage.texture(Format::Rgba8Unorm, 1);
        let shown_view = stage.view(shown, Format::Rgba8Unorm);
        let cleared = DepthAttachment {
            depth_clear: format.has_depth().then_some(0.5),
            depth_store: stores[0],
            stencil_clear: format.has_stencil().then_some(0x17f),
            stencil_store: stores[1],
            ..record::load_depth(depth_view)
        };
        if !in_one_pass {
            drop(stage.card.begin_render_pass([], Some(cleared.clone())));
        }
        for &(stencil, value, _) in asks {
            let pipeline = stage.pipeline(Format::Rgba8Unorm, samples, Some(test(format, stencil)));
            let attachment = if in_one_pass { cleared.clone() } else { record::load_depth(depth_view) };
            let target = if samples > 1 { color_view } else { shown_view };
            let color = ColorAttachment { resolve: (samples > 1).then_some(shown_view), ..record::clear(target, BLACK) };
            let mut pass = stage.card.begin_render_pass([color], Some(attachment));
            pass.set_pipeline(pipeline);
            pass.set_stencil_reference(value);
            // Depth in eighths.
            pass.draw_from(6, 1, 0, instance(EVERYWHERE.0, EVERYWHERE.1, if stencil { 0 } else { value }, red(8)));
            drop(pass);
            stage.card.present(shown);
        }
        let [drawn, empty]: [Texel<'_>; 2] = [&|_| vec![128, 0, 0, 16], &|_| vec![0, 0, 0, 255]];
        let frames: Vec<Texel<'_>> = asks.iter().map(|&(_, _, passes)| if passes { drawn } else { empty }).collect();
        stage.shows(&format!("{} of {samples} samples, stored {stores:?}, {in_one_pass}", format.name()), &frames);
    }
}

const STENCIL: bool = true;
const DEPTH: bool = false;

#[test]
fn a_stencil_value_is_cleared_to_its_low_bits_in_every_format() {
    for format in [Format::Stencil8, Format::Depth24PlusStencil8, Format::Depth32FloatStencil8] {
        for in_one_pass in [true, false] {
            tested(format, [true; 2], in_one_pass, &[(STENCIL, 0x7f, true), (STENCIL, 0, false), (STENCIL, 0xff, false)]);
        }
    }
}

#[test]
fn an_aspect_that_is_not_stored_is_zero_and_the_other_is_as_it_was() {
    for format in [Format::Depth24PlusStencil8, Format::Depth32FloatStencil8] {
        let kept = [(STENCIL, 0x7f, true), (STENCIL, 0, false), (DEPTH, 3, true), (DEPTH, 5, false)];
        let lost = [(STENCIL, 0x7f, false), (STENCIL, 0, true), (DEPTH, 1, false), (DEPTH, 0, true)];
        tested(format, [true, true], false, &kept);
        tested(format, [true, false], false, &[&lost[..2], &kept[2..]].concat());
        tested(format, [false, true], false, &[&kept[..2], &lost[2..]].concat());
        tested(format, [false, false], false, &lost);
    }
    // What is said of an aspect that a format does not have changes nothing.
    for format in [Format::Depth16Unorm, Format::Depth24Plus, Format::Depth32Float] {
        tested(format, [false, true], false, &[(DEPTH, 1, false), (DEPTH, 0, true)]);
        tested(format, [true, false], false, &[(DEPTH, 3, true), (DEPTH, 5, false)]);
    }
    tested(Format::Stencil8, [true, false], false, &[(STENCIL, 0x7f, false), (STENCIL, 0, true)]);
    tested(Format::Stencil8, [false, true], false, &[(STENCIL, 0x7f, true), (STENCIL, 0, false)]);
}

#[test]
fn depths_that_a_cache_has_kept_of_one_image_say_nothing_of_another() {
    // Larger than what a cache of hierarchical Z holds: stale lines of it would hide the fault.
    let mut stage = CaseRecorder::new([96, 96]);
    let format = Format::Depth32Float;
    let shown = stage.texture(Format::Rgba8Unorm, 1);
    let shown_view = stage.card.create_view(shown);
    let [near, far] = [(); 2].map(|()| {
        let texture = stage.texture(format, 1);
        stage.card.create_view(texture)
    });
    let states = [DepthStencil { depth_compare: Compare::Always, ..record::depth_less(format) }, test(format, DEPTH)];
    let [writes, tests] = states.map(|state| stage.pipeline(Format::Rgba8Unorm, 1, Some(state)));
    // The first pass leaves depth 7/8 in one image. The second leaves depth 0 of another in the caches. The third brings in the first image's
    // blocks again: its second draw, at 4/8, is in front of them.
    let passes: [(ViewId, Option<f32>, &[Layer]); 3] = [
        (far, Some(1.0), &[(writes, 7, 1)]),
        (near, Some(1.0), &[(writes, 0, 3)]),
        (far, None, &[(tests, 1, 5), (tests, 4, 8)]),
    ];
    for (depth, depth_clear, draws) in passes {
        let depth = DepthAttachment { depth_clear, ..record::load_depth(depth) };
        let mut pass = stage.card.begin_render_pass([record::clear(shown_view, BLACK)], Some(depth));
        for &(pipeline, depth, color) in draws {
            pass.set_pipeline(pipeline);
            pass.draw_from(6, 1, 0, instance(EVERYWHERE.0, EVERYWHERE.1, depth, red(color)));
        }
    }
    stage.card.present(shown);
    stage.shows("another image", &[&|_| vec![128, 0, 0, 16]]);
}

#[test]
fn logic_operations_combine_stored_bits() {
    // Results for new and stored bits 00, 01, 10, 11, from the lowest bit on: the table of the Vulkan specification.
    let tables = [0x0, 0x8, 0x4, 0xc, 0x2, 0xa, 0x6, 0xe, 0x1, 0x9, 0x5, 0xd, 0x3, 0xb, 0x7, 0xf];
    let (new, stored): ([u8; 4], [u8; 4]) = ([159, 96, 191, 16], [51, 0, 255, 204]);
    for samples in [1, 4] {
        let mut stage = CaseRecorder::new(SMALL);
        let [many, shown] = [samples, 1].map(|samples| stage.texture(Format::Rgba8Unorm, samples));
        let [many_view, shown_view] = [many, shown].map(|texture| stage.view(texture, Format::Rgba8Unorm));
        for (at, &op) in LogicOp::ALL.iter().enumerate() {
            let desc = RenderPipelineDesc {
                multisample: Multisample { count: samples, ..Multisample::default() },
                targets: vec![Some(ColorTarget {
                    logic: Some(op),
                    write_mask: if at % 2 == 0 { 15 } else { 13 },
                    ..record::target(Format::Rgba8Unorm)
                })],
                ..record::render_pipeline(stage.module, Format::Rgba8Unorm)
            };
            let pipeline = stage.card.create_render_pipeline("draw", desc);
            let (view, resolve) = if samples > 1 { (many_view, Some(shown_view)) } else { (shown_view, None) };
            let clear = stored.map(|code| f64::from(code) / 255.0);
            // Columns 0 to 5; 10, 6 and 12 sixteenths.
            let color = ColorAttachment { resolve, ..record::clear(view, clear) };
            stage.draw(color, pipeline, [[0, 0], [4, 8]], 10 | 6 << 4 | 12 << 8);
            stage.card.present(shown);
        }
        let drawn: Vec<Vec<u8>> = (0..16)
            .map(|at| {
                let channel = |c: usize| {
                    let bit = |b: u32| tables[at] >> ((new[c] >> b & 1) << 1 | stored[c] >> b & 1) & 1;
                    (0..8).fold(0, |all, b| all | (bit(b) as u8) << b)
                };
                (0..4).map(|c| if at % 2 == 1 && c == 1 { stored[c] } else { channel(c) }).collect()
            })
            .collect();
        let texels: Vec<_> =
            drawn.iter().map(|drawn| move |x: u32| if x < 6 { drawn.clone() } else { stored.to_vec() }).collect();
        let frames: Vec<Texel<'_>> = texels.iter().map(|texel| texel as Texel<'_>).collect();
        stage.shows(&format!("logic operations on {samples} samples"), &frames);
    }
}

#[test]
fn faces_have_stencil_masks_and_references_of_their_own() {
    for format in [Format::Stencil8, Format::Depth24PlusStencil8, Format::Depth32FloatStencil8] {
        let mut stage = CaseRecorder::new(SMALL);
        let [color, depth] = [Format::Rgba8Unorm, format].map(|format| stage.texture(format, 1));
        let [color_view, depth_view] = [color, depth].map(|texture| stage.card.create_view(texture));
        let mut pipeline = |front_face, face, masks| {
            let desc = RenderPipelineDesc {
                primitive: Primitive { front_face, ..Primitive::default() },
                depth_stencil: Some(DepthStencil {
                    depth_write: false,
                    depth_compare: Compare::Always,
                    stencil_front: face,
                    stencil_back: face,
                    stencil_read_mask: 0x0f,
                    stencil_write_mask: 0xf0,
                    stencil_back_masks: masks,
                    ..record::depth_less(format)
                }),
                ..record::render_pipeline(stage.module, Format::Rgba8Unorm)
            };
            stage.card.create_render_pipeline("draw", desc)
        };
        let replace = StencilFace { pass_op: StencilOp::Replace, ..StencilFace::default() };
        let equal = StencilFace { compare: Compare::Equal, ..StencilFace::default() };
        let masks = Some(StencilMasks { read: 0xf0, write: 0x3c });
        // What is drawn goes clockwise.
        let [front, back] = [FrontFace::Cw, FrontFace::Ccw].map(|face| pipeline(face, replace, masks));
        let [front_test, back_test] = [FrontFace::Cw, FrontFace::Ccw].map(|face| pipeline(face, equal, masks));
        let attachment = DepthAttachment {
            depth_clear: format.has_depth().then_some(1.0),
            stencil_clear: Some(0xff),
            ..record::load_depth(depth_view)
        };
        let mut pass = stage.card.begin_render_pass([record::clear(color_view, BLACK)], Some(attachment));
        let (left, right) = ([[0, 0], [4, 8]], [[4, 0], [8, 8]]);
        pass.set_stencil_references([0x5a, 0xa5]);
        // On the left 0x5a through 0xf0: 0x5f. On the right 0xa5 through 0x3c: 0xe7.
        for (pipeline, [low, high]) in [(front, left), (back, right)] {
            pass.set_pipeline(pipeline);
            pass.draw_from(6, 1, 0, instance(low, high, 0, red(0)));
        }
        // Front faces compare the lower digits, back faces the upper ones.
        let asks =
            [(front_test, [0x0f, 0], left, 4), (front_test, [0x07, 0xf0], left, 1), (back_test, [0x07, 0xe0], right, 12)];
        for (pipeline, references, [low, high], sixteenths) in asks {
            pass.set_pipeline(pipeline);
            pass.set_stencil_references(references);
            pass.draw_from(6, 1, 0, instance(low, high, 0, red(sixteenths)));
        }
        drop(pass);
        stage.card.present(color);
        stage.shows(format.name(), &[&|x| vec![if x < 6 { 64 } else { 191 }, 0, 0, 16]]);
    }
}

#[test]
fn depths_are_offset_by_fractions_of_a_step() {
    let format = Format::Depth16Unorm;
    let mut stage = CaseRecorder::new(SMALL);
    let [color, depth] = [Format::Rgba8Unorm, format].map(|format| stage.texture(format, 1));
    let [color_view, depth_view] = [color, depth].map(|texture| stage.card.create_view(texture));
    // A depth of a quarter is 16383.75 steps: 1.5 steps more are 16385.25, stored as 16385.
    let mut pipeline = |bias, depth_compare| {
        let state = DepthStencil { bias, depth_compare, ..record::depth_less(format) };
        stage.pipeline(Format::Rgba8Unorm, 1, Some(state))
    };
    let draws = [
        (pipeline(1.5, Compare::Always), [0, 8], 0),
        (pipeline(1.25, Compare::Equal), [0, 4], 8),
        (pipeline(2.0, Compare::Equal), [4, 8], 8),
    ];
    let attachment = record::clear_depth(depth_view, true);
    let mut pass = stage.card.begin_render_pass([record::clear(color_view, BLACK)], attachment);
    for (pipeline, [left, right], sixteenths) in draws {
        pass.set_pipeline(pipeline);
        pass.draw_from(6, 1, 0, instance([left, 0], [right, 8], 2, red(sixteenths)));
    }
    drop(pass);
    stage.card.present(color);
    // 16385.0 is the same step, and 16385.75 the next.
    stage.shows("offset depths", &[&|x| vec![if x < 6 { 128 } else { 0 }, 0, 0, 16]]);
}

#[test]
fn lines_are_as_wide_as_a_pipeline_says() {
    for samples in [1, 4] {
        for (width, columns) in [(2.0, 5..7), (0.25, 0..0), (6.5, 3..9)] {
            let mut stage = CaseRecorder::new(SMALL);
            let [many, shown] = [samples, 1].map(|samples| stage.texture(Format::Rgba8Unorm, samples));
            let [many_view, shown_view] = [many, shown].map(|texture| stage.view(texture, Format::Rgba8Unorm));
            let desc = RenderPipelineDesc {
                primitive: Primitive { topology: Topology::LineList, line_width: Some(width), ..Primitive::default() },
                multisample: Multisample { count: samples, ..Multisample::default() },
                ..record::render_pipeline(stage.module, Format::Rgba8Unorm)
            };
            let pipeline = stage.card.create_render_pipeline("lines", desc);
            let (view, resolve) = if samples > 1 { (many_view, Some(shown_view)) } else { (shown_view, None) };
            let color = ColorAttachment { resolve, ..record::clear(view, BLACK) };
            let mut pass = stage.card.begin_render_pass([color], None);
            pass.set_pipeline(pipeline);
            // The right edge of the left half, from above to below: between columns 5 and 6.
            pass.draw_from(2, 1, 1, instance([0, 0], [4, 8], 0, red(8)));
            drop(pass);
            stage.card.present(shown);
            let texel = |x| if columns.contains(&x) { vec![128, 0, 0, 16] } else { vec![0, 0, 0, 255] };
            // A line of 6.5 pixels covers one sample of the columns beside it. One of a quarter has a sample on each border, of which the left
            // hand's is inside.
            let quarter = |x| match x {
                2 | 9 if samples == 4 && width == 6.5 => vec![32, 0, 0, 195],
                6 if samples == 4 && width == 0.25 => vec![32, 0, 0, 195],
                _ => texel(x),
            };
            stage.shows(&format!("lines of {width} pixels, {samples} samples"), &[&quarter]);
        }
    }
}
