//! Where the rules for lines and points meet: joints of a strip, borders of pixels. (`fillrate accuracy oracle` has the rules.)

mod raster_common;

use fillrate::gfx::setup::{self, ScreenVertex};
use raster_common::*;

fn line_pixels(samples: u32, from: [i32; 2], to: [i32; 2], window: [i32; 4]) -> Image {
    let state = state(samples, window);
    let vertex = |[x, y]: [i32; 2]| ScreenVertex { x, y, z: 0.5, inv_w: 1.0 };
    let mut image = Image::new(window);
    match setup::line(&state, &[vertex(from), vertex(to)], true) {
        Ok(line) if samples == 1 => image.draw::<1>(&line),
        Ok(line) => image.draw::<4>(&line),
        Err(_) => {}
    }
    image
}

#[test]
fn a_line_strip_draws_each_joint_once() {
    // What diamond exit is for: the end of one line is the start of the next, and no pixel is lost or drawn twice.
    for (from, middle, to) in [([0, 3], [10, 3], [20, 3]), ([2, 2], [9, 9], [20, 20]), ([20, 1], [11, 4], [2, 7])] {
        let window = [0, 0, 32, 32];
        let center = |p: [i32; 2]| p.map(|v| v * 256 + 128);
        let (a, b) = (line_pixels(1, center(from), center(middle), window), line_pixels(1, center(middle), center(to), window));
        let whole = line_pixels(1, center(from), center(to), window);
        for y in 0..32 {
            for x in 0..32 {
                assert_eq!(a.hits(x, y, 0) + b.hits(x, y, 0), whole.hits(x, y, 0), "{x} {y}");
            }
        }
    }
}

#[test]
fn a_point_is_one_pixel() {
    let window = [0, 0, 16, 16];
    for x in 0..16 * 256 {
        let y = (x * 7) % (16 * 256);
        let mut image = Image::new(window);
        let point = setup::point(&state(1, window), &ScreenVertex { x, y, z: 0.0, inv_w: 1.0 }, true);
        // A position on the border of two pixels belongs to the left or upper one.
        let (column, row) = ((x - 1) >> 8, (y - 1) >> 8);
        let Ok(point) = point else {
            assert!(column < 0 || row < 0, "{x} {y}");
            continue;
        };
        image.draw::<1>(&point);
        assert_eq!(image.total(), 1);
        assert_eq!(image.hits(column, row, 0), 1);
    }
}
