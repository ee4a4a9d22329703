//! Programs in GLSL, replayed: what they draw against arithmetic that is written here.

use fillrate::accuracy::gl::recording::Recording;

/// Draws the whole window with a program of these shaders; a text that is empty leaves the stage to fixed functions. Objects have the
/// numbers 10 n, 10 n + 1 and 10 n + 2.
pub fn frame(recording: &mut Recording, n: usize, vertex: &str, fragment: &str, calls: &str) {
    let program = 10 * n + 2;
    recording.add(&format!("glCreateProgram()={program}"));
    for (k, (stage, text)) in
        [("VERTEX", vertex), ("FRAGMENT", fragment)].into_iter().enumerate().filter(|(_, (_, text))| !text.is_empty())
    {
        let name = 10 * n + k;
        recording.add(&format!(
            "glCreateShader(GL_{stage}_SHADER)={name}\nglShaderSource({name},1,\"{text}\",0)\nglCompileShader({name})\n\
             glAttachShader({program},{name})"
        ));
    }
    recording.add(&format!(
        "glLinkProgram({program})\nglUseProgram({program})\n{}\nglRectf(-1,-1,1,1)",
        calls.replace('@', &program.to_string())
    ));
    recording.end_frame();
}

/// A vertex shader that passes the position on.
pub const PASS: &str = "void main() { gl_Position = gl_Vertex; }";

/// Compares the middle of each frame.
pub fn near(recording: &Recording, wanted: &[(&str, [f64; 3])]) {
    let seen = recording.centers().unwrap_or_else(|error| panic!("{error:#}"));
    assert_eq!(seen.len(), wanted.len());
    for ((name, wanted), seen) in wanted.iter().zip(seen) {
        for (value, seen) in wanted.iter().zip(seen) {
            let value = (255.0 * value).clamp(0.0, 255.0);
            assert!((value - seen).abs() <= 1.0, "{name}: {value} is not {seen}");
        }
    }
}

