//! The YAML of a ROS `map_server` map, and what its pixels mean.
//!
//! After the documentation of `map_server` (ROS 1) and `nav2_map_server` (ROS 2).

use std::fmt;

use serde::Deserialize;
use serde::de::{Deserializer, Error as _, Visitor};
use serde_saphyr::{Location, Spanned};

use super::import::{ImportConfig, MapImportError, Position};
use super::picture::{Pixel, Shade};

/// How gray values are read.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Mode {
    /// Occupied, free or unknown, by two thresholds.
    Trinary,
    /// As [`Mode::Trinary`], with a gradient between the thresholds; transparent pixels are unknown.
    Scale,
    /// The gray value is the occupancy in percent, 101 to 255 are unknown.
    Raw,
}

/// A map's description: the fields of its YAML that matter.
#[derive(Debug, Clone, PartialEq)]
pub struct MapYaml {
    /// Path of the image: absolute, or relative to the folder of the YAML.
    pub image: String,
    /// Edge of a pixel in meters.
    pub resolution: f64,
    /// Pose of the lower left corner of the image: x and y in meters, yaw counter-clockwise in radians.
    pub origin: [f64; 3],
    /// Whether black is free and white occupied.
    pub negate: bool,
    /// Occupancy above which a pixel is occupied.
    pub occupied_thresh: f64,
    /// Occupancy below which a pixel is free.
    pub free_thresh: f64,
    /// How gray values are read.
    pub mode: Mode,
}

/// The YAML as it is written. Fields that others have added are ignored.
#[derive(Deserialize)]
struct Written {
    image: Spanned<String>,
    resolution: Spanned<f64>,
    origin: Spanned<Vec<f64>>,
    #[serde(default)]
    negate: Flag,
    occupied_thresh: Spanned<f64>,
    free_thresh: Spanned<f64>,
    mode: Option<Spanned<String>>,
}

impl MapYaml {
    /// Parses the text of a map's YAML.
    ///
    /// `image`, `resolution`, `origin` and both thresholds are required; `negate` is 0 and `mode` is `trinary` if they
    /// are left out. Fields of other names are ignored, since ROS tools add their own.
    ///
    /// # Errors
    /// [`MapImportError`] with the line and column of what is missing, of another type or out of range.
    pub fn parse(text: &str) -> Result<Self, MapImportError> {
        let options = serde_saphyr::options! { with_snippet: false };
        let written: Written = serde_saphyr::from_str_with_options(text, options).map_err(|error| {
            let at = error.location().and_then(|location| position(&location));
            MapImportError::Yaml { message: message(&error.to_string()), at }
        })?;
        let resolution =
            number("resolution", &written.resolution, "a number of meters above 0 and at most 1000", |value| {
                value > 0.0 && value <= 1000.0
            })?;
        let share = |field, value| number(field, value, "a number from 0 to 1", |value| (0.0..=1.0).contains(&value));
        let occupied = share("occupied_thresh", &written.occupied_thresh)?;
        let free = share("free_thresh", &written.free_thresh)?;
        if occupied < free {
            return Err(MapImportError::Thresholds {
                occupied,
                free,
                at: position(&written.occupied_thresh.referenced),
            });
        }
        if written.image.value.trim().is_empty() {
            return Err(field("image", "the path of a file", &written.image.value, &written.image.referenced));
        }
        Ok(Self {
            origin: origin(&written.origin)?,
            mode: mode(written.mode.as_ref())?,
            image: written.image.value,
            resolution,
            negate: written.negate.0,
            occupied_thresh: occupied,
            free_thresh: free,
        })
    }

    /// Returns the description with the thresholds and the negation that `config` sets instead.
    ///
    /// # Errors
    /// [`MapImportError::Thresholds`] if the two do not fit each other any more.
    pub(super) fn overridden(&self, config: &ImportConfig) -> Result<Self, MapImportError> {
        let yaml = Self {
            occupied_thresh: config.occupied_thresh.unwrap_or(self.occupied_thresh),
            free_thresh: config.free_thresh.unwrap_or(self.free_thresh),
            negate: config.negate.unwrap_or(self.negate),
            ..self.clone()
        };
        if yaml.occupied_thresh < yaml.free_thresh {
            let (occupied, free) = (yaml.occupied_thresh, yaml.free_thresh);
            return Err(MapImportError::Thresholds { occupied, free, at: None });
        }
        Ok(yaml)
    }

