//! Work made without a trace: triangles, random or given, set up and traversed by `gfx`, with made-up shading costs, texture lines and
//! colours, and the picture that API order gives.
//!
//! ```
//! use synthetic::{Scene, events};
//! use work::Event;
//!
//! // A triangle with two sides of four pixels in a target of 8x8.
//! let scene = Scene::plain(8, 8, vec![[[0.0, 0.0], [4.0, 0.0], [0.0, 4.0]]], 1);
//! let events = events(&scene);
//! let Some(Event::EndFrame(frame)) = events.last() else { panic!("a scene ends with a frame") };
//! let clear = &frame.reference[4 * 63..];
//! let drawn = frame.reference.chunks(4).filter(|&pixel| pixel != clear).count();
//! assert_eq!(drawn, 6);
//! ```

mod segment;

use std::sync::Arc;

use gfx::format::Format;
use gfx::rop::{self, ColorState, DepthStencilState};
use gfx::setup::{DepthBias, SetupState};
use gfx::stage::{Stage, StageMap};
use gfx::state::{
    Blend, BlendComponent, BlendFactor, BlendOp, ColorTarget, Compare, CullMode, DepthStencil, FrontFace, Rect, StencilFace,
    StencilOp, StepMode, Viewport,
};
use gfx::texel;
use num::{CallSite, Random};
use segment::SegmentRecorder;
use work::*;

/// What a scene is made of.
#[derive(Clone, Debug)]
pub struct Scene {
    /// Width of the target in pixels.
    pub width: u32,
    /// Height of the target in pixels.
    pub height: u32,
    /// Samples per pixel, 1 or 4.
    pub samples: u32,
    /// Draws per frame.
    pub draws: u32,
    /// Triangles of each draw.
    pub triangles: u32,
    /// Edge of the square in which a triangle lies, in pixels.
    pub size: f32,
    /// The depth test.
    pub compare: Compare,
    /// Comparisons of the draws, over and over; that above if there are none.
    pub compares: Vec<Compare>,
    /// Format of the depth buffer, where there is one.
    pub depth_format: Option<Format>,
    /// All draws are tested before shading; else every other one.
    pub early: bool,
    /// Colours are blended over what is there.
    pub blend: bool,
    /// Steps with a texture request.
    pub textures: u32,
    /// Instructions in each step.
    pub instructions: u32,
    /// Frames.
    pub frames: u32,
    /// Segments of each draw.
    pub segments: u32,
    /// Where the format has a stencil, every other draw counts there what fails, and all are let through only where the count is even.
    pub stencil: bool,
    /// Shaders of late draws discard at random.
    pub discard: bool,
    /// Every other draw, from the first on, writes depths only.
    pub blind: bool,
    /// Every covered quad is shaded, as for machines whose early tests do not see all depths.
    pub covered: bool,
    /// Corners of the triangles of each draw, in pixels; random ones if there are none.
    pub shapes: Vec<[[f32; 2]; 3]>,
    /// Depths of the triangles of each draw, each the same all over; random slopes if there are none.
    pub depths: Vec<f32>,
    /// Where random numbers begin.
    pub seed: u64,
}

impl Scene {
    /// One draw of these triangles without depth and textures, in segments of `of_segment` triangles.
    pub fn plain(width: u32, height: u32, shapes: Vec<[[f32; 2]; 3]>, of_segment: u32) -> Scene {
        let triangles = shapes.len() as u32;
        Scene {
            width,
            height,
            draws: 1,
            segments: triangles.div_ceil(of_segment),
            triangles,
            depth_format: None,
            compare: Compare::Always,
            textures: 0,
            instructions: 1,
            shapes,
            ..Scene::default()
        }
    }
}

impl Default for Scene {
    fn default() -> Scene {
        Scene {
            width: 200,
            height: 136,
            samples: 1,
            draws: 2,
            triangles: 60,
            size: 60.0,
            compare: Compare::Less,
            compares: Vec::new(),
            depth_format: Some(Format::Depth32Float),
            early: true,
            blend: false,
            textures: 1,
            instructions: 20,
            frames: 1,
            segments: 2,
            stencil: false,
            discard: false,
            blind: false,
            covered: false,
            shapes: Vec::new(),
            depths: Vec::new(),
            seed: 7,
        }
    }
}

const COLOR: SurfaceKey = SurfaceKey { texture: 1, level: 0, layer: 0 };
const DEPTH: SurfaceKey = SurfaceKey { texture: 2, level: 0, layer: 0 };
const RESOLVED: SurfaceKey = SurfaceKey { texture: 3, level: 0, layer: 0 };

/// Frame buffers as API order leaves them: codes by pixel and sample.
struct Reference {
    width: u32,
    samples: u32,
    color: Vec<u32>,
    depth: Vec<u32>,
}

