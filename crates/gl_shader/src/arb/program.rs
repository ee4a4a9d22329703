//! A parsed program of ARB_vertex_program or ARB_fragment_program.

use crate::glsl::stage::Code;

/// Maximum number of environment parameters, and of local parameters, of a program.
pub const PARAMETERS: u32 = 256;
/// Number of generic vertex attributes.
pub const GENERICS: usize = 16;
/// Number of program matrices.
pub const MATRICES: usize = 8;

/// A stage.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum ProgramStage {
    /// `!!ARBvp1.0`
    Vertex = 1,
    /// `!!ARBfp1.0`
    Fragment = 2,
}

/// Bits of inputs; the numbers equal the locations of vertex attributes.
pub mod input {
    /// Position of the vertex, or of the fragment in the window.
    pub const POSITION: u32 = 0;
    /// Primary colour.
    pub const COLOR: u32 = 1;
    /// Normal.
    pub const NORMAL: u32 = 2;
    /// Secondary colour.
    pub const SECONDARY: u32 = 3;
    /// Fog coordinate.
    pub const FOG: u32 = 4;
    /// Texture coordinates of unit 0.
    pub const TEXTURE: u32 = 8;
    /// Generic attribute 0.
    pub const GENERIC: u32 = 16;
}

/// A result.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Output {
    /// Position in clip space.
    Position,
    /// Colours: 0 primary and 1 secondary of the front, 2 and 3 of the back. In fragment programs: the colour buffers.
    Color(u8),
    /// Fog coordinate.
    Fog,
    /// Point size.
    PointSize,
    /// Texture coordinates.
    Texture(u8),
    /// Depth in the window.
    Depth,
    /// The second source of blending of the first colour buffer.
    Second,
}

/// A matrix.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Matrix {
    /// Modelview.
    Modelview,
    /// Projection.
    Projection,
    /// Projection x modelview.
    Mvp,
    /// A texture matrix.
    Texture(u8),
    /// A program matrix.
    Program(u8),
}

/// A term of lights, materials and their products.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Term {
    /// Ambient.
    Ambient,
    /// Diffuse.
    Diffuse,
    /// Specular.
    Specular,
    /// Emission, of materials.
    Emission,
    /// Shininess, of materials.
    Shininess,
    /// Position, of lights.
    Position,
    /// Attenuation and spot exponent, of lights.
    Attenuation,
    /// Direction of the spot and cosine of its cutoff, of lights.
    Spot,
    /// The spot's cutoff in degrees, of lights.
    Cutoff,
    /// Half vector for a viewer at infinity, of lights.
    Half,
}

/// The binding of a four-component parameter. Faces: 0 front, 1 back.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Param {
    /// A constant.
    Literal([f32; 4]),
    /// A parameter of all programs of a stage.
    Environment(u32),
    /// A parameter of this program.
    Local(u32),
    /// A term of a face's material.
    Material(u8, Term),
    /// A term of a light.
    Light(u8, Term),
    /// Ambient light of the scene.
    ModelAmbient,
    /// Emission of a face's material plus its reflection of the scene's ambient light.
    SceneColor(u8),
    /// The product of a term of a light and of a face's material.
    Product(u8, u8, Term),
    /// A plane of texture generation: unit, whether in eye space, coordinate.
    Generation(u8, bool, u8),
    /// The colour of a unit's texture environment.
    Environ(u8),
    /// The instance number, as the bits of an integer.
    Instance,
    /// The factor of `GL_RESCALE_NORMAL`.
    NormalScale,
    /// Fog colour.
    FogColor,
    /// Density, start, end, 1 / (end - start).
    FogTerms,
    /// A clip plane in eye space.
    Plane(u8),
    /// Size, minimum, maximum, fade threshold.
    PointSize,
    /// Constant, linear, quadratic.
    PointAttenuation,
    /// Near, far, far - near.
    DepthRange,
    /// A row of a matrix, after inversion or transposition.
    Row {
        /// Which matrix.
        matrix: Matrix,
        /// Whether it is inverted.
        inverse: bool,
        /// Whether it is transposed.
        transpose: bool,
        /// Which row.
        row: u8,
    },
}

