//! `annotate`: a map of your own, without a pipeline.

use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use super::crowd_args::{self, CrowdArgs};
use super::error::CliError;
use super::import_args::{ImportArgs, tell};
use super::model_files;
use super::out_folder::OutFolder;
use super::pages::{VIEW, View};
use super::screen::Screen;
use super::track_args::TrackArgs;
use crate::domain::annotate::{self as domain, AnnotateConfig, AnnotateFields, Normalize};
use crate::domain::map::{Imported, OccupancyMap};
use crate::kinds::{Checkpoint, Heat, Model, Placed, SingleFile};
use crate::pipeline::stage::Stage;
use crate::report::bars::WorkBar;
use crate::report::picture::{Picture, Scale, heat_picture};
use crate::report::png;
use crate::stages::{annotate, compute};

/// The files that it writes.
const HEAT: &str = "heat.parquet";
const SIMULATED: &str = "simulated.parquet";
const MAP: &str = "map.parquet";
const PICTURE: &str = "heat.png";

/// Arguments of `annotate`.
#[derive(Debug, clap::Args)]
#[command(
    after_help = "It writes `heat.parquet` (one row a cell: heat, and what else the model says), `heat.png`, `map.parquet`, and `view.html`, a page to look at it all closely; with `--by both` \
`simulated.parquet` besides.

Maps of ROS are read as nav2 reads them, but for the gray value 205: `map_saver` writes it for unknown space, so it is unknown \
whatever the thresholds say.

Examples:
  trodden annotate my_map.yaml --out annotated
  trodden annotate my_map.yaml --by both --out annotated
  trodden annotate plan.png --image-resolution 0.05 --out annotated
  trodden annotate plan.png --scale 120,80:620,80=12.5m --out annotated
  trodden annotate clinic.building.yaml --level L1 --out annotated
  trodden annotate my_map.yaml --tracks monday.csv tuesday.csv --columns id=2,time=1,x=3,y=4 --tracks-unit m --out annotated
  trodden annotate Rs_int --floor 0 --region all --model artifacts/latest/quickstart/model --out annotated"
)]
pub struct Args {
    /// A ROS `map_server` YAML, an image (with --image-resolution or --scale), the folder of an iGibson scene, or a floor plan: a
    /// `building.yaml` of Open-RMF, DXF, SVG, WKT or GeoJSON.
    map: PathBuf,
    /// Folder of a checkpoint, such as `artifacts/latest/quickstart/model` [default: the model that trodden brings].
    #[arg(long)]
    model: Option<PathBuf>,
    /// Who tells: the model, in moments, or people who are simulated on the map, in seconds; `both` shows them beside each
    /// other.
    #[arg(long, value_enum, default_value_t = By::Model)]
    by: By,
    #[command(flatten)]
    out: OutFolder,
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
    crowd: CrowdArgs,
    #[command(flatten)]
    import: ImportArgs,
    #[command(flatten)]
    tracks: Box<TrackArgs>,
}

/// Who tells where people walk.
#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
enum By {
    Model,
    Simulation,
    Both,
}

#[derive(Debug, Clone, Copy, clap::ValueEnum)]
enum ModeName {
    Exact,
    Dense,
}

