//! Triangle setup.

/// Depth over the screen: `z0 + (x - x0) dzdx + (y - y0) dzdy`, evaluated in exactly this order in f32.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct DepthPlane {
    /// Reference point in pixels.
    pub x0: f32,
    /// Reference point in pixels.
    pub y0: f32,
    /// Depth at the reference point.
    pub z0: f32,
    /// Slope along x, per pixel.
    pub dzdx: f32,
    /// Slope along y, per pixel.
    pub dzdy: f32,
}

impl DepthPlane {
    /// Depth at a window position in pixels, before clamping.
    #[inline(always)]
    pub fn at(&self, x: f32, y: f32) -> f32 {
        self.z0 + ((x - self.x0) * self.dzdx + (y - self.y0) * self.dzdy)
    }
}
