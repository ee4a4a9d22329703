//! Programs in GLSL beside fixed functions: uniform blocks, numbers of vertices and instances, clip distances.

use super::gl_scenes::{
    BLACK, BLUE, GREEN, PASS, PASS_POSITION, QUAD, RED, near, program, program_of, refused_with_errors, shown,
};

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

/// A triangle over the whole window, whose corners are the vertices `first` to `first` + 2.
fn numbered(first: u32) -> String {
    let vertex = format!(
        "#version 130\nflat out int id; void main() {{ int k = gl_VertexID - {first}; id = gl_VertexID; \
         gl_Position = vec4(k == 1 ? 3.0 : -1.0, k == 2 ? 3.0 : -1.0, 0.0, 1.0); }}"
    );
    program_of(&vertex, "#version 130\nflat in int id; out vec4 c; void main() { c = vec4(float(id) / 255.0, 0.0, 1.0, 1.0); }")
}

#[test]
fn shaders_make_vertices_of_their_numbers() {
    // The last corner gives the flat value.
    let draws = [
        (0, "glDrawArrays(GL_TRIANGLES,0,3)"),
        (0, "glBindVertexArray(7)\nglDrawArrays(GL_TRIANGLES,0,3)"),
        (100, "glDrawArrays(GL_TRIANGLES,100,3)"),
        (100, "glDrawElements(GL_TRIANGLES,3,GL_UNSIGNED_BYTE,*1)"),
        (140, "glDrawElementsBaseVertex(GL_TRIANGLES,3,GL_UNSIGNED_BYTE,*1,40)"),
        (0, "glDrawArraysInstanced(GL_TRIANGLES,0,3,2)"),
    ];
    for (first, draw) in draws {
        let image = shown(&format!("{}{draw}", numbered(first)), &[&[100, 101, 102]]);
        let wanted = [first as u8 + 2, 0, 255];
        assert!(near(image.at(0, 0), wanted) && near(image.at(15, 15), wanted), "{draw}: {:?}", image.at(8, 8));
    }
    // With an array, which stays on the card in other draws.
    let vertex = "#version 130\nin vec2 p; flat out int id; void main() { id = gl_VertexID; gl_Position = vec4(p, 0.0, 1.0); }";
    let fragment = "#version 130\nflat in int id; out vec4 c; void main() { c = vec4(float(id) / 255.0, 0.0, 1.0, 1.0); }";
    let corners: Vec<u8> = [-1.0_f32, -1.0, 3.0, -1.0, -1.0, 3.0].iter().flat_map(|value| value.to_le_bytes()).collect();
    let calls = format!(
        "{}glGetAttribLocation(3,\"p\")=4\nglBindBuffer(GL_ARRAY_BUFFER,1)\nglBufferData(GL_ARRAY_BUFFER,24,*1,GL_STATIC_DRAW)\n\
         glVertexAttribPointer(4,2,GL_FLOAT,0,0,0)\nglEnableVertexAttribArray(4)\nglDrawArrays(GL_TRIANGLES,0,3)",
        program_of(vertex, fragment)
    );
    assert!(near(shown(&calls, &[&corners]).at(8, 8), [2, 0, 255]));
}

#[test]
fn no_draw_of_a_refused_program_is_lost() {
    let fragment = "#version 130\nuniform usampler2D t; out vec4 c; void main() { c = vec4(texelFetch(t, ivec2(0), 0)); }";
    let corners = [0_u8; 24];
    let array = "glBindBuffer(GL_ARRAY_BUFFER,1)\nglBufferData(GL_ARRAY_BUFFER,24,*1,GL_STATIC_DRAW)\n\
                 glVertexAttribPointer(1,2,GL_FLOAT,0,0,0)\nglEnableVertexAttribArray(1)\n";
    for arrays in ["", array] {
        let calls = format!(
            "{}glGetUniformLocation(3,\"t\")=1\nglUniform1i(1,0)\n{arrays}glDrawArrays(GL_TRIANGLES,0,3)\n\
             glDrawArrays(GL_TRIANGLES,0,3)",
            program_of(PASS_POSITION, fragment)
        );
        let (why, errors) = refused_with_errors(&calls, &[&corners]);
        // The cause alone is named: the driver took the program, so its uniforms are no errors.
        assert!(
            why.starts_with("drawing with GLSL program 3: fragment shader, line 2: ") && why.contains(" times, first in call "),
            "{why}"
        );
        assert!(why.contains("usampler2D") && errors.is_empty(), "{why} {errors:?}");
    }
    // Stages that are not there are named where a program with them draws.
    let calls = format!(
        "glCreateShader(36313)=9\nglShaderSource(9,1,\"void main() {{}}\",0)\nglCompileShader(9)\n{}glAttachShader(3,9)\n\
         glLinkProgram(3)\nglUniform1i(0,1)\n{QUAD}",
        program_of(PASS_POSITION, "")
    );
    let (why, errors) = refused_with_errors(&calls, &[]);
    assert!(
        why.starts_with("drawing with GLSL program 3: shaders of the stage GL_GEOMETRY_SHADER are not supported (1 times"),
        "{why}"
    );
    assert!(errors.is_empty(), "{errors:?}");
}

