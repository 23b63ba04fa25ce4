//! What a scan shows of a building: jagged, doubled and missing walls, specks, and space that nobody has looked at.

use super::super::dice::Dice;
use crate::domain::geometry::{Cell, Grid};
use crate::domain::map::{Pixel, neighbors4, regions};

/// The most places that a building is scanned from.
const MOST_STATIONS: usize = 1500;

/// Draws how good a scan is, and what it shows of `free` pixels of so many meters.
pub(super) fn scan(free: &Grid<bool>, pixel: f64, dice: &mut Dice) -> Grid<Pixel> {
    // Most scans are good, some are not.
    let strength = libm::pow(dice.real(0.0, 1.0), 2.5);
    let mut solid = warped(free, pixel, strength, dice).map(|free| !free);
    doubled(&mut solid, pixel, strength, dice);
    let glass = missing(&solid, pixel, dice);
    let seen = looked_at(free, &solid, &glass, pixel, dice);
    let mut shown = shown(&solid, &glass, &seen, dice);
    specks(&mut shown, pixel, strength, dice);
    shown
}

/// Smooth noise: values from −1 to 1 at the knots of a coarse grid, and what lies between.
struct Waves {
    spacing: f64,
    knots: Grid<f64>,
}

impl Waves {
    fn draw(rows: usize, cols: usize, spacing: f64, dice: &mut Dice) -> Self {
        let count = |pixels: usize| (pixels as f64 / spacing) as usize + 2;
        Self { spacing, knots: Grid::from_fn(count(rows), count(cols), |_| dice.real(-1.0, 1.0)) }
    }

    fn at(&self, cell: Cell) -> f64 {
        let (row, col) = (cell.row as f64 / self.spacing, cell.col as f64 / self.spacing);
        let knot = Cell::new(row as usize, col as usize);
        let (down, right) = (row - knot.row as f64, col - knot.col as f64);
        let value = |row: usize, col: usize| self.knots[Cell::new(knot.row + row, knot.col + col)];
        let above = value(0, 0) * (1.0 - right) + value(0, 1) * right;
        let below = value(1, 0) * (1.0 - right) + value(1, 1) * right;
        above * (1.0 - down) + below * down
    }
}

/// Bends walls a little over meters and more over decimeters, and frays their edges.
fn warped(free: &Grid<bool>, pixel: f64, strength: f64, dice: &mut Dice) -> Grid<bool> {
    let (rows, cols) = (free.rows(), free.cols());
    let mut waves = |low: f64, high: f64| Waves::draw(rows, cols, dice.real(low, high) / pixel, dice);
    let bends = [waves(3.0, 8.0), waves(3.0, 8.0)];
    let ripples = [waves(0.3, 1.0), waves(0.3, 1.0)];
    let bend = strength * dice.real(0.0, 0.12) / pixel;
    let ripple = strength * dice.real(0.0, 0.08) / pixel;
    let fray = strength * dice.real(0.0, 0.6);
    Grid::from_fn(rows, cols, |cell| {
        let offset = |axis: usize| bend * bends[axis].at(cell) + ripple * ripples[axis].at(cell);
        let mut row = cell.row as isize + offset(0).round() as isize;
        let mut col = cell.col as isize + offset(1).round() as isize;
        if dice.chance(fray) {
            row += dice.range(-1, 1) as isize;
            col += dice.range(-1, 1) as isize;
        }
        free.get(row, col).copied().unwrap_or(false)
    })
}

/// Returns the solid pixels that touch one that is not, in row-major order.
fn faces(solid: &Grid<bool>) -> Vec<Cell> {
    let open = |cell: Cell| neighbors4(cell).into_iter().any(|(row, col)| solid.get(row, col) == Some(&false));
    solid.cells().filter(|cell| solid[*cell] && open(*cell)).collect()
}

/// Returns the cells of a grid around a middle.
fn disc(rows: usize, cols: usize, middle: Cell, radius: f64) -> impl Iterator<Item = Cell> {
    let reach = radius as usize;
    let (top, left) = (middle.row.saturating_sub(reach), middle.col.saturating_sub(reach));
    let (bottom, right) = ((middle.row + reach + 1).min(rows), (middle.col + reach + 1).min(cols));
    let cells = (top..bottom).flat_map(move |row| (left..right).map(move |col| Cell::new(row, col)));
    cells.filter(move |cell| {
        let (down, right) = (cell.row as f64 - middle.row as f64, cell.col as f64 - middle.col as f64);
        down * down + right * right <= radius * radius
    })
}

/// Returns how many things there are that lie so many square meters of walls' surroundings apart, on average.
fn count(faces: &[Cell], pixel: f64, meters: f64, dice: &mut Dice) -> usize {
    (faces.len() as f64 * pixel / meters + dice.real(0.0, 1.0)) as usize
}

/// Repeats walls a little aside, as a scanner that lost its way does.
fn doubled(solid: &mut Grid<bool>, pixel: f64, strength: f64, dice: &mut Dice) {
    let faces = faces(solid);
    let wanted = if strength > 0.15 { count(&faces, pixel, 60.0 / strength, dice) } else { 0 };
    let (rows, cols) = (solid.rows(), solid.cols());
    let is_face = {
        let mut grid = Grid::filled(rows, cols, false);
        faces.iter().for_each(|cell| grid[*cell] = true);
        grid
    };
    for _ in 0..wanted.min(faces.len()) {
        let middle = faces[dice.below(faces.len())];
        let radius = dice.real(0.8, 3.0) / pixel;
        let (length, angle) = (dice.real(0.1, 0.3) / pixel, dice.real(0.0, std::f64::consts::TAU));
        let (down, right) =
            ((length * libm::sin(angle)).round() as isize, (length * libm::cos(angle)).round() as isize);
        for cell in disc(rows, cols, middle, radius) {
            if is_face.get(cell.row as isize - down, cell.col as isize - right) == Some(&true) {
                solid[cell] = true;
            }
        }
    }
}

