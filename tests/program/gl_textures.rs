//! Textures: their images, filters, environments, comparisons and samplers.

use fillrate::trace::Reading;

use super::gl_scenes::{
    BLACK, BLUE, GREEN, NEAREST, NEAREST_FILTERS, ORTHO, PASS, PASS_POSITION, QUAD, RED, TEXTURE_AND_QUAD, TEXTURED, last_of,
    near, program, program_of, recorded, refused, refused_with_errors, shown, with_errors,
};

#[test]
fn anisotropy_counts_without_mipmaps_too() {
    // Four texels per pixel along x: black, white, white, black. The two in the middle are all that a bilinear filter reads.
    let texels: Vec<u8> = [0, 255, 255, 0].repeat(16);
    let draw = |more: &str| {
        let calls = format!(
            "glTexParameteri(3553,10241,9729)\nglTexParameteri(3553,10240,9729)\n{more}\nglPixelStorei(GL_UNPACK_ALIGNMENT,1)\n\
             glTexImage2D(3553,0,6409,64,1,0,6409,GL_UNSIGNED_BYTE,*1)\nglTexEnvi(8960,8704,7681)\nglEnable(3553)\nglBegin(GL_QUADS)\n\
             glTexCoord2f(0,0)\nglVertex2f(-1,-1)\nglTexCoord2f(1,0)\nglVertex2f(1,-1)\nglTexCoord2f(1,1)\nglVertex2f(1,1)\n\
             glTexCoord2f(0,1)\nglVertex2f(-1,1)\nglEnd()"
        );
        shown(&calls, &[&texels]).at(7, 7)
    };
    assert_eq!(draw(""), [255; 3]);
    let [filtered, ..] = draw("glTexParameterf(3553,34046,8)");
    assert!((100..200).contains(&filtered), "{filtered}");
}

#[test]
fn srgb_is_decoded_from_textures_and_encoded_to_the_window() {
    let texel = [188, 188, 188, 128_u8].repeat(4);
    let draw = |set: &str| {
        let calls = format!(
            "glTexParameteri(GL_TEXTURE_2D,GL_TEXTURE_MIN_FILTER,9728)\nglTexImage2D(GL_TEXTURE_2D,0,35907,2,2,0,GL_RGBA,GL_UNSIGNED_BYTE,*1)\n\
             glTexEnvi(8960,8704,7681)\nglEnable(GL_TEXTURE_2D)\n{set}\nglClearColor(0.5,0,0,1)\nglClear(16384)\nglRectf(0,0,1,1)"
        );
        shown(&calls, &[&texel])
    };
    // 188 stands for 0.503 of white.
    let linear = draw("");
    assert!(near(linear.at(12, 12), [128; 3]) && near(linear.at(2, 2), [128, 0, 0]), "{:?}", linear.at(12, 12));
    let encoded = draw("glEnable(36281)");
    assert!(near(encoded.at(12, 12), [188; 3]) && near(encoded.at(2, 2), [188, 0, 0]), "{:?}", encoded.at(12, 12));
    let off = draw("glEnable(36281)\nglDisable(36281)");
    assert_eq!(off.0, linear.0);
}

#[test]
fn images_may_have_another_size_between_two_uses() {
    // Two texels wide, used; then four, without contents; then two again.
    let image = |width: u32, bytes: &str| {
        format!("glTexImage2D(GL_TEXTURE_2D,0,GL_DEPTH_COMPONENT16,{width},1,0,GL_DEPTH_COMPONENT,GL_UNSIGNED_SHORT,{bytes})\n")
    };
    let filters = "glTexParameteri(GL_TEXTURE_2D,GL_TEXTURE_MIN_FILTER,GL_NEAREST)\nglTexParameteri(GL_TEXTURE_2D,GL_TEXTURE_MAG_FILTER,GL_NEAREST)\n";
    let calls =
        format!("{filters}{}{TEXTURE_AND_QUAD}{}{}{TEXTURE_AND_QUAD}", image(2, "*1"), image(4, "U0x0"), image(2, "*2"));
    let seen = shown(&calls, &[&[0, 0, 0, 0], &[0, 128, 255, 255]]);
    assert!(near(seen.at(4, 8), [128; 3]) && near(seen.at(12, 8), [255; 3]), "{:?} {:?}", seen.at(4, 8), seen.at(12, 8));
}

