//! `import-map`: the maps of others, from the bytes of their files.
//!
//! What stands in a file is first classified pixel by pixel, then resampled, and the largest region of it is kept.

use image::ImageError;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::picture::{MOST_PIXELS, Pixel, Shade, classify, flipped};
use super::resample::{largest_region, resample};
use super::ros::MapYaml;
use super::{MapError, OccupancyMap};
use crate::domain::geometry::{Frame, Grid, Point};

/// The name of the picture of traversable space in an iGibson scene's folder.
pub const IGIBSON_IMAGE: &str = "floor_trav_0.png";

/// The edge of a pixel of [`IGIBSON_IMAGE`] in meters.
pub const IGIBSON_RESOLUTION: f64 = 0.01;

/// How maps are read.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct ImportConfig {
    /// Edge of a cell of the result in meters, 0.01 to 1.
    #[schemars(range(min = 0.01, max = 1.0))]
    pub resolution: f64,
    /// Edge of a pixel in meters of a plain image, which says nothing about its scale itself, 0.001 to 10.
    #[schemars(range(min = 0.001, max = 10.0))]
    pub image_resolution: Option<f64>,
    /// Brightness from which on a pixel of a plain image is free, as a share of white, 0 to 1.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub threshold: f64,
    /// Occupancy above which a pixel is occupied, instead of the one in a map's YAML, 0 to 1.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub occupied_thresh: Option<f64>,
    /// Occupancy below which a pixel is free, instead of the one in a map's YAML, 0 to 1.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub free_thresh: Option<f64>,
    /// Whether black is free and white occupied, instead of what a map's YAML says; plain images take it too.
    pub negate: Option<bool>,
}

impl Default for ImportConfig {
    fn default() -> Self {
        Self {
            resolution: 0.1,
            image_resolution: None,
            threshold: 0.5,
            occupied_thresh: None,
            free_thresh: None,
            negate: None,
        }
    }
}

impl ImportConfig {
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
        within("threshold", self.threshold, 0.0, 1.0)?;
        within("occupied_thresh", self.occupied_thresh.unwrap_or(0.0), 0.0, 1.0)?;
        within("free_thresh", self.free_thresh.unwrap_or(0.0), 0.0, 1.0)?;
        match (self.occupied_thresh, self.free_thresh) {
            (Some(occupied), Some(free)) if occupied < free => {
                Err(MapImportError::Thresholds { occupied, free, at: None })
            }
            _ => Ok(()),
        }
    }
}

/// A place in a text, both counted from 1.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Position {
    /// Line.
    pub line: u64,
    /// Column in characters.
    pub column: u64,
}

