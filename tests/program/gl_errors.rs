//! Calls that are errors, and rare arguments: each has the effect that it has in Mesa, or none, and the recording goes on.

use fillrate::trace::Reading;

use super::gl_scenes::{GREEN, NEAREST, ORTHO, QUAD, RED, last_of, recorded, shown, tolerated};

#[test]
fn an_error_of_a_draw_leaves_the_call_behind_it() {
    // The draw is made when the next call needs it. It has no image to draw to; that call selects the window again.
    let calls =
        format!("glBindFramebuffer(GL_FRAMEBUFFER,1)\n{QUAD}\nglBindFramebuffer(GL_FRAMEBUFFER,0)\nglColor3f(1,0,0)\n{QUAD}");
    let (trace, report) = recorded(&calls, &[], 0..u64::MAX, &Reading::default());
    assert_eq!(last_of(&trace).at(8, 8), RED);
    let errors: Vec<&str> = report.errors.iter().map(|(name, _)| name).collect();
    assert_eq!(errors, ["a draw: GL_INVALID_FRAMEBUFFER_OPERATION"]);
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
