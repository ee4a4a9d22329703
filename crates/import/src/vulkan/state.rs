//! The fixed state of draws, in Vulkan's terms: what a pipeline brings and what commands set.

use gfx::state::{LogicOp, Viewport};

use super::args::Args;
use super::fault::{Outcome, unsupported};

/// The numbers of `VkDynamicState` that the translation knows.
pub mod dynamic {
    pub const VIEWPORT: u32 = 0;
    pub const SCISSOR: u32 = 1;
    pub const LINE_WIDTH: u32 = 2;
    pub const DEPTH_BIAS: u32 = 3;
    pub const BLEND_CONSTANTS: u32 = 4;
    pub const STENCIL_COMPARE_MASK: u32 = 6;
    pub const STENCIL_WRITE_MASK: u32 = 7;
    pub const STENCIL_REFERENCE: u32 = 8;
    pub const CULL_MODE: u32 = 1_000_267_000;
    pub const FRONT_FACE: u32 = 1_000_267_001;
    pub const TOPOLOGY: u32 = 1_000_267_002;
    pub const VIEWPORT_WITH_COUNT: u32 = 1_000_267_003;
    pub const SCISSOR_WITH_COUNT: u32 = 1_000_267_004;
    pub const STRIDE: u32 = 1_000_267_005;
    pub const DEPTH_TEST: u32 = 1_000_267_006;
    pub const DEPTH_WRITE: u32 = 1_000_267_007;
    pub const DEPTH_COMPARE: u32 = 1_000_267_008;
    pub const DEPTH_BOUNDS_TEST: u32 = 1_000_267_009;
    pub const STENCIL_TEST: u32 = 1_000_267_010;
    pub const STENCIL_OP: u32 = 1_000_267_011;
    pub const VERTEX_INPUT: u32 = 1_000_352_000;
    pub const DISCARD: u32 = 1_000_377_001;
    pub const DEPTH_BIAS_ENABLE: u32 = 1_000_377_002;
    pub const LOGIC_OP: u32 = 1_000_377_003;
    pub const RESTART: u32 = 1_000_377_004;
    pub const COLOR_WRITE_ENABLE: u32 = 1_000_381_000;
    pub const DEPTH_CLAMP: u32 = 1_000_455_003;
    pub const POLYGON_MODE: u32 = 1_000_455_004;
    pub const SAMPLES: u32 = 1_000_455_005;
    pub const SAMPLE_MASK: u32 = 1_000_455_006;
    pub const ALPHA_TO_COVERAGE: u32 = 1_000_455_007;
    pub const ALPHA_TO_ONE: u32 = 1_000_455_008;
    pub const LOGIC_OP_ENABLE: u32 = 1_000_455_009;
    pub const BLEND_ENABLE: u32 = 1_000_455_010;
    pub const BLEND_EQUATION: u32 = 1_000_455_011;
    pub const COLOR_WRITE_MASK: u32 = 1_000_455_012;
    pub const DEPTH_CLIP: u32 = 1_000_455_016;
    pub const PROVOKING_VERTEX: u32 = 1_000_455_019;
    pub const LINE_MODE: u32 = 1_000_455_020;
    pub const LINE_STIPPLE_ENABLE: u32 = 1_000_455_021;
    pub const NEGATIVE_ONE_TO_ONE: u32 = 1_000_455_022;
}

/// A vertex buffer's layout.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct VertexBinding {
    /// Its number.
    pub binding: u32,
    /// Bytes from one element to the next.
    pub stride: u32,
    /// Whether it advances with the instance.
    pub instance: bool,
    /// Instances for each element.
    pub divisor: u32,
}

/// A vertex attribute.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct VertexAttribute {
    /// Its location in the shader.
    pub location: u32,
    /// The vertex buffer.
    pub binding: u32,
    /// `VkFormat`.
    pub format: u32,
    /// First byte in an element.
    pub offset: u32,
}

/// Stencil state of one face, with constants as Vulkan numbers them.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Stencil {
    pub fail: u32,
    pub pass: u32,
    pub depth_fail: u32,
    pub compare: u32,
    pub compare_mask: u32,
    pub write_mask: u32,
    pub reference: u32,
}

