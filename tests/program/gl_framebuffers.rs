//! Frame buffer objects, windows, clears and blits.

use std::path::Path;

use fillrate::import::gl::import_bytes;
use fillrate::trace::Reading;

use super::gl_scenes::{
    BLACK, BLUE, GREEN, PASS, PASS_POSITION, QUAD, RED, TEXTURE_AND_QUAD, imported, last_of, near, program, program_of,
    refused, refused_with_errors, shown, tolerated,
};

/// A texture of 16 x 16 in a frame buffer object; its lower half is red, its upper left quarter green.
const OBJECT: &str = "glBindTexture(GL_TEXTURE_2D,1)\nglTexParameteri(GL_TEXTURE_2D,GL_TEXTURE_MIN_FILTER,GL_NEAREST)\n\
    glTexParameteri(GL_TEXTURE_2D,GL_TEXTURE_MAG_FILTER,GL_NEAREST)\n\
    glTexImage2D(GL_TEXTURE_2D,0,GL_RGBA,16,16,0,GL_RGBA,GL_UNSIGNED_BYTE,U0x0)\nglBindFramebufferEXT(GL_FRAMEBUFFER_EXT,2)\n\
    glFramebufferTexture2DEXT(GL_FRAMEBUFFER_EXT,GL_COLOR_ATTACHMENT0_EXT,GL_TEXTURE_2D,1,0)\nglClearColor(0,0,0,1)\n\
    glClear(GL_COLOR_BUFFER_BIT)\nglEnable(GL_CULL_FACE)\n\
    glColor3f(1,0,0)\nglRectf(-1,-1,1,0)\nglColor3f(0,1,0)\nglRectf(-1,0,0,1)\nglColor3f(1,1,1)\n";

#[test]
fn what_is_drawn_into_a_texture_is_upright_where_it_is_read() {
    let image = shown(&format!("{OBJECT}glBindFramebufferEXT(GL_FRAMEBUFFER_EXT,0)\n{TEXTURE_AND_QUAD}"), &[]);
    for (x, y, color) in [(0, 0, RED), (15, 7, RED), (0, 8, GREEN), (7, 15, GREEN), (8, 8, BLACK), (15, 15, BLACK)] {
        assert_eq!(image.at(x, y), color, "{x}, {y}");
    }
    // Scissor, window positions and copies count rows from the bottom there too.
    let image = shown(
        &format!(
            "{OBJECT}glEnable(GL_SCISSOR_TEST)\nglScissor(1,2,1,1)\nglClearColor(0,0,1,1)\nglClear(GL_COLOR_BUFFER_BIT)\n\
             glDisable(GL_SCISSOR_TEST)\nglWindowPos2i(4,12)\nglCopyPixels(1,2,1,1,GL_COLOR)\n\
             glBindFramebufferEXT(GL_FRAMEBUFFER_EXT,0)\n{TEXTURE_AND_QUAD}"
        ),
        &[],
    );
    let blue: Vec<(usize, usize)> = image.lit().into_iter().filter(|&(x, y)| image.at(x, y) == BLUE).collect();
    assert_eq!(blue, [(1, 2), (4, 12)]);
}

#[test]
fn levels_are_made_of_what_was_drawn_and_blits_move_it() {
    // The last level is the mean: half red, a quarter green.
    let image = shown(
        &format!(
            "{OBJECT}glBindFramebufferEXT(GL_FRAMEBUFFER_EXT,0)\nglGenerateMipmapEXT(GL_TEXTURE_2D)\n\
             glTexParameteri(GL_TEXTURE_2D,GL_TEXTURE_BASE_LEVEL,4)\n{TEXTURE_AND_QUAD}"
        ),
        &[],
    );
    assert!(near(image.at(5, 5), [128, 64, 0]), "{:?}", image.at(5, 5));
    // The left half, upside down, into the window's right upper quarter.
    let image = shown(
        &format!(
            "{OBJECT}glBindFramebuffer(GL_DRAW_FRAMEBUFFER,0)\nglBlitFramebuffer(0,0,8,16,8,16,16,8,GL_COLOR_BUFFER_BIT,GL_NEAREST)"
        ),
        &[],
    );
    assert_eq!([image.at(8, 8), image.at(15, 11), image.at(8, 12), image.at(15, 15)], [GREEN, GREEN, RED, RED]);
    assert_eq!(image.lit().len(), 64);
}

