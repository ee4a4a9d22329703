//! Rules of commands inside passes and bundles: state, draws, dispatches, queries.

use gfx::state::{StepMode, Viewport};

use super::bind::groups_fit;
use super::pass::{ComputeScope, DrawState, RenderScope, pipeline_fits};
use super::*;

/// How far a viewport may reach in any direction, in pixels.
const VIEWPORT_REACH: f32 = 65_536.0;

impl Checker<'_> {
    #[inline]
    pub(super) fn inside_pass(&mut self, command: &Command) -> CheckResult {
        // The scope is taken out while it is checked against the tables beside it.
        let mut scope = std::mem::replace(&mut self.scope, Scope::Outside);
        let outcome = match &mut scope {
            Scope::Outside => Err("only allowed inside a pass".into()),
            Scope::Render(pass) => self.inside_render_pass(pass, command),
            Scope::Compute(pass) => self.inside_compute_pass(pass, command),
            Scope::Bundle(open) => {
                if let Command::SetRenderPipeline(id) = command {
                    let pipeline = self.render_pipelines.get(id.0)?;
                    if open.bundle.pipelines.iter().all(|(known, _)| known != id) {
                        open.bundle.pipelines.push((*id, pipeline.clone()));
                    }
                }
                self.drawing(&mut open.draw, command).map(|vertices| {
                    open.bundle.draws += u64::from(vertices.is_some());
                    open.bundle.vertices = open.bundle.vertices.saturating_add(vertices.unwrap_or(0));
                })
            }
        };
        self.scope = scope;
        outcome
    }

    #[inline]
    fn inside_render_pass(&mut self, pass: &mut RenderScope, command: &Command) -> CheckResult {
        match command {
            Command::SetRenderPipeline(id) => pipeline_fits(self.render_pipelines.get(id.0)?, &pass.attachments)?,
            Command::SetViewport(viewport) => return check_viewport(viewport),
            Command::SetScissor(rect) => {
                let [width, height] = pass.attachments.size;
                let inside = |start: u32, length: u32, all: u32| start.checked_add(length).is_some_and(|end| end <= all);
                let fits = inside(rect.x, rect.width, width) && inside(rect.y, rect.height, height);
                ensure!(fits, "{rect:?} reaches out of the {width}x{height} target");
                return Ok(());
            }
            Command::SetBlendConstant(color) => {
                ensure!(color.iter().all(|value| value.is_finite()), "the blend constant is {color:?}");
                return Ok(());
            }
            Command::SetStencilReference(_) | Command::SetStencilReferences { .. } => return Ok(()),
            Command::BeginOcclusionQuery { index } => {
                let set = pass.occlusion.ok_or("the pass has no occlusion query set")?;
                ensure!(!pass.occlusion_open, "an occlusion query is open already");
                self.query(set, *index, |kind| kind == QueryKind::Occlusion)?;
                pass.occlusion_open = true;
                return Ok(());
            }
            Command::EndOcclusionQuery => {
                ensure!(std::mem::take(&mut pass.occlusion_open), "no occlusion query is open");
                return Ok(());
            }
            Command::BeginStatisticsQuery { set, index } => {
                return self.begin_statistics(&mut pass.statistics_open, *set, *index);
            }
            Command::EndStatisticsQuery => return end_statistics(&mut pass.statistics_open),
            Command::ExecuteBundles(bundles) => {
                for id in bundles {
                    let bundle = self.bundles.get(id.0)?;
                    for (_, pipeline) in &bundle.pipelines {
                        pipeline_fits(pipeline, &pass.attachments)?;
                    }
                    self.summary.draws += bundle.draws;
                    self.summary.vertices = self.summary.vertices.saturating_add(bundle.vertices);
                }
                // A bundle leaves no state behind, also not what was set before it.
                pass.draw = DrawState::default();
                return Ok(());
            }
            _ => {}
        }
        if let Some(vertices) = self.drawing(&mut pass.draw, command)? {
            self.summary.draws += 1;
            self.summary.vertices = self.summary.vertices.saturating_add(vertices);
        }
        Ok(())
    }

    fn inside_compute_pass(&mut self, pass: &mut ComputeScope, command: &Command) -> CheckResult {
        match command {
            Command::SetComputePipeline(id) => pass.pipeline = Some(self.compute_pipelines.get(id.0)?.clone()),
            Command::SetBindGroup { index, group, offsets } => {
                let bound = self.bound_group(*index, *group, offsets)?;
                pass.groups[*index as usize] = bound;
            }
            Command::SetImmediates { offset, words } => immediates(*offset, words)?,
            Command::Dispatch { groups } => {
                self.dispatch(pass)?;
                let small = groups.iter().all(|&count| count <= WORKGROUPS_MAX);
                ensure!(small, "{groups:?} workgroups, at most {WORKGROUPS_MAX} in each dimension");
            }
            Command::DispatchIndirect { buffer, offset } => {
                self.dispatch(pass)?;
                range_fits(buffer, *offset, 12, *self.buffers.get(buffer.0)?)?;
            }
            Command::BeginStatisticsQuery { set, index } => self.begin_statistics(&mut pass.statistics_open, *set, *index)?,
            Command::EndStatisticsQuery => end_statistics(&mut pass.statistics_open)?,
            _ => return Err("not allowed inside a compute pass".into()),
        }
        Ok(())
    }

    fn dispatch(&mut self, pass: &ComputeScope) -> CheckResult {
        let pipeline = pass.pipeline.as_ref().ok_or("no compute pipeline is set")?;
        groups_fit(&pipeline.layout, &pass.groups)?;
        self.summary.dispatches += 1;
        Ok(())
    }

    fn begin_statistics(&self, open: &mut bool, set: QuerySetId, index: u32) -> CheckResult {
        ensure!(!*open, "a statistics query is open already");
        self.query(set, index, |kind| matches!(kind, QueryKind::PipelineStatistics(_)))?;
        *open = true;
        Ok(())
    }

    /// Checks a command of a render pass or bundle; answers the vertices of a draw, as far as they are known.
    #[inline]
    fn drawing(&self, draw: &mut DrawState, command: &Command) -> Result<Option<u64>, Reason> {
        match command {
            Command::SetRenderPipeline(id) => draw.pipeline = Some(self.render_pipelines.get(id.0)?.clone()),
            Command::SetBindGroup { index, group, offsets } => {
                let bound = self.bound_group(*index, *group, offsets)?;
                draw.groups[*index as usize] = bound;
            }
            Command::SetImmediates { offset, words } => immediates(*offset, words)?,
            Command::SetIndexBuffer { buffer, format, offset, size } => {
                let bytes = open_range(buffer, *offset, *size, *self.buffers.get(buffer.0)?)?;
                let aligned = offset.is_multiple_of(u64::from(format.bytes()));
                ensure!(aligned, "offset {offset} is no multiple of the {} bytes of an index", format.bytes());
                draw.indices = Some(bytes / u64::from(format.bytes()));
            }
            Command::SetVertexBuffer { slot, buffer, offset, size } => {
                ensure!(*slot < VERTEX_BUFFERS_MAX, "slot {slot}, there are {VERTEX_BUFFERS_MAX}");
                draw.vertex[*slot as usize] = match buffer {
                    Some(buffer) => Some(open_range(buffer, *offset, *size, *self.buffers.get(buffer.0)?)?),
                    None => None,
                };
            }
            command => {
                let draws = command.draws().ok_or("not allowed here")?;
                ready(draw)?;
                return self.draws(draw, &draws).map(|()| Some(draws.vertices().unwrap_or(0)));
            }
        }
        Ok(None)
    }

    #[inline]
    fn draws(&self, draw: &DrawState, draws: &Draws) -> CheckResult {
        let bound = if draws.indexed() { draw.indices.ok_or("no index buffer is set")? } else { 0 };
        match *draws {
            Draws::Direct { indexed, range: DrawRange { first, count, first_instance, instances, .. } } => {
                if indexed {
                    let end = u64::from(first) + u64::from(count);
                    let fits = count == 0 || end <= bound;
                    ensure!(fits, "indices {first} + {count} reach past the {bound} of the index buffer");
                } else {
                    vertex_ranges(draw, StepMode::Vertex, first, count)?;
                }
                vertex_ranges(draw, StepMode::Instance, first_instance, instances)?;
            }
            Draws::Indirect { buffer, offset, indexed, count, count_buffer } => {
                let bytes = u64::from(count) * if indexed { 20 } else { 16 };
                range_fits(&buffer, offset, bytes, *self.buffers.get(buffer.0)?)?;
                if let Some((counts, at)) = count_buffer {
                    range_fits(&counts, at, 4, *self.buffers.get(counts.0)?)?;
                }
            }
        }
        Ok(())
    }
}

