//! Combined image samplers, storage images without a format, loads at offsets, and input attachments.

use gfx::format::Format;
use gfx::state::AddressMode;
use num::Lanes;
use shader::{Executor, Resources};
use spirv::{Bias, BoundFormat, Combined, InputAttachment, Options, Place, SAMPLER_BINDINGS, Stage, Swizzle};

use crate::assembler::assemble;
use crate::engine::{Bound, build, compute, refusal, resources, run};

const COMBINED: &str = "%image = OpTypeImage %float 2D 0 0 0 1 Unknown
    %sampled = OpTypeSampledImage %image
    %ptr_sampled = OpTypePointer UniformConstant %sampled
    %half = OpConstant %float 0.5
    %beyond = OpConstant %float 1.125
    %inside = OpConstant %float 0.875
    %at = OpConstantComposite %v2float %beyond %half
    %near = OpConstantComposite %v2float %inside %half";

/// Four texels in one row: 1, 2, 3 and 4.
fn row(bound: Bound, set: u32, binding: u32) -> Bound {
    bound.texture(set, binding, Format::R32Float, &[1.0f32, 2.0, 3.0, 4.0].map(f32::to_bits))
}

#[test]
fn a_combined_image_sampler_is_an_image_and_a_sampler() {
    let words = compute(
        "",
        "OpDecorate %in DescriptorSet 1\nOpDecorate %in Binding 3",
        &format!("{COMBINED}\n%third = OpConstantComposite %v2int %i2 %i0\n%in = OpVariable %ptr_sampled UniformConstant"),
        "%s = OpLoad %sampled %in
         %x = OpImageSampleExplicitLod %v4float %s %at Lod %f0
         %c = OpCompositeExtract %float %x 0
         %b = OpBitcast %uint %c
         out 0 %b
         %i = OpImage %image %s
         %y = OpImageFetch %v4float %i %third Lod %i0
         %d = OpCompositeExtract %float %y 0
         %e = OpBitcast %uint %d
         out 1 %e",
    );
    for (address, want) in [(AddressMode::Repeat, 1.0f32), (AddressMode::ClampToEdge, 4.0)] {
        let bound = row(Bound::default().buffer(0, 0, &[0; 2]), 1, 3).sampler(1, 3 + SAMPLER_BINDINGS, address);
        let translated = run(&words, &Options::default(), &bound);
        assert_eq!(bound.words(0, 0), [want.to_bits(), 3f32.to_bits()]);
        let combined = Combined { place: Place { set: 1, binding: 3 }, sampler_binding: 3 + SAMPLER_BINDINGS };
        assert_eq!(translated.combined, [combined]);
    }
}