#[test]
fn clip_distances_of_enabled_planes_cut() {
    let vertex = "#version 130\nout float gl_ClipDistance[2]; void main() { gl_ClipDistance[0] = gl_Vertex.x; gl_ClipDistance[1] = gl_Vertex.y - 0.5; \
                  gl_Position = gl_Vertex; }";
    let fragment = "void main() { gl_FragColor = vec4(0.0, 1.0, 0.0, 1.0); }";
    let image = |enabled: &str| shown(&format!("{}{enabled}{QUAD}", program_of(vertex, fragment)), &[]);
    let none = image("");
    assert_eq!(none.lit().len(), 256);
    let one = image("glEnable(GL_CLIP_PLANE0)\n");
    assert_eq!((one.at(7, 8), one.at(8, 8), one.lit().len()), (BLACK, GREEN, 128));
    let both = image("glEnable(GL_CLIP_PLANE0)\nglEnable(GL_CLIP_PLANE1)\n");
    assert_eq!((both.at(8, 11), both.at(8, 12), both.lit().len()), (BLACK, GREEN, 32));
}

#[test]
fn what_naga_does_not_take_is_written_in_other_words() {
    // Members whose names naga changes go from stage to stage.
    let structure = "struct Corner { vec2 c1; float sample; vec3 loop2[2]; };";
    let vertex = format!(
        "{structure} varying Corner v; void main() {{ v.c1 = vec2(0.25, 0.5); v.sample = 0.75; v.loop2[0] = vec3(0.125); \
         v.loop2[1] = vec3(0.375); gl_Position = gl_Vertex; }}"
    );
    for (value, wanted) in [("v.c1, v.sample", [64, 128, 191]), ("v.loop2[0].x, v.loop2[1].y, v.c1.y", [32, 96, 128])] {
        let fragment = format!("{structure} varying Corner v; void main() {{ gl_FragColor = vec4({value}, 1.0); }}");
        assert!(near(shown(&format!("{}{QUAD}", program_of(&vertex, &fragment)), &[]).at(8, 8), wanted), "{value}");
    }
    let fragment = "struct Light { float patch; float sample; }; uniform Light l; void main() { gl_FragColor = vec4(l.patch, l.sample, 0.0, 1.0); }";
    let values = "glGetUniformLocation(3,\"l.patch\")=1\nglUniform1f(1,0.25)\nglGetUniformLocation(3,\"l.sample\")=2\nglUniform1f(2,0.5)\n";
    assert!(near(shown(&format!("{}{values}{QUAD}", program_of(PASS_POSITION, fragment)), &[]).at(8, 8), [64, 128, 0]));
    // Functions that are declared alone, functions that may end without a result, and statements that never run.
    let fragment = "vec3 nowhere(float x); uniform sampler2D s; struct Two { vec3 a; float b; };\n\
        vec3 color(int k) { if (k == 0) return vec3(1.0, 0.0, 0.0); else if (k == 1) return vec3(0.0, 1.0, 0.0); }\n\
        Two two(int k) { if (k == 3) { return Two(vec3(0.0, 0.5, 0.0), 0.5); } }\n\
        vec4 read(sampler2D t, int k) { if (k == 2) { return vec4(0.25); vec4 never = texture2D(t, vec2(0.5)); return never; } \
        return vec4(0.0); return texture2D(t, vec2(0.5)); }\n\
        void main() { gl_FragColor = vec4(color(1).rg, read(s, 2).b, two(3).b); gl_FragColor.a = 1.0; return; gl_FragColor = texture2D(s, vec2(0.5)); }";
    assert!(near(shown(&format!("{}{QUAD}", program_of(PASS_POSITION, fragment)), &[]).at(8, 8), [0, 255, 64]));
}

