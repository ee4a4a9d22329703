//! What the standard leaves open, and what is easily left out: each picture is the one that Mesa's llvmpipe draws.

use super::gl_features::{BLACK, BLUE, GREEN, QUAD, RED, last_of, near, recorded, shown};
use fillrate::trace::Reading;

const ORTHO: &str = "glMatrixMode(GL_PROJECTION)\nglOrtho(0,16,0,16,-1,1)\nglMatrixMode(GL_MODELVIEW)\n";

#[test]
fn parameters_of_textures_are_restored() {
    // Two texels, red and blue: between them a linear filter shows a mixture.
    let texture = "glTexParameteri(GL_TEXTURE_2D,GL_TEXTURE_MIN_FILTER,GL_NEAREST)\nglTexParameteri(GL_TEXTURE_2D,GL_TEXTURE_WRAP_S,GL_CLAMP_TO_EDGE)\n\
        glTexImage2D(GL_TEXTURE_2D,0,GL_RGBA,2,1,0,GL_RGBA,GL_UNSIGNED_BYTE,*1)\nglEnable(GL_TEXTURE_2D)\n";
    let quad = "glBegin(GL_QUADS)\nglTexCoord2f(0,0)\nglVertex2f(-1,-1)\nglTexCoord2f(1,0)\nglVertex2f(1,-1)\nglTexCoord2f(1,1)\nglVertex2f(1,1)\n\
        glTexCoord2f(0,1)\nglVertex2f(-1,1)\nglEnd()\n";
    let texels = [255, 0, 0, 255, 0, 0, 255, 255];
    let of = |before: &str, group: &str| {
        let calls = format!(
            "{before}glPushAttrib({group})\nglTexParameteri(GL_TEXTURE_2D,GL_TEXTURE_MAG_FILTER,GL_NEAREST)\nglPopAttrib()\n{texture}{quad}"
        );
        let image = shown(&calls, &[&texels]);
        [image.at(7, 8), image.at(8, 8)]
    };
    for before in ["", "glBindTexture(GL_TEXTURE_2D,7)\n"] {
        let [left, right] = of(before, "GL_TEXTURE_BIT");
        assert!(left != RED && right != BLUE && left[0] > right[0], "{left:?} {right:?}");
        assert_eq!(of(before, "GL_POLYGON_BIT"), [RED, BLUE]);
    }
}

#[test]
fn alpha_is_compared_in_eight_bits() {
    let drawn = |function: &str, alpha: u8| {
        shown(&format!("glEnable(GL_ALPHA_TEST)\nglAlphaFunc({function},0.5)\nglColor4ub(255,0,0,{alpha})\n{QUAD}"), &[])
            .at(8, 8)
            == RED
    };
    let of = |function: &str| [127, 128, 129].map(|alpha| drawn(function, alpha));
    assert_eq!(of("GL_GREATER"), [false, false, true]);
    assert_eq!(of("GL_GEQUAL"), [false, true, true]);
    assert_eq!(of("GL_EQUAL"), [false, true, false]);
    assert_eq!(of("GL_NOTEQUAL"), [true, false, true]);
    assert_eq!(of("GL_LEQUAL"), [true, true, false]);
    assert_eq!(of("GL_LESS"), [true, false, false]);
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
fn halves_of_raster_positions_are_rounded_up() {
    let pixel = [0, 255, 0, 255];
    for (at, expected) in [("2.5,3.5", (3, 4)), ("3.4,4.6", (3, 5))] {
        let image = shown(&format!("{ORTHO}glRasterPos2f({at})\nglDrawPixels(1,1,GL_RGBA,GL_UNSIGNED_BYTE,*1)\n"), &[&pixel]);
        assert_eq!(image.lit(), [expected]);
        assert_eq!(image.at(expected.0, expected.1), GREEN);
    }
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
fn colours_of_few_bits_are_rounded_when_given_and_cut_when_drawn() {
    let texture = |format: &str, pixels: &str| {
        format!(
            "glBindTexture(GL_TEXTURE_2D,1)\nglTexParameteri(GL_TEXTURE_2D,GL_TEXTURE_MIN_FILTER,GL_NEAREST)\n\
             glTexParameteri(GL_TEXTURE_2D,GL_TEXTURE_MAG_FILTER,GL_NEAREST)\nglTexEnvi(GL_TEXTURE_ENV,GL_TEXTURE_ENV_MODE,GL_REPLACE)\n\
             glTexImage2D(GL_TEXTURE_2D,0,{format},1,1,0,GL_RGBA,GL_UNSIGNED_BYTE,{pixels})\n"
        )
    };
    let read = "glEnable(GL_TEXTURE_2D)\n";
    let given = |format: &str| shown(&format!("{}{read}{QUAD}", texture(format, "*1")), &[&[10, 100, 203, 100]]).at(8, 8);
    assert_eq!(given("GL_RGBA8"), [10, 100, 203]);
    // 12 of 31 repeats its bits as 99, 6 of 15 is 102.
    assert_eq!([given("GL_RGB5_A1"), given("GL_RGB5")], [[8, 99, 206]; 2]);
    assert_eq!([given("GL_RGBA4"), given("GL_RGB4")], [[17, 102, 204]; 2]);
    assert_eq!(given("GL_R3_G3_B2"), [0, 109, 170]);
    let object = "glBindFramebufferEXT(GL_FRAMEBUFFER_EXT,2)\n\
        glFramebufferTexture2DEXT(GL_FRAMEBUFFER_EXT,GL_COLOR_ATTACHMENT0_EXT,GL_TEXTURE_2D,1,0)\n";
    let window = "glBindFramebufferEXT(GL_FRAMEBUFFER_EXT,0)\n";
    let drawn = |format: &str, draw: &str| {
        let calls = format!("{}{object}{draw}{window}{read}{QUAD}", texture(format, "U0x0"));
        shown(&calls, &[]).at(8, 8)
    };
    let (color, clear) =
        (format!("glColor4ub(15,100,207,255)\n{QUAD}\n"), "glClearColor(0.3,0.45,0.71,1)\nglClear(GL_COLOR_BUFFER_BIT)\n");
    assert_eq!([drawn("GL_RGB5", &color), drawn("GL_RGBA4", &color)], [[8, 99, 206], [17, 102, 204]]);
    assert_eq!([drawn("GL_RGB5", clear), drawn("GL_RGBA4", clear)], [[74, 115, 181], [85, 119, 187]]);
    // The copy of a window.
    let copied = format!("{color}{}glCopyTexSubImage2D(GL_TEXTURE_2D,0,0,0,0,0,1,1)\n{read}{QUAD}", texture("GL_RGB5", "U0x0"));
    assert_eq!(shown(&copied, &[]).at(8, 8), [8, 99, 206]);
    // What is blended keeps all bits, which is said.
    let blended = format!("{}{object}glEnable(GL_BLEND)\nglBlendFunc(GL_ONE,GL_ONE)\n{color}", texture("GL_RGB5", "U0x0"));
    let (trace, report) = recorded(&blended, &[], 0..u64::MAX, &Reading::default());
    assert!(report.refusal().is_some_and(|what| what.starts_with("blending into colours of fewer")), "{:?}", report.refusal());
    assert_eq!(last_of(&trace).lit(), []);
}
