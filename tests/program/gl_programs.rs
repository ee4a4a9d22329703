//! Programs of ARB_vertex_program and ARB_fragment_program, replayed: what they draw against arithmetic that is written here.

use fillrate::accuracy::gl::recording::Recording;

/// Operands of the instructions below: program.local[0], [1], [2].
const A: [f64; 4] = [0.75, -1.5, 2.25, -0.5];
const B: [f64; 4] = [-0.5, 1.25, 0.5, 3.0];
const C: [f64; 4] = [1.0, 0.25, -2.0, 0.5];

fn locals(target: &str) -> String {
    let one = |(k, v): (usize, [f64; 4])| {
        format!("glProgramLocalParameter4fARB(GL_{target}_PROGRAM_ARB,{k},{},{},{},{})\n", v[0], v[1], v[2], v[3])
    };
    [A, B, C].into_iter().enumerate().map(one).collect()
}

/// A frame that a program of this stage draws over the whole window.
fn frame(recording: &mut Recording, stage: &str, text: &str, calls: &str) {
    recording.add(&format!(
        "glBindProgramARB(GL_{stage}_PROGRAM_ARB,1)\nglEnable(GL_{stage}_PROGRAM_ARB)\n\
         glProgramStringARB(GL_{stage}_PROGRAM_ARB,GL_PROGRAM_FORMAT_ASCII_ARB,{},\"{text}\")\n{}{calls}\nglRectf(-1,-1,1,1)",
        text.len(),
        locals(stage)
    ));
    recording.end_frame();
}

const HEAD: &str = "PARAM a = program.local[0]; PARAM b = program.local[1]; PARAM c = program.local[2]; TEMP r; MOV r, {0.0, 0.0, 0.0, 0.0};\n";

fn program(stage: &str, instructions: &str) -> String {
    match stage {
        "VERTEX" => format!(
            "!!ARBvp1.0\n{HEAD}ADDRESS A0; PARAM list[4] = {{ program.local[0..2], {{7, 8, 9}} }};\n{instructions}\n\
             MOV result.position, vertex.position;\nMAD result.color, r, 0.125, 0.5;\nEND\n"
        ),
        _ => format!("!!ARBfp1.0\n{HEAD}{instructions}\nMAD result.color, r, {{0.125}}.x, {{0.5, 0.5, 0.5, 0.5}};\nEND\n"),
    }
}

fn shown(value: f64) -> f64 {
    255.0 * (0.125 * value + 0.5).clamp(0.0, 1.0)
}