#[test]
fn statements_compute_what_the_language_says() {
    let cases: Vec<(&str, [f64; 3])> = vec![
        ("c = vec3(0.25, 0.5, 0.75);", [0.25, 0.5, 0.75]),
        // Whole numbers become floats.
        ("float x = 3; c = vec3(x / 4, 1 / 2, 5 / 2 / 4.0);", [0.75, 0.0, 0.5]),
        ("int i = 7; i /= 2; c = vec3(float(i) / 10.0, mod(5.5, 2.0) / 4.0, fract(-0.25));", [0.3, 0.375, 0.75]),
        ("c = mix(vec3(0.0), vec3(1.0, 0.5, 0.25), 0.5);", [0.5, 0.25, 0.125]),
        ("c.bg = vec2(0.25, 0.5); c.r = c.g * 2.0;", [1.0, 0.5, 0.25]),
        ("mat2 m = mat2(0.5, 0.0, 0.25, 1.0); c = vec3(m * vec2(1.0, 0.5), m[1][0]);", [0.625, 0.5, 0.25]),
        ("mat3 m = mat3(0.5); c = vec3(0.5, 1.0, 0.25) * m;", [0.25, 0.5, 0.125]),
        ("float a[3]; for (int i = 0; i < 3; i++) a[i] = float(i) * 0.25; c = vec3(a[0], a[1], a[2]);", [0.0, 0.25, 0.5]),
        ("for (int i = 0; i < 10; ++i) { if (i == 2) continue; if (i > 4) break; c += 0.1; }", [0.4, 0.4, 0.4]),
        ("int i = 0; do { c.r += 0.25; i++; } while (i < 3); while (i < 5) { c.g += 0.25; i += 1; }", [0.75, 0.5, 0.0]),
        ("float sum = 0.0; c = twice(vec3(0.1, 0.2, 0.3), sum) + vec3(0.0, 0.0, sum);", [0.2, 0.4, 0.6 + 0.6]),
        ("c = all(lessThan(vec2(0.0), vec2(1.0))) && !any(bvec2(false)) ? vec3(0.5) : vec3(0.0);", [0.5, 0.5, 0.5]),
        ("c = vec3(pow(0.5, 2.0), sqrt(0.25), exp2(-1.0));", [0.25, 0.5, 0.5]),
        ("c = clamp(vec3(-1.0, 0.5, 2.0), 0.25, 0.75);", [0.25, 0.5, 0.75]),
        ("c = reflect(vec3(0.5, -0.25, 0.0), vec3(0.0, 1.0, 0.0)) + step(0.5, vec3(0.0, 0.0, 1.0)) * 0.5;", [0.5, 0.25, 0.5]),
        ("Pair p = Pair(0.5, vec2(0.25, 0.75)); c = vec3(p.one, p.two);", [0.5, 0.25, 0.75]),
        ("c = TWO(0.25) * vec3(1.0, half_, quarter[1]);", [0.5, 0.25, 0.125]),
        // A word that is reserved in later versions, and a name that the program has for itself.
        ("float sample = 0.5; float u = 0.25; c = vec3(sample, u, TWO(u));", [0.5, 0.25, 0.5]),
        // Rows of the window go up.
        ("c = vec3(dFdx(gl_FragCoord.x), dFdy(gl_FragCoord.y), 0.5 * fwidth(gl_FragCoord.y));", [1.0, 1.0, 0.5]),
        ("c = vec3(gl_FragCoord.xy / 8.0, gl_FrontFacing ? 0.5 : 0.0);", [4.5 / 8.0, 3.5 / 8.0, 0.5]),
        ("c = vec3(float(gl_MaxLights) / 16.0, float(__VERSION__) / 480.0, 0.0);", [0.5, 0.25, 0.0]),
    ];
    let head = "#version 120\n#define TWO(x) (2.0 * (x))\nstruct Pair { float one; vec2 two; };\nconst float half_ = 1.0 / 2.0;\n\
                const float quarter[2] = float[2](0.0, 0.25);\n\
                vec3 twice(in vec3 v, inout float sum) { sum += v.x + v.y + v.z; return v * 2.0; }\n";
    let mut recording = Recording::new();
    for (k, (statement, _)) in cases.iter().enumerate() {
        let fragment = format!("{head}void main() {{ vec3 c = vec3(0.0); {statement} gl_FragColor = vec4(c, 1.0); }}");
        frame(&mut recording, 2 * k + 1, PASS, &fragment, "");
    }
    near(&recording, &cases);
    // The same in the vertex shader, without what only fragment shaders can read.
    let mut recording = Recording::new();
    let cases: Vec<_> = cases.into_iter().filter(|(text, _)| !text.contains("gl_F")).collect();
    for (k, (statement, _)) in cases.iter().enumerate() {
        let vertex = format!(
            "{head}varying vec3 color; void main() {{ vec3 c = vec3(0.0); {statement} color = c; gl_Position = gl_Vertex; }}"
        );
        let fragment = "varying vec3 color; void main() { gl_FragData[0] = vec4(color, 1.0); }";
        frame(&mut recording, 2 * k + 1, &vertex, fragment, "");
    }
    near(&recording, &cases);
}

