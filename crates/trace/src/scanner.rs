//! Finds where commands end in the text of a trace, byte by byte, without reading them.

/// What a byte of the text is for one who looks for commands.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Mark {
    /// Nothing of interest.
    Nothing,
    /// The bracket in front of the commands.
    Begin,
    /// A comma behind a command.
    Comma,
    /// The bracket behind the commands.
    End,
    /// Something that the scanner does not know: raw strings and strings of bytes, characters, attributes; and what is wrong.
    Unknown,
}

/// Where a scanner is.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
enum State {
    #[default]
    Code,
    /// Behind a slash that may begin a comment.
    Slash,
    String,
    /// Behind a backslash in a string.
    Escape,
    /// In a comment to the end of the line.
    Line,
    /// In comments, so deep, behind this byte; 0 where that belongs to no other.
    Block(u32, u8),
}

/// Goes through the text, and tells its brackets and commas from those in strings and comments.
#[derive(Debug, Default)]
pub(super) struct Scanner {
    state: State,
    /// Open brackets.
    depth: u32,
    begun: bool,
    last: u8,
}

/// Open brackets around the list of commands, and in it.
const OUTSIDE: u32 = 1;
const INSIDE: u32 = 2;

impl Scanner {
    /// Goes on by one byte, and tells what it is.
    pub fn step(&mut self, byte: u8) -> Mark {
        let last = std::mem::replace(&mut self.last, byte);
        self.state = match (self.state, byte) {
            (State::Code, _) => return self.code(last, byte),
            (State::Slash, b'/') => State::Line,
            (State::Slash, b'*') => State::Block(1, 0),
            (State::Slash, _) => return Mark::Unknown,
            (State::String, b'"') | (State::Line, b'\n') => State::Code,
            (State::String, b'\\') => State::Escape,
            (State::String | State::Escape, _) => State::String,
            (State::Line, _) => State::Line,
            (State::Block(depth, b'/'), b'*') => State::Block(depth + 1, 0),
            (State::Block(1, b'*'), b'/') => State::Code,
            (State::Block(depth, b'*'), b'/') => State::Block(depth - 1, 0),
            (State::Block(depth, _), _) => State::Block(depth, byte),
        };
        Mark::Nothing
    }

    fn code(&mut self, last: u8, byte: u8) -> Mark {
        match byte {
            b'/' => self.state = State::Slash,
            // What stands before may make it a raw string, or one of bytes.
            b'"' if last.is_ascii_alphanumeric() || last == b'_' => return Mark::Unknown,
            b'"' => self.state = State::String,
            b'\'' | b'#' => return Mark::Unknown,
            b'(' | b'{' => self.depth += 1,
            b'[' => {
                self.depth += 1;
                if self.depth == INSIDE && !self.begun {
                    self.begun = true;
                    return Mark::Begin;
                }
            }
            b')' | b']' | b'}' => {
                let Some(depth) = self.depth.checked_sub(1) else { return Mark::Unknown };
                self.depth = depth;
                if self.begun && depth == OUTSIDE {
                    return if byte == b']' { Mark::End } else { Mark::Unknown };
                }
            }
            b',' if self.begun && self.depth == INSIDE => return Mark::Comma,
            _ => {}
        }
        Mark::Nothing
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The marks of a text, with their places.
    fn marks(text: &str) -> Vec<(usize, Mark)> {
        let mut scanner = Scanner::default();
        let all = text.bytes().map(|byte| scanner.step(byte)).enumerate();
        all.filter(|(_, mark)| *mark != Mark::Nothing).collect()
    }

    #[test]
    fn only_brackets_and_commas_of_the_list_are_marked() {
        let found = |text: &str, expected: &str| {
            let mut marked = vec![b' '; text.len()];
            for (at, mark) in marks(text) {
                marked[at] = match mark {
                    Mark::Begin => b'B',
                    Mark::Comma => b',',
                    Mark::End => b'E',
                    _ => b'?',
                };
            }
            assert_eq!(String::from_utf8(marked).expect("ASCII").trim_end(), expected, "{text}");
        };
        found("Trace(version: 1, files: {\"a\": [1]}, commands: [A(x: [1, 2], y: (3, 4)), B, ])", &{
            let mut expected = " ".repeat(47) + "B";
            expected += &(" ".repeat(23) + ",  ,");
            expected + " E"
        });
        found("([A(\"],\\\"],\\\\\"),])", " B             ,E");
        found("([/* ,/* ] */ , **/,// ],\n])", " B                 ,      E");
        found("([/*/,*/,])", " B      ,E");
        found("(['", " B?");
        found("([r\"", " B ?");
        found("([r#", " B ?");
        found("([/x", " B ?");
        found("([)", " B?");
    }
}
