//! Converts recorded OpenGL programs to traces: two readers, and one machine for the fixed-function pipeline of OpenGL 1.5, assembly
//! programs and GLSL programs.
//!
//! A module uses only those below it:
//!
//! ```text
//! open, background    a file becomes a trace in memory, or a stream of commands
//! recording           runs the calls of a reader on a machine
//! dispatch, table     find the function of a call by its name
//! calls               the functions; those of display lists run others
//! draw                turns the state into draws, and draws into commands
//! machine             has all parts of the state
//! state               transform, lighting, texturing, buffers, lists, programs, ...
//! geometry            vertices, primitives, and how they are packed into buffers
//! card                passes, pipelines, windows; records commands
//! texels, elements    formats of pixels and of vertices
//! call, names         recorded calls and their arguments
//! ```
//!
//! The machine holds OpenGL's state. Primitives between two changes of state become one draw. Fixed-function state becomes WGSL, which is
//! generated from a small key (`gl_shader::key`), so equal state has one shader and one pipeline. Draws are gathered into passes. A pass
//! ends at a clear, a copy of the framebuffer, a write to a texture that it reads, and the end of the frame.
//!
//! * Buffer objects stay on the card (`state::buffers`). Draws read them from there where the card can (`draw::resident`); other draws have their
//!   vertices in buffers of their pass.
//! * Clip space: the matrix maps depths from [-w, w] to [0, w]. The window's origin is at the lower left; the viewport, the scissor and
//!   copies flip rows.
//! * A texture's first row is its lowest in OpenGL, and the first in memory in both, so images are not changed. Only copies of the
//!   framebuffer flip rows.
//! * Framebuffer objects store rows as textures do: positions are flipped instead, and so is the winding of front faces.
//! * In frames that are not wanted, passes that draw to the window are held back until something can read their results. A clear of all
//!   that they write drops them.
//! * The window has no alpha unless the program asks for it: alpha stays 1.
//! * A call that raises an OpenGL error has no effect.
//! * Unsupported features are counted by name, with the first call ([`Report`](crate::Report)); they never give a wrong picture without a message.

mod background;
mod call;
mod calls;
mod card;
mod dispatch;
mod draw;
mod elements;
mod geometry;
mod log;
mod machine;
mod matrix;
mod names;
mod open;
mod reader;
mod recording;
mod state;
mod table;
mod texels;

pub use open::open;
pub use recording::{import_bytes, import_frames};
