//! The cost of a run: instructions by class and memory requests, for each quad separately.

use std::collections::HashMap;

use super::RECORDED_PAUSE;
use crate::program::Body;
use crate::scalar::Counted;
use gfx::format::TexelClass;
use gfx::texture::Footprint;
use num::{Lanes, Mask, QUADS};
use work::{
    Class, Cost, CostId, CostTable, InFlight, Invocations, LINE, Point, RenderKey, Request, RequestKind, Service, Span, Step,
};

/// What one quad of the last recorded run cost.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct QuadCost {
    /// Entry of [`Recorder::costs`].
    pub cost: CostId,
    /// First of its requests in [`Recorder::requests`]; their number is that of the cost's steps with a request.
    pub first_request: u32,
    /// First of its accesses to workgroup memory in [`Recorder::shared`].
    pub first_shared: u32,
}

/// What a recorder keeps only where it is requested.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Extra {
    /// The paths that were taken through the program.
    pub paths: bool,
    /// Texels of the second level of samples between two levels where it has no weight.
    pub both_levels: bool,
    /// Instructions that work on four components, instead of those that work on one.
    pub vectors: bool,
}

impl Extra {
    /// What a key asks for.
    pub fn of(key: &RenderKey) -> Extra {
        Extra { paths: key.paths, both_levels: key.needless.levels, vectors: key.vectors }
    }
}

/// Collects costs and memory requests. It belongs to one thread's piece of work; the caller takes `costs`, `requests` and
/// `lines` out of it (with [`Recorder::take`]) when the piece is done.
#[derive(Debug, Default)]
pub struct Recorder {
    /// The costs found, each once.
    pub costs: CostTable,
    /// Requests, in order of runs, quads and steps.
    pub requests: Vec<Request>,
    /// Lines of the requests, in order of runs.
    pub lines: Vec<u32>,
    /// Accesses to workgroup memory, in order of runs, quads and steps, whose lines are entries of `words`.
    pub shared: Vec<Request>,
    /// Words of workgroup memory.
    pub words: Vec<u32>,
    /// The quads of the last run.
    pub quads: [QuadCost; QUADS],
    /// What is recorded beside what counts always.
    pub extra: Extra,
    /// Bytes that have been charged to a meter.
    pub(super) told: u64,
    /// Bytes of runs that are charged though they are not kept: those of runs that took much memory for a while, or that were stopped.
    pub(super) passed: u64,
    known: HashMap<Cost, CostId>,
    /// The cost that was found last.
    last: CostId,
    /// Requests and lines of the last piece of work. The next one reserves memory for as many, because lists that grow are copied.
    room: [usize; 2],
    /// Spans in the table, by where they begin.
    spans: HashMap<u32, u32>,
}

/// Lines of a request at most. A quad touches at most 4 lanes x 320 texels of a level, neighbours; more distinct lines are cut off.
const MOST_LINES: usize = 255;

/// What a run in progress has cost so far.
///
/// Quads stay together as long as all instructions with a request or a branch have had lanes in the same quads. What they have executed is
/// then recorded once, as that of quad 0, and requests are recorded row by row. Where quads part, each gets a copy.
#[derive(Debug, Default)]
pub(super) struct Scratch {
    /// First operation not yet accounted.
    last: usize,
    /// The quads that go together, by their first lanes; none before the first has come.
    together: Mask,
    /// Whether quads have parted.
    parted: bool,
    /// Whether uniform buffers were read.
    constants: bool,
    running: [Running; QUADS],
    steps: [Vec<Step>; QUADS],
    /// Requests of the quads that go together, step by step.
    rows: Vec<[Request; QUADS]>,
    /// Requests of quads that have parted.
    staged: [Vec<Request>; QUADS],
    /// Accesses of quads to workgroup memory, which part quads, and their words.
    shared: [Vec<Request>; QUADS],
    words: Vec<u32>,
    /// Whether paths are recorded, the path of each quad by the place where its spans begin, and the spans.
    keeps_paths: bool,
    /// Whether instructions work on four components.
    vectors: bool,
    paths: [Vec<Point>; QUADS],
    spans: Vec<Span>,
    /// How many spans stand before those of the program.
    ahead: u32,
    /// The lines of all requests, and the texture instruction being recorded.
    pub(super) footprint: Footprint,
    /// What the last texture access gave; none before the first.
    pub(super) texels: Option<Box<[Lanes; 4]>>,
}

