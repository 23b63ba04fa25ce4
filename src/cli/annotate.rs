//! `annotate`: a map of your own, without a pipeline.

use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use super::error::CliError;
use super::screen::Screen;
use super::{model_files, paths};
use crate::domain::annotate::{self as domain, AnnotateConfig, AnnotateFields, Mode, Normalize};
use crate::domain::map::{ImportConfig, Imported, MapImportError, Region, Survey};
use crate::kinds::{Checkpoint, Model, Placed, SingleFile};
use crate::pipeline::stage::Stage;
use crate::report::bars::WorkBar;
use crate::report::picture::{Scale, heat_picture};
use crate::report::png;
use crate::stages::import_map::{self, ImportMap};
use crate::stages::map_origin::Origin;
use crate::stages::{annotate, compute};
use crate::store::write_whole;

/// The files that it writes.
const HEAT: &str = "heat.parquet";
const MAP: &str = "map.parquet";
const PICTURE: &str = "heat.png";

/// Offsets that are averaged where a model says ranks and nothing else is asked for: one in each rotation and mirroring.
const RANKS_OFFSETS: u32 = 8;

/// Arguments of `annotate`.
#[derive(Debug, clap::Args)]
#[command(
    after_help = "It writes `heat.parquet` (one row a cell: heat, and what else the model says), `heat.png`, and `map.parquet`.

Maps of ROS are read as nav2 reads them, but for the gray value 205: `map_saver` writes it for unknown space, so it is unknown \
whatever the thresholds say.

Examples:
  trodden annotate my_map.yaml --out annotated
  trodden annotate plan.png --image-resolution 0.05 --out annotated
  trodden annotate Rs_int --floor 0 --region all --model artifacts/latest/quickstart/model --out annotated"
)]
pub struct Args {
    /// A ROS `map_server` YAML, an image (with --image-resolution), or the folder of an iGibson scene.
    map: PathBuf,
    /// Folder of a checkpoint, such as `artifacts/latest/quickstart/model` [default: the model that trodden brings].
    #[arg(long)]
    model: Option<PathBuf>,
    /// Folder to write to.
    #[arg(long, short)]
    out: PathBuf,
    /// `dense`: the whole map at once; `exact`: sliding windows, as the paper has it [default: dense; exact with --stride].
    #[arg(long, value_enum)]
    mode: Option<ModeName>,
    /// Distance between neighboring windows in cells, for exact mode [default: 4].
    #[arg(long)]
    stride: Option<u32>,
    /// How many of the offsets modulo the network's period are averaged, for dense mode, 1 to 64 [default: 64; 8 if the model
    /// says ranks].
    #[arg(long)]
    offsets: Option<u32>,
    /// Whether each offset sees the map in another rotation or mirroring, for dense mode [default: true].
    #[arg(long)]
    augment: Option<bool>,
    /// Divide by the map's maximum.
    #[arg(long)]
    normalize: bool,
    #[command(flatten)]
    import: ImportArgs,
}

/// How the map is read: what `files` and `igibson` of a pipeline file take too.
#[derive(Debug, clap::Args)]
#[command(next_help_heading = "How the map is read")]
struct ImportArgs {
    /// Edge of a pixel in meters, for a plain image.
    #[arg(long, value_name = "METERS")]
    image_resolution: Option<f64>,
    /// Brightness from which on a pixel is free, as a share of white, for a plain image [default: 0.5].
    #[arg(long, value_name = "SHARE")]
    threshold: Option<f64>,
    /// Occupancy up to which a pixel is free, instead of what the YAML of a map of ROS says.
    #[arg(long, value_name = "SHARE")]
    free_thresh: Option<f64>,
    /// Occupancy from which on a pixel is occupied, instead of what the YAML of a map of ROS says.
    #[arg(long, value_name = "SHARE")]
    occupied_thresh: Option<f64>,
    /// Black is free and white is occupied; `--negate=false` if the YAML of a map of ROS says so and is wrong.
    #[arg(long, value_name = "BOOL", num_args = 0..=1, default_missing_value = "true", require_equals = true)]
    negate: Option<bool>,
    /// Number of the floor, for an iGibson scene [default: 0, or the only one].
    #[arg(long, value_name = "NUMBER")]
    floor: Option<u32>,
    /// Edge of a cell of the result in meters; models are trained on cells of one size.
    #[arg(long, value_name = "METERS", default_value_t = ImportConfig::default().resolution)]
    resolution: f64,
    /// Which of separate regions of free floor are kept: `largest` (that is not outdoors), `all`, or the one at `x,y`, in
    /// meters in the frame of the map.
    #[arg(long, default_value = "largest", allow_hyphen_values = true)]
    region: Region,
}

