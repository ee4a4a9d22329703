//! Points, lines and polygons. What the standard leaves open is as in Mesa's llvmpipe.

use fillrate::trace::Reading;

use super::gl_scenes::{BLACK, BLUE, GREEN, NEAREST, ORTHO, QUAD, RED, near, program, recorded, shown};

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
fn smooth_points_are_discs() {
    let ortho = "glMatrixMode(GL_PROJECTION)\nglOrtho(0,16,0,16,-1,1)\nglMatrixMode(GL_MODELVIEW)\nglEnable(GL_POINT_SMOOTH)\n";
    let lit =
        |size: &str| shown(&format!("{ortho}glPointSize({size})\nglBegin(GL_POINTS)\nglVertex2f(8,8)\nglEnd()"), &[]).lit();
    // The corners of the square of 4 x 4 are farther away than 2.
    let disc: Vec<(usize, usize)> = (6..10).flat_map(|y| (6..10).map(move |x| (x, y))).collect();
    let corner = |&(x, y): &(usize, usize)| matches!(x, 6 | 9) && matches!(y, 6 | 9);
    assert_eq!(lit("4"), disc.into_iter().filter(|at| !corner(at)).collect::<Vec<_>>());
    // Small ones have a radius of 1.
    assert_eq!(lit("0.5"), [(7, 7), (8, 7), (7, 8), (8, 8)]);
}

#[test]
fn a_viewport_far_away_shows_nothing_and_is_no_error() {
    assert_eq!(shown(&format!("glViewport(4,-2147483400,7,255)\n{QUAD}"), &[]).lit(), []);
}

