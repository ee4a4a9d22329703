//! Files of pictures.

use std::fs::File;
use std::io::{BufReader, Cursor};

use image::codecs::png::PngEncoder;
use image::{
    DynamicImage, ExtendedColorType, ImageBuffer, ImageEncoder, ImageError, ImageFormat, ImageReader, Pixel,
    PixelWithColorType, RgbaImage,
};

/// A PNG file of a picture of 8 bits a channel, with alpha where its pixels have it.
///
/// # Errors
/// If the picture has no pixels.
pub fn png<P>(image: &ImageBuffer<P, Vec<u8>>) -> Result<Vec<u8>, ImageError>
where
    P: Pixel<Subpixel = u8> + PixelWithColorType,
{
    png_of(image.as_raw(), [image.width(), image.height()], P::COLOR_TYPE)
}

/// No type parameter: the compressor is optimised here, and not compiled again in each package that writes pictures.
fn png_of(bytes: &[u8], [width, height]: [u32; 2], color: ExtendedColorType) -> Result<Vec<u8>, ImageError> {
    let mut file = Vec::new();
    PngEncoder::new(&mut file).write_image(bytes, width, height, color)?;
    Ok(file)
}

/// What tells a PNG file that [`marked`] has written from others: a text chunk that names the program.
pub const MARK: &[u8] = b"tEXtSoftware\0fillrate";

/// A PNG file of a picture, with [`MARK`] in it.
///
/// # Errors
/// If the picture has no pixels.
pub fn marked(image: &RgbaImage) -> Result<Vec<u8>, ImageError> {
    /// The signature and the header, which come first.
    const HEADER: usize = 8 + 25;
    let mut file = png(image)?;
    let mut chunk = (MARK.len() as u32 - 4).to_be_bytes().to_vec();
    chunk.extend_from_slice(MARK);
    chunk.extend_from_slice(&crc32fast::hash(MARK).to_be_bytes());
    file.splice(HEADER..HEADER, chunk);
    Ok(file)
}

/// Reads a PNG or PNM file. Its first bytes say which it is.
///
/// # Errors
/// If it cannot be read, is neither, or is damaged, or if the picture is too large.
pub fn read(file: File) -> Result<DynamicImage, ImageError> {
    ImageReader::new(BufReader::new(file)).with_guessed_format().map_err(ImageError::IoError)?.decode()
}

/// Reads the bytes of a PNG file.
///
/// # Errors
/// If they are none, if it is damaged, or if the picture is too large.
pub fn read_png(file: &[u8]) -> Result<DynamicImage, ImageError> {
    ImageReader::with_format(Cursor::new(file), ImageFormat::Png).decode()
}

#[cfg(test)]
mod tests {
    use super::*;
    use image::{Rgb, RgbImage, Rgba};
    use std::io::{Seek, Write};

    fn on_disk(bytes: &[u8]) -> File {
        let mut file = tempfile::tempfile().unwrap();
        file.write_all(bytes).unwrap();
        file.rewind().unwrap();
        file
    }

    #[test]
    fn files_are_read_as_they_were_written() {
        let image = RgbaImage::from_fn(7, 3, |x, y| Rgba([x as u8 * 30, y as u8 * 80, 9, 255 - x as u8]));
        let file = png(&image).unwrap();
        assert_eq!(read(on_disk(&file)).unwrap().into_rgba8(), image);
        assert_eq!(read_png(&file).unwrap().into_rgba8(), image);
        let marked = marked(&image).unwrap();
        assert!(marked.windows(MARK.len()).any(|bytes| bytes == MARK));
        // A reader checks the sum of each chunk.
        assert_eq!(read_png(&marked).unwrap().into_rgba8(), image);
        let opaque = RgbImage::from_fn(5, 2, |x, y| Rgb([x as u8, y as u8, 200]));
        assert_eq!(read(on_disk(&png(&opaque).unwrap())).unwrap().into_rgb8(), opaque);
        let pnm = [&b"P6 2 1 255\n"[..], &[1, 2, 3, 4, 5, 6]].concat();
        assert_eq!(read(on_disk(&pnm)).unwrap().into_rgb8().into_raw(), [1, 2, 3, 4, 5, 6]);
        assert!(read_png(&pnm).is_err());
        assert!(read(on_disk(&file[..file.len() / 2])).is_err() && read(on_disk(b"no picture")).is_err());
    }
}