/// Blending of one target, with constants as Vulkan numbers them.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Blend {
    pub enabled: bool,
    /// Source factor, destination factor and operation of colour, then of alpha.
    pub equation: [u32; 6],
    pub write_mask: u32,
}

/// A rectangle that may lie outside of the targets.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Area {
    pub x: i32,
    pub y: i32,
    pub width: u32,
    pub height: u32,
}

impl Area {
    /// Reads a `VkRect2D`.
    pub fn new(of: Args<'_>) -> Outcome<Area> {
        let (offset, [width, height]) = (of.of("offset")?, of.pair("extent", ["width", "height"])?);
        Ok(Area { x: offset.i32("x")?, y: offset.i32("y")?, width, height })
    }

    /// What two have in common, beginning at 0 at least.
    pub fn common(self, other: Area) -> Area {
        let end = |at: i32, size: u32| i64::from(at) + i64::from(size);
        let (x, y) = (self.x.max(other.x).max(0), self.y.max(other.y).max(0));
        let right = end(self.x, self.width).min(end(other.x, other.width));
        let bottom = end(self.y, self.height).min(end(other.y, other.height));
        let size = |from: i32, to: i64| (to - i64::from(from)).clamp(0, u32::MAX.into()) as u32;
        Area { x, y, width: size(x, right), height: size(y, bottom) }
    }
}

/// State of draws.
#[derive(Clone, Debug, PartialEq)]
pub struct Fixed {
    pub bindings: Vec<VertexBinding>,
    pub attributes: Vec<VertexAttribute>,
    pub topology: u32,
    pub restart: bool,
    pub viewports: Vec<Viewport>,
    pub scissors: Vec<Area>,
    pub depth_clamp: bool,
    pub depth_clip: Option<bool>,
    pub discard: bool,
    pub polygon_mode: u32,
    pub cull_mode: u32,
    pub front_face: u32,
    pub depth_bias: bool,
    /// Constant, clamp, slope.
    pub bias: [f32; 3],
    pub line_width: f32,
    /// `VkLineRasterizationModeEXT`.
    pub line_mode: u32,
    pub stippled: bool,
    pub provoking_last: bool,
    pub negative_one_to_one: bool,
    pub samples: u32,
    pub sample_mask: u32,
    /// The share of samples for which the fragment stage runs at least; 0: once for each pixel.
    pub sample_shading: f32,
    pub alpha_to_coverage: bool,
    pub alpha_to_one: bool,
    pub depth_test: bool,
    pub depth_write: bool,
    pub depth_compare: u32,
    pub depth_bounds: bool,
    pub stencil_test: bool,
    pub stencil: [Stencil; 2],
    pub logic_op: Option<u32>,
    pub logic_op_enable: bool,
    pub blend: Vec<Blend>,
    pub color_write: Vec<bool>,
    pub blend_constants: [f32; 4],
}

impl Default for Fixed {
    fn default() -> Fixed {
        Fixed {
            bindings: Vec::new(),
            attributes: Vec::new(),
            topology: 3,
            restart: false,
            viewports: Vec::new(),
            scissors: Vec::new(),
            depth_clamp: false,
            depth_clip: None,
            discard: false,
            polygon_mode: 0,
            cull_mode: 0,
            front_face: 0,
            depth_bias: false,
            bias: [0.0; 3],
            line_width: 1.0,
            line_mode: 0,
            stippled: false,
            provoking_last: false,
            negative_one_to_one: false,
            samples: 1,
            sample_mask: !0,
            sample_shading: 0.0,
            alpha_to_coverage: false,
            alpha_to_one: false,
            depth_test: false,
            depth_write: false,
            depth_compare: 7,
            depth_bounds: false,
            stencil_test: false,
            stencil: [Stencil { compare: 7, compare_mask: !0, write_mask: !0, ..Stencil::default() }; 2],
            logic_op: None,
            logic_op_enable: false,
            blend: Vec::new(),
            color_write: Vec::new(),
            blend_constants: [0.0; 4],
        }
    }
}

