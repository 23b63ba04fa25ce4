//! Which of a picture's separate regions of free floor are the building's: not the paper around it.

use super::config::Region;
use super::error::MapImportError;
use super::form::MapForm;
use super::observed::Observed;
use super::occupancy::OccupancyMap;
use super::regions::regions;
use crate::domain::geometry::{Cell, Frame, Grid, Point};

/// The least free floor that makes a map, in square meters.
const LEAST: f64 = 1.0;
/// The share of the paper around it that a building's largest region has at least, where that is the only hint.
const BUILDING: f64 = 0.25;
/// The same for maps of robots, which tell unknown space from free: here what reaches all sides is likely a hall.
const MAPPED_BUILDING: f64 = 0.1;
/// The share of the free floor below which what is kept deserves a warning.
const MOST: f64 = 0.9;

/// What became of the free floor of an imported map, all areas in square meters.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Survey {
    /// Free floor that is kept.
    pub kept: f64,
    /// Free floor that is not outdoors.
    pub indoors: f64,
    /// How many separate regions the latter has.
    pub regions: usize,
    /// Free floor that was left out because it surrounds the building.
    pub outdoors: f64,
    /// Whether transparent pixels were read as white paper.
    pub paper: bool,
    /// Which regions were asked for.
    pub region: Region,
}

impl Survey {
    /// Returns how much of the free floor is kept, 0 to 1.
    #[must_use]
    pub fn share(&self) -> f64 {
        self.kept / self.indoors
    }

    /// Tells whether somebody should look: much of the floor is gone, or what was left out is a guess.
    #[must_use]
    pub fn is_odd(&self) -> bool {
        self.share() < MOST || self.outdoors > 0.0 || self.paper
    }
}

impl std::fmt::Display for Survey {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        // Never rounded up to all of it.
        let percent = (1000.0 * self.share()).floor() / 10.0;
        write!(f, "kept {:.1} of {:.1} m² of free floor ({percent:.1} %)", self.kept, self.indoors)?;
        let others = self.regions > 1 && self.kept < self.indoors;
        match self.region {
            Region::Largest if others => write!(f, ", the largest of {} regions", self.regions)?,
            Region::At(..) if others => write!(f, ", one of {} regions", self.regions)?,
            _ => {}
        }
        if self.outdoors > 0.0 {
            write!(f, "; left out {:.1} m² around the building as outdoors", self.outdoors)?;
        }
        if self.paper {
            f.write_str("; read transparent pixels as white paper")?;
        }
        Ok(())
    }
}

/// A region of free cells.
#[derive(Debug, Clone, Copy)]
struct Area {
    cells: usize,
    top: usize,
    bottom: usize,
    left: usize,
    right: usize,
    /// Cells in the corners of the grid that belong to it.
    corners: usize,
    outdoors: bool,
}

/// Keeps the regions that are asked for, cut out with a margin of one blocked cell on each side.
///
/// The first in row-major order wins a tie. The origin moves with the cut, so no cell changes its place in the world.
/// Regions that are not kept are blocked, but observed as they are; of what lies beyond the picture nothing is known.
///
/// # Errors
/// [`MapImportError`] if no cell is free, less than a square meter is kept, or no region lies at the place asked for.
pub(super) fn choose(
    cells: &Grid<Observed>,
    frame: &Frame,
    form: MapForm,
    region: Region,
) -> Result<(OccupancyMap, Survey), MapImportError> {
    let (labels, sizes) = regions(&cells.map(|cell| *cell == Observed::Free));
    let mut areas = areas(&labels, &sizes);
    let cell_area = frame.resolution * frame.resolution;
    mark_outdoors(&mut areas, &labels, form, cell_area);
    let mut keep: Vec<bool> = areas.iter().map(|area| !area.outdoors).collect();
    match region {
        Region::All => {}
        Region::Largest => {
            let most = largest(&areas, |area| !area.outdoors);
            (0..keep.len()).for_each(|at| keep[at] = Some(at) == most);
        }
        Region::At(x, y) => {
            let chosen = nearest(&labels, frame, Point::new(x, y)).ok_or_else(|| nowhere(frame, x, y))?;
            // What somebody points at is not left out.
            areas[chosen].outdoors = false;
            (0..keep.len()).for_each(|at| keep[at] = at == chosen);
        }
    }
    let area = |wanted: &dyn Fn(usize) -> bool| {
        (0..areas.len()).filter(|at| wanted(*at)).map(|at| areas[at].cells).sum::<usize>() as f64 * cell_area
    };
    let survey = Survey {
        kept: area(&|at| keep[at]),
        indoors: area(&|at| !areas[at].outdoors),
        regions: areas.iter().filter(|area| !area.outdoors).count(),
        outdoors: area(&|at| areas[at].outdoors),
        paper: false,
        region,
    };
    let map = cut(cells, &labels, frame, &areas, &keep)?;
    if survey.kept < LEAST - 1e-9 {
        return Err(MapImportError::TooSmall { area: survey.kept });
    }
    Ok((map, survey))
}

