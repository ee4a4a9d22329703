//! Features later than OpenGL 1.5 that old and new programs use: several colour buffers, floating-point images, swizzles, instances.

use fillrate::trace::Reading;

use super::gl_features::{BLACK, BLUE, GREEN, QUAD, RED, near, recorded, shown};

const WHITE: [u8; 3] = [255; 3];

/// A program of these shaders, which is used; objects have the numbers n, n + 1 and n + 2.
pub(super) fn program(n: usize, vertex: &str, fragment: &str) -> String {
    let mut calls = format!("glCreateProgram()={}\n", n + 2);
    for (k, (stage, text)) in [("VERTEX", vertex), ("FRAGMENT", fragment)].into_iter().enumerate() {
        let (name, program) = (n + k, n + 2);
        calls += &format!(
            "glCreateShader(GL_{stage}_SHADER)={name}\nglShaderSource({name},1,\"{text}\",0)\nglCompileShader({name})\n\
             glAttachShader({program},{name})\n"
        );
    }
    calls + &format!("glLinkProgram({0})\nglUseProgram({0})\n", n + 2)
}

const PASS: &str = "void main() { gl_Position = gl_Vertex; gl_TexCoord[0] = gl_Vertex * 0.5 + 0.5; }";

/// A frame buffer object with two textures of an internal format, 1 and 2, both of which are drawn to.
fn two_buffers(internal: &str) -> String {
    let mut calls = "glBindFramebuffer(GL_FRAMEBUFFER,1)\n".to_owned();
    for (texture, attachment) in [(1, 0), (2, 1)] {
        calls += &format!(
            "glBindTexture(GL_TEXTURE_2D,{texture})\nglTexStorage2D(GL_TEXTURE_2D,1,{internal},16,16)\n\
             glTexParameteri(GL_TEXTURE_2D,GL_TEXTURE_MIN_FILTER,GL_NEAREST)\n\
             glTexParameteri(GL_TEXTURE_2D,GL_TEXTURE_MAG_FILTER,GL_NEAREST)\n\
             glFramebufferTexture2D(GL_FRAMEBUFFER,GL_COLOR_ATTACHMENT{attachment},GL_TEXTURE_2D,{texture},0)\n"
        );
    }
    calls + "glDrawBuffers(2,{GL_COLOR_ATTACHMENT0,GL_COLOR_ATTACHMENT1})\n"
}

/// Shows a texture in the window, times a factor.
fn show(texture: u32, factor: f32) -> String {
    let fragment =
        format!("uniform sampler2D t; void main() {{ gl_FragColor = {factor:?} * texture2D(t, gl_TexCoord[0].xy); }}");
    format!(
        "glBindFramebuffer(GL_FRAMEBUFFER,0)\nglBindTexture(GL_TEXTURE_2D,{texture})\n{}glRectf(-1,-1,1,1)",
        program(10, PASS, &fragment)
    )
}

#[test]
fn uniform_blocks_read_buffers() {
    let fragment = "#version 150 compatibility\nlayout(std140) uniform; uniform Colors { float first; highp vec3 color; mat2 m; vec2 list[2], one; bool on; };\n\
        layout(binding = 5) uniform More { vec4 tint; } more; uniform float plain;\n\
        void main() { float color2 = 0.5; vec2 v = m * list[1]; gl_FragColor = on ? vec4(first * color.r, v.y, one.x * color2, 1.0) * more.tint * plain : vec4(1.0); }";
    let mut colors = [0.0_f32; 28];
    // The second column of the matrix is at 48, the second element of the list at 80.
    (colors[0], colors[4], colors[9], colors[13], colors[20], colors[21], colors[24]) = (0.5, 1.0, 0.25, 0.5, 1.0, 0.5, 1.0);
    let bytes = |values: &[f32]| values.iter().flat_map(|value| value.to_le_bytes()).collect::<Vec<u8>>();
    let mut colors = bytes(&colors);
    colors[104] = 3;
    let tint = bytes(&[0.0, 0.0, 0.0, 0.0, 1.0, 0.5, 1.0, 1.0]);
    let other = bytes(&[0.0, 0.0, 0.0, 0.0, 0.5, 1.0, 0.25, 1.0]);
    let bound = "glBindBuffer(35345,1)\nglBufferData(35345,112,*1,35044)\nglBindBufferBase(35345,2,1)\n\
        glBindBuffer(35345,2)\nglBufferData(35345,32,*2,35044)\nglBindBufferRange(35345,5,2,16,16)\n";
    let named = "glGetUniformBlockIndex(12,\"Colors\")=0\nglGetUniformBlockIndex(12,\"More\")=1\nglUniformBlockBinding(12,0,2)\n\
        glGetUniformLocation(12,\"plain\")=0\nglUniform1f(0,1)\n";
    let drawn = |calls: &str| {
        let calls = format!("{bound}{}\n{named}{calls}", program(10, PASS, fragment));
        shown(&calls, &[&colors, &tint, &other])
    };
    // 0.25 * 1.0 + 0.5 * 0.5 of the second row of the matrix, times 0.5.
    assert!(near(drawn("glRectf(-1,-1,1,1)").at(8, 8), [128, 64, 128]));
    // Contents that change between two draws; and a binding of the program's choice.
    let image = drawn("glRectf(-1,-1,0,1)\nglBufferSubData(35345,0,32,*3)\nglRectf(0,-1,1,1)");
    assert!(near(image.at(4, 8), [128, 64, 128]) && near(image.at(12, 8), [64, 128, 32]), "{:?}", image.at(12, 8));
    let image =
        drawn("glUniformBlockBinding(12,1,9)\nglBindBufferBase(35345,9,2)\nglBufferSubData(35345,0,16,*3)\nglRectf(-1,-1,1,1)");
    assert_eq!(image.at(8, 8), BLACK);
    // A buffer that is deleted, and one that is too short.
    assert_eq!(drawn("glDeleteBuffers(1,{2})\nglRectf(-1,-1,1,1)").at(8, 8), BLACK);
}

