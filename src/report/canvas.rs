//! A canvas of pixels: rectangles, and text from a bitmap font.

use noto_sans_mono_bitmap::{FontWeight, RasterHeight, get_raster, get_raster_width};

use super::colors::{self, Rgb};

/// A font.
#[derive(Debug, Clone, Copy)]
pub struct Font {
    weight: FontWeight,
    height: RasterHeight,
}

impl Font {
    /// Axes and legends.
    pub const SMALL: Self = Self { weight: FontWeight::Regular, height: RasterHeight::Size16 };
    /// Titles.
    pub const TITLE: Self = Self { weight: FontWeight::Bold, height: RasterHeight::Size20 };

    /// Returns the height of a line in pixels.
    #[must_use]
    pub const fn height(self) -> usize {
        self.height.val()
    }

    /// Returns the width of a text in pixels.
    #[must_use]
    pub fn width(self, text: &str) -> usize {
        text.chars().count() * get_raster_width(self.weight, self.height)
    }
}

/// A picture in the making.
#[derive(Debug)]
pub struct Canvas {
    width: usize,
    height: usize,
    pixels: Vec<Rgb>,
}

impl Canvas {
    /// Starts with bare paper.
    #[must_use]
    pub fn new(width: usize, height: usize) -> Self {
        Self { width, height, pixels: vec![colors::PAPER; width * height] }
    }

    /// Fills a rectangle; what lies outside is left out.
    pub fn fill(&mut self, x: usize, y: usize, width: usize, height: usize, color: Rgb) {
        for row in y..(y + height).min(self.height) {
            let (from, to) = (x.min(self.width), (x + width).min(self.width));
            self.pixels[row * self.width + from..row * self.width + to].fill(color);
        }
    }

    /// Draws the edges of a rectangle, one pixel wide, just outside of it.
    pub fn frame(&mut self, x: usize, y: usize, width: usize, height: usize, color: Rgb) {
        let (left, top) = (x.saturating_sub(1), y.saturating_sub(1));
        self.fill(left, top, width + 2, 1, color);
        self.fill(left, y + height, width + 2, 1, color);
        self.fill(left, top, 1, height + 2, color);
        self.fill(x + width, top, 1, height + 2, color);
    }

    /// Writes text from its upper left corner.
    pub fn text(&mut self, x: usize, y: usize, text: &str, font: Font) {
        let mut left = x;
        for letter in text.chars() {
            self.letter(letter, font, |column, row| (left + column, y + row));
            left += get_raster_width(font.weight, font.height);
        }
    }

    /// Writes text from bottom to top, from its lower left corner.
    pub fn text_upwards(&mut self, x: usize, y: usize, text: &str, font: Font) {
        let mut bottom = y;
        for letter in text.chars() {
            self.letter(letter, font, |column, row| (x + row, bottom.wrapping_sub(column)));
            bottom = bottom.wrapping_sub(get_raster_width(font.weight, font.height));
        }
    }

    fn letter(&mut self, letter: char, font: Font, place: impl Fn(usize, usize) -> (usize, usize)) {
        let raster = get_raster(known(letter), font.weight, font.height);
        let raster = raster.or_else(|| get_raster('?', font.weight, font.height)).expect("the font has Basic Latin");
        for (row, line) in raster.raster().iter().enumerate() {
            for (column, strength) in line.iter().enumerate() {
                let (x, y) = place(column, row);
                if *strength > 0 && x < self.width && y < self.height {
                    let pixel = &mut self.pixels[y * self.width + x];
                    *pixel = colors::mix(*pixel, colors::INK, f64::from(*strength) / 255.0);
                }
            }
        }
    }

    /// Returns width, height and the bytes of the pixels.
    #[must_use]
    pub fn into_rgb(self) -> (usize, usize, Vec<u8>) {
        (self.width, self.height, self.pixels.concat())
    }
}

/// Puts what Latin-1 has in place of what it has not.
const fn known(letter: char) -> char {
    match letter {
        '−' | '–' | '—' => '-',
        '’' | '‘' => '\'',
        '“' | '”' => '"',
        '…' => '.',
        other => other,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn drawing_beyond_the_edge_is_left_out() {
        let mut canvas = Canvas::new(20, 10);
        canvas.frame(0, 0, 20, 10, [4, 5, 6]);
        canvas.text(12, 4, "W漢", Font::TITLE);
        canvas.text_upwards(15, 8, "heat", Font::SMALL);
        canvas.fill(15, 5, 100, 100, [1, 2, 3]);
        let (width, height, bytes) = canvas.into_rgb();
        assert_eq!((width, height, bytes.len()), (20, 10, 600));
        assert_eq!(bytes[(9 * 20 + 19) * 3..], [1, 2, 3]);
    }

    #[test]
    fn text_is_as_wide_as_it_says() {
        let width = Font::SMALL.width("10 m²");
        let mut canvas = Canvas::new(width + 20, 20);
        canvas.text(10, 2, "10 m²", Font::SMALL);
        let (wide, _, bytes) = canvas.into_rgb();
        let inked: Vec<usize> =
            bytes.chunks(3).enumerate().filter(|(_, p)| p[0] < 200).map(|(i, _)| i % wide).collect();
        assert!(*inked.iter().min().expect("ink") >= 10 && *inked.iter().max().expect("ink") < 10 + width);
    }
}
