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
    // Small numbers are primitive modes and bits, which messages do not name.
    let known = table().iter().find(|&&(_, v)| v == value && value > 0xff);
    known.map_or_else(|| format!("{value:#06x}"), |(name, _)| (*name).to_owned())
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
    }
}
