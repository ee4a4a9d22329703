//! Blocks, matrices and texel buffers.

use spirv::{BoundFormat, Moved, Options, Place, Stage, UNIFORM_BINDINGS, translate};

use crate::engine::{Bound, build, compute, refusal, run};

/// Bits of numbers.
fn bits<const N: usize>(numbers: [f32; N]) -> [u32; N] {
    numbers.map(f32::to_bits)
}

#[test]
fn the_memory_model_of_vulkan_and_its_operands_are_cut() {
    let model = |words: Vec<u32>| -> Vec<u32> {
        // Turns the model of the module into that of Vulkan.
        let mut words = words;
        let at = words.iter().position(|&word| word == 14 | 3 << 16).expect("a memory model");
        words[at + 2] = 3;
        words
    };
    let words = model(compute(
        "OpCapability VulkanMemoryModel
         OpCapability VulkanMemoryModelDeviceScope
         OpExtension \"SPV_KHR_vulkan_memory_model\"",
        "",
        "",
        "%p = OpAccessChain %ptr_uint %out %u0 %u1
         %x = OpLoad %uint %p MakePointerVisible|NonPrivatePointer %u1
         %q = OpAccessChain %ptr_uint %out %u0 %u0
         OpStore %q %x Aligned 4",
    ));
    let bound = Bound::default().buffer(0, 0, &[1, 42]);
    run(&words, &Options::default(), &bound);
    assert_eq!(bound.words(0, 0), [42, 42]);
}

#[test]
fn uniform_blocks_with_dense_arrays_become_storage_buffers() {
    let words = compute(
        "",
        "OpDecorate %dense ArrayStride 4
         OpDecorate %u Block
         OpMemberDecorate %u 0 Offset 0
         OpDecorate %in DescriptorSet 1
         OpDecorate %in Binding 2",
        "%dense = OpTypeArray %uint %u4
         %u = OpTypeStruct %dense
         %ptr_u = OpTypePointer Uniform %u
         %ptr_in = OpTypePointer Uniform %uint
         %in = OpVariable %ptr_u Uniform",
        "%p = OpAccessChain %ptr_in %in %i0 %i3
         %x = OpLoad %uint %p
         out 0 %x",
    );
    let bound = Bound::default().buffer(0, 0, &[0]).buffer(1, 2 + UNIFORM_BINDINGS, &[5, 6, 7, 8]);
    let translated = run(&words, &Options::default(), &bound);
    assert_eq!(bound.words(0, 0), [8]);
    let moved = Moved { place: Place { set: 1, binding: 2 }, binding: 2 + UNIFORM_BINDINGS };
    assert_eq!(translated.uniform_as_storage, [moved]);
    let (_, program) = build(&words, "main", Stage::Compute, &Options::default()).expect("it compiles");
    assert!(!program.interface().bindings[1].written);
}

#[test]
fn old_storage_blocks_move_with_uniform_blocks() {
    let words = compute(
        "",
        "OpDecorate %dense ArrayStride 4
         OpDecorate %u Block
         OpMemberDecorate %u 0 Offset 0
         OpDecorate %in DescriptorSet 0
         OpDecorate %in Binding 1
         OpDecorate %b BufferBlock
         OpMemberDecorate %b 0 Offset 0
         OpDecorate %old DescriptorSet 0
         OpDecorate %old Binding 2",
        "%dense = OpTypeArray %uint %u2
         %u = OpTypeStruct %dense
         %ptr_u = OpTypePointer Uniform %u
         %b = OpTypeStruct %uint
         %ptr_b = OpTypePointer Uniform %b
         %ptr_in = OpTypePointer Uniform %uint
         %in = OpVariable %ptr_u Uniform
         %old = OpVariable %ptr_b Uniform",
        "%p = OpAccessChain %ptr_in %in %i0 %i1
         %x = OpLoad %uint %p
         %q = OpAccessChain %ptr_in %old %i0
         OpStore %q %x",
    );
    let bound = Bound::default().buffer(0, 1 + UNIFORM_BINDINGS, &[5, 6]).buffer(0, 2, &[0]);
    run(&words, &Options::default(), &bound);
    assert_eq!(bound.words(0, 2), [6]);
}

#[test]
fn storage_buffers_that_are_only_written_are_accepted() {
    let words = compute("", "OpDecorate %out NonReadable\nOpMemberDecorate %block 0 NonReadable", "", "out 0 %u7");
    let bound = Bound::default().buffer(0, 0, &[0]);
    run(&words, &Options::default(), &bound);
    assert_eq!(bound.words(0, 0), [7]);
}