/// What all invocations of a draw or dispatch share, as each warp does it: its loads, then instructions.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct SharedWork {
    pub loads: Vec<SharedLoad>,
    pub counted: Counted,
}

/// A load of one line.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct SharedLoad {
    pub line: u32,
    /// Whether it is from a uniform buffer.
    pub constant: bool,
    /// What is read of the line, as [`Request::words`] or [`Request::halves`] have it.
    pub part: u16,
}

/// What a quad has executed since its last request.
#[derive(Clone, Copy, Debug)]
struct Running {
    counted: Counted,
    in_flight: InFlight,
}

impl Default for Running {
    fn default() -> Running {
        Running { counted: Counted::default(), in_flight: InFlight::ANY }
    }
}

impl Running {
    #[inline(always)]
    fn add(&mut self, counted: &Counted, in_flight: InFlight) {
        self.counted.add(counted);
        self.in_flight = self.in_flight.and(in_flight);
    }
}

/// No request.
const NONE: Request = Request { first_line: 0, lines: 0, operations: 0, texel: TexelClass::Bytes, loads: false };

/// The first lanes of the quads that have a lane in the mask.
#[inline(always)]
fn firsts(mask: Mask) -> Mask {
    super::run::quads_of(mask) & 0x1111_1111_1111_1111
}

/// The quads that have a lane in the mask.
#[inline(always)]
fn quads(mask: Mask) -> impl Iterator<Item = usize> {
    (0..QUADS).filter(move |q| mask >> (4 * q) & 15 != 0)
}

impl Recorder {
    /// An empty recorder.
    pub fn new() -> Recorder {
        Recorder::default()
    }

    /// An empty recorder, which records `extra` as well.
    pub fn with(extra: Extra) -> Recorder {
        Recorder { extra, ..Recorder::default() }
    }

    /// Bytes of the requests and lines that were collected.
    pub fn bytes(&self) -> u64 {
        let shared = size_of_val(&*self.shared) + size_of_val(&*self.words);
        (size_of_val(&*self.requests) + size_of_val(&*self.lines) + shared) as u64
    }

    /// Bytes that count against a limit. They depend on what was run, not on when this is called.
    pub(super) fn metered(&self) -> u64 {
        self.bytes() + self.passed
    }

    /// Bytes that were not charged to a meter ([`BoundProgram::within`](super::BoundProgram::within)); the caller charges them.
    pub fn take_bytes(&mut self) -> u64 {
        let bytes = self.metered();
        bytes.saturating_sub(std::mem::replace(&mut self.told, bytes))
    }

    /// Takes out accesses to workgroup memory, and their words.
    pub fn take_shared(&mut self) -> (Vec<Request>, Vec<u32>) {
        (std::mem::take(&mut self.shared), std::mem::take(&mut self.words))
    }

    /// Takes out what was collected and leaves an empty recorder with its memory for the next piece of work.
    pub fn take(&mut self) -> Invocations {
        self.known.clear();
        self.spans.clear();
        (self.told, self.passed) = (0, 0);
        self.room = [self.requests.len(), self.lines.len()];
        let Recorder { costs, requests, lines, .. } = self;
        Invocations { costs: std::mem::take(costs), requests: std::mem::take(requests), lines: std::mem::take(lines) }
    }
}

impl Scratch {
    /// Forgets the last run. A run of the lanes of the mask begins with what all invocations share, which each warp computes and loads like
    /// everything else. (Instructions on four components count it elsewhere.)
    pub(super) fn begin(&mut self, extra: Extra, shared: &SharedWork, mask: Mask) {
        self.last = 0;
        self.keeps_paths = extra.paths;
        self.vectors = extra.vectors;
        self.footprint.both_levels = extra.both_levels;
        if self.parted {
            self.spans.clear();
            self.running = Default::default();
        }
        self.forget();
        self.running[0] = Running::default();
        self.constants = false;
        (self.together, self.parted, self.ahead) = (0, extra.paths, 0);
        if !extra.vectors && mask != 0 && *shared != SharedWork::default() {
            self.begin_shared(shared, mask);
        }
    }

