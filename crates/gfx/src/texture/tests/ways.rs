//! Properties: both samplers give the same bits, whatever coordinates are asked for.

use super::*;

fn addresses() -> impl Strategy<Value = AddressMode> {
    proptest::sample::select(vec![AddressMode::ClampToEdge, AddressMode::Repeat, AddressMode::MirrorRepeat])
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn the_fixed_point_filter_has_the_bits_of_the_general_one(
        address in [addresses(), addresses()],
        // Rows, as one-dimensional textures are, have a filter of their own.
        size in (1_u32..40, prop_oneof![Just(1), 1_u32..40]),
        srgb in any::<bool>(),
        mip in any::<bool>(),
        alone in any::<bool>(),
        lod in 0_u32..4,
        coords in proptest::collection::vec(-3.0_f32..3.0, 2 * LANES),
        near in any::<bool>(),
        layer in 0_u32..4,
    ) {
        let size = [size.0, size.1];
        let levels = if alone { 1 } else { 32 - size[0].max(size[1]).leading_zeros() };
        let format = if srgb { Format::Bgra8UnormSrgb } else { Format::Rgba8Unorm };
        let dimension = if layer == 0 { ViewDimension::D2 } else { ViewDimension::D2Array };
        let view = view_of(&image([size[0], size[1], layer.max(1)], levels, format), dimension);
        let mipmap = if mip { FilterMode::Linear } else { FilterMode::Nearest };
        let sampler = Sampler::new(&SamplerDesc { address: [address[0], address[1], AddressMode::Repeat], mipmap, ..linear() });
        let scale = if near { 0.1 } else { 1.0 };
        let lanes: [Lanes; 2] = std::array::from_fn(|c| Lanes(std::array::from_fn(|i| (coords[2 * i + c] * scale).to_bits())));
        let level = Lanes(std::array::from_fn(|i| (coords[2 * i] + 1.0).to_bits()));
        let of_quads = Lanes(std::array::from_fn(|i| level.0[i & !3]));
        let lod = [Lod::Auto, Lod::Level(&level), Lod::Bias(&level), Lod::Bias(&of_quads)][lod as usize];
        let layers = Lanes(std::array::from_fn(|i| (i as u32 / 5) % layer.max(1)));
        let mut args = operands([&lanes[0], &lanes[1], &lanes[1]], lod);
        args.layer = (layer > 0).then_some(&layers);
        let (mut fast, mut exact, mut found) = ([Lanes::ZERO; 4], [Lanes::ZERO; 4], None);
        prop_assert!(general::is_fixed(&view, &sampler, &args));
        prop_assert!(fast::sample(&view, &sampler, &args, !0, &mut found, &mut fast));
        general::sample(&view, &sampler, &args, !0, &mut exact);
        prop_assert!(fast == exact);
        // Levels that are the same in a quad are found for the quad: they are those that are found lane by lane.
        let mut given = Lanes::ZERO;
        *given.f32_mut() = lod::Selection::new(&view, &sampler, &args).lambda;
        args.lod = Lod::Level(&given);
        prop_assert!(fast::sample(&view, &sampler, &args, !0, &mut None, &mut exact));
        prop_assert!(fast == exact, "levels of quads are those of their lanes");
        // Fixed point is near to numbers: an offset that leads a period on is filtered in these.
        if address == [AddressMode::Repeat; 2] && !srgb && view.levels.len() == 1 {
            args.offset = [size[0] as i32, -(size[1] as i32), 0];
            prop_assert!(!general::is_fixed(&view, &sampler, &args));
            general::sample(&view, &sampler, &args, !0, &mut exact);
            for c in 0..4 {
                for i in 0..LANES {
                    let (a, b) = (fast[c].f32()[i], exact[c].f32()[i]);
                    prop_assert!((a - b).abs() < 0.06 / 255.0 + 1e-5, "channel {c} lane {i}: {a} {b}");
                }
            }
        }
    }

    #[test]
    fn stages_over_all_lanes_have_the_bits_of_the_general_filter(
        address in proptest::array::uniform2(proptest::sample::select(AddressMode::ALL.to_vec())),
        filters in proptest::array::uniform3(any::<bool>()),
        size in [1_u32..40, 1_u32..40],
        format in 0_usize..6,
        lod in 0_usize..5,
        odd in proptest::collection::vec(any::<u32>(), LANES),
        coords in proptest::collection::vec(-3.0_f32..3.0, 4 * LANES),
        near in any::<bool>(),
        layer in 0_u32..4,
        compare in proptest::option::of(proptest::sample::select(Compare::ALL.to_vec())),
    ) {
        let format = [
            Format::Rgba8Unorm,
            Format::Bgra8UnormSrgb,
            Format::Depth32Float,
            Format::Rgba32Float,
            Format::Bc1RgbaUnorm,
            // Any bits: infinities, NaN and -0 too.
            Format::Rgba16Float,
        ][format];
        let levels = 32 - size[0].max(size[1]).leading_zeros();
        let dimension = if layer == 0 { ViewDimension::D2 } else { ViewDimension::D2Array };
        let view = view_of(&image([size[0], size[1], layer.max(1)], levels, format), dimension);
        let [mag, min, mipmap] = filters.map(|linear| if linear { FilterMode::Linear } else { FilterMode::Nearest });
        let address = [address[0], address[1], AddressMode::Repeat];
        let desc = SamplerDesc { address, mag, min, mipmap, compare, border: BorderColor::OpaqueWhite, ..SamplerDesc::default() };
        let scale = if near { 0.1 } else { 1.0 };
        // Every seventh lane has any bits.
        let lanes: [Lanes; 4] = std::array::from_fn(|c| {
            Lanes(std::array::from_fn(|i| if i % 7 == c { odd[i] } else { (coords[4 * i + c] * scale).to_bits() }))
        });
        let [u, v, level, reference] = &lanes;
        let gradient = Lod::Gradient { dx: [u, v, v], dy: [v, level, u] };
        let lod = [Lod::Auto, Lod::Level(level), Lod::Bias(level), Lod::Zero, gradient][lod];
        let layers = Lanes(std::array::from_fn(|i| (i as u32 / 5) % layer.max(1)));
        let mut args = operands([u, v, v], lod);
        args.layer = (layer > 0).then_some(&layers);
        args.compare = compare.map(|_| reference);
        let (mut stages, mut exact) = ([Lanes::ZERO; 4], [Lanes::ZERO; 4]);
        prop_assume!(!general::is_fixed(&view, &Sampler::new(&desc), &args));
        prop_assert!(fast::sample(&view, &Sampler::new(&desc), &args, !0, &mut None, &mut stages));
        general::sample(&view, &Sampler::new(&desc), &args, !0, &mut exact);
        for c in 0..4 {
            for i in 0..LANES {
                let (a, b) = (stages[c].0[i], exact[c].0[i]);
                let both_nan = f32::from_bits(a).is_nan() && f32::from_bits(b).is_nan();
                prop_assert!(a == b || both_nan, "channel {c} lane {i}: {a:#x} {b:#x}");
            }
        }
    }

    #[test]
    fn nearest_texels_of_one_level_have_the_bits_of_the_general_filter(
        address in proptest::array::uniform2(proptest::sample::select(AddressMode::ALL.to_vec())),
        size in [1_u32..40, 1_u32..40],
        format in proptest::sample::select(vec![Format::Rgba8Unorm, Format::Bgra8Unorm, Format::R8Unorm, Format::Bc1RgbaUnorm]),
        odd in proptest::collection::vec(any::<u32>(), LANES),
        coords in proptest::collection::vec(-3.0_f32..3.0, 2 * LANES),
    ) {
        let view = view_of(&image([size[0], size[1], 1], 1, format), ViewDimension::D2);
        let desc = SamplerDesc { address: [address[0], address[1], AddressMode::Repeat], ..SamplerDesc::default() };
        // Every seventh lane has any bits.
        let [u, v]: [Lanes; 2] = std::array::from_fn(|c| {
            Lanes(std::array::from_fn(|i| if i % 7 == c { odd[i] } else { coords[2 * i + c].to_bits() }))
        });
        let args = operands([&u, &v, &v], Lod::Auto);
        let (mut found, mut exact) = ([Lanes::ZERO; 4], [Lanes::ZERO; 4]);
        prop_assert!(fast::sample(&view, &Sampler::new(&desc), &args, !0, &mut None, &mut found));
        general::sample(&view, &Sampler::new(&desc), &args, !0, &mut exact);
        prop_assert!(found.iter().zip(&exact).all(|(a, b)| a.0 == b.0));
    }

    #[test]
    fn averages_over_all_lanes_have_the_bits_of_the_general_filter(
        address in proptest::array::uniform2(proptest::sample::select(AddressMode::ALL.to_vec())),
        size in [1_u32..90, 1_u32..90],
        format in 0_usize..4,
        lod in 0_usize..3,
        anisotropy in 2_u16..=16,
        odd in proptest::collection::vec(any::<u32>(), LANES),
        coords in proptest::collection::vec(-3.0_f32..3.0, 4 * LANES),
        scale in -8.0_f32..0.0,
        all_levels in any::<bool>(),
        layer in 0_u32..4,
        mask in any::<u64>(),
    ) {
        let format = [Format::Rgba8Unorm, Format::Bgra8UnormSrgb, Format::R32Float, Format::Rgba16Float][format];
        let levels = if all_levels { 32 - size[0].max(size[1]).leading_zeros() } else { 1 };
        let dimension = if layer == 0 { ViewDimension::D2 } else { ViewDimension::D2Array };
        let view = view_of(&image([size[0], size[1], layer.max(1)], levels, format), dimension);
        let address = [address[0], address[1], AddressMode::Repeat];
        let sampler = Sampler::new(&SamplerDesc { address, anisotropy, ..linear() });
        // Footprints of all sizes; every seventh lane has any bits.
        let lanes: [Lanes; 4] = std::array::from_fn(|c| {
            let place = |i: usize| (coords[4 * i + c] * scale.exp2()).to_bits();
            Lanes(std::array::from_fn(|i| if i % 7 == c { odd[i] } else { place(i) }))
        });
        let [u, v, level, w] = &lanes;
        let lod = [Lod::Auto, Lod::Bias(level), Lod::Gradient { dx: [u, v, v], dy: [v, w, u] }][lod];
        let layers = Lanes(std::array::from_fn(|i| (i as u32 / 5) % layer.max(1)));
        let mut args = operands([u, v, v], lod);
        args.layer = (layer > 0).then_some(&layers);
        let (mut averages, mut exact) = ([Lanes::ZERO; 4], [Lanes::ZERO; 4]);
        let borders = address[..2].contains(&AddressMode::ClampToBorder);
        let done = fast::sample(&view, &sampler, &args, mask, &mut None, &mut averages);
        prop_assert_eq!(done, !borders && mask.count_ones() >= 6);
        general::sample(&view, &sampler, &args, mask, &mut exact);
        for c in 0..4 {
            for i in (0..LANES).filter(|i| done && mask >> i & 1 == 1) {
                let (a, b) = (averages[c].0[i], exact[c].0[i]);
                let both_nan = f32::from_bits(a).is_nan() && f32::from_bits(b).is_nan();
                prop_assert!(a == b || both_nan, "channel {c} lane {i}: {a:#x} {b:#x}");
            }
        }
    }

    #[test]
    fn no_coordinate_panics(bits in proptest::collection::vec(any::<u32>(), 6 * LANES), pick in 0_usize..6, mode in 0_usize..4) {
        let (dimension, format) = [
            (ViewDimension::D2, Format::Rgba8Unorm),
            (ViewDimension::Cube, Format::Rgba8UnormSrgb),
            (ViewDimension::D2Array, Format::Rgba16Float),
            (ViewDimension::CubeArray, Format::Depth32Float),
            (ViewDimension::D3, Format::R8Snorm),
            (ViewDimension::D2, Format::Rgba32Uint),
        ][pick];
        let layers = if dimension == ViewDimension::D2 { 1 } else { 6 };
        let mut desc = image([8, 8, layers], 3, format);
        if dimension == ViewDimension::D3 {
            desc.dimension = TextureDimension::D3;
        }
        let view = view_of(&desc, dimension);
        let lanes: Vec<Lanes> = (0..6).map(|c| Lanes(std::array::from_fn(|i| bits[c * LANES + i]))).collect();
        let mut out = [Lanes::ZERO; 4];
        let mut footprint = Footprint::new();
        for &filter in FilterMode::ALL {
            for anisotropy in [1, 16] {
                let desc = SamplerDesc {
                    address: [AddressMode::ALL[mode]; 3],
                    mag: filter,
                    min: filter,
                    mipmap: filter,
                    anisotropy,
                    ..SamplerDesc::default()
                };
                let sampler = Sampler::new(&desc);
                let coords = [&lanes[0], &lanes[1], &lanes[2]];
                let gradient = Lod::Gradient { dx: coords, dy: [&lanes[3], &lanes[4], &lanes[5]] };
                for lod in [Lod::Auto, Lod::Level(&lanes[3]), Lod::Bias(&lanes[4]), gradient] {
                    for compare in [None, Some(&lanes[5])] {
                        let args = Sample { coords, layer: Some(&lanes[5]), offset: [3, -8, 7], lod, compare };
                        view.sample(&sampler, &args, !0, &mut out);
                        view.gather(&sampler, &args, 3, !0, &mut out);
                        view.record_sample(&sampler, &args, !0, &mut footprint);
                        view.record_gather(&sampler, &args, !0, &mut footprint);
                        view.sample(&sampler, &Sample { offset: [0; 3], compare: None, ..args }, !0, &mut out);
                    }
                }
                view.load(coords, Some(&lanes[3]), &lanes[4], !0, &mut out);
                view.record_load(coords, Some(&lanes[3]), &lanes[4], !0, &mut footprint);
            }
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    /// Lanes beside each other that read one layer are recorded together, as if each looked for its own.
    #[test]
    fn layers_that_lanes_share_are_recorded_as_those_of_each(
        address in [addresses(), addresses()],
        size in [1_u32..70, 1_u32..70],
        coords in proptest::collection::vec(-2.0_f32..2.0, 2 * LANES),
        layers in proptest::collection::vec(0_u32..3, LANES / 4),
        all in any::<bool>(),
        nearest in any::<bool>(),
    ) {
        let levels = 32 - size[0].max(size[1]).leading_zeros();
        let view = view_of(&image([size[0], size[1], 3], levels, Format::Rgba8Unorm), ViewDimension::D2Array);
        let mipmap = if nearest { FilterMode::Nearest } else { FilterMode::Linear };
        let sampler = Sampler::new(&SamplerDesc { address: [address[0], address[1], AddressMode::Repeat], mipmap, ..linear() });
        let lanes: [Lanes; 2] = std::array::from_fn(|c| Lanes(std::array::from_fn(|i| coords[2 * i + c].to_bits())));
        let record = |layer: &Lanes, mask: u64| {
            let args = Sample { layer: Some(layer), ..operands([&lanes[0], &lanes[1], &lanes[1]], Lod::Auto) };
            let mut footprint = Footprint::new();
            view.record_sample(&sampler, &args, mask, &mut footprint);
            footprint
        };
        let of = |lane: usize| layers[if all { 0 } else { lane / 4 }];
        let together = record(&Lanes(std::array::from_fn(of)), !0);
        for q in 0..16 {
            // The others, which are not recorded, have a layer for each lane.
            let apart = Lanes(std::array::from_fn(|lane| if lane / 4 == q { of(lane) } else { lane as u32 % 3 }));
            let alone = record(&apart, 15 << (4 * q));
            prop_assert_eq!(together.quad(q), alone.quad(q), "quad {}", q);
        }
    }

    #[test]
    fn records_are_those_of_the_taps(
        address in [addresses(), addresses()],
        size in [1_u32..70, 1_u32..70],
        coords in proptest::collection::vec(-2.0_f32..2.0, 2 * LANES),
        mask in any::<u64>(),
    ) {
        let levels = 32 - size[0].max(size[1]).leading_zeros();
        let view = view_of(&image([size[0], size[1], 1], levels, Format::Rgba8Unorm), ViewDimension::D2);
        let sampler = Sampler::new(&SamplerDesc { address: [address[0], address[1], AddressMode::Repeat], ..linear() });
        let lanes: [Lanes; 2] = std::array::from_fn(|c| Lanes(std::array::from_fn(|i| coords[2 * i + c].to_bits())));
        let level = Lanes(std::array::from_fn(|i| (coords[2 * i] + 1.0).to_bits()));
        let args = operands([&lanes[0], &lanes[1], &lanes[1]], Lod::Level(&level));
        let mut footprint = Footprint::new();
        view.record_sample(&sampler, &args, mask, &mut footprint);
        for q in 0..16 {
            let mut want = std::collections::BTreeSet::new();
            let mut operations = 0;
            for lane in (4 * q..4 * q + 4).filter(|l| mask >> l & 1 != 0) {
                let levels = lod::Levels::new(level.f32()[lane].max(0.0), view.levels.len(), &sampler);
                for (l, counts) in [(levels.first, true), (levels.second, levels.weight > 0.0)] {
                    if counts {
                        operations += 1;
                        let taps = taps::taps(&view, &sampler, l, true, taps::TexturePoint::new(&view, &args, lane), [0; 3]);
                        // A tap without weight need not be read.
                        for i in (0..taps.count).filter(|i| taps.weight[*i] > 1e-3) {
                            let [x, y, s] = taps.texel[i];
                            want.insert(view.line(l, x as u32, y as u32, s as u32));
                        }
                    }
                }
            }
            let (lines, ops) = footprint.quad(q);
            let got: std::collections::BTreeSet<u32> = lines.iter().copied().collect();
            prop_assert_eq!(got.len(), lines.len(), "no line twice");
            prop_assert!(want.is_subset(&got));
            prop_assert_eq!(u32::from(ops), operations);
        }
        // Of levels that are found by quad: those that sampling finds are those that recording alone finds.
        let args = operands([&lanes[0], &lanes[1], &lanes[1]], Lod::Auto);
        let (mut with, mut out) = (Footprint::new(), [Lanes::ZERO; 4]);
        view.record_sample(&sampler, &args, mask, &mut footprint);
        view.sample_recorded(&sampler, &args, mask, &mut out, &mut with);
        for q in 0..16 {
            prop_assert_eq!(footprint.quad(q), with.quad(q));
        }
    }
}
