//! Recorded OpenGL programs: small recordings that are written here, read back, damaged and refused.

use std::path::Path;

use import::Report;
use import::gl::import_bytes;
use proptest::prelude::*;
use trace::command::{Command, ShaderSource};
use trace::{Reading, Trace, TraceError, check};

use crate::recorder::{Value, Writer};

const TRIANGLES: u64 = 4;
const COLOR_BUFFER_BIT: u64 = 0x4000;
const LIGHTING: u64 = 0xb50;
const LIGHT0: u64 = 0x4000;
const TEXTURE_2D: u64 = 0xde1;

/// A triangle, lit and textured, in two frames.
fn program(version: u64) -> Writer {
    program_after(Writer::new(version))
}

/// As [`program`], after other calls.
fn program_after(mut w: Writer) -> Writer {
    use Value::*;
    w.call("glViewport", &[Uint(0), Uint(0), Uint(32), Uint(16)]);
    w.call("glEnable", &[Enum(LIGHTING)]);
    w.call("glEnable", &[Enum(LIGHT0)]);
    w.call("glLightfv", &[Enum(LIGHT0), Enum(0x1203), Floats(vec![0.0, 0.0, 1.0, 0.0])]);
    w.call("glBindTexture", &[Enum(TEXTURE_2D), Uint(3)]);
    w.call("glTexParameteri", &[Enum(TEXTURE_2D), Enum(0x2801), Sint(0)]);
    w.call("glTexParameteri", &[Enum(TEXTURE_2D), Enum(0x2801), Enum(0x2600)]);
    let texels = vec![200; 16];
    w.call(
        "glTexImage2D",
        &[Enum(TEXTURE_2D), Uint(0), Uint(0x1908), Uint(2), Uint(2), Uint(0), Enum(0x1908), Enum(0x1401), Blob(texels)],
    );
    w.call("glEnable", &[Enum(TEXTURE_2D)]);
    w.call("glNewList", &[Uint(1), Enum(0x1300)]);
    w.call("glBegin", &[Enum(TRIANGLES)]);
    for [x, y] in [[-1.0, -1.0], [1.0, -1.0], [0.0, 1.0]] {
        w.call("glTexCoord2f", &[Float(x), Float(y)]);
        w.call("glVertex3f", &[Float(x), Float(y), Float(0.0)]);
    }
    w.call("glEnd", &[]);
    w.call("glEndList", &[]);
    for _ in 0..2 {
        w.call("glClear", &[Uint(COLOR_BUFFER_BIT)]);
        w.call("glCallList", &[Uint(1)]);
        w.call("glXSwapBuffers", &[Uint(1), Uint(2)]);
    }
    w
}

fn imported(bytes: Vec<u8>) -> Result<(Trace, Report), String> {
    import_bytes(Path::new("x.trace"), bytes, [&[], &[]], &Reading::default()).map_err(|error| error.to_string())
}

fn draws(trace: &Trace) -> usize {
    let mut draws = 0;
    let counted: Result<(), TraceError> = trace.for_each_command(|_, command| {
        draws += usize::from(matches!(command, Command::DrawIndexed { .. }));
        Ok(())
    });
    counted.expect("commands in memory");
    draws
}

#[test]
fn every_version_of_the_container_is_read_and_chunks_mean_nothing() {
    for version in 1..=6 {
        for chunk in [7, 1 << 20] {
            let (trace, report) = imported(program(version).file(chunk)).expect("a recording");
            let summary = check(&trace).expect("a valid trace");
            assert_eq!((summary.frames, draws(&trace), report.frames), (2, 2, 2), "version {version}");
            assert!(report.unsupported.is_empty(), "{:?}", report.unsupported);
            // The parameter that is no enumerant raised an error, and had no effect.
            assert!(report.errors.iter().all(|(name, _)| name.contains("glTexParameteri")));
        }
    }
    let error = imported(Writer::new(7).file(64)).err().expect("a version that is not known");
    assert!(error.contains("version 7"), "{error}");
}

#[test]
fn gzip_and_brotli_are_read() {
    use std::io::Write;
    let mut packed = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::fast());
    packed.write_all(&program(4).bytes).expect("memory");
    let (trace, _) = imported(packed.finish().expect("memory")).expect("a recording");
    assert_eq!(draws(&trace), 2);
    // Brotli without compression: a window of 64 KiB, one part of this length, and an empty last part (RFC 7932, section 9).
    let plain = program(4).bytes;
    let header = ((plain.len() as u32 - 1) << 4 | 1 << 20).to_le_bytes();
    let packed = [&header[..3], &plain, &[3]].concat();
    let (trace, _) = imported(packed.clone()).expect("a recording");
    assert_eq!(draws(&trace), 2);
    let (_, report) = imported(packed[..packed.len() / 2].to_vec()).expect("half of a recording");
    let cut = report.cut.expect("it is cut");
    assert!(cut.contains("call ") && cut.contains("byte ") && cut.contains("cannot be expanded"), "{cut}");
    let folder = tempfile::tempdir().expect("a folder");
    let kind = |bytes: &[u8]| {
        let path = folder.path().join("x.trace");
        std::fs::write(&path, bytes).expect("a file");
        import::detect(&path).map(|found| found.kind)
    };
    assert_eq!(kind(&packed), Some(import::TraceKind::Apitrace));
    assert_eq!(kind(b"\x8b\x02\x80more"), None);
    let error = imported(b"\x8b\x02\x80more".to_vec()).err().expect("no recording");
    assert!(error.contains("container of version 109"), "{error}");
}

