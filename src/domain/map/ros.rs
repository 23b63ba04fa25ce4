//! The YAML of a ROS `map_server` map, and what its pixels mean.
//!
//! As `nav2_map_server` reads them (ROS 2), but for one thing: the gray value 205 is unknown whatever the thresholds say,
//! because it is what `map_saver` writes for unknown space, and thresholds that call it free are a common mistake.

use std::fmt;

use serde::Deserialize;
use serde::de::{Deserializer, Visitor};
use serde_saphyr::Spanned;

use super::config::ImportConfig;
use super::error::MapImportError;
use super::picture::{Pixel, Shade};
use super::yaml::{from_yaml, position};

/// How gray values are read.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Mode {
    /// Occupied, free or unknown, by two thresholds.
    Trinary,
    /// As [`Mode::Trinary`], with a gradient of costs between the thresholds.
    Scale,
    /// The gray value is the occupancy in percent; 101 to 255 are unknown, and there is no negation or opacity.
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
    /// Occupancy from which on a pixel is occupied.
    pub occupied_thresh: f64,
    /// Occupancy up to which a pixel is free.
    pub free_thresh: f64,
    /// How gray values are read.
    pub mode: Mode,
}

/// The YAML as it is written. Fields that others have added are ignored.
#[derive(Deserialize)]
struct Written {
    image: Spanned<Scalar>,
    resolution: Spanned<Scalar>,
    origin: Spanned<Vec<Scalar>>,
    negate: Option<Spanned<Scalar>>,
    occupied_thresh: Spanned<Scalar>,
    free_thresh: Spanned<Scalar>,
    mode: Option<Spanned<Scalar>>,
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
        let written: Written = from_yaml(text)?;
        let resolution =
            number("resolution", &written.resolution, "a number of meters from 0.00001 to 1000", |value| {
                (1e-5..=1000.0).contains(&value)
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
        if written.image.value.0.trim().is_empty() {
            return Err(field("image", "the path of a file", &written.image));
        }
        Ok(Self {
            origin: origin(&written.origin)?,
            mode: mode(written.mode.as_ref())?,
            negate: negate(written.negate.as_ref())?,
            image: written.image.value.0,
            resolution,
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

    /// Classifies a pixel as nav2 does, except that the gray of unknown space is unknown whatever the thresholds say.
    ///
    /// That gray is known only where white is free. In trinary and scale mode what is not opaque is unknown. Where both
    /// thresholds are met, the pixel is free. In scale mode the costs 0 and 100 are free and occupied; those between are
    /// unknown here. Raw percentages are held against the same thresholds.
    pub(super) fn pixel(&self, shade: Shade) -> Pixel {
        let gray = f64::from(shade.gray);
        let occupancy = match self.mode {
            Mode::Raw if shade.gray > 100 => return Pixel::Unknown,
            Mode::Raw => gray / 100.0,
            _ if shade.alpha < u8::MAX || shade.marked && !self.negate => return Pixel::Unknown,
            _ => (if self.negate { gray } else { 255.0 - gray }) / 255.0,
        };
        // The steps between gray values are some 4000 times as large.
        const HAIR: f64 = 1e-6;
        if occupancy <= self.free_thresh + HAIR {
            return Pixel::Free;
        }
        if occupancy >= self.occupied_thresh - HAIR {
            return Pixel::Occupied;
        }
        if self.mode == Mode::Scale {
            let cost = (occupancy - self.free_thresh) / (self.occupied_thresh - self.free_thresh) * 100.0;
            if cost < 0.5 {
                return Pixel::Free;
            }
            if cost >= 99.5 {
                return Pixel::Occupied;
            }
        }
        Pixel::Unknown
    }
}

/// A number, word or flag as it is written; quotes make no difference.
struct Scalar(String);

impl<'de> Deserialize<'de> for Scalar {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct ScalarVisitor;
        impl Visitor<'_> for ScalarVisitor {
            type Value = Scalar;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("a number or a word")
            }

            fn visit_bool<E>(self, value: bool) -> Result<Scalar, E> {
                Ok(Scalar(value.to_string()))
            }

            fn visit_u64<E>(self, value: u64) -> Result<Scalar, E> {
                Ok(Scalar(value.to_string()))
            }

            fn visit_i64<E>(self, value: i64) -> Result<Scalar, E> {
                Ok(Scalar(value.to_string()))
            }

            fn visit_f64<E>(self, value: f64) -> Result<Scalar, E> {
                Ok(Scalar(value.to_string()))
            }

            fn visit_str<E>(self, value: &str) -> Result<Scalar, E> {
                Ok(Scalar(value.to_owned()))
            }

            fn visit_unit<E>(self) -> Result<Scalar, E> {
                Ok(Scalar(String::new()))
            }
        }
        deserializer.deserialize_any(ScalarVisitor)
    }
}

impl Scalar {
    fn number(&self) -> Option<f64> {
        // YAML writes `.nan` and `.inf`.
        self.0.trim().parse().ok()
    }
}

fn number(
    name: &'static str,
    written: &Spanned<Scalar>,
    expected: &'static str,
    in_range: impl Fn(f64) -> bool,
) -> Result<f64, MapImportError> {
    written.value.number().filter(|value| in_range(*value)).ok_or_else(|| field(name, expected, written))
}

fn origin(written: &Spanned<Vec<Scalar>>) -> Result<[f64; 3], MapImportError> {
    /// Floor plans lie on Earth, whose circumference this is.
    const FURTHEST: f64 = 4e7;
    let numbers: Vec<f64> = written.value.iter().filter_map(Scalar::number).collect();
    match (written.value.len(), &numbers[..]) {
        (3, &[x, y, yaw]) if numbers.iter().all(|value| value.abs() <= FURTHEST) => Ok([x, y, yaw]),
        _ => {
            let found: Vec<&str> = written.value.iter().map(|value| value.0.as_str()).collect();
            Err(MapImportError::Field {
                field: "origin",
                expected: "three finite numbers, [x, y, yaw]",
                found: format!("[{}]", found.join(", ")),
                at: position(&written.referenced),
            })
        }
    }
}

/// Reads a number, where all but 0 mean yes, or one of YAML's words for yes and no.
fn negate(written: Option<&Spanned<Scalar>>) -> Result<bool, MapImportError> {
    let Some(written) = written else { return Ok(false) };
    match written.value.0.trim().to_lowercase().as_str() {
        "true" | "yes" | "on" | "y" => Ok(true),
        "false" | "no" | "off" | "n" => Ok(false),
        word => {
            let number = word.parse::<i64>().map_err(|_| field("negate", "0, 1, false or true", written))?;
            Ok(number != 0)
        }
    }
}

fn mode(written: Option<&Spanned<Scalar>>) -> Result<Mode, MapImportError> {
    let Some(written) = written else { return Ok(Mode::Trinary) };
    match written.value.0.to_lowercase().as_str() {
        "trinary" => Ok(Mode::Trinary),
        "scale" => Ok(Mode::Scale),
        "raw" => Ok(Mode::Raw),
        _ => Err(field("mode", "`trinary`, `scale` or `raw`", written)),
    }
}

fn field(field: &'static str, expected: &'static str, written: &Spanned<Scalar>) -> MapImportError {
    MapImportError::Field { field, expected, found: written.value.0.clone(), at: position(&written.referenced) }
}

#[cfg(test)]
mod tests {
    use super::super::position::Position;
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
        check(
            "0.050000",
            "coarse",
            "`resolution` must be a number of meters from 0.00001 to 1000, not `coarse`",
            2,
            13,
        );
        check("0.050000", "0,05", "not `0,05`", 2, 13);
        check("0.050000", ".nan", "`resolution` must be a number of meters from 0.00001 to 1000", 2, 13);
        check("0.050000", "5e-324", "`resolution` must be a number of meters from 0.00001 to 1000", 2, 13);
        check("0.050000", "0", "`resolution` must be a number of meters from 0.00001 to 1000", 2, 13);
        check("0.050000", "-0.05", "not `-0.05`", 2, 13);
        check("0.050000", ".inf", "not `.inf`", 2, 13);
        check("-12, 0.000000", "-12", "`origin` must be three finite numbers, [x, y, yaw], not `[-12.5, -12]`", 3, 9);
        check("-12, 0.000000", "-12, .nan", "`origin` must be three finite numbers", 3, 9);
        check("-12, 0.000000", "-12, -nan", "not `[-12.5, -12, -nan]`", 3, 9);
        check("-12, 0.000000", "-12, 0, 0", "`origin` must be three finite numbers", 3, 9);
        check("[-12.5, -12, 0.000000]", "5", "expected sequence start", 3, 9);
        check("negate: 0", "negate: maybe", "`negate` must be 0, 1, false or true, not `maybe`", 4, 9);
        check("0.65", "1.5", "`occupied_thresh` must be a number from 0 to 1, not `1.5`", 5, 18);
        check("0.65", "0.1", "`occupied_thresh` (0.1) is below `free_thresh` (0.196)", 5, 18);
        check("free_thresh: 0.196", "", "missing field `free_thresh`", 5, 1);
        check("negate: 0", "mode: ternary", "`mode` must be `trinary`, `scale` or `raw`, not `ternary`", 4, 7);
        check("map.pgm", "''", "`image` must be the path of a file", 1, 8);
        check("map.pgm", "", "`image` must be the path of a file", 1, 6);
        check("negate: 0", "image: b.pgm", "duplicate mapping key: image (line", 4, 1);
    }

