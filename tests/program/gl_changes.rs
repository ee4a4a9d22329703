//! Changes of the state between draws, of which some end a batch: the draws do not show which.

use fillrate::trace::TraceError;
use fillrate::trace::command::Command;

use super::gl_scenes::imported;

/// A scene with most of what shaders depend on: two textures, light, fog, tests, blending. The batch ends with each line of a list.
const SCENE: &str = "glMatrixMode(GL_PROJECTION)\nglOrtho(0,16,0,16,-8,8)\nglMatrixMode(GL_MODELVIEW)\n\
    glBindTexture(GL_TEXTURE_2D,1)\nglTexParameteri(GL_TEXTURE_2D,GL_TEXTURE_MIN_FILTER,GL_NEAREST)\n\
    glTexImage2D(GL_TEXTURE_2D,0,GL_RGBA,2,1,0,GL_RGBA,GL_UNSIGNED_BYTE,*1)\nglBindTexture(GL_TEXTURE_2D,2)\n\
    glTexParameteri(GL_TEXTURE_2D,GL_TEXTURE_MIN_FILTER,GL_NEAREST)\n\
    glTexImage2D(GL_TEXTURE_2D,0,GL_ALPHA,2,1,0,GL_ALPHA,GL_UNSIGNED_BYTE,*1)\nglBindTexture(GL_TEXTURE_2D,1)\nglEnable(GL_TEXTURE_2D)\n\
    glEnable(GL_LIGHTING)\nglEnable(GL_LIGHT0)\nglEnable(GL_FOG)\nglEnable(GL_DEPTH_TEST)\nglEnable(GL_CULL_FACE)\n";

/// A primitive that is drawn at once.
const DRAW: &str = "glBegin(GL_QUADS)\nglTexCoord2f(0,0)\nglVertex2f(1,1)\nglTexCoord2f(1,0)\nglVertex2f(5,1)\nglTexCoord2f(1,1)\nglVertex2f(5,5)\n\
    glTexCoord2f(0,1)\nglVertex2f(1,5)\nglEnd()\nglTranslatef(0.5,0,0)\n";

