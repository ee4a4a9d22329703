//! Rarely used features of OpenGL 1.5: copies of depths and stencil values, borders, flat outlines, stencils with two sides, and others.

use super::gl_features::{BLACK, BLUE, GREEN, QUAD, RED, near, recorded, shown};
use super::gl_later::program;
use fillrate::trace::Reading;

const ORTHO: &str = "glMatrixMode(GL_PROJECTION)\nglOrtho(0,16,0,16,-1,1)\nglMatrixMode(GL_MODELVIEW)\n";

#[test]
fn a_material_keeps_the_colour_that_tracked_it() {
    // Only the ambient light of the scene, so that the ambient material is the colour.
    let lit = "glLightModelfv(GL_LIGHT_MODEL_AMBIENT,{1,1,1,1})\nglEnable(GL_LIGHTING)\n";
    let of = |calls: &str| shown(&format!("{lit}{calls}\n{QUAD}"), &[]).at(8, 8);
    let tracked = "glColorMaterial(GL_FRONT_AND_BACK,GL_AMBIENT)\nglEnable(GL_COLOR_MATERIAL)\nglColor3f(1,0,0)\n";
    assert_eq!(of(&format!("{tracked}glDisable(GL_COLOR_MATERIAL)\nglColor3f(0,1,0)")), RED);
    assert_eq!(of(&format!("{tracked}glColor3f(0,1,0)")), GREEN);
    // Another term is tracked from now on: the ambient one stays.
    assert_eq!(of(&format!("{tracked}glColorMaterial(GL_FRONT_AND_BACK,GL_SPECULAR)\nglColor3f(0,0,1)")), RED);
    // The term that was tracked at the time of saving is restored.
    assert_eq!(
        of(&format!("{tracked}glPushAttrib(GL_LIGHTING_BIT)\nglColor3f(0,1,0)\nglPopAttrib()\nglDisable(GL_COLOR_MATERIAL)")),
        GREEN,
        "the tracked colour is the current one, which was not restored"
    );
    assert_eq!(of("glEnable(GL_COLOR_MATERIAL)\nglColor3f(0,0,1)\nglMaterialfv(GL_FRONT,GL_AMBIENT,{1,0,0,1})"), BLUE);
}

