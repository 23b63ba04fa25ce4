//! PGM: gray images as `map_saver` writes them, with whatever largest value and with comments anywhere in the header.

use super::error::MapImportError;
use super::samples::{MOST_PIXELS, Samples};

/// The rows of a gray image, not yet scaled to 8 bits.
pub(super) struct Pgm {
    pub width: usize,
    pub height: usize,
    /// The value of white.
    pub max: u16,
    pub samples: Samples,
}

/// Tells whether these are the first bytes of a PGM, plain (`P2`) or binary (`P5`).
pub(super) fn is_pgm(bytes: &[u8]) -> bool {
    matches!(bytes, [b'P', b'2' | b'5', next, ..] if next.is_ascii_whitespace() || *next == b'#')
}

/// Reads a PGM.
///
/// As in Netpbm a comment runs from `#` to the end of its line and may follow a number without a space. Values above the
/// largest one are taken as white; what follows the last pixel is ignored.
///
/// # Errors
/// [`MapImportError`] if the header is none, the image is too large or its rows are cut short.
pub(super) fn read(bytes: &[u8]) -> Result<Pgm, MapImportError> {
    let mut header = Header { bytes, at: 2 };
    let (width, height) = (header.number()?, header.number()?);
    let max = header.number()?;
    if width == 0 || height == 0 {
        return Err(MapImportError::Pnm("its header says that it has no pixels"));
    }
    if width.saturating_mul(height) > MOST_PIXELS {
        return Err(MapImportError::TooManyPixels { width, height, most: MOST_PIXELS });
    }
    let Some(max) = u16::try_from(max).ok().filter(|max| *max > 0) else {
        return Err(MapImportError::Pnm("the largest value must lie from 1 to 65535"));
    };
    let pixels = (width * height) as usize;
    let samples = if bytes[1] == b'2' { header.plain(pixels, max)? } else { header.binary(pixels, max)? };
    Ok(Pgm { width: width as usize, height: height as usize, max, samples })
}

/// Reads numbers and comments.
struct Header<'a> {
    bytes: &'a [u8],
    at: usize,
}

impl Header<'_> {
    /// Returns the next byte that is no part of a comment; the end of a comment's line stands for all of it.
    fn next(&mut self) -> Option<u8> {
        let byte = *self.bytes.get(self.at)?;
        self.at += 1;
        if byte != b'#' {
            return Some(byte);
        }
        let line = self.bytes[self.at..].iter().position(|byte| matches!(byte, b'\n' | b'\r'))?;
        self.at += line + 1;
        Some(b'\n')
    }

    /// Reads a number and the one byte behind it.
    fn number(&mut self) -> Result<u64, MapImportError> {
        const WRONG: MapImportError = MapImportError::Pnm("its header holds something that is no number");
        let mut byte = self.next().ok_or(MapImportError::ImageCutShort)?;
        while byte.is_ascii_whitespace() {
            byte = self.next().ok_or(MapImportError::ImageCutShort)?;
        }
        let mut value = 0u64;
        loop {
            if !byte.is_ascii_digit() {
                return Err(WRONG);
            }
            value = value.saturating_mul(10).saturating_add(u64::from(byte - b'0'));
            match self.next() {
                Some(next) if !next.is_ascii_whitespace() => byte = next,
                _ => return Ok(value),
            }
        }
    }

    fn plain(&mut self, pixels: usize, max: u16) -> Result<Samples, MapImportError> {
        // Two bytes a value, at the least.
        if self.bytes.len().saturating_sub(self.at) + 1 < 2 * pixels {
            return Err(MapImportError::ImageCutShort);
        }
        let values = (0..pixels).map(|_| self.number().map(|value| value.min(max.into()) as u16));
        if max > 255 {
            return Ok(Samples::Deep(values.collect::<Result<_, _>>()?));
        }
        Ok(Samples::Bytes(values.map(|value| value.map(|value| value as u8)).collect::<Result<_, _>>()?))
    }

    fn binary(&self, pixels: usize, max: u16) -> Result<Samples, MapImportError> {
        let rest = self.bytes.get(self.at..).unwrap_or_default();
        let size = if max > 255 { 2 * pixels } else { pixels };
        let rest = rest.get(..size).ok_or(MapImportError::ImageCutShort)?;
        Ok(if max > 255 {
            Samples::Deep(rest.chunks_exact(2).map(|two| u16::from_be_bytes([two[0], two[1]]).min(max)).collect())
        } else {
            Samples::Bytes(rest.iter().map(|value| u16::from(*value).min(max) as u8).collect())
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn check(bytes: &[u8], max: u16, expected: &[u16]) {
        let pgm = read(bytes).unwrap_or_else(|error| panic!("{error}: {}", String::from_utf8_lossy(bytes)));
        let found = match pgm.samples {
            Samples::Bytes(values) => values.into_iter().map(u16::from).collect(),
            Samples::Deep(values) => values,
        };
        assert_eq!((pgm.width * pgm.height, pgm.max, found), (expected.len(), max, expected.to_vec()));
    }

    #[test]
    fn comments_stand_anywhere_in_the_header() {
        check(b"P5 2 1 255\n\x01\x02", 255, &[1, 2]);
        check(b"P5#a\n2#b\n1#c\n255#d\n\x01\x02", 255, &[1, 2]);
        check(b"P5\n# CREATOR: map_saver.cpp 0.050 m/pix\n2 1\n255\n\x01\x02", 255, &[1, 2]);
        check(b"P5\r\n#a\r\n\n#b\n2 1 255\n#\x02", 255, &[35, 2]);
        check(b"P2\n2 1\n# one\n15\n3 #two\n 16", 15, &[3, 15]);
    }

    #[test]
    fn every_largest_value_is_read() {
        check(b"P5 2 1 100 \x50\xff", 100, &[80, 100]);
        check(b"P5 2 1 65535\n\xcd\xcd\0\x01", 65535, &[52685, 1]);
        check(b"P5 1 1 256\n\x01\0 and more", 256, &[256]);
        check(b"P2 2 1 65535 52685 7\n", 65535, &[52685, 7]);
    }

    #[test]
    fn what_is_no_image_is_an_error() {
        for (bytes, says) in [
            (&b"P5 2 1 255\n\x01"[..], "cut short"),
            (b"P5 2 2 65535\n\0\x01\0\x01\0\x01\0", "cut short"),
            (b"P5 2 1", "cut short"),
            (b"P5 2 1 255", "cut short"),
            (b"P5 2 1 # 255", "cut short"),
            (b"P2 2 2 255 1 2 3", "cut short"),
            (b"P5 0 1 255\n", "no pixels"),
            (b"P5 2 1 0\n\0\0", "from 1 to 65535"),
            (b"P5 2 1 70000\n\0\0", "from 1 to 65535"),
            (b"P5 two 1 255\n\0\0", "no number"),
            (b"P5 -2 1 255\n\0\0", "no number"),
            (b"P5 99999999999999999999 2 255\n\0\0", "too many pixels"),
        ] {
            let error = read(bytes).err().map(|error| error.to_string()).unwrap_or_default();
            assert!(error.contains(says), "{}: {error}", String::from_utf8_lossy(bytes));
        }
    }
}
