//! A multithreaded SIMT core: holds warps, issues their instructions by class, and hides what memory takes behind other warps.

use super::card::{Card, Fault};
use super::token::WarpToken;
use super::warp::Program;
use crate::num::Cycle;
use crate::sim::{In, Out, Tick, Unit, Wires};
use crate::unit::knob::Allowed;
use crate::work::{Class, RequestKind};

crate::choices! {
    /// Which of the ready warps issues.
    pub enum Scheduling {
        /// The next after the one that issued last.
        RoundRobin "round-robin",
        /// The one that has been in the core longest.
        Oldest "oldest",
    }
}

crate::knobs! {
    /// A shader core.
    pub struct CoreConfig {
        /// Cores in each pipeline.
        per_pipeline: u32 ["cores", Allowed::Range(1, 8), "a cluster of one or two"],
        /// Whether these cores also shade vertices; if not, there are vertex cores.
        unified: bool ["", Allowed::Switch, "unified since 2006"],
        /// Vertex cores, where they are separate.
        vertex_cores: u32 ["cores", Allowed::Range(1, 32), "ATTILA bGPU.ini NumVertexShaders = 8"],
        /// Warps that a vertex core holds.
        vertex_warps: u32 ["warps", Allowed::Range(1, 64), "ATTILA bGPU.ini VERTEXSHADER ExecutableThreads = 12"],
        /// Warp instructions that a vertex core issues a cycle.
        vertex_issue: u32 ["instructions/cycle", Allowed::Range(1, 8), "ATTILA bGPU.ini VERTEXSHADER FetchRate = 1"],
        /// Invocations of a warp.
        warp_width: u32 ["invocations", Allowed::PowerOfTwo(4, 64), "NVIDIA 32, AMD 64 or 32, Intel 8 to 32, ATTILA 64 (VectorLength 16 of stamps)"],
        /// Warps that a core holds.
        warps: u32 ["warps", Allowed::Range(1, 64), "NVIDIA 64 an SM until 2016, 48 or 32 since; AMD 40 a CU"],
        /// 32-bit registers of a core, which bound the warps further.
        registers: u32 ["registers", Allowed::Range(256, 1048576), "65,536 an SM since 2012"],
        /// Bytes of workgroup memory of a core.
        shared_bytes: u32 ["bytes", Allowed::Range(1024, 1048576), "48 to 100 KB an SM; WebGPU asks for 16 KB"],
        /// Warp instructions issued a cycle.
        issue: u32 ["instructions/cycle", Allowed::Range(1, 8), "four schedulers an SM since 2012"],
        /// Single-precision invocations executed a cycle.
        float_lanes: u32 ["lanes", Allowed::PowerOfTwo(1, 512), "128 an SM of 2014 and 2016"],
        /// Integer invocations executed a cycle.
        integer_lanes: u32 ["lanes", Allowed::PowerOfTwo(1, 512), "64 or 128 an SM"],
        /// Transcendental invocations executed a cycle.
        special_lanes: u32 ["lanes", Allowed::PowerOfTwo(1, 512), "32 an SM of 2014, a quarter of the others"],
        /// Branches and barriers executed a cycle.
        control_lanes: u32 ["lanes", Allowed::PowerOfTwo(1, 512), "as integers"],
        /// Cycles from a warp's single-precision instruction to its next.
        float_latency: u32 ["cycles", Allowed::Range(1, 63), "6 on NVIDIA 2014, 4 since 2017 (Jia et al. 2018); instructions are taken as dependent"],
        /// Cycles from a warp's integer instruction to its next.
        integer_latency: u32 ["cycles", Allowed::Range(1, 63), "as single precision"],
        /// Cycles from a warp's transcendental instruction to its next.
        special_latency: u32 ["cycles", Allowed::Range(1, 63), "about 20 (Jia et al. 2018)"],
        /// Cycles from a warp's branch to its next instruction.
        control_latency: u32 ["cycles", Allowed::Range(1, 63), "fetch of the target"],
        /// Instructions of one class that a warp may issue at one turn; its next turn comes after as many latencies. 1 is exact;
        /// more take the scheduler less host time, and leave rates and latencies as they are.
        run: u32 ["instructions", Allowed::Range(1, 8), "measured: docs/performance.md has the difference"],
        /// Which of the ready warps issues.
        scheduling: Scheduling ["", Allowed::Choice(Scheduling::NAMES), "loose round robin; greedy-then-oldest is the other (Rogers et al. 2012)"],
        /// Shaded warps queued behind each core.
        output_queue: u32 ["warps", Allowed::Range(2, 256), "enough never to hold up the core"],
    }
}

