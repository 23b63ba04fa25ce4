//! What helps when a floor plan cannot be read.

use crate::domain::map::{PlanError, PlanForm};

/// What helps where hardly any floor is free.
pub(super) const NARROW: &str = "check the plan's unit, take smaller cells (`resolution`), or name another region: `region: all`, \
     or `region: [x, y]` in meters (`--region`)";

/// Says what helps.
pub(super) const fn help(error: &PlanError) -> Option<&'static str> {
    Some(match error {
        PlanError::LevelMissing { .. } | PlanError::LevelUnknown { .. } => {
            "name one of them: `files: { paths: [...], level: NAME }`, or `--level NAME`"
        }
        PlanError::Measurements { .. } | PlanError::Distance { .. } => {
            "in Open-RMF's traffic editor, draw a measurement between two points and give its distance in meters"
        }
        PlanError::Scale { .. } => "check the distances of the measurements: they are in meters",
        PlanError::Coordinates { .. } => "trace the building over a drawing of it, with a measurement for the scale",
        PlanError::Degrees => {
            "project it to meters first, such as `ogr2ogr -t_srs EPSG:25832`, and write `unit: m` (`--unit m`)"
        }
        PlanError::Wkt { .. } | PlanError::Json { .. } | PlanError::GeoJson { .. } | PlanError::Ring { .. } => {
            "export it again: a plan is made of polygons, whose rings are closed"
        }
        PlanError::DxfBinary => "save it as a text DXF, of any version",
        PlanError::Dxf { .. } | PlanError::DxfGroup { .. } => "the file is damaged: save it again as a text DXF",
        PlanError::DxfUnit { .. } => "say in which unit it is drawn: `unit: mm` (`--unit mm`)",
        PlanError::Layers { .. } => {
            "name those of walls, and of doors: `walls: [\"*WALL*\"], doors: [\"*DOOR*\"]`, or `--walls '*WALL*' --doors '*DOOR*'`"
        }
        PlanError::Xml { .. } | PlanError::Svg { .. } => "the file is damaged: export it again as a plain SVG",
        PlanError::SvgScale => {
            "give two points in its user units and their distance: `scale: \"120,80:620,80=12.5m\"`, or `--scale 120,80:620,80=12.5m`; \
             or the unit in which it is drawn in its own size: `unit: mm` (`--unit mm`)"
        }
        PlanError::SvgNames { .. } => {
            "name walls, and doors, by layer, class or color: `walls: [\"*wall*\", \"#000000\"], doors: [\"door*\"]`, or \
             `--walls '*wall*,#000000' --doors 'door*'`"
        }
        PlanError::Nothing => "check that it is the right file: a map is made of its walls and areas",
        PlanError::TooManyCells { .. } => {
            "check the plan's unit, or take larger cells: `resolution: 0.2` (`--resolution`)"
        }
        PlanError::TooManyPoints { .. } | PlanError::TooManyLines { .. } => {
            "leave out what is no wall, floor or door first"
        }
        _ => return None,
    })
}

/// Says what plans of this form take.
pub(super) const fn unfit(form: PlanForm) -> &'static str {
    match form {
        PlanForm::Building => "leave it out: buildings take `level` and `wall_thickness`; measurements say the scale",
        PlanForm::Dxf => "leave it out: drawings take `walls`, `doors`, `wall_thickness` and `unit`",
        PlanForm::Svg => {
            "leave it out: drawings take `scale`, `image_resolution` or `unit`, `walls`, `doors` and `wall_thickness`"
        }
        PlanForm::Wkt | PlanForm::GeoJson => "leave it out: polygons take `unit`",
    }
}