/// A module with a block `%m` of a matrix with these decorations, an array of two such matrices behind it, and a number.
fn matrix(columns: u32, rows: u32, decorations: &[&str], offsets: [u32; 3], body: &str) -> Vec<u32> {
    let mut decorated = "OpDecorate %m Block\nOpDecorate %in DescriptorSet 0\nOpDecorate %in Binding 1\n".to_owned();
    for decoration in decorations {
        decorated += &format!("OpMemberDecorate %m 0 {decoration}\nOpMemberDecorate %m 1 {decoration}\n");
    }
    for (member, offset) in offsets.iter().enumerate() {
        decorated += &format!("OpMemberDecorate %m {member} Offset {offset}\n");
    }
    decorated += &format!("OpDecorate %pair ArrayStride {}", (offsets[2] - offsets[1]) / 2);
    let globals = format!(
        "%mat = OpTypeMatrix %v{rows}float {columns}
         %pair = OpTypeArray %mat %u2
         %m = OpTypeStruct %mat %pair %float
         %ptr_m = OpTypePointer StorageBuffer %m
         %ptr_mat = OpTypePointer StorageBuffer %mat
         %ptr_pair = OpTypePointer StorageBuffer %pair
         %ptr_column = OpTypePointer StorageBuffer %v{rows}float
         %ptr_float = OpTypePointer StorageBuffer %float
         %in = OpVariable %ptr_m StorageBuffer"
    );
    compute("", &decorated, &globals, body)
}

/// The elements of `%x` column by column, into the block from this slot on.
fn elements(columns: u32, rows: u32, name: &str, first: u32) -> String {
    let mut text = String::new();
    for n in 0..columns * rows {
        let (c, r) = (n / rows, n % rows);
        text += &format!("%e{first}_{n} = OpCompositeExtract %float {name} {c} {r}\n");
        text += &format!("%b{first}_{n} = OpBitcast %uint %e{first}_{n}\nout {} %b{first}_{n}\n", first + n);
    }
    text
}

/// 32 words: element n is n as a floating-point number.
fn counted() -> Vec<u32> {
    (0..32).map(|n| (n as f32).to_bits()).collect()
}

#[test]
fn matrices_of_two_rows_have_distant_columns() {
    let body = format!(
        "%p = OpAccessChain %ptr_mat %in %i0
         %x = OpLoad %mat %p
         {}
         %q = OpAccessChain %ptr_mat %in %i1 %i1
         %y = OpLoad %mat %q
         {}
         %c = OpAccessChain %ptr_column %in %i1 %u1 %i1
         %z = OpLoad %v2float %c
         %z0 = OpCompositeExtract %float %z 1
         %z1 = OpBitcast %uint %z0
         out 8 %z1
         %f = OpAccessChain %ptr_float %in %i0 %u1 %i0
         %w = OpLoad %float %f
         %w1 = OpBitcast %uint %w
         out 9 %w1
         %l = OpAccessChain %ptr_float %in %i2
         %last = OpLoad %float %l
         %last1 = OpBitcast %uint %last
         out 10 %last1",
        elements(2, 2, "%x", 0),
        elements(2, 2, "%y", 4)
    );
    let words = matrix(2, 2, &["ColMajor", "MatrixStride 16"], [0, 32, 96], &body);
    let bound = Bound::default().buffer(0, 0, &[0; 16]).buffer(0, 1, &counted());
    run(&words, &Options::default(), &bound);
    assert_eq!(bound.words(0, 0)[..11], bits([0.0, 1.0, 4.0, 5.0, 16.0, 17.0, 20.0, 21.0, 21.0, 4.0, 24.0]));
}

#[test]
fn matrices_by_rows_are_loaded_and_stored() {
    // Three columns and two rows: two vectors of three elements, 16 bytes apart.
    let body = format!(
        "%p = OpAccessChain %ptr_mat %in %i0
         %x = OpLoad %mat %p
         {}
         %whole = OpLoad %m %in
         %y = OpCompositeExtract %mat %whole 1 1
         {}
         %c = OpAccessChain %ptr_column %in %i1 %i0 %i2
         %z = OpLoad %v2float %c
         %z0 = OpCompositeExtract %float %z 1
         %z1 = OpBitcast %uint %z0
         out 12 %z1
         %f = OpAccessChain %ptr_float %c %i0
         %w = OpLoad %float %f
         %w1 = OpBitcast %uint %w
         out 13 %w1
         %q = OpAccessChain %ptr_mat %in %i1 %i1
         OpStore %q %x
         %d = OpAccessChain %ptr_column %in %i0 %i1
         OpStore %d %z
         %e = OpAccessChain %ptr_float %in %i0 %i0 %i1
         OpStore %e %f0",
        elements(3, 2, "%x", 0),
        elements(3, 2, "%y", 6)
    );
    let words = matrix(3, 2, &["RowMajor", "MatrixStride 16"], [0, 32, 96], &body);
    let bound = Bound::default().buffer(0, 0, &[0; 16]).buffer(0, 1, &counted());
    run(&words, &Options::default(), &bound);
    let first = [0.0, 4.0, 1.0, 5.0, 2.0, 6.0];
    let last = [16.0, 20.0, 17.0, 21.0, 18.0, 22.0];
    assert_eq!(bound.words(0, 0)[..6], bits(first));
    assert_eq!(bound.words(0, 0)[6..12], bits(last));
    assert_eq!(bound.words(0, 0)[12..14], bits([14.0, 10.0]));
    let after = bound.words(0, 1);
    assert_eq!(after[16..23], bits([0.0, 1.0, 2.0, 19.0, 4.0, 5.0, 6.0]));
    assert_eq!(after[..8], bits([0.0, 10.0, 2.0, 3.0, 0.0, 14.0, 6.0, 7.0]));
}

