//! Images from bytes: which pixels are free, occupied or unknown.

use std::io::Cursor;
use std::panic::{AssertUnwindSafe, catch_unwind};

use image::{DynamicImage, ExtendedColorType, ImageDecoder, ImageFormat, ImageReader, Limits};

use super::error::MapImportError;
use super::samples::{MOST_BYTES, MOST_PIXELS, Samples};
use super::{jpeg, pnm};
use crate::domain::geometry::{Cell, Grid};

/// The name of the thread that decodes images: what panics there is reported as an error, so nobody need print it.
pub const DECODER_THREAD: &str = "image decoder";

/// The gray value that `map_saver` writes for unknown space, of 255.
const UNKNOWN: u8 = 205;
/// How far JPEG may move it by rounding.
const JPEG_ERROR: u8 = 2;

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

/// What is known of a pixel's color.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Shade {
    /// Luminance, 255 is white.
    pub gray: u8,
    /// 255 is opaque; as are all pixels of an image without an alpha channel.
    pub alpha: u8,
    /// Whether it is the gray that `map_saver` writes for unknown space, however the image encodes that.
    pub marked: bool,
}

/// A decoded image.
#[derive(Debug)]
pub(super) struct Picture {
    rows: usize,
    cols: usize,
    pixels: Pixels,
    /// The samples, in their own scale, that stand for unknown space.
    unknown: Vec<u32>,
    is_jpeg: bool,
}

#[derive(Debug)]
enum Pixels {
    Gray {
        samples: Samples,
        max: u16,
    },
    /// Red, green, blue and alpha, or gray and alpha.
    Channels {
        samples: Samples,
        count: usize,
    },
}

/// Tells whether a file begins as one of the images that are read.
#[must_use]
pub fn is_image(start: &[u8]) -> bool {
    pnm::is_pgm(start) || format(start).is_some()
}

fn format(start: &[u8]) -> Option<ImageFormat> {
    let format = image::guess_format(start).ok()?;
    use ImageFormat::{Bmp, Jpeg, Png, Pnm, Tiff};
    matches!(format, Pnm | Png | Jpeg | Bmp | Tiff).then_some(format)
}

impl Picture {
    /// Decodes an image.
    ///
    /// PGM (and its family), PNG, JPEG, BMP and TIFF are told apart by their first bytes.
    ///
    /// # Errors
    /// [`MapImportError`] if the bytes are no such image, are cut short or hold more than [`MOST_PIXELS`] pixels.
    pub(super) fn decode(bytes: &[u8]) -> Result<Self, MapImportError> {
        if bytes.is_empty() {
            return Err(MapImportError::Empty);
        }
        if is_lfs_pointer(bytes) {
            return Err(MapImportError::LfsPointer { what: "image" });
        }
        if !is_image(bytes) {
            return Err(MapImportError::ImageFormat);
        }
        contained(|| if pnm::is_pgm(bytes) { Self::pgm(bytes) } else { Self::other(bytes) })
    }

    fn pgm(bytes: &[u8]) -> Result<Self, MapImportError> {
        let pnm::Pgm { width, height, max, samples } = pnm::read(bytes)?;
        let unknown = unknown_samples(max.into());
        Ok(Self { rows: height, cols: width, pixels: Pixels::Gray { samples, max }, unknown, is_jpeg: false })
    }

