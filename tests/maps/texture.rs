//! What can be measured of walls without knowing what they are of, for real maps and for generated ones side by side.

use trodden::domain::geometry::{Cell, Grid};
use trodden::domain::homes::buildings::{BuildingConfig, BuildingKind, generate_building};
use trodden::domain::homes::{HomeConfig, HomeKind, generate};
use trodden::domain::map::{Observed, OccupancyMap, squared_distances};

use super::import;
use crate::needs::Need;

const SEED: u64 = 2023;

/// How the free space of a map looks.
#[derive(Debug, Clone, Copy)]
struct Texture {
    /// Obstacles of at most 2 m that stand free, to 100 m².
    isolated: f64,
    /// Share of the boundary of free space that lies in straight runs of at most three cells.
    jagged: f64,
    /// Median distance from the center of a cell to the nearest that is not free, in meters.
    clearance: f64,
    /// Share of the free floor that is further than 1.5 m from anything.
    wide: f64,
    /// Ways around something of more than 2 m for a disc of radius 0.2 m, to 100 m².
    loops: f64,
}

impl Texture {
    const HEAD: &str = "                               isolated  jagged  clearance  > 1.5 m  loops";

    /// Measures what a map shows as free.
    fn of(map: &OccupancyMap) -> Self {
        let free = map.observed().map(|cell| *cell == Observed::Free);
        let cell = map.resolution();
        let hundreds = free.as_slice().iter().filter(|free| **free).count() as f64 * cell * cell / 100.0;
        let is_small = |extent: &usize| *extent as f64 * cell <= 2.0 + 1e-9;
        // Between the center of a cell and the border of the nearest that is not free.
        let clearance = squared_distances(&free).map(|squared| squared.sqrt() * cell - 0.5 * cell);
        let walkable = clearance.map(|clear| *clear >= 0.2 - 1e-9);
        let mut clear: Vec<f64> = clearance.as_slice().iter().copied().filter(|clear| *clear > 0.0).collect();
        clear.sort_by(f64::total_cmp);
        Self {
            isolated: islands(&free).iter().filter(|extent| is_small(extent)).count() as f64 / hundreds,
            jagged: jagged(&free),
            clearance: clear[clear.len() / 2],
            wide: clear.iter().filter(|clear| **clear > 1.5).count() as f64 / clear.len() as f64,
            loops: islands(&walkable).iter().filter(|extent| !is_small(extent)).count() as f64 / hundreds,
        }
    }

    fn values(self) -> [f64; 5] {
        [self.isolated, self.jagged, self.clearance, self.wide, self.loops]
    }

    fn mean(all: &[Self]) -> Self {
        let mean = |pick: fn(&Self) -> f64| all.iter().map(pick).sum::<f64>() / all.len() as f64;
        Self {
            isolated: mean(|texture| texture.isolated),
            jagged: mean(|texture| texture.jagged),
            clearance: mean(|texture| texture.clearance),
            wide: mean(|texture| texture.wide),
            loops: mean(|texture| texture.loops),
        }
    }

    fn print(self, name: &str) -> Self {
        let Self { isolated, jagged, clearance, wide, loops } = self;
        println!("{name:30} {isolated:8.1} {jagged:7.2} {clearance:10.2} {wide:8.2} {loops:6.2}");
        self
    }
}

/// Returns the longer side, in cells, of each eight-connected piece of what is not free and does not touch the border.
fn islands(free: &Grid<bool>) -> Vec<usize> {
    let (rows, cols) = (free.rows(), free.cols());
    let (mut taken, mut found) = (free.clone(), Vec::new());
    for start in free.cells() {
        if std::mem::replace(&mut taken[start], true) {
            continue;
        }
        let (mut top, mut bottom, mut left, mut right) = (start.row, start.row, start.col, start.col);
        let mut rest = vec![start];
        while let Some(cell) = rest.pop() {
            (top, bottom) = (top.min(cell.row), bottom.max(cell.row));
            (left, right) = (left.min(cell.col), right.max(cell.col));
            for step in 0..9 {
                let (row, col) = ((cell.row + step / 3).wrapping_sub(1), (cell.col + step % 3).wrapping_sub(1));
                if row < rows && col < cols && !std::mem::replace(&mut taken[Cell::new(row, col)], true) {
                    rest.push(Cell::new(row, col));
                }
            }
        }
        if top > 0 && left > 0 && bottom + 1 < rows && right + 1 < cols {
            found.push((bottom - top).max(right - left) + 1);
        }
    }
    found
}

