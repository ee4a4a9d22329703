//! Knobs that follow from others: `geometry_units=max(1, pipelines/2)`; and conditions on them: `pipelines*core.per_pipeline<=16`.

use crate::knob::Setting;
use crate::machine::Config;

/// A knob whose value is computed from others.
#[derive(Clone, Debug, PartialEq)]
pub struct Link {
    /// Its path.
    pub path: String,
    /// As written.
    pub text: String,
    formula: Formula,
}

/// A formula over names: of knobs, in whole numbers, or of statistics.
#[derive(Clone, Debug, PartialEq)]
pub enum Formula {
    /// A number.
    Number(u64),
    /// What is at a path.
    Named(String),
    /// Two, combined.
    Of(Operation, Box<Formula>, Box<Formula>),
}

/// What is done with two values.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Operation {
    /// The sum.
    Add,
    /// The difference.
    Subtract,
    /// The product.
    Multiply,
    /// The quotient; of knobs without a remainder.
    Divide,
    /// The smaller one.
    Least,
    /// The larger one.
    Most,
}

impl Formula {
    /// Reads a formula.
    ///
    /// # Errors
    /// What is wrong with the text.
    pub fn parse(text: &str) -> Result<Formula, String> {
        if text.len() > LENGTH {
            return Err(format!("has more than {LENGTH} bytes"));
        }
        let mut reader = Reader { left: text, depth: 0 };
        let formula = reader.sum()?;
        let rest = reader.left.trim_start();
        if rest.is_empty() { Ok(formula) } else { Err(format!("has `{rest}` where it should end")) }
    }

    /// The paths that it reads.
    pub fn reads(&self) -> Vec<&str> {
        fn walk<'f>(formula: &'f Formula, found: &mut Vec<&'f str>) {
            match formula {
                Formula::Number(_) => {}
                Formula::Named(path) => found.push(path),
                Formula::Of(_, a, b) => {
                    walk(a, found);
                    walk(b, found);
                }
            }
        }
        let mut found = Vec::new();
        walk(self, &mut found);
        found
    }

    /// Its value over numbers; none where one of these is not known, or something is divided by 0.
    pub fn real(&self, read: &dyn Fn(&str) -> Option<f64>) -> Option<f64> {
        Some(match self {
            Formula::Number(number) => *number as f64,
            Formula::Named(path) => read(path)?,
            Formula::Of(operation, a, b) => {
                let (a, b) = (a.real(read)?, b.real(read)?);
                match operation {
                    Operation::Add => a + b,
                    Operation::Subtract => a - b,
                    Operation::Multiply => a * b,
                    Operation::Divide if b == 0.0 => return None,
                    Operation::Divide => a / b,
                    Operation::Least => a.min(b),
                    Operation::Most => a.max(b),
                }
            }
        })
    }
}

impl Link {
    /// Reads a link.
    ///
    /// # Errors
    /// What is wrong with the text.
    pub fn parse(text: &str) -> Result<Link, String> {
        let wrong = || "is no link: write it as PATH=FORMULA, with + - * / min() max()".to_owned();
        let (path, formula) = text.split_once('=').ok_or_else(wrong)?;
        Ok(Link { path: Config::path(path).to_owned(), text: text.trim().to_owned(), formula: Formula::parse(formula)? })
    }

    /// The paths that it reads.
    pub fn reads(&self) -> Vec<&str> {
        self.formula.reads()
    }

    /// Its value for a configuration and variables.
    ///
    /// # Errors
    /// If a knob that it reads has no number, or the result is no whole number from 0.
    pub fn value(&self, config: &Config, variables: &[Variable<'_>]) -> Result<u64, String> {
        value(&self.formula, config, variables).map_err(|reason| format!("the link {}: {reason}", self.text))
    }
}

/// A variable that is no knob, with its value.
pub type Variable<'v> = (&'v str, u64);

/// How two numbers must compare.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Comparison {
    AtMost,
    Less,
    AtLeast,
    More,
    Equal,
    Unequal,
}

/// A condition on the knobs and variables of a machine.
#[derive(Clone, Debug, PartialEq)]
pub struct Condition {
    /// As written.
    pub text: String,
    left: Formula,
    comparison: Comparison,
    right: Formula,
}

