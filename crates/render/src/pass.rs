//! A render pass in execution: attachments, dynamic state, draws, queries, bundles.

use std::sync::Arc;

use gfx::format::Format;
use gfx::stage::{Stage, StageMap};
use gfx::texel;
use num::QuerySetId;
use shader::{BuiltIn, Interface, Uniforms};
use trace::command::*;
use work::{Aspects, Attachment, Event, Extent, Funnel, Load, Pass, Reach, Segment, Signature, Stored, Surface};

use super::attachments::{Clearing, Subresource, announce, clear_bits, discard, kept, lost, place_of, put_tiles, take_tiles};
use super::bind::{Lent, ResolvedBindings};
use super::draw::{
    BoundStage, BufferRange, DrawCall, Drawn, DynamicState, IndexRange, OpenQueries, PassOptions, RenderPass, Signer,
};
use super::execute::{Renderer, counts};
use super::fault::Fault;
use super::ledger::{DRAW_STEPS, Ledger, VERTEX_STEPS};
use super::needs::Need;
use super::pipeline::{PipelineStage, RenderPipeline};
use super::resources::Buffer;
use super::state::{IndexSlot, MAX_VERTEX_BUFFERS, PassState, StateError, VertexSlot};
use super::stored::stored_blocks;
use super::surface::{Shape, TileSurface};
use super::targets::PassTarget;

/// One attachment while the pass runs.
struct BoundAttachment {
    place: Subresource,
    /// Format in which it is drawn: the view's.
    format: Format,
    resolve: Option<Subresource>,
    keeps: Aspects,
    /// Neither aspect may be written: the texture keeps its contents, and shaders may read it meanwhile.
    read_only: bool,
}

/// A render pass between its begin and its end.
pub(super) struct ActivePass {
    number: u32,
    pass: RenderPass,
    color: Vec<Option<BoundAttachment>>,
    depth: Option<BoundAttachment>,
    state: PassState,
    width: u32,
    height: u32,
    occlusion: Option<QuerySetId>,
    /// The open occlusion query and the samples that passed since.
    open_occlusion: Option<(u32, u64)>,
    /// The open statistics query and what was counted since.
    open_statistics: Option<(QuerySetId, u32, Funnel)>,
    timestamps: Option<PassTimestamps>,
    /// The results that are needed.
    need: Need,
    /// The counts of its draws, if the draws hand on nothing else.
    counted: Option<Funnel>,
    /// Memory for the resources of the next draw.
    spare: DrawResources,
    /// Memory that the last draw may touch beside attachments.
    reach: Arc<Reach>,
    /// Where the arguments of the current indirect draws lie.
    arguments: Vec<Extent>,
}

/// The resources bound to the slots of a draw. The lists are used again for each draw of a pass.
#[derive(Default)]
struct DrawResources {
    vertex_buffers: Vec<Option<BufferRange>>,
    /// The bindings of each stage.
    resolved: StageMap<ResolvedBindings>,
    /// The values that invocations of each stage share.
    uniforms: StageMap<Uniforms>,
}

impl DrawResources {
    /// Holds nothing any more, and keeps its memory.
    fn clear(&mut self) {
        self.vertex_buffers.clear();
        self.resolved.values_mut().for_each(ResolvedBindings::clear);
    }
}

