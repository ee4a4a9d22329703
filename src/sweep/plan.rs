//! The machines of an experiment.

use anyhow::{Result, anyhow, bail};

use super::area::area;
use super::entry::Keep;
use super::experiment::{Design, Experiment, Search};
use super::link::{Condition, Formula, Link, Variable};
use super::values::{numbers, values};
use crate::knob::Setting;
use crate::machine::{Config, ConfigError};
use crate::num::Random;
use crate::report::pages::Glossary;

/// What a formula of the cost calls the bytes of the [area model](super::area).
const AREA: &str = "area";

/// Machines of a plan that is not asked to be larger.
pub const MOST_MACHINES: u64 = 1_000_000;

/// A knob or a variable, and the values that it takes.
#[derive(Clone, Debug, PartialEq)]
pub struct Axis {
    /// The path of a knob; the name of a variable.
    pub path: String,
    /// Whether it is a variable: no knob, but a number that links and conditions read.
    pub is_variable: bool,
    /// Its values, in the order in which they were written.
    pub values: Vec<Setting>,
}

/// One machine of a plan.
#[derive(Clone, Debug)]
pub struct Planned {
    /// Its number in the plan, from 0.
    pub number: u32,
    /// The values of the axes and then of the links, by [`Plan::parameters`].
    pub settings: Vec<Setting>,
    /// Its configuration, or which rule between knobs it breaks.
    pub config: Result<Config, String>,
}

/// All machines of an experiment. A machine is made when it is asked for.
#[derive(Clone, Debug)]
pub struct Plan {
    base: Config,
    axes: Vec<Axis>,
    links: Vec<Link>,
    /// Conditions over knobs that no link sets and over variables, and then all others: what the first ones exclude has no links.
    conditions: [Vec<Condition>; 2],
    /// Combinations that do not meet a condition.
    excluded: u64,
    /// How many machines break a rule between knobs, and which rule the first of them breaks.
    broken: Option<(u32, String)>,
    /// What a machine costs; none: the experiment does not say.
    cost: Option<Link>,
    /// What is measured of machines beside cycles: the name, or the formula's text, and the formula.
    measures: Vec<(String, Formula)>,
    chosen: Chosen,
}

/// Which values the machines have.
#[derive(Clone, Debug)]
enum Chosen {
    /// All combinations; the last axis changes fastest.
    Grid(u32),
    /// For each machine, the place of its value on each axis; none: the base's.
    Listed(Vec<Vec<Option<u32>>>),
}

