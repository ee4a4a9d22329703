//! The over operator.

use anyhow::Result;

use super::kit::{COLORED, Draw, Kit, OVER, Pass};
use super::{Scene, SceneRun};
use crate::Row;
use gfx::format::Format;
use machine::config::SortClass;

pub(super) const OVER_SCENE: Scene = Scene {
    name: "over",
    group: "Transparency",
    what: "Half red over half green is not half green over half red: both are (1 - a) of what is behind and a of what is before, within a code of 255 a layer.",
    fault: "the second square is drawn with alpha 0.6",
    play,
};

const SIZE: [u32; 2] = [96, 48];

fn square(x: [f32; 2], y: [f32; 2], color: [f32; 4]) -> Vec<f32> {
    let corner = |i: usize, j: usize| [[x[i], y[j], 0.5, 1.0], color].concat();
    [[0, 0], [1, 0], [0, 1], [0, 1], [1, 0], [1, 1]].iter().flat_map(|&[i, j]| corner(i, j)).collect()
}

fn play(stage: &mut SceneRun) -> Result<()> {
    let mut kit = Kit::new("over");
    let target = kit.target("target", SIZE, Format::Rgba8Unorm);
    let (red, green) = ([1.0, 0.0, 0.0, 0.5], [0.0, 1.0, 0.0, if stage.fault() { 0.6 } else { 0.5 }]);
    // Left: red over green. Right: green over red.
    let all = [([-1.0, 0.0], [green, red]), ([0.0, 1.0], [red, green])]
        .into_iter()
        .flat_map(|(x, colors)| colors.map(|color| square(x, [-1.0, 1.0], color)).concat())
        .collect();
    let pass = Pass { color: vec![(target, Some([1.0; 4]))], ..Pass::default() };
    kit.pass(&pass, &[Draw::list(COLORED, 2, all).blend(OVER)]);
    kit.present(target);
    let trace = kit.finish();
    let frames = stage.show(&trace)?;
    let worst = frames[0].worst(|x, _| {
        let [a, b] = if x < SIZE[0] / 2 { [[0.0, 1.0, 0.0], [1.0, 0.0, 0.0]] } else { [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]] };
        std::array::from_fn(|c| 0.5 * b[c] + 0.5 * (0.5 * a[c] + 0.5))
    });
    stage.row(Row::at_most("largest difference from f64, in codes", worst, 1.0));
    let [left, right] = [0, SIZE[0] - 1].map(|x| frames[0].rgba(x, 0));
    stage.row(Row::within(
        "red of red over green less red of green over red, in codes",
        63.75,
        f64::from(left[0]) - f64::from(right[0]),
        1.0,
    ));
    if !stage.fault() {
        let disordered = stage.disordered(SortClass::LastImage);
        stage.row(Row::exact("passes that sort-last-image names", 1.0, disordered as f64));
    }
    Ok(())
}