impl ActivePass {
    /// Begins a pass.
    pub fn begin(
        renderer: &mut Renderer<'_, '_>,
        color: &[Option<ColorAttachment>],
        depth: Option<&DepthAttachment>,
        occlusion: Option<QuerySetId>,
        timestamps: Option<PassTimestamps>,
        label: String,
    ) -> Result<ActivePass, Fault> {
        if let Some(PassTimestamps { set, begin: Some(index), .. }) = timestamps {
            renderer.write_timestamp(set, index)?;
        }
        let mut extent: Option<(u32, u32, u32)> = None;
        let mut check_extent = |surface: &Surface| {
            let this = (surface.width, surface.height, surface.samples);
            match *extent.get_or_insert(this) == this {
                true => Ok(()),
                false => Err(StateError::Extents { first: extent, second: this }),
            }
        };
        let mut storage = Vec::new();
        let mut bound = Vec::new();
        let mut attachments = Vec::new();
        for slot in color {
            let Some(attachment) = slot else {
                storage.push(None);
                bound.push(None);
                attachments.push(None);
                continue;
            };
            let (place, format) = place_of(renderer, attachment.view.0, attachment.depth_slice)?;
            let surface = renderer.res.textures.get(place.texture.0)?.surface(place.texture, place.level, place.layer);
            check_extent(&surface)?;
            renderer.claim_images(&surface)?;
            let (load, clearing) = match attachment.clear.map(|value| clear_bits(format.kind(), value)) {
                Some(bits) => (Load::Clear(bits), Clearing::to(texel::encode_code(format, bits))),
                None => (Load::Load, Clearing::NONE),
            };
            let tiles = take_tiles(&mut renderer.res, place, clearing)?;
            let (mut resolve, mut resolve_surface) = (None, None);
            if let Some(view) = attachment.resolve {
                let (to, format) = place_of(renderer, view.0, None)?;
                let surface = renderer.res.textures.get(to.texture.0)?.surface(to.texture, to.level, to.layer);
                renderer.claim_images(&surface)?;
                (resolve, resolve_surface) = (Some(to), Some(Surface { format, ..surface }));
            }
            let keeps = Aspects { main: attachment.store, stencil: false };
            let attachment = Attachment {
                surface: Surface { format, ..surface },
                load,
                store: attachment.store,
                stencil_load: Load::Load,
                stencil_store: false,
                keeps,
                resolve: resolve_surface,
            };
            announce(renderer, &attachment.surface, attachment.loads(), &tiles)?;
            storage.push(Some((tiles, format)));
            bound.push(Some(BoundAttachment { place, format, resolve, keeps, read_only: false }));
            attachments.push(Some(attachment));
        }
        let mut depth_storage = None;
        let mut depth_bound = None;
        let mut depth_attachment = None;
        if let Some(attachment) = depth {
            let (place, format) = place_of(renderer, attachment.view.0, None)?;
            let read_only =
                (attachment.depth_read_only || !format.has_depth()) && (attachment.stencil_read_only || !format.has_stencil());
            if read_only {
                // Shaders may sample it during the pass, so the words must hold it too.
                renderer.res.flushed(place.texture)?;
            }
            let surface = renderer.res.textures.get(place.texture.0)?.surface(place.texture, place.level, place.layer);
            check_extent(&surface)?;
            renderer.claim_images(&surface)?;
            let depth_load = attachment.depth_clear.map_or(Load::Load, |z| Load::Clear([z.to_bits(), 0, 0, 0]));
            let stencil_load = attachment.stencil_clear.map_or(Load::Load, |s| Load::Clear([0, s & 0xff, 0, 0]));
            let (value, mask) = texel::depth_stencil_code(format, attachment.depth_clear, attachment.stencil_clear);
            let (depth_mask, stencil_mask) = texel::aspect_masks(format);
            let whole = (0..4).all(|i| mask[i] == depth_mask[i] | stencil_mask[i]);
            let tiles = take_tiles(&mut renderer.res, place, Clearing { mask, value, whole })?;
            let keeps = Aspects {
                main: attachment.depth_store || attachment.depth_read_only,
                stencil: attachment.stencil_store || attachment.stencil_read_only,
            };
            let attachment = Attachment {
                surface,
                load: depth_load,
                store: attachment.depth_store && !attachment.depth_read_only,
                stencil_load,
                stencil_store: attachment.stencil_store && !attachment.stencil_read_only,
                keeps,
                resolve: None,
            };
            announce(renderer, &surface, attachment.loads(), &tiles)?;
            depth_storage = Some(tiles);
            depth_bound = Some(BoundAttachment { place, format, resolve: None, keeps, read_only });
            depth_attachment = Some(attachment);
        }
        let (width, height, samples) = extent.ok_or(StateError::NoAttachments)?;
        let need = renderer.options.needs.as_ref().map_or(Need::Colors, |needs| needs.pass(renderer.passes));
        renderer.passes += 1;
        let number = renderer.numbers.passes;
        renderer.numbers.passes += 1;
        let info = Pass { number, label, width, height, samples, color: attachments, depth: depth_attachment };
        renderer.emit(Event::BeginPass(Arc::new(info)))?;
        let options = PassOptions {
            need,
            areas: renderer.options.areas,
            key: renderer.options.key,
            record: renderer.recording(),
            skips: renderer.options.skips,
        };
        Ok(ActivePass {
            number,
            pass: RenderPass::begin(width, height, samples, storage, depth_storage, options),
            need,
            color: bound,
            depth: depth_bound,
            state: PassState::new(width, height),
            width,
            height,
            occlusion,
            open_occlusion: None,
            open_statistics: None,
            timestamps,
            counted: None,
            spare: DrawResources::default(),
            reach: Arc::default(),
            arguments: Vec::new(),
        })
    }

