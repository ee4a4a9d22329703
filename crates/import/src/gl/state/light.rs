//! Lights and materials.

use glam::{Vec3, vec3};

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
