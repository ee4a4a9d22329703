//! Comparison of two statistics files or two configurations.

use std::collections::{HashMap, HashSet};

use serde_json::{Number, Value};

use crate::machine::Config;

/// One statistic that differs between two files.
#[derive(Clone, Debug, PartialEq)]
pub struct StatisticDifference {
    /// Its path, such as `total.funnel.quads_shaded`.
    pub path: String,
    /// In the first file; none: it is not there.
    pub a: Option<Value>,
    /// In the second file; none: it is not there.
    pub b: Option<Value>,
}

impl StatisticDifference {
    fn numbers(&self) -> Option<(f64, f64)> {
        Some((self.a.as_ref()?.as_f64()?, self.b.as_ref()?.as_f64()?))
    }

    /// Change from the first to the second, where both are numbers.
    pub fn absolute(&self) -> Option<f64> {
        self.numbers().map(|(a, b)| b - a)
    }

    /// Relative change from the first to the second, where both are numbers and the first is not 0.
    pub fn relative(&self) -> Option<f64> {
        let (a, b) = self.numbers()?;
        if a == 0.0 { None } else { Some((b - a) / a) }
    }

    /// How large the change is: relative (from 0, behind all that have such a size) and as a difference.
    fn size(&self, by: Size) -> Option<[f64; 2]> {
        let (a, b) = self.numbers()?;
        let absolute = (b - a).abs();
        let relative = if a == 0.0 { -1.0 } else { absolute / a.abs() };
        // Of equal ones the other measure decides.
        Some(match by {
            Size::Relative => [relative, absolute],
            Size::Absolute => [absolute, relative],
        })
    }
}

/// What makes a change large.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Size {
    /// The difference by the first value.
    Relative,
    /// The difference itself.
    Absolute,
}

/// Puts the largest changes first. What is no number, or is in one file only, follows in its order.
pub fn largest_first(found: &mut [StatisticDifference], by: Size) {
    found.sort_by(|x, y| match (x.size(by), y.size(by)) {
        (Some(x), Some(y)) => y[0].total_cmp(&x[0]).then(y[1].total_cmp(&x[1])),
        (x, y) => y.is_some().cmp(&x.is_some()),
    });
}

/// A path and its value, for each statistic of a file, in order.
pub type Leaves = Vec<(String, Value)>;

/// The statistics of a `stats.json`.
pub fn leaves(tree: &Value) -> Leaves {
    let mut found = Vec::new();
    walk("", tree, &mut found);
    found
}

fn walk(path: &str, value: &Value, found: &mut Leaves) {
    match value {
        Value::Object(map) if !map.is_empty() => {
            for (key, value) in map {
                walk(&if path.is_empty() { key.clone() } else { format!("{path}.{key}") }, value, found);
            }
        }
        Value::Array(list) if !list.is_empty() => {
            for (i, value) in list.iter().enumerate() {
                walk(&format!("{path}[{i}]"), value, found);
            }
        }
        value => found.push((path.to_owned(), value.clone())),
    }
}

/// The statistics of a table of a replay, under the paths that `stats.json` has them at: the `i`-th frame is `frames[i]`, a row of
/// `passes.csv` is one of its `phases`, and a row of `draws.csv` one of the `draws` of a phase.
///
/// # Errors
/// The line that is no row of such a table, and why.
pub fn table(text: &str) -> Result<Leaves, String> {
    let mut rows = rows(text)?.into_iter();
    let Some((_, header)) = rows.next() else { return Ok(Leaves::new()) };
    if header[0] != "frame" {
        return Err(format!("line 1: the first column is {:?}, not \"frame\"", header[0]));
    }
    // Columns that say which phase of a frame a row is about, and whether it is about a draw of it.
    let (phase, draws) = (header.get(1).is_some_and(|name| name == "phase"), header.get(3).is_some_and(|name| name == "draw"));
    let mut found = Leaves::new();
    let (mut frames, mut draw) = (0, 0);
    let mut last: Option<Vec<String>> = None;
    for (line, row) in rows {
        if row.len() != header.len() {
            return Err(format!("line {line} has {} fields, the header has {}", row.len(), header.len()));
        }
        let of: Vec<String> = row[..1 + usize::from(phase)].to_vec();
        match &last {
            // The next draw of the phase; of other tables each row has a place of its own.
            Some(known) if phase && *known == of => draw += 1,
            Some(known) => {
                frames += usize::from(!phase || known[0] != of[0]);
                draw = 0;
            }
            None => {}
        }
        let place = match (phase, draws) {
            (false, _) => format!("frames[{frames}]"),
            (true, false) => format!("frames[{frames}].phases[{}]", row[1]),
            (true, true) => format!("frames[{frames}].phases[{}].draws[{draw}]", row[1]),
        };
        last = Some(of);
        for (path, field) in header.iter().zip(row) {
            // A whole number, a real one, a text.
            let number = field.parse::<u64>().map(Value::from).ok();
            let number = number.or_else(|| Some(Value::Number(Number::from_f64(field.parse().ok()?)?)));
            found.push((format!("{place}.{path}"), number.unwrap_or(Value::String(field))));
        }
    }
    Ok(found)
}

