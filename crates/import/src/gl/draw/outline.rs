//! Polygons that are drawn as lines or points (`glPolygonMode`). Facing is computed here, since the card computes it for triangles only.
//!
//! As in Mesa, clip planes of the program cut the polygon before it becomes an outline: edges and corners along such a plane are drawn, and
//! polygons are cut as triangles. Along the sides of the view volume nothing is drawn, but the edges of triangles that these cut have another
//! order, which patterns and edges over each other show.

use gl_shader::arb::program::ProgramStage;
use gl_shader::{PLANES, consts as e};
use glam::{DVec2, DVec3, Mat4, dvec2, dvec3};

use crate::gl::call::{Fault, GlResult};
use crate::gl::draw::lit;
use crate::gl::geometry::clip::{VIEW_VOLUME, between, to_clip};
use crate::gl::geometry::primitive::{Class, OFFSET_STEPS};
use crate::gl::geometry::vertex::Vertex;
use crate::gl::machine::Gl;
use crate::gl::matrix;
use crate::gl::state::server::capability;

/// A step of the depth buffer, which has 24 bits.
const DEPTH_STEP: f64 = 1.0 / 16_777_215.0;

/// Corners of a triangle or of what planes left of one: each with whether the edge that begins there is drawn.
type Piece = Vec<(Vertex, bool)>;

/// What cuts polygons: a function that is negative outside, and whether an edge along it is drawn.
type Cut<'a> = (&'a dyn Fn(&Vertex) -> f32, bool);

impl Gl {
    /// Polygons of which some are drawn as lines or points.
    pub fn outlines(&mut self, mode: u32, vertices: &[Vertex], triangles: &[[u32; 3]]) -> GlResult {
        let n = vertices.len() as u32;
        let polygons: Vec<Vec<u32>> = match mode {
            e::QUADS => (0..n / 4).map(|k| (4 * k..4 * k + 4).collect()).collect(),
            e::QUAD_STRIP => (0..n.saturating_sub(2) / 2).map(|k| vec![2 * k, 2 * k + 1, 2 * k + 3, 2 * k + 2]).collect(),
            e::POLYGON if n > 2 => vec![(0..n).collect()],
            e::POLYGON => Vec::new(),
            _ => triangles.iter().map(|t| t.to_vec()).collect(),
        };
        let clip = to_clip(&self.context.matrices.projection.top, &self.context.matrices.modelview.top);
        let planes: Vec<[f32; 4]> =
            (0..PLANES).filter(|&k| self.state.is(e::CLIP_PLANE0 + k as u32)).map(|k| self.state.transform.planes[k]).collect();
        // Whether a vertex program decides where vertices and clip planes are.
        let program = self.active_program(ProgramStage::Vertex)?;
        for corners in polygons {
            let back = self.is_back(&clip, corners.iter().map(|&i| &vertices[i as usize]));
            let culled = self.state.is(e::CULL_FACE)
                && match self.state.polygon.cull {
                    e::FRONT => !back,
                    e::BACK => back,
                    _ => true,
                };
            if culled {
                continue;
            }
            let edged = !matches!(mode, e::TRIANGLES | e::QUADS | e::POLYGON);
            let mut own: Vec<Vertex> = corners.iter().map(|&i| vertices[i as usize].clone()).collect();
            own.iter_mut().for_each(|vertex| vertex.edge |= edged);
            let count = own.len() as u32;
            // A stippled pattern begins at the edge at which Mesa begins: but for polygons, before the first vertex.
            let first = match mode {
                e::POLYGON => 0,
                e::QUAD_STRIP => 2,
                _ => count - 1,
            };
            let order = (0..count).map(|k| (first + k) % count);
            let edges: Vec<u32> = order.filter(|&k| own[k as usize].edge).collect();
            let (class, indices) = match self.state.polygon.modes[usize::from(back)] {
                e::POINT => (Class::Points, edges),
                e::LINE => (Class::Lines, edges.into_iter().flat_map(|k| [k, (k + 1) % count]).collect()),
                _ => (Class::Triangles, corners_of(mode, count).into_flattened()),
            };
            if self.offsets(class) {
                let offset = self.polygon_offset(&clip, &own);
                own.iter_mut().for_each(|vertex| vertex.offset = offset);
            }
            let polygon = (class != Class::Triangles).then_some(back);
            let (modelview, dashed) = (self.context.matrices.modelview.top, class == Class::Lines && self.line_stippled());
            let sides = VIEW_VOLUME.map(|side| move |vertex: &Vertex| side(matrix::transform(&clip, vertex.position)));
            let planes: Vec<_> = planes
                .iter()
                .map(|&plane| move |vertex: &Vertex| matrix::at_plane(plane, matrix::transform(&modelview, vertex.position)))
                .collect();
            let sides = sides.iter().filter(|_| program.is_none()).map(|side| (side as &dyn Fn(&Vertex) -> f32, false));
            let cuts: Vec<Cut> = sides.chain(planes.iter().map(|plane| (plane as &dyn Fn(&Vertex) -> f32, true))).collect();
            let outside = |cut: &Cut| own.iter().any(|vertex| cut.0(vertex) < 0.0);
            let cut = polygon.is_some() && cuts.iter().any(outside);
            if polygon.is_some()
                && !planes.is_empty()
                && program.as_ref().is_some_and(|active| cut || !active.program.invariant)
            {
                return Err(Fault::Unsupported(
                    "clip planes of polygons drawn as lines or points with a vertex program".into(),
                ));
            }
            if polygon.is_some() && self.state.lighting.flat {
                // The edges and corners of a polygon have the colour of its provoking vertex.
                let provoking = match mode {
                    e::POLYGON => 0,
                    e::QUAD_STRIP => 2,
                    _ => count as usize - 1,
                };
                if program.is_some() {
                    let what = "flat shading of polygons drawn as lines or points with a vertex program";
                    return Err(Fault::Unsupported(what.into()));
                }
                let (color, secondary) = lit::colors_of_side(&self.state, &modelview, &own[provoking], back);
                own.iter_mut().for_each(|vertex| (vertex.color, vertex.secondary) = (color, secondary));
            } else if cut {
                // What lies between corners has a colour between theirs, not that of a normal between theirs.
                self.light(&mut own, back);
            }
            if cut {
                for (vertices, indices) in pieces(mode, &own, class, &cuts) {
                    self.add_lit(class, back, &vertices, &indices)?;
                }
                continue;
            }
            if polygon.is_some() && self.state.lighting.flat {
                self.add_lit(class, back, &own, &indices)?;
                continue;
            }
            if dashed {
                // The pattern continues from edge to edge.
                self.add(class, polygon, &own, &indices)?;
                continue;
            }
            let used: Vec<Vertex> = indices.iter().map(|&k| own[k as usize].clone()).collect();
            let all: Vec<u32> = (0..used.len() as u32).collect();
            self.add(class, polygon, &used, &all)?;
        }
        Ok(())
    }

