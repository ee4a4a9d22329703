//! Built-in names of old dialects, for OpenGL's state and fixed-function stages (OpenGL Shading Language 1.20, chapter 7).

use crate::COLORS_MAX;
use crate::arb::program::{Matrix, Output, Param, ProgramStage, Term, input};
use crate::{IMAGES, LIGHTS, PLANES, STAGE_IMAGES, UNITS};

/// The meaning of a name that begins with `gl_`.
#[derive(Clone, Debug, PartialEq)]
pub enum Role {
    /// A constant of this value.
    Constant(u32),
    /// An input, by its bit.
    Input(u32),
    /// Whether the triangle is front-facing.
    Facing,
    /// The position of a fragment within a point.
    PointCoord,
    /// A result.
    Output(Output),
    /// The position in eye space for clip planes.
    ClipVertex,
    /// Distances from clip planes.
    ClipDistance,
    /// The number of the vertex.
    VertexId,
    /// State of the machine: for each vector, a parameter and its first component.
    State(Vec<(Param, u8)>),
}

/// The declared type of a name, the structure that it needs, and its role.
#[derive(Clone, Debug, PartialEq)]
pub struct Builtin {
    /// Its type.
    pub kind: String,
    /// Elements, if it is an array.
    pub count: Option<usize>,
    /// The declaration of its structure.
    pub structure: &'static str,
    /// Its meaning.
    pub role: Role,
}

impl Builtin {
    fn new(kind: &str, role: Role) -> Builtin {
        Builtin { kind: kind.into(), count: None, structure: "", role }
    }

    fn many(kind: &str, count: usize, role: Role) -> Builtin {
        Builtin { count: Some(count), ..Builtin::new(kind, role) }
    }
}

const LIGHT: &str = "struct glx_Light { vec4 ambient; vec4 diffuse; vec4 specular; vec4 position; vec4 halfVector; \
    vec3 spotDirection; float spotExponent; float spotCutoff; float spotCosCutoff; float constantAttenuation; \
    float linearAttenuation; float quadraticAttenuation; };";
const MATERIAL: &str = "struct glx_Material { vec4 emission; vec4 ambient; vec4 diffuse; vec4 specular; float shininess; };";
const MODEL: &str = "struct glx_Model { vec4 ambient; };";
const MODEL_PRODUCT: &str = "struct glx_ModelProduct { vec4 sceneColor; };";
const PRODUCT: &str = "struct glx_Product { vec4 ambient; vec4 diffuse; vec4 specular; };";
const POINT: &str = "struct glx_PointParameters { float size; float sizeMin; float sizeMax; float fadeThresholdSize; \
    float distanceConstantAttenuation; float distanceLinearAttenuation; float distanceQuadraticAttenuation; };";
const FOG: &str = "struct glx_FogParameters { vec4 color; float density; float start; float end; float scale; };";
const RANGE: &str = "struct glx_Range { float near; float far; float diff; };";

/// The built-in of a stage with this name, given without `gl_`.
pub fn find(stage: ProgramStage, name: &str) -> Option<Builtin> {
    if stage == ProgramStage::Vertex && name == "ClipDistance" {
        return Some(Builtin::many("float", PLANES, Role::ClipDistance));
    }
    let role = match stage {
        ProgramStage::Vertex => vertex(name),
        ProgramStage::Fragment => fragment(name),
    };
    role.map(|(kind, role)| Builtin::new(kind, role)).or_else(|| constant(name)).or_else(|| state(name))
}

/// A name that ends in a number below a limit.
fn numbered(name: &str, stem: &str, limit: usize) -> Option<u8> {
    let number: u8 = name.strip_prefix(stem)?.parse().ok()?;
    (usize::from(number) < limit).then_some(number)
}

