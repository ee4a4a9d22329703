//! Section F: what the fixed functions of OpenGL 1.5 give, in closed form. The checks write recorded calls themselves; they are imported and
//! replayed as a recording is.

pub mod recording;

mod light;
mod pixel;
mod texture;

use anyhow::{Result, ensure};
use glam::DVec3;

use super::{Row, Section, Target};
use num::Random;
use recording::Recording;

/// Targets of the section, in order.
pub const TARGETS: &[Target] = &[
    Target {
        id: "gl-light",
        section: Section::Gl,
        what: "The lighting equation: emission and ambient, directional and positional lights, attenuation, spots, specular terms of \
               both viewers, back faces, colour material, normals that are normalised or rescaled",
        bound: "1 of 255",
        fault: "normals reach the machine with y and z exchanged, colours halved",
        check: light::check,
    },
    Target {
        id: "gl-environment",
        section: Section::Gl,
        what: "Texture environments: each mode with each base format, colour and alpha",
        bound: "1 of 255",
        fault: "texels are inverted on their way to the machine",
        check: texture::environments,
    },
    Target {
        id: "gl-combine",
        section: Section::Gl,
        what: "Texture combiners: each function of colour and alpha, each source, operand and scale",
        bound: "1 of 255",
        fault: "texels are inverted on their way to the machine",
        check: texture::combiners,
    },
    Target {
        id: "gl-generation",
        section: Section::Gl,
        what: "Generated texture coordinates: each mode and coordinate, in a texture whose colour is its coordinate",
        bound: "1 of 255",
        fault: "planes and normals reach the machine with x and y exchanged",
        check: texture::generation,
    },
    Target {
        id: "gl-fog",
        section: Section::Gl,
        what: "Fog: linear, exp and exp2, by the distance and by the fog coordinate",
        bound: "1 of 255",
        fault: "what is drawn lies 30 % farther away",
        check: pixel::fog,
    },
    Target {
        id: "gl-blend",
        section: Section::Gl,
        what: "Blending of colours that have 8 bits: each factor of source and destination, each equation",
        bound: "1 of 255",
        fault: "the destination is inverted before it is blended with",
        check: pixel::blend,
    },
];

/// Frames that are drawn, and the colour that each must have.
#[derive(Default)]
struct Cases {
    recording: Recording,
    list: Vec<(String, [f64; 3])>,
}

impl Cases {
    /// A frame: state that these calls change is put back after it. Colours from 0 to 1; they are clamped here.
    fn frame(&mut self, name: impl Into<String>, calls: &str, expected: [f64; 3]) {
        self.recording.add("glPushAttrib(GL_ALL_ATTRIB_BITS)\nglClear(GL_COLOR_BUFFER_BIT)").add(calls).add("glPopAttrib()");
        self.recording.end_frame();
        self.list.push((name.into(), expected.map(|value| 255.0 * value.clamp(0.0, 1.0))));
    }

    /// A frame whose colour is the alpha of what is drawn.
    fn alpha(&mut self, name: impl Into<String>, calls: &str, expected: f64) {
        let over_white =
            "glClearColor(1,1,1,1)\nglClear(GL_COLOR_BUFFER_BIT)\nglEnable(GL_BLEND)\nglBlendFunc(GL_ZERO,GL_SRC_ALPHA)\n";
        self.frame(name, &format!("{over_white}{calls}"), [expected; 3]);
    }

    /// A row for each name: the channel that is farthest off.
    fn rows(self) -> Result<Vec<Row>> {
        let seen = self.recording.centers()?;
        ensure!(seen.len() == self.list.len(), "{} frames of {}", seen.len(), self.list.len());
        let mut rows: Vec<Row> = Vec::new();
        for ((name, expected), seen) in self.list.into_iter().zip(seen) {
            for (expected, seen) in expected.into_iter().zip(seen) {
                let row = Row::within(name.clone(), expected, seen, 1.0);
                match rows.iter_mut().find(|known| known.case == name) {
                    Some(known) if known.error >= row.error => {}
                    Some(known) => *known = row,
                    None => rows.push(row),
                }
            }
        }
        Ok(rows)
    }
}

/// Numbers as arguments of a call.
fn list(values: &[f64]) -> String {
    values.iter().map(f64::to_string).collect::<Vec<_>>().join(",")
}

/// A point that covers the window: all its pixels have the values of one vertex.
fn point(at: DVec3) -> String {
    format!("glPointSize(64)\nglBegin(GL_POINTS)\nglVertex3f({})\nglEnd()", list(&at.to_array()))
}

/// A vector of components that a function gives, in the order x, y, z.
fn vector(mut component: impl FnMut() -> f64) -> DVec3 {
    DVec3::from_array(std::array::from_fn(|_| component()))
}

/// A number that single precision has.
fn unit(random: &mut Random) -> f64 {
    f64::from(random.unit())
}