impl Reference {
    fn at(&self, x: u32, y: u32, s: u32) -> usize {
        ((y * self.width + x) * self.samples + s) as usize
    }

    /// The run of a quad: sample after sample, four pixels each. Pixels outside are zero.
    fn run(&self, buffer: &[u32], x: u32, y: u32) -> Vec<u32> {
        let mut run = Vec::new();
        for s in 0..self.samples {
            for p in 0..4 {
                run.push(*buffer.get(self.at(x + p % 2, y + p / 2, s)).filter(|_| x + p % 2 < self.width).unwrap_or(&0));
            }
        }
        run
    }

    fn put(&self, buffer: &mut [u32], x: u32, y: u32, run: &[u32]) {
        for s in 0..self.samples {
            for p in 0..4 {
                let at = self.at(x + p % 2, y + p / 2, s);
                if x + p % 2 < self.width && at < buffer.len() {
                    buffer[at] = run[(4 * s + p) as usize];
                }
            }
        }
    }
}

/// The events of a scene, and with each frame the picture that API order gives.
pub fn events(scene: &Scene) -> Vec<Event> {
    let mut random = Random::new(scene.seed);
    let mut out = Vec::new();
    let surface = |key, format, samples, address| Surface {
        key,
        format,
        width: scene.width,
        height: scene.height,
        samples,
        address,
        opaque: false,
    };
    let color = surface(COLOR, Format::Rgba8Unorm, scene.samples, 1 << 20);
    let resolve = (scene.samples > 1).then(|| surface(RESOLVED, Format::Rgba8Unorm, 1, 1 << 26));
    let clear = [0.25_f32.to_bits(), 0, 0, 1.0_f32.to_bits()];
    let attachment = |surface, load| Attachment {
        surface,
        load,
        store: true,
        stencil_load: Load::Clear([0, 0, 0, 0]),
        stencil_store: true,
        keeps: Aspects { main: true, stencil: true },
        resolve: None,
    };
    let far = match scene.compare {
        Compare::Greater | Compare::GreaterEqual => 0.0_f32,
        _ => 1.0,
    };
    for frame in 0..scene.frames {
        let depth = scene
            .depth_format
            .map(|format| attachment(surface(DEPTH, format, scene.samples, 1 << 24), Load::Clear([far.to_bits(), 0, 0, 0])));
        let pass = Pass {
            number: frame,
            label: String::new(),
            width: scene.width,
            height: scene.height,
            samples: scene.samples,
            color: vec![Some(Attachment { resolve, ..attachment(color, Load::Clear(clear)) })],
            depth,
        };
        out.push(Event::BeginPass(Arc::new(pass)));
        let pixels = (scene.width * scene.height * scene.samples) as usize;
        let cleared = texel::encode_code(color.format, clear)[0];
        let far_code = scene.depth_format.map_or(0, |format| texel::depth_code(format, far));
        let mut reference = Reference {
            width: scene.width,
            samples: scene.samples,
            color: vec![cleared; pixels],
            depth: vec![far_code; pixels],
        };
        for number in 0..scene.draws {
            draw(scene, number, &mut random, &mut reference, &mut out);
        }
        out.push(Event::EndPass(None));
        let shown = resolve.unwrap_or(color);
        let bytes: Vec<u8> = if scene.samples == 1 {
            reference.color.iter().flat_map(|code| code.to_le_bytes()).collect()
        } else {
            let resolve = |samples: &[u32]| {
                let mut pixel = [0];
                rop::resolve(color.format, samples, &mut pixel);
                pixel[0].to_le_bytes()
            };
            reference.color.chunks_exact(scene.samples as usize).flat_map(resolve).collect()
        };
        out.push(Event::EndFrame(EndFrame {
            number: frame,
            shown: Some(shown),
            reference: bytes.into(),
            drawn: true,
            sprites: [].into(),
        }));
    }
    out
}

fn cost(scene: &Scene, extra: u32) -> Cost {
    let mut steps = Vec::new();
    for _ in 0..scene.textures {
        steps.push(Step::dependent([scene.instructions, 2, 1, 0, 0], RequestKind::Texture));
    }
    steps.push(Step::dependent([scene.instructions + extra, 0, 1, 1, 0], RequestKind::End));
    Cost::from(steps)
}