#[test]
fn uniforms_of_all_types_reach_both_stages() {
    let declarations = "uniform float f = 0.25; uniform vec3 v; uniform int i; uniform ivec2 iv; uniform bool b; uniform mat2 m2; uniform mat3 m3;\n\
        uniform mat4 m4; uniform float list[4]; uniform vec2 pairs[3]; uniform mat4 bones[2];\n\
        struct Light { vec3 color; float power; vec2 parts[2]; }; uniform Light light; uniform Light lights[2];";
    let calls = "glGetUniformLocation(@,\"v\")=1\nglUniform3fv(1,1,{0.5,0.25,0.75})\nglGetUniformLocation(@,\"i\")=2\nglUniform1i(2,1)\n\
        glGetUniformLocation(@,\"iv\")=3\nglUniform2iv(3,1,{-1,3})\nglGetUniformLocation(@,\"b\")=4\nglUniform1i(4,7)\n\
        glGetUniformLocation(@,\"m2\")=5\nglUniformMatrix2fv(5,1,GL_FALSE,{0.5,0.25,0,1})\n\
        glGetUniformLocation(@,\"m3\")=6\nglUniformMatrix3fv(6,1,GL_TRUE,{0.5,0.25,0.125,0,1,0,0,0,1})\n\
        glGetUniformLocation(@,\"m4\")=7\nglUniformMatrix4fv(7,1,GL_FALSE,{1,0,0,0,0,1,0,0,0,0,1,0,0.25,0.5,0.75,1})\n\
        glGetUniformLocation(@,\"list[0]\")=8\nglUniform1fv(8,2,{0.125,0.25})\nglUniform1f(10,0.5)\nglUniform1fv(11,9,{0.75,9,9,9,9,9,9,9,9})\n\
        glGetUniformLocation(@,\"pairs\")=12\nglUniform2f(14,0.5,0.25)\n\
        glGetUniformLocation(@,\"bones\")=15\nglUniformMatrix4fv(16,1,GL_FALSE,{0.5,0,0,0,0,0.25,0,0,0,0,1,0,0,0,0,1})\n\
        glGetUniformLocation(@,\"light.color\")=20\nglUniform3f(20,0.25,0.5,1)\nglGetUniformLocation(@,\"lights[1].power\")=21\nglUniform1f(21,0.5)\n\
        glGetUniformLocation(@,\"lights[1].parts[0]\")=22\nglUniform2f(23,0.25,0.75)\nglGetUniformLocation(@,\"nowhere\")=-1\nglUniform1f(-1,3)";
    let cases: Vec<(&str, [f64; 3])> = vec![
        ("c = v;", [0.5, 0.25, 0.75]),
        ("c = vec3(f, float(i), b ? 0.5 : 0.0);", [0.25, 1.0, 0.5]),
        ("c = vec3(float(iv.x + 2) * 0.5, float(iv.y) / 4.0, 0.0);", [0.5, 0.75, 0.0]),
        ("c = vec3(m2 * vec2(1.0, 0.5), m2[0].y);", [0.5, 0.75, 0.25]),
        ("c = m3 * vec3(1.0, 0.5, 0.0);", [0.625, 0.5, 0.0]),
        ("c = (m4 * vec4(0.0, 0.0, 0.0, 1.0)).xyz;", [0.25, 0.5, 0.75]),
        ("c = vec3(list[0], list[i], list[i + 2]);", [0.125, 0.25, 0.75]),
        ("c = vec3(pairs[2], list[2]);", [0.5, 0.25, 0.5]),
        ("c = (bones[i] * vec4(1.0)).xyz;", [0.5, 0.25, 1.0]),
        ("c = light.color * lights[i].power;", [0.125, 0.25, 0.5]),
        ("Light one = lights[i]; c = vec3(one.parts[1], one.power);", [0.25, 0.75, 0.5]),
        ("float all[4] = list; c = vec3(all[3], all[i], 0.0);", [0.75, 0.25, 0.0]),
    ];
    for stage in ["vertex", "fragment"] {
        let mut recording = Recording::new();
        for (k, (statement, _)) in cases.iter().enumerate() {
            let head = format!("#version 120\n{declarations}\nvarying vec3 color;");
            let body = format!("vec3 c; {statement}");
            let (vertex, fragment) = match stage {
                "vertex" => (
                    format!("{head} void main() {{ {body} color = c; gl_Position = gl_Vertex; }}"),
                    "varying vec3 color; void main() { gl_FragColor = vec4(color, 1.0); }".to_owned(),
                ),
                _ => (
                    PASS.to_owned(),
                    format!(
                        "{} void main() {{ {body} gl_FragColor = vec4(c, 1.0); }}",
                        head.replace("varying vec3 color;", "")
                    ),
                ),
            };
            frame(&mut recording, 2 * k + 1, &vertex, &fragment, calls);
        }
        near(&recording, &cases);
    }
}

