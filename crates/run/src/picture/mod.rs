//! Pictures: a surface's bytes as a picture, files of pictures, and how two pictures differ.
//!
//! ```
//! use gfx::format::Format;
//! use work::{Surface, SurfaceKey};
//!
//! let key = SurfaceKey { texture: 1, level: 0, layer: 0 };
//! let surface = Surface { key, format: Format::Bgra8Unorm, width: 1, height: 1, samples: 1, address: 0, opaque: false };
//! // Stored as blue, green, red, alpha.
//! let red = run::picture::picture(&surface, &[0, 0, 255, 255])?;
//! assert_eq!(red.get_pixel(0, 0).0, [255, 0, 0, 255]);
//! # Ok::<(), String>(())
//! ```

mod difference;
mod file;
mod surface;

pub use difference::{Difference, TOLERANCE, compare, rgb_difference};
pub use file::{MARK, ReadError, marked, png, read, read_png};
pub use surface::{colors, picture};