    /// Classifies a pixel as `map_server` does, except that the gray value 205 is unknown whatever the thresholds say.
    ///
    /// In trinary mode an alpha channel is averaged in as a fourth color; in scale mode it marks unknown pixels; in raw
    /// mode it is ignored. What lies between the thresholds, the gradient of scale mode included, is unknown. Raw
    /// percentages are held against the same thresholds.
    pub(super) fn pixel(&self, shade: Shade) -> Pixel {
        let transparent = shade.alpha.is_some_and(|alpha| alpha < 255.0);
        if shade.is_unknown() || (self.mode == Mode::Scale && transparent) {
            return Pixel::Unknown;
        }
        let occupancy = match self.mode {
            Mode::Raw if shade.gray > 100.0 => return Pixel::Unknown,
            Mode::Raw => shade.gray / 100.0,
            Mode::Trinary | Mode::Scale => {
                let gray = match shade.alpha {
                    Some(alpha) if self.mode == Mode::Trinary => (3.0 * shade.gray + alpha) / 4.0,
                    _ => shade.gray,
                };
                (if self.negate { gray } else { 255.0 - gray }) / 255.0
            }
        };
        if occupancy > self.occupied_thresh {
            Pixel::Occupied
        } else if occupancy < self.free_thresh {
            Pixel::Free
        } else {
            Pixel::Unknown
        }
    }
}

/// `0`, `1`, `false` or `true`.
#[derive(Default)]
struct Flag(bool);

impl<'de> Deserialize<'de> for Flag {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct FlagVisitor;
        impl Visitor<'_> for FlagVisitor {
            type Value = Flag;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("`negate` to be 0, 1, false or true")
            }

            fn visit_bool<E>(self, value: bool) -> Result<Flag, E> {
                Ok(Flag(value))
            }

            fn visit_u64<E: serde::de::Error>(self, value: u64) -> Result<Flag, E> {
                match value {
                    0 | 1 => Ok(Flag(value == 1)),
                    _ => Err(E::custom(format_args!("`negate` must be 0, 1, false or true, not `{value}`"))),
                }
            }

            fn visit_i64<E: serde::de::Error>(self, value: i64) -> Result<Flag, E> {
                self.visit_u64(u64::try_from(value).unwrap_or(u64::MAX))
            }
        }
        deserializer.deserialize_any(FlagVisitor).map_err(D::Error::custom)
    }
}

fn number(
    name: &'static str,
    written: &Spanned<f64>,
    expected: &'static str,
    in_range: impl Fn(f64) -> bool,
) -> Result<f64, MapImportError> {
    if in_range(written.value) {
        Ok(written.value)
    } else {
        Err(field(name, expected, &written.value.to_string(), &written.referenced))
    }
}

fn origin(written: &Spanned<Vec<f64>>) -> Result<[f64; 3], MapImportError> {
    /// Floor plans lie on Earth, whose circumference this is.
    const FURTHEST: f64 = 4e7;
    match written.value[..] {
        [x, y, yaw] if [x, y, yaw].iter().all(|value| value.abs() <= FURTHEST) => Ok([x, y, yaw]),
        _ => {
            let expected = "three finite numbers, [x, y, yaw]";
            Err(field("origin", expected, &format!("{:?}", written.value), &written.referenced))
        }
    }
}

fn mode(written: Option<&Spanned<String>>) -> Result<Mode, MapImportError> {
    let Some(written) = written else { return Ok(Mode::Trinary) };
    match written.value.as_str() {
        "trinary" => Ok(Mode::Trinary),
        "scale" => Ok(Mode::Scale),
        "raw" => Ok(Mode::Raw),
        other => Err(field("mode", "`trinary`, `scale` or `raw`", other, &written.referenced)),
    }
}

fn field(field: &'static str, expected: &'static str, found: &str, at: &Location) -> MapImportError {
    MapImportError::Field { field, expected, found: found.to_owned(), at: position(at) }
}

fn position(location: &Location) -> Option<Position> {
    let (line, column) = (location.line(), location.column());
    (line > 0).then_some(Position { line, column })
}

