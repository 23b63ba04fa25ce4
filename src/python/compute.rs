//! Where people walk, by the model or by simulation, and paths around them.

use std::ops::ControlFlow;
use std::path::PathBuf;

use pyo3::prelude::*;

use super::error::PythonError;
use super::table::Table;
use crate::cli::{CliError, model_files};
use crate::domain::annotate::{AnnotateConfig, AnnotateFields};
use crate::domain::crowd::{CrowdConfig, CrowdFields};
use crate::domain::geometry::{Frame, Point};
use crate::domain::map::OccupancyMap;
use crate::domain::planner::Path;
use crate::kinds::{Heat, Model, Placed};
use crate::stages::crowd_heat::{self, Walks};
use crate::stages::path_around::{NoPath, Planned, Trip};
use crate::stages::{annotate as stage, compute};

/// Lets a model tell where people walk; `fields` are the parameters of the stage `annotate`, as JSON.
#[pyfunction]
#[pyo3(signature = (map, fields, model=None))]
pub fn annotate(py: Python<'_>, map: &Bound<'_, Table>, fields: &str, model: Option<PathBuf>) -> PyResult<Table> {
    let map = map_of(map.get())?;
    let fields: AnnotateFields = read(fields)?;
    let asked = fields.offsets;
    let mut config = AnnotateConfig::try_from(fields).map_err(|error| {
        let help = stage::advice(&error);
        PythonError::from(CliError::Request { message: error.to_string(), help })
    })?;
    let heat = interruptible(py, |progress| {
        let model = model.as_deref().map_or_else(|| Ok(Model::shipped()), model_files::read)?;
        stage::settle(&mut config, asked, &model);
        Ok(stage::heat(map, &model, &config, &compute::open(config.device, config.simd)?, progress)?)
    })?;
    Ok(Table::of_heat(Placed::new(*map.frame(), heat))?)
}

/// Lets simulated people walk; `crowd` are the parameters of the stage `simulate` that are about people, as JSON. What was not
/// as it was asked for stands beside the heat.
#[pyfunction]
pub fn simulate(
    py: Python<'_>,
    map: &Bound<'_, Table>,
    crowd: &str,
    episodes: u32,
    seed: u64,
) -> PyResult<(Table, Vec<String>)> {
    let map = map_of(map.get())?;
    let crowd = CrowdConfig::from(read::<CrowdFields>(crowd)?);
    crowd.check().map_err(|error| PythonError::from(CliError::request(error.to_string())))?;
    if !(1..=1_000_000).contains(&episodes) {
        let what = format!("`episodes` is {episodes}, allowed are 1 to 1000000");
        return Err(PythonError::from(CliError::request(what)).into());
    }
    let walks = Walks { crowd, episodes, seed };
    let (heat, summary) = interruptible(py, |progress| Ok(crowd_heat::heat(map, &walks, progress)?))?;
    let warnings = crowd_heat::warnings(&walks.crowd, &summary);
    Ok((Table::of_heat(Placed::new(*map.frame(), heat))?, warnings))
}

/// A path: its points, in the frame of the map; its length, its expected social cost, and its λ.
type Told = (Vec<(f64, f64)>, f64, f64, f64);

/// Plans a path around people. Returns how many are reckoned with, whether the best path is the one to take, the shortest path
/// and the best one.
#[pyfunction]
#[pyo3(signature = (map, heat, ends, detour, radius, speed, people=None, lambda_=None))]
#[expect(clippy::too_many_arguments, reason = "the Python function beside it has them by name")]
pub fn plan_path(
    py: Python<'_>,
    map: &Bound<'_, Table>,
    heat: &Bound<'_, Table>,
    ends: [f64; 4],
    detour: f64,
    radius: f64,
    speed: f64,
    people: Option<f64>,
    lambda_: Option<f64>,
) -> PyResult<(f64, bool, Told, Told)> {
    let [from_x, from_y, to_x, to_y] = ends;
    let (from, to) = (Point::new(from_x, from_y), Point::new(to_x, to_y));
    let trip = Trip { from, to, people, detour, lambda: lambda_, radius, speed };
    let map = map_of(map.get())?;
    let heat = heat_of(heat.get(), map.frame())?;
    let planned = py.detach(|| trip.on(map).and_then(|start| start.among(heat)));
    let Planned { found, people, is_best } = planned.map_err(refused)?;
    let told = |path: &Path| {
        let points = path.route.points().iter().map(|point| map.frame().to_map(*point));
        (points.map(|at| (at.x, at.y)).collect(), path.route.length(), path.cost, path.lambda)
    };
    Ok((people, is_best, told(&found.shortest), told(&found.best)))
}

fn read<T: serde::de::DeserializeOwned>(json: &str) -> Result<T, PythonError> {
    serde_json::from_str(json).map_err(|error| CliError::request(error.to_string()).into())
}

fn map_of(table: &Table) -> Result<&OccupancyMap, PythonError> {
    let other = || PythonError::argument("this raster is no map", "read one with `trodden.read_map`");
    table.map().ok_or_else(other)
}

fn heat_of<'t>(table: &'t Table, frame: &Frame) -> Result<&'t Heat, PythonError> {
    let Some(heat) = table.heat() else {
        let what = "`heat` is no heat";
        return Err(PythonError::argument(what, "give what `annotate` or `simulate` returns"));
    };
    if heat.frame != *frame {
        let what = "`heat` does not lie on the map as it is read here";
        return Err(PythonError::argument(what, "give the map and the options that the heat was made with"));
    }
    Ok(&heat.value)
}

fn refused(error: NoPath) -> PythonError {
    let help = match error {
        NoPath::Narrow { is_start, least, most, .. } => Some(format!(
            "choose another `{}` on the free floor that is kept: x is {:.1} to {:.1}, y is {:.1} to {:.1} on this map",
            if is_start { "start" } else { "goal" },
            least.x,
            most.x,
            least.y,
            most.y
        )),
        NoPath::NoWay => Some("look at the map's picture for what is one region, or try `region=\"all\"`".to_owned()),
        NoPath::Range { .. } | NoPath::Crowd(_) | NoPath::Nobody => None,
    };
    CliError::Request { message: error.to_string(), help }.into()
}

/// Works while other threads of Python go on, until it is done or somebody presses Ctrl-C.
fn interruptible<T: Send>(
    py: Python<'_>,
    work: impl FnOnce(&mut dyn FnMut(usize, usize) -> ControlFlow<()>) -> Result<T, PythonError> + Send,
) -> Result<T, PythonError> {
    py.detach(|| {
        let mut raised = None;
        let done = work(&mut |_, _| match Python::attach(|py| py.check_signals()) {
            Ok(()) => ControlFlow::Continue(()),
            Err(error) => {
                raised = Some(error);
                ControlFlow::Break(())
            }
        });
        raised.map_or(done, |raised| Err(PythonError::Raised(raised)))
    })
}
