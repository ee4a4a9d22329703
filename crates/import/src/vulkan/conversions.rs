//! Dispatches that write what native commands read, where the program has it in another form: indices, conditions, results of queries.
//! They run before the pass that waits.

use num::{BindGroupLayoutId, BufferId, ComputePipelineId};
use trace::command::*;
use trace::record::{self, Recorder};

use super::fault::{Outcome, unsupported};
use super::machine::Vulkan;

/// What all of them have.
const HEAD: &str = "
struct Values { first: u32, count: u32, bits: u32, flag: u32, instances: u32, base: u32, first_instance: u32 }
var<immediate> values: Values;
@group(0) @binding(0) var<storage, read> source: array<u32>;
@group(0) @binding(1) var<storage, read> condition: array<u32>;
@group(0) @binding(2) var<storage, read_write> result: array<u32>;
fn index(at: u32) -> u32 {
    let bit = at * values.bits;
    return (source[bit / 32] >> (bit % 32)) & (0xffffffffu >> (32 - values.bits));
}
";

/// Indices of 8 bits become such of 16. `flag`: the largest one ends primitives.
const BYTES: &str = "
@compute @workgroup_size(64) fn main(@builtin(global_invocation_id) id: vec3u) {
    if id.x * 2 >= values.count { return; }
    var word = 0u;
    for (var half = 0u; half < 2; half++) {
        var own = index(values.first + id.x * 2 + half);
        if values.flag != 0 && own == 255 { own = 65535; }
        word |= own << (half * 16);
    }
    result[id.x] = word;
}
";

/// Indices of lists that end primitives are cut, with the primitives that they leave unfinished. `flag`: indices for each primitive. The
/// arguments of the draw come first.
const LISTS: &str = "
@compute @workgroup_size(1) fn main() {
    var kept = 0u;
    for (var at = 0u; at < values.count; at++) {
        let own = index(values.first + at);
        if own == 0xffffffffu >> (32 - values.bits) {
            kept -= kept % values.flag;
        } else {
            result[8 + kept] = own;
            kept++;
        }
    }
    result[0] = kept - kept % values.flag;
    result[1] = values.instances;
    result[2] = 0;
    result[3] = values.base;
    result[4] = values.first_instance;
}
";

/// Words that are zero unless a condition holds. `flag`: it is inverted.
const CONDITION: &str = "
@compute @workgroup_size(1) fn main() {
    let holds = (condition[0] != 0) != (values.flag != 0);
    for (var at = 0u; at < values.count; at++) {
        result[at] = select(0u, source[at], holds);
    }
}
";

/// Results of queries in 64 bits go where the program wants them. `bits`: results of each query; `flag`: those of `VkQueryResultFlags`;
/// `base`: words from one query to the next.
const RESULTS: &str = "
@compute @workgroup_size(64) fn main(@builtin(global_invocation_id) id: vec3u) {
    if id.x >= values.count { return; }
    var to = values.first + id.x * values.base;
    for (var at = 0u; at <= values.bits; at++) {
        var own = vec2u(1, 0);
        if at < values.bits {
            let low = (id.x * values.bits + at) * 2;
            own = vec2u(source[low], source[low + 1]);
        } else if (values.flag & 4) == 0 {
            return;
        }
        if (values.flag & 1) != 0 {
            result[to] = own.x;
            result[to + 1] = own.y;
            to += 2;
        } else {
            result[to] = select(own.x, 0xffffffffu, own.y != 0);
            to++;
        }
    }
}
";

/// What is converted.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Task {
    Bytes,
    Lists,
    Condition,
    Results,
}

/// Words that a dispatch reads besides buffers, as the shaders' `Values`.
#[derive(Clone, Copy, Default)]
struct Values {
    first: u32,
    count: u32,
    bits: u32,
    flag: u32,
    instances: u32,
    base: u32,
    first_instance: u32,
}

/// A range of a buffer: first byte, bytes.
type Range = (BufferId, u64, u64);

/// Pipelines of conversions, and what they have written for the pass that waits.
#[derive(Default)]
pub struct Conversions {
    known: Vec<(Task, ComputePipelineId, BindGroupLayoutId)>,
    written: Vec<BufferId>,
}

/// The workgroups that this number of invocations needs.
fn workgroups(invocations: u64) -> Outcome<u32> {
    let groups = invocations.div_ceil(64);
    if groups > trace::check::WORKGROUPS_MAX.into() {
        return unsupported(format!("a conversion of {invocations} words"));
    }
    Ok(groups as u32)
}

/// The words that hold a range, which native bindings can be.
fn words((buffer, offset, size): Range) -> BoundResource {
    let first = offset - offset % 4;
    BoundResource::Buffer { buffer, offset: first, size: Some((offset + size - first).next_multiple_of(4).max(4)) }
}