#[test]
fn depths_of_a_texture_are_compared_with_the_third_coordinate() {
    // A surface at depth 0.5 in the left half, and none behind it; the third coordinate is 0.7.
    let calls = "glEnable(GL_DEPTH_TEST)\nglRectf(-1,-1,0,1)\nglBindTexture(GL_TEXTURE_2D,1)\n\
         glTexParameteri(GL_TEXTURE_2D,GL_TEXTURE_MIN_FILTER,GL_NEAREST)\n\
         glCopyTexImage2D(GL_TEXTURE_2D,0,GL_DEPTH_COMPONENT,0,0,16,16,0)\n\
         glTexParameteri(GL_TEXTURE_2D,GL_TEXTURE_COMPARE_MODE,GL_COMPARE_R_TO_TEXTURE)\nglDisable(GL_DEPTH_TEST)\n\
         glTranslatef(0,0,0)\nglEnable(GL_TEXTURE_2D)\nglBegin(GL_QUADS)\nglTexCoord3f(0,0,0.7)\nglVertex2f(-1,-1)\nglTexCoord3f(1,0,0.7)\n\
         glVertex2f(1,-1)\nglTexCoord3f(1,1,0.7)\nglVertex2f(1,1)\nglTexCoord3f(0,1,0.7)\nglVertex2f(-1,1)\nglEnd()";
    let image = shown(calls, &[]);
    assert_eq!([image.at(2, 5), image.at(13, 5)], [BLACK, [255; 3]]);
    // By programs in assembly and in GLSL, of both dialects.
    let text =
        "!!ARBfp1.0\nOPTION ARB_fragment_program_shadow;\nTEX result.color, fragment.texcoord[0], texture[0], SHADOW2D;\nEND";
    let assembly = format!(
        "glEnable(GL_FRAGMENT_PROGRAM_ARB)\nglProgramStringARB(GL_FRAGMENT_PROGRAM_ARB,GL_PROGRAM_FORMAT_ASCII_ARB,{},\"{text}\")",
        text.len()
    );
    let glsl = |text: &str| {
        format!(
            "glCreateShader(GL_FRAGMENT_SHADER)=7\nglShaderSource(7,1,\"{text}\",0)\nglCompileShader(7)\nglCreateProgram()=8\n\
             glAttachShader(8,7)\nglLinkProgram(8)\nglUseProgram(8)"
        )
    };
    let old = glsl("uniform sampler2DShadow t; void main() { gl_FragColor = shadow2D(t, gl_TexCoord[0].xyz); }");
    let new =
        glsl("#version 130\nuniform sampler2DShadow t; out vec4 c; void main() { c = vec4(texture(t, gl_TexCoord[0].xyz)); }");
    for program in [assembly, old, new] {
        let image = shown(&calls.replace("glEnable(GL_TEXTURE_2D)", &program), &[]);
        assert_eq!([image.at(2, 5), image.at(13, 5)], [BLACK, [255; 3]], "{program}");
    }
    // The values as they are stored: half and one.
    let plain = calls.replace("GL_COMPARE_R_TO_TEXTURE", "GL_NONE");
    let image = shown(&plain, &[]);
    assert!(near(image.at(2, 5), [128; 3]) && image.at(13, 5) == [255; 3], "{:?}", image.at(2, 5));
}

#[test]
fn compressed_blocks_are_kept_and_parts_replace_them() {
    // Blocks of one colour: its code twice, then codes 0.
    let block = |code: u16| [code.to_le_bytes(), code.to_le_bytes()].concat().into_iter().chain([0; 4]).collect::<Vec<u8>>();
    let (red, blue) = (block(0xf800), block(0x001f));
    let image = [red.clone(), red.clone(), red.clone(), red].concat();
    let setup = "glBindTexture(GL_TEXTURE_2D,1)\nglTexParameteri(GL_TEXTURE_2D,GL_TEXTURE_MIN_FILTER,GL_NEAREST)\n\
        glTexParameteri(GL_TEXTURE_2D,GL_TEXTURE_MAG_FILTER,GL_NEAREST)\n";
    let picture = shown(
        &format!(
            "{setup}glCompressedTexImage2DARB(GL_TEXTURE_2D,0,GL_COMPRESSED_RGB_S3TC_DXT1_EXT,8,8,0,32,*1)\n\
             glCompressedTexSubImage2DARB(GL_TEXTURE_2D,0,4,0,4,4,GL_COMPRESSED_RGB_S3TC_DXT1_EXT,8,*2)\n{TEXTURE_AND_QUAD}\n"
        ),
        &[&image, &blue],
    );
    assert_eq!([picture.at(0, 0), picture.at(15, 0), picture.at(8, 7), picture.at(15, 8)], [RED, BLUE, BLUE, RED]);
    // Two by two texels are no whole block.
    let picture = shown(
        &format!(
            "{setup}glCompressedTexImage2DARB(GL_TEXTURE_2D,0,GL_COMPRESSED_RGB_S3TC_DXT1_EXT,2,2,0,8,*1)\n{TEXTURE_AND_QUAD}\n"
        ),
        &[&blue],
    );
    assert_eq!(picture.at(3, 9), BLUE);
}

#[test]
fn a_border_is_left_out() {
    let mut texels = [[9, 9, 9, 255]; 16];
    for (k, color) in [(5, RED), (6, GREEN), (9, BLUE), (10, [255; 3])] {
        texels[k] = [color[0], color[1], color[2], 255];
    }
    let image = shown(
        &format!(
            "glTexParameteri(GL_TEXTURE_2D,GL_TEXTURE_MIN_FILTER,GL_NEAREST)\nglTexParameteri(GL_TEXTURE_2D,GL_TEXTURE_MAG_FILTER,GL_NEAREST)\n\
             glTexImage2D(GL_TEXTURE_2D,0,GL_RGBA,4,4,1,GL_RGBA,GL_UNSIGNED_BYTE,*1)\n{TEXTURE_AND_QUAD}"
        ),
        &[texels.as_flattened()],
    );
    assert_eq!([image.at(0, 0), image.at(15, 0), image.at(0, 15), image.at(15, 15)], [RED, GREEN, BLUE, [255; 3]]);
}

#[test]
fn floating_point_texels_are_kept_with_their_channels() {
    let bytes: Vec<u8> = [3.0_f32, 0.5, -1.0, 1.0].iter().flat_map(|value| value.to_le_bytes()).collect();
    let seen = |internal: &str, result: &str| {
        let fragment =
            format!("uniform sampler2D t; void main() {{ vec4 v = texture2D(t, vec2(0.5)); gl_FragColor = {result}; }}");
        let calls = format!(
            "glBindTexture(GL_TEXTURE_2D,1)\nglTexParameteri(GL_TEXTURE_2D,GL_TEXTURE_MIN_FILTER,GL_NEAREST)\n\
             glTexImage2D(GL_TEXTURE_2D,0,{internal},1,1,0,GL_RGBA,GL_FLOAT,*1)\n{}glRectf(-1,-1,1,1)",
            program(10, PASS, &fragment)
        );
        shown(&calls, &[&bytes]).at(8, 8)
    };
    for internal in ["GL_RGBA16F_ARB", "GL_RGBA32F_ARB"] {
        assert!(near(seen(internal, "vec4(v.r / 6.0, v.g, v.b + 1.25, 1.0)"), [128, 128, 64]));
    }
    // Red, and red with green; blue is 0 there. 33325 is GL_R16F, 33328 GL_RG32F.
    assert!(near(seen("33325", "vec4(v.r / 6.0, v.g, v.b, 1.0)"), [128, 0, 0]));
    assert!(near(seen("33328", "vec4(v.r / 6.0, v.g, v.b, 1.0)"), [128, 128, 0]));
    assert!(near(seen("GL_LUMINANCE32F_ARB", "v / 6.0"), [128, 128, 128]));
}

