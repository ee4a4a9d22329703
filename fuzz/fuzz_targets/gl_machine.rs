//! Calls of OpenGL that are whole and in any order, with arguments of the kinds that each takes: whatever state they lead to, importing and
//! checking them ends with a trace or a message. Each call takes a byte for its function and one for each argument.

#![no_main]

use std::fmt::Write;
use std::path::Path;

use fillrate::import::gl::import_bytes;
use fillrate::trace::{Reading, check};

/// Functions, and the kinds of their arguments: `e` an enumerant, `n` a name of an object, `i` a small whole number, `f` a number, `b` a
/// Boolean, `m` bits, `4` four numbers, `M` sixteen numbers, `p` pixels or other bytes, `u` names of a list.
const CALLS: &[(&str, &str)] = &[
    ("glBegin", "e"),
    ("glEnd", ""),
    ("glVertex2f", "ff"),
    ("glVertex4fv", "4"),
    ("glNormal3f", "fff"),
    ("glColor4f", "ffff"),
    ("glTexCoord2f", "ff"),
    ("glMultiTexCoord4f", "effff"),
    ("glRectf", "ffff"),
    ("glMaterialfv", "ee4"),
    ("glColorMaterial", "ee"),
    ("glLightfv", "ee4"),
    ("glLightModelfv", "e4"),
    ("glEnable", "e"),
    ("glDisable", "e"),
    ("glPushAttrib", "m"),
    ("glPopAttrib", ""),
    ("glMatrixMode", "e"),
    ("glLoadIdentity", ""),
    ("glLoadMatrixf", "M"),
    ("glPushMatrix", ""),
    ("glPopMatrix", ""),
    ("glOrtho", "ffffff"),
    ("glViewport", "iiii"),
    ("glScissor", "iiii"),
    ("glClear", "m"),
    ("glClearColor", "ffff"),
    ("glBlendFunc", "ee"),
    ("glAlphaFunc", "ef"),
    ("glDepthFunc", "e"),
    ("glStencilFunc", "eii"),
    ("glStencilOp", "eee"),
    ("glLogicOp", "e"),
    ("glColorMask", "bbbb"),
    ("glShadeModel", "e"),
    ("glPolygonMode", "ee"),
    ("glPolygonOffset", "ff"),
    ("glLineWidth", "f"),
    ("glLineStipple", "ii"),
    ("glPointSize", "f"),
    ("glFogfv", "e4"),
    ("glTexEnvi", "eee"),
    ("glTexGeni", "eee"),
    ("glTexParameteri", "eee"),
    ("glTexParameterfv", "ee4"),
    ("glActiveTexture", "e"),
    ("glBindTexture", "en"),
    ("glTexImage1D", "eieiieep"),
    ("glTexImage2D", "eieiiieep"),
    ("glTexImage3D", "eieiiiieep"),
    ("glTexSubImage2D", "eiiiiieep"),
    ("glTexStorage2D", "eieii"),
    ("glTexStorage3D", "eieiii"),
    ("glCopyTexImage2D", "eieiiiii"),
    ("glCopyTexSubImage2D", "eiiiiiii"),
    ("glGenerateMipmap", "e"),
    ("glDeleteTextures", "iu"),
    ("glBindFramebuffer", "en"),
    ("glFramebufferTexture2D", "eeeni"),
    ("glFramebufferRenderbuffer", "eeen"),
    ("glBindRenderbuffer", "en"),
    ("glRenderbufferStorage", "eeii"),
    ("glBlitFramebuffer", "iiiiiiiime"),
    ("glDrawBuffer", "e"),
    ("glDrawBuffers", "i3"),
    ("glReadBuffer", "e"),
    ("glDeleteFramebuffers", "iu"),
    ("glDrawPixels", "iieep"),
    ("glBitmap", "iiffffp"),
    ("glCopyPixels", "iiiie"),
    ("glRasterPos2f", "ff"),
    ("glPixelStorei", "ei"),
    ("glPixelTransferf", "ef"),
    ("glAccum", "ef"),
    ("glNewList", "ne"),
    ("glEndList", ""),
    ("glCallList", "n"),
    ("glEnableClientState", "e"),
    ("glVertexPointer", "ieip"),
    ("glColorPointer", "ieip"),
    ("glDrawArrays", "eii"),
    ("glDrawElements", "eiep"),
    ("glBindBuffer", "en"),
    ("glBufferData", "eipe"),
    ("glBufferSubData", "eiip"),
    ("glMap2f", "effiiffiip"),
    ("glMapGrid2f", "iffiff"),
    ("glEvalMesh2", "eiiii"),
    ("glSelectBuffer", "ip"),
    ("glRenderMode", "e"),
    ("glClipPlane", "e4"),
    ("wglSwapBuffers", "i"),
];

