//! Rules of the beginning and end of passes and bundles.

use gfx::state::ViewDimension;

use super::bind::GroupLayout;
use super::pipeline::{Compute, Render};
use super::resource::View;
use super::*;

/// Layouts of the bound groups; inner none: a derived layout.
pub type Groups = [Option<GroupLayout>; BIND_GROUPS_MAX as usize];

/// The pass or bundle that is open.
pub enum Scope {
    Outside,
    Render(Box<RenderScope>),
    Compute(Box<ComputeScope>),
    Bundle(Box<BundleScope>),
}

/// A render pass.
pub struct RenderScope {
    pub attachments: Attachments,
    pub draw: DrawState,
    pub occlusion: Option<QuerySetId>,
    pub occlusion_open: bool,
    pub statistics_open: bool,
}

/// A compute pass.
#[derive(Default)]
pub struct ComputeScope {
    pub pipeline: Option<Compute>,
    pub groups: Groups,
    pub statistics_open: bool,
}

/// A bundle.
pub struct BundleScope {
    pub id: BundleId,
    pub draw: DrawState,
    pub bundle: Bundle,
}

/// What executing a bundle needs to know of it.
#[derive(Clone, Default)]
pub struct Bundle {
    /// Each pipeline once.
    pub pipelines: Vec<(RenderPipelineId, Render)>,
    pub draws: u64,
    pub vertices: u64,
}

/// What a pass renders to.
#[derive(Default)]
pub struct Attachments {
    /// Formats of the colour attachments, without trailing empty ones.
    pub colors: Vec<Option<Format>>,
    pub depth: Option<Format>,
    pub depth_read_only: bool,
    pub stencil_read_only: bool,
    pub samples: u32,
    pub size: [u32; 2],
    /// Texture, level and layer or slice of each.
    used: Vec<(TextureId, u32, u32)>,
}

/// What draws use.
#[derive(Default)]
pub struct DrawState {
    pub pipeline: Option<Render>,
    pub groups: Groups,
    /// Bytes that are bound to each slot.
    pub vertex: [Option<u64>; VERTEX_BUFFERS_MAX as usize],
    /// Indices that are bound.
    pub indices: Option<u64>,
}

impl Scope {
    pub fn name(&self) -> Option<&'static str> {
        match self {
            Scope::Outside => None,
            Scope::Render(_) => Some("render pass"),
            Scope::Compute(_) => Some("compute pass"),
            Scope::Bundle(_) => Some("bundle"),
        }
    }
}

impl Attachments {
    /// Adds an attachment; all have the same size and number of samples.
    fn add(&mut self, what: &str, view: &View, depth_slice: Option<u32>) -> CheckResult {
        let flat = view.levels == 1
            && match view.dimension {
                ViewDimension::D3 => depth_slice.is_some_and(|slice| slice < view.size[2]),
                ViewDimension::D2 | ViewDimension::D2Array => view.layers == 1 && depth_slice.is_none(),
                _ => false,
            };
        ensure!(flat, "{what} is not one level of one 2D layer or slice");
        let place = (view.texture, view.base_level, depth_slice.unwrap_or(view.base_layer));
        ensure!(!self.used.contains(&place), "{what} is an attachment already");
        self.used.push(place);
        let size = [view.size[0], view.size[1]];
        if self.samples == 0 {
            self.samples = view.samples;
            self.size = size;
        }
        let (mine, all) = (view.samples, self.samples);
        ensure!(mine == all, "{what} has {mine} samples, other attachments {all}");
        let ([width, height], [all_width, all_height]) = (size, self.size);
        ensure!(size == self.size, "{what} is {width}x{height}, other attachments {all_width}x{all_height}");
        Ok(())
    }
}

/// Checks that a pipeline fits the attachments of a pass.
#[inline]
pub fn pipeline_fits(pipeline: &Render, pass: &Attachments) -> CheckResult {
    let list = |formats: &[Option<Format>]| {
        let names: Vec<&str> = formats.iter().map(|format| format.map_or("none", |format| format.name())).collect();
        format!("[{}]", names.join(", "))
    };
    let (targets, colors) = (&pipeline.targets, &pass.colors);
    ensure!(targets == colors, "the pipeline's colour targets are {}, the pass has {}", list(targets), list(colors));
    let name = |format: Option<Format>| format.map_or("none", |format| format.name());
    let (mine, all) = (name(pipeline.depth), name(pass.depth));
    ensure!(mine == all, "the pipeline's depth and stencil format is {mine}, the pass has {all}");
    let (mine, all) = (pipeline.samples, pass.samples);
    ensure!(mine == all, "the pipeline has {mine} samples, the pass {all}");
    ensure!(!(pipeline.writes_depth && pass.depth_read_only), "the pipeline writes depth, which is read-only in the pass");
    ensure!(
        !(pipeline.writes_stencil && pass.stencil_read_only),
        "the pipeline writes stencil, which is read-only in the pass"
    );
    Ok(())
}

