//! OpenGL contexts, share groups, windows and threads: small recordings of apitrace, whose pictures follow from the calls.

use std::path::Path;

use fillrate::import::Report;
use fillrate::import::gl::import_frames;
use fillrate::machine::Config;
use fillrate::picture::picture;
use fillrate::run::replay::{Fidelity, Options, replay};
use fillrate::trace::{Reading, Trace};

use super::gl_scenes::{BLACK, BLUE, GREEN, RED};

#[path = "../../crates/import/tests/import/recorder.rs"]
pub(super) mod recorder;

use recorder::Value::{self, Enum, Float, Floats, Null, Pointer, Uint};
use recorder::Writer;

const YELLOW: [u8; 3] = [255, 255, 0];
pub(super) const TEXTURE_2D: u64 = 0xde1;
pub(super) const FRAMEBUFFER: u64 = 0x8d40;
const COLOR: u64 = 0x4000;
pub(super) const SCISSOR: u64 = 0xc11;

/// A recording that is being written: its calls come from one thread until another one is chosen.
pub(super) struct Program {
    writer: Writer,
    thread: u64,
    /// The calls, for messages.
    pub(super) calls: Vec<String>,
}

impl Program {
    pub(super) fn new() -> Program {
        Program { writer: Writer::new(6), thread: 0, calls: Vec::new() }
    }

    pub(super) fn thread(&mut self, thread: u64) -> &mut Self {
        self.thread = thread;
        self
    }

    pub(super) fn call(&mut self, name: &str, args: &[Value]) -> &mut Self {
        self.calls.push(format!("thread {}: {name}{args:?}", self.thread));
        self.writer.call_in(self.thread, name, args, None);
        self
    }

    pub(super) fn returning(&mut self, name: &str, args: &[Value], result: Value) -> &mut Self {
        self.calls.push(format!("thread {}: {name}{args:?} = {result:?}", self.thread));
        self.writer.call_in(self.thread, name, args, Some(result));
        self
    }

    /// Makes a context that shares the objects of another one; 0: of none.
    pub(super) fn make(&mut self, context: u64, share: u64) -> &mut Self {
        let share = if share == 0 { Null } else { Pointer(share) };
        self.returning("glXCreateContextAttribsARB", &[Pointer(1), Pointer(2), share, Uint(1)], Pointer(context))
    }

    /// Makes a context current with a window; 0: none.
    pub(super) fn current(&mut self, context: u64, window: u64) -> &mut Self {
        let context = if context == 0 { Null } else { Pointer(context) };
        self.returning("glXMakeCurrent", &[Pointer(1), Uint(window), context], Uint(1))
    }

    /// As [`Program::current`], and as the recorder does for a new context: with the window's size.
    pub(super) fn first(&mut self, context: u64, window: u64, [width, height]: [u64; 2]) -> &mut Self {
        self.current(context, window);
        for name in ["glViewport", "glScissor"] {
            self.call(name, &[Uint(0), Uint(0), Uint(width), Uint(height)]);
        }
        self
    }

    pub(super) fn swap(&mut self, window: u64) -> &mut Self {
        self.call("glXSwapBuffers", &[Pointer(1), Uint(window)])
    }

    pub(super) fn color(&mut self, color: [u8; 3]) -> &mut Self {
        self.call("glColor3f", &color.map(|value| Float(f32::from(value) / 255.0)))
    }

    pub(super) fn clear(&mut self, color: [u8; 3]) -> &mut Self {
        let [r, g, b] = color.map(|value| Float(f32::from(value) / 255.0));
        self.call("glClearColor", &[r, g, b, Float(1.0)]).call("glClear", &[Uint(COLOR)])
    }

    /// Draws over the viewport, with the current colour and the bound texture.
    pub(super) fn quad(&mut self) -> &mut Self {
        self.call("glRectf", &[-1.0, -1.0, 1.0, 1.0].map(Float))
    }

