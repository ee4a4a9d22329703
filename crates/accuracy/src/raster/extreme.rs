//! Snapping to sub-pixels, and positions of every size.

use anyhow::{Result, ensure};

use super::draw::{Image, state, viewport};
use crate::{Row, Section, Setting, Target};
use gfx::clip::{ClipVolume, Clipped, NOT_FINITE, Polygon};
use gfx::setup::{self, Screen, ScreenVertex};
use gfx::state::Viewport;
use num::{Random, snap};

pub const SNAP: Target = Target {
    id: "snap",
    section: Section::Raster,
    what: "From floating point to 16.8: rounding to nearest, ties to even; NaN becomes 0, what is outside of the guard band clamps",
    bound: "exact",
    fault: "the number is snapped with its last bit inverted",
    check: snapping,
};

pub const EXTREME: Target = Target {
    id: "extreme",
    section: Section::Raster,
    what: "Positions of every size up to the largest number, w down to 1e-6 and across 0, NaN and infinity in any component",
    bound: "none drawn that is not finite, nothing else than finite numbers after clipping and setup, the same on every run",
    fault: "clipping does not know which positions are not finite",
    check: extreme,
};

/// Where a number of pixels must snap to, in f64, in which all of this is exact.
fn snapped(pixels: f32) -> i32 {
    let scaled = f64::from(pixels) * 256.0;
    if scaled.is_nan() {
        return 0;
    }
    let clamped = scaled.clamp(-8_388_608.0, 8_388_607.0);
    let below = clamped.floor();
    let up = match clamped - below {
        part if part > 0.5 => true,
        part if part < 0.5 => false,
        _ => below % 2.0 != 0.0,
    };
    below as i32 + i32::from(up)
}

fn snapping(setting: &Setting) -> Result<Vec<Row>> {
    // A viewport that changes nothing: half a width of 1, the centre at 0.
    let screen = Screen::new(&Viewport { x: -1.0, y: 1.0, width: 2.0, height: -2.0, min_depth: 0.0, max_depth: 1.0 });
    let wrong = |pixels: f32| {
        let expected = snapped(pixels);
        let given = if setting.inject_fault { f32::from_bits(pixels.to_bits() ^ 1) } else { pixels };
        // Alone, and as a vertex on its way to setup. -0.0 + 0.0 is 0.0, which snaps to the same.
        let vertex = screen.vertex([given, given, 0.0, 1.0]);
        u64::from(snap(given) != expected) + u64::from(vertex.x != expected) + u64::from(vertex.y != expected)
    };
    let pieces = |n: u64, each: &(dyn Fn(u64, &mut Random) -> u64 + Sync)| setting.pieces(n, each).into_iter().sum::<u64>();
    // All ties of the guard band and their neighbours on both sides: (k + 1/2) / 256.
    let every = setting.pick(1_009, 1, 1);
    let ties = pieces(256, &|piece, _| {
        let first = (piece as i64 - 128) << 16;
        (first..first + (1 << 16))
            .step_by(every)
            .map(|k| {
                let tie = ((k as f64 + 0.5) / 256.0) as f32;
                let near = |step: i32| f32::from_bits(tie.to_bits().wrapping_add_signed(step));
                wrong(tie) + wrong(near(1)) + wrong(near(-1))
            })
            .sum()
    });
    // Every bit pattern, or some of them.
    let every = setting.pick(65_537, 257, 1);
    let patterns = pieces(256, &|piece, _| {
        let first = (piece as u32) << 24;
        (first..=first | 0xff_ffff).step_by(every).map(|bits| wrong(f32::from_bits(bits))).sum()
    });
    let special =
        [f32::NAN, -f32::NAN, f32::INFINITY, f32::NEG_INFINITY, f32::MAX, f32::MIN, 0.0, -0.0, 1e-45, 32_767.998, 32_768.0];
    Ok(vec![
        Row::none("ties and their neighbours", ties),
        Row::none("numbers of every size", patterns),
        Row::none("NaN, infinities, ends of the guard band", special.into_iter().map(wrong).sum()),
    ])
}

/// A number of any size.
fn wild(random: &mut Random) -> f32 {
    let huge = f32::MAX / 16.0;
    let sign = if random.below(2) == 0 { 1.0 } else { -1.0 };
    sign * match random.below(15) {
        0 => huge,
        1 => f32::MAX,
        2 => 0.0,
        3 => f32::MIN_POSITIVE,
        4 => 1.0e-40,
        5 => 1.0e-6,
        6 => f32::NAN,
        7 => f32::INFINITY,
        8 => 1.0e19,
        9 => huge * random.unit(),
        10 => libm::exp2f(random.between(-125, 126) as f32),
        11 => 1.0e-6 * random.unit(),
        _ => random.range(0.0, 3.0),
    }
}

