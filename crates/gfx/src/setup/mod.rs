//! Triangle, line and point setup: from snapped window vertices to what traversal and interpolation walk on.
//!
//! Everything about coverage is integer arithmetic on 16.8 coordinates and hence exact. Bounds: a snapped coordinate fits 24
//! bits (|v| <= 2^23), a difference of two 25 bits with sign (|d| < 2^24), an edge function the sum of two products of
//! differences (|E| < 2^49). All of these are exact in i64 and, below 2^53, in f64 as well, which interpolation uses.

mod eight;
mod fan;
mod plane;
mod screen;

pub use eight::{Eight, EightBounds, EightQuad, is_small};
pub use fan::fan;
pub use plane::{BiasUnit, DepthBias, DepthPlane};
pub use screen::{Screen, ScreenVertex};

use num::{Fx8, SUBPIXEL, SUBPIXEL_BITS};

use super::state::{CullMode, FrontFace, Rect, Viewport};

/// Sample positions in 1/256 pixel from the pixel's centre, right and down: one sample.
pub const SAMPLES_1: [[Fx8; 2]; 1] = [[0, 0]];

/// Four samples at the standard places of Vulkan and D3D: (0.375, 0.125), (0.875, 0.375), (0.125, 0.625), (0.625, 0.875).
pub const SAMPLES_4: [[Fx8; 2]; 4] = [[-32, -96], [96, -32], [-96, 32], [32, 96]];

/// Half-open rectangle of pixels: `x0 <= x < x1`, `y0 <= y < y1`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub struct Bounds {
    /// First column.
    pub x0: u16,
    /// First row.
    pub y0: u16,
    /// One after the last column.
    pub x1: u16,
    /// One after the last row.
    pub y1: u16,
}

impl Bounds {
    /// Whether it holds no pixel.
    #[inline(always)]
    pub const fn is_empty(&self) -> bool {
        self.x0 >= self.x1 || self.y0 >= self.y1
    }

    /// What both hold.
    #[inline(always)]
    pub fn intersect(&self, other: &Bounds) -> Bounds {
        Bounds { x0: self.x0.max(other.x0), y0: self.y0.max(other.y0), x1: self.x1.min(other.x1), y1: self.y1.min(other.y1) }
    }
}

/// Why setup threw a primitive away.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Culled {
    /// No area (or length) after snapping.
    Degenerate,
    /// Faces away.
    Face,
    /// Its bounding box holds no sample position.
    NoSample,
    /// Its samples lie outside the scissor, the viewport or the target.
    Scissor,
}

/// State of setup, chosen once per draw.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SetupState {
    /// Pixels that may be drawn: target, viewport and scissor.
    pub bounds: Bounds,
    /// Range of the viewport's depth, least first.
    pub depth_range: [f32; 2],
    /// Depth bias.
    pub bias: DepthBias,
    /// Winding of front faces.
    pub front_face: FrontFace,
    /// Faces thrown away.
    pub cull: CullMode,
    /// Samples per pixel, 1 or 4.
    pub samples: u32,
    /// Whether samples on horizontal edges belong to what is above them, not below.
    pub lower_edges: bool,
    /// Whether vertices may lie outside of the depth range: near and far planes do not clip.
    pub unclipped_depth: bool,
    /// Half the width of lines that are rectangles, in 1/256 pixel; none: lines are as [`Triangle::half_width`] says.
    pub half_width: Option<u16>,
}

impl SetupState {
    /// The state for a target of `width` by `height` pixels.
    ///
    /// Of a viewport with fractional edges those pixels may be drawn whose centre is inside, left and top edge included:
    /// what clipping to the view volume under the top-left rule would leave.
    pub fn new(
        (width, height): (u32, u32),
        viewport: &Viewport,
        scissor: Rect,
        front_face: FrontFace,
        cull: CullMode,
        samples: u32,
        bias: DepthBias,
    ) -> SetupState {
        let axis = |start: f32, size: f32, from: u32, len: u32, target: u32| {
            let edge = |v: f32| (f64::from(v) - 0.5).ceil().clamp(0.0, 32768.0) as u32;
            let (a, b) = (start.min(start + size), start.max(start + size));
            let first = edge(a).max(from).min(32768);
            let end = edge(b).min(from.saturating_add(len)).min(target).min(32768);
            (first as u16, end as u16)
        };
        let (x0, x1) = axis(viewport.x, viewport.width, scissor.x, scissor.width, width);
        let (y0, y1) = axis(viewport.y, viewport.height, scissor.y, scissor.height, height);
        let (near, far) = (viewport.min_depth, viewport.max_depth);
        SetupState {
            bounds: Bounds { x0, y0, x1, y1 },
            depth_range: [near.min(far), near.max(far)],
            bias,
            front_face,
            cull,
            samples,
            lower_edges: false,
            unclipped_depth: false,
            half_width: None,
        }
    }

