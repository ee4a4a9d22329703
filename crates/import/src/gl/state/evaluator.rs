//! Evaluators: Bezier curves and surfaces (OpenGL 1.5, section 5.1).

/// The greatest order.
pub const ORDER_MAX: usize = 30;
/// Components of the points of maps, from `GL_MAP1_COLOR_4` (or `GL_MAP2_COLOR_4`) on.
pub const COMPONENTS: [usize; 9] = [4, 1, 3, 1, 2, 3, 4, 3, 4];
pub const COLOR: usize = 0;
pub const NORMAL: usize = 2;
pub const TEXTURE: usize = 3;
pub const VERTEX_3: usize = 7;
pub const VERTEX_4: usize = 8;

/// A map: from, to, order in u and v; points.
#[derive(Clone)]
pub struct Map {
    u: (f32, f32, usize),
    v: (f32, f32, usize),
    points: Vec<[f32; 4]>,
}

/// All maps.
#[derive(Clone, Default)]
pub struct Maps {
    maps: [[Option<Map>; 9]; 2],
}

impl Maps {
    /// A map of curves or surfaces, by its number among those.
    pub fn get(&self, surface: bool, index: usize) -> Option<&Map> {
        self.maps[usize::from(surface)][index].as_ref()
    }

    /// Sets a map: for u and v from, to and order; and the points.
    pub fn set(&mut self, surface: bool, index: usize, [u, v]: [(f32, f32, usize); 2], points: Vec<[f32; 4]>) {
        self.maps[usize::from(surface)][index] = Some(Map { u, v, points });
    }
}

/// Weights of the control points, and their derivatives (Bernstein polynomials).
fn weights(order: usize, t: f32) -> (Vec<f32>, Vec<f32>) {
    let build = |degree: usize| {
        let mut weights = vec![1.0];
        for _ in 0..degree {
            let mut next = vec![0.0; weights.len() + 1];
            for (k, weight) in weights.iter().enumerate() {
                next[k] += weight * (1.0 - t);
                next[k + 1] += weight * t;
            }
            weights = next;
        }
        weights
    };
    let degree = order - 1;
    let mut derivative = vec![0.0; order];
    if degree > 0 {
        for (k, weight) in build(degree - 1).iter().enumerate() {
            derivative[k] -= degree as f32 * weight;
            derivative[k + 1] += degree as f32 * weight;
        }
    }
    (build(degree), derivative)
}

impl Map {
    /// The value and both derivatives.
    pub fn at(&self, u: f32, v: f32) -> [[f32; 4]; 3] {
        let place = |(from, to, order): (f32, f32, usize), t: f32| weights(order, (t - from) / (to - from));
        let ((wu, du), (wv, dv)) = (place(self.u, u), place(self.v, v));
        let mut sums = [[0.0; 4]; 3];
        for (i, row) in self.points.chunks_exact(wv.len()).enumerate() {
            for (j, point) in row.iter().enumerate() {
                for k in 0..4 {
                    sums[0][k] += wu[i] * wv[j] * point[k];
                    sums[1][k] += du[i] * wv[j] * point[k];
                    sums[2][k] += wu[i] * dv[j] * point[k];
                }
            }
        }
        sums
    }
}
