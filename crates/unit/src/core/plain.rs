//! The rules of issue, literally: one instruction after another. [`Issue`] is tested against them.

use proptest::prelude::*;

use super::issue::{CYCLE, Fixed, Issue, PLACES};
use super::{CoreConfig, Scheduling};
use num::{Cycle, Random};
use work::{Class, RequestKind, Step};

/// A step at work.
#[derive(Clone)]
struct Work {
    left: [u32; Class::COUNT],
    /// Classes of its instructions where they have an order, the next one last.
    order: Vec<usize>,
    then: RequestKind,
    /// When its next instruction can be issued.
    at: Cycle,
    /// Parts of a cycle that it waits after an instruction of each class, and that it has waited too little.
    waits: [u32; Class::COUNT],
    late: u32,
    /// How many of 256 instructions come beside the one before, and how many it is short of that.
    pairs: u32,
    paired: u32,
    born: u64,
}

/// Places at the ends of their steps: with a request, with the warp, with a barrier.
type Ended = (u64, u64, u64);

/// A core that looks at every instruction in every cycle.
#[derive(Clone)]
struct Plain {
    config: CoreConfig,
    work: [Option<Work>; PLACES],
    /// When each class's lanes are free, in cycles times lanes.
    free_at: [u64; Class::COUNT],
    next: usize,
    ended: Ended,
}

impl Plain {
    /// The class that comes next: without an order, of which a step has most, of equals the first.
    fn class(Work { left, order, .. }: &Work) -> usize {
        if let Some(&class) = order.last() {
            return class;
        }
        (0..Class::COUNT).fold(0, |most, class| if left[class] > left[most] { class } else { most })
    }

    fn enter(&mut self, place: usize, work: Work) {
        if work.left == [0; Class::COUNT] {
            self.end(place, work.then);
        } else {
            self.work[place] = Some(work);
        }
    }

    fn end(&mut self, place: usize, then: RequestKind) {
        let set = match then {
            RequestKind::End => &mut self.ended.1,
            RequestKind::Barrier => &mut self.ended.2,
            RequestKind::Texture
            | RequestKind::Load
            | RequestKind::Store
            | RequestKind::Atomic
            | RequestKind::Constant
            | RequestKind::Shared => &mut self.ended.0,
        };
        *set |= 1 << place;
    }

    /// Issues in a cycle. Returns how many.
    fn cycle(&mut self, now: Cycle) -> u32 {
        let c = &self.config;
        let lanes = c.lanes().map(u64::from);
        let issue = c.issue;
        let mut issued = 0;
        let mut second = Vec::new();
        let finds_lanes = |plain: &Plain, place: usize| {
            plain.work[place].as_ref().is_some_and(|work| {
                let class = Plain::class(work);
                plain.free_at[class] < (now + 1) * lanes[class]
            })
        };
        while issued < issue {
            // 1. Whose turn it is of those that can issue and find a lane. Lanes that are no multiple of a warp take up to as many as they can,
            // and what they could take besides is left for instructions that are issued beside others.
            let can =
                |place: &usize| self.work[*place].as_ref().is_some_and(|work| work.at <= now) && finds_lanes(self, *place);
            let chosen = match self.config.scheduling {
                Scheduling::RoundRobin => (0..PLACES).map(|ahead| (self.next + ahead) % PLACES).find(can),
                Scheduling::Oldest => {
                    (0..PLACES).filter(can).min_by_key(|&place| self.work[place].as_ref().map(|work| work.born))
                }
            };
            let Some(place) = chosen else { break };
            // 2. It issues.
            self.next = place + 1;
            issued += 1;
            if self.issue(now, place, true) {
                second.push(place);
            }
        }
        // 3. Some issue a second instruction; those that find no lane do in the next cycle.
        second.sort_unstable();
        for place in second {
            if finds_lanes(self, place) {
                self.issue(now, place, false);
            } else if let Some(work) = &mut self.work[place] {
                work.at = now + 1;
            }
        }
        issued
    }