impl Plan {
    /// Plans an experiment on a base configuration, which has the experiment's settings. `most` bounds the number of machines.
    ///
    /// # Errors
    /// If an axis or a link names no knob, a value is out of its range, an axis is given twice, nothing reads a variable, no combination meets the
    /// conditions, or there are too many machines.
    pub fn new(base: Config, experiment: &Experiment, most: u64) -> Result<Plan> {
        let mut axes: Vec<Axis> = Vec::new();
        for text in &experiment.vary {
            let (path, written) =
                text.split_once('=').ok_or_else(|| anyhow!("the axis `{text}` is not written as PATH=VALUES"))?;
            let (knob, _) = base.knob("--vary", path)?;
            let path = Config::path(path).to_owned();
            let values = values(knob, written).map_err(|reason| anyhow!("the axis {path} {reason}"))?;
            if axes.iter().any(|axis| axis.path == path) {
                bail!("the axis {path} is given twice");
            }
            axes.push(Axis { path, is_variable: false, values });
        }
        for text in &experiment.variables {
            let (name, written) =
                text.split_once('=').ok_or_else(|| anyhow!("the variable `{text}` is not written as NAME=VALUES"))?;
            let name = name.trim();
            let is_word = name.starts_with(|c: char| c.is_ascii_alphabetic())
                && name.chars().all(|c| c.is_ascii_alphanumeric() || c == '_');
            if !is_word {
                bail!("the variable `{text}` has no name of letters, digits and _ before the =");
            }
            if base.knob("--let", name).is_ok() {
                bail!("the variable {name} has the name of a knob: use --vary, or another name");
            }
            let values = numbers(written).map_err(|reason| anyhow!("the variable {name} {reason}"))?;
            if axes.iter().any(|axis| axis.path == name) {
                bail!("the variable {name} is given twice");
            }
            axes.push(Axis { path: name.to_owned(), is_variable: true, values });
        }
        let is_variable = |path: &str| axes.iter().any(|axis| axis.is_variable && axis.path == path);
        let mut links: Vec<Link> = Vec::new();
        for text in &experiment.link {
            let link = Link::parse(text).map_err(|reason| anyhow!("the link `{text}` {reason}"))?;
            base.knob("--link", &link.path)?;
            for path in link.reads().into_iter().filter(|path| !is_variable(path)) {
                base.knob("--link", path)?;
            }
            if axes.iter().any(|axis| axis.path == link.path) || links.iter().any(|known| known.path == link.path) {
                bail!("the link `{text}` sets {}, which is set by another axis or link, too", link.path);
            }
            // Links are computed in their order, so that each sees those before it.
            if let Some(later) = links.iter().find(|known| known.reads().contains(&link.path.as_str())) {
                bail!("the link {} reads {}, which a later link sets: change their order", later.text, link.path);
            }
            links.push(link);
        }
        let mut conditions = [Vec::new(), Vec::new()];
        for text in &experiment.conditions {
            let condition = Condition::parse(text).map_err(|reason| anyhow!("the condition `{text}` {reason}"))?;
            for path in condition.reads().into_iter().filter(|path| !is_variable(path)) {
                base.knob("--where", path)?;
            }
            let linked = condition.reads().iter().any(|path| links.iter().any(|link| link.path == *path));
            conditions[usize::from(linked)].push(condition);
        }
        for axis in axes.iter().filter(|axis| axis.is_variable) {
            let linked = links.iter().any(|link| link.reads().contains(&axis.path.as_str()));
            if !linked {
                bail!("no link reads the variable {}: it changes no machine", axis.path);
            }
        }
        if experiment.screen.is_some() && experiment.search.is_some() {
            bail!("the experiment has a screen and a search, which both choose the machines that are simulated: leave one out");
        }
        if let Some(Search::Halving { machines: 0 }) = experiment.search {
            bail!("the search asks for 0 machines");
        }
        let chosen = choose(&base, &axes, &experiment.design, most)?;
        let cost = match experiment.cost.trim() {
            "" => None,
            text => {
                // A link of which only the formula counts.
                let link = Link::parse(&format!("cost={text}")).map_err(|reason| anyhow!("the cost `{text}` {reason}"))?;
                for path in link.reads().into_iter().filter(|path| *path != AREA) {
                    base.knob("--cost", path)?;
                }
                Some(link)
            }
        };
        let mut plan =
            Plan { base, axes, links, conditions, excluded: 0, broken: None, cost, measures: measures(experiment)?, chosen };
        plan.exclude()?;
        // A link that gives no number or one that its knob does not take is found before anything runs.
        for number in 0..plan.len() {
            let Some((config, _)) = plan.settings(number)? else { continue };
            if !plan.cost.as_ref().is_some_and(|cost| cost.reads().contains(&AREA)) {
                plan.cost(&config)?;
            }
            if let Err(error) = config.check() {
                plan.broken.get_or_insert_with(|| (0, rule(&config, &error))).0 += 1;
            }
        }
        Ok(plan)
    }

    /// Leaves out the combinations that do not meet the conditions.
    fn exclude(&mut self) -> Result<()> {
        if self.conditions.iter().all(Vec::is_empty) {
            return Ok(());
        }
        let mut kept = Vec::new();
        for number in 0..self.len() {
            if self.settings(number)?.is_some() {
                kept.push(self.places(number).into_iter().map(|place| place.map(|place| place as u32)).collect());
            } else {
                self.excluded += 1;
            }
        }
        if kept.is_empty() {
            bail!("none of {} combinations meets the conditions", self.excluded);
        }
        self.chosen = Chosen::Listed(kept);
        Ok(())
    }

    /// How many machines break a rule between knobs, so that they cannot be run, and the rule that the first of them breaks.
    pub fn broken(&self) -> Option<(u32, &str)> {
        self.broken.as_ref().map(|(count, rule)| (*count, rule.as_str()))
    }

