//! Shaders of fixed functions have only terms that can matter.

use std::path::Path;

use import::gl::import_bytes;
use trace::command::{Command, ShaderSource};
use trace::{Reading, Trace, TraceError};

/// The shaders of a recording of GLInterceptor whose calls are these, between the window and its only frame.
fn shaders(calls: &str) -> Vec<String> {
    let text = format!("GLI0.t\n#! RES 16x16\nwglMakeCurrent(1,1)=1\n{calls}wglSwapBuffers(1)=1\n");
    let imported = import_bytes(Path::new("x.txt"), text.into_bytes(), [&[], &[]], &Reading::default());
    let (trace, report) = imported.expect("a recording");
    assert!(report.unsupported.is_empty(), "{:?}", report.unsupported);
    texts(&trace)
}

fn texts(trace: &Trace) -> Vec<String> {
    let mut texts = Vec::new();
    let seen: Result<(), TraceError> = trace.for_each_command(|_, command| {
        if let Command::CreateShader { source: ShaderSource::Wgsl(name), .. } = command {
            let bytes = trace.blob(name).expect("a shader's text");
            texts.push(String::from_utf8(bytes.to_vec()).expect("UTF-8"));
        }
        Ok(())
    });
    seen.expect("commands in memory");
    texts
}

/// A light that is no direction, so that coordinates in eye space are read, and a triangle in two calls of each kind.
fn lit(before: &str, vertex: &str) -> String {
    let light = "glEnable(GL_LIGHTING)\nglEnable(GL_LIGHT0)\nglLightfv(GL_LIGHT0,GL_POSITION,{0,0,2,1})\n";
    format!("{light}{before}glBegin(GL_TRIANGLES)\nglVertex2f(-1,-1)\nglVertex3f(1,-1,0.5)\n{vertex}glEnd()\n")
}

#[test]
fn coordinates_in_eye_space_are_divided_where_their_w_can_differ_from_1() {
    let divided = |calls: &str| {
        let texts = shaders(calls);
        let [text] = &texts[..] else { panic!("{} shaders", texts.len()) };
        assert!(text.contains("let eye = eye4.xyz"), "{text}");
        text.contains("eye4.xyz / eye4.w")
    };
    let plain = "glVertex3f(0,1,0)\n";
    assert!(!divided(&lit("", plain)));
    assert!(!divided(&lit("glTranslatef(1,2,3)\nglRotatef(30,0,1,0)\nglScalef(2,2,2)\n", plain)));
    assert!(divided(&lit("", "glVertex4f(0,1,0,2)\n")));
    // A projection in the matrix of the model.
    assert!(divided(&lit("glFrustum(-1,1,-1,1,1,9)\n", plain)));
    // Where nothing reads them it makes no other shader.
    let unlit = "glBegin(GL_POINTS)\nglVertex2f(0,0)\nglEnd()\nglBegin(GL_POINTS)\nglVertex4f(0,0,0,2)\nglEnd()\n";
    assert_eq!(shaders(unlit).len(), 1);
}

#[test]
fn single_elements_of_arrays_in_memory_are_named_in_recordings_of_apitrace() {
    use crate::recorder::Value::{Blob, Enum, Uint};
    let mut w = crate::recorder::Writer::new(6);
    w.call("glViewport", &[Uint(0), Uint(0), Uint(8), Uint(8)]);
    w.call("glEnableClientState", &[Enum(0x8074)]);
    // Before a draw apitrace gives as many elements as that draw reads.
    w.call("glVertexPointer", &[Uint(2), Enum(0x1406), Uint(0), Blob(vec![0; 24])]);
    w.call("glDrawArrays", &[Enum(4), Uint(0), Uint(3)]);
    w.call("glBegin", &[Enum(4)]);
    for k in [0, 1, 7] {
        w.call("glArrayElement", &[Uint(k)]);
    }
    w.call("glEnd", &[]);
    let imported = import_bytes(Path::new("x.trace"), w.file(1 << 20), [&[], &[]], &Reading::default());
    let (_, report) = imported.expect("a recording");
    let refusal = "glArrayElement with arrays in memory, which apitrace does not record (3 times, first in call 5)";
    assert_eq!(report.refusal().as_deref(), Some(refusal));
}
