//! Draws: what the state says becomes commands of the card.
//!
//! Vertices that stay on the card are kept for later draws, each as long as what they are made of:
//!
//! * Buffers of display lists ([`lists`]) are made of a list's vertices and a layout. A list owns them.
//! * Conversions of buffer objects ([`resident`]) are made of its contents and a format. The buffer object owns them.

pub mod append;
pub mod arrays;
pub mod buffers;
pub mod clear;
pub mod conditions;
pub mod frames;
pub mod key;
pub mod lines;
pub mod lists;
pub mod lit;
pub mod materials;
pub mod outline;
pub mod pipeline;
pub mod pixels;
pub mod prepare;
pub mod primitives;
pub mod program_key;
pub mod program_values;
pub mod programs;
pub mod quads;
pub mod resident;
pub mod stipple;
pub mod streams;
pub mod submit;
pub mod target;
pub mod texturing;
pub mod uniforms;
pub mod viewport;