#[test]
fn instructions_compute_what_the_extensions_say() {
    let dot3 = A[0] * B[0] + A[1] * B[1] + A[2] * B[2];
    let root = |x: f64| 1.0 / x.abs().sqrt();
    // Instruction, result, stages (`v`, `f`).
    let cases: Vec<(&str, [f64; 3], &str)> = vec![
        ("MOV r, a;", [0.75, -1.5, 2.25], "vf"),
        ("MOV r, -a.zyxw;", [-2.25, 1.5, -0.75], "vf"),
        ("MOV r.xz, a;", [0.75, 0.0, 2.25], "vf"),
        ("MOV r.y, a.z;", [0.0, 2.25, 0.0], "vf"),
        ("ABS r, a;", [0.75, 1.5, 2.25], "vf"),
        ("ADD r, a, b;", [0.25, -0.25, 2.75], "vf"),
        ("SUB r, a, b;", [1.25, -2.75, 1.75], "vf"),
        ("MUL r, a, b;", [-0.375, -1.875, 1.125], "vf"),
        ("MUL r.xy, a, -b;", [0.375, 1.875, 0.0], "vf"),
        ("MAD r, a, b, c;", [0.625, -1.625, -0.875], "vf"),
        ("MIN r, a, b;", [-0.5, -1.5, 0.5], "vf"),
        ("MAX r, a, b;", [0.75, 1.25, 2.25], "vf"),
        ("FLR r, a;", [0.0, -2.0, 2.0], "vf"),
        ("FRC r, a;", [0.75, 0.5, 0.25], "vf"),
        ("SGE r, a, b;", [1.0, 0.0, 1.0], "vf"),
        ("SLT r, a, b;", [0.0, 1.0, 0.0], "vf"),
        ("DP3 r, a, b;", [dot3; 3], "vf"),
        ("DP4 r, a, b;", [dot3 - 1.5; 3], "vf"),
        ("DPH r, a, b;", [dot3 + 3.0; 3], "vf"),
        ("DST r, a, b;", [1.0, -1.875, 2.25], "vf"),
        ("XPD r, a, b;", [-1.5 * 0.5 - 2.25 * 1.25, 2.25 * -0.5 - 0.75 * 0.5, 0.75 * 1.25 - 1.5 * 0.5], "vf"),
        ("EX2 r, b.y;", [1.25_f64.exp2(); 3], "vf"),
        ("LG2 r, a.z;", [2.25_f64.log2(); 3], "vf"),
        ("POW r, a.z, b.y;", [2.25_f64.powf(1.25); 3], "vf"),
        ("RCP r, a.w;", [-2.0; 3], "vf"),
        ("RSQ r, a.y;", [root(1.5); 3], "vf"),
        ("LIT r, b.yzxw;", [1.0, 1.25, 0.5_f64.powi(3)], "vf"),
        ("LIT r, a.xyzx;", [1.0, 0.75, 0.0], "vf"),
        ("LIT r, {0.5, 0.0, 0.0, 0.0};", [1.0, 0.5, 1.0], "vf"),
        ("LIT r, {-0.5, 2.0, 0.0, 2.0};", [1.0, 0.0, 0.0], "vf"),
        ("SWZ r, a, z, -1, -x, 0;", [2.25, -1.0, -0.75], "vf"),
        ("EXP r, b.y;", [2.0, 0.25, 1.25_f64.exp2()], "v"),
        ("LOG r, a.y;", [0.0, 1.5, 1.5_f64.log2()], "v"),
        ("ARL A0.x, b.y; MOV r, list[A0.x];", [-0.5, 1.25, 0.5], "v"),
        ("ARL A0.x, c.z; MOV r, list[A0.x + 4];", [1.0, 0.25, -2.0], "v"),
        ("ARL A0.x, b.w; MOV r, list[A0.x - 0];", [7.0, 8.0, 9.0], "v"),
        ("CMP r, a, b, c;", [1.0, 1.25, -2.0], "f"),
        ("LRP r, {0.25}.x, a, b;", [-0.1875, 0.5625, 0.9375], "f"),
        ("COS r, a.z;", [2.25_f64.cos(); 3], "f"),
        ("SIN r, a.z;", [2.25_f64.sin(); 3], "f"),
        ("SCS r.xy, b.y;", [1.25_f64.cos(), 1.25_f64.sin(), 0.0], "f"),
        ("MOV_SAT r, a;", [0.75, 0.0, 1.0], "f"),
        ("MOV r, a.bgra;", [2.25, -1.5, 0.75], "f"),
        ("KIL a.xxzz; MOV r, 1.0;", [1.0; 3], "f"),
        ("MOV r, {1.0, 2.0}; ALIAS q = r; ADD q, q, 1.0;", [2.0, 3.0, 1.0], "vf"),
    ];
    for (letter, stage) in [("v", "VERTEX"), ("f", "FRAGMENT")] {
        let cases: Vec<_> = cases.iter().filter(|(_, _, stages)| stages.contains(letter)).collect();
        let mut recording = Recording::new();
        for (instructions, ..) in &cases {
            frame(&mut recording, stage, &program(stage, instructions), "");
        }
        let seen = recording.centers().expect("a replay");
        assert_eq!(seen.len(), cases.len());
        for ((instructions, wanted, _), seen) in cases.iter().zip(seen) {
            for (value, seen) in wanted.iter().zip(seen) {
                assert!(
                    (shown(*value) - seen).abs() <= 1.0,
                    "{stage} {instructions}: {value} is {}, not {seen}",
                    shown(*value)
                );
            }
        }
    }
}

