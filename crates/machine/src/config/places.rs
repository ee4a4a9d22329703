//! Where keys stand in the text of a configuration, which the parsed values no longer know.

/// A key and its place.
#[derive(Debug, PartialEq, Eq)]
pub struct KeyLocation {
    /// `path.to.key`.
    pub path: String,
    /// Line and column, from 1.
    pub at: [usize; 2],
}

/// The keys of a text that has been parsed, as they stand in it.
pub fn keys(text: &str) -> Vec<KeyLocation> {
    let mut found = Vec::new();
    // The keys whose values are open, and the last word with its place: a key, if a colon follows.
    let (mut open, mut key, mut word) = (Vec::new(), String::new(), None);
    // How far lines are counted, and the place there: counted from the top for each key, a long text would take minutes.
    let (mut counted, mut line, mut column) = (0, 1, 1);
    let mut left = text;
    while let Some(c) = left.chars().next() {
        let length = match c {
            '/' if left.starts_with("//") => left.find('\n').unwrap_or(left.len()),
            '/' if left.starts_with("/*") => comment(left),
            '"' => quoted(left),
            'r' if left.starts_with("r\"") || left.starts_with("r#") => raw(left),
            c if c.is_alphanumeric() || c == '_' => {
                let length = left.find(|c: char| !c.is_alphanumeric() && c != '_').unwrap_or(left.len());
                word = Some((&left[..length], text.len() - left.len()));
                length
            }
            _ => {
                match (c, word) {
                    (':', Some((name, offset))) => {
                        for c in text[counted..offset].chars() {
                            (line, column) = if c == '\n' { (line + 1, 1) } else { (line, column + 1) };
                        }
                        counted = offset;
                        let above = open.iter().rfind(|k: &&String| !k.is_empty());
                        key = above.map_or(name.to_owned(), |above| format!("{above}.{name}"));
                        found.push(KeyLocation { path: key.clone(), at: [line, column] });
                    }
                    ('(' | '{' | '[', _) => open.push(std::mem::take(&mut key)),
                    (')' | '}' | ']', _) => {
                        open.pop();
                    }
                    (',', _) => key.clear(),
                    _ => {}
                }
                if !c.is_whitespace() {
                    word = None;
                }
                c.len_utf8()
            }
        };
        left = &left[length.min(left.len())..];
    }
    found
}

/// Bytes of a comment that may hold others.
pub fn comment(text: &str) -> usize {
    let (mut depth, mut at) = (0, 0);
    while let Some(next) = text[at..].find(['/', '*']) {
        at += next;
        let (step, deeper) = match text[at..].get(..2) {
            Some("/*") => (2, 1),
            Some("*/") => (2, -1),
            _ => (1, 0),
        };
        at += step;
        depth += deeper;
        if depth == 0 {
            return at;
        }
    }
    text.len()
}

/// Bytes of a string in quotes.
fn quoted(text: &str) -> usize {
    let mut escaped = false;
    for (at, c) in text.char_indices().skip(1) {
        match c {
            '"' if !escaped => return at + 1,
            _ => escaped = c == '\\' && !escaped,
        }
    }
    text.len()
}

/// Bytes of a raw string.
fn raw(text: &str) -> usize {
    let hashes = text[1..].bytes().take_while(|b| *b == b'#').count();
    let start = 2 + hashes;
    let end = format!("\"{}", "#".repeat(hashes));
    text.get(start..).and_then(|inner| inner.find(&end)).map_or(text.len(), |at| start + at + end.len())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn keys_are_found_where_they_stand() {
        let text = "// a: 1\n(extends: \"b: (c: 2)\", /* d: /* e: */ f: */\n  setup: (latency: 3, /*x*/ rate\n: 4),\n name: r#\"g: \"h: \"#, é: 1)";
        let expected = [("extends", [2, 2]), ("setup", [3, 3]), ("setup.latency", [3, 11]), ("setup.rate", [3, 29])];
        let found = keys(text);
        let short: Vec<_> = found.iter().map(|p| (p.path.as_str(), p.at)).collect();
        assert_eq!(short[..4], expected);
        assert_eq!(short[4..], [("name", [5, 2]), ("é", [5, 22])]);
    }

    #[test]
    fn what_is_cut_short_ends() {
        for text in ["/* a", "\"a\\", "r##\"a\"#", "(a", "a:", "r#", "))", "/*/"] {
            keys(text);
        }
    }
}
