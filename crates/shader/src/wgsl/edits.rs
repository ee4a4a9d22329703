//! A text that is rewritten step by step, and which byte of the first text each byte stands for.

/// A part of a text that is replaced.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Edit {
    pub at: usize,
    /// Bytes that are taken out.
    pub length: usize,
    pub text: String,
}

impl Edit {
    pub fn insert(at: usize, text: String) -> Edit {
        Edit { at, length: 0, text }
    }

    pub fn replace(range: std::ops::Range<usize>, text: impl Into<String>) -> Edit {
        Edit { at: range.start, length: range.len(), text: text.into() }
    }
}

/// One step: pieces that were put in, as their begin and end afterwards, and the end of what they stand for before.
#[derive(Clone, Debug)]
struct Step(Vec<[usize; 3]>);

/// A text with its history.
#[derive(Clone, Debug)]
pub(crate) struct Text {
    text: String,
    steps: Vec<Step>,
}

impl Text {
    pub fn new(text: &str) -> Text {
        Text { text: text.to_owned(), steps: Vec::new() }
    }

    pub fn as_str(&self) -> &str {
        &self.text
    }

    /// Applies edits, which must not overlap.
    pub(super) fn apply(&mut self, mut edits: Vec<Edit>) {
        edits.sort_by_key(|edit| edit.at);
        let (mut out, mut step, mut from) = (String::with_capacity(self.text.len()), Step(Vec::new()), 0);
        for edit in edits {
            out.push_str(&self.text[from..edit.at]);
            let begin = out.len();
            out.push_str(&edit.text);
            from = edit.at + edit.length;
            step.0.push([begin, out.len(), from]);
        }
        out.push_str(&self.text[from..]);
        self.text = out;
        self.steps.push(step);
    }

    /// The byte of the first text that a byte stands for. What was put in stands for what comes after it.
    pub fn origin(&self, at: usize) -> usize {
        self.steps.iter().rev().fold(at, |at, step| {
            let before = step.0.partition_point(|&[begin, ..]| begin <= at);
            match before.checked_sub(1).map(|last| step.0[last]) {
                Some([_, end, from]) if at < end => from,
                Some([_, end, from]) => at - end + from,
                None => at,
            }
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bytes_keep_their_origin() {
        let mut text = Text::new("one two three");
        text.apply(vec![Edit::replace(4..7, "2222"), Edit::insert(0, "x ".to_owned())]);
        assert_eq!(text.as_str(), "x one 2222 three");
        text.apply(vec![Edit::replace(2..6, "")]);
        assert_eq!(text.as_str(), "x 2222 three");
        let origins: Vec<usize> = (0..12).map(|at| text.origin(at)).collect();
        assert_eq!(origins, [0, 0, 7, 7, 7, 7, 7, 8, 9, 10, 11, 12]);
    }
}
