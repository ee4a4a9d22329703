//! A multithreaded SIMT core: holds warps, issues their instructions by class, and hides what memory takes behind other warps.

mod account;
mod issue;
#[cfg(test)]
mod plain;
mod shared;
mod turns;

use super::card::{Card, Fault};
use super::token::WarpToken;
use super::warp::Execution;
use account::{Full, Hours};
use gfx::stage::{Stage, StageMap};
use issue::{Fixed, Issue, PLACES, bits};
use knob::Allowed;
use num::{Cycle, NEVER};
use shared::{SHARED, SharedMemory};
use sim::{Counted, In, Out, Tick, Unit, Wires};
use stats::{Cycles, Heading};
use turns::Turns;
use work::{Class, InFlight, RequestKind, Service, ServiceMap, Step};

knob::choices! {
    /// Which of the ready warps issues.
    pub enum Scheduling {
        /// The next after the one that issued last.
        RoundRobin "round-robin",
        /// The one that has been in the core longest.
        Oldest "oldest",
    }
}

knob::choices! {
    /// What an instruction works on.
    pub enum Instructions {
        /// One component.
        Scalar "scalar",
        /// Up to four: of one code, none of which needs another; dot products too. An instruction of one component is issued beside another.
        Vector "vector",
    }
}

knob::knobs! {
    /// A shader core.
    pub struct CoreConfig {
        /// Cores in each pipeline.
        per_pipeline: u32 ["cores", Allowed::Range(1, 8), "four multiprocessors a cluster (NVIDIA 2014, GeForce GTX 980 white paper, p. 6)"]
            {estimate: Used, relax: Units("twice the cores, texture units and texture caches"), advice: []},
        /// Whether these cores also shade vertices; if not, there are vertex cores.
        unified: bool ["", Allowed::Switch, "unified since 2006"]
            {estimate: Used, relax: Never, advice: []},
        /// Vertex cores, where they are separate.
        vertex_cores: u32 ["cores", Allowed::Range(1, 32), "assumed; ATTILA bGPU.ini NumVertexShaders = 8"]
            {estimate: Used, relax: Never, advice: []},
        /// Warps that a vertex core holds.
        vertex_warps: u32 ["warps", Allowed::Range(1, 64), "assumed; ATTILA bGPU.ini VERTEXSHADER ExecutableThreads = 12"]
            {estimate: UsedBy("core.of_vertices"), relax: Room, advice: []},
        /// Warp instructions that a vertex core issues per cycle.
        vertex_issue: u32 ["instructions/cycle", Allowed::Range(1, 8), "assumed; ATTILA bGPU.ini VERTEXSHADER FetchRate = 1"]
            {estimate: UsedBy("core.of_vertices"), relax: Rate, advice: []},
        /// Invocations of a warp.
        warp_width: u32 ["invocations", Allowed::PowerOfTwo(4, 64), "NVIDIA 32, AMD 64 or 32, Intel 8 to 32, ATTILA 64 (VectorLength 16 of stamps)"]
            {estimate: Used, relax: Never, advice: []},
        /// Warps that a core holds. A workgroup of more runs in turns.
        warps: u32 ["warps", Allowed::Range(1, 64), "NVIDIA 64 an SM until 2016, 48 or 32 since; AMD 40 a CU"]
            {estimate: Used, relax: Room, advice: []},
        /// 32-bit registers of a core, which bound the warps further. A workgroup that asks for more runs in turns.
        registers: u32 ["registers", Allowed::Range(256, 1048576), "65,536 an SM since 2012"]
            {estimate: UsedBy("core.resident_warps"), relax: Room, advice: []},
        /// Registers that a warp takes at once: it gets a multiple of them.
        register_granule: u32 ["registers", Allowed::Range(1, 4096), "256 since 2012 (NVIDIA, CUDA occupancy calculator: allocation unit size)"]
            {estimate: UsedBy("core.resident_warps"), relax: Never, advice: []},
        /// Parts of a core that have equal shares of its registers, so that a core holds a multiple of as many warps of one kind.
        register_files: u32 ["files", Allowed::PowerOfTwo(1, 8), "one a scheduler, four since 2012 (NVIDIA, CUDA occupancy calculator: warp allocation granularity)"]
            {estimate: UsedBy("core.resident_warps"), relax: Never, advice: []},
        /// Bytes of workgroup memory of a core.
        shared_bytes: u32 ["bytes", Allowed::Range(16384, 1048576), "96 KB (NVIDIA 2014, GeForce GTX 980 white paper, p. 9); WebGPU asks for 16 KB"]
            {estimate: Ignored("cycles hardly depend on it"), relax: Never, advice: []},
        /// Warp instructions issued per cycle.
        issue: u32 ["instructions/cycle", Allowed::Range(1, 8), "four schedulers an SM since 2012"]
            {estimate: Used, relax: Rate, advice: []},
        /// Single-precision invocations executed per cycle.
        float_lanes: u32 ["lanes", Allowed::Range(1, 512), "128 an SM of 2014 and 2016, 192 of 2012"]
            {estimate: Used, relax: Rate, advice: []},
        /// Integer invocations executed per cycle.
        integer_lanes: u32 ["lanes", Allowed::PowerOfTwo(1, 512), "assumed: 64 or 128 an SM"] {estimate: Used, relax: Rate, advice: []},
        /// Transcendental invocations executed per cycle.
        special_lanes: u32 ["lanes", Allowed::PowerOfTwo(1, 512), "32 an SM of 2014, a quarter of the others"]
            {estimate: Used, relax: Rate, advice: []},
        /// Branches and barriers executed per cycle.
        control_lanes: u32 ["lanes", Allowed::PowerOfTwo(1, 512), "assumed: as integers"] {estimate: Used, relax: Rate, advice: []},
        /// Multiplications of 32-bit integers, with a sum, executed per cycle.
        multiply_lanes: u32 ["lanes", Allowed::Range(1, 512), "0.29 of the lanes of single precision on a GTX 980, 0.20 on an RX 570 (clpeak: 1,446 and 1,032 billion operations/s)"]
            {estimate: Used, relax: Rate, advice: []},
        /// Cycles from a single-precision instruction to one that needs its result.
        float_latency: u32 ["cycles", Allowed::Range(1, 63), "6 on Maxwell, 4 on Volta and Turing (Jia et al. 2019, table 4.1)"]
            {estimate: Used, relax: Latency, advice: []},
        /// Cycles from an integer instruction to one that needs its result.
        integer_latency: u32 ["cycles", Allowed::Range(1, 63), "6 on Maxwell, 4 on Volta and Turing (Jia et al. 2019, table 4.1)"]
            {estimate: Used, relax: Latency, advice: []},
        /// Cycles from a transcendental instruction to one that needs its result.
        special_latency: u32 ["cycles", Allowed::Range(1, 63), "14 on Maxwell (Jia et al. 2019, table 4.1: MUFU)"]
            {estimate: Used, relax: Latency, advice: []},
        /// Cycles from a multiplication of integers to an instruction that needs its result.
        multiply_latency: u32 ["cycles", Allowed::Range(1, 127), "86 on Maxwell, where it is a sequence of products of 16 bits; 5 on Volta and Turing (Jia et al. 2019, table 4.1)"]
            {estimate: Used, relax: Latency, advice: []},
        /// Cycles from a warp's branch to its next instruction.
        control_latency: u32 ["cycles", Allowed::Range(1, 63), "assumed: fetch of the target"] {estimate: Used, relax: Latency, advice: []},
        /// Whether an instruction waits for those only whose results it needs; if not, for the one before it.
        scoreboard: bool ["", Allowed::Switch, "in order, with dependences by registers, in cards since 2001: one warp of four independent chains issues four times as often as of one (gpu-benches: V100)"]
            {estimate: Used, relax: Never, advice: []},
        /// Whether a warp that has two instructions that do not need each other issues both in a cycle; `core.issue` counts warps then.
        dual_issue: bool ["", Allowed::Switch, "NVIDIA, \"Kepler GK110\" white paper: four schedulers of two dispatch units for 192 lanes; off: one instruction each"]
            {estimate: Used, relax: Never, advice: []},
        /// Whether an instruction of one class is issued while the lanes of another still take one in. If not, `core.issue` is 1.
        overlap: bool ["", Allowed::Switch, "lanes of a class have ports of their own in cards; ATTILA fetches when all invocations of an instruction have begun (VectorShaderFetch)"]
            {estimate: Used, relax: Never, advice: []},
        /// Requests of a warp to memory, and to workgroup memory, that may be unanswered while it goes on with what does not need them.
        in_flight: u32 ["requests", Allowed::Range(1, 63), "63 are counted on GCN (\"Southern Islands ISA\": VM_CNT); six barriers, each of up to 63 loads, on Maxwell (maxas)"]
            {estimate: Used, relax: Never, advice: []},
        /// Cycles from an access to workgroup memory without conflicts to an instruction that needs its result.
        shared_latency: u32 ["cycles", Allowed::Range(1, 256), "23 on Maxwell, 24 on Pascal, 19 on Volta and Turing (Jia et al. 2019, table 3.1)"]
            {estimate: Used, relax: Latency, advice: []},
        /// Banks of workgroup memory, each of which has a word for a warp in a cycle. Invocations that read the same word share it.
        shared_banks: u32 ["banks", Allowed::PowerOfTwo(1, 64), "32 of 4 bytes since 2010 (NVIDIA, CUDA C Programming Guide, \"Shared Memory\")"]
            {estimate: Used, relax: Never, advice: []},
        /// Which of the ready warps issues.
        scheduling: Scheduling ["", Allowed::Choice(Scheduling::NAMES), "loose round robin; greedy-then-oldest is the other (Rogers et al. 2012)"]
            {estimate: Ignored("cycles hardly depend on it"), relax: Never, advice: []},
        /// What a warp executes where its parts take different paths, and in which order. All but `longest` have the renderer
        /// record paths.
        execution: Execution ["", Allowed::Choice(Execution::NAMES), "cards execute in lockstep (Levinthal and Porter 1984) and nearly in order; longest needs no paths, and docs/fidelity.md has what it is off by"]
            {estimate: RefusedUnless(Is(&["longest"]), "the paths that quads take"), relax: Never, advice: []},
        /// What an instruction works on. Vectors have the renderer record other costs.
        instructions: Instructions ["", Allowed::Choice(Instructions::NAMES), "scalar since 2006; vectors of four in cards before and in ATTILA (VectorALUConfig = simd4+scalar)"]
            {estimate: RefusedUnless(Is(&["scalar"]), "instructions on several components"), relax: Never, advice: []},
        /// Shaded warps queued behind each core.
        output_queue: u32 ["warps", Allowed::Range(2, 256), "assumed: enough never to hold up the core"]
            {estimate: Ignored("cycles hardly depend on it"), relax: Room, advice: []},
    }
}