    /// Appends lines or points of a polygon, whose vertices have been lit and cut. Where there is lighting, or the program has clip planes, they
    /// are a draw of their own without these.
    fn add_lit(&mut self, class: Class, back: bool, vertices: &[Vertex], indices: &[u32]) -> GlResult {
        let planes = (0..PLANES).filter_map(|k| capability(e::CLIP_PLANE0 + k as u32)).fold(0, |all, bit| all | bit);
        let (enabled, without) = (self.state.enabled, self.without_lighting() & !planes);
        if enabled == without {
            return self.add(class, Some(back), vertices, indices);
        }
        self.with_enabled(without, |gl| gl.add(class, Some(false), vertices, indices))
    }

    /// The depth offset of a polygon (OpenGL 1.5, section 3.5.5), in window coordinates. The slope of a polygon that is not flat is that of
    /// its mean plane.
    fn polygon_offset(&self, clip: &Mat4, corners: &[Vertex]) -> f32 {
        let [factor, units] = self.state.polygon.offset.map(f64::from);
        let [near, far] = self.state.transform.depth_range.map(f64::from);
        let [_, _, width, height] = self.state.transform.viewport.map(f64::from);
        let window = |vertex: &Vertex| {
            let [x, y, z, w] = matrix::transform(clip, vertex.position).map(f64::from);
            dvec3(0.5 * width * x, 0.5 * height * y, (far - near) * z) / w
        };
        // Twice the area of a polygon that is projected to each of the planes between the axes.
        let first = window(&corners[0]);
        let from_first: Vec<DVec3> = corners[1..].iter().map(|vertex| window(vertex) - first).collect();
        let normal: DVec3 = from_first.windows(2).map(|pair| pair[0].cross(pair[1])).sum();
        let slope = normal.x.abs().max(normal.y.abs()) / normal.z.abs();
        // The slope of a polygon that is seen from its edge has no bound.
        let by_slope = if factor == 0.0 || slope.is_nan() { 0.0 } else { factor * slope };
        (by_slope + units * f64::from(OFFSET_STEPS) * DEPTH_STEP).clamp(-1.0, 1.0) as f32
    }

