//! Windows of maps and labels: cut, turned and mirrored, stitched back (sections IV-A and IV-C of the paper).

mod target;
mod transform;

use std::collections::BTreeMap;
use std::ops::Range;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::geometry::{Cell, Grid};
use super::map::{OccupancyMap, Shown};
use super::planes::{self, Plane};
use super::quantize::OBSTACLE;

pub use target::{Known, NO_RANK, Ranks, Target};
pub use transform::Transform;

/// Parameters of cutting maps into windows.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct TileConfig {
    /// Edge of a window in cells, a multiple of 8 from 8 to 512 (the network halves it three times).
    #[schemars(range(min = 8, max = 512), extend("multipleOf" = 8))]
    pub size: u32,
    /// Distance between neighboring windows in cells, from 1 to `size`.
    #[schemars(range(min = 1, max = 512))]
    pub stride: u32,
    /// Windows with fewer labeled cells than this are dropped, 1 to `size`²; 256 is a sixteenth of a window of 64 cells.
    #[schemars(range(min = 1, max = 262_144))]
    pub min_labeled: u32,
    /// What a network is shown of each cell besides whether it is free: `unknown`, whether nobody has looked; `paths`, the
    /// share of the map's free cells that fewer shortest paths lead over; `ways`, the same of ways from room to room that
    /// people like, who keep off walls and differ.
    pub besides: Vec<Plane>,
    /// What a network is shown of a map: the `map` itself, or what is `observed` of it, as a scan with its noise, its gaps
    /// and its unknown space; what is learned is known of the map either way.
    pub shown: Shown,
}

impl Default for TileConfig {
    fn default() -> Self {
        Self { size: 64, stride: 8, min_labeled: 256, besides: Vec::new(), shown: Shown::Map }
    }
}

/// What keeps maps from becoming windows, or windows from becoming maps.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[expect(missing_docs, reason = "the messages say what the variants and their fields are")]
pub enum TileError {
    #[error("`size` is `{0}`, allowed are multiples of 8 from 8 to 512")]
    Size(u32),
    #[error("`stride` is `{stride}`, allowed are 1 to the window's {size}")]
    Stride { stride: u32, size: u32 },
    #[error("`min_labeled` is `{min_labeled}`, allowed are 1 to the window's {cells} cells")]
    MinLabeled { min_labeled: u32, cells: u32 },
    #[error("of `besides` {0}, allowed is each plane once")]
    Besides(String),
    #[error("the labels of map `{map}` have {rows} × {cols} cells, the map {map_rows} × {map_cols}")]
    SizeMismatch { map: String, rows: usize, cols: usize, map_rows: usize, map_cols: usize },
    #[error("the labels of map `{map}` have {found} classes, those of the maps before it {classes}")]
    ClassMismatch { map: String, found: u8, classes: u8 },
    #[error("of map `{0}` something else is known than of the maps before it")]
    KnownMismatch(String),
    #[error("nothing of map `{0}` is seen to be free")]
    NothingSeen(String),
    #[error("no window has `min_labeled` = {0} labeled cells")]
    NoWindow(u32),
    #[error("the windows of map `{map}` contradict each other at row {row}, column {col}")]
    Contradiction { map: String, row: usize, col: usize },
}

impl TileConfig {
    /// Checks that every parameter is in its range.
    ///
    /// # Errors
    /// [`TileError`] names the parameter and what is allowed.
    pub fn check(&self) -> Result<(), TileError> {
        let &Self { size, stride, min_labeled, .. } = self;
        if !(8..=512).contains(&size) || !size.is_multiple_of(8) {
            return Err(TileError::Size(size));
        }
        if !(1..=size).contains(&stride) {
            return Err(TileError::Stride { stride, size });
        }
        if !(1..=size * size).contains(&min_labeled) {
            return Err(TileError::MinLabeled { min_labeled, cells: size * size });
        }
        planes::sorted(self.besides.clone()).map(drop).map_err(TileError::Besides)
    }
}

