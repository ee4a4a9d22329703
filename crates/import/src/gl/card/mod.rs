//! The card: windows, passes, pipelines, and the recorder of the commands.

pub mod copies;
pub mod copy_key;
pub mod device;
pub mod pass;
pub mod targets;
pub mod windows;
