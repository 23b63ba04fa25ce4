//! Floors of corridors: one between two rows of rooms, or several that cross, with rooms, halls and light wells in the
//! blocks between them.

use super::super::plan::{Purpose, Rect};
use super::rows::Floor;

/// The largest share of its length that a row may be shorter than the building.
const NOTCH: i32 = 3;

/// Draws the corridors and rooms of a floor of about `area` square meters; `None` if the pieces do not fit together.
pub(super) fn layout(floor: &mut Floor<'_>, area: f64) -> Option<()> {
    let bands = Bands::draw(floor, area);
    let width = (area * 100.0 / f64::from(bands.height)) as i32;
    let (least, most) = if bands.cores.is_empty() { (7, 50) } else { (8, 32) };
    if 10 * width < least * bands.height || 10 * width > most * bands.height || width < 90 {
        return None;
    }
    if bands.cores.is_empty() { single(floor, &bands, width) } else { crossing(floor, &bands, width) }
}

/// The floor from its upper to its lower side.
struct Bands {
    corridor: i32,
    /// Depth of the rows of rooms at the upper and lower side; 0 is a corridor with windows.
    facades: [i32; 2],
    /// Depth of what lies between two corridors.
    cores: Vec<i32>,
    height: i32,
}

impl Bands {
    fn draw(floor: &mut Floor<'_>, area: f64) -> Self {
        let range = |floor: &mut Floor<'_>, [low, high]: [i32; 2]| floor.dice.range(low, high);
        let manner = floor.manner;
        let corridors = match area {
            ..320.0 => 1,
            ..800.0 => floor.dice.one_of(&[1, 2, 2]),
            ..1600.0 => floor.dice.one_of(&[2, 2, 3]),
            _ => floor.dice.one_of(&[2, 3, 3, 4]),
        };
        let corridor = range(floor, manner.corridor);
        let mut facades = [range(floor, manner.facade), range(floor, manner.facade)];
        if floor.dice.chance(0.12) {
            facades[floor.dice.below(2)] = 0;
        }
        let cores: Vec<i32> = (1..corridors).map(|_| range(floor, manner.core)).collect();
        let wall = floor.bearing;
        let rows: i32 = facades.iter().map(|depth| if *depth > 0 { depth + wall } else { 0 }).sum();
        let height = rows + cores.iter().map(|core| core + 2 * wall).sum::<i32>() + corridors * corridor;
        Self { corridor, facades, cores, height }
    }
}

/// One corridor between two rows of rooms, with a hall at its end or not.
fn single(floor: &mut Floor<'_>, bands: &Bands, width: i32) -> Option<()> {
    let end = if floor.dice.chance(0.6) { floor.dice.range(50, 110).min(width / 3) } else { 0 };
    let wall = floor.bearing;
    let length = if end > 0 { width - end - wall } else { width };
    let hall = floor.plan.add(Rect::new(0, 0, length, bands.corridor), Purpose::Corridor);
    facades(floor, bands, [hall, hall], [0, length])?;
    if end > 0 {
        let above = if bands.facades[0] > 0 { -wall - bands.facades[0] } else { 0 };
        let below = bands.corridor + if bands.facades[1] > 0 { wall + bands.facades[1] } else { 0 };
        let rect = Rect::new(length + wall, above, width, below);
        let open = floor.dice.chance(0.5);
        end_hall(floor, rect, &[hall], open)?;
    }
    Some(())
}

/// Rows of rooms along the first and the last corridor; each may be shorter than the building.
fn facades(floor: &mut Floor<'_>, bands: &Bands, halls: [usize; 2], [left, right]: [i32; 2]) -> Option<()> {
    let (top, bottom) = (floor.plan.rooms[halls[0]].floor.top, floor.plan.rooms[halls[1]].floor.bottom);
    let wall = floor.bearing;
    let spans = [
        (bands.facades[0], top - wall - bands.facades[0], top - wall),
        (bands.facades[1], bottom + wall, bottom + wall + bands.facades[1]),
    ];
    for ((depth, from, to), hall) in spans.into_iter().zip(halls) {
        if depth == 0 {
            continue;
        }
        let (mut first, mut last) = (left, right);
        if floor.dice.chance(0.35) {
            let notch = floor.dice.range(20, ((right - left) / NOTCH).max(20));
            if floor.dice.chance(0.5) { first += notch } else { last -= notch }
        }
        floor.row(Rect::new(first, from, last, to), false, &[hall])?;
    }
    Some(())
}

/// Several corridors along the building and others across, which make rings.
fn crossing(floor: &mut Floor<'_>, bands: &Bands, width: i32) -> Option<()> {
    let (wall, corridor) = (floor.bearing, bands.corridor);
    // At the ends may be one more column of rooms, or a hall.
    let ends = [0, 1].map(|_| {
        let [low, high] = floor.manner.facade;
        if floor.dice.chance(0.45) { floor.dice.range(low, high + 40) } else { 0 }
    });
    let [left, right] = [ends[0], ends[1]].map(|depth| if depth > 0 { depth + wall } else { 0 });
    let (left, right) = (left, width - right);
    if right - left < 2 * corridor + 80 {
        return None;
    }
    let mut tops = vec![0];
    for core in &bands.cores {
        tops.push(tops[tops.len() - 1] + corridor + core + 2 * wall);
    }
    let along = |top: i32| Rect::new(left, top, right, top + corridor);
    let first = floor.plan.add(along(0), Purpose::Corridor);
    let mut halls = vec![first];
    for top in &tops[1..] {
        halls.push(floor.plan.add_open(along(*top), Purpose::Corridor, first));
    }
    let stations = stations(floor, left, right, corridor);
    for (band, core) in bands.cores.iter().enumerate() {
        let (top, bottom) = (tops[band] + corridor, tops[band] + corridor + core + 2 * wall);
        block_band(floor, &stations, [top, bottom], [halls[band], halls[band + 1]])?;
    }
    facades(floor, bands, [first, halls[halls.len() - 1]], [left, right])?;
    let (top, bottom) = (0, tops[tops.len() - 1] + corridor);
    let columns = [Rect::new(0, top, ends[0], bottom), Rect::new(right + wall, top, width, bottom)];
    for (column, depth) in columns.into_iter().zip(ends) {
        if depth == 0 {
            continue;
        }
        let beside: Vec<usize> = (0..floor.plan.rooms.len())
            .filter(|room| floor.plan.rooms[*room].space == floor.plan.rooms[first].space)
            .filter(|room| floor.plan.rooms[*room].floor.intersects(column.grown(wall + 1)))
            .collect();
        if floor.dice.chance(0.5) {
            let open = floor.dice.chance(0.3);
            end_hall(floor, column, &beside, open)?;
        } else {
            floor.row(column, true, &beside)?;
        }
    }
    Some(())
}