#[test]
fn what_is_read_of_a_texture_is_swizzled() {
    // 36422 is GL_TEXTURE_SWIZZLE_RGBA, 36419 GL_TEXTURE_SWIZZLE_G, 33321 GL_R8.
    let seen = |swizzle: &str| {
        let calls = format!(
            "glBindTexture(GL_TEXTURE_2D,1)\nglTexParameteri(GL_TEXTURE_2D,GL_TEXTURE_MIN_FILTER,GL_NEAREST)\n\
             glPixelStorei(GL_UNPACK_ALIGNMENT,1)\nglTexImage2D(GL_TEXTURE_2D,0,33321,1,1,0,GL_RED,GL_UNSIGNED_BYTE,*1)\n\
             {swizzle}\nglEnable(GL_TEXTURE_2D)\nglTexEnvi(GL_TEXTURE_ENV,GL_TEXTURE_ENV_MODE,GL_REPLACE)\n{QUAD}"
        );
        shown(&calls, &[&[102]]).at(8, 8)
    };
    assert_eq!(seen(""), [102, 0, 0]);
    assert_eq!(seen("glTexParameteriv(GL_TEXTURE_2D,36422,{GL_ZERO,GL_RED,GL_ONE,GL_ONE})"), [0, 102, 255]);
    assert_eq!(seen("glTexParameteri(GL_TEXTURE_2D,36419,GL_RED)"), [102, 102, 0]);
}

#[test]
fn a_cube_map_is_read_in_all_directions_and_not_over_the_edges_of_faces() {
    // Faces of one texel: red on the positive sides, green on the negative ones.
    let faces: String = ["POSITIVE_X", "NEGATIVE_X", "POSITIVE_Y", "NEGATIVE_Y", "POSITIVE_Z", "NEGATIVE_Z"]
        .iter()
        .enumerate()
        .map(|(k, face)| {
            format!("glTexImage2D(GL_TEXTURE_CUBE_MAP_{face},0,GL_RGB,1,1,0,GL_RGB,GL_UNSIGNED_BYTE,*{})\n", 1 + k % 2)
        })
        .collect();
    for wrap in ["GL_CLAMP", "GL_CLAMP_TO_EDGE", "GL_REPEAT"] {
        let at = |coordinates: &str| {
            let calls = format!(
                "glPixelStorei(GL_UNPACK_ALIGNMENT,1)\nglBindTexture(GL_TEXTURE_CUBE_MAP,1)\n{faces}\
                 glTexParameteri(GL_TEXTURE_CUBE_MAP,GL_TEXTURE_MIN_FILTER,GL_LINEAR)\n\
                 glTexParameteri(GL_TEXTURE_CUBE_MAP,GL_TEXTURE_WRAP_S,{wrap})\n\
                 glTexParameteri(GL_TEXTURE_CUBE_MAP,GL_TEXTURE_WRAP_T,{wrap})\n\
                 glEnable(GL_TEXTURE_CUBE_MAP)\nglTexEnvi(GL_TEXTURE_ENV,GL_TEXTURE_ENV_MODE,GL_REPLACE)\n\
                 glTexCoord4f({coordinates})\nglBegin(GL_QUADS)\nglVertex2f(-1,-1)\nglVertex2f(1,-1)\nglVertex2f(1,1)\n\
                 glVertex2f(-1,1)\nglEnd()"
            );
            shown(&calls, &[&[255, 0, 0], &[0, 255, 0]]).at(8, 8)
        };
        // A direction has no length, and its last coordinate means nothing.
        assert_eq!([at("2,0.1,0,1"), at("-2,0.1,0,1"), at("0,0.1,-0.5,0")], [RED, GREEN, GREEN], "{wrap}");
        // Beside the edge of a face nothing of the next face is seen.
        assert_eq!([at("1,-0.9,0,1"), at("0.9,-1,0,1")], [RED, GREEN], "{wrap}");
    }
}

#[test]
fn a_sampler_takes_the_place_of_the_textures_own() {
    let bytes = [255, 0, 0, 0, 255, 0];
    let seen = |calls: &str| {
        let calls = format!(
            "glPixelStorei(GL_UNPACK_ALIGNMENT,1)\nglBindTexture(GL_TEXTURE_2D,1)\n\
             glTexParameteri(GL_TEXTURE_2D,GL_TEXTURE_MIN_FILTER,GL_NEAREST)\n\
             glTexImage2D(GL_TEXTURE_2D,0,GL_RGB,2,1,0,GL_RGB,GL_UNSIGNED_BYTE,*1)\nglEnable(GL_TEXTURE_2D)\n\
             glTexEnvi(GL_TEXTURE_ENV,GL_TEXTURE_ENV_MODE,GL_REPLACE)\n\
             glSamplerParameteri(5,GL_TEXTURE_MIN_FILTER,GL_NEAREST)\nglSamplerParameteri(5,GL_TEXTURE_MAG_FILTER,GL_NEAREST)\n\
             glSamplerParameteri(5,GL_TEXTURE_WRAP_S,GL_CLAMP_TO_EDGE)\n{calls}\nglTexCoord2f(2.25,0.5)\n{QUAD}"
        );
        shown(&calls, &[&bytes]).at(8, 8)
    };
    assert_eq!([seen(""), seen("glBindSampler(0,5)"), seen("glBindSampler(0,5)\nglBindSampler(0,0)")], [RED, GREEN, RED]);
}

