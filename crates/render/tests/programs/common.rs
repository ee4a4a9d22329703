//! Programs recorded with the library's recorder and run the whole way: trace, checker, renderer, image. What a program leaves in
//! a buffer is shown as a texture of `r32uint`, so that every bit of it comes back.

use gfx::format::Format;
use num::*;
use render::{self, Options};
use trace::TraceError;
use trace::command::*;
use trace::record::{self, Recorder};
use work::Event;

/// A recording and short ways to run programs in it.
pub struct Lab {
    pub card: Recorder,
}

/// Words of a row of the texture through which buffers are read.
const ROW: u64 = 64;

/// The bytes of the little-endian words.
pub fn bytes(words: &[u32]) -> Vec<u8> {
    words.iter().flat_map(|w| w.to_le_bytes()).collect()
}

/// The bits of numbers.
pub fn bits(numbers: &[f32]) -> Vec<u32> {
    numbers.iter().map(|x| x.to_bits()).collect()
}

/// The numbers of bits.
pub fn floats(words: &[u32]) -> Vec<f32> {
    words.iter().map(|&w| f32::from_bits(w)).collect()
}

/// A sequence of numbers that is the same on every run: 32 bits each.
pub fn noise(seed: u32) -> impl FnMut() -> u32 {
    let mut random = Random::new(seed.into());
    move || random.bits()
}

/// Numbers in [0, 1).
pub fn unit_noise(seed: u32) -> impl FnMut() -> f32 {
    let mut next = noise(seed);
    move || (next() >> 8) as f32 / 16_777_216.0
}

/// Whether two numbers differ by at most this share of the larger, or this much.
#[track_caller]
pub fn assert_near(got: f32, want: f64, relative: f64, absolute: f64, what: &str) {
    let allowed = (want.abs() * relative).max(absolute);
    assert!((f64::from(got) - want).abs() <= allowed, "{what}: {got} is not {want}");
}

impl Lab {
    pub fn new() -> Lab {
        Lab { card: Recorder::new("program") }
    }

    /// A buffer of this many words, zero, whole rows of the readback.
    pub fn words(&mut self, words: u64) -> BufferId {
        self.card.create_buffer("", 4 * words.next_multiple_of(ROW))
    }

    /// A buffer with these words.
    pub fn buffer(&mut self, words: &[u32]) -> BufferId {
        let id = self.words(words.len() as u64);
        self.card.write_buffer(id, 0, "data", bytes(words));
        id
    }

    /// A compute pipeline of a module's only entry point, its layout derived.
    pub fn compute(&mut self, source: &str) -> ComputePipelineId {
        let shader = self.card.create_shader("program", source);
        self.card.create_compute_pipeline("", None, record::stage(shader))
    }

    /// A bind group for a derived layout: resources by binding number.
    pub fn group(
        &mut self,
        pipeline: AnyPipeline,
        index: u32,
        resources: impl IntoIterator<Item = BoundResource>,
    ) -> BindGroupId {
        let layout = self.card.get_bind_group_layout(pipeline, index);
        self.card.create_bind_group(layout, (0..).zip(resources))
    }

    /// Dispatches a pipeline with these resources as group 0.
    pub fn dispatch(
        &mut self,
        pipeline: ComputePipelineId,
        groups: [u32; 3],
        resources: impl IntoIterator<Item = BoundResource>,
    ) {
        let group = self.group(AnyPipeline::Compute(pipeline), 0, resources);
        let mut pass = self.card.begin_compute_pass();
        pass.set_pipeline(pipeline);
        pass.set_bind_group(0, group);
        pass.dispatch(groups[0], groups[1], groups[2]);
    }

    /// Shows the first words of a buffer as a frame.
    pub fn show_buffer(&mut self, buffer: BufferId, words: u64) {
        let rows = words.div_ceil(ROW) as u32;
        let texture = self.card.create_texture("", record::texture_2d(ROW as u32, rows, Format::R32Uint));
        let layout = LinearLayout { offset: 0, bytes_per_row: Some(4 * ROW as u32), rows_per_image: None };
        self.card.copy_buffer_to_texture(buffer, layout, whole(texture), [ROW as u32, rows, 1]);
        self.card.present(texture);
    }

