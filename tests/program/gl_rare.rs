//! Features that few programs use, as Mesa has them: packed attributes, combiners of four arguments, distances of fog, mirrored textures,
//! copies of buffer objects, indices that end a primitive.

use fillrate::trace::Reading;

use super::gl_features::{BLACK, BLUE, GREEN, QUAD, RED, last_of, near, recorded, shown};

const ORTHO: &str = "glMatrixMode(GL_PROJECTION)\nglOrtho(0,16,0,16,-1,1)\nglMatrixMode(GL_MODELVIEW)\n";
const NEAREST: &str = "glTexParameteri(3553,10241,9728)\nglTexParameteri(3553,10240,9728)\nglEnable(3553)\n";
const TEXEL: &str = "glTexImage2D(3553,0,6408,1,1,0,6408,5121,*1)\n";

/// Why calls are refused.
fn refused(calls: &str, buffers: &[&[u8]]) -> String {
    recorded(calls, buffers, 0..u64::MAX, &Reading::default()).1.refusal().unwrap_or_default()
}

/// The picture of calls, and the number of those that are errors.
fn with_errors(calls: &str, buffers: &[&[u8]]) -> (super::gl_features::Shown, u64) {
    let (trace, report) = recorded(calls, buffers, 0..u64::MAX, &Reading::default());
    assert_eq!(report.refusal(), None);
    (last_of(&trace), report.errors.iter().map(|(_, count)| count.times).sum())
}

fn floats(values: &[f32]) -> Vec<u8> {
    values.iter().flat_map(|value| value.to_le_bytes()).collect()
}

#[test]
fn packed_attributes_are_sent_between_begin_and_end() {
    const UNSIGNED: u32 = 33640;
    const SIGNED: u32 = 36255;
    let word = |[x, y, z, w]: [u32; 4]| x & 1023 | (y & 1023) << 10 | (z & 1023) << 20 | w << 30;
    let corner = |kind: u32, x: u32, y: u32| format!("glVertexP2ui({kind},{})\n", word([x, y, 7, 1]));
    let triangle = |kind: u32| {
        let corners = [corner(kind, 0, 0), corner(kind, 16, 0), corner(kind, 0, 16)].concat();
        format!("glColorP3ui({UNSIGNED},{})\n{corners}", word([0, 1023, 0, 0]))
    };
    for kind in [UNSIGNED, SIGNED] {
        let begun = format!("glBegin(GL_TRIANGLES)\n{}glEnd()\n", triangle(kind));
        assert_eq!(shown(&format!("{ORTHO}{begun}"), &[]).at(2, 2), GREEN);
        let list = format!("{ORTHO}glNewList(1,GL_COMPILE)\n{begun}glEndList()\nglCallList(1)");
        assert_eq!(shown(&list, &[]).at(2, 2), GREEN, "in a list");
    }
    let colored = |call: String| shown(&format!("{call}\n{QUAD}"), &[]).at(8, 8);
    // Values measured in Mesa: 255 of 1023, and 255 of 511 with a sign.
    assert!(near(colored(format!("glColorP4ui({UNSIGNED},{})", word([255, 0, 512, 1]))), [64, 0, 128]));
    assert!(near(colored(format!("glColorP3ui({SIGNED},{})", word([255, 1023, 511, 0]))), [127, 0, 255]));
    assert_eq!(colored(format!("glColorP3uiv({UNSIGNED},{{{}}})", word([1023, 0, 0, 0]))), RED);
    let secondary =
        format!("glEnable(GL_COLOR_SUM)\nglColor3f(0,0,0)\nglSecondaryColorP3ui({UNSIGNED},{})", word([0, 0, 1023, 0]));
    assert_eq!(colored(secondary), BLUE);
    let lit = format!("glEnable(GL_LIGHTING)\nglEnable(GL_LIGHT0)\nglNormalP3ui({SIGNED},{})", word([0, 0, 511, 0]));
    assert_eq!(colored(lit.clone()), colored("glEnable(GL_LIGHTING)\nglEnable(GL_LIGHT0)\nglNormal3f(0,0,1)".into()));
    assert!(colored(lit)[0] > 100);
    // Three texels; the coordinate is not normalised.
    let texels = [[255, 0, 0, 255], [0, 255, 0, 255], [0, 0, 255, 255]].concat();
    for call in [format!("glTexCoordP1ui({UNSIGNED},2)"), format!("glMultiTexCoordP1ui(GL_TEXTURE0,{UNSIGNED},2)")] {
        let drawn = format!(
            "{NEAREST}glTexImage2D(3553,0,6408,3,1,0,6408,5121,*1)\nglMatrixMode(GL_TEXTURE)\nglScalef(0.25,1,1)\n{call}\n{QUAD}"
        );
        assert_eq!(shown(&drawn, &[&texels]).at(8, 8), GREEN, "{call}");
    }
    assert_eq!(with_errors(&format!("glColorP3ui(GL_FLOAT,3)\n{QUAD}"), &[]).1, 1);
    assert!(refused("glBegin(GL_POINTS)\nglVertexStream2fATI(0,1,1)\nglEnd()", &[]).starts_with("glVertexStream2fATI"));
}

