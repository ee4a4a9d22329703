//! The depth plane of a primitive: one linear function of the window position, and the one place where depth is computed.

/// Depth as a linear function of the window position, clamped to the range that the primitive's own vertices span.
///
/// The renderer and the simulated ROPs both call [`DepthPlane::at`]: the same operations in the same order, hence the same bits.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DepthPlane {
    /// Window x, in pixels, of the reference point; a whole number near the primitive, so that differences are exact.
    pub x0: f32,
    /// Window y of the reference point.
    pub y0: f32,
    /// Depth at the reference point, bias included, before clamping.
    pub z0: f32,
    /// Change of depth per pixel to the right.
    pub dzdx: f32,
    /// Change of depth per pixel down.
    pub dzdy: f32,
    /// Least depth: the least of the vertices', biased and clamped to the viewport's range.
    pub min: f32,
    /// Greatest depth.
    pub max: f32,
}

impl Default for DepthPlane {
    /// Depth 0 everywhere, and no clamping.
    fn default() -> Self {
        DepthPlane { min: f32::NEG_INFINITY, max: f32::INFINITY, ..DepthPlane::constant(0.0) }
    }
}

/// `v` clamped to `[min, max]`, in the form that compiles to two instructions a vector.
#[inline(always)]
fn clamp(v: f32, min: f32, max: f32) -> f32 {
    let v = if v > min { v } else { min };
    if v < max { v } else { max }
}

impl DepthPlane {
    /// A plane of the same depth everywhere.
    pub const fn constant(z: f32) -> DepthPlane {
        DepthPlane { x0: 0.0, y0: 0.0, z0: z, dzdx: 0.0, dzdy: 0.0, min: z, max: z }
    }

    /// Depth at a window position in pixels; pixel (i, j) has its centre at (i + 0.5, j + 0.5).
    ///
    /// The clamp is exact for every covered sample, which lies in the convex hull of the vertices; what it removes is the
    /// cancellation error of slivers, whose slopes are steep, and extrapolation.
    #[inline(always)]
    pub fn at(&self, x: f32, y: f32) -> f32 {
        let z = self.z0 + (self.dzdx * (x - self.x0) + self.dzdy * (y - self.y0));
        clamp(z, self.min, self.max)
    }

    /// Depths at the four pixel centres of the quad whose upper left pixel is (x, y), in lane order.
    #[inline(always)]
    pub fn quad(&self, x: i32, y: i32) -> [f32; 4] {
        let (x0, y0) = (x as f32 + 0.5, y as f32 + 0.5);
        self.at4([x0, x0 + 1.0, x0, x0 + 1.0], [y0, y0, y0 + 1.0, y0 + 1.0])
    }

    /// [`DepthPlane::at`] at four places: the same operations in the same order, step by step so that they become vectors.
    #[inline(always)]
    pub fn at4(&self, x: [f32; 4], y: [f32; 4]) -> [f32; 4] {
        let mut z = [0.0; 4];
        for p in 0..4 {
            z[p] = self.z0 + (self.dzdx * (x[p] - self.x0) + self.dzdy * (y[p] - self.y0));
        }
        for p in 0..4 {
            z[p] = clamp(z[p], self.min, self.max);
        }
        z
    }

    /// The least and greatest value that [`DepthPlane::at`] takes in a closed rectangle of window positions.
    ///
    /// Not only near: rounding is monotone, so every operation of `at` is a monotone function of x and of y, and so is their
    /// composition. The extremes over a box are therefore the values at two of its corners, bit for bit.
    #[inline(always)]
    pub fn range(&self, x0: f32, y0: f32, x1: f32, y1: f32) -> (f32, f32) {
        let (xl, xh) = if self.dzdx >= 0.0 { (x0, x1) } else { (x1, x0) };
        let (yl, yh) = if self.dzdy >= 0.0 { (y0, y1) } else { (y1, y0) };
        (self.at(xl, yl), self.at(xh, yh))
    }

    /// Bounds of the depth of all samples in a square block of `size` pixels whose upper left pixel is (x, y).
    #[inline(always)]
    pub fn block_range(&self, x: i32, y: i32, size: i32) -> (f32, f32) {
        let (x, y, size) = (x as f32, y as f32, size as f32);
        self.range(x, y, x + size, y + size)
    }
}

/// Unit of the constant depth bias.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum BiasUnit {
    /// The same everywhere: the smallest step of a fixed-point depth format.
    Fixed(f32),
    /// The step of an f32 at the primitive's greatest depth: `2^(e - 23)`, e its exponent.
    Float,
}

/// Depth bias (Vulkan's formula): `o = m * slope + r * constant`, clamped to `clamp` where that is not 0, where m is the
/// greater of |dz/dx| and |dz/dy| and r the unit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DepthBias {
    /// Constant part, in units.
    pub constant: f32,
    /// Factor of the slope.
    pub slope: f32,
    /// Bound: positive an upper, negative a lower one, 0 none.
    pub clamp: f32,
    /// The unit.
    pub unit: BiasUnit,
}

impl DepthBias {
    /// No bias.
    pub const NONE: DepthBias = DepthBias { constant: 0.0, slope: 0.0, clamp: 0.0, unit: BiasUnit::Float };

    /// Whether it changes nothing.
    pub fn is_none(&self) -> bool {
        self.constant == 0.0 && self.slope == 0.0
    }

    /// The offset for a primitive of slope `m` whose vertices' greatest absolute depth is `z`.
    pub(super) fn offset(&self, m: f32, z: f32) -> f32 {
        let unit = match self.unit {
            BiasUnit::Fixed(unit) => unit,
            BiasUnit::Float => {
                let exponent = (z.to_bits() >> 23 & 0xff) as i32 - 127;
                // 2^(e - 23), built from its exponent; below the normal range the least normal number will do.
                f32::from_bits(((exponent - 23).max(-126) + 127) as u32 * (1 << 23))
            }
        };
        let offset = m * self.slope + unit * self.constant;
        let offset = if self.clamp > 0.0 {
            offset.min(self.clamp)
        } else if self.clamp < 0.0 {
            offset.max(self.clamp)
        } else {
            offset
        };
        // A slope beyond all bounds times a factor of 0.
        if offset.is_nan() { 0.0 } else { offset }
    }
}