#[test]
fn outlines_and_corners_of_polygons_are_offset_and_other_lines_are_not() {
    // A blue plane whose depth falls by 0.05 from pixel to pixel, and is 0.5 where x is 8.
    let plane = format!(
        "{ORTHO}glEnable(GL_DEPTH_TEST)\nglColor3f(0,0,1)\nglBegin(GL_QUADS)\nglVertex3f(0,0,-0.8)\nglVertex3f(16,0,0.8)\nglVertex3f(16,16,0.8)\n\
         glVertex3f(0,16,-0.8)\nglEnd()\nglColor3f(1,0,0)\nglEnable(GL_POLYGON_OFFSET_LINE)\nglEnable(GL_POLYGON_OFFSET_POINT)\n"
    );
    // How many pixels of row 3 are red: the lower edge of a rectangle of this slope, or a line.
    let red = |mode: &str, slope: f32, offset: &str, more: &str, kind: &str| {
        let corner = |x: f32, y: f32| format!("glVertex3f({x},{y},{})\n", slope * (x - 8.0));
        let corners = [(0.5, 3.5), (15.5, 3.5), (15.5, 12.5), (0.5, 12.5)].map(|(x, y)| corner(x, y)).concat();
        let image = shown(
            &format!(
                "{plane}glPolygonMode(GL_FRONT_AND_BACK,{mode})\nglPolygonOffset({offset})\n{more}\nglBegin({kind})\n{corners}glEnd()\n"
            ),
            &[],
        );
        (0..16).filter(|&x| image.at(x, 3) == RED).count()
    };
    let outline = |slope: f32, offset: &str| red("GL_LINE", slope, offset, "", "GL_QUADS");
    let near_to = |count: usize, expected: usize| assert!(count.abs_diff(expected) <= 1, "{count}, not {expected}");
    near_to(outline(0.0, "0,0"), 8);
    // 2^21 units of two steps are 0.25: five pixels.
    near_to(outline(0.0, "0,2097152"), 3);
    near_to(outline(0.0, "0,-2097152"), 13);
    // A polygon that faces the viewer has no slope. The depth of one that leans the other way rises by 0.05 from pixel to pixel.
    near_to(outline(0.0, "4,0"), 8);
    near_to(outline(-0.1, "4,0"), 6);
    near_to(outline(-0.1, "-4,0"), 10);
    // In the plane itself, an offset decides.
    assert_eq!((outline(0.1, "1,1"), outline(0.1, "-1,-1")), (0, 16));
    // Also of wide, smooth and flat ones; lines between Begin and End stay where they are.
    for more in
        ["glLineWidth(3)", "glShadeModel(GL_FLAT)", "glEnable(GL_LINE_STIPPLE)\nglLineStipple(64,65535)", "glDepthRange(0,1)"]
    {
        near_to(red("GL_LINE", 0.0, "0,2097152", more, "GL_QUADS"), 3);
        near_to(red("GL_LINE", 0.0, "0,2097152", more, "GL_LINE_LOOP"), 8);
    }
    near_to(red("GL_LINE", 0.0, "0,2097152", "glDisable(GL_POLYGON_OFFSET_LINE)", "GL_QUADS"), 8);
    // The corner at the left is in front of the plane, unless it is moved away by more than 0.375.
    let corners = |offset: &str| red("GL_POINT", 0.0, offset, "", "GL_QUADS");
    assert_eq!((corners("0,0"), corners("0,2800000"), corners("0,3300000"), corners("0,-3300000")), (1, 1, 0, 2));
}

#[test]
fn an_outline_that_a_clip_plane_cuts_has_an_edge_along_it() {
    let square = |mode: &str, calls: &str| {
        shown(
            &format!(
                "{ORTHO}glColor3f(1,0,0)\nglPolygonMode(GL_FRONT_AND_BACK,{mode})\nglClipPlane(GL_CLIP_PLANE0,{{-1,0,0,8.5}})\n\
                 glClipPlane(GL_CLIP_PLANE1,{{0,1,0,-4.5}})\nglEnable(GL_CLIP_PLANE0)\n{calls}\nglBegin(GL_QUADS)\nglVertex2f(2.5,2.5)\n\
                 glVertex2f(13.5,2.5)\nglVertex2f(13.5,12.5)\nglVertex2f(2.5,12.5)\nglEnd()\n"
            ),
            &[],
        )
    };
    let red = |mode: &str, calls: &str| {
        let image = square(mode, calls);
        let all = (0..16_u32).flat_map(|y| (0..16).map(move |x| (x, y)));
        let red: Vec<(u32, u32)> = all.filter(|&(x, y)| image.at(x as usize, y as usize) == RED).collect();
        move |x: u32, y: u32| red.contains(&(x, y))
    };
    for calls in ["", "glShadeModel(GL_FLAT)", "glEnable(GL_LINE_STIPPLE)\nglLineStipple(1,65535)"] {
        let lines = red("GL_LINE", calls);
        assert!((3..12).all(|y| lines(8, y) && lines(2, y)) && lines(5, 2) && lines(5, 12), "{calls}");
        assert!((0..16).all(|y| (9..16).all(|x| !lines(x, y))) && !lines(5, 7), "{calls}");
    }
    // The edge along one plane ends at the other, which has an edge of its own.
    let both = red("GL_LINE", "glEnable(GL_CLIP_PLANE1)");
    assert!((5..12).all(|y| both(8, y)) && (3..8).all(|x| both(x, 4)) && (0..4).all(|y| (0..16).all(|x| !both(x, y))));
    // Its ends are corners, and so is where the plane meets a diagonal: Mesa cuts triangles.
    let corners = red("GL_POINT", "");
    assert!(corners(2, 2) && corners(2, 12) && corners(8, 2) && corners(8, 12) && corners(8, 7) && !corners(13, 2));
    assert!(!red("GL_FILL", "")(9, 7) && red("GL_FILL", "")(7, 7));
}

