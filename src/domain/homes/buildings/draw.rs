//! One building from its number: plan, furniture, pose, scan.

use super::super::dice::Dice;
use super::super::furnish::Furnisher;
use super::super::plan::{Plan, Purpose, Style};
use super::super::site::Site;
use super::super::{gross_area, house, office, public, rooms};
use super::config::{BuildingConfig, BuildingKind};
use super::pose::{Pose, pixels};
use super::rows::{BACK_ROOMS, Floor, OFFICE, SCHOOL, WARD};
use super::{circuits, halls, relief, scan, streets};
use crate::domain::geometry::{Frame, Grid};
use crate::domain::map::{Observed, OccupancyMap, Pixel, regions, resample};

/// How often a plan is drawn anew before giving up.
const ATTEMPTS: usize = 2000;
/// The largest edge of a pixel that maps are made from, in meters.
const PIXEL: f64 = 0.05;

/// Draws building `number` of a `seed`, its lower left corner at the origin.
///
/// The same arguments give the same cells on every machine. Doors are 0.8 to 2.5 m wide before scaling; what is free is
/// the largest connected region of the floor, cropped to a margin of one cell.
///
/// # Panics
/// If the configuration does not pass [`BuildingConfig::check`].
#[must_use]
pub fn generate_building(seed: u64, number: u64, config: &BuildingConfig) -> OccupancyMap {
    config.check().expect("the configuration was checked before");
    let kind = config.kinds[(number % config.kinds.len() as u64) as usize];
    let dice = |purpose: &str| Dice::new(seed, number, &format!("building {} {purpose}", kind.name()));
    let (mut plan, partition) = draw(kind, config, &mut dice("plan"));
    relief::recesses(&mut plan, &mut dice("relief"));
    let drawing = furnished(&plan, config.furniture, &mut dice("furniture")).into_drawing();
    let pose = pose(config, partition, &mut dice("pose"));
    let pixel = PIXEL.min(config.resolution);
    let free = pixels(&drawing, pose, pixel);
    let clean = cells(&free.map(|free| if *free { Pixel::Free } else { Pixel::Occupied }), pixel, config.resolution);
    let mut dice = dice("scan");
    let seen = dice.chance(config.scan).then(|| cells(&scan::scan(&free, pixel, &mut dice), pixel, config.resolution));
    cropped(&clean, seen.as_ref().unwrap_or(&clean), config.resolution)
}

fn cells(pixels: &Grid<Pixel>, pixel: f64, resolution: f64) -> Grid<Observed> {
    let frame = Frame::at_zero(pixel, pixels.rows(), pixels.cols());
    resample(pixels, &frame, resolution).expect("a building is far below the limit").0
}

/// Keeps the largest free region and what is observed in its bounds.
fn cropped(clean: &Grid<Observed>, seen: &Grid<Observed>, resolution: f64) -> OccupancyMap {
    let (labels, sizes) = regions(&clean.map(|cell| *cell == Observed::Free));
    let most = sizes.iter().copied().max().expect("a building has free floor");
    let label = 1 + sizes.iter().position(|size| *size == most).expect("the maximum is one of them") as u32;
    let (mut top, mut bottom, mut left, mut right) = (labels.rows(), 0, labels.cols(), 0);
    for cell in labels.cells().filter(|cell| labels[*cell] == label) {
        (top, bottom) = (top.min(cell.row), bottom.max(cell.row));
        (left, right) = (left.min(cell.col), right.max(cell.col));
    }
    let (rows, cols) = (bottom - top + 3, right - left + 3);
    let at = |row: usize, col: usize| ((top + row) as isize - 1, (left + col) as isize - 1);
    let free = Grid::from_fn(rows, cols, |cell| {
        let (row, col) = at(cell.row, cell.col);
        labels.get(row, col) == Some(&label)
    });
    let observed = Grid::from_fn(rows, cols, |cell| {
        let (row, col) = at(cell.row, cell.col);
        seen.get(row, col).copied().unwrap_or(Observed::Occupied)
    });
    let map = OccupancyMap::new(free, Frame::at_zero(resolution, rows, cols)).expect("the largest region has cells");
    map.with_observed(observed).expect("both were cut alike")
}