#[test]
fn state_and_parameters_reach_programs() {
    let calls = "glMatrixMode(GL_MODELVIEW)\nglLoadMatrixf({2,0,0,0,0,4,0,0,0,0,8,0,0.5,0.25,0.125,1})\nglMatrixMode(GL_MATRIX0_ARB)\n\
                 glLoadMatrixf({0.5,0,0,0,1,0.25,0,0,0,0,1,0,0,0,0,1})\nglMatrixMode(GL_PROJECTION)\n\
                 glLightfv(GL_LIGHT2,GL_DIFFUSE,{0.5,0.25,1,1})\nglMaterialfv(GL_FRONT,GL_DIFFUSE,{0.5,1,0.25,1})\n\
                 glMaterialf(GL_FRONT,GL_SHININESS,96)\nglFogf(GL_FOG_DENSITY,0.5)\nglFogf(GL_FOG_START,1)\nglFogf(GL_FOG_END,3)\n\
                 glProgramEnvParameter4fvARB(GL_FRAGMENT_PROGRAM_ARB,200,{0.25,0.5,0.75,1})\nglDepthRange(0.25,1)\n\
                 glTexEnvfv(GL_TEXTURE_ENV,GL_TEXTURE_ENV_COLOR,{0.125,0.25,0.5,1})\nglColor3f(0.5,0.25,0.75)";
    let cases: [(&str, [f64; 3]); 12] = [
        // Rows of the modelview matrix: the last column has the translation.
        ("MOV result.color, state.matrix.modelview.row[0].wxyz;", [0.5, 1.0, 0.0]),
        ("MUL result.color, state.matrix.modelview.inverse.row[1], 2.0;", [0.0, 0.5, 0.0]),
        ("MOV result.color, state.matrix.program[0].row[0];", [0.5, 1.0, 0.0]),
        ("MOV result.color, state.matrix.program[0].transpose.row[1];", [1.0, 0.25, 0.0]),
        ("MOV result.color, state.lightprod[2].diffuse;", [0.25, 0.25, 0.25]),
        ("MUL result.color, state.material.shininess, {0.0078125, 1.0, 1.0, 1.0};", [0.75, 0.0, 0.0]),
        ("MUL result.color, state.fog.params, {1.0, 0.5, 0.25, 1.0};", [0.5, 0.5, 0.75]),
        ("MOV result.color, program.env[200];", [0.25, 0.5, 0.75]),
        ("MOV result.color, state.depth.range;", [0.25, 1.0, 0.75]),
        ("MOV result.color, state.texenv[0].color;", [0.125, 0.25, 0.5]),
        ("MOV result.color, fragment.color;", [0.5, 0.25, 0.75]),
        // The pixel's centre is 4.5 from the left, and 3.5 from the bottom.
        ("MUL result.color, fragment.position, 0.125;", [4.5 / 8.0, 3.5 / 8.0, 0.0]),
    ];
    let mut recording = Recording::new();
    for (k, (instruction, _)) in cases.iter().enumerate() {
        let text = format!("!!ARBfp1.0\n{instruction}\nEND");
        frame(
            &mut recording,
            "FRAGMENT",
            &text,
            &format!(
                "glLoadIdentity()\n{calls}\nglLoadMatrixf({{0.5,0,0,0,0,0.25,0,0,0,0,0,0,-0.25,-0.0625,{},1}})",
                if k == 11 { -1 } else { 0 }
            ),
        );
    }
    let seen = recording.centers().expect("a replay");
    for ((instruction, wanted), seen) in cases.iter().zip(seen) {
        let mut wanted = *wanted;
        if instruction.contains("position") {
            // Depth -1 in clip space is the near end of the depth range.
            wanted[2] = 0.25 / 8.0;
        }
        for (value, seen) in wanted.iter().zip(seen) {
            assert!((255.0 * value - seen).abs() <= 1.0, "{instruction}: {value} is not {seen} / 255");
        }
    }
}