impl CoreConfig {
    /// The core that shades vertices: a vertex core, where they are separate.
    pub fn of_vertices(&self) -> CoreConfig {
        let own = if self.unified { (self.warps, self.issue) } else { (self.vertex_warps, self.vertex_issue) };
        CoreConfig { warps: own.0, issue: own.1, ..self.clone() }
    }

    /// Invocations executed per cycle, by class.
    pub fn lanes(&self) -> [u32; Class::COUNT] {
        [self.float_lanes, self.integer_lanes, self.special_lanes, self.control_lanes, self.multiply_lanes]
    }

    /// Registers of a warp whose invocations have a number of them.
    pub fn registers_of(&self, registers: u32) -> u32 {
        (registers * self.warp_width).max(1).next_multiple_of(self.register_granule.max(1))
    }

    /// Registers that warps that get `each` leave over in all register files of a core. None where one warp needs more than a file has:
    /// such warps use what all files have together.
    pub fn left_over(&self, each: u32) -> u32 {
        let files = self.register_files.max(1);
        let fit = self.registers / files / each;
        if fit == 0 { 0 } else { self.registers - fit * files * each }
    }

    /// Warps that a core has at most, where their invocations have a number of registers. One fits always.
    pub fn resident_warps(&self, registers: u32) -> u32 {
        let each = self.registers_of(registers);
        ((self.registers - self.left_over(each)) / each).clamp(1, self.warps)
    }