#[test]
fn each_colour_buffer_is_blended_and_masked_for_itself() {
    let data = "void main() { gl_FragData[0] = vec4(0.5, 0.25, 0.0, 1.0); gl_FragData[1] = vec4(0.5, 0.25, 0.5, 1.0); }";
    let drawn = |calls: &str, texture: u32| {
        let clear = "glClearBufferfv(GL_COLOR,0,{0.25,0.25,0.25,1})\nglClearBufferfv(GL_COLOR,1,{0.5,0.5,0.25,1})\n";
        let restore = "glDisable(GL_BLEND)\nglColorMask(1,1,1,1)\n";
        let draw =
            format!("{}{clear}{calls}\n{}\nglRectf(-1,-1,1,1)\n{restore}", two_buffers("GL_RGBA8"), program(20, PASS, data));
        shown(&format!("{draw}{}", show(texture, 1.0)), &[]).at(8, 8)
    };
    let of = |calls: &str| [drawn(calls, 1), drawn(calls, 2)];
    let check = |calls: &str, first: [u8; 3], second: [u8; 3]| {
        let seen = of(calls);
        assert!(near(seen[0], first) && near(seen[1], second), "{calls}: {seen:?}");
    };
    check("glEnable(GL_BLEND)\nglBlendFunc(GL_ONE,GL_ONE)", [191, 128, 64], [255, 191, 191]);
    check("glBlendFunc(GL_ONE,GL_ONE)\nglEnablei(GL_BLEND,1)", [128, 64, 0], [255, 191, 191]);
    check("glEnable(GL_BLEND)\nglDisableIndexedEXT(GL_BLEND,1)\nglBlendFunc(GL_ONE,GL_ONE)", [191, 128, 64], [128, 64, 128]);
    let each = "glEnable(GL_BLEND)\nglBlendFunci(0,GL_ONE,GL_ONE)\nglBlendFuncSeparatei(1,GL_ZERO,GL_ONE,GL_ONE,GL_ZERO)";
    check(each, [191, 128, 64], [128, 128, 64]);
    let each = "glEnable(GL_BLEND)\nglBlendFunc(GL_ONE,GL_ONE)\nglBlendEquationi(1,GL_FUNC_REVERSE_SUBTRACT)";
    check(each, [191, 128, 64], [0, 64, 0]);
    check("glColorMaski(1,1,0,0,1)", [128, 64, 0], [128, 128, 64]);
    check("glColorMaski(0,0,1,1,1)", [64, 64, 0], [128, 64, 128]);
    // Of one buffer, the part in the scissor.
    let part = "glEnable(GL_SCISSOR_TEST)\nglScissor(0,0,16,4)\nglClearBufferfv(GL_COLOR,1,{1,1,1,1})\nglDisable(GL_SCISSOR_TEST)\nglColorMask(0,0,0,0)";
    check(part, [64, 64, 64], [128, 128, 64]);
    // Restored with the group, and as a switch.
    let saved = "glPushAttrib(GL_COLOR_BUFFER_BIT)\nglColorMaski(1,0,0,0,0)\nglEnablei(GL_BLEND,0)\nglBlendFunc(GL_ZERO,GL_ONE)\nglPopAttrib()";
    check(saved, [128, 64, 0], [128, 64, 128]);
    let switch = "glBlendFunc(GL_ONE,GL_ONE)\nglPushAttrib(GL_ENABLE_BIT)\nglEnable(GL_BLEND)\nglPopAttrib()";
    check(switch, [128, 64, 0], [128, 64, 128]);
    check(
        "glPushAttrib(GL_COLOR_BUFFER_BIT)\nglBlendFunc(GL_ONE,GL_ONE)\nglEnable(GL_BLEND)\nglPopAttrib()",
        [128, 64, 0],
        [128, 64, 128],
    );
}