    /// The half width of lines ([`Triangle::half_width`]): 0 with one sample per pixel where nothing makes them rectangles.
    fn half_width(&self) -> u16 {
        self.half_width.unwrap_or(if self.samples == 1 { 0 } else { LINE_HALF })
    }

    /// What the box of a line has about its vertices: a pixel on every side beside the half width, enough for both rules and every tie.
    fn line_margin(&self) -> Fx8 {
        SUBPIXEL + Fx8::from(self.half_width().max(LINE_HALF))
    }

    /// Pixels of which some sample lies in a closed box of window coordinates, greatest edges excluded, or the least ones where these are
    /// horizontal and the rule is the other; not yet scissored.
    #[inline(always)]
    fn pixels(&self, min: [Fx8; 2], max: [Fx8; 2]) -> [i32; 4] {
        // The least and greatest sample offsets from the left (upper) edge of a pixel.
        let (first, last) = if self.samples == 1 { (128, 128) } else { (32, 224) };
        let low = |v: Fx8| (v + (SUBPIXEL - 1 - last)) >> SUBPIXEL_BITS;
        let high = |v: Fx8| (v + (SUBPIXEL - 1 - first)) >> SUBPIXEL_BITS;
        let down = Fx8::from(self.lower_edges);
        [low(min[0]), low(min[1] + down), high(max[0]), high(max[1] + down)]
    }

    /// Pixels of the bounding box of a primitive with these vertices, not scissored: of a line the second vertex is repeated, of a
    /// point the only one.
    pub fn unclipped(&self, shape: Shape, v: &[ScreenVertex; 3]) -> u64 {
        let margin = match shape {
            Shape::Triangle => 0,
            Shape::Line => self.line_margin(),
            Shape::Point => SUBPIXEL / 2,
        };
        let [v0, v1, v2] = v;
        let min = [v0.x.min(v1.x).min(v2.x) - margin, v0.y.min(v1.y).min(v2.y) - margin];
        let max = [v0.x.max(v1.x).max(v2.x) + margin, v0.y.max(v1.y).max(v2.y) + margin];
        let [x0, y0, x1, y1] = self.pixels(min, max);
        (x1 - x0).max(0) as u64 * (y1 - y0).max(0) as u64
    }

    /// Scissors a box of pixels.
    #[inline(always)]
    fn scissored(&self, [x0, y0, x1, y1]: [i32; 4]) -> Result<Bounds, Culled> {
        if x0 >= x1 || y0 >= y1 {
            return Err(Culled::NoSample);
        }
        let b = &self.bounds;
        let (x0, y0) = (x0.max(i32::from(b.x0)), y0.max(i32::from(b.y0)));
        let (x1, y1) = (x1.min(i32::from(b.x1)), y1.min(i32::from(b.y1)));
        if x0 >= x1 || y0 >= y1 {
            return Err(Culled::Scissor);
        }
        Ok(Bounds { x0: x0 as u16, y0: y0 as u16, x1: x1 as u16, y1: y1 as u16 })
    }

    /// Whether a face is thrown away.
    #[inline(always)]
    fn culls(&self, front: bool) -> bool {
        match self.cull {
            CullMode::None => false,
            CullMode::Front => front,
            CullMode::Back => !front,
        }
    }

