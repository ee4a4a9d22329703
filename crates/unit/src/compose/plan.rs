//! Which unit sends what to which other, step after step.

use std::ops::Range;

use super::Scheme;

/// A step of a node: blocks that it sends and blocks that it takes in, at the same time.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Step {
    /// Another node, and the blocks that it gets.
    pub send: Option<(usize, Range<u32>)>,
    /// Another node, and the blocks that come from it.
    pub receive: Option<(usize, Range<u32>)>,
    /// Whether each block is sent on when it has come and is composed.
    pub forward: bool,
    /// Whether the blocks that come are the last that were missing. Composed with them, blocks are the result.
    pub last: bool,
}

/// The steps of a node. Copies are always composed with those of a run of nodes next to theirs, so that "over" has its order.
///
/// All nodes agree on one order of all transfers, in which each of them sends and each of them receives: the first that is not
/// complete is at the head of both its ends, so that no scheme gets stuck.
pub fn steps(scheme: Scheme, node: usize, nodes: usize, blocks: u32) -> Vec<Step> {
    let all = 0..blocks;
    match scheme {
        _ if nodes < 2 => Vec::new(),
        Scheme::BinarySwap => binary_swap(node, nodes, all),
        Scheme::DirectSend => direct_send(node, nodes, blocks),
        Scheme::Pipeline => {
            let send = (node > 0).then(|| (node - 1, all.clone()));
            let receive = (node + 1 < nodes).then(|| (node + 1, all));
            vec![Step { forward: send.is_some() && receive.is_some(), last: node == 0, send, receive }]
        }
    }
}

/// Rounds of halves (Ma et al. 1994). Where nodes are no power of two, the first ones are first composed in pairs.
fn binary_swap(node: usize, nodes: usize, all: Range<u32>) -> Vec<Step> {
    let rounds = nodes.ilog2();
    let pairs = nodes - (1 << rounds);
    let mut steps = Vec::new();
    if node < 2 * pairs {
        let partner = node ^ 1;
        let whole = Some((partner, all.clone()));
        if node % 2 == 1 {
            return vec![Step { send: whole, receive: None, forward: false, last: false }];
        }
        steps.push(Step { send: None, receive: whole, forward: false, last: false });
    }
    let rank = if node < 2 * pairs { node / 2 } else { node - pairs };
    let of_rank = |rank: usize| if rank < pairs { 2 * rank } else { rank + pairs };
    let mut mine = all;
    for round in 0..rounds {
        let partner = of_rank(rank ^ 1 << round);
        let middle = mine.start + (mine.end - mine.start) / 2;
        let (low, high) = (mine.start..middle, middle..mine.end);
        let (keep, give) = if rank >> round & 1 == 0 { (low, high) } else { (high, low) };
        steps.push(Step {
            send: Some((partner, give)),
            receive: Some((partner, keep.clone())),
            forward: false,
            last: round + 1 == rounds,
        });
        mine = keep;
    }
    steps
}

/// Each node owns a part of the blocks and gets it from all others: from those before it, the nearest first, then from those behind.
fn direct_send(node: usize, nodes: usize, blocks: u32) -> Vec<Step> {
    let border = |of: usize| (u64::from(blocks) * of as u64 / nodes as u64) as u32;
    let part = |of: usize| border(of)..border(of + 1);
    let below = |distance: usize| node.checked_sub(distance);
    let above = |distance: usize| Some(node + distance).filter(|&other| other < nodes);
    let step = |to: Option<usize>, from: Option<usize>| Step {
        send: to.map(|to| (to, part(to))),
        receive: from.map(|from| (from, part(node))),
        forward: false,
        last: false,
    };
    let up = (1..nodes).map(|distance| step(above(distance), below(distance)));
    let down = (1..nodes).map(|distance| step(below(distance), above(distance)));
    let mut steps: Vec<Step> = up.chain(down).filter(|step| step.send.is_some() || step.receive.is_some()).collect();
    if let Some(step) = steps.iter_mut().rev().find(|step| step.receive.is_some()) {
        step.last = true;
    }
    steps
}

#[cfg(test)]
mod tests {
    use super::*;