/// Reads a `VkViewport`.
pub fn viewport(of: Args<'_>) -> Outcome<Viewport> {
    Ok(Viewport {
        x: of.f32("x")?,
        y: of.f32("y")?,
        width: of.f32("width")?,
        height: of.f32("height")?,
        min_depth: of.f32("minDepth")?,
        max_depth: of.f32("maxDepth")?,
    })
}

/// Reads a `VkStencilOpState`.
pub fn stencil(of: Args<'_>) -> Outcome<Stencil> {
    Ok(Stencil {
        fail: of.u32("failOp")?,
        pass: of.u32("passOp")?,
        depth_fail: of.u32("depthFailOp")?,
        compare: of.u32("compareOp")?,
        compare_mask: of.u32("compareMask")?,
        write_mask: of.u32("writeMask")?,
        reference: of.u32("reference")?,
    })
}

/// Writes values at their places, and makes the list as long as that asks for.
fn put<T: Clone + Default>(list: &mut Vec<T>, first: usize, values: impl ExactSizeIterator<Item = T>) {
    // Vulkan's implementations have at most some tens of each.
    let end = first.saturating_add(values.len()).min(256);
    list.resize(list.len().max(end), T::default());
    list.iter_mut().skip(first).zip(values).for_each(|(slot, value)| *slot = value);
}

impl Fixed {
    /// Takes over the state of a pipeline, but for what commands set.
    pub fn bind(&mut self, pipeline: &Fixed, set_by_commands: &[u32]) {
        use dynamic::*;
        let kept = |state: u32| set_by_commands.contains(&state);
        macro_rules! take {
            ($($kept:expr => $field:ident;)+) => { $(if !($kept) { self.$field = pipeline.$field.clone(); })+ };
        }
        take! {
            kept(VERTEX_INPUT) => attributes;
            kept(TOPOLOGY) => topology;
            kept(RESTART) => restart;
            kept(VIEWPORT) || kept(VIEWPORT_WITH_COUNT) => viewports;
            kept(SCISSOR) || kept(SCISSOR_WITH_COUNT) => scissors;
            kept(DEPTH_CLAMP) => depth_clamp;
            kept(DEPTH_CLIP) => depth_clip;
            kept(DISCARD) => discard;
            kept(POLYGON_MODE) => polygon_mode;
            kept(CULL_MODE) => cull_mode;
            kept(FRONT_FACE) => front_face;
            kept(DEPTH_BIAS_ENABLE) => depth_bias;
            kept(DEPTH_BIAS) => bias;
            kept(LINE_WIDTH) => line_width;
            kept(LINE_MODE) => line_mode;
            kept(LINE_STIPPLE_ENABLE) => stippled;
            kept(PROVOKING_VERTEX) => provoking_last;
            kept(NEGATIVE_ONE_TO_ONE) => negative_one_to_one;
            kept(SAMPLES) => samples;
            kept(SAMPLE_MASK) => sample_mask;
            false => sample_shading;
            kept(ALPHA_TO_COVERAGE) => alpha_to_coverage;
            kept(ALPHA_TO_ONE) => alpha_to_one;
            kept(DEPTH_TEST) => depth_test;
            kept(DEPTH_WRITE) => depth_write;
            kept(DEPTH_COMPARE) => depth_compare;
            kept(DEPTH_BOUNDS_TEST) => depth_bounds;
            kept(STENCIL_TEST) => stencil_test;
            kept(LOGIC_OP) => logic_op;
            kept(LOGIC_OP_ENABLE) => logic_op_enable;
            kept(COLOR_WRITE_ENABLE) => color_write;
            kept(BLEND_CONSTANTS) => blend_constants;
        }
        if !kept(VERTEX_INPUT) {
            let strides = std::mem::replace(&mut self.bindings, pipeline.bindings.clone());
            if kept(STRIDE) {
                for binding in &mut self.bindings {
                    let known = strides.iter().find(|known| known.binding == binding.binding);
                    binding.stride = known.map_or(binding.stride, |known| known.stride);
                }
            }
        }
        for (own, new) in self.stencil.iter_mut().zip(&pipeline.stencil) {
            if !kept(STENCIL_OP) {
                (own.fail, own.pass, own.depth_fail, own.compare) = (new.fail, new.pass, new.depth_fail, new.compare);
            }
            if !kept(STENCIL_COMPARE_MASK) {
                own.compare_mask = new.compare_mask;
            }
            if !kept(STENCIL_WRITE_MASK) {
                own.write_mask = new.write_mask;
            }
            if !kept(STENCIL_REFERENCE) {
                own.reference = new.reference;
            }
        }
        self.blend.resize(self.blend.len().max(pipeline.blend.len()), Blend::default());
        for (own, new) in self.blend.iter_mut().zip(&pipeline.blend) {
            if !kept(BLEND_ENABLE) {
                own.enabled = new.enabled;
            }
            if !kept(BLEND_EQUATION) {
                own.equation = new.equation;
            }
            if !kept(COLOR_WRITE_MASK) {
                own.write_mask = new.write_mask;
            }
        }
    }

