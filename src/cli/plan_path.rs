//! `plan-path`: a path that stays out of people's way, without a pipeline.

use std::fmt::Write as _;
use std::path::PathBuf;
use std::process::ExitCode;
use std::str::FromStr;

use serde_json::json;

use super::annotate::predict_by_default;
use super::error::CliError;
use super::heat_file::read_heat;
use super::import_args::{ImportArgs, tell};
use super::out_folder::OutFolder;
use super::pages::{VIEW, View};
use super::screen::Screen;
use crate::domain::geometry::{Frame, Grid, Point};
use crate::domain::map::{Imported, OccupancyMap};
use crate::domain::planner::Path;
use crate::kinds::{Heat, Placed};
use crate::pipeline::stage::Stage;
use crate::report::picture::{Scale, planned_path};
use crate::report::png;
use crate::stages::path_around::{NoPath, Planned, Trip};

/// The files that it writes.
const CSV: &str = "path.csv";
const GEOJSON: &str = "path.geojson";
const PICTURE: &str = "path.png";

/// Arguments of `plan-path`.
#[derive(Debug, clap::Args)]
#[command(
    after_help = "It plans the path with the least expected social cost (equation 2 of the paper) of those that are at most a \
tenth longer than the shortest one, and says so where none saves more than a quarter of that cost; then the shortest path is the one to take. \
With --lambda the path has the least length + λ · expected social cost instead, however long it is.

It writes `path.csv` (path, x, y, meters along it), `path.geojson` (two lines with their lengths and costs), `path.png` and `view.html` \
(a page to look at it closely), with the shortest path beside the planned one. All coordinates are meters in the frame of the map.

Examples:
  trodden plan-path my_map.yaml --from 2.5,1 --to 14,8.5 --out path
  trodden plan-path my_map.yaml --from 2.5,1 --to 14,8.5 --heat annotated/heat.parquet --people 12 --out path
  trodden plan-path my_map.yaml --from 2.5,1 --to 14,8.5 --lambda 0.5 --out path"
)]
pub struct Args {
    /// A ROS `map_server` YAML, an image (with --image-resolution or --scale), the folder of an iGibson scene, or a floor plan: a
    /// `building.yaml` of Open-RMF, DXF, SVG, WKT or GeoJSON.
    map: PathBuf,
    /// Where the robot is, as x,y in meters in the frame of the map.
    #[arg(long, value_name = "X,Y", allow_hyphen_values = true)]
    from: Place,
    /// Where it wants to go.
    #[arg(long, value_name = "X,Y", allow_hyphen_values = true)]
    to: Place,
    #[command(flatten)]
    out: OutFolder,
    /// A heat of this map, such as the `heat.parquet` that `annotate` or `simulate` writes [default: what the model that
    /// trodden brings says].
    #[arg(long, value_name = "FILE")]
    heat: Option<PathBuf>,
    /// How many people are in the building [default: 6.5, and in proportion more above 200 m²].
    #[arg(long, value_name = "NUMBER")]
    people: Option<f64>,
    /// How much longer than the shortest path the path may be, as a share.
    #[arg(long, value_name = "SHARE", default_value_t = 0.1, conflicts_with = "lambda")]
    detour: f64,
    /// Meters that a unit of social cost is worth.
    #[arg(long, value_name = "METERS")]
    lambda: Option<f64>,
    /// Radius of the robot in meters.
    #[arg(long, value_name = "METERS", default_value_t = 0.2)]
    radius: f64,
    /// Speed of the robot in m/s.
    #[arg(long, value_name = "SPEED", default_value_t = 1.3)]
    speed: f64,
    #[command(flatten)]
    import: ImportArgs,
}

/// A point in the frame of the map.
#[derive(Debug, Clone, Copy)]
struct Place(Point);

impl FromStr for Place {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let number = |part: &str| part.trim().parse::<f64>().ok().filter(|number| number.is_finite());
        let place = text.split_once(',').and_then(|(x, y)| Some(Self(Point::new(number(x)?, number(y)?))));
        place.ok_or_else(|| "write two numbers with a comma between them, say `2.5,-1`".to_owned())
    }
}

impl Args {
    pub(super) fn run(&self, _: &std::path::Path, screen: &Screen) -> Result<ExitCode, CliError> {
        let trip = self.trip();
        trip.check().map_err(refused)?;
        let import = self.import.importer(&self.map)?;
        let mut inputs: Vec<PathBuf> = import.sources()?.into_iter().map(|source| source.path).collect();
        inputs.extend(self.heat.clone());
        self.out.check(&[CSV, GEOJSON, PICTURE, VIEW], &inputs)?;
        let imported = import.import()?;
        tell(&imported, screen);
        let Imported { map, .. } = imported;
        let start = trip.on(&map).map_err(refused)?;
        let heat = self.heat(&map, screen)?;
        let planned = start.among(&heat).map_err(refused)?;
        self.tell(&planned, screen)?;
        let paths = [&planned.found.shortest, planned.chosen()];
        let frame = map.frame();
        let name = import.origin().map_name();
        let picture = draw(frame, &heat.heat, map.free(), paths, &name);
        let about = paths.map(told);
        let view = View::new(&name, &map).heat("", &Placed::new(*frame, heat));
        let view = view.paths([0, 1].map(|at| (paths[at].route.points(), about[at].as_str())));
        let mut files = vec![
            (CSV, csv(frame, paths).into_bytes()),
            (GEOJSON, geojson(frame, paths).into_bytes()),
            (PICTURE, picture),
        ];
        files.extend(view.file(PICTURE, screen));
        self.out.write(&files, screen)?;
        Ok(ExitCode::SUCCESS)
    }