#[test]
fn state_reaches_shaders() {
    let calls = "glMatrixMode(GL_PROJECTION)\nglLoadMatrixf({1,0,0,0,0,1,0,0,0,0,1,0,0,0,0,1})\nglMatrixMode(GL_MODELVIEW)\n\
        glLoadMatrixf({0.5,0,0,0,0,0.25,0,0,0,0,2,0,0.125,0.25,0,1})\nglLightfv(GL_LIGHT2,GL_DIFFUSE,{0.5,0.25,1,1})\n\
        glLightf(GL_LIGHT2,GL_SPOT_EXPONENT,32)\nglLightf(GL_LIGHT2,GL_LINEAR_ATTENUATION,0.5)\n\
        glLightf(GL_LIGHT2,GL_SPOT_CUTOFF,60)\nglMaterialfv(GL_FRONT,GL_DIFFUSE,{0.5,1,0.25,1})\nglMaterialf(GL_BACK,GL_SHININESS,96)\n\
        glFogf(GL_FOG_DENSITY,0.5)\nglFogf(GL_FOG_START,1)\nglFogf(GL_FOG_END,3)\nglFogfv(GL_FOG_COLOR,{0.25,0.5,0.75,1})\n\
        glLightModelfv(GL_LIGHT_MODEL_AMBIENT,{0.125,0.25,0.5,1})\nglPointSize(3)\nglDepthRange(0.25,1)\nglColor3f(0.5,0.25,0.75)\n\
        glMatrixMode(GL_TEXTURE)\nglLoadMatrixf({0.5,0,0,0,0,0.75,0,0,0,0,1,0,0,0,0,1})\nglMatrixMode(GL_MODELVIEW)\n\
        glTexEnvfv(GL_TEXTURE_ENV,GL_TEXTURE_ENV_COLOR,{0.125,0.25,0.5,1})\nglMultiTexCoord2f(GL_TEXTURE1,0.25,0.75)\n\
        glSecondaryColor3f(0.75,0.5,0.25)\nglNormal3f(0.5,0.25,1)\nglFogCoordf(0.5)";
    let cases: Vec<(&str, [f64; 3])> = vec![
        ("c = vec3(gl_ModelViewMatrix[0].x, gl_ModelViewMatrix[1].y, gl_ModelViewMatrix[3].x);", [0.5, 0.25, 0.125]),
        (
            "c = vec3(gl_ModelViewMatrixInverse[1].y / 8.0, gl_ModelViewMatrixTranspose[1].w, gl_ProjectionMatrix[2].z);",
            [0.5, 0.25, 1.0],
        ),
        ("c = gl_NormalMatrix * vec3(0.25, 0.125, 1.0);", [0.5, 0.5, 0.5]),
        ("c = vec3(gl_ModelViewProjectionMatrix[3].xy, gl_TextureMatrix[0][1].y);", [0.125, 0.25, 0.75]),
        ("c = gl_LightSource[2].diffuse.rgb;", [0.5, 0.25, 1.0]),
        (
            "c = vec3(gl_LightSource[2].spotExponent / 64.0, gl_LightSource[2].linearAttenuation, gl_LightSource[2].spotCosCutoff);",
            [0.5, 0.5, 0.5],
        ),
        (
            "for (int i = 0; i < 3; i++) c = vec3(gl_LightSource[i].spotCutoff / 240.0, gl_FrontLightProduct[i].diffuse.rg);",
            [0.25, 0.25, 0.25],
        ),
        ("c = vec3(gl_FrontMaterial.diffuse.rb, gl_BackMaterial.shininess / 128.0);", [0.5, 0.25, 0.75]),
        ("c = vec3(gl_Fog.density, gl_Fog.start / gl_Fog.end, gl_Fog.scale) * gl_Fog.color.rgb;", [0.125, 0.5 / 3.0, 0.375]),
        ("c = vec3(gl_LightModel.ambient.rg, gl_Point.size / 4.0);", [0.125, 0.25, 0.75]),
        ("c = vec3(gl_DepthRange.near, gl_DepthRange.far, gl_DepthRange.diff);", [0.25, 1.0, 0.75]),
        ("c = gl_TextureEnvColor[0].rgb;", [0.125, 0.25, 0.5]),
    ];
    let mut recording = Recording::new();
    for (k, (statement, _)) in cases.iter().enumerate() {
        let fragment = format!("void main() {{ vec3 c = vec3(0.0); {statement} gl_FragColor = vec4(c, 1.0); }}");
        frame(&mut recording, 2 * k + 1, PASS, &fragment, calls);
    }
    near(&recording, &cases);
    // Attributes, and what fixed fragments take of a vertex shader.
    let cases: Vec<(&str, [f64; 3])> = vec![
        ("gl_FrontColor = gl_Color;", [0.5, 0.25, 0.75]),
        ("gl_FrontColor = gl_SecondaryColor;", [0.75, 0.5, 0.25]),
        ("gl_FrontColor = vec4(gl_Normal.xy, gl_FogCoord, 1.0);", [0.5, 0.25, 0.5]),
        ("gl_FrontColor = vec4(gl_MultiTexCoord1.xy, 0.0, 1.0);", [0.25, 0.75, 0.0]),
        // Clamped, as colours of vertices are.
        ("gl_FrontColor = vec4(2.0, -1.0, 0.5, 1.0);", [1.0, 0.0, 0.5]),
        ("gl_FrontColor = ftransform() * 0.25 + 0.5;", [0.1875 / 4.0 + 0.5, 0.21875 / 4.0 + 0.5, 0.5]),
    ];
    let mut recording = Recording::new();
    for (k, (statement, _)) in cases.iter().enumerate() {
        let vertex = format!("void main() {{ {statement} gl_Position = gl_Vertex; }}");
        frame(&mut recording, 2 * k + 1, &vertex, "", calls);
    }
    near(&recording, &cases);
}

