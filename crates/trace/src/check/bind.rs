//! Rules of bind group layouts, pipeline layouts and bind groups, and of binding them.

use std::rc::Rc;

use super::pass::Groups;
use super::*;

/// Entries of a layout by binding number; none: derived from a shader, which is not looked at here.
pub type GroupLayout = Option<Rc<[LayoutEntry]>>;

/// A pipeline layout.
pub struct PipelineLayout {
    pub groups: Rc<[Option<GroupLayout>]>,
}

/// A bind group.
pub struct Group {
    pub layout: GroupLayout,
    /// Buffers with a dynamic offset, by binding number: id, first byte, bytes, bytes of the buffer.
    dynamic: Vec<(BufferId, u64, u64, u64)>,
}

impl Checker<'_> {
    pub(super) fn create_bind_group_layout(&mut self, id: BindGroupLayoutId, entries: &[LayoutEntry]) -> CheckResult {
        let sorted = bind_group_layout(entries)?;
        Ok(self.group_layouts.create(id.0, Some(sorted.into()))?)
    }

    pub(super) fn create_pipeline_layout(
        &mut self,
        id: PipelineLayoutId,
        groups: &[Option<BindGroupLayoutId>],
        immediate_size: u32,
    ) -> CheckResult {
        pipeline_layout(groups.len(), immediate_size)?;
        let groups: Result<Rc<[_]>, String> =
            groups.iter().map(|group| group.map(|group| self.group_layouts.get(group.0).cloned()).transpose()).collect();
        Ok(self.pipeline_layouts.create(id.0, PipelineLayout { groups: groups? })?)
    }

    pub(super) fn create_bind_group(
        &mut self,
        id: BindGroupId,
        layout: BindGroupLayoutId,
        entries: &[BindGroupEntry],
    ) -> CheckResult {
        let layout = self.group_layouts.get(layout.0)?.clone();
        let mut sorted: Vec<&BindGroupEntry> = entries.iter().collect();
        sorted.sort_by_key(|entry| entry.binding);
        for pair in sorted.windows(2) {
            ensure!(pair[0].binding != pair[1].binding, "binding {} is given twice", pair[0].binding);
        }
        for entry in &sorted {
            self.bound_resource(entry).map_err(|reason| match reason {
                Reason::Rule(reason) => Reason::Rule(format!("binding {}: {reason}", entry.binding)),
                blob => blob,
            })?;
        }
        let mut dynamic = Vec::new();
        if let Some(layout) = &layout {
            for wanted in layout.iter() {
                let binding = wanted.binding;
                let Some(entry) = sorted.iter().find(|entry| entry.binding == binding) else {
                    return Err(format!("binding {binding} of the layout is missing").into());
                };
                let fits = matches_kind(wanted, &entry.resource);
                ensure!(fits, "binding {binding} is {}, the layout says {:?}", describe(&entry.resource), wanted.kind);
                if let (true, BoundResource::Buffer { buffer, offset, size }) = (is_dynamic(wanted.kind), &entry.resource) {
                    let length = *self.buffers.get(buffer.0)?;
                    dynamic.push((*buffer, *offset, size.unwrap_or(length - offset), length));
                }
            }
            let extra = sorted.iter().find(|entry| layout.iter().all(|wanted| wanted.binding != entry.binding));
            if let Some(extra) = extra {
                return Err(format!("binding {} is not in the layout", extra.binding).into());
            }
        }
        Ok(self.groups.create(id.0, Group { layout, dynamic })?)
    }

    fn bound_resource(&self, entry: &BindGroupEntry) -> CheckResult {
        let buffer = |id: &BufferId, offset: u64, size: Option<u64>| -> CheckResult {
            let size = open_range(&id, offset, size, *self.buffers.get(id.0)?)?;
            ensure!(size > 0, "an empty range of {id}");
            Ok(())
        };
        match &entry.resource {
            BoundResource::Buffer { buffer: id, offset, size } => buffer(id, *offset, *size),
            BoundResource::Buffers(list) => list.iter().try_for_each(|(id, offset, size)| buffer(id, *offset, *size)),
            BoundResource::View(id) => Ok(self.views.get(id.0).map(|_| ())?),
            BoundResource::Views(list) => Ok(list.iter().try_for_each(|id| self.views.get(id.0).map(|_| ()))?),
            BoundResource::Sampler(id) => Ok(self.samplers.get(id.0).map(|_| ())?),
            BoundResource::Samplers(list) => Ok(list.iter().try_for_each(|id| self.samplers.get(id.0).map(|_| ()))?),
        }
    }

    /// Checks a `SetBindGroup` and answers what is then bound.
    #[inline]
    pub(super) fn bound_group(
        &self,
        index: u32,
        group: Option<BindGroupId>,
        offsets: &[u32],
    ) -> Result<Option<GroupLayout>, Reason> {
        ensure!(index < BIND_GROUPS_MAX, "group {index}, there are {BIND_GROUPS_MAX}");
        let Some(id) = group else {
            ensure!(offsets.is_empty(), "dynamic offsets without a group");
            return Ok(None);
        };
        let group = self.groups.get(id.0)?;
        if group.layout.is_some() {
            let (given, wanted) = (offsets.len(), group.dynamic.len());
            ensure!(given == wanted, "{given} dynamic offsets, {id} has {wanted} dynamic bindings");
            for (&by, &(buffer, offset, size, length)) in offsets.iter().zip(&group.dynamic) {
                range_fits(&buffer, offset + u64::from(by), size, length)?;
            }
        }
        Ok(Some(group.layout.clone()))
    }
}

