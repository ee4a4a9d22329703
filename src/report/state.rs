//! The state of draws in words: what their pipeline, bindings and pass are, as the commands of the trace have set them. Nothing is drawn for it.

use std::collections::{BTreeMap, BTreeSet};
use std::ops::ControlFlow;

use crate::gfx::state::{
    BlendComponent, BlendFactor, BlendOp, ColorTarget, Compare, DepthStencil, FrontFace, Rect, SamplerDesc, StencilFace,
    VertexAttribute, Viewport,
};
use crate::host::one_line;
use crate::num::{BindGroupId, BufferId, BundleId, CallSite, RenderPipelineId, SamplerId, ShaderId, TextureId, ViewId};
use crate::report::summary::bytes;
use crate::trace::command::*;
use crate::trace::{Trace, TraceError};

/// A part of the state: its heading, and its lines of a name and a value each.
pub type StatePart = (&'static str, Vec<(String, String)>);

/// The state of a draw.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct DrawState {
    /// Where the command that draws was made.
    pub site: CallSite,
    /// The parts, in the order in which a card goes through them.
    pub parts: Vec<StatePart>,
}

impl DrawState {
    /// The state as text, a line for each value.
    pub fn text(&self) -> String {
        let width = self.parts.iter().flat_map(|(_, lines)| lines).map(|(name, _)| name.chars().count()).max().unwrap_or(0);
        let mut text = String::new();
        for (title, lines) in &self.parts {
            text.push_str(&format!("\n{title}\n"));
            for (name, value) in lines {
                text.push_str(&format!("  {name:<width$}  {}\n", one_line(value)));
            }
        }
        text
    }
}

/// Finds the states of draws by their numbers in the trace. A draw that is not in the trace has none.
///
/// # Errors
/// If the trace cannot be read, or if the number of draws before one of these is only known to a buffer on the card.
pub fn states(trace: &Trace, draws: &BTreeSet<u32>) -> Result<BTreeMap<u32, DrawState>, TraceError> {
    let mut walk = Walk::new(draws);
    trace.try_for_each_command(|index, command| -> Result<ControlFlow<()>, TraceError> {
        walk.command(index, command).map_err(|reason| trace.error_at(index, format!("{}: {reason}", command.name())))?;
        Ok(if walk.last.is_none_or(|last| walk.next > last) { ControlFlow::Break(()) } else { ControlFlow::Continue(()) })
    })?;
    Ok(walk.found)
}

/// What commands of a pass or bundle have bound.
#[derive(Clone, Default)]
struct Bound {
    pipeline: Option<RenderPipelineId>,
    groups: BTreeMap<u32, (BindGroupId, Vec<u32>)>,
    vertex: BTreeMap<u32, (BufferId, u64, Option<u64>)>,
    index: Option<(BufferId, String, u64)>,
}

/// State of a pass that outlives bundles.
#[derive(Clone, Default)]
struct PassState {
    color: Vec<Option<ColorAttachment>>,
    depth: Option<DepthAttachment>,
    label: String,
    viewport: Option<Viewport>,
    scissor: Option<Rect>,
    blend: Option<[f64; 4]>,
    stencil: [u32; 2],
}

struct Walk<'d> {
    wanted: &'d BTreeSet<u32>,
    last: Option<u32>,
    /// The number of the next draw.
    next: u32,
    site: Option<CallSite>,
    buffers: BTreeMap<BufferId, (u64, String)>,
    textures: BTreeMap<TextureId, (TextureDesc, String)>,
    views: BTreeMap<ViewId, (TextureId, ViewDesc)>,
    samplers: BTreeMap<SamplerId, SamplerDesc>,
    shaders: BTreeMap<ShaderId, String>,
    groups: BTreeMap<BindGroupId, Vec<BindGroupEntry>>,
    pipelines: BTreeMap<RenderPipelineId, (Box<RenderPipelineDesc>, String)>,
    bundles: BTreeMap<BundleId, Vec<Command>>,
    /// The bundle that is recorded.
    bundle: Option<(BundleId, Vec<Command>)>,
    bound: Bound,
    pass: PassState,
    found: BTreeMap<u32, DrawState>,
}

fn label_of(label: &Option<String>) -> String {
    label.clone().unwrap_or_default()
}