#[test]
fn the_pattern_of_an_outline_begins_at_the_closing_edge() {
    let outline = |mode: &str| {
        shown(
            &format!(
                "{ORTHO}glPolygonMode(GL_FRONT_AND_BACK,GL_LINE)\nglEnable(GL_LINE_STIPPLE)\nglLineStipple(1,255)\nglBegin({mode})\nglVertex2f(3.5,2.5)\n\
                 glVertex2f(11.5,2.5)\nglVertex2f(11.5,10.5)\nglVertex2f(3.5,10.5)\nglEnd()\n"
            ),
            &[],
        )
    };
    // Eight pixels are drawn, eight are left out. Of a quadrilateral the last edge is the first, as in Mesa.
    let (quad, polygon) = (outline("GL_QUADS"), outline("GL_POLYGON"));
    assert!(quad.at(3, 6) != BLACK && quad.at(7, 2) == BLACK && quad.at(11, 6) != BLACK && quad.at(7, 10) == BLACK);
    assert!(polygon.at(3, 6) == BLACK && polygon.at(7, 2) != BLACK && polygon.at(11, 6) == BLACK && polygon.at(7, 10) != BLACK);
}

#[test]
fn outlines_of_flat_polygons_have_the_colour_of_the_provoking_vertex() {
    let outline = |mode: &str, corners: &str| {
        shown(
            &format!(
                "{ORTHO}glShadeModel(GL_FLAT)\nglPolygonMode(GL_FRONT_AND_BACK,GL_LINE)\nglBegin({mode})\n{corners}glEnd()"
            ),
            &[],
        )
    };
    let colored = |list: &[(&str, f32, f32)]| -> String {
        list.iter().map(|(color, x, y)| format!("glColor3f({color})\nglVertex2f({x},{y})\n")).collect()
    };
    let (red, green, blue) = ("1,0,0", "0,1,0", "0,0,1");
    let corners = [(red, 2.5, 2.5), (green, 12.5, 2.5), (green, 12.5, 12.5), (blue, 2.5, 12.5)];
    // The last vertex of a quadrilateral, the first of a polygon.
    let quad = outline("GL_QUADS", &colored(&corners));
    assert!(quad.lit().len() >= 36 && quad.lit().into_iter().all(|(x, y)| quad.at(x, y) == BLUE), "{:?}", quad.lit());
    let polygon = outline("GL_POLYGON", &colored(&corners));
    assert!(polygon.lit().len() >= 36 && polygon.lit().into_iter().all(|(x, y)| polygon.at(x, y) == RED));
    // Also of those that are filled beside others that are not.
    for (mode, color) in [("GL_QUADS", BLUE), ("GL_POLYGON", RED)] {
        let filled = shown(
            &format!(
                "{ORTHO}glShadeModel(GL_FLAT)\nglPolygonMode(GL_BACK,GL_LINE)\nglBegin({mode})\n{}glEnd()",
                colored(&corners)
            ),
            &[],
        );
        assert!(filled.lit().len() >= 100 && filled.lit().into_iter().all(|(x, y)| filled.at(x, y) == color), "{mode}");
    }
    // Lit: the colour is that of the last vertex's normal. Straight on it is white of the light, and sideways only ambient light is left.
    let lit = |last: &str| {
        let calls = format!(
            "glEnable(GL_LIGHTING)\nglEnable(GL_LIGHT0)\nglLightModelfv(GL_LIGHT_MODEL_AMBIENT,{{0,0,0,1}})\nglMaterialfv(GL_FRONT,GL_DIFFUSE,{{1,1,1,1}})\n\
             {ORTHO}glShadeModel(GL_FLAT)\nglPolygonMode(GL_FRONT_AND_BACK,GL_LINE)\nglBegin(GL_TRIANGLES)\nglNormal3f(1,0,0)\nglVertex2f(2.5,2.5)\n\
             glVertex2f(12.5,2.5)\nglNormal3f({last})\nglVertex2f(2.5,12.5)\nglEnd()"
        );
        shown(&calls, &[]).at(7, 2)
    };
    assert_eq!((lit("0,0,1"), lit("0,1,0")), ([255; 3], BLACK));
}