impl Args {
    pub(super) fn run(&self, _: &Path, screen: &Screen) -> Result<ExitCode, CliError> {
        self.check_options()?;
        let (mut config, walks) = (self.config()?, self.crowd.walks()?);
        let import = self.import.importer(&self.map)?;
        let recording = self.tracks.config()?;
        let names: &[&str] =
            if self.by == By::Both { &[HEAT, SIMULATED, MAP, PICTURE, VIEW] } else { &[HEAT, MAP, PICTURE, VIEW] };
        let mut inputs: Vec<PathBuf> = import.sources()?.into_iter().map(|source| source.path).collect();
        inputs.extend_from_slice(self.tracks.files());
        inputs.extend(self.model.iter().flat_map(|model| Checkpoint::FILES.map(|name| model.join(name))));
        self.out.check(names, &inputs)?;
        let model = self.model.as_deref().map_or_else(|| Ok(Model::shipped()), model_files::read)?;
        annotate::settle(&mut config, self.offsets, &model);
        let name = import.origin().map_name();
        screen.remark(format!("annotating {}", import.origin().path().display()));
        let imported = import.import()?;
        tell(&imported, screen);
        let Imported { map, .. } = imported;
        let place = |heat| Placed::new(*map.frame(), heat);
        let seen = self.tracks.seen(&map, &recording, screen)?;
        let updated = |heat| Ok::<_, CliError>(place(self.tracks.update(&map, heat, seen.as_ref())?));
        let simulated = || updated(crowd_args::simulate(&map, &walks, screen)?);
        let predicted = || updated(predict(&map, &model, &config, screen)?);
        let figure = |picture: &Picture, title: &str| png::figure(picture, Scale::Linear, title);
        let (heat, besides, picture) = match self.by {
            By::Model | By::Simulation => {
                let heat = if self.by == By::Model { predicted()? } else { simulated()? };
                let picture = figure(&heat_picture(&heat), &name);
                (heat, None, picture)
            }
            By::Both => {
                let (heat, walked) = (predicted()?, simulated()?);
                let picture = heat_picture(&heat).beside(&heat_picture(&walked));
                let picture = figure(&picture, &format!("{name}: predicted, and simulated"));
                (heat, Some(walked), picture)
            }
        };
        let view = View::new(&name, &map);
        let view = match &besides {
            None => view.heat("", &heat),
            Some(walked) => view.heat("predicted", &heat).heat("simulated", walked),
        };
        let view = if self.by == By::Model { view } else { view.people(&map, &walks)? };
        let view = match seen {
            None => view,
            Some(seen) => view.recorded(&map, seen, self.tracks.files()),
        };
        let mut files = vec![(HEAT, heat.to_bytes()?)];
        if let Some(walked) = besides {
            files.push((SIMULATED, walked.to_bytes()?));
        }
        files.extend([(MAP, map.to_bytes()?), (PICTURE, picture)]);
        files.extend(view.file(PICTURE, screen));
        self.out.write(&files, screen)?;
        Ok(ExitCode::SUCCESS)
    }

    /// Refuses options that what is asked for has no use for.
    fn check_options(&self) -> Result<(), CliError> {
        let of_model = [
            (self.model.is_some(), "--model"),
            (self.mode.is_some(), "--mode"),
            (self.stride.is_some(), "--stride"),
            (self.offsets.is_some(), "--offsets"),
            (self.augment.is_some(), "--augment"),
            (self.normalize, "--normalize"),
        ];
        let (unfit, by, help) = match self.by {
            By::Model => (self.crowd.given(), "model", "write `--by simulation` or `--by both`"),
            By::Simulation => {
                let given = of_model.into_iter().find_map(|(given, name)| given.then_some(name));
                (given, "simulation", "write `--by model` or `--by both`")
            }
            By::Both => {
                (self.tracks.files().first().map(|_| "--tracks"), "both", "write `--by model` or `--by simulation`")
            }
        };
        let refuse = |option| Err(CliError::advised(format!("`{option}` does not fit `--by {by}`"), help));
        unfit.map_or(Ok(()), refuse)
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
}

/// Lets the model that trodden brings tell, as `annotate` does where nothing else is asked for, with a bar.
pub(super) fn predict_by_default(map: &OccupancyMap, screen: &Screen) -> Result<Heat, CliError> {
    let (mut config, model) = (AnnotateConfig::default(), Model::shipped());
    annotate::settle(&mut config, None, &model);
    predict(map, &model, &config, screen)
}

/// Lets a model tell, with a bar.
fn predict(map: &OccupancyMap, model: &Model, config: &AnnotateConfig, screen: &Screen) -> Result<Heat, CliError> {
    let compute = compute::open(config.device, config.simd)?;
    let mut bar = WorkBar::new("annotate", screen.bars());
    let mut progress = |done: usize, all: usize| {
        bar.advance(done, all);
        ControlFlow::Continue(())
    };
    Ok(annotate::heat(map, model, config, &compute, &mut progress)?)
}