#[test]
fn biases_of_textures_move_levels_that_shaders_give() {
    // Levels of 2 and of 1 texels.
    let levels = |internal: &str, format: &str| {
        format!(
            "glTexParameteri(GL_TEXTURE_2D,GL_TEXTURE_MIN_FILTER,GL_NEAREST_MIPMAP_NEAREST)\n\
             glTexImage2D(GL_TEXTURE_2D,0,{internal},2,1,0,{format},GL_UNSIGNED_BYTE,*1)\n\
             glTexImage2D(GL_TEXTURE_2D,1,{internal},1,1,0,{format},GL_UNSIGNED_BYTE,*2)\n"
        )
    };
    let vertex = "void main() { gl_Position = gl_Vertex; }";
    let by = |sampler: &str, read: &str| {
        program(10, vertex, &format!("uniform {sampler} t; void main() {{ gl_FragColor = {read}; }}"))
    };
    let reads = [
        "texture2DGradARB(t, vec2(0.5), vec2(0.001), vec2(0.001))",
        "texture2DLod(t, vec2(0.5), 0.0)",
        "texture2D(t, gl_FragCoord.xy / 64.0, 0.0)",
        "texture2D(t, gl_FragCoord.xy / 64.0)",
    ];
    let texels: [&[u8]; 2] = [&[255, 0, 0, 255, 255, 0, 0, 255], &[0, 0, 255, 255]];
    let of_texture = "glTexParameterf(GL_TEXTURE_2D,GL_TEXTURE_LOD_BIAS,20)\n";
    let of_sampler = "glSamplerParameteri(3,GL_TEXTURE_MIN_FILTER,GL_NEAREST_MIPMAP_NEAREST)\nglSamplerParameterf(3,GL_TEXTURE_LOD_BIAS,20)\n\
        glBindSampler(0,3)\n";
    for (bias, wanted) in [("", RED), (of_texture, BLUE), (of_sampler, BLUE)] {
        for read in reads {
            let calls = format!("{}{bias}{}{QUAD}", levels("GL_RGBA", "GL_RGBA"), by("sampler2D", read));
            assert_eq!(shown(&calls, &texels).at(8, 8), wanted, "{bias}{read}");
        }
    }
    // Depths have no bias in WGSL.
    let depths: [&[u8]; 2] = [&[255, 255, 0, 0], &[255]];
    for (bias, read, refused) in [
        ("", "shadow2D(t, vec3(0.5))", false),
        ("", "shadow2D(t, vec3(0.5), 1.0)", true),
        ("", "shadow2DLod(t, vec3(0.5), 1.0)", true),
        (of_texture, "shadow2D(t, vec3(0.5))", true),
    ] {
        let compare = "glTexParameteri(GL_TEXTURE_2D,GL_TEXTURE_COMPARE_MODE,GL_COMPARE_R_TO_TEXTURE)\n";
        let calls = format!(
            "{}{compare}{bias}{}{QUAD}",
            levels("GL_DEPTH_COMPONENT", "GL_DEPTH_COMPONENT"),
            by("sampler2DShadow", read)
        );
        let refusal = recorded(&calls, &depths, 0..u64::MAX, &Reading::default()).1.refusal();
        assert_eq!(refusal.is_some_and(|what| what.starts_with("depth textures with several levels")), refused, "{bias}{read}");
    }
}

const TEXEL: &str = "glTexImage2D(3553,0,6408,1,1,0,6408,5121,*1)\n";

