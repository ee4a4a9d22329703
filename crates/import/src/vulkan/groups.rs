//! Bind groups: made when a draw needs them, from what the descriptors hold then, and once for each content.

use std::collections::{BTreeMap, BTreeSet};

use num::*;
use trace::command::*;
use trace::record::Recorder;

use super::fault::{Fault, Outcome, unsupported};
use super::machine::Vulkan;
use super::objects::{Descriptor, DescriptorKind, Set, known};

/// Groups that are kept at most.
const GROUPS_MAX: usize = 1 << 14;

/// Where a native binding comes from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Origin {
    /// The view of a descriptor.
    View,
    /// The view of a descriptor, to which shaders write.
    Storage,
    /// The sampler of a descriptor.
    Sampler,
    /// The buffer of a descriptor, or its inline block or texels; the shader needs this number of bytes.
    Buffer(u64),
}

/// A binding of a native group.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Planned {
    /// The native number.
    pub native: u32,
    /// The number in the program's layout.
    pub binding: u32,
    /// What of the descriptor it takes.
    pub origin: Origin,
    /// Whether it is an array.
    pub array: bool,
}

/// A native group of a pipeline.
#[derive(Debug)]
pub struct Plan {
    /// The set, and the native group.
    pub set: u32,
    /// Its native layout.
    pub layout: BindGroupLayoutId,
    /// Its bindings.
    pub bindings: Vec<Planned>,
}

/// Bind groups that have been made.
#[derive(Default)]
pub struct Groups {
    known: BTreeMap<Vec<u64>, BindGroupId>,
    views: BTreeMap<u32, BTreeSet<Vec<u64>>>,
    buffers: BTreeMap<u32, BTreeSet<Vec<u64>>>,
    samplers: Vec<(gfx::state::SamplerDesc, SamplerId)>,
    /// Buffers with the contents of inline blocks.
    blocks: BTreeMap<Vec<u8>, BufferId>,
}

impl Groups {
    /// Ends all groups with a view.
    pub fn forget_view(&mut self, view: ViewId, card: &mut Recorder) {
        let keys = self.views.remove(&view.0).unwrap_or_default();
        keys.into_iter().for_each(|key| self.forget(&key, card));
    }

    /// Ends all groups with a buffer.
    pub fn forget_buffer(&mut self, buffer: BufferId, card: &mut Recorder) {
        let keys = self.buffers.remove(&buffer.0).unwrap_or_default();
        keys.into_iter().for_each(|key| self.forget(&key, card));
    }

    fn forget(&mut self, key: &Vec<u64>, card: &mut Recorder) {
        if let Some(group) = self.known.remove(key) {
            card.push(Command::Destroy(Object::BindGroup(group)));
        }
    }

    /// Ends all groups if there are many. Not while commands wait that use them.
    pub fn trim(&mut self, card: &mut Recorder) {
        if self.known.len() > GROUPS_MAX {
            self.views.clear();
            self.buffers.clear();
            for group in std::mem::take(&mut self.known).into_values() {
                card.push(Command::Destroy(Object::BindGroup(group)));
            }
        }
    }

    /// A native sampler; made once.
    pub fn sampler(&mut self, desc: gfx::state::SamplerDesc, card: &mut Recorder) -> Outcome<SamplerId> {
        if let Some(&(_, id)) = self.samplers.iter().find(|(known, _)| *known == desc) {
            return Ok(id);
        }
        trace::check::rules::sampler(&desc).map_err(Fault::Unsupported)?;
        let id = card.create_sampler(desc);
        self.samplers.push((desc, id));
        Ok(id)
    }
}

/// An element of a group's key.
fn code(resource: &BoundResource, key: &mut Vec<u64>) {
    match resource {
        BoundResource::Buffer { buffer, offset, size } => key.extend([1, buffer.0.into(), *offset, size.unwrap_or(0)]),
        BoundResource::View(view) => key.extend([2, view.0.into()]),
        BoundResource::Sampler(sampler) => key.extend([3, sampler.0.into()]),
        BoundResource::Buffers(list) => {
            key.extend([4, list.len() as u64]);
            list.iter().for_each(|(buffer, offset, size)| key.extend([buffer.0.into(), *offset, size.unwrap_or(0)]));
        }
        BoundResource::Views(list) => {
            key.extend([5, list.len() as u64]);
            key.extend(list.iter().map(|view| u64::from(view.0)));
        }
        BoundResource::Samplers(list) => {
            key.extend([6, list.len() as u64]);
            key.extend(list.iter().map(|sampler| u64::from(sampler.0)));
        }
    }
}

impl Vulkan {
    /// The native group of a set; `offsets` are those of its dynamic descriptors, in order.
    pub fn group(&mut self, plan: &Plan, set: &Set, offsets: &[u32]) -> Outcome<BindGroupId> {
        let mut entries = Vec::with_capacity(plan.bindings.len());
        let mut key = vec![plan.layout.0.into()];
        for planned in &plan.bindings {
            let resource = self.resource(plan.set, planned, set, offsets)?;
            key.push(planned.native.into());
            code(&resource, &mut key);
            entries.push((planned.native, resource));
        }
        if let Some(&known) = self.groups.known.get(&key) {
            return Ok(known);
        }
        for (_, resource) in &entries {
            let (buffers, views): (Vec<BufferId>, Vec<ViewId>) = match resource {
                BoundResource::Buffer { buffer, .. } => (vec![*buffer], Vec::new()),
                BoundResource::Buffers(list) => (list.iter().map(|(buffer, ..)| *buffer).collect(), Vec::new()),
                BoundResource::View(view) => (Vec::new(), vec![*view]),
                BoundResource::Views(list) => (Vec::new(), list.clone()),
                BoundResource::Sampler(_) | BoundResource::Samplers(_) => continue,
            };
            for buffer in buffers {
                self.groups.buffers.entry(buffer.0).or_default().insert(key.clone());
            }
            for view in views {
                self.groups.views.entry(view.0).or_default().insert(key.clone());
            }
        }
        let group = self.card.create_bind_group(plan.layout, entries);
        self.groups.known.insert(key, group);
        Ok(group)
    }

