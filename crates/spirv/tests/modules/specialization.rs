//! Specialization constants and what is computed from them.

use spirv::{Constant, Options};

use crate::engine::{Bound, compute, refusal, run};

/// What a module leaves in its block, with these values of constants.
#[track_caller]
fn left(decorations: &str, globals: &str, body: &str, given: &[(u32, u32)], count: usize) -> Vec<u32> {
    let bytes: Vec<(u32, [u8; 4])> = given.iter().map(|&(id, value)| (id, value.to_le_bytes())).collect();
    let constants: Vec<Constant<'_>> = bytes.iter().map(|(id, bytes)| Constant { id: *id, bytes }).collect();
    let bound = Bound::default().buffer(0, 0, &vec![0; count]);
    let words = compute("", decorations, globals, body);
    run(&words, &Options { specialization: &constants, ..Options::default() }, &bound);
    bound.words(0, 0)
}

#[test]
fn constants_have_the_values_of_the_pipeline_or_their_own() {
    let decorations = "OpDecorate %a SpecId 7
        OpDecorate %b SpecId 8
        OpDecorate %c SpecId 9";
    let globals = "%a = OpSpecConstant %uint 5
        %b = OpSpecConstantTrue %bool
        %c = OpSpecConstant %float 1.5
        %pair = OpSpecConstantComposite %v2uint %a %u3";
    let body = "out 0 %a
        %s = OpSelect %uint %b %u1 %u2
        out 1 %s
        %bits = OpBitcast %uint %c
        out 2 %bits
        %second = OpCompositeExtract %uint %pair 0
        out 3 %second";
    assert_eq!(left(decorations, globals, body, &[], 4), [5, 1, 1.5f32.to_bits(), 5]);
    assert_eq!(left(decorations, globals, body, &[(7, 11), (8, 0), (9, 2f32.to_bits())], 4), [11, 2, 2f32.to_bits(), 11]);
}

#[test]
fn operations_of_whole_numbers_are_folded() {
    // Operation, type of the result, and the result of -7 and 3, then of 7 and 3.
    let table: &[(&str, &str, u32, u32)] = &[
        ("IAdd", "%int", -4i32 as u32, 10),
        ("ISub", "%int", -10i32 as u32, 4),
        ("IMul", "%int", -21i32 as u32, 21),
        ("UDiv", "%int", (u32::MAX - 6) / 3, 2),
        ("SDiv", "%int", -2i32 as u32, 2),
        ("UMod", "%int", (u32::MAX - 6) % 3, 1),
        ("SRem", "%int", -1i32 as u32, 1),
        ("SMod", "%int", 2, 1),
        ("ShiftRightLogical", "%int", (u32::MAX - 6) >> 3, 0),
        ("ShiftRightArithmetic", "%int", -1i32 as u32, 0),
        ("ShiftLeftLogical", "%int", -56i32 as u32, 56),
        ("BitwiseOr", "%int", (-7i32 | 3) as u32, 7),
        ("BitwiseXor", "%int", (-7i32 ^ 3) as u32, 4),
        ("BitwiseAnd", "%int", 1, 3),
        ("IEqual", "%bool", 0, 0),
        ("INotEqual", "%bool", 1, 1),
        ("ULessThan", "%bool", 0, 0),
        ("ULessThanEqual", "%bool", 0, 0),
        ("UGreaterThan", "%bool", 1, 1),
        ("UGreaterThanEqual", "%bool", 1, 1),
        ("SLessThan", "%bool", 1, 0),
        ("SLessThanEqual", "%bool", 1, 0),
        ("SGreaterThan", "%bool", 0, 1),
        ("SGreaterThanEqual", "%bool", 0, 1),
    ];
    let mut globals = "%a = OpSpecConstant %int 7\n%b = OpSpecConstant %int 3\n".to_owned();
    let mut body = String::new();
    for (n, (name, ty, ..)) in table.iter().enumerate() {
        globals += &format!("%r{n} = OpSpecConstantOp {ty} {name} %a %b\n%at{n} = OpConstant %uint {n}\n");
        body += &format!("%p{n} = OpAccessChain %ptr_uint %out %u0 %at{n}\n");
        body += &match *ty {
            "%bool" => format!("%v{n} = OpSelect %uint %r{n} %u1 %u0\nOpStore %p{n} %v{n}\n"),
            _ => format!("%v{n} = OpBitcast %uint %r{n}\nOpStore %p{n} %v{n}\n"),
        };
    }
    let decorations = "OpDecorate %a SpecId 0";
    let negative: Vec<u32> = table.iter().map(|row| row.2).collect();
    let positive: Vec<u32> = table.iter().map(|row| row.3).collect();
    assert_eq!(left(decorations, &globals, &body, &[(0, -7i32 as u32)], table.len()), negative);
    assert_eq!(left(decorations, &globals, &body, &[], table.len()), positive);
}

