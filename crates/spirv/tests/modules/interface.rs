//! Entry points, built-in values, and locations.

use shader::{BuiltIn, Executor, Interpolation, Resources};
use spirv::{Options, Refusal, Stage, translate};

use crate::assembler::assemble;
use crate::engine::{Bound, build, resources, run};

/// A vertex module whose block has a position and the size of points; `globals` and `body` come beside.
fn vertex(decorations: &str, interface: &str, globals: &str, body: &str) -> Vec<u32> {
    assemble(
        0,
        &format!(
            "OpCapability Shader
             OpCapability MultiView
             OpExtension \"SPV_KHR_multiview\"
             OpMemoryModel Logical GLSL450
             OpEntryPoint Vertex %main \"main\" %gl {interface}
             OpDecorate %block Block
             OpMemberDecorate %block 0 BuiltIn Position
             OpMemberDecorate %block 1 BuiltIn PointSize
             {decorations}
             %void = OpTypeVoid
             %signature = OpTypeFunction %void
             %int = OpTypeInt 32 1
             %float = OpTypeFloat 32
             %v4float = OpTypeVector %float 4
             %block = OpTypeStruct %v4float %float
             %ptr_block = OpTypePointer Output %block
             %ptr_v4float = OpTypePointer Output %v4float
             %ptr_float = OpTypePointer Output %float
             %gl = OpVariable %ptr_block Output
             %i0 = OpConstant %int 0
             %i1 = OpConstant %int 1
             %f1 = OpConstant %float 1.0
             %f2 = OpConstant %float 2.0
             %f3 = OpConstant %float 3.0
             %value = OpConstantComposite %v4float %f1 %f2 %f3 %f1
             {globals}
             %main = OpFunction %void None %signature
             %begin = OpLabel
             %p = OpAccessChain %ptr_v4float %gl %i0
             OpStore %p %value
             %s = OpAccessChain %ptr_float %gl %i1
             OpStore %s %f3
             {body}
             OpReturn
             OpFunctionEnd"
        ),
    )
}

/// The outputs of a vertex module for one vertex: components of each slot.
#[track_caller]
fn outputs(words: &[u32], options: &Options<'_>) -> Vec<(shader::Slot, Vec<u32>)> {
    let (_, program) = build(words, "main", Stage::Vertex, options).unwrap_or_else(|error| panic!("{error}"));
    let bound = Bound::default();
    let bindings = resources(&program, &bound);
    let resources = Resources { bindings: &bindings, ..Resources::default() };
    let uniforms = program.uniforms(&resources);
    let mut executor = Executor::new();
    let mut batch = executor.bind(&program, &resources, &uniforms);
    batch.run(1, 0).expect("it ends");
    let slots = program.interface().outputs.iter().enumerate();
    slots.map(|(n, slot)| (*slot, (0..slot.components as usize).map(|c| batch.output(n, c).0[0]).collect())).collect()
}

#[test]
fn y_of_positions_is_turned() {
    let words = vertex("", "", "", "");
    let y = |flip_y| {
        let all = outputs(&words, &Options { flip_y, ..Options::default() });
        let (_, position) = all.iter().find(|(slot, _)| slot.is_builtin(BuiltIn::Position)).expect("a position");
        position.iter().map(|&bits| f32::from_bits(bits)).collect::<Vec<f32>>()
    };
    assert_eq!(y(false), [1.0, 2.0, 3.0, 1.0]);
    assert_eq!(y(true), [1.0, -2.0, 3.0, 1.0]);
}

/// naga's own form of a translated module.
fn read(words: &[u32], stage: Stage) -> naga::Module {
    let translated = translate(words, "main", stage, &Options::default()).expect("it is translated");
    let options = naga::front::spv::Options::default();
    naga::front::spv::Frontend::new(translated.words.into_iter(), &options).parse().expect("naga reads it")
}