    /// Combinations that are no machines, because they do not meet a condition.
    pub fn excluded(&self) -> u64 {
        self.excluded
    }

    /// The setting that an axis has in the base: the knob's own, or the first value of a variable.
    pub fn base_setting(&self, axis: &Axis) -> Result<Setting> {
        base_setting(&self.base, axis)
    }

    /// What a machine costs; none where the experiment does not say.
    ///
    /// # Errors
    /// If the formula gives no whole number, or reads the area of a machine that cannot be built.
    pub fn cost(&self, config: &Config) -> Result<Option<u64>> {
        let Some(cost) = &self.cost else { return Ok(None) };
        let area = cost.reads().contains(&AREA).then(|| area(config)).transpose()?;
        let variables: Vec<Variable<'_>> = area.map(|area| (AREA, area)).into_iter().collect();
        cost.value(config, &variables).map(Some).map_err(|reason| anyhow!(reason.replace("the link cost=", "the cost ")))
    }

    /// What is measured of machines beside cycles: the name of each, or its text where it has none, and the formula.
    pub fn measures(&self) -> &[(String, Formula)] {
        &self.measures
    }

    /// The configuration that is varied.
    pub fn base(&self) -> &Config {
        &self.base
    }

    /// The axes.
    pub fn axes(&self) -> &[Axis] {
        &self.axes
    }

    /// Paths of the knobs in which machines differ: axes, then links.
    pub fn parameters(&self) -> Vec<&str> {
        self.axes.iter().map(|axis| axis.path.as_str()).chain(self.links.iter().map(|link| link.path.as_str())).collect()
    }

    /// How many machines there are.
    pub fn len(&self) -> u32 {
        match &self.chosen {
            Chosen::Grid(machines) => *machines,
            Chosen::Listed(list) => list.len() as u32,
        }
    }

    /// Whether there is none.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The place of a machine's value on each axis; none: the base's.
    fn places(&self, number: u32) -> Vec<Option<usize>> {
        let mut left = number as usize;
        let mut places = vec![None; self.axes.len()];
        match &self.chosen {
            Chosen::Grid(_) => {
                for (axis, place) in self.axes.iter().zip(&mut places).rev() {
                    *place = Some(left % axis.values.len());
                    left /= axis.values.len();
                }
            }
            Chosen::Listed(list) => {
                for (own, place) in list[left].iter().zip(&mut places) {
                    *place = own.map(|place| place as usize);
                }
            }
        }
        places
    }

    /// The configuration of a machine before rules between knobs are looked at, and its parameters. None if a condition is not met.
    fn settings(&self, number: u32) -> Result<Option<(Config, Vec<Setting>)>> {
        let mut config = self.base.clone();
        let mut settings = Vec::with_capacity(self.axes.len() + self.links.len());
        let mut variables: Vec<Variable<'_>> = Vec::new();
        for (axis, place) in self.axes.iter().zip(self.places(number)) {
            let value = match place {
                Some(place) => axis.values[place].clone(),
                None => self.base_setting(axis)?,
            };
            match &value {
                Setting::Number(number) if axis.is_variable => variables.push((&axis.path, *number)),
                value => config.put("--vary", &axis.path, value)?,
            }
            settings.push(value);
        }
        let meets = |config: &Config, conditions: &[Condition]| -> Result<bool> {
            for condition in conditions {
                if !condition.holds(config, &variables).map_err(|reason| anyhow!(reason))? {
                    return Ok(false);
                }
            }
            Ok(true)
        };
        if !meets(&config, &self.conditions[0])? {
            return Ok(None);
        }
        for link in &self.links {
            let place = || format!("machine {number}, {}", described(&self.parameters(), &settings));
            let value = link.value(&config, &variables).map_err(|reason| anyhow!("{}: {reason}", place()))?;
            let value = Setting::Number(value);
            config.put(&place(), &link.path, &value)?;
            settings.push(value);
        }
        Ok(meets(&config, &self.conditions[1])?.then_some((config, settings)))
    }