#[test]
fn wide_lines_of_a_program_are_those_of_the_fixed_functions() {
    // A matrix by which depths follow x: the line leaves through the near plane.
    let matrix = "glMultMatrixf({1,0,2,0,0,1,0,0,0,0,1,0,0,0,0,1})\n";
    let line = "glLineWidth(4)\nglBegin(GL_LINES)\nglColor3f(1,0,0)\nglVertex3f(-1,-0.5,0)\nglColor3f(0,1,0)\nglVertex3f(0.5,0.5,0)\nglEnd()\n";
    let builtin = "void main() { gl_Position = gl_ModelViewProjectionMatrix * gl_Vertex; gl_FrontColor = gl_Color; }";
    let own = "varying vec4 v; void main() { gl_Position = gl_ModelViewProjectionMatrix * gl_Vertex; v = gl_Color; }";
    let (plain, from_own) = ("void main() { gl_FragColor = gl_Color; }", "varying vec4 v; void main() { gl_FragColor = v; }");
    let smooth = "glEnable(GL_LINE_SMOOTH)\nglEnable(GL_BLEND)\nglBlendFunc(GL_SRC_ALPHA,GL_ONE_MINUS_SRC_ALPHA)\n";
    let part = "glViewport(4,4,9,9)\n";
    for state in ["", matrix, smooth, &format!("{matrix}{smooth}"), "glShadeModel(GL_FLAT)\n", part] {
        let fixed = shown(&format!("{state}{line}"), &[]);
        assert!(fixed.lit().len() > 20 && fixed.lit().len() < 100, "{state}: {}", fixed.lit().len());
        for (vertex, fragment) in [(builtin, plain), (own, from_own)] {
            if state.contains("FLAT") && vertex == own {
                continue; // Only OpenGL's own colours are flat.
            }
            let seen = shown(&format!("{}{state}{line}", program(10, vertex, fragment)), &[]);
            assert!(fixed.0.iter().zip(&seen.0).all(|(&a, &b)| near(a, b)), "{state} {vertex}");
        }
    }
    // What would be computed from another vertex is refused.
    let global = "vec4 sum = vec4(0.0); void main() { sum += gl_Vertex; gl_Position = sum; }";
    let calls = format!("{}{line}", program(10, global, plain));
    let (_, report) = recorded(&calls, &[], 0..u64::MAX, &Reading::default());
    assert!(report.refusal().is_some_and(|what| what.contains("wide lines")), "{:?}", report.refusal());
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

/// The middle quarter of the window, with a unit per pixel.
const PART_OF_WINDOW: &str =
    "glViewport(4,4,8,8)\nglMatrixMode(GL_PROJECTION)\nglOrtho(0,8,0,8,-1,1)\nglMatrixMode(GL_MODELVIEW)\n";

fn drawn(state: &str, mode: &str, vertices: &[[f32; 2]]) -> Vec<(usize, usize)> {
    let vertices: String = vertices.iter().map(|[x, y]| format!("glVertex2f({x},{y})\n")).collect();
    shown(&format!("{PART_OF_WINDOW}{state}glBegin({mode})\n{vertices}glEnd()\n"), &[]).lit()
}

/// The pixels of a rectangle, row by row.
fn rectangle(x: std::ops::Range<usize>, y: std::ops::Range<usize>) -> Vec<(usize, usize)> {
    y.flat_map(|y| x.clone().map(move |x| (x, y))).collect()
}

#[test]
fn points_and_lines_reach_out_of_the_viewport() {
    let points = |size: u32, at: [f32; 2]| drawn(&format!("glPointSize({size})\n"), "GL_POINTS", &[at]);
    assert_eq!(points(5, [0.0, 0.0]), rectangle(2..7, 2..7));
    assert_eq!(points(4, [8.0, 3.0]), rectangle(10..14, 5..9));
    assert_eq!(points(1, [8.0, 8.0]), [(12, 12)]);
    // Their middles decide whether they are drawn.
    assert_eq!(points(5, [-0.1, 4.0]), []);
    // A wide line along the lower edge keeps both halves.
    let wide = drawn("glLineWidth(4)\n", "GL_LINES", &[[0.0, 0.0], [8.0, 0.0]]);
    assert_eq!(wide, rectangle(4..12, 2..6));
    // The pixels of a frame are those to the left of its edges and below them.
    let frame = drawn("", "GL_LINE_LOOP", &[[0.0, 0.0], [8.0, 0.0], [8.0, 8.0], [0.0, 8.0]]);
    let mut wanted: Vec<_> = (4..12).flat_map(|k| [(k, 3), (k, 11), (3, k), (11, k)]).collect();
    wanted.sort_by_key(|&(x, y)| (y, x));
    wanted.dedup();
    assert_eq!(frame, wanted);
    // The scissor cuts.
    let scissored = drawn("glEnable(GL_SCISSOR_TEST)\nglScissor(3,3,2,9)\nglPointSize(5)\n", "GL_POINTS", &[[0.0, 0.0]]);
    assert_eq!(scissored, rectangle(3..5, 3..7));
}

#[test]
fn wide_lines_end_where_their_middle_leaves_the_view_volume() {
    // Upward at the left edge, through it at a height of 4: above that nothing is drawn, though half of the width would still be inside.
    for (state, view) in [("", [0, 0]), (PART_OF_WINDOW, [4, 4])] {
        let line = "glLineWidth(4)\nglBegin(GL_LINES)\nglVertex2f(0.25,0)\nglVertex2f(-0.25,1)\nglEnd()\n";
        let unit = "glLoadIdentity()\nglMatrixMode(GL_PROJECTION)\nglLoadIdentity()\nglOrtho(0,1,0,1,-1,1)\n";
        let rows: Vec<usize> = shown(&format!("{state}{unit}{line}"), &[]).lit().iter().map(|&(_, y)| y).collect();
        let (height, size) = (view[1], if view[1] == 0 { 16 } else { 8 });
        assert_eq!((rows.iter().min(), rows.iter().max()), (Some(&height), Some(&(height + size / 2 - 1))), "{state}");
    }
}

#[test]
fn what_a_clipped_line_shows_lies_between_the_colours_of_its_ends() {
    // Lit fully at the left end, not at all at the right one, each half a window beyond its edge.
    let light = "glLightfv(GL_LIGHT0,GL_POSITION,{0,0,1,0})\nglEnable(GL_LIGHTING)\nglEnable(GL_LIGHT0)\nglMaterialfv(GL_FRONT,GL_AMBIENT,{0,0,0,1})\n\
        glLightModelfv(GL_LIGHT_MODEL_AMBIENT,{0,0,0,1})\nglMaterialfv(GL_FRONT,GL_DIFFUSE,{1,1,1,1})\n";
    let line = "glBegin(GL_LINES)\nglNormal3f(0,0,1)\nglVertex2f(-2,0)\nglNormal3f(0,0,-1)\nglVertex2f(2,0)\nglEnd()\n";
    for width in ["", "glLineWidth(4)\n", "glEnable(GL_LINE_SMOOTH)\n"] {
        let image = shown(&format!("{light}{width}{line}"), &[]);
        let row = (0..16).find(|&y| image.at(8, y) != BLACK).expect("a line");
        for x in 1..15 {
            let level = 255.0 * (0.75 - (x as f32 + 0.5) / 32.0);
            // The soft ends of smooth lines lie half a pixel beyond the ends, with the colours of these.
            let off = image.at(x, row).map(|value| (f32::from(value) - level).abs());
            assert!(off.iter().all(|&off| off < 4.0), "{width}{x}: {:?}, {level}", image.at(x, row));
        }
    }
}

#[test]
fn sizes_of_points_that_differ_are_whole() {
    // The size is divided by the root of 0.25.
    let lit = |size: f32| {
        let attenuation = "glPointParameterfv(GL_POINT_DISTANCE_ATTENUATION,{0.25,0,0})\n";
        shown(&format!("{ORTHO}{attenuation}glPointSize({size})\nglBegin(GL_POINTS)\nglVertex2f(8.1,8.1)\nglEnd()\n"), &[])
            .lit()
            .len()
    };
    assert_eq!([1.2, 1.3, 1.7, 1.8].map(lit), [4, 9, 9, 16]);
}

#[test]
fn points_at_the_same_distance_of_two_columns_have_the_right_one() {
    let sprites = "glEnable(GL_POINT_SPRITE)\n";
    for size in 1..=4_usize {
        for at in [7.75_f32, 8.0, 8.25, 8.5, 8.75] {
            let point = format!("glPointSize({size})\nglBegin(GL_POINTS)\nglVertex2f({at},{at})\nglEnd()\n");
            let lit = shown(&format!("{ORTHO}{point}"), &[]).lit();
            // OpenGL 1.5, section 3.3: the first pixel, from the centre that the size gives.
            let first = if size % 2 == 1 { at.floor() as usize - size / 2 } else { (at + 0.5).floor() as usize - size / 2 };
            let wanted: Vec<_> = (0..size * size).map(|k| (first + k % size, first + k / size)).collect();
            assert_eq!(lit, wanted, "size {size} at {at}");
            // Sprites are squares around their place: ties are those of triangles.
            let sprite = shown(&format!("{ORTHO}{sprites}{point}"), &[]).lit();
            assert_eq!(sprite.len(), size * size, "size {size} at {at}");
        }
    }
}

#[test]
fn sizes_of_points_fall_with_the_distance_from_the_plane_of_the_eye() {
    // The size is divided by the distance, whatever lies beside the axis.
    let lit = |x: f32, z: f32| {
        let attenuation = "glPointParameterfv(GL_POINT_DISTANCE_ATTENUATION,{0,0,1})\nglPointSize(2)\n";
        shown(&format!("{ORTHO}{attenuation}glBegin(GL_POINTS)\nglVertex3f({x},8.1,{z})\nglEnd()\n"), &[]).lit().len()
    };
    for x in [4.6, 8.1, 11.1] {
        assert_eq!([-0.25, -0.5, 0.5, 1.0].map(|z| lit(x, z)), [64, 16, 16, 4], "at {x}");
    }
}

#[test]
fn inner_parts_of_smooth_points_are_less_transparent() {
    let image = shown(
        &format!(
            "{ORTHO}glEnable(GL_POINT_SMOOTH)\nglEnable(GL_BLEND)\nglBlendFunc(GL_SRC_ALPHA,GL_ZERO)\nglPointSize(8)\nglColor4f(1,0,0,0.25)\n\
             glBegin(GL_POINTS)\nglVertex2f(8,8)\nglEnd()\n"
        ),
        &[],
    );
    // At 0.5 and 0.5 from the centre: (1 - 0.5 / 16) / (1 - 9 / 16) of the alpha. At the rim the alpha itself, and nothing outside.
    let at = |x: usize| image.at(x, 8)[0];
    assert!(near([at(8), 0, 0], [141, 0, 0]) && near([at(11), 0, 0], [64, 0, 0]), "{} {}", at(8), at(11));
    assert_eq!((image.at(12, 8), image.at(11, 11)), (BLACK, BLACK));
}

#[test]
fn rectangles_have_the_diagonals_of_mesa() {
    let corner = |color: &str, at: &str| format!("glColor3f({color})\nglVertex3f({at},-2)\n");
    let corners = [corner("1,0,0", "-2,-2"), corner("0,1,0", "2,-2"), corner("0,0,1", "2,2"), corner("1,1,0", "-2,2")].concat();
    let frustum = "glMatrixMode(GL_PROJECTION)\nglFrustum(-1,1,-1,1,1,10)\nglMatrixMode(GL_MODELVIEW)\n";
    let middle = |calls: &str| shown(&format!("{frustum}{calls}"), &[]).at(8, 8);
    let quads = format!("glBegin(GL_QUADS)\n{corners}glEnd()\n");
    // From the first to the third corner, between red and blue; from the second to the fourth, between green and yellow.
    let (first, second) = ([128, 0, 128], [128, 255, 0]);
    let like = |color: [u8; 3], wanted: [u8; 3]| (0..3).all(|k| color[k].abs_diff(wanted[k]) < 24);
    let of = |calls: &str| middle(&format!("{calls}{quads}"));
    assert!(like(of(""), first), "in perspective, too: {:?}", of(""));
    let pattern = format!("glEnable(GL_POLYGON_STIPPLE)\nglPolygonStipple(*1)\n{quads}");
    let stippled = shown(&format!("{frustum}{pattern}"), &[&[255; 128]]).at(8, 8);
    assert!(like(stippled, second), "with a pattern: {stippled:?}");
    assert!(like(of("glRotatef(1,0,1,0)\n"), second), "one that does not face the screen");
    let floats = |values: &[f32]| values.iter().flat_map(|value| value.to_le_bytes()).collect::<Vec<u8>>();
    let arrays = [
        floats(&[-2.0, -2.0, -2.0, 2.0, -2.0, -2.0, 2.0, 2.0, -2.0, -2.0, 2.0, -2.0]),
        floats(&[1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 1.0, 1.0, 0.0]),
        vec![0, 1, 2, 3],
    ];
    let enabled = "glEnableClientState(GL_VERTEX_ARRAY)\nglVertexPointer(3,GL_FLOAT,0,*1)\nglEnableClientState(GL_COLOR_ARRAY)\nglColorPointer(3,GL_FLOAT,0,*2)\n";
    let drawn = |call: &str| shown(&format!("{frustum}{enabled}{call}\n"), &[&arrays[0], &arrays[1], &arrays[2]]).at(8, 8);
    assert!(like(drawn("glDrawArrays(GL_QUADS,0,4)"), first));
    assert!(like(drawn("glDrawElements(GL_QUADS,4,GL_UNSIGNED_BYTE,*3)"), second));
}

#[test]
fn edges_along_a_clip_plane_belong_to_an_outline() {
    let outline = |mode: &str| {
        shown(
            &format!(
                "{ORTHO}glClipPlane(GL_CLIP_PLANE0,{{1,0,0,-8.25}})\nglEnable(GL_CLIP_PLANE0)\nglPolygonMode(GL_FRONT_AND_BACK,{mode})\n\
                 glBegin(GL_QUADS)\nglVertex2f(2.5,3.5)\nglVertex2f(12.5,3.5)\nglVertex2f(12.5,11.5)\nglVertex2f(2.5,11.5)\nglEnd()\n"
            ),
            &[],
        )
    };
    let lines = outline("GL_LINE");
    assert!((4..11).all(|y| lines.at(8, y) != BLACK && lines.at(12, y) != BLACK), "{:?}", lines.lit());
    assert!((9..12).all(|x| lines.at(x, 3) != BLACK && lines.at(x, 11) != BLACK), "{:?}", lines.lit());
    assert!(
        lines.lit().into_iter().all(|(x, y)| x > 7 && !((9..=11).contains(&x) && (4..=10).contains(&y))),
        "{:?}",
        lines.lit()
    );
    // The plane also cuts the diagonal, which has no corner of its own otherwise.
    assert_eq!(outline("GL_POINT").lit(), [(8, 3), (12, 3), (8, 6), (8, 11), (12, 11)]);
}

#[test]
fn ties_in_a_window_follow_the_rows_from_below() {
    // All edges pass through centres of pixels: those of the left and lower edges belong to the rectangle.
    let rectangle = shown(&format!("{ORTHO}glRectf(2.5,3.5,6.5,5.5)"), &[]).lit();
    assert_eq!(rectangle, [2, 3, 4, 5].map(|x| (x, 3)).into_iter().chain([2, 3, 4, 5].map(|x| (x, 4))).collect::<Vec<_>>());
    // A line between two rows belongs to the lower one.
    let line = shown(&format!("{ORTHO}glBegin(GL_LINES)\nglVertex2f(2.5,4)\nglVertex2f(5.5,4)\nglEnd()"), &[]).lit();
    assert_eq!(line, [(2, 3), (3, 3), (4, 3)]);
}

#[test]
fn ends_of_wide_lines_follow_the_diamonds_of_pixels() {
    let columns = |from: f32, to: f32| {
        let line = format!("{ORTHO}glLineWidth(3)\nglBegin(GL_LINES)\nglVertex2f({from},8.5)\nglVertex2f({to},8.5)\nglEnd()");
        let image = shown(&line, &[]);
        (0..16).filter(|&x| (7..10).all(|y| image.at(x, y) != BLACK)).collect::<Vec<usize>>()
    };
    // Beyond the middle of a pixel a line is still in its diamond: it leaves that of its first pixel, and not that of its last.
    assert_eq!([columns(3.7, 6.7), columns(6.7, 3.7)], [vec![3, 4, 5], vec![4, 5, 6]]);
    assert_eq!([columns(3.2, 6.2), columns(6.2, 3.2)], [vec![3, 4, 5], vec![4, 5, 6]]);
    // From middle to middle: the first pixel is drawn, the last is not.
    assert_eq!([columns(3.5, 6.5), columns(6.5, 3.5)], [vec![3, 4, 5], vec![4, 5, 6]]);
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
