//! Names of enumerants, as in text recordings.

use std::collections::BTreeMap;
use std::sync::OnceLock;

/// One `NAME VALUE` a line, the value in hexadecimal.
const TEXT: &str = include_str!("names.txt");

/// Suffixes of names that may be omitted.
const ENDINGS: &[&str] = &["", "_ARB", "_EXT", "_SGIS"];

fn table() -> &'static BTreeMap<&'static str, u32> {
    static TABLE: OnceLock<BTreeMap<&'static str, u32>> = OnceLock::new();
    TABLE.get_or_init(|| {
        let line = |line: &'static str| {
            let (name, value) = line.split_once(' ')?;
            Some((name, u32::from_str_radix(value, 16).ok()?))
        };
        TEXT.lines().filter_map(line).collect()
    })
}

/// The value of a name.
pub fn value(name: &str) -> Option<u32> {
    match name {
        "TRUE" => Some(1),
        "FALSE" => Some(0),
        // Extension names have the values of the core names.
        _ => ENDINGS.iter().find_map(|end| table().get(name.strip_suffix(end)?).copied()),
    }
}

/// A name of a value for messages; if there are several, the first in alphabetical order.
pub fn name(value: u32) -> String {
    // Small numbers are primitive modes and bits, which messages do not name.
    let known = table().iter().find(|&(_, &v)| v == value && value > 0xff);
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
