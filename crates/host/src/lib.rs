//! Floor 0: the machine that this program runs on: its files, and text for its terminals.

mod files;
mod plain;
mod replace;

pub use files::{Links, check_folder, length, open, read_text};
pub use plain::{Fence, excerpt, is_obeyed, one_line, path_line, printable};
pub use replace::{Part, replace, write_file};
