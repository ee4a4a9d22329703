//! The fragment half of a draw: its tiles, on the images of the pass.

use std::sync::Arc;

use gfx::format::Format;
use gfx::stage::Stage;
use gfx::texel::aspect_masks;
use work::{Areas, Event, Funnel};

use super::super::needs::Need;
use super::areas;
use super::batch::Batch;
use super::geometry::{Geometry, Stages, each, settle};
use super::record::{self, TileRecord};
use super::signature;
use super::tile::{self, MAX_COLORS, SegmentInput, TileJob};
use super::workers::Workers;
use super::{DrawCall, DrawError, Drawn};
use crate::parallel;
use crate::surface::{ALL, TileSurface};

/// Tiles that are not worth other threads.
const FEW_TILES: usize = 2;

/// Quads and triangles of tiles that are not worth other threads either: to wake them, and to wait for them where the host is busy, takes
/// longer than to draw these.
const FEW_QUADS: u64 = 128;
const FEW_REFERENCES: u64 = 64;

/// Adds what became of a segment's primitives before its tiles were drawn.
fn count(funnel: &mut Funnel, batches: &[Batch]) {
    for batch in batches {
        *funnel += batch.funnel;
        let late = batch.late.iter().filter(|late| late.end.is_some()).count() as u64;
        funnel.setup_culled += late;
        funnel.triangles_setup += late;
    }
}

/// The depth attachment where a draw uses it, and the bits of its texels that the draw may write.
fn depth_of<'a>(depth: &'a mut Option<TileSurface>, call: &DrawCall<'_>) -> Option<(&'a mut TileSurface, [u32; 4])> {
    let (surface, state) = (depth.as_mut()?, call.depth.as_ref()?);
    let (depth_bits, stencil_bits) = aspect_masks(surface.shape().format);
    let stencil = if state.writes_stencil() { u32::MAX } else { 0 };
    Some((surface, std::array::from_fn(|w| depth_bits[w] | stencil_bits[w] & stencil)))
}

/// The images that a pass draws on.
pub struct Images {
    /// Colour attachments by location, with the format in which they are drawn.
    pub color: Vec<Option<(TileSurface, Format)>>,
    /// Depth and stencil.
    pub depth: Option<TileSurface>,
    /// Columns and rows of tiles.
    pub tiles: [u32; 2],
}