    #[test]
    fn what_is_no_description_says_what_it_is() {
        let check = |text: &str, says: &str| {
            let error = MapYaml::parse(text).expect_err(says).to_string();
            assert!(error.contains(says), "{error}");
        };
        check("", "the file is empty");
        check(" \n", "the file is empty");
        check(
            "version https://git-lfs.github.com/spec/v1\noid sha256:4d\nsize 12\n",
            "pointer of Git LFS, not the YAML",
        );
    }

    #[test]
    fn words_and_numbers_may_be_quoted_and_in_capitals() {
        let check = |line: &str, negate: bool, mode: Mode| {
            let found =
                MapYaml::parse(&HOUSE.replace("negate: 0", line)).unwrap_or_else(|error| panic!("{line}: {error}"));
            assert_eq!((found.negate, found.mode), (negate, mode), "{line}");
        };
        for no in ["0", "\"0\"", "'0'", "false", "False", "'false'", "no", "NO", "off", "'No'"] {
            check(&format!("negate: {no}"), false, Mode::Trinary);
        }
        // A number other than 0 is as good as true in C++.
        for yes in ["1", "\"1\"", "true", "TRUE", "'true'", "yes", "On", "3", "-1"] {
            check(&format!("negate: {yes}"), true, Mode::Trinary);
        }
        for (word, mode) in
            [("Trinary", Mode::Trinary), ("SCALE", Mode::Scale), ("'Raw'", Mode::Raw), ("raw", Mode::Raw)]
        {
            check(&format!("negate: 0\nmode: {word}"), false, mode);
        }
        check("", false, Mode::Trinary);
        let quoted =
            HOUSE.replace("0.050000", "'0.05'").replace("-12, 0.000000", "'-12', \"0\"").replace("0.65", "\"0.65\"");
        assert_eq!(MapYaml::parse(&quoted).expect("quotes make no difference"), yaml());
    }

