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
        command.for_each_object(|object| stack.push(object));
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
        if let Some(owner) = bundle.or_else(|| command.creates()) {
            command.for_each_object(|object| {
                if object != owner {
                    holds.entry(owner).or_default().push(object);
                }
            });
        }
    }
    holds
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
