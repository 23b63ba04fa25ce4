//! Images from bytes: which pixels are free, occupied or unknown.

use std::io::Cursor;

use image::{DynamicImage, ImageDecoder, ImageFormat, ImageReader, Limits};

use super::import::MapImportError;
use crate::domain::geometry::{Cell, Grid};

/// The most pixels that an image, and the most cells that an imported grid, may have.
pub const MOST_PIXELS: u64 = 400_000_000;

/// The gray value that `map_saver` writes for unknown space.
const UNKNOWN: f64 = 205.0;

/// What a pixel says about the floor.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Pixel {
    /// Nothing stands there.
    Free,
    /// Something stands there.
    Occupied,
    /// Nobody has looked, or the value lies between the thresholds.
    Unknown,
}

/// A pixel's gray value and opacity, both in 0–255.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Shade {
    /// Mean of the color channels.
    pub gray: f64,
    /// 255 is opaque; `None` if the image has no alpha channel.
    pub alpha: Option<f64>,
}

impl Shade {
    /// Tells whether this is the value of unknown space, whatever the thresholds say.
    pub(super) fn is_unknown(self) -> bool {
        self.gray == UNKNOWN
    }
}

/// Decodes an image and classifies each of its pixels.
///
/// PGM (and its family), PNG, JPEG, BMP and TIFF are told apart by their first bytes. Channels of 16 bits are cut to 8.
///
/// # Errors
/// [`MapImportError`] if the bytes are no such image, are cut short or hold more than [`MOST_PIXELS`] pixels.
pub(super) fn classify(bytes: &[u8], class: impl Fn(Shade) -> Pixel) -> Result<Grid<Pixel>, MapImportError> {
    let image = decode(bytes)?;
    let (cols, rows) = (image.width() as usize, image.height() as usize);
    let gray = |value: u8| f64::from(value);
    let pixels = match &image {
        DynamicImage::ImageLuma8(pixels) => {
            let table: Vec<Pixel> = (0..=255).map(|value| class(Shade { gray: gray(value), alpha: None })).collect();
            pixels.as_raw().iter().map(|value| table[usize::from(*value)]).collect()
        }
        DynamicImage::ImageLumaA8(pixels) => {
            let shade = |p: &[u8]| Shade { gray: gray(p[0]), alpha: Some(gray(p[1])) };
            pixels.as_raw().chunks_exact(2).map(|p| class(shade(p))).collect()
        }
        DynamicImage::ImageRgb8(pixels) => {
            let shade = |p: &[u8]| Shade { gray: mean(p), alpha: None };
            pixels.as_raw().chunks_exact(3).map(|p| class(shade(p))).collect()
        }
        DynamicImage::ImageRgba8(pixels) => {
            let shade = |p: &[u8]| Shade { gray: mean(p), alpha: Some(gray(p[3])) };
            pixels.as_raw().chunks_exact(4).map(|p| class(shade(p))).collect()
        }
        deep if deep.color().has_alpha() => {
            let pixels = deep.to_rgba8();
            let shade = |p: &[u8]| Shade { gray: mean(p), alpha: Some(gray(p[3])) };
            pixels.as_raw().chunks_exact(4).map(|p| class(shade(p))).collect()
        }
        deep => {
            let pixels = deep.to_rgb8();
            let shade = |p: &[u8]| Shade { gray: mean(p), alpha: None };
            pixels.as_raw().chunks_exact(3).map(|p| class(shade(p))).collect()
        }
    };
    Ok(Grid::from_vec(rows, cols, pixels))
}

/// Turns a grid of pixels upside down.
pub(super) fn flipped(pixels: &Grid<Pixel>) -> Grid<Pixel> {
    let last = pixels.rows() - 1;
    Grid::from_fn(pixels.rows(), pixels.cols(), |cell| pixels[Cell::new(last - cell.row, cell.col)])
}

fn mean(channels: &[u8]) -> f64 {
    (f64::from(channels[0]) + f64::from(channels[1]) + f64::from(channels[2])) / 3.0
}

fn decode(bytes: &[u8]) -> Result<DynamicImage, MapImportError> {
    let damaged = |source| MapImportError::Image { source };
    let mut reader = ImageReader::new(Cursor::new(bytes));
    let format = image::guess_format(bytes).map_err(|_| MapImportError::ImageFormat)?;
    if !matches!(format, ImageFormat::Pnm | ImageFormat::Png | ImageFormat::Jpeg | ImageFormat::Bmp | ImageFormat::Tiff)
    {
        return Err(MapImportError::ImageFormat);
    }
    // The decoder of JPEG fills what is missing with gray instead of failing.
    if format == ImageFormat::Jpeg && !jpeg_is_whole(bytes) {
        return Err(MapImportError::ImageCutShort);
    }
    reader.set_format(format);
    let mut limits = Limits::no_limits();
    // 16 bits in each of four channels.
    limits.max_alloc = Some(8 * MOST_PIXELS);
    reader.limits(limits);
    let decoder = reader.into_decoder().map_err(damaged)?;
    let (width, height) = decoder.dimensions();
    if u64::from(width) * u64::from(height) > MOST_PIXELS {
        return Err(MapImportError::TooManyPixels { width: width.into(), height: height.into() });
    }
    DynamicImage::from_decoder(decoder).map_err(damaged)
}

