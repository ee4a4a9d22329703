//! What programs of OpenGL 2 and 3 do beside fixed functions: many texture units, draws without arrays, clip distances, two sources of blending.

use std::path::Path;

use fillrate::import::gl::import_bytes;
use fillrate::trace::Reading;

use super::gl_features::{BLACK, BLUE, GREEN, QUAD, RED, Shown, last_of, near, recorded};

/// Calls that make program 3 of these shaders and use it; a text that is empty leaves the stage to fixed functions.
fn program(vertex: &str, fragment: &str) -> String {
    let mut calls = "glCreateProgram()=3\n".to_owned();
    for (name, stage, text) in [(1, "VERTEX", vertex), (2, "FRAGMENT", fragment)] {
        if !text.is_empty() {
            calls += &format!(
                "glCreateShader(GL_{stage}_SHADER)={name}\nglShaderSource({name},1,\"{text}\",0)\nglCompileShader({name})\n\
                 glAttachShader(3,{name})\n"
            );
        }
    }
    calls + "glLinkProgram(3)\nglUseProgram(3)\n"
}

/// The picture of calls that are supported and raise no error.
fn shown(calls: &str, buffers: &[&[u8]]) -> Shown {
    let (trace, report) = recorded(calls, buffers, 0..u64::MAX, &Reading::default());
    assert_eq!(report.refusal(), None);
    assert!(report.errors.is_empty(), "{:?}", report.errors.iter().collect::<Vec<_>>());
    last_of(&trace)
}

/// Why calls are refused, and which of them are errors.
fn refused(calls: &str, buffers: &[&[u8]]) -> (String, Vec<String>) {
    let (_, report) = recorded(calls, buffers, 0..u64::MAX, &Reading::default());
    (report.refusal().unwrap_or_default(), report.errors.iter().map(|(name, _)| name.to_owned()).collect())
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
const PASS: &str = "void main() { gl_Position = gl_Vertex; }";

#[test]
fn each_texture_unit_keeps_its_texture() {
    let units = [0, 1, 7, 8, 9, 15, 31, 32, 100, 191];
    let texels: Vec<[u8; 4]> = (0..units.len() as u8).map(|k| [20 * k + 10, 200 - 20 * k, k, 255]).collect();
    let buffers: Vec<&[u8]> = texels.iter().map(|texel| &texel[..]).collect();
    for (unit, texel) in units.iter().zip(&texels) {
        let calls = format!(
            "{}{}glGetUniformLocation(3,\"s\")=1\nglUniform1i(1,{unit})\n{QUAD}",
            textures(units.into_iter()),
            program(PASS, READ)
        );
        assert_eq!(shown(&calls, &buffers).at(8, 8), texel[..3], "unit {unit}");
    }
    // A unit without a texture is black, and the one behind the last is an error that changes no unit.
    let calls = format!("{}glUniform1i(1,30)\n{QUAD}", program(PASS, READ) + "glGetUniformLocation(3,\"s\")=1\n");
    assert_eq!(shown(&calls, &[]).at(8, 8), BLACK);
    let wrong = format!("{}glActiveTexture({})\nglBindTexture(3553,2)\n", textures([5].into_iter()), 0x84c0 + 192);
    assert_eq!(refused(&wrong, &[&[0; 4]]), (String::new(), vec!["glActiveTexture: GL_INVALID_ENUM".into()]));
}

#[test]
fn further_units_have_samplers_and_no_fixed_functions() {
    // Between a black and a white texel the sampler of the unit filters, the texture does not.
    let calls = format!(
        "glActiveTexture({})\nglBindTexture(3553,1)\nglTexParameteri(3553,10241,9728)\nglTexParameteri(3553,10240,9728)\n\
         glTexImage2D(3553,0,6408,2,1,0,6408,5121,*1)\nglBindSampler(20,5)\nglSamplerParameteri(5,10241,9729)\n\
         glSamplerParameteri(5,10240,9729)\n{}glGetUniformLocation(3,\"s\")=1\nglUniform1i(1,20)\n{QUAD}",
        0x84c0 + 20,
        program(PASS, READ)
    );
    let texels = [0, 0, 0, 255, 255, 255, 255, 255];
    assert!(near(shown(&calls, &[&texels]).at(8, 8), [128; 3]));
    // They have no matrices, and what is enabled there does not texture.
    let active = format!("glActiveTexture({})\n", 0x84c0 + 9);
    let image = shown(&format!("{}{active}glEnable(3553)\n{QUAD}", textures([9].into_iter())), &[&[255, 0, 0, 255]]);
    assert_eq!(image.at(8, 8), [255; 3]);
    let matrix = format!("{active}glMatrixMode(GL_TEXTURE)\nglTranslatef(1,0,0)\nglPushMatrix()\n");
    assert_eq!(refused(&matrix, &[]).1, ["glPushMatrix: GL_INVALID_OPERATION", "glTranslatef: GL_INVALID_OPERATION"]);
    // What is saved comes back, also of units that were first used after that.
    let texel = [0, 255, 0, 255];
    let saved = format!(
        "glPushAttrib(GL_TEXTURE_BIT)\n{}glPopAttrib()\n{}glGetUniformLocation(3,\"s\")=1\nglUniform1i(1,12)\n{QUAD}",
        textures([12].into_iter()),
        program(PASS, READ)
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
            program(PASS, &sum(count)),
            units.join(",")
        )
    };
    let buffers: Vec<&[u8]> = (0..33).map(|_| &[7, 0, 0, 7][..]).collect();
    assert!(near(shown(&calls(32), &buffers[..32]).at(8, 8), [224, 0, 0]));
    let (why, errors) = refused(&calls(33), &buffers);
    assert!(why.contains("a stage reads 33 textures, at most 32") && errors.is_empty(), "{why} {errors:?}");
}