#[test]
fn the_size_of_points_and_the_coordinate_in_them_survive() {
    let module = read(&vertex("", "", "", ""), Stage::Vertex);
    let result = module.entry_points[0].function.result.as_ref().expect("a result");
    let naga::TypeInner::Struct { members, .. } = &module.types[result.ty].inner else { panic!("several outputs") };
    let is_size = |member: &naga::StructMember| member.binding == Some(naga::Binding::BuiltIn(naga::BuiltIn::PointSize));
    assert!(members.iter().any(is_size));

    let text = "OpCapability Shader
         OpMemoryModel Logical GLSL450
         OpEntryPoint Fragment %main \"main\" %color %coord
         OpExecutionMode %main OriginUpperLeft
         OpDecorate %color Location 0
         OpDecorate %coord BuiltIn PointCoord
         %void = OpTypeVoid
         %signature = OpTypeFunction %void
         %float = OpTypeFloat 32
         %v2float = OpTypeVector %float 2
         %ptr_color = OpTypePointer Output %v2float
         %ptr_coord = OpTypePointer Input %v2float
         %color = OpVariable %ptr_color Output
         %coord = OpVariable %ptr_coord Input
         %main = OpFunction %void None %signature
         %begin = OpLabel
         %x = OpLoad %v2float %coord
         OpStore %color %x
         OpReturn
         OpFunctionEnd";
    let (_, program) = build(&assemble(0, text), "main", Stage::Fragment, &Options::default()).expect("it compiles");
    assert!(program.interface().input(BuiltIn::PointCoord).is_some());
}

#[test]
fn the_number_of_the_view_is_a_constant() {
    let words = vertex(
        "OpDecorate %view BuiltIn ViewIndex\nOpDecorate %number Location 0\nOpDecorate %number Flat",
        "%view %number",
        "%ptr_view = OpTypePointer Input %int
         %view = OpVariable %ptr_view Input
         %ptr_number = OpTypePointer Output %int
         %number = OpVariable %ptr_number Output",
        "%v = OpLoad %int %view
         OpStore %number %v",
    );
    for (given, want) in [(None, 0), (Some(3), 3)] {
        let all = outputs(&words, &Options { view_index: given, ..Options::default() });
        let (_, number) = all.iter().find(|(slot, _)| slot.location() == Some(0)).expect("an output");
        assert_eq!(number[..], [want]);
    }
}

#[test]
fn numbers_of_draws_are_constants_where_they_are_given() {
    for builtin in ["BaseInstance", "DrawIndex"] {
        let words = vertex(
            &format!("OpDecorate %own BuiltIn {builtin}\nOpDecorate %number Location 0\nOpDecorate %number Flat"),
            "%own %number",
            "%ptr_own = OpTypePointer Input %int
             %own = OpVariable %ptr_own Input
             %ptr_number = OpTypePointer Output %int
             %number = OpVariable %ptr_number Output",
            "%v = OpLoad %int %own
             OpStore %number %v",
        );
        let options = match builtin {
            "BaseInstance" => Options { base_instance: Some(7), ..Options::default() },
            _ => Options { draw_index: Some(7), ..Options::default() },
        };
        let all = outputs(&words, &options);
        let (_, number) = all.iter().find(|(slot, _)| slot.location() == Some(0)).expect("an output");
        assert_eq!(number[..], [7], "{builtin}");
    }
}

#[test]
fn a_dispatch_can_begin_at_any_workgroup() {
    let text = "@group(0) @binding(0) var<storage, read_write> out: array<u32>;
        @compute @workgroup_size(2, 1, 3) fn main(
            @builtin(workgroup_id) group: vec3u,
            @builtin(global_invocation_id) global: vec3u,
            @builtin(local_invocation_id) local: vec3u,
            @builtin(num_workgroups) groups: vec3u,
        ) {
            if all(local == vec3u(1, 0, 2)) {
                for (var axis = 0; axis < 3; axis++) {
                    out[axis] = group[axis];
                    out[3 + axis] = global[axis];
                    out[6 + axis] = groups[axis];
                }
            }
        }";
    let module = naga::front::wgsl::parse_str(text).expect("WGSL");
    let info = naga::valid::Validator::new(Default::default(), Default::default()).validate(&module).expect("a module");
    let words = naga::back::spv::write_vec(&module, &info, &Default::default(), None).expect("words");
    for (base_workgroup, want) in
        [([0; 3], [0, 0, 0, 1, 0, 2, 1, 1, 1]), ([5, 6, 7], [5, 6, 7, 5 * 2 + 1, 6, 7 * 3 + 2, 1, 1, 1])]
    {
        let bound = Bound::default().buffer(0, 0, &[0; 9]);
        run(&words, &Options { base_workgroup, ..Options::default() }, &bound);
        assert_eq!(bound.words(0, 0), want);
    }
}

#[test]
fn stages_that_choose_a_viewport_or_a_layer_are_refused_by_name() {
    for (builtin, what) in [("ViewportIndex", "viewport"), ("Layer", "layer")] {
        let words = vertex(
            &format!("OpDecorate %own BuiltIn {builtin}"),
            "%own",
            "%ptr_own = OpTypePointer Output %int
             %own = OpVariable %ptr_own Output",
            "OpStore %own %i1",
        );
        let refusal = translate(&words, "main", Stage::Vertex, &Options::default()).expect_err("it is refused");
        assert_eq!(refusal.instruction, "OpVariable");
        assert_eq!(refusal.reason, format!("a vertex stage that chooses the {what} is not supported"));
    }
}