    fn shade(gray: u8, alpha: u8) -> Shade {
        Shade { gray, alpha, marked: gray == 205 }
    }

    fn check(yaml: &MapYaml, gray: u8, expected: Pixel) {
        assert_eq!(yaml.pixel(shade(gray, 255)), expected, "{gray} {yaml:?}");
    }

    #[test]
    fn trinary_splits_at_two_thresholds() {
        // An occupancy of 0.65 lies between the grays 89 and 90, one of 0.196 between 205 and 206.
        check(&yaml(), 0, Pixel::Occupied);
        check(&yaml(), 89, Pixel::Occupied);
        check(&yaml(), 90, Pixel::Unknown);
        check(&yaml(), 205, Pixel::Unknown);
        check(&yaml(), 206, Pixel::Free);
        let negated = MapYaml { negate: true, ..yaml() };
        check(&negated, 0, Pixel::Free);
        check(&negated, 255, Pixel::Occupied);
    }

    #[test]
    fn the_thresholds_themselves_belong_to_both_sides() {
        // 0.4 is the occupancy of 153, 0.6 of 102, as decimals and as float32.
        for (low, high) in [(0.4, 0.6), (f64::from(0.4f32), f64::from(0.6f32))] {
            let between = MapYaml { free_thresh: low, occupied_thresh: high, ..yaml() };
            check(&between, 153, Pixel::Free);
            check(&between, 152, Pixel::Unknown);
            check(&between, 103, Pixel::Unknown);
            check(&between, 102, Pixel::Occupied);
        }
        // Free is what nav2 sets last.
        let equal = MapYaml { occupied_thresh: 0.4, free_thresh: 0.4, ..yaml() };
        check(&equal, 153, Pixel::Free);
        check(&equal, 154, Pixel::Free);
        check(&equal, 152, Pixel::Occupied);
        for mode in [Mode::Trinary, Mode::Scale] {
            let widest = MapYaml { occupied_thresh: 1.0, free_thresh: 0.0, mode, ..yaml() };
            check(&widest, 255, Pixel::Free);
            check(&widest, 0, Pixel::Occupied);
            check(&widest, 128, Pixel::Unknown);
        }
    }

