use super::*;
use crate::format::{Format, TexelKind};
use crate::image::ImageDesc;
use crate::state::*;
use crate::texel::decode;
use num::{LANES, Random, Words};
use proptest::prelude::*;

mod ways;

/// A texture of pseudo-random bytes.
fn noise(image: &ImageDesc, seed: u32) -> Words {
    let words = Words::new(image.bytes());
    let mut random = Random::new(seed.into());
    for i in 0..words.words().len() {
        let bits = random.bits();
        // Floating-point texels stay in [0.5, 1).
        let float = matches!(image.format, Format::Depth32Float | Format::R32Float | Format::Rgba32Float);
        words.store(i, if float { 0x3f00_0000 | bits >> 9 } else { bits });
    }
    words
}

pub(super) fn image(size: [u32; 3], levels: u32, format: Format) -> ImageDesc {
    ImageDesc { dimension: TextureDimension::D2, size, levels, samples: 1, format }
}

pub(super) fn whole(image: &ImageDesc, dimension: ViewDimension) -> ViewRange {
    let layers = if dimension == ViewDimension::D3 { 1 } else { image.size[2] };
    let (format, levels) = (image.format, image.levels);
    ViewRange { dimension, format, aspect: Aspect::All, base_level: 0, levels, base_layer: 0, layers }
}

pub(super) fn view_of(image: &ImageDesc, dimension: ViewDimension) -> View {
    View::new(&noise(image, 1), image, &whole(image, dimension), 0).expect("a valid view")
}

fn linear() -> SamplerDesc {
    SamplerDesc { mag: FilterMode::Linear, min: FilterMode::Linear, mipmap: FilterMode::Linear, ..SamplerDesc::default() }
}

fn operands<'a>(coords: [&'a Lanes; 3], lod: Lod<'a>) -> Sample<'a> {
    Sample { coords, layer: None, offset: [0; 3], lod, compare: None }
}

fn one(view: &View, desc: &SamplerDesc, at: [f32; 3], level: f32) -> [f32; 4] {
    let coords = at.map(Lanes::splat_f32);
    let level = Lanes::splat_f32(level);
    let mut out = [Lanes::ZERO; 4];
    let args = operands([&coords[0], &coords[1], &coords[2]], Lod::Level(&level));
    view.sample(&Sampler::new(desc), &args, 1, &mut out);
    out.map(|c| c.f32()[0])
}

/// A texel by the codec, straight from the texture's bytes.
fn texel(words: &Words, image: &ImageDesc, level: u32, layer: u32, x: u32, y: u32) -> [u32; 4] {
    let size = image.format.block_bytes() as usize;
    let mut bytes = vec![0; size];
    let row = u64::from(y) * image.row_bytes(level);
    words.read(image.offset(level, layer) + row + u64::from(x) * size as u64, &mut bytes);
    decode(image.format, &bytes)
}

#[test]
fn parts_of_a_view_may_be_made_in_any_order() {
    for format in [Format::Rgba8Unorm, Format::Bgra8Unorm, Format::Rgba8UnormSrgb, Format::R8Unorm, Format::Depth32Float] {
        for (size, levels, samples) in [([200, 301, 2], 4, 1), ([1, 1, 1], 1, 1), ([9, 98, 1], 1, 4)] {
            let image = ImageDesc { samples, ..image(size, levels, format) };
            let words = noise(&image, 3);
            let range = whole(&image, ViewDimension::D2Array);
            let backwards = |parts: usize, part: &(dyn Fn(usize) + Sync)| (0..parts).rev().for_each(part);
            let (here, there) =
                (View::new(&words, &image, &range, 0), View::new_in_parts(&words, &image, &range, 0, &backwards));
            let (here, there) = (here.expect("a valid view"), there.expect("a valid view"));
            assert!(here.texels == there.texels && here.levels == there.levels, "{format:?} of {size:?}");
        }
    }
}