/// What keeps a map from being read.
#[derive(Debug, thiserror::Error)]
pub enum MapImportError {
    #[error("the YAML of the map is not understood: {message}{}", place(at))]
    Yaml { message: String, at: Option<Position> },
    #[error("`{field}` must be {expected}, not `{found}`{}", place(at))]
    Field { field: &'static str, expected: &'static str, found: String, at: Option<Position> },
    #[error("`occupied_thresh` ({occupied}) is below `free_thresh` ({free}): a pixel could be both{}", place(at))]
    Thresholds { occupied: f64, free: f64, at: Option<Position> },
    #[error("`{field}` is {value}, but must lie from {low} to {high}")]
    Parameter { field: &'static str, value: f64, low: f64, high: f64 },
    #[error("a plain image needs `image_resolution`, the edge of its pixels in meters")]
    ImageResolution,
    #[error("the image is none of PGM, PNG, JPEG, BMP and TIFF")]
    ImageFormat,
    #[error("the image is cut short")]
    ImageCutShort,
    #[error("the image cannot be decoded")]
    Image { source: ImageError },
    #[error("{width} × {height} are too many pixels: at most {MOST_PIXELS} are read")]
    TooManyPixels { width: u64, height: u64 },
    #[error(transparent)]
    Map(#[from] MapError),
}

impl MapImportError {
    /// Returns the place in the YAML that is to blame, where there is one.
    #[must_use]
    pub const fn position(&self) -> Option<Position> {
        match self {
            Self::Yaml { at, .. } | Self::Field { at, .. } | Self::Thresholds { at, .. } => *at,
            _ => None,
        }
    }
}

fn place(at: &Option<Position>) -> String {
    at.map_or_else(String::new, |at| format!(" (line {}, column {})", at.line, at.column))
}

/// Reads a map of ROS `map_server` from its parsed YAML and the bytes of the image that the YAML names.
///
/// # Errors
/// [`MapImportError`] if a parameter is out of range, the image is damaged or too large, or nothing is free.
pub fn import_ros(yaml: &MapYaml, image: &[u8], config: &ImportConfig) -> Result<OccupancyMap, MapImportError> {
    config.check()?;
    let yaml = yaml.overridden(config)?;
    let pixels = classify(image, |shade| yaml.pixel(shade))?;
    let origin = Point::new(yaml.origin[0], yaml.origin[1]);
    finish(&pixels, yaml.resolution, config, |frame| Frame { origin, yaw: yaml.origin[2], ..frame })
}

/// Reads a plain image: bright is free, dark is occupied, transparent and the gray value 205 are unknown.
///
/// Its lower left corner becomes the origin.
///
/// # Errors
/// [`MapImportError`] if `image_resolution` is missing, a parameter is out of range, the image is damaged or too large,
/// or nothing is free.
pub fn import_image(image: &[u8], config: &ImportConfig) -> Result<OccupancyMap, MapImportError> {
    config.check()?;
    let resolution = config.image_resolution.ok_or(MapImportError::ImageResolution)?;
    let pixels = classify(image, |shade| plain_pixel(shade, config))?;
    finish(&pixels, resolution, config, |frame| frame)
}

/// Reads the picture [`IGIBSON_IMAGE`] of an iGibson scene's folder: white is traversable, all else is not.
///
/// In iGibson the world's origin is the middle of the picture and y grows with its rows. So that coordinates are the
/// simulator's, the picture is turned upside down: its last row becomes row 0, the one with the largest y.
///
/// # Errors
/// [`MapImportError`] if a parameter is out of range, the image is damaged or too large, or nothing is free.
pub fn import_igibson(image: &[u8], config: &ImportConfig) -> Result<OccupancyMap, MapImportError> {
    config.check()?;
    let pixels = classify(image, |shade| if shade.gray == 255.0 { Pixel::Free } else { Pixel::Occupied })?;
    finish(&flipped(&pixels), IGIBSON_RESOLUTION, config, |frame| Frame {
        origin: Point::new(-0.5 * frame.cols as f64 * frame.resolution, -0.5 * frame.rows as f64 * frame.resolution),
        ..frame
    })
}

fn plain_pixel(shade: Shade, config: &ImportConfig) -> Pixel {
    if shade.is_unknown() || shade.alpha.is_some_and(|alpha| alpha < 127.5) {
        return Pixel::Unknown;
    }
    let gray = if config.negate == Some(true) { 255.0 - shade.gray } else { shade.gray };
    if gray >= config.threshold * 255.0 { Pixel::Free } else { Pixel::Occupied }
}

fn finish(
    pixels: &Grid<Pixel>,
    resolution: f64,
    config: &ImportConfig,
    place: impl FnOnce(Frame) -> Frame,
) -> Result<OccupancyMap, MapImportError> {
    let frame = place(Frame::at_zero(resolution, pixels.rows(), pixels.cols()));
    let (free, frame) = resample(pixels, &frame, config.resolution)?;
    Ok(largest_region(&free, &frame)?)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::domain::geometry::Cell;

    /// A binary PGM of rows of gray values.
    fn pgm(rows: &[&[u8]]) -> Vec<u8> {
        let mut bytes = format!("P5 {} {} 255\n", rows[0].len(), rows.len()).into_bytes();
        rows.iter().for_each(|row| bytes.extend_from_slice(row));
        bytes
    }

    fn drawn(map: &OccupancyMap) -> Vec<String> {
        (0..map.free().rows())
            .map(|row| map.free().row(row).iter().map(|free| if *free { '.' } else { '#' }).collect())
            .collect()
    }

    fn plain() -> ImportConfig {
        ImportConfig { image_resolution: Some(0.1), ..ImportConfig::default() }
    }

    #[test]
    fn a_plain_image_is_split_at_its_threshold() {
        let image = pgm(&[&[255, 128, 127, 205, 0]]);
        let map = import_image(&image, &plain()).expect("a map");
        assert_eq!(drawn(&map), ["####", "#..#", "####"]);
        let dark = ImportConfig { threshold: 0.4, ..plain() };
        assert_eq!(drawn(&import_image(&image, &dark).expect("a map")), ["#####", "#...#", "#####"]);
        let negated = ImportConfig { negate: Some(true), ..plain() };
        assert_eq!(drawn(&import_image(&image, &negated).expect("a map"))[1], "#.#");
    }

    #[test]
    fn a_ros_map_keeps_its_origin() {
        let yaml = "image: m.pgm\nresolution: 0.05\norigin: [-3, 7, 0.5]\noccupied_thresh: 0.65\nfree_thresh: 0.25";
        let yaml = MapYaml::parse(yaml).expect("a map's description");
        // Two cells of 0.1 m, each of 2 × 2 pixels; the upper one is unknown, which a threshold of 0.25 would call free.
        let image = pgm(&[&[205, 205], &[205, 205], &[254, 205], &[254, 254]]);
        let map = import_ros(&yaml, &image, &ImportConfig::default()).expect("a map");
        assert_eq!(drawn(&map), ["###", "#.#", "###"]);
        let frame = map.frame();
        let corner = frame.to_map(Point::new(0.1, 0.1));
        assert!(corner.distance(Point::new(-3.0, 7.0)) < 1e-12 && frame.yaw == 0.5, "{corner:?}");
    }

    #[test]
    fn a_comment_in_the_header_changes_nothing() {
        let image = pgm(&[&[255, 0, 255, 255]]);
        let commented = [b"P5\n# saved again\n4 1\n255\n".as_slice(), &image[image.len() - 4..]].concat();
        let import = |bytes: &[u8]| import_image(bytes, &plain()).expect("a map");
        assert_eq!(import(&image), import(&commented));
    }

    #[test]
    fn a_plain_image_needs_a_resolution() {
        let error = import_image(&pgm(&[&[255]]), &ImportConfig::default()).expect_err("no scale");
        assert!(matches!(error, MapImportError::ImageResolution), "{error}");
    }

    #[test]
    fn a_map_without_free_space_is_an_error() {
        let error = import_image(&pgm(&[&[0, 205]]), &plain()).expect_err("all is blocked");
        assert!(matches!(error, MapImportError::Map(MapError::NoFreeSpace)), "{error}");
    }

    #[test]
    fn igibson_lies_around_the_middle_with_y_along_the_rows() {
        // 40 × 40 pixels of 0.01 m; free is the upper left quarter, that is, negative x and negative y.
        let rows: Vec<Vec<u8>> =
            (0..40).map(|row| (0..40).map(|col| if row < 20 && col < 20 { 255 } else { 254 }).collect()).collect();
        let rows: Vec<&[u8]> = rows.iter().map(Vec::as_slice).collect();
        let map = import_igibson(&pgm(&rows), &ImportConfig::default()).expect("a map");
        assert_eq!(drawn(&map), ["####", "#..#", "#..#", "####"]);
        let center = map.frame().to_map(map.frame().center(Cell::new(1, 1)));
        assert!((center.x - -0.15).abs() < 1e-12 && (center.y - -0.05).abs() < 1e-12, "{center:?}");
    }

    #[test]
    fn parameters_out_of_range_are_named() {
        let check = |config: ImportConfig, field: &str| {
            let error = config.check().expect_err(field).to_string();
            assert!(error.contains(&format!("`{field}`")), "{error}");
        };
        check(ImportConfig { resolution: f64::NAN, ..plain() }, "resolution");
        check(ImportConfig { resolution: 0.0, ..plain() }, "resolution");
        check(ImportConfig { image_resolution: Some(-1.0), ..plain() }, "image_resolution");
        check(ImportConfig { threshold: 1.5, ..plain() }, "threshold");
        check(ImportConfig { free_thresh: Some(f64::INFINITY), ..plain() }, "free_thresh");
        check(ImportConfig { free_thresh: Some(0.5), occupied_thresh: Some(0.4), ..plain() }, "occupied_thresh");
        ImportConfig::default().check().expect("the defaults are in range");
    }

    #[test]
    fn the_grid_of_a_huge_map_is_refused() {
        let config = ImportConfig { resolution: 0.01, image_resolution: Some(10.0), ..plain() };
        let row = [255u8; 64];
        let error = import_image(&pgm(&[&row[..]; 64]), &config).expect_err("64,000 × 64,000 cells");
        assert!(matches!(error, MapImportError::TooManyPixels { width: 64_000, .. }), "{error}");
    }
}