#[test]
fn values_go_from_stage_to_stage() {
    // Declarations of both stages, what the vertex shader writes, and the colour.
    let cases: Vec<(&str, &str, &str, [f64; 3])> = vec![
        ("varying vec2 a; varying float b;", "a = gl_Vertex.xy; b = 0.75;", "vec3(a * 4.0, b)", [0.5, -0.5, 0.75]),
        ("varying mat3 m;", "m = mat3(0.25); m[1].x = 0.5;", "vec3(m[0].x, m[1].x, m[2].z)", [0.25, 0.5, 0.25]),
        ("varying vec2 l[2];", "l[0] = vec2(0.25, 0.5); l[1] = vec2(0.75);", "vec3(l[0], l[1].y)", [0.25, 0.5, 0.75]),
        (
            "varying vec4 gl_TexCoord[2];",
            "gl_TexCoord[1] = vec4(0.5, 0.25, 0.75, 1.0);",
            "gl_TexCoord[1].rgb",
            [0.5, 0.25, 0.75],
        ),
        ("invariant varying highp vec3 v;", "v = vec3(0.25);", "v", [0.25; 3]),
        (
            "",
            "gl_FrontColor = vec4(0.5); gl_FrontSecondaryColor = vec4(0.25); gl_FogFragCoord = 0.75;",
            "vec3(gl_Color.r, gl_SecondaryColor.g, gl_FogFragCoord)",
            [0.5, 0.25, 0.75],
        ),
    ];
    let mut recording = Recording::new();
    for (k, (declarations, writes, color, _)) in cases.iter().enumerate() {
        let vertex = format!("{declarations} void main() {{ {writes} gl_Position = gl_Vertex; }}");
        let fragment = format!("{declarations} void main() {{ gl_FragColor = vec4({color}, 1.0); }}");
        frame(&mut recording, 2 * k + 1, &vertex, &fragment, "");
    }
    // Flat: whole numbers of the last vertex; an output of a name of its own, and one at a location.
    frame(
        &mut recording,
        31,
        "#version 130\nin vec4 place; flat out int n; void main() { n = 3; gl_Position = place; }",
        "#version 130\nflat in int n; out vec3 shown; void main() { shown = vec3(float(n) / 4.0, 0.5, 0.25); }",
        "glBindAttribLocation(@,0,\"place\")",
    );
    frame(
        &mut recording,
        33,
        "#version 330\nlayout(location = 0) in vec4 place; out vec3 v; void main() { v = vec3(0.5); gl_Position = place; }",
        "#version 330\nin vec3 v; layout(location = 1) out vec4 other; layout(location = 0) out vec4 shown;\n\
         void main() { other = vec4(1.0); shown = vec4(v, 1.0); }",
        "",
    );
    let mut wanted: Vec<(&str, [f64; 3])> = cases.iter().map(|&(name, .., wanted)| (name, wanted)).collect();
    wanted.extend([("flat", [0.75, 0.5, 0.25]), ("locations", [0.5; 3])]);
    near(&recording, &wanted);
}

