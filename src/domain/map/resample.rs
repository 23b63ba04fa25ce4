//! Pixels into cells of another size, by position.

use super::error::MapImportError;
use super::observed::Observed;
use super::picture::Pixel;
use super::ratio::Ratio;
use super::samples::MOST_CELLS;
use super::separation::{Count, Spans, separate};
use crate::domain::geometry::{Cell, Frame, Grid};

/// Computes what cells of `resolution` meters show of an image of smaller, equal or larger pixels.
///
/// Both grids share the lower left corner. A cell is blocked if any occupied pixel falls into it and free if at least
/// half of its pixels are free; what is neither is unknown. A pixel falls into the cell that holds its center, since
/// widths such as 0.03 m do not divide 0.1 m. Lines of unknown pixels too thin to fill half a cell still [separate] what
/// lies at their sides. Where pixels are *larger* than cells, the overlap of their areas decides instead: any overlap with
/// an occupied pixel blocks, and at least half of the cell's area within the image must be free.
///
/// # Errors
/// [`MapImportError::TooManyPixels`] if the grid would have more than [`MOST_CELLS`] cells.
pub fn resample(
    pixels: &Grid<Pixel>,
    frame: &Frame,
    resolution: f64,
) -> Result<(Grid<Observed>, Frame), MapImportError> {
    let ratio = Ratio::of(frame.resolution, resolution);
    let (rows, cols) = (ratio.cells(pixels.rows()), ratio.cells(pixels.cols()));
    if rows.saturating_mul(cols) > MOST_CELLS {
        return Err(MapImportError::TooManyPixels { width: cols, height: rows, most: MOST_CELLS });
    }
    let target = Frame { resolution, rows: rows as usize, cols: cols as usize, ..*frame };
    let cells =
        if ratio.cells <= ratio.pixels { by_center(pixels, ratio, &target) } else { by_area(pixels, ratio, &target) };
    Ok((cells, target))
}

/// Spreads free and blocked cells over `resolution` meters, which must not be larger than their own.
#[must_use]
pub fn refined(free: &Grid<bool>, frame: &Frame, resolution: f64) -> (Grid<bool>, Frame) {
    let pixels = free.map(|free| if *free { Pixel::Free } else { Pixel::Occupied });
    let (cells, frame) =
        resample(&pixels, frame, resolution).expect("a drawing refined to 0.02 m is far below the limit");
    (cells.map(|cell| *cell == Observed::Free), frame)
}

/// Sorts small pixels into cells by their centers.
fn by_center(pixels: &Grid<Pixel>, ratio: Ratio, target: &Frame) -> Grid<Observed> {
    let index = |pixel: usize, cells: usize| ratio.cell_of(pixel).min(cells - 1);
    let cols: Vec<usize> = (0..pixels.cols()).map(|col| index(col, target.cols)).collect();
    // Rows count from the top, positions from the bottom.
    let above = |row: usize| target.rows - 1 - index(pixels.rows() - 1 - row, target.rows);
    let rows: Vec<usize> = (0..pixels.rows()).map(above).collect();
    let mut counts = Grid::filled(target.rows, target.cols, Count::default());
    for (row, cell_row) in rows.iter().enumerate() {
        for (pixel, col) in pixels.row(row).iter().zip(&cols) {
            let count = &mut counts[Cell::new(*cell_row, *col)];
            count.all += 1;
            count.free += u32::from(*pixel == Pixel::Free);
            count.occupied |= *pixel == Pixel::Occupied;
        }
    }
    let spans = Spans { rows: spans(&rows, target.rows), cols: spans(&cols, target.cols) };
    separate(pixels, &counts, &spans, ratio.pixels_in_a_cell())
}

/// From which pixel to which each cell reaches along one axis; the end is excluded.
fn spans(cell_of: &[usize], cells: usize) -> Vec<(usize, usize)> {
    let mut spans = vec![(0, 0); cells];
    for (pixel, cell) in cell_of.iter().enumerate() {
        let first = if spans[*cell].1 == 0 { pixel } else { spans[*cell].0 };
        spans[*cell] = (first, pixel + 1);
    }
    spans
}