/// The fields of a CSV text, with the line of each row. A field in quotes may hold commas, ends of lines and doubled quotes.
fn rows(text: &str) -> Result<Vec<(usize, Vec<String>)>, String> {
    let (mut rows, mut row, mut field) = (Vec::new(), Vec::new(), String::new());
    let (mut line, mut first, mut quoted) = (1, 1, false);
    let mut left = text.chars().peekable();
    while let Some(c) = left.next() {
        line += usize::from(c == '\n');
        match c {
            '"' if quoted && left.peek() == Some(&'"') => field.extend(left.next()),
            '"' => quoted = !quoted,
            _ if quoted => field.push(c),
            ',' => row.push(std::mem::take(&mut field)),
            '\n' => {
                row.push(std::mem::take(&mut field));
                rows.push((first, std::mem::take(&mut row)));
                first = line;
            }
            '\r' => {}
            _ => field.push(c),
        }
    }
    if quoted {
        return Err(format!("line {first}: a quote is not closed"));
    }
    if !field.is_empty() || !row.is_empty() {
        row.push(field);
        rows.push((first, row));
    }
    Ok(rows)
}

/// How the banks of a unit are compared.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Banks {
    /// Their numbers are summed: `units.setup[*].busy`.
    Sum,
    /// Each by itself: `units.setup[0].busy`, `units.setup[1].busy`.
    Each,
}

/// All statistics in which two files differ, in the order of the first; what only the second has follows.
pub fn statistics(a: Leaves, b: Leaves, banks: Banks) -> Vec<StatisticDifference> {
    let (a, b) = match banks {
        Banks::Each => (a, b),
        Banks::Sum => {
            // A unit of one bank on both sides keeps its path.
            let many: HashSet<String> = a.iter().chain(&b).filter_map(|(path, _)| other_than_first(path)).collect();
            (summed(a, &many), summed(b, &many))
        }
    };
    let mut second: HashMap<String, (usize, Value)> =
        b.into_iter().enumerate().map(|(at, (path, value))| (path, (at, value))).collect();
    let mut found = Vec::new();
    for (path, a) in a {
        let b = second.remove(&path).map(|(_, b)| b);
        if b.as_ref() != Some(&a) {
            found.push(StatisticDifference { path, a: Some(a), b });
        }
    }
    let mut only: Vec<(String, (usize, Value))> = second.into_iter().collect();
    only.sort_by_key(|(_, (at, _))| *at);
    found.extend(only.into_iter().map(|(path, (_, b))| StatisticDifference { path, a: None, b: Some(b) }));
    found
}

/// Whether a path begins so, with the number of the bank or with `*` in its place.
pub fn is_under(path: &str, prefix: &str) -> bool {
    path.starts_with(prefix) || unit(path).is_some_and(|(all, _)| all.starts_with(prefix))
}

/// A path of a bank as that of all of them, and the number of the bank. Frames and phases are no banks, nor is what has no names inside.
fn unit(path: &str) -> Option<(String, &str)> {
    let (stem, rest) = path.rsplit_once("].")?;
    let (stem, index) = stem.rsplit_once('[')?;
    let name = stem.rsplit('.').next().unwrap_or(stem);
    if matches!(name, "frames" | "phases" | "draws") { None } else { Some((format!("{stem}[*].{rest}"), index)) }
}

