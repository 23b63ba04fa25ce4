//! `export lif`: a graph of ways as a layout for VDA 5050.
//!
//! The form is the Layout Interchange Format of VDMA, version 1.0.0: nodes and directed edges, each with what a type of
//! vehicle may do there.

use std::path::PathBuf;

use serde_json::{Value, json};

use super::routes::{RouteArgs, role_name};
use crate::cli::error::CliError;
use crate::cli::heat_file::read_heat;
use crate::cli::out_folder::OutFolder;
use crate::cli::screen::Screen;
use crate::domain::route_graph::Edge;
use crate::pipeline::execute::timestamp;

const LAYOUT: &str = "layout.lif.json";
const PICTURE: &str = "layout.png";

/// Arguments of `export lif`.
#[derive(Debug, clap::Args)]
#[command(after_help = "An edge has the speed at which it takes as long as its length and what the people on it cost \
together, so that a fleet manager that looks for the fastest way keeps out of people's way. Stations are yours to add. The frame is that \
of the map.")]
pub(super) struct Args {
    /// A heat, such as the `heat.parquet` that `annotate` writes.
    heat: PathBuf,
    /// Type of the vehicles that may use the layout.
    #[arg(long, default_value = "robot")]
    vehicle_type: String,
    /// Name of the layout.
    #[arg(long, default_value = "building")]
    layout: String,
    #[command(flatten)]
    out: OutFolder,
    #[command(flatten)]
    routes: RouteArgs,
}

impl Args {
    pub(super) fn run(&self, screen: &Screen) -> Result<(), CliError> {
        self.out.check(&[LAYOUT, PICTURE], std::slice::from_ref(&self.heat))?;
        let heat = read_heat(&self.heat)?;
        let laid = self.routes.lay(&heat, &self.heat, screen)?;
        let id = |number: usize| format!("n{}", number + 1);
        let node = |(number, (at, role, name)): (usize, ([f64; 2], _, Option<String>))| {
            json!({
                "nodeId": id(number),
                "nodeName": name.unwrap_or_else(|| id(number)),
                "nodeDescription": role_name(role),
                "nodePosition": { "x": at[0], "y": at[1] },
                "vehicleTypeNodeProperties": [{ "vehicleTypeId": self.vehicle_type }],
            })
        };
        let nodes: Vec<Value> = laid.places().enumerate().map(node).collect();
        let edge = |(number, line): (usize, Edge)| {
            json!({
                "edgeId": format!("e{}", number + 1),
                "startNodeId": id(line.ends[0]),
                "endNodeId": id(line.ends[1]),
                "vehicleTypeEdgeProperties": [{
                    "vehicleTypeId": self.vehicle_type,
                    "maxSpeed": laid.speed(&line),
                    "rotationAllowed": true,
                }],
            })
        };
        let edges: Vec<Value> = laid.lines().enumerate().map(edge).collect();
        let layout = json!({
            "metaInformation": {
                "projectIdentification": self.layout,
                "creator": "trodden",
                "exportTimestamp": timestamp(),
                "lifVersion": "1.0.0",
            },
            "layouts": [{
                "layoutId": self.layout,
                "layoutVersion": "1",
                "layoutDescription": format!(
                    "{:.1} people are reckoned with; a unit of social cost is worth {:.3} m", laid.people, laid.lambda
                ),
                "nodes": nodes,
                "edges": edges,
                "stations": [],
            }],
        });
        let text = format!("{layout:#}\n");
        let picture = laid.draw(&heat, "Layout for VDA 5050");
        self.out.write(&[(LAYOUT, text.into_bytes()), (PICTURE, picture)], screen)
    }
}