    /// Whether a polygon is back-facing, by the sign of its area in the window.
    fn is_back<'a>(&self, clip: &Mat4, corners: impl Iterator<Item = &'a Vertex>) -> bool {
        let window: Vec<DVec2> = corners
            .map(|vertex| {
                let [x, y, _, w] = matrix::transform(clip, vertex.position).map(f64::from);
                dvec2(x, y) / w
            })
            .collect();
        let area: f64 = (0..window.len()).map(|k| window[k].perp_dot(window[(k + 1) % window.len()])).sum();
        (area < 0.0) == (self.state.polygon.front == e::CCW)
    }
}

/// The triangles of a polygon of `count` corners as Mesa draws them where some faces are not filled; the last corner of each gives its flat
/// colour.
fn corners_of(mode: u32, count: u32) -> Vec<[u32; 3]> {
    match mode {
        e::QUADS => vec![[0, 1, 3], [1, 2, 3]],
        e::QUAD_STRIP => vec![[3, 0, 2], [0, 1, 2]],
        e::POLYGON => (2..count).map(|k| [k - 1, k, 0]).collect(),
        _ => (2..count).map(|k| [0, k - 1, k]).collect(),
    }
}

/// A polygon as the triangles that Mesa cuts: their corners in its order. Inner edges are not drawn.
fn triangles_of(mode: u32, corners: &[Vertex]) -> Vec<Piece> {
    let n = corners.len() as u32;
    let outer = |[from, to]: [u32; 2]| to == (from + 1) % n;
    let piece = |triangle: [u32; 3]| {
        let edge = |k: usize| {
            let ends = [triangle[k], triangle[(k + 1) % 3]];
            let corner = &corners[ends[0] as usize];
            (corner.clone(), corner.edge && outer(ends))
        };
        vec![edge(0), edge(1), edge(2)]
    };
    corners_of(mode, n).into_iter().map(piece).collect()
}

/// The vertices and indices of the lines or points that are left of a polygon's triangles. A pattern begins anew in each of these lists.
fn pieces(mode: u32, corners: &[Vertex], class: Class, cuts: &[Cut]) -> Vec<(Vec<Vertex>, Vec<u32>)> {
    let mut lists = Vec::new();
    for triangle in triangles_of(mode, corners) {
        // Of a triangle that is whole the last edge comes first. One that is cut does not continue a pattern.
        let left = cut_by(&triangle, cuts);
        let first = if left.is_some() { 0 } else { 2 };
        if left.is_some() || lists.is_empty() {
            lists.push((Vec::new(), Vec::new()));
        }
        let Some((vertices, indices)) = lists.last_mut() else { continue };
        let piece = left.unwrap_or(triangle);
        let (base, count) = (vertices.len() as u32, piece.len() as u32);
        for k in (0..count).map(|k| (first + k) % count).filter(|&k| piece[k as usize].1) {
            indices.push(base + k);
            if class == Class::Lines {
                indices.push(base + (k + 1) % count);
            }
        }
        vertices.extend(piece.into_iter().map(|(vertex, _)| vertex));
    }
    lists
}

/// What is left of a convex polygon; none if nothing is cut off.
fn cut_by(corners: &Piece, cuts: &[Cut]) -> Option<Piece> {
    let (mut left, mut any) = (corners.clone(), false);
    for (distance, drawn) in cuts {
        let distances: Vec<f32> = left.iter().map(|(vertex, _)| distance(vertex)).collect();
        if distances.iter().all(|&distance| distance >= 0.0) {
            continue;
        }
        any = true;
        let mut inside = Vec::new();
        for (k, (vertex, edge)) in left.iter().enumerate() {
            let next = (k + 1) % left.len();
            let (here, there) = (distances[k], distances[next]);
            if here >= 0.0 {
                inside.push((vertex.clone(), *edge));
            }
            let crossing = || between(&[vertex.clone(), left[next].0.clone()], here / (here - there));
            match (here >= 0.0, there >= 0.0) {
                (true, false) => inside.push((crossing(), *drawn)),
                (false, true) => inside.push((crossing(), *edge)),
                _ => {}
            }
        }
        left = if inside.len() > 2 { inside } else { Vec::new() };
    }
    any.then_some(left)
}