#[test]
fn what_is_not_supported_is_counted_by_name() {
    let mut w = program(6);
    for _ in 0..3 {
        w.call("glTexImage2DMultisample", &[Value::Enum(0x9100), Value::Uint(4)]);
    }
    let (_, report) = imported(w.file(1 << 20)).expect("a recording");
    let refusal = report.refusal().expect("something is not supported");
    assert_eq!(refusal, format!("glTexImage2DMultisample (3 times, first in call {})", program(6).calls));
}

#[test]
fn windows_that_are_drawn_in_turn_are_refused_and_a_new_window_is_not() {
    let swapped = |drawables: &[u64]| {
        let mut w = Writer::new(6);
        w.call("glViewport", &[Value::Uint(0), Value::Uint(0), Value::Uint(8), Value::Uint(8)]);
        for &drawable in drawables {
            w.call("glXSwapBuffers", &[Value::Uint(1), Value::Uint(drawable)]);
        }
        imported(w.file(1 << 20)).expect("a recording").1.refusal()
    };
    assert_eq!(swapped(&[1002, 1002, 1003, 1003]), None);
    let refusal = swapped(&[1002, 1003, 1002, 1003]).expect("a refusal");
    assert!(
        refusal.starts_with("windows that are drawn in turn, without a call that makes a context current (2 times"),
        "{refusal}"
    );
}

#[test]
fn a_window_accumulates_only_if_the_program_asks_for_it() {
    let errors = |list: &[f32]| {
        let mut w = Writer::new(6);
        w.call("glXChooseVisual", &[Value::Uint(1), Value::Uint(0), Value::Floats(list.to_vec())]);
        w.call("glViewport", &[Value::Uint(0), Value::Uint(0), Value::Uint(8), Value::Uint(8)]);
        w.call("glAccum", &[Value::Enum(0x101), Value::Float(1.0)]);
        imported(w.file(1 << 20)).expect("a recording").1.errors.len()
    };
    // GLX_RGBA, GLX_ACCUM_RED_SIZE.
    assert_eq!((errors(&[4.0, 0.0]), errors(&[4.0, 14.0, 8.0, 0.0])), (1, 0));
}

#[test]
fn parts_of_no_bytes_and_elements_behind_a_buffer_are_no_damage() {
    let mut w = Writer::new(6);
    w.call("glViewport", &[Value::Uint(0), Value::Uint(0), Value::Uint(8), Value::Uint(8)]);
    w.call("glBindBuffer", &[Value::Enum(0x8892), Value::Uint(1)]);
    w.call("glBufferData", &[Value::Enum(0x8892), Value::Uint(16), Value::Null, Value::Enum(0x88e4)]);
    w.call("glBufferSubData", &[Value::Enum(0x8892), Value::Uint(16), Value::Uint(0), Value::Null]);
    w.call("glEnableClientState", &[Value::Enum(0x8074)]);
    w.call("glVertexPointer", &[Value::Uint(2), Value::Enum(0x1406), Value::Uint(0), Value::Null]);
    w.call("glDrawArrays", &[Value::Enum(4), Value::Uint(0), Value::Uint(3)]);
    let (_, report) = imported(w.file(1 << 20)).expect("a recording");
    assert!(report.unsupported.is_empty() && report.errors.is_empty(), "{:?} {:?}", report.unsupported, report.errors);
}

/// Channels that the program writes to a window that is asked for like this: bit 0 red to bit 3 alpha.
fn written(choose: &str, first: usize, list: &[f32]) -> Vec<u8> {
    let mut w = Writer::new(6);
    let mut args = vec![Value::Uint(1); first];
    args.push(Value::Floats(list.to_vec()));
    w.call(choose, &args);
    let (trace, _) = imported(program_after(w).file(1 << 20)).expect("a recording");
    let mut masks = Vec::new();
    let read: Result<(), TraceError> = trace.for_each_command(|_, command| {
        if let Command::CreateTexture { desc, label, .. } = command {
            assert_eq!(desc.opaque, label.as_deref() == Some("window"), "a screen shows no alpha: {label:?}");
        }
        if let Command::CreateRenderPipeline { desc, .. } = command {
            masks.extend(desc.targets.iter().flatten().map(|target| target.write_mask));
        }
        Ok(())
    });
    read.expect("commands in memory");
    assert!(!masks.is_empty());
    masks
}

