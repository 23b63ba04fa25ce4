//! `generate-map`: furnished homes and offices from a seed.
//!
//! A plan is drawn first: a living zone with wings of rooms along corridors, or the floors of an office, as rectangles
//! on a grid of 0.1 m with doors between them. Then every room gets its furniture, piece by piece; a piece that would
//! cut off a part of the floor or block a door is not placed. Last, the plan is turned, and nooks that no disc of
//! radius 0.2 m comes near are closed, so that all free space is reachable.

mod aisles;
pub mod buildings;
mod dice;
mod finish;
mod furnish;
mod house;
mod office;
mod outline;
mod plan;
mod public;
mod rooms;
mod site;
mod wing;
mod workplace;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use self::dice::Dice;
use self::furnish::Furnisher;
use self::plan::{Plan, Style};
use self::site::Site;
use super::map::OccupancyMap;

/// What kind of building is drawn.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum HomeKind {
    /// A flat or a house: living zone, kitchen, bedrooms, baths.
    #[default]
    Home,
    /// A floor of an office: corridors, offices, open floors, meeting rooms.
    Office,
}

/// What the generated buildings are like.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct HomeConfig {
    /// Homes or offices.
    pub kind: HomeKind,
    /// Least and greatest floor area in m², inner walls included; by default 60 to 160 for homes, 200 to 500 for offices.
    pub area: Option<[f64; 2]>,
    /// Least and greatest width of doors in meters, 0.8 to 1.2.
    pub door_width: [f64; 2],
    /// Share of the usual furniture, 0 (none) to 1.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub furniture: f64,
    /// Share of the buildings whose walls are not aligned with the grid, 0 to 1.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub tilted: f64,
    /// Edge of a cell in meters, 0.02 to 0.1.
    #[schemars(range(min = 0.02, max = 0.1))]
    pub resolution: f64,
}

impl Default for HomeConfig {
    fn default() -> Self {
        Self { kind: HomeKind::Home, area: None, door_width: [0.8, 1.0], furniture: 1.0, tilted: 0.2, resolution: 0.1 }
    }
}