/// Tells whether a JPEG's scans end with the marker for the end of the image.
///
/// Segments before the first scan are skipped by their lengths, because an embedded thumbnail has an end of its own.
fn jpeg_is_whole(bytes: &[u8]) -> bool {
    const START_OF_SCAN: u8 = 0xda;
    const END_OF_IMAGE: u8 = 0xd9;
    let mut at = 2;
    while let Some([0xff, marker, high, low]) = bytes.get(at..at + 4) {
        match *marker {
            0xff => at += 1,
            START_OF_SCAN => return bytes[at + 4..].windows(2).any(|pair| pair == [0xff, END_OF_IMAGE]),
            _ => at += 2 + usize::from(*high) * 256 + usize::from(*low),
        }
    }
    false
}

#[cfg(test)]
mod tests {
    use super::*;

    const FORMATS: [ImageFormat; 5] =
        [ImageFormat::Pnm, ImageFormat::Png, ImageFormat::Jpeg, ImageFormat::Bmp, ImageFormat::Tiff];

    fn encoded(image: &DynamicImage, format: ImageFormat) -> Vec<u8> {
        let mut bytes = Cursor::new(Vec::new());
        image.write_to(&mut bytes, format).expect("an image");
        bytes.into_inner()
    }

    /// White, with a black square in the upper left quarter.
    fn square() -> DynamicImage {
        DynamicImage::ImageLuma8(image::GrayImage::from_fn(64, 32, |x, y| {
            image::Luma([if x < 32 && y < 16 { 0 } else { 255 }])
        }))
    }

    fn half(shade: Shade) -> Pixel {
        if shade.gray > 127.0 { Pixel::Free } else { Pixel::Occupied }
    }

    #[test]
    fn every_format_is_read() {
        for format in FORMATS {
            let pixels = classify(&encoded(&square(), format), half).expect("an image");
            assert_eq!((pixels.rows(), pixels.cols()), (32, 64), "{format:?}");
            for cell in pixels.cells() {
                let black = cell.row < 16 && cell.col < 32;
                assert_eq!(pixels[cell] == Pixel::Occupied, black, "{format:?} {cell:?}");
            }
        }
    }

    #[test]
    fn every_channel_layout_is_read() {
        let image = square();
        for layout in [
            DynamicImage::ImageLumaA8(image.to_luma_alpha8()),
            DynamicImage::ImageRgb8(image.to_rgb8()),
            DynamicImage::ImageRgba8(image.to_rgba8()),
            DynamicImage::ImageLuma16(image.to_luma16()),
            DynamicImage::ImageRgba16(image.to_rgba16()),
        ] {
            let alpha = layout.color().has_alpha().then_some(255.0);
            let pixels = classify(&encoded(&layout, ImageFormat::Png), |shade| {
                assert_eq!(shade.alpha, alpha, "{:?}", layout.color());
                half(shade)
            });
            assert_eq!(
                pixels.expect("an image"),
                classify(&encoded(&image, ImageFormat::Png), half).expect("an image")
            );
        }
    }

    #[test]
    fn a_truncated_image_is_an_error() {
        let noise =
            DynamicImage::ImageLuma8(image::GrayImage::from_fn(64, 64, |x, y| image::Luma([(x * y * 37) as u8])));
        for format in FORMATS {
            let bytes = encoded(&noise, format);
            for percent in [0, 1, 10, 50, 90, 97] {
                let cut = &bytes[..bytes.len() * percent / 100];
                assert!(classify(cut, half).is_err(), "{format:?} cut to {percent} %");
            }
        }
    }

    #[test]
    fn an_image_bomb_is_refused_before_it_is_unpacked() {
        let bomb = b"P5 100000 100000 255\n\0";
        let error = classify(bomb, half).expect_err("ten thousand million pixels");
        assert!(matches!(error, MapImportError::TooManyPixels { width: 100_000, .. }), "{error}");
        let error = classify(b"GIF89a\x01\0\x01\0", half).expect_err("not one of ours");
        assert!(matches!(error, MapImportError::ImageFormat), "{error}");
    }

    #[test]
    fn flipping_swaps_the_rows() {
        use Pixel::{Free, Occupied, Unknown};
        let pixels = Grid::from_vec(3, 1, vec![Free, Occupied, Unknown]);
        assert_eq!(flipped(&pixels).as_slice(), [Unknown, Occupied, Free]);
    }
}
