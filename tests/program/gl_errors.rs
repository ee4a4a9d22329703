//! Calls that are errors, and rare arguments: each has the effect that it has in Mesa, or none, and the recording goes on.

use fillrate::trace::Reading;

use super::gl_features::{BLACK, BLUE, GREEN, QUAD, RED, Shown, last_of, near, recorded, shown};

const ORTHO: &str = "glMatrixMode(GL_PROJECTION)\nglOrtho(0,16,0,16,-1,1)\nglMatrixMode(GL_MODELVIEW)\n";
const NEAREST: &str =
    "glTexParameteri(3553,10241,9728)\nglTexParameteri(3553,10240,9728)\nglTexEnvi(8960,8704,7681)\nglEnable(3553)\n";
const TEXTURED: &str = "glBegin(GL_QUADS)\nglTexCoord2f(0,0)\nglVertex2f(-1,-1)\nglTexCoord2f(1,0)\nglVertex2f(1,-1)\nglTexCoord2f(1,1)\n\
    glVertex2f(1,1)\nglTexCoord2f(0,1)\nglVertex2f(-1,1)\nglEnd()\n";

/// The picture of calls that are supported, and the names of those that are errors.
fn tolerated(calls: &str, buffers: &[&[u8]]) -> (Shown, Vec<String>) {
    let (trace, report) = recorded(calls, buffers, 0..u64::MAX, &Reading::default());
    assert_eq!(report.refusal(), None);
    (last_of(&trace), report.errors.iter().map(|(name, _)| name.to_owned()).collect())
}

/// Why calls are refused.
fn refused(calls: &str, buffers: &[&[u8]]) -> String {
    recorded(calls, buffers, 0..u64::MAX, &Reading::default()).1.refusal().unwrap_or_default()
}

fn floats(values: &[f32]) -> Vec<u8> {
    values.iter().flat_map(|value| value.to_le_bytes()).collect()
}

#[test]
fn single_numbers_for_colours_and_places_are_followed_by_zeros() {
    let lit = "glEnable(GL_LIGHTING)\nglNormal3f(0,0,1)\nglMaterialfv(GL_FRONT,GL_AMBIENT,{1,1,1,1})\nglMaterialfv(GL_FRONT,GL_DIFFUSE,{1,1,1,1})\n";
    let texture = "glTexImage2D(3553,0,6408,2,1,0,6408,GL_UNSIGNED_BYTE,*1)\n";
    let cases = [
        (
            "glEnable(GL_FOG)\nglFogi(GL_FOG_MODE,GL_LINEAR)\nglFogf(GL_FOG_START,-2)\nglFogf(GL_FOG_END,-1)\n".to_owned(),
            "glFogf(GL_FOG_COLOR,0.5)",
            "glFogfv(GL_FOG_COLOR,{0.5,0,0,0})",
        ),
        (
            format!("{NEAREST}{texture}glTexEnvi(8960,8704,GL_BLEND)\nglTexEnvfv(8960,GL_TEXTURE_ENV_COLOR,{{0,1,1,1}})\n"),
            "glTexEnvf(8960,GL_TEXTURE_ENV_COLOR,0.5)",
            "glTexEnvfv(8960,GL_TEXTURE_ENV_COLOR,{0.5,0,0,0})",
        ),
        (lit.to_owned(), "glLightModelf(GL_LIGHT_MODEL_AMBIENT,0.5)", "glLightModelfv(GL_LIGHT_MODEL_AMBIENT,{0.5,0,0,0})"),
        (
            format!("{lit}glEnable(GL_LIGHT0)\n"),
            "glLightf(GL_LIGHT0,GL_DIFFUSE,0.5)",
            "glLightfv(GL_LIGHT0,GL_DIFFUSE,{0.5,0,0,0})",
        ),
        (
            format!("{NEAREST}{texture}glEnable(GL_TEXTURE_GEN_S)\nglTexGeni(GL_S,GL_TEXTURE_GEN_MODE,GL_OBJECT_LINEAR)\n"),
            "glTexGenf(GL_S,GL_OBJECT_PLANE,0.5)",
            "glTexGenfv(GL_S,GL_OBJECT_PLANE,{0.5,0,0,0})",
        ),
    ];
    for (before, single, several) in cases {
        let of = |call: &str| shown(&format!("{before}{call}\n{QUAD}"), &[&[255, 0, 0, 255, 0, 0, 255, 255]]).0;
        assert!(of(single) == of(several), "{single}");
        assert!(of(single) != of(""), "{single}");
    }
    let points =
        |call: &str| shown(&format!("{ORTHO}glPointSize(2)\n{call}\nglBegin(GL_POINTS)\nglVertex2f(8,8)\nglEnd()"), &[]);
    assert_eq!(points("glPointParameterf(GL_POINT_DISTANCE_ATTENUATION,0.25)").lit().len(), 16);
    // These are errors. Of a material, Mesa reads what lies behind the number.
    let errors = tolerated(
        &format!(
            "glEnable(GL_LIGHTING)\nglLightModelfv(GL_LIGHT_MODEL_AMBIENT,{{1,1,1,1}})\nglMaterialfv(GL_FRONT,GL_AMBIENT,{{0,1,0,1}})\n\
             glMaterialf(GL_FRONT,GL_AMBIENT,0.5)\nglTexParameterf(3553,GL_TEXTURE_BORDER_COLOR,0.5)\nglTexParameteri(3553,36422,6403)\n{QUAD}"
        ),
        &[],
    );
    assert_eq!(errors.0.at(8, 8), GREEN);
    assert_eq!(
        errors.1,
        ["glMaterialf: GL_INVALID_ENUM", "glTexParameterf: GL_INVALID_ENUM", "glTexParameteri: GL_INVALID_ENUM"]
    );
}