/// The entries of a bind group layout by binding number, if they keep the rules.
///
/// # Errors
/// The rule that is broken.
pub fn bind_group_layout(entries: &[LayoutEntry]) -> Result<Vec<LayoutEntry>, String> {
    let mut sorted = entries.to_vec();
    sorted.sort_by_key(|entry| entry.binding);
    for pair in sorted.windows(2) {
        ensure!(pair[0].binding != pair[1].binding, "binding {} is given twice", pair[0].binding);
    }
    for entry in &sorted {
        if let Some(count) = entry.count {
            let binding = entry.binding;
            let right = (1..=BINDING_ARRAY_MAX).contains(&count);
            ensure!(right, "binding {binding} is an array of {count}, it must be 1 to {BINDING_ARRAY_MAX}");
            ensure!(!is_dynamic(entry.kind), "binding {binding} is an array with a dynamic offset");
        }
    }
    Ok(sorted)
}

/// The rules of a pipeline layout with this number of groups.
///
/// # Errors
/// The rule that is broken.
pub fn pipeline_layout(groups: usize, immediate_size: u32) -> Result<(), String> {
    ensure!(groups <= BIND_GROUPS_MAX as usize, "{groups} groups, at most {BIND_GROUPS_MAX}");
    let words = immediate_size.is_multiple_of(4) && immediate_size <= IMMEDIATES_MAX;
    ensure!(words, "{immediate_size} bytes of immediates, it must be a multiple of 4 up to {IMMEDIATES_MAX}");
    Ok(())
}

/// Checks that what a pipeline layout asks for is bound.
#[inline]
pub fn groups_fit(layout: &Option<Rc<[Option<GroupLayout>]>>, bound: &Groups) -> CheckResult {
    let Some(layout) = layout else { return Ok(()) };
    for (index, wanted) in layout.iter().enumerate() {
        // A derived layout is checked where the shader is known.
        let Some(Some(wanted)) = wanted else { continue };
        if wanted.is_empty() {
            continue;
        }
        match &bound[index] {
            None => return Err(format!("the pipeline's bind group {index} is not set").into()),
            Some(Some(layout)) => ensure!(layout == wanted, "bind group {index} has another layout than the pipeline's"),
            Some(None) => return Err(format!("bind group {index} has the derived layout of another pipeline").into()),
        }
    }
    Ok(())
}

fn is_dynamic(kind: BindingKind) -> bool {
    matches!(kind, BindingKind::Uniform { dynamic_offset: true } | BindingKind::Storage { dynamic_offset: true, .. })
}

fn matches_kind(entry: &LayoutEntry, resource: &BoundResource) -> bool {
    let kind = entry.kind;
    let buffer = matches!(kind, BindingKind::Uniform { .. } | BindingKind::Storage { .. });
    let view = matches!(kind, BindingKind::Texture | BindingKind::StorageTexture);
    let sampler = kind == BindingKind::Sampler;
    // An array may be bound in part.
    let fits = |length: usize| entry.count.is_some_and(|count| (1..=count as usize).contains(&length));
    match resource {
        BoundResource::Buffer { .. } => buffer && entry.count.is_none(),
        BoundResource::View(_) => view && entry.count.is_none(),
        BoundResource::Sampler(_) => sampler && entry.count.is_none(),
        BoundResource::Buffers(list) => buffer && fits(list.len()),
        BoundResource::Views(list) => view && fits(list.len()),
        BoundResource::Samplers(list) => sampler && fits(list.len()),
    }
}

fn describe(resource: &BoundResource) -> String {
    match resource {
        BoundResource::Buffer { .. } => "a buffer".into(),
        BoundResource::View(_) => "a view".into(),
        BoundResource::Sampler(_) => "a sampler".into(),
        BoundResource::Buffers(list) => format!("an array of {} buffers", list.len()),
        BoundResource::Views(list) => format!("an array of {} views", list.len()),
        BoundResource::Samplers(list) => format!("an array of {} samplers", list.len()),
    }
}
