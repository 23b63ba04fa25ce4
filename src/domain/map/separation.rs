//! Lines too thin to fill half a cell: an unknown line is a wall.
//!
//! A cell is free if at least half of its pixels are, so a line of one pixel would vanish and join the rooms at its sides.
//! Therefore two neighboring cells may only both be free if one gets from one to the other over free pixels, without a
//! detour through a third cell. Where that is not so, the cell with the smaller share of free pixels is blocked, which is
//! one that the line crosses. Unknown spots that fit into a cell are noise and no lines: they are stepped over.
//!
//! What follows: two regions of free pixels that nothing but spots could hold together stay apart at any resolution, cells
//! whose pixels are all free stay free, and so do openings between them.

use std::collections::BTreeMap;

use super::observed::Observed;
use super::picture::Pixel;
use crate::domain::geometry::{Cell, Grid};

/// What falls into a cell: numbers of pixels, or areas of them.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Count {
    pub all: u32,
    pub free: u32,
    pub occupied: bool,
}

impl Count {
    const fn is_free(self) -> bool {
        !self.occupied && self.all > 0 && 2 * self.free as u64 >= self.all as u64
    }
}

/// From which row and column of pixels to which the rows and columns of cells reach; ends are excluded.
#[derive(Debug)]
pub(super) struct Spans {
    pub rows: Vec<(usize, usize)>,
    pub cols: Vec<(usize, usize)>,
}

/// Returns what the cells show, from what falls into each. A spot of `spot` × `spot` pixels fits into a cell.
///
/// What is neither free nor holds an occupied pixel is unknown, a line that separates too.
pub(super) fn separate(pixels: &Grid<Pixel>, counts: &Grid<Count>, spans: &Spans, spot: usize) -> Grid<Observed> {
    let mut free = counts.map(|count| count.is_free());
    let fine = Fine { pixels, spans, spot };
    // The floor of each cell that has other pixels than free ones.
    let mut floors = BTreeMap::new();
    for cell in counts.cells() {
        if free[cell] && counts[cell].free < counts[cell].all {
            floors.insert(counts.index_of(cell), fine.floor(cell));
        }
    }
    let share = |cell: Cell| f64::from(counts[cell].free) / f64::from(counts[cell].all);
    for cell in counts.cells() {
        for next in [Cell::new(cell.row, cell.col + 1), Cell::new(cell.row + 1, cell.col)] {
            if next.row >= counts.rows() || next.col >= counts.cols() || !free[cell] || !free[next] {
                continue;
            }
            let floor = |cell| floors.get(&counts.index_of(cell));
            if !fine.joined(cell, floor(cell), next, floor(next)) {
                free[if share(cell) < share(next) { cell } else { next }] = false;
            }
        }
    }
    Grid::from_fn(counts.rows(), counts.cols(), |cell| match (free[cell], counts[cell].occupied) {
        (true, _) => Observed::Free,
        (false, true) => Observed::Occupied,
        (false, false) => Observed::Unknown,
    })
}

/// The pixels and where the cells lie in them.
struct Fine<'a> {
    pixels: &'a Grid<Pixel>,
    spans: &'a Spans,
    spot: usize,
}