#[test]
fn combiners_have_the_functions_of_extensions() {
    // The texel is a third, the primary colour a half, the constant 0.2; the results are sums of products.
    let start = format!(
        "{NEAREST_FILTERS}{TEXEL}glColor3f(0.5,0.5,0.5)\nglTexEnvfv(8960,GL_TEXTURE_ENV_COLOR,{{0.2,0.2,0.2,1}})\nglTexEnvi(8960,8704,GL_COMBINE)\n\
         glTexEnvi(8960,GL_SRC0_RGB,GL_TEXTURE)\nglTexEnvi(8960,GL_SRC1_RGB,GL_CONSTANT)\nglTexEnvi(8960,GL_SRC2_RGB,GL_PRIMARY_COLOR)\n\
         glTexEnvi(8960,GL_OPERAND2_RGB,GL_SRC_COLOR)\n"
    );
    let of = |calls: &str| {
        let calls = calls.replace("env(", "glTexEnvi(8960,");
        shown(&format!("{start}{calls}\n{QUAD}"), &[&[85, 85, 85, 255]]).at(8, 8)[0]
    };
    let close = |value: u8, wanted: f32| (f32::from(value) - 255.0 * wanted).abs() <= 1.0;
    // Functions of ATI_texture_env_combine3.
    for (function, wanted) in [(0x8744, 0.5 / 3.0 + 0.2), (0x8745, 0.0), (0x8746, 0.0)] {
        assert!(close(of(&format!("env(GL_COMBINE_RGB,{function})")), wanted), "{function:x}");
    }
    let brighter = "env(GL_OPERAND0_RGB,GL_ONE_MINUS_SRC_COLOR)\nenv(GL_SRC2_RGB,1)\n";
    assert!(close(of(&format!("{brighter}env(GL_COMBINE_RGB,{})", 0x8745)), 2.0 / 3.0 + 0.2 - 0.5));
    assert!(close(of(&format!("{brighter}env(GL_COMBINE_RGB,{})", 0x8746)), 2.0 / 3.0 - 0.2));
    assert!(close(of("env(GL_SRC0_RGB,0)\nenv(GL_COMBINE_RGB,GL_ADD)"), 0.2));
    // Four arguments: a third of 0.2 and half of 1 - 0.2.
    let four = format!("env(8704,{})\nenv({},GL_CONSTANT)\nenv({},GL_ONE_MINUS_SRC_COLOR)\n", 0x8503, 0x8583, 0x8593);
    assert!(close(of(&format!("{four}env(GL_COMBINE_RGB,GL_ADD)\nenv(GL_COMBINE_ALPHA,GL_ADD)")), 0.2 / 3.0 + 0.4));
    let signed = format!("{four}env(GL_SRC2_RGB,1)\nenv(GL_COMBINE_RGB,GL_ADD_SIGNED)\nenv(GL_COMBINE_ALPHA,GL_ADD)");
    assert!(close(of(&signed), 0.2 / 3.0 + 0.8 - 0.5));
    let other = refused(&format!("{start}glTexEnvi(8960,8704,34051)\n{QUAD}"), &[&[85, 85, 85, 255]]);
    assert!(other.starts_with("GL_COMBINE4_NV with a function"), "{other}");
    // Dot products of EXT_texture_env_dot3 are not scaled.
    let dot = format!("{start}glTexEnvi(8960,GL_COMBINE_RGB,{})\n", 0x8740);
    let shown_dot = shown(&format!("{dot}{QUAD}"), &[&[85, 85, 85, 255]]).at(8, 8)[0];
    assert!(close(shown_dot, 4.0 * 3.0 * (1.0 / 6.0) * 0.3), "{shown_dot}");
    assert!(refused(&format!("{dot}glTexEnvf(8960,GL_RGB_SCALE,2)\n{QUAD}"), &[&[85, 85, 85, 255]]).contains("dot products"));
    // Operands of alpha are alphas.
    let errors =
        with_errors(&format!("glTexEnvi(8960,GL_OPERAND0_ALPHA,GL_SRC_COLOR)\nglTexEnvi(8960,8704,17185)\n{QUAD}"), &[]).1;
    assert_eq!(errors, 2);
}

#[test]
fn textures_are_mirrored_once() {
    // What Mesa reads of a red and a blue texel with a green border, at these places and at the same with a minus.
    const PLACES: [f32; 6] = [0.0, 0.125, 0.5, 0.875, 1.0, 1.25];
    let (half, some, mixed, much) = ([128, 128, 0], [191, 64, 0], [128, 0, 128], [0, 64, 191]);
    let edge = [0, 128, 128];
    let rows = [
        (0x8742, 9728, [RED, RED, BLUE, BLUE, BLUE, BLUE]),
        (0x8742, 9729, [half, some, mixed, much, edge, edge]),
        (0x8743, 9728, [RED, RED, BLUE, BLUE, BLUE, BLUE]),
        (0x8743, 9729, [RED, RED, mixed, BLUE, BLUE, BLUE]),
        (0x8912, 9728, [RED, RED, BLUE, BLUE, GREEN, GREEN]),
        (0x8912, 9729, [half, some, mixed, much, edge, GREEN]),
    ];
    for (wrap, filter, wanted) in rows {
        let columns: String = (0..12)
            .map(|k| {
                let (u, x) = (if k < 6 { PLACES[k] } else { -PLACES[k - 6] }, k);
                format!("glTexCoord2f({u},0.5)\nglRecti({x},0,{},16)\n", x + 1)
            })
            .collect();
        let calls = format!(
            "{ORTHO}{NEAREST_FILTERS}glTexEnvi(8960,8704,7681)\nglTexParameteri(3553,10241,{filter})\nglTexParameteri(3553,10240,{filter})\n\
             glTexParameteri(3553,10242,{wrap})\nglTexParameterfv(3553,4100,{{0,1,0,1}})\nglTexImage2D(3553,0,6408,2,1,0,6408,5121,*1)\n{columns}"
        );
        let image = shown(&calls, &[&[255, 0, 0, 255, 0, 0, 255, 255]]);
        for k in 0..12 {
            assert!(near(image.at(k, 8), wanted[k % 6]), "{wrap:x} {filter} at {k}: {:?}", image.at(k, 8));
        }
    }
    // An unknown mode is an error, as are others than clamping for rectangles.
    let errors = with_errors(
        "glTexParameteri(3553,10242,77)\nglTexParameteri(34037,10242,GL_REPEAT)\nglTexParameteri(34037,10242,GL_CLAMP)\nglTexParameteri(3553,7,1)",
        &[],
    )
    .1;
    assert_eq!(errors, 3);
    for call in ["glTexParameteri(3553,37734,32775)", "glTexParameteri(3553,37098,6401)", "glTexParameteri(34067,34895,1)"] {
        assert!(!refused(call, &[]).is_empty(), "{call}");
    }
}

#[test]
fn compressed_textures_of_one_and_two_channels_are_stored_as_texels() {
    for (internal, wanted) in [(0x8225, RED), (0x8226, [255, 128, 0])] {
        let calls =
            format!("{NEAREST_FILTERS}glTexEnvi(8960,8704,7681)\nglTexImage2D(3553,0,{internal},1,1,0,6408,5121,*1)\n{QUAD}");
        assert!(near(shown(&calls, &[&[255, 128, 64, 255]]).at(8, 8), wanted), "{internal:x}");
    }
}