/// A parameter that no building can be drawn with.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[expect(missing_docs, reason = "the messages say what the variants and their fields are")]
pub enum HomeError {
    #[error("`{field}` is {value}, but must lie from {low} to {high}")]
    Range { field: &'static str, value: f64, low: f64, high: f64 },
    #[error("`{field}` is [{}, {}], but the first must not exceed the second{}", .range[0], .range[1], .more)]
    Order { field: &'static str, range: [f64; 2], more: &'static str },
    #[error("`kinds` is empty, but must name at least one kind of building")]
    NoKinds,
    #[error("`area` is [{}, {}], but a {kind} has {low} to {high} m²", .range[0], .range[1])]
    Kind { kind: &'static str, low: f64, high: f64, range: [f64; 2] },
}

impl HomeError {
    /// Checks that all values of a field are in its range.
    fn within(field: &'static str, values: &[f64], low: f64, high: f64) -> Result<(), Self> {
        match values.iter().find(|value| !(low..=high).contains(*value)) {
            Some(value) => Err(Self::Range { field, value: *value, low, high }),
            None => Ok(()),
        }
    }
}

impl HomeConfig {
    /// Checks every number against its range.
    ///
    /// # Errors
    /// [`HomeError`] names the first field that is out of range.
    pub fn check(&self) -> Result<(), HomeError> {
        let (least, most) = match self.kind {
            HomeKind::Home => (50.0, 250.0),
            HomeKind::Office => (150.0, 1000.0),
        };
        HomeError::within("area", &self.areas(), least, most)?;
        HomeError::within("door_width", &self.door_width, 0.8, 1.2)?;
        HomeError::within("furniture", &[self.furniture], 0.0, 1.0)?;
        HomeError::within("tilted", &[self.tilted], 0.0, 1.0)?;
        HomeError::within("resolution", &[self.resolution], 0.02, 0.1)?;
        let [low, high] = self.areas();
        if high < 1.1 * low - 1e-9 {
            let more = " divided by 1.1: rooms come in whole pieces";
            return Err(HomeError::Order { field: "area", range: [low, high], more });
        }
        if self.door_width[1] < self.door_width[0] {
            return Err(HomeError::Order { field: "door_width", range: self.door_width, more: "" });
        }
        Ok(())
    }

    fn areas(&self) -> [f64; 2] {
        self.area.unwrap_or(match self.kind {
            HomeKind::Home => [60.0, 160.0],
            HomeKind::Office => [200.0, 500.0],
        })
    }
}

/// How often a plan is drawn anew before giving up; one in three or four fits.
const ATTEMPTS: usize = 1000;

/// Draws building `number` of a `seed`, its lower left corner at the origin.
///
/// The same arguments give the same cells on every machine. Doors are 0.8 to 1 m wide as configured, passages between
/// furniture at least 0.5 m and from door to door 0.7 m (before tilting); all free cells are connected and lie within
/// 0.3 m of a place where a disc of radius 0.2 m can stand, and such a disc can go from each such place to every other.
///
/// # Panics
/// If the configuration does not pass [`HomeConfig::check`].
#[must_use]
pub fn generate(seed: u64, number: u64, config: &HomeConfig) -> OccupancyMap {
    config.check().expect("the configuration was checked before");
    let purpose = match config.kind {
        HomeKind::Home => "home",
        HomeKind::Office => "office",
    };
    let mut dice = Dice::new(seed, number, purpose);
    let plan = draw(config, &mut dice);
    let legs = if dice.chance(0.25) { 1.0 } else { 0.0 };
    let mut furnisher = Furnisher { site: Site::new(&plan), dice: &mut dice, density: config.furniture, legs };
    rooms::furnish(&plan, &mut furnisher);
    let free = furnisher.site.into_free();
    let tilt = if dice.chance(config.tilted) { dice.real(-0.5, 0.5) } else { 0.0 };
    finish::finish(&free, tilt, config.resolution, &mut dice)
}

/// Draws plans until one fits together and has an area in range.
fn draw(config: &HomeConfig, dice: &mut Dice) -> Plan {
    let [least, most] = config.areas();
    for _ in 0..ATTEMPTS {
        let area = dice.real(least, most);
        let office = config.kind == HomeKind::Office;
        let door = config.door_width.map(|width| (width * 10.0).round() as i32);
        let corridor = if office { dice.range(15, 21) } else { dice.range(11, 15).max(door[0] + 2) };
        let style = Style { wall: if dice.chance(0.7) { 1 } else { 2 }, corridor, door };
        let plan = if office { office::layout(area, style, dice) } else { house::layout(area, style, dice) };
        if let Some(plan) = plan
            && (least..=most).contains(&gross_area(&plan))
            && slenderness(&plan) <= if office { 3.2 } else { 2.0 }
        {
            return plan;
        }
    }
    unreachable!("{ATTEMPTS} plans of {least} to {most} m² did not fit together")
}

/// Measures the floor of a plan with its inner walls, in square meters.
fn gross_area(plan: &Plan) -> f64 {
    let bounds = plan.bounds();
    // Half a wall more on every side joins neighbors.
    let inside = |x, y| plan.rooms.iter().any(|room| room.floor.grown(1).contains(plan::Rect::new(x, y, x + 1, y + 1)));
    bounds.cells().filter(|(x, y)| inside(*x, *y)).count() as f64 * 0.01
}

/// Returns how many times longer than wide a plan is.
fn slenderness(plan: &Plan) -> f64 {
    let (width, height) = (plan.bounds().width(), plan.bounds().height());
    f64::from(width.max(height)) / f64::from(width.min(height))
}

#[cfg(test)]
mod tests;