impl Fine<'_> {
    /// Returns the largest piece of floor within a cell, four-connected: `true` where one may stand.
    fn floor(&self, cell: Cell) -> Grid<bool> {
        let ((top, bottom), (left, right)) = (self.spans.rows[cell.row], self.spans.cols[cell.col]);
        let open = self.open(cell);
        let mut pieces = Grid::filled(bottom - top, right - left, 0usize);
        let (mut count, mut largest) = (0, (0, 0));
        for start in open.cells() {
            if !open[start] || pieces[start] != 0 {
                continue;
            }
            count += 1;
            let size = spread(start, 1, &mut |row, col| {
                let inside = open.get(row, col) == Some(&true);
                let fresh = inside && pieces[Cell::new(row as usize, col as usize)] == 0;
                if fresh {
                    pieces[Cell::new(row as usize, col as usize)] = count;
                }
                fresh
            });
            if size.pixels > largest.0 {
                largest = (size.pixels, count);
            }
        }
        pieces.map(|piece| *piece == largest.1)
    }

    /// Returns where one may stand within a cell: on free pixels and on spots.
    fn open(&self, cell: Cell) -> Grid<bool> {
        let ((top, bottom), (left, right)) = (self.spans.rows[cell.row], self.spans.cols[cell.col]);
        // A spot that reaches into the cell ends before the edge of this window.
        let (low_row, low_col) = (top.saturating_sub(self.spot), left.saturating_sub(self.spot));
        let high_row = (bottom + self.spot).min(self.pixels.rows());
        let high_col = (right + self.spot).min(self.pixels.cols());
        let mut open = Grid::from_fn(high_row - low_row, high_col - low_col, |at| {
            self.pixels[Cell::new(low_row + at.row, low_col + at.col)] == Pixel::Free
        });
        let mut seen = open.clone();
        for row in top - low_row..bottom - low_row {
            for col in left - low_col..right - low_col {
                if seen[Cell::new(row, col)] {
                    continue;
                }
                let mut members = Vec::new();
                let extent = spread(Cell::new(row, col), 2, &mut |row, col| {
                    let fresh = seen.get(row, col) == Some(&false);
                    if fresh {
                        let member = Cell::new(row as usize, col as usize);
                        seen[member] = true;
                        members.push(member);
                    }
                    fresh
                });
                let image_edge = low_row + extent.top == 0
                    || low_col + extent.left == 0
                    || low_row + extent.bottom + 1 == self.pixels.rows()
                    || low_col + extent.right + 1 == self.pixels.cols();
                let fits = extent.bottom - extent.top < self.spot && extent.right - extent.left < self.spot;
                if fits && !image_edge {
                    members.iter().for_each(|member| open[*member] = true);
                }
            }
        }
        Grid::from_fn(bottom - top, right - left, |at| open[Cell::new(at.row + top - low_row, at.col + left - low_col)])
    }

    /// Tells whether the floors of two neighboring cells touch; `None` is a cell that is floor everywhere.
    ///
    /// Where pixels are larger than cells, the two may share a pixel at their border: the floors of both must hold it.
    fn joined(&self, a: Cell, a_floor: Option<&Grid<bool>>, b: Cell, b_floor: Option<&Grid<bool>>) -> bool {
        let on =
            |floor: Option<&Grid<bool>>, row: usize, col: usize| floor.is_none_or(|floor| floor[Cell::new(row, col)]);
        let ((top, bottom), (left, right)) = (self.spans.rows[a.row], self.spans.cols[a.col]);
        if a.row == b.row {
            (0..bottom - top).any(|row| on(a_floor, row, right - left - 1) && on(b_floor, row, 0))
        } else {
            (0..right - left).any(|col| on(a_floor, bottom - top - 1, col) && on(b_floor, 0, col))
        }
    }
}

/// How far something reaches.
struct Extent {
    pixels: usize,
    top: usize,
    bottom: usize,
    left: usize,
    right: usize,
}

