//! `export nav2`: a heat as masks for the costmap filters of Nav2 and as a graph for its route server, with the parameters to
//! paste.

use std::path::{Path, PathBuf};

use serde_json::{Value, json};

use super::nav2_params::{MASKS, parameters};
use super::routes::{Laid, RouteArgs, role_name};
use crate::cli::error::CliError;
use crate::cli::heat_file::{read, read_heat};
use crate::cli::out_folder::OutFolder;
use crate::cli::screen::Screen;
use crate::domain::geometry::{Frame, Grid};
use crate::domain::map::{MapYaml, free_pixels};
use crate::domain::masks::{self, MOST};
use crate::domain::route_graph::Edge;

const GRAPH: &str = "route_graph.geojson";
const PICTURE: &str = "route_graph.png";
const PARAMETERS: &str = "nav2_params.yaml";
const README: &str = "README.md";

/// Arguments of `export nav2`.
#[derive(Debug, clap::Args)]
pub(super) struct Args {
    /// A heat, such as the `heat.parquet` that `annotate` writes.
    heat: PathBuf,
    /// YAML of the map of ROS that the robot uses: masks get its grid, resolution and origin [default: those of the heat].
    #[arg(long, value_name = "YAML")]
    map: Option<PathBuf>,
    #[command(flatten)]
    out: OutFolder,
    /// Value of the busiest floor in the keepout mask, 0 to 99; 100 could not be crossed.
    #[arg(long, value_name = "VALUE", default_value_t = MOST, value_parser = clap::value_parser!(u8).range(0..=i64::from(MOST)))]
    most: u8,
    /// Speed on the busiest floor, in percent of the robot's most.
    #[arg(long, value_name = "PERCENT", default_value_t = 40, value_parser = clap::value_parser!(u8).range(1..=100))]
    slowest: u8,
    /// Number of zones for the zone filter.
    #[arg(long, value_name = "NUMBER", default_value_t = 3, value_parser = clap::value_parser!(u8).range(2..=16))]
    zones: u8,
    #[command(flatten)]
    routes: RouteArgs,
}

impl Args {
    pub(super) fn run(&self, screen: &Screen) -> Result<(), CliError> {
        let masks = MASKS.map(|(name, _)| [format!("{name}_mask.pgm"), format!("{name}_mask.yaml")]);
        let names: Vec<&str> =
            masks.iter().flatten().map(String::as_str).chain([GRAPH, PICTURE, PARAMETERS, README]).collect();
        let inputs: Vec<PathBuf> = std::iter::once(&self.heat).chain(&self.map).cloned().collect();
        self.out.check(&names, &inputs)?;
        let heat = read_heat(&self.heat)?;
        let (free, frame) = match &self.map {
            Some(map) => grid_of(map)?,
            None => (heat.value.free.clone(), heat.frame),
        };
        let told = masks::carried(&heat.value.heat, &heat.value.free, &heat.frame, &free, &frame);
        if told.as_slice().iter().all(Option::is_none) {
            let map = self.map.as_deref().unwrap_or(&self.heat).display();
            let what = format!("no free cell of `{map}` lies where `{}` says something", self.heat.display());
            return Err(CliError::advised(what, "give the map that the heat was made of"));
        }
        let values = [masks::keepout(&told, self.most), masks::percent(&told), masks::zones(&told, self.zones)];
        let mut files: Vec<(&str, Vec<u8>)> = Vec::new();
        for ([image, yaml], values) in masks.iter().zip(&values) {
            files.push((image, pgm(values)));
            files.push((yaml, description(image, &frame).into_bytes()));
        }
        let laid = self.routes.lay_if_any(&heat, &self.heat, screen)?;
        if let Some(laid) = &laid {
            files.push((GRAPH, geojson(laid).into_bytes()));
            files.push((PICTURE, laid.draw(&heat, "Route graph")));
        } else {
            screen.remark("no route graph: the robot gets nowhere on this floor");
        }
        files.push((PARAMETERS, parameters(self.slowest, self.zones, laid.is_some().then_some(GRAPH)).into_bytes()));
        files.push((README, self.readme(laid.as_ref()).into_bytes()));
        self.out.write(&files, screen)
    }