#[test]
fn every_format_loads_what_its_codec_decodes() {
    for &format in Format::ALL {
        if format.is_compressed() || format == Format::Stencil8 {
            continue;
        }
        let image = image([7, 5, 2], 3, format);
        let words = noise(&image, 9);
        let view = View::new(&words, &image, &whole(&image, ViewDimension::D2Array), 0).expect("a valid view");
        for level in 0..3 {
            let [w, h, _] = image.level_size(level);
            for layer in 0..2 {
                for y in 0..h {
                    let x = Lanes(std::array::from_fn(|i| (i as u32).min(w - 1)));
                    let mut out = [Lanes::ZERO; 4];
                    let (ys, ls, lv) = (Lanes::splat(y), Lanes::splat(layer), Lanes::splat(level));
                    view.load([&x, &ys, &Lanes::ZERO], Some(&ls), &lv, !0, &mut out);
                    for i in 0..w {
                        let want = texel(&words, &image, level, layer, i, y);
                        let got: [u32; 4] = std::array::from_fn(|c| out[c].0[i as usize]);
                        let both_nan = |c: usize| f32::from_bits(want[c]).is_nan() && f32::from_bits(got[c]).is_nan();
                        assert!((0..4).all(|c| got[c] == want[c] || both_nan(c)), "{format:?} {level} {layer} {i} {y}");
                    }
                }
            }
        }
    }
}

#[test]
fn lanes_load_alike_together_and_apart() {
    let desc = image([7, 5, 1], 2, Format::Bgra8Unorm);
    let words = noise(&desc, 5);
    let view = View::new(&words, &desc, &whole(&desc, ViewDimension::D2), 0).expect("a valid view");
    let mut random = Random::new(11);
    let mut present = 0;
    for round in 0..400 {
        // All texels exist, or some do not; levels are one or several; lanes are all there, or some are.
        let (beyond, levels) = (round % 3, if round % 5 == 0 { 3 } else { 1 });
        let first = random.between(0, 2) as u32;
        let any = random.between(0, 2) == 0;
        let mask = if round % 2 == 0 { !0 } else { u64::from(random.bits()) << 32 | u64::from(random.bits()) };
        let mut lanes = |end: u32| Lanes(std::array::from_fn(|_| random.between(0, end as i32) as u32));
        let [mut x, y, mut level] = [lanes(3 + beyond), lanes(2 + beyond), lanes(levels)];
        if levels == 1 {
            level = Lanes::splat(first);
        }
        if any {
            // What does not take part names nothing.
            (0..LANES).filter(|lane| mask >> lane & 1 == 0).for_each(|lane| x.0[lane] = !0);
        }
        let mut out = [Lanes::ZERO; 4];
        view.load([&x, &y, &Lanes::ZERO], None, &level, mask, &mut out);
        for i in 0..LANES {
            let [w, h, _] = if level.0[i] < 2 { desc.level_size(level.0[i]) } else { [0; 3] };
            let exists = mask >> i & 1 == 1 && x.0[i] < w && y.0[i] < h;
            present += u32::from(exists);
            let want = if exists { texel(&words, &desc, level.0[i], 0, x.0[i], y.0[i]) } else { [0; 4] };
            assert_eq!(out.map(|channel| channel.0[i]), want, "round {round}, lane {i}");
        }
    }
    assert!((5_000..20_000).contains(&present), "{present}");
}

#[test]
fn loads_outside_give_zeros_and_samples_are_chosen() {
    let desc = ImageDesc { samples: 4, ..image([3, 2, 1], 1, Format::R32Uint) };
    let words = noise(&desc, 3);
    let view = View::new(&words, &desc, &whole(&desc, ViewDimension::D2), 0).expect("a valid view");
    let sample = Lanes(std::array::from_fn(|i| i as u32 % 5));
    let x = Lanes(std::array::from_fn(|i| i as u32 / 5 % 4));
    let mut out = [Lanes::splat(9); 4];
    view.load([&x, &Lanes::splat(1), &Lanes::ZERO], None, &sample, !0, &mut out);
    for i in 0..LANES {
        let (x, s) = (x.0[i], sample.0[i]);
        let want = if x < 3 && s < 4 { words.load(((3 + x) * 4 + s) as usize) } else { 0 };
        assert_eq!(out[0].0[i], want);
    }
    assert_eq!((view.samples(), view.kind(), view.size(0), view.size(1)), (4, TexelKind::Uint, [3, 2, 1], [0; 3]));
}

#[test]
fn depth_and_stencil_aspects_are_apart() {
    let desc = image([2, 1, 1], 1, Format::Depth24PlusStencil8);
    let words = Words::new(desc.bytes());
    words.store(0, 0x07ff_ffff);
    words.store(1, 0x2a00_0000);
    for (aspect, want) in [(Aspect::StencilOnly, [7, 42]), (Aspect::DepthOnly, [0x3f80_0000, 0])] {
        let range = ViewRange { aspect, ..whole(&desc, ViewDimension::D2) };
        let view = View::new(&words, &desc, &range, 0).expect("a valid view");
        let x = Lanes(std::array::from_fn(|i| i as u32));
        let mut out = [Lanes::ZERO; 4];
        view.load([&x, &Lanes::ZERO, &Lanes::ZERO], None, &Lanes::ZERO, 3, &mut out);
        assert_eq!(out[0].0[..2], want);
    }
}

