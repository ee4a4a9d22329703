//! Hostile recordings of OpenGL as GLInterceptor's text: calls that are repeated, nested, or that stand for more than they say.

use super::{TextForm, lines, nested};

/// A recording of these calls and a swap.
pub fn recording(calls: &str) -> String {
    format!("GLI0.t\n#! RES 8x8\nwglMakeCurrent(1,1)=1\n{calls}\nwglSwapBuffers(1)\n")
}

/// Calls and what their arguments can be, `n` times.
pub const CALLS: &[TextForm] = &[
    ("rectangles", |n| recording(&"glRectf(-1,-1,1,1)\n".repeat(n))),
    ("swaps", |n| recording(&"wglSwapBuffers(1)\n".repeat(n))),
    ("clears", |n| recording(&"glClear(GL_COLOR_BUFFER_BIT)\n".repeat(n))),
    ("states", |n| recording(&"glEnable(GL_BLEND)\nglDisable(GL_BLEND)\n".repeat(n))),
    ("states and draws", |n| {
        recording(&"glEnable(GL_BLEND)\nglRectf(0,0,1,1)\nglDisable(GL_BLEND)\nglRectf(0,0,1,1)\n".repeat(n))
    }),
    ("matrices", |n| recording(&lines(n, |k| format!("glRotatef({k},0,0,1)\nglRectf(0,0,1,1)")))),
    ("triangles", |n| recording(&format!("glBegin(GL_TRIANGLES)\n{}glEnd()", "glVertex2f(0,1)\n".repeat(n)))),
    ("quads", |n| recording(&format!("glBegin(GL_QUADS)\n{}glEnd()", "glVertex2f(0,1)\n".repeat(n)))),
    ("fan", |n| recording(&format!("glBegin(GL_TRIANGLE_FAN)\n{}glEnd()", lines(n, |k| format!("glVertex2f({k},{})", k % 7))))),
    ("polygon", |n| {
        recording(&format!("glBegin(GL_POLYGON)\n{}\nglEnd()", lines(n, |k| format!("glVertex2f({k},{})", k % 7))))
    }),
    ("lines", |n| recording(&format!("glBegin(GL_LINE_STRIP)\n{}\nglEnd()", lines(n, |k| format!("glVertex2f({},1)", k % 3))))),
    ("wide lines", |n| {
        recording(&format!(
            "glLineWidth(64)\nglLineStipple(1,21845)\nglEnable(GL_LINE_STIPPLE)\nglBegin(GL_LINES)\n{}glEnd()",
            "glVertex2f(-1,-1)\nglVertex2f(1,1)\n".repeat(n)
        ))
    }),
    ("points", |n| recording(&format!("glPointSize(64)\nglBegin(GL_POINTS)\n{}glEnd()", "glVertex2f(0,0)\n".repeat(n)))),
    ("colours", |n| {
        recording(&format!("glBegin(GL_TRIANGLES)\n{}\nglEnd()", lines(n, |k| format!("glColor3f({k},0,0)\nglVertex2f(0,1)"))))
    }),
    ("begins", |n| recording(&"glBegin(GL_TRIANGLES)\nglVertex2f(0,0)\nglVertex2f(1,0)\nglVertex2f(1,1)\nglEnd()\n".repeat(n))),
    ("begins in begins", |n| recording(&"glBegin(GL_TRIANGLES)\n".repeat(n))),
    ("lights", |n| {
        recording(&format!(
            "glEnable(GL_LIGHTING)\nglEnable(GL_LIGHT0)\n{}",
            lines(n, |k| format!("glLightfv(GL_LIGHT0,GL_DIFFUSE,{{0,{k},0,1}})\nglRectf(0,0,1,1)"))
        ))
    }),
    ("matrices kept", |n| recording(&"glPushMatrix()\n".repeat(n))),
    ("attributes kept", |n| recording(&"glPushAttrib(GL_ALL_ATTRIB_BITS)\n".repeat(n))),
    ("lists", |n| {
        recording(&lines(n, |k| {
            format!("glNewList({},GL_COMPILE)\nglRectf(0,0,1,1)\nglEndList()\nglCallList({})", k + 1, k + 1)
        }))
    }),
    ("a long list", |n| {
        recording(&format!(
            "glNewList(1,GL_COMPILE)\n{}glEndList()\nglCallList(1)\nglCallList(1)",
            "glRectf(0,0,1,1)\n".repeat(n)
        ))
    }),
    ("textures", |n| {
        recording(&lines(n, |k| {
            format!(
                "glBindTexture(GL_TEXTURE_2D,{})\nglTexImage2D(GL_TEXTURE_2D,0,GL_RGBA8,1,1,0,GL_RGBA,GL_UNSIGNED_BYTE,0)",
                k + 1
            )
        }))
    }),
    ("textures used", |n| {
        recording(&format!(
            "glEnable(GL_TEXTURE_2D)\n{}",
            lines(n, |k| format!(
                "glBindTexture(GL_TEXTURE_2D,{})\nglTexParameteri(GL_TEXTURE_2D,GL_TEXTURE_MIN_FILTER,GL_NEAREST)\nglTexImage2D(GL_TEXTURE_2D,0,GL_RGBA8,1,1,0,GL_RGBA,GL_UNSIGNED_BYTE,{{1,2,3,4}})\nglRectf(0,0,1,1)",
                k + 1
            ))
        ))
    }),
    ("uploads", |n| {
        recording(&format!(
            "glTexImage2D(GL_TEXTURE_2D,0,GL_RGBA8,64,64,0,GL_RGBA,GL_UNSIGNED_BYTE,0)\n{}",
            "glTexSubImage2D(GL_TEXTURE_2D,0,0,0,1,1,GL_RGBA,GL_UNSIGNED_BYTE,{1,2,3,4})\n".repeat(n)
        ))
    }),
    ("copies to textures", |n| {
        recording(&format!(
            "glTexImage2D(GL_TEXTURE_2D,0,GL_RGBA8,8,8,0,GL_RGBA,GL_UNSIGNED_BYTE,0)\n{}",
            "glCopyTexSubImage2D(GL_TEXTURE_2D,0,0,0,0,0,8,8)\nglRectf(0,0,1,1)\n".repeat(n)
        ))
    }),
    ("mipmaps", |n| {
        recording(&format!(
            "glTexImage2D(GL_TEXTURE_2D,0,GL_RGBA8,512,512,0,GL_RGBA,GL_UNSIGNED_BYTE,0)\n{}",
            "glGenerateMipmap(GL_TEXTURE_2D)\n".repeat(n)
        ))
    }),
    ("frame buffers", |n| {
        recording(&format!(
            "glBindTexture(GL_TEXTURE_2D,1)\nglTexImage2D(GL_TEXTURE_2D,0,GL_RGBA8,8,8,0,GL_RGBA,GL_UNSIGNED_BYTE,0)\n{}",
            lines(n, |k| format!(
                "glBindFramebuffer(GL_FRAMEBUFFER,{})\nglFramebufferTexture2D(GL_FRAMEBUFFER,GL_COLOR_ATTACHMENT0,GL_TEXTURE_2D,1,0)\nglRectf(0,0,1,1)",
                k + 1
            ))
        ))
    }),
    ("blits", |n| recording(&"glBlitFramebuffer(0,0,8,8,0,0,8,8,GL_COLOR_BUFFER_BIT,GL_NEAREST)\n".repeat(n))),
    ("pixels", |n| recording(&"glDrawPixels(1,1,GL_RGBA,GL_UNSIGNED_BYTE,{1,2,3,4})\n".repeat(n))),
    ("bitmaps", |n| recording(&"glRasterPos2f(0,0)\nglBitmap(8,8,0,0,1,1,{1,2,4,8,16,32,64,128})\n".repeat(n))),
    ("copies of pixels", |n| recording(&"glCopyPixels(0,0,8,8,GL_COLOR)\n".repeat(n))),
    ("buffers", |n| {
        recording(&lines(n, |k| {
            format!("glBindBuffer(GL_ARRAY_BUFFER,{})\nglBufferData(GL_ARRAY_BUFFER,64,0,GL_STATIC_DRAW)", k + 1)
        }))
    }),
    ("arrays", |n| {
        let start = "glBindBuffer(GL_ARRAY_BUFFER,1)\nglBufferData(GL_ARRAY_BUFFER,48,0,GL_STATIC_DRAW)\nglEnableClientState(GL_VERTEX_ARRAY)\nglVertexPointer(4,GL_FLOAT,0,0)\n";
        recording(&format!("{start}{}", "glDrawArrays(GL_TRIANGLES,0,3)\n".repeat(n)))
    }),
    ("parts of buffers", |n| {
        let start = "glBindBuffer(GL_ARRAY_BUFFER,1)\nglBufferData(GL_ARRAY_BUFFER,65536,0,GL_STATIC_DRAW)\nglEnableClientState(GL_VERTEX_ARRAY)\nglVertexPointer(4,GL_FLOAT,0,0)\n";
        recording(&format!(
            "{start}{}",
            "glBufferSubData(GL_ARRAY_BUFFER,0,4,{1,2,3,4})\nglDrawArrays(GL_TRIANGLES,0,3)\n".repeat(n)
        ))
    }),
    ("shaders", |n| {
        recording(&lines(n, |k| {
            format!(
                "glCreateShader(GL_VERTEX_SHADER)={}\nglShaderSource({},1,\"void main() {{ gl_Position = gl_Vertex; }}\",0)\nglCompileShader({})",
                k + 1,
                k + 1,
                k + 1
            )
        }))
    }),
    ("programs in assembly", |n| {
        let text = "!!ARBfp1.0\nMOV result.color, fragment.color;\nEND\n";
        recording(&lines(n, |k| {
            format!(
                "glBindProgramARB(GL_FRAGMENT_PROGRAM_ARB,{})\nglProgramStringARB(GL_FRAGMENT_PROGRAM_ARB,GL_PROGRAM_FORMAT_ASCII_ARB,{},\"{text}\")\nglEnable(GL_FRAGMENT_PROGRAM_ARB)\nglRectf(0,0,1,1)",
                k + 1,
                text.len()
            )
        }))
    }),
    ("instructions of assembly", |n| {
        let text = format!(
            "!!ARBfp1.0\nTEMP a;\nMOV a, fragment.color;\n{}MOV result.color, a;\nEND\n",
            "MAD a, a, a, a;\n".repeat(n)
        );
        recording(&format!(
            "glBindProgramARB(GL_FRAGMENT_PROGRAM_ARB,1)\nglProgramStringARB(GL_FRAGMENT_PROGRAM_ARB,GL_PROGRAM_FORMAT_ASCII_ARB,{},\"{text}\")\nglEnable(GL_FRAGMENT_PROGRAM_ARB)\nglRectf(0,0,1,1)",
            text.len()
        ))
    }),
    ("registers of assembly", |n| {
        let text = format!(
            "!!ARBfp1.0\n{}\nMOV result.color, a0;\nEND\n",
            lines(n, |k| format!("TEMP a{k};\nMOV a{k}, fragment.color;"))
        );
        recording(&format!(
            "glBindProgramARB(GL_FRAGMENT_PROGRAM_ARB,1)\nglProgramStringARB(GL_FRAGMENT_PROGRAM_ARB,GL_PROGRAM_FORMAT_ASCII_ARB,{},\"{text}\")\nglEnable(GL_FRAGMENT_PROGRAM_ARB)\nglRectf(0,0,1,1)",
            text.len()
        ))
    }),
    ("contexts", |n| {
        recording(&lines(n, |k| format!("wglCreateContext(1)={}\nwglMakeCurrent(1,{})=1\nglRectf(0,0,1,1)", k + 2, k + 2)))
    }),
    ("contexts in turns", |n| {
        recording(&"wglMakeCurrent(1,2)=1\nglRectf(0,0,1,1)\nwglMakeCurrent(1,3)=1\nglRectf(0,0,1,1)\n".repeat(n))
    }),
    ("windows", |n| {
        recording(&lines(n, |k| format!("wglMakeCurrent({},1)=1\nglRectf(0,0,1,1)\nwglSwapBuffers({})", k + 1, k + 1)))
    }),
    ("unknown calls", |n| recording(&lines(n, |k| format!("glNoSuchThing{k}(1,2)")))),
    ("errors", |n| recording(&"glPopMatrix()\n".repeat(n))),
    ("arguments", |n| recording(&format!("glRectf({}1)", "1,".repeat(n)))),
    ("elements", |n| recording(&format!("glLoadMatrixf({{{}1}})", "1,".repeat(n)))),
    ("braces", |n| recording(&format!("glLoadMatrixf({})", nested("{", "1", "}", n)))),
    ("braces not closed", |n| recording(&format!("glLoadMatrixf({}", "{".repeat(n)))),
    ("brackets", |n| recording(&nested("glRectf(", "1", ")", n))),
    ("digits", |n| recording(&format!("glLineWidth({})", "1".repeat(n)))),
    ("digits of a fraction", |n| recording(&format!("glLineWidth(0.{})", "1".repeat(n)))),
    ("long name", |n| recording(&format!("gl{}(1)", "A".repeat(n)))),
    ("long enumerant", |n| recording(&format!("glEnable(GL_{})", "A".repeat(n)))),
    ("bits", |n| recording(&format!("glClear({}GL_COLOR_BUFFER_BIT)", "GL_DEPTH_BUFFER_BIT|".repeat(n)))),
    ("long text", |n| recording(&format!("glShaderSource(1,1,\"{}\",0)", "a".repeat(n)))),
    ("lines of a text", |n| recording(&format!("glShaderSource(1,1,\"{}\",0)", "\n".repeat(n)))),
    ("quotes", |n| recording(&format!("glShaderSource(1,1,{},0)", "\"\"".repeat(n)))),
    ("quotes not closed", |n| recording(&"glShaderSource(1,1,\"\n".repeat(n))),
    ("empty lines", |n| recording(&"\n".repeat(n))),
    ("comments", |n| recording(&"# a comment\n".repeat(n))),
    ("marks of frames", |n| recording(&"#! FRAME 1\n".repeat(n))),
    ("nonsense", |n| recording(&"(){}\"=,\n".repeat(n))),
    ("evaluators", |n| {
        recording(&format!(
            "glMap1f(GL_MAP1_VERTEX_3,0,1,3,2,{{0,0,0,1,1,1}})\nglEnable(GL_MAP1_VERTEX_3)\n{}",
            "glMapGrid1f(100,0,1)\nglEvalMesh1(GL_LINE,0,100)\n".repeat(n)
        ))
    }),
    ("accumulations", |n| recording(&"glAccum(GL_ACCUM,0.5)\nglAccum(GL_RETURN,1)\n".repeat(n))),
    ("selections", |n| recording(&"glRenderMode(GL_SELECT)\nglRectf(0,0,1,1)\nglRenderMode(GL_RENDER)\n".repeat(n))),
    ("queries", |n| {
        recording(&lines(n, |k| {
            format!("glBeginQuery(GL_SAMPLES_PASSED,{})\nglRectf(0,0,1,1)\nglEndQuery(GL_SAMPLES_PASSED)", k + 1)
        }))
    }),
    ("names", |n| recording(&"glGenTextures(3,{1,2,3})\nglDeleteTextures(3,{1,2,3})\n".repeat(n))),
];