    fn other(bytes: &[u8]) -> Result<Self, MapImportError> {
        let (image, format, depth) = decode(bytes)?;
        let unknown = if format == ImageFormat::Jpeg {
            (UNKNOWN - JPEG_ERROR..=UNKNOWN + JPEG_ERROR).map(u32::from).collect()
        } else {
            // Fewer bits have been spread over all of the 8 or 16.
            let max = (1u32 << depth.clamp(1, 16)) - 1;
            let spread = if depth > 8 { 65535 / max } else { 255 / max };
            unknown_samples(max).into_iter().map(|sample| sample * spread).collect()
        };
        let (cols, rows) = (image.width() as usize, image.height() as usize);
        let pixels = match image {
            DynamicImage::ImageLuma8(image) => {
                Pixels::Gray { samples: Samples::Bytes(image.into_raw()), max: u8::MAX.into() }
            }
            DynamicImage::ImageLuma16(image) => {
                Pixels::Gray { samples: Samples::Deep(image.into_raw()), max: u16::MAX }
            }
            DynamicImage::ImageLumaA8(image) => {
                Pixels::Channels { samples: Samples::Bytes(image.into_raw()), count: 2 }
            }
            DynamicImage::ImageLumaA16(image) => {
                Pixels::Channels { samples: Samples::Deep(image.into_raw()), count: 2 }
            }
            DynamicImage::ImageRgb8(image) => Pixels::Channels { samples: Samples::Bytes(image.into_raw()), count: 3 },
            DynamicImage::ImageRgba8(image) => Pixels::Channels { samples: Samples::Bytes(image.into_raw()), count: 4 },
            DynamicImage::ImageRgb16(image) => Pixels::Channels { samples: Samples::Deep(image.into_raw()), count: 3 },
            deep => Pixels::Channels { samples: Samples::Deep(deep.to_rgba16().into_raw()), count: 4 },
        };
        Ok(Self { rows, cols, pixels, unknown, is_jpeg: format == ImageFormat::Jpeg })
    }

    /// Gives areas of unknown space one gray again if a JPEG has rippled them; for maps of `map_saver`.
    pub(super) fn settle_unknown(&mut self) {
        let count = match &self.pixels {
            Pixels::Gray { .. } => 1,
            Pixels::Channels { count, .. } => *count,
        };
        let (Pixels::Gray { samples, .. } | Pixels::Channels { samples, .. }) = &mut self.pixels;
        if let Samples::Bytes(bytes) = samples
            && self.is_jpeg
        {
            jpeg::settle(bytes, self.cols, count, UNKNOWN, JPEG_ERROR);
        }
    }

    /// Returns the number of pixels.
    pub(super) const fn len(&self) -> usize {
        self.rows * self.cols
    }

    /// Classifies each pixel.
    pub(super) fn classify(&self, class: impl Fn(Shade) -> Pixel) -> Grid<Pixel> {
        let pixels = match &self.pixels {
            Pixels::Gray { samples, max } => {
                let of = |sample: u32| {
                    let gray = scaled(sample, (*max).into());
                    class(Shade { gray, alpha: u8::MAX, marked: self.unknown.contains(&sample) })
                };
                let table: Vec<Pixel> = (0..=u32::from(*max)).map(of).collect();
                match samples {
                    Samples::Bytes(samples) => samples.iter().map(|sample| table[usize::from(*sample)]).collect(),
                    Samples::Deep(samples) => samples.iter().map(|sample| table[usize::from(*sample)]).collect(),
                }
            }
            Pixels::Channels { samples: Samples::Bytes(samples), count } => {
                samples.chunks_exact(*count).map(|pixel| class(self.shade(pixel, u8::MAX.into()))).collect()
            }
            Pixels::Channels { samples: Samples::Deep(samples), count } => {
                samples.chunks_exact(*count).map(|pixel| class(self.shade(pixel, u16::MAX.into()))).collect()
            }
        };
        Grid::from_vec(self.rows, self.cols, pixels)
    }

    fn shade<T: Copy + Into<u32>>(&self, channels: &[T], max: u32) -> Shade {
        let (colors, alpha) = match channels {
            [gray] => ([*gray; 3], None),
            [gray, alpha] => ([*gray; 3], Some(*alpha)),
            [red, green, blue] => ([*red, *green, *blue], None),
            [red, green, blue, alpha, ..] => ([*red, *green, *blue], Some(*alpha)),
            [] => unreachable!("an image has one to four channels"),
        };
        let colors = colors.map(Into::into);
        Shade {
            gray: scaled(luminance(colors), max),
            alpha: alpha.map_or(u8::MAX, |alpha| scaled(alpha.into(), max)),
            marked: colors.iter().all(|color| self.unknown.contains(color)),
        }
    }
}

/// Turns a grid of pixels upside down.
pub(super) fn flipped(pixels: &Grid<Pixel>) -> Grid<Pixel> {
    let last = pixels.rows() - 1;
    Grid::from_fn(pixels.rows(), pixels.cols(), |cell| pixels[Cell::new(last - cell.row, cell.col)])
}