#[test]
fn wrong_views_are_refused() {
    let desc = image([8, 8, 3], 2, Format::Rgba8Unorm);
    let words = noise(&desc, 1);
    let make = |range: ViewRange| View::new(&words, &desc, &range, 0);
    let good = whole(&desc, ViewDimension::D2Array);
    assert!(make(good).is_ok());
    assert!(matches!(make(ViewRange { levels: 3, ..good }), Err(ViewError::Range { .. })));
    assert!(matches!(make(ViewRange { base_layer: 3, layers: 1, ..good }), Err(ViewError::Range { .. })));
    assert!(matches!(make(ViewRange { base_level: u32::MAX, levels: 2, ..good }), Err(ViewError::Range { .. })));
    assert!(matches!(make(ViewRange { dimension: ViewDimension::Cube, ..good }), Err(ViewError::Cube { .. })));
    assert!(matches!(make(ViewRange { format: Format::Rg8Unorm, ..good }), Err(ViewError::Format { .. })));
    let few = Words::new(16);
    assert!(matches!(View::new(&few, &desc, &good, 0), Err(ViewError::Bytes { .. })));
}

#[test]
fn bilinear_weights_are_those_of_the_definition() {
    let desc = image([2, 2, 1], 1, Format::R32Float);
    let words = Words::new(desc.bytes());
    for (i, value) in [0.0_f32, 1.0, 2.0, 4.0].iter().enumerate() {
        words.store(i, value.to_bits());
    }
    let view = View::new(&words, &desc, &whole(&desc, ViewDimension::D2), 0).expect("a valid view");
    assert_eq!(one(&view, &linear(), [0.5, 0.5, 0.0], 0.0)[0], 1.75);
    assert_eq!(one(&view, &linear(), [0.25, 0.25, 0.0], 0.0)[0], 0.0);
    assert_eq!(one(&view, &linear(), [0.5, 0.25, 0.0], 0.0)[0], 0.5);
    assert_eq!(one(&view, &linear(), [0.375, 0.75, 0.0], 0.0)[0], 2.5);
    assert_eq!(one(&view, &linear(), [-9.0, 99.0, 0.0], 0.0)[0], 2.0);
    let border = SamplerDesc { address: [AddressMode::ClampToBorder; 3], border: BorderColor::OpaqueWhite, ..linear() };
    assert_eq!(one(&view, &border, [-9.0, 0.5, 0.0], 0.0), [1.0; 4]);
    assert_eq!(one(&view, &border, [0.0, 0.25, 0.0], 0.0)[0], 0.5);
    let coords = [Lanes::splat_f32(0.5), Lanes::splat_f32(0.5)];
    let mut out = [Lanes::ZERO; 4];
    let args = operands([&coords[0], &coords[1], &coords[1]], Lod::Zero);
    view.gather(&Sampler::new(&linear()), &args, 0, 1, &mut out);
    assert_eq!(out.map(|c| c.f32()[0]), [2.0, 4.0, 1.0, 0.0]);
}

#[test]
fn comparison_is_made_before_filtering() {
    let desc = image([2, 1, 1], 1, Format::Depth32Float);
    let words = Words::new(desc.bytes());
    words.store(0, 0.2_f32.to_bits());
    words.store(1, 0.8_f32.to_bits());
    let view = View::new(&words, &desc, &whole(&desc, ViewDimension::D2), 0).expect("a valid view");
    for (compare, want) in [(Compare::Less, 0.25), (Compare::Greater, 0.75), (Compare::Always, 1.0), (Compare::Never, 0.0)] {
        let sampler = Sampler::new(&SamplerDesc { compare: Some(compare), ..linear() });
        let (u, v, r) = (Lanes::splat_f32(0.375), Lanes::splat_f32(0.5), Lanes::splat_f32(0.5));
        let mut out = [Lanes::ZERO; 4];
        view.sample(&sampler, &Sample { compare: Some(&r), ..operands([&u, &v, &v], Lod::Zero) }, 1, &mut out);
        assert_eq!(out[0].f32()[0], want, "{compare:?}");
    }
}