#[test]
fn operations_of_one_operand_booleans_and_composites_are_folded() {
    let globals = "%a = OpSpecConstant %int 7
        %t = OpSpecConstantTrue %bool
        %f = OpSpecConstantFalse %bool
        %neg = OpSpecConstantOp %int SNegate %a
        %not = OpSpecConstantOp %int Not %a
        %no = OpSpecConstantOp %bool LogicalNot %t
        %or = OpSpecConstantOp %bool LogicalOr %f %t
        %and = OpSpecConstantOp %bool LogicalAnd %f %t
        %eq = OpSpecConstantOp %bool LogicalEqual %f %t
        %ne = OpSpecConstantOp %bool LogicalNotEqual %f %t
        %chosen = OpSpecConstantOp %int Select %f %a %neg
        %third = OpConstant %float 0.33333334
        %half = OpSpecConstantOp %float QuantizeToF16 %third
        %v = OpSpecConstantComposite %v3int %a %neg %not
        %w = OpSpecConstantOp %v3int VectorShuffle %v %v 2 3 1
        %x = OpSpecConstantOp %v3int CompositeInsert %i9 %w 1
        %y = OpSpecConstantOp %int CompositeExtract %x 1
        %sum = OpSpecConstantOp %v3int IAdd %v %x
        %null = OpConstantNull %v3int
        %z = OpSpecConstantOp %v3int CompositeInsert %a %null 2
        %pick = OpSpecConstantOp %v3int Select %f %v %z";
    let mut body = String::new();
    for (n, name) in ["%neg", "%not", "%chosen", "%y", "%half"].iter().enumerate() {
        body += &format!("%b{n} = OpBitcast %uint {name}\nout {n} %b{n}\n");
    }
    body += "%flags0 = OpSelect %uint %no %u1 %u0\n";
    for (n, name) in ["%or", "%and", "%eq", "%ne"].iter().enumerate() {
        body += &format!("%bit{n} = OpSelect %uint {name} %u1 %u0\n%twice{n} = OpIMul %uint %flags{n} %u2\n");
        body += &format!("%flags{} = OpIAdd %uint %twice{n} %bit{n}\n", n + 1);
    }
    body += "out 5 %flags4\n";
    for (n, (vector, part)) in [("%sum", 0), ("%sum", 1), ("%sum", 2), ("%z", 1), ("%pick", 2)].iter().enumerate() {
        body +=
            &format!("%e{n} = OpCompositeExtract %int {vector} {part}\n%c{n} = OpBitcast %uint %e{n}\nout {} %c{n}\n", n + 6);
    }
    // -(7) = -7, !7 = -8; w = (-8, 7, -7), x = (-8, 9, -7), sum = (-1, 2, -15).
    let want = [-7, -8, -7, 9, 0x3eaa_a000, 0b01001, -1, 2, -15, 0, 7].map(|number: i32| number as u32);
    assert_eq!(left("", globals, &body, &[], 11), want);
}

#[test]
fn workgroups_have_the_size_of_constants() {
    let decorations = "OpDecorate %x SpecId 0\nOpDecorate %size BuiltIn WorkgroupSize";
    let globals = "%x = OpSpecConstant %uint 2
        %v3uint = OpTypeVector %uint 3
        %size = OpSpecConstantComposite %v3uint %x %u1 %u1";
    let words = compute("", decorations, globals, "%w = OpCompositeExtract %uint %size 0\nout 0 %w");
    let bytes = 5u32.to_le_bytes();
    let constants = [Constant { id: 0, bytes: &bytes }];
    let options = Options { specialization: &constants, ..Options::default() };
    let (_, program) = crate::engine::build(&words, "main", spirv::Stage::Compute, &options).expect("it compiles");
    assert_eq!(program.interface().workgroup_size, [5, 1, 1]);

    let by_id =
        compute("OpCapability Shader", "OpExecutionModeId %main LocalSizeId %x %u3 %u2", "%x = OpSpecConstant %uint 4", "");
    let (_, program) = crate::engine::build(&by_id, "main", spirv::Stage::Compute, &Options::default()).expect("it compiles");
    assert_eq!(program.interface().workgroup_size, [4, 3, 2]);
}

