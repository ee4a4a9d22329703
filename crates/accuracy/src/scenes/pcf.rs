//! Filtered comparisons with a shadow map.

use anyhow::Result;

use super::kit::{Draw, Kit, Pass};
use super::{Scene, SceneRun};
use crate::Row;
use gfx::format::Format;
use gfx::state::{Compare, FilterMode, SamplerDesc, Topology};

pub(super) const PCF: Scene = Scene {
    name: "pcf",
    group: "Shadows",
    what: "Nine filtered comparisons of the straight edge of a shadow: a linear ramp three texels wide, within a code and the 1/256 of a filter's weight.",
    fault: "comparisons are not filtered",
    play,
};

const PIXELS: u32 = 256;
const TEXELS: u32 = 16;

fn play(stage: &mut SceneRun) -> Result<()> {
    let mut kit = Kit::new("pcf");
    let map = kit.target("map", [TEXELS; 2], Format::Depth32Float);
    let target = kit.target("target", [PIXELS, 32], Format::Rgba8Unorm);
    // An occluder over the left half.
    let half = "@vertex fn vs(@builtin(vertex_index) i: u32) -> @builtin(position) vec4f {
        return vec4f(f32(i & 1u) - 1.0, f32(i >> 1u) * 2.0 - 1.0, 0.2, 1.0);
    }";
    let cast = Draw::list(half, 0, Vec::new()).count(4).depth(Format::Depth32Float, Compare::Less);
    let cast = Draw { depth_only: true, topology: Topology::TriangleStrip, ..cast };
    kit.pass(&Pass { depth: Some((map, Some((1.0, 0)))), ..Pass::default() }, &[cast]);
    let filter = if stage.fault() { FilterMode::Nearest } else { FilterMode::Linear };
    let sampler =
        kit.sampler(SamplerDesc { mag: filter, min: filter, compare: Some(Compare::LessEqual), ..SamplerDesc::default() });
    let source = format!(
        "@group(0) @binding(0) var map: texture_depth_2d;
        @group(0) @binding(1) var s: sampler_comparison;
        @fragment fn fs(@builtin(position) at: vec4f) -> @location(0) vec4f {{
            var lit = 0.0;
            for (var y = -1; y <= 1; y++) {{
                for (var x = -1; x <= 1; x++) {{
                    let uv = vec2f(at.x / {PIXELS}.0, 0.5) + vec2f(f32(x), f32(y)) / {TEXELS}.0;
                    lit += textureSampleCompareLevel(map, s, uv, 0.5);
                }}
            }}
            return vec4f(vec3f(lit / 9.0), 1.0);
        }}"
    );
    let show = Draw::cover(&source).with([map.bound(), sampler]);
    kit.pass(&Pass { color: vec![(target, Some([0.0; 4]))], ..Pass::default() }, &[show]);
    kit.present(target);
    let trace = kit.finish();
    let frames = stage.show(&trace)?;
    let ramp = |x: u32| {
        let texels = (f64::from(x) + 0.5) / f64::from(PIXELS / TEXELS) - f64::from(TEXELS / 2);
        ((texels + 1.5) / 3.0).clamp(0.0, 1.0)
    };
    stage.row(Row::at_most("largest difference from the ramp, in codes", frames[0].worst(|x, _| [ramp(x); 3]), 1.5));
    let between = (0..PIXELS).filter(|&x| !matches!(frames[0].rgba(x, 0)[0], 0 | 255)).count() as f64;
    stage.row(Row::within("pixels of the ramp, 16 a texel", 48.0, between, 1.0));
    Ok(())
}
