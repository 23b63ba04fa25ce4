//! How the map that somebody names is read: the same options for every command that takes one.

use std::path::Path;

use super::error::CliError;
use super::screen::Screen;
use crate::domain::map::{ImportConfig, Imported, MapImportError, Region, ScaleBar, Unit};
use crate::stages::import_map::{self, ImportMap};
use crate::stages::map_origin::Origin;

/// How the map is read: what `files` and `igibson` of a pipeline file take too.
#[derive(Debug, clap::Args)]
#[command(next_help_heading = "How the map is read")]
pub(super) struct ImportArgs {
    /// Edge of a pixel in meters, for a plain image, or of a user unit, for an SVG drawing.
    #[arg(long, value_name = "METERS")]
    image_resolution: Option<f64>,
    /// The same by two points of the picture and their distance: `120,80:620,80=12.5m`, in pixels or user units to the right and down
    /// from the upper left corner.
    #[arg(long, value_name = "SCALE", conflicts_with = "image_resolution")]
    scale: Option<ScaleBar>,
    /// Brightness from which on a pixel is free, as a share of white, for a plain image [default: 0.5].
    #[arg(long, value_name = "SHARE")]
    threshold: Option<f64>,
    /// Occupancy up to which a pixel is free, instead of what the YAML of a map of ROS says.
    #[arg(long, value_name = "SHARE")]
    free_thresh: Option<f64>,
    /// Occupancy from which on a pixel is occupied, instead of what the YAML of a map of ROS says.
    #[arg(long, value_name = "SHARE")]
    occupied_thresh: Option<f64>,
    /// Black is free and white is occupied; `--negate=false` if the YAML of a map of ROS says so and is wrong.
    #[arg(long, value_name = "BOOL", num_args = 0..=1, default_missing_value = "true", require_equals = true)]
    negate: Option<bool>,
    /// Number of the floor, for an iGibson scene [default: 0, or the only one].
    #[arg(long, value_name = "NUMBER")]
    floor: Option<u32>,
    /// Name of the level, for a building of Open-RMF [default: the only one].
    #[arg(long, value_name = "NAME")]
    level: Option<String>,
    /// How thick walls are, for a building of Open-RMF or a DXF drawing [default: 0.1], or an SVG
    /// drawing [default: as they are drawn].
    #[arg(long, value_name = "METERS")]
    wall_thickness: Option<f64>,
    /// Unit of the coordinates, for WKT [default: m], GeoJSON, DXF [default: what its header says], and SVG
    /// in its own size: m, cm, mm, in or ft.
    #[arg(long)]
    unit: Option<Unit>,
    /// Layers whose lines are walls, for a DXF drawing, or layers, groups, classes or colors (`#rrggbb`) of walls, for an SVG
    /// drawing: names with `*` and `?`, with commas between them.
    #[arg(long, value_name = "LAYERS", value_delimiter = ',')]
    walls: Option<Vec<String>>,
    /// The same for straight lines that lie in doors.
    #[arg(long, value_name = "LAYERS", value_delimiter = ',')]
    doors: Option<Vec<String>>,
    /// Edge of a cell of the result in meters; models are trained on cells of one size.
    #[arg(long, value_name = "METERS", default_value_t = ImportConfig::default().resolution)]
    resolution: f64,
    /// Which of separate regions of free floor are kept: `largest` (that is not outdoors), `all`, or the one at `x,y`, in
    /// meters in the frame of the map.
    #[arg(long, default_value = "largest", allow_hyphen_values = true)]
    region: Region,
}

impl ImportArgs {
    fn config(&self) -> ImportConfig {
        ImportConfig {
            resolution: self.resolution,
            region: self.region,
            image_resolution: self.image_resolution,
            scale: self.scale,
            threshold: self.threshold,
            occupied_thresh: self.occupied_thresh,
            free_thresh: self.free_thresh,
            negate: self.negate,
            floor: self.floor,
            level: self.level.clone(),
            wall_thickness: self.wall_thickness,
            unit: self.unit,
            walls: self.walls.clone(),
            doors: self.doors.clone(),
        }
    }

    /// Finds the map; refuses options that it has no use for.
    pub(super) fn importer(&self, map: &Path) -> Result<ImportMap, CliError> {
        let config = self.config();
        let origin = Origin::of(map, &config)?;
        if let Some(field) = config.unfit(origin.form()).first() {
            let error = MapImportError::Unfit { field, form: origin.form() };
            let option = format!("`--{}` does not fit {}", field.replace('_', "-"), origin.form());
            return Err(match import_map::help(&error) {
                Some(help) => CliError::advised(option, help),
                None => CliError::request(option),
            });
        }
        Ok(ImportMap::new(origin, config)?)
    }
}

/// Says what was read of the map, what became of its free floor, and how to have it otherwise.
pub(super) fn tell(imported: &Imported, screen: &Screen) {
    let Imported { survey, reading, .. } = imported;
    reading.found.iter().for_each(|line| screen.remark(line));
    reading.doubts.iter().for_each(|doubt| screen.warn(doubt));
    if survey.is_odd() {
        screen.warn(format!("{survey}; `--region all` or `--region x,y` keeps other regions"));
    } else {
        screen.remark(survey.to_string());
    }
}
