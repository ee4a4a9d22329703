//! Recordings of a few calls, and their pictures: what the tests of OpenGL's features share.

use std::path::Path;

use fillrate::import::Report;
use fillrate::import::gl::import_frames;
use fillrate::machine::Config;
use fillrate::picture::picture;
use fillrate::run::replay::{Fidelity, Options, replay};
use fillrate::trace::{Reading, Trace, check};

/// Imports calls, one per line, in a window of 16 x 16. `*1` is the first of `buffers`.
pub fn imported(calls: &str, buffers: &[&[u8]], frames: std::ops::Range<u64>) -> (Trace, Report) {
    imported_with(calls, buffers, frames, &Reading::default())
}

pub fn imported_with(calls: &str, buffers: &[&[u8]], frames: std::ops::Range<u64>, reading: &Reading) -> (Trace, Report) {
    let (trace, report) = recorded(calls, buffers, frames, reading);
    assert!(report.unsupported.is_empty() && report.errors.is_empty(), "{:?} {:?}", report.unsupported, report.errors);
    check(&trace).unwrap_or_else(|error| panic!("{error}"));
    (trace, report)
}

/// The same, of calls that may be refused or have no effect.
pub fn recorded(calls: &str, buffers: &[&[u8]], frames: std::ops::Range<u64>, reading: &Reading) -> (Trace, Report) {
    let text = format!("GLI0.t\n#! RES 16x16\n{}\nwglSwapBuffers(1)\n", calls.trim());
    let words = |words: &[u32]| words.iter().flat_map(|word| word.to_le_bytes()).collect::<Vec<u8>>();
    let (mut descriptors, mut regions) = (Vec::new(), Vec::new());
    for (bytes, id) in buffers.iter().zip(1_u32..) {
        let (address, size) = (id << 16, bytes.len() as u32);
        descriptors.extend(words(&[id, address, size, id]));
        regions.extend(words(&[id, address, size]));
        regions.extend_from_slice(bytes);
    }
    let memory = [descriptors.as_slice(), regions.as_slice()];
    let imported = import_frames(Path::new("x.txt"), text.into_bytes(), memory, reading, frames);
    imported.unwrap_or_else(|error| panic!("{error}"))
}

/// The red, green and blue of each pixel, of the lowest row first.
pub struct Shown(pub Vec<[u8; 3]>);

impl Shown {
    pub fn at(&self, x: usize, y: usize) -> [u8; 3] {
        self.0[y * 16 + x]
    }

    /// The pixels that are not black.
    pub fn lit(&self) -> Vec<(usize, usize)> {
        (0..256).filter(|&k| self.0[k] != [0; 3]).map(|k| (k % 16, k / 16)).collect()
    }
}

pub fn shown(calls: &str, buffers: &[&[u8]]) -> Shown {
    last_of(&imported(calls, buffers, 0..u64::MAX).0)
}

pub fn last_of(trace: &Trace) -> Shown {
    let options = Options::new(Config::built_in("tiny").expect("a built-in configuration"), Fidelity::Functional);
    let replayed = replay(trace, &options, &|_| ()).unwrap_or_else(|error| panic!("{error:#}"));
    let (surface, bytes) = replayed.frames.last().and_then(|frame| frame.shown.as_ref()).expect("a picture");
    let image = picture(surface, bytes).expect("a picture");
    let pixel = |k: u32| image.get_pixel(k % 16, 15 - k / 16).0;
    Shown((0..256).map(pixel).map(|[r, g, b, _]| [r, g, b]).collect())
}

pub const RED: [u8; 3] = [255, 0, 0];

pub const GREEN: [u8; 3] = [0, 255, 0];

pub const BLUE: [u8; 3] = [0, 0, 255];

pub const BLACK: [u8; 3] = [0; 3];

pub fn near(a: [u8; 3], b: [u8; 3]) -> bool {
    (0..3).all(|k| a[k].abs_diff(b[k]) <= 1)
}