#[test]
fn levels_are_chosen_by_derivatives_bias_and_clamps() {
    // Each level has its own number as its value.
    let desc = image([64, 64, 1], 7, Format::R32Float);
    let words = Words::new(desc.bytes());
    for level in 0..7 {
        for i in 0..desc.layer_bytes(level) / 4 {
            words.store((desc.offset(level, 0) / 4 + i) as usize, (level as f32).to_bits());
        }
    }
    let view = View::new(&words, &desc, &whole(&desc, ViewDimension::D2), 0).expect("a valid view");
    let run = |desc: SamplerDesc, step: [f32; 4], bias: f32| {
        let mut coords = [Lanes::ZERO; 2];
        for i in 0..LANES {
            let (x, y) = ((i % 2) as f32, (i / 2 % 2) as f32);
            coords[0].f32_mut()[i] = 0.5 + (step[0] * x + step[1] * y) / 64.0;
            coords[1].f32_mut()[i] = 0.5 + (step[2] * x + step[3] * y) / 64.0;
        }
        let bias = Lanes::splat_f32(bias);
        let mut out = [Lanes::ZERO; 4];
        view.sample(&Sampler::new(&desc), &operands([&coords[0], &coords[1], &coords[1]], Lod::Bias(&bias)), !0, &mut out);
        out[0].f32()[5]
    };
    let near = |a: f32, b: f32| assert!((a - b).abs() < 1e-3, "{a} {b}");
    near(run(linear(), [4.0, 0.0, 0.0, 1.0], 0.0), 2.0);
    near(run(linear(), [1.0, 0.0, 0.0, 6.0], 0.0), 6_f32.log2());
    near(run(linear(), [3.0, 0.0, 4.0, 0.0], 0.0), 5_f32.log2());
    near(run(linear(), [4.0, 0.0, 0.0, 1.0], 1.5), 3.5);
    near(run(linear(), [4.0, 0.0, 0.0, 1.0], 99.0), 6.0);
    near(run(SamplerDesc { lod_max: 1.25, ..linear() }, [4.0, 0.0, 0.0, 1.0], 0.0), 1.25);
    near(run(SamplerDesc { lod_min: 2.5, ..linear() }, [1.0, 0.0, 0.0, 1.0], 0.0), 2.5);
    near(run(SamplerDesc { mipmap: FilterMode::Nearest, ..linear() }, [3.0, 0.0, 0.0, 1.0], 0.0), 2.0);
    near(run(SamplerDesc { anisotropy: 16, ..linear() }, [16.0, 0.0, 0.0, 2.0], 0.0), 1.0);
    near(run(SamplerDesc { anisotropy: 4, ..linear() }, [16.0, 0.0, 0.0, 2.0], 0.0), 2.0);
}

#[test]
fn volumes_arrays_and_lines_filter_in_their_dimensions() {
    let mut desc = image([4, 4, 4], 1, Format::R32Float);
    desc.dimension = TextureDimension::D3;
    let words = Words::new(desc.bytes());
    for i in 0..64 {
        words.store(i, ((i / 16) as f32).to_bits());
    }
    let view = View::new(&words, &desc, &whole(&desc, ViewDimension::D3), 0).expect("a valid view");
    assert_eq!(one(&view, &linear(), [0.3, 0.7, 0.5], 0.0)[0], 1.5);
    assert_eq!(one(&view, &SamplerDesc::default(), [0.3, 0.7, 0.99], 0.0)[0], 3.0);
    assert_eq!(view.size(0), [4, 4, 4]);
    let mut desc = image([4, 1, 1], 1, Format::R32Float);
    desc.dimension = TextureDimension::D1;
    let words = noise(&desc, 4);
    let view = View::new(&words, &desc, &whole(&desc, ViewDimension::D1), 0).expect("a valid view");
    let texels: Vec<f32> = (0..4).map(|i| f32::from_bits(words.load(i))).collect();
    assert_eq!(one(&view, &linear(), [0.5, f32::NAN, 0.0], 0.0)[0], (texels[1] + texels[2]) * 0.5);
    let desc = image([2, 2, 3], 1, Format::R32Float);
    let words = noise(&desc, 4);
    let view = View::new(&words, &desc, &whole(&desc, ViewDimension::D2Array), 0).expect("a valid view");
    let layer = Lanes(std::array::from_fn(|i| (i as i32 - 2) as u32));
    let (u, mut out) = (Lanes::splat_f32(0.2), [Lanes::ZERO; 4]);
    let args = Sample { layer: Some(&layer), ..operands([&u, &u, &u], Lod::Zero) };
    view.sample(&Sampler::new(&SamplerDesc::default()), &args, !0, &mut out);
    for i in 0..LANES {
        let want = words.load(4 * (i as i32 - 2).clamp(0, 2) as usize);
        assert_eq!(out[0].0[i], want);
    }
}

