//! Submissions: the lists of command buffers run, and their calls become native commands.

use std::rc::Rc;

use gfxr::Call;
use num::CallSite;
use trace::command::Command;

use super::args::Args;
use super::fault::{Fault, Outcome, unsupported};
use super::machine::Vulkan;
use super::objects::{Handle, Pipeline, Recorded, Set, known};
use super::pass::{Begun, Open, Targets};
use super::pipelines::{Ready, ReadyCompute};
use super::state::Fixed;

/// A call that stops the capture: the number of its block, its name, and what is wrong.
pub type Stop = (u64, &'static str, Fault);

/// Command buffers within command buffers.
const DEPTH_MAX: usize = 2;

/// A descriptor set that is bound.
#[derive(Clone)]
pub enum BoundSet {
    /// As it is when a draw reads it, and the offsets of its dynamic descriptors.
    Allocated(Handle, Vec<u32>),
    /// It was written by commands.
    Pushed(Set),
}

/// What is bound for draws or for dispatches.
#[derive(Clone, Default)]
pub struct BindPoint {
    /// The pipeline.
    pub pipeline: Option<Rc<Pipeline>>,
    /// Sets by number.
    pub sets: Vec<Option<BoundSet>>,
}

/// A vertex or index buffer that is bound: the buffer, the first byte, and the bytes or none for the rest.
pub type BoundBuffer = (Handle, u64, Option<u64>);

/// The state of a command buffer that runs.
#[derive(Default)]
pub struct Encoder {
    pub state: Fixed,
    pub graphics: BindPoint,
    pub compute: BindPoint,
    pub vertex: Vec<Option<BoundBuffer>>,
    /// With its `VkIndexType`.
    pub index: Option<(BoundBuffer, u32)>,
    pub constants: Vec<u8>,
    /// Draws happen if this is not zero, or if it is zero.
    pub condition: Option<(Handle, u64, bool)>,
    /// The pass that is open.
    pub open: Open,
    /// Whether the pass was refused, so that its draws are left out.
    pub pass_refused: bool,
    /// The program's render pass.
    begun: Option<Begun>,
    /// The pipeline as the last draw had it.
    pub ready: Option<Rc<Ready>>,
    pub ready_compute: Option<Rc<ReadyCompute>>,
    /// The occlusion query that is open, and the one of statistics: pool and number.
    pub occlusion: Option<(Handle, u32)>,
    pub statistics: Option<(Handle, u32)>,
    depth: usize,
}

impl Encoder {
    /// The part of a bind point.
    fn point(&mut self, code: u32) -> Outcome<&mut BindPoint> {
        match code {
            0 => Ok(&mut self.graphics),
            1 => Ok(&mut self.compute),
            _ => unsupported(format!("pipelines for {}", super::formats::name("VkPipelineBindPoint", code))),
        }
    }

    fn changed(&mut self) {
        (self.ready, self.ready_compute) = (None, None);
    }
}

/// The name of a call without the suffix of its extension.
fn plain(name: &str) -> &str {
    name.strip_suffix("KHR").or_else(|| name.strip_suffix("EXT")).or_else(|| name.strip_suffix("AMD")).unwrap_or(name)
}

/// Characters that are kept of the label of a debug group.
const LABEL_MAX: usize = 256;

/// Whether a call draws or clears inside a render pass.
fn does_work(name: &str) -> bool {
    name.starts_with("vkCmdDraw") || name.starts_with("vkCmdClearAttachments")
}

/// Whether a call ends what a subpass holds.
fn ends_subpass(call: &Call) -> bool {
    let name = plain(call.name).trim_end_matches('2');
    matches!(name, "vkCmdNextSubpass" | "vkCmdEndRenderPass" | "vkCmdEndRendering")
}

impl Vulkan {
    /// Runs command buffers.
    pub fn submit(&mut self, buffers: &[Handle]) -> Result<(), Stop> {
        if let Err(fault) = self.flush_linear() {
            self.report("vkQueueSubmit", self.log.block, fault)?;
        }
        for &handle in buffers {
            let Some(buffer) = self.objects.commands.get(handle) else {
                return Err((self.log.block, "vkQueueSubmit", Fault::Damaged(format!("there is no command buffer {handle}"))));
            };
            let list = buffer.list.clone();
            let mut encoder = Encoder::default();
            self.run(&list, &mut encoder)?;
            self.close(&mut encoder.open);
        }
        self.groups.trim(&mut self.card);
        Ok(())
    }

    /// Counts what is not supported; the rest stops the capture.
    pub fn report(&mut self, name: &'static str, block: u64, fault: Fault) -> Result<(), Stop> {
        match fault {
            Fault::Unsupported(what) => {
                self.log.refuse(name, block, &what);
                Ok(())
            }
            fault => Err((block, name, fault)),
        }
    }

    fn run(&mut self, list: &[Recorded], encoder: &mut Encoder) -> Result<(), Stop> {
        let mut at = 0;
        while at < list.len() {
            let Recorded { block, call } = &list[at];
            at += 1;
            let site = CallSite::Block(*block);
            self.card.set_call_site(site);
            if matches!(encoder.open, Open::Render(_)) && does_work(call.name) {
                self.annotate(Command::SetCallSite(site), &mut encoder.open);
            }
            match self.targets_of(call, encoder) {
                Ok(Some(targets)) if targets.views != 0 => {
                    let end = at + list[at..].iter().take_while(|recorded| !ends_subpass(&recorded.call)).count();
                    for view in (0..32).filter(|view| targets.views >> view & 1 != 0) {
                        self.begin(&targets, Some(view), *block, call.name, encoder)?;
                        self.run(&list[at..end], encoder)?;
                        self.close(&mut encoder.open);
                    }
                    at = end;
                }
                Ok(Some(targets)) => self.begin(&targets, None, *block, call.name, encoder)?,
                Ok(None) => {
                    if plain(call.name) == "vkCmdExecuteCommands" {
                        self.execute(*block, call, encoder)?;
                    } else if let Err(fault) = self.command(plain(call.name), call, encoder) {
                        self.report(call.name, *block, fault)?;
                    }
                }
                Err(fault) => {
                    encoder.pass_refused = true;
                    self.report(call.name, *block, fault)?;
                }
            }
        }
        Ok(())
    }

    fn begin(
        &mut self,
        targets: &Targets,
        view: Option<u32>,
        block: u64,
        name: &'static str,
        encoder: &mut Encoder,
    ) -> Result<(), Stop> {
        encoder.changed();
        match self.open_pass(targets, view) {
            Ok(pass) => {
                encoder.pass_refused = false;
                encoder.open = Open::Render(Box::new(pass));
                Ok(())
            }
            Err(fault) => {
                encoder.pass_refused = true;
                self.report(name, block, fault)
            }
        }
    }

    /// The targets of the pass that a call begins, if it begins one.
    fn targets_of(&mut self, call: &Call, encoder: &mut Encoder) -> Outcome<Option<Targets>> {
        let args = Args::from(call);
        Ok(Some(match plain(call.name) {
            "vkCmdBeginRenderPass" | "vkCmdBeginRenderPass2" => {
                self.close(&mut encoder.open);
                let begun = Begun::new(self, args.of("pRenderPassBegin")?)?;
                encoder.begun.insert(begun).targets()?
            }
            "vkCmdNextSubpass" | "vkCmdNextSubpass2" | "vkCmdNextSubpass2KHR" => {
                self.close(&mut encoder.open);
                let Some(begun) = &mut encoder.begun else {
                    return Err(Fault::Damaged("no render pass has begun".into()));
                };
                begun.subpass += 1;
                begun.targets()?
            }
            "vkCmdBeginRendering" => {
                self.close(&mut encoder.open);
                self.rendering_targets(args.of("pRenderingInfo")?)?
            }
            _ => return Ok(None),
        }))
    }

    /// Begins a debug group.
    pub fn push_group(&mut self, label: &str, open: &mut Open) {
        self.debug_groups += 1;
        self.annotate(Command::PushDebugGroup(label.chars().take(LABEL_MAX).collect()), open);
    }

    /// Ends a debug group. Nothing happens without one: only part of a program may have been captured.
    pub fn pop_group(&mut self, open: &mut Open) {
        if let Some(left) = self.debug_groups.checked_sub(1) {
            self.debug_groups = left;
            self.annotate(Command::PopDebugGroup, open);
        }
    }

    /// Runs secondary command buffers: their state is their own.
    fn execute(&mut self, block: u64, call: &Call, encoder: &mut Encoder) -> Result<(), Stop> {
        let stop = |fault: Fault| (block, call.name, fault);
        if encoder.depth >= DEPTH_MAX {
            return Err(stop(Fault::Damaged("command buffers that execute each other".into())));
        }
        for handle in Args::from(call).numbers("pCommandBuffers").map_err(stop)? {
            let list = known(self.objects.commands.get(handle), "command buffer", handle).map_err(stop)?.list.clone();
            let mut inner = Encoder {
                open: std::mem::take(&mut encoder.open),
                pass_refused: encoder.pass_refused,
                condition: encoder.condition,
                depth: encoder.depth + 1,
                ..Encoder::default()
            };
            self.run(&list, &mut inner)?;
            encoder.open = inner.open;
        }
        encoder.changed();
        Ok(())
    }

    /// Runs a command that does not begin a pass.
    fn command(&mut self, name: &str, call: &Call, encoder: &mut Encoder) -> Outcome {
        let args = Args::from(call);
        if let Some(rest) = name.strip_prefix("vkCmdSet")
            && !rest.starts_with("Event")
            && encoder.state.set(name, args)?
        {
            encoder.ready = None;
            return Ok(());
        }
        match name {
            "vkCmdEndRenderPass" | "vkCmdEndRenderPass2" => {
                self.close(&mut encoder.open);
                (encoder.begun, encoder.pass_refused) = (None, false);
            }
            "vkCmdEndRendering" | "vkCmdEndRendering2" => {
                self.close(&mut encoder.open);
                encoder.pass_refused = false;
            }
            "vkCmdBindPipeline" => {
                let handle = args.u64("pipeline")?;
                let pipeline = known(self.objects.pipelines.get(handle), "pipeline", handle)?.clone();
                let code = args.u32("pipelineBindPoint")?;
                encoder.point(code)?.pipeline = Some(pipeline.clone());
                if code == 0 {
                    encoder.state.bind(&pipeline.fixed, &pipeline.dynamic);
                }
                encoder.changed();
            }
            "vkCmdBindDescriptorSets" => self.bind_sets(args, encoder)?,
            "vkCmdBindDescriptorSets2" => {
                let info = args.of("pBindDescriptorSetsInfo")?;
                let stages = info.u32("stageFlags")?;
                self.bind_sets_at(info, if stages & 32 != 0 { 1 } else { 0 }, encoder)?;
                if stages & 32 != 0 && stages & 31 != 0 {
                    self.bind_sets_at(info, 0, encoder)?;
                }
            }
            "vkCmdPushDescriptorSet" => {
                let writes = args.list("pDescriptorWrites")?;
                self.push_set(args, encoder, |set| writes.into_iter().try_for_each(|write| set.update(write)))?;
            }
            "vkCmdPushDescriptorSetWithTemplate" => {
                let template = args.u64("descriptorUpdateTemplate")?;
                let (entries, point) = known(self.objects.templates.get(template), "update template", template)?.clone();
                let data = args.of("pData")?;
                self.push_set_at(point, args, encoder, |set| set.update_with(&entries, data))?;
            }
            "vkCmdPushConstants" => push_constants(args, encoder)?,
            "vkCmdPushConstants2" => push_constants(args.of("pPushConstantsInfo")?, encoder)?,
            "vkCmdBindVertexBuffers" | "vkCmdBindVertexBuffers2" => {
                let (buffers, offsets) = (args.numbers("pBuffers")?, args.numbers("pOffsets")?);
                let second = name.ends_with('2');
                let (sizes, strides) = match second {
                    true => (args.numbers("pSizes")?, args.numbers("pStrides")?),
                    false => (Vec::new(), Vec::new()),
                };
                let first = args.u32("firstBinding")? as usize;
                encoder.vertex.resize(encoder.vertex.len().max(first.saturating_add(buffers.len()).min(64)), None);
                for (at, (buffer, offset)) in buffers.into_iter().zip(offsets).enumerate() {
                    let Some(slot) = encoder.vertex.get_mut(first + at) else { continue };
                    let size = sizes.get(at).copied().filter(|&size| size != !0);
                    *slot = (buffer != 0).then_some((buffer, offset, size));
                    if let Some(&stride) = strides.get(at) {
                        encoder.state.set_stride((first + at) as u32, stride as u32);
                        encoder.ready = None;
                    }
                }
            }
            "vkCmdBindIndexBuffer" | "vkCmdBindIndexBuffer2" => {
                let size = if name.ends_with('2') { Some(args.u64("size")?).filter(|&size| size != !0) } else { None };
                let (buffer, offset) = (args.u64("buffer")?, args.u64("offset")?);
                encoder.index = (buffer != 0).then_some(((buffer, offset, size), args.u32("indexType")?));
                encoder.ready = None;
            }
            "vkCmdBeginConditionalRendering" => {
                let info = args.of("pConditionalRenderingBegin")?;
                let inverted = info.u32("flags")? & 1 != 0;
                encoder.condition = Some((info.u64("buffer")?, info.u64("offset")?, inverted));
            }
            "vkCmdEndConditionalRendering" => encoder.condition = None,
            "vkCmdBeginDebugUtilsLabel" => {
                let label = args.of("pLabelInfo")?.text("pLabelName")?;
                self.push_group(label, &mut encoder.open);
            }
            "vkCmdDebugMarkerBegin" => {
                let label = args.of("pMarkerInfo")?.text("pMarkerName")?;
                self.push_group(label, &mut encoder.open);
            }
            "vkCmdEndDebugUtilsLabel" | "vkCmdDebugMarkerEnd" => self.pop_group(&mut encoder.open),
            // The order of submission is the order of execution here.
            "vkCmdPipelineBarrier"
            | "vkCmdPipelineBarrier2"
            | "vkCmdSetEvent"
            | "vkCmdSetEvent2"
            | "vkCmdResetEvent"
            | "vkCmdResetEvent2"
            | "vkCmdWaitEvents"
            | "vkCmdWaitEvents2"
            | "vkCmdSetDeviceMask"
            | "vkCmdInsertDebugUtilsLabel"
            | "vkCmdDebugMarkerInsert"
            | "vkEndCommandBuffer" => {}
            _ => {
                let done = self.draw_command(name, args, encoder)?
                    || self.query_command(name, args, encoder)?
                    || self.transfer_command(name, args, encoder)?;
                if !done {
                    return unsupported("this command");
                }
            }
        }
        Ok(())
    }

    fn bind_sets(&mut self, args: Args<'_>, encoder: &mut Encoder) -> Outcome {
        self.bind_sets_at(args, args.u32("pipelineBindPoint")?, encoder)
    }

    fn bind_sets_at(&mut self, args: Args<'_>, point: u32, encoder: &mut Encoder) -> Outcome {
        let first = args.u32("firstSet")? as usize;
        let handles = args.numbers("pDescriptorSets")?;
        let mut offsets = args.numbers("pDynamicOffsets")?.into_iter().map(|offset| offset as u32);
        let mut bound = Vec::new();
        for handle in handles {
            if handle == 0 {
                bound.push(None);
                continue;
            }
            let set = known(self.objects.sets.get(handle), "descriptor set", handle)?;
            let dynamic = |binding: &&super::objects::LayoutBinding| matches!(&binding.kind, Ok(kind) if kind.is_dynamic());
            let count: u32 = set.layout.bindings.iter().filter(dynamic).map(|binding| binding.count).sum();
            bound.push(Some(BoundSet::Allocated(handle, offsets.by_ref().take(count as usize).collect())));
        }
        let sets = &mut encoder.point(point)?.sets;
        // Vulkan's implementations have 32 at most.
        sets.resize_with(sets.len().max(first.saturating_add(bound.len()).min(64)), || None);
        sets.iter_mut().skip(first).zip(bound).for_each(|(slot, set)| *slot = set);
        encoder.sets_changed(point);
        Ok(())
    }

    fn push_set(&mut self, args: Args<'_>, encoder: &mut Encoder, write: impl FnOnce(&mut Set) -> Outcome) -> Outcome {
        self.push_set_at(args.u32("pipelineBindPoint")?, args, encoder, write)
    }

    fn push_set_at(
        &mut self,
        point: u32,
        args: Args<'_>,
        encoder: &mut Encoder,
        write: impl FnOnce(&mut Set) -> Outcome,
    ) -> Outcome {
        let (handle, number) = (args.u64("layout")?, args.u32("set")? as usize);
        let layout = known(self.objects.pipeline_layouts.get(handle), "pipeline layout", handle)?;
        let layout = known(layout.sets.get(number).cloned().flatten(), "set", number as u64)?;
        let sets = &mut encoder.point(point)?.sets;
        sets.resize_with(sets.len().max(number.min(63) + 1), || None);
        let slot = known(sets.get_mut(number), "set", number as u64)?;
        let mut set = match slot.take() {
            Some(BoundSet::Pushed(set)) if set.layout.bindings.len() == layout.bindings.len() => set,
            _ => Set::new(&layout, 0),
        };
        write(&mut set)?;
        *slot = Some(BoundSet::Pushed(set));
        encoder.sets_changed(point);
        Ok(())
    }
}

impl Encoder {
    /// What is bound has changed: shaders may depend on the formats of images.
    fn sets_changed(&mut self, point: u32) {
        if point == 0 { self.ready = None } else { self.ready_compute = None }
    }
}

fn push_constants(args: Args<'_>, encoder: &mut Encoder) -> Outcome {
    let (offset, bytes) = (args.u32("offset")? as usize, args.bytes("pValues")?);
    let end = offset.saturating_add(bytes.len());
    if end > trace::check::IMMEDIATES_MAX as usize {
        return unsupported(format!("{end} bytes of push constants"));
    }
    encoder.constants.resize(encoder.constants.len().max(end), 0);
    encoder.constants[offset..end].copy_from_slice(&bytes);
    Ok(())
}
