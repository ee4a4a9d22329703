//! When objects end.
//!
//! A wgpu trace says when its program dropped an object, not when it last used the object: a command buffer that was recorded
//! before the drop may be submitted after it. So the native stream destroys a dropped object after its last use. Who uses a bind
//! group, view, bundle, layout or pipeline also uses all objects that it holds. Objects that may hold the trace's picture are not
//! destroyed. After the last creation no object is destroyed.

use std::collections::{HashMap, HashSet};

use trace::command::*;

/// The objects to destroy, in order, each with the index of the command after which it is destroyed.
pub fn destructions(commands: &[Command], dropped: &[Object]) -> Vec<(usize, Object)> {
    let dropped: HashSet<Object> = dropped.iter().copied().collect();
    if dropped.is_empty() {
        return Vec::new();
    }
    let holds = holds(commands);
    let last = commands.iter().rposition(allocates).unwrap_or(0);
    let mut seen: HashSet<Object> = picture(commands).into_iter().collect();
    let mut ends = Vec::new();
    let mut stack = Vec::new();
    // The walk goes backwards, so that it meets the last use of an object first. A use inside a pass or bundle counts at its end,
    // because no object may be destroyed inside.
    let mut end = None;
    for (index, command) in commands.iter().enumerate().rev() {
        if matches!(command, Command::EndRenderPass | Command::EndComputePass | Command::EndBundle) {
            end = Some(index);
        }
        let at = end.unwrap_or(index);
        for_each_object(command, |object| stack.push(object));
        while let Some(object) = stack.pop() {
            if !seen.insert(object) {
                continue;
            }
            if at < last && dropped.contains(&object) {
                ends.push((at, object));
            }
            stack.extend(holds.get(&object).into_iter().flatten().copied());
        }
        if matches!(command, Command::BeginRenderPass { .. } | Command::BeginComputePass { .. } | Command::BeginBundle { .. }) {
            end = None;
        }
    }
    ends.sort_by_key(|&(at, object)| (at, order(object)));
    ends
}

/// What each object holds.
fn holds(commands: &[Command]) -> HashMap<Object, Vec<Object>> {
    let mut holds: HashMap<Object, Vec<Object>> = HashMap::new();
    let mut bundle = None;
    for command in commands {
        match command {
            Command::BeginBundle { id } => bundle = Some(Object::Bundle(*id)),
            Command::EndBundle => bundle = None,
            _ => {}
        }
        if let Some(owner) = bundle.or_else(|| created(command)) {
            for_each_object(command, |object| {
                if object != owner {
                    holds.entry(owner).or_default().push(object);
                }
            });
        }
    }
    holds
}

/// The object that a command creates from other objects.
fn created(command: &Command) -> Option<Object> {
    Some(match command {
        Command::CreateView { id, .. } => Object::View(*id),
        Command::CreatePipelineLayout { id, .. } => Object::PipelineLayout(*id),
        Command::CreateBindGroup { id, .. } => Object::BindGroup(*id),
        Command::CreateRenderPipeline { id, .. } => Object::RenderPipeline(*id),
        Command::CreateComputePipeline { id, .. } => Object::ComputePipeline(*id),
        Command::GetBindGroupLayout { id, .. } => Object::BindGroupLayout(*id),
        _ => return None,
    })
}

/// Whether a command allocates memory. After the last one that does, destroying objects saves nothing.
fn allocates(command: &Command) -> bool {
    matches!(
        command,
        Command::CreateBuffer { .. }
            | Command::CreateTexture { .. }
            | Command::CreateRenderPipeline { .. }
            | Command::CreateComputePipeline { .. }
    )
}