#[test]
fn combined_image_samplers_pass_through_arrays_functions_and_blocks_of_code() {
    let text = "OpCapability Shader
         %glsl = OpExtInstImport \"GLSL.std.450\"
         OpMemoryModel Logical GLSL450
         OpEntryPoint GLCompute %main \"main\" %out %one %all
         OpExecutionMode %main LocalSize 1 1 1
         OpDecorate %out DescriptorSet 0
         OpDecorate %out Binding 0
         OpDecorate %block Block
         OpMemberDecorate %block 0 Offset 0
         OpDecorate %one DescriptorSet 0
         OpDecorate %one Binding 1
         OpDecorate %all DescriptorSet 0
         OpDecorate %all Binding 2
         %void = OpTypeVoid
         %signature = OpTypeFunction %void
         %uint = OpTypeInt 32 0
         %int = OpTypeInt 32 1
         %float = OpTypeFloat 32
         %bool = OpTypeBool
         %v2float = OpTypeVector %float 2
         %v4float = OpTypeVector %float 4
         %block = OpTypeStruct %v2float
         %ptr_block = OpTypePointer StorageBuffer %block
         %ptr_float = OpTypePointer StorageBuffer %float
         %out = OpVariable %ptr_block StorageBuffer
         %u0 = OpConstant %uint 0
         %u1 = OpConstant %uint 1
         %u3 = OpConstant %uint 3
         %f0 = OpConstant %float 0.0
         %half = OpConstant %float 0.5
         %inside = OpConstant %float 0.875
         %at = OpConstantComposite %v2float %inside %half
         %image = OpTypeImage %float 2D 0 0 0 1 Unknown
         %sampled = OpTypeSampledImage %image
         %ptr_sampled = OpTypePointer UniformConstant %sampled
         %three = OpTypeArray %sampled %u3
         %ptr_three = OpTypePointer UniformConstant %three
         %takes = OpTypeFunction %float %ptr_sampled %v2float
         %one = OpVariable %ptr_sampled UniformConstant
         %all = OpVariable %ptr_three UniformConstant
         %main = OpFunction %void None %signature
         %begin = OpLabel
         %x = OpFunctionCall %float %read %one %at
         %p = OpAccessChain %ptr_float %out %u0 %u0
         OpStore %p %x
         %element = OpAccessChain %ptr_sampled %all %u1
         %s = OpLoad %sampled %element
         %is = OpFOrdGreaterThan %bool %x %f0
         OpSelectionMerge %end None
         OpBranchConditional %is %then %end
         %then = OpLabel
         %y = OpImageSampleExplicitLod %v4float %s %at Lod %f0
         %c = OpCompositeExtract %float %y 0
         %q = OpAccessChain %ptr_float %out %u0 %u1
         OpStore %q %c
         OpBranch %end
         %end = OpLabel
         OpReturn
         OpFunctionEnd
         %read = OpFunction %float None %takes
         %texture = OpFunctionParameter %ptr_sampled
         %place = OpFunctionParameter %v2float
         %inner = OpLabel
         %loaded = OpLoad %sampled %texture
         %value = OpImageSampleExplicitLod %v4float %loaded %place Lod %f0
         %first = OpCompositeExtract %float %value 0
         OpReturnValue %first
         OpFunctionEnd";
    let sampler = AddressMode::ClampToEdge;
    let bound = row(row(Bound::default().buffer(0, 0, &[0; 2]), 0, 1), 0, 2).sampler(0, 1 + SAMPLER_BINDINGS, sampler).sampler(
        0,
        2 + SAMPLER_BINDINGS,
        sampler,
    );
    for minor in [3, 4, 6] {
        let translated = run(&assemble(minor, text), &Options::default(), &bound);
        assert_eq!(bound.words(0, 0), [4f32.to_bits(); 2]);
        assert_eq!(translated.combined.len(), 2);
    }
}

#[test]
fn storage_images_have_the_formats_of_what_is_bound() {
    let words = compute(
        "OpCapability StorageImageWriteWithoutFormat
         OpCapability StorageImageReadWithoutFormat",
        "OpDecorate %a DescriptorSet 0
         OpDecorate %a Binding 1
         OpDecorate %b DescriptorSet 0
         OpDecorate %b Binding 2",
        "%image = OpTypeImage %float 2D 0 0 0 2 Unknown
         %ptr_image = OpTypePointer UniformConstant %image
         %a = OpVariable %ptr_image UniformConstant
         %b = OpVariable %ptr_image UniformConstant
         %at = OpConstantComposite %v2int %i1 %i0",
        "%i = OpLoad %image %a
         %x = OpImageRead %v4float %i %at
         %j = OpLoad %image %b
         OpImageWrite %j %at %x",
    );
    let bound =
        Bound::default().storage(0, 1, Format::Rgba8Unorm, &[0, 0xff00_ff00, 0, 0]).storage(0, 2, Format::R32Float, &[9; 4]);
    let formats = |first| [BoundFormat { set: 0, binding: 1, format: first }, BoundFormat { set: 0, binding: 2, format: 100 }];
    run(&words, &Options { formats: &formats(37), ..Options::default() }, &bound);
    assert_eq!(bound.words(0, 2), [9, 0, 9, 9]);
    let refused = refusal(&words, &Options { formats: &formats(1), ..Options::default() });
    assert_eq!(refused.reason, "the storage image of set 0, binding 1 has format 1, which storage images do not have");
    let refused = refusal(&words, &Options { formats: &formats(37)[..1], ..Options::default() });
    assert_eq!(refused.reason, "the format of the storage image of set 0, binding 2 is not known");
}