#[test]
fn pixels_whose_type_does_not_fit_their_format_are_errors() {
    let (image, errors) = tolerated(
        &format!(
            "{ORTHO}glRasterPos2f(3,3)\nglDrawPixels(9,9,GL_RED,GL_UNSIGNED_BYTE_3_3_2,U0x0)\nglDrawPixels(9,9,GL_RGBA,GL_DOUBLE,U0x0)\n\
             glTexImage2D(3553,0,6408,2,1,0,GL_RGB,GL_UNSIGNED_SHORT_4_4_4_4,U0x0)\nglDrawPixels(1,1,GL_RGBA,GL_UNSIGNED_BYTE,*1)"
        ),
        &[&[0, 255, 0, 255]],
    );
    assert_eq!((image.lit(), image.at(3, 3)), (vec![(3, 3)], GREEN));
    assert_eq!(
        errors,
        ["glDrawPixels: GL_INVALID_ENUM", "glDrawPixels: GL_INVALID_OPERATION", "glTexImage2D: GL_INVALID_OPERATION"]
    );
    assert!(refused(&format!("{ORTHO}glDrawPixels(1,1,34647,34234,*1)"), &[&[0; 4]]).starts_with("pixels of format"));
}

#[test]
fn pixels_may_have_alpha_first() {
    let pixels = [[255, 0, 255, 0], [255, 0, 0, 255]].concat();
    let image = shown(&format!("{ORTHO}glRasterPos2f(3,3)\nglDrawPixels(2,1,GL_ABGR_EXT,GL_UNSIGNED_BYTE,*1)"), &[&pixels]);
    assert_eq!([image.at(3, 3), image.at(4, 3)], [GREEN, RED]);
    let image =
        shown(&format!("{NEAREST}glTexImage2D(3553,0,6408,2,1,0,GL_ABGR_EXT,GL_UNSIGNED_BYTE,*1)\n{TEXTURED}"), &[&pixels]);
    assert_eq!([image.at(3, 3), image.at(12, 3)], [GREEN, RED]);
    // The first component of a packed pixel is alpha, which is in the highest bits, or in the lowest.
    for (kind, bytes) in [("GL_UNSIGNED_SHORT_4_4_4_4", [0xf0_u8, 0xf0]), ("GL_UNSIGNED_SHORT_4_4_4_4_REV", [0x0f, 0x0f])] {
        let image = shown(&format!("{ORTHO}glRasterPos2f(3,3)\nglDrawPixels(1,1,GL_ABGR_EXT,{kind},*1)"), &[&bytes]);
        assert_eq!(image.at(3, 3), GREEN, "{kind}");
    }
}

