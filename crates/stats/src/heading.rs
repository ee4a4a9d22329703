//! Where counters stand in the statistics.

use std::fmt;

use super::{Group, Node, Tree};

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

    fn follow<'t, 's>(steps: impl Iterator<Item = &'s str>, tree: &'t Tree) -> Vec<&'t Tree> {
        steps.fold(vec![tree], |above, step| {
            let entries = above.into_iter().flat_map(Tree::entries);
            let below = entries.filter(|&(name, _)| step == Heading::ANY || name == step).map(|(_, node)| match node {
                Node::Tree(tree) => std::slice::from_ref(tree),
                Node::List(list) => list,
                Node::Leaf(_) => &[],
            });
            below.flatten().collect()
        })
    }

    /// The counters under it, those of all units summed. Counters that are not there are 0.
    pub fn sum<G: Group>(&self, tree: &Tree) -> G {
        self.find(tree).into_iter().map(Tree::read::<G>).sum()
    }

    /// The same of one name, such as a unit that statistics name.
    pub fn sum_of<G: Group>(&self, tree: &Tree, name: &str) -> G {
        let steps = self.steps().0.map(|step| if step == Heading::ANY { name } else { step });
        Heading::follow(steps, tree).into_iter().map(Tree::read::<G>).sum()
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
    use crate::FrameCounts;

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
    }
}