    /// Cycles from an instruction to one that needs its result, by class.
    pub fn latencies(&self) -> [u32; Class::COUNT] {
        [self.float_latency, self.integer_latency, self.special_latency, self.control_latency, self.multiply_latency]
    }
}

/// Ports of a core.
#[derive(Clone, Default)]
pub struct CorePorts {
    /// Warps of each stage, and where they go when shaded. What goes on is the number of a fragment warp, of a batch of vertices, or of a
    /// workgroup.
    pub stages: StageMap<Option<(In<WarpToken>, Out<WarpToken>)>>,
    /// Requests to each service that has a unit, and their answers. The texture unit serves requests to those that have none.
    pub services: ServiceMap<Option<(Out<WarpToken>, In<WarpToken>)>>,
}

impl CorePorts {
    /// The ports for these stages and services.
    pub fn new(
        stages: impl IntoIterator<Item = (Stage, Option<(In<WarpToken>, Out<WarpToken>)>)>,
        services: impl IntoIterator<Item = (Service, Option<(Out<WarpToken>, In<WarpToken>)>)>,
    ) -> CorePorts {
        let mut ports = CorePorts::default();
        stages.into_iter().for_each(|(stage, ends)| ports.stages[stage] = ends);
        services.into_iter().for_each(|(service, ends)| ports.services[service] = ends);
        ports
    }