impl<'d> Walk<'d> {
    fn new(wanted: &'d BTreeSet<u32>) -> Walk<'d> {
        Walk {
            wanted,
            last: wanted.last().copied(),
            next: 0,
            site: None,
            buffers: BTreeMap::new(),
            textures: BTreeMap::new(),
            views: BTreeMap::new(),
            samplers: BTreeMap::new(),
            shaders: BTreeMap::new(),
            groups: BTreeMap::new(),
            pipelines: BTreeMap::new(),
            bundles: BTreeMap::new(),
            bundle: None,
            bound: Bound::default(),
            pass: PassState::default(),
            found: BTreeMap::new(),
        }
    }

    fn command(&mut self, index: u64, command: &Command) -> Result<(), String> {
        match command {
            Command::CreateBuffer { id, size, label } => drop(self.buffers.insert(*id, (*size, label_of(label)))),
            Command::CreateTexture { id, desc, label } => drop(self.textures.insert(*id, (desc.clone(), label_of(label)))),
            Command::CreateView { id, texture, desc } => drop(self.views.insert(*id, (*texture, desc.clone()))),
            Command::CreateSampler { id, desc } => drop(self.samplers.insert(*id, *desc)),
            Command::CreateShader { id, source, label } => drop(self.shaders.insert(*id, shader_name(source, label))),
            Command::CreateBindGroup { id, entries, .. } => drop(self.groups.insert(*id, entries.clone())),
            Command::CreateRenderPipeline { id, desc, label } => {
                self.pipelines.insert(*id, (desc.clone(), label_of(label)));
            }
            Command::Destroy(object) => self.destroy(*object),
            Command::BeginBundle { id } => self.bundle = Some((*id, Vec::new())),
            Command::EndBundle => self.bundles.extend(self.bundle.take()),
            command => match &mut self.bundle {
                Some((_, commands)) => commands.push(command.clone()),
                None => self.run(index, command)?,
            },
        }
        Ok(())
    }

    fn destroy(&mut self, object: Object) {
        match object {
            Object::Buffer(id) => drop(self.buffers.remove(&id)),
            Object::Texture(id) => drop(self.textures.remove(&id)),
            Object::View(id) => drop(self.views.remove(&id)),
            Object::Sampler(id) => drop(self.samplers.remove(&id)),
            Object::Shader(id) => drop(self.shaders.remove(&id)),
            Object::BindGroup(id) => drop(self.groups.remove(&id)),
            Object::RenderPipeline(id) => drop(self.pipelines.remove(&id)),
            Object::Bundle(id) => drop(self.bundles.remove(&id)),
            _ => {}
        }
    }

    /// Runs a command that is not about objects.
    fn run(&mut self, index: u64, command: &Command) -> Result<(), String> {
        match command {
            Command::SetCallSite(site) => self.site = Some(*site),
            Command::BeginRenderPass { color, depth, label, .. } => {
                self.bound = Bound::default();
                let (color, depth, label) = (color.clone(), depth.clone(), label_of(label));
                self.pass = PassState { color, depth, label, ..PassState::default() };
            }
            Command::SetRenderPipeline(id) => self.bound.pipeline = Some(*id),
            Command::SetBindGroup { index, group: Some(group), offsets } => {
                self.bound.groups.insert(*index, (*group, offsets.clone()));
            }
            Command::SetBindGroup { index, group: None, .. } => drop(self.bound.groups.remove(index)),
            Command::SetVertexBuffer { slot, buffer: Some(buffer), offset, size } => {
                self.bound.vertex.insert(*slot, (*buffer, *offset, *size));
            }
            Command::SetVertexBuffer { slot, buffer: None, .. } => drop(self.bound.vertex.remove(slot)),
            Command::SetIndexBuffer { buffer, format, offset, .. } => {
                self.bound.index = Some((*buffer, words(format), *offset));
            }
            Command::SetViewport(viewport) => self.pass.viewport = Some(*viewport),
            Command::SetScissor(rect) => self.pass.scissor = Some(*rect),
            Command::SetBlendConstant(constant) => self.pass.blend = Some(*constant),
            Command::SetStencilReference(reference) => self.pass.stencil = [*reference; 2],
            Command::SetStencilReferences { front, back } => self.pass.stencil = [*front, *back],
            Command::ExecuteBundles(ids) => {
                for id in ids {
                    let commands = self.bundles.get(id).cloned().unwrap_or_default();
                    self.bound = Bound::default();
                    commands.iter().try_for_each(|command| self.run(index, command))?;
                    self.bound = Bound::default();
                }
            }
            command => {
                match command.draws() {
                    None => {}
                    Some(Draws::Direct { indexed, range }) => {
                        let DrawRange { first, count, base_vertex, first_instance, instances, .. } = range;
                        let what = if indexed { "indices" } else { "vertices" };
                        let base = if base_vertex != 0 { format!(", base vertex {base_vertex}") } else { String::new() };
                        let range = format!("{count} {what} from {first}{base}; {instances} instances from {first_instance}");
                        self.draw(index, range, indexed);
                    }
                    Some(Draws::Indirect { count_buffer: Some(_), .. }) if self.last.is_some_and(|last| last >= self.next) => {
                        return Err("how many draws these are is in a buffer on the card, so that draws from here on have no known number".into());
                    }
                    Some(Draws::Indirect { buffer, offset, indexed, count, .. }) => {
                        for number in 0..count {
                            let range =
                                format!("draw {number} of {count}, by arguments in {} from byte {offset}", self.buffer(buffer));
                            self.draw(index, range, indexed);
                        }
                    }
                }
            }
        }
        Ok(())
    }

    fn draw(&mut self, index: u64, range: String, indexed: bool) {
        let number = self.next;
        self.next += 1;
        if self.wanted.contains(&number) {
            let site = self.site.unwrap_or(CallSite::Command(index));
            self.found.insert(number, DrawState { site, parts: self.parts(range, indexed) });
        }
    }

    fn buffer(&self, id: BufferId) -> String {
        match self.buffers.get(&id) {
            Some((size, label)) => format!("buffer {}{} of {}", id.0, quoted(label), bytes(*size as f64)),
            None => format!("buffer {}", id.0),
        }
    }

    fn texture(&self, id: TextureId) -> String {
        let Some((desc, label)) = self.textures.get(&id) else { return format!("texture {}", id.0) };
        let [width, height, depth] = desc.size;
        let mut text = format!("texture {}{}: {}, {width} x {height}", id.0, quoted(label), desc.format.name());
        if depth > 1 {
            text.push_str(&format!(" x {depth}"));
        }
        for (count, what) in [(desc.levels, "levels"), (desc.samples, "samples")] {
            if count > 1 {
                text.push_str(&format!(", {count} {what}"));
            }
        }
        text
    }

    fn view(&self, id: ViewId) -> String {
        let Some((texture, desc)) = self.views.get(&id) else { return format!("view {}", id.0) };
        let mut text = self.texture(*texture);
        if let Some(format) = desc.format {
            text.push_str(&format!(", seen as {}", format.name()));
        }
        for (first, count, what) in [(desc.base_level, desc.levels, "level"), (desc.base_layer, desc.layers, "layer")] {
            match (first, count) {
                (0, None) => {}
                (first, Some(1)) => text.push_str(&format!(", {what} {first}")),
                (first, Some(count)) => {
                    text.push_str(&format!(", {what}s {first} to {}", (u64::from(first) + u64::from(count)).saturating_sub(1)))
                }
                (first, None) => text.push_str(&format!(", {what}s from {first}")),
            }
        }
        text
    }

    fn stage(&self, stage: &StageDesc) -> String {
        let shader = self.shaders.get(&stage.shader).cloned().unwrap_or_else(|| format!("shader {}", stage.shader.0));
        let entry = stage.entry.as_ref().map_or(String::new(), |entry| format!(", entry point {entry}"));
        let constants: Vec<String> = stage.constants.iter().map(|(name, value)| format!("{name} = {value}")).collect();
        let constants = if constants.is_empty() { String::new() } else { format!(", {}", constants.join(", ")) };
        format!("{shader}{entry}{constants}")
    }

    fn parts(&self, range: String, indexed: bool) -> Vec<StatePart> {
        let pipeline = self.bound.pipeline.and_then(|id| Some((id, self.pipelines.get(&id)?)));
        let mut parts = Vec::new();
        let mut part = |title, lines: Vec<(String, String)>| {
            if !lines.is_empty() {
                parts.push((title, lines));
            }
        };
        let line = |name: &str, value: String| (name.to_owned(), value);
        let mut vertices = vec![line("draws", range)];
        if let (true, Some((buffer, format, offset))) = (indexed, &self.bound.index) {
            vertices.push(line("indices", format!("{format}, {} from byte {offset}", self.buffer(*buffer))));
        }
        let Some((id, (desc, label))) = pipeline else {
            part("Vertices", vertices);
            return parts;
        };
        vertices.push(line("pipeline", format!("{}{}", id.0, quoted(label))));
        vertices.push(line("topology", words(&desc.primitive.topology)));
        for (slot, layout) in desc.buffers.iter().enumerate() {
            let Some(layout) = layout else { continue };
            let bound = self.bound.vertex.get(&(slot as u32));
            let bound = bound.map_or("nothing bound".to_owned(), |(buffer, offset, _)| {
                format!("{} from byte {offset}", self.buffer(*buffer))
            });
            let of = |attribute: &VertexAttribute| {
                format!("location {} {} at {}", attribute.location, attribute.format.name(), attribute.offset)
            };
            let attributes: Vec<String> = layout.attributes.iter().map(of).collect();
            let (step, stride) = (words(&layout.step), layout.stride);
            let value = format!("{stride} bytes per {step}: {}; {bound}", attributes.join(", "));
            vertices.push((format!("vertex buffer {slot}"), value));
        }
        vertices.push(line("vertex shader", self.stage(&desc.vertex)));
        part("Vertices", vertices);
        part("Rasteriser", self.rasteriser(desc));
        let mut fragments: Vec<(String, String)> = Vec::new();
        fragments.extend(desc.fragment.as_ref().map(|stage| line("fragment shader", self.stage(stage))));
        fragments.extend(desc.depth_stencil.as_ref().into_iter().flat_map(|state| depth_lines(state, self.pass.stencil)));
        part("Fragments", fragments);
        part("Targets", self.targets(desc));
        part("Bindings", self.bindings());
        parts
    }

    fn rasteriser(&self, desc: &RenderPipelineDesc) -> Vec<(String, String)> {
        let primitive = &desc.primitive;
        let mut lines = vec![
            ("culls".to_owned(), format!("{}; front faces are {}", words(&primitive.cull_mode), winding(primitive.front_face))),
            ("fills".to_owned(), words(&primitive.polygon_mode)),
        ];
        let whole = "the whole of the attachments".to_owned();
        let viewport = self.pass.viewport.map_or(whole.clone(), |v| {
            format!("{} x {} from {},{}, depths {} to {}", v.width, v.height, v.x, v.y, v.min_depth, v.max_depth)
        });
        let scissor = self.pass.scissor.map_or(whole, |r| format!("{} x {} from {},{}", r.width, r.height, r.x, r.y));
        lines.extend([("viewport".to_owned(), viewport), ("scissor".to_owned(), scissor)]);
        if primitive.unclipped_depth {
            lines.push(("depths".to_owned(), "clamped, not clipped".to_owned()));
        }
        let samples = &desc.multisample;
        let mut text = samples.count.to_string();
        if samples.mask != u32::MAX {
            text.push_str(&format!(", mask {:#x}", samples.mask));
        }
        if samples.alpha_to_coverage {
            text.push_str(", alpha to coverage");
        }
        lines.push(("samples".to_owned(), text));
        lines
    }

    fn targets(&self, desc: &RenderPipelineDesc) -> Vec<(String, String)> {
        let mut lines = Vec::new();
        if !self.pass.label.is_empty() {
            lines.push(("pass".to_owned(), self.pass.label.clone()));
        }
        for (location, attachment) in self.pass.color.iter().enumerate() {
            let Some(attachment) = attachment else { continue };
            let mut text = self.view(attachment.view);
            match desc.targets.get(location).and_then(Option::as_ref) {
                None => text.push_str("; the pipeline writes nothing to it"),
                Some(target) => {
                    let mask: String =
                        "rgba".chars().zip(0..).filter(|(_, bit)| target.write_mask >> bit & 1 != 0).map(|(c, _)| c).collect();
                    let mask = if mask.is_empty() { "nothing".to_owned() } else { mask };
                    text.push_str(&format!("; {}; writes {mask}", target_text(target, self.pass.blend)));
                }
            }
            if let Some(resolve) = attachment.resolve {
                text.push_str(&format!("; resolved to {}", self.view(resolve)));
            }
            lines.push((format!("colour {location}"), text));
        }
        if let Some(depth) = &self.pass.depth {
            lines.push(("depth and stencil".to_owned(), self.view(depth.view)));
        }
        lines
    }

    fn bindings(&self) -> Vec<(String, String)> {
        let mut lines = Vec::new();
        for (&index, (group, offsets)) in &self.bound.groups {
            for entry in self.groups.get(group).into_iter().flatten() {
                lines.push((format!("group {index} binding {}", entry.binding), self.resource(&entry.resource)));
            }
            if !offsets.is_empty() {
                let offsets: Vec<String> = offsets.iter().map(u32::to_string).collect();
                lines.push((format!("group {index} offsets"), offsets.join(", ")));
            }
        }
        lines
    }

    fn resource(&self, resource: &BoundResource) -> String {
        let range = |buffer: BufferId, offset: u64, size: Option<u64>| {
            let size = size.map_or("to its end".to_owned(), |size| bytes(size as f64));
            format!("{} from byte {offset}, {size}", self.buffer(buffer))
        };
        let many = |texts: Vec<String>| format!("{} of: {}", texts.len(), texts.join("; "));
        match resource {
            BoundResource::Buffer { buffer, offset, size } => range(*buffer, *offset, *size),
            BoundResource::View(view) => self.view(*view),
            BoundResource::Sampler(sampler) => self.sampler(*sampler),
            BoundResource::Buffers(buffers) => {
                many(buffers.iter().map(|&(buffer, offset, size)| range(buffer, offset, size)).collect())
            }
            BoundResource::Views(views) => many(views.iter().map(|&view| self.view(view)).collect()),
            BoundResource::Samplers(samplers) => many(samplers.iter().map(|&sampler| self.sampler(sampler)).collect()),
        }
    }

    fn sampler(&self, id: SamplerId) -> String {
        let Some(desc) = self.samplers.get(&id) else { return format!("sampler {}", id.0) };
        let [u, v, w] = desc.address.map(|mode| words(&mode));
        let address = if u == v && v == w { u } else { format!("{u}, {v}, {w}") };
        let mut text = format!(
            "sampler {}: magnified {}, minified {}, between levels {}, {address}",
            id.0,
            words(&desc.mag),
            words(&desc.min),
            words(&desc.mipmap)
        );
        if desc.anisotropy > 1 {
            text.push_str(&format!(", anisotropy {}", desc.anisotropy));
        }
        if let Some(compare) = desc.compare {
            text.push_str(&format!(", compares {}", words(&compare)));
        }
        text
    }
}

/// A label in quotes with a space before it, to stand behind a number. An empty label gives an empty text.
fn quoted(label: &str) -> String {
    if label.is_empty() { String::new() } else { format!(" {label:?}") }
}

fn shader_name(source: &ShaderSource, label: &Option<String>) -> String {
    let (file, kind) = match source {
        ShaderSource::Wgsl(file) => (file, "WGSL"),
        ShaderSource::SpirV(file) => (file, "SPIR-V"),
        ShaderSource::NagaIr(file) => (file, "naga's form"),
    };
    format!("{file} ({kind}){}", quoted(&label_of(label)))
}

/// The name of a value of WebGPU's as words: `TriangleList` is "triangle list".
fn words(value: &impl std::fmt::Debug) -> String {
    let mut text = String::new();
    for c in format!("{value:?}").chars() {
        if c.is_ascii_uppercase() && !text.is_empty() {
            text.push(' ');
        }
        text.push(c.to_ascii_lowercase());
    }
    text
}

fn winding(face: FrontFace) -> &'static str {
    match face {
        FrontFace::Ccw => "counter-clockwise",
        FrontFace::Cw => "clockwise",
    }
}

