//! A render pass in execution: attachments, dynamic state, draws, queries, bundles.

use std::sync::Arc;

use gfx::format::{Format, TexelKind};
use gfx::state::TextureDimension;
use gfx::texel;
use num::{QuerySetId, TextureId};
use shader::{self, BuiltIn, Interface, Program};
use trace::command::*;
use work::{Attachment, Contents, Event, Funnel, Load, Pass, Segment, Signature, Surface};

use super::bind::ResolvedBindings;
use super::draw::{self, BufferRange, DrawCall, IndexRange, RenderPass, Signer};
use super::execute::{Fault, Renderer};
use super::ledger::Claim;
use super::needs::Need;
use super::pipeline::RenderPipeline;
use super::resources::{Buffer, ImageState, Resources};
use super::state::{DrawState, IndexSlot, MAX_VERTEX_BUFFERS, VertexSlot};
use super::surface::{Shape, TileSurface};

/// Where an attachment's image is.
#[derive(Clone, Copy, Debug)]
struct Place {
    texture: TextureId,
    level: u32,
    layer: u32,
}

/// One attachment while the pass runs.
struct Bound {
    place: Place,
    /// Format in which it is drawn: the view's.
    format: Format,
    resolve: Option<Place>,
    /// Some aspect is kept.
    keep_color_or_depth: bool,
    keep_stencil: bool,
    /// Neither aspect may be written: the texture keeps its contents, and shaders may read it meanwhile.
    read_only: bool,
}

