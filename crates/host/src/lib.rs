//! Floor 0: the machine that this program runs on: its files, text for its terminals, its stacks and heap, its signals.
//!
//! ```
//! // A name from a trace cannot steer the terminal that shows it.
//! assert_eq!(host::one_line("a\nb"), "a\\nb");
//! // A file is written as a whole or not at all.
//! let path = std::env::temp_dir().join(format!("host-example-{}", std::process::id()));
//! host::write_file(&path, b"complete")?;
//! assert_eq!(host::read_text(&path, 100)?, "complete");
//! std::fs::remove_file(&path)?;
//! # Ok::<(), std::io::Error>(())
//! ```

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
pub use replace::{PartialFile, exit_without_parts, replace, write_file};
pub use signal::survive_full_files;
pub use spool::Spool;
pub use stack::{with_program_stack, with_room_for};
