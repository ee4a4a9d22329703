//! Draws and instances outside the view volume, found by bounds ahead of everything that is done with their vertices.
//!
//! The vertex program is run on ranges (`shader::Encloser`): an attribute may be anything that the vertices of the draw hold in memory,
//! and so may indices be; instance attributes and numbers are ranges for a draw and single values for an instance. Where the clip
//! positions that come out lie outside one plane of the view volume, by the comparisons of `gfx::clip`, all primitives would have been
//! rejected there: none of them is set up, and no pixel and no count of samples can tell.
//!
//! What could show the difference is never tested: programs with side effects, programs that see which invocations are shaded beside them
//! (subgroups), and what a pipeline statistics query counts. Nor is what the test reads changed before the draw is over: only such programs could.
//!
//! Bounds of indices and attributes are kept for as long as the contents of their buffers stay what they are.

use std::collections::HashMap;

use gfx::state::{IndexFormat, StepMode, VertexFormat};
use num::{LANES, Lanes};
use shader::{BuiltIn, Encloser, InputRegister, Range};
use work::{Cull, Culling};

use super::super::pipeline::PipelineStage;
use super::{BufferRange, DrawCall};

/// Entries after which what is known of buffers is forgotten.
const KEPT: usize = 1 << 14;

/// Vertices between the least and the greatest index, beside four for every index, up to which attributes are looked at: scattered
/// indices have bounds that say little and take long to find.
const SPREAD: u64 = 4096;

/// Part of a buffer and the version of its contents.
#[derive(Clone, Copy, PartialEq, Eq, Hash)]
struct Contents {
    address: u64,
    size: u64,
    version: u64,
}

impl Contents {
    fn of(range: &BufferRange) -> Contents {
        Contents { address: range.address, size: range.size, version: range.version }
    }
}

#[derive(Clone, Copy, PartialEq, Eq, Hash)]
struct IndexKey {
    contents: Contents,
    format: IndexFormat,
    first: u32,
    count: u32,
    restart: Option<u32>,
}

#[derive(Clone, Copy, PartialEq, Eq, Hash)]
struct AttributeKey {
    contents: Contents,
    format: VertexFormat,
    offset: u64,
    stride: u64,
    vertices: (u32, u32),
}

/// Known ranges of the contents of buffers, and memory to find more.
#[derive(Default)]
pub struct Boxes {
    /// Least and greatest index; none where there are none.
    indices: HashMap<IndexKey, Option<(u32, u32)>>,
    attributes: HashMap<AttributeKey, [Range; 4]>,
    encloser: Encloser,
}

/// A draw that is to be tested.
pub struct Candidate<'a> {
    pub call: &'a DrawCall<'a>,
    /// Index that ends a strip.
    pub restart: Option<u32>,
    /// Primitives of an instance, and entries of its stream.
    pub primitives: u64,
    pub entries: u64,
}

/// The instances of a draw that may be seen, and what the tests came to.
pub struct VisibleInstances {
    pub instances: Vec<std::ops::Range<u64>>,
    pub culling: Culling,
}

/// An input and its known range.
type KnownInput = (InputRegister, Range);