/// A render pass between its begin and its end.
pub(super) struct ActivePass {
    pass: RenderPass,
    color: Vec<Option<Bound>>,
    depth: Option<Bound>,
    state: DrawState,
    width: u32,
    height: u32,
    occlusion: Option<QuerySetId>,
    /// The open occlusion query and the samples that passed since.
    open_occlusion: Option<(u32, u64)>,
    /// The open statistics query and what was counted since.
    open_statistics: Option<(QuerySetId, u32, Funnel)>,
    timestamps: Option<PassTimestamps>,
    /// What has to be done of it.
    need: Need,
    /// What its draws have done, where they hand on nothing else.
    counted: Option<Funnel>,
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
                false => Err(format!("attachments of {this:?} and {extent:?} pixels and samples in one pass")),
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
            let load = match attachment.clear {
                Some(value) => Load::Clear(clear_bits(format.kind(), value)),
                None => Load::Load,
            };
            let mut tiles = take_tiles(&mut renderer.res, place, load != Load::Load)?;
            if let Load::Clear(bits) = load {
                tiles.clear(stored_words(format, bits));
            }
            storage.push(Some((tiles, format)));
            let resolve = match attachment.resolve {
                Some(view) => Some(place_of(renderer, view.0, None)?.0),
                None => None,
            };
            let resolve_surface = match resolve {
                Some(to) => Some(renderer.res.textures.get(to.texture.0)?.surface(to.texture, to.level, to.layer)),
                None => None,
            };
            announce(
                renderer,
                place,
                &surface,
                load == Load::Load,
                storage.last().and_then(Option::as_ref).map(|(tiles, _)| tiles),
            )?;
            bound.push(Some(Bound {
                place,
                format,
                resolve,
                keep_color_or_depth: attachment.store,
                keep_stencil: false,
                read_only: false,
            }));
            attachments.push(Some(Attachment {
                surface: Surface { format, ..surface },
                load,
                store: attachment.store,
                stencil_load: Load::Load,
                stencil_store: false,
                resolve: resolve_surface,
            }));
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
            let value = [attachment.depth_clear.unwrap_or(0.0).to_bits(), attachment.stencil_clear.unwrap_or(0) & 0xff, 0, 0];
            let (depth_mask, stencil_mask) = draw::aspect_masks(format);
            let mut mask = [0; 4];
            for i in 0..4 {
                mask[i] |= if depth_load != Load::Load { depth_mask[i] } else { 0 };
                mask[i] |= if stencil_load != Load::Load { stencil_mask[i] } else { 0 };
            }
            let both: [u32; 4] = std::array::from_fn(|i| depth_mask[i] | stencil_mask[i]);
            let mut tiles = take_tiles(&mut renderer.res, place, mask == both)?;
            if mask == both {
                tiles.clear(stored_words(format, value));
            } else if mask != [0; 4] {
                renderer.ledger.bytes.charge(tiles.shape().bytes())?;
                tiles.clear_masked(stored_words(format, value), mask);
            }
            announce(renderer, place, &surface, mask != both, Some(&tiles))?;
            depth_storage = Some(tiles);
            depth_bound = Some(Bound {
                place,
                format,
                resolve: None,
                keep_color_or_depth: attachment.depth_store || attachment.depth_read_only,
                keep_stencil: attachment.stencil_store || attachment.stencil_read_only,
                read_only,
            });
            depth_attachment = Some(Attachment {
                surface,
                load: depth_load,
                store: attachment.depth_store && !attachment.depth_read_only,
                stencil_load,
                stencil_store: attachment.stencil_store && !attachment.stencil_read_only,
                resolve: None,
            });
        }
        let (width, height, samples) = extent.ok_or("a render pass without attachments")?;
        let number = renderer.passes;
        renderer.passes += 1;
        let need = renderer.options.needs.as_ref().map_or(Need::Colors, |needs| needs.pass(number));
        let info = Pass { number, label, width, height, samples, color: attachments, depth: depth_attachment };
        renderer.emit(Event::BeginPass(Arc::new(info)))?;
        Ok(ActivePass {
            pass: RenderPass::begin(width, height, samples, storage, depth_storage),
            color: bound,
            depth: depth_bound,
            state: DrawState::new(width, height),
            width,
            height,
            occlusion,
            open_occlusion: None,
            open_statistics: None,
            timestamps,
            need,
            counted: None,
        })
    }

    /// Runs one command of the pass.
    pub fn run(&mut self, renderer: &mut Renderer<'_, '_>, command: &Command) -> Result<(), Fault> {
        renderer.moment += 1;
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
                    return Err(format!("vertex buffer slot {slot}, the limit is {MAX_VERTEX_BUFFERS}").into());
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
            Command::SetViewport(viewport) => state.viewport = *viewport,
            Command::SetScissor(rect) => {
                let inside = |at: u32, size: u32, all: u32| at.checked_add(size).is_some_and(|end| end <= all);
                if !inside(rect.x, rect.width, self.width) || !inside(rect.y, rect.height, self.height) {
                    return Err(
                        format!("scissor {rect:?} reaches outside the {} x {} attachments", self.width, self.height).into()
                    );
                }
                state.scissor = *rect;
            }
            Command::SetBlendConstant(color) => state.blend_constant = color.map(|c| c as f32),
            Command::SetStencilReference(reference) => state.stencil_reference = *reference,
            &Command::Draw { vertices, instances, first_vertex, first_instance } => {
                let range = draw::Range {
                    first: first_vertex,
                    count: vertices,
                    base_vertex: 0,
                    first_instance,
                    instances,
                    draw_index: 0,
                };
                self.draw(renderer, false, range)?;
            }
            &Command::DrawIndexed { indices, instances, first_index, base_vertex, first_instance } => {
                let range =
                    draw::Range { first: first_index, count: indices, base_vertex, first_instance, instances, draw_index: 0 };
                self.draw(renderer, true, range)?;
            }
            &Command::DrawIndirect { buffer, offset, indexed, count, count_buffer } => {
                self.draw_indirect(renderer, buffer.0, offset, indexed, count, count_buffer.map(|(b, at)| (b.0, at)))?;
            }
            &Command::BeginOcclusionQuery { index } => {
                if self.occlusion.is_none() {
                    return Err("an occlusion query in a pass without an occlusion query set".into());
                }
                self.open_occlusion = Some((index, 0));
            }
            Command::EndOcclusionQuery => {
                let (index, passed) = self.open_occlusion.take().ok_or("no occlusion query is open")?;
                let set = self.occlusion.ok_or("no occlusion query set")?;
                renderer.res.query_sets.get_mut(set.0)?.slot(index)?[0] = passed;
            }
            &Command::BeginStatisticsQuery { set, index } => self.open_statistics = Some((set, index, Funnel::default())),
            Command::EndStatisticsQuery => {
                let (set, index, funnel) = self.open_statistics.take().ok_or("no pipeline statistics query is open")?;
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
            command => return Err(format!("{} is not possible in a render pass", command.name()).into()),
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
                    return Err(format!("a draw count at byte {at} of the {} of buffer {id}", counts.len()).into());
                }
                count.min(counts.u32_at(at as usize))
            }
            None => count,
        };
        let stride = if indexed { 20 } else { 16 };
        let end = u64::from(count).saturating_mul(stride).saturating_add(offset);
        if end > words.len() {
            return Err(format!(
                "{count} indirect draws at byte {offset} reach beyond the {} bytes of buffer {buffer}",
                words.len()
            )
            .into());
        }
        for draw_index in 0..count {
            renderer.ledger.commands.charge(1)?;
            let at = (offset + u64::from(draw_index) * stride) as usize;
            let word = |i: usize| words.u32_at(at + 4 * i);
            let range = if indexed {
                draw::Range {
                    first: word(2),
                    count: word(0),
                    base_vertex: word(3) as i32,
                    first_instance: word(4),
                    instances: word(1),
                    draw_index,
                }
            } else {
                draw::Range {
                    first: word(2),
                    count: word(0),
                    base_vertex: 0,
                    first_instance: word(3),
                    instances: word(1),
                    draw_index,
                }
            };
            self.draw(renderer, indexed, range)?;
        }
        Ok(())
    }

    fn draw(&mut self, renderer: &mut Renderer<'_, '_>, indexed: bool, range: draw::Range) -> Result<(), Fault> {
        let state = &self.state;
        let id = state.pipeline.ok_or("a draw without a pipeline")?;
        let pipeline = renderer.res.render_pipelines.get(id)?.clone();
        let number = renderer.draws;
        renderer.draws += 1;
        if range.count == 0 || range.instances == 0 || self.need == Need::Nothing {
            return Ok(());
        }
        let ledger = renderer.ledger.clone();
        ledger.vertices.charge(u64::from(range.count) * u64::from(range.instances))?;
        let resolved: Vec<ResolvedBindings> = pipeline
            .programs()
            .iter()
            .map(|program| ResolvedBindings::new(&mut renderer.res, program.interface(), &state.bindings))
            .collect::<Result<_, _>>()?;
        ledger.steps.charge(pipeline.programs().iter().map(Program::uniform_steps).sum())?;
        ledger.bytes.charge(resolved.iter().map(ResolvedBindings::cost).sum())?;
        let mut vertex_buffers = Vec::new();
        for slot in &state.vertex {
            vertex_buffers.push(match slot {
                Some(slot) => {
                    let buffer = renderer.res.buffers.get(slot.buffer.0)?;
                    Some(bound(buffer, slot.offset, slot.size))
                }
                None => None,
            });
        }
        let index = match (indexed, &state.index) {
            (false, _) => None,
            (true, None) => return Err("an indexed draw without an index buffer".into()),
            (true, Some(slot)) => {
                let buffer = renderer.res.buffers.get(slot.buffer.0)?;
                Some(IndexRange { range: bound(buffer, slot.offset, slot.size), format: slot.format })
            }
        };
        let unasked = self.open_occlusion.is_none() && self.open_statistics.is_none();
        let signed = renderer.recording() && renderer.options.key.signatures && unasked;
        let signature = if signed { signature(&pipeline, resolved.get(1), state) } else { None };
        let borrowed: Vec<_> = resolved.iter().map(ResolvedBindings::borrow).collect();
        let mut resources = borrowed
            .iter()
            .zip(&resolved)
            .map(|(bindings, resolved)| shader::Resources { bindings, immediates: resolved.immediates() });
        let boxes = renderer.boxes.clone();
        let call = DrawCall {
            number,
            group: renderer.groups.innermost(),
            pipeline: &pipeline,
            vertex_buffers: &vertex_buffers,
            index: index.as_ref(),
            range,
            vertex_resources: resources.next().unwrap_or_default(),
            fragment_resources: resources.next(),
            viewport: state.viewport,
            scissor: state.scissor,
            blend_constant: state.blend_constant,
            stencil_reference: state.stencil_reference,
            count_samples: self.open_occlusion.is_some(),
            need: self.need,
            areas: renderer.options.areas,
            key: renderer.options.key,
            record: renderer.recording(),
            signature,
            skips: renderer.options.skips,
            boxes: self.open_statistics.is_none().then_some(&*boxes),
            ledger: &ledger,
        };
        let mut stopped: Result<(), Fault> = Ok(());
        let outcome = self.pass.draw(&call, &mut |event| {
            if stopped.is_ok() {
                stopped = renderer.emit(event);
            }
        })?;
        stopped?;
        renderer.overwritten += outcome.overwritten;
        if !renderer.options.record && !renderer.options.areas {
            // Sums are all that there is to hand on, and once a pass is enough: to wake a reader for each draw took longer than to draw
            // few pixels.
            *self.counted.get_or_insert_default() += outcome.funnel;
        } else if !renderer.recording() {
            // Without recorded work the funnel is all that there is to hand on; who reads it counts draws, too.
            let counts = Segment { funnel: outcome.funnel, areas: outcome.areas, ..Segment::default() };
            renderer.emit(Event::Segment(Arc::new(counts)))?;
        }
        if let Some((_, passed)) = &mut self.open_occlusion {
            *passed += outcome.samples_passed;
        }
        if let Some((_, _, funnel)) = &mut self.open_statistics {
            *funnel += outcome.funnel;
        }
        if pipeline.has_side_effects() {
            for bindings in &resolved {
                bindings.note_writes(&mut renderer.res)?;
            }
        }
        Ok(())
    }

    /// Ends the pass: contents go back to their textures, samples are resolved.
    pub fn end(self, renderer: &mut Renderer<'_, '_>) -> Result<(), Fault> {
        if self.open_occlusion.is_some() || self.open_statistics.is_some() {
            return Err("the pass ends inside a query".into());
        }
        if let Some(funnel) = self.counted {
            renderer.emit(Event::Segment(Arc::new(Segment { funnel, ..Segment::default() })))?;
        }
        let ended = self.pass.end();
        for (bound, tiles) in self.color.iter().zip(ended.color) {
            let (Some(bound), Some(tiles)) = (bound, tiles) else { continue };
            if let Some(to) = bound.resolve.filter(|_| self.need == Need::Colors) {
                renderer.ledger.bytes.charge(tiles.shape().bytes())?;
                let single = Shape { samples: 1, ..tiles.shape() };
                let claim = renderer.ledger.claim("the resolved samples of an attachment", single.tiled_bytes())?;
                put_tiles(renderer, to, tiles.resolve(bound.format), true, Some(claim))?;
                renderer.drawn = Some((to.texture, to.level, to.layer));
            } else if tiles.shape().samples == 1 {
                renderer.drawn = Some((bound.place.texture, bound.place.level, bound.place.layer));
            }
            put_tiles(renderer, bound.place, tiles, bound.keep_color_or_depth, None)?;
        }
        if let (Some(bound), Some(mut tiles)) = (&self.depth, ended.depth)
            && !bound.read_only
        {
            let (depth_mask, stencil_mask) = draw::aspect_masks(tiles.shape().format);
            let lose: [u32; 4] = std::array::from_fn(|i| {
                (if bound.keep_color_or_depth { 0 } else { depth_mask[i] })
                    | (if bound.keep_stencil { 0 } else { stencil_mask[i] })
            });
            let keep = bound.keep_color_or_depth || bound.keep_stencil;
            if keep && lose != [0; 4] {
                renderer.ledger.bytes.charge(tiles.shape().bytes())?;
                tiles.clear_masked([0; 4], lose);
            }
            put_tiles(renderer, bound.place, tiles, keep, None)?;
        }
        if let Some(PassTimestamps { set, end: Some(index), .. }) = self.timestamps {
            renderer.write_timestamp(set, index)?;
        }
        renderer.emit(Event::EndPass)
    }
}