    /// Issues an instruction. Returns whether another one comes beside it.
    fn issue(&mut self, now: Cycle, place: usize, first: bool) -> bool {
        let lanes = self.config.lanes().map(u64::from);
        let width = u64::from(self.config.warp_width);
        let Some(work) = &mut self.work[place] else { return false };
        let class = Plain::class(work);
        work.order.pop();
        self.free_at[class] = self.free_at[class].max(now * lanes[class]) + width;
        if !self.config.overlap {
            // No lanes are free before those of the class are.
            let free = now + width.div_ceil(lanes[class]);
            self.free_at = lanes.map(|lanes| free * lanes);
        }
        work.left[class] -= 1;
        let mut wait = work.late + work.waits[class];
        let mut beside = false;
        if first {
            work.paired += work.pairs;
            beside = work.paired >= 256 && work.late < CYCLE;
        }
        if beside {
            work.paired -= 256;
            work.at = now + 1;
        } else {
            let cycles = (wait / CYCLE).max(1);
            work.at = now + u64::from(cycles);
            wait = wait.saturating_sub(cycles * CYCLE);
        }
        work.late = wait;
        if work.left == [0; Class::COUNT] {
            let then = work.then;
            self.work[place] = None;
            self.end(place, then);
            return false;
        }
        beside
    }
}

/// A configuration of all that issue depends on.
fn config() -> impl Strategy<Value = CoreConfig> {
    // From an eighth of the width to eight times as many.
    let lanes = || 0..7_u32;
    let latency = || prop_oneof![1..8_u32, 1..64_u32];
    let latencies = (latency(), latency(), latency(), latency());
    let multiply = (1..300_u32, prop_oneof![2 => 1..64_u32, 1 => 64..128_u32]);
    let flags = (any::<bool>(), any::<bool>(), any::<bool>(), any::<bool>());
    (3..7_u32, 1..9_u32, (lanes(), lanes(), lanes(), lanes()), latencies, multiply, prop_oneof![1..200_u32, Just(0)], flags)
        .prop_map(|(width, issue, lanes, latency, multiply, float_lanes, (oldest, overlap, scoreboard, dual_issue))| {
            CoreConfig {
                warp_width: 1 << width,
                issue: if overlap { issue } else { 1 },
                overlap,
                float_lanes: if float_lanes > 0 { float_lanes } else { 1 << (width + lanes.0 - 3) },
                integer_lanes: 1 << (width + lanes.1 - 3),
                special_lanes: 1 << (width + lanes.2 - 3),
                control_lanes: 1 << (width + lanes.3 - 3),
                float_latency: latency.0,
                integer_latency: latency.1,
                special_latency: latency.2,
                control_latency: latency.3,
                multiply_lanes: multiply.0,
                multiply_latency: multiply.1,
                scoreboard,
                dual_issue: dual_issue && overlap,
                scheduling: if oldest { Scheduling::Oldest } else { Scheduling::RoundRobin },
                ..CoreConfig::default()
            }
        })
}

/// When a warp comes, as cycles after the one before it; which place it would like; before or after the issue of the cycle; its
/// step; whether that has an order, and which.
type Arrival = (u64, usize, bool, Step, Option<u64>);

fn arrivals() -> impl Strategy<Value = Vec<Arrival>> {
    let wait = prop_oneof![4 => Just(0_u64), 2 => 0..3_u64, 1 => 0..200_u64];
    // Mostly of one class, as shaders are, and some longer than a run may be.
    let instructions = (
        prop_oneof![4 => 0..4_u32, 4 => 0..40_u32, 1 => 200..300_u32],
        0..3_u32,
        0..5_u32,
        0..2_u32,
        0..2_u32,
        0..Class::COUNT,
    )
        .prop_map(|(a, b, c, d, e, turn)| {
            let mut counts = [a, b, c, d, e];
            counts.rotate_right(turn);
            counts
        });
    // All that is from one of several chains to none that waits for another.
    let step = (instructions, 0..3_u8, prop_oneof![2 => Just(1), 1 => 2..40_u32]).prop_map(|(instructions, then, chains)| {
        let then = [RequestKind::Texture, RequestKind::End, RequestKind::Barrier][usize::from(then)];
        Step { chain: instructions.map(|count| count.div_ceil(chains)), ..Step::dependent(instructions, then) }
    });
    proptest::collection::vec((wait, 0..PLACES, any::<bool>(), step, proptest::option::of(any::<u64>())), 1..70)
}

