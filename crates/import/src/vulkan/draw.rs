//! Draws and dispatches.

use std::rc::Rc;

use gfx::state::{IndexFormat, Rect, StepMode, Viewport};
use num::*;
use trace::command::*;

use super::args::Args;
use super::conversions::ListDraw;
use super::fault::{Fault, Outcome, unsupported};
use super::groups::Plan;
use super::machine::Vulkan;
use super::objects::{Descriptor, DescriptorKind, Set, known};
use super::pass::{ComputeEmitted, Open, OpenPass};
use super::pipelines::Ready;
use super::shaders::{Bound, Numbers};
use super::state::{Area, Fixed};
use super::submission::{BindPoint, BoundSet, Encoder};

/// Viewports reach this far.
const VIEWPORT_REACH: f32 = 65_000.0;

/// `VK_INDEX_TYPE_UINT8`.
const INDICES_OF_8_BITS: u32 = 1_000_265_000;

/// Parts of a draw whose attributes change after several instances.
const PARTS_MAX: u32 = 1 << 12;

/// What is drawn.
#[derive(Clone, Copy, Debug)]
enum Order {
    /// Vertices or indices of these numbers.
    Direct { indexed: bool, first: u32, count: u32, base: i32, first_instance: u32, instances: u32 },
    /// Arguments in a buffer, each this number of bytes after the one before.
    Indirect { indexed: bool, buffer: u64, offset: u64, count: u32, stride: u32, counts: Option<(u64, u64)> },
    /// Arguments of one draw with indices in a native buffer.
    Written { buffer: BufferId },
}

/// Native indices: the buffer, first byte, bytes.
type Indices = (BufferId, u64, u64, IndexFormat);

fn bytes_of(words: &[u32]) -> Vec<u8> {
    words.iter().flat_map(|word| word.to_le_bytes()).collect()
}

fn words(bytes: &[u8]) -> Vec<u32> {
    let word = |bytes: &[u8]| u32::from_le_bytes(std::array::from_fn(|at| bytes.get(at).copied().unwrap_or(0)));
    bytes.chunks(4).map(word).collect()
}

impl Vulkan {
    /// Runs a command that draws or dispatches. Answers whether it is one.
    pub fn draw_command(&mut self, name: &str, call: Args<'_>, encoder: &mut Encoder) -> Outcome<bool> {
        let indexed = name.starts_with("vkCmdDrawIndexed") || name.starts_with("vkCmdDrawMultiIndexed");
        match name {
            "vkCmdDraw" => {
                let (first, count) = (call.u32("firstVertex")?, call.u32("vertexCount")?);
                let (first_instance, instances) = (call.u32("firstInstance")?, call.u32("instanceCount")?);
                let order = Order::Direct { indexed, first, count, base: 0, first_instance, instances };
                self.draw(order, None, encoder)?;
            }
            "vkCmdDrawIndexed" => {
                let (first, count) = (call.u32("firstIndex")?, call.u32("indexCount")?);
                let (first_instance, instances) = (call.u32("firstInstance")?, call.u32("instanceCount")?);
                let base = call.i32("vertexOffset")?;
                self.draw(Order::Direct { indexed, first, count, base, first_instance, instances }, None, encoder)?;
            }
            "vkCmdDrawMulti" | "vkCmdDrawMultiIndexed" => {
                let (first_instance, instances) = (call.u32("firstInstance")?, call.u32("instanceCount")?);
                // The same for all draws, where it is given.
                let base = if indexed && call.is_some("pVertexOffset")? { Some(call.i32("pVertexOffset")?) } else { None };
                let list = call.list(if indexed { "pIndexInfo" } else { "pVertexInfo" })?;
                for (number, info) in (0..).zip(list) {
                    let (first, count, base) = match indexed {
                        true => {
                            let own = info.i32("vertexOffset")?;
                            (info.u32("firstIndex")?, info.u32("indexCount")?, base.unwrap_or(own))
                        }
                        false => (info.u32("firstVertex")?, info.u32("vertexCount")?, 0),
                    };
                    let order = Order::Direct { indexed, first, count, base, first_instance, instances };
                    self.draw(order, Some(number), encoder)?;
                }
            }
            "vkCmdDrawIndirect" | "vkCmdDrawIndexedIndirect" => {
                let (buffer, offset) = (call.u64("buffer")?, call.u64("offset")?);
                let (count, stride) = (call.u32("drawCount")?, call.u32("stride")?);
                self.draw(Order::Indirect { indexed, buffer, offset, count, stride, counts: None }, None, encoder)?;
            }
            "vkCmdDrawIndirectCount" | "vkCmdDrawIndexedIndirectCount" => {
                let (buffer, offset) = (call.u64("buffer")?, call.u64("offset")?);
                let counts = Some((call.u64("countBuffer")?, call.u64("countBufferOffset")?));
                let (count, stride) = (call.u32("maxDrawCount")?, call.u32("stride")?);
                self.draw(Order::Indirect { indexed, buffer, offset, count, stride, counts }, None, encoder)?;
            }
            "vkCmdDispatch" | "vkCmdDispatchBase" => {
                let base_workgroup = match name {
                    "vkCmdDispatchBase" => [call.u32("baseGroupX")?, call.u32("baseGroupY")?, call.u32("baseGroupZ")?],
                    _ => [0; 3],
                };
                let groups = [call.u32("groupCountX")?, call.u32("groupCountY")?, call.u32("groupCountZ")?];
                if groups.iter().any(|&count| count > trace::check::WORKGROUPS_MAX) {
                    return unsupported(format!("a dispatch of {groups:?} workgroups"));
                }
                self.dispatch(Command::Dispatch { groups }, Numbers { base_workgroup, ..Numbers::default() }, encoder)?;
            }
            "vkCmdDispatchIndirect" => {
                let (buffer, offset, _) = self.range(call.u64("buffer")?, call.u64("offset")?, Some(12))?;
                self.dispatch(Command::DispatchIndirect { buffer, offset }, Numbers::default(), encoder)?;
            }
            _ => return Ok(false),
        }
        Ok(true)
    }