    /// The unit that serves a service. None if it is the core.
    #[inline(always)]
    fn unit_of(&self, service: Service) -> Option<Service> {
        match service {
            Service::Shared => None,
            Service::Texture | Service::Constant if self.services[service].is_some() => Some(service),
            Service::Texture | Service::Constant => Some(Service::Texture),
        }
    }
}

/// The requests of a warp to a texture unit that also serves others: for each service a bit for each request, the oldest in the lowest.
#[derive(Clone, Copy, Debug, Default)]
struct Mixed {
    asked: ServiceMap<u128>,
    requests: u32,
}

impl Mixed {
    fn ask(&mut self, asks: ServiceMap<bool>) {
        self.asked.values_mut().zip(asks.values()).for_each(|(bits, &asks)| *bits |= u128::from(asks) << self.requests);
        self.requests += 1;
    }

    /// The services (0 or 1 request each) that the next answer is from.
    fn answer(&mut self) -> ServiceMap<u8> {
        let answered = ServiceMap::from_fn(|service| (self.asked[service] & 1) as u8);
        self.asked.values_mut().for_each(|bits| *bits >>= 1);
        self.requests -= 1;
        answered
    }
}

/// Stages in the order in which a core takes their warps in: vertices first, since fragments wait for them.
const INTAKE: [Stage; Stage::COUNT] = [Stage::Vertex, Stage::Compute, Stage::Fragment];

/// A warp in the core.
#[derive(Clone, Copy, Debug, Default)]
struct Resident {
    /// Its number in the cluster.
    warp: u32,
    /// Registers it holds.
    registers: u32,
    /// Workgroup memory that it holds for its group.
    shared: u32,
    stage: Stage,
    /// Number of its workgroup or batch.
    number: u32,
    siblings: u32,
}

/// A SIMT core. Its items are instructions of warps.
#[derive(Clone)]
pub struct Core {
    config: CoreConfig,
    cluster: usize,
    ports: CorePorts,
    resident: Vec<Resident>,
    /// All places, and those that hold a warp.
    all: u64,
    held: u64,
    fixed: Fixed,
    issue: Issue,
    /// Instructions of vertices.
    vertex: u64,
    /// Requests of each place that are not answered.
    unanswered: Vec<InFlight>,
    /// Whether the texture unit serves other services too, and then the requests of each place to it that are not answered.
    mixes: bool,
    mixed: Vec<Mixed>,
    /// Places that wait for answers before they go on.
    waiting: u64,
    memory: SharedMemory,
    registers: u32,
    shared: u32,
    /// Warps taken in since the start.
    born: u64,
    /// Steps begun by warps since the start.
    begun: u64,
    hours: Hours,
    /// The workgroup whose warps are being taken in, how many are still to come, and workgroup memory that none of it holds.
    taking: Option<(u32, u32, u32)>,
    /// The workgroup that runs in turns.
    turns: Option<Box<Turns>>,
}