    /// Runs one command of the pass.
    pub fn run(&mut self, renderer: &mut Renderer<'_, '_>, command: &Command) -> Result<(), Fault> {
        renderer.count(command);
        let state = &mut self.state;
        match command {
            Command::SetRenderPipeline(id) => state.pipeline = Some(id.0),
            Command::SetBindGroup { index, group, offsets } => state.bindings.set(*index, *group, offsets)?,
            Command::SetImmediates { offset, words } => state.bindings.set_immediates(*offset, words)?,
            &Command::SetIndexBuffer { buffer, format, offset, size } => {
                let (offset, size) = renderer.res.buffers.get(buffer.0)?.range(buffer, offset, size)?;
                state.index = Some(IndexSlot { buffer, format, offset, size });
            }
            &Command::SetVertexBuffer { slot, buffer, offset, size } => {
                let at = slot as usize;
                if at >= MAX_VERTEX_BUFFERS {
                    return Err(StateError::VertexBufferSlot(slot).into());
                }
                if state.vertex.len() <= at {
                    state.vertex.resize(at + 1, None);
                }
                state.vertex[at] = match buffer {
                    Some(buffer) => {
                        let (offset, size) = renderer.res.buffers.get(buffer.0)?.range(buffer, offset, size)?;
                        Some(VertexSlot { buffer, offset, size })
                    }
                    None => None,
                };
            }
            Command::SetViewport(viewport) => state.dynamic.viewport = *viewport,
            Command::SetScissor(rect) => {
                let inside = |at: u32, size: u32, all: u32| at.checked_add(size).is_some_and(|end| end <= all);
                if !inside(rect.x, rect.width, self.width) || !inside(rect.y, rect.height, self.height) {
                    return Err(StateError::Scissor { rect: *rect, width: self.width, height: self.height }.into());
                }
                state.dynamic.scissor = *rect;
            }
            Command::SetBlendConstant(color) => state.dynamic.blend_constant = color.map(|c| c as f32),
            Command::SetStencilReference(reference) => state.dynamic.stencil_references = [*reference; 2],
            &Command::SetStencilReferences { front, back } => state.dynamic.stencil_references = [front, back],
            &Command::BeginOcclusionQuery { index } => {
                if self.occlusion.is_none() {
                    return Err(StateError::OcclusionWithoutSet.into());
                }
                self.open_occlusion = Some((index, 0));
            }
            Command::EndOcclusionQuery => {
                let (index, passed) = self.open_occlusion.take().ok_or(StateError::NoOcclusionQuery)?;
                let set = self.occlusion.ok_or(StateError::NoOcclusionSet)?;
                renderer.res.query_sets.get_mut(set.0)?.slot(index)?[0] = passed;
            }
            &Command::BeginStatisticsQuery { set, index } => {
                self.open_statistics = Some((set, index, Funnel::default()));
            }
            Command::EndStatisticsQuery => {
                let (set, index, funnel) = self.open_statistics.take().ok_or(StateError::NoStatisticsQuery)?;
                renderer.res.query_sets.get_mut(set.0)?.write_statistics(index, &funnel, 0)?;
            }
            &Command::WriteTimestamp { set, index } => renderer.write_timestamp(set, index)?,
            Command::ExecuteBundles(ids) => {
                for id in ids {
                    let commands = renderer.res.bundles.get(id.0)?.clone();
                    // A bundle sees none of the pass's state except viewport, scissor, blend constant and stencil reference.
                    self.state.reset_after_bundle();
                    for command in commands.iter() {
                        renderer.ledger.commands.charge(1)?;
                        self.run(renderer, command)?;
                    }
                    self.state.reset_after_bundle();
                }
            }
            Command::PushDebugGroup(_) | Command::PopDebugGroup => renderer.groups.note(command),
            Command::InsertDebugMarker(_) => {}
            Command::SetCallSite(site) => renderer.site = Some(*site),
            command => match command.draws() {
                Some(Draws::Direct { indexed, range }) => self.draw(renderer, indexed, range)?,
                Some(Draws::Indirect { buffer, offset, indexed, count, count_buffer }) => {
                    self.draw_indirect(renderer, buffer.0, offset, indexed, count, count_buffer.map(|(b, at)| (b.0, at)))?;
                }
                None => return Err(StateError::WrongScope { name: command.name(), scope: "in a render pass" }.into()),
            },
        }
        Ok(())
    }