fn areas(labels: &Grid<u32>, sizes: &[usize]) -> Vec<Area> {
    let none = Area { cells: 0, top: usize::MAX, bottom: 0, left: usize::MAX, right: 0, corners: 0, outdoors: false };
    let mut areas: Vec<Area> = sizes.iter().map(|cells| Area { cells: *cells, ..none }).collect();
    for cell in labels.cells().filter(|cell| labels[*cell] > 0) {
        let area = &mut areas[labels[cell] as usize - 1];
        (area.top, area.bottom) = (area.top.min(cell.row), area.bottom.max(cell.row));
        (area.left, area.right) = (area.left.min(cell.col), area.right.max(cell.col));
        let corner =
            (cell.row == 0 || cell.row + 1 == labels.rows()) && (cell.col == 0 || cell.col + 1 == labels.cols());
        area.corners += usize::from(corner);
    }
    areas
}

fn largest(areas: &[Area], wanted: impl Fn(&Area) -> bool) -> Option<usize> {
    (0..areas.len()).filter(|at| wanted(&areas[*at])).min_by_key(|at| std::cmp::Reverse(areas[*at].cells))
}

/// Marks what surrounds the building, if there is one.
///
/// That is what reaches all sides of the picture; also what holds a corner of it, where the building stands at a border and
/// divides the paper; also, where a frame is drawn round the sheet, what reaches into all corners of that frame. A hint of
/// the latter kinds counts only if the largest region without it is not much smaller.
fn mark_outdoors(areas: &mut [Area], labels: &Grid<u32>, form: MapForm, cell_area: f64) {
    let last = (labels.rows() - 1, labels.cols() - 1);
    let reaches = |area: &Area| (area.top, area.left) == (0, 0) && (area.bottom, area.right) == last;
    let least = |area: &Area, form: MapForm| match form {
        MapForm::Image | MapForm::Plan(_) => 0.0,
        MapForm::Ros | MapForm::Igibson => MAPPED_BUILDING * area.cells as f64,
    };
    let inner = largest(areas, |area| !reaches(area)).map_or(0, |at| areas[at].cells);
    for area in areas.iter_mut().filter(|area| reaches(area)) {
        area.outdoors = inner as f64 * cell_area >= LEAST && inner as f64 >= least(area, form);
    }
    if form != MapForm::Image {
        return;
    }
    let is_building =
        |inner: usize, area: &Area| inner as f64 * cell_area >= LEAST && inner as f64 >= BUILDING * area.cells as f64;
    let inner = largest(areas, |area| area.corners == 0 && !area.outdoors).map_or(0, |at| areas[at].cells);
    for area in areas.iter_mut().filter(|area| area.corners > 0) {
        area.outdoors |= is_building(inner, area);
    }
    while let Some(sheet) = framed(areas, labels) {
        let others = (0..areas.len()).filter(|at| *at != sheet && !areas[*at].outdoors);
        let inner = others.map(|at| areas[at].cells).max().unwrap_or(0);
        if !is_building(inner, &areas[sheet]) {
            return;
        }
        areas[sheet].outdoors = true;
    }
}