#[test]
fn a_shader_gives_each_colour_buffer_its_own() {
    let data = "void main() { gl_FragData[0] = vec4(1.0, 0.0, 0.0, 1.0); gl_FragData[1] = vec4(0.0, 2.0, 0.0, 1.0); }";
    // An array of outputs, and outputs at stated places.
    let array = "#version 130\nout vec4 c[2]; void main() { c[0] = vec4(1, 0, 0, 1); c[1] = vec4(0, 2, 0, 1); }";
    let placed = "#version 330\nlayout(location = 1) out vec4 b; layout(location = 0) out vec4 a;\n\
                  void main() { a = vec4(1, 0, 0, 1); b = vec4(0, 2, 0, 1); }";
    for fragment in [data, array, placed] {
        let drawn = |internal: &str, texture: u32, factor: f32| {
            let draw = format!("{}{}glRectf(-1,-1,1,1)\n", two_buffers(internal), program(20, PASS, fragment));
            shown(&format!("{draw}{}", show(texture, factor)), &[]).at(8, 8)
        };
        assert_eq!(drawn("GL_RGBA8", 1, 1.0), RED);
        assert_eq!(drawn("GL_RGBA8", 2, 1.0), GREEN);
        // Eight bits end at 1; floating-point numbers do not.
        assert!(near(drawn("GL_RGBA8", 2, 0.25), [0, 64, 0]));
        assert!(near(drawn("GL_RGBA16F", 2, 0.25), [0, 128, 0]));
        assert!(near(drawn("GL_RGBA32F", 2, 0.25), [0, 128, 0]));
    }
}

#[test]
fn one_colour_goes_to_all_colour_buffers() {
    let whole = "void main() { gl_FragColor = vec4(0.0, 0.0, 1.0, 1.0); }";
    for texture in [1, 2] {
        let own = format!("{}{}glRectf(-1,-1,1,1)\n", two_buffers("GL_RGBA8"), program(20, PASS, whole));
        assert_eq!(shown(&format!("{own}{}", show(texture, 1.0)), &[]).at(8, 8), BLUE);
        let fixed = format!("{}glDisable(GL_TEXTURE_2D)\nglColor3f(0,1,0)\n{QUAD}\n", two_buffers("GL_RGBA8"));
        assert_eq!(shown(&format!("{fixed}{}", show(texture, 1.0)), &[]).at(8, 8), GREEN);
    }
}