#[test]
fn combiners_have_the_functions_of_extensions() {
    // The texel is a third, the primary colour a half, the constant 0.2; the results are sums of products.
    let start = format!(
        "{NEAREST}{TEXEL}glColor3f(0.5,0.5,0.5)\nglTexEnvfv(8960,GL_TEXTURE_ENV_COLOR,{{0.2,0.2,0.2,1}})\nglTexEnvi(8960,8704,GL_COMBINE)\n\
         glTexEnvi(8960,GL_SRC0_RGB,GL_TEXTURE)\nglTexEnvi(8960,GL_SRC1_RGB,GL_CONSTANT)\nglTexEnvi(8960,GL_SRC2_RGB,GL_PRIMARY_COLOR)\n\
         glTexEnvi(8960,GL_OPERAND2_RGB,GL_SRC_COLOR)\n"
    );
    let of = |calls: &str| {
        let calls = calls.replace("env(", "glTexEnvi(8960,");
        shown(&format!("{start}{calls}\n{QUAD}"), &[&[85, 85, 85, 255]]).at(8, 8)[0]
    };
    let close = |value: u8, wanted: f32| (f32::from(value) - 255.0 * wanted).abs() <= 1.0;
    // Functions of ATI_texture_env_combine3.
    for (function, wanted) in [(0x8744, 0.5 / 3.0 + 0.2), (0x8745, 0.0), (0x8746, 0.0)] {
        assert!(close(of(&format!("env(GL_COMBINE_RGB,{function})")), wanted), "{function:x}");
    }
    let brighter = "env(GL_OPERAND0_RGB,GL_ONE_MINUS_SRC_COLOR)\nenv(GL_SRC2_RGB,1)\n";
    assert!(close(of(&format!("{brighter}env(GL_COMBINE_RGB,{})", 0x8745)), 2.0 / 3.0 + 0.2 - 0.5));
    assert!(close(of(&format!("{brighter}env(GL_COMBINE_RGB,{})", 0x8746)), 2.0 / 3.0 - 0.2));
    assert!(close(of("env(GL_SRC0_RGB,0)\nenv(GL_COMBINE_RGB,GL_ADD)"), 0.2));
    // Four arguments: a third of 0.2 and half of 1 - 0.2.
    let four = format!("env(8704,{})\nenv({},GL_CONSTANT)\nenv({},GL_ONE_MINUS_SRC_COLOR)\n", 0x8503, 0x8583, 0x8593);
    assert!(close(of(&format!("{four}env(GL_COMBINE_RGB,GL_ADD)\nenv(GL_COMBINE_ALPHA,GL_ADD)")), 0.2 / 3.0 + 0.4));
    let signed = format!("{four}env(GL_SRC2_RGB,1)\nenv(GL_COMBINE_RGB,GL_ADD_SIGNED)\nenv(GL_COMBINE_ALPHA,GL_ADD)");
    assert!(close(of(&signed), 0.2 / 3.0 + 0.8 - 0.5));
    let other = refused(&format!("{start}glTexEnvi(8960,8704,34051)\n{QUAD}"), &[&[85, 85, 85, 255]]);
    assert!(other.starts_with("GL_COMBINE4_NV with a function"), "{other}");
    // Dot products of EXT_texture_env_dot3 are not scaled.
    let dot = format!("{start}glTexEnvi(8960,GL_COMBINE_RGB,{})\n", 0x8740);
    let shown_dot = shown(&format!("{dot}{QUAD}"), &[&[85, 85, 85, 255]]).at(8, 8)[0];
    assert!(close(shown_dot, 4.0 * 3.0 * (1.0 / 6.0) * 0.3), "{shown_dot}");
    assert!(refused(&format!("{dot}glTexEnvf(8960,GL_RGB_SCALE,2)\n{QUAD}"), &[&[85, 85, 85, 255]]).contains("dot products"));
    // Operands of alpha are alphas.
    let errors =
        with_errors(&format!("glTexEnvi(8960,GL_OPERAND0_ALPHA,GL_SRC_COLOR)\nglTexEnvi(8960,8704,17185)\n{QUAD}"), &[]).1;
    assert_eq!(errors, 2);
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
fn textures_are_mirrored_once() {
    // What Mesa reads of a red and a blue texel with a green border, at these places and at the same with a minus.
    const PLACES: [f32; 6] = [0.0, 0.125, 0.5, 0.875, 1.0, 1.25];
    let (half, some, mixed, much) = ([128, 128, 0], [191, 64, 0], [128, 0, 128], [0, 64, 191]);
    let edge = [0, 128, 128];
    let rows = [
        (0x8742, 9728, [RED, RED, BLUE, BLUE, BLUE, BLUE]),
        (0x8742, 9729, [half, some, mixed, much, edge, edge]),
        (0x8743, 9728, [RED, RED, BLUE, BLUE, BLUE, BLUE]),
        (0x8743, 9729, [RED, RED, mixed, BLUE, BLUE, BLUE]),
        (0x8912, 9728, [RED, RED, BLUE, BLUE, GREEN, GREEN]),
        (0x8912, 9729, [half, some, mixed, much, edge, GREEN]),
    ];
    for (wrap, filter, wanted) in rows {
        let columns: String = (0..12)
            .map(|k| {
                let (u, x) = (if k < 6 { PLACES[k] } else { -PLACES[k - 6] }, k);
                format!("glTexCoord2f({u},0.5)\nglRecti({x},0,{},16)\n", x + 1)
            })
            .collect();
        let calls = format!(
            "{ORTHO}{NEAREST}glTexEnvi(8960,8704,7681)\nglTexParameteri(3553,10241,{filter})\nglTexParameteri(3553,10240,{filter})\n\
             glTexParameteri(3553,10242,{wrap})\nglTexParameterfv(3553,4100,{{0,1,0,1}})\nglTexImage2D(3553,0,6408,2,1,0,6408,5121,*1)\n{columns}"
        );
        let image = shown(&calls, &[&[255, 0, 0, 255, 0, 0, 255, 255]]);
        for k in 0..12 {
            assert!(near(image.at(k, 8), wanted[k % 6]), "{wrap:x} {filter} at {k}: {:?}", image.at(k, 8));
        }
    }
    // An unknown mode is an error, as are others than clamping for rectangles.
    let errors = with_errors(
        "glTexParameteri(3553,10242,77)\nglTexParameteri(34037,10242,GL_REPEAT)\nglTexParameteri(34037,10242,GL_CLAMP)\nglTexParameteri(3553,7,1)",
        &[],
    )
    .1;
    assert_eq!(errors, 3);
    for call in ["glTexParameteri(3553,37734,32775)", "glTexParameteri(3553,37098,6401)", "glTexParameteri(34067,34895,1)"] {
        assert!(!refused(call, &[]).is_empty(), "{call}");
    }
}

#[test]
fn blend_factors_are_the_colour_and_the_alpha_of_the_constant() {
    let draw = |source: u32, destination: u32| {
        let calls = format!(
            "glClearColor(1,0.5,0.25,1)\nglClear(16384)\nglEnable(GL_BLEND)\nglBlendColor(0.8,0.6,0.2,0.4)\nglBlendFunc({source},{destination})\n\
             glColor3f(0.5,0.5,1.5)\n{QUAD}"
        );
        shown(&calls, &[]).at(8, 8)
    };
    let (color, other_color, alpha, other_alpha) = (32769, 32770, 32771, 32772);
    let factor = |of: u32, k: usize| {
        let constant = [0.8_f32, 0.6, 0.2][k];
        [constant, 1.0 - constant, 0.4, 0.6][of as usize - 32769]
    };
    for (source, destination) in [(color, other_alpha), (other_color, alpha), (alpha, color), (other_alpha, other_color)] {
        let wanted: [f32; 3] = std::array::from_fn(|k| {
            let (new, old) = ([0.5, 0.5, 1.0][k], [1.0, 0.5, 0.25][k]);
            (255.0 * (new * factor(source, k) + old * factor(destination, k))).min(255.0)
        });
        let found = draw(source, destination);
        assert!((0..3).all(|k| (f32::from(found[k]) - wanted[k]).abs() <= 2.0), "{found:?} {wanted:?}");
    }
}

#[test]
fn buffer_objects_are_copied_in_parts() {
    let corners = floats(&[0.0, 0.0, 16.0, 0.0, 0.0, 16.0]);
    let calls = format!(
        "{ORTHO}glEnableClientState(GL_VERTEX_ARRAY)\nglBindBufferARB(36662,1)\nglBufferStorage(36662,24,*1,0)\nglBindBufferARB(34962,2)\n\
         glBufferDataARB(34962,32,*2,35044)\nglVertexPointer(2,GL_FLOAT,0,8)\n"
    );
    let copy = "glCopyBufferSubData(36662,34962,0,8,24)\n";
    let image = |more: &str| {
        let (image, errors) = with_errors(&format!("{calls}{more}glDrawArrays(GL_TRIANGLES,0,3)"), &[&corners, &[0; 32]]);
        (image.lit().len(), errors)
    };
    assert_eq!(image(""), (0, 0));
    let (lit, errors) = image(copy);
    assert!(lit > 100 && errors == 0);
    // Beyond the end, of overlapping parts, and of negative places; storage stays as it is.
    let wrong = "glCopyBufferSubData(36662,34962,1,8,24)\nglCopyBufferSubData(34962,34962,0,8,16)\nglCopyBufferSubData(36662,34962,-4,8,4)\n\
        glBufferDataARB(36662,24,*2,35044)\nglBufferStorage(36662,0,*2,0)\nglBufferSubDataARB(36662,0,8,*2)\n";
    assert_eq!(image(&format!("{wrong}{copy}")), (lit, 6));
    let written =
        calls.replace("*1,0)", "*1,256)") + "glBufferSubDataARB(36662,0,24,*2)\n" + copy + "glDrawArrays(GL_TRIANGLES,0,3)";
    let (image, errors) = with_errors(&written, &[&corners, &[0; 32]]);
    assert_eq!((image.lit().len(), errors), (0, 0), "storage that may be written");
}

#[test]
fn indices_end_primitives() {
    // Two strips of a column each, beside a corner that only a strip that goes on would reach.
    let corners = floats(&[0.0, 0.0, 2.0, 0.0, 0.0, 16.0, 2.0, 16.0, 8.0, 0.0, 10.0, 0.0, 8.0, 16.0, 10.0, 16.0]);
    let indices = [0_u8, 1, 2, 3, 255, 4, 5, 6, 7];
    let words: Vec<u8> = indices.iter().flat_map(|&index| [index, 0]).collect();
    let arrays = format!("{ORTHO}glEnableClientState(GL_VERTEX_ARRAY)\nglVertexPointer(2,GL_FLOAT,0,*1)\n");
    let columns = |calls: &str| {
        let image = shown(&format!("{arrays}{calls}"), &[&corners, &indices, &words]);
        (0..16).filter(|&x| image.at(x, 8) != BLACK).collect::<Vec<_>>()
    };
    let draw = "glDrawElements(GL_TRIANGLE_STRIP,9,GL_UNSIGNED_BYTE,*2)\n";
    let apart = [0, 1, 8, 9];
    assert_eq!(columns(&format!("glEnable(36765)\nglPrimitiveRestartIndex(255)\n{draw}")), apart);
    assert_eq!(columns(&format!("glEnable(36201)\n{draw}")), apart);
    assert_eq!(columns(&format!("glEnableClientState(34136)\nglPrimitiveRestartIndexNV(255)\n{draw}")), apart);
    let short = "glDrawElements(GL_TRIANGLE_STRIP,9,GL_UNSIGNED_SHORT,*3)\n";
    assert_eq!(columns(&format!("glEnable(36765)\nglPrimitiveRestartIndex(255)\n{short}")), apart);
    // In buffer objects, with a number that is added to the other indices only.
    let object = "glBindBufferARB(34963,2)\nglBufferDataARB(34963,9,*2,35044)\nglBindBufferARB(34962,1)\nglBufferDataARB(34962,64,*1,35044)\nglVertexPointer(2,GL_FLOAT,0,0)\n\
         glEnable(36765)\nglPrimitiveRestartIndex(255)\n";
    assert_eq!(columns(&format!("{object}glDrawElements(GL_TRIANGLE_STRIP,9,GL_UNSIGNED_BYTE,0)")), apart);
    let based = "glDrawElementsBaseVertex(GL_TRIANGLE_STRIP,5,GL_UNSIGNED_BYTE,0,4)";
    assert_eq!(columns(&format!("{object}{based}")), [8, 9]);
    // Elements that are sent one by one.
    let elements: String = indices.iter().map(|index| format!("glArrayElement({index})\n")).collect();
    let begun = format!("glBegin(GL_TRIANGLE_STRIP)\n{elements}glEnd()\n");
    assert_eq!(columns(&format!("{object}{begun}")), apart);
    for calls in [format!("glEnable(36201)\n{begun}"), format!("glNewList(1,GL_COMPILE)\n{begun}glEndList()\n")] {
        assert!(refused(&format!("{arrays}{object}{calls}"), &[&corners, &indices]).starts_with("glArrayElement"), "{calls}");
    }
}

#[test]
fn a_call_ends_a_primitive_and_begins_the_next() {
    let strip = |x: u32| format!("glVertex2i({x},0)\nglVertex2i({},0)\nglVertex2i({x},16)\nglVertex2i({},16)\n", x + 2, x + 2);
    let both = format!("glBegin(GL_TRIANGLE_STRIP)\n{}glPrimitiveRestartNV()\n{}glEnd()\n", strip(0), strip(8));
    let columns = |calls: &str| {
        let image = shown(&format!("{ORTHO}{calls}"), &[]);
        (0..16).filter(|&x| image.at(x, 8) != BLACK).collect::<Vec<_>>()
    };
    assert_eq!(columns(&both), [0, 1, 8, 9]);
    assert_eq!(columns(&format!("glNewList(1,GL_COMPILE)\n{both}glEndList()\nglCallList(1)")), [0, 1, 8, 9]);
    assert_eq!(with_errors("glPrimitiveRestartNV()", &[]).1, 1);
}

#[test]
fn depths_are_not_copied_to_colours() {
    for kind in [34926, 34927] {
        let what = refused(&format!("glRasterPos2f(0,0)\nglCopyPixels(0,0,2,2,{kind})"), &[]);
        assert!(what.starts_with("copies of depths and stencil values to colours"), "{what}");
    }
}

#[test]
fn compressed_textures_of_one_and_two_channels_are_stored_as_texels() {
    for (internal, wanted) in [(0x8225, RED), (0x8226, [255, 128, 0])] {
        let calls = format!("{NEAREST}glTexEnvi(8960,8704,7681)\nglTexImage2D(3553,0,{internal},1,1,0,6408,5121,*1)\n{QUAD}");
        assert!(near(shown(&calls, &[&[255, 128, 64, 255]]).at(8, 8), wanted), "{internal:x}");
    }
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