#[test]
fn programs_meet_fixed_functions_and_textures() {
    let mut recording = Recording::new();
    let texels: Vec<u8> = (0..4).flat_map(|k| [40 * k, 200 - 40 * k, 100, 255]).collect();
    recording.texture("GL_RGBA", [2, 2], "GL_RGBA", &texels);
    let vertex = "!!ARBvp1.0\nMOV result.position, vertex.position;\nMOV result.color, vertex.attrib[5];\n\
                  MUL result.texcoord[0], vertex.attrib[3], 2.0;\nMOV result.fogcoord, 3.0;\nEND";
    // 0: a vertex program in front of fixed texturing: texel (1, 1) times the colour.
    frame(
        &mut recording,
        "VERTEX",
        vertex,
        "glEnable(GL_TEXTURE_2D)\nglVertexAttrib4fARB(5,0.5,0.5,1,1)\nglVertexAttrib4NubARB(3,96,96,0,128)",
    );
    // 1: with fog of fixed functions, linear from 1 to 5, of the program's coordinate 3.
    frame(
        &mut recording,
        "VERTEX",
        vertex,
        "glDisable(GL_TEXTURE_2D)\nglEnable(GL_FOG)\nglFogi(GL_FOG_MODE,GL_LINEAR)\nglFogf(GL_FOG_START,1)\nglFogf(GL_FOG_END,5)\n\
         glFogfv(GL_FOG_COLOR,{1,1,0,1})",
    );
    // 2: a fragment program behind fixed functions, whose texture coordinate has q = 2; the unit is off.
    let projected = "!!ARBfp1.0\nTXP result.color, fragment.texcoord[0], texture[0], 2D;\nEND";
    recording.add("glDisable(GL_VERTEX_PROGRAM_ARB)\nglDisable(GL_FOG)\nglTexCoord4f(1.5,0.5,0,2)");
    frame(&mut recording, "FRAGMENT", projected, "");
    // 3: fog by option: exp2(-...) of the eye's distance 0.
    let fogged = "!!ARBfp1.0\nOPTION ARB_fog_linear;\nMOV result.color, {0.2, 0.4, 2.0};\nEND";
    recording.add("glFogCoordf(2)\nglFogi(GL_FOG_COORD_SRC,GL_FOG_COORD)");
    frame(&mut recording, "FRAGMENT", fogged, "");
    // 4: fragments that are killed show the frame before, and an incomplete texture is black.
    frame(&mut recording, "FRAGMENT", "!!ARBfp1.0\nKIL -fragment.texcoord[0];\nMOV result.color, 1.0;\nEND", "");
    frame(&mut recording, "FRAGMENT", "!!ARBfp1.0\nTEX result.color, fragment.texcoord[0], texture[3], CUBE;\nEND", "");
    // 6: position_invariant, with a light of fixed functions that has no effect.
    recording.add("glDisable(GL_FRAGMENT_PROGRAM_ARB)\nglClear(GL_COLOR_BUFFER_BIT)\nglEnable(GL_LIGHTING)");
    frame(
        &mut recording,
        "VERTEX",
        "!!ARBvp1.0\nOPTION ARB_position_invariant;\nMOV result.color, vertex.color;\nEND",
        "glDisable(GL_FOG)\nglColor3f(0.25,0.5,0.75)\nglScalef(0.5,0.5,1)",
    );
    let wanted = [
        [60.0, 40.0, 100.0],
        [0.5 * 127.5 + 127.5, 0.5 * 127.5 + 127.5, 127.5],
        [40.0, 160.0, 100.0],
        [0.75 * 51.0 + 0.25 * 255.0, 0.75 * 102.0 + 0.25 * 255.0, 0.75 * 255.0],
        [0.75 * 51.0 + 0.25 * 255.0, 0.75 * 102.0 + 0.25 * 255.0, 0.75 * 255.0],
        [0.0, 0.0, 0.0],
        [63.75, 127.5, 191.25],
    ];
    for (k, (wanted, seen)) in wanted.iter().zip(recording.centers().expect("a replay")).enumerate() {
        for (value, seen) in wanted.iter().zip(seen) {
            assert!((value - seen).abs() <= 1.0, "frame {k}: {wanted:?}, not {seen}");
        }
    }
}