    /// The biased plane through a point of depth `z` at the snapped position `at`, with slopes per 1/256 pixel: clamped to the viewport's
    /// range, and the ends of depth that is not.
    #[inline(always)]
    fn plane(&self, at: [Fx8; 2], z: [f32; 3], slope: [f64; 2], origin: [i32; 2]) -> (DepthPlane, [f32; 2]) {
        let per_pixel = f64::from(SUBPIXEL);
        let dx = f64::from(origin[0] * SUBPIXEL - at[0]);
        let dy = f64::from(origin[1] * SUBPIXEL - at[1]);
        let mut z_origin = f64::from(z[0]) + (slope[0] * dx + slope[1] * dy);
        let [sx, sy] = [(slope[0] * per_pixel) as f32, (slope[1] * per_pixel) as f32];
        // Selections rather than `min` and `max`, which leave the sign of a zero open.
        let less = |a: f32, b: f32| if a < b { a } else { b };
        let greater = |a: f32, b: f32| if a > b { a } else { b };
        let mut min = less(less(z[0], z[1]), z[2]);
        let mut max = greater(greater(z[0], z[1]), z[2]);
        let [near, far] = self.depth_range;
        let limit = |z: f32| less(greater(z, near), far);
        // What clipping leaves may be rounded to depths beside the range.
        let mut ends = if self.unclipped_depth { [min, max] } else { [limit(min), limit(max)] };
        if !self.bias.is_none() {
            let offset = self.bias.offset(sx.abs().max(sy.abs()), min.abs().max(max.abs()));
            z_origin += f64::from(offset);
            min += offset;
            max += offset;
            ends = ends.map(|end| end + offset);
        }
        let plane = DepthPlane {
            x0: origin[0] as f32,
            y0: origin[1] as f32,
            z0: z_origin as f32,
            dzdx: sx,
            dzdy: sy,
            min: limit(min),
            max: limit(max),
        };
        (plane, ends)
    }
}

/// What a [`Triangle`] really is: all primitives take the same road after setup.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum Shape {
    /// A triangle.
    Triangle,
    /// A line.
    Line,
    /// A point of size 1.
    Point,
}

/// One edge function, `E = c + a x + b y`, x and y in 1/256 pixel from the primitive's [`Triangle::base`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub struct Edge {
    /// Change of E per 1/256 pixel to the right.
    pub a: i32,
    /// Change of E per 1/256 pixel down.
    pub b: i32,
    /// E at the base.
    pub c: i64,
}

impl Edge {
    /// E at `(x, y)` in 1/256 pixel from the base.
    #[inline(always)]
    pub fn at(&self, x: i32, y: i32) -> i64 {
        self.c + i64::from(self.a) * i64::from(x) + i64::from(self.b) * i64::from(y)
    }

    /// Whether samples exactly on this edge of a triangle belong to it: a left edge (the inside is to the right), or a top
    /// edge (horizontal, the inside below), or where `lower` is set a bottom edge.
    #[inline(always)]
    pub const fn owns(&self, lower: bool) -> bool {
        // Not short-circuited: the signs of edges are not predictable.
        (self.a > 0) | ((self.a == 0) & ((self.b > 0) != lower))
    }
}

/// A primitive ready for traversal and interpolation: plain data of its own, no reference to its vertices.
///
/// `edges[i]` is opposite to vertex i and not negative inside; `E_i / (E_0 + E_1 + E_2)` is the weight of vertex i (their sum
/// is the same everywhere). Of a line `edges[1]` grows from 0 at its start to the squared length at its end and `edges[2]` is
/// 0; of a point only `edges[0]` is not 0. Interpolation need not know which it has.
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(C)]
pub struct Triangle {
    /// Edge functions.
    pub edges: [Edge; 3],
    /// 1 / (E_0 + E_1 + E_2).
    pub inv_area: f64,
    /// 1/w of the vertices.
    pub inv_w: [f32; 3],
    /// Depth, as it is tested and written.
    pub depth: DepthPlane,
    /// Least and greatest depth that the fragment stage sees: those of the vertices, biased. Where depth is not clipped they may lie
    /// outside of the viewport's range, to which depth is clamped after the stage.
    pub depth_ends: [f32; 2],
    /// Pixels outside of which nothing is covered: the scissored bounding box. Not empty.
    pub bounds: Bounds,
    /// The snapped first vertex.
    pub start: [Fx8; 2],
    /// What it is.
    pub shape: Shape,
    /// Half the width of a line that is a rectangle, in 1/256 pixel. 0 for a line that draws what leaves its diamond, and for other shapes.
    pub half_width: u16,
    /// Whether it faces front; lines and points do.
    pub front: bool,
    /// Whether samples on horizontal edges belong to what is above them ([`SetupState::lower_edges`]).
    pub lower_edges: bool,
}