    /// Draws over the left half of the viewport.
    pub(super) fn left(&mut self, color: [u8; 3]) -> &mut Self {
        self.color(color).call("glRectf", &[-1.0, -1.0, 0.0, 1.0].map(Float))
    }

    pub(super) fn enable(&mut self, capability: u64) -> &mut Self {
        self.call("glEnable", &[Enum(capability)])
    }

    pub(super) fn bind(&mut self, name: u64) -> &mut Self {
        self.call("glBindTexture", &[Enum(TEXTURE_2D), Uint(name)])
    }

    /// Gives the bound texture one texel.
    pub(super) fn texel(&mut self, [r, g, b]: [u8; 3]) -> &mut Self {
        self.call("glTexParameteri", &[Enum(TEXTURE_2D), Enum(0x2801), Enum(0x2600)]);
        let image = [Enum(TEXTURE_2D), Uint(0), Uint(0x1908), Uint(1), Uint(1), Uint(0), Enum(0x1908), Enum(0x1401)];
        self.call("glTexImage2D", &[image.as_slice(), &[Value::Blob(vec![r, g, b, 255])]].concat())
    }

    /// Binds a frame buffer object, and attaches a texture to it.
    pub(super) fn target(&mut self, name: u64, texture: u64) -> &mut Self {
        let args = [Enum(FRAMEBUFFER), Enum(0x8ce0), Enum(TEXTURE_2D), Uint(texture), Uint(0)];
        self.call("glBindFramebuffer", &[Enum(FRAMEBUFFER), Uint(name)]).call("glFramebufferTexture2D", &args)
    }

    pub(super) fn imported(&self, reading: &Reading, frames: std::ops::Range<u64>) -> Result<(Trace, Report), String> {
        let bytes = self.writer.file(1 << 20);
        import_frames(Path::new("x.trace"), bytes, [&[], &[]], reading, frames).map_err(|error| error.to_string())
    }

    pub(super) fn shown_with(&self, reading: &Reading, frames: std::ops::Range<u64>) -> (Vec<Picture>, Report) {
        let (trace, report) = self.imported(reading, frames).unwrap_or_else(|error| panic!("{error}"));
        assert!(report.unsupported.is_empty(), "{:?}", report.unsupported);
        let options = Options::new(Config::built_in("tiny").expect("a built-in configuration"), Fidelity::Functional);
        let replayed = replay(&trace, &options, &|_| ()).unwrap_or_else(|error| panic!("{error:#}"));
        let pictures = replayed.frames.iter().map(|frame| {
            let (surface, bytes) = frame.shown.as_ref().expect("a picture");
            let image = picture(surface, bytes).expect("a picture");
            let pixels = image.pixels().map(|pixel| [pixel[0], pixel[1], pixel[2]]).collect();
            Picture { size: [image.width(), image.height()], pixels }
        });
        (pictures.collect(), report)
    }

    /// All frames. No call is an error.
    pub(super) fn shown(&self) -> Vec<Picture> {
        let (pictures, report) = self.shown_with(&Reading::default(), 0..u64::MAX);
        assert!(report.errors.is_empty(), "{:?}", report.errors);
        pictures
    }

    /// The colours of the frames, each of which has one.
    pub(super) fn colors(&self) -> Vec<[u8; 3]> {
        self.shown().iter().map(Picture::plain).collect()
    }
}

/// A picture, with the highest row first.
#[derive(Debug, PartialEq)]
pub(super) struct Picture {
    pub(super) size: [u32; 2],
    pub(super) pixels: Vec<[u8; 3]>,
}

impl Picture {
    pub(super) fn at(&self, x: u32, y: u32) -> [u8; 3] {
        self.pixels[(y * self.size[0] + x) as usize]
    }

    /// Its only colour.
    pub(super) fn plain(&self) -> [u8; 3] {
        assert!(self.pixels.iter().all(|pixel| *pixel == self.pixels[0]), "{self:?}");
        self.pixels[0]
    }
}