    /// Records what all invocations of the mask share.
    fn begin_shared(&mut self, shared: &SharedWork, mask: Mask) {
        let mut load = Counted::default();
        load.instructions[Class::Integer as usize] = 1;
        for &SharedLoad { line, constant, part } in &shared.loads {
            let first_line = self.footprint.lines.len() as u32;
            self.footprint.lines.extend([line, !u32::from(part)]);
            self.count(&load, InFlight::ANY, mask);
            self.path_begins(&load, InFlight::ANY, mask);
            let kind = if constant { RequestKind::Constant } else { RequestKind::Load };
            self.requests(kind, mask, |_, _| Request { first_line, lines: 1, operations: 1, ..NONE });
        }
        let mut loaded = InFlight::ANY;
        for load in &shared.loads {
            loaded[if load.constant { Service::Constant } else { Service::Texture }] = 0;
        }
        self.count(&shared.counted, loaded, mask);
        self.path_begins(&shared.counted, loaded, mask);
    }

    /// Adds instructions to the quads of the mask.
    #[inline(always)]
    fn count(&mut self, spent: &Counted, in_flight: InFlight, mask: Mask) {
        if self.goes_together(mask) {
            self.running[0].add(spent, in_flight);
            return;
        }
        for q in quads(mask) {
            self.running[q].add(spent, in_flight);
        }
    }

    /// Where paths are recorded, one begins with instructions that stand before the program.
    fn path_begins(&mut self, counted: &Counted, in_flight: InFlight, mask: Mask) {
        if !self.keeps_paths {
            return;
        }
        let runs = Class::ALL.into_iter().map(|class| (class, counted.instructions[class as usize]));
        let span = self.spans.len() as u32;
        let runs = runs.filter(|&(_, count)| count > 0).collect();
        let lines = vec![(0, counted.instructions.iter().sum())];
        self.spans.push(Span { at: span, runs, lines, chain: counted.chain });
        self.ahead = span + 1;
        for q in quads(mask) {
            self.paths[q].push(Point { span, in_flight, then: RequestKind::End });
        }
    }

    /// Whether the quads of the mask, which is not empty, are those that stay together. If not, all have parted.
    #[inline(always)]
    fn goes_together(&mut self, mask: Mask) -> bool {
        if self.parted {
            return false;
        }
        let quads = firsts(mask);
        if self.together == 0 {
            self.together = quads;
        }
        if self.together != quads {
            self.part();
        }
        !self.parted
    }

    /// Gives each quad what they have in common.
    #[cold]
    fn part(&mut self) {
        self.parted = true;
        let (running, steps) = (std::mem::take(&mut self.running[0]), std::mem::take(&mut self.steps[0]));
        for q in quads(self.together) {
            self.running[q] = running;
            self.steps[q].clone_from(&steps);
            self.staged[q].extend(self.rows.iter().map(|row| row[q]));
        }
        self.rows.clear();
    }

    /// How many quads the first of the lists stands for.
    fn shares(&self) -> usize {
        if self.parted { 1 } else { self.together.count_ones() as usize }
    }

    /// Accounts the operations from the last place up to `pc` to the quads of the mask.
    #[inline(always)]
    pub(super) fn block(&mut self, body: &Body, pc: usize, mask: Mask) {
        let counts = if self.vectors { &body.vectors } else { &body.counts };
        let (from, to) = (counts[self.last], counts[pc]);
        let in_flight = body.in_flight[self.last];
        if self.keeps_paths {
            self.point((counts, &body.lines), pc, mask, in_flight);
        }
        self.last = pc;
        if mask == 0 {
            return;
        }
        let spent = to.since(&from);
        self.count(&spent, in_flight, mask);
    }