/// Objects that may hold the picture of a trace that presents nothing: the source of the last copy to a buffer, and the last colour targets.
fn picture(commands: &[Command]) -> Vec<Object> {
    let mut kept = Vec::new();
    if let Some(texture) = commands.iter().rev().find_map(|command| match command {
        Command::CopyTextureToBuffer { from, .. } => Some(from.texture),
        _ => None,
    }) {
        kept.push(Object::Texture(texture));
    }
    let targets = commands.iter().rev().find_map(|command| match command {
        Command::BeginRenderPass { color, .. } if color.iter().any(Option::is_some) => Some(color),
        _ => None,
    });
    let views = targets.into_iter().flatten().flatten().flat_map(|target| [Some(target.view), target.resolve]);
    for view in views.flatten() {
        kept.push(Object::View(view));
        kept.extend(commands.iter().find_map(|command| match command {
            Command::CreateView { id, texture, .. } if *id == view => Some(Object::Texture(*texture)),
            _ => None,
        }));
    }
    kept
}

/// Calls `see` with each object that a command names.
fn for_each_object(command: &Command, mut see: impl FnMut(Object)) {
    match command {
        Command::CreateBuffer { id, .. } | Command::WriteBuffer { id, .. } => see(Object::Buffer(*id)),
        Command::CreateTexture { id, .. } => see(Object::Texture(*id)),
        Command::WriteTexture { to, .. } => see(Object::Texture(to.texture)),
        Command::CreateView { id, texture, .. } => {
            see(Object::View(*id));
            see(Object::Texture(*texture));
        }
        Command::SetSprite { view, .. } => view.iter().for_each(|&view| see(Object::View(view))),
        Command::CreateSampler { id, .. } => see(Object::Sampler(*id)),
        Command::CreateShader { id, .. } => see(Object::Shader(*id)),
        Command::CreateBindGroupLayout { id, .. } => see(Object::BindGroupLayout(*id)),
        Command::CreatePipelineLayout { id, groups, .. } => {
            see(Object::PipelineLayout(*id));
            groups.iter().flatten().for_each(|&group| see(Object::BindGroupLayout(group)));
        }
        Command::CreateBindGroup { id, layout, entries } => {
            see(Object::BindGroup(*id));
            see(Object::BindGroupLayout(*layout));
            entries.iter().for_each(|entry| for_each_bound(&entry.resource, &mut see));
        }
        Command::CreateRenderPipeline { id, desc, .. } => {
            see(Object::RenderPipeline(*id));
            desc.layout.into_iter().for_each(|layout| see(Object::PipelineLayout(layout)));
            desc.stages().for_each(|(_, stage)| see(Object::Shader(stage.shader)));
        }
        Command::CreateComputePipeline { id, layout, stage, .. } => {
            see(Object::ComputePipeline(*id));
            layout.iter().for_each(|&layout| see(Object::PipelineLayout(layout)));
            see(Object::Shader(stage.shader));
        }
        Command::GetBindGroupLayout { id, pipeline, .. } => {
            see(Object::BindGroupLayout(*id));
            see(match *pipeline {
                AnyPipeline::Render(pipeline) => Object::RenderPipeline(pipeline),
                AnyPipeline::Compute(pipeline) => Object::ComputePipeline(pipeline),
            });
        }
        Command::CreateQuerySet { id, .. } => see(Object::QuerySet(*id)),
        Command::Destroy(object) => see(*object),
        Command::CopyBufferToBuffer { from, to, .. } => {
            see(Object::Buffer(*from));
            see(Object::Buffer(*to));
        }
        Command::CopyBufferToTexture { from, to, .. } => {
            see(Object::Buffer(*from));
            see(Object::Texture(to.texture));
        }
        Command::CopyTextureToBuffer { from, to, .. } => {
            see(Object::Texture(from.texture));
            see(Object::Buffer(*to));
        }
        Command::CopyTextureToTexture { from, to, .. } => {
            see(Object::Texture(from.texture));
            see(Object::Texture(to.texture));
        }
        Command::ClearBuffer { buffer, .. } => see(Object::Buffer(*buffer)),
        Command::ClearTexture { texture, .. } | Command::Present { texture } => see(Object::Texture(*texture)),
        Command::WriteTimestamp { set, .. } | Command::BeginStatisticsQuery { set, .. } => see(Object::QuerySet(*set)),
        Command::ResolveQuerySet { set, to, .. } => {
            see(Object::QuerySet(*set));
            see(Object::Buffer(*to));
        }
        Command::BeginRenderPass { color, depth, occlusion, timestamps, .. } => {
            for target in color.iter().flatten() {
                see(Object::View(target.view));
                target.resolve.iter().for_each(|&view| see(Object::View(view)));
            }
            depth.iter().for_each(|depth| see(Object::View(depth.view)));
            occlusion.iter().for_each(|&set| see(Object::QuerySet(set)));
            timestamps.iter().for_each(|times| see(Object::QuerySet(times.set)));
        }
        Command::BeginComputePass { timestamps, .. } => {
            timestamps.iter().for_each(|times| see(Object::QuerySet(times.set)));
        }
        Command::BeginBundle { id } => see(Object::Bundle(*id)),
        Command::SetRenderPipeline(id) => see(Object::RenderPipeline(*id)),
        Command::SetComputePipeline(id) => see(Object::ComputePipeline(*id)),
        Command::SetBindGroup { group, .. } => group.iter().for_each(|&group| see(Object::BindGroup(group))),
        Command::SetIndexBuffer { buffer, .. } | Command::DispatchIndirect { buffer, .. } => see(Object::Buffer(*buffer)),
        Command::SetVertexBuffer { buffer, .. } => buffer.iter().for_each(|&buffer| see(Object::Buffer(buffer))),
        Command::DrawIndirect { buffer, count_buffer, .. } => {
            see(Object::Buffer(*buffer));
            count_buffer.iter().for_each(|&(buffer, _)| see(Object::Buffer(buffer)));
        }
        Command::ExecuteBundles(bundles) => bundles.iter().for_each(|&bundle| see(Object::Bundle(bundle))),
        Command::EndRenderPass
        | Command::EndComputePass
        | Command::EndBundle
        | Command::SetImmediates { .. }
        | Command::SetViewport(_)
        | Command::SetScissor(_)
        | Command::SetBlendConstant(_)
        | Command::SetStencilReference(_)
        | Command::SetStencilReferences { .. }
        | Command::Draw { .. }
        | Command::DrawIndexed { .. }
        | Command::Dispatch { .. }
        | Command::BeginOcclusionQuery { .. }
        | Command::EndOcclusionQuery
        | Command::EndStatisticsQuery
        | Command::SetCallSite(_)
        | Command::PushDebugGroup(_)
        | Command::PopDebugGroup
        | Command::InsertDebugMarker(_) => {}
    }
}

