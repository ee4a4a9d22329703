//! Which machines estimates hold for: a configuration with values that they do not know is refused by name.
//!
//! The declaration of each knob says what estimates do with it ([`Estimate`]). For a knob that changes cycles and that no estimate reads, it
//! has the values for which estimates hold. `fillrate accuracy knobs` sets each to both ends of its range, on the baseline or on a machine that has
//! it, with `bound` and with `cycle`. If cycles moved by more than 5 % and the estimate did not, values were halved or doubled until it followed:
//! estimates hold for those. A knob that moved nothing is ignored.

use std::sync::LazyLock;

use anyhow::{Result, bail};
use knob::{Estimate, Setting, Values};
use machine::Config;

/// A knob that estimates do not read, and the values of it for which they hold.
struct Limit {
    path: String,
    values: Values,
    /// What a machine with another value has that is not estimated.
    unknown: &'static str,
}

/// The limits of all knobs, by path.
static LIMITS: LazyLock<Vec<Limit>> = LazyLock::new(|| {
    let limit = |(path, knob): (String, &knob::Knob)| match knob.estimate {
        Estimate::RefusedUnless(values, unknown) => Some(Limit { path, values, unknown }),
        Estimate::Used | Estimate::UsedBy(_) | Estimate::Ignored(_) => None,
    };
    let mut limits: Vec<Limit> = Config::default().knobs().filter_map(limit).collect();
    limits.sort_by(|a, b| a.path.cmp(&b.path));
    limits
});

/// The built-in configurations on which errors are measured (`docs/data/fidelity.md`) although they have values beyond those of [`LIMITS`].
static MEASURED: LazyLock<[Config; 1]> = LazyLock::new(|| [Config::built_in("tiny").expect("it is built in")]);

/// The cycles of the card that a cycle of DRAM takes at most where estimates hold. With more of them, latencies of memory are longer than what the
/// estimates of small draws have of them.
const SLOWEST_DRAM: u32 = 9;

/// The value of a knob; none where it has no effect.
fn value(config: &Config, path: &str) -> Option<Setting> {
    let (_, setting) = config.knob("", path).expect("a knob of the table");
    config.no_effect(path).is_none().then_some(setting)
}

/// Checks that estimates hold for a configuration. They do if all of its knobs have values for which estimates are known to hold, or if all
/// knobs that no estimate reads have the values of a configuration on which the errors are measured.
///
/// # Errors
/// The first knob that has another value.
pub(super) fn check(config: &Config) -> Result<()> {
    let dram = &config.dram;
    if value(config, "memory.dram.clock").is_some() && dram.card_cycles / dram.clock > SLOWEST_DRAM {
        bail!(
            "a cycle of memory.dram.clock takes {} cycles of the card, and estimates of the bound fidelity hold where it takes {SLOWEST_DRAM} \
             or fewer: they know nothing of latencies of a slow memory; use --fidelity cycle",
            dram.card_cycles / dram.clock
        );
    }
    let broken = |limit: &'static Limit| {
        let setting = value(config, &limit.path).filter(|setting| !limit.values.contain(setting))?;
        Some((limit, setting))
    };
    let Some((Limit { path, values, unknown }, setting)) = LIMITS.iter().find_map(broken) else { return Ok(()) };
    let same = |measured: &Config| LIMITS.iter().all(|limit| value(config, &limit.path) == value(measured, &limit.path));
    if MEASURED.iter().any(same) {
        return Ok(());
    }
    bail!(
        "{path} is {setting}, and estimates of the bound fidelity hold where it is {values}: they know nothing of {unknown}; use \
         --fidelity cycle"
    );
}

#[cfg(test)]
mod tests {
    use knob::Allowed;

    use super::*;

    /// The sources of the estimates, without comments.
    fn sources() -> String {
        let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/src/bound");
        let files = std::fs::read_dir(folder).expect("the folder of this file");
        let files = files.map(|file| file.expect("a file").path()).filter(|path| path.file_name() != Some("known.rs".as_ref()));
        let text: String = files.map(|path| std::fs::read_to_string(path).expect("a source")).collect();
        text.lines().filter(|line| !line.trim_start().starts_with("//")).flat_map(|line| [line, "\n"]).collect()
    }

