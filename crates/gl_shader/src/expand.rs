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
    // A line ends where its middle leaves the view volume.
    for plane in ["e.z", "e.w - e.z", "e.w + e.x", "e.w - e.x", "e.w + e.y", "e.w - e.y"] {
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

/// Points and lines as triangles: `corner` is from -1 to 1. They may reach out of the viewport: that of the draw is larger about the same
/// middle, and `part` is the size of the program's in it.
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
                line!(out, "    let steep = abs(way.x) < abs(way.y);");
                diamonds(out);
                line!(
                    out,
                    "    let by = v.corner.x * 0.5 * u.screen.z * across + select(shift, shift.yx, steep) * vec2f(1, -1);"
                );
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
    if key.expand != Expand::No {
        line!(out, "    o.position = vec4f(o.position.xy * u.part.xy, o.position.zw);");
    }
}

/// Which columns of pixels (rows, of a steep line) a line draws at its ends: a pixel belongs to it if the line leaves the diamond about the
/// pixel's middle (OpenGL 1.5, section 3.4.1). The card draws a column if its middle lies between the ends; where that is not the same, an end
/// moves back along the line, just before the middle. As Mesa does, the test takes a line that does not come near the middle of the column to
/// cross it at the mirrored height, and rows are counted downward.
fn diamonds(out: &mut String) {
    line!(out, "    let down = way * vec2f(1, -1);");
    line!(out, "    let run = select(down, down.yx, steep);");
    // On the card's grid: what rounding adds to an end in the middle of a pixel would decide otherwise.
    line!(out, "    let window = round((p.xy / p.w + vec2f(1)) * u.screen.xy * 256.0) / 256.0 * vec2f(1, -1);");
    line!(out, "    let at = select(window, window.yx, steep);");
    line!(out, "    let slope = run.y / select(run.x, 1.0, run.x == 0.0);");
    line!(out, "    let begins = v.corner.y < 0.0;");
    line!(out, "    var off = fract(at) - vec2f(0.5);");
    line!(out, "    if !begins && off.y == -0.5 && run.y > 0.0 {{\n        off.y = 0.5;\n    }}");
    line!(out, "    let inside = abs(off.x) + abs(off.y) < 0.5;");
    line!(out, "    let turn = select(1.0, -1.0, steep);");
    line!(out, "    let beyond = (turn * off.x >= 0.0) == (turn * run.x >= 0.0);");
    line!(out, "    let apart = (-turn * off.y >= 0.0) == (-turn * run.y >= 0.0);");
    line!(out, "    let height = fract(at.y) + off.x * slope;");
    line!(out, "    let crosses = (height > 0.0 || steep && !begins && height == 0.0) && height < 1.0;");
    line!(out, "    let begun = inside || !beyond && (!apart || crosses);");
    line!(out, "    let ended = !inside && beyond && (apart || crosses);");
    // A middle at the very end is drawn at a left end, and at an upper or lower one by the rule of the target.
    line!(out, "    let before = select(off.x <= 0.0, off.x < 0.0, steep && u.screen.w != 0.0);");
    line!(out, "    let covered = ((run.x > 0.0) == before) == begins;");
    line!(out, "    let back = select(covered && !ended, begun && !covered, begins);");
    line!(out, "    let shift = select(0.0, -off.x - sign(run.x) / 64.0, back) * vec2f(1, slope);");
}