    /// Takes over what a part of a pipeline brings: all that is not as a pipeline without parts has it.
    pub fn join(&mut self, part: &Fixed) {
        let none = Fixed::default();
        macro_rules! take {
            ($($field:ident)+) => { $(if part.$field != none.$field { self.$field = part.$field.clone(); })+ };
        }
        take! {
            bindings attributes topology restart viewports scissors depth_clamp depth_clip discard polygon_mode cull_mode front_face depth_bias bias
            line_width line_mode stippled provoking_last negative_one_to_one samples sample_mask sample_shading alpha_to_coverage alpha_to_one depth_test
            depth_write depth_compare depth_bounds stencil_test stencil logic_op logic_op_enable blend color_write blend_constants
        }
    }

    /// The logic operation, where draws have one.
    pub fn logic(&self) -> Outcome<Option<LogicOp>> {
        let Some(number) = self.logic_op.filter(|_| self.logic_op_enable) else { return Ok(None) };
        match LogicOp::ALL.get(number as usize) {
            Some(&operation) => Ok(Some(operation)),
            None => unsupported(format!("the logic operation {number}")),
        }
    }

    /// The stencil tests of front and back faces. Points and lines are front faces, also where points are drawn as squares.
    pub fn stencil_sides(&self) -> [Stencil; 2] {
        let [front, back] = self.stencil;
        [front, if self.topology < 3 { front } else { back }]
    }

    /// The most instances that a draw can have without a change of attributes that change after several, if there are any.
    pub fn instance_step(&self) -> Option<u32> {
        let read = |binding: &&VertexBinding| self.attributes.iter().any(|own| own.binding == binding.binding);
        let several = self.bindings.iter().filter(|binding| binding.instance && binding.divisor > 1).filter(read);
        let common = |mut a: u32, mut b: u32| {
            while b != 0 {
                (a, b) = (b, a % b);
            }
            a
        };
        several.map(|binding| binding.divisor).reduce(common)
    }

    /// Sets the stride of a vertex buffer.
    pub fn set_stride(&mut self, binding: u32, stride: u32) {
        match self.bindings.iter_mut().find(|known| known.binding == binding) {
            Some(known) => known.stride = stride,
            None => self.bindings.push(VertexBinding { binding, stride, instance: false, divisor: 1 }),
        }
    }