    /// Whether a source has an expression, as a whole.
    fn has(source: &str, expression: &str) -> bool {
        let is_word = |c: char| c.is_alphanumeric() || c == '_';
        source.match_indices(expression).any(|(at, _)| {
            let (before, after) = (&source[..at], &source[at + expression.len()..]);
            !before.ends_with(is_word) && !after.starts_with(is_word)
        })
    }

    #[test]
    fn the_estimates_read_the_knobs_that_declarations_say_they_read() {
        let sources = sources();
        for (path, knob) in Config::default().knobs() {
            // `config.fetch.reuse`, `self.config.dram.channels`, or a section that has a name of its own.
            let (section, name) = path.rsplit_once('.').unwrap_or(("card", &path));
            let field = format!("{}.{name}", section.rsplit('.').next().expect("a name"));
            let read = has(&sources, &field);
            match knob.estimate {
                Estimate::Used => assert!(read, "{path} is declared as used, and no estimate reads {field}"),
                Estimate::UsedBy(function) => {
                    assert!(has(&sources, function), "{path}: no estimate calls {function}");
                    assert!(!read, "{path} is declared as read by {function}, and an estimate reads {field}");
                }
                Estimate::Ignored(reason) => {
                    assert!(!reason.is_empty(), "{path} is ignored without a reason");
                    assert!(!read, "{path} is declared as ignored, and an estimate reads {field}");
                }
                // It may be read for the values for which estimates hold.
                Estimate::RefusedUnless(..) => {}
            }
        }
    }

    #[test]
    fn estimates_hold_for_values_that_a_knob_takes_and_not_for_all_of_them() {
        let config = Config::built_in("baseline").expect("it is built in");
        for (path, knob) in config.knobs() {
            let Estimate::RefusedUnless(values, unknown) = knob.estimate else { continue };
            assert!(!unknown.is_empty(), "{path} is refused without a reason");
            let number = Setting::Number;
            let taken: Vec<Setting> = match knob.allowed {
                Allowed::Range(low, high) | Allowed::PowerOfTwo(low, high) => vec![number(low), number(high)],
                Allowed::Switch => vec![Setting::Switch(false), Setting::Switch(true)],
                Allowed::Choice(names) => names.iter().map(|name| Setting::Name((*name).into())).collect(),
            };
            assert!(taken.iter().any(|setting| !values.contain(setting)), "{path}: no value is refused");
            let known: Vec<Setting> = match values {
                Values::AtLeast(value) | Values::AtMost(value) => vec![number(value)],
                Values::Between(least, most) => vec![number(least), number(most)],
                Values::Is(values) => values.iter().map(|&value| Setting::from(value)).collect(),
            };
            let other = known.iter().find(|setting| !knob.allowed.admits(setting));
            assert_eq!(other, None, "{path} is {}", knob.allowed);
        }
    }

    #[test]
    fn the_values_of_the_classes_and_of_tiny_are_known_and_no_others() {
        let with = |name: &str, changes: &[&str]| {
            let mut config = Config::built_in(name).expect("it is built in");
            changes.iter().for_each(|change| config.set(change).expect("a knob"));
            check(&config).map_err(|error| error.to_string())
        };
        for name in [
            "four-pipelines",
            "wide",
            "gtx-titan",
            "tiny",
            "sort-first",
            "sort-middle-binned",
            "sort-last-fragment",
            "sort-last-image",
        ] {
            assert_eq!(with(name, &[]), Ok(()), "{name}");
        }
        for name in ["attila", "geforce2-ultra"] {
            with(name, &[]).expect_err(name);
        }
        // Estimates hold for `tiny` as a whole, but are not known to hold for its values one by one.
        for change in ["fetch.misses=8", "fetch.cache_lines=16"] {
            with("four-pipelines", &[change]).expect_err(change);
        }
        assert_eq!(
            with("four-pipelines", &["memory.dram.t_faw=400"]),
            Err("memory.dram.t_faw is 400, and estimates of the bound fidelity hold where it is 56 or less: they know nothing of a limit \
                 on activations; use --fidelity cycle"
                .to_owned())
        );
        // Knobs without effect are not checked.
        assert_eq!(
            with("four-pipelines", &["memory.dram.t_faw=400", "memory.kind=ideal", "route.mode=immediate", "bin.hide=true"]),
            Ok(())
        );
        with("sort-first", &["route.mode=immediate"]).expect_err("it has an effect");
    }
}