#[test]
fn textures_are_read_in_all_ways() {
    let texels: Vec<u8> = (0..4).flat_map(|k| [40 * k, 200 - 40 * k, 100, 255]).collect();
    let texel = |k: f64| [40.0 * k / 255.0, (200.0 - 40.0 * k) / 255.0, 100.0 / 255.0];
    let cases: Vec<(&str, [f64; 3])> = vec![
        ("texture2D(t, vec2(0.75, 0.25))", texel(1.0)),
        ("texture2D(t, vec2(0.25, 0.75), 0.0)", texel(2.0)),
        ("texture2DProj(t, vec3(1.5, 0.5, 2.0))", texel(1.0)),
        ("texture2DProj(t, vec4(1.5, 1.5, 9.0, 2.0))", texel(3.0)),
        ("texture2DLod(t, vec2(0.75), 0.0)", texel(3.0)),
        ("texture2DGradARB(t, vec2(0.25), vec2(0.01), vec2(0.01))", texel(0.0)),
        ("twice(texture2D(t, texture2D(t, vec2(0.75)).rg))", texel(0.0).map(|v| 2.0 * v)),
        ("texture(t, vec2(0.75))", texel(3.0)),
        ("texelFetch(t, ivec2(1, 0), 0)", texel(1.0)),
        ("vec4(vec2(textureSize(t, 0)) / 4.0, 0.0, 1.0)", [0.5, 0.5, 0.0]),
        ("vec4(vec2(textureSize(other, 0)), 0.25, 1.0)", [0.0, 0.0, 0.25]),
        // A unit without a texture is black.
        ("textureCube(other, vec3(0.5)) + vec4(0.0, 0.5, 0.0, 0.0)", [0.0, 0.5, 0.0]),
    ];
    let head = "uniform sampler2D t; uniform samplerCube other; vec4 twice(vec4 v) { return 2.0 * v; }";
    let calls = "glGetUniformLocation(@,\"t\")=3\nglUniform1i(3,2)\nglGetUniformLocation(@,\"other\")=4\nglUniform1i(4,1)";
    let mut recording = Recording::new();
    recording.add("glActiveTexture(GL_TEXTURE2)").texture("GL_RGBA", [2, 2], "GL_RGBA", &texels);
    for (k, (expression, _)) in cases.iter().enumerate() {
        frame(&mut recording, 4 * k + 1, PASS, &format!("{head} void main() {{ gl_FragColor = {expression}; }}"), calls);
    }
    near(&recording, &cases);
    // A vertex shader reads the level that it names, or the largest.
    let mut recording = Recording::new();
    recording.add("glActiveTexture(GL_TEXTURE2)").texture("GL_RGBA", [2, 2], "GL_RGBA", &texels);
    let cases = &cases[..5];
    for (k, (expression, _)) in cases.iter().enumerate() {
        let expression =
            expression.replace(", 0.0)", ")").replace("texture2DLod(t, vec2(0.75)", "texture2DLod(t, vec2(0.75), 0.0");
        let vertex = format!("{head} varying vec4 c; void main() {{ c = {expression}; gl_Position = gl_Vertex; }}");
        frame(&mut recording, 4 * k + 1, &vertex, "varying vec4 c; void main() { gl_FragColor = c; }", calls);
    }
    near(&recording, cases);
}

