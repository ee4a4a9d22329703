//! The ends of channels, which units take by number.

use std::cell::RefCell;
use std::ops::Range;
use std::rc::Rc;

use crate::class::BuildError;
use sim::{UnitId, Wiring};

/// A channel, by its name and number, and the units that it joins.
#[derive(Clone, Copy, Debug)]
pub(super) struct Joint {
    pub name: &'static str,
    pub index: usize,
    pub from: UnitId,
    pub to: UnitId,
}

/// Channels that have an end which nobody has taken.
pub(super) type Untaken = Rc<RefCell<Vec<Joint>>>;

/// The error of the first channel that has an end which nobody has taken, if there is one.
pub(super) fn complaint(untaken: &Untaken, wiring: &Wiring) -> Option<BuildError> {
    let &Joint { name, index, from, to } = untaken.borrow().first()?;
    let [from, to] = [from, to].map(|unit| wiring.label(unit));
    Some(BuildError::Untaken { name, index, from, to })
}

/// The ends of some channels at one side. Each is taken once, by its number; those that are left are reported to the builder.
pub(crate) struct Ends<E> {
    ends: Vec<(Joint, Option<E>)>,
    untaken: Untaken,
}

impl<E> Default for Ends<E> {
    fn default() -> Ends<E> {
        Ends { ends: Vec::new(), untaken: Untaken::default() }
    }
}

impl<E> Ends<E> {
    /// Ends that nobody has taken yet.
    pub(super) fn new(ends: impl IntoIterator<Item = (Joint, E)>, untaken: &Untaken) -> Ends<E> {
        Ends { ends: ends.into_iter().map(|(joint, end)| (joint, Some(end))).collect(), untaken: untaken.clone() }
    }

    /// The number of ends.
    pub fn len(&self) -> usize {
        self.ends.len()
    }

    /// The end of a number.
    ///
    /// # Panics
    /// If there is none or it has been taken: two units have been given the same number.
    pub fn take(&mut self, number: usize) -> E {
        let (joint, end) = self.ends.get_mut(number).unwrap_or_else(|| panic!("there is no end {number}"));
        end.take().unwrap_or_else(|| panic!("two units take the end of {}[{}]", joint.name, joint.index))
    }

    /// The end of a number, if these are the ends of any channels.
    pub fn take_if_any(&mut self, number: usize) -> Option<E> {
        (!self.ends.is_empty()).then(|| self.take(number))
    }

    /// The ends of some numbers.
    pub fn take_all(&mut self, numbers: Range<usize>) -> Vec<E> {
        numbers.map(|number| self.take(number)).collect()
    }

    /// All ends, for one unit.
    pub fn all(mut self) -> Vec<E> {
        self.take_all(0..self.len())
    }

    /// The ends from a number on, which no longer belong to these.
    pub fn split_off(&mut self, at: usize) -> Ends<E> {
        Ends { ends: self.ends.split_off(at), untaken: self.untaken.clone() }
    }
}

impl<E> Drop for Ends<E> {
    fn drop(&mut self) {
        let left = self.ends.iter().filter(|(_, end)| end.is_some()).map(|&(joint, _)| joint);
        self.untaken.borrow_mut().extend(left);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_end_that_nobody_takes_is_reported_with_both_units() {
        let mut wiring = Wiring::new();
        let [from, to] = ["depth", "color"].map(|name| wiring.unit(name, 0));
        let untaken = Untaken::default();
        let ends = |count: usize| {
            let joint = move |index| (Joint { name: "tested_late", index, from, to }, index);
            Ends::new((0..count).map(joint), &untaken)
        };
        assert_eq!(ends(3).all(), [0, 1, 2]);
        let mut some = ends(2);
        let mut behind = some.split_off(1);
        assert_eq!((some.take(0), behind.take(0), ends(0).take_if_any(5)), (0, 1, None));
        drop((some, behind));
        assert_eq!(complaint(&untaken, &wiring), None);
        ends(2).take(0);
        let complaint = complaint(&untaken, &wiring).expect("an end is left");
        assert!(
            complaint.to_string().starts_with("no unit takes an end of tested_late[1], from depth[0] to color[0]"),
            "{complaint}"
        );
    }

    #[test]
    #[should_panic(expected = "two units take the end of tested_late[0]")]
    fn an_end_is_taken_once() {
        let mut wiring = Wiring::new();
        let [from, to] = ["depth", "color"].map(|name| wiring.unit(name, 0));
        let joint = Joint { name: "tested_late", index: 0, from, to };
        let mut ends = Ends::new([(joint, ())], &Untaken::default());
        ends.take(0);
        ends.take(0);
    }
}
