//! Debug groups, after which draws are named.

use std::sync::Arc;

use trace::command::Command;

/// Groups whose labels are kept, from the outermost on. Groups inside these are only counted: a trace may open any number.
const DEPTH: usize = 64;

/// Characters that are kept of a label.
const LENGTH: usize = 256;

/// The debug groups that are open.
#[derive(Debug)]
pub struct DebugGroups {
    open: Vec<Arc<str>>,
    /// Groups inside these.
    deeper: u64,
    none: Arc<str>,
}

impl Default for DebugGroups {
    fn default() -> DebugGroups {
        DebugGroups { open: Vec::new(), deeper: 0, none: Arc::from("") }
    }
}

impl DebugGroups {
    /// Opens or closes a group, if the command does. A pop without a group is the checker's to refuse.
    pub fn note(&mut self, command: &Command) {
        match command {
            Command::PushDebugGroup(_) if self.open.len() == DEPTH => self.deeper += 1,
            Command::PushDebugGroup(label) => self.open.push(label.chars().take(LENGTH).collect::<String>().into()),
            Command::PopDebugGroup if self.deeper > 0 => self.deeper -= 1,
            Command::PopDebugGroup => {
                self.open.pop();
            }
            _ => {}
        }
    }

    /// The label of the innermost group whose label is kept, or empty.
    pub fn innermost(&self) -> Arc<str> {
        self.open.last().unwrap_or(&self.none).clone()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_innermost_group_names_a_draw() {
        let mut groups = DebugGroups::default();
        assert_eq!(&*groups.innermost(), "");
        groups.note(&Command::PushDebugGroup("scene".into()));
        groups.note(&Command::PushDebugGroup("trees".into()));
        assert_eq!(&*groups.innermost(), "trees");
        for _ in 0..100 {
            groups.note(&Command::PushDebugGroup("x".repeat(1000)));
        }
        assert_eq!(groups.innermost().len(), LENGTH);
        for _ in 0..100 {
            groups.note(&Command::PopDebugGroup);
        }
        assert_eq!(&*groups.innermost(), "trees");
        groups.note(&Command::PopDebugGroup);
        assert_eq!(&*groups.innermost(), "scene");
    }
}