/// Returns the share of the edges between free cells and others that lie in straight runs of at most three.
fn jagged(free: &Grid<bool>) -> f64 {
    let at = |row: usize, col: usize| i32::from(free[Cell::new(row, col)]);
    // Along each line between two rows or columns: on which side the free cell lies, if there is an edge.
    let flat = (1..free.rows()).map(|row| (0..free.cols()).map(|col| at(row, col) - at(row - 1, col)).collect());
    let upright = (1..free.cols()).map(|col| (0..free.rows()).map(|row| at(row, col) - at(row, col - 1)).collect());
    let (mut all, mut short) = (0, 0);
    for line in flat.chain(upright) {
        let line: Vec<i32> = line;
        for run in line.chunk_by(|a, b| a == b).filter(|run| run[0] != 0) {
            all += run.len();
            short += if run.len() <= 3 { run.len() } else { 0 };
        }
    }
    f64::from(short as u32) / f64::from(all as u32)
}

#[test]
fn textures_are_what_they_are_called() {
    let rows = ["########", "#......#", "#.#..#.#", "#....#.#", "#....#.#", "#....#.#", "#......#", "########"];
    let free = Grid::from_fn(8, 8, |cell| rows[cell.row].as_bytes()[cell.col] == b'.');
    assert_eq!(islands(&free), [1, 4]);
    // Four walls of six edges; a pillar of four runs of one; a screen of two runs of four and two of one.
    assert!((jagged(&free) - 6.0 / 38.0).abs() < 1e-12);
}

/// Prints the table of domain and real maps; the test maps stand last, for comparison only.
#[test]
fn generated_buildings_look_like_real_ones() {
    let Some(maps) = Need::Maps.folder() else { return };
    println!("{}", Texture::HEAD);
    let real = [
        "pal/small_office/map.yaml",
        "pal/small_warehouse/map.yaml",
        "nav2/warehouse.yaml",
        "sean/lab/map.yaml",
        "sean/hotel/map.yaml",
        "hunav/hall.yaml",
        "sean/labstudy/map.yaml",
    ]
    .map(|yaml| Texture::of(&import(&maps.join(yaml), 0.1)).print(yaml));
    let homes = |kind: HomeKind, name: &str| {
        let config = HomeConfig { kind, ..HomeConfig::default() };
        let all: Vec<Texture> = (0..12).map(|number| Texture::of(&generate(SEED, number, &config))).collect();
        Texture::mean(&all).print(name);
    };
    homes(HomeKind::Home, "homes");
    homes(HomeKind::Office, "offices");
    let kinds = BuildingConfig::default().kinds;
    let drawn = |kind: BuildingKind| {
        let config = BuildingConfig { kinds: vec![kind], ..BuildingConfig::default() };
        let all: Vec<Texture> = (0..8).map(|number| Texture::of(&generate_building(SEED, number, &config))).collect();
        Texture::mean(&all).print(&format!("buildings: {kind:?}"))
    };
    let drawn: Vec<Texture> = kinds.into_iter().map(drawn).collect();
    let drawn = Texture::mean(&drawn).print("buildings");
    for yaml in [
        "pal/hospital/map.yaml",
        "pal/willow_garage/map.yaml",
        "pal/pal_office_7th_floor/map.yaml",
        "pal/small_house/map.yaml",
        "hunav/bookstore.yaml",
        "pal/pal_office/map.yaml",
    ] {
        Texture::of(&import(&maps.join(yaml), 0.1)).print(&format!("(test) {yaml}"));
    }
    for (at, value) in drawn.values().into_iter().enumerate() {
        let (low, high) = real
            .iter()
            .map(|texture| texture.values()[at])
            .fold((f64::INFINITY, 0.0f64), |(low, high), value| (low.min(value), high.max(value)));
        // Real maps without any loop are small.
        assert!((low..=high.max(2.0)).contains(&value), "measure {at}: {value:.2} is not in {low:.2} to {high:.2}");
    }
}