    fn resource(&mut self, number: u32, planned: &Planned, set: &Set, offsets: &[u32]) -> Outcome<BoundResource> {
        let Planned { binding, origin, array, .. } = *planned;
        let place = format!("set {number}, binding {binding}");
        let Some((layout, first)) = set.layout.find(binding) else {
            return unsupported(format!("{place}, which the shader reads and the set's layout does not have"));
        };
        let (kind, slots) = (layout.kind.clone()?, layout.slots());
        let count = if array { slots } else { 1 };
        // Dynamic offsets stand in the order of the bindings.
        let before = set.layout.bindings.iter().take_while(|other| other.binding < binding);
        let dynamic = |other: &super::objects::LayoutBinding| matches!(&other.kind, Ok(kind) if kind.is_dynamic());
        let dynamics: usize = before.filter(|other| dynamic(other)).map(|other| other.count as usize).sum();
        let (mut buffers, mut views, mut samplers) = (Vec::new(), Vec::new(), Vec::new());
        for element in 0..count {
            let descriptor = set.slots.get(first + element).cloned().unwrap_or_default();
            match (origin, descriptor) {
                (Origin::View, Descriptor::Image { view, .. }) if view != 0 => views.push(self.bound_view(view, false)?),
                (Origin::Storage, Descriptor::Image { view, .. }) if view != 0 => views.push(self.bound_view(view, true)?),
                (Origin::Sampler, Descriptor::Image { sampler, .. }) if sampler != 0 => {
                    let desc = known(self.objects.samplers.get(sampler), "sampler", sampler)?.clone()?.desc;
                    samplers.push(self.groups.sampler(desc, &mut self.card)?);
                }
                (Origin::Buffer(needed), Descriptor::Buffer { buffer, offset, range }) if buffer != 0 => {
                    let by = match offsets.get(dynamics + element) {
                        Some(&by) if kind.is_dynamic() => u64::from(by),
                        _ => 0,
                    };
                    buffers.push(self.bound_range(buffer, offset.saturating_add(by), range, needed)?);
                }
                (Origin::Buffer(needed), Descriptor::Texels(handle)) if handle != 0 => {
                    let view = known(self.objects.buffer_views.get(handle), "buffer view", handle)?;
                    let (buffer, offset, range) = (view.buffer, view.offset, view.range);
                    buffers.push(self.bound_range(buffer, offset, range, needed)?);
                }
                (Origin::Buffer(needed), Descriptor::Inline(bytes)) => buffers.push(self.inline_block(&bytes, needed)),
                // An array may have descriptors that are not read: what is in others stands for them.
                _ if array && element > 0 => {
                    buffers.extend(buffers.first().copied());
                    views.extend(views.first().copied());
                    samplers.extend(samplers.first().copied());
                }
                _ if matches!(kind, DescriptorKind::Inline) => {
                    return unsupported(format!("{place}: an inline block without bytes"));
                }
                _ => return unsupported(format!("{place}, which the shader reads and no descriptor was written to")),
            }
        }
        Ok(match (origin, array) {
            (Origin::View | Origin::Storage, false) => BoundResource::View(views[0]),
            (Origin::Sampler, false) => BoundResource::Sampler(samplers[0]),
            (Origin::Buffer(_), false) => {
                let (buffer, offset, size) = buffers[0];
                BoundResource::Buffer { buffer, offset, size }
            }
            (Origin::View | Origin::Storage, true) => BoundResource::Views(views),
            (Origin::Sampler, true) => BoundResource::Samplers(samplers),
            (Origin::Buffer(_), true) => BoundResource::Buffers(buffers),
        })
    }

    /// A range of a buffer that is at least as long as a shader's block: the program may bind what it has written of the block, or its length
    /// before it is rounded up.
    fn bound_range(
        &mut self,
        buffer: u64,
        offset: u64,
        range: Option<u64>,
        needed: u64,
    ) -> Outcome<(BufferId, u64, Option<u64>)> {
        let owner = known(self.objects.buffers.get(buffer), "buffer", buffer)?;
        // A dynamic offset moves a range, which then may reach beyond the buffer.
        let left = owner.size.saturating_sub(offset);
        let (memory, at) = owner.bound.unwrap_or_default();
        let (id, first, size) = self.range(buffer, offset, range.map(|range| range.min(left)))?;
        let end = known(self.objects.memories.get(memory), "memory object", memory)?.native.map_or(0, |(_, bytes)| bytes);
        let size = size.max(needed);
        if at.saturating_add(offset).saturating_add(size) > end {
            return unsupported(format!("a block of {size} bytes at byte {offset} of buffer {buffer}, which ends before"));
        }
        Ok((id, first, Some(size)))
    }

    /// A buffer with these bytes, the arguments of a draw.
    pub fn arguments(&mut self, bytes: Vec<u8>) -> BufferId {
        self.inline_block(&bytes, 0).0
    }

    /// A buffer with the contents of an inline block.
    fn inline_block(&mut self, bytes: &[u8], needed: u64) -> (BufferId, u64, Option<u64>) {
        let size = needed.max(bytes.len() as u64).max(4);
        let mut padded = bytes.to_vec();
        padded.resize(size as usize, 0);
        let card = &mut self.card;
        let id =
            *self.groups.blocks.entry(padded).or_insert_with_key(|padded| card.create_buffer_init("inline", padded.as_slice()));
        (id, 0, Some(size))
    }
}