pub const QUAD: &str = "glBegin(GL_QUADS)\nglVertex2f(-1,-1)\nglVertex2f(1,-1)\nglVertex2f(1,1)\nglVertex2f(-1,1)\nglEnd()";

pub const TEXTURE_AND_QUAD: &str = "glEnable(GL_TEXTURE_2D)\nglBegin(GL_QUADS)\nglTexCoord2f(0,0)\nglVertex2f(-1,-1)\nglTexCoord2f(1,0)\n\
    glVertex2f(1,-1)\nglTexCoord2f(1,1)\nglVertex2f(1,1)\nglTexCoord2f(0,1)\nglVertex2f(-1,1)\nglEnd()\n";

/// A program of these shaders, which is used; objects have the numbers n, n + 1 and n + 2.
pub fn program(n: usize, vertex: &str, fragment: &str) -> String {
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

pub const PASS: &str = "void main() { gl_Position = gl_Vertex; gl_TexCoord[0] = gl_Vertex * 0.5 + 0.5; }";

pub const ORTHO: &str = "glMatrixMode(GL_PROJECTION)\nglOrtho(0,16,0,16,-1,1)\nglMatrixMode(GL_MODELVIEW)\n";

pub const NEAREST_FILTERS: &str = "glTexParameteri(3553,10241,9728)\nglTexParameteri(3553,10240,9728)\nglEnable(3553)\n";

/// Why calls are refused.
pub fn refused(calls: &str, buffers: &[&[u8]]) -> String {
    recorded(calls, buffers, 0..u64::MAX, &Reading::default()).1.refusal().unwrap_or_default()
}

/// The picture of calls, and the number of those that are errors.
pub fn with_errors(calls: &str, buffers: &[&[u8]]) -> (Shown, u64) {
    let (trace, report) = recorded(calls, buffers, 0..u64::MAX, &Reading::default());
    assert_eq!(report.refusal(), None);
    (last_of(&trace), report.errors.iter().map(|(_, count)| count.times).sum())
}

pub fn floats(values: &[f32]) -> Vec<u8> {
    values.iter().flat_map(|value| value.to_le_bytes()).collect()
}

pub const TEXTURED: &str = "glBegin(GL_QUADS)\nglTexCoord2f(0,0)\nglVertex2f(-1,-1)\nglTexCoord2f(1,0)\nglVertex2f(1,-1)\nglTexCoord2f(1,1)\n\
    glVertex2f(1,1)\nglTexCoord2f(0,1)\nglVertex2f(-1,1)\nglEnd()\n";

pub const NEAREST: &str =
    "glTexParameteri(3553,10241,9728)\nglTexParameteri(3553,10240,9728)\nglTexEnvi(8960,8704,7681)\nglEnable(3553)\n";

/// Calls that make program 3 of these shaders and use it; a text that is empty leaves the stage to fixed functions.
pub fn program_of(vertex: &str, fragment: &str) -> String {
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

/// Why calls are refused, and which of them are errors.
pub fn refused_with_errors(calls: &str, buffers: &[&[u8]]) -> (String, Vec<String>) {
    let (_, report) = recorded(calls, buffers, 0..u64::MAX, &Reading::default());
    (report.refusal().unwrap_or_default(), report.errors.iter().map(|(name, _)| name.to_owned()).collect())
}

pub const PASS_POSITION: &str = "void main() { gl_Position = gl_Vertex; }";

/// The picture of calls that are supported, and the names of those that are errors.
pub fn tolerated(calls: &str, buffers: &[&[u8]]) -> (Shown, Vec<String>) {
    let (trace, report) = recorded(calls, buffers, 0..u64::MAX, &Reading::default());
    assert_eq!(report.refusal(), None);
    (last_of(&trace), report.errors.iter().map(|(name, _)| name.to_owned()).collect())
}
