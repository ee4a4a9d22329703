//! Debug groups, after which draws are named.

use std::sync::Arc;

use trace::command::Command;
use work::DebugPath;

/// Groups whose labels are kept, from the outermost on. Groups inside these are only counted: a trace may open any number.
const DEPTH: usize = 64;

/// Characters that are kept of a label.
const LENGTH: usize = 256;

/// The debug groups that are open.
#[derive(Debug, Default)]
pub struct DebugGroups {
    open: Vec<Arc<str>>,
    /// Groups inside these.
    deeper: u64,
    /// The labels as draws share them, until a group opens or closes.
    path: Option<DebugPath>,
}

impl DebugGroups {
    /// Opens or closes a group, if the command does. A pop without a group is the checker's to refuse.
    pub fn note(&mut self, command: &Command) {
        match command {
            Command::PushDebugGroup(_) if self.open.len() == DEPTH => self.deeper += 1,
            Command::PushDebugGroup(label) => {
                self.open.push(label.chars().take(LENGTH).collect::<String>().into());
                self.path = None;
            }
            Command::PopDebugGroup if self.deeper > 0 => self.deeper -= 1,
            Command::PopDebugGroup => {
                self.open.pop();
                self.path = None;
            }
            _ => {}
        }
    }

    /// The labels of the groups that are open, from the outermost on; empty where they are not kept.
    pub fn open(&self) -> impl Iterator<Item = &str> {
        let deeper = (0..self.deeper).map(|_| "");
        self.open.iter().map(|label| &**label).chain(deeper)
    }

    /// The labels of the groups that are open, the outermost first, as far as they are kept.
    pub fn path(&mut self) -> DebugPath {
        self.path.get_or_insert_with(|| self.open.as_slice().into()).clone()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_draw_has_the_labels_of_all_groups_that_are_open() {
        let mut groups = DebugGroups::default();
        let innermost = |groups: &mut DebugGroups| groups.path().last().map_or(String::new(), |label| label.to_string());
        assert!(groups.path().is_empty());
        groups.note(&Command::PushDebugGroup("scene".into()));
        groups.note(&Command::PushDebugGroup("trees".into()));
        assert!(groups.path().iter().map(|label| &**label).eq(["scene", "trees"]));
        for _ in 0..100 {
            groups.note(&Command::PushDebugGroup("x".repeat(1000)));
        }
        assert_eq!((innermost(&mut groups).len(), groups.path().len()), (LENGTH, DEPTH));
        for _ in 0..100 {
            groups.note(&Command::PopDebugGroup);
        }
        assert_eq!(innermost(&mut groups), "trees");
        groups.note(&Command::PopDebugGroup);
        assert_eq!(innermost(&mut groups), "scene");
    }
}