/// A map to be cut, with what is to be learned of it.
#[derive(Debug, Clone, Copy)]
pub struct LabeledMap<'a> {
    /// Name of the map.
    pub name: &'a str,
    /// Its free cells.
    pub map: &'a OccupancyMap,
    /// What is known of its cells.
    pub known: Known<'a>,
}

/// Square windows of some maps; every window is stored once, as it lies on its map.
#[derive(Debug, Clone, PartialEq)]
pub struct Tiles {
    /// Edge of a window in cells.
    pub size: usize,
    /// Names of the maps.
    pub maps: Vec<String>,
    /// For each window the index of its map and the row and column of its top left cell, which may be negative.
    pub origin: Vec<(u32, i32, i32)>,
    /// 1 for free and 0 for blocked cells; shape [windows, size, size].
    pub occupancy: Vec<u8>,
    /// Codes of the planes that a network is shown besides, each of the shape of the occupancy.
    pub besides: BTreeMap<Plane, Vec<u8>>,
    /// What is to be learned of the cells; shape [windows, size, size].
    pub target: Target,
    /// For each window the share of its cells that are labeled.
    pub labeled_share: Vec<f32>,
}

impl Tiles {
    /// Returns the number of stored windows.
    #[must_use]
    pub const fn len(&self) -> usize {
        self.origin.len()
    }

    /// Tells whether there is no window.
    #[must_use]
    pub const fn is_empty(&self) -> bool {
        self.origin.is_empty()
    }

    /// Returns the number of samples: each window in each of its eight [transforms](Transform).
    #[must_use]
    pub const fn samples(&self) -> usize {
        self.len() * Transform::ALL.len()
    }

    /// Returns window and transform of a sample from 0 to [`samples`](Self::samples) − 1.
    #[must_use]
    pub const fn sample(&self, sample: usize) -> (usize, Transform) {
        (sample / Transform::ALL.len(), Transform::ALL[sample % Transform::ALL.len()])
    }

    /// Returns what a network is shown besides whether cells are free.
    #[must_use]
    pub fn planes(&self) -> Vec<Plane> {
        self.besides.keys().copied().collect()
    }

    /// Returns the occupancy of one window in row-major order.
    #[must_use]
    pub fn occupancy_of(&self, window: usize) -> &[u8] {
        &self.occupancy[window * self.size * self.size..][..self.size * self.size]
    }

    /// Returns where the cells of one window lie in the values of the [target](Self::target).
    #[must_use]
    pub const fn cells_of(&self, window: usize) -> Range<usize> {
        let cells = self.size * self.size;
        window * cells..(window + 1) * cells
    }

    /// Puts the windows of one map back where they were cut from.
    ///
    /// # Errors
    /// [`TileError::Contradiction`] if two windows disagree about a cell, or one about the outside of the map.
    ///
    /// # Panics
    /// If `map` is not the index of one of [`maps`](Self::maps).
    pub fn stitch(&self, map: usize, rows: usize, cols: usize) -> Result<Stitched, TileError> {
        let name = &self.maps[map];
        let mut cells: Grid<Option<(bool, f32)>> = Grid::filled(rows, cols, None);
        for (window, &(of, top, left)) in self.origin.iter().enumerate() {
            if of as usize != map {
                continue;
            }
            for (i, (free, cell)) in self.occupancy_of(window).iter().zip(self.cells_of(window)).enumerate() {
                let (row, col) = (top as isize + (i / self.size) as isize, left as isize + (i % self.size) as isize);
                let value = (*free == 1, self.target.value(cell));
                let agrees = if cells.get(row, col).is_some() {
                    *cells[Cell::new(row as usize, col as usize)].get_or_insert(value) == value
                } else {
                    value == (false, self.target.padding())
                };
                if !agrees {
                    let (row, col) = (row.max(0) as usize, col.max(0) as usize);
                    return Err(TileError::Contradiction { map: name.clone(), row, col });
                }
            }
        }
        Ok(Stitched { free: cells.map(|c| c.map(|c| c.0)), target: cells.map(|c| c.map(|c| c.1)) })
    }
}