#[test]
fn borders_of_textures_have_any_colour() {
    // A green texel in the middle half; around it is the border. Both wrap modes are GL_CLAMP_TO_BORDER.
    let around =
        "glTexParameteri(3553,10242,33069)\nglTexParameteri(3553,10243,33069)\nglTexParameterfv(3553,4100,{1,0.5,0.25,0.5})\n";
    let wide = TEXTURED.replace("Coord2f(0,0)", "Coord2f(-0.5,-0.5)").replace("Coord2f(1,0)", "Coord2f(1.5,-0.5)");
    let wide = wide.replace("Coord2f(1,1)", "Coord2f(1.5,1.5)").replace("Coord2f(0,1)", "Coord2f(-0.5,1.5)");
    let draw = |filter: &str, internal: u32, format: &str, texel: &[u8]| {
        let calls = format!(
            "{NEAREST}{filter}{around}glPixelStorei(GL_UNPACK_ALIGNMENT,1)\nglTexImage2D(3553,0,{internal},1,1,0,{format},GL_UNSIGNED_BYTE,*1)\n{wide}"
        );
        shown(&calls, &[texel])
    };
    let image = draw("", 6408, "GL_RGBA", &[0, 255, 0, 255]);
    assert_eq!((image.at(8, 8), image.at(5, 10)), (GREEN, GREEN));
    assert!(near(image.at(1, 1), [255, 128, 64]) && near(image.at(14, 8), [255, 128, 64]), "{:?}", image.at(1, 1));
    // Luminance has the border's red.
    let image = draw("", 6409, "GL_LUMINANCE", &[0]);
    assert!(near(image.at(1, 1), [255; 3]) && image.at(8, 8) == BLACK);
    // A linear filter mixes: at the centre of the pixel the coordinates are 1/16 and 9/16, the texel's centre is 1/2: it has 9/16 of 15/16.
    let image =
        draw("glTexParameteri(3553,10241,9729)\nglTexParameteri(3553,10240,9729)\n", 6408, "GL_RGBA", &[0, 255, 0, 255]);
    let mixed = image.at(4, 8);
    assert!(near(mixed, [121, 195, 30]), "{mixed:?}");
}

#[test]
fn automatic_mipmaps_follow_parts_and_copies_and_have_three_dimensions() {
    // A black texture of 16 x 16 whose left half becomes white: at an eighth of its size each texel is a mean.
    let start = "glTexParameteri(3553,10241,9984)\nglTexEnvi(8960,8704,7681)\nglEnable(3553)\nglTexParameteri(3553,33169,1)\n\
        glPixelStorei(GL_UNPACK_ALIGNMENT,1)\nglTexImage2D(3553,0,6407,16,16,0,GL_RGB,GL_UNSIGNED_BYTE,*1)\n";
    let small = "glBegin(GL_QUADS)\nglTexCoord2f(0,0)\nglVertex2f(-1,-1)\nglTexCoord2f(16,0)\nglVertex2f(1,-1)\nglTexCoord2f(16,16)\n\
        glVertex2f(1,1)\nglTexCoord2f(0,16)\nglVertex2f(-1,1)\nglEnd()\n";
    let (black, white) = (vec![0; 768], vec![255; 384]);
    let image =
        shown(&format!("{start}glTexSubImage2D(3553,0,0,0,8,16,GL_RGB,GL_UNSIGNED_BYTE,*2)\n{small}"), &[&black, &white]);
    assert!(near(image.at(7, 7), [128; 3]), "{:?}", image.at(7, 7));
    let image = shown(
        &format!(
            "{start}glClearColor(1,0,0,1)\nglClear(16384)\nglCopyTexSubImage2D(3553,0,0,0,0,0,16,8)\nglClearColor(0,0,0,1)\nglClear(16384)\n{small}"
        ),
        &[&black],
    );
    assert!(near(image.at(7, 7), [128, 0, 0]), "{:?}", image.at(7, 7));
    // One of eight texels is white.
    let mut cube = vec![0; 24];
    cube[21..24].fill(255);
    let image = shown(
        "glTexParameteri(32879,10241,9984)\nglTexEnvi(8960,8704,7681)\nglEnable(32879)\nglTexParameteri(32879,33169,1)\n\
         glPixelStorei(GL_UNPACK_ALIGNMENT,1)\nglTexImage3D(32879,0,6407,2,2,2,0,GL_RGB,GL_UNSIGNED_BYTE,*1)\n\
         glTexParameteri(32879,33084,1)\nglRectf(-1,-1,1,1)",
        &[&cube],
    );
    assert!(near(image.at(7, 7), [32; 3]), "{:?}", image.at(7, 7));
}

#[test]
fn slices_of_three_dimensions_are_copied_from_the_window() {
    let image = shown(
        "glTexParameteri(32879,10241,9728)\nglTexParameteri(32879,10240,9728)\nglTexEnvi(8960,8704,7681)\n\
         glTexImage3D(32879,0,6408,16,16,2,0,GL_RGBA,GL_UNSIGNED_BYTE,U0x0)\nglClearColor(1,0,0,1)\nglClear(16384)\n\
         glEnable(GL_SCISSOR_TEST)\nglScissor(0,0,16,4)\nglClearColor(0,1,0,1)\nglClear(16384)\nglDisable(GL_SCISSOR_TEST)\n\
         glCopyTexSubImage3D(32879,0,0,0,1,0,0,16,16)\nglClearColor(0,0,0,1)\nglClear(16384)\nglEnable(32879)\nglBegin(GL_QUADS)\n\
         glTexCoord3f(0,0,0.75)\nglVertex2f(-1,-1)\nglTexCoord3f(1,0,0.75)\nglVertex2f(1,-1)\nglTexCoord3f(1,1,0.75)\nglVertex2f(1,1)\n\
         glTexCoord3f(0,1,0.75)\nglVertex2f(-1,1)\nglEnd()",
        &[],
    );
    assert_eq!([image.at(3, 1), image.at(3, 12)], [GREEN, RED]);
}

