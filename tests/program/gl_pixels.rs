//! Pixel rectangles, bitmaps, pixel storage and the raster position.

use super::gl_scenes::{BLACK, BLUE, GREEN, NEAREST, ORTHO, QUAD, RED, Shown, TEXTURED, near, refused, shown, tolerated};

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
fn depths_are_not_copied_to_colours() {
    for kind in [34926, 34927] {
        let what = refused(&format!("glRasterPos2f(0,0)\nglCopyPixels(0,0,2,2,{kind})"), &[]);
        assert!(what.starts_with("copies of depths and stencil values to colours"), "{what}");
    }
}

#[test]
fn depths_and_stencil_values_are_copied() {
    // The left half of the window is nearer; its depths are copied to the right half.
    let near_left = "glEnable(GL_DEPTH_TEST)\nglColorMask(0,0,0,0)\nglBegin(GL_QUADS)\nglVertex3f(-1,-1,-0.5)\nglVertex3f(0,-1,-0.5)\n\
        glVertex3f(0,1,-0.5)\nglVertex3f(-1,1,-0.5)\nglEnd()\n";
    let copy = |kind: &str| {
        format!("glDepthFunc(GL_ALWAYS)\nglWindowPos2i(10,3)\nglCopyPixels(1,1,4,5,{kind})\nglDepthFunc(GL_LESS)\n")
    };
    let image = shown(&format!("{near_left}{}glColorMask(1,1,1,1)\n{QUAD}", copy("GL_DEPTH")), &[]);
    let hidden = |x: usize, y: usize| x < 8 || (10..14).contains(&x) && (3..8).contains(&y);
    assert!((0..256).all(|k| hidden(k % 16, k / 16) == (image.at(k % 16, k / 16) == BLACK)), "{:?}", image.lit());
    // Stencil values of a row, copied two rows up.
    let values = "glWindowPos2i(3,3)\nglDrawPixels(4,1,GL_STENCIL_INDEX,GL_UNSIGNED_BYTE,*1)\n";
    let image = shown(
        &format!(
            "{values}glWindowPos2i(5,5)\nglCopyPixels(3,3,4,1,GL_STENCIL)\nglEnable(GL_STENCIL_TEST)\nglStencilFunc(GL_EQUAL,5,255)\n{QUAD}"
        ),
        &[&[5, 7, 5, 255]],
    );
    assert_eq!(image.lit(), [(3, 3), (5, 3), (5, 5), (7, 5)]);
    // Depths that are drawn pass the stencil test.
    let depths: Vec<u8> = [0.25_f32; 4].iter().flat_map(|depth| depth.to_le_bytes()).collect();
    let image = shown(
        &format!(
            "{values}glEnable(GL_DEPTH_TEST)\nglEnable(GL_STENCIL_TEST)\nglStencilFunc(GL_EQUAL,5,255)\nglColorMask(0,0,0,0)\nglWindowPos2i(3,3)\n\
             glDrawPixels(4,1,GL_DEPTH_COMPONENT,GL_FLOAT,*2)\nglColorMask(1,1,1,1)\nglDisable(GL_STENCIL_TEST)\nglEnable(GL_SCISSOR_TEST)\n\
             glScissor(3,3,4,1)\n{QUAD}"
        ),
        &[&[5, 7, 5, 255], &depths],
    );
    assert_eq!(image.lit(), [(4, 3), (6, 3)]);
}

#[test]
fn raster_positions_have_the_coordinates_of_maps() {
    // A sphere map seen straight on by a normal towards the viewer is read in its middle, by one to the right at the right.
    let texels = [[255, 0, 0, 255], [0, 255, 0, 255], [0, 0, 255, 255]].concat();
    let draw = |normal: &str| {
        let calls = format!(
            "{NEAREST}glTexImage2D(3553,0,6408,3,1,0,GL_RGBA,GL_UNSIGNED_BYTE,*1)\nglTexGeni(8192,9472,9218)\nglTexGeni(8193,9472,9218)\n\
             glEnable(3168)\nglEnable(3169)\nglMatrixMode(GL_PROJECTION)\nglFrustum(-1,1,-1,1,1,10)\nglMatrixMode(GL_MODELVIEW)\nglTranslatef(0,0,-2)\n\
             glNormal3f({normal})\nglRasterPos2f(0,0)\nglBitmap(1,1,0,0,0,0,*2)"
        );
        shown(&calls, &[&texels, &[0x80, 0, 0, 0]]).at(8, 8)
    };
    assert_eq!((draw("0,0,1"), draw("0.7071068,0,0.7071068")), (GREEN, BLUE));
}

#[test]
fn polygon_stipples_have_the_storage_of_pixels() {
    // Every row has its lowest bit set: the leftmost of eight pixels, where the lowest bit comes first.
    let pattern = [1; 128];
    let draw = |more: &str| shown(&format!("{more}glPolygonStipple(*1)\nglEnable(GL_POLYGON_STIPPLE)\n{QUAD}"), &[&pattern]);
    let columns = |image: &Shown| (0..16).filter(|&x| image.at(x, 5) != BLACK).collect::<Vec<_>>();
    assert_eq!(columns(&draw("")), [7, 15]);
    assert_eq!(columns(&draw("glPixelStorei(GL_UNPACK_LSB_FIRST,1)\n")), [0, 8]);
}

#[test]
fn pixel_rectangles_have_a_fog_coordinate_of_zero() {
    let drawn = |mode: &str, place: &str| {
        let fog =
            format!("glFogi(GL_FOG_MODE,{mode})\nglFogf(GL_FOG_DENSITY,3)\nglFogf(GL_FOG_START,-1)\nglFogf(GL_FOG_END,3)\n");
        let calls = format!(
            "glEnable(GL_FOG)\n{fog}glFogfv(GL_FOG_COLOR,{{0,0,1,1}})\nglFogi(GL_FOG_COORD_SRC,GL_FOG_COORD)\nglFogCoordf(2)\n{place}glDrawPixels(1,1,GL_RGBA,GL_UNSIGNED_BYTE,*1)"
        );
        shown(&calls, &[&[255, 0, 0, 255]]).at(8, 8)
    };
    for place in [
        "glRasterPos3f(0,0,0.5)\n",
        "glWindowPos3f(8,8,0.5)\n",
        "glFogi(GL_FOG_COORD_SRC,GL_FRAGMENT_DEPTH)\nglRasterPos3f(0,0,0.5)\n",
    ] {
        assert_eq!([drawn("GL_EXP", place), drawn("GL_EXP2", place)], [RED; 2], "{place}");
        // 3 of 4 is the distance from 0 to the end.
        assert!(near(drawn("GL_LINEAR", place), [191, 0, 64]), "{place} {:?}", drawn("GL_LINEAR", place));
    }
}

#[test]
fn halves_of_raster_positions_are_rounded_up() {
    let pixel = [0, 255, 0, 255];
    for (at, expected) in [("2.5,3.5", (3, 4)), ("3.4,4.6", (3, 5))] {
        let image = shown(&format!("{ORTHO}glRasterPos2f({at})\nglDrawPixels(1,1,GL_RGBA,GL_UNSIGNED_BYTE,*1)\n"), &[&pixel]);
        assert_eq!(image.lit(), [expected]);
        assert_eq!(image.at(expected.0, expected.1), GREEN);
    }
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