/// The path of all banks, of one that is not the first.
fn other_than_first(path: &str) -> Option<String> {
    unit(path).filter(|(_, index)| *index != "0").map(|(all, _)| all)
}

/// The same with the numbers of banks summed, for units of which there are several; each sum stands where its first bank was.
fn summed(leaves: Leaves, many: &HashSet<String>) -> Leaves {
    let mut out: Leaves = Vec::with_capacity(leaves.len());
    let mut places: HashMap<String, usize> = HashMap::new();
    for (path, value) in leaves {
        match unit(&path).filter(|(all, _)| value.is_number() && many.contains(all)) {
            Some((all, _)) => match places.get(&all) {
                Some(&at) => out[at].1 = sum(&out[at].1, &value),
                None => {
                    places.insert(all.clone(), out.len());
                    out.push((all, value));
                }
            },
            None => out.push((path, value)),
        }
    }
    out
}

/// The sum of two numbers, whole where both are.
fn sum(x: &Value, y: &Value) -> Value {
    match (x.as_u64(), y.as_u64()) {
        (Some(x), Some(y)) => Value::from(x.saturating_add(y)),
        _ => Value::from(x.as_f64().unwrap_or(0.0) + y.as_f64().unwrap_or(0.0)),
    }
}

/// One knob that differs between two configurations.
#[derive(Clone, Debug, PartialEq)]
pub struct KnobDifference {
    /// Its path, such as `core.warps`.
    pub path: String,
    /// In the first configuration, as it is written there.
    pub a: String,
    /// In the second one.
    pub b: String,
}