#[test]
fn offsets_of_loads_are_added() {
    let words = compute(
        "",
        "OpDecorate %in DescriptorSet 0\nOpDecorate %in Binding 1",
        "%image = OpTypeImage %float 2D 0 0 0 1 Unknown
         %ptr_image = OpTypePointer UniformConstant %image
         %in = OpVariable %ptr_image UniformConstant
         %at = OpConstantComposite %v2int %i1 %i0
         %by = OpConstantComposite %v2int %i2 %i0",
        "%i = OpLoad %image %in
         %x = OpImageFetch %v4float %i %at Lod|ConstOffset %i0 %by
         %c = OpCompositeExtract %float %x 0
         %b = OpBitcast %uint %c
         out 0 %b",
    );
    let bound = row(Bound::default().buffer(0, 0, &[0]), 0, 1);
    run(&words, &Options::default(), &bound);
    assert_eq!(bound.words(0, 0), [4f32.to_bits()]);
}

#[test]
fn what_naga_reads_past_is_refused_by_name() {
    let sample = |instruction: &str| {
        let words = compute(
            "",
            "OpDecorate %in DescriptorSet 0\nOpDecorate %in Binding 1",
            &format!("{COMBINED}\n%in = OpVariable %ptr_sampled UniformConstant"),
            &format!("%s = OpLoad %sampled %in\n%x = {instruction}"),
        );
        let refused = refusal(&words, &Options::default());
        format!("{}: {}", refused.instruction, refused.reason)
    };
    assert_eq!(
        sample("OpImageSampleImplicitLod %v4float %s %at MinLod %half"),
        "OpImageSampleImplicitLod: image operands 0x80 are not supported"
    );
    assert_eq!(
        sample("OpImageSampleDrefExplicitLod %float %s %at %half Lod %half"),
        "OpImageSampleDrefExplicitLod: a comparison at a level other than the constant 0 is not supported"
    );
    assert_eq!(
        sample("OpImageTexelPointer %ptr_sampled %in %u0 %u0"),
        "OpImageTexelPointer: atomic operations on images are not supported"
    );
}

#[test]
fn input_attachments_are_read_at_the_position_of_the_fragment() {
    let text = "OpCapability Shader
         OpCapability InputAttachment
         OpMemoryModel Logical GLSL450
         OpEntryPoint Fragment %main \"main\" %color
         OpExecutionMode %main OriginUpperLeft
         OpDecorate %color Location 0
         OpDecorate %in DescriptorSet 0
         OpDecorate %in Binding 2
         OpDecorate %in InputAttachmentIndex 1
         %void = OpTypeVoid
         %signature = OpTypeFunction %void
         %int = OpTypeInt 32 1
         %float = OpTypeFloat 32
         %v2int = OpTypeVector %int 2
         %v4float = OpTypeVector %float 4
         %i0 = OpConstant %int 0
         %zero = OpConstantComposite %v2int %i0 %i0
         %image = OpTypeImage %float SubpassData 0 0 0 2 Unknown
         %ptr_image = OpTypePointer UniformConstant %image
         %in = OpVariable %ptr_image UniformConstant
         %ptr_color = OpTypePointer Output %v4float
         %color = OpVariable %ptr_color Output
         %main = OpFunction %void None %signature
         %begin = OpLabel
         %i = OpLoad %image %in
         %x = OpImageRead %v4float %i %zero
         OpStore %color %x
         OpReturn
         OpFunctionEnd";
    let (translated, program) = build(&assemble(0, text), "main", Stage::Fragment, &Options::default()).expect("it compiles");
    assert_eq!(translated.input_attachments, [InputAttachment { place: Place { set: 0, binding: 2 }, index: 1 }]);
    let texels: Vec<u32> = (0..8).map(|n| (n as f32).to_bits()).collect();
    let bound = Bound::default().texture(0, 2, Format::R32Float, &texels);
    let bindings = resources(&program, &bound);
    let resources = Resources { bindings: &bindings, ..Resources::default() };
    let uniforms = program.uniforms(&resources);
    let mut executor = Executor::new();
    let mut batch = executor.bind(&program, &resources, &uniforms);
    let slot = program.interface().input(shader::BuiltIn::Position).expect("it reads the position");
    for (component, value) in [(0, 2.5), (1, 1.5)] {
        *batch.input_mut(slot, component).expect("it is read") = Lanes::splat_f32(value);
    }
    batch.run(1, 0).expect("it ends");
    assert_eq!(batch.output(0, 0).f32()[0], 6.0);
    let several = text.replace("SubpassData 0 0 0", "SubpassData 0 0 1").replace("%i %zero", "%i %zero Sample %i0");
    build(&assemble(0, &several), "main", Stage::Fragment, &Options::default()).expect("it compiles");
}

