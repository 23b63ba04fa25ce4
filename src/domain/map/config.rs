//! How maps are read.

use std::str::FromStr;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::error::MapImportError;
use super::form::{MapForm, PlanForm};
use super::scale_bar::ScaleBar;
use super::unit::Unit;

/// Which of the separate regions of free floor are kept.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(try_from = "Written", into = "Written")]
#[schemars(with = "Written")]
pub enum Region {
    /// The largest one that is not outdoors.
    #[default]
    Largest,
    /// All that are not outdoors.
    All,
    /// The one at a place, x and y in meters in the frame of the map.
    At(f64, f64),
}

/// `largest`, `all`, or the coordinates of a place in the region: `[x, y]` or `"x,y"`, in meters in the frame of the map.
#[derive(Serialize, Deserialize, JsonSchema)]
#[serde(untagged, expecting = "expected `largest`, `all`, or a place in the region, `[x, y]` in meters")]
enum Written {
    Word(String),
    Place([f64; 2]),
}

impl TryFrom<Written> for Region {
    type Error = String;

    fn try_from(written: Written) -> Result<Self, String> {
        match written {
            Written::Word(word) => word.parse(),
            Written::Place([x, y]) if x.is_finite() && y.is_finite() => Ok(Self::At(x, y)),
            Written::Place([x, y]) => Err(no_region(&format!("{x},{y}"))),
        }
    }
}

impl From<Region> for Written {
    fn from(region: Region) -> Self {
        match region {
            Region::Largest => Self::Word("largest".to_owned()),
            Region::All => Self::Word("all".to_owned()),
            Region::At(x, y) => Self::Place([x, y]),
        }
    }
}

impl FromStr for Region {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let number = |text: &str| text.trim().parse().ok().filter(|value: &f64| value.is_finite());
        match text {
            "largest" => Ok(Self::Largest),
            "all" => Ok(Self::All),
            _ => {
                let place = text.split_once(',').and_then(|(x, y)| Some((number(x)?, number(y)?)));
                place.map(|(x, y)| Self::At(x, y)).ok_or_else(|| no_region(text))
            }
        }
    }
}

fn no_region(text: &str) -> String {
    format!("`region` must be `largest`, `all` or `x,y` in meters, not `{text}`")
}

/// How maps are read.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct ImportConfig {
    /// Edge of a cell of the result in meters, 0.01 to 1.
    #[schemars(range(min = 0.01, max = 1.0))]
    pub resolution: f64,
    /// Which of the separate regions of free floor are kept: `largest` (that is not outdoors), `all`, or the one at
    /// `[x, y]`, in meters in the frame of the map.
    pub region: Region,
    /// Edge of a pixel in meters of a plain image, or of a user unit of an SVG drawing, neither of which says anything about its
    /// scale itself, 0.001 to 10.
    #[schemars(range(min = 0.001, max = 10.0))]
    pub image_resolution: Option<f64>,
    /// The same by two points of the picture and their distance: `120,80:620,80=12.5m`, in pixels or user units to the right and down
    /// from the upper left corner.
    pub scale: Option<ScaleBar>,
    /// Brightness from which on a pixel of a plain image is free, as a share of white, 0 to 1; 0.5 if it is left out.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub threshold: Option<f64>,
    /// Occupancy from which on a pixel is occupied, instead of the one in the YAML of a map of ROS, 0 to 1.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub occupied_thresh: Option<f64>,
    /// Occupancy up to which a pixel is free, instead of the one in the YAML of a map of ROS, 0 to 1.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub free_thresh: Option<f64>,
    /// Whether black is free and white occupied, instead of what the YAML of a map of ROS says; plain images take it too.
    pub negate: Option<bool>,
    /// Number of the floor of an iGibson scene; 0 if it is left out, or the only one there is.
    pub floor: Option<u32>,
    /// Name of the level of a building of Open-RMF; may be left out where there is only one.
    pub level: Option<String>,
    /// How thick the walls of a building of Open-RMF or of a DXF drawing are in meters, 0.01 to 2; 0.1 if it is left out, as Open-RMF's own tools
    /// build them. In an SVG drawing it replaces the width of lines.
    #[schemars(range(min = 0.01, max = 2.0))]
    pub wall_thickness: Option<f64>,
    /// The unit of the coordinates of WKT, `m` if it is left out, of GeoJSON, which is degrees by its standard and must be
    /// told, of a DXF drawing, instead of what its header says, and of an SVG drawing in its own size: `m`, `cm`, `mm`, `in` or `ft`.
    pub unit: Option<Unit>,
    /// The layers of a DXF drawing whose lines are walls, or the layers, groups, classes or colors (`#rrggbb`) of walls in an SVG
    /// drawing; `*` stands for any letters, `?` for one, capitals are no others.
    pub walls: Option<Vec<String>>,
    /// The same of the straight lines that lie in doors, which stand open.
    pub doors: Option<Vec<String>>,
}