/// Returns the region that reaches into all four corners of what holds all regions that are left, if there is one.
fn framed(areas: &[Area], labels: &Grid<u32>) -> Option<usize> {
    let left = || areas.iter().filter(|area| !area.outdoors);
    let (top, bottom) = (left().map(|area| area.top).min()?, left().map(|area| area.bottom).max()?);
    let (first, last) = (left().map(|area| area.left).min()?, left().map(|area| area.right).max()?);
    let corners = [(top, first), (top, last), (bottom, first), (bottom, last)];
    let label = labels[Cell::new(top, first)];
    let same = label > 0 && corners.into_iter().all(|(row, col)| labels[Cell::new(row, col)] == label);
    same.then(|| label as usize - 1)
}

/// Returns the region nearest to a place, at most half a meter away.
fn nearest(labels: &Grid<u32>, frame: &Frame, place: Point) -> Option<usize> {
    const REACH: f64 = 0.5;
    let local = frame.to_local(place);
    let reach = (REACH / frame.resolution).ceil() as isize;
    let (row, col) = frame.signed_cell(local);
    let near = (-reach..=reach)
        .flat_map(|down| (-reach..=reach).map(move |right| (row.saturating_add(down), col.saturating_add(right))));
    let found = near.filter_map(|(row, col)| {
        let label = labels.get(row, col).filter(|label| **label > 0)?;
        let distance = frame.center(Cell::new(row as usize, col as usize)).distance(local);
        Some((distance, *label))
    });
    let best = found.min_by(|a, b| a.0.total_cmp(&b.0))?;
    (best.0 <= REACH + frame.resolution).then(|| best.1 as usize - 1)
}

fn nowhere(frame: &Frame, x: f64, y: f64) -> MapImportError {
    let (width, height) = (frame.cols as f64 * frame.resolution, frame.rows as f64 * frame.resolution);
    let corners =
        [(0.0, 0.0), (width, 0.0), (0.0, height), (width, height)].map(|(x, y)| frame.to_map(Point::new(x, y)));
    let round = |value: f64| (value * 100.0).round() / 100.0;
    let bound = |start: f64, pick: fn(f64, f64) -> f64| {
        [corners.iter().fold(start, |a, p| pick(a, p.x)), corners.iter().fold(start, |a, p| pick(a, p.y))].map(round)
    };
    MapImportError::NoRegion { x, y, low: bound(f64::INFINITY, f64::min), high: bound(f64::NEG_INFINITY, f64::max) }
}

fn cut(
    cells: &Grid<Observed>,
    labels: &Grid<u32>,
    frame: &Frame,
    areas: &[Area],
    keep: &[bool],
) -> Result<OccupancyMap, MapImportError> {
    let kept = || areas.iter().zip(keep).filter(|(_, keep)| **keep).map(|(area, _)| area);
    let none = super::occupancy::MapError::NoFreeSpace;
    let (Some(top), Some(left)) = (kept().map(|area| area.top).min(), kept().map(|area| area.left).min()) else {
        return Err(none.into());
    };
    let bottom = kept().map(|area| area.bottom).max().unwrap_or(top);
    let right = kept().map(|area| area.right).max().unwrap_or(left);
    let (rows, cols) = (bottom - top + 3, right - left + 3);
    let before = |cell: Cell| ((top + cell.row) as isize - 1, (left + cell.col) as isize - 1);
    let free = Grid::from_fn(rows, cols, |cell| {
        let (row, col) = before(cell);
        labels.get(row, col).is_some_and(|label| *label > 0 && keep[*label as usize - 1])
    });
    let observed = Grid::from_fn(rows, cols, |cell| {
        let (row, col) = before(cell);
        cells.get(row, col).copied().unwrap_or(Observed::Unknown)
    });
    let corner = Point::new(
        (left as f64 - 1.0) * frame.resolution,
        (frame.rows as f64 - 2.0 - bottom as f64) * frame.resolution,
    );
    let frame = Frame { origin: frame.to_map(corner), rows: free.rows(), cols: free.cols(), ..*frame };
    Ok(OccupancyMap::new(free, frame)?.with_observed(observed)?)
}