/// Part of a buffer as a draw takes it.
fn bound(buffer: &Buffer, offset: u64, size: u64) -> BufferRange {
    let (words, address) = (buffer.words.clone(), buffer.address + offset);
    BufferRange { words, offset, size, address, version: buffer.version() }
}

/// The signature of what a draw's pixels depend on beside attachments and primitives; none where it does more than write pixels, or where
/// they depend on the company that a fragment is shaded in.
fn signature(pipeline: &RenderPipeline, fragment: Option<&ResolvedBindings>, state: &DrawState) -> Option<Signature> {
    let interface = pipeline.fragment().map(Program::interface);
    let apart = |interface: &Interface| !interface.subgroups && interface.input(BuiltIn::PrimitiveIndex).is_none();
    if pipeline.has_side_effects() || !interface.is_none_or(apart) {
        return None;
    }
    let mut signer = Signer::default();
    signer.value(&pipeline.number);
    signer.value(&(state.viewport, state.scissor, state.stencil_reference));
    signer.words(&state.blend_constant.map(f32::to_bits));
    if let (Some(bindings), Some(interface)) = (fragment, interface) {
        bindings.sign(&mut signer, interface.immediate_bytes.div_ceil(4) as usize);
    }
    Some(signer.finish())
}

/// The image that a view used as an attachment names, and the format it is drawn in.
fn place_of(renderer: &Renderer<'_, '_>, view: u32, slice: Option<u32>) -> Result<(Place, Format), Fault> {
    let view = renderer.res.views.get(view)?;
    let texture = renderer.res.textures.get(view.texture.0)?;
    let layer = match texture.image.dimension {
        TextureDimension::D3 => slice.ok_or("a 3D attachment without a depth slice")?,
        _ => view.range.base_layer,
    };
    if layer >= texture.image.level_size(view.range.base_level)[2] {
        return Err(format!("slice {layer} of texture {} is not there", view.texture.0).into());
    }
    if view.range.levels != 1 || view.range.layers != 1 && texture.image.dimension != TextureDimension::D3 {
        return Err(format!("an attachment of {} levels and {} layers", view.range.levels, view.range.layers).into());
    }
    Ok((Place { texture: view.texture, level: view.range.base_level, layer }, view.range.format))
}