/// The heading of cores in the statistics.
pub const CORES: Heading = Heading::new("shading.core[i]", "Warp instructions by class, and warps held.");

stats::counters! {
    /// Warp instructions issued by a core, and the warps that it held.
    pub struct CoreCounts {
        /// Single-precision.
        float: "instructions",
        /// Integer and bit operations, without multiplications.
        integer: "instructions",
        /// Transcendental.
        special: "instructions",
        /// Branches and barriers.
        control: "instructions",
        /// Multiplications of integers, with the sums that belong to them.
        multiply: "instructions",
        /// Of all these, those of warps of vertices.
        vertex: "instructions",
        /// Of the cycles under `memory`, those in which the oldest warp waited for the texture unit, which also loads from buffers.
        texture_waits: "cycles",
        /// Warps held, summed over the cycles: divided by `slot_cycles`, the occupancy.
        warp_cycles: "cycles",
        /// Slots for warps, summed over the cycles.
        slot_cycles: "cycles",
        /// A warp waited outside: all slots held warps.
        full_warps: "cycles",
        /// A warp waited outside: too few registers were left for it.
        full_registers: "cycles",
        /// A warp waited outside: its workgroup did not fit beside what the core held.
        full_workgroups: "cycles",
    }
}

impl Core {
    /// An idle core, whose warps are those of cluster `cluster`.
    pub fn new(config: CoreConfig, cluster: usize, ports: CorePorts) -> Core {
        assert!((1..=PLACES as u32).contains(&config.warps), "places of warps fit a mask");
        Core {
            cluster,
            mixes: Service::ALL.into_iter().filter(|&service| ports.unit_of(service) == Some(Service::Texture)).count() > 1,
            ports,
            resident: vec![Resident::default(); config.warps as usize],
            all: u64::MAX >> (64 - config.warps),
            held: 0,
            fixed: Fixed::new(&config),
            issue: Issue::new(),
            vertex: 0,
            unanswered: vec![InFlight::NONE; config.warps as usize],
            mixed: vec![Mixed::default(); config.warps as usize],
            waiting: 0,
            memory: SharedMemory::new(&config),
            registers: config.registers,
            shared: config.shared_bytes,
            born: 0,
            begun: 0,
            hours: Hours::default(),
            taking: None,
            turns: None,
            config,
        }
    }

    /// Instructions in all, and those of vertices.
    pub fn instructions(&self) -> (u64, u64) {
        (self.issue.issued.iter().sum(), self.vertex)
    }

    /// The number of steps that warps have begun.
    pub fn begun(&self) -> u64 {
        self.begun
    }

    /// A warp begins its current step.
    #[inline(always)]
    fn enter_step(&mut self, card: &Card, place: u32) {
        self.begun += 1;
        let Resident { warp, stage, .. } = self.resident[place as usize];
        let warp = &card.warps[self.cluster][warp];
        match warp.steps.get(warp.step as usize) {
            Some(step) => {
                if stage.is_geometry() {
                    self.vertex += step.instructions.iter().map(|&count| u64::from(count)).sum::<u64>();
                }
                self.issue.enter(&self.fixed, place, step, warp.order(warp.step));
            }
            None => self.issue.enter(&self.fixed, place, &Step::dependent([0; Class::COUNT], RequestKind::End), &[]),
        }
    }

    /// A warp goes on with its current step, as soon as those requests are answered that the step needs.
    #[inline(always)]
    fn go_on(&mut self, card: &Card, place: u32) {
        if self.may_go_on(card, place) {
            self.waiting &= !(1 << place);
            self.enter_step(card, place);
        } else {
            self.waiting |= 1 << place;
        }
    }