    /// The contents of a bound set.
    fn bound(&self, point: &BindPoint, number: u32) -> Outcome<(Set, Vec<u32>)> {
        match point.sets.get(number as usize) {
            Some(Some(BoundSet::Allocated(handle, offsets))) => {
                Ok((known(self.objects.sets.get(*handle), "descriptor set", *handle)?.clone(), offsets.clone()))
            }
            Some(Some(BoundSet::Pushed(set))) => Ok((set.clone(), Vec::new())),
            _ => unsupported(format!("descriptor set {number}, which the shader reads and is not bound")),
        }
    }

    /// The native groups of a bind point.
    fn bound_groups(&mut self, point: &BindPoint, plans: &[Plan]) -> Outcome<Vec<(u32, BindGroupId)>> {
        let mut groups = Vec::with_capacity(plans.len());
        for plan in plans {
            let (set, offsets) = self.bound(point, plan.set)?;
            groups.push((plan.set, self.group(plan, &set, &offsets)?));
        }
        Ok(groups)
    }

    /// What is bound, as far as shaders depend on it: they may leave formats of storage images and texel buffers open, and do what views and
    /// samplers of the card do not.
    fn reads(&self, point: &BindPoint) -> Outcome<Bound> {
        use DescriptorKind::*;
        let mut all = Bound::default();
        for (number, set) in (0..).zip(&point.sets) {
            if set.is_none() {
                continue;
            }
            let Ok((set, _)) = self.bound(point, number) else { continue };
            for binding in &set.layout.bindings {
                let Ok(kind) = &binding.kind else { continue };
                let first = set.layout.find(binding.binding).map_or(0, |(_, first)| first);
                let code = match (kind, set.slots.get(first)) {
                    (StorageImage, Some(Descriptor::Image { view, .. })) => self.objects.views.get(*view).map(|view| view.code),
                    (UniformTexels | StorageTexels, Some(Descriptor::Texels(view))) => {
                        self.objects.buffer_views.get(*view).map(|view| view.code)
                    }
                    _ => None,
                };
                all.formats.extend(code.map(|code| (number, binding.binding, code)));
                if self.objects.rewritten && matches!(kind, Sampler | Combined | Sampled | Input) {
                    let slots = set.slots.get(first..first + binding.slots()).unwrap_or_default();
                    let swizzles = self
                        .elements(slots, |view, _| self.objects.views.get(view).map(|view| view.swizzle.unwrap_or_default()));
                    let biases = self.elements(slots, |_, sampler| {
                        self.objects.samplers.get(sampler)?.as_ref().ok().map(|sampler| sampler.bias.to_bits())
                    });
                    let differ = swizzles.len().max(biases.len());
                    if differ > ELEMENTS_MAX {
                        let binding = binding.binding;
                        return unsupported(format!(
                            "set {number}, binding {binding}: an array of {differ} descriptors whose views exchange different channels or \
                             whose samplers have different biases"
                        ));
                    }
                    let exchanged = swizzles.into_iter().filter(|(_, own)| *own != [0; 4]);
                    all.swizzles.extend(exchanged.map(|(element, own)| (number, binding.binding, element, own)));
                    let added = biases.into_iter().filter(|(_, own)| f32::from_bits(*own) != 0.0);
                    all.biases.extend(added.map(|(element, own)| (number, binding.binding, element, own)));
                }
            }
        }
        Ok(all)
    }

