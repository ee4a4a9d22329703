//! WGSL of lighting, and of the colours of a vertex.

use std::fmt::Write;

use crate::key::ShaderKey;

/// Lighting of one side (OpenGL 1.5, section 2.14.1).
pub(crate) fn light(key: &ShaderKey, out: &mut String) {
    let Some(lighting) = &key.lighting else { return };
    line!(out, "struct Lit {{ primary: vec4f, secondary: vec3f }}");
    line!(out, "fn light(eye: vec3f, n: vec3f, ambient: vec3f, diffuse: vec4f, specular: vec4f, emission: vec3f) -> Lit {{");
    line!(out, "    var sum = emission + ambient * u.model_ambient.rgb;\n    var shine = vec3f();");
    for (k, of) in lighting.lights.iter().enumerate() {
        line!(out, "    {{ // light {k}");
        if of.directional {
            line!(out, "        let l = u.light{k}[3].xyz;");
        } else {
            // One root gives the direction and the distance. A light at the vertex has no direction, and one so far away that the square of
            // its distance is no number has none either, as in Mesa.
            line!(out, "        let way = u.light{k}[3].xyz - eye;\n        let square = max(dot(way, way), 1e-37);");
            line!(out, "        let near = inverseSqrt(square);\n        let l = way * near;");
            if of.attenuated {
                line!(out, "        let distance = select(1e30, square * near, near > 0.0);");
                line!(out, "        let terms = u.light{k}[5];");
                line!(out, "        let attenuation = 1.0 / (terms.y + distance * (terms.z + distance * terms.w));");
            }
        }
        if of.spot {
            line!(out, "        let spot = -dot(l, u.light{k}[6].xyz);");
            line!(out, "        let cone = select(0.0, pow(max(spot, 1e-30), u.light{k}[5].x), spot >= u.light{k}[6].w);");
        }
        let strength = match (of.attenuated && !of.directional, of.spot) {
            (false, false) => None,
            (true, false) => Some("attenuation"),
            (false, true) => Some("cone"),
            (true, true) => Some("attenuation * cone"),
        };
        // Products of a light and a material that no vertex changes are made once for a draw.
        line!(out, "        let facing = dot(n, l);");
        let product = format!("ambient * u.light{k}[0].rgb + max(facing, 0.0) * (diffuse.rgb * u.light{k}[1].rgb)");
        match strength {
            None => line!(out, "        sum += {product};"),
            Some(strength) => line!(out, "        let strength = {strength};\n        sum += strength * ({product});"),
        }
        if lighting.specular {
            let half = match (lighting.local_viewer, of.directional) {
                (true, _) => "normalize(l - normalize(eye))".to_owned(),
                (false, true) => format!("u.light{k}[4].xyz"),
                (false, false) => "normalize(l + vec3f(0, 0, 1))".to_owned(),
            };
            // An exponent of 0 gives 1 even where the base is 0.
            line!(out, "        let gloss = pow(max(dot(n, {half}), 1e-30), specular.w);");
            let gloss = if strength.is_some() { "strength * gloss" } else { "gloss" };
            line!(out, "        shine += select(0.0, {gloss}, facing > 0.0) * (specular.rgb * u.light{k}[2].rgb);");
        }
        line!(out, "    }}");
    }
    let (primary, secondary) = if lighting.separate { ("sum", "shine") } else { ("sum + shine", "vec3f()") };
    line!(out, "    return Lit(saturate(vec4f({primary}, diffuse.a)), saturate({secondary}));\n}}");
}

/// Colours of a vertex in the fixed-function vertex stage.
pub(crate) fn colors(key: &ShaderKey, out: &mut String) {
    let Some(lighting) = &key.lighting else {
        line!(out, "    o.color = saturate(color);");
        if key.secondary() {
            line!(
                out,
                "    o.secondary = saturate({});",
                if key.varying.secondary { "v.secondary" } else { "u.secondary.rgb" }
            );
        }
        return;
    };
    let eye = if key.eye() { "eye" } else { "vec3f()" };
    let mut side = |face: usize, color: &str, secondary: &str| {
        let material = ["u.front_material", "u.back_material"][face];
        let tracks = |bit: u8| lighting.color_material[face] & 1 << bit != 0;
        let term = |bit: u8, k: usize, part: &str| {
            if tracks(bit) { format!("color{part}") } else { format!("{material}[{k}]{part}") }
        };
        let specular = if tracks(2) { format!("vec4f(color.rgb, {material}[2].w)") } else { format!("{material}[2]") };
        let n = match (key.normal(), face) {
            (false, _) => "vec3f()",
            (true, 0) => "n",
            (true, _) => "-n",
        };
        line!(
            out,
            "    let lit{face} = light({eye}, {n}, {}, {}, {specular}, {});",
            term(0, 0, ".rgb"),
            term(1, 1, ""),
            term(3, 3, ".rgb")
        );
        line!(out, "    o.{color} = lit{face}.primary;");
        if key.secondary() {
            let sum = match (key.color_sum && !lighting.separate, key.varying.secondary) {
                (true, true) => " + v.secondary",
                (true, false) => " + u.secondary.rgb",
                _ => "",
            };
            line!(out, "    o.{secondary} = saturate(lit{face}.secondary{sum});");
        }
    };
    if lighting.two_side {
        side(0, "color", "secondary");
        side(1, "back_color", "back_secondary");
    } else {
        side(usize::from(key.back), "color", "secondary");
    }
}
