//! Pictures of machines that keep the order of the trace: they are those of functional rendering.

use crate::machine::{Config, SortOutcome};
use crate::num::OUR_FAULT;
use crate::stats::Tree;

/// Pixels that a machine shows otherwise than functional rendering, by the statistics of a frame or of a run.
pub fn wrong_pixels(statistics: &Tree) -> u64 {
    SortOutcome::read(statistics).wrong_pixels
}

/// The message about wrong pixels of a machine that keeps the order of the trace. None: there are none, or the machine does not keep it.
pub fn fault(config: &Config, wrong_pixels: u64) -> Option<String> {
    let is_fault = wrong_pixels > 0 && config.keeps_order();
    is_fault.then(|| {
        format!("{wrong_pixels} pixels are not those of functional rendering, and this machine keeps its order. {OUR_FAULT}")
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn wrong_pixels_are_a_fault_where_order_is_kept() {
        let [baseline, images] = ["baseline", "sort-last-image"].map(|name| Config::built_in(name).expect("it is built in"));
        let mut tree = Tree::new();
        tree.child("sort").count("wrong_pixels", 3);
        assert_eq!(wrong_pixels(&tree), 3);
        assert_eq!(wrong_pixels(&Tree::new()), 0);
        assert!(fault(&baseline, 3).is_some_and(|text| text.starts_with("3 pixels ") && text.contains(OUR_FAULT)));
        assert_eq!((fault(&baseline, 0), fault(&images, 3)), (None, None));
    }
}