/// Enumerants that one of the functions takes; some are wrong for any one of them.
const NAMES: &[&str] = &[
    "GL_POINTS", "GL_LINES", "GL_TRIANGLES", "GL_QUADS", "GL_POLYGON", "GL_TRIANGLE_FAN", "GL_QUAD_STRIP", "GL_LINE_LOOP",
    "GL_FRONT", "GL_BACK", "GL_FRONT_AND_BACK", "GL_NONE", "GL_AMBIENT", "GL_DIFFUSE", "GL_SPECULAR", "GL_EMISSION",
    "GL_AMBIENT_AND_DIFFUSE", "GL_POSITION", "GL_LIGHT0", "GL_LIGHT7", "GL_LIGHTING", "GL_COLOR_MATERIAL", "GL_NORMALIZE",
    "GL_DEPTH_TEST", "GL_STENCIL_TEST", "GL_ALPHA_TEST", "GL_BLEND", "GL_FOG", "GL_SCISSOR_TEST", "GL_COLOR_LOGIC_OP",
    "GL_TEXTURE_1D", "GL_TEXTURE_2D", "GL_TEXTURE_3D", "GL_TEXTURE_CUBE_MAP", "GL_TEXTURE_RECTANGLE", "GL_TEXTURE_GEN_S",
    "GL_TEXTURE_CUBE_MAP_POSITIVE_X", "GL_TEXTURE_CUBE_MAP_NEGATIVE_Z", "GL_PROXY_TEXTURE_2D", "GL_LINE_STIPPLE",
    "GL_LINE_SMOOTH", "GL_POINT_SMOOTH", "GL_POINT_SPRITE", "GL_POLYGON_STIPPLE", "GL_CULL_FACE", "GL_CLIP_PLANE0",
    "GL_CLIP_PLANE5", "GL_AUTO_NORMAL", "GL_MAP2_VERTEX_3", "GL_MAP2_TEXTURE_COORD_2", "GL_FRAMEBUFFER_SRGB",
    "GL_POLYGON_OFFSET_FILL", "GL_POLYGON_OFFSET_LINE", "GL_MODELVIEW", "GL_PROJECTION", "GL_TEXTURE", "GL_NEVER", "GL_LESS",
    "GL_EQUAL", "GL_ALWAYS", "GL_KEEP", "GL_REPLACE", "GL_INCR", "GL_ZERO", "GL_ONE", "GL_SRC_ALPHA", "GL_ONE_MINUS_SRC_ALPHA",
    "GL_DST_COLOR", "GL_CONSTANT_ALPHA", "GL_XOR", "GL_INVERT", "GL_SET", "GL_FLAT", "GL_SMOOTH", "GL_LINE", "GL_FILL",
    "GL_POINT", "GL_FOG_MODE", "GL_FOG_COLOR", "GL_EXP", "GL_LINEAR", "GL_NEAREST", "GL_LINEAR_MIPMAP_LINEAR",
    "GL_TEXTURE_ENV", "GL_TEXTURE_ENV_MODE", "GL_COMBINE", "GL_COMBINE_RGB", "GL_DOT3_RGB", "GL_MODULATE", "GL_DECAL", "GL_S",
    "GL_T", "GL_TEXTURE_GEN_MODE", "GL_SPHERE_MAP", "GL_REFLECTION_MAP", "GL_OBJECT_LINEAR", "GL_TEXTURE_MIN_FILTER",
    "GL_TEXTURE_MAG_FILTER", "GL_TEXTURE_WRAP_S", "GL_TEXTURE_WRAP_T", "GL_CLAMP", "GL_REPEAT", "GL_CLAMP_TO_BORDER",
    "GL_TEXTURE_BORDER_COLOR", "GL_TEXTURE_BASE_LEVEL", "GL_TEXTURE_MAX_LEVEL", "GL_GENERATE_MIPMAP", "GL_TEXTURE_COMPARE_MODE",
    "GL_COMPARE_REF_TO_TEXTURE", "GL_TEXTURE_SWIZZLE_R", "GL_TEXTURE0", "GL_TEXTURE1", "GL_TEXTURE7", "GL_RGB", "GL_RGBA",
    "GL_BGRA", "GL_RED", "GL_RG", "GL_ALPHA", "GL_LUMINANCE", "GL_LUMINANCE_ALPHA", "GL_INTENSITY", "GL_RGB8", "GL_RGBA8",
    "GL_R8", "GL_RG8", "GL_RGBA16F", "GL_RGBA32F", "GL_R32F", "GL_SRGB8", "GL_DEPTH_COMPONENT", "GL_DEPTH_COMPONENT24",
    "GL_DEPTH24_STENCIL8", "GL_STENCIL_INDEX", "GL_COLOR_INDEX", "GL_UNSIGNED_BYTE", "GL_BYTE", "GL_UNSIGNED_SHORT", "GL_SHORT",
    "GL_UNSIGNED_INT", "GL_INT", "GL_FLOAT", "GL_HALF_FLOAT", "GL_DOUBLE", "GL_BITMAP", "GL_UNSIGNED_SHORT_5_6_5",
    "GL_UNSIGNED_INT_8_8_8_8_REV", "GL_FRAMEBUFFER", "GL_DRAW_FRAMEBUFFER", "GL_READ_FRAMEBUFFER", "GL_RENDERBUFFER",
    "GL_COLOR_ATTACHMENT0", "GL_COLOR_ATTACHMENT1", "GL_COLOR_ATTACHMENT2", "GL_DEPTH_ATTACHMENT", "GL_STENCIL_ATTACHMENT",
    "GL_DEPTH_STENCIL_ATTACHMENT", "GL_COLOR", "GL_DEPTH", "GL_STENCIL", "GL_UNPACK_ALIGNMENT", "GL_UNPACK_ROW_LENGTH",
    "GL_UNPACK_SKIP_ROWS", "GL_RED_SCALE", "GL_DEPTH_BIAS", "GL_MAP_COLOR", "GL_ACCUM", "GL_LOAD", "GL_RETURN", "GL_MULT",
    "GL_COMPILE", "GL_COMPILE_AND_EXECUTE", "GL_VERTEX_ARRAY", "GL_COLOR_ARRAY", "GL_TEXTURE_COORD_ARRAY", "GL_ARRAY_BUFFER",
    "GL_ELEMENT_ARRAY_BUFFER", "GL_PIXEL_UNPACK_BUFFER", "GL_STATIC_DRAW", "GL_RENDER", "GL_FEEDBACK", "GL_SELECT",
];