    /// Runs a command that sets state. Answers whether it is one.
    pub fn set(&mut self, name: &str, call: Args<'_>) -> Outcome<bool> {
        let faces = |mask: u32| (0..2).filter(move |face| mask >> face & 1 != 0);
        match name.strip_suffix("EXT").unwrap_or(name) {
            "vkCmdSetViewport" => {
                let all: Vec<_> = call.list("pViewports")?.into_iter().map(viewport).collect::<Outcome<_>>()?;
                let first = call.u32("firstViewport")? as usize;
                let none = Viewport { x: 0.0, y: 0.0, width: 0.0, height: 0.0, min_depth: 0.0, max_depth: 1.0 };
                self.viewports.resize(self.viewports.len().max((first + all.len()).min(256)), none);
                self.viewports.iter_mut().skip(first).zip(all).for_each(|(slot, value)| *slot = value);
            }
            "vkCmdSetViewportWithCount" => {
                self.viewports = call.list("pViewports")?.into_iter().map(viewport).collect::<Outcome<_>>()?;
            }
            "vkCmdSetScissor" => {
                let all: Vec<_> = call.list("pScissors")?.into_iter().map(Area::new).collect::<Outcome<_>>()?;
                put(&mut self.scissors, call.u32("firstScissor")? as usize, all.into_iter());
            }
            "vkCmdSetScissorWithCount" => {
                self.scissors = call.list("pScissors")?.into_iter().map(Area::new).collect::<Outcome<_>>()?;
            }
            "vkCmdSetLineWidth" => self.line_width = call.f32("lineWidth")?,
            "vkCmdSetDepthBias" => {
                let of = |name: &str| call.f32(name);
                self.bias = [of("depthBiasConstantFactor")?, of("depthBiasClamp")?, of("depthBiasSlopeFactor")?];
            }
            "vkCmdSetBlendConstants" => {
                let values = call.floats("blendConstants")?;
                self.blend_constants.iter_mut().zip(values).for_each(|(slot, value)| *slot = value);
            }
            "vkCmdSetStencilCompareMask" => {
                for face in faces(call.u32("faceMask")?) {
                    self.stencil[face].compare_mask = call.u32("compareMask")?;
                }
            }
            "vkCmdSetStencilWriteMask" => {
                for face in faces(call.u32("faceMask")?) {
                    self.stencil[face].write_mask = call.u32("writeMask")?;
                }
            }
            "vkCmdSetStencilReference" => {
                for face in faces(call.u32("faceMask")?) {
                    self.stencil[face].reference = call.u32("reference")?;
                }
            }
            "vkCmdSetStencilOp" => {
                for face in faces(call.u32("faceMask")?) {
                    let own = &mut self.stencil[face];
                    (own.fail, own.pass) = (call.u32("failOp")?, call.u32("passOp")?);
                    (own.depth_fail, own.compare) = (call.u32("depthFailOp")?, call.u32("compareOp")?);
                }
            }
            "vkCmdSetCullMode" => self.cull_mode = call.u32("cullMode")?,
            "vkCmdSetFrontFace" => self.front_face = call.u32("frontFace")?,
            "vkCmdSetPrimitiveTopology" => self.topology = call.u32("primitiveTopology")?,
            "vkCmdSetPrimitiveRestartEnable" => self.restart = call.flag("primitiveRestartEnable")?,
            "vkCmdSetDepthTestEnable" => self.depth_test = call.flag("depthTestEnable")?,
            "vkCmdSetDepthWriteEnable" => self.depth_write = call.flag("depthWriteEnable")?,
            "vkCmdSetDepthCompareOp" => self.depth_compare = call.u32("depthCompareOp")?,
            "vkCmdSetDepthBoundsTestEnable" => self.depth_bounds = call.flag("depthBoundsTestEnable")?,
            "vkCmdSetStencilTestEnable" => self.stencil_test = call.flag("stencilTestEnable")?,
            "vkCmdSetRasterizerDiscardEnable" => self.discard = call.flag("rasterizerDiscardEnable")?,
            "vkCmdSetDepthBiasEnable" => self.depth_bias = call.flag("depthBiasEnable")?,
            "vkCmdSetDepthClampEnable" => self.depth_clamp = call.flag("depthClampEnable")?,
            "vkCmdSetDepthClipEnable" => self.depth_clip = Some(call.flag("depthClipEnable")?),
            "vkCmdSetPolygonMode" => self.polygon_mode = call.u32("polygonMode")?,
            "vkCmdSetRasterizationSamples" => self.samples = call.u32("rasterizationSamples")?,
            "vkCmdSetSampleMask" => self.sample_mask = call.words("pSampleMask")?.first().copied().unwrap_or(!0),
            "vkCmdSetAlphaToCoverageEnable" => self.alpha_to_coverage = call.flag("alphaToCoverageEnable")?,
            "vkCmdSetAlphaToOneEnable" => self.alpha_to_one = call.flag("alphaToOneEnable")?,
            "vkCmdSetLogicOpEnable" => self.logic_op_enable = call.flag("logicOpEnable")?,
            "vkCmdSetLogicOp" => self.logic_op = Some(call.u32("logicOp")?),
            "vkCmdSetProvokingVertexMode" => self.provoking_last = call.u32("provokingVertexMode")? == 1,
            "vkCmdSetDepthClipNegativeOneToOne" => self.negative_one_to_one = call.flag("negativeOneToOne")?,
            "vkCmdSetLineRasterizationMode" => self.line_mode = call.u32("lineRasterizationMode")?,
            "vkCmdSetLineStippleEnable" => self.stippled = call.flag("stippledLineEnable")?,
            "vkCmdSetColorWriteEnable" => {
                self.color_write = call.numbers("pColorWriteEnables")?.into_iter().map(|on| on != 0).collect();
            }
            "vkCmdSetColorBlendEnable" => {
                for (slot, on) in self.blends(call.u32("firstAttachment")?, &call.numbers("pColorBlendEnables")?) {
                    slot.enabled = *on != 0;
                }
            }
            "vkCmdSetColorWriteMask" => {
                for (slot, mask) in self.blends(call.u32("firstAttachment")?, &call.numbers("pColorWriteMasks")?) {
                    slot.write_mask = *mask as u32;
                }
            }
            "vkCmdSetColorBlendEquation" => {
                let all: Vec<_> = call.list("pColorBlendEquations")?.into_iter().map(equation).collect::<Outcome<_>>()?;
                for (slot, equation) in self.blends(call.u32("firstAttachment")?, &all) {
                    slot.equation = *equation;
                }
            }
            "vkCmdSetVertexInput" => {
                let bindings = call.list("pVertexBindingDescriptions")?;
                self.bindings =
                    bindings.into_iter().map(|of| vertex_binding(of, Some(of.u32("divisor")?))).collect::<Outcome<_>>()?;
                let attributes = call.list("pVertexAttributeDescriptions")?;
                self.attributes = attributes.into_iter().map(vertex_attribute).collect::<Outcome<_>>()?;
            }
            // The pattern counts only where stipple is on, patches only with tessellation.
            "vkCmdSetLineStipple"
            | "vkCmdSetLineStippleKHR"
            | "vkCmdSetPatchControlPoints"
            | "vkCmdSetDepthBounds"
            | "vkCmdSetTessellationDomainOrigin"
            | "vkCmdSetFragmentShadingRateKHR" => {}
            _ => return Ok(false),
        }
        Ok(true)
    }

