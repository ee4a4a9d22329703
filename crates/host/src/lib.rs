//! Floor 0: the machine that this program runs on: its files, text for its terminals, its stacks and heap, its signals.

mod files;
mod guard;
mod heap;
mod plain;
mod replace;
mod signal;
mod spool;
mod stack;

pub use files::{Links, check_folder, length, open, open_locked, read_text};
pub use guard::{guarded, is_guarded};
pub use heap::share_one_heap;
pub use plain::{Fence, excerpt, is_obeyed, one_line, path_line, printable, ron_reason};
pub use replace::{Part, replace, write_file};
pub use signal::survive_full_files;
pub use spool::Spool;
pub use stack::{with_program_stack, with_room_for};