fn depth_lines(state: &DepthStencil, references: [u32; 2]) -> Vec<(String, String)> {
    let mut lines = Vec::new();
    if state.format.has_depth() {
        let write = if state.depth_write { "written" } else { "not written" };
        let mut text = format!("passes: {}; {write} ({})", compared(state.depth_compare), state.format.name());
        if state.bias != 0.0 || state.bias_slope != 0.0 {
            text.push_str(&format!(", bias {} and {} times the slope", state.bias, state.bias_slope));
        }
        lines.push(("depth".to_owned(), text));
    }
    if state.format.has_stencil() {
        let idle = [state.stencil_front, state.stencil_back] == [StencilFace::default(); 2];
        if idle {
            lines.push(("stencil".to_owned(), "not tested".to_owned()));
        } else {
            let faces = [("stencil, front", state.stencil_front), ("stencil, back", state.stencil_back)];
            for ((name, face), (reference, masks)) in faces.into_iter().zip(references.into_iter().zip(state.stencil_masks())) {
                let [fail, depth_fail, pass] = [face.fail_op, face.depth_fail_op, face.pass_op].map(|op| words(&op));
                let (compare, read, write) = (compared(face.compare), masks.read & 0xff, masks.write & 0xff);
                lines.push((
                    name.to_owned(),
                    format!(
                        "reference {reference} passes: {compare}; if it fails {fail}, if depth fails {depth_fail}, if both pass {pass}; \
                         reads bits {read:#04x}, writes {write:#04x}"
                    ),
                ));
            }
        }
    }
    lines
}