#[test]
fn images_are_skipped_in_three_dimensions_only() {
    let store = "glPixelStorei(GL_UNPACK_SKIP_IMAGES,1)\nglPixelStorei(GL_UNPACK_IMAGE_HEIGHT,1)\n";
    let (red, both) = ([255, 0, 0, 255], [[255, 0, 0, 255], [0, 0, 255, 255]].concat());
    let drawn = shown(&format!("{ORTHO}{store}glRasterPos2f(3,3)\nglDrawPixels(1,1,GL_RGBA,GL_UNSIGNED_BYTE,*1)"), &[&red]);
    assert_eq!(drawn.at(3, 3), RED);
    let image = |calls: &str| shown(&format!("{NEAREST}{store}{calls}\n{TEXTURED}"), &[&red, &both]).at(8, 8);
    assert_eq!(image("glTexImage2D(3553,0,6408,1,1,0,6408,5121,*1)"), RED);
    assert_eq!(image("glTexImage2D(3553,0,6408,1,1,0,6408,5121,U0x0)\nglTexSubImage2D(3553,0,0,0,1,1,6408,5121,*1)"), RED);
    let solid = "glTexParameteri(32879,10241,9728)\nglTexParameteri(32879,10240,9728)\nglEnable(32879)\n";
    assert_eq!(image(&format!("{solid}glTexImage3D(32879,0,6408,1,1,1,0,6408,5121,*2)")), BLUE);
    let pattern: Vec<u8> = vec![0xff; 128];
    let stippled = shown(&format!("{store}glEnable(GL_POLYGON_STIPPLE)\nglPolygonStipple(*1)\n{QUAD}"), &[&pattern]);
    assert_eq!(stippled.lit().len(), 256);
}

#[test]
fn pixel_maps_and_patterns_come_from_buffer_objects() {
    let buffer = "glBindBufferARB(35052,1)\nglBufferDataARB(35052,132,*1,35044)\n";
    let mut bytes = vec![0xff, 0xff, 0, 0];
    bytes.extend([0x0f; 128]);
    let (image, errors) = tolerated(
        &format!(
            "{ORTHO}{buffer}glPixelMapusv(GL_PIXEL_MAP_R_TO_R,2,U0x0)\nglPixelMapusv(GL_PIXEL_MAP_G_TO_G,128,U0x0)\nglPolygonStipple(4)\n\
             glBindBufferARB(35052,0)\nglPixelTransferi(GL_MAP_COLOR,1)\nglRasterPos2f(3,3)\nglDrawPixels(2,1,GL_RGBA,GL_UNSIGNED_BYTE,*2)\n\
             glEnable(GL_POLYGON_STIPPLE)\nglRectf(0,8,16,16)"
        ),
        &[&bytes, &[255, 0, 0, 255, 0, 0, 0, 255]],
    );
    assert_eq!([image.at(3, 3), image.at(4, 3)], [BLACK, RED]);
    assert_eq!([image.at(3, 9), image.at(4, 9)], [BLACK, [255; 3]]);
    assert_eq!(errors, ["glPixelMapusv: GL_INVALID_OPERATION"], "a map that is larger than its buffer object");
    let beyond = format!(
        "{ORTHO}{buffer}glDrawPixels(6,6,GL_RGBA,GL_UNSIGNED_BYTE,U0x0)\nglBitmap(32,33,0,0,0,0,4)\nglPolygonStipple(8)"
    );
    let (image, errors) = tolerated(&beyond, &[&bytes]);
    assert_eq!(image.lit(), []);
    let names = ["glBitmap", "glDrawPixels", "glPolygonStipple"];
    assert_eq!(errors, names.map(|name| format!("{name}: GL_INVALID_OPERATION")));
}