/// An image's contents as tiles, out of the texture for the length of the pass; any contents where all of them are `cleared` next.
fn take_tiles(res: &mut Resources, place: Place, cleared: bool) -> Result<TileSurface, Fault> {
    let texture = res.textures.get_mut(place.texture.0)?;
    let state = texture.images.get_or_insert_with((place.level, place.layer), ImageState::default);
    if let Some(tiles) = state.tiles.take() {
        return Ok(tiles);
    }
    let [width, height, _] = texture.image.level_size(place.level);
    let shape = Shape { width, height, samples: texture.image.samples, format: texture.image.format };
    state.working = None;
    state.working = Some(res.ledger.claim("the tiles of an attachment", shape.tiled_bytes())?);
    res.ledger.bytes.charge(shape.tiled_bytes())?;
    let mut tiles = TileSurface::new(shape);
    if !cleared {
        tiles.load(&texture.words, texture.image.offset(place.level, place.layer));
    }
    Ok(tiles)
}

/// Puts an image's contents back after a pass; what is not kept becomes zeros, as WebGPU has it. A claim replaces that of the tiles that
/// the image had.
fn put_tiles(
    renderer: &mut Renderer<'_, '_>,
    place: Place,
    mut tiles: TileSurface,
    keep: bool,
    claim: Option<Claim>,
) -> Result<(), Fault> {
    let followed = renderer.recording();
    let texture = renderer.res.textures.get_mut(place.texture.0)?;
    if !keep {
        tiles.clear([0; 4]);
    }
    texture.version += 1;
    let state = texture.images.get_or_insert_with((place.level, place.layer), ImageState::default);
    state.tiles = Some(tiles);
    if claim.is_some() {
        state.working = claim;
    }
    // What a pass did not keep is zeros here and whatever it was in the machine: the machine must be told before it loads.
    state.machine_knows = followed && keep;
    state.drawn = keep;
    Ok(())
}