    /// Runs the recording; the bytes of each frame.
    pub fn frames(self) -> Result<Vec<Vec<u8>>, TraceError> {
        let trace = self.card.finish();
        let mut frames = Vec::new();
        render::render(&trace, &Options::default(), &mut |event| {
            if let Event::EndFrame(end) = event {
                frames.push(end.reference.to_vec());
            }
            Ok(())
        })?;
        Ok(frames)
    }

    /// Runs the recording; the words of its only frame, or of the last.
    pub fn last_frame(self) -> Vec<u32> {
        let frames = self.frames().unwrap_or_else(|error| panic!("{error}"));
        let last = frames.last().expect("a frame");
        last.chunks_exact(4).map(|b| u32::from_le_bytes([b[0], b[1], b[2], b[3]])).collect()
    }

    /// Runs the recording; the first words of a buffer at its end.
    pub fn read(mut self, buffer: BufferId, words: u64) -> Vec<u32> {
        self.show_buffer(buffer, words);
        let mut out = self.last_frame();
        out.truncate(words as usize);
        out
    }

    /// Uses a module's only entry point, which must fail: it is compiled, and no workgroup runs. The message.
    pub fn refusal_of(mut self, shader: ShaderId) -> String {
        let pipeline = self.card.create_compute_pipeline("", None, record::stage(shader));
        self.dispatch(pipeline, [0, 1, 1], []);
        self.refusal()
    }

    /// Runs the recording, which must fail; the message.
    pub fn refusal(self) -> String {
        match self.frames() {
            Ok(_) => panic!("the recording was accepted"),
            Err(error) => error.to_string(),
        }
    }
}

/// All of a texture's first level.
pub fn whole(texture: TextureId) -> TextureEnd {
    TextureEnd { texture, level: 0, origin: [0; 3], aspect: Default::default() }
}

/// Runs a program once: binding 0 takes `results` words, the other bindings hold `inputs` in order.
pub fn run(source: &str, groups: [u32; 3], results: u64, inputs: &[&[u32]]) -> Vec<u32> {
    let mut lab = Lab::new();
    let result = lab.words(results);
    let mut resources = vec![record::whole(result)];
    for input in inputs {
        let buffer = lab.buffer(input);
        resources.push(record::whole(buffer));
    }
    let pipeline = lab.compute(source);
    lab.dispatch(pipeline, groups, resources);
    lab.read(result, results)
}

/// A vertex stage that covers the target with one triangle.
pub const COVER: &str = "
    @vertex fn cover(@builtin(vertex_index) i: u32) -> @builtin(position) vec4f {
        return vec4f(f32(i & 1u) * 4.0 - 1.0, f32(i >> 1u) * 4.0 - 1.0, 0.5, 1.0);
    }
";

/// Runs a fragment stage once for each pixel of a target, with these resources as group 0; the target's words.
pub fn paint(lab: Lab, source: &str, size: [u32; 2], format: Format, resources: Vec<BoundResource>) -> Vec<u32> {
    let mut lab = lab;
    let target = lab.card.create_texture("target", record::texture_2d(size[0], size[1], format));
    let view = lab.card.create_view(target);
    let shader = lab.card.create_shader("program", &format!("{source}{COVER}"));
    let pipeline = lab.card.create_render_pipeline("program", record::render_pipeline(shader, format));
    let group = (!resources.is_empty()).then(|| lab.group(AnyPipeline::Render(pipeline), 0, resources));
    {
        let mut pass = lab.card.begin_render_pass([record::clear(view, [0.0; 4])], None);
        pass.set_pipeline(pipeline);
        if let Some(group) = group {
            pass.set_bind_group(0, group);
        }
        pass.draw(3, 1);
    }
    lab.card.present(target);
    lab.last_frame()
}