    /// Whether few enough requests of a warp are unanswered for its current step to begin. Before a step that ends the program or leads to a
    /// barrier, and without a scoreboard, none may be unanswered.
    #[inline(always)]
    fn may_go_on(&self, card: &Card, place: u32) -> bool {
        let unanswered = self.unanswered[place as usize];
        if unanswered == InFlight::NONE {
            return true;
        }
        let warp = &card.warps[self.cluster][self.resident[place as usize].warp];
        let step = warp.steps.get(warp.step as usize);
        let needs_all = |step: &&Step| step.then.service().is_none() || !self.config.scoreboard;
        let Some(step) = step.filter(|step| !needs_all(step)) else { return false };
        let most = self.config.in_flight as u8 - 1;
        let may = |unanswered: u8, allowed: u8| unanswered <= allowed.min(most);
        let of_texture = |&service: &Service| self.ports.unit_of(service) == Some(Service::Texture);
        let mixed = || Service::ALL.into_iter().filter(of_texture).map(|service| unanswered[service]).sum();
        (!self.mixes || may(mixed(), u8::MAX))
            && Service::ALL.into_iter().all(|service| may(unanswered[service], step.in_flight[service]))
    }

    /// A request of a warp is answered: it goes on, if it waits for that.
    #[inline(always)]
    fn answered(&mut self, card: &Card, place: u32) {
        if self.waiting >> place & 1 != 0 {
            self.go_on(card, place);
        }
    }

    /// Releases the workgroups all of whose warps wait at a barrier.
    fn release_barriers(&mut self, card: &mut Card) -> bool {
        let mut released = false;
        for place in bits(self.issue.barrier) {
            if self.issue.barrier >> place & 1 == 0 {
                continue;
            }
            let Resident { number, siblings, .. } = self.resident[place as usize];
            let group = bits(self.issue.barrier)
                .filter(|&p| self.resident[p as usize].number == number)
                .fold(0_u64, |mask, p| mask | 1 << p);
            // Warps of the group that have ended do not hold the others up.
            let ended = self
                .taking
                .is_none_or(|(taking, ..)| taking != number)
                .then(|| siblings - bits(self.held).filter(|&p| self.is_of_group(p, number)).count() as u32);
            if ended.is_some_and(|ended| group.count_ones() + ended == siblings) {
                self.issue.barrier &= !group;
                for place in bits(group) {
                    card.warps[self.cluster][self.resident[place as usize].warp].step += 1;
                    self.enter_step(card, place);
                }
                released = true;
            }
        }
        released
    }

    /// The memory of a workgroup is held as long as any of its warps is there or still to come.
    #[cold]
    fn hand_on(&mut self, from: Resident) {
        let sibling = bits(self.held).find(|&place| self.is_of_group(place, from.number));
        match (sibling, &mut self.taking) {
            (Some(place), _) => self.resident[place as usize].shared = from.shared,
            (None, Some((number, _, shared))) if *number == from.number => *shared = from.shared,
            _ => self.shared += from.shared,
        }
    }

    /// Takes warps in from one input while there is room for them.
    #[inline(always)]
    fn take(&mut self, wires: &mut Wires, card: &mut Card, stage: Stage) -> Tick {
        match &self.ports.stages[stage] {
            Some((input, _)) if wires.can_pop(input) => {
                if self.held != self.all {
                    return self.take_in(wires, card, stage);
                }
                self.hours.refuse(Full::Warps);
                Tick::Starved
            }
            _ => Tick::Starved,
        }
    }