#[test]
fn a_window_has_alpha_if_the_program_asks_for_it() {
    let with = |mask: u8, masks: Vec<u8>| assert!(masks.iter().all(|&m| m == mask), "{masks:?}");
    // EGL_ALPHA_SIZE and EGL_DEPTH_SIZE.
    with(15, written("eglChooseConfig", 1, &[12325.0, 8.0, 12321.0, 8.0, 12344.0]));
    with(7, written("eglChooseConfig", 1, &[12321.0, 0.0, 12325.0, 8.0, 12344.0]));
    // GLX_RGBA and GLX_DOUBLEBUFFER have no value, GLX_ALPHA_SIZE (11) and GLX_DEPTH_SIZE (12) have.
    with(15, written("glXChooseVisual", 2, &[4.0, 5.0, 11.0, 1.0, 0.0]));
    with(7, written("glXChooseVisual", 2, &[4.0, 12.0, 11.0, 5.0, 0.0]));
    with(15, written("glXChooseFBConfig", 2, &[5.0, 1.0, 11.0, 1.0, 0.0]));
}

#[test]
fn a_call_that_raises_an_error_has_no_effect() {
    let mut w = Writer::new(6);
    w.call("glViewport", &[Value::Uint(0), Value::Uint(0), Value::Uint(8), Value::Uint(8)]);
    w.call("glPopMatrix", &[]);
    w.call("glBegin", &[Value::Enum(99)]);
    w.call("glEnd", &[]);
    w.call("glViewport", &[Value::Uint(0), Value::Uint(0), Value::Sint(8), Value::Uint(8)]);
    w.call("glXSwapBuffers", &[]);
    let (trace, report) = imported(w.file(1 << 20)).expect("a recording");
    check(&trace).expect("a valid trace");
    let errors: Vec<&str> = report.errors.iter().map(|(name, _)| name).collect();
    let wanted = [
        "glBegin: GL_INVALID_ENUM",
        "glEnd: GL_INVALID_OPERATION",
        "glPopMatrix: GL_STACK_UNDERFLOW",
        "glViewport: GL_INVALID_VALUE",
    ];
    assert_eq!(errors, wanted);
}

#[test]
fn a_recording_that_is_cut_anywhere_has_what_is_whole() {
    // In many chunks, and in one.
    for chunk in [64, 1 << 20] {
        let whole = program(6).file(chunk);
        let (all, _) = imported(whole.clone()).expect("a recording");
        let (mut errors, mut cuts, mut last) = (0, 0, (0, 0));
        for length in 0..whole.len() {
            match imported(whole[..length].to_vec()) {
                Ok((trace, report)) => {
                    check(&trace).expect("a valid trace");
                    let calls: u64 = report.calls.iter().map(|(_, count)| count).sum();
                    assert!((calls, report.frames) >= last && draws(&trace) <= draws(&all), "{length}");
                    last = (calls, report.frames);
                    cuts += usize::from(report.cut.is_some_and(|cut| cut.starts_with("call ") && cut.contains(", byte ")));
                }
                // Not even the header is there.
                Err(error) => {
                    errors += 1;
                    assert_eq!(last, (0, 0), "{length}: {error}");
                }
            }
        }
        // Only where a chunk ends between two events nothing is seen to be missing.
        assert!(errors < 40 && cuts > (whole.len() - errors) * 9 / 10, "{errors} errors, {cuts} cuts of {}", whole.len());
        assert!(last.1 == 2, "{last:?}");
    }
}

#[test]
fn what_was_drawn_after_the_last_swap_is_a_frame_where_the_end_is_cut() {
    let (whole, frame) = ("GLI0.t\n#! RES 8x8\n", "glClear(GL_COLOR_BUFFER_BIT)\nglRectf(-1,-1,0,0)\nwglSwapBuffers(1)\n");
    let of = |text: String| {
        let (trace, report) = imported_text(text.as_bytes(), &memory()).expect("a recording");
        let mut shown = 0;
        let counted = trace.for_each_command(|_, command| -> Result<(), TraceError> {
            shown += u64::from(matches!(command, Command::Present { .. }));
            Ok(())
        });
        counted.expect("commands");
        assert_eq!(shown, report.frames);
        (report.frames, report.cut)
    };
    let place = |call: u64, line: u64| Some(format!("call {call}, line {line}: glRectf: arguments without an end"));
    assert_eq!(of(format!("{whole}{frame}{frame}")), (2, None));
    // Whole calls behind the last swap are no frame, as with a program that ends.
    assert_eq!(of(format!("{whole}{frame}glRectf(-1,-1,0,0)\n")), (1, None));
    assert_eq!(of(format!("{whole}{frame}glRectf(-1,-1,0,0)\nglRectf(0")), (2, place(4, 7)));
    // Nothing was drawn.
    assert_eq!(of(format!("{whole}{frame}glRectf(0")), (1, place(3, 6)));
    assert_eq!(of(format!("{whole}glRectf(-1,-1,0,0)\nglRectf(0")), (0, place(1, 4)));
    let text = "glProgramStringARB(GL_VERTEX_PROGRAM_ARB,GL_PROGRAM_FORMAT_ASCII_ARB,9,\"!!ARB\nEND\n";
    assert_eq!(of(format!("{whole}{frame}{text}")).1.as_deref(), Some("call 3, line 7: the recording ends inside a call"));
    // A call that did not return: the program crashed in it.
    let mut w = program(6);
    w.call("glClear", &[Value::Uint(COLOR_BUFFER_BIT)]);
    let bytes = w.file(1 << 20);
    let (_, report) = imported(bytes).expect("a recording");
    assert_eq!((report.frames, report.cut), (2, None));
}

