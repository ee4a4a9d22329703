//! The key of a draw's shader. It has only terms that can affect the shader.
//!
//! Its functions run for each draw. They are `#[inline]`, so they are compiled with the machine's crate, which is optimised.

use crate::UNITS;
use crate::arb::program::input;
use crate::narrow::Narrow;

/// Attributes that come from the vertex buffer; the others are constant for all vertices and are uniforms.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub struct Varying {
    /// Primary colour.
    pub color: bool,
    /// Normal.
    pub normal: bool,
    /// Secondary colour.
    pub secondary: bool,
    /// Fog coordinate.
    pub fog: bool,
    /// Texture coordinates.
    pub texture: [bool; UNITS],
    /// Generic attributes: a bit each.
    pub generic: u16,
}

/// One enabled light.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct LightKey {
    /// A direction.
    pub directional: bool,
    /// A spot.
    pub spot: bool,
    /// Attenuated.
    pub attenuated: bool,
}

/// Lighting.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct LightingKey {
    /// Enabled lights in order.
    pub lights: Vec<LightKey>,
    /// The viewer is in the scene.
    pub local_viewer: bool,
    /// Back faces have a separate colour.
    pub two_side: bool,
    /// Specular light occurs.
    pub specular: bool,
    /// Specular light is added after texturing.
    pub separate: bool,
    /// Material parameters taken from the colour: bit 0 ambient, 1 diffuse, 2 specular, 3 emission; for front and back.
    pub color_material: [u8; 2],
}

/// How a coordinate is generated.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum TexGenMode {
    /// By a plane in object space.
    Object,
    /// By a plane in eye space.
    Eye,
    /// By the sphere map.
    Sphere,
    /// By the reflection.
    Reflection,
    /// By the normal.
    Normal,
}

/// The shape of a texture.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum TextureShape {
    /// 1D, stored as a 2D texture of one row.
    D1,
    /// 2D.
    D2,
    /// 2D, coordinates in texels.
    Rectangle,
    /// 3D.
    D3,
    /// Cube.
    Cube,
}

/// Base format: the meaning of a texture's channels (OpenGL 1.5, table 3.15), and how they are stored.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Base {
    /// Alpha: stored in one channel.
    Alpha,
    /// Luminance: stored in one channel.
    Luminance,
    /// Luminance and alpha: stored in two channels.
    LuminanceAlpha,
    /// Intensity: stored in one channel.
    Intensity,
    /// Colour.
    Rgb,
    /// Colour and alpha.
    Rgba,
    /// Colour, stored in sRGB encoding.
    Srgb,
    /// The same with alpha, which is linear.
    SrgbAlpha,
    /// Red: stored in one channel.
    Red,
    /// Red and green: stored in two channels.
    Rg,
    /// Floating-point numbers, not clamped.
    Float(Channels, Width),
    /// Fewer than eight bits per channel.
    Narrow(Narrow),
    /// Depth; the texture's depth mode selects what the environment reads.
    Depth,
}

/// Channels of floating-point texels.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Channels {
    /// As [`Base::Alpha`].
    Alpha,
    /// As [`Base::Luminance`].
    Luminance,
    /// As [`Base::LuminanceAlpha`].
    LuminanceAlpha,
    /// As [`Base::Intensity`].
    Intensity,
    /// As [`Base::Red`].
    Red,
    /// As [`Base::Rg`].
    Rg,
    /// As [`Base::Rgb`].
    Rgb,
    /// As [`Base::Rgba`].
    Rgba,
}

/// Bits of floating-point channels.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Width {
    /// 16.
    Half,
    /// 32.
    Single,
}

