//! `sweep`: many variants of a pipeline in one run.

use std::process::ExitCode;

use super::error::CliError;
use super::run;
use super::screen::Screen;
use super::table::{TableArgs, print_study};
use super::upward::StorePlace;
use crate::pipeline::stage::Register;
use crate::store::Store;

/// Arguments of `sweep`.
#[derive(Debug, clap::Args)]
#[command(
    after_help = "What variants share is made once. The table at the end has a row for each of them; rows that differ in \
                  seeds alone are taken together. `trodden table` prints it again, in other forms too.

Values are separated by commas; `1..5` are the whole numbers from 1 to 5; what goes together is joined by `+`. A file may \
                  say the same under `sweep:`. What has a `=` is never taken for the file.

Examples:
  trodden sweep pipelines/quickstart.yaml labels.classes=3,4,5 model.seed=1..3
  trodden sweep labels.classes=3,4,5                           of the pipeline in this folder
  trodden sweep pipelines/quickstart.yaml crowd.radius=0.2,0.25,0.3 --dry-run
  trodden sweep study.yaml maps.train.fold.leave=0..4+maps.test.fold.take=0..4
  trodden sweep study.yaml model.learning_rate=0.001,0.003,0.01 tiles.size=32,64 --sample 4"
)]
pub struct Args {
    #[command(flatten)]
    run: run::Args,
    /// What varies: `labels.classes=3,4,5`, `model.seed=1..5`.
    #[arg(value_name = "PATH=VALUES")]
    axes: Vec<String>,
    /// Draw so many of the variants.
    #[arg(long, value_name = "N")]
    sample: Option<usize>,
    /// The seed of that draw.
    #[arg(long, value_name = "SEED", default_value_t = 0, requires = "sample")]
    sample_seed: u64,
}

impl Args {
    pub(super) fn run(&self, register: &Register, place: &StorePlace, screen: &Screen) -> Result<ExitCode, CliError> {
        let sample = self.sample.map(|count| (count, self.sample_seed));
        let pipeline = self.run.pipeline().load_swept(&self.axes, sample, register)?;
        if pipeline.variants.is_empty() {
            return Err(CliError::advised(
                "nothing varies",
                "say what does: `trodden sweep FILE labels.classes=3,4,5`, or `sweep:` in the file",
            ));
        }
        if !screen.json() {
            let (variants, nodes) = (pipeline.variants.len(), pipeline.nodes.len());
            screen.remark(format!("{variants} variants, {nodes} different nodes, chunks and steps not counted"));
        }
        let store = place.root_for(&pipeline.file);
        let (code, id) = self.run.run_pipeline(&pipeline, &store, screen)?;
        let Some(id) = id.filter(|_| !screen.json()) else { return Ok(code) };
        let store = Store::open_existing(&store)?;
        print_study(&store, &[store.run(&id)?], &TableArgs::default(), register, screen)?;
        Ok(code)
    }
}