/// A texture of one texel, with nearest filters, at each of these units.
fn textures(units: impl Iterator<Item = usize>) -> String {
    let one = |(k, unit): (usize, usize)| {
        format!(
            "glActiveTexture({})\nglBindTexture(3553,{})\nglTexParameteri(3553,10241,9728)\nglTexParameteri(3553,10240,9728)\n\
             glTexImage2D(3553,0,6408,1,1,0,6408,5121,*{})\n",
            0x84c0 + unit,
            k + 1,
            k + 1
        )
    };
    units.enumerate().map(one).collect()
}

const READ: &str = "uniform sampler2D s; void main() { gl_FragColor = texture2D(s, vec2(0.5)); }";

#[test]
fn each_texture_unit_keeps_its_texture() {
    let units = [0, 1, 7, 8, 9, 15, 31, 32, 100, 191];
    let texels: Vec<[u8; 4]> = (0..units.len() as u8).map(|k| [20 * k + 10, 200 - 20 * k, k, 255]).collect();
    let buffers: Vec<&[u8]> = texels.iter().map(|texel| &texel[..]).collect();
    for (unit, texel) in units.iter().zip(&texels) {
        let calls = format!(
            "{}{}glGetUniformLocation(3,\"s\")=1\nglUniform1i(1,{unit})\n{QUAD}",
            textures(units.into_iter()),
            program_of(PASS_POSITION, READ)
        );
        assert_eq!(shown(&calls, &buffers).at(8, 8), texel[..3], "unit {unit}");
    }
    // A unit without a texture is black, and the one behind the last is an error that changes no unit.
    let calls = format!("{}glUniform1i(1,30)\n{QUAD}", program_of(PASS_POSITION, READ) + "glGetUniformLocation(3,\"s\")=1\n");
    assert_eq!(shown(&calls, &[]).at(8, 8), BLACK);
    let wrong = format!("{}glActiveTexture({})\nglBindTexture(3553,2)\n", textures([5].into_iter()), 0x84c0 + 192);
    assert_eq!(refused_with_errors(&wrong, &[&[0; 4]]), (String::new(), vec!["glActiveTexture: GL_INVALID_ENUM".into()]));
}

#[test]
fn further_units_have_samplers_and_no_fixed_functions() {
    // Between a black and a white texel the sampler of the unit filters, the texture does not.
    let calls = format!(
        "glActiveTexture({})\nglBindTexture(3553,1)\nglTexParameteri(3553,10241,9728)\nglTexParameteri(3553,10240,9728)\n\
         glTexImage2D(3553,0,6408,2,1,0,6408,5121,*1)\nglBindSampler(20,5)\nglSamplerParameteri(5,10241,9729)\n\
         glSamplerParameteri(5,10240,9729)\n{}glGetUniformLocation(3,\"s\")=1\nglUniform1i(1,20)\n{QUAD}",
        0x84c0 + 20,
        program_of(PASS_POSITION, READ)
    );
    let texels = [0, 0, 0, 255, 255, 255, 255, 255];
    assert!(near(shown(&calls, &[&texels]).at(8, 8), [128; 3]));
    // They have no matrices, and what is enabled there does not texture.
    let active = format!("glActiveTexture({})\n", 0x84c0 + 9);
    let image = shown(&format!("{}{active}glEnable(3553)\n{QUAD}", textures([9].into_iter())), &[&[255, 0, 0, 255]]);
    assert_eq!(image.at(8, 8), [255; 3]);
    let matrix = format!("{active}glMatrixMode(GL_TEXTURE)\nglTranslatef(1,0,0)\nglPushMatrix()\n");
    assert_eq!(
        refused_with_errors(&matrix, &[]).1,
        ["glPushMatrix: GL_INVALID_OPERATION", "glTranslatef: GL_INVALID_OPERATION"]
    );
    // What is saved comes back, also of units that were first used after that.
    let texel = [0, 255, 0, 255];
    let saved = format!(
        "glPushAttrib(GL_TEXTURE_BIT)\n{}glPopAttrib()\n{}glGetUniformLocation(3,\"s\")=1\nglUniform1i(1,12)\n{QUAD}",
        textures([12].into_iter()),
        program_of(PASS_POSITION, READ)
    );
    assert_eq!(shown(&saved, &[&texel]).at(8, 8), BLACK);
    assert_eq!(shown(&saved.replace("glPopAttrib()\n", ""), &[&texel]).at(8, 8), GREEN);
}

#[test]
fn a_stage_reads_as_many_textures_as_it_may() {
    let sum = |count: usize| {
        let terms: Vec<String> = (0..count).map(|k| format!("texture2D(s[{k}], vec2(0.5))")).collect();
        format!("uniform sampler2D s[{count}]; void main() {{ gl_FragColor = vec4({}); }}", terms.join(" + "))
    };
    let calls = |count: usize| {
        let units: Vec<String> = (0..count).map(|k| (2 * k).to_string()).collect();
        format!(
            "{}{}glGetUniformLocation(3,\"s[0]\")=1\nglUniform1iv(1,{count},{{{}}})\n{QUAD}",
            textures((0..count).map(|k| 2 * k)),
            program_of(PASS_POSITION, &sum(count)),
            units.join(",")
        )
    };
    let buffers: Vec<&[u8]> = (0..33).map(|_| &[7, 0, 0, 7][..]).collect();
    assert!(near(shown(&calls(32), &buffers[..32]).at(8, 8), [224, 0, 0]));
    let (why, errors) = refused_with_errors(&calls(33), &buffers);
    assert!(why.contains("a stage reads 33 textures, at most 32") && errors.is_empty(), "{why} {errors:?}");
}

