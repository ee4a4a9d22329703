//! The counters that ATTILA leaves of a frame: names and values between semicolons, one line each.

use std::io::Read;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, anyhow, bail, ensure};
use flate2::read::GzDecoder;

use host::{self, Links};

/// Bytes of such a file at most: those that are known have a tenth of a megabyte.
const BYTES_MAX: u64 = 16 << 20;

/// The counters of one frame.
#[derive(Clone, Debug)]
pub struct Counters {
    /// Where they were read; errors name it.
    file: PathBuf,
    values: Vec<(String, String)>,
}

impl Counters {
    /// Reads a compressed file with a line of names and a line of values.
    ///
    /// # Errors
    /// If the file is missing, damaged, longer than 16 MiB, or has not the same number of names and values, with its name and the line.
    pub fn read(file: &Path) -> Result<Counters> {
        let fail = || format!("{}", file.display());
        let packed = host::open(file, Links::Follow).with_context(fail)?;
        let mut text = String::new();
        let read = GzDecoder::new(packed).take(BYTES_MAX + 1).read_to_string(&mut text);
        read.map_err(|error| anyhow!("{}: byte {} of its text: {error}", file.display(), text.len()))?;
        ensure!(text.len() as u64 <= BYTES_MAX, "{}: its text is longer than {BYTES_MAX} bytes", file.display());
        Counters::parse(file, &text)
    }

    /// The same from text; `file` is what errors call it.
    ///
    /// # Errors
    /// As [`Counters::read`].
    pub fn parse(file: &Path, text: &str) -> Result<Counters> {
        let place = file.display();
        let mut lines = text.lines();
        let names = lines
            .next()
            .filter(|line| !line.trim().is_empty())
            .with_context(|| format!("{place}: line 1: no names of counters"))?;
        let row = lines.next().with_context(|| format!("{place}: line 2: no values"))?;
        if let Some(extra) = lines.position(|line| !line.trim().is_empty()) {
            bail!("{place}: line {}: more than one frame", extra + 3);
        }
        // Both lines end with a separator.
        let fields = |line: &str| line.trim_end().trim_end_matches(';').split(';').map(str::to_owned).collect::<Vec<_>>();
        let (names, row) = (fields(names), fields(row));
        ensure!(names.len() == row.len(), "{place}: line 2: {} values of {} counters", row.len(), names.len());
        Ok(Counters { file: file.to_owned(), values: names.into_iter().zip(row).collect() })
    }

    /// The value of one counter.
    ///
    /// # Errors
    /// If there is no such counter, or it is no number of 0 or more; with the file.
    pub fn one(&self, name: &str) -> Result<f64> {
        let (at, (_, text)) = self
            .values
            .iter()
            .enumerate()
            .find(|(_, (known, _))| known == name)
            .with_context(|| format!("{}: line 1: no counter {name}", self.file.display()))?;
        self.value(at, name, text)
    }

    fn value(&self, at: usize, name: &str, text: &str) -> Result<f64> {
        let value: Option<f64> = text.trim().parse().ok().filter(|value: &f64| value.is_finite() && *value >= 0.0);
        value.with_context(|| {
            format!("{}: line 2, value {}: {name} is `{text}`, no number of 0 or more", self.file.display(), at + 1)
        })
    }

    /// The sum of a counter over the units of a kind: `PassedFragments_ZST` is that of `PassedFragments_ZST-SU0` and so on.
    ///
    /// # Errors
    /// As [`Counters::one`].
    pub fn sum(&self, name: &str) -> Result<f64> {
        let mut found = false;
        let mut sum = 0.0;
        for (at, (known, text)) in self.values.iter().enumerate() {
            if known.strip_prefix(name).is_some_and(|rest| rest.starts_with('-')) {
                sum += self.value(at, known, text)?;
                found = true;
            }
        }
        ensure!(found, "{}: line 1: no counter {name} of any unit", self.file.display());
        Ok(sum)
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::Counters;

    fn parse(text: &str) -> Result<Counters, String> {
        Counters::parse(Path::new("stats.csv.gz"), text).map_err(|error| format!("{error:#}"))
    }

    #[test]
    fn counters_are_found_and_summed() {
        let counters = parse("Frame;A_X-0;A_X-1;A_XY-0;\n3;10;5;100;\n").expect("two lines");
        assert_eq!(counters.one("Frame").expect("a counter"), 3.0);
        assert_eq!(counters.sum("A_X").expect("of two units"), 15.0);
    }

    #[test]
    fn damage_is_told_with_its_place() {
        for (text, reason) in [
            ("", "line 1: no names"),
            ("Frame;A;\n", "line 2: no values"),
            ("Frame;A;\n1;\n", "line 2: 1 values of 2 counters"),
            ("Frame;A;\n1;2;\n3;4;\n", "line 3: more than one frame"),
        ] {
            let error = parse(text).expect_err(text);
            assert!(error.contains("stats.csv.gz") && error.contains(reason), "{error}");
        }
        let counters = parse("Frame;A-0;\n1;x;\n").expect("two lines");
        for (error, reason) in [
            (counters.one("B").map(|_| ()), "no counter B"),
            (counters.sum("A").map(|_| ()), "value 2: A-0 is `x`"),
            (counters.sum("C").map(|_| ()), "no counter C of any unit"),
        ] {
            let error = format!("{:#}", error.expect_err(reason));
            assert!(error.contains("stats.csv.gz") && error.contains(reason), "{error}");
        }
    }
}
