//! Where counters stand in the statistics.

use std::fmt;

use super::{Counter, Declaration, Group, Tree};

/// A heading of the statistics: where the groups of counters of a kind of unit stand.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Heading {
    /// Its path, such as `rop.NAME[i]`: `NAME` stands for names of which several kinds of units bring one each, `[i]` for their
    /// numbers.
    pub path: &'static str,
    /// What is there, for the page of all statistics.
    pub about: &'static str,
    /// What stands for `NAME`; none: each name that there is.
    name: Option<&'static str>,
}

impl Heading {
    /// What a path has where names differ.
    const ANY: &str = "NAME";

    /// One.
    pub const fn new(path: &'static str, about: &'static str) -> Heading {
        Heading { path, about, name: None }
    }

    /// That of one of several names.
    pub const fn named(self, name: &'static str) -> Heading {
        Heading { name: Some(name), ..self }
    }

    /// The steps to it, and whether units are numbered there.
    pub fn steps(&self) -> (impl Iterator<Item = &'static str>, bool) {
        let name = self.name.unwrap_or(Heading::ANY);
        let (path, many) = self.path.strip_suffix("[i]").map_or((self.path, false), |path| (path, true));
        (path.split('.').map(move |step| if step == Heading::ANY { name } else { step }), many)
    }

    /// The subtree under it of the unit of a number; what is missing on the way there is made.
    pub fn at<'t>(&self, tree: &'t mut Tree, number: usize) -> &'t mut Tree {
        let (above, last, many) = self.above(tree);
        if many { above.element(last, number) } else { above.child(last) }
    }

    /// The subtree under it for a name that statistics have in place of `NAME`. Missing subtrees are made.
    pub fn at_of<'t>(&self, tree: &'t mut Tree, name: &str) -> &'t mut Tree {
        let steps = self.steps().0.map(|step| if step == Heading::ANY { name } else { step });
        steps.fold(tree, |tree, step| tree.child(step.to_owned()))
    }

    /// The subtree in which its last step stands, which is made where it is missing; that step, and whether units are numbered there. Many
    /// units of several names are found faster from here.
    pub fn above<'t>(&self, tree: &'t mut Tree) -> (&'t mut Tree, &'static str, bool) {
        let (mut steps, many) = self.steps();
        let mut last = steps.next().expect("a path has a step");
        let above = steps.fold(tree, |tree, step| tree.child(std::mem::replace(&mut last, step)));
        (above, last, many)
    }

    /// What stands under it in statistics: a subtree for each unit, in order. Empty where there is none.
    pub fn find<'t>(&self, tree: &'t Tree) -> Vec<&'t Tree> {
        Heading::follow(self.steps().0, tree)
    }

    /// The subtrees under it for a name that statistics have in place of `NAME`, such as that of a unit.
    pub fn find_of<'t>(&self, tree: &'t Tree, name: &str) -> Vec<&'t Tree> {
        Heading::follow(self.steps().0.map(|step| if step == Heading::ANY { name } else { step }), tree)
    }

    fn follow<'t, 's>(steps: impl Iterator<Item = &'s str>, tree: &'t Tree) -> Vec<&'t Tree> {
        steps.filter(|step| !step.is_empty()).fold(vec![tree], |above, step| {
            let entries = above.into_iter().flat_map(Tree::entries);
            entries.filter(|&(name, _)| step == Heading::ANY || name == step).flat_map(|(_, node)| node.trees()).collect()
        })
    }

    /// The names that statistics have in place of `NAME`, the last step of its path, in order. Each comes with a subtree for each unit.
    pub fn banks<'t>(&self, tree: &'t Tree) -> impl Iterator<Item = (&'t str, &'t [Tree])> {
        let above = self.steps().0.take_while(|&step| step != Heading::ANY);
        Heading::follow(above, tree).into_iter().flat_map(Tree::entries).map(|(name, node)| (name, node.trees()))
    }

    /// The counters under it, those of all units summed. Counters that are not there are 0.
    pub fn sum<G: Group>(&self, tree: &Tree) -> G {
        self.find(tree).into_iter().map(Tree::read::<G>).sum()
    }

    /// The counters under it for a name that statistics have in place of `NAME`, those of all units summed.
    pub fn sum_of<G: Group>(&self, tree: &Tree, name: &str) -> G {
        self.find_of(tree, name).into_iter().map(Tree::read::<G>).sum()
    }

    /// The key of a counter under it.
    pub const fn counter<G>(self, counter: Counter<G>) -> Key {
        Key { heading: self, name: None, leaf: counter.name() }
    }

    /// The key of another declared statistic under it.
    pub const fn statistic(self, declaration: &Declaration) -> Key {
        Key { heading: self, name: None, leaf: declaration.name }
    }
}