/// Drops what is said elsewhere or to programmers: the place behind a message, the names of the parser's options.
fn message(text: &str) -> String {
    let text = text.rsplit_once(" at line ").map_or(text, |(before, _)| before);
    let text = text.split_once(", set ").map_or(text, |(before, _)| before);
    text.split_once("; use ").map_or(text, |(before, _)| before).to_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    const HOUSE: &str = "\
image: map.pgm
resolution: 0.050000
origin: [-12.5, -12, 0.000000]
negate: 0
occupied_thresh: 0.65
free_thresh: 0.196
";

    fn yaml() -> MapYaml {
        MapYaml::parse(HOUSE).expect("a map's description")
    }

    #[test]
    fn a_description_is_read() {
        let expected = MapYaml {
            image: "map.pgm".to_owned(),
            resolution: 0.05,
            origin: [-12.5, -12.0, 0.0],
            negate: false,
            occupied_thresh: 0.65,
            free_thresh: 0.196,
            mode: Mode::Trinary,
        };
        assert_eq!(yaml(), expected);
        let more = HOUSE.replace("negate: 0", "negate: true\nmode: scale\nauthor: { name: x, tags: [1, 2] }");
        let expected = MapYaml { negate: true, mode: Mode::Scale, ..expected };
        assert_eq!(MapYaml::parse(&more).expect("unknown fields are ignored"), expected);
    }

    #[test]
    fn errors_name_field_and_place() {
        let check = |old: &str, new: &str, says: &str, line: u64, column: u64| {
            let error = MapYaml::parse(&HOUSE.replace(old, new)).expect_err(new);
            assert!(error.to_string().contains(says), "{error}");
            assert_eq!(error.position(), Some(Position { line, column }), "{error}");
        };
        check("0.050000", "coarse", "invalid floating point (line 2, column 13)", 2, 13);
        check("0.050000", ".nan", "`resolution` must be a number of meters above 0", 2, 13);
        check("0.050000", "0", "`resolution` must be a number of meters above 0", 2, 13);
        check("0.050000", "-0.05", "not `-0.05`", 2, 13);
        check("0.050000", ".inf", "not `inf`", 2, 13);
        check("-12, 0.000000", "-12", "`origin` must be three finite numbers, [x, y, yaw], not `[-12.5, -12.0]`", 3, 9);
        check("-12, 0.000000", "-12, .nan", "`origin` must be three finite numbers", 3, 9);
        check("[-12.5, -12, 0.000000]", "5", "expected sequence start", 3, 9);
        check("negate: 0", "negate: 3", "`negate` must be 0, 1, false or true, not `3`", 4, 9);
        check("0.65", "1.5", "`occupied_thresh` must be a number from 0 to 1, not `1.5`", 5, 18);
        check("0.65", "0.1", "`occupied_thresh` (0.1) is below `free_thresh` (0.196)", 5, 18);
        check("free_thresh: 0.196", "", "missing field `free_thresh`", 5, 1);
        check("negate: 0", "mode: ternary", "`mode` must be `trinary`, `scale` or `raw`, not `ternary`", 4, 7);
        check("map.pgm", "''", "`image` must be the path of a file", 1, 8);
        check("map.pgm", "[", "expected string scalar", 1, 8);
        check("negate: 0", "image: b.pgm", "duplicate mapping key: image (line", 4, 1);
    }

    fn check(yaml: &MapYaml, gray: f64, alpha: Option<f64>, expected: Pixel) {
        assert_eq!(yaml.pixel(Shade { gray, alpha }), expected, "{gray} {alpha:?} {yaml:?}");
    }

    #[test]
    fn trinary_splits_at_two_thresholds() {
        check(&yaml(), 0.0, None, Pixel::Occupied);
        check(&yaml(), 89.0, None, Pixel::Occupied);
        check(&yaml(), 90.0, None, Pixel::Unknown);
        check(&yaml(), 205.0, None, Pixel::Unknown);
        check(&yaml(), 206.0, None, Pixel::Free);
        let negated = MapYaml { negate: true, ..yaml() };
        check(&negated, 0.0, None, Pixel::Free);
        check(&negated, 255.0, None, Pixel::Occupied);
        // Equal thresholds leave only the value itself unknown.
        let equal = MapYaml { occupied_thresh: 0.4, free_thresh: 0.4, ..yaml() };
        check(&equal, 153.0, None, Pixel::Unknown);
        check(&equal, 154.0, None, Pixel::Free);
        check(&equal, 152.0, None, Pixel::Occupied);
    }

    #[test]
    fn the_gray_of_unknown_space_is_never_free() {
        let loose = MapYaml { free_thresh: 0.25, ..yaml() };
        check(&loose, 204.0, None, Pixel::Free);
        check(&loose, 205.0, None, Pixel::Unknown);
        // Averaged with an opaque alpha it would be 217.5.
        check(&loose, 205.0, Some(255.0), Pixel::Unknown);
    }

    #[test]
    fn alpha_is_a_color_in_trinary_and_a_mask_in_scale() {
        check(&yaml(), 255.0, Some(255.0), Pixel::Free);
        check(&yaml(), 0.0, Some(255.0), Pixel::Occupied);
        check(&yaml(), 255.0, Some(0.0), Pixel::Unknown);
        let scale = MapYaml { mode: Mode::Scale, ..yaml() };
        check(&scale, 255.0, Some(254.0), Pixel::Unknown);
        check(&scale, 255.0, Some(255.0), Pixel::Free);
        check(&scale, 60.0, Some(255.0), Pixel::Occupied);
        check(&scale, 150.0, Some(255.0), Pixel::Unknown);
    }

    #[test]
    fn raw_values_are_percentages() {
        let raw = MapYaml { mode: Mode::Raw, negate: true, ..yaml() };
        check(&raw, 0.0, None, Pixel::Free);
        check(&raw, 19.0, None, Pixel::Free);
        check(&raw, 20.0, None, Pixel::Unknown);
        check(&raw, 66.0, Some(0.0), Pixel::Occupied);
        check(&raw, 100.0, None, Pixel::Occupied);
        check(&raw, 101.0, None, Pixel::Unknown);
        check(&raw, 255.0, None, Pixel::Unknown);
    }

    #[test]
    fn a_configuration_overrides_thresholds() {
        let config = ImportConfig { free_thresh: Some(0.3), negate: Some(true), ..ImportConfig::default() };
        let changed = yaml().overridden(&config).expect("0.3 is below 0.65");
        assert_eq!((changed.free_thresh, changed.negate, changed.occupied_thresh), (0.3, true, 0.65));
        let config = ImportConfig { free_thresh: Some(0.7), ..ImportConfig::default() };
        assert!(yaml().overridden(&config).is_err());
    }
}