    /// The quads of the mask execute the span from the last place up to `pc`.
    #[cold]
    fn point(&mut self, (counts, lines_of): (&[Counted], &[u32]), pc: usize, mask: Mask, in_flight: InFlight) {
        if mask == 0 {
            return;
        }
        let at = self.ahead + self.last as u32;
        let known = self.spans.iter().position(|span| span.at == at);
        let span = known.unwrap_or_else(|| {
            let (mut runs, mut lines) = (Vec::<(Class, u32)>::new(), Vec::<(u32, u32)>::new());
            for (operation, &line) in counts[self.last..=pc].windows(2).zip(&lines_of[self.last..]) {
                let own: u32 = operation[1].since(&operation[0]).instructions.iter().sum();
                match lines.iter_mut().find(|(known, _)| *known == line) {
                    Some((_, sum)) => *sum += own,
                    None if own > 0 => lines.push((line, own)),
                    None => {}
                }
                for class in Class::ALL {
                    let count = operation[1].since(&operation[0]).instructions[class as usize];
                    match runs.last_mut() {
                        Some((last, sum)) if *last == class => *sum += count,
                        _ if count > 0 => runs.push((class, count)),
                        _ => {}
                    }
                }
            }
            self.spans.push(Span { at, runs, lines, chain: counts[pc].since(&counts[self.last]).chain });
            self.spans.len() - 1
        });
        for q in quads(mask) {
            self.paths[q].push(Point { span: span as u32, in_flight, then: RequestKind::End });
        }
    }

    /// Bytes that the run has collected so far.
    pub(super) fn bytes(&self) -> u64 {
        self.kept() + self.passing()
    }

    /// Bytes that count against a limit: those that the recorder keeps at the end of the run, and those of the run itself beyond a free amount.
    pub(super) fn metered(&self) -> u64 {
        self.kept() + self.passed()
    }

    /// Those of the run itself beyond a free amount.
    fn passed(&self) -> u64 {
        self.passing().saturating_sub(RECORDED_PAUSE)
    }

    /// Bytes of requests and lines, which the recorder keeps.
    fn kept(&self) -> u64 {
        let staged: usize = self.staged.iter().chain(&self.shared).map(|staged| size_of_val(&**staged)).sum();
        let staged = staged + size_of_val(&*self.words);
        let rows = self.shares() * self.rows.len() * size_of::<Request>();
        (staged + rows + size_of_val(&*self.footprint.lines)) as u64
    }

    /// Bytes of steps and paths, of which the recorder keeps one of each kind.
    #[inline(always)]
    fn passing(&self) -> u64 {
        if !self.parted {
            return (self.shares() * size_of_val(&*self.steps[0])) as u64;
        }
        let steps: usize = self.steps.iter().map(|steps| size_of_val(&**steps)).sum();
        let paths: usize = self.paths.iter().map(|path| size_of_val(&**path)).sum();
        (steps + paths) as u64
    }

    /// Forgets what the run has collected; it may go on.
    pub(super) fn forget(&mut self) {
        if self.parted {
            self.steps.iter_mut().for_each(Vec::clear);
            self.staged.iter_mut().for_each(Vec::clear);
            self.shared.iter_mut().for_each(Vec::clear);
            self.words.clear();
            self.paths.iter_mut().for_each(Vec::clear);
        }
        self.steps[0].clear();
        self.rows.clear();
        self.footprint.lines.clear();
    }

    /// Execution goes on at `pc`.
    #[inline]
    pub(super) fn jump(&mut self, pc: usize) {
        self.last = pc;
    }

