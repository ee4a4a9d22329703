//! Native passes. Commands of a pass wait until it ends, so that what they need can be made before it begins.

use gfx::format::Format;
use gfx::state::{IndexFormat, Rect, Viewport};
use num::*;
use trace::command::*;

use super::args::Args;
use super::fault::{Fault, Outcome, unsupported};
use super::machine::Vulkan;
use super::objects::{Framebuffer, Handle, RenderPass, known};
use super::pipelines::PassFormats;
use super::state::Area;

/// A target of a pass.
#[derive(Clone, Debug, Default)]
pub struct Target {
    /// The view.
    pub view: Handle,
    /// The value that it is cleared to, as the bits of its channels.
    pub clear: Option<[u32; 4]>,
    /// Stencil is cleared as well, to the second of these.
    pub stencil_clear: Option<u32>,
    /// Whether the contents are kept.
    pub store: bool,
    /// Whether stencil is kept.
    pub stencil_store: bool,
    /// The view that samples are resolved to.
    pub resolve: Option<Handle>,
}

/// What a pass draws to.
#[derive(Clone, Debug, Default)]
pub struct Targets {
    /// Colour.
    pub color: Vec<Option<Target>>,
    /// Depth and stencil.
    pub depth: Option<Target>,
    /// The part that is drawn to.
    pub area: Area,
    /// A bit for each view; 0: no views.
    pub views: u32,
}

/// The state that commands of the native pass have set.
#[derive(Default)]
pub struct Emitted {
    pub pipeline: Option<RenderPipelineId>,
    pub groups: [Option<BindGroupId>; 8],
    pub vertex: Vec<Option<(BufferId, u64, u64)>>,
    pub index: Option<(BufferId, u64, u64, IndexFormat)>,
    pub viewport: Option<Viewport>,
    pub scissor: Option<Rect>,
    pub blend: Option<[f64; 4]>,
    pub stencil: Option<[u32; 2]>,
    pub immediates: Vec<u32>,
}

/// A pass that is open.
pub struct OpenPass {
    /// Its targets.
    color: Vec<Option<ColorAttachment>>,
    depth: Option<DepthAttachment>,
    /// Formats and samples.
    pub formats: PassFormats,
    /// Width and height of the targets.
    pub size: [u32; 2],
    /// The part that is drawn to.
    pub area: Area,
    /// Occlusion queries go here.
    pub occlusion: Option<QuerySetId>,
    /// Commands that wait.
    pub commands: Vec<Command>,
    /// What they have set.
    pub emitted: Emitted,
    /// The call that begins the pass.
    pub site: Option<CallSite>,
}

/// What is open.
#[derive(Default)]
pub enum Open {
    /// Nothing.
    #[default]
    Nothing,
    /// A render pass.
    Render(Box<OpenPass>),
    /// A compute pass: its commands, and what they have set.
    Compute(Vec<Command>, Box<ComputeEmitted>),
}

/// The state that commands of a native compute pass have set.
#[derive(Default)]
pub struct ComputeEmitted {
    pub pipeline: Option<ComputePipelineId>,
    pub groups: [Option<BindGroupId>; 8],
    pub immediates: Vec<u32>,
}

/// The channels of a clear value of a format.
pub fn clear_color(bits: [u32; 4], format: Format) -> [f64; 4] {
    use gfx::format::TexelKind::*;
    bits.map(|bits| match format.kind() {
        Uint => bits.into(),
        Sint => (bits as i32).into(),
        Float | Depth => f32::from_bits(bits).into(),
    })
}

fn four(words: &[u32]) -> [u32; 4] {
    std::array::from_fn(|at| words.get(at).copied().unwrap_or(0))
}

impl OpenPass {
    /// A pass of one target that is drawn to without the program's doing.
    pub fn of(
        formats: PassFormats,
        size: [u32; 2],
        color: Option<ColorAttachment>,
        depth: Option<DepthAttachment>,
    ) -> OpenPass {
        let area = Area { x: 0, y: 0, width: size[0], height: size[1] };
        let (color, emitted) = (color.into_iter().map(Some).collect(), Emitted::default());
        OpenPass { color, depth, formats, size, area, occlusion: None, commands: Vec::new(), emitted, site: None }
    }
}