/// A triangle over the whole window, whose corners are the vertices `first` to `first` + 2.
fn numbered(first: u32) -> String {
    let vertex = format!(
        "#version 130\nflat out int id; void main() {{ int k = gl_VertexID - {first}; id = gl_VertexID; \
         gl_Position = vec4(k == 1 ? 3.0 : -1.0, k == 2 ? 3.0 : -1.0, 0.0, 1.0); }}"
    );
    program(&vertex, "#version 130\nflat in int id; out vec4 c; void main() { c = vec4(float(id) / 255.0, 0.0, 1.0, 1.0); }")
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
        program(vertex, fragment)
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
            program(PASS, fragment)
        );
        let (why, errors) = refused(&calls, &[&corners]);
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
        program(PASS, "")
    );
    let (why, errors) = refused(&calls, &[]);
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
    let image = |enabled: &str| shown(&format!("{}{enabled}{QUAD}", program(vertex, fragment)), &[]);
    let none = image("");
    assert_eq!(none.lit().len(), 256);
    let one = image("glEnable(GL_CLIP_PLANE0)\n");
    assert_eq!((one.at(7, 8), one.at(8, 8), one.lit().len()), (BLACK, GREEN, 128));
    let both = image("glEnable(GL_CLIP_PLANE0)\nglEnable(GL_CLIP_PLANE1)\n");
    assert_eq!((both.at(8, 11), both.at(8, 12), both.lit().len()), (BLACK, GREEN, 32));
}

#[test]
fn colours_are_blended_with_a_second_source() {
    let stated = "#version 330\nlayout(location = 0, index = 0) out vec4 a; layout(location = 0, index = 1) out vec4 b; \
                  void main() { a = vec4(0.2, 0.0, 0.0, 1.0); b = vec4(0.5, 0.25, 1.0, 1.0); }";
    let bound = stated.replace("layout(location = 0, index = 0) ", "").replace("layout(location = 0, index = 1) ", "");
    let names = "glBindFragDataLocationIndexed(3,0,0,\"a\")\nglBindFragDataLocationIndexed(3,0,1,\"b\")\nglLinkProgram(3)\n";
    for (fragment, names) in [(stated, ""), (&bound, names)] {
        let draw = |factors: &str| {
            format!(
                "glClearColor(0.2,0.4,0.8,1)\nglClear(GL_COLOR_BUFFER_BIT)\n{}{names}glEnable(GL_BLEND)\nglBlendFunc({factors})\n{QUAD}",
                program(PASS, fragment)
            )
        };
        // GL_ONE, GL_SRC1_COLOR; then GL_ZERO, GL_ONE_MINUS_SRC1_COLOR; then without the second source.
        assert!(near(shown(&draw("1,35065"), &[]).at(8, 8), [77, 26, 204]));
        assert!(near(shown(&draw("0,35066"), &[]).at(8, 8), [26, 77, 0]));
        assert!(near(shown(&draw("1,0"), &[]).at(8, 8), [51, 0, 0]));
    }
    let (why, _) = refused(&format!("glEnable(GL_BLEND)\nglBlendFunc(1,35065)\n{QUAD}"), &[]);
    assert!(why.starts_with("blending with a second source that no fragment shader writes"), "{why}");
}