#[test]
fn a_long_recording_that_is_refused_can_be_inspected() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("refused.txt");
    let frame = "glRectf(-1,-1,0,0)\nglNoSuchThing(1)\nwglSwapBuffers(1)\n";
    std::fs::write(&path, format!("GLI0.t\n#! RES 8x8\n{}glRect", frame.repeat(20))).expect("a file");
    let reading = Reading { in_memory: Some(0), lenient: true, ..Reading::default() };
    let (trace, report) = import::open_reported(&path, &reading).expect("a recording");
    let report = report.expect("a report");
    assert_eq!(check(&trace).expect("a trace").frames, 20);
    assert_eq!((report.frames, report.windows[0].size, report.unsupported.len()), (20, [8, 8], 1));
    // What is said is the same before and after the commands have been read.
    assert_eq!(trace.origin(), report.origin());
    let (trace, none) = import::open_frames(&path, &reading, 0..u64::MAX).expect("a recording");
    assert!(none.is_none());
    trace.for_each_command(|_, _| -> Result<(), TraceError> { Ok(()) }).expect("commands");
    assert_eq!(trace.origin(), report.origin());
    assert!(report.cut.is_some_and(|cut| cut.starts_with("call 60, line 63: ")));
}

const TEXT: &str = "GLI0.h\n#! RES 16x8\n# a comment\nglClearColor(0x3f800000,0x0,0x0,0x3f800000)\n\
    glClear(GL_DEPTH_BUFFER_BIT | GL_COLOR_BUFFER_BIT)\nglMultMatrixd({0x0.0x3ff00000,0x0.0x0,0x0.0x0,0x0.0x0,0x0.0x0,0x0.0x3ff00000,\
    0x0.0x0,0x0.0x0,0x0.0x0,0x0.0x0,0x0.0x3ff00000,0x0.0x0,0x0.0x0,0x0.0x0,0x0.0x0,0x0.0x3ff00000})\n\
    glEnableClientState(GL_VERTEX_ARRAY)\nglVertexPointer(2,GL_FLOAT,0,*4)\nglDrawArrays(GL_TRIANGLES,0,3)\n\
    glProgramStringARB(GL_VERTEX_PROGRAM_ARB,GL_PROGRAM_FORMAT_ASCII_ARB,9,\"!!ARB\nEND\n\")\nwglSwapBuffers(7)=NOT TRACED\n";