#[test]
fn fragments_are_counted_from_the_corner_that_a_shader_names() {
    // The pixel in column 3, row 5 from below, of a window and of a texture.
    let shader = |layout: &str| {
        format!("#version 150\n{layout}out vec4 c; void main() {{ c = vec4(gl_FragCoord.xy / 16.0, 0.0, 1.0); }}")
    };
    let cases = [
        ("", [3.5, 5.5]),
        ("layout(origin_upper_left) in vec4 gl_FragCoord; ", [3.5, 10.5]),
        ("layout(pixel_center_integer) in vec4 gl_FragCoord; ", [3.0, 5.0]),
        ("layout(origin_upper_left, pixel_center_integer) in vec4 gl_FragCoord; ", [3.0, 10.0]),
    ];
    let target = "glBindTexture(3553,1)\nglTexParameteri(3553,10241,9728)\nglTexParameteri(3553,10240,9728)\n\
                  glTexImage2D(3553,0,6408,16,16,0,6408,5121,U0x0)\nglBindFramebuffer(GL_FRAMEBUFFER,1)\n\
                  glFramebufferTexture2D(GL_FRAMEBUFFER,GL_COLOR_ATTACHMENT0,3553,1,0)\n";
    let show = "glBindFramebuffer(GL_DRAW_FRAMEBUFFER,0)\nglBlitFramebuffer(0,0,16,16,0,0,16,16,16384,9728)\n";
    for (layout, [x, y]) in cases {
        let draw = format!("{}{QUAD}\n", program_of(PASS_POSITION, &shader(layout)));
        for calls in [draw.clone(), format!("{target}{draw}{show}")] {
            let wanted = [x, y, 0.0].map(|value: f32| (value / 16.0 * 255.0).round() as u8);
            let seen = shown(&calls, &[]).at(3, 5);
            assert!(near(seen, wanted), "{layout}: {seen:?} is not {wanted:?}");
        }
    }
    let (why, _) =
        refused_with_errors(&format!("{}{QUAD}", program_of(PASS_POSITION, &shader("layout(early_fragment_tests) in; "))), &[]);
    assert!(why.contains("layout(early_fragment_tests) of this form is not supported"), "{why}");
}

#[test]
fn cases_go_on_with_the_next_one() {
    let text = "#version 130\nuniform int k; out vec4 c; void main() { c = vec4(0.0, 0.0, 0.0, 1.0); switch (k) { case 0: c.r = 1.0; case 1: c.g = 1.0; break; \
                case 2: case 3: c.b = 1.0; default: c.r = 0.5; } }";
    for (k, wanted) in [(0, [255, 255, 0]), (1, GREEN), (2, [128, 0, 255]), (3, [128, 0, 255]), (4, [128, 0, 0])] {
        let calls = format!("{}glGetUniformLocation(3,\"k\")=1\nglUniform1i(1,{k})\n{QUAD}", program_of(PASS_POSITION, text));
        assert!(near(shown(&calls, &[]).at(8, 8), wanted), "{k}");
    }
    // Cases that end in other ways.
    let text = "#version 130\nuniform int k; out vec4 c; void main() { c = vec4(0.0, 0.0, 0.0, 1.0); switch (k) { case 0: c.r = 1.0; return; \
                case 1: { c.g = 1.0; break; } case 2: if (k == 2) { c.b = 1.0; break; } else discard; default: { return; } break; } c.rg += 0.5; }";
    for (k, wanted) in [(0, RED), (1, [128, 255, 0]), (2, [128, 128, 255]), (3, BLACK)] {
        let calls = format!("{}glGetUniformLocation(3,\"k\")=1\nglUniform1i(1,{k})\n{QUAD}", program_of(PASS_POSITION, text));
        assert!(near(shown(&calls, &[]).at(8, 8), wanted), "{k}");
    }
}

#[test]
fn uniforms_are_set_in_programs_that_are_not_used() {
    // A structure without a name, too.
    let text = "uniform struct { vec2 a; float b; } x; uniform mat2 m; void main() { gl_FragColor = vec4(m * x.a, x.b, 1.0); }";
    let names = "glGetUniformLocation(3,\"x.a\")=1\nglGetUniformLocation(3,\"x.b\")=2\nglGetUniformLocation(3,\"m\")=3\n";
    let values = "glUseProgram(0)\nglProgramUniform2fv(3,1,1,{0.25,0.5})\nglProgramUniform1fEXT(3,2,0.75)\n\
                  glProgramUniformMatrix2fv(3,3,1,GL_FALSE,{1,0,0,0.5})\nglUseProgram(3)\n";
    assert!(near(shown(&format!("{}{names}{values}{QUAD}", program_of(PASS_POSITION, text)), &[]).at(8, 8), [64, 64, 191]));
    let (_, errors) = refused_with_errors("glProgramUniform1f(9,1,0.5)", &[]);
    assert_eq!(errors, ["glProgramUniform1f: GL_INVALID_VALUE"]);
}