/// A module that samples the combined image sampler of set 1, binding 3, with these operands, and writes four channels.
fn sampled(instruction: &str) -> Vec<u32> {
    let channels: String = (0..4)
        .map(|n| format!("%c{n} = OpCompositeExtract %float %x {n}\n%b{n} = OpBitcast %uint %c{n}\nout {n} %b{n}\n"))
        .collect();
    compute(
        "",
        "OpDecorate %in DescriptorSet 1\nOpDecorate %in Binding 3",
        &format!("{COMBINED}\n%third = OpConstantComposite %v2int %i2 %i0\n%in = OpVariable %ptr_sampled UniformConstant"),
        &format!("%s = OpLoad %sampled %in\n{instruction}\n{channels}"),
    )
}

#[test]
fn channels_of_views_are_exchanged_behind_reads() {
    let place = Place { set: 1, binding: 3 };
    let read = |instruction: &str, channels: [u32; 4]| {
        let options = Options { swizzles: &[Swizzle { place, element: None, channels }], ..Options::default() };
        let bound =
            row(Bound::default().buffer(0, 0, &[0; 4]), 1, 3).sampler(1, 3 + SAMPLER_BINDINGS, AddressMode::ClampToEdge);
        run(&sampled(instruction), &options, &bound);
        bound.words(0, 0).into_iter().map(f32::from_bits).collect::<Vec<f32>>()
    };
    let sample = "%x = OpImageSampleExplicitLod %v4float %s %at Lod %f0";
    assert_eq!(read(sample, [0, 0, 0, 0]), [4.0, 0.0, 0.0, 1.0]);
    assert_eq!(read(sample, [6, 3, 1, 2]), [1.0, 4.0, 0.0, 1.0]);
    assert_eq!(read(sample, [3, 3, 3, 0]), [4.0, 4.0, 4.0, 1.0]);
    let fetch = "%i = OpImage %image %s\n%x = OpImageFetch %v4float %i %third Lod %i0";
    assert_eq!(read(fetch, [1, 0, 3, 3]), [0.0, 0.0, 3.0, 3.0]);
    let gather = |component: u32| format!("%x = OpImageGather %v4float %s %near %i{component}");
    assert_eq!(read(&gather(2), [0, 0, 3, 0]), read(&gather(0), [0; 4]));
    assert_eq!(read(&gather(1), [0, 2, 0, 0]), [1.0; 4]);
}