/// A statistic under a heading: a counter of any group, or another declared statistic. Cells of tables show statistics by their keys.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Key {
    heading: Heading,
    name: Option<String>,
    leaf: &'static str,
}

impl Key {
    /// The key for a name that statistics have in place of `NAME`.
    pub fn of(&self, name: &str) -> Key {
        Key { name: Some(name.to_owned()), ..*self }
    }

    /// Its value in statistics, the sum over all units. None if no unit has it as a number.
    pub fn sum(&self, tree: &Tree) -> Option<f64> {
        let units = match &self.name {
            Some(name) => self.heading.find_of(tree, name),
            None => self.heading.find(tree),
        };
        units.into_iter().filter_map(|unit| unit.number(self.leaf)).reduce(|sum, own| sum + own)
    }

    /// Its path, with `units` in place of the number of a unit.
    pub fn path(&self, units: &str) -> String {
        let (steps, many) = self.heading.steps();
        let mut path = String::new();
        for step in steps.filter(|step| !step.is_empty()) {
            path.extend([self.name.as_deref().filter(|_| step == Heading::ANY).unwrap_or(step), "."]);
        }
        if many {
            path.insert_str(path.len() - 1, units);
        }
        path + self.leaf
    }
}

/// The path, with its name in it.
impl fmt::Display for Heading {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.path.replace(Heading::ANY, self.name.unwrap_or(Heading::ANY)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{FRAME, FrameCounts, counter};

    #[test]
    fn a_heading_finds_one_name_or_all_with_every_unit() {
        let units = Heading::new("units.NAME[i]", "Units.");
        let mut tree = Tree::new();
        for (name, unit, cycles) in [("a", 0, 1), ("a", 1, 2), ("b", 0, 4)] {
            units.named(name).at(&mut tree, unit).extend(FrameCounts { cycles }.tree());
        }
        assert_eq!(tree.number("units.a[1].cycles"), Some(2.0));
        let sum = |heading: Heading| (heading.find(&tree).len(), heading.sum::<FrameCounts>(&tree).cycles);
        assert_eq!([units, units.named("a")].map(|heading| heading.to_string()), ["units.NAME[i]", "units.a[i]"]);
        assert_eq!([units, units.named("a"), units.named("c")].map(sum), [(3, 7), (2, 3), (0, 0)]);
        let banks: Vec<_> = units.banks(&tree).map(|(name, list)| (name, list.len())).collect();
        assert_eq!(banks, [("a", 2), ("b", 1)]);
        let cycles = units.counter(counter!(FrameCounts, cycles));
        assert_eq!([cycles.of("a"), cycles.of("c"), cycles.clone()].map(|key| key.sum(&tree)), [Some(3.0), None, Some(7.0)]);
        assert_eq!(
            (cycles.of("b").path("[*]"), cycles.path("")),
            ("units.b[*].cycles".to_owned(), "units.NAME.cycles".to_owned())
        );
        let top = FRAME.counter(counter!(FrameCounts, cycles));
        assert_eq!((top.path(""), top.sum(&FrameCounts { cycles: 5 }.tree())), ("cycles".to_owned(), Some(5.0)));
    }
}