const A: u64 = 0x10;
const B: u64 = 0x20;
const C: u64 = 0x30;
const ONE: u64 = 101;
const TWO: u64 = 102;
const SIZE: [u64; 2] = [8, 8];

/// Both contexts are current with a window of their own, A last.
fn two_contexts(share: bool) -> Program {
    let mut p = Program::new();
    p.make(A, 0).make(B, if share { A } else { 0 });
    p.first(B, TWO, SIZE).first(A, ONE, SIZE);
    p
}

#[test]
fn names_are_those_of_the_share_group() {
    for share in [false, true] {
        let mut p = two_contexts(share);
        p.enable(TEXTURE_2D).bind(1).texel(RED).call("glNewList", &[Uint(1), Enum(0x1300)]).color(GREEN).call("glEndList", &[]);
        // A buffer of two triangles over the window.
        let corners: [f32; 8] = [-1.0, -1.0, 1.0, -1.0, 1.0, 1.0, -1.0, 1.0];
        let bytes = corners.iter().flat_map(|value| value.to_le_bytes()).collect();
        p.call("glBindBuffer", &[Enum(0x8892), Uint(1)]);
        p.call("glBufferData", &[Enum(0x8892), Uint(32), Value::Blob(bytes), Enum(0x88e4)]);
        p.current(B, TWO).enable(TEXTURE_2D).bind(1);
        if !share {
            p.texel(BLUE);
        }
        p.quad().swap(TWO);
        // The list of A sets a colour, if there is one.
        p.call("glDisable", &[Enum(TEXTURE_2D)]).color(RED).call("glCallList", &[Uint(1)]).quad().swap(TWO);
        // Without sharing, the buffer of this name is empty: all corners are at the origin.
        p.clear(YELLOW).color(RED).call("glEnableClientState", &[Enum(0x8074)]).call("glBindBuffer", &[Enum(0x8892), Uint(1)]);
        if !share {
            p.call("glBufferData", &[Enum(0x8892), Uint(32), Value::Blob(vec![0; 32]), Enum(0x88e4)]);
        }
        p.call("glVertexPointer", &[Uint(2), Enum(0x1406), Uint(0), Null]);
        p.call("glDrawArrays", &[Enum(7), Uint(0), Uint(4)]).swap(TWO);
        // What B did is not to be seen in A, unless it shares.
        p.current(A, ONE).color([255; 3]).quad().swap(ONE);
        let expected = if share { [RED, GREEN, RED, RED] } else { [BLUE, RED, YELLOW, RED] };
        assert_eq!(p.colors(), expected, "{share}");
    }
}

#[test]
fn programs_are_shared_and_stay_while_another_context_uses_them() {
    let mut p = two_contexts(true);
    let text = "void main() { gl_FragColor = vec4(0.0, 1.0, 0.0, 1.0); }";
    p.returning("glCreateShader", &[Enum(0x8b30)], Uint(1));
    p.call("glShaderSource", &[Uint(1), Uint(1), Value::Blob(text.as_bytes().to_vec()), Null]);
    p.call("glCompileShader", &[Uint(1)]).returning("glCreateProgram", &[], Uint(2));
    p.call("glAttachShader", &[Uint(2), Uint(1)]).call("glLinkProgram", &[Uint(2)]);
    // It is current in B alone.
    p.current(B, TWO).call("glUseProgram", &[Uint(2)]);
    p.current(A, ONE).color(RED).call("glDeleteProgram", &[Uint(2)]).quad().swap(ONE);
    p.current(B, TWO).color(RED).quad().swap(TWO);
    assert_eq!(p.colors(), [RED, GREEN]);
}