#[test]
fn draws_of_instances_are_errors_in_lists() {
    let corners = floats(&[0.0, 0.0, 16.0, 0.0, 0.0, 16.0]);
    let arrays = "glEnableClientState(GL_VERTEX_ARRAY)\nglVertexPointer(2,GL_FLOAT,0,*1)\n";
    let (image, errors) = tolerated(
        &format!(
            "{ORTHO}{arrays}glNewList(1,GL_COMPILE_AND_EXECUTE)\nglDrawArraysInstanced(GL_TRIANGLES,0,3,1)\n\
             glDrawElementsInstancedBaseVertex(GL_TRIANGLES,2,GL_UNSIGNED_INT,U0x0,3,0)\nglEndList()\nglCallList(1)"
        ),
        &[&corners],
    );
    assert_eq!(image.lit(), []);
    let names = ["glDrawArraysInstanced", "glDrawElementsInstancedBaseVertex"];
    assert_eq!(errors, names.map(|name| format!("{name}: GL_INVALID_OPERATION")));
    // A recorder gives as many elements as there are vertices: the fourth instance has none.
    let few = "glEnableVertexAttribArray(3)\nglVertexAttribDivisor(3,1)\nglVertexAttribPointer(3,2,GL_FLOAT,0,0,*1)\n";
    let draw = |instances: u32| {
        refused(&format!("{ORTHO}{arrays}{few}glDrawArraysInstanced(GL_TRIANGLES,0,3,{instances})"), &[&corners])
    };
    assert_eq!(draw(3), "");
    assert!(draw(4).starts_with("elements of instances in memory"), "{}", draw(4));
}