    /// [`Core::take`] where a warp is at the head.
    #[inline(never)]
    fn take_in(&mut self, wires: &mut Wires, card: &mut Card, stage: Stage) -> Tick {
        let mut did = Tick::Starved;
        loop {
            let Some((input, _)) = &self.ports.stages[stage] else { return did };
            let Some(token) = wires.front(input) else { return did };
            let free = self.all & !self.held;
            if free == 0 {
                self.hours.refuse(Full::Warps);
                return did;
            }
            let warp = &card.warps[self.cluster][token.warp];
            let (number, siblings) = (warp.number, warp.siblings);
            let registers = self.asked(warp.registers);
            let mut shared = 0;
            let in_turns = self.turns.as_ref().is_some_and(|turns| turns.coming > 0);
            if stage.has_workgroups() && self.taking.is_none() && !in_turns {
                // A workgroup comes whole, since its warps may wait for each other: the places and registers for all of them are
                // there when the first is taken.
                shared = warp.shared_bytes;
                let (asked, has) = (u64::from(shared), u64::from(self.config.shared_bytes));
                if asked > has {
                    let dispatch = card.compute(warp.slot).dispatch.number;
                    card.stop(Fault::Resources { dispatch, what: "workgroup memory", asked, has, key: "core.shared_bytes" });
                    return did.or(Tick::Blocked);
                }
                let all = u64::from(registers) * u64::from(siblings) + u64::from(self.config.left_over(registers));
                if siblings as usize > self.resident.len() || all > u64::from(self.config.registers) {
                    // If the core has too few places or registers for the whole group, the group has the core for itself.
                    if self.held != 0 || self.turns.is_some() {
                        self.hours.refuse(Full::Workgroups);
                        return did;
                    }
                    self.shared -= shared;
                    self.turns = Some(Box::new(Turns::new(number, siblings, shared)));
                    shared = 0;
                } else if self.turns.is_some()
                    || free.count_ones() < siblings
                    || u64::from(self.registers) < all
                    || self.shared < shared
                {
                    self.hours.refuse(Full::Workgroups);
                    return did;
                }
            }
            let Some(held) = self.place_for(registers) else {
                self.hours.refuse(Full::Registers);
                return did;
            };
            self.shared -= shared;
            if let Some(turns) = self.turns.as_mut().filter(|_| stage.has_workgroups()) {
                turns.coming -= 1;
            } else if stage.has_workgroups() {
                shared += self.taking.map_or(0, |(.., left)| left);
                let left = self.taking.map_or(siblings, |(_, left, _)| left) - 1;
                self.taking = (left > 0).then_some((number, left, 0));
            }
            wires.take(input);
            self.settle(card, Resident { warp: token.warp, registers: held, shared, stage, number, siblings });
            did = Tick::Moved;
        }
    }
}

impl Unit<Card> for Core {
    fn tick(&mut self, wires: &mut Wires, card: &mut Card) -> Tick {
        let now = wires.now();

        // 0. Issue instructions for the cycles since the last tick.
        if self.issue.advance(&self.fixed, now) != 0 {
            wires.works();
        }
        self.close_span(now);
        let did = self.act(now, wires, card);
        self.open_span(now);
        did
    }

    fn items(&self) -> u64 {
        self.issue.issued.iter().sum()
    }

    fn resident(&self) -> u64 {
        u64::from(self.held.count_ones()) + self.turns.as_ref().map_or(0, |turns| turns.away() as u64)
    }

    fn account(&self, account: Cycles, cycle: Cycle) -> (Cycles, u64) {
        self.attribute(account, cycle)
    }

    fn counted(groups: &mut Counted<Self>) {
        // Cores that shade nothing but vertices are not counted.
        groups.timed_if(CORES, |unit, cycle| unit.ports.stages[Stage::Fragment].is_some().then(|| unit.counts(cycle)));
        groups.group_if(SHARED, |unit| unit.ports.stages[Stage::Compute].is_some().then(|| unit.memory.counts()));
    }
}