/// A fragment module that copies a varying of whole numbers to its colour.
fn fragment(decorations: &str) -> Vec<u32> {
    assemble(
        0,
        &format!(
            "OpCapability Shader
             OpMemoryModel Logical GLSL450
             OpEntryPoint Fragment %main \"main\" %color %in
             OpExecutionMode %main OriginUpperLeft
             OpDecorate %color Location 1
             OpDecorate %in Location 0
             {decorations}
             %void = OpTypeVoid
             %signature = OpTypeFunction %void
             %int = OpTypeInt 32 1
             %ptr_color = OpTypePointer Output %int
             %ptr_in = OpTypePointer Input %int
             %color = OpVariable %ptr_color Output
             %in = OpVariable %ptr_in Input
             %main = OpFunction %void None %signature
             %begin = OpLabel
             %x = OpLoad %int %in
             OpStore %color %x
             OpReturn
             OpFunctionEnd"
        ),
    )
}

#[test]
fn whole_numbers_are_flat_and_first_indices_say_nothing() {
    let (_, program) =
        build(&fragment("OpDecorate %color Index 0"), "main", Stage::Fragment, &Options::default()).expect("it compiles");
    let [slot] = program.interface().inputs[..] else { panic!("one input") };
    assert!(matches!(slot.connection, shader::Connection::Location { interpolation: Interpolation::Flat, .. }));
    assert_eq!(program.interface().outputs[0].location(), Some(1));
}

#[test]
fn what_begins_within_a_location_is_refused() {
    let refused = translate(&fragment("OpDecorate %in Component 1"), "main", Stage::Fragment, &Options::default());
    let refused = refused.expect_err("naga reads it from the first component");
    assert_eq!(refused.instruction, "OpDecorate");
    let far = translate(&fragment("OpDecorate %in Location 4096"), "main", Stage::Fragment, &Options::default());
    assert_eq!(far.expect_err("it is far").reason, "location 4096 is not supported: they end with 4095");
    translate(&fragment("OpDecorate %in Component 0"), "main", Stage::Fragment, &Options::default()).expect("it says nothing");
}

#[test]
fn entry_points_are_chosen_by_name_and_stage() {
    let refused =
        |name: &str, stage: Stage| translate(&fragment(""), name, stage, &Options::default()).expect_err("no such entry");
    assert_eq!(refused("main", Stage::Vertex).reason, "the module has no entry point `main` of the vertex stage");
    assert_eq!(refused("other", Stage::Fragment).reason, "the module has no entry point `other` of the fragment stage");
    let geometry = fragment("");
    let at = geometry.iter().position(|word| word & 0xffff == 15).expect("an entry point");
    let mut geometry = geometry;
    geometry[at + 1] = 3;
    let refused = translate(&geometry, "main", Stage::Geometry, &Options::default());
    let want = Refusal {
        word: at as u32,
        instruction: "OpEntryPoint".to_owned(),
        reason: "the geometry stage is not supported".to_owned(),
    };
    assert_eq!(refused, Err(want));
}

#[test]
fn what_other_entry_points_have_is_forgotten() {
    let text = "OpCapability Shader
         OpCapability Geometry
         OpCapability StorageImageWriteWithoutFormat
         OpMemoryModel Logical GLSL450
         OpEntryPoint Fragment %main \"main\" %color
         OpEntryPoint GLCompute %other \"main\" %image
         OpEntryPoint Geometry %third \"main\" %layer
         OpExecutionMode %main OriginUpperLeft
         OpExecutionMode %other LocalSize 1 1 1
         OpExecutionMode %third InputPoints
         OpDecorate %color Location 0
         OpDecorate %layer BuiltIn Layer
         OpDecorate %image DescriptorSet 0
         OpDecorate %image Binding 0
         %void = OpTypeVoid
         %signature = OpTypeFunction %void
         %int = OpTypeInt 32 1
         %float = OpTypeFloat 32
         %v2int = OpTypeVector %int 2
         %v4float = OpTypeVector %float 4
         %i0 = OpConstant %int 0
         %zero = OpConstantComposite %v2int %i0 %i0
         %f1 = OpConstant %float 1.0
         %ones = OpConstantComposite %v4float %f1 %f1 %f1 %f1
         %open = OpTypeImage %float 2D 0 0 0 2 Unknown
         %ptr_open = OpTypePointer UniformConstant %open
         %ptr_color = OpTypePointer Output %v4float
         %ptr_layer = OpTypePointer Output %int
         %image = OpVariable %ptr_open UniformConstant
         %color = OpVariable %ptr_color Output
         %layer = OpVariable %ptr_layer Output
         %main = OpFunction %void None %signature
         %begin = OpLabel
         OpStore %color %ones
         OpReturn
         OpFunctionEnd
         %other = OpFunction %void None %signature
         %start = OpLabel
         %i = OpLoad %open %image
         OpImageWrite %i %zero %ones
         OpReturn
         OpFunctionEnd
         %third = OpFunction %void None %signature
         %first = OpLabel
         OpStore %layer %i0
         OpReturn
         OpFunctionEnd";
    for minor in [0, 4] {
        let words = assemble(minor, text);
        build(&words, "main", Stage::Fragment, &Options::default()).unwrap_or_else(|error| panic!("{error}"));
        let refused = translate(&words, "main", Stage::Compute, &Options::default()).expect_err("no format");
        assert_eq!(refused.reason, "the format of the storage image of set 0, binding 0 is not known");
    }
}