    fn readme(&self, laid: Option<&Laid>) -> String {
        let Self { most, slowest, zones, .. } = self;
        format!(
            "# Where people walk, for Nav2

Masks of one grid, `mode: raw`: a pixel is the value of its cell.

- `keepout_mask`: 0 where nobody walks to {most} where most people do, 255 (unknown) where nothing is said. A keepout filter
  makes the cost value · 254 / 100 of it, {cost} at most: the floor stays crossable, and planners go around where it is cheap.
- `speed_mask`: the same in percent. With base 100 and the multiplier in `nav2_params.yaml` the robot goes at full speed where
  nobody walks, and at {slowest} % of it on the busiest floor.
- `zones_mask`: zones 1 to {zones} by rising heat for a zone parameter filter; 0 is the nominal state.
{graph}
A value of a mask is a rank: the share of the floor on which fewer people walk. `nav2_params.yaml` has the servers, the filters and their
topics; all servers are lifecycle nodes and want to be started by a lifecycle manager.
",
            cost = (f64::from(*most) * 254.0 / 100.0).round(),
            graph = laid.map(about_graph).unwrap_or_default(),
        )
    }
}

/// Reads which cells of a map of ROS are free, on its own grid.
fn grid_of(path: &Path) -> Result<(Grid<bool>, Frame), CliError> {
    let failed = |error: &dyn std::fmt::Display| CliError::request(format!("`{}`: {error}", path.display()));
    let text = String::from_utf8(read(path)?).map_err(|error| failed(&error))?;
    let yaml = MapYaml::parse(&text).map_err(|error| failed(&error))?;
    let image = read(&path.parent().unwrap_or(Path::new("")).join(&yaml.image))?;
    free_pixels(&yaml, &image).map_err(|error| failed(&error))
}

/// Says what the route graph is.
fn about_graph(laid: &Laid) -> String {
    format!(
        "- `route_graph.geojson`: a graph for the route server, in meters in the frame of the map; `route_graph.png` shows it.
  Nodes lie at doors, crossings, ends and bends (`class` in their metadata), edges are straight, one for each direction, and the
  robot fits on them. The metadata of an edge have its expected `social_cost` (eq. 2 of the paper, with {:.1} people in the
  building) and, as `penalty`, what that is worth in meters: {:.3} m a unit. The penalty scorer adds it to the length.
",
        laid.people, laid.lambda
    )
}

/// Writes a graph as Nav2's route server reads it: nodes are points, edges lines with the ids of their ends, and no two of all of
/// them have one id.
fn geojson(laid: &Laid) -> String {
    let feature = |properties: Value, geometry: Value| json!({ "type": "Feature", "properties": properties, "geometry": geometry });
    let places: Vec<[f64; 2]> = laid.places().map(|(at, ..)| at).collect();
    let node = |(number, (at, role, name)): (usize, ([f64; 2], _, Option<String>))| {
        let mut metadata = json!({ "class": role_name(role) });
        if let Some(name) = name {
            metadata["name"] = name.into();
        }
        let properties = json!({ "id": number + 1, "frame": "map", "metadata": metadata });
        feature(properties, json!({ "type": "Point", "coordinates": at }))
    };
    let edge = |(number, line): (usize, Edge)| {
        let properties = json!({
            "id": laid.len() + number + 1,
            "startid": line.ends[0] + 1,
            "endid": line.ends[1] + 1,
            "metadata": { "penalty": rounded(laid.penalty(&line)), "social_cost": rounded(line.cost) },
        });
        let ends = line.ends.map(|end| places[end]);
        feature(properties, json!({ "type": "MultiLineString", "coordinates": [ends] }))
    };
    let nodes = laid.places().enumerate().map(node);
    let features: Vec<Value> = nodes.chain(laid.lines().enumerate().map(edge)).collect();
    // What Nav2's own graphs say: coordinates are meters.
    let crs = json!({ "type": "name", "properties": { "name": "urn:ogc:def:crs:EPSG::3857" } });
    format!("{:#}\n", json!({ "type": "FeatureCollection", "name": "route_graph", "crs": crs, "features": features }))
}

fn rounded(value: f64) -> f64 {
    (value * 1e4).round() / 1e4
}

/// Writes a binary PGM.
fn pgm(values: &Grid<u8>) -> Vec<u8> {
    let mut bytes = format!("P5\n{} {}\n255\n", values.cols(), values.rows()).into_bytes();
    bytes.extend_from_slice(values.as_slice());
    bytes
}

/// Writes the YAML that `map_server` reads beside an image.
fn description(image: &str, frame: &Frame) -> String {
    let Frame { resolution, origin, yaw, .. } = frame;
    format!(
        "image: {image}\nmode: raw\nresolution: {resolution}\norigin: [{:?}, {:?}, {yaw:?}]\nnegate: 0\n\
         occupied_thresh: 0.65\nfree_thresh: 0.25\n",
        origin.x, origin.y
    )
}