#[test]
fn cubes_are_seamless() {
    // A cube whose texels are their own directions: filtering must be continuous over edges and corners.
    let n = 16;
    let desc = image([n, n, 6], 1, Format::Rgba32Float);
    let words = Words::new(desc.bytes());
    for face in 0..6 {
        for y in 0..n {
            for x in 0..n {
                let c = |i: u32| (2 * i + 1) as f32 / n as f32 - 1.0;
                let d = cube::from_face(face, [c(x), c(y), 1.0]);
                let length = (d[0] * d[0] + d[1] * d[1] + d[2] * d[2]).sqrt();
                for i in 0..3 {
                    let at = ((face * n + y) * n + x) * 4 + i;
                    words.store(at as usize, (d[i as usize] / length).to_bits());
                }
            }
        }
    }
    let view = View::new(&words, &desc, &whole(&desc, ViewDimension::Cube), 0).expect("a valid view");
    let mut random = Random::new(5);
    for _ in 0..20_000 {
        let mut next = || random.range(-1.0, 1.0);
        let d = [next(), next(), next()];
        let length = (d[0] * d[0] + d[1] * d[1] + d[2] * d[2]).sqrt();
        if length < 0.1 {
            continue;
        }
        let got = one(&view, &linear(), d, 0.0);
        for i in 0..3 {
            assert!((got[i] - d[i] / length).abs() < 0.06, "{d:?} {got:?}");
        }
    }
    for odd in [[0.0; 3], [f32::NAN; 3], [f32::INFINITY, 0.0, f32::NEG_INFINITY]] {
        one(&view, &linear(), odd, 0.0);
    }
}

#[test]
fn compressed_textures_show_their_blocks_at_ragged_edges() {
    let desc = image([10, 6, 1], 2, Format::Bc1RgbaUnorm);
    let words = noise(&desc, 11);
    let view = View::new(&words, &desc, &whole(&desc, ViewDimension::D2), 0).expect("a valid view");
    for level in 0..2 {
        let [w, h, _] = desc.level_size(level);
        for y in 0..h {
            for x in 0..w {
                let mut block = [0; 8];
                let column = u64::from(x / 4) * 8;
                words.read(desc.offset(level, 0) + u64::from(y / 4) * desc.row_bytes(level) + column, &mut block);
                let want = crate::texel::decode_block(desc.format, &block)[(y % 4 * 4 + x % 4) as usize];
                let mut out = [Lanes::ZERO; 4];
                let at = [Lanes::splat(x), Lanes::splat(y)];
                view.load([&at[0], &at[1], &Lanes::ZERO], None, &Lanes::splat(level), 1, &mut out);
                assert_eq!(out.map(|c| c.0[0]), want);
            }
        }
    }
}

#[test]
fn footprints_hold_each_line_once() {
    let desc = image([64, 64, 1], 7, Format::Rgba8Unorm);
    let words = noise(&desc, 1);
    let view = View::new(&words, &desc, &whole(&desc, ViewDimension::D2), 4096).expect("a valid view");
    let mut coords = [Lanes::ZERO; 2];
    for i in 0..LANES {
        let (q, p) = (i / 4, i % 4);
        coords[0].f32_mut()[i] = (q * 2 + p % 2) as f32 / 64.0 + 0.5 / 64.0;
        coords[1].f32_mut()[i] = (p / 2) as f32 / 64.0 + 0.5 / 64.0;
    }
    let args = operands([&coords[0], &coords[1], &coords[1]], Lod::Auto);
    let mut footprint = Footprint::new();
    view.record_sample(&Sampler::new(&linear()), &args, !0, &mut footprint);
    // At 1:1 a quad's texels and their neighbours lie in one line of 4x4 texels, or in two where they cross to the next.
    assert_eq!(footprint.quad(0), (&[64][..], 4));
    assert_eq!(footprint.quad(1), (&[64, 65][..], 4));
    assert_eq!(footprint.quad(2), (&[65][..], 4));
    view.record_sample(&Sampler::new(&linear()), &args, 0xf0, &mut footprint);
    assert_eq!(footprint.quad(0), (&[][..], 0));
    assert_eq!(footprint.quad(1).1, 4);
    let half = Lanes::splat_f32(1.5);
    let args = operands([&coords[0], &coords[1], &coords[1]], Lod::Level(&half));
    view.record_sample(&Sampler::new(&linear()), &args, !0, &mut footprint);
    assert_eq!(footprint.quad(3).1, 8);
    assert!(footprint.quad(3).0.iter().all(|line| *line >= 64 + 256));
}