#[test]
fn state_belongs_to_a_context() {
    for share in [false, true] {
        let mut p = two_contexts(share);
        // State of A that would hide what B draws.
        p.enable(SCISSOR).call("glScissor", &[Uint(0), Uint(0), Uint(1), Uint(1)]);
        p.call("glColorMask", &[Uint(0), Uint(0), Uint(0), Uint(0)]).color(RED);
        p.call("glMatrixMode", &[Enum(0x1701)]).call("glScalef", &[Float(0.0), Float(0.0), Float(1.0)]);
        p.enable(0xb50).enable(0xb44).call("glCullFace", &[Enum(0x408)]);
        p.call("glClearColor", &[1.0, 0.0, 0.0, 1.0].map(Float)).call("glDrawBuffer", &[Enum(0)]);
        p.call("glPolygonMode", &[Enum(0x408), Enum(0x1b00)]).enable(0x0de1).bind(9).texel(BLUE);
        p.call("glEnableClientState", &[Enum(0x8074)]).call("glPushAttrib", &[Uint(0xfffff)]);
        p.current(B, TWO).left(GREEN).swap(TWO);
        // B clears to what it was made with, and has nothing to pop.
        p.call("glClear", &[Uint(COLOR)]).swap(TWO).call("glPopAttrib", &[]);
        // A still has its own.
        p.current(A, ONE).call("glDrawBuffer", &[Enum(0x405)]);
        p.call("glColorMask", &[Uint(1), Uint(1), Uint(1), Uint(1)]).call("glClear", &[Uint(COLOR)]).swap(ONE);
        let (pictures, report) = p.shown_with(&Reading::default(), 0..u64::MAX);
        assert_eq!((pictures[0].at(0, 0), pictures[0].at(7, 7), pictures[1].plain()), (GREEN, BLACK, BLACK));
        let a = &pictures[2];
        assert_eq!((a.at(0, 7), a.at(1, 7), a.at(0, 6)), (RED, BLACK, BLACK));
        let errors: Vec<&str> = report.errors.iter().map(|(name, _)| name).collect();
        assert_eq!(errors, ["glPopAttrib: GL_STACK_UNDERFLOW"]);
    }
}

#[test]
fn containers_are_not_shared() {
    let mut p = two_contexts(true);
    p.bind(1).texel(BLACK).target(1, 1).clear(RED);
    // B has no frame buffer object of this name, and another one draws into the same texture.
    p.current(B, TWO).call("glBindFramebuffer", &[Enum(FRAMEBUFFER), Uint(1)]).clear(GREEN);
    p.call("glBindFramebuffer", &[Enum(FRAMEBUFFER), Uint(0)]).enable(TEXTURE_2D).bind(1).quad().swap(TWO);
    p.target(1, 1).clear(BLUE);
    // That of A is still bound there.
    p.current(A, ONE).enable(SCISSOR).call("glScissor", &[Uint(0), Uint(0), Uint(1), Uint(1)]);
    p.call("glBindFramebuffer", &[Enum(FRAMEBUFFER), Uint(0)]).call("glDisable", &[Enum(SCISSOR)]);
    p.enable(TEXTURE_2D).quad().swap(ONE);
    // A vertex array object of A has an array, the one of B of this name has none.
    let bytes: Vec<u8> =
        [-1.0_f32, -1.0, 1.0, -1.0, 1.0, 1.0, -1.0, 1.0].iter().flat_map(|value| value.to_le_bytes()).collect();
    p.call("glDisable", &[Enum(TEXTURE_2D)]).call("glBindVertexArray", &[Uint(1)]);
    p.call("glEnableClientState", &[Enum(0x8074)]).call("glBindBuffer", &[Enum(0x8892), Uint(5)]);
    p.call("glBufferData", &[Enum(0x8892), Uint(32), Value::Blob(bytes), Enum(0x88e4)]);
    p.call("glVertexPointer", &[Uint(2), Enum(0x1406), Uint(0), Null]);
    p.current(B, TWO).call("glBindFramebuffer", &[Enum(FRAMEBUFFER), Uint(0)]).call("glDisable", &[Enum(TEXTURE_2D)]);
    p.clear(YELLOW).color(RED).call("glBindVertexArray", &[Uint(1)]);
    p.call("glDrawArrays", &[Enum(7), Uint(0), Uint(4)]).swap(TWO);
    p.current(A, ONE).color(GREEN).call("glDrawArrays", &[Enum(7), Uint(0), Uint(4)]).swap(ONE);
    let (pictures, report) = p.shown_with(&Reading::default(), 0..u64::MAX);
    let colors: Vec<_> = pictures.iter().map(Picture::plain).collect();
    assert_eq!(colors, [RED, BLUE, YELLOW, GREEN]);
    let errors: Vec<&str> = report.errors.iter().map(|(name, _)| name).collect();
    assert_eq!(errors, ["glClear: GL_INVALID_FRAMEBUFFER_OPERATION"]);
}