#[test]
fn one_level_of_a_texture_can_be_drawn_from_the_level_before() {
    let image = shown(
        &format!(
            "{OBJECT}glTexImage2D(GL_TEXTURE_2D,1,GL_RGBA,8,8,0,GL_RGBA,GL_UNSIGNED_BYTE,U0x0)\n\
             glTexParameteri(GL_TEXTURE_2D,GL_TEXTURE_MAX_LEVEL,0)\n\
             glFramebufferTexture2DEXT(GL_FRAMEBUFFER_EXT,GL_COLOR_ATTACHMENT0_EXT,GL_TEXTURE_2D,1,1)\nglViewport(0,0,8,8)\n{TEXTURE_AND_QUAD}\
             glBindFramebufferEXT(GL_FRAMEBUFFER_EXT,0)\nglViewport(0,0,16,16)\n\
             glTexParameteri(GL_TEXTURE_2D,GL_TEXTURE_MAX_LEVEL,1)\nglTexParameteri(GL_TEXTURE_2D,GL_TEXTURE_BASE_LEVEL,1)\n{TEXTURE_AND_QUAD}"
        ),
        &[],
    );
    assert_eq!([image.at(0, 0), image.at(15, 7), image.at(0, 8), image.at(15, 15)], [RED, RED, GREEN, BLACK]);
}

#[test]
fn depths_are_written_into_a_texture_without_contents() {
    // The right half of an image that was defined without contents.
    let image = shown(
        &format!(
            "glTexParameteri(GL_TEXTURE_2D,GL_TEXTURE_MIN_FILTER,GL_NEAREST)\nglTexParameteri(GL_TEXTURE_2D,GL_TEXTURE_MAG_FILTER,GL_NEAREST)\n\
             glTexImage2D(GL_TEXTURE_2D,0,GL_DEPTH_COMPONENT16,2,1,0,GL_DEPTH_COMPONENT,GL_UNSIGNED_SHORT,U0x0)\n\
             glTexSubImage2D(GL_TEXTURE_2D,0,1,0,1,1,GL_DEPTH_COMPONENT,GL_UNSIGNED_SHORT,*1)\n{TEXTURE_AND_QUAD}"
        ),
        &[&[0, 128, 0, 0]],
    );
    assert!(near(image.at(4, 8), BLACK) && near(image.at(12, 8), [128; 3]), "{:?} {:?}", image.at(4, 8), image.at(12, 8));
}

#[test]
fn a_frame_buffer_object_of_depths_alone_gives_a_shadow_map() {
    let calls = format!(
        "glBindTexture(GL_TEXTURE_2D,1)\nglTexParameteri(GL_TEXTURE_2D,GL_TEXTURE_MIN_FILTER,GL_NEAREST)\n\
         glTexImage2D(GL_TEXTURE_2D,0,GL_DEPTH_COMPONENT24,8,8,0,GL_DEPTH_COMPONENT,GL_FLOAT,U0x0)\n\
         glBindFramebuffer(GL_FRAMEBUFFER,3)\nglFramebufferTexture2D(GL_FRAMEBUFFER,GL_DEPTH_ATTACHMENT,GL_TEXTURE_2D,1,0)\n\
         glDrawBuffer(GL_NONE)\nglViewport(0,0,8,8)\nglClear(GL_DEPTH_BUFFER_BIT)\nglEnable(GL_DEPTH_TEST)\nglRectf(-1,-1,1,0)\n\
         glDisable(GL_DEPTH_TEST)\nglBindFramebuffer(GL_FRAMEBUFFER,0)\nglViewport(0,0,16,16)\n{TEXTURE_AND_QUAD}"
    );
    let image = shown(&calls, &[]);
    assert!(near(image.at(9, 3), [128; 3]) && image.at(9, 12) == [255; 3], "{:?}", image.at(9, 3));
}

#[test]
fn what_is_drawn_to_the_front_is_not_in_the_next_frame() {
    let image =
        shown("glDrawBuffer(GL_FRONT)\nglRectf(-1,-1,1,1)\nglDrawBuffer(GL_BACK)\nglColor3f(1,0,0)\nglRectf(-1,-1,0,0)", &[]);
    assert_eq!((image.at(1, 1), image.lit().len()), (RED, 64));
    // It can be copied from.
    let image = shown(
        "glDrawBuffer(GL_FRONT)\nglColor3f(0,1,0)\nglRectf(-1,-1,1,1)\nglDrawBuffer(GL_BACK)\nglReadBuffer(GL_FRONT)\nglWindowPos2i(8,8)\n\
         glCopyPixels(0,0,2,2,GL_COLOR)",
        &[],
    );
    assert_eq!((image.at(9, 9), image.lit().len()), (GREEN, 4));
}