/// A map as its windows show it; `None` where none of them reaches.
#[derive(Debug, Clone, PartialEq)]
pub struct Stitched {
    /// Whether a cell is free.
    pub free: Grid<Option<bool>>,
    /// Class or rank of a cell.
    pub target: Grid<Option<f32>>,
}

/// Cuts maps into overlapping windows.
///
/// The top left cells of the windows lie on multiples of `stride`, also before the map's first row and column, so that
/// each cell is in equally many windows. Of them those are kept that contain a free cell, as in algorithm 1, and at
/// least `min_labeled` labeled ones. What lies outside of a map is obstacle. Maps come in the given order, the windows of
/// a map by row and column.
///
/// # Errors
/// [`TileError`] if a parameter is out of range, labels do not fit their map or the maps before, or no window is left.
pub fn cut(maps: &[LabeledMap<'_>], config: &TileConfig) -> Result<Tiles, TileError> {
    config.check()?;
    let Some(first) = maps.first() else { return Err(TileError::NoWindow(config.min_labeled)) };
    let mut tiles = Tiles {
        size: config.size as usize,
        maps: maps.iter().map(|map| map.name.to_owned()).collect(),
        origin: Vec::new(),
        occupancy: Vec::new(),
        besides: config.besides.iter().map(|plane| (*plane, Vec::new())).collect(),
        target: first.known.empty_target(),
        labeled_share: Vec::new(),
    };
    for (index, labeled) in maps.iter().enumerate() {
        let (free, (rows, cols)) = (labeled.map.free(), labeled.known.size());
        if (rows, cols) != (free.rows(), free.cols()) {
            let (map, map_rows, map_cols) = (labeled.name.to_owned(), free.rows(), free.cols());
            return Err(TileError::SizeMismatch { map, rows, cols, map_rows, map_cols });
        }
        check_alike(&first.known, labeled)?;
        let index = u32::try_from(index).expect("fewer than 2³² maps");
        let shown = config.shown.of(labeled.map).ok_or_else(|| TileError::NothingSeen(labeled.name.to_owned()))?;
        cut_map(&mut tiles, index, (labeled, &shown), config);
    }
    if tiles.is_empty() { Err(TileError::NoWindow(config.min_labeled)) } else { Ok(tiles) }
}

/// Checks that of a map the same is known as of the first.
fn check_alike(first: &Known<'_>, labeled: &LabeledMap<'_>) -> Result<(), TileError> {
    let map = || labeled.name.to_owned();
    match (first, &labeled.known) {
        (Known::Classes(first), Known::Classes(labels)) if first.count != labels.count => {
            Err(TileError::ClassMismatch { map: map(), found: labels.count, classes: first.count })
        }
        (Known::Classes(_), Known::Classes(_)) => Ok(()),
        (Known::Ranks(first), Known::Ranks(ranks)) => {
            let parts = |ranks: &Ranks| (ranks.density.is_some(), ranks.flow.is_some());
            if parts(first) == parts(ranks) { Ok(()) } else { Err(TileError::KnownMismatch(map())) }
        }
        _ => Err(TileError::KnownMismatch(map())),
    }
}

fn cut_map(tiles: &mut Tiles, index: u32, (labeled, shown): (&LabeledMap<'_>, &OccupancyMap), config: &TileConfig) {
    let free = labeled.map.free();
    let free_cells = Sums::new(free, |free| *free);
    let labeled_cells = Sums::new(&labeled.known.labeled(), |labeled| *labeled);
    let besides: BTreeMap<Plane, Grid<u8>> = tiles.besides.keys().map(|plane| (*plane, plane.of(shown))).collect();
    let (size, stride) = (i64::from(config.size), i64::from(config.stride));
    // The first multiple of the stride at which a window still reaches the map.
    let first = -((size - 1) / stride * stride);
    let starts = |length: usize| (first..length as i64).step_by(config.stride as usize);
    for top in starts(free.rows()) {
        for left in starts(free.cols()) {
            let count = labeled_cells.within(top, left, size);
            if free_cells.within(top, left, size) == 0 || count < u64::from(config.min_labeled) {
                continue;
            }
            tiles.origin.push((index, top as i32, left as i32));
            tiles.labeled_share.push(count as f32 / (size * size) as f32);
            push_window(&mut tiles.occupancy, shown.free(), top, left, size, 0, |free| u8::from(*free));
            for (plane, codes) in &mut tiles.besides {
                push_window(codes, &besides[plane], top, left, size, 0, |code| *code);
            }
            match (&mut tiles.target, labeled.known) {
                (Target::Classes { labels, .. }, Known::Classes(known)) => {
                    push_window(labels, &known.classes, top, left, size, OBSTACLE, |label| *label);
                }
                (Target::Ranks { rank, density, flow }, Known::Ranks(known)) => {
                    push_window(rank, &known.rank, top, left, size, NO_RANK, |rank| *rank);
                    if let (Some(density), Some(known)) = (density, &known.density) {
                        push_window(density, known, top, left, size, 0.0, |density| *density);
                    }
                    if let (Some(flow), Some(known)) = (flow, &known.flow) {
                        known.iter().for_each(|codes| push_window(flow, codes, top, left, size, 0, |code| *code));
                    }
                }
                _ => unreachable!("of all maps the same is known"),
            }
        }
    }
}

/// Appends one window of a grid, with `padding` where it reaches beyond it.
fn push_window<T, U: Copy>(
    out: &mut Vec<U>,
    grid: &Grid<T>,
    top: i64,
    left: i64,
    size: i64,
    padding: U,
    value: impl Fn(&T) -> U,
) {
    let cols = grid.cols() as i64;
    let (from, to) = (left.clamp(0, cols), (left + size).clamp(0, cols));
    for row in top..top + size {
        let end = out.len() + size as usize;
        if (0..grid.rows() as i64).contains(&row) {
            out.resize(out.len() + (from - left) as usize, padding);
            out.extend(grid.row(row as usize)[from as usize..to as usize].iter().map(&value));
        }
        out.resize(end, padding);
    }
}

/// How many cells of a kind lie above and to the left of each corner: sums over rectangles in constant time.
struct Sums(Grid<u64>);

impl Sums {
    fn new<T>(grid: &Grid<T>, counts: impl Fn(&T) -> bool) -> Self {
        let mut sums = Grid::filled(grid.rows() + 1, grid.cols() + 1, 0u64);
        for row in 0..grid.rows() {
            let mut run = 0;
            for (col, value) in grid.row(row).iter().enumerate() {
                run += u64::from(counts(value));
                sums[Cell::new(row + 1, col + 1)] = sums[Cell::new(row, col + 1)] + run;
            }
        }
        Self(sums)
    }

    fn within(&self, top: i64, left: i64, size: i64) -> u64 {
        let row = |row: i64| row.clamp(0, self.0.rows() as i64 - 1) as usize;
        let col = |col: i64| col.clamp(0, self.0.cols() as i64 - 1) as usize;
        let (top, bottom, left, right) = (row(top), row(top + size), col(left), col(left + size));
        let at = |row, col| self.0[Cell::new(row, col)];
        at(bottom, right) + at(top, left) - at(top, right) - at(bottom, left)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::domain::geometry::Frame;
    use crate::domain::map::Observed;
    use crate::domain::quantize::{ClassCounts, Labels};
    use crate::domain::random::Stream;
    use crate::domain::raster::DIRECTIONS;
    use proptest::prelude::*;

    fn random_map(rows: usize, cols: usize, seed: u64) -> (OccupancyMap, Labels) {
        let mut stream = Stream::new(seed, &[0; 32], 0, "tiles");
        let mut classes = Grid::from_fn(rows, cols, |_| stream.below(5) as i8 - 1);
        classes[Cell::new(0, 0)] = 1;
        let free = classes.map(|class| *class != OBSTACLE);
        let map = OccupancyMap::new(free, Frame::at_zero(0.1, rows, cols)).expect("a free cell");
        (map, Labels { classes, count: 3 })
    }

    #[test]
    fn windows_start_before_the_map() {
        let (map, labels) = random_map(3, 9, 1);
        let labels = Labels { classes: labels.classes.map(|_| 2), ..labels };
        let map = OccupancyMap::new(map.free().map(|_| true), *map.frame()).expect("all free");
        let maps = [LabeledMap { name: "strip", map: &map, known: Known::Classes(&labels) }];
        let tiles =
            cut(&maps, &TileConfig { size: 8, stride: 4, min_labeled: 1, ..TileConfig::default() }).expect("windows");
        let expected: Vec<_> = [-4, 0].iter().flat_map(|r| [-4, 0, 4, 8].map(|c| (0u32, *r, c))).collect();
        assert_eq!(tiles.origin, expected);
        // The last one of the first row holds the map's last column in its first one, rows 0 to 2 from its row 4 on.
        let set: Vec<usize> = (0..64).filter(|i| tiles.target.value(3 * 64 + i) == 2.0).collect();
        assert_eq!(set, [32, 40, 48]);
        assert_eq!(tiles.labeled_share[3], 3.0 / 64.0);
        assert_eq!(tiles.samples(), 64);
        assert_eq!(tiles.sample(63), (7, Transform::AntiTranspose));
        // Every cell of the map is in four windows.
        assert_eq!(
            tiles.target.class_counts(),
            Some(ClassCounts { obstacle: 8 * 64 - 4 * 27, classes: vec![0, 4 * 27, 0], unlabeled: 0 })
        );
    }

    #[test]
    fn windows_without_enough_labels_are_dropped() {
        let (map, labels) = random_map(20, 20, 2);
        let maps = [LabeledMap { name: "a", map: &map, known: Known::Classes(&labels) }];
        let config = TileConfig { size: 8, stride: 1, min_labeled: 40, ..TileConfig::default() };
        let tiles = cut(&maps, &config).expect("windows");
        let all = cut(&maps, &TileConfig { min_labeled: 1, ..config.clone() }).expect("windows");
        let labeled =
            |tiles: &Tiles, window| tiles.cells_of(window).filter(|cell| tiles.target.value(*cell) > 0.0).count();
        assert!((0..tiles.len()).all(|window| labeled(&tiles, window) >= 40));
        assert_eq!((0..all.len()).filter(|window| labeled(&all, *window) >= 40).count(), tiles.len());
        assert!(tiles.len() < all.len());
        for window in 0..all.len() {
            assert_eq!(all.labeled_share[window], labeled(&all, window) as f32 / 64.0);
        }
        assert_eq!(cut(&maps, &TileConfig { min_labeled: 64, ..config }), Err(TileError::NoWindow(64)));
    }

    #[test]
    fn ranks_are_cut_where_cells_are_free() {
        let free = Grid::from_fn(5, 6, |cell| cell.col != 2);
        let rank =
            Grid::from_fn(5, 6, |cell| if free[cell] { (cell.row * 6 + cell.col) as f32 / 30.0 } else { NO_RANK });
        let map = OccupancyMap::new(free.clone(), Frame::at_zero(0.1, 5, 6)).expect("free cells");
        let flow: [Grid<u8>; DIRECTIONS] =
            std::array::from_fn(|direction| free.map(|free| if *free { 10 + direction as u8 } else { 0 }));
        let known = |density: Option<Grid<f32>>| Ranks { rank: rank.clone(), density, flow: Some(flow.clone()) };
        let (plain, dense) = (known(None), known(Some(rank.map(|rank| 2.0 * rank.max(0.0)))));
        let labeled = |name, known| LabeledMap { name, map: &map, known: Known::Ranks(known) };
        let config = TileConfig { size: 8, stride: 8, min_labeled: 1, ..TileConfig::default() };
        let tiles = cut(&[labeled("a", &dense), labeled("b", &dense)], &config).expect("windows");
        // Windows at −0 only: the map is smaller than one.
        assert_eq!(tiles.origin, [(0, 0, 0), (1, 0, 0)]);
        assert_eq!(tiles.labeled_share, [25.0 / 64.0; 2]);
        let Target::Ranks { rank, density: Some(density), flow: Some(flow) } = &tiles.target else {
            panic!("ranks, densities and flow")
        };
        assert_eq!((rank[8 + 1], density[8 + 1]), (7.0 / 30.0, 14.0 / 30.0));
        // Blocked, and beyond the map.
        assert_eq!((rank[2], density[2], rank[6], density[6]), (NO_RANK, 0.0, NO_RANK, 0.0));
        // Window by window the directions, each of 64 cells.
        assert_eq!(flow.len(), 2 * DIRECTIONS * 64);
        let codes = |cell: usize| (0..DIRECTIONS).map(move |direction| flow[(DIRECTIONS + direction) * 64 + cell]);
        assert_eq!(codes(8 + 1).collect::<Vec<_>>(), [10, 11, 12, 13, 14, 15, 16, 17]);
        assert!(codes(2).chain(codes(6)).all(|code| code == 0));
        let stitched = tiles.stitch(1, 5, 6).expect("windows agree");
        assert_eq!(stitched.target[Cell::new(4, 5)], Some(29.0 / 30.0));
        let error = cut(&[labeled("a", &dense), labeled("b", &plain)], &config).expect_err("one has no density");
        assert_eq!(error, TileError::KnownMismatch("b".to_owned()));
        let still = Ranks { flow: None, ..dense.clone() };
        assert!(cut(&[labeled("a", &dense), labeled("b", &still)], &config).is_err());
    }

    #[test]
    fn planes_are_cut_as_the_map_is() {
        let (map, labels) = random_map(5, 6, 3);
        let unknown = Grid::from_fn(5, 6, |cell| if cell.col == 4 { Observed::Unknown } else { Observed::Free });
        let map = map.with_observed(unknown).expect("of one size");
        let maps = [LabeledMap { name: "a", map: &map, known: Known::Classes(&labels) }];
        let besides = vec![Plane::Ways, Plane::Paths, Plane::Unknown];
        let config = TileConfig { size: 8, stride: 8, min_labeled: 1, besides, ..TileConfig::default() };
        let tiles = cut(&maps, &config).expect("windows");
        assert_eq!(tiles.besides.keys().copied().collect::<Vec<_>>(), Plane::ALL);
        let at = |plane: Plane| {
            let codes = plane.of(&map);
            (0..64).map(|i| codes.get(i / 8, i % 8).copied().unwrap_or(0)).collect::<Vec<u8>>()
        };
        assert!(Plane::ALL.iter().all(|plane| tiles.besides[plane] == at(*plane)));
        let twice = TileConfig { besides: vec![Plane::Paths; 2], ..config };
        let error = twice.check().expect_err("twice").to_string();
        assert_eq!(error, "of `besides` `paths` occurs twice, allowed is each plane once");
    }

    /// Of a row of free cells one is seen as occupied and one not at all: both are to be learned, neither is shown as free.
    #[test]
    fn what_is_observed_can_be_shown_instead() {
        let map = OccupancyMap::new(Grid::filled(1, 4, true), Frame::at_zero(0.1, 1, 4)).expect("free cells");
        let seen = Grid::from_vec(1, 4, vec![Observed::Free, Observed::Occupied, Observed::Unknown, Observed::Free]);
        let map = map.with_observed(seen).expect("of one size");
        let visits = Grid::from_vec(1, 4, vec![1, 2, 3, 4]);
        let ranks = Ranks::of(&map, &visits, None, None, None);
        let maps = |map| [LabeledMap { name: "a", map, known: Known::Ranks(&ranks) }];
        let config =
            TileConfig { size: 8, stride: 8, min_labeled: 1, besides: vec![Plane::Unknown], shown: Shown::Observed };
        let tiles = cut(&maps(&map), &config).expect("a window");
        assert_eq!(tiles.occupancy[..5], [1, 0, 0, 1, 0]);
        assert_eq!(tiles.besides[&Plane::Unknown][..5], [0, 0, 1, 0, 0]);
        let Target::Ranks { rank, .. } = &tiles.target else { panic!("ranks") };
        assert_eq!(rank[..5], [0.0, 0.25, 0.5, 0.75, NO_RANK]);
        let plain = cut(&maps(&map), &TileConfig { shown: Shown::Map, ..config.clone() }).expect("a window");
        assert_eq!(plain.occupancy[..5], [1, 1, 1, 1, 0]);
        let dark = map.clone().with_observed(Grid::filled(1, 4, Observed::Unknown)).expect("of one size");
        assert_eq!(cut(&maps(&dark), &config), Err(TileError::NothingSeen("a".to_owned())));
    }

    #[test]
    fn parameters_out_of_range_are_named() {
        let check = |size, stride, min_labeled| {
            TileConfig { size, stride, min_labeled, ..TileConfig::default() }.check().expect_err("out of range")
        };
        assert_eq!(check(12, 4, 1).to_string(), "`size` is `12`, allowed are multiples of 8 from 8 to 512");
        assert_eq!(check(16, 17, 1).to_string(), "`stride` is `17`, allowed are 1 to the window's 16");
        assert_eq!(check(16, 4, 257).to_string(), "`min_labeled` is `257`, allowed are 1 to the window's 256 cells");
        assert_eq!(TileConfig::default().check(), Ok(()));
    }

    #[test]
    fn contradicting_windows_do_not_stitch() {
        let (map, labels) = random_map(10, 10, 3);
        let maps = [LabeledMap { name: "a", map: &map, known: Known::Classes(&labels) }];
        let mut tiles =
            cut(&maps, &TileConfig { size: 8, stride: 4, min_labeled: 1, ..TileConfig::default() }).expect("windows");
        let window = tiles.origin.iter().position(|origin| *origin == (0, 0, 0)).expect("a window at the corner");
        let Target::Classes { labels, .. } = &mut tiles.target else { unreachable!("they were cut from classes") };
        labels[window * 64 + 8 * 5 + 6] ^= 1;
        let error = tiles.stitch(0, 10, 10).expect_err("a contradiction");
        assert_eq!(error.to_string(), "the windows of map `a` contradict each other at row 5, column 6");
    }

    proptest! {
        #[test]
        fn cut_tiles_stitch_back(
            sizes in prop::collection::vec((1usize..40, 1usize..40), 1..3), stride in 1u32..=8, seed in 0u64..1000,
        ) {
            let parts: Vec<_> = sizes.iter().map(|(rows, cols)| random_map(*rows, *cols, seed)).collect();
            let maps: Vec<_> = parts.iter().map(|(map, labels)| LabeledMap { name: "m", map, known: Known::Classes(labels) }).collect();
            let tiles = cut(&maps, &TileConfig { size: 8, stride, min_labeled: 1, ..TileConfig::default() }).expect("one labeled cell each");
            for (index, (map, labels)) in parts.iter().enumerate() {
                let (rows, cols) = (map.free().rows(), map.free().cols());
                let stitched = tiles.stitch(index, rows, cols).expect("windows agree");
                for cell in map.free().cells() {
                    prop_assert!(stitched.free[cell].is_none_or(|free| free == map.free()[cell]));
                    prop_assert!(stitched.target[cell].is_none_or(|label| label == f32::from(labels.classes[cell])));
                    // What was dropped has no label to lose.
                    prop_assert!(stitched.target[cell].is_some() || labels.classes[cell] <= 0);
                }
            }
            prop_assert_eq!(tiles.occupancy.len(), tiles.len() * 64);
            prop_assert_eq!(tiles.target.len(), tiles.len() * 64);
        }
    }
}