/// Tells whether a file is what Git LFS puts in the place of a large one.
pub(super) fn is_lfs_pointer(bytes: &[u8]) -> bool {
    bytes.starts_with(b"version https://git-lfs.github.com/spec/")
}

/// Returns the samples, of `max` for white, that 205 of 255 becomes, whether it is rounded or shifted.
fn unknown_samples(max: u32) -> Vec<u32> {
    let unknown = u32::from(UNKNOWN);
    let rounded = (2 * unknown * max + 255) / 510;
    let shifted = unknown * (max + 1) / 256;
    let low = rounded.min(shifted);
    // So few levels that it would be white or black mean nothing.
    (low..=rounded).filter(|sample| *sample > 0 && *sample < max).collect()
}

/// Scales a sample to 8 bits, to the nearest.
const fn scaled(sample: u32, max: u32) -> u8 {
    ((2 * sample * 255 + max) / (2 * max)) as u8
}

/// Weighs red, green and blue as nav2's image library does (Rec. 601).
const fn luminance([red, green, blue]: [u32; 3]) -> u32 {
    (306 * red + 601 * green + 117 * blue) / 1024
}

/// Lets nothing out of a decoder of others but an error.
fn contained<T: Send>(decode: impl Fn() -> Result<T, MapImportError> + Send + Sync) -> Result<T, MapImportError> {
    let guarded = || {
        catch_unwind(AssertUnwindSafe(&decode)).unwrap_or_else(|panic| {
            let text = panic.downcast_ref::<&str>().map(|text| (*text).to_owned());
            let text = text.or_else(|| panic.downcast_ref::<String>().cloned());
            Err(MapImportError::Decoder(text.unwrap_or_else(|| "no message".to_owned())))
        })
    };
    std::thread::scope(|scope| {
        match std::thread::Builder::new().name(DECODER_THREAD.to_owned()).spawn_scoped(scope, guarded) {
            Ok(thread) => thread.join().expect("panics are caught in the thread"),
            // No more threads: then here, where a panic is caught as well.
            Err(_) => guarded(),
        }
    })
}