#[test]
fn only_what_the_wanted_frames_need_is_translated() {
    let frame = |color: &str| {
        format!(
            "glClear(GL_COLOR_BUFFER_BIT | GL_DEPTH_BUFFER_BIT)\nglColor3f({color})\nglRectf(-1,-1,0,0)\nwglSwapBuffers(1)\n"
        )
    };
    let calls = [frame("1,0,0"), frame("1,1,0"), frame("0,1,0"), "glNoSuchFunction()\n".into()].concat();
    let (trace, report) = imported(&calls, &[], 2..3);
    assert_eq!((report.frames, report.dropped, last_of(&trace).at(1, 1)), (3, 1, GREEN));
    // A frame that is not cleared shows what was drawn before.
    let kept = calls.replacen("glColor3f(0,1,0)", "glColor3f(0,1,0)\nglTranslatef(1,1,0)", 1);
    let at = kept.rfind("glClear").expect("a clear");
    let kept = format!("{}{}", &kept[..at], kept[at..].split_once('\n').expect("lines").1);
    let (trace, report) = imported(&kept, &[], 2..3);
    let image = last_of(&trace);
    assert_eq!((report.dropped, image.at(1, 1), image.at(9, 9)), (1, [255, 255, 0], GREEN));
}

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
fn one_buffer_is_cleared_with_a_value_of_its_own() {
    let depth = "glClearBufferfv(GL_DEPTH,0,{0.25})\nglEnable(GL_DEPTH_TEST)\nglColor3f(0,0,1)\n";
    let color = "glClearColor(0,1,0,1)\nglClearBufferfv(GL_COLOR,0,{1,0,0,1})\n";
    // At depth 0.5 nothing passes; the value of glClear is another one.
    assert_eq!(shown(&format!("{color}{depth}{QUAD}"), &[]).at(8, 8), RED);
    assert_eq!(shown(&format!("{color}{depth}glClearBufferfi(GL_DEPTH_STENCIL,0,1,0)\n{QUAD}"), &[]).at(8, 8), BLUE);
    assert_eq!(shown(&format!("{color}glClear(GL_COLOR_BUFFER_BIT)"), &[]).at(8, 8), GREEN);
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
        let (why, _) =
            refused_with_errors(&format!("{unbound}{again}glBindFramebuffer(GL_FRAMEBUFFER,1)\nglClear(16384)"), &[]);
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
    let read = program_of(
        PASS_POSITION,
        "uniform sampler2D s; void main() { gl_FragColor = vec4(texture2D(s, vec2(0.5)).r, 1.0, 0.0, 1.0); }",
    );
    let show = "glBindFramebuffer(GL_FRAMEBUFFER,0)\nglUseProgram(0)\nglBindTexture(3553,1)\nglEnable(3553)\n";
    assert!(near(shown(&format!("{target}{read}{QUAD}\n{show}{QUAD}"), &[]).at(8, 8), [64, 255, 0]));
    let (why, _) = refused_with_errors(&format!("{target}{read}glEnable(GL_DEPTH_TEST)\n{QUAD}"), &[]);
    assert!(why.starts_with("drawing into a texture that the draw reads"), "{why}");
    // An object that is complete for the driver alone would lose draws.
    let empty = "glBindFramebuffer(GL_FRAMEBUFFER,1)\nglCheckFramebufferStatus(GL_FRAMEBUFFER)=36053\n";
    assert!(refused_with_errors(empty, &[]).0.starts_with("a frame buffer object that is complete for the recorded driver"));
}

#[test]
fn both_buffers_of_a_window_are_drawn_to() {
    for buffer in ["GL_LEFT", "GL_FRONT_AND_BACK"] {
        assert_eq!(shown(&format!("glDrawBuffer({buffer})\nglColor3f(1,0,0)\n{QUAD}"), &[]).at(8, 8), RED, "{buffer}");
        let read = |then: &str| {
            refused(
                &format!(
                    "glDrawBuffer({buffer})\n{QUAD}\n{then}glReadBuffer(GL_FRONT)\nglRasterPos2f(0,0)\nglCopyPixels(0,0,4,4,GL_COLOR)"
                ),
                &[],
            )
        };
        assert!(read("").starts_with("reading the front buffer"), "{}", read(""));
        assert_eq!(read("wglSwapBuffers(1)\n"), "");
    }
    // A window has no right buffers.
    let (image, errors) =
        tolerated(&format!("glDrawBuffer(GL_RIGHT)\nglReadBuffer(GL_RIGHT)\nglReadBuffer(77)\nglColor3f(1,0,0)\n{QUAD}"), &[]);
    assert_eq!(image.at(8, 8), RED);
    assert_eq!(
        errors,
        ["glDrawBuffer: GL_INVALID_OPERATION", "glReadBuffer: GL_INVALID_ENUM", "glReadBuffer: GL_INVALID_OPERATION"]
    );
}
