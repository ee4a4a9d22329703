//! A multithreaded SIMT core: holds warps, issues their instructions by class, and hides what memory takes behind other warps.

mod issue;
#[cfg(test)]
mod plain;
mod turns;

use super::card::{Card, Fault};
use super::token::WarpToken;
use super::warp::{Execution, Program};
use issue::{Fixed, Issue, PLACES, bits};
use knob::Allowed;
use num::NEVER;
use sim::{Counted, In, Out, Tick, Unit, Wires};
use stats::Heading;
use turns::Turns;
use work::{Class, RequestKind};

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
        /// Warps that a core holds. A workgroup of more runs in turns.
        warps: u32 ["warps", Allowed::Range(1, 64), "NVIDIA 64 an SM until 2016, 48 or 32 since; AMD 40 a CU"],
        /// 32-bit registers of a core, which bound the warps further. A workgroup that asks for more runs in turns.
        registers: u32 ["registers", Allowed::Range(256, 1048576), "65,536 an SM since 2012"],
        /// Bytes of workgroup memory of a core.
        shared_bytes: u32 ["bytes", Allowed::Range(16384, 1048576), "48 to 100 KB an SM; WebGPU asks for 16 KB"],
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
        /// Whether an instruction of one class is issued while the lanes of another still take one in. If not, `core.issue` is 1.
        overlap: bool ["", Allowed::Switch, "lanes of a class have ports of their own in cards; ATTILA fetches when all invocations of an instruction have begun (VectorShaderFetch)"],
        /// Which of the ready warps issues.
        scheduling: Scheduling ["", Allowed::Choice(Scheduling::NAMES), "loose round robin; greedy-then-oldest is the other (Rogers et al. 2012)"],
        /// What a warp executes where its parts take different paths, and in which order. All but `longest` have the renderer
        /// record paths.
        execution: Execution ["", Allowed::Choice(Execution::NAMES), "cards execute in lockstep (Levinthal and Porter 1984) and nearly in order; longest needs no paths, and docs/fidelity.md has what it is off by"],
        /// What an instruction works on. Vectors have the renderer record other costs.
        instructions: Instructions ["", Allowed::Choice(Instructions::NAMES), "scalar since 2006; vectors of four in cards before and in ATTILA (VectorALUConfig = simd4+scalar)"],
        /// Shaded warps queued behind each core.
        output_queue: u32 ["warps", Allowed::Range(2, 256), "enough never to hold up the core"],
    }
}

/// Ports of a core.
#[derive(Clone)]
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

/// A warp in the core.
#[derive(Clone, Copy, Debug, Default)]
struct Resident {
    /// Its number in the cluster.
    warp: u32,
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
    registers: u32,
    shared: u32,
    /// Warps taken in since the start.
    born: u64,
    /// The workgroup whose warps are being taken in, how many are still to come, and workgroup memory that none of it holds.
    taking: Option<(u32, u32, u32)>,
    /// The workgroup that runs in turns.
    turns: Option<Box<Turns>>,
}

/// Where cores count.
pub const CORES: Heading = Heading::new("shading.core[i]", "Warp instructions by class.");

stats::counters! {
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
        /// Of all these, those of warps of vertices.
        vertex: "instructions",
    }
}

impl Core {
    /// An empty one, whose warps are those of a cluster.
    pub fn new(config: CoreConfig, cluster: usize, ports: CorePorts) -> Core {
        assert!((1..=PLACES as u32).contains(&config.warps), "places of warps fit a mask");
        Core {
            cluster,
            ports,
            resident: vec![Resident::default(); config.warps as usize],
            all: u64::MAX >> (64 - config.warps),
            held: 0,
            fixed: Fixed::new(&config),
            issue: Issue::new(),
            vertex: 0,
            registers: config.registers,
            shared: config.shared_bytes,
            born: 0,
            taking: None,
            turns: None,
            config,
        }
    }

    /// Instructions by class.
    pub fn counts(&self) -> CoreCounts {
        let [float, integer, special, control] = self.issue.issued;
        CoreCounts { float, integer, special, control, vertex: self.vertex }
    }

