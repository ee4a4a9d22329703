//! Files of pictures.

use std::io::{BufRead, BufReader, Cursor, Read, Seek};

use image::codecs::png::PngEncoder;
use image::{
    DynamicImage, ExtendedColorType, ImageBuffer, ImageDecoder, ImageEncoder, ImageError, ImageFormat, ImageReader, Pixel,
    PixelWithColorType, RgbaImage,
};
use num::{LimitExceeded, Limits};

/// A PNG file of a picture of 8 bits per channel, with alpha where its pixels have it.
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

/// Why a file of a picture is not read.
#[derive(Debug, thiserror::Error)]
pub enum ReadError {
    /// It cannot be read, or it is damaged.
    #[error(transparent)]
    Image(#[from] ImageError),
    /// Its picture is too large.
    #[error("a picture of {width} x {height}: {error}")]
    Large {
        /// Its width in pixels.
        width: u32,
        /// Its height in pixels.
        height: u32,
        /// The limit.
        error: LimitExceeded,
    },
    /// Its picture has no pixels: a PNM file may say so.
    #[error("a picture of {width} x {height} has no pixels")]
    Empty {
        /// Its width in pixels.
        width: u32,
        /// Its height in pixels.
        height: u32,
    },
    /// Its decoder needs more memory than a picture of as many pixels as are allowed.
    #[error(
        "a row of its picture, or what is packed beside it, needs more memory than {0} pixels; --limit picture.pixels=N allows more"
    )]
    Room(u64),
}

/// Reads a PNG or PNM file. Its first bytes say which it is.
///
/// # Errors
/// If the file cannot be read, is of another format, or is damaged, or if the picture has no pixels, or more than [`Limits::picture_pixels`].
pub fn read<R: Read + Seek>(file: R, limits: &Limits) -> Result<DynamicImage, ReadError> {
    decode(ImageReader::new(BufReader::new(file)).with_guessed_format().map_err(ImageError::IoError)?, limits)
}

/// Reads the bytes of a PNG file.
///
/// # Errors
/// As [`read`].
pub fn read_png(file: &[u8], limits: &Limits) -> Result<DynamicImage, ReadError> {
    decode(ImageReader::with_format(Cursor::new(file), ImageFormat::Png), limits)
}

/// Bytes of the largest pixel: four channels of 16 bits.
const PIXEL: u64 = 8;

/// Bytes that a decoder may take beside the picture: a row of it, and the text and the profile that are packed in the file.
const BESIDE: u64 = 64 << 20;

/// Decodes a picture whose header asks for no more than is allowed. The decoder makes room for the picture after its header is read.
fn decode<R: BufRead + Seek>(mut reader: ImageReader<R>, limits: &Limits) -> Result<DynamicImage, ReadError> {
    let mut room = image::Limits::no_limits();
    room.max_alloc = Some(limits.picture_pixels.get().saturating_mul(PIXEL).saturating_add(BESIDE));
    reader.limits(room);
    let allowed = limits.picture_pixels.get();
    let refused = |error| match error {
        ImageError::Limits(_) => ReadError::Room(allowed),
        error => ReadError::Image(error),
    };
    let decoder = reader.into_decoder().map_err(refused)?;
    let (width, height) = decoder.dimensions();
    let pixels = u64::from(width).saturating_mul(u64::from(height));
    if pixels == 0 {
        return Err(ReadError::Empty { width, height });
    }
    limits.picture_pixels.check(pixels).map_err(|error| ReadError::Large { width, height, error })?;
    DynamicImage::from_decoder(decoder).map_err(refused)
}

#[cfg(test)]
mod tests {
    use super::*;
    use image::{Rgb, RgbImage, Rgba};
    use std::fs::File;
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
        let limits = Limits::default();
        let read = |file: &[u8]| read(on_disk(file), &limits);
        let read_bytes = |file: &[u8]| read_png(file, &limits);
        assert_eq!(read(&file).unwrap().into_rgba8(), image);
        assert_eq!(read_bytes(&file).unwrap().into_rgba8(), image);
        let marked = marked(&image).unwrap();
        assert!(marked.windows(MARK.len()).any(|bytes| bytes == MARK));
        // A reader checks the sum of each chunk.
        assert_eq!(read_bytes(&marked).unwrap().into_rgba8(), image);
        let opaque = RgbImage::from_fn(5, 2, |x, y| Rgb([x as u8, y as u8, 200]));
        assert_eq!(read(&png(&opaque).unwrap()).unwrap().into_rgb8(), opaque);
        let pnm = [&b"P6 2 1 255\n"[..], &[1, 2, 3, 4, 5, 6]].concat();
        assert_eq!(read(&pnm).unwrap().into_rgb8().into_raw(), [1, 2, 3, 4, 5, 6]);
        assert!(read_bytes(&pnm).is_err());
        assert!(read(&file[..file.len() / 2]).is_err() && read(b"no picture").is_err());
    }

    #[test]
    fn pictures_without_pixels_are_not_read() {
        for (size, pnm) in [("0 x 3", "P6 0 3 255\n"), ("7 x 0", "P5 7 0 255\n"), ("0 x 60000", "P6000 60000\n255\n")] {
            let refused = read(on_disk(pnm.as_bytes()), &Limits::default()).expect_err(pnm);
            assert_eq!(refused.to_string(), format!("a picture of {size} has no pixels"));
        }
    }

    #[test]
    fn pictures_of_more_pixels_than_allowed_are_not_read() {
        let file = png(&RgbaImage::new(7, 3)).unwrap();
        let within =
            |pixels: u64| Limits { picture_pixels: Limits::default().picture_pixels.with(pixels), ..Limits::default() };
        assert_eq!(read_png(&file, &within(21)).unwrap().into_rgba8().dimensions(), (7, 3));
        let pnm = [&b"P6 7 3 255\n"[..], &[0; 63]].concat();
        for refused in [read_png(&file, &within(20)), read(on_disk(&file), &within(20)), read(on_disk(&pnm), &within(20))] {
            assert_eq!(
                refused.unwrap_err().to_string(),
                "a picture of 7 x 3: 21 pixels of a picture, more than the limit of 20; --limit picture.pixels=N allows more"
            );
        }
    }
}