impl Base {
    /// The base format of the same channels with eight bits each.
    #[inline]
    pub fn plain(self) -> Base {
        match self {
            Base::Float(channels, _) => match channels {
                Channels::Alpha => Base::Alpha,
                Channels::Luminance => Base::Luminance,
                Channels::LuminanceAlpha => Base::LuminanceAlpha,
                Channels::Intensity => Base::Intensity,
                Channels::Red => Base::Red,
                Channels::Rg => Base::Rg,
                Channels::Rgb => Base::Rgb,
                Channels::Rgba => Base::Rgba,
            },
            Base::Narrow(narrow) => narrow.plain(),
            other => other,
        }
    }

    /// Its format, if it has fewer than eight bits per channel.
    #[inline]
    pub fn narrow(self) -> Option<Narrow> {
        if let Base::Narrow(narrow) = self { Some(narrow) } else { None }
    }

    /// Whether values outside [0, 1] are stored.
    #[inline]
    pub fn is_float(self) -> bool {
        matches!(self, Base::Float(..))
    }

    /// WGSL of the value that the environment reads, from a stored texel `t`.
    pub fn swizzle(self) -> &'static str {
        match self.plain() {
            Base::Alpha => "vec4f(0, 0, 0, t.r)",
            Base::Red => "vec4f(t.r, 0, 0, 1)",
            Base::Rg => "vec4f(t.rg, 0, 1)",
            Base::Luminance => "vec4f(t.r, t.r, t.r, 1)",
            Base::LuminanceAlpha => "t.rrrg",
            Base::Intensity => "t.rrrr",
            Base::Rgb | Base::Srgb => "vec4f(t.rgb, 1)",
            Base::Rgba | Base::SrgbAlpha | Base::Depth | Base::Float(..) | Base::Narrow(_) => "t",
        }
    }

    /// WGSL of the stored texel, from a colour `c`.
    pub fn unswizzle(self) -> &'static str {
        if let Base::Narrow(narrow) = self {
            return narrow.unswizzle();
        }
        match self.plain() {
            Base::Alpha => "c.aaaa",
            Base::Luminance | Base::Intensity | Base::Red => "c.rrrr",
            Base::Rg => "c.rgba",
            Base::LuminanceAlpha => "c.raaa",
            Base::Rgb | Base::Srgb => "vec4f(c.rgb, 1)",
            Base::Rgba | Base::SrgbAlpha | Base::Depth | Base::Float(..) | Base::Narrow(_) => "c",
        }
    }
}

/// How depths of a texture are read.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub enum DepthRead {
    /// The texture has colours.
    #[default]
    No,
    /// Depths as colours, without comparison.
    Plain,
    /// Compared with the third coordinate.
    Compared,
}

/// A texture environment.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum EnvironmentKey {
    /// One of the plain modes.
    Mode(u32),
    /// Combiners: functions ([`FOUR`] is added to those of four arguments), sources, operands; whether results are scaled.
    Combine([u32; 2], [[u32; 4]; 2], [[u32; 4]; 2], bool),
}

/// Added to functions of combiners that have four arguments (`GL_COMBINE4_NV`).
pub const FOUR: u32 = 1 << 31;

/// An enabled texture unit.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct UnitKey {
    /// Its number.
    pub unit: usize,
    /// Its coordinates go to the fragment stage.
    pub coordinates: bool,
    /// Its texture is read.
    pub sampled: bool,
    /// The texture.
    pub kind: TextureShape,
    /// Its base format.
    pub base: Base,
    /// The source of each component that is read.
    pub swizzle: [u8; 4],
    /// Whether filters stop at the edges of cube map faces, because cube maps are not seamless.
    pub face_edges: bool,
    /// Whether the card does not support the border's colour.
    pub border: bool,
    /// Whether it has depths.
    pub depth: DepthRead,
    /// Coordinates that are clamped to [0, 1] before filtering (`GL_CLAMP`).
    pub clamp: [bool; 3],
    /// Coordinates that are mirrored at 0 before filtering.
    pub mirror: [bool; 3],
    /// Generated coordinates.
    pub made: [Option<TexGenMode>; 4],
    /// Whether the texture matrix is not the identity.
    pub matrix: bool,
    /// Whether q may be other than 1.
    pub projective: bool,
    /// Whether the level of detail is biased.
    pub bias: bool,
    /// Whether the coordinates are those of the sprite.
    pub sprite: bool,
    /// Whether the second coordinate of the sprite grows upward.
    pub sprite_up: bool,
    /// Its environment.
    pub environment: EnvironmentKey,
}