/// Ports of a core.
pub struct CorePorts {
    /// Warps of fragments, and where they go when shaded.
    pub fragment: Option<(In<WarpToken>, Out<WarpToken>)>,
    /// Warps of vertices; what goes on is the batch number.
    pub vertex: Option<(In<WarpToken>, Out<WarpToken>)>,
    /// Warps of workgroups; what goes on is the workgroup's number.
    pub compute: Option<(In<WarpToken>, Out<WarpToken>)>,
    /// Texture and memory requests, and their answers.
    pub texture: (Out<WarpToken>, In<WarpToken>),
}

/// Length of the wheel of latencies: the longest run of the longest latency fits.
const WHEEL: usize = 512;

/// A warp in the core.
#[derive(Clone, Copy, Debug, Default)]
struct Resident {
    /// Its number in the cluster.
    warp: u32,
    /// Instructions left of its step, by class.
    left: [u32; Class::COUNT],
    /// Registers it holds.
    registers: u32,
    /// Workgroup memory that it holds for its group.
    shared: u32,
    program: Program,
    /// Number of its workgroup or batch.
    number: u32,
    siblings: u32,
}

/// A SIMT core. Its items are instructions of warps.
pub struct Core {
    config: CoreConfig,
    cluster: usize,
    ports: CorePorts,
    resident: Vec<Resident>,
    /// Places that hold a warp; of these: that can issue; that ask the texture unit; that are done; that wait at a barrier.
    held: u64,
    ready: u64,
    asking: u64,
    finished: u64,
    barrier: u64,
    /// Places whose step ends when their last run's latencies are over.
    ending: u64,
    /// Places with instructions of a class left.
    has: [u64; Class::COUNT],
    /// Places that become ready at a cycle, modulo the wheel; and the cycles with any, a bit each.
    wheel: Box<[u64; WHEEL]>,
    turning: [u64; WHEEL / 64],
    wheel_at: Cycle,
    /// When the schedulers are free, in cycles times instructions a cycle.
    issue_at: u64,
    /// When each class's lanes are free, in cycles times lanes.
    free_at: [u64; Class::COUNT],
    lanes: [u64; Class::COUNT],
    latency: [u32; Class::COUNT],
    registers: u32,
    shared: u32,
    /// Where round robin goes on.
    next: u32,
    /// Age order of places, for oldest-first.
    age: [u64; 64],
    born: u64,
    /// The workgroup whose warps are being taken in, how many are still to come, and workgroup memory that none of it holds.
    taking: Option<(u32, u32, u32)>,
    items: u64,
    issued: [u64; Class::COUNT],
}

crate::counters! {
    /// Warp instructions issued by a core.
    pub struct CoreCounts {
        /// Single-precision.
        float: "instructions",
        /// Integer and bit operations.
        integer: "instructions",
        /// Transcendental.
        special: "instructions",
        /// Branches and barriers.
        control: "instructions",
    }
}

#[inline(always)]
fn bits(mut mask: u64) -> impl Iterator<Item = u32> {
    std::iter::from_fn(move || {
        (mask != 0).then(|| {
            let bit = mask.trailing_zeros();
            mask &= mask - 1;
            bit
        })
    })
}

impl Core {
    /// An empty one, whose warps are those of a cluster.
    pub fn new(config: CoreConfig, cluster: usize, ports: CorePorts) -> Core {
        let lanes = [config.float_lanes, config.integer_lanes, config.special_lanes, config.control_lanes].map(u64::from);
        let latency = [config.float_latency, config.integer_latency, config.special_latency, config.control_latency];
        Core {
            cluster,
            ports,
            resident: vec![Resident::default(); config.warps as usize],
            held: 0,
            ready: 0,
            asking: 0,
            finished: 0,
            barrier: 0,
            ending: 0,
            has: [0; Class::COUNT],
            wheel: Box::new([0; WHEEL]),
            turning: [0; WHEEL / 64],
            wheel_at: 0,
            issue_at: 0,
            free_at: [0; Class::COUNT],
            lanes,
            latency,
            registers: config.registers,
            shared: config.shared_bytes,
            next: 0,
            age: [0; 64],
            born: 0,
            taking: None,
            items: 0,
            issued: [0; Class::COUNT],
            config,
        }
    }