    /// What descriptors that hold a view or a sampler have: once without an element where it is the same for all, else of each element.
    fn elements<T: PartialEq>(&self, slots: &[Descriptor], of: impl Fn(u64, u64) -> Option<T>) -> Vec<(Option<u32>, T)> {
        let held = |slot: &Descriptor| match slot {
            Descriptor::Image { view, sampler } => of(*view, *sampler),
            _ => None,
        };
        let mut all: Vec<_> = (0..).zip(slots).filter_map(|(at, slot)| Some((Some(at), held(slot)?))).collect();
        if all.windows(2).all(|two| two[0].1 == two[1].1) {
            all.truncate(1);
            all.iter_mut().for_each(|(element, _)| *element = None);
        }
        all
    }

    fn dispatch(&mut self, command: Command, numbers: Numbers, encoder: &mut Encoder) -> Outcome {
        let point = encoder.compute.clone();
        let Some(pipeline) = &point.pipeline else { return unsupported("a dispatch without a pipeline") };
        let ready = match &encoder.ready_compute {
            Some(ready) if ready.serves(numbers) => ready.clone(),
            _ => {
                let reads = self.reads(&point)?;
                let ready = Rc::new(self.ready_compute(pipeline, reads, numbers)?);
                encoder.ready_compute.insert(ready).clone()
            }
        };
        let groups = self.bound_groups(&point, &ready.groups)?;
        let command = match encoder.condition {
            Some(condition) => {
                // What an earlier dispatch writes may be the condition.
                self.close(&mut encoder.open);
                let (buffer, offset) = match command {
                    Command::DispatchIndirect { buffer, offset } => (buffer, offset),
                    Command::Dispatch { groups } => (self.arguments(bytes_of(&groups)), 0),
                    _ => return Ok(()),
                };
                let buffer = self.under_condition((buffer, offset, 12), condition)?;
                encoder.open = Open::Compute(Vec::new(), Box::default());
                Command::DispatchIndirect { buffer, offset: 0 }
            }
            None => command,
        };
        if !matches!(encoder.open, Open::Compute(..)) {
            self.close(&mut encoder.open);
            encoder.open = Open::Compute(Vec::new(), Box::default());
        }
        let Open::Compute(commands, emitted) = &mut encoder.open else { return Ok(()) };
        let ComputeEmitted { pipeline, groups: known, immediates } = &mut **emitted;
        if *pipeline != Some(ready.id) {
            commands.push(Command::SetComputePipeline(ready.id));
            *pipeline = Some(ready.id);
        }
        set_groups(&groups, known, commands);
        set_immediates(&encoder.constants, ready.immediates, immediates, commands);
        commands.extend(self.card.call_site().map(Command::SetCallSite));
        commands.push(command);
        Ok(())
    }

    /// The native range of a bound vertex or index buffer.
    fn bound_buffer(&mut self, (buffer, offset, size): super::submission::BoundBuffer) -> Outcome<(BufferId, u64, u64)> {
        let owner = known(self.objects.buffers.get(buffer), "buffer", buffer)?;
        let left = owner.size.saturating_sub(offset);
        self.range(buffer, offset.min(owner.size), Some(size.unwrap_or(left).min(left)))
    }

