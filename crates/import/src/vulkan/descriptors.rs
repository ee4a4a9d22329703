//! Descriptor sets: how they are allocated, written and copied.

use std::rc::Rc;

use super::args::Args;
use super::fault::{Fault, Outcome};
use super::machine::Vulkan;
use super::objects::*;

/// A range in bytes; none: to the end.
fn range(of: Args<'_>) -> Outcome<Option<u64>> {
    Ok(Some(of.u64("range")?).filter(|&range| range != !0))
}

fn buffer(of: Args<'_>) -> Outcome<Descriptor> {
    Ok(Descriptor::Buffer { buffer: of.u64("buffer")?, offset: of.u64("offset")?, range: range(of)? })
}

/// The view and the sampler of an image descriptor. What its type does not use may be any number.
fn image(of: Args<'_>, kind: DescriptorKind) -> Outcome<Descriptor> {
    let (view, sampler) = (of.u64("imageView")?, of.u64("sampler")?);
    Ok(match kind {
        DescriptorKind::Sampler => Descriptor::Image { view: 0, sampler },
        DescriptorKind::Combined => Descriptor::Image { view, sampler },
        _ => Descriptor::Image { view, sampler: 0 },
    })
}

impl Set {
    /// Writes descriptors from an element of a binding on. What does not fit goes on in the next bindings.
    fn write(&mut self, binding: u32, element: u32, values: Vec<Descriptor>) -> Outcome {
        let (layout, first) = known(self.layout.find(binding), "binding", binding.into())?;
        let immutable = !layout.immutable.is_empty();
        let start = first + element as usize;
        let slots = Rc::make_mut(&mut self.slots);
        for (at, value) in values.into_iter().enumerate() {
            let slot = known(slots.get_mut(start + at), "descriptor", (start + at) as u64)?;
            *slot = match (value, &*slot) {
                // The sampler of the layout stays.
                (Descriptor::Image { view, .. }, Descriptor::Image { sampler, .. }) if immutable => {
                    Descriptor::Image { view, sampler: *sampler }
                }
                (value, _) => value,
            };
        }
        Ok(())
    }

    /// Writes bytes of an inline block.
    fn write_inline(&mut self, binding: u32, start: u32, bytes: &[u8]) -> Outcome {
        let (_, first) = known(self.layout.find(binding), "binding", binding.into())?;
        let slots = Rc::make_mut(&mut self.slots);
        let Some(Descriptor::Inline(block)) = slots.get_mut(first) else {
            return Err(Fault::Damaged(format!("binding {binding} is no inline block")));
        };
        let start = start as usize;
        let target = Rc::make_mut(block).get_mut(start..start.saturating_add(bytes.len()));
        known(target, "byte of an inline block", start as u64)?.copy_from_slice(bytes);
        Ok(())
    }

    /// Carries out a `VkWriteDescriptorSet`.
    pub fn update(&mut self, write: Args<'_>) -> Outcome {
        let kind = DescriptorKind::new(write.u32("descriptorType")?)?;
        let (binding, element) = (write.u32("dstBinding")?, write.u32("dstArrayElement")?);
        let values = match kind {
            DescriptorKind::Inline => {
                let block = write.chained("VkWriteDescriptorSetInlineUniformBlock");
                let bytes = known(block, "inline block", binding.into())?.bytes("pData")?;
                return self.write_inline(binding, element, &bytes);
            }
            DescriptorKind::UniformTexels | DescriptorKind::StorageTexels => {
                write.numbers("pTexelBufferView")?.into_iter().map(Descriptor::Texels).collect()
            }
            DescriptorKind::Uniform
            | DescriptorKind::Storage
            | DescriptorKind::UniformDynamic
            | DescriptorKind::StorageDynamic => {
                write.list("pBufferInfo")?.into_iter().map(buffer).collect::<Outcome<Vec<_>>>()?
            }
            DescriptorKind::Sampler
            | DescriptorKind::Combined
            | DescriptorKind::Sampled
            | DescriptorKind::StorageImage
            | DescriptorKind::Input => {
                write.list("pImageInfo")?.into_iter().map(|of| image(of, kind)).collect::<Outcome<Vec<_>>>()?
            }
        };
        self.write(binding, element, values)
    }

    /// Writes what an update template's data has.
    pub fn update_with(&mut self, entries: &[TemplateEntry], data: Args<'_>) -> Outcome {
        let mut images = data.list("imageInfos")?.into_iter();
        let mut buffers = data.list("bufferInfos")?.into_iter();
        let mut texels = data.numbers("texelBufferViews")?.into_iter();
        let (inline, mut taken) = (data.bytes("inlineUniformBlocks")?, 0usize);
        let missing = |what: &str| Fault::Damaged(format!("the data of an update template has too few {what}"));
        for entry in entries {
            let kind = DescriptorKind::new(entry.kind)?;
            let count = entry.count as usize;
            let mut values = Vec::new();
            match kind {
                DescriptorKind::Inline => {
                    let bytes = inline.get(taken..taken.saturating_add(count)).ok_or_else(|| missing("bytes"))?;
                    taken += count;
                    self.write_inline(entry.binding, entry.element, bytes)?;
                    continue;
                }
                DescriptorKind::UniformTexels | DescriptorKind::StorageTexels => {
                    values.extend(texels.by_ref().take(count).map(Descriptor::Texels));
                }
                DescriptorKind::Uniform
                | DescriptorKind::Storage
                | DescriptorKind::UniformDynamic
                | DescriptorKind::StorageDynamic => {
                    for of in buffers.by_ref().take(count) {
                        values.push(buffer(of)?);
                    }
                }
                DescriptorKind::Sampler
                | DescriptorKind::Combined
                | DescriptorKind::Sampled
                | DescriptorKind::StorageImage
                | DescriptorKind::Input => {
                    for of in images.by_ref().take(count) {
                        values.push(image(of, kind)?);
                    }
                }
            }
            if values.len() != count {
                return Err(missing("descriptors"));
            }
            self.write(entry.binding, entry.element, values)?;
        }
        Ok(())
    }
}

