//! What units count in addition to their items and their cycles.

use super::unit::Unit;
use num::Cycle;
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
type Read<U> = Box<dyn Fn(&U, (usize, Cycle), &mut Vec<u64>) -> Option<usize>>;

/// The groups of counters of a kind of unit.
pub struct Counted<U> {
    descriptions: Vec<Description>,
    reads: Vec<Read<U>>,
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
        self.numbered_if(heading, move |unit, (number, _)| Some((number, read(unit))));
    }

    /// A group that some do not have.
    pub fn group_if<G: Group>(&mut self, heading: Heading, read: fn(&U) -> Option<G>) {
        self.numbered_if(heading, move |unit, (number, _)| Some((number, read(unit)?)));
    }

    /// A group that some do not have, whose counters go on in cycles in which the unit does not tick. They are read up to a cycle.
    pub fn timed_if<G: Group>(&mut self, heading: Heading, read: fn(&U, Cycle) -> Option<G>) {
        self.numbered_if(heading, move |unit, (number, cycle)| Some((number, read(unit, cycle)?)));
    }

    /// A group of units that know their numbers, where several banks are of one kind.
    pub fn numbered<G: Group>(&mut self, heading: Heading, read: fn(&U) -> (usize, G)) {
        self.numbered_if(heading, move |unit, _| Some(read(unit)));
    }

    fn numbered_if<G: Group>(&mut self, heading: Heading, read: impl Fn(&U, (usize, Cycle)) -> Option<(usize, G)> + 'static) {
        let append = move |unit: &U, at: (usize, Cycle), values: &mut Vec<u64>| {
            let (number, counts) = read(unit, at)?;
            values.extend(counts.values());
            Some(number)
        };
        self.descriptions.push(Description { heading, declarations: G::DECLARATIONS });
        self.reads.push(Box::new(append));
    }

    pub(super) fn read(&self, units: &[U], cycle: Cycle, sheet: &mut Sheet) {
        for (description, read) in self.descriptions.iter().zip(&self.reads) {
            let before = sheet.numbers.len();
            let numbers = units.iter().enumerate().filter_map(|(number, unit)| read(unit, (number, cycle), &mut sheet.values));
            sheet.numbers.extend(numbers);
            sheet.kinds.push((*description, sheet.numbers.len() - before));
        }
    }

    pub(super) fn describe(&self, list: &mut Vec<Description>) {
        list.extend_from_slice(&self.descriptions);
    }
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

/// What the units of a machine have counted in addition to their items, up to now or between two readings.
#[derive(Clone, Debug, Default)]
pub struct Sheet {
    /// The groups, in data-flow order, each with the number of units that have it.
    kinds: Vec<(Description, usize)>,
    /// The numbers of these units.
    numbers: Vec<usize>,
    /// The values of these units.
    values: Vec<u64>,
}

impl Sheet {
    /// What was counted since an earlier reading of the same machine.
    pub fn since(&self, earlier: &Sheet) -> Sheet {
        debug_assert_eq!(self.numbers, earlier.numbers, "a unit has the same groups all the time");
        let values = self.values.iter().zip(&earlier.values).map(|(now, then)| now - then).collect();
        Sheet { kinds: self.kinds.clone(), numbers: self.numbers.clone(), values }
    }

    /// Adds what a machine of the same configuration has counted.
    pub fn add(&mut self, later: &Sheet) {
        self.values.iter_mut().zip(&later.values).for_each(|(sum, own)| *sum += own);
    }

    /// The groups, each with the numbers of its units and their values.
    fn kinds(&self) -> impl Iterator<Item = (&Description, &[usize], &[u64])> {
        let (mut numbers, mut values) = (&self.numbers[..], &self.values[..]);
        self.kinds.iter().map(move |(description, units)| {
            let own = (numbers.split_at(*units), values.split_at(units * description.declarations.len()));
            (numbers, values) = (own.0.1, own.1.1);
            (description, own.0.0, own.1.0)
        })
    }

    /// Puts groups into a tree, in the order of the places of their headings, and at one place in data-flow order. Groups without a place are
    /// left out.
    pub fn put(&self, tree: &mut Tree, place: impl Fn(&Heading) -> Option<usize>) {
        let mut placed: Vec<_> = self.kinds().filter_map(|kind| Some((place(&kind.0.heading)?, kind))).collect();
        placed.sort_by_key(|(place, _)| *place);
        for (_, (Description { heading, declarations }, numbers, values)) in placed {
            for (&number, values) in numbers.iter().zip(values.chunks_exact(declarations.len())) {
                let unit = heading.at(tree, number);
                unit.reserve(declarations.len());
                declarations.iter().zip(values).for_each(|(declaration, &value)| unit.count(declaration.name, value));
            }
        }
    }

    /// What all units together have counted below the first step of a heading, by the last step.
    pub fn sums(&self, heading: Heading) -> Vec<Sum> {
        let top = heading.steps().0.next();
        let mut sums: Vec<Sum> = Vec::new();
        for (Description { heading, declarations }, numbers, values) in self.kinds() {
            let (mut steps, _) = heading.steps();
            if numbers.is_empty() || steps.next() != top {
                continue;
            }
            let name = steps.last().unwrap_or_default();
            // Several banks may be of one kind.
            let at = sums.iter().position(|known| known.name == name).unwrap_or(sums.len());
            if at == sums.len() {
                sums.push(Sum { name, declarations, values: vec![0; declarations.len()] });
            }
            for own in values.chunks_exact(declarations.len()) {
                sums[at].values.iter_mut().zip(own).for_each(|(sum, value)| *sum += value);
            }
        }
        sums
    }
}