#[test]
fn biases_of_samplers_are_added_to_levels() {
    let options =
        Options { biases: &[Bias { place: Place { set: 1, binding: 3 }, element: None, bias: 1.5 }], ..Options::default() };
    let added = |instruction: &str| {
        let bound =
            row(Bound::default().buffer(0, 0, &[0; 4]), 1, 3).sampler(1, 3 + SAMPLER_BINDINGS, AddressMode::ClampToEdge);
        let translated = run(&sampled(instruction), &options, &bound);
        assert_eq!(f32::from_bits(bound.words(0, 0)[0]), 4.0, "there is one level");
        let ops: Vec<u32> = translated.origins.iter().map(|&(at, _)| translated.words[at as usize] & 0xffff).collect();
        [129, 142].map(|op| ops.iter().filter(|&&own| own == op).count())
    };
    assert_eq!(added("%x = OpImageSampleExplicitLod %v4float %s %at Lod %f0"), [1, 0], "a sum");
    assert_eq!(added("%x = OpImageSampleExplicitLod %v4float %s %at Grad %near %near"), [0, 2], "two products");
}

/// A module that reads the element of an array of three combined image samplers (set 1, binding 3) whose index is this id; `%own` is word 8 of the
/// block.
fn sampled_element(index: &str, instruction: &str) -> Vec<u32> {
    let channels: String = (0..4)
        .map(|n| format!("%c{n} = OpCompositeExtract %float %x {n}\n%b{n} = OpBitcast %uint %c{n}\nout {n} %b{n}\n"))
        .collect();
    compute(
        "",
        "OpDecorate %in DescriptorSet 1\nOpDecorate %in Binding 3",
        &format!(
            "{COMBINED}\n%three = OpTypeArray %sampled %u3\n%ptr_three = OpTypePointer UniformConstant %three
             %in = OpVariable %ptr_three UniformConstant"
        ),
        &format!(
            "%pointer = OpAccessChain %ptr_uint %out %u0 %u8\n%own = OpLoad %uint %pointer
             %element = OpAccessChain %ptr_sampled %in {index}\n%s = OpLoad %sampled %element\n{instruction}\n{channels}"
        ),
    )
}

#[test]
fn views_and_samplers_of_an_array_ask_for_their_own() {
    let place = Place { set: 1, binding: 3 };
    let swizzles = [(1, [6, 3, 1, 2]), (2, [3, 3, 3, 0])].map(|(at, channels)| Swizzle { place, element: Some(at), channels });
    let biases = [(0, 1.0), (2, -2.0)].map(|(at, bias)| Bias { place, element: Some(at), bias });
    let options = Options { swizzles: &swizzles, biases: &biases, ..Options::default() };
    let sample = "%x = OpImageSampleExplicitLod %v4float %s %at Lod %f0";
    for (element, want) in [(0, [4.0, 0.0, 0.0, 1.0]), (1, [1.0, 4.0, 0.0, 1.0]), (2, [4.0, 4.0, 4.0, 1.0])] {
        for (index, selects, adds) in
            [("%own".to_owned(), 2 + 4 * 2, 1), (format!("%u{element}"), 0, usize::from(element != 1))]
        {
            let mut words = [0; 9];
            words[8] = element;
            let bound =
                row(Bound::default().buffer(0, 0, &words), 1, 3).sampler(1, 3 + SAMPLER_BINDINGS, AddressMode::ClampToEdge);
            let translated = run(&sampled_element(&index, sample), &options, &bound);
            let read: Vec<f32> = bound.words(0, 0)[..4].iter().map(|&word| f32::from_bits(word)).collect();
            assert_eq!(read, want, "element {index}");
            let ops: Vec<u32> = translated.origins.iter().map(|&(at, _)| translated.words[at as usize] & 0xffff).collect();
            assert_eq!([169, 129].map(|op| ops.iter().filter(|&&own| own == op).count()), [selects, adds], "element {index}");
        }
    }
    let gather = sampled_element("%own", "%x = OpImageGather %v4float %s %near %i0");
    let refused = refusal(&gather, &options).to_string();
    assert!(refused.contains("a gather or a comparison with an array of views that exchange different channels"), "{refused}");
}