/// Pixel rectangles, frame buffer objects and all else that is no triangle.
const FEATURES: &str = "GLI0.t\n#! RES 8x8\nglPixelZoom(2,-1)\nglPixelTransferf(GL_RED_SCALE,0.5)\nglPixelMapfv(GL_PIXEL_MAP_I_TO_R,2,{0,1})\n\
    glRasterPos3f(0.1,0.2,0.3)\nglBitmap(8,2,1,0,9,2,*4)\nglDrawPixels(2,2,GL_RGBA,GL_UNSIGNED_BYTE,*4)\nglCopyPixels(0,0,3,3,GL_COLOR)\n\
    glDrawPixels(2,1,GL_DEPTH_COMPONENT,GL_FLOAT,*4)\nglDrawPixels(2,1,GL_STENCIL_INDEX,GL_UNSIGNED_BYTE,*4)\nglEnable(GL_LINE_STIPPLE)\n\
    glLineStipple(2,9)\nglBegin(GL_LINE_LOOP)\nglVertex3f(0,0,-3)\nglVertex2f(1,0)\nglVertex2f(1,1)\nglEnd()\nglAccum(GL_LOAD,0.5)\n\
    glAccum(GL_RETURN,1)\nglBindTexture(GL_TEXTURE_2D,1)\nglTexImage2D(GL_TEXTURE_2D,0,GL_RGBA,4,4,1,GL_RGBA,GL_UNSIGNED_BYTE,U0x0)\n\
    glTexImage2D(GL_TEXTURE_2D,0,GL_RGBA,4,4,0,GL_RGBA,GL_UNSIGNED_BYTE,U0x0)\nglBindFramebufferEXT(GL_FRAMEBUFFER_EXT,2)\n\
    glFramebufferTexture2DEXT(GL_FRAMEBUFFER_EXT,GL_COLOR_ATTACHMENT0_EXT,GL_TEXTURE_2D,1,0)\nglBindRenderbuffer(GL_RENDERBUFFER,3)\n\
    glRenderbufferStorage(GL_RENDERBUFFER,GL_DEPTH_COMPONENT24,4,4)\n\
    glFramebufferRenderbuffer(GL_FRAMEBUFFER,GL_DEPTH_ATTACHMENT,GL_RENDERBUFFER,3)\nglClear(GL_COLOR_BUFFER_BIT)\nglRectf(-1,-1,0,0)\n\
    glBindFramebuffer(GL_DRAW_FRAMEBUFFER,0)\nglBlitFramebuffer(0,0,4,4,7,0,1,6,GL_COLOR_BUFFER_BIT,GL_LINEAR)\n\
    glBindFramebuffer(GL_FRAMEBUFFER,0)\nglGenerateMipmap(GL_TEXTURE_2D)\nglTexParameteri(GL_TEXTURE_2D,GL_TEXTURE_BASE_LEVEL,1)\n\
    glEnable(GL_TEXTURE_2D)\nglBeginQueryARB(GL_SAMPLES_PASSED,5)\nglRectf(0,0,1,1)\nglEndQueryARB(GL_SAMPLES_PASSED)\n\
    glBindTexture(GL_TEXTURE_2D,2)\nglCompressedTexImage2D(GL_TEXTURE_2D,0,GL_COMPRESSED_RGB_S3TC_DXT1_EXT,4,4,0,8,*4)\n\
    glCompressedTexSubImage2D(GL_TEXTURE_2D,0,0,0,4,4,GL_COMPRESSED_RGB_S3TC_DXT1_EXT,8,*4)\n\
    glCopyTexImage2D(GL_TEXTURE_2D,0,GL_DEPTH_COMPONENT,0,0,4,4,0)\nglRectf(0,0,1,1)\nglDrawBuffer(GL_FRONT)\nglRectf(0,0,1,1)\n\
    glBindBuffer(GL_PIXEL_UNPACK_BUFFER,7)\nglBufferData(GL_PIXEL_UNPACK_BUFFER,24,*4,GL_STREAM_DRAW)\nglTexSubImage2D(GL_TEXTURE_2D,0,0,0,2,1,GL_DEPTH_COMPONENT,GL_FLOAT,4)\n\
    glCopyPixels(0,0,2,2,GL_DEPTH)\nglCopyPixels(0,0,2,2,GL_STENCIL)\nglStencilFuncSeparate(GL_BACK,GL_ALWAYS,3,255)\nglEnable(GL_STENCIL_TEST)\n\
    glEnableClientState(GL_VERTEX_ARRAY)\nglVertexPointer(2,GL_FLOAT,0,*4)\nglNewList(1,GL_COMPILE_AND_EXECUTE)\nglBegin(GL_TRIANGLES)\nglColor3f(1,0,0)\nglVertex2f(0,0)\n\
    glVertex2f(1,0)\nglVertex2f(1,1)\nglEnd()\nglBegin(GL_LINES)\nglArrayElement(0)\nglArrayElement(1)\nglEnd()\nglEndList()\nglCallList(1)\nglCallList(1)\n\
    glBindBuffer(GL_PIXEL_UNPACK_BUFFER,0)\nglTexImage3D(GL_TEXTURE_3D,0,GL_RGBA,2,2,2,0,GL_RGBA,GL_UNSIGNED_BYTE,U0x0)\nglCopyTexSubImage3D(GL_TEXTURE_3D,0,0,0,1,0,0,2,2)\n\
    wglSwapBuffers(1)\n";

/// A recording that draws with these shaders.
fn drawn_with(vertex: &str, fragment: &str) -> String {
    let shader = |name: u32, stage: &str, text: &str| {
        format!("glCreateShader(GL_{stage}_SHADER)={name}\nglShaderSource({name},1,\"{text}\",0)\nglCompileShader({name})\n")
    };
    format!(
        "GLI0.t\n#! RES 8x8\n{}{}glCreateProgram()=3\nglAttachShader(3,1)\nglAttachShader(3,2)\nglLinkProgram(3)\nglUseProgram(3)\n\
         glGetUniformLocation(3,\"list\")=0\nglUniform2f(1,2,3)\nglRectf(-1,-1,1,1)\nwglSwapBuffers(1)\n",
        shader(1, "VERTEX", vertex),
        shader(2, "FRAGMENT", fragment)
    )
}

#[test]
fn damaged_shaders_end_with_a_trace_or_a_message() {
    let vertex = "uniform vec2 list[3];\nattribute vec3 a; varying vec4 v[2];\nvoid main() { int i = 1; v[i].x = list[i].y;\n\
                  gl_TexCoord[1] = gl_LightSource[i].diffuse; gl_Position = ftransform() + vec4(a, 0.0); }";
    let fragment = "#version 120\n#define TWO(x) (2.0 * x)\nvarying vec4 v[2]; uniform sampler2D t;\nstruct S { vec2 m; float x[2]; }; uniform S s;\n\
                    void main() { S o = s; gl_FragColor = texture2D(t, v[1].xy * o.m, 0.5) * TWO(o.x[1]) + dFdy(v[0]); }";
    let (mut drawn, mut refused) = (0, 0);
    for (text, first) in [(vertex, true), (fragment, false)] {
        for at in (0..text.len()).filter(|at| text.is_char_boundary(*at)) {
            for letter in ["", "[", "9", ".", ";", "-", "\u{e9}", "{", "gl_"] {
                let damaged = format!("{}{letter}{}", &text[..at], &text[at + 1..]);
                let calls = if first { drawn_with(&damaged, fragment) } else { drawn_with(vertex, &damaged) };
                let (_, report) = imported(calls.into_bytes()).expect("a damaged shader does not end the import");
                let refusal = report.refusal().unwrap_or_default();
                drawn += usize::from(refusal.is_empty());
                refused += usize::from(refusal.contains("drawing with GLSL program 3: "));
            }
        }
    }
    assert!(drawn > 100 && refused > 1000, "{drawn} are drawn and {refused} refused");
}