impl Triangle {
    /// The pixel at whose centre the edge functions have their constant: the first of the aligned 8x8 block that holds the
    /// first pixel of the bounds.
    #[inline(always)]
    pub fn base(&self) -> [i32; 2] {
        [i32::from(self.bounds.x0 & !7), i32::from(self.bounds.y0 & !7)]
    }

    /// E_0 + E_1 + E_2: twice the area in units of (1/256 pixel) squared for a triangle. Positive.
    #[inline(always)]
    pub fn area(&self) -> i64 {
        self.edges[0].c + self.edges[1].c + self.edges[2].c
    }
}

/// Cross product of two differences.
#[inline(always)]
fn cross(ax: i32, ay: i32, bx: i32, by: i32) -> i64 {
    i64::from(ax) * i64::from(by) - i64::from(ay) * i64::from(bx)
}

/// Twice the signed area, positive where the winding is clockwise on the screen (y down).
#[inline(always)]
fn signed_area(v: &[ScreenVertex; 3]) -> i64 {
    cross(v[1].x - v[0].x, v[1].y - v[0].y, v[2].x - v[0].x, v[2].y - v[0].y)
}

/// Facing of a triangle that is drawn as lines or points: whether it faces front, or why it is not drawn.
#[inline]
pub fn facing(state: &SetupState, v: &[ScreenVertex; 3]) -> Result<bool, Culled> {
    let area = signed_area(v);
    if area == 0 {
        return Err(Culled::Degenerate);
    }
    let front = (area > 0) == (state.front_face == FrontFace::Cw);
    if state.culls(front) { Err(Culled::Face) } else { Ok(front) }
}

/// The first half of [`triangle`]: whether it is drawn at all, and the bounds it will have.
///
/// # Errors
/// Why it is not drawn.
#[inline(always)]
pub fn bounds(state: &SetupState, v: &[ScreenVertex; 3]) -> Result<Bounds, Culled> {
    let signed = signed_area(v);
    if signed == 0 {
        return Err(Culled::Degenerate);
    }
    let front = (signed > 0) == (state.front_face == FrontFace::Cw);
    if state.culls(front) {
        return Err(Culled::Face);
    }
    let [v0, v1, v2] = v;
    let min = [v0.x.min(v1.x).min(v2.x), v0.y.min(v1.y).min(v2.y)];
    let max = [v0.x.max(v1.x).max(v2.x), v0.y.max(v1.y).max(v2.y)];
    state.scissored(state.pixels(min, max))
}

/// Sets a triangle up.
///
/// # Errors
/// Why it is not drawn.
#[inline(always)]
pub fn triangle(state: &SetupState, v: &[ScreenVertex; 3]) -> Result<Triangle, Culled> {
    let bounds = bounds(state, v)?;
    Ok(within(state, v, bounds))
}

