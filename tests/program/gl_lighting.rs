//! Lights, materials, colour material and fog.

use fillrate::trace::Reading;

use super::gl_scenes::{BLACK, BLUE, GREEN, ORTHO, QUAD, RED, near, recorded, refused, shown, with_errors};

const WHITE: [u8; 3] = [255; 3];

#[test]
fn a_material_that_waits_stays_beside_colour_material_until_the_colour_changes() {
    // Only the ambient light of the scene, so that the ambient material is the colour.
    let lit = "glLightModelfv(GL_LIGHT_MODEL_AMBIENT,{1,1,1,1})\nglEnable(GL_LIGHTING)\n\
               glColorMaterial(GL_FRONT_AND_BACK,GL_AMBIENT)\n";
    let of = |calls: &str| shown(&format!("{lit}{calls}\n{QUAD}"), &[]).at(8, 8);
    let (given, on) = ("glMaterialfv(GL_FRONT_AND_BACK,GL_AMBIENT,{1,0,0,1})\n", "glEnable(GL_COLOR_MATERIAL)\n");
    assert_eq!(of(&format!("{given}{on}")), RED);
    assert_eq!(of(&format!("{given}{on}glColor3f(0,1,0)")), GREEN);
    // While colour material tracks it, it is not set.
    let other = "glMaterialfv(GL_FRONT_AND_BACK,GL_AMBIENT,{0,0,1,1})\n";
    assert_eq!([of(&format!("{given}{on}{other}")), of(&format!("{on}{other}"))], [RED, WHITE]);
    // A primitive between them has taken the material.
    let point = "glBegin(GL_POINTS)\nglVertex2f(0,0)\nglEnd()\n";
    assert_eq!(of(&format!("{given}{point}{on}")), WHITE);
    // What is kept stays when colour material is switched off.
    assert_eq!(of(&format!("{given}{on}{point}glDisable(GL_COLOR_MATERIAL)\nglColor3f(0,1,0)")), RED);
}

#[test]
fn fog_has_three_distances() {
    // The vertices are 3 from the plane of the eye, and 5 from the eye. Fog is 0 at 0 and whole at 10.
    let draw = |calls: &str| {
        let fog = "glEnable(GL_FOG)\nglFogi(GL_FOG_MODE,GL_LINEAR)\nglFogf(GL_FOG_START,0)\nglFogf(GL_FOG_END,10)\nglFogfv(GL_FOG_COLOR,{1,1,1,1})\n";
        shown(
            &format!(
                "glMatrixMode(GL_PROJECTION)\nglOrtho(3.9,4.1,-0.1,0.1,-9,9)\nglMatrixMode(GL_MODELVIEW)\n{fog}{calls}\nglColor3f(0,0,0)\nglBegin(GL_QUADS)\n\
                 glVertex3f(3.9,-1,-3)\nglVertex3f(4.1,-1,-3)\nglVertex3f(4.1,1,-3)\nglVertex3f(3.9,1,-3)\nglEnd()"
            ),
            &[],
        )
        .at(8, 8)
    };
    let like = |color: [u8; 3], wanted: f32| (f32::from(color[0]) - 255.0 * wanted).abs() <= 8.0;
    assert!(like(draw(""), 0.3) && like(draw("glFogi(34138,34140)"), 0.3));
    assert!(like(draw("glFogi(34138,34139)"), 0.5), "{:?}", draw("glFogi(34138,34139)"));
    let restored = draw("glPushAttrib(GL_FOG_BIT)\nglFogi(34138,34139)\nglPopAttrib()");
    assert!(like(restored, 0.3), "a part of the state of fog: {restored:?}");
    assert_eq!(draw("glFogi(34138,9474)"), BLACK, "with sign, what is seen is at negative distances");
    let errors = with_errors("glFogi(34138,7)\nglFogi(GL_FOG_COORD_SRC,7)\nglFogi(7,7)", &[]).1;
    assert_eq!(errors, 3);
    let pixels = "glEnable(GL_FOG)\nglFogi(34138,34139)\nglRasterPos2f(0,0)\nglDrawPixels(1,1,GL_RGBA,GL_UNSIGNED_BYTE,*1)";
    assert!(refused(pixels, &[&[0; 4]]).starts_with("pixel rectangles with a mode of the fog's distance"));
}

#[test]
fn secondary_colours_of_fixed_functions_are_opaque() {
    let text = "!!ARBfp1.0\nMOV result.color, fragment.color.secondary.w;\nEND";
    let drawn = |state: &str| {
        let program = format!(
            "glEnable(GL_FRAGMENT_PROGRAM_ARB)\nglProgramStringARB(GL_FRAGMENT_PROGRAM_ARB,GL_PROGRAM_FORMAT_ASCII_ARB,{},\"{text}\")\n",
            text.len()
        );
        shown(&format!("{state}{program}{QUAD}"), &[]).at(8, 8)
    };
    let separate = "glEnable(GL_LIGHTING)\nglLightModeli(GL_LIGHT_MODEL_COLOR_CONTROL,GL_SEPARATE_SPECULAR_COLOR)\n";
    let seen = ["", "glEnable(GL_COLOR_SUM)\n", separate, "glEnable(GL_LIGHTING)\n"].map(drawn);
    assert_eq!(seen, [[255; 3], [255; 3], [255; 3], [0; 3]]);
}

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