impl Condition {
    /// Reads a condition.
    ///
    /// # Errors
    /// What is wrong with the text.
    pub fn parse(text: &str) -> Result<Condition, String> {
        // Of two signs with one beginning the longer one comes first.
        let signs = [
            ("<=", Comparison::AtMost),
            (">=", Comparison::AtLeast),
            ("==", Comparison::Equal),
            ("!=", Comparison::Unequal),
            ("<", Comparison::Less),
            (">", Comparison::More),
        ];
        let found = signs.into_iter().find_map(|(sign, comparison)| Some((text.split_once(sign)?, comparison)));
        let ((left, right), comparison) =
            found.ok_or("is no condition: write it as FORMULA<=FORMULA, with <= < >= > == or !=")?;
        Ok(Condition { text: text.trim().to_owned(), left: Formula::parse(left)?, comparison, right: Formula::parse(right)? })
    }

    /// The paths that it reads.
    pub fn reads(&self) -> Vec<&str> {
        [self.left.reads(), self.right.reads()].concat()
    }

    /// Whether a configuration and variables meet it.
    ///
    /// # Errors
    /// If a knob that it reads has no number, or a side is no whole number from 0.
    pub fn holds(&self, config: &Config, variables: &[Variable<'_>]) -> Result<bool, String> {
        let side = |formula: &Formula| {
            value(formula, config, variables).map_err(|reason| format!("the condition {}: {reason}", self.text))
        };
        let (left, right) = (side(&self.left)?, side(&self.right)?);
        Ok(match self.comparison {
            Comparison::AtMost => left <= right,
            Comparison::Less => left < right,
            Comparison::AtLeast => left >= right,
            Comparison::More => left > right,
            Comparison::Equal => left == right,
            Comparison::Unequal => left != right,
        })
    }
}

fn value(formula: &Formula, config: &Config, variables: &[Variable<'_>]) -> Result<u64, String> {
    match formula {
        Formula::Number(number) => Ok(*number),
        Formula::Named(path) => match variables.iter().find(|(known, _)| known == path) {
            Some((_, number)) => Ok(*number),
            None => knob(path, config),
        },
        Formula::Of(operation, a, b) => {
            let (a, b) = (value(a, config, variables)?, value(b, config, variables)?);
            let result = match operation {
                Operation::Add => a.checked_add(b),
                Operation::Subtract => a.checked_sub(b),
                Operation::Multiply => a.checked_mul(b),
                Operation::Divide if b == 0 => return Err(format!("{a} is divided by 0")),
                Operation::Divide if a % b != 0 => {
                    return Err(format!(
                        "{a} / {b} is no whole number; leave such machines out, or use max(1, ...) and multiples"
                    ));
                }
                Operation::Divide => Some(a / b),
                Operation::Least => Some(a.min(b)),
                Operation::Most => Some(a.max(b)),
            };
            result.ok_or_else(|| format!("{a} and {b} give no whole number from 0 to 2^64 - 1"))
        }
    }
}

/// The number that a knob of a configuration has.
fn knob(path: &str, config: &Config) -> Result<u64, String> {
    match config.knob("the link", path).map_err(|error| error.to_string())? {
        (_, Setting::Number(number)) => Ok(number),
        (_, other) => Err(format!("{path} is {other}, and no number")),
    }
}

/// Bytes of a link at most: a formula is walked level by level, and a sum of n terms has n levels.
const LENGTH: usize = 1000;

/// Levels of brackets at most.
const DEPTH: u32 = 32;

struct Reader<'t> {
    left: &'t str,
    depth: u32,
}

impl Reader<'_> {
    fn takes(&mut self, token: &str) -> bool {
        match self.left.trim_start().strip_prefix(token) {
            Some(rest) => {
                self.left = rest;
                true
            }
            None => false,
        }
    }

    fn sum(&mut self) -> Result<Formula, String> {
        self.depth += 1;
        if self.depth > DEPTH {
            return Err(format!("has more than {DEPTH} levels of brackets"));
        }
        let mut left = self.product()?;
        loop {
            let operation = match () {
                () if self.takes("+") => Operation::Add,
                () if self.takes("-") => Operation::Subtract,
                () => break,
            };
            left = Formula::Of(operation, Box::new(left), Box::new(self.product()?));
        }
        self.depth -= 1;
        Ok(left)
    }

    fn product(&mut self) -> Result<Formula, String> {
        let mut left = self.term()?;
        loop {
            let operation = match () {
                () if self.takes("*") => Operation::Multiply,
                () if self.takes("/") => Operation::Divide,
                () => return Ok(left),
            };
            left = Formula::Of(operation, Box::new(left), Box::new(self.term()?));
        }
    }