    /// The loads of a run whose quads have stayed together, one for each line, in order.
    pub(super) fn loads_together(&self) -> impl Iterator<Item = SharedLoad> + '_ {
        let asking = self.steps[0].iter().filter(|step| step.then.has_request());
        asking.zip(&self.rows).flat_map(|(step, row)| {
            let (request, lines) = (row[0], &self.footprint.lines);
            let constant = step.then == RequestKind::Constant;
            (0..u32::from(request.lines)).map(move |k| {
                let at = request.first_line as usize + k as usize;
                let part =
                    if constant { !lines[at + usize::from(request.lines)] as u16 } else { request.halves(lines, k).into() };
                SharedLoad { line: lines[at], constant, part }
            })
        })
    }

    /// Ends the current step of the quads of the mask.
    fn step(&mut self, q: usize, then: RequestKind) {
        let Running { counted: Counted { instructions, chain }, in_flight } = std::mem::take(&mut self.running[q]);
        self.steps[q].push(Step { instructions, chain, in_flight, then });
        if let Some(point) = self.paths[q].last_mut() {
            point.then = then;
        }
    }

    /// A barrier, at which all quads of the mask arrive.
    pub(super) fn barrier(&mut self, mask: Mask) {
        if mask != 0 && self.goes_together(mask) {
            self.step(0, RequestKind::Barrier);
        } else {
            quads(mask).for_each(|q| self.step(q, RequestKind::Barrier));
        }
    }

    /// Ends a step of each quad of the mask with its request, which `of` makes.
    #[inline(always)]
    fn requests(&mut self, kind: RequestKind, mask: Mask, mut of: impl FnMut(&mut Footprint, usize) -> Request) {
        self.constants |= kind == RequestKind::Constant;
        if mask != 0 && self.goes_together(mask) {
            let mut row = [NONE; QUADS];
            for q in quads(mask) {
                row[q] = of(&mut self.footprint, q);
            }
            self.rows.push(row);
            self.step(0, kind);
            return;
        }
        for q in quads(mask) {
            let request = of(&mut self.footprint, q);
            self.step(q, kind);
            self.staged[q].push(request);
        }
    }

    /// A memory request of the quads of the mask: `address` gives the first byte each lane touches, `bytes` how many.
    pub(super) fn request(
        &mut self,
        kind: RequestKind,
        mask: Mask,
        words: u8,
        address: impl Fn(usize) -> Option<u64>,
        bytes: u64,
    ) {
        self.requests(kind, mask, |Footprint { lines, .. }, q| {
            let first = lines.len();
            let mut moved = 0u32;
            for i in 4 * q..4 * q + 4 {
                if mask >> i & 1 == 0 {
                    continue;
                }
                let Some(a) = address(i) else { continue };
                moved += u32::from(words);
                for line in a / LINE..=(a + bytes.max(1) - 1) / LINE {
                    if !lines[first..].contains(&(line as u32)) {
                        lines.push(line as u32);
                    }
                }
            }
            let count = (lines.len() - first).min(MOST_LINES);
            lines.truncate(first + count);
            // What is read of each line.
            let parts = match kind {
                RequestKind::Constant => count,
                RequestKind::Load => count.div_ceil(8),
                RequestKind::Texture
                | RequestKind::Store
                | RequestKind::Atomic
                | RequestKind::Shared
                | RequestKind::Barrier
                | RequestKind::End => 0,
            };
            lines.resize(first + count + parts, !0);
            for i in (4 * q..4 * q + 4).filter(|i| parts > 0 && mask >> i & 1 != 0) {
                let Some(a) = address(i) else { continue };
                let end = a + bytes.max(1) - 1;
                for line in a / LINE..=end / LINE {
                    let Some(at) = lines[first..first + count].iter().position(|&known| known == line as u32) else { continue };
                    if kind == RequestKind::Load {
                        let half = |byte: u64| 1 << (byte.clamp(line * LINE, line * LINE + LINE - 1) % LINE / (LINE / 2));
                        lines[first + count + at / 8] &= !((half(a) | half(end)) << (2 * (at % 8)));
                    } else if line == a / LINE {
                        lines[first + count + at] &= !(1 << (a % LINE / 4));
                    }
                }
            }
            Request { first_line: first as u32, lines: count as u8, operations: moved.clamp(1, 255) as u8, ..NONE }
        });
    }

    /// An access to workgroup memory by the lanes of the mask: `address` gives the first byte of each, and each moves a number of words. The
    /// words that atomics change are those of all lanes, because each is changed once for each lane.
    pub(super) fn shared(&mut self, mask: Mask, words: u8, atomic: bool, address: impl Fn(usize) -> u64) {
        if !self.parted {
            self.part();
        }
        for q in quads(mask) {
            let first = self.words.len();
            for i in (4 * q..4 * q + 4).filter(|i| mask >> i & 1 != 0) {
                let word = (address(i) / 4) as u32;
                if atomic || !self.words[first..].contains(&word) {
                    self.words.push(word);
                }
            }
            let (lines, operations) = ((self.words.len() - first) as u8, if atomic { 0 } else { words });
            self.shared[q].push(Request { first_line: first as u32, lines, operations, ..NONE });
            self.step(q, RequestKind::Shared);
        }
    }

    /// Puts the requests to uniform buffers behind all others, at the end of a run.
    #[cold]
    fn constants_last(&mut self) {
        fn last<T: Copy>(steps: &[Step], requests: &mut [T]) {
            let asking = steps.iter().filter(|step| step.then.has_request());
            let mut marked: Vec<_> =
                asking.map(|step| step.then == RequestKind::Constant).zip(requests.iter().copied()).collect();
            marked.sort_by_key(|&(constant, _)| constant);
            requests.iter_mut().zip(marked).for_each(|(request, (_, sorted))| *request = sorted);
        }
        if self.parted {
            self.steps.iter().zip(&mut self.staged).for_each(|(steps, staged)| last(steps, staged));
        } else {
            last(&self.steps[0], &mut self.rows);
        }
    }

    /// A texture request of the quads of the mask, which was recorded in the footprint.
    #[inline(always)]
    pub(super) fn footprint_request(&mut self, mask: Mask) {
        #[inline(always)]
        fn of(footprint: &Footprint, q: usize) -> Request {
            let (lines, operations) = footprint.range(q);
            let (texel, loads) = footprint.texel();
            Request {
                first_line: lines.start,
                lines: lines.len().min(MOST_LINES) as u8,
                operations: operations.clamp(1, 255) as u8,
                texel,
                loads,
            }
        }
        if mask != 0 && self.goes_together(mask) {
            // Those of other quads are never read: without a branch for each, the compiler makes vectors.
            self.rows.push(std::array::from_fn(|q| of(&self.footprint, q)));
            self.step(0, RequestKind::Texture);
            return;
        }
        self.requests(RequestKind::Texture, mask, |footprint, q| of(footprint, q));
    }
}