    /// A machine.
    ///
    /// # Errors
    /// Those of a link, which [`Plan::new`] has found.
    pub fn machine(&self, number: u32) -> Result<Planned> {
        let (mut config, settings) =
            self.settings(number)?.ok_or_else(|| anyhow!("machine {number} does not meet a condition"))?;
        config.name = format!("{} with {}", self.base.name, described(&self.parameters(), &settings));
        let config = match config.check() {
            Ok(()) => Ok(config),
            Err(error) => Err(rule(&config, &error)),
        };
        Ok(Planned { number, settings, config })
    }
}

/// The measures of an experiment, of statistics that there are and that it keeps.
fn measures(experiment: &Experiment) -> Result<Vec<(String, Formula)>> {
    let (glossary, keep) = (Glossary::default(), Keep::new(&experiment.keep));
    let read = |text: &String| -> Result<(String, Formula)> {
        // A name, or the formula itself.
        let (name, formula) = text.split_once('=').unwrap_or((text, text));
        if name.trim().is_empty() {
            bail!("the measure `{text}` has no name before the =");
        }
        let formula = Formula::parse(formula).map_err(|reason| anyhow!("the measure `{text}` {reason}"))?;
        for path in formula.reads() {
            if glossary.find(path).is_none() {
                let nearest = glossary.nearest(path).map_or(String::new(), |nearest| format!("; {nearest} is the nearest"));
                bail!("the measure `{text}` reads {path}, which is no statistic{nearest}; docs/data/statistics.md lists them");
            }
            // Both are kept whatever else is.
            if !matches!(path, "cycles" | "seconds") && !keep.keeps(path) {
                bail!("the measure `{text}` reads {path}, which the experiment does not keep: add it to `keep`");
            }
        }
        Ok((name.trim().to_owned(), formula))
    };
    experiment.measures.iter().map(read).collect()
}

/// The rule that a configuration breaks, alone: which machine it is stands beside it.
fn rule(config: &Config, error: &ConfigError) -> String {
    error.to_string().trim_start_matches(&format!("{}: ", config.name)).to_owned()
}

/// Settings as the command line takes them.
pub fn described(paths: &[&str], settings: &[Setting]) -> String {
    let text = |(path, setting): (&&str, &Setting)| match setting {
        Setting::Name(name) => format!("{path}={name}"),
        other => format!("{path}={other}"),
    };
    paths.iter().zip(settings).map(text).collect::<Vec<_>>().join(" ")
}

fn base_setting(base: &Config, axis: &Axis) -> Result<Setting> {
    Ok(if axis.is_variable { axis.values[0].clone() } else { base.knob("the base", &axis.path)?.1 })
}