#[test]
fn what_is_deleted_stays_where_it_is_used() {
    let corners: Vec<u8> = [-1.0_f32, -1.0, 3.0, -1.0, -1.0, 3.0].iter().flat_map(|value| value.to_le_bytes()).collect();
    let arrays = "glBindVertexArray(1)\nglBindBuffer(GL_ARRAY_BUFFER,1)\nglBufferData(GL_ARRAY_BUFFER,24,*1,GL_STATIC_DRAW)\n\
                  glVertexAttribPointer(0,2,GL_FLOAT,0,0,0)\nglEnableVertexAttribArray(0)\nglBindBuffer(GL_ELEMENT_ARRAY_BUFFER,2)\n\
                  glBufferData(GL_ELEMENT_ARRAY_BUFFER,3,*2,GL_STATIC_DRAW)\nglBindVertexArray(0)\n\
                  glDeleteBuffers(2,{1,2})\nglBindBuffer(GL_ARRAY_BUFFER,1)\nglBufferData(GL_ARRAY_BUFFER,24,*3,GL_STATIC_DRAW)\n\
                  glBindVertexArray(1)\nglColor3f(1,0,0)\nglDrawElements(GL_TRIANGLES,3,GL_UNSIGNED_BYTE,0)";
    assert_eq!(shown(arrays, &[&corners, &[0, 1, 2], &[0; 24]]).at(8, 8), RED);
}

#[test]
fn a_window_of_unknown_size_is_cleared() {
    let text = "GLI0.t\nglClearColor(0,0,1,1)\nglClear(GL_COLOR_BUFFER_BIT)\nglViewport(0,0,16,16)\nglColor3f(1,0,0)\n\
                        glRectf(-1,-1,0,1)\nwglSwapBuffers(1)\n";
    let import = |text: String| {
        import_bytes(Path::new("x.txt"), text.into_bytes(), [&[], &[]], &Reading::default()).expect("a recording")
    };
    let (trace, report) = import(text.to_owned());
    assert_eq!(report.refusal(), None);
    let image = last_of(&trace);
    assert_eq!((image.at(3, 8), image.at(12, 8)), (RED, BLUE));
    // What would be lost is named.
    let (_, report) = import(text.replace("glClear(", "glRectf(0,0,1,1)\nglEnable(GL_SCISSOR_TEST)\nglClear("));
    let why = report.refusal().expect("refused");
    assert!(why.contains("drawing before the size of the window is known (1 times"), "{why}");
    assert!(why.contains("clearing a part before the size of the window is known (1 times"), "{why}");
}