#[test]
fn each_sampler_of_an_array_has_a_unit_of_its_own() {
    // Units 1 to 3 have one colour each.
    let colors: [[u8; 4]; 3] = [[64, 0, 0, 255], [0, 128, 0, 255], [0, 0, 191, 255]];
    let head = "uniform sampler2D t[3]; uniform sampler2D other;";
    let body = "void main() { gl_FragColor = texture2D(t[0], vec2(0.5)) + 0.5 * texture2D(t[1], vec2(0.5)) + texture2D(t[2], vec2(0.5), 0.0)\n\
        + 0.0 * texture2D(other, vec2(0.5)); }";
    // Set together, one by one, and from the second on.
    let all = "glGetUniformLocation(@,\"t\")=3\nglUniform1iv(3,3,{3,2,1})";
    let each = "glGetUniformLocation(@,\"t[0]\")=5\nglUniform1i(5,1)\nglUniform1i(6,2)\nglGetUniformLocation(@,\"t[2]\")=7\nglUniform1i(7,3)";
    let rest = "glGetUniformLocation(@,\"t\")=5\nglUniform1i(5,2)\nglUniform1iv(6,2,{3,1})";
    let cases = [(all, [0.25, 0.25, 0.75]), (each, [0.25, 0.25, 0.75]), (rest, [0.25, 0.5, 0.375])];
    let mut recording = Recording::new();
    for (k, color) in colors.iter().enumerate() {
        recording.add(&format!("glActiveTexture(GL_TEXTURE{})\nglBindTexture(GL_TEXTURE_2D,{})", k + 1, k + 1));
        recording.texture("GL_RGBA", [1, 1], "GL_RGBA", color);
    }
    for (k, (calls, _)) in cases.iter().enumerate() {
        frame(&mut recording, 4 * k + 1, PASS, &format!("{head} {body}"), calls);
    }
    // Parameters of functions: a sampler, an element of an array, an array.
    let body = "vec4 of(sampler2D s, float k) { return k * texture2D(s, vec2(0.5)); }\n\
        vec4 last(sampler2D s[3], sampler2D o) { return of(s[2], 1.0) + 0.0 * texture2D(o, vec2(0.5)); }\n\
        void main() { gl_FragColor = of(t[0], 1.0) + of(t[1], 0.5) + last(t, other); }";
    for (k, (calls, _)) in cases.iter().enumerate() {
        frame(&mut recording, 4 * k + 21, PASS, &format!("{head} {body}"), calls);
    }
    near(&recording, &[cases, cases].concat());
    // A location in the declaration.
    let text = "#version 430\nlayout(location = 4) uniform sampler2D[2] t; out vec4 c;\n\
        void main() { c = texture(t[0], vec2(0.5)) + texture(t[1], vec2(0.5)); }";
    let mut recording = Recording::new();
    for (k, color) in colors.iter().enumerate() {
        recording.add(&format!("glActiveTexture(GL_TEXTURE{})\nglBindTexture(GL_TEXTURE_2D,{})", k + 1, k + 1));
        recording.texture("GL_RGBA", [1, 1], "GL_RGBA", color);
    }
    frame(&mut recording, 1, PASS, text, "glUniform1i(4,1)\nglUniform1i(5,2)");
    near(&recording, &[("location", [0.25, 0.5, 0.0])]);
}

#[test]
fn what_is_not_supported_is_named_with_its_line() {
    let refusal = |vertex: &str, fragment: &str| {
        let mut recording = Recording::new();
        frame(&mut recording, 1, vertex, fragment, "");
        recording.import().expect("a recording").1.refusal().unwrap_or_default()
    };
    for (text, wanted) in [
        ("void main() {\n gl_FragColor = vec4(nothing); }", "fragment shader, line 2: Unknown variable: nothing"),
        ("void main() { gl_FragColor = vec4(1.0) }", "fragment shader, line 1: `;` is expected, not `}`"),
        ("\n\nvoid main() { gl_FragColor = gl_Nonsense; }", "fragment shader, line 3: gl_Nonsense is not supported"),
        (
            "#version 150 compatibility\nin Block { vec4 a; };\nvoid main() { gl_FragColor = a; }",
            "line 2: the interface block Block is not supported",
        ),
        (
            "layout(row_major) uniform Block { mat2 a; };\nvoid main() {}",
            "line 1: row_major in a uniform block is not supported",
        ),
        ("layout(row_major) uniform;\nvoid main() {}", "line 1: row_major in a uniform block is not supported"),
        (
            "uniform Block { layout(row_major) mat2 a; };\nvoid main() {}",
            "line 1: row_major in a uniform block is not supported",
        ),
        ("uniform Block { vec4 a; } b[2];\nvoid main() {}", "line 1: the array of the uniform block Block is not supported"),
        (
            "uniform sampler2D t[2];\nvoid main() { for (int i = 0; i < 2; i++) gl_FragColor += texture2D(t[i], vec2(0.0)); }",
            "line 2: the array t of samplers with an index that is no number is not supported",
        ),
        (
            "uniform sampler2D t[2];\nvoid main() { gl_FragColor = texture2D(t[2], vec2(0.0)); }",
            "element 2 of the array t of 2",
        ),
        (
            "const int n = 2;\nuniform sampler2D t[n];\nvoid main() {}",
            "line 2: the array t of samplers, whose size is no number",
        ),
        (
            "vec4 f(sampler2D s) { return texture2D(s, vec2(0.5)); }\nuniform sampler2D t[2]; uniform int i;\n\
             void main() { gl_FragColor = f(t[i]); }",
            "line 3: a call of the function f whose samplers are not those of its parameters is not supported",
        ),
        ("uniform usampler2D t;\nvoid main() {}", "line 1: the type usampler2D is not supported"),
        ("void f() {}", "fragment shader: "),
        ("(1)\nvoid main() {}", "fragment shader, line 1: "),
        (
            "varying vec3 missing;\nvoid main() { gl_FragColor = vec4(missing, 1.0); }",
            "the vertex shader does not write missing",
        ),
        ("#if 1\nvoid main() {}", "line 1: a conditional block without `#endif`"),
        (
            "void main() { for (int i = 0; i < 3; i++) gl_FragColor = gl_TexCoord[i]; }",
            "gl_TexCoord without a number in brackets",
        ),
    ] {
        let refusal = refusal(PASS, text);
        assert!(refusal.contains("drawing with GLSL program 12: ") && refusal.contains(wanted), "{text}: {refusal}");
    }
    let clip = "void main() { gl_Position = gl_Vertex; }";
    let mut recording = Recording::new();
    recording.add("glEnable(GL_CLIP_PLANE0)");
    frame(&mut recording, 1, clip, "", "");
    let refused = recording.import().expect("a recording").1.refusal().unwrap_or_default();
    assert!(refused.contains("clip planes with a vertex shader without gl_ClipVertex"), "{refused}");
    // Uniforms at a location that the program never queried.
    let mut recording = Recording::new();
    frame(&mut recording, 1, PASS, "uniform float x; void main() { gl_FragColor = vec4(x); }", "glUniform1f(5,1)");
    let refused = recording.import().expect("a recording").1.refusal().unwrap_or_default();
    assert!(refused.contains("uniforms at locations that the recording does not name"), "{refused}");
}