/// Two windows that are swapped in turns: frames 0 and 2 are 8 x 8, 1 and 3 are 12 x 4. Each second frame of a window draws over the first one.
fn two_windows() -> Program {
    let mut p = Program::new();
    p.make(A, 0).make(B, 0).first(A, ONE, [8, 8]).clear(RED).first(B, TWO, [12, 4]).clear(GREEN);
    p.current(A, ONE).swap(ONE).current(B, TWO).swap(TWO);
    p.current(A, ONE).left(BLUE).current(B, TWO).left(YELLOW).swap(ONE).swap(TWO);
    p
}

#[test]
fn each_window_has_a_framebuffer_and_a_size_of_its_own() {
    let p = two_windows();
    let (all, report) = p.shown_with(&Reading::default(), 0..u64::MAX);
    let sizes: Vec<_> = all.iter().map(|picture| picture.size).collect();
    assert_eq!(sizes, [[8, 8], [12, 4], [8, 8], [12, 4]]);
    assert_eq!((all[0].plain(), all[1].plain()), (RED, GREEN));
    assert_eq!([all[2].at(3, 7), all[2].at(4, 7), all[3].at(5, 3), all[3].at(6, 3)], [BLUE, RED, YELLOW, GREEN]);
    assert_eq!(
        report.contexts.iter().map(|context| (context.call, context.shares)).collect::<Vec<_>>(),
        [(0, None), (1, None)]
    );
    let windows: Vec<_> = report.windows.iter().map(|window| window.to_string()).collect();
    assert_eq!(windows, ["8 x 8, 2 swaps", "12 x 4, 2 swaps"]);
    // One of them alone, and parts of all frames and of its own.
    for window in 0..2 {
        let reading = Reading { window: Some(window), ..Reading::default() };
        let (own, report) = p.shown_with(&reading, 0..u64::MAX);
        assert_eq!((own.len(), report.frames), (2, 2));
        assert!(own.iter().eq(all.iter().skip(window as usize).step_by(2)));
        let (last, _) = p.shown_with(&reading, 1..2);
        assert_eq!(last.last(), own.last());
    }
    for frame in 0..4 {
        let (part, _) = p.shown_with(&Reading::default(), frame..frame + 1);
        assert_eq!(part.last(), all.get(frame as usize), "frame {frame}");
    }
    let error = p.imported(&Reading { window: Some(2), ..Reading::default() }, 0..u64::MAX).err().expect("no such window");
    assert_eq!(
        error,
        "x.trace: window 2 is not there; the recording has window 0 (8 x 8, 2 swaps), window 1 (12 x 4, 2 swaps)"
    );
}