impl Recorder {
    /// Ends all quads of a run and interns their costs, with the host's widest vectors.
    #[inline(always)]
    pub(super) fn finish(&mut self, run: &mut Scratch) {
        gfx::simd::dispatch!(_simd => self.finish_here(run));
    }

    #[inline(always)]
    fn finish_here(&mut self, run: &mut Scratch) {
        self.passed += run.passed();
        if self.lines.capacity() == 0 && !run.footprint.lines.is_empty() {
            let [requests, lines] = self.room.map(|room| room + room / 4);
            self.requests.reserve_exact(requests);
            self.lines.reserve_exact(lines);
        }
        let first_line = self.lines.len() as u32;
        self.lines.extend_from_slice(&run.footprint.lines);
        if run.constants {
            run.constants_last();
        }
        if !run.parted {
            return self.finish_together(run, first_line);
        }
        let first_word = self.words.len() as u32;
        self.words.extend_from_slice(&run.words);
        for q in 0..QUADS {
            run.step(q, RequestKind::End);
            let first_request = self.requests.len() as u32;
            let staged = run.staged[q].iter();
            self.requests.extend(staged.map(|r| Request { first_line: first_line + r.first_line, ..*r }));
            let first_shared = self.shared.len() as u32;
            let shared = run.shared[q].iter();
            self.shared.extend(shared.map(|r| Request { first_line: first_word + r.first_line, ..*r }));
            let mut cost = Cost::default();
            if !run.paths[q].is_empty() {
                self.name_spans(&run.spans, &mut run.paths[q]);
                std::mem::swap(&mut cost.path, &mut run.paths[q]);
            }
            let cost = match q.checked_sub(1) {
                Some(p) if !run.keeps_paths && run.steps[p] == run.steps[q] => self.quads[p].cost,
                _ => {
                    // The key borrows the memory of the steps and the path, so that a path that is known costs no allocation.
                    std::mem::swap(&mut cost.steps, &mut run.steps[q]);
                    let id = self.intern(&cost);
                    std::mem::swap(&mut cost.steps, &mut run.steps[q]);
                    std::mem::swap(&mut cost.path, &mut run.paths[q]);
                    id
                }
            };
            self.quads[q] = QuadCost { cost, first_request, first_shared };
        }
    }

