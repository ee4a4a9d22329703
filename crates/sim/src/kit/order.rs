//! Cycles whose units tick in a given order: results must not depend on it.

use crate::Circuit;

/// All orders of `n` units.
pub fn permutations(n: usize) -> Vec<Vec<usize>> {
    if n == 0 {
        return vec![Vec::new()];
    }
    let mut all = Vec::new();
    for shorter in permutations(n - 1) {
        for at in 0..n {
            let mut order = shorter.clone();
            order.insert(at, n - 1);
            all.push(order);
        }
    }
    all
}

/// A cycle in which all units tick in a given order.
pub fn step<K: Circuit>(machine: &mut K, order: &[usize], context: &mut K::Context) {
    machine.cycle_in(order, context);
    let now = machine.wires().now();
    machine.wires_mut().advance(now + 1);
}
