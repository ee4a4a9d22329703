//! Primitives of which nothing is drawn, and which a card that does not find that out in geometry takes further: recorded for such
//! machines ([`CulledLate`](work::CulledLate)). A primitive has one triangle of this kind, whatever it would be cut into.

use gfx::assemble::PrimitiveKind;
use gfx::clip::ClipVolume;
use gfx::setup::{DepthPlane, ScreenVertex};
use gfx::state::{FrontFace, PolygonMode};
use num::{SUBPIXEL, SUBPIXEL_BITS};
use work::{self, BLOCK, End, PrimitiveOutcome, Segment};

use super::batch::{Batch, Input};

/// A primitive that ends behind geometry.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Late {
    /// Number in its batch; in [`insert`], in its segment.
    pub primitive: u32,
    /// The stage in which it ends. None if it ends where it is cut.
    pub end: Option<End>,
    /// Whether it faces away, by its area before its corners are snapped. A primitive without area does not face away.
    pub back: bool,
    /// Pixels about it, as those of [`work::Triangle`]; none outside of the attachments.
    pub pixels: [u16; 4],
    /// Pixels about it that no attachment bounds.
    pub unclipped: u64,
}

impl Batch {
    /// Notes a primitive that has ended, if its triangle goes on. `made` is the first of the vertices that cutting it made.
    pub(super) fn note_late(
        &mut self,
        input: &Input<'_, '_>,
        number: u32,
        v: [u32; 3],
        outcome: PrimitiveOutcome,
        made: usize,
    ) {
        let (call, vertices) = (input.call, input.vertices);
        if !call.options.key.needless.keeps(outcome) {
            return;
        }
        let v = v.map(|v| v as usize);
        // Outside as a whole, without a plane of its own to be cut at: its corners have a place in the window. All others that are
        // outside are found to be so by cutting them.
        let codes = v.map(|v| vertices.codes[v]);
        if outcome == PrimitiveOutcome::Frustum && !ClipVolume::is_in_band(&codes) {
            return self.late.push(Late { primitive: number, end: None, back: false, pixels: [0; 4], unclipped: 0 });
        }
        let cut = &self.made_screen[made..];
        let own = v.map(|v| vertices.screen[v]);
        let corners = if cut.is_empty() { &own[..] } else { cut };
        let primitive = &call.pipeline.primitive;
        let filled = PrimitiveKind::of(call.topology) == PrimitiveKind::Triangle && primitive.polygon_mode == PolygonMode::Fill;
        let margin = if filled { 0 } else { SUBPIXEL / 2 };
        let drawn = call.setup.bounds;
        // A primitive of which the scissor rectangle leaves nothing is looked for in the area of the attachments.
        let within = match outcome {
            PrimitiveOutcome::Scissor | PrimitiveOutcome::Frustum => [0, 0, call.width as i32, call.height as i32],
            _ => [drawn.x0, drawn.y0, drawn.x1, drawn.y1].map(i32::from),
        };
        let pixels = pixels(corners, margin, within);
        let walked = matches!(outcome, PrimitiveOutcome::Scissor | PrimitiveOutcome::NoSample) && pixels != [0; 4];
        let end = Some(if walked { End::Traversal } else { End::Setup });
        let [x0, y0, x1, y1] = box_of(corners, margin);
        let unclipped = (x1 - x0) as u64 * (y1 - y0) as u64;
        let area = if filled { call.screen.area_sign(&v.map(|v| vertices.clip[v])) } else { 0.0 };
        let back = area != 0.0 && (area > 0.0) != (call.setup.front_face == FrontFace::Cw);
        self.late.push(Late { primitive: number, end, back, pixels, unclipped });
    }
}

/// The pixels that hold the box of some vertices.
fn box_of(corners: &[ScreenVertex], margin: i32) -> [i32; 4] {
    let axis = |of: fn(&ScreenVertex) -> i32| {
        let first = corners.iter().map(of).min().unwrap_or(0) - margin;
        let last = corners.iter().map(of).max().unwrap_or(0) + margin;
        [first >> SUBPIXEL_BITS, (last >> SUBPIXEL_BITS) + 1]
    };
    let ([left, right], [top, bottom]) = (axis(|v| v.x), axis(|v| v.y));
    [left, top, right, bottom]
}

/// The pixels that hold the box of some vertices, as far as it lies within a rectangle of pixels; zeros if it does not.
fn pixels(corners: &[ScreenVertex], margin: i32, [x0, y0, x1, y1]: [i32; 4]) -> [u16; 4] {
    let [left, top, right, bottom] = box_of(corners, margin);
    let (left, top, right, bottom) = (left.max(x0), top.max(y0), right.min(x1), bottom.min(y1));
    if left >= right || top >= bottom { [0; 4] } else { [left, top, right, bottom].map(|v| v as u16) }
}

/// The blocks that hold pixels.
fn blocks([x0, y0, x1, y1]: [u16; 4]) -> [u16; 4] {
    let block = BLOCK as u16;
    [x0 / block, y0 / block, x1.div_ceil(block), y1.div_ceil(block)]
}

/// Puts triangles of primitives that end late among those of a segment, in the order of primitives. What covers no sample is looked
/// for in its bounds, if that is `walked`.
pub fn insert(segment: &mut Segment, late: &[Late], walked: bool) {
    if walked {
        for triangle in segment.triangles.iter_mut().filter(|triangle| triangle.visits == 0) {
            triangle.end = End::Traversal;
        }
    }
    if late.is_empty() {
        return;
    }
    let own = std::mem::take(&mut segment.triangles);
    segment.triangles.reserve_exact(own.len() + late.len());
    let mut late = late.iter().peekable();
    for (number, primitive) in (0..).zip(&mut segment.primitives) {
        let first = std::mem::replace(&mut primitive.first_triangle, segment.triangles.len() as u32);
        segment.triangles.extend_from_slice(&own[first as usize..][..usize::from(primitive.triangles)]);
        let Some(&Late { end, back, pixels, unclipped, .. }) = late.next_if(|late| late.primitive == number) else { continue };
        primitive.cut_away = end.is_none();
        primitive.triangles = u8::from(end.is_some());
        segment.triangles.extend(end.map(|end| work::Triangle {
            primitive: number,
            depth: DepthPlane::default(),
            back,
            bounds: blocks(pixels),
            pixels,
            unclipped,
            first_visit: 0,
            visits: 0,
            end,
        }));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(x: i32, y: i32) -> ScreenVertex {
        ScreenVertex { x, y, ..ScreenVertex::default() }
    }

    #[test]
    fn boxes_are_those_of_the_vertices_inside_of_what_is_looked_at() {
        let corners = [at(8 * 256, 0), at(17 * 256, 16 * 256 - 1), at(9 * 256, 3)];
        assert_eq!(blocks(pixels(&corners, 0, [0, 0, 64, 64])), [1, 0, 3, 2]);
        assert_eq!(blocks(pixels(&corners, 128, [0, 0, 64, 64])), [0, 0, 3, 3]);
        assert_eq!(blocks(pixels(&corners, 0, [0, 0, 16, 8])), [1, 0, 2, 1]);
        assert_eq!(blocks(pixels(&corners, 0, [20, 0, 64, 64])), [0; 4]);
        assert_eq!(blocks(pixels(&[at(-300, -1), at(-256, -700), at(-257, -5)], 0, [0, 0, 64, 64])), [0; 4]);
    }
}