    /// The same where the quads have gone together. Costs get their numbers in the order of the quads.
    #[inline(always)]
    fn finish_together(&mut self, run: &mut Scratch, first_line: u32) {
        run.step(0, RequestKind::End);
        let together = run.together;
        let mut costs = [0; 2];
        for runs in [together & 1 != 0, together & 1 == 0] {
            if runs && together != 0 || !runs && together != firsts(!0) {
                costs[usize::from(runs)] = self.intern_shared(run, runs);
            }
        }
        let (first, each) = (self.requests.len(), run.rows.len());
        if together == firsts(!0) {
            for (q, quad) in self.quads.iter_mut().enumerate() {
                *quad = QuadCost { cost: costs[1], first_request: (first + q * each) as u32, first_shared: 0 };
            }
            if each == 1 {
                let moved = |request: Request| Request { first_line: first_line + request.first_line, ..request };
                self.requests.extend_from_slice(&run.rows[0].map(moved));
                return;
            }
        }
        let mut next = first as u32;
        for (q, quad) in self.quads.iter_mut().enumerate() {
            let runs = together >> (4 * q) & 1;
            *quad = QuadCost { cost: costs[runs as usize], first_request: next, first_shared: 0 };
            next += runs as u32 * each as u32;
        }
        // Row by row, each request is put to those of its quad.
        self.requests.resize(next as usize, NONE);
        for (at, row) in run.rows.iter().enumerate() {
            let mut place = first + at;
            for q in 0..QUADS {
                if together >> (4 * q) & 1 != 0 {
                    self.requests[place] = Request { first_line: first_line + row[q].first_line, ..row[q] };
                    place += each;
                }
            }
        }
    }

    /// The cost of the quads that have stayed together, or that of the others, which have executed nothing.
    fn intern_shared(&mut self, run: &mut Scratch, runs: bool) -> CostId {
        // The list of the others is empty and stays empty.
        let steps = &mut run.steps[usize::from(!runs)];
        if !runs {
            steps.push(Step::dependent([0; Class::COUNT], RequestKind::End));
        }
        let mut cost = Cost { steps: std::mem::take(steps), ..Cost::default() };
        let id = self.intern(&cost);
        if !runs {
            cost.steps.clear();
        }
        *steps = cost.steps;
        id
    }

    fn intern(&mut self, cost: &Cost) -> CostId {
        // Most are like the one before.
        if self.costs.costs.get(usize::from(self.last)).is_some_and(|last| last == cost) {
            return self.last;
        }
        self.last = match self.known.get(cost) {
            Some(&id) => id,
            None if self.costs.costs.len() > usize::from(CostId::MAX) => self.nearest(cost),
            None => {
                let id = self.costs.costs.len() as CostId;
                self.costs.costs.push(cost.clone());
                self.known.insert(cost.clone(), id);
                id
            }
        };
        self.last
    }

    /// Gives the spans of a run's path their numbers in the table.
    #[cold]
    fn name_spans(&mut self, spans: &[Span], path: &mut [Point]) {
        for point in path {
            let span = &spans[point.span as usize];
            point.span = *self.spans.entry(span.at).or_insert_with(|| {
                self.costs.spans.push(span.clone());
                self.costs.spans.len() as u32 - 1
            });
        }
    }

    /// For a full table: of the known costs with the same number of requests, the one with the nearest instructions.
    fn nearest(&self, cost: &Cost) -> CostId {
        let wanted = cost.requests();
        let total = |c: &Cost| c.instructions().iter().sum::<u32>();
        let t = total(cost);
        (0..self.costs.costs.len())
            .filter(|&i| self.costs.costs[i].requests() == wanted)
            .min_by_key(|&i| total(&self.costs.costs[i]).abs_diff(t))
            .unwrap_or(0) as CostId
    }
}