#[test]
fn the_recording_of_features_is_whole() {
    let (trace, report) = imported_text(FEATURES.as_bytes(), &memory()).expect("a recording");
    assert_eq!(check(&trace).expect("a valid trace").frames, 1);
    assert!(report.unsupported.is_empty() && report.errors.is_empty(), "{:?} {:?}", report.unsupported, report.errors);
}

/// Commands with the contents of their blobs in the place of names.
fn with_contents(trace: &Trace) -> Vec<(Command, Vec<u8>)> {
    let mut list = Vec::new();
    trace
        .for_each_command(|_, command| -> Result<(), TraceError> {
            let mut command = command.clone();
            let contents = match &mut command {
                Command::WriteBuffer { data, .. } | Command::WriteTexture { data, .. } => {
                    let bytes = trace.data(data)?.to_vec();
                    data.blob.clear();
                    bytes
                }
                Command::CreateShader { source: ShaderSource::Wgsl(name), .. } => {
                    trace.text(&std::mem::take(name))?.into_bytes()
                }
                _ => Vec::new(),
            };
            list.push((command, contents));
            Ok(())
        })
        .expect("all commands");
    list
}

#[test]
fn a_stream_has_the_commands_of_the_whole() {
    let folder = tempfile::tempdir().expect("a folder");
    let [descriptors, regions] = memory();
    std::fs::write(folder.path().join("BufferDescriptors.dat"), descriptors).expect("a file");
    std::fs::write(folder.path().join("MemoryRegions.dat"), regions).expect("a file");
    let path = folder.path().join("features.txt");
    std::fs::write(&path, FEATURES).expect("a file");
    let open =
        |in_memory| import::open_with(&path, &Reading { in_memory, lenient: true, ..Reading::default() }).expect("a recording");
    let (whole, stream) = (open(Some(u64::MAX)), open(Some(0)));
    assert!(!whole.is_stream() && !open(None).is_stream() && stream.is_stream());
    let commands = with_contents(&whole);
    assert!(commands.len() > 100 && commands == with_contents(&stream));
    // Readers beside each other and one after the other, and one that stops early.
    std::thread::scope(|scope| {
        let readers: Vec<_> = (0..3).map(|_| scope.spawn(|| with_contents(&stream))).collect();
        assert!(stream.presents(1) && !stream.presents(100));
        assert!(readers.into_iter().all(|reader| reader.join().expect("a reader") == commands));
    });
    // What has been read is gone.
    let name = whole.blob_names().next().expect("a blob").to_owned();
    assert!(whole.blob(&name).is_ok() && stream.blob(&name).is_err());
    let error = trace::write(&stream, folder.path().join("out")).expect_err("a stream");
    assert!(error.to_string().contains("read as a stream"), "{error}");
}

#[test]
fn a_long_recording_starts_at_once_and_ends_at_what_is_not_supported() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("frames.txt");
    let frame = |more: &str| format!("glClear(GL_COLOR_BUFFER_BIT)\nglRectf(-1,-1,0,0)\n{more}wglSwapBuffers(1)\n");
    let rare = frame("glNoSuchThing(1)\n");
    let text = format!("GLI0.t\n#! RES 8x8\n{}{rare}{}{rare}", frame("").repeat(40), frame("").repeat(40));
    std::fs::write(&path, text).expect("a file");
    let reading = |lenient| Reading { in_memory: Some(0), lenient, ..Reading::default() };
    let shown = |trace: &Trace| {
        let mut frames = 0;
        let read = trace.for_each_command(|_, command| -> Result<(), TraceError> {
            frames += u64::from(matches!(command, Command::Present { .. }));
            Ok(())
        });
        (frames, read)
    };
    // Nothing is said before it begins. Frames before the call are there, none behind it, and all such calls are counted.
    let (trace, report) = import::open_frames(&path, &reading(false), 0..u64::MAX).expect("a recording");
    assert!(report.is_none() && trace.is_stream());
    let (frames, read) = shown(&trace);
    let error = read.expect_err("it asks for what is not there");
    assert!(error.unsupported && (1..=40).contains(&frames), "{frames}: {error}");
    // Three calls per frame, and one more: the first is that of frame 40.
    assert!(
        error.to_string().ends_with("not supported: glNoSuchThing (2 times, first in call 122); --lenient leaves it out"),
        "{error}"
    );
    // Left out, all frames are there, and what was left out is known behind the last.
    let (trace, _) = import::open_frames(&path, &reading(true), 0..u64::MAX).expect("a recording");
    assert_eq!(trace.origin().left_out, None);
    let (frames, read) = shown(&trace);
    read.expect("all commands");
    assert_eq!((frames, trace.origin().left_out), (82, Some("glNoSuchThing (2 times, first in call 122)".to_owned())));
    // Of the frames before it nothing is wrong.
    let (trace, _) = import::open_frames(&path, &reading(false), 0..40).expect("a recording");
    shown(&trace).1.expect("40 frames");
    // Where all is asked for first, it is refused first.
    let error = import::open_with(&path, &reading(false)).err().expect("refused");
    assert!(error.unsupported, "{error}");
    let (_, report) = import::open_reported(&path, &reading(false)).expect("a recording");
    assert_eq!(report.expect("a report").frames, 82);
}