/// When a comparison passes: of the new value, or of the reference.
fn compared(compare: Compare) -> &'static str {
    match compare {
        Compare::Never => "never",
        Compare::Less => "less than the stored one",
        Compare::Equal => "equal to the stored one",
        Compare::LessEqual => "less than or equal to the stored one",
        Compare::Greater => "greater than the stored one",
        Compare::NotEqual => "not equal to the stored one",
        Compare::GreaterEqual => "greater than or equal to the stored one",
        Compare::Always => "always",
    }
}

/// How a target takes a colour.
fn target_text(target: &ColorTarget, constant: Option<[f64; 4]>) -> String {
    if let Some(logic) = target.logic {
        return format!("logic operation {}", words(&logic));
    }
    let Some(blend) = target.blend else { return "replaces".to_owned() };
    let component = |of: &BlendComponent| match of.op {
        BlendOp::Min | BlendOp::Max => words(&of.op),
        _ => format!("{} of source times {} and target times {}", words(&of.op), words(&of.src), words(&of.dst)),
    };
    let (color, alpha) = (component(&blend.color), component(&blend.alpha));
    let text = if color == alpha { format!("blends: {color}") } else { format!("blends colours: {color}; alpha: {alpha}") };
    let named = |of: &BlendComponent| {
        [of.src, of.dst].iter().any(|f| matches!(f, BlendFactor::Constant | BlendFactor::OneMinusConstant))
    };
    match constant {
        Some([r, g, b, a]) if named(&blend.color) || named(&blend.alpha) => format!("{text}; constant {r} {g} {b} {a}"),
        _ => text,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gfx::format::Format;
    use crate::gfx::state::{Blend, CullMode, Primitive, Topology, VertexFormat};
    use crate::trace::record::{self, Recorder};

    fn value<'s>(state: &'s DrawState, title: &str, name: &str) -> &'s str {
        let lines = state.parts.iter().find(|(known, _)| *known == title).map(|(_, lines)| lines);
        let line = lines.and_then(|lines| lines.iter().find(|(known, _)| known == name));
        line.map_or_else(|| panic!("{title}, {name}: {state:#?}"), |(_, value)| value)
    }

    /// Four draws: one in a pass, one in a bundle, and two whose arguments are in a buffer.
    fn trace(count_buffer: bool) -> Trace {
        let mut card = Recorder::new("state");
        let target = card.create_texture("canvas", record::texture_2d(64, 32, Format::Rgba8Unorm));
        let view = card.create_view(target);
        let image = card.create_texture("", record::texture_mipped(16, 16, 5, Format::Rgba8UnormSrgb));
        let image_view = card.create_view(image);
        let (vertices, arguments) = (card.create_buffer("vertices", 4096), card.create_buffer("arguments", 64));
        let shader = card.create_shader("lit", "@vertex fn vs() -> @builtin(position) vec4f { return vec4f(); }");
        let over = BlendComponent { op: BlendOp::Add, src: BlendFactor::SrcAlpha, dst: BlendFactor::OneMinusSrcAlpha };
        let pipeline = card.create_render_pipeline(
            "lit",
            RenderPipelineDesc {
                buffers: vec![record::vertex_buffer(&[(0, VertexFormat::Float32x3), (1, VertexFormat::Float32x2)])],
                primitive: Primitive { topology: Topology::TriangleStrip, cull_mode: CullMode::Back, ..Primitive::default() },
                targets: vec![Some(ColorTarget {
                    format: Format::Rgba8Unorm,
                    blend: Some(Blend { color: over, alpha: over }),
                    logic: None,
                    write_mask: 7,
                })],
                ..record::render_pipeline(shader, Format::Rgba8Unorm)
            },
        );
        let layout = card.create_bind_group_layout([(0, record::TEXTURE)]);
        let group = card.create_bind_group(layout, [(0, BoundResource::View(image_view))]);
        let bundle = {
            let mut bundle = card.begin_bundle();
            bundle.set_pipeline(pipeline);
            bundle.draw(6, 2);
            bundle.id()
        };
        card.set_call_site(CallSite::Call(77));
        {
            let mut pass = card.begin_render_pass([record::clear(view, [0.0; 4])], None);
            pass.set_pipeline(pipeline);
            pass.set_bind_group(0, group);
            pass.set_vertex_buffer(0, vertices);
            pass.push(Command::SetScissor(Rect { x: 1, y: 2, width: 3, height: 4 }));
            pass.draw(3, 1);
            pass.push(Command::ExecuteBundles(vec![bundle]));
            pass.set_pipeline(pipeline);
            let count_buffer = count_buffer.then_some((arguments, 60));
            pass.push(Command::DrawIndirect { buffer: arguments, offset: 16, indexed: false, count: 2, count_buffer });
        }
        card.finish()
    }

    #[test]
    fn a_draw_has_the_state_that_was_set_before_it() {
        let found = states(&trace(false), &(0..9).collect()).unwrap_or_else(|error| panic!("{error}"));
        assert_eq!(found.keys().copied().collect::<Vec<_>>(), [0, 1, 2, 3]);
        let first = &found[&0];
        assert_eq!(first.site, CallSite::Call(77));
        for (title, name, wanted) in [
            ("Vertices", "draws", "3 vertices from 0; 1 instances from 0"),
            ("Vertices", "topology", "triangle strip"),
            (
                "Vertices",
                "vertex buffer 0",
                "20 bytes per vertex: location 0 float32x3 at 0, location 1 float32x2 at 12; buffer 0 \"vertices\" of 4.00 KiB from byte 0",
            ),
            ("Rasteriser", "culls", "back; front faces are counter-clockwise"),
            ("Rasteriser", "scissor", "3 x 4 from 1,2"),
            ("Rasteriser", "samples", "1"),
            (
                "Targets",
                "colour 0",
                "texture 0 \"canvas\": rgba8unorm, 64 x 32; blends: add of source times src alpha and target times one minus src alpha; writes rgb",
            ),
            ("Bindings", "group 0 binding 0", "texture 1: rgba8unorm-srgb, 16 x 16, 5 levels"),
        ] {
            assert_eq!(value(first, title, name), wanted);
        }
        // A bundle sees nothing of what the pass has bound, and keeps its scissor.
        assert!(found[&1].parts.iter().all(|(title, _)| *title != "Bindings"), "{:?}", found[&1]);
        assert_eq!(value(&found[&1], "Rasteriser", "scissor"), "3 x 4 from 1,2");
        assert!(value(&found[&3], "Vertices", "draws").starts_with("draw 1 of 2, by arguments in buffer 1"));
    }

    #[test]
    fn numbers_that_only_the_card_knows_are_no_numbers() {
        let first = states(&trace(true), &BTreeSet::from([1])).unwrap_or_else(|error| panic!("{error}"));
        assert_eq!(first.len(), 1);
        let error = states(&trace(true), &BTreeSet::from([2])).unwrap_err().to_string();
        assert!(error.contains("DrawIndirect: how many draws these are is in a buffer"), "{error}");
    }
}