#[test]
fn clip_planes_cut_at_the_clip_vertex() {
    let mut recording = Recording::new();
    let vertex = |x: &str| {
        format!(
            "void main() {{ gl_ClipVertex = vec4({x}, 0.0, 0.0, 1.0); gl_FrontColor = vec4(0.5); gl_Position = gl_Vertex; }}"
        )
    };
    recording.add("glEnable(GL_CLIP_PLANE0)\nglClipPlane(GL_CLIP_PLANE0,{1,0,0,0})");
    frame(&mut recording, 1, &vertex("1.0"), "", "");
    recording.add("glClear(GL_COLOR_BUFFER_BIT)");
    frame(&mut recording, 3, &vertex("-1.0"), "", "");
    near(&recording, &[("kept", [0.5; 3]), ("cut", [0.0; 3])]);
}

#[test]
fn a_location_is_no_neighbour_of_a_uniform_that_is_no_array() {
    // An explicit location after one that was queried, and a location after a sampler.
    let fragment = "#version 430\nlayout(location = 6) uniform float b; uniform float a; uniform sampler2D t; out vec4 c;\n\
                    void main() { c = vec4(a, b, 0.0, 1.0) + texture(t, vec2(0.0)) * 0.0; }";
    let asked = "glGetUniformLocation(@,\"a\")=5\nglUniform1f(5,0.5)\nglUniform1f(6,0.25)";
    let mut recording = Recording::new();
    frame(&mut recording, 1, PASS, fragment, asked);
    near(&recording, &[("both", [0.5, 0.25, 0.0])]);
    let mut recording = Recording::new();
    frame(&mut recording, 1, PASS, fragment, "glGetUniformLocation(@,\"t\")=7\nglUniform1i(8,3)");
    let refused = recording.import().expect("a recording").1.refusal().unwrap_or_default();
    assert!(refused.contains("uniforms at locations that the recording does not name"), "{refused}");
}

#[test]
fn a_program_that_was_never_linked_is_not_used() {
    let mut recording = Recording::new();
    recording.add("glCreateProgram()=5\nglUseProgram(5)\nglColor3f(0.5,0.25,1)\nglRectf(-1,-1,1,1)").end_frame();
    let (_, report) = recording.import().expect("a recording");
    assert!(
        report.refusal().is_none() && report.errors.get("glUseProgram: GL_INVALID_OPERATION").is_some(),
        "{:?}",
        report.errors
    );
    assert_eq!(report.shaders.len(), 1, "the fixed functions draw");
}