#[test]
fn a_blit_says_how_large_a_window_is() {
    // All is drawn into a texture of 16 x 16 texels; the window has had one viewport, of 8 x 16.
    let text = "GLI0.t\nglViewport(0,0,8,16)\nglBindTexture(3553,1)\nglTexParameteri(3553,10241,9728)\n\
                glTexImage2D(3553,0,6408,16,16,0,6408,5121,U0x0)\nglBindFramebuffer(GL_FRAMEBUFFER,1)\n\
                glFramebufferTexture2D(GL_FRAMEBUFFER,GL_COLOR_ATTACHMENT0,3553,1,0)\nglViewport(0,0,16,16)\n\
                glClearColor(0,0,1,1)\nglClear(GL_COLOR_BUFFER_BIT)\nglColor3f(1,0,0)\nglRectf(-1,-1,0,1)\n\
                glBindFramebuffer(GL_DRAW_FRAMEBUFFER,0)\nglBlitFramebuffer(0,0,16,16,0,0,16,16,16384,9728)\nwglSwapBuffers(1)\n";
    let (trace, report) =
        import_bytes(Path::new("x.txt"), text.as_bytes().to_vec(), [&[], &[]], &Reading::default()).expect("a recording");
    assert_eq!(report.refusal(), None);
    let image = last_of(&trace);
    assert_eq!((image.at(3, 8), image.at(12, 8)), (RED, BLUE));
}

#[test]
fn a_texture_that_is_deleted_leaves_the_bound_framebuffer_object() {
    let target = "glBindTexture(3553,1)\nglTexParameteri(3553,10241,9728)\nglTexImage2D(3553,0,6408,16,16,0,6408,5121,U0x0)\n\
                  glBindFramebuffer(GL_FRAMEBUFFER,1)\nglFramebufferTexture2D(GL_FRAMEBUFFER,GL_COLOR_ATTACHMENT0,3553,1,0)\n";
    // Bound: the object has no image any more, and takes another one.
    let calls = format!(
        "{target}glDeleteTextures(1,{{1}})\n{target}glClearColor(1,0,0,1)\nglClear(16384)\n\
         glBindFramebuffer(GL_DRAW_FRAMEBUFFER,0)\nglBlitFramebuffer(0,0,16,16,0,0,16,16,16384,9728)"
    );
    assert_eq!(shown(&calls, &[]).at(3, 5), RED);
    // Not bound: OpenGL would keep the texture, also beside a new one of the same name.
    let unbound = format!("{target}glBindFramebuffer(GL_FRAMEBUFFER,0)\nglDeleteTextures(1,{{1}})\n");
    shown(&format!("{unbound}{QUAD}"), &[]);
    for again in ["", "glBindTexture(3553,1)\nglTexImage2D(3553,0,6408,16,16,0,6408,5121,U0x0)\n"] {
        let (why, _) = refused(&format!("{unbound}{again}glBindFramebuffer(GL_FRAMEBUFFER,1)\nglClear(16384)"), &[]);
        assert!(why.contains("attached to a frame buffer object that is not bound"), "{why}");
    }
}