impl Vulkan {
    /// Begins a native pass; nothing may be open.
    pub fn open_pass(&mut self, targets: &Targets, view: Option<u32>) -> Outcome<OpenPass> {
        let layer = view.unwrap_or(0);
        let mut pass = OpenPass {
            color: Vec::new(),
            depth: None,
            formats: PassFormats { samples: 1, view, ..PassFormats::default() },
            size: [0; 2],
            area: targets.area,
            occlusion: None,
            commands: Vec::new(),
            emitted: Emitted::default(),
            site: self.card.call_site(),
        };
        let mut first = true;
        let mut clears = Vec::new();
        let all = targets.color.iter().map(|target| (target, true)).chain([(&targets.depth, false)]);
        for (number, (target, is_color)) in all.enumerate() {
            let Some(target) = target else {
                if is_color {
                    pass.color.push(None);
                    pass.formats.color.push(None);
                }
                continue;
            };
            let owner = known(self.objects.views.get(target.view), "image view", target.view)?;
            let (image, level) = (owner.image, owner.desc.base_level);
            let format_of_view = owner.desc.format;
            let desc = self.texture_desc(image)?;
            let [width, height, _] = desc.level_size(level);
            if first {
                (pass.size, pass.formats.samples, first) = ([width, height], desc.samples, false);
            }
            if pass.size != [width, height] {
                return unsupported("a pass with targets of different sizes");
            }
            let whole = targets.area.common(Area { x: 0, y: 0, width, height }) == Area { x: 0, y: 0, width, height };
            let (native, slice) = self.target_view(target.view, layer)?;
            let format = format_of_view.unwrap_or(desc.format);
            if is_color {
                let resolve = match target.resolve {
                    Some(resolve) if desc.samples > 1 => Some(self.target_view(resolve, layer)?.0),
                    _ => None,
                };
                let clear = target.clear.map(|bits| clear_color(bits, format));
                if !whole && let Some(bits) = target.clear {
                    clears.push((number, bits));
                }
                pass.formats.color.push(Some(format));
                let clear = clear.filter(|_| whole);
                pass.color.push(Some(ColorAttachment {
                    view: native,
                    depth_slice: slice,
                    resolve,
                    clear,
                    store: target.store,
                }));
            } else {
                pass.formats.depth = Some(format);
                let depth = target.clear.map(|bits| f32::from_bits(bits[0]).clamp(0.0, 1.0)).filter(|_| format.has_depth());
                let stencil = target.stencil_clear.filter(|_| format.has_stencil());
                if !whole && (depth.is_some() || stencil.is_some()) {
                    return unsupported("a clear of depth in a part of the targets, as a pass begins");
                }
                pass.depth = Some(DepthAttachment {
                    view: native,
                    depth_clear: depth,
                    depth_store: target.store || !format.has_depth(),
                    depth_read_only: false,
                    stencil_clear: stencil,
                    stencil_store: target.stencil_store || !format.has_stencil(),
                    stencil_read_only: false,
                });
            }
        }
        if first {
            return unsupported("a pass without targets");
        }
        while let Some(None) = pass.formats.color.last() {
            pass.formats.color.pop();
        }
        for (number, bits) in clears {
            self.clear_color_part(&mut pass, number, bits, targets.area)?;
        }
        Ok(pass)
    }

    /// Ends what is open.
    pub fn close(&mut self, open: &mut Open) {
        let now = self.card.call_site();
        match std::mem::take(open) {
            Open::Nothing => {}
            Open::Render(pass) => {
                let OpenPass { color, depth, occlusion, commands, site, .. } = *pass;
                site.into_iter().for_each(|site| self.card.set_call_site(site));
                self.card.push(Command::BeginRenderPass { color, depth, occlusion, timestamps: None, label: None });
                commands.into_iter().for_each(|command| self.card.push(command));
                self.card.push(Command::EndRenderPass);
            }
            Open::Compute(commands, _) => {
                self.card.push(Command::BeginComputePass { timestamps: None, label: None });
                commands.into_iter().for_each(|command| self.card.push(command));
                self.card.push(Command::EndComputePass);
            }
        }
        now.into_iter().for_each(|site| self.card.set_call_site(site));
        self.conversions.end(&mut self.card);
    }

    /// Appends a command that is allowed everywhere to what is open, or to the commands outside passes.
    pub fn annotate(&mut self, command: Command, open: &mut Open) {
        match open {
            Open::Nothing => self.card.push(command),
            Open::Render(pass) => pass.commands.push(command),
            Open::Compute(commands, _) => commands.push(command),
        }
    }

    /// Takes up a pass anew, to which more has to be drawn: its contents are loaded.
    pub fn reopen(&mut self, pass: &mut OpenPass) {
        let mut color = pass.color.clone();
        let mut depth = pass.depth.clone();
        for target in color.iter_mut().flatten() {
            target.clear = None;
        }
        if let Some(depth) = &mut depth {
            (depth.depth_clear, depth.stencil_clear) = (None, None);
        }
        for target in pass.color.iter_mut().flatten() {
            (target.store, target.resolve) = (true, None);
        }
        if let Some(depth) = &mut pass.depth {
            (depth.depth_store, depth.stencil_store) = (true, true);
        }
        let again = OpenPass {
            color,
            depth,
            formats: pass.formats.clone(),
            size: pass.size,
            area: pass.area,
            occlusion: None,
            commands: Vec::new(),
            emitted: Emitted::default(),
            site: pass.site,
        };
        let before = std::mem::replace(pass, again);
        self.close(&mut Open::Render(Box::new(before)));
    }