    /// Draws an order, which has a number where it is one of several.
    fn draw(&mut self, order: Order, number: Option<u32>, encoder: &mut Encoder) -> Outcome {
        let numbers = Numbers { draw: number, ..Numbers::default() };
        let (Order::Direct { first_instance: origin, instances: all, .. }, Some(step)) = (order, encoder.state.instance_step())
        else {
            return self.draw_part(order, numbers, encoder);
        };
        if all.div_ceil(step) > PARTS_MAX {
            return unsupported(format!("{all} instances whose attributes change every {step}"));
        }
        for first in (0..all).step_by(step as usize) {
            let Order::Direct { indexed, first: index, count, base, .. } = order else { continue };
            let (first_instance, instances) = (origin.saturating_add(first), step.min(all - first));
            let part = Order::Direct { indexed, first: index, count, base, first_instance, instances };
            self.draw_part(part, Numbers { base_instance: Some(origin), ..numbers }, encoder)?;
        }
        Ok(())
    }

    /// Draws an order, or a part of an order that has these numbers.
    fn draw_part(&mut self, order: Order, numbers: Numbers, encoder: &mut Encoder) -> Outcome {
        if encoder.pass_refused || encoder.state.discard {
            return Ok(());
        }
        let point = encoder.graphics.clone();
        let Some(pipeline) = &point.pipeline else { return unsupported("a draw without a pipeline") };
        let Open::Render(pass) = &encoder.open else { return unsupported("a draw outside of a pass") };
        let index = match encoder.index {
            Some((_, code)) => match code {
                // Those of 8 bits are converted.
                0 | INDICES_OF_8_BITS => Some(IndexFormat::Uint16),
                1 => Some(IndexFormat::Uint32),
                _ => None,
            },
            None => None,
        };
        let ready = match &encoder.ready {
            Some(ready) if ready.serves(numbers) => ready.clone(),
            _ => {
                let reads = self.reads(&point)?;
                let ready = Rc::new(self.ready(pipeline, &encoder.state, &pass.formats, index, reads, numbers)?);
                encoder.ready.insert(ready).clone()
            }
        };
        // Points and lines have no faces.
        if encoder.state.cull_mode & 3 == 3 && encoder.state.topology >= 3 {
            return if ready.writes {
                unsupported("culling of both faces where the vertex shader writes to memory")
            } else {
                Ok(())
            };
        }
        let groups = self.bound_groups(&point, &ready.groups)?;
        let indexed = matches!(order, Order::Direct { indexed: true, .. } | Order::Indirect { indexed: true, .. });
        let indices = match (indexed, encoder.index) {
            (false, _) => None,
            (true, None) => return unsupported("a draw with indices without a buffer of them"),
            (true, Some((bound, code))) => {
                let Some(format) = index else {
                    return unsupported(format!("indices of {}", super::formats::name("VkIndexType", code)));
                };
                let (buffer, offset, size) = self.bound_buffer(bound)?;
                Some((buffer, offset, size, format, code == INDICES_OF_8_BITS))
            }
        };
        let vertex = self.vertex_buffers(&ready, &order, numbers.base_instance, encoder)?;
        let Some((viewport, scissor)) = view_of(encoder)? else { return Ok(()) };
        let (order, indices) = match indices {
            Some((buffer, offset, size, format, bytes)) => {
                let (order, indices) = self.indices(order, (buffer, offset, size), format, bytes, &encoder.state)?;
                (order, Some(indices))
            }
            None => (order, None),
        };
        let commands =
            self.order(order, &ready, indices.map(|(_, _, size, format)| size / u64::from(format.bytes())), encoder)?;
        let Open::Render(pass) = &mut encoder.open else { return Ok(()) };
        let state = &encoder.state;
        let OpenPass { commands: out, emitted, .. } = &mut **pass;
        if emitted.pipeline != Some(ready.id) {
            out.push(Command::SetRenderPipeline(ready.id));
            emitted.pipeline = Some(ready.id);
        }
        if emitted.viewport != Some(viewport) {
            out.push(Command::SetViewport(viewport));
            emitted.viewport = Some(viewport);
        }
        if emitted.scissor != Some(scissor) {
            out.push(Command::SetScissor(scissor));
            emitted.scissor = Some(scissor);
        }
        let constants = if ready.constant_alpha { [state.blend_constants[3]; 4] } else { state.blend_constants };
        let blend = constants.map(f64::from);
        if emitted.blend.unwrap_or_default() != blend {
            out.push(Command::SetBlendConstant(blend));
            emitted.blend = Some(blend);
        }
        let references = if state.stencil_test { state.stencil_sides().map(|face| face.reference & 255) } else { [0; 2] };
        if emitted.stencil.unwrap_or_default() != references {
            out.push(Command::stencil_references(references));
            emitted.stencil = Some(references);
        }
        set_groups(&groups, &mut emitted.groups, out);
        set_immediates(&encoder.constants, ready.immediates, &mut emitted.immediates, out);
        emitted.vertex.resize(emitted.vertex.len().max(vertex.len()), None);
        for (slot, (&(buffer, offset, size), known)) in (0..).zip(vertex.iter().zip(&mut emitted.vertex)) {
            if *known != Some((buffer, offset, size)) {
                out.push(Command::SetVertexBuffer { slot, buffer: Some(buffer), offset, size: Some(size) });
                *known = Some((buffer, offset, size));
            }
        }
        if let Some((buffer, offset, size, format)) = indices
            && emitted.index != indices
        {
            out.push(Command::SetIndexBuffer { buffer, format, offset, size: Some(size) });
            emitted.index = indices;
        }
        out.extend(commands);
        Ok(())
    }