impl Default for ImportConfig {
    fn default() -> Self {
        Self {
            resolution: 0.1,
            region: Region::Largest,
            image_resolution: None,
            scale: None,
            threshold: None,
            occupied_thresh: None,
            free_thresh: None,
            negate: None,
            floor: None,
            level: None,
            wall_thickness: None,
            unit: None,
            walls: None,
            doors: None,
        }
    }
}

impl ImportConfig {
    /// Brightness from which on a pixel of a plain image is free, unless another is set.
    pub const THRESHOLD: f64 = 0.5;
    /// How thick walls are that a plan draws as lines, unless something else is set, in meters: what Open-RMF's tools take.
    pub const WALL_THICKNESS: f64 = 0.1;

    /// Checks every number against its range.
    ///
    /// # Errors
    /// [`MapImportError::Parameter`] names the first field that is out of range.
    pub fn check(&self) -> Result<(), MapImportError> {
        let within = |field, value: f64, low: f64, high: f64| {
            if value >= low && value <= high {
                Ok(())
            } else {
                Err(MapImportError::Parameter { field, value, low, high })
            }
        };
        within("resolution", self.resolution, 0.01, 1.0)?;
        within("image_resolution", self.image_resolution.unwrap_or(1.0), 0.001, 10.0)?;
        within("scale", self.scale.map_or(1.0, |scale| scale.pixel()), 0.001, 10.0)?;
        within("threshold", self.threshold.unwrap_or(0.0), 0.0, 1.0)?;
        within("occupied_thresh", self.occupied_thresh.unwrap_or(0.0), 0.0, 1.0)?;
        within("free_thresh", self.free_thresh.unwrap_or(0.0), 0.0, 1.0)?;
        within("wall_thickness", self.wall_thickness.unwrap_or(1.0), 0.01, 2.0)?;
        if self.image_resolution.is_some() && self.scale.is_some() {
            return Err(MapImportError::TwoScales);
        }
        match (self.occupied_thresh, self.free_thresh) {
            (Some(occupied), Some(free)) if occupied < free => {
                Err(MapImportError::Thresholds { occupied, free, at: None })
            }
            _ => Ok(()),
        }
    }

    /// Returns the edge of a pixel of a plain image in meters, if it is told.
    #[must_use]
    pub fn pixel(&self) -> Option<f64> {
        self.image_resolution.or_else(|| self.scale.map(|scale| scale.pixel()))
    }

    /// Returns the fields that are set although maps of this form have no use for them.
    #[must_use]
    pub fn unfit(&self, form: MapForm) -> Vec<&'static str> {
        use MapForm::{Igibson, Image, Ros};
        const BUILDING: MapForm = MapForm::Plan(PlanForm::Building);
        const DXF: MapForm = MapForm::Plan(PlanForm::Dxf);
        const SVG: MapForm = MapForm::Plan(PlanForm::Svg);
        const IN_UNITS: [MapForm; 4] = [MapForm::Plan(PlanForm::Wkt), MapForm::Plan(PlanForm::GeoJson), DXF, SVG];
        let fields: [(&str, bool, &[MapForm]); 12] = [
            ("image_resolution", self.image_resolution.is_some(), &[Image, SVG]),
            ("scale", self.scale.is_some(), &[Image, SVG]),
            ("threshold", self.threshold.is_some(), &[Image]),
            ("occupied_thresh", self.occupied_thresh.is_some(), &[Ros]),
            ("free_thresh", self.free_thresh.is_some(), &[Ros]),
            ("negate", self.negate.is_some(), &[Ros, Image]),
            ("floor", self.floor.is_some(), &[Igibson]),
            ("level", self.level.is_some(), &[BUILDING]),
            ("wall_thickness", self.wall_thickness.is_some(), &[BUILDING, DXF, SVG]),
            ("unit", self.unit.is_some(), &IN_UNITS),
            ("walls", self.walls.is_some(), &[DXF, SVG]),
            ("doors", self.doors.is_some(), &[DXF, SVG]),
        ];
        fields.into_iter().filter(|(_, set, forms)| *set && !forms.contains(&form)).map(|(name, ..)| name).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parameters_out_of_range_are_named() {
        let check = |config: ImportConfig, field: &str| {
            let error = config.check().expect_err(field).to_string();
            assert!(error.contains(&format!("`{field}`")), "{error}");
        };
        let plain = || ImportConfig { image_resolution: Some(0.1), ..ImportConfig::default() };
        check(ImportConfig { resolution: f64::NAN, ..plain() }, "resolution");
        check(ImportConfig { resolution: 0.0, ..plain() }, "resolution");
        check(ImportConfig { image_resolution: Some(-1.0), ..plain() }, "image_resolution");
        check(ImportConfig { scale: "0,0:1,0=11m".parse().ok(), image_resolution: None, ..plain() }, "scale");
        check(ImportConfig { scale: "0,0:1,0=1m".parse().ok(), ..plain() }, "scale");
        check(ImportConfig { threshold: Some(1.5), ..plain() }, "threshold");
        check(ImportConfig { free_thresh: Some(f64::INFINITY), ..plain() }, "free_thresh");
        check(ImportConfig { wall_thickness: Some(0.0), ..plain() }, "wall_thickness");
        check(ImportConfig { free_thresh: Some(0.5), occupied_thresh: Some(0.4), ..plain() }, "occupied_thresh");
        ImportConfig::default().check().expect("the defaults are in range");
    }