impl Checker<'_> {
    fn begin(&mut self, scope: Scope) -> CheckResult {
        if let Some(open) = self.scope.name() {
            return Err(format!("not allowed inside a {open}").into());
        }
        self.scope = scope;
        Ok(())
    }

    fn timestamps(&self, timestamps: Option<&PassTimestamps>) -> CheckResult {
        let Some(stamps) = timestamps else { return Ok(()) };
        stamps
            .begin
            .into_iter()
            .chain(stamps.end)
            .try_for_each(|index| self.query(stamps.set, index, |kind| kind == QueryKind::Timestamp))
    }

    pub(super) fn begin_render_pass(
        &mut self,
        color: &[Option<ColorAttachment>],
        depth: Option<&DepthAttachment>,
        occlusion: Option<QuerySetId>,
        timestamps: Option<&PassTimestamps>,
    ) -> CheckResult {
        ensure!(color.len() <= COLOR_TARGETS_MAX, "{} colour attachments, at most {COLOR_TARGETS_MAX}", color.len());
        let mut pass = Attachments::default();
        for (index, attachment) in color.iter().enumerate() {
            let Some(attachment) = attachment else {
                pass.colors.push(None);
                continue;
            };
            let what = format!("colour attachment {index}");
            let view = self.views.get(attachment.view.0)?;
            let name = view.format.name();
            ensure!(resource::renderable(view.format), "{what}: {name} cannot be rendered to");
            pass.add(&what, view, attachment.depth_slice)?;
            pass.colors.push(Some(view.format));
            if let Some(resolve) = attachment.resolve {
                let to = self.views.get(resolve.0)?;
                ensure!(view.samples > 1, "{what} is resolved, but has one sample per pixel");
                ensure!(to.samples == 1, "{what} is resolved to a multisampled texture");
                ensure!(to.format == view.format, "{what} of {name} is resolved to {}", to.format.name());
                let flat = to.levels == 1 && to.layers == 1 && to.dimension != ViewDimension::D3;
                ensure!(flat, "{what} is resolved to more than one 2D layer");
                ensure!(to.size[..2] == view.size[..2], "{what} is resolved to another size");
            }
        }
        while let Some(None) = pass.colors.last() {
            pass.colors.pop();
        }
        if let Some(depth) = depth {
            let view = self.views.get(depth.view.0)?;
            let name = view.format.name();
            ensure!(view.format.is_depth_stencil(), "the depth attachment has format {name}");
            pass.add("the depth attachment", view, None)?;
            pass.depth = Some(view.format);
            pass.depth_read_only = depth.depth_read_only;
            pass.stencil_read_only = depth.stencil_read_only;
            if let Some(clear) = depth.depth_clear {
                ensure!((0.0..=1.0).contains(&clear), "depth is cleared to {clear}, it must be 0 to 1");
                ensure!(view.format.has_depth(), "depth of {name} is cleared");
                ensure!(!depth.depth_read_only, "read-only depth is cleared");
            }
            if depth.stencil_clear.is_some() {
                ensure!(view.format.has_stencil(), "stencil of {name} is cleared");
                ensure!(!depth.stencil_read_only, "read-only stencil is cleared");
            }
        }
        ensure!(pass.samples > 0, "the pass has no attachment");
        if let Some(set) = occlusion {
            let (kind, _) = *self.query_sets.get(set.0)?;
            ensure!(kind == QueryKind::Occlusion, "{set} counts {kind:?}");
        }
        self.timestamps(timestamps)?;
        self.summary.render_passes += 1;
        self.begin(Scope::Render(Box::new(RenderScope {
            attachments: pass,
            draw: DrawState::default(),
            occlusion,
            occlusion_open: false,
            statistics_open: false,
        })))
    }

    pub(super) fn begin_compute_pass(&mut self, timestamps: Option<&PassTimestamps>) -> CheckResult {
        self.timestamps(timestamps)?;
        self.summary.compute_passes += 1;
        self.begin(Scope::Compute(Box::default()))
    }

    pub(super) fn begin_bundle(&mut self, id: BundleId) -> CheckResult {
        self.begin(Scope::Bundle(Box::new(BundleScope { id, draw: DrawState::default(), bundle: Bundle::default() })))
    }

    pub(super) fn end_render_pass(&mut self) -> CheckResult {
        match &self.scope {
            Scope::Render(pass) => {
                ensure!(!pass.occlusion_open && !pass.statistics_open, "a query is still open");
                self.scope = Scope::Outside;
                Ok(())
            }
            _ => Err("no render pass is open".into()),
        }
    }

    pub(super) fn end_compute_pass(&mut self) -> CheckResult {
        match &self.scope {
            Scope::Compute(pass) => {
                ensure!(!pass.statistics_open, "a query is still open");
                self.scope = Scope::Outside;
                Ok(())
            }
            _ => Err("no compute pass is open".into()),
        }
    }

    pub(super) fn end_bundle(&mut self) -> CheckResult {
        match std::mem::replace(&mut self.scope, Scope::Outside) {
            Scope::Bundle(open) => Ok(self.bundles.create(open.id.0, open.bundle)?),
            _ => Err("no bundle is open".into()),
        }
    }
}