    fn vertex_buffers(
        &mut self,
        ready: &Ready,
        order: &Order,
        origin: Option<u32>,
        encoder: &Encoder,
    ) -> Outcome<Vec<(BufferId, u64, u64)>> {
        let mut bound = Vec::with_capacity(ready.slots.len());
        for slot in &ready.slots {
            let Some(Some(buffer)) = encoder.vertex.get(slot.binding as usize) else {
                return unsupported(format!("vertex buffer {}, which is not bound", slot.binding));
            };
            let (id, mut offset, mut size) = self.bound_buffer(*buffer)?;
            if let Some((stride, divisor)) = slot.at_first_instance {
                let first = match order {
                    Order::Direct { first_instance, .. } => {
                        let origin = origin.unwrap_or(*first_instance);
                        let later = (first_instance - origin).checked_div(divisor).unwrap_or(0);
                        u64::from(origin) + u64::from(later)
                    }
                    _ => return unsupported("an indirect draw with attributes that change otherwise than with each instance"),
                };
                let by = (first * u64::from(stride)).min(size);
                (offset, size) = (offset + by, size - by);
            }
            bound.push((id, offset, size));
        }
        if let Order::Direct { indexed, first, count, first_instance, instances, .. } = *order {
            for ((slot, &(.., size)), layout) in ready.slots.iter().zip(&bound).zip(&ready.layouts) {
                let extent = layout.attributes.iter().map(|own| own.offset + u64::from(own.format.bytes())).max().unwrap_or(0);
                let by_vertex = (layout.step == StepMode::Vertex) != ready.points;
                let (first, count) = if by_vertex { (first, count) } else { (first_instance, instances) };
                let needed = (u64::from(first) + u64::from(count)).saturating_sub(1) * layout.stride + extent;
                if count > 0 && needed > size && !(by_vertex && indexed) {
                    let binding = slot.binding;
                    return unsupported(format!(
                        "a draw that reads {needed} bytes of vertex buffer {binding}, which has {size}"
                    ));
                }
            }
        }
        Ok(bound)
    }

