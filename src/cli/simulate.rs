//! `simulate`: people walk on a map of your own, without a pipeline.

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use super::crowd_args::{self, CrowdArgs};
use super::error::CliError;
use super::import_args::{ImportArgs, tell};
use super::out_folder::OutFolder;
use super::pages::{VIEW, View};
use super::screen::Screen;
use crate::domain::map::Imported;
use crate::kinds::{Placed, SingleFile};
use crate::pipeline::stage::Stage;
use crate::report::picture::{Scale, heat_picture};
use crate::report::png;

/// The files that it writes.
const HEAT: &str = "heat.parquet";
const MAP: &str = "map.parquet";
const PICTURE: &str = "heat.png";

/// Arguments of `simulate`.
#[derive(Debug, clap::Args)]
#[command(
    after_help = "It writes `heat.parquet` (one row a cell: heat, density, and the share of passages in eight directions), \
`heat.png`, `map.parquet`, and `view.html`, a page to look at it all closely and to see some of the people walk: what `annotate` predicts, by walking instead of looking.

Examples:
  trodden simulate my_map.yaml --out simulated
  trodden simulate plan.png --image-resolution 0.05 --preset comfortable --episodes 400 --out simulated"
)]
pub struct Args {
    /// A ROS `map_server` YAML, an image (with --image-resolution or --scale), the folder of an iGibson scene, or a floor plan: a
    /// `building.yaml` of Open-RMF, DXF, SVG, WKT or GeoJSON.
    map: PathBuf,
    #[command(flatten)]
    out: OutFolder,
    #[command(flatten)]
    crowd: CrowdArgs,
    #[command(flatten)]
    import: ImportArgs,
}

impl Args {
    pub(super) fn run(&self, _: &Path, screen: &Screen) -> Result<ExitCode, CliError> {
        let walks = self.crowd.walks()?;
        let import = self.import.importer(&self.map)?;
        let inputs: Vec<PathBuf> = import.sources()?.into_iter().map(|source| source.path).collect();
        self.out.check(&[HEAT, MAP, PICTURE, VIEW], &inputs)?;
        screen.remark(format!("simulating people on {}", import.origin().path().display()));
        let imported = import.import()?;
        tell(&imported, screen);
        let Imported { map, .. } = imported;
        let heat = Placed::new(*map.frame(), crowd_args::simulate(&map, &walks, screen)?);
        let name = import.origin().map_name();
        let picture = png::figure(&heat_picture(&heat), Scale::Linear, &name);
        let view = View::new(&name, &map).heat("", &heat).people(&map, &walks)?;
        let mut files = vec![(HEAT, heat.to_bytes()?), (MAP, map.to_bytes()?), (PICTURE, picture)];
        files.extend(view.file(PICTURE, screen));
        self.out.write(&files, screen)?;
        Ok(ExitCode::SUCCESS)
    }
}