    /// Instructions by class.
    pub fn counts(&self) -> CoreCounts {
        let [float, integer, special, control] = self.issued;
        CoreCounts { float, integer, special, control }
    }

    /// The first cycle after `from` in which a warp becomes ready.
    #[inline(always)]
    fn next_ready(&self, from: Cycle) -> Option<Cycle> {
        let start = (from + 1) as usize % WHEEL;
        for ahead in 0..=self.turning.len() {
            let word = (start / 64 + ahead) % self.turning.len();
            let mut bits = self.turning[word];
            if ahead == 0 {
                bits &= u64::MAX << (start % 64);
            } else if ahead == self.turning.len() {
                bits &= !(u64::MAX << (start % 64));
            }
            if bits != 0 {
                let slot = word * 64 + bits.trailing_zeros() as usize;
                return Some(from + 1 + ((slot + WHEEL - start) % WHEEL) as u64);
            }
        }
        None
    }

    /// Brings the wheel up to `now`.
    #[inline(always)]
    fn turn(&mut self, now: Cycle) {
        while let Some(at) = self.next_ready(self.wheel_at)
            && at <= now
        {
            let slot = at as usize % WHEEL;
            self.ready |= std::mem::take(&mut self.wheel[slot]);
            self.turning[slot / 64] &= !(1 << (slot % 64));
            self.wheel_at = at;
        }
        self.wheel_at = now;
    }

    /// Puts a warp into the state that its current step asks for.
    #[inline(always)]
    fn enter_step(&mut self, card: &Card, place: u32) {
        let resident = &mut self.resident[place as usize];
        let warp = &card.warps[self.cluster][resident.warp];
        let bit = 1_u64 << place;
        let Some(step) = warp.steps.get(warp.step as usize) else {
            self.finished |= bit;
            return;
        };
        resident.left = step.instructions;
        let mut any = false;
        for class in 0..Class::COUNT {
            if step.instructions[class] > 0 {
                self.has[class] |= bit;
                any = true;
            }
        }
        if any {
            self.ready |= bit;
        } else {
            self.end_step(card, place);
        }
    }

    /// A warp has issued all instructions of its step: what now?
    #[inline(always)]
    fn end_step(&mut self, card: &Card, place: u32) {
        let bit = 1_u64 << place;
        let warp = &card.warps[self.cluster][self.resident[place as usize].warp];
        match warp.steps[warp.step as usize].then {
            RequestKind::End => self.finished |= bit,
            RequestKind::Barrier => self.barrier |= bit,
            _ => self.asking |= bit,
        }
    }