/// The distance of a vertex for fog (`GL_FOG_DISTANCE_MODE_NV`).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub enum FogDistance {
    /// From the plane of the eye, without sign.
    #[default]
    Absolute,
    /// Along the axis of the eye, with sign.
    Signed,
    /// From the eye.
    Radial,
}

/// How primitives become triangles in the vertex stage.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub enum Expand {
    /// They do not.
    #[default]
    No,
    /// Points as squares.
    Point,
    /// Points as discs.
    SmoothPoint,
    /// Lines as parallelograms.
    Line,
    /// Lines as rectangles with soft edges.
    SmoothLine,
}

/// A vertex program.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct VertexKey {
    /// Its number.
    pub number: u32,
    /// Inputs that it reads (`arb::input`).
    pub inputs: u32,
    /// Back faces have separate colours.
    pub two_side: bool,
    /// It writes the point size.
    pub size: bool,
    /// Its position is that of the fixed-function pipeline.
    pub invariant: bool,
}

/// A fragment program.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct FragmentKey {
    /// Its number.
    pub number: u32,
    /// Inputs that it reads (`arb::input`).
    pub inputs: u32,
}

/// Everything on which a shader depends.
#[derive(Clone, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub struct ShaderKey {
    /// Attributes in the buffer.
    pub varying: Varying,
    /// Lighting.
    pub lighting: Option<LightingKey>,
    /// Normals: 0 unchanged, 1 normalised, 2 rescaled.
    pub normalize: u8,
    /// Enabled texture units.
    pub units: Vec<UnitKey>,
    /// The secondary colour is added.
    pub color_sum: bool,
    /// Flat shading.
    pub flat: bool,
    /// Fog: the mode.
    pub fog: Option<u32>,
    /// The distance that fog uses otherwise.
    pub fog_distance: FogDistance,
    /// Fog uses the fog coordinate.
    pub fog_coordinate: bool,
    /// Alpha test: the comparison.
    pub alpha: Option<u32>,
    /// Enabled clip planes.
    pub planes: u8,
    /// Polygon stipple.
    pub stipple: bool,
    /// Depth offsets of polygons that are drawn as lines or points.
    pub offset: bool,
    /// Primary colours are those of drawn pixels.
    pub pixels: bool,
    /// Expansion.
    pub expand: Expand,
    /// Points whose size depends on the distance.
    pub attenuated_point: bool,
    /// Coordinates in eye space are read and have to be divided by their w.
    pub projective_eye: bool,
    /// Lines and points of polygons that are back faces.
    pub back: bool,
    /// The vertex program, which replaces transformation, lighting and texture coordinate generation.
    pub vertex: Option<VertexKey>,
    /// The fragment program, which replaces texture environments, colour sum and fog.
    pub fragment: Option<FragmentKey>,
    /// The writes to the colour buffers.
    pub colors: Colors,
}

impl ShaderKey {
    /// Whether the vertex program runs for both ends of a line at each corner of what the line becomes.
    #[inline]
    pub fn both_ends(&self) -> bool {
        let lines = matches!(self.expand, Expand::Line | Expand::SmoothLine);
        lines && self.vertex.is_some_and(|vertex| !vertex.invariant)
    }
}

/// The colours that fragments write to the colour buffers.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Colors {
    /// Number of colour buffers, at least 1.
    pub count: u8,
    /// Which of them are written: a bit each.
    pub written: u8,
    /// Whether all get the colour of the first one.
    pub alike: bool,
    /// Whether any of them stores values outside [0, 1].
    pub float: bool,
    /// Whether the first one's red, green and blue are multiplied by a constant before they are blended.
    pub scaled: bool,
    /// Set if the only one has fewer than eight bits per channel.
    pub narrow: Option<Narrow>,
    /// Whether the only one is blended with a second source.
    pub second: bool,
}