#[test]
fn wrong_calls_of_features_raise_errors_or_name_their_call() {
    let of = |calls: &str| imported_text(format!("GLI0.t\n#! RES 8x8\n{calls}\nwglSwapBuffers(1)\n").as_bytes(), &memory());
    let errors = [
        ("glBitmap(-1,1,0,0,0,0,*4)", "glBitmap: GL_INVALID_VALUE"),
        ("glDrawPixels(1,1,77,GL_FLOAT,*4)", "glDrawPixels: GL_INVALID_ENUM"),
        ("glPixelMapfv(GL_PIXEL_MAP_I_TO_R,3,{0,1,0})", "glPixelMapfv: GL_INVALID_VALUE"),
        ("glAccum(77,1)", "glAccum: GL_INVALID_ENUM"),
        ("glEndQuery(GL_SAMPLES_PASSED)", "glEndQuery: GL_INVALID_OPERATION"),
        (
            "glFramebufferTexture2D(GL_FRAMEBUFFER,GL_COLOR_ATTACHMENT0,GL_TEXTURE_2D,0,0)",
            "glFramebufferTexture2D: GL_INVALID_OPERATION",
        ),
        ("glBindFramebuffer(GL_FRAMEBUFFER,1)\nglClear(GL_COLOR_BUFFER_BIT)", "glClear: GL_INVALID_FRAMEBUFFER_OPERATION"),
        (
            "glCompressedTexImage2D(GL_TEXTURE_2D,0,GL_COMPRESSED_RGB_S3TC_DXT1_EXT,4,4,0,9,*4)",
            "glCompressedTexImage2D: GL_INVALID_VALUE",
        ),
    ];
    for (call, wanted) in errors {
        let (_, report) = of(call).expect("a recording");
        assert_eq!(report.errors.iter().map(|(name, _)| name).collect::<Vec<_>>(), [wanted], "{call}");
    }
    // Bytes that are not there end the import, with the number of the call.
    let error = of("glFlush()\nglDrawPixels(4,4,GL_RGBA,GL_UNSIGNED_BYTE,*4)").err().expect("24 bytes are not 64");
    assert!(error.contains("call 1") && error.contains("24 bytes"), "{error}");
    let bind = "glBindBufferARB(GL_ARRAY_BUFFER,1)\n";
    let whole = format!("{bind}glBufferDataARB(GL_ARRAY_BUFFER,24,*4,35044)");
    assert!(of(&whole).is_ok());
    let few = [
        format!("{bind}glBufferDataARB(GL_ARRAY_BUFFER,25,*4,35044)"),
        format!("{whole}\nglBufferSubDataARB(GL_ARRAY_BUFFER,0,25,*4)"),
    ];
    for (calls, number) in few.iter().zip(["call 1", "call 2"]) {
        let error = of(calls).err().expect("24 bytes are not 25");
        assert!(error.contains(number) && error.contains("24 of 25 bytes were recorded"), "{error}");
    }
}

/// The two files beside a text: buffer 4 has the corners of a triangle.
fn memory() -> [Vec<u8>; 2] {
    let words = |words: &[u32]| words.iter().flat_map(|word| word.to_le_bytes()).collect::<Vec<u8>>();
    let corners = [-1.0_f32, -1.0, 1.0, -1.0, 0.0, 1.0].map(f32::to_bits);
    let regions = [words(&[9, 4096, 24]), words(&corners)].concat();
    [words(&[4, 4096, 24, 9]), regions]
}

/// Each of these meshes had a loop of two thousand million turns without a point.
#[test]
fn meshes_that_are_empty_along_one_axis_take_no_time() {
    for (mode, range) in [
        ("POINT", "-2147483648,1,16,8"),
        ("LINE", "-2147483648,1,16,8"),
        ("LINE", "16,8,-2147483648,1"),
        ("FILL", "16,8,-2147483648,1"),
    ] {
        let text = format!("GLI0.t\n#! RES 8x8\nglEvalMesh2(GL_{mode},{range})\nwglSwapBuffers(1)\n");
        let (trace, report) = imported_text(text.as_bytes(), &[Vec::new(), Vec::new()]).expect("nothing is drawn");
        assert!(report.unsupported.is_empty());
        assert_eq!(draws(&trace), 0);
    }
}