    /// Releases the workgroups all of whose warps wait at a barrier.
    fn release_barriers(&mut self, card: &mut Card) -> bool {
        let mut released = false;
        for place in bits(self.barrier) {
            if self.barrier >> place & 1 == 0 {
                continue;
            }
            let Resident { number, siblings, .. } = self.resident[place as usize];
            let group =
                bits(self.barrier).filter(|&p| self.resident[p as usize].number == number).fold(0_u64, |mask, p| mask | 1 << p);
            // Warps of the group that have ended do not hold the others up.
            let ended = self
                .taking
                .is_none_or(|(taking, ..)| taking != number)
                .then(|| siblings - bits(self.held).filter(|&p| self.is_of_group(p, number)).count() as u32);
            if ended.is_some_and(|ended| group.count_ones() + ended == siblings) {
                self.barrier &= !group;
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

    fn is_of_group(&self, place: u32, number: u32) -> bool {
        let resident = &self.resident[place as usize];
        resident.program == Program::Compute && resident.number == number
    }

    /// Takes warps in from one input while there is room for them.
    #[inline(always)]
    fn take(&mut self, wires: &mut Wires, card: &mut Card, program: Program) -> Tick {
        let mut did = Tick::Starved;
        loop {
            let port = match program {
                Program::Fragment => &self.ports.fragment,
                Program::Vertex => &self.ports.vertex,
                Program::Compute => &self.ports.compute,
            };
            let Some((input, _)) = port else { return did };
            let Some(token) = wires.front(input) else { return did };
            let free = !self.held & (u64::MAX >> (64 - self.resident.len()));
            if free == 0 {
                return did;
            }
            let warp = &card.warps[self.cluster][token.warp];
            let registers = (warp.registers * self.config.warp_width).max(1);
            let mut shared = 0;
            if program == Program::Compute && self.taking.is_none() {
                // A workgroup comes whole or not at all: its warps may wait for each other.
                shared = warp.shared_bytes;
                let over = [
                    ("warps of a workgroup", warp.siblings, self.resident.len() as u32, "core.warps"),
                    ("registers of a workgroup", registers * warp.siblings, self.config.registers, "core.registers"),
                    ("workgroup memory", shared, self.config.shared_bytes, "core.shared_bytes"),
                ];
                if let Some(&(what, asked, has, key)) = over.iter().find(|(_, asked, has, _)| asked > has) {
                    let dispatch = card.compute(warp.slot).dispatch.number;
                    card.stop(Fault::Resources { dispatch, what, asked: asked.into(), has: has.into(), key });
                    return did.or(Tick::Blocked);
                }
                if free.count_ones() < warp.siblings || self.registers < registers * warp.siblings || self.shared < shared {
                    return did;
                }
            }
            if self.registers < registers {
                if registers > self.config.registers {
                    // A program that asks for more than the whole core has runs alone, as if it spilled without cost.
                    if self.held != 0 {
                        return did;
                    }
                } else {
                    return did;
                }
            }
            let held = registers.min(self.registers);
            let place = free.trailing_zeros();
            self.registers -= held;
            self.shared -= shared;
            if let (Program::Compute, Some((.., left))) = (program, self.taking) {
                shared += left;
            }
            self.resident[place as usize] = Resident {
                warp: token.warp,
                left: [0; Class::COUNT],
                registers: held,
                shared,
                program,
                number: warp.number,
                siblings: warp.siblings,
            };
            if program == Program::Compute {
                let left = self.taking.map_or(warp.siblings, |(_, left, _)| left) - 1;
                self.taking = (left > 0).then_some((warp.number, left, 0));
            }
            self.held |= 1 << place;
            self.age[place as usize] = self.born;
            self.born += 1;
            wires.pop(input);
            self.enter_step(card, place);
            did = Tick::Moved;
        }
    }

    /// The place that issues next among candidates.
    #[inline(always)]
    fn choose(&self, candidates: u64) -> u32 {
        match self.config.scheduling {
            Scheduling::RoundRobin => {
                let after = candidates & (u64::MAX << self.next);
                if self.next < 64 && after != 0 { after.trailing_zeros() } else { candidates.trailing_zeros() }
            }
            Scheduling::Oldest => bits(candidates).min_by_key(|&place| self.age[place as usize]).expect("there are candidates"),
        }
    }

    /// Issues what schedulers and lanes of this cycle take.
    #[inline(always)]
    fn issue(&mut self, now: Cycle, card: &Card) -> bool {
        let mut moved = false;
        let rate = u64::from(self.config.issue);
        while self.issue_at < (now + 1) * rate {
            let mut open = 0;
            let mut candidates = 0;
            for class in 0..Class::COUNT {
                if self.has[class] & self.ready != 0 && self.free_at[class] < (now + 1) * self.lanes[class] {
                    open |= 1 << class;
                    candidates |= self.has[class] & self.ready;
                }
            }
            if candidates == 0 {
                break;
            }
            let place = self.choose(candidates);
            let bit = 1_u64 << place;
            self.next = (place + 1) % 64;

            // Of the classes that it has left and whose lanes are free, the one it has most of: costs name no order.
            let left = &mut self.resident[place as usize].left;
            let mut class = Class::COUNT;
            let mut most = 0;
            for (c, &n) in left.iter().enumerate() {
                if open >> c & 1 != 0 && n > most {
                    (class, most) = (c, n);
                }
            }
            let run = most.min(self.config.run);
            left[class] -= run;
            if left[class] == 0 {
                self.has[class] &= !bit;
            }
            let over = left.iter().all(|&n| n == 0);
            self.free_at[class] = self.free_at[class].max(now * self.lanes[class]) + u64::from(run * self.config.warp_width);
            self.issue_at = self.issue_at.max(now * rate) + u64::from(run);
            self.issued[class] += u64::from(run);
            self.items += u64::from(run);
            self.ready &= !bit;
            moved = true;
            // The last instruction of a step waits for nothing; those before it waited for each other.
            let latency = u64::from(self.latency[class]);
            let wait = if over { u64::from(run - 1) * latency } else { u64::from(run) * latency };
            if wait == 0 {
                self.end_step(card, place);
            } else {
                let slot = (now + wait) as usize % WHEEL;
                self.wheel[slot] |= bit;
                self.turning[slot / 64] |= 1 << (slot % 64);
                if over {
                    self.ending |= bit;
                }
            }
        }
        moved
    }

    /// When a warp that only waits for lanes or latency can go on next.
    #[inline(always)]
    fn next_issue(&self, now: Cycle) -> Option<Cycle> {
        let mut next = self.next_ready(now);
        let issue = self.issue_at / u64::from(self.config.issue);
        for class in 0..Class::COUNT {
            if self.has[class] & self.ready != 0 {
                let at = (self.free_at[class] / self.lanes[class]).max(issue).max(now + 1);
                next = Some(next.map_or(at, |next| next.min(at)));
            }
        }
        next
    }
}

impl Unit<Card> for Core {
    fn tick(&mut self, wires: &mut Wires, card: &mut Card) -> Tick {
        let now = wires.now();
        let mut did = Tick::Starved;

        // 1. Warps that are done leave.
        if self.finished != 0 {
            for place in bits(self.finished) {
                let resident = self.resident[place as usize];
                let (port, number) = match resident.program {
                    Program::Fragment => (&self.ports.fragment, resident.warp),
                    Program::Vertex => (&self.ports.vertex, resident.number),
                    Program::Compute => (&self.ports.compute, resident.number),
                };
                let Some((_, output)) = port else { continue };
                if !wires.try_push(output, WarpToken { warp: number }) {
                    did = did.or(Tick::Blocked);
                    continue;
                }
                if resident.program != Program::Fragment {
                    card.warps[self.cluster].remove(resident.warp);
                }
                self.finished &= !(1 << place);
                self.held &= !(1 << place);
                self.registers += resident.registers;
                if resident.shared > 0 {
                    self.hand_on(resident);
                }
                did = Tick::Moved;
            }
        }

        // 2. Answers of the texture unit: the warp goes on with its next step.
        while let Some(token) = wires.pop(&self.ports.texture.1) {
            let place = token.warp;
            card.warps[self.cluster][self.resident[place as usize].warp].step += 1;
            self.enter_step(card, place);
            did = Tick::Moved;
        }

        // 3. Warps whose latency is over are ready, or at the end of their step; the core issues.
        self.turn(now);
        let over = self.ready & self.ending;
        if over != 0 {
            self.ending &= !over;
            self.ready &= !over;
            for place in bits(over) {
                self.end_step(card, place);
            }
            did = Tick::Moved;
        }
        if self.issue(now, card) {
            did = Tick::Moved;
        }

        // 4. Warps at the end of a step ask the texture unit, or wait for their group.
        while self.asking != 0 {
            let place = self.choose(self.asking);
            let warp = self.resident[place as usize].warp;
            // The texture unit finds the warp by its number, and answers with its place.
            card.warps[self.cluster][warp].place = place;
            if !wires.try_push(&self.ports.texture.0, WarpToken { warp }) {
                did = did.or(Tick::Blocked);
                break;
            }
            self.asking &= !(1 << place);
            did = Tick::Moved;
        }
        if self.barrier != 0 && self.release_barriers(card) {
            did = Tick::Moved;
        }

        // 5. New warps: vertices first, since fragments wait for them.
        did = did.or(self.take(wires, card, Program::Vertex));
        did = did.or(self.take(wires, card, Program::Compute));
        did = did.or(self.take(wires, card, Program::Fragment));

        // 6. Nothing moved, but warps are between instructions: busy; or all wait for memory.
        if did != Tick::Moved && self.held != 0 {
            match self.next_issue(now) {
                Some(at) => {
                    wires.sleep_until(at);
                    did = did.or(Tick::Working);
                }
                None => did = did.or(Tick::Memory),
            }
        }
        did
    }

    fn items(&self) -> u64 {
        self.items
    }

    fn resident(&self) -> u64 {
        u64::from(self.held.count_ones())
    }
}
