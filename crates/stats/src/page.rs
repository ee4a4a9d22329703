//! The page of all statistics, generated from their declarations.

use super::Declaration;

/// The Markdown table of the counters under one place in the tree, as `units.NAME[i]`.
pub fn page(place: &str, about: &str, declarations: &[Declaration]) -> String {
    let mut text = format!("## `{place}`\n\n{about}\n\n| name | unit | meaning |\n|---|---|---|\n");
    for Declaration { name, unit, meaning } in declarations {
        text.push_str(&format!("| `{name}` | {unit} | {} |\n", meaning.replace('|', "\\|")));
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Cycles, Group};

    #[test]
    fn each_declaration_is_a_row() {
        let page = page("units.NAME[i]", "Cycles.", Cycles::DECLARATIONS);
        assert!(page.contains("| `blocked` | cycles | The unit's output had no room. |\n"), "{page}");
        assert_eq!(page.lines().count(), 6 + Cycles::DECLARATIONS.len());
    }
}