#[test]
fn all_colour_buffers_are_cleared() {
    for texture in [1, 2] {
        let clear = "glClearColor(1,0,0,1)\nglClear(GL_COLOR_BUFFER_BIT)\nglEnable(GL_SCISSOR_TEST)\nglScissor(0,0,8,16)\n\
                     glClearColor(0,1,0,1)\nglClear(GL_COLOR_BUFFER_BIT)\nglDisable(GL_SCISSOR_TEST)\n";
        let image = shown(&format!("{}{clear}{}", two_buffers("GL_RGBA8"), show(texture, 1.0)), &[]);
        assert_eq!((image.at(4, 8), image.at(12, 8)), (GREEN, RED));
    }
    // A floating-point buffer keeps what is greater than 1.
    let clear = "glClearColor(4,0,0,1)\nglClear(GL_COLOR_BUFFER_BIT)\n";
    assert!(near(shown(&format!("{}{clear}{}", two_buffers("GL_RGBA16F"), show(2, 0.125)), &[]).at(8, 8), [128, 0, 0]));
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
fn instances_have_numbers_and_elements_of_their_own() {
    let floats = |values: &[f32]| values.iter().flat_map(|value| value.to_le_bytes()).collect::<Vec<u8>>();
    // A quadrilateral at the left edge, a quarter of the window wide, and a colour for each two instances.
    let corners = floats(&[-1.0, -1.0, -0.5, -1.0, -0.5, 1.0, -1.0, 1.0]);
    let colors = floats(&[1.0, 0.0, 0.0, 0.0, 1.0, 0.0]);
    let vertex = "#version 140\nin vec2 at; in vec3 color; out vec3 c;\n\
                  void main() { gl_Position = vec4(at + vec2(0.5 * float(gl_InstanceID), 0.0), 0.0, 1.0); c = color; }";
    let fragment = "#version 140\nin vec3 c; out vec4 o; void main() { o = vec4(c, 1.0); }";
    let calls = format!(
        "{}glGetAttribLocation(12,\"at\")=0\nglGetAttribLocation(12,\"color\")=1\n\
         glEnableVertexAttribArray(0)\nglVertexAttribPointer(0,2,GL_FLOAT,GL_FALSE,0,*1)\n\
         glEnableVertexAttribArray(1)\nglVertexAttribPointer(1,3,GL_FLOAT,GL_FALSE,0,*2)\nglVertexAttribDivisor(1,2)\n",
        program(10, vertex, fragment)
    );
    let image = shown(&format!("{calls}glDrawArraysInstanced(GL_QUADS,0,4,3)"), &[&corners, &colors]);
    assert_eq!([2, 6, 10, 14].map(|x| image.at(x, 8)), [RED, RED, GREEN, BLACK]);
    // Indices that count from a base vertex: those below it are never read.
    let indices: Vec<u8> = [0_u16, 1, 2, 3].iter().flat_map(|index| index.to_le_bytes()).collect();
    let moved = floats(&[9.0, 9.0, -1.0, -1.0, -0.5, -1.0, -0.5, 1.0, -1.0, 1.0]);
    let draw = "glDrawElementsBaseVertex(GL_QUADS,4,GL_UNSIGNED_SHORT,*3,1)";
    let image = shown(&format!("{calls}{draw}"), &[&moved, &floats(&[0.0, 0.0, 1.0]), &indices]);
    assert_eq!([2, 6].map(|x| image.at(x, 8)), [BLUE, BLACK]);
}

#[test]
fn prototypes_may_stand_behind_their_functions() {
    let fragment = "float half_(float x) { return 0.5 * x; } float half_(float); float half_(float y); float half_(vec2 v);\n\
                    void main() { gl_FragColor = vec4(half_(1.0), half_(vec2(2.0)), 0.0, 1.0); }\n\
                    float half_(vec2 v) { return 0.5 * v.x; }";
    let calls = format!("{}glRectf(-1,-1,1,1)", program(10, PASS, fragment));
    assert!(near(shown(&calls, &[]).at(8, 8), [128, 255, 0]));
}

#[test]
fn smooth_points_are_discs() {
    let ortho = "glMatrixMode(GL_PROJECTION)\nglOrtho(0,16,0,16,-1,1)\nglMatrixMode(GL_MODELVIEW)\nglEnable(GL_POINT_SMOOTH)\n";
    let lit =
        |size: &str| shown(&format!("{ortho}glPointSize({size})\nglBegin(GL_POINTS)\nglVertex2f(8,8)\nglEnd()"), &[]).lit();
    // The corners of the square of 4 x 4 are farther away than 2.
    let disc: Vec<(usize, usize)> = (6..10).flat_map(|y| (6..10).map(move |x| (x, y))).collect();
    let corner = |&(x, y): &(usize, usize)| matches!(x, 6 | 9) && matches!(y, 6 | 9);
    assert_eq!(lit("4"), disc.into_iter().filter(|at| !corner(at)).collect::<Vec<_>>());
    // Small ones have a radius of 1.
    assert_eq!(lit("0.5"), [(7, 7), (8, 7), (7, 8), (8, 8)]);
}

#[test]
fn a_material_that_waits_stays_beside_colour_material_until_the_colour_changes() {
    // Only the ambient light of the scene, so that the ambient material is the colour.
    let lit = "glLightModelfv(GL_LIGHT_MODEL_AMBIENT,{1,1,1,1})\nglEnable(GL_LIGHTING)\n\
               glColorMaterial(GL_FRONT_AND_BACK,GL_AMBIENT)\n";
    let of = |calls: &str| shown(&format!("{lit}{calls}\n{QUAD}"), &[]).at(8, 8);
    let (given, on) = ("glMaterialfv(GL_FRONT_AND_BACK,GL_AMBIENT,{1,0,0,1})\n", "glEnable(GL_COLOR_MATERIAL)\n");
    assert_eq!(of(&format!("{given}{on}")), RED);
    assert_eq!(of(&format!("{given}{on}glColor3f(0,1,0)")), GREEN);
    // While colour material tracks it, it is not set.
    let other = "glMaterialfv(GL_FRONT_AND_BACK,GL_AMBIENT,{0,0,1,1})\n";
    assert_eq!([of(&format!("{given}{on}{other}")), of(&format!("{on}{other}"))], [RED, WHITE]);
    // A primitive between them has taken the material.
    let point = "glBegin(GL_POINTS)\nglVertex2f(0,0)\nglEnd()\n";
    assert_eq!(of(&format!("{given}{point}{on}")), WHITE);
    // What is kept stays when colour material is switched off.
    assert_eq!(of(&format!("{given}{on}{point}glDisable(GL_COLOR_MATERIAL)\nglColor3f(0,1,0)")), RED);
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
fn a_viewport_far_away_shows_nothing_and_is_no_error() {
    assert_eq!(shown(&format!("glViewport(4,-2147483400,7,255)\n{QUAD}"), &[]).lit(), []);
}

#[test]
fn one_buffer_is_cleared_with_a_value_of_its_own() {
    let depth = "glClearBufferfv(GL_DEPTH,0,{0.25})\nglEnable(GL_DEPTH_TEST)\nglColor3f(0,0,1)\n";
    let color = "glClearColor(0,1,0,1)\nglClearBufferfv(GL_COLOR,0,{1,0,0,1})\n";
    // At depth 0.5 nothing passes; the value of glClear is another one.
    assert_eq!(shown(&format!("{color}{depth}{QUAD}"), &[]).at(8, 8), RED);
    assert_eq!(shown(&format!("{color}{depth}glClearBufferfi(GL_DEPTH_STENCIL,0,1,0)\n{QUAD}"), &[]).at(8, 8), BLUE);
    assert_eq!(shown(&format!("{color}glClear(GL_COLOR_BUFFER_BIT)"), &[]).at(8, 8), GREEN);
}

#[test]
fn wide_lines_of_a_program_are_those_of_the_fixed_functions() {
    // A matrix by which depths follow x: the line leaves through the near plane.
    let matrix = "glMultMatrixf({1,0,2,0,0,1,0,0,0,0,1,0,0,0,0,1})\n";
    let line = "glLineWidth(4)\nglBegin(GL_LINES)\nglColor3f(1,0,0)\nglVertex3f(-1,-0.5,0)\nglColor3f(0,1,0)\nglVertex3f(0.5,0.5,0)\nglEnd()\n";
    let builtin = "void main() { gl_Position = gl_ModelViewProjectionMatrix * gl_Vertex; gl_FrontColor = gl_Color; }";
    let own = "varying vec4 v; void main() { gl_Position = gl_ModelViewProjectionMatrix * gl_Vertex; v = gl_Color; }";
    let (plain, from_own) = ("void main() { gl_FragColor = gl_Color; }", "varying vec4 v; void main() { gl_FragColor = v; }");
    let smooth = "glEnable(GL_LINE_SMOOTH)\nglEnable(GL_BLEND)\nglBlendFunc(GL_SRC_ALPHA,GL_ONE_MINUS_SRC_ALPHA)\n";
    let part = "glViewport(4,4,9,9)\n";
    for state in ["", matrix, smooth, &format!("{matrix}{smooth}"), "glShadeModel(GL_FLAT)\n", part] {
        let fixed = shown(&format!("{state}{line}"), &[]);
        assert!(fixed.lit().len() > 20 && fixed.lit().len() < 100, "{state}: {}", fixed.lit().len());
        for (vertex, fragment) in [(builtin, plain), (own, from_own)] {
            if state.contains("FLAT") && vertex == own {
                continue; // Only OpenGL's own colours are flat.
            }
            let seen = shown(&format!("{}{state}{line}", program(10, vertex, fragment)), &[]);
            assert!(fixed.0.iter().zip(&seen.0).all(|(&a, &b)| near(a, b)), "{state} {vertex}");
        }
    }
    // What would be computed from another vertex is refused.
    let global = "vec4 sum = vec4(0.0); void main() { sum += gl_Vertex; gl_Position = sum; }";
    let calls = format!("{}{line}", program(10, global, plain));
    let (_, report) = recorded(&calls, &[], 0..u64::MAX, &Reading::default());
    assert!(report.refusal().is_some_and(|what| what.contains("wide lines")), "{:?}", report.refusal());
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
