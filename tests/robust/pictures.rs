//! Checks for any bytes as a picture, for the tests and the fuzz target.

use std::io::Cursor;

use fillrate::num::Limits;
use fillrate::picture;

/// Pixels that a picture may have here.
const PIXELS: u64 = 1 << 16;

/// The answer is a picture of as many pixels as are allowed, which is written and reads back the same, or an error with a message.
pub fn read_everything(data: &[u8]) {
    let limits = Limits { picture_pixels: Limits::default().picture_pixels.with(PIXELS), ..Limits::default() };
    for read in [picture::read(Cursor::new(data), &limits), picture::read_png(data, &limits)] {
        match read {
            Ok(image) => {
                let image = image.into_rgba8();
                assert!(u64::from(image.width()) * u64::from(image.height()) <= PIXELS);
                let written = picture::png(&image).unwrap_or_else(|error| panic!("{error}"));
                let again = picture::read_png(&written, &limits).unwrap_or_else(|error| panic!("{error}"));
                assert!(again.into_rgba8() == image);
            }
            Err(error) => assert!(!error.to_string().is_empty()),
        }
    }
}