/// Visits all that hangs together with `start`: over edges if `steps` is 1, over corners too if it is 2.
///
/// `take` tells whether a place, which may lie outside, belongs to it and was not taken before.
fn spread(start: Cell, steps: isize, take: &mut impl FnMut(isize, isize) -> bool) -> Extent {
    let mut extent = Extent { pixels: 0, top: start.row, bottom: start.row, left: start.col, right: start.col };
    take(start.row as isize, start.col as isize);
    let mut rest = vec![start];
    while let Some(cell) = rest.pop() {
        extent.pixels += 1;
        extent.top = extent.top.min(cell.row);
        extent.bottom = extent.bottom.max(cell.row);
        extent.left = extent.left.min(cell.col);
        extent.right = extent.right.max(cell.col);
        for (down, right) in (-1..=1).flat_map(|down: isize| (-1..=1).map(move |right: isize| (down, right))) {
            let (row, col) = (cell.row as isize + down, cell.col as isize + right);
            if (1..=steps).contains(&(down.abs() + right.abs())) && take(row, col) {
                rest.push(Cell::new(row as usize, col as usize));
            }
        }
    }
    extent
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::super::regions::regions;
    use super::super::resample::resample;
    use super::*;
    use crate::domain::geometry::Frame;

    fn pixels(rows: &[&str]) -> Grid<Pixel> {
        Grid::from_fn(rows.len(), rows[0].len(), |c| match rows[c.row].as_bytes()[c.col] {
            b'.' => Pixel::Free,
            b'#' => Pixel::Occupied,
            _ => Pixel::Unknown,
        })
    }

    fn resampled(pixels: &Grid<Pixel>, from: f64) -> Grid<bool> {
        let frame = Frame::at_zero(from, pixels.rows(), pixels.cols());
        let (cells, _) = resample(pixels, &frame, 0.1).expect("a small grid");
        cells.map(|cell| *cell == Observed::Free)
    }

    fn check(from: f64, source: &[&str], expected: &[&str]) {
        let source = pixels(source);
        let free = resampled(&source, from);
        let drawn: Vec<String> =
            (0..free.rows()).map(|row| free.row(row).iter().map(|f| if *f { '.' } else { '#' }).collect()).collect();
        assert_eq!(drawn, expected);
    }

    #[test]
    fn a_line_blocks_the_cells_that_it_crosses() {
        check(0.05, &["....?...", "....?..."], &["..#."]);
        check(0.05, &["...?....", "...?...."], &[".#.."]);
        check(0.05, &["...??...", "...??..."], &["..#."]);
        check(0.025, &["......?.....", "......?.....", "......?.....", "......?....."], &[".#."]);
    }

    #[test]
    fn an_opening_in_a_line_stays_open() {
        // The line ends; the cell of its end is passed beside it.
        check(
            0.025,
            &[
                "......?.....",
                "......?.....",
                "............",
                "............",
                "............",
                "............",
                "............",
                "............",
            ],
            &["...", "..."],
        );
        check(
            0.05,
            &["....?...", "....?...", "........", "........", "....?...", "....?..."],
            &["..#.", "....", "..#."],
        );
    }

    #[test]
    fn a_spot_is_no_line() {
        check(0.05, &["........", "...?....", "....?...", "........"], &["....", "...."]);
        check(0.05, &["........", "...??...", "...??...", "........"], &["....", "...."]);
        // One pixel more and it is one.
        check(0.05, &["..?.....", "...?....", "....?...", "........"], &[".#..", "...."]);
    }

    /// Free pixels with unknown and occupied lines and specks, some of them crossing.
    fn scenes() -> impl Strategy<Value = Grid<Pixel>> {
        let stroke = ((0i32..60, 0i32..60), (-3i32..=3, -3i32..=3), 1i32..50, 1i32..3, prop::bool::weighted(0.8));
        let specks = prop::collection::vec((0usize..60, 0usize..60), 0..30);
        (prop::collection::vec(stroke, 0..9), specks).prop_map(|(strokes, specks)| {
            let mut scene = Grid::filled(60, 60, Pixel::Free);
            let mut paint = |row: i32, col: i32, pixel| {
                if (0..60).contains(&row) && (0..60).contains(&col) {
                    scene[Cell::new(row as usize, col as usize)] = pixel;
                }
            };
            for ((row, col), (down, right), length, width, unknown) in strokes {
                let pixel = if unknown { Pixel::Unknown } else { Pixel::Occupied };
                for step in 0..3 * length {
                    let (row, col) = (row + step * down / 3, col + step * right / 3);
                    (0..width * width).for_each(|at| paint(row + at / width, col + at % width, pixel));
                }
            }
            for (row, col) in specks {
                paint(row as i32, col as i32, Pixel::Unknown);
            }
            scene
        })
    }

    /// Tells which cell a pixel falls into, by its center in meters.
    fn cell_of(pixel: Cell, rows: usize, from: f64, free: &Grid<bool>) -> Cell {
        let at = |pixel: usize| ((pixel as f64 + 0.5) * from / 0.1 + 1e-9) as usize;
        Cell::new(free.rows() - 1 - at(rows - 1 - pixel.row), at(pixel.col))
    }

    proptest! {
        #[test]
        fn regions_larger_than_spots_are_never_joined(
            scene in scenes(),
            from in prop::sample::select(vec![0.05, 0.03, 0.025, 0.02, 0.01, 0.07]),
        ) {
            let free = resampled(&scene, from);
            let (coarse, _) = regions(&free);
            let (fine, sizes) = regions(&scene.map(|pixel| *pixel == Pixel::Free));
            // Cells all of whose pixels are free belong to one region; which of them lie together in the result?
            let mut kinds: BTreeMap<(usize, usize), Vec<(Pixel, u32)>> = BTreeMap::new();
            for pixel in scene.cells() {
                let cell = cell_of(pixel, 60, from, &free);
                kinds.entry((cell.row, cell.col)).or_default().push((scene[pixel], fine[pixel]));
            }
            let mut owner: BTreeMap<u32, u32> = BTreeMap::new();
            for ((row, col), inside) in &kinds {
                if inside.iter().all(|(pixel, _)| *pixel == Pixel::Free) {
                    let cell = Cell::new(*row, *col);
                    prop_assert!(free[cell], "{cell:?} is free all over, and not in the result");
                    let region = inside[0].1;
                    let first = owner.entry(coarse[cell]).or_insert(region);
                    prop_assert_eq!(*first, region, "sizes {} and {}", sizes[*first as usize - 1], sizes[region as usize - 1]);
                }
                if inside.iter().any(|(pixel, _)| *pixel == Pixel::Occupied) {
                    prop_assert!(!free[Cell::new(*row, *col)], "an occupied pixel blocks");
                }
            }
        }

        #[test]
        fn specks_alone_change_nothing(
            specks in prop::collection::btree_set((0usize..20, 0usize..20), 0..60),
            from in prop::sample::select(vec![0.05, 0.025, 0.02]),
        ) {
            // Specks that do not touch each other: every third pixel at most, and none at the border.
            let unknown = |c: Cell| c.row % 3 == 1 && c.col % 3 == 1 && specks.contains(&(c.row / 3, c.col / 3));
            let scene = Grid::from_fn(60, 60, |c| if unknown(c) { Pixel::Unknown } else { Pixel::Free });
            let free = resampled(&scene, from);
            prop_assert!(free.as_slice().iter().all(|free| *free));
        }
    }
}