fn for_each_bound(resource: &BoundResource, see: &mut impl FnMut(Object)) {
    match resource {
        BoundResource::Buffer { buffer, .. } => see(Object::Buffer(*buffer)),
        BoundResource::View(view) => see(Object::View(*view)),
        BoundResource::Sampler(sampler) => see(Object::Sampler(*sampler)),
        BoundResource::Buffers(all) => all.iter().for_each(|&(buffer, ..)| see(Object::Buffer(buffer))),
        BoundResource::Views(all) => all.iter().for_each(|&view| see(Object::View(view))),
        BoundResource::Samplers(all) => all.iter().for_each(|&sampler| see(Object::Sampler(sampler))),
    }
}

/// Kind and number, by which objects are sorted: a holder comes before the objects that it holds.
fn order(object: Object) -> (u8, u32) {
    match object {
        Object::Bundle(id) => (0, id.0),
        Object::BindGroup(id) => (1, id.0),
        Object::RenderPipeline(id) => (2, id.0),
        Object::ComputePipeline(id) => (3, id.0),
        Object::PipelineLayout(id) => (4, id.0),
        Object::BindGroupLayout(id) => (5, id.0),
        Object::Shader(id) => (6, id.0),
        Object::View(id) => (7, id.0),
        Object::Sampler(id) => (8, id.0),
        Object::Texture(id) => (9, id.0),
        Object::Buffer(id) => (10, id.0),
        Object::QuerySet(id) => (11, id.0),
    }
}