/// The register of an operand.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Register {
    /// A temporary.
    Temp(usize),
    /// A parameter.
    Param(usize),
    /// An array of parameters, indexed by an address register plus an offset.
    Relative {
        /// The first parameter of the array plus the offset.
        first: i32,
        /// The address register.
        address: usize,
    },
    /// An input, by its bit.
    Input(u32),
    /// A result.
    Output(Output),
    /// An address register.
    Address(usize),
}

/// An operand that is read. Components are 0 to 3; 4 and 5 are the constants 0 and 1 of `SWZ`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SourceOperand {
    /// What is read.
    pub register: Register,
    /// The source component of each component.
    pub swizzle: [u8; 4],
    /// Which are negated.
    pub negate: [bool; 4],
}

/// An operand that is written.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Destination {
    /// The register that is written.
    pub register: Register,
    /// Components.
    pub mask: [bool; 4],
}

/// A texture that a program reads.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Image {
    /// The unit.
    pub unit: usize,
    /// The target: an index of [`TARGETS`](crate::TARGETS).
    pub target: usize,
    /// How it is read: bits of [`way`](crate::glsl::stage::way).
    pub ways: u8,
}

/// An instruction.
#[derive(Clone, Debug, PartialEq)]
pub struct Instruction {
    /// Its name, without `_SAT`.
    pub name: &'static str,
    /// Whether the result is clamped to [0, 1].
    pub saturate: bool,
    /// The destination; none for `KIL`.
    pub destination: Option<Destination>,
    /// What is read.
    pub sources: Vec<SourceOperand>,
    /// Texture unit.
    pub unit: usize,
}

/// A program.
#[derive(Clone, Debug, PartialEq)]
pub struct Program {
    /// Its stage.
    pub stage: ProgramStage,
    /// Instructions.
    pub instructions: Vec<Instruction>,
    /// Names of temporaries.
    pub temps: Vec<String>,
    /// Names of address registers.
    pub addresses: Vec<String>,
    /// Parameters.
    pub params: Vec<Param>,
    /// Inputs: a bit of [`input`] each.
    pub inputs: u32,
    /// Results that are written.
    pub outputs: Vec<Output>,
    /// The textures that it reads, in the order of their units.
    pub images: Vec<Image>,
    /// Whether it reads the number of the vertex, in place of the fog coordinate.
    pub numbered: bool,
    /// Whether the position is that of the fixed-function pipeline.
    pub invariant: bool,
    /// Fog that is applied to the colour: `GL_LINEAR`, `GL_EXP`, `GL_EXP2`.
    pub fog: Option<u32>,
    /// A GLSL stage in place of instructions.
    pub code: Option<Code>,
}

impl Program {
    /// The texture that it reads at a unit.
    #[inline]
    pub fn image(&self, unit: usize) -> Option<&Image> {
        self.images.iter().find(|image| image.unit == unit)
    }

    /// Notes that it reads the texture of a unit in these ways.
    pub fn reads(&mut self, unit: usize, target: usize, ways: u8) {
        match self.images.binary_search_by_key(&unit, |image| image.unit) {
            Ok(at) => self.images[at].ways |= ways,
            Err(at) => self.images.insert(at, Image { unit, target, ways }),
        }
    }

    /// The ways in which it reads the texture of a unit: bits of [`way`](crate::glsl::stage::way).
    #[inline]
    pub fn ways(&self, unit: usize) -> u8 {
        self.image(unit).map_or(0, |image| image.ways)
    }

    /// An empty program.
    pub fn new(stage: ProgramStage) -> Program {
        Program {
            stage,
            instructions: Vec::new(),
            temps: Vec::new(),
            addresses: Vec::new(),
            params: Vec::new(),
            inputs: 0,
            outputs: Vec::new(),
            images: Vec::new(),
            numbered: false,
            invariant: false,
            fog: None,
            code: None,
        }
    }

    /// Whether it hands on values that one vertex gives to a whole primitive, beside the colours of flat shading.
    pub fn has_flat(&self) -> bool {
        self.code.as_ref().is_some_and(|code| code.varyings.iter().any(|varying| varying.interpolation == Some("flat")))
    }
}