impl Candidate<'_> {
    /// All instances.
    fn all(&self) -> std::ops::Range<u64> {
        let first = u64::from(self.call.range.first_instance);
        first..first + u64::from(self.call.range.instances)
    }

    /// Tests the draw, and its instances where that is asked for and there are several.
    pub fn test(&self, boxes: &mut Boxes) -> VisibleInstances {
        let all = self.all();
        let mut seen = VisibleInstances { instances: vec![all.clone()], culling: Culling::default() };
        let Some(mut given) = self.vertices(boxes) else { return seen };
        let known = given.len();
        seen.culling.tests += 1;
        self.instance_ranges(boxes, all.clone(), &mut given);
        if self.outside(boxes, &given) == Some(true) {
            seen.instances.clear();
            seen.culling.draws += 1;
        } else if self.call.options.key.cull == Cull::Instances && self.call.range.instances > 1 {
            seen.instances.clear();
            self.test_each(boxes, &mut given, known, &mut seen);
        }
        let kept: u64 = seen.instances.iter().map(|run| run.end - run.start).sum();
        seen.culling.instances = all.end - all.start - kept;
        seen.culling.primitives = seen.culling.instances * self.primitives;
        seen.culling.vertices = seen.culling.instances * self.entries;
        seen
    }

    /// Tests every instance on its own. Where the first has no bounds, none of them is thought to have any.
    fn test_each(&self, boxes: &mut Boxes, given: &mut Vec<KnownInput>, known: usize, seen: &mut VisibleInstances) {
        let all = self.all();
        let mut fetched = Vec::new();
        for instance in all.clone() {
            let lane = ((instance - all.start) % LANES as u64) as usize;
            if lane == 0 {
                self.fetch_instances(instance, &mut fetched);
            }
            given.truncate(known);
            given.extend(fetched.iter().map(|(register, lanes)| (*register, Range::point(lanes.0[lane]))));
            let number = instance as u32;
            self.builtins(BuiltIn::InstanceIndex, Range::point(number), given);
            seen.culling.tests += 1;
            let outside = self.outside(boxes, given);
            if outside.is_none() && instance == all.start {
                seen.instances.push(all);
                return;
            }
            if outside != Some(true) {
                match seen.instances.last_mut() {
                    Some(run) if run.end == instance => run.end += 1,
                    _ => seen.instances.push(instance..instance + 1),
                }
            }
        }
    }

    /// Whether all positions lie outside one plane. None if the positions have no known bounds.
    fn outside(&self, boxes: &mut Boxes, given: &[KnownInput]) -> Option<bool> {
        let vertex = self.call.vertex();
        let program = &vertex.stage.program;
        if !boxes.encloser.enclose(program, &vertex.resources, vertex.uniforms, given) {
            return None;
        }
        let mut ends = [(0.0, 0.0); 4];
        for (c, ends) in ends.iter_mut().enumerate() {
            *ends = boxes.encloser.output(program, self.call.pipeline.position, c).ends()?;
        }
        Some(self.call.clip.rejects(ends))
    }

    /// The known ranges of the inputs that come from vertices. None if nothing is known.
    fn vertices(&self, boxes: &mut Boxes) -> Option<Vec<KnownInput>> {
        let Candidate { call, .. } = self;
        let ends = match call.index {
            None => (call.range.first, call.range.first.checked_add(call.range.count - 1)?),
            Some(index) => {
                let key = IndexKey {
                    contents: Contents::of(&index.range),
                    format: index.format,
                    first: call.range.first,
                    count: call.range.count,
                    restart: self.restart,
                };
                let find = || {
                    let indices = index.buffer();
                    let numbers = (0..key.count).map(|at| indices.at(key.first.wrapping_add(at)));
                    numbers.filter(|&number| Some(number) != key.restart).fold(None, |ends: Option<(u32, u32)>, number| {
                        Some(ends.map_or((number, number), |(a, b)| (a.min(number), b.max(number))))
                    })
                };
                let (least, greatest) = remembered(&mut boxes.indices, key, find)?;
                let moved = |number: u32| u32::try_from(i64::from(number) + i64::from(call.range.base_vertex)).ok();
                (moved(least)?, moved(greatest)?)
            }
        };
        if u64::from(ends.1 - ends.0) > 4 * u64::from(call.range.count) + SPREAD {
            return None;
        }
        let mut given = Vec::new();
        self.attributes(boxes, StepMode::Vertex, ends, &mut given);
        self.builtins(BuiltIn::VertexIndex, Range::unsigned(ends.0, ends.1), &mut given);
        self.builtins(BuiltIn::BaseVertex, Range::point(call.base_vertex()), &mut given);
        self.builtins(BuiltIn::BaseInstance, Range::point(call.range.first_instance), &mut given);
        self.builtins(BuiltIn::DrawIndex, Range::point(call.range.draw_index), &mut given);
        Some(given)
    }

    /// Appends the known ranges of the inputs that come from instances, over all instances of a draw.
    fn instance_ranges(&self, boxes: &mut Boxes, all: std::ops::Range<u64>, given: &mut Vec<KnownInput>) {
        // Instance numbers beyond 32 bits begin again.
        let Ok(last) = u32::try_from(all.end - 1) else { return };
        let ends = (all.start as u32, last);
        self.attributes(boxes, StepMode::Instance, ends, given);
        self.builtins(BuiltIn::InstanceIndex, Range::unsigned(ends.0, ends.1), given);
    }

    /// Bounds of the attributes of vertices (or instances) from the first to the last.
    fn attributes(&self, boxes: &mut Boxes, step: StepMode, ends: (u32, u32), given: &mut Vec<KnownInput>) {
        let Candidate { call, .. } = self;
        for attribute in &call.pipeline.attributes {
            let (program, source) = (&call.vertex().stage.program, call.source(attribute));
            let read = |c: usize| program.input_register(attribute.input, c);
            if attribute.step != step || (0..attribute.components).all(|c| read(c).is_none()) {
                continue;
            }
            let find = || {
                let mut ranges: Option<[Range; 4]> = None;
                let mut lanes = [Lanes::ZERO; 4];
                let mut first = u64::from(ends.0);
                while first <= u64::from(ends.1) {
                    let n = (u64::from(ends.1) - first + 1).min(LANES as u64) as usize;
                    let numbers = std::array::from_fn(|i| first as u32 + i.min(n - 1) as u32);
                    source.fetch(attribute.format, attribute.offset, &numbers, n, &mut lanes);
                    let here: [Range; 4] = std::array::from_fn(|c| Range::all(&lanes[c].0[..n]));
                    ranges = Some(ranges.map_or(here, |all| std::array::from_fn(|c| all[c].join(here[c]))));
                    first += n as u64;
                }
                ranges.unwrap_or([Range::ANY; 4])
            };
            let contents = call.vertex_buffers.get(attribute.buffer).and_then(Option::as_ref).map(Contents::of);
            let ranges = match contents {
                Some(contents) => {
                    let (format, offset, stride) = (attribute.format, attribute.offset, attribute.stride);
                    let key = AttributeKey { contents, format, offset, stride, vertices: ends };
                    remembered(&mut boxes.attributes, key, find)
                }
                None => find(),
            };
            given.extend((0..attribute.components).filter_map(|c| Some((read(c)?, ranges[c]))));
        }
    }

    /// The instance attributes of up to 64 instances, a lane each.
    fn fetch_instances(&self, first: u64, fetched: &mut Vec<(InputRegister, Lanes)>) {
        let program = &self.call.vertex().stage.program;
        fetched.clear();
        let numbers = std::array::from_fn(|i| (first as u32).wrapping_add(i as u32));
        for attribute in &self.call.pipeline.attributes {
            if attribute.step == StepMode::Instance {
                let mut lanes = [Lanes::ZERO; 4];
                self.call.source(attribute).fetch(attribute.format, attribute.offset, &numbers, LANES, &mut lanes);
                let read =
                    (0..attribute.components).filter_map(|c| program.input_register(attribute.input, c).zip(Some(lanes[c])));
                fetched.extend(read);
            }
        }
    }

    /// Gives a built-in value to the inputs that ask for it.
    fn builtins(&self, builtin: BuiltIn, range: Range, given: &mut Vec<KnownInput>) {
        let PipelineStage { program, builtins } = self.call.vertex().stage;
        let asked = builtins.iter().filter(|(_, asked)| *asked == builtin);
        given.extend(asked.filter_map(|&(slot, _)| Some((program.input_register(slot, 0)?, range))));
    }
}

/// The value that is remembered for a key, or that is found now. Tests do both, so that contents which changed unnoticed are seen.
fn remembered<K: Copy + Eq + std::hash::Hash, V: Copy + PartialEq + std::fmt::Debug>(
    known: &mut HashMap<K, V>,
    key: K,
    find: impl Fn() -> V,
) -> V {
    if let Some(&value) = known.get(&key) {
        debug_assert!(value == find(), "contents of a buffer have changed and its version has not");
        return value;
    }
    if known.len() >= KEPT {
        known.clear();
    }
    let value = find();
    known.insert(key, value);
    value
}

/// Whether a draw outside the view may be left out: no other result of the trace depends on it.
pub fn may_cull(call: &DrawCall<'_>) -> bool {
    let company = |(_, builtin): &(usize, BuiltIn)| *builtin == BuiltIn::SubgroupInvocationId;
    call.options.key.cull != Cull::None
        && !call.pipeline.has_side_effects()
        && call.pipeline.stages().all(|stage| !stage.interface().subgroups)
        && !call.fragment().is_some_and(|bound| bound.stage.builtins.iter().any(company))
}