    /// The native draws of an order.
    fn order(&mut self, order: Order, ready: &Ready, indices: Option<u64>, encoder: &Encoder) -> Outcome<Vec<Command>> {
        if let Order::Direct { indexed: true, first, count, .. } = order
            && indices.is_some_and(|bound| u64::from(first) + u64::from(count) > bound)
        {
            return unsupported(format!("indices {first} + {count} of a buffer that has {}", indices.unwrap_or(0)));
        }
        if ready.points {
            let Order::Direct { indexed: false, first, count, first_instance: 0, instances: 1, .. } = order else {
                return unsupported("points of a size with indices, instances or indirect arguments");
            };
            let draw = Command::Draw { vertices: 4, instances: count, first_vertex: 0, first_instance: first };
            return Ok(vec![self.draw_under(draw, encoder.condition)?]);
        }
        let condition = encoder.condition;
        Ok(match order {
            Order::Written { buffer } => {
                let draw = Command::DrawIndirect { buffer, offset: 0, indexed: true, count: 1, count_buffer: None };
                vec![self.draw_under(draw, condition)?]
            }
            Order::Direct { indexed: true, first, count, base, first_instance, instances } => {
                let draw =
                    Command::DrawIndexed { indices: count, instances, first_index: first, base_vertex: base, first_instance };
                vec![self.draw_under(draw, condition)?]
            }
            Order::Direct { indexed: false, first, count, first_instance, instances, .. } => {
                let draw = Command::Draw { vertices: count, instances, first_vertex: first, first_instance };
                vec![self.draw_under(draw, condition)?]
            }
            Order::Indirect { indexed, buffer, offset, count, stride, counts } => {
                let record = if indexed { 20 } else { 16 };
                if count > 1 && u64::from(stride) < record {
                    return Err(Fault::Damaged(format!("arguments of {record} bytes, {stride} bytes apart")));
                }
                let bytes = u64::from(count.saturating_sub(1)) * u64::from(stride) + record;
                if count == 0 {
                    return Ok(Vec::new());
                }
                let (buffer, offset, _) = self.range(buffer, offset, Some(bytes))?;
                let count_buffer = match counts {
                    Some((buffer, offset)) => {
                        let (buffer, offset, _) = self.range(buffer, offset, Some(4))?;
                        Some((buffer, offset))
                    }
                    None => None,
                };
                if count == 1 || u64::from(stride) == record {
                    let draw = Command::DrawIndirect { buffer, offset, indexed, count, count_buffer };
                    return Ok(vec![self.draw_under(draw, condition)?]);
                }
                if ready.reads_draw() {
                    return unsupported(format!("the number of the draw in a shader, of indirect draws {stride} bytes apart"));
                }
                if count_buffer.is_some() {
                    return unsupported(format!("indirect draws with counts, {stride} bytes apart"));
                }
                let at = |number: u32| offset + u64::from(number) * u64::from(stride);
                let one = |number| Command::DrawIndirect { buffer, offset: at(number), indexed, count: 1, count_buffer: None };
                (0..count).map(|number| self.draw_under(one(number), condition)).collect::<Outcome<_>>()?
            }
        })
    }

    /// The range of a buffer, or a buffer of zeros in its place unless a condition holds.
    fn under_condition(
        &mut self,
        words: (BufferId, u64, u64),
        (buffer, offset, inverted): (u64, u64, bool),
    ) -> Outcome<BufferId> {
        let (buffer, offset, _) = self.range(buffer, offset, Some(4))?;
        Ok(self.conditional(words, (buffer, offset, inverted)))
    }

    /// A draw, which happens only if a condition holds: the number of draws is zero then.
    pub fn draw_under(&mut self, draw: Command, condition: Option<(u64, u64, bool)>) -> Outcome<Command> {
        let Some(condition) = condition else { return Ok(draw) };
        let (words, indexed) = match draw {
            Command::Draw { vertices, instances, first_vertex, first_instance } => {
                (vec![vertices, instances, first_vertex, first_instance], false)
            }
            Command::DrawIndexed { indices, instances, first_index, base_vertex, first_instance } => {
                (vec![indices, instances, first_index, base_vertex as u32, first_instance], true)
            }
            Command::DrawIndirect { buffer, offset, indexed, count, count_buffer } => {
                let (counts, at) = match count_buffer {
                    Some(counts) => counts,
                    None => (self.arguments(bytes_of(&[count])), 0),
                };
                let count_buffer = Some((self.under_condition((counts, at, 4), condition)?, 0));
                return Ok(Command::DrawIndirect { buffer, offset, indexed, count, count_buffer });
            }
            other => return Ok(other),
        };
        let buffer = self.arguments(bytes_of(&words));
        let count_buffer = match condition {
            // The condition itself is a count, of which one is used.
            (condition, offset, false) => {
                let (condition, offset, _) = self.range(condition, offset, Some(4))?;
                (condition, offset)
            }
            inverted => {
                let one = self.arguments(bytes_of(&[1]));
                (self.under_condition((one, 0, 4), inverted)?, 0)
            }
        };
        Ok(Command::DrawIndirect { buffer, offset: 0, indexed, count: 1, count_buffer: Some(count_buffer) })
    }