impl ImportArgs {
    const fn config(&self) -> ImportConfig {
        ImportConfig {
            resolution: self.resolution,
            region: self.region,
            image_resolution: self.image_resolution,
            threshold: self.threshold,
            occupied_thresh: self.occupied_thresh,
            free_thresh: self.free_thresh,
            negate: self.negate,
            floor: self.floor,
        }
    }
}

#[derive(Debug, Clone, Copy, clap::ValueEnum)]
enum ModeName {
    Exact,
    Dense,
}

impl Args {
    pub(super) fn run(&self, _: &Path, screen: &Screen) -> Result<ExitCode, CliError> {
        let mut config = self.config()?;
        let import = self.importer()?;
        self.check_outputs(&import)?;
        let model = self.model.as_deref().map_or_else(|| Ok(Model::shipped()), model_files::read)?;
        if let (Mode::Dense { offsets, .. }, None, None) = (&mut config.mode, self.offsets, model.config.counts()) {
            *offsets = RANKS_OFFSETS;
        }
        let name = import.origin().map_name();
        screen.remark(format!("annotating {}", import.origin().path().display()));
        let mut bar = WorkBar::new("annotate", screen.color());
        let Imported { map, survey } = import.import()?;
        bar.said(|| screen.remark(said(&survey)));
        let compute = compute::open(config.device)?;
        let mut progress = |done: usize, all: usize| {
            bar.advance(done, all);
            ControlFlow::Continue(())
        };
        let heat = Placed::new(*map.frame(), annotate::heat(&map, &model, &config, &compute, &mut progress)?);
        drop(bar);
        std::fs::create_dir_all(&self.out).map_err(|source| self.failed(&self.out, source))?;
        self.write(HEAT, &heat.to_bytes()?, screen)?;
        self.write(MAP, &map.to_bytes()?, screen)?;
        self.write(PICTURE, &png::figure(&heat_picture(&heat), Scale::Linear, &name), screen)?;
        Ok(ExitCode::SUCCESS)
    }

    /// Finds the map; refuses options that it has no use for.
    fn importer(&self) -> Result<ImportMap, CliError> {
        let config = self.import.config();
        let origin = Origin::of(&self.map, &config)?;
        if let Some(field) = config.unfit(origin.form()).first() {
            let error = MapImportError::Unfit { field, form: origin.form() };
            let option = format!("`--{}` does not fit {}", field.replace('_', "-"), origin.form());
            return Err(match import_map::help(&error) {
                Some(help) => CliError::advised(option, help),
                None => CliError::request(option),
            });
        }
        Ok(ImportMap::new(origin, config)?)
    }

    /// Refuses to write where the map, the model or something of the store is, through whatever links.
    fn check_outputs(&self, import: &ImportMap) -> Result<(), CliError> {
        let mut inputs: Vec<PathBuf> = import.sources()?.into_iter().map(|source| source.path).collect();
        inputs.extend(self.model.iter().flat_map(|model| Checkpoint::FILES.map(|name| model.join(name))));
        for output in [HEAT, MAP, PICTURE].map(|name| self.out.join(name)) {
            let same = |input: &&PathBuf| paths::same_file(input, &output);
            if let Some(input) = inputs.iter().find(same) {
                let what = format!("`{}` would overwrite its source `{}`", output.display(), input.display());
                return Err(CliError::advised(what, "choose another folder with `--out`"));
            }
            if std::fs::symlink_metadata(&output).is_ok_and(|metadata| metadata.is_symlink()) {
                let what = format!("`{}` is a link to something else", output.display());
                return Err(CliError::advised(what, "remove it, or choose another folder with `--out`"));
            }
        }
        Ok(())
    }

    fn config(&self) -> Result<AnnotateConfig, CliError> {
        let mode = self.mode.map(|mode| match mode {
            ModeName::Exact => domain::ModeName::Exact,
            ModeName::Dense => domain::ModeName::Dense,
        });
        let normalize = if self.normalize { Normalize::Max } else { Normalize::None };
        let Self { stride, offsets, augment, .. } = *self;
        let fields = AnnotateFields { mode, stride, offsets, augment, normalize, ..AnnotateFields::default() };
        let refused = |error| match annotate::advice(&error) {
            Some(advice) => CliError::advised(error.to_string(), advice),
            None => CliError::request(error.to_string()),
        };
        AnnotateConfig::try_from(fields).map_err(refused)
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

/// Says what became of the free floor of the map, and how to have it otherwise.
fn said(survey: &Survey) -> String {
    let advice = if survey.is_odd() { "; `--region all` or `--region x,y` keeps other regions" } else { "" };
    let warning = if survey.is_odd() { "warning: " } else { "" };
    format!("{warning}{survey}{advice}")
}