    #[test]
    fn a_region_is_a_word_or_a_place() {
        let check = |json: &str, expected: Option<Region>| {
            let found: Result<Region, _> = serde_json::from_str(json);
            assert_eq!(found.as_ref().ok(), expected.as_ref(), "{json}: {found:?}");
            if let Some(region) = expected {
                let again = serde_json::to_string(&region).expect("is JSON");
                assert_eq!(serde_json::from_str::<Region>(&again).expect("reads back"), region);
            }
        };
        check("\"largest\"", Some(Region::Largest));
        check("\"all\"", Some(Region::All));
        check("[1, -2.5]", Some(Region::At(1.0, -2.5)));
        check("\"1, -2.5\"", Some(Region::At(1.0, -2.5)));
        for wrong in ["\"biggest\"", "\"1\"", "\"1,2,3\"", "\"nan,0\"", "[1]", "[1, 2, 3]", "7", "null"] {
            check(wrong, None);
        }
    }

    #[test]
    fn what_does_not_fit_the_form_is_named() {
        use MapForm::{Igibson, Image, Ros};
        const BUILDING: MapForm = MapForm::Plan(PlanForm::Building);
        const WKT: MapForm = MapForm::Plan(PlanForm::Wkt);
        const DXF: MapForm = MapForm::Plan(PlanForm::Dxf);
        const SVG: MapForm = MapForm::Plan(PlanForm::Svg);
        let check = |config: ImportConfig, fits: &[MapForm]| {
            for form in [Ros, Image, Igibson, BUILDING, WKT, DXF, SVG] {
                assert_eq!(config.unfit(form).is_empty(), fits.contains(&form), "{form}: {config:?}");
            }
        };
        let none = ImportConfig::default;
        check(
            ImportConfig { resolution: 0.2, region: Region::All, ..none() },
            &[Ros, Image, Igibson, BUILDING, WKT, DXF, SVG],
        );
        check(ImportConfig { image_resolution: Some(0.1), ..none() }, &[Image, SVG]);
        check(ImportConfig { scale: "0,0:1,0=1m".parse().ok(), ..none() }, &[Image, SVG]);
        check(ImportConfig { threshold: Some(0.5), ..none() }, &[Image]);
        check(ImportConfig { occupied_thresh: Some(0.5), ..none() }, &[Ros]);
        check(ImportConfig { free_thresh: Some(0.5), ..none() }, &[Ros]);
        check(ImportConfig { negate: Some(false), ..none() }, &[Ros, Image]);
        check(ImportConfig { floor: Some(0), ..none() }, &[Igibson]);
        check(ImportConfig { level: Some("L1".to_owned()), ..none() }, &[BUILDING]);
        check(ImportConfig { wall_thickness: Some(0.2), ..none() }, &[BUILDING, DXF, SVG]);
        check(ImportConfig { unit: Some(Unit::Meter), ..none() }, &[WKT, DXF, SVG]);
        check(ImportConfig { walls: Some(vec![]), ..none() }, &[DXF, SVG]);
        check(ImportConfig { doors: Some(vec![]), ..none() }, &[DXF, SVG]);
    }
}