#[test]
fn damaged_words_are_refused_with_their_place() {
    let words = fragment("");
    let reason = |words: &[u32]| translate(words, "main", Stage::Fragment, &Options::default()).expect_err("damaged").reason;
    assert_eq!(reason(&[]), "a module has at least 5 words");
    assert_eq!(reason(&[0; 5]), "this is no SPIR-V: the magic number is wrong");
    assert_eq!(reason(&words[..words.len() - 3]), "the instruction ends behind the module");
    let mut large = words.clone();
    large[3] = 1 << 23;
    assert_eq!(reason(&large), "ids up to a bound that SPIR-V does not allow");
    for at in 5..words.len() {
        for value in [0, 1, u32::MAX, words[at] ^ 1, words[at] << 16] {
            let mut changed = words.clone();
            changed[at] = value;
            if let Ok(translated) =
                translate(&changed, "main", Stage::Fragment, &Options { flip_y: true, ..Options::default() })
            {
                assert!(translated.origin(translated.words.len() as u32) < words.len() as u32);
            }
        }
    }
}

#[test]
fn matrices_and_arrays_take_a_location_for_each_vector() {
    let words = vertex(
        "OpDecorate %matrix Location 2
         OpDecorate %numbers Location 4
         OpDecorate %sum Location 1
         OpDecorate %sum NoPerspective",
        "%matrix %numbers %sum",
        "%uint = OpTypeInt 32 0
         %two = OpConstant %uint 2
         %mat = OpTypeMatrix %v4float 2
         %ints = OpTypeArray %int %two
         %floats = OpTypeArray %float %two
         %ptr_mat = OpTypePointer Input %mat
         %ptr_ints = OpTypePointer Input %ints
         %ptr_floats = OpTypePointer Output %floats
         %ptr_element = OpTypePointer Input %float
         %ptr_int = OpTypePointer Input %int
         %matrix = OpVariable %ptr_mat Input
         %numbers = OpVariable %ptr_ints Input
         %sum = OpVariable %ptr_floats Output",
        "%m = OpLoad %mat %matrix
         %a = OpCompositeExtract %float %m 1 3
         %b = OpAccessChain %ptr_element %matrix %i0 %i1
         %c = OpLoad %float %b
         %d = OpFAdd %float %a %c
         %e = OpAccessChain %ptr_int %numbers %i1
         %f = OpLoad %int %e
         %g = OpConvertSToF %float %f
         %q0 = OpAccessChain %ptr_float %sum %i0
         OpStore %q0 %d
         %q1 = OpAccessChain %ptr_float %sum %i1
         OpStore %q1 %g",
    );
    let (_, program) = build(&words, "main", Stage::Vertex, &Options::default()).unwrap_or_else(|error| panic!("{error}"));
    let bound = Bound::default();
    let bindings = resources(&program, &bound);
    let resources = Resources { bindings: &bindings, ..Resources::default() };
    let uniforms = program.uniforms(&resources);
    let mut executor = Executor::new();
    let mut batch = executor.bind(&program, &resources, &uniforms);
    let interface = program.interface();
    for (location, component, value) in [(2, 1, 5f32.to_bits()), (3, 3, 7f32.to_bits()), (5, 0, 9)] {
        let slot = interface.inputs.iter().position(|slot| slot.location() == Some(location)).expect("an input");
        batch.input_mut(slot, component).expect("it is read").0[0] = value;
    }
    batch.run(1, 0).expect("it ends");
    for (location, want) in [(1, 12f32), (2, 9.0)] {
        let slot = interface.output_location(location).expect("an output");
        assert_eq!(batch.output(slot, 0).f32()[0], want);
        let shader::Connection::Location { interpolation, .. } = interface.outputs[slot].connection else {
            panic!("a location")
        };
        assert_eq!(interpolation, Interpolation::Linear);
    }
    let far = vertex(
        "OpDecorate %many Location 0",
        "%many",
        "%uint = OpTypeInt 32 0
         %count = OpConstant %uint 300
         %floats = OpTypeArray %float %count
         %ptr_floats = OpTypePointer Output %floats
         %many = OpVariable %ptr_floats Output",
        "",
    );
    let refused = translate(&far, "main", Stage::Vertex, &Options::default()).expect_err("too many");
    assert_eq!(refused.reason, "an input or output has more vectors than are supported");
    // Four thousand million structures with nothing in them.
    let empty = vertex(
        "OpDecorate %many Location 0",
        "%many",
        "%uint = OpTypeInt 32 0
         %count = OpConstant %uint 4294967295
         %nothing = OpTypeStruct
         %nothings = OpTypeArray %nothing %count
         %ptr_nothings = OpTypePointer Output %nothings
         %many = OpVariable %ptr_nothings Output",
        "",
    );
    let refused = translate(&empty, "main", Stage::Vertex, &Options::default()).expect_err("too many");
    assert_eq!(refused.reason, "an input or output has more vectors than are supported");
}