/// A few calls that stand for 2 to the power of this number, or for more.
pub const LARGE: &[TextForm] = &[
    ("lists of lists", |n| {
        let all = lines(n, |k| format!("glNewList({},GL_COMPILE)\nglCallList({k})\nglCallList({k})\nglEndList()", k + 1));
        recording(&format!(
            "glNewList(0,GL_COMPILE)\nglRectf(0,0,1,1)\nglEndList()\nglNewList(1,GL_COMPILE)\nglRectf(0,0,1,1)\nglEndList()\n{}\nglCallList({n})",
            all.replacen("glNewList(1,GL_COMPILE)\nglCallList(0)\nglCallList(0)\nglEndList()", "", 1)
        ))
    }),
    ("empty lists of lists", |n| {
        let all =
            lines(n, |k| format!("glNewList({},GL_COMPILE)\nglCallList({})\nglCallList({})\nglEndList()", k + 2, k + 1, k + 1));
        recording(&format!("glNewList(1,GL_COMPILE)\nglEndList()\n{all}\nglCallList({})", n + 1))
    }),
    ("a list that calls itself", |n| {
        recording(&format!("glNewList(1,GL_COMPILE)\n{}glEndList()\nglCallList(1)", "glCallList(1)\n".repeat(n.max(2))))
    }),
    ("vertices of an array", |n| {
        let start = "glBindBuffer(GL_ARRAY_BUFFER,1)\nglBufferData(GL_ARRAY_BUFFER,48,0,GL_STATIC_DRAW)\nglEnableClientState(GL_VERTEX_ARRAY)\nglVertexPointer(4,GL_FLOAT,0,0)\n";
        recording(&format!("{start}glDrawArrays(GL_TRIANGLES,0,{})\n", 1_u64 << n.min(31)))
    }),
    ("vertices of no array", |n| recording(&format!("glDrawArrays(GL_TRIANGLES,0,{})\n", (1_u64 << n.min(31)) - 1))),
    ("bytes of a buffer", |n| {
        recording(&format!(
            "glBindBuffer(GL_ARRAY_BUFFER,1)\nglBufferData(GL_ARRAY_BUFFER,{},0,GL_STATIC_DRAW)\n",
            1_u64 << n.min(40)
        ))
    }),
    ("texels", |n| {
        recording(&format!(
            "glTexImage3D(GL_TEXTURE_3D,0,GL_RGBA32F,{0},{0},{0},0,GL_RGBA,GL_FLOAT,0)\n",
            1_u64 << (n / 3).min(14)
        ))
    }),
    ("texels of levels", |n| {
        recording(&format!(
            "glTexImage2D(GL_TEXTURE_2D,0,GL_RGBA32F,{0},{0},0,GL_RGBA,GL_FLOAT,0)\n{1}",
            1_u64 << (n / 2).min(14),
            "glGenerateMipmap(GL_TEXTURE_2D)\n".repeat(20)
        ))
    }),
    ("storage", |n| recording(&format!("glTexStorage2D(GL_TEXTURE_2D,14,GL_RGBA32F,{0},{0})\n", 1_u64 << (n / 2).min(14)))),
    ("pixels of a rectangle", |n| {
        recording(&format!("glDrawPixels({0},{0},GL_RGBA,GL_UNSIGNED_BYTE,0)\n", 1_u64 << (n / 2).min(30)))
    }),
    ("copies of large rectangles", |n| {
        recording(&format!("glCopyTexImage2D(GL_TEXTURE_2D,0,GL_RGBA8,0,0,{0},{0},0)\n", 1_u64 << (n / 2).min(14)))
    }),
    ("steps of evaluators", |n| {
        let map = "glMap2f(GL_MAP2_VERTEX_3,0,1,3,2,0,1,6,2,{0,0,0,1,0,0,0,1,0,1,1,0})\nglEnable(GL_MAP2_VERTEX_3)\n";
        recording(&format!("{map}glMapGrid2f({0},0,1,{0},0,1)\nglEvalMesh2(GL_FILL,0,{0},0,{0})\n", 1_u64 << (n / 2).min(30)))
    }),
    ("names", |n| recording(&format!("glGenTextures({},0)\nglGenLists({})=1\n", 1_u64 << n.min(31), 1_u64 << n.min(31)))),
    ("size of the window", |n| {
        format!(
            "GLI0.t\n#! RES {0}x{0}\nwglMakeCurrent(1,1)=1\nglRectf(-1,-1,1,1)\nwglSwapBuffers(1)\n",
            1_u64 << (n / 2).min(30)
        )
    }),
    ("size of the viewport", |n| recording(&format!("glViewport(0,0,{0},{0})\nglRectf(-1,-1,1,1)", 1_u64 << (n / 2).min(30)))),
    ("rectangles over a large window", |n| {
        format!(
            "GLI0.t\n#! RES 4096x4096\nwglMakeCurrent(1,1)=1\n{}wglSwapBuffers(1)\n",
            "glEnable(GL_BLEND)\nglRectf(-1,-1,1,1)\n".repeat(8 * n)
        )
    }),
    ("points of a large size", |n| {
        format!(
            "GLI0.t\n#! RES 2048x2048\nwglMakeCurrent(1,1)=1\nglPointSize(2048)\nglBegin(GL_POINTS)\n{}glEnd()\nwglSwapBuffers(1)\n",
            "glVertex2f(0,0)\n".repeat(8 * n)
        )
    }),
];
