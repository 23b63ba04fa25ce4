//! `run`: runs a pipeline.

use std::path::Path;
use std::process::ExitCode;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use super::error::CliError;
use super::how::{HowArgs, bars};
use super::plan::print_plan;
use super::recheck::{self, CheckArgs};
use super::request::PipelineArgs;
use super::screen::Screen;
use super::selection::{NAMES, SelectionArgs};
use super::signals;
use super::spread::{SpreadArgs, spread};
use super::upward::StorePlace;
use crate::pipeline::execute::{Options, recheck};
use crate::pipeline::selection::Selection;
use crate::pipeline::spec::Pipeline;
use crate::pipeline::stage::Register;
use crate::store::Store;

/// Arguments of `run`.
#[derive(Debug, clap::Args)]
#[command(after_help = format!("{NAMES}

`--only` runs some nodes and what they need, and nothing else. `--until` runs everything but what lies behind some nodes: what does not hang on them runs, too. `--exclude` takes nodes and all that reads them out of either.

`--check` makes nodes again beside what is on record and compares the bits: an audit of whether stages are deterministic. It says which file, byte and column differ, replaces nothing and puts no run on record; what came out otherwise stays as an object until `trodden gc`.

Examples:
  trodden run pipelines/quickstart.yaml
  trodden run pipelines/quickstart.yaml --set walks.episodes=200 --set model.epochs=10
  trodden run pipelines/quickstart.yaml --only labels/home_03
  trodden run pipelines/quickstart.yaml --only '*/home_0?' --exclude walks/home_07
  trodden run pipelines/quickstart.yaml --until labels         not the windows and what follows
  trodden run pipelines/quickstart.yaml --force heat           again, although it is on record
  trodden run pipelines/quickstart.yaml --check 'labels/*'     do the same bits come out?
  trodden run pipelines/quickstart.yaml --check-sample 5%      the same for one in twenty
  trodden run pipelines/quickstart.yaml --json | jq -r 'select(.outcome == \"ran\") | .node'

Exit codes: 0 done, 1 a stage or a disk failed or other bits came out, 2 a bad request, 3 a damaged store, 130 interrupted."))]
pub struct Args {
    #[command(flatten)]
    pipeline: PipelineArgs,
    #[command(flatten)]
    selection: SelectionArgs,
    #[command(flatten)]
    check: CheckArgs,
    #[command(flatten)]
    how: HowArgs,
    /// Only show what would run.
    #[arg(long)]
    dry_run: bool,
    /// Mark the run, so that `gc` keeps what it reaches.
    #[arg(long)]
    keep: bool,
    #[command(flatten)]
    spread: SpreadArgs,
}

impl Args {
    pub(super) fn run(&self, register: &Register, place: &StorePlace, screen: &Screen) -> Result<ExitCode, CliError> {
        let pipeline = self.pipeline.load(register)?;
        Ok(self.run_pipeline(&pipeline, &place.root_for(&pipeline.file), screen)?.0)
    }

    /// Returns the pipeline that is asked for.
    pub(super) const fn pipeline(&self) -> &PipelineArgs {
        &self.pipeline
    }

    /// Runs a pipeline; returns the id of the run, too, unless it was only planned.
    pub(super) fn run_pipeline(
        &self,
        pipeline: &Pipeline,
        store: &Path,
        screen: &Screen,
    ) -> Result<(ExitCode, Option<String>), CliError> {
        let cancelled = Arc::new(AtomicBool::new(false));
        if self.spread.is_wanted() {
            let remote = self.how.need_remote(pipeline, &cancelled)?;
            signals::listen(&cancelled);
            let store = Store::open_until(store, &cancelled)?;
            let selection = Selection { elsewhere: true, ..(&self.selection).into() };
            let asked = (&self.how, self.dry_run, self.keep);
            return spread(&self.spread, asked, (pipeline, &selection), (&store, &remote), &cancelled, screen);
        }
        let remote = self.how.remote(pipeline, &cancelled)?;
        if self.dry_run {
            let selection = (&self.selection).into();
            return Ok((print_plan(pipeline, store, &selection, remote.as_ref(), screen)?, None));
        }
        signals::listen(&cancelled);
        let store = Store::open_until(store, &cancelled)?;
        let options = self.how.options((&self.selection).into(), remote.as_ref(), &cancelled)?;
        let Some(sample) = self.check.sample() else {
            let (code, id) = self.how.run(pipeline, &store, (&options, remote.as_ref()), self.keep, screen)?;
            return Ok((code, Some(id)));
        };
        let mut bars = bars(screen);
        let options = Options { keep_going: true, ..options };
        let report = recheck(pipeline, &store, &sample, &options, &mut |event| bars.hear(event))?;
        let code = recheck::finish(&report, &store, screen)?;
        bars.take_failure().map_or(Ok((code, None)), |failure| Err(CliError::output(failure)))
    }
}
