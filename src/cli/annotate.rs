//! `annotate`: a map of your own, without a pipeline.

use std::io::ErrorKind;
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use super::error::CliError;
use super::screen::Screen;
use crate::domain::annotate::{self as domain, AnnotateConfig, AnnotateFields, Normalize};
use crate::domain::map::{IGIBSON_IMAGE, ImportConfig};
use crate::domain::quantize::OBSTACLE;
use crate::kinds::{Checkpoint, Heat, Placed, SingleFile};
use crate::pipeline::stage::StageError;
use crate::report::bars::WorkBar;
use crate::report::picture::{Picture, Scale};
use crate::report::png;
use crate::stages::import_map::{ImportMap, Origin};
use crate::stages::{annotate, compute};
use crate::store::write_whole;

/// Arguments of `annotate`.
#[derive(Debug, clap::Args)]
#[command(
    after_help = "It writes `heat.parquet` (one row a cell: heat, class, probabilities), `heat.png`, and `map.parquet`.

Examples:
  trodden annotate my_map.yaml --model artifacts/latest/quickstart/model --out annotated
  trodden annotate plan.png --image-resolution 0.05 --model model --out annotated --mode exact --stride 1"
)]
pub struct Args {
    /// A ROS `map_server` YAML, an image (with --image-resolution), or the folder of an iGibson scene.
    map: PathBuf,
    /// Folder of a checkpoint, such as `artifacts/latest/quickstart/model`.
    #[arg(long)]
    model: PathBuf,
    /// Folder to write to.
    #[arg(long, short)]
    out: PathBuf,
    /// Edge of a pixel in meters, for a plain image.
    #[arg(long, value_name = "METERS")]
    image_resolution: Option<f64>,
    /// `dense`: the whole map at once; `exact`: sliding windows, as the paper has it [default: dense; exact with --stride].
    #[arg(long, value_enum)]
    mode: Option<ModeName>,
    /// Distance between neighboring windows in cells, for exact mode [default: 4].
    #[arg(long)]
    stride: Option<u32>,
    /// How many of the 64 offsets modulo 8 are averaged, for dense mode [default: 64].
    #[arg(long)]
    offsets: Option<u32>,
    /// Divide by the map's maximum.
    #[arg(long)]
    normalize: bool,
}

#[derive(Debug, Clone, Copy, clap::ValueEnum)]
enum ModeName {
    Exact,
    Dense,
}

impl Args {
    pub(super) fn run(&self, _: &Path, screen: &Screen) -> Result<ExitCode, CliError> {
        let config = self.config()?;
        let import = ImportConfig { image_resolution: self.image_resolution, ..ImportConfig::default() };
        let map = ImportMap::new(Origin::of(&self.map), import).map_err(|error| self.unreadable(error))?.import()?;
        let checkpoint = self.checkpoint()?;
        let compute = compute::open(config.device)?;
        let mut bar = WorkBar::new("annotate", screen.color());
        let mut progress = |done: usize, all: usize| {
            bar.advance(done, all);
            ControlFlow::Continue(())
        };
        let heat = Placed::new(*map.frame(), annotate::heat(&map, &checkpoint, &config, &compute, &mut progress)?);
        drop(bar);
        std::fs::create_dir_all(&self.out).map_err(|source| self.failed(&self.out, source))?;
        self.write("heat.parquet", &heat.to_bytes()?, screen)?;
        self.write("map.parquet", &map.to_bytes()?, screen)?;
        self.write("heat.png", &self.picture(&heat), screen)?;
        Ok(ExitCode::SUCCESS)
    }

    fn config(&self) -> Result<AnnotateConfig, CliError> {
        let mode = self.mode.map(|mode| match mode {
            ModeName::Exact => domain::ModeName::Exact,
            ModeName::Dense => domain::ModeName::Dense,
        });
        let normalize = if self.normalize { Normalize::Max } else { Normalize::None };
        let fields =
            AnnotateFields { mode, stride: self.stride, offsets: self.offsets, normalize, ..AnnotateFields::default() };
        let refused = |error| match annotate::advice(&error) {
            Some(advice) => CliError::advised(error.to_string(), advice),
            None => CliError::request(error.to_string()),
        };
        AnnotateConfig::try_from(fields).map_err(refused)
    }

    /// Says how a folder is read; that it lacks the file of a scene is puzzling if it was meant otherwise.
    fn unreadable(&self, error: StageError) -> CliError {
        if !(self.map.is_dir() && matches!(error, StageError::Source { .. })) {
            return error.into();
        }
        let folder = self.map.display();
        CliError::advised(
            format!("`{folder}` is no folder of an iGibson scene: it has no `{IGIBSON_IMAGE}`"),
            "for a map of ROS give its YAML file",
        )
    }

    fn checkpoint(&self) -> Result<Checkpoint, CliError> {
        let read = |name: &'static str| {
            let path = self.model.join(name);
            std::fs::read(&path).map_err(|source| match source.kind() {
                ErrorKind::NotFound | ErrorKind::NotADirectory => {
                    let what = format!("`{}` is no folder of a checkpoint: it has no `{name}`", self.model.display());
                    CliError::advised(what, "give that of a `train` node, such as `artifacts/latest/quickstart/model`")
                }
                _ => CliError::File { action: "read", path, source },
            })
        };
        // Read first, so that a missing file is named with its path.
        let mut files = std::collections::BTreeMap::new();
        for name in Checkpoint::FILES {
            files.insert(name, read(name)?);
        }
        Ok(Checkpoint::from_files(|name| Ok(files.remove(name).expect("read above")))?)
    }

    fn picture(&self, heat: &Placed<Heat>) -> Vec<u8> {
        let name = self.map.file_stem().unwrap_or(self.map.as_os_str()).to_string_lossy();
        let walls = heat.value.classes.map(|class| *class == OBSTACLE);
        let picture = Picture::values(heat.frame, heat.value.heat.clone(), Some(walls), "heat", None);
        png::figure(&picture, Scale::Linear, &name)
    }

    fn write(&self, name: &str, bytes: &[u8], screen: &Screen) -> Result<(), CliError> {
        let path = self.out.join(name);
        write_whole(&path, bytes).map_err(|source| self.failed(&path, source))?;
        screen.line(path.display().to_string())
    }

    fn failed(&self, path: &Path, source: std::io::Error) -> CliError {
        CliError::File { action: "write", path: path.to_owned(), source }
    }
}
