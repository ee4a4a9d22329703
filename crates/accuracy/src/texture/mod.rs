//! Section E, its first half: what textures cost. Traces made here go through the renderer, whose footprints say which lines each quad
//! reads, and through machines, whose texture units look them up.

mod lines;
mod prefetch;
mod trilinear;

use anyhow::Result;

use super::Target;
use super::draws::{Sheet, Stroke, work};
use super::harness::counts;
use gfx::state::{FilterMode, SamplerDesc};
use machine::MachineReport;
use mem::{CACHES, CacheCounts};
use trace::Trace;
use trace::command::{BoundResource, TextureDesc};
use work::{Event, RenderKey};

/// Targets of the section, in order.
pub const TARGETS: &[Target] = &[lines::TEXTURE_LRU, lines::ORIENTATION, trilinear::TRILINEAR, prefetch::PREFETCH];

/// One pipeline with one core, before a memory that does not hold it up.
const ALONE: [&str; 5] =
    ["pipelines=1", "geometry_units=1", "core.per_pipeline=1", "memory.kind=ideal", "scanout.enabled=false"];

/// Lines that were not in the first-level cache when a quad needed them.
fn misses(report: &MachineReport) -> Result<f64> {
    Ok(counts::<CacheCounts>(&report.total, CACHES.named("texture"))?.misses as f64)
}

/// A sampler that filters texels of one level.
fn bilinear() -> SamplerDesc {
    SamplerDesc { mag: FilterMode::Linear, min: FilterMode::Linear, ..SamplerDesc::default() }
}

/// A draw of `vertices` vertices with a texture `t` and a sampler `s`. `vertex` is its vertex stage, `color` the colour of a fragment at `p`.
fn textured(size: [u32; 2], texture: TextureDesc, sampler: SamplerDesc, vertices: u32, vertex: &str, color: &str) -> Trace {
    let mut sheet = Sheet::new(size, 1);
    let texture = sheet.card.create_texture("texture", texture);
    let resources =
        vec![BoundResource::View(sheet.card.create_view(texture)), BoundResource::Sampler(sheet.card.create_sampler(sampler))];
    let source = format!(
        "@group(0) @binding(0) var t: texture_2d<f32>;
        @group(0) @binding(1) var s: sampler;
        @fragment fn fs(@builtin(position) p: vec4f) -> @location(0) vec4f {{ return {color}; }}
        {vertex}"
    );
    sheet.draw(Stroke { resources, ..Stroke::new(source, vertices) });
    sheet.finish()
}

/// What the renderer leaves of a trace.
fn rendered(trace: &Trace) -> Result<Vec<Event>> {
    work(trace, RenderKey::default())
}