#[test]
fn depths_and_stencil_values_are_drawn_and_copied_together() {
    // The lower left corner has depth 0.25 and stencil value 9, the rest 1 and 7. The test would fail everywhere, and the colour is red.
    let corner = "glClearDepth(1)\nglClearStencil(7)\nglClear(GL_DEPTH_BUFFER_BIT | GL_STENCIL_BUFFER_BIT)\nglEnable(GL_SCISSOR_TEST)\n\
        glScissor(0,0,2,2)\nglClearDepth(0.25)\nglClearStencil(9)\nglClear(GL_DEPTH_BUFFER_BIT | GL_STENCIL_BUFFER_BIT)\n\
        glDisable(GL_SCISSOR_TEST)\nglColor3f(1,0,0)\nglWindowPos2i(8,8)\nglEnable(GL_DEPTH_TEST)\nglDepthFunc(GL_NEVER)\n";
    let see = |stencil: u32, z: f32| {
        format!(
            "glDepthMask(1)\nglEnable(GL_STENCIL_TEST)\nglStencilFunc(GL_EQUAL,{stencil},255)\nglDepthFunc(GL_LESS)\nglColor3f(0,1,0)\n\
             glBegin(GL_QUADS)\nglVertex3f(-1,-1,{z})\nglVertex3f(1,-1,{z})\nglVertex3f(1,1,{z})\nglVertex3f(-1,1,{z})\nglEnd()"
        )
    };
    let words: Vec<u8> = [0x3fff_ff09_u32; 4].iter().flat_map(|word| word.to_le_bytes()).collect();
    let apart: Vec<u8> = [0.25_f32.to_bits(), 9].repeat(4).iter().flat_map(|word| word.to_le_bytes()).collect();
    let moved = [(8, 8), (9, 8), (8, 9), (9, 9)];
    let all: Vec<_> = [(0, 0), (1, 0), (0, 1), (1, 1)].into_iter().chain(moved).collect();
    for call in ["glCopyPixels(0,0,2,2,34041)", "glDrawPixels(2,2,34041,34042,*1)", "glDrawPixels(2,2,34041,36269,*2)"] {
        let lit = |mask: u32, stencil: u32, z: f32| {
            shown(&format!("{corner}glDepthMask({mask})\n{call}\n{}", see(stencil, z)), &[&words, &apart]).lit()
        };
        // At a depth of 0.2 and of 0.3.
        assert_eq!(lit(1, 9, -0.6), all, "{call}");
        assert_eq!(lit(1, 9, -0.4), [], "{call}");
        assert_eq!(lit(0, 9, -0.4), moved, "without depths, {call}");
    }
    // Depths of a texture may have stencil values beside them.
    let texture = |then: &str| {
        format!(
            "glBindTexture(3553,3)\n{NEAREST}glTexImage2D(3553,0,35056,2,2,0,34041,34042,*1)\nglBindTexture(3553,4)\n{then}"
        )
    };
    let depth = shown(&format!("{}glBindTexture(3553,3)\n{TEXTURED}", texture("")), &[&words]).at(8, 8);
    assert!(near(depth, [64; 3]), "{depth:?}");
    let attached = texture(&format!(
        "glBindFramebufferEXT(36160,2)\nglFramebufferTexture2DEXT(36160,36096,3553,3,0)\nglFramebufferTexture2DEXT(36160,36128,3553,3,0)\n{QUAD}"
    ));
    assert!(refused(&attached, &[&words]).contains("stencil values that a texture was given"));
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

#[test]
fn primitives_of_lists_between_begin_and_end_are_dropped() {
    let corners = floats(&[0.0, 0.0, 16.0, 0.0, 0.0, 16.0]);
    let whole = "glVertex2f(0,0)\nglVertex2f(16,0)\nglVertex2f(0,16)\n";
    let lists = format!(
        "{ORTHO}glEnableClientState(GL_VERTEX_ARRAY)\nglVertexPointer(2,GL_FLOAT,0,*1)\nglNewList(1,GL_COMPILE)\nglDrawArrays(GL_TRIANGLES,0,3)\nglEndList()\n\
         glNewList(2,GL_COMPILE)\nglBegin(GL_TRIANGLES)\nglColor3f(1,0,0)\n{whole}glEnd()\nglEndList()\n\
         glNewList(3,GL_COMPILE)\nglBegin(GL_TRIANGLES)\nglVertex2f(0,0)\nglColor3f(1,0,0)\nglVertex2f(16,0)\nglVertex2f(0,16)\nglEnd()\nglEndList()\n\
         glNewList(4,GL_COMPILE)\nglVertex2f(0,16)\nglEndList()\nglColor3f(0,1,0)\n"
    );
    for list in 1..4 {
        let (image, errors) = tolerated(&format!("{lists}glBegin(GL_TRIANGLES)\nglCallList({list})\nglEnd()"), &[&corners]);
        assert_eq!((image.lit(), errors.len()), (vec![], 1), "{list}");
        // The open primitive goes on.
        let around = format!(
            "{lists}glBegin(GL_TRIANGLES)\nglVertex2f(0,0)\nglVertex2f(16,0)\nglCallList({list})\nglCallList(4)\nglEnd()"
        );
        let (image, errors) = tolerated(&around, &[&corners]);
        assert_eq!((image.at(2, 2), errors), (GREEN, vec!["glBegin: GL_INVALID_OPERATION".to_owned()]), "{list}");
    }
}

#[test]
fn arrays_are_enabled_as_capabilities_are() {
    let arrays = [floats(&[0.0, 0.0, 16.0, 0.0, 0.0, 16.0]), floats(&[0.0, 1.0, 0.0, 0.0, 1.0, 0.0, 0.0, 1.0, 0.0])];
    let draw = |calls: &str| {
        let calls = format!(
            "{ORTHO}glVertexPointer(2,GL_FLOAT,0,*1)\nglColorPointer(3,GL_FLOAT,0,*2)\nglColor3f(1,0,0)\n{calls}\nglDrawArrays(GL_TRIANGLES,0,3)"
        );
        shown(&calls, &[&arrays[0], &arrays[1]]).at(2, 2)
    };
    assert_eq!(draw("glEnable(GL_VERTEX_ARRAY)\nglEnable(GL_COLOR_ARRAY)"), GREEN);
    assert_eq!(
        draw("glEnableClientState(GL_VERTEX_ARRAY)\nglEnableClientState(GL_COLOR_ARRAY)\nglDisable(GL_COLOR_ARRAY)"),
        RED
    );
    // In a list, they are switched when it is called.
    assert_eq!(draw("glNewList(1,GL_COMPILE)\nglEnable(GL_VERTEX_ARRAY)\nglEndList()"), BLACK);
    assert_eq!(draw("glNewList(1,GL_COMPILE)\nglEnable(GL_VERTEX_ARRAY)\nglEndList()\nglCallList(1)"), RED);
}

#[test]
fn offsets_without_bound_are_the_largest() {
    // Toward the eye without bound, a polygon that slopes passes the test of depths; away from it, it does not.
    let drawn = |factor: &str| {
        let before = format!("glEnable(GL_DEPTH_TEST)\nglColor3f(1,0,0)\n{QUAD}\nglColor3f(0,1,0)\n");
        let offset = format!("glEnable(GL_POLYGON_OFFSET_FILL)\nglPolygonOffset({factor},0)\nglRotatef(10,0,1,0)\n");
        shown(&format!("{before}{offset}{QUAD}"), &[]).at(8, 8)
    };
    assert_eq!([drawn("-1e39"), drawn("1e39")], [GREEN, RED]);
}