fn vertex(name: &str) -> Option<(&'static str, Role)> {
    Some(match name {
        "Vertex" => ("vec4", Role::Input(input::POSITION)),
        "Normal" => ("vec3", Role::Input(input::NORMAL)),
        "Color" => ("vec4", Role::Input(input::COLOR)),
        "SecondaryColor" => ("vec4", Role::Input(input::SECONDARY)),
        "FogCoord" => ("float", Role::Input(input::FOG)),
        "Position" => ("vec4", Role::Output(Output::Position)),
        "PointSize" => ("float", Role::Output(Output::PointSize)),
        "ClipVertex" => ("vec4", Role::ClipVertex),
        "VertexID" => ("int", Role::VertexId),
        "FrontColor" => ("vec4", Role::Output(Output::Color(0))),
        "FrontSecondaryColor" => ("vec4", Role::Output(Output::Color(1))),
        "BackColor" => ("vec4", Role::Output(Output::Color(2))),
        "BackSecondaryColor" => ("vec4", Role::Output(Output::Color(3))),
        "FogFragCoord" => ("float", Role::Output(Output::Fog)),
        _ => {
            if let Some(unit) = numbered(name, "MultiTexCoord", UNITS) {
                ("vec4", Role::Input(input::TEXTURE + u32::from(unit)))
            } else {
                ("vec4", Role::Output(Output::Texture(numbered(name, "TexCoord_", UNITS)?)))
            }
        }
    })
}

fn fragment(name: &str) -> Option<(&'static str, Role)> {
    Some(match name {
        "FragCoord" => ("vec4", Role::Input(input::POSITION)),
        "FrontFacing" => ("bool", Role::Facing),
        "PointCoord" => ("vec2", Role::PointCoord),
        "Color" => ("vec4", Role::Input(input::COLOR)),
        "SecondaryColor" => ("vec4", Role::Input(input::SECONDARY)),
        "FogFragCoord" => ("float", Role::Input(input::FOG)),
        "FragColor" | "FragData_0" => ("vec4", Role::Output(Output::Color(0))),
        "FragDepth" => ("float", Role::Output(Output::Depth)),
        _ => match numbered(name, "FragData_", COLORS_MAX) {
            Some(k) => ("vec4", Role::Output(Output::Color(k))),
            None => ("vec4", Role::Input(input::TEXTURE + u32::from(numbered(name, "TexCoord_", UNITS)?))),
        },
    })
}

fn constant(name: &str) -> Option<Builtin> {
    let value = match name {
        "MaxLights" => LIGHTS,
        "MaxClipPlanes" => PLANES,
        "MaxClipDistances" => PLANES,
        "MaxTextureUnits" | "MaxTextureCoords" => UNITS,
        "MaxTextureImageUnits" | "MaxVertexTextureImageUnits" => STAGE_IMAGES,
        "MaxCombinedTextureImageUnits" => IMAGES,
        "MaxVertexAttribs" => crate::arb::program::GENERICS,
        "MaxDrawBuffers" => 1,
        "MaxVaryingFloats" | "MaxVaryingComponents" => 64,
        "MaxVertexUniformComponents" | "MaxFragmentUniformComponents" => 4096,
        _ => return None,
    };
    Some(Builtin::new("const int", Role::Constant(value as u32)))
}

/// Columns of a matrix: its name may be followed by `Inverse`, `Transpose` or both.
fn matrix(matrix: Matrix, ending: &str, columns: u8) -> Option<Vec<(Param, u8)>> {
    let (inverse, transpose) = match ending {
        "" => (false, false),
        "Inverse" => (true, false),
        "Transpose" => (false, true),
        "InverseTranspose" => (true, true),
        _ => return None,
    };
    // A column is a row of the transposed matrix.
    Some((0..columns).map(|row| (Param::Row { matrix, inverse, transpose: !transpose, row }, 0)).collect())
}