    const fn trip(&self) -> Trip {
        let Self { from: Place(from), to: Place(to), people, detour, lambda, radius, speed, .. } = *self;
        Trip { from, to, people, detour, lambda, radius, speed }
    }

    /// Reads the heat, or lets the model tell one.
    fn heat(&self, map: &OccupancyMap, screen: &Screen) -> Result<Heat, CliError> {
        let Some(path) = &self.heat else { return predict_by_default(map, screen) };
        let heat = read_heat(path)?;
        if heat.frame != *map.frame() {
            let what = format!("`{}` does not lie on `{}` as it is read here", path.display(), self.map.display());
            return Err(CliError::advised(what, "give the map and the options that the heat was made with"));
        }
        Ok(heat.value)
    }

    /// Says what was found.
    fn tell(&self, planned: &Planned, screen: &Screen) -> Result<(), CliError> {
        let Planned { found, people, is_best } = planned;
        if screen.json() {
            let path = |path: &Path| json!({ "length_m": path.route.length(), "expected_social_cost": path.cost, "lambda_m": path.lambda });
            return screen.object(&json!({
                "people": people,
                "shortest": path(&found.shortest),
                "planned": path(planned.chosen()),
                "best": path(&found.best),
            }));
        }
        screen.remark(format!("{people:.1} people are reckoned with"));
        screen.remark(format!("shortest path: {}", told(&found.shortest)));
        let longer = 100.0 * (found.best.route.length() / found.shortest.route.length() - 1.0);
        let less = 100.0 * (1.0 - found.best.cost / found.shortest.cost.max(f64::MIN_POSITIVE));
        let compared = format!("{longer:.1} % longer, {less:.0} % less social cost, λ = {:.3} m", found.best.lambda);
        if *is_best {
            screen.remark(format!("planned path: {} ({compared})", told(&found.best)));
        } else {
            let within = 100.0 * self.detour;
            screen.remark(format!(
                "there is no way around people within {within} % that is worth it (the best one: {compared}): the shortest path is planned"
            ));
        }
        Ok(())
    }
}

/// Says what a path is like.
fn told(path: &Path) -> String {
    format!("{:.1} m, expected social cost {:.2}", path.route.length(), path.cost)
}

/// Says why there is no path in the words of the options, and what helps.
pub(super) fn refused(error: NoPath) -> CliError {
    match error {
        NoPath::Range { field, value, low, high } => {
            CliError::request(format!("`--{field}` is {value}, allowed are {low} to {high}"))
        }
        NoPath::Narrow { is_start, place, least, most } => {
            let option = if is_start { "--from" } else { "--to" };
            let (x, y) = ([least.x, most.x], [least.y, most.y]);
            let [x, y] = [x, y].map(|[low, high]| format!("{low:.1} to {high:.1}"));
            CliError::advised(
                format!("the robot does not fit at `{option}` {},{}", place.x, place.y),
                format!(
                    "choose a place on the free floor that is kept: x is {x}, y is {y} on this map (`--region` keeps other floors)"
                ),
            )
        }
        NoPath::NoWay => CliError::advised(
            "no way leads from `--from` to `--to`",
            "see `heat.png` of `annotate` for what is one region, or try `--region all`",
        ),
        error @ (NoPath::Crowd(_) | NoPath::Nobody) => CliError::request(error.to_string()),
    }
}

const NAMES: [&str; 2] = ["shortest", "planned"];

/// Writes both paths point by point.
fn csv(frame: &Frame, paths: [&Path; 2]) -> String {
    let mut text = String::from("path,x,y,meters\n");
    for (name, path) in NAMES.iter().zip(paths) {
        let mut along = 0.0;
        let points = path.route.points();
        for (at, point) in points.iter().enumerate() {
            along += if at > 0 { points[at - 1].distance(*point) } else { 0.0 };
            let Point { x, y } = frame.to_map(*point);
            let _ = writeln!(text, "{name},{x:.3},{y:.3},{along:.3}");
        }
    }
    text
}

/// Writes both paths as lines; their coordinates are meters in the frame of the map and not degrees.
fn geojson(frame: &Frame, paths: [&Path; 2]) -> String {
    let features: Vec<serde_json::Value> = NAMES
        .iter()
        .zip(paths)
        .map(|(name, path)| {
            let points = path.route.points().iter().map(|point| frame.to_map(*point));
            let coordinates: Vec<[f64; 2]> = points.map(|at| [at.x, at.y].map(|c| (c * 1e3).round() / 1e3)).collect();
            json!({
                "type": "Feature",
                "properties": {
                    "name": name,
                    "length_m": path.route.length(),
                    "expected_social_cost": path.cost,
                    "lambda_m": path.lambda,
                },
                "geometry": { "type": "LineString", "coordinates": coordinates },
            })
        })
        .collect();
    format!("{:#}\n", json!({ "type": "FeatureCollection", "features": features }))
}

/// Draws both paths over the heat.
fn draw(frame: &Frame, heat: &Grid<f32>, free: &Grid<bool>, paths: [&Path; 2], title: &str) -> Vec<u8> {
    png::figure(&planned_path(frame, heat, free, paths.map(|path| path.route.points())), Scale::Linear, title)
}