fn choose(base: &Config, axes: &[Axis], design: &Design, most: u64) -> Result<Chosen> {
    let fits = |machines: u64| {
        if machines > most {
            bail!(
                "these are {machines} machines; more than {most} are run with --yes only; a random or latin-hypercube design takes a part of them"
            )
        }
        u32::try_from(machines).map_err(|_| anyhow!("these are {machines} machines, and a plan has at most {}", u32::MAX))
    };
    let drawn = |machines: u32| {
        if machines == 0 { bail!("the design asks for 0 machines") } else { fits(u64::from(machines)) }
    };
    Ok(match design {
        Design::Grid => {
            let machines = axes.iter().try_fold(1_u64, |product, axis| product.checked_mul(axis.values.len() as u64));
            Chosen::Grid(fits(machines.unwrap_or(u64::MAX))?)
        }
        Design::OneAtATime => {
            fits(1 + axes.iter().map(|axis| axis.values.len() as u64).sum::<u64>())?;
            let base: Vec<Setting> = axes.iter().map(|axis| base_setting(base, axis)).collect::<Result<_>>()?;
            let mut list = vec![vec![None; axes.len()]];
            for (at, axis) in axes.iter().enumerate() {
                // A value that the base has is the base.
                for place in (0..axis.values.len()).filter(|&place| axis.values[place] != base[at]) {
                    let mut machine = vec![None; axes.len()];
                    machine[at] = Some(place as u32);
                    list.push(machine);
                }
            }
            Chosen::Listed(list)
        }
        Design::Random { machines, seed } => {
            let machines = drawn(*machines)?;
            let mut random = Random::new(*seed);
            let one =
                |random: &mut Random| axes.iter().map(|axis| Some(random.below(axis.values.len() as u32))).collect::<Vec<_>>();
            Chosen::Listed((0..machines).map(|_| one(&mut random)).collect())
        }
        Design::LatinHypercube { machines, seed } => {
            let machines = drawn(*machines)?;
            let mut list = vec![vec![None; axes.len()]; machines as usize];
            for (at, axis) in axes.iter().enumerate() {
                // Each value as often as the others, in a random order; which values come once more is random, too.
                let mut random = Random::nth(*seed, at as u64);
                let mut values: Vec<u32> = (0..axis.values.len() as u32).collect();
                let mut column = Vec::with_capacity(machines as usize);
                while column.len() < machines as usize {
                    random.shuffle(&mut values);
                    column.extend(values.iter().take(machines as usize - column.len()));
                }
                random.shuffle(&mut column);
                list.iter_mut().zip(column).for_each(|(machine, place)| machine[at] = Some(place));
            }
            Chosen::Listed(list)
        }
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn plan(text: &str) -> Result<Plan> {
        let experiment = Experiment::parse("e.ron", &format!("(traces: [\"a\"], {text})"))?;
        Plan::new(Config::built_in("baseline")?, &experiment, 1000)
    }

    fn all(text: &str) -> Vec<String> {
        let plan = plan(text).expect("a plan");
        let machine = |number| described(&plan.parameters(), &plan.machine(number).expect("a machine").settings);
        (0..plan.len()).map(machine).collect()
    }

    #[test]
    fn a_grid_has_all_combinations_and_links_follow() {
        let machines =
            all(r#"vary: ["card.pipelines=2,4", "memory.kind=all"], link: ["card.geometry_units=card.pipelines/2"]"#);
        assert_eq!(
            machines,
            [
                "pipelines=2 memory.kind=dram geometry_units=1",
                "pipelines=2 memory.kind=ideal geometry_units=1",
                "pipelines=4 memory.kind=dram geometry_units=2",
                "pipelines=4 memory.kind=ideal geometry_units=2",
            ]
        );
        assert_eq!(all("").len(), 1, "the base alone");
    }

    #[test]
    fn variables_are_axes_that_links_read_and_conditions_leave_combinations_out() {
        let links = r#"vary: ["texture.line_bytes=64,128"], let: ["size=2048..8192*2"], link: ["texture.cache_lines=size/texture.line_bytes"]"#;
        let machines = all(links);
        assert_eq!((machines.len(), machines[1].as_str()), (6, "texture.line_bytes=64 size=4096 texture.cache_lines=64"));
        let limited = all(&format!(r#"{links}, where: ["texture.cache_lines<=64", "size != 2048"]"#));
        assert_eq!(
            limited,
            [
                "texture.line_bytes=64 size=4096 texture.cache_lines=64",
                "texture.line_bytes=128 size=4096 texture.cache_lines=32",
                "texture.line_bytes=128 size=8192 texture.cache_lines=64",
            ]
        );
        let counted = plan(&format!(r#"{links}, where: ["texture.cache_lines<=64"]"#)).expect("a plan");
        assert_eq!((counted.len(), counted.excluded()), (5, 1));
        // What a condition excludes needs no link that holds.
        let odd = all(
            r#"vary: ["pipelines=1..4"], link: ["geometry_units=pipelines/2"], where: ["pipelines != 1", "pipelines != 3"]"#,
        );
        assert_eq!(odd, ["pipelines=2 geometry_units=1", "pipelines=4 geometry_units=2"]);
        let one = all(&format!("{links}, design: one_at_a_time"));
        assert_eq!((one.len(), one[0].contains("size=2048")), (4, true));
    }

    #[test]
    fn one_at_a_time_begins_with_the_base_and_has_it_once() {
        let machines = all(r#"vary: ["pipelines=1,4,8", "depth.early=all"], design: one_at_a_time"#);
        assert_eq!(
            machines,
            [
                "pipelines=4 depth.early=true",
                "pipelines=1 depth.early=true",
                "pipelines=8 depth.early=true",
                "pipelines=4 depth.early=false"
            ]
        );
    }

    #[test]
    fn a_latin_hypercube_has_every_value_equally_often() {
        let machines =
            all(r#"vary: ["pipelines=1..4", "geometry_units=1..3"], design: latin_hypercube(machines: 12, seed: 7)"#);
        for (value, times) in [("pipelines=1 ", 3), ("pipelines=4 ", 3), ("geometry_units=1", 4), ("geometry_units=3", 4)] {
            assert_eq!(machines.iter().filter(|machine| machine.contains(value)).count(), times, "{value}: {machines:?}");
        }
        let random = |seed| all(&format!(r#"vary: ["pipelines=1..64"], design: random(machines: 20, seed: {seed})"#));
        assert_eq!(random(1), random(1));
        assert_ne!(random(1), random(2));
    }

    #[test]
    fn a_rule_between_knobs_is_one_machines_own_error() {
        let plan = plan(r#"vary: ["memory.l2.slices=3,16"]"#).expect("a plan");
        let error = plan.machine(0).expect("a machine").config.expect_err("three slices for eight channels");
        assert!(error.contains("memory.l2.slices") && !error.contains(" with "), "{error}");
        assert_eq!(plan.broken(), Some((1, error.as_str())));
        assert!(plan.machine(1).expect("a machine").config.is_ok());
    }

    #[test]
    fn what_cannot_be_planned_is_refused() {
        for (text, told) in [
            (r#"vary: ["pipelnes=1..4"]"#, "pipelines is the nearest"),
            (r#"vary: ["pipelines"]"#, "PATH=VALUES"),
            (r#"vary: ["pipelines="]"#, "the axis pipelines has an empty value"),
            (r#"vary: ["pipelines=0..4"]"#, "the axis pipelines has the value 0"),
            (r#"vary: ["pipelines=1", "card.pipelines=2"]"#, "given twice"),
            (
                r#"vary: ["pipelines=1..4"], link: ["geometry_units=pipelines/2"]"#,
                "machine 0, pipelines=1: the link geometry_units=pipelines/2: 1 / 2 is no whole number",
            ),
            (r#"vary: ["pipelines=1..64"], link: ["geometry_units=pipelines"]"#, "geometry_units is 17"),
            (r#"vary: ["pipelines=1"], link: ["pipelines=2"]"#, "set by another"),
            (r#"link: ["pipelines=geometry_units", "geometry_units=2"]"#, "change their order"),
            (r#"link: ["pipelines=geometry_unit"]"#, "geometry_units is the nearest"),
            (r#"vary: ["pipelines=1..64", "memory.dram.banks=1..64"]"#, "4096 machines; more than 1000"),
            (r#"design: random(machines: 0, seed: 1)"#, "0 machines"),
            (r#"let: ["size=1,2"]"#, "no link reads the variable size"),
            (r#"let: ["pipelines=1,2"]"#, "has the name of a knob"),
            (r#"let: ["a b=1"]"#, "has no name of letters"),
            (r#"let: ["size=all"]"#, "which is no whole number"),
            (r#"let: ["size=1,1"], link: ["pipelines=size"]"#, "twice"),
            (r#"vary: ["pipelines=1..4"], where: ["pipelines>4"]"#, "none of 4 combinations meets the conditions"),
            (r#"where: ["pipelnes>4"]"#, "pipelines is the nearest"),
            (r#"where: ["pipelines"]"#, "is no condition"),
            (r#"screen: (keep: 1), search: halving(machines: 8)"#, "a screen and a search"),
            (r#"search: halving(machines: 0)"#, "0 machines"),
            (r#"cost: "aria""#, "there is no key aria"),
            (r#"measures: ["=cycles"]"#, "has no name"),
            (r#"measures: ["a=b=cycles"]"#, "the measure `a=b=cycles` has `=cycles`"),
        ] {
            let error = format!("{:#}", plan(text).map(|_| ()).unwrap_err());
            assert!(error.contains(told), "{text}: {error}");
        }
    }
}