    fn term(&mut self) -> Result<Formula, String> {
        for (name, operation) in [("min(", Operation::Least), ("max(", Operation::Most)] {
            if self.takes(name) {
                let first = self.sum()?;
                self.expect(",")?;
                let second = self.sum()?;
                self.expect(")")?;
                return Ok(Formula::Of(operation, Box::new(first), Box::new(second)));
            }
        }
        if self.takes("(") {
            let inner = self.sum()?;
            self.expect(")")?;
            return Ok(inner);
        }
        let left = self.left.trim_start();
        let end = left.find(|c: char| !(c.is_ascii_alphanumeric() || c == '_' || c == '.')).unwrap_or(left.len());
        let (word, rest) = left.split_at(end);
        self.left = rest;
        match word {
            "" if rest.is_empty() => Err("ends where a number or a knob is missing".into()),
            "" => Err(format!("has `{rest}` where a number or a knob should be")),
            word if word.starts_with(|c: char| c.is_ascii_digit()) => {
                word.parse().map(Formula::Number).map_err(|_| format!("has `{word}`, which is no whole number"))
            }
            word => Ok(Formula::Named(Config::path(word).to_owned())),
        }
    }

    fn expect(&mut self, token: &str) -> Result<(), String> {
        if self.takes(token) { Ok(()) } else { Err(format!("misses `{token}`")) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(text: &str) -> Result<u64, String> {
        let config = Config::built_in("baseline").expect("it is built in");
        Link::parse(text)?.value(&config, &[("size", 4096)])
    }

    #[test]
    fn formulae_over_knobs() {
        assert_eq!(of("geometry_units=card.pipelines/2"), Ok(2));
        assert_eq!(of("card.geometry_units = max(1, pipelines / 4) + 2 * 3"), Ok(7));
        assert_eq!(of("geometry_units=(1+2)*3-min(4,9)"), Ok(5));
        assert_eq!(of("geometry_units=size/1024"), Ok(4));
        let link = Link::parse("card.geometry_units=max(pipelines, memory.dram.channels)").expect("a link");
        assert_eq!(link.path, "geometry_units");
        assert_eq!(link.reads(), ["pipelines", "memory.dram.channels"]);
    }

    #[test]
    fn what_gives_no_whole_number_is_refused() {
        for (text, told) in [
            ("geometry_units", "no link"),
            ("geometry_units=pipelines/3", "4 / 3 is no whole number"),
            ("geometry_units=pipelines/0", "divided by 0"),
            ("geometry_units=1-2", "no whole number"),
            ("geometry_units=sort", "no number"),
            ("geometry_units=pipelnes", "pipelines is the nearest"),
            ("geometry_units=2 2", "where it should end"),
            ("geometry_units=(2", "misses `)`"),
            ("geometry_units=2+", "is missing"),
            ("geometry_units=2x", "no whole number"),
            ("geometry_units=99999999999999999999", "no whole number"),
            ("geometry_units=18446744073709551615*2", "no whole number"),
        ] {
            let error = of(text).unwrap_err();
            assert!(error.contains(told), "{text}: {error}");
        }
        let deep = format!("geometry_units={}1", "(".repeat(100));
        assert!(of(&deep).unwrap_err().contains("brackets"));
        let long = format!("geometry_units=1{}", "+1".repeat(500_000));
        assert!(of(&long).unwrap_err().contains("more than 1000 bytes"));
    }

    #[test]
    fn conditions_compare_two_formulae() {
        let config = Config::built_in("baseline").expect("it is built in");
        let of = |text: &str| Condition::parse(text)?.holds(&config, &[("size", 4096)]);
        for (text, holds) in [
            ("pipelines*2<=8", true),
            ("pipelines*2 < 8", false),
            ("size>=4096", true),
            ("size > 4096", false),
            ("size/pipelines==1024", true),
            ("size != 4096", false),
        ] {
            assert_eq!(of(text), Ok(holds), "{text}");
        }
        for (text, told) in [
            ("pipelines", "no condition"),
            ("pipelines<", "is missing"),
            ("1/3 < 2", "no whole number"),
            ("sort<2", "no number"),
        ] {
            let error = of(text).unwrap_err();
            assert!(error.contains(told), "{text}: {error}");
        }
    }

    #[test]
    fn formulae_over_statistics() {
        let read = |path: &str| {
            [("hits", 3.0), ("all", 8.0), ("none", 0.0)].into_iter().find(|(name, _)| *name == path).map(|own| own.1)
        };
        let of = |text: &str| Formula::parse(text).expect("a formula").real(&read);
        assert_eq!(
            [of("1-hits/all"), of("max(hits, 2*all)"), of("hits/none"), of("hits+misses")],
            [Some(0.625), Some(16.0), None, None]
        );
    }

    proptest::proptest! {
        #[test]
        fn any_text_is_computed_or_refused(text in "[a-z_.]{0,12}=[0-9a-z_.+*/(), -]{0,60}", other in ".{0,80}") {
            for text in [text, other] {
                let _ = of(&text);
            }
        }
    }
}