impl Conversions {
    fn pipeline(&mut self, task: Task, card: &mut Recorder) -> (ComputePipelineId, BindGroupLayoutId) {
        if let Some(&(_, id, layout)) = self.known.iter().find(|(known, ..)| *known == task) {
            return (id, layout);
        }
        let text = match task {
            Task::Bytes => BYTES,
            Task::Lists => LISTS,
            Task::Condition => CONDITION,
            Task::Results => RESULTS,
        };
        let shader = card.create_shader("conversion", &format!("{HEAD}{text}"));
        let storage = |read_only| BindingKind::Storage { read_only, dynamic_offset: false };
        let layout = card.create_bind_group_layout([(0, storage(true)), (1, storage(true)), (2, storage(false))]);
        let whole = card.create_pipeline_layout([layout], 28);
        let id = card.create_compute_pipeline("conversion", Some(whole), record::stage_entry(shader, "main"));
        self.known.push((task, id, layout));
        (id, layout)
    }

    fn run(&mut self, task: Task, [source, condition, target]: [Range; 3], values: Values, groups: u32, card: &mut Recorder) {
        let (pipeline, layout) = self.pipeline(task, card);
        let bound = [source, condition, target].map(words);
        let group = card.create_bind_group(layout, (0..).zip(bound));
        let Values { first, count, bits, flag, instances, base, first_instance } = values;
        let mut pass = card.begin_compute_pass();
        pass.set_pipeline(pipeline);
        pass.set_bind_group(0, group);
        pass.set_immediates(0, &[first, count, bits, flag, instances, base, first_instance]);
        pass.dispatch(groups, 1, 1);
        drop(pass);
        card.push(Command::Destroy(Object::BindGroup(group)));
    }

    fn target(&mut self, bytes: u64, card: &mut Recorder) -> Range {
        let id = card.create_buffer("converted", bytes);
        self.written.push(id);
        (id, 0, bytes)
    }

    /// Ends what was written for a pass, which has ended.
    pub fn end(&mut self, card: &mut Recorder) {
        self.written.drain(..).for_each(|buffer| card.push(Command::Destroy(Object::Buffer(buffer))));
    }
}

/// A draw with indices of lists, as its arguments say.
pub struct ListDraw {
    pub first: u32,
    pub count: u32,
    pub base: i32,
    pub first_instance: u32,
    pub instances: u32,
}

impl Vulkan {
    /// A buffer of indices of 16 bits from a range of such of 8 bits. The largest one ends primitives if `restart` is set.
    pub fn wide_indices(&mut self, source: Range, restart: bool) -> Outcome<BufferId> {
        let (_, offset, size) = source;
        let groups = workgroups(size.div_ceil(2))?;
        let target = self.conversions.target((2 * size).next_multiple_of(4).max(4), &mut self.card);
        let (first, count) = ((offset % 4) as u32, size as u32);
        let values = Values { first, count, bits: 8, flag: restart.into(), ..Values::default() };
        // The last word may hold one index.
        let padded = (source.0, offset, size + 1);
        self.conversions.run(Task::Bytes, [padded, padded, target], values, groups, &mut self.card);
        Ok(target.0)
    }

    /// The arguments of a draw, and from byte 32 on its indices of 32 bits: those of lists of `each` indices without the ones that end primitives.
    pub fn list_indices(&mut self, source: Range, bytes: u32, each: u32, draw: &ListDraw) -> Outcome<BufferId> {
        let (buffer, offset, size) = source;
        let count = draw.count;
        let target = self.conversions.target(32 + 4 * u64::from(count), &mut self.card);
        let own = (buffer, offset + u64::from(draw.first) * u64::from(bytes), u64::from(count) * u64::from(bytes));
        debug_assert!(own.1 + own.2 <= offset + size);
        let values = Values {
            first: (own.1 % 4) as u32 / bytes,
            count,
            bits: 8 * bytes,
            flag: each,
            instances: draw.instances,
            base: draw.base as u32,
            first_instance: draw.first_instance,
        };
        self.conversions.run(Task::Lists, [own, own, target], values, 1, &mut self.card);
        self.log.note("indices that end primitives in lists are cut by a dispatch before the pass".to_owned());
        Ok(target.0)
    }

    /// A buffer with these words, or with zeros unless a condition holds.
    pub fn conditional(&mut self, words: Range, (buffer, offset, inverted): (BufferId, u64, bool)) -> BufferId {
        let target = self.conversions.target(words.2, &mut self.card);
        let values = Values { count: (words.2 / 4) as u32, flag: inverted.into(), ..Values::default() };
        self.conversions.run(Task::Condition, [words, (buffer, offset, 4), target], values, 1, &mut self.card);
        target.0
    }

