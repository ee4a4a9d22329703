//! Lights and materials.

use gl_shader::key::FogDistance;
use gl_shader::{LIGHTS, consts as e};
use glam::{Vec3, vec3};

/// Lights, materials and shading.
#[derive(Clone, Debug)]
pub struct Lighting {
    /// Lights.
    pub lights: [Light; LIGHTS],
    /// Ambient light of the scene.
    pub model_ambient: [f32; 4],
    /// Whether the viewer is in the scene.
    pub local_viewer: bool,
    /// Whether back faces are lit.
    pub two_side: bool,
    /// Whether specular light is added after texturing.
    pub separate_specular: bool,
    /// Materials: front, back.
    pub materials: [Material; 2],
    /// Faces and mode of colour material.
    pub color_material: [u32; 2],
    /// Flat shading.
    pub flat: bool,
    /// Whether the first vertex of a primitive gives its flat values.
    pub provoking_first: bool,
}

impl Default for Lighting {
    fn default() -> Self {
        let (black, white) = ([0.0, 0.0, 0.0, 1.0], [1.0; 4]);
        let mut light = Light {
            ambient: black,
            diffuse: black,
            specular: black,
            position: [0.0, 0.0, 1.0, 0.0],
            spot_direction: [0.0, 0.0, -1.0],
            spot_exponent: 0.0,
            spot_cutoff: 180.0,
            attenuation: [1.0, 0.0, 0.0],
            derived: Derived::default(),
        };
        light.derive();
        let mut lights: [Light; LIGHTS] = std::array::from_fn(|_| light.clone());
        (lights[0].diffuse, lights[0].specular) = (white, white);
        let material = Material {
            ambient: [0.2, 0.2, 0.2, 1.0],
            diffuse: [0.8, 0.8, 0.8, 1.0],
            specular: black,
            emission: black,
            shininess: 0.0,
        };
        Lighting {
            lights,
            model_ambient: [0.2, 0.2, 0.2, 1.0],
            local_viewer: false,
            two_side: false,
            separate_specular: false,
            materials: [material.clone(), material],
            color_material: [e::FRONT_AND_BACK, e::AMBIENT_AND_DIFFUSE],
            flat: false,
            provoking_first: false,
        }
    }
}

/// Fog.
#[derive(Clone, Debug)]
pub struct Fog {
    /// `GL_EXP`, ...
    pub mode: u32,
    /// Colour.
    pub color: [f32; 4],
    /// Density, start, end.
    pub terms: [f32; 3],
    /// The distance that it uses.
    pub distance: FogDistance,
    /// Whether it uses the fog coordinate.
    pub from_coordinate: bool,
}

impl Default for Fog {
    fn default() -> Self {
        let (color, terms) = ([0.0; 4], [1.0, 0.0, 1.0]);
        Fog { mode: e::EXP, color, terms, distance: FogDistance::Absolute, from_coordinate: false }
    }
}

/// A light; positions and directions are in eye space.
#[derive(Clone, Debug)]
pub struct Light {
    /// Colours.
    pub ambient: [f32; 4],
    /// Colours.
    pub diffuse: [f32; 4],
    /// Colours.
    pub specular: [f32; 4],
    /// Position; w = 0: a direction.
    pub position: [f32; 4],
    /// Direction of the spot.
    pub spot_direction: [f32; 3],
    /// Exponent of the spot.
    pub spot_exponent: f32,
    /// Cutoff in degrees; 180: no spot.
    pub spot_cutoff: f32,
    /// Constant, linear, quadratic.
    pub attenuation: [f32; 3],
    /// What shaders read of position, spot and viewer: computed by [`Light::derive`].
    pub derived: Derived,
}

/// Terms of a light that shaders read.
#[derive(Clone, Debug, Default)]
pub struct Derived {
    /// The direction (w = 0), or the position divided by its w (w = 1).
    pub position: [f32; 4],
    /// The half vector for a viewer at infinity.
    pub half: [f32; 4],
    /// The direction of the spot, and the cosine of its cutoff.
    pub spot: [f32; 4],
}

impl Light {
    /// Whether it is a direction.
    pub fn directional(&self) -> bool {
        self.position[3] == 0.0
    }

    /// Computes the terms again, after a change of the light.
    pub fn derive(&mut self) {
        let [x, y, z, w] = self.position;
        let position = match self.directional() {
            true => vec3(x, y, z).normalize_or_zero().extend(0.0),
            false => (vec3(x, y, z) / w).extend(1.0),
        };
        let [x, y, z] = Vec3::from(self.spot_direction).normalize_or_zero().to_array();
        self.derived = Derived {
            position: position.to_array(),
            half: (position.truncate() + Vec3::Z).normalize_or_zero().extend(0.0).to_array(),
            spot: [x, y, z, libm::cos(f64::from(self.spot_cutoff).to_radians()) as f32],
        };
    }
}

/// A material of one side.
#[derive(Clone, Debug, PartialEq)]
pub struct Material {
    /// Colours.
    pub ambient: [f32; 4],
    /// Colours.
    pub diffuse: [f32; 4],
    /// Colours.
    pub specular: [f32; 4],
    /// Colours.
    pub emission: [f32; 4],
    /// Exponent.
    pub shininess: f32,
}