/// What came of a triangle.
#[derive(Clone, Debug, PartialEq)]
struct Run {
    clipped: Clipped,
    /// Numbers after clipping, projection and setup that are none, and vertices not in front of the eye.
    wrong: u64,
    hits: Vec<i32>,
}

fn run(position: &[[f32; 4]; 3], unclipped: bool, inject_fault: bool) -> Run {
    const SIZE: i32 = 24;
    let (volume, screen) = (ClipVolume::new(&viewport(SIZE), unclipped), Screen::new(&viewport(SIZE)));
    let state = state(1, [0, 0, SIZE, SIZE]);
    let told = if inject_fault { !NOT_FINITE } else { !0 };
    let mut polygon = Polygon::EMPTY;
    let clipped = volume.triangle(position, position.map(|p| volume.outcode(p) & told), &mut polygon);
    if clipped == Clipped::Whole {
        polygon.set(position);
    }
    let mut wrong = 0;
    let mut check = |holds: bool| wrong += u64::from(!holds);
    let mut image = Image::new([0, 0, SIZE, SIZE], 1, false);
    if clipped != Clipped::Rejected {
        let mut vertices: Vec<ScreenVertex> = Vec::new();
        for v in polygon.vertices() {
            check(v.position.iter().chain(&v.weights).all(|x| x.is_finite()));
            check(v.position[3] > 0.0);
            let snapped = screen.clipped(v);
            check(snapped.x.abs() <= 32_768 * 256 && snapped.y.abs() <= 32_768 * 256);
            check(snapped.z.is_finite() && snapped.inv_w.is_normal() && snapped.inv_w > 0.0);
            vertices.push(snapped);
        }
        for t in setup::fan(&vertices) {
            if let Ok(t) = setup::triangle(&state, &t.map(|i| vertices[i])) {
                let d = t.depth;
                check([d.z0, d.dzdx, d.dzdy, d.min, d.max].iter().all(|v| v.is_finite()));
                check(t.inv_area.is_normal() && t.inv_area > 0.0);
                image.draw(&t, 1);
            }
        }
    }
    Run { clipped, wrong: wrong + image.wrong, hits: image.all().to_vec() }
}

fn extreme(setting: &Setting) -> Result<Vec<Row>> {
    let each = 500;
    let counts = setting.pieces(setting.pick(10, 2_000, 40_000), |_, random| {
        let [mut drawn, mut wrong, mut differ, mut cut, mut whole, mut covered] = [0; 6];
        for case in 0..each {
            // Some wild components among tame ones.
            let share = random.below(13);
            let position: [[f32; 4]; 3] = std::array::from_fn(|_| {
                std::array::from_fn(|k| match k {
                    _ if random.below(12) < share => wild(random),
                    // Across 0 now and then.
                    3 => random.range(if case % 4 == 0 { -1.0 } else { 0.1 }, 2.0),
                    _ => random.range(-1.0, 1.5),
                })
            });
            let unclipped = case % 3 == 0;
            let first = run(&position, unclipped, setting.inject_fault);
            let finite = position.iter().flatten().all(|v| v.is_finite());
            drawn += u64::from(!finite && first.clipped != Clipped::Rejected);
            wrong += first.wrong;
            cut += u64::from(first.clipped == Clipped::Cut);
            whole += u64::from(first.clipped == Clipped::Whole);
            covered += first.hits.iter().map(|&hits| hits as u64).sum::<u64>();
            differ += u64::from(case % 8 == 0 && run(&position, unclipped, setting.inject_fault) != first);
        }
        [drawn, wrong, differ, cut, whole, covered]
    });
    let sum = |k: usize| counts.iter().map(|counts| counts[k]).sum::<u64>();
    ensure!(sum(3) > 200 && sum(4) > 50 && sum(5) > 1_000, "too few were cut, whole or seen: {:?}", [sum(3), sum(4), sum(5)]);
    Ok(vec![
        Row::none("triangles drawn with a position that is not finite", sum(0)),
        Row::none("numbers after clipping and setup that are not finite", sum(1)),
        Row::none("second runs that differ", sum(2)),
    ])
}