/// Weighs large pixels by the area that they share with a cell, in parts of which `ratio.cells` make an edge of a pixel.
fn by_area(pixels: &Grid<Pixel>, ratio: Ratio, target: &Frame) -> Grid<Observed> {
    // Each cell's pixels along one axis, counted from the bottom or left, with the length of the cell that each covers.
    let lengths = |cell: usize, count: usize| -> Vec<(usize, u64)> {
        let (low, high) = (cell as u64 * ratio.pixels, (cell as u64 + 1) * ratio.pixels);
        (low / ratio.cells..=(high - 1) / ratio.cells)
            .filter(|pixel| *pixel < count as u64)
            .map(|pixel| (pixel as usize, high.min((pixel + 1) * ratio.cells) - low.max(pixel * ratio.cells)))
            .collect()
    };
    let cols: Vec<_> = (0..target.cols).map(|col| lengths(col, pixels.cols())).collect();
    let above = |(row, length): (usize, u64)| (pixels.rows() - 1 - row, length);
    let rows: Vec<Vec<_>> = (0..target.rows)
        .map(|row| lengths(target.rows - 1 - row, pixels.rows()).into_iter().rev().map(above).collect())
        .collect();
    let counts = Grid::from_fn(target.rows, target.cols, |cell| {
        let mut count = Count::default();
        for (row, height) in &rows[cell.row] {
            for (col, width) in &cols[cell.col] {
                let (pixel, area) = (pixels[Cell::new(*row, *col)], (height * width) as u32);
                count.all += area;
                count.free += if pixel == Pixel::Free { area } else { 0 };
                count.occupied |= pixel == Pixel::Occupied;
            }
        }
        count
    });
    let span = |lengths: &Vec<(usize, u64)>| lengths.first().map_or((0, 0), |first| (first.0, first.0 + lengths.len()));
    separate(
        pixels,
        &counts,
        &Spans { rows: rows.iter().map(span).collect(), cols: cols.iter().map(span).collect() },
        0,
    )
}

#[cfg(test)]
mod tests {
    use super::super::regions::regions;
    use super::*;

    fn pixels(rows: &[&str]) -> Grid<Pixel> {
        Grid::from_fn(rows.len(), rows[0].len(), |c| match rows[c.row].as_bytes()[c.col] {
            b'.' => Pixel::Free,
            b'#' => Pixel::Occupied,
            _ => Pixel::Unknown,
        })
    }

    fn drawn(cells: &Grid<Observed>) -> Vec<String> {
        (0..cells.rows())
            .map(|row| cells.row(row).iter().map(|cell| ['#', '.', '?'][*cell as usize]).collect())
            .collect()
    }

    fn check(from: f64, to: f64, source: &[&str], expected: &[&str]) {
        let source = pixels(source);
        let frame = Frame::at_zero(from, source.rows(), source.cols());
        let (cells, target) = resample(&source, &frame, to).expect("a small grid");
        assert_eq!(drawn(&cells), expected, "{from} to {to}");
        assert_eq!((target.rows, target.cols, target.resolution), (cells.rows(), cells.cols(), to));
    }

    #[test]
    fn one_occupied_pixel_blocks_and_half_free_ones_free() {
        check(0.05, 0.1, &["..?.", "..??", "#.??", "..??"], &[".?", "#?"]);
        check(0.05, 0.1, &["...?", "...?", "...?", "..??"], &["..", ".?"]);
        check(0.1, 0.1, &[".?#", "..."], &[".?#", "..."]);
    }

    #[test]
    fn a_cell_without_pixels_is_unknown() {
        // Seven pixels of 0.03 m reach to 0.21 m, but no center lies beyond 0.2 m.
        check(0.03, 0.1, &["......."], &["..?"]);
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
        check(0.2, 0.1, &[".#", "?."], &["..##", "..##", "??..", "??.."]);
        // The middle cell of 0.1 m lies half in each pixel of 0.15 m.
        check(0.15, 0.1, &[".?"], &["..?", "..?"]);
        check(0.15, 0.1, &[".#"], &[".##", ".##"]);
    }

    #[test]
    fn an_unknown_line_separates_at_every_ratio() {
        for (from, to) in [
            (0.05, 0.1),
            (0.03, 0.1),
            (0.025, 0.1),
            (0.02, 0.1),
            (0.01, 0.1),
            (0.07, 0.1),
            (0.09, 0.1),
            (0.1, 0.1),
            (0.11, 0.1),
            (0.15, 0.1),
            (0.2, 0.1),
        ] {
            for width in [1, 2] {
                for offset in 0..12 {
                    for lean in [0, 1, 2] {
                        // A line that stands upright, leans by half or goes along the diagonal.
                        let start = |c: Cell| 30 + offset + c.row * lean / 2;
                        let pixels = Grid::from_fn(40, 100, |c| {
                            if (start(c)..start(c) + width).contains(&c.col) { Pixel::Unknown } else { Pixel::Free }
                        });
                        let free_of = |pixels: &Grid<Pixel>| {
                            let (cells, _) =
                                resample(pixels, &Frame::at_zero(from, 40, 100), to).expect("a small grid");
                            cells.map(|cell| *cell == Observed::Free)
                        };
                        let free = free_of(&pixels);
                        let (_, sizes) = regions(&free);
                        let large = sizes.iter().filter(|size| 10 * **size > free.len()).count();
                        assert_eq!(large, 2, "{width} of {from} in {to}, offset {offset}, lean {lean}: {sizes:?}");
                        // The line costs what a painted one would, at most.
                        let painted = pixels.map(|pixel| if *pixel == Pixel::Free { *pixel } else { Pixel::Occupied });
                        let solid = free_of(&painted);
                        assert!(solid.cells().all(|cell| free[cell] || !solid[cell]), "{width} of {from} in {to}");
                    }
                }
            }
        }
    }
}