/// The second half of [`triangle`], given the bounds that the first half has found.
#[inline(always)]
pub fn within(state: &SetupState, v: &[ScreenVertex; 3], bounds: Bounds) -> Triangle {
    let signed = signed_area(v);
    let front = (signed > 0) == (state.front_face == FrontFace::Cw);
    let [v0, v1, v2] = v;
    let base = [i32::from(bounds.x0 & !7), i32::from(bounds.y0 & !7)];
    let center = base.map(|v| v * SUBPIXEL + SUBPIXEL / 2);
    // Either winding gets edges that are positive inside.
    let sign = if signed > 0 { 1 } else { -1 };
    let edge = |j: &ScreenVertex, k: &ScreenVertex| {
        let (a, b) = ((j.y - k.y) * sign, (k.x - j.x) * sign);
        Edge { a, b, c: i64::from(a) * i64::from(center[0] - j.x) + i64::from(b) * i64::from(center[1] - j.y) }
    };
    let edges = [edge(v1, v2), edge(v2, v0), edge(v0, v1)];
    let inv_area = 1.0 / (signed.abs() as f64);
    // z = z0 + b1 (z1 - z0) + b2 (z2 - z0); the slopes of b1 and b2 are those of their edge functions over the area.
    let (d1, d2) = (f64::from(v1.z) - f64::from(v0.z), f64::from(v2.z) - f64::from(v0.z));
    let slope = [
        (f64::from(edges[1].a) * d1 + f64::from(edges[2].a) * d2) * inv_area,
        (f64::from(edges[1].b) * d1 + f64::from(edges[2].b) * d2) * inv_area,
    ];
    let (depth, depth_ends) = state.plane([v0.x, v0.y], [v0.z, v1.z, v2.z], slope, base);
    Triangle {
        edges,
        inv_area,
        inv_w: [v0.inv_w, v1.inv_w, v2.inv_w],
        depth,
        depth_ends,
        bounds,
        start: [v0.x, v0.y],
        shape: Shape::Triangle,
        half_width: 0,
        front,
        lower_edges: state.lower_edges,
    }
}

/// Half a pixel: half the width of lines that have no other.
const LINE_HALF: u16 = SUBPIXEL as u16 / 2;

/// Sets a line up. `front` is what the fragment stage sees: true but for edges of a polygon that faces back.
///
/// # Errors
/// Why it is not drawn.
pub fn line(state: &SetupState, v: &[ScreenVertex; 2], front: bool) -> Result<Triangle, Culled> {
    let [v0, v1] = v;
    let d = [v1.x - v0.x, v1.y - v0.y];
    let length2 = i64::from(d[0]) * i64::from(d[0]) + i64::from(d[1]) * i64::from(d[1]);
    if length2 == 0 {
        return Err(Culled::Degenerate);
    }
    let margin = state.line_margin();
    let min = [v0.x.min(v1.x) - margin, v0.y.min(v1.y) - margin];
    let max = [v0.x.max(v1.x) + margin, v0.y.max(v1.y) + margin];
    let bounds = state.scissored(state.pixels(min, max))?;
    let base = [i32::from(bounds.x0 & !7), i32::from(bounds.y0 & !7)];
    let center = base.map(|v| v * SUBPIXEL + SUBPIXEL / 2);
    let along = i64::from(d[0]) * i64::from(center[0] - v0.x) + i64::from(d[1]) * i64::from(center[1] - v0.y);
    let inv_area = 1.0 / length2 as f64;
    let dz = (f64::from(v1.z) - f64::from(v0.z)) * inv_area;
    let (depth, depth_ends) = state.plane([v0.x, v0.y], [v0.z, v1.z, v1.z], d.map(|v| f64::from(v) * dz), base);
    Ok(Triangle {
        edges: [Edge { a: -d[0], b: -d[1], c: length2 - along }, Edge { a: d[0], b: d[1], c: along }, Edge::default()],
        inv_area,
        inv_w: [v0.inv_w, v1.inv_w, v1.inv_w],
        depth,
        depth_ends,
        bounds,
        start: [v0.x, v0.y],
        shape: Shape::Line,
        half_width: state.half_width(),
        front,
        lower_edges: state.lower_edges,
    })
}

/// Sets a point of size 1 up. `front` as for [`fn@line`].
///
/// # Errors
/// Why it is not drawn.
pub fn point(state: &SetupState, v: &ScreenVertex, front: bool) -> Result<Triangle, Culled> {
    let half = SUBPIXEL / 2;
    let bounds = state.scissored(state.pixels([v.x - half, v.y - half], [v.x + half, v.y + half]))?;
    let base = [i32::from(bounds.x0 & !7), i32::from(bounds.y0 & !7)];
    let (depth, depth_ends) = state.plane([v.x, v.y], [v.z; 3], [0.0; 2], base);
    Ok(Triangle {
        edges: [Edge { a: 0, b: 0, c: 1 }, Edge::default(), Edge::default()],
        inv_area: 1.0,
        inv_w: [v.inv_w; 3],
        depth,
        depth_ends,
        bounds,
        start: [v.x, v.y],
        shape: Shape::Point,
        half_width: 0,
        front,
        lower_edges: state.lower_edges,
    })
}
