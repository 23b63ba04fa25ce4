//! `import-map`: the floor plans of others, from the bytes of their files.

use super::raster::{frame_of, rasterize};
use super::shapes::Plan;
use super::{building, dxf, geojson, svg, wkt};
use crate::domain::map::config::ImportConfig;
use crate::domain::map::error::MapImportError;
use crate::domain::map::form::{MapForm, PlanForm};
use crate::domain::map::import::Imported;
use crate::domain::map::indoors::choose;
use crate::domain::map::observed::Observed;
use crate::domain::map::picture::is_lfs_pointer;
use crate::domain::map::reading::Reading;

/// Reads a floor plan: areas, walls and doors become cells.
///
/// The frame of the map is the plan's own, in meters, with y upwards and without rotation. What is no floor, or is a wall, is
/// blocked and shown as occupied.
///
/// # Errors
/// [`MapImportError`] if a parameter is out of range, the file is not understood, or hardly anything is free.
pub fn import_plan(form: PlanForm, bytes: &[u8], config: &ImportConfig) -> Result<Imported, MapImportError> {
    let (plan, reading) = read(form, bytes, config)?;
    let (free, frame) = rasterize(&plan, config.resolution)?;
    let cells = free.map(|free| Observed::of_free(*free));
    let (map, survey) = choose(&cells, &frame, MapForm::Plan(form), config.region)?;
    Ok(Imported { map, survey, reading })
}

/// Returns how many cells the grid of a floor plan has, which is read for that.
///
/// # Errors
/// [`MapImportError`] if a parameter is out of range, the file is not understood, or there are too many cells.
pub fn plan_cells(form: PlanForm, bytes: &[u8], config: &ImportConfig) -> Result<u64, MapImportError> {
    let (plan, _) = read(form, bytes, config)?;
    let frame = frame_of(&plan, config.resolution)?;
    Ok(frame.rows as u64 * frame.cols as u64)
}

fn read(form: PlanForm, bytes: &[u8], config: &ImportConfig) -> Result<(Plan, Reading), MapImportError> {
    config.check()?;
    let text = String::from_utf8_lossy(bytes);
    let text = text.trim_start_matches('\u{feff}');
    match form {
        PlanForm::Building => building::read(text, config),
        _ if text.trim().is_empty() => Err(MapImportError::Empty),
        _ if is_lfs_pointer(bytes) => Err(MapImportError::LfsPointer { what: "plan" }),
        PlanForm::Dxf => Ok(dxf::read(text, config)?),
        PlanForm::Wkt => Ok(wkt::read(text, config)?),
        PlanForm::Svg => Ok(svg::read(text, config)?),
        PlanForm::GeoJson => Ok(geojson::read(text, config)?),
    }
}