#[test]
fn flat_values_of_the_first_vertex_are_refused() {
    let line = "glBegin(GL_LINES)\nglVertex2f(0,0)\nglVertex2f(1,1)\nglEnd()\n";
    let refusal = |calls: &str| recorded(&format!("{calls}{line}"), &[], 0..u64::MAX, &Reading::default()).1.refusal();
    let (first, last) = ("glProvokingVertex(GL_FIRST_VERTEX_CONVENTION)\n", "glProvokingVertex(GL_LAST_VERTEX_CONVENTION)\n");
    let flat = "glShadeModel(GL_FLAT)\n";
    // Without flat values nothing depends on it.
    assert_eq!(refusal(first), None);
    assert_eq!(refusal(&format!("{first}{last}{flat}")), None);
    assert_eq!(refusal(&format!("glPushAttrib(GL_LIGHTING_BIT)\n{first}{flat}glPopAttrib()\n")), None);
    let refused = refusal(&format!("{first}{flat}")).expect("refused");
    assert!(refused.contains("flat values of the first vertex (glProvokingVertex) (1 times"), "{refused}");
    let vertex = "#version 130\nflat out vec4 v; void main() { gl_Position = gl_Vertex; v = gl_Color; }";
    let fragment = "#version 130\nflat in vec4 v; void main() { gl_FragColor = v; }";
    let refused = refusal(&format!("{first}{}", program(10, vertex, fragment))).expect("refused");
    assert!(refused.contains("glProvokingVertex"), "{refused}");
}