    fn draw_indirect(
        &mut self,
        renderer: &mut Renderer<'_, '_>,
        buffer: u32,
        offset: u64,
        indexed: bool,
        count: u32,
        count_buffer: Option<(u32, u64)>,
    ) -> Result<(), Fault> {
        let words = renderer.res.buffers.get(buffer)?.words.clone();
        let count = match count_buffer {
            Some((id, at)) => {
                let counts = &renderer.res.buffers.get(id)?.words;
                if at + 4 > counts.len() {
                    return Err(StateError::DrawCount { offset: at, bytes: counts.len(), buffer: id }.into());
                }
                count.min(counts.u32_at(at as usize))
            }
            None => count,
        };
        let stride = if indexed { 20 } else { 16 };
        let end = u64::from(count).saturating_mul(stride).saturating_add(offset);
        if end > words.len() {
            return Err(StateError::IndirectDraws { count, offset, bytes: words.len(), buffer }.into());
        }
        self.arguments.clear();
        self.arguments.push(Extent::new(renderer.res.buffers.get(buffer)?.address + offset, u64::from(count) * stride));
        if let Some((id, at)) = count_buffer {
            self.arguments.push(Extent::new(renderer.res.buffers.get(id)?.address + at, 4));
        }
        for draw_index in 0..count {
            renderer.ledger.commands.charge(1)?;
            let at = (offset + u64::from(draw_index) * stride) as usize;
            let word = |i: usize| words.u32_at(at + 4 * i);
            let (base_vertex, first_instance) = if indexed { (word(3) as i32, word(4)) } else { (0, word(3)) };
            let range =
                DrawRange { first: word(2), count: word(0), base_vertex, first_instance, instances: word(1), draw_index };
            self.draw(renderer, indexed, range)?;
        }
        self.arguments.clear();
        Ok(())
    }

    fn draw(&mut self, renderer: &mut Renderer<'_, '_>, indexed: bool, range: DrawRange) -> Result<(), Fault> {
        let state = &self.state;
        let id = state.pipeline.ok_or(StateError::DrawWithoutPipeline)?;
        let number = renderer.numbers.draws;
        renderer.numbers.draws += 1;
        if range.count == 0 || range.instances == 0 || self.need == Need::Nothing {
            return Ok(());
        }
        let pipeline = renderer.res.render_pipeline(id)?;
        let ledger = renderer.ledger.clone();
        let vertices = range.vertices();
        ledger.vertices.charge(vertices)?;
        let mut bound = std::mem::take(&mut self.spare);
        for stage in pipeline.stages() {
            bound.resolved[stage.kind()].resolve(&mut renderer.res, stage.interface(), &state.bindings)?;
        }
        let uniform: u64 = pipeline.stages().map(|stage| stage.program.uniform_steps()).sum();
        ledger.steps.charge(uniform.saturating_add(DRAW_STEPS).saturating_add(vertices.saturating_mul(VERTEX_STEPS)))?;
        ledger.bytes.charge(bound.resolved.values().map(ResolvedBindings::cost).sum())?;
        for slot in &state.vertex {
            bound.vertex_buffers.push(match slot {
                Some(slot) => {
                    let buffer = renderer.res.buffers.get(slot.buffer.0)?;
                    Some(range_of(buffer, slot.offset, slot.size))
                }
                None => None,
            });
        }
        let index = match (indexed, &state.index) {
            (false, _) => None,
            (true, None) => return Err(StateError::NoIndexBuffer.into()),
            (true, Some(slot)) => {
                let buffer = renderer.res.buffers.get(slot.buffer.0)?;
                Some(IndexRange { range: range_of(buffer, slot.offset, slot.size), format: slot.format })
            }
        };
        let queries = OpenQueries { occlusion: self.open_occlusion.is_some(), statistics: self.open_statistics.is_some() };
        let unasked = !queries.occlusion && !queries.statistics;
        let signed = renderer.recording() && renderer.options.key.signatures && unasked;
        let signature = if signed { signature(&pipeline, &bound.resolved[Stage::Fragment], &state.dynamic) } else { None };
        if renderer.recording() {
            let mut reach = Reach::default();
            for stage in pipeline.stages() {
                bound.resolved[stage.kind()].reach(stage.interface(), &mut reach);
            }
            let vertices = bound.vertex_buffers.iter().flatten().chain(index.as_ref().map(|index| &index.range));
            vertices.for_each(|range| reach.reads.add(range.extent()));
            self.arguments.iter().for_each(|&extent| reach.reads.add(extent));
            // Draws that follow each other mostly have the same.
            if *self.reach != reach {
                self.reach = reach.into();
            }
        }
        let drawn_with = self.pass.state(&pipeline, &state.dynamic, queries)?;
        let mut lent = StageMap::<Lent<'_>>::default();
        let mut stages = StageMap::default();
        for ((kind, lent), uniforms) in Stage::ALL.into_iter().zip(lent.values_mut()).zip(bound.uniforms.values_mut()) {
            if let Some(stage) = pipeline.stage(kind).filter(|_| drawn_with.runs(kind)) {
                stages[kind] = Some(BoundStage::new(stage, bound.resolved[kind].lend(lent), uniforms));
            }
        }
        let (site, groups, boxes) = (renderer.call_site(), renderer.groups.path(), renderer.boxes.clone());
        let call = DrawCall {
            state: &drawn_with,
            number,
            site,
            groups: &groups,
            vertex_buffers: &bound.vertex_buffers,
            index: index.as_ref(),
            range,
            stages,
            signature,
            reach: &self.reach,
            boxes: (!queries.statistics).then_some(&*boxes),
            ledger: &ledger,
        };
        let mut stopped: Result<(), Fault> = Ok(());
        let drawn = self.pass.draw(&call, &mut |event| {
            if stopped.is_ok() {
                stopped = renderer.emit(event);
            }
        })?;
        stopped?;
        self.count(renderer, &pipeline, drawn)?;
        if pipeline.has_side_effects() {
            for stage in pipeline.stages() {
                bound.resolved[stage.kind()].note_writes(&mut renderer.res, stage.interface())?;
            }
        }
        self.spare = bound;
        self.spare.clear();
        Ok(())
    }

