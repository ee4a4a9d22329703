//! Where the boxes of a diagram go: rows by the data flow, what lies on the longest way through it in the first column.

use super::Diagram;

/// A bank's place.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct BoxPosition {
    pub bank: usize,
    pub row: usize,
    pub column: usize,
}

/// Banks in data-flow order. That is the order of declaration, save that a bank which nothing before it feeds comes right after the
/// first that does.
fn ordered(diagram: &Diagram, banks: &[usize]) -> Vec<usize> {
    let feeds = |from: usize, to: usize| diagram.cables.iter().any(|cable| cable.from == from && cable.to == to);
    let mut order: Vec<usize> = Vec::new();
    let mut waiting: Vec<usize> = Vec::new();
    for &bank in banks {
        if !order.is_empty() && !order.iter().any(|&earlier| feeds(earlier, bank)) {
            waiting.push(bank);
            continue;
        }
        order.push(bank);
        // What waited for this one.
        let mut last = order.len() - 1;
        while last < order.len() {
            let from = order[last];
            let (now, later): (Vec<usize>, Vec<usize>) = waiting.iter().partition(|&&to| feeds(from, to));
            order.extend(now);
            waiting = later;
            last += 1;
        }
    }
    order.extend(waiting);
    order
}

/// Places for some banks, in rows and columns that begin at 0. The way to the bank called `end`, if there is one, is the first column.
pub(super) fn place(diagram: &Diagram, banks: &[usize], end: &str) -> Vec<BoxPosition> {
    let order = ordered(diagram, banks);
    let position = |bank: usize| order.iter().position(|&b| b == bank);
    // 1. A row below all that feed it.
    let mut rows = vec![0; order.len()];
    let before = |n: usize| -> Vec<usize> {
        let cables = diagram.cables.iter().filter(|cable| cable.to == order[n]);
        cables.filter_map(|cable| position(cable.from)).filter(|&from| from < n).collect()
    };
    for n in 0..order.len() {
        rows[n] = before(n).into_iter().map(|from| rows[from] + 1).max().unwrap_or(0);
    }
    // 2. The longest way to the end.
    let deepest = (0..order.len()).rev().max_by_key(|&n| rows[n]);
    let mut at = (0..order.len()).find(|&n| diagram.banks[order[n]].name == end).or(deepest);
    let mut spine = Vec::new();
    while let Some(n) = at {
        spine.push(n);
        at = before(n).into_iter().find(|&from| rows[from] + 1 == rows[n]);
    }
    // 3. Others beside it.
    let mut taken = vec![0; order.len()];
    (0..order.len())
        .map(|n| {
            let row = rows[n];
            let column = if spine.contains(&n) {
                0
            } else {
                taken[row] += 1;
                taken[row]
            };
            BoxPosition { bank: order[n], row, column }
        })
        .collect()
}
