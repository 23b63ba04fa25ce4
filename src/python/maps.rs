//! Maps from files, and from grids at hand.

use std::path::PathBuf;

use pyo3::prelude::*;

use super::error::PythonError;
use super::table::Table;
use crate::domain::geometry::{Frame, Grid, Point};
use crate::domain::map::{ImportConfig, Imported, MapImportError, import_grid};
use crate::stages::import_map::{self, ImportMap};
use crate::stages::map_origin::Origin;

/// A map, and what there is to say of it: lines, and whether each is a warning.
type Read = (Table, Vec<(String, bool)>);

/// Reads a map from a file; the options are those of `files` in a pipeline file, as JSON.
#[pyfunction]
pub fn read_map(py: Python<'_>, path: PathBuf, options: &str) -> PyResult<Read> {
    let read = || {
        let config = parsed(options)?;
        let origin = Origin::of(&path, &config)?;
        if let Some(field) = config.unfit(origin.form()).first() {
            return Err(refused(&MapImportError::Unfit { field, form: origin.form() }));
        }
        told(ImportMap::new(origin, config)?.import()?)
    };
    Ok(py.detach(read)?)
}

/// Takes a grid for a map: a byte for each cell, row by row, not 0 where it is free; then the edge of a cell, the origin, x and y,
/// and the yaw.
#[pyfunction]
pub fn grid_map(py: Python<'_>, free: &[u8], shape: (usize, usize), place: [f64; 4], options: &str) -> PyResult<Read> {
    let (rows, cols) = shape;
    let [resolution, x, y, yaw] = place;
    let read = || {
        if rows.checked_mul(cols) != Some(free.len()) {
            return Err(PythonError::argument("the grid is not of its shape", "give an array with two dimensions"));
        }
        let free = Grid::from_vec(rows, cols, free.iter().map(|byte| *byte != 0).collect());
        let frame = Frame { resolution, origin: Point::new(x, y), yaw, rows, cols };
        told(import_grid(&free, &frame, &parsed(options)?).map_err(|error| refused(&error))?)
    };
    Ok(py.detach(read)?)
}

fn parsed(options: &str) -> Result<ImportConfig, PythonError> {
    let config: ImportConfig = serde_json::from_str(options)
        .map_err(|error| PythonError::argument(error.to_string(), "see `help(trodden.read_map)`"))?;
    config.check().map_err(|error| refused(&error))?;
    Ok(config)
}

fn refused(error: &MapImportError) -> PythonError {
    match import_map::help(error) {
        Some(help) => PythonError::argument(error.to_string(), help),
        None => crate::cli::CliError::request(error.to_string()).into(),
    }
}

fn told(imported: Imported) -> Result<Read, PythonError> {
    let Imported { map, survey, reading } = imported;
    let advice = if survey.is_odd() { "; `region=\"all\"` or `region=(x, y)` keeps other regions" } else { "" };
    let found = reading.found.into_iter().map(|line| (line, false));
    let doubts = reading.doubts.iter().map(|doubt| (doubt.to_string(), true));
    let lines = found.chain(doubts).chain([(format!("{survey}{advice}"), survey.is_odd())]).collect();
    Ok((Table::of_map(map)?, lines))
}
