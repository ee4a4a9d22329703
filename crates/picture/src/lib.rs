//! Floor 3: pictures: a surface's bytes as one, files of them, and how two differ. What touches every pixel for the reports is here, since the
//! package of the program is not optimised.

mod difference;
mod file;
mod surface;

pub use difference::{Difference, TOLERANCE, compare, rgb_difference};
pub use file::{MARK, ReadError, marked, png, read, read_png};
pub use surface::{colors, picture};