#[test]
fn no_colour_buffer_is_drawn_to_after_an_empty_list() {
    let calls = |list: &str| format!("glColor3f(1,0,0)\n{list}\n{QUAD}");
    assert_eq!(shown(&calls("glDrawBuffers(0,U0x0)"), &[]).at(8, 8), BLACK);
    assert_eq!(shown(&calls("glDrawBuffers(0,U0x0)\nglDrawBuffers(1,{GL_BACK_LEFT})"), &[]).at(8, 8), RED);
    let target = "glBindTexture(3553,1)\nglTexParameteri(3553,10241,9728)\nglTexImage2D(3553,0,6408,1,1,0,6408,5121,*1)\n\
                  glBindFramebuffer(GL_FRAMEBUFFER,1)\nglFramebufferTexture2D(GL_FRAMEBUFFER,GL_COLOR_ATTACHMENT0,3553,1,0)\n\
                  glBindRenderbuffer(GL_RENDERBUFFER,1)\nglRenderbufferStorage(GL_RENDERBUFFER,GL_DEPTH_COMPONENT24,1,1)\n\
                  glFramebufferRenderbuffer(GL_FRAMEBUFFER,GL_DEPTH_ATTACHMENT,GL_RENDERBUFFER,1)\n";
    let shows = "glBindFramebuffer(GL_FRAMEBUFFER,0)\nglColor3f(1,1,1)\nglEnable(3553)\n";
    let image = shown(&format!("{target}glColor3f(1,0,0)\nglDrawBuffers(0,U0x0)\n{QUAD}\n{shows}{QUAD}"), &[&[0, 0, 255, 255]]);
    assert_eq!(image.at(8, 8), BLUE);
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
        assert!(near(shown(&format!("{}{QUAD}", program(&vertex, &fragment)), &[]).at(8, 8), wanted), "{value}");
    }
    let fragment = "struct Light { float patch; float sample; }; uniform Light l; void main() { gl_FragColor = vec4(l.patch, l.sample, 0.0, 1.0); }";
    let values = "glGetUniformLocation(3,\"l.patch\")=1\nglUniform1f(1,0.25)\nglGetUniformLocation(3,\"l.sample\")=2\nglUniform1f(2,0.5)\n";
    assert!(near(shown(&format!("{}{values}{QUAD}", program(PASS, fragment)), &[]).at(8, 8), [64, 128, 0]));
    // Functions that are declared alone, functions that may end without a result, and statements that never run.
    let fragment = "vec3 nowhere(float x); uniform sampler2D s; struct Two { vec3 a; float b; };\n\
        vec3 color(int k) { if (k == 0) return vec3(1.0, 0.0, 0.0); else if (k == 1) return vec3(0.0, 1.0, 0.0); }\n\
        Two two(int k) { if (k == 3) { return Two(vec3(0.0, 0.5, 0.0), 0.5); } }\n\
        vec4 read(sampler2D t, int k) { if (k == 2) { return vec4(0.25); vec4 never = texture2D(t, vec2(0.5)); return never; } \
        return vec4(0.0); return texture2D(t, vec2(0.5)); }\n\
        void main() { gl_FragColor = vec4(color(1).rg, read(s, 2).b, two(3).b); gl_FragColor.a = 1.0; return; gl_FragColor = texture2D(s, vec2(0.5)); }";
    assert!(near(shown(&format!("{}{QUAD}", program(PASS, fragment)), &[]).at(8, 8), [0, 255, 64]));
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
        let draw = format!("{}{QUAD}\n", program(PASS, &shader(layout)));
        for calls in [draw.clone(), format!("{target}{draw}{show}")] {
            let wanted = [x, y, 0.0].map(|value: f32| (value / 16.0 * 255.0).round() as u8);
            let seen = shown(&calls, &[]).at(3, 5);
            assert!(near(seen, wanted), "{layout}: {seen:?} is not {wanted:?}");
        }
    }
    let (why, _) = refused(&format!("{}{QUAD}", program(PASS, &shader("layout(early_fragment_tests) in; "))), &[]);
    assert!(why.contains("layout(early_fragment_tests) of this form is not supported"), "{why}");
}