    /// The order with native indices: the card has none of 8 bits, and none that end primitives in lists.
    fn indices(
        &mut self,
        order: Order,
        (buffer, offset, size): (BufferId, u64, u64),
        format: IndexFormat,
        bytes: bool,
        state: &Fixed,
    ) -> Outcome<(Order, Indices)> {
        let each = if bytes { 1 } else { format.bytes() };
        let bound = size / u64::from(each);
        let direct = match order {
            Order::Direct { first, count, .. } if u64::from(first) + u64::from(count) > bound => {
                return unsupported(format!("indices {first} + {count} of a buffer that has {bound}"));
            }
            Order::Direct { first, count, base, first_instance, instances, .. } => {
                Some(ListDraw { first, count, base, first_instance, instances })
            }
            _ => None,
        };
        if state.restart
            && let Some(primitive) = [1, 2, 0, 3].get(state.topology as usize).filter(|&&of| of > 0)
        {
            let Some(draw) = direct else { return unsupported("indirect draws with indices that end primitives in lists") };
            let count = u64::from(draw.count);
            let written = self.list_indices((buffer, offset, size), each, *primitive, &draw)?;
            return Ok((Order::Written { buffer: written }, (written, 32, 4 * count, IndexFormat::Uint32)));
        }
        if !bytes {
            return Ok((order, (buffer, offset, size, format)));
        }
        Ok(match direct {
            Some(ListDraw { first, count, base, first_instance, instances }) => {
                let count_bytes = u64::from(count);
                let wide = self.wide_indices((buffer, offset + u64::from(first), count_bytes), state.restart)?;
                let order = Order::Direct { indexed: true, first: 0, count, base, first_instance, instances };
                (order, (wide, 0, 2 * count_bytes, format))
            }
            None => (order, (self.wide_indices((buffer, offset, size), state.restart)?, 0, 2 * size, format)),
        })
    }
}

/// The most elements of an array of descriptors that shaders tell apart.
const ELEMENTS_MAX: usize = 64;

/// The viewport and the scissor rectangle; none if nothing can be drawn.
fn view_of(encoder: &Encoder) -> Outcome<Option<(Viewport, Rect)>> {
    let Open::Render(pass) = &encoder.open else { return Ok(None) };
    let Some(&viewport) = encoder.state.viewports.first() else { return unsupported("a draw without a viewport") };
    let [width, height] = pass.size;
    let scissor = encoder.state.scissors.first().copied().unwrap_or(Area { x: 0, y: 0, width, height });
    let area = scissor.common(pass.area).common(Area { x: 0, y: 0, width, height });
    if area.width == 0 || area.height == 0 || viewport.width == 0.0 || viewport.height == 0.0 {
        return Ok(None);
    }
    let upward = viewport.height < 0.0;
    let (y, height) = if upward { (viewport.y + viewport.height, -viewport.height) } else { (viewport.y, viewport.height) };
    let viewport = Viewport { y, height, ..viewport };
    let far = [viewport.x, y, viewport.x + viewport.width, y + height].into_iter().any(|edge| !(edge.abs() <= VIEWPORT_REACH));
    let depths = [viewport.min_depth, viewport.max_depth];
    if far || viewport.width < 0.0 || depths.into_iter().any(|depth| !(0.0..=1.0).contains(&depth)) {
        return unsupported(format!("a viewport of {viewport:?}"));
    }
    Ok(Some((viewport, Rect { x: area.x as u32, y: area.y as u32, width: area.width, height: area.height })))
}

fn set_groups(groups: &[(u32, BindGroupId)], known: &mut [Option<BindGroupId>; 8], out: &mut Vec<Command>) {
    for &(index, group) in groups {
        let slot = &mut known[index as usize];
        if *slot != Some(group) {
            out.push(Command::SetBindGroup { index, group: Some(group), offsets: Vec::new() });
            *slot = Some(group);
        }
    }
}

fn set_immediates(constants: &[u8], size: u32, known: &mut Vec<u32>, out: &mut Vec<Command>) {
    let mut wanted = words(constants);
    wanted.resize((size / 4) as usize, 0);
    let same = known.len() >= wanted.len() && known[..wanted.len()] == *wanted;
    if !same {
        out.push(Command::SetImmediates { offset: 0, words: wanted.clone() });
        *known = wanted;
    }
}