    #[test]
    fn the_gray_of_unknown_space_is_never_free() {
        for mode in [Mode::Trinary, Mode::Scale] {
            let loose = MapYaml { free_thresh: 0.25, mode, ..yaml() };
            check(&loose, 204, Pixel::Free);
            check(&loose, 205, Pixel::Unknown);
            // Negated, the value means nothing: its occupancy is 0.8.
            check(&MapYaml { negate: true, ..loose }, 205, Pixel::Occupied);
        }
    }

    #[test]
    fn what_is_not_opaque_is_unknown_but_in_raw_mode() {
        for mode in [Mode::Trinary, Mode::Scale] {
            let yaml = MapYaml { mode, ..yaml() };
            for gray in [0, 255] {
                assert_eq!(yaml.pixel(shade(gray, 254)), Pixel::Unknown);
                assert_ne!(yaml.pixel(shade(gray, 255)), Pixel::Unknown);
            }
        }
        assert_eq!(MapYaml { mode: Mode::Raw, ..yaml() }.pixel(shade(0, 0)), Pixel::Free);
    }

    #[test]
    fn costs_that_round_to_the_ends_of_a_scale_are_the_ends() {
        let scale = MapYaml { occupied_thresh: 1.0, free_thresh: 0.0, mode: Mode::Scale, ..yaml() };
        // 1/255 is a cost of 0.39, 2/255 one of 0.78.
        check(&scale, 254, Pixel::Free);
        check(&scale, 253, Pixel::Unknown);
        check(&scale, 2, Pixel::Unknown);
        check(&scale, 1, Pixel::Occupied);
    }

    #[test]
    fn raw_values_are_percentages() {
        let raw = MapYaml { mode: Mode::Raw, negate: true, ..yaml() };
        check(&raw, 0, Pixel::Free);
        check(&raw, 19, Pixel::Free);
        check(&raw, 20, Pixel::Unknown);
        check(&raw, 66, Pixel::Occupied);
        check(&raw, 100, Pixel::Occupied);
        check(&raw, 101, Pixel::Unknown);
        check(&raw, 255, Pixel::Unknown);
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
