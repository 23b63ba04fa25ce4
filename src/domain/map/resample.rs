//! Pixels into cells of another size, by position; the largest region of them; cropped.

use super::picture::{MOST_PIXELS, Pixel};
use super::{MapError, MapImportError, OccupancyMap, regions};
use crate::domain::geometry::{Cell, Frame, Grid, Point};

/// Lengths closer than this share of a pixel are taken as equal.
const HAIR: f64 = 1e-6;

/// Computes the free cells of `resolution` meters from an image of smaller, equal or larger pixels.
///
/// Both grids share the lower left corner. A cell is blocked if any occupied pixel falls into it and free if at least
/// half of its pixels are free; unknown pixels are not free. A pixel falls into the cell that holds its center, since
/// widths such as 0.03 m do not divide 0.1 m. Where pixels are *larger* than cells, the overlap of their areas decides
/// instead: any overlap with an occupied pixel blocks, and at least half of the cell's area within the image must be free.
///
/// # Errors
/// [`MapImportError::TooManyPixels`] if the grid would have more than [`MOST_PIXELS`] cells.
pub(super) fn resample(
    pixels: &Grid<Pixel>,
    frame: &Frame,
    resolution: f64,
) -> Result<(Grid<bool>, Frame), MapImportError> {
    let ratio = frame.resolution / resolution;
    let cells = |pixels: usize| (pixels as f64 * ratio - HAIR).ceil().max(1.0);
    let (rows, cols) = (cells(pixels.rows()), cells(pixels.cols()));
    if rows * cols > MOST_PIXELS as f64 {
        return Err(MapImportError::TooManyPixels { width: cols as u64, height: rows as u64 });
    }
    let target = Frame { resolution, rows: rows as usize, cols: cols as usize, ..*frame };
    let free = if ratio <= 1.0 { by_center(pixels, ratio, &target) } else { by_area(pixels, ratio, &target) };
    Ok((free, target))
}

/// Spreads free and blocked cells over `resolution` meters, which must not be larger than their own.
#[must_use]
pub fn refined(free: &Grid<bool>, frame: &Frame, resolution: f64) -> (Grid<bool>, Frame) {
    let pixels = free.map(|free| if *free { Pixel::Free } else { Pixel::Occupied });
    resample(&pixels, frame, resolution).expect("a drawing refined to 0.02 m is far below the limit")
}

/// Sorts small pixels into cells by their centers.
fn by_center(pixels: &Grid<Pixel>, ratio: f64, target: &Frame) -> Grid<bool> {
    #[derive(Clone, Copy, Default)]
    struct Count {
        pixels: u32,
        free: u32,
        occupied: bool,
    }
    let index = |pixel: usize, cells: usize| (((pixel as f64 + 0.5) * ratio) as usize).min(cells - 1);
    let cols: Vec<usize> = (0..pixels.cols()).map(|col| index(col, target.cols)).collect();
    let mut counts = Grid::filled(target.rows, target.cols, Count::default());
    for row in 0..pixels.rows() {
        // Rows count from the top, positions from the bottom.
        let cell_row = target.rows - 1 - index(pixels.rows() - 1 - row, target.rows);
        for (pixel, col) in pixels.row(row).iter().zip(&cols) {
            let count = &mut counts[Cell::new(cell_row, *col)];
            count.pixels += 1;
            count.free += u32::from(*pixel == Pixel::Free);
            count.occupied |= *pixel == Pixel::Occupied;
        }
    }
    counts.map(|count| !count.occupied && count.pixels > 0 && 2 * count.free >= count.pixels)
}

/// Weighs large pixels by the area that they share with a cell.
fn by_area(pixels: &Grid<Pixel>, ratio: f64, target: &Frame) -> Grid<bool> {
    // Each cell's pixels along one axis, counted from the bottom or left, with the share of the cell that each covers.
    let shares = |cell: usize, count: usize| -> Vec<(usize, f64)> {
        let (low, high) = (cell as f64 / ratio, (cell + 1) as f64 / ratio);
        let (first, last) = ((low + HAIR) as usize, (high - HAIR) as usize);
        (first..=last)
            .filter(|pixel| *pixel < count)
            .map(|pixel| (pixel, (high.min((pixel + 1) as f64) - low.max(pixel as f64)) * ratio))
            .collect()
    };
    let cols: Vec<_> = (0..target.cols).map(|col| shares(col, pixels.cols())).collect();
    let rows: Vec<_> = (0..target.rows).map(|row| shares(target.rows - 1 - row, pixels.rows())).collect();
    Grid::from_fn(target.rows, target.cols, |cell| {
        let (mut free, mut covered) = (0.0, 0.0);
        for (row, height) in &rows[cell.row] {
            for (col, width) in &cols[cell.col] {
                covered += height * width;
                match pixels[Cell::new(pixels.rows() - 1 - row, *col)] {
                    Pixel::Occupied => return false,
                    Pixel::Free => free += height * width,
                    Pixel::Unknown => {}
                }
            }
        }
        covered > 0.0 && free >= (0.5 - HAIR) * covered
    })
}