/// Checks that a pipeline is set and has the groups and buffers that it asks for.
#[inline]
fn ready(draw: &DrawState) -> CheckResult {
    let pipeline = draw.pipeline.as_ref().ok_or("no render pipeline is set")?;
    for (slot, layout) in pipeline.buffers.iter().enumerate() {
        ensure!(layout.is_none() || draw.vertex[slot].is_some(), "vertex buffer {slot} is not set");
    }
    groups_fit(&pipeline.layout, &draw.groups)
}

/// Checks that the vertices or instances `first` + `count` are in the buffers that advance with them.
#[inline]
fn vertex_ranges(draw: &DrawState, step: StepMode, first: u32, count: u32) -> CheckResult {
    let Some(pipeline) = draw.pipeline.as_ref().filter(|_| count > 0) else { return Ok(()) };
    for (slot, layout) in pipeline.buffers.iter().enumerate() {
        let (Some(layout), Some(bytes)) = (layout, draw.vertex[slot]) else { continue };
        // Numbers are below 2^33 and strides below 2^17: no overflow.
        let last = u64::from(first) + u64::from(count) - 1;
        let needed = last * layout.stride + layout.extent;
        if layout.step == step && needed > bytes {
            let what = if step == StepMode::Vertex { "vertices" } else { "instances" };
            let reason = format!("{what} {first} + {count} need {needed} bytes, vertex buffer {slot} has {bytes}");
            return Err(reason.into());
        }
    }
    Ok(())
}

fn immediates(offset: u32, words: &[u32]) -> CheckResult {
    let end = u64::from(offset) + 4 * words.len() as u64;
    let fits = offset.is_multiple_of(4) && end <= u64::from(IMMEDIATES_MAX);
    ensure!(fits, "bytes {offset} + {} are no words of the {IMMEDIATES_MAX} bytes of immediates", 4 * words.len());
    Ok(())
}

fn check_viewport(viewport: &Viewport) -> CheckResult {
    let Viewport { x, y, width, height, min_depth, max_depth } = *viewport;
    let near = [x, y, x + width, y + height].iter().all(|edge| edge.abs() <= VIEWPORT_REACH);
    ensure!(near && width >= 0.0 && height >= 0.0, "a viewport at {x}, {y} of {width} x {height}");
    let depths = [min_depth, max_depth].iter().all(|depth| (0.0..=1.0).contains(depth));
    ensure!(depths, "a depth range of {min_depth} to {max_depth}, both must be 0 to 1");
    Ok(())
}

fn end_statistics(open: &mut bool) -> CheckResult {
    ensure!(std::mem::take(open), "no statistics query is open");
    Ok(())
}
