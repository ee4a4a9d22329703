//! Wide points and lines as triangles.

use std::fmt::Write;

use crate::key::{Expand, ShaderKey};
use crate::wgsl::{attributes, location};

/// Attributes beside the position of a vertex program that runs for both ends of a line, at most: each has two locations.
pub const BOTH_ENDS_MAX: u32 = 14;

/// The locations of the other end's attributes, in the order of the attributes: those that are free.
pub fn far_locations(key: &ShaderKey) -> Vec<u32> {
    let used: Vec<u32> = attributes(key).into_iter().map(|(location, ..)| location).collect();
    let own = [location::POSITION, location::CORNER, location::OTHER, location::OFFSET];
    let free = (0..2 * location::GENERIC).filter(|at| !own.contains(at) && !used.contains(at));
    free.take(used.len()).collect()
}

/// The vertex stage of a line that becomes triangles, where a program computes positions: it runs for both ends, and what lies outside of the
/// view volume is cut off here. `varyings` are names of values, and whether they are those of one vertex for the whole line.
pub(crate) fn line_of_program(key: &ShaderKey, varyings: &[(String, bool)], out: &mut String) {
    line!(out, "@vertex fn vs(v: Input) -> Varying {{\n    var at_far = v;\n    at_far.position = v.other;");
    for (_, name, _) in attributes(key) {
        line!(out, "    at_far.{name} = v.far_{name};");
    }
    line!(out, "    var o = line_end(v);\n    let far = line_end(at_far);");
    line!(out, "    let ends = array(o.position, far.position);\n    var cut = vec2f(0, 1);");
    // Smooth lines end softly where they leave the window, as in Mesa: they are cut at all its planes.
    let planes = ["e.z", "e.w - e.z", "e.w + e.x", "e.w - e.x", "e.w + e.y", "e.w - e.y"];
    for plane in &planes[..if key.expand == Expand::SmoothLine { 6 } else { 1 }] {
        let [a, b] = ["ends[0]", "ends[1]"].map(|end| plane.replace("e.", &format!("{end}.")));
        line!(out, "    {{\n        let a = {a};\n        let b = {b};");
        line!(out, "        if a < 0.0 {{\n            cut.x = max(cut.x, select(2.0, a / (a - b), b >= 0.0));");
        line!(out, "        }} else if b < 0.0 {{\n            cut.y = min(cut.y, a / (a - b));\n        }}\n    }}");
    }
    line!(out, "    o.position = mix(ends[0], ends[1], cut.x);");
    for (name, _) in varyings.iter().filter(|(_, flat)| !flat) {
        line!(out, "    o.{name} = mix(o.{name}, far.{name}, cut.x);");
    }
    expand(key, out);
    line!(out, "    if !(cut.x < cut.y) {{\n        o.position = vec4f(0, 0, -1, 1);\n    }}\n    return o;\n}}");
}

/// Points and lines as triangles: `corner` is from -1 to 1.
pub(crate) fn expand(key: &ShaderKey, out: &mut String) {
    match key.expand {
        Expand::No => {}
        Expand::Point | Expand::SmoothPoint => {
            let size = if key.vertex.is_some_and(|vertex| vertex.size) { "out_size.x" } else { "u.screen.z" };
            line!(out, "    var size = {size};");
            if key.attenuated_point {
                // The distance is that from the plane of the eye, as in Mesa.
                line!(out, "    let distance = abs(eye.z);\n    let terms = u.point_attenuation;");
                line!(out, "    size *= inverseSqrt(max(terms.x + distance * (terms.y + distance * terms.z), 1e-30));");
                line!(out, "    size = clamp(size, u.point_limits.x, u.point_limits.y);");
            }
            // Without smoothing, sizes are whole; those that do not differ between points have been made so. Sprites have any size.
            let differ = key.attenuated_point || size != "u.screen.z";
            if differ && key.expand == Expand::Point && !key.units.iter().any(|unit| unit.sprite) {
                line!(out, "    size = max(ceil(size - 0.5), 1.0);");
            }
            // The discs of small points have at least two pixels, as in Mesa.
            let least = if key.expand == Expand::SmoothPoint { "2.0" } else { "1.0" };
            let reach = format!("0.5 * max(size, {least})");
            line!(out, "    let reach = {reach};");
            // A point is clipped by its centre.
            line!(out, "    let p = o.position;");
            line!(out, "    let inside = all(abs(p.xy) <= vec2f(p.w)) && p.z >= 0.0 && p.z <= p.w;");
            line!(
                out,
                "    o.position = select(vec4f(0, 0, -1, 1), vec4f(p.xy + v.corner * reach / u.screen.xy * p.w, p.zw), inside);"
            );
            let half = if key.expand == Expand::SmoothPoint { "reach" } else { "0.5 * size" };
            line!(out, "    o.corner = vec4f(v.corner * reach, {half}, 0.0);");
        }
        Expand::Line | Expand::SmoothLine => {
            // corner.x is the side, corner.y the end: -1 the first, 1 the second.
            let other = if key.both_ends() { "mix(ends[0], ends[1], cut.y)" } else { "u.mvp * v.other" };
            line!(out, "    let q = {other};\n    let p = o.position;");
            line!(out, "    let way = -v.corner.y * (q.xy / q.w - p.xy / p.w) * u.screen.xy;");
            if key.expand == Expand::Line {
                line!(out, "    let across = select(vec2f(1, 0), vec2f(0, 1), abs(way.x) >= abs(way.y));");
                // A pixel belongs to a line that leaves its diamond (OpenGL 1.5, section 3.4.1): an end beyond the middle of a pixel, but
                // within its diamond, is drawn back before the middle.
                line!(out, "    let steep = abs(way.x) < abs(way.y);");
                line!(out, "    let run = select(way, way.yx, steep);");
                line!(out, "    let window = (p.xy / p.w + vec2f(1)) * u.screen.xy;");
                line!(out, "    let at = select(window, window.yx, steep);");
                line!(out, "    let slope = run.y / select(run.x, 1.0, run.x == 0.0);");
                line!(out, "    let beyond = fract(at.x) - 0.5;");
                line!(out, "    let aside = at.y - floor(at.y - beyond * slope) - 0.5;");
                line!(out, "    let back = beyond * run.x > 0.0 && abs(beyond) + abs(aside) < 0.5;");
                line!(out, "    let shift = select(0.0, -beyond - sign(run.x) / 64.0, back) * vec2f(1, slope);");
                line!(out, "    let by = v.corner.x * 0.5 * u.screen.z * across + select(shift, shift.yx, steep);");
                line!(out, "    o.corner = vec4f();");
            } else {
                line!(out, "    let along = way * inverseSqrt(max(dot(way, way), 1e-30));");
                // Edges and ends are soft over one pixel.
                line!(out, "    let reach = 0.5 * max(u.screen.z, 1.0) + 0.5;\n    let half = 0.5 * length(way);");
                // A line shorter than a pixel gets fainter, as in Mesa.
                line!(out, "    let soft = select(half + 0.5, 2.0 * half, half < 0.5);");
                line!(out, "    let by = v.corner.x * reach * vec2f(-along.y, along.x) + v.corner.y * 0.5 * along;");
                line!(out, "    o.corner = vec4f(v.corner.x * reach, v.corner.y * soft, reach, soft);");
            }
            line!(out, "    o.position = vec4f(p.xy + by / u.screen.xy * p.w, p.zw);");
        }
    }
}