#[test]
fn parameters_of_textures_are_restored() {
    // Two texels, red and blue: between them a linear filter shows a mixture.
    let texture = "glTexParameteri(GL_TEXTURE_2D,GL_TEXTURE_MIN_FILTER,GL_NEAREST)\nglTexParameteri(GL_TEXTURE_2D,GL_TEXTURE_WRAP_S,GL_CLAMP_TO_EDGE)\n\
        glTexImage2D(GL_TEXTURE_2D,0,GL_RGBA,2,1,0,GL_RGBA,GL_UNSIGNED_BYTE,*1)\nglEnable(GL_TEXTURE_2D)\n";
    let quad = "glBegin(GL_QUADS)\nglTexCoord2f(0,0)\nglVertex2f(-1,-1)\nglTexCoord2f(1,0)\nglVertex2f(1,-1)\nglTexCoord2f(1,1)\nglVertex2f(1,1)\n\
        glTexCoord2f(0,1)\nglVertex2f(-1,1)\nglEnd()\n";
    let texels = [255, 0, 0, 255, 0, 0, 255, 255];
    let of = |before: &str, group: &str| {
        let calls = format!(
            "{before}glPushAttrib({group})\nglTexParameteri(GL_TEXTURE_2D,GL_TEXTURE_MAG_FILTER,GL_NEAREST)\nglPopAttrib()\n{texture}{quad}"
        );
        let image = shown(&calls, &[&texels]);
        [image.at(7, 8), image.at(8, 8)]
    };
    for before in ["", "glBindTexture(GL_TEXTURE_2D,7)\n"] {
        let [left, right] = of(before, "GL_TEXTURE_BIT");
        assert!(left != RED && right != BLUE && left[0] > right[0], "{left:?} {right:?}");
        assert_eq!(of(before, "GL_POLYGON_BIT"), [RED, BLUE]);
    }
}

#[test]
fn colours_of_few_bits_are_rounded_when_given_and_cut_when_drawn() {
    let texture = |format: &str, pixels: &str| {
        format!(
            "glBindTexture(GL_TEXTURE_2D,1)\nglTexParameteri(GL_TEXTURE_2D,GL_TEXTURE_MIN_FILTER,GL_NEAREST)\n\
             glTexParameteri(GL_TEXTURE_2D,GL_TEXTURE_MAG_FILTER,GL_NEAREST)\nglTexEnvi(GL_TEXTURE_ENV,GL_TEXTURE_ENV_MODE,GL_REPLACE)\n\
             glTexImage2D(GL_TEXTURE_2D,0,{format},1,1,0,GL_RGBA,GL_UNSIGNED_BYTE,{pixels})\n"
        )
    };
    let read = "glEnable(GL_TEXTURE_2D)\n";
    let given = |format: &str| shown(&format!("{}{read}{QUAD}", texture(format, "*1")), &[&[10, 100, 203, 100]]).at(8, 8);
    assert_eq!(given("GL_RGBA8"), [10, 100, 203]);
    // 12 of 31 repeats its bits as 99, 6 of 15 is 102.
    assert_eq!([given("GL_RGB5_A1"), given("GL_RGB5")], [[8, 99, 206]; 2]);
    assert_eq!([given("GL_RGBA4"), given("GL_RGB4")], [[17, 102, 204]; 2]);
    assert_eq!(given("GL_R3_G3_B2"), [0, 109, 170]);
    let object = "glBindFramebufferEXT(GL_FRAMEBUFFER_EXT,2)\n\
        glFramebufferTexture2DEXT(GL_FRAMEBUFFER_EXT,GL_COLOR_ATTACHMENT0_EXT,GL_TEXTURE_2D,1,0)\n";
    let window = "glBindFramebufferEXT(GL_FRAMEBUFFER_EXT,0)\n";
    let drawn = |format: &str, draw: &str| {
        let calls = format!("{}{object}{draw}{window}{read}{QUAD}", texture(format, "U0x0"));
        shown(&calls, &[]).at(8, 8)
    };
    let (color, clear) =
        (format!("glColor4ub(15,100,207,255)\n{QUAD}\n"), "glClearColor(0.3,0.45,0.71,1)\nglClear(GL_COLOR_BUFFER_BIT)\n");
    assert_eq!([drawn("GL_RGB5", &color), drawn("GL_RGBA4", &color)], [[8, 99, 206], [17, 102, 204]]);
    assert_eq!([drawn("GL_RGB5", clear), drawn("GL_RGBA4", clear)], [[74, 115, 181], [85, 119, 187]]);
    // The copy of a window.
    let copied = format!("{color}{}glCopyTexSubImage2D(GL_TEXTURE_2D,0,0,0,0,0,1,1)\n{read}{QUAD}", texture("GL_RGB5", "U0x0"));
    assert_eq!(shown(&copied, &[]).at(8, 8), [8, 99, 206]);
    // What is blended keeps all bits, which is said.
    let blended = format!("{}{object}glEnable(GL_BLEND)\nglBlendFunc(GL_ONE,GL_ONE)\n{color}", texture("GL_RGB5", "U0x0"));
    let (trace, report) = recorded(&blended, &[], 0..u64::MAX, &Reading::default());
    assert!(report.refusal().is_some_and(|what| what.starts_with("blending into colours of fewer")), "{:?}", report.refusal());
    assert_eq!(last_of(&trace).lit(), []);
}