impl Core {
    /// The work of a cycle, after that of the cycles since the last tick.
    #[inline(always)]
    fn act(&mut self, now: Cycle, wires: &mut Wires, card: &mut Card) -> Tick {
        let mut did = Tick::Starved;

        // 1. Warps that are done leave.
        if self.issue.finished != 0 {
            did = did.or(self.leave(wires, card));
        }

        // 2. Answers: the warp goes on with its next step.
        for unit in Service::ALL {
            while let Some(token) = self.ports.services[unit].as_ref().and_then(|(_, answers)| wires.pop(answers)) {
                let place = token.warp;
                let unanswered = &mut self.unanswered[place as usize];
                if unit == Service::Texture && self.mixes {
                    let answered = self.mixed[place as usize].answer();
                    unanswered.values_mut().zip(answered.values()).for_each(|(left, answered)| *left -= answered);
                } else {
                    unanswered[unit] -= 1;
                }
                self.answered(card, place);
                did = Tick::Moved;
            }
        }
        while let Some(place) = self.memory.answer(now) {
            self.unanswered[place as usize][Service::Shared] -= 1;
            self.answered(card, place);
            did = Tick::Moved;
        }

        // 3. Warps whose latency is over are ready; the core issues.
        if self.issue.advance(&self.fixed, now + 1) == now + 1 {
            did = Tick::Moved;
        }

        // 4. Warps at the end of a step ask services, or wait for their group.
        while self.issue.asking != 0 {
            let place = self.issue.choose(&self.fixed, self.issue.asking);
            let number = self.resident[place as usize].warp;
            let apart = card.warps[self.cluster][number].apart;
            let asks = if apart {
                shared::asks(card, self.cluster, number)
            } else {
                ServiceMap::from_fn(|service| service == Service::Texture)
            };
            let mut units = ServiceMap::<bool>::default();
            for service in Service::ALL.into_iter().filter(|&service| asks[service]) {
                if let Some(unit) = self.ports.unit_of(service) {
                    units[unit] = true;
                }
            }
            let ports = &self.ports.services;
            let takes = |unit: Service| ports[unit].as_ref().is_none_or(|(requests, _)| wires.can_push(requests));
            if !Service::ALL.into_iter().filter(|&unit| units[unit]).all(takes) {
                did = did.or(Tick::Blocked);
                self.hours.stuck = true;
                break;
            }
            for unit in Service::ALL.into_iter().filter(|&unit| units[unit]) {
                let Some((requests, _)) = &ports[unit] else { continue };
                wires.push(requests, WarpToken { warp: number });
                // The unit finds the warp by its number, and answers with its place.
                let warp = &mut card.warps[self.cluster][number];
                warp.place = place;
                warp.asked[unit].push_back(warp.step);
            }
            self.unanswered[place as usize].values_mut().zip(asks.values()).for_each(|(left, &asks)| *left += u8::from(asks));
            if self.mixes && units[Service::Texture] {
                let own = |service: Service| asks[service] && self.ports.unit_of(service) == Some(Service::Texture);
                self.mixed[place as usize].ask(ServiceMap::from_fn(own));
            }
            if asks[Service::Shared] {
                self.memory.access(card, self.cluster, number, place, now);
            }
            self.issue.asking &= !(1 << place);
            card.warps[self.cluster][number].step += 1;
            self.go_on(card, place);
            did = Tick::Moved;
        }
        if self.turns.is_some() {
            did = did.or(self.turn(card));
        } else if self.issue.barrier != 0 && self.release_barriers(card) {
            did = Tick::Moved;
        }

        // 5. New warps: vertices first, since fragments wait for them.
        for stage in INTAKE {
            did = did.or(self.take(wires, card, stage));
        }

        // 6. A core that has something for another unit, or waits for its group, looks again in the next cycle. Else nothing can be
        //    seen from outside until a warp comes to the end of its step; or all wait for memory.
        let moved = did == Tick::Moved;
        if moved && self.issue.any_ended() {
            return did;
        }
        let mut why = if moved { Tick::Starved } else { did };
        if self.held != 0 {
            // It has something that another unit does not take: so its account must distinguish cycles of issue from blocked ones.
            let next = if self.issue.any_ended() { self.issue.next_event() } else { self.issue.quiet_until(&self.fixed) };
            let next = next.min(self.memory.next_answer());
            wires.sleep_until(next);
            why = why.or(if next == NEVER { Tick::Memory } else { Tick::Working });
        }
        if moved {
            wires.rest(why);
            return did;
        }
        why
    }

    /// Warps that are done leave, as far as there is room.
    fn leave(&mut self, wires: &mut Wires, card: &mut Card) -> Tick {
        let mut did = Tick::Starved;
        for place in bits(self.issue.finished) {
            let resident = self.resident[place as usize];
            // Warps of fragments are given up where their quads are put in order.
            let (number, ends) = match resident.stage {
                Stage::Fragment => (resident.warp, false),
                Stage::Vertex | Stage::Compute => (resident.number, true),
            };
            let Some((_, output)) = &self.ports.stages[resident.stage] else { continue };
            if !wires.try_push(output, WarpToken { warp: number }) {
                did = did.or(Tick::Blocked);
                self.hours.stuck = true;
                continue;
            }
            if ends {
                card.warps[self.cluster].remove(resident.warp);
            }
            self.issue.finished &= !(1 << place);
            self.held &= !(1 << place);
            self.registers += resident.registers;
            if resident.shared > 0 {
                self.hand_on(resident);
            }
            if self.turns.is_some() && resident.stage.has_workgroups() {
                self.end_turn(resident);
            }
            did = Tick::Moved;
        }
        did
    }
}
