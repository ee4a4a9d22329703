//! Features of OpenGL other than triangles, each in a recording of a few calls whose pixels follow from arithmetic.

use std::path::Path;

use fillrate::gfx::state::Topology;
use fillrate::import::gl::{Report, import_frames};
use fillrate::machine::Config;
use fillrate::picture::picture;
use fillrate::run::replay::{Fidelity, Options, replay};
use fillrate::trace::command::Command;
use fillrate::trace::{Reading, Trace, TraceError, check};

/// Imports calls, one per line, in a window of 16 x 16. `*1` is the first of `buffers`.
pub(super) fn imported(calls: &str, buffers: &[&[u8]], frames: std::ops::Range<u64>) -> (Trace, Report) {
    imported_with(calls, buffers, frames, &Reading::default())
}

pub(super) fn imported_with(
    calls: &str,
    buffers: &[&[u8]],
    frames: std::ops::Range<u64>,
    reading: &Reading,
) -> (Trace, Report) {
    let (trace, report) = recorded(calls, buffers, frames, reading);
    assert!(report.unsupported.is_empty() && report.errors.is_empty(), "{:?} {:?}", report.unsupported, report.errors);
    check(&trace).unwrap_or_else(|error| panic!("{error}"));
    (trace, report)
}

/// The same, of calls that may be refused or have no effect.
pub(super) fn recorded(calls: &str, buffers: &[&[u8]], frames: std::ops::Range<u64>, reading: &Reading) -> (Trace, Report) {
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
pub(super) struct Shown(pub(super) Vec<[u8; 3]>);

impl Shown {
    pub(super) fn at(&self, x: usize, y: usize) -> [u8; 3] {
        self.0[y * 16 + x]
    }

    /// The pixels that are not black.
    pub(super) fn lit(&self) -> Vec<(usize, usize)> {
        (0..256).filter(|&k| self.0[k] != [0; 3]).map(|k| (k % 16, k / 16)).collect()
    }
}

pub(super) fn shown(calls: &str, buffers: &[&[u8]]) -> Shown {
    last_of(&imported(calls, buffers, 0..u64::MAX).0)
}

pub(super) fn last_of(trace: &Trace) -> Shown {
    let options = Options::new(Config::built_in("tiny").expect("a built-in configuration"), Fidelity::Functional);
    let replayed = replay(trace, &options, &|_| ()).unwrap_or_else(|error| panic!("{error:#}"));
    let (surface, bytes) = replayed.frames.last().and_then(|frame| frame.shown.as_ref()).expect("a picture");
    let image = picture(surface, bytes).expect("a picture");
    let pixel = |k: u32| image.get_pixel(k % 16, 15 - k / 16).0;
    Shown((0..256).map(pixel).map(|[r, g, b, _]| [r, g, b]).collect())
}

pub(super) const RED: [u8; 3] = [255, 0, 0];
pub(super) const GREEN: [u8; 3] = [0, 255, 0];
pub(super) const BLUE: [u8; 3] = [0, 0, 255];
pub(super) const BLACK: [u8; 3] = [0; 3];

pub(super) fn near(a: [u8; 3], b: [u8; 3]) -> bool {
    (0..3).all(|k| a[k].abs_diff(b[k]) <= 1)
}

#[test]
fn kept_draws_are_those_of_the_program() {
    let corners = [[1, 1], [1, 15], [15, 1], [15, 15]];
    let kinds: [(&str, &[usize], Topology); 6] = [
        ("GL_TRIANGLES", &[0, 2, 1, 1, 2, 3], Topology::TriangleList),
        ("GL_TRIANGLE_STRIP", &[0, 2, 1, 3], Topology::TriangleStrip),
        ("GL_TRIANGLE_FAN", &[0, 2, 3, 1], Topology::TriangleFan),
        ("GL_QUADS", &[0, 2, 3, 1], Topology::QuadList),
        ("GL_QUAD_STRIP", &[1, 0, 3, 2], Topology::TriangleStrip),
        ("GL_POLYGON", &[0, 2, 3, 1], Topology::TriangleFan),
    ];
    for (kind, order, topology) in kinds {
        // The colours are not those of a plane: the picture shows the diagonal.
        let corner = |&k: &usize| {
            let [x, y] = corners[k];
            format!("glColor3f({},0.25,{})\nglVertex2f({x},{y})\n", [0.1, 0.9, 0.4, 0.2][k], [1.0, 0.5, 0.9, 0.7][k])
        };
        let vertices: String = order.iter().map(corner).collect();
        let calls = format!(
            "glOrtho(0,16,0,16,-1,1)\nglRotatef(0.5,0,0,1)\nglEnable(GL_CULL_FACE)\nglBegin({kind})\n{vertices}glEnd()\n"
        );
        let joined = shown(&calls, &[]);
        let (trace, _) = imported_with(&calls, &[], 0..u64::MAX, &Reading { keep_draws: true, ..Reading::default() });
        let kept = last_of(&trace);
        assert!(joined.0.iter().zip(&kept.0).all(|(&a, &b)| near(a, b)), "{kind}: the same picture");
        assert!(kept.lit().len() > 150, "{kind}");
        let (mut topologies, mut draws) = (Vec::new(), Vec::new());
        let seen: Result<(), TraceError> = trace.for_each_command(|_, command| {
            match command {
                Command::CreateRenderPipeline { desc, .. } => topologies.push(desc.primitive.topology),
                Command::Draw { vertices, .. } => draws.push(*vertices as usize),
                Command::DrawIndexed { .. } => panic!("{kind}: the program sends no indices"),
                _ => {}
            }
            Ok(())
        });
        seen.expect("a trace");
        assert_eq!((topologies, draws), (vec![topology], vec![order.len()]), "{kind}");
    }
}

#[test]
fn interleaved_arrays_have_their_parts_where_the_standard_says() {
    // Of each format: components and place of colours, whether these are bytes, and of positions; bytes of a vertex (OpenGL 1.5, table 2.5).
    type Format = (&'static str, Option<(usize, bool)>, (usize, usize), usize);
    const FORMATS: [Format; 14] = [
        ("GL_V2F", None, (2, 0), 8),
        ("GL_V3F", None, (3, 0), 12),
        ("GL_C4UB_V2F", Some((0, true)), (2, 4), 12),
        ("GL_C4UB_V3F", Some((0, true)), (3, 4), 16),
        ("GL_C3F_V3F", Some((0, false)), (3, 12), 24),
        ("GL_N3F_V3F", None, (3, 12), 24),
        ("GL_C4F_N3F_V3F", Some((0, false)), (3, 28), 40),
        ("GL_T2F_V3F", None, (3, 8), 20),
        ("GL_T4F_V4F", None, (4, 16), 32),
        ("GL_T2F_C4UB_V3F", Some((8, true)), (3, 12), 24),
        ("GL_T2F_C3F_V3F", Some((8, false)), (3, 20), 32),
        ("GL_T2F_N3F_V3F", None, (3, 20), 32),
        ("GL_T2F_C4F_N3F_V3F", Some((8, false)), (3, 36), 48),
        ("GL_T4F_C4F_N3F_V4F", Some((16, false)), (4, 44), 60),
    ];
    for (format, color, (components, position), vertex) in FORMATS {
        for gap in [0, 4] {
            // Behind four bytes that are skipped, the left half of the window in red, where there are colours.
            let stride = vertex + gap;
            let mut bytes = vec![0x55; 4 + 4 * stride];
            for (n, [x, y]) in [[-1.0_f32, -1.0], [0.0, -1.0], [0.0, 1.0], [-1.0, 1.0]].into_iter().enumerate() {
                let start = 4 + n * stride;
                for (k, value) in [x, y, 0.0, 1.0][..components].iter().enumerate() {
                    bytes[start + position + 4 * k..][..4].copy_from_slice(&value.to_le_bytes());
                }
                match color {
                    Some((at, true)) => bytes[start + at..][..4].copy_from_slice(&[255, 0, 0, 255]),
                    Some((at, false)) => {
                        for (k, value) in [1.0_f32, 0.0, 0.0].iter().enumerate() {
                            bytes[start + at + 4 * k..][..4].copy_from_slice(&value.to_le_bytes());
                        }
                    }
                    None => {}
                }
            }
            let given = if gap == 0 { 0 } else { stride };
            let draw = "glDrawArrays(GL_QUADS,0,4)";
            let memory = shown(&format!("glColor3f(0,1,0)\nglInterleavedArrays({format},{given},*1)\n{draw}"), &[&bytes[4..]]);
            let object = shown(
                &format!(
                    "glColor3f(0,1,0)\nglEnableClientState(GL_EDGE_FLAG_ARRAY)\nglBindBufferARB(34962,1)\n\
                     glBufferDataARB(34962,{},*1,35044)\nglInterleavedArrays({format},{given},4)\n{draw}",
                    bytes.len()
                ),
                &[&bytes],
            );
            let wanted = if color.is_some() { RED } else { GREEN };
            for (of, shown) in [("memory", memory), ("object", object)] {
                assert_eq!(
                    [shown.at(3, 3), shown.at(7, 12), shown.at(8, 12)],
                    [wanted, wanted, BLACK],
                    "{format}, {gap}, {of}"
                );
            }
        }
    }
}

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
fn a_bitmap_colours_its_set_bits_and_moves_the_raster_position() {
    // Rows of four bytes each; the second bitmap is one pixel, at the moved position.
    let bits = [0b1010_0000, 0, 0, 0, 0b0000_0001, 0, 0, 0];
    let image = shown(
        "glColor3f(1,0,0)\nglWindowPos2i(3,4)\nglColor3f(0,1,0)\nglBitmap(8,2,1,0,9,2,*1)\nglBitmap(1,1,0,0,0,0,*2)",
        &[&bits, &[0x80, 0, 0, 0]],
    );
    assert_eq!(image.lit(), [(2, 4), (4, 4), (9, 5), (12, 6)]);
    assert_eq!(image.at(2, 4), RED);
}

#[test]
fn a_bitmap_in_a_list_keeps_the_storage_of_its_time_and_an_invalid_position_draws_nothing() {
    let list = "glPixelStorei(GL_UNPACK_ALIGNMENT,1)\nglNewList(1,GL_COMPILE)\nglBitmap(8,2,0,0,0,0,*1)\nglEndList()\n\
        glPixelStorei(GL_UNPACK_ALIGNMENT,8)\n";
    let image = shown(&format!("{list}glRasterPos2f(0,0)\nglCallList(1)"), &[&[0x80, 0x40]]);
    assert_eq!(image.lit(), [(8, 8), (9, 9)]);
    let image = shown(&format!("{list}glRasterPos2f(-1.5,0)\nglCallList(1)"), &[&[0x80, 0x40]]);
    assert_eq!(image.lit(), []);
}

#[test]
fn drawn_pixels_are_zoomed_and_transferred() {
    let pixels = [255, 0, 0, 255, 0, 255, 0, 255, 0, 0, 255, 255, 200, 100, 50, 255];
    let draw = "glWindowPos2i(4,2)\nglPixelZoom(2,3)\nglDrawPixels(2,2,GL_RGBA,GL_UNSIGNED_BYTE,*1)";
    let image = shown(draw, &[&pixels]);
    for (x, y, color) in
        [(4, 2, RED), (5, 4, RED), (6, 2, GREEN), (7, 4, GREEN), (4, 5, BLUE), (5, 7, BLUE), (6, 5, [200, 100, 50])]
    {
        assert_eq!(image.at(x, y), color, "{x}, {y}");
    }
    assert_eq!(image.lit().len(), 4 * 6);
    let image = shown(&format!("glPixelTransferf(GL_RED_SCALE,0.5)\nglPixelTransferf(GL_BLUE_BIAS,0.2)\n{draw}"), &[&pixels]);
    assert_eq!((image.at(6, 5), image.at(4, 2)), ([100, 100, 101], [128, 0, 51]));
    // A negative zoom turns the rectangle around its first pixel's corner.
    let image = shown("glWindowPos2i(4,4)\nglPixelZoom(-1,1)\nglDrawPixels(2,1,GL_RGBA,GL_UNSIGNED_BYTE,*1)", &[&pixels]);
    assert_eq!((image.at(3, 4), image.at(2, 4), image.lit().len()), (RED, GREEN, 2));
}

#[test]
fn copied_pixels_are_upright() {
    let pixels = [255, 0, 0, 255, 0, 255, 0, 255, 0, 0, 255, 255, 200, 100, 50, 255];
    let image = shown(
        "glWindowPos2i(1,1)\nglDrawPixels(2,2,GL_RGBA,GL_UNSIGNED_BYTE,*1)\nglWindowPos2i(9,6)\nglCopyPixels(1,1,2,2,GL_COLOR)",
        &[&pixels],
    );
    let copied = [image.at(9, 6), image.at(10, 6), image.at(9, 7), image.at(10, 7)];
    assert_eq!(copied, [RED, GREEN, BLUE, [200, 100, 50]]);
    assert_eq!(image.lit().len(), 8);
}

pub(super) const QUAD: &str =
    "glBegin(GL_QUADS)\nglVertex2f(-1,-1)\nglVertex2f(1,-1)\nglVertex2f(1,1)\nglVertex2f(-1,1)\nglEnd()";

#[test]
fn drawn_stencil_values_and_depths_are_tested() {
    let image = shown(
        &format!(
            "glWindowPos2i(3,3)\nglDrawPixels(4,1,GL_STENCIL_INDEX,GL_UNSIGNED_BYTE,*1)\nglEnable(GL_STENCIL_TEST)\n\
             glStencilFunc(GL_EQUAL,5,255)\n{QUAD}"
        ),
        &[&[5, 7, 5, 255]],
    );
    assert_eq!(image.lit(), [(3, 3), (5, 3)]);
    // Depths 0.25 and 0.75 in a row; a surface at 0.5 is in front of the second only.
    let depths: Vec<u8> = [0.25_f32, 0.75].iter().flat_map(|depth| depth.to_le_bytes()).collect();
    let image = shown(
        &format!(
            "glEnable(GL_DEPTH_TEST)\nglDepthFunc(GL_ALWAYS)\nglColorMask(0,0,0,0)\nglWindowPos2i(3,3)\n\
             glDrawPixels(2,1,GL_DEPTH_COMPONENT,GL_FLOAT,*1)\nglColorMask(1,1,1,1)\nglDepthFunc(GL_LESS)\nglEnable(GL_SCISSOR_TEST)\n\
             glScissor(3,3,2,1)\n{QUAD}"
        ),
        &[&depths],
    );
    assert_eq!(image.lit(), [(4, 3)]);
}

#[test]
fn line_stipples_count_pixels_along_the_line() {
    // Bits 0 and 3 of sixteen, each for two pixels.
    let image = shown(
        "glEnable(GL_LINE_STIPPLE)\nglLineStipple(2,9)\nglMatrixMode(GL_PROJECTION)\nglOrtho(0,16,0,16,-1,1)\n\
         glBegin(GL_LINES)\nglVertex2f(2.1,5.5)\nglVertex2f(14.1,5.5)\nglEnd()",
        &[],
    );
    assert_eq!(image.lit(), [(2, 5), (3, 5), (8, 5), (9, 5)]);
}

#[test]
fn accumulation_adds_scales_and_returns() {
    let clear = |color: &str| format!("glClearColor({color},1)\nglClear(GL_COLOR_BUFFER_BIT)\n");
    let image = shown(
        &format!(
            "{}glAccum(GL_LOAD,0.5)\n{}glAccum(GL_ACCUM,0.25)\n{}glAccum(GL_MULT,0.5)\nglAccum(GL_RETURN,2)",
            clear("1,0,0"),
            clear("0,1,1"),
            clear("0,0,0")
        ),
        &[],
    );
    assert!(near(image.at(3, 3), [128, 64, 64]), "{:?}", image.at(3, 3));
    let image =
        shown("glClearAccum(0.2,0.4,0,0)\nglClear(GL_ACCUM_BUFFER_BIT)\nglAccum(GL_ADD,0.2)\nglAccum(GL_RETURN,1)", &[]);
    assert!(near(image.at(3, 3), [102, 153, 51]), "{:?}", image.at(3, 3));
}

/// A texture of 16 x 16 in a frame buffer object; its lower half is red, its upper left quarter green.
const OBJECT: &str = "glBindTexture(GL_TEXTURE_2D,1)\nglTexParameteri(GL_TEXTURE_2D,GL_TEXTURE_MIN_FILTER,GL_NEAREST)\n\
    glTexParameteri(GL_TEXTURE_2D,GL_TEXTURE_MAG_FILTER,GL_NEAREST)\n\
    glTexImage2D(GL_TEXTURE_2D,0,GL_RGBA,16,16,0,GL_RGBA,GL_UNSIGNED_BYTE,U0x0)\nglBindFramebufferEXT(GL_FRAMEBUFFER_EXT,2)\n\
    glFramebufferTexture2DEXT(GL_FRAMEBUFFER_EXT,GL_COLOR_ATTACHMENT0_EXT,GL_TEXTURE_2D,1,0)\nglClearColor(0,0,0,1)\n\
    glClear(GL_COLOR_BUFFER_BIT)\nglEnable(GL_CULL_FACE)\n\
    glColor3f(1,0,0)\nglRectf(-1,-1,1,0)\nglColor3f(0,1,0)\nglRectf(-1,0,0,1)\nglColor3f(1,1,1)\n";

const TEXTURED: &str = "glEnable(GL_TEXTURE_2D)\nglBegin(GL_QUADS)\nglTexCoord2f(0,0)\nglVertex2f(-1,-1)\nglTexCoord2f(1,0)\n\
    glVertex2f(1,-1)\nglTexCoord2f(1,1)\nglVertex2f(1,1)\nglTexCoord2f(0,1)\nglVertex2f(-1,1)\nglEnd()\n";

#[test]
fn what_is_drawn_into_a_texture_is_upright_where_it_is_read() {
    let image = shown(&format!("{OBJECT}glBindFramebufferEXT(GL_FRAMEBUFFER_EXT,0)\n{TEXTURED}"), &[]);
    for (x, y, color) in [(0, 0, RED), (15, 7, RED), (0, 8, GREEN), (7, 15, GREEN), (8, 8, BLACK), (15, 15, BLACK)] {
        assert_eq!(image.at(x, y), color, "{x}, {y}");
    }
    // Scissor, window positions and copies count rows from the bottom there too.
    let image = shown(
        &format!(
            "{OBJECT}glEnable(GL_SCISSOR_TEST)\nglScissor(1,2,1,1)\nglClearColor(0,0,1,1)\nglClear(GL_COLOR_BUFFER_BIT)\n\
             glDisable(GL_SCISSOR_TEST)\nglWindowPos2i(4,12)\nglCopyPixels(1,2,1,1,GL_COLOR)\n\
             glBindFramebufferEXT(GL_FRAMEBUFFER_EXT,0)\n{TEXTURED}"
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
             glTexParameteri(GL_TEXTURE_2D,GL_TEXTURE_BASE_LEVEL,4)\n{TEXTURED}"
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
             glFramebufferTexture2DEXT(GL_FRAMEBUFFER_EXT,GL_COLOR_ATTACHMENT0_EXT,GL_TEXTURE_2D,1,1)\nglViewport(0,0,8,8)\n{TEXTURED}\
             glBindFramebufferEXT(GL_FRAMEBUFFER_EXT,0)\nglViewport(0,0,16,16)\n\
             glTexParameteri(GL_TEXTURE_2D,GL_TEXTURE_MAX_LEVEL,1)\nglTexParameteri(GL_TEXTURE_2D,GL_TEXTURE_BASE_LEVEL,1)\n{TEXTURED}"
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
             glTexSubImage2D(GL_TEXTURE_2D,0,1,0,1,1,GL_DEPTH_COMPONENT,GL_UNSIGNED_SHORT,*1)\n{TEXTURED}"
        ),
        &[&[0, 128, 0, 0]],
    );
    assert!(near(image.at(4, 8), BLACK) && near(image.at(12, 8), [128; 3]), "{:?} {:?}", image.at(4, 8), image.at(12, 8));
}

#[test]
fn images_may_have_another_size_between_two_uses() {
    // Two texels wide, used; then four, without contents; then two again.
    let image = |width: u32, bytes: &str| {
        format!("glTexImage2D(GL_TEXTURE_2D,0,GL_DEPTH_COMPONENT16,{width},1,0,GL_DEPTH_COMPONENT,GL_UNSIGNED_SHORT,{bytes})\n")
    };
    let filters = "glTexParameteri(GL_TEXTURE_2D,GL_TEXTURE_MIN_FILTER,GL_NEAREST)\nglTexParameteri(GL_TEXTURE_2D,GL_TEXTURE_MAG_FILTER,GL_NEAREST)\n";
    let calls = format!("{filters}{}{TEXTURED}{}{}{TEXTURED}", image(2, "*1"), image(4, "U0x0"), image(2, "*2"));
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
fn a_frame_buffer_object_of_depths_alone_gives_a_shadow_map() {
    let calls = format!(
        "glBindTexture(GL_TEXTURE_2D,1)\nglTexParameteri(GL_TEXTURE_2D,GL_TEXTURE_MIN_FILTER,GL_NEAREST)\n\
         glTexImage2D(GL_TEXTURE_2D,0,GL_DEPTH_COMPONENT24,8,8,0,GL_DEPTH_COMPONENT,GL_FLOAT,U0x0)\n\
         glBindFramebuffer(GL_FRAMEBUFFER,3)\nglFramebufferTexture2D(GL_FRAMEBUFFER,GL_DEPTH_ATTACHMENT,GL_TEXTURE_2D,1,0)\n\
         glDrawBuffer(GL_NONE)\nglViewport(0,0,8,8)\nglClear(GL_DEPTH_BUFFER_BIT)\nglEnable(GL_DEPTH_TEST)\nglRectf(-1,-1,1,0)\n\
         glDisable(GL_DEPTH_TEST)\nglBindFramebuffer(GL_FRAMEBUFFER,0)\nglViewport(0,0,16,16)\n{TEXTURED}"
    );
    let image = shown(&calls, &[]);
    assert!(near(image.at(9, 3), [128; 3]) && image.at(9, 12) == [255; 3], "{:?}", image.at(9, 3));
}

#[test]
fn pixels_come_from_a_buffer_object_where_one_is_bound() {
    let image = shown(
        "glBindBufferARB(GL_PIXEL_UNPACK_BUFFER,7)\nglBufferDataARB(GL_PIXEL_UNPACK_BUFFER,8,*1,GL_STREAM_DRAW)\nglWindowPos2i(2,2)\n\
         glDrawPixels(1,1,GL_RGBA,GL_UNSIGNED_BYTE,4)\nglBindBufferARB(GL_PIXEL_UNPACK_BUFFER,0)\n\
         glWindowPos2i(3,2)\nglDrawPixels(1,1,GL_RGBA,GL_UNSIGNED_BYTE,*2)",
        &[&[9, 9, 9, 9, 0, 255, 0, 255], &[0, 0, 255, 255]],
    );
    assert_eq!((image.at(2, 2), image.at(3, 2), image.lit().len()), (GREEN, BLUE, 2));
}

#[test]
fn buffer_objects_into_which_pixels_were_read_are_not_drawn_from() {
    let read = "glBindBuffer(GL_PIXEL_PACK_BUFFER,7)\nglBufferData(GL_PIXEL_PACK_BUFFER,4,*1,GL_STREAM_READ)\n\
        glReadPixels(0,0,1,1,GL_RGBA,GL_UNSIGNED_BYTE,U0x0)\nglBindBuffer(GL_PIXEL_PACK_BUFFER,0)\n";
    let drawn = "glBindBuffer(GL_PIXEL_UNPACK_BUFFER,7)\nglWindowPos2i(2,2)\nglDrawPixels(1,1,GL_RGBA,GL_UNSIGNED_BYTE,0)\n";
    let refusal = |calls: &str| recorded(calls, &[&[0, 255, 0, 255]], 0..u64::MAX, &Reading::default()).1.refusal();
    assert_eq!(refusal(read), None);
    let what = refusal(&format!("{read}{drawn}"));
    assert!(
        what.as_ref().is_some_and(|what| what.starts_with("reading of a buffer object into which pixels were read back")),
        "{what:?}"
    );
    // Unless its contents are given anew.
    let again = "glBindBuffer(GL_PIXEL_UNPACK_BUFFER,7)\nglBufferSubData(GL_PIXEL_UNPACK_BUFFER,0,4,*1)\n";
    assert_eq!(refusal(&format!("{read}{again}{drawn}")), None);
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
             glCompressedTexSubImage2DARB(GL_TEXTURE_2D,0,4,0,4,4,GL_COMPRESSED_RGB_S3TC_DXT1_EXT,8,*2)\n{TEXTURED}\n"
        ),
        &[&image, &blue],
    );
    assert_eq!([picture.at(0, 0), picture.at(15, 0), picture.at(8, 7), picture.at(15, 8)], [RED, BLUE, BLUE, RED]);
    // Two by two texels are no whole block.
    let picture = shown(
        &format!("{setup}glCompressedTexImage2DARB(GL_TEXTURE_2D,0,GL_COMPRESSED_RGB_S3TC_DXT1_EXT,2,2,0,8,*1)\n{TEXTURED}\n"),
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
             glTexImage2D(GL_TEXTURE_2D,0,GL_RGBA,4,4,1,GL_RGBA,GL_UNSIGNED_BYTE,*1)\n{TEXTURED}"
        ),
        &[texels.as_flattened()],
    );
    assert_eq!([image.at(0, 0), image.at(15, 0), image.at(0, 15), image.at(15, 15)], [RED, GREEN, BLUE, [255; 3]]);
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
fn occlusion_queries_are_carried() {
    let (trace, report) = imported(
        "glBeginQueryARB(GL_SAMPLES_PASSED_ARB,1)\nglRectf(-1,-1,0,0)\nglEndQueryARB(GL_SAMPLES_PASSED_ARB)\nglColor3f(1,0,0)\nglRectf(0,0,1,1)\n\
         glBeginQueryARB(GL_SAMPLES_PASSED_ARB,2)\nglRectf(0,0,1,1)\nglEndQueryARB(GL_SAMPLES_PASSED_ARB)",
        &[],
        0..u64::MAX,
    );
    let (mut open, mut counted) = (false, Vec::new());
    let seen: Result<(), TraceError> = trace.for_each_command(|_, command| {
        match command {
            Command::BeginOcclusionQuery { .. } => open = true,
            Command::EndOcclusionQuery => open = false,
            Command::DrawIndexed { .. } => counted.push(open),
            _ => {}
        }
        Ok(())
    });
    seen.expect("commands in memory");
    assert_eq!((report.queries, counted), (2, vec![true, false, true]));
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