impl Images {
    /// The fragment half of a segment: all tiles with something in them.
    ///
    /// # Errors
    /// If a shader does not end, or something comes to more than is allowed.
    pub fn fragments(
        &mut self,
        call: &DrawCall<'_>,
        workers: &Workers,
        stages: &mut Stages,
        made: Geometry,
        sink: &mut dyn FnMut(Event),
    ) -> Result<Drawn, DrawError> {
        let tiles = self.tiles;
        let (growth, quads) = (&made.growth, stages.quads());
        let Stages { stream, vertices, batches, batches_used, pieces, touched, records, .. } = stages;
        let batches = &mut batches[..*batches_used];
        let wanted = |&tile: &u32| call.options.need != Need::Survey || areas::surveys([tile % tiles[0], tile / tiles[0]]);
        touched.clear();
        match &*batches {
            [batch] => touched.extend(batch.tiles().iter().copied().filter(wanted)),
            batches => {
                let drawn_here = |tile: &u32| batches.iter().any(|batch| batch.touches(*tile as usize));
                touched.extend((0..tiles[0] * tiles[1]).filter(|tile| wanted(tile) && drawn_here(tile)));
            }
        }
        let references = batches.iter().map(Batch::references).sum();
        call.ledger.quads.charge(references)?;
        let few = touched.len() <= FEW_TILES || references <= FEW_REFERENCES && quads <= FEW_QUADS;
        let input = SegmentInput { call, pieces, batches, vertices, growth };
        let one = |job: &mut TileJob<'_>| workers.with(|worker| tile::draw(&input, worker, job, call.options.record));
        let alone = call.tiles_in_order || few;
        let own = if alone && !call.options.record { 1 } else { touched.len() };
        if call.options.record {
            // A draw that failed may have left some.
            records.clear();
        }
        records.resize_with(records.len().max(own), TileRecord::default);
        let mut result = Ok(());
        if alone {
            for (i, &index) in touched.iter().enumerate() {
                let record = &mut records[if call.options.record { i } else { 0 }];
                result = one(&mut self.job(call, tiles, index as usize, record));
                if result.is_err() {
                    break;
                }
            }
        } else {
            let mut jobs = self.jobs(call, tiles, touched, records);
            result = parallel::map(jobs.iter_mut(), 1..=1, |_, job| one(job)).collect();
        }
        let mut drawn = workers.take_counts();
        settle(call, workers, growth, call.program(Stage::Fragment))?;
        result?;
        call.ledger.quads.add(drawn.funnel.quads_rasterized);
        call.ledger.quads.verify()?;
        if call.options.need == Need::Survey {
            // The counts are those of some tiles only.
            drawn.funnel = Funnel::default();
        } else {
            each(batches, Batch::count_uncovered);
        }
        drawn.funnel.vertices_in += made.entries;
        drawn.funnel.vertices_shaded += made.shaded;
        count(&mut drawn.funnel, batches);
        if call.options.areas || call.options.need == Need::Survey {
            batches.iter().for_each(|batch| drawn.areas += batch.areas);
        } else {
            // Tiles count what is visible in any case.
            drawn.areas = Areas::default();
        }
        if let Some(mut segment) = made.segment {
            segment.funnel = drawn.funnel;
            segment.areas = drawn.areas;
            segment.programs = call.pipeline.named();
            let tile = |(&tile, record): (&u32, &mut TileRecord)| (tile % tiles[0], tile / tiles[0], std::mem::take(record));
            let recorded = touched.iter().zip(records).map(tile).collect();
            // The segment waits for the machine, with as much memory as made it: what is not needed now goes.
            let signed = call.signature.is_some().then(|| signature::vertices(vertices));
            vertices.release();
            let mut segment = record::assemble(call, pieces, stream, batches, recorded, *segment);
            if let Some(signed) = signed {
                segment.signatures = signature::primitives(&segment.primitives, &signed);
            }
            sink(Event::Segment(Arc::new(segment)));
        }
        Ok(drawn)
    }

    /// One tile with its parts of the attachments.
    fn job<'a>(&'a mut self, call: &DrawCall<'_>, tiles: [u32; 2], index: usize, record: &'a mut TileRecord) -> TileJob<'a> {
        let mut job = TileJob::new(index, tiles[0], record);
        let mut locations: [Option<&mut TileSurface>; MAX_COLORS] = Default::default();
        for (location, color) in locations.iter_mut().zip(&mut self.color) {
            *location = color.as_mut().map(|(surface, _)| surface);
        }
        for (tile, target) in job.colors.iter_mut().zip(&call.targets) {
            *tile = locations[target.location].take().map(|surface| surface.tile_mut(index, ALL));
        }
        job.depth = depth_of(&mut self.depth, call).map(|(surface, written)| surface.tile_mut(index, written));
        job
    }

    /// Some tiles, in order, with their parts of the attachments, and with what is recorded of each.
    fn jobs<'a>(
        &'a mut self,
        call: &DrawCall<'_>,
        tiles: [u32; 2],
        indices: &[u32],
        records: &'a mut [TileRecord],
    ) -> Vec<TileJob<'a>> {
        let mut locations: Vec<Option<_>> =
            self.color.iter_mut().map(|c| c.as_mut().map(|(surface, _)| surface.tiles_mut(ALL))).collect();
        let mut colors: Vec<_> = call.targets.iter().map(|t| locations[t.location].take()).collect();
        let mut depth = depth_of(&mut self.depth, call).map(|(surface, written)| surface.tiles_mut(written));
        let mut jobs = Vec::with_capacity(indices.len());
        let mut next = 0;
        for (index, record) in indices.iter().map(|&index| index as usize).zip(records) {
            let skipped = index - next;
            next = index + 1;
            let mut job = TileJob::new(index, tiles[0], record);
            for (tile, surface) in job.colors.iter_mut().zip(&mut colors) {
                *tile = surface.as_mut().and_then(|tiles| tiles.nth(skipped));
            }
            job.depth = depth.as_mut().and_then(|tiles| tiles.nth(skipped));
            jobs.push(job);
        }
        jobs
    }
}
