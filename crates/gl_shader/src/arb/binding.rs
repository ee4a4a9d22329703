//! Bindings of dotted names: inputs, results, state, program parameters.

use super::lex::Wrong;
use super::parse::Parser;
use super::program::*;
use crate::{LIGHTS, PLANES, UNITS};

type ParseResult<T = ()> = Result<T, Wrong>;

impl Parser {
    /// `vertex.texcoord[2]`, `fragment.position`: its bit.
    pub(super) fn input(&mut self) -> ParseResult<u32> {
        let vertex = self.program.stage == ProgramStage::Vertex;
        let wanted = if vertex { "vertex" } else { "fragment" };
        if self.name()? != wanted {
            return self.fail(format!("an input of this stage begins with {wanted}"));
        }
        let bit = if vertex {
            match self.must(&["position", "normal", "color", "fogcoord", "texcoord", "attrib"])? {
                0 => input::POSITION,
                1 => input::NORMAL,
                2 => self.which_color(),
                3 => input::FOG,
                4 => input::TEXTURE + self.bracket(UNITS as u32, "texture unit")?,
                _ => match self.bracket(GENERICS as u32, "generic attribute")? {
                    // Generic attribute 0 and the position are one attribute.
                    0 => input::POSITION,
                    number => input::GENERIC + number,
                },
            }
        } else {
            match self.must(&["color", "texcoord", "fogcoord", "position"])? {
                0 => self.which_color(),
                1 => input::TEXTURE + self.bracket(UNITS as u32, "texture unit")?,
                2 => input::FOG,
                _ => input::POSITION,
            }
        };
        self.program.inputs |= 1 << bit;
        Ok(bit)
    }

    fn which_color(&mut self) -> u32 {
        if self.member(&["primary", "secondary"]) == Some(1) { input::SECONDARY } else { input::COLOR }
    }

    /// `result.color.back`
    pub(super) fn output(&mut self) -> ParseResult<Output> {
        if self.name()? != "result" {
            return self.fail("a result begins with `result`");
        }
        if self.program.stage == ProgramStage::Fragment {
            return Ok(match self.must(&["color", "depth"])? {
                0 => {
                    self.bracket(1, "colour that is supported")?;
                    Output::Color(0)
                }
                _ => Output::Depth,
            });
        }
        Ok(match self.must(&["position", "color", "fogcoord", "pointsize", "texcoord"])? {
            0 => Output::Position,
            1 => {
                let back = self.member(&["front", "back"]) == Some(1);
                let secondary = self.member(&["primary", "secondary"]) == Some(1);
                Output::Color(2 * u8::from(back) + u8::from(secondary))
            }
            2 => Output::Fog,
            3 => Output::PointSize,
            _ => Output::Texture(self.bracket(UNITS as u32, "texture unit")? as u8),
        })
    }

    /// The binding after `state` or `program`.
    pub(super) fn binding(&mut self, state: bool) -> ParseResult<Vec<Param>> {
        if !state {
            let local = self.must(&["env", "local"])? == 1;
            let range = self.range(PARAMETERS, "parameter")?;
            return Ok(range.map(|k| if local { Param::Local(k) } else { Param::Environment(k) }).collect());
        }
        let kinds =
            ["material", "light", "lightmodel", "lightprod", "texgen", "texenv", "fog", "clip", "point", "depth", "matrix"];
        let one = match self.must(&kinds)? {
            0 => {
                let face = self.face();
                let terms = [Term::Ambient, Term::Diffuse, Term::Specular, Term::Emission, Term::Shininess];
                Param::Material(face, terms[self.must(&["ambient", "diffuse", "specular", "emission", "shininess"])?])
            }
            1 => {
                let light = self.bracket(LIGHTS as u32, "light")? as u8;
                let names = ["ambient", "diffuse", "specular", "position", "attenuation", "spot", "half"];
                let terms =
                    [Term::Ambient, Term::Diffuse, Term::Specular, Term::Position, Term::Attenuation, Term::Spot, Term::Half];
                let term = terms[self.must(&names)?];
                if term == Term::Spot {
                    self.must(&["direction"])?;
                }
                Param::Light(light, term)
            }
            2 => match self.member(&["ambient"]) {
                Some(_) => Param::ModelAmbient,
                None => {
                    let face = self.face();
                    self.must(&["scenecolor"])?;
                    Param::SceneColor(face)
                }
            },
            3 => {
                let light = self.bracket(LIGHTS as u32, "light")? as u8;
                let face = self.face();
                let terms = [Term::Ambient, Term::Diffuse, Term::Specular];
                Param::Product(light, face, terms[self.must(&["ambient", "diffuse", "specular"])?])
            }
            4 => {
                let unit = self.bracket(UNITS as u32, "texture unit")? as u8;
                let eye = self.must(&["object", "eye"])? == 1;
                Param::Generation(unit, eye, self.must(&["s", "t", "r", "q"])? as u8)
            }
            5 => {
                let unit = self.bracket(UNITS as u32, "texture unit")? as u8;
                self.must(&["color"])?;
                Param::Environ(unit)
            }
            6 => [Param::FogColor, Param::FogTerms][self.must(&["color", "params"])?],
            7 => {
                let plane = self.bracket(PLANES as u32, "clip plane")? as u8;
                self.must(&["plane"])?;
                Param::Plane(plane)
            }
            8 => [Param::PointSize, Param::PointAttenuation][self.must(&["size", "attenuation"])?],
            9 => {
                self.must(&["range"])?;
                Param::DepthRange
            }
            _ => return self.matrix(),
        };
        Ok(vec![one])
    }

    fn face(&mut self) -> u8 {
        u8::from(self.member(&["front", "back"]) == Some(1))
    }

    fn matrix(&mut self) -> ParseResult<Vec<Param>> {
        let matrix = match self.must(&["modelview", "projection", "mvp", "texture", "program"])? {
            0 => {
                self.bracket(1, "modelview matrix")?;
                Matrix::Modelview
            }
            1 => Matrix::Projection,
            2 => Matrix::Mvp,
            3 => Matrix::Texture(self.bracket(UNITS as u32, "texture matrix")? as u8),
            _ => Matrix::Program(self.bracket(MATRICES as u32, "program matrix")? as u8),
        };
        let (inverse, transpose) = match self.member(&["inverse", "transpose", "invtrans"]) {
            None => (false, false),
            Some(0) => (true, false),
            Some(1) => (false, true),
            Some(_) => (true, true),
        };
        let rows = if self.member(&["row"]).is_some() { self.range(4, "row")? } else { 0..4 };
        Ok(rows.map(|row| Param::Row { matrix, inverse, transpose, row: row as u8 }).collect())
    }
}