#[test]
fn a_hidden_window_is_never_shown() {
    let mut p = Program::new();
    p.make(A, 0).make(B, A).first(A, ONE, [16, 16]).clear(RED).first(B, TWO, [4, 8]).clear(GREEN);
    p.current(A, ONE).clear(BLUE).bind(1).texel(RED).target(1, 1).clear(YELLOW).enable(SCISSOR);
    // The frame buffer object is bound in A alone.
    p.current(B, TWO).swap(TWO).left(RED).swap(TWO);
    let pictures = p.shown();
    assert_eq!((pictures[0].size, pictures[0].plain()), ([4, 8], GREEN));
    assert_eq!([pictures[1].at(1, 0), pictures[1].at(2, 0)], [RED, GREEN]);
    let error = p.imported(&Reading { window: Some(0), ..Reading::default() }, 0..u64::MAX).err().expect("never shown");
    assert!(error.contains("window 0 is never shown; the recording has window 0 (16 x 16, no swap), window 1"), "{error}");
}

#[test]
fn a_context_is_current_in_a_thread() {
    // One context in two threads in turns, the second of which has another one between.
    let mut p = Program::new();
    p.make(A, 0).make(B, 0).thread(0).first(A, ONE, SIZE).color(RED).current(0, 0);
    p.thread(1).first(B, TWO, SIZE).color(GREEN).quad().current(A, ONE).quad().swap(ONE);
    p.call("glRectf", &[-1.0, -1.0, 1.0, 1.0].map(Float)).current(B, TWO).swap(TWO);
    p.thread(0).current(A, ONE).color(BLUE).quad().swap(ONE);
    assert_eq!(p.colors(), [RED, GREEN, BLUE]);
    // Two contexts in two threads whose calls alternate, also within primitives.
    let mut p = Program::new();
    p.make(A, 0).make(B, A).thread(0).first(A, ONE, SIZE).thread(1).first(B, TWO, SIZE);
    p.thread(0).color(RED).thread(1).color(GREEN);
    for thread in [0, 1] {
        p.thread(thread).call("glBegin", &[Enum(7)]);
    }
    for corner in [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]] {
        for thread in [0, 1] {
            p.thread(thread).call("glVertex2f", &corner.map(Float));
        }
    }
    p.thread(0).call("glEnd", &[]).thread(1).call("glEnd", &[]).swap(TWO).thread(0).swap(ONE);
    assert_eq!(p.colors(), [GREEN, RED]);
}

#[test]
fn calls_without_a_context_have_no_effect() {
    let mut p = Program::new();
    p.make(A, 0).first(A, ONE, SIZE).color(RED).current(0, 0).color(GREEN).clear(GREEN);
    p.call("glGetError", &[]).thread(1).clear(BLUE).thread(0).current(A, ONE).quad().swap(ONE);
    // A call that has failed changes nothing.
    p.returning("glXMakeCurrent", &[Pointer(1), Uint(0), Null], Uint(0)).color(BLUE).quad().swap(ONE);
    let (pictures, report) = p.shown_with(&Reading::default(), 0..u64::MAX);
    assert_eq!(pictures.iter().map(Picture::plain).collect::<Vec<_>>(), [RED, BLUE]);
    let errors: Vec<_> = report.errors.iter().map(|(name, count)| (name, count.times)).collect();
    let none = |name: &str| format!("{name}: no current context");
    assert_eq!(
        errors,
        [(&*none("glClear"), 2), (&*none("glClearColor"), 2), (&*none("glColor3f"), 1)],
        "the recorder's own calls and queries are not errors"
    );
}

