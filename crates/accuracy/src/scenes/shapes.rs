//! Triangles on the grid of 1/256 pixel, by exact integer arithmetic.

/// A corner: x and y in 1/256 pixel, y down.
pub type Corner = [i64; 2];

/// Twice the signed area of three corners.
pub fn area(a: Corner, b: Corner, c: Corner) -> i64 {
    (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
}

/// The centre of a pixel.
pub fn center(x: u32, y: u32) -> Corner {
    [i64::from(x) * 256 + 128, i64::from(y) * 256 + 128]
}

/// Whether a triangle covers a point, with the rule that points on top and left edges are inside.
pub fn covers([a, b, c]: [Corner; 3], p: Corner) -> bool {
    let [a, b, c] = if area(a, b, c) < 0 { [a, c, b] } else { [a, b, c] };
    area(a, b, c) != 0
        && [[a, b], [b, c], [c, a]].iter().all(|&[from, to]| {
            let side = area(from, to, p);
            let (dx, dy) = (to[0] - from[0], to[1] - from[1]);
            // With y down and this winding, a top edge goes right and a left edge goes up.
            side > 0 || side == 0 && (dy < 0 || dy == 0 && dx > 0)
        })
}

/// Positions in clip space of corners on a target of `width` x `height` pixels. Both are powers of two, so that positions are exact in f32.
pub fn clip([x, y]: Corner, [width, height]: [u32; 2], z: f32) -> [f32; 4] {
    [x as f32 / (128 * width) as f32 - 1.0, 1.0 - y as f32 / (128 * height) as f32, z, 1.0]
}
