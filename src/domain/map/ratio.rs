//! The ratio of two resolutions, as whole numbers: cells are counted, never accumulated.

/// Numbers closer than this, as a share of the larger one, are taken as equal: a rounding to `float32` moves a number by a
/// sixteenth of it.
const HAIR: f64 = 1e-6;

/// How many cells an edge of a pixel spans: `cells / pixels`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Ratio {
    pub cells: u64,
    pub pixels: u64,
}

impl Ratio {
    /// Finds the simplest fraction within a hair of `pixel / cell`, two lengths from 10 µm to 1 km.
    pub(super) fn of(pixel: f64, cell: f64) -> Self {
        let exact = pixel / cell;
        // Continued fractions: each convergent is the best one up to its denominator.
        let (mut before, mut now) = ((0u64, 1u64), (1u64, 0u64));
        let mut rest = exact;
        loop {
            let whole = rest.floor();
            let next = (whole as u64 * now.0 + before.0, whole as u64 * now.1 + before.1);
            if (next.0 as f64 / next.1 as f64 - exact).abs() <= HAIR * exact {
                return Self { cells: next.0, pixels: next.1 };
            }
            (before, now) = (now, next);
            rest = 1.0 / (rest - whole);
        }
    }

    /// Returns how many cells so many pixels need.
    pub(super) const fn cells(self, pixels: usize) -> u64 {
        (pixels as u64 * self.cells).div_ceil(self.pixels)
    }

    /// Returns the cell that holds the center of a pixel, both counted from 0.
    pub(super) const fn cell_of(self, pixel: usize) -> usize {
        ((2 * pixel as u64 + 1) * self.cells / (2 * self.pixels)) as usize
    }

    /// Returns the largest number of pixels that is no wider than a cell, at least 1.
    pub(super) const fn pixels_in_a_cell(self) -> usize {
        let whole = self.pixels / self.cells;
        if whole == 0 { 1 } else { whole as usize }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn float32_gives_the_fraction_of_its_decimal() {
        let check = |pixel: f64, cell: f64, cells, pixels| {
            for pixel in [pixel, f64::from(pixel as f32), format!("{:.7}", pixel as f32).parse().expect("a number")] {
                for cell in [cell, f64::from(cell as f32)] {
                    assert_eq!(Ratio::of(pixel, cell), Ratio { cells, pixels }, "{pixel} in {cell}");
                }
            }
        };
        check(0.1, 0.1, 1, 1);
        check(0.05, 0.1, 1, 2);
        check(0.025, 0.1, 1, 4);
        check(0.03, 0.1, 3, 10);
        check(0.07, 0.1, 7, 10);
        check(0.02, 0.05, 2, 5);
        check(0.2, 0.1, 2, 1);
        check(0.15, 0.1, 3, 2);
        check(0.0254, 0.1, 127, 500);
        check(10.0, 0.01, 1000, 1);
    }

    #[test]
    fn any_two_lengths_have_a_fraction() {
        for pixel in [0.001, 0.012_345_678, std::f64::consts::PI / 100.0, 1.0 / 3.0, 1000.0, 1e-5] {
            for cell in [0.01, 0.1, 0.123_456_789, 1.0] {
                let ratio = Ratio::of(pixel, cell);
                let found = ratio.cells as f64 / ratio.pixels as f64;
                assert!((found * cell / pixel - 1.0).abs() <= 2.0 * HAIR, "{pixel} in {cell}: {ratio:?}");
            }
        }
    }

    #[test]
    fn pixels_are_counted() {
        let third = Ratio { cells: 3, pixels: 10 };
        assert_eq!((0..8).map(|pixel| third.cell_of(pixel)).collect::<Vec<_>>(), [0, 0, 0, 1, 1, 1, 1, 2]);
        assert_eq!([0, 1, 3, 4, 10, 11].map(|pixels| third.cells(pixels)), [0, 1, 1, 2, 3, 4]);
        assert_eq!((third.pixels_in_a_cell(), Ratio { cells: 2, pixels: 1 }.pixels_in_a_cell()), (3, 1));
    }
}
