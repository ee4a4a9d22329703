//! The block diagram of a machine, drawn from the machine itself: its units and channels as they are wired, banks of equal units as
//! one box, channels of one name between two banks as one line.

mod dot;
mod layout;
mod svg;

use crate::machine::Machine;
use crate::sim::Link;
use crate::unit::network::Names;

/// Units that make up the memory; their boxes name what joins them to others.
const MEMORY: [&str; 5] = ["crossbar", "l2", "dram", "return_path", "ideal"];

/// Equal units.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Bank {
    /// What they are called.
    pub name: &'static str,
    /// How many.
    pub count: usize,
}

/// Parallel channels of one name between two banks, or within one.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Cable {
    /// What they are called.
    pub name: &'static str,
    /// The bank that pushes, by its place.
    pub from: usize,
    /// The bank that pops.
    pub to: usize,
    /// How many.
    pub count: usize,
    /// The shape of the first.
    pub link: Link,
    /// Whether this is where work is sorted.
    pub sorts: bool,
}

/// A machine's banks and cables, in the order in which units and channels are declared.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Diagram {
    /// The configuration's name, its class, its pipelines.
    pub title: String,
    /// Banks, in data-flow order.
    pub banks: Vec<Bank>,
    /// Cables.
    pub cables: Vec<Cable>,
}

impl Diagram {
    /// That of a machine.
    pub fn new(machine: &Machine) -> Diagram {
        let mut banks: Vec<Bank> = Vec::new();
        let mut bank_of = Vec::new();
        for (name, _) in machine.units() {
            let bank = banks.iter().position(|bank| bank.name == name).unwrap_or_else(|| {
                banks.push(Bank { name, count: 0 });
                banks.len() - 1
            });
            banks[bank].count += 1;
            bank_of.push(bank);
        }
        let sorting = [Names::SORT.direct, Names::SORT.inject, Names::SORT.link, Names::SORT.eject];
        let mut cables: Vec<Cable> = Vec::new();
        for wire in machine.wires() {
            let (name, from, to) = (wire.name, bank_of[wire.from], bank_of[wire.to]);
            match cables.iter_mut().find(|cable| (cable.name, cable.from, cable.to) == (name, from, to)) {
                Some(cable) => cable.count += 1,
                None => cables.push(Cable { name, from, to, count: 1, link: wire.link, sorts: sorting.contains(&name) }),
            }
        }
        let card = &machine.config().card;
        let s = if card.pipelines == 1 { "" } else { "s" };
        let (name, class) = (&machine.config().name, card.sort.name());
        let name = if name == class { String::new() } else { format!("{name}: ") };
        let title = format!("{name}{class}, {} pipeline{s}", card.pipelines);
        Diagram { title, banks, cables }
    }

    /// In the language of Graphviz.
    pub fn dot(&self) -> String {
        dot::draw(self)
    }

    /// As a picture.
    pub fn svg(&self) -> String {
        svg::draw(self, &|_| None)
    }

    /// As a picture in which each bank is as dark as it is busy: `busy` answers the share of a bank's cycles, from 0 to 1, by its name.
    pub fn svg_by_use(&self, busy: &dyn Fn(&str) -> Option<f64>) -> String {
        svg::draw(self, busy)
    }

    fn is_memory(&self, bank: usize) -> bool {
        MEMORY.contains(&self.banks[bank].name)
    }
}

/// A name, and how many there are of it if more than one.
fn times(name: &str, count: usize) -> String {
    if count == 1 { name.to_owned() } else { format!("{name} x{count}") }
}

/// What a channel can carry, in words.
fn shape(link: &Link) -> String {
    let what = if link.by_bytes { "bytes" } else { "items" };
    format!("{} {what} per cycle, latency {}, room for {}", link.width, link.latency, link.capacity)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::machine::Config;

    fn diagram(changes: &[&str]) -> Diagram {
        let mut config = Config::built_in("baseline").unwrap();
        for change in changes {
            config.set(change).unwrap();
        }
        Diagram::new(&Machine::new(&config).unwrap())
    }

    #[test]
    fn every_unit_and_every_channel_is_in_it_once() {
        for changes in [
            &[][..],
            &["sort=sort-first", "network.topology=mesh"],
            &["sort=sort-last-fragment", "pipelines=7"],
            &["sort=sort-last-image", "pipelines=3"],
        ] {
            let mut config = Config::built_in("baseline").unwrap();
            changes.iter().for_each(|change| config.set(change).unwrap());
            let machine = Machine::new(&config).unwrap();
            let diagram = Diagram::new(&machine);
            assert_eq!(diagram.banks.iter().map(|bank| bank.count).sum::<usize>(), machine.units().count());
            assert_eq!(diagram.cables.iter().map(|cable| cable.count).sum::<usize>(), machine.wires().count());
            assert!(diagram.cables.iter().any(|cable| cable.sorts));
            assert!(diagram.svg().contains("stroke=\"#c05000\""), "the picture marks where the machine sorts");
        }
    }

    #[test]
    fn counts_are_those_of_the_machine() {
        let diagram = diagram(&["pipelines=6", "geometry_units=3"]);
        let bank = |name: &str| diagram.banks.iter().position(|bank| bank.name == name).unwrap();
        assert_eq!(diagram.banks[bank("setup")].count, 6);
        assert_eq!(diagram.banks[bank("clip")].count, 3);
        let sorted = diagram.cables.iter().find(|cable| cable.name == "sorted").unwrap();
        assert_eq!((sorted.from, sorted.to, sorted.count), (bank("distribute"), bank("setup"), 18));
    }

    #[test]
    fn boxes_of_a_picture_are_apart() {
        for sort in machine::config::SortClass::NAMES {
            for topology in ["point-to-point", "bus", "ring", "butterfly"] {
                let sort = format!("sort={sort}");
                let diagram = diagram(&[&sort, &format!("network.topology={topology}")]);
                let boxes = svg::boxes(&diagram);
                assert_eq!(boxes.len(), diagram.banks.len());
                for (n, a) in boxes.iter().enumerate() {
                    for b in &boxes[..n] {
                        let apart = a.0 + a.2 <= b.0 || b.0 + b.2 <= a.0 || a.1 + a.3 <= b.1 || b.1 + b.3 <= a.1;
                        assert!(apart, "{sort}, {topology}: {a:?} meets {b:?}");
                    }
                }
            }
        }
    }
}