fn state(name: &str) -> Option<Builtin> {
    let units = 0..UNITS as u8;
    let structure = |kind: &str, count: Option<usize>, structure: &'static str, slots: Vec<(Param, u8)>| {
        Some(Builtin { kind: kind.into(), count, structure, role: Role::State(slots) })
    };
    let square = |of: Matrix, ending: &str| Some(Builtin::new("mat4", Role::State(matrix(of, ending, 4)?)));
    if let Some(ending) = name.strip_prefix("ModelViewProjectionMatrix") {
        return square(Matrix::Mvp, ending);
    }
    if let Some(ending) = name.strip_prefix("ModelViewMatrix") {
        return square(Matrix::Modelview, ending);
    }
    if let Some(ending) = name.strip_prefix("ProjectionMatrix") {
        return square(Matrix::Projection, ending);
    }
    if let Some(ending) = name.strip_prefix("TextureMatrix") {
        let mut slots = Vec::new();
        for unit in units {
            slots.extend(matrix(Matrix::Texture(unit), ending, 4)?);
        }
        return Some(Builtin::many("mat4", UNITS, Role::State(slots)));
    }
    let plane = |name: &str| {
        let (eye, rest) = match name.strip_prefix("EyePlane") {
            Some(rest) => (true, rest),
            None => (false, name.strip_prefix("ObjectPlane")?),
        };
        Some((eye, ["S", "T", "R", "Q"].iter().position(|&letter| letter == rest)? as u8))
    };
    if let Some((eye, coordinate)) = plane(name) {
        let slots = units.map(|unit| (Param::Generation(unit, eye, coordinate), 0)).collect();
        return Some(Builtin::many("vec4", UNITS, Role::State(slots)));
    }
    let face = u8::from(name.starts_with("Back"));
    match name {
        "NormalMatrix" => Some(Builtin::new("mat3", Role::State(matrix(Matrix::Modelview, "InverseTranspose", 3)?))),
        "ClipPlane" => {
            Some(Builtin::many("vec4", PLANES, Role::State((0..PLANES as u8).map(|k| (Param::Plane(k), 0)).collect())))
        }
        "TextureEnvColor" => Some(Builtin::many("vec4", UNITS, Role::State(units.map(|k| (Param::Environ(k), 0)).collect()))),
        "DepthRange" => structure("glx_Range", None, RANGE, (0..3).map(|k| (Param::DepthRange, k)).collect()),
        "Point" => {
            let sizes = (0..4).map(|k| (Param::PointSize, k));
            structure("glx_PointParameters", None, POINT, sizes.chain((0..3).map(|k| (Param::PointAttenuation, k))).collect())
        }
        "Fog" => {
            let terms = (0..4).map(|k| (Param::FogTerms, k));
            structure("glx_FogParameters", None, FOG, std::iter::once((Param::FogColor, 0)).chain(terms).collect())
        }
        "FrontMaterial" | "BackMaterial" => {
            let terms = [Term::Emission, Term::Ambient, Term::Diffuse, Term::Specular, Term::Shininess];
            structure("glx_Material", None, MATERIAL, terms.map(|term| (Param::Material(face, term), 0)).to_vec())
        }
        // In vertex shaders only.
        "InstanceID" | "InstanceIDARB" => Some(Builtin::new("int", Role::State(vec![(Param::Instance, 0)]))),
        "NormalScale" => Some(Builtin::new("float", Role::State(vec![(Param::NormalScale, 0)]))),
        "LightModel" => structure("glx_Model", None, MODEL, vec![(Param::ModelAmbient, 0)]),
        "FrontLightModelProduct" | "BackLightModelProduct" => {
            structure("glx_ModelProduct", None, MODEL_PRODUCT, vec![(Param::SceneColor(face), 0)])
        }
        "FrontLightProduct" | "BackLightProduct" => {
            let terms = [Term::Ambient, Term::Diffuse, Term::Specular];
            let slots = (0..LIGHTS as u8).flat_map(|k| terms.map(|term| (Param::Product(k, face, term), 0)));
            structure("glx_Product", Some(LIGHTS), PRODUCT, slots.collect())
        }
        "LightSource" => {
            let of = |k: u8| {
                let whole = [Term::Ambient, Term::Diffuse, Term::Specular, Term::Position, Term::Half, Term::Spot];
                let parts = [
                    (Term::Attenuation, 3),
                    (Term::Cutoff, 0),
                    (Term::Spot, 3),
                    (Term::Attenuation, 0),
                    (Term::Attenuation, 1),
                    (Term::Attenuation, 2),
                ];
                let part = move |(term, component): (Term, u8)| (Param::Light(k, term), component);
                whole.map(|term| (term, 0)).into_iter().chain(parts).map(part)
            };
            structure("glx_Light", Some(LIGHTS), LIGHT, (0..LIGHTS as u8).flat_map(of).collect())
        }
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn state_has_as_many_vectors_as_its_type_has() {
        let slots = |name: &str| match find(ProgramStage::Vertex, name).expect("a name").role {
            Role::State(slots) => slots.len(),
            other => panic!("{other:?}"),
        };
        assert_eq!(slots("ModelViewMatrixInverseTranspose"), 4);
        assert_eq!(slots("NormalMatrix"), 3);
        assert_eq!(slots("TextureMatrix"), 4 * UNITS);
        assert_eq!(slots("LightSource"), 12 * LIGHTS);
        assert_eq!(slots("Fog"), 5);
        assert_eq!(slots("Point"), 7);
        assert_eq!(find(ProgramStage::Fragment, "Vertex"), None);
        assert_eq!(find(ProgramStage::Vertex, "TexCoord_8"), None);
    }
}