#[test]
fn a_demoted_invocation_goes_on_as_a_helper() {
    let text = "OpCapability Shader
         OpCapability DemoteToHelperInvocation
         OpExtension \"SPV_EXT_demote_to_helper_invocation\"
         OpMemoryModel Logical GLSL450
         OpEntryPoint Fragment %main \"main\" %color
         OpExecutionMode %main OriginUpperLeft
         OpDecorate %color Location 0
         %void = OpTypeVoid
         %signature = OpTypeFunction %void
         %float = OpTypeFloat 32
         %f2 = OpConstant %float 2.0
         %ptr_color = OpTypePointer Output %float
         %color = OpVariable %ptr_color Output
         %main = OpFunction %void None %signature
         %begin = OpLabel
         OpDemoteToHelperInvocation
         OpStore %color %f2
         OpReturn
         OpFunctionEnd";
    let (_, program) =
        build(&assemble(5, text), "main", Stage::Fragment, &Options::default()).unwrap_or_else(|error| panic!("{error}"));
    let resources = Resources::default();
    let uniforms = program.uniforms(&resources);
    let mut executor = Executor::new();
    let mut batch = executor.bind(&program, &resources, &uniforms);
    let outcome = batch.run(3, 0).expect("it ends");
    assert_eq!((outcome.mask, batch.output(0, 0).f32()[0]), (0, 2.0));
}

#[test]
fn the_mask_of_samples_is_an_array_of_one_number() {
    let text = "OpCapability Shader
         OpMemoryModel Logical GLSL450
         OpEntryPoint Fragment %main \"main\" %in %mask
         OpExecutionMode %main OriginUpperLeft
         OpDecorate %in BuiltIn SampleMask
         OpDecorate %in Flat
         OpDecorate %mask BuiltIn SampleMask
         %void = OpTypeVoid
         %signature = OpTypeFunction %void
         %int = OpTypeInt 32 1
         %uint = OpTypeInt 32 0
         %u1 = OpConstant %uint 1
         %i0 = OpConstant %int 0
         %i6 = OpConstant %int 6
         %ints = OpTypeArray %int %u1
         %ptr_in = OpTypePointer Input %ints
         %ptr_mask = OpTypePointer Output %ints
         %ptr_in_int = OpTypePointer Input %int
         %ptr_out_int = OpTypePointer Output %int
         %in = OpVariable %ptr_in Input
         %mask = OpVariable %ptr_mask Output
         %main = OpFunction %void None %signature
         %begin = OpLabel
         %p = OpAccessChain %ptr_in_int %in %i0
         %x = OpLoad %int %p
         %y = OpBitwiseAnd %int %x %i6
         %q = OpAccessChain %ptr_out_int %mask %i0
         OpStore %q %y
         OpReturn
         OpFunctionEnd";
    let (_, program) =
        build(&assemble(0, text), "main", Stage::Fragment, &Options::default()).unwrap_or_else(|error| panic!("{error}"));
    assert!(program.interface().input(BuiltIn::SampleMask).is_some() && program.interface().writes_sample_mask);
}
