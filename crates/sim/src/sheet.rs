//! What units count in addition to their items and their cycles.

use super::unit::Unit;
use stats::{Declaration, Group, Heading, Tree};

/// What one group of counters of a kind of unit is.
#[derive(Clone, Copy, Debug)]
pub struct Description {
    /// Where it stands.
    pub heading: Heading,
    /// Its counters.
    pub declarations: &'static [Declaration],
}

/// Appends the values of a group of a unit whose number in its bank is given; gives the number that it has in the statistics. None: the
/// unit has no such group.
type Read<U> = Box<dyn Fn(&U, usize, &mut Vec<u64>) -> Option<usize>>;

/// The same for a group by its place among the descriptions and a unit by its number in the bank.
type ReadAt<'b> = &'b dyn Fn(usize, usize, &mut Vec<u64>) -> Option<usize>;

/// The groups of counters of a kind of unit.
pub struct Counted<U> {
    descriptions: Vec<Description>,
    reads: Vec<Read<U>>,
}

/// The counters of a bank of units, whatever kind they are of: what is done with them is compiled once and not for each kind.
struct Bank<'b> {
    descriptions: &'b [Description],
    units: usize,
    read: ReadAt<'b>,
}

impl<U: 'static> Counted<U> {
    /// Those that it brings.
    pub fn of<C>() -> Counted<U>
    where
        U: Unit<C>,
    {
        let mut counted = Counted { descriptions: Vec::new(), reads: Vec::new() };
        U::counted(&mut counted);
        counted
    }

    /// A group that each has.
    pub fn group<G: Group>(&mut self, heading: Heading, read: fn(&U) -> G) {
        self.numbered_if(heading, move |unit, number| Some((number, read(unit))));
    }

    /// A group that some do not have.
    pub fn group_if<G: Group>(&mut self, heading: Heading, read: fn(&U) -> Option<G>) {
        self.numbered_if(heading, move |unit, number| Some((number, read(unit)?)));
    }

    /// A group of units that know their numbers, where several banks are of one kind.
    pub fn numbered<G: Group>(&mut self, heading: Heading, read: fn(&U) -> (usize, G)) {
        self.numbered_if(heading, move |unit, _| Some(read(unit)));
    }

    fn numbered_if<G: Group>(&mut self, heading: Heading, read: impl Fn(&U, usize) -> Option<(usize, G)> + 'static) {
        let append = move |unit: &U, number: usize, values: &mut Vec<u64>| {
            let (number, counts) = read(unit, number)?;
            values.extend(counts.values());
            Some(number)
        };
        self.descriptions.push(Description { heading, declarations: G::DECLARATIONS });
        self.reads.push(Box::new(append));
    }

    pub(super) fn read(&self, units: &[U], sheet: &mut Sheet) {
        self.bank(units, |bank| bank.read(sheet));
    }

    pub(super) fn sum(&self, units: &[U], tops: &[&str], lists: &mut [Vec<Sum>]) {
        self.bank(units, |bank| bank.sum(tops, lists));
    }

    fn bank(&self, units: &[U], with: impl FnOnce(Bank)) {
        let read = |group: usize, unit: usize, values: &mut Vec<u64>| self.reads[group](&units[unit], unit, values);
        with(Bank { descriptions: &self.descriptions, units: units.len(), read: &read });
    }

    pub(super) fn describe(&self, list: &mut Vec<Description>) {
        list.extend_from_slice(&self.descriptions);
    }
}

impl Bank<'_> {
    fn read(&self, sheet: &mut Sheet) {
        let mut values = Vec::new();
        for (group, Description { heading, declarations }) in self.descriptions.iter().enumerate() {
            for unit in 0..self.units {
                values.clear();
                if let Some(number) = (self.read)(group, unit, &mut values) {
                    sheet.entries.push((*heading, number, tree(declarations, &values)));
                }
            }
        }
    }

    fn sum(&self, tops: &[&str], lists: &mut [Vec<Sum>]) {
        let mut values = Vec::new();
        for (group, Description { heading, declarations }) in self.descriptions.iter().enumerate() {
            let first = heading.steps().0.next();
            let Some(list) = tops.iter().position(|&top| first == Some(top)).map(|at| &mut lists[at]) else { continue };
            let mut sum: Option<Vec<u64>> = None;
            for unit in 0..self.units {
                values.clear();
                if (self.read)(group, unit, &mut values).is_some() {
                    let sum = sum.get_or_insert_with(|| vec![0; values.len()]);
                    sum.iter_mut().zip(&values).for_each(|(sum, value)| *sum += value);
                }
            }
            let Some(values) = sum else { continue };
            let name = heading.steps().0.last().unwrap_or_default();
            match list.iter_mut().find(|known| known.name == name) {
                // Several banks are of one kind.
                Some(known) => known.values.iter_mut().zip(&values).for_each(|(sum, value)| *sum += value),
                None => list.push(Sum { name, declarations, values }),
            }
        }
    }
}

/// Counters with their values as leaves.
fn tree(declarations: &[Declaration], values: &[u64]) -> Tree {
    let mut tree = Tree::with_capacity(declarations.len());
    declarations.iter().zip(values).for_each(|(declaration, &value)| tree.count(declaration.name, value));
    tree
}

/// What all units together have counted under one name of a heading.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Sum {
    /// The last step of the heading's path.
    pub name: &'static str,
    /// The counters.
    pub declarations: &'static [Declaration],
    /// Their sums over the units.
    pub values: Vec<u64>,
}

/// What the units of a machine have counted in addition to their items, up to now.
#[derive(Debug, Default)]
pub struct Sheet {
    entries: Vec<(Heading, usize, Tree)>,
}

impl Sheet {
    /// Moves to a tree what stands below one of these paths, in their order, and below those in data-flow order.
    pub fn move_to(&mut self, tree: &mut Tree, paths: &[&str]) {
        // Units of one kind stand one after the other: where they go is found once.
        let mut last: Option<(Heading, Option<usize>)> = None;
        let place = |(heading, ..): &(Heading, usize, Tree)| match last {
            Some((known, place)) if known == *heading => place,
            _ => {
                let below = |path: &&str| {
                    let (mut steps, _) = heading.steps();
                    path.split('.').all(|step| steps.next() == Some(step))
                };
                let place = paths.iter().position(below);
                last = Some((*heading, place));
                place
            }
        };
        let places: Vec<_> = self.entries.iter().map(place).collect();
        let mut moved: Vec<_> = std::mem::take(&mut self.entries).into_iter().zip(places).collect();
        self.entries.extend(moved.extract_if(.., |(_, place)| place.is_none()).map(|(entry, _)| entry));
        moved.sort_by_key(|(_, place)| *place);
        moved.into_iter().for_each(|((heading, number, counts), _)| heading.at(tree, number).extend(counts));
    }

    /// Moves all that is left.
    pub fn move_rest(self, tree: &mut Tree) {
        for (heading, number, counts) in self.entries {
            heading.at(tree, number).extend(counts);
        }
    }
}