    /// Hands on the counts of a draw.
    fn count(&mut self, renderer: &mut Renderer<'_, '_>, pipeline: &RenderPipeline, drawn: Drawn) -> Result<(), Fault> {
        renderer.overwritten += drawn.overwritten;
        if !renderer.options.record && !renderer.options.areas {
            // Sums are all that there is to hand on, and once per pass is enough: to wake a reader for each draw took longer than to draw
            // few pixels.
            *self.counted.get_or_insert_default() += drawn.funnel;
        } else if !renderer.recording() {
            // Without recorded work the funnel is all that there is to hand on; who reads it counts draws, too.
            let programs = pipeline.named();
            let counts = Segment { funnel: drawn.funnel, areas: drawn.areas, programs, ..Segment::default() };
            renderer.emit(Event::Segment(Arc::new(counts)))?;
        }
        if let Some((_, passed)) = &mut self.open_occlusion {
            *passed += drawn.samples_passed;
        }
        if let Some((_, _, funnel)) = &mut self.open_statistics {
            *funnel += drawn.funnel;
        }
        Ok(())
    }

    /// Ends the pass: contents go back to their textures, samples are resolved.
    pub fn end(self, renderer: &mut Renderer<'_, '_>) -> Result<(), Fault> {
        if self.open_occlusion.is_some() || self.open_statistics.is_some() {
            return Err(StateError::OpenQuery.into());
        }
        if let Some(funnel) = self.counted {
            renderer.emit(counts(funnel))?;
        }
        let ended = self.pass.end();
        let images: Vec<Option<TileSurface>> = ended.color.into_iter().chain([ended.depth]).collect();
        let stored = match renderer.recording() && renderer.options.stored {
            true => Some(Arc::new(stored(&renderer.ledger, &images, self.color.len())?)),
            false => None,
        };
        if !renderer.recording() {
            // A machine does not see what this pass has written.
            let places = self.color.iter().chain([&self.depth]).flatten().filter(|bound| !bound.read_only);
            for place in places.flat_map(|bound| [Some(bound.place), bound.resolve]).flatten() {
                renderer.res.holdings.forget(place.key());
            }
        }
        for (location, (bound, tiles)) in self.color.iter().chain([&self.depth]).zip(images).enumerate() {
            let (Some(bound), Some(mut tiles)) = (bound, tiles) else { continue };
            let (Subresource { texture, level, layer }, shape) = (bound.place, tiles.shape());
            let location = (location < self.color.len()).then_some(location as u32);
            if bound.format.is_depth_stencil() {
                if bound.read_only {
                    continue;
                }
                if lost(bound.keeps, shape.format) != [0; 4] {
                    renderer.ledger.bytes.charge(shape.bytes())?;
                }
            } else if let (Some(to), Need::Colors) = (bound.resolve, self.need) {
                renderer.ledger.bytes.charge(shape.bytes())?;
                let single = Shape { samples: 1, ..shape };
                let claim = renderer.ledger.claim("the resolved samples of an attachment", single.tiled_bytes())?;
                let resolved = tiles.resolve(bound.format);
                show(renderer, (self.number, location, bound), to, &resolved)?;
                put_tiles(&mut renderer.res, to, resolved, Some(claim))?;
                renderer.drawn = Some((to.texture, to.level, to.layer));
            } else if shape.samples == 1 {
                renderer.drawn = Some((texture, level, layer));
            }
            if bound.resolve.is_none() {
                show(renderer, (self.number, location, bound), bound.place, &tiles)?;
            }
            discard(bound.keeps, &mut tiles);
            put_tiles(&mut renderer.res, bound.place, tiles, None)?;
        }
        if let Some(PassTimestamps { set, end: Some(index), .. }) = self.timestamps {
            renderer.write_timestamp(set, index)?;
        }
        renderer.emit(Event::EndPass(stored))
    }
}