#[test]
fn what_is_destroyed_while_it_is_current_goes_when_it_is_not() {
    let mut p = two_contexts(true);
    p.bind(1).texel(RED);
    let destroy = |p: &mut Program, context| {
        p.call("glXDestroyContext", &[Pointer(1), Pointer(context)]);
    };
    destroy(&mut p, A);
    p.color(GREEN).quad().swap(ONE);
    // Its objects stay while another context shares them.
    p.current(B, TWO).enable(TEXTURE_2D).bind(1).quad().swap(TWO);
    // A new context of the same address begins anew, and so does a window.
    p.call("glXDestroyWindow", &[Pointer(1), Uint(ONE)]).make(A, B).first(A, ONE, [4, 4]).quad().swap(ONE);
    p.enable(TEXTURE_2D).bind(1).quad().swap(ONE);
    destroy(&mut p, A);
    destroy(&mut p, B);
    // The last context of a group takes its objects along.
    p.make(C, 0).current(C, ONE).enable(TEXTURE_2D).bind(1).color(BLUE).quad().swap(ONE);
    let pictures = p.shown();
    assert_eq!(pictures.iter().map(Picture::plain).collect::<Vec<_>>(), [GREEN, RED, [255; 3], RED, BLUE]);
    assert_eq!((pictures[0].size, pictures[2].size), ([8, 8], [4, 4]));
}

#[test]
fn one_drawable_is_read_and_another_drawn_to() {
    let mut p = two_contexts(false);
    p.clear(RED);
    let both = |p: &mut Program, draw, read| {
        p.returning("glXMakeContextCurrent", &[Pointer(1), Uint(draw), Uint(read), Pointer(A)], Uint(1));
    };
    both(&mut p, TWO, ONE);
    p.clear(GREEN).call("glWindowPos2i", &[Uint(0), Uint(0)]);
    p.call("glCopyPixels", &[Uint(0), Uint(0), Uint(4), Uint(8), Enum(0x1800)]).swap(TWO);
    let shown = p.shown();
    assert_eq!((shown[0].at(3, 3), shown[0].at(4, 3)), (RED, GREEN));
}

#[test]
fn a_context_without_a_window_draws_into_frame_buffer_objects() {
    let mut p = Program::new();
    let surface = |surface| if surface == 0 { Null } else { Pointer(surface) };
    let current = |p: &mut Program, window: u64| {
        p.returning("eglMakeCurrent", &[Pointer(1), surface(window), surface(window), Pointer(A)], Enum(1));
    };
    p.returning("eglCreateContext", &[Pointer(1), Pointer(2), Null, Floats(vec![])], Pointer(A));
    current(&mut p, 0);
    // There is no window to clear.
    p.clear(BLUE).bind(1).texel(BLACK).target(1, 1).clear(GREEN).enable(TEXTURE_2D);
    // The first window gives viewport and scissor their sizes. A pixel buffer keeps its own.
    let pixels = [12375.0, 6.0, 12374.0, 2.0, 12344.0].to_vec();
    p.returning("eglCreatePbufferSurface", &[Pointer(1), Pointer(2), Floats(pixels)], Pointer(TWO));
    current(&mut p, TWO);
    p.enable(SCISSOR).call("glBindFramebuffer", &[Enum(FRAMEBUFFER), Uint(0)]).quad();
    p.call("glViewport", &[Uint(0), Uint(0), Uint(8), Uint(8)]).call("eglSwapBuffers", &[Pointer(1), Pointer(TWO)]);
    // A window without a viewport of its own has the size of the context's.
    current(&mut p, ONE);
    p.call("glDisable", &[Enum(SCISSOR)]).quad();
    p.call("eglSwapBuffersWithDamageKHR", &[Pointer(1), Pointer(ONE), Null, Uint(0)]);
    let (pictures, report) = p.shown_with(&Reading::default(), 0..u64::MAX);
    assert_eq!((pictures[0].size, pictures[0].plain()), ([6, 2], GREEN));
    assert_eq!((pictures[1].size, pictures[1].plain()), ([8, 8], GREEN));
    let errors: Vec<&str> = report.errors.iter().map(|(name, _)| name).collect();
    assert_eq!(errors, ["glClear: GL_INVALID_FRAMEBUFFER_OPERATION"]);
    assert_eq!(report.windows[0].to_string(), "6 x 2, off screen, 1 swap");
}