/// Changes between two draws. Most of them end the batch.
const CHANGES: &[&str] = &[
    "glRotatef(30,0,0,1)",
    "glPushMatrix()\nglScalef(2,2,2)",
    "glMatrixMode(GL_TEXTURE)\nglScalef(2,2,2)\nglMatrixMode(GL_MODELVIEW)",
    "glMatrixMode(GL_TEXTURE)\nglFrustum(-1,1,-1,1,1,9)\nglMatrixMode(GL_MODELVIEW)",
    "glFrustum(-1,1,-1,1,1,9)",
    "glColor4f(1,0,0,0.5)",
    "glColor4f(1,0,0,0.5)\nglEnable(GL_COLOR_MATERIAL)",
    "glEnable(GL_COLOR_MATERIAL)\nglMaterialfv(GL_FRONT,GL_DIFFUSE,{1,0,0,1})",
    "glMaterialfv(GL_FRONT,GL_DIFFUSE,{1,0,0,1})",
    "glMaterialfv(GL_FRONT,GL_DIFFUSE,{1,0,0,1})\nglEnable(GL_COLOR_MATERIAL)\nglBegin(GL_TRIANGLES)\nglEnd()\nglCallList(9)\nglCallList(9)\n\
     glColor3f(0,1,0)",
    "glMaterialfv(GL_FRONT,GL_SPECULAR,{1,0,0,1})",
    "glMaterialfv(GL_BACK,GL_SPECULAR,{1,0,0,1})",
    "glMaterialf(GL_FRONT,GL_SHININESS,20)",
    "glLightfv(GL_LIGHT0,GL_POSITION,{1,1,1,0})",
    "glLightfv(GL_LIGHT0,GL_POSITION,{1,1,1,1})",
    "glLightf(GL_LIGHT0,GL_SPOT_CUTOFF,40)",
    "glLightModeli(GL_LIGHT_MODEL_TWO_SIDE,1)",
    "glLightModelfv(GL_LIGHT_MODEL_AMBIENT,{1,0,0,1})",
    "glEnable(GL_LIGHT1)",
    "glEnable(GL_LIGHT0)",
    "glDisable(GL_LIGHTING)",
    "glNormal3f(0,1,0)",
    "glEnable(GL_NORMALIZE)",
    "glShadeModel(GL_FLAT)",
    "glShadeModel(GL_SMOOTH)",
    "glFrontFace(GL_CW)",
    "glFrontFace(GL_CCW)",
    "glCullFace(GL_FRONT)",
    "glCullFace(GL_FRONT_AND_BACK)",
    "glPolygonMode(GL_FRONT_AND_BACK,GL_LINE)",
    "glPolygonMode(GL_FRONT_AND_BACK,GL_FILL)",
    "glEnable(GL_POLYGON_OFFSET_FILL)\nglPolygonOffset(1,2)",
    "glDepthFunc(GL_ALWAYS)",
    "glDepthFunc(GL_LESS)",
    "glDepthMask(0)",
    "glDepthMask(1)",
    "glDepthRange(0.25,0.5)",
    "glEnable(GL_ALPHA_TEST)\nglAlphaFunc(GL_GREATER,0.5)",
    "glAlphaFunc(GL_ALWAYS,0)",
    "glEnable(GL_BLEND)\nglBlendFunc(GL_SRC_ALPHA,GL_ONE)",
    "glBlendFunc(GL_ONE,GL_ZERO)",
    "glEnable(GL_COLOR_LOGIC_OP)\nglLogicOp(GL_XOR)",
    "glColorMask(1,0,1,0)",
    "glEnable(GL_STENCIL_TEST)\nglStencilFunc(GL_ALWAYS,7,255)\nglStencilOp(GL_KEEP,GL_KEEP,GL_REPLACE)",
    "glEnable(GL_SCISSOR_TEST)\nglScissor(2,2,4,4)",
    "glViewport(2,2,8,8)",
    "glFogi(GL_FOG_MODE,GL_LINEAR)",
    "glFogfv(GL_FOG_COLOR,{1,0,0,1})",
    "glBindTexture(GL_TEXTURE_2D,2)",
    "glBindTexture(GL_TEXTURE_2D,1)",
    "glBindTexture(GL_TEXTURE_2D,3)",
    "glDeleteTextures(1,{1})",
    "glTexParameteri(GL_TEXTURE_2D,GL_TEXTURE_MAG_FILTER,GL_NEAREST)",
    "glTexSubImage2D(GL_TEXTURE_2D,0,0,0,1,1,GL_RGBA,GL_UNSIGNED_BYTE,*1)",
    "glTexEnvi(GL_TEXTURE_ENV,GL_TEXTURE_ENV_MODE,GL_REPLACE)",
    "glTexEnvfv(GL_TEXTURE_ENV,GL_TEXTURE_ENV_COLOR,{1,0,0,1})",
    "glActiveTexture(GL_TEXTURE1)",
    "glActiveTexture(GL_TEXTURE1)\nglBindTexture(GL_TEXTURE_2D,2)\nglEnable(GL_TEXTURE_2D)\nglMultiTexCoord2f(GL_TEXTURE1,1,1)",
    "glEnable(GL_TEXTURE_GEN_S)",
    "glDisable(GL_TEXTURE_2D)",
    "glEnable(GL_CLIP_PLANE0)",
    "glEnable(GL_POLYGON_STIPPLE)",
    "glPushAttrib(GL_ALL_ATTRIB_BITS)\nglDisable(GL_LIGHTING)\nglPopAttrib()",
    "glBegin(GL_TRIANGLES)\nglVertex2f(9,9)\nglMaterialfv(GL_FRONT,GL_DIFFUSE,{0,0,1,1})\nglVertex2f(12,9)\nglVertex2f(9,12)\nglEnd()\nglTranslatef(0,0,0)",
    "glBegin(GL_LINES)\nglVertex2f(9,9)\nglVertex2f(12,12)\nglEnd()\nglTranslatef(0,0,0)",
    "glBegin(GL_POINTS)\nglVertex2f(9,9)\nglEnd()\nglTranslatef(0,0,0)",
    "glBegin(GL_TRIANGLES)\nglTexCoord4f(0,0,0,2)\nglVertex4f(9,9,0,2)\nglVertex2f(12,9)\nglVertex2f(9,12)\nglEnd()\nglTranslatef(0,0,0)",
    "glBegin(GL_TRIANGLES)\nglColor3f(1,0,0)\nglVertex2f(9,9)\nglColor4f(0,1,0,0.5)\nglVertex2f(12,9)\nglVertex2f(9,12)\nglEnd()\nglTranslatef(0,0,0)",
    "glWindowPos2i(4,2)\nglDrawPixels(1,1,GL_RGBA,GL_UNSIGNED_BYTE,*1)",
    "glClear(GL_COLOR_BUFFER_BIT)",
];

/// The commands of a trace as text.
fn commands(calls: &str) -> Vec<String> {
    let texels = [255, 0, 0, 255, 0, 255, 0, 64];
    let (trace, _) = imported(calls, &[&texels], 0..u64::MAX);
    let mut all = Vec::new();
    let seen: Result<(), TraceError> = trace.for_each_command(|_, command| {
        // The numbers of calls behind a call that is added are others.
        if !matches!(command, Command::SetCallSite(_)) {
            all.push(format!("{command:?}"));
        }
        Ok(())
    });
    seen.expect("a trace");
    all
}

#[test]
fn a_change_between_draws_gives_the_same_commands_whether_the_batch_has_ended_before() {
    // The zoom has no effect on these draws, but it ends the batch.
    let end = "glPixelZoom(1,1)";
    let list = format!("glNewList(9,GL_COMPILE)\n{DRAW}glEndList()\n");
    for change in CHANGES {
        for draw in [DRAW, "glCallList(9)\n"] {
            let with = |between: &str| commands(&format!("{SCENE}{list}{draw}{draw}{between}\n{draw}{draw}"));
            assert!(with(change) == with(&format!("{end}\n{change}\n{end}")), "{change}\n{draw}");
        }
    }
}