#[test]
fn what_cannot_be_folded_is_refused_by_name() {
    let words = compute("", "OpDecorate %a SpecId 3", "%a = OpSpecConstant %uint 1", "out 0 %a");
    let constants = [Constant { id: 3, bytes: &[1, 2] }];
    let refused = refusal(&words, &Options { specialization: &constants, ..Options::default() });
    assert_eq!(refused.instruction, "OpSpecConstant");
    assert_eq!(refused.reason, "the pipeline gives 2 bytes for constant 3, which has 4");
    assert_eq!(words[refused.word as usize] & 0xffff, 50);
    let float = compute("", "", "%a = OpSpecConstantOp %float FAdd %f0 %f0", "");
    assert_eq!(refusal(&float, &Options::default()).reason, "operation 129 of specialization constants is not supported");
}

#[test]
fn parts_of_numbers_and_numbers_of_16_bits_are_computed() {
    let globals = "%both = OpTypeStruct %v2float %v2float
        %ptr_float = OpTypePointer Function %float
        %a = OpConstant %float 2.75
        %b = OpConstant %float -3.5
        %third = OpConstant %float 0.33333334
        %v = OpConstantComposite %v2float %a %b";
    let body = "%whole = OpVariable %ptr_float Function
        %m = OpExtInst %both %glsl 36 %v
        %f = OpCompositeExtract %float %m 0 1
        %g = OpCompositeExtract %float %m 1 0
        %h = OpExtInst %float %glsl 35 %b %whole
        %i = OpLoad %float %whole
        %j = OpQuantizeToF16 %float %third
        %f1 = OpBitcast %uint %f
        %g1 = OpBitcast %uint %g
        %h1 = OpBitcast %uint %h
        %i1b = OpBitcast %uint %i
        %j1 = OpBitcast %uint %j
        out 0 %f1
        out 1 %g1
        out 2 %h1
        out 3 %i1b
        out 4 %j1";
    let want = [-0.5f32, 2.0, -0.5, -3.0, 0.333_251_95].map(f32::to_bits);
    assert_eq!(left("", globals, body, &[], 5), want);
}

#[test]
fn logical_operations_take_vectors() {
    let globals = "%v2bool = OpTypeVector %bool 2
        %true = OpConstantTrue %bool
        %false = OpConstantFalse %bool
        %ones = OpConstantComposite %v2uint %u1 %u1
        %zeros = OpConstantComposite %v2uint %u0 %u0
        %a = OpConstantComposite %v2bool %true %false";
    let body = "%place = OpAccessChain %ptr_uint %out %u0 %u0
        %seven = OpLoad %uint %place
        %is = OpIEqual %bool %seven %u7
        %b = OpCompositeConstruct %v2bool %is %is
        %or = OpLogicalOr %v2bool %a %b
        %and = OpLogicalAnd %v2bool %a %b
        %x = OpSelect %v2uint %or %ones %zeros
        %y = OpSelect %v2uint %and %ones %zeros
        %x1 = OpCompositeExtract %uint %x 1
        %y0 = OpCompositeExtract %uint %y 0
        %y1 = OpCompositeExtract %uint %y 1
        out 1 %x1
        out 2 %y0
        out 3 %y1";
    let bound = Bound::default().buffer(0, 0, &[7, 9, 9, 9]);
    run(&compute("", "", globals, body), &Options::default(), &bound);
    assert_eq!(bound.words(0, 0), [7, 1, 1, 0]);
}

#[test]
fn minima_take_numbers_of_either_sign() {
    let body = "%place = OpAccessChain %ptr_uint %out %u0 %u0
        %x = OpLoad %uint %place
        %y = OpBitcast %int %x
        %a = OpExtInst %int %glsl 39 %x %i1
        %b = OpExtInst %uint %glsl 38 %y %u1
        %c = OpExtInst %uint %glsl 45 %y %i2 %u5
        %a1 = OpBitcast %uint %a
        out 1 %a1
        out 2 %b
        out 3 %c";
    let bound = Bound::default().buffer(0, 0, &[-3i32 as u32, 9, 9, 9]);
    run(&compute("", "", "", body), &Options::default(), &bound);
    assert_eq!(bound.words(0, 0)[1..], [-3i32 as u32, 1, 2]);
}
