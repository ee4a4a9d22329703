//! Names of enumerants, as in text recordings.

use std::sync::OnceLock;

/// One `NAME VALUE` a line, the value in hexadecimal.
const TEXT: &str = include_str!("names.txt");
/// Suffixes of names that may be omitted.
const ENDINGS: &[&str] = &["", "_ARB", "_EXT", "_SGIS"];

/// Names and values in alphabetical order.
fn table() -> &'static [(&'static str, u32)] {
    static TABLE: OnceLock<Vec<(&'static str, u32)>> = OnceLock::new();
    TABLE.get_or_init(|| {
        let line = |line: &'static str| {
            let (name, value) = line.split_once(' ')?;
            Some((name, u32::from_str_radix(value, 16).ok()?))
        };
        let mut table: Vec<_> = TEXT.lines().filter_map(line).collect();
        table.sort_unstable();
        table
    })
}

/// Values with their first names in alphabetical order, in the order of values. Small numbers are primitive modes and bits, which messages do not
/// name.
fn by_value() -> &'static [(u32, &'static str)] {
    static TABLE: OnceLock<Vec<(u32, &'static str)>> = OnceLock::new();
    TABLE.get_or_init(|| {
        let mut values: Vec<_> = table().iter().filter(|&&(_, v)| v > 0xff).map(|&(name, value)| (value, name)).collect();
        values.sort_unstable();
        values.dedup_by_key(|&mut (value, _)| value);
        values
    })
}

/// The value of a name.
pub fn value(name: &str) -> Option<u32> {
    let known = |name: &str| {
        let at = table().binary_search_by_key(&name, |&(known, _)| known).ok()?;
        Some(table()[at].1)
    };
    match name {
        "TRUE" => Some(1),
        "FALSE" => Some(0),
        // Extension names have the values of the core names.
        _ => ENDINGS.iter().find_map(|end| known(name.strip_suffix(end)?)),
    }
}

/// A name of a value for messages; if there are several, the first in alphabetical order.
pub fn name(value: u32) -> String {
    // A list that is called often may have each of its calls refused.
    let known = by_value().binary_search_by_key(&value, |&(value, _)| value);
    known.map_or_else(|_| format!("{value:#06x}"), |at| by_value()[at].1.to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_and_values_find_each_other() {
        assert_eq!(value("GL_TEXTURE_2D"), Some(0x0de1));
        assert_eq!(value("GL_TEXTURE0_ARB"), Some(0x84c0));
        assert_eq!(value("TRUE"), Some(1));
        assert_eq!(value("GL_NO_SUCH_NAME"), None);
        assert_eq!(name(0x0de1), "GL_TEXTURE_2D");
        assert_eq!(name(0x1_0001), "0x10001");
        assert_eq!(name(4), "0x0004");
        // The first of its names.
        assert_eq!(name(0x8513), "GL_TEXTURE_CUBE_MAP");
        for &(_, value) in table().iter().filter(|&&(_, value)| value > 0xff) {
            let first = table().iter().find(|&&(_, v)| v == value).expect("it has a name");
            assert_eq!(name(value), first.0);
        }
    }
}
