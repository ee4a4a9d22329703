//! Points and lines at the borders of the viewport and of the view volume: each picture is the one that Mesa's llvmpipe draws.

use super::gl_features::{BLACK, shown};

/// The middle quarter of the window, with a unit per pixel.
const PART: &str = "glViewport(4,4,8,8)\nglMatrixMode(GL_PROJECTION)\nglOrtho(0,8,0,8,-1,1)\nglMatrixMode(GL_MODELVIEW)\n";

fn drawn(state: &str, mode: &str, vertices: &[[f32; 2]]) -> Vec<(usize, usize)> {
    let vertices: String = vertices.iter().map(|[x, y]| format!("glVertex2f({x},{y})\n")).collect();
    shown(&format!("{PART}{state}glBegin({mode})\n{vertices}glEnd()\n"), &[]).lit()
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
    for (state, view) in [("", [0, 0]), (PART, [4, 4])] {
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