    /// Writes results of queries, of which a set has 64 bits each, in the form of `VkQueryResultFlags`.
    pub fn write_results(
        &mut self,
        (set, first, count): (num::QuerySetId, u32, u32),
        results: u32,
        flags: u32,
        stride: u64,
        target: Range,
    ) -> Outcome {
        let groups = workgroups(count.into())?;
        let from = self.conversions.target(8 * u64::from(results) * u64::from(count), &mut self.card);
        self.card.resolve_queries(set, first, count, from.0, 0);
        let values = Values { count, bits: results, flag: flags, base: (stride / 4) as u32, ..Values::default() };
        self.conversions.run(Task::Results, [from, from, target], values, groups, &mut self.card);
        self.conversions.end(&mut self.card);
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use num::Words;
    use shader::{BufferRange, Executor, Module, ModuleSource, Options, Resource, Resources, Stage, compile};

    use super::*;

    fn resource(words: &Words) -> Resource<'_> {
        Resource::Buffer(BufferRange { words, offset: 0, size: words.len(), address: 0 })
    }

    /// What a conversion leaves in this number of words.
    fn run(text: &str, source: &[u32], condition: u32, values: [u32; 7], words: usize) -> Vec<u32> {
        let module = Module::new("conversion", ModuleSource::Wgsl(&format!("{HEAD}{text}"))).expect("a module");
        let program = compile(&module, Stage::Compute, Some("main"), &Options::default()).expect("a program");
        let filled = |all: &[u32]| {
            let buffer = Words::new(all.len() as u64 * 4);
            all.iter().enumerate().for_each(|(at, &word)| buffer.store(at, word));
            buffer
        };
        let buffers = [filled(source), filled(&[condition]), filled(&vec![7; words])];
        let bound: Vec<Vec<Resource<'_>>> =
            program.interface().bindings.iter().map(|at| vec![resource(&buffers[at.binding as usize])]).collect();
        let resources = Resources { bindings: &bound, immediates: &values, ..Resources::default() };
        let uniforms = program.uniforms(&resources);
        let mut executor = Executor::new();
        executor.bind(&program, &resources, &uniforms).run_groups(0..1, [1, 1, 1], None).expect("it ends");
        (0..words).map(|at| buffers[2].load(at)).collect()
    }

    #[test]
    fn indices_of_8_bits_become_16() {
        let source = [u32::from_le_bytes([9, 1, 2, 255]), 3];
        assert_eq!(run(BYTES, &source, 0, [1, 4, 8, 1, 0, 0, 0], 3), [2 << 16 | 1, 3 << 16 | 0xffff, 7]);
        assert_eq!(run(BYTES, &source, 0, [1, 4, 8, 0, 0, 0, 0], 3), [2 << 16 | 1, 3 << 16 | 255, 7]);
    }

    #[test]
    fn lists_lose_the_primitives_that_an_index_cuts() {
        let source = [1u16, 2, 0xffff, 3, 4, 5, 6, 7].map(u32::from);
        let source: Vec<u32> = source.chunks(2).map(|pair| pair[0] | pair[1] << 16).collect();
        let written = run(LISTS, &source, 0, [0, 8, 16, 3, 2, u32::MAX, 4], 12);
        assert_eq!(written[..5], [3, 2, 0, u32::MAX, 4]);
        assert_eq!(written[8..11], [3, 4, 5]);
        let words = [8, 9, u32::MAX];
        assert_eq!(run(LISTS, &words, 0, [0, 3, 32, 2, 1, 0, 0], 11)[8..], [8, 9, 7]);
    }

    #[test]
    fn a_condition_leaves_words_or_zeros() {
        for (condition, inverted, holds) in [(0, 0, false), (4, 0, true), (0, 1, true), (4, 1, false)] {
            let words = run(CONDITION, &[5, 6], condition, [0, 2, 0, inverted, 0, 0, 0], 3);
            assert_eq!(words, if holds { [5, 6, 7] } else { [0, 0, 7] });
        }
    }

    #[test]
    fn results_of_queries_take_the_form_that_is_asked_for() {
        let results = [5, 0, 6, 1];
        assert_eq!(run(RESULTS, &results, 0, [0, 2, 1, 0, 0, 1, 0], 3), [5, u32::MAX, 7]);
        assert_eq!(run(RESULTS, &results, 0, [0, 2, 1, 4, 0, 3, 0], 6), [5, 1, 7, u32::MAX, 1, 7]);
        assert_eq!(run(RESULTS, &results, 0, [0, 2, 1, 5, 0, 4, 0], 8), [5, 0, 1, 0, 6, 1, 1, 0]);
        assert_eq!(run(RESULTS, &results, 0, [0, 1, 2, 0, 0, 2, 0], 3), [5, u32::MAX, 7]);
    }
}