    const SCHEMES: [Scheme; 3] = [Scheme::BinarySwap, Scheme::DirectSend, Scheme::Pipeline];

    /// Blocks that a node sends.
    fn sent(steps: &[Step]) -> u32 {
        steps.iter().filter_map(|step| step.send.as_ref()).map(|(_, blocks)| blocks.len() as u32).sum()
    }

    #[test]
    fn every_block_is_composed_of_all_copies_once_and_by_neighbours() {
        for scheme in SCHEMES {
            for nodes in 2..=64 {
                for blocks in [1, 7, 64, 200] {
                    let plans: Vec<_> = (0..nodes).map(|node| steps(scheme, node, nodes, blocks)).collect();
                    // For each node and block the run of copies that it holds composed, as a mask; and how many finish it.
                    let mut held: Vec<Vec<u64>> = (0..nodes).map(|node| vec![1 << node; blocks as usize]).collect();
                    let mut finished = vec![0; blocks as usize];
                    let mut at = vec![0; nodes];
                    let mut moved = true;
                    while moved {
                        moved = false;
                        // A step ends for the receiver when the sender is at the step that sends.
                        for node in (0..nodes).rev() {
                            let Some(step) = plans[node].get(at[node]) else { continue };
                            let met = |other: usize, sends: bool| {
                                plans[other].iter().position(|step| {
                                    let end = if sends { &step.send } else { &step.receive };
                                    end.as_ref().is_some_and(|&(peer, _)| peer == node)
                                })
                            };
                            let here = step.receive.as_ref().is_none_or(|&(from, _)| {
                                let step = met(from, true).unwrap();
                                if plans[from][step].forward { at[from] > step } else { at[from] >= step }
                            });
                            if !here {
                                continue;
                            }
                            if let Some((from, range)) = &step.receive {
                                let peer = met(*from, true).unwrap();
                                assert_eq!(plans[*from][peer].send.as_ref().unwrap().1, *range);
                                for block in range.clone().map(|block| block as usize) {
                                    let (mine, theirs) = (held[node][block], held[*from][block]);
                                    assert_eq!(mine & theirs, 0, "{scheme:?} {nodes}: a copy came twice");
                                    let both = mine | theirs;
                                    let run = both >> both.trailing_zeros();
                                    assert_eq!(run & run.wrapping_add(1), 0, "{scheme:?} {nodes}: not neighbours");
                                    held[node][block] = both;
                                    if step.last {
                                        finished[block] += 1;
                                        assert_eq!(both.count_ones() as usize, nodes, "{scheme:?} {nodes}");
                                    }
                                }
                            }
                            at[node] += 1;
                            moved = true;
                        }
                    }
                    assert!((0..nodes).all(|node| at[node] == plans[node].len()), "{scheme:?} {nodes}: stuck at {at:?}");
                    assert!(finished.iter().all(|&times| times == 1), "{scheme:?} {nodes}: {finished:?}");
                    let total: u32 = plans.iter().map(|steps| sent(steps)).sum();
                    assert_eq!(total, blocks * (nodes as u32 - 1), "{scheme:?} {nodes}");
                }
            }
        }
    }

    #[test]
    fn schemes_send_what_the_formulas_say() {
        let blocks = 64 * 9 * 5 * 7;
        for nodes in [2, 4, 8, 16, 32, 64] {
            for node in 0..nodes {
                let steps = steps(Scheme::BinarySwap, node, nodes, blocks);
                assert_eq!(steps.len() as u32, nodes.ilog2());
                assert_eq!(sent(&steps), blocks - blocks / nodes as u32);
            }
        }
        for nodes in [2, 3, 5, 7, 9, 15, 21, 64] {
            for node in 0..nodes {
                let steps = steps(Scheme::DirectSend, node, nodes, blocks);
                let sends = steps.iter().filter_map(|step| step.send.as_ref());
                let sizes: Vec<u32> = sends.map(|(_, blocks)| blocks.len() as u32).collect();
                assert_eq!(sizes, vec![blocks / nodes as u32; nodes - 1]);
            }
        }
    }
}