#[test]
fn arrays_feed_generic_attributes() {
    let mut recording = Recording::new();
    let corners = recording.blob(
        &[[-1.0_f32, -1.0], [3.0, -1.0], [-1.0, 3.0]].as_flattened().iter().flat_map(|v| v.to_le_bytes()).collect::<Vec<u8>>(),
    );
    let colors = recording.blob(&[51, 102, 204, 255, 51, 102, 204, 255, 51, 102, 204, 255]);
    let text = "!!ARBvp1.0\nMOV result.position, vertex.attrib[0];\nMOV result.color, vertex.attrib[9];\nEND";
    recording.add(&format!(
        "glBindProgramARB(GL_VERTEX_PROGRAM_ARB,7)\nglProgramStringARB(GL_VERTEX_PROGRAM_ARB,GL_PROGRAM_FORMAT_ASCII_ARB,{},\"{text}\")\n\
         glEnable(GL_VERTEX_PROGRAM_ARB)\nglEnableVertexAttribArrayARB(0)\nglEnableVertexAttribArrayARB(9)\n\
         glVertexAttribPointerARB(0,2,GL_FLOAT,GL_FALSE,0,{corners})\n\
         glVertexAttribPointerARB(9,4,GL_UNSIGNED_BYTE,GL_TRUE,4,{colors})\nglDrawArrays(GL_TRIANGLES,0,3)",
        text.len()
    ));
    recording.end_frame();
    assert_eq!(recording.centers().expect("a replay"), [[51.0, 102.0, 204.0]]);
}

#[test]
fn wrong_programs_are_named_with_line_column_and_call() {
    let of = |stage: &str, text: &str, draw: bool| {
        let mut recording = Recording::new();
        recording.add(&format!(
            "glBindProgramARB(GL_{stage}_PROGRAM_ARB,1)\n\
             glProgramStringARB(GL_{stage}_PROGRAM_ARB,GL_PROGRAM_FORMAT_ASCII_ARB,{},\"{text}\")",
            text.len()
        ));
        if draw {
            recording.add(&format!("glEnable(GL_{stage}_PROGRAM_ARB)\nglRectf(-1,-1,1,1)"));
        }
        recording.end_frame();
        let (_, report) = recording.import().expect("a recording");
        let errors: Vec<String> = report.errors.iter().map(|(name, count)| format!("{name} @{}", count.first)).collect();
        (errors.join("|"), report.refusal().unwrap_or_default())
    };
    for (stage, text, wanted) in [
        ("VERTEX", "!!ARBvp1.0\nMOV result.position, vertex.positon;\nEND", "line 2, column 28: after this one of position"),
        ("VERTEX", "!!ARBfp1.0\nEND", "line 1, column 1: a program of the other stage"),
        ("VERTEX", "!!VP1.0\nEND", "line 1, column 1: begins with \"!!VP1.0\""),
        ("FRAGMENT", "!!ARBfp1.0\nTEMP r;\nEXP r, r.x;\nEND", "line 3, column 1: EXP is no instruction of this stage"),
        (
            "FRAGMENT",
            "!!ARBfp1.0\nTEMP r;\nTEX r, r, texture[0], SHADOW2D;\nEND",
            "line 3, column 23: texture target SHADOW2D needs OPTION ARB_fragment_program_shadow",
        ),
        ("FRAGMENT", "!!ARBfp1.0\nOPTION NV_fragment_program;\nEND", "line 2, column 8: option NV_fragment_program is not"),
        ("FRAGMENT", "!!ARBfp1.0\nTEMP r, r;\nEND", "line 2, column 9: r is declared twice"),
        ("FRAGMENT", "!!ARBfp1.0\nMOV result.color.yx, 1.0;\nEND", "line 2, column 18: yx is no write mask"),
        ("FRAGMENT", "!!ARBfp1.0\nTEMP r;\nRCP r, r;\nEND", "line 3, column 9: a scalar operand needs one component"),
        ("FRAGMENT", "!!ARBfp1.0\nMOV result.color, 1.0\nEND", "line 3, column 1: `;` is missing before `END`"),
        ("FRAGMENT", "!!ARBfp1.0\nMOV result.color, 1.0;", "where a name is needed"),
    ] {
        let (errors, refusal) = of(stage, text, false);
        assert!(errors.starts_with("glProgramStringARB: GL_INVALID_OPERATION: ") && errors.contains(wanted), "{errors}");
        assert!(errors.ends_with(" @1") && refusal.is_empty(), "{errors}, {refusal}");
        let (_, refusal) = of(stage, text, true);
        assert!(refusal.contains(wanted) && refusal.contains("(call 1)"), "{refusal}");
    }
}