#[cfg(test)]
mod tests {
    use super::*;
    use MapForm::{Igibson, Image, Ros};

    /// A drawing of free (`.`), unknown (`?`) and occupied cells of half a meter.
    fn drawing(rows: &[&str]) -> (Grid<Observed>, Frame) {
        let cells = Grid::from_fn(rows.len(), rows[0].len(), |c| match rows[c.row].as_bytes()[c.col] {
            b'.' => Observed::Free,
            b'?' => Observed::Unknown,
            _ => Observed::Occupied,
        });
        let frame = Frame::at_zero(0.5, cells.rows(), cells.cols());
        (cells, frame)
    }

    fn chosen(rows: &[&str], form: MapForm, region: Region) -> Result<(OccupancyMap, Survey), MapImportError> {
        let (cells, frame) = drawing(rows);
        choose(&cells, &frame, form, region)
    }

    /// Checks how many cells are kept and how many are left out as outdoors.
    fn check(rows: &[&str], form: MapForm, kept: usize, outdoors: usize) {
        let (map, survey) = chosen(rows, form, Region::Largest).expect("a map");
        assert_eq!((map.free_cells(), (survey.outdoors * 4.0) as usize), (kept, outdoors), "{rows:#?}: {survey:?}");
        assert_eq!(survey.kept, map.free_area());
    }

    #[test]
    fn the_paper_around_a_building_is_outdoors() {
        let plan = ["........", ".######.", ".#....#.", ".#....#.", ".######.", "........"];
        check(&plan, Image, 8, 24);
        let (map, _) = chosen(&plan, Image, Region::Largest).expect("a map");
        assert_eq!((map.free().rows(), map.free().cols()), (4, 6));
        // Only paper: then it is the floor.
        check(&["....", ".##.", "...."], Image, 10, 0);
        // What it surrounds is less than a square meter.
        check(&["......", ".####.", ".#..#.", ".####.", "......"], Image, 18, 0);
    }

    #[test]
    fn a_building_may_stand_at_the_border() {
        check(&["........", "#####...", "....#...", "....#...", "#####...", "........"], Image, 8, 28);
        check(&["#####...", "#...#...", "#...#...", "#####..."], Image, 6, 12);
        check(&["#####...", "#...#...", "#...#...", "#####...", "........"], Image, 6, 20);
        check(&[".#####..", ".#...#..", ".#...#..", ".#####.."], Image, 6, 12);
    }

    #[test]
    fn a_frame_round_the_sheet_is_no_wall() {
        let framed = [
            "##########",
            "#........#",
            "#.######.#",
            "#.#....#.#",
            "#.#....#.#",
            "#.######.#",
            "#........#",
            "##########",
        ];
        check(&framed, Image, 8, 24);
        let margin: Vec<String> = framed.iter().map(|row| format!(".{row}.")).collect();
        let line = ".".repeat(12);
        let rows: Vec<&str> =
            [line.as_str()].into_iter().chain(margin.iter().map(String::as_str)).chain([line.as_str()]).collect();
        check(&rows, Image, 8, 24 + 40);
        // A hall with a closed chamber in it is no sheet of paper.
        check(
            &[
                "##########",
                "#........#",
                "#...####.#",
                "#...#..#.#",
                "#...#..#.#",
                "#...####.#",
                "#........#",
                "##########",
            ],
            Image,
            32,
            0,
        );
    }

