//! Equal depths.

use anyhow::Result;

use super::kit::{COLORED, Draw, Kit, Pass};
use super::shapes::{Corner, center, clip, covers};
use super::{Scene, SceneRun};
use crate::Row;
use gfx::format::Format;
use gfx::state::Compare;

pub(super) const FIGHTING: Scene = Scene {
    name: "fighting",
    group: "Order",
    what: "A slanted triangle three times, in red, green and blue, at the same depths: LessEqual shows the last, Less the first.",
    fault: "the two comparisons are exchanged",
    play,
};

const SIZE: [u32; 2] = [128, 128];
const TRIANGLE: [Corner; 3] = [[1_001, 2_003], [31_007, 9_011], [8_013, 30_017]];

fn play(stage: &mut SceneRun) -> Result<()> {
    let mut kit = Kit::new("fighting");
    let target = kit.target("target", SIZE, Format::Rgba8Unorm);
    let depth = kit.target("depth", SIZE, Format::Depth32Float);
    let compares = [Compare::LessEqual, Compare::Less];
    for which in 0..2 {
        let compare = compares[if stage.fault() { 1 - which } else { which }];
        let draws: Vec<Draw> = (0..3)
            .map(|channel| {
                let mut color = [0.0, 0.0, 0.0, 1.0];
                color[channel] = 1.0;
                let depths = [0.1, 0.9, 0.43];
                let vertices = (0..3).flat_map(|k| [clip(TRIANGLE[k], SIZE, depths[k]), color].concat());
                Draw::list(COLORED, 2, vertices.collect()).depth(Format::Depth32Float, compare)
            })
            .collect();
        let pass =
            Pass { color: vec![(target, Some([0.0, 0.0, 0.0, 1.0]))], depth: Some((depth, Some((1.0, 0)))), ..Pass::default() };
        kit.pass(&pass, &draws);
        kit.present(target);
    }
    let frames = stage.show(&kit.finish())?;
    for (frame, (name, color)) in frames.iter().zip([("LessEqual", [0, 0, 255]), ("Less", [255, 0, 0])]) {
        let wrong = frame.wrong(|x, y| if covers(TRIANGLE, center(x, y)) { color } else { [0; 3] });
        stage.row(Row::none(format!("wrong pixels with {name}"), wrong));
    }
    Ok(())
}