/// Returns pieces of walls that a scanner looks through.
fn missing(solid: &Grid<bool>, pixel: f64, dice: &mut Dice) -> Grid<bool> {
    let mut glass = Grid::filled(solid.rows(), solid.cols(), false);
    let faces = faces(solid);
    let apart = dice.real(25.0, 150.0);
    for _ in 0..count(&faces, pixel, apart, dice).min(faces.len()) {
        let middle = faces[dice.below(faces.len())];
        let radius = dice.real(0.15, 0.8) / pixel;
        for cell in disc(solid.rows(), solid.cols(), middle, radius) {
            glass[cell] = solid[cell];
        }
    }
    glass
}

/// Looks around from station after station in the largest region, until little of its floor is left unseen.
///
/// Beams end at their range, and between the beams of a coarse scanner far things are missed.
fn looked_at(free: &Grid<bool>, solid: &Grid<bool>, glass: &Grid<bool>, pixel: f64, dice: &mut Dice) -> Grid<bool> {
    let (labels, sizes) = regions(free);
    let most = sizes.iter().copied().max().unwrap_or(0);
    let label = 1 + sizes.iter().position(|size| *size == most).unwrap_or(0) as u32;
    let mut floor: Vec<Cell> = labels.cells().filter(|cell| labels[*cell] == label && !solid[*cell]).collect();
    dice.shuffle(&mut floor);
    let goal = if dice.chance(0.7) { dice.real(0.97, 1.0) } else { dice.real(0.8, 0.97) };
    let wanted = (floor.len() as f64 * goal) as usize;
    let (range, beams) = (dice.real(5.0, 14.0) / pixel, dice.one_of(&[360, 720, 1440, 1440]));
    let mut seen = Grid::filled(free.rows(), free.cols(), false);
    let (mut found, mut next) = (0, 0);
    for _ in 0..MOST_STATIONS {
        // The next place that has not been seen: a robot goes there.
        while next < floor.len() && seen[floor[next]] {
            next += 1;
        }
        if next == floor.len() || found >= wanted {
            break;
        }
        let from = floor[next];
        next += 1;
        for beam in 0..beams {
            let angle = std::f64::consts::TAU * (f64::from(beam) + 0.5) / f64::from(beams);
            found += cast(from, angle, range, [solid, glass], &mut seen, &labels, label);
        }
    }
    seen
}

/// Marks what a beam passes, and returns how many pixels of the region it is the first to see.
fn cast(
    from: Cell,
    angle: f64,
    range: f64,
    [solid, glass]: [&Grid<bool>; 2],
    seen: &mut Grid<bool>,
    labels: &Grid<u32>,
    label: u32,
) -> usize {
    let (sin, cos) = (libm::sin(angle), libm::cos(angle));
    let mut found = 0;
    for step in 0..range as usize {
        let step = step as f64;
        let (row, col) = (from.row as f64 + 0.5 + step * sin, from.col as f64 + 0.5 + step * cos);
        let (row, col) = (row.floor() as isize, col.floor() as isize);
        match solid.get(row, col) {
            None => break,
            Some(true) if glass.get(row, col) != Some(&true) => break,
            Some(_) => {}
        }
        let cell = Cell::new(row as usize, col as usize);
        if !std::mem::replace(&mut seen[cell], true) && labels[cell] == label {
            found += 1;
        }
    }
    found
}

/// What is seen is free; the faces of what is solid beside it are occupied; all else is unknown.
fn shown(solid: &Grid<bool>, glass: &Grid<bool>, seen: &Grid<bool>, dice: &mut Dice) -> Grid<Pixel> {
    let thick = dice.range(1, 2) as isize;
    let beside = |cell: Cell| {
        let reach = -thick..=thick;
        reach.clone().flat_map(|down| reach.clone().map(move |right| (down, right))).any(|(down, right)| {
            let (row, col) = (cell.row as isize + down, cell.col as isize + right);
            seen.get(row, col) == Some(&true) && solid.get(row, col) == Some(&false)
        })
    };
    Grid::from_fn(solid.rows(), solid.cols(), |cell| match (solid[cell], seen[cell]) {
        (false, true) => Pixel::Free,
        (true, true) if glass[cell] => {
            if (cell.row + cell.col) % 3 == 0 {
                Pixel::Unknown
            } else {
                Pixel::Free
            }
        }
        (true, _) if !glass[cell] && beside(cell) => Pixel::Occupied,
        _ => Pixel::Unknown,
    })
}

/// Strews specks over the floor, most of them near walls, and holes into the unknown.
fn specks(shown: &mut Grid<Pixel>, pixel: f64, strength: f64, dice: &mut Dice) {
    let (rows, cols) = (shown.rows(), shown.cols());
    let area = (rows * cols) as f64 * pixel * pixel;
    let dense = strength * dice.real(0.0, 0.25);
    for _ in 0..(area * dense) as usize {
        let mut cell = Cell::new(dice.below(rows), dice.below(cols));
        let kind = if shown[cell] == Pixel::Free { Pixel::Occupied } else { Pixel::Free };
        let unknown = shown[cell] == Pixel::Unknown;
        if shown[cell] == Pixel::Occupied || (unknown && dice.chance(0.8)) {
            continue;
        }
        for _ in 0..dice.range(1, 6) {
            shown[cell] = kind;
            let (row, col) = neighbors4(cell)[dice.below(4)];
            if shown.get(row, col).is_none() {
                break;
            }
            cell = Cell::new(row as usize, col as usize);
        }
    }
}