/// All knobs in which two configurations differ, in the order of their declarations.
pub fn configurations(a: &Config, b: &Config) -> Vec<KnobDifference> {
    let mut found = Vec::new();
    for ((section, a), (_, b)) in a.sections().into_iter().zip(b.sections()) {
        for knob in a.knobs() {
            let (Some(a), Some(b)) = (a.get(knob.name), b.get(knob.name)) else { continue };
            if a != b {
                let path = knob.path(section);
                found.push(KnobDifference { path, a: a.to_string(), b: b.to_string() });
            }
        }
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn statistics_name_the_leaf() {
        let a = json!({"total": {"cycles": 10, "units": [{"busy": 1}, {"busy": 2}]}, "only_a": 1});
        let b = json!({"total": {"cycles": 15, "units": [{"busy": 1}]}, "only_b": {}});
        let d = statistics(leaves(&a), leaves(&b), Banks::Each);
        let paths: Vec<_> = d.iter().map(|d| d.path.as_str()).collect();
        assert_eq!(paths, ["total.cycles", "total.units[1].busy", "only_a", "only_b"]);
        assert_eq!((d[0].relative(), d[0].absolute()), (Some(0.5), Some(5.0)));
        assert_eq!((d[1].relative(), d[1].b.as_ref()), (None, None));
        assert_eq!(statistics(leaves(&a), leaves(&a), Banks::Each), []);
    }

    #[test]
    fn banks_are_summed_where_there_are_several() {
        let a = json!({"frames": [{"units": {"setup": [{"busy": 1, "share": 0.5}, {"busy": 2, "share": 0.25}], "clip": [{"busy": 5}]}}]});
        let b = json!({"frames": [{"units": {"setup": [{"busy": 9, "share": 0.75}], "clip": [{"busy": 4}]}}]});
        let found = statistics(leaves(&a), leaves(&b), Banks::Sum);
        let found: Vec<_> = found.into_iter().map(|d| (d.path, d.a.unwrap(), d.b.unwrap())).collect();
        let row = |path: &str, a: i32, b: i32| (format!("frames[0].units.{path}"), json!(a), json!(b));
        // The shares have the same sum.
        assert_eq!(found, [row("setup[*].busy", 3, 9), row("clip[0].busy", 5, 4)]);
        // What moves from a bank to another is no difference of the unit.
        let (x, y) = (json!({"u": [{"n": 1}, {"n": 2}]}), json!({"u": [{"n": 2}, {"n": 1}]}));
        assert_eq!(statistics(leaves(&x), leaves(&y), Banks::Sum), []);
        assert_eq!(statistics(leaves(&x), leaves(&y), Banks::Each).len(), 2);
    }

    #[test]
    fn frames_and_phases_are_no_banks() {
        for path in ["frames[1].cycles", "frames[0].phases[1].draws[2].cycles", "histogram[3]", "total.cycles"] {
            assert_eq!(unit(path), None, "{path}");
        }
        assert_eq!(unit("frames[1].units.rop[12].busy"), Some(("frames[1].units.rop[*].busy".into(), "12")));
    }

    #[test]
    fn the_largest_changes_come_first() {
        let d = |path: &str, a: Option<f64>, b: Option<f64>| {
            let value = |v: Option<f64>| v.map(Value::from);
            StatisticDifference { path: path.into(), a: value(a), b: value(b) }
        };
        let mut found = vec![
            d("only one", None, Some(1e9)),
            d("small share", Some(1000.0), Some(1100.0)),
            d("half", Some(20.0), Some(10.0)),
            d("from 0", Some(0.0), Some(3.0)),
            d("to 0", Some(7.0), Some(0.0)),
        ];
        let names = |found: &[StatisticDifference]| found.iter().map(|d| d.path.clone()).collect::<Vec<_>>();
        largest_first(&mut found, Size::Relative);
        assert_eq!(names(&found), ["to 0", "half", "small share", "from 0", "only one"]);
        largest_first(&mut found, Size::Absolute);
        assert_eq!(names(&found), ["small share", "half", "to 0", "from 0", "only one"]);
    }

    #[test]
    fn a_table_has_the_paths_of_the_tree() {
        let text = "frame,cycles,sort.passes_out_of_order,seconds\n3,10,\"1 \"\"a\"\", 2\",0.5\n4,12,,1e-7\n";
        let found = table(text).unwrap();
        let row = |path: &str, value: Value| (path.to_owned(), value);
        assert_eq!(
            found[..4],
            [
                row("frames[0].frame", json!(3)),
                row("frames[0].cycles", json!(10)),
                row("frames[0].sort.passes_out_of_order", json!("1 \"a\", 2")),
                row("frames[0].seconds", json!(0.5)),
            ]
        );
        assert_eq!(found[5..7], [row("frames[1].cycles", json!(12)), row("frames[1].sort.passes_out_of_order", json!(""))]);
        let paths = |text: &str| table(text).unwrap().into_iter().map(|(path, _)| path).collect::<Vec<_>>();
        let cycles = |text: &str| paths(text).into_iter().filter(|path| path.ends_with("cycles")).collect::<Vec<_>>();
        let passes = "frame,phase,kind,number,label,cycles\n7,0,transfers,0,,5\n7,1,pass,0,,9\n8,0,pass,1,,4\n";
        assert_eq!(cycles(passes), ["frames[0].phases[0].cycles", "frames[0].phases[1].cycles", "frames[1].phases[0].cycles"]);
        let draws =
            "frame,phase,pass,draw,group,label,cycles\n7,1,0,0,,,5\n7,1,0,end of the pass,,,9\n7,2,1,0,,,4\n8,1,0,0,,,2\n";
        assert_eq!(
            cycles(draws),
            [
                "frames[0].phases[1].draws[0].cycles",
                "frames[0].phases[1].draws[1].cycles",
                "frames[0].phases[2].draws[0].cycles",
                "frames[1].phases[1].draws[0].cycles"
            ]
        );
        assert_eq!(table("").unwrap(), []);
        assert_eq!(table("frame,a\n1\n").unwrap_err(), "line 2 has 1 fields, the header has 2");
        assert!(table("x,a\n").unwrap_err().contains("\"x\""));
        assert!(table("frame,a\n1,\"b\n").unwrap_err().starts_with("line 2"));
    }

    #[test]
    fn configurations_name_the_knobs() {
        let a = Config::built_in("baseline").unwrap();
        let mut b = a.clone();
        assert_eq!(configurations(&a, &b), []);
        b.set("core.warps=3").unwrap();
        b.set("sort=sort-first").unwrap();
        let found = configurations(&a, &b);
        let paths: Vec<_> = found.iter().map(|d| (d.path.as_str(), d.b.as_str())).collect();
        assert_eq!(paths, [("sort", "\"sort-first\""), ("core.warps", "3")]);
    }
}