impl Vulkan {
    /// Runs a call about descriptors. Answers whether it is one.
    pub fn describe(&mut self, name: &str, call: Args<'_>) -> Outcome<bool> {
        match name {
            "vkAllocateDescriptorSets" => {
                let info = call.of("pAllocateInfo")?;
                let pool = info.u64("descriptorPool")?;
                for (layout, handle) in info.numbers("pSetLayouts")?.into_iter().zip(call.numbers("pDescriptorSets")?) {
                    let layout = known(self.objects.set_layouts.get(layout), "descriptor set layout", layout)?;
                    self.objects.sets.insert(handle, Set::new(layout, pool));
                }
            }
            "vkFreeDescriptorSets" => {
                for handle in call.numbers("pDescriptorSets")? {
                    self.objects.sets.remove(handle);
                }
            }
            "vkResetDescriptorPool" | "vkDestroyDescriptorPool" => {
                let pool = call.u64("descriptorPool")?;
                let gone: Vec<Handle> =
                    self.objects.sets.iter().filter(|(_, set)| set.pool == pool).map(|(handle, _)| handle).collect();
                gone.into_iter().for_each(|handle| drop(self.objects.sets.remove(handle)));
            }
            "vkUpdateDescriptorSets" => {
                for write in call.list("pDescriptorWrites")? {
                    let handle = write.u64("dstSet")?;
                    known(self.objects.sets.get_mut(handle), "descriptor set", handle)?.update(write)?;
                }
                call.list("pDescriptorCopies")?.into_iter().try_for_each(|copy| self.copy_descriptors(copy))?;
            }
            "vkCreateDescriptorUpdateTemplate" => {
                let entry = |of: Args<'_>| -> Outcome<TemplateEntry> {
                    let (binding, element) = (of.u32("dstBinding")?, of.u32("dstArrayElement")?);
                    Ok(TemplateEntry { binding, element, count: of.u32("descriptorCount")?, kind: of.u32("descriptorType")? })
                };
                let info = call.of("pCreateInfo")?;
                let entries = info.list("pDescriptorUpdateEntries")?.into_iter().map(entry).collect::<Outcome<Vec<_>>>()?;
                let template = (Rc::new(entries), info.u32("pipelineBindPoint")?);
                self.objects.templates.insert(call.u64("pDescriptorUpdateTemplate")?, template);
            }
            "vkDestroyDescriptorUpdateTemplate" => drop(self.objects.templates.remove(call.u64("descriptorUpdateTemplate")?)),
            "vkUpdateDescriptorSetWithTemplate" => {
                let (handle, template) = (call.u64("descriptorSet")?, call.u64("descriptorUpdateTemplate")?);
                let (entries, _) = known(self.objects.templates.get(template), "update template", template)?.clone();
                let set = known(self.objects.sets.get_mut(handle), "descriptor set", handle)?;
                set.update_with(&entries, call.of("pData")?)?;
            }
            _ => return Ok(false),
        }
        Ok(true)
    }

    fn copy_descriptors(&mut self, copy: Args<'_>) -> Outcome {
        let (from, to) = (copy.u64("srcSet")?, copy.u64("dstSet")?);
        let source = known(self.objects.sets.get(from), "descriptor set", from)?;
        let binding = copy.u32("srcBinding")?;
        let (layout, first) = known(source.layout.find(binding), "binding", binding.into())?;
        let (element, count) = (copy.u32("srcArrayElement")? as usize, copy.u32("descriptorCount")? as usize);
        let slots = source.slots.clone();
        let inline = layout.kind == Ok(DescriptorKind::Inline);
        let target = known(self.objects.sets.get_mut(to), "descriptor set", to)?;
        let (binding, start) = (copy.u32("dstBinding")?, copy.u32("dstArrayElement")?);
        if let (true, Some(Descriptor::Inline(bytes))) = (inline, slots.get(first)) {
            let bytes = known(bytes.get(element..element.saturating_add(count)), "byte of an inline block", element as u64)?;
            return target.write_inline(binding, start, bytes);
        }
        let start_of = first.saturating_add(element);
        let values = known(slots.get(start_of..start_of.saturating_add(count)), "descriptor", start_of as u64)?;
        target.write(binding, start, values.to_vec())
    }
}