/// Tells a machine the contents of an attachment that it is about to load and cannot know.
fn announce(
    renderer: &mut Renderer<'_, '_>,
    place: Place,
    surface: &Surface,
    loads: bool,
    tiles: Option<&TileSurface>,
) -> Result<(), Fault> {
    if !loads || !renderer.recording() {
        return Ok(());
    }
    let state = renderer
        .res
        .textures
        .get_mut(place.texture.0)?
        .images
        .get_or_insert_with((place.level, place.layer), ImageState::default);
    if state.machine_knows {
        return Ok(());
    }
    state.machine_knows = true;
    if let Some(tiles) = tiles {
        renderer.ledger.bytes.charge(tiles.shape().bytes())?;
        renderer.ledger.passing("the contents of an attachment", 2 * tiles.shape().bytes())?;
    }
    let bytes = tiles.map(TileSurface::to_bytes).unwrap_or_default();
    renderer.emit(Event::Contents(Contents { surface: *surface, bytes: bytes.into() }))
}

/// A clear value as the bits that `texel::encode` takes.
fn clear_bits(kind: TexelKind, value: [f64; 4]) -> [u32; 4] {
    value.map(|c| match kind {
        TexelKind::Uint => c as u32,
        TexelKind::Sint => c as i32 as u32,
        TexelKind::Float | TexelKind::Depth => (c as f32).to_bits(),
    })
}

/// A value as the words of a stored texel.
fn stored_words(format: Format, bits: [u32; 4]) -> [u32; 4] {
    let bytes = texel::encode(format, bits);
    std::array::from_fn(|i| u32::from_le_bytes(std::array::from_fn(|k| bytes[4 * i + k])))
}