    fn blends<'a, T>(&'a mut self, first: u32, values: &'a [T]) -> impl Iterator<Item = (&'a mut Blend, &'a T)> {
        let first = first as usize;
        self.blend.resize(self.blend.len().max((first + values.len()).min(256)), Blend { write_mask: 15, ..Blend::default() });
        self.blend.iter_mut().skip(first).zip(values)
    }
}

/// Reads a blend equation, dynamic or of a pipeline.
pub fn equation(of: Args<'_>) -> Outcome<[u32; 6]> {
    Ok([
        of.u32("srcColorBlendFactor")?,
        of.u32("dstColorBlendFactor")?,
        of.u32("colorBlendOp")?,
        of.u32("srcAlphaBlendFactor")?,
        of.u32("dstAlphaBlendFactor")?,
        of.u32("alphaBlendOp")?,
    ])
}

/// Reads a binding of vertex input.
pub fn vertex_binding(of: Args<'_>, divisor: Option<u32>) -> Outcome<VertexBinding> {
    let (binding, stride, instance) = (of.u32("binding")?, of.u32("stride")?, of.u32("inputRate")? == 1);
    Ok(VertexBinding { binding, stride, instance, divisor: divisor.unwrap_or(1) })
}

/// Reads an attribute of vertex input.
pub fn vertex_attribute(of: Args<'_>) -> Outcome<VertexAttribute> {
    let (location, binding) = (of.u32("location")?, of.u32("binding")?);
    Ok(VertexAttribute { location, binding, format: of.u32("format")?, offset: of.u32("offset")? })
}
