//! Converts captures of Vulkan programs by GFXReconstruct to traces.
//!
//! A module uses only those below it:
//!
//! ```text
//! recording, survey     a file becomes a trace in memory, a stream of commands, or a list of what is refused; runs blocks and calls
//! submission            runs the lists of command buffers
//! draw, transfer,       commands become native ones: draws and dispatches, copies and clears, queries
//!   queries
//! generated,            draws that stand for commands that the card does not have, dispatches that convert what a command reads
//!   conversions
//! create, descriptors   the program's objects
//! pass                  passes
//! pipelines, groups,    native pipelines, bind groups and shaders, made when a draw needs them
//!   shaders, points
//! machine               has all of the state
//! objects, state        objects of the program, fixed state of draws
//! args, formats, fault  values of calls, constants, errors
//! ```
//!
//! Calls that record commands are kept in lists, which run when their command buffer is submitted. The order of submission is the order of
//! execution, so barriers, events, fences and semaphores have nothing to do: a machine orders what touches the same memory.
//!
//! * A memory object is a native buffer, as long as the buffers in it need, and a `VkBuffer` is a range of it. Images are textures.
//! * Native pipelines and bind groups are made at the draw that needs them, and kept by what they are made of. So a pipeline with a shader that is
//!   refused does no harm until it draws.
//! * A group has the bindings that the shaders read, whatever the layout of the set has.
//! * Vulkan's clip space points down: positions are turned in the vertex shader, unless the height of the viewport is negative.
//! * A render pass with several subpasses is a native pass for each, and a pass with several views is one for each view.
//! * What is not supported is counted by name with the first block, and never gives a wrong picture without a message.

mod args;
mod conversions;
mod create;
mod descriptors;
mod draw;
mod fault;
mod formats;
mod generated;
mod groups;
mod machine;
mod objects;
mod pass;
mod pipelines;
mod points;
mod queries;
mod recording;
mod shaders;
mod state;
mod submission;
mod survey;
mod transfer;

pub use fault::Refusal;
pub use recording::{open, survey};
pub use survey::Survey;