impl Default for Colors {
    #[inline]
    fn default() -> Self {
        Colors { count: 1, written: 1, alike: true, float: false, scaled: false, narrow: None, second: false }
    }
}

impl ShaderKey {
    /// Whether the position in eye space is needed.
    #[inline]
    pub fn eye(&self) -> bool {
        let made = self.units.iter().any(|unit| {
            unit.made.iter().flatten().any(|made| matches!(made, TexGenMode::Eye | TexGenMode::Sphere | TexGenMode::Reflection))
        });
        let lit = self.lighting.as_ref().is_some_and(|l| l.local_viewer || l.lights.iter().any(|light| !light.directional));
        if self.vertex.is_some() {
            return self.planes != 0;
        }
        made || lit || self.planes != 0 || self.attenuated_point || self.fogged() && !self.fog_coordinate
    }

    /// Whether the normal in eye space is needed.
    #[inline]
    pub fn normal(&self) -> bool {
        let made = |unit: &UnitKey| {
            unit.made
                .iter()
                .flatten()
                .any(|made| matches!(made, TexGenMode::Sphere | TexGenMode::Reflection | TexGenMode::Normal))
        };
        if self.vertex.is_some() {
            return self.reads(input::NORMAL);
        }
        self.units.iter().any(made) || self.lighting.as_ref().is_some_and(|l| !l.lights.is_empty())
    }

    /// Whether the vertex's primary colour is needed.
    #[inline]
    pub fn color(&self) -> bool {
        if self.vertex.is_some() {
            return self.reads(input::COLOR);
        }
        self.lighting.as_ref().is_none_or(|lighting| lighting.color_material != [0; 2])
    }

    /// Whether a vertex program reads an input.
    #[inline]
    pub fn reads(&self, bit: u32) -> bool {
        self.vertex.is_some_and(|vertex| vertex.inputs & 1 << bit != 0)
    }

    /// Whether the vertex's secondary colour is needed.
    #[inline]
    pub fn vertex_secondary(&self) -> bool {
        if self.vertex.is_some() { self.reads(input::SECONDARY) } else { self.color_sum }
    }

    /// Whether the vertex's fog coordinate is needed.
    #[inline]
    pub fn vertex_fog(&self) -> bool {
        if self.vertex.is_some() { self.reads(input::FOG) } else { self.fogged() && self.fog_coordinate }
    }

    /// Whether the vertex's texture coordinates of a unit are needed.
    #[inline]
    pub fn vertex_texture(&self, k: usize) -> bool {
        let generated = |unit: &UnitKey| unit.sprite || unit.made.iter().all(Option::is_some);
        match self.vertex {
            Some(_) => self.reads(input::TEXTURE + k as u32),
            None => self.units.iter().any(|unit| unit.unit == k && unit.coordinates && !generated(unit)),
        }
    }

    /// Whether the fragment stage has a fog coordinate.
    #[inline]
    pub fn fogged(&self) -> bool {
        self.fog.is_some() || self.fragment.is_some_and(|fragment| fragment.inputs & 1 << input::FOG != 0)
    }

    /// Whether back faces have a colour of their own.
    #[inline]
    pub fn two_side(&self) -> bool {
        self.lighting.as_ref().is_some_and(|lighting| lighting.two_side) || self.vertex.is_some_and(|vertex| vertex.two_side)
    }

    /// Whether a second colour is added after texturing.
    #[inline]
    pub fn secondary(&self) -> bool {
        if let (Some(fragment), Some(_)) = (self.fragment, self.vertex) {
            return fragment.inputs & 1 << input::SECONDARY != 0;
        }
        self.color_sum || self.lighting.as_ref().is_some_and(|lighting| lighting.separate && lighting.specular)
    }
}