/// Hands an attachment of a pass to the reader of targets, if there is one.
fn show(
    renderer: &mut Renderer<'_, '_>,
    (pass, location, bound): (u32, Option<u32>, &BoundAttachment),
    Subresource { texture, level, layer }: Subresource,
    tiles: &TileSurface,
) -> Result<(), Fault> {
    let Some(reader) = renderer.options.targets.clone().filter(|_| renderer.in_range()) else { return Ok(()) };
    renderer.ledger.bytes.charge(tiles.shape().bytes())?;
    renderer.ledger.passing("the picture of an attachment", tiles.shape().bytes())?;
    let surface = renderer.res.textures.get(texture.0)?.surface(texture, level, layer);
    let surface = Surface { format: bound.format, ..surface };
    let kept = bound.resolve.is_some() || kept(bound.keeps, bound.format).any();
    reader.read(PassTarget { pass, location, kept, surface, bytes: tiles.to_bytes() });
    Ok(())
}

/// The memory that the blocks of attachments take. The first `colors` attachments are colours. This reads all texels of the attachments.
fn stored(ledger: &Ledger, images: &[Option<TileSurface>], colors: usize) -> Result<Stored, Fault> {
    let of = |tiles: &Option<TileSurface>| match tiles {
        Some(tiles) => {
            ledger.bytes.charge(tiles.shape().bytes())?;
            Ok(Some(stored_blocks(tiles)))
        }
        None => Ok(None),
    };
    let (color, depth) = images.split_at(colors.min(images.len()));
    let color = color.iter().map(of).collect::<Result<_, Fault>>()?;
    Ok(Stored { color, depth: depth.first().map_or(Ok(None), of)? })
}

/// Part of a buffer as a draw takes it.
fn range_of(buffer: &Buffer, offset: u64, size: u64) -> BufferRange {
    let (words, address) = (buffer.words.clone(), buffer.address + offset);
    BufferRange { words, offset, size, address, version: buffer.version() }
}

/// The signature of what a draw's pixels depend on beside attachments and primitives; none where it does more than write pixels, or where
/// they depend on the company that a fragment is shaded in.
fn signature(pipeline: &RenderPipeline, fragment: &ResolvedBindings, dynamic: &DynamicState) -> Option<Signature> {
    let interface = pipeline.fragment().map(PipelineStage::interface);
    let apart = |interface: &Interface| !interface.subgroups && interface.input(BuiltIn::PrimitiveIndex).is_none();
    if pipeline.has_side_effects() || !interface.is_none_or(apart) {
        return None;
    }
    let mut signer = Signer::default();
    signer.value(&pipeline.number);
    signer.value(&(dynamic.viewport, dynamic.scissor, dynamic.stencil_references));
    signer.words(&dynamic.blend_constant.map(f32::to_bits));
    if let Some(interface) = interface {
        fragment.sign(&mut signer, interface.immediate_bytes.div_ceil(4) as usize);
    }
    Some(signer.finish())
}