    /// A warp begins its current step.
    #[inline(always)]
    fn enter_step(&mut self, card: &Card, place: u32) {
        let Resident { warp, program, .. } = self.resident[place as usize];
        let warp = &card.warps[self.cluster][warp];
        match warp.steps.get(warp.step as usize) {
            Some(step) => {
                if program == Program::Vertex {
                    self.vertex += step.instructions.iter().map(|&count| u64::from(count)).sum::<u64>();
                }
                self.issue.enter(&self.fixed, place, step.instructions, step.then, warp.order(warp.step));
            }
            None => self.issue.enter(&self.fixed, place, [0; Class::COUNT], RequestKind::End, &[]),
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
    fn take(&mut self, wires: &mut Wires, card: &mut Card, program: Program) -> Tick {
        let port = match program {
            Program::Fragment => &self.ports.fragment,
            Program::Vertex => &self.ports.vertex,
            Program::Compute => &self.ports.compute,
        };
        match port {
            Some((input, _)) if wires.can_pop(input) && self.held != self.all => self.take_in(wires, card, program),
            _ => Tick::Starved,
        }
    }

    /// [`Core::take`] where a warp is at the head.
    #[inline(never)]
    fn take_in(&mut self, wires: &mut Wires, card: &mut Card, program: Program) -> Tick {
        let mut did = Tick::Starved;
        loop {
            let port = match program {
                Program::Fragment => &self.ports.fragment,
                Program::Vertex => &self.ports.vertex,
                Program::Compute => &self.ports.compute,
            };
            let Some((input, _)) = port else { return did };
            let Some(token) = wires.front(input) else { return did };
            let free = self.all & !self.held;
            if free == 0 {
                return did;
            }
            let warp = &card.warps[self.cluster][token.warp];
            let (number, siblings) = (warp.number, warp.siblings);
            let registers = self.asked(warp.registers);
            let mut shared = 0;
            let in_turns = self.turns.as_ref().is_some_and(|turns| turns.coming > 0);
            if program == Program::Compute && self.taking.is_none() && !in_turns {
                // A workgroup comes whole, since its warps may wait for each other: the places and registers for all of them are
                // there when the first is taken.
                shared = warp.shared_bytes;
                let (asked, has) = (u64::from(shared), u64::from(self.config.shared_bytes));
                if asked > has {
                    let dispatch = card.compute(warp.slot).dispatch.number;
                    card.stop(Fault::Resources { dispatch, what: "workgroup memory", asked, has, key: "core.shared_bytes" });
                    return did.or(Tick::Blocked);
                }
                let all = u64::from(registers) * u64::from(siblings);
                if siblings as usize > self.resident.len() || all > u64::from(self.config.registers) {
                    // Where the core has not so many, the group has it for itself.
                    if self.held != 0 || self.turns.is_some() {
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
                    return did;
                }
            }
            let Some(held) = self.place_for(registers) else { return did };
            self.shared -= shared;
            if let Some(turns) = self.turns.as_mut().filter(|_| program == Program::Compute) {
                turns.coming -= 1;
            } else if program == Program::Compute {
                shared += self.taking.map_or(0, |(.., left)| left);
                let left = self.taking.map_or(siblings, |(_, left, _)| left) - 1;
                self.taking = (left > 0).then_some((number, left, 0));
            }
            wires.take(input);
            self.settle(card, Resident { warp: token.warp, registers: held, shared, program, number, siblings });
            did = Tick::Moved;
        }
    }
}

impl Unit<Card> for Core {
    fn tick(&mut self, wires: &mut Wires, card: &mut Card) -> Tick {
        let now = wires.now();
        let mut did = Tick::Starved;

        // 0. What happened since the last tick.
        if self.issue.advance(&self.fixed, now) != 0 {
            wires.works();
        }

        // 1. Warps that are done leave.
        if self.issue.finished != 0 {
            did = did.or(self.leave(wires, card));
        }

        // 2. Answers of the texture unit: the warp goes on with its next step.
        while let Some(token) = wires.pop(&self.ports.texture.1) {
            let place = token.warp;
            card.warps[self.cluster][self.resident[place as usize].warp].step += 1;
            self.enter_step(card, place);
            did = Tick::Moved;
        }

        // 3. Warps whose latency is over are ready; the core issues.
        if self.issue.advance(&self.fixed, now + 1) == now + 1 {
            did = Tick::Moved;
        }

        // 4. Warps at the end of a step ask the texture unit, or wait for their group.
        while self.issue.asking != 0 {
            let place = self.issue.choose(&self.fixed, self.issue.asking);
            let warp = self.resident[place as usize].warp;
            // The texture unit finds the warp by its number, and answers with its place.
            card.warps[self.cluster][warp].place = place;
            if !wires.try_push(&self.ports.texture.0, WarpToken { warp }) {
                did = did.or(Tick::Blocked);
                break;
            }
            self.issue.asking &= !(1 << place);
            did = Tick::Moved;
        }
        if self.turns.is_some() {
            did = did.or(self.turn(card));
        } else if self.issue.barrier != 0 && self.release_barriers(card) {
            did = Tick::Moved;
        }

        // 5. New warps: vertices first, since fragments wait for them.
        for program in Program::ALL {
            did = did.or(self.take(wires, card, program));
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
            wires.sleep_until(next);
            why = why.or(if next == NEVER { Tick::Memory } else { Tick::Working });
        }
        if moved {
            wires.rest(why);
            return did;
        }
        why
    }

    fn items(&self) -> u64 {
        self.issue.issued.iter().sum()
    }

    fn resident(&self) -> u64 {
        u64::from(self.held.count_ones()) + self.turns.as_ref().map_or(0, |turns| turns.away() as u64)
    }

    fn counted(groups: &mut Counted<Self>) {
        // Cores that shade nothing but vertices are not counted.
        groups.group_if(CORES, |unit| unit.ports.fragment.is_some().then(|| unit.counts()));
    }
}

impl Core {
    /// Warps that are done leave, as far as there is room.
    fn leave(&mut self, wires: &mut Wires, card: &mut Card) -> Tick {
        let mut did = Tick::Starved;
        for place in bits(self.issue.finished) {
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
            self.issue.finished &= !(1 << place);
            self.held &= !(1 << place);
            self.registers += resident.registers;
            if resident.shared > 0 {
                self.hand_on(resident);
            }
            if self.turns.is_some() && resident.program == Program::Compute {
                self.end_turn(resident);
            }
            did = Tick::Moved;
        }
        did
    }
}
