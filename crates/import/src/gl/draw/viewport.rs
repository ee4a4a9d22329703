//! Points and lines are clipped by their middle alone, so they may reach out of the viewport (OpenGL 1.5, section 2.11). The card cuts at the
//! viewport: where this is a part of what is drawn to, points and lines become triangles, whose viewport is larger.

use gfx::state::Viewport;
use gl_shader::consts as e;
use gl_shader::key::{Expand, ShaderKey};
use num::SUBPIXEL;

use crate::gl::card::pass::{Buffer, Target};
use crate::gl::geometry::primitive::Class;
use crate::gl::machine::Gl;

/// How far points and lines reach beside their middle at most, in pixels: Mesa's are up to 255 wide.
const REACH: f32 = 128.0;

/// How many times as wide and high as the program's the viewport is for points and lines that become triangles. Powers of two: positions stay
/// the same to the bit.
pub fn wider([x, y, width, height]: [i32; 4], target: [u32; 2]) -> [f32; 2] {
    let covers = |from: i32, size: i32, whole: u32| from <= 0 && i64::from(from) + i64::from(size) >= i64::from(whole);
    if covers(x, width, target[0]) && covers(y, height, target[1]) {
        return [1.0; 2];
    }
    [width, height].map(|size| {
        let mut wider = 2.0;
        while 0.5 * (wider - 1.0) * (size.max(1) as f32) < REACH {
            wider *= 2.0;
        }
        wider
    })
}

impl Gl {
    /// Whether points and lines become triangles since the viewport is a part of what is drawn to, which has this size. Where a program
    /// computes positions, those of width 1 are cut at the viewport.
    pub fn reaches_out_of(&self, size: [u32; 2]) -> bool {
        self.state.programs == 0 && self.context.glsl_program == 0 && wider(self.state.transform.viewport, size) != [1.0; 2]
    }

    /// Whether lines become triangles.
    pub fn widens_lines(&mut self) -> bool {
        self.state.is(e::LINE_SMOOTH) || self.state.line.width >= 1.5 || self.reaches_out()
    }

    /// [`Gl::reaches_out_of`] what is drawn to at present.
    pub fn reaches_out(&mut self) -> bool {
        let target = match self.context.framebuffers.draw {
            0 => self.card.window_target(Buffer::Back),
            name => self.target_of(name).ok(),
        };
        target.is_some_and(|target| self.reaches_out_of(target.size))
    }

    /// The card's viewport for a draw.
    pub fn viewport(&self, target: &Target, key: &ShaderKey, class: Class) -> Viewport {
        let height = target.size[1] as f32;
        let [mut x, y, w, h] = self.state.transform.viewport.map(|value| value as f32);
        let [min_depth, max_depth] = self.state.transform.depth_range;
        let mut y = if target.upward { y } else { height - y - h };
        // A point without smoothing has the pixels around floor(x) + 1/2, or floor(x + 1/2) where its size is even (OpenGL 1.5, section 3.3):
        // the rule of the card's edges leaves out the right one of two columns at the same distance. One step of its grid decides. Rows
        // are counted from below.
        if class == Class::Points && key.expand != Expand::SmoothPoint && !self.state.is(e::POINT_SPRITE) {
            const STEP: f32 = 1.0 / SUBPIXEL as f32;
            x += STEP;
            y += if target.upward { STEP } else { 0.0 };
        }
        let [i, j] = if key.expand == Expand::No { [1.0; 2] } else { wider(self.state.transform.viewport, target.size) };
        let (x, y) = (x - 0.5 * (i - 1.0) * w, y - 0.5 * (j - 1.0) * h);
        Viewport { x, y, width: i * w, height: j * h, min_depth, max_depth }
    }
}

#[cfg(test)]
mod tests {
    use super::wider;

    #[test]
    fn a_viewport_that_is_a_part_is_enlarged_by_what_points_and_lines_reach() {
        assert_eq!(wider([0, 0, 640, 480], [640, 480]), [1.0; 2]);
        assert_eq!(wider([-5, 0, 700, 480], [640, 480]), [1.0; 2]);
        assert_eq!(wider([0, 1, 640, 479], [640, 480]), [2.0; 2]);
        // 1 and 20 pixels become 512 and 320: at least 128 on each side.
        assert_eq!(wider([0, 0, 1, 20], [640, 480]), [512.0, 16.0]);
        // The largest, the farthest away, is one that the trace may have.
        let far = wider([32_767, -32_768, 16_384, 16_384], [640, 480]);
        assert!(far.iter().all(|by| 32_768.0 + 16_384.0 * (1.0 + 0.5 * (by - 1.0)) <= 65_536.0));
    }
}