fn draw(scene: &Scene, number: u32, random: &mut Random, reference: &mut Reference, out: &mut Vec<Event>) {
    let factor = |src, dst| BlendComponent { src, dst, op: BlendOp::Add };
    let over = factor(BlendFactor::SrcAlpha, BlendFactor::OneMinusSrcAlpha);
    let blend = scene.blend.then_some(Blend { color: over, alpha: over });
    let compare = scene.compares.get(number as usize % scene.compares.len().max(1)).copied().unwrap_or(scene.compare);
    let stencil = scene.stencil && scene.depth_format.is_some_and(|format| format.has_stencil());
    let counts = StencilOp::IncrementWrap;
    let even = StencilFace { compare: Compare::Equal, fail_op: counts, depth_fail_op: counts, pass_op: StencilOp::Keep };
    let face = if stencil { even } else { StencilFace::default() };
    let state = scene.depth_format.map(|format| DepthStencil {
        format,
        depth_write: true,
        depth_compare: compare,
        stencil_front: face,
        stencil_back: face,
        stencil_read_mask: if stencil { 1 } else { !0 },
        stencil_write_mask: if stencil && number % 2 == 1 { 0 } else { !0 },
        stencil_back_masks: None,
        bias: 0.0,
        bias_slope: 0.0,
        bias_clamp: 0.0,
    });
    // Every other draw of a late scene is early, so that both kinds meet.
    let early = scene.early || number % 2 == 1;
    let target = Target {
        blend,
        logic: None,
        write_mask: if scene.blind && number.is_multiple_of(2) { 0 } else { 15 },
        payload: Some(0),
        words: if scene.blend { 4 } else { 1 },
        packed: !scene.blend,
        second: None,
    };
    let words = 4 * target.words;
    let mut shapes = StageMap::default();
    shapes[Stage::Vertex] = Some(ShaderShape { registers: 16, inputs: 8, outputs: 8 });
    shapes[Stage::Fragment] = Some(ShaderShape { registers: 24, inputs: 8, outputs: 4 });
    let drawn_with = RecordedState {
        // Draws that are all alike share one state.
        number: if scene.compares.is_empty() && scene.early && !scene.blind && !scene.stencil { 0 } else { number },
        label: String::new(),
        shapes,
        depth_stencil: state,
        stencil_references: [0; 2],
        targets: vec![Some(target)],
        blend_constant: [0.0; 4],
        depth_words: 0,
        payload_words: words,
        early,
        hierarchical_z: early && !stencil,
        depth_range: [0.0, 1.0],
    };
    let draw = Draw {
        number,
        site: CallSite::Command(0),
        groups: [].into(),
        state: Arc::new(drawn_with),
        attributes: vec![AttributeFetch { address: 1 << 22, stride: 32, step: StepMode::Vertex, bytes: 32 }],
        signature: None,
        culling: Default::default(),
        reach: Default::default(),
    };
    out.push(Event::Draw(Arc::new(draw)));
    let depth = state.map(|state| DepthStencilState::new(&state, [0; 2], [0.0, 1.0]));
    let color = ColorState::new(
        &ColorTarget { format: Format::Rgba8Unorm, blend: target.blend, logic: None, write_mask: target.write_mask },
        [0.0; 4],
    );
    let view =
        Viewport { x: 0.0, y: 0.0, width: scene.width as f32, height: scene.height as f32, min_depth: 0.0, max_depth: 1.0 };
    let scissor = Rect { x: 0, y: 0, width: scene.width, height: scene.height };
    let setup_state = SetupState::new(
        (scene.width, scene.height),
        &view,
        scissor,
        FrontFace::Ccw,
        CullMode::None,
        scene.samples,
        DepthBias::NONE,
    );
    let mut painter = SegmentRecorder {
        scene,
        random,
        reference,
        setup: &setup_state,
        depth: depth.as_ref(),
        color: &color,
        early,
        blend: blend.is_some(),
    };
    let each = scene.triangles.div_ceil(scene.segments);
    for segment in 0..scene.segments {
        let count = each.min(scene.triangles - (each * segment).min(scene.triangles));
        let made = match scene.samples {
            1 => painter.segment::<1>(count, segment * each),
            _ => painter.segment::<4>(count, segment * each),
        };
        out.push(Event::Segment(Arc::new(made)));
    }
}

/// The events of a scene of one frame with its draws in two passes, the second of which loads what the first has drawn.
pub fn in_two_passes(scene: &Scene) -> Vec<Event> {
    let mut out = Vec::new();
    let mut second: Option<Pass> = None;
    for event in events(scene) {
        match &event {
            Event::BeginPass(begun) => {
                let mut pass = Pass { number: 1, ..begun.as_ref().clone() };
                pass.color.iter_mut().flatten().chain(&mut pass.depth).for_each(|attachment| {
                    attachment.load = Load::Load;
                    attachment.stencil_load = Load::Load;
                });
                second = Some(pass);
            }
            Event::Draw(draw) if draw.number == 1 => {
                out.extend(second.take().into_iter().flat_map(|pass| [Event::EndPass(None), Event::BeginPass(Arc::new(pass))]));
            }
            _ => {}
        }
        out.push(event);
    }
    out
}