#[test]
fn stencil_references_and_masks_differ_between_faces() {
    // Two triangles beside each other: the left one shows its front, the right one its back. Each writes its own reference.
    let faces = "glBegin(GL_TRIANGLES)\nglVertex2f(-1,-1)\nglVertex2f(0,-1)\nglVertex2f(-1,1)\nglVertex2f(0,-1)\nglVertex2f(0,1)\nglVertex2f(1,-1)\nglEnd()\n";
    let draw = |reference: u32| {
        shown(
            &format!(
                "glEnable(GL_STENCIL_TEST)\nglColorMask(0,0,0,0)\nglStencilFuncSeparate(GL_FRONT,GL_ALWAYS,5,255)\n\
                 glStencilFuncSeparate(GL_BACK,GL_ALWAYS,7,255)\nglStencilMaskSeparate(GL_BACK,6)\nglStencilOp(GL_KEEP,GL_KEEP,GL_REPLACE)\n{faces}\
                 glColorMask(1,1,1,1)\nglStencilFunc(GL_EQUAL,{reference},255)\nglStencilOp(GL_KEEP,GL_KEEP,GL_KEEP)\n{QUAD}"
            ),
            &[],
        )
    };
    let (front, back) = (draw(5), draw(6));
    assert!(front.at(1, 2) != BLACK && front.at(9, 2) == BLACK);
    assert!(back.at(1, 2) == BLACK && back.at(9, 2) != BLACK);
    // ATI's function has a comparison of each face and one reference.
    let image = shown(&format!("glEnable(GL_STENCIL_TEST)\nglStencilFuncSeparateATI(GL_ALWAYS,GL_NEVER,3,255)\n{faces}"), &[]);
    assert!(image.at(1, 2) != BLACK && image.at(9, 2) == BLACK);
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
fn elements_of_several_draws_have_indices_of_their_own() {
    let corners: Vec<u8> =
        [0.0_f32, 0.0, 4.0, 0.0, 0.0, 4.0, 8.0, 8.0, 12.0, 8.0, 8.0, 12.0].iter().flat_map(|v| v.to_le_bytes()).collect();
    let image = shown(
        &format!(
            "{ORTHO}glEnableClientState(GL_VERTEX_ARRAY)\nglVertexPointer(2,GL_FLOAT,0,*1)\nglBindBufferARB(34963,1)\nglBufferDataARB(34963,6,*2,35044)\n\
             glMultiDrawElements(GL_TRIANGLES,{{3,3}},GL_UNSIGNED_BYTE,{{0,3}},2)"
        ),
        &[&corners, &[0, 1, 2, 3, 4, 5]],
    );
    assert!(image.at(1, 1) != BLACK && image.at(9, 9) != BLACK && image.at(6, 6) == BLACK);
}

const TEXTURED: &str = "glBegin(GL_QUADS)\nglTexCoord2f(0,0)\nglVertex2f(-1,-1)\nglTexCoord2f(1,0)\nglVertex2f(1,-1)\nglTexCoord2f(1,1)\n\
    glVertex2f(1,1)\nglTexCoord2f(0,1)\nglVertex2f(-1,1)\nglEnd()\n";
const NEAREST: &str =
    "glTexParameteri(3553,10241,9728)\nglTexParameteri(3553,10240,9728)\nglTexEnvi(8960,8704,7681)\nglEnable(3553)\n";

#[test]
fn borders_of_textures_have_any_colour() {
    // A green texel in the middle half; around it is the border. Both wrap modes are GL_CLAMP_TO_BORDER.
    let around =
        "glTexParameteri(3553,10242,33069)\nglTexParameteri(3553,10243,33069)\nglTexParameterfv(3553,4100,{1,0.5,0.25,0.5})\n";
    let wide = TEXTURED.replace("Coord2f(0,0)", "Coord2f(-0.5,-0.5)").replace("Coord2f(1,0)", "Coord2f(1.5,-0.5)");
    let wide = wide.replace("Coord2f(1,1)", "Coord2f(1.5,1.5)").replace("Coord2f(0,1)", "Coord2f(-0.5,1.5)");
    let draw = |filter: &str, internal: u32, format: &str, texel: &[u8]| {
        let calls = format!(
            "{NEAREST}{filter}{around}glPixelStorei(GL_UNPACK_ALIGNMENT,1)\nglTexImage2D(3553,0,{internal},1,1,0,{format},GL_UNSIGNED_BYTE,*1)\n{wide}"
        );
        shown(&calls, &[texel])
    };
    let image = draw("", 6408, "GL_RGBA", &[0, 255, 0, 255]);
    assert_eq!((image.at(8, 8), image.at(5, 10)), (GREEN, GREEN));
    assert!(near(image.at(1, 1), [255, 128, 64]) && near(image.at(14, 8), [255, 128, 64]), "{:?}", image.at(1, 1));
    // Luminance has the border's red.
    let image = draw("", 6409, "GL_LUMINANCE", &[0]);
    assert!(near(image.at(1, 1), [255; 3]) && image.at(8, 8) == BLACK);
    // A linear filter mixes: at the centre of the pixel the coordinates are 1/16 and 9/16, the texel's centre is 1/2: it has 9/16 of 15/16.
    let image =
        draw("glTexParameteri(3553,10241,9729)\nglTexParameteri(3553,10240,9729)\n", 6408, "GL_RGBA", &[0, 255, 0, 255]);
    let mixed = image.at(4, 8);
    assert!(near(mixed, [121, 195, 30]), "{mixed:?}");
}

#[test]
fn automatic_mipmaps_follow_parts_and_copies_and_have_three_dimensions() {
    // A black texture of 16 x 16 whose left half becomes white: at an eighth of its size each texel is a mean.
    let start = "glTexParameteri(3553,10241,9984)\nglTexEnvi(8960,8704,7681)\nglEnable(3553)\nglTexParameteri(3553,33169,1)\n\
        glPixelStorei(GL_UNPACK_ALIGNMENT,1)\nglTexImage2D(3553,0,6407,16,16,0,GL_RGB,GL_UNSIGNED_BYTE,*1)\n";
    let small = "glBegin(GL_QUADS)\nglTexCoord2f(0,0)\nglVertex2f(-1,-1)\nglTexCoord2f(16,0)\nglVertex2f(1,-1)\nglTexCoord2f(16,16)\n\
        glVertex2f(1,1)\nglTexCoord2f(0,16)\nglVertex2f(-1,1)\nglEnd()\n";
    let (black, white) = (vec![0; 768], vec![255; 384]);
    let image =
        shown(&format!("{start}glTexSubImage2D(3553,0,0,0,8,16,GL_RGB,GL_UNSIGNED_BYTE,*2)\n{small}"), &[&black, &white]);
    assert!(near(image.at(7, 7), [128; 3]), "{:?}", image.at(7, 7));
    let image = shown(
        &format!(
            "{start}glClearColor(1,0,0,1)\nglClear(16384)\nglCopyTexSubImage2D(3553,0,0,0,0,0,16,8)\nglClearColor(0,0,0,1)\nglClear(16384)\n{small}"
        ),
        &[&black],
    );
    assert!(near(image.at(7, 7), [128, 0, 0]), "{:?}", image.at(7, 7));
    // One of eight texels is white.
    let mut cube = vec![0; 24];
    cube[21..24].fill(255);
    let image = shown(
        "glTexParameteri(32879,10241,9984)\nglTexEnvi(8960,8704,7681)\nglEnable(32879)\nglTexParameteri(32879,33169,1)\n\
         glPixelStorei(GL_UNPACK_ALIGNMENT,1)\nglTexImage3D(32879,0,6407,2,2,2,0,GL_RGB,GL_UNSIGNED_BYTE,*1)\n\
         glTexParameteri(32879,33084,1)\nglRectf(-1,-1,1,1)",
        &[&cube],
    );
    assert!(near(image.at(7, 7), [32; 3]), "{:?}", image.at(7, 7));
}

#[test]
fn slices_of_three_dimensions_are_copied_from_the_window() {
    let image = shown(
        "glTexParameteri(32879,10241,9728)\nglTexParameteri(32879,10240,9728)\nglTexEnvi(8960,8704,7681)\n\
         glTexImage3D(32879,0,6408,16,16,2,0,GL_RGBA,GL_UNSIGNED_BYTE,U0x0)\nglClearColor(1,0,0,1)\nglClear(16384)\n\
         glEnable(GL_SCISSOR_TEST)\nglScissor(0,0,16,4)\nglClearColor(0,1,0,1)\nglClear(16384)\nglDisable(GL_SCISSOR_TEST)\n\
         glCopyTexSubImage3D(32879,0,0,0,1,0,0,16,16)\nglClearColor(0,0,0,1)\nglClear(16384)\nglEnable(32879)\nglBegin(GL_QUADS)\n\
         glTexCoord3f(0,0,0.75)\nglVertex2f(-1,-1)\nglTexCoord3f(1,0,0.75)\nglVertex2f(1,-1)\nglTexCoord3f(1,1,0.75)\nglVertex2f(1,1)\n\
         glTexCoord3f(0,1,0.75)\nglVertex2f(-1,1)\nglEnd()",
        &[],
    );
    assert_eq!([image.at(3, 1), image.at(3, 12)], [GREEN, RED]);
}

#[test]
fn sprites_begin_above_or_below() {
    // A texture whose lower half is red and whose upper half is green, on a point that covers the window.
    let texels = [[255, 0, 0, 255], [255, 0, 0, 255], [0, 255, 0, 255], [0, 255, 0, 255]].concat();
    let draw = |origin: u32| {
        let calls = format!(
            "{NEAREST}glTexImage2D(3553,0,6408,2,2,0,GL_RGBA,GL_UNSIGNED_BYTE,*1)\nglEnable(34913)\nglTexEnvi(34913,34914,1)\nglPointParameteri(36000,{origin})\n\
             glPointSize(16)\nglBegin(GL_POINTS)\nglVertex2f(0,0)\nglEnd()"
        );
        let image = shown(&calls, &[&texels]);
        [image.at(7, 3), image.at(7, 12)]
    };
    // From the upper left, the second coordinate grows downward.
    assert_eq!((draw(0x8ca2), draw(0x8ca1)), ([GREEN, RED], [RED, GREEN]));
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
    let columns = |image: &super::gl_features::Shown| (0..16).filter(|&x| image.at(x, 5) != BLACK).collect::<Vec<_>>();
    assert_eq!(columns(&draw("")), [7, 15]);
    assert_eq!(columns(&draw("glPixelStorei(GL_UNPACK_LSB_FIRST,1)\n")), [0, 8]);
}

#[test]
fn a_light_is_seen_from_any_distance_whose_square_is_a_number() {
    let lit = |term: &str, distance: &str, attenuation: f32| {
        let calls = format!(
            "glEnable(GL_LIGHTING)\nglEnable(GL_LIGHT0)\nglLightModelfv(GL_LIGHT_MODEL_AMBIENT,{{0,0,0,1}})\n\
             glLightfv(GL_LIGHT0,GL_DIFFUSE,{{0,0,0,1}})\nglLightfv(GL_LIGHT0,{term},{{1,1,1,1}})\n\
             glMaterialfv(GL_FRONT,GL_AMBIENT,{{1,0,0,1}})\nglMaterialfv(GL_FRONT,GL_DIFFUSE,{{0,1,0,1}})\n\
             glLightfv(GL_LIGHT0,GL_POSITION,{{0,0,{distance},1}})\nglLightf(GL_LIGHT0,GL_LINEAR_ATTENUATION,{attenuation})\n\
             glNormal3f(0,0,1)\n{QUAD}"
        );
        shown(&calls, &[]).at(8, 8)
    };
    let diffuse = |distance| lit("GL_DIFFUSE", distance, 0.0);
    assert_eq!((diffuse("1e6"), diffuse("1e15")), (GREEN, GREEN));
    // Farther away it has no direction, and nothing is left of what decreases with the distance.
    assert_eq!(diffuse("1e25"), BLACK);
    let ambient = |distance| lit("GL_AMBIENT", distance, 1e-3);
    assert!(ambient("0.1")[0] >= 254, "{:?}", ambient("0.1"));
    assert_eq!((ambient("1e15"), ambient("1e25")), (BLACK, BLACK));
}

#[test]
fn several_materials_change_within_a_primitive() {
    // Only ambient light of the scene: the colour is the ambient material and the emission. Each change is one of the second triangle's corner.
    let lit = "glLightModelfv(GL_LIGHT_MODEL_AMBIENT,{1,1,1,1})\nglEnable(GL_LIGHTING)\nglMaterialfv(GL_FRONT_AND_BACK,GL_AMBIENT,{1,0,0,1})\n";
    let strip = |changes: &str| {
        let calls = format!(
            "{ORTHO}{lit}glBegin(GL_TRIANGLE_STRIP)\nglVertex2f(0,0)\nglVertex2f(0,16)\n{changes}glVertex2f(16,0)\nglVertex2f(16,16)\nglEnd()\n"
        );
        shown(&calls, &[]).at(8, 8)
    };
    let material = |name: &str, color: &str| format!("glMaterialfv(GL_FRONT_AND_BACK,{name},{{{color}}})\n");
    let between = |left: [f32; 3], right: [f32; 3]| -> [u8; 3] {
        std::array::from_fn(|c| (255.0 * (left[c] + (right[c] - left[c]) * 8.5 / 16.0)).round() as u8)
    };
    let (ambient, emission) = (material("GL_AMBIENT", "0,0,1,1"), material("GL_EMISSION", "0,1,0,1"));
    assert!(near(strip(&ambient), between([1.0, 0.0, 0.0], [0.0, 0.0, 1.0])), "{:?}", strip(&ambient));
    let both = format!("{ambient}{emission}");
    assert!(near(strip(&both), between([1.0, 0.0, 0.0], [0.0, 1.0, 1.0])), "{:?}", strip(&both));
    // The diffuse material was another one than the ambient one.
    let joined = material("GL_AMBIENT_AND_DIFFUSE", "0,0,1,1");
    assert!(near(strip(&joined), between([1.0, 0.0, 0.0], [0.0, 0.0, 1.0])), "{:?}", strip(&joined));
    // As points, each with its own: two changes, one of them of a parameter that had not changed before.
    let points = format!(
        "{ORTHO}{lit}glPointSize(4)\nglBegin(GL_POINTS)\nglVertex2f(2,2)\n{ambient}glVertex2f(8,2)\n{emission}glVertex2f(14,2)\nglEnd()\n"
    );
    let image = shown(&points, &[]);
    assert_eq!([2, 8, 14].map(|x| image.at(x, 2)), [RED, BLUE, [0, 255, 255]]);
    // The backs of two-sided polygons have colours of their own, which one vertex cannot have besides.
    let two = format!(
        "{lit}glLightModeli(GL_LIGHT_MODEL_TWO_SIDE,1)\nglBegin(GL_TRIANGLE_STRIP)\nglVertex2f(0,0)\nglVertex2f(0,1)\n{both}glVertex2f(1,0)\nglEnd()\n"
    );
    let refusal = recorded(&two, &[], 0..u64::MAX, &Reading::default()).1.refusal();
    assert!(refusal.as_ref().is_some_and(|what| what.starts_with("several materials within a primitive")), "{refusal:?}");
}

#[test]
fn each_primitive_of_a_begin_has_the_materials_of_its_vertices() {
    let corner =
        |color: &str, x: i32, y: i32| format!("glMaterialfv(GL_FRONT,GL_EMISSION,{{{color},1}})\nglVertex2f({x},{y})\n");
    let triangle = |x: i32| [corner("1,0,0", x, 0), corner("0,1,0", x + 8, 0), corner("0,0,1", x, 8)].concat();
    let scene = format!("{ORTHO}glEnable(GL_LIGHTING)\nglLightModelfv(GL_LIGHT_MODEL_AMBIENT,{{0,0,0,1}})\n");
    let apart = |x: i32| format!("glBegin(GL_TRIANGLES)\n{}glEnd()\n", triangle(x));
    let one = shown(&format!("{scene}{}{}", apart(0), apart(8)), &[]);
    let both = shown(&format!("{scene}glBegin(GL_TRIANGLES)\n{}{}glEnd()", triangle(0), triangle(8)), &[]);
    assert_eq!((one.at(1, 1), one.at(9, 1)), (both.at(1, 1), both.at(9, 1)));
    assert!(one.0 == both.0);
    // What was drawn before keeps its material.
    let before = shown(
        &format!(
            "{scene}glMaterialfv(GL_FRONT,GL_EMISSION,{{1,1,1,1}})\nglBegin(GL_TRIANGLES)\nglVertex2f(8,8)\nglVertex2f(16,8)\nglVertex2f(8,16)\nglEnd()\n{}",
            apart(0)
        ),
        &[],
    );
    assert_eq!(before.at(9, 9), [255; 3]);
}