/// Decodes with the crate for images; says which format it is and how many bits a gray sample has.
fn decode(bytes: &[u8]) -> Result<(DynamicImage, ImageFormat, u16), MapImportError> {
    let damaged = |source| MapImportError::Image { source };
    let format = format(bytes).ok_or(MapImportError::ImageFormat)?;
    // The decoder of JPEG fills what is missing with gray instead of failing.
    if format == ImageFormat::Jpeg && !jpeg_is_whole(bytes) {
        return Err(MapImportError::ImageCutShort);
    }
    let mut reader = ImageReader::new(Cursor::new(bytes));
    reader.set_format(format);
    let mut limits = Limits::no_limits();
    limits.max_alloc = Some(MOST_BYTES);
    reader.limits(limits);
    let decoder = reader.into_decoder().map_err(damaged)?;
    let (width, height) = decoder.dimensions();
    if width == 0 || height == 0 {
        // Some decoders make room for rows that have no pixels.
        return Err(MapImportError::ImageCutShort);
    }
    // The decoder of JPEG keeps twelve bytes for each pixel beside what it decodes.
    let kept = if format == ImageFormat::Jpeg { 12 } else { 0 };
    let most = MOST_PIXELS.min(MOST_BYTES / (u64::from(decoder.color_type().bytes_per_pixel()) + kept));
    if u64::from(width) * u64::from(height) > most {
        return Err(MapImportError::TooManyPixels { width: width.into(), height: height.into(), most });
    }
    let depth = match (format, decoder.original_color_type()) {
        // The decoder of PNG does not tell: depth and kind of color stand in its header.
        (ImageFormat::Png, _) if bytes.get(25) == Some(&0) => bytes[24].into(),
        (_, ExtendedColorType::L1) => 1,
        (_, ExtendedColorType::L2) => 2,
        (_, ExtendedColorType::L4) => 4,
        _ if decoder.color_type().bytes_per_pixel() > decoder.color_type().channel_count() => 16,
        _ => 8,
    };
    Ok((DynamicImage::from_decoder(decoder).map_err(damaged)?, format, depth))
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
        if shade.gray > 127 { Pixel::Free } else { Pixel::Occupied }
    }

    fn classify(bytes: &[u8], class: impl Fn(Shade) -> Pixel) -> Result<Grid<Pixel>, MapImportError> {
        Ok(Picture::decode(bytes)?.classify(class))
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
        let expected = classify(&encoded(&image, ImageFormat::Png), half).expect("an image");
        for layout in [
            DynamicImage::ImageLumaA8(image.to_luma_alpha8()),
            DynamicImage::ImageLumaA16(image.to_luma_alpha16()),
            DynamicImage::ImageRgb8(image.to_rgb8()),
            DynamicImage::ImageRgba8(image.to_rgba8()),
            DynamicImage::ImageLuma16(image.to_luma16()),
            DynamicImage::ImageRgb16(image.to_rgb16()),
            DynamicImage::ImageRgba16(image.to_rgba16()),
        ] {
            let pixels = classify(&encoded(&layout, ImageFormat::Png), |shade| {
                assert_eq!(shade.alpha, 255, "{:?}", layout.color());
                half(shade)
            });
            assert_eq!(pixels.expect("an image"), expected);
        }
    }

    /// Tells whether an image of one gray, encoded in a way, is unknown space.
    fn is_marked(bytes: &[u8]) -> bool {
        let pixels = classify(bytes, |shade| if shade.marked { Pixel::Unknown } else { half(shade) });
        let pixels = pixels.expect("an image");
        assert!(pixels.as_slice().iter().all(|pixel| *pixel == pixels.as_slice()[0]), "one gray everywhere");
        pixels.as_slice()[0] == Pixel::Unknown
    }

    #[test]
    fn unknown_space_is_found_in_every_encoding() {
        for (gray, unknown) in [(205u8, true), (204, false), (206, false), (255, false), (0, false)] {
            let image = DynamicImage::ImageLuma8(image::GrayImage::from_pixel(16, 16, image::Luma([gray])));
            for layout in [
                image.clone(),
                DynamicImage::ImageLumaA8(image.to_luma_alpha8()),
                DynamicImage::ImageRgb8(image.to_rgb8()),
                DynamicImage::ImageRgba8(image.to_rgba8()),
                DynamicImage::ImageLuma16(image.to_luma16()),
                DynamicImage::ImageRgb16(image.to_rgb16()),
                DynamicImage::ImageRgba16(image.to_rgba16()),
            ] {
                assert_eq!(is_marked(&encoded(&layout, ImageFormat::Png)), unknown, "{gray} {:?}", layout.color());
            }
            for format in FORMATS {
                let near = (203..=207).contains(&gray) && format == ImageFormat::Jpeg;
                assert_eq!(is_marked(&encoded(&image, format)), unknown || near, "{gray} {format:?}");
            }
        }
    }

    #[test]
    fn unknown_space_is_found_whatever_stands_for_white() {
        // 205 of 255, to the nearest, and what a shift by whole bits makes of it.
        for (max, samples) in [
            (255, &[205u32][..]),
            (100, &[80]),
            (15, &[12]),
            (3, &[2]),
            (127, &[102]),
            (1, &[]),
            (2, &[]),
            (1023, &[820, 821, 822]),
        ] {
            assert_eq!(unknown_samples(max), samples, "of {max}");
        }
        let deep = unknown_samples(65535);
        assert!(deep.contains(&52480) && deep.contains(&52685) && deep.len() == 206);
        assert!(is_marked(b"P5 2 1 100\n\x50\x50") && !is_marked(b"P5 2 1 100\n\x4f\x4f"));
        assert!(is_marked(b"P5 1 1 65535\n\xcd\xcd") && !is_marked(b"P5 1 1 65535\n\xcc\xff"));
        assert!(is_marked(b"P2 1 1 15 12\n") && !is_marked(b"P2 1 1 15 13\n"));
        // A PNG of 4 bits a pixel, which are spread over 8 as it is decoded.
        assert!(is_marked(&four_bit_png(12)) && !is_marked(&four_bit_png(13)));
    }

    /// A gray PNG of 2 × 1 pixels of 4 bits.
    fn four_bit_png(gray: u8) -> Vec<u8> {
        png(&[0, 0, 0, 2, 0, 0, 0, 1, 4, 0, 0, 0, 0], &[], &[0, gray << 4 | gray])
    }

    /// A PNG of a header, further chunks and rows of less than 64 KiB.
    fn png(header: &[u8], more: &[(&[u8; 4], &[u8])], rows: &[u8]) -> Vec<u8> {
        let crc = |bytes: &[u8]| {
            let step = |crc: u32, byte: &u8| {
                (0..8).fold(crc ^ u32::from(*byte), |crc, _| (crc >> 1) ^ (0xEDB8_8320 * (crc & 1)))
            };
            !bytes.iter().fold(!0, step)
        };
        let adler = rows.iter().fold((1u32, 0u32), |(a, b), byte| {
            let a = (a + u32::from(*byte)) % 65521;
            (a, (b + a) % 65521)
        });
        let length = rows.len() as u16;
        let mut stored = vec![0x78, 1, 1];
        stored.extend(length.to_le_bytes());
        stored.extend((!length).to_le_bytes());
        stored.extend(rows);
        stored.extend((adler.1 << 16 | adler.0).to_be_bytes());
        let mut bytes = b"\x89PNG\r\n\x1a\n".to_vec();
        let chunks = [(b"IHDR", header)].into_iter().chain(more.iter().copied());
        for (name, data) in chunks.chain([(b"IDAT", &stored[..]), (b"IEND", &[])]) {
            bytes.extend((data.len() as u32).to_be_bytes());
            let chunk = [name, data].concat();
            bytes.extend(&chunk);
            bytes.extend(crc(&chunk).to_be_bytes());
        }
        bytes
    }

    #[test]
    fn a_decoder_that_panics_is_contained() {
        // One color, and the opacity of three.
        let palette: [(&[u8; 4], &[u8]); 2] = [(b"PLTE", &[0, 0, 0]), (b"tRNS", &[1, 2, 3])];
        let bytes = png(&[0, 0, 0, 2, 0, 0, 0, 1, 8, 3, 0, 0, 0], &palette, &[0, 0, 2]);
        match classify(&bytes, half) {
            Err(MapImportError::Decoder(_) | MapImportError::Image { .. }) | Ok(_) => {}
            Err(other) => panic!("{other}"),
        }
        let error = contained::<()>(|| panic!("at the {}nd pixel", 2)).expect_err("it panics");
        assert_eq!(error.to_string(), "the image is damaged in a way that stops its decoder: at the 2nd pixel");
    }

    #[test]
    fn what_is_no_image_says_what_it_is() {
        let check = |bytes: &[u8], says: &str| {
            let error = classify(bytes, half).expect_err(says).to_string();
            assert!(error.contains(says), "{error}");
        };
        check(b"", "the file is empty");
        check(b"version https://git-lfs.github.com/spec/v1\noid sha256:4d\nsize 12345\n", "pointer of Git LFS");
        check(b"GIF89a\x01\0\x01\0", "none of PGM, PNG, JPEG, BMP and TIFF");
        check(b"P", "none of PGM");
        check(b"image: map.pgm", "none of PGM");
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
    }

    #[test]
    fn an_image_without_pixels_is_refused_whatever_its_other_side() {
        for empty in [&b"P4 0 2147483647\n\0"[..], b"P1 2147483647 0\n0", b"P6 0 4294967295 255\n\0"] {
            let error = classify(empty, half).expect_err("nothing");
            assert!(matches!(error, MapImportError::ImageCutShort | MapImportError::Image { .. }), "{error}");
        }
    }

    #[test]
    fn an_image_that_takes_more_than_a_gibibyte_decoded_is_refused() {
        let encoded = |header: &str| classify(header.as_bytes(), half).expect_err("cut short or too large");
        // 196 million pixels: one byte each is too few to matter, six bytes each are 1.2 GB.
        assert!(!matches!(encoded("P5 14000 14000 255\n"), MapImportError::TooManyPixels { .. }));
        let error = encoded("P6 14000 14000 65535\n");
        assert!(matches!(error, MapImportError::TooManyPixels { most: 178_956_970, .. }), "{error}");
    }

    #[test]
    fn flipping_swaps_the_rows() {
        use Pixel::{Free, Occupied, Unknown};
        let pixels = Grid::from_vec(3, 1, vec![Free, Occupied, Unknown]);
        assert_eq!(flipped(&pixels).as_slice(), [Unknown, Occupied, Free]);
    }
}