/// Numbers that are not bounded, and others that are.
const NUMBERS: &[&str] = &["0", "1", "-1", "0.5", "0.25", "2", "8", "16", "100", "-0.75", "1e30", "-1e30", "1e-30", "nan", "inf", "3"];
/// Small whole numbers, sizes and offsets.
const WHOLE: &[i64] = &[0, 1, 2, 3, 4, 8, 16, 5, 7, -1, 10, 64, 255, 1000, 100_000, -2_147_483_648];
/// Bits of masks.
const MASKS: &[u32] = &[0x4000, 0x100, 0x400, 0x4500, 0x200, 0xffff_ffff, 0x2000, 0x40000, 1, 0];

libfuzzer_sys::fuzz_target!(|data: &[u8]| {
    let mut bytes = data.iter().copied();
    let mut text = String::from("GLI0.t\n#! RES 16x16\n");
    while let Some(function) = bytes.next() {
        let (name, kinds) = CALLS[usize::from(function) % CALLS.len()];
        let mut arguments = Vec::new();
        for kind in kinds.chars() {
            let choice = usize::from(bytes.next().unwrap_or(0));
            let number = |k: usize| NUMBERS[(choice + k) % NUMBERS.len()];
            let list = |count: usize| format!("{{{}}}", (0..count).map(number).collect::<Vec<_>>().join(","));
            arguments.push(match kind {
                'e' => NAMES[choice % NAMES.len()].to_owned(),
                'n' => (choice % 4).to_string(),
                'u' => format!("{{{},{}}}", choice % 4, choice / 4 % 4),
                'i' => WHOLE[choice % WHOLE.len()].to_string(),
                'f' => number(0).to_owned(),
                'b' => ["GL_FALSE", "GL_TRUE"][choice % 2].to_owned(),
                'm' => MASKS[choice % MASKS.len()].to_string(),
                '3' => {
                    let buffer = |k: usize| ["GL_NONE", "GL_COLOR_ATTACHMENT0", "GL_COLOR_ATTACHMENT1"][(choice >> k) % 3];
                    format!("{{{},{},{}}}", buffer(0), buffer(2), buffer(4))
                }
                '4' => list(4),
                'M' => list(16),
                _ => match choice % 4 {
                    0 => "0".to_owned(),
                    k => list([16, 64, 512][k - 1]),
                },
            });
        }
        writeln!(text, "{name}({})", arguments.join(",")).expect("text in memory");
    }
    text.push_str("wglSwapBuffers(0)\n");
    match import_bytes(Path::new("x.trace"), text.into_bytes(), [&[], &[]], &Reading::default()) {
        // What the machine makes of calls is a trace that passes the checker.
        Ok((trace, report)) => {
            if report.unsupported.is_empty()
                && let Err(error) = check(&trace)
            {
                panic!("{error}");
            }
        }
        Err(error) => assert!(error.to_string().starts_with("x.trace"), "{error}"),
    }
});