#[test]
fn cases_go_on_with_the_next_one() {
    let text = "#version 130\nuniform int k; out vec4 c; void main() { c = vec4(0.0, 0.0, 0.0, 1.0); switch (k) { case 0: c.r = 1.0; case 1: c.g = 1.0; break; \
                case 2: case 3: c.b = 1.0; default: c.r = 0.5; } }";
    for (k, wanted) in [(0, [255, 255, 0]), (1, GREEN), (2, [128, 0, 255]), (3, [128, 0, 255]), (4, [128, 0, 0])] {
        let calls = format!("{}glGetUniformLocation(3,\"k\")=1\nglUniform1i(1,{k})\n{QUAD}", program(PASS, text));
        assert!(near(shown(&calls, &[]).at(8, 8), wanted), "{k}");
    }
    // Cases that end in other ways.
    let text = "#version 130\nuniform int k; out vec4 c; void main() { c = vec4(0.0, 0.0, 0.0, 1.0); switch (k) { case 0: c.r = 1.0; return; \
                case 1: { c.g = 1.0; break; } case 2: if (k == 2) { c.b = 1.0; break; } else discard; default: { return; } break; } c.rg += 0.5; }";
    for (k, wanted) in [(0, RED), (1, [128, 255, 0]), (2, [128, 128, 255]), (3, BLACK)] {
        let calls = format!("{}glGetUniformLocation(3,\"k\")=1\nglUniform1i(1,{k})\n{QUAD}", program(PASS, text));
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
    assert!(near(shown(&format!("{}{names}{values}{QUAD}", program(PASS, text)), &[]).at(8, 8), [64, 64, 191]));
    let (_, errors) = refused("glProgramUniform1f(9,1,0.5)", &[]);
    assert_eq!(errors, ["glProgramUniform1f: GL_INVALID_VALUE"]);
}

#[test]
fn what_may_be_forgotten_is_kept() {
    let texture = "glBindTexture(3553,1)\nglTexParameteri(3553,10241,9728)\nglTexParameteri(3553,10240,9728)\n\
                   glTexImage2D(3553,0,GL_BGRA,1,1,0,GL_BGRA,GL_UNSIGNED_BYTE,*1)\nglEnable(3553)\n";
    let calls = format!(
        "{texture}glInvalidateTexImage(1,0)\nglInvalidateBufferData(1)\nglQueryCounter(1,36392)\n{QUAD}\n\
         glInvalidateFramebuffer(GL_FRAMEBUFFER,1,{{GL_DEPTH}})"
    );
    assert_eq!(shown(&calls, &[&[0, 0, 255, 255]]).at(8, 8), RED);
}

#[test]
fn an_attached_depth_texture_is_read_where_nothing_tests_it() {
    let target = "glBindTexture(3553,1)\nglTexParameteri(3553,10241,9728)\nglTexParameteri(3553,10240,9728)\n\
                  glTexImage2D(3553,0,6408,16,16,0,6408,5121,U0x0)\nglBindTexture(3553,2)\nglTexParameteri(3553,10241,9728)\n\
                  glTexParameteri(3553,10240,9728)\nglTexImage2D(3553,0,GL_DEPTH_COMPONENT24,16,16,0,GL_DEPTH_COMPONENT,GL_FLOAT,U0x0)\n\
                  glBindFramebuffer(GL_FRAMEBUFFER,1)\nglFramebufferTexture2D(GL_FRAMEBUFFER,GL_COLOR_ATTACHMENT0,3553,1,0)\n\
                  glFramebufferTexture2D(GL_FRAMEBUFFER,GL_DEPTH_ATTACHMENT,3553,2,0)\nglCheckFramebufferStatus(GL_FRAMEBUFFER)=36053\n\
                  glViewport(0,0,16,16)\nglClearDepth(0.25)\nglClear(GL_COLOR_BUFFER_BIT | GL_DEPTH_BUFFER_BIT)\n";
    let read =
        program(PASS, "uniform sampler2D s; void main() { gl_FragColor = vec4(texture2D(s, vec2(0.5)).r, 1.0, 0.0, 1.0); }");
    let show = "glBindFramebuffer(GL_FRAMEBUFFER,0)\nglUseProgram(0)\nglBindTexture(3553,1)\nglEnable(3553)\n";
    assert!(near(shown(&format!("{target}{read}{QUAD}\n{show}{QUAD}"), &[]).at(8, 8), [64, 255, 0]));
    let (why, _) = refused(&format!("{target}{read}glEnable(GL_DEPTH_TEST)\n{QUAD}"), &[]);
    assert!(why.starts_with("drawing into a texture that the draw reads"), "{why}");
    // An object that is complete for the driver alone would lose draws.
    let empty = "glBindFramebuffer(GL_FRAMEBUFFER,1)\nglCheckFramebufferStatus(GL_FRAMEBUFFER)=36053\n";
    assert!(refused(empty, &[]).0.starts_with("a frame buffer object that is complete for the recorded driver"));
}

#[test]
fn an_error_of_a_draw_leaves_the_call_behind_it() {
    // The draw is made when the next call needs it. It has no image to draw to; that call selects the window again.
    let calls =
        format!("glBindFramebuffer(GL_FRAMEBUFFER,1)\n{QUAD}\nglBindFramebuffer(GL_FRAMEBUFFER,0)\nglColor3f(1,0,0)\n{QUAD}");
    let (trace, report) = recorded(&calls, &[], 0..u64::MAX, &Reading::default());
    assert_eq!(last_of(&trace).at(8, 8), RED);
    let errors: Vec<&str> = report.errors.iter().map(|(name, _)| name).collect();
    assert_eq!(errors, ["a draw: GL_INVALID_FRAMEBUFFER_OPERATION"]);
}
