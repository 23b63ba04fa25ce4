//! `export rmf`: a graph of ways as lanes of Open-RMF.
//!
//! The form is that of the `nav_graphs` which its building map tools write and its fleet adapters read: vertices `[x, y,
//! properties]` and lanes in one direction `[from, to, properties]`, by level.

use std::collections::BTreeMap;
use std::path::PathBuf;

use serde::Serialize;
use serde_json::{Map, Value, json};

use super::routes::RouteArgs;
use crate::cli::error::CliError;
use crate::cli::heat_file::read_heat;
use crate::cli::out_folder::OutFolder;
use crate::cli::screen::Screen;

const GRAPH: &str = "nav_graph.yaml";
const PICTURE: &str = "nav_graph.png";

/// Arguments of `export rmf`.
#[derive(Debug, clap::Args)]
#[command(
    after_help = "A lane has the speed limit at which it takes as long as its length and what the people on it cost \
together, so that planners that look for the fastest way keep out of people's way. Doors, crossings and ends have names. The \
frame is that of the map; for a `building.yaml` that is Open-RMF's own."
)]
pub(super) struct Args {
    /// A heat, such as the `heat.parquet` that `annotate` writes.
    heat: PathBuf,
    /// Name of the level that the map shows.
    #[arg(long, default_value = "L1")]
    level: String,
    /// Name of the building.
    #[arg(long, default_value = "building")]
    building: String,
    #[command(flatten)]
    out: OutFolder,
    #[command(flatten)]
    routes: RouteArgs,
}

/// A graph of one fleet.
#[derive(Debug, Serialize)]
struct NavGraph<'a> {
    building_name: &'a str,
    doors: Map<String, Value>,
    levels: BTreeMap<&'a str, Level>,
    lifts: Map<String, Value>,
}

#[derive(Debug, Serialize)]
struct Level {
    lanes: Vec<(usize, usize, Value)>,
    vertices: Vec<(f64, f64, Value)>,
}

impl Args {
    pub(super) fn run(&self, screen: &Screen) -> Result<(), CliError> {
        self.out.check(&[GRAPH, PICTURE], std::slice::from_ref(&self.heat))?;
        let heat = read_heat(&self.heat)?;
        let laid = self.routes.lay(&heat, &self.heat, screen)?;
        let vertex =
            |(at, _, name): ([f64; 2], _, Option<String>)| (at[0], at[1], json!({ "name": name.unwrap_or_default() }));
        let level = Level {
            lanes: laid
                .lines()
                .map(|line| (line.ends[0], line.ends[1], json!({ "speed_limit": laid.speed(&line) })))
                .collect(),
            vertices: laid.places().map(vertex).collect(),
        };
        let graph = NavGraph {
            building_name: &self.building,
            doors: Map::new(),
            levels: BTreeMap::from([(self.level.as_str(), level)]),
            lifts: Map::new(),
        };
        let text = serde_saphyr::to_string(&graph).expect("numbers and names can be written");
        let picture = laid.draw(&heat, "Lanes for Open-RMF");
        self.out.write(&[(GRAPH, text.into_bytes()), (PICTURE, picture)], screen)
    }
}