    /// The targets of dynamic rendering.
    pub fn rendering_targets(&self, info: Args<'_>) -> Outcome<Targets> {
        let target = |of: Args<'_>| -> Outcome<Option<Target>> {
            let view = of.u64("imageView")?;
            if view == 0 {
                return Ok(None);
            }
            let (load, store) = (of.u32("loadOp")?, of.u32("storeOp")?);
            let resolves = of.u32("resolveMode")? != 0;
            let resolve = Some(of.u64("resolveImageView")?).filter(|&resolve| resolves && resolve != 0);
            let clear = if load == 1 { Some(four(&of.words("clearValue")?)) } else { None };
            Ok(Some(Target { view, clear, store: store != 1, resolve, ..Target::default() }))
        };
        let color = info.list("pColorAttachments")?.into_iter().map(target).collect::<Outcome<_>>()?;
        let depth = info.maybe("pDepthAttachment")?.map(target).transpose()?.flatten();
        let stencil = info.maybe("pStencilAttachment")?.map(target).transpose()?.flatten();
        for target in [&depth, &stencil].into_iter().flatten() {
            if target.resolve.is_some() {
                return unsupported("a resolve of depth");
            }
        }
        let depth = match (depth, stencil) {
            (Some(depth), Some(stencil)) => {
                Some(Target { stencil_clear: stencil.clear.map(|bits| bits[1]), stencil_store: stencil.store, ..depth })
            }
            (Some(depth), None) => Some(Target { stencil_store: true, ..depth }),
            (None, Some(stencil)) => Some(Target {
                view: stencil.view,
                clear: None,
                stencil_clear: stencil.clear.map(|bits| bits[1]),
                store: true,
                stencil_store: stencil.store,
                resolve: None,
            }),
            (None, None) => None,
        };
        let views = info.u32("viewMask")?;
        if views == 0 && info.u32("layerCount")? > 1 {
            return unsupported("a pass with several layers");
        }
        Ok(Targets { color, depth, area: Area::new(info.of("renderArea")?)?, views })
    }
}

/// A render pass of the program that has begun.
pub struct Begun {
    pass: std::rc::Rc<RenderPass>,
    views: Vec<Handle>,
    clears: Vec<[u32; 4]>,
    area: Area,
    layers: u32,
    /// The subpass that is open.
    pub subpass: usize,
}

impl Begun {
    /// Reads a `VkRenderPassBeginInfo`.
    pub fn new(vulkan: &Vulkan, info: Args<'_>) -> Outcome<Begun> {
        let (pass, framebuffer) = (info.u64("renderPass")?, info.u64("framebuffer")?);
        let pass = known(vulkan.objects.render_passes.get(pass), "render pass", pass)?.clone();
        let framebuffer: &Framebuffer = known(vulkan.objects.framebuffers.get(framebuffer), "framebuffer", framebuffer)?;
        let views = match info.chained("VkRenderPassAttachmentBeginInfo") {
            Some(given) if framebuffer.views.is_empty() => given.numbers("pAttachments")?,
            _ => framebuffer.views.clone(),
        };
        let clears = info.clear_values("pClearValues")?.iter().map(|words| four(words)).collect();
        Ok(Begun { pass, views, clears, area: Area::new(info.of("renderArea")?)?, layers: framebuffer.layers, subpass: 0 })
    }

    /// The targets of the open subpass.
    pub fn targets(&self) -> Outcome<Targets> {
        let damaged = |what: &str| Fault::Damaged(format!("a render pass has no {what}"));
        let subpass = self.pass.subpasses.get(self.subpass).ok_or_else(|| damaged("such subpass"))?;
        if let Some(refused) = &subpass.refused {
            return unsupported(refused.clone());
        }
        if self.layers > 1 && subpass.views == 0 {
            return unsupported("a pass with several layers");
        }
        let uses = |subpass: &super::objects::Subpass, attachment: usize| {
            let color =
                subpass.color.iter().chain(&subpass.resolve).chain([&subpass.depth]).any(|used| *used == Some(attachment));
            color || subpass.input.contains(&attachment)
        };
        let before = |attachment: usize| self.pass.subpasses[..self.subpass].iter().any(|subpass| uses(subpass, attachment));
        let after = |attachment: usize| self.pass.subpasses[self.subpass + 1..].iter().any(|subpass| uses(subpass, attachment));
        let target = |attachment: usize| -> Outcome<Target> {
            let own = self.pass.attachments.get(attachment).ok_or_else(|| damaged("such attachment"))?;
            let view = *self.views.get(attachment).ok_or_else(|| damaged("such view"))?;
            let value = self.clears.get(attachment).copied().unwrap_or_default();
            let (first, last) = (!before(attachment), !after(attachment));
            Ok(Target {
                view,
                clear: (own.clear && first).then_some(value),
                stencil_clear: (own.stencil_clear && first).then_some(value[1]),
                store: own.store || !last,
                stencil_store: own.stencil_store || !last,
                resolve: None,
            })
        };
        let mut color = Vec::new();
        for (number, attachment) in subpass.color.iter().enumerate() {
            let mut own = attachment.map(target).transpose()?;
            let resolve = subpass.resolve.get(number).copied().flatten();
            if let (Some(own), Some(resolve)) = (&mut own, resolve) {
                own.resolve = Some(*self.views.get(resolve).ok_or_else(|| damaged("such view"))?);
            }
            color.push(own);
        }
        Ok(Targets { color, depth: subpass.depth.map(target).transpose()?, area: self.area, views: subpass.views })
    }
}