/// Draws where corridors cross the building: at both ends, and in between.
fn stations(floor: &mut Floor<'_>, left: i32, right: i32, corridor: i32) -> Vec<i32> {
    let length = right - left;
    let inner = length / floor.dice.range(140, 320);
    let mut stations = vec![left];
    for at in 1..=inner {
        let middle = left + length * at / (inner + 1) - corridor / 2;
        stations.push(middle + floor.dice.range(-20, 20));
    }
    stations.push(right - corridor);
    stations
}

/// Fills what lies between two corridors: others that cross, and blocks between these.
fn block_band(floor: &mut Floor<'_>, stations: &[i32], [top, bottom]: [i32; 2], halls: [usize; 2]) -> Option<()> {
    let (wall, last) = (floor.bearing, stations.len() - 1);
    let corridor = floor.plan.rooms[halls[0]].floor.height();
    let mut from = stations[0];
    for (at, station) in stations.iter().enumerate() {
        // The outer ones close the ring; of the others some are missing.
        if at > 0 && at < last && floor.dice.chance(0.3) {
            continue;
        }
        if at > 0 {
            let block = Rect::new(from + wall, top + wall, station - wall, bottom - wall);
            fill_block(floor, block, halls)?;
        }
        let crossing = Rect::new(*station, top, station + corridor, bottom);
        floor.plan.add_open(crossing, Purpose::Corridor, halls[0]);
        from = station + corridor;
    }
    Some(())
}

/// Makes rooms, a hall or a light well of a block between two corridors.
fn fill_block(floor: &mut Floor<'_>, block: Rect, halls: [usize; 2]) -> Option<()> {
    let (wall, hall) = (floor.bearing, floor.manner.hall);
    if block.width() < 30 {
        return Some(());
    }
    if floor.dice.chance(floor.manner.halls) {
        if block.width() > 160 {
            // The hall takes a part of the block, rooms the rest.
            let cut = block.left + block.width() * floor.dice.range(35, 65) / 100;
            let rest = Rect { left: cut + wall, ..block };
            fill_hall(floor, Rect { right: cut, ..block }, hall, halls)?;
            return fill_rows(floor, rest, halls);
        }
        return fill_hall(floor, block, hall, halls);
    }
    if floor.dice.chance(0.08) {
        // A light well, or lifts and stairs.
        return Some(());
    }
    fill_rows(floor, block, halls)
}

fn fill_hall(floor: &mut Floor<'_>, block: Rect, purpose: Purpose, halls: [usize; 2]) -> Option<()> {
    let wall = floor.bearing;
    match floor.dice.below(3) {
        // Open to both corridors.
        0 => {
            let rect = Rect { top: block.top - wall, bottom: block.bottom + wall, ..block };
            floor.plan.add_open(rect, purpose, halls[0]);
        }
        // Open to one of them, and by a door or none to the other.
        1 => {
            let rect = Rect { top: block.top - wall, ..block };
            let hall = floor.plan.add_open(rect, purpose, halls[0]);
            let width = floor.dice.range(10, 25);
            floor.open(hall, halls[1], width);
        }
        _ => {
            let hall = floor.plan.add(block, purpose);
            for side in halls {
                let width = floor.dice.range(12, 25);
                floor.open(hall, side, width).then_some(())?;
            }
        }
    }
    Some(())
}

fn fill_rows(floor: &mut Floor<'_>, block: Rect, halls: [usize; 2]) -> Option<()> {
    let [least, _] = floor.manner.facade;
    let wall = floor.partition;
    if block.height() >= 2 * (least - 8) + wall {
        let middle = block.top + block.height() * floor.dice.range(44, 56) / 100;
        floor.row(Rect { bottom: middle, ..block }, false, &halls[..1])?;
        floor.row(Rect { top: middle + wall, ..block }, false, &halls[1..])
    } else {
        floor.row(block, false, &halls)
    }
}

/// Adds a hall at the end of corridors: without walls towards one of them, or with wide doors.
fn end_hall(floor: &mut Floor<'_>, rect: Rect, halls: &[usize], open: bool) -> Option<()> {
    let purpose =
        if floor.dice.chance(0.6) { floor.manner.hall } else { floor.dice.one_of(&[Purpose::Canteen, Purpose::Hall]) };
    let hall = floor.plan.add(rect, purpose);
    let mut doors = 0;
    for other in halls {
        let beside = floor.plan.rooms[*other].floor;
        let most = beside.height().min(beside.width()) - 2;
        let width = if open { most } else { floor.dice.range(12, 25).min(most) };
        doors += usize::from(floor.open(hall, *other, width));
    }
    (doors > 0).then_some(())
}