#[test]
fn contexts_of_windows_and_of_macos_share_too() {
    let mut p = Program::new();
    let current = |p: &mut Program, context| {
        p.returning("wglMakeCurrent", &[Pointer(ONE), Pointer(context)], Uint(1));
    };
    p.returning("wglCreateContext", &[Pointer(ONE)], Pointer(A)).returning("wglCreateContext", &[Pointer(ONE)], Pointer(B));
    p.returning("wglCreateContextAttribsARB", &[Pointer(ONE), Pointer(A), Null], Pointer(C));
    current(&mut p, A);
    p.call("glViewport", &[Uint(0), Uint(0), Uint(8), Uint(8)]).bind(1).texel(RED);
    p.returning("wglShareLists", &[Pointer(A), Pointer(B)], Uint(1));
    for context in [B, C] {
        current(&mut p, context);
        p.enable(TEXTURE_2D).bind(1).quad();
        // Another device context of the window.
        p.call("wglSwapBuffers", &[Pointer(TWO)]).clear(BLACK);
    }
    assert_eq!(p.colors(), [RED, RED]);
    let mut p = Program::new();
    for (context, share) in [(A, Null), (B, Pointer(A))] {
        p.returning("CGLCreateContext", &[Pointer(1), share, Pointer(context)], Uint(0));
    }
    p.returning("CGLSetCurrentContext", &[Pointer(A)], Uint(0));
    p.call("glViewport", &[Uint(0), Uint(0), Uint(8), Uint(8)]).bind(1).texel(GREEN);
    p.returning("CGLSetCurrentContext", &[Pointer(B)], Uint(0));
    p.call("glViewport", &[Uint(0), Uint(0), Uint(4), Uint(4)]).enable(TEXTURE_2D).bind(1).quad();
    p.call("CGLFlushDrawable", &[Pointer(B)]);
    let pictures = p.shown();
    assert_eq!((pictures[0].size, pictures[0].plain()), ([4, 4], GREEN));
}

#[test]
fn a_recording_without_the_creation_of_its_contexts_goes_on_with_one() {
    let mut p = Program::new();
    p.call("glViewport", &[Uint(0), Uint(0), Uint(8), Uint(8)]).bind(1).texel(RED).enable(TEXTURE_2D);
    p.current(A, ONE).quad().swap(ONE).current(A, TWO).quad().swap(TWO);
    assert_eq!(p.colors(), [RED, RED]);
    // What a second one shares is not known.
    p.current(B, TWO).quad().swap(TWO);
    let (_, report) = p.imported(&Reading::default(), 0..u64::MAX).expect("a recording");
    let refusal = report.refusal().expect("a refusal");
    assert!(refusal.starts_with("several contexts of which the recording does not have the creation (1 times"), "{refusal}");
}

#[test]
fn what_another_context_deletes_is_not_taken_for_a_new_object_of_its_name() {
    let refusal = |bind: bool, delete: bool| {
        let mut p = two_contexts(true);
        p.bind(1).texel(RED).current(B, TWO).enable(TEXTURE_2D).bind(1).current(A, ONE);
        if delete {
            p.call("glDeleteTextures", &[Uint(1), Floats(vec![1.0])]);
        }
        p.bind(1).texel(BLUE).current(B, TWO);
        if bind {
            p.bind(1);
        }
        let (_, report) = p.quad().swap(TWO).imported(&Reading::default(), 0..u64::MAX).expect("a recording");
        if report.unsupported.is_empty() { Err(p.colors()) } else { Ok(report.refusal().expect("a refusal")) }
    };
    // OpenGL keeps the red one for B, until B binds another one.
    let kept = refusal(false, true).expect("a refusal");
    assert!(
        kept.starts_with("objects that are deleted while they are bound in another context") && kept.contains("(1 times"),
        "{kept}"
    );
    assert_eq!([refusal(true, true), refusal(false, false)], [Err(vec![BLUE]), Err(vec![BLUE])]);
}