    #[test]
    fn a_hall_that_a_robot_has_mapped_stays() {
        // Its pillar is hollow; no wall was seen at the borders.
        let hall: Vec<String> = (0..20)
            .map(|row| {
                (0..20)
                    .map(|col| {
                        let (down, right) = (i32::abs(row - 9), i32::abs(col - 9));
                        if down.max(right) == 2 { '#' } else { '.' }
                    })
                    .collect()
            })
            .collect();
        let rows: Vec<&str> = hall.iter().map(String::as_str).collect();
        check(&rows, Ros, 400 - 25, 0);
        // A plan with its paper that somebody has put a YAML beside.
        let plan = ["........", ".######.", ".#....#.", ".#....#.", ".######.", "........"];
        check(&plan, Ros, 8, 24);
        check(&plan, Igibson, 8, 24);
        check(&["#####...", "#...#...", "#...#...", "#####..."], Ros, 12, 0);
    }

    #[test]
    fn regions_can_be_chosen() {
        let rows = ["###########", "#....#....#", "#....#....#", "#....#...##", "###########"];
        let kept = |region| chosen(&rows, Image, region).map(|(map, survey)| (map.free_cells(), survey.regions));
        assert_eq!(kept(Region::Largest).expect("a map"), (12, 2));
        assert_eq!(kept(Region::All).expect("a map"), (23, 2));
        assert_eq!(kept(Region::At(3.2, 1.0)).expect("a map"), (11, 2));
        // On a wall the nearest floor counts; further out there is none.
        assert_eq!(kept(Region::At(2.6, 1.0)).expect("a map").0, 12);
        for nowhere in [(9.0, 1.0), (-1.5, 1.0), (1e300, 0.0)] {
            let found = kept(Region::At(nowhere.0, nowhere.1));
            assert!(matches!(found, Err(MapImportError::NoRegion { .. })), "{nowhere:?}: {found:?}");
        }
        // Somebody may want to see people in the yard.
        let plan = ["........", ".######.", ".#....#.", ".#....#.", ".######.", "........"];
        let (map, survey) = chosen(&plan, Image, Region::At(0.2, 0.2)).expect("a map");
        assert_eq!((map.free_cells(), survey.outdoors), (24, 0.0));
    }

    #[test]
    fn what_is_not_kept_is_still_observed() {
        let rows = ["?######", "......#", ".###..#", ".#.#..#", ".###..#", "......#"];
        let (map, _) = chosen(&rows, Ros, Region::Largest).expect("a map");
        let drawn: Vec<String> = (0..map.observed().rows())
            .map(|row| map.observed().row(row).iter().map(|cell| ['#', '.', '?'][*cell as usize]).collect())
            .collect();
        // On the left and below, the margin lies beyond the picture.
        let expected = ["??######", "?......#", "?.###..#", "?.#.#..#", "?.###..#", "?......#", "????????"];
        assert_eq!(drawn, expected);
        assert!(!map.is_free(3, 3), "nobody gets into the chamber");
        assert_eq!(map.free_cells(), 21);
    }

    #[test]
    fn what_is_kept_keeps_its_place_in_the_world() {
        let free = Grid::from_fn(4, 7, |c| matches!((c.row, c.col), (0, 0) | (1..=2, 3..=5)));
        let free = free.map(|free| Observed::of_free(*free));
        for yaw in [0.0, 0.7] {
            let frame = Frame { origin: Point::new(-3.0, 8.0), yaw, ..Frame::at_zero(0.5, 4, 7) };
            let (map, _) = choose(&free, &frame, Ros, Region::Largest).expect("free cells");
            let drawn: Vec<String> =
                (0..4).map(|row| map.free().row(row).iter().map(|f| if *f { '.' } else { '#' }).collect()).collect();
            assert_eq!(drawn, ["#####", "#...#", "#...#", "#####"]);
            let before = frame.to_map(frame.center(Cell::new(1, 3)));
            let after = map.frame().to_map(map.frame().center(Cell::new(1, 1)));
            assert!(before.distance(after) < 1e-12, "{before:?} {after:?}");
            let (same, _) = choose(&free, &frame, Ros, Region::At(before.x, before.y)).expect("free cells");
            assert_eq!(same, map);
        }
        let error = choose(&Grid::filled(2, 2, Observed::Occupied), &Frame::at_zero(0.1, 2, 2), Ros, Region::Largest);
        assert!(matches!(error, Err(MapImportError::Map(_))), "{error:?}");
    }
}