/// Infinity and NaN as factors made traces that the checker refuses.
#[test]
fn factors_that_are_no_finite_numbers_make_whole_traces() {
    for value in ["0x7f800000", "0xff800000", "0x7fc00000"] {
        let text = format!(
            "GLI0.t\n#! RES 8x8\nglAccum(GL_LOAD,1)\nglAccum(GL_MULT,{value})\nglAccum(GL_RETURN,{value})\nglEnable(GL_BLEND)\n\
             glBlendColor({value},0,{value},0)\nglBlendFunc(GL_CONSTANT_COLOR,GL_ONE)\nglRectf(-1,-1,1,1)\nwglSwapBuffers(1)\n"
        );
        let (trace, report) = imported_text(text.as_bytes(), &[Vec::new(), Vec::new()]).expect("a recording");
        assert!(report.unsupported.is_empty() && report.errors.is_empty(), "{:?} {:?}", report.unsupported, report.errors);
        let mut constants = 0;
        let read: Result<(), TraceError> = trace.for_each_command(|_, command| {
            constants += usize::from(matches!(command, Command::SetBlendConstant(_)));
            Ok(())
        });
        read.expect("commands in memory");
        assert_eq!(constants, 2, "of glAccum and of glBlendColor");
        check(&trace).unwrap_or_else(|error| panic!("{value}: {error}"));
    }
}

/// A list that calls itself twice would run 2^64 calls.
#[test]
fn lists_that_call_themselves_end_with_a_message() {
    let text = "GLI0.t\n#! RES 8x8\nglNewList(2,GL_COMPILE)\nglCallList(2)\nglLineWidth(2)\nglCallList(2)\nglEndList()\nglCallList(2)\n";
    let error = imported_text(text.as_bytes(), &[Vec::new(), Vec::new()]).err();
    assert_eq!(
        error.as_deref(),
        Some("x.txt: call 5, line 8: glCallList: display lists of more than 16777216 calls run in one")
    );
}

fn imported_text(text: &[u8], memory: &[Vec<u8>; 2]) -> Result<(Trace, Report), String> {
    let memory = [memory[0].as_slice(), memory[1].as_slice()];
    import_bytes(Path::new("x.txt"), text.to_vec(), memory, &Reading::default()).map_err(|error| error.to_string())
}

#[test]
fn a_text_is_read_with_its_memory_file() {
    let (trace, report) = imported_text(TEXT.as_bytes(), &memory()).expect("a recording");
    let summary = check(&trace).expect("a valid trace");
    assert_eq!((summary.frames, draws(&trace)), (1, 1));
    assert!(report.unsupported.is_empty(), "{:?}", report.unsupported);
    let mut clears = Vec::new();
    let seen: Result<(), TraceError> = trace.for_each_command(|_, command| {
        if let Command::BeginRenderPass { color, .. } = command {
            clears.extend(color.iter().flatten().filter_map(|color| color.clear));
        }
        Ok(())
    });
    seen.expect("commands in memory");
    assert_eq!(clears, [[1.0, 0.0, 0.0, 1.0]]);

    let missing = imported_text(TEXT.replace("*4", "*5").as_bytes(), &memory()).err().expect("no such buffer");
    assert!(missing.contains("line 8") && missing.contains("buffer 5"), "{missing}");
    let short = [memory()[0].clone(), memory()[1][..30].to_vec()];
    assert!(imported_text(TEXT.as_bytes(), &short).err().expect("a short file").contains("region 9"));
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(1000))]

    #[test]
    fn damaged_recordings_end_with_a_trace_or_a_message(edits in prop::collection::vec((any::<usize>(), any::<u8>()), 1..8), version in 1..7_u64) {
        let mut writer = program(version);
        let length = writer.bytes.len();
        for (at, byte) in edits {
            writer.bytes[at % length] = byte;
        }
        match imported(writer.file(1 << 20)) {
            Ok((trace, _)) => drop(check(&trace)),
            Err(error) => prop_assert!(error.starts_with("x.trace"), "{}", error),
        }
    }

    #[test]
    fn damaged_features_end_with_a_trace_or_a_message(edits in prop::collection::vec((any::<usize>(), any::<u8>()), 1..12)) {
        let mut text = FEATURES.as_bytes().to_vec();
        let length = text.len();
        for (at, byte) in edits {
            // Digits and letters that are there lead further than any byte does.
            let with = if byte < 128 { text[usize::from(byte) * 31 % length] } else { byte };
            text[2 + at % (length - 2)] = with;
        }
        match imported_text(&text, &memory()) {
            Ok((trace, _)) => drop(check(&trace)),
            Err(error) => prop_assert!(error.starts_with("x.txt") && (error.contains("call ") || error.contains("line")), "{}", error),
        }
    }

    #[test]
    fn damaged_texts_end_with_a_trace_or_a_message(edits in prop::collection::vec((any::<usize>(), any::<u8>()), 1..8)) {
        let mut text = TEXT.as_bytes().to_vec();
        let length = text.len();
        for (at, byte) in edits {
            text[2 + at % (length - 2)] = byte;
        }
        match imported_text(&text, &memory()) {
            Ok((trace, _)) => drop(check(&trace)),
            Err(error) => prop_assert!(error.starts_with("x.txt"), "{}", error),
        }
    }
}