/// Keeps the largest four-connected region of free cells, cut out with a margin of one blocked cell on each side.
///
/// The first in row-major order wins a tie. The origin moves with the cut, so no cell changes its place in the world.
///
/// # Errors
/// [`MapError::NoFreeSpace`] if no cell is free.
pub(super) fn largest_region(free: &Grid<bool>, frame: &Frame) -> Result<OccupancyMap, MapError> {
    let (labels, sizes) = regions(free);
    let most = sizes.iter().copied().max().ok_or(MapError::NoFreeSpace)?;
    let label = 1 + sizes.iter().position(|size| *size == most).expect("the maximum is one of the sizes") as u32;
    let (mut top, mut bottom, mut left, mut right) = (usize::MAX, 0, usize::MAX, 0);
    for cell in labels.cells().filter(|cell| labels[*cell] == label) {
        (top, bottom) = (top.min(cell.row), bottom.max(cell.row));
        (left, right) = (left.min(cell.col), right.max(cell.col));
    }
    let cut = Grid::from_fn(bottom - top + 3, right - left + 3, |cell| {
        let (row, col) = ((top + cell.row) as isize - 1, (left + cell.col) as isize - 1);
        labels.get(row, col) == Some(&label)
    });
    let corner = Point::new(
        (left as f64 - 1.0) * frame.resolution,
        (frame.rows as f64 - 2.0 - bottom as f64) * frame.resolution,
    );
    let frame = Frame { origin: frame.to_map(corner), rows: cut.rows(), cols: cut.cols(), ..*frame };
    OccupancyMap::new(cut, frame)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn pixels(rows: &[&str]) -> Grid<Pixel> {
        Grid::from_fn(rows.len(), rows[0].len(), |c| match rows[c.row].as_bytes()[c.col] {
            b'.' => Pixel::Free,
            b'#' => Pixel::Occupied,
            _ => Pixel::Unknown,
        })
    }

    fn drawn(free: &Grid<bool>) -> Vec<String> {
        (0..free.rows()).map(|row| free.row(row).iter().map(|f| if *f { '.' } else { '#' }).collect()).collect()
    }

    fn check(from: f64, to: f64, source: &[&str], expected: &[&str]) {
        let source = pixels(source);
        let frame = Frame::at_zero(from, source.rows(), source.cols());
        let (free, target) = resample(&source, &frame, to).expect("a small grid");
        assert_eq!(drawn(&free), expected, "{from} to {to}");
        assert_eq!((target.rows, target.cols, target.resolution), (free.rows(), free.cols(), to));
    }

    #[test]
    fn one_occupied_pixel_blocks_and_half_free_ones_free() {
        check(0.05, 0.1, &["..?.", "..??", "#.??", "..??"], &[".#", "##"]);
        check(0.05, 0.1, &["..?.", "..?.", "...?", "..??"], &["..", ".#"]);
        check(0.1, 0.1, &[".?#", "..."], &[".##", "..."]);
    }

    #[test]
    fn pixels_fall_where_their_centers_lie() {
        // Ten pixels of 0.03 m: centers below 0.1 m are those of 0, 1 and 2, below 0.2 m of 3, 4, 5 and 6.
        check(0.03, 0.1, &["...#......"], &[".#."]);
        check(0.03, 0.1, &["......#..."], &[".#."]);
        check(0.03, 0.1, &[".......#.."], &["..#"]);
        check(0.02, 0.1, &["....#....."], &["#."]);
        check(0.025, 0.1, &["....#..."], &[".#"]);
    }

    #[test]
    fn rows_are_counted_from_the_bottom() {
        // Three rows of 0.05 m: the lower two share a cell, the upper one has its own.
        check(0.05, 0.1, &["##", "..", ".."], &["#", "."]);
    }

    #[test]
    fn a_coarse_source_is_spread_over_finer_cells() {
        check(0.2, 0.1, &[".#", "?."], &["..##", "..##", "##..", "##.."]);
        // The middle cell of 0.1 m lies half in each pixel of 0.15 m.
        check(0.15, 0.1, &[".?"], &["..#", "..#"]);
        check(0.15, 0.1, &[".#"], &[".##", ".##"]);
    }

    #[test]
    fn the_largest_region_keeps_its_place_in_the_world() {
        let free = Grid::from_fn(4, 7, |c| matches!((c.row, c.col), (0, 0) | (1..=2, 3..=5)));
        for yaw in [0.0, 0.7] {
            let frame = Frame { origin: Point::new(-3.0, 8.0), yaw, ..Frame::at_zero(0.1, 4, 7) };
            let map = largest_region(&free, &frame).expect("free cells");
            assert_eq!(drawn(map.free()), ["#####", "#...#", "#...#", "#####"]);
            let before = frame.to_map(frame.center(Cell::new(1, 3)));
            let after = map.frame().to_map(map.frame().center(Cell::new(1, 1)));
            assert!(before.distance(after) < 1e-12, "{before:?} {after:?}");
        }
        let error = largest_region(&Grid::filled(2, 2, false), &Frame::at_zero(0.1, 2, 2));
        assert_eq!(error, Err(MapError::NoFreeSpace));
    }
}