/// A module that reads texel 3 of a texel buffer whose value has this type, and writes the bits of its components and the number of texels.
fn texels(kind: &str, image: &str, read: &str) -> Vec<u32> {
    let mut body = format!(
        "%i = OpLoad %image %in
         %x = {read} %v4{kind} %i %i3
         %n = OpImageQuerySize %int %i
         %n1 = OpBitcast %uint %n
         out 4 %n1\n"
    );
    for n in 0..4 {
        body += &format!("%c{n} = OpCompositeExtract %{kind} %x {n}\n%b{n} = OpBitcast %uint %c{n}\nout {n} %b{n}\n");
    }
    let globals = format!(
        "%v4int = OpTypeVector %int 4
         %image = OpTypeImage %{kind} {image}
         %ptr_image = OpTypePointer UniformConstant %image
         %in = OpVariable %ptr_image UniformConstant"
    );
    let decorations = "OpDecorate %in DescriptorSet 0\nOpDecorate %in Binding 1";
    compute("OpCapability SampledBuffer\nOpCapability ImageBuffer\nOpCapability ImageQuery", decorations, &globals, &body)
}

#[test]
fn texel_buffers_are_storage_buffers_with_the_conversion_of_their_format() {
    let one = 1f32.to_bits();
    // Format, type, words, and the components of texel 3.
    type Row = (u32, &'static str, Vec<u32>, [u32; 4], u32);
    let table: Vec<Row> = vec![
        // R8_UNORM, R8_SINT, R8G8_SNORM, R8G8B8A8_UNORM, B8G8R8A8_UNORM, A2B10G10R10_UNORM.
        (9, "float", vec![0x8000_0000, 0], [(128.0f32 / 255.0).to_bits(), 0, 0, one], 8),
        (14, "int", vec![0x8000_0000], [-128i32 as u32, 0, 0, 1], 4),
        (17, "float", vec![0, 0x7f80_0000], [(-1f32).to_bits(), one, 0, one], 4),
        (37, "float", vec![0, 0, 0, 0xff00_ff33], [0.2f32.to_bits(), one, 0, one], 4),
        (44, "float", vec![0, 0, 0, 0x0000_ff33], [0, one, 0.2f32.to_bits(), 0], 4),
        (64, "float", vec![0, 0, 0, 1 << 30 | 1023 << 10], [0, one, 0, (1.0f32 / 3.0).to_bits()], 4),
        // R16G16_SFLOAT, R32_UINT, R32G32_SFLOAT, R32G32B32_SFLOAT, R32G32B32A32_UINT.
        (83, "float", vec![0, 0, 0, 0xc000_3c00], [one, (-2f32).to_bits(), 0, one], 4),
        (98, "uint", vec![0, 0, 0, 77, 0], [77, 0, 0, 1], 5),
        (103, "float", vec![0, 0, 0, 0, 0, 0, one, 9], [one, 9, 0, one], 4),
        (106, "float", (1..=12).collect(), [10, 11, 12, one], 4),
        (107, "uint", (1..=16).collect(), [13, 14, 15, 16], 4),
    ];
    for (format, kind, words, want, count) in table {
        let module = texels(kind, "Buffer 0 0 0 1 Unknown", "OpImageFetch");
        let formats = [BoundFormat { set: 0, binding: 1, format }];
        let bound = Bound::default().buffer(0, 0, &[0; 5]).buffer(0, 1, &words);
        let translated = run(&module, &Options { formats: &formats, ..Options::default() }, &bound);
        assert_eq!(translated.texel_buffers, [Place { set: 0, binding: 1 }]);
        assert_eq!(bound.words(0, 0)[..4], want, "format {format}");
        assert_eq!(bound.words(0, 0)[4], count, "format {format}");
    }
    // A storage texel buffer has its format in its type.
    let module = texels("float", "Buffer 0 0 0 2 R8", "OpImageRead");
    let bound = Bound::default().buffer(0, 0, &[0; 5]).buffer(0, 1, &[0xff00_0000]);
    run(&module, &Options::default(), &bound);
    assert_eq!(bound.words(0, 0)[0], one);
}

#[test]
fn samplerbuffer_of_glsl_is_a_texel_buffer() {
    let words = compute(
        "OpCapability SampledBuffer",
        "OpDecorate %in DescriptorSet 0\nOpDecorate %in Binding 1",
        "%image = OpTypeImage %uint Buffer 0 0 0 1 Unknown
         %sampled = OpTypeSampledImage %image
         %ptr_image = OpTypePointer UniformConstant %sampled
         %in = OpVariable %ptr_image UniformConstant",
        "%s = OpLoad %sampled %in
         %i = OpImage %image %s
         %x = OpImageFetch %v4uint %i %i1
         %c = OpCompositeExtract %uint %x 0
         out 0 %c",
    );
    let formats = [BoundFormat { set: 0, binding: 1, format: 98 }];
    let bound = Bound::default().buffer(0, 0, &[0]).buffer(0, 1, &[3, 4]);
    let translated = run(&words, &Options { formats: &formats, ..Options::default() }, &bound);
    assert_eq!(bound.words(0, 0), [4]);
    assert!(translated.combined.is_empty());
}

#[test]
fn texel_buffers_are_written() {
    let module = |format: &str, kind: &str| {
        compute(
            "OpCapability ImageBuffer",
            "OpDecorate %in DescriptorSet 0\nOpDecorate %in Binding 1",
            &format!(
                "%image = OpTypeImage %{kind} Buffer 0 0 0 2 {format}
                 %ptr_image = OpTypePointer UniformConstant %image
                 %in = OpVariable %ptr_image UniformConstant
                 %f1 = OpConstant %float 1.0
                 %f2 = OpConstant %float -1.0
                 %uints = OpConstantComposite %v4uint %u1 %u2 %u3 %u4
                 %floats = OpConstantComposite %v4float %f1 %f2 %f0 %f1"
            ),
            &format!("%i = OpLoad %image %in\nOpImageWrite %i %i1 %{kind}s"),
        )
    };
    let left = |format: &str, kind: &str| {
        let bound = Bound::default().buffer(0, 1, &[0; 8]);
        run(&module(format, kind), &Options::default(), &bound);
        bound.words(0, 1)
    };
    assert_eq!(left("Rgba32ui", "uint")[3..], [0, 1, 2, 3, 4]);
    assert_eq!(left("Rg32f", "float")[1..5], [0, 1f32.to_bits(), (-1f32).to_bits(), 0]);
    assert_eq!(left("Rgba8", "float")[..3], [0, 0xff00_00ff, 0]);
    assert_eq!(left("Rgba16f", "float")[1..5], [0, 0xbc00_3c00, 0x3c00_0000, 0]);
    assert_eq!(left("Rgba8ui", "uint")[..3], [0, 0x0403_0201, 0]);
    let refused = refusal(&module("R8", "float"), &Options::default());
    assert_eq!((refused.instruction.as_str(), refused.reason.contains("no whole words")), ("OpImageWrite", true));
}

#[test]
fn a_texel_buffer_without_a_known_format_is_refused() {
    let module = texels("float", "Buffer 0 0 0 1 Unknown", "OpImageFetch");
    let refused = translate(&module, "main", Stage::Compute, &Options::default()).expect_err("no format");
    assert_eq!(refused.instruction, "OpVariable");
    assert_eq!(refused.reason, "the format of the texel buffer of set 0, binding 1 is not known");
}

#[test]
fn arrays_of_several_buffers_are_refused() {
    let module = |count: u32| {
        compute(
            "",
            "OpDecorate %in DescriptorSet 0
             OpDecorate %in Binding 1
             OpDecorate %b Block
             OpMemberDecorate %b 0 Offset 0",
            &format!(
                "%b = OpTypeStruct %uint
                 %all = OpTypeArray %b %u{count}
                 %ptr_all = OpTypePointer StorageBuffer %all
                 %in = OpVariable %ptr_all StorageBuffer"
            ),
            "%p = OpAccessChain %ptr_uint %in %u0 %u0
             %x = OpLoad %uint %p
             out 0 %x",
        )
    };
    let bound = Bound::default().buffer(0, 0, &[0]).buffer(0, 1, &[5]);
    run(&module(1), &Options::default(), &bound);
    assert_eq!(bound.words(0, 0), [5]);
    assert_eq!(refusal(&module(3), &Options::default()).reason, "an array of several buffers is not supported");
}
