//! Which buildings are drawn, and how they are shown.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::super::HomeError;

/// What a building is for.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum BuildingKind {
    /// A flat or a house with circuits, 50 to 250 m².
    Home,
    /// Offices along one corridor or rings of them, 150 to 2,500 m².
    Office,
    /// Patients' rooms with baths along wide corridors, 250 to 3,000 m².
    Ward,
    /// Classrooms, 350 to 3,000 m².
    School,
    /// Shelves with aisles, tills and back rooms, 50 to 1,500 m².
    Shop,
    /// Racks and open floor, 100 to 3,000 m².
    Warehouse,
    /// A lobby, a canteen, a hall with columns, 60 to 2,000 m².
    Hall,
}

impl BuildingKind {
    const ALL: [Self; 7] =
        [Self::Home, Self::Office, Self::Ward, Self::Shop, Self::School, Self::Hall, Self::Warehouse];

    /// Returns the least and the greatest area in m² that it is drawn with.
    #[must_use]
    pub const fn areas(self) -> [f64; 2] {
        match self {
            Self::Home => [50.0, 250.0],
            Self::Office => [150.0, 2500.0],
            Self::Ward => [250.0, 3000.0],
            Self::School => [350.0, 3000.0],
            Self::Shop => [50.0, 1500.0],
            Self::Warehouse => [100.0, 3000.0],
            Self::Hall => [60.0, 2000.0],
        }
    }

    pub(super) const fn name(self) -> &'static str {
        match self {
            Self::Home => "home",
            Self::Office => "office",
            Self::Ward => "ward",
            Self::School => "school",
            Self::Shop => "shop",
            Self::Warehouse => "warehouse",
            Self::Hall => "hall",
        }
    }
}

/// What generated buildings are like.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct BuildingConfig {
    /// What they are for; building `n` is of the kind at place `n` of this list, which is gone through again and again.
    pub kinds: Vec<BuildingKind>,
    /// Least and greatest floor area in m² before scaling, inner walls included; each kind keeps to the part of this range
    /// that is its own. Small buildings are as likely as large ones: the logarithm is drawn evenly.
    pub area: [f64; 2],
    /// Share of the usual furniture, 0 (none) to 1.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub furniture: f64,
    /// Share of the usual second doors, which make circuits, 0 (none) to 1.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub circuits: f64,
    /// Share of the buildings that are turned by any angle instead of none, 0 to 1.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub turned: f64,
    /// Least and greatest factor by which a building is made larger than life, 0.8 to 1.25.
    pub scale: [f64; 2],
    /// Share of the buildings that are observed as a scan shows them, with jagged, doubled and missing walls, specks and
    /// space that nobody has looked at, 0 to 1. Where people walk stays clean.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub scan: f64,
    /// Edge of a cell in meters, 0.02 to 0.1.
    #[schemars(range(min = 0.02, max = 0.1))]
    pub resolution: f64,
}

impl Default for BuildingConfig {
    fn default() -> Self {
        Self {
            kinds: BuildingKind::ALL.to_vec(),
            area: [50.0, 1200.0],
            furniture: 1.0,
            circuits: 1.0,
            turned: 0.4,
            scale: [0.9, 1.15],
            scan: 0.5,
            resolution: 0.1,
        }
    }
}

impl BuildingConfig {
    /// Checks every number against its range.
    ///
    /// # Errors
    /// [`HomeError`] names the first field that is out of range.
    pub fn check(&self) -> Result<(), HomeError> {
        HomeError::within("area", &self.area, 50.0, 3000.0)?;
        HomeError::within("furniture", &[self.furniture], 0.0, 1.0)?;
        HomeError::within("circuits", &[self.circuits], 0.0, 1.0)?;
        HomeError::within("turned", &[self.turned], 0.0, 1.0)?;
        HomeError::within("scale", &self.scale, 0.8, 1.25)?;
        HomeError::within("scan", &[self.scan], 0.0, 1.0)?;
        HomeError::within("resolution", &[self.resolution], 0.02, 0.1)?;
        for (field, range) in [("area", self.area), ("scale", self.scale)] {
            if range[1] < range[0] {
                return Err(HomeError::Order { field, range, more: "" });
            }
        }
        if self.kinds.is_empty() {
            return Err(HomeError::NoKinds);
        }
        for kind in &self.kinds {
            let [low, high] = self.areas(*kind);
            if high < 1.2 * low {
                let [low, high] = kind.areas();
                return Err(HomeError::Kind { kind: kind.name(), low, high, range: self.area });
            }
        }
        Ok(())
    }

    /// Returns the least and the greatest area of a kind in m².
    pub(super) const fn areas(&self, kind: BuildingKind) -> [f64; 2] {
        let [low, high] = kind.areas();
        [self.area[0].max(low), self.area[1].min(high)]
    }
}