/// The classes of single instructions, `counts` of each class, in a random order.
fn in_some_order(counts: [u32; Class::COUNT], order: u64) -> Vec<usize> {
    let (mut left, mut random, mut classes) = (counts, Random::new(order), Vec::new());
    while left != [0; Class::COUNT] {
        // Runs of some length, and single ones.
        let class = random.below(Class::COUNT as u32) as usize;
        let run = left[class].min(1 + random.below(8));
        left[class] -= run;
        classes.extend(std::iter::repeat_n(class, run as usize));
    }
    classes
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(200))]

    /// Every step ends in the cycle in which it ends by the rules, whether the core looks in every cycle, or only when it must:
    /// when a warp comes and when a step might end. What it issues in a cycle is as much.
    #[test]
    fn issue_in_sets_and_runs_is_issue_one_by_one(config in config(), arrivals in arrivals(), looks in any::<bool>()) {
        let mut fixed = Fixed::new(&config);
        let mut issue = Issue::new();
        let mut plain = Plain { config, work: std::array::from_fn(|_| None), free_at: [0; Class::COUNT], next: 0, ended: (0, 0, 0) };
        let mut arrivals = arrivals.into_iter().peekable();
        let (mut now, mut since, mut born, mut held) = (0, 0, 0, 0_u64);
        let mut asked = [0; Class::COUNT];
        while arrivals.peek().is_some() || held != 0 {
            let mut come = [Vec::new(), Vec::new()];
            while held != u64::MAX
                && let Some((_, place, after, step, order)) = arrivals.next_if(|&(wait, ..)| since + wait <= now)
            {
                let free = (0..PLACES).map(|ahead| (place + ahead) % PLACES).find(|place| held >> place & 1 == 0);
                let place = free.expect("not all are held");
                held |= 1 << place;
                come[usize::from(after)].push((place, step, order));
                since = now;
            }
            let must = come.iter().any(|come| !come.is_empty()) || issue.quiet_until(&fixed) <= now;
            let ticks = must || looks;
            for (after, come) in come.into_iter().enumerate() {
                if after == 0 && ticks {
                    issue.advance(&fixed, now);
                }
                if after == 1 {
                    let issued = plain.cycle(now);
                    if ticks {
                        prop_assert_eq!(issue.advance(&fixed, now + 1) == now + 1, issued > 0, "issue in cycle {}", now);
                    }
                }
                for (place, step, order) in come {
                    let counts = step.instructions;
                    fixed.take(place as u32, born);
                    let order = order.map_or(Vec::new(), |order| in_some_order(counts, order));
                    let runs: Vec<(Class, u32)> =
                        order.chunk_by(|a, b| a == b).map(|run| (Class::ALL[run[0]], run.len() as u32)).collect();
                    issue.enter(&fixed, place as u32, &step, &runs);
                    let at = now + after as u64;
                    let order = order.into_iter().rev().collect();
                    let (waits, _, pairs) = fixed.waits(&step);
                    let then = step.then;
                    plain.enter(place, Work { left: counts, order, then, at, waits, late: 0, pairs, paired: 0, born });
                    born += 1;
                    for class in 0..Class::COUNT {
                        asked[class] += u64::from(counts[class]);
                    }
                }
            }
            let ended = (issue.asking, issue.finished, issue.barrier);
            prop_assert_eq!(ended, plain.ended, "ends in cycle {}", now);
            held &= !(ended.0 | ended.1 | ended.2);
            (issue.asking, issue.finished, issue.barrier) = (0, 0, 0);
            plain.ended = (0, 0, 0);
            now += 1;
        }
        prop_assert_eq!(issue.issued, asked);
    }
}