/// Draws plans until one fits together and has an area in range; returns it with the thickness of its partitions.
pub(super) fn draw(kind: BuildingKind, config: &BuildingConfig, dice: &mut Dice) -> (Plan, i32) {
    let [least, most] = config.areas(kind);
    for _ in 0..ATTEMPTS {
        let area = libm::exp(dice.real(libm::log(least), libm::log(most)));
        let partition = dice.one_of(&[1, 1, 2, 2]);
        let bearing = dice.range(partition, 3);
        if let Some(plan) = layout(kind, area, [partition, bearing], config.circuits, dice)
            && (least..=most).contains(&gross_area(&plan))
        {
            return (plan, partition);
        }
    }
    unreachable!("{ATTEMPTS} plans of {least} to {most} m² did not fit together")
}

fn layout(kind: BuildingKind, area: f64, [partition, bearing]: [i32; 2], share: f64, dice: &mut Dice) -> Option<Plan> {
    let manner = match kind {
        BuildingKind::Home | BuildingKind::Office | BuildingKind::Hall => OFFICE,
        BuildingKind::Ward => WARD,
        BuildingKind::School => SCHOOL,
        BuildingKind::Shop | BuildingKind::Warehouse => BACK_ROOMS,
    };
    let plan = match kind {
        BuildingKind::Home => Some(house::layout(area, style(dice.range(11, 16), partition), dice)?),
        BuildingKind::Office if area < 1000.0 && dice.chance(0.3) => {
            Some(office::layout(area, style(dice.range(14, 22), partition), dice)?)
        }
        _ => None,
    };
    let drawn = plan.is_some();
    let mut floor = Floor { plan: plan.unwrap_or_default(), manner, partition, bearing, dice };
    if !drawn {
        fill(&mut floor, kind, area)?;
    }
    circuits::add(&mut floor, share);
    let plan = floor.plan;
    (plan.is_connected() && !plan.overlaps()).then_some(plan)
}

fn style(corridor: i32, wall: i32) -> Style {
    Style { wall, corridor, door: [8, 10] }
}

fn fill(floor: &mut Floor<'_>, kind: BuildingKind, area: f64) -> Option<()> {
    match kind {
        BuildingKind::Shop => halls::layout(floor, Purpose::Shop, area),
        BuildingKind::Warehouse => halls::layout(floor, Purpose::Depot, area),
        BuildingKind::Hall => {
            let purpose = floor.dice.one_of(&[Purpose::Lobby, Purpose::Lobby, Purpose::Hall, Purpose::Canteen]);
            halls::layout(floor, purpose, area)
        }
        _ => streets::layout(floor, area),
    }
}

/// Furnishes a plan, space by space: what is built in first, small things last.
fn furnished(plan: &Plan, furniture: f64, dice: &mut Dice) -> Site {
    let (legs, litter) = (dice.real(0.0, 1.0), dice.real(0.0, 1.0));
    let (leaf, density) = (dice.real(0.0, 0.8), furniture * dice.real(0.75, 1.0));
    let leaves = relief::leaves(plan, leaf, dice);
    let mut f = Furnisher { site: Site::new(plan), dice, density, legs };
    let spaces = plan.rooms.iter().map(|room| room.space).max().map_or(0, |last| last + 1);
    for space in 0..spaces {
        let rooms = || plan.rooms.iter().filter(|room| room.space == space);
        if rooms().all(|room| room.purpose == Purpose::Shaft) {
            continue;
        }
        f.site.enter(plan, space);
        relief::hang(plan, space, &leaves, &mut f);
        rooms().for_each(|room| relief::walls(room.floor, room.purpose, &mut f));
        rooms().for_each(|room| rooms::furnish_room(room, &mut f));
        for room in rooms().filter(|room| room.floor.area() > 400) {
            if room.purpose == Purpose::Corridor {
                public::carts(&mut f, room.floor, room.floor.area() / 2500);
            }
            // Squared: most buildings are tidy, some are not.
            public::clutter(&mut f, room.floor, 14.0 * litter * litter * furniture);
        }
    }
    f.site
}

fn pose(config: &BuildingConfig, partition: i32, dice: &mut Dice) -> Pose {
    let angle = if dice.chance(config.turned) {
        dice.real(0.0, std::f64::consts::TAU)
    } else {
        f64::from(dice.range(0, 3)) * std::f64::consts::FRAC_PI_2
    };
    // Walls of two cells and more may be thinner: 0.15 m and 0.25 m instead of 0.2 m and 0.3 m.
    let skin = if partition > 1 && dice.chance(0.5) { 0.25 } else { 0.0 };
    Pose { angle, scale: dice.real(config.scale[0], config.scale[1]), mirrored: dice.chance(0.5), skin }
}
