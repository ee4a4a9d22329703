//! Floor 0: the machine that this program runs on: its files, text for its terminals, its stacks.

mod files;
mod guard;
mod plain;
mod replace;
mod stack;

pub use files::{Links, check_folder, length, open, read_text};
pub use guard::{guarded, is_guarded};
pub use plain::{Fence, excerpt, is_obeyed, one_line, path_line, printable, ron_reason};
pub use replace::{Part, replace, write_file};
pub use stack::with_room_for;
